"""Flights of the plain stepper that are wrong where chance seldom looks: each was once accepted.

What each gets wrong is drawn on purpose by a family of questions, of steps as of trajectories and flows: who
follows these by an engine of its own may be right in steps.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from math import hypot, inf
from typing import ClassVar

import msgspec

from conformance import vectors
from conformance.cases.scenes import walls_speed
from conformance.mutants.laws import single
from conformance.plain.motion import BangBangMotion, ConstantMotion
from conformance.plain.step import Flight, Open
from scene import (
    BangBang,
    Collision,
    Fourier,
    Horizon,
    Mushroom,
    Outcome,
    Rejected,
    Scene,
    State,
    Wall,
    from_data,
)
from scene.tables import cycle_length, laws


def upright_below(least: float) -> type[Flight]:
    """Return a flight that takes a side whose constant slope is smaller than some bound for upright."""

    class UprightBelow(Flight):
        def __init__(self, scene: Scene, state: State, t_end: float) -> None:
            slope = getattr(scene, "slope", 0.0)
            if isinstance(slope, float) and abs(slope) < least and slope:
                scene = msgspec.structs.replace(scene, slope=0.0)
            super().__init__(scene, state, t_end)

    return UprightBelow


class RoomForLegs(BangBangMotion):
    """Joins all legs behind the 128th to one."""

    def __init__(self, law: BangBang, t: float) -> None:
        most = law.knots if len(law.knots) <= 129 else (*law.knots[:128], law.knots[-1])
        super().__init__(BangBang(knots=most), t)


class RoomFor128Legs(Flight):
    """Flies between walls with room for 128 legs."""

    kinds: ClassVar = {**Flight.kinds, BangBang: RoomForLegs}


class DistanceKept(Flight):
    """Leaves a wall as it should, but meets it again where f with f(0) vanishes."""

    def root_between(self, wall: Wall, a: float, b: float) -> float:
        root = super().root_between(wall, a, b)
        return root - self.gap(wall, 0.0).start / self.f(wall, root)[1] if wall == self.wall else root


def bent(forgotten: Callable[[Flight], float]) -> type[Flight]:
    """Return a flight whose bound on f'' of a side leaves something out."""

    class Bent(Flight):
        def bend(self, wall: Wall) -> float:
            return super().bend(wall) - (forgotten(self) if wall in ("left", "right") else 0.0)

    return Bent


def tilting_on_the_way(flight: Flight) -> float:
    """Return the bound on 2 m' v_y, of a side that tilts while a particle passes along it."""
    return 2 * flight.bounds["slope"].slope * abs(flight.vy)


def opening_with_the_cap(flight: Flight) -> float:
    """Return the bound on 2 nu' r', of a mouth that opens while its cap grows."""
    known = flight.bounds
    return 2 * known["nu"].slope * known["r"].slope if "nu" in known else 0.0


class AmplitudesAdded(Flight):
    """Refuses a size whose amplitudes add up to its mean or more, in scenes that no file holds."""

    def refusal(self) -> Outcome | None:
        for name, law in laws(self.scene).items():
            if (
                name != "slope"
                and isinstance(law, Fourier)
                and sum(map(abs, (*law.cos, *law.sin))) >= law.mean
            ):
                return Rejected(f"{name} may vanish")
        return super().refusal()


def growing_with_the_cap(flight: Flight) -> float:
    """Return the bound on nu r'', of a mouth whose nu is at rest too."""
    known = flight.bounds
    return known["nu"].highest * known["r"].curvature if "nu" in known else 0.0


class RestingWithNu(Flight):
    """Never meets again a side that it leaves where nu and slope are at rest, whatever the cap does."""

    def first_root(self, wall: Wall, start: float, end: float) -> float | None:
        own = [self.bounds[name].slope for name in ("nu", "slope") if name in self.bounds]
        if wall == self.wall and wall in ("left", "right") and own == [0.0, 0.0]:
            return None
        return super().first_root(wall, start, end)


class PatientForPeriods(Flight):
    """Takes a particle that meets nothing for 150 periods for one that meets nothing."""

    def outcome(self) -> Outcome:
        found = super().outcome()
        if not isinstance(found, Collision) or found.dt < 150 * (cycle_length(self.scene) or inf):
            return found
        return Horizon(self.t_end, *self.place(self.t_end - self.state.t), self.vx, self.vy)


