"""The families that look where steppers are seldom tested: far times, near walls, narrow margins."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf, nextafter

import msgspec

from conformance.cases.draws import (
    Draw,
    SharedPeriod,
    clock,
    law,
    scene,
    state,
    time,
    wire_form,
)
from conformance.cases.families import VectorFamily
from conformance.cases.flow_families import any_marks, tilted
from conformance.cases.grazing_and_stem_cases import BOX, CIRCLE, LIFT, STATIC
from conformance.cases.question import Question
from conformance.cases.seldom import drawn_deep_wave
from scene import BangBang, Cap, Fourier, Mushroom, Scene, State, Stem
from scene.geometry import rounded
from scene.tables import cycle_length, laws

TABLES = ("cap", "stem", "mushroom")


def coverage_families() -> list[VectorFamily]:
    """List these families, in the corpus's order."""
    return [
        VectorFamily("knots-off-zero", 40, _knots_off_zero),
        VectorFamily("waiting", 40, _waiting),
        VectorFamily("beside-a-wall", 50, _beside_a_wall),
        VectorFamily("far-phase", 30, _far_phase),
        VectorFamily("mouth-edge", 40, _mouth_edge),
        VectorFamily("mouth-nearly-whole", 30, _mouth_nearly_whole),
        VectorFamily("many-harmonics", 30, _many_harmonics),
        VectorFamily("tilting-side", 40, _tilting_side),
        VectorFamily("mixed-laws", 40, _mixed),
        VectorFamily("far-mouth", 24, _far_mouth),
        VectorFamily("deep-waves", 30, _deep_waves),
    ]


def _question(group: str, rule: str, source: str, of: Scene, start: tuple[State, float]) -> Question:
    return Question(group, rule, source, wire_form(of), *start)


def _knots_off_zero(draw: Draw) -> Question:
    """Ask about a bang-bang law whose first knot is not at 0, at times of either sign."""
    first, length = draw.pick(((0.3, 0.25), (-0.7, 0.5), (-0.7, 1.0), (-0.7, 1.5), (17.3, 0.5), (-0.25, 1.0)))
    of = scene(draw, draw.pick(TABLES), SharedPeriod("bang-bang", length))
    last = first + length  # the period, exactly, is a binary64 number for each of these

    def moved(knots: tuple[tuple[float, float], ...]) -> BangBang:
        inner = [(first + t, value) for t, value in knots[1:-1]]
        return BangBang(knots=((first, knots[0][1]), *inner, (last, knots[-1][1])))

    off = {name: moved(found.knots) for name, found in laws(of).items() if isinstance(found, BangBang)}
    of = msgspec.structs.replace(of, **off)
    t = time(draw, of) - (cycle_length(of) or 1.0) * draw.pick((0, 0, 1, 3, 40))
    at = {"t": t, "speed": draw.power(-2, 4), "patience": 8.0}
    rule = "knots that begin at another time than 0, before or after the start"
    return _question("knots-off-zero", rule, "sec. 4.1", of, state(draw, of, at))


def _waiting(draw: Draw) -> Question:
    """Ask about a particle that drifts for many periods through a part of the table that no wall sweeps."""
    shared = SharedPeriod(draw.pick(("fourier", "bang-bang", "mixed")), draw.pick((0.5, 1.0, 4.0)))
    n_periods = draw.pick((20, 20, 100)) * draw.between(1.0, 1.25)
    table = draw.pick(TABLES)
    of: Scene
    if table == "cap":
        of = Cap(r=law(draw, 1.0, 1.25, shared))
    elif table == "stem":
        of = Stem(w=law(draw, 1.0, 1.25, shared), h=law(draw, 2.0, 2.5, shared))
    else:
        nu, h = law(draw, 0.3, 0.6, shared), law(draw, 1.0, 1.25, shared)
        of = Mushroom(r=law(draw, 1.0, 1.25, shared), nu=nu, h=h)
    x, y = draw.between(-0.2, 0.2), draw.between(0.1, 0.4) * (-1.0 if table == "stem" else 1.0)
    t, (vx, vy) = time(draw, of), draw.direction()
    speed = 0.8 / (n_periods * (cycle_length(of) or shared.rate))
    start = State(t, x, y, speed * vx, speed * vy)
    rule = "a hit after tens of periods of flight"
    return _question("waiting", rule, "hard case 11", of, (start, t + 4.0 / speed))


def _beside_a_wall(draw: Draw) -> Question:
    """Ask about a start on one wall very near another."""
    of = scene(draw, draw.pick(TABLES), clock(draw))
    t = time(draw, of)
    near = 10.0 ** -draw.pick(range(3, 13)) * draw.between(1.0, 2.0)
    site, x, y = draw.pick(list(_near_corners(of, t, near)))
    side = draw.pick((1.0, -1.0))
    if site in ("left", "right"):
        site = "left" if side < 0 else "right"
    at = {"t": t, "site": site, "place": (side * x, y), "speed": draw.power(-1, 6), "patience": 16.0}
    rule = "a start on a wall, very near another: neither is taken for the other"
    return _question("beside-a-wall", rule, "hard case 30", of, state(draw, of, at))


