"""Exact symmetries of the billiard as checks of a Python stepper, without certified answers.

A check takes a stepper and a question. It raises AssertionError, with one line, if the answer breaks the
symmetry, is not an outcome of this scene, or rejects a state clearly inside. It returns True if it compared
numbers. It returns False if there was nothing to compare: the outcome is undecided, undefined or correctly
rejected, the symmetry does not concern this table, or a small change of the inputs changes the wall. In a
Hypothesis test:

    @given(conformance.strategies.scenes_and_states())
    def test_mirror(drawn):
        conformance.properties.check_mirror(my_stepper, *drawn)

Mirror image and scaling by powers of two are exact to the bit in a binary64 stepper that has no absolute
tolerance and treats both sides alike. With `is_exact=False` they are checked within rounding. All other
symmetries are checked within rounding. `bound` is the permitted backward error (1e-9 by default, as in the
physics verdict). The work identity of ensembles is `conformance.profiles.check_work_identity`.

A stepper that forgets to return would else leave every property with nothing to say, as one that is
undecided does, and so would one that refuses every state: what is clearly inside, off all walls and of
numbers that every stepper can hold, must not be `rejected`. Numbers of any kind that `float` takes are taken
(numpy's too).

What honest rounding may do to a step is measured on the stepper itself by finite nudges. One whose backward
error is `bound` gives the exact answer to a question off by `bound` of each input, itself off by `bound` of
each output. How far that moves the answer, to first order, follows from the answers to nudged questions.
Where a nudge changes the outcome or the wall, the question is delicate and nothing is said about it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import partial
from math import hypot
from typing import Any, NamedTuple, NoReturn

import msgspec
from mpmath import fp

from conformance import plain
from conformance.vectors import question
from scene import (
    Collision,
    Horizon,
    Outcome,
    Rejected,
    Scene,
    State,
    Undecided,
    Undefined,
    transforms,
)
from scene.geometry import table_at
from scene.laws import times_power
from scene.precision import decimals
from scene.refusal import shown
from scene.states import Stepper

BOUND = 1e-9
SLACK = 4.0  # first-order errors of two answers, each estimated by differences
NAMES = ("dt", "t", "x", "y", "vx", "vy")
STEP = 2.0**-16  # relative, of the differences of `check_symplectic`
LEAST, MOST = 2.0**-400, 2.0**400  # numbers whose squares neither vanish nor overflow
HELD = 2.0**100  # sizes, speeds and their inverses within it overflow nowhere
FAR = 2.0**20  # periods from t = 0 that every stepper must reach
CLEAR = 2.0**-20  # of the table's size: farther inside than any rounding leads
NUDGE = 2.0**-26  # relative: the differences of central differences then keep half of binary64's digits
INPUTS = ("t", "x", "y", "vx", "vy")
Question = tuple[Scene, State, float]  # as a stepper takes it: with t_end
Numbers = tuple[float, ...]


def check_mirror(
    stepper: Stepper, scene: Scene, state: State, t_end: float, *, is_exact: bool = True, bound: float = BOUND
) -> bool:
    """Check that x -> -x gives the mirror image of the answer.

    Args:
        stepper: (scene, state, t_end) -> outcome.
        scene: a valid scene.
        state: of a particle.
        t_end: horizon [time].
        is_exact: compare bit for bit, else within rounding.
        bound: permitted backward error if not exact.

    Returns:
        Whether there was something to compare.
    """
    question, image = (scene, state, t_end), (scene, transforms.mirrored(state), t_end)
    expected = _changed(ask(stepper, *question), (1, 1, -1, 1, -1, 1), transforms.mirrored_wall)
    return _compare("mirror in x", stepper, question, image, ask(stepper, *image), expected, is_exact, bound)


def check_scaling(
    stepper: Stepper,
    scene: Scene,
    state: State,
    t_end: float,
    *,
    length: int = 0,
    time: int = 0,
    is_exact: bool = True,
    bound: float = BOUND,
) -> bool:
    """Check that lengths times 2^length and times times 2^time scale the answer accordingly.

    Exact to the bit if all numbers, before and after, are 0 or between 2^-400 and 2^400. See `check_mirror`.
    """
    unit, size, speed = (times_power(1.0, exponent) for exponent in (time, length, length - time))
    answer = ask(stepper, scene, state, t_end)
    inputs = [t_end, state.t, state.x, state.y, state.vx, state.vy, *(numbers(answer, state) or ())]
    if any(part and not LEAST < abs(part) * f < MOST for part in inputs for f in (1.0, unit, size, speed)):
        return False
    scaled = transforms.scaled(scene, length, time), transforms.scaled_state(state, length, time)
    image = (*scaled, unit * t_end)
    unscaled = _changed(ask(stepper, *image), (1 / unit, 1 / unit, 1 / size, 1 / size, 1 / speed, 1 / speed))
    return _compare("scaling", stepper, (scene, state, t_end), image, unscaled, answer, is_exact, bound)


def check_static_limit(
    stepper: Stepper, scene: Scene, state: State, t_end: float, *, is_exact: bool = True, bound: float = BOUND
) -> bool:
    """Check that laws of amplitude zero equal constants, in the scene frozen at the time of the state.

    Exact to the bit if the value of a law is its mean plus a sum of zeros. See `check_mirror`.
    """
    still = transforms.frozen(scene, state.t)
    question, idle = (still, state, t_end), (transforms.idle(still), state, t_end)
    answer = ask(stepper, *question)
    return _compare("static limit", stepper, question, idle, ask(stepper, *idle), answer, is_exact, bound)


def check_period_shift(
    stepper: Stepper,
    scene: Scene,
    state: State,
    t_end: float,
    *,
    is_exact: bool = False,
    bound: float = BOUND,
) -> bool:
    """Check that a start one whole period later changes only t.

    The shifted times are rounded. This error is known and counts as an error of t. With `is_exact` bits
    must be equal if nothing is rounded. See `check_mirror`.
    """
    shared = scene.cycle
    answer = ask(stepper, scene, state, t_end)
    if shared is None or not isinstance(answer, Collision | Horizon):
        return False
    ctx = decimals(50)
    shift = shared.value(ctx)
    later, span = float(state.t + shift), t_end - state.t
    late = State(later, state.x, state.y, state.vx, state.vy, state.wall)
    # A collision must not be lost to the rounding of t_end.
    end = later + (2 * span if isinstance(answer, Collision) else span)
    found = ask(stepper, scene, late, end)
    rounding = float(abs(ctx.mpf(later) - state.t - shift))
    if isinstance(answer, Horizon):
        rounding += float(abs(ctx.mpf(end) - t_end - shift))
    if isinstance(found, Collision | Horizon):
        found = msgspec.structs.replace(found, t=answer.t)
    is_exact = is_exact and rounding == 0.0
    incoming = (rounding + bound * abs(later), 0.0, 0.0, 0.0, 0.0)
    question, image = (scene, state, t_end), (scene, late, end)
    return _compare("period shift", stepper, question, image, found, answer, is_exact, bound, incoming)


def check_split_flight(
    stepper: Stepper, scene: Scene, state: State, t_end: float, *, bound: float = BOUND
) -> bool:
    """Check that a flight, or a flow, that is stopped halfway and continued ends like the whole one."""
    question = scene, state, t_end
    whole = measure_step(stepper, *question, bound)
    if whole is None:
        return False
    middle = state.t + whole.numbers[0] / 2
    half = measure_step(stepper, scene, state, middle, bound)
    if half is None or middle == state.t:
        return False
    if not isinstance(half.outcome, Horizon):
        fail("split flight", f"{half.outcome} before half of the flight", question, (scene, state, middle))
    asked = question, (scene, state, middle), (scene, half.state(), t_end)
    rest = measure_step(stepper, *asked[-1], bound, half.errors[1:])
    if rest is None:
        return False
    if getattr(rest.outcome, "wall", None) != getattr(whole.outcome, "wall", None):
        fail("split flight", f"then {rest.outcome}, at once {whole.outcome}", *asked)
    taken = float(Fraction(middle) - Fraction(state.t)) + rest.numbers[0]
    allowed = [a + b for a, b in zip(whole.errors, rest.errors, strict=True)]
    _near("split flight", (taken, *rest.numbers[1:]), whole.numbers, allowed, *asked)
    return True


def check_reversal(
    stepper: Stepper, scene: Scene, state: State, t_end: float, *, bound: float = BOUND
) -> bool:
    """Check that reversed velocity and laws retrace the path across one bounce, or a flow.

    The path goes from the state over its collision to half of the next flight, then back to half of the
    first. Permitted errors are carried through every step. See `check_mirror`.
    """
    question = scene, state, t_end
    there = measure_step(stepper, *question, bound)
    if there is None:
        return False
    onward: MeasuredStep | None = there
    walls: list[str | None] = [None]
    begin, asked = state, [question]
    if isinstance(there.outcome, Collision):
        led = scene, there.state(), max(t_end, there.outcome.t)
        if isinstance(refusal := ask(stepper, *led), Rejected):
            fail("time reversal", f"{there.outcome} leads nowhere: {refusal.reason}", question, led)
        way = _across_bounce(stepper, scene, state, t_end)
        if way is None:
            return False
        begin, hit, end = way
        walls = [hit.wall, None]
        asked.append((scene, there.state(), end))
        onward = measure_step(stepper, *asked[-1], bound, there.errors[1:])
    if onward is None or not isinstance(onward.outcome, Horizon) or not onward.outcome.t > begin.t:
        return False
    at, errors, film = onward.state(), onward.errors, transforms.backwards(scene)
    at = State(-at.t, at.x, at.y, -at.vx, -at.vy)
    for wall in walls:  # and last the horizon
        asked.append((film, at, -begin.t))
        back = measure_step(stepper, *asked[-1], bound, errors[1:])
        met = None if back is None else getattr(back.outcome, "wall", None)
        if back is not None and wall and met != wall:
            fail("time reversal", f"{wall} there, {back.outcome} on the way back", question, asked[-1])
        if back is None or met != wall:
            return False
        at, errors = back.state(), back.errors
    expected = (0.0, 0.0, begin.x, begin.y, begin.vx, begin.vy)
    _near("time reversal", (0.0, 0.0, at.x, at.y, -at.vx, -at.vy), expected, errors, *asked)
    return True


def check_angular_momentum(
    stepper: Stepper, scene: Scene, state: State, t_end: float, *, bound: float = BOUND
) -> bool:
    """Check that x vy - y vx is constant in flight and at the arc, which pushes towards the centre.

    At the base, which is at rest, it changes sign. Other walls are not compared.
    """
    step = measure_step(stepper, scene, state, t_end, bound)
    if step is None or not isinstance(step.outcome, Collision) or step.outcome.wall not in ("arc", "base"):
        return False
    _, _, x, y, vx, vy = step.numbers
    _, _, dx, dy, dvx, dvy = step.errors
    before, after = state.x * state.vy - state.y * state.vx, x * vy - y * vx
    if step.outcome.wall == "base":
        after = -after
    allowed = abs(vy) * dx + abs(vx) * dy + abs(x) * dvy + abs(y) * dvx
    allowed += bound * hypot(state.x, state.y) * hypot(state.vx, state.vy)
    if not abs(after - before) <= SLACK * allowed:
        text = f"x vy - y vx = {before!r} before and {after!r} after {step.outcome.wall}"
        fail("angular momentum", text, (scene, state, t_end))
    return True


def check_energy(stepper: Stepper, scene: Scene, state: State, t_end: float, *, bound: float = BOUND) -> bool:
    """Check that the speed is constant in a static table."""
    answer = ask(stepper, scene, state, t_end)
    found = numbers(answer, state)
    if found is None or scene.cycle is not None:
        return False
    before, after = hypot(state.vx, state.vy), hypot(*found[4:])
    if not abs(after - before) <= SLACK * bound * before:
        fail("energy", f"speed {before!r} becomes {after!r} in a static table", (scene, state, t_end))
    return True


def check_symplectic(
    stepper: Stepper, scene: Scene, state: State, t_end: float, *, bound: float = BOUND
) -> bool:
    """Check that the map (x, y, vx, vy) -> (x, y, vx, vy) across one bounce is symplectic.

    Its matrix M is computed by central differences of two widths and extrapolated. The difference of the two
    bounds the error. M^T J M = J must hold within this error plus `bound` divided by the width.
    """
    way = _across_bounce(stepper, scene, state, t_end)
    if way is None:
        return False
    begin, _, end = way
    length, speed, time = scales(scene, state)
    coarse, fine = (
        _flow_matrix(stepper, scene, way, (length, length, speed, speed), width) for width in (STEP, STEP / 2)
    )
    if coarse is None or fine is None:
        return False
    M = [[(4 * b - a) / 3 for a, b in zip(*rows, strict=True)] for rows in zip(coarse, fine, strict=True)]
    gap = max(abs(a - b) for rows in zip(coarse, fine, strict=True) for a, b in zip(*rows, strict=True))
    # The time of the hit is rounded like t, whatever the stepper.
    noise = bound + 2.0**-50 * max(abs(begin.t), abs(end)) / time
    largest = max(abs(m) for row in M for m in row)
    allowed = 16 * largest * gap + SLACK * largest * largest * noise / STEP
    for i in range(4):
        for j in range(i):
            form = sum(M[k][i] * M[k + 2][j] - M[k + 2][i] * M[k][j] for k in (0, 1))
            wanted = {(2, 0): -1.0, (3, 1): -1.0}.get((i, j), 0.0)
            if not abs(form - wanted) <= allowed:
                text = f"(M^T J M)[{i}][{j}] = {form:.9g}, must be {wanted:g} within {allowed:.3g}"
                fail("symplectic", text, (scene, state, t_end))
    return True


PROPERTIES: dict[str, Callable[..., bool]] = {
    "mirror": check_mirror,
    "scaling-of-lengths": partial(check_scaling, length=-40),
    "scaling-of-times": partial(check_scaling, time=-40),
    "static-limit": check_static_limit,
    "period-shift": check_period_shift,
    "split-flight": check_split_flight,
    "reversal": check_reversal,
    "angular-momentum": check_angular_momentum,
    "energy": check_energy,
    "symplectic": check_symplectic,
}


def _across_bounce(
    stepper: Stepper, scene: Scene, state: State, t_end: float
) -> tuple[State, Collision, float] | None:
    """Return the state halfway to the collision, the collision, and the time halfway to the next event."""
    hit = ask(stepper, scene, state, t_end)
    if not isinstance(hit, Collision) or not hit.t < t_end:
        return None
    following = ask(stepper, scene, hit.state(), t_end)
    if not isinstance(following, Collision | Horizon):
        return None
    end, half = (hit.t + following.t) / 2, hit.dt / 2
    begin = State(state.t + half, state.x + state.vx * half, state.y + state.vy * half, state.vx, state.vy)
    return (begin, hit, end) if state.t < begin.t < hit.t < end else None


def _flow_matrix(
    stepper: Stepper, scene: Scene, way: tuple[State, Collision, float], units: Sequence[float], width: float
) -> list[list[float]] | None:
    """Differentiate the state at the end of a path by that at its start; rows are outputs, in given units."""
    begin, hit, end = way
    columns = []
    for field, unit in zip(("x", "y", "vx", "vy"), units, strict=True):
        ends = []
        for sign in (-1, 1):
            moved = getattr(begin, field) + sign * width * unit
            first = ask(stepper, scene, msgspec.structs.replace(begin, **{field: moved}), end)
            if not isinstance(first, Collision) or first.wall != hit.wall:
                return None
            last = ask(stepper, scene, first.state(), end)
            if not isinstance(last, Horizon):
                return None
            ends.append((last.x, last.y, last.vx, last.vy))
        columns.append([(b - a) / (2 * width * u) for a, b, u in zip(*ends, units, strict=True)])
    return [list(row) for row in zip(*columns, strict=True)]


def _changed(
    outcome: Outcome, factors: Sequence[float], wall: Callable[..., object] = lambda name: name
) -> Outcome:
    """Return an outcome with dt, t, x, y, vx, vy times factors and another wall."""
    if isinstance(outcome, Collision):
        parts = (getattr(outcome, name) * f for name, f in zip(NAMES, factors, strict=True))
        return Collision(wall(outcome.wall), *parts)  # type: ignore[arg-type]
    if isinstance(outcome, Horizon):
        return Horizon(*(getattr(outcome, name) * f for name, f in zip(NAMES[1:], factors[1:], strict=True)))
    return outcome


def _compare(
    name: str,
    stepper: Stepper,
    question: Question,
    image: Question,
    answer: Outcome,
    expected: Outcome,
    is_exact: bool,
    bound: float,
    incoming: Sequence[float] = (0.0,) * 5,
) -> bool:
    """Compare two outcomes that must be the same, bit for bit or within rounding."""
    state = question[1]
    if isinstance(answer, Undecided) or isinstance(expected, Undecided):
        return False
    walls = [getattr(outcome, "wall", None) for outcome in (answer, expected)]
    allowed: Sequence[float] = (0.0,) * 6
    if not is_exact:
        step = measure_step(stepper, *question, bound, incoming)
        if step is None:
            return False
        allowed = [2 * error for error in step.errors]
    if type(answer) is not type(expected) or walls[0] != walls[1]:
        fail(name, f"{answer}, must be {expected}", question, image)
    found, wanted = numbers(answer, state), numbers(expected, state)
    if found is None or wanted is None:
        return False
    _near(name, found, wanted, allowed, question, image)
    return True


def _near(
    name: str, found: Sequence[float], wanted: Sequence[float], allowed: Sequence[float], *asked: Question
) -> None:
    for part, a, b, error in zip(NAMES, found, wanted, allowed, strict=True):
        if not abs(a - b) <= SLACK * error:
            within = f" within {SLACK * error:.3g}" if error else ""
            fail(name, f"{part} = {a!r}, must be {b!r}{within}", *asked)


def fail(name: str, text: str, *questions: Question) -> NoReturn:
    """Say in one line what is wrong, and with which questions, each as it was sent.

    Raises:
        AssertionError: always.
    """
    lines = [json.dumps({"cmd": "step", "seq": 1, **question("step", *asked)}) for asked in questions]
    raise AssertionError("; ".join([f"{name}: {text}", *lines]))


def is_clearly_inside(scene: Scene, state: State, t_end: float) -> bool:
    """Tell whether a state is one that no stepper may refuse; of one on a wall this does not judge."""
    sizes = [abs(extent) for law in scene.laws.values() for extent in law.bounds()]
    sizes += [abs(number) for number in (state.x, state.y, state.vx, state.vy, state.t, t_end)]
    is_far = max(abs(state.t), abs(t_end)) > FAR * (scene.period or 1.0)
    if state.wall is not None or is_far or any(size and not 1 / HELD < size < HELD for size in sizes):
        return False
    off = CLEAR * float(table_at(fp, scene, state.t).size)
    places = [(0.0, 0.0), (off, 0.0), (-off, 0.0), (0.0, off), (0.0, -off)]
    around = [msgspec.structs.replace(state, x=state.x + dx, y=state.y + dy) for dx, dy in places]
    return not any(isinstance(plain.next_collision(scene, at, t_end), Rejected) for at in around)


def ask(stepper: Stepper, scene: Scene, state: State, t_end: float) -> Outcome:
    """Return a stepper's answer, which must be an outcome whose numbers are finite floats.

    Raises:
        AssertionError: one line, with the question.
    """
    found: Any = stepper(scene, state, t_end)
    if isinstance(found, Rejected) and is_clearly_inside(scene, state, t_end):
        fail("outcome", f"{found}, must be no refusal of a state clearly inside", (scene, state, t_end))
    if isinstance(found, Undefined | Undecided | Rejected):
        return found
    if not isinstance(found, Collision | Horizon):
        fail("outcome", f"{shown(found)}, must be an outcome of `scene`", (scene, state, t_end))
    if isinstance(found, Collision) and found.wall not in scene.walls:
        text = f"wall = {shown(found.wall)}, must be one of {', '.join(scene.walls)}"
        fail("outcome", text, (scene, state, t_end))
    numbers = {field: _number(getattr(found, field)) for field in found.__struct_fields__ if field != "wall"}
    for field, number in numbers.items():
        if not math.isfinite(number):
            text = f"{field} = {shown(getattr(found, field))}, must be a finite number"
            fail("outcome", text, (scene, state, t_end))
    return msgspec.structs.replace(found, **numbers)


def _number(value: Any) -> float:
    """Return a number as a float; nan for what is none."""
    try:
        return math.nan if isinstance(value, str) else float(value)
    except (TypeError, ValueError, OverflowError):
        return math.nan


class MeasuredStep(NamedTuple):
    """An answer and what rounding may move it by: dt, t, x, y, vx, vy each."""

    outcome: Collision | Horizon
    numbers: Numbers
    errors: Numbers

    def state(self) -> State:
        """Return the state that the next step starts from."""
        wall = self.outcome.wall if isinstance(self.outcome, Collision) else None
        _, t, x, y, vx, vy = self.numbers
        return State(t, x, y, vx, vy, wall)


def scales(scene: Scene, state: State) -> tuple[float, float, float]:
    """Return the table's size [length], the speed [length/time], and the time that a crossing takes."""
    found = {name: law.bounds() for name, law in scene.laws.items()}
    length = max(law.highest for name, law in found.items() if name in ("r", "w", "h"))
    speed = hypot(state.vx, state.vy) or max(law.slope for law in found.values()) or length
    return length, speed, length / speed


