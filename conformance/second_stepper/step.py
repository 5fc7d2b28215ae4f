"""One step and a trajectory of steps in ball arithmetic, precision doubled until they are decided.

A flight goes straight to the first of: a wall of its part of the table, the crossing of y = 0 (the base, or
the mouth into the other part), the horizon. Roots are bracketed by `roots`; which comes first is decided by
comparing brackets. What still overlaps is a tie only when both are shown to vanish at one rational time,
exactly: the crossing, the horizon, or the simplest rational number of the overlap.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from flint import arb, fmpq
from mpmath import fp

from conformance.arb.flight import SIDES, Line, Table, line_of
from conformance.arb.numbers import ZERO, Ball, Rational, exact, precision, rational_ends
from conformance.second_stepper import start
from conformance.second_stepper.answer import Answer, OpenQuestion
from conformance.second_stepper.flight import SearchedFlight, extent
from conformance.second_stepper.jacobian import jacobian
from conformance.second_stepper.roots import AtEnd, RootBracket, first_root
from scene import Scene, State, Wall
from scene.tables import period

BITS = 160  # to begin with, beyond those that the numbers' sizes need
DOUBLINGS = 5
RELIABLE_BITS = 80  # that comparisons may take from an answer, relative to the size of its vectors


class Met(NamedTuple):
    """How a flight ends: with a wall, at the horizon (wall None), or nowhere (reason)."""

    wall: Wall | None
    time: Ball = None
    reason: str = ""


class Search:
    """How one flight ends, at the present precision.

    Args:
        flight: with what it leaves taken out.
        in_cap: in which part of the table it begins.
        end: flight time to the horizon, a rational, a ball, or None for none.
    """

    def __init__(self, flight: SearchedFlight, *, in_cap: bool, end: Ball | Rational | None) -> None:
        self.flight, self.in_cap = flight, in_cap
        escape = self._escape()
        self.is_horizon = end is not None and (escape is None or not escape < arb(end))
        self.end = end if self.is_horizon else escape
        if self.end is None:
            raise OpenQuestion("a particle at rest and no horizon")

    def outcome(self) -> Met:
        """Find how the flight ends."""
        crossing = self._crossing()
        limit = self.end if crossing is None or not self._is_before(crossing, self.end) else crossing
        near: tuple[Wall, ...] = ("arc",) if self.in_cap else SIDES
        met = self._first(near, ZERO, limit)
        if met is not None:
            return met
        if limit is self.end:
            return self._nothing()
        time = arb(limit)
        if not self.flight.table.is_mushroom or (self.in_cap and not self._is_mouth_open(limit)):
            if self.flight.table.is_mushroom and self._is_edge(limit):
                return Met(None, reason="mouth-edge")
            return Met("base", time)
        beyond = SIDES if self.in_cap else ("arc",)
        met = self._first(beyond, rational_ends(time)[0], self.end)
        if met is None:
            return self._nothing()
        if met.wall is not None and not met.time > time:
            raise OpenQuestion("a wall is met where y = 0 is crossed, as far as this precision shows")
        return met

    def along_mouth(self) -> Met:
        """Follow a particle along y = 0 in the mouth: to the horizon, or the mouth's edge."""
        met = self._first(("left", "right"), ZERO, self.end)
        return self._nothing() if met is None or met == Met(None) else Met(None, reason="mouth-edge")

    def _nothing(self) -> Met:
        if not self.is_horizon:
            raise OpenQuestion("no wall is met where one must be")
        return Met(None)

    def _crossing(self) -> Ball | Rational | None:
        """Return when y = 0 is met or crossed: a rational for an exact state; None for never."""
        flight, line = self.flight, self.flight.balls
        if "base" in flight.residuals:
            return None
        towards = -1 if self.in_cap else 1
        if towards * line.vy <= 0:
            return None
        if not towards * line.vy > 0:
            raise OpenQuestion("the sign of vy is open")
        if flight.state is not None:
            return -flight.line.y / flight.line.vy if flight.state.y else None
        if not towards * line.y < 0:
            raise OpenQuestion("the side of y = 0 is open")
        return -line.y / line.vy

    def _is_before(self, time: Ball | Rational, other: Ball | Rational) -> bool:
        """Tell whether time < other, exactly where both are rational."""
        if isinstance(time, fmpq) and isinstance(other, fmpq):
            return bool(time < other)
        if arb(time) < arb(other):
            return True
        if arb(time) > arb(other):
            return False
        raise OpenQuestion("the crossing of y = 0 and the horizon fall together")

    def _escape(self) -> Ball | None:
        """Return a time by which every particle that meets no wall has left the table."""
        across, up = extent(self.flight.table)
        line = self.flight.balls
        times = [
            2 * size / abs(speed)
            for size, speed in ((4 * across, line.vx), (2 * up, line.vy))
            if speed > 0 or speed < 0
        ]
        # A time that both axes allow: the lesser, wherever balls can tell.
        return min(times, key=lambda time: float(time.mid()), default=None)

    def _is_mouth_open(self, limit: Ball | Rational) -> bool:
        gaps = [self.flight.jet(wall, arb(limit))[0] for wall in ("left", "right")]
        if all(gap > 0 for gap in gaps):
            return True
        if any(gap < 0 for gap in gaps) or self._is_edge(limit):
            return False
        raise OpenQuestion("the mouth's edge is met, as far as this precision shows")

    def _is_edge(self, limit: Ball | Rational) -> bool:
        is_exact = isinstance(limit, fmpq)
        return is_exact and any(self.flight.is_zero(wall, limit) for wall in ("left", "right"))

    def _first(self, walls: Sequence[Wall], begin: Rational, limit: Ball | Rational) -> Met | None:
        """Find what is met first of these walls before `limit`; None when f > 0 on all of them up to it."""
        flight, last = self.flight, rational_ends(arb(limit))[1]
        roots: list[RootBracket] = []  # none of which certainly comes after another
        at_limit: list[Wall] = []
        for wall in walls:
            until = min((root.high for root in roots), default=last)
            found = first_root(flight, wall, begin, until)
            if isinstance(found, AtEnd) and roots:
                found = first_root(flight, wall, begin, last)  # it may fall with the one found: bracket it
            if isinstance(found, AtEnd) or (found is not None and self._is_at(found, limit)):
                if not self._vanishes_at(wall, limit):
                    raise OpenQuestion(f"{wall} may be met just at the end of the search, at this precision")
                at_limit.append(wall)
            elif found is not None and not any(root.high < found.low for root in roots):
                roots = [found, *(root for root in roots if not found.high < root.low)]
        earlier = [root for root in roots if not self._is_after(root, limit)]
        if earlier:
            return self._tied(earlier) if len(earlier) > 1 else Met(earlier[0].wall, earlier[0].time())
        return self._at_limit(at_limit, limit) if at_limit else None

    def _is_at(self, root: RootBracket, limit: Ball | Rational) -> bool:
        """Tell whether a root may be the limit itself."""
        if isinstance(limit, fmpq):
            return bool(root.low <= limit <= root.high)
        return not root.time() < arb(limit) and not root.time() > arb(limit)

    def _is_after(self, root: RootBracket, limit: Ball | Rational) -> bool:
        return bool(root.low > limit) if isinstance(limit, fmpq) else bool(root.time() > limit)

    def _vanishes_at(self, wall: Wall, limit: Ball | Rational) -> bool:
        return isinstance(limit, fmpq) and self.flight.is_zero(wall, limit)

    def _at_limit(self, walls: Sequence[Wall], limit: Ball | Rational) -> Met:
        """Walls that are met exactly at the limit: nothing before the horizon, or with the crossing."""
        if limit is self.end:
            return Met(None)
        is_edge = self.flight.table.is_mushroom and any(wall in ("left", "right") for wall in walls)
        return Met(None, reason="mouth-edge" if is_edge else "corner")

    def _tied(self, roots: list[RootBracket]) -> Met:
        low, high = max(root.low for root in roots), min(root.high for root in roots)
        if low <= high:
            instant = simplest(low, high)
            if all(self.flight.is_zero(root.wall, instant) for root in roots):
                return Met(None, reason="corner")
        raise OpenQuestion("two walls are met together, as far as this precision shows")


