"""What `simulate` says of time on stderr: compilation, the forecast of a long run, and careful steps."""

from __future__ import annotations

import importlib.util
import json

import numpy as np
import pytest
from support.refusals import assert_refused

import fast
from conformance.audit import session
from mushrooms import attack, bench, forecast, orbits
from mushrooms.terminal import compilation_told
from scene import load

RUN = ["simulate", "moving-cap", "--particles", 60, "--energy", 1e4, "--seed", 7, "--threads", 1, "--json"]
KEPT = """\
from numba import njit

@njit(cache=True)
def follow_particles(n):
    return n + 1
"""


@pytest.fixture
def fresh(tmp_path):
    """Return what makes a compiled function anew, as a new process does; what is compiled is kept on disk."""
    path = tmp_path / "kept.py"
    path.write_text(KEPT)

    def make():
        spec = importlib.util.spec_from_file_location("kept", path)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module.follow_particles

    return make


def test_compilation_is_told_when_nothing_is_kept_and_only_then(fresh, capsys):
    told = []
    for _ in range(2):  # the second finds what the first has kept
        entry = fresh()
        with compilation_told():
            assert entry(1) == entry(1) == 2
        told.append(capsys.readouterr().err)
    assert told[0].count("\n") == 1
    assert "this machine: about half a minute; kept for next time" in told[0]
    assert told[1] == ""
    entry(1.5)  # another type of argument: compiled, but nobody is told outside
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("command", "owner", "name"),
    [
        (RUN, fast, "go_on"),
        (["audit", "--out"], session, "conduct"),
        (["bench", "--quick", "--out"], bench, "_measured"),
        (["attack", "--cases", 1, "--json"], attack, "steppers"),
        (["draw", "ergodic", "--trajectory"], orbits, "follow"),
    ],
)
def test_commands_that_compile_say_so(command_line, fresh, monkeypatch, tmp_path, command, owner, name):
    def compiles(*_args, **_options):
        fresh()(1)
        raise KeyboardInterrupt

    monkeypatch.setattr(owner, name, compiles)
    out = [tmp_path / "out.json"] if command[-1] in ("--out", "--json") and command is not RUN else []
    code, _, err = command_line(*command, *out)
    assert code == 130
    assert err.count("compiling the fast stepper") == 1


@pytest.mark.parametrize(
    ("name", "energy", "n_particles", "n_cycles"),
    [
        ("moving-cap", 1e5, 400, 1),
        ("moving-cap", 1e4, 100, 5),
        ("fermi-ulam", 1e4, 500, 3),
        ("ergodic", 1e5, 300, 2),
    ],
)
def test_a_forecast_comes_true(monkeypatch, name, energy, n_particles, n_cycles):
    """Collisions within a fifth; and seconds that follow from what a pilot's collisions take."""
    monkeypatch.setattr(forecast, "LONG", 0.0)
    monkeypatch.setattr(forecast, "flights", lambda *_: (10**6, 0.25))
    scene = load(name)
    asked = {"n_particles": n_particles, "energy": energy, "n_cycles": n_cycles, "seed": 1, "threads": 1}
    ahead = forecast.forecast(scene, **asked)
    assert 0.8 < ahead.collisions / fast.simulate(scene, **asked).n_collisions.sum() < 1.25
    assert ahead.seconds == pytest.approx(ahead.collisions * 2.5e-7)


def test_a_long_run_begins_with_a_forecast(command_line, monkeypatch):
    begun = []

    def broken_off(*_args, progress, **_options):
        progress(0)
        begun.append(True)
        raise KeyboardInterrupt

    fast.simulate(load("moving-cap"), n_particles=1, energy=10.0)  # compiled
    monkeypatch.setattr(fast, "go_on", broken_off)
    monkeypatch.setattr(forecast, "flights", lambda *_: (10**6, 0.04))  # 40 ns a collision on any machine
    run = ["simulate", "moving-cap", "--energy", 1e7, "--threads", 1, "--particles"]
    code, _, err = command_line(*run, 10**7)
    assert (code, err.count("\n"), begun) == (130, 2, [True])
    assert err.endswith("interrupted; nothing is kept without --out\n")
    assert "about 4.1e+11 collisions ahead: some 4.5 hours on 1 thread" in err
    assert "ahead" not in command_line(*run, 1000).err  # two seconds


def test_a_forecast_changes_no_bit_of_the_run(command_line, monkeypatch):
    plain = command_line(*RUN)
    monkeypatch.setattr(forecast, "LONG", 1e-9)
    told = command_line(*RUN)
    assert " collisions ahead: " in told.err
    assert json.loads(told.out)["sha256"] == json.loads(plain.out)["sha256"]


def test_a_refused_run_has_no_forecast(command_line):
    assert_refused(command_line("simulate", "moving-cap", "--particles", 10**6, "--energy", 1e30))


@pytest.mark.parametrize(
    ("seconds", "per_thousand", "said"),
    [(5.0, 3, "0.003 of the collisions, some 13% of the time"), (5.0, 2, ""), (0.5, 3, "")],
)
def test_careful_steps_are_told_of_where_they_took_the_time(
    command_line, monkeypatch, seconds, per_thousand, said
):
    paused = fast.go_on(load("moving-cap"), n_particles=40, energy=1e4, threads=1)
    n_careful = np.array([paused.ensemble.n_collisions.sum() * per_thousand // 1000])
    run = paused.ensemble._replace(seconds=seconds, n_careful=n_careful)
    monkeypatch.setattr(fast, "go_on", lambda *_args, **_options: paused._replace(ensemble=run))
    code, out, err = command_line(*RUN)
    assert (code, json.loads(out)["careful"]) == (0, run.n_careful.sum())
    assert (said in err) if said else err == ""
