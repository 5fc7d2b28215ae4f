"""A trajectory: the successive collisions of one particle, its time carried as a sum of two floats."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fast.kernel import entries, records
from fast.kernel.records import FloatArray, unfilled_ends, unfilled_paths
from fast.kernel.worker import Loops, careful_at, new_worker
from fast.pieces import laws_in_lanes
from fast.starts import only_stop
from fast.step import WALL_NAMES, as_arrays, check_state, trouble
from fast.threads import follow_path
from fast.units import LateTime, fit
from fast.validation import MAX_STEPS, given_end
from scene import Horizon, Outcome, Scene, State, Undecided, Wall, check_scene
from scene.refusal import check_count

NAMES = np.array([WALL_NAMES[code] for code in range(len(WALL_NAMES))], dtype=object)


class Collisions(NamedTuple):
    """Successive collisions, and why they ended.

    Attributes:
        walls: (n,) names of the walls hit.
        steps: (n, 6) dt, t, x, y, vx, vy after each collision.
        outcome: None if all collisions asked for were found, else the outcome that ended the path.
    """

    walls: list[Wall]
    steps: FloatArray
    outcome: Outcome | None


def trajectory(scene: Scene, state: State, n_collisions: int, t_end: float = np.inf) -> Collisions:
    """Follow a particle through `n_collisions` collisions, time carried as a compensated pair.

    Args:
        scene: table and laws of motion.
        state: the start, as for `next_collision`.
        n_collisions: number of collisions to follow, 0 to 10^7.
        t_end: horizon [time], >= state.t; infinity for none.

    Returns:
        The collisions. If t_end is infinite and no wall is met any more (a particle at rest that no wall
        reaches), the outcome is a Horizon at t = infinity with its position.

    Raises:
        BadInput: a bad argument, naming field, value and bound. A state outside the table, or moving into
            the wall that it leaves, is found by the first step: the outcome is then Rejected.
    """
    check_scene(scene)
    t_end = given_end(t_end)
    n_collisions = check_count("n_collisions", n_collisions, 0, MAX_STEPS)
    try:
        start = check_state(scene, state, None if t_end == np.inf else t_end)
    except LateTime as error:
        return Collisions([], np.empty((0, 6)), Undecided(str(error)))
    rows, walls = as_arrays([start])
    factors = start.units.factors()  # multiplied in passing: a pass of its own took a quarter of the time
    paths = unfilled_paths(1, n_collisions, factors)
    if n_collisions:
        in_lanes = laws_in_lanes(fit(scene).scene)
        stop = only_stop(start.units.horizon(t_end))
        worker = new_worker(in_lanes, stop, unfilled_ends(rows, 1, (1, 1)), loops=Loops(careful_at(), 0, 0))
        kernel = entries.PATHS[in_lanes.slope is None, in_lanes.degree]
        with np.errstate(over="ignore", under="ignore"):  # without the compiler
            follow_path(kernel, (worker, walls, paths), n_collisions, stop.called_off)
    n, code = paths.counts.item(), paths.codes.item()
    n_exact = paths.n_exact.item() if factors is not None else start.units.n_exact(paths.steps[0, :n])
    if n_exact < n:
        n, code = n_exact, entries.ANSWER_LOST
    steps = paths.steps[0, :n] if n == n_collisions else paths.steps[0, :n].copy()  # not all room is held
    steps = steps if factors is not None else start.units.steps(steps)
    walls = NAMES.take(paths.walls[0, :n]).tolist()
    outcome: Outcome | None = None
    if n < n_collisions:
        # Without a horizon only what rests is never met, and it rests where it was: there is no v * infinity.
        last = steps[n - 1, 2:] if n else np.array([state.x, state.y, state.vx, state.vy])
        if code == records.HORIZON and np.isfinite(t_end):
            place = paths.ends[:, 2:]
            if start.units.keeps(place).all():
                last = start.units.places(place[0])
            else:
                code = entries.ANSWER_LOST
        is_horizon = code == records.HORIZON
        outcome = Horizon(t_end, *(float(v) for v in last)) if is_horizon else trouble(code, scene, state, n)
    return Collisions(walls, steps, outcome)
