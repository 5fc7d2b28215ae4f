"""`mushrooms bench`: speed against error on the same runs, error growth, cost against work, hard cases."""

from __future__ import annotations

import os
import subprocess
import tempfile
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from mushrooms import output
from mushrooms.terminal import compilation_told, progress_bar, refuse_unheeded
from scene.files import Writer, write_files
from scene.refusal import BadInput, check_seed

if TYPE_CHECKING:
    from conformance.bench.comparison import Ratio
    from conformance.bench.contenders import Ask, Contender, Family
    from conformance.bench.measure import Effort
    from conformance.bench.record import Drawn, Record, Size

TIMEOUT, RESTARTS = 30.0, 1  # of a command
C_FLAGS = ("-O3", "-march=native")
# By size: questions of a workload, steps with walls only, laps, trajectories and their length, repeats of an
# ensemble.
QUESTIONS = {"quick": 12, "full": 64}
FURTHER = {"quick": 200, "full": 2000}
REPEATS = {"quick": 5, "full": 11}
PATHS = {"quick": (3, 40), "full": (9, 80)}
ENSEMBLE_REPEATS = {"quick": 1, "full": 3}


def bench(
    command: Annotated[
        list[str] | None,
        typer.Argument(metavar="[-- COMMAND...]", help="One more stepper; speaks protocol 1."),
    ] = None,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the results.")] = Path("bench-report"),
    quick: Annotated[bool, typer.Option("--quick", help="Fewer questions and laps: five minutes.")] = False,
    seed: Annotated[int, typer.Option(help="Seed of the questions, 0 to 2^64 - 1.")] = 0,
    compare: Annotated[
        Path | None, typer.Option(metavar="OLD.json", help="An earlier bench.json to compare with.")
    ] = None,
    table: Annotated[
        Path | None,
        typer.Option(metavar="OLD.json", help="Print a table of an earlier bench.json as Markdown, and end."),
    ] = None,
    workload: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Which table; or `all`. By default moving-cap-1e7."),
    ] = None,
) -> None:
    """Measure speed against error; writes bench.json, bench.svg, bench.html and hard-cases.md.

    Exit code 0, or 1 when --compare shows a stepper slower than laps explain, or 2 on bad input.
    """
    from conformance.bench import comparison, hard_cases, record
    from mushrooms.figures import speed as figures_of_speed
    from mushrooms.reports import bench_page

    _check_table(table, workload, quick, compare, command)
    if table is not None:
        print(bench_page.to_markdown(record.read(table), workload or "moving-cap-1e7"), end="")
        return
    check_seed(seed, "--seed")
    size: Size = "quick" if quick else "full"
    old = record.read(compare) if compare is not None else None
    if old is not None:
        comparison.check_alike(old, size, seed, QUESTIONS[size], _drawn(size))
    with output.writable_folder(out) as folder, compilation_told():
        found = _measured(size, seed, command or [])
        picture = figures_of_speed.speed(found)
        files: dict[str, bytes | str | Writer] = {
            "bench.json": record.encode(found),
            "bench.svg": picture,
            "bench.html": bench_page.to_html(found, picture),
            "hard-cases.md": hard_cases.to_markdown(found.hard_cases).encode(),
        }
        write_files(folder, files)
    console = Console(width=140)
    console.print(_table(found))
    for name, why in found.not_run.items():
        console.print(f"not run: {name}: {why}", markup=False)
    print(f"{found.seconds:.0f} s. Report: {folder / 'bench.html'}")
    if old is not None:
        ratios = comparison.compare(old, found)
        console.print(_ratios(ratios))
        for what in comparison.gone(old, found):
            console.print(f"not measured any more: {what}", markup=False)
        slower = [r for r in ratios if r.is_slower]
        print(f"{len(slower)} of {len(ratios)} slower than {comparison.SLOWER} times {compare}")
        raise typer.Exit(1 if slower else 0)


def _check_table(
    table: Path | None, workload: str | None, quick: bool, compare: Path | None, command: list[str] | None
) -> None:
    """Refuse options that would change nothing: a table is of an earlier run, and a run has all workloads."""
    if table is None:
        refuse_unheeded({"--workload": workload}, "it needs --table")
    else:
        measuring = {"--quick": quick or None, "--compare": compare, "COMMAND": command or None}
        refuse_unheeded(measuring, "--table measures nothing")


