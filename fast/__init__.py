"""The fast stepper: a step, a trajectory and an ensemble in binary64, compiled by numba."""

from fast.ensemble import Ensemble, simulate
from fast.stepper import Trajectory, next_collision, trajectory

__all__ = ["Ensemble", "Trajectory", "next_collision", "simulate", "trajectory"]
