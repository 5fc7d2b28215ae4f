"""Secs. 3.5 and 4: curves, densities and distributions of one cycle, sums of many, P(E_n < E_0) and its rate.

Atoms of log E1 / E0 are the uncaptured, and the captured while a loop runs back along itself. Where V_cap / V
is the same at capture and at release all along a stretch, s is constant there: it is rounding that tells such
captives apart. A probability at their place has all of them, and a particle that keeps the energy is neither
lost nor has gained.
"""

import math
from functools import cache

import mpmath
import numpy as np
import pytest
from mpmath import fp
from numpy.typing import NDArray
from scipy.special import ndtr
from support.depth import deep_among, deep_but

from scene import BangBang, Fourier, Mushroom, load
from scene.precision import decimals
from scene.transforms import scaled
from theory import (
    Cycle,
    Energies,
    Prediction,
    capture_curve,
    capture_rate_at,
    capture_time_mass,
    caustics,
    cdf_at,
    chaotic_zone,
    cumulants,
    density_at,
    distribution,
    energies,
    energy_cdf,
    energy_density,
    largest_gain,
    loss_probability,
    moments,
    predict,
    rarity,
    reversed_cycle,
    sum_of_cycles,
    volumes_at,
)
from theory.branches import Branch, at
from theory.chebyshev import Grid, compressed, convolve
from theory.volumes import delta_slope


def test_curve_runs_from_nothing_to_the_uncaptured() -> None:
    curve = capture_curve(load("moving-cap"), 101)
    found = predict(load("moving-cap"))
    assert all(column.shape == (101,) and column.dtype == np.float64 for column in curve)
    assert np.all(np.diff(curve.t_in) > 0)
    assert np.all(np.diff(curve.p_cha) < 0)
    assert (curve.t_in[0], curve.p_cha[0], curve.nu[0]) == (0.0, 1.0, 1.0)
    assert curve.t_in[-1] == np.pi
    assert curve.p_cha[-1] == pytest.approx(float(found.p_nc), rel=1e-14)
    assert curve.s[-1] == pytest.approx(float(found.log_e_nc), rel=1e-13)  # g = 1 at the minimum


def test_curve_points_satisfy_the_definitions() -> None:
    scene = load("moving-cap")
    curve = capture_curve(scene, 12)
    np.testing.assert_allclose(curve.t_out, 2 * np.pi - curve.t_in, rtol=1e-14)
    np.testing.assert_allclose(curve.nu, 0.6 + 0.4 * np.cos(curve.t_in), rtol=1e-14)
    for t_in, t_out, log_g in zip(curve.t_in, curve.t_out, curve.log_g, strict=True):
        at_capture = volumes_at(fp, scene, float(t_in))
        at_release = volumes_at(fp, scene, float(t_out))
        g = at_capture.v_cha / at_capture.v_cap / (at_release.v_cha / at_release.v_cap)
        assert log_g == pytest.approx(np.log(g), abs=1e-13)


def test_times_are_resolved_where_all_else_is_smooth_in_nu() -> None:
    """Only the mouth moves, and nearly stops where it turns."""
    nu = Fourier(mean=0.5, omega=1.0, cos=(0.3, 0.075 * 0.999))
    curve = capture_curve(Mushroom(r=1.0, h=1.0, nu=nu), 101)
    np.testing.assert_allclose(nu(curve.t_in), curve.nu, rtol=1e-14)
    np.testing.assert_allclose(nu(curve.t_out), curve.nu, rtol=1e-14)


def test_largest_gain_of_the_moving_cap() -> None:
    best = largest_gain(load("moving-cap"))
    assert best is not None
    assert (f"{best[0]:.5f}", f"{best[1]:.6f}") == ("1.24757", "0.846126")
    assert capture_curve(load("moving-cap"), 4001).s.max() == pytest.approx(best[1], abs=1e-6)


def test_largest_gain_at_an_end_of_the_curve() -> None:
    # Clockwise the gain falls with every later capture: the first captured gain -log g(w1).
    best = largest_gain(load("fixed-cap-clockwise"))
    curve = capture_curve(load("fixed-cap-clockwise"))
    assert best == (0.25, curve.s[0])
    assert np.all(np.diff(curve.s) < 0)


