"""Validity of a scene over its whole period, by proof rather than sampling.

Each condition is the sign of a sum of products of laws. For trigonometric laws the
substitution x = tan(omega t / 2) makes it a rational polynomial over the real line, for
bang-bang laws it is one on each leg. `scene.exact` decides its sign, and contact too: nu = 1
at one instant is valid, nu > 1 by one unit in the last place is not. If laws of both kinds move in
a condition, intervals decide it. Then the two sides must not touch: contact is refused.

A condition of both kinds is no polynomial, but it is smooth on each leg of the bang-bang laws. On
an interval of half-width h about m the mean value theorem says

    f(t) lies in f(m) + f'([m - h, m + h]) [-h, h]    for |t - m| <= h.

An interval is done if all of that is positive; otherwise it is halved. Near a contact no interval
is small enough. The search then ends and reports where.
"""

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from math import inf, isfinite, prod
from typing import Any, NamedTuple

import numpy as np

from scene import exact
from scene.exact import half_angle, leg_intervals, leg_polynomial, one_plus_square
from scene.laws import Constant, Law, first_origin, shared_cycle
from scene.pieces import Period, exact as number
from scene.precision import decimals, intervals
from scene.refusal import InvalidScene

MAX_BOXES = 8_000  # a scene with 512 half legs needs one to some for each, at up to 3 ms
MAX_HALVINGS = 64  # laws that keep apart by 2^-120 of their size are still told apart
BITS = 256  # a time may be 2^53 periods, of which no digit that counts is lost

NOTHING = Constant(0.0)

Laws = Mapping[str, Law]
Interval = Any  # mpmath's, which has no type stubs
Terms = Sequence[tuple[int, tuple[Law, ...]]]


class Condition(NamedTuple):
    """sum of sign * product(laws) must be > 0 (strict) or >= 0."""

    text: str
    terms: Terms
    is_strict: bool = True


def prove(laws: Laws, conditions: Sequence[Condition]) -> None:
    """Prove that laws share one period and that conditions hold at all times.

    Args:
        laws: by parameter name; each a sound law.
        conditions: those that say that single laws are positive come first.

    Raises:
        InvalidScene: naming the parameter, the time and the values that break it.
    """
    check_common_period(laws)
    positive: set[Law] = set()
    for condition in conditions:
        kept = [(sign, factors) for sign, factors in condition.terms if NOTHING not in factors]
        if [sign for sign, _ in kept] == [1] and positive.issuperset(kept[0][1]):
            continue  # a product of laws known to be positive
        _check(laws, condition)
        if len(condition.terms) == len(condition.terms[0][1]) == 1 and condition.is_strict:
            positive.add(condition.terms[0][1][0])


def check_common_period(laws: Laws) -> None:
    """Refuse laws that move with different periods.

    Raises:
        InvalidScene: naming two of them, their periods and what to do.
    """
    moving = {name: law.cycle for name, law in laws.items() if law.cycle is not None}
    for (first, a), (second, b) in itertools.combinations(moving.items(), 2):
        if a != b:
            ctx = decimals()
            one, other = (ctx.nstr(shared.value(ctx), 17) for shared in (a, b))
            raise InvalidScene(
                f"{first} has period {one} and {second} has {other}:"
                " all laws that move must share one period exactly; "
                f"{_remedy(laws, first, second, a, b)}"
            )


def _remedy(laws: Laws, first: str, second: str, a: Period, b: Period) -> str:
    if (a.length is None) != (b.length is None):
        by_omega, length = (first, b.length) if a.length is None else (second, a.length)
        assert length is not None
        instead = f"give it period = {float(length)} instead"
        return f"{by_omega} gives omega, so its period is irrational: {instead}"
    if laws[first].breakpoints() and laws[second].breakpoints():
        return "repeat the knots of the shorter, or let it rest until the longer ends"
    return (
        "let both have a period that holds a whole number of each,"
        " and put waves further back in cos and sin (or repeat the knots)"
    )


