"""From a question to a certified vector: the reference answers, the verifier proves the line.

Answers of single steps come first, the one place that makes them from the reference's enclosures.
At a knot of a law the acceleration of a wall jumps, and the derivatives with it. Rounding may put a
hit on either side: the larger sum of both sides counts.

Along a path the Jacobians of the steps are chained: what rounding every state that a stepper holds
may do.

An arc hit of a mushroom is captured when |x vy - y vx| > w(t) |v|, with the time and place of the
hit and the velocity before the bounce (docs/protocol.md). Which hits begin and end a stay follows
from two things alone: the order of the walls met, and for each arc hit whether it is captured. The
reference's path proves the first; the signs of (x vy - y vx)^2 - w^2 v^2, certain over the
enclosures of each hit, are the second: neither side of the inequality is negative, so squares
compare as they do. A hit whose sign is open makes the question unfit. So all states within the
enclosures have their stays between the same hits, and when these happen is enclosed with the path.
"""

import json
from collections.abc import Sequence
from fractions import Fraction
from math import inf, isfinite
from typing import Literal

import msgspec
import numpy as np
import numpy.typing as npt
from msgspec.structs import astuple

import reference
from conformance.cases.draw import Proved, Question, Unfit, file_vector
from conformance.grading.agreement import compare
from conformance.plain.step import CaptureInterval, next_collision
from conformance.vectors import (
    DIGITS,
    NUMBERS,
    Certified,
    Ends,
    Expectation,
    Level,
    Vector,
    certified,
    four_digits,
)
from conformance.verify import Verdict, verify_line
from reference.arithmetic import Arithmetic, Interval, rational, sign
from reference.prepared import prepare
from reference.walls import EnclosedFlight, MovingWalls
from scene import (
    BadInput,
    InvalidState,
    Mushroom,
    Rejected,
    Scene,
    State,
    Undecided,
    Undefined,
    from_data,
    mpmath_internals as raw,
)
from scene.protocol.rules import may_be_refused, without_loose

# What a level asks (docs/corpus.md): nudges that change no wall, and the largest condition number.
NUDGES: dict[Level, float] = {"core": 2.0**-30, "extended": 2.0**-44}
CONDITIONS = {"core": 1e6, "extended": 1e12}
# Pairs, so that one of each pair lies on either side of a tie; a trajectory takes the first pair.
SIGNS = ((1, 1, -1, 1, -1), (-1, -1, 1, -1, 1), (1, 1, 1, 1, 1), (-1, -1, -1, -1, -1))
Matrix = list[list[float]]
REFUSAL = Expectation("rejected")
GUARD = 6  # decimals asked of the reference beyond those that are written down


def proved_step(
    scene: Scene, state: State, t_end: float, digits: int = DIGITS
) -> Expectation | None:
    """Answer a step by proof.

    Args:
        scene: table and laws.
        state: the start.
        t_end: horizon [time].
        digits: decimals of the certified answer.

    Returns:
        The certified answer; None where the reference is undecided.
    """
    proved = measured_step(scene, state, t_end, digits)
    return proved.expect[0] if proved else None


def measured_step(scene: Scene, state: State, t_end: float, digits: int = DIGITS) -> Proved | None:
    """Return a step's certified answer as `proved_step` does, and how delicate it is."""
    outcome = reference.next_collision(
        scene, state, t_end, digits=digits + GUARD, is_differentiated=True
    )
    links = Links(state)
    if isinstance(outcome, Undecided):
        return None
    if isinstance(outcome, Rejected):
        return Proved((Expectation("rejected"),))
    if isinstance(outcome, Undefined):
        return Proved((Expectation("undefined", reason=outcome.reason),), inf)
    if isinstance(outcome, reference.Horizon):
        numbers = coasted(outcome, (Fraction(state.t),) * 2)
        step = certified(numbers, links.coast(numbers), None, digits=digits)
        return Proved((Expectation("horizon", (step,)),), links.condition)
    step = certified(collided(outcome), links.add(outcome), outcome.wall, digits=digits)
    return Proved((Expectation("collision", (step,)),), links.condition)


def _steepest(derivative: reference.Enclosure, largest: float) -> float:
    """Return a derivative rounded.

    At a knot, where it is enclosed between two, the greater in size.
    """
    low = float(derivative.lo)
    high = float(derivative.hi)
    if high - low <= 2.0**-40 * largest:
        return float(derivative)
    return max(low, high, key=abs)


