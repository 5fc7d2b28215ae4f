"""How what is measured at finite energy is brought to its limit: widths, an unbiased mean, fits over energy.

What finite energy does is predicted by `one_cycle`; this works for any cycle, with frozen rates or without.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from scene.refusal import BadInput, check_number
from scene.tables import Scene
from theory.branches import Floats
from theory.precision import finite_array
from theory.prediction import mean_of

ALIKE = 2.0**-46  # share of a term that the others leave: below it they leave rounding


class PowerFit(NamedTuple):
    """A fit of y = coefficient x^exponent, with next orders if asked for, to log y.

    exponent, exponent_error: the exponent and its standard error.
    coefficient, coefficient_error: value at x = 1 without next orders, and its standard error.
    residuals: (log y - fit) in standard errors, in the order of the data.
    chi_square: their sum of squares, for len(y) - 2 degrees of freedom, less one for each next order.
    """

    exponent: float
    exponent_error: float
    coefficient: float
    coefficient_error: float
    residuals: Floats
    chi_square: float


class Limit(NamedTuple):
    """A fit of y = limit + slope x^exponent.

    limit, limit_error: the value as x -> infinity (exponent < 0).
    slope, slope_error: factor of the finite-energy term.
    residuals: (y - fit) in standard errors.
    chi_square: their sum of squares, for len(y) - 2 degrees of freedom.
    """

    limit: float
    limit_error: float
    slope: float
    slope_error: float
    residuals: Floats
    chi_square: float


def unbiased_mean(scene: Scene, digits: int = 15) -> Any:
    """Return the mean of exp(-s / 2), which has no bias of order E0^(-1/2) at a finite energy E0.

    This holds if the sides lean inward at all times. Otherwise (`upright`) it has a bias at every energy that
    a run reaches.

    Args:
        scene: a valid mushroom.
        digits: correct significant digits wanted.

    Returns:
        An mpf below 1, or 1 if energies do not change.

    Raises:
        NotCovered, NotConverged: as `theory.predict`.
    """
    return mean_of(scene, lambda s: s.context.exp(-s / 2), digits)


def fit_power(x: ArrayLike, y: ArrayLike, errors: ArrayLike, orders: ArrayLike = ()) -> PowerFit:
    """Fit a power law; for the width against the energy the theory's exponent is -1/4 (sides lean inward).

    Args:
        x: shape (n,), positive, with at least two different values, and one more for each next order.
        y: shape (n,), positive.
        errors: standard errors of y, positive.
        orders: exponents < 0. For each, a term proportional to this power of x is added to log y.

    Raises:
        BadInput: the shapes differ or a number is out of bounds.
    """
    orders_ = finite_array("orders", orders, 1)
    if not np.all(orders_ < 0) or np.unique(orders_).size < orders_.size:
        raise BadInput("orders must be < 0, no two of them alike")
    x_, y_, errors_ = _data(x, y, errors, 2 + orders_.size)
    if not np.all(y_ > 0):
        raise BadInput("a power law needs y > 0")
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        terms = [np.log(x_), *((x_ / x_[0]) ** order for order in orders_)]
        (level, slope, *_), (level_error, slope_error, *_), residuals = _fitted(
            terms, np.log(y_), errors_ / y_
        )
        coefficient = float(np.exp(level))
    return PowerFit(
        slope, slope_error, coefficient, coefficient * level_error, residuals, float(residuals @ residuals)
    )


def extrapolate(x: ArrayLike, y: ArrayLike, errors: ArrayLike, exponent: float = -0.5) -> Limit:
    """Extrapolate a measured quantity to infinite energy.

    Args:
        x: energies, shape (n,), positive, with at least two different values.
        y: the quantity (mean of s, share not captured, ...), shape (n,).
        errors: standard errors of y, positive.
        exponent: of the finite-energy term; -1/2 for all terms of order sigma_w^2, if the sides lean inward.

    Raises:
        BadInput: the shapes differ, a number is out of bounds or exponent is not < 0.
    """
    x_, y_, errors_ = _data(x, y, errors, 2)
    exponent = check_number("exponent", exponent)
    if not exponent < 0:
        raise BadInput(f"exponent = {exponent}, must be < 0")
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        (limit, slope), (limit_error, slope_error), residuals = _fitted([x_**exponent], y_, errors_)
    return Limit(limit, limit_error, slope, slope_error, residuals, float(residuals @ residuals))


def _data(x: ArrayLike, y: ArrayLike, errors: ArrayLike, least: int) -> tuple[Floats, Floats, Floats]:
    x_, y_, errors_ = (finite_array(*named) for named in (("x", x), ("y", y), ("errors", errors)))
    if x_.ndim != 1 or not x_.shape == y_.shape == errors_.shape or np.unique(x_).size < least:
        raise BadInput(f"x, y and errors must be of one length, with at least {least} different x")
    if not (np.all(x_ > 0) and np.all(errors_ > 0)):
        raise BadInput("x and errors must be positive, and all numbers finite")
    return x_, y_, errors_


def _fitted(terms: Sequence[Floats], y: Floats, errors: Floats) -> tuple[list[float], list[float], Floats]:
    """Fit y = a + the sum of b_k term_k by least squares; return a, b_k, their errors, and the residuals.

    Raises:
        BadInput: binary64 does not hold the terms, or does not tell them apart.
    """
    columns = np.column_stack([np.ones_like(y), *terms]) / errors[:, None]
    if not (np.all(np.isfinite(columns)) and np.all(np.isfinite(y / errors))):
        raise BadInput("x, y and errors: a term of the fit, divided by its error, is beyond binary64")
    q, triangle = np.linalg.qr(columns)
    if np.any(np.abs(np.diag(triangle)) <= ALIKE * np.linalg.norm(columns, axis=0)):
        raise BadInput("x, exponent and orders: two terms of the fit are alike within rounding")
    inverse = np.linalg.inv(triangle)  # inverse inverse^T is the covariance
    found = inverse @ (q.T @ (y / errors))
    return found.tolist(), np.linalg.norm(inverse, axis=1).tolist(), y / errors - columns @ found
