"""One audit: simulate what the claims need, examine each, keep what is finished.

Every finding is saved in the results' folder; `resume` takes up those that the same sources made
with the same settings. Whether particles are kept is up to the caller, by `simulate_run`.
"""

import hashlib
import json
import time
from collections.abc import Callable, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import fast
import scene
import theory
from mushrooms.audit.claim import (
    AuditSteppers,
    Claim,
    ClaimEvidence,
    Finding,
    Predict,
    from_data,
    to_data,
    verdict_of,
)
from mushrooms.audit.claims import all_claims
from mushrooms.audit.runs import RUNS, Progress, Sample, Simulate, Simulation, Size, draw
from scene.files.writer import sealed, unsealed, write_file
from scene.refusal import check_seed

# Modules of this folder that decide nothing: import-linter holds that none that decides imports
# them.
SHOWING = (
    "command.py",
    "ensemble_command.py",
    "ensemble_table.py",
    "figures.py",
    "options.py",
    "page.py",
)


class AuditSettings(NamedTuple):
    """What an audit is asked for.

    Attributes:
        size: quick or full.
        seed: of all random numbers.
        threads: for the stepper; None for all cores.
        folder: for findings; None to keep none.
        resume: whether what the folder holds may be used.
    """

    size: Size = "quick"
    seed: int = 0
    threads: int | None = None
    folder: Path | None = None
    resume: bool = False


class AuditResult(NamedTuple):
    """What an audit found.

    Attributes:
        settings: as asked.
        claims: examined, in the order of the claims.
        findings: one per claim.
        samples: by run.
        seconds: wall time [s].
    """

    settings: AuditSettings
    claims: tuple[Claim, ...]
    findings: list[Finding]
    samples: dict[str, Sample]
    seconds: float

    @property
    def is_passed(self) -> bool:
        """Tell whether every claim has its expected verdict."""
        pairs = zip(self.claims, self.findings, strict=True)
        return all(finding.verdict == claim.expected for claim, finding in pairs)

    @property
    def n_tests(self) -> int:
        """Return how many comparisons with random data were made."""
        return sum(check.n_tests for finding in self.findings for check in finding.checks)


def conduct(
    steppers: AuditSteppers,
    settings: AuditSettings,
    *,
    claims: Sequence[Claim] | None = None,
    predict: Predict = theory.predict,
    simulate_run: Callable[[str], Simulate] | None = None,
    progress: Progress = lambda *_: None,
) -> AuditResult:
    """Conduct an audit.

    Args:
        steppers: what to simulate with.
        settings: size, seed, threads, folder.
        claims: to be checked, all by default.
        predict: theory, or a wrong one that must be found out.
        simulate_run: what simulates the run of a name, with the signature of `steppers.simulate`,
            which does so by default.
        progress: told of each run's particles.

    Raises:
        BadInput: a setting out of bounds.
    """
    claims = all_claims() if claims is None else claims
    check_seed(settings.seed)
    begin = time.perf_counter()
    if settings.folder:
        settings.folder.mkdir(parents=True, exist_ok=True)
        # Before anything is examined: what is edited meanwhile does not run.
        code()
    known = {claim.id: _kept(claim, settings) for claim in claims}
    found = {
        name: from_data(data["finding"])
        for name, data in known.items()
        if data.get("code") == code()
    }
    samples: dict[str, Sample] = {}
    for run in needed(claims, settings.size):
        samples[run.name] = draw(
            simulate_run(run.name) if simulate_run else steppers.simulate,
            run,
            size=settings.size,
            seed=settings.seed,
            threads=settings.threads,
            progress=partial(progress, run.name, run.n_particles(settings.size)),
        )
    evidence = ClaimEvidence(
        samples,
        steppers,
        size=settings.size,
        seed=settings.seed,
        threads=settings.threads,
        predict=cache(predict),
    )
    for claim in claims:
        if claim.id not in found:
            found[claim.id] = examine(claim, evidence)
        _save(claim, found[claim.id], settings)
    findings = [found[claim.id] for claim in claims]
    return AuditResult(settings, tuple(claims), findings, samples, time.perf_counter() - begin)


def needed(claims: Sequence[Claim], size: Size) -> list[Simulation]:
    """Return the runs of this size that claims rest on, in the order in which they are made."""
    names = dict.fromkeys(name for claim in claims for name in claim.runs)
    return [RUNS[name] for name in names if RUNS[name].n_particles(size)]


def kept(settings: AuditSettings) -> set[str]:
    """Return the ids of the claims whose findings are there.

    What other sources found is found again.
    """
    return {claim.id for claim in all_claims() if _kept(claim, settings)}


def examine(claim: Claim, evidence: ClaimEvidence) -> Finding:
    """Make a claim's checks; with particles lost it cannot be better than open."""
    begin = time.perf_counter()
    checks = list(claim.examine(evidence))
    verdict = verdict_of(claim, checks)
    if verdict != "refuted" and not all(
        sample.is_whole for sample in evidence.samples(*claim.runs)
    ):
        verdict = "indeterminate"
    return Finding(claim.id, verdict, checks, time.perf_counter() - begin)


def _kept(claim: Claim, settings: AuditSettings) -> dict[str, Any]:
    """Return the stored finding of a claim for these settings, from any earlier audit.

    Empty without one.
    """
    content = (
        unsealed(settings.folder / f"{claim.id}.finding")
        if settings.folder and settings.resume
        else None
    )
    data: dict[str, Any] = json.loads(content) if content else {}
    return data if data.get("settings") == [settings.size, settings.seed] else {}


@cache
def code() -> str:
    """Return the SHA-256 of the sources, measured rates among them, that make the findings.

    How findings are shown, and how a caller keeps particles, is no part of it: what is kept is
    looked at when it is taken up.
    """
    digest = hashlib.sha256()
    here = Path(__file__).parent
    shown = [here / name for name in SHOWING]
    for place in (here, *(Path(package.__path__[0]) for package in (scene, fast, theory))):
        for path in sorted(place.rglob("*")):
            is_file = path.is_file()  # an editor's dangling link is none
            if is_file and path.suffix in (".py", ".toml", ".json") and path not in shown:
                content = path.read_bytes()
                digest.update(
                    f"{place.name}/{path.relative_to(place).as_posix()} {len(content)}\n".encode()
                )
                digest.update(content)
    return digest.hexdigest()


def _save(claim: Claim, finding: Finding, settings: AuditSettings) -> None:
    if settings.folder:
        data = {
            "settings": [settings.size, settings.seed],
            "code": code(),
            "finding": to_data(finding),
        }
        write_file(settings.folder / f"{claim.id}.finding", sealed(json.dumps(data).encode()))
