"""Rationals, balls, the working precision, and functions with their first two derivatives.

A rational (fmpq) is exact; a ball (arb) holds a number that is not rational, or not known exactly. A
comparison of balls is true only when it is certain.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from fractions import Fraction
from typing import Any

import flint
from flint import arb, fmpq

# flint has no type stubs.
Ball = Any  # arb
Rational = Any  # fmpq
Number = Any  # either
Jet = tuple[Number, Number, Number]  # a function and its first two derivatives by time

ZERO = fmpq(0)


@contextmanager
def precision(bits: int) -> Iterator[None]:
    """Work with balls of this many bits, then restore flint's own."""
    before = flint.ctx.prec
    flint.ctx.prec = bits
    try:
        yield
    finally:
        flint.ctx.prec = before


def exact(number: float | Fraction) -> Rational:
    """Return the rational that a binary64 number or a fraction is."""
    return fmpq(*number.as_integer_ratio())


def dyadic(text: str) -> Rational:
    """Read "m*2^e"."""
    mantissa, exponent = text.split("*2^")
    return fmpq(int(mantissa)) * fmpq(2) ** int(exponent)


def interval(ends: Any) -> tuple[Rational, Rational]:
    """Read an enclosure [lower, upper] of two numbers "m*2^e"."""
    low, high = map(dyadic, ends)
    return low, high


def hull(a: Number, b: Number) -> Ball:
    """Return a ball that holds all numbers between two."""
    return arb(a).union(arb(b))


def rational_ends(number: Number) -> tuple[Rational, Rational]:
    """Return rationals that enclose a number: the number itself when it is one, else the ends of its ball.

    They follow from centre and radius, which are exact: `lower` and `upper` round to the ambient precision.
    """
    if isinstance(number, fmpq):
        return number, number
    centre, radius = number.mid().fmpq(), number.rad().fmpq()
    return centre - radius, centre + radius


def add(p: Jet, q: Jet) -> Jet:
    """Return the jet of a sum."""
    return p[0] + q[0], p[1] + q[1], p[2] + q[2]


def negative(p: Jet) -> Jet:
    """Return the jet of -p."""
    return -p[0], -p[1], -p[2]


def product(p: Jet, q: Jet) -> Jet:
    """Return the jet of a product."""
    return p[0] * q[0], p[1] * q[0] + p[0] * q[1], p[2] * q[0] + 2 * p[1] * q[1] + p[0] * q[2]


def bisected(
    f: Callable[[Rational], Number], low: Rational, high: Rational, n_halvings: int
) -> tuple[Rational, Rational]:
    """Narrow the bracket of a root by the sign of a falling f, as far as its sign is known.

    The root itself may lie half way, where f has no sign; then f has one at a third.
    """
    for _ in range(n_halvings):
        for middle in ((low + high) / 2, (2 * low + high) / 3):
            value = f(middle)
            if value > 0:
                low = middle
            elif value < 0:
                high = middle
            else:
                continue
            break
        else:
            break
    return low, high