@pytest.mark.parametrize("name", ["moving-cap", "fixed-cap-anticlockwise", "fixed-cap-clockwise"])
def test_masses_make_up_the_captured_and_their_means(name: str) -> None:
    found = predict(load(name))
    edges = np.linspace(-1.5, 1.5, 3001)
    mass = energy_density(load(name), edges)
    assert mass.sum() == pytest.approx(1 - float(found.p_nc), abs=1e-12)
    assert np.all(mass >= -1e-15)
    middle = (edges[1:] + edges[:-1]) / 2
    mean = mass @ middle + float(found.p_nc * found.log_e_nc)
    assert mean == pytest.approx(float(found.m1), abs=1e-5)
    square = mass @ (middle - float(found.m1)) ** 2 + float(found.p_nc * (found.log_e_nc - found.m1) ** 2)
    assert np.sqrt(square) == pytest.approx(float(found.sd), abs=1e-5)


def hazard(t: float) -> float:
    """Return the rate of capture from the chaotic zone of the moving cap (Eq:dps/ps)."""
    now = volumes_at(fp, load("moving-cap"), t)
    return float(now.v_cap / now.v_cha * delta_slope(fp, now.nu) * -0.4 * fp.sin(t))


def test_capture_time_masses_are_differences_of_p_cha() -> None:
    edges = [0.0, 0.7, 1.5, 2.9, 4.0]
    p_cha = [np.exp(-float(fp.quad(hazard, [0, min(t, np.pi)]))) for t in edges]
    np.testing.assert_allclose(capture_time_mass(load("moving-cap"), edges), -np.diff(p_cha), atol=3e-7)


def test_chaotic_zone_through_the_cycle() -> None:
    scene = load("moving-cap")
    found = predict(load("moving-cap"))
    curve = capture_curve(scene, 9)
    falling = chaotic_zone(scene, curve.t_in)
    rising = chaotic_zone(scene, curve.t_out[1:])
    np.testing.assert_allclose(falling.p_cha, curve.p_cha, atol=3e-7)
    np.testing.assert_allclose(rising.p_cha, curve.p_cha[1:], atol=3e-7)
    # The energy gained in the chaotic zone before capture, in the cap, and after release.
    before = np.array([volumes_at(fp, scene, float(t)).v_cap for t in curve.t_in[1:]])
    after = np.array([volumes_at(fp, scene, float(t)).v_cap for t in curve.t_out[1:]])
    total = falling.log_energy[1:] + np.log(before / after) + float(found.log_e_nc) - rising.log_energy
    np.testing.assert_allclose(total, curve.s[1:], atol=1e-6)
    again = chaotic_zone(scene, [0.5, 0.5 + 4 * np.pi])
    assert np.diff(again.log_energy)[0] == pytest.approx(2 * float(found.log_e_nc), abs=1e-6)
    assert np.diff(again.p_cha)[0] == pytest.approx(0, abs=1e-12)


def test_without_capture_the_curves_are_empty() -> None:
    for name in ("ergodic", "frozen-mushroom"):
        assert all(column.size == 0 for column in capture_curve(load(name)))
        assert largest_gain(load(name)) is None
        assert energy_density(load(name), [-1.0, 1.0]).tolist() == [0.0]
    zone = chaotic_zone(load("ergodic"), [0.0, 1.0])
    volumes = [volumes_at(fp, load("ergodic"), t).v_cha for t in (0.0, 1.0)]
    np.testing.assert_allclose(zone.log_energy, [0.0, np.log(volumes[0] / volumes[1])], atol=1e-15)
    assert zone.p_cha.tolist() == [1.0, 1.0]
    assert Cycle.of(load("frozen-mushroom"), 15).period is None


