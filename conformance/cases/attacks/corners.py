"""Attacks on corners and edges: starts on them, arrivals at them, beside them, and the horizon met exactly.

Most numbers are short dyadic ones, so that ties are exact; where an arrival is to miss by a little, only the
start is moved.
"""

from __future__ import annotations

import math

from conformance.cases.attacks.case import Attack, Family
from conformance.cases.draws import Draw
from scene import BangBang, Cap, Fourier, Law, Mushroom, Scene, State, Stem, Wall

SPEEDS = (-2.0, -1.0, -0.75, -0.1, 0.0, 0.1, 0.25, 1.0, 3.0)
PERIOD = 4.0


def moved(draw: Draw, size: float, at: float = 0.0) -> Law:
    """Return a law that is `size` at time `at`, at rest then or moving; sometimes a number."""
    if draw.pick((True, False)):
        return size
    other = size * draw.pick((0.75, 0.875, 1.125, 1.25))
    if draw.pick((True, False)):
        knots = ((at, size), (at + 1.0, other), (at + PERIOD, size))
    else:  # half way down a leg of length 2: the mean of its ends
        knots = ((at - 1.0, 2 * size - other), (at + 1.0, other), (at + 3.0, 2 * size - other))
    return BangBang(knots=knots)


def _shapes(draw: Draw) -> tuple[Scene, float, float, float, float]:
    """Draw a scene and what r, w, h and slope are at t = 0, whole periods left out.

    A length moves by at most a quarter of itself: h slope <= 0.08 < 0.18 <= w <= 0.47 < 0.75 <= r.
    """
    r, w = 1.0, draw.pick((0.25, 0.375))
    h, slope = draw.pick((0.5, 1.0)), draw.pick((0.0, 0.0625, -0.25))
    table = draw.pick(("cap", "stem", "mushroom", "mushroom"))
    if table == "cap":
        return Cap(r=moved(draw, r)), r, w, h, slope
    if table == "stem":
        return Stem(w=moved(draw, w), h=moved(draw, h), slope=slope), r, w, h, slope
    if draw.pick((True, False)):
        return Mushroom(r=moved(draw, r), nu=w, h=moved(draw, h), slope=slope), r, w, h, slope
    narrow = moved(draw, w)
    return Mushroom(r=moved(draw, r), w=narrow, h=moved(draw, h), slope=slope), r, w, h, slope


def _turns(draw: Draw) -> float:
    return PERIOD * draw.pick((0, 0, 1, -3, 100))


def corner_start(draw: Draw) -> Attack:
    """A start exactly where two walls meet, any of them named or none, moving anywhere."""
    scene, r, w, h, slope = _shapes(draw)
    side = draw.pick((1.0, -1.0))
    tops = [] if isinstance(scene, Stem) else [(r, 0.0)]
    feet = [] if isinstance(scene, Cap) else [(w, 0.0), (w, 0.0), (w - slope * h, -h)]
    x, y = draw.pick(tops + feet)
    names: tuple[Wall | None, ...] = (*scene.walls, None)
    t = _turns(draw)
    state = State(t, side * x, y, draw.pick(SPEEDS), draw.pick(SPEEDS), draw.pick(names))
    return Attack(scene, state, t + draw.pick((0.0, 2.0**-20, 5.0)))


def side_at_mouth(draw: Draw) -> Attack:
    """A start on a side, the arc or the base of a mushroom, at y = 0 or next to it."""
    w, h = draw.pick((0.25, 0.375)), 1.0
    slope = draw.pick((0.0, 0.0, 0.0625, -0.25))
    scene = Mushroom(r=moved(draw, 1.0), w=moved(draw, w), h=moved(draw, h), slope=slope)
    wall: Wall = draw.pick(("left", "right", "left", "right", "arc", "base"))
    side = draw.pick((1.0, -1.0))
    lift = draw.pick((0.0, 0.0, draw.power(-300, -10), draw.power(-52, -2), draw.between(0.0, 0.4)))
    if wall in ("left", "right"):
        side = -1.0 if wall == "left" else 1.0
        y = -lift if draw.pick((True, True, False)) else lift
        x = side * (w + slope * y)
    elif wall == "arc":
        y = lift * draw.pick((1.0, 1.0, -1.0))
        x = side * math.sqrt(1.0 - lift * lift)
    else:
        x, y = side * draw.pick((w, 1.0, w + lift, 1.0 - lift / 2, w - lift / 2)), 0.0
        if abs(x) < w:
            x = side * w
    t = _turns(draw)
    state = State(t, x, y, draw.pick(SPEEDS), draw.pick(SPEEDS), wall)
    return Attack(scene, state, t + draw.pick((2.0**-20, 5.0)))


def corner_arrival(draw: Draw) -> Attack:
    """A flight to a corner or to the mouth's edge: exactly, by an ulp, or missed by 1e-8 to 1e-15."""
    dt = draw.pick((0.5, 1.0, 2.0))
    scene, r, w, h, slope = _shapes(draw)
    # The shapes are those at the time of arrival.
    start = _turns(draw) - dt
    side = draw.pick((1.0, -1.0))
    tops = [] if isinstance(scene, Stem) else [(r, 0.0)]
    edge = [] if isinstance(scene, Cap) else [(w, 0.0), (w, 0.0)]
    feet = [] if isinstance(scene, Cap) else [(w - slope * h, -h)]
    x, y = draw.pick(tops + edge + feet)
    is_foot = y < 0
    from_stem = isinstance(scene, Stem) or is_foot or (x == w and draw.pick((True, False, False)))
    x0 = draw.pick((0.0, 0.0625, -0.125))
    y0 = -h * draw.pick((0.25, 0.5)) if from_stem else draw.pick((0.25, 0.125))
    vx, vy = (side * x - x0) / dt, (y - y0) / dt
    miss = draw.pick((0.0, 0.0, 10.0 ** -draw.pick(range(8, 16)), -(10.0 ** -draw.pick(range(8, 16)))))
    if draw.pick((True, False)):
        x0 += miss
    else:
        y0 += miss
    state = State(start, x0, y0, vx, vy)
    return Attack(scene, state, start + draw.pick((dt, 2 * dt)))


