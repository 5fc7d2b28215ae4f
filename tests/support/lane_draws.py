"""Draws of scenes and starts in which a wall comes and goes during one flight, for the search in lane_search.

Each group aims at one kind of flight of docs/lanes.md: one wall moves deeply, the particle leaves the wall
named with a velocity of the order of the walls', and of thousands of such starts those are kept on whose way
some f falls below zero and rises above it again within the time that lanes look ahead: there nearly every
answer hangs on a check. Some starts are kept unseen, so that the lanes have something to answer.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from fast.kernel import records
from scene import BangBang, Cap, Fourier, Law, Mushroom, Scene, Stem
from scene.tables import laws, width_factors

Array = npt.NDArray[np.floating[Any]]
Start = tuple[Array, int]
N_CROWD, N_INSTANTS = 1500, 96
LOOK_AHEAD = 0.25  # phase


class Numbers(NamedTuple):
    """A law's values and its first three derivatives."""

    f: Array
    rate: Array
    bend: Array
    third: Array


class Group(NamedTuple):
    """Where the flights of a group begin, and which wall moves."""

    wall: int
    moving: str
    is_mouth_wide: bool = True
    is_captured: bool = False


GROUPS = {
    "arc to base": Group(int(records.ARC), "r", is_mouth_wide=False),
    "arc to stem": Group(int(records.ARC), "r"),
    "base to arc": Group(int(records.BASE), "r"),
    "arc to moving mouth": Group(int(records.ARC), "w"),
    "side to arc": Group(int(records.RIGHT), "w"),
    "side to moving arc": Group(int(records.LEFT), "r"),
    "floor to arc": Group(int(records.FLOOR), "w"),
    "floor to moving arc": Group(int(records.FLOOR), "r"),
    "side under moving floor": Group(int(records.LEFT), "h"),
    "rising floor": Group(int(records.FLOOR), "h"),
    "captured beside a moving mouth": Group(int(records.ARC), "w", is_captured=True),
    "captured under a moving arc": Group(int(records.ARC), "r", is_mouth_wide=False, is_captured=True),
}


def numbers(law: Law, t: Array) -> Numbers:
    """Return a law of one harmonic, of legs or constant at many times."""
    if isinstance(law, Fourier):
        omega = law.omega or 2.0 * np.pi / (law.period or 1.0)
        c, s = (law.cos or (0.0,))[0], (law.sin or (0.0,))[0]
        cosine, sine = np.cos(omega * t), np.sin(omega * t)
        wave, turned = c * cosine + s * sine, s * cosine - c * sine
        return Numbers(law.mean + wave, omega * turned, -(omega**2) * wave, -(omega**3) * turned)
    if isinstance(law, BangBang):
        times, ends = np.array(law.knots).T
        part = times[0] + np.mod(t - times[0], times[-1] - times[0])
        i = np.clip(np.searchsorted(times, part, side="right") - 1, 0, len(times) - 2)
        length, rise = times[i + 1] - times[i], ends[i + 1] - ends[i]
        s = (part - times[i]) / length
        late = s >= 0.5
        f = ends[i] + rise * np.where(late, 1.0 - 2.0 * (1.0 - s) ** 2, 2.0 * s * s)
        rate = 4.0 * rise / length * np.where(late, 1.0 - s, s)
        return Numbers(f, rate, 4.0 * rise / length**2 * np.where(late, -1.0, 1.0), 0.0 * s)
    return Numbers(np.full_like(t, law), *np.zeros((3, *t.shape)))


def walls_at(scene: Scene, t: Array) -> dict[str, Numbers]:
    """Return radius, half-width and depth, whichever the scene has, at many times."""
    found = {name: numbers(law, t) for name, law in laws(scene).items() if name in ("r", "h")}
    factors = [numbers(law, t) for law in width_factors(scene)] if not isinstance(scene, Cap) else []
    if len(factors) == 1:
        found["w"] = factors[0]
    elif factors:
        a, b = factors
        found["w"] = Numbers(
            a.f * b.f,
            a.rate * b.f + a.f * b.rate,
            a.bend * b.f + 2 * a.rate * b.rate + a.f * b.bend,
            a.third * b.f + 3 * (a.bend * b.rate + a.rate * b.bend) + a.f * b.third,
        )
    return found


