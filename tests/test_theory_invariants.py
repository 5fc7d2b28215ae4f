"""Sec. 3: invariants of the cap, and energy drifting in each zone (Eqs dEe, dE)."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from mpmath import MPContext, fp

import fast
from scene import BadInput, Fourier, Horizon, Mushroom, State, load
from scene.laws import value
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


BREATHING = Mushroom(
    r=Fourier(0.8, 1.0, cos=(0.2, 0.03), sin=(0.0, 0.05)), h=0.7, nu=Fourier(0.3, 1.0, sin=(0.1,))
)


def captives(speed: float, n: int) -> list[State]:
    """Return particles of the island of BREATHING, |sin phi_hat| > 0.55, at t = 0."""
    random, r = np.random.default_rng(7), float(value(fp, BREATHING.r, 0.0))
    found: list[State] = []
    while len(found) < n:
        x, y, turn = random.uniform(-r, r), random.uniform(0, r), random.uniform(0, 2 * math.pi)
        vx, vy = speed * math.cos(turn), speed * math.sin(turn)
        if math.hypot(x, y) < 0.99 * r and abs(sin_phi_hat(fp, x, y, vx, vy, r)) > 0.55:
            found.append(State(0.0, x, y, vx, vy))
    return found


def drifts(t: float, speed: float, of: Callable[..., float]) -> float:
    """Return the largest change by time t of a function of (x, y, vx, vy, r)."""
    starts, largest = captives(speed, 40), 0.0
    r0, r1 = (float(value(fp, BREATHING.r, at)) for at in (0.0, t))
    for start, end in zip(starts, fast.flow(BREATHING, starts, t).outcomes, strict=True):
        assert isinstance(end, Horizon)
        before = of(start.x, start.y, start.vx, start.vy, r0)
        largest = max(largest, abs(of(end.x, end.y, end.vx, end.vy, r1) - before))
    return largest


def size_of_sin_phi_hat(x: float, y: float, vx: float, vy: float, r: float) -> float:
    return abs(float(sin_phi_hat(fp, x, y, vx, vy, r)))


def log_cap_invariant(x: float, y: float, vx: float, vy: float, r: float) -> float:
    return math.log(cap_invariant(fp, vx, vy, r))


@pytest.mark.parametrize("of", [size_of_sin_phi_hat, log_cap_invariant])
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
    for k in (2, 4, 6):
        t_in, t_out = ctx.mpf(captured.t_in[k]), ctx.mpf(captured.t_out[k])
        free = ctx.quad(chaotic, [0, t_in], maxdegree=4) + ctx.quad(chaotic, [t_out, 2 * ctx.pi], maxdegree=4)
        held = ctx.quad(island, [t_in, t_out], maxdegree=5)
        assert float(free + held) == pytest.approx(captured.s[k], abs=1e-8)


@pytest.mark.parametrize("name", ["moving-cap", "fixed-cap-anticlockwise", "frozen-mushroom"])
def test_the_volumes_at_many_times_are_those_at_each(name):
    scene = load(name)
    times = np.linspace(-1.0, 9.0, 41)
    at_each = np.array([volumes_at(fp, scene, float(t)) for t in times])
    np.testing.assert_allclose(volumes_at(np, scene, times), at_each.T, rtol=1e-13, atol=1e-13)
    assert all(column.size == 0 for column in volumes_at(np, scene, times[:0]))
    with pytest.raises(BadInput, match=r"nu = .*, must be in \[0, 1\]"):
        delta(np, np.array([0.5, np.nextafter(1.0, 2.0)]))