def simplest(low: Rational, high: Rational) -> Rational:
    """Return the rational of the least denominator in [low, high] (Stern and Brocot)."""
    whole = low.floor()
    if whole == low or whole + 1 <= high:
        return fmpq(whole) if whole == low else fmpq(whole) + 1
    return whole + 1 / simplest(1 / (high - whole), 1 / (low - whole))


def next_collision(scene: Scene, state: State, t_end: float, *, doublings: int = DOUBLINGS) -> Answer:
    """Find the first wall the particle meets after `state.t`.

    Args:
        scene: a valid scene; its numbers and those of the state are exact.
        state: position (x, y) [length], velocity (vx, vy) [length/time], wall being left or None.
        t_end: horizon [time], t_end >= state.t. A wall met exactly then is not met before it.
        doublings: how often the precision is doubled before the answer is undecided.

    Returns:
        The answer; `undefined` only where it is shown exactly.
    """
    return trajectory(scene, state, 1, t_end, doublings=doublings)[0]


def bits_for(scene: Scene, state: State) -> int:
    """Return a precision that tells apart the times of a step: the phase of a late start costs bits."""
    shared = period(scene)
    if shared is None or state.t == 0:
        return BITS
    late = math.frexp(abs(state.t))[1] - math.frexp(float(shared.value(fp)))[1]
    return BITS + max(late, 0)


