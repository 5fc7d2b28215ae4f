"""The suite's accounting: verdicts, exit codes, known failures, reports; its further parts can fail."""

import json
import sys
from types import SimpleNamespace
from xml.etree import ElementTree

import msgspec
import pytest
from msgspec.structs import replace
from support.faults import FAULTS
from support.faulty_servers import command
from support.faulty_steppers import clock, faulty
from support.schemas import validator
from test_conformance_session import asked_alone, made_up

from conformance import vectors
from conformance.mutants.kill_matrix import diagnose
from conformance.suite import reports, symmetry
from conformance.suite import run as suite
from conformance.suite.result import VERDICTS, Result, Run
from conformance.suite.session import Limits, Session, missing
from scene.protocol.messages import Introduction
from scene.refusal import BadInput

INTRODUCTION = Introduction(1, "made-up", "1", "C", ("step", "flow"), ("cap", "mushroom"), ("constant",))


def made(*verdicts: str, listed: tuple[int, ...] = (), **fields) -> Run:
    """Return a run of so many results: by turns of the protocol and of one group of vectors."""
    results = [
        Result(
            f"made-up/{i}",
            "made-up" if i % 2 else "protocol",
            verdict,
            "because & <why>",
            0.5,
            "core",
            ulps=2.0 if verdict == "pass" else None,
            relative=1e-16 if verdict == "pass" else None,
            answer={"x": 1.0},
            is_known=i in listed,
        )
        for i, verdict in enumerate(verdicts)
    ]
    graded = {"tables": ["cap"], "laws": ["constant"], "profiles": ["step"], "not_graded": ["flow"]}
    asked = ["./made-up"], "core", 7, "1.0", "0" * 64, Limits(), INTRODUCTION
    return replace(Run(*asked, results, None, 0, "", 1.5, graded, []), **fields)


def of_groups(*counts: tuple[int, str, str, str]) -> Run:
    """Return a run of results by number, group, level and verdict."""
    results = [
        Result("a/1", group, verdict, level=level) for n, group, level, verdict in counts for _ in range(n)
    ]
    return made(results=results)


def of_one_seed(name: str, verdict: str, seed: int) -> Run:
    """Return a run of a seed with one generated question, where a name is listed as known to fail."""
    result = Result("fresh/2", "fresh", verdict, level="core")
    known = replace(result, is_known=suite._is_known(result, frozenset({name}), seed))
    return made(results=[known, Result("a/1", "a", "pass", level="core")])


UNASKED = "not asked: restarted 10 times"
EASY = 4, "a", "core", "pass"
PASSES = "passes, though it is listed as a known failure"


