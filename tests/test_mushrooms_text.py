"""What commands print, whole: tables row by row and lines word by word, of results with known numbers."""

import json
import re

import msgspec
import pytest

from conformance import vectors
from conformance.cases.attacks import Tally
from conformance.grading.agreement import middle
from conformance.suite import Result, Run
from conformance.suite.run import draw_transform
from conformance.suite.session import Limits
from mushrooms import check, questions
from mushrooms.questions import STEPPERS
from scene.protocol.messages import Introduction


def cells(text: str) -> list[list[str]]:
    """Return the cells of the rows of a table that rich has printed, its head first."""
    rows = [re.split("[│┃]", line.strip("│┃")) for line in text.splitlines() if line[:1] in ("│", "┃")]
    return [[cell.strip() for cell in row] for row in rows]


@pytest.fixture
def attacked(command_line, monkeypatch):
    """Return a function that attacks with these tallies in place of those that are found."""

    def call(tallies: list[Tally], *options):
        asked = []

        def run(families, n_cases, seed, steppers, progress):
            asked.append(([family.name for family in families], n_cases, seed, steppers))
            return tallies

        monkeypatch.setattr(questions, "run", run)
        monkeypatch.setenv("COLUMNS", "200")
        return asked, command_line("attack", *options)

    return call


def tally(name: str, slowest: float = 0.125, **cases: list[str]) -> Tally:
    kinds = {"undecided": [], "open": [], "wrong": []} | cases
    counts = {"agreed": 5, "refused": 6} | {kind: len(found) for kind, found in kinds.items()}
    ordered = {kind: counts[kind] for kind in ("agreed", "undecided", "refused", "open", "wrong")}
    return Tally(name, 17, ordered, 3.14159, slowest, kinds)


@pytest.mark.parametrize(
    ("cases", "slowest", "code"),
    [
        ({}, 10.0, 0), ({}, 10.5, 1), ({"wrong": ["no: {1}", "off: {2}"]}, 0.1, 1),
        ({"open": ["not proved: {3}"], "undecided": ["shy: {4}"]}, 0.1, 0),
    ],
)  # fmt: skip
def test_attacks_are_counted_in_a_table_and_listed_where_they_matter(
    attacked, tmp_path, cases, slowest, code
):
    found = [tally("one"), tally("other", slowest, **cases)]
    file = tmp_path / "a.json"
    asked, ended = attacked(found, "--family", "knot-at-event", "--cases", 17, "--seed", 3, "--json", file)
    assert asked == [(["knot-at-event"], 17, 3, STEPPERS["both"])]
    assert (ended.code, ended.err) == (code, "")
    numbers = [str(len(cases.get(kind, []))) for kind in ("undecided", "open", "wrong")]
    assert cells(ended.out) == [
        ["family", "cases", "agreed", "undecided", "refused", "open", "wrong", "worst ulps", "slowest s"],
        ["one", "17", "5", "0", "6", "0", "0", "3.14", "0.12"],
        ["other", "17", "5", numbers[0], "6", *numbers[1:], "3.14", f"{slowest:.2f}"],
    ]
    listed = [f"{kind}: {case}" for kind in ("open", "wrong") for case in cases.get(kind, [])]
    assert [line for line in ended.out.splitlines() if "{" in line] == listed
    assert json.loads(file.read_text()) == [
        {
            "family": one.family, "cases": 17, **one.counts, "worst_ulps": 3.14159, "slowest_s": one.slowest,
            "undecided_cases": one.cases["undecided"], "open_cases": one.cases["open"],
            "wrong_cases": one.cases["wrong"],
        }
        for one in found
    ]  # fmt: skip


def test_all_families_are_attacked_if_none_is_named(attacked):
    asked, ended = attacked([tally("one")], "--stepper", "fast", "--cases", 2)
    [(names, n_cases, seed, steppers)] = asked
    assert (names, n_cases, seed) == (list(questions.FAMILIES), 2, 0)
    assert steppers is STEPPERS["fast"]
    assert ended.code == 0


