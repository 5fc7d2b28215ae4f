"""What a run is: all that decides its bits, the arrays that are stored of it, and their sizes.

A block of particles is one chunk of each array. Along the cycles a chunk holds as many as the run
began with, and a run that is lengthened gets further chunks. What is not there yet reads as nan, or
as -1.
"""

import json
import math
import platform
import shlex
import subprocess
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np
import numpy.typing as npt

import mushrooms
import scene as scenes
from fast import Ensemble, Paused
from fast.kernel.follow import LANE_ROWS
from scene import Mushroom, Scene
from scene.mouth import mouth_minima

SCHEMA = 4  # of a stored run: raised when its files change, so that older ones are refused


class RunSpec(NamedTuple):
    """All that decides the bits of a particle, except its number.

    Attributes:
        scene: table and laws.
        energy: E = v^2 / 2 of every start [length^2 / time^2].
        n_cycles: cycles followed.
        seed: of the starts.
        phases: fractions of each cycle at which energies are kept too, rising, in (0, 1).
    """

    scene: Scene
    energy: float
    n_cycles: int
    seed: int
    phases: tuple[float, ...] = ()

    def to_data(self) -> dict[str, Any]:
        """Return the specification as a store keeps it, in types of JSON."""
        return {
            "schema": SCHEMA,
            "version": mushrooms.__version__,
            "scene": json.loads(
                json.dumps(scenes.to_data(self.scene))
            ),  # lists, as they are read back
            "energy": self.energy,
            "cycles": self.n_cycles,
            "seed": self.seed,
            **(
                {"phases": list(self.phases)} if self.phases else {}
            ),  # as older runs say it that have none
        }

    def command(self, scene: str, n_particles: int, folder: Path) -> str:
        """Return the command that makes this run, or goes on with it."""
        options: dict[str, object] = {
            "particles": n_particles,
            "energy": self.energy,
            "cycles": self.n_cycles,
            "seed": self.seed,
            **({"phases": ",".join(map(repr, self.phases))} if self.phases else {}),
            "out": folder,
        }
        words = [str(word) for name, value in options.items() for word in (f"--{name}", value)]
        return shlex.join(["mushrooms", "simulate", scene, *words, "--resume"])


def spec_of(data: dict[str, Any]) -> RunSpec:
    """Return the specification that a store holds."""
    phases = tuple(data.get("phases", ()))
    return RunSpec(
        scenes.from_data(data["scene"]), data["energy"], data["cycles"], data["seed"], phases
    )


def difference(stored: dict[str, Any], wanted: dict[str, Any]) -> str | None:
    """Return the first field in which a stored run differs from the one wanted, with both values.

    Or None.
    """
    stored, wanted = ({**data, "phases": data.get("phases", [])} for data in (stored, wanted))
    for name, value in wanted.items():
        found = stored.get(name)
        # Of a scene, or a law, the first part that differs.
        if found != value and isinstance(found, dict) and isinstance(value, dict):
            return f"{name}: {difference(found, {**dict.fromkeys(found), **value})}"
        if found != value:
            return f"{name} = {found!r} there, {value!r} asked for"
    return None


def made_by() -> dict[str, Any]:
    """Return what bits may depend on: versions of packages, revision of the source tree."""
    return {
        "versions": {
            "oscillating-mushrooms": mushrooms.__version__,
            "python": platform.python_version(),
            "numpy": np.__version__,
            "numba": numba.__version__,
            "machine": platform.machine(),
        },
        "revision": _revision(),
    }