@pytest.mark.parametrize(
    ("run", "words", "code"),
    [
        (made("pass", "pass"), [], 0),
        (made("pass", "fail"), ["made-up/1: fail: because & <why>"], 1),
        *((made("pass", bad), [bad], 1) for bad in ("crashed", "timed-out", "wrong-format", "error")),
        (made("pass", "unsupported"), [], 0),
        (made("pass", "indeterminate"), [], 2),
        (made("pass", "indeterminate", "fail"), ["fail"], 1),
        (made("unsupported", "unsupported"), ["no vector passed"], 1),
        (made(), ["no vector passed"], 1),
        (made("declined", "declined"), ["declined 2 of 2 cases"], 1),
        (made(*["pass"] * 19, "declined"), [], 0),
        (made(*["pass"] * 18, "declined"), ["declined 1 of 19"], 1),
        (made("pass", "fail", listed=(1,)), [], 0),
        (made("pass", "crashed", listed=(1,)), [], 0),
        (made("pass", "pass", listed=(1,)), [f"made-up/1: {PASSES}"], 1),
        # What was never asked has one line.
        (
            made(results=[Result(f"a/{i}", "a", "error", UNASKED) for i in range(591)]),
            [f"a/0 and 590 others: error: {UNASKED}"],
            1,
        ),
        # At level stress a group may be declined, but not all that is asked.
        (of_groups((60, "a", "core", "pass"), (3, "b", "stress", "declined")), [], 0),
        (of_groups((60, "a", "core", "pass"), (4, "b", "stress", "declined")), ["declined 4 of 64 cases"], 1),
        (of_groups(EASY, (3, "a", "core", "declined"), (90, "b", "stress", "pass")), ["in group a"], 1),
        # What is declined too often can be known.
        (made("pass", "declined", "declined"), ["declined 2 of 3 cases"], 1),
        (made("pass", "declined", "declined", known=frozenset({"declined/all"})), [], 0),
        (
            made("pass", "declined", "declined", known=frozenset({"declined/all", "declined/protocol"})),
            ["declined/protocol: less is declined, though it is listed as a known failure"],
            1,
        ),
        # A list made with one seed holds with another: it is strict within a seed.
        (of_one_seed("fresh/2@1", "fail", 1), [], 0),
        (of_one_seed("fresh/2@1", "pass", 1), [PASSES], 1),
        (of_one_seed("fresh/2@1", "pass", 2), [], 0),
        (of_one_seed("fresh/2@1", "fail", 2), ["fail"], 1),
        (of_one_seed("fresh/*", "fail", 2), [], 0),
        (of_one_seed("fresh/*", "pass", 2), [], 0),
        (of_one_seed("profile/*", "fail", 2), ["fail"], 1),
        (of_one_seed("fresh/2", "fail", 2), [], 0),
    ],
)
def test_what_a_run_comes_to(run, words, code):
    told = run.objections()
    assert [word in line for word, line in zip(words, told, strict=True)] == [True] * len(words), told
    assert run.exit_code() == code


def test_nothing_is_diagnosed_where_nothing_passed():
    """One that refuses every question has the same vectors wrong as every mutant that spoils all answers."""
    failed = [vector for vector in vectors.load("core") if vector.group == "fermi-ulam"]
    assert diagnose(failed, []) == []


@pytest.mark.parametrize("groups", [["static-cap"], ["promise"], ["fresh", "static-stem"]])
def test_what_is_asked_by_name_is_asked_alone(monkeypatch, groups):
    few = [check for check in suite.checks_of() if check.name in ("promise/spelling", "property/mirror")]
    monkeypatch.setattr(suite, "checks_of", lambda *_: few)
    run = suite.check(faulty(lambda request, answer: answer(request)), groups=groups, seed=1)
    assert set(run.groups()) == {"protocol", *groups}
    assert (run.exit_code(), run.speed) == (0 if "promise" not in groups else 1, None)  # nothing was graded


def test_what_is_not_offered_is_not_asked():
    vector = made_up(0)
    assert missing(INTRODUCTION, "step", vector.scene) == ""
    moving = msgspec.structs.replace(vector, scene={"table": "stem", "w": 1.0, "h": {"kind": "fourier"}})
    assert missing(INTRODUCTION, "step", moving.scene) == "table stem, law fourier"
    assert missing(INTRODUCTION, "trajectory", vector.scene) == "profile trajectory"
    assert missing(INTRODUCTION, "step", None) == ""  # what must be refused needs no table
    assert suite.ask_vector(SimpleNamespace(introduction=INTRODUCTION), moving).verdict == "unsupported"


def test_levels_and_groups_are_chosen():
    assert {v.group for v in suite.choose("core", ["moving-cap"])} == {"moving-cap"}
    for bad in (("core", ["no-such"]), ("hard", [])):
        with pytest.raises(BadInput, match="must be one of"):
            suite.choose(*bad)


def test_the_json_report_follows_its_published_schema():
    run = made("pass", "fail", "declined", "crashed", listed=(1,))
    data = json.loads(reports.to_json(run))
    validator("check").validate(data)
    counts = {v: int(v in ("pass", "fail", "declined", "crashed")) for v in VERDICTS}
    assert (data["total"]["counts"], data["exit_code"]) == (counts, 1)
    assert [r.get("answer") for r in data["results"]] == [None, {"x": 1.0}, {"x": 1.0}, {"x": 1.0}]
    assert not validator("check").is_valid({**data, "results": [{}]})


