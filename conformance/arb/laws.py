"""Laws of motion over balls of time, and exactly at rational times.

Laws and their rates are continuous; the second derivative of a bang-bang law jumps at its knots and mid-legs.
Asked at a ball of time, a law returns the union over all the pieces that the ball touches, so nothing that
uses a law needs to know where its knots lie; the second derivative is then that of some piece touched, which
is what a mean-value bound needs. Where the sign of the second derivative up to a knot matters, the caller
names an instant `within` the one piece that it means.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterable
from itertools import pairwise
from typing import NamedTuple

from flint import arb, fmpq

from conformance.arb.numbers import ZERO, Ball, Jet, Number, Rational, exact, hull
from scene import BangBang, Fourier, Law
from scene.laws import is_constant

# Pieces whose ends lie this share of a period beyond a ball's rounded ends are still looked at exactly.
PREFILTER = 2.0**-30
QUARTERS = (fmpq(1), ZERO, fmpq(-1), ZERO)  # cos of 0, 1, 2 and 3 quarters of a turn


class BallLaw:
    """A law that can be asked at balls of time and at exact times."""

    def jet(self, time: Number, within: Rational | None = None) -> Jet:
        """Enclose value, rate and second derivative.

        Args:
            time: a ball, for every time in it, or a rational, for that time and just after it; then each of
                the three is a rational where it is known to be one.
            within: an instant of the only piece to consider; None for every piece touched.
        """
        raise NotImplementedError

    def range(self) -> tuple[Number, Number]:
        """Return bounds of the value at all times."""
        raise NotImplementedError

    def knots(self, start: Rational, end: Rational) -> list[Rational]:
        """List the times strictly between at which the law changes its piece."""
        return []


def ball_law(law: Law) -> BallLaw:
    """Prepare a law at the present precision of flint."""
    if isinstance(law, Fourier):
        return BallConstant(law.mean) if is_constant(law) else BallFourier(law)
    if isinstance(law, BangBang):
        return BallConstant(law.knots[0][1]) if is_constant(law) else BallBangBang(law)
    return BallConstant(law)


class BallConstant(BallLaw):
    """A law that never changes."""

    def __init__(self, number: float) -> None:
        self.exact = (exact(number), ZERO, ZERO)
        self.balls = (arb(self.exact[0]), arb(0), arb(0))

    def jet(self, time: Number, within: Rational | None = None) -> Jet:
        """See `BallLaw`."""
        return self.exact if isinstance(time, fmpq) else self.balls

    def range(self) -> tuple[Number, Number]:
        """See `BallLaw`."""
        return self.exact[0], self.exact[0]


class BallFourier(BallLaw):
    """A trigonometric polynomial of time; its frequency is omega, or 2 pi / period."""

    def __init__(self, law: Fourier) -> None:
        self.period = None if law.period is None else exact(law.period)
        self.omega = 2 * arb.pi() / self.period if law.omega is None else exact(law.omega)
        self.mean = exact(law.mean)
        self.harmonics = [(k, exact(a), exact(b)) for k, a, b in law.harmonics()]
        self.terms = [(k * arb(self.omega), arb(a), arb(b)) for k, a, b in self.harmonics]

    def jet(self, time: Number, within: Rational | None = None) -> Jet:
        """See `BallLaw`: rational at time 0 and, but for the rates, at every quarter of a rational period."""
        if isinstance(time, fmpq):
            turn = ZERO if time == 0 else None if self.period is None else time / self.period
            if turn is not None and (4 * turn).q == 1:
                return self._at_quarter(int((4 * turn).p))
        sine_cosine = _sine_cosine_of_ball if isinstance(time, arb) else arb.sin_cos
        waves = ((frequency, a, b, *sine_cosine(frequency * time)) for frequency, a, b in self.terms)
        return _added((arb(self.mean), arb(0), arb(0)), waves)

    def _at_quarter(self, quarter: int) -> Jet:
        turned = ((k, a, b, k * quarter) for k, a, b in self.harmonics)
        waves = ((k * self.omega, a, b, QUARTERS[(n - 1) % 4], QUARTERS[n % 4]) for k, a, b, n in turned)
        return _added((self.mean, ZERO, ZERO), waves)

    def range(self) -> tuple[Number, Number]:
        """See `BallLaw`."""
        swing = arb(0)
        for _, a, b in self.terms:
            swing += (a * a + b * b).sqrt()
        return self.mean - swing, self.mean + swing


def _added(to: Jet, waves: Iterable[tuple[Number, ...]]) -> Jet:
    """Add waves and their derivatives; each is frequency, cosine and sine amplitude, sine and cosine."""
    value, rate, bend = to
    for frequency, a, b, sin, cos in waves:
        wave = a * cos + b * sin
        value, rate = value + wave, rate + frequency * (b * cos - a * sin)
        bend -= frequency * frequency * wave
    return value, rate, bend


class Parabola(NamedTuple):
    """value + pull u^2 / 2, u the time since `rest`, for local times in [start, end]."""

    start: Number
    end: Number
    rest: Number
    value: Number
    pull: Number

    def jet(self, local: Number) -> Jet:
        """Return value, rate and second derivative at a local time."""
        u = local - self.rest
        rate = self.pull * u
        return self.value + rate * u / 2, rate, self.pull


def _sine_cosine_of_ball(angle: arb) -> tuple[arb, arb]:
    """Enclose sine and cosine of an angle, tightly where one of them turns.

    Arb takes both to change by as much as the angle. Where waves cancel, near the least of a law that all but
    vanishes, second derivatives would be lost in that.
    """
    sine, cosine = angle.mid().sin_cos()
    across = arb(0, angle.rad())
    down = arb(1, angle.rad() ** 2 / 2)  # cosine of what the angle is off its middle
    wide_sine, wide_cosine = angle.sin_cos()
    return (
        wide_sine.intersection(sine * down + cosine * across),
        wide_cosine.intersection(cosine * down - sine * across),
    )


class BallBangBang(BallLaw):
    """A bang-bang law. Local time is the time since the first knot, whole periods taken off."""

    def __init__(self, law: BangBang) -> None:
        knots = [(exact(t), exact(v)) for t, v in law.knots]
        self.first, self.period = knots[0][0], knots[-1][0] - knots[0][0]
        self.exact_pieces: list[Parabola] = []
        for (t0, v0), (t1, v1) in pairwise((t - self.first, v) for t, v in knots):
            pull, middle = 4 * (v1 - v0) / (t1 - t0) ** 2, (t0 + t1) / 2
            self.exact_pieces += [Parabola(t0, middle, t0, v0, pull), Parabola(middle, t1, t1, v1, -pull)]
        self.exact_starts = [piece.start for piece in self.exact_pieces]
        # One period before and one after: a ball's lower end rounds a little below 0, its upper end anywhere.
        self.pieces = [
            Parabola(*(arb(n) for n in (p.start + turn, p.end + turn, p.rest + turn, p.value, p.pull)))
            for turn in (-self.period, 0, self.period)
            for p in self.exact_pieces
        ]
        self.unit = 1 / arb(self.period)
        self.starts = [float((piece.start * self.unit).mid()) for piece in self.pieces]
        self.values = min(v for _, v in knots), max(v for _, v in knots)
        speed = max(abs(p.pull) * (p.end - p.start) for p in self.exact_pieces)
        bend = max(abs(p.pull) for p in self.exact_pieces)
        self.anywhere: Jet = (hull(*self.values), hull(-speed, speed), hull(-bend, bend))

    def jet(self, time: Number, within: Rational | None = None) -> Jet:
        """See `BallLaw`."""
        if within is None and isinstance(time, fmpq):
            within = time
        if within is not None:
            begin = self.first + ((within - self.first) / self.period).floor() * self.period
            return self.exact_pieces[bisect_right(self.exact_starts, within - begin) - 1].jet(time - begin)
        local = time - arb(self.first)
        if 2 * local.rad() * self.unit > 0.9:
            return self.anywhere
        turns = (local * self.unit).lower().floor().unique_fmpz()
        if turns is None:
            return self.anywhere
        return self._united(local - arb(self.period * turns))

    def _united(self, local: Ball) -> Jet:
        touched = self.touched(local)
        if not touched:  # beyond the pieces listed: the ball's lower end rounds far below 0
            return self.anywhere
        if len(touched) == 1:
            return touched[0].jet(local)
        jets = [piece.jet(local.intersection(hull(piece.start, piece.end))) for piece in touched]
        value, rate, bend = jets[0]
        for other in jets[1:]:
            value, rate, bend = value.union(other[0]), rate.union(other[1]), bend.union(other[2])
        return value, rate, bend

    def touched(self, local: Ball) -> list[Parabola]:
        """Return the pieces that hold at some time of a ball of local time."""
        share = local * self.unit
        middle, reach = float(share.mid()), float(share.rad()) + PREFILTER
        low = max(bisect_left(self.starts, middle - reach) - 1, 0)
        high = bisect_right(self.starts, middle + reach)
        # A comparison of balls is true only when it is certain, so what may be touched stays.
        return [piece for piece in self.pieces[low:high] if not (piece.start > local or piece.end < local)]

    def range(self) -> tuple[Number, Number]:
        """See `BallLaw`."""
        return self.values

    def knots(self, start: Rational, end: Rational) -> list[Rational]:
        """See `BallLaw`."""
        found = []
        for place in self.exact_starts:
            begin = self.first + place
            time = begin + ((start - begin) / self.period).floor() * self.period
            while time < end:
                if time > start:
                    found.append(time)
                time += self.period
        return found
