"""The fast stepper: a step, a trajectory, a flow and an ensemble in binary64, compiled by numba."""

from fast.ensemble import Ensemble, simulate
from fast.fine import FineTrajectory, fine_trajectory
from fast.flow import Flow, flow
from fast.step import next_collision
from fast.trajectory import Collisions, trajectory

__all__ = [
    "Collisions",
    "Ensemble",
    "FineTrajectory",
    "Flow",
    "fine_trajectory",
    "flow",
    "next_collision",
    "simulate",
    "trajectory",
]
