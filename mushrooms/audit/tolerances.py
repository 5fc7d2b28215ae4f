"""Acceptance: how far a number may be from what is claimed, and how often chance breaks that.

An audit makes fewer than MAX_TESTS comparisons with random data. Each is allowed to fail a true
claim with probability LEVEL; so a whole audit raises a false alarm with probability below
FAMILY_LEVEL (Bonferroni's bound: no independence is assumed). Errors are taken to be normal: means
over thousands of particles are, and so are shares when a few dozen particles or more lie on either
side.

A comparison that holds says little unless it could have failed. So each tells the departure that it
would refute with probability SEEN; and where a rival of the claim has a name, how likely that rival
is refuted: the power of the test against it.
"""

from __future__ import annotations

from collections.abc import Callable
from decimal import Decimal
from typing import Any, NamedTuple

import mpmath
import numpy as np
import numpy.typing as npt
from scipy.stats import ks_1samp, kstwo, norm

from mushrooms.audit.claim import Check, Form

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
Cdf = Callable[[FloatArray], FloatArray]

FAMILY_LEVEL = 1e-3
MAX_TESTS = 400
LEVEL = FAMILY_LEVEL / MAX_TESTS
N_SIGMA = float(norm.isf(LEVEL / 2))  # 4.71
SEEN = 0.95


class Mean(NamedTuple):
    """A measured value with its standard error."""

    value: float
    error: float

    def less(self, amount: float) -> Mean:
        """Return the value less a known amount."""
        return Mean(self.value - amount, self.error)

    def root(self) -> Mean:
        """Return the square root, its error to first order."""
        return Mean(self.value**0.5, self.error / (2 * self.value**0.5))

    def over(self, other: Mean) -> Mean:
        """Return the ratio to an independent value, its error to first order."""
        ratio = self.value / other.value
        return Mean(
            ratio, ratio * float(np.hypot(self.error / self.value, other.error / other.value))
        )


def mean(values: npt.ArrayLike) -> Mean:
    """Return the mean and its standard error; nan for fewer than two values."""
    x = np.asarray(values, dtype=np.float64)
    if x.size < 2:
        return Mean(np.nan, np.nan)
    return Mean(float(x.mean()), float(x.std(ddof=1) / np.sqrt(x.size)))


def share(flags: npt.ArrayLike) -> Mean:
    """Return the share of true flags and its standard error.

    The error is never 0 (Agresti and Coull 1998).
    """
    x = np.asarray(flags, dtype=bool)
    if not x.size:
        return Mean(np.nan, np.nan)
    p = (x.sum() + 2) / (x.size + 4)
    return Mean(float(x.mean()), float(np.sqrt(p * (1 - p) / (x.size + 4))))


def spread(values: npt.ArrayLike) -> Mean:
    """Return the standard deviation and its standard error, from the fourth moment."""
    x = np.asarray(values, dtype=np.float64)
    if x.size < 4:
        return Mean(np.nan, np.nan)
    centred = x - x.mean()
    variance = float(np.mean(centred**2))
    fourth = float(np.mean(centred**4)) - variance**2
    return Mean(
        float(x.std(ddof=1)), float(np.sqrt(max(fourth, 0.0) / x.size / max(4 * variance, 1e-300)))
    )


def half_unit(printed: str) -> float:
    """Return half a unit of the last printed digit."""
    return 0.5 * 10.0 ** int(Decimal(printed).as_tuple().exponent)


def close(
    what: str,
    found: tuple[float, float],
    expected: Any,
    *,
    band: float = 0.0,
    scale: float = np.inf,
    form: Form = "claim",
    note: str = "",
    against: tuple[str, float] | None = None,
) -> Check:
    """Compare a measured value with an expected one.

    Args:
        what: what is compared.
        found: value and standard error.
        expected: an mpf or a float.
        band: how far off finite energy may put it.
        scale: size that must be resolved: with a wider reach the check tells nothing.
        form: of the check.
        note: what else is worth knowing.
        against: an alternative to be told from it, its name and the value that it predicts.
    """
    value, error = found
    reach = N_SIGMA * error + band
    holds = bool(abs(value - float(expected)) <= reach)  # never with nan
    is_coarse = holds and reach >= scale
    name, other = against or ("", None)
    return Check(
        what,
        None if is_coarse else holds,
        mpmath.nstr(mpmath.mpf(expected), 10),
        value,
        error,
        band,
        form,
        1,
        note,
        sees=_seen(reach, error),
        against=name,
        power=None if other is None else power(other - float(expected), reach, error),
    )


