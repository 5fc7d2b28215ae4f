"""Flow: states of given particles at a given time, by the same kernel as ensembles."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fast.ensemble import follow
from fast.kernel.records import FloatArray, IntArray, unfilled_ends
from fast.kernel.single import ANSWER_LOST
from fast.pieces import laws_in_lanes
from fast.starts import least_collisions, only_stop
from fast.step import as_arrays, end_of_path, fitted_start, next_collision
from fast.units import fit, scaled
from fast.validation import MOST_TO_A_TIME, check_states, check_threads
from scene import InvalidState, Outcome, Rejected, Scene, State, Undecided, check_scene
from scene.refusal import check_number


class Flow(NamedTuple):
    """N particles at t_end.

    Attributes:
        outcomes: (N,) Horizon with the state at t_end; Undefined or Undecided for a particle lost before.
            A particle in a moving table is also Undecided after 10^7 collisions.
        t_in, t_out: (N,) the first capture interval in the cap [time], cut at t_end; nan for none.
        wall_counts: (N, 5) collisions with arc, base, left, right, floor.
        n_careful: (N,) number of collisions computed by the scalar step, not by the SIMD lanes.
    """

    outcomes: list[Outcome]
    t_in: FloatArray
    t_out: FloatArray
    wall_counts: IntArray
    n_careful: IntArray


def flow(scene: Scene, states: Sequence[State], t_end: float, threads: int | None = None) -> Flow:
    """Carry particles to t_end.

    Args:
        scene: table and laws of motion.
        states: the starts, each as for `next_collision`, with t <= t_end.
        t_end: when to stop [time], finite.
        threads: number of threads; default: one per core. The results do not depend on it.

    Raises:
        InvalidState: a start is not a State or not in this table; the particle is named.
        BadInput: another argument is bad; naming field, value and bound.

    Source: captured means |sin phi| > nu at the arc, sec. 3.2.
    """
    check_scene(scene)
    threads = check_threads(threads)
    states = check_states(scene, states)
    t_end = check_number("t_end", t_end)
    refusals = [refuse(scene, state, t_end) for state in states]
    for i, refusal in enumerate(refusals):
        if isinstance(refusal, Rejected):
            raise InvalidState(f"particle {i}: {refusal.reason}")
    return carry(scene, states, refusals, t_end, threads)[0]


def carry(
    scene: Scene, states: Sequence[State], refusals: Sequence[Outcome | None], t_end: float, threads: int
) -> tuple[Flow, float]:
    """Carry particles to t_end, those whose units agree together; those refused stay where they are.

    Returns:
        What became of them, and the seconds that took.

    Raises:
        BadInput: the scene does not fit into binary64: see fast.units.
    """
    starts = {i: fitted_start(scene, states[i]) for i, refusal in enumerate(refusals) if refusal is None}
    every, outcomes, seconds = unfilled_ends(np.empty((len(states), 6)), 1, (1, 1)), list(refusals), 0.0
    for units in sorted({start.units for start in starts.values()}):
        those = [i for i, start in starts.items() if start.units == units]
        rows, walls = as_arrays([starts[i] for i in those])
        done = unfilled_ends(rows, 1, (1, 1))
        stop = only_stop(units.horizon(t_end))
        seconds += follow(laws_in_lanes(fit(scene).scene), done, walls, stop, threads)
        # t, its low part, x, y, vx, vy; begin and end of the capture interval
        numbers = np.column_stack([done.states, done.t_in[:, 0, 0], done.t_out[:, 0, 0]])
        numbers, is_kept = scaled(numbers, np.append(units.of_step(), [units.time, units.time]))
        is_lost = ~is_kept.all(axis=1)
        done.codes[is_lost], numbers[is_lost, 6:] = ANSWER_LOST, np.nan
        done.t_in[:, 0, 0], done.t_out[:, 0, 0] = numbers[:, 6], numbers[:, 7]
        for whole, own in zip(every, done, strict=True):
            whole[those] = own
        ends = zip(those, done.codes.tolist(), done.counts.sum(axis=1), numbers[:, 2:6], strict=True)
        for i, code, n, place in ends:
            outcomes[i] = end_of_path(code, scene, states[i], n, t_end, place)
    found = [outcome for outcome in outcomes if outcome is not None]
    return Flow(found, every.t_in[:, 0, 0], every.t_out[:, 0, 0], every.counts, every.careful), seconds


def refuse(scene: Scene, state: State, t_end: float) -> Rejected | Undecided | None:
    """Return why a particle cannot start so, or is not followed so far; else None."""
    outcome = next_collision(scene, state, t_end)
    if isinstance(outcome, Rejected | Undecided):
        return outcome
    fitted, start = fit(scene), fitted_start(scene, state)
    s = start.state
    ahead = least_collisions(fitted.scene, math.hypot(s.vx, s.vy), start.units.horizon(t_end) - s.t)
    if ahead > MOST_TO_A_TIME:
        return Undecided(f"t_end = {t_end!r} is over {ahead:.0e} collisions away, must be at most 1e7")
    return None
