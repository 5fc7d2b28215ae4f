"""Numbers that `theory` is given: of any kind, of one number system, as large as binary64 holds."""

from collections.abc import Callable
from fractions import Fraction
from typing import Any

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.refusals import one_line

import theory
from scene import load
from theory import volumes

SCENE = load("moving-cap")
CYCLE = theory.Cycle.of(SCENE, 15)
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
    expected = formula(mpmath.fp, *map(float, shares))
    numbers = [kind(share) for kind, share in zip(kinds, shares, strict=True)]
    for ctx in (mpmath.fp, mpmath.mp, MANY, np):
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
    assert CYCLE.t_in(half) == CYCLE.t_in(0.5)
    assert CYCLE.t_out(half) == CYCLE.t_out(0.5)
    assert CYCLE.release_time(half) == CYCLE.release_time(0.5)
    assert theory.cdf_at(SCENE, [half], 4) == theory.cdf_at(SCENE, [0.5], 4)


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


@pytest.mark.parametrize("name", ["moving-cap", "moving-cap-reversed", "retraced-arc"])
@pytest.mark.parametrize("n", [10, 100, 300])
def test_sums_keep_phase_volume_where_they_are_tilted_to_it(name: str, n: int) -> None:
    found = theory.energies(load(name))
    sums = theory.sum_of_cycles(found, n, q=-1.0)
    error = n * (sums.step**2 / 4 + 1e-7)
    assert sums.mean_of(lambda s: np.exp(-s)) == pytest.approx(1, abs=error)
    plain = theory.sum_of_cycles(found, n).mean_of(lambda s: np.exp(-s))
    assert (abs(plain - 1) < error) == (n == 10)  # many cycles' tails are rounding there
