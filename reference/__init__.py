"""Ground truth: a slow stepper whose every answer is an enclosure, proved to be first."""

from reference.answers import Collision, Horizon, Moment, Outcome, Trajectory
from reference.arithmetic import Enclosure
from reference.step import next_collision, trajectory

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
