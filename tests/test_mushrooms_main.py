"""The command line: results as promised, and every bad input one line on stderr with exit code 2."""

from __future__ import annotations

import base64
import io
import json
import os
import re
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from decimal import Decimal
from html.parser import HTMLParser
from types import SimpleNamespace

import numpy as np
import pytest
from test_conformance_audit import draw_ensemble

import fast
import scene as scenes
from conformance.claims import CLAIMS
from mushrooms.main import run

N_AUDITED = 2000
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


@pytest.fixture
def call(capsys):
    def run_command(*arguments):
        with pytest.raises(SystemExit) as stop:
            run([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        return stop.value.code, captured.out, captured.err

    return run_command


def assert_refused(result, *words):
    code, out, err = result
    assert code == 2
    assert out == ""
    assert err.startswith("mushrooms: ")
    assert err.endswith("\n")
    assert err.count("\n") == 1
    for word in words:
        assert word in err


@pytest.mark.parametrize("command", ["theory", "simulate", "draw"])
@pytest.mark.parametrize("kind", BROKEN_SCENES)
def test_a_broken_scene_is_refused(call, tmp_path, command, kind):
    text, word = BROKEN_SCENES[kind]
    path = tmp_path / "scene.toml"
    path.write_text(text)
    out = tmp_path / ("out.svg" if command == "draw" else "out")
    more = {"theory": [], "simulate": ["--particles", 1, "--energy", 1, "--out", out], "draw": ["--out", out]}
    assert_refused(call(command, path, *more[command]), word)
    assert [entry.name for entry in tmp_path.iterdir()] == ["scene.toml"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], ["command"]),
        (["bogus"], ["bogus"]),
        (["theory"], ["SCENE"]),
        (["theory", "nowhere"], ["nowhere"]),
        (["theory", "nowhere.toml"], ["nowhere.toml", "No such file"]),
        (["theory", "moving-cap-as-printed"], ["w > h slope"]),
        (["theory", "fermi-ulam"], []),
        (["theory", "moving-cap", "--digits", "0"], ["--digits = 0", "1 to 1000"]),
        (["theory", "moving-cap", "--digits", "1001"], ["--digits = 1001", "1 to 1000"]),
        (["theory", "moving-cap", "--digits", "many"], ["--digits"]),
        (["simulate", "moving-cap", "--energy", "1"], ["--particles"]),
        (["audit", "--particles", "1999"], ["--particles = 1999", "2000 to 100000000"]),
        (["audit", "--seed", "-1"], ["--seed = -1"]),
        (["draw", "moving-cap", "--out", "picture.pdf"], ["picture.pdf", ".svg"]),
        (["draw", "moving-cap", "--out", "nowhere/picture.svg"], ["nowhere/picture.svg", "No such"]),
    ],
)
def test_bad_arguments_are_refused(call, tmp_path, monkeypatch, arguments, words):
    monkeypatch.chdir(tmp_path)
    assert_refused(call(*arguments), *words)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("option", "value", "bound"),
    [
        ("--particles", "0", "1 to 100000000"),
        ("--particles", "100000001", "1 to 100000000"),
        ("--energy", "-1", "> 0"),
        ("--energy", "0", "> 0"),
        ("--energy", "nan", "finite"),
        ("--energy", "inf", "finite"),
        ("--cycles", "0", ">= 1"),
        ("--seed", "-1", "0 to 18446744073709551615"),
        ("--seed", "18446744073709551616", "0 to 18446744073709551615"),
        ("--threads", "0", ">= 1"),
    ],
)
def test_bad_numbers_are_refused_with_value_and_bound(call, tmp_path, option, value, bound):
    options = {"--particles": "5", "--energy": "100", "--out": str(tmp_path / "out")} | {option: value}
    result = call("simulate", "moving-cap", *(part for pair in options.items() for part in pair))
    assert_refused(result, option, value, bound)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("command", ["simulate", "audit"])
@pytest.mark.parametrize("below", [True, False])
def test_output_on_a_file_is_refused_before_any_work(call, tmp_path, monkeypatch, command, below):
    def never(*_args, **_options):
        raise AssertionError("simulated although the output cannot be written")

    monkeypatch.setattr(fast, "simulate", never)
    blocker = tmp_path / "file.txt"
    blocker.write_text("kept")
    more = ["moving-cap", "--particles", 5, "--energy", 100] if command == "simulate" else []
    assert_refused(call(command, *more, "--out", blocker / "sub" if below else blocker), "file.txt", "folder")
    assert blocker.read_text() == "kept"
    assert list(tmp_path.iterdir()) == [blocker]


