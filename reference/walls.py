"""The walls along a straight flight, as enclosures (sec. 2).

f > 0 inside:   arc r^2 - x^2 - y^2,   base y (in a stem -y),
    right w + slope y - x,   left w + slope y + x,   floor y + h.
With an interval of flight times, each enclosure holds over all of it, knots included.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from fractions import Fraction
from functools import partial, reduce
from typing import Any, NamedTuple

from reference.arithmetic import Arithmetic, Interval
from reference.jets import Jet, add, multiply, negative, square
from reference.prepared import PreparedTable
from reference.timeline import Timeline
from scene import Wall
from scene.mpmath_internals import ends


class EnclosedFlight(NamedTuple):
    """A straight flight, described at an exact instant.

    Attributes:
        instant: absolute time, exactly; flight times s are counted from it [time].
        x, y, vx, vy: enclosures of place and velocity at s = 0, on the line of flight.
        begin: enclosure of the s at which the flight begins: 0 for a given state; a little before
            or after 0 for a flight that begins at a collision, whose time is enclosed.
    """

    instant: Fraction
    x: Interval
    y: Interval
    vx: Interval
    vy: Interval
    begin: Interval


def wall_function(
    table: PreparedTable,
    wall: Wall,
    x: Jet,
    y: Jet,
    law: Callable[[str], Jet],
    square_of: Callable[[Jet], Jet],
) -> Jet:
    """Return f, f', f'' of a wall for a particle at (x, y).

    Args:
        table: the scene, prepared.
        wall: one of its walls.
        x: of the particle, as a function of time.
        y: likewise.
        law: returns a law by its name; `w` is the half-width of the mouth also where nu is given.
        square_of: returns a square.
    """
    if wall == "base":
        return negative(y) if table.is_stem else y
    if wall == "floor":
        return add(y, law("h"))
    if wall == "arc":
        return add(square_of(law("r")), negative(add(square_of(x), square_of(y))))
    side = negative(x) if wall == "right" else x
    return add(add(law("w"), multiply(law("slope"), y)), side)


class MovingWalls:
    """Evaluates the walls along a flight."""

    def __init__(
        self, arithmetic: Arithmetic, table: PreparedTable, flight: EnclosedFlight
    ) -> None:
        self.arithmetic = arithmetic
        self.flight = flight
        self.table = table
        self.timeline = Timeline(arithmetic, table, flight.instant)
        # Neighbouring intervals share ends, and later proofs reuse results of earlier ones.
        self._known: dict[tuple[Wall, Any], Jet] = {}

    def at_rest(self, s: Interval) -> MovingWalls:
        """Return the walls for a particle at rest where the flight is at s.

        Evaluated laws are shared.
        """
        q = self.flight
        zero = self.arithmetic.zero
        still = copy(self)
        still.flight = q._replace(x=q.x + q.vx * s, y=q.y + q.vy * s, vx=zero, vy=zero)
        still._known = {}
        return still

    def law(self, name: str, s: Interval) -> Jet:
        """Enclose a law and its derivatives over an interval of flight time."""
        return self.timeline.jet(name, s)

    def width(self, s: Interval) -> Jet:
        """Enclose the half-width w of the mouth, w = nu r where nu is given."""
        return reduce(multiply, (self.law(name, s) for name in self.table.width))

    def wall(self, wall: Wall, s: Interval) -> Jet:
        """Enclose f, f', f'' of a wall over flight times s."""
        key = wall, ends(s)
        if key in self._known:
            self.arithmetic.spend(1)
        else:
            self._known[key] = self._evaluated(wall, s)
        return self._known[key]

    def _evaluated(self, wall: Wall, s: Interval) -> Jet:
        q = self.flight
        zero = self.arithmetic.zero
        x, y = Jet(q.x + q.vx * s, q.vx, zero), Jet(q.y + q.vy * s, q.vy, zero)

        def law(name: str) -> Jet:
            return self.width(s) if name == "w" else self.law(name, s)

        return wall_function(self.table, wall, x, y, law, partial(square, self.arithmetic))

    def gradient(self, wall: Wall, s: Interval) -> tuple[Interval, Interval, Interval]:
        """Enclose the partial derivatives of f by x, y and t at flight time s."""
        q = self.flight
        f_t = self.at_rest(s).wall(wall, s).d1
        one = self.arithmetic.number(1)
        zero = self.arithmetic.zero
        if wall == "arc":
            return -2 * (q.x + q.vx * s), -2 * (q.y + q.vy * s), f_t
        if wall in ("left", "right"):
            return (-one if wall == "right" else one), self.law("slope", s).f, f_t
        is_down = wall == "base" and self.table.is_stem
        return zero, -one if is_down else one, f_t

    def hessian(self, wall: Wall, s: Interval) -> tuple[Interval, Interval, Interval, Interval]:
        """Enclose f_xx, f_yy, f_yt and f_tt at flight time s; the other second partials are 0."""
        f_tt = self.at_rest(s).wall(wall, s).d2
        zero = self.arithmetic.zero
        f_yt = self.law("slope", s).d1 if wall in ("left", "right") else zero
        curved = self.arithmetic.number(-2) if wall == "arc" else zero
        return curved, curved, f_yt, f_tt
