"""Plain steppers that are wrong where chance seldom looks: each was once accepted.

What each gets wrong is drawn on purpose by a family of questions, of steps as of trajectories and flows: one
that follows these by an engine of its own may be right in steps. Each is a method of the plain stepper
overridden by a function, as `conformance.mutants` are; some are mutants of another size.
"""

import json
from collections.abc import Callable
from math import hypot
from typing import Any

import msgspec

from conformance import vectors
from conformance.cases.scenes import walls_speed
from conformance.mutants import MUTANTS, Mutant
from conformance.mutants.laws import single
from conformance.mutants.mutant import make_mutant
from conformance.mutants.roots import TieBlind
from conformance.mutants.walls import UPRIGHT
from conformance.plain.step import MAX_COLLISIONS, BangBangMotion, ConstantMotion, Flight, PlainPath
from scene import BangBang, Fourier, Mushroom, Rejected, from_data
from scene.tables import laws

# The fault, and the row of the table of families whose questions it answers wrong; none for a run's first.
FAULTS: dict[str, tuple[Mutant, str]] = {
    "2 m' v_y forgotten": (MUTANTS["curvature-of-tilt-without-flight"], "bend-slope-rate-fourier"),
    "2 nu' r' forgotten": (MUTANTS["curvature-of-side-without-product"], "bend-nu-rate-bang-bang"),
    "amplitudes added up": (MUTANTS["sizes-judged-by-their-amplitudes"], "deep-waves"),
    "150 periods at most": (MUTANTS["gives-up-after-ten-periods"].of_size(150), "vibrating-stem"),
}


def fault(name: str, row: str, method: str, kind: type = Flight, size: float | None = None) -> Any:
    """Register a function as what a faulty stepper does in place of a method."""

    def register(change: Callable[..., Any]) -> Callable[..., Any]:
        FAULTS[name] = make_mutant(kind, method, change, size), row
        return change

    return register


@fault("upright below 1e-12", "leaning-right", "__init__", size=1e-12)
@fault("upright below 1e-10", "leaning-left", "__init__", size=1e-10)
@fault("upright below 1e-6", "leaning-left", "__init__", size=1e-6)
def upright(flight, plain, scene, state, t_end, *, size):
    """Takes a side whose constant slope is smaller than some bound for upright."""
    slope = getattr(scene, "slope", 0.0)
    is_small = isinstance(slope, float) and 0.0 < abs(slope) < size
    plain(msgspec.structs.replace(scene, slope=0.0) if is_small else scene, state, t_end)


@fault("room for thirty legs", "many-knots-cap", "__init__", BangBangMotion, 30)
@fault("room for 128 legs", "many-knots-cap", "__init__", BangBangMotion, 128)
def few_legs(motion, plain, law, t, *, size):
    """Joins all later legs to one."""
    is_long = len(law.knots) > size + 1
    plain(BangBang(knots=(*law.knots[:size], law.knots[-1])) if is_long else law, t)


@fault("distance from its wall kept", "returning-stem-left", "root_between")
def distance_kept(flight, plain, wall, a, b):
    """Leaves a wall as it should, but meets it again where f with f(0) vanishes."""
    root = plain(wall, a, b)
    return root - flight.gap(wall, 0.0).start / flight.f(wall, root)[1] if wall == flight.wall else root


@fault("nu r'' forgotten", "bend-nu-r-bend-fourier", "bend")
def growing_with_the_cap(flight, plain, wall):
    """Leaves nu r'' out of the bound on f'' of a side, where nu is at rest too."""
    if wall not in UPRIGHT or "nu" not in flight.bounds:
        return plain(wall)
    return plain(wall) - flight.bounds["nu"].highest * flight.bounds["r"].curvature


@fault("sides rest with nu", "returning-mushroom-left", "first_root")
def resting_with_nu(flight, plain, wall, start, end):
    """Never meets again a side that it leaves where nu and slope are at rest, whatever the cap does."""
    own = [flight.bounds[name].slope for name in ("nu", "slope") if name in flight.bounds]
    is_left = wall == flight.wall and wall in UPRIGHT
    return None if is_left and own == [0.0, 0.0] else plain(wall, start, end)


@fault("hits within 1e-12 skipped", "returning-cap-arc", "first_root", TieBlind)
def within_epsilon(flight, plain, wall, start, end):
    """Takes what it meets of the wall that it left within 1e-12, of any unit, for the hit before."""
    root = plain(wall, start, end)
    return None if root is not None and root < 1e-12 and wall == flight.wall else root


@fault("walls stand for who is fast", "hurried", "first_root")
def past_standing_walls(flight, plain, wall, start, end):
    """Looks for the hit of a particle 2^20 times as fast as walls as if these stood still."""
    moving = flight.laws
    if 0.0 < 2.0**20 * walls_speed(flight.scene) < hypot(flight.vx, flight.vy):
        flight.laws = {name: ConstantMotion(law.at(0.0).value, 0.0) for name, law in moving.items()}
    found = plain(wall, start, end)
    flight.laws = moving
    return found


@fault("only on its wall", "returning-mushroom-arc", "refusal")
def only_on_its_wall(flight, plain):
    """Refuses a start that is farther from its wall than rounding of the place."""
    is_off = flight.wall and abs(flight.gap(flight.wall, 0.0).start) > 1e-9 * (flight.x**2 + flight.y**2)
    return Rejected("off its wall") if is_off else plain()


@fault("no base in the mouth", "from-the-base", "refusal")
def no_base_in_the_mouth(flight, plain):
    """Refuses a state that names the base in the open mouth, where the mouth may have been narrower."""
    is_open = isinstance(flight.scene, Mushroom) and abs(flight.x) < flight.width(0.0).value
    return Rejected("no base") if is_open and flight.wall == "base" else plain()


