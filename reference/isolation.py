"""The first downward root of a wall function, isolated left first.

Sub-intervals cover the flight from the left. On each, f > 0 is proved, given f >= 0 at its left
end:
    direct           f(I) > 0;
    centred          f(m) + f'(m)(I - m) + f''(I)(I - m)^2 / 2 > 0 with m inside I;
    increasing       f' > 0 on it;
    decreasing       f' < 0 on it, and f > 0 at its right end;
    concave          f'' <= 0 on it, and f > 0 at its right end;
    flat start       f'' > 0 on it, and f = f' = 0 exactly at its left end, the start;
    never reached    the wall does not meet, in a whole period, particles at rest at the two ends of
                     the path on it. For fixed laws f is concave along a flight, so f > 0 between
                     these two positions at every phase.
A root is accepted only on an interval with f' < 0 throughout, f > 0 at its left end and f < 0
at its right one. If none of this decides, the interval is halved, at last refused (`Undecidable`).

f is continuously differentiable, also across the knots of its laws. f'' may jump there, and is
enclosed with all its one-sided values. Each of these arguments, interval Newton, and the
uniqueness of the root need only that, so an interval may contain knots.

On the wall being left, f stands for f - f(0), and f = 0 where the flight begins. That moment may
be known only within `begin`. On a sub-interval that does not begin after it, f must then increase,
or be concave with all of `begin` inside.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

from reference.arithmetic import (
    Arithmetic,
    Interval,
    Undecidable,
    exact_ends,
    is_at_most_zero,
    is_below,
    sign,
)
from reference.jets import Jet
from reference.timeline import Timeline

MAX_EXCLUDED = 4000  # sub-intervals of one wall on which f > 0 is proved
MAX_PARTS = (
    2 * MAX_EXCLUDED
)  # sub-intervals that a search examines: halving needs so many for MAX_EXCLUDED
MAX_NEWTON = 200


class IsolatedRoot(NamedTuple):
    """The only root on `time`, with f' < 0 throughout it, and no earlier one."""

    time: Interval
    slope: Interval


