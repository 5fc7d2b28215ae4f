"""Laws of motion (secs. 3, 4): values, derivatives, periods, pieces, bounds at all times, exact algebra."""

import math
import random
import sys
from fractions import Fraction
from functools import reduce
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given, strategies as st
from mpmath import MPContext, MPIntervalContext, fp, mpf
from support.depth import deep_but
from support.refusals import one_line

from conformance.strategies import laws
from scene import BangBang, Cap, Constant, Fourier, Law, Stem, bounds, mpmath_internals as raw
from scene.bounds import LEAST_NORMAL, Bounds, round_up
from scene.exact import Sturm, add, at, multiply, negative_point, root_bound, scale, vanishes
from scene.laws import law_of
from scene.pieces import exact

LEGS = BangBang(knots=((0.0, 1.0), (0.25, 0.3), (0.5, 0.3), (0.75, 1.0), (1.0, 1.0)))
times = st.floats(-1e3, 1e3)
drawn = laws().map(law_of)
moving = drawn.filter(lambda law: not law.is_constant)


def context(digits):
    ctx = MPContext()
    ctx.dps = digits
    return ctx


def test_a_fourier_law_is_its_sum():
    law = Fourier(mean=0.5, omega=2.0, cos=(0.25,), sin=(0.125, 0.0625))
    t = 0.7
    expected = 0.5 + 0.25 * math.cos(1.4) + 0.125 * math.sin(1.4) + 0.0625 * math.sin(2.8)
    assert law.value(fp, t) == pytest.approx(expected, rel=1e-15)


def test_bang_bang_rests_at_its_knots_and_is_half_way_and_fastest_at_mid_leg():
    ctx = context(40)
    for time, level in LEGS.knots:
        assert (LEGS.value(ctx, time), LEGS.value(ctx, time, 1)) == (ctx.mpf(level), 0)
    low, high = ctx.mpf(0.3), ctx.mpf(1.0)
    assert LEGS.value(ctx, 0.125) == (low + high) / 2
    assert LEGS.value(ctx, 0.125, 1) == 2 * (low - high) / ctx.mpf(0.25)
    # Constant acceleration to mid-leg, the opposite after.
    assert LEGS.value(ctx, 0.0625, 2) == -LEGS.value(ctx, 0.1875, 2)
    # A quarter of the way in time is an eighth of the way in value.
    assert LEGS.value(ctx, 0.0625) == high + (low - high) / 8


@given(moving, st.lists(times, min_size=1, max_size=5))
def test_many_times_at_once_are_as_right_as_they_are_rounded(law, given_times):
    ctx, limits = context(40), law.bounds()
    sizes = max(abs(limits.lowest), abs(limits.highest)), limits.slope, limits.curvature
    for order in (0, 1):
        found = law.values(np.array(given_times), order)
        far = 2 * max((abs(float(t)) for t in law.breakpoints()), default=0.0)
        for t, number in zip(given_times, found, strict=True):
            late = 4 * np.spacing(abs(t) + far)
            assert abs(number - law.value(ctx, t, order)) <= 1e-14 * sizes[order] + late * sizes[order + 1]


def test_many_times_at_once_know_their_legs():
    inside = np.array([t + turns for t in (0.0625, 0.1875, 0.3, 0.5625, 0.6875, 0.8) for turns in (-3, 0, 7)])
    for order in (0, 1, 2):
        expected = [LEGS.value(fp, float(t), order) for t in inside]
        assert LEGS.values(inside, order) == pytest.approx(expected, abs=1e-13)
    assert LEGS.values(np.array([0.25, 1.25]), 2).tolist() == [0.0, 0.0]  # of the leg that follows
    # The phase of a far time is lost, but it is one; a leg's middle may round onto its knot.
    law = BangBang(knots=((0.0, 1.0), (0.1, 0.5), (0.3, 1.0)))
    far = law.values(np.logspace(10, 20, 200))
    assert (far.min() >= 0.5, far.max() <= 1.0) == (True, True)
    steep = BangBang(knots=((1.0, 1.0), (1.0 + 2.0**-52, 4.0), (2.0, 1.0)))
    assert steep.values(np.array([1.0, 1.0 + 2.0**-52])).tolist() == [1.0, 4.0]


def test_a_knot_belongs_to_the_leg_that_follows():
    law = BangBang(knots=((0.0, 1.0), (1.0, 2.0), (3.0, 1.0)))
    assert law.value(fp, 1.0, 2) == -1.0
    assert law.value(fp, 3.0, 2) == law.value(fp, 0.0, 2) == 4.0
    # And mid-leg to the half that brakes: a piece never ends where it starts to hold.
    assert law.value(fp, 0.5, 2) == -4.0
    assert all(law.piece_at(t).end > t for t in law.breakpoints())


