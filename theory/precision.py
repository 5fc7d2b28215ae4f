"""Number systems, and checks of the numbers that callers give.

mpmath keeps each constant and the precision it is known to in two variables that all contexts
share: a thread that reads one before and the other after another thread's change gets a constant wrong
by a power of two. Everything in `theory` that computes with mpmath holds one lock. Python runs one
thread at a time anyway, so nothing is lost. Threads that use mpmath outside `theory` are
not stopped; those that ask for fewer digits than theory has asked for change nothing. `Binary` is gmpy2's
numbers beside an mpmath context.

Checks are made before any arithmetic, and raise `BadInput` with one line. Scenes, whole numbers and binary64
numbers are checked by `scene.refusal`; here are the checks of number systems, numbers of any precision and
arrays, and bounds.
"""

import threading
from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager
from functools import partial, wraps
from numbers import Real
from typing import Any, ParamSpec, TypeVar

import gmpy2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from scene import mpmath_internals as raw
from scene.refusal import BadInput, check_number, shown

P = ParamSpec("P")
R = TypeVar("R")

MAX_DIGITS = 1000  # excludes nonsense; so many digits of the moving cap may take far over ten minutes
MAX_ORDER = 64  # of moments and cumulants
HELD = threading.RLock()
SPARE_BITS = 24  # sixteen harmonics, each a product with the one before, lose a few


def guarded(function: Callable[P, R]) -> Callable[P, R]:
    """Make a function hold the lock on mpmath's constants while it runs."""

    @wraps(function)
    def guard(*args: P.args, **kwargs: P.kwargs) -> R:
        with HELD:
            return function(*args, **kwargs)

    return guard


def settle(ctx: Any) -> None:
    """Compute the constants to more digits than a context will ask for: nothing refines them later."""
    raw.know_constants(4 * ctx.prec)  # cos and exp work with up to about three times the precision


class Binary:
    """gmpy2's floating point numbers as a number system, beside an mpmath context; SPARE_BITS wider.

    What is computed with them is computed under `working`.
    """

    mpf, mpc, sqrt, exp, log = gmpy2.mpfr, gmpy2.mpc, gmpy2.sqrt, gmpy2.exp, gmpy2.log
    cos, asin, sign, fsum, log10 = gmpy2.cos, gmpy2.asin, gmpy2.sign, gmpy2.fsum, gmpy2.log10
    zero, one = gmpy2.mpfr(0), gmpy2.mpfr(1)

    def __init__(self, ctx: Any) -> None:
        self.ctx = ctx

    @property
    def prec(self) -> int:
        """Return the present precision in bits."""
        return int(gmpy2.get_context().precision)

    @property
    def pi(self) -> Any:
        """Return pi at the present precision."""
        return gmpy2.const_pi()

    @property
    def eps(self) -> Any:
        """Return the spacing of numbers near 1."""
        return self.ldexp(self.one, 1 - self.prec)

    def ldexp(self, x: Any, n: int) -> Any:
        """Return x 2^n."""
        return x * (1 << n) if n >= 0 else x / (1 << -n)  # faster than gmpy2's own functions

    def expj(self, x: Any) -> Any:
        """Return exp(i x)."""
        sin, cos = gmpy2.sin_cos(x)
        return cos + 1j * sin

    def workprec(self, prec: int) -> AbstractContextManager[Any]:
        """Compute with so many bits."""
        changed: AbstractContextManager[Any] = gmpy2.context(gmpy2.get_context(), precision=prec)
        return changed

    def working(self) -> AbstractContextManager[Any]:
        """Compute as wide as the mpmath context is now."""
        return self.workprec(int(self.ctx.prec) + SPARE_BITS)

    def taken(self, x: Any) -> Any:
        """Return a number of the mpmath context as one of these."""
        mantissa, exponent = raw.parts(raw.number(self.ctx.convert(x)))
        return self.ldexp(gmpy2.mpfr(mantissa), exponent)

    def given(self, x: Any) -> Any:
        """Return one of these as a number of the mpmath context, rounded to it."""
        mantissa, exponent = x.as_mantissa_exp()
        return self.ctx.mpf((mantissa, int(exponent)))


