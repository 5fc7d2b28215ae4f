"""A search for wrong lane answers, aimed at what the checks of docs/lanes.md rule out.

Draws of `lane_anywhere` are those of the suite; the other groups aim at one kind of flight each. Each start
goes three lane steps, so that what a step leaves to the next is tried too. An answer is wrong that names
another wall than the careful step from the same state, or differs from it by more than 4 backward ulps; or
another than the floor, from a start above it by less than the careful step tells, but rising slower.
"""

from collections import Counter
from functools import partial
from types import ModuleType

import numpy as np

from fast.batch import LaneRound, take_careful_steps
from fast.kernel import lanes, records, rows
from fast.kernel.batch import residual
from fast.kernel.fine_step import FineState, fine_path
from fast.kernel.records import DEPTH, RATE, FloatArray, Particle
from scene import Scene
from support.lane_anywhere import Group, Start, draw_anywhere
from support.lane_draws import AIMS, draw_aimed
from support.lane_traps import TRAPS

BOUND = 4.0  # backward ulps
CLOSE = 2.0**-24  # relative, where no more can be asked: see error_of
NUDGES = (2.0**-36, 2.0**-46)  # of each number of a state: for the derivatives of a step
AIMED = {name: Group(partial(draw_aimed, aim), aim.is_captured) for name, aim in AIMS.items()}
GROUPS: dict[str, Group] = {"anywhere": Group(draw_anywhere), **AIMED, **TRAPS}
N_ROUNDS = 3
ANSWERS_OF_A_DRAW = 10
Wrong = tuple[Scene, list[float], int, int, list[float]]  # start, its wall, the lane's wall, its numbers


