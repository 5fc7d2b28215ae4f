"""Ground truth: a slow stepper whose every answer is an enclosure, proved to be first.

`path` answers one step and many, and reflects the particle; `answers` describes the results.
`prepared` has what is known of a scene once and for all. `start` judges the starting state, and
`course` follows a flight. `isolation` finds the first root on each wall of `walls`, in the
arithmetic of `arithmetic`, or for ties of `rational`. `timeline` has the laws in time.
`arithmetic` also limits the work of a step.
"""

from reference.answers import (
    Moment,
    Outcome,
    ProvedCollision as Collision,
    ProvedHorizon as Horizon,
    Trajectory,
)
from reference.arithmetic import Enclosure
from reference.path import next_collision, trajectory

__all__ = [
    "Collision",
    "Enclosure",
    "Horizon",
    "Moment",
    "Outcome",
    "Trajectory",
    "next_collision",
    "trajectory",
]


def __dir__() -> list[str]:
    """List the public names, without the modules that they come from."""
    return __all__
