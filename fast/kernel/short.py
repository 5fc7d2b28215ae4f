"""Laws and places a short time after a reference, for the loops of the lanes: series and exact sums."""

from __future__ import annotations

from fast.kernel.arithmetic import fma, two_product, two_sum
from fast.kernel.compiling import kernel


@kernel
def turns(omega, s):
    """Return G1(s), G2(s) and cos(omega s) for |omega s| <= 1/4; s, s^2 / 2 and 1 for omega = 0."""
    z = omega * s
    u = z * z
    a = fma(u, -1.0 / 39916800.0, 1.0 / 362880.0)
    a = fma(a, u, -1.0 / 5040.0)
    a = fma(a, u, 1.0 / 120.0)
    a = fma(a, u, -1.0 / 6.0)
    b = fma(u, -1.0 / 479001600.0, 1.0 / 3628800.0)
    b = fma(b, u, -1.0 / 40320.0)
    b = fma(b, u, 1.0 / 720.0)
    b = fma(b, u, -1.0 / 24.0)
    b = fma(b, u, 0.5)
    return fma(s * u, a, s), s * s * b, fma(-u, b, 1.0)


@kernel
def moved(x, v, s):
    """Return x + v s as a sum of two floats."""
    p, e = two_product(v, s)
    x_s, low = two_sum(x, p)
    return x_s, low + e


@kernel
def short_sum(a, b):
    """Return a + b for |b| far below |a|, or a = 0, as a rounded sum and its error."""
    s = a + b
    return s, b - (s - a)


@kernel
def law(f, low, f1, f2, omega, g1, g2, g0):
    """Return a law and its two derivatives, from its values at the reference time."""
    return f + (low + fma(f1, g1, f2 * g2)), fma(f1, g0, f2 * g1), fma(f2, g0, -(omega * omega * f1) * g1)