def test_a_picture_below_a_file_is_refused(call, tmp_path):
    (tmp_path / "file.txt").write_text("kept")
    assert_refused(call("draw", "moving-cap", "--out", tmp_path / "file.txt" / "a.svg"), "a.svg")
    assert [entry.name for entry in tmp_path.iterdir()] == ["file.txt"]


@pytest.mark.parametrize(
    ("error", "code"), [(KeyboardInterrupt, 130), (MemoryError, 2), (OSError("full"), 2)]
)
def test_a_broken_off_simulation_leaves_nothing(call, tmp_path, monkeypatch, error, code):
    def broken(*_args, **_options):
        raise error

    monkeypatch.setattr(fast, "simulate", broken)
    result = call("simulate", "moving-cap", "--particles", 5, "--energy", 100, "--out", tmp_path / "a" / "b")
    assert result[0] == code
    assert "Traceback" not in result[2]
    assert list(tmp_path.iterdir()) == []


def test_a_failed_write_leaves_older_results_alone(tmp_path):
    from mushrooms import output

    (tmp_path / "a.json").write_text("old")

    def fail(_file):
        raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"):
        output.write_files(tmp_path, {"a.json": lambda file: file.write(b"new"), "b.json": fail})
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.json"]
    assert (tmp_path / "a.json").read_text() == "old"


def test_the_catalogue_is_listed_with_the_refused_scene(call):
    code, out, _ = call("scenes", "--json")
    rows = {row["name"]: row for row in json.loads(out)}
    assert code == 0
    assert list(rows) == scenes.catalogue()
    assert [name for name, row in rows.items() if row["refused"]] == ["moving-cap-as-printed"]
    assert "w > h slope" in rows["moving-cap-as-printed"]["refused"]
    assert rows["fixed-cap-clockwise"]["period"] == 1.0
    assert rows["frozen-mushroom"]["period"] is None
    code, out, _ = call("scenes")
    assert code == 0
    assert all(name in out for name in rows)


def test_theory_prints_decimal_strings(call):
    code, out, _ = call("theory", "moving-cap", "--digits", 25, "--json")
    values = json.loads(out)
    assert code == 0
    assert set(values) == {"p_nc", "m1", "log_e_nc", "sd", "mean_exp_minus", "mean_exp_plus"}
    assert abs(Decimal(values["m1"]) - Decimal("0.1227679649374")) < Decimal("1e-13")
    assert abs(Decimal(values["mean_exp_minus"]) - 1) < Decimal("1e-23")
    code, out, _ = call("theory", "moving-cap")
    assert code == 0
    assert values["m1"][:12] in out


def test_simulate_prints_and_saves_the_same_result(call, tmp_path):
    command = ["simulate", "moving-cap", "--particles", 40, "--energy", 1e4, "--seed", 7, "--json"]
    code, out, err = call(*command, "--out", tmp_path / "run")
    assert (code, err) == (0, "")
    summary = json.loads(out)
    assert list(summary) == [
        "particles", "collisions", "lost", "undecided", "m1", "m1_se", "p_nc", "ns_per_collision", "sha256",
    ]  # fmt: skip
    assert sorted(entry.name for entry in (tmp_path / "run").iterdir()) == ["ensemble.npz", "summary.json"]
    saved = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert saved.items() >= summary.items()
    assert saved["seed"] == 7
    assert scenes.from_data(saved["scene"]) == scenes.load("moving-cap")
    with np.load(tmp_path / "run" / "ensemble.npz") as arrays:
        assert arrays["energy"].shape == (40,)
        assert np.log(arrays["energy"] / arrays["energy0"]).mean() == pytest.approx(summary["m1"], rel=1e-12)
        assert arrays["n_collisions"].sum() == summary["collisions"]
    again = json.loads(call(*command, "--threads", 1)[1])
    assert again["sha256"] == summary["sha256"]


def test_simulate_one_particle_in_a_cap_says_what_it_cannot_know(call):
    code, out, _ = call("simulate", "breathing-circle", "--particles", 1, "--energy", 50, "--json")
    summary = json.loads(out)
    assert code == 0
    assert summary["m1_se"] is None
    assert summary["p_nc"] is None


class Links(HTMLParser):
    def __init__(self):
        super().__init__()
        self.sources, self.tags = [], []

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        self.sources += [value for name, value in attributes if name in ("src", "href", "srcset", "data")]


