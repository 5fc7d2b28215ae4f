"""The command line: results as promised, and every bad input one line on stderr with exit code 2."""

from __future__ import annotations

import errno
import json
import os
import re
import subprocess
import sys
from concurrent.futures import BrokenExecutor
from decimal import Decimal

import numpy as np
import pytest
from support.depth import deep_but
from support.refusals import assert_refused

import fast
import scene as scenes
from conformance.files import write_files
from mushrooms import scenes as catalogue
from mushrooms.scenes import FIGURES

MOVING_CAP = """\
table = "mushroom"
r = 1.0
h = 1.0
slope = 0.0
[w]
kind = "fourier"
mean = 0.6
omega = 1.0
cos = [0.4]
"""
BROKEN_SCENES = {
    "too-wide": (MOVING_CAP.replace("[0.4]", "[0.4000001]"), "w <= r"),
    "nan": (MOVING_CAP.replace("h = 1.0", "h = nan"), "h = nan"),
    "unknown-key": ("depth = 1.0\n" + MOVING_CAP, "depth"),
    "not-toml": ("table = ", "TOML"),
}


@pytest.mark.parametrize("command", ["theory", "simulate", "draw"])
@pytest.mark.parametrize("kind", BROKEN_SCENES)
def test_a_broken_scene_is_refused(command_line, tmp_path, command, kind):
    text, word = BROKEN_SCENES[kind]
    path = tmp_path / "scene.toml"
    path.write_text(text)
    out = tmp_path / ("out.svg" if command == "draw" else "out")
    more = {"theory": [], "simulate": ["--particles", 1, "--energy", 1, "--out", out], "draw": ["--out", out]}
    assert_refused(command_line(command, path, *more[command]), word)
    assert [entry.name for entry in tmp_path.iterdir()] == ["scene.toml"]


SIMULATE = ["simulate", "moving-cap", "--particles", "5", "--energy", "100", "--out", "out"]


@pytest.mark.parametrize(
    ("arguments", "out", "word"),
    [
        *(
            (arguments, out, "folder")
            for arguments in (SIMULATE[:-2], ["audit"])
            for out in ("file.txt", "file.txt/sub")
        ),
        (["draw", "moving-cap"], "file.txt/a.svg", "a.svg"),
    ],
)
def test_output_on_a_file_is_refused_at_once(command_line, tmp_path, monkeypatch, arguments, out, word):
    def never(*_args, **_options):
        raise AssertionError("simulated although the output cannot be written")

    for name in ("simulate", "go_on"):
        monkeypatch.setattr(fast, name, never)
    blocker = tmp_path / "file.txt"
    blocker.write_text("kept")
    assert_refused(command_line(*arguments, "--out", tmp_path / out), "file.txt", word)
    assert blocker.read_text() == "kept"
    assert list(tmp_path.iterdir()) == [blocker]


@pytest.mark.parametrize(
    ("error", "cause", "code"),
    [
        (KeyboardInterrupt, None, 130),
        (MemoryError, None, 2),
        (OSError("full"), None, 2),
        # A compiled module loaded at the moment of an interrupt: a page, and exit code 1.
        (ImportError("initialization failed"), KeyboardInterrupt(), 130),
    ],
)
def test_a_broken_off_simulation_leaves_nothing(command_line, tmp_path, monkeypatch, error, cause, code):
    def broken(*_args, **_options):
        raise error from cause

    monkeypatch.setattr(fast, "go_on", broken)
    ended = command_line(*SIMULATE[:-1], tmp_path / "a" / "b")
    assert (ended.code, ended.err.count("\n")) == (code, 1)
    assert ("interrupted" in ended.err) == (code == 130)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (EOFError("Ran out of input"), "a file or stream ended too soon: Ran out of input"),
        (MemoryError(), "not enough memory"),
        (MemoryError("Unable to allocate 8 GiB"), "not enough memory: Unable to allocate 8 GiB"),
        (RecursionError("maximum depth exceeded"), "nested too deeply: maximum depth exceeded"),
        (BrokenExecutor("no result"), "a process of this run was ended from outside: no result"),
        (OSError(errno.EMFILE, "Too many open files"), "[Errno 24] Too many open files"),
        (KeyboardInterrupt(), "interrupted; files are written only when they are complete"),
    ],
)
def test_only_an_interrupt_is_called_one(command_line, monkeypatch, error, told):
    def broken(*_arguments):
        raise error

    monkeypatch.setattr(catalogue, "print_scenes", broken)
    code = 130 if isinstance(error, KeyboardInterrupt) else 2
    assert command_line("scenes") == (code, "", f"mushrooms: {told}\n")


def test_a_failed_write_leaves_older_results_alone(tmp_path):
    (tmp_path / "a.json").write_text("old")

    def fail(_file):
        raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"):
        write_files(tmp_path, {"a.json": lambda file: file.write(b"new"), "b.json": fail})
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.json"]
    assert (tmp_path / "a.json").read_text() == "old"


