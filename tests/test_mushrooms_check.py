"""The commands check, ask, verify and bench: exit codes, what is printed and written, and what is refused."""

import json
import math
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import msgspec
import numpy as np
import pytest
from matplotlib.text import Text
from support.depth import deep_but
from support.faulty_servers import command
from support.pages import assert_stands_alone

import conformance
import reference
import scene as scenes
from conformance import plain, vectors
from conformance.bench import record, workloads
from conformance.harness.examples import find_compiler
from conformance.suite import pytest_suite, run as suite
from conformance.suite.checks import flows
from conformance.suite.session import Session
from mushrooms import bench, progress
from mushrooms.reports import bench_page, check_page
from scene import State
from scene.refusal import shown

PYTHON = [sys.executable, str(Path(conformance.__file__).parent / "harness" / "python" / "stepper.py")]


@pytest.fixture(autouse=True)
def _few(monkeypatch):
    """A handful of vectors of every kind, and few properties; two workloads, and a few questions."""
    found = [v for v in vectors.load("core") if v.group in ("moving-cap", "stem-trajectory", "near-corner")][
        ::6
    ]
    assert {vector.kind for vector in found} == {"step", "trajectory"}
    monkeypatch.setattr(suite, "choose", lambda *_: found)
    monkeypatch.setitem(flows.SIZES, "core", flows.Size(20, 50.0, 0.5))
    monkeypatch.setattr(suite, "TIMED_LEAST", 100_000)
    monkeypatch.setattr(progress, "FIRST", math.inf)
    monkeypatch.setattr(workloads, "RULES", workloads.RULES[:1] + workloads.RULES[2:3])
    monkeypatch.setattr(bench, "QUESTIONS", {"quick": 2, "full": 64})
    monkeypatch.setattr(bench, "FURTHER", {"quick": 40, "full": 2000})
    monkeypatch.setattr(bench, "REPEATS", {"quick": 2})
    monkeypatch.setattr(bench, "PATHS", {"quick": (1, 4)})


REPORTS = {"json": "json", "junit": "xml", "html": "html", "badge": "svg", "summary": "json"}


@pytest.mark.deep
def test_a_good_stepper_is_accepted_and_reported(command_line, tmp_path):
    files = {kind: tmp_path / f"{kind}.{ending}" for kind, ending in REPORTS.items()}
    options = [part for kind, path in files.items() for part in (f"--{kind}", path)]
    code, out, err = command_line("check", "--seed", "77", *options, "--", *PYTHON)
    assert (code, err) == (0, "")
    assert "ns per collision" in out
    assert sorted(tmp_path.iterdir()) == sorted(files.values())
    texts = {kind: path.read_text("utf-8") for kind, path in files.items()}
    data, summary = json.loads(texts["json"]), json.loads(texts["summary"])
    n = data["total"]["cases"]
    assert f"{data['total']['counts']['pass']} of {n} cases pass" in out
    assert data["implementation"]["name"] == "example-python"
    assert int(ElementTree.fromstring(texts["junit"]).get("tests")) == n
    assert re.fullmatch(r"accepted: core 1\..* seed 77", data["verdict"])
    assert all(data["verdict"] in said for said in (out.replace("\n", " "), texts["badge"]))
    ElementTree.fromstring(texts["badge"])
    assert (summary["verdict"], summary["scope"]) == ("accepted", data["scope"])
    assert {"schemaVersion", "label", "message", "color"} <= set(summary)
    page = texts["html"]
    words = ("example-python", "Worst cases", "Speed against error", "property/mirror")
    assert all(word in page for word in words)
    assert len(assert_stands_alone(page)) == page.count("<figure") >= 3


MUTANT = """
import sys
from conformance.mutants import COMMON
from scene.protocol.wire import serve
m = COMMON["wall-velocity-once"]
serve("faulty", m.step, m.trajectory, sys.stdin.buffer, sys.stdout.buffer)
"""


