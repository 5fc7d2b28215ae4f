"""Mutants at the narrow places: the mouth's edge, corners, slanted sides, what is near the start, t_end.

Part of `conformance.mutants`, which lists them; a docstring is the fault.
"""

# ruff: noqa: D102 (a class says what its one method does wrong)

from __future__ import annotations

from collections.abc import Sequence
from math import hypot

from msgspec.structs import replace

from conformance.mutants.of_walls import _Heedless
from conformance.plain.motion import ConstantMotion, LawValue
from conformance.plain.step import Flight, Gap
from scene import Collision, Mushroom, Outcome, Scene, State, Wall


class MouthWiderByAMillionth(_Heedless):
    """Lets a particle through the mouth that hits the base within a millionth of its edge."""

    def is_mouth_open(self, s: float) -> bool:
        return abs(self.x + self.vx * s) < self.width(s).now + 1e-6


class MouthNarrowerByAMillionth(_Heedless):
    """Bounces a particle off the base that passes the mouth within a millionth of its edge."""

    def is_mouth_open(self, s: float) -> bool:
        return abs(self.x + self.vx * s) < self.width(s).now - 1e-6


class MouthHalfAsWide(_Heedless):
    """Takes the half-width of the mouth for its width."""

    def is_mouth_open(self, s: float) -> bool:
        return abs(self.x + self.vx * s) < self.width(s).now / 2


class MouthAndBaseExchanged(_Heedless):
    """Opens the base and closes the mouth."""

    def is_mouth_open(self, s: float) -> bool:
        return abs(self.x + self.vx * s) > self.width(s).now


class MouthTestedAtHorizon(_Heedless):
    """Asks at t_end how wide the mouth is."""

    def is_mouth_open(self, s: float) -> bool:
        return abs(self.x + self.vx * s) < self.width(min(self.t_end - self.state.t, 1e9)).now


class MouthOfFirstRadius(_Heedless):
    """Multiplies nu with the radius at departure."""

    def width(self, s: float) -> LawValue:
        if "w" in self.laws:
            return self.laws["w"].at(s)
        nu, r = self.laws["nu"].at(s), self.laws["r"].at(0.0)
        return LawValue(nu.value * r.value, nu.rise * r.value, nu.rate * r.value)


class HoleRateOfRadiusOnly(Flight):
    """Forgets that nu moves: the rate of nu r is nu r'."""

    def width(self, s: float) -> LawValue:
        motion = super().width(s)
        if "w" in self.laws:
            return motion
        return motion._replace(rate=self.laws["nu"].at(s).now * self.laws["r"].at(s).rate)


class CornersTurnBack(_Heedless):
    """Turns the velocity round where two walls are met within a millionth of the flight time."""

    def collision(self, wall: Wall, s: float) -> Collision:
        hit = super().collision(wall, s)
        near = self.walls_near(in_cap=hit.y > 0 or (self.is_in_cap and wall == "base"))
        if all(other in (wall, self.wall) or self.f(other, s)[0] > 1e-6 for other in near):
            return hit
        return replace(hit, vx=-self.vx, vy=-self.vy)


class WallsNearTheStartSkipped(_Heedless):
    """Passes by every wall that is within a thousandth of a start on another one."""

    def first_root(self, wall: Wall, start: float, end: float) -> float | None:
        if self.wall not in (None, wall) and start == 0.0 and self.f(wall, 0.0)[0] < 1e-3:
            return None
        return super().first_root(wall, start, end)


class StartTakenForTheNearerWall(_Heedless):
    """Takes a start within a thousandth of two walls to be on the other one."""

    def __init__(self, scene: Scene, state: State, t_end: float) -> None:
        super().__init__(scene, state, t_end)
        for wall in self.walls_near(in_cap=self.is_in_cap):
            if self.wall not in (None, wall) and abs(self.f(wall, 0.0)[0]) < 1e-3:
                self.wall = wall
                break

    def refusal(self) -> Outcome | None:
        return None


class HitsWithinAMillionthSkipped(_Heedless):
    """Takes a hit within a millionth of departure for the one just left."""

    def first_root(self, wall: Wall, start: float, end: float) -> float | None:
        root = super().first_root(wall, start, end)
        return None if root is not None and root < 1e-6 else root


class HorizonIncluded(_Heedless):
    """Counts a hit at t_end exactly."""

    def require_clear(self, walls: Sequence[Wall], s: float) -> None:
        return None

    def outcome(self) -> Outcome:
        if self.is_horizon:
            self.end *= 1 + 2.0**-52
            if abs(self.crossing - self.end) <= 2.0**-50 * self.end:
                self.crossing, self.end = self.end * (1 - 2.0**-51), self.end * (1 + 2.0**-48)
        return super().outcome()


class HitsJustBeforeHorizonDropped(_Heedless):
    """Looks for a hit up to a millionth before t_end only."""

    def outcome(self) -> Outcome:
        if self.is_horizon:
            self.end *= 1 - 1e-6
        return super().outcome()


class HitsJustAfterHorizonCounted(_Heedless):
    """Looks for a hit up to a millionth after t_end."""

    def outcome(self) -> Outcome:
        if self.is_horizon:
            self.end *= 1 + 1e-6
        return super().outcome()


