"""The steps of a path with their Jacobians chained: what rounding every state that a stepper holds may do."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from math import inf, isfinite

import numpy as np
import numpy.typing as npt

import reference
from conformance.cases.draw import Unfit
from conformance.cases.prover import ask, coasted, ends, flight_of
from conformance.grading.error import Matrix, condition_number, free_flight, inputs_of
from conformance.vectors import NUMBERS, Certified, certified
from scene import Scene, State


class Links:
    """The steps of a trajectory: their Jacobians chained from each state that a stepper has held.

    Each Jacobian is that of the step from the rounded state, with the residual of the wall moving along.
    `held` is (n, 5, 5): d(t, x, y, vx, vy) after the last step by t, x, y, vx, vy of each state held, and
    `inputs` is (n, 5). Sums go over whole arrays: four digits of the allowances are kept, which no order of
    summation changes. A flow tells no flight times: how delicate these are does not count where `is_timed`
    is false.
    """

    def __init__(self, scene: Scene, state: State, t_end: float, *, is_timed: bool = True) -> None:
        self.scene, self.state, self.t_end, self.is_timed = scene, state, t_end, is_timed
        self.held: npt.NDArray[np.float64] = np.empty((0, 5, 5))
        self.inputs: npt.NDArray[np.float64] = np.empty((0, 5))
        self.condition = self.largest = 0.0

    def add(self, found: reference.Collision) -> list[float]:
        """Add a step, and return what all rounding may do to it: it begins at the rounded state."""
        proved = ask(self.scene, self.state, self.t_end)
        if not isinstance(proved, reference.Collision) or proved.wall != found.wall:
            raise Unfit("a rounded state takes another path")
        centre = [float(found.dt), *(float(c) for c in found.after[1:])]
        allowance = self._chain(flight_of(proved, self.state, self.t_end).jacobian, centre)
        self.state = found.rounded().state()
        return allowance

    def coast(self, horizon: reference.Horizon, since: reference.Enclosure | None) -> Certified:
        """Return the horizon after the last collision, at time `since`; None for none."""
        start = Fraction(self.state.t)
        numbers = coasted(horizon, (start, start) if since is None else ends(since))
        centre = [float(sum(numbers[name]) / 2) for name in NUMBERS]
        allowance = self._chain(free_flight(self.state, centre[0]), centre)
        return certified(numbers, finite(allowance), None, is_wide=True)

    def _chain(self, jacobian: Matrix, centre: list[float]) -> list[float]:
        self.held = np.concatenate([self.held, np.eye(5)[None]])
        self.inputs = np.concatenate([self.inputs, [inputs_of(self.state)]])
        with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused by `finite`
            rows = (np.array(jacobian)[:, :, None] * self.held[:, None]).sum(axis=2)
            moved = np.abs(rows * self.inputs[:, None]).sum(axis=(0, 2))
            rows[:, 0] += self.held[:, 0]
        self.held = rows
        allowance = [float(part) for part in moved]
        self.condition = condition(centre if self.is_timed else [inf, *centre[1:]], allowance)
        return allowance


def condition(centre: Sequence[float], allowance: Sequence[float]) -> float:
    """Return the condition number of dt, x, y, vx, vy by what their inputs move them, summed already."""
    return condition_number(centre, [[part] for part in allowance], [1.0])


def finite(allowance: Sequence[float]) -> Sequence[float]:
    """Return allowances as they are.

    Raises:
        Unfit: one is infinite or none.
    """
    if not all(map(isfinite, allowance)):
        raise Unfit("an allowance overflows")
    return allowance
