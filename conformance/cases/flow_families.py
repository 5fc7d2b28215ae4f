"""The families of flows and of long paths: what happens up to t_end, and the captured stays on the way.

A flow tells its end and its first captured stay only, so an error anywhere on the way shows there or not at
all: these families end where the condition number still lets it show. Long paths need motion that
does not forget its start exponentially fast: a fixed cap or mushroom, a breathing circle, a particle
captured in a moving mushroom, a stem with level floor, all much faster than the walls.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from conformance.cases.draws import (
    Draw,
    SharedPeriod,
    clock,
    law,
    scene,
    state,
    time,
    walls_speed,
    wire_form,
)
from conformance.cases.families import CATALOGUE, FIXED, MOVING, VectorFamily
from conformance.cases.question import Question
from conformance.cases.stays import Mark, stays
from scene import Mushroom, Scene, State, Stem, load
from scene.geometry import rounded
from scene.laws import bounds

Marks = Sequence[Mark]
MOST = 40  # collisions of a drawn flow
MANY = 64  # of a flow with several stays
# See `VectorFamily.first_attempts`.
STAYS_AT = (23, 75, 509, 399, 88, 82, 182, 134, 132, 3, 297, 157)
AT_THE_END_AT = (17, 0, 0, 2, 13, 0, 0, 5, 7, 8)
LONGEST_AT = (0, 0, 1, 0, 2)
LONG_AT = (2, 1, 2, 0, 5, 1, 2, 3, 0, 1, 1, 0, 0, 2, 1, 2)
INTERRUPTED_AT = (45, 91, 9, 65, 5, 125, 8, 132)
REGULAR = ("breathing-circle", "frozen-mushroom", "moving-cap", "fixed-cap-clockwise", "fermi-ulam")
MUSHROOMS = (*MOVING, *FIXED, "frozen-mushroom")


def flow_families() -> list[VectorFamily]:
    """List the families of flows and of long paths, in the corpus's order."""
    return [
        VectorFamily("flow", 50, _catalogue),
        VectorFamily("flow-generated", 40, _generated),
        VectorFamily("flow-tilted", 24, _tilted),
        VectorFamily("flow-bang-bang", 16, _bang_bang),
        VectorFamily("flow-starts-captured", 16, _starts_captured),
        VectorFamily("flow-stays", 12, _several_stays, None, STAYS_AT),
        VectorFamily("flow-stay-interrupted", 8, _interrupted, None, INTERRUPTED_AT),
        VectorFamily("flow-stay-at-the-end", 10, _stay_at_the_end, None, AT_THE_END_AT),
        VectorFamily("flow-brief", 10, _brief),
        VectorFamily("long-flow", 16, _long, None, LONG_AT),
        VectorFamily("longest-flow", 5, _longest, None, LONGEST_AT),
        VectorFamily("long-trajectory", 5, _long_trajectory),
    ]


def any_marks(found: Marks) -> bool:
    """Take every flow."""
    return True


def has_stays(number: int) -> Callable[[Marks], bool]:
    """Look for flows of so many stays, or more."""
    return lambda found: len(stays(found)) >= number


def has_hits(number: int) -> Callable[[Marks], bool]:
    """Look for flows of so many collisions, or more."""
    return lambda found: len(found) >= number


def is_interrupted(found: Marks) -> bool:
    """Look for a stay in which an arc hit is not captured though later ones are."""
    return any("free" in found[begin:end] for begin, end in stays(found))


def is_on_at_the_end(found: Marks) -> bool:
    """Look for a stay that is cut at t_end."""
    return any(end == len(found) for _, end in stays(found))


def _flow(
    group: str,
    rule: str,
    source: str,
    of: Scene,
    start: tuple[State, float],
    looked_for: Callable[[Marks], bool] = any_marks,
    most: int = MOST,
) -> Question:
    return Question(group, rule, source, wire_form(of), *start, most, flow=looked_for)


