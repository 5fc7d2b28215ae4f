"""Double-double arithmetic in compiled code: numbers as pairs of floats, about 31 decimals.

A pair (high, low) stands for the sum high + low, |low| at most half a unit in the last place of high. Each
operation is right to a few units of 2^-104; no fastmath, no libm.
"""

from __future__ import annotations

from fractions import Fraction
from math import factorial

import numpy as np
from mpmath import MPContext

from fast.kernel.arithmetic import MAX_QUADRANT, TWO_OVER_PI, multiplied, two_product, two_sum
from fast.kernel.compiling import kernel

N_TERMS = 15  # of a series for an angle up to pi/4: to 2^-106


def _parts(number: Fraction, n: int) -> list[float]:
    """Split a number into n floats, each the nearest to what is left."""
    found = []
    for _ in range(n):
        found.append(float(number))
        number -= Fraction(found[-1])
    return found


def half_pi() -> Fraction:
    """Return pi / 2 to 300 bits."""
    ctx = MPContext()
    ctx.prec = 300
    return Fraction(*map(int, (ctx.pi / 2).as_integer_ratio()))


HALF_PI = np.array(_parts(half_pi(), 4))
# 1 / n! with the series' signs: of sin in odd rows, of cos in even ones.
TERMS = np.array([_parts(Fraction((-1) ** (n // 2), factorial(n)), 2) for n in range(2 * N_TERMS)])


@kernel
def add(a, b):
    """Return a + b; right relative to the sum even where a and b cancel."""
    s, e = two_sum(a[0], b[0])
    t, f = two_sum(a[1], b[1])
    s, e = two_sum(s, e + t)
    return two_sum(s, e + f)


@kernel
def sub(a, b):
    """Return a - b."""
    return add(a, (-b[0], -b[1]))


@kernel
def mul(a, b):
    """Return a b."""
    return multiplied(a[0], a[1], b[0], b[1])


@kernel
def times(factor, a):
    """Return a float times a pair."""
    return multiplied(factor, 0.0, a[0], a[1])


@kernel
def div(a, b):
    """Return a / b."""
    q = a[0] / b[0]
    rest = sub(a, times(q, b))
    q2 = rest[0] / b[0]
    rest = sub(rest, times(q2, b))
    return add(two_sum(q, q2), (rest[0] / b[0], 0.0))


@kernel
def series(r, z, first):
    """Return the sine's (first = 1) or the cosine's (first = 0) series at r, z = r r."""
    total = (TERMS[2 * N_TERMS - 2 + first, 0], TERMS[2 * N_TERMS - 2 + first, 1])
    for j in range(N_TERMS - 2, -1, -1):
        n = 2 * j + first
        total = add(mul(total, z), (TERMS[n, 0], TERMS[n, 1]))
    return mul(total, r) if first else total


@kernel
def sine_cosine(angle):
    """Return sine and cosine of a pair, and whether it is in reach (2^27 quarter turns)."""
    n = np.floor(angle[0] * TWO_OVER_PI + 0.5)
    r = angle
    for k in range(4):
        r = add(r, two_product(-n, HALF_PI[k]))
    z = mul(r, r)
    sine, cosine = series(r, z, 1), series(r, z, 0)
    quarter = n - 4.0 * np.floor(0.25 * n)
    if quarter == 1.0 or quarter == 3.0:
        sine, cosine = cosine, (-sine[0], -sine[1])
    if quarter >= 2.0:
        sine, cosine = (-sine[0], -sine[1]), (-cosine[0], -cosine[1])
    return sine, cosine, abs(n) < MAX_QUADRANT
