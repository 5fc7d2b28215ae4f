"""Re-prove a trajectory's written enclosures in Arb: the root in each, and the state that follows.

The start is exact; after each collision the state is a ball. Time stays exact: a state is carried to a
rational instant beside its collision, so no law is ever asked in which of two pieces it is. Which wall is met
first is proved apart, from each rounded state (`conformance.second_proof.step`).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from fractions import Fraction

import flint
from flint import arb, fmpq

from conformance.second_proof.flight import Flight, Number, ball
from conformance.second_proof.precision import precision
from conformance.second_proof.step import Refuted
from conformance.vectors import Certified
from scene import Scene, State


def recheck(scene: Scene, state: State, t_end: float, steps: Sequence[Certified]) -> None:
    """Prove that every written enclosure of a trajectory holds the truth.

    Raises:
        Refuted: saying which one does not.
    """
    for bits in (512, 2048, 8192):
        try:
            with precision(bits):
                start = {name: getattr(state, name) for name in state.__struct_fields__}
                path = _Path(Flight(scene, start))
                for number, certified in enumerate(steps, 1):
                    path.advance(certified, Fraction(t_end), f"step {number}")
        except _Open:
            # Balls grow along a path: more bits may yet decide.
            if bits == 8192:
                raise
        else:
            return


class _Open(Refuted):
    """Not proved with so many bits, nor shown to be wrong."""


class _Path:
    """Where a trajectory stands: a flight with balls for place and velocity, from an exact instant.

    `since` is the time from the last collision to that instant, a small ball.
    """

    def __init__(self, flight: Flight) -> None:
        self.flight = flight
        self.since: Number = fmpq(0)
        if flight.wall is not None:
            wall = flight.wall
            flat = wall == "base"
            flight.residuals = {} if flat else {wall: flight.jet(wall, fmpq(0), fmpq(0))[0]}

    def advance(self, certified: Certified, t_end: Fraction, place: str) -> None:
        """Prove one step and go on to the state after it."""
        f, wall = self.flight, certified.wall
        low, high = (_exact(end) for end in certified.dt)
        if wall is None:
            s: Number = fmpq(t_end.numerator, t_end.denominator) - f.t
            centre = s
        elif wall == "base":
            s = -f.y / f.vy
            centre = (low + high) / 2
        else:
            s, centre = self._root(wall, low, high, place)
        x, y = f.x + f.vx * s, f.y + f.vy * s
        vx, vy = (f.vx, f.vy) if wall is None else self._reflected(wall, s, centre, x, y)
        numbers = {"dt": s + self.since, "x": x, "y": fmpq(0) if wall == "base" else y, "vx": vx, "vy": vy}
        for name, number in numbers.items():
            ends = [arb(_exact(end)) for end in getattr(certified, name)]
            if number < ends[0] or number > ends[1]:
                raise Refuted(f"{place}: {name} is not what was written")
            if not (ends[0] <= number and number <= ends[1]):
                raise _Open(f"{place}: {name} is not shown to be what was written")
        if wall is not None:
            self._go_on(wall, centre, centre - s, numbers)

    def _root(self, wall: str, low: fmpq, high: fmpq, place: str) -> tuple[Number, fmpq]:
        """Enclose the wall's root near the written flight time, proved to be one and falling."""
        f, width = self.flight, max(high - low, fmpq(1, 2**80) * abs(high))
        shift = fmpq(*_dyadic(arb(self.since).mid()))
        low, high = low - shift - width, high - shift + width
        cuts = [low, *f.cuts(low, high)[1:-1], high]
        first, last = f.at(wall, low)[0], f.at(wall, high)[0]
        if first < 0 or last > 0:
            raise Refuted(f"{place}: {wall} does not change sign over the written time")
        if not (first > 0 and last < 0):
            raise _Open(f"{place}: {wall} is not shown to change sign over the written time")
        if not all(f.has_slope(-1, wall, a, b) for a, b in itertools.pairwise(cuts)):
            raise Refuted(f"{place}: {wall} does not fall over the written time")
        for _ in range(flint.ctx.prec):
            # The root itself may lie half way; then it does not lie at a third.
            for middle in ((low + high) / 2, (2 * low + high) / 3):
                value = f.at(wall, middle)[0]
                if value > 0:
                    low = middle
                elif value < 0:
                    high = middle
                else:
                    continue
                break
            else:
                break
        return ball(low, high), (low + high) / 2

    def _reflected(self, wall: str, s: Number, within: fmpq, x: Number, y: Number) -> tuple[Number, Number]:
        f = self.flight
        if wall == "base":
            return f.vx, -f.vy
        gradient: tuple[Number, Number] = (fmpq(0), fmpq(1))
        if wall == "arc":
            gradient = (-2 * x, -2 * y)
        elif wall != "floor":
            gradient = (fmpq(1 if wall == "left" else -1), f.law("slope", s, within)[0])
        factor = 2 * f.jet(wall, s, within)[1] / (gradient[0] ** 2 + gradient[1] ** 2)
        return f.vx - factor * gradient[0], f.vy - factor * gradient[1]

    def _go_on(self, wall: str, centre: fmpq, back: Number, after: dict[str, Number]) -> None:
        """Start anew at the instant `centre` of this flight, `back` after the collision."""
        f = self.flight
        kept = f.residuals.get(wall)
        f.t, f.wall = f.t + centre, wall
        f.vx, f.vy = after["vx"], after["vy"]
        f.x, f.y = after["x"] + f.vx * back, after["y"] + f.vy * back
        f.residuals = {} if kept is None else {wall: kept}
        self.since = back


def _exact(text: str) -> fmpq:
    number = Fraction(text)
    return fmpq(number.numerator, number.denominator)


def _dyadic(number: arb) -> tuple[int, int]:
    mantissa, exponent = number.man_exp()
    m, e = int(mantissa), int(exponent)
    return (m << e, 1) if e >= 0 else (m, 1 << -e)
