"""Attacks: families of questions aimed at the weak points of a stepper's argument, seeded for ever.

A family draws questions; `run` puts them to steppers that the caller gives and compares every answer with
the second stepper (`conformance.second_stepper`). Needs the test extra (python-flint).
"""

from conformance.attacks import corners, dips, knots, residuals, shapes, vanishing
from conformance.attacks.case import Attack, Family, line
from conformance.attacks.search import Claim, Judgement, Tally, UnderAttack, run

FAMILIES: dict[str, Family] = {
    family.name: family
    for module in (knots, residuals, corners, dips, shapes, vanishing)
    for family in module.FAMILIES
}

__all__ = ["FAMILIES", "Attack", "Claim", "Family", "Judgement", "Tally", "UnderAttack", "line", "run"]
