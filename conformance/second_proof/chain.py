"""Re-prove a trajectory's written enclosures in Arb: the root in each, and the state that follows.

The start is exact; after each collision the state is a ball. Time stays exact: a state is carried to a
rational instant beside its collision, so the phase of a law loses no digit along the path. Which wall is met
first is proved apart, from each rounded state (`conformance.second_proof.step`).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from fractions import Fraction

import flint
from flint import arb, fmpq

from conformance.arb.flight import Line, Table, line_of
from conformance.arb.numbers import ZERO, Number, bisected, exact, hull, precision
from conformance.second_proof.signs import SignedFlight
from conformance.second_proof.step import Refuted
from conformance.vectors import Certified
from scene import Scene, State, Wall


def recheck(
    scene: Scene, state: State, t_end: float, steps: Sequence[Certified], marks: Sequence[str] = ()
) -> None:
    """Prove that every written enclosure of a trajectory holds the truth.

    Args:
        scene: table and laws.
        state: the exact start.
        t_end: horizon [time].
        steps: the enclosures of each collision, and of the horizon where it is met.
        marks: of each collision of a flow: "captured" and "free" are claims about arc hits, and are proved;
            what the walls alone tell is not looked at.

    Raises:
        Refuted: saying which one does not.
    """
    for bits in (512, 2048, 8192):
        try:
            with precision(bits):
                path = _WrittenPath(SignedFlight(Table(scene), line_of(state), state.wall))
                told = itertools.chain(marks, itertools.repeat(""))
                for number, (certified, mark) in enumerate(zip(steps, told, strict=False), 1):
                    path.advance(certified, exact(t_end), f"step {number}", mark)
        except _NotShown:
            # Balls grow along a path: more bits may yet decide.
            if bits == 8192:
                raise
        else:
            return


class _NotShown(Refuted):
    """Not proved with so many bits, nor shown to be wrong."""


class _WrittenPath:
    """Where a trajectory stands: a flight with balls for place and velocity, from an exact instant.

    `since` is the time from the last collision to that instant, a small ball.
    """

    def __init__(self, flight: SignedFlight) -> None:
        self.flight = flight
        self.since: Number = ZERO
        if flight.wall is not None and flight.wall != "base":
            flight.residuals = {flight.wall: flight.jet(flight.wall, ZERO)[0]}

    def advance(self, certified: Certified, t_end: fmpq, place: str, mark: str = "") -> None:
        """Prove one step, and its mark if it has one, and go on to the state after it."""
        f, wall = self.flight, certified.wall
        low, high = (exact(Fraction(end)) for end in certified.dt)
        if wall is None:
            s: Number = t_end - f.line.t
            centre = s
        elif wall == "base":
            s = -f.line.y / f.line.vy
            centre = (low + high) / 2
        else:
            low, high = self._root(wall, low, high, place)
            s, centre = hull(low, high), (low + high) / 2
        if mark in ("captured", "free"):
            self._require_mark(mark, s, place)
        x, y = f.place(s)
        vx, vy = (f.line.vx, f.line.vy) if wall is None else f.reflected(wall, s)
        numbers = {"dt": s + self.since, "x": x, "y": ZERO if wall == "base" else y, "vx": vx, "vy": vy}
        for name, number in numbers.items():
            ends = [arb(exact(Fraction(end))) for end in getattr(certified, name)]
            if number < ends[0] or number > ends[1]:
                raise Refuted(f"{place}: {name} is not what was written")
            if not (ends[0] <= number and number <= ends[1]):
                raise _NotShown(f"{place}: {name} is not shown to be what was written")
        if wall is not None:
            self._go_on(wall, centre, centre - s, numbers)

    def _require_mark(self, mark: str, s: Number, place: str) -> None:
        """Prove that an arc hit is captured, or that it is not: |x vy - y vx| > w |v| before the bounce."""
        f, line = self.flight, self.flight.line
        spin, width = line.x * line.vy - line.y * line.vx, f.width(s)[0]
        excess = spin * spin - width * width * (line.vx * line.vx + line.vy * line.vy)
        if excess < 0 if mark == "captured" else excess > 0:
            raise Refuted(f"{place}: the arc hit is not {mark}")
        if not (excess > 0 or excess < 0):
            raise _NotShown(f"{place}: the arc hit is not shown to be {mark}")

    def _root(self, wall: Wall, low: fmpq, high: fmpq, place: str) -> tuple[fmpq, fmpq]:
        """Enclose the wall's root near the written flight time, proved to be one and falling."""
        f, width = self.flight, max(high - low, fmpq(1, 2**80) * abs(high))
        shift = arb(self.since).mid().fmpq()
        low, high = low - shift - width, high - shift + width
        first, last = f.jet(wall, low)[0], f.jet(wall, high)[0]
        if first < 0 or last > 0:
            raise Refuted(f"{place}: {wall} does not change sign over the written time")
        if not (first > 0 and last < 0):
            raise _NotShown(f"{place}: {wall} is not shown to change sign over the written time")
        if not all(f.has_slope(-1, wall, a, b) for a, b in itertools.pairwise(f.cuts(low, high))):
            raise Refuted(f"{place}: {wall} does not fall over the written time")
        return bisected(lambda s: f.jet(wall, s)[0], low, high, flint.ctx.prec)

    def _go_on(self, wall: Wall, centre: fmpq, back: Number, after: dict[str, Number]) -> None:
        """Start anew at the instant `centre` of this flight, `back` after the collision."""
        f, vx, vy = self.flight, after["vx"], after["vy"]
        line = Line(f.line.t + centre, after["x"] + vx * back, after["y"] + vy * back, vx, vy)
        kept = f.residuals.get(wall)
        self.flight = SignedFlight(f.table, line, wall, {} if kept is None else {wall: kept})
        self.since = back
