"""Families at ties: corners, knots, the horizon, residuals, and laws that all but vanish.

Most numbers are short dyadic ones, so that ties are exact. The residual f(0) of the wall being
left, down to 1e-90 and of either sign, decides what is met where the flight returns to its wall
exactly when something else happens: a crossing of y = 0, a corner, the horizon. A value whose terms
are known well may be known badly itself where waves cancel to a part of 1e-4 to 1e-13: what is
looked for there is near such a wall by parts of what is left of it.
"""

import math
from typing import Any

import msgspec
from mpmath import MPContext

from conformance import plain
from conformance.cases.draw import NEVER, Draw, Family, Question, Unfit
from conformance.cases.scenes import (
    SIDES,
    TABLES,
    Clock,
    clock,
    many_legs,
    off_its_wall,
    scene,
    state,
)
from scene import BangBang, Cap, Collision, Fourier, GivenLaw, Mushroom, Scene, State, Stem, Wall
from scene.transforms import scaled, scaled_state

FINE = MPContext()
FINE.prec = 300  # bits, of the place of a wall
SPEEDS = (-2.0, -1.0, -0.75, -0.1, 0.0, 0.1, 0.25, 1.0, 3.0)
PERIOD = 4.0
ARRIVALS = (0.5, 1.0, 2.0)  # flight times
LARGEST = 390  # powers of two, of units of length and time


def at_or_next_to(draw: Draw, t: float) -> float:
    """Draw a time, or a number next to it."""
    return math.nextafter(t, draw.pick((t, t, math.inf, -math.inf)))


def moved(draw: Draw, size: float, at: float) -> GivenLaw:
    """Draw a law that is `size` at time `at`, at rest then or half way down a leg.

    Sometimes a number.
    """
    if draw.pick((True, False)):
        return size
    other = size * draw.pick((0.75, 0.875, 1.125, 1.25))
    if draw.pick((True, False)):
        return BangBang(knots=((at, size), (at + 1.0, other), (at + PERIOD, size)))
    return BangBang(
        knots=((at - 1.0, 2 * size - other), (at + 1.0, other), (at + 3.0, 2 * size - other))
    )


def dyadic(draw: Draw, at: float) -> tuple[Scene, list[tuple[float, float]]]:
    """Draw a scene of short dyadic sizes at time `at`, and list its corners and edges, x > 0.

    A length moves by at most a quarter of itself: h slope <= 0.08 < 0.18 <= w <= 0.47 < 0.75 <= r.
    """
    w = draw.pick((0.25, 0.375))
    h = draw.pick((0.5, 1.0))
    slope = draw.pick((0.0, 0.0625, -0.25))
    top = [(1.0, 0.0)]
    feet = [(w, 0.0), (w - slope * h, -h)]
    table = draw.pick(TABLES)
    if table == "cap":
        return Cap(r=moved(draw, 1.0, at)), top
    width, depth = moved(draw, w, at), moved(draw, h, at)
    if table == "stem":
        return Stem(w=width, h=depth, slope=slope), feet
    return Mushroom(r=moved(draw, 1.0, at), w=width, h=depth, slope=slope), top + feet


def corner_start(draw: Draw) -> Question:
    """Start where two walls meet, or above or below the mouth's edge, on any wall or none."""
    of, corners = dyadic(draw, 0.0)
    x, y = draw.pick(corners)
    x *= draw.pick((1.0, -1.0))
    if draw.pick(range(4)) == 3:
        y += draw.pick((1.0, -1.0)) * draw.power(-300, -2)
    t = PERIOD * draw.pick((0, 0, 1, -3, 100))
    wall: Wall | None = draw.pick((*of.walls, None))
    return Question(
        of,
        State(t, x, y, draw.pick(SPEEDS), draw.pick(SPEEDS), wall),
        t + draw.pick((0.0, 2.0**-20, 5.0)),
    )


