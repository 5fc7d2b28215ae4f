"""A search for wrong lane answers, aimed at what the checks of docs/lanes.md rule out.

Of two halves. `anywhere` draws scenes whose walls move as far and the particles as slowly as lanes allow:
near the least radius, mouths from half the cap to a slit, deep floors, plateaus; starts on every wall. The
groups of `lane_draws` and `lane_traps` aim at one kind of flight each. Each start goes three lane steps, so
that what a step leaves to the next is tried too. An answer is wrong that names another wall than the careful
step from the same state, or differs from it by more than 4 backward ulps; or another than the floor, from a
start above it by less than the careful step tells, but rising slower. `python lane_search.py SEED N`
searches N lane answers deep in each group.
"""

from __future__ import annotations

import sys
from collections import Counter
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from mpmath import fp

from fast.batch import LaneRound, as_particle, followed_paths, residual
from fast.kernel import lanes, pools, records
from fast.kernel.fine_step import fine_path
from fast.kernel.records import DEPTH, RATE, FloatArray
from scene import BangBang, Cap, Fourier, Law, Mushroom, Scene, Stem
from scene.laws import value
from scene.tables import laws, width_factors
from support.lane_draws import GROUPS, Group, Start, draw_starts
from support.lane_draws import draw_scene as draw_directed_scene
from support.lane_traps import TRAPS, Trap

BOUND = 4.0  # backward ulps
CLOSE = 2.0**-24  # relative, where no more can be asked: see error_of
NUDGES = (2.0**-36, 2.0**-46)  # of each number of a state: for the derivatives of a step
ANYWHERE = "anywhere"
N_ROUNDS = 3
ANSWERS_OF_A_TRAP = 10  # that a draw of starts solved for stands for


class Wrong(NamedTuple):
    """A lane answer that the careful step contradicts."""

    scene: Scene
    state: list[float]
    wall: int
    lane: tuple[int, list[float]]
    careful: tuple[int, list[float]]


class Round(LaneRound):
    """A round of the lanes, of the honest kernels or of faulty ones, beside the careful step.

    Attributes:
        is_disk: whether particles move unfolded through the base: in a cap, and as captured ones.
    """

    def __init__(self, scene: Scene, kernels: ModuleType = lanes, *, is_captured: bool = False) -> None:
        super().__init__(scene)
        self.kernels = kernels
        self.is_cap, self.is_disk = self.is_disk, self.is_disk or is_captured

    def fill_all(self, starts: list[Start], age: float = 0.0) -> None:
        """Put starts into the first lanes, their laws known from `age` before them."""
        for lane, (p, wall) in enumerate(starts):
            self.fill(lane, p, wall, age)

    def advance(self, n: int) -> None:
        """Take a step in n lanes; faulty kernels run uncompiled, on a list."""
        if self.is_disk:
            # A step is judged from its state alone, not from the angular momentum of the interval so far.
            x, y, vx, vy = (self.row(r, n) for r in (pools.X, pools.Y, pools.VX, pools.VY))
            self.row(pools.SPIN, n)[:] = x * vy - y * vx
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
        of, limits, k = self.in_lanes, self.worker.limits, self.kernels
        waves = of.waves if of.degree in (k.ONE_WAVE, k.TWO_WAVES) else None
        step = k.chord if self.is_disk else k.fly
        step(a, count, self.worker.table, waves, of.slope, (0,) * of.degree, limits)

    def correct_lane(self, a: list[float], i: int) -> None:
        """Correct a step that is not yet right again, as the next rounds do."""
        k, known = self.kernels, (self.compiled, self.in_lanes.pieces, self.in_lanes.degree)
        spare = [0.0] * pools.POOL_SIZE
        k.copy_rows(a, i, spare, 0, 0, pools.POOL_SIZE)
        while spare[pools.FATE] in (pools.COARSE, pools.FAR) and spare[pools.TRIES] <= pools.MAX_CORRECTIONS:
            if spare[pools.FATE] == pools.FAR:
                t = spare[pools.T] + spare[pools.S]
                k.set_reference(spare, 0, t, spare[pools.T_LOW], *known)
            self.call_loop(spare, 1)
        k.copy_rows(spare, 0, a, i, 0, pools.POOL_SIZE)

    def careful_step(self, p: FloatArray, wall: int) -> tuple[int, float, FloatArray]:
        """Return the scalar step's wall, its time, and the state after, from a state and its wall."""
        paths = followed_paths(self.compiled, p[None], np.array([wall]), 1, np.inf)
        return int(paths.codes[0]), float(paths.steps[0, 0, 0]), paths.ends[0]

    def careful(self, p: FloatArray, wall: int) -> tuple[int, FloatArray]:
        """Return the careful step's wall and dt, x, y, vx, vy; unfolded, those of the next hit of the arc."""
        q, total, is_folded = p.copy(), 0.0, False
        if self.is_disk and q[3] < 0.0:
            q[3], q[5], is_folded = -q[3], -q[5], True
        code = records.NO_WALL
        for _ in range(2):
            code, dt, q = self.careful_step(q, wall)
            total += dt
            if not self.is_disk or code != records.BASE:
                break
            wall, is_folded = int(code), not is_folded
        if is_folded:
            q[3], q[5] = -q[3], -q[5]
        return int(code), np.array([total, *q[2:]])

    def is_floor_met_at_once(self, p: FloatArray) -> bool:
        """Tell whether a start is above the floor by no more than rounding, in pairs of floats, and falls."""
        f, error = residual(as_particle(p, int(records.FLOOR)), self.compiled, self.anchors)
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
        start = np.array([[p[0], p[1]], *([v, 0.0] for v in p[2:])])
        steps, met = np.zeros((1, 6, 2)), np.zeros(1, dtype=np.int64)
        if is_folded:
            start[[2, 4]] *= -1.0
        called_off = np.zeros(1, np.int64)
        fine_path(self.compiled, self.anchors, start, wall, np.inf, steps, met, called_off)
        found = np.delete(steps[0, :, 0], 1)
        if is_folded:
            found[[2, 4]] *= -1.0
        return found

    def moved(self, p: FloatArray, wall: int, nudge: float) -> FloatArray | None:
        """Return the sum over the start's numbers of |d step / d number| |number|, by differences."""
        total, code = np.zeros(5), None
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