@pytest.mark.parametrize("turns", [-(2**40), -3, -1, 1, 7, 2**40])
def test_bang_bang_repeats_at_negative_and_large_times(turns):
    for time in (0.0, 0.0625, 0.125, 0.3, 0.5, 0.7421875, 0.875):
        late = Fraction(time) + turns
        ctx = context(60)
        for order in (0, 1, 2):
            assert LEGS.value(ctx, exact(ctx, late), order) == LEGS.value(ctx, time, order)


@pytest.mark.parametrize("leg", [1e-20, 1e-160, 1e-310, 5e-324])
def test_floats_hold_the_values_of_legs_whose_parts_they_do_not(leg):
    law, ctx = BangBang(((0.0, 1.0), (leg, 0.5), (1.0, 1.0))), context(700)
    times = [0.0, 0.3 * leg, 0.7 * leg, leg, 0.25, 0.7]
    for order in (0, 1, 2):
        right = [float(law.value(ctx, time, order)) for time in times]
        assert [law.value(fp, time, order) for time in times] == pytest.approx(right, rel=1e-15, abs=1e-15)
        assert law.value(fp, np.array(times), order) == pytest.approx(right, rel=1e-15, abs=1e-15)


def test_times_may_be_any_kind_of_number():
    ctx = context(50)
    third = ctx.mpf(1) / 3
    assert LEGS.value(ctx, third) == ctx.mpf(0.3)
    assert LEGS.value(ctx, ctx.mpf(0.125)) == LEGS.value(ctx, 0.125) == LEGS.value(ctx, Fraction(1, 8))


@given(drawn, times)
def test_derivatives_are_limits_of_differences(law, t):
    ctx = context(60)
    time, step = ctx.mpf(t), ctx.mpf(2) ** -80
    # One-sided, for at a knot or mid-leg the law that follows holds; no knot may come within the step.
    piece = law.piece_at(Fraction(t))
    assume(piece.end is None or piece.end > Fraction(t) + Fraction(1, 2**80))
    for order in (0, 1):
        slope = (law.value(ctx, time + step, order) - law.value(ctx, time, order)) / step
        size = 1 + abs(law.bounds().curvature) * (
            1 + 64 * (float(law.cycle.frequency(fp)) if law.is_trigonometric and law.cycle else 0.0)
        )
        assert abs(slope - law.value(ctx, time, order + 1)) <= size * step


@given(drawn, st.floats(-8.0, 8.0), st.floats(0.0, 2.0**-6))
def test_intervals_enclose_points(law, t, width):
    iv = MPIntervalContext()
    iv.prec = 80
    sharp = context(60)
    piece = law.piece_at(Fraction(t))
    stop = t + width if piece.end is None else min(t + width, float(piece.end))
    for order in (0, 1, 2):
        enclosure = piece.evaluate(iv, iv.mpf([t, stop]), order)
        for point in (t, (t + stop) / 2, stop):
            assert piece.evaluate(sharp, sharp.mpf(point), order) in enclosure


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Fourier(mean=math.inf, omega=1.0), "fourier.mean = inf, must be finite"),
        (lambda: Fourier(mean="1", omega=1.0), "fourier.mean = '1', must be a finite number"),
        (lambda: Fourier(mean=1.0, omega=0.0), "fourier.omega = 0.0, must be finite and > 0"),
        (lambda: Fourier(mean=1.0, omega=-1.0), "fourier.omega = -1.0, must be finite and > 0"),
        (lambda: Fourier(mean=1.0, omega=math.nan), "fourier.omega = nan, must be finite"),
        (lambda: Fourier(mean=1.0, omega=True), "fourier.omega = True, must be a finite number"),
        (lambda: Fourier(mean=1.0, period=0.0), "fourier.period = 0.0, must be finite and > 0"),
        (lambda: Fourier(mean=1.0, period=math.inf), "fourier.period = inf, must be finite"),
        (lambda: Fourier(mean=1.0), "fourier needs exactly one of `omega` and `period`"),
        (
            lambda: Fourier(mean=1.0, omega=1.0, period=1.0),
            "fourier needs exactly one of `omega` and `period`",
        ),
        (lambda: Fourier(1.0, 1.0, sin=(0.0, math.nan)), "fourier.sin[1] = nan, must be finite"),
        (lambda: Fourier(1.0, 1.0, cos=(0.0,) * 17), "fourier.cos has 17 harmonics, at most 16"),
        (lambda: Fourier(1.0, 1.0, cos=0.5), "fourier.cos = 0.5, must be a list of numbers"),
        (lambda: Fourier(1.0, 1.0, cos="12"), "fourier.cos = '12', must be a list of numbers"),
        (lambda: Fourier(1.0, 1.0, cos=(None,)), "fourier.cos[0] = None, must be a finite number"),
        (lambda: BangBang(knots=()), "bang-bang.knots has 0 knots, must have 2 to 256"),
        (lambda: BangBang(knots=None), "bang-bang.knots = None, must be a list of pairs [time, value]"),
        (lambda: BangBang(knots=((0.0, 1.0),) * 257), "bang-bang.knots has 257 knots, must have 2 to 256"),
        (lambda: BangBang(((0.0, 1.0), (0.0, 1.0))), "bang-bang.knots[1] time = 0.0, must be > 0.0"),
        (lambda: BangBang(((0.0, 1.0), (1.0, 2.0))), "knots[1] value = 2.0, must equal the first (1.0)"),
        (lambda: BangBang(((0.0, 1.0), (math.inf, 1.0))), "bang-bang.knots[1] time = inf, must be finite"),
        (lambda: BangBang(((0.0, 1.0), (1.0,))), "knots[1] = (1.0,), must be a pair"),
        (lambda: BangBang(((0.0, 1.0), "ab")), "bang-bang.knots[1] = 'ab', must be a pair [time, value]"),
        (lambda: BangBang(((1e-20, 1.0), (1.0, 1.0))), "the period must be a binary64 number"),
        (lambda: BangBang(((-1e308, 1.0), (1e308, 1.0))), "the period must be a binary64 number"),
    ],
)
def test_a_broken_law_cannot_be_made(make, message):
    assert message in one_line(make)


