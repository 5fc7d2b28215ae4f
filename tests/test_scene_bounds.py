"""Bounds of laws at all times, and exact algebra."""

from __future__ import annotations

import itertools
import math
import random
import sys
from fractions import Fraction
from functools import reduce
from itertools import pairwise
from typing import NamedTuple

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from support.depth import deep_but

from scene import BangBang, Fourier, Law
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
from scene.laws import Bounds, bounds, frequency
from scene.mixed import PI, PI_ERROR

N_LAWS = 4000
LEAST, LARGEST = Fraction(math.ulp(0.0)), Fraction(sys.float_info.max)


class Truth(NamedTuple):
    """What the bounds of a law are, each enclosed: (at least, at most)."""

    lowest: tuple[Fraction, Fraction]
    highest: tuple[Fraction, Fraction]
    slope: tuple[Fraction, Fraction]
    curvature: tuple[Fraction, Fraction]


def root(square: Fraction) -> tuple[Fraction, Fraction]:
    """Enclose a square root to 200 bits."""
    shift = max(0, 400 - square.numerator.bit_length() + square.denominator.bit_length())
    shift += shift % 2
    whole = math.isqrt((square.numerator << shift) // square.denominator)
    unit = Fraction(1, 1 << shift // 2)
    return whole * unit, (whole + 1) * unit


def truth(law: Law) -> Truth:
    """Return the exact extremes of legs, or the sums of amplitudes that bound a Fourier law."""
    if isinstance(law, BangBang):
        knots = [(Fraction(t), Fraction(v)) for t, v in law.knots]
        values = [v for _, v in knots]
        slope = max(2 * abs(v1 - v0) / (t1 - t0) for (t0, v0), (t1, v1) in pairwise(knots))
        curvature = max(4 * abs(v1 - v0) / (t1 - t0) ** 2 for (t0, v0), (t1, v1) in pairwise(knots))
        low, high = min(values), max(values)
        return Truth((low, low), (high, high), (slope, slope), (curvature, curvature))
    assert isinstance(law, Fourier)
    if law.omega is not None:
        omega = Fraction(law.omega), Fraction(law.omega)
    else:
        omega = 2 * PI / Fraction(law.period), 2 * (PI + PI_ERROR) / Fraction(law.period)
    sums = [[Fraction(0), Fraction(0)] for _ in range(3)]
    for k, c, s in law.harmonics():
        for end, size in enumerate(root(Fraction(c) ** 2 + Fraction(s) ** 2)):
            for order in range(3):
                sums[order][end] += size * (k * omega[end]) ** order
    mean, (swing, slopes, curvatures) = Fraction(law.mean), sums
    return Truth(
        (mean - swing[1], mean - swing[0]),
        (mean + swing[0], mean + swing[1]),
        tuple(slopes),
        tuple(curvatures),
    )


def at_scale(draw: random.Random) -> float:
    """Draw a positive number: any of the powers of two from 2^-1074 to 2^1000, times up to 2."""
    return max(
        math.ldexp(1 + draw.random(), draw.choice((draw.randint(-1074, 999), draw.randint(-1074, -1020)))),
        5e-324,
    )


def extreme_law(draw: random.Random) -> Law:
    """Draw a law whose values and times are of any size; sometimes its parts are of different sizes."""
    unit, time = at_scale(draw), at_scale(draw)

    def size() -> float:
        return draw.choice((1, -1)) * (at_scale(draw) if draw.random() < 0.2 else unit * draw.random())

    if draw.random() < 0.5:
        cos, sin = ([size() for _ in range(draw.randint(0, 4))] for _ in range(2))
        given = {draw.choice(("omega", "period")): time}
        return Fourier(size(), cos=cos, sin=sin, **given)
    places = sorted({0, 4096, *(draw.randint(1, 4095) for _ in range(draw.randint(1, 4)))})
    step = max(math.ldexp(1.0, math.frexp(time)[1] - 12), 5e-324)
    values = [size() for _ in places[1:]]
    return BangBang(list(zip([place * step for place in places], [*values, values[0]], strict=True)))


def is_sound(found: Bounds, true: Truth) -> bool:
    """Tell whether the bounds hold, infinite ones included."""
    below = found.lowest == -math.inf or Fraction(found.lowest) <= true.lowest[0]
    return below and all(
        bound == math.inf or Fraction(bound) >= size[1]
        for bound, size in zip(found[1:], true[1:], strict=True)
    )


def is_sharp(found: Bounds, true: Truth) -> bool:
    """Tell whether no bound is further off than a relative 2^-44, or 2 of the smallest numbers."""
    size = max(abs(true.lowest[0]), abs(true.highest[1]), true.highest[1] - true.lowest[0])
    ends = ((-found.lowest, -true.lowest[1], size), (found.highest, true.highest[0], size))
    rates = (
        (found.slope, true.slope[0], true.slope[1]),
        (found.curvature, true.curvature[0], true.curvature[1]),
    )
    return all(
        (bound == math.inf and at_least + size / 2**44 > LARGEST)
        or (bound < math.inf and Fraction(bound) - at_least <= size / 2**44 + 2 * LEAST)
        for bound, at_least, size in (*ends, *rates)
    )


def rounded_up_by_a_factor(law: Law) -> Bounds:
    """A faulty `bounds`: sums in binary64, then a factor of 1 + 2^-45, which does nothing to a subnormal."""

    def up(size: float) -> float:
        return size * (1 + 2.0**-45)

    if isinstance(law, BangBang):
        legs = [(abs(v1 - v0), t1 - t0) for (t0, v0), (t1, v1) in pairwise(law.knots)]
        values = [v for _, v in law.knots]
        slope, curvature = max(2 * v / t for v, t in legs), max(4 * v / t / t for v, t in legs)
        return Bounds(min(values), max(values), up(slope), up(curvature))
    omega = law.omega if law.omega is not None else 2 * math.pi / law.period
    terms = [(k * omega, math.hypot(c, s)) for k, c, s in law.harmonics()]
    swing, slope = up(sum(size for _, size in terms)), up(sum(size * f for f, size in terms))
    curvature = up(sum(size * f * f for f, size in terms))
    low, high = law.mean - swing, law.mean + swing
    slack = [(abs(level) + swing) * 2.0**-50 for level in (low, high)]
    return Bounds(low - slack[0], high + slack[1], slope, curvature)


@pytest.mark.parametrize("seed", deep_but(range(4), 0))
def test_bounds_are_rounded_outward_at_every_scale(seed):
    draw = random.Random(f"bounds {seed}")
    n_subnormal = n_infinite = n_missed = 0
    for _ in range(N_LAWS // 4):
        law = extreme_law(draw)
        found, true = bounds(law), truth(law)
        assert is_sound(found, true), law
        assert is_sharp(found, true), law
        n_subnormal += any(0 < abs(bound) < 2.0**-1022 for bound in found)
        n_infinite += math.inf in found
        n_missed += not is_sound(_or_infinite(rounded_up_by_a_factor, law), true)
    assert n_subnormal > 100
    assert n_infinite > 50
    assert n_missed > 20  # the faulty one is caught


def _or_infinite(faulty, law):
    try:
        return faulty(law)
    except ZeroDivisionError:  # a period that underflows
        return Bounds(-math.inf, math.inf, math.inf, math.inf)


@pytest.mark.parametrize(
    "law",
    [
        Fourier(1e-320, 1.0, cos=(5e-324, 5e-324, 5e-324)),
        Fourier(1.0, 5e-324, cos=(0.3,)),
        Fourier(1e300, 1e300, cos=(1e299,)),
        Fourier(0.0, 1.0, cos=(1.7e308,) * 16),
        Fourier(-1.7e308, period=5e-324, sin=(1.7e308,)),
        BangBang(((0.0, 5e-324), (1.0, 1e-323), (3.0, 5e-324))),
        BangBang(((0.0, 1.0), (5e-324, 2.0), (1e-323, 1.0))),
        BangBang(((0.0, -1.7e308), (1.0, 1.7e308), (2.0, -1.7e308))),
        BangBang(((0.0, 1.0), (1e308, 1.5), (1.5e308, 1.0))),
    ],
)
def test_bounds_of_the_most_extreme_laws(law):
    assert is_sound(bounds(law), truth(law))


def test_a_law_that_stands_still_has_exact_bounds():
    assert bounds(0.3) == bounds(Fourier(0.3, 1.0)) == Bounds(0.3, 0.3, 0.0, 0.0)
    assert bounds(BangBang(((0.0, 0.3), (1.0, 0.3)))) == Bounds(0.3, 0.3, 0.0, 0.0)


def test_frequency_of_a_period_is_the_nearest_number():
    from mpmath import MPContext

    ctx = MPContext()
    ctx.dps = 50
    law = Fourier(1.0, period=3.0, cos=(0.5,))
    assert abs(frequency(ctx, law) * 3 - 2 * ctx.pi) < ctx.mpf(10) ** -48
    assert float(frequency(ctx, Fourier(1.0, 0.1, (0.5,)))) == 0.1


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
