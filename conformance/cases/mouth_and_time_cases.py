"""The hard cases as vectors: the mouth and corners (23 to 33), time and scale (34 to 48)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from conformance.cases.draws import unproved, wire_form
from conformance.cases.grazing_and_stem_cases import (
    BOX,
    CIRCLE,
    LIFT,
    STATIC,
    case,
    grazing_and_slow,
    stem,
)
from conformance.cases.question import Question
from conformance.vectors import OutcomeName
from scene import BangBang, Fourier, Mushroom, Scene, State, load
from scene.tables import laws
from scene.transforms import backwards

# The mouth: w = 1/2 - t^2 / 2 until t = 1/2, then 1/4 + (t - 1)^2 / 2 until t = 3/2.
CLOSING = Mushroom(r=1.0, h=1.0, w=BangBang(knots=((0.0, 0.5), (1.0, 0.25), (2.0, 0.5))))
DOWN = State(0.0, 0.5, 0.5, 0.0, -1.0)


def cases() -> list[Question]:
    """List every hard case that a protocol line can ask."""
    return [
        *grazing_and_slow(),
        *stem(),
        *mouth(),
        *corners(),
        *times(),
        *scales(),
        *symmetries(),
        *refused(),
    ]


def mouth() -> Iterator[Question]:
    """Yield hard cases 23 to 27, 31 and 32."""
    for x, y, vy in ((0.25, 0.25, -1.0), (0.25, -0.25, 1.0)):
        yield case(23, "the mouth's edge is hit", STATIC, State(0.0, x, y, 1.0, vy))
    for k in (54, 50, 45, 30):
        for side in (1, -1):
            start = State(0.0, 0.25 + side * 2.0**-k, 0.25, 1.0, -1.0)
            yield case(23, "beside the mouth's edge", STATIC, start)
    for t, x in ((0.0, 0.4375), (0.0, 0.375 + 2.0**-30), (0.0, 0.375 - 2.0**-30), (1.0, 0.3125)):
        rule = "the width at the crossing decides, not that at departure"
        yield case(24, rule, CLOSING, State(t, x, 0.5, 0.0, -1.0))
    yield case(24, "the mouth opens in flight", CLOSING, State(1.0, 0.375 + 2.0**-30, 0.5, 0.0, -1.0))
    for x in (0.25 - 2.0**-20, 0.25 + 2.0**-20):
        yield case(25, "beside a double root of |x| - w", CLOSING, State(0.5, x, 0.5, 0.0, -1.0), 1.5)
    rule = "a double root of |x| - w at the crossing"
    edge = State(0.5, 0.25, 0.5, 0.0, -1.0)
    yield case(25, rule, CLOSING, edge, 1.5)
    for depth in (2.0**-20, 2.0**-500):
        start = State(0.0, 0.40625, -depth, 0.0, 0.0)
        yield case(26, "just below a closing mouth a side hits", CLOSING, start)
    along = State(0.0, 0.0, 0.0, 1.0, 0.0)
    yield case(27, "along the base: sliding", STATIC, State(0.0, 0.75, 0.0, 1.0, 0.0, "base"))
    yield case(27, "along the mouth to its edge", STATIC, along)
    yield case(27, "along the mouth, not to its edge", STATIC, along, 0.25)
    narrow = Mushroom(r=1.0, h=1.0, w=1e-12)
    for x, vx in ((0.0, 0.0), (2e-12, 0.0), (0.0, 1.5e-12)):
        yield case(31, "a mouth of half-width 1e-12", narrow, State(0.0, x, 0.5, vx, -1.0))
    sliver = Mushroom(r=1.0, h=1.0, nu=1 - 2.0**-30)
    yield case(32, "a base that is a sliver", sliver, State(0.0, 1 - 2.0**-31, 2.0**-20, 0.0, -1.0))
    yield case(32, "nu = 1: no base at all", Mushroom(r=1.0, h=1.0, nu=1.0), DOWN)
    for mean in (0.75, 0.75 + 2.0**-53):
        nu = Fourier(mean=mean, omega=1.0, cos=(0.25,))
        rule = "nu = 1 at an instant is valid, more by one unit in the last place is not"
        yield case(32, rule, unproved("mushroom", r=1.0, h=1.0, nu=nu), DOWN, 3.0)


def corners() -> Iterator[Question]:
    """Yield hard cases 28 to 30."""
    yield case(28, "arc meets base", CIRCLE, State(0.0, 0.5, 0.5, 0.5, -0.5))
    for vx in (0.5, -0.5):
        yield case(29, "floor meets side", BOX, State(0.0, vx, -0.5, vx, -0.5))
    for k in (20, 30, 40, 50):
        start = State(0.0, 0.5 + 2.0**-k, -0.5, 0.5, -0.5)
        yield case(30, "beside a corner: the nearer wall", BOX, start)
        both = case(30, "beside a corner: two hits, none skipped", BOX, start, 100.0, 2)
        yield both._replace(longest=1e18)  # only the time between the two is that delicate


def times() -> Iterator[Question]:
    """Yield hard cases 34 to 39."""
    yield case(34, "a hit at a knot", LIFT, State(0.0, 0.5, -1.5, 0.0, 0.0))
    rise, before = 2.0**-10, 0.25 - 2.0**-20
    for t, y, vy in ((0.25, -1.5, 4 + rise), (before, 8 * before**2 - 2, 4 + rise), (0.75, -1.5, -4 + rise)):
        rule = "a start on a knot: the law after it holds"
        yield case(35, rule, LIFT, State(t, 0.0, y, 0.0, vy, "floor"))
    for y in (-1.0625, -1.25):
        yield case(36, "a knot inside a flight", LIFT, State(0.0, 0.0, y, 0.0, 0.0))
    late = State(188.49555921538757, 0.1, 0.3, 10.0, 7.0)
    yield case(38, "a late start: full precision in dt", load("moving-cap"), late, 200.0)
    for t in (2.0**24, 2.0**30, 1e15):
        # A stepper may refuse times at which a period is lost in rounding, if it says so.
        also: tuple[OutcomeName, ...] = ("rejected",) if t > 2.0**24 else ()
        start = State(t, 0.0, -1.75, 0.0, 0.0)
        yield case(39, "an astronomical time", LIFT, start, t + 64, None, also)
    start = State(1e15, 0.1, 0.3, 10.0, 7.0)
    rule = "an astronomical time, an irrational period"
    yield case(39, rule, load("moving-cap"), start, 1e15 + 64, None, ("rejected",))


def scales() -> Iterator[Question]:
    """Yield hard cases 40 to 42 and 44."""
    for speed in (1e100, 1e200, 1e300):
        rule = "squares that overflow: scaled or refused, never nan"
        start = State(0.0, 0.0, 0.5, speed, 0.0)
        yield case(40, rule, CIRCLE, start, 1.0, None, ("rejected",), "extended")
    least = 5e-324
    for of, y, vy in ((BOX, -0.5, least), (BOX, -0.5, -least), (STATIC, -0.5, least), (CIRCLE, 0.5, -least)):
        yield case(41, "y / vy overflows: never crossed", of, State(0.0, 0.0, y, 1.0, vy), level="extended")
    for vx in (0.0, 1.0):
        rule = "subnormal numbers are not flushed"
        yield case(42, rule, BOX, State(0.0, 0.0, -3 * least, vx, 1.0), level="extended")
    fallen = State(0.0, 0.0, least, 0.0, -1.0)
    yield case(42, "subnormal numbers are not flushed", CIRCLE, fallen, level="extended")
    for of in (BOX, CIRCLE, STATIC):
        y = -0.5 if of is BOX else 0.5
        start, rule = State(0.0, 0.1, y, 0.7, 0.3), "laws that move by nothing stand still"
        yield case(44, rule, of, start, 100.0, 12)
        yield case(44, rule, _still(of), start, 100.0, 12)


def symmetries() -> Iterator[Question]:
    """Yield hard cases 43, 47 and 48."""
    starts = ((0.1, 0.3, 10.0, 7.0), (0.1, -0.3, 1.0, -0.5), (0.0, 0.5, 1.0, 0.0))
    for name in ("moving-cap", "fixed-cap-clockwise", "frozen-mushroom"):
        for x, y, vx, vy in starts:
            for sign in (1.0, -1.0):
                start = State(0.0, sign * x, y, sign * vx, vy)
                yield case(43, "x -> -x mirrors", load(name), start, 9.0)
    for zero in (0.0, -0.0):
        start = State(zero, zero, 0.5, zero, -1.0)
        yield case(43, "signs of zero do not matter", STATIC, start, 9.0)
    for name in ("moving-cap", "fixed-cap-clockwise"):
        of = load(name)
        films: tuple[tuple[Scene | dict[str, Any], float], ...] = (
            (of, 0.125),
            (wire_form(backwards(of)), -0.625),
        )
        for scene, t in films:
            start = State(t, 0.1, 0.3, 10.0, 7.0)
            yield case(47, "a film run forwards, and its laws run backwards", scene, start, t + 0.5, 99)
        for sign in (1.0, -1.0):
            start = State(0.0, sign * 0.1, 0.3, sign * 10.0, 7.0)
            yield case(48, "mirror images collide together", of, start, 9.0, 12)


def refused() -> Iterator[Question]:
    """Yield hard cases 33, 37, 45 and 46: what is no scene, or no state of its scene."""
    inside = State(0.0, 0.1, 0.2, 1.0, 0.0)
    for least in (0.0, -(2.0**-53)):
        law = Fourier(mean=0.25 + least, omega=1.0, sin=(0.25,))
        for of in (
            unproved("cap", r=law),
            unproved("stem", w=1.0, h=law),
            unproved("stem", w=law, h=1.0, slope=-0.5),
        ):
            yield case(33, "min r, h or w <= 0", of, inside)
    for knots in (((0.0, 1.0), (1.0, 2.0)), ((0.0, 1.0), (0.5, 1.0), (0.5, 2.0), (1.0, 1.0))):
        of_jump = unproved("stem", w=1.0, h={"kind": "bang-bang", "knots": knots})
        yield case(37, "a jump in a law", of_jump, State(0.0, 0.1, -0.2, 1.0, 0.0))
    for scene, state in (
        (CIRCLE, State(0.0, 0.9, 0.9, 1.0, 0.0)),
        (CIRCLE, State(0.0, 0.1, -0.1, 1.0, 0.0)),
        (BOX, State(0.0, -1.5, -0.5, 1.0, 0.0)),
        (LIFT, State(0.5, 0.0, -1.5, 1.0, 0.0)),
        (CIRCLE, State(0.0, 0.6, 0.8, 1.0, 0.0, "arc")),
        (LIFT, State(0.25, 0.0, -1.5, 0.0, 3.75, "floor")),
        (BOX, State(0.0, 0.1, 0.0, 1.0, 1.0, "base")),
        (CIRCLE, State(0.0, 0.1, 0.5, 1.0, 1.0, "floor")),
    ):
        yield case(45, "a start outside, or on a wall that it approaches", scene, state)
    yield case(45, "a horizon before the start", CIRCLE, State(1.0, 0.1, 0.5, 1.0, 1.0), 0.5)
    broken = (
        {"table": "cap"},
        {"table": "cap", "r": 1.0, "colour": 2.0},
        {"table": "cap", "r": {"kind": "fourier", "mean": 1.0}},
        {"table": "cap", "r": {"kind": "spline", "mean": 1.0, "omega": 1.0}},
        {"table": "cap", "r": "1"},
        {"table": "mushroom", "r": 1.0, "h": 1.0},
        {"table": "mushroom", "r": 1.0, "h": 1.0, "w": 0.5, "nu": 0.5},
        {"table": "ellipse", "r": 1.0},
        {"r": 1.0},
    )
    for data in broken:
        yield case(46, "missing, extra or ill-typed fields of a scene", dict(data), inside)


def _still(of: Scene) -> dict[str, Any]:
    """Return the same table, with laws that move by nothing."""
    flat = {"kind": "fourier", "omega": 1.0, "sin": [0.0, 0.0], "cos": [0.0]}
    found = {name: {**flat, "mean": law} for name, law in laws(of).items()}
    return {**wire_form(of), **found}
