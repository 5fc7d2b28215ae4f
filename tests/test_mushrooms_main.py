"""The command line: results as promised, refusals in one line, the manners of all commands, odd scenes."""

from __future__ import annotations

import errno
import io
import json
import math
import os
import re
import shlex
import subprocess
import sys
from concurrent.futures import BrokenExecutor
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.depth import deep_but
from support.faulty_servers import command
from support.refusals import assert_refused, one_line

import conformance
import fast
import scene as scenes
import theory
from conformance.files import write_files
from mushrooms import scenes as catalogue
from mushrooms.commands import app
from mushrooms.figures import table
from mushrooms.main import INTERRUPTED, run
from mushrooms.output import new_console, print_pairs
from mushrooms.scenes import FIGURES
from mushrooms.store.summary import expected_collisions
from scene import BangBang, Mushroom, load

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
        (KeyboardInterrupt(), "interrupted"),
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


ROOT = Path(__file__).parent.parent
# As a shell has it: what could not be written is still there when the interpreter ends.
BUFFERED = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
COMMANDS = [command.callback.__name__ for command in app.registered_commands]
HEAVY = {
    "numpy",
    "numba",
    "mpmath",
    "msgspec",
    "scipy",
    "matplotlib",
    "rich",
    "zarr",
    "scene",
    "fast",
    "theory",
}