class SidesSlantFromTheFloor(_Heedless):
    """Takes w for the half-width at the floor, not at the mouth."""

    def gap(self, wall: Wall, s: float) -> Gap:
        gap = super().gap(wall, s)
        if wall not in ("left", "right"):
            return gap
        slope, h = self.laws["slope"].at(s), self.laws["h"].at(s)
        start = gap.start + slope.value * h.value
        rise = gap.rise + slope.now * h.now - slope.value * h.value
        return gap._replace(start=start, rise=rise, ft=gap.ft + slope.rate * h.now + slope.now * h.rate)

    def refusal(self) -> Outcome | None:
        return None


class TiltRateSign(Flight):
    """Has the sign of d(slope)/dt wrong in the velocity of a side."""

    def gap(self, wall: Wall, s: float) -> Gap:
        gap = super().gap(wall, s)
        return gap._replace(ft=2 * self.width(s).rate - gap.ft) if wall in ("left", "right") else gap


class TiltRateOfTheFloor(Flight):
    """Takes the velocity of a slanted side at the floor for that where it is hit."""

    def normal(self, wall: Wall, s: float) -> tuple[float, float, float]:
        nx, ny, u = super().normal(wall, s)
        if wall not in ("left", "right"):
            return nx, ny, u
        slope, h = self.laws["slope"].at(s), self.laws["h"].at(s)
        return nx, ny, -(self.width(s).rate - slope.rate * h.now) / hypot(1.0, slope.now)


class SlopeAtDeparture(Flight):
    """Holds the slope of the sides still during a flight."""

    def __init__(self, scene: Scene, state: State, t_end: float) -> None:
        super().__init__(scene, state, t_end)
        if "slope" in self.laws:
            self.laws["slope"] = ConstantMotion(self.laws["slope"].value, 0.0)


class WallVelocityAlongXOnly(Flight):
    """Adds the velocity of a wall to vx alone."""

    def bounce(self, wall: Wall, s: float) -> tuple[float, float]:
        vx, vy = super().bounce(wall, s)
        _, ny, u = self.normal(wall, s)
        return vx, vy - 2 * u * ny


class FloorVelocitySign(Flight):
    """Takes a floor that rises for one that sinks."""

    def normal(self, wall: Wall, s: float) -> tuple[float, float, float]:
        nx, ny, u = super().normal(wall, s)
        return nx, ny, -u if wall == "floor" else u


class ArcVelocityOfTheMouth(Flight):
    """Takes the velocity of the mouth's edge for that of the arc."""

    def normal(self, wall: Wall, s: float) -> tuple[float, float, float]:
        nx, ny, u = super().normal(wall, s)
        return (
            (nx, ny, -self.width(s).rate)
            if wall == "arc" and isinstance(self.scene, Mushroom)
            else (nx, ny, u)
        )


class ArcNormalOfOldRadius(Flight):
    """Divides the place on the arc by the radius at departure for a unit normal."""

    def normal(self, wall: Wall, s: float) -> tuple[float, float, float]:
        nx, ny, u = super().normal(wall, s)
        if wall != "arc":
            return nx, ny, u
        r = self.laws["r"].at(s)
        return nx * r.now / r.value, ny * r.now / r.value, u


class ArcGoesOnBelow(_Heedless):
    """Meets the arc in the stem too, where the circle goes on below the mouth."""

    def walls_near(self, *, in_cap: bool) -> tuple[Wall, ...]:
        near = super().walls_near(in_cap=in_cap)
        return near if in_cap or not isinstance(self.scene, Mushroom) else (*near, "arc")


class LeftAndRightExchanged(Flight):
    """Calls the left side right."""

    def collision(self, wall: Wall, s: float) -> Collision:
        hit = super().collision(wall, s)
        return replace(hit, wall={"left": "right", "right": "left"}.get(wall, wall))


class CurvatureOfWallsForgotten(_Heedless):
    """Takes walls to move at constant velocity where it excludes earlier hits."""

    def bend(self, wall: Wall) -> float:
        return 2 * (self.vx**2 + self.vy**2) if wall == "arc" else 0.0


class CurvatureOfFlightForgotten(_Heedless):
    """Leaves v^2 out of the curvature of the arc's function."""

    def bend(self, wall: Wall) -> float:
        return super().bend(wall) - (2 * (self.vx**2 + self.vy**2) if wall == "arc" else 0.0)


class CurvatureOfTiltForgotten(_Heedless):
    """Leaves the tilting of a side out of the curvature of its function."""

    def bend(self, wall: Wall) -> float:
        if wall not in ("left", "right"):
            return super().bend(wall)
        b = self.bounds
        return b["w"].curvature if "w" in b else b["nu"].highest * b["r"].curvature


class CurvatureSign(_Heedless):
    """Has the sign of the walls' curvature wrong where it excludes earlier hits."""

    def bend(self, wall: Wall) -> float:
        still = 2 * (self.vx**2 + self.vy**2) if wall == "arc" else 0.0
        return max(2 * still - super().bend(wall), 0.0)
