"""What `simulate` says of time: compilation, collisions to expect, and careful steps."""

from __future__ import annotations

import importlib.util
import json

import numpy as np
import pytest

import fast
from conformance.audit import session
from mushrooms import attack, bench, orbits
from mushrooms.forecast import expected_collisions
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
        (RUN, fast, "simulate"),
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
    ("name", "energy", "n_cycles"),
    [("moving-cap", 1e5, 1), ("moving-cap", 1e4, 5), ("fermi-ulam", 1e4, 3), ("ergodic", 1e5, 2)],
)
def test_expected_collisions_are_within_a_fifth(name, energy, n_cycles):
    scene = load(name)
    found = fast.simulate(scene, n_particles=200, energy=energy, n_cycles=n_cycles, seed=1)
    assert 0.8 < expected_collisions(scene, energy, n_cycles) / found.n_collisions.mean() < 1.25


def test_the_mean_time_between_collisions_is_that_of_the_table(command_line):
    """A particle in an area A with walls of length P meets them every pi A / (P v); here nothing moves."""
    run = ["simulate", "frozen-mushroom", "--particles", 400, "--energy", 1e4, "--seed", 1, "--json"]
    found = json.loads(command_line(*run).out)
    wanted = 1 / expected_collisions(load("frozen-mushroom"), 1e4, 1)
    assert found["collision_time"] == pytest.approx(wanted, rel=0.03)


@pytest.mark.parametrize(
    ("seconds", "per_thousand", "said"),
    [(5.0, 3, "0.003 of the collisions, some 13% of the time"), (5.0, 2, ""), (0.5, 3, "")],
)
def test_careful_steps_are_told_of_where_they_took_the_time(
    command_line, monkeypatch, seconds, per_thousand, said
):
    run = fast.simulate(load("moving-cap"), n_particles=40, energy=1e4, threads=1)
    n_careful = np.array([run.n_collisions.sum() * per_thousand // 1000])
    run = run._replace(seconds=seconds, n_careful=n_careful)
    monkeypatch.setattr(fast, "simulate", lambda *_args, **_options: run)
    code, out, err = command_line(*RUN)
    assert (code, json.loads(out)["careful"]) == (0, run.n_careful.sum())
    assert (said in err) if said else err == ""
