"""Secs. 3.2 to 3.5: falls and rises of nu, capture and release; several captures a cycle, identities."""

import dataclasses
import importlib
import re
from fractions import Fraction
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings, strategies as st
from mpmath import MPContext
from numpy.typing import NDArray
from support.depth import deep_but

from scene import BangBang, Constant, Fourier, InvalidScene, Law, Mushroom, load
from scene.pieces import Period, PolynomialPiece
from scene.transforms import scaled
from theory import (
    Cycle,
    Energies,
    NotCovered,
    capture_curve,
    capture_time_mass,
    chaotic_zone,
    cumulants,
    energies,
    largest_gain,
    predict,
    reversed_cycle,
)
from theory.adiabatic import captures
from theory.critical import solve_rising, spans
from theory.cycle import MovingMushroom, NuWell
from theory.prepared import prepare


def test_moving_cap_releases_at_two_pi_minus_t() -> None:
    cycle = Cycle.of(load("moving-cap"), 30)
    ctx = cycle.ctx
    assert cycle.start == 0
    assert (cycle.nu_max, float(cycle.nu_min)) == (1, pytest.approx(0.2))
    for t in ("0.01", "1.3", "3.1"):
        assert abs(cycle.release_time(ctx.mpf(t)) - (2 * ctx.pi - ctx.mpf(t))) < ctx.mpf(10) ** -40
        later = ctx.mpf(t) + 6 * ctx.pi
        assert abs(cycle.release_time(later) - (8 * ctx.pi - ctx.mpf(t))) < ctx.mpf(10) ** -40
        nu = ctx.mpf(0.6) + ctx.mpf(0.4) * ctx.cos(ctx.mpf(t))
        assert abs(cycle.t_in(nu) - ctx.mpf(t)) < ctx.mpf(10) ** -40
        assert abs(cycle.t_out(nu) - cycle.release_time(ctx.mpf(t))) < ctx.mpf(10) ** -40


def test_degenerate_turns_are_found_with_their_orders() -> None:
    # nu' ~ -sin t (1 + cos t): quartic minimum. nu' ~ -sin t (1 + cos 2t): cubic inflections.
    for cos, orders in (([0.25, 0.0625], [4, 2]), ([0.28125, 0.0, 0.09375], [3, 2, 3, 2])):
        law = Fourier(mean=0.5, omega=1.0, cos=tuple(cos))
        ctx = MPContext()
        found = spans(ctx, prepare(Mushroom(r=1.0, h=1.0, nu=law)))
        assert sorted(s.start_order for s in found) == sorted(orders)


@pytest.mark.parametrize("shift", [0.0, 1.0, -2.5, 3.0])
def test_a_shift_in_time_shifts_the_start(shift: float) -> None:
    # cos(t - shift), so the fall starts at the shift, taken into [0, 2 pi).
    ctx = MPContext()
    ctx.dps = 30
    law = Fourier(mean=0.5, omega=1.0, cos=(float(ctx.cos(shift)) / 4,), sin=(float(ctx.sin(shift)) / 4,))
    cycle = Cycle.of(Mushroom(r=1.0, h=1.0, nu=law), 15)
    assert float(cycle.start) == pytest.approx(shift % float(2 * ctx.pi), abs=1e-12)
    assert 0 <= cycle.start < cycle.period


@pytest.mark.parametrize("wave", deep_but([(3, -4), (-3, 4), (-3, -4)], (3, -4)))
def test_a_mouth_that_opens_fully_at_no_round_time(wave: tuple[int, int]) -> None:
    cos, sin = wave
    # w = r (m + c cos t + s sin t), r = 1 + sin t / 2, exact in binary64: w / r touches 1, and rounding
    # carries it above at some digits.
    c = cos / 32
    s = sin / 32
    m = 1 - 5 / 32
    w = Fourier(mean=m + s / 4, omega=1.0, cos=(c, -s / 4), sin=(s + m / 2, c / 4))
    scene = Mushroom(r=Fourier(mean=1.0, omega=1.0, sin=(0.5,)), h=1.0, w=w)
    for digits in range(5, 25):
        cycle = Cycle.of(scene, digits)
        assert cycle.nu_max == 1
        whole = cycle.t_out(cycle.nu_max) - cycle.t_in(cycle.nu_max)
        assert abs(whole - cycle.period) < cycle.ctx.mpf(10) ** -(digits + 35)


