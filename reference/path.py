"""Ground truth of many steps: a trajectory, every state of it enclosed and proved.

All steps are taken at one working precision; when the last state is not enclosed to the digits asked for,
the whole trajectory begins again at twice that. What is claimed, and why it follows: docs/proof.md.
"""

from __future__ import annotations

from fractions import Fraction

from reference.answers import Outcome, ProvedCollision, Trajectory
from reference.arithmetic import Arithmetic, Exhausted, Undecidable, WorkLimit
from reference.chain import bounce, collision, horizon
from reference.course import Course
from reference.jacobian import chained, enclosures, identity, step_jacobian
from reference.start import flight_from, is_in_cap, judge_start
from reference.step import GUARD_DIGITS, MAX_DIGITS, checked_digits, checked_state, require_digits
from scene import Scene, State, Stem, Undecided
from scene.refusal import check_count, check_number

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
    """Follow a particle, every state enclosed, the last one to `digits` decimals.

    Args:
        scene: table and laws of motion.
        state: the exact start.
        n_collisions: how many collisions to follow, 0 to 1,000,000.
        t_end: horizon [time], None for none: then a particle that is never met ends, a Horizon, at the
            flight time 2^1000.
        digits: decimals wanted of the last state, relative to the size of its vectors; 1 to 10,000. A place
            that may be 0 is known to so many of the last flight's length.
        working: decimals to work with, and no more: the path ends, undecided, where they no longer tell
            what comes next, whatever `digits` says. By default they are doubled until they serve.
        is_differentiated: chain the steps' Jacobians too.

    Raises:
        BadInput: naming field, value and bound.
    """
    digits = checked_digits(scene, digits)
    n_collisions = check_count("n_collisions", n_collisions, 0, MAX_COLLISIONS)
    if t_end is not None:
        t_end = check_number("t_end", t_end)
    if working is not None:
        working = check_count("working", working, 1, MAX_DIGITS)
        return _EnclosedPath(scene, state, t_end, working, None, is_differentiated).follow(n_collisions)
    working = digits + GUARD_DIGITS + n_collisions // 4
    while True:
        try:
            return _EnclosedPath(scene, state, t_end, working, digits, is_differentiated).follow(n_collisions)
        except Undecidable as question:
            if isinstance(question, Exhausted) or working > 8 * (digits + GUARD_DIGITS + n_collisions):
                return Trajectory([], Undecided(f"{question} ({working} digits)"), working)
            working *= 2


class _EnclosedPath:
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
        state = checked_state(scene, state, getattr(state, "t", 0.0) if t_end is None else t_end)
        self.scene, self.state, self.digits = scene, state, digits
        self.t_end = None if t_end is None else Fraction(t_end)
        self.arithmetic = Arithmetic(working)
        self.matrix = identity(self.arithmetic) if is_differentiated else None
        self.steps: list[ProvedCollision] = []

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
            arithmetic.work = WorkLimit()
            end = None if self.t_end is None else self.t_end - flight.instant
            course = Course(self.scene, arithmetic, flight, leaving, flat, end, exact)
            event = course.event(in_cap=in_cap)
            if event.undefined is not None:
                return event.undefined
            if event.hit is None:
                return horizon(course)
            if self.matrix is not None:
                matrix = step_jacobian(arithmetic, flight, event.hit, leaving)
                self.matrix = chained(matrix, self.matrix)
            after = bounce(course, event.hit)
            self.steps.append(collision(course, event.hit, after))
            flight, leaving, flat, exact = after.flight, after.leaving, frozenset(), None
            is_base = event.hit.wall == "base"
            in_cap = event.hit.wall == "arc" or (is_base and not isinstance(self.scene, Stem))
        if self.steps and self.digits is not None:
            require_digits(self.steps[-1], self.digits)
        return None
