"""Flights whose answers hang on a rounding that as a rule goes unnoticed, for the search in lane_search.

How long a hop is depends on the arc's rate less the particle's, and an error of the one is an error of the
other. As a rule rounding of the state or the time does as much. It does not where those are small: early,
when the phase itself is nearly 0, near an axis and nearly along the arc.

A side or the floor hands its rate to who is much slower, rounded as it is where the wall was quick, and where
it stands nearly still for long no rounding of time or place does as much.

A flight up a deep stem may be a million times as long as the cap is high: what is left of its time moves the
place of the hit along the path, and no rounding of the start does, which moves it across.
"""

from __future__ import annotations

from math import comb

import numpy as np
import numpy.typing as npt
from mpmath import fp

from fast.kernel import records
from scene import BangBang, Fourier, Law, Mushroom, Scene
from scene.laws import value

Start = tuple[npt.NDArray[np.floating], int]


def early_hop(n: int, random: np.random.Generator) -> tuple[Scene, list[Start]]:
    """Draw starts on the arc near t = 0, near an axis, with a velocity nearly along it."""
    r = _radius(random)
    return Mushroom(r=r, w=1e-3, h=0.1), [_start(r, random) for _ in range(n)]


def _radius(random: np.random.Generator) -> Law:
    swing = float(10.0 ** random.uniform(-2, -0.1))
    if random.random() < 0.3:
        inner = float(random.uniform(0.2, 0.8))
        return BangBang(((0.0, 1.0), (inner, 1.0 - swing), (1.0, 1.0)))
    cos = (swing,) if random.random() < 0.5 else (0.7 * swing, -0.3 * swing)
    sin = (0.0,) if random.random() < 0.5 else (float(0.1 * swing * 10.0 ** random.uniform(-9, 0)),)
    return Fourier(1.0, 1.0, cos, sin)


def _start(r: Law, random: np.random.Generator) -> Start:
    t = 0.0 if random.random() < 0.3 else float(10.0 ** random.uniform(-12, 0))
    now, rate = float(value(fp, r, t)), float(value(fp, r, t, 1))
    off = 0.0 if random.random() < 0.3 else float(10.0 ** random.uniform(-12, 0))
    angle = 0.5 * np.pi - off if random.random() < 0.8 else off + 1e-3
    along = float(random.choice([-1.0, 1.0]) * 10.0 ** random.uniform(-1, 3))
    out = rate - abs(along) * 10.0 ** random.uniform(-9, -0.3)
    e_x, e_y = float(np.cos(angle)) if off else 0.0, float(np.sin(angle))
    place = (now * e_x, now * e_y, out * e_x - along * e_y, out * e_y + along * e_x)
    return np.array([t, 0.0, *place]), int(records.ARC)


def up_a_deep_stem(n: int, random: np.random.Generator) -> tuple[Scene, list[Start]]:
    """Draw starts on the floor of a deep stem, through the mouth to the arc."""
    depth, swing = float(10.0 ** random.uniform(2, 6)), float(random.choice([0.0, 0.3]))
    scene = Mushroom(r=Fourier(1.0, 1.0, (swing,)), nu=0.95, h=depth)
    starts = []
    for _ in range(n):
        t, speed = float(random.uniform(0, 9)), float(depth * 10.0 ** random.uniform(1, 4))
        width = 0.95 * (1.0 - swing)
        x, at_mouth = random.uniform(-width, width, 2)
        state = np.array([t, 0.0, x, -depth, speed * (at_mouth - x) / depth, speed])
        starts.append((state, int(records.FLOOR)))
    return scene, starts


def slow_beside_a_plateau(n: int, random: np.random.Generator) -> tuple[Scene, list[Start]]:
    """Draw short slow flights to a floor or a side that stands nearly still, and is quick at other times."""
    law, is_floor, starts = _plateau(int(random.integers(2, 9))), random.random() < 0.5, []
    scene = Mushroom(r=3.0, w=1.0, h=law) if is_floor else Mushroom(r=3.0, w=law, h=1.0)
    for _ in range(n):
        t = float(2.0 * np.pi * random.integers(0, 5) + random.uniform(-0.4, 0.2))
        speed, along = 10.0 ** random.uniform(-4, -1.5), random.random()
        s = speed * 10.0 ** random.uniform(-3, -1)
        there, rate = float(value(fp, law, t + s)), float(value(fp, law, t + s, 1))
        if is_floor:
            place, wall = (1.0, (speed + rate) * s - there, -speed * along, -speed - rate), records.RIGHT
        else:
            place, wall = (there - (speed + rate) * s, -1.0, speed + rate, speed * along), records.FLOOR
        starts.append((np.array([t, 0.0, *place]), int(wall)))
    return scene, starts


def _plateau(n: int) -> Fourier:
    """Return 1 + 0.4 ((1 - cos t) / 2)^n, flat about t = 0."""
    shares = [0.4 * comb(2 * n, n - k) / 4.0**n for k in range(n + 1)]
    waves = tuple(2.0 * (-1) ** k * share for k, share in enumerate(shares))
    return Fourier(1.0 + shares[0], 1.0, waves[1:])
