"""Secs. 2 and 3: volumes of cap, stem, island and chaotic zone, invariants of the cap, energies in zones."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from mpmath import MPContext, fp

import fast
from scene import BadInput, Fourier, Horizon, Mushroom, State, load
from theory import (
    cap_invariant,
    capture_curve,
    log_energy_rate_chaotic,
    log_energy_rate_island,
    predict,
    sin_phi_hat,
    v_cap,
    v_cha,
    v_ell,
    v_stem,
    volumes_at,
)
from theory.volumes import delta, delta_slope


@pytest.fixture
def ctx() -> Any:
    context = MPContext()
    context.dps = 50
    return context


@pytest.mark.parametrize("nu", ["0", "0.01", "0.3", "0.5", "0.99", "1"])
def test_delta_is_its_integral_to_40_digits(ctx: Any, nu: str) -> None:
    r = ctx.mpf("1.7")
    w = ctx.mpf(nu) * r
    island = 4 * ctx.pi * ctx.quad(lambda s: ctx.sqrt(abs(r * r - s * s)), [w, (w + r) / 2, r])
    assert abs(delta(ctx, ctx.mpf(nu)) - island / v_cap(ctx, r)) < ctx.mpf(10) ** -40
    assert abs(v_ell(ctx, r, ctx.mpf(nu)) - island) < ctx.mpf(10) ** -39


def share_of_island(ctx: Any, nu: Any) -> Any:
    """Return delta by its formula, which loses digits where nu is near 1."""
    return 2 * (ctx.acos(nu) - nu * ctx.sqrt(1 - nu * nu)) / ctx.pi


def worst_of_small_islands(share: Callable[..., Any]) -> float:
    """Return the largest relative error, in units of 2^-53, of a share in floats; 0.5 <= nu < 1."""
    many = MPContext()
    found = 0.0
    many.dps = 80
    for nu in (1 - 2.0**-k * part for k in range(1, 54) for part in (1.0, 0.5625, 0.71875)):
        if nu < 1:
            found = max(found, float(abs(share(fp, nu) / share_of_island(many, many.mpf(nu)) - 1)) * 2.0**53)
    return found


def test_a_small_island_is_known_as_well_as_a_large_one() -> None:
    assert worst_of_small_islands(delta) < 12
    assert worst_of_small_islands(share_of_island) > 1e10
    few = MPContext()
    many = MPContext()
    few.dps = 30
    many.dps = 100
    for nu in (1 - few.mpf(10) ** -k for k in (0.7, 1, 8, 16, 29)):
        truth = share_of_island(many, many.mpf(nu))
        assert abs(many.mpf(delta(few, nu)) / truth - 1) < many.mpf(10) ** -29
    assert delta(fp, 1.0) == delta(few, few.one) == 0
    assert 0 < v_ell(fp, 1.0, 1 - 2.0**-53) < 1e-22


def test_delta_slope_is_its_derivative(ctx: Any) -> None:
    for nu in ("0.1", "0.5", "0.9"):
        measured = ctx.diff(lambda x: delta(ctx, x), ctx.mpf(nu))
        assert abs(delta_slope(ctx, ctx.mpf(nu)) - measured) < ctx.mpf(10) ** -20


@pytest.mark.parametrize("nu", [0.1, 0.3, 0.65, 0.9])
def test_delta_is_the_captured_share_of_phase_points(nu: float) -> None:
    n = 400_000
    r = 1.3
    rng = np.random.Generator(np.random.Philox(20140601))
    rho = r * np.sqrt(rng.random(n))
    psi = np.pi * rng.random(n)
    direction = 2 * np.pi * rng.random(n)
    x, y = rho * np.cos(psi), rho * np.sin(psi)
    captured = np.abs(sin_phi_hat(np, x, y, np.cos(direction), np.sin(direction), r)) > nu
    expected = delta(fp, nu)
    sigma = np.sqrt(expected * (1 - expected) / n)
    assert abs(captured.mean() - expected) < 5 * sigma


def test_cap_and_stem_are_two_pi_times_their_areas(ctx: Any) -> None:
    r, w, h, slope = (ctx.mpf(x) for x in ("1.3", "0.8", "2.1", "0.2"))
    cap = ctx.quad(lambda y: 2 * ctx.sqrt(abs(r * r - y * y)), [0, r / 2, r])
    stem = ctx.quad(lambda y: 2 * (w + slope * y), [-h, 0])
    assert abs(v_cap(ctx, r) - 2 * ctx.pi * cap) < ctx.mpf(10) ** -40
    assert abs(v_stem(ctx, w, h, slope) - 2 * ctx.pi * stem) < ctx.mpf(10) ** -45
    whole = v_cap(ctx, r) + v_stem(ctx, w, h, slope)
    assert abs(v_cha(ctx, r, w, h, slope) + v_ell(ctx, r, w / r) - whole) < ctx.mpf(10) ** -45


def test_volumes_of_a_scene_agree_in_floats_and_in_many_digits(ctx: Any) -> None:
    for name in ("moving-cap", "fixed-cap-clockwise", "frozen-mushroom", "ergodic"):
        scene = load(name)
        for t in (0.0, 0.1, 0.375, 2.5, 7.25):
            many = volumes_at(ctx, scene, ctx.mpf(t))
            few = volumes_at(fp, scene, t)
            assert [float(x) for x in many] == pytest.approx(list(few), rel=1e-14, abs=1e-14)


def test_moving_cap_volumes_are_the_formulas_of_the_scene(ctx: Any) -> None:
    t = ctx.mpf("1.1")
    r = 1 + ctx.sin(t) / 2
    h = 1 - ctx.sin(t) / 2
    nu = ctx.mpf(0.6) + ctx.mpf(0.4) * ctx.cos(t)
    found = volumes_at(ctx, load("moving-cap"), t)
    assert abs(found.nu - nu) < ctx.mpf(10) ** -48
    assert abs(found.v_cha - v_cha(ctx, r, nu * r, h, ctx.mpf(0.1111))) < ctx.mpf(10) ** -46


@pytest.mark.parametrize("nu", [1.0, 0.3, 1e-5, 1e-12, 1e-40, 1e-300])
def test_the_chaotic_zone_keeps_its_digits_however_narrow_the_mouth(ctx: Any, nu: float) -> None:
    """Cap and stem less the island left none of them where the island fills the cap within rounding."""
    w = ctx.mpf(nu)
    h = ctx.mpf(0.25)
    strip = ctx.quad(lambda s: ctx.sqrt(1 - (w * s) ** 2), [0, 1])
    zone = 4 * ctx.pi * w * strip + v_stem(ctx, w, h, 0)
    assert abs(v_cha(ctx, ctx.one, w, h, 0) / zone - 1) < ctx.mpf(10) ** -40
    assert v_cha(fp, 1.0, nu, 0.25, 0.0) == pytest.approx(float(zone), rel=1e-15)
    assert volumes_at(fp, Mushroom(r=1.0, h=0.25, w=nu), 0.0).v_cha == pytest.approx(float(zone), rel=1e-15)


def test_sin_phi_hat_is_the_incidence_angle_on_the_arc() -> None:
    r = 1.4
    psi = 0.8
    phi = 0.3
    speed = 7.0
    x, y = r * math.cos(psi), r * math.sin(psi)
    vx, vy = speed * math.cos(psi - phi), speed * math.sin(psi - phi)
    assert sin_phi_hat(fp, x, y, vx, vy, r) == pytest.approx(math.sin(phi), rel=1e-14)


BREATHING = Mushroom(
    r=Fourier(0.8, 1.0, cos=(0.2, 0.03), sin=(0.0, 0.05)), h=0.7, nu=Fourier(0.3, 1.0, sin=(0.1,))
)


def captives(speed: float, n: int) -> list[State]:
    """Return particles of the island of BREATHING, |sin phi_hat| > 0.55, at t = 0."""
    random = np.random.default_rng(7)
    r = float(BREATHING.laws["r"].value(fp, 0.0))
    found: list[State] = []
    while len(found) < n:
        x = random.uniform(-r, r)
        y = random.uniform(0, r)
        turn = random.uniform(0, 2 * math.pi)
        vx, vy = speed * math.cos(turn), speed * math.sin(turn)
        if math.hypot(x, y) < 0.99 * r and abs(sin_phi_hat(fp, x, y, vx, vy, r)) > 0.55:
            found.append(State(0.0, x, y, vx, vy))
    return found


def drifts(t: float, speed: float, of: Callable[..., float]) -> float:
    """Return the largest change by time t of a function of (x, y, vx, vy, r)."""
    starts = captives(speed, 40)
    largest = 0.0
    r0, r1 = (float(BREATHING.laws["r"].value(fp, at)) for at in (0.0, t))
    for start, end in zip(starts, fast.flow(BREATHING, starts, t).outcomes, strict=True):
        assert isinstance(end, Horizon)
        before = of(start.x, start.y, start.vx, start.vy, r0)
        largest = max(largest, abs(of(end.x, end.y, end.vx, end.vy, r1) - before))
    return largest


@pytest.mark.parametrize(
    "of",
    [
        lambda x, y, vx, vy, r: abs(float(sin_phi_hat(fp, x, y, vx, vy, r))),
        lambda x, y, vx, vy, r: math.log(cap_invariant(fp, vx, vy, r)),
    ],
    ids=["sin phi hat", "invariant"],
)
def test_what_the_cap_keeps_drifts_as_one_over_v(of: Callable[..., float]) -> None:
    for t in (2.3, 2 * math.pi):
        slow, quick = (speed * drifts(t, speed, of) for speed in (40.0, 4000.0))
        assert 0.3 < slow / quick < 3
        assert quick < 3


@pytest.mark.parametrize(
    "wrong",
    [
        lambda x, y, vx, vy, r: float(sin_phi_hat(fp, x, y, vx, vy, r)),  # its sign is turned by the base
        lambda x, y, vx, vy, r: abs(float(sin_phi_hat(fp, x, y, vx, vy, 1.0))),  # the radius of the start
        lambda x, y, vx, vy, r: math.log((vx * vx + vy * vy) * r),  # of E r
    ],
)
def test_what_the_cap_does_not_keep_is_told_from_it(wrong: Callable[..., float]) -> None:
    assert drifts(2.3, 4000.0, wrong) * 4000 > 100


def test_cap_invariant_is_energy_times_volume() -> None:
    assert cap_invariant(fp, 3.0, 4.0, 2.0) == pytest.approx(12.5 * 4 * math.pi**2)


def _rates(ctx: Any) -> tuple[Any, Any]:
    """Eq:dE and Eq:dEe along the moving cap, its volumes differentiated numerically."""
    scene = load("moving-cap")

    def chaotic(t: Any) -> Any:
        now = volumes_at(ctx, scene, t)
        volume_rate = ctx.diff(lambda x: volumes_at(ctx, scene, x).v_cha, t)
        nu_rate = -ctx.mpf(0.4) * ctx.sin(t)
        return log_energy_rate_chaotic(now.v_cha, now.v_cap, volume_rate, delta_slope(ctx, now.nu) * nu_rate)

    def island(t: Any) -> Any:
        volume_rate = ctx.diff(lambda x: volumes_at(ctx, scene, x).v_cap, t)
        return log_energy_rate_island(volumes_at(ctx, scene, t).v_cap, volume_rate)

    return chaotic, island


def test_the_rates_integrate_to_the_energies_of_the_cycle() -> None:
    # The first line of Eq:lnE/E0 and Eq:lnEnc/E0, zone by zone in time.
    ctx = MPContext()
    ctx.dps = 20
    chaotic, island = _rates(ctx)
    nowhere = ctx.quad(chaotic, [0, ctx.pi, 2 * ctx.pi], maxdegree=5)
    assert abs(nowhere - predict(load("moving-cap")).log_e_nc) < 1e-9
    captured = capture_curve(load("moving-cap"), 9)
    t_in = ctx.mpf(captured.t_in[4])
    t_out = ctx.mpf(captured.t_out[4])
    free = ctx.quad(chaotic, [0, t_in], maxdegree=4) + ctx.quad(chaotic, [t_out, 2 * ctx.pi], maxdegree=4)
    held = ctx.quad(island, [t_in, t_out], maxdegree=5)
    assert float(free + held) == pytest.approx(captured.s[4], abs=1e-8)


@pytest.mark.parametrize("name", ["moving-cap", "fixed-cap-anticlockwise", "frozen-mushroom"])
def test_the_volumes_at_many_times_are_those_at_each(name):
    scene = load(name)
    times = np.linspace(-1.0, 9.0, 41)
    at_each = np.array([volumes_at(fp, scene, float(t)) for t in times])
    np.testing.assert_allclose(volumes_at(np, scene, times), at_each.T, rtol=1e-13, atol=1e-13)
    assert all(column.size == 0 for column in volumes_at(np, scene, times[:0]))
    with pytest.raises(BadInput, match=r"nu = .*, must be in \[0, 1\]"):
        delta(np, np.array([0.5, np.nextafter(1.0, 2.0)]))
