"""Laws of motion over balls of time, and exactly at rational times.

`Timed.jet` encloses a law, its rate and its second derivative for every time of a ball, however wide: where
the ball touches several pieces of a bang-bang law, all of them are kept and the union of their values is
returned. So nothing that uses a law needs to know where its knots lie, nor whether a time is exact.
Laws and their rates are continuous; the second derivative is that of some piece the ball touches, which is
what a mean-value bound needs.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from itertools import pairwise
from typing import Any, NamedTuple, Protocol

from flint import arb, fmpq

from scene import BangBang, Fourier, Law

Ball = Any  # arb, which has no type stubs
Rational = Any  # fmpq
Jet = tuple[Ball, Ball, Ball]  # value, first and second derivative by time
ExactJet = tuple[Rational, Rational, Rational]

# Pieces whose ends lie this share of a period beyond a ball's rounded ends are still looked at exactly.
PREFILTER = 2.0**-30


def exact(number: float) -> Rational:
    """Return the rational that a binary64 is."""
    return fmpq(*float(number).as_integer_ratio())


def hull(a: Ball, b: Ball) -> Ball:
    """Return a ball that holds all numbers between two balls or rationals."""
    return arb(a).union(arb(b))


def product(p: Any, q: Any) -> Any:
    """Return the jet of a product."""
    return p[0] * q[0], p[1] * q[0] + p[0] * q[1], p[2] * q[0] + 2 * p[1] * q[1] + p[0] * q[2]


class Timed(Protocol):
    """A law that can be asked at balls of time and at exact times."""

    def jet(self, time: Ball) -> Jet:
        """Enclose value, rate and second derivative at every time of the ball."""

    def exact_value(self, time: Rational) -> Rational | None:
        """Return the value at a rational time, or None where it is not known to be rational."""

    def exact_jet(self, time: Rational) -> ExactJet | None:
        """Return all three at a rational time and just after it, or None where one may be irrational."""

    def range(self) -> tuple[Ball, Ball]:
        """Return bounds of the value at all times."""


def timed(law: Law) -> Timed:
    """Prepare a law at the present precision of flint."""
    if isinstance(law, BangBang) and len({value for _, value in law.knots}) > 1:
        return Legs(law)
    if isinstance(law, Fourier) and law.harmonics():
        return Waves(law)
    if isinstance(law, BangBang):
        return Still(law.knots[0][1])
    return Still(law.mean if isinstance(law, Fourier) else law)


class Still:
    """A law that never changes."""

    def __init__(self, number: float) -> None:
        self.number = exact(number)
        self.fixed = (arb(self.number), arb(0), arb(0))

    def jet(self, time: Ball) -> Jet:
        """See `Timed`."""
        return self.fixed

    def exact_value(self, time: Rational) -> Rational | None:
        """See `Timed`."""
        return self.number

    def exact_jet(self, time: Rational) -> ExactJet | None:
        """See `Timed`."""
        return self.number, fmpq(0), fmpq(0)

    def range(self) -> tuple[Ball, Ball]:
        """See `Timed`."""
        return self.fixed[0], self.fixed[0]


class Waves:
    """A trigonometric polynomial of time; its frequency is omega, or 2 pi / period."""

    def __init__(self, law: Fourier) -> None:
        self.period = None if law.period is None else exact(law.period)
        self.exact_omega = None if law.omega is None else exact(law.omega)
        self.omega = 2 * arb.pi() / arb(self.period) if self.exact_omega is None else arb(self.exact_omega)
        self.mean = exact(law.mean)
        self.harmonics = [(k, exact(a), exact(b)) for k, a, b in law.harmonics()]
        self.terms = [(k * self.omega, arb(a), arb(b)) for k, a, b in self.harmonics]

    def jet(self, time: Ball) -> Jet:
        """See `Timed`."""
        value, rate, bend = arb(self.mean), arb(0), arb(0)
        for frequency, a, b in self.terms:
            sin, cos = (frequency * time).sin_cos()
            wave = a * cos + b * sin
            value += wave
            rate += frequency * (b * cos - a * sin)
            bend -= frequency * frequency * wave
        return value, rate, bend

    def exact_value(self, time: Rational) -> Rational | None:
        """See `Timed`: rational at 0, and at every quarter of a rational period."""
        turn = fmpq(0) if time == 0 else None if self.period is None else time / self.period
        if turn is None or (4 * turn).q != 1:
            return None
        total = self.mean
        for k, a, b in self.harmonics:
            quarter = int((4 * k * turn).p) % 4
            total += a * (1, 0, -1, 0)[quarter] + b * (0, 1, 0, -1)[quarter]
        return total

    def exact_jet(self, time: Rational) -> ExactJet | None:
        """See `Timed`: where the period is rational, omega and the rates are not."""
        if time != 0 or self.exact_omega is None:
            return None
        value = self.exact_value(time)
        rate, bend = fmpq(0), fmpq(0)
        for k, a, b in self.harmonics:
            frequency = k * self.exact_omega
            rate += frequency * b
            bend -= frequency * frequency * a
        return value, rate, bend

    def range(self) -> tuple[Ball, Ball]:
        """See `Timed`."""
        swing = arb(0)
        for _, a, b in self.terms:
            swing += (a * a + b * b).sqrt()
        return arb(self.mean) - swing, arb(self.mean) + swing


class Piece(NamedTuple):
    """value + pull u^2 / 2, u the time since `rest`, for local times in [start, end]."""

    start: Ball
    end: Ball
    rest: Ball
    value: Ball
    pull: Ball


class Legs:
    """A bang-bang law. Local time is the time since the first knot, whole periods taken off."""

    def __init__(self, law: BangBang) -> None:
        knots = [(exact(t), exact(v)) for t, v in law.knots]
        self.first, self.period = knots[0][0], knots[-1][0] - knots[0][0]
        self.exact_pieces = []
        for (t0, v0), (t1, v1) in pairwise(knots):
            pull, middle = 4 * (v1 - v0) / (t1 - t0) ** 2, (t0 + t1) / 2
            self.exact_pieces.append((t0 - self.first, middle - self.first, t0 - self.first, v0, pull))
            self.exact_pieces.append((middle - self.first, t1 - self.first, t1 - self.first, v1, -pull))
        # One period before and one after: a ball's lower end rounds a little below 0, its upper end anywhere.
        self.pieces = [
            Piece(*(arb(n) for n in (a + turn, b + turn, rest + turn, value, pull)))
            for turn in (-self.period, 0, self.period)
            for a, b, rest, value, pull in self.exact_pieces
        ]
        self.unit = 1 / arb(self.period)
        self.starts = [float((piece.start * self.unit).mid()) for piece in self.pieces]
        self.values = min(v for _, v in knots), max(v for _, v in knots)
        speed = max(2 * abs(v1 - v0) / (t1 - t0) for (t0, v0), (t1, v1) in pairwise(knots))
        bend = max(4 * abs(v1 - v0) / (t1 - t0) ** 2 for (t0, v0), (t1, v1) in pairwise(knots))
        self.anywhere: Jet = (hull(*self.values), hull(-speed, speed), hull(-bend, bend))

    def jet(self, time: Ball) -> Jet:
        """See `Timed`."""
        local = time - arb(self.first)
        if 2 * local.rad() * self.unit > 0.9:
            return self.anywhere
        turns = (local * self.unit).lower().floor().unique_fmpz()
        if turns is None:
            return self.anywhere
        local -= arb(self.period * turns)
        touched = self.touched(local)
        if not touched:  # beyond the pieces listed: the ball's lower end rounds far below 0
            return self.anywhere
        if len(touched) == 1:
            return _on_piece(touched[0], local)
        jets = [_on_piece(piece, local.intersection(hull(piece.start, piece.end))) for piece in touched]
        value, rate, bend = jets[0]
        for other in jets[1:]:
            value, rate, bend = value.union(other[0]), rate.union(other[1]), bend.union(other[2])
        return value, rate, bend

    def touched(self, local: Ball) -> list[Piece]:
        """Return the pieces that hold at some time of a ball of local time."""
        share = local * self.unit
        middle, reach = float(share.mid()), float(share.rad()) + PREFILTER
        low = max(bisect_left(self.starts, middle - reach) - 1, 0)
        high = bisect_right(self.starts, middle + reach)
        # A comparison of balls is true only when it is certain, so what may be touched stays.
        return [piece for piece in self.pieces[low:high] if not (piece.start > local or piece.end < local)]

    def exact_value(self, time: Rational) -> Rational | None:
        """See `Timed`."""
        return self.exact_jet(time)[0]

    def exact_jet(self, time: Rational) -> ExactJet:
        """See `Timed`."""
        turns = ((time - self.first) / self.period).floor()
        local = time - self.first - turns * self.period
        _, _, rest, value, pull = next(piece for piece in self.exact_pieces if piece[0] <= local < piece[1])
        u = local - rest
        return value + pull * u * u / 2, pull * u, pull

    def range(self) -> tuple[Ball, Ball]:
        """See `Timed`."""
        return arb(self.values[0]), arb(self.values[1])


def _on_piece(piece: Piece, local: Ball) -> Jet:
    u = local - piece.rest
    rate = piece.pull * u
    return piece.value + rate * u / 2, rate, piece.pull
