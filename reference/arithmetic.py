"""Sound interval arithmetic at a private precision, on mpmath's `iv`.

Only operations known to be sound are used: + - * / sqrt, integer squares, and cos and sin in
one call. mpmath's interval `exp` is not sound and is not here. Comparisons never guess: `sign`
says 0 when an interval does not decide. Each Arithmetic owns its context, so threads working at
different precisions do not disturb each other, and mpmath's global precision is never touched.
"""

import math
from collections.abc import Sequence
from decimal import Decimal
from fractions import Fraction
from typing import Any, NamedTuple

from scene import mpmath_internals as raw
from scene.precision import CONSTANTS, ExactMpf, intervals, reduce_record

Interval = Any  # mpmath's ivmpf, which has no type stubs

BITS_PER_DIGIT = 3.3219280948873626
# Work that one step may take, in the unit of `WorkLimit`. Measured: at most 6,400 for a vector of
# the corpus at 50 digits, 4,400 for a plain step at 10,000 digits; 0.03 to 0.2 ms a unit on one
# idle core.
MAX_WORK = 50_000.0
LONG_NUMBER = 1024  # bits; arithmetic with so long a number takes twice as long as with a short one


class Undecidable(Exception):  # noqa: N818 (not an error of the caller: precision is raised)
    """The question is open at this precision."""


class Exhausted(Undecidable):
    """The work allowed for one step is used up; more precision would not help."""


class WorkLimit:
    """Limit on the work of one step, over all precisions that it tries.

    The unit is one evaluation of a parabola at few digits; long numbers cost in proportion. Work is
    counted, not timed, so that an answer does not depend on the machine.
    """

    def __init__(self) -> None:
        self.spent = 0.0

    def spend(self, units: float) -> None:
        """Count some work.

        Raises:
            Exhausted: when it is more than allowed.
        """
        self.spent += units
        if self.spent > MAX_WORK:
            raise Exhausted(f"more than {MAX_WORK:.0f} evaluations of the laws")


class Enclosure(NamedTuple):
    """lo <= truth <= hi, both exact mpf; copies and pickles keep every bit."""

    lo: Any
    hi: Any

    def __reduce__(self) -> tuple[Any, ...]:
        """Tell pickle and copy how to keep every bit."""
        return reduce_record(self)

    def __float__(self) -> float:
        """Return the centre, correctly rounded to binary64."""
        return float(self.centre())

    def __repr__(self) -> str:
        """Return the centre with its known decimals, and how far the true number may be from it."""
        centre = self.centre()
        half = self.extent() / 2
        if not half and Fraction(float(self)) == centre:
            return f"Enclosure({float(self)!r})"
        half = half or abs(centre) * Fraction("1E-40")
        places = 1 + math.ceil(math.log10(half.denominator) - math.log10(half.numerator))
        scale = Fraction(f"1E{places}")
        middle = round(centre * scale)
        left = math.ceil(half * scale + abs(centre * scale - middle))
        return f"Enclosure({Decimal(f'{middle}E{-places}')} ± {Decimal(f'{left}E{-places}')})"

    def centre(self) -> Fraction:
        """Return (lo + hi) / 2, exactly."""
        return (rational(raw.number(self.lo)) + rational(raw.number(self.hi))) / 2

    def extent(self) -> Fraction:
        """Return hi - lo, exactly."""
        return rational(raw.number(self.hi)) - rational(raw.number(self.lo))

    def width(self) -> float:
        """Return hi - lo, rounded."""
        return float(self.extent())

    def contains(self, number: float | Fraction) -> bool:
        """Tell exactly whether a number lies within."""
        return rational(raw.number(self.lo)) <= Fraction(number) <= rational(raw.number(self.hi))


def rational(number: raw.Raw) -> Fraction:
    """Return the rational that a raw finite number stands for."""
    return Fraction(*map(int, raw.to_rational(number)))


def exact_number(number: raw.Raw) -> ExactMpf:
    """Return the number that a raw finite number stands for."""
    return ExactMpf.of(*raw.parts(number))


def exact_ends(interval: Interval) -> tuple[Fraction, Fraction]:
    """Return the ends of a finite interval as rationals."""
    low, high = raw.ends(interval)
    return rational(low), rational(high)


