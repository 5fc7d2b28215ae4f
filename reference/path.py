"""Ground truth of one step and of many.

Every collision and state enclosed, and proved at any precision.

`next_collision` answers one step; `trajectory` takes all steps at one working precision. Both begin
again with twice the digits until the answer is proved or a cap is reached; then they say
`Undecided`. What is claimed, and why it follows: docs/proof.md.

A collision's time is enclosed, so the state after it is carried along the new line of flight to an
exact instant within that enclosure. There place and velocity are boxes and the time is a number;
the flight itself begins a little before or after, at an enclosed flight time
(`EnclosedFlight.begin`).
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from typing import NamedTuple

from reference.answers import Jacobian, Moment, Outcome, ProvedCollision, ProvedHorizon, Trajectory
from reference.arithmetic import Arithmetic, Exhausted, Interval, Undecidable, WorkLimit, exact_ends
from reference.course import FOR_EVER, Course, Hit
from reference.jacobian import chained, enclosures, identity, step_jacobian
from reference.margins import measure
from reference.prepared import PreparedTable, prepare
from reference.start import depart
from reference.walls import EnclosedFlight, MovingWalls
from scene import (
    InvalidState,
    Rejected,
    Scene,
    State,
    Undecided,
    Undefined,
    check_count,
    check_number,
    check_scene,
)
from scene.states import check_numbers

GUARD_DIGITS = 15
MAX_DIGITS = 10_000
MAX_COLLISIONS = 1_000_000


def next_collision(
    scene: Scene,
    state: State,
    t_end: float,
    *,
    digits: int = 50,
    is_differentiated: bool = False,
    is_measured: bool = False,
) -> Outcome:
    """Find the first wall the particle meets after `state.t`, proved to be first.

    Args:
        scene: table and laws of motion; numbers are exact binary64.
        state: position (x, y) [length], velocity (vx, vy) [length/time], wall being left or None.
        t_end: horizon [time], t_end >= state.t; a wall met at t_end exactly is not met before it. A
            state at t_end has arrived: the outcome is Horizon, even if no flight could begin there.
        digits: correct decimals wanted, 1 to 10,000; guard digits are added inside.
        is_differentiated: whether to return the Jacobian of the step.
        is_measured: whether to return the margins of the collision.

    Returns:
        Collision, with its time enclosed to a relative 10**-digits; Horizon; Undefined; Undecided,
        also if the work for one step is used up; or Rejected for a state outside this table.

    Raises:
        BadInput: `scene` is not a scene or `digits` out of range, naming field, value and bound.

    Source: Gelfreich, Rom-Kedar, Turaev (2014), sec. 3.1. Method: isolate, exclude, refine.
    """
    digits = checked_digits(scene, digits)
    table = prepare(scene)
    least = digits + GUARD_DIGITS
    work = WorkLimit()

    def follow(working: int) -> Trajectory:
        arithmetic = Arithmetic(working, work)
        return _follow(arithmetic, table, state, t_end, 1, digits, is_differentiated, is_measured)

    try:
        state = check_numbers(scene, state, t_end)
        return _decided(follow, least, 4 * least).outcomes[0]
    except InvalidState as error:
        return Rejected(str(error))


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
        t_end: horizon [time], None for none. A particle that never meets a wall then ends with a
            Horizon at the flight time 2^1000.
        digits: decimals wanted of the last state, relative to the size of its vectors; 1 to 10,000.
            A position that may be 0 has this many digits relative to the length of the last flight.
        working: decimals to work with. The path ends with Undecided if they do not decide the next
            step, for any `digits`. By default they are doubled until they suffice.
        is_differentiated: whether to return the Jacobian of the whole path, and of each step.

    Raises:
        BadInput: naming field, value and bound.
    """
    digits = checked_digits(scene, digits)
    n_collisions = check_count("n_collisions", n_collisions, 0, MAX_COLLISIONS)
    if t_end is not None:
        t_end = check_number("t_end", t_end)
    state = check_numbers(scene, state, sys.float_info.max if t_end is None else t_end)
    table = prepare(scene)
    if working is not None:
        working = check_count("working", working, 1, MAX_DIGITS)
        return _follow(
            Arithmetic(working), table, state, t_end, n_collisions, None, is_differentiated
        )

    def follow(digits_now: int) -> Trajectory:
        return _follow(
            Arithmetic(digits_now), table, state, t_end, n_collisions, digits, is_differentiated
        )

    most = 8 * (digits + GUARD_DIGITS + n_collisions)
    return _decided(follow, digits + GUARD_DIGITS + n_collisions // 4, most)


def _decided(follow: Callable[[int], Trajectory], working: int, most: int) -> Trajectory:
    """Follow a particle with `working` digits, doubled until they suffice or exceed `most`."""
    while True:
        try:
            return follow(working)
        except Undecidable as question:
            if isinstance(question, Exhausted) or working > most:
                return Trajectory([], Undecided(f"{question} ({working} digits)"), working)
            working *= 2


def checked_digits(scene: Scene, digits: int) -> int:
    """Return a number of digits as an int.

    Raises:
        BadInput: `scene` is not a scene, or `digits` not a number in range.
    """
    check_scene(scene)
    return check_count("digits", digits, 1, MAX_DIGITS)


def require_digits(found: ProvedCollision, digits: int) -> None:
    """Require the digits asked for: of dt, and of velocity and position relative to their vectors.

    A position that may be 0, as in the middle of a base, has these digits relative to the flight's
    length.

    Raises:
        Undecidable: there are fewer.
    """
    bound = Fraction(1, 10**digits)
    after = found.after
    vectors = {"dt": (found.dt,), "velocity": (after.vx, after.vy), "place": (after.x, after.y)}
    for name, vector in vectors.items():
        size = max(abs(number.centre()) for number in vector)
        if name == "place" and all(number.contains(0.0) for number in vector):
            size = found.dt.centre() * max(abs(number.centre()) for number in vectors["velocity"])
        if max(number.extent() for number in vector) > bound * size:
            raise Undecidable(f"{name} is enclosed too widely")


def _follow(
    arithmetic: Arithmetic,
    table: PreparedTable,
    state: State,
    t_end: float | None,
    n_collisions: int,
    digits: int | None,
    is_differentiated: bool,
    is_measured: bool = False,
) -> Trajectory:
    """Follow a particle at one working precision; with `digits` None, as far as it reaches.

    Raises:
        Undecidable: the precision does not suffice for the digits asked for.
        InvalidState: the start is not in this table.
    """
    steps: list[ProvedCollision] = []
    outcome: Outcome | None
    try:
        course = depart(arithmetic, table, state, None if t_end is None else Fraction(float(t_end)))
        if isinstance(course, Undefined):
            # Nothing comes next, and nothing need come where no step is asked for, or no time is
            # left.
            end = arrived(arithmetic, state) if t_end == state.t else course
            return Trajectory(steps, end if n_collisions else None, arithmetic.digits)
        outcome, jacobian = _extend(steps, n_collisions, course, is_differentiated, is_measured)
        if outcome is None and steps and digits is not None:
            require_digits(steps[-1], digits)
    except Undecidable as question:
        if digits is not None:
            raise
        outcome = Undecided(f"{question} ({arithmetic.digits} digits)")
        jacobian = None
    return Trajectory(steps, outcome, arithmetic.digits, jacobian)


def _extend(
    steps: list[ProvedCollision],
    n_collisions: int,
    course: Course,
    is_differentiated: bool,
    is_measured: bool,
) -> tuple[Outcome | None, Jacobian | None]:
    """Add steps until there are enough, or another outcome comes. Return it, else the Jacobian."""
    arithmetic = course.arithmetic
    matrix = identity(course.arithmetic)
    while len(steps) < n_collisions:
        hit = course.event()
        if not isinstance(hit, Hit):
            return horizon(course) if hit is None else hit, None
        after = bounce(course, hit)
        found = collision(course, hit, after)
        if is_differentiated:
            own = step_jacobian(course, hit)
            matrix = chained(own, matrix)
            found = replace(found, jacobian=enclosures(arithmetic, own))
        if is_measured:
            found = replace(found, margins=measure(course, hit))
        steps.append(found)
        course = fly_on(course, hit, after)
        arithmetic.work = WorkLimit()  # for the next step
    return None, enclosures(arithmetic, matrix) if is_differentiated else None


class Bounce(NamedTuple):
    """What follows a hit: t, x, y, vx, vy just after it, and the next flight."""

    moment: tuple[Interval, Interval, Interval, Interval, Interval]
    flight: EnclosedFlight


def reflect(course: Course, hit: Hit) -> tuple[Interval, Interval]:
    """Return the velocity after a hit, v - 2 (v.n - u) n = v - 2 f' grad f / |grad f|^2."""
    f_x, f_y, _ = course.motion.gradient(hit.wall, hit.time)
    factor = 2 * hit.slope / (course.arithmetic.square(f_x) + course.arithmetic.square(f_y))
    return course.flight.vx - factor * f_x, course.flight.vy - factor * f_y


def bounce(course: Course, hit: Hit) -> Bounce:
    """Reflect at a hit, and describe the next flight at an exact instant close to it."""
    arithmetic = course.arithmetic
    q = course.flight
    s = hit.time
    vx, vy = reflect(course, hit)
    is_base = hit.wall == "base"
    x, y = q.x + q.vx * s, arithmetic.zero if is_base else q.y + q.vy * s
    t = arithmetic.between(*(q.instant + end for end in exact_ends(arithmetic.inflated(s))))
    # The new line of flight at that instant, a little before or after the hit.
    near = arithmetic.middle(s)
    begin = s - near
    x_near = q.x + q.vx * near + (q.vx - vx) * begin
    y_near = -vy * begin if is_base else q.y + q.vy * near + (q.vy - vy) * begin
    box = map(arithmetic.inflated, (x_near, y_near, vx, vy, begin))
    following = EnclosedFlight._make((q.instant + exact_ends(near)[0], *box))
    x, y, vx, vy = map(arithmetic.inflated, (x, y, vx, vy))
    return Bounce((t, x, y, vx, vy), following)


def fly_on(course: Course, hit: Hit, after: Bounce) -> Course:
    """Return the flight that follows a hit. The wall keeps its residual if it was left before."""
    arithmetic = course.arithmetic
    table = course.table
    leaving = {hit.wall: course.leaving.get(hit.wall, arithmetic.zero)}
    in_cap = hit.wall == "arc" or (hit.wall == "base" and not table.is_stem)
    end = None if course.end is None else course.end + course.flight.instant - after.flight.instant
    return Course(
        table, MovingWalls(arithmetic, table, after.flight), leaving, False, in_cap, end, None
    )


def collision(course: Course, hit: Hit, after: Bounce) -> ProvedCollision:
    """Return a collision free of its working precision."""
    arithmetic = course.arithmetic
    flight = course.flight
    close = arithmetic.enclosure
    return ProvedCollision(
        hit.wall,
        close(arithmetic.inflated(hit.time - flight.begin)),
        Moment(*map(close, after.moment)),
        close(hit.slope),
        arithmetic.digits,
        EnclosedFlight._make((flight.instant, *map(close, flight[1:]))),
        close(hit.time),
    )


def arrived(arithmetic: Arithmetic, state: State) -> ProvedHorizon:
    """Return a state that is at the horizon."""
    numbers = (
        arithmetic.number(value) for value in (state.t, state.x, state.y, state.vx, state.vy)
    )
    return ProvedHorizon(Moment(*map(arithmetic.enclosure, numbers)), arithmetic.digits)


def horizon(course: Course) -> ProvedHorizon:
    """Return the state at a horizon that no collision comes before."""
    arithmetic = course.arithmetic
    flight = course.flight
    end = Fraction(FOR_EVER) if course.end is None else course.end
    s = arithmetic.dyadic(end)
    t = arithmetic.dyadic(flight.instant + end)
    at = (flight.x + flight.vx * s, flight.y + flight.vy * s, flight.vx, flight.vy)
    moment = Moment(*map(arithmetic.enclosure, (t, *map(arithmetic.inflated, at))))
    return ProvedHorizon(moment, arithmetic.digits)
