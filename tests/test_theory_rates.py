"""Frozen rates are those of one cycle, however it is written, and of no other."""

import math

import msgspec
import numpy as np
import pytest
from mpmath import fp

import theory
from scene import BangBang, Fourier, Mushroom, load
from scene.geometry import table_at
from scene.tables import laws
from scene.transforms import backwards
from theory import NotCovered, frozen_rates
from theory.finite_energy import rates
from theory.finite_energy.rates import PHASES


def all_at(scene: Mushroom, phases: np.ndarray) -> np.ndarray:
    now = table_at(fp, scene, phases)
    return np.concatenate([np.ravel(getattr(now, name)) for name in ("r", "w", "h", "slope")])


def by_every_fifth_phase(measured: Mushroom, sought: Mushroom) -> bool:
    """Compare cycles as was done once: at 13 times, without rates."""
    lengths = [2 * math.pi if isinstance(scene.nu, Fourier) else 1.0 for scene in (measured, sought)]
    one, other = (
        all_at(scene, length * PHASES[::5]) for scene, length in zip((measured, sought), lengths, strict=True)
    )
    return (
        lengths[0] == lengths[1] and one.shape == other.shape and np.allclose(one, other, rtol=1e-9, atol=0.0)
    )


def that_swings_between_phases() -> Mushroom:
    """Return the moving cap, its depth swung by waves that vanish at every fifth of PHASES."""
    times, k = 2 * math.pi * PHASES[::5], np.arange(1, 17)
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
    again = Mushroom(**{field: written(law) for field, law in laws(scene).items()})
    assert frozen_rates(again)[0] is frozen_rates(scene)[0]
    assert frozen_rates(backwards(again))[0] is frozen_rates(scene)[0]


def by_its_width(name):
    """Return a scene whose mouth is told as w, not nu: w = nu r, and r moves."""
    scene, wave = load(name), Fourier(mean=0.6, omega=1.0, cos=(0.4,), sin=(0.3, 0.1))
    return Mushroom(r=scene.r, h=scene.h, w=wave if name == "moving-cap" else scene.r, slope=scene.slope)


@pytest.mark.parametrize("name", ["moving-cap", "ergodic"])
def test_a_mouth_given_by_its_width_has_the_same_rates(name, monkeypatch):
    """Multiplied by another pace than they were divided by, they were two times too great."""
    scene, again = load(name), by_its_width(name)
    times = np.linspace(0.1, 6.1, 13)
    for one, other in ((scene, again), (backwards(scene), backwards(again))):
        assert frozen_rates(other)[0] is frozen_rates(one)[0]
        for mine, its in zip(rates.rates_at(one, times), rates.rates_at(other, times), strict=True):
            np.testing.assert_allclose(its, mine, rtol=1e-9, atol=1e-9)
        assert rates.table_error(other) == pytest.approx(rates.table_error(one), rel=1e-9)
    wanted = rates.rates_at(scene, times).diffusion.sum(axis=1)
    own = rates.pace
    monkeypatch.setattr(rates, "pace", lambda _, at: own(again, at))  # as was done once
    assert np.abs(rates.rates_at(again, times).diffusion.sum(axis=1) / wanted - 1).max() > 0.5


@pytest.mark.parametrize("name", ["moving-cap", "ergodic"])
def test_a_mouth_given_by_its_width_leads_to_the_same_energies(name):
    one, other = (theory.at_energy(scene, 1e6) for scene in (load(name), by_its_width(name)))
    assert other.peak == pytest.approx(one.peak, rel=1e-9, abs=1e-12)
    assert other.theory_error == pytest.approx(one.theory_error, rel=1e-7)
    for mine, its in zip(one.point_masses, other.point_masses, strict=True):
        np.testing.assert_allclose(its, mine, rtol=1e-7, atol=1e-9)
