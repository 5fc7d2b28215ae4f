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

from fast import codes, ensemble, entries, follow, lanes, motion
from fast.compiled import FloatArray, compile_scene
from fast.fine import FineTrajectory, as_trajectory
from fast.starts import only_stop
from fast.stepper import WALL_NAMES, as_arrays, trouble
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
    starts, walls = as_arrays(states)
    out, met = np.empty_like(starts), np.empty_like(walls)
    compiled = compile_scene(scene)
    entries.each_step(*compiled, starts[:0], walls[:0], out, met, 0)  # compiles, or loads from the cache
    begin = time.perf_counter()
    entries.each_step(*compiled, starts, walls, out, met, n_times)
    seconds = time.perf_counter() - begin
    outcomes: list[Outcome] = []
    for state, code, row in zip(states, met.tolist(), out.tolist(), strict=True):
        if code in WALL_NAMES:
            outcomes.append(Collision(WALL_NAMES[code], *row))
        elif code == codes.HORIZON:  # it moves for ever
            outcomes.append(Horizon(np.inf, state.x, state.y, state.vx, state.vy))
        else:
            outcomes.append(trouble(code, state))
    return outcomes, seconds


def fine_steps(scene: Scene, states: Sequence[State], n_times: int = 1) -> tuple[list[FineTrajectory], float]:
    """Take a fine step from each of N states, a call of compiled code for each; as `careful_steps`."""
    compiled = compile_scene(scene)
    rows, walls = as_arrays(states)
    pairs = np.zeros((len(states), 5, 2))
    pairs[:, :, 0] = np.delete(rows, 1, axis=1)  # without the time's low part
    out, met = np.empty((len(states), 1, 6, 2)), np.empty((len(states), 1), dtype=np.int64)
    questions = list(zip(pairs, walls.tolist(), out, met, strict=True))
    ends: list[tuple[int, int]] = []
    if states:
        entries.fine(*compiled, pairs[0], questions[0][1], np.inf, out[0], met[0])  # compiles, or loads
    begin = time.perf_counter()
    for _ in range(n_times):
        ends = [entries.fine(*compiled, p, wall, np.inf, steps, hit) for p, wall, steps, hit in questions]
    seconds = time.perf_counter() - begin
    paths = zip(states, ends, out, met, strict=True)
    return [as_trajectory(state, *end, steps, hit) for state, end, steps, hit in paths], seconds


def flights(scene: Scene, states: Sequence[State], t_end: float) -> tuple[int, float]:
    """Follow states to t_end in one thread, as ensembles are: number of collisions, seconds."""
    starts, walls = as_arrays(states)
    done = ensemble.follow(compile_scene(scene), starts, walls, only_stop(t_end), 1)
    return int(done.counts.sum()), done.seconds


