"""From a question to a certified vector: the reference proves, a second arithmetic proves again.

Steps: every certificate of the reference, undefined outcomes included, is re-proved in Arb, and the
enclosures that are written down (24 decimals, rounded outward) hold the re-proved ones. Trajectories: the
whole path is re-proved, each step from the box that the one before leads to
(`second_proof.trajectory`); each step from the rounded state before it is re-proved to meet the same wall
first; and the written enclosures are re-proved along the whole path by `second_proof.chain`.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import fsum, inf, isfinite
from typing import Any, Literal, NamedTuple

import msgspec

import reference
from conformance.generator.prover import ask, coasted, collided, ends, expectation, flight_of
from conformance.grading.error import Matrix, condition_number, free_flight, inputs_of, moved
from conformance.second_proof.chain import recheck
from conformance.second_proof.step import check
from conformance.second_proof.trajectory import check_path
from conformance.vectors import NUMBERS, Certified, Expectation, Level, Vector, certified, four_digits
from reference.certificate import certificate, path_certificate
from scene import BadInput, InvalidState, Rejected, Scene, State, Undecided, Undefined, from_data

NUDGES: tuple[tuple[Level, float], ...] = (("core", 2.0**-30), ("extended", 2.0**-44))
CONDITIONS = {"core": 1e6, "extended": 1e12}
LONGEST = 1e8  # condition number up to which a trajectory is followed
INFINITE = 1e300
# Pairs, so that one of each pair lies on either side of a tie; a trajectory takes the first pair.
SIGNS = ((1, 1, -1, 1, -1), (-1, -1, 1, -1, 1), (1, 1, 1, 1, 1), (-1, -1, -1, -1, -1))
Outcome = Literal["collision", "horizon", "undefined", "undecided", "rejected"]


class Question(NamedTuple):
    """What a vector asks, and how its vector is filed.

    Attributes:
        group: first part of its id.
        rule: what it tests.
        source: place in the paper, or hard case.
        scene: the wire's form.
        state: the start.
        t_end: horizon [time].
        collisions: None for a step; for a trajectory how many are tried.
        also: outcomes that are right beside the proved one.
        level: None to measure it.
        longest: condition number up to which a trajectory is followed.
    """

    group: str
    rule: str
    source: str
    scene: dict[str, Any]
    state: State
    t_end: float
    collisions: int | None = None
    also: tuple[Outcome, ...] = ()
    level: Level | None = None
    longest: float = LONGEST


class Unfit(Exception):  # noqa: N818 (a finding about the draw)
    """The question has no certified answer that fits its rule; another must be asked."""


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
    is_path = question.collisions is not None
    scene: Scene | None = None
    try:
        scene = from_data(question.scene)
    except BadInput:
        proved = _Proved((Expectation("rejected"),))
    else:
        proved = _trajectory(scene, question) if is_path else _step(scene, question)
    also = [Expectation(kind) for kind in question.also]
    expect = tuple(dict.fromkeys([*proved.expect, *also]))
    if not expect:
        raise Unfit("the reference is undecided")
    vector = Vector(
        id=f"{question.group}/{number}",
        group=question.group,
        level="stress",
        kind="trajectory" if is_path else "step",
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
    allowance = _finite(flight.allowance(state))
    return _Proved((answer,), _condition(flight.centre(), allowance))


def _trajectory(scene: Scene, question: Question) -> _Proved:
    """Follow a particle as far as the chained condition number allows, or to the horizon."""
    assert question.collisions is not None
    try:
        path = reference.trajectory(scene, question.state, question.collisions, question.t_end)
    except InvalidState as error:
        raise Unfit(str(error)) from None
    check_path(path_certificate(scene, question.state, question.t_end, path))
    links = _Links(scene, question.state, question.t_end)
    steps: list[Certified] = []
    for found in path.steps:
        allowance = links.add(found)
        if links.condition > question.longest:
            break
        links.largest = max(links.largest, links.condition)
        steps.append(certified(collided(found), _finite(allowance), found.wall, is_wide=True))
    if not steps:
        raise Unfit("no collision is met, or the first is too delicate")
    expect = [Expectation("collision", tuple(steps))]
    end = path.outcome if len(steps) == len(path.steps) else None
    if isinstance(end, reference.Horizon):
        steps.append(links.coast(end, path.steps[-1].after.t))
        links.largest = max(links.largest, links.condition)
        expect = [Expectation("horizon", tuple(steps))]
    elif isinstance(end, Undefined):
        expect = [
            Expectation("undefined", tuple(steps), end.reason),
            Expectation("undecided", tuple(steps)),
        ]
    elif end is not None:
        raise Unfit("the reference is undecided")
    recheck(scene, question.state, question.t_end, steps)
    return _Proved(tuple(expect), links.largest, len(steps) + isinstance(end, Undefined))


class _Links:
    """The steps of a trajectory: their Jacobians chained from each state that a stepper has held.

    Each Jacobian is that of the step from the rounded state, with the residual of the wall moving along.
    """

    def __init__(self, scene: Scene, state: State, t_end: float) -> None:
        self.scene, self.state, self.t_end = scene, state, t_end
        self.held: list[tuple[Matrix, list[float]]] = []
        self.condition = self.largest = 0.0

    def add(self, found: reference.Collision) -> list[float]:
        """Add a step: prove it again from the rounded state, and return what all rounding may do to it."""
        proved = ask(self.scene, self.state, self.t_end)
        if not isinstance(proved, reference.Collision) or proved.wall != found.wall:
            raise Unfit("a rounded state takes another path")
        check(certificate(self.scene, self.state, self.t_end, proved))
        centre = [float(found.dt), *(float(c) for c in found.after[1:])]
        allowance = self._chain(flight_of(proved, self.state, self.t_end).jacobian, centre)
        self.state = found.rounded().state()
        return allowance

    def coast(self, horizon: reference.Horizon, since: reference.Enclosure) -> Certified:
        """Return the horizon after the last collision, at time `since`."""
        numbers = coasted(horizon, ends(since))
        centre = [float(sum(numbers[name]) / 2) for name in NUMBERS]
        allowance = self._chain(free_flight(self.state, centre[0]), centre)
        return certified(numbers, _finite(allowance), None, is_wide=True)

    def _chain(self, jacobian: Matrix, centre: list[float]) -> list[float]:
        self.held.append(([[float(i == j) for j in range(5)] for i in range(5)], inputs_of(self.state)))
        allowance = [0.0] * 5
        for k, (earlier, inputs) in enumerate(self.held):
            rows = [
                [fsum(a * b[j] for a, b in zip(row, earlier, strict=True)) for j in range(5)]
                for row in jacobian
            ]
            allowance = [a + moved(row, inputs) for a, row in zip(allowance, rows, strict=True)]
            rows[0] = [a + b for a, b in zip(rows[0], earlier[0], strict=True)]
            self.held[k] = (rows, inputs)
        self.condition = _condition(centre, allowance)
        return allowance


def _condition(centre: Sequence[float], allowance: Sequence[float]) -> float:
    # The inputs' part in each output is summed already.
    return condition_number(centre, [[part] for part in allowance], [1.0])


def _finite(allowance: Sequence[float]) -> Sequence[float]:
    if not all(map(isfinite, allowance)):
        raise Unfit("an allowance overflows")
    return allowance


def _level(scene: Scene | None, vector: Vector) -> Level:
    first = vector.expect[0]
    if scene is None or first.outcome == "rejected":
        return "extended"
    if first.outcome in ("undefined", "undecided"):
        return "stress"
    expected = _walls_met(scene, vector, vector.state)
    patterns = SIGNS if vector.kind == "step" else SIGNS[:2]
    for level, nudge in NUDGES:
        nudged = (_nudged(vector.state, vector.t_end, signs, nudge) for signs in patterns)
        if vector.condition <= CONDITIONS[level] and all(
            _walls_met(scene, vector, state) == expected for state in nudged
        ):
            return level
    return "stress"


def _nudged(state: State, t_end: float, signs: Sequence[int], nudge: float) -> State:
    place, speed = max(abs(state.x), abs(state.y)), max(abs(state.vx), abs(state.vy))
    sizes = (abs(state.t), place, place, speed, speed)
    values = [v + nudge * sign * size for v, sign, size in zip(inputs_of(state), signs, sizes, strict=True)]
    t, x, y, vx, vy = values
    return State(min(t, t_end), x, y, vx, vy, state.wall)


def _walls_met(scene: Scene, vector: Vector, state: State) -> list[str]:
    """Return the walls that a state meets, and how it ends."""
    if vector.kind == "step":
        outcome = reference.next_collision(scene, state, vector.t_end, digits=15)
        return [outcome.wall if isinstance(outcome, reference.Collision) else type(outcome).__name__]
    try:
        path = reference.trajectory(scene, state, vector.collisions, vector.t_end, digits=10)
    except InvalidState:
        return ["Rejected"]
    return [*(step.wall for step in path.steps), type(path.outcome).__name__]
