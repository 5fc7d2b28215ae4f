"""`mushrooms audit`: conducts the audit with the fast stepper and writes its report."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path

from rich import progress

import fast
from conformance.audit import session
from conformance.audit.claim import AuditSteppers, Claim
from conformance.audit.claims import all_claims, select_claims
from conformance.audit.runs import Size
from conformance.audit.session import AuditResult, AuditSettings
from conformance.files import write_files
from mushrooms import audit_runs, output
from mushrooms.audit_ensemble import Options, audit_ensemble
from mushrooms.output import locked
from mushrooms.reports import audit_page
from mushrooms.terminal import announce_compilation, progress_bar, refuse_unheeded
from scene.refusal import BadInput


def audit_claims(
    out: Path,
    full: bool,
    only: str | None,
    seed: int,
    threads: int | None,
    resume: bool,
    commands: bool,
    as_json: bool,
    ensemble: Path | None,
    scene: str | None,
    backwards: Path | None,
    energy: float | None,
    energy_unit: str | None,
    time_unit: str | None,
    particles: int | None,
) -> int:
    """Check the paper's claims, or an ensemble of another program; return the exit code."""
    of_ensemble = {"--scene": scene, "--backwards": backwards, "--energy": energy}
    of_ensemble |= {"--energy-unit": energy_unit, "--time-unit": time_unit, "--particles": particles}
    if ensemble is None:
        refuse_unheeded(of_ensemble, "there is no --ensemble")
        return _audit_paper(out, full, only, seed, threads, resume, commands, as_json)
    of_paper = {"--full": full or None, "--only": only, "--threads": threads}
    of_paper |= {"--resume": resume or None, "--commands": commands or None}
    refuse_unheeded(of_paper, "an --ensemble is audited")
    options = Options(energy, energy_unit or "v2/2", time_unit, particles)
    return audit_ensemble(ensemble, scene, backwards, options, out, as_json)


def _audit_paper(
    out: Path,
    full: bool,
    only: str | None,
    seed: int,
    threads: int | None,
    resume: bool,
    commands: bool,
    as_json: bool,
) -> int:
    """Conduct the audit of the paper's claims."""
    if only is not None and not only.replace(",", " ").split():
        raise BadInput(f"--only = {only!r}, must name a claim such as X2; all are checked without it")
    claims = select_claims(only or "")
    size: Size = "full" if full else "quick"
    if commands:
        lines = [audit_runs.command(run, size, seed, out) for run in audit_runs.needed(claims, size)]
        print(json.dumps(lines, indent=2) if as_json else "\n".join(lines))
        return 0
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
    return 0 if result.is_passed else 1


def _conduct(folder: Path, settings: AuditSettings, claims: tuple[Claim, ...]) -> AuditResult:
    """Conduct an audit of the claims, and of those that are taken up, in a folder that is held."""
    if settings.resume:
        wanted = {claim.id for claim in claims} | session.kept(settings)
        claims = tuple(claim for claim in all_claims() if claim.id in wanted)
        _check_report(folder, wanted)
    runs = audit_runs.KeptRuns(folder, settings.resume)
    runs.check(audit_runs.needed(claims, settings.size), settings.seed)
    try:
        with announce_compilation(), progress_bar() as bar:
            return session.conduct(
                AuditSteppers(fast.simulate, fast.trajectory, fast.flow),
                settings,
                claims=claims,
                simulate_run=runs.simulate,
                progress=_advance(bar),
            )
    except KeyboardInterrupt as error:
        error.add_note("finished parts are in the folder of the report: --resume continues the audit")
        raise


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
