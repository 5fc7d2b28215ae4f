"""`mushrooms check`: the conformance suite on a command, its progress, summary and report files."""

import secrets
import shlex
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Column, Table

from conformance import vectors
from conformance.suite import VERDICTS, Run, check, read_known, reports
from conformance.suite.run import NEW_SEEDS, choose
from conformance.suite.session import Limits
from conformance.suite.sheet import (
    Sheet,
    grade_answers,
    read_answers,
    read_key,
    signed,
    write_lines,
    write_tables,
)
from mushrooms.folders import check_file, writable_folder
from mushrooms.output import new_console, print_table
from mushrooms.progress import Watch, progress_bar
from scene import BadInput
from scene.files.writer import write_file
from scene.refusal import refuse_unheeded

MAX_SHOWN = 20  # objections on the terminal; all are in the reports
MAX_TAUGHT = 5  # of them with what was given and what is certified, or with what was sent
MAX_SENT = 500  # characters of that, and of a line of standard error
MAX_ERRORS = 6  # lines of that
COLOURS = {"pass": "green", "declined": "yellow", "unsupported": "yellow"}


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckOptions:
    """The options of `mushrooms check`.

    Attributes:
        command: program and arguments of the stepper.
        level: core, extended or stress.
        seed: of the questions; None for a new one.
        timeout, total: seconds for one answer, and for the whole run; None for no limit.
        restarts: fresh processes after the first.
        groups: names separated by commas; empty for all.
        known_failures: file of the cases that may fail.
        json_file, junit, html, badge, summary: files for reports.
        questions: file or folder of questions, to be written, or that were answered.
        answers: file or folder to be graded.
        corpus: the version that it must be; None for any.
    """

    command: Sequence[str] | None
    level: str
    seed: int | None
    timeout: float
    total: float | None
    restarts: int
    groups: str
    known_failures: Path | None
    json_file: Path | None
    junit: Path | None
    html: Path | None
    badge: Path | None
    summary: Path | None
    questions: Path | None
    answers: Path | None
    corpus: str | None


def check_stepper(options: CheckOptions) -> int:
    """Grade a stepper or a file of answers, or write a file of questions; return the exit code."""
    require_corpus(options.corpus)
    files = _report_files(options)
    if options.questions or options.answers:
        refuse_unheeded(
            {
                "COMMAND": options.command or None,
                "--groups": options.groups or None,
                "--known-failures": options.known_failures,
            },
            "questions and answers are in files",
        )
    if options.answers:
        run = grade_file(options.answers, options.questions, options.level, options.seed)
    elif options.questions:
        refuse_unheeded({str(path): True for path in files}, "nothing is graded yet")
        write_questions(options.questions, options.level, options.seed)
        return 0
    else:
        run = _hold_dialogue(options)
    for path, content in files.items():
        write_file(path, content(run))
    show(run)
    return run.exit_code()


def _hold_dialogue(options: CheckOptions) -> Run:
    """Ask a running stepper."""
    names = _names_of(options.groups)
    known = read_known(options.known_failures) if options.known_failures else frozenset()
    with progress_bar() as bar:
        return check(
            options.command or [],
            level=options.level,
            seed=options.seed,
            groups=names,
            limits=Limits(options.timeout, options.restarts, options.total),
            known=known,
            progress=Watch(bar, "check", "cases").update,
        )


def require_corpus(version: str | None) -> None:
    """Refuse a run with another corpus than the one asked for; None for any.

    Raises:
        BadInput: naming the version that is here, and those that exist.
    """
    here = vectors.manifest().corpus
    if version is not None and version != here:
        known = ", ".join(vectors.VERSIONS)
        why = "is that of an earlier release" if version in vectors.VERSIONS else "does not exist"
        raise BadInput(f"corpus = {version!r} {why}, must be {here}; there are {known}")


def _names_of(groups: str) -> list[str]:
    names = [name.strip() for name in groups.split(",") if name.strip()]
    if groups and not names:
        raise BadInput(f"--groups = {groups!r}, must name a group; all are asked without it")
    return names


def to_html(run: Run) -> str:
    """Return the HTML report."""
    from mushrooms.reports import check_page  # drawing takes a second to import

    return check_page.to_html(run)