def _is_clear(condition: Condition) -> bool:
    """Tell whether the ranges of the laws prove a condition.

    For most scenes they do, at little cost.
    """
    ranges = [law.bounds()[:2] for _, factors in condition.terms for law in factors]
    if not all(isfinite(end) for ends in ranges for end in ends):
        return False
    # Of two floats the sum has the right sign; products are taken exactly.
    is_sum = all(len(factors) == 1 for _, factors in condition.terms)
    level = float if is_sum else Fraction
    least = sum((_least_of(level, sign, factors) for sign, factors in condition.terms), level(0))
    return least > 0 or (least == 0 and not condition.is_strict)


def _least_of(level: type[float] | type[Fraction], sign: int, factors: tuple[Law, ...]) -> Any:
    """Return the least value of sign * product(laws) over the ranges of the laws."""
    ends = [level(sign)]
    for law in factors:
        lowest, highest, *_ = law.bounds()
        ends = [end * level(bound) for end in ends for bound in (lowest, highest)]
    return min(ends)


def _check(laws: Laws, condition: Condition) -> None:
    if _is_clear(condition):
        return
    used = [law for _, factors in condition.terms for law in factors if not law.is_constant]
    legs = [law for law in used if law.breakpoints()]
    if all(law.is_polynomial for law in used) or all(law.is_trigonometric for law in used):
        parts = _on_legs(condition, legs) if legs else _on_circle(condition)
        if any(_is_broken(condition, p, a, b) for p, a, b in parts):
            raise InvalidScene(_message(laws, condition))
    else:
        _check_by_intervals(laws, condition, legs)


def _is_broken(condition: Condition, p: exact.Polynomial, a: Fraction, b: Fraction) -> bool:
    """Tell whether a condition's polynomial is too small somewhere in [a, b]."""
    if exact.negative_point(p, a, b) is not None:
        return True
    return condition.is_strict and exact.vanishes(p, a, b)


def _check_by_intervals(laws: Laws, condition: Condition, legs: Sequence[Law]) -> None:
    """Check a condition in which laws of several forms meet."""
    verdict = sign_on_legs(condition.terms, condition.is_strict, leg_intervals(legs))
    if verdict.holds is None:
        raise InvalidScene(
            f"{condition.text} cannot be shown near t = {float(verdict.time):.6g}: where a law"
            " of waves and one with knots meet in one condition its sides must keep apart:"
            " here they touch, or nearly"
        )
    if not verdict.holds:
        raise InvalidScene(_message(laws, condition, verdict.time))


class SignVerdict(NamedTuple):
    """Whether a condition holds at all times; None if this is open near the given time."""

    holds: bool | None
    time: Fraction


def sign_on_legs(
    terms: Terms, is_strict: bool, legs: Iterable[tuple[Fraction, Fraction]]
) -> SignVerdict:
    """Decide whether the sum of sign * product(laws) is > 0 (strict) or >= 0 at all times.

    Args:
        terms: (sign, laws); laws with knots, and Fourier laws that give their period.
        is_strict: whether 0 is not enough.
        legs: intervals that cover one period, each within one piece of every law.

    Returns:
        The verdict. Its time is one at which the condition fails, or near which it is open.
    """
    todo = [((a + b) / 2, (b - a) / 2, 0) for a, b in legs]
    for _ in range(MAX_BOXES):
        if not todo:
            return SignVerdict(True, Fraction(0))
        m, h, n_halvings = todo.pop()
        at_m, over = enclose(terms, m, h)
        if at_m.b < 0 or (is_strict and at_m.b == 0):
            return SignVerdict(False, m)
        if over.a > 0 or (over.a == 0 and not is_strict):
            continue
        if n_halvings == MAX_HALVINGS:
            return SignVerdict(None, m)
        todo += [(m - h / 2, h / 2, n_halvings + 1), (m + h / 2, h / 2, n_halvings + 1)]
    return SignVerdict(None, todo[-1][0]) if todo else SignVerdict(True, Fraction(0))


