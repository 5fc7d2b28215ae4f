"""Secs. 3.5 and 4: densities and distribution functions of one cycle, sums of many cycles."""

import mpmath
import numpy as np
import pytest
from mpmath import fp
from numpy.typing import NDArray
from support.saddle import Saddle

from scene import BangBang, Fourier, Mushroom, load
from theory import (
    Energies,
    Prediction,
    capture_curve,
    capture_rate_at,
    caustics,
    cdf_at,
    cumulants,
    density_at,
    distribution,
    energies,
    energy_cdf,
    energy_density,
    moments,
    predict,
    reversed_cycle,
    sum_of_cycles,
    volumes_at,
)
from theory.branches import at
from theory.volumes import delta_slope

TWICE = Mushroom(
    r=Fourier(mean=1.0, omega=1.0, sin=(0.5,)), h=1.0, nu=Fourier(mean=0.5, omega=1.0, cos=(0.125, 0.25))
)


@pytest.fixture(scope="module")
def solved() -> tuple[Energies, Energies]:
    return energies(load("moving-cap")), energies(TWICE)


# Captured up to twice, as in TWICE, while the cap breathes by 2^-12: s is of order 1e-4.
NEARLY_TRIVIAL = Mushroom(
    r=BangBang(((0.0, 1.0), (1.0, 1 + 2.0**-12), (4.0, 1.0))),
    h=1.0,
    nu=BangBang(((0.0, 0.875), (1.0, 0.25), (2.0, 0.625), (3.0, 0.25), (4.0, 0.875))),
)


@pytest.fixture(scope="module")
def figures() -> tuple[Prediction, Prediction]:
    return predict(load("moving-cap")), predict(TWICE, 6)


@pytest.mark.parametrize("name", ["moving-cap", "fixed-cap-anticlockwise"])
def test_reversed_scenes_are_those_of_the_catalogue(name: str) -> None:
    there, back = predict(reversed_cycle(load(name)), 6), predict(load(_opposite(name)), 6)
    assert there.strings(6) == back.strings(6)
    assert reversed_cycle(reversed_cycle(load(name))) == load(name)


def _opposite(name: str) -> str:
    return name.replace("anticlockwise", "clockwise") if "clock" in name else f"{name}-reversed"


def test_moments_of_any_order_are_those_of_the_prediction() -> None:
    found, powers = predict(load("moving-cap"), 8), moments(load("moving-cap"), 4, digits=8)
    assert abs(powers[1] - found.m1) < 1e-8
    assert abs(powers[2] - found.sd**2 - found.m1**2) < 1e-8
    curve = capture_curve(load("moving-cap"), 20_001)
    weights, middle = -np.diff(curve.p_cha), (curve.s[1:] + curve.s[:-1]) / 2
    fourth = weights @ middle**4 + float(found.p_nc * found.log_e_nc**4)
    assert float(powers[4]) == pytest.approx(fourth, rel=1e-6)
    assert powers[0] == pytest.approx(1, abs=1e-12)


@pytest.mark.deep
def test_reversal_holds_to_40_digits() -> None:
    # p_nc' = p_nc exp(-s_nc), m1' = -mean s exp(-s), p'(-s) = p(s) exp(-s), mean exp(-s) = 1.
    scene, small = load("fixed-cap-clockwise"), mpmath.mpf(10) ** -40
    back = reversed_cycle(scene)
    ahead, behind = predict(scene, 41), predict(back, 41)
    ctx = ahead.m1.context
    assert abs(behind.p_nc - ahead.p_nc * ctx.exp(-ahead.log_e_nc)) < small
    assert abs(behind.m1 + cumulants(scene, 1, 41, q=-1.0)[1]) < small
    assert abs(ahead.mean_exp_minus - 1) < small
    levels = (0.7, 0.75)
    forward, backward = density_at(scene, levels, 41), density_at(back, [-s for s in levels], 41)
    for s, p, q in zip(levels, forward, backward, strict=True):
        assert p > 0.1
        assert abs(q - p * ctx.exp(-s)) < small


def test_distribution_in_floats_is_that_at_many_digits() -> None:
    for name in ("moving-cap", "fixed-cap-clockwise"):
        levels = np.array([[-0.4, -0.1612], [0.25, 0.7]])
        found = energy_cdf(load(name), levels)
        assert found.shape == levels.shape
        expected = [float(p) for p in cdf_at(load(name), levels.ravel().tolist(), 14)]
        np.testing.assert_allclose(found.ravel(), expected, atol=2e-14)