def _measured(size: Size, seed: int, command: list[str]) -> Record:
    """Run everything."""
    import fast
    from conformance.bench import growth, hard_cases, measure, record, work, workloads
    from conformance.cases.prover import proved_step
    from mushrooms import bench_contenders as ours

    begin = time.monotonic()
    n_questions, n_further, repeats = QUESTIONS[size], FURTHER[size], REPEATS[size]
    with ExitStack() as stack:
        bar = stack.enter_context(progress_bar())
        task = bar.add_task("speed against error", total=len(workloads.RULES) * (repeats + 1))

        def tick(what: str) -> None:
            bar.update(task, advance=0 if what else 1, description=escape(what) or None)

        contenders, askers, built, not_run = _contenders(stack, command)
        points, clock = [], list[float]()
        for rule in workloads.RULES:
            tick(f"questions: {rule.name}")
            workload = workloads.draw_workload(
                rule, seed, n_questions, proved_step, n_further, fast.next_collision
            )
            found, troubles = measure.measure(workload, contenders, _effort(size), tick, clock)
            points += found
            not_run |= {f"{name} on {rule.name}": why for name, why in troubles.items()}
            tick("")
        n_paths, length = PATHS[size]
        bar.reset(task, total=n_paths, description="error growth")
        grown = growth.grow(
            ours.our_followers(), proved_step, ours.linearise, ours.prove_path, seed, n_paths, length, tick
        )
        bar.reset(task, total=48, description="hard cases")
        cases = hard_cases.tabulate(askers, tick)
        bar.reset(task, total=None)
        series, memory = work.measure_work(
            ours.run_ensemble, size, os.cpu_count() or 1, ENSEMBLE_REPEATS[size], tick
        )
        tick("compile times")
        compiled = _compile_times(not_run) if size == "full" else {}
    return record.Record(
        format=record.FORMAT,
        size=size,
        seed=seed,
        questions=n_questions,
        repeats=repeats,
        digits=workloads.DIGITS,
        machine=record.this_machine(built),
        clock_ns=tuple(clock),
        workloads=_drawn(size),
        points=tuple(points),
        not_run=not_run,
        growth=grown,
        work=record.EnsembleWork(work.SCENE, series, memory, compiled),
        hard_cases=cases,
        seconds=round(time.monotonic() - begin, 1),
    )


def _drawn(size: Size) -> tuple[Drawn, ...]:
    """Describe the workloads of a run."""
    from conformance.bench import record, workloads

    numbers = QUESTIONS[size], FURTHER[size]
    return tuple(record.Drawn(rule.name, rule.what, rule.scene, *numbers) for rule in workloads.RULES)


def _compile_times(not_run: dict[str, str]) -> dict[str, float]:
    from mushrooms import bench_contenders as ours

    try:
        return ours.compile_times()
    except subprocess.CalledProcessError as error:
        not_run["compile times"] = f"exit code {error.returncode}"
        return {}


def _effort(size: str) -> Effort:
    from conformance.bench.measure import Effort

    return Effort(REPEATS[size], 3e6, 4e8) if size == "quick" else Effort(REPEATS[size], 2e7, 4e9)


def _contenders(
    stack: ExitStack, command: list[str]
) -> tuple[list[Contender], dict[str, Ask], dict[str, str], dict[str, str]]:
    """Return contenders, how each answers a vector, what was compiled, and what cannot run."""
    from conformance.bench import baselines
    from conformance.bench.contenders import by_command, plain_python, time_steppers
    from conformance.harness.examples import find_examples
    from conformance.suite.process import Trouble
    from conformance.suite.session import Limits
    from mushrooms import bench_contenders as ours

    limits = Limits(TIMEOUT, RESTARTS)
    contenders = [*ours.our_contenders(), baselines.in_numba(), plain_python(), *time_steppers()]
    askers = ours.our_askers()
    built, not_run = {}, {}
    folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
    try:
        library, built["lean C"] = baselines.build(folder, C_FLAGS)
        in_c = baselines.in_c(library)
        contenders += in_c
        askers |= {c.name: baselines.asker(c) for c in (in_c[0], in_c[-1])}
    except Trouble as trouble:
        not_run["lean C, time steps"] = trouble.why

    def add(name: str, family: Family, line: Sequence[str]) -> None:
        contender, askers[name] = by_command(name, family, line, stack, limits)
        contenders.append(contender)

    examples = find_examples(folder, C_FLAGS)
    for language, example in examples.items():
        name = f"example in {language}"
        if not example.command:
            not_run[name] = example.why_not
            continue
        try:
            add(name, "example", example.command)
        except (Trouble, BadInput) as trouble:
            not_run[name] = str(trouble)
            continue
        if example.built:
            built[name] = example.built
    if command:
        try:
            add(f"command {' '.join(command)}", "command", command)
        except Trouble as trouble:
            raise BadInput(f"command {command[0]!r} {trouble.verdict}: {trouble.why}") from None
    return contenders, askers, built, not_run


def _new_table(title: str, *numbers: str) -> Table:
    table = Table("workload", "stepper", title=title, title_justify="left")
    for name in numbers:
        table.add_column(name, justify="right")
    return table


def _table(found: Record) -> Table:
    from conformance.bench.record import quartiles
    from mushrooms.reports.bench_page import astray, middle_and_worst

    numbers = ("ns/collision", "quartiles", "median ulps", "worst ulps", "wrong", "undecided", "left")
    table = _new_table("Speed against error", *numbers, "wrong of further")
    for p in found.points:
        middle, worst = middle_and_worst(p.ulps, ".2g")
        counts = [str(n) if n else "" for n in (p.wrong, p.undecided, p.left)]
        first, ns, third = quartiles(p.ns)
        spread = f"-{1 - first / ns:.1%} +{third / ns - 1:.1%}"
        row = [escape(p.contender), f"{ns:,.0f}", spread, middle, worst, *counts, astray(p)]
        table.add_row(p.workload, *row)
    return table


def _ratios(ratios: list[Ratio]) -> Table:
    table = _new_table("New time over old, 99 % bootstrap interval over the laps", "ratio", "interval")
    for r in ratios:
        mark = " slower" if r.is_slower else ""
        table.add_row(r.workload, escape(r.contender), f"{r.ratio:.2f}", f"{r.low:.2f} to {r.high:.2f}{mark}")
    return table
