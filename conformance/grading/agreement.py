"""Does a stepper's answer agree with a proved one? The comparison behind grades and tests.

An agreement is the same outcome, the same wall, and numbers within a bound of backward ulps
(`conformance.grading.error`). `undecided` is never wrong, only counted; it is the caller's to bound.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import NamedTuple

from conformance.grading.error import backward_ulps
from scene import Collision, Horizon, Outcome, State


class Truth(NamedTuple):
    """A proved answer.

    Attributes:
        outcome: in the wire's form, numbers rounded.
        numbers: dt, x, y, vx, vy to many more digits (dt to the horizon where nothing is hit).
        jacobian: derivatives of the numbers by t, x, y, vx, vy; None where nothing is hit.
    """

    outcome: Outcome
    numbers: Sequence[Fraction] = ()
    jacobian: Sequence[Sequence[float]] | None = None


class Agreement(NamedTuple):
    """How an answer compares: `kind` is agrees, undecided, outcome, wall or numbers; its error."""

    kind: str
    ulps: float


# Position and velocity in free flight, by t, x, y, vx, vy, for the flight time dt.
def _free_flight(dt: float, state: State) -> list[list[float]]:
    return [
        [0.0] * 5,
        [-state.vx, 1.0, 0.0, dt, 0.0],
        [-state.vy, 0.0, 1.0, 0.0, dt],
        [0.0, 0.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 1.0],
    ]


def compare(answer: Outcome, truth: Truth, state: State, bound: float) -> Agreement:
    """Compare one step with the truth.

    Args:
        answer: of the stepper under test.
        truth: proved.
        state: the start of the step.
        bound: backward ulps allowed.

    Returns:
        What differs first, with the worst backward ulps of the numbers where they were compared.
    """
    if answer == truth.outcome and not isinstance(answer, Collision | Horizon):
        return Agreement("agrees", 0.0)
    kinds = {type(answer).__name__, type(truth.outcome).__name__}
    if "Undecided" in kinds:
        return Agreement("undecided", 0.0)
    if len(kinds) > 1:
        return Agreement("outcome", 0.0)
    if isinstance(answer, Collision) and isinstance(truth.outcome, Collision):
        if answer.wall != truth.outcome.wall:
            return Agreement("wall", 0.0)
        dt = answer.dt
    elif isinstance(answer, Horizon):
        dt = float(truth.numbers[0])
    else:
        return Agreement("agrees", 0.0)  # undefined or rejected, for reasons in other words
    computed = (dt, answer.x, answer.y, answer.vx, answer.vy)
    jacobian = truth.jacobian or _free_flight(dt, state)
    inputs = (state.t, state.x, state.y, state.vx, state.vy)
    worst = max(backward_ulps(computed, truth.numbers, jacobian, inputs))
    return Agreement("agrees" if worst <= bound else "numbers", worst)