class Round(LaneRound):
    """A round of the lanes, of the honest kernels or of faulty ones, beside the careful step.

    Attributes:
        is_disk: whether particles move unfolded through the base: in a cap, and as captured ones.
        serves: the longest time that a piece of its laws serves.
    """

    def __init__(self, scene: Scene, kernels: ModuleType = lanes, *, is_captured: bool = False) -> None:
        super().__init__(scene)
        self.kernels = kernels
        self.serves = float(np.diff(self.in_lanes.pieces.begins, append=self.in_lanes.pieces.period).max())
        self.is_disk = self.is_disk or is_captured

    def fill_all(self, starts: list[Start], age: float = 0.0) -> None:
        """Put starts into the first lanes, their laws known from `age` before them."""
        for lane, (p, wall) in enumerate(starts):
            self.fill(lane, p, wall, age)

    def advance(self, n: int) -> None:
        """Take a step in n lanes; faulty kernels run uncompiled, on a list."""
        if self.is_disk:
            # A step is judged from its state alone, not from the angular momentum of the interval so far.
            x, y, vx, vy = (self.row(r, n) for r in (rows.X, rows.Y, rows.VX, rows.VY))
            self.row(rows.SPIN, n)[:] = x * vy - y * vx
        if self.kernels is lanes:
            super().advance(n)
            return
        a = self.pool.tolist()
        with np.errstate(all="ignore"):
            self.call_loop(a, n)
            for i in range(n):
                self.correct_lane(a, i)
        self.pool[:] = a

    def call_loop(self, a: list[float], count: int) -> None:
        """Call the loop of the kernels that `follow.advance` calls."""
        of = self.in_lanes
        k = self.kernels
        waves = of.waves if of.form in (k.ONE_WAVE, k.TWO_WAVES) else None
        step = k.chord if self.is_disk else k.fly
        slope = None if of.is_slope_moving else of.slope
        step(a, count, of.scene, waves, slope, (0,) * of.form, of.limits)

    def correct_lane(self, a: list[float], i: int) -> None:
        """Correct a step that is not yet right again, as the next rounds do."""
        k = self.kernels
        spare = [0.0] * rows.POOL_SIZE
        k.copy_rows(a, i, spare, 0, 0, rows.POOL_SIZE)
        while spare[rows.FATE] in (rows.COARSE, rows.FAR) and spare[rows.TRIES] <= rows.MAX_CORRECTIONS:
            if spare[rows.FATE] == rows.FAR:
                t = spare[rows.T] + spare[rows.S]
                k.set_reference(spare, 0, t, spare[rows.T_LOW], self.in_lanes)
            self.call_loop(spare, 1)
        k.copy_rows(spare, 0, a, i, 0, rows.POOL_SIZE)

    def careful_step(self, p: FloatArray, wall: int) -> tuple[int, float, FloatArray]:
        """Return the scalar step's wall, its time, and the state after, from a state and its wall."""
        codes, times, ends = take_careful_steps(self.compiled, p[None], np.array([wall]))
        return int(codes[0]), float(times[0]), ends[0]

    def careful(self, p: FloatArray, wall: int) -> tuple[int, FloatArray]:
        """Return the careful step's wall and dt, x, y, vx, vy; unfolded, those of the next hit of the arc."""
        q = p.copy()
        total = 0.0
        is_folded = False
        if self.is_disk and q[3] < 0.0:
            q[3], q[5], is_folded = -q[3], -q[5], True
        code = records.NO_WALL
        for _ in range(2):
            code, dt, q = self.careful_step(q, wall)
            total += dt
            if not self.is_disk or code != records.BASE:
                break
            wall = int(code)
            is_folded = not is_folded
        if is_folded:
            q[3], q[5] = -q[3], -q[5]
        return int(code), np.array([total, *q[2:]])

    def is_floor_met_at_once(self, p: FloatArray) -> bool:
        """Tell whether a start is above the floor by no more than rounding, in pairs of floats, and falls."""
        f, error = residual(Particle._make((*p.tolist(), int(records.FLOOR))), self.compiled, self.anchors)
        return bool(0.0 < f <= error and p[5] + self.anchors[DEPTH, RATE] < 0.0)

    def ulps(self, p: FloatArray, wall: int, answer: FloatArray, truth: FloatArray) -> float | None:
        """Return the backward ulps of an answer beside the careful one; None for a delicate step.

        `grading.agreement.backward_ulps`, with what a step changes by when a number of its start does.
        """
        off = np.abs(answer - truth)
        if bool(np.all(off <= BOUND * 2.0**-53 * np.abs(truth))):
            return float(np.max(off / (2.0**-53 * np.abs(truth) + 5e-324)))
        for nudge in NUDGES:
            moved = self.moved(p, wall, nudge)
            if moved is not None:
                return float(np.max(off / (2.0**-53 * (moved + np.abs(truth)) + 5e-324)))
        return None

    def fine(self, p: FloatArray, wall: int) -> FloatArray:
        """Return dt, x, y, vx, vy of a step that meets no base first, from pairs of floats, rounded once."""
        is_folded = bool(self.is_disk and p[3] < 0.0)
        steps = np.zeros((1, 6, 2))
        met = np.zeros(1, dtype=np.int64)
        t, t_low, x, y, vx, vy = p.tolist()
        if is_folded:
            y = -y
            vy = -vy
        start = FineState((t, t_low), (x, 0.0), (y, 0.0), (vx, 0.0), (vy, 0.0))
        called_off = np.zeros(1, np.int64)
        fine_path(self.compiled, self.anchors, start, wall, steps, met, called_off)
        found = np.delete(steps[0, :, 0], 1)
        if is_folded:
            found[[2, 4]] *= -1.0
        return found

    def moved(self, p: FloatArray, wall: int, nudge: float) -> FloatArray | None:
        """Return the sum over the start's numbers of |d step / d number| |number|, by differences."""
        total = np.zeros(5)
        code = None
        for k in (0, 2, 3, 4, 5):
            ends = []
            for sign in (-1.0, 1.0):
                q = p.copy()
                q[k] += sign * nudge * q[k]
                found, numbers = self.careful(q, wall)
                if code not in (None, found):
                    return None
                code = found
                ends.append(numbers)
            total += np.abs(ends[1] - ends[0]) / (2.0 * nudge)
        return total


