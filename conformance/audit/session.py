"""One audit: simulate what the entries need, examine each, keep what is finished.

Entries that need no simulation are examined in another process at the same time. Every finding is saved in
the results' folder; `resume` takes up those that the same sources made with the same settings. Whether
particles are kept is up to who hands in `simulate_run`.
"""

from __future__ import annotations

import hashlib
import json
import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from functools import cache
from multiprocessing import active_children, get_context, parent_process
from pathlib import Path
from threading import Thread
from typing import Any, NamedTuple

import fast
import scene
import theory
from conformance.audit import ledger
from conformance.audit.evidence import AuditSteppers, ClaimEvidence, Predict
from conformance.audit.finding import Entry, Finding, from_data, to_data, verdict_of
from conformance.audit.runs import RUNS, Size
from conformance.audit.samples import Progress, Sample, Simulate, draw
from scene.files import sealed, unsealed, write_file
from scene.refusal import check_seed


class AuditSettings(NamedTuple):
    """What an audit is asked for.

    Attributes:
        size: quick or full.
        seed: of all random numbers.
        threads: for the stepper; None for all cores.
        folder: for findings; None to keep none.
        resume: whether what the folder holds may be used.
        apart: whether entries without simulations are examined in another process.
    """

    size: Size = "quick"
    seed: int = 0
    threads: int | None = None
    folder: Path | None = None
    resume: bool = False
    apart: bool = False


class AuditResult(NamedTuple):
    """What an audit found.

    Attributes:
        settings: as asked.
        entries: examined, in the ledger's order.
        findings: one per entry.
        samples: by run.
        seconds: wall time [s].
    """

    settings: AuditSettings
    entries: tuple[Entry, ...]
    findings: list[Finding]
    samples: dict[str, Sample]
    seconds: float

    @property
    def is_passed(self) -> bool:
        """Tell whether every entry has its expected verdict."""
        pairs = zip(self.entries, self.findings, strict=True)
        return all(finding.verdict == entry.expected for entry, finding in pairs)

    @property
    def n_tests(self) -> int:
        """Return how many comparisons with random data were made."""
        return sum(check.n_tests for finding in self.findings for check in finding.checks)


def conduct(
    steppers: AuditSteppers,
    settings: AuditSettings,
    *,
    entries: Sequence[Entry] | None = None,
    predict: Predict = theory.predict,
    simulate_run: Callable[[str], Simulate] | None = None,
    progress: Progress | None = None,
) -> AuditResult:
    """Conduct an audit.

    Args:
        steppers: what to simulate with.
        settings: size, seed, threads, folder.
        entries: of the ledger, all by default.
        predict: theory, or a wrong one that must be found out.
        simulate_run: what simulates the run of a name, with the signature of `steppers.simulate`, which
            does so by default.
        progress: told of each run's particles.

    Raises:
        BadInput: a setting out of bounds.
    """
    entries = ledger.entries() if entries is None else entries
    check_seed(settings.seed)
    begin = time.perf_counter()
    folder = settings.folder
    if folder:
        folder.mkdir(parents=True, exist_ok=True)
        code()  # before anything is examined: an edit meanwhile is not what runs, and must not be told as it
    found = {e.id: f for e in entries if (f := _load(e, settings)) is not None}
    predict = cache(predict)
    samples: dict[str, Sample] = {}
    with _elsewhere(settings, [e for e in entries if not e.runs and e.id not in found]) as pending:
        for name in dict.fromkeys(run for entry in entries for run in entry.runs):
            if RUNS[name].n_particles(settings.size):
                samples[name] = draw(
                    simulate_run(name) if simulate_run else steppers.simulate,
                    RUNS[name],
                    size=settings.size,
                    seed=settings.seed,
                    threads=settings.threads,
                    progress=progress,
                )
        for entry in entries:
            if entry.id in pending:
                found[entry.id] = pending[entry.id].result()
            elif entry.id not in found:
                found[entry.id] = examine(entry, samples, steppers, settings, predict)
            _save(found[entry.id], settings)
    ordered = [found[entry.id] for entry in entries]
    return AuditResult(settings, tuple(entries), ordered, samples, time.perf_counter() - begin)


