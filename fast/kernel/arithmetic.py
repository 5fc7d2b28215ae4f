"""Sums, products, sines and cosines in binary64 and in pairs of floats, in compiled code.

No fastmath and no libm: only + - * / sqrt floor and the fused multiply-add, each rounded once as
IEEE 754 says, so all results are the same bits on every machine. The compiler never fuses by
itself; `fma` is written where one rounding is wanted. Phases beyond 2^27 quarter turns are refused.

A pair (high, low) stands for the sum high + low, |low| at most half a unit in the last place of high: about
31 decimals. `add`, `mul`, `div` and the like are right to a few units of 2^-104.
"""

import math
from fractions import Fraction
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types

from fast.kernel.compiling import in_kernels, kept, kernel, packed, part
from fast.kernel.numba_internals import intrinsic
from scene.precision import decimals

SAFETY = 8.0 * 2.0**-53  # eight units in the last place of the summed sizes of a sum's terms
MAX_QUADRANT = 2.0**27
# pi/2 in parts of 26 bits, so that a multiple below 2^27 of each is exact.
PIO2_1 = float.fromhex("0x1.921fb50000000p+0")
PIO2_2 = float.fromhex("0x1.110b460000000p-26")
PIO2_3 = float.fromhex("0x1.1a62630000000p-54")
PIO2_4 = float.fromhex("0x1.8a2e030000000p-81")
# What the rounded fractions lack.
ONE_6TH_LOW, ONE_24TH_LOW, ONE_120TH_LOW = (float(Fraction(1, n) - Fraction(1.0 / n)) for n in (6, 24, 120))
TWO_OVER_PI = 0.6366197723675814


def split(number: Fraction, n: int = 2) -> list[float]:
    """Split a number into n floats, each the nearest to what is left."""
    found = [float(number)]
    while len(found) < n:
        number -= Fraction(found[-1])
        found.append(float(number))
    return found


HALF_PI = Fraction(*map(int, (decimals(90).pi / 2).as_integer_ratio()))  # to some 300 bits


@intrinsic
def _compiled_fma(_context: Any, a: Any, b: Any, c: Any) -> Any:
    def generate(_: Any, builder: ir.IRBuilder, __: Any, arguments: Any) -> Any:
        return builder.fma(*arguments)

    return types.float64(types.float64, types.float64, types.float64), generate


def fma(a: float, b: float, c: float) -> float:
    """Return a b + c, rounded once; in kernels one instruction."""
    rough = a * b + c
    if not np.isfinite(rough):
        return rough
    exact = Fraction(float(a)) * Fraction(float(b)) + Fraction(float(c))
    return float(exact) if exact else rough  # a zero with its sign


@in_kernels(fma)
def _fused(a: Any, b: Any, c: Any) -> Any:
    return lambda a, b, c: _compiled_fma(a, b, c)


@kernel
def two_sum(a, b):
    """Return a + b as a rounded sum and its exact error."""
    s = a + b
    z = s - a
    return s, (a - (s - z)) + (b - z)


@kernel
def short_sum(a, b):
    """Return a + b for |b| below |a|, or a = 0, as a rounded sum and its error."""
    s = a + b
    return s, b - (s - a)


@kernel
def two_product(a, b):
    """Return a b as a rounded product and its exact error."""
    p = a * b
    return p, fma(a, b, -p)


@kernel
def mul(a, b):
    """Return a b, of pairs."""
    p, e = two_product(a[0], b[0])
    return two_sum(p, e + (a[0] * b[1] + a[1] * b[0]))


@packed
def products(a, a_low, b, b_low, c, c_low, d, d_low):
    """Return (a + a_low) (b + b_low) + (c + c_low) (d + d_low) as a sum of two floats."""
    p, e = two_product(a, b)
    q, f = two_product(c, d)
    s, low = two_sum(p, q)
    return s, low + (e + f + (fma(a, b_low, a_low * b) + fma(c, d_low, c_low * d)))


@packed
def quotient(a, a_low, b, b_low):
    """Return (a + a_low) / (b + b_low) as a sum of two floats."""
    inverse = 1.0 / b
    q = a * inverse
    return q, (fma(-q, b, a) + (a_low - q * b_low)) * inverse


@kernel
def dot(a, b, c, d):
    """Return a b + c d, right to a unit in the last place or so even where the two cancel."""
    p = c * d
    return fma(a, b, p) + fma(c, d, -p)


@kernel
def reduced(omega, omega_low, k, t_hi, t_lo):
    """Return k (omega + omega_low) (t_hi + t_lo) as quarter turns n and a rest r + tail, |r| <= pi/4."""
    p, e = two_product(omega, t_hi)
    e += omega * t_lo + omega_low * t_hi
    q, f = two_product(k, p)
    f += k * e
    n = np.floor(q * TWO_OVER_PI + 0.5)
    r = q - n * PIO2_1
    r, e1 = two_sum(r, -n * PIO2_2)
    r, e2 = two_sum(r, -n * PIO2_3)
    r, tail = two_sum(r, (e1 + e2) - n * PIO2_4 + f)
    return n, r, tail


