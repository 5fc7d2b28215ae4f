"""Ground truth: the first collision and trajectories, enclosed and proved at any precision.

`next_collision` doubles the working precision until the answer is proved or a cap is reached;
then it says `Undecided`. A trajectory restarts at a higher precision until its last state is
enclosed to the digits asked for. What is claimed, and why it follows: docs/proof.md.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

from reference.answers import Collision, Outcome, Trajectory
from reference.arithmetic import Arithmetic, Exhausted, Undecidable, Work
from reference.chain import bounce, collision, horizon
from reference.course import Course, Event, Evidence
from reference.jacobian import chained, enclosures, identity, step_jacobian
from reference.margins import measure
from reference.start import Start, flight_from, is_in_cap, judge_start, motion_at
from reference.walls import Flight
from scene import BadInput, InvalidState, Rejected, Scene, State, Stem, Undecided
from scene.refusal import check_count, check_number, check_scene
from scene.states import check_numbers

GUARD_DIGITS = 15
DOUBLINGS = 3
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
        t_end: horizon [time], t_end >= state.t; a wall met at t_end exactly is not met before it.
        digits: correct decimals wanted, 1 to 10,000; guard digits are added inside.
        is_differentiated: give the Jacobian of the step too.
        is_measured: give the margins of the collision too.

    Returns:
        Collision, its time enclosed to a relative 10**-digits; Horizon; Undefined; Undecided, also
        when the work for one step is used up; or Rejected for a state that is none of this table.

    Raises:
        BadInput: `scene` or `digits` is none, naming field, value and bound.

    Source: Gelfreich, Rom-Kedar, Turaev (2014), sec. 3.1. Method: isolate, exclude, refine.
    """
    digits = _checked(scene, digits)
    extras = is_differentiated, is_measured
    return _answer(scene, state, t_end, digits, extras)[0]


def _checked(scene: Scene, digits: int) -> int:
    check_scene(scene)
    return check_count("digits", digits, 1, MAX_DIGITS)


def _answer(
    scene: Scene, state: State, t_end: float, digits: int, extras: tuple[bool, bool]
) -> tuple[Outcome, Evidence | None]:
    """Double the precision until a step is decided; with what proves an undefined one."""
    working, work = digits + GUARD_DIGITS, Work()
    open_question = ""
    for _ in range(DOUBLINGS + 1):
        try:
            return _attempt(scene, state, t_end, Arithmetic(working, work), digits, extras)
        except InvalidState as error:
            return Rejected(str(error)), None
        except Exhausted as question:
            return Undecided(f"{question} ({working} digits)"), None
        except Undecidable as question:
            open_question = str(question)
            working *= 2
    return Undecided(f"{open_question} ({working // 2} digits)"), None


