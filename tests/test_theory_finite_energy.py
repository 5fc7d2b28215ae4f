"""Finite energy with nothing fitted: rates, coefficients, distributions, limits; fits over energy.

Frozen rates are those of one cycle, however it is written, and of no other (theory/equations.md).
"""

import math
from collections.abc import Iterator

import msgspec
import numpy as np
import pytest
from mpmath import fp
from scipy.stats import ncx2, norm
from support.depth import deep_among, deep_but

import theory
from scene import BangBang, Fourier, Mushroom, Scene, load
from scene.geometry import table_at
from scene.transforms import backwards
from theory import NotCovered, cumulants
from theory.finite_energy import rates
from theory.finite_energy.fits import extrapolate, fit_power, unbiased_mean
from theory.finite_energy.one_cycle import FiniteEnergy, at_energy, kernel_cdf
from theory.finite_energy.rates import (
    MEMORIES,
    N_TIMES,
    PHASES,
    SPEEDS,
    Fields,
    MeasuredRates,
    find_rates,
    frozen_rates,
    kick_rates,
    rates_at,
)
from theory.prepared import PreparedMushroom, prepare

CYCLES = (
    "fixed-cap-anticlockwise",
    "fixed-cap-clockwise",
    "moving-cap",
    "moving-cap-reversed",
    "retraced-arc",
)


def known_rates(scene: Scene) -> MeasuredRates:
    """Return the rates that are known for a scene."""
    return find_rates(prepare(scene))


@pytest.mark.parametrize("variance", [1e-4, 0.003, 0.03, 0.1])
def test_the_blur_is_a_brownian_motion_in_four_dimensions(variance: float) -> None:
    x = np.linspace(-5, 5, 201) * math.sqrt(variance)
    exact = ncx2.cdf(np.exp(x / 2) * 16 / variance, 4, 16 / variance)
    assert np.abs(kernel_cdf(x, variance) - exact).max() < 0.5 * (variance / 16) ** 1.5
    fine = np.linspace(-9, 9, 40001) * math.sqrt(variance)
    mass = np.diff(kernel_cdf(fine, variance))
    middle = (fine[1:] + fine[:-1]) / 2
    assert mass @ middle == pytest.approx(variance / 4, rel=1e-3)
    assert mass @ np.exp(-middle / 2) == pytest.approx(1, abs=0.1 * (variance / 16) ** 1.5 + 1e-9)


def test_the_diffusion_that_keeps_the_measure_de_has_this_blur() -> None:
    """It drifts by a quarter of its variance, and exp(-s / 2) has no bias."""
    rng = np.random.default_rng(7)
    n = 100_000
    n_steps = 200
    e, variance = np.full(n, 1e4), 0.05  # of log E, 2 D / E^2 at the start
    for _ in range(n_steps):
        step = variance / n_steps
        e = e + 0.75 * e**0.5 * step * 100 + np.sqrt(e**1.5 * step * 100) * rng.standard_normal(n)
    s = np.sort(np.log(e / 1e4))
    places = (np.arange(n) + 0.5) / n
    assert np.abs(kernel_cdf(s, variance) - places).max() < 1.95 / math.sqrt(n)  # p = 1e-3
    gaussian = norm.cdf(s, variance / 4, math.sqrt(variance))
    assert np.abs(gaussian - places).max() > 1.95 / math.sqrt(n)
    error = s.std() / math.sqrt(n)
    assert abs(s.mean() - variance / 4) < 4 * error
    assert abs(np.exp(-s / 2).mean() - 1) < 4 * error / 2
    assert abs(s.mean() - variance / 2) > 3 * error
    assert abs(s.mean()) > 3 * error


def phase_volume_gap(name: str, energy: float, width: float = 0.3) -> float:
    """Return how far particles of all energies, uniform in phase space, end from uniform near an energy."""
    y, step = math.log(energy), 0.25  # the bump is 0.3 wide: what sums leave is below 1e-12
    total = 0.0
    for x in np.arange(y - 3.2, y + 2.6, step):
        f = FiniteEnergy(load(name), math.exp(x))
        centre = x + f.s_nc + f.point_masses.gain + f.point_masses.shift + f.point_masses.variance / 4
        spread = f.point_masses.variance + width**2
        bump = np.exp(-((centre - y) ** 2) / (2 * spread)) * width / np.sqrt(spread)
        total += math.exp(x - y) * float(f.point_masses.weight @ bump) * step
    return total / (math.exp(width**2 / 2) * width * math.sqrt(2 * math.pi)) - 1


