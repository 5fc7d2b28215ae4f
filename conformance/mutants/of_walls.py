"""Mutants that have a wall or a bounce wrong: frozen walls, the mouth, normals, velocities after the hit.

Part of `conformance.mutants`, which lists them; a docstring is the fault.
"""

# ruff: noqa: D102 (a class says what its one method does wrong)

from __future__ import annotations

from collections.abc import Sequence
from math import hypot

from msgspec.structs import replace

from conformance.plain.motion import ConstantMotion, LawMotion, LawValue
from conformance.plain.step import Flight, Gap, Open
from scene import Collision, Horizon, Outcome, Scene, State, Wall


class WallVelocityDropped(Flight):
    """Bounces as if every wall stood still."""

    def normal(self, wall: Wall, s: float) -> tuple[float, float, float]:
        return *super().normal(wall, s)[:2], 0.0


class WallVelocityOnce(Flight):
    """Adds u where 2 u is due."""

    def normal(self, wall: Wall, s: float) -> tuple[float, float, float]:
        nx, ny, u = super().normal(wall, s)
        return nx, ny, u / 2


class WallVelocitySign(Flight):
    """Takes a wall that comes for one that goes."""

    def normal(self, wall: Wall, s: float) -> tuple[float, float, float]:
        nx, ny, u = super().normal(wall, s)
        return nx, ny, -u


def _departure(flight: Flight, s: float) -> float:
    """Return time 0, or s where departure is from the centre, which has no normal."""
    return 0.0 if flight.x or flight.y else s


class WallVelocityAtDeparture(Flight):
    """Kicks with the speed that the wall had at departure."""

    def normal(self, wall: Wall, s: float) -> tuple[float, float, float]:
        return *super().normal(wall, s)[:2], super().normal(wall, _departure(self, s))[2]


class NormalAtDeparture(Flight):
    """Reflects about the normal at the place of departure."""

    def normal(self, wall: Wall, s: float) -> tuple[float, float, float]:
        return *super().normal(wall, _departure(self, s))[:2], super().normal(wall, s)[2]


class NormalWithoutCos(Flight):
    """Takes (1, slope) for a unit normal of a slanted side."""

    def normal(self, wall: Wall, s: float) -> tuple[float, float, float]:
        if wall not in ("left", "right"):
            return super().normal(wall, s)
        gap = self.gap(wall, s)
        return gap.fx, gap.fy, -gap.ft


class SideVelocityWithoutCos(Flight):
    """Takes dw/dt for the normal velocity of a slanted side."""

    def normal(self, wall: Wall, s: float) -> tuple[float, float, float]:
        nx, ny, u = super().normal(wall, s)
        return (nx, ny, -self.gap(wall, s).ft) if wall in ("left", "right") else (nx, ny, u)


class SidesReflectAsUpright(Flight):
    """Reflects x alone at a slanted side."""

    def normal(self, wall: Wall, s: float) -> tuple[float, float, float]:
        nx, ny, u = super().normal(wall, s)
        return (1.0 if nx > 0 else -1.0, 0.0, u) if wall in ("left", "right") else (nx, ny, u)


class NormalTiltedUpward(Flight):
    """Has the sign of the slope wrong in the normal of a side."""

    def normal(self, wall: Wall, s: float) -> tuple[float, float, float]:
        nx, ny, u = super().normal(wall, s)
        return (nx, -ny, u) if wall in ("left", "right") else (nx, ny, u)


class ArcVelocityUnscaled(Flight):
    """Takes the rate of r^2 for the velocity of the arc."""

    def normal(self, wall: Wall, s: float) -> tuple[float, float, float]:
        nx, ny, u = super().normal(wall, s)
        return nx, ny, self.gap(wall, s).ft if wall == "arc" else u


class EnergyKept(Flight):
    """Rescales the velocity after each bounce to the speed before."""

    def bounce(self, wall: Wall, s: float) -> tuple[float, float]:
        vx, vy = super().bounce(wall, s)
        part = hypot(self.vx, self.vy) / (hypot(vx, vy) or 1.0)
        return part * vx, part * vy


class TiltRateDropped(Flight):
    """Leaves d(slope)/dt out of the velocity of a side."""

    def gap(self, wall: Wall, s: float) -> Gap:
        gap = super().gap(wall, s)
        return gap._replace(ft=self.width(s).rate) if wall in ("left", "right") else gap


class _Negated(ConstantMotion):
    def __init__(self, law: LawMotion) -> None:
        super().__init__(-law.value, 0.0)
        self.law = law

    def at(self, s: float) -> LawValue:
        return LawValue(*(-part for part in self.law.at(s)))


class SlopeSign(Flight):
    """Lets a stem widen downwards that narrows, and the other way round."""

    def __init__(self, scene: Scene, state: State, t_end: float) -> None:
        super().__init__(scene, state, t_end)
        if "slope" in self.laws:
            self.laws["slope"] = _Negated(self.laws["slope"])


class LeftSideUpright(Flight):
    """Slants the right side only."""

    def gap(self, wall: Wall, s: float) -> Gap:
        if wall != "left":
            return super().gap(wall, s)
        w = self.width(s)
        return Gap(w.value + self.x, w.rise + self.vx * s, w.rate, 1.0, 0.0)


