"""A run's blocks, in a folder or in memory: written whole, read with their checksums, found after a fault.

A block is there when its marker is: a small sealed file, written after the block's chunks are on the disk,
that holds their SHA-256 and the block's tally. What has no marker, or is not what its marker says, is
followed anew. So it does not matter when a process ends, nor what a disk does to a file.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np

from conformance.files import sealed, unsealed, write_file, write_files
from mushrooms.store.asked import SCHEMA, Asked, asked_of, made_by
from mushrooms.store.layout import LANES, Array, Arrays, Shape, from_chunks, metadata, to_chunks
from mushrooms.store.tally import RunTally, tally_from
from scene.refusal import BadInput

GROUP, MARKERS = "ensemble.zarr", "blocks"
DESCRIPTION = "run.marker"  # among the markers: the group's attributes once more, sealed


class Piece(NamedTuple):
    """Particles that are to be followed: a block, or what a block lacks.

    Attributes:
        number: of the block.
        first: number of the first particle.
        n: how many.
        before: what became of the first of them through fewer cycles; they go on from there.
    """

    number: int
    first: int
    n: int
    before: Block | None = None


class Block(NamedTuple):
    """What became of the particles of a block, or of a part of one.

    Attributes:
        arrays: as stored.
        tally: of them.
        seconds: kernel time x threads [s].
    """

    arrays: Arrays
    tally: RunTally
    seconds: float

    def joined(self, rest: Block) -> Block:
        """Return this block with more particles behind its own."""
        arrays = {name: np.concatenate([array, rest.arrays[name]]) for name, array in self.arrays.items()}
        return Block(arrays, self.tally.merged(rest.tally), self.seconds + rest.seconds)


class AnyRun(Protocol):
    """Where blocks are kept."""

    shape: Shape
    tally: RunTally
    seconds: float

    @property
    def cycles_there(self) -> int:
        """Return how many cycles have been followed of all that is missing."""

    def missing(self) -> Iterator[Piece]:
        """Yield what is still to be followed."""

    def keep(self, piece: Piece, block: Block) -> None:
        """Keep what was followed."""

    def read(self, number: int, name: str) -> Array:
        """Return one array of a block."""


class RunInMemory:
    """A run that is kept nowhere else; see `AnyRun`."""

    cycles_there = 0

    def __init__(self, shape: Shape) -> None:
        self.shape, self.tally, self.seconds = shape, RunTally(), 0.0
        self._blocks: dict[int, Arrays] = {}

    def missing(self) -> Iterator[Piece]:
        """Yield what is still to be followed."""
        for number in range(self.shape.n_blocks):
            yield Piece(number, number * self.shape.block, self.shape.rows(number))

    def keep(self, piece: Piece, block: Block) -> None:
        """Keep what was followed."""
        self._blocks[piece.number] = {name: a for name, a in block.arrays.items() if name != LANES}
        self.tally, self.seconds = self.tally.merged(block.tally), self.seconds + block.seconds

    def read(self, number: int, name: str) -> Array:
        """Return one array of a block."""
        return self._blocks[number][name]


class Marker(NamedTuple):
    """What says that a block is there.

    Attributes:
        rows, cycles: how many particles it holds, and through how many cycles they were followed.
        sums: SHA-256 of each chunk, by its path.
        tally, seconds: see `Block`.
    """

    rows: int
    cycles: int
    sums: dict[str, str]
    tally: RunTally
    seconds: float


class RunFolder:
    """A run in a folder; see `AnyRun`. Whoever writes must hold the folder (`mushrooms.output.locked`).

    Attributes:
        folder: holds GROUP, which xarray reads, and MARKERS.
        asked: what decides its bits.
        shape: its sizes.
        command: how it is made.
        tally, seconds: of the blocks that are there, once `check` has looked; without those that hold
            fewer cycles.
    """

    def __init__(self, folder: Path, asked: Asked, shape: Shape, command: str) -> None:
        self.folder, self.asked, self.shape, self.command = folder, asked, shape, command
        self.tally, self.seconds = RunTally(), 0.0
        self._rows: dict[int, int] = {}  # particles that are there, by block
        self._shorter: dict[int, int] = {}  # blocks that are there with fewer cycles, and how many
        self._is_described = False
        # A marker of another run, left in the folder by whoever moved files, is none of this one.
        sizes = {"cycles": shape.chunked, "block": shape.block}
        identity = json.dumps(asked.to_data() | sizes, sort_keys=True)
        self._identity = hashlib.sha256(identity.encode()).hexdigest()

    def missing(self) -> Iterator[Piece]:
        """Yield what is still to be followed, with what is there of it.

        Raises:
            BadInput: that has been damaged since `check`.
        """
        for piece in self.lacking():
            yield piece._replace(before=self.block(piece.number)) if piece.number in self._shorter else piece

    def lacking(self) -> Iterator[Piece]:
        """Yield what is still to be followed."""
        for number in range(self.shape.n_blocks):
            there = self._rows.get(number, 0)
            if there < self.shape.rows(number):
                yield Piece(number, number * self.shape.block + there, self.shape.rows(number) - there)

    @property
    def cycles_there(self) -> int:
        """Return how many cycles have been followed of all that is missing."""
        return min((self._shorter.get(piece.number, 0) for piece in self.lacking()), default=0)

    def first_there(self) -> int | None:
        """Return the first block of which anything is there, one of fewer cycles before others."""
        return min(self._shorter or self._rows, default=None)

    def block(self, number: int) -> Block:
        """Return what is there of a block.

        Raises:
            BadInput: it is not there, or not as it was written.
        """
        arrays = {name: self.read(number, name) for name in self.shape.names}
        marker = self._marker(number)
        assert marker is not None
        return Block(arrays, marker.tally, marker.seconds)

    def check(self) -> list[int]:
        """Look at every block, count those that are as they were written, and return the damaged ones."""
        damaged = []
        self._rows, self._shorter, self.tally, self.seconds = {}, {}, RunTally(), 0.0
        for path in self.folder.rglob(".*.part"):  # what a process was writing when it ended
            path.unlink(missing_ok=True)
        for number in range(self.shape.n_blocks):
            marker = self._marker(number)
            if marker is not None and all(self._chunks(number, name, marker) for name in self.shape.names):
                self._count(number, marker)
            elif self._path(number).exists():
                damaged.append(number)
        return damaged

    def keep(self, piece: Piece, block: Block) -> None:
        """Write a block: first its chunks, then its marker.

        Raises:
            OSError: it could not be written; the run is as it was without it.
        """
        if not self._is_described:
            self.describe()
        there, whole, written = self._rows.get(piece.number, 0), block, dict[str, str]()
        if there:  # the run was widened: the block gets more particles
            whole = self.block(piece.number).joined(block)
        old = self._marker(piece.number)
        if piece.before is not None and old is not None:  # first cycles that are full stay as they are
            written = old.sums
        chunks: dict[str, memoryview] = {}
        for name in self.shape.names:
            paths = self.shape.chunks(name, piece.number, self.shape.n_cycles)
            chunks |= zip(paths, to_chunks(whole.arrays[name], self.shape, name), strict=True)
        sums = {path: hashlib.sha256(content).hexdigest() for path, content in chunks.items()}
        write_files(
            self.folder / GROUP, {path: chunks[path] for path in chunks if sums[path] != written.get(path)}
        )
        marker = Marker(there + piece.n, self.shape.n_cycles, sums, whole.tally, whole.seconds)
        data = {"run": self._identity, "number": piece.number, **marker._asdict()}
        data["tally"] = whole.tally.to_data()
        write_file(self._path(piece.number), sealed(json.dumps(data).encode()))
        self._count(piece.number, marker._replace(tally=block.tally, seconds=block.seconds))

    def describe(self) -> None:
        """Write what the group's arrays are, and what the run was asked for."""
        (self.folder / MARKERS).mkdir(exist_ok=True)
        for name in self.shape.names:
            (self.folder / GROUP / name).mkdir(parents=True, exist_ok=True)
        sizes = {"particles": self.shape.n_particles, "block": self.shape.block}
        sizes |= {"cycles_of_a_chunk": self.shape.chunked}
        attributes = self.asked.to_data() | sizes | {"command": self.command} | made_by()
        write_file(self.folder / MARKERS / DESCRIPTION, sealed(json.dumps(attributes).encode()))
        write_files(self.folder / GROUP, metadata(self.shape, attributes))
        self._is_described = True

    def read(self, number: int, name: str) -> Array:
        """Return one array of a block.

        Raises:
            BadInput: it is not there, or not as it was written.
        """
        marker = self._marker(number)
        contents = None if marker is None else self._chunks(number, name, marker)
        if marker is None or contents is None:
            path = self.folder / GROUP / self.shape.chunk(name, number)
            raise BadInput(f"{str(path)!r} is missing or damaged: mushrooms simulate --resume mends it")
        return from_chunks(contents, self.shape, name, marker.rows, marker.cycles)

    def load(self) -> None:
        """Count the blocks by their markers alone: what is read later is checked then.

        Raises:
            BadInput: particles are missing.
        """
        for number in range(self.shape.n_blocks):
            marker = self._marker(number)
            if marker is not None:
                self._count(number, marker)
        if any(self.lacking()):
            there, n = self.tally.particles, self.shape.n_particles
            raise BadInput(
                f"run {str(self.folder)!r} has {there} of {n} particles: go on with {self.command}"
            )

    def _count(self, number: int, marker: Marker) -> None:
        if marker.cycles < self.shape.n_cycles:
            self._shorter[number] = marker.cycles
            return
        self._shorter.pop(number, None)
        self._rows[number] = marker.rows
        self.tally, self.seconds = self.tally.merged(marker.tally), self.seconds + marker.seconds

    def _path(self, number: int) -> Path:
        return self.folder / MARKERS / f"{number}.marker"

    def _marker(self, number: int) -> Marker | None:
        content = unsealed(self._path(number))
        if content is None:
            return None
        data = json.loads(content)
        is_ours = data.get("run") == self._identity and data["number"] == number
        if not is_ours or data["rows"] > self.shape.rows(number) or data["cycles"] > self.shape.n_cycles:
            return None
        fields = {name: data[name] for name in Marker._fields} | {"tally": tally_from(data["tally"])}
        return Marker(**fields)

    def _chunks(self, number: int, name: str, marker: Marker) -> list[bytes] | None:
        paths = self.shape.chunks(name, number, marker.cycles)
        try:
            contents = [(self.folder / GROUP / path).read_bytes() for path in paths]
        except OSError:
            return None
        sums = [hashlib.sha256(content).hexdigest() for content in contents]
        return contents if sums == [marker.sums[path] for path in paths] else None


