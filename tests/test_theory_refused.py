"""What `theory` is given: numbers of any kind; bad input is refused in one line that names the field."""

import math
from collections.abc import Callable
from fractions import Fraction
from functools import cache
from typing import Any

import mpmath
import numpy as np
import pytest
from hypothesis import given, strategies as st
from support.depth import deep_but
from support.refusals import one_line

import theory
from scene import BangBang, Cap, Fourier, Mushroom, Stem, load
from scene.transforms import scaled
from theory import volumes
from theory.precision import MAX_DIGITS, MAX_ORDER

SCENE = load("moving-cap")
FP = mpmath.fp


def identity(s):
    return s


# What each argument may not be, by the type of what it may be: lists stand for arrays, tuples for levels.
BAD = {
    Mushroom: ["moving-cap", None, 1.0, {"table": "cap", "r": 1.0}, Mushroom, Cap(r=1.0), Stem(w=1.0, h=1.0)],
    type(FP): [None, 1.0, "fp"],
    type(identity): [3],
    int: [-1, 10**400, 1.5, np.float64(2.5), "3", None, True, math.nan, math.inf, [3]],
    float: ["x", b"1", None, True, math.nan, math.inf, -math.inf, [1.0], 1j, mpmath.mpf("nan"), mpmath.inf],
    list: [
        *("abc", None, True, {"a": 1}),
        *([math.nan, 1.0], [0.0, math.inf], [0.0, "1"], [[0.0, 1.0], [2.0]], [1j, 0]),
    ],
    tuple: [None, 1.0, "0.1", [math.nan], ["x"], [None], [[0.0]], [True], ["inf"], [1j]],
}
energies = cache(lambda: theory.energies(SCENE))
cycle = cache(lambda: theory.Cycle.of(SCENE, 15))
prediction = cache(lambda: theory.predict(SCENE, 4))
sum_of_three = cache(lambda: theory.sum_of_cycles(energies(), 3))
finite = cache(lambda: theory.at_energy(SCENE, 1e6))
OF_A_SCENE, WITH_DIGITS = {"scene": SCENE}, {"scene": SCENE, "digits": 4}
COLUMNS = {"x": [1.0, 2.0], "y": [1.0, 2.0], "errors": [1.0, 1.0]}
# What each entry takes: a function of its arguments by name, and arguments that are good.
ENTRIES = {
    "predict": (theory.predict, WITH_DIGITS),
    "mean_of": (theory.mean_of, {**WITH_DIGITS, "f": identity}),
    "moments": (theory.moments, {**WITH_DIGITS, "order": 2}),
    "cumulants": (theory.cumulants, {**WITH_DIGITS, "order": 1, "q": 0.5}),
    "reversed_cycle": (theory.reversed_cycle, OF_A_SCENE),
    "capture_curve": (theory.capture_curve, {**OF_A_SCENE, "n": 400}),
    "largest_gain": (theory.largest_gain, OF_A_SCENE),
    "energy_density": (theory.energy_density, {**OF_A_SCENE, "edges": [0.0, 1.0]}),
    "capture_time_mass": (theory.capture_time_mass, {**OF_A_SCENE, "edges": [0.0, 1.0]}),
    "chaotic_zone": (theory.chaotic_zone, {**OF_A_SCENE, "times": [0.0, 1.0]}),
    "density_at": (theory.density_at, {**WITH_DIGITS, "s": (0.0,)}),
    "cdf_at": (theory.cdf_at, {**WITH_DIGITS, "s": (0.0,)}),
    "caustics": (theory.caustics, WITH_DIGITS),
    "capture_rate_at": (theory.capture_rate_at, {**WITH_DIGITS, "t": (0.0,)}),
    "unbiased_mean": (theory.unbiased_mean, WITH_DIGITS),
    "volumes_at": (theory.volumes_at, {**OF_A_SCENE, "ctx": FP, "t": 0.0}),
    "energies": (theory.energies, {"found": SCENE}),
    "energy_cdf": (theory.energy_cdf, {"found": SCENE, "s": [0.0]}),
    "sum_of_cycles": (theory.sum_of_cycles, {"found": SCENE, "n_cycles": 2, "q": 0.5}),
    "rarity": (theory.rarity, WITH_DIGITS),
    "loss_probability": (theory.loss_probability, {"found": SCENE, "n_cycles": 2}),
    "frozen_rates": (theory.frozen_rates, OF_A_SCENE),
    "is_upright": (theory.is_upright, OF_A_SCENE),
    "upright_rate": (theory.upright_rate, {**OF_A_SCENE, "times": [0.0]}),
    "upright_spread": (theory.upright_spread, OF_A_SCENE),
    "kept_by_the_cap": (theory.kept_by_the_cap, {"nu": 0.5}),
    "at_energy": (theory.at_energy, {**OF_A_SCENE, "energy": 1e6}),
    "FiniteEnergy.cdf": (lambda **given: finite().cdf(**given), {"s": [0.0]}),
    "FiniteEnergy.free_cdf": (lambda **given: finite().free_cdf(**given), {"s": [0.0]}),
    "FiniteEnergy.captured_cdf": (lambda **given: finite().captured_cdf(**given), {"s": [0.0]}),
    "FiniteEnergy.capture_cdf": (lambda **given: finite().capture_cdf(**given), {"t": [0.0]}),
    "FiniteEnergy.zone": (lambda **given: finite().zone(**given), {"times": [0.0]}),
    "FiniteEnergy.at_capture": (lambda **given: finite().at_capture(**given), {"times": [0.0]}),
    "FiniteEnergy.mean_of_exp": (lambda **given: finite().mean_of_exp(**given), {"q": 0.5}),
    "FiniteEnergy.draw": (lambda **given: finite().draw(**given), {"n_cycles": 2, "n": 3, "seed": 4}),
    "fit_power": (theory.fit_power, {**COLUMNS, "orders": [-0.5]}),
    "extrapolate": (theory.extrapolate, {**COLUMNS, "exponent": -0.5}),
    "Cycle.of": (theory.Cycle.of, WITH_DIGITS),
    "Cycle.t_in": (lambda **given: cycle().t_in(**given), {"nu": 0.5}),
    "Cycle.t_out": (lambda **given: cycle().t_out(**given), {"nu": 0.5}),
    "Cycle.release_time": (lambda **given: cycle().release_time(**given), {"t": 0.5}),
    "Prediction.strings": (lambda **given: prediction().strings(**given), {"digits": 4}),
    "Prediction.sd_of_mean": (lambda **given: prediction().sd_of_mean(**given), {"n_cycles": 3}),
    "Energies.cdf": (lambda **given: energies().cdf(**given), {"s": [0.0]}),
    "Energies.captured_below": (lambda **given: energies().captured_below(**given), {"s": [0.0]}),
    "Sum.cdf": (lambda **given: sum_of_three().cdf(**given), {"s": [0.0]}),
    "Sum.density": (lambda **given: sum_of_three().density(**given), {"s": [0.0]}),
    "v_cap": (theory.v_cap, {"ctx": FP, "r": 1.0}),
    "v_stem": (theory.v_stem, {"ctx": FP, "w": 0.5, "h": 1.0, "slope": 0.0}),
    "v_ell": (theory.v_ell, {"ctx": FP, "r": 1.0, "nu": 0.5}),
    "v_cha": (theory.v_cha, {"ctx": FP, "r": 1.0, "w": 0.5, "h": 1.0, "slope": 0.0}),
    "delta": (theory.delta, {"ctx": FP, "nu": 0.5}),
    "energy": (theory.energy, {"ctx": FP, "vx": 1.0, "vy": 1.0}),
    "cap_invariant": (theory.cap_invariant, {"ctx": FP, "vx": 1.0, "vy": 1.0, "r": 1.0}),
    "sin_phi_hat": (theory.sin_phi_hat, {"ctx": FP, "x": 0.1, "y": 0.2, "vx": 1.0, "vy": 1.0, "r": 1.0}),
    "log_energy_rate_chaotic": (
        theory.log_energy_rate_chaotic,
        {"v_cha": 1.0, "v_cap": 1.0, "v_cha_rate": 1.0, "delta_rate": 1.0},
    ),
    "log_energy_rate_island": (theory.log_energy_rate_island, {"v_cap": 1.0, "v_cap_rate": 1.0}),
}


