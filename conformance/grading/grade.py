"""The verdict on one answer: physics apart from precision.

Physics asks for the right outcome, the right walls in order, and numbers with a backward error of at most
1e-9, less where the condition number is above 1e6 (`agreement.physics_bound`). Precision is measured in
backward ulps, component by component. Where the enclosures of the truth are too wide to tell, the verdict is
`indeterminate`, which is the corpus's defect.

Trajectories end before the condition number reaches 1e8; only hard case 30 goes on, where the walls are the
question.

- `undecided` where an answer is due is `declined`; so is a trajectory that ends so, after right steps.
- Where a vector allows `rejected` beside an answer (a time so late, numbers so large), `undecided` will do.
- Where the mathematics gives no answer (`undefined`), `undecided` is right too, and listed in the vector.
- `rejected` for a valid question is `fail`: what an implementation cannot do it says in its introduction,
  and is then not asked (`unsupported`, the runner's verdict, as `crashed` and `timed-out` are).
- An answer {"error": "..."} is `error`; missing or ill-typed fields are `wrong-format`, and so are numbers
  that are none (JSON has no nan). Further fields are ignored. The reason of `undefined` is compared, others
  are not.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Literal, NamedTuple

import msgspec

from conformance.grading.agreement import Agreement, Answer, Kind, compare, compare_arrival, physics_bound
from conformance.vectors import Vector
from scene import Horizon
from scene.protocol.messages import Answered, AnsweredCollision

Verdict = Literal[
    "pass",
    "fail",
    "indeterminate",
    "declined",
    "unsupported",
    "error",
    "crashed",
    "timed-out",
    "wrong-format",
]
PrecisionClass = Literal["A", "B", "C"]
SHARP, FAIR = 4.0, 1e4  # backward ulps of classes A and B
# Of several right answers the best grade counts; this is the order.
_PREFERENCE: tuple[Verdict, ...] = ("pass", "indeterminate", "declined", "fail")
_VERDICTS: dict[Kind, Verdict] = {
    "agrees": "pass",
    "indeterminate": "indeterminate",
    "undecided": "declined",
    "numbers": "fail",
    "wall": "fail",
    "outcome": "fail",
    "length": "fail",
}


class Grade(NamedTuple):
    """What is found about one answer.

    Attributes:
        verdict: of its physics, or why there is none.
        ulps: worst backward ulps, nan when not measured.
        relative: worst backward error, nan when not measured.
        why: one line.
        step: the one that `why` is about, counted from 0.
    """

    verdict: Verdict
    ulps: float
    relative: float
    why: str
    step: int = 0


class _Misshapen(Exception):  # noqa: N818 (a finding about the answer)
    pass


def grade(vector: Vector, answer: Any) -> Grade:
    """Judge an answer.

    Args:
        vector: the question and its certified answers.
        answer: what the implementation sent, decoded: a mapping, or the answer is none.

    Returns:
        pass, fail, indeterminate, declined, error or wrong-format, with the errors measured.
    """
    if not isinstance(answer, Mapping):
        return _unmeasured("wrong-format", f"an answer must be an object, not {type(answer).__name__}")
    if isinstance(answer.get("error"), str):
        return _unmeasured("error", " ".join(answer["error"].split())[:200])
    physics = physics_bound(vector.condition)
    try:
        if vector.kind == "flow":
            arrival = _arrival(answer)
            found = [compare_arrival(*arrival, known, vector.state, physics) for known in vector.expect]
            return _noted(vector, _best(found))
        outcomes = _outcomes(vector, answer)
    except _Misshapen as finding:
        return _unmeasured("wrong-format", str(finding))
    asked: Answer | list[Answer] = outcomes if vector.kind == "trajectory" else outcomes[0]
    found = [compare(asked, known, vector.state, physics=physics) for known in vector.expect]
    graded = _noted(vector, _best(found))
    if graded.verdict == "declined" and {"rejected"} < {known.outcome for known in vector.expect}:
        graded = graded._replace(verdict="pass", why=f"{graded.why}; a refusal is allowed here")
    if any(isinstance(outcome, AnsweredCollision) and outcome.dt is None for outcome in outcomes):
        return graded._replace(why=f"{graded.why}; without dt, t is graded in its place")
    return graded


def _noted(vector: Vector, found: Grade) -> Grade:
    """Say of a right answer that its numbers could not have been wrong, where the condition allows none."""
    if (
        found.verdict != "pass"
        or math.isnan(found.relative)
        or vector.condition * physics_bound(vector.condition) < 1
    ):
        return found
    return found._replace(
        why=f"the walls alone are graded: condition {vector.condition:.1g} allows no number"
    )


def precision_class(ulps: Sequence[float]) -> PrecisionClass:
    """Return the class reached: A for at most 4 backward ulps in all answers, B for 1e4, C for the rest.

    Args:
        ulps: of the answers that passed; nan (nothing measured) is left out.
    """
    worst = max((n for n in ulps if not math.isnan(n)), default=0.0)
    return "A" if worst <= SHARP else "B" if worst <= FAIR else "C"


def _best(found: Sequence[Agreement]) -> Grade:
    """Return the grade against the certified answer that fits best."""
    grades = [Grade(_VERDICTS[one.kind], one.ulps, one.relative, one.why, one.step) for one in found]
    return min(grades, key=lambda grade: _PREFERENCE.index(grade.verdict))


def _unmeasured(verdict: Verdict, why: str) -> Grade:
    return Grade(verdict, math.nan, math.nan, why)


def _outcomes(vector: Vector, answer: Mapping[str, Any]) -> list[Answer]:
    """Decode an answer into outcomes, strictly."""
    if vector.kind == "step":
        return [_outcome(answer, "")]
    if "steps" not in answer and answer.get("outcome") in ("undefined", "undecided", "rejected"):
        return [_outcome(answer, "")]
    steps = answer.get("steps")
    if not isinstance(steps, Sequence) or isinstance(steps, str):
        raise _Misshapen("`steps` must be an array")
    found: list[Answer] = [_outcome(step, f"steps[{i}]: ") for i, step in enumerate(steps)]
    for i, outcome in enumerate(found[:-1]):
        if not isinstance(outcome, AnsweredCollision):
            raise _Misshapen(f"steps[{i}]: only the last may be other than a collision")
    return found


def _arrival(answer: Mapping[str, Any]) -> tuple[Answered, tuple[float, float] | None]:
    """Decode a flow of one particle: its outcome and first captured stay, strictly."""
    states = answer.get("states")
    if states is None and answer.get("outcome") in ("undefined", "undecided", "rejected"):
        return _outcome(answer, ""), None
    if not isinstance(states, Sequence) or isinstance(states, str) or len(states) != 1:
        raise _Misshapen("`states` must be an array of one, as many as were asked")
    outcome = _outcome(states[0], "states[0]: ")
    if isinstance(outcome, AnsweredCollision):
        raise _Misshapen("states[0]: a flow ends at t_end, not at a collision")
    try:
        captured = msgspec.convert(states[0].get("captured"), tuple[float, float] | None)
    except msgspec.ValidationError as error:
        raise _Misshapen(f"states[0].captured: {error}") from None
    if captured is not None and not isinstance(outcome, Horizon):
        raise _Misshapen("states[0].captured must be null or absent where no particle arrives")
    if captured is not None and not all(map(math.isfinite, captured)):
        raise _Misshapen("states[0].captured must be finite")
    return outcome, captured


def _outcome(data: Any, place: str) -> Answered:
    """Decode an outcome; a collision without `dt` is graded by its `t`, one without `wall` not at all."""
    try:
        outcome: Answered = msgspec.convert(data, Answered)
    except (msgspec.ValidationError, OverflowError, RecursionError) as error:
        raise _Misshapen(place + " ".join(str(error).split())) from None
    if isinstance(outcome, AnsweredCollision) and outcome.wall is None:
        raise _Misshapen(f"{place}`wall` is missing")
    for name in outcome.__struct_fields__:
        number = getattr(outcome, name)
        if isinstance(number, float) and not math.isfinite(number):
            raise _Misshapen(f"{place}{name} = {number}, must be finite")
    return outcome