@pytest.mark.parametrize("length", [0, -600])
def test_width_over_radius_is_the_same_cycle_as_nu(length: int) -> None:
    """In small units too, where the square of the radius is no float."""
    # (1/2 + cos t / 4) (1 + sin t / 2), exact in binary64.
    r = Fourier(mean=1.0, omega=1.0, sin=(0.5,))
    w = Fourier(mean=0.5, omega=1.0, cos=(0.25,), sin=(0.25, 0.0625))
    by_w = Cycle.of(scaled(Mushroom(r=r, h=1.0, w=w), length, 0), 20)
    by_nu = Cycle.of(Mushroom(r=r, h=1.0, nu=Fourier(mean=0.5, omega=1.0, cos=(0.25,))), 20)
    ctx = by_w.ctx
    for nu in ("0.3", "0.5", "0.7"):
        assert abs(by_w.t_in(ctx.mpf(nu)) - by_nu.t_in(ctx.mpf(nu))) < ctx.mpf(10) ** -45
        assert abs(by_w.t_out(ctx.mpf(nu)) - by_nu.t_out(ctx.mpf(nu))) < ctx.mpf(10) ** -45


class Cubic(Law, frozen=True):
    """A law of a kind that there is not: 1 + t^3 for a time 2."""

    cycle = Period(None, Fraction(2))
    is_polynomial = True

    def breakpoints(self) -> list[Fraction]:
        """Return both ends."""
        return [Fraction(0), Fraction(2)]

    def piece_at(self, time: Fraction) -> PolynomialPiece:
        """Return the first piece."""
        coefficients = tuple(map(Fraction, (1, 0, 0, 1)))
        return PolynomialPiece(Fraction(0), coefficients, Fraction(2))


def test_a_cubic_over_a_parabola_is_not_covered() -> None:
    ramp = BangBang(knots=((0.0, 0.5), (1.0, 0.75), (2.0, 0.5)))
    plain = prepare(Mushroom(r=1.0, h=1.0, nu=ramp))
    cubic = dataclasses.replace(plain, mouth=(Cubic(), Constant(1.0)), jointed=(Cubic(),))
    assert len(spans(MPContext(), cubic)) == 1
    with pytest.raises(NotCovered, match="a cubic at most"):
        spans(MPContext(), dataclasses.replace(cubic, mouth=(Cubic(), ramp)))


def test_bang_bang_width_and_radius_turn_between_knots() -> None:
    # w and r both move in the leg [0, 1]; dense sampling finds the same extremes.
    w = BangBang(knots=((0.0, 0.5), (1.0, 0.75), (3.0, 0.5)))
    r = BangBang(knots=((0.0, 1.0), (2.0, 1.5), (3.0, 1.0)))
    cycle = Cycle.of(Mushroom(r=r, h=1.0, w=w), 15)
    sampled = [w.value(cycle.ctx, k / 512) / r.value(cycle.ctx, k / 512) for k in range(1536)]
    assert max(sampled) <= cycle.nu_max < max(sampled) + 1e-4
    assert min(sampled) - 1e-4 < cycle.nu_min <= min(sampled)


@pytest.mark.parametrize("name", ["moving-cap", "fixed-cap-clockwise", "retraced-arc"])
@pytest.mark.parametrize("digits", [15, 200])
def test_times_of_capture_and_release_have_the_mouth_asked_for_to_all_digits(name: str, digits: int) -> None:
    """Parabolas are inverted in closed form, waves from a solution in binary64."""
    cycle = Cycle.of(load(name), digits)
    assert cycle.pieces
    for piece in cycle.pieces:
        for stretch in (piece.capture, piece.release):
            for share in (0.01, 0.5, 0.99):
                nu = piece.nu_lower + (piece.nu_upper - piece.nu_lower) * cycle.ctx.mpf(share)
                t = stretch.time(nu)
                assert min(stretch.lower, stretch.upper) < t < max(stretch.lower, stretch.upper)
                assert abs(stretch.motion.nu(t)[0] - nu) < cycle.ctx.mpf(10) ** (2 - cycle.ctx.dps)


