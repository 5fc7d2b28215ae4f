"""Solvers: steppers that step a workload's states and say how long that took, timed in turns and graded.

A solver whose answers differ between runs is left out. (The lanes are timed on whole flights, and graded
on one round from the same states: see `mushrooms.bench`.)

Warm-up first (compilation, caches), which also says how often a run must take the steps to be long enough
for the clock. Then all solvers take one run each, again and again, so that a disturbance of the machine
meets all of them; ratios are between runs of one benchmark.

Error growth (`grow`): how far along a trajectory each stepper can be trusted. Two trajectories of a chaotic
table part exponentially; a stepper's rounding errors grow at the same rate, decimals lost per collision,
whatever its precision. The chained Jacobians of the proved steps give that rate (the Lyapunov slope) and what
one backward ulp at each step can grow to (the predicted bound).
"""

import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from fractions import Fraction
from functools import cache
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from conformance.bench.record import Growth, Point, short
from conformance.bench.workloads import RULES, SINGLE_STEPS, ProvedStep, Prover, Workload, draw_workload
from conformance.grading.agreement import Answer, Enclosed, U, compare, exact
from conformance.suite.checks import Implementation, timing
from conformance.suite.process import CheckFailure
from conformance.suite.session import Limits, Session, missing
from conformance.vectors import NUMBERS, Certified
from scene import Collision, Scene, State, Undecided, to_data
from scene.geometry import rounded

FloatArray = npt.NDArray[np.float64]
MAX_TIMES = 1000  # as many as a `time` request of the protocol may ask for
MIN_REPEATS = 3
MOST = Fraction(10**308)  # of a relative error that is kept
WORKLOAD, ENERGY = "moving-cap-1e4", 1e4
FAR = 1e9  # horizon of a step that a trajectory takes
Family = Literal[
    "proof", "compiled", "interpreted", "time-stepping", "fixed-step", "lean", "example", "command"
]
SolverAnswer = Answer | None  # None: a step that this solver leaves to another


class SolverRun(NamedTuple):
    """One run over a workload.

    Attributes:
        ns: nanoseconds per step (or per collision, where the solver follows the states on).
        answers: one for each question.
        lasted: nanoseconds in all.
    """

    ns: float
    answers: list[SolverAnswer]
    lasted: float


class Solver(NamedTuple):
    """A stepper.

    Attributes:
        name: as in the plot.
        family: what kind of thing it is.
        run: (workload, n_times) -> a run in which every step is taken n_times; raises CheckFailure.
        serves: the workloads it can run.
        steps: one step from each of many states, quickly; None where there is no such thing.
    """

    name: str
    family: Family
    run: Callable[[Workload, int], SolverRun]
    serves: tuple[str, ...] = SINGLE_STEPS
    steps: Callable[[Scene, Sequence[State]], Sequence[SolverAnswer]] | None = None


def by_call(name: str, family: Family, step: Callable[[Scene, State, float], SolverAnswer]) -> Solver:
    """Return a Python function of one step as a solver; the call is part of its time."""

    def run(workload: Workload, n_times: int) -> SolverRun:
        answers: list[SolverAnswer] = []
        begin = time.perf_counter_ns()
        for _ in range(n_times):
            answers = [step(workload.scene, q.state, q.t_end) for q in workload.questions]
        ns = time.perf_counter_ns() - begin
        return SolverRun(ns / (n_times * len(workload.questions)), answers, ns)

    return Solver(name, family, run)


def by_command(
    name: str, family: Family, command: Sequence[str], stack: ExitStack, limits: Limits | None = None
) -> Solver:
    """Return a command that speaks protocol 1 as a solver that times itself.

    Args:
        name: as in the plot.
        family: "example" or "command".
        command: program and arguments.
        stack: closes the session at the end.
        limits: of the session.

    Raises:
        BadInput: there is no such program.
        CheckFailure: it does not introduce itself.
    """
    session = stack.enter_context(Session(command, limits))
    session.start()

    @cache  # its clock is looked at once
    def clock_failure() -> CheckFailure | None:
        """Hold what it says of its time to the clock on this side; a run is too short to do so."""
        try:
            timing.honest_clock(Implementation(session, "time"), timing.SCENES[0], timing.START)
        except CheckFailure as failure:
            return failure
        return None

    def run(workload: Workload, n_times: int) -> SolverRun:
        assert session.introduction is not None
        if lacking := missing(session.introduction, "time", to_data(workload.scene)):
            raise CheckFailure("unsupported", lacking)
        answers: list[SolverAnswer] = []
        lasted = 0
        for question in workload.questions:
            found = timing.ask_time(session, workload.scene, question.state, 1, n_times)
            lasted += sum(found.ns)
            answers.append(found.last)
        if (failure := clock_failure()) is not None:
            raise failure
        return SolverRun(lasted / (n_times * len(answers)), answers, lasted)

    return Solver(name, family, run)


