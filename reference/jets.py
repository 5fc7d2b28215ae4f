"""A function with its first two derivatives, each enclosed over an interval of time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from reference.arithmetic import Arithmetic, Interval


class Jet(NamedTuple):
    """Value and first two derivatives by s; None for a derivative that is 0 identically."""

    f: Interval
    d1: Interval | None
    d2: Interval | None


def _sum(a: Interval | None, b: Interval | None) -> Interval | None:
    if a is None or b is None:
        return b if a is None else a
    return a + b


def _twice(x: Interval) -> Interval:
    return x + x  # exact, and no 2 is to be enclosed


def add(p: Jet, q: Jet) -> Jet:
    """Return p + q."""
    return Jet(p.f + q.f, _sum(p.d1, q.d1), _sum(p.d2, q.d2))


def negative(p: Jet) -> Jet:
    """Return -p."""
    return Jet(-p.f, None if p.d1 is None else -p.d1, None if p.d2 is None else -p.d2)


def multiply(p: Jet, q: Jet) -> Jet:
    """Return p q."""
    d1 = d2 = None
    if p.d1 is not None:
        d1 = p.d1 * q.f
    if q.d1 is not None:
        d1 = _sum(d1, p.f * q.d1)
        d2 = None if p.d1 is None else _twice(p.d1 * q.d1)
    if p.d2 is not None:
        d2 = _sum(d2, p.d2 * q.f)
    if q.d2 is not None:
        d2 = _sum(d2, p.f * q.d2)
    return Jet(p.f * q.f, d1, d2)


def square(arithmetic: Arithmetic, p: Jet) -> Jet:
    """Return p^2, with f and d1^2 as true squares."""
    if p.d1 is None:
        return Jet(arithmetic.square(p.f), None, None)
    d2 = arithmetic.square(p.d1)
    if p.d2 is not None:
        d2 = d2 + p.f * p.d2
    return Jet(arithmetic.square(p.f), _twice(p.f * p.d1), _twice(d2))


def united(arithmetic: Arithmetic, jets: Sequence[Jet]) -> Jet:
    """Enclose whichever of some functions holds."""

    def union(parts: Sequence[Interval | None]) -> Interval | None:
        if all(part is None for part in parts):
            return None
        return arithmetic.union([arithmetic.zero if part is None else part for part in parts])

    return Jet(
        arithmetic.union([jet.f for jet in jets]),
        union([jet.d1 for jet in jets]),
        union([jet.d2 for jet in jets]),
    )
