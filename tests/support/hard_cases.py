"""The corpus's hard cases by id, put to both steppers."""

from __future__ import annotations

from fractions import Fraction

import mpmath

import fast
import reference
from conformance import vectors
from conformance.grading.agreement import compare
from conformance.vectors import Vector
from reference.arithmetic import Enclosure
from scene import Scene, Undecided, from_data

MAX_ULPS = 64.0  # backward ulps that the fast stepper may be off
CASES = {vector.id: vector for vector in vectors.load("stress") if vector.group.startswith("hard-case-")}


def case(name: str) -> Vector:
    """Return a hard case by number and index: `case("04/2")`."""
    return CASES[f"hard-case-{name}"]


def scene_of(name: str) -> Scene:
    """Return the scene of a hard case."""
    return from_data(case(name).scene)


def in_both(name: str, *, may_be_undecided: bool = False) -> reference.Outcome:
    """Return the reference's outcome of a step, once both steppers agree with the certified one.

    Args:
        name: number and index of the case.
        may_be_undecided: whether the case is degenerate within rounding, so that the fast stepper may say
            `undecided`; the reference may not.
    """
    asked, scene = case(name), scene_of(name)
    proved = reference.next_collision(scene, asked.state, asked.t_end, digits=40)
    assert not isinstance(proved, Undecided), proved
    rounded = proved.rounded() if isinstance(proved, reference.Collision | reference.Horizon) else proved
    assert compare(rounded, asked.expect[0], asked.state, 1.0).kind == "agrees", proved
    answer = fast.next_collision(scene, asked.state, asked.t_end)
    found = compare(answer, asked.expect[0], asked.state, MAX_ULPS)
    assert found.kind == "agrees" or (may_be_undecided and found.kind == "undecided"), (found, answer, proved)
    return proved


def is_enclosed(number: mpmath.mpf | Fraction | float, enclosure: Enclosure) -> bool:
    """Tell whether an exact or 300-digit number lies in an enclosure of at least 40 digits."""
    if isinstance(number, Fraction | float):
        return enclosure.contains(number)
    return bool(enclosure.lo <= number <= enclosure.hi)
