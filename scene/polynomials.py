"""Laws as polynomials with rational coefficients, from which signs and roots are decided exactly.

On a bang-bang leg a law is a polynomial in time. Over the period of a Fourier law the substitution
x = tan(omega t / 2) makes it a polynomial in x over a power of 1 + x^2.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise
from math import comb

from scene import exact
from scene.laws import BangBang, Fourier, Law, Quadratic, breakpoints, piece_at

POWERS_OF_I = ((1, 0, -1, 0), (0, 1, 0, -1))  # real and imaginary parts of i^0 ... i^3


def leg_intervals(legs: Sequence[BangBang]) -> list[tuple[Fraction, Fraction]]:
    """Cut one period, shared by these laws, at every time at which one of them is not analytic."""
    start, span = Fraction(legs[0].knots[0][0]), Fraction(0)
    cuts = {start}
    for law in legs:
        times = breakpoints(law)
        span = times[-1] - times[0]
        cuts |= {start + (t - start) % span for t in times}
    return list(pairwise([*sorted(cuts), start + span]))


def leg_polynomial(law: Law, start: Fraction) -> exact.Polynomial:
    """Return a constant or a bang-bang law in the variable t - start, right until its next half leg."""
    piece = piece_at(law, start)
    if isinstance(piece, Quadratic):
        d = start - piece.origin
        c0, c1, c2 = piece.c0, piece.c1, piece.c2
        return exact.trimmed([c0 + d * (c1 + d * c2), c1 + 2 * c2 * d, c2])
    assert isinstance(piece, float)
    return exact.trimmed([Fraction(piece)])


def one_plus_square(n: int) -> exact.Polynomial:
    """Return (1 + x^2)^n."""
    return [Fraction(comb(n, k // 2)) if k % 2 == 0 else Fraction(0) for k in range(2 * n + 1)]


def half_angle(law: Law, order: int = 0) -> tuple[exact.Polynomial, int]:
    """Return (N, n) with law = N(x) / (1 + x^2)^n, x = tan(omega t / 2), n its highest harmonic.

    For order 1 it is the law's derivative by omega t. A bang-bang law must be constant.
    """
    if not isinstance(law, Fourier):
        level = law.knots[0][1] if isinstance(law, BangBang) else law
        return exact.trimmed([Fraction(level)] if order == 0 else []), 0
    harmonics = law.harmonics()
    n = max((k for k, _, _ in harmonics), default=0)
    total = exact.scale(one_plus_square(n), Fraction(law.mean)) if order == 0 else []
    for k, c, s in harmonics:
        cosine, sine = Fraction(c), Fraction(s)
        if order == 1:
            cosine, sine = k * sine, -k * cosine
        # cos(k a) + i sin(k a) = (1 + i x)^(2 k) / (1 + x^2)^k with x = tan(a / 2).
        cos, sin = (
            [Fraction(comb(2 * k, j) * unit[j % 4]) for j in range(2 * k + 1)] for unit in POWERS_OF_I
        )
        wave = exact.add(exact.scale(cos, cosine), exact.scale(sin, sine))
        total = exact.add(total, exact.multiply(wave, one_plus_square(n - k)))
    return total, n
