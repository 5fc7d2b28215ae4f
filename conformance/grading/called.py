"""A stepper called from Python: what it returns is an outcome of the question, or an AssertionError says not.

A stepper that forgets to return would else leave every property with nothing to say, as one that is
undecided does, and so would one that refuses every state: what is clearly inside, off all walls and of
numbers that every stepper can hold, must not be `rejected`. Numbers of any kind that `float` takes are taken
(numpy's too); whether they are right is not judged here.

What honest rounding may do to a step is measured on the stepper itself by finite nudges. One whose backward
error is `bound` gives the exact answer to a question off by `bound` of each input, itself off by `bound` of
each output. How far that moves the answer, to first order, follows from the answers to nudged questions.
Where a nudge changes the outcome or the wall, the question is delicate and nothing is said about it.
"""

import json
import math
from collections.abc import Sequence
from typing import Any, NamedTuple, NoReturn

import msgspec
from mpmath import fp

from conformance import plain
from scene import (
    Collision,
    Horizon,
    Outcome,
    Rejected,
    Scene,
    State,
    Undecided,
    Undefined,
    to_data,
)
from scene.geometry import table_at
from scene.laws import bounds
from scene.refusal import shown
from scene.states import Stepper
from scene.tables import laws

HELD = 2.0**100  # sizes, speeds and their inverses within it overflow nowhere
FAR = 2.0**20  # periods from t = 0 that every stepper must reach
Question = tuple[Scene, State, float]  # as a stepper takes it: with t_end
CLEAR = 2.0**-20  # of the table's size: farther inside than any rounding leads

Numbers = tuple[float, ...]
NUDGE = 2.0**-26  # relative: the differences of central differences then keep half of binary64's digits
INPUTS = ("t", "x", "y", "vx", "vy")


def fail(name: str, text: str, *questions: Question) -> NoReturn:
    """Say in one line what is wrong, and with which questions, each as it was sent.

    Raises:
        AssertionError: always.
    """
    lines = []
    for scene, state, t_end in questions:
        asked = {"scene": to_data(scene), "state": msgspec.structs.asdict(state), "t_end": t_end}
        lines.append(json.dumps({"cmd": "step", "seq": 1, **asked}))
    raise AssertionError("; ".join([f"{name}: {text}", *lines]))


def is_clearly_inside(scene: Scene, state: State, t_end: float) -> bool:
    """Tell whether a state is one that no stepper may refuse; of one on a wall this does not judge."""
    sizes = [abs(extent) for law in laws(scene).values() for extent in bounds(law)]
    sizes += [abs(number) for number in (state.x, state.y, state.vx, state.vy, state.t, t_end)]
    is_far = max(abs(state.t), abs(t_end)) > FAR * (scene.period or 1.0)
    if state.wall is not None or is_far or any(size and not 1 / HELD < size < HELD for size in sizes):
        return False
    off = CLEAR * float(table_at(fp, scene, state.t).size)
    places = [(0.0, 0.0), (off, 0.0), (-off, 0.0), (0.0, off), (0.0, -off)]
    around = [msgspec.structs.replace(state, x=state.x + dx, y=state.y + dy) for dx, dy in places]
    return not any(isinstance(plain.next_collision(scene, at, t_end), Rejected) for at in around)


def ask(stepper: Stepper, scene: Scene, state: State, t_end: float) -> Outcome:
    """Return a stepper's answer, which must be an outcome whose numbers are finite floats.

    Raises:
        AssertionError: one line, with the question.
    """
    found: Any = stepper(scene, state, t_end)
    if isinstance(found, Rejected) and is_clearly_inside(scene, state, t_end):
        fail("outcome", f"{found}, must be no refusal of a state clearly inside", (scene, state, t_end))
    if isinstance(found, Undefined | Undecided | Rejected):
        return found
    if not isinstance(found, Collision | Horizon):
        fail("outcome", f"{shown(found)}, must be an outcome of `scene`", (scene, state, t_end))
    if isinstance(found, Collision) and found.wall not in scene.walls:
        text = f"wall = {shown(found.wall)}, must be one of {', '.join(scene.walls)}"
        fail("outcome", text, (scene, state, t_end))
    fields = [field for field in found.__struct_fields__ if field != "wall"]
    numbers = {field: _number(getattr(found, field)) for field in fields}
    for field, number in numbers.items():
        if not math.isfinite(number):
            text = f"{field} = {shown(getattr(found, field))}, must be a finite number"
            fail("outcome", text, (scene, state, t_end))
    return msgspec.structs.replace(found, **numbers)


def _number(value: Any) -> float:
    """Return a number as a float; nan for what is none."""
    try:
        return math.nan if isinstance(value, str) else float(value)
    except (TypeError, ValueError, OverflowError):
        return math.nan


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
    speed = math.hypot(state.vx, state.vy) or max(law.slope for law in found.values()) or length
    return Scales(length, speed, length / speed)


def numbers(outcome: Outcome, state: State) -> Numbers | None:
    """Return dt, t, x, y, vx, vy of a collision or horizon, else None."""
    if isinstance(outcome, Collision):
        return (outcome.dt, outcome.t, outcome.x, outcome.y, outcome.vx, outcome.vy)
    if isinstance(outcome, Horizon):
        return (outcome.t - state.t, outcome.t, outcome.x, outcome.y, outcome.vx, outcome.vy)
    return None


def measure_step(
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
    outcome = ask(stepper, scene, state, t_end)
    found = numbers(outcome, state)
    if found is None or not isinstance(outcome, Collision | Horizon):
        return None
    scale = scales(scene, state)
    nudges = [max(NUDGE * scale.time, 2.0**-46 * abs(state.t))]
    nudges += [NUDGE * scale.length] * 2 + [NUDGE * scale.speed] * 2
    size = [abs(state.t), *[math.hypot(state.x, state.y)] * 2, *[math.hypot(state.vx, state.vy)] * 2]
    dt, t, x, y, vx, vy = found
    errors = [bound * part for part in (abs(dt), abs(t), *[math.hypot(x, y)] * 2, *[math.hypot(vx, vy)] * 2)]
    for field, nudge, extent, error in zip(INPUTS, nudges, size, incoming, strict=True):
        slopes = derivative(stepper, scene, state, t_end, outcome, field, nudge)
        if slopes is None:
            return None
        errors = [e + abs(d) * (error + bound * extent) for e, d in zip(errors, slopes, strict=True)]
    return MeasuredStep(outcome, found, tuple(errors))


def derivative(
    stepper: Stepper, scene: Scene, state: State, t_end: float, outcome: Outcome, field: str, nudge: float
) -> Numbers | None:
    """Return d(dt, t, x, y, vx, vy) / d field by a central difference; None when delicate."""
    at = [getattr(state, field) - nudge, getattr(state, field) + nudge]
    ends = []
    for value in at:
        nudged = msgspec.structs.replace(state, **{field: value})
        if nudged.t > t_end:
            return None
        answer = ask(stepper, scene, nudged, t_end)
        found = numbers(answer, nudged)
        same = getattr(answer, "wall", None) == getattr(outcome, "wall", None)
        if found is None or type(answer) is not type(outcome) or not same:
            return None
        ends.append(found)
    return tuple((b - a) / (at[1] - at[0]) for a, b in zip(*ends, strict=True))
