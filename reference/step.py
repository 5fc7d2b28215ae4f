"""Ground truth of one step: the first collision, enclosed and proved at any precision.

`next_collision` doubles the working precision until the answer is proved or a cap is reached; then it says
`Undecided`. What is claimed, and why it follows: docs/proof.md. Many steps: `reference.path`.
"""

from dataclasses import replace
from fractions import Fraction

from reference.answers import Outcome, ProvedCollision
from reference.arithmetic import Arithmetic, Exhausted, Undecidable, WorkLimit
from reference.chain import bounce, collision, horizon
from reference.course import Hit
from reference.jacobian import enclosures, step_jacobian
from reference.margins import measure
from reference.start import depart
from scene import InvalidState, Rejected, Scene, State, Undecided, Undefined, check_count, check_scene
from scene.states import check_numbers

GUARD_DIGITS = 15
DOUBLINGS = 3
MAX_DIGITS = 10_000


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
        is_differentiated: whether to return the Jacobian of the step.
        is_measured: whether to return the margins of the collision.

    Returns:
        Collision, with its time enclosed to a relative 10**-digits; Horizon; Undefined; Undecided, also if
        the work for one step is used up; or Rejected for a state outside this table.

    Raises:
        BadInput: `scene` is not a scene or `digits` out of range, naming field, value and bound.

    Source: Gelfreich, Rom-Kedar, Turaev (2014), sec. 3.1. Method: isolate, exclude, refine.
    """
    digits = checked_digits(scene, digits)
    work, reason = WorkLimit(), ""
    for doubling in range(DOUBLINGS + 1):
        working = (digits + GUARD_DIGITS) << doubling
        try:
            return _attempt(
                Arithmetic(working, work), scene, state, t_end, digits, is_differentiated, is_measured
            )
        except InvalidState as error:
            return Rejected(str(error))
        except Exhausted as error:
            return Undecided(f"{error} ({working} digits)")
        except Undecidable as error:
            reason = f"{error} ({working} digits)"
    return Undecided(reason)


def checked_digits(scene: Scene, digits: int) -> int:
    """Return a number of digits as an int.

    Raises:
        BadInput: `scene` is not a scene, or `digits` not a number in range.
    """
    check_scene(scene)
    return check_count("digits", digits, 1, MAX_DIGITS)


def require_digits(found: ProvedCollision, digits: int) -> None:
    """Require the digits asked for: of dt, and of velocity and position relative to their vectors.

    A position that may be 0, as in the middle of a base, has these digits relative to the flight's length.

    Raises:
        Undecidable: there are fewer.
    """
    bound, after = Fraction(1, 10**digits), found.after
    vectors = {"dt": (found.dt,), "velocity": (after.vx, after.vy), "place": (after.x, after.y)}
    for name, vector in vectors.items():
        size = max(abs(number.centre()) for number in vector)
        if name == "place" and all(number.contains(0.0) for number in vector):
            size = found.dt.centre() * max(abs(number.centre()) for number in vectors["velocity"])
        if max(number.extent() for number in vector) > bound * size:
            raise Undecidable(f"{name} is enclosed too widely")


def _attempt(
    arithmetic: Arithmetic,
    scene: Scene,
    state: State,
    t_end: float,
    digits: int,
    is_differentiated: bool,
    is_measured: bool,
) -> Outcome:
    """Answer at one precision."""
    state = check_numbers(scene, state, t_end)
    course = depart(arithmetic, scene, state, Fraction(float(t_end)))
    if isinstance(course, Undefined):
        return course
    hit = course.event()
    if not isinstance(hit, Hit):
        return horizon(course) if hit is None else hit
    found = collision(course, hit, bounce(course, hit))
    require_digits(found, digits)
    if is_differentiated:
        found = replace(found, jacobian=enclosures(arithmetic, step_jacobian(course, hit)))
    return replace(found, margins=measure(course, hit)) if is_measured else found