@pytest.mark.parametrize(
    ("name", "size"),
    [pytest.param("fixed-cap-clockwise", 5e-5, marks=pytest.mark.deep), ("moving-cap", 5e-6)],
)
def test_phase_volume_is_kept(name: str, size: float, monkeypatch: pytest.MonkeyPatch) -> None:
    assert abs(phase_volume_gap(name, 1e8)) < size
    real = Fields.at

    def forgetful(self: Fields, name: str, gain: np.ndarray, t: np.ndarray | float) -> np.ndarray:
        return real(self, name, gain, t) * (name not in ("likelier", "hazards"))

    monkeypatch.setattr(Fields, "at", forgetful)  # capture as likely as without a lag
    assert abs(phase_volume_gap(name, 1e8)) > 4 * size


@pytest.mark.parametrize("name", deep_but(CYCLES, "moving-cap", "fixed-cap-clockwise"))
def test_great_energies_have_the_adiabatic_theory(name: str) -> None:
    scene = load(name)
    found = at_energy(scene, 1e20)
    right = theory.predict(scene, 10)
    assert found.p_nc == pytest.approx(float(right.p_nc), abs=1e-6)
    assert found.mean_s == pytest.approx(float(right.m1), abs=5e-6)
    assert math.sqrt(found.variance_s) == pytest.approx(float(right.sd), rel=1e-4)
    assert found.mean_of_exp(-0.5) == pytest.approx(float(theory.unbiased_mean(scene, 8)), abs=5e-6)
    below = theory.energy_cdf(scene, s := np.linspace(-1.2, 1.2, 49))
    assert np.abs(found.cdf(s) - below)[np.abs(s - found.s_nc) > 1e-3].max() < 3e-3


def test_figures_fit_the_drawn_cycles() -> None:
    found = at_energy(load("fixed-cap-clockwise"), 1e7)
    s = found.draw(2, 400_000, 5)
    first = s[:, 0]
    second = s[:, 1] - s[:, 0]
    error = math.sqrt(found.variance_s / len(first))
    assert abs(first.mean() - found.mean_s) < 4 * error
    assert first.var() == pytest.approx(found.variance_s, rel=0.01)
    assert abs(np.exp(-first / 2).mean() - found.mean_of_exp(-0.5)) < 4 * error
    gap = np.abs(found.cdf(np.sort(first)) - (np.arange(len(first)) + 0.5) / len(first)).max()
    assert gap < 1.95 / math.sqrt(len(first))
    assert abs(np.corrcoef(first, second)[0, 1]) < 0.02  # the richer blur and drift less
    assert np.array_equal(s, found.draw(2, 400_000, 5))


def test_reversed_cycles_turn_the_lags_and_keep_the_diffusion() -> None:
    forward = load("fixed-cap-anticlockwise")
    backward = load("fixed-cap-clockwise")
    t = np.array([0.06, 0.125, 0.2, 0.3, 0.45, 0.55, 0.7, 0.9])
    a = rates_at(known_rates(forward), t)
    b = rates_at(known_rates(backward), 1 - t)
    assert np.allclose(a.diffusion, b.diffusion)
    assert np.allclose(a.lag, -b.lag)
    assert np.allclose(a.square, b.square)
    assert frozen_rates(forward)[0] is frozen_rates(backward)[0]


@pytest.mark.parametrize("name", ["moving-cap", "fixed-cap-anticlockwise"])
def test_the_mean_kick_is_eq_de_without_the_flux(name: str) -> None:
    scene = load(name)
    h = 1e-5
    for t in (0.1, 0.3, 0.6, 0.9):
        t *= 2 * math.pi if name == "moving-cap" else 1
        log_e = theory.chaotic_zone(scene, [t - h, t + h]).log_energy
        assert kick_rates(scene, np.array([t]))[0] == pytest.approx((log_e[1] - log_e[0]) / (2 * h), rel=2e-3)


