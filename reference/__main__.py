"""`python -m reference`: serve the reference stepper through protocol 1."""

import sys
import time

import reference
from scene import Outcome, Scene, State, Undecided
from scene.protocol.wire import serve


def rounded(outcome: reference.Outcome) -> Outcome:
    """Return a proved outcome rounded to binary64; Undecided if a number is too large."""
    if not isinstance(outcome, reference.Collision | reference.Horizon):
        return outcome
    try:
        return outcome.rounded()
    except OverflowError:
        return Undecided("the answer holds a number beyond binary64")


def step(scene: Scene, state: State, t_end: float) -> Outcome:
    """Return the proved outcome of one step, rounded."""
    return rounded(reference.next_collision(scene, state, t_end))


def follow(scene: Scene, state: State, n_collisions: int, t_end: float) -> list[Outcome]:
    """Return the proved collisions of a trajectory, rounded.

    The last entry may be another outcome.
    """
    path = reference.trajectory(scene, state, n_collisions, t_end)
    return [rounded(outcome) for outcome in path.outcomes]


def clock(scene: Scene, state: State, n_collisions: int, repeat: int) -> tuple[list[int], Outcome]:
    """Return the nanoseconds of each of `repeat` proofs of a trajectory, and its last outcome."""
    ns = []
    for _ in range(repeat):
        begin = time.perf_counter_ns()
        path = reference.trajectory(scene, state, n_collisions)
        ns.append(time.perf_counter_ns() - begin)
    return ns, rounded(path.outcomes[-1])


if __name__ == "__main__":
    serve("reference", step, follow, sys.stdin.buffer, sys.stdout.buffer, timer=clock)