# The ending and the content of each report file, by its field of `CheckOptions`.
WRITERS: dict[str, tuple[str, Callable[[Run], bytes | str]]] = {
    "json_file": (".json", reports.to_json),
    "junit": (".xml", reports.to_junit),
    "html": (".html", to_html),
    "badge": (".svg", reports.to_badge),
    "summary": (".json", reports.to_summary),
}


def _report_files(options: CheckOptions) -> dict[Path, Callable[[Run], bytes | str]]:
    """Return the report files that are asked for, each with what makes its content."""
    files: dict[Path, Callable[[Run], bytes | str]] = {}
    for name, (suffix, content) in WRITERS.items():
        path: Path | None = getattr(options, name)
        if path is not None:
            check_file(path, (suffix,))
            if path in files:
                raise BadInput(
                    f"output {str(path)!r} is asked for twice, must be a file for each report"
                )
            files[path] = content
    return files


def show(run: Run) -> None:
    """Print verdicts by group, with every denominator, and what stands against success."""
    groups = [*(reports.summarise(run, group) for group in run.groups()), reports.summarise(run)]
    seen = [verdict for verdict in VERDICTS if verdict == "pass" or groups[-1].counts[verdict]]
    verdicts = [
        Column(verdict, style=COLOURS.get(verdict, "bold red"), justify="right") for verdict in seen
    ]
    numbers = [Column(name, justify="right") for name in ("worst ulps", "A/B/C", "class")]
    heads = [Column("group", no_wrap=True), Column("cases", justify="right"), *verdicts, *numbers]
    table = Table(*heads, title=_title(run))
    for group in groups:
        counts = [str(group.counts[verdict]) for verdict in seen]
        graded = ["–", "–"]
        if group.precision != "–":
            worst = "inf" if group.worst_ulps is None else f"{group.worst_ulps:.3g}"
            graded = [worst, "/".join(map(str, group.classes.values()))]
        row = [group.group, str(group.cases), *counts, *graded, group.precision]
        table.add_row(*row, end_section=group is groups[-2])
    console = new_console(soft_wrap=True)
    print_table(console, table)
    _show_measured(console, run)
    _show_objections(console, run)
    console.print(_verdict(run, groups[-1]))
    colour = "green" if run.exit_code() == 0 else "red"
    console.print(f"[bold {colour}]{run.verdict()}[/]: {escape(str(run.scope()))}")


def _show_measured(console: Console, run: Run) -> None:
    """Print the speed, and what the statistics found."""
    if run.speed:
        console.print(
            f"Speed on {run.speed.scene}: {run.speed.best_ns:.4g} ns per collision,"
            f" best of {run.speed.repeats} x {run.speed.collisions}."
        )
    for result in run.results:
        if result.group == "profile" and result.verdict == "pass":
            console.print(f"{result.id}: {result.why}.")


def _show_objections(console: Console, run: Run) -> None:
    """Print why the run does not succeed.

    What was given stands beside what is certified; what fails alike is named.
    """
    objections = run.objections()
    for line in objections[:MAX_SHOWN]:
        console.print(f"[red]{escape(line)}[/]")
    if len(objections) > MAX_SHOWN:
        console.print(f"... and {len(objections) - MAX_SHOWN} more: --json FILE has them all.")
    _show_stderr(console, run)
    wrong = [result for result in run.results if not result.is_right and not result.is_known]
    for result in [result for result in wrong if result.expected][:MAX_TAUGHT]:
        again = f"mushrooms ask {result.id} --seed {run.seed}"
        console.print(f"{result.id}, asked {escape(result.asked)}; {again} prints it")
        console.print(f"  given     {escape(format_outcome(result.given))}")
        console.print(f"  certified {escape(format_outcome(result.expected))}")
    for result in [result for result in wrong if result.paste][:MAX_TAUGHT]:
        head = f"{result.id} as a test, where implementation is {run.command}:"
        console.print(head, markup=False, soft_wrap=True)
        console.print(result.paste, markup=False, soft_wrap=True)
    of_protocol = [result for result in wrong if result.group == "protocol"]
    for result in [result for result in of_protocol if result.sent][:MAX_TAUGHT]:
        rest = "... (--json FILE has it whole)" if len(result.sent) > MAX_SENT else ""
        console.print(f"{result.id}, sent last: {escape(result.sent[:MAX_SENT])}{rest}")
    for line in run.diagnosis:
        console.print(f"[yellow]{escape(line)}[/]")


