"""The first downward root of a wall function, isolated left first, and the proof of it.

The flight is covered from the left by sub-intervals, on each of which f > 0 is proved given
f >= 0 at its left end, in one of six ways:
    plain    f(I) > 0 as evaluated;
    rising   f' > 0 on it;
    falling  f' < 0 on it and f > 0 at its right end;
    concave  f'' <= 0 on it and f > 0 at its right end;
    centred  f(m) + f'(I)(I - m) > 0, m inside I;
    lifting  f'' > 0 on it, f = f' = 0 exactly at its left end, the start.
A stretch that a wall never reaches, its laws anywhere within their bounds, is marked `swept`.
A root is accepted only on an interval with f' < 0 throughout, f > 0 at its left end and f < 0
at its right one. What none of this decides is bisected, then refused (`Undecidable`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from reference.arithmetic import Arithmetic, Interval, Undecidable, is_at_most_zero, is_below, sign
from reference.jets import Jet

MAX_LEAVES = 4000
MAX_DEPTH_PER_DIGIT = 8


class Leaf(NamedTuple):
    """A sub-interval of flight time on which f > 0 is proved, and by which sign."""

    start: Interval
    end: Interval
    kind: str


class Root(NamedTuple):
    """The only root on `time`, with f' < 0 throughout it; what lies before is excluded by `leaves`."""

    time: Interval
    slope: Interval


Function = Callable[[Interval], Jet]


class Isolator:
    """Isolates roots of one wall function, with the residual of the wall being left removed.

    Args:
        arithmetic: the working precision.
        jet: f, f', f'' over an interval of flight time.
        residual: f(0) when the particle leaves this wall (the root s = 0 is divided out), else None.
        is_flat: f(0) = f'(0) = 0 exactly, so that only f'' > 0 can prove the start.
    """

    def __init__(
        self, arithmetic: Arithmetic, jet: Function, residual: Interval | None, *, is_flat: bool = False
    ) -> None:
        self.arithmetic = arithmetic
        self.jet = jet
        self.residual = residual
        self.is_flat = is_flat
        self.leaves: list[Leaf] = []

    def value(self, s: Interval) -> Interval:
        """Enclose f, less its residual, at s."""
        f = self.jet(s).f
        return f if self.residual is None else f - self.residual

    def first_root(self, start: Interval, end: Interval) -> Root | None:
        """Find the first root in (start, end], or prove that there is none.

        Args:
            start: thin interval; that f > 0 there, or f = 0 and rising, is the caller's claim.
            end: thin interval.

        Raises:
            Undecidable: when this precision cannot tell.
        """
        todo = [(start, end, 0)]
        max_depth = MAX_DEPTH_PER_DIGIT * self.arithmetic.digits + 64
        while todo:
            a, b, depth = todo.pop()
            if depth > max_depth or len(self.leaves) > MAX_LEAVES:
                raise Undecidable("f and f' vanish together, as far as this precision shows")
            whole = self.arithmetic.hull(a, b)
            jet = self.jet(whole)
            if sign(jet.f if self.residual is None else jet.f - self.residual) > 0:
                self.leaves.append(Leaf(a, b, "plain"))
                continue
            slope = self.arithmetic.zero if jet.d1 is None else jet.d1
            is_concave = jet.d2 is None or is_at_most_zero(jet.d2)
            if sign(slope) > 0:
                self.leaves.append(Leaf(a, b, "rising"))
                continue
            if self.is_flat and a is start and jet.d2 is not None and sign(jet.d2) > 0:
                self.leaves.append(Leaf(a, b, "lifting"))
                continue
            if sign(slope) < 0 or is_concave:
                at_end = sign(self.value(b))
                if at_end > 0:
                    self.leaves.append(Leaf(a, b, "falling" if sign(slope) < 0 else "concave"))
                    continue
                if at_end < 0 and sign(slope) < 0:
                    return self._refine(a, b)
            elif self._is_centred_positive(whole, slope):
                self.leaves.append(Leaf(a, b, "centred"))
                continue
            middle = self._split(a, b)
            todo += [(middle, b, depth + 1), (a, middle, depth + 1)]
        return None

    def _split(self, a: Interval, b: Interval) -> Interval:
        # A point where f has a sign, so that no sub-interval ends on a root.
        for left, right in ((a, b), (a, self.arithmetic.middle(self.arithmetic.hull(a, b)))):
            middle = self.arithmetic.middle(self.arithmetic.hull(left, right))
            if is_below(a, middle) and is_below(middle, b) and sign(self.value(middle)) != 0:
                return middle
        raise Undecidable("f has no sign where the interval is split")

    def _is_centred_positive(self, whole: Interval, slope: Interval) -> bool:
        middle = self.arithmetic.middle(whole)
        return sign(self.value(middle) + slope * (whole - middle)) > 0

    def _refine(self, a: Interval, b: Interval) -> Root:
        # Interval Newton on [a, b]: f' < 0 there, so each image encloses the one root. Where it
        # does not halve the enclosure, the sign at the middle does.
        time = self.arithmetic.hull(a, b)
        while True:
            middle = self.arithmetic.middle(time)
            f = self.value(middle)
            smaller = self.arithmetic.intersection(time, middle - f / self.jet(time).d1)
            if not is_below(2 * smaller.delta, time.delta):
                if sign(f) == 0:
                    return self._accepted(smaller, a)
                lower, upper = self.arithmetic.lower(time), self.arithmetic.upper(time)
                smaller = self.arithmetic.hull(*((middle, upper) if sign(f) > 0 else (lower, middle)))
            time = smaller

    def _accepted(self, time: Interval, a: Interval) -> Root:
        # Strict signs at both ends of a somewhat wider interval, and the stretch before it.
        least = self.arithmetic.upper(time) * self.arithmetic.power_of_two(8 - self.arithmetic.prec)
        margin = self.arithmetic.upper(time.delta + least)
        while True:
            wider = self.arithmetic.hull(
                self.arithmetic.lower(time - margin), self.arithmetic.upper(time + margin)
            )
            lower, upper = self.arithmetic.lower(wider), self.arithmetic.upper(wider)
            slope = self.jet(wider).d1
            if not is_below(a, lower) or slope is None or sign(slope) >= 0:
                raise Undecidable("the signs around the root are not strict")
            if sign(self.value(lower)) > 0 > sign(self.value(upper)):
                self.leaves.append(Leaf(a, lower, "falling"))
                return Root(wider, slope)
            margin = 8 * margin