class Effort(NamedTuple):
    """How long to measure.

    Attributes:
        repeats: runs of each solver.
        least_ns: a run is to last at least so long.
        most_ns: runs of a solver that together last longer than this are fewer, MIN_REPEATS at least.
    """

    repeats: int
    least_ns: float
    most_ns: float


def measure(
    workload: Workload,
    solvers: Sequence[Solver],
    effort: Effort,
    tick: Callable[[str], None],
) -> tuple[list[Point], dict[str, str]]:
    """Measure all solvers on a workload.

    Args:
        workload: with proved answers.
        solvers: those that serve it are run.
        effort: how long.
        tick: called with a solver's name before its warm-up, and after every round with "".

    Returns:
        A point for each solver, and what failed of the others.
    """
    running: list[tuple[Solver, int, int, list[SolverRun]]] = []
    failures: dict[str, str] = {}

    @contextmanager
    def noting_failures(solver: Solver) -> Iterator[None]:
        try:
            yield
        except CheckFailure as failure:
            failures[solver.name] = f"{failure.verdict}: {failure.why}"

    for solver in solvers:
        if workload.rule.name in solver.serves:
            tick(solver.name)
            with noting_failures(solver):
                running.append((solver, *_warm_up(solver, workload, effort), []))
    for number in range(effort.repeats):
        for solver, n_times, n_runs, runs in running:
            if number < n_runs and solver.name not in failures:
                with noting_failures(solver):
                    runs.append(solver.run(workload, n_times))
                    _check_runs(runs)
        tick("")
    points = [
        _point(workload, solver, n_times, runs)
        for solver, n_times, _, runs in running
        if solver.name not in failures
    ]
    return points, failures


def _warm_up(solver: Solver, workload: Workload, effort: Effort) -> tuple[int, int]:
    """Return how many times a run is to take the steps, and how many runs there is time for."""
    n_times = 1
    lasted = solver.run(workload, 1).lasted
    while lasted < effort.least_ns and n_times < MAX_TIMES:
        n_times = min(MAX_TIMES, max(2 * n_times, math.ceil(1.2 * n_times * effort.least_ns / (lasted + 1))))
        lasted = solver.run(workload, n_times).lasted
    n_runs = min(effort.repeats, max(MIN_REPEATS, int(effort.most_ns / (lasted + 1))))
    return n_times, n_runs


def _check_runs(runs: Sequence[SolverRun]) -> None:
    if not runs[-1].ns:
        raise CheckFailure("fail", "a run is said to last 0 ns in all")
    if repr(runs[-1].answers) != repr(runs[0].answers):
        raise CheckFailure("fail", "its answers differ from run to run")


def _point(workload: Workload, solver: Solver, n_times: int, runs: Sequence[SolverRun]) -> Point:
    graded = [_grade(answer, q) for answer, q in zip(runs[-1].answers, workload.questions, strict=True)]
    kinds = [kind for kind, *_ in graded]
    right = [errors for kind, *errors in graded if kind == "right"]
    further, astray = _count_walls(workload, solver)
    return Point(
        workload=workload.rule.name,
        solver=solver.name,
        family=solver.family,
        n_times=n_times,
        ns=tuple(short(run.ns) for run in runs),
        right=len(right),
        wrong=kinds.count("wrong"),
        undecided=kinds.count("undecided"),
        left=kinds.count("left"),
        further=further,
        astray=astray,
        ulps=tuple(short(ulps) if math.isfinite(ulps) else None for ulps, _ in right),
        relative=tuple(short(relative) for _, relative in right),
    )


def _count_walls(workload: Workload, solver: Solver) -> tuple[int, int]:
    """Return how many of the further steps the solver answers, and how many with a wrong wall."""
    if solver.steps is None or not workload.further:
        return 0, 0
    answers = solver.steps(workload.scene, [step.state for step in workload.further])
    pairs = [(a, step.wall) for a, step in zip(answers, workload.further, strict=True)]
    answered = [(a, wall) for a, wall in pairs if not isinstance(a, Undecided | None)]
    return len(answered), sum(getattr(a, "wall", None) != wall for a, wall in answered)


def _grade(found: SolverAnswer, question: ProvedStep) -> tuple[str, float, float]:
    """Return right, wrong, undecided or left, and of a right answer its backward ulps and relative error."""
    if found is None:
        return "left", 0.0, 0.0
    answer = _enclosed(found)
    agreement = compare(answer, question.truth, question.state)
    if agreement.verdict == "declined":
        return "undecided", 0.0, 0.0
    if math.isnan(agreement.ulps) or not isinstance(answer, Enclosed):
        return "wrong", 0.0, 0.0
    return "right", agreement.ulps, relative_error(answer, question.truth.steps[0])


def _enclosed(answer: Answer) -> Answer:
    """Return a collision by the numbers that all solvers have, which leaves out the rounded time t."""
    if not isinstance(answer, Collision):
        return answer
    numbers = [getattr(answer, name) for name in NUMBERS]
    return exact(answer.wall, list(map(Fraction, numbers))) if all(map(math.isfinite, numbers)) else answer


