"""A mushroom's parameters as fast analytic functions of time, with their rates, and the time of a mouth.

The same functions as `scene.laws.evaluate` gives, in gmpy2's numbers, ten times as fast as mpmath's, with one
sine and cosine for all laws and harmonics: a cycle inverts nu(t) and takes volumes thousands of times. It is
inverted in closed form where parameters are parabolas, else from a solution in binary64.
"""

from __future__ import annotations

import cmath
from collections.abc import Callable
from fractions import Fraction
from itertools import zip_longest
from typing import Any

import gmpy2
from mpmath import fp

from scene.exact import leg_polynomial
from scene.laws import Fourier, Law, Piece, Quadratic, exact, frequency, piece_at
from scene.mouth import mouth_factors
from scene.tables import Mushroom, laws
from theory.critical import quadratic_roots, solve_rising
from theory.precision import Binary
from theory.volumes import Volumes, volumes_of

# From t and exp(i omega t) to the law's value and rate.
Parameter = Callable[[Any, Any], tuple[Any, Any]]
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
        waves = [piece for piece in pieces.values() if isinstance(piece, Fourier)]
        mouth = (pieces["nu"], 1.0) if "nu" in pieces else (pieces["w"], pieces["r"])
        self._is_wavy = any(isinstance(piece, Fourier) for piece in mouth)
        with self.binary.working():
            # Laws that move share one period.
            self._omega = frequency(self.binary, waves[0]) if waves else None
            self._parameters = {name: _parameter(self.binary, piece) for name, piece in pieces.items()}
            self._near: Inverse = (
                _inverse_of_waves(self.binary, *mouth)
                if self._is_wavy
                else _inverse_of_parabolas(self.binary, *mouth_factors(scene), time)
            )

    def nu(self, t: Any) -> tuple[Any, Any]:
        """Return the mouth w / r at time t, and its rate. Source: Eq:nu, eq:dnu."""
        with self.binary.working():
            nu, rate = self.mouth(self.binary.taken(t))
            return self.binary.given(nu), self.binary.given(rate)

    def volumes(self, t: Any, nu: Any) -> Volumes:
        """Return the volumes at time t, where the mouth is nu."""
        with self.binary.working():
            found = [self.binary.given(x) for x in self._of(self.binary.taken(t), "r", "h", "slope")]
        return volumes_of(self.ctx, found[0], nu, *found[1:])

    def mouth(self, t: Any) -> tuple[Any, Any]:
        """Return `nu` in binary numbers."""
        turn = self._turn(t)
        if "nu" in self._parameters:
            return self._parameters["nu"](t, turn)
        (w, w_rate), (r, r_rate) = (self._parameters[name](t, turn) for name in ("w", "r"))
        return w / r, (w_rate * r - w * r_rate) / (r * r)

    def stem_share(self, t: Any, nu: Any) -> Any:
        """Return V_stem / V_cap at time t in binary numbers, where the mouth is nu. Source: Eq:Vcap."""
        r, h, slope = self._of(t, "r", "h", "slope")
        return 2 * h * (2 * nu * r - h * slope) / (self.binary.pi * r * r)

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

    def _of(self, t: Any, *names: str) -> list[Any]:
        turn = self._turn(t)
        return [self._parameters[name](t, turn)[0] for name in names]

    def _turn(self, t: Any) -> Any:
        if self._omega is None:
            return None
        sin, cos = gmpy2.sin_cos(self._omega * t)
        return gmpy2.mpc(cos, sin)


def _parameter(binary: Binary, piece: Piece) -> Parameter:
    if isinstance(piece, Quadratic):
        origin, c0, c1, c2 = (exact(binary, number) for number in piece[:4])

        def parabola(t: Any, _: Any) -> tuple[Any, Any]:
            x = t - origin
            return c0 + x * (c1 + x * c2), c1 + 2 * x * c2

        return parabola
    if isinstance(piece, Fourier):
        return _wave(piece, frequency(binary, piece), gmpy2.mpc)
    constant = binary.mpf(piece), binary.zero
    return lambda t, turn: constant


def _wave(law: Fourier, omega: Any, number: Callable[[float, float], Any]) -> Parameter:
    """Sum a wave by Horner's scheme, in complex numbers that `number` makes of two real ones."""
    amplitudes = {k: number(c, -s) for k, c, s in law.harmonics()}
    zero = number(0.0, 0.0)
    terms = [(amplitudes.get(k, zero), k * amplitudes.get(k, zero)) for k in range(max(amplitudes), 0, -1)]

    def wave(_: Any, turn: Any) -> tuple[Any, Any]:
        value = rate = zero
        for a, k_a in terms:
            value, rate = value * turn + a, rate * turn + k_a
        return law.mean + (value * turn).real, -omega * (rate * turn).imag

    return wave


def _inverse_of_parabolas(binary: Binary, width: Law, radius: Law, time: Fraction) -> Inverse:
    """Invert w / r of the parabolas or constants that two laws are near a time: a quadratic equation."""
    powers = [[exact(binary, c) for c in leg_polynomial(law, time)] for law in (width, radius)]
    base = exact(binary, time)

    def inverse(nu: Any, low: Any, high: Any) -> Any:
        found = quadratic_roots(binary, *(w - nu * r for w, r in zip_longest(*powers, fillvalue=0)))
        return next((base + x for x in found if low < base + x < high), None)

    return inverse


def _inverse_of_waves(binary: Binary, width: Piece, radius: Piece) -> Inverse:
    """Invert w / r of waves or constants in binary64."""
    known = [_in_floats(piece) for piece in (width, radius)]

    def inverse(nu: Any, low: Any, high: Any) -> Any:
        level, start, end = float(nu), float(low), float(high)

        def excess(t: float) -> tuple[float, float]:
            (w, w_rate), (r, r_rate) = (law(t) for law in known)
            return w / r - level, (w_rate * r - w * r_rate) / (r * r)

        sign = 1.0 if excess(start)[0] < excess(end)[0] else -1.0
        return binary.mpf(solve_rising(fp, lambda t: [sign * x for x in excess(t)], start, end))

    return inverse


def _in_floats(piece: Piece) -> Callable[[float], tuple[float, float]]:
    if not isinstance(piece, Fourier):
        assert isinstance(piece, float)
        return lambda t: (piece, 0.0)
    omega = float(frequency(fp, piece))
    wave = _wave(piece, omega, complex)
    return lambda t: wave(t, cmath.exp(1j * omega * t))
