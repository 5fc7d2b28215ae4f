"""The fast stepper: a step, a trajectory, a flow and an ensemble in binary64, compiled by numba."""

from fast.ensemble import Ensemble, simulate
from fast.flow import Flow, flow
from fast.stepper import Trajectory, next_collision, trajectory

__all__ = ["Ensemble", "Flow", "Trajectory", "flow", "next_collision", "simulate", "trajectory"]
