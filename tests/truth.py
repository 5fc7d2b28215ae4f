"""The reference's answers in the form that comparisons take."""

from __future__ import annotations

from fractions import Fraction

import reference
from conformance.agreement import Truth
from reference.arithmetic import Enclosure, rational
from scene import Scene, State


def centre(enclosure: Enclosure) -> Fraction:
    return (rational(enclosure.lo._mpf_) + rational(enclosure.hi._mpf_)) / 2


def proved_step(scene: Scene, state: State, t_end: float, digits: int = 30) -> Truth:
    outcome = reference.next_collision(scene, state, t_end, digits=digits, is_differentiated=True)
    if isinstance(outcome, reference.Collision):
        numbers = [centre(outcome.dt), *(centre(c) for c in outcome.after[1:])]
        assert outcome.jacobian is not None
        return Truth(outcome.rounded(), numbers, [[float(d) for d in row] for row in outcome.jacobian])
    if isinstance(outcome, reference.Horizon):
        dt = Fraction(t_end) - Fraction(state.t)
        return Truth(outcome.rounded(), [dt, *(centre(c) for c in outcome.at[1:])])
    return Truth(outcome)