def search(seed: int, n: int, tally: Counter[str], name: str, kernels: ModuleType = lanes) -> list[Wrong]:
    """Search one group of draws until lanes have given n answers; returns the wrong ones.

    The search of faulty kernels ends with the first draw in which they are found out. Starts that are solved
    for are mostly left to the careful step: no more than n // ANSWERS_OF_A_DRAW draws are tried.
    """
    random = np.random.default_rng(seed)
    group = GROUPS[name]
    found: list[Wrong] = []
    most = tally["lane answers"] + n
    for _ in range(n // ANSWERS_OF_A_DRAW):
        if tally["lane answers"] >= most or (found and kernels is not lanes):
            break
        scene, starts = group.draw(rows.LANES, random)
        found += try_starts(
            Round(scene, kernels, is_captured=group.is_captured), scene, starts, random, tally
        )
    return found


def try_starts(
    pool: Round, scene: Scene, starts: list[Start], random: np.random.Generator, tally: Counter[str]
) -> list[Wrong]:
    """Fill a pool with starts in a scene and take lane steps from them."""
    found: list[Wrong] = []
    age = pool.serves * random.random() if pool.serves < np.inf and random.random() < 0.5 else 0.0
    pool.fill_all(starts, age)
    codes = [pool.careful_step(*start)[0] for start in starts]
    is_live = np.array(codes, dtype=np.int64) < records.APPROACHING
    for _ in range(N_ROUNDS):
        begun = [state_in(pool, i) for i in range(len(starts))]
        right, hits, numbers = pool.step(len(starts))
        tally["steps"] += int(is_live.sum())
        is_live &= right
        for i in np.flatnonzero(is_live):
            p, wall = begun[i]
            code, truth = pool.careful(p, wall)
            if code == records.NEAR_START:  # the careful step cannot tell whether it is inside its walls
                tally["starts at a corner"] += 1
                is_live[i] = False
                is_wrong = hits[i] != records.FLOOR and pool.is_floor_met_at_once(p)
            else:
                tally["lane answers"] += 1
                ulps = error_of(pool, p, wall, numbers[i], truth, tally) if code == hits[i] else np.inf
                tally["delicate"] += ulps is None
                is_wrong = ulps is not None and not ulps <= BOUND
                is_live[i] = not is_wrong
            if is_wrong:
                found.append((scene, p.tolist(), wall, int(hits[i]), numbers[i].tolist()))
    return found


def error_of(
    pool: Round, p: FloatArray, wall: int, answer: FloatArray, truth: FloatArray, tally: Counter[str]
) -> float | None:
    """Return a lane answer's backward ulps, 0 where only times are compared; None for a delicate step."""
    if pool.is_disk and p[3] * answer[2] < 0.0:
        # Through the base the careful step forgets that the start lay on the arc by definition, and so its
        # rounding counts. A quarter turn, which is exact, brings half of these chords above y = 0.
        if p[2] * answer[1] < 0.0:
            tally["across the base, by the time alone"] += 1
            return 0.0 if abs(answer[0] - truth[0]) <= CLOSE * truth[0] else np.inf
        sign = 1.0 if p[2] > 0.0 else -1.0
        p = np.array([p[0], p[1], -sign * p[3], sign * p[2], -sign * p[5], sign * p[4]])
        answer = np.array(
            [answer[0], -sign * answer[2], sign * answer[1], -sign * answer[4], sign * answer[3]]
        )
        _, truth = pool.careful(p, wall)
    ulps = pool.ulps(p, wall, answer, truth)
    if ulps is not None and BOUND < ulps < np.inf:
        # The careful step has errors too.
        tally["judged in pairs of floats"] += 1
        ulps = pool.ulps(p, wall, answer, pool.fine(p, wall))
    return ulps


def state_in(pool: Round, i: int) -> tuple[FloatArray, int]:
    """Return the state in a lane, as the kernels take it."""
    columns = (rows.T, rows.T_LOW, rows.X, rows.Y, rows.VX, rows.VY)
    return np.array([pool.pool[row + i] for row in columns]), int(pool.pool[rows.WALL + i])