def numbers(outcome: Outcome, state: State) -> Numbers | None:
    """Return dt, t, x, y, vx, vy of a collision or horizon, else None."""
    if not isinstance(outcome, Collision | Horizon):
        return None
    dt = outcome.dt if isinstance(outcome, Collision) else outcome.t - state.t
    return dt, outcome.t, outcome.x, outcome.y, outcome.vx, outcome.vy


def measure_step(
    stepper: Stepper,
    scene: Scene,
    state: State,
    t_end: float,
    bound: float,
    incoming: Sequence[float] = (0.0,) * 5,
) -> MeasuredStep | None:
    """Take a step and measure what rounding may do to it.

    Args:
        stepper: under test.
        scene: of the question.
        state: of the question.
        t_end: horizon [time].
        bound: backward error allowed.
        incoming: errors that t, x, y, vx, vy of the state already have.

    Returns:
        The step, or None when it is no collision or horizon, or a delicate one.
    """
    outcome = ask(stepper, scene, state, t_end)
    found = numbers(outcome, state)
    if found is None or not isinstance(outcome, Collision | Horizon):
        return None
    length, speed, time = scales(scene, state)
    nudges = [max(NUDGE * time, 2.0**-46 * abs(state.t)), *[NUDGE * length] * 2, *[NUDGE * speed] * 2]
    size = [abs(state.t), *[hypot(state.x, state.y)] * 2, *[hypot(state.vx, state.vy)] * 2]
    dt, t, x, y, vx, vy = found
    errors = [bound * part for part in (abs(dt), abs(t), *[hypot(x, y)] * 2, *[hypot(vx, vy)] * 2)]
    for field, nudge, extent, error in zip(INPUTS, nudges, size, incoming, strict=True):
        slopes = derivative(stepper, scene, state, t_end, outcome, field, nudge)
        if slopes is None:
            return None
        errors = [e + abs(d) * (error + bound * extent) for e, d in zip(errors, slopes, strict=True)]
    return MeasuredStep(outcome, found, tuple(errors))


def derivative(
    stepper: Stepper, scene: Scene, state: State, t_end: float, outcome: Outcome, field: str, nudge: float
) -> Numbers | None:
    """Return d(dt, t, x, y, vx, vy) / d field by a central difference; None when delicate."""
    at = [getattr(state, field) - nudge, getattr(state, field) + nudge]
    ends = []
    for value in at:
        nudged = msgspec.structs.replace(state, **{field: value})
        if nudged.t > t_end:
            return None
        answer = ask(stepper, scene, nudged, t_end)
        found = numbers(answer, nudged)
        same = getattr(answer, "wall", None) == getattr(outcome, "wall", None)
        if found is None or type(answer) is not type(outcome) or not same:
            return None
        ends.append(found)
    return tuple((b - a) / (at[1] - at[0]) for a, b in zip(*ends, strict=True))
