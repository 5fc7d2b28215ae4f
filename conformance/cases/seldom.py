"""What chance seldom draws, and mistakes hide behind: each drawn here on purpose.

A deep wave is a Fourier law whose amplitudes add up to more than its mean, and which is positive all the
same. A law of many legs has as many as a scene may have, and is asked about late in its period. A leaning
stem is so deep that a slope of 2^-22 to 2^-40 leads its sides together, or apart, by as much as they are
apart: who takes them for upright meets them at quite another time. A returning start is off its wall by up to
a quarter of what is allowed, and meets that wall again, which keeps the distance out of f at the later hit
too; in other units no flight time is long that seems so, or short. The sides under a growing cap are met
again though nothing of their own moves: w = nu r with nu at rest. A hurried start is so much faster than the
walls that they seem to stand, which its time and velocity show; a waiting one comes to the base after
hundreds of periods that no wall disturbs.
"""

from __future__ import annotations

from math import inf
from typing import NamedTuple

import msgspec

from conformance.cases.draws import Draw, SharedPeriod, clock, deep_wave, law, place, state
from conformance.vectors import Kind
from scene import BadInput, BangBang, Cap, Fourier, Law, Mushroom, Scene, State, Stem, Wall
from scene.geometry import rounded
from scene.given import MAX_KNOTS
from scene.laws import bounds
from scene.states import ON_WALL
from scene.tables import cycle_length
from scene.transforms import scaled, scaled_law, scaled_state

DEPTHS = 22, 28, 38, 34  # of a leaning stem, as powers of two of its width
# Of its width, by which a side is moved at the floor: at the deepest slopes are below 1e-12.
LEANS = 0.1, 0.27
GRID = 1024  # parts of a period that knots lie on
UNITS = -44, 0, 44  # powers of two that lengths and times are multiplied with
HURRY = 20, 22  # of a speed, as powers of two of the walls': at 2^30 they do stand within 1e-9
WAIT = 8, 9  # of a flight, as powers of two of a period
TREMOR = -10, -8  # what a wall moves by that vibrates, as powers of two of its size
REACH = {"arc": "r", "floor": "h"}  # the law that says how large a wall is; that of a side is its width


class Extra(NamedTuple):
    """A question that is asked for the sake of one seldom flight: kind, where it leads, and a word for it."""

    kind: Kind
    table: str
    wall: Wall
    aspect: str


# What a trajectory and a flow to some walls begin with, and the word that `cases.fresh` has for it.
PATHS: dict[tuple[str, Wall], tuple[str, str]] = {
    ("cap", "arc"): ("legs", "return"),
    ("stem", "left"): ("lean", "sweep"),
    ("stem", "right"): ("sweep", "lean"),
    ("stem", "floor"): ("return", "legs"),
    ("mushroom", "arc"): ("brief", "return"),
    ("mushroom", "left"): ("sweep", "sweep"),
    ("mushroom", "right"): ("return", "sweep"),
    ("mushroom", "floor"): ("mouth", "brief"),
    ("mushroom", "base"): ("mouth", "mouth"),
}
EXTRA = (
    *(Extra("trajectory", *to, begin) for to, (begin, _) in PATHS.items()),
    *(Extra("flow", *to, begin) for to, (_, begin) in PATHS.items()),
    *(Extra("step", "mushroom", "arc", "hurry"),) * 2,
    Extra("step", "cap", "base", "wait"),
    Extra("step", "stem", "base", "wait"),
)


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


def in_other_units(draw: Draw, of: Scene, start: State, t_end: float) -> tuple[Scene, State, float]:
    """Return the same question in other units of length and time; exactly, since they are powers of two."""
    length, time = draw.pick(UNITS), draw.pick((-44, *UNITS))
    return scaled(of, length, time), scaled_state(start, length, time), t_end * 2.0**time


def under_a_growing_cap(draw: Draw) -> Mushroom:
    """Draw a mushroom whose mouth and sides move with its cap alone."""
    shared = clock(draw, ("fourier", "bang-bang"))
    r = law(draw, 0.5, 2.0, shared)
    if isinstance(r, float):
        raise BadInput("the cap is at rest")
    return Mushroom(r=r, nu=draw.short(0.3, 0.9), h=law(draw, 0.5, 1.5, shared), slope=draw.short(-0.3, 0.05))


def hurried_start(draw: Draw, of: Mushroom, t: float) -> tuple[State, float]:
    """Draw a start that crosses a table in next to no part of its period, and an end [time]."""
    return state(draw, of, {"t": t, "speed": draw.power(*HURRY) * draw.between(1.0, 2.0), "patience": 8.0})


def vibrating_scene(draw: Draw, table: str) -> Cap | Stem:
    """Draw a cap, or a stem, that moves by little: flights last for any number of its periods."""
    shared, part = clock(draw, ("fourier", "bang-bang")), draw.power(*TREMOR)

    def moving() -> Law:
        size = draw.short(0.5, 2.0)
        return law(draw, size * (1.0 - part), size * (1.0 + part), shared)

    of = Cap(r=moving()) if table == "cap" else Stem(w=moving(), h=moving(), slope=draw.short(-0.2, 0.1))
    if not cycle_length(of):
        raise BadInput("the walls are at rest")
    return of


def waiting_start(draw: Draw, of: Cap | Stem, t: float) -> tuple[State, float]:
    """Draw a start in a vibrating table that comes to the base after very many periods, and an end [time]."""
    wide, high = (bounds(law).lowest for law in ((of.r, of.r) if isinstance(of, Cap) else (of.w, of.h)))
    flight = (cycle_length(of) or 1.0) * draw.power(*WAIT) * draw.between(0.625, 1.0)
    way, y = (1.0 if isinstance(of, Cap) else -1.0), high * draw.between(0.05, 0.3)
    across = wide * draw.between(-0.3, 0.3), wide * draw.between(-0.3, 0.3)
    start = State(t, across[0], way * y, (across[1] - across[0]) / flight, -way * y / flight)
    return start, t + 4 * flight
