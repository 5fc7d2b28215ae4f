"""Attacks: families of questions aimed at the weak points of a stepper's argument, seeded for ever.

A family draws questions. `run` has the reference answer them and the verifier (`conformance.verify`) judge
its claims, to which it holds the steppers that the caller gives.
"""

from conformance.cases.attacks import corners, dips, knots, residuals, shapes, vanishing
from conformance.cases.attacks.case import Attack, Family, line
from conformance.cases.attacks.search import Judgement, Tally, UnderAttack, run

FAMILIES: dict[str, Family] = {
    family.name: family
    for module in (knots, residuals, corners, dips, shapes, vanishing)
    for family in module.FAMILIES
}

__all__ = ["FAMILIES", "Attack", "Family", "Judgement", "Tally", "UnderAttack", "line", "run"]
