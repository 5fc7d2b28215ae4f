"""Orbits: the start and the collisions of one particle, with sections, maps, energies and export.

`follow` draws starts like an ensemble: particle i of seed S is particle i of `fast.simulate(...,
seed=S)`. Each is followed for the same number of collisions, or of cycles. An orbit has its
energies, its hits in the coordinates of a Poincare section and of the boundary map, its capture
intervals, and the energy that the adiabatic theory predicts for these intervals. Pictures:
`mushrooms.figures.orbits`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from mpmath import fp

import fast
import scene as scenes
import theory
from fast.ensemble import initial_states
from fast.paths import captured, sin_phi
from fast.validation import check_energy, check_progress
from mushrooms import __version__
from mushrooms.folders import check_file
from scene import Outcome, Scene, State, Stem, Wall, check_scene
from scene.files.tables import SUFFIXES, write_table
from scene.geometry import TableAt, table_at
from scene.mouth import start_time
from scene.pieces import FloatArray
from scene.refusal import BadInput, check_count, check_number, check_seed

BoolArray = npt.NDArray[np.bool_]
MAX_COLLISIONS = 1_000_000
MAX_ORBITS = 1000
N_PHASES = 48  # of a cycle, for mean lengths of walls
CROSSINGS = 60.0  # of the table in a cycle, at the energy taken when none is asked for


class Section(NamedTuple):
    """The n hits of the arc, in the coordinates of a Poincare section.

    Attributes:
        collision: (n,) number of the collision in the orbit, from 0.
        t: (n,) time of the hit [time].
        place: (n,) arc length from the right end, divided by the length of the arc at that time, 0
            to 1.
        sin_phi: (n,) sin of the angle to the normal before the bounce; positive: clockwise
            (Eq:sinphi).
        nu: (n,) w / r at that time; 0 in a cap.
    """

    collision: npt.NDArray[np.int64]
    t: FloatArray
    place: FloatArray
    sin_phi: FloatArray
    nu: FloatArray

    def is_captured(self) -> BoolArray:
        """Return (n,): |sin phi| > nu."""
        return np.asarray(np.abs(self.sin_phi) > self.nu)

    def first_from(self, instants: FloatArray) -> Section:
        """Return the first hit after each given time that has one."""
        k = np.searchsorted(self.t, instants)
        there = k[k < len(self.t)]
        return Section(self.collision[there], *(column[there] for column in self[1:]))


@dataclass(frozen=True)
class FollowedOrbit:
    """One particle: its start, its collisions, and why they ended.

    Attributes:
        scene: the table and its laws.
        start: the state it starts from.
        walls: (n,) the walls hit.
        steps: (n, 6) dt, t, x, y, vx, vy after each collision.
        outcome: None if all collisions asked for were found, else the outcome that ended the path.
        seed: of which the start was drawn; None where it was given.
    """

    scene: Scene
    start: State
    walls: list[Wall]
    steps: FloatArray
    outcome: Outcome | None
    seed: int | None = None

    def states(self) -> FloatArray:
        """Return (n + 1, 5): t, x, y, vx, vy at the start and after each collision."""
        first = [getattr(self.start, name) for name in ("t", "x", "y", "vx", "vy")]
        return np.vstack([first, self.steps[:, 1:]])

    def state(self, k: int) -> State:
        """Return the state after k collisions; the start for 0."""
        if k == 0:
            return self.start
        _, t, x, y, vx, vy = self.steps[k - 1].tolist()
        return State(t, x, y, vx, vy, self.walls[k - 1])

    def energies(self) -> FloatArray:
        """Return (n + 1,): v^2 / 2 at the start and after each collision [length^2 / time^2]."""
        states = self.states()
        return np.asarray((states[:, 3] ** 2 + states[:, 4] ** 2) / 2)

    def at(self, times: FloatArray) -> FloatArray:
        """Return (m, 2): the place at times between the start and the last collision [length]."""
        states = self.states()
        return np.column_stack([np.interp(times, states[:, 0], states[:, k]) for k in (1, 2)])

    def section(self) -> Section:
        """Return the hits of the arc.

        Raises:
            BadInput: the table is a stem, which has no arc.
        """
        if isinstance(self.scene, Stem):
            raise BadInput("this section is of arc hits: table is stem, must be cap or mushroom")
        states = self.states()
        index = np.array([k for k, wall in enumerate(self.walls) if wall == "arc"], int)
        t, x, y = states[index + 1, :3].T
        sine, nu = sin_phi(self.scene, states, index)
        return Section(index, t, np.arctan2(y, x) / math.pi, sine, nu)

    def phase_section(self, phase: float | None = None) -> FloatArray:
        """Return (n, 2): phase t/T, 0 to 1, of each hit of the moving wall, and velocity after it.

        This is the section of Fermi and Ulam. If the floor of a stem moves, it has the hits of the
        floor and vy; else the hits of both sides and |vx| [length/time]. With a phase of the walls
        it has y and vy at that phase of each cycle.

        Raises:
            BadInput: the table is not such a stem, or the phase is out of range.
        """
        if not isinstance(self.scene, Stem) or not self.scene.period:
            raise BadInput("the section of phase and velocity is of a stem that moves")
        if phase is not None:
            times = self.instants(phase)
            last = np.searchsorted(self.states()[:, 0], times, side="right") - 1
            return np.column_stack([self.at(times)[:, 1], self.states()[last, 4]])
        walls = ("left", "right") if self.scene.laws["h"].is_constant else ("floor",)
        states = self.states()[1:][np.isin(self.walls, walls)]
        speed = states[:, 4] if walls == ("floor",) else np.abs(states[:, 3])
        phases = (states[:, 0] - start_time(self.scene)) / self.scene.period % 1.0
        return np.column_stack([phases, speed])

    def instants(self, phase: float) -> FloatArray:
        """Return the times within the orbit at which the walls have a phase t/T, 0 to 1.

        Raises:
            BadInput: the phase is out of range, or the walls stand still.
        """
        if not 0 <= check_number("phase", phase) < 1:
            raise BadInput(f"phase = {phase}, must be at least 0 and below 1")
        if not self.scene.period:
            raise BadInput(f"phase = {phase}: the walls of this scene stand still")
        begin = self.start.t
        end = float(self.states()[-1, 0])
        first = start_time(self.scene) + phase * self.scene.period
        lowest, highest = ((t - first) / self.scene.period for t in (begin, end))
        count = np.arange(math.ceil(lowest), math.floor(highest) + 1, dtype=np.float64)
        return np.asarray(first + self.scene.period * count)

    def captured(self) -> BoolArray:
        """Return (n + 1,): whether the particle is captured on the flight from each state.

        A capture interval begins with a captured arc hit. It ends with a free arc hit, or below the
        mouth. In a cap every particle is captured.
        """
        if not isinstance(self.scene, scenes.Mushroom):
            return np.full(len(self.walls) + 1, not isinstance(self.scene, Stem))
        return captured(self.scene, self.states(), self.walls)

    def adiabatic(self) -> FloatArray:
        """Return (n + 1,): log E / E0 by theory, for the capture intervals of this particle.

        While captured E V_cap is constant; otherwise the law of the chaotic zone holds.

        Raises:
            NotCovered: the table is a stem.

        Source: Eq:dEe, Eq:dE.
        """
        times = self.states()[:, 0]
        is_captured = self.captured()[:-1]
        if isinstance(self.scene, Stem):
            raise theory.NotCovered("the theory is of caps and mushrooms: table is stem")
        rise = np.diff(-2 * np.log(self.scene.laws["r"].values(times)))
        if isinstance(self.scene, scenes.Mushroom) and not is_captured.all():
            rise = np.where(
                is_captured, rise, np.diff(theory.chaotic_zone(self.scene, times).log_energy)
            )
        return np.concatenate([[0.0], np.cumsum(rise)])

    def columns(self) -> dict[str, list[Any]]:
        """Return the orbit as columns of n + 1 rows, the start first; None marks a missing value.

        They are collision, wall, dt, t, x, y, vx, vy, energy; at the arc also place, sin_phi, nu
        and captured (see `Section`).
        """
        n = len(self.walls) + 1
        found: dict[str, list[Any]] = {
            "collision": list(range(n)),
            "wall": [self.start.wall, *self.walls],
            "dt": [None, *self.steps[:, 0].tolist()],
            **dict(zip(("t", "x", "y", "vx", "vy"), self.states().T.tolist(), strict=True)),
            "energy": self.energies().tolist(),
        }
        at_arc = np.full((n, 4), None)
        if not isinstance(self.scene, Stem):
            section = self.section()
            hits = (section.place, section.sin_phi, section.nu, section.is_captured())
            at_arc[section.collision + 1] = np.transpose([hit.astype(object) for hit in hits])
        found |= dict(zip(("place", "sin_phi", "nu", "captured"), at_arc.T.tolist(), strict=True))
        return found

    def write(self, path: Path | str) -> None:
        """Write the columns as .csv (floats in shortest round-trip form) or .parquet.

        Scene, energy, seed and version go with them: see `scene.files.tables`.

        Raises:
            BadInput: another ending, or pyarrow is not installed.
        """
        check_file(Path(path), SUFFIXES)
        about = describe(self.scene, energy=float(self.energies()[0]), seed=self.seed)
        write_table(Path(path), [self.columns()], about)


def describe(scene: Scene, *, energy: float, seed: int | None) -> dict[str, Any]:
    """Return what goes with a table of particles: scene, initial energy, seed and version."""
    found = {"version": __version__, "scene": scenes.to_data(scene), "energy": energy}
    return found if seed is None else {**found, "seed": seed}


def usual_energy(scene: Scene, crossings: float = CROSSINGS) -> float:
    """Return the energy for so many crossings of the table in a cycle [length^2 / time^2]."""
    check_scene(scene)
    size = float(table_at(fp, scene, 0.0).size)
    return 0.5 * (crossings * size / (scene.period or CROSSINGS * size)) ** 2


def follow(
    scene: Scene,
    n_collisions: int = MAX_COLLISIONS,
    *,
    energy: float | None = None,
    seed: int = 0,
    n_orbits: int = 1,
    n_cycles: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> list[FollowedOrbit]:
    """Follow particles from drawn starts, uniform in area and direction when the cycle begins.

    Args:
        scene: table and laws.
        n_collisions: of each particle, 1 to 10^6.
        energy: v^2 / 2 at the start [length^2 / time^2], > 0 and at most 2^800; by default one
            that crosses the table some sixty times in a cycle.
        seed: 0 to 2^64 - 1; particle i is particle i of `fast.simulate` at this energy and seed.
        n_orbits: number of particles, 1 to 1000.
        n_cycles: cycles of the walls after which to stop, if the collisions do not end before.
        progress: called with the number of particles that have been followed.

    Raises:
        BadInput: naming field, value and bound.
    """
    check_scene(scene)
    n_collisions = check_count("n_collisions", n_collisions, 1, MAX_COLLISIONS)
    n_orbits = check_count("n_orbits", n_orbits, 1, MAX_ORBITS)
    seed = check_seed(seed)
    energy = usual_energy(scene) if energy is None else check_energy(energy)
    end = math.inf
    if n_cycles is not None:
        n_cycles = check_count("n_cycles", n_cycles, 1, MAX_COLLISIONS)
        end = start_time(scene) + n_cycles * (scene.period or 1.0)
    tell = check_progress(progress) or (lambda _n_done: None)
    found = []
    for row in initial_states(scene, n_orbits, energy, seed).tolist():
        orbit = from_state(scene, State(row[0], *row[2:]), n_collisions, end)
        found.append(replace(orbit, seed=seed))
        tell(len(found))
    return found


def from_state(
    scene: Scene, start: State, n_collisions: int, t_end: float = math.inf
) -> FollowedOrbit:
    """Follow a particle from a state of your own, as `fast.trajectory`.

    Raises:
        BadInput: naming field, value and bound.
    """
    found = fast.trajectory(scene, start, n_collisions, t_end)
    return FollowedOrbit(
        scene, start, found.walls, np.asarray(found.steps, np.float64), found.outcome
    )


class Slot(NamedTuple):
    """A wall's part of the boundary map: name, begin and end along the boundary, 0 to 1."""

    wall: Wall
    begin: float
    end: float


