"""Families of flows and of long paths: what happens up to t_end, and the capture intervals on the way.

A flow tells its end and its first capture interval only, so an error anywhere on the way shows there or not
at all: these families end where the condition number still lets it show. Long paths need motion that does
not forget its start exponentially fast: a fixed cap or mushroom, a breathing circle, a particle captured in
a moving mushroom, a stem with level floor, all much faster than the walls.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from conformance.cases.certify import capture_intervals
from conformance.cases.draw import Draw, Family, Mark, Question
from conformance.cases.families import CATALOGUE, FIXED, MOVING_CAPS
from conformance.cases.scenes import MOVING, Clock, clock, law, scene, state, time, walls_speed
from scene import Mushroom, Scene, State, Stem, load
from scene.geometry import rounded
from scene.laws import bounds

Marks = Sequence[Mark]
MOST = 40  # collisions of a drawn flow
MANY = 64  # of a flow with several stays
LONG, LONGEST = 60, 510  # collisions at least
# See `Family.first_attempts`.
STAYS_AT = (23, 75, 509, 399, 88, 82, 182, 134, 132, 3, 297, 157)
AT_THE_END_AT = (17, 0, 0, 2, 13, 0, 0, 5, 7, 8)
LONGEST_AT = (0, 0, 1, 0, 2)
LONG_AT = (2, 1, 2, 0, 5, 1, 2, 3, 0, 1, 1, 0, 0, 2, 1, 2)
INTERRUPTED_AT = (45, 91, 9, 65, 5, 125, 8, 132)
REGULAR = ("breathing-circle", "frozen-mushroom", "moving-cap", "fixed-cap-clockwise", "fermi-ulam")
MUSHROOMS = (*MOVING_CAPS, *FIXED, "frozen-mushroom")


def any_marks(found: Marks) -> bool:
    """Take every flow."""
    return True


def has_stays(number: int) -> Callable[[Marks], bool]:
    """Look for flows of so many stays, or more."""
    return lambda found: len(capture_intervals(found)) >= number


def has_hits(number: int) -> Callable[[Marks], bool]:
    """Look for flows of so many collisions, or more."""
    return lambda found: len(found) >= number


def is_interrupted(found: Marks) -> bool:
    """Look for a stay in which an arc hit is not captured though later ones are."""
    return any("free" in found[begin:end] for begin, end in capture_intervals(found))


def is_on_at_the_end(found: Marks) -> bool:
    """Look for a stay that is cut at t_end."""
    return any(end == len(found) for _, end in capture_intervals(found))


def _flow(draw: Draw, of: Scene, at: dict[str, Any]) -> Question:
    return Question(of, *state(draw, of, at), MOST, any_marks)


def flow(draw: Draw) -> Question:
    """Carry a particle through a scene of the catalogue."""
    name = draw.pick((*MUSHROOMS, *MUSHROOMS, "breathing-circle", "fermi-ulam"))
    at = {"speed": draw.power(0, 6) * draw.between(1.0, 2.0), "patience": draw.pick((2.0, 4.0, 6.0))}
    asked = _flow(draw, load(name), at)
    return asked._replace(rule=f"a particle carried through the scene {name}", source=CATALOGUE[name])


def flow_generated(draw: Draw) -> Question:
    """Carry a particle through a table with laws of any kind."""
    table = draw.pick(("mushroom", "mushroom", "mushroom", "cap", "stem"))
    of = scene(draw, table, clock(draw, ("fourier", "bang-bang", "mixed", "constant")))
    at = {"speed": draw.power(0, 4) * draw.between(1.0, 2.0), "patience": draw.pick((1.0, 2.0, 4.0))}
    return _flow(draw, of, at)._replace(rule=f"a particle carried through a generated {table}")


def tilted(draw: Draw, shared: Clock) -> Mushroom:
    """Draw a mushroom whose sides are far from upright, and may tilt."""
    r, w, h = law(draw, 1.0, 1.5, shared), law(draw, 0.5, 0.9, shared), law(draw, 0.5, 1.0, shared)
    steepest = 0.9 * bounds(w).lowest / bounds(h).highest
    low, high = draw.pick(((-0.8, -0.2), (0.15, steepest), (-0.5, steepest)))
    return Mushroom(r=r, w=w, h=h, slope=law(draw, low, high, shared))


def flow_tilted(draw: Draw) -> Question:
    """Begin in a stem with such sides."""
    of = tilted(draw, clock(draw, MOVING))
    at = {"site": draw.pick(("stem", "left", "right", "floor")), "speed": draw.power(0, 4), "patience": 3.0}
    return _flow(draw, of, at)


def flow_bang_bang(draw: Draw) -> Question:
    """Pass knots on the way."""
    of = scene(draw, "mushroom", Clock("bang-bang", draw.pick((0.5, 1.0))))
    return _flow(draw, of, {"speed": draw.power(-1, 3) * draw.between(1.0, 2.0), "patience": 4.0})


def flow_starts_captured(draw: Draw) -> Question:
    """Begin on a captured chord."""
    of = load(draw.pick(MUSHROOMS)) if draw.pick((False, True)) else _narrow(draw)
    t = time(draw, of)
    now, speed = rounded(of, t), draw.power(0, 5) * (walls_speed(of) or 1.0)
    start = gallery(draw, of, t, speed)
    return Question(of, start, t + draw.pick((0.25, 2.0, 4.0, 6.0)) * now.size / speed, MOST, any_marks)


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


def _stays(at: dict[str, Any], looked_for: Callable[[Marks], bool], draw: Draw) -> Question:
    """Look for capture intervals on a long way through a mushroom."""
    of = load(draw.pick((*MOVING_CAPS[:3], *FIXED))) if draw.pick((False, True)) else _narrow(draw)
    speed = draw.power(1, 4) * (1.0 if "site" in at else draw.between(1.0, 2.0))
    at = {**at, "speed": speed, "patience": draw.pick((6.0, 10.0, 14.0))}
    return _flow(draw, of, at)._replace(collisions=MANY, flow=looked_for)


def flow_stay_at_the_end(draw: Draw) -> Question:
    """Look for one that t_end cuts."""
    of = load(draw.pick(MUSHROOMS)) if draw.pick((False, True)) else _narrow(draw)
    at = {"speed": draw.power(0, 5), "patience": draw.pick((3.0, 5.0, 8.0))}
    return _flow(draw, of, at)._replace(flow=is_on_at_the_end)


def flow_brief(draw: Draw) -> Question:
    """End before much is met."""
    of = scene(draw, "mushroom", clock(draw))
    return _flow(draw, of, {"patience": draw.pick((0.0, 2.0**-20, 2.0**-4, 0.25))})


def long_flow(draw: Draw) -> Question:
    """Ask for a path of 60 to 120 collisions."""
    name = draw.pick(REGULAR)
    of = load(name)
    t = time(draw, of)
    speed = draw.power(6, 8) * draw.between(1.0, 2.0) * (walls_speed(of) or 1.0)
    if name == "fermi-ulam":
        start, _ = state(draw, of, {"t": t, "site": "stem", "speed": speed / walls_speed(of)})
    else:
        start = gallery(draw, of, t, speed)
    t_end = t + 0.5 * LONG * draw.between(0.6, 1.2) * rounded(of, t).size / speed
    rule = f"a path of {LONG} collisions and more in the scene {name}: errors that begin late, or grow"
    return Question(of, start, t_end, 2 * LONG, has_hits(LONG), rule=rule, source=CATALOGUE[name])


def longest_flow(draw: Draw) -> Question:
    """Ask for a path of 510 collisions and more in an upright stem, where enclosures are not turned."""
    of = load("fermi-ulam")
    if draw.pick((False, True)):
        of = Stem(w=draw.short(0.5, 2.0), h=draw.short(0.5, 2.0))
    at = {"site": "stem", "speed": draw.power(5, 7) * draw.between(1.0, 2.0), "patience": 0.45 * LONGEST}
    return Question(of, *state(draw, of, at), 2 * LONGEST, has_hits(LONGEST))


FAMILIES = (
    Family("flow", "a particle carried through a scene of the catalogue", flow, n_vectors=50),
    Family("flow-generated", "a particle carried through a generated table", flow_generated, n_vectors=40),
    Family("flow-tilted", "slanted sides turn a particle on its way", flow_tilted, n_vectors=24),
    Family(
        "flow-bang-bang", "several knots of the laws are passed on the way", flow_bang_bang, "sec. 4.1", 16
    ),
    Family(
        "flow-starts-captured",
        "the start is on a captured chord: the stay begins with the first arc hit",
        flow_starts_captured,
        "sec. 3.2",
        16,
    ),
    Family(
        "flow-stays",
        "several capture intervals: the first is told",
        partial(_stays, {}, has_stays(2)),
        "sec. 3.2",
        12,
        first_attempts=STAYS_AT,
    ),
    Family(
        "flow-stay-interrupted",
        "an arc hit that is not captured does not end a stay when a later one is, with no visit below",
        partial(_stays, {"site": "cap"}, is_interrupted),
        "sec. 3.2",
        8,
        first_attempts=INTERRUPTED_AT,
    ),
    Family(
        "flow-stay-at-the-end",
        "a stay that is on at t_end ends there",
        flow_stay_at_the_end,
        "sec. 3.2",
        10,
        first_attempts=AT_THE_END_AT,
    ),
    Family("flow-brief", "little or nothing is met before t_end", flow_brief, "protocol 1", 10),
    Family("long-flow", "errors that begin late, or grow", long_flow, n_vectors=16, first_attempts=LONG_AT),
    Family(
        "longest-flow",
        f"a path of {LONGEST} collisions and more in an upright stem: errors that begin late, or grow",
        longest_flow,
        "introduction",
        5,
        first_attempts=LONGEST_AT,
    ),
    Family(
        "long-trajectory",
        "120 collisions in an upright stem: errors that begin late, or grow",
        lambda draw: longest_flow(draw)._replace(collisions=120, flow=None),
        "introduction",
        5,
    ),
)
