"""`python -m reference`: serve the reference stepper through protocol 1."""

import sys

from reference.stepper import Collision, Horizon, next_collision
from scene import Outcome, Scene, State
from scene.wire import serve


def rounded_step(scene: Scene, state: State, t_end: float) -> Outcome:
    """Return the proved outcome, its numbers rounded to binary64."""
    outcome = next_collision(scene, state, t_end)
    return outcome.rounded() if isinstance(outcome, Collision | Horizon) else outcome


if __name__ == "__main__":
    serve("reference", rounded_step, sys.stdin.buffer, sys.stdout.buffer)