@pytest.mark.parametrize(
    ("stepper", "words"),
    [
        (command("honest"), ()),
        pytest.param(
            [sys.executable, "-c", MUTANT], ("like wall-velocity-once on ",), marks=pytest.mark.deep
        ),
    ],
)
def test_a_bad_stepper_is_not_and_its_fault_is_told(command_line, tmp_path, stepper, words):
    """One that keeps the protocol fails by verdict: what it gave stands beside what is certified."""
    options = ("--seed", 5, "--html", tmp_path / "r.html", "--json", tmp_path / "r.json")
    code, out, _ = command_line("check", *options, "--", *stepper)
    assert code == 1
    assert re.search(r"property/\S+ as a test, where implementation is \[.*@example\(", out, re.DOTALL)
    assert re.search(r"; mushrooms ask \S+ --seed 5 prints it\n", out)
    assert all(word in out for word in ("not accepted", "  certified collision wall=", *words))
    page = (tmp_path / "r.html").read_text("utf-8")
    assert all(word in page for word in ("Cases that failed", "What stands against it"))
    drawn = re.findall(r'<figure id="([^"]+)">', page)
    assert drawn
    assert all(f'href="#{name}"' in page for name in drawn)
    counts = json.loads((tmp_path / "r.json").read_text())["total"]["counts"]
    assert counts["fail"] > 5
    assert counts["unsupported"] >= 1  # it offers no flow, or no trajectory either
    assert counts["crashed"] == counts["wrong-format"] == counts["timed-out"] == 0


def test_a_piped_run_tells_on_stderr_how_far_it_is(command_line, monkeypatch):
    monkeypatch.setattr(progress, "FIRST", 0.0)
    monkeypatch.setattr(progress, "EVERY", 0.0)
    _, _, err = command_line("check", "--groups", "static-stem", "--", *command("honest"))
    lines = err.splitlines()
    assert len(lines) > 5
    assert all(re.fullmatch(r"check: \d+ of \d+ cases, .*(left|unknown)", line) for line in lines)


BROKEN = "import sys\nprint('[red]a line before', file=sys.stderr)\nimport no_such_module\n"
EVIL = (
    "import sys\nfor line in sys.stdin:\n"
    "    print('<script>alert(1)</script>[red]', file=sys.stderr, flush=True)\n"
    "    print('<script>alert(2)</script>', flush=True)\n"
)


LAST_WORDS = "\n  ModuleNotFoundError: No module named 'no_such_module'\n"


@pytest.mark.parametrize(
    ("stepper", "words"),
    [
        *((command(name), []) for name in ("exit-silently", "other-protocol", "fourteen-digits")),
        (
            [sys.executable, "-c", BROKEN],
            ["Its standard error ends:\n  [red]a line before\n", LAST_WORDS, "not asked: start failed"],
        ),
        ([sys.executable, "-c", EVIL], ["<script>"]),
    ],
)
def test_what_a_broken_stepper_says_is_told_as_text_in_every_report(command_line, tmp_path, stepper, words):
    """In few lines, and in the page escaped."""
    options = [part for kind in REPORTS for part in (f"--{kind}", tmp_path / f"{kind}.{REPORTS[kind]}")]
    ended = command_line("check", "--restarts", 1, *options, "--", *stepper)
    assert ended.code == 1
    assert all(word in ended.out for word in ("not accepted", *words))
    assert ended.out.count("not asked: start failed") <= 1
    assert "<script" not in (tmp_path / "html.html").read_text("utf-8")
    assert len(list(tmp_path.iterdir())) == len(REPORTS)


# Options of the pytest plugin, the exit code, and what is said of one vector.
ASKED = (["--mushrooms-command", " ".join(PYTHON)], 0, "1 passed")
NOT_ASKED = (
    (["--mushrooms-seed", "-1"], 4, "ERROR: --mushrooms-seed = -1, must be 0 to"),
    (["--mushrooms-timeout", "nan"], 4, "ERROR: --mushrooms-timeout = nan, must be above 0 seconds"),
    (["--mushrooms-timeout", "0"], 4, "ERROR: --mushrooms-timeout = 0.0, must be above 0 seconds"),
    (["--mushrooms-command", "a 'b"], 4, "ERROR: --mushrooms-command = "),
    (["--mushrooms-command", " "], 1, "give the stepper as --mushrooms-command"),
    (["--mushrooms-command", "./no-such"], 1, "command './no-such' cannot be started: No such file"),
    # It answers whenever the machine pleases, before it is asked or after; the verdict is the same.
    (["--mushrooms-command", "echo"], 1, "wrong-format: "),
)


