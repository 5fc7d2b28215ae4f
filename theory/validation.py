"""Checks of what callers give to the theory's public entries, made before any arithmetic.

Each raises `BadInput` with one line. Scenes, whole numbers and binary64 numbers are checked by
`scene.refusal`; here are the checks of number systems, numbers of any precision and arrays, and bounds.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scene.refusal import BadInput, check_number, shown

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


def in_system(ctx: Any, **numbers: object) -> list[Any]:
    """Return numbers as those of a number system: of numpy binary64 or arrays of it, else one number each.

    A number of another kind, a fraction say, would be reckoned with by its own rules, or never come to rest.

    Args:
        ctx: the number system.
        numbers: by field name.

    Raises:
        BadInput: naming field, value and bound.
    """
    check_system(ctx)
    one = _of_numpy if ctx is np else partial(one_of, ctx)
    return [one(field, number) for field, number in numbers.items()]


def _of_numpy(field: str, number: Any) -> Any:
    if isinstance(number, np.ndarray):
        return finite_array(field, number)
    return np.float64(check_number(field, number))


def one_of(ctx: Any, field: str, number: Any) -> Any:
    """Return a finite real number as one of a number system that has no arrays.

    Raises:
        BadInput: naming field, value and bound.
    """
    if isinstance(number, np.ndarray):
        if number.ndim:
            raise BadInput(f"{field} = {shown(number)}, must be one number: arrays go with numpy")
        number = finite_array(field, number).item()
    check_real(**{field: number})
    if isinstance(number, ctx.mpf):
        return number
    if isinstance(number, np.generic):
        number = number.item() if isinstance(number, np.integer) else float(number)
    try:
        found = ctx.mpf(number)
    except OverflowError:
        raise BadInput(f"{field} = {shown(number)}, must be a finite binary64 number") from None
    check_real(**{field: found})
    return found


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
            number = one_of(ctx, f"{field}[{i}]", value)
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
    with np.errstate(over="ignore"):  # of wider floats: refused as infinite
        found: NDArray[np.float64] = given.astype(np.float64)
    if not np.all(np.isfinite(found)):
        raise BadInput(f"{field} holds {found[~np.isfinite(found)][0]}, must be finite")
    if n_dimensions is not None and found.ndim != n_dimensions:
        raise BadInput(f"{field} has {found.ndim} dimensions, must have {n_dimensions}")
    return found
