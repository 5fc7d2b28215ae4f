"""The fast stepper: a step, a trajectory, a flow and an ensemble in binary64, compiled by numba."""

from fast.ensemble import Ensemble, simulate
from fast.fine import FineTrajectory, fine_trajectory
from fast.flow import Flow, flow
from fast.step import Trajectory, next_collision, trajectory

__all__ = [
    "Ensemble",
    "FineTrajectory",
    "Flow",
    "Trajectory",
    "fine_trajectory",
    "flow",
    "next_collision",
    "simulate",
    "trajectory",
]
