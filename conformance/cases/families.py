"""The families of drawn vectors: which scenes, which states, and what each family tests.

A family's order and its rule never change once published; a longer count only adds vectors.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import msgspec

from conformance.cases.draws import Draw, SharedPeriod, clock, place, scene, state, time, wire_form
from conformance.cases.question import Question
from scene import Scene, State, from_data, load, to_data
from scene.geometry import rounded

Ask = Callable[[Draw], Question]
MOVING = ("moving-cap", "moving-cap-reversed", "moving-cap-trivial", "ergodic", "untilted")
FIXED = ("fixed-cap-anticlockwise", "fixed-cap-clockwise")
CATALOGUE = {
    "moving-cap": "sec. 4.2",
    "moving-cap-reversed": "sec. 4.2",
    "moving-cap-trivial": "sec. 4.2",
    "ergodic": "sec. 4.2",
    "untilted": "sec. 4.2, discussion",
    "fixed-cap-anticlockwise": "sec. 4.1",
    "fixed-cap-clockwise": "sec. 4.1",
    "frozen-mushroom": "sec. 2",
    "breathing-circle": "sec. 3.1",
    "fermi-ulam": "introduction",
    "retraced-arc": "sec. 5",
}


class VectorFamily(NamedTuple):
    """A group's drawn vectors.

    Attributes:
        group: first part of their ids.
        n_vectors: how many.
        ask: from a stream of numbers to a question.
        wanted: the outcome it must have; None for any answer of a valid question.
        first_attempts: for each number which draw is tried first, 0 by default. What a family looks for may
            be rare: the plain stepper has been asked before, so that few draws are certified in vain.
    """

    group: str
    n_vectors: int
    ask: Ask
    wanted: str | None = None
    first_attempts: tuple[int, ...] = ()


def families() -> list[VectorFamily]:
    """List all families, in the corpus's order."""
    found = []
    for name, source in CATALOGUE.items():
        found.append(VectorFamily(name, 50, partial(_catalogue_step, name, source)))
        n_paths = 16 if name in ("moving-cap", *FIXED) else 11
        found.append(VectorFamily(f"{name}-trajectory", n_paths, partial(_catalogue_path, name, source)))
    for table in ("cap", "stem", "mushroom"):
        found += [
            VectorFamily(f"static-{table}", 20, partial(_generated_step, table, "static", ("constant",))),
            VectorFamily(f"generated-{table}", 90, partial(_generated_step, table, "generated", ())),
            VectorFamily(f"generated-{table}-trajectory", 10, partial(_generated_path, table)),
        ]
    return [
        *found,
        VectorFamily("whispering-gallery", 10, _gallery),
        VectorFamily("stem-trajectory", 10, _stem_path),
        VectorFamily("slow-particle", 60, _slow),
        VectorFamily("fast-wall", 40, _fast_wall),
        VectorFamily("skipping", 60, _skipping),
        VectorFamily("grazing", 60, _grazing),
        VectorFamily("near-corner", 90, _near_corner),
        VectorFamily("through-mouth", 60, _through_mouth),
        VectorFamily("knot-in-flight", 60, _knots),
        VectorFamily("late-start", 50, _late),
        VectorFamily("horizon", 50, _horizon, "horizon"),
        VectorFamily("scales", 50, _scales),
        VectorFamily("refused-state", 30, _outside, "rejected"),
    ]


def _question(
    group: str, rule: str, source: str, of: Scene, start: tuple[State, float], n: int | None = None
) -> Question:
    return Question(group, rule, source, wire_form(of), *start, n)


def _catalogue_step(name: str, source: str, draw: Draw) -> Question:
    of = load(name)
    return _question(name, f"a flight in the scene {name}", source, of, state(draw, of, {}))


def _catalogue_path(name: str, source: str, draw: Draw) -> Question:
    of = load(name)
    at = {"speed": draw.power(-1, 7) * draw.between(1.0, 2.0), "patience": draw.pick((4.0, 400.0))}
    rule = f"successive collisions in the scene {name}"
    return _question(f"{name}-trajectory", rule, source, of, state(draw, of, at), draw.pick((6, 12, 24)))