def _catalogue(draw: Draw) -> Question:
    name = draw.pick((*MUSHROOMS, *MUSHROOMS, "breathing-circle", "fermi-ulam"))
    of = load(name)
    at = {"speed": draw.power(0, 6) * draw.between(1.0, 2.0), "patience": draw.pick((2.0, 4.0, 6.0))}
    return _flow(
        "flow", f"a particle carried through the scene {name}", CATALOGUE[name], of, state(draw, of, at)
    )


def _generated(draw: Draw) -> Question:
    table = draw.pick(("mushroom", "mushroom", "mushroom", "cap", "stem"))
    of = scene(draw, table, clock(draw, ("fourier", "bang-bang", "mixed", "constant")))
    at = {"speed": draw.power(0, 4) * draw.between(1.0, 2.0), "patience": draw.pick((1.0, 2.0, 4.0))}
    rule = f"a particle carried through a generated {table}"
    return _flow("flow-generated", rule, "sec. 2", of, state(draw, of, at))


def tilted(draw: Draw, shared: SharedPeriod) -> Mushroom:
    """Draw a mushroom whose sides are far from upright, and may tilt."""
    r, w, h = law(draw, 1.0, 1.5, shared), law(draw, 0.5, 0.9, shared), law(draw, 0.5, 1.0, shared)
    steepest = 0.9 * bounds(w).lowest / bounds(h).highest
    ranges = ((-0.8, -0.2), (0.15, steepest), (-0.5, steepest))
    low, high = draw.pick(ranges)
    return Mushroom(r=r, w=w, h=h, slope=law(draw, low, high, shared))


def _tilted(draw: Draw) -> Question:
    of = tilted(draw, clock(draw, ("fourier", "bang-bang")))
    at = {"site": draw.pick(("stem", "left", "right", "floor")), "speed": draw.power(0, 4), "patience": 3.0}
    rule = "slanted sides turn a particle on its way"
    return _flow("flow-tilted", rule, "sec. 2", of, state(draw, of, at))


def _bang_bang(draw: Draw) -> Question:
    of = scene(draw, "mushroom", SharedPeriod("bang-bang", draw.pick((0.5, 1.0))))
    at = {"speed": draw.power(-1, 3) * draw.between(1.0, 2.0), "patience": 4.0}
    rule = "several knots of the laws are passed on the way"
    return _flow("flow-bang-bang", rule, "sec. 4.1", of, state(draw, of, at))


def _starts_captured(draw: Draw) -> Question:
    of = load(draw.pick(MUSHROOMS)) if draw.pick((False, True)) else _narrow(draw)
    t = time(draw, of)
    now, speed = rounded(of, t), draw.power(0, 5) * (walls_speed(of) or 1.0)
    start = gallery(draw, of, t, speed)
    patience = draw.pick((0.25, 2.0, 4.0, 6.0))
    rule = "the start is on a captured chord: the stay begins with the first arc hit"
    return _flow("flow-starts-captured", rule, "sec. 3.2", of, (start, t + patience * now.size / speed))


def _narrow(draw: Draw) -> Mushroom:
    """Draw a mushroom with a mouth that is small most of the time."""
    shared = clock(draw, ("fourier", "bang-bang", "mixed"))
    r, h, nu = law(draw, 0.75, 2.0, shared), law(draw, 0.5, 2.0, shared), law(draw, 0.1, 0.7, shared)
    return Mushroom(r=r, h=h, nu=nu, slope=draw.pick((0.0, draw.short(0.0, 0.02))))


