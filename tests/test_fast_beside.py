"""Other processes compile beside a run's own; whatever becomes of them, the run goes on."""

from __future__ import annotations

import subprocess
import sys
import threading

import pytest
from numba import njit
from support.depth import deep_but

import fast
from fast import first_run
from fast.kernel import beside, entries, loops
from fast.kernel.beside import start as really_start
from scene import load


@pytest.fixture
def started(monkeypatch):
    """Start a made-up program, twice, in place of the other processes; return the list of those started."""
    found = []

    def with_program(text):
        def start(into):
            found.extend(subprocess.Popen([sys.executable, "-c", text]) for _ in range(2))
            into.extend(found)

        monkeypatch.setattr(beside, "start", start)
        return found

    return with_program


def on_cores(n, monkeypatch):
    monkeypatch.setattr(beside.os, "sched_getaffinity", lambda _: range(n))


def all_started(*arguments):
    found = []
    really_start(found, *arguments)
    return found


def compiled():
    function = njit(lambda x: x + 1)
    with beside.compiled_beside([function]):
        return function(1)


@pytest.mark.parametrize("text", ["", "raise SystemExit(3)", "import time; time.sleep(0.3)"])
def test_it_is_waited_for_and_its_fate_is_no_matter(started, text):
    processes = started(text)
    assert compiled() == 2
    assert [process.returncode is None for process in processes] == [False, False]


def test_without_others_all_is_as_before(monkeypatch):
    monkeypatch.setattr(beside, "start", lambda _: None)
    assert compiled() == 2


def test_what_is_kept_or_not_meant_starts_nothing(started):
    processes = started("")
    function = njit(lambda x: x + 1)
    assert function(1) == 2
    with beside.compiled_beside([function]):
        assert function(1) == 2
    with beside.compiled_beside([function]):
        assert njit(lambda x: x + 2)(1) == 3
    assert processes == []


def test_the_first_that_is_not_kept_starts_them(started):
    """The careful step may be kept before: whoever asks one question first compiles it."""
    processes = started("")
    kept, missing = njit(lambda x: x + 1), njit(lambda x: x + 2)
    assert kept(1) == 2
    with beside.compiled_beside([kept, missing]):
        kept(1)
        assert processes == []
        missing(1)
    assert len(processes) == 2


def test_one_that_hangs_is_left_behind(started, monkeypatch):
    monkeypatch.setattr(beside, "PATIENCE", 0.1)
    processes = started("import time; time.sleep(600)")
    assert compiled() == 2
    assert {process.returncode for process in processes}.isdisjoint({None, 0})


def test_an_interrupt_while_they_are_started_ends_those_that_are(monkeypatch):
    begun, really = [], subprocess.Popen

    def popen(*_, **__):
        if begun:
            raise KeyboardInterrupt
        begun.append(really([sys.executable, "-c", "import time; time.sleep(600)"]))
        return begun[0]

    on_cores(3, monkeypatch)
    monkeypatch.setattr(beside, "start", really_start)
    monkeypatch.setattr(beside, "_ONCE", threading.Lock())
    monkeypatch.setattr(subprocess, "Popen", popen)
    with pytest.raises(KeyboardInterrupt):
        compiled()
    assert begun[0].returncode not in (None, 0)


def test_an_interrupt_ends_it_too(started):
    processes = started("import time; time.sleep(600)")
    function = njit(lambda x: x + 1)

    def interrupted():
        with beside.compiled_beside([function]):
            function(1)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert {process.returncode for process in processes}.isdisjoint({None, 0})


def test_it_is_told_where_our_modules_are(monkeypatch, tmp_path):
    given = []
    monkeypatch.setattr(subprocess, "Popen", lambda command, **options: given.append((command, options)))
    on_cores(2, monkeypatch)
    monkeypatch.setattr(beside, "_ONCE", threading.Lock())
    monkeypatch.setattr(sys, "path", [*sys.path, tmp_path, str(tmp_path)])  # import passes by what is no text
    all_started("1", "12")
    ((command, options),) = given
    what = [sys.executable, "-P", "-m", "fast.first_run", "1", "12"]
    assert command == [*what, *beside.BY_CORES[2][1]]
    assert options["env"]["PYTHONPATH"].endswith(str(tmp_path))
    assert options["env"][beside.MARK]


@pytest.mark.parametrize(
    "why", ["one core", "another process", "started before", "an application", "no room"]
)
def test_it_is_started_once_and_where_it_is_of_use(why, monkeypatch):
    def refused(*_, **__):
        if why != "no room":
            raise AssertionError(why)
        raise OSError("no room")

    monkeypatch.setattr(subprocess, "Popen", refused)
    on_cores(1 if why == "one core" else 2, monkeypatch)
    monkeypatch.setattr(beside, "_ONCE", threading.Lock())
    if why == "another process":
        monkeypatch.setenv(beside.MARK, "1")
    if why == "started before":
        beside._ONCE.acquire()
    if why == "an application":
        monkeypatch.setattr(sys, "frozen", True, raising=False)
    assert all_started("0", "12") == []


@pytest.mark.parametrize("n_cores", deep_but([2, 3, 64], 2))
def test_the_others_find_what_is_kept_whatever_lies_about(n_cores, tmp_path, monkeypatch):
    fast.simulate(load("moving-cap"), n_particles=1, energy=1e2, seed=1)
    (tmp_path / "fast.py").write_text("raise SystemExit(3)")
    monkeypatch.chdir(tmp_path)
    on_cores(n_cores, monkeypatch)
    monkeypatch.setattr(beside, "_ONCE", threading.Lock())
    assert [process.wait() for process in all_started("0", "12")] == [0] * min(n_cores - 1, 2)


def test_what_it_compiles_is_what_a_run_asks_for(monkeypatch):
    """Else another process would compile for nobody."""
    fast.simulate(load("moving-cap"), n_particles=1, energy=1e2, seed=1)
    asked = []
    monkeypatch.setattr(entries.follow_particles, "compile", asked.append)
    first_run.compile_following()
    assert asked == entries.follow_particles.signatures


@pytest.mark.parametrize("n_cores", beside.BY_CORES)
def test_all_is_compiled_by_somebody(n_cores):
    shared = [name for share in beside.BY_CORES[n_cores] for name in share]
    wanted = ["careful"] if n_cores == 1 else ["follow", *loops.Loops._fields]
    assert sorted(shared) == sorted(wanted)


def test_a_loop_is_compiled_by_its_name_for_the_scenes_it_is_for(monkeypatch):
    asked = []
    monkeypatch.setattr(loops, "address", lambda entry, _: asked.append(entry))
    first_run.main("1", "12", "aim", "fly", "chord", "bounce", "rebound")
    assert asked == [
        loops.AIMS[True],
        loops.FLIES[True, 12],
        loops.CHORDS[12],
        loops.BOUNCES[True],
        loops.rebound_lanes,
    ]