class WithinEpsilon(Flight):
    """Takes what it meets of the wall that it left within 1e-12, of any unit, for the hit before."""

    def require_clear(self, walls: object, s: float) -> None:
        return None

    def first_root(self, wall: Wall, start: float, end: float) -> float | None:
        root = super().first_root(wall, start, end)
        return None if root is not None and root < 1e-12 and wall == self.wall else root


class FastPastStandingWalls(Flight):
    """Looks for the hit of a particle 2^20 times as fast as walls as if these stood still."""

    def first_root(self, wall: Wall, start: float, end: float) -> float | None:
        moving = self.laws
        if 0.0 < 2.0**20 * walls_speed(self.scene) < hypot(self.vx, self.vy):
            self.laws = {name: ConstantMotion(law.at(0.0).value, 0.0) for name, law in moving.items()}
        found = super().first_root(wall, start, end)
        self.laws = moving
        return found


# The faulty flight, and the row of the table of families whose questions it answers wrong.
SELDOM_WRONG: dict[str, tuple[type[Flight], str]] = {
    "upright below 1e-6": (upright_below(1e-6), "leaning-left"),
    "upright below 1e-10": (upright_below(1e-10), "leaning-left"),
    "upright below 1e-12": (upright_below(1e-12), "leaning-right"),
    "room for 128 legs": (RoomFor128Legs, "many-knots-cap"),
    "distance from its wall kept": (DistanceKept, "returning-stem-left"),
    "2 m' v_y forgotten": (bent(tilting_on_the_way), "bend-slope-rate-fourier"),
    "2 nu' r' forgotten": (bent(opening_with_the_cap), "bend-nu-rate-bang-bang"),
    "amplitudes added up": (AmplitudesAdded, "deep-waves"),
    "sides rest with nu": (RestingWithNu, "returning-mushroom-left"),
    "nu r'' forgotten": (bent(growing_with_the_cap), "bend-nu-r-bend-fourier"),
    "150 periods at most": (PatientForPeriods, "vibrating-stem"),
    "hits within 1e-12 skipped": (WithinEpsilon, "returning-cap-arc"),
    "walls stand for who is fast": (FastPastStandingWalls, "hurried"),
}


class RoomForThirtyLegs(BangBangMotion):
    """Joins all later legs to one."""

    def __init__(self, law, t):
        most = law.knots if len(law.knots) <= 31 else (*law.knots[:30], law.knots[-1])
        super().__init__(BangBang(knots=most), t)


class ManyLegs(Flight):
    """A flight between walls with room for thirty legs."""

    kinds: ClassVar = {**Flight.kinds, BangBang: RoomForThirtyLegs}


class OnlyOnItsWall(Flight):
    """Refuses a start that is farther from its wall than rounding of the place."""

    def refusal(self):
        is_off = self.wall and abs(self.gap(self.wall, 0.0).start) > 1e-9 * (self.x**2 + self.y**2)
        return Rejected("off its wall") if is_off else super().refusal()


class Keeping(Flight):
    """Keeps the table by its name, or by all but one of its laws."""

    kept: ClassVar[dict[str, object]] = {}

    def __init__(self, scene, state, t_end):
        super().__init__(self.kept.setdefault(self.key(scene), scene), state, t_end)


class KeptByName(Keeping):
    """Takes two scenes of one name for the same."""

    def key(self, scene):
        return scene.name or repr(scene)


class KeptWithoutDepth(Keeping):
    """Forgets the depth of the stem and its slope in the key of a table."""

    def key(self, scene):
        forgotten = {name: value for name, value in (("h", 1.0), ("slope", 0.0)) if name in laws(scene)}
        return repr(msgspec.structs.replace(scene, name="", **forgotten))


def wrong_where(condition):
    """Return a flight that gives a speed off by a thousandth, where a condition on flight and wall holds."""

    class WrongThere(Flight):
        def bounce(self, wall, s):
            vx, vy = super().bounce(wall, s)
            return (1.001 * vx, 1.001 * vy) if condition(self, wall) else (vx, vy)

    return WrongThere


def family_of_laws(scene):
    """Return what a law is in a scene, and its numbers in proportion: the same in all its disguises."""
    return json.dumps([sorted(laws(scene)), *(_proportions(law) for law in laws(scene).values())])