def relative_error(answer: Enclosed, truth: Certified) -> float:
    """Return the largest error of dt, place and velocity, each relative to its largest component.

    None is larger than MOST: a wall may be right where the numbers are off by more than binary64 holds.
    """
    ends = dict(zip(NUMBERS, answer.ends, strict=True))
    worst = Fraction(0)
    for vector in (("dt",), ("x", "y"), ("vx", "vy")):
        centres = {name: truth.centre(name) for name in vector}
        size = max(map(abs, centres.values()))
        error = max(abs(end - centres[name]) for name in vector for end in ends[name])
        worst = max(worst, error / size) if size else worst
    return float(min(worst, MOST))


class PathPoint(NamedTuple):
    """Where a trajectory stands after a collision; `width`: relative, of what encloses it."""

    wall: str
    x: Fraction | float
    y: Fraction | float
    vx: Fraction | float
    vy: Fraction | float
    width: float = 0.0


class Sensitivity(NamedTuple):
    """What the chained Jacobians of a path say after a collision.

    Attributes:
        allowance: for dt, x, y, vx, vy what rounding the states so far may do, as in `vectors.Certified`.
        jacobian: (5, 5), of t, x, y, vx, vy by those of the start.
    """

    allowance: Sequence[float]
    jacobian: FloatArray


PathFollower = Callable[[Scene, State, int], list[PathPoint]]
PathProver = Callable[[Scene, State, int], tuple[list[PathPoint], list[Sensitivity]]]


def grow(
    followers: dict[str, PathFollower],
    prove: Prover,
    prove_path: PathProver,
    seed: int,
    n_paths: int,
    n_collisions: int,
    tick: Callable[[str], None],
) -> Growth:
    """Follow trajectories with every follower and with proof.

    Args:
        followers: by name; a path may end early, which counts as having no digit left.
        prove: one step, for the draws.
        prove_path: a trajectory, right to many digits at its end, and how it depends on its states.
        seed: of the draws.
        n_paths: how many trajectories.
        n_collisions: of each.
        tick: called after each path.
    """
    rule = next(rule for rule in RULES if rule.name == WORKLOAD)
    workload = draw_workload(rule, seed, n_paths, prove)
    errors: dict[str, list[FloatArray]] = {name: [] for name in followers}
    bounds, growths = [], []
    for question in workload.questions:
        truth, chain = prove_path(workload.scene, question.state, n_collisions)
        size = rounded(workload.scene, question.state.t).r
        speed = math.hypot(question.state.vx, question.state.vy)
        for name, follow in followers.items():
            errors[name].append(_errors(follow(workload.scene, question.state, n_collisions), truth, size))
        bound, growth = _chained(truth, chain, size, speed)
        bounds.append(bound)
        growths.append(growth)
        tick("")
    count = np.arange(1, n_collisions + 1)
    return Growth(
        scene=rule.scene,
        energy=ENERGY,
        paths=n_paths,
        collisions=n_collisions,
        followers={name: _rounded(np.median(found, axis=0)) for name, found in errors.items()},
        lasts={name: float(np.median([_last(path) for path in found])) for name, found in errors.items()},
        bound=_rounded(np.median(bounds, axis=0)),
        rate=round(float(np.polyfit(count, np.median(np.log10(growths), axis=0), 1)[0]), 4),
    )


def _errors(path: Sequence[PathPoint], truth: Sequence[PathPoint], size: float) -> FloatArray:
    """Return errors relative to table and speed, at most 1: no digit left."""
    found = np.ones(len(truth))
    for i, (place, proved) in enumerate(zip(path, truth, strict=False)):
        if place.wall != proved.wall:
            break
        speed = math.hypot(float(proved.vx), float(proved.vy))
        off = [abs(Fraction(a) - Fraction(b)) for a, b in zip(place[1:5], proved[1:5], strict=True)]
        error = max(float(max(off[:2])) / size, float(max(off[2:])) / speed, place.width)
        found[i] = min(error, 1.0)
    return found


def _last(errors: FloatArray) -> int:
    """Return how many collisions there are before the first whose error exceeds a tenth."""
    beyond = np.flatnonzero(errors > 0.1)
    return int(beyond[0]) if len(beyond) else len(errors)


def _chained(
    truth: Sequence[PathPoint], chain: Sequence[Sensitivity], size: float, speed: float
) -> tuple[FloatArray, FloatArray]:
    """Return the predicted bound and the norm of the chained Jacobians after each collision."""
    scales = np.array([size / speed, size, size, speed, speed])
    bounds, growths = [], []
    for place, (allowance, jacobian) in zip(truth, chain, strict=True):
        outputs = np.abs(np.array(place[1:5], dtype=float))
        bounds.append(float(U) * float(np.max((allowance[1:] + outputs) / scales[1:])))
        growths.append(float(np.linalg.norm(jacobian * scales[None, :] / scales[:, None], 2)))
    return np.minimum(bounds, 1.0), np.array(growths)


def _rounded(numbers: FloatArray) -> tuple[float, ...]:
    return tuple(short(float(number), 3) for number in numbers)