@pytest.mark.parametrize("asked", deep_but([ASKED, *NOT_ASKED], NOT_ASKED[0]))
def test_pytest_asks_one_vector_a_test_or_says_why_not_without_a_traceback(tmp_path, asked):
    options, code, word = asked
    plugin = ["-p", "conformance.suite.pytest_plugin", "--pyargs", "conformance.suite.pytest_suite"]
    more = ["-q", "-k", "near-corner/11", "-p", "no:cacheprovider", "--rootdir", str(tmp_path)]
    line = [sys.executable, "-m", "pytest", *plugin, *more, *options]
    done = subprocess.run(line, capture_output=True, text=True, check=False, cwd=tmp_path)
    said = done.stdout + done.stderr
    assert (done.returncode, word in said) == (code, True), said
    assert "Traceback" not in said
    assert ".py:" not in said


def test_the_pytest_case_fails_and_skips_with_the_verdict():
    vector = next(vector for vector in vectors.load() if vector.kind == "step")
    with Session(command("missing-field")) as session:
        session.start()
        with pytest.raises(pytest.fail.Exception, match="wrong-format: "):
            pytest_suite.test_vector(
                session, vector, SimpleNamespace(option=SimpleNamespace(mushrooms_seed=0))
            )
        session.introduction = msgspec.structs.replace(session.introduction, tables=())
        with pytest.raises(pytest.skip.Exception, match="unsupported: table"):
            pytest_suite.test_vector(
                session, vector, SimpleNamespace(option=SimpleNamespace(mushrooms_seed=0))
            )


PLAIN = [sys.executable, "-m", "conformance.plain"]


def test_it_prints_question_answer_and_rule_or_the_vector_as_json(command_line):
    vector = next(v for v in vectors.load() if v.id == "moving-cap/3")
    code, out, err = command_line("ask", "moving-cap/3")
    assert (code, err) == (0, "")
    question = next(line for line in out.splitlines() if line.startswith("question"))
    assert json.loads(question.removeprefix("question")) == vectors.request(vector, 0)
    assert vector.rule in out
    assert f"wall={vector.expect[0].steps[0].wall!r}" in out
    assert out.endswith("verifier   proved\n")
    assert (
        msgspec.convert(command_line("ask", "moving-cap/3", "--json").data(), type=vectors.Vector).id
        == "moving-cap/3"
    )


def test_the_verifiers_word_is_about_the_vector(command_line, monkeypatch):
    later = msgspec.structs.replace(vectors.load()[0], t_end=vectors.load()[0].state.t)
    monkeypatch.setattr(vectors, "load", lambda level: (later,))
    _, out, _ = command_line("ask", later.id)
    assert "verifier   false the answer is horizon" in out


@pytest.mark.parametrize(
    ("arguments", "stepper", "word"),
    [
        (["moving-cap/3"], PLAIN, "pass: "),
        (["near-corner/9", "--seed", 4], PLAIN, "pass: "),
        (["fresh/3", "--seed", 4], PLAIN, "pass: "),  # is asked as it is
        (["moving-cap/3"], command("honest"), "fail: "),
    ],
)
def test_it_grades_a_stepper(command_line, arguments, stepper, word):
    code, out, _ = command_line("ask", *arguments, "--", *stepper)
    assert code == (word == "fail: ")
    assert word in out
    assert ("asked " in out) == ("--seed" in arguments and arguments[0] != "fresh/3")


START = State(0.0, 0.1, 0.2, 3.0, 4.0)


FIELDS = ("t", "x", "y", "vx", "vy", "wall")


def as_csv(states):
    """Return states as a file of rows."""
    rows = [",".join("" if state[name] is None else str(state[name]) for name in FIELDS) for state in states]
    return "\n".join([",".join(FIELDS), *rows])