def loaded_by(code: str) -> set[str]:
    """Return which of the heavy packages are imported after some code has run in a process of its own."""
    command = [sys.executable, "-c", f"import sys\n{code}\nprint(*sys.modules, file=sys.stderr)"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return HEAVY & set(done.stderr.split())


def test_no_help_imports_what_takes_long():
    """The list of commands, and the help of each: their bodies import what does the work."""
    code = "from mushrooms.main import run\nfor words in {}:\n try: run(words)\n except SystemExit: pass"
    asked = [["--help"], *([name, "--help"] for name in COMMANDS)]
    assert loaded_by(code.format(asked)) == set()
    assert loaded_by("import fast") == {"fast"}
    assert "numba" in loaded_by("import fast\nfast.simulate")


@pytest.mark.parametrize("name", ["", *COMMANDS])
def test_every_command_has_an_example(command_line, name):
    code, out, _ = command_line(*name.split(), "--help")
    assert code == 0
    assert f"Example: mushrooms {name} ".replace("  ", " ") in out


def test_a_file_that_the_system_refuses_is_named_without_a_number(command_line, tmp_path, monkeypatch):
    def full(_table, _suffix, file):
        raise OSError(errno.EFBIG, os.strerror(errno.EFBIG))

    monkeypatch.setattr(table, "write_picture", full)
    ended = command_line("draw", "moving-cap", "--out", tmp_path / "a.svg")
    assert_refused(ended, f"mushrooms: '{tmp_path / 'a.svg'}': File too large")
    assert list(tmp_path.iterdir()) == []


def test_a_mean_is_rounded_to_its_error(capsys):
    pairs = {"m1": 0.0358545588507, "m1_se": 0.0063475245, "n": 3, "none": None}
    print_pairs(pairs, as_json=False)
    assert capsys.readouterr().out.split() == ["m1", "0.0359", "m1_se", "0.0063", "n", "3", "none", "–"]
    print_pairs(pairs, as_json=True)
    assert "0.0358545588507" in capsys.readouterr().out
    print_pairs({"m1": 12345.678, "m1_se": 250.0}, as_json=False)
    assert capsys.readouterr().out.split() == ["m1", "12346", "m1_se", "250"]


def test_tables_obey_columns(monkeypatch):
    monkeypatch.setenv("COLUMNS", "60")
    assert new_console().width == 60
    monkeypatch.delenv("COLUMNS")
    assert new_console().width == 140


@pytest.mark.parametrize(("given", "meant"), [("2e1", 20), ("20", 20), ("0.2e2", 20), ("+20.0", 20)])
def test_whole_numbers_may_have_exponents(command_line, given, meant):
    code, out, _ = command_line(
        "simulate", "breathing-circle", "--particles", given, "--energy", "1", "--json"
    )
    assert code == 0
    assert json.loads(out)["particles"] == meant


def test_wherever_it_prints_nothing_is_lost_for_want_of_a_letter_or_a_width(monkeypatch):
    rng = np.random.default_rng(20261123)
    sizes = ["", "0", "-1", "60", "200", "\N{SUPERSCRIPT TWO}", "9" * 5000, "1e2", "wide"]
    for _ in range(60):
        for name in ("COLUMNS", "LINES"):
            monkeypatch.setenv(name, sizes[rng.integers(len(sizes))])
        encoding = ["ascii", "latin-1", "cp1252", "utf-8"][rng.integers(4)]
        kept = io.TextIOWrapper(io.BytesIO(), encoding=encoding)
        monkeypatch.setattr(sys, "stdout", kept)
        with pytest.raises(SystemExit) as stop:
            run([["scenes"], ["scenes", "--json"], ["scenes", "moving-cap"]][rng.integers(3)])
        assert stop.value.code == 0
        assert len(kept.buffer.getvalue()) > 200


@pytest.mark.parametrize(
    ("to", "code", "word"),
    [(">&-", 0, ""), (">/dev/full", 2, "standard output cannot be written"), ("", 0, "")],
)
@pytest.mark.parametrize("more", deep_but(["", "2>&-"], ""))
def test_standard_output_may_be_closed_or_full(tmp_path, to, code, word, more):
    line = f'"{sys.executable}" -m mushrooms scenes moving-cap --json {to} {more}'
    done = subprocess.run(
        line, shell=True, cwd=ROOT, env=BUFFERED, capture_output=True, text=True, timeout=60
    )
    assert done.returncode == code
    assert word in done.stderr or more
    assert "Traceback" not in done.stderr
    assert done.stdout == "" or (not to and json.loads(done.stdout)["name"] == "moving-cap")


@pytest.mark.parametrize("is_full", deep_but([False, True], False))
@pytest.mark.parametrize("name", deep_but(["SIGINT", "SIGTERM", "SIGHUP"], "SIGTERM"))
def test_whatever_ends_a_command_no_half_written_file_stays(tmp_path, name, is_full):
    """Also where nothing can be said of it: a terminal that has gone takes no more."""
    code = f"""if True:
        import os, signal
        from mushrooms.figures import table
        from mushrooms.main import run

        def ended(_table, _suffix, file):
            file.write(b"half")
            os.kill(os.getpid(), signal.{name})

        table.write_picture = ended
        # As a terminal starts a command: where these are ignored from the start they stay so.
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.signal(signal.SIGHUP, signal.SIG_DFL)
        run(["draw", "moving-cap", "--out", "a.svg"])
    """
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-c", code],
            cwd=tmp_path,
            stdout=subprocess.PIPE,
            stderr=full if is_full else subprocess.PIPE,
            text=True,
            timeout=60,
            env={**BUFFERED, "PYTHONPATH": str(ROOT)},
        )
    assert done.returncode == INTERRUPTED
    assert is_full or done.stderr == "mushrooms: interrupted\n"
    assert list(tmp_path.iterdir()) == []


SCENES = {
    "short": 'r = 1.0\nh = 1.0\nnu = {kind = "fourier", mean = 0.5, period = 1e-308, cos = [0.1]}',
    "huge": "r = 1.7e308\nh = 1e300\nnu = 0.5",
    "slow": 'h = 1e300\nnu = 0.5\nr = {kind = "fourier", mean = 1e308, period = 1e308, cos = [1e307]}',
    "brief": 'r = 1.0\nnu = 0.5\nh = {kind = "bang-bang", knots = [[0, 1], [5e-324, 2], [1, 1]]}',
}