def _generated_step(table: str, way: str, kinds: tuple[str, ...], draw: Draw) -> Question:
    of = scene(draw, table, clock(draw, kinds) if kinds else clock(draw))
    rule = f"a flight in a {way} {table}"
    return _question(f"{way}-{table}", rule, "sec. 2", of, state(draw, of, {}))


def _generated_path(table: str, draw: Draw) -> Question:
    of = scene(draw, table, clock(draw))
    at = {"speed": draw.power(0, 6), "patience": draw.pick((4.0, 400.0))}
    rule = f"successive collisions in a generated {table}"
    return _question(
        f"generated-{table}-trajectory", rule, "sec. 2", of, state(draw, of, at), draw.pick((6, 12, 20))
    )


def _gallery(draw: Draw) -> Question:
    of = load(draw.pick(("breathing-circle", "moving-cap", "frozen-mushroom")))
    at = {"site": "arc", "speed": draw.power(3, 6), "lift": draw.power(-6, -2), "patience": 400.0}
    rule = "a whispering gallery: angular momentum is kept while r moves"
    return _question("whispering-gallery", rule, "sec. 3.1; hard cases 2, 3", of, state(draw, of, at), 30)


def _stem_path(draw: Draw) -> Question:
    of = scene(draw, "stem", clock(draw, ("fourier", "bang-bang")))
    at = {"speed": draw.power(2, 6), "patience": 400.0}
    return _question("stem-trajectory", "many collisions in a stem", "sec. 2", of, state(draw, of, at), 30)


def _slow(draw: Draw) -> Question:
    of = scene(draw, draw.pick(("cap", "stem", "mushroom")), clock(draw, ("fourier", "bang-bang")))
    at = {"speed": draw.power(-12, -1), "patience": draw.pick((0.25, 4.0))}
    start, t_end = state(draw, of, at)
    rule = "a particle slower than the walls"
    return _question("slow-particle", rule, "hard cases 8 to 15", of, (start, min(t_end, start.t + 16)))


def _fast_wall(draw: Draw) -> Question:
    of = load(draw.pick((*MOVING, *FIXED, "breathing-circle", "fermi-ulam")))
    start, t_end = state(draw, of, {"speed": draw.power(-10, 0), "patience": 2.0})
    rule = "a wall that overtakes or recedes: gate on f', not on v"
    return _question("fast-wall", rule, "hard cases 8, 11", of, (start, min(t_end, start.t + 16)))


def _skipping(draw: Draw) -> Question:
    of = scene(draw, draw.pick(("cap", "stem", "mushroom")), clock(draw, ("fourier", "bang-bang")))
    at = {"site": draw.pick([w for w in of.walls if w != "base"]), "lift": draw.power(-40, -3)}
    start, t_end = state(draw, of, at)
    rule = "a wall is left at a grazing angle, relative to the wall: the next hit may be very near"
    return _question("skipping", rule, "hard cases 2, 3, 9, 10", of, (start, min(t_end, start.t + 16)))


def _grazing(draw: Draw) -> Question:
    of = scene(draw, draw.pick(("cap", "mushroom")), clock(draw))
    t = time(draw, of)
    r, (c, s) = rounded(of, t).r, draw.direction()
    rho = r * (1 - draw.power(-50, -6))
    speed, turn = draw.power(0, 10), draw.pick((1.0, -1.0))
    start = State(t, rho * c, rho * abs(s), -turn * speed * abs(s), turn * speed * c)
    rule = "a chord close to the arc"
    return _question("grazing", rule, "hard case 1", of, (start, t + 8 * r / speed + 1.0))


def _near_corner(draw: Draw) -> Question:
    of = scene(draw, draw.pick(("cap", "stem", "mushroom")), clock(draw))
    t = time(draw, of)
    now, speed = rounded(of, t), draw.power(0, 8)
    site = draw.pick(_regions(of))
    x, y = place(draw, now, site)
    flight = now.size / speed * draw.between(0.25, 1.0)
    there = rounded(of, t + flight)
    corner = draw.pick(there.corners(site))
    off = there.size * draw.power(-50, -8)
    c, s = draw.direction()
    vx, vy = (corner[0] + off * c - x) / flight, (corner[1] + off * s - y) / flight
    start = State(t, x, y, vx, vy)
    rule = "a hit beside a corner or the mouth's edge"
    return _question("near-corner", rule, "hard cases 23, 30", of, (start, t + 4 * flight))


