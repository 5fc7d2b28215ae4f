"""What the reference answers: enclosures of a collision, a horizon or a trajectory."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import scene as wire
from reference.arithmetic import Enclosure
from reference.margins import Margins
from reference.walls import EnclosedFlight
from scene import Rejected, Undecided, Undefined, Wall


class Moment(NamedTuple):
    """A state, all components enclosed."""

    t: Enclosure
    x: Enclosure
    y: Enclosure
    vx: Enclosure
    vy: Enclosure


Jacobian = tuple[tuple[Enclosure, ...], ...]


@dataclass(frozen=True)
class ProvedCollision:
    """A proved first collision.

    Attributes:
        wall: the wall met.
        dt: flight time [time].
        after: the state just after the bounce.
        slope: f' at the hit, < 0.
        digits: working decimals that decided it.
        departure: the flight that ends with this hit, its numbers enclosed.
        root: flight time of the hit, counted from the instant of the departure; dt plus its begin [time].
        jacobian: d(dt, x, y, vx, vy) / d(t, x, y, vx, vy), rows by outputs, when asked for.
        margins: distances of this collision from other outcomes, when asked for.
    """

    wall: Wall
    dt: Enclosure
    after: Moment
    slope: Enclosure
    digits: int
    departure: EnclosedFlight = field(repr=False)
    root: Enclosure = field(repr=False)
    jacobian: Jacobian | None = field(repr=False, default=None)
    margins: Margins | None = field(repr=False, default=None)

    def rounded(self) -> wire.Collision:
        """Return the centres, correctly rounded, in the wire's form."""
        return wire.Collision(self.wall, float(self.dt), *(float(c) for c in self.after))


@dataclass(frozen=True)
class ProvedHorizon:
    """Proved: no collision before t_end; the state there, enclosed."""

    at: Moment
    digits: int

    def rounded(self) -> wire.Horizon:
        """Return the centres, correctly rounded, in the wire's form."""
        return wire.Horizon(*(float(c) for c in self.at))


Outcome = ProvedCollision | ProvedHorizon | Undefined | Undecided | Rejected


class Trajectory(NamedTuple):
    """Successive collisions, and the outcome that ended them early.

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
