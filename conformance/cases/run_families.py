"""Families of a run's questions: scenes that no file holds, and rare events in them.

Where a family is for a wall, its questions are those that meet this wall first. A returning
particle leaves its wall slowly, off it by up to a quarter of what is allowed, and meets it again,
which keeps the distance out of f at the later hit too; in other units no flight time is long that
seems so, or short. A law of many legs has as many as a scene may have, and is asked about late in
its period. A leaning stem is so deep that a slope of 2^-22 to 2^-40 leads its sides together, or
apart, by as much as they are apart. A hurried particle is so much faster than the walls that they
seem to stand, which its time and velocity show; a waiting one comes to the base after hundreds of
periods that no wall disturbs. A changed mouth is open when the particle comes there and was not
when it left the arc, or the other way round.

Others aim at the slack of bounds by which a stepper excludes hits. Between two looks at a wall's f
> 0 it proves by a bound of f'' that the wall is not met. If a term of f'' is forgotten there, a
wall that meets the particle for a short time and draws back is never seen. Each term is made the
only one that matters, for each kind of law:

    arc      f'' = 2 (r'^2 + r r'' - v^2)
    floor    f'' = h''
    sides    f'' = w'' + m'' y + 2 m' v_y, with w = nu r also nu'' r + 2 nu' r' + nu r''

A brief meeting is made where it is: at some time the particle is a little beyond the wall, with the
wall's own velocity along the normal, while f'' > 0 along the flight. About that time f is f'' s^2 /
2 - depth: the length asked for gives the depth, and the start is some time before on the same line.
"""

from collections.abc import Callable
from functools import partial
from math import hypot, sqrt
from typing import NamedTuple

from conformance.cases.draw import Draw, Family, Question, Unfit
from conformance.cases.scenes import (
    KINDS,
    LONGEST,
    MOVING,
    PERIODS,
    SIDES,
    TABLES,
    Clock,
    any_scene,
    clock,
    deep_wave,
    law,
    many_legs,
    off_its_wall,
    place,
    point,
    start,
    state,
    time,
    walls_speed,
    when,
)
from conformance.plain.step import Flight
from scene import BangBang, Cap, Fourier, GivenLaw, Mushroom, Scene, State, Stem, Wall
from scene.geometry import rounded
from scene.laws import MAX_KNOTS, law_of
from scene.transforms import scaled, scaled_law, scaled_state

WALLS: tuple[tuple[str, Wall], ...] = tuple(
    (table.__name__.lower(), wall) for table in (Cap, Stem, Mushroom) for wall in table.walls
)
MOVABLE = tuple((table, wall) for table, wall in WALLS if wall != "base")
DEPTHS = 22, 40  # of a leaning stem, as powers of two of its width
UNITS = -44, 44  # powers of two that lengths and times are multiplied with, at most
LOOK = 2.0**-20  # of a period: f' after so long is f'' times as much
LASTS = -13, -8  # how long a meeting is, as powers of two of a period: shorter ones are delicate


def anywhere(table: str | None, wall: Wall | None, draw: Draw) -> Question:
    """Fly in any scene from any start.

    In a mushroom half of them on the wall's own side of the mouth.
    """
    of = any_scene(draw, table)
    site = None
    if table == "mushroom" and draw.pick((True, False)):
        site = "cap" if wall in ("arc", "base") else "stem"
    return Question(of, *start(draw, of, when(draw, of), site))


def from_the_base(draw: Draw) -> Question:
    """Leave the base of a mushroom, or the place where it was before the mouth opened."""
    of = any_scene(draw, "mushroom")
    return Question(of, *start(draw, of, when(draw, of), "base"))


def returning(table: str, wall: Wall, draw: Draw) -> Question:
    """Leave a wall slowly, a little off it, in any units; at times from just before the bounce."""
    of: Scene = any_scene(draw, table)
    if table == "mushroom" and wall != "arc" and draw.pick((True, False)):
        of = under_a_growing_cap(draw)
    at = {"t": when(draw, of), "site": wall, "speed": draw.power(-4, 1), "lift": draw.power(-5, -1)}
    leaving, t_end = state(draw, of, at | {"patience": 32.0})
    t_end = min(t_end, leaving.t + LONGEST / 2 * (of.period or 1.0))
    leaving = off_its_wall(draw, of, leaving, -3)
    length = draw.pick(range(UNITS[0], UNITS[1] + 1))
    units = draw.pick(range(UNITS[0], UNITS[1] + 1))
    return Question(
        scaled(of, length, units), scaled_state(leaving, length, units), t_end * 2.0**units
    )


