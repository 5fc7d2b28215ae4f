"""Ground truth: the first collision and trajectories, enclosed and proved at any precision.

`next_collision` doubles the working precision until the answer is proved or a cap is reached;
then it says `Undecided`. A trajectory restarts at a higher precision until its last state is
enclosed to the digits asked for.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import scene as wire
from reference.arithmetic import Arithmetic, Enclosure, Interval, Undecidable
from reference.course import Course, Event, Hit
from reference.isolation import Leaf
from reference.jacobian import chained, enclosures, identity, step_jacobian
from reference.jets import Flight
from reference.margins import Margins, measure
from reference.start import flight_from, is_in_cap, judge_start, motion_at
from scene import InvalidState, Rejected, Scene, State, Stem, Undecided, Undefined, Wall
from scene.states import check_numbers

GUARD_DIGITS = 15
DOUBLINGS = 3


class Moment(NamedTuple):
    """A state, all components enclosed."""

    t: Enclosure
    x: Enclosure
    y: Enclosure
    vx: Enclosure
    vy: Enclosure


Jacobian = tuple[tuple[Enclosure, ...], ...]


@dataclass(frozen=True)
class Collision:
    """A proved first collision.

    Attributes:
        wall: the wall met.
        dt: flight time [time].
        after: the state just after the bounce.
        slope: f' at the hit, < 0.
        digits: working decimals that decided it.
        proof: for each wall, the sub-intervals of flight time on which f > 0 was proved.
        jacobian: d(dt, x, y, vx, vy) / d(t, x, y, vx, vy), rows by outputs, when asked for.
        margins: how far this answer is from another one, when asked for.
    """

    wall: Wall
    dt: Enclosure
    after: Moment
    slope: Enclosure
    digits: int
    proof: dict[str, list[Leaf]] = field(repr=False)
    jacobian: Jacobian | None = field(repr=False, default=None)
    margins: Margins | None = field(repr=False, default=None)

    def rounded(self) -> wire.Collision:
        """Return the centres, correctly rounded, in the wire's form."""
        return wire.Collision(self.wall, float(self.dt), *(float(c) for c in self.after))


@dataclass(frozen=True)
class Horizon:
    """Proved: no collision before t_end; the state there, enclosed."""

    at: Moment
    digits: int
    proof: dict[str, list[Leaf]] = field(repr=False)

    def rounded(self) -> wire.Horizon:
        """Return the centres, correctly rounded, in the wire's form."""
        return wire.Horizon(*(float(c) for c in self.at))


Outcome = Collision | Horizon | Undefined | Undecided | Rejected


