"""Draws of scenes and starts in which a wall comes and goes during one flight, for the search in lane_search.

Each group aims at one kind of flight of docs/lanes.md: one wall moves deeply, the particle leaves the wall
named with a velocity of the order of the walls', and of thousands of such starts those are kept on whose way
some f falls below zero and rises above it again within the time that lanes look ahead: there nearly every
answer hangs on a check. Some starts are kept unseen, so that the lanes have something to answer.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from mpmath import fp

from fast.kernel import records
from fast.kernel.records import FloatArray
from scene import BangBang, Fourier, GivenLaw, Mushroom, Wall
from scene.geometry import TableAt, table_at
from scene.laws import law_of
from support.lane_anywhere import Start

N_CROWD = 1500
N_INSTANTS = 96
LOOK_AHEAD = 0.25  # phase
MET: tuple[Wall, ...] = ("arc", "right", "left", "floor")


class Aim(NamedTuple):
    """Where the flights of a group begin, and which wall moves."""

    wall: int
    moving: str
    is_mouth_wide: bool = True
    is_captured: bool = False


AIMS = {
    "arc to base": Aim(int(records.ARC), "r", is_mouth_wide=False),
    "arc to stem": Aim(int(records.ARC), "r"),
    "base to arc": Aim(int(records.BASE), "r"),
    "arc to moving mouth": Aim(int(records.ARC), "w"),
    "side to arc": Aim(int(records.RIGHT), "w"),
    "side to moving arc": Aim(int(records.LEFT), "r"),
    "floor to arc": Aim(int(records.FLOOR), "w"),
    "floor to moving arc": Aim(int(records.FLOOR), "r"),
    "side under moving floor": Aim(int(records.LEFT), "h"),
    "rising floor": Aim(int(records.FLOOR), "h"),
    "captured beside a moving mouth": Aim(int(records.ARC), "w", is_captured=True),
    "captured under a moving arc": Aim(int(records.ARC), "r", is_mouth_wide=False, is_captured=True),
}


def draw_scene(aim: Aim, random: np.random.Generator) -> Mushroom:
    """Draw a scene in which the wall of an aim moves deeply."""
    swings = [random.uniform(0.02, 0.25), random.uniform(0.5, 0.9), 1.0 - 10.0 ** random.uniform(-3, -1)]
    swing = float(random.choice(swings))
    moving = _moving(swing, random)
    share = 1.0 - 10.0 ** random.uniform(-7, -0.3) if aim.is_mouth_wide else 10.0 ** random.uniform(-4, -1)
    share = float(share)
    depth = float(10.0 ** random.uniform(-1.5, 0.5))
    if aim.moving == "h":
        return Mushroom(r=2.0, w=float(random.uniform(0.3, 1.9)), h=moving)
    if aim.moving == "w":
        return Mushroom(r=float(1.0 + swing + 10.0 ** random.uniform(-3, 0)), w=moving, h=depth)
    if random.random() < 0.5 and aim.is_mouth_wide:
        return Mushroom(r=moving, nu=share, h=depth)
    return Mushroom(r=moving, w=share * (1.0 - swing), h=depth)


def _moving(swing: float, random: np.random.Generator) -> GivenLaw:
    """Draw a law about 1 that comes down to 1 - swing."""
    if random.random() < 0.75:
        return Fourier(1.0, 1.0, (swing,))
    inner = float(random.uniform(0.2, 0.8))
    return BangBang(((0.0, 1.0), (inner, 1.0 - swing), (1.0, 1.0)))


def draw_crowd(scene: Mushroom, aim: Aim, random: np.random.Generator) -> FloatArray:
    """Draw many starts on the wall of an aim; rows t, x, y, vx, vy, and how far they are looked at."""
    n = N_CROWD
    (moving,) = (law for law in scene.laws.values() if not law.is_constant)
    is_smooth = isinstance(moving, Fourier)
    period, ahead = (2.0 * np.pi, LOOK_AHEAD) if is_smooth else (1.0, 0.3)
    t = random.uniform(0.0, period, n)
    least = moving.knots[1][0] if isinstance(moving, BangBang) else np.pi
    t = np.where(random.random(n) < 0.5, t, least + ahead * random.uniform(-1.5, 0.5, n))
    s = ahead * 10.0 ** random.uniform(-2, 0, n)
    if aim.is_captured and is_smooth:
        t = np.where(random.random(n) < 0.5, t, 2.0 * np.pi - 0.5 * s)  # about the greatest of cos t
    now = table_at(fp, scene, t)
    then = table_at(fp, scene, t + s)
    pace = 1.0 / period
    small = 10.0 ** random.uniform(-6, 0, n) * pace
    sign = random.choice([-1.0, 1.0], n)
    inward = 1.0 - 10.0 ** random.uniform(-5, 0, n)
    if aim.is_captured:
        x, y, vx, vy = chords(now, then, t, s, random)
        if random.random() < 0.5:
            # Straight down, to the mouth, which is as wide there and then but not at one of the ends.
            widest = scene.width.value(fp, t + 0.5 * s)
            edge = now.w if random.random() < 0.5 else then.w
            x = edge + (widest - edge) * random.random(n)
            y = np.sqrt(np.maximum((now.r - x) * (now.r + x), 0.0))
            vx = np.zeros(n)
            vy = -2.0 * y / s
    elif aim.wall == records.ARC:
        angle = np.where(
            random.random(n) < 0.5, random.uniform(0, np.pi, n), 10.0 ** random.uniform(-3, 0.4, n)
        )
        x, y = now.r * np.cos(angle), now.r * np.sin(angle)
        edge = np.where(random.random(n) < 0.5, then.r, then.w)
        x_s = sign * edge * inward
        y_s = np.zeros(n)
        vx, vy = (x_s - x) / s, (y_s - y) / s
        if aim.moving == "r" and random.random() < 0.7:
            widest = then.w if aim.is_mouth_wide else then.r
            x, y, vx, vy = slipping(scene.r, t, s, widest, sign, random)
    elif aim.wall == records.BASE:
        x = sign * (now.w + (now.r - now.w) * inward)
        y = np.zeros(n)
        # About as fast as the arc, whose function is then hardly concave, or not.
        speed = pace_of_arc(scene, t) * 10.0 ** random.uniform(-1.5, 1.5, n)
        turn = np.pi * random.random(n)
        vx, vy = speed * np.cos(turn), speed * np.sin(turn)
    elif aim.wall == records.FLOOR:
        x = sign * now.w * inward
        y = -now.h
        vx = sign * (now.w_rate + small * random.choice([-1.0, 1.0], n))
        vy = np.where(random.random(n) < 0.7, -y / s, small - now.h_rate)
    else:
        side = 1.0 if aim.wall == records.RIGHT else -1.0
        x = side * now.w
        y = -now.h * np.where(random.random(n) < 0.5, random.random(n), inward)
        vx = side * (now.w_rate - small)
        vy = np.where(random.random(n) < 0.7, -y / s, pace * random.normal(size=n))
    return np.column_stack([t, x, y, vx, vy, np.full(n, ahead)])


def chords(
    now: TableAt, then: TableAt, t: FloatArray, s: FloatArray, random: np.random.Generator
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return starts on the arc whose chords, about s long, pass the mouth's edge closely."""
    n = len(s)
    r = now.r
    edge = np.where(random.random(n) < 0.5, np.maximum(now.w, then.w), now.w)
    spread = random.choice([-1.0, 1.0], n) * 10.0 ** random.uniform(-5, -0.5, n)
    sine = np.minimum(edge * (1.0 + spread) / r, 1.0 - 10.0 ** random.uniform(-6, -1, n))
    cosine = np.sqrt((1.0 - sine) * (1.0 + sine))
    speed = np.where(
        random.random(n) < 0.5,
        2.0 * r * cosine / s,
        pace_of_arc(now.scene, t) * 10.0 ** random.uniform(-1, 1, n) + 1e-6,
    )
    turn = np.pi * random.random(n)
    way = random.choice([-1.0, 1.0], n)
    out = now.r_rate * (random.random(n) < 0.5) - speed * cosine
    along = way * speed * sine
    e_x, e_y = np.cos(turn), np.sin(turn)
    return r * e_x, r * e_y, out * e_x - along * e_y, out * e_y + along * e_x