def under_a_growing_cap(draw: Draw) -> Mushroom:
    """Draw a mushroom whose mouth and sides move with its cap alone."""
    shared = clock(draw, MOVING)
    r = law(draw, 0.5, 2.0, shared)
    if law_of(r).is_constant:
        raise Unfit("the cap is at rest")
    return Mushroom(
        r=r, nu=draw.short(0.3, 0.9), h=law(draw, 0.5, 1.5, shared), slope=draw.short(-0.3, 0.05)
    )


def many_knots(table: str, draw: Draw) -> Question:
    """Begin in the last part of a period that has as many legs as there may be."""
    period = draw.pick((0.5, 1.0, 1.5, 4.0))
    low = draw.short(0.5, 1.5)
    legs = many_legs(draw, low, low * draw.between(1.05, 1.5), period, MAX_KNOTS - 1)
    of: Scene = Cap(r=legs)
    if table == "stem":
        of = Stem(
            w=law(draw, 0.5, 1.0, Clock("mixed", period)), h=legs, slope=draw.short(-0.5, 0.3)
        )
    t = period * (draw.pick((0, 0, -1, 3)) + draw.between(0.75, 1.0))
    begun, t_end = start(draw, of, t)
    return Question(of, begun, min(t_end, t + period / 2))


def leaning(draw: Draw) -> Question:
    """Cross much of the depth of a stem that is next to upright, and of its width."""
    shared = clock(draw, KINDS)
    depth = draw.pick(range(DEPTHS[0], DEPTHS[1] + 1))
    w, h = law(draw, 0.25, 0.5, shared), law(draw, 0.5, 1.0, shared)
    part = draw.pick((1.0, -1.0)) * draw.between(0.1, 0.27)
    of = Stem(w=w, h=scaled_law(h, depth, 0), slope=part * law_of(w).bounds().lowest * 2.0**-depth)
    t = time(draw, of)
    flight = (of.period or 1.0) * draw.power(-4, 1)
    table = rounded(of, t)
    site = draw.pick(("stem", "left", "right", "floor"))
    x, y = place(draw, table, site)
    wall: Wall | None = next((name for name in of.walls if name == site), None)
    vx = draw.between(-1.0, 1.0) * table.w / flight
    vy = draw.pick((1.0, -1.0)) * draw.between(0.2, 1.0) * table.h / flight
    return Question(of, State(t, x, y, vx, vy, wall), t + 4 * flight)


def is_leaning(of: Scene) -> bool:
    """Tell whether a scene is such a stem."""
    if not isinstance(of, Stem):
        return False
    deepest, widest = (of.laws[name].bounds().highest for name in ("h", "w"))
    return deepest > 2.0 ** (DEPTHS[0] - 2) * widest


def changed_mouth(draw: Draw) -> Question:
    """Leave the arc for a place that the mouth's edge passes during the flight there.

    Most come down upright, as far from the centre as that place: these are captured at one of the
    two times and not at the other.
    """
    of = any_scene(draw, "mushroom")
    t = when(draw, of)
    length = of.period or 1.0
    flight = length * draw.power(-6, -1) * draw.between(0.5, 1.0)
    now = rounded(of, t)
    widths = now.w, rounded(of, t + flight).w
    to = draw.pick((1.0, -1.0)) * draw.between(min(widths), max(widths))
    x, y = place(draw, now, "arc")
    if draw.pick((True, True, True, False)) and abs(to) < now.r:
        x = to * draw.between(0.9, 1.0)
        y = sqrt(now.r**2 - x**2)
    return Question(of, State(t, x, y, (to - x) / flight, -y / flight, "arc"), t + LONGEST * length)


def hurried(draw: Draw) -> Question:
    """Cross a table in next to no part of its period: at 2^30 the walls do stand within 1e-9."""
    of = under_a_growing_cap(draw)
    at = {"speed": draw.power(16, 22) * draw.between(1.0, 2.0), "patience": 8.0}
    return Question(of, *state(draw, of, at | {"t": time(draw, of)}))


