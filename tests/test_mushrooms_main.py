"""The command line: results as promised, how a command ends, the manners of all commands, odd scenes."""

import errno
import io
import json
import math
import os
import re
import subprocess
import sys
from concurrent.futures import BrokenExecutor
from decimal import Decimal
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from support.depth import deep_but
from support.refusals import assert_refused, one_line

import fast
import scene as scenes
import theory
from conformance.cases.table import FAMILIES
from mushrooms import questions
from mushrooms.commands import app
from mushrooms.figures import table
from mushrooms.main import INTERRUPTED, run
from mushrooms.output import new_console, print_pairs
from mushrooms.scenes import FIGURES
from mushrooms.store.summary import expected_collisions
from scene import BangBang, Mushroom, load
from scene.files.writer import write_files


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (EOFError("Ran out of input"), "a file or stream ended too soon: Ran out of input\n"),
        (MemoryError(), "not enough memory\n"),
        (MemoryError("Unable to allocate 8 GiB"), "not enough memory: Unable to allocate 8 GiB\n"),
        (RecursionError("maximum depth exceeded"), "nested too deeply: maximum depth exceeded\n"),
        (BrokenExecutor("no result"), "a process of this run was ended from outside: no result\n"),
        (OSError("full"), "full; 0 of 5 particles are kept; go on with: mushrooms simulate"),
        (KeyboardInterrupt(), "interrupted; 0 of 5 particles are kept; go on with: mushrooms simulate"),
        # A compiled module loaded at the moment of an interrupt: a page, and exit code 1.
        (ImportError("initialization failed"), "interrupted\n"),
    ],
)
def test_a_run_that_breaks_off_says_why_in_a_line_and_leaves_nothing(
    command_line, tmp_path, monkeypatch, error, told
):
    """Only an interrupt is called one."""

    def broken(*_args, **_options):
        raise error from KeyboardInterrupt() if isinstance(error, ImportError) else None

    monkeypatch.setattr(fast, "go_on", broken)
    run = ["simulate", "moving-cap", "--particles", 5, "--energy", 100]
    code, out, err = command_line(*run, "--out", tmp_path / "a" / "b")
    assert (code, out, err.count("\n")) == (130 if "interrupted" in told else 2, "", 1)
    assert err.startswith(f"mushrooms: {told}")
    assert list(tmp_path.iterdir()) == []


def test_a_failed_write_leaves_older_results_alone(tmp_path):
    (tmp_path / "a.json").write_text("old")

    def fail(_file):
        raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"):
        write_files(tmp_path, {"a.json": lambda file: file.write(b"new"), "b.json": fail})
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.json"]
    assert (tmp_path / "a.json").read_text() == "old"


def test_the_catalogue_is_listed_with_the_refused_scene(command_line):
    rows = {row["name"]: row for row in command_line("scenes", "--json").data()}
    assert list(rows) == scenes.catalogue()
    assert [name for name, row in rows.items() if row["refused"]] == ["moving-cap-as-printed"]
    assert "w > h slope" in rows["moving-cap-as-printed"]["refused"]
    assert rows["fixed-cap-clockwise"]["period"] == 1.0
    assert rows["frozen-mushroom"]["period"] is None
    assert all(name in command_line("scenes").out for name in rows)


def test_theory_prints_decimal_strings_and_adds_what_finite_energy_does(command_line):
    """As lines: docs/start.md."""
    command = ["theory", "fixed-cap-anticlockwise", "--digits", 25, "--energy", "1e9", "--json"]
    values = command_line(*command).data()
    assert list(values) == list(FIGURES)
    assert abs(Decimal(values["m1"]) - Decimal("0.044926243")) < Decimal("5e-9")
    assert abs(Decimal(values["mean_exp_minus"]) - 1) < Decimal("1e-23")
    assert values["m1_at"] == pytest.approx(0.0469, abs=2e-4)  # the paper's run: 0.0463 +- 0.0009
    assert values["peak_width_at"] == pytest.approx(0.0873, rel=0.02)
    assert 0 < values["m1_error"] < 1e-3
    assert values["v"] == pytest.approx(44721.36)
    assert 2e4 < values["collisions"] < 2e5
    assert command_line("theory", "ergodic", "--energy", "1e7", "--json").data()["captured_at"] is None


