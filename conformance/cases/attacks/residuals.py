"""Attacks on the residual of the wall being left: rounding, down to 1e-90, that decides what is met.

The flight returns to its wall exactly when something else happens (a crossing of y = 0, a corner, the
horizon), but for f(0), which is tiny and has either sign. It is taken out of f everywhere, so it decides.
"""

from __future__ import annotations

import math

from conformance.cases.attacks.case import Attack, Family
from conformance.cases.draws import Draw
from scene import BangBang, Cap, Mushroom, Scene, State, Stem, Wall


def _rise_and_fall(low: float, high: float, t: float) -> tuple[BangBang, float]:
    """Return a law that rises for a time 1 and falls for a time 1, and its value at t and at 2 - t."""
    share = 2 * t * t if t <= 0.5 else 1 - 2 * (1 - t) * (1 - t)
    return BangBang(knots=((0.0, low), (1.0, high), (2.0, low))), low + (high - low) * share


def _tilt(draw: Draw) -> float:
    """Draw a slope that rounding hides: 2^-40 to 2^-400, of either sign."""
    return draw.pick((1.0, -1.0)) * draw.power(-400, -40)


def tiny_slope(draw: Draw) -> Attack:
    """Leave a side that leans by next to nothing, and come back to it at y = 0 or at the horizon."""
    t = draw.pick((0.25, 0.5, 0.125, 0.75))
    low, high = draw.pick(((1.0, 2.0), (0.5, 0.75), (1.0, 1.125)))
    width, half = _rise_and_fall(low, high, t)
    speed = draw.pick((1.0, 0.5, 0.25))
    y = -speed * (2 - 2 * t) if draw.pick((True, True, False)) else -1.0
    turn = 2.0 * draw.pick((0, 0, 1, -5, 512))
    side = draw.pick((-1.0, 1.0))
    wall: Wall = "left" if side < 0 else "right"
    t_end = draw.pick((3.0, 3.0, 2 - t, math.nextafter(2 - t, 9.0), math.nextafter(2 - t, 0.0)))
    stem: Scene
    if draw.pick((True, True, False)):
        stem = Stem(w=width, h=4.0, slope=_tilt(draw))
    else:
        stem = Mushroom(r=4.0, w=width, h=4.0, slope=_tilt(draw))
    return Attack(stem, State(turn + t, side * half, y, 0.0, speed, wall), turn + t_end)


def flattening_slope(draw: Draw) -> Attack:
    """Leave a side whose tiny lean vanishes, and comes back, by the time the horizon is reached."""
    t = 0.25
    lean = abs(_tilt(draw))
    slope = BangBang(
        knots=draw.pick(
            (
                ((0.0, lean), (1.75, 0.0), (2.0, lean)),
                ((0.0, -lean), (1.75, 0.0), (2.0, -lean)),
                ((0.0, 0.0), (1.0, lean), (2.0, 0.0)),
                ((0.0, lean), (1.0, -lean), (2.0, lean)),
            )
        )
    )
    width, half = _rise_and_fall(1.0, 2.0, t)
    side = draw.pick((-1.0, 1.0))
    wall: Wall = "left" if side < 0 else "right"
    speed = draw.pick((0.0, 0.5, 1.0, -0.25))
    y = draw.pick((-1.5, -1.0, -2.0))
    t_end = draw.pick((1.75, 1.75, 3.0, math.nextafter(1.75, 9.0), math.nextafter(1.75, 0.0)))
    return Attack(Stem(w=width, h=4.0, slope=slope), State(t, side * half, y, 0.0, speed, wall), t_end)


def arc_residual(draw: Draw) -> Attack:
    """Wait just beside the arc's top while it rises and falls; back at the start's radius it is met."""
    t = draw.pick((0.25, 0.5, 0.125, 0.75))
    low, high = draw.pick(((1.0, 2.0), (0.5, 0.75)))
    arc, radius = _rise_and_fall(low, high, t)
    off = draw.pick((0.0, draw.power(-200, -20), -draw.power(-200, -20)))
    up = draw.pick((radius, math.nextafter(radius, 0.0), math.nextafter(radius, 9.0)))
    t_end = draw.pick((2 - t, 2 - t, 3.0, math.nextafter(2 - t, 9.0), math.nextafter(2 - t, 0.0)))
    return Attack(Cap(r=arc), State(t, off, up, 0.0, 0.0, "arc"), t_end)


def floor_residual(draw: Draw) -> Attack:
    """Leave the floor from a rounding beside it; it comes back with a side, or at the horizon."""
    t = draw.pick((0.25, 0.5, 0.75))
    floor, depth = _rise_and_fall(1.0, 1.5, t)
    off = draw.pick((0.0, 2.0**-52, -(2.0**-52), 2.0**-40, -(2.0**-40)))
    vx = draw.pick((0.0, 0.5 / (2 - 2 * t), 0.25))
    t_end = draw.pick((2 - t, 3.0, 3.0, math.nextafter(2 - t, 9.0), math.nextafter(2 - t, 0.0)))
    state = State(t, 0.5, -depth + off, vx, 0.0, "floor")
    return Attack(Stem(w=1.0, h=floor), state, t_end)


FAMILIES = (
    Family(
        tiny_slope, "f is asked for where f - f(0) decides, at the crossing or the horizon", is_delicate=True
    ),
    Family(flattening_slope, "f(0) = 5e-91 is forgotten at the horizon", is_delicate=True),
    Family(arc_residual, "the arc's f(0) is forgotten where it is met again", is_delicate=True),
    Family(floor_residual, "the floor's f(0) is forgotten at a corner or the horizon", is_delicate=True),
)