def kept(settings: AuditSettings) -> set[str]:
    """Return the ids of the entries whose findings are there; what other sources found is found again."""
    return {entry.id for entry in ledger.entries() if _kept(entry, settings)}


def examine(
    entry: Entry,
    samples: dict[str, Sample],
    steppers: AuditSteppers,
    settings: AuditSettings,
    predict: Predict,
) -> Finding:
    """Make an entry's checks; with particles lost it cannot be better than open."""
    begin = time.perf_counter()
    evidence = ClaimEvidence(
        samples, steppers, size=settings.size, seed=settings.seed, threads=settings.threads, predict=predict
    )
    checks = list(entry.examine(evidence))
    verdict = verdict_of(entry, checks)
    if verdict != "refuted" and not all(samples[run].is_whole for run in entry.runs if run in samples):
        verdict = "indeterminate"
    return Finding(entry.id, verdict, checks, time.perf_counter() - begin)


def _examine_apart(entry_id: str, settings: AuditSettings) -> Finding:
    import fast

    entry = ledger.select(entry_id)[0]
    return examine(
        entry, {}, AuditSteppers(fast.simulate, fast.trajectory, fast.flow), settings, cache(theory.predict)
    )


@contextmanager
def _elsewhere(settings: AuditSettings, entries: list[Entry]) -> Iterator[dict[str, Future[Finding]]]:
    if not (settings.apart and entries):
        yield {}
        return
    others = active_children()
    pool = ProcessPoolExecutor(1, mp_context=get_context("spawn"), initializer=_end_with_parent)
    try:
        yield {entry.id: pool.submit(_examine_apart, entry.id, settings) for entry in entries}
    except KeyboardInterrupt:
        # Ctrl-C in a terminal reaches it too, a batch system's signal does not: a claim can take minutes.
        for process in set(active_children()) - set(others):
            process.terminate()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def _end_with_parent() -> None:
    """Let this process end when the audit's has: one that was killed calls nobody off."""
    parent = parent_process()
    assert parent is not None

    def watch() -> None:
        parent.join()
        os._exit(1)

    Thread(target=watch, daemon=True).start()


def _key(entry: Entry, settings: AuditSettings) -> str:
    runs = [(run, RUNS[run].n_particles(settings.size)) for run in entry.runs]
    return json.dumps(
        [entry.id, entry.statement, entry.method, entry.tolerance, settings.size, settings.seed, runs]
    )


def _load(entry: Entry, settings: AuditSettings) -> Finding | None:
    data = _kept(entry, settings)
    return from_data(data["finding"]) if data and data.get("code") == code() else None


def _kept(entry: Entry, settings: AuditSettings) -> dict[str, Any]:
    """Return what is kept of an entry for these settings, whoever made it; nothing where there is none."""
    content = unsealed(settings.folder / _file(entry)) if settings.folder and settings.resume else None
    data: dict[str, Any] = json.loads(content) if content else {}
    return data if data.get("key") == _key(entry, settings) else {}


@cache
def code() -> str:
    """Return the SHA-256 of the sources that findings owe their numbers to, measured rates among them.

    How a caller keeps particles is no part of it: what is kept is looked at when it is taken up.
    """
    digest = hashlib.sha256()
    for place in (Path(__file__).parent, *(Path(package.__path__[0]) for package in (scene, fast, theory))):
        for path in sorted(place.rglob("*")):
            if path.suffix in (".py", ".toml", ".json") and path.is_file():  # not an editor's dangling link
                content = path.read_bytes()
                digest.update(f"{place.name}/{path.relative_to(place).as_posix()} {len(content)}\n".encode())
                digest.update(content)
    return digest.hexdigest()


def _file(entry: Entry) -> str:
    return f"{entry.id}.finding"


def _save(finding: Finding, settings: AuditSettings) -> None:
    if settings.folder:
        entry = ledger.select(finding.id)[0]
        content = json.dumps({"key": _key(entry, settings), "code": code(), "finding": to_data(finding)})
        write_file(settings.folder / _file(entry), sealed(content.encode()))