def hit_at_end(draw: Draw) -> Attack:
    """A hit, a tie or a crossing exactly at t_end, a unit in the last place before it and after it."""
    attack = corner_arrival(draw)
    if draw.pick((True, True, False)):
        attack = _plain_hit(draw)
    away = draw.pick((0.0, 0.0, math.inf, -math.inf))
    return attack._replace(t_end=attack.t_end if away == 0.0 else math.nextafter(attack.t_end, away))


def _plain_hit(draw: Draw) -> Attack:
    """Fly straight at one wall, which is met after a short dyadic time, the horizon then."""
    dt, t = draw.pick((0.5, 1.0, 2.0)), _turns(draw)
    size = draw.pick((1.0, 1.5))
    law = moved(draw, size)
    room = draw.pick((0.25, 0.5, 0.75))
    speed = room / dt
    wall = draw.pick(("arc", "floor", "left", "base", "top"))
    side = draw.pick((1.0, -1.0))
    start = t - dt
    if wall == "arc":
        return Attack(Cap(r=law), State(start, 0.0, size - room, 0.0, speed), t)
    if wall == "floor":
        return Attack(Stem(w=1.0, h=law), State(start, 0.25, room - size, 0.0, -speed), t)
    if wall == "left":
        stem = Stem(w=law, h=1.0, slope=draw.pick((0.0, 0.125)))
        return Attack(stem, State(start, side * (size - room), -(2.0**-30), side * speed, 0.0), t)
    if wall == "top":
        return Attack(Stem(w=law, h=1.0), State(start, 0.25, -room, 0.0, speed), t)
    wide = Mushroom(r=2.0, w=moved(draw, 0.5), h=1.0)
    return Attack(wide, State(start, draw.pick((0.0, 0.75, 1.5)), room, 0.0, -speed), t)


def near_another_wall(draw: Draw) -> Attack:
    """A start on one wall within 1e-3 to 1e-12 of another, leaving towards it, along it or away."""
    scene, r, w, h, slope = _shapes(draw)
    gap = 10.0 ** -draw.between(3.0, 12.0)
    side = draw.pick((1.0, -1.0))
    wall: Wall
    places: list[tuple[Wall, float, float]] = []
    if not isinstance(scene, Stem):
        places += [("arc", math.sqrt(r * r - gap * gap), gap), ("base", r - gap, 0.0)]
    if isinstance(scene, Mushroom):
        places.append(("base", w + gap, 0.0))
    if not isinstance(scene, Cap):
        foot = w - slope * h
        across: Wall = "right" if side > 0 else "left"
        places += [
            ("floor", foot - gap, -h),
            (across, w - slope * (h - gap), gap - h),
            (across, w - slope * gap, -gap),
        ]
    wall, x, y = draw.pick(places)
    t = _turns(draw)
    speed = draw.power(-3, 6)
    inward = {
        "arc": (-side, 0.0),
        "base": (0.0, -1.0 if isinstance(scene, Stem) else 1.0),
        "floor": (0.0, 1.0),
    }
    nx, ny = inward.get(wall, (-side, 0.0))
    lift = draw.pick((0.5, 0.01, 1e-6, 0.99))
    along = math.sqrt(1 - lift * lift) * draw.pick((1.0, -1.0))
    vx, vy = speed * (lift * nx - along * ny), speed * (lift * ny + along * nx)
    return Attack(scene, State(t, side * x, y, vx, vy, wall), t + 8.0 / speed)


def on_the_wall(draw: Draw) -> Attack:
    """A start on a wall but for rounding, or clearly off it, by the table's size of that moment."""
    swing = 1.0 - 10.0 ** -draw.between(1.0, 4.0)
    law = Fourier(mean=1.0, omega=1.0, cos=(swing,))
    t = math.pi + draw.pick((0.0, 0.001, -0.01, 3.0))
    size = 1.0 + swing * math.cos(t)
    gap = size * draw.pick((0.0, 2.0**-30, -(2.0**-24), 2.0**-16, -(2.0**-14), 0.01, 0.5))
    speed = draw.pick((1.0, 8.0))  # faster than every wall
    t_end = t + 8.0
    wall: Wall = draw.pick(("arc", "floor", "left", "right"))
    if wall == "arc":
        return Attack(Cap(r=law), State(t, 0.0, size - gap, 0.25, -2 * speed, wall), t_end)
    if wall == "floor":
        return Attack(Stem(w=1.0, h=law), State(t, 0.125, gap - size, 0.25, 2 * speed, wall), t_end)
    side = 1.0 if wall == "right" else -1.0
    start = State(t, side * (size - gap), -0.5, -2 * side * speed, 0.25, wall)
    return Attack(Stem(w=law, h=1.0), start, t_end)


FAMILIES = (
    Family(on_the_wall, "a state is on its wall by the largest size of all time"),
    Family(corner_start, "a named wall hides that the place lies on a second one"),
    Family(side_at_mouth, "a side wall is met above the stem, or the mouth's edge is passed"),
    Family(corner_arrival, "an edge missed by 1e-8 to 1e-15, or not at all", is_delicate=True),
    Family(hit_at_end, "a hit exactly at the horizon is called before it, or after", is_delicate=True),
    Family(near_another_wall, "the second of two walls within a whisker is skipped"),
)