def _near_corners(of: Scene, t: float, near: float) -> Iterator[tuple[str, float, float]]:
    """Yield sites with places of positive x, on one wall and so near (relative) to another."""
    now = rounded(of, t)
    if not isinstance(of, Stem):
        yield "arc", now.r * (1 - near * near) ** 0.5, now.r * near
        yield "base", now.r * (1 - near), 0.0
    if isinstance(of, Mushroom):
        yield "base", now.w + (now.r - now.w) * near, 0.0
    if not isinstance(of, Cap):
        for depth in (near, 1 - near):
            yield ("right", *now.stem_point("right", 1.0, depth))
        yield ("floor", *now.stem_point("floor", 1 - near, 1.0))
    if isinstance(of, Stem):
        yield "base", now.w * (1 - near), 0.0


def _far_phase(draw: Draw) -> Question:
    """Ask about a start more than 2^31 periods late, where binary64 still resolves the phase."""
    turns = float(draw.power(31, 34) + draw.pick(range(2**20)))
    shared = SharedPeriod(draw.pick(("fourier", "bang-bang", "mixed")), draw.pick((0.5, 1.0, 4.0)))
    of = scene(draw, draw.pick(TABLES), shared)
    t = draw.pick((1.0, 1.0, -1.0)) * (turns + draw.pick(range(64)) / 64) * (cycle_length(of) or shared.rate)
    rule = "a phase more than 2^31 periods late"
    asked = _question(
        "far-phase", rule, "hard case 39", of, state(draw, of, {"t": t, "speed": draw.power(0, 4)})
    )
    # A stepper may refuse times at which much of a phase is lost in rounding, if it says so.
    return asked._replace(also=("rejected",))


def _far_mouth(draw: Draw) -> Question:
    """Ask which wall is met where the phase decides: allowances grow with t, so numbers alone say little."""
    turns = float(draw.power(31, 34) + draw.pick(range(2**20))) + draw.pick(range(64)) / 64
    shared = SharedPeriod(draw.pick(("fourier", "bang-bang", "bang-bang")), draw.pick((0.5, 1.0, 4.0)))
    of = Mushroom(r=draw.short(1.0, 1.5), h=draw.short(1.0, 1.5), nu=law(draw, 0.1, 0.9, shared))
    t = draw.pick((1.0, 1.0, -1.0)) * turns * (cycle_length(of) or shared.rate)
    y, flight = draw.between(0.1, 0.3), draw.between(0.02, 0.1)
    widths = rounded(of, t + flight).w, rounded(of, flight).w
    x = draw.pick((0.5, -0.5)) * (widths[0] + widths[1])
    start = State(t, x, y, 0.0, -y / flight)
    rule = "the mouth more than 2^31 periods late: open or closed, as it is not at time 0"
    asked = _question("far-mouth", rule, "hard case 39", of, (start, t + 4 * flight))
    return asked._replace(also=("rejected",))


def _mouth_edge(draw: Draw) -> Question:
    """Ask about a crossing of y = 0 that misses the mouth's edge by a hundred millionth, or thereabouts."""
    shared = clock(draw, ("fourier", "bang-bang", "constant"))
    nu, slope = law(draw, 0.2, 0.8, shared), draw.pick((0.0, draw.short(0.0, 0.05)))
    of = Mushroom(r=law(draw, 0.75, 1.5, shared), h=law(draw, 1.0, 2.0, shared), nu=nu, slope=slope)
    t = time(draw, of)
    flight, off = draw.between(0.25, 1.0) / draw.power(0, 3), draw.pick((1e-6, 1e-7, 1e-8, 1e-8, 1e-8, 1e-9))
    edge = rounded(of, t + flight).w * (1 + draw.pick((1.0, -1.0)) * off * draw.between(0.5, 2.0))
    side, y = draw.pick((1.0, -1.0)), draw.between(0.05, 0.4) * draw.pick((1.0, 1.0, -1.0))
    x = draw.between(-0.1, 0.1)
    start = State(t, x, y, (side * edge - x) / flight, -y / flight)
    rule = "the mouth's edge is missed by little: no tolerance opens or closes it"
    return _question("mouth-edge", rule, "hard case 23", of, (start, t + 4 * flight))


def _mouth_nearly_whole(draw: Draw) -> Question:
    """Ask about a mouth that is as wide as the cap but for a thousand millionth, always or at times."""
    sliver = 1e-9 * draw.between(0.1, 1.0)
    shared = clock(draw, ("fourier", "bang-bang"))
    swing = draw.pick((0.0, 2.0**-30, 0.25))
    nu: float | Fourier | BangBang = 1.0 - sliver
    if swing and shared.kind == "fourier":
        nu = Fourier(mean=1.0 - sliver - swing, omega=shared.rate, cos=(swing,))
    elif swing:
        low = 1.0 - sliver - 2 * swing
        nu = BangBang(knots=((0.0, 1.0 - sliver), (shared.rate / 2, low), (shared.rate, 1.0 - sliver)))
    of = Mushroom(r=law(draw, 0.75, 1.5, shared), h=law(draw, 1.0, 2.0, shared), nu=nu)
    t = time(draw, of)
    flight, speed_up = draw.between(0.25, 1.0) / draw.power(0, 3), draw.pick((1.0, -1.0))
    there = rounded(of, t + flight)
    part = draw.pick((draw.part(), draw.part(), -draw.part(), -1e6 * draw.part()))
    aim = there.w + part * (there.r - there.w)
    x, y = draw.between(-0.1, 0.1), draw.between(0.05, 0.3)
    start = State(t, x, y, (speed_up * aim - x) / flight, -y / flight)
    rule = "nu within a thousand millionth of 1: the base is a sliver"
    return _question("mouth-nearly-whole", rule, "hard case 32", of, (start, t + 4 * flight))


