"""A run in a folder: a Zarr group of results, and a sealed marker for each block of particles.

zarr writes and reads the arrays (`spec`).

A block is finished when its marker is there: a small sealed file, written after the block's arrays,
that holds their SHA-256. A block without a marker, or whose arrays do not have these sums, is
followed again. So neither the moment at which a process ends nor damage to a file can change a
result.

`open_run` is the one way to read a finished run: whatever draws, exports or audits it goes through
there, and every number of the run is held to its checksum first.
"""

import hashlib
import json
import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import zarr

from fast import Ensemble, Paused
from mushrooms.progress import Watch, progress_bar
from mushrooms.store.spec import (
    FIELDS,
    SCHEMA,
    Array,
    RunSpec,
    Shape,
    columns,
    made_by,
    paused_of,
    shape_of,
    spec_of,
)
from mushrooms.store.summary import RunTally, tally_of
from scene import BadInput
from scene.files.writer import sealed, unsealed, write_file

GROUP = "ensemble.zarr"
MARKERS = "blocks"
DESCRIPTION = "run.marker"  # among the markers: the group's attributes once more, sealed
# What zarr raises of damaged metadata and chunks.
UNREADABLE = (
    ArithmeticError,
    AttributeError,
    LookupError,
    OSError,
    RuntimeError,
    TypeError,
    ValueError,
)


OURS = {"seal", "cycles_of_a_chunk"}  # attributes that no Zarr group of others has

DIGESTED = Ensemble._fields[1:-2]  # neither energy0 nor times


class BlockRange(NamedTuple):
    """The particles of a block that is to be followed.

    Attributes:
        number: of the block.
        first: number of its first particle.
        n: how many.
        before: their results after fewer cycles, from which they continue; None: from their starts.
    """

    number: int
    first: int
    n: int
    before: Paused | None = None


class Marker(NamedTuple):
    """The record of a finished block.

    Attributes:
        run, number: the run's identity, and the block's number.
        rows, cycles: how many particles it holds, and through how many cycles they were followed.
        sums: SHA-256 of each array's numbers.
        seconds: kernel time x threads [s].
    """

    run: str
    number: int
    rows: int
    cycles: int
    sums: dict[str, str]
    seconds: float


