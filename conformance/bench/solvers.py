"""The solvers: steppers that step a workload's states and say how long that took."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import cache, partial
from typing import Any, Literal, NamedTuple

import msgspec

from conformance import plain
from conformance.bench.time_stepping import TOLERANCES, next_collision_by
from conformance.bench.workloads import SINGLE_STEPS, Workload
from conformance.grading.agreement import Answer
from conformance.suite.process import Trouble
from conformance.suite.promises import timing
from conformance.suite.session import Limits, Session, missing
from scene import Scene, State, to_data

Family = Literal[
    "proof", "compiled", "interpreted", "time-stepping", "fixed-step", "lean", "example", "command"
]
Given = Answer | None  # None: a step that this solver leaves to another


class SolverRun(NamedTuple):
    """One run over a workload.

    Attributes:
        ns: nanoseconds per step (or per collision, where the solver follows the states on).
        answers: one for each question.
        lasted: nanoseconds in all.
    """

    ns: float
    answers: list[Given]
    lasted: float


class Solver(NamedTuple):
    """A stepper.

    Attributes:
        name: as in the plot.
        family: what kind of thing it is.
        run: (workload, n_times) -> a run in which every step is taken n_times; raises Trouble.
        serves: the workloads it can run.
        steps: one step from each of many states, quickly; None where there is no such thing.
    """

    name: str
    family: Family
    run: Callable[[Workload, int], SolverRun]
    serves: tuple[str, ...] = SINGLE_STEPS
    steps: Callable[[Scene, Sequence[State]], Sequence[Given]] | None = None


def by_call(name: str, family: Family, step: Callable[[Scene, State, float], Given]) -> Solver:
    """Return a Python function of one step as a solver; the call is part of its time."""

    def run(workload: Workload, n_times: int) -> SolverRun:
        answers: list[Given] = []
        begin = time.perf_counter_ns()
        for _ in range(n_times):
            answers = [step(workload.scene, q.state, q.t_end) for q in workload.questions]
        ns = time.perf_counter_ns() - begin
        return SolverRun(ns / (n_times * len(workload.questions)), answers, ns)

    return Solver(name, family, run)


def in_python() -> list[Solver]:
    """Return the plain stepper, and scipy's solve_ivp with events, at several tolerances."""
    integrators = {f"solve_ivp, rtol {rtol:.0e}": next_collision_by(rtol) for rtol in TOLERANCES}
    return [
        by_call("plain Python", "interpreted", plain.next_collision),
        *(by_call(name, "time-stepping", step) for name, step in integrators.items()),
    ]


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
        CommandNotFound: there is no such program.
        Trouble: it does not introduce itself.
    """
    session = stack.enter_context(Session(command, limits))
    session.start()
    clock_trouble = cache(partial(_clock_trouble, session))  # its clock is looked at once

    def run(workload: Workload, n_times: int) -> SolverRun:
        assert session.introduction is not None
        scene = to_data(workload.scene)
        if lacking := missing(session.introduction, "time", scene):
            raise Trouble("unsupported", lacking)
        answers: list[Given] = []
        lasted = 0
        for question in workload.questions:
            request: dict[str, Any] = {"cmd": "time", "scene": scene, "collisions": 1}
            request |= {"state": msgspec.to_builtins(question.state), "repeat": n_times}
            begin = time.monotonic()
            found = session.ask(request)
            seconds = time.monotonic() - begin
            ns, last = timing.read_repeats(found, n_times, seconds, question.state.t)
            lasted += sum(ns)
            answers.append(last)
        if (trouble := clock_trouble()) is not None:
            raise trouble
        return SolverRun(lasted / (n_times * len(answers)), answers, lasted)

    return Solver(name, family, run)


def _clock_trouble(session: Session) -> Trouble | None:
    """Hold what a command says of its time to the clock on this side; a run is too short to do so."""
    try:
        timing.honest_clock(session)
    except Trouble as trouble:
        return trouble
    return None