def test_a_trivial_loop_keeps_all_its_mass_at_zero() -> None:
    p_nc = float(predict(load("moving-cap-trivial")).p_nc)
    mass = energy_density(load("moving-cap-trivial"), [-1.0, -1e-9, 1e-9, 1.0])
    np.testing.assert_allclose(mass, [0.0, 1 - p_nc, 0.0], atol=1e-12)
    best = largest_gain(load("moving-cap-trivial"))
    assert best is not None
    assert abs(best[1]) < 1e-12


@pytest.mark.parametrize(("length", "time"), [(600, 0), (-1000, 0), (0, 900)])
def test_the_chaotic_zone_is_the_same_in_any_units(length: int, time: int) -> None:
    """Not nan where the square of a length is no float."""
    table = load("moving-cap")
    times = np.array([1.0, 4.0])
    here = chaotic_zone(table, times)
    there = chaotic_zone(scaled(table, length, time), np.ldexp(times, time))
    for one, other in zip(here, there, strict=True):
        assert other == pytest.approx(one, abs=1e-12)


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


@pytest.mark.parametrize(
    ("name", "opposite"),
    [("moving-cap", "moving-cap-reversed"), ("fixed-cap-anticlockwise", "fixed-cap-clockwise")],
)
def test_reversed_scenes_are_those_of_the_catalogue(name: str, opposite: str) -> None:
    there = predict(reversed_cycle(load(name)), 6)
    back = predict(load(opposite), 6)
    assert there.strings(6) == back.strings(6)
    assert reversed_cycle(reversed_cycle(load(name))) == load(name)


def test_moments_of_any_order_are_those_of_the_prediction() -> None:
    found = predict(load("moving-cap"), 8)
    powers = moments(load("moving-cap"), 4, digits=8)
    assert abs(powers[1] - found.m1) < 1e-8
    assert abs(powers[2] - found.sd**2 - found.m1**2) < 1e-8
    curve = capture_curve(load("moving-cap"), 20_001)
    weights = -np.diff(curve.p_cha)
    middle = (curve.s[1:] + curve.s[:-1]) / 2
    fourth = weights @ middle**4 + float(found.p_nc * found.log_e_nc**4)
    assert float(powers[4]) == pytest.approx(fourth, rel=1e-6)
    assert powers[0] == pytest.approx(1, abs=1e-12)


@pytest.mark.deep
def test_reversal_holds_to_40_digits() -> None:
    # p_nc' = p_nc exp(-s_nc), m1' = -mean s exp(-s), p'(-s) = p(s) exp(-s), mean exp(-s) = 1.
    scene = load("fixed-cap-clockwise")
    small = mpmath.mpf(10) ** -40
    back = reversed_cycle(scene)
    ahead = predict(scene, 41)
    behind = predict(back, 41)
    ctx = ahead.m1.context
    assert abs(behind.p_nc - ahead.p_nc * ctx.exp(-ahead.log_e_nc)) < small
    assert abs(behind.m1 + cumulants(scene, 1, 41, q=-1.0)[1]) < small
    assert abs(ahead.mean_exp_minus - 1) < small
    levels = (0.7, 0.75)
    forward = density_at(scene, levels, 41)
    backward = density_at(back, [-s for s in levels], 41)
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
    found = solved[0]
    one = figures[0]
    place = float(one.log_e_nc)
    levels = np.array([-1.0, place - 1e-9, place + 1e-9, 0.8, 0.9])
    p = energy_cdf(found, levels)
    assert (p[0], p[1]) == (0.0, 0.0)
    assert p[2] == pytest.approx(float(one.p_nc), abs=1e-8)
    assert p[4] == pytest.approx(1, abs=1e-15)
    assert np.all(np.diff(energy_cdf(found, np.linspace(-1, 1, 2001))) >= 0)


def test_density_is_the_slope_of_the_distribution_between_caustics() -> None:
    scene = load("moving-cap")
    step = mpmath.mpf(2) ** -20
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
        assert float(rate) == pytest.approx(p_cha * hazard(t), rel=1e-8)
    assert released == 0
    assert float(again) == pytest.approx(float(first), rel=1e-8)


