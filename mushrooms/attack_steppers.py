"""Our steppers as attacks meet them: the reference's claims, the fast one's steps and flows."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import fast
import reference
from conformance.attacks import Attack, Claim, Steppers
from reference.arithmetic import Enclosure, rational
from reference.certificate import certificate, path_certificate
from scene import BadInput, Horizon, Scene, State, Undefined

DIGITS = 25  # of a single step: enough to tell enclosures from wrong answers
WALLS = ("arc", "base", "left", "right", "floor")


def steppers(choice: str) -> Steppers:
    """Return what "reference", "fast" or "both" puts under attack."""
    proved = prove if choice in ("reference", "both") else None
    if choice in ("fast", "both"):
        return Steppers(proved, fast.next_collision, flow)
    return Steppers(proved)


def prove(attack: Attack) -> Sequence[Claim]:
    """Answer an attack with the reference: outcomes, enclosures, and the certificate of all of it."""
    scene, state = attack.scene, attack.state
    if attack.n_collisions is None:
        assert attack.t_end is not None
        outcome = reference.next_collision(scene, state, attack.t_end, digits=DIGITS)
        claim = claimed(outcome)
        if isinstance(outcome, reference.Collision | reference.Horizon | Undefined):
            claim = claim._replace(certificate=certificate(scene, state, attack.t_end, outcome))
        return [claim]
    try:
        path = reference.trajectory(scene, state, attack.n_collisions, attack.t_end, working=attack.working)
    except BadInput as error:
        return [Claim("rejected", reason=str(error))]
    steps: list[reference.Outcome] = [*path.steps]
    claims = [claimed(step) for step in (steps if path.outcome is None else [*steps, path.outcome])]
    if attack.t_end is None and isinstance(path.outcome, Undefined):
        return claims  # without a horizon the proof of an undefined end cannot be written down
    return [claims[0]._replace(certificate=path_certificate(scene, state, attack.t_end, path)), *claims[1:]]


def claimed(outcome: reference.Outcome) -> Claim:
    """Return one of the reference's outcomes as a claim."""
    if isinstance(outcome, reference.Collision):
        numbers = [ends(outcome.dt), *(ends(number) for number in outcome.after[1:])]
        return Claim("collision", outcome.wall, numbers=numbers)
    if isinstance(outcome, reference.Horizon):
        return Claim("horizon")
    return Claim(type(outcome).__name__.lower(), reason=outcome.reason)


def ends(enclosure: Enclosure) -> tuple[Fraction, Fraction]:
    """Return the ends of an enclosure, exactly."""
    return rational(enclosure.lo._mpf_), rational(enclosure.hi._mpf_)


def flow(scene: Scene, state: State, t_end: float) -> dict[str, int] | None:
    """Return how often the lanes meet each wall up to t_end; None where a flow is undecided or refused."""
    try:
        carried = fast.flow(scene, [state], t_end)
    except BadInput:
        return None
    if not isinstance(carried.outcomes[0], Horizon | Undefined):
        return None
    return dict(zip(WALLS, map(int, carried.wall_counts[0]), strict=True))