def _seen(reach: float, error: float) -> float | None:
    """Return the departure that a reach misses only with probability 1 - SEEN.

    None for an error of nan.
    """
    return reach + float(norm.isf(1 - SEEN)) * error if np.isfinite(reach + error) else None


def power(departure: float, reach: float, error: float) -> float | None:
    """Return how likely a normal value, off by `departure`, is further than `reach`."""
    if not np.isfinite(departure + reach + error):
        return None
    if error == 0:
        return float(abs(departure) > reach)
    return float(norm.sf((reach - departure) / error) + norm.cdf((-reach - departure) / error))


def above(what: str, found: tuple[float, float], bound: float, *, form: Form = "claim") -> Check:
    """Check that a measured value exceeds a bound beyond its error; within it, it is undecided."""
    value, error = found
    holds = None if abs(value - bound) <= N_SIGMA * error else bool(value > bound)
    return Check(
        what,
        holds,
        f"> {bound:.6g}",
        value,
        error,
        0.0,
        form,
        1,
        sees=_seen(N_SIGMA * error, error),
        against="no more than the bound",
        power=1 - LEVEL / 2,
    )


def exact(what: str, value: Any, expected: Any, size: float, *, form: Form = "claim") -> Check:
    """Compare two computed numbers within `size`, the rounding of the computation."""
    holds = bool(abs(value - expected) <= size)
    return Check(what, holds, mpmath.nstr(mpmath.mpf(expected), 12), float(value), None, size, form)


def stated(what: str, holds: bool, found: str, expected: str, *, form: Form = "claim") -> Check:
    """Record a statement decided without chance."""
    return Check(what, bool(holds), expected, form=form, note=found)


def critical_gap(n: int) -> float:
    """Return the distance that n values of the right distribution exceed with probability LEVEL."""
    return float(kstwo.isf(LEVEL, n))


def seen_late(cdf: Cdf, times: FloatArray, wait: float) -> float:
    """Return how far the distribution of times moves at most if each is seen by `wait` later."""
    grid = np.linspace(times.min(), times.max(), 2000)
    return float(np.max(cdf(grid) - cdf(grid - wait)))


def steepest(cdf: Cdf, lowest: float, highest: float) -> float:
    """Return the largest density of a distribution between two places."""
    places = np.linspace(lowest, highest, 400)
    return float(np.max(np.diff(cdf(places)) / np.diff(places)))


def chance(values: FloatArray, cdf: Cdf) -> float:
    """Return Kolmogorov's p: how likely so large a distance is if the law is right."""
    return float(ks_1samp(values, cdf, method="exact").pvalue)


def fits(
    what: str,
    values: FloatArray,
    cdf: Cdf,
    *,
    band: float = 0.0,
    scale: float = 0.5,
    note: str = "",
    against: tuple[str, Cdf] | None = None,
) -> Check:
    """Test a whole distribution by Kolmogorov's distance (one sample, two sides).

    Args:
        what: what is tested.
        values: the sample.
        cdf: its distribution function.
        band: distance that finite energy may add.
        scale: distance that must be seen: with a wider reach the check tells nothing.
        note: what else is worth knowing.
        against: an alternative to be told from it, its name and its distribution function.
    """
    n = len(values)
    if n < 2:
        return Check(what, None, "a sample", n_tests=1, note="no particles")
    gap, p = ks_1samp(values, cdf, method="exact")
    reach = critical_gap(n) + band
    holds = None if reach >= scale else bool(gap <= reach)
    more = f"; {note}" if note else ""
    text = f"Kolmogorov's distance, n = {n}, p = {p:.2g} without a band{more}"
    name, other = against or ("", None)
    return Check(
        what,
        holds,
        f"<= {reach:.4g}",
        gap,
        band=band,
        n_tests=1,
        note=text,
        sees=_seen(reach, 0.5 / n**0.5),  # a share has its largest error at one half
        against=name,
        power=None if other is None else _power_of_gap(values, cdf, other, reach),
    )


def _power_of_gap(values: FloatArray, cdf: Cdf, other: Cdf, reach: float) -> float:
    """Return at least how likely a sample of `other` is further than `reach` from `cdf`."""
    lowest, highest = np.quantile(values, (0.001, 0.999)).tolist()
    places = np.linspace(lowest, highest, 2001)
    g = np.clip(other(places), 0.0, 1.0)
    error = np.sqrt(np.maximum(g * (1 - g), 1 / len(values)) / len(values))
    return float(np.max(norm.sf((reach - np.abs(g - cdf(places))) / error)))