@pytest.fixture
def file_of(tmp_path):
    """Return what writes a scene's file."""

    def write(text, name="scene"):
        path = tmp_path / "scene.toml"
        path.write_text(f'table = "mushroom"\nname = "{name}"\n{text}\n', "utf-8")
        return path

    return write


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("short", "period = 1e-308, must be"),
        ("huge", "scene.r = 1.7e+308, must be"),
        ("slow", "scene.r = 1.1e+308"),
    ],
)
@pytest.mark.parametrize("kind", [(), ("--trajectory",), ("--export", "path.csv")])
def test_what_no_figure_holds_is_not_drawn(command_line, file_of, tmp_path, monkeypatch, name, words, kind):
    monkeypatch.chdir(tmp_path)
    asked = ["draw", file_of(SCENES[name]), *kind, "--out", "picture.svg"]
    assert_refused(command_line(*asked), words, "1e-100 to 1e+100 in a picture")
    assert not list(tmp_path.glob("p*"))


NO_FORMULA = ("r = 1.0\nh = 1.0\nnu = 0.5", r"$\\frac{$ a_b^")


@pytest.mark.parametrize(
    ("scene", "kind"),
    [
        ((SCENES["brief"],), ()),  # a leg shorter than any float tells
        *((NO_FORMULA, kind) for kind in ((), ("--trajectory",), ("--section",), ("--growth",))),
    ],
)
def test_odd_scenes_are_drawn_and_a_name_begins_no_formula(command_line, file_of, tmp_path, scene, kind):
    assert command_line("draw", file_of(*scene), *kind, "--out", tmp_path / "picture.svg").code == 0


def test_a_run_at_the_last_floats_goes_without_a_forecast(command_line, file_of):
    scene = file_of(SCENES["slow"])
    assert math.isnan(expected_collisions(load(scene), 100.0, 1))
    assert command_line("simulate", scene, "--particles", 2, "--energy", 100.0).code == 0


@pytest.mark.parametrize("before", [(), ((-1.0, 0.2),)])
def test_a_leg_that_theory_cannot_tell_from_an_instant_is_refused(before):
    at_start = 0.3 if before else 0.2
    mouth = BangBang((*before, (0.0, at_start), (1e-60, 0.5), (1.0, 0.2)))
    assert "so short a time" in one_line(theory.predict, Mushroom(r=1.0, h=1.0, nu=mouth))


