"""Questions and answers in files: graded as a dialogue is; answers to other questions are refused."""

import csv
import io
import json
import subprocess

import msgspec
import pytest
from support.depth import deep_but
from support.faulty_steppers import answers_to
from support.refusals import assert_refused
from support.runnable import runnable

from conformance import plain, vectors
from conformance.harness.examples import FOLDER, compiled, find_examples
from conformance.suite import run as suite, sheet as sheets
from conformance.suite.checks import flows
from conformance.suite.process import CheckFailure
from conformance.suite.session import Limits
from scene import BadInput

SEED = 5
ALL_CHECKS = dict(sheets.CHECKS)


# Enough to see every profile and every kind of check; which of them hang on no answer is asked of all.
SOME = (
    "property/mirror",
    "promise/hits",
    "promise/endings",
    *(f"profile/{name}" for name in ("work-identity", "mean-growth")),
)


@pytest.fixture(autouse=True, scope="module")
def _few():
    """A handful of vectors of every kind, few checks, small ensembles; fresh questions take long to prove."""
    groups = ("moving-cap", "stem-trajectory", "flow-brief", "near-corner")
    groups += ("static-cap", "generated-cap", "generated-cap-trajectory")
    found = [v for v in vectors.load("core") if v.group in groups][::2]
    assert {vector.kind for vector in found} == {"step", "trajectory", "flow"}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(suite, "choose", lambda *_: found)
        patch.setattr(suite, "N_FRESH", dict.fromkeys(suite.N_FRESH, 1))
        patch.setattr(sheets, "CHECKS", {name: sheets.CHECKS[name] for name in SOME})
        patch.setitem(flows.SIZES, "core", flows.Size(20, 50.0, 0.5))
        yield


@pytest.fixture(scope="module")
def sheet():
    return sheets.Sheet("core", SEED)


@pytest.mark.parametrize("name", deep_but(list(ALL_CHECKS), "property/mirror", "promise/endings"))
def test_questions_in_files_hang_on_no_answer(name, sheet, tmp_path, monkeypatch):
    seen = []

    def noted(verdict, why):
        seen.append(why)
        return CheckFailure(verdict, why)

    monkeypatch.setattr(sheets, "CHECKS", {name: ALL_CHECKS[name]})
    monkeypatch.setattr(sheets, "CheckFailure", noted)
    monkeypatch.setattr(suite, "choose", lambda *_: [])
    alone = sheets.Sheet("core", SEED, [])
    run = graded(alone, tmp_path, answered(b"\n".join(alone.lines()), off_by(2.0**-50)))
    assert [result.id for result in run.results[3:]] == [name]
    assert not [why for why in seen if "hangs on an answer" in why]


def answered(lines: bytes, step=plain.next_collision) -> bytes:
    """Answer a file of questions as a program does that reads standard input."""
    return answers_to(
        lines.splitlines(keepends=True),
        step,
        lambda *asked: plain.trajectory(*asked, step),
        flow=lambda *asked: plain.flow(*asked, step),
    )


def off_by(part):
    """Return the plain stepper with vx off by a part; what goes on from its answer is another question."""

    def step(scene, state, t_end):
        found = plain.next_collision(scene, state, t_end)
        return msgspec.structs.replace(found, vx=found.vx * (1 + part)) if hasattr(found, "vx") else found

    return step


def graded(sheet, tmp_path, content: bytes, name: str = "answers.jsonl"):
    path = tmp_path / name
    path.write_bytes(content)
    return sheets.grade_answers(sheet, sheets.read_answers(path))


def test_what_comes_back_has_the_verdict_of_a_dialogue(sheet, tmp_path, tally):
    command = runnable(find_examples(tmp_path)["C"])
    questions = b"\n".join(sheet.lines())
    done = subprocess.run(command, input=questions, capture_output=True, check=True)
    run = graded(sheet, tmp_path, done.stdout)
    chosen = [*sorted({v.group for v in sheet.chosen}), "fresh", "property"]
    there = suite.check(command, seed=SEED, groups=chosen, limits=Limits(timeout=60.0))
    verdicts = {result.id: result.verdict for result in there.results}
    partly = {name for name, profiles in sheets.CHECKS.items() if len(profiles) < 3}
    same = {r.id: r.verdict for r in run.results if r.id in verdicts and r.id not in partly}
    assert same == {name: verdicts[name] for name in same}
    assert (run.exit_code(), there.exit_code()) == (0, 0)
    assert len(same) > 60
    assert run.scope().tables == there.scope().tables
    assert all(name in str(run.scope()) for name in sheets.NOT_IN_FILES)
    tally["cases with the same verdict"] = len(same)


def test_the_example_in_fortran_is_accepted_for_caps(sheet, tmp_path):
    command = runnable(compiled("Fortran", ["-O2"], FOLDER / "fortran" / "caps.f90", tmp_path / "caps"))
    sheets.write_tables(sheet, tmp_path)
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, check=True)
    run = graded(sheet, tmp_path, done.stdout, "answers.csv")
    assert run.objections() == []
    assert (run.scope().tables, run.scope().profiles) == (["cap"], ["step", "trajectory"])
    assert run.precision() in ("A", "B")


