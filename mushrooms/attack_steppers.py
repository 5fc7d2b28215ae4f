"""Our steppers as attacks meet them: the reference's claims, the fast one's steps and flows."""

from __future__ import annotations

from fractions import Fraction

from mpmath import isfinite

import fast
import reference
from conformance.attacks import Attack, Claim, UnderAttack
from conformance.generator.prover import coasted, ends
from conformance.grading.agreement import Answer, Enclosed
from conformance.vectors import Ends
from reference.certificate import certificate, path_certificate
from scene import BadInput, Horizon, Mushroom, Rejected, Scene, State, Undecided, Undefined

DIGITS = 25  # of a single step: enough to tell enclosures from wrong answers


def steppers(choice: str) -> UnderAttack:
    """Return what "reference", "fast" or "both" puts under attack."""
    proved = prove if choice in ("reference", "both") else None
    if choice in ("fast", "both"):
        return UnderAttack(proved, fast.next_collision, flow)
    return UnderAttack(proved)


def prove(attack: Attack) -> Claim:
    """Answer an attack with the reference: outcomes, enclosures, and the certificate of all of it."""
    scene, state = attack.scene, attack.state
    if attack.n_collisions is None:
        assert attack.t_end is not None
        outcome = reference.next_collision(scene, state, attack.t_end, digits=DIGITS)
        answers = [claimed(outcome, (Fraction(state.t), Fraction(state.t)))]
        if isinstance(outcome, Undecided | Rejected):
            return Claim(answers)
        return Claim(answers, certificate(scene, state, attack.t_end, outcome))
    try:
        path = reference.trajectory(scene, state, attack.n_collisions, attack.t_end, working=attack.working)
    except BadInput as error:
        return Claim([Rejected(str(error))])
    since = Fraction(state.t), Fraction(state.t)
    answers = []
    for step in path.steps:
        answers.append(claimed(step, since))
        since = ends(step.after.t)
    if path.outcome is not None:
        answers.append(claimed(path.outcome, since))
    if attack.t_end is None and isinstance(path.outcome, Undefined):
        return Claim(answers)  # without a horizon the proof of an undefined end cannot be written down
    return Claim(answers, path_certificate(scene, state, attack.t_end, path))


def claimed(outcome: reference.Outcome, since: Ends) -> Answer:
    """Return one of the reference's outcomes, reached from time `since`: collisions and horizons enclosed."""
    if isinstance(outcome, reference.Collision):
        return Enclosed(outcome.wall, [ends(number) for number in (outcome.dt, *outcome.after[1:])])
    if isinstance(outcome, reference.Horizon):
        if not isfinite(outcome.at.t.hi):  # a particle at rest, followed without a horizon
            return outcome.rounded()
        return Enclosed(None, list(coasted(outcome, since).values()))
    return outcome


def flow(scene: Scene, state: State, t_end: float) -> dict[str, int] | None:
    """Return how often the lanes meet each wall up to t_end; None where a flow is undecided or refused."""
    try:
        carried = fast.flow(scene, [state], t_end)
    except BadInput:
        return None
    if not isinstance(carried.outcomes[0], Horizon | Undefined):
        return None
    return dict(zip(Mushroom.walls, map(int, carried.wall_counts[0]), strict=True))
