"""Variables of the environment that make a library fail, long after they were set.

The library's own words are a traceback from the middle of an import, which names no variable.
"""

import os

# Each must be a whole number of at least so much: numba's threads, and the date of numba's and
# matplotlib's files.
LEAST = {"NUMBA_NUM_THREADS": 1, "SOURCE_DATE_EPOCH": 0}


def bad_variable() -> str | None:
    """Return a line that names a variable, its value and what it must be; None if all are good."""
    for name, least in LEAST.items():
        given = os.environ.get(name, str(least))
        try:
            is_valid = int(given) >= least
        except ValueError:
            is_valid = False
        if not is_valid:
            return f"{name} = {given[:40]!r}, must be a whole number >= {least}"
    return None