def _proportions(law):
    if isinstance(law, BangBang):
        return sorted({f"{v / (law.knots[0][1] or 1.0):.6g}" for _, v in law.knots})
    return (
        [f"{a / (law.mean or 1.0):.6g}" for a in (*law.cos, *law.sin)]
        if isinstance(law, Fourier)
        else "constant"
    )


KNOWN = {
    family_of_laws(from_data(v.scene)) for v in vectors.load("stress") if v.expect[0].outcome != "rejected"
}


class OmegaOfTheFirst(Flight):
    """Takes omega of the first wave of a scene for all: one that stands still may have any."""

    def law(self, law):
        if isinstance(law, Fourier):
            first = next(other for other in laws(self.scene).values() if isinstance(other, Fourier))
            law = msgspec.structs.replace(law, omega=first.omega, period=first.period)
        return super().law(law)


class NoBaseInTheMouth(Flight):
    """Refuses a state that names the base in the open mouth, where the mouth may have been narrower."""

    def refusal(self):
        is_open = isinstance(self.scene, Mushroom) and abs(self.x) < self.width(0.0).value
        return Rejected("no base") if is_open and self.wall == "base" else super().refusal()


class LooksByThePeriod(Flight):
    """Looks at f 64 times in a period for a change of sign, and in a flight."""

    def first_root(self, wall, start, end):
        look = min((cycle_length(self.scene) or 1.0) / 64, (end - start) / 64)
        a = start
        while a < end:
            b = min(a + look, end)
            if self.f(wall, b)[0] <= 0:
                return self.root_between(wall, a, b)
            if b == a:
                raise Open("a look of no length")
            a = b
        return None

    def require_clear(self, walls, s):
        """Goes on, outside a wall that it has missed."""


class CapturedCannotLeave(Flight):
    """Keeps a particle in the cap that leaves the arc on a chord which the mouth does not reach yet."""

    def is_mouth_open(self, s):
        reach = self.width(0.0).value * hypot(self.vx, self.vy)
        is_captured = self.state.wall == "arc" and abs(self.x * self.vy - self.y * self.vx) > reach
        return not is_captured and super().is_mouth_open(s)


class LatePhaseInFloat32(Flight):
    """Keeps the time of departure in binary32 from a hundred thousand on."""

    def law(self, law):
        t = self.state.t
        return self.kinds[type(law)](law, single(t) if abs(t) > 1e5 else t)


def is_shallow(flight, wall):
    """Tell whether a stem is ten times as wide as it is deep, where one of its walls is met."""
    widths = [flight.bounds[name].lowest for name in ("w", "r") if name in flight.bounds]
    return wall in ("left", "right", "floor") and 10 * flight.bounds["h"].highest < min(widths)


def hardly_moves(flight, wall):
    """Tell whether the arc is met that moves by less than a hundredth of its radius."""
    r = flight.bounds.get("r")
    return wall == "arc" and 0 < r.highest - r.lowest < r.lowest / 100


STRAIGHT = wrong_where(lambda flight, wall: wall == "arc" and flight.x * flight.vy == flight.y * flight.vx)
UNKNOWN = wrong_where(lambda flight, _: family_of_laws(flight.scene) not in KNOWN)
EARLY = wrong_where(
    lambda flight, _: flight.state.t < 0 and Fourier in map(type, laws(flight.scene).values())
)
# The faulty flight, and the row of the table whose questions it answers wrong; none for a run's first.
FAULTY = {
    "omega of the first": (OmegaOfTheFirst, "anywhere-mushroom-floor"),
    "no base in the mouth": (NoBaseInTheMouth, "from-the-base"),
    "where the stem is shallow": (wrong_where(is_shallow), "anywhere-stem-floor"),
    "where the arc hardly moves": (wrong_where(hardly_moves), "anywhere-cap-arc"),
    "straight at the centre": (STRAIGHT, "anywhere-mushroom-arc"),
    "right in known scenes": (UNKNOWN, "steep"),
    "before time 0, in waves": (EARLY, "anywhere-stem-left"),
    "room for thirty legs": (ManyLegs, "many-knots-cap"),
    "only on its wall": (OnlyOnItsWall, "returning-mushroom-arc"),
    "kept by name": (KeptByName, ""),
    "kept without depth": (KeptWithoutDepth, ""),
    "looks by the period": (LooksByThePeriod, "brief-cap-arc"),
    "captured cannot leave": (CapturedCannotLeave, "changed-mouth-right"),
    "late phase in float32": (LatePhaseInFloat32, "returning-stem-left"),
}