@pytest.mark.parametrize("size", [1.0, 1e-30, 1e-290])
@pytest.mark.parametrize("digits", [15, 60, 300])
def test_waves_are_summed_to_their_last_bits(size: float, digits: int) -> None:
    """However small the waves: rates are right relatively to them, where one of them alone is seen."""
    draw = np.random.default_rng(digits)
    cos, sin = (
        tuple((size * draw.uniform(-1, 1, 16) * 10.0 ** -draw.integers(0, 9, 16)).tolist()) for _ in "ab"
    )
    law = Fourier(mean=0.5, omega=1.7, cos=tuple(0.03 * c for c in cos), sin=tuple(0.03 * s for s in sin))
    ctx = MPContext()
    finer = MPContext()
    ctx.dps = digits
    finer.dps = digits + 400
    motion = MovingMushroom(ctx, prepare(Mushroom(r=1.0, h=1.0, nu=law)), Fraction(0))
    for t in draw.uniform(0, 3, 5).tolist():
        nu, rate = (finer.mpf(x) for x in motion.nu(ctx.mpf(t)))
        assert abs(nu - law.value(finer, finer.mpf(t))) < finer.mpf(10) ** -(digits - 1)
        assert abs(rate - law.value(finer, finer.mpf(t), 1)) < size * finer.mpf(10) ** -(digits - 2)


def test_a_root_is_found_where_newton_alone_runs_away() -> None:
    ctx = MPContext()
    ctx.dps = 30
    root = solve_rising(ctx, lambda x: (ctx.atan(50 * x - 3), 50 / (1 + (50 * x - 3) ** 2)), -10, ctx.mpf(90))
    assert abs(root - ctx.mpf(3) / 50) < ctx.mpf(10) ** -29


def test_the_table_of_equations_names_what_exists() -> None:
    tests = Path(__file__).parent
    table = (tests.parent / "theory" / "equations.md").read_text("utf-8")
    written = "".join(file.read_text("utf-8") for file in tests.glob("test_*.py"))
    functions = re.findall(r"`(\w+)\.(\w+)`", table)
    cases = re.findall(r"`(test_\w+)`", table)
    assert len(functions) > 15
    for module, function in functions:
        room = "" if find_spec(f"theory.{module}") else "finite_energy."
        assert hasattr(importlib.import_module(f"theory.{room}{module}"), function), f"{module}.{function}"
    for case in cases:
        assert f"def {case}(" in written, case


Floats = NDArray[np.float64]

# nu falls from 0.875 to 0.242, rises to 0.625, falls and rises again: a particle is captured up to twice.
TWICE = Mushroom(
    r=Fourier(mean=1.0, omega=1.0, sin=(0.5,)),
    h=Fourier(mean=1.0, omega=1.0, cos=(0.25,), sin=(-0.25,)),
    nu=Fourier(mean=0.5, omega=1.0, cos=(0.125, 0.25)),
    slope=0.0625,
)


def nested(well: NuWell) -> list[Any]:
    """Show the tree: [highest nu, lowest nu, children...]."""
    ends = [round(float(nu), 6) for p in well.pieces for nu in (p.nu_upper, p.nu_lower)]
    return [max(ends, default=None), min(ends, default=None), *(nested(child) for child in well.children)]


def test_a_valley_splits_at_its_highest_inner_peak() -> None:
    assert nested(Cycle.of(TWICE, 10).well) == [0.875, 0.625, [0.625, 0.242188], [0.625, 0.242188]]


def test_equal_maxima_make_valleys_side_by_side_and_lower_ones_nest() -> None:
    knots = ((0.0, 0.9), (1.0, 0.2), (2.0, 0.5), (3.0, 0.3), (4.0, 0.7), (5.0, 0.1), (6.0, 0.9))
    w = BangBang(knots=(*knots, (7.0, 0.4), (8.0, 0.9)))
    tree = Cycle.of(Mushroom(r=1.0, h=1.0, w=w), 10).well
    first = [0.9, 0.7, [0.7, 0.5, [0.5, 0.2], [0.5, 0.3]], [0.7, 0.1]]
    assert nested(tree) == [None, None, first, [0.9, 0.4]]


def test_release_is_the_first_return_of_nu() -> None:
    # trelease itself, by marching in time.
    cycle = Cycle.of(TWICE, 15)

    def nu(t: Floats) -> Floats:
        return np.asarray(0.5 + 0.125 * np.cos(t) + 0.25 * np.cos(2 * t))

    for t in (0.2, 0.7, 0.75, 1.6, 3.3, 4.5):
        later = np.linspace(t, t + 6.3, 200_001)[2:]
        expected = later[np.argmax(nu(later) >= nu(np.array([t])))]
        assert float(cycle.release_time(t)) == pytest.approx(expected, abs=5e-5)
    for t in (1.8, 3.1, 4.6, 6.0):
        assert cycle.release_time(t) == t


