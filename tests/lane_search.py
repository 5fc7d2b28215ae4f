"""A search for wrong lane answers, aimed at what the checks of docs/lanes.md rule out.

Scenes whose walls move as far and the particles as slowly as lanes allow: near the least radius, mouths from
half the cap to a slit, deep floors, plateaus; starts on every wall. Each start goes three lane steps, so that
what a step leaves to the next is tried too, and every step that lanes show right is compared with the
careful step from the same state. `python tests/lane_search.py SEED N` searches N lane answers deep.
"""

from __future__ import annotations

import sys
from collections import Counter
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from mpmath import fp

from fast import codes, entries, follow, lanes
from fast.batch import LaneRound
from fast.compiled import FloatArray
from scene import BangBang, Cap, Fourier, Law, Mushroom, Scene, Stem
from scene.laws import value
from scene.tables import laws, width_factors

CLOSE = 2.0**-24  # relative: a wrong hit is off by much more, a right one's Newton step by much less
N_ROUNDS = 3


class Wrong(NamedTuple):
    """A lane answer that the careful step contradicts."""

    scene: Scene
    state: list[float]
    wall: int
    lane: tuple[int, float]
    careful: tuple[int, float]


def search(seed: int, n_answers: int, tally: Counter[str]) -> list[Wrong]:
    """Search until lanes have given `n_answers` answers; returns the wrong ones."""
    random, found = np.random.default_rng(seed), []
    while tally["lane answers"] < n_answers:
        scene = draw_scene(random)
        found += try_scene(scene, random, tally)
    return found


def try_scene(scene: Scene, random: np.random.Generator, tally: Counter[str]) -> list[Wrong]:
    """Fill a pool with starts in a scene and take lane steps from them."""
    pool, found = LaneRound(scene), []
    starts = [draw_start(scene, random) for _ in range(lanes.LANES)]
    age = follow.SERVES / pool.omega * random.random() if pool.omega else 0.0
    for i, (p, wall) in enumerate(starts):
        pool.fill(i, p, wall, age)
    is_live = np.array([is_valid(pool, p, wall) for p, wall in starts])
    for _ in range(N_ROUNDS):
        begun = [state_in(pool, i) for i in range(len(starts))]
        right, hits, numbers = (pool.skip if pool.is_disk else pool.fly)(len(starts))
        is_live &= right
        for i in np.flatnonzero(is_live):
            p, wall = begun[i]
            answer = (int(hits[i]), float(numbers[i, 0]))
            truth = careful_answer(pool, p, wall)
            tally["lane answers"] += 1
            if truth[0] != answer[0] or abs(truth[1] - answer[1]) > CLOSE * answer[1]:
                found.append(Wrong(scene, p.tolist(), wall, answer, truth))
                is_live[i] = False
    return found


def careful_answer(pool: LaneRound, p: FloatArray, wall: int) -> tuple[int, float]:
    """Return the careful step's wall and time, in a cap those of the next hit of the arc, unfolded."""
    q, total = p.copy(), 0.0
    if pool.is_disk and q[3] < 0.0:
        q[3], q[5] = -q[3], -q[5]
    for _ in range(2):
        code, dt = entries.single_step(*pool.compiled, q, wall, np.inf)
        total += dt
        if not pool.is_disk or code != codes.BASE:
            break
        wall = int(code)
    return int(code), total


def is_valid(pool: LaneRound, p: FloatArray, wall: int) -> bool:
    """Tell whether the careful step takes a start."""
    code, _ = entries.single_step(*pool.compiled, p.copy(), wall, np.inf)
    return bool(code < codes.APPROACHING)


def state_in(pool: LaneRound, i: int) -> tuple[FloatArray, int]:
    """Return the state in a lane, as the kernels take it."""
    rows = (lanes.T, lanes.T_LOW, lanes.X, lanes.Y, lanes.VX, lanes.VY)
    return np.array([pool.pool[row + i] for row in rows]), int(pool.pool[lanes.WALL + i])