def _series(first: int, last: int) -> tuple[float, ...]:
    """Return the coefficients of the sine's or the cosine's series, from a power down to another."""
    return tuple((-1) ** (n // 2) / math.factorial(n) for n in range(first, last - 1, -2))


SINE_FROM_3, COSINE_FROM_4 = _series(17, 3), _series(16, 4)
SINE_FROM_7, COSINE_FROM_6 = _series(19, 7), _series(18, 6)


@packed
def polynomial(z, coefficients):
    """Return the polynomial whose coefficients are given, that of the highest power first, at least two."""
    total = coefficients[0]
    for coefficient in coefficients[1:]:
        total = fma(total, z, coefficient)
    return total


@kernel
def beyond_first_order(r):
    """Return sin r - r and cos r - 1 for |r| <= pi/4, by their Taylor series to r^17."""
    z = r * r
    s, c = polynomial(z, SINE_FROM_3), polynomial(z, COSINE_FROM_4)
    return r * z * s, fma(z * z, c, -0.5 * z)


@part
def short_sine_cosine(r, tail):
    """Return sin and cos of r + tail for |r| <= pi/4, each as a sum of two floats, right to 2^-64.

    The Taylor series to r^19, whose first terms are sums of two floats.
    """
    z, z_low = two_product(r, r)
    p, p_low = two_sum(1.0 / 120.0, polynomial(z, SINE_FROM_7) * z)
    p, p_low = mul((p, p_low + ONE_120TH_LOW), (z, z_low))
    p, e = two_sum(-1.0 / 6.0, p)
    p, p_low = mul((p, p_low + (e - ONE_6TH_LOW)), (z, z_low))
    p, p_low = mul((p, p_low), (r, 0.0))
    s, s_low = two_sum(r, p)
    q, q_low = two_sum(1.0 / 24.0, polynomial(z, COSINE_FROM_6) * z)
    q, q_low = mul((q, q_low + ONE_24TH_LOW), (z, z_low))
    q, e = two_sum(-0.5, q)
    q, q_low = mul((q, q_low + e), (z, z_low))
    c, c_low = two_sum(1.0, q)
    return s, s_low + fma(c, tail, p_low), c, c_low + fma(-s, tail, q_low)


@kernel
def turned(n, sine, cosine):
    """Return sin and cos of an angle n quarter turns further."""
    half = np.floor(0.5 * n)
    is_odd = n - 2.0 * half > 0.5
    sign = 1.0 - 2.0 * (half - 2.0 * np.floor(0.5 * half))
    s = sign * (cosine if is_odd else sine)
    c = sign * (-sine if is_odd else cosine)
    return s, c


@kernel
def sine_cosine(omega, omega_low, k, t_hi, t_lo):
    """Return sin and cos of k (omega + omega_low) (t_hi + t_lo), each as two floats, and whether in reach."""
    n, r, tail = reduced(omega, omega_low, k, t_hi, t_lo)
    sine, sine_low, cosine, cosine_low = short_sine_cosine(r, tail)
    s, c = turned(n, sine, cosine)
    s_low, c_low = turned(n, sine_low, cosine_low)
    return s, s_low, c, c_low, abs(n) < MAX_QUADRANT


N_TERMS = 15  # of a series for an angle up to pi/4: to 2^-106


QUARTER_TURN, QUARTER_TURN_LOW = split(HALF_PI)


@kept(error_model="numpy")
def directions(turns):
    """Return (n, 2) unit vectors at whole turns from the x axis; no libm, hence the same everywhere."""
    out = np.empty((turns.shape[0], 2))
    for i in range(turns.shape[0]):
        s, _, c, _, _ = sine_cosine(4.0 * turns[i], 0.0, 1.0, QUARTER_TURN, QUARTER_TURN_LOW)
        out[i, 0], out[i, 1] = c, s
    return out


HALF_PI_PARTS = np.array(split(HALF_PI, 4))
# 1 / n! with the series' signs: of sin in odd rows, of cos in even ones.
TERMS = np.array([split(Fraction((-1) ** (n // 2), math.factorial(n))) for n in range(2 * N_TERMS)])


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
def times(factor, a):
    """Return a float times a pair."""
    return mul((factor, 0.0), a)


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
def fine_sine_cosine(angle):
    """Return sine and cosine of a pair, and whether it is in reach (2^27 quarter turns)."""
    n = np.floor(angle[0] * TWO_OVER_PI + 0.5)
    r = angle
    for k in range(4):
        r = add(r, two_product(-n, HALF_PI_PARTS[k]))
    z = mul(r, r)
    sine, cosine = series(r, z, 1), series(r, z, 0)
    s, c = turned(n, sine[0], cosine[0])
    s_low, c_low = turned(n, sine[1], cosine[1])
    return (s, s_low), (c, c_low), abs(n) < MAX_QUADRANT