def corner_arrival(draw: Draw) -> Question:
    """Fly to a corner or to the mouth's edge: exactly, or missed by 2^-26 to 2^-50."""
    dt = draw.pick(ARRIVALS)
    of, corners = dyadic(draw, 0.0)
    x, y = draw.pick(corners)
    side = draw.pick((1.0, -1.0))
    is_below = isinstance(of, Stem) or y < 0
    x0 = draw.pick((0.0, 0.0625, -0.125))
    y0 = -draw.pick((0.125, 0.25)) if is_below else draw.pick((0.125, 0.25))
    vx = (side * x - x0) / dt
    vy = (y - y0) / dt
    t = PERIOD * draw.pick((0, 0, 1, -3, 100)) - dt
    miss = draw.pick((0.0, draw.power(-50, -26), -draw.power(-50, -26)))
    return Question(
        of,
        State(t, x0 + miss, y0, vx, vy),
        at_or_next_to(draw, t + dt) if draw.pick((False, True)) else t + 2 * dt,
    )


def hit_at_end(draw: Draw) -> Question:
    """Fly straight at a wall that is met at the horizon, or a unit in the last place beside it.

    Sometimes the wall rests at a knot then, behind which is a violent leg.
    """
    dt = draw.pick(ARRIVALS)
    size = draw.pick((1.0, 1.5))
    side = draw.pick((1.0, -1.0))
    knot = at_or_next_to(draw, dt)
    quick = draw.power(-40, -1)
    t_end = at_or_next_to(draw, dt)
    law = moved(draw, size, dt)
    if draw.pick((False, True)):
        other = draw.between(0.3, 4.0)
        times = (0.0, knot, knot + quick, knot + quick + 1.0, PERIOD)
        law = BangBang(knots=tuple(zip(times, (size, size, other, other, size), strict=True)))
        t_end = draw.pick((t_end, 3.9))
    room = size * draw.pick((0.25, 0.5, 0.75))
    speed = room / dt
    turns = PERIOD * draw.pick((0, 0, 1, 1024, -2))
    asked: tuple[tuple[Scene, State], ...] = (
        (Cap(r=law), State(turns, 0.0, size - room, 0.0, speed)),
        (Stem(w=1.0, h=law), State(turns, 0.25, room - size, 0.0, -speed)),
        (Stem(w=law, h=2.0), State(turns, side * (size - room), -0.5, side * speed, 0.0)),
        (
            Mushroom(r=8.0, h=1.0, w=law),
            State(turns, side * size * draw.pick((0.5, 0.999, 1.001)), room, 0.0, -speed),
        ),
    )
    return Question(*draw.pick(asked), turns + t_end)


def knot_at_event(draw: Draw) -> Question:
    """Put a knot next to the time of a hit, or of a crossing of y = 0, on a path that is known.

    The path is followed with all walls at rest. The law that decides it then has a sudden leg:
    before that time, after it or within its rounding. Which side of it the time lies on decides the
    outcome, and a stepper that knows the time only to some digits must keep both.
    """
    of = Mushroom(
        r=draw.short(0.6, 1.5),
        w=draw.short(0.1, 0.4),
        h=draw.short(0.3, 2.0),
        slope=draw.short(-0.2, 0.004),
    )
    start, _ = state(draw, of, {"t": 0.0, "site": draw.pick(("cap", "stem")), "speed": 0.25})
    before: list[Any] = [start, *plain.trajectory(of, start, 3, NEVER)]
    n = draw.pick((1, 1, 2, 3))
    if not all(isinstance(hit, State | Collision) for hit in before) or len(before) <= n:
        raise Unfit("no such hit")
    last, hit = before[n - 1 : n + 1]
    name = {"arc": "r", "floor": "h", "base": "w"}.get(hit.wall, draw.pick(("w", "slope")))
    time = hit.t
    if hit.wall != "base" and last.y * hit.y < 0 and draw.pick((True, False)):
        name = "w"
        time = last.t - last.y / last.vy
    width = draw.power(-52, -30) * draw.between(1.0, 2.0)
    begin = time + width * draw.pick((-2.0, -1.0, -0.5, -0.1, 0.0, 0.1, 1.0))
    size = float(getattr(of, name))
    end = max(begin + width, math.nextafter(begin, math.inf))
    other = draw.pick((0.25, 0.5, 2.0)) * size
    times = (0.0, begin, end, end + draw.between(0.05, 2.0), 64.0)
    leg = BangBang(knots=tuple(zip(times, (size, size, other, other, size), strict=True)))
    turns = draw.pick((0.0, 64.0, -64.0, draw.power(12, 110)))
    late = State(turns, start.x, start.y, start.vx, start.vy, start.wall)
    bits = math.log2(max(turns, 1.0)) - math.log2(width) + draw.pick(range(-16, 4))
    working = min(max(round((bits - 8) / math.log2(10)), 6), 60)
    other_scene = msgspec.structs.replace(of, **{name: leg})
    return Question(other_scene, late, NEVER, n + draw.pick((0, 1)), working=working)


