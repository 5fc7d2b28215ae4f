"""A run in a folder: a Zarr group of results, and a sealed marker for each block of particles.

zarr writes and reads the arrays (`layout`).

A block is finished when its marker is there: a small sealed file, written after the block's arrays, that
holds their SHA-256. A block without a marker, or whose arrays do not have these sums, is followed again. So
neither the moment at which a process ends nor damage to a file can change a result.
"""

from __future__ import annotations

import hashlib
import json
import warnings
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import zarr

from conformance.files import sealed, unsealed, write_file
from fast import Ensemble
from mushrooms.store.layout import FIELDS, Array, Arrays, Shape, shape_of
from mushrooms.store.progress import RunTally, tally_of
from mushrooms.store.spec import SCHEMA, RunSpec, made_by, spec_of
from scene.refusal import BadInput

GROUP, MARKERS = "ensemble.zarr", "blocks"
DESCRIPTION = "run.marker"  # among the markers: the group's attributes once more, sealed
# What zarr raises of damaged metadata and chunks.
UNREADABLE = (ArithmeticError, AttributeError, LookupError, OSError, RuntimeError, TypeError, ValueError)


DIGESTED = Ensemble._fields[1:-2]  # neither energy0 nor times


class BlockRange(NamedTuple):
    """Particles that are to be followed: a block, or what a block lacks.

    Attributes:
        number: of the block.
        first: number of the first particle.
        n: how many.
        before: results of the first of them after fewer cycles; they go on from there.
    """

    number: int
    first: int
    n: int
    before: Block | None = None


class Block(NamedTuple):
    """Results of the particles of a block, or of a part of one.

    Attributes:
        arrays: as stored.
        seconds: kernel time x threads [s].
    """

    arrays: Arrays
    seconds: float

    @property
    def tally(self) -> RunTally:
        """Count what became of the particles."""
        return tally_of(self.arrays)

    def joined(self, rest: Block) -> Block:
        """Return this block with more particles behind its own."""
        arrays = {name: np.concatenate([array, rest.arrays[name]]) for name, array in self.arrays.items()}
        return Block(arrays, self.seconds + rest.seconds)


class Marker(NamedTuple):
    """The record of a finished block.

    Attributes:
        run, number: the run's identity, and the block's number.
        rows, cycles: how many particles it holds, and through how many cycles they were followed.
        sums: SHA-256 of each array's numbers.
        seconds: see `Block`.
    """

    run: str
    number: int
    rows: int
    cycles: int
    sums: dict[str, str]
    seconds: float


