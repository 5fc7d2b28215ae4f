"""What a law is between two knots: a constant, a polynomial of time, or a sum of waves.

`evaluate` works in each of mpmath's number systems (`mp`, `fp`, `iv`) and in `Arrays`, so one
definition serves points, floats, arrays and enclosures. Exact algebra asks a piece whether it
`is_polynomial`. If so, `polynomial` gives its rational coefficients. Else it is a sum of waves,
with a `mean`, `harmonics` and a `cycle`.
"""

from __future__ import annotations

import math
from fractions import Fraction
from math import comb, perm
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def exact(ctx: Any, number: Fraction) -> Any:
    """Bring a rational into a number system (in `iv`: an enclosure); a float is rounded once."""
    if ctx.mpf is not float:
        return ctx.mpf(number.numerator) / ctx.mpf(number.denominator)
    try:
        # Its parts alone may be beyond any float, as those of a knot at 1e-310 are.
        return float(number)
    except OverflowError:
        return math.inf if number > 0 else -math.inf


class Arrays:
    """A number system for `evaluate`: arrays of binary64."""

    mpf = float
    pi = math.pi

    @staticmethod
    def cos_sin(x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the cosines and the sines of an array."""
        return np.cos(x), np.sin(x)


class Period(NamedTuple):
    """A common period: 2 pi / omega, kept symbolic, or an exact rational length [time]."""

    omega: float | None
    length: Fraction | None

    def value(self, ctx: Any) -> Any:
        """Return the period [time] in an mpmath number system."""
        if self.length is not None:
            return exact(ctx, self.length)
        return 2 * ctx.pi / ctx.mpf(self.omega)

    def frequency(self, ctx: Any) -> Any:
        """Return 2 pi / period [1/time] in a number system.

        In `iv` an enclosure where it is irrational.
        """
        if self.length is not None:
            return 2 * ctx.pi / exact(ctx, self.length)
        return ctx.mpf(self.omega)


class ConstantPiece(NamedTuple):
    """A law that never changes."""

    level: float

    @property
    def end(self) -> None:
        """Return None: the piece holds for ever."""
        return

    @property
    def is_polynomial(self) -> Literal[True]:
        """Return True: of degree 0."""
        return True

    def evaluate(self, ctx: Any, t: Any, order: int = 0) -> Any:
        """Evaluate the piece, or a derivative, as `PolynomialPiece.evaluate` does."""
        return ctx.mpf(self.level) if order == 0 else ctx.mpf(0)

    def polynomial(self, start: Fraction) -> list[Fraction]:
        """Return the coefficients in t - start; the last one is not 0."""
        return [Fraction(self.level)] if self.level else []


class PolynomialPiece(NamedTuple):
    """sum_k coefficients[k] (t - origin)^k until `end`, all exact rationals.

    At least one coefficient.
    """

    origin: Fraction
    coefficients: tuple[Fraction, ...]
    end: Fraction

    @property
    def is_polynomial(self) -> Literal[True]:
        """Return True."""
        return True

    def evaluate(self, ctx: Any, t: Any, order: int = 0) -> Any:
        """Evaluate the piece, or its first or second derivative.

        Args:
            ctx: an mpmath context (mp, fp, iv, or a private one), or `Arrays`.
            t: time, a number of ctx [time]; the caller keeps it within the piece.
            order: 0, 1 or 2.

        Returns:
            A number of ctx: [length], [length/time] or [length/time^2]; slopes and nu have no
            length.
        """
        x = t - exact(ctx, self.origin)
        numbers = [exact(ctx, number) for number in self.coefficients]
        if ctx.mpf is float and any(map(math.isinf, numbers)):
            return self._evaluate_exactly(t, order)
        terms = [perm(k, order) * numbers[k] for k in range(order, len(numbers))]
        total = terms.pop() if terms else ctx.mpf(0)
        while terms:
            total = x * total + terms.pop()
        return total

    def _evaluate_exactly(self, t: float | FloatArray, order: int) -> Any:
        """Evaluate where a coefficient is beyond any float: exactly, and round once."""
        if isinstance(t, np.ndarray):
            found = [self._evaluate_exactly(each, order) for each in t.ravel().tolist()]
            return np.array(found).reshape(t.shape)
        about = self.polynomial(Fraction(t))
        return exact(
            Arrays, perm(order, order) * about[order] if order < len(about) else Fraction(0)
        )

    def polynomial(self, start: Fraction) -> list[Fraction]:
        """Return the coefficients in t - start; the last one is not 0."""
        away = start - self.origin
        n = len(self.coefficients)
        found = [
            sum(
                (comb(k, j) * self.coefficients[k] * away ** (k - j) for k in range(j, n)),
                Fraction(0),
            )
            for j in range(n)
        ]
        while found and found[-1] == 0:
            found.pop()
        return found

    def later(self, shift: Fraction) -> PolynomialPiece:
        """Return the same motion, a time later."""
        return PolynomialPiece(self.origin + shift, self.coefficients, self.end + shift)


class TrigonometricPiece(NamedTuple):
    """mean + sum over harmonics (k, c, s) of c cos(k omega t) + s sin(k omega t)."""

    mean: float
    harmonics: tuple[tuple[int, float, float], ...]
    cycle: Period

    @property
    def end(self) -> None:
        """Return None: the piece holds for ever."""
        return

    @property
    def is_polynomial(self) -> Literal[False]:
        """Return False."""
        return False

    def evaluate(self, ctx: Any, t: Any, order: int = 0) -> Any:
        """Evaluate the piece, or a derivative, as `PolynomialPiece.evaluate` does."""
        total = ctx.mpf(self.mean) if order == 0 else ctx.mpf(0)
        omega = self.cycle.frequency(ctx)
        for k, c, s in self.harmonics:
            rate = k * omega
            cos, sin = ctx.cos_sin(rate * t)
            if order == 1:
                cos, sin = -rate * sin, rate * cos
            elif order == 2:
                cos, sin = -rate * rate * cos, -rate * rate * sin
            if c:
                total += ctx.mpf(c) * cos
            if s:
                total += ctx.mpf(s) * sin
        return total


Piece = ConstantPiece | PolynomialPiece | TrigonometricPiece