def across_a_knot(draw: Draw) -> Question:
    """Leave a wall just before a knot, late, and meet it again just after another."""
    period = draw.pick((0.5, 1.0, 3.0))
    which = draw.pick(("r", "h", "w"))
    law = many_legs(draw, 0.6, 2.0, period, draw.pick((3, 4, 5)))
    t0, _, t1 = map(float, law.breakpoints()[:3])
    t = period * draw.pick((0, 0, 1, 100, 1000)) + t1 - (t1 - t0) * 10.0 ** -draw.between(0.5, 6.0)
    sizes: dict[str, GivenLaw] = {"r": 4.0, "h": 1.0, "w": 0.3, which: law}
    walls: dict[str, Wall] = {"r": "arc", "h": "floor", "w": draw.pick(SIDES)}
    wall = walls[which]
    of = Mushroom(**sizes)  # type: ignore[arg-type]
    leaving, _ = state(
        draw, of, {"t": t, "site": wall, "speed": draw.power(-6, 0), "lift": draw.power(-50, -3)}
    )
    return Question(of, leaving, t + 4 * period)


def rise_and_fall(low: float, high: float, t: float) -> tuple[BangBang, float]:
    """Return a law that rises and falls for a time 1 each, and its value at t and at 2 - t."""
    share = 2 * t * t if t <= 0.5 else 1 - 2 * (1 - t) * (1 - t)
    return BangBang(knots=((0.0, low), (1.0, high), (2.0, low))), low + (high - low) * share


def tiny_slope(draw: Draw) -> Question:
    """Leave a side that leans by 2^-40 to 2^-400, and come back to it at y = 0 or at the horizon.

    Its lean may vanish, and come back, on the way.
    """
    t = draw.pick((0.25, 0.5, 0.125, 0.75))
    speed = draw.pick((1.0, 0.5, 0.25, 0.0))
    width, half = rise_and_fall(*draw.pick(((1.0, 2.0), (0.5, 0.75), (1.0, 1.125))), t)
    lean = draw.pick((1.0, -1.0)) * draw.power(-400, -40)
    wall = draw.pick(SIDES)
    back = 2 - t
    first, last = draw.pick(((lean, 0.0), (0.0, lean), (lean, -lean)))
    vanishing = BangBang(knots=((0.0, first), (draw.pick((back, 1.0)), last), (2.0, first)))
    slopes: tuple[GivenLaw, ...] = lean, vanishing
    slope = draw.pick(slopes)
    y = -speed * (2 - 2 * t) if speed and draw.pick((True, False)) else -1.5
    tables: tuple[Scene, ...] = (
        Stem(w=width, h=4.0, slope=slope),
        Mushroom(r=4.0, w=width, h=4.0, slope=slope),
    )
    turn = 2.0 * draw.pick((0, 0, 1, -5, 512))
    x = half if wall == "right" else -half
    leaving = State(turn + t, x, y, 0.0, speed, wall)
    return Question(draw.pick(tables), leaving, turn + draw.pick((3.0, at_or_next_to(draw, back))))