@pytest.mark.parametrize(
    ("name", "energy", "why"),
    [("untilted", 1e6, "no frozen rates of scene 'untilted'"), ("moving-cap", 1e3, "particles so slow")],
)
def test_theory_prints_the_limit_where_nothing_is_known_of_an_energy(command_line, name, energy, why):
    ended = command_line("theory", name, "--energy", energy, "--json")
    values, limit = ended.data(), command_line("theory", name, "--json").data()
    assert why in ended.err
    assert ended.err.endswith("What is printed is the limit of high energies\n")
    assert set(values) == {*limit, "energy", "v", "collisions"}
    assert values["v"] == pytest.approx((2 * energy) ** 0.5)


def test_simulate_prints_and_saves_the_same_result(command_line, tmp_path):
    command = ["simulate", "moving-cap", "--particles", 40, "--energy", 1e4, "--seed", 7, "--json"]
    command_line(*command)  # compiles, which stderr tells of, unless that is done
    ended = command_line(*command, "--out", tmp_path / "run")
    summary = ended.data()
    assert ended.err == ""
    assert list(summary) == [
        "particles", "collisions", "lost", "undecided", "careful", "collision_time", "m1", "m1_se",
        "m1_theory", "m1_z", "p_nc", "p_nc_se", "p_nc_theory", "p_nc_z", "ns_per_collision", "sha256",
    ]  # fmt: skip
    saved = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert saved.items() >= {**summary, "seed": 7}.items()
    assert scenes.from_data(saved["scene"]) == scenes.load("moving-cap")
    found = fast.simulate(scenes.load("moving-cap"), n_particles=40, energy=1e4, seed=7)
    assert np.log(found.energy / 1e4).mean() == pytest.approx(summary["m1"], rel=1e-12)
    assert found.n_collisions.sum() == summary["collisions"]
    assert found.n_careful.sum() == summary["careful"] > 0
    assert command_line(*command, "--threads", 1).data()["sha256"] == summary["sha256"]
    one = command_line("simulate", "breathing-circle", "--particles", 1, "--energy", 50, "--json").data()
    assert (one["m1_se"], one["p_nc"]) == (None, None)  # what one particle in a cap cannot tell


def test_the_version_is_printed(command_line):
    assert re.fullmatch(r"mushrooms \d\S*\n", command_line("--version").out)


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


@pytest.mark.parametrize(
    ("name", "value", "bound"),
    [
        ("NUMBA_NUM_THREADS", "0", ">= 1"),
        ("NUMBA_NUM_THREADS", "many", ">= 1"),
        ("SOURCE_DATE_EPOCH", "-1", ">= 0"),
        ("SOURCE_DATE_EPOCH", "", ">= 0"),
    ],
)
def test_a_variable_that_no_library_can_use_is_refused(command_line, monkeypatch, name, value, bound):
    monkeypatch.setenv(name, value)
    line = f"{name} = {value!r}, must be a whole number {bound}"
    assert_refused(command_line("theory", "moving-cap"), line)
    assert command_line("--help").code == 0


@pytest.mark.parametrize("name", ["", *COMMANDS])
def test_every_command_has_an_example(command_line, name):
    code, out, _ = command_line(*name.split(), "--help")
    assert code == 0
    assert f"Example: mushrooms {name} ".replace("  ", " ") in out


def test_a_file_that_the_system_refuses_is_named_without_a_number(command_line, tmp_path, monkeypatch):
    def full(_table, _suffix, file, _progress):
        raise OSError(errno.EFBIG, os.strerror(errno.EFBIG))

    monkeypatch.setattr(table, "write_picture", full)
    ended = command_line("draw", "moving-cap", "--out", tmp_path / "a.svg")
    assert_refused(ended, f"mushrooms: '{tmp_path / 'a.svg'}': File too large")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("pairs", "told"),
    [
        ({"m1": 0.03585455, "m1_se": 0.0063475, "n": 3}, "m1 0.0359 m1_se 0.0063 n 3"),
        ({"m1": 12345.678, "m1_se": 250.0, "none": None}, "m1 12346 m1_se 250 none –"),
    ],
)
def test_a_mean_is_rounded_to_its_error(capsys, pairs, told):
    print_pairs(pairs, as_json=False)
    assert " ".join(capsys.readouterr().out.split()) == told