@pytest.mark.parametrize("name", ["moving-cap/3", "static-cap/1", "near-corner/9"])
@pytest.mark.parametrize("seed", [None, 4])
def test_a_case_is_printed_line_by_line(command_line, name, seed):
    vector = next(one for one in vectors.load("core") if one.id == name)
    code, out, err = command_line("ask", name, *(() if seed is None else ("--seed", seed)))
    assert (code, err) == (0, "")
    condition = f", condition {vector.condition:.3g}" if vector.condition else ""
    lines = [f"{name}, level core{condition}", f"rule       {vector.rule}", f"source     {vector.source}"]
    sent = vector
    if seed is not None:
        image = draw_transform(vector, seed)
        sent = image.apply(vector)
        lines.append(f"asked      {image}; certified answers below are of the question as published")
        assert sent != vector
    lines.append(f"question   {json.dumps(vectors.request(sent, 0))}")
    for begin, expected in zip(["certified", *["or"] * 9], vector.expect, strict=False):
        lines.append(f"{begin}  {expected.outcome} {expected.reason}".rstrip())
        for number, outcome in enumerate(middle(expected, vector.state), 1):
            fields = msgspec.to_builtins(outcome)
            kind = fields.pop("outcome")
            words = [kind, *(f"{field}={value!r}" for field, value in fields.items())]
            lines.append(f"  {number:>4}  {' '.join(words)}")
    assert out.splitlines() == [*lines, "verifier   proved"]


GOOD = [Result("cap/1", "cap", "pass", level="core", ulps=2.5, relative=1e-16, seconds=0.5)]
LATE = [
    *GOOD, Result("cap/2", "cap", "pass", level="core", ulps=5e5, relative=1e-12),
    Result("stem/1", "stem", "timed-out", "slow", level="core"),
    Result("stem/2", "stem", "pass", level="core", relative=1.0),
    Result("far/1", "far", "indeterminate", "open", level="core"),
    Result("protocol/stop", "protocol", "pass"),
]  # fmt: skip
OPEN = [*GOOD, Result("far/1", "far", "indeterminate", "open", level="core")]
WHO = Introduction(1, "one [bold]", "2.0", "C", ("step",), ("cap",), ("constant",))


def a_run(results: list[Result], introduction: Introduction | None, n_restarts: int) -> Run:
    graded = {"tables": ["cap"], "laws": [], "profiles": ["step"], "not_graded": ["stem"]}
    return Run(
        ["./it", "a b"], "core", 1, "9.9", "", Limits(), introduction, results, None, n_restarts, "", 41.64,
        graded, [],
    )  # fmt: skip


SHOWN = [
    (
        GOOD, None, 0, "./it 'a b', level core, corpus 9.9", ["pass"],
        [["cap", "1", "1", "2.5", "1/0/0", "A"], ["all", "1", "1", "2.5", "1/0/0", "A"]],
        ["1 of 1 cases pass, 41.6 s.", "accepted: core 9.9; cap; step; stem not graded; 0.0 % declined;"
         " class A; seed 1"],
    ),
    (
        LATE, WHO, 2, "one [bold] 2.0 (C), level core, corpus 9.9", ["pass", "indeterminate", "timed-out"],
        [["cap", "2", "2", "0", "0", "5e+05", "1/0/1", "C"],
         ["stem", "2", "1", "0", "1", "inf", "0/0/1", "C"],
         ["far", "1", "0", "1", "0", "–", "–", "–"], ["protocol", "1", "1", "0", "0", "–", "–", "–"],
         ["all", "6", "4", "1", "1", "inf", "1/0/2", "C"]],
        ["stem/1: timed-out: slow", "4 of 6 cases pass, 2 restarts, 41.6 s.",
         "not accepted: core 9.9; cap; step; stem not graded; 0.0 % declined; class C; seed 1"],
    ),
    (
        OPEN, None, 0, "./it 'a b', level core, corpus 9.9", ["pass", "indeterminate"],
        [["cap", "1", "1", "0", "2.5", "1/0/0", "A"], ["far", "1", "0", "1", "–", "–", "–"],
         ["all", "2", "1", "1", "2.5", "1/0/0", "A"]],
        ["1 of 2 cases pass, 41.6 s: the suite itself is at fault.", "undecided: core 9.9; cap; step;"
         " stem not graded; 0.0 % declined; class A; seed 1"],
    ),
]  # fmt: skip


@pytest.mark.parametrize(
    ("results", "who", "n_restarts", "title", "verdicts", "rows", "lines"), SHOWN, ids=range(len(SHOWN))
)
def test_a_run_of_the_suite_is_shown_in_a_table_and_these_lines(
    capsys, monkeypatch, results, who, n_restarts, title, verdicts, rows, lines
):
    monkeypatch.setenv("COLUMNS", "200")
    check.show(a_run(results, who, n_restarts))
    out = capsys.readouterr().out
    assert out.splitlines()[0].strip() == title
    assert cells(out) == [["group", "cases", *verdicts, "worst ulps", "A/B/C", "class"], *rows]
    assert out.splitlines()[-len(lines) :] == lines
    assert out.splitlines()[-len(lines) - 1].startswith("└")