@pytest.mark.parametrize("n_cycles", deep_but([10, 30], 10))
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
    """Return the variance of ten cycles' sum over ten times one cycle's."""
    ten = sum_of_cycles(scene, 10)
    mean = ten.mean_of(lambda s: s)
    return ten.mean_of(lambda s: (s - mean) ** 2) / float(10 * cumulants(scene, 2, 6)[2])


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
    one = solved[0]
    n_cycles = 10
    n = 40_000
    grid = np.linspace(one.s_nc - 1e-9, 0.8462, 20_001)
    rng = np.random.Generator(np.random.Philox(5))
    draws = np.interp(rng.random((n, n_cycles)), one.cdf(grid), grid).sum(axis=1)
    draws.sort()
    found = sum_of_cycles(one, n_cycles)
    distance = np.max(np.abs(found.cdf(draws) - (np.arange(n) + 0.5) / n))
    assert distance * np.sqrt(n) < 1.95
    wrong = sum_of_cycles(reversed_cycle(load("moving-cap")), n_cycles)
    assert np.max(np.abs(wrong.cdf(draws) - (np.arange(n) + 0.5) / n)) * np.sqrt(n) > 5


def saddle_point(scene: Mushroom, q: float, n_cycles: int) -> tuple[float, float, float, float]:
    """Approximate at s = n K'(q), K = log mean exp(q s), the sum of n cycles: s, density, P below and above.

    By Daniels (1954), with relative errors O(n^-2), and Lugannani and Rice (1980), O(1 / n) or better.
    """
    K, K1, K2, K3, K4 = map(float, cumulants(scene, 4, 12, q))
    correction = 1 + (K4 / K2**2 / 8 - 5 * K3**2 / K2**3 / 24) / n_cycles
    density = math.exp(n_cycles * (K - q * K1)) / math.sqrt(2 * math.pi * n_cycles * K2) * correction
    w = math.copysign(math.sqrt(2 * n_cycles * (q * K1 - K)), q)
    gap = math.exp(-w * w / 2) / math.sqrt(2 * math.pi) * (1 / (q * math.sqrt(n_cycles * K2)) - 1 / w)
    return n_cycles * K1, density, ndtr(w) - gap, ndtr(-w) + gap


def test_the_saddle_point_meets_the_convolution_and_the_gaussian_does_not(
    solved: tuple[Energies, Energies], figures: tuple[Prediction, Prediction]
) -> None:
    n_cycles = 30
    one = figures[0]
    spread = float(one.sd) * np.sqrt(n_cycles)
    rows = [saddle_point(load("moving-cap"), k / spread, n_cycles) for k in (-3.0, -1.0, 0.1, 1.0, 3.0)]
    s, density, below, above = np.transpose(rows)
    found = sum_of_cycles(solved[0], n_cycles)
    np.testing.assert_allclose(below, found.cdf(s), rtol=1e-3)
    np.testing.assert_allclose(above, 1 - found.cdf(s), rtol=1e-3)
    np.testing.assert_allclose(density, found.density(s), rtol=1e-4)
    gauss = np.exp(-(((s - n_cycles * float(one.m1)) / spread) ** 2) / 2) / (spread * np.sqrt(2 * np.pi))
    assert np.max(np.abs(gauss / found.density(s) - 1)) > 0.05


def test_a_tilted_convolution_meets_the_saddle_point_far_in_the_tail(
    solved: tuple[Energies, Energies],
) -> None:
    s, density, _, _ = saddle_point(load("moving-cap"), 5.0, 30)
    far = float(sum_of_cycles(solved[0], 30, q=5.0).density(s))
    assert far < 1e-12
    assert density == pytest.approx(far, rel=1e-3)


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
        k = cumulants(load(name), 0, 15, q + shift)[0]
        assert float(-k) <= float(found.rate) + 1e-15
        assert float(-k) == pytest.approx(float(found.rate), abs=1e-6)


