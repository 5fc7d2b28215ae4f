"""Number systems: mpmath's constants, safe among threads, and gmpy2's numbers beside an mpmath context.

mpmath keeps each constant and the precision it is known to in two variables that all contexts
share: a thread that reads one before and the other after another thread's change gets a constant wrong
by a power of two. Everything in `theory` that computes with mpmath holds one lock. Python runs one
thread at a time anyway, so nothing is lost. Threads that use mpmath outside `theory` are
not stopped; those that ask for fewer digits than theory has asked for change nothing.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import wraps
from typing import Any, ParamSpec, TypeVar

import gmpy2
from mpmath.libmp import from_man_exp, libelefun

P = ParamSpec("P")
R = TypeVar("R")

HELD = threading.RLock()
FEW_BITS = 256  # within which the third power of 2^-53 is followed by rounding
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
    for constant in (libelefun.pi_fixed, libelefun.ln2_fixed, libelefun.ln10_fixed):
        constant(4 * ctx.prec)  # cos and exp work with up to about three times the precision


class Binary:
    """gmpy2's floating point numbers as a number system, beside an mpmath context; SPARE_BITS wider.

    What is computed with them is computed under `working`.
    """

    mpf, mpc, sqrt, exp, log = gmpy2.mpfr, gmpy2.mpc, gmpy2.sqrt, gmpy2.exp, gmpy2.log
    cos, sign, fsum, log10 = gmpy2.cos, gmpy2.sign, gmpy2.fsum, gmpy2.log10
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

    def angle(self, sine: Any, cosine: Any) -> Any:
        """Return the angle in [0, pi / 2] that has this sine and cosine, at a third of the cost of asin."""
        if self.prec > FEW_BITS:
            return gmpy2.asin(sine)
        near = math.atan2(sine, cosine)
        sin, cos = gmpy2.sin_cos(near)
        rest = sine * cos - cosine * sin  # sine of the rest, 2^-53 of the angle
        return near + (rest + rest * rest * rest / 6)

    def workprec(self, prec: int) -> AbstractContextManager[Any]:
        """Compute with so many bits."""
        changed: AbstractContextManager[Any] = gmpy2.context(gmpy2.get_context(), precision=prec)
        return changed

    def working(self) -> AbstractContextManager[Any]:
        """Compute as wide as the mpmath context is now."""
        return self.workprec(int(self.ctx.prec) + SPARE_BITS)

    def taken(self, x: Any) -> Any:
        """Return a number of the mpmath context as one of these."""
        sign, mantissa, exponent, _ = self.ctx.convert(x)._mpf_
        return self.ldexp(gmpy2.mpfr(-mantissa if sign else mantissa), exponent)

    def given(self, x: Any) -> Any:
        """Return one of these as a number of the mpmath context, rounded to it."""
        mantissa, exponent = x.as_mantissa_exp()
        return self.ctx.make_mpf(from_man_exp(mantissa, int(exponent), *self.ctx._prec_rounding))
