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
    """A state whose components are all enclosed."""

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
        root: `dt` plus the flight time at which `departure` begins, which is near 0 [time].
        jacobian: d(dt, x, y, vx, vy) / d(t, x, y, vx, vy), a row for each output, if asked for.
        margins: distances of this collision from other outcomes, if asked for.
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
        """Return the centres of the enclosures, correctly rounded, as a class of `scene`."""
        return wire.Collision(self.wall, float(self.dt), *(float(c) for c in self.after))


@dataclass(frozen=True)
class ProvedHorizon:
    """A proof that there is no collision before t_end, with the state at t_end, enclosed."""

    at: Moment
    digits: int

    def rounded(self) -> wire.Horizon:
        """Return the centres of the enclosures, correctly rounded, as a class of `scene`."""
        return wire.Horizon(*(float(c) for c in self.at))


Outcome = ProvedCollision | ProvedHorizon | Undefined | Undecided | Rejected


class Trajectory(NamedTuple):
    """Successive collisions, and the outcome that ended them early.

    Attributes:
        steps: the collisions, each enclosed.
        outcome: None if all collisions were found; else the outcome that ended the path before
            that.
        digits: the working decimals that were needed.
        jacobian: d(t, x, y, vx, vy) after the last collision / d(initial state), if asked for.
    """

    steps: list[ProvedCollision]
    outcome: Outcome | None
    digits: int
    jacobian: Jacobian | None = None

    @property
    def outcomes(self) -> list[Outcome]:
        """The collisions and, if another outcome ended the path early, that one."""
        return [*self.steps, self.outcome] if self.outcome is not None else [*self.steps]