class Stretch(NamedTuple):
    """A wall, or its part beside the mouth, from one end to the other, anticlockwise."""

    wall: Wall
    begin: tuple[float, float]
    end: tuple[float, float]

    @property
    def length(self) -> float:
        """Return its length."""
        return math.dist(self.begin, self.end) * (math.pi / 2 if self.wall == "arc" else 1.0)

    def share(self, x: float, y: float) -> float:
        """Return the position of one of its points, 0 at the begin to 1 at the end."""
        if self.wall == "arc":
            return math.atan2(abs(y), x) / math.pi
        return min(math.dist(self.begin, (x, y)) / (self.length or 1.0), 1.0)


def stretches(now: TableAt) -> list[Stretch]:
    """Return the walls anticlockwise from the right end of the cap."""
    r, w, foot, h = map(float, (now.r, now.w, now.half_width(-now.h), now.h))
    stem = [
        Stretch("left", (-w, 0.0), (-foot, -h)),
        Stretch("floor", (-foot, -h), (foot, -h)),
        Stretch("right", (foot, -h), (w, 0.0)),
    ]
    if isinstance(now.scene, Stem):
        return [Stretch("base", (w, 0.0), (-w, 0.0)), *stem]
    arc = Stretch("arc", (r, 0.0), (-r, 0.0))
    if isinstance(now.scene, scenes.Cap):
        return [arc, Stretch("base", (-r, 0.0), (r, 0.0))]
    return [arc, Stretch("base", (-r, 0.0), (-w, 0.0)), *stem, Stretch("base", (w, 0.0), (r, 0.0))]


