"""From a question to a certified vector: the reference proves, a second arithmetic proves again.

Steps: every certificate of the reference, undefined outcomes included, is re-proved in Arb, and the
enclosures that are written down (24 decimals, rounded outward) hold the re-proved ones. Trajectories: the
whole path is re-proved, each step from the box that the one before leads to
(`second_proof.trajectory`); each step from the rounded state before it is re-proved to meet the same wall
first; and the written enclosures are re-proved along the whole path by `second_proof.chain`.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf

import msgspec

import reference
from conformance.generator.links import Confirmation, Unfit, condition, finite
from conformance.generator.paths import proved_path
from conformance.generator.prover import CONDITIONS, NUDGES, SIGNS, ask, expectation, flight_of, nudged
from conformance.generator.question import Proved, Question, filed
from conformance.generator.stays import Mark, OpenSign, marks
from conformance.second_proof.chain import recheck
from conformance.second_proof.step import check
from conformance.second_proof.trajectory import check_path
from conformance.vectors import Certified, Expectation, Level, Vector, four_digits
from reference.certificate import certificate, path_certificate
from scene import BadInput, InvalidState, Rejected, Scene, State, Undecided, Undefined, from_data

INFINITE = 1e300


class InArb(Confirmation):
    """Proves again in Arb what the reference has proved."""

    def step(self, scene: Scene, state: State, t_end: float, found: reference.Collision) -> None:
        """Confirm a collision from a state."""
        check(certificate(scene, state, t_end, found))

    def path(self, scene: Scene, state: State, t_end: float, found: reference.Trajectory) -> None:
        """Confirm a path from a state, each step from the box that the one before leads to."""
        check_path(path_certificate(scene, state, t_end, found))

    def chain(
        self, scene: Scene, state: State, t_end: float, steps: Sequence[Certified], marks: Sequence[Mark]
    ) -> None:
        """Confirm the enclosures that are written down, and which hits are captured, along a whole path."""
        recheck(scene, state, t_end, steps, marks)


def certify(question: Question, number: int) -> Vector:
    """Answer a question, prove the answer twice, and measure how delicate it is.

    Args:
        question: what to ask.
        number: the vector's number within its group.

    Raises:
        Unfit: when there is no answer to certify.
        Refuted: when the second arithmetic does not confirm the first.
    """
    scene: Scene | None = None
    try:
        scene = from_data(question.scene)
    except BadInput:
        proved = Proved((Expectation("rejected"),))
    else:
        is_step = question.kind == "step"
        proved = _step(scene, question) if is_step else proved_path(scene, question, InArb())
    also = [Expectation(kind) for kind in question.also]
    expect = tuple(dict.fromkeys([*proved.expect, *also]))
    if not expect:
        raise Unfit("the reference is undecided")
    rounded = four_digits(min(proved.condition, INFINITE))
    vector = filed(question, number, proved._replace(expect=expect, condition=rounded), "stress")
    return msgspec.structs.replace(vector, level=question.level or _level(scene, vector))


def _step(scene: Scene, question: Question) -> Proved:
    state, t_end = question.state, question.t_end
    outcome = ask(scene, state, t_end)
    answer = expectation(outcome, state, t_end)
    if answer is None:
        return Proved(())
    if isinstance(outcome, Rejected | Undecided):
        return Proved((answer,))
    check(certificate(scene, state, t_end, outcome))
    if isinstance(outcome, Undefined):
        # A stepper in binary64 may find the tie within rounding, and say no more than that.
        return Proved((answer, Expectation("undecided")), inf)
    flight = flight_of(outcome, state, t_end)
    allowance = finite(flight.allowance(state))
    return Proved((answer,), condition(flight.centre(), allowance))


def _level(scene: Scene | None, vector: Vector) -> Level:
    first = vector.expect[0]
    if scene is None or first.outcome == "rejected":
        return "extended"
    if first.outcome in ("undefined", "undecided"):
        return "stress"
    expected = _walls_met(scene, vector, vector.state)
    patterns = SIGNS if vector.kind == "step" else SIGNS[:2]
    for level, nudge in NUDGES:
        states = (nudged(vector.state, vector.t_end, signs, nudge) for signs in patterns)
        if vector.condition <= CONDITIONS[level] and all(
            _walls_met(scene, vector, state) == expected for state in states
        ):
            return level
    return "stress"


def _walls_met(scene: Scene, vector: Vector, state: State) -> list[str]:
    """Return the walls that a state meets, which hits are captured where that is asked, and how it ends."""
    if vector.kind == "step":
        outcome = reference.next_collision(scene, state, vector.t_end, digits=15)
        return [outcome.wall if isinstance(outcome, reference.Collision) else type(outcome).__name__]
    try:
        path = reference.trajectory(scene, state, vector.collisions, vector.t_end, digits=10)
        found = marks(scene, path.steps) if vector.kind == "flow" else []
    except (InvalidState, OpenSign):
        return ["Rejected"]
    return [*(step.wall for step in path.steps), *found, type(path.outcome).__name__]
