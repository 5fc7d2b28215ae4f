"""A mushroom's parameters as fast analytic functions of time, with their rates, and the time of a mouth.

The same functions as `scene.laws.evaluate` gives, in gmpy2's numbers, ten times as fast as mpmath's, with one
sine and cosine for all laws and harmonics: a cycle inverts nu(t) and takes volumes thousands of times. It is
inverted in closed form where parameters are parabolas, else from a solution in binary64.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from fractions import Fraction
from itertools import zip_longest
from typing import Any, NamedTuple

from mpmath import fp

from scene.exact import leg_polynomial
from scene.laws import Fourier, Law, Piece, Quadratic, exact, frequency, piece_at
from scene.mouth import mouth_factors
from scene.tables import Mushroom, laws
from theory.critical import quadratic_roots, solve_rising
from theory.precision import Binary


class Parameter(NamedTuple):
    """A law as two functions of t and exp(i omega t)."""

    value: Callable[[Any, Any], Any]
    rate: Callable[[Any, Any], Any]


# From nu and a bracket to the time in it at which the mouth is nu, about; None where none is found.
Inverse = Callable[[Any, Any, Any], Any]


class MovingMushroom:
    """The table in motion, valid on the span of time on which its laws keep their pieces.

    Attributes:
        ctx: mpmath's number system, in which questions are asked and answered.
        binary: that in which they are worked out.
    """

    def __init__(self, ctx: Any, scene: Mushroom, time: Fraction) -> None:
        self.ctx, self.binary = ctx, Binary(ctx)
        pieces = {name: piece_at(law, time) for name, law in laws(scene).items()}
        mouth = (pieces["nu"], 1.0) if "nu" in pieces else (pieces["w"], pieces["r"])
        self._is_wavy = any(isinstance(piece, Fourier) for piece in mouth)
        with self.binary.working():
            self._turn = _turning(self.binary, pieces.values())
            self._parameters = {name: _parameter(self.binary, piece) for name, piece in pieces.items()}
            self._half, self._4_by_pi = self.binary.one / 2, 4 / self.binary.pi
            self.mouth = _mouth(self.binary, mouth)
            self._near: Inverse = (
                _inverse_of_waves(self.binary, mouth)
                if self._is_wavy
                else _inverse_of_parabolas(self.binary, *mouth_factors(scene), time)
            )

    def nu(self, t: Any) -> tuple[Any, Any]:
        """Return the mouth w / r at time t, and its rate. Source: Eq:nu, eq:dnu."""
        with self.binary.working():
            nu, rate = self.mouth(self.binary.taken(t))
            return self.binary.given(nu), self.binary.given(rate)

    def stem_share(self, t: Any, nu: Any) -> Any:
        """Return V_stem / V_cap at time t in binary numbers, where the mouth is nu. Source: Eq:Vcap."""
        turn = self._turn(t)
        r, h, slope = (self._parameters[name].value(t, turn) for name in ("r", "h", "slope"))
        depth = h / r
        return self._4_by_pi * depth * (nu - self._half * depth * slope)

    def time(self, nu: Any, low: Any, high: Any, is_falling: bool) -> Any:
        """Return the time in [low, high] at which a mouth that falls, or rises, is nu; in binary numbers."""
        near = self._near(nu, low, high)
        if near is not None and not self._is_wavy:
            return near
        sign = -1 if is_falling else 1

        def rising(t: Any) -> tuple[Any, Any]:
            value, rate = self.mouth(t)
            return sign * (value - nu), sign * rate

        return solve_rising(self.binary, rising, low, high, near)


def _turning(system: Any, pieces: Iterable[Piece]) -> Callable[[Any], Any]:
    """Return exp(i omega t) as a function of t; laws that move share one omega."""
    waves = [piece for piece in pieces if isinstance(piece, Fourier)]
    if not waves:
        return lambda t: None
    omega = frequency(system, waves[0])
    return lambda t: system.expj(omega * t)


def _mouth(system: Any, pieces: tuple[Piece, Piece]) -> Callable[[Any], tuple[Any, Any]]:
    """Return w / r and its rate as a function of t, from the pieces of w and r."""
    turning, (width, radius) = _turning(system, pieces), (_parameter(system, piece) for piece in pieces)

    def mouth(t: Any) -> tuple[Any, Any]:
        turn = turning(t)
        w, r = width.value(t, turn), radius.value(t, turn)
        return w / r, (width.rate(t, turn) * r - w * radius.rate(t, turn)) / (r * r)

    return mouth


def _parameter(system: Any, piece: Piece) -> Parameter:
    if isinstance(piece, Quadratic):
        origin, c0, c2 = (exact(system, number) for number in piece[:3])
        twice = 2 * c2

        def value(t: Any, _: Any) -> Any:
            x = t - origin
            return c0 + x * (x * c2)

        return Parameter(value, lambda t, _: (t - origin) * twice)
    if isinstance(piece, Fourier):
        return _wave(system, piece)
    constant, zero = system.mpf(piece), system.zero
    return Parameter(lambda t, turn: constant, lambda t, turn: zero)


def _wave(system: Any, law: Fourier) -> Parameter:
    """Sum a wave by Horner's scheme in complex numbers."""
    omega, zero = frequency(system, law), system.mpc(0.0, 0.0)
    amplitudes = {k: system.mpc(c, -s) for k, c, s in law.harmonics()}
    terms = [amplitudes.get(k, zero) for k in range(max(amplitudes), 0, -1)]
    slopes = [k * amplitudes.get(k, zero) for k in range(max(amplitudes), 0, -1)]

    def total(coefficients: list[Any], turn: Any) -> Any:
        found = zero
        for a in coefficients:
            found = (found + a) * turn
        return found

    return Parameter(
        lambda t, turn: law.mean + total(terms, turn).real, lambda t, turn: -omega * total(slopes, turn).imag
    )


def _inverse_of_parabolas(binary: Binary, width: Law, radius: Law, time: Fraction) -> Inverse:
    """Invert w / r of the parabolas or constants that two laws are near a time: a quadratic equation."""
    powers = [[exact(binary, c) for c in leg_polynomial(law, time)] for law in (width, radius)]
    pairs, base = list(zip_longest(*powers, fillvalue=binary.zero)), exact(binary, time)

    def inverse(nu: Any, low: Any, high: Any) -> Any:
        roots = quadratic_roots(binary, *[w - nu * r for w, r in pairs])
        return next((base + root for root in roots if low < base + root < high), None)

    return inverse


def _inverse_of_waves(binary: Binary, pieces: tuple[Piece, Piece]) -> Inverse:
    """Invert w / r of waves and constants in binary64."""
    mouth = _mouth(fp, pieces)

    def inverse(nu: Any, low: Any, high: Any) -> Any:
        level, start, end = float(nu), float(low), float(high)
        sign = 1.0 if mouth(start)[0] < mouth(end)[0] else -1.0

        def rising(t: float) -> tuple[float, float]:
            value, rate = mouth(t)
            return sign * (value - level), sign * rate

        return binary.mpf(solve_rising(fp, rising, start, end))

    return inverse
