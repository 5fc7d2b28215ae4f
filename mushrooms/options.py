"""Options that several commands share, and what they make of the text given."""

from __future__ import annotations

from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Annotated

import typer

from scene.refusal import BadInput

SceneName = Annotated[
    str, typer.Argument(metavar="SCENE", help="A catalogue name, or a .toml or .json file.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]
Seed = Annotated[int, typer.Option(help="Seed of the random starts, 0 to 2^64 - 1.")]


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


def place(text: str) -> Path:
    """Return the path of a file or folder to write.

    Raises:
        BadParameter: the text is empty.
    """
    if not text.strip():
        raise typer.BadParameter("'' is empty, must name a file or folder")
    return Path(text)


def check_range(option: str, value: int, low: int, high: int | None = None) -> None:
    """Refuse a number out of bounds.

    Raises:
        BadInput: naming option, value and bounds.
    """
    if value < low or (high is not None and value > high):
        bound = f">= {low}" if high is None else f"{low} to {high}"
        raise BadInput(f"{option} = {value}, must be {bound}")
