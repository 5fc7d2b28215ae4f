"""Mutants that follow a law of motion wrongly: phase, harmonics, legs, periods, precision of time.

Part of `conformance.mutants`, which lists them; a docstring is the fault. A class of motion stands for the
flight that is plain but for its laws of that kind.
"""

# ruff: noqa: D102 (a class says what its one method does wrong)

from __future__ import annotations

import struct
from itertools import pairwise
from math import cos, fmod, sin

from mpmath import fp
from msgspec.structs import replace

from conformance.plain.motion import (
    BangBangMotion,
    ConstantMotion,
    FourierMotion,
    Half,
    LawMotion,
    LawValue,
    turned,
)
from conformance.plain.step import Flight
from scene import BangBang, Fourier, Law, Outcome, Rejected, Scene, State
from scene.laws import bounds, frequency
from scene.tables import laws


def single(x: float) -> float:
    """Round to binary32, as one who declares a float does."""
    return float(struct.unpack("f", struct.pack("f", max(-3e38, min(x, 3e38))))[0])


class LegsAtConstantSpeed(BangBangMotion):
    """Joins the knots of a bang-bang law by straight lines."""

    def __init__(self, law: BangBang, t: float) -> None:
        super().__init__(law, t)
        first = law.knots[0][0]
        t = first + fmod(fmod(t - first, self.period) + self.period, self.period)
        legs = [(b - a, (v - u) / (b - a)) for (a, u), (b, v) in pairwise(law.knots)]
        now = max(i for i, (a, _) in enumerate(law.knots[:-1]) if a <= t or i == 0)
        a, u = law.knots[now]
        self.value = u + legs[now][1] * (t - a)
        self.legs = [(a + legs[now][0] - t, legs[now][1]), *legs[now + 1 :], *legs[: now + 1]]

    def at(self, s: float) -> LawValue:
        rise, rate, left = 0.0, 0.0, fmod(s, self.period)
        for duration, rate in self.legs:
            step = min(duration, left)
            rise, left = rise + rate * step, left - step
            if left <= 0:
                break
        return LawValue(self.value, rise, rate)


class HalfLegAccelerationSign(BangBangMotion):
    """Accelerates through the second half of a leg instead of braking."""

    def halves(self, a: float, u: float, b: float, v: float) -> tuple[Half, Half]:
        middle, pull = (a + b) / 2, 4 * (v - u) / (b - a) / (b - a)
        return Half(a, middle, a, u, pull), Half(middle, b, b, v, pull)


class PhaseOffByOneKnot(BangBangMotion):
    """Takes each knot's value from the knot after it."""

    def __init__(self, law: BangBang, t: float) -> None:
        times, values = zip(*law.knots, strict=True)
        super().__init__(BangBang(knots=tuple(zip(times, [*values[1:], values[1]], strict=True))), t)


class PeriodWrapLost(BangBangMotion):
    """Lets a bang-bang law stand still outside its first period."""

    def __init__(self, law: BangBang, t: float) -> None:
        super().__init__(law, t)
        self.left = max(law.knots[-1][0] - t, 0.0)
        if t < law.knots[0][0] or not self.left:
            self.value, self.pieces = law.knots[-1][1], [(self.period, 0.0)]
            self.rate = 0.0

    def at(self, s: float) -> LawValue:
        return super().at(min(s, self.left))


class HalfTheAcceleration(BangBangMotion):
    """Forgets that half a leg is covered in half its time: accelerates by 2 d / T^2, not 4 d / T^2."""

    def halves(self, a: float, u: float, b: float, v: float) -> tuple[Half, Half]:
        one, two = super().halves(a, u, b, v)
        return one._replace(pull=one.pull / 2), two._replace(pull=two.pull / 2)


class RateByDifferences(FourierMotion):
    """Takes the rate of a Fourier law from a difference over a fixed time of 1e-6."""

    def at(self, s: float) -> LawValue:
        now, then = super().at(s), super().at(s + 1e-6)
        return now._replace(rate=(then.rise - now.rise) / 1e-6)


class RateWithoutHarmonicNumber(FourierMotion):
    """Differentiates cos(k omega t) to -omega sin(k omega t)."""

    def __init__(self, law: Fourier, t: float) -> None:
        super().__init__(law, t)
        self.omega = frequency(fp, law)

    def at(self, s: float) -> LawValue:
        rate = sum(self.omega * (b * cos(f * s) - a * sin(f * s)) for f, a, b in self.waves)
        return super().at(s)._replace(rate=rate)


class HarmonicsIgnored(FourierMotion):
    """Keeps the first harmonic of a Fourier law only."""

    def __init__(self, law: Fourier, t: float) -> None:
        super().__init__(replace(law, cos=law.cos[:1], sin=law.sin[:1]), t)


class SineAndCosineSwapped(FourierMotion):
    """Takes the cosine amplitudes for the sine's."""

    def __init__(self, law: Fourier, t: float) -> None:
        super().__init__(replace(law, cos=law.sin, sin=law.cos), t)


class PhaseSign(FourierMotion):
    """Runs the phase of a Fourier law backwards: sines change sign."""

    def __init__(self, law: Fourier, t: float) -> None:
        super().__init__(replace(law, sin=tuple(-b for b in law.sin)), t)


class OmegaAsFrequency(FourierMotion):
    """Takes omega for cycles per unit of time: too fast by 2 pi."""

    def __init__(self, law: Fourier, t: float) -> None:
        super().__init__(replace(law, omega=6.283185307179586 * frequency(fp, law), period=None), t)


class PiTooShort(FourierMotion):
    """Reduces the phase of a Fourier law by 2 x 3.14159."""

    def __init__(self, law: Fourier, t: float) -> None:
        period = 2 * 3.14159 / frequency(fp, law)
        super().__init__(law, fmod(t, period))


class PhaseRestartsAtEachStep(FourierMotion):
    """Follows a Fourier law from t = 0 whatever the time of departure."""

    def __init__(self, law: Fourier, t: float) -> None:
        super().__init__(law, t)
        omega = frequency(fp, law)
        self.waves = [turned(k * omega, a, b, 0.0) for k, a, b in law.harmonics()]
        self.value = law.mean + sum(a for _, a, _ in self.waves)


class TimeInFloat32(Flight):
    """Keeps the time of departure in binary32."""

    def law(self, law: Law) -> LawMotion:
        found: LawMotion = self.kinds[type(law)](law, single(self.state.t))
        return found


class PlaceInFloat32(Flight):
    """Keeps x and y in binary32."""

    def __init__(self, scene: Scene, state: State, t_end: float) -> None:
        at = State(state.t, single(state.x), single(state.y), state.vx, state.vy, state.wall)
        super().__init__(scene, at, t_end)


class SlopeConstantThoughALaw(Flight):
    """Takes the slope at t = 0 for all times."""

    def __init__(self, scene: Scene, state: State, t_end: float) -> None:
        super().__init__(scene, state, t_end)
        if "slope" in self.laws:
            law = getattr(scene, "slope")  # noqa: B009 (a cap has none)
            self.laws["slope"] = ConstantMotion(self.kinds[type(law)](law, 0.0).value, 0.0)


class SizesJudgedByTheirAmplitudes(Flight):
    """Refuses a scene in which a size's amplitudes add up to its mean or more, though it stays positive."""

    def refusal(self) -> Outcome | None:
        for name, law in laws(self.scene).items():
            if name != "slope" and not bounds(law).lowest > 0:
                return Rejected(f"scene.{name} is negative at times")
        return super().refusal()
