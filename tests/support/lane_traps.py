"""Starts that are solved for, for the search in lane_search: random ones hardly ever hang on these checks.

`misled chord` and `misled side` solve for a flight whose f has two or three roots close together, and for
which Newton's method from the lane's guess lands on the second or third of them. The other answers hang on a
rounding that as a rule goes unnoticed:

How long a hop is depends on the arc's rate less the particle's, and an error of the one is an error of the
other. As a rule rounding of the state or the time does as much. It does not where those are small: early,
when the phase itself is nearly 0, near an axis and nearly along the arc.

A side or the floor hands its rate to a particle that is much slower, rounded as it is where the wall was
quick, and where it stands nearly still for long no rounding of time or place does as much. A speed along the
wall does not help. The same holds for a slope that moves and is nearly zero.

A flight up a deep stem may be a million times as long as the cap is high: what is left of its time moves the
place of the hit along the path, and no rounding of the start does, which moves it across.
"""

from collections.abc import Callable
from math import comb

import numpy as np
from mpmath import fp

from fast.kernel import records
from fast.kernel.records import FloatArray
from scene import BangBang, Fourier, GivenLaw, Mushroom, Scene
from scene.laws import law_of
from support.lane_anywhere import Group, Start

N_CROWD = 4_000
REACH = 0.24  # phase


def zero_between(off: Callable[[FloatArray], FloatArray], low: FloatArray, high: FloatArray) -> FloatArray:
    """Return zeros of many functions by bisection, nan where the ends have one sign or off jumps."""
    below = off(low)
    ok = below * off(high) < 0.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        at = off(middle)
        is_left = below * at <= 0.0
        low = np.where(is_left, low, middle)
        high = np.where(is_left, middle, high)
        below = np.where(is_left, below, at)
    middle = 0.5 * (low + high)
    return np.where(ok & (np.abs(off(middle)) < 1e-7), middle, np.nan)


def misled_chord(n: int, random: np.random.Generator) -> tuple[Scene, list[Start]]:
    """Draw captured particles slower than the arc's bend, near its least radius, of about four amplitudes.

    There p - r, p the distance from the centre, may bend upwards, downwards and upwards again: the arc is
    met, left and met once more. The speed and direction are such that f has roots at u_1 and u_3; u_3 is
    solved for such that Newton's second correction ends there.
    """
    mean = 4.0 + float(10.0 ** random.uniform(-3, 0))
    t = -random.uniform(0.02, 0.09, N_CROWD)
    u_1 = REACH * random.uniform(0.3, 0.8, N_CROWD)
    n_steps = int(random.integers(1, 3))
    r = mean - np.cos(t)
    rate = np.sin(t)
    bend = np.cos(t)

    def grown(u: FloatArray) -> FloatArray:  # (r(t + u)^2 - r(t)^2) / u
        d = np.cos(t) - np.cos(t + u)
        return np.asarray(d * (2.0 * r + d) / u)

    def motion(u_3: FloatArray) -> tuple[FloatArray, FloatArray]:
        v2 = (grown(u_3) - grown(u_1)) / (u_3 - u_1)
        return v2, 0.5 * (grown(u_1) - v2 * u_1)

    def missed(u_3: FloatArray) -> FloatArray:
        v2, q = motion(u_3)
        s = 2.0 * (r * rate - q) / (v2 - rate**2 - r * bend)
        for _ in range(n_steps):
            slope = 2.0 * ((mean - np.cos(t + s)) * np.sin(t + s) - (s * v2 + q))
            s = s - s * (grown(s) - s * v2 - 2.0 * q) / slope
        return np.asarray(s - u_3)

    with np.errstate(all="ignore"):
        first = u_1 * (1.0 + 10.0 ** random.uniform(-2.5, -0.2, N_CROWD))
        u_3 = zero_between(missed, first, first * random.uniform(1.0, 1.3, N_CROWD))
        v2, q = motion(u_3)
        out = q / r
        slope = 2.0 * ((mean - np.cos(t + u_3)) * np.sin(t + u_3) - (u_3 * v2 + q))
        chosen = np.flatnonzero((v2 > out**2) & (out < rate) & (slope < 0.0) & (u_3 < 0.25))[:n]
    scene = Mushroom(r=Fourier(mean, 1.0, (-1.0,)), w=0.01, h=1.0)
    starts = []
    for i, turn in zip(chosen, random.uniform(0.3, 2.0, len(chosen)), strict=True):
        e_x = np.cos(turn)
        e_y = np.sin(turn)
        along = np.sqrt(v2[i] - out[i] ** 2)
        place = (r[i] * e_x, r[i] * e_y, out[i] * e_x - along * e_y, out[i] * e_y + along * e_x)
        starts.append((np.array([t[i], 0.0, *place]), int(records.ARC)))
    return scene, starts


