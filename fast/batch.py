"""One step of each of many given states: careful, fine, or by one round of the lanes.

Ensembles and flows mix careful step and lanes; here each is alone, so that its answers can be compared and
its time measured.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from fast.compiled import FloatArray, compile_scene
from fast.fine import FineTrajectory, as_pairs, as_trajectory
from fast.flow import follow_to
from fast.kernel import codes, entries, follow, lanes, walls
from fast.kernel.laws import ANCHORS_SHAPE, set_anchors
from fast.kernel.limits import limits_of
from fast.step import WALL_NAMES, as_arrays, fitted_start, trouble
from fast.units import fit
from scene import Collision, Horizon, Outcome, Scene, State

PLACE = (lanes.X, lanes.Y, lanes.VX, lanes.VY)
OFF = np.bool_(False)


def careful_steps(scene: Scene, states: Sequence[State], n_times: int = 1) -> tuple[list[Outcome], float]:
    """Take a careful step from each of N states, in compiled code throughout.

    Args:
        scene: table and laws of motion.
        states: starts that `next_collision` takes.
        n_times: how often to take all N steps.

    Returns:
        The outcomes, and the seconds that n_times N steps took.
    """
    starts = [fitted_start(scene, state) for state in states]
    rows, walls = as_arrays(starts)
    out, met = np.empty_like(rows), np.empty_like(walls)
    compiled = fit(scene).compiled
    entries.each_step(*compiled, rows[:0], walls[:0], out, met, 0)  # compiles, or loads from the cache
    begin = time.perf_counter()
    entries.each_step(*compiled, rows, walls, out, met, n_times)
    seconds = time.perf_counter() - begin
    outcomes: list[Outcome] = []
    for state, start, code, row in zip(states, starts, met.tolist(), out, strict=True):
        if code in WALL_NAMES:
            outcomes.append(Collision(WALL_NAMES[code], *start.units.steps(row).tolist()))
        elif code == codes.HORIZON:  # it moves for ever
            outcomes.append(Horizon(np.inf, state.x, state.y, state.vx, state.vy))
        else:
            outcomes.append(trouble(code, state))
    return outcomes, seconds


def fine_steps(scene: Scene, states: Sequence[State], n_times: int = 1) -> tuple[list[FineTrajectory], float]:
    """Take a fine step from each of N states, a call of compiled code for each; as `careful_steps`."""
    starts = [fitted_start(scene, state) for state in states]
    compiled, pairs = fit(scene).compiled, [as_pairs(start) for start in starts]
    _, walls = as_arrays(starts)
    out, met = np.empty((len(states), 1, 6, 2)), np.empty((len(states), 1), dtype=np.int64)
    questions = list(zip(pairs, walls.tolist(), out, met, strict=True))
    ends: list[tuple[int, int]] = []
    if states:
        entries.fine(*compiled, pairs[0], questions[0][1], np.inf, out[0], met[0])  # compiles, or loads
    begin = time.perf_counter()
    for _ in range(n_times):
        ends = [entries.fine(*compiled, p, wall, np.inf, steps, hit) for p, wall, steps, hit in questions]
    seconds = time.perf_counter() - begin
    paths = zip(states, starts, ends, out, met, strict=True)
    return [as_trajectory(s, start.units, *end, steps, hit) for s, start, end, steps, hit in paths], seconds


def flights(scene: Scene, states: Sequence[State], t_end: float) -> tuple[int, float]:
    """Follow states to t_end in one thread, as ensembles are: number of collisions, seconds."""
    done = follow_to(scene, states, t_end, 1)
    return int(done.counts.sum()), done.seconds


class LaneRound:
    """One pool of lanes, filled with given states; scene and states as they are, in whatever units.

    Attributes:
        compiled: the scene's numbers.
        is_disk: whether the scene is a cap, whose particles move unfolded: only the arc is met.
    """

    def __init__(self, scene: Scene) -> None:
        self.compiled = compile_scene(scene)
        self.table, self.is_relative, self.laws, self.bounds = self.compiled
        self.is_disk = bool(self.table == codes.CAP)
        self.limits = limits_of(self.laws, self.bounds)
        self.omega = self.laws[codes.PHASES, 0]
        self.anchors = np.zeros(ANCHORS_SHAPE)
        self.pool, self.spare = np.zeros((2, lanes.N_ROWS * lanes.LANES))

    def fill(self, lane: int, p: FloatArray, wall: int, age: float = 0.0) -> None:
        """Put a state [t, its low part, x, y, vx, vy] into a lane, its laws known from `age` before it."""
        a = self.pool
        i = np.int64(lane)
        follow.load(a, i, p, wall, np.inf, OFF)
        a[lanes.NEXT_T + i], a[lanes.NEXT_T_LOW + i] = p[0] - age, p[1]
        set_anchors(self.laws, self.anchors, p[0] - age, p[1])
        follow.set_reference(a, i, self.laws, self.anchors, self.is_relative)
        if a[lanes.END + i] <= p[0]:
            self.fill(lane, p, wall)
            return
        since = (a[lanes.T + i] - a[lanes.REF + i]) + (a[lanes.T_LOW + i] - a[lanes.REF_LOW + i])
        rows = (lanes.R0, lanes.W0, lanes.H0)
        follow.set_laws(a, i, *rows, since, self.laws, self.is_relative)
        spin = p[2] * p[5] - p[3] * p[4]
        a[lanes.SPIN + i] = spin

    def is_met(self, p: FloatArray, wall: int) -> bool:
        """Tell whether a state lies, but for rounding, on the wall that it leaves, as after a step."""
        if wall == codes.NO_WALL:
            return False
        if wall == codes.BASE:
            return bool(p[3] == 0.0)
        anchors = np.zeros(ANCHORS_SHAPE)
        set_anchors(self.laws, anchors, p[0], p[1])
        f, error = walls.wall_residual(wall, p[2], p[3], self.laws, anchors, self.bounds, self.is_relative)
        return bool(abs(f) <= error)

    def fly(self, n: int) -> tuple[npt.NDArray[np.bool_], FloatArray, FloatArray]:
        """Take a step in n lanes: which are shown right, walls met, and rows of dt, x, y, vx, vy."""
        a, count, m = self.pool, np.int64(n), self.laws[codes.M, 1]
        is_stem = self.table == codes.STEM
        lanes.aim(a, count, is_stem, m, self.limits)
        follow.next_flight(a, count, is_stem, self.is_relative, self.omega, m, self.limits)
        self.correct_more(follow.GENERAL, n)
        right = self.row(lanes.OK, n) == lanes.RIGHT_ONE
        # A hit beyond a knot is left to the careful step.
        right &= self.row(lanes.NEXT_T, n) < self.row(lanes.KNOT, n)
        hits, dt = self.row(lanes.HIT, n).copy(), self.row(lanes.S, n).copy()
        lanes.bounce(a, count, m, self.table == codes.MUSHROOM)
        return right, hits, np.column_stack([dt, *(self.row(r, n) for r in PLACE)])

    def skip(self, n: int) -> tuple[npt.NDArray[np.bool_], FloatArray, FloatArray]:
        """Take captured chords in n lanes, likewise; every hit is on the arc."""
        a, count = self.pool, np.int64(n)
        follow.next_chord(a, count, OFF, self.is_disk, self.is_relative, self.omega, self.limits)
        self.correct_more(follow.DISK, n)
        right = self.row(lanes.OK, n) == lanes.RIGHT_ONE
        right &= self.row(lanes.NEXT_T, n) < self.row(lanes.KNOT, n)
        dt = self.row(lanes.S, n).copy()
        lanes.rebound(a, count)
        return right, np.zeros(n), np.column_stack([dt, *(self.row(r, n) for r in PLACE)])

    def correct_more(self, pool: np.integer[Any], n: int) -> None:
        """Correct coarse steps again, as `fast.kernel.follow` does."""
        for i in range(n):
            follow.correct_more(pool, tuple(self.compiled), self.pool, np.int64(i), self.spare, self.limits)

    def row(self, start: np.integer[Any], n: int) -> FloatArray:
        """Return n lanes of a row of the pool."""
        return self.pool[start : start + n]


def lane_steps(scene: Scene, states: Sequence[State]) -> list[Outcome | None]:
    """Take a step from each of N states by one round of the lanes.

    Args:
        scene: a table whose laws the lanes know.
        states: starts that `next_collision` takes.

    Returns:
        Collisions; None where the lanes leave the step to the careful one, for a start on the base of a cap
        or a flight to it (there the lanes go unfolded), and for a start that is on no wall, or on its wall
        by decree only: lanes know a particle by the wall that it has just met, and where that wall is.
    """
    pool = LaneRound(fit(scene).scene)
    found: list[Outcome | None] = []
    for first in range(0, len(states), lanes.LANES):
        part = states[first : first + lanes.LANES]
        starts, are_met = [fitted_start(scene, state) for state in part], []
        for i, (p, wall) in enumerate(zip(*as_arrays(starts), strict=True)):
            pool.fill(i, p, wall)
            are_met.append(pool.is_met(p, wall))
        rows = (pool.skip if pool.is_disk else pool.fly)(len(part))
        for state, start, is_met, is_right, hit, row in zip(part, starts, are_met, *rows, strict=True):
            is_folded = pool.is_disk and (row[2] < 0.0 or state.wall == "base")
            if not is_right or is_folded or not is_met:
                found.append(None)
                continue
            numbers = start.units.steps(np.array([row[0], start.state.t + row[0], *row[1:]]))
            found.append(Collision(WALL_NAMES[int(hit)], *numbers.tolist()))
    return found
