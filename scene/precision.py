"""Number systems of mpmath: one for each kind and precision, in each thread.

Making one takes 3 ms, longer than most of what is then computed in it. mpmath raises a system's
precision while it evaluates a function and then puts it back: two threads must not share one, and
nobody may change the precision of a system that was handed out here. mpmath keeps pi and the
precision that it was computed to in two variables that all systems share: a thread that reads one
before and the other after a change would get a wrong pi. Proofs therefore read it with the lock
CONSTANTS held.

mpmath copies and pickles a number by rounding it to the precision that its global system has at
that moment, 15 digits by default. So each number that users get is an `ExactMpf` or belongs to a
system of `Decimals`: their copies are equal to the last bit. A record that may also hold numbers of
a caller's own system uses `reduce_record`.
"""

from __future__ import annotations

import threading
from typing import Any

from mpmath import MPContext, mp

from scene import mpmath_internals as raw

CONSTANTS = threading.Lock()


class Decimals(MPContext):  # type: ignore[misc]  # mpmath has no types
    """mpmath's numbers with so many decimals, whose copies and pickles keep every bit.

    A copy belongs to a system of its own, of the same precision; numbers that are copied together
    share it.
    """

    def __init__(self, digits: int) -> None:
        super().__init__()
        self.dps = digits
        self.mpf.__reduce__ = _reduce_number

    def __reduce__(self) -> tuple[Any, ...]:
        """Tell pickle and copy how to make a system of the same precision."""
        return _system, (self.dps, self.prec)


class ExactMpf(mp.mpf):  # type: ignore[misc]
    """A number of mpmath's global system `mp`, whose copies and pickles keep every bit."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Tell pickle and copy how to make the same number."""
        return _number, (None, _parts(self))

    @classmethod
    def of(cls, mantissa: int, exponent: int) -> ExactMpf:
        """Return mantissa 2^exponent, not rounded."""
        found: ExactMpf = _exact(cls, (mantissa, exponent))
        return found


# A finite number as mantissa and exponent of two; infinity or not a number in words.
Parts = tuple[int, int] | str


def reduce_record(record: Any) -> tuple[Any, ...]:
    """Tell pickle and copy how to make a named tuple again with every bit of its numbers.

    A number of a system that was not made here becomes an `ExactMpf`.
    """
    return type(record), tuple(map(_lasting, record))


def _lasting(number: Any) -> Any:
    system = getattr(number, "context", None)
    if not isinstance(system, MPContext) or isinstance(system, Decimals):
        return number
    return _number(None, _parts(number)) if isinstance(number, system.mpf) else number


def _parts(number: Any) -> Parts:
    if not number.context.isfinite(number):
        return str(number)
    mantissa, exponent = number.man_exp
    size = abs(int(mantissa))
    return (-size if number < 0 else size), int(exponent)


def _reduce_number(number: Any) -> tuple[Any, ...]:
    return _number, (number.context, _parts(number))


def _number(system: Decimals | None, parts: Parts) -> Any:
    """Return the number of these parts in a system; in none, as an `ExactMpf`."""
    return _exact(ExactMpf if system is None else system.mpf, parts)


def _exact(kind: Any, parts: Parts) -> Any:
    if isinstance(parts, str):
        return kind(parts)
    return kind(parts, prec=max(parts[0].bit_length(), 1))


def _system(digits: int, bits: int) -> Decimals:
    made = Decimals(digits)
    if made.prec != bits:  # it was set in bits
        made.prec = bits
    return made


class _Made(threading.local):
    """The systems that a thread has made: numbers by their decimals, intervals by their bits."""

    def __init__(self) -> None:
        self.decimals: dict[int, Any] = {}
        self.intervals: dict[int, Any] = {}


_MADE = _Made()


def decimals(digits: int = 15) -> Any:
    """Return mpmath's numbers with so many decimals; 15 decimals have binary64's 53 bits."""
    if digits not in _MADE.decimals:
        _MADE.decimals[digits] = Decimals(digits)
    return _MADE.decimals[digits]


def intervals(bits: int) -> Any:
    """Return mpmath's intervals with ends of so many bits, an `MPIntervalContext`."""
    if bits not in _MADE.intervals:
        _MADE.intervals[bits] = system = raw.MPIntervalContext()
        system.prec = bits
        _make_quick(system, bits)
    return _MADE.intervals[bits]


def _make_quick(system: Any, bits: int) -> None:
    """Spare a system's intervals mpmath's search for kinds.

    Compute cosine and sine together, and pi once.
    """

    def cos_sin(x: Any) -> tuple[Any, Any]:
        with CONSTANTS:
            cos, sin = raw.interval_cos_sin(raw.ends(x), bits)
        return system.make_mpf(cos), system.make_mpf(sin)

    system.cos_sin = cos_sin
    with CONSTANTS:
        system.pi = system.make_mpf((raw.pi(bits, raw.DOWN), raw.pi(bits, raw.UP)))
    for name in raw.INTERVAL_OPERATIONS:
        setattr(system.mpf, name, raw.quick_operation(system.mpf, name, bits))