def misled_side(n: int, random: np.random.Generator) -> tuple[Scene, list[Start]]:
    """Draw flights from the floor along the right side, whose w = nu r is of the fourth order at its least.

    f = w - y - x then has the shape of any quartic. Its first roots are u_1 and u_2; u_2 is solved for such
    that Newton's method ends there.
    """
    swing = float(random.uniform(0.2, 0.9))
    other = min(0.98, swing * (1.0 + random.normal() * float(10.0 ** random.uniform(-3, -1.5))))
    phi = 2.0 * np.arccos(swing)
    r = Fourier(1.0, 1.0, (swing,))
    nu = Fourier(0.5, 1.0, (float(0.5 * other * np.cos(phi)),), (float(-0.5 * other * np.sin(phi)),))
    t = np.pi - 0.5 * phi + random.uniform(-0.2, 0.1, N_CROWD)
    n_steps = int(random.integers(1, 4))

    def w(u: FloatArray | float) -> FloatArray:
        return np.asarray(0.5 * (1.0 + swing * np.cos(t + u)) * (1.0 + other * np.cos(t + u + phi)))

    def rate(u: FloatArray | float) -> FloatArray:
        one = t + u
        two = t + u + phi
        return np.asarray(
            -0.5 * swing * np.sin(one) * (1.0 + other * np.cos(two))
            - 0.5 * other * np.sin(two) * (1.0 + swing * np.cos(one))
        )

    bend = -0.5 * (swing * np.cos(t) + other * np.cos(t + phi) + 2.0 * swing * other * np.cos(2.0 * t + phi))
    u_1 = REACH * random.uniform(0.2, 0.9, N_CROWD)

    def motion(u_2: FloatArray) -> tuple[FloatArray, FloatArray]:
        v = (w(u_2) - w(u_1)) / (u_2 - u_1)
        return v, w(u_1) - v * u_1

    def missed(u_2: FloatArray) -> FloatArray:
        v, x = motion(u_2)
        s = (w(0.0) - x) / (v - rate(0.0))
        s = s * (1.0 + 0.5 * bend * s / (v - rate(0.0)))
        for _ in range(n_steps):
            s = s - (w(s) - x - v * s) / (rate(s) - v)
        return np.asarray(s - u_2)

    with np.errstate(all="ignore"):
        first = u_1 * (1.0 + 10.0 ** random.uniform(-3, -0.1, N_CROWD))
        u_2 = zero_between(missed, first, first * random.uniform(1.0, 1.3, N_CROWD))
        v, x = motion(u_2)
        is_good = (x < w(0.0)) & (v > rate(0.0)) & (rate(u_1) < v) & (u_2 < REACH)
    scene = Mushroom(r=r, nu=nu, h=1.0, slope=-1.0)  # it leans, so that x may change quickly along it
    starts = [
        (np.array([t[i], 0.0, x[i] + 1.0, -1.0, v[i] - 3.0, 3.0]), int(records.FLOOR))
        for i in np.flatnonzero(is_good)[:n]
    ]
    return scene, starts


def early_hop(n: int, random: np.random.Generator) -> tuple[Scene, list[Start]]:
    """Draw starts on the arc near t = 0, near an axis, with a velocity nearly along it."""
    r = _radius(random)
    return Mushroom(r=r, w=1e-3, h=0.1), [_start(r, random) for _ in range(n)]


def _radius(random: np.random.Generator) -> GivenLaw:
    swing = float(10.0 ** random.uniform(-2, -0.1))
    if random.random() < 0.3:
        inner = float(random.uniform(0.2, 0.8))
        return BangBang(((0.0, 1.0), (inner, 1.0 - swing), (1.0, 1.0)))
    cos = (swing,) if random.random() < 0.5 else (0.7 * swing, -0.3 * swing)
    sin = (0.0,) if random.random() < 0.5 else (float(0.1 * swing * 10.0 ** random.uniform(-9, 0)),)
    return Fourier(1.0, 1.0, cos, sin)