def test_wrong_answers_fail_and_missing_ones_are_declined(sheet, tmp_path):
    lines = b"\n".join(sheet.lines())
    run = graded(sheet, tmp_path, answered(lines, off_by(1e-6)))
    wrong = {result.group for result in run.results if result.verdict == "fail"}
    assert {"moving-cap", "stem-trajectory", "flow-brief", "promise"} <= wrong
    assert run.exit_code() == 1
    first, *_, last = sheet.questions.values()
    kept = [line for line in answered(lines).splitlines() if f'"seq":{first.seq},' not in line.decode()]
    by_case = {result.id: result for result in graded(sheet, tmp_path, b"\n".join(kept)).results}
    assert (by_case[first.case].verdict, by_case[last.case].verdict) != ("pass", "declined")
    assert by_case[first.case].verdict == "declined"
    assert str(first.seq) in by_case[first.case].why


@pytest.mark.parametrize("form", deep_but(["decimal", "hexadecimal", "fortran"], "hexadecimal", "fortran"))
def test_csv_answers_are_graded_alike(sheet, tmp_path, form):
    spell = {"decimal": repr, "hexadecimal": float.hex, "fortran": lambda x: f"{x:.17E}".replace("E", "D")}[
        form
    ]
    names, table = [*sheets.NEEDED, *sheets.OPTIONAL], io.StringIO()
    writer = csv.DictWriter(table, names, extrasaction="ignore")
    writer.writeheader()
    for line in answered(b"\n".join(sheet.lines())).splitlines():
        data = json.loads(line)
        for part in data.get("steps", data.get("states", [data])) if "seq" in data else []:
            part |= dict(zip(("t_in", "t_out"), part.get("captured") or (), strict=False))
            cells = {name: spell(cell) if isinstance(cell, float) else cell for name, cell in part.items()}
            writer.writerow({**cells, "seq": data["seq"]})
    run = graded(sheet, tmp_path, table.getvalue().encode(), "answers.csv")
    assert {r.verdict for r in run.results} <= {"pass", "declined", "unsupported"}
    assert [r.id for r in run.results if r.level and r.verdict != "pass"] == []


def test_csv_questions_hold_what_the_lines_hold(sheet, tmp_path):
    n = sheets.write_tables(sheet, tmp_path)
    names = (tmp_path / sheets.INDEX).read_text().split()
    rows = {}
    for name in names:
        scene, *table = (tmp_path / name).read_text().split("seq,")
        assert scene.startswith("# table ")
        rows |= {line.split(",")[0]: line for line in table[0].splitlines()[1:]}
    assert n == len(sheet.questions) - 1
    assert set(rows) == {str(q.seq) for q in sheet.questions.values() if q.case != sheets.REJECTS}
    assert sheets.read_key(tmp_path).questions.keys() == sheet.questions.keys()


LINE = '{"seq":%d,"outcome":"undecided","reason":"x"}\n'
HEADER = "seq,outcome,t,x,y,vx,vy\n"
ROW = "1,collision,1,0,0,1,1\n"
BAD_ANSWERS = {
    "empty": ("a.jsonl", "", "holds no answer"),
    "no json": ("a.jsonl", "yes\n", "a.jsonl':1: has no seq, must have that of its question: yes"),
    "no seq": ("a.jsonl", "{}\n", "has no seq"),
    "a list": ("a.jsonl", "[1]\n", "has no seq"),
    "twice": ("a.jsonl", LINE % 7 + LINE % 7, "a.jsonl':2: seq = 7 is answered twice, first at 1"),
    "header only": ("a.csv", HEADER, "holds no answer"),
    "no header": ("a.csv", ROW, "column 'seq' is missing"),
    "no vy": ("a.csv", HEADER.replace(",vy", "") + ROW, "column 'vy' is missing"),
    "x twice": ("a.csv", HEADER.replace("y,", "x,"), "column 'y' is missing"),
    "unknown": ("a.csv", HEADER.replace("vy", "vy,colour"), "column 'colour' is unknown"),
    "short row": ("a.csv", HEADER + "1,collision\n", "2 cells, must be 7"),
    "no number": (
        "a.csv",
        HEADER + ROW.replace("1,1\n", "1,north\n"),
        "vy = 'north', must be a finite number",
    ),
    "nan": ("a.csv", HEADER + ROW.replace("1,1\n", "1,nan\n"), "vy = 'nan', must be a finite number"),
    "bad hex": ("a.csv", HEADER + ROW.replace("1,1\n", "1,0xzz\n"), "vy = '0xzz', must be a finite number"),
    "seq no whole": ("a.csv", HEADER + ROW.replace("1,coll", "1.5,coll"), "seq = '1.5', must be a whole"),
    "torn": ("a.csv", HEADER + ROW + ROW.replace("1,coll", "2,coll") + ROW, "seq = 1 is answered twice"),
    "semicolons": (
        "a.csv",
        HEADER.replace(",", ";"),
        "columns are separated by semicolons, must be by commas",
    ),
    "tabs": ("a.csv", HEADER.replace(",", "\t"), "columns are separated by tabs"),
    "no utf-8": ("a.csv", b"\xff\xfe", "it is no UTF-8"),
    "no file": ("missing.jsonl", None, "No such file"),
}


