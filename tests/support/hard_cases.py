"""A hard case, run through both steppers: first the reference, then the fast one against it."""

from __future__ import annotations

from fractions import Fraction

import mpmath

import fast
import reference
from conformance.grading.agreement import compare
from reference.arithmetic import Enclosure
from scene import BangBang, Cap, Mushroom, Scene, State, Stem, Undecided
from support.truth import proved_step

MAX_ULPS = 64.0  # backward ulps that the fast stepper may be off

CIRCLE = Cap(r=1.0)
BOX = Stem(w=1.0, h=1.0)
STATIC = Mushroom(r=1.0, h=1.0, w=0.5)
# A floor that comes up at constant acceleration 16, h = 2 - 8 t^2 until t = 1/4, then
# h = 1 + 8 (t - 1/2)^2 until t = 3/4, then 2 - 8 (t - 1)^2: down again.
LIFT = Stem(w=1.0, h=BangBang(knots=((0.0, 2.0), (0.5, 1.0), (1.0, 2.0))))


def in_both(
    scene: Scene, state: State, t_end: float = 100.0, *, may_be_undecided: bool = False
) -> reference.Outcome:
    """Return the reference's outcome, once the fast stepper has been found to agree with it.

    Args:
        scene: the table.
        state: the start.
        t_end: horizon [time].
        may_be_undecided: whether the case is degenerate within rounding, so that the fast
            stepper may say `undecided`; the reference may not.
    """
    proved = reference.next_collision(scene, state, t_end, digits=40)
    assert not isinstance(proved, Undecided), proved
    answer = fast.next_collision(scene, state, t_end)
    agreement = compare(answer, proved_step(scene, state, t_end), state, MAX_ULPS)
    allowed = ("agrees", "undecided") if may_be_undecided else ("agrees",)
    assert agreement.kind in allowed, (agreement, answer, proved)
    return proved


def collision(
    scene: Scene, state: State, t_end: float = 100.0, *, may_be_undecided: bool = False
) -> reference.Collision:
    """Return the proved collision that both steppers find."""
    found = in_both(scene, state, t_end, may_be_undecided=may_be_undecided)
    assert isinstance(found, reference.Collision), found
    return found


def is_enclosed(number: mpmath.mpf | Fraction | float, enclosure: Enclosure) -> bool:
    """Tell whether an exact or 300-digit number lies in an enclosure of at least 40 digits."""
    if isinstance(number, Fraction | float):
        return enclosure.contains(number)
    return bool(enclosure.lo <= number <= enclosure.hi)
