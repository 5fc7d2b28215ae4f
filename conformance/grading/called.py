"""A stepper called from Python: what it returns is an outcome of the question, or an AssertionError says not.

A stepper that forgets to return would else leave every property with nothing to say, as one that is
undecided does, and so would one that refuses every state: what is clearly inside, off all walls and of
numbers that every stepper can hold, must not be `rejected`. Numbers of any kind that `float` takes are taken
(numpy's too); whether they are right is not judged here.
"""

from __future__ import annotations

import json
import math
from functools import partial
from typing import Any, NoReturn

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
from scene.tables import cycle_length, laws

MOST = 2.0**100  # sizes, speeds and their inverses within it overflow nowhere
FAR = 2.0**20  # periods from t = 0 that every stepper must reach
Question = tuple[Scene, State, float]  # as a stepper takes it: with t_end
CLEAR = 2.0**-20  # of the table's size: farther inside than any rounding leads


def answering(stepper: Stepper) -> Stepper:
    """Return the stepper, held to answer every question by an outcome whose numbers are finite floats.

    Args:
        stepper: (scene, state, t_end) -> outcome.

    Raises:
        AssertionError: when it is called and does not: one line, with the question.
    """
    return partial(_outcome, stepper)


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
    is_far = max(abs(state.t), abs(t_end)) > FAR * (cycle_length(scene) or 1.0)
    if state.wall is not None or is_far or any(size and not 1 / MOST < size < MOST for size in sizes):
        return False
    off = CLEAR * float(table_at(fp, scene, state.t).size)
    places = [(0.0, 0.0), (off, 0.0), (-off, 0.0), (0.0, off), (0.0, -off)]
    around = [msgspec.structs.replace(state, x=state.x + dx, y=state.y + dy) for dx, dy in places]
    return not any(isinstance(plain.next_collision(scene, at, t_end), Rejected) for at in around)


def _outcome(stepper: Stepper, scene: Scene, state: State, t_end: float) -> Outcome:
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
