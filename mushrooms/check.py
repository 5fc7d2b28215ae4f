"""`mushrooms check`: the conformance suite on a command, with its progress, summary and report files."""

from __future__ import annotations

import math
import secrets
import shlex
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from conformance.files import write_file
from mushrooms import output
from mushrooms.terminal import new_console, progress_bar, refuse_unheeded
from scene.refusal import BadInput, check_seed

if TYPE_CHECKING:
    from rich.progress import Progress

    from conformance.suite.result import Run

LONGEST = 7 * 86_400  # seconds
EVERY = 10.0  # seconds between lines where there is no terminal
MAX_SHOWN = 20  # objections on the terminal; all are in the reports
MAX_TAUGHT = 5  # of them with what was given and what is certified, or with what was sent
MAX_SENT = 500  # characters of that, and of a line of standard error
MAX_ERRORS = 6  # lines of that
COLOURS = {"pass": "green", "declined": "yellow", "unsupported": "yellow"}


def check(
    command: Annotated[
        list[str] | None, typer.Argument(metavar="-- COMMAND...", help="The stepper; it speaks protocol 1.")
    ] = None,
    level: Annotated[str, typer.Option(help="core, extended or stress.")] = "core",
    seed: Annotated[int | None, typer.Option(help="Seed of the questions; default: a new one.")] = None,
    timeout: Annotated[float, typer.Option(help="Seconds for one answer, compilation included.")] = 120.0,
    total: Annotated[
        float | None, typer.Option(help="Seconds for the whole run; no limit by default.")
    ] = None,
    restarts: Annotated[int, typer.Option(help="Fresh processes after the first, 0 to 1000.")] = 10,
    groups: Annotated[
        str, typer.Option(help="Only these groups of cases, separated by commas; default: all.")
    ] = "",
    known_failures: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Known to fail, one per line: ID, ID@SEED, fresh/*, declined/GROUP."
        ),
    ] = None,
    json_file: Annotated[Path | None, typer.Option("--json", metavar="FILE", help="JSON report.")] = None,
    junit: Annotated[Path | None, typer.Option(metavar="FILE", help="JUnit XML report.")] = None,
    html: Annotated[Path | None, typer.Option(metavar="FILE", help="HTML report.")] = None,
    badge: Annotated[Path | None, typer.Option(metavar="FILE", help="Badge (SVG) to publish.")] = None,
    summary: Annotated[Path | None, typer.Option(metavar="FILE", help="Verdict and scope as JSON.")] = None,
    questions: Annotated[
        Path | None,
        typer.Option(metavar="PATH", help="Write the questions to a .jsonl file, or as CSV into a folder."),
    ] = None,
    answers: Annotated[
        Path | None, typer.Option(metavar="PATH", help="Grade these answers to the file of --questions.")
    ] = None,
) -> None:
    """Test a stepper in any language. COMMAND starts it; it speaks protocol 1 on stdin and stdout.

    Each question is randomly mirrored and rescaled. The seed is printed, and --seed repeats a run.
    Without a dialogue: --questions writes questions to a file, --answers grades the answers in a file.

    Exit code 0 if everything passes, 1 if something fails, 2 if the options or the suite are at fault.
    """
    _check_limits(timeout, restarts, total)
    files = _report_files(json_file, junit, html, badge, summary)
    if groups and not groups.replace(",", " ").split():
        raise BadInput(f"--groups = {groups!r}, must name a group; all are asked without it")
    names = [name.strip() for name in groups.split(",") if name.strip()]
    if questions or answers:
        unheeded = {"COMMAND": command, "--groups": groups or None, "--known-failures": known_failures}
        refuse_unheeded(unheeded, "questions and answers are in files")
        if answers is None:
            refuse_unheeded({str(path): True for path, _ in files}, "nothing is graded yet")
            assert questions is not None
            write_questions(questions, level, seed)
            return
        run = grade_file(answers, questions, level, seed)
    else:
        run = _asked(command or [], level, seed, names, (timeout, restarts, total), known_failures)
    for path, content in files:
        write_file(path, content(run))
    show(run)
    raise typer.Exit(run.exit_code())


def _check_limits(timeout: float, restarts: int, total: float | None) -> None:
    for name, seconds in (("--timeout", timeout), ("--total", total)):
        if seconds is not None and not (math.isfinite(seconds) and 0 < seconds <= LONGEST):
            raise BadInput(f"{name} = {seconds}, must be > 0 and at most {LONGEST} seconds")
    if not 0 <= restarts <= 1000:
        raise BadInput(f"--restarts = {restarts}, must be 0 to 1000")


def _report_files(*given: Path | None) -> list[tuple[Path, Callable[[Run], bytes | str]]]:
    """Return the report files that are asked for, each with what makes its content, in the options' order."""
    asked_for = zip(given, _writers(), strict=True)
    files = [(path, suffix, content) for path, (suffix, content) in asked_for if path]
    for i, (path, suffix, _) in enumerate(files):
        output.check_file(path, (suffix,))
        if path in [other for other, _, _ in files[:i]]:
            raise BadInput(f"output {str(path)!r} is asked for twice, must be a file for each report")
    return [(path, content) for path, _, content in files]


def _asked(
    command: list[str],
    level: str,
    seed: int | None,
    groups: list[str],
    limits: tuple[float, int, float | None],
    known_failures: Path | None,
) -> Run:
    """Run the suite on a command, with its progress shown."""
    from conformance import suite
    from conformance.suite.session import Limits

    known = suite.read_known(known_failures) if known_failures else frozenset()
    with progress_bar() as bar:
        return suite.check(
            command,
            level=level,
            seed=seed,
            groups=groups,
            limits=Limits(*limits),
            known=known,
            progress=_teller(bar),
        )


def _teller(bar: Progress) -> Callable[[int, int], None]:
    """Return what moves a bar on a terminal, and elsewhere writes a line on stderr now and then."""
    task, told = bar.add_task("cases", total=None), time.monotonic()

    def tell(n_done: int, n_total: int) -> None:
        nonlocal told
        bar.update(task, completed=n_done, total=n_total)
        if bar.disable and time.monotonic() - told > EVERY:
            told = time.monotonic()
            print(f"{n_done} of {n_total} cases", file=sys.stderr, flush=True)

    return tell


def _writers() -> tuple[tuple[str, Callable[[Run], bytes | str]], ...]:
    """Return the ending and the content of each report file, in the order of the options."""
    from conformance.suite import reports

    def to_html(run: Run) -> bytes:
        from mushrooms.reports import check_page  # it draws, and drawing takes a second to import

        return check_page.to_html(run)

    kinds = reports.to_json, reports.to_junit, to_html, reports.to_badge, reports.to_summary
    return tuple(zip((".json", ".xml", ".html", ".svg", ".json"), kinds, strict=True))


def show(run: Run) -> None:
    """Print verdicts by group, with every denominator, and what stands against success."""
    from conformance.suite import reports
    from conformance.suite.result import VERDICTS

    groups = [*(reports.summarise(run, group) for group in run.groups()), reports.summarise(run)]
    seen = [verdict for verdict in VERDICTS if verdict == "pass" or groups[-1].counts[verdict]]
    table = Table("group", "cases", *seen, "worst ulps", "A/B/C", "class", title=_title(run))
    for column in table.columns[1:]:
        column.justify = "right"
    for group in groups:
        cells = [_cell(verdict, group.counts[verdict]) for verdict in seen]
        worst = "inf" if group.worst_ulps is None else f"{group.worst_ulps:.3g}"
        table.add_section() if group is groups[-1] else None
        graded = group.precision != "–"
        counts = "/".join(map(str, group.classes.values())) if graded else "–"
        table.add_row(
            group.group, str(group.cases), *cells, worst if graded else "–", counts, group.precision
        )
    console = new_console()
    console.print(table)
    if run.speed:
        best = f"{run.speed.best_ns:.4g} ns per collision"
        console.print(
            f"Speed on {run.speed.scene}: {best}, best of {run.speed.repeats} x {run.speed.collisions}."
        )
    for result in run.results:
        if result.group == "profile" and result.verdict == "pass":
            console.print(f"{result.id}: {result.why}.")
    _show_objections(console, run)
    console.print(_verdict(run, groups[-1]))
    colour = "green" if run.exit_code() == 0 else "red"
    console.print(f"[bold {colour}]{run.verdict()}[/]: {escape(str(run.scope()))}")


def _show_objections(console: Console, run: Run) -> None:
    """Print why the run does not succeed: what was given beside what is certified, and what fails alike."""
    objections, stderr = run.objections(), run.stderr.split("\n")
    for line in objections[:MAX_SHOWN]:
        console.print(f"[red]{escape(line)}[/]")
    if len(objections) > MAX_SHOWN:
        console.print(f"... and {len(objections) - MAX_SHOWN} more: --json FILE has them all.")
    broken = [r for r in run.results if not r.is_right and (r.verdict == "crashed" or r.group == "protocol")]
    if broken and any(stderr):
        console.print("Its standard error ends:")
        for line in [line for line in stderr if line.strip()][-MAX_ERRORS:]:
            console.print(f"  {escape(line[:MAX_SENT])}")
    for result in [r for r in run.results if r.expected and not r.is_known and not r.is_right][:MAX_TAUGHT]:
        again = f"mushrooms ask {result.id} --seed {run.seed}"
        console.print(f"{result.id}, asked {escape(result.asked)}; {again} prints it")
        console.print(f"  given     {escape(in_one_line(result.given))}")
        console.print(f"  certified {escape(in_one_line(result.expected))}")
    wrong = [r for r in run.results if not r.is_right and not r.is_known]
    for result in [r for r in wrong if r.paste][:MAX_TAUGHT]:
        console.print(
            f"{result.id} as a test, where implementation is {run.command}:", markup=False, soft_wrap=True
        )
        console.print(result.paste, markup=False, soft_wrap=True)
    for result in [r for r in wrong if r.sent and r.group == "protocol"][:MAX_TAUGHT]:
        rest = "... (--json FILE has it whole)" if len(result.sent) > MAX_SENT else ""
        console.print(f"{result.id}, sent last: {escape(result.sent[:MAX_SENT])}{rest}")
    for line in run.diagnosis:
        console.print(f"[yellow]{escape(line)}[/]")


def in_one_line(outcome: dict[str, Any] | None) -> str:
    """Return an outcome's fields on a line."""
    if outcome is None:
        return "nothing"
    return " ".join(
        f"{name}={value!r}" if name != "outcome" else str(value) for name, value in outcome.items()
    )


def _title(run: Run) -> str:
    who = run.introduction
    name = f"{who.name} {who.version} ({who.language})" if who else shlex.join(run.command)
    return escape(f"{name}, level {run.level}, corpus {run.corpus}")


def _cell(verdict: str, n: int) -> str:
    return f"[{COLOURS.get(verdict, 'bold red')}]{n}[/]" if n else "[dim]0[/]"


def _verdict(run: Run, total: Any) -> str:
    passed = f"{total.counts['pass']} of {total.cases} cases pass"
    restarts = f", {run.n_restarts} restarts" if run.n_restarts else ""
    doubt = ": the corpus could not tell, which is its own fault" if run.exit_code() == 2 else ""
    return f"{passed}{restarts}, {run.seconds:.1f} s{doubt}."


def write_questions(path: Path, level: str, seed: int | None) -> None:
    """Write the questions of a run: as JSON lines into a .jsonl file, or else as CSV into a folder.

    Raises:
        BadInput: the level, the seed or the path is none; nothing is written then.
    """
    from conformance.suite import sheet_files
    from conformance.suite.run import NEW_SEEDS, choose
    from conformance.suite.sheet import Sheet

    choose(level)
    seed = secrets.randbelow(NEW_SEEDS) if seed is None else check_seed(seed, "--seed")
    if path.suffix == ".jsonl":
        output.check_file(path, (".jsonl",))
        sheet = Sheet(level, seed)
        n = sheet_files.write_lines(sheet, path)
    elif path.suffix:
        raise BadInput(f"--questions = {str(path)!r}, must end in .jsonl, or be a folder for CSV")
    else:
        with output.writable_folder(path) as folder:
            if any(folder.iterdir()):
                raise BadInput(f"--questions = {str(path)!r} is not empty, must be a new folder")
            sheet = Sheet(level, seed)
            n = sheet_files.write_tables(sheet, folder)
    more = f", {len(sheet.questions) - n} left out that CSV cannot hold" if n < len(sheet.questions) else ""
    print(f"{n} questions of level {level} and seed {seed}{more}: {path}")
    print(f"Grade the answers with: mushrooms check --questions {path} --answers FILE")


def grade_file(answers: Path, questions: Path | None, level: str, seed: int | None) -> Run:
    """Grade a file of answers.

    Args:
        answers: the file, or a folder of CSV files.
        questions: what they answer, where the key is beside it; else the fresh questions are proved anew.
        level: of the questions, where nothing else tells.
        seed: likewise; None where the answers tell it.

    Raises:
        BadInput: in one line.
    """
    from conformance.suite import sheet_files
    from conformance.suite.sheet import Sheet, grade_answers, signed

    found = sheet_files.read_answers(answers)
    if questions is not None:
        sheet = sheet_files.read_key(questions)
        if seed not in (None, sheet.seed):
            raise BadInput(f"--seed = {seed}, must be {sheet.seed}, that of the questions")
        return grade_answers(sheet, found)
    told = signed(found.echoes)
    if told is None and seed is None:
        raise BadInput("--answers: give --questions, or the --seed and --level that they were written with")
    level, seed = told if told is not None and seed is None else (level, seed)
    assert seed is not None
    return grade_answers(Sheet(level, check_seed(seed, "--seed")), found)