def test_a_right_trajectory_is_proved_and_a_false_step_is_drawn(tmp_path, command_line):
    """As rows beside the name of a scene, and in the form that the verifier takes."""
    path, picture = tmp_path / "steps.csv", tmp_path / "false.svg"
    cap = scenes.load("moving-cap")
    states = [
        {name: getattr(one, name) for name in FIELDS}
        for one in (START, *plain.trajectory(cap, START, 4, 1e9))
    ]
    scene = {name: law for name, law in scenes.to_data(cap).items() if name not in ("name", "notes")}
    whole = tmp_path / "steps.json"
    whole.write_text(json.dumps({"scene": scene, "state": states[0], "steps": states[1:]}))
    path.write_text(as_csv(states))
    arguments = ("verify", path, "--scene", "moving-cap", "--picture", picture)
    for words in (arguments, ("verify", whole)):
        code, out, _ = command_line(*words)
        assert code == 0
        assert out.splitlines()[-1] == "4 of 4 agree within 9.01e+06 backward ulps, 0 false, 0 open"
    assert not picture.exists()
    path.write_text(as_csv([*states[:2], {**states[2], "x": states[2]["x"] + 0.01}]))
    code, out, _ = command_line(*arguments)
    assert (code, "step 2: false" in out) == (1, True)
    assert (
        f"step 2: x = {states[2]['x'] + 0.01:.10g}, must be {states[2]['x']:.10g}: off by 0.01"
        in picture.read_text()
    )
    lines_of_json = tmp_path / "steps.jsonl"
    rows = [{"scene": scene, "state": states[0]}, *states[1:]]
    lines_of_json.write_text("\n".join(map(json.dumps, rows)))
    for options, expected in ((("--all", "--within", "1e6"), 0), (("--within", "0"), 1)):
        code, out, _ = command_line("verify", lines_of_json, *options)
        assert (code, " agree within " in out) == (expected, True)


@pytest.mark.parametrize("outcome", [scenes.Undecided("shy"), scenes.Undefined("corner")])
def test_a_false_step_without_a_certified_end_is_not_drawn(tmp_path, command_line, monkeypatch, outcome):
    """The verifier may refuse a step that the reference cannot end."""
    cap = scenes.load("moving-cap")
    [hit] = plain.trajectory(cap, START, 1, 1e9)
    row = {name: getattr(hit, name) for name in FIELDS}
    scene = {name: law for name, law in scenes.to_data(cap).items() if name not in ("name", "notes")}
    state = {name: getattr(START, name) for name in FIELDS}
    path, picture = tmp_path / "steps.json", tmp_path / "false.svg"
    path.write_text(json.dumps({"scene": scene, "state": state, "steps": [{**row, "x": row["x"] + 0.01}]}))
    monkeypatch.setattr(reference, "next_collision", lambda *_: outcome)
    code, _, err = command_line("verify", path, "--picture", picture)
    assert (code, picture.exists()) == (2, False)
    assert err == f"mushrooms: --picture: step 1 from {shown(str(START))} has no certified end to draw\n"


def test_a_wall_that_is_missing_from_a_table_is_named(tmp_path, command_line):
    path = tmp_path / "steps.csv"
    path.write_text("t,x,y,vx,vy\n0,0.1,0.2,3,4\n1,0,0,0,1\n")
    code, out, err = command_line("verify", path, "--scene", "moving-cap")
    assert (code, out, "column 'wall' is missing" in err) == (2, "", True)


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("x", lambda x: x + 1e-4, "off by 0.0001"),
        ("vy", lambda vy: vy * (1 + 1e-4), "vy = "),
        ("t", lambda t: t * (1 + 1e-4), "t = "),
        ("wall", lambda wall: "base" if wall == "arc" else "arc", "wall = "),
    ],
)
def test_the_picture_of_a_false_step_shows_what_is_off(name, change, words):
    """The close-up is as large as the distance, so that two ends are two points."""
    [truth] = plain.trajectory(scenes.load("moving-cap"), START, 1, 1e9)
    given = {field: getattr(truth, field) for field in FIELDS}
    given[name] = change(given[name])
    figures = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(check_page.plots, "svg", figures.append)
        check_page.draw_step(scenes.load("moving-cap"), START, truth, given, "step 7")
    [figure] = figures
    title = figure.get_suptitle()
    assert title.startswith(f"step 7: {name} = ")
    assert words in title
    if name == "x":
        left, right = figure.axes[1].get_xlim()
        assert 2e-4 < right - left < 8e-4
        assert left < min(truth.x, given["x"]) < max(truth.x, given["x"]) < right
        points = np.hstack([line.get_data() for line in figure.axes[1].lines if len(line.get_xdata()) > 100])
        assert np.hypot(points[0] - truth.x, points[1] - truth.y).min() < 2e-5  # the arc goes through the hit


