"""mpmath's pi and log 2, safe among threads.

mpmath keeps each constant and the precision it is known to in two variables that all contexts
share: a thread that reads one before and the other after another thread's change gets a constant wrong
by a power of two. Everything in `theory` that computes with mpmath holds one lock. Python runs one
thread at a time anyway, so nothing is lost. Threads that use mpmath outside `theory` are
not stopped; those that ask for fewer digits than theory has asked for change nothing.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec, TypeVar

from mpmath.libmp import libelefun

P = ParamSpec("P")
R = TypeVar("R")

HELD = threading.RLock()


def guarded(function: Callable[P, R]) -> Callable[P, R]:
    """Make a function hold the lock on mpmath's constants while it runs."""

    @wraps(function)
    def guard(*args: P.args, **kwargs: P.kwargs) -> R:
        with HELD:
            return function(*args, **kwargs)

    return guard


def settle(ctx: Any) -> None:
    """Compute the constants to more digits than a context will ask for: nothing refines them later."""
    for constant in (libelefun.pi_fixed, libelefun.ln2_fixed, libelefun.ln10_fixed):
        constant(4 * ctx.prec)  # cos and exp work with up to about three times the precision