def on_the_wall(draw: Draw) -> Question:
    """Start off a wall that is named, by what is allowed or clearly, in a table next to nothing."""
    law = Fourier(mean=1.0, omega=1.0, cos=(1.0 - 10.0 ** -draw.between(1.0, 4.0),))
    tables: tuple[Scene, ...] = Cap(r=law), Stem(w=law, h=law)
    of = draw.pick(tables)
    t = math.pi + draw.pick((0.0, 0.001, -0.01, 3.0))
    leaving, t_end = state(
        draw, of, {"t": t, "site": draw.pick([w for w in of.walls if w != "base"]), "speed": 4.0}
    )
    if draw.pick((True, False)):
        return Question(of, off_its_wall(draw, of, leaving), max(t_end, t + 8.0))
    by = 1.0 - draw.power(-12, -4)
    return Question(
        of,
        msgspec.structs.replace(leaving, x=leaving.x * by, y=leaving.y * by),
        max(t_end, t + 8.0),
    )


def extreme_scale(draw: Draw) -> Question:
    """Ask a plain question with lengths and times scaled by powers of two up to 2^+-390."""
    of = scene(draw, draw.pick(TABLES), clock(draw))
    start, t_end = state(draw, of, {})
    length = draw.pick(range(-LARGEST, LARGEST + 1))
    units = draw.pick(range(-LARGEST, LARGEST + 1))
    # Speeds beyond 2^400 are refused by every stepper.
    units = min(max(units, length - 380), length + 380)
    return Question(
        scaled(of, length, units), scaled_state(start, length, units), 2.0**units * t_end
    )


def rest_and_sweep(draw: Draw) -> Question:
    """Start at rest, or nearly: swept up by a wall, or left alone up to the horizon."""
    of = scene(draw, draw.pick(TABLES), draw.pick((Clock("fourier"), Clock("bang-bang", 1.5))))
    start, _ = state(draw, of, {})
    size = draw.pick((0.0, 0.0, draw.power(-300, -10), draw.power(-40, -2)))
    vx, vy = (size * number for number in draw.direction())
    if isinstance(of, Mushroom) and start.y == 0:
        vy = abs(vy) + draw.power(-9, 0)
    return Question(
        of, State(start.t, start.x, start.y, vx, vy), start.t + draw.pick((1.0, 7.0, 30.0))
    )


def slow_towards_waves(draw: Draw) -> Question:
    """Meet a wall of several harmonics after thousands of periods.

    The harmonics are never all at their least together.
    """
    sin, cos = (tuple(draw.between(-0.05, 0.05) for _ in range(n)) for n in (3, 2))
    law = Fourier(mean=1.0, period=draw.pick((1.0, 0.375)), sin=(0.1, *sin), cos=cos)
    v = 10.0 ** -draw.between(2.0, 5.0)
    across = draw.pick((0.0, 0.125, -0.5))
    t = draw.between(-9.0, 9.0)
    inside = draw.between(0.25, 0.6)
    options: tuple[tuple[Scene, State], ...] = (
        (Stem(w=1.0, h=law), State(t, 0.0, -inside, across * v / 4, -v)),
        (Stem(w=law, h=1.0), State(t, draw.pick((1.0, -1.0)) * inside, -0.5, v, across * v / 4)),
        (Cap(r=law), State(t, 0.0, inside, across * v, v)),
        (Mushroom(r=2.0, h=1.5, w=law), State(t, -inside, -0.75, -v, across * v / 4)),
    )
    return Question(*draw.pick(options), t + 4.0 / v)


def sunk(n: int, left: float, least: float = 0.0) -> Fourier:
    """Return ((1 - cos 2 pi (t - least)) / 2)^n + left, of period 1.

    The higher n is, the flatter is the law at its least.
    """
    waves = [math.comb(2 * n, n - k) * (-1.0) ** k * 2.0 / 4.0**n for k in range(1, n + 1)]
    angles = [2 * math.pi * k * least for k in range(1, n + 1)]
    cos = tuple(wave * math.cos(angle) for wave, angle in zip(waves, angles, strict=True))
    sin = tuple(wave * math.sin(angle) for wave, angle in zip(waves, angles, strict=True))
    return Fourier(mean=math.comb(2 * n, n) / 4.0**n + left, cos=cos, sin=sin, period=1.0)


