"""Bad input: the one error that it raises, and the checks that public entries share.

A public entry checks what it is given before any arithmetic, so that a wrong type or a nan ends in
one line that names the field, the value and the bound, never in a traceback from deep inside.
"""

import math
import numbers
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

MAX_SEED = 2**64 - 1
FEW = 6  # parts of a list that a message shows


class BadInput(ValueError):  # noqa: N818 (the caller's input is bad, not the program)
    """One line naming the field, its value and the bound it breaks."""


class InvalidScene(BadInput):
    """An invalid scene: one line naming parameter, time, value and bound."""


def check_count(field: str, value: object, low: int, high: int) -> int:
    """Return a whole number within bounds.

    Args:
        field: its name, for the message.
        value: a whole number; floats such as 1e4 and numbers of numpy are accepted.
        low: least value allowed.
        high: greatest value allowed.

    Raises:
        BadInput: naming field, value and bounds.
    """
    given = listed(value)
    is_whole = not isinstance(given, bool) and isinstance(given, numbers.Real) and given % 1 == 0
    if not is_whole:
        raise BadInput(f"{field} = {shown(given)}, must be a whole number, {low} to {high}")
    count = int(given)
    if not low <= count <= high:
        raise BadInput(f"{field} = {shown(count)}, must be {low} to {high}")
    return count


def check_seed(value: object, field: str = "seed") -> int:
    """Return a seed of random numbers, 0 to MAX_SEED.

    Raises:
        BadInput: naming field, value and bounds.
    """
    return check_count(field, value, 0, MAX_SEED)


def check_number(field: str, value: object, refusal: type[BadInput] = BadInput) -> float:
    """Return a finite number as a binary64.

    Args:
        field: its name, for the message.
        value: a number; numpy scalars and 0-d arrays are accepted.
        refusal: the error to raise.

    Raises:
        BadInput: or the error given as `refusal`, naming field, value and bound.
    """
    if type(value) is float and math.isfinite(value):
        return value
    given = listed(value)
    if isinstance(given, bool) or not isinstance(given, numbers.Real):
        raise refusal(f"{field} = {shown(given)}, must be a finite number")
    try:
        number = float(given)
    except OverflowError:
        raise refusal(f"{field} = {shown(given)}, must be a finite binary64 number") from None
    if not math.isfinite(number):
        raise refusal(f"{field} = {number}, must be finite")
    return number


def check_list(
    field: str, value: object, what: str, refusal: type[BadInput] = BadInput
) -> Sequence[Any]:
    """Return a list, a tuple or the like, text excepted.

    Args:
        field: its name, for the message.
        value: a sequence, or an array of numpy.
        what: what it must be, for the message.
        refusal: the error to raise.

    Raises:
        BadInput: or the error given as `refusal`, naming field, value and what it must be.
    """
    given = listed(value)
    if isinstance(given, str | bytes) or not isinstance(given, Sequence):
        raise refusal(f"{field} = {shown(given)}, must be {what}")
    return given


def listed(value: object) -> Any:
    """Return what numpy holds as numbers of Python, in lists for each dimension; else the value."""
    if not isinstance(value, np.ndarray | np.generic):
        return value
    return str(value) if value.dtype.kind in "mM" else value.tolist()  # a date would be a number


def shown(value: object) -> str:
    """Return a value as a message shows it: on one line, and short."""
    if isinstance(value, int) and value.bit_length() > 256:  # Python refuses to print the longest
        return f"an integer of {value.bit_length()} bits"
    if isinstance(value, list | tuple) and all(map(_is_plain, value[:FEW])):
        text = ", ".join(map(shown, value[:FEW]))
        more = ", ..." if len(value) > FEW else "," * (isinstance(value, tuple) and len(value) == 1)
        text = f"[{text}{more}]" if isinstance(value, list) else f"({text}{more})"
    elif not (value is None or _is_plain(value)):  # long, or nested too deep to print
        return f"an object of type {type(value).__name__}"
    else:
        text = " ".join(repr(value).split())
    return text if len(text) <= 60 else text[:57] + "..."


def _is_plain(value: object) -> bool:
    return isinstance(value, numbers.Number | str)


def refuse_unheeded(options: Mapping[str, object], why: str) -> None:
    """Refuse options that nothing here would heed: their user would count on them.

    Args:
        options: by name; None is one that is not given, True one that has no value.
        why: nothing heeds them.

    Raises:
        BadInput: naming the first that is given.
    """
    for name, value in options.items():
        if value is not None:
            shown = repr(value) if isinstance(value, str) else value
            given = name if value is True else f"{name} = {shown}"
            raise BadInput(f"{given} would change nothing here: {why}")