class Arithmetic:
    """Interval arithmetic at a fixed precision.

    Args:
        digits: working decimals.
        work: the limit to use; None for a new one.
    """

    def __init__(self, digits: int, work: WorkLimit | None = None) -> None:
        self.digits = digits
        self.work = WorkLimit() if work is None else work
        self.prec = int(digits * BITS_PER_DIGIT) + 8
        self.context = intervals(self.prec)
        self.zero: Interval = self.context.mpf(0)

    def spend(self, units: float) -> None:
        """Count evaluations of a law at this precision.

        Raises:
            Exhausted: when the step has cost more than is allowed.
        """
        self.work.spend(units * (1 + self.prec / LONG_NUMBER))

    def number(self, value: float | int | Fraction) -> Interval:
        """Enclose a number: exactly when it is a float or a short integer."""
        if isinstance(value, Fraction):
            return self.number(value.numerator) / self.number(value.denominator)
        exactly = raw.from_int if isinstance(value, int) else raw.from_float
        return self.context.make_mpf(
            (exactly(value, self.prec, raw.DOWN), exactly(value, self.prec, raw.UP))
        )

    def dyadic(self, value: Fraction) -> Interval:
        """Return the thin interval at a rational whose denominator is a power of two, exactly."""
        shift = value.denominator.bit_length() - 1
        return self.point(raw.from_parts(value.numerator, -shift))

    def between(self, low: Fraction, high: Fraction) -> Interval:
        """Return the interval between two rationals whose denominators are powers of two, exactly.

        Denominators are not checked. Of any other rational this would make another number.
        """
        return self.hull(self.dyadic(low), self.dyadic(high))

    def point(self, number: raw.Raw) -> Interval:
        """Return the thin interval at a raw number."""
        return self.context.make_mpf((number, number))

    def power_of_two(self, exponent: int) -> Interval:
        """Return 2^exponent, exactly."""
        return self.point(raw.from_parts(1, exponent))

    def lower(self, x: Interval) -> Interval:
        """Return the lower end as a thin interval."""
        return self.point(raw.ends(x)[0])

    def upper(self, x: Interval) -> Interval:
        """Return the upper end as a thin interval."""
        return self.point(raw.ends(x)[1])

    def hull(self, x: Interval, y: Interval) -> Interval:
        """Return the interval from the lower end of x to the upper end of y."""
        return self.context.make_mpf((raw.ends(x)[0], raw.ends(y)[1]))

    def union(self, intervals: Sequence[Interval]) -> Interval:
        """Return the smallest interval that holds all of these."""
        lo, hi = raw.ends(intervals[0])
        for x in intervals[1:]:
            a, b = raw.ends(x)
            lo, hi = (a if raw.is_less(a, lo) else lo), (b if raw.is_greater(b, hi) else hi)
        return self.context.make_mpf((lo, hi))

    def middle(self, x: Interval) -> Interval:
        """Return a short dyadic point well inside x (half way when x is very thin)."""
        a, b = raw.ends(x)
        exact = raw.shifted(raw.add(a, b), -1)
        short = raw.rounded(exact, 53, raw.NEAREST)
        inside = raw.is_less(a, short) and raw.is_less(short, b)
        return self.point(short if inside else exact)

    def intersection(self, x: Interval, y: Interval) -> Interval:
        """Return the common part of two intervals that meet."""
        a, b = raw.ends(x)
        c, d = raw.ends(y)
        lo = a if raw.is_greater(a, c) else c
        hi = b if raw.is_less(b, d) else d
        if raw.is_greater(lo, hi):
            raise Undecidable("disjoint enclosures of one number")
        return self.context.make_mpf((lo, hi))

    def inflated(self, x: Interval) -> Interval:
        """Return a wider interval, which another arithmetic can prove to contain this one."""
        margin = self.upper(x.delta) * self.power_of_two(-6)
        return self.hull(self.lower(x - margin), self.upper(x + margin))

    def square(self, x: Interval) -> Interval:
        """Return x^2, never below 0."""
        return self.context.make_mpf(raw.interval_square(raw.ends(x), self.prec))

    def cos_sin(self, x: Interval) -> tuple[Interval, Interval]:
        """Return cos x and sin x; wide arguments give [-1, 1]."""
        a, b = raw.ends(x)
        if raw.is_greater(raw.subtract(b, a, 30, raw.DOWN), raw.from_int(3)):
            whole = self.context.mpf([-1, 1])
            return whole, whole
        cos, sin = self.context.cos_sin(x)
        return cos, sin

    def turning(
        self, omega: float | None, period: float | None, instant: Fraction
    ) -> tuple[Interval, Interval]:
        """Enclose the angular frequency, and the phase omega t at an instant, less whole turns.

        Args:
            omega: angular frequency, or None where the period is given [1/time].
            period: the period, or None [time].
            instant: t, exactly [time].
        """
        if period is not None:
            turn = 2 * self._pi(self.prec)
            part = instant / Fraction(period) % 1
            return turn / self.number(period), self.number(part) * turn
        assert omega is not None
        angle = Fraction(omega) * instant
        if abs(angle) < 8:
            return self.number(omega), self.dyadic(angle)
        pi = self._pi(self.prec + abs(angle.numerator // angle.denominator).bit_length() + 8)
        half_turns = exact_ends(pi)
        n = angle // (2 * half_turns[0])  # whole turns: any number of them may be subtracted
        ends = [angle - 2 * n * half_turn for half_turn in half_turns]
        return self.number(omega), self.between(min(ends), max(ends))

    def _pi(self, bits: int) -> Interval:
        with CONSTANTS:
            return self.context.make_mpf((raw.pi(bits, raw.DOWN), raw.pi(bits, raw.UP)))

    def enclosure(self, x: Interval) -> Enclosure:
        """Return the ends as exact numbers, free of this context."""
        return Enclosure(*map(exact_number, raw.ends(x)))


def sign(x: Interval) -> int:
    """Return +1 or -1 when all of x has that sign, 0 when that is not so."""
    lo, hi = raw.ends(x)
    if raw.sign(lo) > 0:
        return 1
    return -1 if raw.sign(hi) < 0 else 0


def is_below(x: Interval, y: Interval) -> bool:
    """Tell whether every number of x is smaller than every number of y."""
    return bool(raw.is_less(raw.ends(x)[1], raw.ends(y)[0]))


def is_at_most_zero(x: Interval) -> bool:
    """Tell whether no number of x is positive."""
    return bool(raw.sign(raw.ends(x)[1]) <= 0)
