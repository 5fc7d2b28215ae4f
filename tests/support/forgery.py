"""Forged certificates: ways to change one that holds, each as a function of the plain data."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Any

Forgery = Callable[[Any], object]


def moved(number: str, shift: float | Fraction) -> str:
    """Add a dyadic rational to "m*2^e"."""
    mantissa, exponent = map(int, number.split("*2^"))
    total = mantissa * Fraction(2) ** exponent + Fraction(shift)
    return f"{total.numerator}*2^{1 - total.denominator.bit_length()}"


def put(*path: Any) -> Forgery:
    """Put the last argument where the keys before it lead."""
    *way, last, value = path
    return lambda claim: _at(claim, way).__setitem__(last, value)


def drop(*path: Any) -> Forgery:
    """Leave out what the keys lead to."""
    *way, last = path
    return lambda claim: _at(claim, way).__delitem__(last)


def shift(by: float | Fraction, *path: Any) -> Forgery:
    """Move what the keys lead to: a number, or both ends of an enclosure."""
    *way, last = path

    def forge(claim: Any) -> None:
        found = _at(claim, way)
        number = found[last]
        is_plain = isinstance(number, float)
        found[last] = (
            number + by
            if is_plain
            else moved(number, by)
            if isinstance(number, str)
            else [moved(end, by) for end in number]
        )

    return forge


def both(*forgeries: Forgery) -> Forgery:
    """Do several things, one after the other."""
    return lambda claim: [forge(claim) for forge in forgeries]


def _at(claim: Any, way: list[Any]) -> Any:
    for key in way:
        claim = claim[key]
    return claim
