"""The starting state: in which part of the table it is, which walls it leaves, or why it is refused."""

from __future__ import annotations

from fractions import Fraction

from reference import rational
from reference.arithmetic import Arithmetic, Interval, Undecidable, sign
from reference.course import SIDES
from reference.jets import Flight, Motion
from scene import Cap, InvalidState, Mushroom, Scene, State, Stem, Undefined, Wall
from scene.laws import bounds, is_constant, piece_at
from scene.states import ON_WALL
from scene.tables import laws


def flight_from(arithmetic: Arithmetic, state: State) -> Flight:
    """Return the flight of a state, exactly."""
    return Flight(*(arithmetic.number(v) for v in (state.t, state.x, state.y, state.vx, state.vy)))


def is_in_cap(scene: Scene, state: State, leaving: dict[Wall, Interval]) -> bool:
    """Tell whether the flight begins in the cap."""
    if not isinstance(scene, Mushroom):
        return isinstance(scene, Cap)
    if "arc" in leaving or "base" in leaving:
        return True
    is_rising_in_mouth = state.y == 0 and state.vy > 0 and not leaving
    return state.y > 0 or is_rising_in_mouth


def judge_start(
    scene: Scene, state: State, arithmetic: Arithmetic
) -> tuple[dict[Wall, Interval], frozenset[Wall]] | Undefined:
    """Judge the starting state: which walls it leaves, or why it is none of this table."""
    _check_part(scene, state)
    motion = motion_at(scene, state, arithmetic)
    on = [wall for wall in _walls_near(scene, state) if _is_on(scene, state, wall, motion)]
    if state.vy == 0 and _is_beside_mouth(scene, state, motion):
        return Undefined("sliding")  # along the base
    if state.wall is not None and state.wall not in on:
        on.append(state.wall)
        _check_residual(scene, state, motion)
    leaving: dict[Wall, Interval] = {}
    flat: set[Wall] = set()
    for wall in on:
        judged = _departure(scene, state, wall, motion)
        if isinstance(judged, Undefined):
            return judged
        leaving[wall] = motion.wall(wall, arithmetic.zero).f
        if judged:
            flat.add(wall)
    if len(leaving) > 1:
        return Undefined("corner")
    return leaving, frozenset(flat)


def _check_part(scene: Scene, state: State) -> None:
    """Refuse a mushroom's arc below y = 0 and its stem's walls above."""
    if not isinstance(scene, Mushroom):
        return
    if state.wall == "arc" and state.y < 0:
        raise InvalidState(f"state.y = {state.y!r} on wall arc is beyond wall base, must be >= 0")
    if state.wall in SIDES and state.y > 0:
        raise InvalidState(f"state.y = {state.y!r} on wall {state.wall} is above the stem, must be <= 0")


def motion_at(scene: Scene, state: State, arithmetic: Arithmetic) -> Motion:
    """Return the walls as they move just after the time of the state."""
    pieces = {name: piece_at(law, Fraction(state.t)) for name, law in laws(scene).items()}
    return Motion(arithmetic, flight_from(arithmetic, state), pieces, is_stem=isinstance(scene, Stem))


def _walls_near(scene: Scene, state: State) -> list[Wall]:
    """List the walls that bound the part of the table the state is in."""
    if isinstance(scene, Cap):
        return ["base", "arc"]
    if isinstance(scene, Stem):
        return ["base", *SIDES]
    if state.y > 0 or state.wall in ("arc", "base"):
        return ["arc"]
    return list(SIDES)


def _is_on(scene: Scene, state: State, wall: Wall, motion: Motion) -> bool:
    """Tell whether an unnamed wall passes exactly through the state; refuse a state beyond it."""
    if wall == state.wall:
        return False
    side = sign(motion.wall(wall, motion.arithmetic.zero).f)
    if isinstance(scene, Mushroom) and state.y == 0 and wall in ("left", "right") and side < 0:
        # Level with the mouth but beside it: on the base, which belongs to the cap.
        return _is_on_base(scene, state, motion)
    if side < 0:
        raise InvalidState(
            f"state (x, y) = ({state.x!r}, {state.y!r}) at t = {state.t!r} is beyond wall {wall}"
        )
    if side == 0 and not rational.is_zero(scene, state, wall, Fraction(0)):
        raise Undecidable(f"the state may be on wall {wall}")
    return side == 0


def _is_on_base(scene: Mushroom, state: State, motion: Motion) -> bool:
    if sign(motion.wall("arc", motion.arithmetic.zero).f) < 0:
        raise InvalidState(f"state (x, y) = ({state.x!r}, 0) at t = {state.t!r} is beyond wall arc")
    if state.vy < 0:
        raise InvalidState(f"state.vy = {state.vy!r}: the particle starts on wall base and moves into it")
    return False


def _is_beside_mouth(scene: Scene, state: State, motion: Motion) -> bool:
    """Tell whether a state that names no wall lies on y = 0 beyond the mouth's edge."""
    if not isinstance(scene, Mushroom) or state.wall is not None or state.y != 0:
        return False
    return any(sign(motion.wall(wall, motion.arithmetic.zero).f) < 0 for wall in ("left", "right"))


def _departure(scene: Scene, state: State, wall: Wall, motion: Motion) -> Undefined | bool:
    """Judge f' at the start on a wall: True when it is flat there but lifts, False when it rises."""
    jet = motion.wall(wall, motion.arithmetic.zero)
    rise = sign(jet.d1) if jet.d1 is not None else 0
    if rise > 0:
        return False
    if rise < 0:
        raise InvalidState(f"state.wall = {wall!r}: the particle starts on this wall and moves into it")
    exact = rational.wall_jet(scene, state, wall, Fraction(0))
    if exact is None or exact[1] != 0:
        raise Undecidable("f' at the start has no sign")
    if exact[2] > 0:
        return True
    is_at_rest = all(is_constant(law) for law in laws(scene).values())
    return Undefined("sliding" if exact[2] < 0 or is_at_rest or wall == "base" else "tangency")


def _check_residual(scene: Scene, state: State, motion: Motion) -> None:
    wall = state.wall
    assert wall is not None
    tops = {name: bounds(law).highest for name, law in laws(scene).items()}
    size = tops.get("h", 0.0) if wall == "floor" else max(tops.get("r", 0.0), tops.get("w", 0.0))
    gap = float(motion.arithmetic.enclosure(motion.wall(wall, motion.arithmetic.zero).f))
    if wall == "arc":
        gap /= 2 * size
    if abs(gap) > ON_WALL * size:
        raise InvalidState(f"state.wall = {wall!r}, but the state is {gap:.3g} away from that wall")