def _answer(flight: SearchedFlight, met: Met, end: Ball | Rational | None, bits: int) -> Answer:
    if met.reason:
        return Answer("undefined", reason=met.reason, bits=bits)
    if met.wall is None:
        s = arb(end)
        return Answer("horizon", numbers=(s, *flight.place(s), flight.balls.vx, flight.balls.vy), bits=bits)
    numbers = bounced(flight, met.wall, met.time)
    found = Answer("collision", met.wall, numbers=numbers, bits=bits)
    if flight.state is not None:
        _require_reliable(numbers)
        found = found._replace(jacobian=jacobian(flight, met.wall, met.time))
    return found


def bounced(flight: SearchedFlight, wall: Wall, s: Ball) -> tuple[Ball, ...]:
    """Return dt, x, y, vx, vy after the bounce."""
    if not flight.jet(wall, s)[1] < 0:
        raise OpenQuestion(f"f' of {wall} has no sign where it is met")
    x, y = flight.place(s)
    return s, x, arb(0) if wall == "base" else y, *flight.reflected(wall, s)


def _require_reliable(numbers: tuple[Ball, ...]) -> None:
    dt, x, y, vx, vy = numbers
    for vector in ((dt,), (x, y), (vx, vy)):
        size = max(number.abs_upper() for number in vector)
        if any(number.rad() * arb(2) ** RELIABLE_BITS > size for number in vector):
            raise OpenQuestion("the answer is enclosed too widely")


def trajectory(
    scene: Scene, state: State, n_collisions: int, t_end: float | None = None, *, doublings: int = DOUBLINGS
) -> list[Answer]:
    """Follow a particle: its collisions, and last what came instead of one.

    Args:
        scene: a valid scene.
        state: the exact start.
        n_collisions: how many collisions to follow, >= 0.
        t_end: horizon [time], None for none.
        doublings: how often the precision is doubled; then the path ends where it is undecided.

    Returns:
        Answers in order. From the second on, steps start in balls: what is a tie there is undecided.
    """
    if refusal := start.refused(scene, state, state.t if t_end is None else t_end):
        return [refusal]
    bits, found = bits_for(scene, state), []
    for _ in range(doublings + 1):
        with precision(bits):
            found = _chain(scene, state, n_collisions, t_end, bits)
        if not found or found[-1].kind != "undecided":
            break
        bits *= 2
    return found


def _chain(scene: Scene, state: State, n_collisions: int, t_end: float | None, bits: int) -> list[Answer]:
    found: list[Answer] = []
    try:
        table = Table(scene)
        flight = SearchedFlight(table, line_of(state), state)
        begun = start.judge(flight, state)
        if isinstance(begun, Answer):
            return [begun._replace(bits=bits)]
        in_cap, along_mouth = begun.in_cap, begun.runs_along_mouth
        while len(found) < n_collisions:
            end = None if t_end is None else exact(t_end) - flight.line.t
            if end == 0:
                met = Met(None)
            else:
                search = Search(flight, in_cap=in_cap, end=end)
                met = search.along_mouth() if along_mouth else search.outcome()
            found.append(_answer(flight, met, end, bits))
            if met.wall is None:
                return found
            flight, in_cap = _following(flight, met.wall, found[-1].numbers), met.wall in ("arc", "base")
            in_cap, along_mouth = in_cap and not table.is_stem, False
    except OpenQuestion as question:
        found.append(Answer("undecided", reason=f"{question} ({bits} bits)", bits=bits))
    return found


def _following(flight: SearchedFlight, wall: Wall, numbers: tuple[Ball, ...]) -> SearchedFlight:
    """Return the flight after a bounce: the wall is left with the residual it was met with."""
    dt, *moved = numbers
    after = SearchedFlight(flight.table, Line(flight.balls.t + dt, *moved), None)
    after.leave(wall, flight.residuals.get(wall, arb(0)))
    return after