def test_the_zone_ends_at_the_peak_and_begins_at_nothing() -> None:
    found = at_energy(load("moving-cap"), 1e7)
    mean, variance = found.zone([0.0, math.pi, 2 * math.pi])
    assert mean[0] == pytest.approx(0, abs=1e-5)
    assert variance[0] == pytest.approx(0, abs=1e-9)
    assert (mean[-1], variance[-1]) == pytest.approx(found.peak, abs=2e-5)
    assert 0 < variance[1] < variance[2]


ALLOWED = [
    ("moving-cap", 1e4),
    ("moving-cap", 1e6),
    ("fixed-cap-anticlockwise", 1e6),
    ("retraced-arc", 1e4),
]


@pytest.mark.parametrize("asked", deep_but(ALLOWED, *ALLOWED[:2]))
def test_no_variance_is_negative_at_any_time_that_is_allowed(asked: tuple[str, float]) -> None:
    """At the start of the moving cap's cycle it was -1e-5, and of slower particles -0.02 within it."""
    name, energy = asked
    found = at_energy(load(name), energy)
    start, step = found._coefficients[:2]
    times = np.linspace(start - 16 * step, start + (N_TIMES + 16) * step, 4001)[1:-1]
    for _, variance in (found.zone(times), found.at_capture(times)):
        assert (variance >= 0).all()
        assert (variance > 0).mean() > 0.3
    lag, square = (found._fields.at(key, np.zeros(times.size), times) for key in ("lag", "square"))
    uncut = found._in_zone(times)[1] + square - lag**2  # as was told once
    assert uncut.min() < -1e-6
    assert np.array_equal(found.at_capture(times)[1], np.maximum(uncut, 0.0))


def test_the_table_covers_every_phase_with_its_errors() -> None:
    for name in CYCLES:
        rates, _ = frozen_rates(load(name))
        assert rates.diffusion.shape == (len(PHASES), len(MEMORIES))
        assert (rates.diffusion >= 0).all()
        assert rates.lag.shape == rates.square.shape == rates.depletion.shape == (len(PHASES), len(SPEEDS))
        whole, error = rates.diffusion.sum(axis=1), rates.diffusion_error.sum(axis=1)
        assert (error > 0).all()
        assert (error < 0.4 * whole).all()
        assert np.median(error / whole) < 0.04


@pytest.mark.parametrize("steps", [0.05, 0.7, 30.0])
@pytest.mark.parametrize("turning", [0.0, 0.3])
def test_kicks_are_remembered_as_their_correlations_say(steps: float, turning: float) -> None:
    """However long the memory, in steps of the cycle: a double integral, the speed being a wave that turns.

    Walls that turn velocities end the correlations sooner, by `turning` of the rate at which they end alone.
    """
    size = np.sin(2 * math.pi * (np.arange(N_TIMES) + 0.5) / N_TIMES)
    fields = Fields.__new__(Fields)
    fields._step = 1.0
    speed = np.full((1, N_TIMES), steps * MEMORIES[2])
    kicks = np.zeros((len(MEMORIES), 1, N_TIMES))
    kicks[2] = size
    found = fields._remembered(kicks, speed, np.full(N_TIMES, turning * steps))
    fine = np.repeat(size, 4)
    apart = np.abs(np.arange(1 - fine.size, fine.size)) / 4 * steps
    truth = np.correlate(fine, fine, "full") @ np.exp(-(1 + turning) * apart) * steps / 2 / 16
    if steps > 1:
        truth = (size**2).sum() / (1 + turning)
    assert found.sum() == pytest.approx(truth, rel=0.01)


