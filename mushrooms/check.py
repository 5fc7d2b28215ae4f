"""`mushrooms check`: the conformance suite on a command, with its progress, summary and report files."""

from __future__ import annotations

import math
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from mushrooms import output
from mushrooms.terminal import progress_bar
from scene.files import write_file
from scene.refusal import BadInput

if TYPE_CHECKING:
    from conformance.suite.run import Run

MAX_SHOWN = 20  # objections on the terminal; all are in the reports
COLOURS = {"pass": "green", "declined": "yellow", "unsupported": "yellow"}


def check(
    command: Annotated[list[str], typer.Argument(metavar="-- COMMAND...", help="Speaks protocol 1.")],
    level: Annotated[str, typer.Option(help="core, extended or stress.")] = "core",
    timeout: Annotated[float, typer.Option(help="Seconds for one answer, compilation included.")] = 120.0,
    restarts: Annotated[int, typer.Option(help="Fresh processes after the first, 0 to 1000.")] = 10,
    groups: Annotated[str, typer.Option(help="Groups of vectors, with commas; all by default.")] = "",
    known_failures: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Ids that must fail, one a line; strict both ways.")
    ] = None,
    json_file: Annotated[Path | None, typer.Option("--json", metavar="FILE", help="JSON report.")] = None,
    junit: Annotated[Path | None, typer.Option(metavar="FILE", help="JUnit XML report.")] = None,
    html: Annotated[Path | None, typer.Option(metavar="FILE", help="HTML report.")] = None,
) -> None:
    """Grade a stepper in any language: a command that speaks protocol 1 on stdin and stdout.

    Exit code 0 when everything passes, 1 when something fails, 2 when the options or the suite are at fault.
    """
    from conformance import suite
    from conformance.suite.session import Limits

    if not (math.isfinite(timeout) and 0 < timeout <= 86_400):
        raise BadInput(f"--timeout = {timeout}, must be > 0 and at most 86400 seconds")
    if not 0 <= restarts <= 1000:
        raise BadInput(f"--restarts = {restarts}, must be 0 to 1000")
    files = {
        path: suffix for path, suffix in ((json_file, ".json"), (junit, ".xml"), (html, ".html")) if path
    }
    for path, suffix in files.items():
        output.check_file(path, (suffix,))
    known = suite.read_known(known_failures) if known_failures else frozenset()
    with progress_bar() as bar:
        task = bar.add_task("cases", total=None)
        run = suite.check(
            command,
            level=level,
            groups=[name.strip() for name in groups.split(",") if name.strip()],
            limits=Limits(timeout, restarts),
            known=known,
            progress=lambda n_done, n_total: bar.update(task, completed=n_done, total=n_total),
        )
    for path, suffix in files.items():
        write_file(path, _content(run, suffix))
    show(run)
    raise typer.Exit(run.exit_code())


def _content(run: Run, suffix: str) -> bytes:
    from conformance.suite import reports
    from mushrooms.reports import check_page

    if suffix == ".json":
        return reports.to_json(run)
    return reports.to_junit(run) if suffix == ".xml" else check_page.to_html(run)


def show(run: Run) -> None:
    """Print verdicts by group, with every denominator, and what stands against success."""
    from conformance.suite import reports
    from conformance.suite.run import VERDICTS

    groups = [*(reports.summarise(run, group) for group in run.groups()), reports.summarise(run)]
    seen = [verdict for verdict in VERDICTS if verdict == "pass" or groups[-1].counts[verdict]]
    table = Table("group", "cases", *seen, "worst ulps", "class", title=_title(run))
    for column in table.columns[1:]:
        column.justify = "right"
    for group in groups:
        cells = [_cell(verdict, group.counts[verdict]) for verdict in seen]
        worst = "inf" if group.worst_ulps is None else f"{group.worst_ulps:.3g}"
        table.add_section() if group is groups[-1] else None
        table.add_row(
            group.group, str(group.cases), *cells, "–" if group.precision == "–" else worst, group.precision
        )
    console = Console(width=None if Console().is_terminal else 140, soft_wrap=True, highlight=False)
    console.print(table)
    if run.speed:
        best = f"{run.speed.best_ns:.4g} ns per collision"
        console.print(
            f"Speed on {run.speed.scene}: {best}, best of {run.speed.repeats} x {run.speed.collisions}."
        )
    for result in run.results:
        if result.group == "profile" and result.verdict == "pass":
            console.print(f"{result.id}: {result.why}.")
    objections = run.objections()
    for line in objections[:MAX_SHOWN]:
        console.print(f"[red]{escape(line)}[/]")
    if len(objections) > MAX_SHOWN:
        console.print(f"... and {len(objections) - MAX_SHOWN} more: --json FILE has them all.")
    console.print(_verdict(run, groups[-1]))


def _title(run: Run) -> str:
    who = run.introduction
    name = f"{who.name} {who.version} ({who.language})" if who else shlex.join(run.command)
    return escape(f"{name}, level {run.level}, corpus {run.corpus}")


def _cell(verdict: str, n: int) -> str:
    return f"[{COLOURS.get(verdict, 'bold red')}]{n}[/]" if n else "[dim]0[/]"


def _verdict(run: Run, total: Any) -> str:
    passed = f"{total.counts['pass']} of {total.cases} cases pass"
    more = f", precision class {total.precision}" if total.precision != "–" else ""
    more += f", {run.n_restarts} restarts" if run.n_restarts else ""
    words = {0: "[bold green]accepted[/]", 1: "[bold red]not accepted[/]"}
    return f"{passed}{more}, {run.seconds:.1f} s: " + words.get(
        run.exit_code(), "[bold red]undecided: the corpus could not tell, which is its own fault[/]"
    )
