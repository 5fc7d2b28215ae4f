"""What this project uses of mpmath's inside.

Raw numbers, and the functions of `mpmath.libmp` on them.

A raw number is the tuple that mpmath keeps in a number. An interval holds two. The functions on
them are exact or round as the caller says. No precision of a system has an effect. No other file
names these parts of mpmath. `tests/test_scene_mpmath_internals.py` tests each for the meaning that
we rely on: a release of mpmath that changes one fails there first, by name.

Only functions known to be sound are here. mpmath's interval `exp` is not.
"""

from collections.abc import Callable
from operator import attrgetter
from typing import Any

from mpmath.ctx_iv import MPIntervalContext
from mpmath.libmp import libelefun, libmpf, libmpi

__all__ = ["MPIntervalContext"]  # a system of intervals, of which mpmath itself names one, `iv`

Raw = Any  # sign, mantissa, exponent, and bits of the mantissa; infinities and nan look otherwise
RawInterval = tuple[Raw, Raw]
DOWN = "f"  # to round
UP = "c"
NEAREST = "n"

number: Callable[[Any], Raw] = attrgetter("_mpf_")
ends: Callable[[Any], RawInterval] = attrgetter("_mpi_")

from_int: Callable[..., Raw] = libmpf.from_int
from_float: Callable[..., Raw] = libmpf.from_float
from_parts: Callable[[int, int], Raw] = libmpf.from_man_exp  # mantissa 2^exponent, exactly
to_rational: Callable[[Raw], tuple[int, int]] = libmpf.to_rational
is_less: Callable[[Raw, Raw], bool] = libmpf.mpf_lt
is_greater: Callable[[Raw, Raw], bool] = libmpf.mpf_gt
sign: Callable[[Raw], int] = libmpf.mpf_sign
add: Callable[[Raw, Raw], Raw] = libmpf.mpf_add  # exactly
subtract: Callable[[Raw, Raw, int, str], Raw] = (
    libmpf.mpf_sub
)  # rounded to so many bits, in this direction
rounded: Callable[[Raw, int, str], Raw] = libmpf.mpf_pos
shifted: Callable[[Raw, int], Raw] = libmpf.mpf_shift  # times a power of two
pi: Callable[[int, str], Raw] = libelefun.mpf_pi

interval_square: Callable[[RawInterval, int], RawInterval] = libmpi.mpi_square
interval_cos_sin: Callable[[RawInterval, int], tuple[RawInterval, RawInterval]] = libmpi.mpi_cos_sin
# By the names of Python's operators.
INTERVAL_OPERATIONS: dict[str, Callable[[RawInterval, RawInterval, int], RawInterval]] = {
    "__add__": libmpi.mpi_add,
    "__sub__": libmpi.mpi_sub,
    "__mul__": libmpi.mpi_mul,
    "__truediv__": libmpi.mpi_div,
}


def parts(raw: Raw) -> tuple[int, int]:
    """Return the mantissa with its sign and the exponent of a finite number."""
    is_negative, mantissa, exponent, _ = raw
    return (-mantissa if is_negative else mantissa), exponent


def quick_operation(kind: Any, name: str, bits: int) -> Callable[[Any, Any], Any]:
    """Return an operation that spares two intervals mpmath's search for kinds.

    What is computed, and by which function of mpmath's, is the same; all else goes mpmath's way.

    Args:
        kind: the class of the system's intervals.
        name: of the operation, in INTERVAL_OPERATIONS.
        bits: precision of the system.
    """
    new = object.__new__
    function = INTERVAL_OPERATIONS[name]
    general: Callable[[Any, Any], Any] = getattr(kind, name)

    def operate(a: Any, b: Any) -> Any:
        if type(b) is not kind:
            return general(a, b)
        found: Any = new(kind)
        found._mpi_ = function(a._mpi_, b._mpi_, bits)
        return found

    return operate


def know_constants(bits: int) -> None:
    """Compute pi, ln 2 and ln 10 to so many bits.

    What asks for fewer changes nothing afterwards.
    """
    for constant in (libelefun.pi_fixed, libelefun.ln2_fixed, libelefun.ln10_fixed):
        constant(bits)
