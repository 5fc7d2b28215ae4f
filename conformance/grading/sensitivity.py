"""What honest rounding may do to a step, measured on the stepper itself by finite nudges.

A stepper whose backward error is `bound` gives the exact answer to a question off by `bound` of each input,
itself off by `bound` of each output. How far that moves the answer, to first order, follows from the
answers to nudged questions. Where a nudge changes the outcome or the wall, the question is delicate
and nothing is said about it.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot
from typing import NamedTuple

from msgspec.structs import replace

from scene import Collision, Horizon, Outcome, Scene, State
from scene.laws import bounds
from scene.states import Stepper
from scene.tables import laws

Numbers = tuple[float, ...]
NUDGE = 2.0**-26  # relative: the differences of central differences then keep half of binary64's digits
INPUTS = ("t", "x", "y", "vx", "vy")


class MeasuredStep(NamedTuple):
    """An answer and what rounding may move it by: dt, t, x, y, vx, vy each."""

    outcome: Collision | Horizon
    numbers: Numbers
    errors: Numbers

    def state(self) -> State:
        """Return the state that the next step starts from."""
        wall = self.outcome.wall if isinstance(self.outcome, Collision) else None
        _, t, x, y, vx, vy = self.numbers
        return State(t, x, y, vx, vy, wall)


class Scales(NamedTuple):
    """Size of the table [length], speed [length/time] and the time that a crossing takes."""

    length: float
    speed: float
    time: float


def scales(scene: Scene, state: State) -> Scales:
    """Return what is large for this question."""
    found = {name: bounds(law) for name, law in laws(scene).items()}
    length = max(law.highest for name, law in found.items() if name in ("r", "w", "h"))
    speed = hypot(state.vx, state.vy) or max(law.slope for law in found.values()) or length
    return Scales(length, speed, length / speed)


def numbers(outcome: Outcome, state: State) -> Numbers | None:
    """Return dt, t, x, y, vx, vy of a collision or horizon, else None."""
    if isinstance(outcome, Collision):
        return (outcome.dt, outcome.t, outcome.x, outcome.y, outcome.vx, outcome.vy)
    if isinstance(outcome, Horizon):
        return (outcome.t - state.t, outcome.t, outcome.x, outcome.y, outcome.vx, outcome.vy)
    return None


def measured(
    stepper: Stepper,
    scene: Scene,
    state: State,
    t_end: float,
    bound: float,
    incoming: Sequence[float] = (0.0,) * 5,
) -> MeasuredStep | None:
    """Take a step and measure what rounding may do to it.

    Args:
        stepper: under test.
        scene: of the question.
        state: of the question.
        t_end: horizon [time].
        bound: backward error allowed.
        incoming: errors that t, x, y, vx, vy of the state already have.

    Returns:
        The step, or None when it is no collision or horizon, or a delicate one.
    """
    outcome = stepper(scene, state, t_end)
    found = numbers(outcome, state)
    if found is None or not isinstance(outcome, Collision | Horizon):
        return None
    scale = scales(scene, state)
    nudges = [max(NUDGE * scale.time, 2.0**-46 * abs(state.t))]
    nudges += [NUDGE * scale.length] * 2 + [NUDGE * scale.speed] * 2
    size = [abs(state.t), *[hypot(state.x, state.y)] * 2, *[hypot(state.vx, state.vy)] * 2]
    errors = [bound * part for part in vector_sizes(found)]
    for field, nudge, extent, error in zip(INPUTS, nudges, size, incoming, strict=True):
        slopes = derivative(stepper, scene, state, t_end, outcome, field, nudge)
        if slopes is None:
            return None
        errors = [e + abs(d) * (error + bound * extent) for e, d in zip(errors, slopes, strict=True)]
    return MeasuredStep(outcome, found, tuple(errors))


def vector_sizes(found: Numbers) -> Numbers:
    """Return the sizes of dt, t, and of place and velocity as vectors."""
    dt, t, x, y, vx, vy = found
    return (abs(dt), abs(t), *[hypot(x, y)] * 2, *[hypot(vx, vy)] * 2)


def derivative(
    stepper: Stepper, scene: Scene, state: State, t_end: float, outcome: Outcome, field: str, nudge: float
) -> Numbers | None:
    """Return d(dt, t, x, y, vx, vy) / d field by a central difference; None when delicate."""
    at = [getattr(state, field) - nudge, getattr(state, field) + nudge]
    ends = []
    for value in at:
        nudged = replace(state, **{field: value})
        if nudged.t > t_end:
            return None
        answer = stepper(scene, nudged, t_end)
        found = numbers(answer, nudged)
        same = getattr(answer, "wall", None) == getattr(outcome, "wall", None)
        if found is None or type(answer) is not type(outcome) or not same:
            return None
        ends.append(found)
    return tuple((b - a) / (at[1] - at[0]) for a, b in zip(*ends, strict=True))
