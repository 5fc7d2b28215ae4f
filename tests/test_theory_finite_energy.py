"""What finite energy adds: widths, biases, fits over energy (theory/equations.md)."""

import math

import numpy as np
import pytest

from scene import load
from theory import cumulants
from theory.finite_energy.fits import extrapolate, fit_power, unbiased_mean


def test_the_unbiased_mean_is_the_generating_function_at_minus_a_half() -> None:
    k = cumulants(load("moving-cap"), 0, 8, q=-0.5)[0]
    found = float(unbiased_mean(load("moving-cap"), 8))
    assert found == pytest.approx(math.exp(float(k)), rel=1e-8)
    assert found < 1
    assert unbiased_mean(load("ergodic")) == 1


def test_a_power_law_and_a_limit_are_recovered_within_their_errors() -> None:
    rng = np.random.Generator(np.random.Philox(11))
    energies = np.logspace(4, 9, 6)
    pulls = []
    for _ in range(400):
        errors = 0.01 * energies**-0.25
        law = fit_power(energies, 1.9 * energies**-0.25 + errors * rng.standard_normal(6), errors)
        end = extrapolate(
            energies, 0.12 + 0.8 * energies**-0.5 + 1e-4 * rng.standard_normal(6), np.full(6, 1e-4)
        )
        pulls.append(
            [
                (law.exponent + 0.25) / law.exponent_error,
                (law.coefficient - 1.9) / law.coefficient_error,
                (end.limit - 0.12) / end.limit_error,
                (end.slope - 0.8) / end.slope_error,
            ]
        )
        assert law.chi_square == pytest.approx(float(law.residuals @ law.residuals))
    assert np.all(np.abs(np.mean(pulls, axis=0)) < 4 / 20)
    np.testing.assert_allclose(np.std(pulls, axis=0), 1, atol=0.15)


def test_next_orders_are_told_from_the_power() -> None:
    x = np.logspace(3, 8, 7)
    y = 3.0 * x**-0.25 * np.exp(2.0 * (x / x[0]) ** -0.5 - (x / x[0]) ** -1.0)
    assert fit_power(x, y, 1e-6 * y, (-0.5, -1.0)).exponent == pytest.approx(-0.25, rel=4e-10)
    assert abs(fit_power(x, y, 1e-6 * y).exponent + 0.25) > 0.01


def test_a_wrong_exponent_shows_in_the_residuals() -> None:
    energies = np.logspace(4, 9, 6)
    law = fit_power(energies, 1.9 * energies**0.25, 0.01 * energies**0.25)  # as sec. 4.1 prints it
    assert abs(law.exponent + 0.25) > 10 * law.exponent_error
    assert extrapolate(energies, 0.1 + energies**-0.25, np.full(6, 1e-4)).chi_square > 1000