def _next_to_nothing(draw: Draw) -> tuple[Fourier, float]:
    """Draw a law of which little is left, and a time about its least; by rounding it may vanish."""
    least = draw.pick((0.0, 0.25, draw.part(), draw.part()))
    law = sunk(draw.pick((1, 1, 2)), 10.0 ** -draw.between(4.0, 13.0), least)
    return law, least + draw.pick((0.0, 1.0, -3.0)) + draw.pick(
        (1.0, -1.0)
    ) * 10.0 ** -draw.between(3.0, 8.0)


def nearly_shut(draw: Draw) -> Question:
    """Start, or cross the mouth, beside a wall that all but vanishes.

    The distance is a small part of what is left of the wall.
    """
    law, t = _next_to_nothing(draw)
    part = draw.pick((1.0, -1.0)) * 10.0 ** -draw.between(4.0, 11.0)
    size = float(law.value(FINE, FINE.mpf(t)) * (1 + FINE.mpf(part)))
    x = size * draw.pick((1.0, -1.0))
    made = Mushroom(r=1.5, w=law, h=1.0)
    before = draw.power(-40, -20)  # and so much later, or as exactly as times are, at the mouth
    asked: tuple[tuple[Scene, State], ...] = (
        (Stem(w=1.0, h=law), State(t, 0.25, -size, 0.0, 1.0)),
        (made, State(t, x, 0.0, 0.0, -1.0)),
        (made, State(t, x, -0.5, 0.0, -1.0)),
        (made, State(t - before, x, before, 0.0, -1.0)),
    )
    return Question(*draw.pick(asked), t + 1e-3)


def all_but_gone(draw: Draw) -> Question:
    """Fly to an arc, a floor or a side that is about to be, or has just been, next to nothing."""
    law, t = _next_to_nothing(draw)
    speed = draw.power(-3, 7)
    across = draw.between(-1.0, 1.0)
    asked: tuple[tuple[Scene, State], ...] = (
        (Cap(r=law), State(t, 0.0, 0.0, across * speed, speed, "base")),
        (Stem(w=1.0, h=law), State(t, 0.25, 0.0, across / 10 * speed, -speed, "base")),
        (Stem(w=law, h=1.0), State(t, 0.0, -0.5, speed, across * speed)),
    )
    return Question(*draw.pick(asked), t + 1.0)


FAMILIES = (
    Family("corner-start", "a named wall hides that the place lies on a second one", corner_start),
    Family(
        "corner-arrival",
        "an edge missed by 1e-8 to 1e-15, or not at all",
        corner_arrival,
        is_delicate=True,
    ),
    Family(
        "hit-at-end",
        "a hit exactly at the horizon, or at a knot, is called before it",
        hit_at_end,
        is_delicate=True,
    ),
    Family(
        "knot-at-event",
        "one piece of a law decides, though the enclosed time of an event or a crossing touches"
        " several",
        knot_at_event,
        is_delicate=True,
    ),
    Family("across-a-knot", "the time within a leg is rounded to the period's ulp", across_a_knot),
    Family(
        "tiny-slope",
        "f is asked for where f - f(0) decides, at the crossing or the horizon",
        tiny_slope,
        is_delicate=True,
    ),
    Family("on-the-wall", "a state is on its wall by the largest size of all time", on_the_wall),
    Family(
        "extreme-scale",
        "squares overflow or vanish, though every number is in range",
        extreme_scale,
    ),
    Family(
        "rest-and-sweep", "a particle at rest is never hit, or divided by its speed", rest_and_sweep
    ),
    Family(
        "slow-towards-waves",
        "walls go as far as all their waves together: the first hit is lost",
        slow_towards_waves,
    ),
    Family(
        "nearly-shut",
        "terms known to 2^-62 of themselves are taken for a sum known as well",
        nearly_shut,
        is_delicate=True,
    ),
    Family("all-but-gone", "the same, where a wall is met", all_but_gone, is_delicate=True),
)
