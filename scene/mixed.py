"""Signs of conditions in which Fourier and bang-bang laws meet, proved by Taylor's theorem in rationals.

Such a condition is not a polynomial, so Sturm's theorem does not decide it. It is smooth on each leg of the
bang-bang laws. Take an interval of half-width h and middle m, and a bound K on |f''| there. Then

    f(t) >= f(m) - |f'(m)| h - K h^2 / 2    for |t - m| <= h,

An interval is done if the right side is positive; otherwise it is halved. All numbers are rational. Cosine
and sine of a rational part of a turn are computed here in integers, to 155 bits, with a proved bound on the
error. (mpmath could do this too, but all threads share its constants.) Near a contact no interval is small
enough. The search then ends and reports where.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from functools import lru_cache, reduce
from typing import NamedTuple

from scene.laws import Fourier, Law, Quadratic, piece_at

MAX_BOXES = 8_000  # a scene with 512 half legs needs one to some for each, at up to 0.5 ms
MAX_HALVINGS = 64  # laws that keep apart by 2^-120 of their size are still told apart
# Digits of pi, cut off: pi exceeds PI by less than PI_ERROR.
PI = Fraction("3.141592653589793238462643383279502884197169399375105820974944")
PI_ERROR = Fraction(1, 10**60)
BITS = 168
# In units of 2^-BITS the first harmonic errs by 2 for its argument, 3 for each of 40 terms and 2 for the rest
# of the series, less than 2^8 in all as a point of the plane; each rotation to the next harmonic adds as much
# again, and 2 for its own rounding: less than 2^13 for 16 harmonics.
TURN_ERROR = Fraction(1, 2 ** (BITS - 13))
_HALF_PI = int(PI * 2 ** (BITS - 1))
_ONE = 1 << BITS


class TaylorBounds(NamedTuple):
    """A function about a time m: value and rate there, how wrong each may be, and a bound on |f''| near m."""

    value: Fraction
    rate: Fraction
    value_error: Fraction
    rate_error: Fraction
    bend: Fraction

    def sizes(self, h: Fraction) -> tuple[Fraction, Fraction]:
        """Return bounds on |f| and |f'| within h of m."""
        rate = abs(self.rate) + self.rate_error
        return abs(self.value) + self.value_error + h * (rate + h * self.bend / 2), rate + h * self.bend

    def least(self, h: Fraction) -> Fraction:
        """Return a lower bound on f within h of m."""
        return self.value - self.value_error - h * (abs(self.rate) + self.rate_error + h * self.bend / 2)


def add(f: TaylorBounds, g: TaylorBounds) -> TaylorBounds:
    """Return f + g."""
    return TaylorBounds(*(a + b for a, b in zip(f, g, strict=True)))


def multiply(f: TaylorBounds, g: TaylorBounds, h: Fraction) -> TaylorBounds:
    """Return f g within h of m, by the product rule."""
    f_size, f_rate = f.sizes(h)
    g_size, g_rate = g.sizes(h)
    f_whole, g_whole = abs(f.value) + f.value_error, abs(g.value) + g.value_error
    return TaylorBounds(
        f.value * g.value,
        f.rate * g.value + f.value * g.rate,
        f_whole * g.value_error + f.value_error * abs(g.value),
        f.rate_error * g_whole
        + abs(f.rate) * g.value_error
        + f.value_error * (abs(g.rate) + g.rate_error)
        + abs(f.value) * g.rate_error,
        f.bend * g_size + 2 * f_rate * g_rate + f_size * g.bend,
    )


def turns(part: Fraction, n: int) -> list[tuple[int, int]]:
    """Return cos and sin of 2 pi k `part` for k = 1 ... n, in units of 2^-BITS and each within TURN_ERROR."""
    quarter = (4 * part + Fraction(1, 2)).__floor__()
    rest = 4 * part - quarter  # quarters of a turn, between -1/2 and 1/2
    x = abs(rest.numerator) * _HALF_PI // rest.denominator
    sums, term, k = [0, 0], _ONE, 0
    while term:
        sums[k % 2] += -term if k % 4 > 1 else term
        k += 1
        term = (term * x >> BITS) // k
    cos, sin = sums[0], sums[1] if rest >= 0 else -sums[1]
    first = ((cos, sin), (-sin, cos), (-cos, -sin), (sin, -cos))[quarter % 4]
    found = [first]
    for _ in range(1, n):
        (a, b), (c, d) = first, found[-1]
        found.append((a * c - b * d >> BITS, a * d + b * c >> BITS))
    return found


