"""When a cycle is trivial: V_cap / V the same at each capture and its release, whatever the loop encloses."""

import mpmath
import numpy as np
import pytest
from mpmath import fp
from support.depth import deep_but

import theory
from scene import Fourier, Mushroom, load
from theory.volumes import volumes_at

N_DRAWN = 4


def in_cos(a: float, b: float, c: float) -> Fourier:
    """Return a + b q + c q^2 with q = cos t: every such law runs along one arc, to and fro."""
    return Fourier(a + c / 2, 1.0, (b, c / 2))


def unlikeness(scene: Mushroom) -> float:
    """Return the largest change of log V_cap / V from a capture to its release."""
    curve = theory.capture_curve(scene, 60)

    def log_share(t: float) -> float:
        now = volumes_at(fp, scene, t)
        return float(fp.log(now.v_cap / (now.v_cap + now.v_stem)))

    pairs = zip(curve.t_in.tolist(), curve.t_out.tolist(), strict=True)
    return max(abs(log_share(begin) - log_share(end)) for begin, end in pairs)


def plane_area(scene: Mushroom) -> float:
    """Return the signed area that the loop encloses in the plane of sec. 3.5, (V_ell / V_cap, V_cap / V)."""
    now = [volumes_at(fp, scene, 2 * fp.pi * k / 720) for k in range(720)]
    x = np.array([float(v.v_ell / v.v_cap) for v in now])
    y = np.array([float(v.v_cap / (v.v_cap + v.v_stem)) for v in now])
    return float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) / 2)


def drawn(seed: int, *, mouth_turns: bool, like: bool = False) -> Mushroom:
    """Draw a scene with one parameter, q = cos t."""
    rng = np.random.default_rng([seed, mouth_turns, like])
    h_1, h_2, r_1 = rng.uniform(-0.3, 0.3, 3)
    nu = in_cos(0.25, 0.0, 0.6) if mouth_turns else in_cos(0.6, 0.3, rng.uniform(-0.1, 0.1))
    if like:
        h_1 = r_1 = 0.0  # all laws are even in q, as nu is: the same at capture and release
    return Mushroom(r=in_cos(1.0, r_1, 0.0), h=in_cos(1.2, h_1, h_2), nu=nu, slope=0.05)


@pytest.mark.parametrize("seed", deep_but(range(N_DRAWN), 0))
def test_one_parameter_gains_nothing_if_the_mouth_goes_one_way_with_it(seed: int) -> None:
    for scene in (drawn(seed, mouth_turns=False), drawn(seed, mouth_turns=True, like=True)):
        assert unlikeness(scene) < 1e-12
        assert theory.predict(scene, 10).m1 == 0


@pytest.mark.parametrize("seed", deep_but(range(N_DRAWN), 0))
def test_one_parameter_gains_if_the_mouth_turns_between_unlike_tables(seed: int) -> None:
    scene = drawn(seed, mouth_turns=True)
    found = theory.predict(scene, 10)
    assert abs(plane_area(scene)) < 1e-12  # a retraced arc has no interior
    assert unlikeness(scene) > 1e-3
    assert found.m1 > 1e-7
    assert abs(found.mean_exp_minus - 1) < 1e-9
    # m1 is of the second order in what capture and release differ by (Eq:Erate).
    assert float(found.m1) < unlikeness(scene) ** 2


@pytest.mark.parametrize("seed", deep_but(range(N_DRAWN), 0))
def test_figures_of_eight_gain_though_their_areas_cancel(seed: int) -> None:
    rng = np.random.default_rng(seed)
    size, nu = rng.uniform(0.1, 0.3), Fourier(0.6, 1.0, (float(rng.uniform(0.2, 0.35)),))
    eight = Mushroom(r=1.0, h=Fourier(1.0, 1.0, (), (0.0, float(size))), nu=nu, slope=0.05)
    # In the plane (nu, h) the signed area is 0 by symmetry, and both lobes count all the same.
    t = np.linspace(0, 2 * np.pi, 4001)[:-1]
    assert abs(np.sum(size * np.sin(2 * t) * -np.sin(t))) < 1e-9
    assert unlikeness(eight) > 1e-3
    assert theory.predict(eight, 10).m1 > 1e-7


@pytest.mark.deep
def test_the_retraced_arc_is_the_counterexample() -> None:
    scene = load("retraced-arc")
    assert isinstance(scene, Mushroom)
    found = theory.predict(scene, 20)
    assert abs(plane_area(scene)) < 1e-12
    assert abs(found.m1 - mpmath.mpf("0.0450706882140")) < 1e-12
    assert abs(found.p_nc - mpmath.mpf("0.242042046235")) < 1e-12
    assert found.log_e_nc == 0
    deeper = Mushroom(r=1.0, h=in_cos(1.0, 0.8, 0.0), nu=scene.nu, slope=0.05)
    assert float(theory.predict(deeper, 8).m1) == pytest.approx(0.1256, abs=5e-5)
