"""Ground truth of many steps: a trajectory with every state enclosed and proved.

All steps are taken at one working precision; when the last state is not enclosed to the digits asked for,
the whole trajectory begins again at twice that. What is claimed, and why it follows: docs/proof.md.
"""

import sys
from dataclasses import replace
from fractions import Fraction

from reference.answers import Jacobian, Outcome, ProvedCollision, Trajectory
from reference.arithmetic import Arithmetic, Exhausted, Undecidable, WorkLimit
from reference.chain import bounce, collision, fly_on, horizon
from reference.course import Course, Hit
from reference.jacobian import Matrix, chained, enclosures, identity, step_jacobian
from reference.start import depart
from reference.step import GUARD_DIGITS, MAX_DIGITS, checked_digits, require_digits
from scene import Scene, State, Undecided, Undefined, check_count, check_number
from scene.states import check_numbers

MAX_COLLISIONS = 1_000_000


def trajectory(
    scene: Scene,
    state: State,
    n_collisions: int,
    t_end: float | None = None,
    *,
    digits: int = 30,
    working: int | None = None,
    is_differentiated: bool = False,
) -> Trajectory:
    """Follow a particle. Every state is enclosed, the last one to `digits` decimals.

    Args:
        scene: table and laws of motion.
        state: the exact start.
        n_collisions: how many collisions to follow, 0 to 1,000,000.
        t_end: horizon [time], None for none. A particle that never meets a wall then ends with a Horizon
            at the flight time 2^1000.
        digits: decimals wanted of the last state, relative to the size of its vectors; 1 to 10,000. A
            position that may be 0 has this many digits relative to the length of the last flight.
        working: decimals to work with. The path ends with Undecided if they do not decide the next step, for
            any `digits`. By default they are doubled until they suffice.
        is_differentiated: whether to return the Jacobian of the whole path, and of each step.

    Raises:
        BadInput: naming field, value and bound.
    """
    digits = checked_digits(scene, digits)
    n_collisions = check_count("n_collisions", n_collisions, 0, MAX_COLLISIONS)
    if t_end is not None:
        t_end = check_number("t_end", t_end)
    if working is not None:
        working = check_count("working", working, 1, MAX_DIGITS)
        return _follow(Arithmetic(working), scene, state, t_end, n_collisions, None, is_differentiated)
    working = digits + GUARD_DIGITS + n_collisions // 4
    while True:
        try:
            return _follow(Arithmetic(working), scene, state, t_end, n_collisions, digits, is_differentiated)
        except Undecidable as question:
            if isinstance(question, Exhausted) or working > 8 * (digits + GUARD_DIGITS + n_collisions):
                return Trajectory([], Undecided(f"{question} ({working} digits)"), working)
            working *= 2


def _follow(
    arithmetic: Arithmetic,
    scene: Scene,
    state: State,
    t_end: float | None,
    n_collisions: int,
    digits: int | None,
    is_differentiated: bool,
) -> Trajectory:
    """Follow a particle at one working precision; with `digits` None, as far as it reaches.

    Raises:
        Undecidable: the precision does not suffice for the digits asked for.
        InvalidState: the start is not a state of this table.
    """
    state = check_numbers(scene, state, sys.float_info.max if t_end is None else t_end)
    matrix = identity(arithmetic) if is_differentiated else None
    steps: list[ProvedCollision] = []
    outcome: Outcome | None
    try:
        course = depart(arithmetic, scene, state, None if t_end is None else Fraction(t_end))
        outcome, jacobian = _extend(steps, n_collisions, course, matrix)
        if outcome is None and steps and digits is not None:
            require_digits(steps[-1], digits)
    except Undecidable as question:
        if digits is not None:
            raise
        outcome, jacobian = Undecided(f"{question} ({arithmetic.digits} digits)"), None
    return Trajectory(steps, outcome, arithmetic.digits, jacobian)


def _extend(
    steps: list[ProvedCollision], n_collisions: int, course: Course | Undefined, matrix: Matrix | None
) -> tuple[Outcome | None, Jacobian | None]:
    """Add steps until there are enough, or another outcome comes. Return it, else the Jacobian."""
    if isinstance(course, Undefined):
        return course, None
    arithmetic = course.arithmetic
    while len(steps) < n_collisions:
        arithmetic.work = WorkLimit()
        hit = course.event()
        if not isinstance(hit, Hit):
            return horizon(course) if hit is None else hit, None
        after = bounce(course, hit)
        found = collision(course, hit, after)
        if matrix is not None:
            own = step_jacobian(course, hit)
            matrix = chained(own, matrix)
            found = replace(found, jacobian=enclosures(arithmetic, own))
        steps.append(found)
        course = fly_on(course, hit, after)
    return None, None if matrix is None else enclosures(arithmetic, matrix)