@pytest.mark.parametrize(
    ("name", "field"), [(name, field) for name, (_, good) in ENTRIES.items() for field in good]
)
def test_every_bad_value_is_refused_by_its_name(name, field):
    entry, good = ENTRIES[name]
    for bad in BAD[type(good[field])]:
        line = one_line(entry, **{**good, field: bad})
        if isinstance(bad, Cap | Stem):
            assert line.startswith("the theory is of mushrooms"), bad
        else:
            assert line.startswith("scene = " if field == "found" else (f"{field} ", f"{field}[")), bad
        if isinstance(good[field], Mushroom):
            assert ("scene.load('moving-cap')" in line) == isinstance(bad, str)


@pytest.mark.parametrize("name", [name for name, (_, good) in ENTRIES.items() if "digits" in good])
def test_digits_end_at_their_bounds(name):
    entry, good = ENTRIES[name]
    for bad in (0, MAX_DIGITS + 1):
        assert one_line(entry, **{**good, "digits": bad}) == f"digits = {bad}, must be 1 to {MAX_DIGITS}"


def test_levels_may_be_decimal_strings():
    assert theory.cdf_at(SCENE, ["0.1", 0.1, mpmath.mpf("0.1")], 4)[0] == pytest.approx(
        float(theory.cdf_at(SCENE, [0.1], 4)[0]), rel=1e-3
    )