def _many_harmonics(draw: Draw) -> Question:
    of = scene(draw, draw.pick(TABLES), SharedPeriod("harmonics", draw.pick((1.0, 3.0, 8.0))))
    at = {"speed": draw.power(-3, 4), "patience": draw.pick((4.0, 16.0))}
    rule = "four to sixteen harmonics: all of them count"
    return _question("many-harmonics", rule, "hard case 15", of, state(draw, of, at))


def _tilting_side(draw: Draw) -> Question:
    of = tilted(draw, clock(draw, ("fourier", "bang-bang")))
    at = {"site": draw.pick(("stem", "left", "right")), "speed": draw.power(-4, 1), "patience": 4.0}
    at["lift"] = draw.power(-12, -1)
    start, t_end = state(draw, of, at)
    rule = "a side that moves and tilts: its rate and its curvature grow with depth"
    return _question("tilting-side", rule, "sec. 2", of, (start, min(t_end, start.t + 16)))


def _mixed(draw: Draw) -> Question:
    of = scene(
        draw, draw.pick(("stem", "mushroom", "mushroom")), SharedPeriod("mixed", draw.pick((0.5, 1.0, 4.0)))
    )
    rule = "laws of every kind in one scene, of one period"
    return _question("mixed-laws", rule, "sec. 2", of, state(draw, of, {"speed": draw.power(-2, 6)}))


def _deep_waves(draw: Draw) -> Question:
    """Ask about walls of whose laws the mean less all amplitudes says that they may vanish."""
    shared, table = clock(draw, ("fourier",)), draw.pick(TABLES)
    of: Scene
    if table == "cap":
        of = Cap(r=drawn_deep_wave(draw, 0.05, 1.5, shared.rate))
    elif table == "stem":
        of = Stem(
            w=drawn_deep_wave(draw, 0.05, 1.0, shared.rate), h=drawn_deep_wave(draw, 0.1, 2.0, shared.rate)
        )
    else:
        nu = drawn_deep_wave(draw, 0.02, 0.9, shared.rate)
        of = Mushroom(r=drawn_deep_wave(draw, 0.05, 1.5, shared.rate), h=draw.short(0.5, 1.5), nu=nu)
    start = state(draw, of, {"speed": draw.power(-4, 2), "patience": draw.pick((1.0, 4.0))})
    rule = "amplitudes that add up to more than the mean of a law that is positive all the same"
    return _question("deep-waves", rule, "sec. 2", of, start)


def at_the_horizon() -> Iterator[Question]:
    """Yield hits at t_end exactly, which come too late, and one unit in the last place to either side.

    Every number on the way is a short dyadic one, so a stepper may meet the hit to the bit.
    """
    wall_to_wall, ray = State(0.0, 0.0, -0.5, 1.0, 0.0), State(0.0, 0.0, 0.5, 0.0, 1.0)
    lifted = State(0.0, 0.5, -1.5, 0.0, 0.0)  # y + h = 1/2 - 8 t^2, until t = 1/4
    down, into = State(0.0, 0.75, 0.5, 0.0, -1.0), State(0.0, 0.25, 0.5, 0.0, -1.0)
    aslant = State(1024.0, 3.0, 1.0, 0.0, 1.0)  # to (3, 4)
    hits: tuple[tuple[Scene, State, tuple[tuple[int, float], ...]], ...] = (
        (BOX, wall_to_wall, ((1, 1.0), (4, 7.0))),
        (CIRCLE, ray, ((1, 0.5), (2, 1.5), (5, 4.5))),
        (STATIC, down, ((1, 0.5),)),
        (STATIC, into, ((1, 1.5),)),
        (LIFT, lifted, ((1, 0.25),)),
        (Cap(r=5.0), aslant, ((1, 1027.0),)),
    )
    for of, start, ends in hits:
        for n, t in ends:
            # Of a tie deep in a path no enclosure can tell.
            for t_end in (t, nextafter(t, 0.0), nextafter(t, inf))[n > 1 :]:
                side = "at t_end" if t_end == t else "just after t_end" if t_end < t else "just before t_end"
                rule = f"a hit {side}: it counts if it comes before"
                asked = Question(
                    "at-the-horizon", rule, "protocol 1", wire_form(of), start, t_end, longest=inf
                )
                yield asked if n == 1 else asked._replace(collisions=n)
                yield asked._replace(collisions=n + 1, flow=any_marks)
