"""Sec. 2 of the paper: volumes of cap, stem, island and chaotic zone."""

from typing import Any

import numpy as np
import pytest
from mpmath import MPContext, fp

from scene import Mushroom, load
from theory import delta, sin_phi_hat, v_cap, v_cha, v_ell, v_stem, volumes_at
from theory.volumes import delta_slope


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


def worst_of_small_islands(share: Any) -> float:
    """Return the largest relative error, in units of 2^-53, of a share in floats; 0.5 <= nu < 1."""
    many = MPContext()
    many.dps = 80
    found = 0.0
    for k in range(1, 54):
        for part in (1.0, 0.5625, 0.71875):
            nu = 1 - 2.0**-k * part
            exact = many.mpf(nu)
            truth = 2 * (many.acos(exact) - exact * many.sqrt(1 - exact * exact)) / many.pi
            if nu < 1:
                found = max(found, float(abs(share(nu) / truth - 1)) * 2.0**53)
    return found


def test_a_small_island_is_known_as_well_as_a_large_one() -> None:
    assert worst_of_small_islands(lambda nu: delta(fp, nu)) < 12
    assert worst_of_small_islands(lambda nu: 2 * (fp.acos(nu) - nu * fp.sqrt(1 - nu * nu)) / fp.pi) > 1e10
    few, many = MPContext(), MPContext()
    few.dps, many.dps = 30, 100
    for nu in (1 - few.mpf(10) ** -k for k in (0.7, 1, 8, 16, 29)):
        exact = many.mpf(nu)
        truth = 2 * (many.acos(exact) - exact * many.sqrt(1 - exact * exact)) / many.pi
        assert abs(many.mpf(delta(few, nu)) / truth - 1) < many.mpf(10) ** -29
    assert delta(fp, 1.0) == delta(few, few.one) == 0
    assert 0 < v_ell(fp, 1.0, 1 - 2.0**-53) < 1e-22


def test_delta_slope_is_its_derivative(ctx: Any) -> None:
    for nu in ("0.1", "0.5", "0.9"):
        measured = ctx.diff(lambda x: delta(ctx, x), ctx.mpf(nu))
        assert abs(delta_slope(ctx, ctx.mpf(nu)) - measured) < ctx.mpf(10) ** -20


@pytest.mark.parametrize("nu", [0.1, 0.3, 0.65, 0.9])
def test_delta_is_the_captured_share_of_phase_points(nu: float) -> None:
    n, r = 400_000, 1.3
    rng = np.random.Generator(np.random.Philox(20140601))
    rho, psi, direction = r * np.sqrt(rng.random(n)), np.pi * rng.random(n), 2 * np.pi * rng.random(n)
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
    r, h, nu = 1 + ctx.sin(t) / 2, 1 - ctx.sin(t) / 2, ctx.mpf(0.6) + ctx.mpf(0.4) * ctx.cos(t)
    found = volumes_at(ctx, load("moving-cap"), t)
    assert abs(found.nu - nu) < ctx.mpf(10) ** -48
    assert abs(found.v_cha - v_cha(ctx, r, nu * r, h, ctx.mpf(0.1111))) < ctx.mpf(10) ** -46


@pytest.mark.parametrize("nu", [1.0, 0.3, 1e-5, 1e-12, 1e-40, 1e-300])
def test_the_chaotic_zone_keeps_its_digits_however_narrow_the_mouth(ctx: Any, nu: float) -> None:
    """Cap and stem less the island left none of them where the island fills the cap within rounding."""
    w, h = ctx.mpf(nu), ctx.mpf(0.25)
    strip = ctx.quad(lambda s: ctx.sqrt(1 - (w * s) ** 2), [0, 1])
    zone = 4 * ctx.pi * w * strip + v_stem(ctx, w, h, 0)
    assert abs(v_cha(ctx, ctx.one, w, h, 0) / zone - 1) < ctx.mpf(10) ** -40
    assert v_cha(fp, 1.0, nu, 0.25, 0.0) == pytest.approx(float(zone), rel=1e-15)
    assert volumes_at(fp, Mushroom(r=1.0, h=0.25, w=nu), 0.0).v_cha == pytest.approx(float(zone), rel=1e-15)
