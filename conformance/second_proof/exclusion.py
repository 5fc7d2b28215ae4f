"""Exclusion of walls in Arb: f > 0 on stretches of a flight, sub-interval by sub-interval.

A certificate says where to cut and which sign to look for; each sign is proved here. A flight begins
at an exact state, or anywhere within an enclosed flight time after a collision; its place, velocity
and residual are then balls, and what is proved holds for every state within them.
"""

from __future__ import annotations

import itertools
from typing import Any

from flint import fmpq

from conformance.arb.numbers import bisected, dyadic, hull
from conformance.second_proof.signs import SignedFlight
from scene import Wall


class Refuted(AssertionError):  # noqa: N818 (a verdict, not an error)
    """The certificate does not prove its answer, for this reason."""


class Exclusion:
    """Proves that walls are not met.

    Args:
        flight: the flight, the wall that it leaves with its residual taken out.
        begin: the flight times between which the flight begins; both 0 for an exact start.
        excluded: for each wall its sub-intervals [start, end, kind] of flight time.
    """

    def __init__(self, flight: SignedFlight, begin: tuple[fmpq, fmpq], excluded: dict[str, Any]) -> None:
        self.flight = flight
        self.begin = begin
        self.excluded = excluded

    def cover(self, wall: Wall, start: fmpq, stop: fmpq, *, may_touch: bool = False) -> None:
        """Prove f > 0 from the flight's begin, or from `start` if that is later, to `stop`.

        Args:
            wall: which one.
            start: flight time.
            stop: flight time; included.
            may_touch: f may fall to exactly 0 at `stop`.

        Raises:
            Refuted: saying from where on it is not proved.
        """
        reached, is_begun = start, wall in self.flight.residuals
        for low, high, kind in self.excluded.get(wall, []):
            a, b = max(dyadic(low), reached), min(dyadic(high), stop)
            if dyadic(low) > reached and reached < stop:
                break
            if a < b:
                if not is_begun and not self.flight.jet(wall, a)[0] > 0:
                    raise Refuted(f"{wall} is not shown to be ahead at {float(a)!r}")
                self._leaf(wall, a, b, kind)
                reached, is_begun = b, True  # every kind proves f > 0 at its right end
        if reached < stop and not (may_touch and self._touches(wall, reached, stop)):
            raise Refuted(f"{wall} is not excluded from {float(reached)!r} on")

    def _touches(self, wall: Wall, a: fmpq, b: fmpq) -> bool:
        return bool(self.flight.jet(wall, b)[0] == 0) and self.falls(wall, a, b)

    def falls(self, wall: Wall, a: fmpq, b: fmpq) -> bool:
        """Tell whether f' < 0 on [a, b]."""
        return self._has_slope(-1, wall, a, b)

    def _leaf(self, wall: Wall, a: fmpq, b: fmpq, kind: str) -> None:
        """Prove f > 0 on (a, b], in the way stated, on each piece of the laws; f >= 0 at a is known."""
        if kind == "swept":
            if not self.flight.is_never_swept(wall, a, b):
                raise Refuted(f"{wall} may sweep [{float(a)!r}, {float(b)!r}]")
            return
        is_long = self.flight.is_long(a, b)
        pieces = [] if is_long else list(itertools.pairwise(self.flight.cuts(a, b)))
        if is_long:
            holds = self._holds_at_once(wall, a, b, kind)
        elif kind == "falling":
            holds = self.falls(wall, a, b) and bool(self.flight.jet(wall, b)[0] > 0)
        elif kind == "concave":
            holds = self._is_concave(wall, a, b, pieces)
        else:
            holds = all(self._holds(wall, low, high, kind) for low, high in pieces)
        if not holds or (self._may_begin(wall, a) and not self._begins(wall, a, b, kind)):
            raise Refuted(f"{wall} is not excluded, {kind}, on [{float(a)!r}, {float(b)!r}]")

    def _may_begin(self, wall: Wall, a: fmpq) -> bool:
        """Tell whether the flight may begin, on this wall, at a or later."""
        return wall in self.flight.residuals and a <= self.begin[1]

    def _begins(self, wall: Wall, a: fmpq, b: fmpq, kind: str) -> bool:
        """Tell whether a sub-interval of this kind proves f > 0 from f = 0, wherever within it that is."""
        if kind == "concave":
            return bool(a <= self.begin[0] and self.begin[1] < b)
        return kind in ("rising", "lifting")

    def _holds(self, wall: Wall, a: fmpq, b: fmpq, kind: str) -> bool:
        """Prove what a kind says on one piece."""
        flight = self.flight
        if kind in ("plain", "centred"):
            return flight.is_positive(wall, a, b)
        if kind == "rising":
            return flight.has_slope(1, wall, a, b)
        if kind == "lifting":
            is_flat = self.begin[0] == self.begin[1] and wall in flight.residuals
            jet = flight.jet(wall, self.begin[0])
            return is_flat and bool(jet[1] == 0) and flight.is_convex(wall, a, b)
        raise Refuted(f"no such kind: {kind}")

    def _holds_at_once(self, wall: Wall, a: fmpq, b: fmpq, kind: str) -> bool:
        """Prove what a kind says over many periods, with laws and rates taken anywhere within their ranges.

        (C1) of the reference's argument holds across knots: signs of f' and f'' over all of it are enough.
        """
        flight, middle = self.flight, (a + b) / 2
        f, slope, bend = flight.jet(wall, hull(a, b))
        if kind == "centred":
            value, rate, _ = flight.jet(wall, middle)
            away = hull(a - middle, b - middle)
            is_above = value + slope * away > 0 or value + rate * away + bend * away * away / 2 > 0
            return bool(is_above)
        if kind in ("falling", "concave"):
            is_bent = slope < 0 if kind == "falling" else bend <= 0
            return bool(is_bent) and bool(flight.jet(wall, b)[0] > 0)
        return bool(slope > 0 if kind == "rising" else kind == "plain" and f > 0)

    def _is_concave(self, wall: Wall, a: fmpq, b: fmpq, pieces: list[tuple[fmpq, fmpq]]) -> bool:
        """Prove that f lies above its chord, or, where f'' touches 0 and no ball shows its sign, f > 0."""
        flight = self.flight
        if not flight.jet(wall, b)[0] > 0:
            return False
        if all(flight.is_concave(wall, *piece) for piece in pieces):
            return True
        instants = [a + (b - a) * fmpq(i, 16) for i in range(17)]
        if any(bool(flight.over(wall, s, s)[2] > 0) for s in instants):
            return False
        if not self._may_begin(wall, a):
            return all(flight.is_positive(wall, *piece) for piece in pieces)
        # From the wall itself, f = 0 where it begins: f rises at first, and is positive after that.
        rests = (a + (b - a) / 2**k for k in range(1, 60))
        rest = next((s for s in rests if self._has_slope(1, wall, a, s)), b)
        if not self.begin[1] < rest < b:
            return False
        return all(flight.is_positive(wall, *piece) for piece in itertools.pairwise(flight.cuts(rest, b)))

    def _has_slope(self, sign: int, wall: Wall, a: fmpq, b: fmpq) -> bool:
        if self.flight.is_long(a, b):
            return bool(sign * self.flight.jet(wall, hull(a, b))[1] > 0)
        pieces = itertools.pairwise(self.flight.cuts(a, b))
        return all(self.flight.has_slope(sign, wall, *piece) for piece in pieces)

    def refined_root(self, wall: Wall, low: fmpq, high: fmpq, n_halvings: int) -> tuple[fmpq, fmpq]:
        """Prove that f falls through 0 within [low, high], once, and enclose it more tightly."""
        if not (self.flight.jet(wall, low)[0] > 0 and self.flight.jet(wall, high)[0] < 0):
            raise Refuted("f does not change sign from + to - over the root interval")
        if not self.falls(wall, low, high):
            raise Refuted("f' is not negative throughout the root interval")
        return bisected(lambda s: self.flight.jet(wall, s)[0], low, high, n_halvings)
