"""`mushrooms bench`: speed against error on the same runs, and error growth.

Our steppers are among the solvers that are measured, and the proofs are what all are measured
against.
"""

import math
import tempfile
import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from rich.markup import escape

import fast
import reference
from conformance import plain
from conformance.bench import baselines, record, solvers, workloads
from conformance.bench.record import Record, Size
from conformance.bench.solvers import (
    FAR,
    PathFollower,
    PathPoint,
    Sensitivity,
    Solver,
    SolverAnswer,
    SolverRun,
    by_call,
    by_command,
)
from conformance.bench.workloads import FLIGHTS, Workload
from conformance.cases.certify import Links, collided, proved_step
from conformance.grading.agreement import Answer, Enclosed, exact
from conformance.harness.examples import find_examples
from conformance.suite.process import CheckFailure
from conformance.suite.session import Limits
from fast.batch import careful_steps, fine_steps, lane_steps
from fast.paths import carry
from mushrooms.figures import style
from mushrooms.folders import writable_folder
from mushrooms.progress import announce_compilation, progress_bar
from mushrooms.reports import bench_page
from scene import BadInput, Collision, Scene, State
from scene.files.writer import write_files
from scene.refusal import refuse_unheeded

# Of a command.
TIMEOUT = 30.0
RESTARTS = 1
# By size: questions of a workload, steps with walls only, runs, trajectories and their length.
QUESTIONS = {"quick": 12, "full": 64}
FURTHER = {"quick": 200, "full": 2000}
REPEATS = {"quick": 5, "full": 11}
LASTING = {"quick": (3e6, 4e8), "full": (2e7, 4e9)}  # ns: of a run at least, of all runs at most
PATHS = {"quick": (3, 40), "full": (9, 80)}
DIGITS = (15, 30, 50, 100, 200)  # of the proofs that are timed
PATH_DIGITS = (30, 60)  # working decimals of the proofs whose growth is followed
LANES_SERVE = (
    "breathing-disk", "fixed-cap", "moving-cap-1e4", "moving-cap-1e7", "moving-cap-1e12",
    "two-harmonics", "sixteen-harmonics", "moving-slope", "bang-bang", "one-path",
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchOptions:
    """The options of `mushrooms bench`.

    Attributes:
        command: program and arguments of another stepper to measure.
        out: folder for the results.
        quick: fewer questions and runs.
        seed: of the questions.
        table: an earlier bench.json, of which a table is printed.
        workload: of the table; None for the headline's.
    """

    command: Sequence[str] | None
    out: Path
    quick: bool
    seed: int
    table: Path | None
    workload: str | None


def measure_solvers(options: BenchOptions) -> None:
    """Measure speed against error and write it into a folder.

    Or print a table of an earlier benchmark.
    """
    if options.table is not None:
        measuring = {"--quick": options.quick or None, "COMMAND": options.command or None}
        refuse_unheeded(measuring, "--table measures nothing")
        earlier = record.read(options.table)
        print(bench_page.to_markdown(earlier, options.workload or bench_page.HEADLINE), end="")
        return
    refuse_unheeded({"--workload": options.workload}, "it needs --table")
    size: Size = "quick" if options.quick else "full"
    with writable_folder(options.out) as folder, announce_compilation():
        found = _measure(size, options.seed, options.command or [])
        picture = style.svg(bench_page.headline(found))
        write_files(
            folder,
            {
                "bench.json": record.encode(found),
                "bench.svg": picture,
                "bench.html": bench_page.to_html(found, picture),
            },
        )
    for drawn in found.workloads:
        print(f"{drawn.name}\n\n{bench_page.to_markdown(found, drawn.name)}")
    for name, why in found.not_run.items():
        print(f"not run: {name}: {why}")
    print(f"{found.seconds:.0f} s. Report: {folder / 'bench.html'}")


def _measure(size: Size, seed: int, command: Sequence[str]) -> Record:
    """Run everything."""
    begin = time.monotonic()
    n_questions = QUESTIONS[size]
    n_further = FURTHER[size]
    repeats = REPEATS[size]
    effort = solvers.Effort(repeats, *LASTING[size])
    with ExitStack() as stack:
        bar = stack.enter_context(progress_bar())
        task = bar.add_task("speed against error", total=len(workloads.RULES) * (repeats + 1))

        def tick(what: str) -> None:
            bar.update(task, advance=0 if what else 1, description=escape(what) or None)

        running, built, not_run = _solvers(stack, command)
        points = []
        for rule in workloads.RULES:
            tick(f"questions: {rule.name}")
            workload = workloads.draw_workload(
                rule, seed, n_questions, proved_step, n_further, fast.next_collision
            )
            fast.warm(workload.scene)  # what is measured is compiled code
            found, failures = solvers.measure(workload, running, effort, tick)
            points += found
            not_run |= {f"{name} on {rule.name}": why for name, why in failures.items()}
            tick("")
        n_paths, length = PATHS[size]
        bar.reset(task, total=n_paths, description="error growth")
        grown = solvers.grow(our_followers(), proved_step, prove_path, seed, n_paths, length, tick)
    return record.Record(
        format=record.FORMAT,
        size=size,
        seed=seed,
        questions=n_questions,
        repeats=repeats,
        digits=workloads.DIGITS,
        machine=record.this_machine(built),
        workloads=tuple(
            record.Drawn(rule.name, rule.what, rule.scene, n_questions, n_further)
            for rule in workloads.RULES
        ),
        points=tuple(points),
        not_run=not_run,
        growth=grown,
        seconds=round(time.monotonic() - begin, 1),
    )


def _solvers(
    stack: ExitStack, command: Sequence[str]
) -> tuple[list[Solver], dict[str, str], dict[str, str]]:
    """Return solvers, what was compiled, and what cannot run."""
    limits = Limits(TIMEOUT, RESTARTS)
    found = [*our_solvers(), *baselines.in_python()]
    built = dict[str, str]()
    not_run = dict[str, str]()
    folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
    try:
        library, built["lean C"] = baselines.build(folder, baselines.FLAGS)
        found += baselines.in_c(library)
    except CheckFailure as failure:
        not_run["lean C, time steps"] = failure.why

    for language, example in find_examples(folder, baselines.FLAGS).items():
        name = f"example in {language}"
        if not example.command:
            not_run[name] = example.why_not
            continue
        try:
            found.append(by_command(name, "example", example.command, stack, limits))
            built |= {name: example.built} if example.built else {}
        except (CheckFailure, BadInput) as failure:
            not_run[name] = str(failure)
    if command:
        try:
            name = f"command {' '.join(command)}"
            found.append(by_command(name, "command", command, stack, limits))
        except CheckFailure as failure:
            raise BadInput(f"command {command[0]!r} {failure.verdict}: {failure.why}") from None
    return found, built, not_run


def prove_path(
    scene: Scene, state: State, n_collisions: int
) -> tuple[list[PathPoint], list[Sensitivity]]:
    """Follow a path by proof and chain the Jacobians of its steps.

    Twenty digits are right at its end.
    """
    path = reference.trajectory(scene, state, n_collisions, digits=20, is_differentiated=True)
    links = Links(state)
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
    """Return followers of trajectories.

    They use binary64, compensated time, or proofs of fixed precision.
    """
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
    """Time the engine on flights that go on from the questions.

    Grade one round of its lanes on these.
    """
    states = [q.state for q in workload.questions]
    copies = -(-128 // len(states))  # enough to fill both pools
    followed = states[:1] if workload.rule.length else states * copies
    t_end = workload.end(workload.rule.length or FLIGHTS)
    seconds = 0.0
    n_collisions = 0
    for _ in range(n_times):
        run, lasted = carry(workload.scene, followed, [None] * len(followed), t_end, 1)
        n_collisions = n_collisions + int(run.wall_counts.sum())
        seconds = seconds + lasted
    return SolverRun(
        seconds / n_collisions * 1e9, list(lane_steps(workload.scene, states)), seconds * 1e9
    )


def _trajectory(workload: Workload, n_times: int) -> SolverRun:
    """Time a path from the first question, the call and its arrays included.

    Grade a step from each.
    """
    states = [q.state for q in workload.questions]
    paths = [fast.trajectory(workload.scene, state, 1) for state in states]
    begin = time.perf_counter_ns()
    for _ in range(n_times):
        fast.trajectory(workload.scene, states[0], workload.rule.length)
    ns = time.perf_counter_ns() - begin
    answers: list[SolverAnswer] = [
        Collision(path.walls[0], *path.steps[0].tolist()) for path in paths
    ]
    return SolverRun(ns / (n_times * workload.rule.length), answers, ns)


def _plain_path(scene: Scene, state: State, n_collisions: int) -> list[PathPoint]:
    found = plain.trajectory(scene, state, n_collisions, state.t + FAR)
    return [PathPoint(c.wall, c.x, c.y, c.vx, c.vy) for c in found if isinstance(c, Collision)]


def _fast_path(scene: Scene, state: State, n_collisions: int) -> list[PathPoint]:
    path = fast.trajectory(scene, state, n_collisions)
    return [
        PathPoint(wall, *row[2:]) for wall, row in zip(path.walls, path.steps.tolist(), strict=True)
    ]


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
