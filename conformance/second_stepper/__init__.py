"""A second stepper in ball arithmetic (Arb, through python-flint), which shares nothing with the reference.

It answers the same questions as `reference`, by another argument, so that two mistakes would have to agree
before a wrong answer passes. It is slow to compile nothing and needs the test extra (python-flint).
"""

from conformance.second_stepper.answer import Answer, Kind
from conformance.second_stepper.step import next_collision, trajectory

__all__ = ["Answer", "Kind", "next_collision", "trajectory"]