@pytest.mark.parametrize("given", ["2e1", "20", "0.2e2", "+20.0"])
def test_whole_numbers_may_have_exponents(command_line, given):
    run = ["simulate", "breathing-circle", "--particles", given, "--energy", "1", "--json"]
    assert command_line(*run).data()["particles"] == 20


SIZES = ("", "0", "-1", "60", "200", "\N{SUPERSCRIPT TWO}", "9" * 5000, "1e2", "wide")


@pytest.mark.parametrize("encoding", deep_but(["ascii", "latin-1", "cp1252", "utf-8"], "ascii", "utf-8"))
@pytest.mark.parametrize("size", SIZES, ids=range(len(SIZES)))
@pytest.mark.parametrize("words", [["scenes"], ["scenes", "--json"], ["scenes", "moving-cap"]])
def test_wherever_it_prints_nothing_is_lost_for_want_of_a_letter_or_a_width(
    monkeypatch, encoding, size, words
):
    for name in ("COLUMNS", "LINES"):
        monkeypatch.setenv(name, size)
    kept = io.TextIOWrapper(io.BytesIO(), encoding=encoding)
    monkeypatch.setattr(sys, "stdout", kept)
    with pytest.raises(SystemExit) as stop:
        run(words)
    assert stop.value.code == 0
    assert len(kept.buffer.getvalue()) > 200


def tally_like(name, counts):
    cases = {"open": [], "wrong": []}
    return SimpleNamespace(
        family=name, n_cases=98765, counts=counts, worst_ulps=0.25, slowest=1.5, cases=cases
    )


@pytest.mark.parametrize("width", [20, 40, 80])
def test_no_name_is_cut_where_the_terminal_is_narrow(monkeypatch, command_line, capsys, width):
    monkeypatch.setenv("COLUMNS", str(width))
    printed = command_line("scenes").out
    assert all(f" {name} " in printed for name in scenes.catalogue())
    counts = {"agreed": 12345, "undecided": 0, "refused": 0, "open": 0, "wrong": 0}
    names = list(FAMILIES)
    questions._print([tally_like(name, counts) for name in names])
    printed = capsys.readouterr().out
    assert all(f" {name} " in printed for name in (*names, "98765", "12345", "0.25", "1.50"))


# A variable of the environment that a library reads when it is imported, and words of the line that names it.
VARIABLES = {
    "NUMBA_NUM_THREADS=0": (2, "NUMBA_NUM_THREADS = '0'", ">= 1"),
    "NUMBA_OPT=many": (0, "warning: Environment variable 'NUMBA_OPT'", "many"),
    "MPLBACKEND=none-such": (2, "MPLBACKEND = 'none-such'", "not a valid value"),
}