def boundary(scene: Scene) -> list[Slot]:
    """Return the walls anticlockwise from the right end of the cap, with their mean lengths."""
    check_scene(scene)
    times = scene.period * np.arange(N_PHASES if scene.period else 1) / N_PHASES
    found = [stretches(table_at(fp, scene, t)) for t in times.tolist()]
    ends = np.cumsum([0.0, *np.mean([[part.length for part in one] for one in found], axis=0)])
    ends /= ends[-1]
    walls = [part.wall for part in found[0]]
    return [Slot(*row) for row in zip(walls, ends[:-1].tolist(), ends[1:].tolist(), strict=True)]


def boundary_map(orbit: FollowedOrbit) -> FloatArray:
    """Return (n, 2): place along the boundary and sine to the normal after each collision.

    The place runs anticlockwise, 0 to 1. Each wall has the part that `boundary` gives it, and a hit
    the corresponding point of it. The sine is positive along that direction.
    """
    slots = boundary(orbit.scene)
    out = np.empty((len(orbit.walls), 2))
    for k, (wall, (_, t, x, y, vx, vy)) in enumerate(
        zip(orbit.walls, orbit.steps.tolist(), strict=True)
    ):
        now = table_at(fp, orbit.scene, t)
        own = [pair for pair in zip(slots, stretches(now), strict=True) if pair[0].wall == wall]
        slot, part = own[0 if x < 0 else -1]  # of the base beside a mouth the left part comes first
        normal_x, normal_y = now.normal(wall, x, y)
        # Anticlockwise along the wall: the inward normal turned by a right angle, clockwise.
        along = (normal_y * vx - normal_x * vy) / math.hypot(vx, vy)
        out[k] = slot.begin + part.share(x, y) * (slot.end - slot.begin), along
    return out


def span_of_nu(scene: Scene) -> tuple[float, float] | None:
    """Return the least and the largest nu = w / r of a cycle; None where there is no mouth."""
    check_scene(scene)
    if not isinstance(scene, scenes.Mushroom):
        return None
    cycle = theory.Cycle.of(scene, 15)
    return float(cycle.nu_min), float(cycle.nu_max)