def _regions(of: Scene) -> tuple[str, ...]:
    return {"Cap": ("cap",), "Stem": ("stem",), "Mushroom": ("cap", "stem")}[type(of).__name__]


def _through_mouth(draw: Draw) -> Question:
    if draw.pick((False, True)):
        of = load(draw.pick((*MOVING, *FIXED)))
    else:
        of = scene(draw, "mushroom", clock(draw))
    t = time(draw, of)
    now, speed = rounded(of, t), draw.power(0, 7)
    x, y = place(draw, now, draw.pick(("cap", "stem")))
    flight = now.size / speed * draw.between(0.25, 1.0)
    aim = draw.between(-1.2, 1.2) * rounded(of, t + flight).w
    start = State(t, x, y, (aim - x) / flight, -y / flight)
    rule = "the width of the mouth when it is reached decides"
    return _question("through-mouth", rule, "sec. 2; hard cases 24, 26", of, (start, t + 8 * flight))


def _knots(draw: Draw) -> Question:
    if draw.pick((False, True)):
        of = load(draw.pick(FIXED))
    else:
        of = scene(draw, draw.pick(("stem", "mushroom")), SharedPeriod("bang-bang", draw.pick((0.5, 1.0))))
    start, t_end = state(draw, of, {"speed": draw.power(-4, 1), "patience": 8.0})
    rule = "a law changes its piece during the flight"
    return _question("knot-in-flight", rule, "sec. 4.1; hard case 36", of, (start, min(t_end, start.t + 16)))


def _late(draw: Draw) -> Question:
    if draw.pick((False, True)):
        of, most = scene(draw, draw.pick(("cap", "stem", "mushroom")), SharedPeriod("constant", 1.0)), 44
    else:
        of, most = load(draw.pick((*MOVING, *FIXED, "breathing-circle", "fermi-ulam"))), 20
    t = draw.power(8, most) * draw.between(1.0, 2.0)
    rule = "a late start: dt keeps its precision"
    return _question("late-start", rule, "hard cases 38, 39", of, state(draw, of, {"t": t}))


def _horizon(draw: Draw) -> Question:
    if draw.pick((False, True)):
        of = load(draw.pick((*MOVING, *FIXED, "breathing-circle", "fermi-ulam")))
    else:
        of = scene(draw, draw.pick(("cap", "stem", "mushroom")), clock(draw))
    at = {"patience": draw.pick((0.0, 2.0**-20, 2.0**-4, 2.0**-4, 0.125))}
    return _question("horizon", "nothing is met before t_end", "protocol 1", of, state(draw, of, at))


def _scales(draw: Draw) -> Question:
    of = scene(draw, draw.pick(("cap", "stem", "mushroom")), SharedPeriod("constant", 1.0))
    start, t_end = state(draw, of, {"t": 0.0})
    k = draw.pick(range(-60, 61))
    laws = to_data(of)
    length = 2.0**k
    for name in ("r", "w", "h"):
        if name in laws:
            laws[name] *= length
    grown = State(0.0, start.x * length, start.y * length, start.vx, start.vy, start.wall)
    rule = "tables of any size: no absolute tolerance"
    return _question("scales", rule, "hard cases 16, 40", from_data(laws), (grown, t_end * length))


def _outside(draw: Draw) -> Question:
    of = scene(draw, draw.pick(("cap", "stem", "mushroom")), clock(draw))
    start, t_end = state(draw, of, {"site": draw.pick(_regions(of))})
    far = draw.pick((1.5, 4.0, 1e6)) * rounded(of, start.t).size
    c, s = draw.direction()
    out = msgspec.structs.replace(start, x=start.x + far * c, y=start.y + far * s)
    return _question("refused-state", "a state outside the table", "hard case 45", of, (out, t_end))