@pytest.mark.parametrize("name", deep_among(CYCLES, "retraced-arc"))
@pytest.mark.parametrize(
    "energy", deep_among([1e-300, 1e-3, 1.0, 10.0, 100.0, 1e4, 1e6, 1e300], 1e-3, 1.0, 10.0, 1e6)
)
def test_at_any_energy_there_is_a_distribution_or_none_is_told(name: str, energy: float) -> None:
    """Corrections of the order v^-1 and v^(-2/3) that outweigh what they correct had left sd = 51 i."""
    try:
        found = at_energy(load(name), energy)
    except theory.NotCovered:
        assert energy <= 1e4
        return
    assert energy > 10
    figures = [found.p_nc, found.mean_s, found.variance_s**0.5, found.peak[1] ** 0.5, found.captured_mean]
    assert np.isrealobj(figures)
    assert np.isfinite([*figures, *found.theory_error]).all()
    below = found.cdf(np.linspace(-20, 20, 201))
    assert np.all(np.diff(below) >= -1e-12)
    assert below[[0, -1]] == pytest.approx([0, 1], abs=1e-3)


def all_at(scene: Mushroom, phases: np.ndarray) -> np.ndarray:
    now = table_at(fp, scene, phases)
    return np.concatenate([np.ravel(getattr(now, name)) for name in ("r", "w", "h", "slope")])


def by_every_fifth_phase(measured: PreparedMushroom, sought: PreparedMushroom) -> bool:
    """Compare cycles as was done once: at 13 times, without rates."""
    one, other = (all_at(each.given, each.period * PHASES[::5]) for each in (measured, sought))
    is_as_long = measured.period == sought.period
    return is_as_long and one.shape == other.shape and np.allclose(one, other, rtol=1e-9, atol=0.0)


def that_swings_between_phases() -> Mushroom:
    """Return the moving cap, its depth swung by waves that vanish at every fifth of PHASES."""
    times = 2 * math.pi * PHASES[::5]
    k = np.arange(1, 17)
    waves = np.concatenate([np.cos(np.outer(times, k)), np.sin(np.outer(times, k))], axis=1)
    swing = 0.05 * np.linalg.svd(waves)[2][-1]
    sin = swing[16:] + np.array([-0.5, *[0.0] * 15])
    depth = Fourier(mean=1.0, omega=1.0, cos=tuple(map(float, swing[:16])), sin=tuple(map(float, sin)))
    return msgspec.structs.replace(load("moving-cap"), h=depth)


def that_jolts_between_phases() -> Mushroom:
    """Return the fixed cap, its floor going down and up while it rested, between two of PHASES."""
    knots = (
        (0.0, 6.0),
        (0.25, 2.0),
        (0.259, 2.0),
        (0.262, 4.0),
        (0.265, 2.0),
        (0.5, 2.0),
        (0.75, 6.0),
        (1.0, 6.0),
    )
    return msgspec.structs.replace(load("fixed-cap-clockwise"), h=BangBang(knots))


@pytest.fixture
def forgotten() -> Iterator[None]:
    """Forget which rates were found, for a test that changes how they are found."""
    find_rates.cache_clear()
    yield
    find_rates.cache_clear()


@pytest.mark.usefixtures("forgotten")
@pytest.mark.parametrize("other", [that_swings_between_phases, that_jolts_between_phases])
def test_a_cycle_that_is_like_a_measured_one_at_phases_is_another(other, monkeypatch):
    """These were given the measured cycle's rates."""
    scene = other()
    for found in (scene, backwards(scene)):
        with pytest.raises(NotCovered, match="no frozen rates"):
            frozen_rates(found)
    monkeypatch.setattr(rates, "_is_one_cycle", by_every_fifth_phase)
    assert len(frozen_rates(scene)[0].lag) == len(PHASES)


def padded(law):
    """Return a law written at greater length."""
    if isinstance(law, Fourier):
        return Fourier(mean=law.mean, omega=law.omega, cos=(*law.cos, 0.0, 0.0), sin=law.sin)
    if isinstance(law, BangBang):
        (t, x), (u, y) = law.knots[:2]
        rest = (((t + u) / 2, x),) if x == y else ()
        return BangBang((law.knots[0], *rest, *law.knots[1:]))
    return law


def later(law):
    """Return a bang-bang law whose knots are told a period later."""
    return BangBang(tuple((t + 1, x) for t, x in law.knots)) if isinstance(law, BangBang) else law