def _show_stderr(console: Console, run: Run) -> None:
    """Print how the standard error ends if a process crashed or broke the protocol."""
    wrong = [result for result in run.results if not result.is_right]
    is_broken = any(result.verdict == "crashed" or result.group == "protocol" for result in wrong)
    lines = run.stderr.split("\n")
    if is_broken and any(lines):
        console.print("Its standard error ends:")
        for line in [line for line in lines if line.strip()][-MAX_ERRORS:]:
            console.print(f"  {escape(line[:MAX_SENT])}")


def format_outcome(outcome: dict[str, Any] | None) -> str:
    """Return an outcome's fields on a line."""
    if outcome is None:
        return "nothing"
    return " ".join(
        f"{name}={value!r}" if name != "outcome" else str(value) for name, value in outcome.items()
    )


def _title(run: Run) -> str:
    known = run.introduction
    name = f"{known.name} {known.version} ({known.language})" if known else shlex.join(run.command)
    return escape(f"{name}, level {run.level}, corpus {run.corpus}")


def _verdict(run: Run, total: Any) -> str:
    passed = f"{total.counts['pass']} of {total.cases} cases pass"
    restarts = f", {run.n_restarts} restarts" if run.n_restarts else ""
    doubt = ": the suite itself is at fault" if run.exit_code() == 2 else ""
    return f"{passed}{restarts}, {run.seconds:.1f} s{doubt}."


def write_questions(path: Path, level: str, seed: int | None) -> None:
    """Write the questions of a run: as JSON lines into a .jsonl file, or else as CSV into a folder.

    Raises:
        BadInput: the level, the seed or the path is none; nothing is written then.
    """
    choose(level)
    seed = secrets.randbelow(NEW_SEEDS) if seed is None else seed
    if path.suffix == ".jsonl":
        check_file(path, (".jsonl",))
        sheet = _draw_sheet(level, seed)
        n = write_lines(sheet, path)
    elif path.suffix:
        raise BadInput(f"--questions = {str(path)!r}, must end in .jsonl, or be a folder for CSV")
    else:
        with writable_folder(path) as folder:
            if any(folder.iterdir()):
                raise BadInput(f"--questions = {str(path)!r} is not empty, must be a new folder")
            sheet = _draw_sheet(level, seed)
            n = write_tables(sheet, folder)
    more = (
        f", {len(sheet.questions) - n} left out that CSV cannot hold"
        if n < len(sheet.questions)
        else ""
    )
    print(f"{n} questions of level {level} and seed {seed}{more}: {path}")
    print(f"Grade the answers with: mushrooms check --questions {path} --answers FILE")


def _draw_sheet(level: str, seed: int) -> Sheet:
    """Return the questions of a run, and say that they take a while: many are proved anew."""
    print(
        f"drawing and proving the questions of seed {seed}: some 20 seconds",
        file=sys.stderr,
        flush=True,
    )
    return Sheet(level, seed)


def grade_file(answers: Path, questions: Path | None, level: str, seed: int | None) -> Run:
    """Grade a file of answers.

    Args:
        answers: the file, or a folder of CSV files.
        questions: what they answer, where the key is beside it; else the fresh questions are proved
            anew.
        level: of the questions, where nothing else tells.
        seed: likewise; None where the answers tell it.

    Raises:
        BadInput: in one line.
    """
    found = read_answers(answers)
    if questions is not None:
        sheet = read_key(questions)
        if seed not in (None, sheet.seed):
            raise BadInput(f"--seed = {seed}, must be {sheet.seed}, that of the questions")
        return grade_answers(sheet, found)
    written_with = signed(found.echoes) if seed is None else (level, seed)
    if written_with is None:
        raise BadInput(
            "--answers: give --questions, or the --seed and --level that they were written with"
        )
    return grade_answers(Sheet(*written_with), found)