def test_distribution_rises_from_nothing_to_one_and_steps_at_the_uncaptured(
    solved: tuple[Energies, Energies], figures: tuple[Prediction, Prediction]
) -> None:
    found, one = solved[0], figures[0]
    place = float(one.log_e_nc)
    levels = np.array([-1.0, place - 1e-9, place + 1e-9, 0.8, 0.9])
    p = energy_cdf(found, levels)
    assert (p[0], p[1]) == (0.0, 0.0)
    assert p[2] == pytest.approx(float(one.p_nc), abs=1e-8)
    assert p[4] == pytest.approx(1, abs=1e-15)
    assert np.all(np.diff(energy_cdf(found, np.linspace(-1, 1, 2001))) >= 0)


def test_density_is_the_slope_of_the_distribution_between_caustics() -> None:
    scene, step = load("moving-cap"), mpmath.mpf(2) ** -20
    levels = (-0.3, 0.25, 0.845)
    *density, above, below = density_at(scene, [*levels, 0.9, -0.5], 10)
    p_cdf = cdf_at(scene, [s + sign * step for s in levels for sign in (1, -1)], 12)
    for p, up, down in zip(density, p_cdf[::2], p_cdf[1::2], strict=True):
        assert abs((up - down) / (2 * step) / p - 1) < 1e-4
    assert above == below == 0


def test_the_caustic_of_the_moving_cap() -> None:
    (caustic,) = caustics(load("moving-cap"), 12)
    assert caustic.is_largest
    assert (f"{float(caustic.t_in):.5f}", f"{float(caustic.s):.6f}") == ("1.24757", "0.846126")
    gaps = (1e-8, 1e-6)
    for gap, near in zip(gaps, density_at(load("moving-cap"), [caustic.s - g for g in gaps], 8), strict=True):
        assert float(near) == pytest.approx(float(caustic.strength) / np.sqrt(gap), rel=10 * np.sqrt(gap))
    mass = energy_density(load("moving-cap"), [float(caustic.s) - 1e-6, 1.0])[0]
    assert mass == pytest.approx(2 * float(caustic.strength) * 1e-3, rel=1e-2)
    assert caustics(load("fixed-cap-clockwise"), 8) == []


def test_capture_rate_is_eq_dps() -> None:
    scene = load("moving-cap")
    curve = capture_curve(scene, 5)
    times = [float(t) for t in curve.t_in[1:-1]]
    *rates, released, first, again = capture_rate_at(scene, [*times, 4.0, 1.0, 1.0 + 4 * np.pi], 8)
    for t, p_cha, rate in zip(times, curve.p_cha[1:-1], rates, strict=True):
        now = volumes_at(fp, scene, t)
        flux = now.v_cap / now.v_cha * delta_slope(fp, now.nu) * -0.4 * fp.sin(t)
        assert float(rate) == pytest.approx(p_cha * flux, rel=1e-8)
    assert released == 0
    assert float(again) == pytest.approx(float(first), rel=1e-8)


@pytest.mark.parametrize("n_cycles", [10, 30])
def test_many_cycles_keep_mass_mean_spread_and_mean_exp_minus(
    n_cycles: int, solved: tuple[Energies, Energies], figures: tuple[Prediction, Prediction]
) -> None:
    for cycle, one in zip(solved, figures, strict=True):
        found = sum_of_cycles(cycle, n_cycles)
        error = n_cycles * (found.step**2 / 4 + 1e-7)
        assert found.mean_of(np.ones_like) == pytest.approx(1, abs=1e-12)
        mean = found.mean_of(lambda s: s)
        assert mean == pytest.approx(n_cycles * float(one.m1), abs=error)
        variance = found.mean_of(lambda s, mean=mean: (s - mean) ** 2)
        assert variance == pytest.approx(n_cycles * float(one.sd**2), abs=error + 1e-5)
        assert found.mean_of(lambda s: np.exp(-s)) == pytest.approx(1, abs=error)
        assert np.sqrt(variance) / n_cycles == pytest.approx(float(one.sd_of_mean(n_cycles)), abs=1e-5)


def spread_of_ten(scene: Mushroom) -> float:
    """Return the variance of ten cycles' sum over ten times one cycle's, which the panels have exactly."""
    found = energies(scene)
    ten, one = sum_of_cycles(found, 10), float(Saddle(found).cumulants([0.0])[2, 0])
    mean = ten.mean_of(lambda s: s)
    return ten.mean_of(lambda s: (s - mean) ** 2) / (10 * one)


