"""What options make of the text given."""

from __future__ import annotations

from decimal import Decimal, InvalidOperation

import typer


def count(text: str | int) -> int:
    """Return a whole number, written as 1000, 1_000 or 1e3.

    Raises:
        BadParameter: it is none.
    """
    try:
        number = Decimal(text)
        if number == number.to_integral_value() and abs(number) < Decimal(10) ** 30:
            return int(number)
    except InvalidOperation:
        pass
    raise typer.BadParameter(f"{text!r} is not a whole number (as 1000 or 1e3)")