def search(
    seed: int, n: int, tally: Counter[str], group: str = ANYWHERE, kernels: ModuleType = lanes
) -> list[Wrong]:
    """Search one group of draws until lanes have given n answers; returns the wrong ones.

    The search of faulty kernels ends with the first draw in which they are found out.
    """
    random, found = np.random.default_rng(seed), []
    before = tally["lane answers"]
    draws = 0
    # Starts that are solved for are mostly left to the careful step: the draws are then counted.
    while tally["lane answers"] < before + n and (group not in TRAPS or draws < n // ANSWERS_OF_A_TRAP):
        if found and kernels is not lanes:
            break
        draws += 1
        if group == ANYWHERE:
            scene = draw_scene(random)
            starts = [draw_start(scene, random) for _ in range(pools.LANES)]
        elif group in TRAPS:
            scene, starts = TRAPS[group].draw(pools.LANES, random)
        else:
            scene = draw_directed_scene(GROUPS[group], random)
            starts = draw_starts(scene, GROUPS[group], pools.LANES, random)
        aims: dict[str, Group | Trap] = {**GROUPS, **TRAPS}
        is_captured = group in aims and aims[group].is_captured
        found += try_starts(Round(scene, kernels, is_captured=is_captured), scene, starts, random, tally)
    return found


def try_starts(
    pool: Round, scene: Scene, starts: list[Start], random: np.random.Generator, tally: Counter[str]
) -> list[Wrong]:
    """Fill a pool with starts in a scene and take lane steps from them."""
    found = []
    age = pool.serves * random.random() if pool.serves < np.inf and random.random() < 0.5 else 0.0
    pool.fill_all(starts, age)
    is_live = np.array([is_valid(pool, *start) for start in starts], dtype=bool)
    for _ in range(N_ROUNDS):
        begun = [state_in(pool, i) for i in range(len(starts))]
        right, hits, numbers = pool.step(len(starts))
        tally["steps"] += int(is_live.sum())
        is_live &= right
        for i in np.flatnonzero(is_live):
            p, wall = begun[i]
            code, truth = pool.careful(p, wall)
            if code == records.START:  # the careful step cannot tell whether it is inside its walls
                tally["starts at a corner"] += 1
                is_live[i] = False
                if hits[i] != records.FLOOR and pool.is_floor_met_at_once(p):
                    found.append(
                        Wrong(scene, p.tolist(), wall, (int(hits[i]), numbers[i].tolist()), (code, []))
                    )
                continue
            tally["lane answers"] += 1
            ulps = error_of(pool, p, wall, numbers[i], truth, tally) if code == hits[i] else np.inf
            if ulps is None:
                tally["delicate"] += 1
            elif not ulps <= BOUND:
                found.append(
                    Wrong(
                        scene, p.tolist(), wall, (int(hits[i]), numbers[i].tolist()), (code, truth.tolist())
                    )
                )
                is_live[i] = False
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


def is_valid(pool: Round, p: FloatArray, wall: int) -> bool:
    """Tell whether the careful step takes a start."""
    code, _, _ = pool.careful_step(p, wall)
    return bool(code < records.APPROACHING)


def state_in(pool: Round, i: int) -> tuple[FloatArray, int]:
    """Return the state in a lane, as the kernels take it."""
    rows = (pools.T, pools.T_LOW, pools.X, pools.Y, pools.VX, pools.VY)
    return np.array([pool.pool[row + i] for row in rows]), int(pool.pool[pools.WALL + i])


def draw_scene(random: np.random.Generator) -> Scene:
    """Draw a scene that lanes know, its walls moving deeply."""
    kind, omega = random.random(), float(10.0 ** random.uniform(-0.5, 0.5))

    def law(least: float, most: float) -> Law:
        if random.random() < 0.25 or least == most:
            return float(least)
        # Smooth laws, laws with knots, or both in one scene.
        if kind < 0.5 or (kind < 0.7 and random.random() < 0.5):
            n, swing = int(random.choice([1, 1, 2, 5, 16])), 0.4999 * (most - least)
            turns, sizes = random.uniform(0, 2 * np.pi, n), random.random(n) / np.arange(1, n + 1) ** 2
            sizes *= swing / sizes.sum()
            cos, sin = (tuple(map(float, sizes * wave(turns))) for wave in (np.cos, np.sin))
            if kind < 0.5:
                return Fourier(mean=0.5 * (least + most), omega=omega, cos=cos, sin=sin)
            return Fourier(mean=0.5 * (least + most), period=1.0, cos=cos, sin=sin)
        inner = np.sort(random.uniform(0.05, 0.95, 3))
        ends = [float(v) for v in random.uniform(least, most, 3)]
        if random.random() < 0.5:
            ends[1] = ends[0]
        times = [0.0, *map(float, inner), 1.0]
        return BangBang(knots=tuple(zip(times, [ends[2], *ends, ends[2]], strict=True)))

    least_r = 10.0 ** random.uniform(-3, 0)
    r = law(least_r, random.uniform(least_r, 2.0))
    table = random.random()
    if table < 0.1:
        return Cap(r=r)
    least_h = 10.0 ** random.uniform(-2, 0.5)
    most_h = random.uniform(least_h, 4.0 + least_h)
    h = law(least_h, most_h)
    share = min(10.0 ** random.uniform(-3, 0.3), 0.95)
    lean = float(random.choice([0.0, random.uniform(-0.4, 0.4)]))

    def slope(size: float) -> Law:
        return law(*sorted((lean * size, -0.4 * size))) if random.random() < 0.5 else lean * size

    if table < 0.25:
        least_w = 10.0 ** random.uniform(-2, 0)
        return Stem(w=law(least_w, random.uniform(least_w, 1.5)), h=h, slope=slope(least_w / most_h))
    if random.random() < 0.2:  # a rim so narrow that a flight leaves the arc and is at once in the mouth
        return Mushroom(r=r, nu=1.0 - float(10.0 ** random.uniform(-4, -1)), h=h)
    if random.random() < 0.5:
        nu = law(share * 10.0 ** random.uniform(-2, 0), share)
        least_nu = 0.009 * share
        return Mushroom(r=r, nu=nu, h=h, slope=slope(least_nu * least_r / most_h))
    w = law(0.05 * share * least_r, share * least_r)
    return Mushroom(r=r, w=w, h=h, slope=slope(0.05 * share * least_r / most_h))


def draw_start(scene: Scene, random: np.random.Generator) -> tuple[FloatArray, int]:
    """Draw a start on a wall: the state as the kernels take it, and the wall's code."""
    t = float(_a_time(scene, random))
    now: dict[str, Any] = {name: float(value(fp, law, t)) for name, law in laws(scene).items()}
    rate: dict[str, Any] = {name: float(value(fp, law, t, 1)) for name, law in laws(scene).items()}
    along, away = 10.0 ** random.uniform(-3, 1.5, 2) * random.choice([1.0, 1.0, 0.03])
    along *= random.choice([-1.0, 1.0])
    wall = int(random.choice(_walls_of(scene), p=_SHARES[len(_walls_of(scene))]))
    if wall == records.ARC:
        angle = random.uniform(0.0, np.pi) if random.random() < 0.7 else 10.0 ** random.uniform(-3, 0)
        out = rate["r"] - away
        bend = float(value(fp, laws(scene)["r"], t, 2))
        curl = rate["r"] ** 2 + now["r"] * bend
        if random.random() < 0.5 and curl > 0.0:
            # The arc's function is just concave here, and will not stay so: it may dip, and come back before
            # the particle is down at y = 0.
            speed = np.sqrt(curl * (1.0 + 10.0 ** random.uniform(-3, 0.5)))
            out = rate["r"] - speed * 10.0 ** random.uniform(-5, -1)
            along = -np.sqrt(max(speed**2 - out**2, 0.0))
            angle = random.random()
        e_x, e_y = np.cos(angle), np.sin(angle)
        place = (now["r"] * e_x, now["r"] * e_y, out * e_x - along * e_y, out * e_y + along * e_x)
        return np.array([t, 0.0, *place]), wall
    w, w_rate = _mouth(scene, t)
    if wall == records.BASE:
        is_top = isinstance(scene, Stem)
        x = w * random.uniform(-1, 1) if is_top else w + (now["r"] - w) * random.random()
        return np.array([t, 0.0, x, 0.0, along, -away if is_top else away]), wall
    if wall == records.FLOOR:
        at = (w - now["slope"] * now["h"]) * random.uniform(-1, 1)
        return np.array([t, 0.0, at, -now["h"], along, away - rate["h"]]), wall
    y = -now["h"] * random.random()
    sign = 1.0 if wall == records.RIGHT else -1.0
    out = w_rate + rate["slope"] * y + now["slope"] * along - away
    return np.array([t, 0.0, sign * (w + now["slope"] * y), y, sign * out, along]), wall


def _walls_of(scene: Scene) -> npt.NDArray[np.int64]:
    if isinstance(scene, Cap):
        return np.array([records.ARC])
    below = [records.BASE, records.LEFT, records.RIGHT, records.FLOOR]
    return np.array(below if isinstance(scene, Stem) else [records.ARC, *below])


_SHARES = {1: [1.0], 4: [0.25] * 4, 5: [0.6, 0.1, 0.1, 0.1, 0.1]}


def _mouth(scene: Scene, t: float) -> tuple[float, float]:
    if isinstance(scene, Cap):
        return 0.0, 0.0
    factors = width_factors(scene)
    values = [float(value(fp, law, t)) for law in factors]
    rates = [float(value(fp, law, t, 1)) for law in factors]
    if len(factors) == 1:
        return values[0], rates[0]
    return values[0] * values[1], rates[0] * values[1] + values[0] * rates[1]


def _a_time(scene: Scene, random: np.random.Generator) -> float:
    """Draw a time, half of them a little before the least radius."""
    r = getattr(scene, "r", None)
    if isinstance(r, Fourier) and random.random() < 0.5:
        least = np.arctan2(-r.sin[0], -r.cos[0]) + random.normal() * 10.0 ** random.uniform(-3, 0)
        return float((least + 2 * np.pi * random.integers(0, 5)) / (r.omega or 2 * np.pi))
    return float(random.uniform(0, 9))


if __name__ == "__main__":
    for name in (ANYWHERE, *GROUPS, *TRAPS):
        counts: Counter[str] = Counter()
        for wrong in search(int(sys.argv[1]), int(sys.argv[2]), counts, name):
            print(wrong)
        print(name, dict(counts), flush=True)
