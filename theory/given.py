"""Checks of what callers give to the theory's public entries, made before any arithmetic.

Each raises `BadInput` with one line. Scenes, whole numbers and binary64 numbers are checked by
`scene.refusal`; here are the checks of number systems, numbers of any precision and arrays, and bounds.
"""

from __future__ import annotations

from collections.abc import Iterable
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scene.refusal import BadInput, shown

MAX_DIGITS = 1000  # excludes nonsense; so many digits of the moving cap may take far over ten minutes
MAX_ORDER = 64  # of moments and cumulants


def check_system(ctx: object) -> None:
    """Refuse what is no number system.

    Raises:
        BadInput: naming what was given.
    """
    if not all(hasattr(ctx, name) for name in ("pi", "sqrt", "hypot")):
        raise BadInput(f"ctx = {shown(ctx)}, must be a number system: mpmath.fp, an MPContext, or numpy")


def check_real(**numbers: object) -> None:
    """Refuse what is neither a finite real number, of any precision, nor an array of such.

    Args:
        numbers: by field name.

    Raises:
        BadInput: naming field, value and bound.
    """
    for field, number in numbers.items():
        if isinstance(number, np.ndarray):
            finite_array(field, number)
        elif isinstance(number, bool) or not isinstance(number, Real):
            raise BadInput(f"{field} = {shown(number)}, must be a finite number")
        elif number - number != 0:  # infinity and nan of any number system
            raise BadInput(f"{field} = {number}, must be finite")


def real_numbers(ctx: Any, field: str, values: object) -> list[Any]:
    """Return numbers of a context from floats, mpf or decimal strings.

    Raises:
        BadInput: values are no sequence, or one is no finite number; naming its place.
    """
    if isinstance(values, str | bytes) or not isinstance(values, Iterable):
        raise BadInput(f"{field} = {shown(values)}, must be a list of numbers")
    found = []
    for i, value in enumerate(values):
        if isinstance(value, str):
            try:
                number = ctx.mpf(value)
            except ValueError:
                raise BadInput(f"{field}[{i}] = {shown(value)}, must be a decimal number") from None
        else:
            check_real(**{f"{field}[{i}]": value})
            number = ctx.mpf(value)
        check_real(**{f"{field}[{i}]": number})
        found.append(number)
    return found


def finite_array(field: str, values: ArrayLike, n_dimensions: int | None = None) -> NDArray[np.float64]:
    """Return finite numbers as a binary64 array.

    Args:
        field: its name, for the message.
        values: whatever a caller gave.
        n_dimensions: what its shape must have; None allows any.

    Raises:
        BadInput: naming the field and the first value that is not allowed.
    """
    try:
        given = np.asarray(values)
    except ValueError:  # lists of different lengths
        raise BadInput(f"{field} must be an array of numbers, its rows of one length") from None
    if given.dtype.kind not in "iuf" and given.size:
        raise BadInput(f"{field} = {shown(given.ravel()[0])}, must be finite numbers")
    found: NDArray[np.float64] = given.astype(np.float64)
    if not np.all(np.isfinite(found)):
        raise BadInput(f"{field} holds {found[~np.isfinite(found)][0]}, must be finite")
    if n_dimensions is not None and found.ndim != n_dimensions:
        raise BadInput(f"{field} has {found.ndim} dimensions, must have {n_dimensions}")
    return found