def nudged(state: State, t_end: float, signs: Sequence[int], nudge: float) -> State:
    """Return a state with numbers moved by a part of their sizes, each in a direction of its own.

    Args:
        state: the start.
        t_end: horizon [time]; no later time is returned.
        signs: of the moves of t, x, y, vx, vy.
        nudge: relative; to the greater component for place and velocity.
    """
    place = max(abs(state.x), abs(state.y))
    speed = max(abs(state.vx), abs(state.vy))
    sizes = (abs(state.t), place, place, speed, speed)
    numbers = astuple(state)[:5]
    t, x, y, vx, vy = (
        v + nudge * sign * size for v, sign, size in zip(numbers, signs, sizes, strict=True)
    )
    return State(min(t, t_end), x, y, vx, vy, state.wall)


def ends(enclosure: reference.Enclosure) -> Ends:
    """Return both ends of one of the reference's enclosures, exactly."""
    return rational(raw.number(enclosure.lo)), rational(raw.number(enclosure.hi))


def collided(outcome: reference.Collision) -> dict[str, Ends]:
    """Return the ends of dt, x, y, vx, vy of a collision."""
    return _numbers(ends(outcome.dt), outcome.after)


def coasted(outcome: reference.Horizon, since: Ends) -> dict[str, Ends]:
    """Return the ends of dt, x, y, vx, vy at the horizon, dt counted from an enclosed time."""
    low, high = ends(outcome.at.t)
    return _numbers((low - since[1], high - since[0]), outcome.at)


def _numbers(dt: Ends, after: reference.Moment) -> dict[str, Ends]:
    return {"dt": dt, **{name: ends(getattr(after, name)) for name in NUMBERS[1:]}}


def free_flight(state: State, dt: float) -> Matrix:
    """Return the (5, 5) Jacobian of a flight up to a fixed time.

    Rows are dt, x, y, vx, vy, columns t, x, y, vx, vy.
    """
    return [
        [-1.0, 0.0, 0.0, 0.0, 0.0],
        [-state.vx, 1.0, 0.0, dt, 0.0],
        [-state.vy, 0.0, 1.0, 0.0, dt],
        [0.0, 0.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 1.0],
    ]


def condition_number(out: Sequence[float], allowance: Sequence[float]) -> float:
    """Return the largest relative change of an output per relative change of the inputs.

    Args:
        out: (dt, x, y, vx, vy), the exact answer rounded.
        allowance: for each of these the sum over inputs of |d out / d in| |in|.

    Returns:
        max over outputs of (sum |d out / d in| |in|) / |out|, place and velocity taken as vectors'
        largest components; inf when such a vector vanishes though it can move.
    """
    sizes = [abs(value) for value in out]
    parts = [
        (max(allowance[part]), max(sizes[part])) for part in (slice(1), slice(1, 3), slice(3, 5))
    ]
    return max((change / size if size else (inf if change else 0.0)) for change, size in parts)


# What a hit means for capture intervals: arc of a mushroom, captured or free; wall of the stem;
# nothing.
Mark = Literal["captured", "free", "out", ""]
WIDEST = Fraction(1, 2**72)  # of an enclosure of a path: a millionth of a backward ulp and less


class Links:
    """The steps of a trajectory: their Jacobians chained from each state that a stepper has held.

    Each Jacobian is that of the step from the enclosed state, with the residual of the wall moving
    along. `held` is (n, 5, 5): d(t, x, y, vx, vy) after the last step by t, x, y, vx, vy of each
    state held, and `inputs` is (n, 5). Sums go over whole arrays: four digits of the allowances are
    kept, which no order of summation changes. A flow tells no flight times: how delicate these are
    does not count where `is_timed` is false.
    """

    def __init__(self, state: State, *, is_timed: bool = True) -> None:
        self.state = state
        self.is_timed = is_timed
        self.held: npt.NDArray[np.float64] = np.empty((0, 5, 5))
        self.inputs: npt.NDArray[np.float64] = np.empty((0, 5))
        self.condition = self.largest = 0.0

    def add(self, found: reference.Collision) -> list[float]:
        """Add a step with its Jacobian, and return what all rounding may do to it."""
        assert found.jacobian is not None
        largest = max(abs(float(end)) for row in found.jacobian for d in row for end in d)
        jacobian = [[_steepest(d, largest) for d in row] for row in found.jacobian]
        allowance = self._chain(jacobian, collided(found))
        self.state = found.rounded().state()
        return allowance

    def coast(self, numbers: dict[str, Ends]) -> list[float]:
        """Add the flight to the horizon, whose numbers are given; as `add`."""
        return self._chain(free_flight(self.state, float(sum(numbers["dt"]) / 2)), numbers)

    def _chain(self, jacobian: Matrix, numbers: dict[str, Ends]) -> list[float]:
        centre = [float(sum(numbers[name]) / 2) for name in NUMBERS]
        self.held = np.concatenate([self.held, np.eye(5)[None]])
        self.inputs = np.concatenate([self.inputs, [astuple(self.state)[:5]]])
        with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused by `finite`
            rows = (np.array(jacobian)[:, :, None] * self.held[:, None]).sum(axis=2)
            moved = np.abs(rows * self.inputs[:, None]).sum(axis=(0, 2))
            rows[:, 0] += self.held[:, 0]
        self.held = rows
        allowance: list[float] = moved.tolist()
        self.condition = condition_number(
            centre if self.is_timed else [inf, *centre[1:]], allowance
        )
        return allowance


