"""P(E_n < E_0): its rate, its symmetry under reversal, and the probabilities themselves."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from support.depth import deep_among, deep_but
from support.saddle import Saddle

import theory
from scene import load
from theory.distribution import loss_probability, rarity

PAIRS = (
    pytest.param("moving-cap", "moving-cap-reversed", marks=pytest.mark.deep),
    ("fixed-cap-anticlockwise", "fixed-cap-clockwise"),
)
RATES = {
    "moving-cap": "0.029519254122468750926605527",
    "fixed-cap-anticlockwise": "0.012188849602495742952738075",
    "retraced-arc": "0.011273424098562731218804807",
}
LOSSES = {
    "moving-cap": {1: 0.473, 10: 0.228, 30: 0.094, 100: 0.0077},
    "fixed-cap-anticlockwise": {1: 0.157, 10: 0.267, 30: 0.182, 100: 0.056},
    "fixed-cap-clockwise": {1: 0.718, 10: 0.355, 30: 0.209, 100: 0.062},
}


@pytest.mark.parametrize("name", deep_among(RATES, "retraced-arc"))
def test_the_rate_is_the_least_of_minus_log_phi(name: str) -> None:
    found = rarity(load(name), 25)
    assert abs(found.rate - found.rate.context.mpf(RATES[name])) < mpmath.mpf(10) ** -25
    q = float(found.place)
    for shift in (-1e-3, 0.0, 1e-3):
        k = theory.cumulants(load(name), 0, 15, q + shift)[0]
        assert float(-k) <= float(found.rate) + 1e-15
        assert float(-k) == pytest.approx(float(found.rate), abs=1e-6)


@pytest.mark.parametrize(("forward", "backward"), PAIRS)
def test_a_cycle_and_its_reverse_are_equally_rare(forward: str, backward: str) -> None:
    one, other = rarity(load(forward), 20), rarity(load(backward), 20)
    assert abs(one.rate - other.rate) < mpmath.mpf(10) ** -21
    assert abs(one.place + other.place + 1) < mpmath.mpf(10) ** -19
    assert abs(one.place - other.place) > 0.02


@pytest.mark.parametrize(("forward", "backward"), PAIRS)
def test_phi_of_the_reverse_is_phi_of_minus_one_less_q_to_30_digits(forward: str, backward: str) -> None:
    rng = np.random.default_rng(11)
    for q in (rng.integers(-192, 128, 2) / 64).tolist():  # -1 - q is exact
        one = theory.cumulants(load(forward), 0, 30, q)[0]
        other = theory.cumulants(load(backward), 0, 30, -1 - q)[0]
        assert abs(one - other) < mpmath.mpf(10) ** -29
        mirrored = theory.cumulants(load(backward), 0, 15, 1 - q)[0]
        assert abs(one - mirrored) > 1e-3  # about another place it does not hold


@pytest.mark.parametrize("name", deep_but(LOSSES, "fixed-cap-clockwise"))
def test_losses_are_those_of_sums_of_cycles(name: str) -> None:
    energies = theory.energies(load(name))
    for n, expected in LOSSES[name].items():
        found = loss_probability(energies, n)
        assert found == pytest.approx(expected, rel=0.012)
        assert found == pytest.approx(float(theory.sum_of_cycles(energies, n).cdf(0.0)), abs=1e-4)
    saddle = float(Saddle(energies).below(0.0, 400)[0])
    assert loss_probability(energies, 400) == pytest.approx(saddle, rel=0.02)


def test_cycles_that_keep_energies_have_no_rate() -> None:
    assert rarity(load("moving-cap-trivial"), 10) == (0, -0.5)
