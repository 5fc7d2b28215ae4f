"""A plain stepper: scalar binary64, readable, and right; its mutants are in `conformance.mutants`."""

from conformance.plain.step import Flight, Gap, PlainPath, UndecidedError, flow, next_collision, trajectory
from scene.protocol.wire import Captured

__all__ = ["Captured", "Flight", "Gap", "PlainPath", "UndecidedError", "flow", "next_collision", "trajectory"]