def is_run(folder: Path) -> bool:
    """Tell whether a folder holds a run, damaged or not."""
    return (folder / MARKERS / DESCRIPTION).is_file() or (folder / GROUP / "zarr.json").is_file()


def attributes_of(folder: Path) -> dict[str, Any]:
    """Return what a stored run says of itself: what is sealed, or where that is damaged what xarray reads.

    Raises:
        BadInput: the folder holds no run, or both are damaged.
    """
    path = folder / GROUP / "zarr.json"
    why = "its description is damaged"
    try:
        described = [unsealed(folder / MARKERS / DESCRIPTION), path.read_bytes()]
    except OSError as error:
        described, why = [unsealed(folder / MARKERS / DESCRIPTION)], error.strerror or str(error)
    for content in described:
        try:
            found = json.loads(content or b"")
            found = found.get("attributes", found)
            if found["schema"] != SCHEMA or _is_description(found):
                return dict(found)
        except (ValueError, KeyError, TypeError, AttributeError):
            continue
    raise BadInput(f"run {str(folder)!r}: {path.name}: {why}")


def _is_description(found: dict[str, Any]) -> bool:
    """Tell whether a description has what runs are opened by: only one of its two copies is sealed."""
    wholes = [found[name] for name in ("particles", "block", "cycles", "cycles_of_a_chunk")]
    phases, seed = found.get("phases", []), found["seed"]
    return (
        all(type(n) is int and n > 0 for n in wholes)
        and (type(seed) is int and seed >= 0)
        and all(type(number) in (int, float) and number > 0 for number in [found["energy"], *phases])
        and isinstance(found["command"], str)
        and isinstance(found["scene"], dict)
    )


def open_run(folder: Path) -> RunFolder:
    """Return a finished run, to be read.

    Raises:
        BadInput: the folder holds none, one of another schema, or one that is not finished.
    """
    from scene.mouth import narrowings

    found = attributes_of(folder)
    if found["schema"] != SCHEMA:
        raise BadInput(f"run {str(folder)!r}: schema = {found['schema']} there, {SCHEMA} is read here")
    asked = asked_of(found)
    n_narrowings = len(narrowings(asked.scene))
    run = RunFolder(
        folder,
        asked,
        Shape(
            found["particles"],
            found["block"],
            asked.n_cycles,
            n_narrowings,
            len(asked.phases),
            found["cycles_of_a_chunk"],
        ),
        found["command"],
    )
    run.load()
    return run
