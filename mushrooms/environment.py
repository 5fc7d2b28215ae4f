"""Variables of the environment by which a library of others fails, long after they were set.

Their own words are a traceback from the middle of an import, which names no variable.
"""

from __future__ import annotations

import os

from scene.refusal import BadInput, shown

# Each must be a whole number, and so great: numba's threads, the date that its and matplotlib's files bear.
LEAST = {"NUMBA_NUM_THREADS": 1, "SOURCE_DATE_EPOCH": 0}
OF_THE_BACKEND = "Key backend: "  # so matplotlib begins what it says of MPLBACKEND


def check_environment() -> None:
    """Refuse variables that hold what no library can use.

    Raises:
        BadInput: naming the variable, its value and what it must be.
    """
    for name, least in LEAST.items():
        given = os.environ.get(name, str(least))
        try:
            is_valid = int(given) >= least
        except ValueError:
            is_valid = False
        if not is_valid:
            raise BadInput(f"{name} = {shown(given)}, must be a whole number >= {least}")


def in_words(error: ValueError) -> str | None:
    """Return what a library refuses of the environment, in a line; None when the error is none of that."""
    told = str(error)
    if "MPLBACKEND" in os.environ and told.startswith(OF_THE_BACKEND):
        return f"MPLBACKEND = {told.removeprefix(OF_THE_BACKEND)}"
    if told.startswith("bad marshal data"):  # so Python says of a file in __pycache__
        return f"a module's bytecode is damaged, its __pycache__ must be removed: {told}"
    return None