@pytest.mark.parametrize("name", ["moving-cap", "fixed-cap-clockwise", "retraced-arc", "ergodic"])
@pytest.mark.parametrize("written", [padded, later])
def test_a_measured_cycle_is_known_however_it_is_written(name, written):
    scene = load(name)
    again = Mushroom(**{field: written(getattr(scene, field)) for field in scene.laws})
    assert frozen_rates(again)[0] is frozen_rates(scene)[0]
    assert frozen_rates(backwards(again))[0] is frozen_rates(scene)[0]


def by_its_width(name):
    """Return a scene whose mouth is told as w, not nu: w = nu r, and r moves."""
    scene = load(name)
    wave = Fourier(mean=0.6, omega=1.0, cos=(0.4,), sin=(0.3, 0.1))
    return Mushroom(r=scene.r, h=scene.h, w=wave if name == "moving-cap" else scene.r, slope=scene.slope)


@pytest.mark.parametrize("name", ["moving-cap", "ergodic"])
def test_a_mouth_given_by_its_width_has_the_same_rates(name, monkeypatch):
    """Multiplied by another pace than they were divided by, they were two times too great."""
    scene, again = load(name), by_its_width(name)
    times = np.linspace(0.1, 6.1, 13)
    for one, other in ((scene, again), (backwards(scene), backwards(again))):
        assert frozen_rates(other)[0] is frozen_rates(one)[0]
        known, found = known_rates(one), known_rates(other)
        for mine, its in zip(rates_at(known, times), rates_at(found, times), strict=True):
            np.testing.assert_allclose(its, mine, rtol=1e-9, atol=1e-9)
        assert rates.table_error(found) == pytest.approx(rates.table_error(known), rel=1e-9)
    wanted = rates_at(known_rates(scene), times).diffusion.sum(axis=1)
    own = rates.pace
    monkeypatch.setattr(rates, "pace", lambda _, at: own(again, at))  # as was done once
    assert np.abs(rates_at(known_rates(again), times).diffusion.sum(axis=1) / wanted - 1).max() > 0.5


@pytest.mark.parametrize("name", ["moving-cap", "ergodic"])
def test_a_mouth_given_by_its_width_leads_to_the_same_energies(name):
    one, other = (theory.at_energy(scene, 1e6) for scene in (load(name), by_its_width(name)))
    assert other.peak == pytest.approx(one.peak, rel=1e-9, abs=1e-12)
    assert other.theory_error == pytest.approx(one.theory_error, rel=1e-7)
    for mine, its in zip(one.point_masses, other.point_masses, strict=True):
        np.testing.assert_allclose(its, mine, rtol=1e-7, atol=1e-9)


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


@pytest.mark.parametrize("kept", [{0: 1.0}, {1: 1.0}, {0: 1.0, 2: 3.0}])
def test_blocks_are_of_twice_the_memory_that_diffusion_has(kept: dict[int, float]) -> None:
    """Where nothing moves a particle's path in a cycle is its speed, and the memory that of its kicks."""
    diffusion = np.zeros((N_TIMES, len(MEMORIES)))
    for k, weight in kept.items():
        diffusion[:, k] = 1e-3 * weight
    none = np.zeros((N_TIMES, len(SPEEDS)))
    zero = np.zeros(N_TIMES)
    rates_there = rates.RatesAt(diffusion, none, none, none)
    crossing, hardly = np.full(N_TIMES, np.pi), np.full(N_TIMES, 1e-9)  # kicks have the sign of the shear
    times = (0.0, 1 / N_TIMES)
    cycle = rates.CycleCoefficients(*times, zero, zero, zero > 0, hardly, crossing, rates_there)
    fields = Fields(cycle, 1e6)
    memory = sum(weight * MEMORIES[k] for k, weight in kept.items()) / sum(kept.values())
    assert fields.n_blocks == pytest.approx(2e6**0.5 / (2 * memory))
    assert (fields.depleted, fields.turned, fields.forgotten) == pytest.approx((0, 0, 0), abs=1e-6)
