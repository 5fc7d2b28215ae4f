"""The laws of a scene as functions of the time since an exact instant.

An instant is an exact rational, and only the time since it is enclosed. Exact comparisons decide which
analytic pieces of a law an enclosed time may touch. All of them are evaluated and united. Laws are
continuously differentiable across their knots, so the union encloses f and f' at every time, and f''
at every time except knots.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from fractions import Fraction
from functools import lru_cache
from typing import Any, NamedTuple, Protocol

from reference.arithmetic import Arithmetic, Interval, exact_ends
from reference.jets import Jet, united
from reference.waves import Waves
from scene import BangBang, Fourier, Law, Scene
from scene.laws import is_constant
from scene.tables import laws, period


class LawInTime(Protocol):
    """A law as a function of the time since an instant."""

    def jet(self, s: Interval) -> Jet:
        """Enclose the law and its derivatives at every time within s."""

    def knots(self, low: Fraction, high: Fraction) -> list[Fraction]:
        """List the times strictly between at which the law changes its piece."""

    def is_whole(self, length: Fraction) -> bool:
        """Tell whether a law takes all its values within any time of this length, as evaluated."""


class Timeline:
    """The laws of a scene since an exact instant.

    Args:
        arithmetic: working precision.
        scene: table and laws.
        instant: the absolute time from which times are counted [time].
    """

    def __init__(self, arithmetic: Arithmetic, scene: Scene, instant: Fraction) -> None:
        self.laws = {name: law_in_time(arithmetic, law, instant) for name, law in laws(scene).items()}
        shared = period(scene)
        length = None if shared is None else arithmetic.period(shared.omega, shared.length)
        self.turn = None if length is None else arithmetic.upper(length)  # a period at least
        self._arithmetic = arithmetic
        # Particles at rest at several places ask for the same parts of a period.
        self._known: dict[tuple[str, Any], Jet] = {}

    def jet(self, name: str, s: Interval) -> Jet:
        """Enclose a law and its derivatives at every time within s."""
        key = name, s._mpi_
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
    if isinstance(law, Fourier):
        return Constant(arithmetic, law.mean) if is_constant(law) else Waves(arithmetic, law, instant)
    if isinstance(law, BangBang):
        return Constant(arithmetic, law.knots[0][1]) if is_constant(law) else Legs(arithmetic, law, instant)
    return Constant(arithmetic, law)


class Constant:
    """A law that never changes."""

    def __init__(self, arithmetic: Arithmetic, value: float) -> None:
        self.value = Jet(arithmetic.number(value), None, None)

    def jet(self, s: Interval) -> Jet:
        """Return the constant."""
        return self.value

    def knots(self, low: Fraction, high: Fraction) -> list[Fraction]:
        """Return none."""
        return []

    def is_whole(self, length: Fraction) -> bool:
        """Return True: its range is its value."""
        return True


class HalfLeg(NamedTuple):
    """Half a leg of a bang-bang law: value + bend u^2 / 2, u the time from its knot `origin`."""

    start: Fraction
    end: Fraction
    origin: Fraction
    value: Fraction
    bend: Fraction


@lru_cache(maxsize=256)
def half_legs(law: BangBang) -> tuple[HalfLeg, ...]:
    """Cut a bang-bang law into its parabolas, in the period that begins at its first knot."""
    found = []
    for (t0, v0), (t1, v1) in zip(law.knots, law.knots[1:], strict=False):
        start, end, before, after = (Fraction(number) for number in (t0, t1, v0, v1))
        middle, length = (start + end) / 2, end - start
        bend = 4 * (after - before) / (length * length)
        found += [HalfLeg(start, middle, start, before, bend), HalfLeg(middle, end, end, after, -bend)]
    return tuple(found)


class Legs:
    """A bang-bang law: parabolas that join smoothly."""

    def __init__(self, arithmetic: Arithmetic, law: BangBang, instant: Fraction) -> None:
        self.arithmetic = arithmetic
        self.halves = half_legs(law)
        self.starts = [half.start for half in self.halves]
        self.period = self.halves[-1].end - self.halves[0].start
        self.instant = instant
        number = arithmetic.number
        self.values = [number(half.value) for half in self.halves]
        self.bends = [number(half.bend) for half in self.halves]

    def jet(self, s: Interval) -> Jet:
        """Unite the parabolas that times within s may lie on."""
        low, high = (self.instant + end for end in exact_ends(s))
        if high - low >= self.period:
            return self._whole()
        turn = (low - self.starts[0]) // self.period * self.period
        i = bisect_right(self.starts, low - turn) - 1
        if self.halves[i].end + turn >= high:
            return self._on(i, turn, s)
        parts = []
        while True:
            start, end = self.halves[i].start + turn, self.halves[i].end + turn
            part = max(start, low) - self.instant, min(end, high) - self.instant
            parts.append(self._on(i, turn, self.arithmetic.between(*part)))
            if end >= high:
                return united(self.arithmetic, parts)
            i += 1
            if i == len(self.halves):
                i, turn = 0, turn + self.period

    def _on(self, i: int, turn: Fraction, s: Interval) -> Jet:
        """Evaluate one parabola at times since the instant."""
        self.arithmetic.spend(1)
        u = self.arithmetic.number(self.instant - self.halves[i].origin - turn) + s
        bend = self.bends[i]
        return Jet(self.values[i] + bend * self.arithmetic.square(u) / 2, bend * u, bend)

    def _whole(self) -> Jet:
        """Enclose the law over all of its period."""
        arithmetic, halves = self.arithmetic, self.halves
        arithmetic.spend(1)
        speed = max(abs(half.bend) * (half.end - half.start) for half in halves)
        bend = max(abs(half.bend) for half in halves)
        both = arithmetic.context.mpf([-1, 1])
        whole = arithmetic.union(self.values)
        return Jet(whole, arithmetic.number(speed) * both, arithmetic.number(bend) * both)

    def knots(self, low: Fraction, high: Fraction) -> list[Fraction]:
        """List the ends of parabolas strictly between two times since the instant, within a period."""
        if high - low >= self.period:
            return []
        begun = low - (self.instant + low - self.starts[0]) % self.period - self.starts[0]
        i = bisect_right(self.starts, low - begun) - 1
        following = [half.end for half in self.halves[i:]] + [
            half.end + self.period for half in self.halves[:i]
        ]
        return [end + begun for end in following[: bisect_left(following, high - begun)]]

    def is_whole(self, length: Fraction) -> bool:
        """Tell whether the length is a period or more."""
        return length >= self.period
