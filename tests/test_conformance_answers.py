"""`verify.py --answers`: paths in floating point, each step judged from the state before it."""

import json
import math
from collections.abc import Callable
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from conformance import plain, verify
from conformance.cases.draw import wire_form
from scene import Scene, State, from_data, load

FIELDS = (*verify.FIELDS, "wall")
CAP: dict[str, Any] = {"table": "cap", "r": 1.0}
DOWN = {"t": 0, "x": 0, "y": 0.5, "vx": 0, "vy": -1.0}
UP = {"t": 0.5, "x": 0, "y": 0, "vx": 0, "vy": 1.0, "wall": "base"}
ASIDE = {"t": 0.0, "x": 0.0, "y": 0.5, "vx": 0.75, "vy": 1.0}
ARC = {
    "t": 0.4431513611335565, "x": 0.3323635208501674, "y": 0.9431513611335565,
    "vx": -0.042636479149832596, "vy": -1.2492726406376256, "wall": "arc",
}  # fmt: skip
LATE = {**DOWN, "t": 0.25, "y": 0.25, "wall": None}
FALLING = {**DOWN, "t": -0.5}
TINY = {"table": "cap", "r": 2.0**-130}
TINY_DOWN = {**DOWN, "y": 2.0**-131, "vy": -(2.0**-130)}
# At a third of a period the cosine is -1/2, which no precision shows: the start lies on the left side.
SWELLING = {"table": "stem", "w": {"kind": "fourier", "mean": 1.0, "period": 1.5, "cos": [0.25]}, "h": 1.0}
SWOLLEN_START = {**DOWN, "t": 0.5, "x": -0.875, "y": -0.5}
Step = dict[str, Any]
Change = Callable[[Step], Step]


def question(state: Step, *steps: Any, scene: Any = CAP, **more: Any) -> Step:
    """Return a path as a file has it."""
    return {"scene": scene, "state": state, "steps": list(steps), **more}


def without(step: Step, name: str, **more: Any) -> Step:
    """Return a step without a field, and with others."""
    return {key: value for key, value in step.items() if key != name} | more


ROWS: dict[str, tuple[Step, int, str]] = {
    "exact": (question(DOWN, UP), 0, "1 of 1 agree"),
    "rounded": (question(ASIDE, ARC), 0, "1 of 1 agree"),
    "horizon": (question(DOWN, LATE, t_end=0.25), 0, "1 of 1 agree"),
    "horizon by its outcome": (
        question(DOWN, without(LATE, "wall", outcome="horizon"), t_end=0.25), 0, "1 of 1 agree",
    ),
    "dt given": (question(DOWN, {**UP, "dt": 0.5, "outcome": "collision"}), 0, "1 of 1 agree"),
    "dt wrong": (question(DOWN, {**UP, "dt": 0.5000001}), 1, "step 1: false: base, dt within"),
    "time wrong": (question(ASIDE, {**ARC, "t": 0.4431515}), 1, "step 1: false: arc, "),
    "another wall": (question(ASIDE, {**ARC, "wall": "base"}), 1, "arc is met first, not base"),
    "the second": (question(ASIDE, ARC, {**ARC, "t": 2.4}), 1, "step 2: false: base is met first"),
    "units": (
        question(TINY_DOWN, {**UP, "x": 2.0**-131, "vy": 2.0**-130}, scene=TINY), 1, "step 1: false",
    ),
    "at time 0": (question(FALLING, {**UP, "t": 0.0, "x": 1e-16}), 0, "1 of 1 agree"),
    "a number is infinite": (question(DOWN, {**UP, "t": math.inf}), 1, "false: t = inf is no finite number"),
    "a number is none": (question(DOWN, {**UP, "x": math.nan}), 1, "false: x = nan is no finite number"),
    "a number is a text": (question(DOWN, {**UP, "vx": "0"}), 1, "false: vx = '0' is no finite number"),
    "no wall": (question(DOWN, without(UP, "wall")), 1, "false: wall is missing"),
    "no vx": (question(DOWN, without(UP, "vx")), 1, "false: vx is missing"),
    "a field misspelt": (question(DOWN, without(UP, "vx", Vx=0)), 1, "false: Vx is an unknown field"),
    "outcome against wall": (
        question(DOWN, {**UP, "outcome": "horizon"}), 1, "outcome and wall contradict each other",
    ),
    "no object": (question(DOWN, 5), 1, "false: the step is no object"),
    "no scene": (question(DOWN, scene={"table": "cap", "r": -1.0}), 2, "r breaks its bound"),
    "no steps": (without(question(DOWN), "steps"), 2, "there is no step to judge"),
    "no step": (question(DOWN), 2, "there is no step to judge"),
    "a start outside": (question({**DOWN, "y": -1.0}, UP), 1, "step 1: open: the state is beyond a wall"),
    "a start without x": (question(without(DOWN, "x"), UP), 2, "a state has t, x, y, vx, vy"),
    "an unknown field": (question(DOWN, UP, tend=0.25), 2, "'tend'] is an unknown field of a path"),
    "a start that no precision decides": (
        question(SWOLLEN_START, UP, scene=SWELLING), 1, "step 1: open: whether the state is on wall left",
    ),
    "a late clock that stands still": (
        question({**DOWN, "t": 2.0**30}, {**UP, "t": 2.0**30, "dt": 0.5}), 1, "false: t does not grow",
    ),
    "a corner": (
        question({**DOWN, "x": 1.0, "y": 0.0, "wall": "base"}, UP), 1, "step 1: open: the motion has no next",
    ),
}  # fmt: skip


