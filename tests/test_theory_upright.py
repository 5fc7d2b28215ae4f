"""Upright stems: what the cap does to flights along the base, and the log(v) / v that comes of it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from support.depth import deep_but

import fast
from conformance.audit.frozen import diffusion
from scene import Fourier, Mushroom, State, load
from scene.refusal import BadInput
from theory import NotCovered, is_upright, kept_by_the_cap, upright_rate, upright_spread

MOUTHS = (1.0, 0.8, 0.5)


def breathing(nu):
    """Return a table whose stem is pulled out through t = 0."""
    return Mushroom(r=1.0, h=Fourier(mean=1.0, omega=1.0, sin=(0.5,)), nu=nu)


def angle_after_the_cap(nu, x, angle):
    """Return the angle from the base at which a flight that enters the cap at x comes back."""
    start = State(t=0.0, x=x, y=0.0, vx=1.0, vy=angle)
    met = fast.trajectory(Mushroom(r=1.0, h=1.0, nu=nu), start, 3 + math.ceil(4 / nu))
    first = next(i for i, wall in enumerate(met.walls) if wall in ("left", "right"))
    return abs(met.steps[first, 5])


@pytest.mark.parametrize("nu", [0.21, 0.5, 0.83, 1.0])
def test_the_cap_hands_flights_along_the_base_back_as_is_told(nu):
    n, angle = 400, 1e-7
    places = (np.arange(n) + 0.5) / n * 2 * nu - nu
    after = np.array([angle_after_the_cap(nu, float(x), angle) for x in places])
    assert np.mean(angle / after) == pytest.approx(kept_by_the_cap(nu), abs=2 / n)
    assert np.mean((angle / after) ** 2) == pytest.approx(1.0, abs=4 / n)  # phase volume is kept


@pytest.mark.parametrize("nu", deep_but(MOUTHS, 0.8))
def test_kicks_of_a_frozen_upright_stem_spread_as_the_logarithm_of_the_path(nu):
    """As is told; without the cap's returns by a tenth of it."""
    table, now = breathing(nu), np.zeros(1)
    short, long = (diffusion(table, 0.0, path, n, 3) for path, n in ((1e3, 20_000), (2e4, 2000)))
    found = (long.value - short.value) / math.log(20)
    error = math.hypot(long.error, short.error) / math.log(20)
    wanted, kept = float(upright_rate(table, now)[0]), kept_by_the_cap(nu)
    assert abs(found - wanted) < 4 * error
    assert abs(found - wanted * (1 - kept) / (1 + kept)) > 4 * error


@pytest.mark.deep
def test_the_variance_of_the_uncaptured_grows_with_log_v_over_v():
    """From E = 1e5 to 1e7, where a variance like 1 / v would keep v times it."""
    wave = Fourier(mean=1.0, omega=1.0, sin=(0.3,))
    table = Mushroom(r=1.0, h=wave, nu=Fourier(mean=0.8, omega=1.0, cos=(0.15,)))
    scaled = []
    for energy, n in ((1e5, 20_000), (1e7, 4000)):
        done = fast.simulate(table, n_particles=n, energy=energy, seed=11)
        s = np.log(done.energy / energy)[done.takes_part() & ~done.is_captured()[:, 0]]
        centred, v = (s - s.mean()) ** 2, math.sqrt(2 * energy)
        scaled.append((v * centred.mean(), v * centred.std() / math.sqrt(len(s))))
    (before, error), (after, more) = scaled
    found, error = (after - before) / math.log(10), math.hypot(error, more) / math.log(10)
    assert abs(found - upright_spread(table)) < 4 * error
    assert found > 4 * error


def test_who_is_upright():
    assert is_upright(load("untilted"))
    assert not is_upright(load("moving-cap"))
    still = Fourier(mean=0.0, omega=1.0)
    assert is_upright(Mushroom(r=1.0, h=1.0, nu=0.5, slope=still))
    assert upright_spread(Mushroom(r=1.0, h=1.0, nu=0.5)) == 0.0
    assert upright_spread(load("untilted")) > 0


def test_a_faster_cycle_spreads_in_proportion():
    """B goes as the walls' speed squared times the period."""
    slow, fast_one = (
        Mushroom(r=1.0, h=Fourier(mean=1.0, omega=omega, sin=(0.5,)), nu=0.5) for omega in (1.0, 3.0)
    )
    assert upright_spread(fast_one) == pytest.approx(3 * upright_spread(slow), rel=1e-6)


def test_what_is_not_covered_is_refused():
    with pytest.raises(NotCovered, match="sides are tilted"):
        upright_spread(load("moving-cap"))
    with pytest.raises(NotCovered, match="sides are tilted"):
        upright_rate(load("retraced-arc"), np.zeros(1))
    with pytest.raises(NotCovered, match="mushrooms"):
        is_upright(load("breathing-circle"))
    for nu in (0.0, 5e-324, 1e-7, 1.5, math.nan):
        with pytest.raises(BadInput, match="nu"):
            kept_by_the_cap(nu)
    narrow = Fourier(mean=1e-8, omega=1.0, cos=(0.5e-8,))
    with pytest.raises(BadInput, match="nu"):
        upright_spread(Mushroom(r=1.0, h=1.0, nu=narrow))


def test_what_the_cap_does_not_keep_goes_as_the_mouth_squared():
    """2 nu^2 / 3 + O(nu^3), down to the narrowest that rounding leaves anything of."""
    for nu in (1e-6, 1e-5, 1e-3):
        assert (1 - kept_by_the_cap(nu)) / nu**2 == pytest.approx(2 / 3, rel=2 * nu + 1e-3)
