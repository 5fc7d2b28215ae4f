"""Number systems of mpmath: one for each kind and precision, in each thread.

Making one takes 3 ms, longer than most of what is then computed in it. mpmath raises a system's precision
while it evaluates a function and then puts it back: two threads must not share one, and nobody may change the
precision of a system that was handed out here. mpmath keeps pi and the precision that it was computed to in
two variables that all systems share: a thread that reads one before and the other after a change would get a
wrong pi. Proofs therefore read it with the lock CONSTANTS held.
"""

import threading
from collections.abc import Callable
from typing import Any

from mpmath import MPContext
from mpmath.ctx_iv import MPIntervalContext
from mpmath.libmp import libelefun, libmpi

CONSTANTS = threading.Lock()


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
        _make_quick(system, bits)
    return _MADE.intervals[bits]


def _make_quick(system: Any, bits: int) -> None:
    """Spare sums, differences, products and quotients of two intervals of a system mpmath's search for kinds.

    What is computed, and by which functions of mpmath's, is the same; all else goes the old way. Cosine and
    sine are computed together, and pi once.
    """
    kind = system.mpf

    def cos_sin(x: Any) -> tuple[Any, Any]:
        with CONSTANTS:
            cos, sin = libmpi.mpi_cos_sin(x._mpi_, bits)
        return system.make_mpf(cos), system.make_mpf(sin)

    system.cos_sin = cos_sin
    with CONSTANTS:
        system.pi = system.make_mpf((libelefun.mpf_pi(bits, "f"), libelefun.mpf_pi(bits, "c")))
    for name, function in (
        ("__add__", libmpi.mpi_add),
        ("__sub__", libmpi.mpi_sub),
        ("__mul__", libmpi.mpi_mul),
        ("__truediv__", libmpi.mpi_div),
    ):
        setattr(kind, name, _quick(kind, bits, function, getattr(kind, name)))


def _quick(
    kind: Any, bits: int, function: Callable[[Any, Any, int], Any], general: Callable[[Any, Any], Any]
) -> Callable[[Any, Any], Any]:
    new = object.__new__

    def operate(a: Any, b: Any) -> Any:
        if type(b) is not kind:
            return general(a, b)
        found: Any = new(kind)
        found._mpi_ = function(a._mpi_, b._mpi_, bits)
        return found

    return operate