@dataclass(eq=False)
class Isolator:
    """Isolates roots of one wall function, with the residual of the wall being left removed.

    Attributes:
        arithmetic: the working precision.
        jet: f, f', f'' over an interval of flight time.
        begin: encloses the flight time at which the flight begins.
        residual: f(0) when the particle leaves this wall (the root s = 0 is divided out), else
            None.
        is_flat: f(0) = f'(0) = 0 exactly, so that only f'' > 0 can prove the start.
        timeline: gives the knots of the laws, where intervals are best cut.
        is_never_met: tells whether the wall never comes to where the flight is at a time; None: not
            known.
        reached: f > 0 is proved up to here, a thin interval; None before the search begins.
        n_excluded: sub-intervals on which f > 0 has been proved.
        root: the first root, once it has been found.
    """

    arithmetic: Arithmetic
    jet: Callable[[Interval], Jet]
    begin: Interval
    residual: Interval | None = None
    is_flat: bool = field(default=False, kw_only=True)
    timeline: Timeline = field(kw_only=True)
    is_never_met: Callable[[Interval], bool] | None = field(default=None, kw_only=True)
    reached: Interval | None = field(default=None, init=False)
    n_excluded: int = field(default=0, init=False)
    root: IsolatedRoot | None = field(default=None, init=False)

    def value(self, s: Interval) -> Interval:
        """Enclose f, less its residual, at s."""
        f = self.jet(s).f
        return f if self.residual is None else f - self.residual

    def first_root(self, start: Interval, end: Interval) -> IsolatedRoot | None:
        """Find the first root in (start, end], or prove that there is none; see `first_fall`.

        Raises:
            Undecidable: when this precision cannot tell.
        """
        fall = self.first_fall(start, end)
        self.root = None if fall is None else self._refine(*fall)
        return self.root

    def first_fall(self, start: Interval, end: Interval) -> tuple[Interval, Interval] | None:
        """Find where f > 0 first falls below 0, by f' < 0 throughout, or prove that it does not.

        Args:
            start: thin interval; that f > 0 there, or that the flight begins there on this wall and
                f = 0, is the caller's claim.
            end: thin interval.

        Returns:
            The ends of a sub-interval of (start, end] that holds one root and no earlier one; None
            for none.

        Raises:
            Undecidable: when this precision cannot tell.
        """
        todo = [(start, end)]
        n_parts = 0
        while todo:
            a, b = todo.pop()
            n_parts += 1
            if self.n_excluded > MAX_EXCLUDED or n_parts > MAX_PARTS:
                raise Undecidable(f"more than {MAX_EXCLUDED} sub-intervals are needed")
            whole = self.arithmetic.hull(a, b)
            jet = self._sharpened(a, b, whole)
            is_excluded = self._is_excluded(a, b, jet)
            if not is_excluded and not self._falls_or_bends_down(jet):
                jet = self._expanded(whole, jet)
                is_excluded = self._is_excluded(a, b, jet)
            if is_excluded or self._is_never_reached(a, b):
                self.reached = b
                self.n_excluded += 1
                continue
            if sign(jet.d1) < 0 and not self._may_begin(a) and sign(self.value(b)) < 0:
                return a, b
            parts = self._parts(a, b, whole, jet)
            self._require_rise(a, b, cut=parts[0][1])
            todo += reversed(parts)
        return None

    def _sharpened(self, a: Interval, b: Interval, whole: Interval) -> Jet:
        """Evaluate f and its derivatives over an interval.

        f' from its ends where it is monotonic.
        """
        jet = self.jet(whole)
        if sign(jet.d1) != 0 or sign(jet.d2) == 0:
            return jet
        first = self.jet(a).d1
        last = self.jet(b).d1
        return jet._replace(
            d1=self.arithmetic.intersection(jet.d1, self.arithmetic.union([first, last]))
        )

    def _expanded(self, whole: Interval, jet: Jet) -> Jet:
        """Enclose f and f' again, by Taylor's theorem: f' is Lipschitz, also across knots.

        Near a flat minimum of a law its waves cancel. Evaluated directly, the error of f is then
        proportional to the length of the interval; this way it is proportional to the cube of the
        length.
        """
        arithmetic = self.arithmetic
        middle = self.arithmetic.middle(whole)
        there = self.jet(middle)
        away = whole - middle
        d1 = arithmetic.intersection(jet.d1, there.d1 + jet.d2 * away)
        f = there.f + there.d1 * away + jet.d2 * arithmetic.square(away) / 2
        return jet._replace(f=arithmetic.intersection(jet.f, f), d1=d1)

    @staticmethod
    def _falls_or_bends_down(jet: Jet) -> bool:
        """Tell whether f' < 0 or f'' <= 0 is known; f > 0 is then asked for at the end alone."""
        return sign(jet.d1) < 0 or is_at_most_zero(jet.d2)

    def _may_begin(self, a: Interval) -> bool:
        """Tell whether the flight may begin, on this wall, at a or later."""
        return self.residual is not None and not is_below(self.arithmetic.upper(self.begin), a)

    def _require_rise(self, a: Interval, b: Interval, cut: Interval) -> None:
        """Refuse to cut an interval if f does not increase near the start of the flight.

        On a part that neither contains all of `begin` nor lies after it, f must increase. If f' > 0
        is not proved at one of its points, cutting would never end there.
        """
        latest = self.arithmetic.upper(self.begin)
        holds_all = not is_below(self.arithmetic.lower(self.begin), a) and is_below(latest, cut)
        if not self._may_begin(a) or holds_all:
            return
        for point in (a, cut, latest if is_below(latest, b) else b):
            if self._may_begin(point) and sign(self.jet(point).d1) <= 0:
                raise Undecidable(
                    "the flight begins along its wall, as far as this precision shows"
                )

    def _is_excluded(self, a: Interval, b: Interval, jet: Jet) -> bool:
        """Tell whether f and its derivatives prove f > 0 on (a, b]."""
        is_concave = is_at_most_zero(jet.d2)
        if sign(jet.d1) > 0:
            return True
        if self._may_begin(a):
            if self.is_flat and sign(jet.d2) > 0:
                return True
            is_all_within = is_below(self.begin, b) and not is_below(
                self.arithmetic.lower(self.begin), a
            )
            return is_concave and is_all_within and sign(self.value(b)) > 0
        return self._sign_of(jet.f) > 0 or (
            (sign(jet.d1) < 0 or is_concave) and sign(self.value(b)) > 0
        )

    def _is_never_reached(self, a: Interval, b: Interval) -> bool:
        """Tell whether the wall never comes, in a period, to where the flight is at a or b."""
        ask = self.is_never_met
        length = exact_ends(b)[0] - exact_ends(a)[0]
        if ask is None or self._may_begin(a) or not self.timeline.is_whole(length):
            return False
        return ask(b) and ask(a)

    def _parts(
        self, a: Interval, b: Interval, whole: Interval, jet: Jet
    ) -> list[tuple[Interval, Interval]]:
        """Cut an interval: around its least value where f is convex, at a knot, or half way."""
        if sign(jet.d2) > 0 and sign(jet.d1) == 0 and not self._may_begin(a):
            low, high = self._bottom(whole)
            if is_below(a, low) and is_below(high, b):
                return (
                    [(a, low), (low, high), (high, b)]
                    if is_below(low, high)
                    else [(a, low), (low, b)]
                )
        middle = self._split(a, b)
        return [(a, middle), (middle, b)]

    def _bottom(self, whole: Interval) -> tuple[Interval, Interval]:
        """Enclose where a convex f is least, by interval Newton on f', until f has a sign there.

        Returns:
            The ends of a wider enclosure, so that f clearly falls left of it and rises right of it;
            those of `whole` when f may be least at an end.
        """
        where = whole
        for _ in range(MAX_NEWTON):
            there = self.jet(self.arithmetic.middle(where))
            over = self.jet(where)
            image = self.arithmetic.middle(where) - there.d1 / over.d2
            if is_below(image, where) or is_below(where, image):
                break
            narrower = self.arithmetic.intersection(where, image)
            is_last = not is_below(2 * narrower.delta, where.delta)
            if is_last or self._sign_of(over.f) > 0 or self._sign_of(there.f) < 0:
                margin = self._margin(narrower)
                low = self.arithmetic.lower(narrower - margin)
                high = self.arithmetic.upper(narrower + margin)
                at_low = sign(self.value(low))
                if at_low < 0 or (
                    at_low > 0 and self._is_positive(self.arithmetic.hull(low, high))
                ):
                    return low, high
            if is_last:
                raise Undecidable("f and f' vanish together, as far as this precision shows")
            where = narrower
        return self.arithmetic.lower(whole), self.arithmetic.upper(whole)

    def _is_positive(self, whole: Interval) -> bool:
        return self._sign_of(self._expanded(whole, self.jet(whole)).f) > 0

    def _sign_of(self, f: Interval) -> int:
        """Return the sign of f less its residual, 0 for none."""
        return sign(f if self.residual is None else f - self.residual)

    def _split(self, a: Interval, b: Interval) -> Interval:
        """Return a point inside where f has a sign, so that no sub-interval ends on a root."""
        half_way = self.arithmetic.middle(self.arithmetic.hull(a, b))
        earlier = self.arithmetic.middle(self.arithmetic.hull(a, half_way))
        later = self.arithmetic.middle(self.arithmetic.hull(half_way, b))
        # Should f vanish half way, which is a short number and may lie aside: the wider part is cut
        # first.
        is_left_wider = is_below(b - half_way, half_way - a)
        aside = (earlier, later) if is_left_wider else (later, earlier)
        for point in (self._knot(a, b), half_way, *aside):
            is_inside = point is not None and is_below(a, point) and is_below(point, b)
            # While the flight may still begin, on the wall, no sign is asked for: f rises or is
            # refused.
            if is_inside and (self._may_begin(point) or sign(self.value(point)) != 0):
                return point
        raise Undecidable("f has no sign where the interval is split")

    def _knot(self, a: Interval, b: Interval) -> Interval | None:
        knot = self.timeline.knot_between(exact_ends(a)[0], exact_ends(b)[0])
        return None if knot is None else self.arithmetic.dyadic(knot)

    def _refine(self, a: Interval, b: Interval) -> IsolatedRoot:
        # Interval Newton on [a, b]: f' < 0 there, so each image encloses the one root. Where it
        # does not halve the enclosure, the sign at a point inside does.
        time = self.arithmetic.hull(a, b)
        while True:
            middle = self.arithmetic.middle(time)
            f = self.value(middle)
            smaller = self.arithmetic.intersection(time, middle - f / self.jet(time).d1)
            if not is_below(2 * smaller.delta, time.delta):
                half = self._cut(time, middle, f)
                if half is None:
                    return self._accepted(smaller, a)
                smaller = half
            time = smaller

    def _cut(self, time: Interval, middle: Interval, f: Interval) -> Interval | None:
        """Return the part of an enclosure that holds the root, by the sign of f inside.

        None without one.

        The root may lie half way, at a knot say, however wide the enclosure is; then not at a
        quarter.
        """
        lower = self.arithmetic.lower(time)
        upper = self.arithmetic.upper(time)
        if sign(f) == 0:
            middle = self.arithmetic.middle(self.arithmetic.hull(lower, middle))
            f = self.value(middle)
        if sign(f) == 0:
            return None
        return self.arithmetic.hull(*((middle, upper) if sign(f) > 0 else (lower, middle)))

    def _margin(self, time: Interval) -> Interval:
        """Return how much wider than itself, and its rounding, an enclosed time is taken."""
        least = self.arithmetic.upper(time) * self.arithmetic.power_of_two(8 - self.arithmetic.prec)
        return self.arithmetic.upper(time.delta + least)

    def _accepted(self, time: Interval, a: Interval) -> IsolatedRoot:
        # Strict signs at both ends of a somewhat wider interval, and the stretch before it.
        if not is_below(self.arithmetic.upper(self.begin), time):
            raise Undecidable("a wall is met within the enclosure of the start")
        margin = self._margin(time)
        while True:
            wider = self.arithmetic.hull(
                self.arithmetic.lower(time - margin), self.arithmetic.upper(time + margin)
            )
            lower = self.arithmetic.lower(wider)
            upper = self.arithmetic.upper(wider)
            slope = self.jet(wider).d1
            is_later = is_below(a, lower) and is_below(self.arithmetic.upper(self.begin), lower)
            if not is_later or sign(slope) >= 0:
                raise Undecidable("the signs around the root are not strict")
            if sign(self.value(lower)) > 0 > sign(self.value(upper)):
                return IsolatedRoot(wider, slope)
            margin = 8 * margin