STEPPER = shlex.join([sys.executable, str(Path(conformance.__file__).parent / "harness/python/stepper.py")])
ONE = "simulate moving-cap --particles 5 --energy 1"
STORED = "simulate moving-cap --particles 5 --energy 100 --out out"
PLOT = "simulate moving-cap --particles 60 --energy 1e4 --plot"
SEEDS = "0 to 18446744073709551615"
NOTHING = "would change nothing here"
# A command and what the refusal must say.
REFUSED: list[Any] = [
    ("", ["command"]),
    ("bogus", ["bogus"]),
    # numbers out of bounds
    (f"{STORED} --particles 0", ["'--particles': 0,", "1 to 10000000000"]),
    (f"{STORED} --particles 10000000001", ["'--particles': 10000000001,", "1 to 10000000000"]),
    (f"{ONE} --particles 100000001", ["--particles = 100000001", "1 to 100000000;"]),
    (f"{STORED} --energy -1", ["'--energy': -1.0,", "> 0"]),
    (f"{STORED} --energy 0", ["'--energy': 0.0,", "> 0"]),
    (f"{STORED} --energy nan", ["'--energy': nan,", "finite"]),
    (f"{STORED} --energy inf", ["'--energy': inf,", "finite"]),
    (f"{STORED} --cycles 0", ["'--cycles': 0,", ">= 1"]),
    (f"{STORED} --seed -1", ["'--seed': -1,", SEEDS]),
    (f"{STORED} --seed 18446744073709551616", ["'--seed': 18446744073709551616,", SEEDS]),
    (f"{STORED} --threads 0", ["'--threads': 0,", ">= 1"]),
    (f"{STORED} --block 0", ["'--block': 0, must be 1 to 1048576"]),
    (f"{STORED} --block 1e29", ["must be 1 to 1048576"]),
    (f"{STORED} --max-seconds 0", ["'--max-seconds': 0.0,", "> 0"]),
    (f"{ONE} --threads 999", ["threads = 999"]),
    ("theory moving-cap --digits 0", ["'--digits': 0,", "1 to 1000"]),
    ("theory moving-cap --digits 1001", ["'--digits': 1001,", "1 to 1000"]),
    ("theory moving-cap --energy 0", ["'--energy': 0.0,"]),
    ("audit --seed -1", ["'--seed': -1,", SEEDS]),
    ("audit --threads 0", ["'--threads': 0,"]),
    ("bench --quick --seed -1", ["'--seed': -1,"]),
    ("attack --cases 0", ["'--cases': 0,", "1 to"]),
    (f"check --timeout 0 -- {STEPPER}", ["'--timeout': 0.0,"]),
    (f"check --timeout nan -- {STEPPER}", ["'--timeout': nan,"]),
    (f"check --total 0 -- {STEPPER}", ["'--total': 0.0,"]),
    (f"check --restarts -1 -- {STEPPER}", ["'--restarts': -1,"]),
    (f"check --seed -1 -- {STEPPER}", ["'--seed': -1,"]),
    ("ask fresh/1 --seed -1", ["'--seed': -1,"]),
    ("draw moving-cap --growth --cycles 0", ["'--cycles': 0,", "1 to 10000"]),
    ("draw moving-cap --trajectory --energy 0", ["'--energy': 0.0,", "> 0"]),
    ("draw moving-cap --trajectory --collisions 0", ["'--collisions': 0,", "1 to 1000000"]),
    ("draw moving-cap --map --particles 1001", ["'--particles': 1001,", "1 to 1000"]),
    ("draw moving-cap --lyapunov --collisions 9", ["collisions = 9", ">= 32"]),
    ("draw moving-cap --section --energy 1e308", ["energy = 1e+308", "2^800"]),
    ("draw moving-cap --seed -1", ["'--seed': -1,"]),
    (f"{PLOT} a.svg --particles 1", ["--particles = 1, must be >= 2"]),
    (
        "simulate moving-cap --particles 1e8 --energy 1 --block 2 --out a",
        ["--block = 2: 100000000 particles", "least 100"],
    ),
    # no numbers
    *((f"{ONE} --particles {n}", ["--particles", n]) for n in ("1e400", "1.5", "1e-1", "nan", "inf", "0x10")),
    *(
        (f"theory moving-cap --digits {n}", ["--digits", "whole"])
        for n in ("many", "1e1000000", "-1e999999999")
    ),
    *((f"{ONE} --energy={x}", ["--energy", f"{x!r} is not a number"]) for x in ("x", "1,5", "0x10", "--")),
    (f"{ONE} --max-seconds=1,5", ["--max-seconds", "'1,5' is not a number"]),
    ("draw moving-cap --trajectory --collisions 1.5", ["--collisions", "1.5"]),
    # empty
    ("draw moving-cap --out ''", ["--out is empty, must have a value"]),
    ("draw moving-cap --out=", ["--out is empty, must have a value"]),
    (f"{ONE} --out ' '", ["--out is empty, must have a value"]),
    ("bench --table ''", ["--table is empty, must have a value"]),
    ("export '' --to a.csv", ["an argument is empty, must have a value"]),
    # missing, or no such thing
    ("theory", ["SCENE"]),
    ("theory nowhere", ["nowhere"]),
    ("theory nowhere.toml", ["nowhere.toml", "No such file"]),
    ("theory moving-cap-as-printed", ["w > h slope"]),
    ("theory fermi-ulam", []),
    ("simulate moving-cap --energy 1", ["--particles"]),
    ("scenes --toml", ["--toml needs NAME"]),
    ("audit --only X2,X99", ["X99", "M1", "L7"]),
    *(
        (f"audit --only '{ids}'", ["--only ", why])
        for ids, why in (("", "empty"), (" ", "empty"), (",,", "name a claim"))
    ),
    *(
        (f"{ONE} --out a --phases '{phases}'", ["--phases "])
        for phases in ("", "a", "0.5,0.25", "0", "0.5,1", "0.5,", "nan", "0.5;0.6")
    ),
    ("attack --family none", ["--family = 'none'", "knot-at-event"]),
    ("bench --quick -- ./no-such-stepper", ["no-such-stepper"]),
    pytest.param(f"bench --quick -- {sys.executable} -c 'print(1)'", ["python"], marks=pytest.mark.deep),
    ("bench --table absent.json", ["absent.json"]),
    ("check", ["COMMAND"]),
    ("check -- ./no-such-stepper", ["no-such-stepper"]),
    ("check --level hard -- true", ["level = 'hard'", "core, extended, stress"]),
    (f"check --groups moving-cap,no-such -- {STEPPER}", ["must be one of"]),
    ("check --groups , -- true", ["--groups = ','"]),
    (f"check --known-failures absent.txt -- {STEPPER}", ["absent.txt"]),
    ("ask", ["ID"]),
    ("ask no-such/1", ["ID = 'no-such/1'"]),
    ("ask fresh/1", ["--seed"]),
    ("ask fresh/999 --seed 1", ["ID = 'fresh/999'"]),
    ("ask moving-cap/3 -- ./no-such-stepper", ["no-such-stepper"]),
    (f"ask moving-cap/3 -- {shlex.join(command('other-protocol'))}", ["does not speak protocol 1"]),
    ("verify none.json", ["'none.json': No such file"]),
    # files that cannot be, or of no such kind
    ("draw moving-cap --out picture.jpeg", ["picture.jpeg", ".svg"]),
    ("draw moving-cap --out nowhere/picture.svg", ["nowhere/picture.svg", "No such"]),
    ("draw moving-cap --section --out a.gif", ["a.gif", ".svg, .png, .pdf"]),
    ("draw moving-cap --export a.txt", ["a.txt", ".csv, .parquet"]),
    (f"{PLOT} a.pdf", [".svg, .png"]),
    (f"check --json report.txt -- {STEPPER}", [".json"]),
    (f"check --badge badge.png -- {STEPPER}", [".svg"]),
    (f"check --json r.json --summary r.json -- {STEPPER}", ["asked for twice"]),
    (f"check --html no/such/folder/r.html -- {STEPPER}", ["cannot be written"]),
    # options that need another, or that nothing would heed
    (f"{ONE} --resume", ["--resume needs --out"]),
    (f"{ONE} --max-seconds 1", ["--max-seconds needs --out"]),
    (f"{ONE} --dask tcp://here:1", ["--dask needs --out"]),
    (f"{ONE} --block 8", ["--block needs --out"]),
    (f"{ONE} --phases 0.5", ["--phases needs --out"]),
    ("scenes moving-cap --toml --json", ["--toml and --json"]),
    ("bench --workload all", ["--workload = 'all'", "needs --table"]),
    ("bench --table a.json --quick", ["--quick", "--table measures nothing"]),
    ("draw moving-cap --seed 1", ["--seed = 1", NOTHING, "the picture of the walls has no particles"]),
    ("draw moving-cap --energy 1", ["--energy = 1.0", "no particles"]),
    ("draw moving-cap --trajectory --particles 3", ["--particles = 3", "--section, --map"]),
    ("draw moving-cap --export a.csv --particles 3", ["--particles = 3"]),
    ("draw moving-cap --map --phase 0.5", ["--phase = 0.5", "--section"]),
    ("draw moving-cap --growth --collisions 99", ["--collisions = 99", "--cycles"]),
    ("draw frozen-mushroom --section --phase 0.5", ["phase = 0.5", "stand still"]),
]


@pytest.mark.parametrize(("line", "words"), REFUSED)
def test_bad_input_is_one_line_and_nothing_is_written(command_line, tmp_path, monkeypatch, line, words):
    monkeypatch.chdir(tmp_path)
    assert_refused(command_line(*shlex.split(line)), *words)
    assert list(tmp_path.iterdir()) == []