def adiabatic_model(n: int, seed: int, most: int = 9) -> tuple[Floats, NDArray[np.int64]]:
    """Follow n particles of the adiabatic model of `TWICE` by chance; none of the theory package.

    In the chaotic zone log E follows Eq:dE and capture has the hazard of Eq:dps/ps; in the cap it follows
    Eq:dEe until nu first returns. A particle is captured at most `most` times. Returns s and the
    number of captures of each.
    """
    t = np.linspace(0.0, 2 * np.pi, 40_001)
    r = 1 + np.sin(t) / 2
    h = 1 + np.cos(t) / 4 - np.sin(t) / 4
    nu = 0.5 + 0.125 * np.cos(t) + 0.25 * np.cos(2 * t)
    cap = np.pi**2 * r**2
    stem = 2 * np.pi * (2 * nu * r * h - 0.0625 * h**2)
    delta = 2 / np.pi * (np.arccos(nu) - nu * np.sqrt(1 - nu**2))
    chaotic = cap + stem - delta * cap
    flux = np.diff(delta) * ((cap / chaotic)[1:] + (cap / chaotic)[:-1]) / 2
    spent = np.concatenate([[0.0], np.cumsum(np.maximum(flux, 0.0))])
    gain = -np.log(chaotic / chaotic[0]) - np.concatenate([[0.0], np.cumsum(flux)])
    released = t.copy()
    open_ = [0]
    for i in range(1, t.size):
        while open_ and nu[i] >= nu[open_[-1]]:
            released[open_.pop()] = t[i]
        open_.append(i)
    released[open_] = t[open_]
    rng = np.random.Generator(np.random.Philox(seed))
    now = np.zeros(n)
    s = np.zeros(n)
    n_captures = np.zeros(n, dtype=np.int64)
    alive = np.arange(n)
    for _ in range(most):
        threshold = np.interp(now[alive], t, spent) + rng.exponential(size=alive.size)
        done = threshold >= spent[-1]
        left = alive[done]
        s[left] += gain[-1] - np.interp(now[left], t, gain)
        now[left] = t[-1]
        alive = alive[~done]
        t_in = np.interp(threshold[~done], spent, t)
        t_out = np.interp(t_in, t, released)
        s[alive] += np.interp(t_in, t, gain) - np.interp(now[alive], t, gain)
        s[alive] += np.log(np.interp(t_in, t, cap) / np.interp(t_out, t, cap))
        now[alive], n_captures[alive] = t_out, n_captures[alive] + 1
    s[alive] += gain[-1] - np.interp(now[alive], t, gain)
    return s, n_captures


N = 40_000


@pytest.fixture(scope="module")
def sample() -> tuple[Floats, NDArray[np.int64]]:
    return adiabatic_model(N, 20140601)


def test_figures_agree_with_an_independent_monte_carlo(sample: tuple[Floats, NDArray[np.int64]]) -> None:
    s, n_captures = sample
    found = predict(TWICE, digits=8)
    p_nc = float(found.p_nc)
    assert abs(np.mean(n_captures == 0) - p_nc) < 4 * np.sqrt(p_nc * (1 - p_nc) / N)
    assert np.mean(n_captures == 2) > 0.1
    for f, figure in [
        (s, found.m1),
        ((s - float(found.m1)) ** 2, found.sd**2),
        (np.exp(-s), found.mean_exp_minus),
        (np.exp(s), found.mean_exp_plus),
    ]:
        assert abs(f.mean() - float(figure)) < 4 * f.std() / np.sqrt(N)
    assert np.mean(s[n_captures == 0]) == pytest.approx(float(found.log_e_nc), abs=1e-6)


@pytest.fixture(scope="module")
def solved() -> Energies:
    return energies(TWICE)


def kolmogorov(found: Energies, s: Floats, n_captures: NDArray[np.int64]) -> float:
    """Return sqrt(n) times the largest distance of the captured sample from the theory's distribution."""
    captured = np.sort(s[n_captures > 0])
    theory = found.captured_below(captured) / (1 - found.p_nc)
    steps = np.arange(captured.size + 1) / captured.size
    distance = max(np.max(theory - steps[:-1]), np.max(steps[1:] - theory))
    return float(distance * np.sqrt(captured.size))


