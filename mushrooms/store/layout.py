"""How an ensemble lies on disk: a Zarr group (format 3), one chunk of each array a block of particles.

Along the cycles a chunk holds as many as the run began with: one that is lengthened gets further chunks. They
are the bare little-endian numbers of an array, so that writing them needs numpy alone; xarray and zarr read
them. What is not there yet reads as nan, or -1.
"""

from __future__ import annotations

import json
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from fast import Ensemble, Paused
from fast.kernel.kept import LANE_ROWS
from scene import Mushroom

Array = npt.NDArray[Any]
Arrays = dict[str, Array]
WALLS = Mushroom.walls
OUTCOMES = ("followed", "undecided", "undefined", "rejected")


class Stored(NamedTuple):
    """An array of the store; it has the name that it has in `fast.Ensemble`, or in `fast.Paused`.

    Attributes:
        dims: its dimensions.
        kind: the type of its numbers, as Zarr names it.
        meaning: in a line.
    """

    dims: tuple[str, ...]
    kind: str
    meaning: str


ONE, CYCLES, SLOTS = ("particle",), ("particle", "cycle"), ("particle", "cycle", "narrowing")
LOOKS = ("particle", "cycle", "phase")
FIELDS = {
    "cycle_energies": Stored(CYCLES, "float64", "energy v^2/2 at the end of each cycle"),
    "t": Stored(ONE, "float64", "time of the last state"),
    "x": Stored(ONE, "float64", "place of the last state"),
    "y": Stored(ONE, "float64", "place of the last state"),
    "vx": Stored(ONE, "float64", "velocity of the last state"),
    "vy": Stored(ONE, "float64", "velocity of the last state"),
    "outcome": Stored(ONE, "int8", "how following it ended; -1: not followed yet"),
    "takes_part": Stored(ONE, "int8", "1: counts in means and shares; -1: not followed yet"),
    "t_in": Stored(SLOTS, "float64", "begin of the capture interval around each narrowing; nan: none"),
    "t_out": Stored(SLOTS, "float64", "end of that stay"),
    "wall_counts": Stored(("particle", "wall"), "int64", "collisions with each wall"),
    "n_careful": Stored(ONE, "int64", "collisions left to the careful step"),
    "phase_energies": Stored(LOOKS, "float64", "energy v^2/2 at the phases of each cycle"),
    "phase_captured": Stored(LOOKS, "int8", "1: captured there; -1: not followed yet"),
    "lanes": Stored(("particle", "row"), "float64", "what it takes to go on: see fast.Paused"),
}
LANES = "lanes"  # no result: neither digested nor exported


