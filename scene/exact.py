"""Exact algebra: polynomials and numbers of scenes, their roots and signs, in rational arithmetic.

The laws of a scene become polynomials in half angles or in time, and conditions on them are decided
exactly.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import cache
from itertools import pairwise
from math import comb, gcd, lcm

from scene.laws import Law, law_of

POWERS_OF_I = ((1, 0, -1, 0), (0, 1, 0, -1))  # real and imaginary parts of i^0 ... i^3


def leg_intervals(legs: Sequence[Law]) -> list[tuple[Fraction, Fraction]]:
    """Cut the period that laws share at each time at which one of them is not analytic."""
    start = legs[0].breakpoints()[0]
    span = Fraction(0)
    cuts = {start}
    for law in legs:
        times = law.breakpoints()
        span = times[-1] - times[0]
        cuts |= {start + (t - start) % span for t in times}
    return list(pairwise([*sorted(cuts), start + span]))


def leg_polynomial(law: float | Law, start: Fraction) -> Polynomial:
    """Return a law of polynomials in the variable t - start, up to its next breakpoint."""
    piece = law_of(law).piece_at(start)
    assert piece.is_polynomial
    return piece.polynomial(start)


def one_plus_square(n: int) -> Polynomial:
    """Return (1 + x^2)^n."""
    return [Fraction(comb(n, k // 2)) if k % 2 == 0 else Fraction(0) for k in range(2 * n + 1)]


def half_angle(law: float | Law, order: int = 0) -> tuple[Polynomial, int]:
    """Return (N, n) with law = N(x) / (1 + x^2)^n, x = tan(omega t / 2), n its highest harmonic.

    For order 1 it is the law's derivative by omega t. The law must be a sum of waves, or constant.
    """
    law = law_of(law)
    assert law.is_trigonometric
    harmonics = law.harmonics()
    n = max((k for k, _, _ in harmonics), default=0)
    total = scale(one_plus_square(n), Fraction(law.level)) if order == 0 else []
    for k, c, s in harmonics:
        cosine, sine = Fraction(c), Fraction(s)
        if order == 1:
            cosine, sine = k * sine, -k * cosine
        # cos(k a) + i sin(k a) = (1 + i x)^(2 k) / (1 + x^2)^k with x = tan(a / 2).
        cos, sin = (
            [Fraction(comb(2 * k, j) * unit[j % 4]) for j in range(2 * k + 1)]
            for unit in POWERS_OF_I
        )
        wave = add(scale(cos, cosine), scale(sin, sine))
        total = add(total, multiply(wave, one_plus_square(n - k)))
    return total, n


Polynomial = list[Fraction]  # its last number is not 0


def trimmed(p: Polynomial) -> Polynomial:
    """Drop leading zeros."""
    p = list(p)
    while p and p[-1] == 0:
        p.pop()
    return p


def add(p: Polynomial, q: Polynomial) -> Polynomial:
    """Return p + q."""
    n = max(len(p), len(q))
    return trimmed(
        [(p[i] if i < len(p) else Fraction(0)) + (q[i] if i < len(q) else 0) for i in range(n)]
    )


def multiply(p: Polynomial, q: Polynomial) -> Polynomial:
    """Return p q."""
    out = [Fraction(0)] * (len(p) + len(q) - 1)
    for i, a in enumerate(p):
        if a:
            for j, b in enumerate(q):
                out[i + j] += a * b
    return trimmed(out)


def scale(p: Polynomial, factor: Fraction) -> Polynomial:
    """Return factor p."""
    return trimmed([factor * a for a in p])


def derivative(p: Polynomial) -> Polynomial:
    """Return p'."""
    return [k * a for k, a in enumerate(p)][1:]


def at(p: Polynomial, x: Fraction) -> Fraction:
    """Evaluate p at x, exactly: in whole numbers, as fractions would be reduced at every step."""
    common = lcm(*(a.denominator for a in p))
    total = 0
    power = 1
    for a in reversed(p):
        total = total * x.numerator + a.numerator * (common // a.denominator) * power
        power *= x.denominator
    return Fraction(total * x.denominator, common * power)


def _primitive(p: Polynomial) -> Polynomial:
    # A positive multiple with coprime integer coefficients: keeps the chain's numbers small.
    common = lcm(*(a.denominator for a in p))
    integers = [a.numerator * (common // a.denominator) for a in p]
    shared = gcd(*integers)
    return [Fraction(a // shared) for a in integers]


def divide(p: Polynomial, q: Polynomial) -> tuple[Polynomial, Polynomial]:
    """Return quotient and remainder of p by q != 0, each up to a factor, in coprime integers.

    All intermediate numbers are whole, because fractions would be reduced at every step.
    """
    rest, divisor = ([a.numerator for a in _primitive(polynomial)] for polynomial in (p, q))
    quotient = [0] * max(len(rest) - len(divisor) + 1, 0)
    size = abs(divisor[-1])
    sign = 1 if divisor[-1] > 0 else -1
    for shift in reversed(range(len(quotient))):
        factor = sign * rest[shift + len(divisor) - 1]
        rest = [size * a for a in rest]
        quotient = [size * a for a in quotient]
        quotient[shift] = factor
        for i, b in enumerate(divisor):
            rest[shift + i] -= factor * b
    return _primitive(trimmed(list(map(Fraction, quotient)))), _primitive(
        trimmed(list(map(Fraction, rest)))
    )


class Sturm:
    """Counts the distinct real roots of a polynomial in intervals.

    The chain of p and p' ends in their common divisor. Divided by it, its first part has each root
    of p once.
    """

    def __init__(self, p: Polynomial) -> None:
        self.p = p
        chain = [p, derivative(p)]
        while chain[-1]:
            chain.append(scale(divide(chain[-2], chain[-1])[1], Fraction(-1)))
        self.chain = [divide(part, chain[-2])[0] for part in chain[:-1]]
        self.root_free_of_squares = self.chain[0]
        self._variations = cache(
            self._count_variations
        )  # intervals that are halved share their ends

    def _count_variations(self, x: Fraction) -> int:
        signs = [v > 0 for v in (at(q, x) for q in self.chain) if v != 0]
        return sum(a != b for a, b in pairwise(signs))

    def n_roots(self, a: Fraction, b: Fraction) -> int:
        """Count the distinct roots in the open interval (a, b)."""
        return self._variations(a) - self._variations(b) - (at(self.p, b) == 0)


def negative_point(p: Polynomial, a: Fraction, b: Fraction) -> Fraction | None:
    """Return a point of [a, b] at which p < 0, or None when there is none (proof)."""
    if not p:
        return None
    sturm = Sturm(p)
    todo = [(a, b)]
    while todo:
        left, right = todo.pop()
        middle = (left + right) / 2
        for x in (left, right, middle):
            if at(p, x) < 0:
                return x
        n = sturm.n_roots(left, right)
        # No root inside: one sign. One root between two positive ends: it does not change sign.
        if n == 0 or (n == 1 and at(p, left) > 0 and at(p, right) > 0):
            continue
        todo += [(middle, right), (left, middle)]
    return None


def vanishes(p: Polynomial, a: Fraction, b: Fraction) -> bool:
    """Tell whether p has a root in the closed interval [a, b]."""
    return not p or at(p, a) == 0 or at(p, b) == 0 or Sturm(p).n_roots(a, b) > 0


def root_bound(p: Polynomial) -> Fraction:
    """Return a bound on |x| over all roots (Cauchy)."""
    return 1 + max((abs(a / p[-1]) for a in p[:-1]), default=Fraction(0))
