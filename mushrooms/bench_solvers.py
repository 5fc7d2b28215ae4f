"""Our steppers as the benchmark's solvers, and the proofs that all are measured against."""

from __future__ import annotations

import math
import time

import fast
import reference
from conformance import plain
from conformance.bench.solvers import (
    FAR,
    PathFollower,
    PathPoint,
    Sensitivity,
    Solver,
    SolverAnswer,
    SolverRun,
    by_call,
)
from conformance.bench.workloads import FLIGHTS, Workload
from conformance.cases.certify import Links, collided
from conformance.grading.agreement import Answer, Enclosed, exact
from fast.batch import careful_steps, fine_steps, flights, lane_steps
from scene import Collision, Scene, State

DIGITS = (15, 30, 50, 100, 200)
PATH_DIGITS = (30, 60)  # working decimals of the proofs whose growth is followed
LANES_SERVE = (
    "breathing-disk", "fixed-cap", "moving-cap-1e4", "moving-cap-1e7", "moving-cap-1e12", "two-harmonics",
    "sixteen-harmonics", "moving-slope", "bang-bang", "one-path",
)  # fmt: skip


def prove_path(scene: Scene, state: State, n_collisions: int) -> tuple[list[PathPoint], list[Sensitivity]]:
    """Follow a path by proof, right to twenty digits at its end, and chain the Jacobians of its steps."""
    path, links = reference.trajectory(scene, state, n_collisions, digits=20), Links(scene, state, FAR)
    chain = [Sensitivity(links.add(step), links.held[0]) for step in path.steps]
    return _places(path), chain


def our_solvers() -> list[Solver]:
    """Return our steppers: the reference at several precisions, and the fast one's five ways."""
    return [
        *(_proof(digits) for digits in DIGITS),
        by_call("fast, a call", "compiled", fast.next_collision),
        Solver("fast, careful", "compiled", _careful),
        Solver("fast, pairs", "compiled", _fine),
        Solver("fast, lanes", "compiled", _lanes, LANES_SERVE, lane_steps),
        Solver("fast, trajectory", "compiled", _trajectory, ("one-path",)),
    ]


def our_followers() -> dict[str, PathFollower]:
    """Return followers of trajectories: binary64, with compensated time, and proofs of fixed precision."""
    return {
        "binary64 (plain Python)": _plain_path,
        "compensated (fast)": _fast_path,
        "double-double (fast)": _fine_path,
        **{f"proof, {digits} decimals": _proof_path(digits) for digits in PATH_DIGITS},
    }


def _proof(digits: int) -> Solver:
    def step(scene: Scene, state: State, t_end: float) -> Answer:
        found = reference.next_collision(scene, state, t_end, digits=digits)
        if isinstance(found, reference.Collision):
            return Enclosed(found.wall, list(collided(found).values()))
        return found.rounded() if isinstance(found, reference.Horizon) else found

    return by_call(f"proof, {digits} digits", "proof", step)


def _careful(workload: Workload, n_times: int) -> SolverRun:
    answers, seconds = careful_steps(workload.scene, [q.state for q in workload.questions], n_times)
    return SolverRun(seconds / (n_times * len(answers)) * 1e9, list(answers), seconds * 1e9)


def _fine(workload: Workload, n_times: int) -> SolverRun:
    paths, seconds = fine_steps(workload.scene, [q.state for q in workload.questions], n_times)
    answers: list[SolverAnswer] = []
    for path in paths:
        if path.outcome is None:
            dt, _, *place = path.numbers(0)
            answers.append(exact(path.walls[0], (dt, *place)))
        else:
            answers.append(path.outcome)
    return SolverRun(seconds / (n_times * len(answers)) * 1e9, answers, seconds * 1e9)


def _lanes(workload: Workload, n_times: int) -> SolverRun:
    """Time the engine on flights that go on from the questions; grade one round of its lanes on these."""
    states = [q.state for q in workload.questions]
    copies = -(-128 // len(states))  # enough to fill both pools
    followed = states[:1] if workload.length else states * copies
    t_end = workload.end(workload.length or FLIGHTS)
    seconds, n_collisions = 0.0, 0
    for _ in range(n_times):
        n, lasted = flights(workload.scene, followed, t_end)
        n_collisions, seconds = n_collisions + n, seconds + lasted
    return SolverRun(seconds / n_collisions * 1e9, list(lane_steps(workload.scene, states)), seconds * 1e9)


def _trajectory(workload: Workload, n_times: int) -> SolverRun:
    """Time a path from the first question, the call and its arrays included; grade a step from each."""
    states = [q.state for q in workload.questions]
    paths = [fast.trajectory(workload.scene, state, 1) for state in states]
    begin = time.perf_counter_ns()
    for _ in range(n_times):
        fast.trajectory(workload.scene, states[0], workload.length)
    ns = time.perf_counter_ns() - begin
    answers: list[SolverAnswer] = [Collision(path.walls[0], *path.steps[0].tolist()) for path in paths]
    return SolverRun(ns / (n_times * workload.length), answers, ns)


def _plain_path(scene: Scene, state: State, n_collisions: int) -> list[PathPoint]:
    found = plain.trajectory(scene, state, n_collisions, state.t + FAR)
    return [PathPoint(c.wall, c.x, c.y, c.vx, c.vy) for c in found if isinstance(c, Collision)]


def _fast_path(scene: Scene, state: State, n_collisions: int) -> list[PathPoint]:
    path = fast.trajectory(scene, state, n_collisions)
    return [PathPoint(wall, *row[2:]) for wall, row in zip(path.walls, path.steps.tolist(), strict=True)]


def _fine_path(scene: Scene, state: State, n_collisions: int) -> list[PathPoint]:
    path = fast.fine_trajectory(scene, state, n_collisions)
    found = []
    for i, wall in enumerate(path.walls):
        _, _, x, y, vx, vy = path.numbers(i)
        found.append(PathPoint(wall, x, y, vx, vy))
    return found


def _proof_path(digits: int) -> PathFollower:
    def follow(scene: Scene, state: State, n_collisions: int) -> list[PathPoint]:
        return _places(reference.trajectory(scene, state, n_collisions, working=digits))

    return follow


def _places(path: reference.Trajectory) -> list[PathPoint]:
    found = []
    for step in path.steps:
        ends = [c.centre() for c in step.after[1:]]
        size, speed = (math.hypot(*map(float, pair)) for pair in (ends[:2], ends[2:]))
        widths = [c.width() for c in step.after[1:]]
        x, y, vx, vy = ends
        width = max(max(widths[:2]) / size, max(widths[2:]) / speed)
        found.append(PathPoint(step.wall, x, y, vx, vy, width))
    return found