class StoredRun:
    """A run in a folder, which whoever writes must hold (`mushrooms.output.locked`).

    Attributes:
        folder: holds GROUP, which xarray reads, and MARKERS.
        spec: all that decides its bits.
        shape: its sizes.
        command: how it is made.
        tally, seconds: of the blocks that are there, once `check` has looked; without those that hold
            fewer cycles.
    """

    def __init__(self, folder: Path, spec: RunSpec, shape: Shape, command: str) -> None:
        self.folder, self.spec, self.shape, self.command = folder, spec, shape, command
        self.tally, self.seconds = RunTally(), 0.0
        self._rows: dict[int, int] = {}  # particles that are there, by block
        self._shorter: dict[int, int] = {}  # blocks that are there with fewer cycles, and how many
        self._arrays: dict[str, Any] = {}  # of the Zarr group, once it is open
        # The marker of another run, left here by someone who moved files, does not count.
        sizes = {"cycles": shape.chunked, "block": shape.block}
        self._identity = _digest(spec.to_data() | sizes)

    def missing(self) -> Iterator[BlockRange]:
        """Yield what is still to be followed, with what is there of it.

        Raises:
            BadInput: that has been damaged since `check`.
        """
        for piece in self.lacking():
            yield piece._replace(before=self.block(piece.number)) if piece.number in self._shorter else piece

    def lacking(self) -> Iterator[BlockRange]:
        """Yield what is still to be followed."""
        for number in range(self.shape.n_blocks):
            there = self._rows.get(number, 0)
            if there < self.shape.rows(number):
                yield BlockRange(number, number * self.shape.block + there, self.shape.rows(number) - there)

    @property
    def cycles_there(self) -> int:
        """Return how many cycles have been followed of all that is missing."""
        return min((self._shorter.get(piece.number, 0) for piece in self.lacking()), default=0)

    def first_there(self) -> int | None:
        """Return the first block that is there, one of fewer cycles before others."""
        return min(self._shorter or self._rows, default=None)

    def block(self, number: int) -> Block:
        """Return a block, with as many cycles as it has.

        Raises:
            BadInput: it is missing or damaged.
        """
        arrays = {name: self.read(number, name) for name in self.shape.names}
        return Block(arrays, self._found(number).seconds)

    def check(self) -> list[int]:
        """Read every block, count those that are as they were written, and return the damaged ones."""
        damaged = []
        self._rows, self._shorter, self.tally, self.seconds = {}, {}, RunTally(), 0.0
        for pattern in (".*.part", "*.partial"):  # what we, or zarr, were writing when the process ended
            for path in self.folder.rglob(pattern):
                path.unlink(missing_ok=True)
        if is_run(self.folder) and not self._is_open():
            self.describe()
        for number in range(self.shape.n_blocks):
            if self._path(number).exists():
                try:
                    block = self.block(number)
                    self._count(self._found(number), block.tally)
                except BadInput:
                    damaged.append(number)
        return damaged

    def keep(self, piece: BlockRange, block: Block) -> None:
        """Write a block: first its arrays, then its marker.

        Raises:
            OSError: it could not be written; the run is as it was without it.
        """
        if not self._arrays:
            self.describe()
        there, whole, first_cycle = self._rows.get(piece.number, 0), block, 0
        if there:  # the run was widened: the block gets more particles
            whole = self.block(piece.number).joined(block)
        marker = self._marker(piece.number)
        rows = there + piece.n
        if piece.before is not None and marker is not None and marker.rows == rows:
            first_cycle = marker.cycles  # these are on the disk, and stay as they are
        begin = piece.number * self.shape.block
        for name in self.shape.names:
            array, values = self._arrays[name], whole.arrays[name]
            if rows < self.shape.rows(piece.number):  # else zarr would read the rest, which may be damaged
                array[begin : begin + self.shape.block] = array.fill_value
            if "cycle" in FIELDS[name].dims:
                array[begin : begin + rows, first_cycle:] = values[:, first_cycle:]
            else:
                array[begin : begin + rows] = values
        sums = {name: _sum(whole.arrays[name]) for name in self.shape.names}
        marker = Marker(self._identity, piece.number, rows, self.shape.n_cycles, sums, whole.seconds)
        write_file(self._path(piece.number), sealed(json.dumps(marker._asdict()).encode()))
        self._count(marker._replace(seconds=block.seconds), block.tally)

    def describe(self) -> None:
        """Write the metadata of the group and of its arrays; chunks that are there stay."""
        (self.folder / MARKERS).mkdir(exist_ok=True)
        sizes = {"particles": self.shape.n_particles, "block": self.shape.block}
        sizes |= {"cycles_of_a_chunk": self.shape.chunked}
        attributes = self.spec.to_data() | sizes | {"command": self.command} | made_by()
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
        marker, dims = self._found(number), FIELDS[name].dims
        begin = number * self.shape.block
        array = np.empty(0)
        if self._is_open():
            with suppress(*UNREADABLE):
                array = np.asarray(self._arrays[name][begin : begin + marker.rows])
                array = array[:, : marker.cycles] if "cycle" in dims else array
        if _sum(array) != marker.sums[name]:
            raise self._damaged(number)
        return array

    def load(self) -> None:
        """Count the blocks by their markers alone: what is read later is checked then.

        Raises:
            BadInput: particles are missing.
        """
        for number in range(self.shape.n_blocks):
            marker = self._marker(number)
            if marker is not None:
                self._count(marker, RunTally(particles=marker.rows))
        if any(self.lacking()):
            there, n = self.tally.particles, self.shape.n_particles
            raise BadInput(
                f"run {str(self.folder)!r} has {there} of {n} particles: go on with {self.command}"
            )

    def part(self, number: int, name: str) -> Array | None:
        """Return a field of `fast.Ensemble` for the particles of a block; None where it holds nothing."""
        if name == "energy":
            return self.read(number, "cycle_energies")[:, -1]
        if name == "n_collisions":
            return np.asarray(self.read(number, "wall_counts").sum(axis=1))
        if name not in self.shape.names:
            return None
        array = self.read(number, name)
        return array.astype(bool) if name == "phase_captured" else array

    def sha256(self) -> str:
        """Return `fast.Ensemble.sha256` of all particles, block by block: memory does not grow with the run.

        It goes field by field over all particles, so that blocks of any size come to the same.

        Raises:
            BadInput: a block is missing or damaged.
        """
        digest = hashlib.sha256()
        for name in DIGESTED:
            for number in range(self.shape.n_blocks):
                array = self.part(number, name)
                if array is not None:
                    digest.update(np.ascontiguousarray(array).data)
        return digest.hexdigest()

    def gains(self) -> Iterator[Array]:
        """Yield (n, K) ln(E/E0) after each cycle of those who take part, block by block."""
        for number in range(self.shape.n_blocks):
            takes_part = self.read(number, "takes_part") == 1
            with np.errstate(divide="ignore"):
                yield np.log(self.read(number, "cycle_energies")[takes_part] / self.spec.energy)

    def ensemble(self, n: int) -> Ensemble:
        """Return the first n particles as `fast.simulate` would, to the bit; times are their share.

        Raises:
            BadInput: a block is missing or damaged.
        """
        n_blocks, fields = -(-n // self.shape.block), dict[str, Any]()
        for name in DIGESTED:
            parts = [array for number in range(n_blocks) if (array := self.part(number, name)) is not None]
            fields[name] = np.concatenate(parts)[:n] if parts else np.zeros((n, self.shape.n_cycles, 0))
        seconds = self.seconds * n / max(self.tally.particles, 1)
        return Ensemble(energy0=self.spec.energy, seconds=seconds, threads=1, **fields)

    def _count(self, marker: Marker, tally: RunTally) -> None:
        if marker.cycles < self.shape.n_cycles:
            self._shorter[marker.number] = marker.cycles
            return
        self._shorter.pop(marker.number, None)
        self._rows[marker.number] = marker.rows
        self.tally, self.seconds = self.tally.merged(tally), self.seconds + marker.seconds

    def _path(self, number: int) -> Path:
        return self.folder / MARKERS / f"{number}.marker"

    def _damaged(self, number: int) -> BadInput:
        where = f"block {number} of {str(self.folder / GROUP)!r}"
        return BadInput(f"{where} is missing or damaged: mushrooms simulate --resume mends it")

    def _found(self, number: int) -> Marker:
        """Return the marker of a block, or raise BadInput."""
        marker = self._marker(number)
        if marker is None:
            raise self._damaged(number)
        return marker

    def _marker(self, number: int) -> Marker | None:
        """Return the marker of a block; None where there is none of this run, or none that is whole."""
        content = unsealed(self._path(number))
        data = {} if content is None else json.loads(content)
        if (data.get("run"), data.get("number")) != (self._identity, number):
            return None
        marker = Marker(**data)
        is_larger = marker.rows > self.shape.rows(number) or marker.cycles > self.shape.n_cycles
        return None if is_larger else marker

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
    """Return the description of a stored run: the sealed file, or if that is damaged the group's attributes.

    Raises:
        BadInput: the folder holds no run, or both are damaged.
    """
    content = unsealed(folder / MARKERS / DESCRIPTION)
    if content is not None:
        return dict(json.loads(content))
    try:
        found = dict(zarr.open_group(folder / GROUP, mode="r").attrs)
        if found.pop("seal", None) == _digest(found):
            return found
    except UNREADABLE:
        pass
    why = "its description is damaged" if is_run(folder) else f"it holds no {GROUP}"
    raise BadInput(f"run {str(folder)!r}: {why}")


def open_run(folder: Path) -> StoredRun:
    """Return a finished run, to be read.

    Raises:
        BadInput: the folder holds none, one of another schema, or one that is not finished.
    """
    found = attributes_of(folder)
    if found["schema"] != SCHEMA:
        raise BadInput(f"run {str(folder)!r}: schema = {found['schema']} there, {SCHEMA} is read here")
    spec = spec_of(found)
    shape = shape_of(spec, found["particles"], found["block"], found["cycles_of_a_chunk"])
    run = StoredRun(folder, spec, shape, found["command"])
    run.load()
    return run