@pytest.mark.parametrize(("forward", "backward"), PAIRS)
def test_a_cycle_and_its_reverse_are_equally_rare(forward: str, backward: str) -> None:
    one = rarity(load(forward), 20)
    other = rarity(load(backward), 20)
    assert abs(one.rate - other.rate) < mpmath.mpf(10) ** -21
    assert abs(one.place + other.place + 1) < mpmath.mpf(10) ** -19
    assert abs(one.place - other.place) > 0.02


@pytest.mark.parametrize(("forward", "backward"), PAIRS)
def test_phi_of_the_reverse_is_phi_of_minus_one_less_q_to_30_digits(forward: str, backward: str) -> None:
    rng = np.random.default_rng(11)
    for q in (rng.integers(-192, 128, 2) / 64).tolist():  # -1 - q is exact
        one = cumulants(load(forward), 0, 30, q)[0]
        other = cumulants(load(backward), 0, 30, -1 - q)[0]
        assert abs(one - other) < mpmath.mpf(10) ** -29
        mirrored = cumulants(load(backward), 0, 15, 1 - q)[0]
        assert abs(one - mirrored) > 1e-3  # about another place it does not hold


@pytest.mark.parametrize("name", deep_but(LOSSES, "fixed-cap-clockwise"))
def test_losses_are_those_of_sums_of_cycles(name: str) -> None:
    found = energies(load(name))
    for n, expected in LOSSES[name].items():
        loss = loss_probability(found, n)
        assert loss == pytest.approx(expected, rel=0.012)
        assert loss == pytest.approx(float(sum_of_cycles(found, n).cdf(0.0)), abs=1e-4)
    q = float(rarity(load(name), 12).place)  # where K' = 0
    for n in (400, 2_000, 10_000):
        assert loss_probability(found, n) == pytest.approx(saddle_point(load(name), q, n)[2], rel=2e-4)


def test_cycles_that_keep_energies_have_no_rate() -> None:
    assert rarity(load("moving-cap-trivial"), 10) == (0, -0.5)


Drawn = np.random.Generator


def retracing(rng: Drawn) -> Mushroom:
    """Draw a loop that runs back along itself while nu is above a half: h is 3 r / 4 there."""
    ends = rng.uniform(0.5, 1.5, 2)
    turn = rng.uniform(0.5, 1.5)
    excess = rng.uniform(0.5, 1.5)
    times = [0.0, 1.0, 2.0, 3.0, 4.0, 4.0 + rng.uniform(0.2, 0.8), 6.0]

    def through(values: list[float]) -> BangBang:
        return BangBang(knots=tuple(zip(times, map(float, values), strict=True)))

    sizes = ends[0], ends[1], ends[1], ends[1], ends[1], turn, ends[0]
    r = [math.ldexp(round(math.ldexp(x, 20)), -20) for x in sizes]  # 3 r is a binary64 number too
    h = [0.75 * x for x in r]
    h[3] += excess
    w = BangBang(knots=((0.0, 0.9), (1.0, 0.5), (2.0, 0.2), (3.0, 0.2), (4.0, 0.5), (6.0, 0.9)))
    return Mushroom(r=through(r), h=through(h), nu=w)


SCENES = [retracing(np.random.default_rng(seed)) for seed in range(4)]
solve = cache(energies)


def kept(scene: Mushroom) -> float:
    """Return the probability of being captured while the loop runs back along itself."""
    return 1 - float(chaotic_zone(scene, [float(Cycle.of(scene, 8).t_in(0.5))]).p_cha[0])


def has_its_atom(scene: Mushroom) -> bool:
    below, at = energies(scene).cdf(np.array([-1e-12, 0.0]))
    return abs(at - below - kept(scene)) < 1e-9


@pytest.mark.parametrize("scene", deep_but(SCENES, SCENES[0]))
def test_who_ends_with_one_energy_is_counted_as_one(scene: Mushroom) -> None:
    assert has_its_atom(scene)
    assert has_its_atom(reversed_cycle(scene))
    levels = [-1e-12, 0.0, 1e-12]
    many = [float(p) for p in cdf_at(scene, levels, 8)]
    assert many == pytest.approx(solve(scene).cdf(np.array(levels)).tolist(), abs=1e-8)
    assert density_at(scene, [0.0], 8) == (0,)