def finite(allowance: Sequence[float]) -> Sequence[float]:
    """Return allowances as they are.

    Raises:
        Unfit: one is infinite or none.
    """
    if not all(map(isfinite, allowance)):
        raise Unfit("an allowance overflows")
    return allowance


def proved_path(scene: Scene, question: Question, working: int | None = None) -> Proved:
    """Follow a particle as far as the chained condition number allows, or to the horizon.

    Args:
        scene: table and laws, of the question.
        question: of a trajectory or a flow.
        working: number of decimals to work with, by default what the reference takes. It answers
            for the digits of the last collision asked for; a path that ends at a horizon may need
            more.

    Raises:
        Unfit: there is no answer to certify.
    """
    path, marks = _followed(scene, question, working)
    links = Links(question.state, is_timed=not question.is_flow)
    steps = _steps(scene, links, path, question)
    end = path.outcome if len(steps) == len(path.steps) else None
    if isinstance(end, reference.Horizon):
        begin = ends(path.steps[-1].after.t) if steps else (Fraction(question.state.t),) * 2
        numbers = coasted(end, begin)
        steps.append(certified(numbers, finite(links.coast(numbers)), None, is_wide=True))
        links.largest = max(links.largest, links.condition)
    elif end is not None and not isinstance(end, Undefined):
        raise Unfit("the reference is undecided")
    if any(map(_is_wide, steps)):
        return proved_path(scene, question, 2 * path.digits)
    if question.is_flow:
        return _proved_flow(question, links, steps, marks)
    walked = tuple(steps)
    if isinstance(end, Undefined):
        expect = (Expectation("undefined", walked, end.reason), Expectation("undecided", walked))
        return Proved(expect, links.largest, len(steps) + 1)
    outcome: Literal["horizon", "collision"] = "horizon" if end else "collision"
    return Proved((Expectation(outcome, walked),), links.largest, len(steps))


def _followed(
    scene: Scene, question: Question, working: int | None
) -> tuple[reference.Trajectory, list[Mark]]:
    """Return the proved path of a question, and of a flow what each hit says of capture."""
    assert question.collisions is not None
    n = question.collisions
    t_end = question.t_end
    try:
        path = reference.trajectory(
            scene, question.state, n, t_end, working=working, is_differentiated=True
        )
        marks = [mark(scene, step) for step in path.steps] if question.is_flow else []
    except InvalidState as error:
        raise Unfit(str(error)) from None
    if question.is_flow and not isinstance(path.outcome, reference.Horizon):
        raise Unfit("no flow to the horizon")
    return path, marks


def _proved_flow(
    question: Question, links: Links, steps: list[Certified], marks: list[Mark]
) -> Proved:
    """Return a flow's answer from the whole path to its horizon, or to where `_steps` gave up."""
    arrived = arrival(steps, capture_intervals(marks))
    largest = max(links.condition, timing_condition(arrived, question.state))
    if largest > question.longest:
        raise Unfit("the horizon is too delicate")
    return Proved((arrived,), largest, len(steps))


def _steps(
    scene: Scene, links: Links, path: reference.Trajectory, question: Question
) -> list[Certified]:
    """Write down a path's collisions as far as condition number and rounding allow.

    Of a flow all.
    """
    steps: list[Certified] = []
    for found in path.steps:
        before = links.state
        allowance = links.add(found)
        if links.condition > question.longest:
            break
        step = certified(collided(found), finite(allowance), found.wall, is_wide=True)
        if steps and not _is_kept(scene, before, question.t_end, step):
            break
        links.largest = max(links.largest, links.condition)
        steps.append(step)
    if len(steps) < (len(path.steps) if question.is_flow else 1):
        raise Unfit("no collision is met, or the first is too delicate")
    return steps


