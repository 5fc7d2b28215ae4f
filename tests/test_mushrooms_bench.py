"""`mushrooms bench`: files, exit codes, bad options in one line; the page on speed shows the record."""

from __future__ import annotations

import re
import shutil
import sys
from functools import partial
from pathlib import Path

import pytest
from matplotlib.text import Text
from support.refusals import assert_refused

from conformance.bench import record, workloads
from mushrooms import bench
from mushrooms.figures import speed as figures_of_speed

ROOT = Path(__file__).parent.parent
FILES = ["bench.html", "bench.json", "bench.svg"]


@pytest.fixture(autouse=True)
def _small(monkeypatch):
    """Two workloads, and a few questions."""
    monkeypatch.setattr(workloads, "RULES", workloads.RULES[:1] + workloads.RULES[2:3])
    monkeypatch.setattr(bench, "QUESTIONS", {"quick": 2, "full": 64})
    monkeypatch.setattr(bench, "FURTHER", {"quick": 40, "full": 2000})
    monkeypatch.setattr(bench, "REPEATS", {"quick": 2})
    monkeypatch.setattr(bench, "PATHS", {"quick": (1, 4)})


@pytest.fixture
def call(command_line):
    return partial(command_line, "bench")


@pytest.mark.deep
def test_a_benchmark_is_written_whole_and_again(call, tmp_path, monkeypatch):
    one = [sys.executable, "-m", "fast"]
    code, out, err = call("--quick", "--out", tmp_path / "one", "--seed", 5, "--", *one)
    assert (code, re.sub("compiling the fast stepper .*\n", "", err)) == (0, "")
    assert sorted(p.name for p in (tmp_path / "one").iterdir()) == FILES
    found = record.read(tmp_path / "one" / "bench.json")
    assert (found.size, found.seed, found.questions) == ("quick", 5, 2)
    names = {p.solver for p in found.points}
    assert {"proof, 200 digits", "fast, lanes", "fast, pairs", "plain Python", "lean numba"} < names
    assert f"command {' '.join(one)}" in names
    if shutil.which("cc"):
        assert names >= {"lean C", "steps, flight/10", "steps, flight/100", "steps, flight/1000"}
        assert "baselines.c" in found.machine.compiled["lean C"]
    else:
        assert found.not_run["lean C, time steps"] == "no C compiler is installed"
    assert {p.further for p in found.points if p.solver in ("fast, lanes", "lean numba")} == {40}
    assert {p.workload for p in found.points} == {"breathing-disk", "moving-cap-1e4"}
    assert "fast, careful" in out
    page = (tmp_path / "one" / "bench.html").read_text("utf-8")
    assert not re.search(r"(src|href)=\"(?!data:)", page)
    assert page.count("<img") == 2
    assert (tmp_path / "one" / "bench.svg").read_text("utf-8").count("breathing-disk") >= 1

    # The same seed asks the same questions, so that the errors are the same to the last bit.
    for picture in ("speed", "growth"):  # drawn above
        monkeypatch.setattr(figures_of_speed, picture, lambda *_: b"<svg/>")
    monkeypatch.setattr(workloads, "RULES", workloads.RULES[:1])
    assert call("--quick", "--out", tmp_path / "two", "--seed", 5)[0] == 0
    again = record.read(tmp_path / "two" / "bench.json")
    errors = [{(p.workload, p.solver): p.relative for p in r.points} for r in (found, again)]
    assert all(errors[0][key] == errors[1][key] for key in errors[1])


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["--seed", "-1"], "--seed = -1"),
        (["--", "./no-such-stepper"], "no-such-stepper"),
        pytest.param(["--", sys.executable, "-c", "print(1)"], "python", marks=pytest.mark.deep),
    ],
)
def test_bad_options_are_one_line(call, monkeypatch, tmp_path, arguments, word):
    monkeypatch.chdir(tmp_path)
    assert_refused(call("--quick", *arguments), word)
    assert not list(tmp_path.iterdir())


def test_the_front_holds_only_what_nothing_beats():
    def point(name, ns, error, wrong=0, astray=0):
        return record.Point("slow", name, "compiled", 1, (ns,), 1, wrong, 0, 0, 9, astray, (1.0,), (error,))

    points = [
        point("a", 10.0, 1e-15),
        point("b", 20.0, 1e-14),
        point("c", 30.0, 1e-30),
        point("d", 1.0, 1e-40, 1),
        point("e", 2.0, 1e-40, 0, 1),
    ]
    assert figures_of_speed.pareto(points) == [(pytest.approx(15.0), 10.0), (pytest.approx(30.0), 30.0)]


def test_the_page_on_speed_shows_what_the_record_holds(call):
    kept = record.read(ROOT / "docs" / "bench" / "bench.json")
    text = (ROOT / "docs" / "speed.md").read_text("utf-8")
    assert kept.size == "full"
    code, table, _ = call("--table", ROOT / "docs" / "bench" / "bench.json")
    assert code == 0
    assert len(table.splitlines()) > 14
    assert table in text
    code, lanes, _ = call("--table", ROOT / "docs" / "bench" / "bench.json", "--workload", "all")
    assert code == 0
    assert lanes in text
    assert_refused(call("--table", "absent.json"), "absent.json")
    refused = call("--table", ROOT / "docs" / "bench" / "bench.json", "--workload", "nowhere")
    assert_refused(refused, "moving-cap-1e7")
    for name, n in kept.growth.lasts.items():
        assert f"{name}: {'over ' if n >= kept.growth.collisions else ''}{n:.0f}" in text


def luminance(colour: str) -> float:
    parts = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    red, green, blue = (c / 12.92 if c <= 0.03928 else ((c + 0.055) / 1.055) ** 2.4 for c in parts)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


@pytest.mark.deep
def test_the_kept_figure_reads_at_a_glance():
    """No two labels of a panel touch, none is smaller than 9 points; colours have contrast and marks.

    The front begins at its first point: what is right to no digit is not on it.
    """
    kept = record.read(ROOT / "docs" / "bench" / "bench.json")
    for colour in [*figures_of_speed.COLOURS.values(), figures_of_speed.RED]:
        assert 1.05 / (luminance(colour) + 0.05) >= 4.5
    assert len(set(figures_of_speed.MARKS.values())) == len(figures_of_speed.COLOURS)
    figure = figures_of_speed.speed_figure(kept)
    figure.draw_without_rendering()
    assert min(text.get_fontsize() for text in figure.findobj(Text) if text.get_text()) >= 9
    panels = [axes for axes in figure.axes if axes.lines]  # of an odd number of workloads one place is empty
    assert len(panels) == len(kept.workloads)
    for axes in panels:
        boxes = [Text.get_window_extent(text) for text in axes.texts]  # without the lines to them
        assert not any(a.overlaps(b) for k, a in enumerate(boxes) for b in boxes[:k])
        (front,) = [line for line in axes.lines if line.get_drawstyle() != "default"]
        assert min(front.get_xdata()) > figures_of_speed.LEAST_DIGITS


def test_labels_are_spread_and_no_further_than_needed():
    assert figures_of_speed.spread([0.1, 0.5, 0.9], 0.1) == pytest.approx([0.1, 0.5, 0.9])
    assert figures_of_speed.spread([0.5, 0.5, 0.5], 0.1) == pytest.approx([0.4, 0.5, 0.6])
    assert figures_of_speed.spread([0.1, 0.5, 0.52], 0.1) == pytest.approx([0.1, 0.46, 0.56])
