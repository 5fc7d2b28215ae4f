"""Bounds of laws at all times, and exact algebra."""

import math
import random
import sys
from fractions import Fraction
from functools import reduce
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mpmath import MPContext, MPIntervalContext, mpf
from support.depth import deep_but

import scene
from scene import BangBang, Fourier, Law
from scene.exact import Sturm, add, at, multiply, negative_point, root_bound, scale, trimmed, vanishes
from scene.laws import LEAST_NORMAL, Bounds, _up, bounds

N_LAWS = 4000
LEAST, LARGEST = math.ulp(0.0), sys.float_info.max
FINE, IV = MPContext(), MPIntervalContext()
FINE.prec = IV.prec = 400  # bits


def truth(law: Law) -> list[tuple[mpf, mpf]]:
    """Enclose the numbers that `bounds` bounds."""
    return [tuple(FINE.make_mpf(end) for end in interval._mpi_) for interval in enclosures(law)]


def enclosures(law: Law) -> Bounds:
    if isinstance(law, BangBang):
        values = [v for _, v in law.knots]
        legs = [
            (abs(Fraction(v1) - Fraction(v0)), Fraction(t1) - Fraction(t0))
            for (t0, v0), (t1, v1) in pairwise(law.knots)
        ]
        slope = max(2 * rise / duration for rise, duration in legs)
        curvature = max(4 * rise / duration**2 for rise, duration in legs)
        rates = (IV.mpf(rate.numerator) / rate.denominator for rate in (slope, curvature))
        return Bounds(IV.mpf(min(values)), IV.mpf(max(values)), *rates)
    omega = IV.mpf(law.omega) if law.omega is not None else 2 * IV.pi / law.period
    terms = [(k * omega, IV.sqrt(IV.mpf(c) ** 2 + IV.mpf(s) ** 2)) for k, c, s in law.harmonics()]
    swing, slope, curvature = (sum((size * f**n for f, size in terms), IV.zero) for n in range(3))
    return Bounds(law.mean - swing, law.mean + swing, slope, curvature)


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


def is_sound(found: Bounds, true: list[tuple[mpf, mpf]]) -> bool:
    """Tell whether the bounds hold, infinite ones included."""
    (lowest, _), *sizes = true
    return found.lowest <= lowest and all(
        bound >= at_most for bound, (_, at_most) in zip(found[1:], sizes, strict=True)
    )


def is_sharp(found: Bounds, true: list[tuple[mpf, mpf]]) -> bool:
    """Tell whether no bound is further off than a relative 2^-44, or 2 of the smallest numbers."""
    lowest, highest, slope, curvature = true
    size = max(abs(lowest[0]), abs(highest[1]), highest[1] - lowest[0])
    rows = (
        (-found.lowest, -lowest[1], size),
        (found.highest, highest[0], size),
        (found.slope, *slope),
        (found.curvature, *curvature),
    )
    return all(
        at_least + size / 2**44 > LARGEST
        if bound == math.inf
        else bound - at_least <= size / 2**44 + 2 * FINE.mpf(LEAST)
        for bound, at_least, size in rows
    )


def rounded_up_by_a_factor(size: float, exponent: int) -> float:
    """A faulty `scene.laws._up`: only a factor of 1 + 2^-45, which does nothing to a subnormal number."""
    found = _up(size, exponent)
    return math.nextafter(found, 0.0) if found < LEAST_NORMAL else found


@pytest.mark.parametrize("seed", deep_but(range(4), 0))
def test_bounds_are_rounded_outward_at_every_scale(seed, monkeypatch):
    draw = random.Random(f"bounds {seed}")
    n_subnormal = n_infinite = n_missed = 0
    for _ in range(N_LAWS // 4):
        law = extreme_law(draw)
        found, true = bounds(law), truth(law)
        assert is_sound(found, true), law
        assert is_sharp(found, true), law
        n_subnormal += any(0 < abs(bound) < LEAST_NORMAL for bound in found)
        n_infinite += math.inf in found
        with monkeypatch.context() as patch:
            patch.setattr(scene.laws, "_up", rounded_up_by_a_factor)
            n_missed += not is_sound(bounds(law), true)
    assert n_subnormal > 100
    assert n_infinite > 50
    assert n_missed > 20  # the faulty one is caught


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


rationals = st.fractions(-4, 4, max_denominator=16)
# x^2 + c has no real root for c > 0 and two irrational ones for most c < 0.
quadratics = rationals.map(lambda c: trimmed([c, Fraction(0), Fraction(1)]))
intervals = st.tuples(rationals, rationals).filter(lambda ends: ends[0] < ends[1])


def product(factors, start=(Fraction(1),)):
    return reduce(multiply, factors, list(start))


@st.composite
def planted(draw):
    """A polynomial with known rational roots of known multiplicities, and its roots."""
    roots = draw(st.dictionaries(rationals, st.integers(1, 4), max_size=4))
    leading = draw(rationals.filter(bool))
    positive = draw(st.sampled_from([[Fraction(1)], [Fraction(1, 7), Fraction(0), Fraction(1)]]))
    linear = [[-root, Fraction(1)] for root, n in roots.items() for _ in range(n)]
    return scale(product(linear, positive), leading), list(roots)


@given(planted(), st.data())
def test_planted_roots_are_counted(case, data):
    """On intervals whose ends may be roots themselves, which Sturm does not count."""
    p, roots = case
    ends = st.one_of(st.sampled_from([*roots, Fraction(5)]), rationals)
    a, b = sorted(data.draw(st.lists(ends, min_size=2, max_size=2, unique=True)))
    assert Sturm(p).n_roots(a, b) == sum(a < root < b for root in roots)
    assert vanishes(p, a, b) == any(a <= root <= b for root in roots)
    for root in roots:
        assert abs(root) <= root_bound(p)
        assert vanishes(p, root - Fraction(1, 999), root)
        assert vanishes(p, root, root + Fraction(1, 999))
    cuts = [a, *sorted(root for root in roots if a < root < b), b]
    probes = [*cuts, *((left + right) / 2 for left, right in pairwise(cuts))]
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
    linear_square = [Fraction(-2), Fraction(0), Fraction(1)]
    p = add(product([linear_square, linear_square]), [Fraction(-1, 10**60)])
    point = negative_point(p, Fraction(0), Fraction(2))
    assert point is not None
    assert at(p, point) < 0
    assert negative_point(p, Fraction(3, 2), Fraction(2)) is None


@pytest.mark.parametrize(("a", "b"), [(0, 1), (-1, 0)])
def test_the_zero_polynomial_vanishes_and_is_never_negative(a, b):
    assert vanishes([], Fraction(a), Fraction(b))
    assert negative_point([], Fraction(a), Fraction(b)) is None
