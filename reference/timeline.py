"""The laws of a scene as functions of the time since an exact instant.

An instant is an exact rational, and only the time since it is enclosed. Exact comparisons decide
which analytic pieces of a law an enclosed time may touch. All of them are evaluated and united.
Laws are continuously differentiable across their knots, so the union encloses f and f' at every
time, and f'' at every time except knots.

Each wave of a Fourier law is enclosed tightly over an interval of time, but their sum is not,
because waves may cancel. Near a flat minimum they nearly do. Taylor's theorem is sharper there.
About a point m inside an interval I

    L(I) lies in  sum over j < ORDER of L_j(m) (I - m)^j / j!  +  [-M, M] (I - m)^ORDER / ORDER!,

where L_j is the derivative of order j, and M = sum (k w)^ORDER (|a_k| + |b_k|) bounds that of order
ORDER at all times. The derivatives at m are sums over waves too, but of numbers and not of
intervals.
"""

from __future__ import annotations

from fractions import Fraction
from functools import cached_property
from itertools import pairwise
from typing import Any

from reference.arithmetic import Arithmetic, Interval, exact_ends, is_below, sign
from reference.jets import Jet, united
from reference.prepared import PreparedTable
from scene import BangBang, Fourier, Law
from scene.mpmath_internals import ends
from scene.pieces import PolynomialPiece

ORDER = 8
# In evaluations of a parabola, as measured: a wave; an expansion, and a wave of it.
WORK_OF_A_WAVE = 1.5
WORK_OF_AN_EXPANSION = 4
WORK_OF_AN_EXPANDED_WAVE = 2


class Timeline:
    """The laws of a scene since an exact instant.

    Args:
        arithmetic: working precision.
        table: the scene, prepared.
        instant: the absolute time from which times are counted [time].
    """

    def __init__(self, arithmetic: Arithmetic, table: PreparedTable, instant: Fraction) -> None:
        self.laws = {
            name: law_in_time(arithmetic, law, instant) for name, law in table.laws.items()
        }
        length = None if table.cycle is None else table.cycle.value(arithmetic.context)
        self.turn = None if length is None else arithmetic.upper(length)  # a period at least
        self._arithmetic = arithmetic
        # Particles at rest at several places ask for the same parts of a period.
        self._known: dict[tuple[str, Any], Jet] = {}

    def jet(self, name: str, s: Interval) -> Jet:
        """Enclose a law and its derivatives at every time within s."""
        key = name, ends(s)
        if key in self._known:
            self._arithmetic.spend(1)
        else:
            self._known[key] = self.laws[name].jet(s)
        return self._known[key]

    def knot_between(self, low: Fraction, high: Fraction) -> Fraction | None:
        """Return the knot nearest to the middle of an interval, None when no law has one inside."""
        found = [knot for law in self.laws.values() for knot in law.knots(low, high)]
        return min(found, key=lambda knot: abs(2 * knot - low - high), default=None)

    def is_whole(self, length: Fraction) -> bool:
        """Tell whether every law takes its whole range within this length of time, as evaluated."""
        return all(law.is_whole(length) for law in self.laws.values())


def law_in_time(arithmetic: Arithmetic, law: Law, instant: Fraction) -> LawInTime:
    """Return a law as a function of the time since an instant."""
    if law.is_constant:
        return Level(arithmetic, law.level)
    match law:
        case Fourier():
            return Waves(arithmetic, law, instant)
        case BangBang():
            return Legs(arithmetic, law, instant)
    raise TypeError(f"{type(law).__name__}: the reference does not enclose this kind of law")


class Level:
    """A law that never changes."""

    def __init__(self, arithmetic: Arithmetic, value: float) -> None:
        self.value = Jet(arithmetic.number(value), arithmetic.zero, arithmetic.zero)

    def jet(self, s: Interval) -> Jet:
        """Return the constant."""
        return self.value

    def knots(self, low: Fraction, high: Fraction) -> list[Fraction]:
        """Return none."""
        return []

    def is_whole(self, length: Fraction) -> bool:
        """Return True: its range is its value."""
        return True


class Legs:
    """A bang-bang law: parabolas that join smoothly."""

    def __init__(self, arithmetic: Arithmetic, law: BangBang, instant: Fraction) -> None:
        self.arithmetic = arithmetic
        self.law = law
        self.instant = instant
        self.period = law.length

    def jet(self, s: Interval) -> Jet:
        """Unite the parabolas that times within s may lie on."""
        low, high = (self.instant + end for end in exact_ends(s))
        if high - low >= self.period:
            return self._whole()
        parts = []
        while True:
            piece = self.law.leg_at(low)
            stop = min(piece.end, high)
            part = self.arithmetic.between(low - self.instant, stop - self.instant)
            parts.append(self._on(piece, part))
            if stop == high:
                return united(self.arithmetic, parts)
            low = stop

    def _on(self, piece: PolynomialPiece, s: Interval) -> Jet:
        """Evaluate one parabola at times since the instant."""
        self.arithmetic.spend(1)
        number = self.arithmetic.number
        at_rest, _, half_bend = piece.coefficients
        u = number(self.instant - piece.origin) + s
        bend = number(2 * half_bend)
        return Jet(number(at_rest) + bend * self.arithmetic.square(u) / 2, bend * u, bend)

    def _whole(self) -> Jet:
        """Enclose the law over all of its period."""
        arithmetic = self.arithmetic
        arithmetic.spend(1)
        lengths = [end - start for start, end in pairwise(self.law.breakpoints())]
        bends = [abs(2 * leg.coefficients[2]) for leg in self.law.half_legs]
        speed = max(bend * length for bend, length in zip(bends, lengths, strict=True))
        bend = max(bends)
        both = arithmetic.context.mpf([-1, 1])
        whole = arithmetic.union(
            [arithmetic.number(leg.coefficients[0]) for leg in self.law.half_legs]
        )
        return Jet(whole, arithmetic.number(speed) * both, arithmetic.number(bend) * both)

    def knots(self, low: Fraction, high: Fraction) -> list[Fraction]:
        """List the ends of parabolas strictly between two times, within a period."""
        found: list[Fraction] = []
        if high - low >= self.period:
            return found
        end = self.law.leg_at(self.instant + low).end
        while end < self.instant + high:
            found.append(end - self.instant)
            end = self.law.leg_at(end).end
        return found

    def is_whole(self, length: Fraction) -> bool:
        """Tell whether the length is a period or more."""
        return length >= self.period