def pace_of_arc(scene: Mushroom, t: FloatArray) -> FloatArray:
    """Return the speed of particles at which the arc's function is just concave."""
    now = table_at(fp, scene, t)
    return np.asarray(np.sqrt(np.abs(now.r_rate**2 + now.r * scene.laws["r"].values(t, 2))))


def slipping(
    law: GivenLaw,
    t: FloatArray,
    s: FloatArray,
    widest: FloatArray,
    sign: FloatArray,
    random: np.random.Generator,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return starts on the arc from which it comes and goes within s, and the particle is at y = 0 then.

    f(u) / u = P(u) - 2 q, where P(u) = (r(u)^2 - r(0)^2) / u - v^2 u and q = x vx + y vy: f is below zero
    where P is below 2 q. The speed is drawn such that P has its value at 0 again somewhere on the way, so
    that it dips before or after; then 2 q such that f begins and ends above zero, and so does the parabola
    from which lanes guess the hit. At the end the particle may be no further out than `widest`.
    """
    n = len(t)
    part = np.arange(1, 49) / 48.0
    r, rate, bend = (law_of(law).values(t, order) for order in range(3))
    u = s[:, None] * part
    slope = (law_of(law).values(t[:, None] + u) ** 2 - r[:, None] ** 2) / u - 2.0 * (r * rate)[:, None]
    v2 = np.maximum((slope / u)[np.arange(n), random.integers(0, 48, n)], 1e-9)
    dip = slope - v2[:, None] * u  # P(u) - P(0)
    least = dip.min(axis=1)
    parabola = (rate**2 + r * bend - v2) * s
    room = np.maximum(law_of(law).values(t + s) ** 2 - widest**2, 0.0) / s
    most = np.minimum(np.minimum(dip[:, -1] - room, 0.0), parabola)
    q = r * rate + 0.5 * (most + (least - most) * 10.0 ** random.uniform(-2, 0, n))
    out = q / r
    along = np.sqrt(np.maximum(v2 - out**2, 0.0))
    angle = np.arctan2(s * along, r + s * out)
    e_x, e_y = np.cos(angle), np.sin(angle)
    return sign * r * e_x, r * e_y, sign * (out * e_x + along * e_y), out * e_y - along * e_x


def comes_and_goes(scene: Mushroom, crowd: FloatArray) -> npt.NDArray[np.bool_]:
    """Tell for which starts some f goes below zero and comes back, before the base ends the flight."""
    t, x, y, vx, vy, ahead = crowd[:, :, None].transpose(1, 0, 2)
    s = ahead * np.arange(1, N_INSTANTS + 1) / N_INSTANTS
    now = table_at(fp, scene, t + s)
    x_s, y_s = x + vx * s, y + vy * s
    below = y_s < 0.0
    # The flight ends where it crosses y = 0 beyond the mouth.
    crosses = np.diff(below, axis=1, prepend=below[:, :1]) & (np.abs(x_s) > now.w)
    open_way = np.cumsum(crosses, axis=1) == 0
    found = np.zeros(len(crowd), dtype=bool)
    for wall in MET:
        f = now.gap(wall, x_s, y_s)
        is_there = ~below if wall == "arc" else below
        is_seen = is_there & open_way
        met = np.maximum.accumulate(is_seen & (f < 0.0), axis=1)
        found |= (met & is_seen & (f > 0.0)).any(axis=1)
    return found


def draw_aimed(aim: Aim, n: int, random: np.random.Generator) -> tuple[Mushroom, list[Start]]:
    """Draw a scene and n starts, most of them such that a wall comes and goes on the way."""
    scene = draw_scene(aim, random)
    crowd = draw_crowd(scene, aim, random)
    directed = crowd[:0] if aim.is_captured else crowd[comes_and_goes(scene, crowd)][: 3 * n // 4]
    chosen = np.concatenate([directed, crowd[: n - len(directed)]])
    states = np.insert(chosen[:, :5], 1, 0.0, axis=1)
    return scene, [(state, aim.wall) for state in states]
