"""The walls along a straight flight, as enclosures (sec. 2).

f > 0 inside:   arc r^2 - x^2 - y^2,   base y (in a stem -y),
    right w + slope y - x,   left w + slope y + x,   floor y + h.
With an interval of flight times, each enclosure holds over all of it, knots included.
"""

from __future__ import annotations

from copy import copy
from fractions import Fraction
from typing import Any, NamedTuple

from reference.arithmetic import Arithmetic, Interval
from reference.jets import Jet, add, multiply, negative, square
from reference.timeline import Timeline
from scene import Scene, Stem, Wall


class EnclosedFlight(NamedTuple):
    """A straight flight, described at an exact instant.

    Attributes:
        instant: absolute time, exactly; flight times s are counted from it [time].
        x, y, vx, vy: enclosures of place and velocity at s = 0, on the line of flight.
        begin: enclosure of the s at which the flight begins: 0 for a given state; a little before or
            after 0 for a flight that begins at a collision, whose time is enclosed.
    """

    instant: Fraction
    x: Interval
    y: Interval
    vx: Interval
    vy: Interval
    begin: Interval


class MovingWalls:
    """Evaluates the walls along a flight."""

    def __init__(self, arithmetic: Arithmetic, scene: Scene, flight: EnclosedFlight) -> None:
        self.arithmetic = arithmetic
        self.flight = flight
        self.is_stem = isinstance(scene, Stem)
        self.timeline = Timeline(arithmetic, scene, flight.instant)
        # Neighbouring intervals share ends, and later proofs reuse results of earlier ones.
        self._known: dict[tuple[Wall, Any], Jet] = {}

    def at_rest(self, s: Interval) -> MovingWalls:
        """Return the walls for a particle at rest where the flight is at s. Evaluated laws are shared."""
        q, zero, still = self.flight, self.arithmetic.zero, copy(self)
        still.flight = q._replace(x=q.x + q.vx * s, y=q.y + q.vy * s, vx=zero, vy=zero)
        still._known = {}
        return still

    def law(self, name: str, s: Interval) -> Jet:
        """Enclose a law and its derivatives over an interval of flight time."""
        return self.timeline.jet(name, s)

    def width(self, s: Interval) -> Jet:
        """Enclose the half-width w of the mouth, w = nu r where nu is given."""
        if "nu" in self.timeline.laws:
            return multiply(self.law("nu", s), self.law("r", s))
        return self.law("w", s)

    def wall(self, wall: Wall, s: Interval) -> Jet:
        """Enclose f, f', f'' of a wall over flight times s."""
        key = wall, s._mpi_
        if key in self._known:
            self.arithmetic.spend(1)
        else:
            self._known[key] = self._evaluated(wall, s)
        return self._known[key]

    def _evaluated(self, wall: Wall, s: Interval) -> Jet:
        q = self.flight
        y = Jet(q.y + q.vy * s, q.vy, None)
        if wall == "base":
            return negative(y) if self.is_stem else y
        if wall == "floor":
            return add(y, self.law("h", s))
        x = Jet(q.x + q.vx * s, q.vx, None)
        if wall == "arc":
            radius = square(self.arithmetic, self.law("r", s))
            return add(radius, negative(add(square(self.arithmetic, x), square(self.arithmetic, y))))
        side = negative(x) if wall == "right" else x
        return add(add(self.width(s), multiply(self.law("slope", s), y)), side)

    def gradient(self, wall: Wall, s: Interval) -> tuple[Interval, Interval, Interval]:
        """Enclose the partial derivatives of f by x, y and t at flight time s."""
        q = self.flight
        one = self.arithmetic.number(1)
        zero = self.arithmetic.zero
        if wall == "base":
            return zero, -one if self.is_stem else one, zero
        if wall == "floor":
            return zero, one, self.law("h", s).d1 or zero
        if wall == "arc":
            r = self.law("r", s)
            f_t = zero if r.d1 is None else 2 * (r.f * r.d1)
            return -2 * (q.x + q.vx * s), -2 * (q.y + q.vy * s), f_t
        slope, y = self.law("slope", s), q.y + q.vy * s
        f_t = self.width(s).d1 or zero
        if slope.d1 is not None:
            f_t = f_t + slope.d1 * y
        return (-one if wall == "right" else one), slope.f, f_t

    def hessian(self, wall: Wall, s: Interval) -> tuple[Interval, Interval, Interval, Interval]:
        """Enclose f_xx, f_yy, f_yt and f_tt at flight time s; the other second partials are 0."""
        q = self.flight
        zero = self.arithmetic.zero
        if wall == "base":
            return zero, zero, zero, zero
        if wall == "floor":
            return zero, zero, zero, self.law("h", s).d2 or zero
        if wall == "arc":
            two = self.arithmetic.number(-2)
            return two, two, zero, square(self.arithmetic, self.law("r", s)).d2 or zero
        slope = self.law("slope", s)
        f_tt = self.width(s).d2 or zero
        if slope.d2 is not None:
            f_tt = f_tt + slope.d2 * (q.y + q.vy * s)
        return zero, zero, slope.d1 or zero, f_tt
