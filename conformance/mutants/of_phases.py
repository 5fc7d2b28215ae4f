"""Mutants that lose the phase of a law: whole periods, knots that begin elsewhere, harmonics, short numbers.

Part of `conformance.mutants`, which lists them; a docstring is the fault. A class of motion stands for the
flight that is plain but for its laws of that kind.
"""

# ruff: noqa: D102 (a class says what its one method does wrong)

from __future__ import annotations

from math import floor, fmod, pi, tan

from mpmath import fp
from msgspec.structs import replace

from conformance.mutants.of_laws import single
from conformance.plain.motion import BangBangMotion, ConstantMotion, FourierMotion, LawMotion, LawValue
from conformance.plain.step import Flight
from scene import BangBang, Fourier, Law, Scene, State
from scene.laws import frequency
from scene.tables import cycle_length


class PeriodsInInt32(BangBangMotion):
    """Counts whole periods in 32 bits, which overflow."""

    def __init__(self, law: BangBang, t: float) -> None:
        first, last = law.knots[0][0], law.knots[-1][0]
        turns = floor((t - first) / (last - first))
        kept = (turns + 2**31) % 2**32 - 2**31
        super().__init__(law, t - kept * (last - first) if kept == turns else last)


class PeriodsTowardsZero(BangBangMotion):
    """Cuts off whole periods towards 0: before the first knot the first leg is taken to have been on."""

    def __init__(self, law: BangBang, t: float) -> None:
        super().__init__(law, t)
        first = law.knots[0][0]
        if (since := fmod(t - first, self.period)) < 0:
            half = self.halves(*law.knots[0], *law.knots[1])[0]
            self.value, self.rate = half.value + half.pull * since * since / 2, half.pull * since
            self.pieces = [(-since + half.end - half.begin, half.pull), *BangBangMotion(law, half.end).pieces]


class KnotsFromZero(BangBangMotion):
    """Takes the first knot to be at time 0."""

    def __init__(self, law: BangBang, t: float) -> None:
        super().__init__(law, t + law.knots[0][0])


class KnotsWithoutTheirOrigin(BangBangMotion):
    """Reduces the time by whole periods from 0, though the knots begin elsewhere."""

    def __init__(self, law: BangBang, t: float) -> None:
        super().__init__(law, t)
        first = law.knots[0][0]
        within = t - floor(t / self.period) * self.period
        if not first <= within < first + self.period:
            self.value, self.rate, self.pieces = law.knots[0][1], 0.0, [(self.period, 0.0)]


class LastLegForgotten(BangBangMotion):
    """Stands still between the last two knots."""

    def __init__(self, law: BangBang, t: float) -> None:
        *kept, (time, _), last = law.knots
        super().__init__(BangBang(knots=(*kept, (time, last[1]), last)) if len(kept) > 1 else law, t)


class KnotsEvenlySpaced(BangBangMotion):
    """Takes the legs to be of equal length."""

    def __init__(self, law: BangBang, t: float) -> None:
        first, n = law.knots[0][0], len(law.knots) - 1
        length = law.knots[-1][0] - first
        times = [first + length * i / n for i in range(n)] + [law.knots[-1][0]]
        super().__init__(
            BangBang(knots=tuple((time, v) for time, (_, v) in zip(times, law.knots, strict=True))), t
        )


class TimeWithinPeriodInFloat32(BangBangMotion):
    """Keeps the time since the first knot, within a period, in binary32."""

    def __init__(self, law: BangBang, t: float) -> None:
        first, last = law.knots[0][0], law.knots[-1][0]
        super().__init__(
            law, first + single(t - first - floor((t - first) / (last - first)) * (last - first))
        )


class ThreeHarmonicsAtMost(FourierMotion):
    """Keeps three harmonics of a Fourier law."""

    def __init__(self, law: Fourier, t: float) -> None:
        super().__init__(replace(law, cos=law.cos[:3], sin=law.sin[:3]), t)


class CosinesOnly(FourierMotion):
    """Leaves the sines out of a Fourier law."""

    def __init__(self, law: Fourier, t: float) -> None:
        super().__init__(replace(law, sin=()), t)


