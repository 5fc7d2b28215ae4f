"""What the reference answers: enclosures of a collision, a horizon or a trajectory, and what proves them."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from typing import NamedTuple

import scene as wire
from reference.arithmetic import Enclosure
from reference.isolation import Leaf
from reference.margins import Margins
from scene import Rejected, Undecided, Undefined, Wall


class Moment(NamedTuple):
    """A state, all components enclosed."""

    t: Enclosure
    x: Enclosure
    y: Enclosure
    vx: Enclosure
    vy: Enclosure


Jacobian = tuple[tuple[Enclosure, ...], ...]


class Departure(NamedTuple):
    """From where an answer was proved: the flight, for every state within these enclosures.

    Attributes:
        instant: absolute time from which flight times are counted, exactly [time].
        x, y, vx, vy: place and velocity on the line of flight at that instant.
        begin: flight time at which the flight begins: 0 for an exact start.
        residuals: f(0) of the wall being left, if any.
    """

    instant: Fraction
    x: Enclosure
    y: Enclosure
    vx: Enclosure
    vy: Enclosure
    begin: Enclosure
    residuals: dict[Wall, Enclosure]


@dataclass(frozen=True)
class ProvedCollision:
    """A proved first collision.

    Attributes:
        wall: the wall met.
        dt: flight time [time].
        after: the state just after the bounce.
        slope: f' at the hit, < 0.
        digits: working decimals that decided it.
        departure: the flight for which this is proved.
        root: the hit's flight time, counted from the departure's instant: dt but for its begin [time].
        proof: for each wall, the sub-intervals of flight time on which f > 0 was proved.
        jacobian: d(dt, x, y, vx, vy) / d(t, x, y, vx, vy), rows by outputs, when asked for.
        margins: how far this answer is from another one, when asked for.
    """

    wall: Wall
    dt: Enclosure
    after: Moment
    slope: Enclosure
    digits: int
    departure: Departure = field(repr=False)
    root: Enclosure = field(repr=False)
    proof: dict[str, list[Leaf]] = field(repr=False)
    jacobian: Jacobian | None = field(repr=False, default=None)
    margins: Margins | None = field(repr=False, default=None)

    def rounded(self) -> wire.Collision:
        """Return the centres, correctly rounded, in the wire's form."""
        return wire.Collision(self.wall, float(self.dt), *(float(c) for c in self.after))


@dataclass(frozen=True)
class ProvedHorizon:
    """Proved: no collision before t_end; the state there, enclosed, and the flight for which it is proved."""

    at: Moment
    digits: int
    departure: Departure = field(repr=False)
    proof: dict[str, list[Leaf]] = field(repr=False)

    def rounded(self) -> wire.Horizon:
        """Return the centres, correctly rounded, in the wire's form."""
        return wire.Horizon(*(float(c) for c in self.at))


Outcome = ProvedCollision | ProvedHorizon | Undefined | Undecided | Rejected


class Trajectory(NamedTuple):
    """Successive collisions and what came instead of the last one asked for.

    Attributes:
        steps: the collisions, each enclosed.
        outcome: None, or horizon, undefined or undecided instead of a further collision.
        digits: the working decimals that were needed.
        jacobian: d(t, x, y, vx, vy) after the last collision / d(initial state), when asked for.
    """

    steps: list[ProvedCollision]
    outcome: Outcome | None
    digits: int
    jacobian: Jacobian | None = None
