"""Speed and error from the same laps: contenders take turns on a workload, and their answers are graded.

A contender whose answers differ between laps is left out. (The lanes are timed on whole flights, and graded
on one round from the same states: see `mushrooms.bench_contenders`.)

Warm-up first (compilation, caches), which also says how often a lap must take the steps to be long enough
for the clock. Then all contenders run one lap each, again and again, so that a disturbance of the machine
meets all of them; ratios are between laps of one run.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from conformance.bench.contenders import Contender, Given, Lap
from conformance.bench.record import Point, short
from conformance.bench.workloads import ProvedStep, Workload
from conformance.grading.agreement import Answer, Enclosed, compare, exact
from conformance.suite.process import Trouble
from conformance.vectors import NUMBERS, Certified
from scene import Collision, Undecided

MAX_TIMES = 1000  # as many as a `time` request of the protocol may ask for


class Effort(NamedTuple):
    """How long to measure.

    Attributes:
        repeats: laps of each contender.
        least_ns: a lap is to last at least so long.
        most_ns: laps of a contender that together last longer than this are fewer, MIN_REPEATS at least.
    """

    repeats: int
    least_ns: float
    most_ns: float


MIN_REPEATS = 3
MOST = Fraction(10**308)  # of a relative error that is kept
ONES = np.ones(100_000)


def measure(
    workload: Workload,
    contenders: Sequence[Contender],
    effort: Effort,
    tick: Callable[[str], None],
    clock: list[float],
) -> tuple[list[Point], dict[str, str]]:
    """Measure all contenders on a workload.

    Args:
        workload: with proved answers.
        contenders: those that serve it are run.
        effort: how long.
        tick: called with a contender's name before its warm-up, and after every round with "".
        clock: the time of a dependent addition [ns] is appended in every round.

    Returns:
        A point for each contender, and those that failed with their trouble.
    """
    running: list[tuple[Contender, int, int]] = []
    laps: dict[str, list[Lap]] = {}
    troubles: dict[str, str] = {}
    for contender in contenders:
        if workload.name not in contender.serves:
            continue
        tick(contender.name)
        try:
            running.append(_warm_up(contender, workload, effort))
        except Trouble as trouble:
            troubles[contender.name] = f"{trouble.verdict}: {trouble.why}"
            continue
        laps[contender.name] = []
    for number in range(effort.repeats):
        for contender, n_times, n_laps in running:
            if number < n_laps and contender.name not in troubles:
                try:
                    laps[contender.name].append(contender.run(workload, n_times))
                    _check_laps(laps[contender.name])
                except Trouble as trouble:
                    troubles[contender.name] = f"{trouble.verdict}: {trouble.why}"
        clock.append(short(clock_ns()))
        tick("")
    points = [
        _point(workload, contender, n_times, laps[contender.name])
        for contender, n_times, _ in running
        if contender.name not in troubles
    ]
    return points, troubles


def _warm_up(contender: Contender, workload: Workload, effort: Effort) -> tuple[Contender, int, int]:
    """Return how many times a lap is to take the steps, and how many laps there is time for."""
    n_times = 1
    lasted = contender.run(workload, 1).lasted
    while lasted < effort.least_ns and n_times < MAX_TIMES:
        n_times = min(MAX_TIMES, max(2 * n_times, math.ceil(1.2 * n_times * effort.least_ns / (lasted + 1))))
        lasted = contender.run(workload, n_times).lasted
    n_laps = min(effort.repeats, max(MIN_REPEATS, int(effort.most_ns / (lasted + 1))))
    return contender, n_times, n_laps


def _check_laps(laps: Sequence[Lap]) -> None:
    if not laps[-1].ns:
        raise Trouble("fail", "a lap is said to last 0 ns in all")
    if repr(laps[-1].answers) != repr(laps[0].answers):
        raise Trouble("fail", "its answers differ from lap to lap")


def clock_ns() -> float:
    """Return the time of one addition that waits for the one before: the core's clock at this moment."""
    begin = time.perf_counter_ns()
    np.add.accumulate(ONES)
    return (time.perf_counter_ns() - begin) / len(ONES)


class _Graded(NamedTuple):
    kind: str  # right, wrong, undecided or left
    ulps: float = 0.0
    relative: float = 0.0


def _point(workload: Workload, contender: Contender, n_times: int, laps: Sequence[Lap]) -> Point:
    graded = [_grade(answer, q) for answer, q in zip(laps[-1].answers, workload.questions, strict=True)]
    kinds = [g.kind for g in graded]
    right = [g for g in graded if g.kind == "right"]
    further, astray = _count_walls(workload, contender)
    return Point(
        workload=workload.name,
        contender=contender.name,
        family=contender.family,
        n_times=n_times,
        ns=tuple(short(lap.ns) for lap in laps),
        right=len(right),
        wrong=kinds.count("wrong"),
        undecided=kinds.count("undecided"),
        left=kinds.count("left"),
        further=further,
        astray=astray,
        ulps=tuple(short(g.ulps) if math.isfinite(g.ulps) else None for g in right),
        relative=tuple(short(g.relative) for g in right),
    )


def _count_walls(workload: Workload, contender: Contender) -> tuple[int, int]:
    """Return how many of the further steps the contender answers, and how many with a wrong wall."""
    if contender.steps is None or not workload.further:
        return 0, 0
    given = contender.steps(workload.scene, [step.state for step in workload.further])
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
    """Return a collision by the numbers that all contenders have, which leaves out the rounded time t."""
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
