"""Certified answers of trajectories and flows, made from the reference's paths."""

from __future__ import annotations

from fractions import Fraction

import reference
from conformance.cases.draw import Unfit
from conformance.cases.links import Links, finite
from conformance.cases.prover import coasted, collided, ends
from conformance.cases.question import Proved, Question
from conformance.cases.stays import OpenSign, arrival, marks, stays, timing_condition
from conformance.vectors import NUMBERS, Certified, Expectation, certified
from scene import InvalidState, Scene, State, Undecided, Undefined

WIDEST = Fraction(1, 2**72)  # of an enclosure of a path: a millionth of a backward ulp and less


def proved_path(scene: Scene, question: Question, working: int | None = None) -> Proved:
    """Follow a particle as far as the chained condition number allows, or to the horizon.

    Args:
        scene: table and laws, of the question.
        question: of a trajectory or a flow.
        working: number of decimals to work with, by default what the reference takes. It answers for the
            digits of the last collision asked for; a path that ends at a horizon may need more.

    Raises:
        Unfit: there is no answer to certify.
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
    links = Links(scene, state, t_end, is_timed=question.flow is None)
    steps = _steps(links, path, question)
    if len(steps) < len(path.steps):
        end = None
    if isinstance(end, reference.Horizon):
        steps.append(links.coast(end, path.steps[-1].after.t if path.steps else None))
        links.largest = max(links.largest, links.condition)
    elif end is not None and not isinstance(end, Undefined):
        raise Unfit("the reference is undecided")
    if any(map(_is_wide, steps)):
        return proved_path(scene, question, 2 * path.digits)
    if question.flow:
        arrived = arrival(steps, stays(captured))
        largest = max(links.condition, timing_condition(arrived, state))
        if largest > question.longest:
            raise Unfit("the horizon is too delicate")
        return Proved((arrived,), largest, len(steps))
    expect = [Expectation("horizon" if end else "collision", tuple(steps))]
    if isinstance(end, Undefined):
        expect = [Expectation("undefined", tuple(steps), end.reason), Expectation("undecided", tuple(steps))]
    return Proved(tuple(expect), links.largest, len(steps) + isinstance(end, Undefined))


def _steps(links: Links, path: reference.Trajectory, question: Question) -> list[Certified]:
    """Write down the collisions of a path as far as the condition number allows; of a flow all."""
    steps: list[Certified] = []
    for found in path.steps:
        allowance = links.add(found)
        if links.condition > question.longest:
            break
        links.largest = max(links.largest, links.condition)
        steps.append(certified(collided(found), finite(allowance), found.wall, is_wide=True))
    if len(steps) < (len(path.steps) if question.flow else 1):
        raise Unfit("no collision is met, or the first is too delicate")
    return steps


def claimed_path(
    scene: Scene, state: State, n_collisions: int, t_end: float, working: int | None = None
) -> Expectation:
    """Return the reference's path however it ends, undecided included; allowances are left out.

    Args:
        scene: table and laws.
        state: the start.
        n_collisions: how many to follow.
        t_end: horizon [time].
        working: decimals to work with, by default what the reference takes.
    """
    try:
        path = reference.trajectory(scene, state, n_collisions, t_end, working=working)
    except InvalidState:
        return Expectation("rejected")
    unknown, end = [0.0] * len(NUMBERS), path.outcome
    steps = [certified(collided(found), unknown, found.wall, is_wide=True) for found in path.steps]
    if isinstance(end, Undefined):
        return Expectation("undefined", tuple(steps), end.reason)
    if isinstance(end, Undecided):
        return Expectation("undecided", tuple(steps), end.reason)
    if isinstance(end, reference.Horizon):
        since = ends(path.steps[-1].after.t) if steps else (Fraction(state.t), Fraction(state.t))
        steps.append(certified(coasted(end, since), unknown, None, is_wide=True))
    return Expectation("horizon" if end else "collision", tuple(steps))


def _is_wide(step: Certified) -> bool:
    """Tell whether an enclosure is wider than a small part of what rounding may do."""
    for name, allowance in zip(NUMBERS, step.allowance, strict=True):
        low, high = step.ends(name)
        if high - low > WIDEST * (Fraction(allowance) + max(abs(low), abs(high))):
            return True
    return False
