"""A plain stepper: scalar binary64, readable, and right; its mutants are in `conformance.mutants`."""

from conformance.plain.flow import Captured, flow
from conformance.plain.step import Flight, Gap, Open, next_collision, trajectory

__all__ = ["Captured", "Flight", "Gap", "Open", "flow", "next_collision", "trajectory"]
