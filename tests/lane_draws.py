"""Draws of scenes and starts in which a wall comes and goes during one flight, for the search in lane_search.

Each group aims at one kind of flight of docs/lanes.md: one wall moves deeply, the particle leaves the wall named
with a velocity of the order of the walls', and of thousands of such starts those are kept on whose way some f falls
below zero and rises above it again within the time that lanes look ahead: there nearly every answer hangs on a
check. Some starts are kept unseen, so that the lanes have something to answer.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from fast import codes
from scene import BangBang, Cap, Fourier, Law, Mushroom, Scene, Stem
from scene.tables import laws, width_factors

Array = npt.NDArray[np.float64]
Start = tuple[Array, int]
N_CROWD, N_INSTANTS = 1500, 96
LOOK_AHEAD = 0.25  # phase, as in lanes.LONGEST_TURN


class Numbers(NamedTuple):
    """A law's values and its first two derivatives."""

    f: Array
    rate: Array
    bend: Array


class Group(NamedTuple):
    """Where the flights of a group begin, and which wall moves."""

    wall: int
    moving: str
    is_mouth_wide: bool = True


GROUPS = {
    "arc to base": Group(codes.ARC, "r", is_mouth_wide=False),
    "arc to stem": Group(codes.ARC, "r"),
    "base to arc": Group(codes.BASE, "r"),
    "arc to moving mouth": Group(codes.ARC, "w"),
    "side to arc": Group(codes.RIGHT, "w"),
    "side to moving arc": Group(codes.LEFT, "r"),
    "floor to arc": Group(codes.FLOOR, "w"),
    "floor to moving arc": Group(codes.FLOOR, "r"),
    "side under moving floor": Group(codes.LEFT, "h"),
    "rising floor": Group(codes.FLOOR, "h"),
}


def numbers(law: Law, t: Array) -> Numbers:
    """Return a law of one harmonic, of legs or constant at many times."""
    if isinstance(law, Fourier):
        omega = law.omega or 2.0 * np.pi / (law.period or 1.0)
        c, s = (law.cos or (0.0,))[0], (law.sin or (0.0,))[0]
        cosine, sine = np.cos(omega * t), np.sin(omega * t)
        wave, turned = c * cosine + s * sine, s * cosine - c * sine
        return Numbers(law.mean + wave, omega * turned, -omega * omega * wave)
    if isinstance(law, BangBang):
        times, ends = np.array(law.knots).T
        part = times[0] + np.mod(t - times[0], times[-1] - times[0])
        i = np.clip(np.searchsorted(times, part, side="right") - 1, 0, len(times) - 2)
        length, rise = times[i + 1] - times[i], ends[i + 1] - ends[i]
        s = (part - times[i]) / length
        late = s >= 0.5
        f = ends[i] + rise * np.where(late, 1.0 - 2.0 * (1.0 - s) ** 2, 2.0 * s * s)
        rate = 4.0 * rise / length * np.where(late, 1.0 - s, s)
        return Numbers(f, rate, 4.0 * rise / length**2 * np.where(late, -1.0, 1.0))
    return Numbers(np.full_like(t, law), np.zeros_like(t), np.zeros_like(t))


def walls_at(scene: Scene, t: Array) -> dict[str, Numbers]:
    """Return radius, half-width and depth, whichever the scene has, at many times."""
    found = {name: numbers(law, t) for name, law in laws(scene).items() if name in ("r", "h")}
    factors = [numbers(law, t) for law in width_factors(scene)] if not isinstance(scene, Cap) else []
    if len(factors) == 1:
        found["w"] = factors[0]
    elif factors:
        a, b = factors
        found["w"] = Numbers(
            a.f * b.f, a.rate * b.f + a.f * b.rate, a.bend * b.f + 2 * a.rate * b.rate + a.f * b.bend
        )
    return found


def draw_scene(group: Group, random: np.random.Generator) -> Scene:
    """Draw a scene in which the group's wall moves deeply."""
    swing = float(random.choice([random.uniform(0.5, 0.9), 1.0 - 10.0 ** random.uniform(-3, -1)]))
    moving = _moving(swing, random)
    share = 1.0 - 10.0 ** random.uniform(-4, -0.3) if group.is_mouth_wide else 10.0 ** random.uniform(-4, -1)
    share, depth = float(share), float(10.0 ** random.uniform(-1.5, 0.5))
    if group.moving == "h":
        return Mushroom(r=2.0, w=float(random.uniform(0.3, 1.9)), h=moving)
    if group.moving == "w":
        return Mushroom(r=float(1.0 + swing + 10.0 ** random.uniform(-3, 0)), w=moving, h=depth)
    if random.random() < 0.5 and group.is_mouth_wide:
        return Mushroom(r=moving, nu=share, h=depth)
    return Mushroom(r=moving, w=share * (1.0 - swing), h=depth)