def _is_kept(scene: Scene, rounded: State, t_end: float, step: Certified) -> bool:
    """Tell whether a step is much the same from the rounded state before it, as steppers round.

    Derivatives do not see a wall that moves across the whole table between two times that are next
    to each other in binary64. The plain stepper is quick; only where it misses the step the
    reference is asked.
    """
    expected = Expectation("collision", (step,))
    if compare(next_collision(scene, rounded, t_end), expected, rounded).verdict == "pass":
        return True
    found = reference.next_collision(scene, rounded, t_end, digits=DIGITS)
    if not isinstance(found, reference.Collision):
        return False
    return compare(found.rounded(), expected, rounded).verdict == "pass"


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
    unknown = [0.0] * len(NUMBERS)
    end = path.outcome
    steps = [certified(collided(found), unknown, found.wall, is_wide=True) for found in path.steps]
    if isinstance(end, Undefined):
        return Expectation("undefined", tuple(steps), end.reason)
    if isinstance(end, Undecided):
        return Expectation("undecided", tuple(steps), end.reason)
    if isinstance(end, reference.Horizon):
        since = ends(path.steps[-1].after.t) if steps else (Fraction(state.t),) * 2
        steps.append(certified(coasted(end, since), unknown, None, is_wide=True))
    return Expectation("horizon" if end else "collision", tuple(steps))


def _is_wide(step: Certified) -> bool:
    """Tell whether an enclosure is wider than a small part of what rounding may do."""
    for name, allowance in zip(NUMBERS, step.allowance, strict=True):
        low, high = step.ends(name)
        if high - low > WIDEST * (Fraction(allowance) + max(abs(low), abs(high))):
            return True
    return False


def mark(scene: Scene, step: reference.Collision) -> Mark:
    """Return what a collision of a proved path means for capture intervals.

    Raises:
        Unfit: an arc hit is neither proved captured nor proved not to be.
    """
    if step.wall in ("left", "right", "floor"):
        return "out"
    if step.wall == "arc" and isinstance(scene, Mushroom):
        return "captured" if _is_captured(scene, step) else "free"
    return ""


def capture_intervals(found: Sequence[Mark]) -> tuple[tuple[int, int], ...]:
    """Return begin and end of each stay as places in a path that ends at a horizon.

    A stay begins with its first captured hit. It ends with the first arc hit after its last
    captured one, or where the particle meets a wall of the stem if that comes first, or at the
    horizon.
    """
    spans: list[tuple[int, int]] = []
    interval = CaptureInterval()  # of places in the path, in place of times
    for place, mark in enumerate([*found, "out"]):
        if mark in ("captured", "free"):
            interval = interval.after(place, mark == "captured")
        elif mark == "out":
            span = interval.until(place)
            if span:
                spans.append((int(span[0]), int(span[1])))
            interval = CaptureInterval()
    return tuple(spans)


def arrival(steps: Sequence[Certified], spans: Sequence[tuple[int, int]]) -> Expectation:
    """Return a flow's answer: of its path the hits that begin or end a stay, and the horizon.

    That is all that is asked. Each keeps its enclosures; dt is counted from the one kept before,
    and what may move it is the sum over the flights between.
    """
    kept = sorted({place for span in spans for place in span} | {len(steps) - 1})
    thinned = []
    for before, place in zip([-1, *kept], kept, strict=False):
        flown = steps[before + 1 : place + 1]
        last = steps[place]
        low, high = (sum(sides) for sides in zip(*(step.ends("dt") for step in flown), strict=True))
        numbers = {name: last.ends(name) for name in NUMBERS} | {"dt": (low, high)}
        allowance = [sum(step.allowance[0] for step in flown), *last.allowance[1:]]
        thinned.append(certified(numbers, allowance, last.wall))
    places = tuple((kept.index(begin), kept.index(end)) for begin, end in spans)
    return Expectation("horizon", tuple(thinned), stays=places)


def timing_condition(expected: Expectation, state: State) -> float:
    """Return the largest condition number of the times at which a flow's stays begin and end."""
    t = state.t
    allowance = abs(state.t)
    worst = 0.0
    for step in expected.steps[:-1]:
        t = t + float(step.centre("dt"))
        allowance = allowance + step.allowance[0]
        worst = max(worst, allowance / abs(t) if t else inf)
    return worst