def gallery(draw: Draw, of: Scene, t: float, speed: float) -> State:
    """Draw a state inside the cap, that flies along a chord which keeps far from the centre."""
    now = rounded(of, t)
    far = now.r * draw.between(max(0.3, min(1.02 * now.w / now.r, 0.95)), 0.97)
    c, s = draw.direction()
    turn, s = draw.pick((1.0, -1.0)), abs(s)
    along = draw.between(-0.9, 0.9) * (now.r * now.r - far * far) ** 0.5
    if far * s + along * turn * c <= 0:
        along = 0.0
    x, y = far * c - along * turn * s, far * s + along * turn * c
    return State(t, x, y, -turn * speed * s, turn * speed * c)


def _several_stays(draw: Draw) -> Question:
    of = load(draw.pick((*MOVING[:3], *FIXED))) if draw.pick((False, True)) else _narrow(draw)
    at = {"speed": draw.power(1, 4) * draw.between(1.0, 2.0), "patience": draw.pick((6.0, 10.0, 14.0))}
    rule = "several captured stays: the first is told"
    return _flow("flow-stays", rule, "sec. 3.2", of, state(draw, of, at), has_stays(2), MANY)


def _interrupted(draw: Draw) -> Question:
    of = load(draw.pick((*MOVING[:3], *FIXED))) if draw.pick((False, True)) else _narrow(draw)
    at = {"site": "cap", "speed": draw.power(1, 4), "patience": draw.pick((6.0, 10.0, 14.0))}
    rule = "an arc hit that is not captured does not end a stay when a later one is, with no visit below"
    return _flow("flow-stay-interrupted", rule, "sec. 3.2", of, state(draw, of, at), is_interrupted, MANY)


def _stay_at_the_end(draw: Draw) -> Question:
    of = load(draw.pick(MUSHROOMS)) if draw.pick((False, True)) else _narrow(draw)
    at = {"speed": draw.power(0, 5), "patience": draw.pick((3.0, 5.0, 8.0))}
    rule = "a stay that is on at t_end ends there"
    return _flow("flow-stay-at-the-end", rule, "sec. 3.2", of, state(draw, of, at), is_on_at_the_end)


def _brief(draw: Draw) -> Question:
    of = scene(draw, "mushroom", clock(draw))
    at = {"patience": draw.pick((0.0, 2.0**-20, 2.0**-4, 0.25))}
    return _flow("flow-brief", "little or nothing is met before t_end", "protocol 1", of, state(draw, of, at))


def _long(draw: Draw) -> Question:
    """Ask for a path of 60 to 120 collisions."""
    name, least = draw.pick(REGULAR), 60
    of = load(name)
    t = time(draw, of)
    speed = draw.power(6, 8) * draw.between(1.0, 2.0) * (walls_speed(of) or 1.0)
    if name == "fermi-ulam":
        start, _ = state(draw, of, {"t": t, "site": "stem", "speed": speed / walls_speed(of)})
    else:
        start = gallery(draw, of, t, speed)
    t_end = t + 0.5 * least * draw.between(0.6, 1.2) * rounded(of, t).size / speed
    rule = f"a path of {least} collisions and more in the scene {name}: errors that begin late, or grow"
    return _flow("long-flow", rule, CATALOGUE[name], of, (start, t_end), has_hits(least), 2 * least)


def _longest(draw: Draw) -> Question:
    """Ask for a path of 510 collisions and more in an upright stem, where enclosures are not turned."""
    least = 510
    of = load("fermi-ulam")
    if draw.pick((False, True)):
        of = Stem(w=draw.short(0.5, 2.0), h=draw.short(0.5, 2.0))
    at = {"site": "stem", "speed": draw.power(5, 7) * draw.between(1.0, 2.0), "patience": 0.45 * least}
    rule = f"a path of {least} collisions and more in an upright stem: errors that begin late, or grow"
    return _flow("longest-flow", rule, "introduction", of, state(draw, of, at), has_hits(least), 2 * least)


def _long_trajectory(draw: Draw) -> Question:
    asked = _longest(draw)
    rule = "120 collisions in an upright stem: errors that begin late, or grow"
    return asked._replace(group="long-trajectory", rule=rule, collisions=120, flow=None)
