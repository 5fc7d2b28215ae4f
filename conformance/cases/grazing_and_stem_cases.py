"""The hard cases as vectors, by their numbers: grazing, slow particles before fast walls, the stem.

See `mouth_and_time_cases` for the mouth, corners, time and scale. Cases that no protocol line can
ask (nan, missing fields of a state) belong to the protocol's own tests. Within a group the order is part of
the ids: new cases go to the end.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from conformance.cases.draws import unproved, wire_form
from conformance.cases.question import Question
from conformance.vectors import Level, OutcomeName
from scene import BangBang, Cap, Fourier, Mushroom, Scene, State, Stem

CIRCLE = Cap(r=1.0)
BOX = Stem(w=1.0, h=1.0)
STATIC = Mushroom(r=1.0, h=1.0, w=0.5)
# A floor that comes up at constant acceleration 16, h = 2 - 8 t^2 until t = 1/4, then
# h = 1 + 8 (t - 1/2)^2 until t = 3/4, then 2 - 8 (t - 1)^2: down again.
LIFT = Stem(w=1.0, h=BangBang(knots=((0.0, 2.0), (0.5, 1.0), (1.0, 2.0))))


def case(
    number: int,
    rule: str,
    of: Scene | dict[str, Any],
    state: State,
    t_end: float = 100.0,
    collisions: int | None = None,
    also: tuple[OutcomeName, ...] = (),
    level: Level | None = None,
) -> Question:
    """Return the question of a hard case."""
    data = of if isinstance(of, dict) else wire_form(of)
    return Question(
        f"hard-case-{number:02}", rule, f"hard case {number}", data, state, t_end, collisions, also, level
    )


def grazing_and_slow() -> Iterator[Question]:
    """Yield hard cases 1 to 16."""
    yield case(1, "an arc left at v_n / v = 1e-8", CIRCLE, _inward(1.0, 1e-8))
    for k in (20, 30, 40, 46, 53):
        rule = "the middle of a chord, close to the arc"
        yield case(1, rule, CIRCLE, State(0.0, 0.0, 1 - 2.0**-k, 1.0, 0.0))
    for angle in (2.0**-4, 1e-3):
        yield case(2, "a whispering gallery: no ghost hit at s = 0", CIRCLE, _inward(1.0, angle), 100.0, 40)
    for rate in (0.25, -0.25):
        of, start = Cap(r=Fourier(mean=1.0, omega=1.0, sin=(rate,))), _inward(1.0, 2.0**-6 - rate)
        yield case(3, "a gallery with a moving arc: the full moving f", of, start)
        yield case(3, "a gallery with a moving arc, followed", of, start, 100.0, 30)
    for least in (1e-12, 1e-14, 1e-16, 1e-30, 1e-100, 1e-300):
        bottom = min(1.0, least * 2.0**20)
        of_lift = Stem(w=1.0, h=BangBang(knots=((0.0, 2.0), (0.5, bottom), (1.0, 2.0))))
        of_reach: Level = "extended" if least > 1e-13 else "stress"  # the law's own rounding
        rule = "a floor that stops just short of a resting particle"
        yield case(4, rule, of_lift, State(0.0, 0.0, least - bottom, 0.0, 0.0), 0.9, level=of_reach)
    touching = State(0.5, 0.0, -1.0, 0.0, 0.0, "floor")
    yield case(5, "f = f' = 0, f'' > 0 at the start: no event", LIFT, touching, 1.25)
    for start in (State(0.0, 0.0, -2.0, 0.0, 0.0, "floor"), State(0.75, 0.0, -1.5, 0.0, -4.0, "floor")):
        yield case(6, "a wall pushes a co-moving particle: sliding", LIFT, start)
    triple = Stem(w=1.0, h=Fourier(mean=2.0, omega=1.0, sin=(0.5, -0.25)))
    yield case(7, "a triple root at zero relative velocity", triple, State(0.0, 0.0, -2.0, 0.0, 0.0, "floor"))
    for vy in (0.5, 0.125, 0.75):
        yield case(8, "a wall overtakes: gate on f', not on v", LIFT, State(0.0, 0.0, -1.9, 0.0, vy))
    rises: dict[float, Level] = {1e-3: "core", 1e-9: "extended", 1e-12: "extended"}
    for rise in (1e-3, 1e-9, 1e-12, 1e-15, 1e-30, 1e-100):
        start, level = State(0.0, 0.0, -2.0, 0.0, rise, "floor"), rises.get(rise, "stress")
        yield case(9, "a recollision at s = 2 f'(0) / |f''|", LIFT, start, level=level)
    bouncing = State(0.0, 0.0, -2.0, 0.0, 2.0**-7, "floor")
    yield case(10, "constant acceleration: a train of bounces", LIFT, bouncing)
    yield case(10, "constant acceleration: a train of bounces, followed", LIFT, bouncing, 0.2, 30)
    returning = State(0.625, 0.0, -1.125, 0.0, -0.25, "floor")
    for start in (returning, State(0.5, 0.0, -0.75, 0.0, -0.5)):
        yield case(11, "a receding wall is met when it comes back", LIFT, start)
    for bits in (10, 30, 50):
        start = State(0.5, 0.0, -0.625, 0.0, -4 - 2.0**-bits)
        yield case(12, "the velocity after the hit cancels", LIFT, start)
    yield case(13, "at rest and swept", LIFT, State(0.0, 0.5, -1.75, 0.0, 0.0))
    yield case(14, "at rest and never swept", LIFT, State(0.0, 0.5, -0.5, 0.0, 0.0), 50.0)
    many = Stem(w=1.0, h=Fourier(mean=2.0, omega=1.0, cos=(0.0,) * 15 + (0.125,)))
    yield case(15, "the first of many roots", many, State(0.0, 0.0, -1.5, 0.0, -(2.0**-7)))
    for speed in (1e12, 1e6, 1e-6, 1e-12):
        rule = "a particle and walls of speeds far apart"
        yield case(16, rule, LIFT, State(0.0, 0.0, -1.9, 0.0, -speed))


def stem() -> Iterator[Question]:
    """Yield hard cases 17 to 22."""
    level = State(0.0, 0.25, -0.5, 1.0, 0.0)
    yield case(17, "level flight bounces for ever", BOX, level, 100.0, 40)
    swept = State(0.0, 0.0, -1.75, 64.0, 0.0)
    yield case(17, "level flight until the floor ends it", LIFT, swept, 100.0, 7)
    sides = Stem(w=BangBang(knots=((0.0, 1.0), (0.5, 0.5), (1.0, 1.0))), h=1.0)
    for vy in (0.5, 0.0):
        yield case(18, "a moving side hits", sides, State(0.0, 0.875, -0.5, 0.0, vy))
    slow_rise = State(0.0, 0.0, -0.9, 1.0, 2.0**-22)
    yield case(19, "nearly level flight keeps its vertical velocity", BOX, slow_rise, 1e3, 40)
    widening = Stem(w=0.5, h=1.0, slope=-0.5)
    yield case(20, "a floor wider than the mouth", widening, State(0.0, 0.25, -0.5, 0.5, -0.5))
    yield case(20, "the side of a widening stem", widening, State(0.0, 0.0, -0.5, 1.0, 0.0))
    triangle = Stem(w=0.5, h=1.0, slope=0.5 - 2.0**-40)
    for x in (0.0, 2.0**-42, 2.0**-40):
        rule = "a stem that is nearly a triangle"
        yield case(21, rule, triangle, State(0.0, x, -0.5, 0.0, -1.0))
    narrowing = Stem(w=0.5, h=1.0, slope=0.25)
    yield case(21, "sides that would meet below the floor", narrowing, State(0.0, 0.0, -0.5, 0.0, -1.0))
    apex = unproved("stem", w=0.5, h=1.0, slope=0.5)
    yield case(21, "a closed stem is refused", apex, State(0.0, 0.0, -0.5, 0.0, -1.0))
    for wide in (1e-3, 1e-9, 1e-15):
        for top in (0.4999, 0.5001):
            knots = ((0.0, 0.1), (0.3 - wide, 0.1), (0.3, top), (0.3 + wide, 0.1), (1.0, 0.1))
            rule = "a spike of the slope: valid below w / h, refused above, by proof over the period"
            of = unproved("stem", w=0.5, h=1.0, slope=BangBang(knots=knots))
            # A stepper that bounds curvature over all times cannot decide past the sharper spikes.
            hard: Level | None = "stress" if wide < 1e-3 and top < 0.5 else None
            yield case(22, rule, of, State(0.5, 0.0, -0.5, 0.25, -1.0), level=hard)


def _inward(tangential: float, normal: float) -> State:
    """Return a state on the unit circle at (0.6, 0.8), by the parts of its velocity."""
    vx, vy = -0.8 * tangential - 0.6 * normal, 0.6 * tangential - 0.8 * normal
    return State(0.0, 0.6, 0.8, vx, vy, "arc")
