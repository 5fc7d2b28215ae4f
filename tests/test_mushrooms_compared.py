"""Theory beside a run: what follows it has small z over one cycle and several; what does not has not."""

from __future__ import annotations

import numpy as np
import pytest

import theory
from mushrooms.compared import measured
from mushrooms.store.asked import Asked
from mushrooms.store.tally import RunTally, moments_of
from scene import load


@pytest.mark.parametrize("n_cycles", [1, 4])
@pytest.mark.parametrize("energy", [1e5, 1e7])  # at 1e4 theory leaves out as much as the directions differ by
def test_energies_drawn_from_theory_agree_with_it(n_cycles, energy):
    """And those of the reversed cycle do not."""
    n, pulls = 100_000, {}
    for name in ("moving-cap", "moving-cap-reversed"):
        found = theory.at_energy(load(name), energy)
        gains = found.draw(n_cycles, n, 5)[:, -1]
        captured = round((1 - found.p_nc) * n * n_cycles)
        counts = RunTally(n, n, captured=captured, gain=moments_of(gains))
        beside = measured(Asked(load("moving-cap"), energy, n_cycles, 1), counts)
        assert beside["m1"] == pytest.approx(gains.mean() / n_cycles)
        assert beside["m1_se"] == pytest.approx(gains.std(ddof=1) / np.sqrt(n) / n_cycles)
        pulls[name] = abs(beside["m1_z"])
    assert pulls["moving-cap"] < 3.5
    assert pulls["moving-cap-reversed"] > 3.5


def test_the_limit_of_high_energies_has_no_z():
    counts = RunTally(100, 100, captured=60, gain=moments_of(np.linspace(-1, 1, 100)))
    beside = measured(Asked(load("untilted"), 1e4, 1, 1), counts)
    assert beside["m1_theory"] == pytest.approx(0.19134361)
    assert (beside["m1_z"], beside["p_nc_z"]) == (None, None)
    assert (beside["p_nc"], beside["p_nc_se"]) == (pytest.approx(0.4), pytest.approx(0.24**0.5 / 10))
    nothing = measured(Asked(load("breathing-circle"), 1e4, 1, 1), RunTally(1, 1))
    assert set(nothing.values()) == {None}
