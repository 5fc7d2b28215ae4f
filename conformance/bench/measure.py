"""Speed and error from the same runs: solvers take turns on a workload, and their answers are graded.

A solver whose answers differ between runs is left out. (The lanes are timed on whole flights, and graded
on one round from the same states: see `mushrooms.bench_solvers`.)

Warm-up first (compilation, caches), which also says how often a run must take the steps to be long enough
for the clock. Then all solvers take one run each, again and again, so that a disturbance of the machine
meets all of them; ratios are between runs of one benchmark.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import NamedTuple

from conformance.bench.record import Point, short
from conformance.bench.solvers import Given, Solver, SolverRun
from conformance.bench.workloads import ProvedStep, Workload
from conformance.grading.agreement import Answer, Enclosed, compare, exact
from conformance.suite.process import Trouble
from conformance.vectors import NUMBERS, Certified
from scene import Collision, Undecided

MAX_TIMES = 1000  # as many as a `time` request of the protocol may ask for


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


MIN_REPEATS = 3
MOST = Fraction(10**308)  # of a relative error that is kept


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
        A point for each solver, and those that failed with their trouble.
    """
    running: list[tuple[Solver, int, int]] = []
    runs: dict[str, list[SolverRun]] = {}
    troubles: dict[str, str] = {}
    for solver in solvers:
        if workload.name not in solver.serves:
            continue
        tick(solver.name)
        try:
            running.append(_warm_up(solver, workload, effort))
        except Trouble as trouble:
            troubles[solver.name] = f"{trouble.verdict}: {trouble.why}"
            continue
        runs[solver.name] = []
    for number in range(effort.repeats):
        for solver, n_times, n_runs in running:
            if number < n_runs and solver.name not in troubles:
                try:
                    runs[solver.name].append(solver.run(workload, n_times))
                    _check_runs(runs[solver.name])
                except Trouble as trouble:
                    troubles[solver.name] = f"{trouble.verdict}: {trouble.why}"
        tick("")
    points = [
        _point(workload, solver, n_times, runs[solver.name])
        for solver, n_times, _ in running
        if solver.name not in troubles
    ]
    return points, troubles


def _warm_up(solver: Solver, workload: Workload, effort: Effort) -> tuple[Solver, int, int]:
    """Return how many times a run is to take the steps, and how many runs there is time for."""
    n_times = 1
    lasted = solver.run(workload, 1).lasted
    while lasted < effort.least_ns and n_times < MAX_TIMES:
        n_times = min(MAX_TIMES, max(2 * n_times, math.ceil(1.2 * n_times * effort.least_ns / (lasted + 1))))
        lasted = solver.run(workload, n_times).lasted
    n_runs = min(effort.repeats, max(MIN_REPEATS, int(effort.most_ns / (lasted + 1))))
    return solver, n_times, n_runs


def _check_runs(runs: Sequence[SolverRun]) -> None:
    if not runs[-1].ns:
        raise Trouble("fail", "a run is said to last 0 ns in all")
    if repr(runs[-1].answers) != repr(runs[0].answers):
        raise Trouble("fail", "its answers differ from run to run")


class _Graded(NamedTuple):
    kind: str  # right, wrong, undecided or left
    ulps: float = 0.0
    relative: float = 0.0


def _point(workload: Workload, solver: Solver, n_times: int, runs: Sequence[SolverRun]) -> Point:
    graded = [_grade(answer, q) for answer, q in zip(runs[-1].answers, workload.questions, strict=True)]
    kinds = [g.kind for g in graded]
    right = [g for g in graded if g.kind == "right"]
    further, astray = _count_walls(workload, solver)
    return Point(
        workload=workload.name,
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
        ulps=tuple(short(g.ulps) if math.isfinite(g.ulps) else None for g in right),
        relative=tuple(short(g.relative) for g in right),
    )


def _count_walls(workload: Workload, solver: Solver) -> tuple[int, int]:
    """Return how many of the further steps the solver answers, and how many with a wrong wall."""
    if solver.steps is None or not workload.further:
        return 0, 0
    given = solver.steps(workload.scene, [step.state for step in workload.further])
    pairs = [(a, step.wall) for a, step in zip(given, workload.further, strict=True)]
    answered = [(a, wall) for a, wall in pairs if not isinstance(a, Undecided | None)]
    return len(answered), sum(getattr(a, "wall", None) != wall for a, wall in answered)


def _grade(given: Given, question: ProvedStep) -> _Graded:
    if given is None:
        return _Graded("left")
    answer = _enclosed(given)
    found = compare(answer, question.truth, question.state)
    if found.kind == "undecided":
        return _Graded("undecided")
    if math.isnan(found.ulps) or not isinstance(answer, Enclosed):
        return _Graded("wrong")
    return _Graded("right", found.ulps, relative_error(answer, question.truth.steps[0]))


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
    given = dict(zip(NUMBERS, answer.ends, strict=True))
    worst = Fraction(0)
    for vector in (("dt",), ("x", "y"), ("vx", "vy")):
        centres = {name: truth.centre(name) for name in vector}
        size = max(map(abs, centres.values()))
        error = max(abs(end - centres[name]) for name in vector for end in given[name])
        worst = max(worst, error / size) if size else worst
    return float(min(worst, MOST))