class AmplitudesForWidths(FourierMotion):
    """Takes an amplitude for the distance from crest to trough."""

    def __init__(self, law: Fourier, t: float) -> None:
        halved = (tuple(a / 2 for a in amplitudes) for amplitudes in (law.cos, law.sin))
        super().__init__(replace(law, **dict(zip(("cos", "sin"), halved, strict=True))), t)


class HarmonicsFromZero(FourierMotion):
    """Takes the first amplitude for the constant term, and every other one for the harmonic before."""

    def __init__(self, law: Fourier, t: float) -> None:
        super().__init__(replace(law, cos=law.cos[1:], sin=law.sin[1:]), t)
        self.value += law.cos[0] if law.cos else 0.0


class PhaseInFloat32(FourierMotion):
    """Works out the phase omega t in binary32."""

    def __init__(self, law: Fourier, t: float) -> None:
        omega = frequency(fp, law)
        super().__init__(law, single(omega * t) / omega)


class FrequencyInFloat32(FourierMotion):
    """Keeps the angular frequency in binary32."""

    def __init__(self, law: Fourier, t: float) -> None:
        super().__init__(replace(law, omega=single(frequency(fp, law)), period=None), t)


class PeriodForFrequency(FourierMotion):
    """Takes a period for an angular frequency."""

    def __init__(self, law: Fourier, t: float) -> None:
        super().__init__(law if law.period is None else replace(law, omega=law.period, period=None), t)


class PeriodWithoutTwoPi(FourierMotion):
    """Takes 1 / period for an angular frequency."""

    def __init__(self, law: Fourier, t: float) -> None:
        super().__init__(law if law.period is None else replace(law, omega=1 / law.period, period=None), t)


class PhaseInDegrees(FourierMotion):
    """Takes the phase at departure in degrees for radians."""

    def __init__(self, law: Fourier, t: float) -> None:
        super().__init__(law, t * pi / 180)


class WavesToSecondOrder(FourierMotion):
    """Carries a Fourier law on by its rate and acceleration at departure."""

    def at(self, s: float) -> LawValue:
        rate = sum(f * b for f, _, b in self.waves)
        pull = sum(-f * f * a for f, a, _ in self.waves)
        return LawValue(self.value, (rate + pull * s / 2) * s, rate + pull * s)


class FirstPeriodOnly(Flight):
    """Lets every law stand still after one period of flight."""

    def law(self, law: Law) -> LawMotion:
        found: LawMotion = super().law(law)
        if isinstance(law, Fourier):
            return _Stopped(found, 2 * pi / frequency(fp, law))
        return _Stopped(found, found.period) if isinstance(found, BangBangMotion) else found


class _Stopped(ConstantMotion):
    def __init__(self, law: LawMotion, span: float) -> None:
        super().__init__(law.value, 0.0)
        self.law, self.span = law, span

    def at(self, s: float) -> LawValue:
        found = self.law.at(min(s, self.span))
        return found if s < self.span else found._replace(rate=0.0)


class GivesUpAfterTenPeriods(Flight):
    """Looks for a hit within ten periods of the laws only."""

    def __init__(self, scene: Scene, state: State, t_end: float) -> None:
        super().__init__(scene, state, t_end)
        if length := cycle_length(scene):
            self.end, self.is_horizon = min(self.end, 10 * length), True


class SlopeForTheAngle(Flight):
    """Takes the slope of the sides for the angle: works with its tangent."""

    def __init__(self, scene: Scene, state: State, t_end: float) -> None:
        super().__init__(scene, state, t_end)
        if "slope" in self.laws:
            self.laws["slope"] = _Tangent(self.laws["slope"])


class _Tangent(ConstantMotion):
    def __init__(self, law: LawMotion) -> None:
        super().__init__(tan(law.value), 0.0)
        self.law = law

    def at(self, s: float) -> LawValue:
        found = self.law.at(s)
        now = tan(found.now)
        return LawValue(self.value, now - self.value, found.rate * (1 + now * now))
