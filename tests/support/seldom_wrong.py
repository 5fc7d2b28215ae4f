"""Flights of the plain stepper that are wrong where chance seldom looks: each was once accepted.

What each gets wrong is drawn on purpose by `conformance.cases.seldom` and `in_flight.swept_scene`, and
most of it of trajectories and flows as well: who follows these by an engine of its own may be right in steps.
"""

from __future__ import annotations

from collections.abc import Callable
from math import hypot, inf
from typing import ClassVar

import msgspec

from conformance.cases.draws import walls_speed
from conformance.plain.motion import BangBangMotion, ConstantMotion
from conformance.plain.step import Flight
from scene import BangBang, Collision, Fourier, Horizon, Outcome, Rejected, Scene, State, Wall
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


# The faulty flight, and numbers of fresh questions among which some are met by it.
SELDOM_WRONG: dict[str, tuple[type[Flight], tuple[int, ...]]] = {
    "upright below 1e-6": (upright_below(1e-6), (2, 20)),
    "upright below 1e-10": (upright_below(1e-10), (2, 68)),
    "upright below 1e-12": (upright_below(1e-12), (2,)),
    "room for 128 legs": (RoomFor128Legs, (38, 98)),
    "distance from its wall kept": (DistanceKept, (11, 35, 71, 119)),
    "2 m' v_y forgotten": (bent(tilting_on_the_way), (53, 101)),
    "2 nu' r' forgotten": (bent(opening_with_the_cap), (29, 77)),
    "amplitudes added up": (AmplitudesAdded, (1, 13, 19)),
    "sides rest with nu": (RestingWithNu, (11, 95)),
    "nu r'' forgotten": (bent(growing_with_the_cap), (11, 95)),
    "150 periods at most": (PatientForPeriods, (153, 154)),
    "hits within 1e-12 skipped": (WithinEpsilon, (11, 35, 47, 71, 119)),
    "walls stand for who is fast": (FastPastStandingWalls, (151, 152)),
}
# Numbers of trajectories, and of flows, that meet what an engine of their own may have got wrong.
SELDOM_WRONG_PATHS: dict[str, tuple[int, ...]] = {
    "upright below 1e-6": (134, 144),
    "room for 128 legs": (133, 145),
    "distance from its wall kept": (136, 139, 142, 146),
    "2 m' v_y forgotten": (135, 143),
    "sides rest with nu": (139,),
}
