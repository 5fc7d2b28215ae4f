"""Upright stems: what the cap does to flights along the base, and the log(v) / v that comes of it."""

import math

import numpy as np
import pytest
from support.depth import deep_but

import fast
from mushrooms.audit.frozen import swaying
from mushrooms.audit.tolerances import Mean, mean
from scene import BangBang, Fourier, Mushroom, State, load
from scene.transforms import scaled
from theory import (
    NotConverged,
    is_upright,
    kept_by_the_cap,
    upright_rate,
    upright_spread,
)
from theory.finite_energy import upright

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


def diffusion(scene: Mushroom, path: float, n: int) -> Mean:
    """Return the variance per path length of the chaotic zone's kicks, the walls swaying once in the path."""
    table, share = swaying(scene, 0.0, path)
    done = fast.simulate(table, n_particles=n, energy=0.5, seed=3, threads=1)
    is_free = (done.outcome == 0) & (done.wall_counts[:, 2:].sum(axis=1) > 0)
    return mean(2 * (np.log(2 * done.energy[is_free]) / share) ** 2 / path)


@pytest.mark.parametrize("nu", deep_but(MOUTHS, 0.8))
def test_kicks_of_a_frozen_upright_stem_spread_as_the_logarithm_of_the_path(nu):
    """As is told; without the cap's returns by a tenth of it."""
    table, now = breathing(nu), np.zeros(1)
    short, long = (diffusion(table, path, n) for path, n in ((1e3, 20_000), (2e4, 2000)))
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


def spread_over_the_mouth(narrow, pace):
    """Return B where r = h = 1 and the mouth goes from 1 to `narrow` and back, each mouth w at speed pace(w).

    An integral over w, in which a leg that lasts for an instant and a narrow mouth are like any other.
    """
    edges = np.geomspace(narrow, 1.0, 5_001)
    w, dw = (edges[1:] + edges[:-1]) / 2, np.diff(edges)
    v_cha = 2 * math.pi * (np.arcsin(w) + w * np.sqrt(1 - w * w) + 2 * w)
    gain = 4 * math.pi * dw / v_cha  # of log E, while the stem loses dw
    gathered = np.cumsum(gain[::-1])[::-1] - gain / 2
    kept = np.array([kept_by_the_cap(x) for x in w])
    kicks = 16 * w * (4 * math.pi / v_cha - 2 / w) ** 2 / v_cha * (1 + kept) / (1 - kept)
    return float((kicks * np.exp(-gathered / 2) * pace(w)) @ dw)


def by_equal_steps(f, edges):
    """Integrate as was done once: by 2,048 equal steps of a cycle."""
    step = (edges[-1] - edges[0]) / 2048
    return float(f(edges[0] + step * (np.arange(2048) + 0.5))[0].sum() * step)


def leg(narrow, lasting):
    """Return the speed at which a bang-bang leg between 1 and `narrow` passes each mouth."""
    fall = 1 - narrow
    return lambda w: 4 * fall / lasting * np.sqrt(np.minimum(1 - w, w - narrow) / (2 * fall))


LEGS = [(0.3, 1e-7), (0.3, 3e-4), (0.01, 0.04), (3e-4, 0.25)]


@pytest.mark.parametrize("narrow_and_fall", deep_but(LEGS, LEGS[0]))
def test_an_instant_of_a_leg_and_a_narrow_mouth_count_in_full(narrow_and_fall, monkeypatch):
    """Equal steps, 2,048 a cycle, give 2e-7 of the first leg and 2.8 times the second."""
    (narrow, fall), rise = narrow_and_fall, 0.5
    table = Mushroom(r=1.0, h=1.0, nu=BangBang(((0.0, 1.0), (fall, narrow), (0.5, narrow), (1.0, 1.0))))
    wanted = spread_over_the_mouth(narrow, lambda w: leg(narrow, fall)(w) + leg(narrow, rise)(w))
    assert upright_spread(table) == pytest.approx(wanted, rel=1e-4)
    monkeypatch.setattr(upright, "_integral", by_equal_steps)
    if fall < 0.01:
        assert upright_spread(table) != pytest.approx(wanted, rel=1e-2)


def that_keeps_its_form(law):
    """Return a table that breathes without a change of form: nothing is kicked but as all else."""
    return Mushroom(r=law, h=law, nu=0.5)


