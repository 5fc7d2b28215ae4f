"""Starts whose answer hangs on what a wall does during the flight: another one if it is not followed.

A brief meeting: a wall meets the particle for a short part of its period, and then draws back from the line
of its flight. Who looks at a wall every so often, and for a change of sign, never sees that between two
looks. It is made where it is: at some time t the particle is a little beyond a wall, with the wall's own
velocity along the normal, while the wall turns round, which it does where f'' > 0 along the flight. About t,
f is f'' s^2 / 2 - depth: the length asked for gives the depth, and the start is some time before on the same
line.

A changed mouth: the particle leaves the arc for a place that is in the mouth when it comes there and was not
when it left, or the other way round. Most come down upright, as far from the centre as that place: these are
captured at one of the two times and not at the other.
"""

from __future__ import annotations

from math import hypot, sqrt

from conformance.cases.draws import Draw, place, walls_speed
from conformance.plain.step import Flight
from scene import BadInput, BangBang, Mushroom, Scene, State, Stem, Wall
from scene.geometry import rounded
from scene.tables import cycle_length

LENGTHS = -13, -8  # of a meeting, as powers of two of a period: shorter ones are too delicate for level core
SLOWNESS = -6, 0  # of the particle along the wall, likewise, of the walls' speed
BEFORE = -5, -2  # the start, likewise, of a period
TO_MOUTH = -6, -1  # the flight from the arc to the mouth, likewise
LOOK = 2.0**-20  # of a period: f' after so long is f'' times as much


def brief_start(draw: Draw, of: Scene, t: float, wall: Wall) -> tuple[State, float]:
    """Draw a start from which a wall is met for a short time about t, if nothing else is met by then.

    Args:
        draw: stream of numbers.
        of: a scene.
        t: when [time].
        wall: one that may move, so not the base.

    Returns:
        The start, which names no wall, and a time after the meeting, when the wall has drawn back [time].

    Raises:
        BadInput: the wall does not draw back from a particle that moves as is drawn.
    """
    length, table = cycle_length(of) or 1.0, rounded(of, t)
    x, y = place(draw, table, wall)
    nx, ny = table.normal(wall, x, y)
    along = draw.pick((1.0, -1.0)) * walls_speed(of) * draw.power(*SLOWNESS) * draw.between(0.5, 1.0)
    away = -table.receding(wall, y)
    vx, vy = away * nx - along * ny, away * ny + along * nx
    lasts = length * draw.power(*LENGTHS) * draw.between(0.5, 1.0)
    before = length * draw.power(*BEFORE) * draw.between(0.5, 1.0)
    return _before_touching(of, State(t, x, y, vx, vy, wall), lasts, before), t + 2 * lasts


def swept_start(draw: Draw, of: Scene, t: float, wall: Wall) -> tuple[State, float]:
    """Draw a start that meets a side for a short time about t, fast along it, and an end [time].

    f'' is there mostly 2 m' v_y, with m' the rate of the slope, or 2 nu' r': who forgets these in a bound of
    f'' takes it for proved that nothing is met. The end is about as long after t as the start is before.

    Args:
        draw: stream of numbers.
        of: of `swept_scene`.
        t: when, of `swept_scene` [time].
        wall: left or right.

    Raises:
        BadInput: the side does not draw back from a particle that moves as is drawn.
    """
    length, table = cycle_length(of) or 1.0, rounded(of, t)
    x, y = table.stem_point(wall, 0.0, draw.between(0.4, 0.6))
    nx, ny = table.normal(wall, x, y)
    fast = table.h / length * draw.pick((1.0, -1.0))
    along = fast * (draw.power(-6, -4) if isinstance(of, Mushroom) else draw.power(5, 6))
    away = -table.receding(wall, y)
    touching = State(t, x, y, away * nx - along * ny, away * ny + along * nx, wall)
    before = length * 2.0**-7 * draw.between(0.5, 1.0)
    lasts = before * draw.power(-5, -3)
    return _before_touching(of, touching, lasts, before), t + before * draw.between(0.9, 1.1)


def swept_scene(draw: Draw, table: str) -> tuple[Scene, float]:
    """Draw a stem whose sides tilt, or a mushroom that opens as its mouth does, and a time of fast change."""
    length = draw.pick((0.5, 1.0, 1.5, 4.0))
    first = length * draw.pick(range(-64, 64)) / 16
    turn = length * draw.pick((0.25, 0.5, 0.5, 0.75))

    def leg(low: float, high: float) -> BangBang:
        return BangBang(knots=((first, low), (first + turn, high), (first + length, low)))

    t = first + turn * draw.between(0.44, 0.48) + length * draw.pick((0, 0, -1, 5))
    if table == "mushroom":
        r, nu = draw.short(1.0, 2.0), draw.short(0.6, 0.9)
        wide = leg(r * draw.between(0.01, 0.03), r), leg(nu * draw.between(0.01, 0.03), nu)
        return Mushroom(r=wide[0], nu=wide[1], h=draw.short(0.5, 1.5)), t
    w, h = draw.short(0.5, 1.5), draw.short(0.5, 1.5)
    lean = 0.9 * w / h
    ends = [-lean * draw.between(0.2, 1.0), lean * draw.between(0.2, 1.0)]
    return Stem(w=w, h=h, slope=leg(*draw.pick((ends, ends[::-1])))), t


def _before_touching(of: Scene, touching: State, lasts: float, before: float) -> State:
    """Return a start on the line of a touch, moved beyond the wall, so that it is met for so long about then.

    Args:
        of: a scene.
        touching: on its wall, with the wall's own velocity along the normal.
        lasts: how long the particle is to be beyond the wall [time].
        before: how long before the touch it starts [time].

    Raises:
        BadInput: the wall does not draw back.
    """
    t, x, y, vx, vy, wall = (getattr(touching, name) for name in ("t", "x", "y", "vx", "vy", "wall"))
    length = cycle_length(of) or 1.0
    flight = Flight(of, touching, t + length)
    bend, gap = flight.f(wall, LOOK * length)[1] / (LOOK * length), flight.gap(wall, 0.0)
    if not bend > 0:
        raise BadInput(f"{wall} does not draw back at t = {t!r}")
    depth = bend * lasts * lasts / 8 / hypot(gap.fx, gap.fy)
    nx, ny = rounded(of, t).normal(wall, x, y)
    start = State(t - before, x - depth * nx - before * vx, y - depth * ny - before * vy, vx, vy)
    after = t + 2 * lasts
    if not Flight(of, start, after).f(wall, before + 2 * lasts)[0] > 0:
        raise BadInput(f"{wall} has not drawn back at t = {after!r}")
    return start


def arc_to_mouth(draw: Draw, of: Mushroom, t: float) -> State:
    """Draw a start on the arc for a place that the mouth's edge passes during the flight there.

    Args:
        draw: stream of numbers.
        of: a scene.
        t: of the start [time].
    """
    flight = (cycle_length(of) or 1.0) * draw.power(*TO_MOUTH) * draw.between(0.5, 1.0)
    table = rounded(of, t)
    widths = table.w, rounded(of, t + flight).w
    to = draw.pick((1.0, -1.0)) * draw.between(min(widths), max(widths))
    x, y = place(draw, table, "arc")
    if draw.pick((True, True, True, False)) and abs(to) < table.r:
        x = to * draw.between(0.9, 1.0)
        y = sqrt(table.r**2 - x**2)
    return State(t, x, y, (to - x) / flight, -y / flight, "arc")
