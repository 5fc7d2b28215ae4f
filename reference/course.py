"""One flight from a state to its first collision, at one working precision.

At y = 0 the straight flight passes from one part of the table to the other. On each part the walls
that bound it are searched from the left (`reference.isolation`). All quantities are enclosures,
except the instant from which flight times are counted, so a trajectory can chain flights.
`Undecidable` is raised if the precision does not decide. Only `reference.rational` proves
equalities. docs/proof.md says what each answer claims, and why.
"""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from typing import Any, NamedTuple

from reference import rational
from reference.arithmetic import Exhausted, Interval, Undecidable, exact_ends, is_below, sign
from reference.isolation import Isolator
from reference.prepared import PreparedTable
from reference.walls import MovingWalls
from scene import State, Undefined, Wall
from scene.mpmath_internals import ends

SIDES: tuple[Wall, ...] = ("left", "right", "floor")
BEYOND = 2.0**-10  # how far past the end of a search f is still looked at, as a share of its length
FOR_EVER = 2.0**1000  # the horizon when none is given, as a flight time


class Hit(NamedTuple):
    """A wall met: when (enclosed, flight time), with f' there."""

    wall: Wall
    time: Interval
    slope: Interval


@dataclass(eq=False)
class Course:
    """A flight, and the questions about it.

    Attributes:
        table: the scene, prepared.
        motion: the walls along the flight, at the working precision.
        leaving: the wall the particle is on, if any, with its residual f(0).
        is_flat: on that wall f'(0) = 0 and f''(0) > 0, both exactly.
        in_cap: the flight begins in the cap.
        end: horizon as flight time, exactly; None for none.
        exact: the state as binary64 numbers, when it is one; decides ties.
    """

    table: PreparedTable
    motion: MovingWalls
    leaving: dict[Wall, Interval]
    is_flat: bool
    in_cap: bool
    end: Fraction | None
    exact: State | None

    def __post_init__(self) -> None:
        """Enclose the horizon and the start; nothing is proved yet."""
        self.arithmetic = self.motion.arithmetic
        self.flight = self.motion.flight
        self.horizon = self.arithmetic.dyadic(Fraction(FOR_EVER) if self.end is None else self.end)
        self.start = self.arithmetic.lower(self.flight.begin)
        self._searches: dict[Wall, Isolator] = {}
        self._never_met: dict[Any, bool] = {}

    def event(self) -> Hit | Undefined | None:
        """Find how the flight ends: at a hit, nowhere (undefined), or at the horizon (None)."""
        if self._runs_along_mouth():
            return self._along_mouth()
        crossing = self._crossing()
        is_crossed = crossing is not None and self._is_before_end(crossing)
        limit = crossing if is_crossed else None
        found = self._first_hit(("arc",) if self.in_cap else SIDES, self.start, limit)
        return found if found is not None or limit is None else self._beyond_crossing(limit)

    def hit_after(self, wall: Wall, start: Interval) -> Interval | None:
        """Find when the flight would meet a wall after `start`, were nothing in its way."""
        if wall == "base":
            crossing = self._crossing()
            return crossing if crossing is not None and is_below(start, crossing) else None
        searches: dict[Wall, Isolator] = {}
        hits = (self._hit(wall, start, stop, searches) for stop in self._stops(start, self.horizon))
        return next((hit.time for hit in hits if hit is not None), None)

    def _runs_along_mouth(self) -> bool:
        is_level = self.exact is not None and self.exact.y == 0 and self.exact.vy == 0
        return self.table.is_mushroom and is_level and not self.leaving

    def _along_mouth(self) -> Undefined | None:
        """Follow a path along y = 0 inside the mouth: it can only end at the mouth's edge."""
        hits = self._hits(("left", "right"), self.start, None)
        if not hits:
            return None
        self._require_before_end(hits[-1])
        return Undefined("mouth-edge")

    def _crossing(self) -> Interval | None:
        """Enclose when the flight crosses y = 0; None for never."""
        if "base" in self.leaving:
            return None
        direction = sign(self.flight.vy)
        if direction == 0 and self.flight.vy != 0:
            raise Undecidable("the sign of vy is open")
        if direction != (-1 if self.in_cap else 1):
            return None
        crossing = self.arithmetic.inflated(-self.flight.y / self.flight.vy)
        if not is_below(self.arithmetic.upper(self.flight.begin), crossing):
            raise Undecidable("y = 0 is crossed within the enclosure of the start")
        return crossing

    def _is_before_end(self, time: Interval) -> bool:
        if is_below(time, self.horizon):
            return True
        if is_below(self.horizon, time):
            return False
        crossing = None if self.exact is None else rational.crossing_time(self.exact)
        if crossing is None or self.end is None:
            raise Undecidable("horizon and event fall together")
        return crossing < self.end

    def _beyond_crossing(self, crossing: Interval) -> Hit | Undefined | None:
        """Continue a flight that met nothing before y = 0: to the base, or through the mouth."""
        if self.table.is_cap:
            return self._base_hit(crossing)
        x = self.flight.x + self.flight.vx * crossing
        w = self.motion.width(crossing).f
        gaps: tuple[tuple[Wall, Interval], ...] = (("left", w + x), ("right", w - x))
        signs = [
            sign(gap - self.leaving[side] if side in self.leaving else gap) for side, gap in gaps
        ]
        if self.in_cap and -1 in signs:
            return self._base_hit(crossing)
        if signs != [1, 1]:
            return self._at_the_edge()
        if self.table.is_stem:
            return self._base_hit(crossing)
        found = self._first_hit(
            SIDES if self.in_cap else ("arc",), self.arithmetic.lower(crossing), None
        )
        if isinstance(found, Hit) and not is_below(crossing, found.time):
            raise Undecidable(
                "a wall is met at the height of the mouth, as far as this precision shows"
            )
        return found

    def _at_the_edge(self) -> Undefined:
        """Judge a crossing of y = 0 that may or may not lie between the sides."""
        is_mouth = self.table.is_mushroom
        instant = None if self.exact is None else rational.crossing_time(self.exact)
        if (
            self.exact is not None
            and instant is not None
            and any(rational.is_zero(self.table, self.exact, side, instant) for side in SIDES[:2])
        ):
            return Undefined("mouth-edge" if is_mouth else "corner")
        edge = "the mouth's edge" if is_mouth else "a corner"
        raise Undecidable(f"{edge} is met, as far as this precision shows")

    def _base_hit(self, crossing: Interval) -> Hit:
        return Hit("base", crossing, -self.flight.vy if self.table.is_stem else self.flight.vy)

    def _first_hit(
        self, walls: tuple[Wall, ...], start: Interval, limit: Interval | None
    ) -> Hit | Undefined | None:
        """Find which of some walls is met first, before y = 0 (`limit`) or the horizon."""
        hits = self._hits(walls, start, limit)
        if not hits:
            farthest = self._escape_time()
            if limit is None and farthest is not None and is_below(farthest, self.horizon):
                raise Undecidable("the flight leaves the table and no wall is found")
            return None
        best = hits[-1]
        is_alone = all(is_below(best.time, other.time) for other in hits[:-1])
        if is_alone and (limit is None or is_below(best.time, limit)):
            self._require_before_end(best)
            return best
        return self._tied(hits, limit)

    def _hits(self, walls: tuple[Wall, ...], start: Interval, limit: Interval | None) -> list[Hit]:
        """Find the walls that may be met first.

        No hit in the list is after one that stands before it.

        A wall met exactly at the horizon is not met before it. A root whose interval contains the
        end of a search is no answer yet: a wall searched before may be met beyond this end, within
        the interval.
        """
        hits: list[Hit] = []
        for stop in self._stops(start, self.horizon if limit is None else limit):
            hits = self._hits_before(stop, walls, start)
            if hits and is_below(hits[-1].time, stop):
                break
        return hits

    def _hits_before(self, stop: Interval, walls: tuple[Wall, ...], start: Interval) -> list[Hit]:
        """Find the walls that may be met first before one end of a search."""
        until = stop
        hits: list[Hit] = []
        postponed: list[Wall] = []
        for wall in itertools.chain(walls, postponed):
            try:
                hit = self._hit(wall, start, until, self._searches)
            except Undecidable as question:
                # An undecided wall may be met after another one. Each wall is postponed once.
                if isinstance(question, Exhausted) or wall in postponed:
                    raise
                postponed.append(wall)
                continue
            if hit is not None and not self._is_at_horizon(hit):
                hits.append(hit)
                until = hit.time
        return hits

    def _stops(self, start: Interval, until: Interval) -> Iterator[Interval]:
        """Yield later and later ends of a search, first after one period.

        An early hit stays cheap.
        """
        upper = self.arithmetic.upper
        farthest = self._escape_time()
        last = upper(until)
        length = self.motion.timeline.turn
        if farthest is not None and is_below(farthest, last):
            last = farthest
        while length is not None and is_below(upper(start + length), last):
            yield upper(start + length)
            length = 4 * length
        yield last

    def _is_at_horizon(self, hit: Hit) -> bool:
        """Tell whether a hit is known to fall on the horizon exactly."""
        if self.exact is None or self.end is None or is_below(hit.time, self.horizon):
            return False
        return rational.is_zero(self.table, self.exact, hit.wall, self.end)

    def _require_before_end(self, hit: Hit) -> None:
        if not is_below(hit.time, self.horizon):
            raise Undecidable("horizon and collision fall together")

    def _tied(self, hits: list[Hit], limit: Interval | None) -> Undefined:
        """Find which walls are met together exactly, at a rational time.

        Raises:
            Undecidable: no rational time proves it.
        """
        times = [] if self.exact is None else self._rational_times(self.exact)
        for instant in times:
            walls = self._met_at(instant, hits, limit)
            if len(walls) > 1:
                is_edge = self.table.is_mushroom and "base" in walls and "arc" not in walls
                return Undefined("mouth-edge" if is_edge else "corner")
        raise Undecidable("two walls are met together, as far as this precision shows")

    def _rational_times(self, state: State) -> list[Fraction]:
        """List the flight times at which straight walls at rest are met before the horizon."""
        times = [rational.crossing_time(state)]
        times += [rational.straight_time(self.table, state, wall) for wall in SIDES]
        return [
            time for time in times if time is not None and (self.end is None or time < self.end)
        ]

    def _met_at(
        self, instant: Fraction, hits: list[Hit], limit: Interval | None
    ) -> tuple[Wall, ...]:
        """List the walls met exactly then, when all others are met later; else nothing."""
        assert self.exact is not None
        met: list[Wall] = []
        if limit is not None:
            crossing = rational.crossing_time(self.exact)
            if crossing is None or crossing < instant:
                return ()
            met += ["base"] if crossing == instant else []
        for hit in hits:
            low, high = exact_ends(hit.time)
            is_met = low <= instant <= high and rational.is_zero(
                self.table, self.exact, hit.wall, instant
            )
            if is_met:
                met.append(hit.wall)
            elif low <= instant:
                return ()
        return tuple(met)

    def _hit(
        self, wall: Wall, start: Interval, until: Interval, searches: dict[Wall, Isolator]
    ) -> Hit | None:
        """Find the first root of one wall's function, if it may come before the end of `until`.

        A search continues where it stopped, because f > 0 is proved there, unless it has found its
        root.
        """
        stop = self.arithmetic.upper(until)
        if wall not in searches:
            begun = self._isolator(wall)
            if wall not in self.leaving and sign(begun.value(start)) <= 0:
                raise Undecidable(f"f of {wall} has no sign where a stretch of the flight begins")
            searches[wall] = begun
        search = searches[wall]
        root = search.root  # known where it lies beyond the end of the search before
        if root is None:
            reached = start if search.reached is None else search.reached
            end = self._end_beyond(search, stop, stop - start)
            root = search.first_root(reached, end) if is_below(reached, end) else None
        if root is None or is_below(stop, root.time):
            return None
        return Hit(wall, root.time, root.slope)

    def _end_beyond(self, search: Isolator, stop: Interval, length: Interval) -> Interval:
        """Return where a search ends.

        A little later than asked for, so that a root at the end lies inside.

        f must have a sign there, because a root may lie at that later end too.
        """
        ends = [
            self.arithmetic.upper(stop + length * share)
            for share in (BEYOND, 2 * BEYOND, 3 * BEYOND)
        ]
        return next((end for end in ends if sign(search.value(end)) != 0), ends[0])

    def _isolator(self, wall: Wall) -> Isolator:
        return Isolator(
            self.arithmetic,
            partial(self.motion.wall, wall),
            self.flight.begin,
            self.leaving.get(wall),
            is_flat=self.is_flat and wall in self.leaving,
            timeline=self.motion.timeline,
            is_never_met=partial(self._is_never_met, wall),
        )

    def _is_never_met(self, wall: Wall, s: Interval) -> bool:
        """Tell whether a wall never comes, in a whole period, to where the flight is at s."""
        turn = self.motion.timeline.turn
        motion = self.motion.at_rest(s)
        if turn is None:
            return False
        place = wall, ends(motion.flight.x), ends(motion.flight.y)
        if place not in self._never_met:
            arithmetic = self.arithmetic
            start = self.arithmetic.zero
            jet = partial(motion.wall, wall)
            before = arithmetic.number(-1)
            search = Isolator(
                arithmetic, jet, before, self.leaving.get(wall), timeline=self.motion.timeline
            )
            try:
                is_clear = sign(search.value(start)) > 0 and search.first_fall(start, turn) is None
            except Exhausted:
                raise
            except Undecidable:
                is_clear = False
            self._never_met[place] = is_clear
        return self._never_met[place]

    def _escape_time(self) -> Interval | None:
        """Return a time by which the straight flight has left the table, wherever its walls are.

        It is twice the time to cross the largest extent the table ever has, along either axis.
        """
        number = self.arithmetic.number
        upper = self.arithmetic.upper
        radius = number(self.table.radius)
        depth = number(self.table.depth)
        widest = max(self.table.radius, self.table.half_width)
        half = number(widest) + number(self.table.tilt) * depth
        times = []
        for speed, extent in ((self.flight.vx, 2 * half), (self.flight.vy, radius + depth)):
            if sign(speed) != 0:
                size = speed if sign(speed) > 0 else -speed
                times.append(upper(2 * extent / size))
        if not times:
            return None
        return times[0] if len(times) == 1 or is_below(times[0], times[1]) else times[1]
