"""The start of a path: its part of the table, the wall it leaves, or why it is refused."""

from decimal import Decimal
from fractions import Fraction

from reference import rational
from reference.arithmetic import Arithmetic, Interval, Undecidable, exact_ends, sign
from reference.course import SIDES, Course
from reference.prepared import PreparedTable
from reference.walls import EnclosedFlight, MovingWalls
from scene import InvalidState, State, Undefined, Wall
from scene.geometry import placed
from scene.states import ON_WALL


def depart(
    arithmetic: Arithmetic, table: PreparedTable, state: State, t_end: Fraction | None
) -> Course | Undefined:
    """Judge the starting state.

    Return the flight from it, or why mathematics gives no answer from there.

    Args:
        arithmetic: working precision.
        table: the scene, prepared.
        state: the exact start.
        t_end: horizon [time], exactly; None for none.

    Raises:
        InvalidState: the state is not in this table; naming field, value and bound.
        Undecidable: when this precision cannot tell.
    """
    _check_part(table, state)
    motion = motion_at(table, state, arithmetic)
    if state.wall is not None:
        _check_residual(table, state, motion)
    wall = _wall_left(table, state, motion)
    if isinstance(wall, Undefined):
        return wall
    leaving = {}
    is_flat = False
    if wall is not None:
        judged = _judge_rise(table, state, wall, motion)
        if isinstance(judged, Undefined):
            return judged
        leaving = {wall: motion.wall(wall, arithmetic.zero).f}
        is_flat = judged
    # New walls without cached values: the work of the flight then does not depend on the start.
    motion = motion_at(table, state, arithmetic)
    in_cap = _is_in_cap(table, state, leaving)
    end = None if t_end is None else t_end - motion.flight.instant
    return Course(table, motion, leaving, is_flat, in_cap, end, state)


def motion_at(table: PreparedTable, state: State, arithmetic: Arithmetic) -> MovingWalls:
    """Return the walls along the flight from a state."""
    numbers = (arithmetic.number(v) for v in (state.x, state.y, state.vx, state.vy))
    flight = EnclosedFlight._make((Fraction(state.t), *numbers, arithmetic.zero))
    return MovingWalls(arithmetic, table, flight)


def _is_in_cap(table: PreparedTable, state: State, leaving: dict[Wall, Interval]) -> bool:
    if not table.is_mushroom:
        return table.is_cap
    if "arc" in leaving or "base" in leaving:
        return True
    is_rising_in_mouth = state.y == 0 and state.vy > 0 and not leaving
    return state.y > 0 or is_rising_in_mouth


def _wall_left(table: PreparedTable, state: State, motion: MovingWalls) -> Wall | Undefined | None:
    """Find the wall that a state leaves, None for none; a place on two walls is undefined."""
    if _is_beside_mouth(table, state, motion):
        return _judge_on_base(table, state, motion)
    on = [wall for wall in _walls_near(table, state) if _is_on(table, state, wall, motion)]
    if state.wall is not None:
        on.append(state.wall)
    # A place on two walls is undefined whichever way it moves; a side ends at the mouth's edge.
    if table.is_mushroom and state.y == 0 and ("left" in on or "right" in on):
        return Undefined("mouth-edge")
    if len(on) > 1:
        return Undefined("corner")
    return on[0] if on else None


def _check_part(table: PreparedTable, state: State) -> None:
    """Refuse a mushroom's arc below y = 0 and its stem's walls above."""
    if not table.is_mushroom:
        return
    if state.wall == "arc" and state.y < 0:
        raise InvalidState(f"state.y = {state.y!r} on wall arc is beyond wall base, must be >= 0")
    if state.wall in SIDES and state.y > 0:
        raise InvalidState(
            f"state.y = {state.y!r} on wall {state.wall} is above the stem, must be <= 0"
        )


def _walls_near(table: PreparedTable, state: State) -> list[Wall]:
    """List the walls that bound the state's part of the table.

    In a mushroom the arc ends at the base.
    """
    if table.is_cap:
        return ["base", "arc"]
    if table.is_stem:
        return ["base", *SIDES]
    if state.wall == "arc" and state.y == 0:
        return ["base", "arc"]
    return ["arc"] if state.y > 0 or state.wall in ("arc", "base") else list(SIDES)