def _moving(swing: float, random: np.random.Generator) -> Law:
    """Draw a law about 1 that comes down to 1 - swing."""
    if random.random() < 0.75:
        return Fourier(1.0, 1.0, (swing,))
    inner = float(random.uniform(0.2, 0.8))
    return BangBang(((0.0, 1.0), (inner, 1.0 - swing), (1.0, 1.0)))


def draw_crowd(scene: Scene, group: Group, random: np.random.Generator) -> Array:
    """Draw many starts on the group's wall; rows t, x, y, vx, vy, and how far they are looked at."""
    n = N_CROWD
    is_smooth = any(isinstance(law, Fourier) for law in laws(scene).values())
    period, ahead = (2.0 * np.pi, LOOK_AHEAD) if is_smooth else (1.0, 0.3)
    t = random.uniform(0.0, period, n)
    s = ahead * random.uniform(0.02, 1.0, n)
    now, then = walls_at(scene, t), walls_at(scene, t + s)
    pace = 1.0 / period
    small = 10.0 ** random.uniform(-6, 0, n) * pace
    sign = random.choice([-1.0, 1.0], n)
    inward = 1.0 - 10.0 ** random.uniform(-5, 0, n)
    if group.wall == codes.ARC:
        angle = np.where(random.random(n) < 0.5, random.uniform(0, np.pi, n), 10.0 ** random.uniform(-3, 0.4, n))
        x, y = now["r"].f * np.cos(angle), now["r"].f * np.sin(angle)
        edge = np.where(random.random(n) < 0.5, then["r"].f, then["w"].f)
        x_s, y_s = sign * edge * inward, np.zeros(n)
        vx, vy = (x_s - x) / s, (y_s - y) / s
    elif group.wall == codes.BASE:
        x, y = sign * (now["w"].f + (now["r"].f - now["w"].f) * inward), np.zeros(n)
        vx = sign * (now["r"].rate + pace * random.normal(size=n) * 10.0 ** random.uniform(-3, 0.5, n))
        vy = pace * 10.0 ** random.uniform(-4, 1, n)
    elif group.wall == codes.FLOOR:
        x, y = sign * now["w"].f * inward, -now["h"].f
        vx = sign * (now["w"].rate + small * random.choice([-1.0, 1.0], n))
        vy = np.where(random.random(n) < 0.7, -y / s, small - now["h"].rate)
    else:
        side = 1.0 if group.wall == codes.RIGHT else -1.0
        x, y = side * now["w"].f, -now["h"].f * np.where(random.random(n) < 0.5, random.random(n), inward)
        vx = side * (now["w"].rate - small)
        vy = np.where(random.random(n) < 0.7, -y / s, pace * random.normal(size=n))
    return np.column_stack([t, x, y, vx, vy, np.full(n, ahead)])


def comes_and_goes(scene: Scene, crowd: Array) -> npt.NDArray[np.bool_]:
    """Tell for which starts some f goes below zero on the way and comes back, before the base ends the flight."""
    t, x, y, vx, vy, ahead = crowd[:, :, None].transpose(1, 0, 2)
    s = ahead * np.arange(1, N_INSTANTS + 1) / N_INSTANTS
    now = walls_at(scene, t + s)
    x_s, y_s = x + vx * s, y + vy * s
    below = y_s < 0.0
    # The flight ends where it crosses y = 0 beyond the mouth.
    crosses = np.diff(below, axis=1, prepend=below[:, :1]) & (np.abs(x_s) > now["w"].f)
    open_way = np.cumsum(crosses, axis=1) == 0
    walls = {"r": (now["r"].f ** 2 - x_s**2 - y_s**2, ~below)}
    walls |= {"right": (now["w"].f - x_s, below), "left": (now["w"].f + x_s, below)}
    walls["floor"] = (y_s + now["h"].f, below)
    found = np.zeros(len(crowd), dtype=bool)
    for f, is_there in walls.values():
        is_seen = is_there & open_way
        met = np.maximum.accumulate(is_seen & (f < 0.0), axis=1)
        rises = np.maximum.accumulate(is_seen & (f > 0.0), axis=1)
        back = met & is_seen & (f > 0.0)
        found |= (back & rises).any(axis=1)
    return found


def draw_starts(scene: Scene, group: Group, n: int, random: np.random.Generator) -> list[Start]:
    """Draw n starts, most of them such that a wall comes and goes on the way."""
    crowd = draw_crowd(scene, group, random)
    directed = crowd[comes_and_goes(scene, crowd)][: 3 * n // 4]
    chosen = np.concatenate([directed, crowd[: n - len(directed)]])
    states = np.insert(chosen[:, :5], 1, 0.0, axis=1)
    return [(state, group.wall) for state in states]
