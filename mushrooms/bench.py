"""`mushrooms bench`: speed against error on the same runs, and error growth."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from rich.markup import escape
from rich.table import Column, Table

import fast
from conformance.bench import baselines, growth, record, solvers, workloads
from conformance.bench.record import Record, Size, quartiles
from conformance.bench.solvers import Family, Solver, by_command
from conformance.cases.prover import proved_step
from conformance.files import Writer, write_files
from conformance.harness.examples import find_examples
from conformance.suite.process import CheckFailure
from conformance.suite.session import Limits
from mushrooms import bench_solvers as ours
from mushrooms import output
from mushrooms.figures import speed, style
from mushrooms.reports import bench_page
from mushrooms.terminal import announce_compilation, new_console, progress_bar, refuse_unheeded
from scene.refusal import BadInput

TIMEOUT, RESTARTS = 30.0, 1  # of a command
# By size: questions of a workload, steps with walls only, runs, trajectories and their length.
QUESTIONS = {"quick": 12, "full": 64}
FURTHER = {"quick": 200, "full": 2000}
REPEATS = {"quick": 5, "full": 11}
LASTING = {"quick": (3e6, 4e8), "full": (2e7, 4e9)}  # ns: of a run at least, of all runs at most
PATHS = {"quick": (3, 40), "full": (9, 80)}


def measure_solvers(
    command: list[str], out: Path, quick: bool, seed: int, table: Path | None, workload: str | None
) -> None:
    """Measure speed against error and write it into a folder; or print a table of an earlier benchmark."""
    if table is not None:
        measuring = {"--quick": quick or None, "COMMAND": command or None}
        refuse_unheeded(measuring, "--table measures nothing")
        print(bench_page.to_markdown(record.read(table), workload or "moving-cap-1e7"), end="")
        return
    refuse_unheeded({"--workload": workload}, "it needs --table")
    size: Size = "quick" if quick else "full"
    with output.writable_folder(out) as folder, announce_compilation():
        found = _measure(size, seed, command)
        picture = style.svg(speed.headline(found))
        files: dict[str, bytes | str | Writer] = {
            "bench.json": record.encode(found),
            "bench.svg": picture,
            "bench.html": bench_page.to_html(found, picture),
        }
        write_files(folder, files)
    console = new_console()
    console.print(_table(found))
    for name, why in found.not_run.items():
        console.print(f"not run: {name}: {why}", markup=False)
    print(f"{found.seconds:.0f} s. Report: {folder / 'bench.html'}")


def _measure(size: Size, seed: int, command: list[str]) -> Record:
    """Run everything."""
    begin = time.monotonic()
    n_questions, n_further, repeats = QUESTIONS[size], FURTHER[size], REPEATS[size]
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
            found, failures = solvers.measure(workload, running, effort, tick)
            points += found
            not_run |= {f"{name} on {rule.name}": why for name, why in failures.items()}
            tick("")
        n_paths, length = PATHS[size]
        bar.reset(task, total=n_paths, description="error growth")
        grown = growth.grow(ours.our_followers(), proved_step, ours.prove_path, seed, n_paths, length, tick)
    return record.Record(
        format=record.FORMAT,
        size=size,
        seed=seed,
        questions=n_questions,
        repeats=repeats,
        digits=workloads.DIGITS,
        machine=record.this_machine(built),
        workloads=tuple(
            record.Drawn(rule.name, rule.what, rule.scene, n_questions, n_further) for rule in workloads.RULES
        ),
        points=tuple(points),
        not_run=not_run,
        growth=grown,
        seconds=round(time.monotonic() - begin, 1),
    )


def _solvers(stack: ExitStack, command: list[str]) -> tuple[list[Solver], dict[str, str], dict[str, str]]:
    """Return solvers, what was compiled, and what cannot run."""
    limits = Limits(TIMEOUT, RESTARTS)
    found = [*ours.our_solvers(), *baselines.in_python()]
    built, not_run = dict[str, str](), dict[str, str]()
    folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
    try:
        library, built["lean C"] = baselines.build(folder, baselines.FLAGS)
        found += baselines.in_c(library)
    except CheckFailure as failure:
        not_run["lean C, time steps"] = failure.why

    def add(name: str, family: Family, line: Sequence[str]) -> None:
        found.append(by_command(name, family, line, stack, limits))

    examples = find_examples(folder, baselines.FLAGS)
    for language, example in examples.items():
        name = f"example in {language}"
        if not example.command:
            not_run[name] = example.why_not
            continue
        try:
            add(name, "example", example.command)
        except (CheckFailure, BadInput) as failure:
            not_run[name] = str(failure)
            continue
        if example.built:
            built[name] = example.built
    if command:
        try:
            add(f"command {' '.join(command)}", "command", command)
        except CheckFailure as failure:
            raise BadInput(f"command {command[0]!r} {failure.verdict}: {failure.why}") from None
    return found, built, not_run


def _table(found: Record) -> Table:
    numbers = ("ns/collision", "quartiles", "median ulps", "worst ulps", "wrong", "undecided", "left")
    table = Table(
        "workload", Column("stepper", no_wrap=True), title="Speed against error", title_justify="left"
    )
    for name in (*numbers, "wrong of further"):
        table.add_column(name, justify="right")
    for p in found.points:
        middle, worst = bench_page.middle_and_worst(p.ulps, ".2g")
        counts = [str(n) if n else "" for n in (p.wrong, p.undecided, p.left)]
        first, ns, third = quartiles(p.ns)
        spread = f"-{1 - first / ns:.1%} +{third / ns - 1:.1%}"
        row = [escape(p.solver), f"{ns:,.0f}", spread, middle, worst, *counts, bench_page.astray(p)]
        table.add_row(p.workload, *row)
    return table
