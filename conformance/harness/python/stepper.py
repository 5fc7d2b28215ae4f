"""A stepper in Python behind protocol 1: an example of what `mushrooms check` grades.

    mushrooms check -- python stepper.py

Put your own functions in place of those of `conformance.plain`, which is a complete plain stepper with the
method explained; `serve` reads the requests, checks them, and writes the answers. The first two functions are
required. Without `flow` or `timer` the profile of that name is not offered, and not asked for.
"""

import sys
from collections.abc import Sequence
from time import perf_counter_ns

from conformance import plain
from scene import Outcome, Scene, State
from scene.protocol.wire import serve


def next_collision(scene: Scene, state: State, t_end: float) -> Outcome:
    """Return `scene.Collision`, `Horizon` at t_end, `Undefined`, `Undecided` or `Rejected`."""
    return plain.next_collision(scene, state, t_end)


def trajectory(scene: Scene, state: State, n_collisions: int, t_end: float) -> list[Outcome]:
    """Return up to `n_collisions` collisions; the last outcome may be what came instead of one."""
    return plain.trajectory(scene, state, n_collisions, t_end)


def flow(scene: Scene, states: Sequence[State], t_end: float) -> list[tuple[Outcome, plain.Captured]]:
    """Return each particle's outcome at t_end, and (begin, end) of its first capture interval, or None."""
    return plain.flow(scene, states, t_end)


def timed(scene: Scene, state: State, n_collisions: int, repeat: int) -> tuple[list[int], Outcome]:
    """Return the nanoseconds that a trajectory took, `repeat` times over, and its last outcome."""
    ns = []
    for _ in range(repeat):
        begin = perf_counter_ns()
        steps = trajectory(scene, state, n_collisions, sys.float_info.max)
        ns.append(perf_counter_ns() - begin)
    return ns, steps[-1]


if __name__ == "__main__":
    lines, out = sys.stdin.buffer, sys.stdout.buffer
    serve("example-python", next_collision, trajectory, lines, out, flow=flow, timer=timed)
