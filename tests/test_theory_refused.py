"""Every public entry of `theory` refuses bad input in one line that names the field."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
from support.refusals import one_line

import theory
from scene import BangBang, Cap, Fourier, Mushroom, Stem, load
from theory.entries import MAX_DIGITS, MAX_ORDER

SCENE = load("moving-cap")
FP = mpmath.fp
NO_SCENES = ["moving-cap", None, 1.0, {"table": "cap", "r": 1.0}, Mushroom, Cap(r=1.0), Stem(w=1.0, h=1.0)]
NO_COUNTS = [-1, 10**9, 10**400, 1.5, 2.0, "3", None, True, math.nan, math.inf, [3]]
NO_NUMBERS = ["x", b"1", None, True, math.nan, math.inf, -math.inf, [1.0], 1j, mpmath.mpf("nan"), mpmath.inf]
NO_ARRAYS = [
    "abc",
    None,
    True,
    [math.nan, 1.0],
    [0.0, math.inf],
    [0.0, "1"],
    [[0.0, 1.0], [2.0]],
    {"a": 1},
    [1j, 0],
]


OF_A_SCENE = {
    "predict": theory.predict,
    "mean_of": lambda scene: theory.mean_of(scene, lambda s: s),
    "moments": lambda scene: theory.moments(scene, 2),
    "cumulants": lambda scene: theory.cumulants(scene, 2),
    "reversed_cycle": theory.reversed_cycle,
    "capture_curve": theory.capture_curve,
    "largest_gain": theory.largest_gain,
    "energy_density": lambda scene: theory.energy_density(scene, [0.0, 1.0]),
    "capture_time_mass": lambda scene: theory.capture_time_mass(scene, [0.0, 1.0]),
    "chaotic_zone": lambda scene: theory.chaotic_zone(scene, [0.0, 1.0]),
    "Cycle.of": lambda scene: theory.Cycle.of(scene, 15),
    "density_at": lambda scene: theory.density_at(scene, [0.0]),
    "cdf_at": lambda scene: theory.cdf_at(scene, [0.0]),
    "caustics": theory.caustics,
    "capture_rate_at": lambda scene: theory.capture_rate_at(scene, [0.0]),
    "energies": theory.energies,
    "energy_cdf": lambda scene: theory.energy_cdf(scene, [0.0]),
    "sum_of_cycles": lambda scene: theory.sum_of_cycles(scene, 2),
    "Saddle": theory.Saddle,
    "bias": lambda scene: theory.bias(scene, 0.1),
    "unbiased_mean": theory.unbiased_mean,
    "volumes_at": lambda scene: theory.volumes_at(FP, scene, 0.0),
}


@pytest.mark.parametrize("entry", OF_A_SCENE)
@pytest.mark.parametrize("bad", NO_SCENES, ids=repr)
def test_what_is_no_mushroom_is_refused(entry, bad):
    message = one_line(OF_A_SCENE[entry], bad)
    if isinstance(bad, Cap | Stem):
        assert message.startswith("the theory is of mushrooms")
    else:
        assert message.startswith("scene = ")
    assert ("scene.load('moving-cap')" in message) == isinstance(bad, str)


DIGITS = {
    "predict": theory.predict,
    "mean_of": lambda scene, digits: theory.mean_of(scene, lambda s: s, digits),
    "moments": lambda scene, digits: theory.moments(scene, 2, digits),
    "cumulants": lambda scene, digits: theory.cumulants(scene, 2, digits),
    "Cycle.of": theory.Cycle.of,
    "density_at": lambda scene, digits: theory.density_at(scene, [0.0], digits),
    "cdf_at": lambda scene, digits: theory.cdf_at(scene, [0.0], digits),
    "caustics": theory.caustics,
    "capture_rate_at": lambda scene, digits: theory.capture_rate_at(scene, [0.0], digits),
    "unbiased_mean": theory.unbiased_mean,
}


@pytest.mark.parametrize("entry", DIGITS)
@pytest.mark.parametrize("bad", [0, MAX_DIGITS + 1, *NO_COUNTS], ids=repr)
def test_digits_are_a_count_within_bounds(entry, bad):
    message = one_line(DIGITS[entry], SCENE, bad)
    assert message.startswith("digits = ")
    assert f"1 to {MAX_DIGITS}" in message


@pytest.fixture(scope="module")
def solved():
    """Return what is solved once: a prediction, a cycle, its energies, a sum and a saddle."""
    energies = theory.energies(SCENE)
    return {
        "prediction": theory.predict(SCENE, 4),
        "cycle": theory.Cycle.of(SCENE, 15),
        "energies": energies,
        "sum": theory.sum_of_cycles(energies, 3),
        "saddle": theory.Saddle(energies),
    }


@pytest.mark.parametrize("bad", NO_COUNTS, ids=repr)
def test_counts(bad, solved):
    assert one_line(theory.moments, SCENE, bad).startswith("order = ")
    assert one_line(theory.cumulants, SCENE, bad).startswith("order = ")
    assert one_line(theory.capture_curve, SCENE, bad).startswith("n = ")
    assert one_line(theory.sum_of_cycles, solved["energies"], bad).startswith("n_cycles = ")
    assert one_line(solved["prediction"].strings, bad).startswith("digits = ")
    if bad != 10**9:  # that many cycles may be averaged, and summed by saddle point
        assert one_line(solved["prediction"].sd_of_mean, bad).startswith("n_cycles = ")
        for entry in (solved["saddle"].density, solved["saddle"].above, solved["saddle"].below):
            assert one_line(entry, 0.0, bad).startswith("n_cycles = ")


def test_counts_end_at_their_bounds():
    for bad in (-1, MAX_ORDER + 1):
        assert one_line(theory.moments, SCENE, bad) == f"order = {bad}, must be 0 to {MAX_ORDER}"
    assert one_line(theory.capture_curve, SCENE, 1) == "n = 1, must be 2 to 10000000"
    assert one_line(theory.sum_of_cycles, SCENE, 0) == "n_cycles = 0, must be 1 to 10000"


@pytest.mark.parametrize("bad", NO_NUMBERS, ids=repr)
def test_numbers(bad, solved):
    assert one_line(theory.cumulants, SCENE, 1, 4, q=bad).startswith("q = ")
    assert one_line(theory.sum_of_cycles, solved["energies"], 3, q=bad).startswith("q = ")
    assert one_line(theory.bias, solved["energies"], bad).startswith("sigma_w = ")
    assert one_line(theory.extrapolate, [1.0, 2.0], [1.0, 2.0], [1.0, 1.0], bad).startswith("exponent = ")
    assert one_line(solved["cycle"].t_in, bad).startswith("nu = ")
    assert one_line(solved["cycle"].t_out, bad).startswith("nu = ")
    assert one_line(solved["cycle"].release_time, bad).startswith("t = ")
    assert one_line(theory.volumes_at, FP, SCENE, bad).startswith("t = ")


FORMULAS = {
    "v_cap": (theory.v_cap, {"r": 1.0}),
    "v_stem": (theory.v_stem, {"w": 0.5, "h": 1.0, "slope": 0.0}),
    "v_ell": (theory.v_ell, {"r": 1.0, "nu": 0.5}),
    "v_cha": (theory.v_cha, {"r": 1.0, "w": 0.5, "h": 1.0, "slope": 0.0}),
    "delta": (theory.delta, {"nu": 0.5}),
    "energy": (theory.energy, {"vx": 1.0, "vy": 1.0}),
    "cap_invariant": (theory.cap_invariant, {"vx": 1.0, "vy": 1.0, "r": 1.0}),
    "sin_phi_hat": (theory.sin_phi_hat, {"x": 0.1, "y": 0.2, "vx": 1.0, "vy": 1.0, "r": 1.0}),
}
RATES = {
    "log_energy_rate_chaotic": (
        theory.log_energy_rate_chaotic,
        {"v_cha": 1.0, "v_cap": 1.0, "v_cha_rate": 1.0, "delta_rate": 1.0},
    ),
    "log_energy_rate_island": (theory.log_energy_rate_island, {"v_cap": 1.0, "v_cap_rate": 1.0}),
}


@pytest.mark.parametrize("name", [*FORMULAS, *RATES])
def test_formulas(name):
    formula, good = {**FORMULAS, **RATES}[name]
    first = (FP,) if name in FORMULAS else ()
    assert math.isfinite(formula(*first, **good))
    for field in good:
        for bad in NO_NUMBERS:
            assert f"{field} = " in one_line(formula, *first, **{**good, field: bad})
    if first:
        for bad in (None, 1.0, "fp"):
            assert one_line(formula, bad, **good).startswith("ctx = ")


def test_formulas_outside_their_domain():
    assert one_line(theory.delta, FP, 1.5).startswith("nu = 1.5")
    assert one_line(theory.v_cha, FP, 0.0, 0.5, 1.0, 0.0) == "r = 0.0, must be > 0"
    assert one_line(theory.sin_phi_hat, FP, 0.0, 0.1, 0.0, 0.0, 1.0).startswith("vx = vy = 0")
    assert one_line(theory.sin_phi_hat, FP, 0.0, 0.1, 1.0, 0.0, 0.0) == "r = 0.0, must be > 0"
    assert one_line(theory.log_energy_rate_island, 0.0, 1.0) == "v_cap = 0.0, must be > 0"
    assert one_line(theory.log_energy_rate_chaotic, 0.0, 1.0, 1.0, 1.0) == "v_cha = 0.0, must be > 0"


@pytest.mark.parametrize("bad", NO_ARRAYS, ids=repr)
def test_arrays(bad, solved):
    assert one_line(theory.energy_density, SCENE, bad).startswith("edges ")
    assert one_line(theory.capture_time_mass, SCENE, bad).startswith("edges ")
    assert one_line(theory.chaotic_zone, SCENE, bad).startswith("times ")
    assert one_line(theory.energy_cdf, solved["energies"], bad).startswith("s ")
    for entry in (solved["energies"].cdf, solved["energies"].captured_below, solved["sum"].cdf):
        assert one_line(entry, bad).startswith("s ")
    assert one_line(solved["sum"].density, bad).startswith("s ")
    assert one_line(solved["saddle"].cumulants, bad).startswith("q ")
    assert one_line(solved["saddle"].place, bad).startswith("x ")
    assert one_line(solved["saddle"].density, bad, 3).startswith("s ")
    assert one_line(solved["saddle"].above, bad, 3).startswith("s ")
    assert one_line(theory.peak_width, bad).startswith("s ")
    for place, field in enumerate(("x", "y", "errors")):
        columns = [[1.0, 2.0], [1.0, 2.0], [1.0, 1.0]]
        columns[place] = bad
        assert one_line(theory.fit_power, *columns).startswith(f"{field} ")
        assert one_line(theory.extrapolate, *columns).startswith(f"{field} ")


@pytest.mark.parametrize(
    "bad", [None, 1.0, "0.1", [math.nan], ["x"], [None], [[0.0]], [True], ["inf"], [1j]], ids=repr
)
def test_levels(bad):
    for entry, field in ((theory.density_at, "s"), (theory.cdf_at, "s"), (theory.capture_rate_at, "t")):
        assert one_line(entry, SCENE, bad, 4).startswith(field)


def test_levels_may_be_decimal_strings():
    assert theory.cdf_at(SCENE, ["0.1", 0.1, mpmath.mpf("0.1")], 4)[0] == pytest.approx(
        float(theory.cdf_at(SCENE, [0.1], 4)[0]), rel=1e-3
    )


def test_other_arguments(solved):
    assert one_line(theory.mean_of, SCENE, 3).startswith("f = 3, must be a function")
    assert one_line(theory.Energies, "moving-cap").startswith("root = 'moving-cap'")
    assert one_line(theory.Sum, SCENE, 2).startswith("root = ")
    assert one_line(theory.sum_of_cycles, solved["energies"], 3, q=1e6).startswith(
        "q = 1000000.0, must be within"
    )
    assert one_line(solved["saddle"].cumulants, [1e9]).startswith("q must be within")
    assert one_line(theory.chaotic_zone, SCENE, 0.0) == "times has 0 dimensions, must have 1"
    assert one_line(theory.energy_density, SCENE, [[0.0, 1.0]]) == "edges has 2 dimensions, must have 1"
    assert theory.sin_phi_hat(np, np.array([0.0, 0.1]), 0.2, 1.0, 0.0, 1.0).shape == (2,)


LEGS = BangBang(((0.0, 1.0), (0.25, 1.0), (0.5, 1.5), (0.75, 1.5), (1.0, 1.0)))
WAVE = Fourier(0.625, period=1.0, cos=(0.25,), sin=(0.125,))


@pytest.mark.parametrize(
    "scene",
    [
        Mushroom(r=LEGS, h=Fourier(1.0, period=1.0, sin=(0.25,)), nu=WAVE),
        Mushroom(
            r=Fourier(1.0, period=1.0, sin=(0.25,)),
            h=LEGS,
            nu=BangBang(((-0.25, 0.9), (0.5, 0.4), (0.75, 0.9))),
        ),
    ],
)
def test_cycles_of_both_kinds_of_laws_keep_the_exact_identities(scene):
    """Mean exp(-s) = 1 and p_nc' = p_nc exp(-s_nc) of the reversed cycle, to 20 digits; sec. 3.5."""
    found, back = theory.predict(scene, 20), theory.predict(theory.reversed_cycle(scene), 20)
    assert abs(found.mean_exp_minus - 1) < 1e-20
    assert abs(back.p_nc - found.p_nc * found.p_nc.context.exp(-found.log_e_nc)) < 1e-20
    assert found.m1 > 0


def test_a_period_is_its_frequency_exactly():
    """Laws that give `period` have the theory of the same laws by omega, as omega = 2 pi / P comes near."""
    given = {"r": (1.0, (), (0.5,)), "nu": (0.6, (0.375,), ())}
    by_period = {n: Fourier(mean, period=2.0, cos=c, sin=s) for n, (mean, c, s) in given.items()}
    by_omega = {n: Fourier(mean, math.pi, cos=c, sin=s) for n, (mean, c, s) in given.items()}
    found = theory.predict(Mushroom(h=1.0, **by_period), 12)
    other = theory.predict(Mushroom(h=1.0, **by_omega), 12)
    assert abs(found.m1 / other.m1 - 1) < 1e-12
    assert theory.Cycle.of(Mushroom(h=1.0, **by_period), 15).period == 2


def test_a_mouth_of_both_kinds_is_not_covered():
    scene = Mushroom(
        r=Fourier(1.5, period=1.0, sin=(0.25,)), w=BangBang(((0.0, 1.0), (0.5, 0.5), (1.0, 1.0))), h=1.0
    )
    assert "give the mouth by `nu`" in one_line(theory.predict, scene)