LEGS = BangBang(((0.0, 1.0), (0.25, 1.0), (0.5, 1.5), (0.75, 1.5), (1.0, 1.0)))
WAVE = Fourier(0.625, period=1.0, cos=(0.25,), sin=(0.125,))


@pytest.mark.parametrize(
    "scene",
    [
        pytest.param(
            Mushroom(r=LEGS, h=Fourier(1.0, period=1.0, sin=(0.25,)), nu=WAVE), marks=pytest.mark.deep
        ),
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


WAVING = Mushroom(r=1.0, h=1.5, nu=Fourier(mean=0.6, omega=1.0, cos=(0.3,)))
NARROW = Mushroom(r=1.0, h=1.0, nu=Fourier(mean=1e-8, omega=1.0, cos=(0.5e-8,)))
TWICE = Mushroom(r=1.0, h=1.0, nu=Fourier(mean=0.5, omega=1.0, cos=(0.1, 0.25), sin=(0.0, 0.1)))
BOTH_KINDS = Mushroom(
    r=Fourier(1.5, period=1.0, sin=(0.25,)), w=BangBang(((0.0, 1.0), (0.5, 0.5), (1.0, 1.0))), h=1.0
)
UNMEASURED = Mushroom(r=Fourier(1.0, 1.0, (), (0.5,)), h=Fourier(1.0, 1.0, (), (-0.5,)), nu=0.9, slope=0.1111)
SLOWEST = Mushroom(r=1.0, h=1.0, nu=Fourier(0.5, 1e-320, cos=(0.1,)))
ONES = [1.0, 1.0]
at_rest = cache(lambda: theory.at_energy(load("ergodic"), 1e6))
# What is asked, and what the refusal says.
REFUSALS = [
    *((lambda n=n: theory.moments(SCENE, n), f"order = {n}, must be 0 to {MAX_ORDER}") for n in (-1, 65)),
    *((lambda n=n: theory.cumulants(SCENE, n), f"order = {n}, must be 0 to {MAX_ORDER}") for n in (-1, 65)),
    *((lambda n=n: theory.capture_curve(SCENE, n), f"n = {n}, must be 2 to 10000000") for n in (1, 10**9)),
    *(
        (lambda n=n: theory.sum_of_cycles(SCENE, n), f"n_cycles = {n}, must be 1 to 10000")
        for n in (0, 10**9)
    ),
    # Formulas outside their domain.
    (lambda: theory.delta(FP, 1.5), "nu = 1.5"),
    (lambda: theory.v_cha(FP, 0.0, 0.5, 1.0, 0.0), "r = 0.0, must be > 0"),
    (lambda: theory.sin_phi_hat(FP, 0.0, 0.1, 0.0, 0.0, 1.0), "vx = vy = 0"),
    (lambda: theory.sin_phi_hat(FP, 0.0, 0.1, 1.0, 0.0, 0.0), "r = 0.0, must be > 0"),
    (lambda: theory.log_energy_rate_island(0.0, 1.0), "v_cap = 0.0, must be > 0"),
    (lambda: theory.log_energy_rate_chaotic(0.0, 1.0, 1.0, 1.0), "v_cha = 0.0, must be > 0"),
    # Numbers, where one that binary64 holds is meant.
    (lambda: cycle().t_in(np.array([0.5, 0.6])), "must be one number"),
    (lambda: cycle().t_out(np.array([0.5, 0.6])), "must be one number"),
    (lambda: cycle().release_time(np.array([0.5, 0.6])), "must be one number"),
    (lambda: theory.density_at(SCENE, np.array([[0.1, 0.2]])), "s[0] = "),
    (lambda: theory.v_cap(FP, 10**400), "r = an integer of"),
    (lambda: theory.log_energy_rate_island(10**400, 1.0), "v_cap = an integer of"),
    # Values outside a cycle, and cycles without an answer.
    (lambda: cycle().t_in(0.1), "nu = 0.1, must be in [0.2, 1]"),
    (lambda: theory.Cycle.of(load("ergodic"), 15).t_out(1.0), "nu is constant"),
    (lambda: theory.predict(BOTH_KINDS), "give the mouth by `nu`"),
    (lambda: theory.predict(SCENE, 4, progress=3), "progress = 3, must be a function"),
    (lambda: theory.density_at(TWICE, [0.0], 4), "captured at most once"),
    (lambda: theory.cdf_at(load("moving-cap-trivial"), [0.0], 4), "in which energies change"),
    *((lambda n=n: theory.loss_probability(load("ergodic"), n), "keeps its energy") for n in (1, 2, 10)),
    (lambda: theory.loss_probability(SCENE, 0), "n_cycles"),
    (lambda: theory.frozen_rates(load("frozen-mushroom")), "no frozen rates"),
    # Other arguments.
    (lambda: theory.Energies("moving-cap"), "root = 'moving-cap'"),
    (lambda: theory.Sum(SCENE, 2), "root = "),
    (lambda: theory.sum_of_cycles(energies(), 3, q=1e6), "q = 1000000.0, must be within"),
    (lambda: theory.chaotic_zone(SCENE, 0.0), "times has 0 dimensions, must have 1"),
    (lambda: theory.chaotic_zone(SLOWEST, [0.0, 1.0]), "period is beyond binary64"),
    (lambda: theory.upright_spread(SLOWEST), "period is beyond binary64"),
    (lambda: theory.energy_density(SCENE, [[0.0, 1.0]]), "edges has 2 dimensions, must have 1"),
    *(
        (lambda edges=edges: theory.capture_time_mass(SCENE, edges), "edges must be at least two rising")
        for edges in ([0.0], [1.0, 0.0], [0.0, 0.0])
    ),
    # Fits, and terms that binary64 does not hold or tell apart.
    (lambda: theory.fit_power(ONES, [1.0, 2.0], ONES), "2 different x"),
    (lambda: theory.fit_power([1.0, 2.0], [1.0, 2.0], ONES, (-0.5,)), "3 different x"),
    (lambda: theory.fit_power([1.0, 2.0, 3.0], [1.0] * 3, [1.0] * 3, (0.5,)), "orders must be < 0"),
    (lambda: theory.fit_power([1.0, 2.0], [1.0, -2.0], ONES), "a power law needs y > 0"),
    (lambda: theory.extrapolate([1.0, 2.0], [1.0, 2.0], [1.0, 0.0]), "errors must be positive"),
    (lambda: theory.extrapolate([1.0, 2.0], [1.0, 2.0], ONES, 0.5), "exponent = 0.5, must be < 0"),
    (lambda: theory.extrapolate([1e5, 1e6], [1.0, 2.0], ONES, -1e-300), "term"),  # both are 1
    (lambda: theory.extrapolate([1e5, 1e6], [1.0, 2.0], ONES, -1e3), "term"),  # and one is 0
    (lambda: theory.extrapolate([1e-300, 1e300], [1.0, 2.0], ONES, -2.0), "term"),  # or infinite
    (lambda: theory.fit_power([1e300, 1.0, 1e-300], [1.0, 2.0, 3.0], [1.0] * 3, (-2.0,)), "term"),
    # Upright stems.
    (lambda: theory.upright_spread(scaled(WAVING, 900, -900)), "beyond binary64"),
    (lambda: theory.upright_rate(scaled(WAVING, 0, -900), np.full(1, 2.0**-900)), "beyond binary64"),
    (lambda: theory.upright_spread(SCENE), "sides are tilted"),
    (lambda: theory.upright_rate(load("retraced-arc"), np.zeros(1)), "sides are tilted"),
    (lambda: theory.is_upright(load("breathing-circle")), "mushrooms"),
    (lambda: theory.upright_spread(NARROW), "nu"),
    *((lambda nu=nu: theory.kept_by_the_cap(nu), "nu") for nu in (0.0, 5e-324, 1e-7, 1.5, math.nan)),
    # Finite energy: these were a page of the array library, a warning with nan, a variance of -1e-5, a mean
    # of nan, and a peak with a variance of -2.7e9.
    (lambda: theory.at_energy(load("untilted"), 1e6), "no frozen rates of scene 'untilted'"),
    (lambda: theory.at_energy(load("fermi-ulam"), 1e6), "mushrooms"),
    (lambda: theory.at_energy(UNMEASURED, 1e6), "no frozen rates"),
    (lambda: theory.at_energy(SCENE, 0.0), "energy = 0"),
    (lambda: theory.at_energy(SCENE, 1e308), "energy = 1e+308, must be > 0 and at most 2^1000"),
    *((lambda e=e: theory.at_energy(SCENE, e), "so slow") for e in (5e-324, 1e-310, 1e-300)),
    *(
        (lambda make=make: make(SCENE, 1e-3), "particles so slow, below a speed of 100")
        for make in (theory.FiniteEnergy, theory.at_energy)
    ),
    *((lambda e=e: theory.FiniteEnergy(SCENE, e), "energy =") for e in (-1.0, 0.0, math.nan, 2.0**1001)),
    (lambda: at_rest().captured_cdf([0.0]), "nobody is captured"),
    (lambda: at_rest().capture_cdf([0.1]), "nobody is captured"),
    (lambda: finite().mean_of_exp(1e6), "beyond binary64"),
    *(
        (lambda ask=ask, times=times: getattr(finite(), ask)(times), "times holds")
        for ask in ("zone", "at_capture")
        for times in ([-3.0], [0.0, 13.0], [1e300], [math.nan])
    ),
]


@pytest.mark.parametrize(("call", "message"), REFUSALS)
def test_what_is_asked_wrongly_is_refused_in_one_line(call, message):
    assert message in one_line(call)


def test_large_integers_shapes_and_nobodies_mean_are_answers():
    assert theory.v_cap(mpmath.mp, 10**400) > mpmath.mpf(10) ** 800
    assert theory.sin_phi_hat(np, np.array([0.0, 0.1]), 0.2, 1.0, 0.0, 1.0).shape == (2,)
    assert math.isnan(at_rest().captured_mean)


MANY = mpmath.MPContext()
MANY.dps = 40
# Formulas of a number system and so many numbers; a share is within their domains, whichever it stands for.
FORMULAS: dict[str, tuple[Callable[..., Any], int]] = {
    "v_cap": (theory.v_cap, 1),
    "v_stem": (theory.v_stem, 3),
    "v_ell": (theory.v_ell, 2),
    "v_cha": (lambda ctx, w, h: theory.v_cha(ctx, 1, w, h, 0), 2),
    "delta": (theory.delta, 1),
    "volumes_at": (lambda ctx, t: theory.volumes_at(ctx, SCENE, t).v_cha, 1),
    "energy": (theory.energy, 2),
    "sin_phi_hat": (theory.sin_phi_hat, 5),
    "cap_invariant": (theory.cap_invariant, 3),
}
SHARES = st.integers(1, 63).map(lambda n: Fraction(n, 64))  # of all kinds exactly
KINDS: list[Callable[[Fraction], Any]] = [
    *(Fraction, float, np.float64, np.float32, np.longdouble),
    *(mpmath.mp.mpf, MANY.mpf, lambda x: np.array(float(x))),
]


@pytest.mark.parametrize("name", FORMULAS)
@given(data=st.data())
def test_a_number_of_any_kind_is_its_value(name: str, data: st.DataObject) -> None:
    formula, n = FORMULAS[name]
    shares = data.draw(st.lists(SHARES, min_size=n, max_size=n))
    kinds = data.draw(st.lists(st.sampled_from(KINDS), min_size=n, max_size=n))
    expected = formula(FP, *map(float, shares))
    numbers = [kind(share) for kind, share in zip(kinds, shares, strict=True)]
    for ctx in (FP, mpmath.mp, MANY, np):
        assert float(formula(ctx, *numbers)) == pytest.approx(expected, rel=1e-13, abs=1e-15)
    rows = [np.array([float(share), 0.5]) for share in shares]
    assert formula(np, *rows)[0] == pytest.approx(expected, rel=1e-13, abs=1e-15)
    assert "arrays go with numpy" in one_line(formula, mpmath.fp, *rows)


def test_a_formula_that_takes_numbers_as_they_come_is_found_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(volumes, "in_system", lambda _, **numbers: list(numbers.values()))
    with pytest.raises(pytest.fail.Exception):
        one_line(theory.v_cap, mpmath.fp, np.array([0.5, 0.25]))


@pytest.mark.parametrize("kind", KINDS)
def test_times_and_mouths_may_be_of_any_kind(kind: Callable[[Fraction], Any]) -> None:
    half = kind(Fraction(1, 2))
    assert cycle().t_in(half) == cycle().t_in(0.5)
    assert cycle().t_out(half) == cycle().t_out(0.5)
    assert cycle().release_time(half) == cycle().release_time(0.5)
    here, there = theory.cdf_at(SCENE, [half, 0.5], 4)
    assert here == there


@pytest.mark.parametrize(
    "value", [None, 1j, "x", mpmath.nan, mpmath.inf, True, np.array([1.0, 2.0]), lambda s: s]
)
def test_what_a_mean_is_taken_of_is_a_finite_number(value: Any) -> None:
    assert one_line(theory.mean_of, SCENE, lambda _: value, 4).startswith("f(s) = ")


@pytest.mark.parametrize("exponent", [-1000, -400, 300, 1000])
def test_angles_scale(exponent: int) -> None:
    """Squares of what binary64 holds may be beyond it: an angle was nan, or 0."""
    near = (0.1, 0.2, 1.0, -2.0, 1.5)
    angle = theory.sin_phi_hat(mpmath.fp, *np.ldexp(near, exponent).tolist())
    assert angle == pytest.approx(theory.sin_phi_hat(mpmath.fp, *near), rel=1e-15)


@pytest.mark.parametrize(
    "name", deep_but(["moving-cap", "moving-cap-reversed", "retraced-arc"], "moving-cap-reversed")
)
@pytest.mark.parametrize("n", deep_but([10, 100, 300], 10, 300))
def test_sums_keep_phase_volume_where_they_are_tilted_to_it(name: str, n: int) -> None:
    found = theory.energies(load(name))
    sums = theory.sum_of_cycles(found, n, q=-1.0)
    error = n * (sums.step**2 / 4 + 1e-7)
    assert sums.mean_of(lambda s: np.exp(-s)) == pytest.approx(1, abs=error)
    plain = theory.sum_of_cycles(found, n).mean_of(lambda s: np.exp(-s))
    assert (abs(plain - 1) < error) == (n == 10)  # many cycles' tails are rounding there