class ArcStatic(Flight):
    """Lets the arc stand still during a flight."""

    still = "r"

    def __init__(self, scene: Scene, state: State, t_end: float) -> None:
        super().__init__(scene, state, t_end)
        if self.still in self.laws:
            self.laws[self.still] = ConstantMotion(self.laws[self.still].value, 0.0)


class FloorStatic(ArcStatic):
    """Lets the floor stand still during a flight."""

    still = "h"


class HoleStatic(Flight):
    """Lets the mouth and the sides stand still during a flight."""

    def width(self, s: float) -> LawValue:
        return super().width(0.0)._replace(rate=0.0)


class SidesNotMovedByTheHole(Flight):
    """Moves the mouth but holds the sides of the stem still during a flight."""

    def gap(self, wall: Wall, s: float) -> Gap:
        if wall not in ("left", "right"):
            return super().gap(wall, s)
        gap, w = super().gap(wall, s), self.width(s)
        return gap._replace(rise=gap.rise - w.rise, ft=gap.ft - w.rate)


class HoleNotScaledByRadius(Flight):
    """Takes nu for the half-width of the mouth."""

    def width(self, s: float) -> LawValue:
        return self.laws["w" if "w" in self.laws else "nu"].at(s)


class HoleRateWithoutRadius(Flight):
    """Forgets that nu r grows with r too: its rate is nu' r."""

    def width(self, s: float) -> LawValue:
        motion = super().width(s)
        if "w" in self.laws:
            return motion
        return motion._replace(rate=self.laws["nu"].at(s).rate * self.laws["r"].at(s).now)


class _Heedless(Flight):
    """Goes on where the plain stepper would see that it must be wrong."""

    def first_root(self, wall: Wall, start: float, end: float) -> float | None:
        try:
            return super().first_root(wall, start, end)
        except Open:
            return None

    def require_clear(self, walls: Sequence[Wall], s: float) -> None:
        if self.is_horizon and s == self.end:
            super().require_clear(walls, s)


class MouthTestedAtDeparture(_Heedless):
    """Asks at departure how wide the mouth is."""

    def is_mouth_open(self, s: float) -> bool:
        return abs(self.x + self.vx * s) < self.width(0.0).now


class MouthTestedWithPlaceOfDeparture(_Heedless):
    """Asks at the place of departure whether the mouth is open."""

    def is_mouth_open(self, s: float) -> bool:
        return abs(self.x) < self.width(s).now


class MouthTestedToTheRightOnly(_Heedless):
    """Tests x < w instead of |x| < w."""

    def is_mouth_open(self, s: float) -> bool:
        return self.x + self.vx * s < self.width(s).now


class MouthTestedAtEndOfSubStep(_Heedless):
    """Crosses y = 0 in sub-steps and asks at the end of one: it cuts the mouth's corner."""

    def is_mouth_open(self, s: float) -> bool:
        size = 0.01 * self.width(0.0).now / (abs(self.vx) + abs(self.vy))
        return super().is_mouth_open((s // size + 1) * size)


class BaseClosed(Flight):
    """Has no mouth."""

    def is_mouth_open(self, s: float) -> bool:
        return False


class BaseOpen(_Heedless):
    """Has no base beside the mouth."""

    def is_mouth_open(self, s: float) -> bool:
        return True


class BaseBounceIgnored(_Heedless):
    """Lets a particle through the closed base of a cap or the top of a stem."""

    def walls_near(self, *, in_cap: bool) -> tuple[Wall, ...]:
        return tuple(wall for wall in super().walls_near(in_cap=in_cap) if wall != "base")


class MouthClosedFromBelow(Flight):
    """Opens the mouth downwards only: a particle of the stem bounces in it."""

    def is_mouth_open(self, s: float) -> bool:
        return self.is_in_cap and super().is_mouth_open(s)


class PlaceNotMovedToTheMouth(Flight):
    """Does not move x on the way to the mouth."""

    def place(self, s: float) -> tuple[float, float]:
        x, y = super().place(s)
        return (x - self.vx * self.crossing, y) if s > self.crossing else (x, y)


class PlaceNotMoved(Flight):
    """Gives the place of departure for that of the hit."""

    def collision(self, wall: Wall, s: float) -> Collision:
        return replace(super().collision(wall, s), x=self.x, y=self.y)


class TimeForFlightTime(Flight):
    """Gives the time of the hit for the flight time."""

    def collision(self, wall: Wall, s: float) -> Collision:
        hit = super().collision(wall, s)
        return replace(hit, dt=hit.t)


class ClockRestarts(Flight):
    """Gives the flight time for the time of the hit."""

    def collision(self, wall: Wall, s: float) -> Collision:
        hit = super().collision(wall, s)
        return replace(hit, t=hit.dt)


class HorizonNotReached(Flight):
    """Gives the place of departure at the horizon."""

    def horizon(self) -> Outcome:
        return Horizon(self.t_end, self.x, self.y, self.vx, self.vy)


class HorizonIgnored(Flight):
    """Goes on to the next collision whatever t_end is."""

    def __init__(self, scene: Scene, state: State, t_end: float) -> None:
        super().__init__(scene, state, t_end)
        self.end, self.is_horizon = self.escape(), True
