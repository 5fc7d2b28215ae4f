"""Hypothesis profiles: `quick` (default, reproducible) and `deep`, chosen with HYPOTHESIS_PROFILE.

A failing example of `conformance.strategies` carries a note: the step as the wire's JSON line.
What long comparisons counted is printed after the tests: nothing is skipped silently.
Workers take whole files, the long ones first, and do not compile what another worker is compiling.
"""

import fcntl
import gc
import json
import os
from collections import Counter
from collections.abc import Callable, Generator, Iterator
from typing import Any, NamedTuple

import pytest
from hypothesis import settings
from numba.core.dispatcher import Dispatcher
from support import plain_terminal  # noqa: F401
from support.entries import kept_entries

import fast
from conformance.suite import run as suite
from conformance.vectors import Vector, load
from fast.kernel.numba_internals import cache_folder
from fast.prepared import prepare
from mushrooms.main import run
from scene import Scene

settings.register_profile("quick", max_examples=50, derandomize=True, deadline=None, print_blob=True)
settings.register_profile("deep", max_examples=10_000, deadline=None, print_blob=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "quick"))

# Files that take longest, in the order in which they begin, so that no worker is left alone with one at the
# end. While one worker compiles for test_fast_bits.py, the next ones have nothing to compile.
LONGEST = [
    "test_fast_bits.py",
    "test_fast_faulty_kernels.py",
    "test_theory_prediction.py",
    "test_theory_cycle.py",
    "test_conformance_protocol.py",
    "test_fast_lane_search.py",
    "test_reference_mutants.py",
    "test_mushrooms_store.py",
    "test_mushrooms_audit_ensemble.py",
    "test_conformance_verify.py",
    "test_conformance_cases.py",
    "test_reference_stepper.py",
    "test_mushrooms_audit.py",
    "test_mushrooms_main.py",
    "test_conformance_properties.py",
    "test_conformance_generated.py",
    "test_mushrooms_simulate.py",
    "test_fast_stepper.py",
    "test_fast_lanes.py",
    "test_mushrooms_audit_claims.py",
    "test_theory_simulated.py",
    "test_theory_finite_energy.py",
    "test_hard_cases.py",
    "test_mushrooms_draw.py",
    "test_mushrooms_claim_figures.py",
    "test_mushrooms_figures.py",
    "test_mushrooms_audit_given.py",
    "test_conformance_grading.py",
    "test_mushrooms_check.py",
    "test_theory_upright.py",
    "test_conformance_bench.py",
    "test_conformance_suite.py",
    "test_theory_distribution.py",
    "test_mushrooms_refused.py",
    "test_scene_validity.py",
    "test_docs.py",
    "test_fast_ensemble.py",
    "test_house_files.py",
]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the files that take longest first; the order within a file stays."""
    places = {name: place for place, name in enumerate(LONGEST)}
    items.sort(key=lambda item: places.get(item.path.name, len(places)))


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Look for no garbage in what is imported and collected: nearly all of it stays until the end."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


@pytest.fixture(scope="session", autouse=True)
def _compiled_once() -> None:
    """Let one worker compile an entry of the kernel while the others wait, and then load what it has kept."""

    def one_at_a_time(entry: Dispatcher) -> Callable[[Any], Any]:
        compile_or_load, name = entry.compile, entry.py_func.__qualname__
        folder = cache_folder(entry)
        assert folder is not None
        lock = folder / f"{name}.lock"

        def compile_alone(signature: Any) -> Any:
            lock.parent.mkdir(parents=True, exist_ok=True)
            with lock.open("w") as held:
                fcntl.flock(held, fcntl.LOCK_EX)
                return compile_or_load(signature)

        return compile_alone

    for entry in kept_entries():
        entry.compile = one_at_a_time(entry)


@pytest.fixture(scope="session", autouse=True)
def _few_fresh_questions() -> Iterator[None]:
    """Prove few questions in each run of the suite here; test_conformance_generated.py asks all."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(suite, "N_FRESH", dict.fromkeys(suite.N_FRESH, 3))
        yield


@pytest.fixture(scope="session", autouse=True)
def _two_cores() -> Iterator[None]:
    """Let tests ask for two threads on a machine with one core."""
    n_cores = max(2, os.cpu_count() or 1)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "cpu_count", lambda: n_cores)
        yield


@pytest.fixture(scope="session")
def corpus() -> list[Vector]:
    """Return all vectors."""
    found = load("stress")
    assert len(found) > 2000
    return found


@pytest.fixture
def tally(request: pytest.FixtureRequest) -> Iterator[Counter[str]]:
    """Count what a test looked at; the counts are printed in the terminal summary."""
    counts: Counter[str] = Counter()
    yield counts
    line = f"{request.node.name}: " + ", ".join(f"{name} {n}" for name, n in counts.items())
    if counts:
        request.node.user_properties.append(("tally", line))  # with the report it travels from any worker


@pytest.fixture
def unsynced(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave files to the system's buffers: no test can cut the power, and a busy disk would take minutes."""
    monkeypatch.setattr(os, "fsync", lambda _descriptor: None)


@pytest.fixture
def uncached() -> Iterator[None]:
    """Forget what was made of scenes, for a test that changes how it is made, and what it made afterwards."""
    prepare.cache_clear()
    yield
    prepare.cache_clear()


@pytest.fixture
def followed(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, int, int, int]]:
    """Return the list of what is followed: first particle, how many, after which cycle and up to which."""
    block_ranges, go_on = list[tuple[int, int, int, int]](), fast.go_on

    def noted(scene: Scene, **options: Any) -> Any:
        before = options.get("before")
        n_before = 0 if before is None else before.ensemble.cycle_energies.shape[1]
        block_ranges.append((options.get("first", 0), options["n_particles"], n_before, options["n_cycles"]))
        return go_on(scene, **options)

    monkeypatch.setattr(fast, "go_on", noted)
    return block_ranges


class Ended(NamedTuple):
    """How a command ended: exit code, standard output, standard error."""

    code: object
    out: str
    err: str

    def data(self) -> Any:
        """Return the JSON that a command printed, which must have done what it was asked for."""
        assert self.code == 0, self.err
        return json.loads(self.out)


@pytest.fixture
def command_line(capsys: pytest.CaptureFixture[str]) -> Callable[..., Ended]:
    """Run `mushrooms` with arguments, in this process."""

    def call(*arguments: object) -> Ended:
        with pytest.raises(SystemExit) as stop:
            run([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        return Ended(stop.value.code, captured.out, captured.err)

    return call


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print the tallies."""
    for report in terminalreporter.stats.get("", []):
        for name, line in report.user_properties if report.when == "teardown" else ():
            if name == "tally":
                terminalreporter.write_line(line)
