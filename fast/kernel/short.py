"""Places a short time after an event, as sums of two floats, for the loops of the lanes."""

from __future__ import annotations

from fast.kernel.arithmetic import two_product, two_sum
from fast.kernel.compiling import kernel
from fast.kernel.records import Place


@kernel
def moved(x, v, s):
    """Return x + v s as a sum of two floats."""
    p, e = two_product(v, s)
    x_s, low = two_sum(x, p)
    return x_s, low + e


@kernel
def place_after(s, x, y, vx, vy):
    """Return the place a time s after (x, y)."""
    x_s, x_low = moved(x, vx, s)
    y_s, y_low = moved(y, vy, s)
    return Place(x_s, x_low, y_s, y_low)


@kernel
def short_sum(a, b):
    """Return a + b for |b| far below |a|, or a = 0, as a rounded sum and its error."""
    s = a + b
    return s, b - (s - a)
