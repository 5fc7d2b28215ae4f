"""Bad input: the one error that it raises, and the checks that public entries share.

A public entry checks what it is given before any arithmetic, so that a wrong type or a nan ends in one
line that names the field, the value and the bound, never in a traceback from deep inside.
"""

from __future__ import annotations

import math
import numbers
import operator

MAX_SEED = 2**64 - 1


class BadInput(ValueError):  # noqa: N818 (the caller's input is bad, not the program)
    """One line naming the field, its value and the bound it breaks."""


class InvalidScene(BadInput):
    """A scene that means nothing: one line naming parameter, time, value and bound."""


def check_count(field: str, value: object, low: int, high: int) -> int:
    """Return a whole number within bounds.

    Args:
        field: its name, for the message.
        value: whatever a caller gave; integers of numpy are taken, a float is not, though it be whole.
        low: least value allowed.
        high: greatest value allowed.

    Raises:
        BadInput: naming field, value and bounds.
    """
    if isinstance(value, bool) or not isinstance(value, numbers.Integral):
        raise BadInput(f"{field} = {shown(value)}, must be a whole number, {low} to {high}")
    count = operator.index(value)
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
        value: whatever a caller gave; integers and numbers of numpy are taken.
        refusal: the error to raise.

    Raises:
        BadInput: or the error asked for, naming field, value and bound.
    """
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        raise refusal(f"{field} = {shown(value)}, must be a finite number")
    try:
        number = float(value)
    except OverflowError:
        raise refusal(f"{field} = {shown(value)}, must be a finite binary64 number") from None
    if not math.isfinite(number):
        raise refusal(f"{field} = {number}, must be finite")
    return number


def shown(value: object) -> str:
    """Return a value as a message shows it: on one line, and short."""
    if isinstance(value, int) and value.bit_length() > 256:  # Python refuses to print the longest
        return f"an integer of {value.bit_length()} bits"
    if not (value is None or isinstance(value, numbers.Number | str)):  # long, or nested too deep to print
        return f"an object of type {type(value).__name__}"
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else text[:57] + "..."