def vibrating(table: str, draw: Draw) -> Question:
    """Wait for 16 to 512 periods of walls that move by little, in which none comes near."""
    shared = clock(draw, MOVING)
    part = draw.power(-12, -8)

    def moving() -> GivenLaw:
        size = draw.short(0.5, 2.0)
        return law(draw, size * (1.0 - part), size * (1.0 + part), shared)

    of: Cap | Stem = (
        Cap(r=moving())
        if table == "cap"
        else Stem(w=moving(), h=moving(), slope=draw.short(-0.2, 0.1))
    )
    if not of.period:
        raise Unfit("the walls are at rest")
    names = ("r", "r") if table == "cap" else ("w", "h")
    wide, high = (of.laws[name].bounds().lowest for name in names)
    flight = of.period * draw.power(5, 9) * draw.between(0.5, 1.0)
    way = 1.0 if table == "cap" else -1.0
    y = high * draw.between(0.05, 0.3)
    t = time(draw, of)
    xs = wide * draw.between(-0.3, 0.3), wide * draw.between(-0.3, 0.3)
    return Question(
        of, State(t, xs[0], way * y, (xs[1] - xs[0]) / flight, -way * y / flight), t + 4 * flight
    )


def deep_waves(draw: Draw) -> Question:
    """Ask about walls of whose laws the mean less all amplitudes says that they may vanish."""
    shared = clock(draw, ("fourier",))
    table = draw.pick(TABLES)
    of: Scene
    if table == "cap":
        of = Cap(r=deep_wave(draw, 0.05, 1.5, shared.rate))
    elif table == "stem":
        of = Stem(
            w=deep_wave(draw, 0.05, 1.0, shared.rate), h=deep_wave(draw, 0.1, 2.0, shared.rate)
        )
    else:
        nu = deep_wave(draw, 0.02, 0.9, shared.rate)
        of = Mushroom(r=deep_wave(draw, 0.05, 1.5, shared.rate), h=draw.short(0.5, 1.5), nu=nu)
    return Question(
        of, *state(draw, of, {"speed": draw.power(-4, 2), "patience": draw.pick((1.0, 4.0))})
    )


class Term(NamedTuple):
    """A term of f'': its walls, the laws that move, and whether it is greatest at full speed."""

    walls: tuple[Wall, ...]
    moving: frozenset[str]
    is_fast: bool = False


TERMS = {
    "r-rate": Term(("arc",), frozenset({"r"}), is_fast=True),
    "r-bend": Term(("arc",), frozenset({"r"})),
    "h-bend": Term(("floor",), frozenset({"h"})),
    "w-bend": Term(SIDES, frozenset({"w"})),
    "slope-bend": Term(SIDES, frozenset({"slope"})),
    "slope-rate": Term(SIDES, frozenset({"slope"}), is_fast=True),
    "nu-bend": Term(SIDES, frozenset({"nu"})),
    "nu-rate": Term(SIDES, frozenset({"nu", "r"}), is_fast=True),
    "nu-r-bend": Term(SIDES, frozenset({"r"})),
}


class Swing(NamedTuple):
    """A motion there and back.

    `law(low, high)` is low at the time `least`, and fastest after `fast`.
    """

    law: Callable[[float, float], GivenLaw]
    least: float
    fast: float
    length: float


def swing(draw: Draw, kind: str) -> Swing:
    """Draw a motion of a kind: two legs, or one harmonic."""
    length = draw.pick(PERIODS)
    quarter = draw.pick(range(4))
    first = length * (quarter / 4 + draw.pick((0, 0, -1, 5)))
    turn = length * (draw.pick((0.5, 0.25, 0.75)) if kind == "bang-bang" else 0.5)

    def legs(low: float, high: float) -> GivenLaw:
        return BangBang(knots=((first, low), (first + turn, high), (first + length, low)))

    def harmonic(low: float, high: float) -> GivenLaw:
        half = (low - high) / 2 if quarter < 2 else (high - low) / 2
        cos, sin = ((), (half,)) if quarter % 2 else ((half,), ())
        return Fourier(mean=(low + high) / 2, period=length, cos=cos, sin=sin)

    fast = first + turn * draw.between(0.42, 0.48)
    return Swing(legs if kind == "bang-bang" else harmonic, first, fast, length)


