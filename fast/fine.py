"""The fine stepper: steps to about 31 decimals, with states as pairs of floats."""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

import numpy as np

from fast.kernel import entries, records
from fast.kernel.entries import ANSWER_LOST
from fast.kernel.records import ANCHORS_SHAPE, Compiled, FloatArray, IntArray
from fast.step import WALL_CODES, WALL_NAMES, Start, check_state, trouble
from fast.threads import follow_path
from fast.units import LateTime, Units
from fast.validation import MAX_STEPS
from scene import Horizon, Outcome, Scene, State, Undecided, Wall, check_scene
from scene.refusal import check_count


class FineTrajectory(NamedTuple):
    """Successive collisions as pairs of floats, and why they ended.

    Attributes:
        walls: (n,) names of the walls hit.
        steps: (n, 6, 2) dt, t, x, y, vx, vy after each collision, as sums high + low.
        outcome: None if all collisions asked for were found, else the outcome that ended the path.
    """

    walls: list[Wall]
    steps: FloatArray
    outcome: Outcome | None

    def numbers(self, i: int) -> list[Fraction]:
        """Return dt, t, x, y, vx, vy of a collision, exactly as they are held."""
        return [Fraction(high) + Fraction(low) for high, low in self.steps[i].tolist()]


def fine_trajectory(scene: Scene, state: State, n_collisions: int) -> FineTrajectory:
    """Follow a particle. Each step is right to about 31 decimals for the state that it starts from.

    Along the path the dynamics amplifies errors. If harmonics of a law nearly cancel, the speed of the wall
    is known to fewer decimals: slow particles near such a wall lost up to 6 decimals in tests.

    Args:
        scene: table and laws of motion.
        state: the start, as for `next_collision`.
        n_collisions: number of collisions to follow, 0 to 10^7.

    Returns:
        The collisions. If no wall is met any more (a particle at rest that no wall reaches), the outcome is
        a Horizon at t = infinity with its position. If a wall is met again within some 1e-10 of a period,
        the outcome may be Undecided although `next_collision` decides it.

    Raises:
        BadInput: naming field, value and bound.

    Source: Gelfreich, Rom-Kedar, Turaev (2014), sec. 3.1; the scalar step decides which wall is met.
    """
    check_scene(scene)
    n_collisions = check_count("n_collisions", n_collisions, 0, MAX_STEPS)
    try:
        start = check_state(scene, state)
    except LateTime as error:
        return FineTrajectory([], np.empty((0, 6, 2)), Undecided(str(error)))
    steps: FloatArray = np.empty((n_collisions, 6, 2))
    met: IntArray = np.empty(n_collisions, dtype=np.int64)
    n, code = fill_path(start.compiled, as_pairs(start), WALL_CODES[state.wall], steps, met)
    return as_trajectory(scene, state, start.units, n, code, steps, met)


def fill_path(
    compiled: Compiled, start: FloatArray, wall: int, steps: FloatArray, met: IntArray
) -> tuple[int, int]:
    """Fill `steps` and `met` from a start in pairs; returns the number of collisions and the last code."""
    called_off = np.zeros(1, np.int64)
    given = compiled, np.zeros(ANCHORS_SHAPE), start, wall, np.inf, steps, met, called_off
    found: tuple[int, int] = follow_path(entries.fine, given, len(steps), called_off)
    return found


def as_pairs(start: Start) -> FloatArray:
    """Return a state as the fine kernel takes it: (5, 2), t, x, y, vx, vy and their low parts."""
    s = start.state
    return np.array([[number, 0.0] for number in (s.t, s.x, s.y, s.vx, s.vy)])


def as_trajectory(
    scene: Scene, state: State, units: Units, n: int, code: int, steps: FloatArray, met: IntArray
) -> FineTrajectory:
    """Return what the kernel found: `n` collisions of those asked for, and its last code."""
    outcome: Outcome | None = None
    n_exact = min(units.n_exact(steps[:n, :, part]) for part in (0, 1))
    if n_exact < n:
        n, code = n_exact, ANSWER_LOST
    found = units.steps(steps[:n])
    if n < len(steps):
        last = found[n - 1, 2:, 0] if n else (state.x, state.y, state.vx, state.vy)
        is_free = code == records.HORIZON
        outcome = Horizon(np.inf, *map(float, last)) if is_free else trouble(code, scene, state, n)
    return FineTrajectory([WALL_NAMES[int(c)] for c in met[:n]], found, outcome)
