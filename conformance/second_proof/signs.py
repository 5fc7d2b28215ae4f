"""Signs of a wall's function, its rate and its second derivative along a flight, proved by splitting."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from math import prod
from typing import Any

from flint import arb, fmpq

from conformance.arb.flight import BallFlight, Line, Table
from conformance.arb.laws import BallBangBang
from conformance.arb.numbers import ZERO, Jet, Number, Rational, exact, hull
from scene import Scene, Wall

MAX_PERIODS = 100  # of a law whose knots are listed
MAX_SPLITS = 2000  # a near miss by 1e-300 takes half as many halvings as it has bits


class SignedFlight(BallFlight):
    """A flight whose time is exact, and the signs that are certain along it.

    Args:
        table: the scene.
        line: rationals, but for place and velocity after a collision, which are balls.
        wall: the one being left, if any.
        residuals: its f(0), where it is known already.
    """

    def __init__(
        self, table: Table, line: Line, wall: Wall | None, residuals: dict[Wall, Number] | None = None
    ) -> None:
        super().__init__(table, line, residuals)
        self.wall = wall

    def leave(self, walls: tuple[Wall, ...]) -> None:
        """Take out f(0) of the wall the flight leaves: the one named, or one that is exactly met."""
        for wall in walls:
            f = self.jet(wall, ZERO)[0]
            if wall == self.wall or f == 0:
                self.residuals[wall] = f

    def begins_in_cap(self) -> bool:
        """Tell whether the flight begins in the cap."""
        if not self.table.is_mushroom:
            return not self.table.is_stem
        y, vy = self.line.y, self.line.vy
        return self.wall in ("arc", "base") or (self.wall is None and (y > 0 or (y == 0 and vy > 0)))

    def cuts(self, a: Rational, b: Rational) -> list[Rational]:
        """List a, the flight times between a and b at which some law leaves a piece, and b."""
        t = self.line.t
        knots = {time - t for law in self.table.laws.values() for time in law.knots(t + a, t + b)}
        return sorted({a, b, *knots})

    def is_long(self, a: Rational, b: Rational) -> bool:
        """Tell whether [a, b] holds so many periods of a law that its knots are not worth listing."""
        bang_bang = [law for law in self.table.laws.values() if isinstance(law, BallBangBang)]
        return any(b - a > MAX_PERIODS * law.period for law in bang_bang)

    def over(self, wall: Wall, a: Rational, b: Rational) -> Jet:
        """Enclose f, f', f'' over [a, b], which lies on one piece of every law."""
        return self.jet(wall, hull(a, b), within=(a + b) / 2)

    def rate(self, wall: Wall, s: Number) -> Number:
        """Enclose f' of a wall, by the mean value theorem too: where it turns, balls are too wide."""
        found = self.jet(wall, s)
        if not isinstance(s, arb):
            return found[1]
        middle = s.mid()
        centred = self.jet(wall, middle)[1] + found[2] * (s - middle)
        return arb(found[1]).intersection(centred)

    def is_never_swept(self, wall: Wall, a: Rational, b: Rational) -> bool:
        """Tell whether f, less its residual, is above 0 on [a, b], whatever the phase.

        With laws held still f is concave in s, and linear in the slope: its least value is at ends. There
        each law is taken anywhere between its bounds, or, where these are too wide, all over a period.
        """
        residual = self.residuals.get(wall, ZERO)
        return all(
            self._lowest(wall, s) - residual > 0 or self._is_never_met(wall, s, residual) for s in (a, b)
        )

    def _is_never_met(self, wall: Wall, s: Rational, residual: Number) -> bool:
        """Tell whether f > 0 over a period for a particle that rests where the flight is at s."""
        if self.table.turn is None:
            return False
        still = SignedFlight(self.table, self.at_rest(s), None, {wall: residual})
        pieces = itertools.pairwise(still.cuts(ZERO, self.table.turn))
        return all(still.is_positive(wall, *piece) for piece in pieces)

    def _lowest(self, wall: Wall, s: Rational) -> Number:
        laws, (x, y) = self.table.laws, self.place(s)
        if wall == "arc":
            radius = laws["r"].range()[0]
            return radius * radius - x * x - y * y
        if wall == "floor":
            return y + laws["h"].range()[0]
        width = prod((law.range()[0] for law in self.table.width), start=fmpq(1))
        return width + laws["slope"].range()[y < 0] * y + (x if wall == "left" else -x)

    def is_positive(self, wall: Wall, a: Rational, b: Rational) -> bool:
        """Tell whether f > 0 on [a, b], on one piece: as evaluated, by Taylor, or after splitting."""

        def holds(low: Rational, high: Rational) -> bool:
            whole, half = self.over(wall, low, high), arb((high - low) / 2)
            f, slope, _ = self.jet(wall, (low + high) / 2)
            taylor = f + slope * half * arb(0, 1) + whole[2] * half * half * arb(0.25, 0.25)
            return bool(whole[0] > 0) or bool(taylor > 0)

        return _everywhere(holds, a, b)

    def has_slope(self, sign: int, wall: Wall, a: Rational, b: Rational) -> bool:
        """Tell whether f' has this strict sign on [a, b], on one piece."""

        def holds(low: Rational, high: Rational) -> bool:
            whole, half = self.over(wall, low, high), arb((high - low) / 2)
            centred = self.jet(wall, (low + high) / 2)[1] + whole[2] * half * arb(0, 1)
            return bool(sign * whole[1] > 0) or bool(sign * centred > 0)

        return _everywhere(holds, a, b)

    def is_convex(self, wall: Wall, a: Rational, b: Rational) -> bool:
        """Tell whether f'' > 0 on [a, b], on one piece."""
        return _everywhere(lambda low, high: bool(self.over(wall, low, high)[2] > 0), a, b)

    def is_concave(self, wall: Wall, a: Rational, b: Rational) -> bool:
        """Tell whether f'' <= 0 on [a, b], on one piece."""
        return _everywhere(lambda low, high: bool(self.over(wall, low, high)[2] <= 0), a, b)


def flight_from(scene: Scene, state: dict[str, Any]) -> SignedFlight:
    """Return the flight of an exact state, as a certificate writes it."""
    return SignedFlight(Table(scene), Line(*(exact(state[name]) for name in Line._fields)), state["wall"])


def _everywhere(holds: Callable[[Rational, Rational], bool], a: Rational, b: Rational) -> bool:
    todo = [(a, b)]
    for _ in range(MAX_SPLITS):
        if not todo:
            return True
        low, high = todo.pop()
        if not holds(low, high):
            middle = (low + high) / 2
            todo += [(middle, high), (low, middle)]
    return False
