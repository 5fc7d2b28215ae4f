"""A mushroom's parameters as fast analytic functions of time, with their rates.

The same functions as `scene.laws.evaluate` gives, with the constants converted once and one
sine and cosine for all laws and harmonics: inverting nu(t) thousands of times needs that.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Any

from mpmath.libmp import to_fixed

from scene.laws import Fourier, Piece, Quadratic, exact, frequency, piece_at
from scene.tables import Mushroom, laws
from theory.volumes import Volumes, volumes_of

SPARE_BITS = 24  # of whole numbers: sixteen harmonics, each a product with the one before, lose a few

# From t and (cos, sin) of omega t to the law's value and rate.
Parameter = Callable[[Any, Any], tuple[Any, Any]]


class MovingMushroom:
    """The table in motion, valid on the span of time on which its laws keep their pieces."""

    def __init__(self, ctx: Any, scene: Mushroom, time: Fraction) -> None:
        self.ctx = ctx
        pieces = {name: piece_at(law, time) for name, law in laws(scene).items()}
        waves = [piece for piece in pieces.values() if isinstance(piece, Fourier)]
        self._omega = frequency(ctx, waves[0]) if waves else None  # laws that move share one period
        self._parameters = {name: _parameter(ctx, piece) for name, piece in pieces.items()}

    def _at(self, t: Any, *names: str) -> list[tuple[Any, Any]]:
        turn = self.ctx.cos_sin(self._omega * t) if self._omega is not None else None
        return [self._parameters[name](t, turn) for name in names]

    def nu(self, t: Any) -> tuple[Any, Any]:
        """Return the mouth w / r at time t, and its rate. Source: Eq:nu, eq:dnu."""
        if "nu" in self._parameters:
            return self._at(t, "nu")[0]
        (w, w_rate), (r, r_rate) = self._at(t, "w", "r")
        return w / r, (w_rate * r - w * r_rate) / (r * r)

    def volumes(self, t: Any, nu: Any, known: tuple[Any, Any] | None = None) -> Volumes:
        """Return the volumes at time t, where the mouth is nu; known: its `theory.volumes.shares`."""
        (r, _), (h, _), (slope, _) = self._at(t, "r", "h", "slope")
        return volumes_of(self.ctx, r, nu, h, slope, known)


def _parameter(ctx: Any, piece: Piece) -> Parameter:
    if isinstance(piece, Quadratic):
        return _parabola(ctx, piece)
    if isinstance(piece, Fourier):
        return _wave(ctx, piece)
    constant = ctx.mpf(piece), ctx.zero
    return lambda t, turn: constant


def _parabola(ctx: Any, piece: Quadratic) -> Parameter:
    origin, c0, c1, c2 = (exact(ctx, number) for number in piece[:4])

    def parabola(t: Any, turn: Any) -> tuple[Any, Any]:
        x = t - origin
        return c0 + x * (c1 + x * c2), c1 + 2 * x * c2

    return parabola


def _wave(ctx: Any, law: Fourier) -> Parameter:
    """Return a Fourier law, its harmonics summed in whole numbers of 2^-bits of the largest amplitude.

    That is as exact as sums of floating point numbers, whose rounding is of the largest term's last bit
    too, and takes a third of the time.
    """
    mean, omega = ctx.mpf(law.mean), frequency(ctx, law)
    amplitudes = {k: (Fraction(c), Fraction(s)) for k, c, s in law.harmonics()}
    last, largest = max(amplitudes), max(abs(x) for pair in amplitudes.values() for x in pair)
    exponent = largest.numerator.bit_length() - largest.denominator.bit_length() + 1
    known: dict[int, list[tuple[int, int]]] = {}

    def whole(bits: int) -> list[tuple[int, int]]:
        unit = Fraction(2) ** (bits - exponent)
        none = (Fraction(0), Fraction(0))
        pairs = (amplitudes.get(k, none) for k in range(1, last + 1))
        return [(round(c * unit), round(s * unit)) for c, s in pairs]

    def wave(t: Any, turn: Any) -> tuple[Any, Any]:
        bits = int(ctx.prec) + SPARE_BITS
        if bits not in known:
            known[bits] = whole(bits)
        cos1, sin1 = (to_fixed(x._mpf_, bits) for x in turn)
        cos, sin, value, rate = cos1, sin1, 0, 0
        for k, (c, s) in enumerate(known[bits], 1):
            if k > 1:
                cos, sin = (cos * cos1 - sin * sin1) >> bits, (sin * cos1 + cos * sin1) >> bits
            value += c * cos + s * sin
            rate += k * (s * cos - c * sin)
        return (
            mean + ctx.ldexp(value, exponent - 2 * bits),
            omega * ctx.ldexp(rate, exponent - 2 * bits),
        )

    return wave