@fault("omega of the first", "anywhere-mushroom-floor", "law")
def omega_of_the_first(flight, plain, law):
    """Takes omega of the first wave of a scene for all: one that stands still may have any."""
    waves = [other for other in laws(flight.scene).values() if isinstance(other, Fourier)]
    if isinstance(law, Fourier):
        law = msgspec.structs.replace(law, omega=waves[0].omega, period=waves[0].period)
    return plain(law)


@fault("waves from the first knot", "anywhere-mushroom-arc", "law")
def waves_from_the_first_knot(flight, plain, law):
    """Counts the time of every law from the first knot of any."""
    if not isinstance(law, Fourier):
        return plain(law)
    knots = [other.knots for other in laws(flight.scene).values() if isinstance(other, BangBang)]
    return flight.kinds[Fourier](law, flight.state.t - (knots[0][0][0] if knots else 0.0))


@fault("late phase in float32", "returning-stem-left", "law")
def late_phase_in_float32(flight, plain, law):
    """Keeps the time of departure in binary32 from a hundred thousand on."""
    t = flight.state.t
    return flight.kinds[type(law)](law, single(t) if abs(t) > 1e5 else t)


@fault("looks by the period", "brief-cap-arc", "first_root", TieBlind)
def looks_by_the_period(flight, plain, wall, start, end):
    """Looks at f 64 times in a period for a change of sign, and in a flight."""
    look = min((flight.scene.period or 1.0) / 64, (end - start) / 64)
    a = start
    while a < end:
        b = min(a + look, end)
        if flight.f(wall, b)[0] <= 0:
            return flight.root_between(wall, a, b)
        a = b if b > a else end
    return None


@fault("captured cannot leave", "changed-mouth-right", "is_mouth_open")
def captured_cannot_leave(flight, plain, s):
    """Keeps a particle in the cap that leaves the arc on a chord which the mouth does not reach yet."""
    reach = flight.width(0.0).value * hypot(flight.vx, flight.vy)
    spin = abs(flight.x * flight.vy - flight.y * flight.vx)
    return not (flight.state.wall == "arc" and spin > reach) and plain(s)


def family_of_laws(scene):
    """Return what a law is in a scene, and its numbers in proportion: the same in all its images."""
    return json.dumps([sorted(laws(scene)), *(_proportions(law) for law in laws(scene).values())])


def _proportions(law):
    if isinstance(law, BangBang):
        return sorted({f"{v / (law.knots[0][1] or 1.0):.6g}" for _, v in law.knots})
    if isinstance(law, Fourier):
        return [f"{a / (law.mean or 1.0):.6g}" for a in (*law.cos, *law.sin)]
    return "constant"


KNOWN = {
    family_of_laws(from_data(v.scene)) for v in vectors.load("stress") if v.expect[0].outcome != "rejected"
}


def is_shallow(flight, wall):
    """Tell whether a stem is ten times as wide as it is deep, where one of its walls is met."""
    widths = [flight.bounds[name].lowest for name in ("w", "r") if name in flight.bounds]
    return wall in ("left", "right", "floor") and 10 * flight.bounds["h"].highest < min(widths)


def hardly_moves(flight, wall):
    """Tell whether the arc is met that moves by less than a hundredth of its radius."""
    r = flight.bounds.get("r")
    return wall == "arc" and 0 < r.highest - r.lowest < r.lowest / 100


def is_straight(flight, wall):
    """Tell whether the arc is met on a line through the centre."""
    return wall == "arc" and flight.x * flight.vy == flight.y * flight.vx


def is_early(flight, _):
    """Tell whether a flight begins before time 0, between waves."""
    return flight.state.t < 0 and Fourier in map(type, laws(flight.scene).values())


def is_unknown(flight, _):
    """Tell whether no file holds the scene."""
    return family_of_laws(flight.scene) not in KNOWN


def faster_where(condition):
    """Return a bounce that gives a speed off by a thousandth, where a condition on flight and wall holds."""

    def bounce(flight, plain, wall, s):
        vx, vy = plain(wall, s)
        return (1.001 * vx, 1.001 * vy) if condition(flight, wall) else (vx, vy)

    return bounce


fault("where the stem is shallow", "anywhere-stem-floor", "bounce")(faster_where(is_shallow))
fault("where the arc hardly moves", "anywhere-cap-arc", "bounce")(faster_where(hardly_moves))
fault("straight at the centre", "anywhere-mushroom-arc", "bounce")(faster_where(is_straight))
fault("before time 0, in waves", "anywhere-stem-left", "bounce")(faster_where(is_early))
fault("right in known scenes", "steep", "bounce")(faster_where(is_unknown))


def faster_later(path, hit, is_followed):
    """Gain a thousandth of the speed at the second hit where a path is followed so and its scene unknown."""
    is_wrong = path.n_hits == 2 and is_followed and family_of_laws(path.scene) not in KNOWN
    return msgspec.structs.replace(hit, vx=1.001 * hit.vx, vy=1.001 * hit.vy) if is_wrong else hit


@fault("later hits in known scenes", "", "report", PlainPath)
def faster_later_in_trajectories(path, plain, hit):
    """Is right in known scenes, and in steps."""
    return faster_later(path, plain(hit), path.most == MAX_COLLISIONS)


@fault("flows in known scenes", "", "report", PlainPath)
def faster_later_in_flows(path, plain, hit):
    """Is right in known scenes, and in steps and trajectories."""
    return faster_later(path, plain(hit), path.most != MAX_COLLISIONS)