class _Chain(NamedTuple):
    """Where a trajectory stands: enclosures, the wall left and its residual."""

    flight: Flight
    leaving: dict[Wall, Interval]


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
        t_end: horizon [time], t_end >= state.t.
        digits: correct decimals wanted, >= 1; guard digits are added inside.
        is_differentiated: give the Jacobian of the step too.
        is_measured: give the margins of the collision too.

    Returns:
        Collision, its time enclosed to a relative 10**-digits; Horizon; Undefined; Undecided; or
        Rejected for a state that is none of this table.

    Source: Gelfreich, Rom-Kedar, Turaev (2014), sec. 3.1. Method: isolate, exclude, refine.
    """
    working = digits + GUARD_DIGITS
    open_question = ""
    extras = is_differentiated, is_measured
    for _ in range(DOUBLINGS + 1):
        try:
            return _attempt(scene, state, t_end, Arithmetic(working), digits, *extras)
        except InvalidState as error:
            return Rejected(str(error))
        except Undecidable as question:
            open_question = str(question)
            working *= 2
    return Undecided(f"{open_question} ({working // 2} digits)")


class Trajectory(NamedTuple):
    """Successive collisions and what came instead of the last one asked for.

    Attributes:
        steps: the collisions, each enclosed.
        outcome: None, or horizon, undefined or undecided instead of a further collision.
        digits: the working decimals that were needed.
        jacobian: d(t, x, y, vx, vy) after the last collision / d(initial state), when asked for.
    """

    steps: list[Collision]
    outcome: Outcome | None
    digits: int
    jacobian: Jacobian | None = None


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
    """Follow a particle, every state enclosed, the last one to `digits` decimals.

    Args:
        scene: table and laws of motion.
        state: the exact start.
        n_collisions: how many collisions to follow, >= 0.
        t_end: horizon [time], None for none.
        digits: decimals wanted of the last state, relative to the size of its vectors.
        working: decimals to work with, and no more: the path ends, undecided, where they no longer tell
            what comes next, whatever `digits` says. By default they are doubled until they serve.
        is_differentiated: chain the steps' Jacobians too.

    Raises:
        InvalidState: naming field, value and bound.
    """
    if working is not None:
        if working < 1:
            raise InvalidState(f"working = {working}, must be >= 1")
        return _chain(scene, state, n_collisions, t_end, Arithmetic(working), None, is_differentiated)
    working = digits + GUARD_DIGITS + n_collisions // 4
    while True:
        try:
            return _chain(scene, state, n_collisions, t_end, Arithmetic(working), digits, is_differentiated)
        except Undecidable as question:
            if working > 8 * (digits + GUARD_DIGITS + n_collisions):
                return Trajectory([], Undecided(f"{question} ({working} digits)"), working)
            working *= 2


def _chain(
    scene: Scene,
    state: State,
    n_collisions: int,
    t_end: float | None,
    arithmetic: Arithmetic,
    digits: int | None,
    is_differentiated: bool,
) -> Trajectory:
    """Follow with fixed precision; `digits` None: as far as it reaches, else Undecidable is raised."""
    check_numbers(scene, state, state.t if t_end is None else t_end)
    steps: list[Collision] = []
    try:
        outcome = judge_start(scene, state, arithmetic)
    except Undecidable as question:
        return _broken_off(steps, question, arithmetic, digits)
    if isinstance(outcome, Undefined):
        return Trajectory(steps, outcome, arithmetic.digits)
    leaving, flat = outcome
    chain = _Chain(flight_from(arithmetic, state), leaving)
    in_cap = is_in_cap(scene, state, leaving)
    exact: State | None = state
    matrix = identity(arithmetic) if is_differentiated else None
    while len(steps) < n_collisions:
        end = _horizon(arithmetic, chain.flight.t, t_end)
        try:
            event = Course(scene, arithmetic, chain.flight, chain.leaving, flat, end, exact).event(
                in_cap=in_cap
            )
        except Undecidable as question:
            return _broken_off(steps, question, arithmetic, digits)
        if event.undefined is not None:
            return Trajectory(steps, event.undefined, arithmetic.digits)
        if event.hit is None:
            last = _horizon_outcome(chain.flight, end, event, arithmetic)
            return Trajectory(steps, last, arithmetic.digits)
        if matrix is not None:
            origin = None
            if not steps and event.hit.wall in leaving:
                origin = motion_at(scene, state, arithmetic).gradient(event.hit.wall, arithmetic.zero)
            matrix = chained(step_jacobian(arithmetic, chain.flight, event.hit, origin), matrix)
        chain = _bounce(chain, event.hit, arithmetic)
        steps.append(_collision(event, event.hit, chain.flight, arithmetic))
        exact, flat = None, frozenset()
        in_cap = event.hit.wall == "arc" or (event.hit.wall == "base" and not isinstance(scene, Stem))
    if steps and digits is not None:
        _require(steps[-1], digits)
    jacobian = None if matrix is None else enclosures(arithmetic, matrix)
    return Trajectory(steps, None, arithmetic.digits, jacobian)


def _broken_off(
    steps: list[Collision], question: Undecidable, arithmetic: Arithmetic, digits: int | None
) -> Trajectory:
    if digits is not None:
        raise question
    return Trajectory(steps, Undecided(f"{question} ({arithmetic.digits} digits)"), arithmetic.digits)


def _attempt(
    scene: Scene,
    state: State,
    t_end: float,
    arithmetic: Arithmetic,
    digits: int,
    is_differentiated: bool,
    is_measured: bool,
) -> Outcome:
    check_numbers(scene, state, t_end)
    outcome = judge_start(scene, state, arithmetic)
    if isinstance(outcome, Undefined):
        return outcome
    leaving, flat = outcome
    flight = flight_from(arithmetic, state)
    end = _horizon(arithmetic, flight.t, t_end)
    course = Course(scene, arithmetic, flight, leaving, flat, end, state)
    event = course.event(in_cap=is_in_cap(scene, state, leaving))
    if event.undefined is not None:
        return event.undefined
    if event.hit is None:
        return _horizon_outcome(flight, end, event, arithmetic)
    after = _bounce(_Chain(flight, leaving), event.hit, arithmetic).flight
    collision = _collision(event, event.hit, after, arithmetic)
    _require(collision, digits)
    if is_differentiated:
        start = motion_at(scene, state, arithmetic)
        wall = event.hit.wall
        origin = start.gradient(wall, arithmetic.zero) if wall in leaving else None
        matrix = step_jacobian(arithmetic, flight, event.hit, origin)
        collision = replace(collision, jacobian=enclosures(arithmetic, matrix))
    if is_measured:
        collision = replace(collision, margins=measure(arithmetic, course, event.hit))
    return collision


def _horizon(arithmetic: Arithmetic, t: Interval, t_end: float | None) -> Interval:
    # Without a horizon: farther than any flight that meets a wall (the escape time cuts it).
    return arithmetic.number(2.0**1000) if t_end is None else arithmetic.number(t_end) - t


def _bounce(chain: _Chain, hit: Hit, arithmetic: Arithmetic) -> _Chain:
    """Reflect: v - 2 f' grad f / |grad f|^2, which is v - 2 (v.n - u) n (sec. 3.1)."""
    q, s = chain.flight, hit.time
    x = q.x + q.vx * s
    y = arithmetic.zero if hit.wall == "base" else q.y + q.vy * s
    velocities = []
    for motion in hit.motions:
        f_x, f_y, _ = motion.gradient(hit.wall, s)
        factor = 2 * hit.slope / (arithmetic.square(f_x) + arithmetic.square(f_y))
        velocities.append((q.vx - factor * f_x, q.vy - factor * f_y))
    vx, vy = (arithmetic.union(component) for component in zip(*velocities, strict=True))
    residual = chain.leaving.get(hit.wall, arithmetic.zero)
    return _Chain(Flight(q.t + s, x, y, vx, vy), {hit.wall: residual})


