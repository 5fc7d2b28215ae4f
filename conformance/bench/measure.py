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
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from conformance.bench.contenders import Answer, Contender, Lap
from conformance.bench.record import Point, short
from conformance.bench.workloads import Question, Workload
from conformance.grading.agreement import Truth
from conformance.grading.error import backward_ulps
from conformance.suite.process import Trouble
from scene import Collision, Undecided

MAX_TIMES = 1000  # as many as a `time` request of the protocol may ask for


class Settings(NamedTuple):
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
ONES = np.ones(100_000)


def measure(
    workload: Workload,
    contenders: Sequence[Contender],
    settings: Settings,
    tick: Callable[[str], None],
    clock: list[float],
) -> tuple[list[Point], dict[str, str]]:
    """Measure all contenders on a workload.

    Args:
        workload: with proved answers.
        contenders: those that serve it are run.
        settings: how long.
        tick: called with a contender's name before its warm-up, and after every round with "".
        clock: the time of a dependent addition [ns] is appended in every round.

    Returns:
        A point for each contender, and those that failed with their trouble.
    """
    running: list[tuple[Contender, int, int]] = []
    laps: dict[str, list[Lap]] = {}
    troubles: dict[str, str] = {}
    for contender in contenders:
        if contender.serves and workload.name not in contender.serves:
            continue
        tick(contender.name)
        try:
            running.append(_warm_up(contender, workload, settings))
        except Trouble as trouble:
            troubles[contender.name] = f"{trouble.verdict}: {trouble.why}"
            continue
        laps[contender.name] = []
    for number in range(settings.repeats):
        for contender, n_times, n_laps in running:
            if number < n_laps and contender.name not in troubles:
                try:
                    laps[contender.name].append(contender.run(workload, n_times))
                    _check_constant(laps[contender.name])
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


def _warm_up(contender: Contender, workload: Workload, settings: Settings) -> tuple[Contender, int, int]:
    """Return how many times a lap is to take the steps, and how many laps there is time for."""
    n_times = 1
    lasted = contender.run(workload, 1).lasted
    while lasted < settings.least_ns and n_times < MAX_TIMES:
        n_times = min(
            MAX_TIMES, max(2 * n_times, math.ceil(1.2 * n_times * settings.least_ns / (lasted + 1)))
        )
        lasted = contender.run(workload, n_times).lasted
    n_laps = min(settings.repeats, max(MIN_REPEATS, int(settings.most_ns / (lasted + 1))))
    return contender, n_times, n_laps


def _check_constant(laps: Sequence[Lap]) -> None:
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
        ulps=tuple(short(g.ulps) if math.isfinite(g.ulps) else None for g in right),
        relative=tuple(short(g.relative) for g in right),
    )


def _grade(answer: Answer, question: Question) -> _Graded:
    truth = question.truth
    assert isinstance(truth.outcome, Collision)
    if answer is None:
        return _Graded("left")
    if isinstance(answer, Undecided):
        return _Graded("undecided")
    wall = getattr(answer, "wall", None)
    numbers = tuple(_numbers(answer))
    if wall != truth.outcome.wall or not numbers or not all(map(math.isfinite, numbers)):
        return _Graded("wrong")
    assert truth.jacobian is not None
    s = question.state
    exact = [Fraction(n) for n in numbers]
    ulps = max(backward_ulps(exact, truth.numbers, truth.jacobian, (s.t, s.x, s.y, s.vx, s.vy)))
    return _Graded("right", ulps, relative_error(numbers, truth))


def _numbers(answer: Answer) -> Iterator[Fraction | float]:
    if isinstance(answer, Collision):
        yield from (answer.dt, answer.x, answer.y, answer.vx, answer.vy)
    else:
        yield from getattr(answer, "numbers", ())


def relative_error(numbers: tuple[Fraction | float, ...], truth: Truth) -> float:
    """Return the largest error of dt, place and velocity, each relative to its largest component."""
    worst = Fraction(0)
    for members in ((0,), (1, 2), (3, 4)):
        size = max(abs(truth.numbers[i]) for i in members)
        error = max(abs(Fraction(numbers[i]) - truth.numbers[i]) for i in members)
        worst = max(worst, error / size) if size else worst
    return float(worst)
