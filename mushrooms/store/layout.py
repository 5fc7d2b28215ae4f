"""How an ensemble lies on disk: a Zarr group (format 3), one chunk of each array a block of particles.

Chunks are the bare little-endian numbers of an array, so that writing them needs numpy alone; xarray and
zarr read them. A chunk that is not there yet reads as nan, or -1.
"""

from __future__ import annotations

import json
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from fast import Ensemble

Array = npt.NDArray[Any]
Arrays = dict[str, Array]
WALLS = ("arc", "base", "left", "right", "floor")
OUTCOMES = ("followed", "undecided", "undefined", "rejected")


class Stored(NamedTuple):
    """An array of the store.

    Attributes:
        dims: its dimensions.
        kind: the type of its numbers, as Zarr names it.
        source: the name in `fast.Ensemble`.
        meaning: in a line.
    """

    dims: tuple[str, ...]
    kind: str
    source: str
    meaning: str


ONE, CYCLES, SLOTS = ("particle",), ("particle", "cycle"), ("particle", "cycle", "narrowing")
LOOKS = ("particle", "cycle", "phase")
FIELDS = {
    "energy": Stored(CYCLES, "float64", "cycle_energies", "energy v^2/2 at the end of each cycle"),
    "t": Stored(ONE, "float64", "t", "time of the last state"),
    "x": Stored(ONE, "float64", "x", "place of the last state"),
    "y": Stored(ONE, "float64", "y", "place of the last state"),
    "vx": Stored(ONE, "float64", "vx", "velocity of the last state"),
    "vy": Stored(ONE, "float64", "vy", "velocity of the last state"),
    "outcome": Stored(ONE, "int8", "outcome", "how following it ended; -1: not followed yet"),
    "t_in": Stored(SLOTS, "float64", "t_in", "begin of the captured stay around each narrowing; nan: none"),
    "t_out": Stored(SLOTS, "float64", "t_out", "end of that stay"),
    "collisions": Stored(("particle", "wall"), "int64", "wall_counts", "collisions with each wall"),
    "careful": Stored(ONE, "int64", "n_careful", "collisions left to the careful step"),
    "phase_energy": Stored(LOOKS, "float64", "phase_energies", "energy v^2/2 at the phases of each cycle"),
    "phase_captured": Stored(LOOKS, "int8", "phase_captured", "1: captured there; -1: not followed yet"),
}


class Shape(NamedTuple):
    """The sizes of a stored run.

    Attributes:
        n_particles: in all.
        block: particles of a block; the last one may have fewer.
        n_cycles, n_narrowings, n_phases: looks at each.
    """

    n_particles: int
    block: int
    n_cycles: int
    n_narrowings: int
    n_phases: int = 0

    @property
    def n_blocks(self) -> int:
        """Return how many blocks there are."""
        return -(-self.n_particles // self.block)

    def rows(self, number: int) -> int:
        """Return how many particles a block has."""
        return min(self.block, self.n_particles - number * self.block)

    def of(self, name: str, n: int) -> tuple[int, ...]:
        """Return the shape of an array for n particles."""
        sizes = {"cycle": self.n_cycles, "narrowing": self.n_narrowings, "wall": len(WALLS)}
        sizes["phase"] = self.n_phases
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

    def chunk(self, name: str, number: int) -> str:
        """Return the path of a chunk in the group."""
        zeros = ".0" * (len(FIELDS[name].dims) - 1)
        return f"{name}/c.{number}{zeros}"


def columns(ensemble: Ensemble) -> Arrays:
    """Return the arrays that are stored of an ensemble."""
    return {n: getattr(ensemble, field.source).astype(field.kind, copy=False) for n, field in FIELDS.items()}


def to_chunk(array: Array, block: int) -> bytes:
    """Return a chunk's bytes; a last block that is not full is filled up, as Zarr has it."""
    little = array.astype(array.dtype.newbyteorder("<"), copy=False)
    rest = np.full((block - len(array), *array.shape[1:]), _filler(array.dtype), little.dtype)
    return little.tobytes() + rest.tobytes()


def from_chunk(content: bytes, shape: Shape, name: str, n: int) -> Array:
    """Return the first n rows of a chunk."""
    kind = np.dtype(FIELDS[name].kind)
    wanted = shape.of(name, n)
    found = np.frombuffer(content, kind.newbyteorder("<"), int(np.prod(wanted)))
    return found.reshape(wanted).astype(kind, copy=False)


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
    field = FIELDS[name]
    attributes: dict[str, Any] = {"long_name": field.meaning}
    if name == "outcome":
        attributes |= {"flag_values": list(range(len(OUTCOMES))), "flag_meanings": " ".join(OUTCOMES)}
    elif name == "collisions":
        attributes["walls"] = " ".join(WALLS)
    return {
        "zarr_format": 3,
        "node_type": "array",
        "shape": shape.of(name, shape.n_particles),
        "data_type": field.kind,
        "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": shape.of(name, shape.block)}},
        "chunk_key_encoding": {"name": "default", "configuration": {"separator": "."}},
        "fill_value": "NaN" if field.kind == "float64" else -1,
        "codecs": [{"name": "bytes", "configuration": {"endian": "little"}}],
        "attributes": attributes,
        "dimension_names": field.dims,
        "storage_transformers": [],
    }