def bend(term: Term, kind: str, draw: Draw) -> Question:
    """Meet a wall briefly where one term of f'' matters."""
    wall = draw.pick(term.walls)
    motion = swing(draw, kind)

    def law(name: str) -> GivenLaw:
        size = draw.short(0.6, 0.9)
        return motion.law(size * draw.power(-6, -4), size) if name in term.moving else size

    of: Scene
    if wall == "arc":
        of = Cap(r=law("r"))
    elif term.moving <= {"r", "nu"}:
        of = Mushroom(r=law("r"), nu=law("nu"), h=draw.short(0.5, 1.5))
    else:
        lean = draw.pick((0.5, -0.5)) * draw.power(-3, 0)
        slope = motion.law(lean, -lean) if "slope" in term.moving else 0.0
        of = Stem(w=law("w"), h=law("h"), slope=slope)
    along = walls_speed(of) * draw.power(-6, -1)
    length = motion.length
    if not term.is_fast:
        lasts = length * draw.power(*LASTS)
        t = motion.least + length * draw.between(-0.05, 0.05)
        return Question(
            of, touch(draw, of, t, wall, along, lasts, length * draw.power(-5, -2)), t + 2 * lasts
        )
    if "slope" in term.moving:
        along = draw.power(4, 5) / length
    before = length * 2.0**-7 * draw.between(0.5, 1.0)
    start = touch(draw, of, motion.fast, wall, along, before * draw.power(-5, -3), before)
    return Question(of, start, motion.fast + before * draw.between(0.9, 1.1))


def touch(
    draw: Draw, of: Scene, t: float, wall: Wall, along: float, lasts: float, before: float
) -> State:
    """Return a start from which a wall is met for a short time about t, if nothing is met before.

    Args:
        draw: stream of numbers.
        of: a scene.
        t: when [time].
        wall: one that may move, so not the base.
        along: speed along the wall then [length/time].
        lasts: how long the particle is to be beyond the wall [time].
        before: how long before t it starts [time].

    Raises:
        Unfit: the wall does not draw back from a particle that moves so.
    """
    length = of.period or 1.0
    table = rounded(of, t)
    x, y = point(table, wall, draw.between(0.2, 0.8), draw.between(0.2, 0.8))
    nx, ny = table.normal(wall, x, y)
    along = draw.pick((1.0, -1.0)) * along * draw.between(0.5, 1.0)
    away = -table.receding(wall, y)
    vx = away * nx - along * ny
    vy = away * ny + along * nx
    flight = Flight(of, State(t, x, y, vx, vy, wall), t + length)
    f_bend = flight.f(wall, LOOK * length)[1] / (LOOK * length)
    gap = flight.gap(wall, 0.0)
    if not f_bend > 0:
        raise Unfit(f"{wall} does not draw back")
    depth = f_bend * lasts * lasts / 8 / hypot(gap.fx, gap.fy)
    start = State(t - before, x - depth * nx - before * vx, y - depth * ny - before * vy, vx, vy)
    after = before + 2 * lasts
    if not Flight(of, start, t + 2 * lasts).f(wall, after)[0] > 0:
        raise Unfit(f"{wall} has not drawn back")
    return start


def brief(table: str, wall: Wall, draw: Draw) -> Question:
    """Meet a wall for a short time in any scene; a flow goes on from there."""
    of = any_scene(draw, table)
    t = when(draw, of)
    length = of.period or 1.0
    along = walls_speed(of) * draw.power(-6, 0)
    before = length * draw.power(-5, -2)
    lasts = length * draw.power(*LASTS) * draw.between(0.5, 1.0)
    start = touch(draw, of, t, wall, along, lasts, before)
    t_end = t + 2 * lasts + length * draw.between(0.5, LONGEST / 2)
    return Question(of, start, t_end, *draw.pick(((40, True), (None, False))))


def thin_ring(draw: Draw) -> Question:
    """Come down beside the edge of a mouth that is as wide as the cap but for 2^-3 to 2^-45."""
    shared = clock(draw)
    ring = draw.power(-45, -3) * draw.between(0.5, 1.0)
    of = Mushroom(
        r=law(draw, 0.75, 1.5, shared),
        h=law(draw, 0.5, 1.5, shared),
        nu=law(draw, 1 - 2 * ring, 1 - ring, shared),
    )
    t = when(draw, of)
    flight = draw.between(0.25, 1.0) / draw.power(0, 3)
    y = draw.between(0.05, 0.3)
    there = rounded(of, t + flight)
    x = draw.between(-0.1, 0.1)
    to = draw.pick((1.0, -1.0)) * (
        there.w + draw.pick((0.5, -0.5, 0.25, -1e3)) * (there.r - there.w)
    )
    return Question(of, State(t, x, y, (to - x) / flight, -y / flight), t + 4 * flight)