def test_the_distribution_agrees_with_an_independent_monte_carlo(
    solved: Energies, sample: tuple[Floats, NDArray[np.int64]]
) -> None:
    assert kolmogorov(solved, *sample) < 1.95  # exceeded with probability 1e-3


def test_a_model_without_recapture_is_refused(solved: Energies) -> None:
    assert kolmogorov(solved, *adiabatic_model(N, 20140601, most=1)) > 5


@pytest.mark.deep
def test_mean_exp_minus_s_is_one_to_40_digits_with_recapture() -> None:
    found = captures(Cycle.of(TWICE, 40), 46)
    with found.binary.working():
        assert abs(found.taylor(-1, 0)[0] - 1) < found.binary.mpf(10) ** -40


def test_a_reversed_cycle_with_recapture_is_the_forward_one_weighted_by_exp_minus_s() -> None:
    # K'(q) of the reversed cycle is K(-1 - q): all its cumulants are those at q = -1, signs alternating.
    back = cumulants(reversed_cycle(TWICE), 3, digits=15)
    ahead = cumulants(TWICE, 3, digits=15, q=-1.0)
    for k in (1, 2, 3):
        assert abs(back[k] - (-1) ** k * ahead[k]) < 1e-15


def test_two_rounds_of_a_cycle_are_two_independent_cycles() -> None:
    one = Mushroom(
        r=Fourier(mean=1.0, omega=2.0, sin=(0.5,)), h=1.0, nu=Fourier(mean=0.75, omega=2.0, cos=(0.125,))
    )
    two = Mushroom(
        r=Fourier(mean=1.0, omega=1.0, sin=(0.0, 0.5)),
        h=1.0,
        nu=Fourier(mean=0.75, omega=1.0, cos=(0.0, 0.125)),
    )
    once = cumulants(one, 4, digits=10, q=0.5)
    twice = cumulants(two, 4, digits=10, q=0.5)
    assert len(Cycle.of(two, 10).well.children) == 2
    for a, b in zip(once, twice, strict=True):
        assert abs(b / (2 * a) - 1) < 1e-9


def test_curves_follow_every_valley(solved: Energies) -> None:
    curve = capture_curve(TWICE, 601)
    assert np.all(np.diff(curve.t_in) >= 0)
    zone = chaotic_zone(TWICE, [*curve.t_in, *curve.t_out, 2 * np.pi - 1e-9])
    np.testing.assert_allclose(zone.p_cha[:-1], [*curve.p_cha, *curve.p_cha], atol=1e-6)
    assert zone.log_energy[-1] == pytest.approx(solved.s_nc, abs=1e-6)
    captured = capture_time_mass(TWICE, [0.0, 2.0, 7.0])
    _, n_captures = adiabatic_model(20_000, 7)
    assert captured.sum() == pytest.approx(n_captures.mean(), abs=4 * n_captures.std() / np.sqrt(20_000))
    best = largest_gain(TWICE)
    assert best is not None
    assert best[1] == pytest.approx(curve.s.max(), abs=1e-4)


amplitude = st.integers(-24, 24).map(lambda k: k / 64)
# One interval of capture, mostly; and mostly several, in which particles are captured again.
harmonics = st.one_of(
    st.tuples(st.just(0.3125), st.integers(-4, 4).map(lambda k: k / 64)),
    st.tuples(amplitude.map(lambda a: a / 3), st.just(0.1875), amplitude.map(lambda a: a / 3)),
)


@settings(
    max_examples=11, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.filter_too_much]
)
@given(st.lists(amplitude, min_size=4, max_size=4), harmonics, st.integers(0, 12))
def test_growth_is_never_negative(amplitudes: list[float], cos: tuple[float, ...], tangent: int) -> None:
    r_cos, r_sin, h_cos, h_sin = amplitudes

    try:
        scene = Mushroom(
            r=Fourier(1.0, 1.0, (r_cos,), (r_sin,)),
            h=Fourier(1.0, 1.0, (h_cos,), (h_sin,)),
            nu=Fourier(0.5, 1.0, cos),
            slope=tangent / 64,
        )
    except InvalidScene:
        assume(False)
    found = predict(scene, 8)
    assert found.m1 >= 0
    assert 0 < found.p_nc < 1
    assert abs(found.mean_exp_minus - 1) < 1e-8
