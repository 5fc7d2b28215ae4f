"""`mushrooms bench`: files, exit codes, bad options in one line; the page on speed shows the record."""

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
from mushrooms.reports import bench_page

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
    assert {"proof, 200 digits", "fast, lanes", "fast, pairs", "plain Python"} < names
    assert f"command {' '.join(one)}" in names
    if shutil.which("cc"):
        assert names >= {"lean C", "steps, flight/10", "steps, flight/100", "steps, flight/1000"}
        assert "baselines.c" in found.machine.compiled["lean C"]
    else:
        assert found.not_run["lean C, time steps"] == "no C compiler is installed"
    assert {p.further for p in found.points if p.solver == "fast, lanes"} == {40}
    assert {p.workload for p in found.points} == {"breathing-disk", "moving-cap-1e4"}
    assert "fast, careful" in out
    page = (tmp_path / "one" / "bench.html").read_text("utf-8")
    assert not re.search(r"(src|href)=\"(?!data:)", page)
    assert page.count("<img") == 2
    assert (tmp_path / "one" / "bench.svg").read_text("utf-8").count("moving-cap-1e4") >= 1

    # The same seed asks the same questions, so that the errors are the same to the last bit.
    monkeypatch.setattr(bench_page, "growth", lambda *_: b"<svg/>")  # drawn above
    monkeypatch.setattr(workloads, "RULES", workloads.RULES[:1])
    assert call("--quick", "--out", tmp_path / "two", "--seed", 5)[0] == 0
    again = record.read(tmp_path / "two" / "bench.json")
    errors = [{(p.workload, p.solver): p.relative for p in r.points} for r in (found, again)]
    assert all(errors[0][key] == errors[1][key] for key in errors[1])


def test_the_page_on_speed_shows_what_the_record_holds(call):
    kept = record.read(ROOT / "docs" / "bench" / "bench.json")
    text = (ROOT / "docs" / "speed.md").read_text("utf-8")
    assert kept.size == "full"
    code, table, _ = call("--table", ROOT / "docs" / "bench" / "bench.json")
    assert code == 0
    rows = [[cell.strip() for cell in line.split("|")] for line in table.splitlines()]
    shown = [row for row in rows if f"| {row[1]} | {row[2]} | {row[3]} | {row[5]} |" in text]
    assert len(shown) == 1 + text.count(" of 64 |") > 14  # the head, and every row of the page
    code, lanes, _ = call("--table", ROOT / "docs" / "bench" / "bench.json", "--workload", "all")
    assert code == 0
    rows = [[cell.strip() for cell in line.split("|")] for line in lanes.splitlines()[2:]]
    assert all(re.search(rf"\| {row[1]}: .* \| {row[2]} \| {row[4]} \|\n", text) for row in rows)
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
    """No two labels touch, none is smaller than 9 points; colours have contrast and marks."""
    kept = record.read(ROOT / "docs" / "bench" / "bench.json")
    for colour in [*bench_page.COLOURS.values(), bench_page.RED]:
        assert 1.05 / (luminance(colour) + 0.05) >= 4.5
    assert len(set(bench_page.MARKS.values())) == len(bench_page.COLOURS)
    figure = bench_page.headline(kept)
    figure.draw_without_rendering()
    boxes = [Text.get_window_extent(text) for text in figure.axes[0].texts if text.get_text()]
    assert len(boxes) == 9
    assert not any(a.overlaps(b) for k, a in enumerate(boxes) for b in boxes[:k])
    assert min(text.get_fontsize() for text in figure.findobj(Text) if text.get_text()) >= 9