def test_telling_them_apart_by_rounding_is_found_out(monkeypatch: pytest.MonkeyPatch) -> None:
    own = Branch.below
    monkeypatch.setattr(Branch, "below", lambda branch, series, levels, _=0.0: own(branch, series, levels))
    assert not all(has_its_atom(scene) for scene in SCENES)


def drawn_losses(scene: Mushroom, n_cycles: int) -> tuple[float, float]:
    """Draw the share of E_n < E_0, and its error, in cycles with one interval of capture."""
    curve = capture_curve(scene, 100_001)
    found = solve(scene)
    u = np.random.default_rng(7).random((200_000, n_cycles))
    gain = np.interp(u, curve.p_cha[::-1], curve.s[::-1])
    share = (np.where(u < found.p_nc, found.s_nc, gain).sum(axis=1) < -1e-9).mean()
    return share, float(np.sqrt(share * (1 - share) / len(u)))


@pytest.mark.parametrize("n", deep_but([1, 2, 3], 2))
@pytest.mark.parametrize("scene", [SCENES[0], reversed_cycle(SCENES[0])])
def test_who_keeps_the_energy_is_not_lost(scene: Mushroom, n: int) -> None:
    share, error = drawn_losses(scene, n)
    assert loss_probability(solve(scene), n) == pytest.approx(share, abs=5 * error)
    atom = kept(scene) ** n  # half of it is what a lattice that shares the atom would count, or all
    assert atom / 2 > 5 * error or n == 3


@pytest.mark.parametrize("n", [1, 2, 3])
def test_the_uncaptured_of_a_loop_that_is_its_own_reverse_are_not_lost(n: int) -> None:
    """By p(-s) = p(s) exp(-s): the lost are the mean of exp(-S) over S > 0."""
    found = solve(load("retraced-arc"))
    assert found.s_nc == 0
    sums = sum_of_cycles(found, n)
    s = np.linspace(0.0, n * 3.0, 100_001)
    p = 1 - sums.cdf(s)
    p[0] = 1 - loss_probability(found, n) - found.p_nc**n
    gained = p[0] - np.trapezoid(np.exp(-s) * p, s)
    assert loss_probability(found, n) == pytest.approx(gained, rel=3e-4)
    assert float(sums.cdf(0.0)) > gained + 0.4 * found.p_nc**n  # a distribution function has them


@pytest.mark.parametrize("ctx", [fp, decimals(30)], ids=["floats", "30 digits"])
def test_compressed_masses_keep_the_means_of_polynomials(ctx) -> None:
    """Of masses that differ by rounding one is left; of few none is taken away."""
    grid = Grid(ctx, 16)
    many = [ctx.mpf(k) for k in range(1, 41)]
    total = ctx.fsum(many)
    one = 1 + 15 * ctx.eps
    for masses in ([(w, ctx.mpf(2)) for w in many], [(w, 2 * one if w == 7 else ctx.mpf(2)) for w in many]):
        assert compressed(grid, masses) == [(total, 2)]
    spread = [(w, ctx.cos(w)) for w in many]
    for low, masses in ((1, spread), (1 + 1e-6, [(w, 1 + (1 + s) * ctx.mpf(1e-6)) for w, s in spread])):
        few = compressed(grid, masses)
        assert len(few) == 17, low
        for degree in range(4):
            mine, its = (ctx.fsum(w * s**degree for w, s in these) for these in (few, masses))
            assert abs(mine - its) <= 1e4 * ctx.eps * total
    assert compressed(grid, spread[:17]) == spread[:17]


def test_a_sum_of_two_has_the_means_of_both() -> None:
    grid = Grid(fp, 16)
    first, second = ([(1 / 30, math.sin(a * k)) for k in range(30)] for a in (1.0, 2.3))
    found = convolve(grid, first, second)
    for degree in (1, 2, 3):
        direct = math.fsum(v * w * (r + s) ** degree for v, r in first for w, s in second)
        assert math.fsum(w * s**degree for w, s in found) == pytest.approx(direct, abs=1e-12)