class StoredRun:
    """A run in a folder, which a writer must hold (`mushrooms.folders.locked`).

    Attributes:
        folder: holds GROUP, which xarray reads, and MARKERS.
        spec: all that decides its bits.
        shape: its sizes.
        command: how it is made.
        tally, seconds: of the finished blocks, once `check` has looked. A block that the run has
            outgrown, because it holds fewer particles or cycles than it has to, is not finished.
    """

    def __init__(self, folder: Path, spec: RunSpec, shape: Shape, command: str) -> None:
        self.folder = folder
        self.spec = spec
        self.shape = shape
        self.command = command
        self.tally = RunTally()
        self.seconds = 0.0
        self._markers: dict[int, Marker] = {}  # of the blocks on disk, those outgrown included
        self._arrays: dict[str, Any] = {}  # of the Zarr group, once it is open
        # The marker of another run, moved here with its files, does not count.
        self._identity = _digest({**spec.to_data(), "cycles": shape.chunked, "block": shape.block})

    def missing(self) -> Iterator[BlockRange]:
        """Yield the blocks still to be followed, each with what is on disk to continue from.

        Raises:
            BadInput: that has been damaged since `check`.
        """
        for block_range in self.lacking():
            marker = self._markers.get(block_range.number)
            is_continued = marker is not None and marker.rows == block_range.n
            yield block_range._replace(
                before=self.block(block_range.number) if is_continued else None
            )

    def lacking(self) -> Iterator[BlockRange]:
        """Yield the blocks still to be followed."""
        for number in range(self.shape.n_blocks):
            if not self._is_finished(number):
                yield BlockRange(number, number * self.shape.block, self.shape.rows(number))

    def _is_finished(self, number: int) -> bool:
        marker = self._markers.get(number)
        whole = self.shape.rows(number), self.shape.n_cycles
        return marker is not None and (marker.rows, marker.cycles) == whole

    def first_there(self) -> int | None:
        """Return the first block on disk, one with fewer cycles than the run before others."""
        whole = {
            number: marker.cycles == self.shape.n_cycles for number, marker in self._markers.items()
        }
        return min(whole, key=lambda number: (whole[number], number), default=None)

    def block(self, number: int, most: int | None = None) -> Paused:
        """Return the particles of a block, or the first ones, with as many cycles as it has.

        Raises:
            BadInput: it is missing or damaged.
        """
        arrays = {name: self.read(number, name)[:most] for name in self.shape.names}
        return paused_of(arrays, self.spec.energy, self._markers[number].seconds)

    def check(self) -> list[int]:
        """Read every block, count the whole ones, and return the damaged ones."""
        damaged = []
        for pattern in (
            ".*.part",
            "*.partial",
        ):  # what we, or zarr, were writing when the process ended
            for path in self.folder.rglob(pattern):
                path.unlink(missing_ok=True)
        if is_run(self.folder) and not self._is_open():
            self.describe()
        for number in range(self.shape.n_blocks):
            if self._path(number).exists():
                try:
                    self._markers[number] = self._marker(number)
                    self._count(self._markers[number], tally_of(self.block(number).ensemble))
                except BadInput:
                    self._markers.pop(number, None)
                    damaged.append(number)
        return damaged

    def keep(self, block_range: BlockRange, block: Paused) -> None:
        """Write a block: first its arrays, then its marker.

        Raises:
            OSError: it could not be written; the run is as it was without it.
        """
        if not self._arrays:
            self.describe()
        number, first, n, before = block_range
        arrays = {name: array for name, array in columns(block).items() if name in self.shape.names}
        there = 0 if before is None else before.ensemble.cycle_energies.shape[1]
        for name, array in arrays.items():
            rows = self._arrays[name]
            if there and "cycle" in FIELDS[name].dims:  # the chunks of earlier cycles stay
                rows[first : first + n, there:] = array[:, there:]
            else:
                rows[first : first + n] = array
        sums = {name: _sum(array) for name, array in arrays.items()}
        seconds = block.ensemble.seconds * block.ensemble.threads
        marker = Marker(self._identity, number, n, self.shape.n_cycles, sums, seconds)
        write_file(self._path(number), sealed(json.dumps(marker._asdict()).encode()))
        self._count(marker, tally_of(block.ensemble))

    def describe(self) -> None:
        """Write the metadata of the group and of its arrays; chunks that are there stay."""
        (self.folder / MARKERS).mkdir(exist_ok=True)
        attributes = {
            **self.spec.to_data(),
            "particles": self.shape.n_particles,
            "block": self.shape.block,
            "cycles_of_a_chunk": self.shape.chunked,
            "command": self.command,
            **made_by(),
        }
        write_file(self.folder / MARKERS / DESCRIPTION, sealed(json.dumps(attributes).encode()))
        for path in (self.folder / GROUP).rglob("zarr.json"):
            path.unlink()
        attributes["seal"] = _digest(attributes)
        group = zarr.create_group(self.folder / GROUP, attributes=attributes)
        for name in self.shape.names:
            field = FIELDS[name]
            self._arrays[name] = group.create_array(
                name,
                shape=self.shape.of(name, self.shape.n_particles, self.shape.n_cycles),
                chunks=self.shape.of(name, self.shape.block, self.shape.chunked),
                dtype=field.kind,
                fill_value=np.nan if field.kind == "float64" else -1,
                compressors=None,
                dimension_names=field.dims,
                attributes={"long_name": field.meaning},
            )
        with warnings.catch_warnings():
            # It is no part of Zarr 3 yet: xarray warns without it, and zarr with it.
            warnings.filterwarnings("ignore", "Consolidated metadata")
            zarr.consolidate_metadata(self.folder / GROUP)

    def read(self, number: int, name: str) -> Array:
        """Return one array of a block.

        Raises:
            BadInput: it is missing or damaged.
        """
        marker = self._markers.get(number)
        begin = number * self.shape.block
        if marker is not None and self._is_open():
            with suppress(*UNREADABLE):
                array = np.asarray(self._arrays[name][begin : begin + marker.rows])
                array = array[:, : marker.cycles] if "cycle" in FIELDS[name].dims else array
                if _sum(array) == marker.sums[name]:
                    return array
        raise self._damaged(number)

    def load(self, on_progress: Callable[[int, int], None]) -> None:
        """Count the blocks of a finished run, each array of which is as it was written.

        Args:
            on_progress: called with the number of particles that are checked, and with that of all.

        Raises:
            BadInput: particles are missing, or a block is damaged.
        """
        for number in range(self.shape.n_blocks):
            if self._path(number).exists():
                marker = self._marker(number)
                self._count(marker, RunTally(particles=marker.rows))
        if any(self.lacking()):
            there = self.tally.particles
            n = self.shape.n_particles
            raise BadInput(
                f"run {str(self.folder)!r} has {there} of {n} particles: go on with {self.command}"
            )
        for number in range(self.shape.n_blocks):
            on_progress(number * self.shape.block, self.shape.n_particles)
            for name in self.shape.names:
                self.read(number, name)

    def part(self, number: int, name: str) -> Array:
        """Return a field of `fast.Ensemble` for the particles of a block.

        Its bytes are the same.
        """
        if name == "energy":
            return self.read(number, "cycle_energies")[:, -1]
        if name == "n_collisions":
            return np.asarray(self.read(number, "wall_counts").sum(axis=1))
        return self.read(number, name) if name in self.shape.names else np.empty(0)

    def sha256(self) -> str:
        """Return `fast.Ensemble.sha256` of all particles, block by block: memory stays bounded.

        It goes field by field over all particles, so that blocks of any size come to the same.

        Raises:
            BadInput: a block is missing or damaged.
        """
        digest = hashlib.sha256()
        for name in DIGESTED:
            for number in range(self.shape.n_blocks):
                digest.update(np.ascontiguousarray(self.part(number, name)).data)
        return digest.hexdigest()

    def gains(self) -> Iterator[Array]:
        """Yield (n, K) ln(E/E0) after each cycle of those that take part, block by block."""
        for number in range(self.shape.n_blocks):
            takes_part = self.read(number, "takes_part") == 1
            with np.errstate(divide="ignore"):
                yield np.log(self.read(number, "cycle_energies")[takes_part] / self.spec.energy)

    def ensemble(self, n: int) -> Ensemble:
        """Return the first n particles as `fast.simulate` would, to the bit; times are their share.

        Raises:
            BadInput: a block is missing or damaged.
        """
        numbers = range(-(-n // self.shape.block))
        arrays = {
            name: np.concatenate([self.read(k, name) for k in numbers])[:n]
            for name in self.shape.names
        }
        seconds = self.seconds * n / max(self.tally.particles, 1)
        return paused_of(arrays, self.spec.energy, seconds).ensemble

    def _count(self, marker: Marker, tally: RunTally) -> None:
        self._markers[marker.number] = marker
        if self._is_finished(marker.number):
            self.tally = RunTally(*(a + b for a, b in zip(self.tally, tally, strict=True)))
            self.seconds += marker.seconds

    def _path(self, number: int) -> Path:
        return self.folder / MARKERS / f"{number}.marker"

    def _damaged(self, number: int) -> BadInput:
        where = f"block {number} of {str(self.folder / GROUP)!r}"
        return BadInput(f"{where} is missing or damaged: mushrooms simulate --resume mends it")

    def _marker(self, number: int) -> Marker:
        """Return the marker of a block from the disk.

        Raises:
            BadInput: there is none of this run, or none that is whole.
        """
        content = unsealed(self._path(number))
        data = {} if content is None else json.loads(content)
        if (data.get("run"), data.get("number")) == (self._identity, number):
            marker = Marker(**data)
            if marker.rows <= self.shape.rows(number) and marker.cycles <= self.shape.n_cycles:
                return marker
        raise self._damaged(number)

    def _is_open(self) -> bool:
        """Open the arrays if they are not; tell whether their metadata can be read."""
        if not self._arrays:
            with suppress(*UNREADABLE):
                group = zarr.open_group(self.folder / GROUP, mode="r+")
                self._arrays = {name: group[name] for name in self.shape.names}
        return bool(self._arrays)


def _sum(array: Array) -> str:
    return hashlib.sha256(np.ascontiguousarray(array).data).hexdigest()


def _digest(data: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()


def is_run(folder: Path) -> bool:
    """Tell whether a folder holds a run, damaged or not."""
    return (folder / MARKERS / DESCRIPTION).is_file() or (folder / GROUP / "zarr.json").is_file()


def attributes_of(folder: Path) -> dict[str, Any]:
    """Return a stored run's description: the sealed file, or if damaged the group's attributes.

    Raises:
        BadInput: the folder holds no run, or both are damaged.
    """
    content = unsealed(folder / MARKERS / DESCRIPTION)
    described = {} if content is None else dict(json.loads(content))
    if "schema" in described:  # else it is another sealed file, in the wrong place
        return described
    with suppress(*UNREADABLE):
        found = dict(zarr.open_group(folder / GROUP, mode="r").attrs)
        if found.pop("seal", None) == _digest(found):
            return found
    why = "its description is damaged"
    if not is_run(folder):
        why = f"it holds no {GROUP}: nothing was stored there by mushrooms simulate --out"
    raise BadInput(f"run {str(folder)!r}: {why}")


def open_run(folder: Path) -> StoredRun:
    """Return a finished run, to be read: all of it is as it was written.

    Raises:
        BadInput: the folder holds none, one of another schema, one that is not finished, or a
            damaged one.
    """
    found = attributes_of(folder)
    if found["schema"] != SCHEMA:
        raise BadInput(
            f"run {str(folder)!r}: schema = {found['schema']} there, {SCHEMA} is read here"
        )
    spec = spec_of(found)
    shape = shape_of(spec, found["particles"], found["block"], found["cycles_of_a_chunk"])
    run = StoredRun(folder, spec, shape, found["command"])
    with progress_bar() as bar:
        run.load(Watch(bar, f"checking {folder}", "particles").update)
    return run


def folder_of(path: Path) -> Path | None:
    """Return the folder of the run that a path is, or has a Zarr group of; None if it is none.

    Raises:
        BadInput: it is a group of ours without the checksums beside it.
    """
    for folder in (path, path.parent):
        if path in (folder, folder / GROUP) and any((folder / MARKERS).glob("*.marker")):
            return folder
    group = path / GROUP if (path / GROUP).is_dir() else path
    names: set[str] = set()
    with suppress(*UNREADABLE):
        names = set(zarr.open_group(group, mode="r").attrs)
    if OURS & names:
        where = str(group.parent / MARKERS)
        raise BadInput(f"run {str(path)!r}: its checksums, the folder {where!r}, are missing")
    return None