def judge_text(text: str, tmp_path: Path, capsys: Any, *options: str, name: str = "steps.json") -> Any:
    """Return exit code, standard output and standard error for a file."""
    path = tmp_path / name
    path.write_text(text, "utf-8")
    code = verify.main(["--answers", *options, str(path)])
    return (code, *capsys.readouterr())


@pytest.mark.parametrize("row", ROWS.values(), ids=ROWS)
def test_a_path_is_judged(row, tmp_path, capsys):
    data, code, words = row
    found, out, err = judge_text(json.dumps(data), tmp_path, capsys)
    assert found == code
    assert words in (err if code == 2 else out)
    assert err.count("\n") == (code == 2)
    assert "proved" not in out


@cache
def path_of(name: str, n: int, change: Change | None = None, begin: State | None = None) -> tuple[Any, ...]:
    """Return scene, start and n steps of the plain stepper, each from the answer before it.

    Args:
        name: of the catalogue, or of a static cap ("static").
        n: number of steps.
        change: what is done to each answer.
        begin: the start.
    """
    scene: Scene = from_data(CAP) if name == "static" else load(name)
    state = begin or State(0.0, 0.1, 0.2, 3.0, 4.0)
    start = {field: getattr(state, field) for field in FIELDS}
    steps = []
    for _ in range(n):
        found = plain.next_collision(scene, state, 1e300)
        step = {field: getattr(found, field) for field in FIELDS}
        step = change(step) if change else step
        steps.append(step)
        state = State(**step)
    return wire_form(scene), start, steps


def judge_path(path: tuple[Any, ...], tmp_path: Path, capsys: Any, *options: str) -> Any:
    """Return exit code, standard output and standard error for a path as JSON."""
    scene, start, steps = path
    text = json.dumps({"scene": scene, "state": start, "steps": steps})
    return judge_text(text, tmp_path, capsys, *options)


def scale(factor: float, *names: str) -> Change:
    """Return a change of an answer: some numbers are multiplied."""
    return lambda step: {**step, **{name: step[name] * factor for name in names}}


def shift(by: float, name: str) -> Change:
    """Return a change of an answer: a number is greater by a constant."""
    return lambda step: {**step, name: step[name] + by}


N = 40
FAST = State(1e6, 0.0, 0.25, 6e3, 8e3)
FASTER_BY_1E_10 = scale(1 + 1e-10, "vx", "vy")
SHIFTED = shift(1e-12, "vx")
BIASES = {
    "every velocity grows": ("moving-cap", FASTER_BY_1E_10, ("vx", "outward"), ("vy", "outward")),
    "every velocity grows, static": ("static", FASTER_BY_1E_10, ("vx", "outward"), ("vy", "outward")),
    "a constant in vx": ("static", SHIFTED, ("vx", "signed")),
    "a clock that is early": ("static", shift(-1e-11, "t"), ("dt", "signed")),
}


@pytest.mark.parametrize("row", BIASES.values(), ids=BIASES)
def test_a_bias_over_a_path_is_said(row, tmp_path, capsys):
    """Each step agrees; that all are wrong in the same direction is told beside that."""
    name, change, *expected = row
    code, out, _ = judge_path(path_of(name, N, change), tmp_path, capsys)
    assert code == 0
    for number, kind in expected:
        assert any(line.startswith(f"bias: {number} ") and kind in line for line in out.splitlines())


@pytest.mark.parametrize("name", ["moving-cap", "static"])
def test_no_bias_is_said_of_rounding(name, tmp_path, capsys):
    code, out, _ = judge_path(path_of(name, N), tmp_path, capsys)
    assert (code, "bias" in out) == (0, False)
    assert f"{N} of {N} agree within 9.01e+06 backward ulps, 0 false, 0 open" in out