@pytest.mark.parametrize("variable", VARIABLES)
def test_a_variable_that_a_library_cannot_read_is_named_in_a_line(tmp_path, variable):
    code, *words = VARIABLES[variable]
    name, _, value = variable.partition("=")
    command = [sys.executable, "-m", "mushrooms", "draw", "moving-cap", "--out", "a.svg"]
    environment = {**os.environ, name: value, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == code, done.stderr
    assert done.stderr.startswith("mushrooms: ")
    told = [line for line in done.stderr.splitlines() if not line.startswith("compiling the fast stepper")]
    assert len(told) == 1
    assert all(word in told[0] for word in words)


def test_a_path_whose_bytes_are_no_letters_is_printed_so_that_a_shell_takes_it(tmp_path):
    """As the bytes that it is where a name alone is printed, and in a message as a shell quotes them."""
    command = [sys.executable, "-m", "mushrooms"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONUTF8": "1"}
    call = partial(subprocess.run, cwd=tmp_path, env=environment, capture_output=True, check=False)
    drawn = call([*command, "draw", "moving-cap", "--out", b"a\xff.svg"])
    assert (drawn.returncode, drawn.stdout) == (0, b"a\xff.svg\n")
    refused = call([*command, "draw", "moving-cap", "--out", b"no\xff/it's.svg"])
    assert refused.returncode == 2
    [quoted] = re.findall(rb"\$'(?:[^'\\]|\\.)*'", refused.stderr)
    echoed = call(["bash", "-c", b"printf %s " + quoted])
    assert echoed.stdout == b"no\xff/it's.svg"


def test_the_width_of_a_terminal_may_be_given(monkeypatch):
    monkeypatch.setenv("COLUMNS", "60")
    assert new_console().width == 60


NO_ROOM = Path("/dev/full")  # Linux has it


@pytest.mark.parametrize("to", deep_but([">&-", f">{NO_ROOM}", ""], ">&-", f">{NO_ROOM}"))
@pytest.mark.parametrize("more", deep_but(["", "2>&-"], ""))
@pytest.mark.parametrize("words", ["scenes moving-cap --json", "--version"])
def test_standard_output_may_be_closed_or_full(words, to, more):
    if str(NO_ROOM) in to and not NO_ROOM.exists():
        pytest.skip(f"this system has no {NO_ROOM}")
    line = f'"{sys.executable}" -m mushrooms {words} {to} {more}'
    done = subprocess.run(
        line, shell=True, cwd=ROOT, env=BUFFERED, capture_output=True, text=True, timeout=60
    )
    assert done.returncode == (2 if "full" in to else 0)
    assert ("standard output cannot be written" in done.stderr) == ("full" in to and not more)
    assert "Traceback" not in done.stderr
    assert bool(done.stdout) == (not to)


@pytest.mark.parametrize("is_full", deep_but([False, True], False))
@pytest.mark.parametrize("name", deep_but(["SIGINT", "SIGTERM", "SIGHUP"], "SIGTERM"))
def test_whatever_ends_a_command_no_half_written_file_stays(tmp_path, name, is_full):
    """Also where nothing can be said of it: a terminal that has gone takes no more."""
    code = f"""if True:
        import os, signal
        from mushrooms.figures import table
        from mushrooms.main import run

        def ended(_table, _suffix, file, _progress):
            file.write(b"half")
            os.kill(os.getpid(), signal.{name})

        table.write_picture = ended
        # As a terminal starts a command: where these are ignored from the start they stay so.
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.signal(signal.SIGHUP, signal.SIG_DFL)
        run(["draw", "moving-cap", "--out", "a.svg"])
    """
    if is_full and not NO_ROOM.exists():
        pytest.skip(f"this system has no {NO_ROOM}")
    with (NO_ROOM if is_full else Path(os.devnull)).open("w") as full:
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


# The last floats; a leg shorter than any float tells; a name that begins no formula.
SLOW = 'h = 1e300\nnu = 0.5\nr = {kind = "fourier", mean = 1e308, period = 1e308, cos = [1e307]}'
BRIEF = 'r = 1.0\nnu = 0.5\nh = {kind = "bang-bang", knots = [[0, 1], [5e-324, 2], [1, 1]]}'
NO_FORMULA = "r = 1.0\nh = 1.0\nnu = 0.5\nname = '$\\frac{$ a_b^'"


@pytest.mark.parametrize(
    ("text", "command"),
    [
        (SLOW, ("simulate", "--particles", 2, "--energy", 100.0)),
        (BRIEF, ("draw",)),
        (NO_FORMULA, ("draw", "--section")),
        *(
            pytest.param(NO_FORMULA, ("draw", *kind), marks=pytest.mark.deep)
            for kind in ([], ["--trajectory"], ["--growth"])
        ),
    ],
)
def test_odd_scenes_are_simulated_and_drawn(command_line, tmp_path, monkeypatch, text, command):
    monkeypatch.chdir(tmp_path)
    Path("scene.toml").write_text(f'table = "mushroom"\n{text}\n')
    assert command_line(command[0], "scene.toml", *command[1:]).code == 0
    assert math.isnan(expected_collisions(load("scene.toml"), 100.0, 1)) == (text == SLOW)


@pytest.mark.parametrize("before", [(), ((-1.0, 0.2),)])
def test_a_leg_that_theory_cannot_tell_from_an_instant_is_refused(before):
    at_start = 0.3 if before else 0.2
    mouth = BangBang((*before, (0.0, at_start), (1e-60, 0.5), (1.0, 0.2)))
    assert "so short a time" in one_line(theory.predict, Mushroom(r=1.0, h=1.0, nu=mouth))
