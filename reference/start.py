"""The starting state: in which part of the table it is, which walls it leaves, or why it is refused."""

from __future__ import annotations

from decimal import Decimal
from fractions import Fraction
from typing import NamedTuple

from reference import rational
from reference.arithmetic import Arithmetic, Interval, Undecidable, exact_ends, sign
from reference.course import SIDES
from reference.walls import EnclosedFlight, MovingWalls
from scene import Cap, InvalidState, Mushroom, Scene, State, Stem, Undefined, Wall
from scene.geometry import placed
from scene.laws import is_constant
from scene.states import ON_WALL
from scene.tables import laws


class JudgedStart(NamedTuple):
    """A judged start.

    Attributes:
        leaving: the wall the particle is on, with its residual f(0); at most one.
        flat: that wall when f'(0) = 0 and f''(0) > 0, both exactly.
        undefined: why mathematics gives no answer from here; None when it does.
        walls: those at which the start is undefined.
    """

    leaving: dict[Wall, Interval]
    flat: frozenset[Wall] = frozenset()
    undefined: Undefined | None = None
    walls: tuple[Wall, ...] = ()


def flight_from(arithmetic: Arithmetic, state: State) -> EnclosedFlight:
    """Return the flight of a state, exactly."""
    numbers = (arithmetic.number(v) for v in (state.x, state.y, state.vx, state.vy))
    return EnclosedFlight._make((Fraction(state.t), *numbers, arithmetic.zero))


def is_in_cap(scene: Scene, state: State, leaving: dict[Wall, Interval]) -> bool:
    """Tell whether the flight begins in the cap."""
    if not isinstance(scene, Mushroom):
        return isinstance(scene, Cap)
    if "arc" in leaving or "base" in leaving:
        return True
    is_rising_in_mouth = state.y == 0 and state.vy > 0 and not leaving
    return state.y > 0 or is_rising_in_mouth


def judge_start(scene: Scene, state: State, arithmetic: Arithmetic) -> JudgedStart:
    """Judge the starting state: which walls it leaves, or why it is none of this table.

    Raises:
        InvalidState: naming field, value and bound.
        Undecidable: when this precision cannot tell.
    """
    _check_part(scene, state)
    motion = motion_at(scene, state, arithmetic)
    if state.wall is not None:
        _check_residual(scene, state, motion)
    if _is_beside_mouth(scene, state, motion):
        return _judge_on_base(scene, state, motion)
    on = [wall for wall in _walls_near(scene, state) if _is_on(scene, state, wall, motion)]
    if state.wall is not None:
        on.append(state.wall)
    # A place on two walls is undefined whichever way it moves; a side ends at the mouth's edge.
    if isinstance(scene, Mushroom) and state.y == 0 and ("left" in on or "right" in on):
        return JudgedStart({}, undefined=Undefined("mouth-edge"), walls=tuple(on))
    if len(on) > 1:
        return JudgedStart({}, undefined=Undefined("corner"), walls=tuple(on))
    for wall in on:
        judged = _departure(scene, state, wall, motion)
        if isinstance(judged, Undefined):
            return JudgedStart({}, undefined=judged, walls=(wall,))
        residual = motion.wall(wall, arithmetic.zero).f
        return JudgedStart({wall: residual}, frozenset({wall} if judged else ()))
    return JudgedStart({})


def _check_part(scene: Scene, state: State) -> None:
    """Refuse a mushroom's arc below y = 0 and its stem's walls above."""
    if not isinstance(scene, Mushroom):
        return
    if state.wall == "arc" and state.y < 0:
        raise InvalidState(f"state.y = {state.y!r} on wall arc is beyond wall base, must be >= 0")
    if state.wall in SIDES and state.y > 0:
        raise InvalidState(f"state.y = {state.y!r} on wall {state.wall} is above the stem, must be <= 0")


def motion_at(scene: Scene, state: State, arithmetic: Arithmetic) -> MovingWalls:
    """Return the walls along the flight from a state."""
    return MovingWalls(arithmetic, scene, flight_from(arithmetic, state))


def _walls_near(scene: Scene, state: State) -> list[Wall]:
    """List the walls that bound the state's part of the table; in a mushroom the arc ends at the base."""
    if isinstance(scene, Cap):
        return ["base", "arc"]
    if isinstance(scene, Stem):
        return ["base", *SIDES]
    if state.wall == "arc" and state.y == 0:
        return ["base", "arc"]
    return ["arc"] if state.y > 0 or state.wall in ("arc", "base") else list(SIDES)


