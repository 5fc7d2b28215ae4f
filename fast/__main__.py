"""`python -m fast`: serve the fast stepper through protocol 1."""

import sys

from fast.stepper import next_collision, trajectory
from scene import Collision, Outcome, Scene, State
from scene.wire import serve


def follow(scene: Scene, state: State, n_collisions: int, t_end: float) -> list[Outcome]:
    """Return the collisions of a trajectory, and last what came instead of one."""
    path = trajectory(scene, state, n_collisions, t_end)
    steps = [Collision(wall, *map(float, row)) for wall, row in zip(path.walls, path.steps, strict=True)]
    return [*steps, path.outcome] if path.outcome is not None else list(steps)


if __name__ == "__main__":
    serve("fast", next_collision, follow, sys.stdin.buffer, sys.stdout.buffer)
