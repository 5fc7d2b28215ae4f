"""Does an answer agree with a certified one? One comparison, for all who grade.

An agreement is the same outcome, the same walls in the same order, and numbers that are right as
physics: a backward error of at most 1e-9, |out - truth| / (allowance + |out|). Place and velocity
are each taken as a vector (its largest allowance and component), so that a stepper which computes
normals from angles is not refused for 1e-17 where the exact zero is right. A caller may also bound
the backward ulps of every single component. In a trajectory all steps are held to the same bounds,
with chained allowances.

The one measure of precision is backward ulps:

    |out - truth| / (sum over inputs |d out / d in| |in| u + |out| u),    u = 2^-53

counts how many units in the last place the inputs and the output would have to move to explain the
answer. It is as fair to a grazing hit, where every stepper must lose digits, as to a head-on one.
The sum over the inputs is the `allowance` that a certified answer carries
(`conformance.vectors.Certified`).

Both the truth and the answer may be enclosures. Numbers count as right, or as wrong, only where
they are so for all numbers of the enclosures; else the comparison is `indeterminate`. An answer
`undecided` is never wrong; callers count it. The reason of an undefined outcome must be the
certified one; no other is compared.

The verdict on an answer (`grade`) keeps physics apart from precision. Physics asks for agreement,
with less than 1e-9 where the condition number is above 1e6 (`physics_bound`). Where the enclosures
of the truth are too wide to tell, the verdict is `indeterminate`, which is the corpus's defect.
Trajectories end before the condition number reaches 1e8; only hard case 30 goes on, where the walls
are the question.

- `undecided` where an answer is due is `declined`; so is a trajectory that ends so, after right
  steps.
- Where a vector allows `rejected` beside an answer (a time so late, numbers so large), `undecided`
  will do.
- Where the mathematics gives no answer (`undefined`), `undecided` is right too, and listed in the
  vector.
- `rejected` for a valid question is `fail`: what an implementation cannot do it says in its
  introduction, and is then not asked (`unsupported`, the runner's verdict, as `crashed` and
  `timed-out` are).
- An answer {"error": "..."} is `error`; missing or ill-typed fields are `wrong-format`, and so are
  numbers that are none (JSON has no nan). Further fields are ignored. The reason of `undefined` is
  compared, others are not.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Any, Literal, NamedTuple

import msgspec

from conformance.vectors import NUMBERS, Certified, Ends, Expectation, Vector
from scene import Collision, Horizon, Outcome, Rejected, State, Undecided, Undefined, Wall
from scene.protocol.messages import Answered, AnsweredCollision, Flown, Steps
from scene.protocol.rules import does_undecided_pass

U = Fraction(1, 2**53)
LEAST = Fraction(1, 2**1075)  # half the spacing of subnormal numbers: nothing rounds better
BOUND = Fraction(1, 10**9)  # physics: far above rounding, far below any error of principle
DIGITS = Fraction(1, 1000)  # what passes is right to
SHARPEST = Fraction(1, 2**43)  # a thousand backward ulps
NEAR_HIT = Fraction(1, 10)  # of the flight time
# dt, t, place, velocity: what is judged as one vector.
VECTORS = (("dt",), ("t",), ("x", "y"), ("vx", "vy"))
PrecisionClass = Literal["A", "B", "C"]
FORMS: dict[str, Any] = {"step": Answered, "trajectory": Steps, "flow": Flown}
LOST = ("undefined", "undecided", "rejected")  # may be answered to a whole question
SHARP = 4.0  # backward ulps of class A
FAIR = 1e4  # and of class B
# Of several right answers the best grade counts; this is the order.
_PREFERENCE = ("pass", "indeterminate", "declined", "fail")
Verdict = Literal["pass", "fail", "indeterminate", "declined", "error", "wrong-format"]


class Enclosed(NamedTuple):
    """A collision or horizon whose numbers are given more closely than binary64 holds them.

    Attributes:
        wall: the wall met; None at the horizon.
        ends: low and high of dt, x, y, vx, vy; equal where a number is exact.
    """

    wall: Wall | None
    ends: Sequence[Ends]


Answer = Outcome | AnsweredCollision | Enclosed


def exact(wall: Wall | None, numbers: Sequence[Fraction]) -> Enclosed:
    """Return a collision, or the horizon, by exact numbers dt, x, y, vx, vy."""
    return Enclosed(wall, [(number, number) for number in numbers])


class Agreement(NamedTuple):
    """How an answer compares.

    Attributes:
        verdict: `pass`, or `fail` where an outcome, a wall, a number or the length of a trajectory
            differs; `declined` where the answer is undecided; `indeterminate` where the truth
            cannot tell; `error` or `wrong-format` where nothing was compared (`grade`).
        ulps: worst backward ulps of a component, nan when not measured.
        relative: worst backward error, likewise.
        why: one line.
        step: the one that differs first, counted from 0; of a flow its end, 0.
    """

    verdict: Verdict
    ulps: float = math.nan
    relative: float = math.nan
    why: str = ""
    step: int = 0


class _Error(NamedTuple):
    """Bounds of the backward error of one component over the enclosures."""

    where: str
    least: Fraction | float
    most: Fraction | float
    least_ulps: Fraction | float
    most_ulps: Fraction | float


def backward_ulps(error: Fraction, size: Fraction) -> Fraction | float:
    """Return |out - truth| in units of u times a size (allowance plus |out|).

    It is inf where only 0 is right.
    """
    if not size:
        return math.inf if error else Fraction(0)
    return error / max(size * U, LEAST)


def physics_bound(condition: float) -> Fraction:
    """Return the backward error that is granted as physics, by the condition number.

    An answer that passes is right to three digits, as long as a thousand backward ulps allow that:
    1e-9 up to a condition of 1e6, and 1e-3 / condition beyond. A phase ten billion periods on must
    not be off by ten.
    """
    return min(BOUND, max(DIGITS / Fraction(max(condition, 1.0)), SHARPEST))


def compare(
    answer: Answer | list[Answer],
    expected: Expectation | None,
    state: State,
    bound: float | None = None,
    physics: Fraction = BOUND,
    *,
    is_end: bool = False,
) -> Agreement:
    """Compare an answer with the truth.

    Args:
        answer: of a step; of a trajectory a list of its steps, with what came instead of a further
            one.
        expected: certified; None where the proof itself is undecided.
        state: the start.
        bound: backward ulps allowed in every component; None where physics is all that is asked.
        physics: backward error allowed, of vectors.
        is_end: whether only the last certified step is answered, as by a flow.

    Returns:
        What differs first, with the worst errors of the numbers where they were compared.
    """
    answers = answer if isinstance(answer, list) else [answer]
    if expected is None:
        return _without_proof(answers)
    due = list(zip(expected.steps, _times(expected, state), strict=True))[-1 if is_end else 0 :]
    measured: list[_Error] = []
    for i, (certified, time) in enumerate(due):
        place = f"step {i + 1}: " if isinstance(answer, list) else ""
        if i >= len(answers):
            return Agreement("fail", why=f"{place}missing, {i} of {len(due)} were given", step=i)
        differing = _difference(answers[i], certified)
        if differing:
            return differing._replace(why=(place + differing.why)[:200], step=i)
        errors = _measure(answers[i], certified, time, place)
        measured += errors
        if max((error.least for error in errors), default=Fraction(0)) > physics:
            judged = _judge_numbers(measured, bound, physics)
            return judged._replace(why=judged.why + _missed(answers[i], certified), step=i)
    end = _judge_end(expected, answers[len(due) :])
    return end._replace(step=len(due)) if end else _judge_numbers(measured, bound, physics)


def _without_proof(answers: list[Answer]) -> Agreement:
    """Return the verdict where the proof itself is undecided."""
    is_undecided = any(isinstance(step, Undecided) for step in answers)
    return Agreement("declined" if is_undecided else "indeterminate", why="the proof is undecided")


def compare_arrival(
    answer: Answered,
    captured: tuple[float, float] | None,
    expected: Expectation,
    state: State,
    physics: Fraction = BOUND,
) -> Agreement:
    """Compare what a flow says of one particle with the truth.

    Args:
        answer: the outcome at t_end.
        captured: begin and end of the first capture interval [time]; None without one.
        expected: certified, with the capture intervals and the collisions that begin and end them.
        state: the start.
        physics: backward error allowed.

    Returns:
        As `compare`; `numbers` too where a stay is missing, invented, or begins or ends at a wrong
        time.
    """
    judged = compare(answer, expected, state, physics=physics, is_end=True)
    if judged.verdict != "pass" or expected.outcome != "horizon":
        return judged
    if (captured is None) != (not expected.stays):
        said = (
            "none"
            if captured is None
            else f"a capture interval from {captured[0]!r} to {captured[1]!r}"
        )
        first = (
            f"the capture interval {expected.stays[0]} of its steps" if expected.stays else "none"
        )
        return judged._replace(verdict="fail", why=f"captured: {said}, must be {first}")
    if captured is None:
        return judged
    times = list(_times(expected, state))
    for name, end, place in zip(("begin", "end"), captured, expected.stays[0], strict=True):
        (low, high), allowance = times[place]
        error = max(Fraction(end) - high, low - Fraction(end), Fraction(0))
        if error > physics * (allowance + abs(Fraction(end))):
            why = f"captured: its {name} is {end!r}, must be {float(low)!r} (step {place + 1})"
            return judged._replace(verdict="fail", why=why)
    return judged


def middle(expected: Expectation, state: State) -> list[Outcome]:
    """Return the middle of the certified answer, rounded to binary64: one outcome a step.

    Args:
        expected: the certified answer.
        state: the start.
    """
    found: list[Outcome] = []
    t = Fraction(state.t)
    for step in expected.steps:
        dt, *numbers = (step.centre(name) for name in NUMBERS)
        t += dt
        place = float(t), *map(float, numbers)
        found.append(Collision(step.wall, float(dt), *place) if step.wall else Horizon(*place))
    if expected.outcome not in ("collision", "horizon"):
        data = {"outcome": expected.outcome, "reason": expected.reason or "as certified"}
        found.append(msgspec.convert(data, Outcome))
    return found


def _difference(answer: Answer, certified: Certified) -> Agreement | None:
    """Return how an answer differs in outcome or wall; None when it does not."""
    if isinstance(answer, Undecided):
        return Agreement("declined", why=f"undecided: {answer.reason}")
    due = certified.wall or "horizon"
    if isinstance(answer, Rejected | Undefined):
        return Agreement("fail", why=f"{_name(answer)}, must be {due}: {answer.reason}")
    met = None if isinstance(answer, Horizon) else answer.wall
    if met == certified.wall:
        return None
    why = f"{met or 'horizon'}, must be {due}{_missed(answer, certified)}"
    return Agreement("fail", why=why)


def _missed(answer: Answer, certified: Certified) -> str:
    """Say what the flight time alone shows of a wrong answer.

    Either an earlier hit was missed, or one was invented.
    """
    if isinstance(answer, Horizon):
        return ", an earlier hit was missed" if certified.wall else ""
    if (
        not isinstance(answer, Collision | AnsweredCollision)
        or answer.dt is None
        or not math.isfinite(answer.dt)
    ):
        return ""
    low, high = certified.ends("dt")
    near = NEAR_HIT if answer.wall == certified.wall else BOUND  # a little off, it is the same hit
    slack = near * (Fraction(certified.allowance[0]) + abs(high))
    if Fraction(answer.dt) > high + slack:
        return ", an earlier hit was missed" if certified.wall else ", beyond t_end"
    return ", nothing is met so early" if Fraction(answer.dt) < low - slack else ""


def _judge_end(expected: Expectation, rest: Sequence[Answer]) -> Agreement | None:
    """Judge what follows the certified steps; None when it is right."""
    if expected.outcome in ("collision", "horizon"):
        return Agreement("fail", why=f"{len(rest)} steps too many") if rest else None
    if not rest:
        return Agreement("fail", why=f"must end as {expected.outcome}")
    kind = _name(rest[0])
    due = f"{expected.outcome} {expected.reason}".rstrip()
    said = f"undefined {rest[0].reason}" if isinstance(rest[0], Undefined) else kind
    if said == due or kind == expected.outcome != "undefined":
        return None
    return Agreement("declined" if kind == "undecided" else "fail", why=f"{said}, must be {due}")


def _name(answer: Answer) -> str:
    if isinstance(answer, Enclosed):
        return "collision" if answer.wall else "horizon"
    return str(answer.__struct_config__.tag)


def _judge_numbers(measured: Sequence[_Error], bound: float | None, physics: Fraction) -> Agreement:
    """Judge the numbers of an answer whose outcomes and walls are right.

    Of wrong ones the first is named: what is computed later follows from it.
    """
    if not measured:
        return Agreement("pass", why="the right outcome")
    worst = max(measured, key=lambda error: error.most)
    ulps = _rounded(max(error.most_ulps for error in measured))
    found = Agreement("pass", ulps, _rounded(worst.most), f"{ulps:.3g} backward ulps")
    for error in measured:
        if error.least > physics:
            off = f"{error.where} is off by {_rounded(error.most):.3g} (backward)"
            return found._replace(verdict="fail", why=off)
    if bound is not None and any(error.least_ulps > bound for error in measured):
        return found._replace(verdict="fail", why=f"numbers are off by {ulps:.3g} backward ulps")
    if worst.most > physics or (bound is not None and ulps > bound):
        return found._replace(verdict="indeterminate", why=f"{worst.where} is enclosed too widely")
    return found


def _times(expected: Expectation, state: State) -> Iterator[tuple[Ends, Fraction]]:
    """Return the enclosure of t after each certified step, and what it may be off by."""
    low = high = Fraction(state.t)
    allowance = abs(low)
    for certified in expected.steps:
        shortest, longest = certified.ends("dt")
        low = low + shortest
        high = high + longest
        allowance += Fraction(certified.allowance[0])
        yield (low, high), allowance


def _measure(
    answer: Answer, certified: Certified, time: tuple[Ends, Fraction], place: str
) -> list[_Error]:
    """Measure dt, t, place and velocity.

    A horizon has no dt, and an enclosed answer no t.
    """
    numbers = _numbers_of(answer)
    if not all(
        math.isfinite(end) for ends in numbers.values() for end in ends if isinstance(end, float)
    ):
        return [_Error(f"{place}a number that is not finite", *[math.inf] * 4)]
    answered = {name: (Fraction(low), Fraction(high)) for name, (low, high) in numbers.items()}
    truth = {name: certified.ends(name) for name in NUMBERS} | {"t": time[0]}
    allowances = dict(zip(NUMBERS, map(Fraction, certified.allowance), strict=True)) | {
        "t": time[1]
    }
    sizes = {name: allowances[name] + max(map(abs, ends)) for name, ends in answered.items()}
    found = []
    for vector in VECTORS:
        names = [name for name in vector if name in answered]
        scale = max([LEAST / U, *(sizes[name] for name in names)])
        for name in names:
            low, high = answered[name]
            certified_low, certified_high = truth[name]
            most = max(abs(high - certified_low), abs(certified_high - low))
            least = max(certified_low - high, low - certified_high, Fraction(0))
            # An exact zero that nothing can move, as y on the base, has no size of its own to be
            # measured by.
            is_zero = not allowances[name] and not any(truth[name])
            size = scale if is_zero else sizes[name]
            ulps = backward_ulps(least, size), backward_ulps(most, size)
            found.append(_Error(place + name, least / scale, most / scale, *ulps))
    return found


def _numbers_of(answer: Answer) -> dict[str, tuple[Fraction | float, Fraction | float]]:
    """Return the ends of the numbers that an answer has, by name."""
    if isinstance(answer, Enclosed):
        return dict(zip(NUMBERS, answer.ends, strict=True))
    numbers = {name: getattr(answer, name, None) for name in ("t", *NUMBERS)}
    return {name: (number, number) for name, number in numbers.items() if number is not None}


def _rounded(number: Fraction | float) -> float:
    try:
        return float(number)
    except OverflowError:
        return math.inf


def grade(vector: Vector, answer: Any) -> Agreement:
    """Judge an answer.

    Args:
        vector: the question and its certified answers.
        answer: what the implementation sent, decoded: a mapping, or the answer is none.

    Returns:
        Its `verdict` is pass, fail, indeterminate, declined, error or wrong-format; with the errors
        measured.
    """
    if isinstance(answer, Mapping) and isinstance(answer.get("error"), str):
        return Agreement("error", why=" ".join(answer["error"].split())[:200])
    try:
        parts = _parts(vector, answer)
        given = [msgspec.convert(msgspec.to_builtins(part), Answered) for part in parts]
    except (TypeError, msgspec.ValidationError, OverflowError, RecursionError) as error:
        return Agreement("wrong-format", why=" ".join(str(error).split()))
    graded = min(_compare_all(vector, parts, given), key=lambda one: _PREFERENCE.index(one.verdict))
    physics = physics_bound(vector.condition)
    if (
        graded.verdict == "pass"
        and not math.isnan(graded.relative)
        and vector.condition * physics >= 1
    ):
        none = f"the walls alone are graded: condition {vector.condition:.1g} allows no number"
        graded = graded._replace(why=none)
    outcomes = {known.outcome for known in vector.expect}
    if graded.verdict == "declined" and does_undecided_pass(outcomes):
        graded = graded._replace(verdict="pass", why=f"{graded.why}; a refusal is allowed here")
    if any(isinstance(outcome, AnsweredCollision) and outcome.dt is None for outcome in given):
        return graded._replace(why=f"{graded.why}; without dt, t is graded in its place")
    return graded


def _compare_all(
    vector: Vector, parts: list[Any], given: Sequence[Answered]
) -> Iterator[Agreement]:
    """Compare what was sent with each answer that the vector permits."""
    physics = physics_bound(vector.condition)
    for known in vector.expect:
        if vector.kind == "flow":
            captured = getattr(parts[0], "captured", None)
            yield compare_arrival(given[0], captured, known, vector.state, physics)
        else:
            asked: Answer | list[Answer] = list(given) if vector.kind == "trajectory" else given[0]
            yield compare(asked, known, vector.state, physics=physics)


def precision_class(ulps: Sequence[float]) -> PrecisionClass:
    """Return the class reached: A for at most 4 backward ulps, B for at most 1e4, else C.

    Args:
        ulps: of the answers that passed; nan (nothing measured) is left out.
    """
    worst = max((n for n in ulps if not math.isnan(n)), default=0.0)
    return "A" if worst <= SHARP else "B" if worst <= FAIR else "C"


def _parts(vector: Vector, answer: Any) -> list[Any]:
    """Decode an answer strictly into its outcomes; a refusal of the whole is the only one.

    Raises:
        msgspec.ValidationError: naming the field that is missing or of the wrong type.
        TypeError: the answer is no object.
        OverflowError, RecursionError: it is beyond all bounds.
    """
    form = Answered if {**answer}.get("outcome") in LOST else FORMS[vector.kind]
    whole = msgspec.convert({**answer, "seq": 0}, form)
    parts = list(getattr(whole, "steps", getattr(whole, "states", [whole])))
    if vector.kind == "flow" and len(parts) != 1:
        raise msgspec.ValidationError("`states` must be an array of one, as many as were asked")
    for i, part in enumerate(parts):
        fields = msgspec.structs.asdict(part)
        numbers = [*fields.values(), *(fields.get("captured") or ())]
        if i < len(parts) - 1 and not isinstance(part, AnsweredCollision):
            raise msgspec.ValidationError(
                f"steps[{i}]: only the last may be other than a collision"
            )
        if isinstance(part, AnsweredCollision) and part.wall is None:
            raise msgspec.ValidationError("`wall` is missing")
        if not all(math.isfinite(number) for number in numbers if isinstance(number, float)):
            raise msgspec.ValidationError(f"{part} has a number that is not finite")
    return parts