def _collision(event: Event, hit: Hit, after: Flight, arithmetic: Arithmetic) -> Collision:
    close = arithmetic.enclosure
    return Collision(
        hit.wall,
        close(hit.time),
        Moment(*map(close, after)),
        close(hit.slope),
        arithmetic.digits,
        event.proof,
    )


def _horizon_outcome(flight: Flight, end: Interval, event: Event, arithmetic: Arithmetic) -> Horizon:
    at = Flight(flight.t + end, flight.x + flight.vx * end, flight.y + flight.vy * end, flight.vx, flight.vy)
    return Horizon(Moment(*map(arithmetic.enclosure, at)), arithmetic.digits, event.proof)


def _require(collision: Collision, digits: int) -> None:
    """Insist on the digits asked for: of dt, and of velocity and place relative to their vectors."""
    bound = 10.0**-digits
    after = collision.after
    sizes = {
        "dt": abs(float(collision.dt)),
        "velocity": max(abs(float(after.vx)), abs(float(after.vy))),
        "place": max(abs(float(after.x)), abs(float(after.y))),
    }
    widths = {
        "dt": collision.dt.width(),
        "velocity": max(after.vx.width(), after.vy.width()),
        "place": max(after.x.width(), after.y.width()),
    }
    for name, width in widths.items():
        if width > bound * sizes[name]:
            raise Undecidable(f"{name} is enclosed too widely")