def _is_captured(scene: Mushroom, step: reference.Collision) -> bool:
    """Tell whether |x vy - y vx| > w |v|; the left side is the same all along the flight."""
    arithmetic = Arithmetic(step.digits)
    departure = step.departure

    def interval(enclosure: reference.Enclosure) -> Interval:
        return arithmetic.hull(*(arithmetic.point(raw.number(end)) for end in enclosure))

    x, y, vx, vy = (interval(getattr(departure, name)) for name in ("x", "y", "vx", "vy"))
    flight = EnclosedFlight(departure.instant, x, y, vx, vy, interval(departure.begin))
    width = MovingWalls(arithmetic, prepare(scene), flight).width(interval(step.root)).f
    spin = arithmetic.square(x * vy - y * vx)
    found = sign(spin - arithmetic.square(width) * (arithmetic.square(vx) + arithmetic.square(vy)))
    if not found:
        raise Unfit("whether an arc hit is captured is not certain over its enclosures")
    return found > 0


INFINITE = 1e300


class FalseClaim(BadInput):
    """The verifier holds the reference's answer to be false: one of the two is mistaken."""


def certify(question: Question, number: int) -> Vector:
    """Answer a question, measure how delicate it is, and have the line that is published proved.

    Args:
        question: what to ask.
        number: the vector's number within its group.

    Raises:
        Unfit: when there is no answer to certify, or the verifier cannot prove it.
        FalseClaim: when the verifier holds it to be false.
    """
    data, is_loose = without_loose(question.wire_scene())
    scene: Scene | None = None
    try:
        scene = from_data(data)
    except BadInput:
        proved = Proved((REFUSAL,))
    else:
        is_step = question.kind == "step"
        proved = _step(scene, question) if is_step else proved_path(scene, question)
    expect = with_further(proved.expect[0], scene, question.state, is_loose=is_loose)
    rounded = four_digits(min(proved.condition, INFINITE))
    vector = file_vector(
        question, number, proved._replace(expect=expect, condition=rounded), "stress"
    )
    vector = msgspec.structs.replace(vector, level=question.level or _level(scene, vector))
    verdict = judge(vector)
    if verdict.status != "proved":
        failure = FalseClaim if verdict.status == "false" else Unfit
        raise failure(f"{vector.id} is {verdict.status}: {verdict.reason}")
    return vector


def with_further(
    known: Expectation, scene: Scene | None, state: State, *, is_loose: bool = False
) -> tuple[Expectation, ...]:
    """Return a right answer, and what else the rules permit (`scene.protocol.rules`).

    A refusal comes first for a scene with fields that may be ignored, because `scene.from_data`
    refuses it.

    Args:
        known: the right answer.
        scene: table and laws; None for none.
        state: the start.
        is_loose: whether the scene was given with fields that may be ignored.
    """
    if scene is None or known.outcome == "rejected":
        return (known,)
    # A stepper in binary64 may find a tie within rounding, and say no more than that.
    found = (known, Expectation("undecided")) if known.outcome == "undefined" else (known,)
    if is_loose:
        return (REFUSAL, *found)
    return (*found, REFUSAL) if may_be_refused(scene, state) else found


def judge(vector: Vector) -> Verdict:
    """Have the line that a vector is published as proved, from that line alone."""
    return verify_line(json.loads(msgspec.json.encode(vector)))


def _step(scene: Scene, question: Question) -> Proved:
    proved = measured_step(scene, question.state, question.t_end)
    if proved is None:
        raise Unfit("the reference is undecided")
    for step in proved.expect[0].steps:
        finite(step.allowance)
    return proved


def _level(scene: Scene | None, vector: Vector) -> Level:
    first = vector.expect[0]
    if scene is None or first.outcome == "rejected":
        return "extended"
    if first.outcome == "undefined":
        return "stress"
    expected = _walls_met(scene, vector, vector.state)
    patterns = SIGNS if vector.kind == "step" else SIGNS[:2]
    for level, nudge in NUDGES.items():
        states = (nudged(vector.state, vector.t_end, signs, nudge) for signs in patterns)
        if vector.condition <= CONDITIONS[level] and all(
            _walls_met(scene, vector, state) == expected for state in states
        ):
            return level
    return "stress"


def _walls_met(scene: Scene, vector: Vector, state: State) -> list[str]:
    """Return the walls that a state meets, which hits are captured if asked, and how it ends."""
    if vector.kind == "step":
        outcome = reference.next_collision(scene, state, vector.t_end, digits=15)
        return [
            outcome.wall if isinstance(outcome, reference.Collision) else type(outcome).__name__
        ]
    try:
        path = reference.trajectory(scene, state, vector.collisions, vector.t_end, digits=10)
        marks = [mark(scene, step) for step in path.steps] if vector.kind == "flow" else []
    except (InvalidState, Unfit):
        return ["Rejected"]
    return [*(step.wall for step in path.steps), *marks, type(path.outcome).__name__]
