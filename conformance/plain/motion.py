"""Laws of motion as the plain stepper sees them: from the time of departure on.

Each law gives its value at departure, its rise since, computed without cancellation however short the
time, and its rate. So no wall is ever evaluated in absolute time.
"""

from __future__ import annotations

from bisect import bisect_right
from functools import cached_property
from itertools import pairwise
from math import cos, floor, fmod, inf, sin
from typing import NamedTuple

from mpmath import fp

from scene import BangBang, Fourier
from scene.laws import frequency


class LawValue(NamedTuple):
    """A law seen from departure: its value then, its rise since, its rate now."""

    value: float
    rise: float
    rate: float

    @property
    def now(self) -> float:
        """The value now."""
        return self.value + self.rise


class ConstantMotion:
    """A law that is a number."""

    def __init__(self, law: float, t: float) -> None:
        self.value = law

    def at(self, s: float) -> LawValue:
        """Return the motion at the time s since departure."""
        return LawValue(self.value, 0.0, 0.0)


class FourierMotion:
    """A Fourier law from time t on: its waves a cos(f s) + b sin(f s) turned to begin there."""

    def __init__(self, law: Fourier, t: float) -> None:
        omega = frequency(fp, law)
        self.waves = [turned(k * omega, a, b, t) for k, a, b in law.harmonics()]
        self.value = law.mean + sum(a for _, a, _ in self.waves)

    def at(self, s: float) -> LawValue:
        """Return the motion at the time s since departure; cos(f s) - 1 is -2 sin(f s / 2)^2."""
        rise = sum(b * sin(f * s) - 2 * a * sin(f * s / 2) ** 2 for f, a, b in self.waves)
        rate = sum(f * (b * cos(f * s) - a * sin(f * s)) for f, a, b in self.waves)
        return LawValue(self.value, rise, rate)


def turned(f: float, a: float, b: float, t: float) -> tuple[float, float, float]:
    """Return frequency and amplitudes of a cos(f (t + s)) + b sin(f (t + s)) as a wave in s."""
    c, s = cos(f * t), sin(f * t)
    return f, a * c + b * s, b * c - a * s


class Half(NamedTuple):
    """Half a leg: it rests at its knot, an end of it, and accelerates by `pull`."""

    begin: float
    end: float
    knot: float
    value: float
    pull: float


class BangBangMotion:
    """A bang-bang law from time t on: one period of pieces of constant acceleration."""

    def __init__(self, law: BangBang, t: float) -> None:
        first, last = law.knots[0][0], law.knots[-1][0]
        self.period = last - first
        t -= floor((t - first) / self.period) * self.period
        halves = [half for (a, u), (b, v) in pairwise(law.knots) for half in self.halves(a, u, b, v)]
        now = max((i for i, half in enumerate(halves) if half.begin <= t), default=0)
        half, others = halves[now], halves[now + 1 :] + halves[:now]
        since = t - half.knot
        self.value, self.rate = half.value + half.pull * since * since / 2, half.pull * since
        ends = (half.end - t, half.pull), (t - half.begin, half.pull)
        self.pieces = [ends[0], *((other.end - other.begin, other.pull) for other in others), ends[1]]

    @cached_property
    def begins(self) -> list[tuple[float, float, float, float]]:
        """What each piece begins with, carried on from the one before: time, rise, rate, pull."""
        begin, rise, rate = 0.0, 0.0, self.rate
        found = []
        for duration, pull in self.pieces:
            found.append((begin, rise, rate, pull))
            begin += duration
            rise += (rate + pull * duration / 2) * duration
            rate += pull * duration
        return found

    def at(self, s: float) -> LawValue:
        """Return the motion at the time s since departure."""
        left = fmod(s, self.period)
        begin, rise, rate, pull = self.begins[bisect_right(self.begins, (left, inf)) - 1]
        step = left - begin
        return LawValue(self.value, rise + (rate + pull * step / 2) * step, rate + pull * step)

    def halves(self, a: float, u: float, b: float, v: float) -> tuple[Half, Half]:
        """Cut the leg from value u at knot a to value v at knot b in two."""
        middle, pull = (a + b) / 2, 4 * (v - u) / (b - a) / (b - a)
        return Half(a, middle, a, u, pull), Half(middle, b, b, v, -pull)


LawMotion = ConstantMotion | FourierMotion | BangBangMotion