ROOT = Path(__file__).parent.parent
FILES = ["bench.html", "bench.json", "bench.svg"]


@pytest.mark.deep
def test_a_benchmark_is_written_whole_and_again(command_line, tmp_path, monkeypatch):
    one = [sys.executable, "-m", "fast"]
    code, out, err = command_line("bench", "--quick", "--out", tmp_path / "one", "--seed", 5, "--", *one)
    assert (code, re.sub("compiling the fast stepper .*\n", "", err)) == (0, "")
    assert sorted(p.name for p in (tmp_path / "one").iterdir()) == FILES
    found = record.read(tmp_path / "one" / "bench.json")
    assert (found.size, found.seed, found.questions) == ("quick", 5, 2)
    names = {p.solver for p in found.points}
    assert {"proof, 200 digits", "fast, lanes", "fast, pairs", "plain Python"} < names
    assert f"command {' '.join(one)}" in names
    if find_compiler("C"):
        assert names >= {"lean C", "steps, flight/10", "steps, flight/100", "steps, flight/1000"}
        assert "baselines.c" in found.machine.compiled["lean C"]
    else:
        assert found.not_run["lean C, time steps"] == "no C compiler is installed"
    assert {p.further for p in found.points if p.solver == "fast, lanes"} == {40}
    assert {p.workload for p in found.points} == {"breathing-disk", "moving-cap-1e4"}
    assert "fast, careful" in out
    page, picture = ((tmp_path / "one" / name).read_text("utf-8") for name in ("bench.html", "bench.svg"))
    assert not re.search(r"(src|href)=\"(?!data:)", page)
    assert page.count("<img") == 2
    assert "moving-cap-1e4" in picture

    # The same seed asks the same questions, so that the errors are the same to the last bit.
    monkeypatch.setattr(bench_page, "growth", lambda *_: b"<svg/>")  # drawn above
    monkeypatch.setattr(workloads, "RULES", workloads.RULES[:1])
    assert command_line("bench", "--quick", "--out", tmp_path / "two", "--seed", 5)[0] == 0
    again = record.read(tmp_path / "two" / "bench.json")
    errors = [{(p.workload, p.solver): p.relative for p in r.points} for r in (found, again)]
    assert all(errors[0][key] == errors[1][key] for key in errors[1])


def test_the_page_on_speed_shows_what_the_record_holds(command_line):
    path, text = ROOT / "docs/bench/bench.json", (ROOT / "docs/speed.md").read_text("utf-8")
    assert record.read(path).size == "full"
    steppers, lanes = (
        [
            [cell.strip() for cell in line.split("|")]
            for line in command_line("bench", "--table", path, *more).out.splitlines()
        ]
        for more in ((), ("--workload", "all"))
    )
    shown = [row for row in steppers if f"| {row[1]} | {row[2]} | {row[3]} | {row[5]} |" in text]
    assert len(shown) == 1 + text.count(" of 64 |") > 14  # the head, and every row of the page
    assert all(re.search(rf"\| {row[1]}: .* \| {row[2]} \| {row[4]} \|\n", text) for row in lanes[2:])


def luminance(colour: str) -> float:
    parts = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    red, green, blue = (c / 12.92 if c <= 0.03928 else ((c + 0.055) / 1.055) ** 2.4 for c in parts)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


@pytest.mark.deep
def test_the_kept_figure_reads_at_a_glance():
    """No two labels touch, none is smaller than 9 points; colours have contrast and marks."""
    kept = record.read(ROOT / "docs" / "bench" / "bench.json")
    for colour in bench_page.COLOURS.values():
        assert 1.05 / (luminance(colour) + 0.05) >= 4.5
    assert len(set(bench_page.MARKS.values())) == len(bench_page.COLOURS)
    figure = bench_page.headline(kept)
    figure.draw_without_rendering()
    boxes = [Text.get_window_extent(text) for text in figure.axes[0].texts if text.get_text()]
    assert len(boxes) == 9
    assert not any(a.overlaps(b) for k, a in enumerate(boxes) for b in boxes[:k])
    assert min(text.get_fontsize() for text in figure.findobj(Text) if text.get_text()) >= 9
