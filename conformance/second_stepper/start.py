"""Starting states: which part of the table they are in, which wall they leave, or why they are refused.

A state that names a wall is on it by definition, if its rounding allows that. Its place may lie exactly on a
second wall of its part of the table: that is a corner, whichever way it moves; a mushroom's sides end at the
mouth's edge. A state that names the base is in the cap, wherever the mouth's edge is by now. A state that
names none leaves a wall that passes exactly through it.
"""

from __future__ import annotations

from functools import reduce
from typing import NamedTuple

from flint import arb, fmpq

from conformance.second_stepper.answer import Answer, Open
from conformance.second_stepper.flight import SIDES, Flight, Table
from conformance.second_stepper.law_balls import ExactJet, Rational, exact, product
from scene import InvalidState, Scene, State, Wall
from scene.states import ON_WALL, check_numbers


class Start(NamedTuple):
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


def judge(flight: Flight, state: State) -> Start | Answer:
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
    return Start(in_cap)


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


def _in_mouth(flight: Flight, state: State) -> Start | Answer:
    """Judge a state on y = 0 that names no wall: in the mouth, at its edge, or on the base beside it."""
    signs = [_sign(flight, wall) for wall in ("left", "right")]
    if 0 in signs:
        return Answer("undefined", reason="mouth-edge")
    if -1 not in signs:
        if state.vy == 0:
            return Start(in_cap=False, runs_along_mouth=True)
        return Start(in_cap=state.vy > 0)
    side = _sign(flight, "arc")
    if side < 0:
        return Answer("rejected", reason="the state is beyond wall arc")
    if state.vy < 0:
        return Answer("rejected", reason="the particle starts on wall base and moves into it")
    if side == 0 or state.vy == 0:
        return Answer("undefined", reason="sliding" if state.vy == 0 else "corner")
    flight.leave("base")
    return Start(in_cap=True)


def _leaves(flight: Flight, state: State, near: tuple[Wall, ...]) -> Answer | None:
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
        if not _is_near(flight, state, state.wall):
            return Answer("rejected", reason=f"the state is not on wall {state.wall}")
        on.append(state.wall)
    if len(on) > 1:
        sides = flight.table.is_mushroom and any(wall in on for wall in ("left", "right"))
        is_edge = sides and "base" in on
        return Answer("undefined", reason="mouth-edge" if is_edge else "corner")
    for wall in on:
        if refused := _departs(flight, state, wall):
            return refused
    return None


def _sign(flight: Flight, wall: Wall) -> int:
    """Return the sign of f at the start; 0 only where it is exactly 0."""
    value = flight.jet(wall, arb(0))[0]
    if value > 0:
        return 1
    if value < 0:
        return -1
    if flight.is_zero(wall, fmpq(0)):
        return 0
    raise Open(f"the state may be on wall {wall}")


def _is_near(flight: Flight, state: State, wall: Wall) -> bool:
    """Tell whether a state is on the wall it names but for rounding, by the table's sizes of that moment."""
    gap, time = flight.jet(wall, arb(0))[0], arb(exact(state.t))
    if wall == "floor":
        size = flight.table.laws["h"].jet(time)[0]
    elif wall in ("left", "right") or flight.table.is_stem:
        size = flight.width(time)[0]
    else:
        size = flight.table.laws["r"].jet(time)[0]
    bound = size * arb(ON_WALL) * (2 * size if wall == "arc" else 1)
    if gap < bound and -gap < bound:
        return True
    if gap > bound or -gap > bound:
        return False
    raise Open(f"whether the state is on wall {wall} is open")


def _departs(flight: Flight, state: State, wall: Wall) -> Answer | None:
    """Take out f(0) and judge f'(0)."""
    flight.leave(wall)
    rise = flight.jet(wall, arb(0))[1]
    if rise > 0:
        return None
    if rise < 0:
        return Answer("rejected", reason=f"the particle starts on wall {wall} and moves into it")
    jet = _exact_rates(flight, state, wall)
    if jet is None or jet[0] != 0:
        raise Open("f' at the start has no sign")
    if jet[1] > 0:
        flight.flat.add(wall)
        return None
    is_still = all(law.range()[0].overlaps(law.range()[1]) for law in flight.table.laws.values())
    return Answer("undefined", reason="sliding" if jet[1] < 0 or is_still or wall == "base" else "tangency")


def _exact_rates(flight: Flight, state: State, wall: Wall) -> tuple[fmpq, fmpq] | None:
    """Return f' and f'' just after the start where they are known to be rational."""
    table, time = flight.table, exact(state.t)
    x, y, vx, vy = (exact(getattr(state, name)) for name in ("x", "y", "vx", "vy"))
    if wall == "base":
        return (-vy if table.is_stem else vy), fmpq(0)
    jets = {name: law.exact_jet(time) for name, law in table.laws.items()}
    if wall == "arc":
        r = jets["r"]
        if r is None:
            return None
        return 2 * (r[0] * r[1] - x * vx - y * vy), 2 * (r[1] ** 2 + r[0] * r[2] - vx * vx - vy * vy)
    if wall == "floor":
        h = jets["h"]
        return None if h is None else (vy + h[1], h[2])
    across, slope = jets.get("w") or _exact_product(table, time), jets["slope"]
    if slope is None or across is None:
        return None
    along = vx if wall == "left" else -vx
    return across[1] + slope[1] * y + slope[0] * vy + along, across[2] + slope[2] * y + 2 * slope[1] * vy


def _exact_product(table: Table, time: Rational) -> ExactJet | None:
    jets = [law.exact_jet(time) for law in table.width]
    known = [jet for jet in jets if jet is not None]
    found: ExactJet = reduce(product, known, (fmpq(1), fmpq(0), fmpq(0)))
    return found if len(known) == len(jets) else None
