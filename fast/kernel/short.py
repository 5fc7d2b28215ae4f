"""Places a short time after an event, as sums of two floats, for the loops of the lanes."""

from __future__ import annotations

from fast.kernel.arithmetic import two_product, two_sum
from fast.kernel.compiling import kernel


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