class Waves:
    """A Fourier law.

    The phase at the instant is reduced once, so that no digit of it is lost later.
    """

    def __init__(self, arithmetic: Arithmetic, law: Fourier, instant: Fraction) -> None:
        self.arithmetic = arithmetic
        self.mean = arithmetic.number(law.mean)
        self.omega, self.phase = arithmetic.turning(law.omega, law.period, instant)
        number = arithmetic.number
        self.terms = []
        for k, a, b in law.harmonics():
            frequency = number(k) * self.omega
            amplitudes = number(a) if a else None, number(b) if b else None
            self.terms.append((number(k), frequency, *amplitudes))

    @cached_property
    def bound(self) -> Interval:
        """[-M, M]: derivatives of order ORDER at all times. One wave alone has no use for it."""
        both = self.arithmetic.context.mpf([-1, 1])
        total = self.arithmetic.zero
        for _, frequency, *amplitudes in self.terms:
            largest = sum((both * a for a in amplitudes if a is not None), self.arithmetic.zero)
            for _ in range(ORDER):
                largest = frequency * largest
            total += largest
        return total

    def jet(self, s: Interval) -> Jet:
        """Enclose the law and its derivatives."""
        if len(self.terms) == 1 or sign(s.delta) == 0:
            return self._summed(s)
        is_short = is_below(s.delta * self.terms[-1][1], self.arithmetic.number(1))
        return self._expanded(s) if is_short else self._summed(s)

    def _summed(self, s: Interval) -> Jet:
        """Sum the harmonics and their derivatives."""
        self.arithmetic.spend(WORK_OF_A_WAVE * len(self.terms))
        f = self.mean
        d1 = self.arithmetic.zero
        d2 = self.arithmetic.zero
        for frequency, wave, quadrature in self._waves(s):
            f = f + wave
            d1 = d1 + frequency * quadrature
            d2 = d2 - self.arithmetic.square(frequency) * wave
        return Jet(f, d1, d2)

    def _expanded(self, s: Interval) -> Jet:
        """Expand the law and its derivatives about a point inside."""
        self.arithmetic.spend(WORK_OF_AN_EXPANSION + WORK_OF_AN_EXPANDED_WAVE * len(self.terms))
        middle = self.arithmetic.middle(s)
        derivatives = [self.mean] + [self.arithmetic.zero] * (ORDER - 1)
        for frequency, wave, quadrature in self._waves(middle):
            for j in range(ORDER):
                derivatives[j] += wave
                wave, quadrature = frequency * quadrature, -(frequency * wave)
        derivatives.append(self.bound)
        powers = self._powers(s - middle)

        def series(order: int) -> Interval:
            products = (
                d * power for d, power in zip(derivatives[order + 1 :], powers, strict=False)
            )
            return sum(products, derivatives[order])

        return Jet(series(0), series(1), series(2))

    def _waves(self, s: Interval) -> list[tuple[Interval, Interval, Interval]]:
        """Return frequency, value, and rate / frequency of each wave k."""
        found = []
        phase = self.phase + self.omega * s
        zero = self.arithmetic.zero
        for k, frequency, a, b in self.terms:
            cos, sin = self.arithmetic.cos_sin(k * phase)
            wave, quadrature = zero, zero
            if a is not None:
                wave, quadrature = a * cos, -(a * sin)
            if b is not None:
                wave, quadrature = wave + b * sin, quadrature + b * cos
            found.append((frequency, wave, quadrature))
        return found

    def _powers(self, away: Interval) -> list[Interval]:
        """Return u^j / j! for j from 1 to ORDER, and u in an interval.

        Even powers are never below 0.
        """
        half_square = self.arithmetic.square(away) / 2
        powers = [away, half_square]
        for j in range(3, ORDER + 1):
            powers.append(powers[-2] * half_square * 2 / (j * (j - 1)))
        return powers

    def knots(self, low: Fraction, high: Fraction) -> list[Fraction]:
        """Return none: the law is analytic."""
        return []

    def is_whole(self, length: Fraction) -> bool:
        """Tell whether the length is a period or more: of its phase 7 are required, to be safe."""
        return exact_ends(self.omega)[0] * length >= 7


LawInTime = Level | Legs | Waves  # a law as a function of the time since an instant
