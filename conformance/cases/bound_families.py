"""Families aimed at the slack of bounds by which a stepper excludes hits.

Between two looks at a wall's f > 0 a stepper proves by a bound of f'' that the wall is not met. If a term
of f'' is forgotten there, a wall that meets the particle for a short time and draws back is never seen. Each
term is made the only one that matters, for each kind of law:

    arc      f'' = 2 (r'^2 + r r'' - v^2)
    floor    f'' = h''
    sides    f'' = w'' + m'' y + 2 m' v_y, with w = nu r also nu'' r + 2 nu' r' + nu r''

A brief meeting is made where it is: at some time the particle is a little beyond the wall, with the wall's
own velocity along the normal, while f'' > 0 along the flight. About that time f is f'' s^2 / 2 - depth: the
length asked for gives the depth, and the start is some time before on the same line.
"""

from collections.abc import Callable
from functools import partial
from math import hypot
from typing import NamedTuple

from conformance.cases.draw import Draw, Family, Question, Unfit
from conformance.cases.run_families import MOVABLE
from conformance.cases.scenes import (
    LONGEST,
    MOVING,
    PERIODS,
    any_scene,
    clock,
    law,
    point,
    start,
    walls_speed,
    when,
)
from conformance.plain.step import Flight
from scene import BangBang, Cap, Fourier, Law, Mushroom, Scene, State, Stem, Wall
from scene.geometry import rounded
from scene.laws import bounds

LOOK = 2.0**-20  # of a period: f' after so long is f'' times as much
LASTS = -13, -8  # how long a meeting is, as powers of two of a period: shorter ones are delicate


class Term(NamedTuple):
    """A term of f'': the walls that have it, the laws that move, and whether it is greatest at full speed."""

    walls: tuple[Wall, ...]
    moving: frozenset[str]
    is_fast: bool = False


SIDES: tuple[Wall, ...] = ("left", "right")
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
    """A motion there and back: `law(low, high)` is low at the time `least`, and fastest after `fast`."""

    law: Callable[[float, float], Law]
    least: float
    fast: float
    length: float


def swing(draw: Draw, kind: str) -> Swing:
    """Draw a motion of a kind: two legs, or one harmonic."""
    length, quarter = draw.pick(PERIODS), draw.pick(range(4))
    first = length * (quarter / 4 + draw.pick((0, 0, -1, 5)))
    turn = length * (draw.pick((0.5, 0.25, 0.75)) if kind == "bang-bang" else 0.5)

    def legs(low: float, high: float) -> Law:
        return BangBang(knots=((first, low), (first + turn, high), (first + length, low)))

    def harmonic(low: float, high: float) -> Law:
        half = (low - high) / 2 if quarter < 2 else (high - low) / 2
        cos, sin = ((), (half,)) if quarter % 2 else ((half,), ())
        return Fourier(mean=(low + high) / 2, period=length, cos=cos, sin=sin)

    fast = first + turn * draw.between(0.42, 0.48)
    return Swing(legs if kind == "bang-bang" else harmonic, first, fast, length)


def bend(term: Term, kind: str, draw: Draw) -> Question:
    """Meet a wall briefly where one term of f'' matters."""
    wall, motion = draw.pick(term.walls), swing(draw, kind)

    def law(name: str) -> Law:
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
    along, length = walls_speed(of) * draw.power(-6, -1), motion.length
    if not term.is_fast:
        lasts, t = length * draw.power(*LASTS), motion.least + length * draw.between(-0.05, 0.05)
        return Question(
            of, touch(draw, of, t, wall, along, lasts, length * draw.power(-5, -2)), t + 2 * lasts
        )
    if "slope" in term.moving:
        along = draw.power(4, 5) / length
    before = length * 2.0**-7 * draw.between(0.5, 1.0)
    start = touch(draw, of, motion.fast, wall, along, before * draw.power(-5, -3), before)
    return Question(of, start, motion.fast + before * draw.between(0.9, 1.1))


def touch(draw: Draw, of: Scene, t: float, wall: Wall, along: float, lasts: float, before: float) -> State:
    """Return a start from which a wall is met for a short time about t, if nothing else is met by then.

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
    length, table = of.period or 1.0, rounded(of, t)
    x, y = point(table, wall, draw.between(0.2, 0.8), draw.between(0.2, 0.8))
    nx, ny = table.normal(wall, x, y)
    along, away = draw.pick((1.0, -1.0)) * along * draw.between(0.5, 1.0), -table.receding(wall, y)
    vx, vy = away * nx - along * ny, away * ny + along * nx
    flight = Flight(of, State(t, x, y, vx, vy, wall), t + length)
    f_bend, gap = flight.f(wall, LOOK * length)[1] / (LOOK * length), flight.gap(wall, 0.0)
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
    t, length = when(draw, of), of.period or 1.0
    along, before = walls_speed(of) * draw.power(-6, 0), length * draw.power(-5, -2)
    lasts = length * draw.power(*LASTS) * draw.between(0.5, 1.0)
    start = touch(draw, of, t, wall, along, lasts, before)
    t_end = t + 2 * lasts + length * draw.between(0.5, LONGEST / 2)
    return Question(of, start, t_end, *draw.pick(((40, True), (None, False))))


def thin_ring(draw: Draw) -> Question:
    """Come down beside the edge of a mouth that is as wide as the cap but for 2^-3 to 2^-45."""
    shared, ring = clock(draw), draw.power(-45, -3) * draw.between(0.5, 1.0)
    of = Mushroom(
        r=law(draw, 0.75, 1.5, shared),
        h=law(draw, 0.5, 1.5, shared),
        nu=law(draw, 1 - 2 * ring, 1 - ring, shared),
    )
    t, flight, y = when(draw, of), draw.between(0.25, 1.0) / draw.power(0, 3), draw.between(0.05, 0.3)
    there, x = rounded(of, t + flight), draw.between(-0.1, 0.1)
    to = draw.pick((1.0, -1.0)) * (there.w + draw.pick((0.5, -0.5, 0.25, -1e3)) * (there.r - there.w))
    return Question(of, State(t, x, y, (to - x) / flight, -y / flight), t + 4 * flight)


def steep(draw: Draw) -> Question:
    """Fly in a stem whose sides are as flat as its floor: slopes of 2^-2 to 2^6, of either sign."""
    shared, depth = clock(draw), draw.power(-6, 0)
    w, h = law(draw, 0.5, 1.0, shared), law(draw, 0.5 * depth, depth, shared)
    steepest = 0.9 * bounds(w).lowest / bounds(h).highest
    low, high = draw.pick(((0.5, 1.0), (-1.0, -0.5), (-1.0, 1.0)))
    of = Stem(w=w, h=h, slope=law(draw, low * steepest, high * steepest, shared))
    return Question(of, *start(draw, of, when(draw, of), draw.pick(("stem", "floor", "left", "right"))))


def growing(table: str, draw: Draw) -> Question:
    """Follow walls that draw back by 2^2 to 2^6 times their distance of the start, and are met beyond it."""
    motion, part = swing(draw, draw.pick(MOVING)), draw.power(-6, -2)
    size = motion.law(part, 1.0)
    of: Scene = Cap(r=size) if table == "cap" else Stem(w=size, h=size)
    t, (c, s) = motion.least, draw.direction()
    speed, y = draw.between(0.3, 2.0) / motion.length, part * draw.between(0.1, 0.9)
    way = 1.0 if table == "cap" else -1.0
    return Question(of, State(t, 0.0, way * y, speed * c, way * speed * abs(s)), t + 4 * motion.length)


FAMILIES = (
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