def _revision() -> str | None:
    """Return the commit of the source tree, with `+` if files differ from it.

    None without a tree.
    """
    here = Path(__file__).parent
    try:
        command = ["git", "describe", "--always", "--abbrev=40", "--dirty=+", "--exclude=*"]
        done = subprocess.run(
            command, cwd=here, capture_output=True, text=True, timeout=20, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout.strip() or None


Array = npt.NDArray[Any]
Arrays = dict[str, Array]
WALLS = Mushroom.walls
OUTCOMES = "followed undecided undefined rejected"


class Stored(NamedTuple):
    """An array of the store; it has the name that it has in `fast.Ensemble`, or in `fast.Paused`.

    Attributes:
        dims: its dimensions.
        kind: the type of its numbers.
        meaning: in a line.
    """

    dims: tuple[str, ...]
    kind: str
    meaning: str


ONE = ("particle",)
CYCLES = ("particle", "cycle")
SLOTS = ("particle", "cycle", "narrowing")
LOOKS = ("particle", "cycle", "phase")
FIELDS = {
    "cycle_energies": Stored(CYCLES, "float64", "energy v^2/2 at the end of each cycle"),
    "t": Stored(ONE, "float64", "time of the last state"),
    "x": Stored(ONE, "float64", "place of the last state"),
    "y": Stored(ONE, "float64", "place of the last state"),
    "vx": Stored(ONE, "float64", "velocity of the last state"),
    "vy": Stored(ONE, "float64", "velocity of the last state"),
    "outcome": Stored(ONE, "int8", f"0 to 3: {OUTCOMES}; -1: not followed yet"),
    "takes_part": Stored(ONE, "int8", "1: counts in means and shares; -1: not followed yet"),
    "t_in": Stored(
        SLOTS, "float64", "begin of the capture interval around each minimum of nu; nan: none"
    ),
    "t_out": Stored(SLOTS, "float64", "end of that stay"),
    "wall_counts": Stored(("particle", "wall"), "int64", f"collisions with {' '.join(WALLS)}"),
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
        n_cycles, n_minima, n_phases: looks at each.
        chunked: cycles of a chunk.
    """

    n_particles: int
    block: int
    n_cycles: int
    n_minima: int
    n_phases: int
    chunked: int

    @property
    def n_blocks(self) -> int:
        """Return how many blocks there are."""
        return -(-self.n_particles // self.block)

    def rows(self, number: int) -> int:
        """Return how many particles a block has."""
        return min(self.block, self.n_particles - number * self.block)

    def of(self, name: str, n: int, n_cycles: int) -> tuple[int, ...]:
        """Return the shape of an array for n particles and so many cycles."""
        sizes = {
            "cycle": n_cycles,
            "narrowing": self.n_minima,
            "phase": self.n_phases,
            "wall": len(WALLS),
            "row": int(LANE_ROWS),
        }
        return (n, *(sizes[dim] for dim in FIELDS[name].dims[1:]))

    @property
    def names(self) -> list[str]:
        """Return the arrays that hold anything.

        A scene without minima of nu has no capture intervals.
        """
        return [name for name in FIELDS if 0 not in self.of(name, 1, 1)]

    @property
    def bytes_of_a_particle(self) -> int:
        """Return how much disk a particle takes."""
        kinds = {name: np.dtype(FIELDS[name].kind) for name in self.names}
        return sum(
            kind.itemsize * math.prod(self.of(name, 1, self.n_cycles))
            for name, kind in kinds.items()
        )


def shape_of(spec: RunSpec, n_particles: int, block: int, chunked: int | None = None) -> Shape:
    """Return the sizes of a run; in a chunk it has so many cycles, by default all."""
    looks = len(mouth_minima(spec.scene)), len(spec.phases)
    return Shape(n_particles, block, spec.n_cycles, *looks, chunked or spec.n_cycles)


def columns(paused: Paused) -> Arrays:
    """Return the arrays that are stored of an ensemble."""
    found = {
        **paused.ensemble._asdict(),
        "lanes": paused.lanes,
        "takes_part": paused.ensemble.takes_part(),
    }
    return {name: found[name].astype(field.kind, copy=False) for name, field in FIELDS.items()}


def paused_of(arrays: Arrays, energy0: float, seconds: float) -> Paused:
    """Return the ensemble that arrays were stored of, and its seconds in one thread."""
    none = np.zeros((*arrays["cycle_energies"].shape, 0))
    empty = {"t_in": none, "t_out": none, "phase_energies": none, "phase_captured": none}
    found: dict[str, Any] = empty | arrays | {"energy0": energy0, "seconds": seconds, "threads": 1}
    found |= {
        "energy": found["cycle_energies"][:, -1],
        "n_collisions": found["wall_counts"].sum(axis=1),
    }
    found["phase_captured"] = found["phase_captured"].astype(bool)
    return Paused(Ensemble(**{name: found[name] for name in Ensemble._fields}), found["lanes"])
