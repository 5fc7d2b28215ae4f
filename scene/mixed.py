"""Signs of conditions in which Fourier and bang-bang laws meet, proved in intervals.

Such a condition is not a polynomial, so Sturm's theorem does not decide it. It is smooth on each leg of the
bang-bang laws. On an interval of half-width h about m the mean value theorem says

    f(t) lies in f(m) + f'([m - h, m + h]) [-h, h]    for |t - m| <= h.

An interval is done if all of that is positive; otherwise it is halved. Near a contact no interval is small
enough. The search then ends and reports where.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

from scene.laws import Law, evaluate, exact, piece_at
from scene.precision import intervals

MAX_BOXES = 8_000  # a scene with 512 half legs needs one to some for each, at up to 3 ms
MAX_HALVINGS = 64  # laws that keep apart by 2^-120 of their size are still told apart
BITS = 256  # a time may be 2^53 periods, of which no digit that counts is lost

Interval = Any  # mpmath's, which has no type stubs
Terms = Sequence[tuple[int, tuple[Law, ...]]]


class SignVerdict(NamedTuple):
    """Whether a condition holds at all times; None if this is open near the given time."""

    holds: bool | None
    time: Fraction


def sign_on_legs(terms: Terms, is_strict: bool, legs: Iterable[tuple[Fraction, Fraction]]) -> SignVerdict:
    """Decide whether the sum of sign * product(laws) is > 0 (strict) or >= 0 at all times.

    Args:
        terms: (sign, laws); bang-bang laws and Fourier laws that give their period.
        is_strict: whether 0 is not enough.
        legs: intervals that cover one period, each within one piece of every bang-bang law.

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
    """Enclose the sum of sign * product(laws) at m, and within h of m on the pieces that hold at m."""
    ctx = intervals(BITS)
    t, away = exact(ctx, m), exact(ctx, h) * ctx.mpf([-1, 1])
    total, total_rate = ctx.mpf(0), ctx.mpf(0)
    for sign, laws in terms:
        at_m, rate = ctx.mpf(sign), ctx.mpf(0)
        for law in laws:
            piece = piece_at(law, m)
            factor, factor_rate = evaluate(ctx, piece, t), evaluate(ctx, piece, t + away, 1)
            rate = rate * (factor + away * factor_rate) + (at_m + away * rate) * factor_rate
            at_m = at_m * factor
        total, total_rate = total + at_m, total_rate + rate
    return total, total + away * total_rate