def jet(law: Law, m: Fraction) -> TaylorBounds:
    """Return a law about m, good as far as the analytic piece that holds at m."""
    piece, zero = piece_at(law, m), Fraction(0)
    if isinstance(piece, Quadratic):
        d = m - piece.origin
        value, rate = piece.c0 + d * (piece.c1 + d * piece.c2), piece.c1 + 2 * piece.c2 * d
        return TaylorBounds(value, rate, zero, zero, abs(2 * piece.c2))
    if isinstance(piece, Fourier):
        return _wave(piece, m)
    return TaylorBounds(Fraction(piece), zero, zero, zero, zero)


class _Wave(NamedTuple):
    """A Fourier law prepared: its numbers as integers over one power of two, and sums of their sizes."""

    scale: int
    mean: int
    harmonics: tuple[tuple[int, int, int], ...]
    swing: Fraction
    slopes: Fraction
    bends: Fraction


@lru_cache(maxsize=64)
def _prepared(law: Fourier) -> _Wave:
    harmonics = [(k, Fraction(c), Fraction(s)) for k, c, s in law.harmonics()]
    mean = Fraction(law.mean)
    scale = max(number.denominator for number in [mean, *(x for _, *pair in harmonics for x in pair)])
    sizes = [(k, abs(a) + abs(b)) for k, a, b in harmonics]
    return _Wave(
        scale,
        int(mean * scale),
        tuple((k, int(a * scale), int(b * scale)) for k, a, b in harmonics),
        sum((size for _, size in sizes), Fraction(0)),
        sum((k * size for k, size in sizes), Fraction(0)),
        sum((k * k * size for k, size in sizes), Fraction(0)),
    )


def _wave(law: Fourier, m: Fraction) -> TaylorBounds:
    assert law.period is not None  # a law that gives omega shares no period with a bang-bang law
    wave, period = _prepared(law), Fraction(law.period)
    found = turns(m / period % 1, wave.harmonics[-1][0])
    value, slope = wave.mean * _ONE, 0
    for k, a, b in wave.harmonics:
        cos, sin = found[k - 1]
        value += a * cos + b * sin
        slope += k * (b * cos - a * sin)
    omega, omega_error = 2 * PI / period, 2 * PI_ERROR / period
    highest = omega + omega_error
    return TaylorBounds(
        Fraction(value, wave.scale * _ONE),
        omega * Fraction(slope, wave.scale * _ONE),
        wave.swing * TURN_ERROR,
        wave.slopes * (highest * TURN_ERROR + omega_error),
        highest * highest * wave.bends,
    )


class SignVerdict(NamedTuple):
    """Whether a condition holds at all times; None if this is open near the given time."""

    holds: bool | None
    time: Fraction


def sign_on_legs(
    terms: Sequence[tuple[int, tuple[Law, ...]]], is_strict: bool, legs: Iterable[tuple[Fraction, Fraction]]
) -> SignVerdict:
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
        total = reduce(add, (_product(sign, laws, m, h) for sign, laws in terms))
        highest, least = total.value + total.value_error, total.least(h)
        if highest < 0 or (is_strict and highest == 0):
            return SignVerdict(False, m)
        if least > 0 or (least == 0 and not is_strict):
            continue
        if n_halvings == MAX_HALVINGS:
            return SignVerdict(None, m)
        todo += [(m - h / 2, h / 2, n_halvings + 1), (m + h / 2, h / 2, n_halvings + 1)]
    return SignVerdict(None, todo[-1][0]) if todo else SignVerdict(True, Fraction(0))


def _product(sign: int, laws: tuple[Law, ...], m: Fraction, h: Fraction) -> TaylorBounds:
    zero = Fraction(0)
    one = TaylorBounds(Fraction(sign), zero, zero, zero, zero)
    return reduce(lambda f, law: multiply(f, jet(law, m), h), laws, one)