def draw_scene(group: Group, random: np.random.Generator) -> Scene:
    """Draw a scene in which the group's wall moves deeply."""
    swings = [random.uniform(0.02, 0.25), random.uniform(0.5, 0.9), 1.0 - 10.0 ** random.uniform(-3, -1)]
    swing = float(random.choice(swings))
    moving = _moving(swing, random)
    share = 1.0 - 10.0 ** random.uniform(-7, -0.3) if group.is_mouth_wide else 10.0 ** random.uniform(-4, -1)
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
    least = np.pi if is_smooth else scene_knot(scene)
    t = np.where(random.random(n) < 0.5, t, least + ahead * random.uniform(-1.5, 0.5, n))
    s = ahead * 10.0 ** random.uniform(-2, 0, n)
    if group.is_captured and is_smooth:
        t = np.where(random.random(n) < 0.5, t, 2.0 * np.pi - 0.5 * s)  # about the greatest of cos t
    now, then = walls_at(scene, t), walls_at(scene, t + s)
    pace = 1.0 / period
    small = 10.0 ** random.uniform(-6, 0, n) * pace
    sign = random.choice([-1.0, 1.0], n)
    inward = 1.0 - 10.0 ** random.uniform(-5, 0, n)
    if group.is_captured:
        x, y, vx, vy = chords(now, then, s, random)
        if random.random() < 0.5:
            # Straight down, to the mouth, which is as wide there and then but not at one of the ends.
            widest = walls_at(scene, t + 0.5 * s)["w"].f
            edge = now["w"].f if random.random() < 0.5 else then["w"].f
            x = edge + (widest - edge) * random.random(n)
            y = np.sqrt(np.maximum((now["r"].f - x) * (now["r"].f + x), 0.0))
            vx, vy = np.zeros(n), -2.0 * y / s
    elif group.wall == records.ARC:
        angle = np.where(
            random.random(n) < 0.5, random.uniform(0, np.pi, n), 10.0 ** random.uniform(-3, 0.4, n)
        )
        x, y = now["r"].f * np.cos(angle), now["r"].f * np.sin(angle)
        edge = np.where(random.random(n) < 0.5, then["r"].f, then["w"].f)
        x_s, y_s = sign * edge * inward, np.zeros(n)
        vx, vy = (x_s - x) / s, (y_s - y) / s
        if group.moving == "r" and not isinstance(scene, Stem) and random.random() < 0.7:
            widest = then["w"].f if group.is_mouth_wide else then["r"].f
            x, y, vx, vy = slipping(scene.r, t, s, widest, sign, random)
    elif group.wall == records.BASE:
        x, y = sign * (now["w"].f + (now["r"].f - now["w"].f) * inward), np.zeros(n)
        # About as fast as the arc, whose function is then hardly concave, or not.
        speed = np.sqrt(np.abs(now["r"].rate ** 2 + now["r"].f * now["r"].bend)) * 10.0 ** random.uniform(
            -1.5, 1.5, n
        )
        turn = np.pi * random.random(n)
        vx, vy = speed * np.cos(turn), speed * np.sin(turn)
    elif group.wall == records.FLOOR:
        x, y = sign * now["w"].f * inward, -now["h"].f
        vx = sign * (now["w"].rate + small * random.choice([-1.0, 1.0], n))
        vy = np.where(random.random(n) < 0.7, -y / s, small - now["h"].rate)
    else:
        side = 1.0 if group.wall == records.RIGHT else -1.0
        x, y = side * now["w"].f, -now["h"].f * np.where(random.random(n) < 0.5, random.random(n), inward)
        vx = side * (now["w"].rate - small)
        vy = np.where(random.random(n) < 0.7, -y / s, pace * random.normal(size=n))
    return np.column_stack([t, x, y, vx, vy, np.full(n, ahead)])