@pytest.mark.parametrize("name", BAD_ANSWERS)
def test_bad_answers_are_refused_in_one_line(name, tmp_path, command_line):
    file, content, message = BAD_ANSWERS[name]
    if content is not None:
        (tmp_path / file).write_bytes(content if isinstance(content, bytes) else content.encode())
    assert_refused(command_line("check", "--answers", tmp_path / file, "--seed", 5), message)


HORIZON = {"outcome": "horizon", "t": "1", "wall": "", "dt": "", "reason": ""}
ROWS = [  # the cells of a row, and the outcome that they are
    ({**HORIZON, "x": "0x1p-1"}, {"outcome": "horizon", "reason": "", "t": 1.0, "x": 0.5}),
    (
        {**HORIZON, "t_in": "0.25", "t_out": "2"},
        {"outcome": "horizon", "reason": "", "t": 1.0, "captured": [0.25, 2.0]},
    ),
    ({**HORIZON, "t_in": "", "t_out": ""}, {"outcome": "horizon", "reason": "", "t": 1.0, "captured": None}),
    ({**HORIZON, "t_in": ""}, {"outcome": "horizon", "reason": "", "t": 1.0, "captured": None}),
    ({**HORIZON, "t_out": ""}, {"outcome": "horizon", "reason": "", "t": 1.0, "captured": None}),
    ({**HORIZON, "t_in": "0.25"}, {"outcome": "horizon", "reason": "", "t": 1.0, "captured": [0.25]}),
    (
        {"outcome": "collision", "wall": "arc", "dt": "1D-3", "vx": "-2", "t_in": "", "t_out": ""},
        {"outcome": "collision", "reason": "", "wall": "arc", "dt": 1e-3, "vx": -2.0},
    ),
    ({"outcome": "undecided", "reason": "shy", "t": ""}, {"outcome": "undecided", "reason": "shy"}),
]  # fmt: skip


@pytest.mark.parametrize(("cells", "outcome"), ROWS, ids=range(len(ROWS)))
def test_a_row_is_the_outcome_that_it_holds(cells, outcome):
    """A table with either column of capture intervals tells of each end whether it is captured."""
    assert sheets._outcome("row", cells) == outcome


def test_lines_of_answers_are_told_apart_by_what_they_hold(tmp_path):
    path = tmp_path / "a.jsonl"
    lines = [
        b'{"protocol":1}',
        LINE.strip().encode() % 7,
        b'{"values":[1.0]}',
        b" ",
        LINE.strip().encode() % 3,
        b'{"values":[2.0]}',
    ]
    path.write_bytes(b"\n".join(lines))
    found = sheets.read_answers(path)
    assert found.lines == {7: lines[1], 3: lines[4]}
    assert (found.introduction, found.echoes) == (lines[0], (lines[2], lines[5]))
    assert found.places == {7: f"answers {str(path)!r}:2", 3: f"answers {str(path)!r}:5"}


def test_a_folder_of_answers_is_read_in_the_order_of_its_files(tmp_path):
    for name, rows in (("b.csv", ROW.replace("1,coll", "2,coll")), ("a.csv", ROW + ROW), ("c.txt", "no")):
        (tmp_path / name).write_text(HEADER + rows)
    found = sheets.read_answers(tmp_path)
    assert [(seq, len(json.loads(line))) for seq, line in found.lines.items()] == [(1, 2), (2, 1)]
    (tmp_path / "d.csv").write_text(HEADER + ROW)
    with pytest.raises(BadInput, match="seq = 1 is answered twice"):
        sheets.read_answers(tmp_path)


def test_the_command_writes_questions_and_grades_answers(tmp_path, command_line):
    questions, answers = tmp_path / "q.jsonl", tmp_path / "a.jsonl"
    code, out, err = command_line("check", "--questions", questions, "--seed", 7)
    assert (code, err) == (0, "drawing and proving the questions of seed 7: some 20 seconds\n")
    answers.write_bytes(answered(questions.read_bytes()))
    for options in (("--questions", questions), ()):
        code, out, err = command_line("check", *options, "--answers", answers)
        assert (code, err) == (0, "")
        assert "accepted" in out
        assert "seed 7" in out
    assert_refused(command_line("check", "--answers", answers, "--seed", 8), "answers to other questions")
    assert_refused(command_line("check", "--answers", answers, "--", "me"), "COMMAND")
    assert_refused(command_line("check", "--questions", tmp_path / "q.txt"), "must end in .jsonl")
