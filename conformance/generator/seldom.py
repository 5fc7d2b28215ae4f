"""What chance seldom draws, and mistakes hide behind: each drawn here on purpose.

A deep wave is a Fourier law whose amplitudes add up to more than its mean, and which is positive all the
same. A law of many legs has as many as a scene may have, and is asked about late in its period. A leaning
stem is so deep that a slope of 2^-22 to 2^-40 leads its sides together, or apart, by as much as they are
apart: who takes them for upright meets them at quite another time. A returning start is off its wall by up to
a quarter of what is allowed, and meets that wall again, which keeps the distance out of f at the later hit
too.
"""

from __future__ import annotations

from math import inf

import msgspec

from conformance.generator.draws import Draw, SharedPeriod, deep_wave, law, place, state
from scene import BangBang, Cap, Fourier, Scene, State, Stem, Wall
from scene.geometry import rounded
from scene.given import MAX_KNOTS
from scene.laws import bounds
from scene.states import ON_WALL
from scene.tables import cycle_length
from scene.transforms import scaled_law

DEPTHS = 22, 28, 38, 34  # of a leaning stem, as powers of two of its width
# Of its width, by which a side is moved at the floor: at the deepest slopes are below 1e-12.
LEANS = 0.1, 0.27
GRID = 1024  # parts of a period that knots lie on
REACH = {"arc": "r", "floor": "h"}  # the law that says how large a wall is; that of a side is its width


def deeper(draw: Draw, of: Fourier) -> Fourier:
    """Return a deep wave of the same period that rises as high as a wave, and sinks as deep as it can."""
    high = bounds(of).highest
    found = drawn_deep_wave(draw, high * draw.between(0.02, 0.15), high, 1.0)
    return msgspec.structs.replace(found, omega=of.omega, period=of.period)


def drawn_deep_wave(draw: Draw, low: float, high: float, omega: float) -> Fourier:
    """Draw a law whose amplitudes add up to more than its mean."""
    while True:
        a, b = draw.short(0.5, 1.5), draw.short(0.2, 0.6)
        found = deep_wave(low, high, a, b, omega)
        if sum(found.cos) > 1.05 * found.mean:
            return deep_wave(low, high, draw.pick((1.0, -1.0)) * a, b, omega)


def many_legs(draw: Draw, low: float, high: float, rate: float) -> BangBang:
    """Draw a law of as many legs as a scene may have."""
    places: set[int] = set()
    while len(places) < MAX_KNOTS - 2:
        places.add(draw.pick(range(1, GRID)))
    values = [draw.between(low, high) for _ in range(MAX_KNOTS - 1)]
    by = draw.pick(range(-256, 256)) / 64  # all sums are exact
    times = [rate * (place / GRID + by) for place in (0, *sorted(places), GRID)]
    return BangBang(knots=tuple(zip(times, [*values, values[0]], strict=True)))


def scene_of_many_legs(draw: Draw, table: str) -> tuple[Scene, float]:
    """Draw a cap, or a stem, whose arc or floor moves in many legs.

    Returns:
        The scene, and a time in the last part of its period, behind most of the legs [time].
    """
    rate = draw.pick((0.5, 1.0, 1.5, 4.0))
    low = draw.short(0.5, 1.5)
    legs = many_legs(draw, low, low * draw.between(1.05, 1.5), rate)
    t = legs.knots[0][0] + rate * (draw.pick((0, 0, -1, 3)) + draw.between(0.75, 1.0))
    if table == "cap":
        return Cap(r=legs), t
    return Stem(w=law(draw, 0.5, 1.0, SharedPeriod("mixed", rate)), h=legs, slope=draw.short(-0.5, 0.3)), t


def leaning_stem(draw: Draw, shared: SharedPeriod, depth: int) -> Stem:
    """Draw a stem some 2^depth times as deep as wide, whose next to upright sides lean by much of that."""
    w, h = law(draw, 0.25, 0.5, shared), law(draw, 0.5, 1.0, shared)
    part = draw.pick((1.0, -1.0)) * draw.between(*LEANS)
    return Stem(w=w, h=scaled_law(h, depth, 0), slope=part * bounds(w).lowest * 2.0**-depth)


def is_leaning(of: Scene) -> bool:
    """Tell whether a scene is such a stem."""
    return isinstance(of, Stem) and bounds(of.h).highest > 2.0**20 * bounds(of.w).highest


def leaning_start(draw: Draw, of: Stem, t: float) -> tuple[State, float]:
    """Draw a start that crosses much of a leaning stem's depth, and of its width, and an end [time]."""
    table = rounded(of, t)
    flight = (cycle_length(of) or 1.0) * draw.power(-4, 1)
    site = draw.pick(("stem", "stem", "left", "right", "floor"))
    x, y = place(draw, table, site)
    wall: Wall | None = next((name for name in of.walls if name == site), None)
    vx = draw.between(-1.0, 1.0) * table.w / flight
    vy = draw.pick((1.0, -1.0)) * draw.between(0.2, 1.0) * table.h / flight
    return State(t, x, y, vx, vy, wall), t + 4 * flight


def returning_start(draw: Draw, of: Scene, t: float, wall: Wall) -> tuple[State, float]:
    """Draw a start off its wall, but on it by definition, that leaves it slowly, and an end [time]."""
    at = {"t": t, "site": wall, "speed": draw.power(-4, 1), "lift": draw.power(-5, -1), "patience": 32.0}
    start, t_end = state(draw, of, at)
    return off_its_wall(draw, of, start, -3), min(t_end, t + 4.0 * (cycle_length(of) or inf))


def off_its_wall(draw: Draw, of: Scene, start: State, least: int = -9) -> State:
    """Return a start farther from its wall than rounding leads, on either side, and on it by definition.

    Args:
        draw: stream of numbers.
        of: a scene.
        start: names its wall; at y = 0 it is on the base, or it is not.
        least: power of two, the least part of what is allowed; the greatest is a quarter.
    """
    assert start.wall is not None
    if start.wall == "base":
        return start
    table = rounded(of, start.t)
    nx, ny = table.normal(start.wall, start.x, start.y)
    reach = getattr(table, REACH.get(start.wall, "w"))
    by = reach * ON_WALL * draw.power(least, -2) * draw.pick((1.0, -1.0))
    return msgspec.structs.replace(start, x=start.x + by * nx, y=start.y + by * ny)
