"""`python -m fast`: serve the fast stepper through protocol 1."""

import math
import os
import sys
import time
from collections.abc import Sequence

import msgspec

import fast
from fast import paths
from fast.validation import check_threads
from scene import Collision, Horizon, Outcome, Scene, State
from scene.protocol.wire import serve

FOR_EVER = 2.0**1000  # the horizon of a path that has none, once nothing is met any more


def follow(scene: Scene, state: State, n_collisions: int, t_end: float = math.inf) -> list[Outcome]:
    """Return the collisions of a trajectory, the last entry may be another outcome."""
    path = fast.trajectory(scene, state, n_collisions, t_end)
    steps: list[Outcome] = list(map(Collision, path.walls, *path.steps.T.tolist()))
    return steps if path.outcome is None else [*steps, path.outcome]


def carry(
    scene: Scene, states: Sequence[State], t_end: float
) -> list[tuple[Outcome, tuple[float, float] | None]]:
    """Return each particle's outcome at t_end and its first capture interval; refuse only bad starts."""
    refusals = [paths.refuse(scene, state, t_end) for state in states]
    run, _ = paths.carry(scene, states, refusals, t_end, check_threads(None))
    return [
        # Only a particle that arrives has a capture interval.
        (outcome, (begin, end) if isinstance(outcome, Horizon) and not math.isnan(begin) else None)
        for outcome, begin, end in zip(run.outcomes, run.t_in.tolist(), run.t_out.tolist(), strict=True)
    ]


def clock(scene: Scene, state: State, n_collisions: int, repeat: int) -> tuple[list[int], Outcome]:
    """Return the nanoseconds that a trajectory took, `repeat` times over, and its last outcome."""
    fast.warm(scene)
    ns = []
    for _ in range(repeat):
        begin = time.perf_counter_ns()
        fast.trajectory(scene, state, n_collisions)
        ns.append(time.perf_counter_ns() - begin)
    last = follow(scene, state, n_collisions)[-1]
    if isinstance(last, Horizon):  # at rest where no wall comes: the wire has no infinity
        last = msgspec.structs.replace(last, t=FOR_EVER)
    return ns, last


if __name__ == "__main__":
    serve("fast", fast.next_collision, follow, sys.stdin.buffer, sys.stdout.buffer, flow=carry, timer=clock)
    os._exit(0)  # at once: the compiler takes up to seconds to free its code, which the system does anyway