def check_real(**numbers: object) -> None:
    """Refuse what is neither a finite real number, of any precision, nor an array of such.

    Args:
        numbers: by field name.

    Raises:
        BadInput: naming field, value and bound.
    """
    for field, number in numbers.items():
        if isinstance(number, np.ndarray):
            finite_array(field, number)
        elif isinstance(number, bool) or not isinstance(number, Real):
            raise BadInput(f"{field} = {shown(number)}, must be a finite number")
        elif number - number != 0:  # infinity and nan of any number system
            raise BadInput(f"{field} = {number}, must be finite")


def in_system(ctx: Any, **numbers: object) -> list[Any]:
    """Return numbers as those of a number system: of numpy binary64 or arrays of it, else one number each.

    A number of another kind, a fraction say, would be reckoned with by its own rules, or never come to rest.

    Args:
        ctx: the number system.
        numbers: by field name.

    Raises:
        BadInput: naming what was given as number system, or field, value and bound.
    """
    if not all(hasattr(ctx, name) for name in ("pi", "sqrt", "hypot")):
        raise BadInput(f"ctx = {shown(ctx)}, must be a number system: mpmath.fp, an MPContext, or numpy")
    one = _of_numpy if ctx is np else partial(one_of, ctx)
    return [one(field, number) for field, number in numbers.items()]


def _of_numpy(field: str, number: Any) -> Any:
    if isinstance(number, np.ndarray):
        return finite_array(field, number)
    return np.float64(check_number(field, number))


def one_of(ctx: Any, field: str, number: Any) -> Any:
    """Return a finite real number as one of a number system that has no arrays.

    Raises:
        BadInput: naming field, value and bound.
    """
    if isinstance(number, np.ndarray):
        if number.ndim:
            raise BadInput(f"{field} = {shown(number)}, must be one number: arrays go with numpy")
        number = finite_array(field, number).item()
    check_real(**{field: number})
    if isinstance(number, ctx.mpf):
        return number
    if isinstance(number, np.generic):
        number = number.item() if isinstance(number, np.integer) else float(number)
    try:
        found = ctx.mpf(number)
    except OverflowError:
        raise BadInput(f"{field} = {shown(number)}, must be a finite binary64 number") from None
    check_real(**{field: found})
    return found


def real_numbers(ctx: Any, field: str, values: object) -> list[Any]:
    """Return numbers of a context from floats, mpf or decimal strings.

    Raises:
        BadInput: values are no sequence, or one is no finite number; naming its place.
    """
    if isinstance(values, str | bytes) or not isinstance(values, Iterable):
        raise BadInput(f"{field} = {shown(values)}, must be a list of numbers")
    found = []
    for i, value in enumerate(values):
        if isinstance(value, str):
            try:
                value = ctx.mpf(value)
            except ValueError:
                raise BadInput(f"{field}[{i}] = {shown(value)}, must be a decimal number") from None
        found.append(one_of(ctx, f"{field}[{i}]", value))
    return found


def finite_array(field: str, values: ArrayLike, n_dimensions: int | None = None) -> NDArray[np.float64]:
    """Return finite numbers as a binary64 array.

    Args:
        field: its name, for the message.
        values: whatever a caller gave.
        n_dimensions: what its shape must have; None allows any.

    Raises:
        BadInput: naming the field and the first value that is not allowed.
    """
    try:
        given = np.asarray(values)
    except ValueError:  # lists of different lengths
        raise BadInput(f"{field} must be an array of numbers, its rows of one length") from None
    if given.dtype.kind not in "iuf" and given.size:
        raise BadInput(f"{field} = {shown(given.ravel()[0])}, must be finite numbers")
    with np.errstate(over="ignore"):  # of wider floats: refused as infinite
        found: NDArray[np.float64] = given.astype(np.float64)
    if not np.all(np.isfinite(found)):
        raise BadInput(f"{field} holds {found[~np.isfinite(found)][0]}, must be finite")
    if n_dimensions is not None and found.ndim != n_dimensions:
        raise BadInput(f"{field} has {found.ndim} dimensions, must have {n_dimensions}")
    return found
