"""Checks of a law's numbers before the law exists, and of the times at which a law is evaluated.

Each function returns the number as the law stores it, or raises `InvalidScene` with one line.
"""

from __future__ import annotations

import itertools
import math
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from scene.refusal import BadInput, InvalidScene, check_number, listed, shown

MAX_HARMONICS = 16  # validity is decided by exact algebra, whose cost grows steeply with the degree
MAX_KNOTS = 256


def finite_times(t: object) -> NDArray[np.float64]:
    """Return times as an array.

    Raises:
        BadInput: a time is not a finite number.
    """
    try:
        times = np.asarray(t, np.float64)
    except (TypeError, ValueError):
        raise BadInput(f"t = {shown(t)}, must be finite numbers") from None
    if not np.isfinite(times).all():
        raise BadInput(f"t = {times[~np.isfinite(times)][0]}, must be finite")
    return times


def amplitudes(field: str, numbers: object) -> tuple[float, ...]:
    """Return a Fourier law's amplitudes.

    Raises:
        InvalidScene: they are not a list of finite numbers, or too many.
    """
    numbers = listed(numbers)
    if not isinstance(numbers, tuple | list):
        raise InvalidScene(f"{field} = {shown(numbers)}, must be a list of numbers")
    if len(numbers) > MAX_HARMONICS:
        raise InvalidScene(f"{field} has {len(numbers)} harmonics, at most {MAX_HARMONICS} are allowed")
    return tuple(check_number(f"{field}[{k}]", number, InvalidScene) for k, number in enumerate(numbers))


def checked_knot(i: int, knot: object) -> tuple[float, float]:
    """Return a bang-bang law's knot number i.

    Raises:
        InvalidScene: it is not a pair of finite numbers.
    """
    knot = listed(knot)
    if not (isinstance(knot, tuple | list) and len(knot) == 2):
        raise InvalidScene(f"bang-bang.knots[{i}] = {shown(knot)}, must be a pair [time, value]")
    time, value = knot
    return (
        check_number(f"bang-bang.knots[{i}] time", time, InvalidScene),
        check_number(f"bang-bang.knots[{i}] value", value, InvalidScene),
    )


def check_legs(knots: tuple[tuple[float, float], ...]) -> None:
    """Refuse knots whose times do not increase, that do not close, or whose span is not a binary64 number.

    Raises:
        InvalidScene: naming the knot, the value and the bound.
    """
    for i, ((before, _), (after, _)) in enumerate(itertools.pairwise(knots), 1):
        if after <= before:
            raise InvalidScene(f"bang-bang.knots[{i}] time = {after}, must be > {before}")
    (start, first), (end, last) = knots[0], knots[-1]
    if last != first:
        raise InvalidScene(
            f"bang-bang.knots[{len(knots) - 1}] value = {last}, must equal the first ({first}): no jumps"
        )
    span = end - start
    if not math.isfinite(span) or Fraction(span) != Fraction(end) - Fraction(start):
        raise InvalidScene(f"bang-bang.knots span {start} to {end}: the period must be a binary64 number")
