"""Mutants that find a wrong root, or decide wrongly which root is the first.

Part of `conformance.mutants`, which lists them; a docstring is the fault.
"""

# ruff: noqa: D102 (a class says what its one method does wrong)

from __future__ import annotations

from collections.abc import Iterator, Sequence

from conformance.plain.step import Flight
from scene import Wall

SAMPLES = 32  # looks along a flight, of those who sample


def _crossings(flight: Flight, wall: Wall, start: float, end: float) -> Iterator[tuple[float, float]]:
    """Yield the sampled intervals at whose ends f is positive, then not."""
    times = [start + (end - start) * i / SAMPLES for i in range(SAMPLES + 1)]
    values = [flight.f(wall, s)[0] for s in times]
    if wall == flight.wall and start == 0.0:
        values[0] = 1.0
    for i in range(SAMPLES):
        if values[i] > 0 >= values[i + 1]:
            yield times[i], times[i + 1]


class SubStepsTestedAtTheirEnds(Flight):
    """Looks at f at the ends of sub-steps only: misses a wall that was met and left between."""

    def first_root(self, wall: Wall, start: float, end: float) -> float | None:
        for a, b in _crossings(self, wall, start, end):
            return super().first_root(wall, a, b) if wall == self.wall else self.root_between(wall, a, b)
        return None


class LastRoot(Flight):
    """Keeps the last root that it comes by, not the first."""

    def first_root(self, wall: Wall, start: float, end: float) -> float | None:
        later = [b for a, b in _crossings(self, wall, start, end) if a > start]
        first = super().first_root(wall, start, end)
        if first is None or not later or later[-1] <= first:
            return first
        a = later[-1] - (end - start) / SAMPLES
        return first if a <= first else self.root_between(wall, a, later[-1])


class ResidualKept(Flight):
    """Leaves f(0), which is rounding, in f: a particle just outside its wall meets it again at once."""

    def first_root(self, wall: Wall, start: float, end: float) -> float | None:
        if wall == self.wall and start == 0.0:
            gap, slope = self.gap(wall, 0.0), self.f(wall, 0.0)[1]
            if gap.start < 0.0 and -gap.start / slope < end:
                return -gap.start / slope
        return super().first_root(wall, start, end)


class HitsWithinEpsilonSkipped(Flight):
    """Takes a hit within 1e-9 of departure for the one just left."""

    def first_root(self, wall: Wall, start: float, end: float) -> float | None:
        root = super().first_root(wall, start, end)
        return None if root is not None and root < 1e-9 else root


class LeftWallForgotten(Flight):
    """Never meets twice in a row the wall that it leaves."""

    def first_root(self, wall: Wall, start: float, end: float) -> float | None:
        return None if wall == self.wall else super().first_root(wall, start, end)


class RootInAbsoluteTime(Flight):
    """Finds the time of the hit, and subtracts: the flight time is rounded like t."""

    def first_root(self, wall: Wall, start: float, end: float) -> float | None:
        root = super().first_root(wall, start, end)
        return None if root is None else (self.state.t + root) - self.state.t


def _halved(flight: Flight, wall: Wall, a: float, b: float, width: float = 0.0, gap: float = -1.0) -> float:
    """Halve the bracket of a root until it is no wider than `width`, or |f| no larger than `gap`."""
    middle = (a + b) / 2
    while b - a > width and a < middle < b and abs(f := flight.f(wall, middle)[0]) > gap:
        a, b = (middle, b) if f > 0 else (a, middle)
        middle = (a + b) / 2
    return middle


class RootToSixDigits(Flight):
    """Stops halving the bracket at a width of 1e-6."""

    def root_between(self, wall: Wall, a: float, b: float) -> float:
        return _halved(self, wall, a, b, width=1e-6)


class RootWhereGapIsSmall(Flight):
    """Accepts as a hit where f is below 1e-7."""

    def root_between(self, wall: Wall, a: float, b: float) -> float:
        return _halved(self, wall, a, b, gap=1e-7)


class OneNewtonStep(Flight):
    """Refines a root by a single step of Newton's."""

    def root_between(self, wall: Wall, a: float, b: float) -> float:
        middle = (a + b) / 2
        f, slope = self.f(wall, middle)
        return min(max(middle - f / slope, a), b) if slope else middle


class NewtonFromDeparture(Flight):
    """Starts Newton's method at s = 0 and takes what it finds."""

    def first_root(self, wall: Wall, start: float, end: float) -> float | None:
        s = start
        if wall == self.wall:
            s = end if end < 1e300 else start
        for _ in range(50):
            f, slope = self.f(wall, s)
            if slope == 0:
                return None
            s, before = s - f / slope, s
            if abs(s - before) <= 1e-15 * abs(s):
                return s if start < s <= end else None
        return None


class GateOnVelocity(Flight):
    """Drops a hit unless the particle itself flies towards the wall."""

    def first_root(self, wall: Wall, start: float, end: float) -> float | None:
        root = super().first_root(wall, start, end)
        if root is None:
            return None
        nx, ny, _ = self.normal(wall, root)
        return root if self.vx * nx + self.vy * ny < 0 else None


class StaticChord(Flight):
    """Flies along the chord of a circle that stands still, from arc to arc."""

    def first_root(self, wall: Wall, start: float, end: float) -> float | None:
        if wall != "arc" or self.wall != "arc" or start > 0.0:
            return super().first_root(wall, start, end)
        chord = -2 * (self.x * self.vx + self.y * self.vy) / (self.vx**2 + self.vy**2)
        return chord if 0 < chord <= end else None


class WallsAtConstantVelocity(Flight):
    """Carries each wall on at its velocity of departure while it looks for the root."""

    def f(self, wall: Wall, s: float) -> tuple[float, float]:
        gap, now = self.gap(wall, 0.0), self.gap(wall, s)
        flown = gap.rise if wall == self.wall else gap.start
        if wall == "arc":
            x, y = self.place(s)
            flown -= x * x + y * y - self.x * self.x - self.y * self.y
        else:
            flown += (gap.fx * self.vx + gap.fy * self.vy) * s
        return flown + gap.ft * s, gap.ft + now.fx * self.vx + now.fy * self.vy


class FirstListedWall(Flight):
    """Takes the first wall in its list that is met, not the wall met first."""

    def first_hit(self, walls: Sequence[Wall], start: float, end: float) -> tuple[Wall, float] | None:
        for wall in walls:
            if (root := self.first_root(wall, start, end)) is not None:
                return wall, root
        return None

    def require_clear(self, walls: Sequence[Wall], s: float) -> None:
        return None


class TiesBrokenByOrder(Flight):
    """Answers a corner, an edge of the mouth or a touch with the wall that comes first in its list."""

    def require_clear(self, walls: Sequence[Wall], s: float) -> None:
        return None

    def is_mouth_open(self, s: float) -> bool:
        return abs(self.x + self.vx * s) < self.width(s).now


class FloorMissedFromTheCap(Flight):
    """Looks for the sides alone when a flight has passed the mouth."""

    def first_hit(self, walls: Sequence[Wall], start: float, end: float) -> tuple[Wall, float] | None:
        kept = [wall for wall in walls if wall != "floor" or start == 0.0]
        return super().first_hit(kept, start, end)


class FlightTimeFromTheMouth(Flight):
    """Counts the flight time from the mouth on when it is passed."""

    def first_hit(self, walls: Sequence[Wall], start: float, end: float) -> tuple[Wall, float] | None:
        hit = super().first_hit(walls, start, end)
        if hit is None or start == 0.0:
            return hit
        return hit[0], hit[1] - start
