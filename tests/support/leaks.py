"""Breaches of the promise `at-rest` that no single answer shows, and errors as large that are none.

As in `support.promise_breakers`: the fast stepper, with its answers changed.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from support.promise_breakers import Fault, Line, on


def turned(step: Line, factor: float, angle: float) -> None:
    """Change the size and the direction of the velocity after a bounce."""
    vx, vy, c, s = step["vx"], step["vy"], factor * math.cos(angle), factor * math.sin(angle)
    step["vx"], step["vy"] = c * vx - s * vy, s * vx + c * vy


def leaking(part: float, angle: float = 0.0) -> Callable[[Line, Line], Line]:
    """Lose a part of the speed at every bounce of a trajectory, and turn the velocity by an angle."""

    def change(_: Line, found: Line) -> Line:
        for i, step in enumerate(found["steps"], 1):
            if step["outcome"] == "collision":
                turned(step, (1 - part) ** i, angle * i)
        return found

    return change


def leaking_flow(_: Line, found: Line) -> Line:
    """Arrive a little too slow."""
    for state in found["states"]:
        if state["outcome"] == "horizon":
            turned(state, 1 - 1e-8, 0.0)
    return found


def to_and_fro(_: Line, found: Line) -> Line:
    """Be now too fast and now too slow by all that a vector lets pass."""
    for i, step in enumerate(found["steps"]):
        if step["outcome"] == "collision":
            turned(step, 1 + (-1) ** i * 1e-9, 0.0)
    return found


LEAKS: dict[str, tuple[str, str, Fault]] = {
    "leaking": ("at-rest", "fail", on("trajectory", leaking(1e-10))),
    "spiralling": ("at-rest", "fail", on("trajectory", leaking(0.0, 1e-10))),
    "leaking-in-flows": ("at-rest", "fail", on("flow", leaking_flow)),
}
NO_LEAK: Fault = on("trajectory", to_and_fro)