def test_junit_counts_what_happened():
    run = made(
        "pass", "fail", "declined", "crashed", "fail", "pass", listed=(4, 5), stderr="\x1b[31mdown\x00"
    )
    root = ElementTree.fromstring(reports.to_junit(run))
    names = ("tests", "failures", "errors", "skipped")
    assert [root.get(name) for name in names] == ["6", "2", "1", "2"]
    assert sum(int(s.get("tests")) for s in root) == 6
    cases = {case.get("name"): [child.tag for child in case] for case in root.iter("testcase")}
    tags = [[], ["failure"], ["skipped"], ["error"], ["skipped"], ["failure"]]
    assert cases == {f"made-up/{i}": tag for i, tag in enumerate(tags)}
    assert root.find(".//system-err").text == "\ufffd[31mdown\ufffd"
    assert root.find(".//failure").get("message") == "fail: because & <why>"


def test_the_reference_passes(monkeypatch):
    offered = [v for v in vectors.load("core") if v.kind != "flow"]
    known = [v for v in offered if v.expect[0].steps and v.group != "hard-case-14"][::100]
    asked_alone(monkeypatch, known)
    monkeypatch.setattr(suite, "measure_speed", lambda _: None)
    run = suite.check([sys.executable, "-m", "reference"])
    assert len(run.results) > 16
    assert (set(run.counts()), run.exit_code(), run.precision()) == ({"pass"}, 0, "A")


# So long that no wait for an answer, however short the path, bears it out.
MILLIONFOLD = clock(lambda said: [10**6 * n for n in said])


@pytest.mark.parametrize("fault", [FAULTS["no-time"][2], FAULTS["elsewhere"][2], MILLIONFOLD])
def test_no_speed_is_shown_for_what_is_not_followed(monkeypatch, fault):
    monkeypatch.setattr(suite, "TIMED_LEAST", 1_000_000)
    for broken, is_shown in ((fault, False), (lambda request, answer: answer(request), True)):
        opened = Session(faulty(broken))
        opened.start()
        speed = suite.measure_speed(opened)
        assert (speed is not None) == is_shown
    assert speed.best_ns > 0
    assert suite.measure_speed(SimpleNamespace(introduction=INTRODUCTION)) is None


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("breathing-circle/1\nno-such/1", ":2: no-such/1"),
        ("property/no-such", "no case"),
        ("fresh/2", "is of one run's questions: fresh/2@SEED lists it, fresh/\\* all"),
        ("fresh/999@1", "no case"),
        ("fresh/2@one", "no case"),
        ("property/*", "no case"),
        ("declined/no-such", "no case"),
        ("grazing/1\ngrazing/1 # again", "twice"),
    ],
)
def test_a_known_failures_file_is_checked(tmp_path, text, word):
    path = tmp_path / "known.txt"
    path.write_text(text)
    with pytest.raises(BadInput, match=word):
        suite.read_known(path)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
def test_known_failures_are_read(tmp_path, encoding):
    path = tmp_path / "known.txt"
    names = "breathing-circle/1@7 property/mirror fresh/2@1 fresh/3@1 fresh/* declined/grazing declined/all"
    path.write_text("# ours\n\nbreathing-circle/1   # issue 7\n" + "\n".join(names.split()), encoding)
    assert suite.read_known(path) == {"breathing-circle/1", *names.split()}
    with pytest.raises(BadInput, match="cannot be read"):
        suite.read_known(tmp_path / "absent.txt")


def test_known_failures_are_marked_in_a_run(monkeypatch):
    asked_alone(monkeypatch, [made_up(0), made_up(1)])
    monkeypatch.setattr(suite, "draw_transform", lambda *_: symmetry.Transform())  # it knows one answer
    fixed = frozenset({"made-up/0", "made-up/1", "protocol/stop"})
    run = suite.check(command("crash-at-second"), known=fixed)
    assert run.objections() == ["made-up/0: passes, though it is listed as a known failure"]