def test_the_catalogue_is_listed_with_the_refused_scene(command_line):
    code, out, _ = command_line("scenes", "--json")
    rows = {row["name"]: row for row in json.loads(out)}
    assert code == 0
    assert list(rows) == scenes.catalogue()
    assert [name for name, row in rows.items() if row["refused"]] == ["moving-cap-as-printed"]
    assert "w > h slope" in rows["moving-cap-as-printed"]["refused"]
    assert rows["fixed-cap-clockwise"]["period"] == 1.0
    assert rows["frozen-mushroom"]["period"] is None
    code, out, _ = command_line("scenes")
    assert code == 0
    assert all(name in out for name in rows)


def test_theory_prints_decimal_strings(command_line):
    code, out, _ = command_line("theory", "moving-cap", "--digits", 25, "--json")
    values = json.loads(out)
    assert code == 0
    assert set(values) == {"p_nc", "m1", "log_e_nc", "sd", "mean_exp_minus", "mean_exp_plus"}
    assert abs(Decimal(values["m1"]) - Decimal("0.1227679649374")) < Decimal("1e-13")
    assert abs(Decimal(values["mean_exp_minus"]) - 1) < Decimal("1e-23")
    code, out, _ = command_line("theory", "moving-cap")
    assert code == 0
    assert values["m1"][:12] in out
    assert all(FIGURES[name] in out for name in values)


def test_theory_adds_what_finite_energy_does(command_line):
    code, out, _ = command_line("theory", "fixed-cap-anticlockwise", "--energy", "1e9", "--json")
    values = json.loads(out)
    assert code == 0
    assert set(values) <= set(FIGURES)
    assert float(values["m1"]) == pytest.approx(0.044926243)
    assert values["m1_at"] == pytest.approx(0.0469, abs=2e-4)  # the paper's run: 0.0463 +- 0.0009
    assert values["peak_width_at"] == pytest.approx(0.0873, rel=0.02)
    assert 0 < values["m1_error"] < 1e-3
    assert values["v"] == pytest.approx(44721.36)
    assert 2e4 < values["collisions"] < 2e5
    assert command_line("theory", "ergodic", "--energy", "1e7", "--json")[0] == 0


@pytest.mark.parametrize(
    ("name", "energy", "why"),
    [("untilted", 1e6, "no frozen rates of scene 'untilted'"), ("moving-cap", 1e3, "particles so slow")],
)
def test_theory_prints_the_limit_where_nothing_is_known_of_an_energy(command_line, name, energy, why):
    code, out, err = command_line("theory", name, "--energy", energy, "--json")
    values = json.loads(out)
    assert code == 0
    assert err.startswith(why) or why in err
    assert err.endswith("What is printed is the limit of high energies\n")
    assert set(values) == {
        *json.loads(command_line("theory", name, "--json").out),
        "energy",
        "v",
        "collisions",
    }
    assert values["v"] == pytest.approx((2 * energy) ** 0.5)


def test_simulate_prints_and_saves_the_same_result(command_line, tmp_path):
    command = ["simulate", "moving-cap", "--particles", 40, "--energy", 1e4, "--seed", 7, "--json"]
    command_line(*command)  # compiles, which stderr tells of, unless that is done
    code, out, err = command_line(*command, "--out", tmp_path / "run")
    assert (code, err) == (0, "")
    summary = json.loads(out)
    assert list(summary) == [
        "particles", "collisions", "lost", "undecided", "careful", "collision_time", "m1", "m1_se",
        "m1_theory", "m1_z", "p_nc", "p_nc_se", "p_nc_theory", "p_nc_z", "ns_per_collision", "sha256",
    ]  # fmt: skip
    names = ["blocks", "ensemble.zarr", "summary.json"]
    assert sorted(entry.name for entry in (tmp_path / "run").iterdir()) == names
    saved = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert saved.items() >= summary.items()
    assert saved["seed"] == 7
    assert scenes.from_data(saved["scene"]) == scenes.load("moving-cap")
    found = fast.simulate(scenes.load("moving-cap"), n_particles=40, energy=1e4, seed=7)
    assert np.log(found.energy / 1e4).mean() == pytest.approx(summary["m1"], rel=1e-12)
    assert found.n_collisions.sum() == summary["collisions"]
    assert found.n_careful.sum() == summary["careful"] > 0
    again = json.loads(command_line(*command, "--threads", 1)[1])
    assert again["sha256"] == summary["sha256"]


def test_simulate_one_particle_in_a_cap_says_what_it_cannot_know(command_line):
    code, out, _ = command_line("simulate", "breathing-circle", "--particles", 1, "--energy", 50, "--json")
    summary = json.loads(out)
    assert code == 0
    assert summary["m1_se"] is None
    assert summary["p_nc"] is None


DRAWABLE = [name for name in scenes.catalogue() if name != "moving-cap-as-printed"]


@pytest.mark.parametrize("name", deep_but(DRAWABLE, "fixed-cap-clockwise"))
def test_every_scene_can_be_drawn(command_line, tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    code, out, _ = command_line("draw", name)
    assert (code, out) == (0, f"{name}.svg\n")
    assert "</svg>" in (tmp_path / f"{name}.svg").read_text("utf-8")
    assert os.listdir(tmp_path) == [f"{name}.svg"]


def test_version_of_the_module_run_as_a_program():
    command = [sys.executable, "-m", "mushrooms", "--version"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert re.fullmatch(r"mushrooms \d\S*\n", done.stdout)