class Shape(NamedTuple):
    """The sizes of a stored run.

    Attributes:
        n_particles: in all.
        block: particles of a block; the last one may have fewer.
        n_cycles, n_narrowings, n_phases: looks at each.
        chunked: cycles of a chunk.
    """

    n_particles: int
    block: int
    n_cycles: int
    n_narrowings: int
    n_phases: int
    chunked: int

    @property
    def n_blocks(self) -> int:
        """Return how many blocks there are."""
        return -(-self.n_particles // self.block)

    def rows(self, number: int) -> int:
        """Return how many particles a block has."""
        return min(self.block, self.n_particles - number * self.block)

    def of(self, name: str, n: int, n_cycles: int | None = None) -> tuple[int, ...]:
        """Return the shape of an array for n particles and so many cycles, by default for all."""
        sizes = {"cycle": self.n_cycles if n_cycles is None else n_cycles}
        sizes |= {"narrowing": self.n_narrowings, "phase": self.n_phases}
        sizes |= {"wall": len(WALLS), "row": LANE_ROWS}
        return (n, *(sizes[dim] for dim in FIELDS[name].dims[1:]))

    @property
    def names(self) -> list[str]:
        """Return the arrays that hold anything: a scene without narrowings has no stays."""
        return [name for name in FIELDS if 0 not in self.of(name, 1)]

    @property
    def bytes_of_a_particle(self) -> int:
        """Return how much disk a particle takes."""
        sizes = (int(np.prod(self.of(name, 1))) * np.dtype(FIELDS[name].kind).itemsize for name in self.names)
        return sum(sizes)

    def chunk(self, name: str, number: int, k: int = 0) -> str:
        """Return the path in the group of a block's chunk, the k-th along the cycles."""
        places = [str(k if dim == "cycle" else 0) for dim in FIELDS[name].dims[1:]]
        return f"{name}/c.{'.'.join([str(number), *places])}"

    def chunks(self, name: str, number: int, n_cycles: int) -> list[str]:
        """Return the paths of a block's chunks, up to a cycle."""
        n = -(-n_cycles // self.chunked) if "cycle" in FIELDS[name].dims else 1
        return [self.chunk(name, number, k) for k in range(n)]


def columns(paused: Paused) -> Arrays:
    """Return the arrays that are stored of an ensemble."""
    found = paused.ensemble._asdict()
    found |= {"lanes": paused.lanes, "takes_part": paused.ensemble.takes_part()}
    return {name: found[name].astype(field.kind, copy=False) for name, field in FIELDS.items()}


def paused_of(arrays: Arrays, energy0: float, seconds: float) -> Paused:
    """Return the ensemble that arrays were stored of, which has taken so many seconds in one thread."""
    none = np.zeros((*arrays["cycle_energies"].shape, 0))
    empty = {"t_in": none, "t_out": none, "phase_energies": none, "phase_captured": none}
    found: dict[str, Any] = empty | arrays | {"energy0": energy0, "seconds": seconds, "threads": 1}
    found |= {"energy": found["cycle_energies"][:, -1], "n_collisions": found["wall_counts"].sum(axis=1)}
    found["phase_captured"] = found["phase_captured"].astype(bool)  # of Zarr's -1 none is left
    return Paused(Ensemble(**{name: found[name] for name in Ensemble._fields}), found["lanes"])


def to_chunks(array: Array, shape: Shape, name: str) -> list[memoryview]:
    """Return the bytes of a block's chunks; those that are not full are filled up, as Zarr has it.

    Bytes of the array itself where it is a chunk: a block's are tens of megabytes.
    """
    sizes = shape.of(name, shape.block, shape.chunked)
    little = array.astype(array.dtype.newbyteorder("<"), copy=False)
    axis = _cycle_axis(name)
    parts = [little] if axis is None else _cut(little, shape.chunked, axis)
    return [np.ascontiguousarray(_filled_up(part, sizes)).data.cast("B") for part in parts]


def from_chunks(contents: list[bytes], shape: Shape, name: str, n: int, n_cycles: int) -> Array:
    """Return the first n rows of a block's chunks, up to a cycle."""
    kind, axis = np.dtype(FIELDS[name].kind), _cycle_axis(name)
    sizes = shape.of(name, n, shape.chunked)
    found = [np.frombuffer(c, kind.newbyteorder("<"), int(np.prod(sizes))).reshape(sizes) for c in contents]
    is_one = axis is None or n_cycles == shape.chunked
    whole = found[0] if is_one else np.concatenate(found, axis).take(range(n_cycles), axis)
    return whole.astype(kind, copy=False)


def _cycle_axis(name: str) -> int | None:
    dims = FIELDS[name].dims
    return dims.index("cycle") if "cycle" in dims else None


def _cut(array: Array, length: int, axis: int) -> list[Array]:
    return np.split(array, range(length, array.shape[axis], length), axis)


def _filled_up(array: Array, sizes: tuple[int, ...]) -> Array:
    if array.shape == sizes:
        return array
    whole = np.full(sizes, _filler(array.dtype), array.dtype)
    whole[tuple(map(slice, array.shape))] = array
    return whole


def _filler(kind: np.dtype[Any]) -> float | int:
    return np.nan if kind.kind == "f" else -1


def metadata(shape: Shape, attributes: dict[str, Any]) -> dict[str, bytes]:
    """Return the files that describe the group and its arrays, the group's last: it names all of them."""
    arrays = {name: _array(shape, name) for name in shape.names}
    everything = {"kind": "inline", "must_understand": False, "metadata": arrays}
    group = {
        "zarr_format": 3,
        "node_type": "group",
        "attributes": attributes,
        "consolidated_metadata": everything,
    }
    files = {f"{name}/zarr.json": data for name, data in arrays.items()} | {"zarr.json": group}
    return {name: json.dumps(data, indent=1).encode() for name, data in files.items()}


def _array(shape: Shape, name: str) -> dict[str, Any]:
    field, chunk = FIELDS[name], shape.of(name, shape.block, shape.chunked)
    attributes: dict[str, Any] = {"long_name": field.meaning}
    if name == "outcome":
        attributes |= {"flag_values": list(range(len(OUTCOMES))), "flag_meanings": " ".join(OUTCOMES)}
    elif name == "wall_counts":
        attributes["walls"] = " ".join(WALLS)
    return {
        "zarr_format": 3,
        "node_type": "array",
        "shape": shape.of(name, shape.n_particles),
        "data_type": field.kind,
        "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": chunk}},
        "chunk_key_encoding": {"name": "default", "configuration": {"separator": "."}},
        "fill_value": "NaN" if field.kind == "float64" else -1,
        "codecs": [{"name": "bytes", "configuration": {"endian": "little"}}],
        "attributes": attributes,
        "dimension_names": field.dims,
        "storage_transformers": [],
    }