def enclose(terms: Terms, m: Fraction, h: Fraction) -> tuple[Interval, Interval]:
    """Enclose the sum of sign * product(laws) at m, and within h of m on the pieces at m."""
    ctx = intervals(BITS)
    t = number(ctx, m)
    away = number(ctx, h) * ctx.mpf([-1, 1])
    total = ctx.mpf(0)
    total_rate = ctx.mpf(0)
    for sign, laws in terms:
        at_m = ctx.mpf(sign)
        rate = ctx.mpf(0)
        for law in laws:
            piece = law.piece_at(m)
            factor = piece.evaluate(ctx, t)
            factor_rate = piece.evaluate(ctx, t + away, 1)
            rate = rate * (factor + away * factor_rate) + (at_m + away * rate) * factor_rate
            at_m = at_m * factor
        total = total + at_m
        total_rate = total_rate + rate
    return total, total + away * total_rate


def _on_legs(
    condition: Condition, legs: Sequence[Law]
) -> Iterator[tuple[exact.Polynomial, Fraction, Fraction]]:
    for a, b in leg_intervals(legs):
        total: exact.Polynomial = []
        for sign, factors in condition.terms:
            term = [Fraction(sign)]
            for factor in factors:
                term = exact.multiply(term, leg_polynomial(factor, a))
            total = exact.add(total, term)
        yield total, Fraction(0), b - a


def _on_circle(condition: Condition) -> Iterator[tuple[exact.Polynomial, Fraction, Fraction]]:
    # Each law is N(x) / (1 + x^2)^n with n its highest harmonic.
    terms = [(sign, [half_angle(law) for law in factors]) for sign, factors in condition.terms]
    n = max(sum(degree for _, degree in factors) for _, factors in terms)
    total: exact.Polynomial = []
    for sign, factors in terms:
        term = exact.scale(one_plus_square(n - sum(d for _, d in factors)), Fraction(sign))
        for numerator, _ in factors:
            term = exact.multiply(term, numerator)
        total = exact.add(total, term)
    # x = infinity is the instant omega t = pi: the value there is the coefficient of x^(2n).
    at_infinity = total[2 * n] if len(total) > 2 * n else Fraction(0)
    yield ([at_infinity] if at_infinity else []), Fraction(0), Fraction(1)
    if total:
        bound = exact.root_bound(total)
        yield total, -bound, bound


def _least(condition: Condition, start: float, span: float, n: int) -> Sequence[int]:
    """Return after which n-ths of a period a condition's excess may be least.

    All, if floats do not tell.
    """
    # Floats know t, and hence the phase of a wave, to some 2^-52 of it: here to 2^-30 of a turn.
    if not abs(start) + span < 2.0**18 * span:
        return range(n)
    times = start + span * (np.arange(n) / n)
    sizes = (
        prod(max(map(abs, law.bounds()[:2])) for law in factors) for _, factors in condition.terms
    )
    with np.errstate(all="ignore"):
        found = sum(
            sign * prod(law.values(times) for law in factors) for sign, factors in condition.terms
        )
        near = np.min(found) + 2.0**-20 * sum(sizes)
    return np.flatnonzero(found <= near).tolist() if near < inf else range(n)


def _message(laws: Laws, condition: Condition, known: Fraction | None = None) -> str:
    # The proof is done; this only looks for an instant to show in the message. In mp no scene
    # overflows.
    ctx = decimals()
    shared = shared_cycle(laws.values())
    span, n = (shared.value(ctx), 512) if shared else (ctx.mpf(0), 1)
    start = first_origin(laws.values())
    times = [ctx.mpf(start) + span * i / n for i in _least(condition, start, float(span), n)]
    if known is not None:
        times.append(number(ctx, known))

    def excess(t: Any) -> Any:
        return sum(
            sign * prod(f.value(ctx, t) for f in factors) for sign, factors in condition.terms
        )

    def shown(x: Any) -> str:
        return str(ctx.nstr(x, 6))

    worst = min(times, key=excess)
    places = ", ".join(f"{name} = {shown(law.value(ctx, worst))}" for name, law in laws.items())
    return (
        f"{condition.text} fails by {shown(excess(worst))} near t = {shown(worst)}, where {places}"
    )
