"""Theory beside a run: what follows it has small z over one cycle and several; what does not has not."""

from __future__ import annotations

import numpy as np
import pytest

import fast
import theory
from conformance.audit.runs import SCENES
from mushrooms.compared import begins_widest, leans_inward, limit_told, measured
from mushrooms.store.spec import RunSpec
from mushrooms.store.tally import Gain, gain_of
from scene import Fourier, Mushroom, load


def gain(values):
    return gain_of(lambda: [values[:, None]])


@pytest.mark.parametrize("n_cycles", [1, 4])
@pytest.mark.parametrize("energy", [1e5, 1e7])  # at 1e4 theory leaves out as much as the directions differ by
def test_energies_drawn_from_theory_agree_with_it(n_cycles, energy):
    """And those of the reversed cycle do not."""
    n, pulls = 100_000, {}
    for name in ("moving-cap", "moving-cap-reversed"):
        found = theory.at_energy(load(name), energy)
        gains = found.draw(n_cycles, n, 5)[:, -1]
        captured = round((1 - found.p_nc) * n * n_cycles)
        beside = measured(RunSpec(load("moving-cap"), energy, n_cycles, 1), captured, gain(gains))
        assert beside["m1"] == pytest.approx(gains.mean() / n_cycles)
        assert beside["m1_se"] == pytest.approx(gains.std(ddof=1) / np.sqrt(n) / n_cycles)
        pulls[name] = abs(beside["m1_z"])
    assert pulls["moving-cap"] < 3.5
    assert pulls["moving-cap-reversed"] > 3.5


def test_the_limit_of_high_energies_has_no_z():
    beside = measured(RunSpec(load("untilted"), 1e4, 1, 1), 60, gain(np.linspace(-1, 1, 100)))
    assert beside["m1_theory"] == pytest.approx(0.19134361)
    assert (beside["m1_z"], beside["p_nc_z"]) == (None, None)
    assert (beside["p_nc"], beside["p_nc_se"]) == (pytest.approx(0.4), pytest.approx(0.24**0.5 / 10))
    nothing = measured(RunSpec(load("breathing-circle"), 1e4, 1, 1), 0, Gain())
    assert set(nothing.values()) == {None}


def turned(phase):
    """Return a mushroom whose cycle begins at a phase of its mouth's, the widest at 0."""

    def law(mean, amplitude, lag):
        cos, sin = amplitude * np.cos(phase - lag), -amplitude * np.sin(phase - lag)
        return Fourier(mean=mean, omega=1.0, cos=(float(cos),), sin=(float(sin),))

    return Mushroom(r=1.0, h=law(1.2, 0.5, 1.2), nu=law(0.55, 0.4, 0.0), slope=0.1)


@pytest.mark.parametrize("phase", [0.0, *np.random.default_rng(23).uniform(0.1, 6.1, 6), 2 * np.pi])
def test_theory_stands_beside_cycles_that_begin_where_its_own_do(phase):
    beside = measured(RunSpec(turned(phase), 1e6, 1, 1), 0, Gain())
    assert (
        (beside["p_nc_theory"] is not None) == (beside["m1_theory"] is not None) == (phase in (0, 2 * np.pi))
    )


@pytest.mark.parametrize("name", [name for name in SCENES if isinstance(SCENES[name], Mushroom)])
def test_the_audits_cycles_begin_where_theorys_do(name):
    assert begins_widest(SCENES[name])


def test_a_cycle_that_begins_at_a_narrow_mouth_is_another_one():
    """Whoever starts in what opens later counts as captured; the next cycle does not know of it."""
    found = fast.simulate(turned(3.0), n_particles=1500, energy=1e6, n_cycles=2, seed=1)
    wanted = float(theory.predict(turned(3.0), 6).p_nc)
    error = np.sqrt(wanted * (1 - wanted) / 1500)
    first, second = np.abs(found.p_nc() - wanted) / error
    assert first > 10
    assert second < 4


NEVER_NARROWS = Mushroom(r=1.0, h=Fourier(mean=1.0, omega=1.0, sin=(0.5,)), nu=0.5, slope=0.1)


@pytest.mark.parametrize("captured", [0, 20])
def test_a_share_of_particles_that_were_all_alike_has_an_error(captured):
    """Of twenty that are free, where one in 300 is captured, none is: it told 1 with an error of 0."""
    beside = measured(RunSpec(turned(0.0), 1e6, 1, 1), captured, gain(np.linspace(-1, 1, 20)))
    assert beside["p_nc"] == 1 - captured / 20
    assert beside["p_nc_se"] == pytest.approx(1 / 21)


def test_a_share_that_is_known_has_none():
    alike = gain(np.linspace(-1, 1, 20))
    assert measured(RunSpec(NEVER_NARROWS, 1e6, 1, 1), 0, alike)["p_nc_se"] == 0.0


def limit_of(scene):
    spec = RunSpec(scene, 1e6, 1, 1)
    return limit_told(spec, measured(spec, 60, gain(np.linspace(-1, 1, 100))))


def test_theory_that_is_the_limit_says_so_and_where_it_is_slow():
    assert limit_of(load("moving-cap")) is None  # of that energy
    told = limit_of(turned(1.0))
    assert told.startswith("m1_theory, p_nc_theory: none, for the cycle begins at t = 0 with its mouth at")
    shift = float(told.split("shift all laws by ")[1].split()[0])
    assert begins_widest(turned(1.0 - shift))
    assert limit_of(turned(0.0)).endswith("what is left at this one is not known")
    assert "slope is not above 0" in limit_of(load("untilted"))
    assert limit_of(load("frozen-mushroom")) is None  # nothing moves: at any energy


def test_one_particle_of_a_scene_whose_rates_are_known_has_theory_of_its_energy():
    """Its m1 has no error and so no z, which was taken for want of a theory."""
    alone = gain(np.array([0.1]))
    for name, is_limit in (("moving-cap", False), ("untilted", True)):
        spec = RunSpec(load(name), 1e6, 1, 1)
        assert (limit_told(spec, measured(spec, 0, alone)) is not None) == is_limit


def test_sides_lean_inward_at_all_times_or_not():
    waves = {"omega": 1.0, "cos": (0.04, 0.03)}  # least near -0.0367, where a bound by their sizes says -0.07
    for mean, inward in ((0.05, True), (0.035, False), (0.0, False), (-0.05, False)):
        table = Mushroom(r=1.0, h=1.0, nu=0.5, slope=Fourier(mean=mean, **waves))
        assert leans_inward(table) == inward
