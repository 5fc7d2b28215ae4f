"""`mushrooms audit`: conducts the audit with the fast stepper and writes its report."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer
from rich import progress

import fast
from conformance.audit import session
from conformance.audit.claim import AuditSteppers, Claim
from conformance.audit.claims import all_claims, select_claims
from conformance.audit.runs import Size
from conformance.audit.session import AuditResult, AuditSettings
from conformance.files import write_files
from mushrooms import audit_runs, output
from mushrooms.output import locked
from mushrooms.terminal import announce_compilation, progress_bar, refuse_unheeded
from scene.refusal import MAX_SEED, BadInput


def audit(
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the report.")] = Path("audit-report"),
    full: Annotated[bool, typer.Option("--full", help="The paper's sizes; an hour on two cores.")] = False,
    only: Annotated[
        str | None, typer.Option(metavar="IDS", help="Only these claims, separated by commas: X2,L4.")
    ] = None,
    seed: Annotated[
        int, typer.Option(min=0, max=MAX_SEED, help="Seed of the random starts, 0 to 2^64 - 1.")
    ] = 0,
    threads: Annotated[int | None, typer.Option(min=1, help="Threads; all cores by default.")] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue with DIR/runs and DIR/findings.")
    ] = False,
    commands: Annotated[
        bool, typer.Option("--commands", help="Print the runs as simulate commands, one per line, and stop.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    ensemble: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Audit this ensemble: CSV, Parquet or Zarr.")
    ] = None,
    scene: Annotated[str | None, typer.Option(metavar="SCENE", help="Scene of --ensemble.")] = None,
    backwards: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="An ensemble of the reversed cycle, to compare with --ensemble."),
    ] = None,
    energy: Annotated[
        float | None,
        typer.Option(min=0, help="Initial energy: chooses rows, or replaces a missing column E0."),
    ] = None,
    energy_unit: Annotated[str | None, typer.Option(help="Unit of energies: v2/2 (default) or v2.")] = None,
    time_unit: Annotated[
        str | None, typer.Option(help="Unit of times: scene or cycles; default: inferred.")
    ] = None,
    particles: Annotated[
        int | None, typer.Option(help="Number of started particles, if some have no row.")
    ] = None,
) -> None:
    """Check the claims of the paper. Writes report.html, report.json and report.txt.

    Particles are stored in DIR/runs/NAME, like those of simulate --out, and results in DIR/findings. --resume
    continues after an interruption, with --full or with other claims (--only). The report then holds the
    old and the new claims. The runs that --commands prints may be made anywhere; --resume uses them. No run
    is ever replaced.

    --ensemble compares an ensemble of another program with theory at its energy.

    Exit code 0 if every claim has its expected verdict, 1 if one has not, 2 on bad input.
    """
    theirs = {"--scene": scene, "--backwards": backwards, "--energy": energy, "--energy-unit": energy_unit}
    theirs |= {"--time-unit": time_unit, "--particles": particles}
    if ensemble is None:
        refuse_unheeded(theirs, "there is no --ensemble")
        _audit_paper(out, full, only, seed, threads, resume, commands, as_json)
        return
    from mushrooms.audit_ensemble import Options, audit_ensemble

    ours = {"--full": full or None, "--only": only, "--threads": threads, "--resume": resume or None}
    refuse_unheeded({**ours, "--commands": commands or None}, "an --ensemble is audited")
    options = Options(energy, energy_unit or "v2/2", time_unit, particles)
    raise typer.Exit(audit_ensemble(ensemble, scene, backwards, options, out, as_json))


def _audit_paper(
    out: Path,
    full: bool,
    only: str | None,
    seed: int,
    threads: int | None,
    resume: bool,
    commands: bool,
    as_json: bool,
) -> None:
    """Conduct the audit of the paper's claims."""
    from mushrooms.reports import audit_page  # drawing takes a second to import

    if only is not None and not only.replace(",", " ").split():
        raise BadInput(f"--only = {only!r}, must name a claim such as X2; all are checked without it")
    claims = select_claims(only or "")
    size: Size = "full" if full else "quick"
    if commands:
        lines = [audit_runs.command(run, size, seed, out) for run in audit_runs.needed(claims, size)]
        print(json.dumps(lines, indent=2) if as_json else "\n".join(lines))
        return
    with output.writable_folder(out) as folder, locked(folder):
        settings = AuditSettings(size, seed, threads, folder / "findings", resume)
        # What a killed audit was writing: no other process writes under these names, as the folder is held.
        for path in (*folder.glob(".report.*.part"), *folder.glob("findings/.*.finding.*.part")):
            path.unlink(missing_ok=True)
        result = _conduct(folder, settings, claims)
        data = audit_page.to_data(result)
        texts = {
            "report.json": audit_page.to_json(data),
            "report.html": audit_page.to_html(data, result.samples),
            "report.txt": audit_page.to_text(data),
        }
        write_files(folder, texts)
    if as_json:
        print(texts["report.json"], end="")
    else:
        print(texts["report.txt"], end="")
        print(f"Report: {folder / 'report.html'}")
    raise typer.Exit(0 if result.is_passed else 1)


def _conduct(folder: Path, settings: AuditSettings, claims: tuple[Claim, ...]) -> AuditResult:
    """Conduct an audit of the claims, and of those that are taken up, in a folder that is held."""
    if settings.resume:
        wanted = {claim.id for claim in claims} | session.kept(settings)
        claims = tuple(claim for claim in all_claims() if claim.id in wanted)
        _check_report(folder, wanted)
    runs = audit_runs.KeptRuns(folder, settings.resume)
    runs.check(audit_runs.needed(claims, settings.size), settings.seed)
    with announce_compilation(), progress_bar() as bar:
        return session.conduct(
            AuditSteppers(fast.simulate, fast.trajectory, fast.flow),
            settings,
            claims=claims,
            simulate_run=runs.simulate,
            progress=_advance(bar),
        )


def _check_report(folder: Path, wanted: set[str]) -> None:
    """Refuse to replace a report by one that has fewer claims, as other settings would."""
    try:
        report = json.loads((folder / "report.json").read_text("utf-8"))
        there = {finding["id"] for finding in report["findings"]}
    except (OSError, ValueError, KeyError, TypeError):  # there is no report that could be lost
        return
    if there - wanted:
        raise BadInput(
            f"output {str(folder)!r} has a report of {len(there)} claims, size = {report.get('size')!r} and"
            f" seed = {report.get('seed')}; {len(wanted)} are asked for: with --resume none is given up"
        )


def _advance(bar: progress.Progress) -> Callable[[str, int, int], None]:
    tasks: dict[str, progress.TaskID] = {}
    finished = set[str]()

    def advance(run: str, n_done: int, n_total: int) -> None:
        if run not in tasks:
            tasks[run] = bar.add_task(run, total=n_total)
        bar.update(tasks[run], completed=n_done)
        if n_done == n_total and run not in finished and bar.disable:
            finished.add(run)
            print(f"{run}: {n_done:,} particles", file=sys.stderr)

    return advance
