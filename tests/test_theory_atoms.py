"""Atoms of log E1 / E0: the uncaptured, and the captured while a loop runs back along itself (sec. 3.5).

Where V_cap / V is the same at capture and at release all along a stretch, s is constant there: it is rounding
that tells such captives apart. A probability at their place has all of them, and who keeps the energy is
neither lost nor has gained.
"""

import math
from functools import cache

import numpy as np
import pytest

import theory
from scene import BangBang, Mushroom, load
from theory.branches import Branch

Drawn = np.random.Generator


def retracing(rng: Drawn) -> Mushroom:
    """Draw a loop that runs back along itself while nu is above a half: h is 3 r / 4 there."""
    ends, turn, excess = rng.uniform(0.5, 1.5, 2), rng.uniform(0.5, 1.5), rng.uniform(0.5, 1.5)
    times = [0.0, 1.0, 2.0, 3.0, 4.0, 4.0 + rng.uniform(0.2, 0.8), 6.0]

    def through(values: list[float]) -> BangBang:
        return BangBang(knots=tuple(zip(times, map(float, values), strict=True)))

    sizes = ends[0], ends[1], ends[1], ends[1], ends[1], turn, ends[0]
    r = [math.ldexp(round(math.ldexp(x, 20)), -20) for x in sizes]  # 3 r is a binary64 number too
    h = [0.75 * x for x in r]
    h[3] += excess
    w = BangBang(knots=((0.0, 0.9), (1.0, 0.5), (2.0, 0.2), (3.0, 0.2), (4.0, 0.5), (6.0, 0.9)))
    return Mushroom(r=through(r), h=through(h), nu=w)


SCENES = [retracing(np.random.default_rng(seed)) for seed in range(4)]
energies = cache(theory.energies)


def kept(scene: Mushroom) -> float:
    """Return the probability of being captured while the loop runs back along itself."""
    return 1 - float(theory.chaotic_zone(scene, [float(theory.Cycle.of(scene, 8).t_in(0.5))]).p_cha[0])


def has_its_atom(scene: Mushroom) -> bool:
    below, at = theory.energies(scene).cdf(np.array([-1e-12, 0.0]))
    return abs(at - below - kept(scene)) < 1e-9


@pytest.mark.parametrize("scene", SCENES)
def test_who_ends_with_one_energy_is_counted_as_one(scene: Mushroom) -> None:
    assert has_its_atom(scene)
    assert has_its_atom(theory.reversed_cycle(scene))
    levels = [-1e-12, 0.0, 1e-12]
    many = [float(p) for p in theory.cdf_at(scene, levels, 8)]
    assert many == pytest.approx(energies(scene).cdf(np.array(levels)).tolist(), abs=1e-8)
    assert theory.density_at(scene, [0.0], 8) == (0,)


def test_telling_them_apart_by_rounding_is_found_out(monkeypatch: pytest.MonkeyPatch) -> None:
    own = Branch.below
    monkeypatch.setattr(Branch, "below", lambda branch, series, levels, _=0.0: own(branch, series, levels))
    assert not all(has_its_atom(scene) for scene in SCENES)


def drawn_losses(scene: Mushroom, n_cycles: int) -> tuple[float, float]:
    """Draw the share of E_n < E_0, and its error, in cycles with one interval of capture."""
    curve, found = theory.capture_curve(scene, 100_001), energies(scene)
    u = np.random.default_rng(7).random((200_000, n_cycles))
    gain = np.interp(u, curve.p_cha[::-1], curve.s[::-1])
    share = (np.where(u < found.p_nc, found.s_nc, gain).sum(axis=1) < -1e-9).mean()
    return share, float(np.sqrt(share * (1 - share) / len(u)))


@pytest.mark.parametrize("n", [1, 2, 3])
@pytest.mark.parametrize("scene", [SCENES[0], theory.reversed_cycle(SCENES[0])])
def test_who_keeps_the_energy_is_not_lost(scene: Mushroom, n: int) -> None:
    share, error = drawn_losses(scene, n)
    assert theory.loss_probability(energies(scene), n) == pytest.approx(share, abs=5 * error)
    atom = kept(scene) ** n  # half of it is what a lattice that shares the atom would count, or all
    assert atom / 2 > 5 * error or n == 3


@pytest.mark.parametrize("n", [1, 2, 3])
def test_the_uncaptured_of_a_loop_that_is_its_own_reverse_are_not_lost(n: int) -> None:
    """By p(-s) = p(s) exp(-s): the lost are the mean of exp(-S) over S > 0."""
    found = energies(load("retraced-arc"))
    assert found.s_nc == 0
    sums = theory.sum_of_cycles(found, n)
    s = np.linspace(0.0, n * 3.0, 100_001)
    p = 1 - sums.cdf(s)
    p[0] = 1 - theory.loss_probability(found, n) - found.p_nc**n
    gained = p[0] - np.trapezoid(np.exp(-s) * p, s)
    assert theory.loss_probability(found, n) == pytest.approx(gained, rel=3e-4)
    assert float(sums.cdf(0.0)) > gained + 0.4 * found.p_nc**n  # a distribution function has them
