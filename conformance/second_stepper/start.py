"""Starting states: which part of the table they are in, which wall they leave, or why they are refused.

A state that names a wall is on it by definition, if its rounding allows that. Its place may lie exactly on a
second wall of its part of the table: that is a corner, whichever way it moves; a mushroom's sides end at the
mouth's edge. A state that names the base is in the cap, wherever the mouth's edge is by now. A state that
names none leaves a wall that passes exactly through it.
"""

from __future__ import annotations

from typing import NamedTuple

from flint import arb, fmpq

from conformance.arb.flight import SIDES, Table
from conformance.arb.numbers import ZERO
from conformance.second_stepper.answer import Answer, OpenQuestion
from conformance.second_stepper.flight import SearchedFlight
from scene import InvalidState, Scene, State, Wall
from scene.laws import is_constant
from scene.states import ON_WALL, check_numbers
from scene.tables import laws


class Beginning(NamedTuple):
    """A flight that may begin: its part of the table, and whether it runs along the mouth."""

    in_cap: bool
    runs_along_mouth: bool = False


def refused(scene: Scene, state: State, t_end: float) -> Answer | None:
    """Refuse numbers that mean no state at all."""
    try:
        check_numbers(scene, state, t_end)
    except InvalidState as error:
        return Answer("rejected", reason=str(error))
    return None


def judge(flight: SearchedFlight, state: State) -> Beginning | Answer:
    """Judge a starting state; the wall it leaves has its residual taken out of the flight's walls."""
    if refusal := _misplaced(flight.table, state):
        return Answer("rejected", reason=refusal)
    if flight.table.is_mushroom and state.wall is None and state.y == 0:
        return _in_mouth(flight, state)
    in_cap = not flight.table.is_stem and (state.wall in ("arc", "base") or state.y > 0)
    if not flight.table.is_mushroom:
        in_cap = not flight.table.is_stem
    if refused := _leaves(flight, state, _near(flight.table, state, in_cap=in_cap)):
        return refused
    return Beginning(in_cap)


def _misplaced(table: Table, state: State) -> str:
    if table.is_mushroom and state.wall == "arc" and state.y < 0:
        return f"state.y = {state.y!r} on wall arc must be >= 0"
    if table.is_mushroom and state.wall in SIDES and state.y > 0:
        return f"state.y = {state.y!r} on wall {state.wall} must be <= 0"
    return ""


def _near(table: Table, state: State, *, in_cap: bool) -> tuple[Wall, ...]:
    if in_cap:
        return ("arc", "base")
    return ("base", *SIDES)


def _in_mouth(flight: SearchedFlight, state: State) -> Beginning | Answer:
    """Judge a state on y = 0 that names no wall: in the mouth, at its edge, or on the base beside it."""
    signs = [_sign(flight, wall) for wall in ("left", "right")]
    if 0 in signs:
        return Answer("undefined", reason="mouth-edge")
    if -1 not in signs:
        if state.vy == 0:
            return Beginning(in_cap=False, runs_along_mouth=True)
        return Beginning(in_cap=state.vy > 0)
    side = _sign(flight, "arc")
    if side < 0:
        return Answer("rejected", reason="the state is beyond wall arc")
    if side == 0:
        return Answer("undefined", reason="corner")
    if state.vy < 0:
        return Answer("rejected", reason="the particle starts on wall base and moves into it")
    if state.vy == 0:
        return Answer("undefined", reason="sliding")
    flight.leave("base")
    return Beginning(in_cap=True)


def _leaves(flight: SearchedFlight, state: State, near: tuple[Wall, ...]) -> Answer | None:
    on: list[Wall] = []
    for wall in near:
        if wall == state.wall:
            continue
        if wall == "base" and flight.table.is_mushroom:
            # Of the base a particle in cap or stem only sees y = 0, where it is a corner or the mouth's edge.
            if state.y == 0:
                on.append(wall)
            continue
        side = _sign(flight, wall)
        if side < 0:
            return Answer("rejected", reason=f"the state is beyond wall {wall}")
        if side == 0:
            on.append(wall)
    if state.wall is not None:
        if not _is_near(flight, state.wall):
            return Answer("rejected", reason=f"the state is not on wall {state.wall}")
        on.append(state.wall)
    if len(on) > 1:
        sides = flight.table.is_mushroom and any(wall in on for wall in ("left", "right"))
        is_edge = sides and "base" in on
        return Answer("undefined", reason="mouth-edge" if is_edge else "corner")
    for wall in on:
        if refused := _departs(flight, wall):
            return refused
    return None


def _sign(flight: SearchedFlight, wall: Wall) -> int:
    """Return the sign of f at the start; 0 only where it is exactly 0."""
    value = flight.jet(wall, arb(0))[0]
    if value > 0:
        return 1
    if value < 0:
        return -1
    if flight.is_zero(wall, ZERO):
        return 0
    raise OpenQuestion(f"the state may be on wall {wall}")


def _is_near(flight: SearchedFlight, wall: Wall) -> bool:
    """Tell whether a state is on the wall it names but for rounding, by the table's sizes of that moment."""
    now = arb(0)
    gap = flight.jet(wall, now)[0]
    if wall == "floor":
        size = flight.law("h", now)[0]
    elif wall in ("left", "right") or flight.table.is_stem:
        size = flight.width(now)[0]
        if wall != "base":
            size = size.max(abs(flight.balls.x))
    else:
        size = flight.law("r", now)[0]
    bound = size * arb(ON_WALL) * (2 * size if wall == "arc" else 1)
    if gap < bound and -gap < bound:
        return True
    if gap > bound or -gap > bound:
        return False
    raise OpenQuestion(f"whether the state is on wall {wall} is open")


def _departs(flight: SearchedFlight, wall: Wall) -> Answer | None:
    """Take out f(0) and judge f'(0)."""
    flight.leave(wall)
    rise = flight.jet(wall, arb(0))[1]
    if rise > 0:
        return None
    if rise < 0:
        return Answer("rejected", reason=f"the particle starts on wall {wall} and moves into it")
    _, rise, bend = flight.jet(wall, ZERO)  # rationals, where they are known to be
    if not (isinstance(rise, fmpq) and isinstance(bend, fmpq) and rise == 0):
        raise OpenQuestion("f' at the start has no sign")
    if bend > 0:
        flight.flat.add(wall)
        return None
    is_still = all(map(is_constant, laws(flight.table.scene).values()))
    return Answer("undefined", reason="sliding" if bend < 0 or is_still or wall == "base" else "tangency")