WAVE, JOLTS = Fourier(1.0, 1.0, cos=(0.2,)), BangBang(((0.0, 1.0), (0.3, 0.55), (0.7, 0.85), (1.0, 1.0)))


@pytest.mark.parametrize("law", [WAVE, JOLTS])
def test_a_spread_of_nothing_but_rounding_is_not_resolved_for_ever(law, monkeypatch):
    """What was left by rounding had its panels halved for a minute, to 14 million times and a GiB."""
    asked, growth = [], upright._growth

    def counted(scene, at):
        asked.append(at.size)
        return growth(scene, at)

    monkeypatch.setattr(upright, "_growth", counted)
    assert 0 <= upright_spread(that_keeps_its_form(law)) < 1e-24
    assert sum(asked) < 10_000
    monkeypatch.setattr(upright, "ROUNDING", 0.0)
    monkeypatch.setattr(upright, "MOST_PANELS", 1000)
    with pytest.raises(NotConverged, match="the spread by upright sides is not resolved near t = "):
        upright_spread(that_keeps_its_form(law))


def test_legs_of_a_few_units_in_the_last_place_are_as_wrong_as_is_told():
    """A leg at 0.25, where times are 2^-54 apart, and at 0, where they are as fine as they need be."""
    for n, wrong in ((4096, 1e-4), (64, 0.01), (2, 0.1)):
        brief = n * 2.0**-54
        early = BangBang(((0.0, 1.0), (brief, 0.3), (0.5, 0.3), (0.75, 1.0), (1.0, 1.0)))
        late = BangBang(((0.0, 1.0), (0.25, 1.0), (0.25 + brief, 0.3), (0.75, 0.3), (1.0, 1.0)))
        right, found = (upright_spread(Mushroom(r=1.0, h=1.0, nu=nu)) for nu in (early, late))
        assert found == pytest.approx(right, rel=wrong)
        assert n == 4096 or found != pytest.approx(right, rel=wrong / 10)


@pytest.mark.parametrize("narrow", deep_but([2.0**-19, 2.0**-7], 2.0**-7))
def test_a_wave_that_narrows_the_mouth_spreads_as_an_integral_over_it(narrow, monkeypatch):
    table = Mushroom(r=1.0, h=1.0, nu=Fourier((1 + narrow) / 2, 1.0, cos=((1 - narrow) / 2,)))
    wanted = spread_over_the_mouth(narrow, lambda w: 2 * np.sqrt((1 - w) * (w - narrow)))
    assert upright_spread(table) == pytest.approx(wanted, rel=1e-4)
    monkeypatch.setattr(upright, "_integral", by_equal_steps)
    if narrow < 1e-4:
        assert upright_spread(table) != pytest.approx(wanted, rel=1e-2)


@pytest.mark.parametrize(
    ("length", "time"), [(390, 0), (-390, 0), (-900, 0), (990, 900), (0, 600), (0, -900)]
)
def test_the_spread_is_a_length_over_a_time_however_large(length, time):
    """Not inf, nan or 0 where the cube of a length, or the square of a rate, is no float."""
    table = Mushroom(r=1.0, h=1.5, nu=Fourier(mean=0.6, omega=1.0, cos=(0.3,)))
    other = scaled(table, length, time)
    assert upright_spread(other) == math.ldexp(upright_spread(table), length - time)
    rate = upright_rate(table, np.ones(1))[0]
    if abs(length - 2 * time) < 1000:
        assert upright_rate(other, np.full(1, 2.0**time))[0] == math.ldexp(rate, length - 2 * time)


def test_who_is_upright():
    assert is_upright(load("untilted"))
    assert not is_upright(load("moving-cap"))
    still = Fourier(mean=0.0, omega=1.0)
    assert is_upright(Mushroom(r=1.0, h=1.0, nu=0.5, slope=still))
    assert upright_spread(Mushroom(r=1.0, h=1.0, nu=0.5)) == 0.0
    assert upright_spread(load("untilted")) > 0


def test_what_the_cap_does_not_keep_goes_as_the_mouth_squared():
    """2 nu^2 / 3 + O(nu^3), down to the narrowest that rounding leaves anything of."""
    for nu in (1e-6, 1e-5, 1e-3):
        assert (1 - kept_by_the_cap(nu)) / nu**2 == pytest.approx(2 / 3, rel=2 * nu + 1e-3)
