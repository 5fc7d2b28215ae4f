"""`mushrooms audit`: conducts the audit with the fast stepper and writes its report.

DIR/runs/NAME is what `mushrooms simulate --out` makes, here or elsewhere.
"""

import json
import os
from collections.abc import Callable, Sequence
from functools import cache, partial
from pathlib import Path

import fast
from fast.ensemble import SHARE
from mushrooms.audit import session
from mushrooms.audit.claim import AuditSteppers, Claim
from mushrooms.audit.claims import all_claims, select_claims
from mushrooms.audit.ensemble_command import audit_ensemble
from mushrooms.audit.options import AuditOptions
from mushrooms.audit.page import to_data, to_html, to_json, to_text
from mushrooms.audit.runs import Simulation, Size, run_seed, scene_of
from mushrooms.audit.session import AuditResult, AuditSettings, needed
from mushrooms.folders import locked, writable_folder
from mushrooms.output import write_report
from mushrooms.progress import Watch, announce_compilation, progress_bar
from mushrooms.store import conduct
from mushrooms.store.run import is_run
from mushrooms.store.spec import RunSpec
from scene import BadInput, Scene
from scene.files.writer import named
from scene.refusal import refuse_unheeded


def audit_claims(options: AuditOptions) -> int:
    """Check the paper's claims, or an ensemble of another program; return the exit code."""
    if options.ensemble is None:
        refuse_unheeded(
            {
                "--scene": options.scene,
                "--backwards": options.backwards,
                "--energy": options.energy,
                "--energy-unit": options.energy_unit,
                "--time-unit": options.time_unit,
                "--particles": options.particles,
            },
            "there is no --ensemble",
        )
        return _audit_paper(options)
    refuse_unheeded(
        {
            "--full": options.full or None,
            "--only": options.only,
            "--threads": options.threads,
            "--resume": options.resume or None,
            "--commands": options.commands or None,
        },
        "an --ensemble is audited",
    )
    return audit_ensemble(options.ensemble, options)


def _audit_paper(options: AuditOptions) -> int:
    """Conduct the audit of the paper's claims."""
    only = options.only
    if only is not None and not only.replace(",", " ").split():
        raise BadInput(
            f"--only = {only!r}, must name a claim such as X2; all are checked without it"
        )
    claims = select_claims(only or "")
    size: Size = "full" if options.full else "quick"
    if options.commands:
        lines = [command(run, size, options.seed, options.out) for run in needed(claims, size)]
        print(json.dumps(lines, indent=2) if options.as_json else "\n".join(lines))
        return 0
    with writable_folder(options.out) as folder, locked(folder):
        findings = folder / "findings"
        settings = AuditSettings(size, options.seed, options.threads, findings, options.resume)
        # What a killed audit was writing: no other process writes under these names, as the folder
        # is held.
        for path in (*folder.glob(".report.*.part"), *folder.glob("findings/.*.finding.*.part")):
            path.unlink(missing_ok=True)
        result = _conduct(folder, settings, claims)
        data = to_data(result)
        page = to_html(data, result.samples)
        write_report(folder, to_json(data), to_text(data), page, options.as_json)
    return 0 if result.is_passed else 1


def _conduct(folder: Path, settings: AuditSettings, claims: tuple[Claim, ...]) -> AuditResult:
    """Conduct an audit of the claims, and of those that are taken up, in a folder that is held."""
    if settings.resume:
        wanted = {claim.id for claim in claims} | session.kept(settings)
        claims = tuple(claim for claim in all_claims() if claim.id in wanted)
        _check_report(folder, wanted)
    check_runs(folder, needed(claims, settings.size), settings.seed, settings.resume)
    try:
        with announce_compilation(), progress_bar() as bar:
            watch_of = cache(partial(Watch, bar, unit="particles"))
            return session.conduct(
                AuditSteppers(fast.simulate, fast.trajectory, fast.flow),
                settings,
                claims=claims,
                simulate_run=lambda name: partial(
                    follow_run, folder / FOLDER / name, settings.resume
                ),
                progress=lambda run, n_total, n_done: watch_of(run).update(n_done, n_total),
            )
    except (KeyboardInterrupt, OSError) as error:
        error.add_note(
            "finished parts are in the folder of the report: --resume continues the audit"
        )
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
            f"output {str(folder)!r} has a report of {len(there)} claims, size ="
            f" {report.get('size')!r} and seed = {report.get('seed')}; {len(wanted)} are asked for:"
            " with --resume none is given up"
        )


FOLDER = "runs"


def spec_of(run: Simulation, seed: int) -> RunSpec:
    """Return what decides the bits of a run in the audit of a seed."""
    return RunSpec(scene_of(run), run.energy, run.n_cycles, run_seed(seed, run), run.phases)


def command(run: Simulation, size: Size, seed: int, folder: Path) -> str:
    """Return the command that makes a run where an audit with --resume takes it up."""
    return spec_of(run, seed).command(run.scene, run.n_particles(size), folder / FOLDER / run.name)


def check_runs(folder: Path, runs: Sequence[Simulation], seed: int, resume: bool) -> None:
    """Refuse at once what would be refused when its turn has come.

    Args:
        folder: of the audit, held by the caller.
        runs: that are to be followed there.
        seed: of the audit.
        resume: whether runs that are there may be gone on with.

    Raises:
        BadInput: the folder of one of these runs holds another, or this one and `resume` was not
            asked for, or another process writes in it.
    """
    for run in runs:
        place = folder / FOLDER / run.name
        if is_run(place):
            with locked(place):
                conduct.read_description(place, spec_of(run, seed), {})
            if not resume:
                how = "--resume takes it up, another --out begins anew"
                raise BadInput(f"output {str(place)!r} holds a run of this audit: {how}")


def follow_run(
    place: Path,
    resume: bool,
    scene: Scene,
    *,
    n_particles: int,
    energy: float,
    n_cycles: int,
    seed: int,
    threads: int | None,
    phases: tuple[float, ...],
    progress: Callable[[int], None],
) -> fast.Ensemble:
    """Return what `fast.simulate` would, and follow only what the run's folder lacks."""
    spec = RunSpec(scene, energy, n_cycles, seed, phases)
    default = block_size(spec, n_particles, threads or os.cpu_count() or 1)
    with writable_folder(place), locked(place), named(place):
        run = conduct.open_or_create(
            place, spec, n_particles, None, default, scene.name, resume, at_least=True
        )
        engine = partial(conduct.in_process, threads=threads)
        conduct.complete(run, engine, progress, n_particles=n_particles)
        return run.ensemble(n_particles)


def block_size(spec: RunSpec, n_particles: int, threads: int) -> int:
    """Return how many particles of a new run are kept at a time, at most all of them.

    At the end of a block the lanes wait for its slowest particle. Energies spread with the cycles,
    so that what takes seconds has too few particles to wait for: each thread has a share of `fast`,
    at the least.
    """
    wanted = max(conduct.block_size(spec, threads), SHARE * threads) * spec.n_cycles
    return min(wanted, conduct.MOST_BLOCK, n_particles)
