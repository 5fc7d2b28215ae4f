"""Number systems of mpmath: one for each kind and precision, in each thread.

Making one takes 3 ms, longer than most of what is then computed in it. mpmath raises a system's precision
while it evaluates a function and then puts it back: two threads must not share one, and nobody may change the
precision of a system that was handed out here.
"""

from __future__ import annotations

import threading
from typing import Any

from mpmath import MPContext
from mpmath.ctx_iv import MPIntervalContext


class _Made(threading.local):
    """The systems that a thread has made: numbers by their decimals, intervals by their bits."""

    def __init__(self) -> None:
        self.decimals: dict[int, Any] = {}
        self.intervals: dict[int, Any] = {}


_MADE = _Made()


def decimals(digits: int = 15) -> Any:
    """Return mpmath's numbers with so many decimals, an `MPContext`; 15 decimals have binary64's 53 bits."""
    if digits not in _MADE.decimals:
        _MADE.decimals[digits] = system = MPContext()
        system.dps = digits
    return _MADE.decimals[digits]


def intervals(bits: int) -> Any:
    """Return mpmath's intervals with ends of so many bits, an `MPIntervalContext`."""
    if bits not in _MADE.intervals:
        _MADE.intervals[bits] = system = MPIntervalContext()
        system.prec = bits
    return _MADE.intervals[bits]
