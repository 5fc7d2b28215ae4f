"""Sec. 3: invariants of the cap, and energy drifting in each zone (Eqs dEe, dE)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from mpmath import MPContext, fp

from scene import BadInput, load
from theory import (
    cap_invariant,
    capture_curve,
    log_energy_rate_chaotic,
    log_energy_rate_island,
    predict,
    sin_phi_hat,
    volumes_at,
)
from theory.volumes import delta, delta_slope


def test_sin_phi_hat_is_the_incidence_angle_on_the_arc() -> None:
    r, psi, phi = 1.4, 0.8, 0.3
    speed = 7.0
    x, y = r * math.cos(psi), r * math.sin(psi)
    vx, vy = speed * math.cos(psi - phi), speed * math.sin(psi - phi)
    assert sin_phi_hat(fp, x, y, vx, vy, r) == pytest.approx(math.sin(phi), rel=1e-14)


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
    for k in (2, 4, 6):
        t_in, t_out = ctx.mpf(captured.t_in[k]), ctx.mpf(captured.t_out[k])
        free = ctx.quad(chaotic, [0, t_in], maxdegree=4) + ctx.quad(chaotic, [t_out, 2 * ctx.pi], maxdegree=4)
        held = ctx.quad(island, [t_in, t_out], maxdegree=5)
        assert float(free + held) == pytest.approx(captured.s[k], abs=1e-8)


def test_formulas_take_arrays_with_numpy_as_number_system() -> None:
    x = np.array([0.5, 0.0])
    expected = [sin_phi_hat(fp, float(a), 0.25, 1.0, 2.0, 1.5) for a in x]
    np.testing.assert_allclose(sin_phi_hat(np, x, 0.25, 1.0, 2.0, 1.5), expected, rtol=1e-15)


@pytest.mark.parametrize("name", ["moving-cap", "fixed-cap-anticlockwise", "frozen-mushroom"])
def test_the_volumes_at_many_times_are_those_at_each(name):
    scene = load(name)
    times = np.linspace(-1.0, 9.0, 41)
    at_each = np.array([volumes_at(fp, scene, float(t)) for t in times])
    np.testing.assert_allclose(volumes_at(np, scene, times), at_each.T, rtol=1e-13, atol=1e-13)
    assert all(column.size == 0 for column in volumes_at(np, scene, times[:0]))
    with pytest.raises(BadInput, match=r"nu = .*, must be in \[0, 1\]"):
        delta(np, np.array([0.5, np.nextafter(1.0, 2.0)]))
