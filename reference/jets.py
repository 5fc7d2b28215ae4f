"""A function with its first two derivatives.

Enclosures over an interval of time, or exact numbers.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

from reference.arithmetic import Arithmetic

Number = Any  # an interval, or a number of `reference.rational`


class Jet(NamedTuple):
    """Value and first two derivatives by s."""

    f: Number
    d1: Number
    d2: Number


def _twice(x: Number) -> Number:
    return x + x  # exact, and no 2 is to be enclosed


def add(p: Jet, q: Jet) -> Jet:
    """Return p + q."""
    return Jet(p.f + q.f, p.d1 + q.d1, p.d2 + q.d2)


def negative(p: Jet) -> Jet:
    """Return -p."""
    return Jet(-p.f, -p.d1, -p.d2)


def multiply(p: Jet, q: Jet) -> Jet:
    """Return p q."""
    return Jet(p.f * q.f, p.d1 * q.f + p.f * q.d1, _twice(p.d1 * q.d1) + p.d2 * q.f + p.f * q.d2)


def square(arithmetic: Arithmetic, p: Jet) -> Jet:
    """Return p^2, with f and d1^2 as true squares."""
    return Jet(
        arithmetic.square(p.f), _twice(p.f * p.d1), _twice(arithmetic.square(p.d1) + p.f * p.d2)
    )


def united(arithmetic: Arithmetic, jets: Sequence[Jet]) -> Jet:
    """Enclose whichever of some functions holds."""
    return Jet(*(arithmetic.union(parts) for parts in zip(*jets, strict=True)))