def _is_on(table: PreparedTable, state: State, wall: Wall, motion: MovingWalls) -> bool:
    """Tell whether an unnamed wall passes exactly through the state; refuse a state beyond it."""
    if wall == state.wall:
        return False
    side = sign(motion.wall(wall, motion.arithmetic.zero).f)
    if side < 0:
        raise InvalidState(placed(table.given, state, wall, "beyond"))
    if side == 0 and not rational.is_zero(table, state, wall, Fraction(0)):
        raise Undecidable(f"the state may be on wall {wall}")
    return side == 0


def _judge_on_base(table: PreparedTable, state: State, motion: MovingWalls) -> Undefined | None:
    """Judge a state on y = 0 that names no wall and is beyond the mouth's edge: it is on the base.

    The base ends at the arc. If the sign of the arc's f is open, the state may lie outside.
    """
    if _is_on(table, state, "arc", motion):
        return Undefined("corner")
    if state.vy < 0:
        raise InvalidState(
            f"state.vy = {state.vy!r}: the particle starts on wall base and moves into it"
        )
    return Undefined("sliding") if state.vy == 0 else None


def _is_beside_mouth(table: PreparedTable, state: State, motion: MovingWalls) -> bool:
    """Tell whether a state that names no wall lies on y = 0 beyond the mouth's edge."""
    if not table.is_mushroom or state.wall is not None or state.y != 0:
        return False
    return any(sign(motion.wall(wall, motion.arithmetic.zero).f) < 0 for wall in ("left", "right"))


def _judge_rise(
    table: PreparedTable, state: State, wall: Wall, motion: MovingWalls
) -> Undefined | bool:
    """Judge f' at the start on a wall: True if f' = 0 and f'' > 0, False if f' > 0."""
    jet = motion.wall(wall, motion.arithmetic.zero)
    rise = sign(jet.d1)
    if rise > 0:
        return False
    if rise < 0:
        raise InvalidState(
            f"state.wall = {wall!r}: the particle starts on this wall and moves into it"
        )
    exact = rational.wall_jet(table, state, wall, Fraction(0))
    if not exact.d1.is_zero():
        raise Undecidable("f' at the start has no sign")
    fraction = Fraction(0) if exact.d2.is_zero() else exact.d2.fraction()
    bend = sign(jet.d2 if fraction is None else motion.arithmetic.number(fraction))
    if bend == 0 and fraction is None:
        raise Undecidable("f'' at the start has no sign")
    if bend > 0:
        return True
    is_at_rest = table.cycle is None
    return Undefined("sliding" if bend < 0 or is_at_rest or wall == "base" else "tangency")


def _check_residual(table: PreparedTable, state: State, motion: MovingWalls) -> None:
    """Refuse a state too far from the wall it names, as measured by that wall's present size."""
    wall = state.wall
    zero = motion.arithmetic.zero
    assert wall is not None
    size = _distance_of(table, wall, motion)
    gap = motion.wall(wall, zero).f
    if wall == "arc":
        gap = gap / (2 * size)
    low, high = exact_ends(gap)
    least, largest = exact_ends(size)
    if wall in ("left", "right"):
        # If a stem is wider below, its side is as far from the axis as the state, and x rounds
        # accordingly.
        least, largest = (max(end, abs(Fraction(state.x))) for end in (least, largest))
    if max(-low, high) <= Fraction(ON_WALL) * least:
        return
    if max(low, -high) <= Fraction(ON_WALL) * largest:
        raise Undecidable(f"whether the state is on wall {wall} is open")
    # Decimal, because the gap may be too large for a float.
    shown = Decimal(low.numerator) / Decimal(low.denominator)
    raise InvalidState(f"state.wall = {wall!r}, but the state is {shown:.3g} away from that wall")


def _distance_of(table: PreparedTable, wall: Wall, motion: MovingWalls) -> Interval:
    """Return r for the arc and base, w for a side and the base of a stem, h for the floor."""
    zero = motion.arithmetic.zero
    if wall == "floor":
        return motion.law("h", zero).f
    if wall in ("left", "right") or table.is_stem:
        return motion.width(zero).f
    return motion.law("r", zero).f
