"""From a question to a certified vector: the reference answers, and the verifier proves what is written."""

from __future__ import annotations

import json
from math import inf

import msgspec

import reference
from conformance.cases.draw import Unfit
from conformance.cases.paths import OpenSign, condition, finite, marks, proved_path
from conformance.cases.prover import CONDITIONS, NUDGES, SIGNS, ask, expectation, flight_of, nudged
from conformance.cases.question import Proved, Question, filed
from conformance.vectors import Expectation, Level, Vector, four_digits
from conformance.verify import Verdict, verify_line
from scene import BadInput, InvalidState, Rejected, Scene, State, Undecided, Undefined, from_data

INFINITE = 1e300


class Refuted(BadInput):
    """The verifier holds the reference's answer to be false: one of the two is mistaken."""


def certify(question: Question, number: int) -> Vector:
    """Answer a question, measure how delicate it is, and have the line that is published proved.

    Args:
        question: what to ask.
        number: the vector's number within its group.

    Raises:
        Unfit: when there is no answer to certify, or the verifier cannot prove it.
        Refuted: when the verifier holds it to be false.
    """
    scene: Scene | None = None
    try:
        scene = from_data(question.wire_scene())
    except BadInput:
        proved = Proved((Expectation("rejected"),))
    else:
        is_step = question.kind == "step"
        proved = _step(scene, question) if is_step else proved_path(scene, question)
    also = [Expectation(kind) for kind in question.also]
    expect = tuple(dict.fromkeys([*proved.expect, *also]))
    rounded = four_digits(min(proved.condition, INFINITE))
    vector = filed(question, number, proved._replace(expect=expect, condition=rounded), "stress")
    vector = msgspec.structs.replace(vector, level=question.level or _level(scene, vector))
    verdict = judge(vector)
    if verdict.status != "proved":
        failure = Refuted if verdict.status == "false" else Unfit
        raise failure(f"{vector.id} is {verdict.status}: {verdict.reason}")
    return vector


def judge(vector: Vector) -> Verdict:
    """Have the line that a vector is published as proved, from that line alone."""
    return verify_line(json.loads(msgspec.json.encode(vector)))


def _step(scene: Scene, question: Question) -> Proved:
    state, t_end = question.state, question.t_end
    outcome = ask(scene, state, t_end)
    answer = expectation(outcome, state, t_end)
    if answer is None:
        raise Unfit("the reference is undecided")
    if isinstance(outcome, Rejected | Undecided):
        return Proved((answer,))
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
    if first.outcome == "undefined":
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
