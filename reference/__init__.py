"""Ground truth: a slow stepper whose every answer is an enclosure, proved to be first.

`step` answers one step and `path` many; `answers` describes the results. `start` judges the starting state,
and `course` follows a flight. `isolation` finds the first root on each wall of `walls`, in the arithmetic
of `arithmetic`, or for ties of `rational`. `chain` reflects the particle.
"""

from reference.answers import Moment, Outcome, Trajectory
from reference.answers import ProvedCollision as Collision
from reference.answers import ProvedHorizon as Horizon
from reference.arithmetic import Enclosure
from reference.path import trajectory
from reference.step import next_collision

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