def evidence_of(scene: Scene, state: State, t_end: float, digits: int = 50) -> Evidence:
    """Return what proves that a step is undefined.

    Raises:
        BadInput: it is not undefined.
    """
    outcome, evidence = _answer(scene, state, t_end, _checked(scene, digits), (False, False))
    if evidence is None:
        raise BadInput(f"outcome = {outcome!r}, must be undefined")
    return evidence


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
        n_collisions: how many collisions to follow, 0 to 1,000,000.
        t_end: horizon [time], None for none: then a particle that is never met ends, a Horizon, at the
            flight time 2^1000.
        digits: decimals wanted of the last state, relative to the size of its vectors; 1 to 10,000.
        working: decimals to work with, and no more: the path ends, undecided, where they no longer tell
            what comes next, whatever `digits` says. By default they are doubled until they serve.
        is_differentiated: chain the steps' Jacobians too.

    Raises:
        BadInput: naming field, value and bound.
    """
    digits = _checked(scene, digits)
    n_collisions = check_count("n_collisions", n_collisions, 0, MAX_COLLISIONS)
    if t_end is not None:
        t_end = check_number("t_end", t_end)
    if working is not None:
        working = check_count("working", working, 1, MAX_DIGITS)
        return _Path(scene, state, t_end, working, None, is_differentiated).follow(n_collisions)
    working = digits + GUARD_DIGITS + n_collisions // 4
    while True:
        try:
            path = _Path(scene, state, t_end, working, digits, is_differentiated)
            return path.follow(n_collisions)
        except Undecidable as question:
            if isinstance(question, Exhausted) or working > 8 * (digits + GUARD_DIGITS + n_collisions):
                return Trajectory([], Undecided(f"{question} ({working} digits)"), working)
            working *= 2


class _Path:
    """A trajectory at one working precision; `digits` None: as far as that reaches."""

    def __init__(
        self,
        scene: Scene,
        state: State,
        t_end: float | None,
        working: int,
        digits: int | None,
        is_differentiated: bool,
    ) -> None:
        state = _judged(scene, state, getattr(state, "t", 0.0) if t_end is None else t_end)
        self.scene, self.state, self.digits = scene, state, digits
        self.t_end = None if t_end is None else Fraction(t_end)
        self.arithmetic = Arithmetic(working)
        self.matrix = identity(self.arithmetic) if is_differentiated else None
        self.steps: list[Collision] = []

    def follow(self, n_collisions: int) -> Trajectory:
        """Take steps until there are enough, or something else comes instead.

        Raises:
            Undecidable: the precision does not serve for the digits asked for.
            InvalidState: the start is none of this table.
        """
        try:
            outcome = self._steps_until(n_collisions)
        except Undecidable as question:
            if self.digits is not None:
                raise
            outcome = Undecided(f"{question} ({self.arithmetic.digits} digits)")
        jacobian = None
        if outcome is None and self.matrix is not None:
            jacobian = enclosures(self.arithmetic, self.matrix)
        return Trajectory(self.steps, outcome, self.arithmetic.digits, jacobian)

    def _steps_until(self, n_collisions: int) -> Outcome | None:
        arithmetic = self.arithmetic
        start = judge_start(self.scene, self.state, arithmetic)
        if start.undefined is not None:
            return start.undefined
        flight, leaving, flat = flight_from(arithmetic, self.state), start.leaving, start.flat
        in_cap = is_in_cap(self.scene, self.state, leaving)
        exact: State | None = self.state
        while len(self.steps) < n_collisions:
            arithmetic.work = Work()
            end = None if self.t_end is None else self.t_end - flight.instant
            course = Course(self.scene, arithmetic, flight, leaving, flat, end, exact)
            event = course.event(in_cap=in_cap)
            if event.undefined is not None:
                return event.undefined
            if event.hit is None:
                return horizon(arithmetic, flight, leaving, end, event)
            self._chain_jacobian(flight, event, start)
            after = bounce(arithmetic, flight, leaving, event.hit)
            self.steps.append(collision(arithmetic, flight, leaving, event, after))
            flight, leaving, flat, exact = after.flight, after.leaving, frozenset(), None
            is_base = event.hit.wall == "base"
            in_cap = event.hit.wall == "arc" or (is_base and not isinstance(self.scene, Stem))
        if self.steps and self.digits is not None:
            _require(self.steps[-1], self.digits)
        return None

    def _chain_jacobian(self, flight: Flight, event: Event, start: Start) -> None:
        if self.matrix is None or event.hit is None:
            return
        origin = None
        if not self.steps and event.hit.wall in start.leaving:
            here = motion_at(self.scene, self.state, self.arithmetic)
            origin = here.gradient(event.hit.wall, self.arithmetic.zero)
        self.matrix = chained(step_jacobian(self.arithmetic, flight, event.hit, origin), self.matrix)


def _attempt(
    scene: Scene,
    state: State,
    t_end: float,
    arithmetic: Arithmetic,
    digits: int,
    extras: tuple[bool, bool],
) -> tuple[Outcome, Evidence | None]:
    """Answer at one precision."""
    is_differentiated, is_measured = extras
    state = _judged(scene, state, t_end)
    start = judge_start(scene, state, arithmetic)
    if start.undefined is not None:
        return start.undefined, Evidence(Fraction(0), start.walls)
    flight, end = flight_from(arithmetic, state), Fraction(float(t_end)) - Fraction(state.t)
    course = Course(scene, arithmetic, flight, start.leaving, start.flat, end, state)
    event = course.event(in_cap=is_in_cap(scene, state, start.leaving))
    if event.undefined is not None:
        return event.undefined, event.evidence
    if event.hit is None:
        return horizon(arithmetic, flight, start.leaving, end, event), None
    after = bounce(arithmetic, flight, start.leaving, event.hit)
    found = collision(arithmetic, flight, start.leaving, event, after)
    _require(found, digits)
    if is_differentiated:
        here, wall = motion_at(scene, state, arithmetic), event.hit.wall
        origin = here.gradient(wall, arithmetic.zero) if wall in start.leaving else None
        matrix = step_jacobian(arithmetic, flight, event.hit, origin)
        found = replace(found, jacobian=enclosures(arithmetic, matrix))
    if is_measured:
        found = replace(found, margins=measure(arithmetic, course, event.hit))
    return found, None


def _judged(scene: Scene, state: State, t_end: float) -> State:
    """Return a state whose numbers are all floats.

    Raises:
        InvalidState: naming field, value and bound.
    """
    check_numbers(scene, state, t_end)
    t, x, y, vx, vy = (float(number) for number in (state.t, state.x, state.y, state.vx, state.vy))
    return State(t, x, y, vx, vy, state.wall)


def _require(found: Collision, digits: int) -> None:
    """Insist on the digits asked for: of dt, and of velocity and place relative to their vectors."""
    bound, after = Fraction(1, 10**digits), found.after
    vectors = {"dt": (found.dt,), "velocity": (after.vx, after.vy), "place": (after.x, after.y)}
    for name, vector in vectors.items():
        size = max(abs(number.centre()) for number in vector)
        if max(number.extent() for number in vector) > bound * size:
            raise Undecidable(f"{name} is enclosed too widely")
