"""From a question to a certified vector: the reference proves, a second arithmetic proves again.

Steps: every certificate of the reference, undefined outcomes included, is re-proved in Arb, and the
enclosures that are written down (24 decimals, rounded outward) hold the re-proved ones. Trajectories: the
whole path is re-proved, each step from the box that the one before leads to
(`second_proof.trajectory`); each step from the rounded state before it is re-proved to meet the same wall
first; and the written enclosures are re-proved along the whole path by `second_proof.chain`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from math import inf
from typing import Any, Literal, NamedTuple

import msgspec

import reference
from conformance.generator.links import Links, Unfit, condition, finite
from conformance.generator.prover import (
    CONDITIONS,
    NUDGES,
    SIGNS,
    ask,
    collided,
    expectation,
    flight_of,
    nudged,
)
from conformance.generator.stays import Mark, OpenSign, arrival, marks, stays, timing_condition
from conformance.second_proof.chain import recheck
from conformance.second_proof.step import check
from conformance.second_proof.trajectory import check_path
from conformance.vectors import (
    NUMBERS,
    Certified,
    Expectation,
    Level,
    OutcomeName,
    Vector,
    certified,
    four_digits,
)
from reference.certificate import certificate, path_certificate
from scene import BadInput, InvalidState, Rejected, Scene, State, Undecided, Undefined, from_data

WIDEST = Fraction(1, 2**72)  # of an enclosure of a path: a millionth of a backward ulp and less
LONGEST = 1e8  # condition number up to which a trajectory is followed
INFINITE = 1e300


class Question(NamedTuple):
    """What a vector asks, and how its vector is filed.

    Attributes:
        group: first part of its id.
        rule: what it tests.
        source: place in the paper, or hard case.
        scene: the wire's form.
        state: the start.
        t_end: horizon [time].
        collisions: None for a step; for a trajectory how many are tried, for a flow how many at most.
        also: outcomes that are right beside the proved one.
        level: None to measure it.
        longest: condition number up to which a trajectory or a flow is followed.
        flow: None when it is none; else which of its collisions' marks (`stays.marks`) are looked for.
    """

    group: str
    rule: str
    source: str
    scene: dict[str, Any]
    state: State
    t_end: float
    collisions: int | None = None
    also: tuple[OutcomeName, ...] = ()
    level: Level | None = None
    longest: float = LONGEST
    flow: Callable[[Sequence[Mark]], bool] | None = None


class _Proved(NamedTuple):
    expect: tuple[Expectation, ...]
    condition: float = 0.0
    collisions: int = 1


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
        proved = _Proved((Expectation("rejected"),))
    else:
        proved = _step(scene, question) if question.collisions is None else _path(scene, question)
    also = [Expectation(kind) for kind in question.also]
    expect = tuple(dict.fromkeys([*proved.expect, *also]))
    if not expect:
        raise Unfit("the reference is undecided")
    vector = Vector(
        id=f"{question.group}/{number}",
        group=question.group,
        level="stress",
        kind=_kind(question),
        rule=question.rule,
        source=question.source,
        scene=question.scene,
        state=question.state,
        t_end=question.t_end,
        expect=expect,
        collisions=proved.collisions,
        condition=four_digits(min(proved.condition, INFINITE)),
    )
    return msgspec.structs.replace(vector, level=question.level or _level(scene, vector))


def _kind(question: Question) -> Literal["step", "trajectory", "flow"]:
    return "step" if question.collisions is None else "flow" if question.flow else "trajectory"


def _step(scene: Scene, question: Question) -> _Proved:
    state, t_end = question.state, question.t_end
    outcome = ask(scene, state, t_end)
    answer = expectation(outcome, state, t_end)
    if answer is None:
        return _Proved(())
    if isinstance(outcome, Rejected | Undecided):
        return _Proved((answer,))
    check(certificate(scene, state, t_end, outcome))
    if isinstance(outcome, Undefined):
        # A stepper in binary64 may find the tie within rounding, and say no more than that.
        return _Proved((answer, Expectation("undecided")), inf)
    flight = flight_of(outcome, state, t_end)
    allowance = finite(flight.allowance(state))
    return _Proved((answer,), condition(flight.centre(), allowance))


def _path(scene: Scene, question: Question, working: int | None = None) -> _Proved:
    """Follow a particle as far as the chained condition number allows, or to the horizon.

    `working` is the number of decimals to work with, by default what the reference takes. It answers for the
    digits of the last collision asked for; a path that ends at a horizon may need more.
    """
    assert question.collisions is not None
    state, t_end = question.state, question.t_end
    try:
        path = reference.trajectory(scene, state, question.collisions, t_end, working=working)
        captured = marks(scene, path.steps) if question.flow else []
    except (InvalidState, OpenSign) as error:
        raise Unfit(str(error)) from None
    end = path.outcome
    if question.flow and not (isinstance(end, reference.Horizon) and question.flow(captured)):
        raise Unfit("not the flow that is looked for")
    check_path(path_certificate(scene, state, t_end, path))
    links = Links(scene, state, t_end, is_timed=question.flow is None)
    steps: list[Certified] = []
    for found in path.steps:
        allowance = links.add(found)
        if links.condition > question.longest:
            break
        links.largest = max(links.largest, links.condition)
        steps.append(certified(collided(found), finite(allowance), found.wall, is_wide=True))
    if len(steps) < (len(path.steps) if question.flow else 1):
        raise Unfit("no collision is met, or the first is too delicate")
    if len(steps) < len(path.steps):
        end = None
    if isinstance(end, reference.Horizon):
        steps.append(links.coast(end, path.steps[-1].after.t if path.steps else None))
        links.largest = max(links.largest, links.condition)
    elif end is not None and not isinstance(end, Undefined):
        raise Unfit("the reference is undecided")
    if any(map(_is_wide, steps)):
        return _path(scene, question, 2 * path.digits)
    recheck(scene, state, t_end, steps, captured)
    if question.flow:
        arrived = arrival(steps, stays(captured))
        largest = max(links.condition, timing_condition(arrived, state))
        if largest > question.longest:
            raise Unfit("the horizon is too delicate")
        return _Proved((arrived,), largest, len(steps))
    expect = [Expectation("horizon" if end else "collision", tuple(steps))]
    if isinstance(end, Undefined):
        expect = [Expectation("undefined", tuple(steps), end.reason), Expectation("undecided", tuple(steps))]
    return _Proved(tuple(expect), links.largest, len(steps) + isinstance(end, Undefined))


def _is_wide(step: Certified) -> bool:
    """Tell whether an enclosure is wider than a small part of what rounding may do."""
    for name, allowance in zip(NUMBERS, step.allowance, strict=True):
        low, high = step.ends(name)
        if high - low > WIDEST * (Fraction(allowance) + max(abs(low), abs(high))):
            return True
    return False


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
