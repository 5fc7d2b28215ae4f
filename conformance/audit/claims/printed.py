"""Printed numbers, digit by digit."""

from __future__ import annotations

from decimal import ROUND_HALF_EVEN, Decimal
from typing import Any

import mpmath


def rounds_to(printed: str, value: Any) -> bool:
    """Tell whether a number, rounded to as many decimals as were printed, is the printed one."""
    number = Decimal(printed)
    exact = Decimal(mpmath.nstr(mpmath.mpf(value), 30, min_fixed=-mpmath.inf, max_fixed=mpmath.inf))
    return exact.quantize(Decimal(1).scaleb(_exponent(number)), ROUND_HALF_EVEN) == number


def half_unit(printed: str) -> float:
    """Return half a unit of the last printed digit."""
    return 0.5 * 10.0 ** _exponent(Decimal(printed))


def _exponent(number: Decimal) -> int:
    exponent = number.as_tuple().exponent
    assert isinstance(exponent, int)
    return exponent
