"""The manners of every command: imports, refusals, numbers and tables; and scenes at the edge of binary64."""

from __future__ import annotations

import errno
import io
import json
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from support.depth import deep_but
from support.refusals import assert_refused, one_line

import theory
from mushrooms.commands import app
from mushrooms.figures import table
from mushrooms.main import INTERRUPTED, run
from mushrooms.store.summary import expected_collisions
from mushrooms.terminal import new_console, print_pairs
from scene import BangBang, Mushroom, load

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
    assert is_full or done.stderr == "mushrooms: interrupted; files are written only when they are complete\n"
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
