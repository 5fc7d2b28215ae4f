"""A second stepper in ball arithmetic (`conformance.arb`), which shares nothing with the reference.

It answers the same questions as `reference`, by another argument, so that two mistakes would have to agree
before a wrong answer passes. It takes milliseconds a step and needs the test extra (python-flint).
"""

from conformance.second_stepper.answer import Answer
from conformance.second_stepper.step import next_collision, trajectory

__all__ = ["Answer", "next_collision", "trajectory"]