def steep(draw: Draw) -> Question:
    """Fly in a stem whose sides are as flat as its floor: slopes of 2^-2 to 2^6, of either sign."""
    shared = clock(draw)
    depth = draw.power(-6, 0)
    w = law(draw, 0.5, 1.0, shared)
    h = law(draw, 0.5 * depth, depth, shared)
    steepest = 0.9 * law_of(w).bounds().lowest / law_of(h).bounds().highest
    low, high = draw.pick(((0.5, 1.0), (-1.0, -0.5), (-1.0, 1.0)))
    of = Stem(w=w, h=h, slope=law(draw, low * steepest, high * steepest, shared))
    return Question(
        of, *start(draw, of, when(draw, of), draw.pick(("stem", "floor", "left", "right")))
    )


def growing(table: str, draw: Draw) -> Question:
    """Follow walls that draw back by 2^2 to 2^6 times their distance from the start.

    They are met beyond it.
    """
    motion = swing(draw, draw.pick(MOVING))
    part = draw.power(-6, -2)
    size = motion.law(part, 1.0)
    of: Scene = Cap(r=size) if table == "cap" else Stem(w=size, h=size)
    t = motion.least
    c, s = draw.direction()
    speed = draw.between(0.3, 2.0) / motion.length
    y = part * draw.between(0.1, 0.9)
    way = 1.0 if table == "cap" else -1.0
    return Question(
        of, State(t, 0.0, way * y, speed * c, way * speed * abs(s)), t + 4 * motion.length
    )


FAMILIES = (
    Family(
        "deep-waves",
        "amplitudes that add up to more than the mean of a law that is positive all the same",
        deep_waves,
        weight=6,
    ),
    Family(
        "anywhere",
        "a flight in a scene that no file holds",
        partial(anywhere, None, None),
        weight=30,
    ),
    *(
        Family(
            f"anywhere-{table}-{wall}",
            "a flight in a scene that no file holds",
            partial(anywhere, table, wall),
            weight=6,
            meets=wall,
        )
        for table, wall in WALLS
    ),
    *(
        Family(
            f"returning-{table}-{wall}",
            "a wall just left is met again: no flight is too short for that, in any unit",
            partial(returning, table, wall),
            weight=2,
            meets=wall,
        )
        for table, wall in MOVABLE
    ),
    Family(
        "many-knots-cap",
        "laws of as many legs as there may be",
        partial(many_knots, "cap"),
        weight=2,
        meets="arc",
    ),
    Family(
        "many-knots-stem",
        "laws of as many legs as there may be",
        partial(many_knots, "stem"),
        weight=2,
        meets="floor",
    ),
    *(
        Family(f"leaning-{wall}", "sides are taken for upright", leaning, weight=4, meets=wall)
        for wall in SIDES
    ),
    *(
        Family(
            f"changed-mouth-{wall}",
            "the mouth is looked at where a flight begins",
            changed_mouth,
            weight=1,
            meets=wall,
        )
        for wall in Mushroom.walls
        if wall != "arc"
    ),
    Family(
        "hurried", "walls are taken to stand, for particles so fast", hurried, weight=4, meets="arc"
    ),
    Family(
        "from-the-base",
        "no start names the base where the mouth is open now",
        from_the_base,
        weight=3,
    ),
    *(
        Family(
            f"vibrating-{table}",
            "a particle that meets nothing for many periods is given up",
            partial(vibrating, table),
            weight=3,
            meets="base",
        )
        for table in ("cap", "stem")
    ),
    *(
        Family(
            f"bend-{name}-{kind}",
            f"a bound of f'' forgets a term: {name}, of laws that are {kind}",
            partial(bend, term, kind),
            weight=3 if term.is_fast else 1,
        )
        for name, term in TERMS.items()
        for kind in MOVING
    ),
    *(
        Family(
            f"brief-{table}-{wall}",
            "a wall is looked at only every so often, though it came by between",
            partial(brief, table, wall),
            weight=1,
            meets=wall,
        )
        for table, wall in MOVABLE
    ),
    Family("thin-ring", "a base of 1e-12 of the cap is lost in a tolerance", thin_ring, weight=4),
    Family("steep", "slopes are taken to be small", steep, weight=4),
    *(
        Family(
            f"growing-{table}",
            "no wall is looked for beyond the sizes of the start",
            partial(growing, table),
            weight=2,
        )
        for table in ("cap", "stem")
    ),
)
