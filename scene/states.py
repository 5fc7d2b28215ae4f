"""States of a particle and outcomes of a step, in the form they have on the wire."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import msgspec

from scene.refusal import BadInput, check_number, shown
from scene.tables import Scene, Wall, check_scene


class InvalidState(BadInput):
    """A state that is invalid in its scene: one line naming field, value and bound."""


class State(msgspec.Struct, frozen=True, gc=False, forbid_unknown_fields=True):
    """A particle in flight.

    `wall` names the wall that the particle is leaving, or is None. The particle is on that wall by
    definition: the residual of (x, y) is subtracted from the wall's f, so rounding yields no false
    hit.
    """

    t: float
    x: float
    y: float
    vx: float
    vy: float
    wall: Wall | None = None


class Collision(msgspec.Struct, frozen=True, gc=False, tag_field="outcome", tag="collision"):
    """The first wall met, the flight time dt, and the state just after the bounce."""

    wall: Wall
    dt: float
    t: float
    x: float
    y: float
    vx: float
    vy: float

    def state(self) -> State:
        """Return the state from which the next step starts."""
        return State(self.t, self.x, self.y, self.vx, self.vy, self.wall)


class Horizon(msgspec.Struct, frozen=True, gc=False, tag_field="outcome", tag="horizon"):
    """No collision before t_end; the state there. A collision exactly at t_end is not before it."""

    t: float
    x: float
    y: float
    vx: float
    vy: float


class Undefined(msgspec.Struct, frozen=True, gc=False, tag_field="outcome", tag="undefined"):
    """Mathematics gives no answer."""

    reason: Literal["corner", "tangency", "sliding", "mouth-edge"]


class Undecided(msgspec.Struct, frozen=True, gc=False, tag_field="outcome", tag="undecided"):
    """This stepper could not decide; it does not guess."""

    reason: str


class Rejected(msgspec.Struct, frozen=True, gc=False, tag_field="outcome", tag="rejected"):
    """Bad input, with the reason."""

    reason: str


Outcome = Collision | Horizon | Undefined | Undecided | Rejected
Stepper = Callable[[Scene, State, float], Outcome]  # (scene, state, t_end): what comes first

# A state on a wall whose residual exceeds this share of the wall's size is
# not on that wall: coordinates rounded to binary64 are on it to about 2^-50, and to 2^-20 even
# when the time alone (t = 1e9) rounds by 1e-7.
ON_WALL = 2.0**-20


def check_numbers(scene: Scene, state: State, t_end: float) -> State:
    """Refuse arguments that are no question, before any arithmetic; return the state in floats.

    Args:
        scene: the table.
        state: position [length], velocity [length/time], time.
        t_end: horizon [time].

    Raises:
        BadInput: `scene` is not a scene.
        InvalidState: naming field, value and bound.
    """
    check_scene(scene)
    if not isinstance(state, State):
        raise InvalidState(f"state = {shown(state)}, must be a State")
    t, x, y, vx, vy = (
        check_number(f"state.{field}", getattr(state, field), InvalidState)
        for field in ("t", "x", "y", "vx", "vy")
    )
    if check_number("t_end", t_end, InvalidState) < t:
        raise InvalidState(f"t_end = {t_end!r}, must be >= state.t = {t!r}")
    # Of an array, `in` alone would ask for its truth.
    if state.wall is not None and not (isinstance(state.wall, str) and state.wall in scene.walls):
        raise InvalidState(
            f"state.wall = {shown(state.wall)}, must be null or one of {', '.join(scene.walls)}"
        )
    return State(t, x, y, vx, vy, state.wall)