def _start(r: GivenLaw, random: np.random.Generator) -> Start:
    t = 0.0 if random.random() < 0.3 else float(10.0 ** random.uniform(-12, 0))
    now = float(law_of(r).value(fp, t))
    rate = float(law_of(r).value(fp, t, 1))
    off = 0.0 if random.random() < 0.3 else float(10.0 ** random.uniform(-12, 0))
    angle = 0.5 * np.pi - off if random.random() < 0.8 else off + 1e-3
    along = float(random.choice([-1.0, 1.0]) * 10.0 ** random.uniform(-1, 3))
    out = rate - abs(along) * 10.0 ** random.uniform(-9, -0.3)
    e_x = float(np.cos(angle)) if off else 0.0
    e_y = float(np.sin(angle))
    place = (now * e_x, now * e_y, out * e_x - along * e_y, out * e_y + along * e_x)
    return np.array([t, 0.0, *place]), int(records.ARC)


def up_a_deep_stem(n: int, random: np.random.Generator) -> tuple[Scene, list[Start]]:
    """Draw starts on the floor of a deep stem, through the mouth to the arc."""
    depth = float(10.0 ** random.uniform(2, 6))
    swing = float(random.choice([0.0, 0.3]))
    scene = Mushroom(r=Fourier(1.0, 1.0, (swing,)), nu=0.95, h=depth)
    starts = []
    for _ in range(n):
        t = float(random.uniform(0, 9))
        speed = float(depth * 10.0 ** random.uniform(1, 4))
        width = 0.95 * (1.0 - swing)
        x, at_mouth = random.uniform(-width, width, 2)
        state = np.array([t, 0.0, x, -depth, speed * (at_mouth - x) / depth, speed])
        starts.append((state, int(records.FLOOR)))
    return scene, starts


def slow_beside_a_plateau(n: int, random: np.random.Generator) -> tuple[Scene, list[Start]]:
    """Draw short flights, slow towards a wall that stands nearly still, and is quick at other times."""
    law = _plateau(int(random.integers(2, 9)))
    is_floor = random.random() < 0.5
    starts = []
    scene = Mushroom(r=3.0, w=1.0, h=law) if is_floor else Mushroom(r=3.0, w=law, h=1.0)
    for _ in range(n):
        t = float(2.0 * np.pi * random.integers(0, 5) + random.uniform(-0.4, 0.2))
        speed = 10.0 ** random.uniform(-4, -1.5)
        is_quick = random.random() < 0.5
        along = 10.0 ** random.uniform(-0.5, 0.7) if is_quick else speed * random.random()
        s = min(speed, 0.5 / along) * 10.0 ** random.uniform(-3, -1)
        there = float(law_of(law).value(fp, t + s))
        rate = float(law_of(law).value(fp, t + s, 1))
        if is_floor:
            place = (1.0, (speed + rate) * s - there, -along, -speed - rate)
            wall = records.RIGHT
        else:
            place = (there - (speed + rate) * s, -1.0, speed + rate, along)
            wall = records.FLOOR
        starts.append((np.array([t, 0.0, *place]), int(wall)))
    return scene, starts


def _plateau(n: int) -> Fourier:
    """Return 1 + 0.4 ((1 - cos t) / 2)^n, flat about t = 0."""
    shares = [0.4 * comb(2 * n, n - k) / 4.0**n for k in range(n + 1)]
    waves = tuple(2.0 * (-1) ** k * share for k, share in enumerate(shares))
    return Fourier(1.0 + shares[0], 1.0, waves[1:])


def across_a_slope_near_zero(n: int, random: np.random.Generator) -> tuple[Scene, list[Start]]:
    """Draw nearly level flights from the left side to the right, whose slope is only briefly small."""
    swing = 1.3
    phase = float(random.uniform(0.0, 6.0))
    waves = (swing * np.cos(phase),), (swing * np.sin(phase),)
    slope = Fourier(-swing - 1e-9, 1.0, *(tuple(map(float, wave)) for wave in waves))
    scene = Mushroom(r=1.0, w=0.5, h=0.02, slope=slope)
    starts = []
    for _ in range(n):
        t = phase + float(2.0 * np.pi * random.integers(0, 2) + random.uniform(-0.06, -0.01))
        y = -float(random.uniform(0.002, 0.018))
        m = float(law_of(slope).value(fp, t))
        vx = float(random.uniform(10.0, 40.0))
        vy = float(random.choice([-1, 1]) * 10.0 ** random.uniform(-4, -1))
        starts.append((np.array([t, 0.0, -(0.5 + m * y), y, vx, vy]), int(records.LEFT)))
    return scene, starts


TRAPS: dict[str, Group] = {
    "misled chord": Group(misled_chord, is_captured=True),
    "misled side": Group(misled_side),
    "early hop": Group(early_hop),
    "early hop through the base": Group(early_hop, is_captured=True),
    "up a deep stem": Group(up_a_deep_stem),
    "slow beside a plateau": Group(slow_beside_a_plateau),
    "across a slope near zero": Group(across_a_slope_near_zero),
}