LISTS = [[0, 1], [np.int64(1), np.float64(2)], (2, 1)]
KNOTS = BangBang(((0.0, 1.0), (1.0, 2.0), (2.0, 1.0)))
ONE_WAVE = Fourier(1.0, 2.0, (0.25, 0.0), (0.125,))


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        (Fourier(1, np.float32(2.0), [np.float64(0.25), 0], [Fraction(1, 8)]), ONE_WAVE),
        (Fourier(np.array(1.0), np.float32(2.0), np.array([0.25, 0.0]), [np.array(0.125)]), ONE_WAVE),
        *((BangBang(knots), KNOTS) for knots in (LISTS, np.array(LISTS), [np.array(knot) for knot in LISTS])),
        (Stem(w=np.array(1.0), h=np.float32(2.0)), Stem(w=1.0, h=2.0)),
    ],
)
def test_numbers_of_any_kind_become_floats_and_lists_tuples(given, expected):
    assert given == expected
    assert repr(given) == repr(expected)  # tuples of floats, none of numpy's


@pytest.mark.parametrize(
    ("law", "period"), [(LEGS, 1.0), (Fourier(1.0, period=3.0, cos=(0.25,)), 3.0), (Fourier(2.0, 1.0), 0.0)]
)
def test_a_law_is_evaluated_at_a_time_or_an_array_of_times(law, period):
    grid = np.array([[0.0, 0.1], [2.5, -7.0]])
    assert law(grid).tolist() == law(grid.tolist()).tolist() == [[law(t) for t in row] for row in grid]
    assert law(0.1) == pytest.approx(law.value(fp, 0.1), rel=1e-15)
    table = Cap(r=law)
    assert table.at(0.1) == {"r": law(0.1)}
    assert table.period == period
    for bad, words in (("a", "t = 'a'"), ([0.0, math.nan], "t = nan"), ({}, "t = an object of type dict")):
        assert one_line(law, bad).startswith(words)


N_LAWS = 4000
LEAST, LARGEST = math.ulp(0.0), sys.float_info.max
FINE, IV = MPContext(), MPIntervalContext()
FINE.prec = IV.prec = 400  # bits


def truth(law: Law) -> list[tuple[mpf, mpf]]:
    """Enclose the numbers that `bounds` bounds."""
    return [tuple(FINE.make_mpf(end) for end in raw.ends(interval)) for interval in enclosures(law)]


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
    """A faulty `round_up`: only a factor of 1 + 2^-45, which does nothing to a subnormal number."""
    found = round_up(size, exponent)
    return math.nextafter(found, 0.0) if found < LEAST_NORMAL else found


@pytest.mark.parametrize("seed", deep_but(range(4), 0))
def test_bounds_are_rounded_outward_at_every_scale(seed, monkeypatch):
    draw = random.Random(f"bounds {seed}")
    n_subnormal = n_infinite = n_missed = 0
    for _ in range(N_LAWS // 4):
        law = extreme_law(draw)
        found, true = law.bounds(), truth(law)
        assert is_sound(found, true), law
        assert is_sharp(found, true), law
        n_subnormal += any(0 < abs(bound) < LEAST_NORMAL for bound in found)
        n_infinite += math.inf in found
        with monkeypatch.context() as patch:
            patch.setattr(bounds, "round_up", rounded_up_by_a_factor)
            n_missed += not is_sound(law.bounds(), true)
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
    assert is_sound(law.bounds(), truth(law))


def test_a_law_that_stands_still_has_exact_bounds():
    assert Constant(0.3).bounds() == Fourier(0.3, 1.0).bounds() == Bounds(0.3, 0.3, 0.0, 0.0)
    assert BangBang(((0.0, 0.3), (1.0, 0.3))).bounds() == Bounds(0.3, 0.3, 0.0, 0.0)


rationals = st.fractions(-4, 4, max_denominator=16)


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
