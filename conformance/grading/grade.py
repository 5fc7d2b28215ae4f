"""The verdict on one answer: physics apart from precision, by exact rational comparison.

Physics asks for the right outcome, the right walls in order, and numbers with a backward error of at most
1e-9: |out - truth| / (allowance + |out|), place and velocity each taken as a vector (its largest allowance
and component), so that a stepper which computes normals from angles is not refused for 1e-17 where the exact
zero is right. Precision is measured in backward ulps, component by component, as everywhere
(`grading.error`). For both the truth is an enclosure: the verdict is `pass` or `fail` only when it is the
same for every number of the enclosure, else `indeterminate`, which is the corpus's defect.

Trajectories: the same bound for every step, with the allowances chained, and the walls in order. They end
before the condition number reaches 1e8, so 1e-9 leaves at least one digit; only hard case 30 goes on, where
the walls are the question.

- `undecided` where an answer is due is `declined`; so is a trajectory that ends so, after right steps.
- Where the mathematics gives no answer (`undefined`), `undecided` is right too, and listed in the vector.
- `rejected` for a valid question is `fail`: what an implementation cannot do it says in its introduction,
  and is then not asked (`unsupported`, the runner's verdict, as `crashed` and `timed-out` are).
- An answer {"error": "..."} is `error`; missing or ill-typed fields are `wrong-format`, and so are numbers
  that are none (JSON has no nan). Further fields are ignored. Reasons are not compared, only that they are
  of the protocol's.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any, Literal, NamedTuple

import msgspec

from conformance.grading.error import LEAST, U
from conformance.vectors import NUMBERS, Certified, Expectation, Vector
from scene import Collision, Horizon, Outcome, Rejected, Undecided, Undefined

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
BOUND = Fraction(1, 10**9)  # physics: far above rounding, far below any error of principle
SHARP, FAIR = 4.0, 1e4  # backward ulps of classes A and B
# Of several right answers the best grade counts; this is the order.
_PREFERENCE: tuple[Verdict, ...] = ("pass", "indeterminate", "declined", "fail")
# dt, t, place, velocity: what is judged as one vector.
_VECTORS = ((0,), (1,), (2, 3), (4, 5))
_COMPONENTS = ("dt", "t", "x", "y", "vx", "vy")


class Grade(NamedTuple):
    """What is found about one answer.

    Attributes:
        verdict: of its physics, or why there is none.
        ulps: worst backward ulps, nan when not measured.
        relative: worst backward error, nan when not measured.
        why: one line.
    """

    verdict: Verdict
    ulps: float
    relative: float
    why: str


class _Misshapen(Exception):  # noqa: N818 (a finding about the answer)
    pass


class _Measured(NamedTuple):
    """Bounds of an error over an enclosure; `where` names the worst component."""

    ulps: float
    least: Fraction
    most: Fraction
    where: str


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
    try:
        outcomes = _outcomes(vector, answer)
    except _Misshapen as finding:
        return _unmeasured("wrong-format", str(finding))
    grades = [_against(vector, expected, outcomes) for expected in vector.expect]
    return min(grades, key=lambda found: _PREFERENCE.index(found.verdict))


def precision_class(ulps: Sequence[float]) -> PrecisionClass:
    """Return the class reached: A for at most 4 backward ulps in all answers, B for 1e4, C for the rest.

    Args:
        ulps: of the answers that passed; nan (nothing measured) is left out.
    """
    worst = max((n for n in ulps if not math.isnan(n)), default=0.0)
    return "A" if worst <= SHARP else "B" if worst <= FAIR else "C"


def _unmeasured(verdict: Verdict, why: str) -> Grade:
    return Grade(verdict, math.nan, math.nan, why)


def _outcomes(vector: Vector, answer: Mapping[str, Any]) -> list[Outcome]:
    """Decode an answer into outcomes, strictly."""
    if vector.kind == "step":
        return [_outcome(answer, "")]
    if "steps" not in answer and answer.get("outcome") in ("undefined", "undecided", "rejected"):
        return [_outcome(answer, "")]
    steps = answer.get("steps")
    if not isinstance(steps, Sequence) or isinstance(steps, str):
        raise _Misshapen("`steps` must be an array")
    found = [_outcome(step, f"steps[{i}]: ") for i, step in enumerate(steps)]
    for i, outcome in enumerate(found[:-1]):
        if not isinstance(outcome, Collision):
            raise _Misshapen(f"steps[{i}]: only the last may be other than a collision")
    return found


def _outcome(data: Any, place: str) -> Outcome:
    try:
        outcome: Outcome = msgspec.convert(data, Outcome)
    except (msgspec.ValidationError, OverflowError, RecursionError) as error:
        raise _Misshapen(place + " ".join(str(error).split())) from None
    for name in outcome.__struct_fields__:
        number = getattr(outcome, name)
        if isinstance(number, float) and not math.isfinite(number):
            raise _Misshapen(f"{place}{name} = {number}, must be finite")
    return outcome


def _against(vector: Vector, expected: Expectation, outcomes: Sequence[Outcome]) -> Grade:
    """Judge outcomes by one of the right answers."""
    clock = _Clock(vector)
    measured: list[_Measured] = []
    for i, certified in enumerate(expected.steps):
        place = f"step {i + 1}: " if vector.kind == "trajectory" else ""
        if i >= len(outcomes):
            return _unmeasured("fail", f"{place}missing, {i} of {len(expected.steps)} were given")
        outcome = outcomes[i]
        if isinstance(outcome, Undecided):
            return _unmeasured("declined", f"{place}undecided: {outcome.reason}"[:200])
        met = outcome.wall if isinstance(outcome, Collision) else type(outcome).__name__.lower()
        if met != (certified.wall or "horizon"):
            why = f": {outcome.reason}" if isinstance(outcome, Rejected | Undefined | Undecided) else ""
            return _unmeasured("fail", f"{place}{met}, must be {certified.wall or 'horizon'}{why}"[:200])
        assert isinstance(outcome, Collision | Horizon)
        found = _measure(outcome, certified, clock)
        measured.append(found._replace(where=place + found.where))
        if found.least > BOUND:
            return _numbers(measured)
    return _judge_end(expected, outcomes[len(expected.steps) :]) or _numbers(measured)


def _judge_end(expected: Expectation, rest: Sequence[Outcome]) -> Grade | None:
    """Judge what follows the certified steps; None when it is right."""
    if expected.outcome in ("collision", "horizon"):
        return _unmeasured("fail", f"{len(rest)} steps too many") if rest else None
    if not rest:
        return _unmeasured("fail", f"must end as {expected.outcome}")
    kind = type(rest[0]).__name__.lower()
    if kind == expected.outcome:
        return None
    verdict: Verdict = "declined" if kind == "undecided" else "fail"
    return _unmeasured(verdict, f"{kind}, must be {expected.outcome} {expected.reason}".rstrip())


def _numbers(measured: Sequence[_Measured]) -> Grade:
    """Judge the numbers of an answer whose outcomes and walls are right."""
    if not measured:
        return _unmeasured("pass", "the right outcome")
    worst = max(measured, key=lambda found: found.most)
    ulps = max(found.ulps for found in measured)
    relative = _rounded(worst.most)
    if measured[-1].least > BOUND:
        return Grade("fail", ulps, relative, f"{worst.where} is off by {relative:.3g} (backward)")
    if worst.most > BOUND:
        return Grade("indeterminate", ulps, relative, f"{worst.where} is enclosed too widely")
    return Grade("pass", ulps, relative, f"{ulps:.3g} backward ulps")


class _Clock:
    """Time along an answer: the enclosure of t, and what it may be off by."""

    def __init__(self, vector: Vector) -> None:
        self.low = self.high = Fraction(vector.state.t)
        self.allowance = abs(self.low)
        self.t_end = Fraction(vector.t_end)

    def advance(self, certified: Certified) -> None:
        """Add a flight."""
        self.low += Fraction(certified.dt[0])
        self.high += Fraction(certified.dt[1])
        self.allowance += Fraction(certified.allowance[0])
        if certified.wall is None:
            self.low = self.high = self.t_end


def _measure(outcome: Collision | Horizon, certified: Certified, clock: _Clock) -> _Measured:
    """Measure dt (of a collision), t, place and velocity against their enclosures."""
    clock.advance(certified)
    enclosures = {name: tuple(map(Fraction, getattr(certified, name))) for name in NUMBERS}
    enclosures["t"] = clock.low, clock.high
    allowances = dict(zip(NUMBERS, map(Fraction, certified.allowance), strict=True))
    allowances["t"] = clock.allowance
    dt = outcome.dt if isinstance(outcome, Collision) else None
    values = (dt, outcome.t, outcome.x, outcome.y, outcome.vx, outcome.vy)
    ulps, worst, least = 0.0, Fraction(-1), Fraction(0)
    where = ""
    for members in _VECTORS:
        given = {_COMPONENTS[i]: Fraction(v) for i in members if (v := values[i]) is not None}
        size = max((allowances[name] + abs(out) for name, out in given.items()), default=Fraction(0))
        for name, out in given.items():
            low, high = enclosures[name]
            most = max(abs(out - low), abs(out - high))
            nearest = max(low - out, out - high, Fraction(0))
            ulps = max(ulps, _backward(most, allowances[name] + abs(out)))
            scale = max(size, LEAST / U)
            least = max(least, nearest / scale)
            if most / scale > worst:
                worst, where = most / scale, name
    return _Measured(ulps, least, worst, where)


def _backward(error: Fraction, size: Fraction) -> float:
    """Return backward ulps: inf where only the exact answer is right, and it is not given."""
    if not size:
        return 0.0 if not error else math.inf
    return _rounded(error / max(size * U, LEAST))


def _rounded(number: Fraction) -> float:
    try:
        return float(number)
    except OverflowError:
        return math.inf
