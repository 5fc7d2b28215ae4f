"""Flights of the plain stepper that are wrong where chance seldom looks: each was once accepted.

What each gets wrong is drawn on purpose by `conformance.generator.seldom` and `in_flight.swept_scene`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

import msgspec

from conformance.plain.motion import BangBangMotion
from conformance.plain.step import Flight
from scene import BangBang, Fourier, Outcome, Rejected, Scene, State, Wall
from scene.tables import laws


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
}