def _is_on(scene: Scene, state: State, wall: Wall, motion: MovingWalls) -> bool:
    """Tell whether an unnamed wall passes exactly through the state; refuse a state beyond it."""
    if wall == state.wall:
        return False
    side = sign(motion.wall(wall, motion.arithmetic.zero).f)
    if side < 0:
        raise InvalidState(placed(scene, state, wall, "beyond"))
    if side == 0 and not rational.is_zero(scene, state, wall, Fraction(0)):
        raise Undecidable(f"the state may be on wall {wall}")
    return side == 0


def _judge_on_base(scene: Scene, state: State, motion: MovingWalls) -> JudgedStart:
    """Judge a state that names no wall, level with the mouth but beside it: on the base, which is the cap's.

    The base ends at the arc. A sign of the arc's f that is open is no sign: the state may lie beyond.
    """
    if _is_on(scene, state, "arc", motion):
        return JudgedStart({}, undefined=Undefined("corner"), walls=("arc", "base"))
    if state.vy < 0:
        raise InvalidState(f"state.vy = {state.vy!r}: the particle starts on wall base and moves into it")
    if state.vy == 0:
        return JudgedStart({}, undefined=Undefined("sliding"), walls=("base",))
    return JudgedStart({})


def _is_beside_mouth(scene: Scene, state: State, motion: MovingWalls) -> bool:
    """Tell whether a state that names no wall lies on y = 0 beyond the mouth's edge."""
    if not isinstance(scene, Mushroom) or state.wall is not None or state.y != 0:
        return False
    return any(sign(motion.wall(wall, motion.arithmetic.zero).f) < 0 for wall in ("left", "right"))


def _departure(scene: Scene, state: State, wall: Wall, motion: MovingWalls) -> Undefined | bool:
    """Judge f' at the start on a wall: True when it is flat there but lifts, False when it rises."""
    jet = motion.wall(wall, motion.arithmetic.zero)
    rise = sign(jet.d1) if jet.d1 is not None else 0
    if rise > 0:
        return False
    if rise < 0:
        raise InvalidState(f"state.wall = {wall!r}: the particle starts on this wall and moves into it")
    exact = rational.wall_jet(scene, state, wall, Fraction(0))
    if not exact.d1.is_zero():
        raise Undecidable("f' at the start has no sign")
    fraction = Fraction(0) if exact.d2.is_zero() else exact.d2.fraction()
    bend = sign(jet.d2 if fraction is None else motion.arithmetic.number(fraction))
    if bend == 0 and fraction is None:
        raise Undecidable("f'' at the start has no sign")
    if bend > 0:
        return True
    is_at_rest = all(is_constant(law) for law in laws(scene).values())
    return Undefined("sliding" if bend < 0 or is_at_rest or wall == "base" else "tangency")


def _check_residual(scene: Scene, state: State, motion: MovingWalls) -> None:
    """Refuse a state too far from the wall it names, as measured by that wall's present size."""
    wall, zero = state.wall, motion.arithmetic.zero
    assert wall is not None
    size = _distance_of(scene, wall, motion)
    gap = motion.wall(wall, zero).f
    if wall == "arc":
        gap = gap / (2 * size)
    low, high = exact_ends(gap)
    least, largest = exact_ends(size)
    if wall in ("left", "right"):
        # Where a stem is wider below, its side is as far from the axis as the state, and x rounds with that.
        least, largest = (max(end, abs(Fraction(state.x))) for end in (least, largest))
    if max(-low, high) <= Fraction(ON_WALL) * least:
        return
    if max(low, -high) <= Fraction(ON_WALL) * largest:
        raise Undecidable(f"whether the state is on wall {wall} is open")
    # Decimal, because the gap may be too large for a float.
    shown = Decimal(low.numerator) / Decimal(low.denominator)
    raise InvalidState(f"state.wall = {wall!r}, but the state is {shown:.3g} away from that wall")


def _distance_of(scene: Scene, wall: Wall, motion: MovingWalls) -> Interval:
    """Return r for the arc, w for a side, h for the floor, the larger of r and w for the base, now."""
    zero = motion.arithmetic.zero
    if wall == "floor":
        return motion.law("h", zero).f
    if wall in ("left", "right") or isinstance(scene, Stem):
        return motion.width(zero).f
    return motion.law("r", zero).f