@pytest.fixture(scope="module")
def audited(tmp_path_factory):
    """An audit of ensembles drawn from theory: real ones take a minute."""
    folder = tmp_path_factory.mktemp("audit") / "report"
    out, err = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(out), redirect_stderr(err):
        patch.setattr(fast, "simulate", draw_ensemble)
        with pytest.raises(SystemExit) as stop:
            run(["audit", "--particles", str(N_AUDITED), "--out", str(folder), "--json"])
    return SimpleNamespace(code=stop.value.code, out=out.getvalue(), err=err.getvalue(), folder=folder)


def test_audit_meets_every_claim(audited):
    findings = json.loads(audited.out)["findings"]
    assert [finding for finding in findings if not finding["as_expected"]] == []
    assert (audited.code, audited.err) == (0, "")


def test_audit_json_is_complete(audited):
    assert sorted(entry.name for entry in audited.folder.iterdir()) == ["report.html", "report.json"]
    assert (audited.folder / "report.json").read_text("utf-8") == audited.out
    report = json.loads(audited.out)
    assert [finding["id"] for finding in report["findings"]] == [claim.id for claim in CLAIMS]
    fields = {"id", "claim", "where", "paper", "theory", "simulation", "error", "band", "verdict", "expected"}
    assert all(finding.keys() >= fields for finding in report["findings"])
    assert {"platform", "python", "numpy", "numba", "cores"} <= report["machine"].keys()
    assert report.keys() >= {"version", "seed", "particles", "wall_time_s", "simulations", "passed"}
    for simulation in report["simulations"]:
        assert simulation["followed"] + simulation["undecided"] + simulation["undefined"] == N_AUDITED
        assert re.fullmatch("[0-9a-f]{64}", simulation["sha256"])


def test_audit_page_loads_nothing_from_elsewhere(audited):
    page = (audited.folder / "report.html").read_text("utf-8")
    links = Links()
    links.feed(page)
    pictures = [source for source in links.sources if not source.startswith("#")]
    assert len(pictures) == 12
    assert not {"script", "link", "iframe", "object"} & set(links.tags)
    assert "http" not in page.replace("data:image/svg+xml", "")
    for source in pictures:
        assert source.startswith("data:image/svg+xml;base64,")
        picture = base64.b64decode(source.partition(",")[2]).decode("utf-8")
        assert all(target.startswith("#") for target in re.findall(r'href="([^"]*)"', picture))
    assert all(claim.id in page for claim in CLAIMS)


def test_audit_exits_with_1_when_a_claim_fails(call, tmp_path, monkeypatch):
    def cooled(scene, **options):
        ensemble = draw_ensemble(scene, **options)
        return ensemble._replace(energy=ensemble.energy * 0.8)

    monkeypatch.setattr(fast, "simulate", cooled)
    code, out, _ = call("audit", "--particles", N_AUDITED, "--out", tmp_path / "report")
    assert code == 1
    assert "refuted" in out
    assert "(expected:" in (tmp_path / "report" / "report.html").read_text("utf-8")
    assert json.loads((tmp_path / "report" / "report.json").read_text("utf-8"))["passed"] is False


@pytest.mark.parametrize("name", [name for name in scenes.catalogue() if name != "moving-cap-as-printed"])
def test_every_scene_can_be_drawn(call, tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    code, out, _ = call("draw", name)
    assert (code, out) == (0, f"{name}.svg\n")
    assert "</svg>" in (tmp_path / f"{name}.svg").read_text("utf-8")
    assert os.listdir(tmp_path) == [f"{name}.svg"]


@pytest.mark.parametrize(("suffix", "start"), [("png", b"\x89PNG"), ("gif", b"GIF89a")])
def test_pictures_have_the_kind_of_their_ending(call, tmp_path, suffix, start):
    path = tmp_path / f"table.{suffix}"
    assert call("draw", "untilted", "--out", path)[0] == 0
    assert path.read_bytes().startswith(start)


@pytest.mark.parametrize(
    "command", [[], *([name] for name in ("scenes", "theory", "simulate", "audit", "draw"))]
)
def test_help_has_an_example(call, command):
    code, out, _ = call(*command, "--help")
    assert code == 0
    assert "Example: mushrooms " in out


def test_version_of_the_module_run_as_a_program():
    command = [sys.executable, "-m", "mushrooms", "--version"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert re.fullmatch(r"mushrooms \d\S*\n", done.stdout)