def test_an_error_may_be_bounded_by_ulps(tmp_path, capsys):
    path = path_of("moving-cap", 4, FASTER_BY_1E_10)
    for options, expected in (((), 0), (("--within", "1e7"), 0), (("--within", "1000"), 1)):
        code, out, _ = judge_path(path, tmp_path, capsys, *options)
        assert code == expected
        assert ("step 1: false: " in out) == (expected == 1)


def stop_clock(step: Step) -> Step:
    """Return an answer at the time of the start."""
    return {**step, "t": FAST.t}


def slow_clock(step: Step) -> Step:
    """Return an answer after a millionth of the flight."""
    return {**step, "t": FAST.t + (step["t"] - FAST.t) * 2**-16}


@pytest.mark.parametrize("change", [stop_clock, slow_clock])
@pytest.mark.parametrize("name", ["static", "moving-cap"])
def test_a_clock_that_stands_still_is_false(name, change, tmp_path, capsys):
    """An error of all of dt is 1e-10 of t here."""
    code, out, _ = judge_path(path_of(name, 1, change, FAST), tmp_path, capsys)
    assert (code, "step 1: false: " in out) == (1, True)


@pytest.mark.parametrize("name", ["static", "moving-cap"])
def test_the_last_place_of_a_late_time_is_no_error(name, tmp_path, capsys):
    for ticks in (-1, 0, 1):
        change = shift(ticks * math.ulp(FAST.t), "t")
        code, _, _ = judge_path(path_of(name, 3, change, FAST), tmp_path, capsys)
        assert code == 0


def false_at(places: tuple[int, ...]) -> tuple[Any, ...]:
    """Return a path that is wrong at some places, and right from each answer to the next otherwise."""
    scene, start, steps = path_of("static", 6)
    changed = [{**step, "x": step["x"] * 1.0001} if k in places else step for k, step in enumerate(steps)]
    return scene, start, changed


def test_the_first_false_step_ends_it_unless_all_are_asked(tmp_path, capsys):
    path = false_at((1, 4))
    code, out, _ = judge_path(path, tmp_path, capsys)
    assert code == 1
    assert out.count(": false: ") == 1
    assert out.splitlines()[-1] == "stopped at the first false step; --all judges the others, too"
    code, out, _ = judge_path(path, tmp_path, capsys, "--all")
    assert code == 1
    false = {line.split(": ")[1] for line in out.splitlines() if ": false: " in line}
    assert {"step 2", "step 5"} <= false
    assert " of 6 agree" in out.splitlines()[-1]


def test_a_step_after_one_that_cannot_be_read_is_open(tmp_path, capsys):
    for unreadable in (5, {"wall": "base"}):
        text = json.dumps(question(DOWN, unreadable, UP, UP))
        code, out, _ = judge_text(text, tmp_path, capsys, "--all")
        assert (code, "step 2: open: the step before cannot be read" in out) == (1, True)


def test_the_worst_step_is_named(tmp_path, capsys):
    scene, start, steps = path_of("static", 6)
    wrong = [*steps[:3], {**steps[3], "vx": steps[3]["vx"] * (1 + 1e-12)}]
    _, out, _ = judge_path((scene, start, wrong), tmp_path, capsys)
    row = next(line for line in out.splitlines() if line.startswith("vx"))
    assert row.endswith("step 4")


def as_lines(path: tuple[Any, ...]) -> str:
    scene, start, steps = path
    return "\n".join(map(json.dumps, [{"scene": scene, "state": start}, *steps]))


def as_table(path: tuple[Any, ...]) -> str:
    _, start, steps = path
    rows = [["" if row[name] is None else str(row[name]) for name in FIELDS] for row in (start, *steps)]
    return "\n".join(map(",".join, [FIELDS, *rows]))


def test_json_lines_and_tables_are_read_too(tmp_path, capsys):
    path = path_of("moving-cap", 6)
    scene = tmp_path / "scene.json"
    scene.write_text(json.dumps(path[0]))
    _, expected, _ = judge_path(path, tmp_path, capsys)
    assert judge_text(as_lines(path), tmp_path, capsys, name="a.jsonl") == (0, expected, "")
    table = judge_text(as_table(path), tmp_path, capsys, "--scene", str(scene), name="a.csv")
    assert table == (0, expected, "")


def test_a_table_takes_its_horizon_from_an_option(tmp_path, capsys):
    scene = tmp_path / "scene.json"
    scene.write_text(json.dumps(CAP))
    text = "t,x,y,vx,vy,wall\n0,0,0.5,0,-0x1p0,\n# halfway\n0.25,0,0.25,0,-1,\n"
    for options, expected in (((), 1), (("--t-end", "0.25"), 0)):
        code, _, _ = judge_text(text, tmp_path, capsys, "--scene", str(scene), *options, name="a.csv")
        assert code == expected