def draw_scene(random: np.random.Generator) -> Scene:
    """Draw a scene that lanes know, its walls moving deeply."""
    kind, omega = random.random(), float(10.0 ** random.uniform(-0.5, 0.5))

    def law(least: float, most: float) -> Law:
        if random.random() < 0.25 or least == most:
            return float(least)
        # Smooth laws, laws with knots, or both in one scene.
        if kind < 0.5 or (kind < 0.7 and random.random() < 0.5):
            turn, swing = random.uniform(0, 2 * np.pi), 0.4999 * (most - least)
            cos, sin = (float(swing * np.cos(turn)),), (float(swing * np.sin(turn)),)
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
    slope = float(random.choice([0.0, random.uniform(-0.4, 0.4)]))
    if table < 0.25:
        least_w = 10.0 ** random.uniform(-2, 0)
        return Stem(w=law(least_w, random.uniform(least_w, 1.5)), h=h, slope=slope * least_w / most_h)
    if random.random() < 0.2:  # a rim so narrow that a flight leaves the arc and is at once in the mouth
        return Mushroom(r=r, nu=1.0 - float(10.0 ** random.uniform(-4, -1)), h=h)
    if random.random() < 0.5:
        nu = law(share * 10.0 ** random.uniform(-2, 0), share)
        least_nu = 0.009 * share
        return Mushroom(r=r, nu=nu, h=h, slope=slope * least_nu * least_r / most_h)
    w = law(0.05 * share * least_r, share * least_r)
    return Mushroom(r=r, w=w, h=h, slope=slope * 0.05 * share * least_r / most_h)


def draw_start(scene: Scene, random: np.random.Generator) -> tuple[FloatArray, int]:
    """Draw a start on a wall: the state as the kernels take it, and the wall's code."""
    t = float(_a_time(scene, random))
    now: dict[str, Any] = {name: float(value(fp, law, t)) for name, law in laws(scene).items()}
    rate: dict[str, Any] = {name: float(value(fp, law, t, 1)) for name, law in laws(scene).items()}
    along, away = 10.0 ** random.uniform(-3, 1.5, 2) * random.choice([1.0, 1.0, 0.03])
    along *= random.choice([-1.0, 1.0])
    wall = int(random.choice(_walls_of(scene), p=_SHARES[len(_walls_of(scene))]))
    if wall == codes.ARC:
        angle = random.uniform(0.0, np.pi) if random.random() < 0.7 else 10.0 ** random.uniform(-3, 0)
        out = rate["r"] - away
        e_x, e_y = np.cos(angle), np.sin(angle)
        place = (now["r"] * e_x, now["r"] * e_y, out * e_x - along * e_y, out * e_y + along * e_x)
        return np.array([t, 0.0, *place]), wall
    w, w_rate = _mouth(scene, t)
    if wall == codes.BASE:
        is_top = isinstance(scene, Stem)
        x = w * random.uniform(-1, 1) if is_top else w + (now["r"] - w) * random.random()
        return np.array([t, 0.0, x, 0.0, along, -away if is_top else away]), wall
    if wall == codes.FLOOR:
        at = (w - now["slope"] * now["h"]) * random.uniform(-1, 1)
        return np.array([t, 0.0, at, -now["h"], along, away - rate["h"]]), wall
    y = -now["h"] * random.random()
    sign = 1.0 if wall == codes.RIGHT else -1.0
    out = w_rate + now["slope"] * along - away
    return np.array([t, 0.0, sign * (w + now["slope"] * y), y, sign * out, along]), wall


def _walls_of(scene: Scene) -> npt.NDArray[np.int64]:
    if isinstance(scene, Cap):
        return np.array([codes.ARC])
    below = [codes.BASE, codes.LEFT, codes.RIGHT, codes.FLOOR]
    return np.array(below if isinstance(scene, Stem) else [codes.ARC, *below])


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
    # Half of the starts are a little before the least radius.
    r = getattr(scene, "r", None)
    if isinstance(r, Fourier) and random.random() < 0.5:
        least = np.arctan2(-r.sin[0], -r.cos[0]) + random.normal(-0.2, 0.4)
        return float((least + 2 * np.pi * random.integers(0, 5)) / (r.omega or 2 * np.pi))
    return float(random.uniform(0, 9))


if __name__ == "__main__":
    counts: Counter[str] = Counter()
    for wrong in search(int(sys.argv[1]), int(sys.argv[2]), counts):
        print(wrong)
    print(dict(counts))
