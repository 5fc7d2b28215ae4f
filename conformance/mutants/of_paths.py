"""Mutants whose single flights are right, and that err on the way from one to the next.

Part of `conformance.mutants`, which lists them; a docstring is the fault. Some begin to err late: only long
paths kill them.
"""

# ruff: noqa: D102 (a class says what its one method does wrong)

from __future__ import annotations

from math import hypot

from msgspec.structs import replace

from conformance.mutants.of_laws import single
from conformance.plain.flow import PlainPath
from conformance.plain.step import Flight
from scene import Collision, Horizon, Outcome, Scene, State


class _Scaled(PlainPath):
    """Changes the speed by a factor at every hit after some."""

    after = 0
    factor = 1.0

    def told(self, hit: Collision) -> Collision:
        if self.n_hits <= self.after:
            return hit
        return replace(hit, vx=self.factor * hit.vx, vy=self.factor * hit.vy)


class SpeedDrifts(_Scaled):
    """Gains a ten millionth of its speed at every hit."""

    factor = 1 + 1e-7


class SpeedDriftsAfterFiftyHits(_Scaled):
    """Loses a hundred thousandth of its speed at every hit after the fiftieth."""

    after, factor = 50, 1 - 1e-5


class SpeedDriftsAfterFiveHundredHits(_Scaled):
    """Loses a hundred thousandth of its speed at every hit after the five hundredth."""

    after, factor = 500, 1 - 1e-5


class EnergyFrozenAfterFiftyHits(PlainPath):
    """Keeps its speed after fifty hits, whatever the walls do."""

    def told(self, hit: Collision) -> Collision:
        if self.n_hits <= 50:
            return hit
        part = hypot(self.state.vx, self.state.vy) / (hypot(hit.vx, hit.vy) or 1.0)
        return replace(hit, vx=part * hit.vx, vy=part * hit.vy)


class WallsStandAfterFiftyHits(PlainPath):
    """Bounces after fifty hits as if the walls stood still, at half the gain."""

    def told(self, hit: Collision) -> Collision:
        if self.n_hits <= 50:
            return hit
        part = 0.5 + 0.5 * hypot(self.state.vx, self.state.vy) / (hypot(hit.vx, hit.vy) or 1.0)
        return replace(hit, vx=part * hit.vx, vy=part * hit.vy)


class AllHitsForgottenAfterForty(PlainPath):
    """Flies straight on after forty hits."""

    def advance(self) -> Outcome:
        if self.n_hits < 40:
            return super().advance()
        at, s = self.state, self.t_end - self.state.t
        return Horizon(self.t_end, at.x + at.vx * s, at.y + at.vy * s, at.vx, at.vy)


class ClockInFloat32(PlainPath):
    """Adds up the time from hit to hit in binary32."""

    def departure(self, hit: Collision) -> State:
        return replace(hit.state(), t=single(hit.t))


class ClockInFloat32AfterFiftyHits(ClockInFloat32):
    """Adds up the time in binary32 after fifty hits."""

    def departure(self, hit: Collision) -> State:
        return super().departure(hit) if self.n_hits > 50 else hit.state()


class VelocityInFloat32(PlainPath):
    """Keeps the velocity from hit to hit in binary32."""

    def departure(self, hit: Collision) -> State:
        return replace(hit.state(), vx=single(hit.vx), vy=single(hit.vy))


class ClockDriftsByHits(PlainPath):
    """Loses a ten millionth of every flight time."""

    def departure(self, hit: Collision) -> State:
        return replace(hit.state(), t=hit.t - 1e-7 * hit.dt)


class ClockStartsAtZero(PlainPath):
    """Counts the time from the start after the first hit, for the laws and for t_end."""

    def departure(self, hit: Collision) -> State:
        if self.n_hits > 1:
            return hit.state()
        self.t_end -= self.state.t
        return replace(hit.state(), t=hit.dt)


class _PushedOff(Flight):
    """Starts a flight from a wall a little inside it."""

    by = 0.0

    def __init__(self, scene: Scene, state: State, t_end: float) -> None:
        super().__init__(scene, state, t_end)
        if self.wall is not None:
            nx, ny, _ = self.normal(self.wall, 0.0)
            self.x, self.y = self.x + self.by * nx, self.y + self.by * ny


class PushedOffByAMillionth(_PushedOff):
    """Starts a flight from a wall a millionth inside it."""

    by = 1e-6


class PushedOffByABillionth(_PushedOff):
    """Starts a flight from a wall a thousand millionth inside it."""

    by = 1e-9


class GoesOnLate(PlainPath):
    """Goes on from each hit a ten millionth of the flight time late, along the new velocity."""

    def departure(self, hit: Collision) -> State:
        late = 1e-7 * hit.dt
        return replace(hit.state(), x=hit.x + late * hit.vx, y=hit.y + late * hit.vy)
