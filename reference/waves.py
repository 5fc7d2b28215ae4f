"""A Fourier law as a function of the time since an exact instant.

Each wave is enclosed tightly over an interval of time, but their sum is not, because waves may cancel. Near a
flat minimum they nearly do. Taylor's theorem is sharper there. About a point m inside an interval I

    L(I) lies in  sum over j < ORDER of L_j(m) (I - m)^j / j!  +  [-M, M] (I - m)^ORDER / ORDER!,

where L_j is the derivative of order j, and M = sum (k w)^ORDER (|a_k| + |b_k|) bounds that of order ORDER at
all times. The derivatives at m are sums over waves too, but of numbers and not of intervals.
"""

from fractions import Fraction
from functools import cached_property

from reference.arithmetic import Arithmetic, Interval, exact_ends, is_below, sign
from reference.jets import Jet
from scene import Fourier

ORDER = 8
# In evaluations of a parabola, as measured: a wave; an expansion, and a wave of it.
WORK_OF_A_WAVE, WORK_OF_AN_EXPANSION, WORK_OF_AN_EXPANDED_WAVE = 1.5, 4, 2


class Waves:
    """A Fourier law. The phase at the instant is reduced once, so that no digit of it is lost later."""

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
        f, d1, d2 = self.mean, self.arithmetic.zero, self.arithmetic.zero
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
            products = (d * power for d, power in zip(derivatives[order + 1 :], powers, strict=False))
            return sum(products, derivatives[order])

        return Jet(series(0), series(1), series(2))

    def _waves(self, s: Interval) -> list[tuple[Interval, Interval, Interval]]:
        """Return frequency, value, and rate / frequency of each wave k."""
        found, phase, zero = [], self.phase + self.omega * s, self.arithmetic.zero
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
        """Return u^j / j! for j from 1 to ORDER, and u in an interval; even powers are never below 0."""
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