def chords(
    now: dict[str, Numbers], then: dict[str, Numbers], s: Array, random: np.random.Generator
) -> tuple[Array, Array, Array, Array]:
    """Return starts on the arc whose chords, about s long, pass the mouth's edge closely."""
    n, r = len(s), now["r"].f
    edge = np.where(random.random(n) < 0.5, np.maximum(now["w"].f, then["w"].f), now["w"].f)
    spread = random.choice([-1.0, 1.0], n) * 10.0 ** random.uniform(-5, -0.5, n)
    sine = np.minimum(edge * (1.0 + spread) / r, 1.0 - 10.0 ** random.uniform(-6, -1, n))
    cosine = np.sqrt((1.0 - sine) * (1.0 + sine))
    speed = np.where(
        random.random(n) < 0.5,
        2.0 * r * cosine / s,
        np.sqrt(np.abs(now["r"].rate ** 2 + r * now["r"].bend)) * 10.0 ** random.uniform(-1, 1, n) + 1e-6,
    )
    turn, way = np.pi * random.random(n), random.choice([-1.0, 1.0], n)
    out, along = now["r"].rate * (random.random(n) < 0.5) - speed * cosine, way * speed * sine
    e_x, e_y = np.cos(turn), np.sin(turn)
    return r * e_x, r * e_y, out * e_x - along * e_y, out * e_y + along * e_x


def scene_knot(scene: Scene) -> float:
    """Return when the law with knots is least."""
    (law,) = (law for law in laws(scene).values() if isinstance(law, BangBang))
    return law.knots[1][0]


def slipping(
    law: Law, t: Array, s: Array, widest: Array, sign: Array, random: np.random.Generator
) -> tuple[Array, Array, Array, Array]:
    """Return starts on the arc from which it comes and goes within s, and the particle is at y = 0 then.

    f(u) / u = P(u) - 2 q, where P(u) = (r(u)^2 - r(0)^2) / u - v^2 u and q = x vx + y vy: f is below zero
    where P is below 2 q. The speed is drawn such that P has its value at 0 again somewhere on the way, so
    that it dips before or after; then 2 q such that f begins and ends above zero, and so does the parabola
    from which lanes guess the hit. At the end the particle may be no further out than `widest`.
    """
    n, part = len(t), np.arange(1, 49) / 48.0
    r, u = numbers(law, t), s[:, None] * part
    slope = (numbers(law, t[:, None] + u).f ** 2 - r.f[:, None] ** 2) / u - 2.0 * (r.f * r.rate)[:, None]
    v2 = np.maximum((slope / u)[np.arange(n), random.integers(0, 48, n)], 1e-9)
    dip = slope - v2[:, None] * u  # P(u) - P(0)
    least = dip.min(axis=1)
    parabola = (r.rate**2 + r.f * r.bend - v2) * s
    room = np.maximum(numbers(law, t + s).f ** 2 - widest**2, 0.0) / s
    most = np.minimum(np.minimum(dip[:, -1] - room, 0.0), parabola)
    q = r.f * r.rate + 0.5 * (most + (least - most) * 10.0 ** random.uniform(-2, 0, n))
    out = q / r.f
    along = np.sqrt(np.maximum(v2 - out**2, 0.0))
    angle = np.arctan2(s * along, r.f + s * out)
    e_x, e_y = np.cos(angle), np.sin(angle)
    return sign * r.f * e_x, r.f * e_y, sign * (out * e_x + along * e_y), out * e_y - along * e_x


def comes_and_goes(scene: Scene, crowd: Array) -> npt.NDArray[np.bool_]:
    """Tell for which starts some f goes below zero and comes back, before the base ends the flight."""
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
    directed = crowd[:0] if group.is_captured else crowd[comes_and_goes(scene, crowd)][: 3 * n // 4]
    chosen = np.concatenate([directed, crowd[: n - len(directed)]])
    states = np.insert(chosen[:, :5], 1, 0.0, axis=1)
    return [(state, group.wall) for state in states]
