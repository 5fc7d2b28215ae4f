"""One flight from a state to its first collision, at one working precision.

The straight flight is cut where a law leaves an analytic piece and where it crosses y = 0; on
each part the walls that can be met there are searched left first (`reference.isolation`). All
quantities are enclosures, so a trajectory may chain flights; what a precision leaves open is
raised as `Undecidable`, and equalities are settled by `reference.rational` alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from functools import partial
from itertools import zip_longest
from typing import NamedTuple

from reference import rational
from reference.arithmetic import Arithmetic, Interval, Undecidable, is_below, sign
from reference.arithmetic import rational as exact_point
from reference.isolation import Isolator, Leaf, Root
from reference.jets import Flight, Motion, Pieces
from scene import Cap, Mushroom, Scene, State, Stem, Undefined, Wall
from scene.laws import Quadratic, bounds, piece_at
from scene.tables import laws, period

SIDES: tuple[Wall, ...] = ("left", "right", "floor")
MAX_SKIPS = 80
BEYOND = 2.0**-10
MAX_SPANS = 20_000  # a flight at 1e-3 of the walls' speed crosses some thousand


class Span(NamedTuple):
    """A stretch of flight time on which every law stays on one piece."""

    start: Interval
    end: Interval
    motion: Motion


class Hit(NamedTuple):
    """A wall met: when (enclosed), with f' there, and the law pieces that may hold then.

    There are two motions where the time's enclosure holds a knot: the truth is in their hull.
    """

    wall: Wall
    time: Interval
    slope: Interval
    motions: tuple[Motion, ...]


class Event(NamedTuple):
    """How a flight ends: at a hit, at the horizon (hit None), or nowhere (undefined)."""

    hit: Hit | None
    undefined: Undefined | None
    proof: dict[str, list[Leaf]]


class Course:
    """A flight and all that is asked about it.

    Args:
        scene: table and laws.
        arithmetic: working precision.
        flight: enclosures of the state.
        leaving: walls the particle is on, each with its residual f(0).
        flat: walls among them with f'(0) = 0 and f''(0) > 0, both exactly.
        end: horizon as flight time, enclosed.
        exact: the state as binary64 numbers, when it is one; decides ties.
    """

    def __init__(
        self,
        scene: Scene,
        arithmetic: Arithmetic,
        flight: Flight,
        leaving: dict[Wall, Interval],
        flat: frozenset[Wall],
        end: Interval,
        exact: State | None,
    ) -> None:
        self.scene = scene
        self.arithmetic = arithmetic
        self.flight = flight
        self.leaving = leaving
        self.flat = flat
        self.end = end
        self.exact = exact
        self.proof: dict[str, list[Leaf]] = {}

    def event(self, *, in_cap: bool) -> Event:
        """Find how the flight ends."""
        if self._runs_along_mouth():
            hit = self._first_hit(("left", "right"), self.arithmetic.zero, self.end)
            if isinstance(hit, Hit):
                hit = Undefined("mouth-edge")
            return Event(None, hit, self.proof)
        crossing = self._crossing(in_cap=in_cap)
        is_crossed = crossing is not None and self._is_before_end(crossing)
        limit = crossing if crossing is not None and is_crossed else self.end
        near: tuple[Wall, ...] = ("arc",) if in_cap else SIDES
        found = self._first_hit(near, self.arithmetic.zero, limit)
        if found is None and crossing is not None and is_crossed:
            found = self._beyond_crossing(crossing, in_cap=in_cap)
        if isinstance(found, Undefined):
            return Event(None, found, self.proof)
        return Event(found, None, self.proof)

    def hit_after(self, wall: Wall, start: Interval) -> Interval | None:
        """Find when the straight flight would meet a wall after `start`, were nothing in its way."""
        if wall == "base":
            crossing = self._crossing(in_cap=not isinstance(self.scene, Stem))
            return crossing if crossing is not None and is_below(start, crossing) else None
        hit = self._hit(wall, start, self.end)
        return None if hit is None else hit.time

    def _runs_along_mouth(self) -> bool:
        is_level = self.exact is not None and self.exact.y == 0 and self.exact.vy == 0
        return isinstance(self.scene, Mushroom) and is_level and not self.leaving

    def _crossing(self, *, in_cap: bool) -> Interval | None:
        if "base" in self.leaving or sign(self.flight.vy) == 0:
            if "base" not in self.leaving and self.flight.vy != 0:
                raise Undecidable("the sign of vy is open")
            return None
        is_towards = sign(self.flight.vy) == (-1 if in_cap else 1)
        return -self.flight.y / self.flight.vy if is_towards else None

    def _is_before_end(self, time: Interval) -> bool:
        if is_below(time, self.end):
            return True
        if is_below(self.end, time):
            return False
        horizon = exact_point(self.end._mpi_[0]) if self.end.delta == 0 else None
        if self.exact is None or horizon is None:
            raise Undecidable("horizon and event fall together")
        crossing = rational.crossing_time(self.exact)
        return crossing is not None and crossing < horizon

    def _beyond_crossing(self, crossing: Interval, *, in_cap: bool) -> Hit | Undefined | None:
        if isinstance(self.scene, Cap):
            return self._base_hit(crossing)
        x = self.flight.x + self.flight.vx * crossing
        is_open = [0, 0]
        for i, motion in enumerate(self._motions_at(crossing)):
            w = motion.width(self.flight.t + crossing).f
            signs = [sign(w - x), sign(w + x)]
            is_open = signs if i == 0 or signs == is_open else [0, 0]
        if 0 in is_open:
            if self._is_tie(("left", "right"), None):
                return Undefined("mouth-edge" if isinstance(self.scene, Mushroom) else "corner")
            raise Undecidable("the mouth's edge is met, as far as this precision shows")
        if isinstance(self.scene, Stem) or (in_cap and -1 in is_open):
            return self._base_hit(crossing)
        walls: tuple[Wall, ...] = SIDES if in_cap else ("arc",)
        return self._first_hit(walls, self.arithmetic.lower(crossing), self.end)

    def _base_hit(self, crossing: Interval) -> Hit:
        slope = -self.flight.vy if isinstance(self.scene, Stem) else self.flight.vy
        return Hit("base", crossing, slope, self._motions_at(crossing))

    def _first_hit(self, walls: tuple[Wall, ...], start: Interval, limit: Interval) -> Hit | Undefined | None:
        hits: list[Hit] = []
        until = limit
        for wall in walls:
            hit = self._hit(wall, start, until)
            if hit is not None:
                hits.append(hit)
                until = hit.time
        if not hits:
            return None
        best = hits[-1]
        for other in hits[:-1]:
            if not is_below(best.time, other.time):
                return self._tied(walls, best.time)
        if is_below(best.time, limit):
            return best
        if limit is not self.end:
            return self._tied((*walls, "base"), best.time)
        if self._is_hit_at_horizon(best.wall):
            return None
        raise Undecidable("horizon and collision fall together")

    def _is_hit_at_horizon(self, wall: Wall) -> bool:
        horizon = exact_point(self.end._mpi_[0]) if self.end.delta == 0 else None
        if self.exact is None or horizon is None:
            return False
        return rational.is_zero(self.scene, self.exact, wall, horizon)

    def _tied(self, walls: tuple[Wall, ...], time: Interval) -> Undefined:
        if self._is_tie(walls, time):
            is_edge = isinstance(self.scene, Mushroom) and "base" in walls and "arc" not in walls
            return Undefined("mouth-edge" if is_edge else "corner")
        raise Undecidable("two walls are met together, as far as this precision shows")

    def _is_tie(self, walls: tuple[Wall, ...], time: Interval | None) -> bool:
        """Tell whether two walls vanish together at a rational time, exactly."""
        if self.exact is None:
            return False
        # Only the crossing of y = 0 and the hit of a floor at rest have rational times.
        for instant, own in (
            (rational.crossing_time(self.exact), "base"),
            (rational.floor_time(self.scene, self.exact), "floor"),
        ):
            if instant is None or (time is not None and instant not in _Within(time)):
                continue
            if any(w != own and rational.is_zero(self.scene, self.exact, w, instant) for w in walls):
                return True
        return False

    def _hit(self, wall: Wall, start: Interval, limit: Interval) -> Hit | None:
        leaves = self.proof.setdefault(wall, [])
        stop = self.arithmetic.upper(limit)
        farthest = self._escape_time()
        if farthest is not None and is_below(farthest, stop):
            stop = farthest
        residual = self.leaving.get(wall)
        if residual is None and self._is_long(start, stop):
            start = self._skip(wall, start, stop, leaves)
        spans = list(self._spans(start, stop))
        for span, following in zip_longest(spans, spans[1:]):
            isolator = self._isolator(wall, span.motion)
            is_at_start = residual is not None and sign(span.start) == 0
            if not is_at_start and sign(isolator.value(span.start)) <= 0:
                raise Undecidable(f"f of {wall} has no sign where a stretch of the flight begins")
            # A little beyond the end, where f goes on smoothly, so that a root at the end is isolated.
            end = self.arithmetic.upper(span.end + (span.end - span.start) * BEYOND)
            root = isolator.first_root(span.start, end)
            leaves.extend(isolator.leaves)
            if root is None or is_below(span.end, root.time):
                continue
            if following is None or is_below(root.time, self.arithmetic.lower(following.start)):
                return Hit(wall, root.time, root.slope, (span.motion,))
            return self._hit_at_knot(wall, root, span, following)
        return None

    def _isolator(self, wall: Wall, motion: Motion) -> Isolator:
        residual = self.leaving.get(wall)
        return Isolator(self.arithmetic, partial(motion.wall, wall), residual, is_flat=wall in self.flat)

    def _hit_at_knot(self, wall: Wall, root: Root, span: Span, following: Span) -> Hit:
        # The truth is a root of the piece before the knot or of the one after: take the hull of both.
        before = self.arithmetic.lower(root.time - (root.time - span.start) * BEYOND)
        isolator = self._isolator(wall, following.motion)
        after = self.arithmetic.upper(following.start + (following.start - before))
        if sign(isolator.value(before)) <= 0:
            raise Undecidable("the pieces on both sides of a knot disagree")
        other = isolator.first_root(before, after)
        if other is None:
            raise Undecidable("the pieces on both sides of a knot disagree")
        times, slopes = (root.time, other.time), (root.slope, other.slope)
        return Hit(
            wall, self.arithmetic.union(times), self.arithmetic.union(slopes), (span.motion, following.motion)
        )

    def _is_long(self, start: Interval, stop: Interval) -> bool:
        shared = period(self.scene)
        if shared is None:
            return False
        span = self.arithmetic.context.mpf(2) * shared.value(self.arithmetic.context)
        return is_below(start + span, stop)

    def _skip(self, wall: Wall, start: Interval, stop: Interval, leaves: list[Leaf]) -> Interval:
        """Pass what the wall never sweeps, all laws anywhere within their bounds; for slow particles."""
        ranges: Pieces = {name: bounds(law) for name, law in laws(self.scene).items()}
        motion = Motion(self.arithmetic, self.flight, ranges, is_stem=isinstance(self.scene, Stem))
        end = stop
        for _ in range(MAX_SKIPS):
            if sign(motion.wall(wall, self.arithmetic.hull(start, end)).f) > 0:
                leaves.append(Leaf(start, end, "swept"))
                if end._mpi_ == stop._mpi_:
                    return stop
                start, end = end, stop
            else:
                end = self.arithmetic.middle(self.arithmetic.hull(start, end))
        return start

    def _motions_at(self, time: Interval) -> tuple[Motion, ...]:
        spans = self._spans(self.arithmetic.lower(time), self.arithmetic.upper(time))
        return tuple(span.motion for span in spans)

    def _spans(self, start: Interval, stop: Interval) -> Iterator[Span]:
        """Cut [start, stop] where a law leaves an analytic piece; at least one span."""
        moment, high = (exact_point(end) for end in (self.flight.t + start)._mpi_)
        if sign(start) == 0:
            moment, high = (exact_point(end) for end in self.flight.t._mpi_)
        is_first = sign(start) == 0
        for _ in range(MAX_SPANS):
            pieces: Pieces = {name: piece_at(law, moment) for name, law in laws(self.scene).items()}
            ends = [piece.end for piece in pieces.values() if isinstance(piece, Quadratic)]
            motion = Motion(self.arithmetic, self.flight, pieces, is_stem=isinstance(self.scene, Stem))
            knot = min(ends, default=None)
            if knot is not None and is_first and knot <= high:
                raise Undecidable("a knot lies within the enclosure of the starting time")
            cut = None if knot is None else self.arithmetic.number(knot) - self.flight.t
            if knot is None or cut is None or not is_below(cut, stop):
                yield Span(start, stop, motion)
                return
            if is_below(start, cut):
                yield Span(start, self.arithmetic.upper(cut), motion)
                start = self.arithmetic.lower(cut)
            moment, is_first = knot, False
        raise Undecidable(f"more than {MAX_SPANS} knots lie within the flight")

    def _escape_time(self) -> Interval | None:
        # Twice the time to cross the largest extent the table ever has, along either axis.
        tops = {name: bounds(law) for name, law in laws(self.scene).items()}
        radius = tops["r"].highest if "r" in tops else 0.0
        depth = tops["h"].highest if "h" in tops else 0.0
        tilt = max(abs(tops["slope"].lowest), abs(tops["slope"].highest)) if "slope" in tops else 0.0
        half = max(radius, tops["w"].highest if "w" in tops else 0.0) + tilt * depth
        times = []
        for speed, extent in ((self.flight.vx, 2 * half), (self.flight.vy, radius + depth)):
            if sign(speed) != 0:
                size = speed if sign(speed) > 0 else -speed
                times.append(self.arithmetic.upper(2 * self.arithmetic.number(extent) / size))
        if not times:
            return None
        return times[0] if len(times) == 1 or is_below(times[0], times[1]) else times[1]


class _Within:
    """Membership of exact numbers in an interval."""

    def __init__(self, interval: Interval) -> None:
        self.low, self.high = (exact_point(end) for end in interval._mpi_)

    def __contains__(self, number: Fraction) -> bool:
        return self.low <= number <= self.high