class LaneRound:
    """One pool of lanes, filled with given states.

    Attributes:
        compiled: the scene's numbers.
        is_disk: whether the scene is a cap, whose particles move unfolded: only the arc is met.
    """

    def __init__(self, scene: Scene) -> None:
        self.compiled = compile_scene(scene)
        self.table, self.is_relative, self.laws, self.bounds = self.compiled
        self.is_disk = bool(self.table == codes.CAP)
        bounds = self.bounds
        self.bend = (1.0 + 2.0**-40) * (bounds[0, 1] * bounds[0, 3] + bounds[0, 2] ** 2)
        self.k_w = max(bounds[1, 3], bounds[2, 3])
        self.omega = self.laws[codes.PHASES, 0]
        self.anchors = np.zeros(motion.ANCHORS_SHAPE)
        self.pool = np.zeros(lanes.N_ROWS * lanes.LANES)

    def fill(self, lane: int, p: FloatArray, wall: int, age: float = 0.0) -> None:
        """Put a state [t, its low part, x, y, vx, vy] into a lane, its laws known from `age` before it."""
        a = self.pool
        i = np.int64(lane)
        follow.load(a, i, p, wall, np.inf, OFF)
        a[lanes.NEXT_T + i], a[lanes.NEXT_T_LOW + i] = p[0] - age, p[1]
        motion.set_anchors(self.laws, self.anchors, p[0] - age, p[1])
        follow.set_reference(a, i, self.laws, self.anchors, self.is_relative)
        if a[lanes.END + i] <= p[0]:
            self.fill(lane, p, wall)
            return
        since = (a[lanes.T + i] - a[lanes.REF + i]) + (a[lanes.T_LOW + i] - a[lanes.REF_LOW + i])
        rows = (lanes.R0, lanes.W0, lanes.H0)
        follow.set_laws(a, i, *rows, since, self.omega, self.is_relative)
        spin = p[2] * p[5] - p[3] * p[4]
        a[lanes.SPIN + i] = spin

    def fly(self, n: int) -> tuple[npt.NDArray[np.bool_], FloatArray, FloatArray]:
        """Take a step in n lanes: which are shown right, walls met, and rows of dt, x, y, vx, vy."""
        a, count, m = self.pool, np.int64(n), self.laws[codes.M, 1]
        is_stem = self.table == codes.STEM
        lanes.aim(a, count, is_stem, m, self.bend, self.k_w)
        lanes.fly(a, count, is_stem, self.is_relative, self.omega, m, self.k_w)
        right = self.row(lanes.OK, n) == lanes.RIGHT_ONE
        # A hit beyond the reference's reach is not taken as it stands.
        right &= self.row(lanes.NEXT_T, n) < self.row(lanes.END, n)
        hits, dt = self.row(lanes.HIT, n).copy(), self.row(lanes.S, n).copy()
        lanes.bounce(a, count, m, self.table == codes.MUSHROOM)
        return right, hits, np.column_stack([dt, *(self.row(r, n) for r in PLACE)])

    def skip(self, n: int) -> tuple[npt.NDArray[np.bool_], FloatArray, FloatArray]:
        """Take captured chords in n lanes, likewise; every hit is on the arc."""
        a, count = self.pool, np.int64(n)
        lanes.chord(a, count, OFF, self.is_disk, self.is_relative, self.omega, self.bend, self.k_w)
        right = self.row(lanes.OK, n) == lanes.RIGHT_ONE
        right &= self.row(lanes.NEXT_T, n) < self.row(lanes.END, n)
        dt = self.row(lanes.S, n).copy()
        lanes.rebound(a, count)
        return right, np.zeros(n), np.column_stack([dt, *(self.row(r, n) for r in PLACE)])

    def row(self, start: np.integer[Any], n: int) -> FloatArray:
        """Return n lanes of a row of the pool."""
        return self.pool[start : start + n]


def lane_steps(scene: Scene, states: Sequence[State]) -> list[Outcome | None]:
    """Take a step from each of N states by one round of the lanes.

    Args:
        scene: a table whose laws the lanes know.
        states: starts that `next_collision` takes.

    Returns:
        Collisions; None where the lanes leave the step to the careful one, and for a start on the base
        of a cap or a flight to it: there the lanes go unfolded.
    """
    pool = LaneRound(scene)
    found: list[Outcome | None] = []
    for first in range(0, len(states), lanes.LANES):
        part = states[first : first + lanes.LANES]
        for i, (p, wall) in enumerate(zip(*as_arrays(part), strict=True)):
            pool.fill(i, p, wall)
        rows = (pool.skip if pool.is_disk else pool.fly)(len(part))
        for state, is_right, hit, (dt, x, y, vx, vy) in zip(
            part, *(row.tolist() for row in rows), strict=True
        ):
            is_folded = pool.is_disk and (y < 0.0 or state.wall == "base")
            is_taken = is_right and not is_folded
            found.append(
                Collision(WALL_NAMES[int(hit)], dt, state.t + dt, x, y, vx, vy) if is_taken else None
            )
    return found
