"""One step of each of many given states: scalar, fine, or by one round of the lanes.

Ensembles and flows mix scalar step and lanes; here each is alone, so that its answers can be compared and
its time measured.
"""

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from fast.ensemble import only_stop
from fast.kernel import records, rows
from fast.kernel.batch import fill_careful, fill_lane, residual, step_lanes
from fast.kernel.records import ANCHORS_SHAPE, Compiled, FloatArray, IntArray, Particle, unfilled_ends
from fast.kernel.worker import DISK, GENERAL, careful_at, new_worker
from fast.paths import FineTrajectory, as_trajectory, fill_fine_path
from fast.pieces import laws_in_lanes
from fast.prepared import prepare
from fast.step import WALL_NAMES, as_arrays, end_of_path, fitted_start
from fast.units import compile_scene, outward
from scene import Collision, Outcome, Scene, State

PLACE = (rows.X, rows.Y, rows.VX, rows.VY)


def take_careful_steps(
    compiled: Compiled, states: FloatArray, walls: IntArray, n_times: int = 1
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Take a scalar step from each of N states, all in the kernel's units; see `careful_steps`.

    Args:
        compiled: the scene's numbers.
        states: (N, 6) t, its low part, x, y, vx, vy.
        walls: (N,) codes of the walls that they leave.
        n_times: how often to do all this, where its time is measured.

    Returns:
        (N,) codes of the walls that are met, or of what comes instead; (N,) times of flight; (N, 6) states
        after.
    """
    found = np.zeros(len(states), np.int64), np.empty(len(states)), np.empty((len(states), 6))
    fill_careful(careful_at(), compiled, states, walls, n_times, found)
    return found


def careful_steps(scene: Scene, states: Sequence[State], n_times: int = 1) -> tuple[list[Outcome], float]:
    """Take a scalar step from each of N states, in compiled code throughout.

    Args:
        scene: table and laws of motion.
        states: starts that `next_collision` takes.
        n_times: how often to take all N steps.

    Returns:
        The outcomes, and the seconds that n_times N steps took.
    """
    prepared = prepare(scene)
    starts = [fitted_start(prepared, state) for state in states]
    rows, walls = as_arrays([particle for particle, _ in starts])
    compiled = prepared.compiled
    take_careful_steps(compiled, rows[:0], walls[:0])  # compiles, or loads from the cache
    begin = time.perf_counter()
    codes, times, ends = take_careful_steps(compiled, rows, walls, n_times)
    seconds = time.perf_counter() - begin
    outcomes: list[Outcome] = []
    steps = np.column_stack([times, np.delete(ends, 1, axis=1)])
    for state, (_, units), code, row in zip(states, starts, codes.tolist(), steps, strict=True):
        if code in WALL_NAMES:
            outcomes.append(Collision(WALL_NAMES[code], *outward(row, units.of_step()).tolist()))
        else:  # without a horizon only what never moves meets no wall
            place = state.x, state.y, state.vx, state.vy
            outcomes.append(end_of_path(code, scene, state, 0, np.inf, place))
    return outcomes, seconds


def fine_steps(scene: Scene, states: Sequence[State], n_times: int = 1) -> tuple[list[FineTrajectory], float]:
    """Take a fine step from each of N states, a call of compiled code for each; as `careful_steps`."""
    prepared = prepare(scene)
    starts = [fitted_start(prepared, state) for state in states]
    steps, met = np.empty((len(states), 1, 6, 2)), np.empty((len(states), 1), dtype=np.int64)
    compiled = prepared.compiled
    particles = [particle for particle, _ in starts]
    questions = [(compiled, *question) for question in zip(particles, steps, met, strict=True)]
    ends = [fill_fine_path(*question) for question in questions[:1]]  # compiles, or loads
    begin = time.perf_counter()
    for _ in range(n_times):
        ends = [fill_fine_path(*question) for question in questions]
    seconds = time.perf_counter() - begin
    paths = zip(states, (units for _, units in starts), ends, steps, met, strict=True)
    return [as_trajectory(scene, *path) for path in paths], seconds


class LaneRound:
    """One pool of lanes, filled with given states; scene and states as they are, in whatever units.

    Attributes:
        compiled: the scene's numbers.
        is_disk: whether particles move unfolded through the base: only the arc is met. So they do in a cap.
    """

    def __init__(self, scene: Scene) -> None:
        self.compiled = compile_scene(scene)
        self.is_disk = bool(self.compiled.table == records.CAP)
        self.in_lanes = laws_in_lanes(scene, self.compiled)
        self.worker = new_worker(self.in_lanes, only_stop(np.inf), unfilled_ends(np.empty((0, 6))))
        self.anchors = np.zeros(ANCHORS_SHAPE)
        self.pool, self.spare = np.zeros(rows.POOL_SIZE), np.zeros(rows.POOL_SIZE)

    def fill(self, lane: int, p: FloatArray, wall: int, age: float = 0.0) -> None:
        """Put a state [t, its low part, x, y, vx, vy] into a lane, its laws known from `age` before it."""
        particle = Particle._make((*p.tolist(), int(wall)))
        fill_lane(self.pool, np.int64(lane), particle, float(age), self.worker)

    def is_met(self, p: FloatArray, wall: int) -> bool:
        """Tell whether a state lies, but for rounding, on the wall that it leaves, as after a step."""
        if wall in (records.NO_WALL, records.BASE):
            return bool(wall == records.BASE and p[3] == 0.0)
        f, error = residual(Particle._make((*p.tolist(), int(wall))), self.compiled, self.anchors)
        return bool(abs(f) <= error)

    def step(self, n: int) -> tuple[npt.NDArray[np.bool_], FloatArray, FloatArray]:
        """Take a step in n lanes: which are shown right, walls met, and rows of dt, x, y, vx, vy."""
        self.advance(n)
        numbers = np.column_stack([self.row(r, n) for r in (rows.S, *PLACE)])
        fates = self.row(rows.FATE, n)
        return (fates == rows.MARKED) | (fates == rows.MOVED), self.row(rows.HIT, n).copy(), numbers

    def advance(self, n: int) -> None:
        """Take a step in n lanes."""
        step_lanes(DISK if self.is_disk else GENERAL, self.pool, np.int64(n), self.worker, self.spare)

    def row(self, start: np.integer[Any], n: int) -> FloatArray:
        """Return n lanes of a row of the pool."""
        return self.pool[start : start + n]


def lane_steps(scene: Scene, states: Sequence[State]) -> list[Outcome | None]:
    """Take a step from each of N states by one round of the lanes.

    Args:
        scene: a table whose laws the lanes know.
        states: starts that `next_collision` takes.

    Returns:
        Collisions; None where the lanes leave the step to the scalar one, for a start on the base of a cap
        or a flight to it (there the lanes go unfolded), and for a start that is on no wall, or on its wall
        by definition only: lanes know a particle by the wall that it has just met, and where that wall is.
    """
    prepared = prepare(scene)
    pool = LaneRound(prepared.scene)
    found: list[Outcome | None] = []
    for first in range(0, len(states), rows.LANES):
        part = states[first : first + rows.LANES]
        starts = [fitted_start(prepared, state) for state in part]
        are_met = []
        for i, (p, wall) in enumerate(zip(*as_arrays([particle for particle, _ in starts]), strict=True)):
            pool.fill(i, p, wall)
            are_met.append(pool.is_met(p, wall))
        for state, (particle, units), is_met, is_right, hit, row in zip(
            part, starts, are_met, *pool.step(len(part)), strict=True
        ):
            is_folded = pool.is_disk and (row[2] < 0.0 or state.wall == "base")
            if not is_right or is_folded or not is_met:
                found.append(None)
                continue
            numbers = outward(np.array([row[0], particle.t + row[0], *row[1:]]), units.of_step())
            found.append(Collision(WALL_NAMES[int(hit)], *numbers.tolist()))
    return found
