"""A stepper called from Python: what it returns is an outcome of the question, or an AssertionError says not.

A stepper that forgets to return would else leave every property with nothing to say, as one that is
undecided does. Numbers of any kind that `float` takes are taken (numpy's too); whether they are right is not
judged here.
"""

from __future__ import annotations

import json
import math
from functools import partial
from typing import Any, NoReturn

import msgspec

from scene import Collision, Horizon, Outcome, Rejected, Scene, State, Undecided, Undefined, to_data
from scene.refusal import shown
from scene.states import Stepper


def answering(stepper: Stepper) -> Stepper:
    """Return the stepper, held to answer every question by an outcome whose numbers are finite floats.

    Args:
        stepper: (scene, state, t_end) -> outcome.

    Raises:
        AssertionError: when it is called and does not: one line, with the question.
    """
    return partial(_outcome, stepper)


def fail(name: str, text: str, scene: Scene, state: State, t_end: float) -> NoReturn:
    """Say in one line what is wrong, and with which question, as the wire has it.

    Raises:
        AssertionError: always.
    """
    asked = {"scene": to_data(scene), "state": msgspec.structs.asdict(state), "t_end": t_end}
    line = {"cmd": "step", "seq": 1, **asked}
    raise AssertionError(f"{name}: {text}; {json.dumps(line)}")


def _outcome(stepper: Stepper, scene: Scene, state: State, t_end: float) -> Outcome:
    found: Any = stepper(scene, state, t_end)
    if isinstance(found, Undefined | Undecided | Rejected):
        return found
    if not isinstance(found, Collision | Horizon):
        fail("outcome", f"{shown(found)}, must be an outcome of `scene`", scene, state, t_end)
    if isinstance(found, Collision) and found.wall not in scene.walls:
        text = f"wall = {shown(found.wall)}, must be one of {', '.join(scene.walls)}"
        fail("outcome", text, scene, state, t_end)
    fields = [field for field in found.__struct_fields__ if field != "wall"]
    numbers = {field: _number(getattr(found, field)) for field in fields}
    for field, number in numbers.items():
        if not math.isfinite(number):
            text = f"{field} = {shown(getattr(found, field))}, must be a finite number"
            fail("outcome", text, scene, state, t_end)
    return msgspec.structs.replace(found, **numbers)


def _number(value: Any) -> float:
    """Return a number as a float; nan for what is none."""
    try:
        return math.nan if isinstance(value, str) else float(value)
    except (TypeError, ValueError, OverflowError):
        return math.nan
