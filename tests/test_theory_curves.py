"""Sec. 4's curves: energy against capture time, densities of energy and of capture time."""

import numpy as np
import pytest
from mpmath import fp

from scene import Fourier, Mushroom, load
from scene.transforms import scaled
from theory import (
    Cycle,
    capture_curve,
    capture_time_mass,
    chaotic_zone,
    energy_density,
    largest_gain,
    predict,
    volumes_at,
)
from theory.volumes import delta_slope


def test_curve_runs_from_nothing_to_the_uncaptured() -> None:
    curve, found = capture_curve(load("moving-cap"), 101), predict(load("moving-cap"))
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
        at_capture, at_release = volumes_at(fp, scene, float(t_in)), volumes_at(fp, scene, float(t_out))
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
    best, curve = largest_gain(load("fixed-cap-clockwise")), capture_curve(load("fixed-cap-clockwise"))
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


def test_capture_time_masses_are_differences_of_p_cha() -> None:
    scene = load("moving-cap")

    def rate(t: float) -> float:
        now = volumes_at(fp, scene, t)
        return float(now.v_cap / now.v_cha * delta_slope(fp, now.nu) * -0.4 * fp.sin(t))

    edges = [0.0, 0.7, 1.5, 2.9, 4.0]
    p_cha = [np.exp(-float(fp.quad(rate, [0, min(t, np.pi)]))) for t in edges]
    np.testing.assert_allclose(capture_time_mass(scene, edges), -np.diff(p_cha), atol=3e-7)


def test_chaotic_zone_through_the_cycle() -> None:
    scene, found = load("moving-cap"), predict(load("moving-cap"))
    curve = capture_curve(scene, 9)
    falling, rising = chaotic_zone(scene, curve.t_in), chaotic_zone(scene, curve.t_out[1:])
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