TABLES = {
    "no scene": ((), "t,x,y,vx,vy,wall\n0,0,1,0,0,", 2, "--scene goes with each CSV file"),
    "no wall": (("--scene",), "t,x,y,vx,vy\n0,0,1,0,0", 2, "a.csv:1: column ['wall'] is missing"),
    "misspelt": (("--scene",), "t,x,y,vx,vy,Wall,wall\n", 2, "a.csv:1: column ['Wall'] is unknown"),
    "short": (("--scene",), "t,x,y,vx,vy,wall\n0,0,1,0,0", 2, "a.csv:2: 5 cells, must be 6"),
    "no number": (
        ("--scene",), "t,x,y,vx,vy,wall\n0,0,.5,0,-1,\n0.5,0,0,0,one,base", 1, "vy = 'one' is no finite",
    ),
}  # fmt: skip


def test_a_table_that_is_no_text_is_told_by_line(tmp_path, capsys):
    scene, path = tmp_path / "scene.json", tmp_path / "a.csv"
    scene.write_text(json.dumps(CAP))
    path.write_bytes(b"t,x,y,vx,vy,wall\n0,0,0.5,0,-1,\n\xff,0,0,0,0,base\n")
    assert verify.main(["--answers", "--scene", str(scene), str(path)]) == 2
    assert "a.csv:3: this is no UTF-8" in capsys.readouterr()[1]


@pytest.mark.parametrize("row", TABLES.values(), ids=TABLES)
def test_a_bad_table_is_told_by_place_and_column(row, tmp_path, capsys):
    options, text, expected, words = row
    scene = tmp_path / "scene.json"
    scene.write_text(json.dumps(CAP))
    more = [*options, str(scene)] if options else []
    code, out, err = judge_text(text, tmp_path, capsys, *more, name="a.csv")
    assert (code, words in out + err) == (expected, True)


def test_a_line_that_cannot_be_read_has_a_number(tmp_path, capsys):
    text = as_lines(path_of("static", 3)) + "\n{"
    code, _, err = judge_text(text, tmp_path, capsys, name="a.jsonl")
    assert (code, "a.jsonl:5: " in err, err.count("\n")) == (2, True, 1)


def test_progress_is_told_on_standard_error(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(verify, "PULSE", -1)
    _, out, err = judge_path(path_of("static", 3), tmp_path, capsys)
    assert [" 1 steps judged" in err, " 3 steps judged" in err, "judged" in out] == [True, True, False]


def test_a_wall_that_is_as_near_is_left_open(tmp_path, capsys):
    """The particle meets the right side and the floor within rounding; both answers are right."""
    scene = {"table": "stem", "w": 1.0, "h": 1.0}
    start = {"t": 0.0, "x": 0.5, "y": -0.5, "vx": 0.5, "vy": -0.5 * (1 - 2**-53), "wall": None}
    step = {"t": 1.0, "x": 1.0, "y": -1.0, "vx": 0.5, "vy": 0.5, "wall": "floor"}
    code, out, _ = judge_text(json.dumps(question(start, step, scene=scene)), tmp_path, capsys)
    assert (code, "step 1: open: which wall is first hangs on" in out) == (1, True)
    far = {**start, "vy": -0.49}
    code, out, _ = judge_text(json.dumps(question(far, step, scene=scene)), tmp_path, capsys)
    assert "right is met first, not floor" in out


def test_the_unit_of_errors_is_that_of_the_definition():
    """Against the sum of changes by finite differences, of proved steps from starts that are moved."""
    for name, begin in (("moving-cap", None), ("static", None), ("moving-cap", FAST)):
        wire, start, steps = path_of(name, 12, None, begin)
        scene = verify.read_scene(wire, [verify.WORK])
        for before in (start, *steps[:-1]):
            state = verify.read_state(scene, before)
            truth = verify.find_truth(scene, state, Fraction(10) ** 300)
            changes = dict.fromkeys(verify.NUMBERS, Fraction(0))
            for field in verify.FIELDS:
                moved = state._replace(**{field: getattr(state, field) * (1 + verify.UNIT)})
                other = verify.find_truth(scene, moved, Fraction(10) ** 300)
                for place, number in enumerate(verify.NUMBERS):
                    changes[number] += abs(other.numbers[place] - truth.numbers[place])
            sizes = verify.measure_sizes(truth, state)
            dt = verify.UNIT * truth.numbers[0] + changes["dt"]
            speed = max(verify.UNIT * abs(truth.numbers[k]) + changes[v] for k, v in ((3, "vx"), (4, "vy")))
            assert abs(sizes["dt"] / dt - 1) < 1e-6
            assert abs(sizes["vx"] / speed - 1) < 1e-6
