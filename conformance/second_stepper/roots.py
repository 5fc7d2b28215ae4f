"""The first time a wall's function falls through 0, by bisection with Taylor bounds.

Intervals are taken left first. One is passed when f > 0 on all of it: as it is enclosed, or by the expansion
about its middle, f(m) + f'(m) d + f'' d^2 / 2 with f'' over the interval (f' is Lipschitz, so this holds
across knots too). One on which f' < 0 and whose ends have opposite signs holds the root, the only one there.
Everything else is halved; where it is longer than a period, it is also passed when particles that rest where
it begins and ends are not met in a whole one. With laws held still f is concave along a flight, so that it is
above 0 between such places whatever the phase. From the wall being left f(0) = 0, and
f(s) >= s (f'(0) + s min f'' / 2).
"""

from __future__ import annotations

from typing import NamedTuple

from flint import arb, ctx, fmpq

from conformance.arb.numbers import Ball, Rational, hull, rational_ends
from conformance.second_stepper.answer import OpenQuestion
from conformance.second_stepper.flight import SearchedFlight
from scene import Wall

UNIT = arb(0, 1)  # the ball [-1, 1]
MAX_SPLITS = 500  # of a period, to see that a particle at rest is not met


class RootBracket(NamedTuple):
    """f falls through 0 somewhere in [low, high], for the first time; f' < 0 on all of it."""

    wall: Wall
    low: Rational
    high: Rational

    def time(self) -> Ball:
        """Return the ball around the root."""
        return hull(self.low, self.high)


class AtEnd(NamedTuple):
    """f > 0 up to [low, end]; there f' < 0, and the sign of f at the end is not known."""

    wall: Wall
    low: Rational


def first_root(
    flight: SearchedFlight, wall: Wall, start: Rational, end: Rational
) -> RootBracket | AtEnd | None:
    """Find the first root of f in [start, end].

    Args:
        flight: a straight flight.
        wall: one of the table's.
        start: flight time >= 0; at 0 the wall may be the one being left.
        end: flight time >= start.

    Returns:
        The root's bracket; AtEnd; or None: f > 0 on all of (start, end], and at `start` unless left there.

    Raises:
        OpenQuestion: at this precision neither is shown.
    """
    is_left = wall in flight.residuals and start == 0
    if not is_left and not flight.jet(wall, arb(start))[0] > 0:
        raise OpenQuestion(f"f of {wall} has no sign where a search begins")
    todo = [(start, end)] if start < end else []
    least = (end - start) / fmpq(2) ** (2 * ctx.prec)
    while todo:
        a, b = todo.pop()
        if is_left and a == start:
            if _lifts(flight, wall, b):
                continue
        else:
            found = _judged(flight, wall, a, b)
            if found == "positive":
                continue
            if found == "root":
                return _narrowed(flight, RootBracket(wall, a, b))
            if found == "unknown end":
                if not todo:
                    return AtEnd(wall, a)
                # The root lies at b as far as can be seen: cut the two intervals elsewhere.
                c = todo.pop()[1]
                cut = a + (c - a) * fmpq(5, 16)
                todo += [(cut, c), (a, cut)]
                if b - a < least:
                    raise OpenQuestion(f"f of {wall} has no sign near {float(b.p) / float(b.q)!r}")
                continue
        if is_never_swept(flight, wall, a, b):
            continue
        if b - a < least:
            raise OpenQuestion(f"f and f' of {wall} vanish together, as far as this precision shows")
        middle = (a + b) / 2
        todo += [(middle, b), (a, middle)]
    return None


def is_never_swept(flight: SearchedFlight, wall: Wall, a: Rational, b: Rational) -> bool:
    """Tell whether a wall never comes to where a flight is at a, nor to where it is at b, a period later."""
    turn = flight.table.turn
    if turn is None or b - a < turn:
        return False
    return all(_is_never_met(flight.resting(wall, s), wall, turn) for s in (b, a))


def _is_never_met(still: SearchedFlight, wall: Wall, turn: Rational) -> bool:
    todo = [(fmpq(0), turn)]
    for _ in range(MAX_SPLITS):
        if not todo:
            return True
        a, b = todo.pop()
        found = _judged(still, wall, a, b) if still.jet(wall, arb(a))[0] > 0 else "met"
        if found not in ("positive", "open"):
            return False
        if found == "open":
            todo += [((a + b) / 2, b), (a, (a + b) / 2)]
    return False


def _lifts(flight: SearchedFlight, wall: Wall, b: Rational) -> bool:
    """Tell whether f - f(0) > 0 on (0, b], from the wall being left."""
    slope = flight.jet(wall, arb(0))[1]
    _, rates, bends = flight.over(wall, fmpq(0), b)
    if rates > 0 or (wall in flight.flat and bends > 0):
        return True
    return bool(slope > 0 and slope + arb(b) * bends / 2 > 0)


def _judged(flight: SearchedFlight, wall: Wall, a: Rational, b: Rational) -> str:
    """Judge [a, b], f(a) > 0: positive, root, unknown end, or open."""
    values, rates, bends = flight.over(wall, a, b)
    if values > 0:
        return "positive"
    middle, reach = (a + b) / 2, arb((b - a) / 2) * UNIT
    value, rate, _ = flight.jet(wall, arb(middle))
    square = arb((b - a) ** 2 / 8) * (arb(1, 1) / 2)  # reach^2 / 2, never below 0
    spread = rate * reach + bends * square
    if value + spread > 0:
        return "positive"
    if value.contains(0) and value.rad() > spread.abs_upper():
        raise OpenQuestion(f"f of {wall} is lost in rounding where f' vanishes too")
    if not (rates < 0 or rate + bends * reach < 0):
        is_rising = rates > 0 or rate + bends * reach > 0
        return "positive" if is_rising else "open"
    last = flight.jet(wall, arb(b))[0]
    return "positive" if last > 0 else "root" if last < 0 else "unknown end"


def _narrowed(flight: SearchedFlight, root: RootBracket) -> RootBracket:
    """Narrow a root's bracket as far as the precision goes: by sign at points, by the mean value theorem."""
    wall, low, high = root
    for _ in range(2 * ctx.prec):
        width = high - low
        middle = (low + high) / 2
        value = flight.jet(wall, arb(middle))[0]
        rates = flight.over(wall, low, high)[1]
        # By the sign of f; and where f' keeps its own as enclosed, by Newton: far quicker, or no help.
        low, high = (middle, high) if value > 0 else (low, middle) if value < 0 else (low, high)
        if rates < 0:
            first, last = rational_ends(arb(middle) - value / rates)
            low, high = max(low, first), min(high, last)
            if low > high:
                raise OpenQuestion(f"the root of {wall} is lost")
        if 4 * (high - low) > 3 * width:
            break
    return RootBracket(wall, low, high)
