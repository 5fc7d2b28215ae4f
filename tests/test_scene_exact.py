"""Signs of rational polynomials against brute force, planted roots of every multiplicity included."""

import itertools
from fractions import Fraction
from functools import reduce

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from scene.exact import (
    Sturm,
    add,
    at,
    derivative,
    divide,
    multiply,
    negative_point,
    remainder,
    root_bound,
    scale,
    squarefree,
    trimmed,
    vanishes,
)

rationals = st.fractions(-4, 4, max_denominator=16)
polynomials = st.lists(rationals, max_size=6).map(trimmed)
# x^2 + c has no real root for c > 0 and two irrational ones for most c < 0.
quadratics = rationals.map(lambda c: trimmed([c, Fraction(0), Fraction(1)]))


def linear(root):
    return [-root, Fraction(1)]


def product(factors, start=(Fraction(1),)):
    return reduce(multiply, factors, list(start))


@st.composite
def planted(draw):
    """A polynomial with known rational roots, its roots, and their multiplicities."""
    roots = draw(st.dictionaries(rationals, st.integers(1, 4), max_size=4))
    leading = draw(rationals.filter(bool))
    positive = draw(st.sampled_from([[Fraction(1)], [Fraction(1, 7), Fraction(0), Fraction(1)]]))
    p = scale(product([linear(root) for root, n in roots.items() for _ in range(n)], positive), leading)
    return p, roots


intervals = st.tuples(rationals, rationals).filter(lambda ends: ends[0] < ends[1])


@given(polynomials, polynomials, rationals)
def test_algebra_agrees_with_values(p, q, x):
    assert at(add(p, q), x) == at(p, x) + at(q, x)
    assert at(multiply(p, q), x) == at(p, x) * at(q, x)
    assert derivative(multiply(p, q)) == trimmed(add(multiply(derivative(p), q), multiply(p, derivative(q))))


@given(polynomials, polynomials.filter(bool))
def test_division_leaves_a_smaller_remainder(p, q):
    quotient, rest = divide(p, q)
    assert add(multiply(quotient, q), rest) == p
    assert len(rest) < len(q)


@given(planted())
def test_squarefree_keeps_the_roots_once(case):
    p, roots = case
    simple = squarefree(p)
    for root in roots:
        assert at(simple, root) == 0
        assert at(derivative(simple), root) != 0
    # No multiple root, and every further zero of it is one of p.
    assert (simple[-1] > 0) == (p[-1] > 0)
    assert not divide(p, simple)[1]


@given(planted(), intervals)
def test_planted_roots_are_counted(case, ends):
    """By Sturm in the open interval; `vanishes` asks for one in the closed."""
    p, roots = case
    a, b = ends
    assert Sturm(p).n_roots(a, b) == sum(a < root < b for root in roots)
    assert vanishes(p, a, b) == any(a <= root <= b for root in roots)


@given(planted(), st.data())
def test_negative_point_against_signs_between_planted_roots(case, data):
    """On intervals whose ends may be roots themselves."""
    p, roots = case
    ends = st.one_of(st.sampled_from([*roots, Fraction(5)]), rationals)
    a, b = sorted(data.draw(st.lists(ends, min_size=2, max_size=2, unique=True)))
    cuts = [a, *sorted(root for root in roots if a < root < b), b]
    probes = [*cuts, *((left + right) / 2 for left, right in itertools.pairwise(cuts))]
    point = negative_point(p, a, b)
    assert (point is not None) == any(at(p, probe) < 0 for probe in probes)
    if point is not None:
        assert a <= point <= b
        assert at(p, point) < 0


@pytest.mark.deep
@given(st.lists(quadratics, min_size=1, max_size=3), intervals)
def test_double_irrational_roots_are_no_change_of_sign(factors, ends):
    a, b = ends
    square = product([f for factor in factors for f in (factor, factor)])
    assert negative_point(square, a, b) is None
    # Lowered by any amount it dips below zero exactly where it vanished before.
    lowered = add(square, [Fraction(-1, 10**30)])
    if vanishes(square, a, b):
        assert negative_point(lowered, a, b) is not None


def test_a_dip_narrower_than_any_sampling_is_found():
    # (x^2 - 2)^2 - 10^-60 is negative only within 4e-31 of the square root of 2.
    p = add(product([linear_square(), linear_square()]), [Fraction(-1, 10**60)])
    point = negative_point(p, Fraction(0), Fraction(2))
    assert point is not None
    assert at(p, point) < 0
    assert negative_point(p, Fraction(3, 2), Fraction(2)) is None


def linear_square():
    return [Fraction(-2), Fraction(0), Fraction(1)]


@given(planted())
def test_the_root_bound_holds_all_roots(case):
    p, roots = case
    assert all(abs(root) <= root_bound(p) for root in roots)


@pytest.mark.parametrize(("a", "b"), [(0, 1), (-1, 0)])
def test_the_zero_polynomial_vanishes_and_is_never_negative(a, b):
    assert vanishes([], Fraction(a), Fraction(b))
    assert negative_point([], Fraction(a), Fraction(b)) is None


@given(
    st.lists(st.integers(-9, 9), min_size=1, max_size=7), st.lists(st.integers(-9, 9), min_size=2, max_size=4)
)
def test_a_remainder_in_whole_numbers_is_a_positive_multiple_of_the_remainder(p, q):
    """Sturm's chain counts changes of sign: a negative multiple would miscount."""
    p, q = ([Fraction(a) for a in numbers] for numbers in (p, q))
    p, q = trimmed(p), trimmed(q)
    assume(len(q) > 1 and p)
    found, true = remainder(p, q), divide(p, q)[1]
    assert len(found) == len(true)
    ratios = {a / b for a, b in zip(found, true, strict=True) if b != 0}
    assert all(a == 0 for a, b in zip(found, true, strict=True) if b == 0)
    assert len(ratios) <= 1
    assert all(ratio > 0 for ratio in ratios)