def test_the_lattice_is_as_fine_as_the_cycle_is_small(monkeypatch: pytest.MonkeyPatch) -> None:
    assert spread_of_ten(NEARLY_TRIVIAL) == pytest.approx(1, abs=1e-6)
    monkeypatch.setattr(distribution, "LEAST_REACH", 1.0)  # one step for all cycles
    assert spread_of_ten(NEARLY_TRIVIAL) > 2


def twice_below(found: Energies, levels: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the probability of two captures and s below each level: one stay integrated over the other."""
    place, weight = np.polynomial.legendre.leggauss(200)
    angle = (place + 1) * np.pi / 4
    x, share = np.sin(angle) ** 2, weight * np.pi / 4 * np.sin(2 * angle)  # the ends' roots removed
    early, late = found.root.children
    total = np.zeros_like(levels)
    for branch in early.branches:
        rate = 2 * at(np.polynomial.chebyshev.chebder(branch.coefficients[3]), x)
        masses = share * rate * branch.chaotic(x) / early.p_top
        rest = (levels[:, None] - at(branch.s, x) + found.s_nc).ravel()
        below = sum((b.below(b.s, rest) for b in late.branches), np.zeros_like(rest))
        total += below.reshape(len(levels), -1) @ masses
    return total


def test_two_captures_in_a_small_cycle_are_their_double_integral() -> None:
    found = energies(NEARLY_TRIVIAL)
    levels = np.array([-2e-5, 0.0, 2e-5, 4e-5])
    once = sum(np.exp(-b.absorbed) * b.below(b.s, levels) for b in found.root.all_branches())
    twice = twice_below(found, levels)
    assert twice[-1] > 0.05
    np.testing.assert_allclose(found.captured_below(levels) - once, twice, atol=1e-6)


def test_many_cycles_agree_with_chance(solved: tuple[Energies, Energies]) -> None:
    # Independent draws from the distribution of one cycle, by inverting it.
    one, n_cycles, n = solved[0], 10, 40_000
    grid = np.linspace(one.s_nc - 1e-9, 0.8462, 20_001)
    rng = np.random.Generator(np.random.Philox(5))
    draws = np.interp(rng.random((n, n_cycles)), one.cdf(grid), grid).sum(axis=1)
    draws.sort()
    found = sum_of_cycles(one, n_cycles)
    distance = np.max(np.abs(found.cdf(draws) - (np.arange(n) + 0.5) / n))
    assert distance * np.sqrt(n) < 1.95
    wrong = sum_of_cycles(reversed_cycle(load("moving-cap")), n_cycles)
    assert np.max(np.abs(wrong.cdf(draws) - (np.arange(n) + 0.5) / n)) * np.sqrt(n) > 5


def test_the_saddle_point_meets_the_convolution_and_the_gaussian_does_not(
    solved: tuple[Energies, Energies], figures: tuple[Prediction, Prediction]
) -> None:
    n_cycles = 30
    saddle, one = Saddle(solved[0]), figures[0]
    m1, sd = float(one.m1), float(one.sd)
    s = n_cycles * m1 + sd * np.sqrt(n_cycles) * np.array([-3.0, -1.0, 0.0, 1.0, 3.0])
    found = sum_of_cycles(solved[0], n_cycles)
    np.testing.assert_allclose(saddle.below(s, n_cycles), found.cdf(s), rtol=1e-3)
    np.testing.assert_allclose(saddle.above(s, n_cycles), 1 - found.cdf(s), rtol=1e-3)
    np.testing.assert_allclose(saddle.density(s, n_cycles), found.density(s), rtol=1e-4)
    spread = sd * np.sqrt(n_cycles)
    gauss = np.exp(-(((s - n_cycles * m1) / spread) ** 2) / 2) / (spread * np.sqrt(2 * np.pi))
    assert np.max(np.abs(gauss / found.density(s) - 1)) > 0.05


def test_a_tilted_convolution_meets_the_saddle_point_far_in_the_tail(
    solved: tuple[Energies, Energies],
) -> None:
    n_cycles, saddle = 30, Saddle(solved[0])
    x = float(saddle.cumulants(5.0)[1, 0])
    far = sum_of_cycles(solved[0], n_cycles, q=5.0).density(n_cycles * x)
    assert far < 1e-12
    assert saddle.density(n_cycles * x, n_cycles)[0] == pytest.approx(float(far), rel=1e-3)
