"""The suite's accounting: verdicts, exit codes, known failures, reports; its further parts can fail."""

import json
import sys
from types import SimpleNamespace
from xml.etree import ElementTree

import msgspec
import pytest
from msgspec.structs import replace
from support.faults import FAULTS
from support.faulty_servers import clock, faulty
from support.saboteurs import command
from support.schemas import validator
from test_conformance_session import asked_alone, made_up

from conformance import vectors
from conformance.mutants.kill_matrix import diagnose
from conformance.suite import reports, symmetry
from conformance.suite import run as suite
from conformance.suite.checks import ensembles
from conformance.suite.result import VERDICTS, Result, Run
from conformance.suite.session import Limits, Session, missing
from scene.protocol.messages import Introduction
from scene.refusal import BadInput

INTRODUCTION = Introduction(1, "made-up", "1", "C", ("step", "flow"), ("cap", "mushroom"), ("constant",))


CHECKS = ("property", "profile", "promise")


def made(
    *verdicts: str, known: tuple[int, ...] = (), known_names: frozenset[str] = frozenset(), **more
) -> Run:
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
            is_known=i in known,
        )
        for i, verdict in enumerate(verdicts)
    ]
    fields = {
        "command": ["./made-up"],
        "level": "core",
        "seed": 7,
        "corpus": "1.0",
        "digest": "0" * 64,
        "limits": Limits(),
        "introduction": INTRODUCTION,
        "results": results,
        "speed": None,
        "n_restarts": 0,
        "stderr": "",
        "seconds": 1.5,
        "graded": {"tables": ["cap"], "laws": ["constant"], "profiles": ["step"], "not_graded": ["flow"]},
        "diagnosis": [],
        "known": known_names,
    }
    return Run(**fields | more)


@pytest.mark.parametrize(
    ("verdicts", "known", "code"),
    [
        (["pass", "pass"], (), 0),
        (["pass", "fail"], (), 1),
        (["pass", "crashed"], (), 1),
        (["pass", "timed-out"], (), 1),
        (["pass", "wrong-format"], (), 1),
        (["pass", "error"], (), 1),
        (["pass", "unsupported"], (), 0),
        (["pass", "indeterminate"], (), 2),
        (["pass", "indeterminate", "fail"], (), 1),
        (["unsupported", "unsupported"], (), 1),
        (["declined", "declined"], (), 1),
        ([*["pass"] * 19, "declined"], (), 0),
        ([*["pass"] * 18, "declined"], (), 1),
        (["pass", "fail"], (1,), 0),
        (["pass", "crashed"], (1,), 0),
        (["pass", "pass"], (1,), 1),
        ([], (), 1),
    ],
)
def test_exit_codes(verdicts, known, code):
    assert made(*verdicts, known=known).exit_code() == code


def test_objections_say_what_is_wrong():
    """What was never asked has one line."""
    run, why = made("pass", "fail", "pass", *["error"] * 591, known=(2,)), "not asked: restarted 10 times"
    results = [replace(r, why=why) if r.verdict == "error" else r for r in run.results]
    assert made(results=results).objections() == [
        "made-up/1: fail: because & <why>",
        "made-up/2: passes, though it is listed as a known failure",
        f"made-up/3 and 590 others: error: {why}",
    ]
    assert "no vector passed" in made("unsupported").objections()[0]
    assert "declined 2 of 3" in made("pass", "declined", "declined").objections()[0]


def test_nothing_is_diagnosed_where_nothing_passed():
    """Who refuses every question has the same vectors wrong as every mutant that spoils all answers."""
    failed = [vector for vector in vectors.load("core") if vector.group == "fermi-ulam"]
    assert diagnose(failed, []) == []


def test_at_level_stress_a_group_may_be_declined_but_not_all_that_is_asked():
    """Hits at the horizon within a unit in the last place are no reason to refuse a stepper."""
    levels = {"a": "core", "b": "stress"}

    def of(*verdicts):
        run = made(*(verdict for _, verdict in verdicts))
        told = [replace(r, group=g, level=levels[g]) for r, (g, _) in zip(run.results, verdicts, strict=True)]
        return made(results=told)

    easy = [("a", "pass")] * 60
    assert of(*easy, *[("b", "declined")] * 3).objections() == []
    assert "declined 4 of 64 cases" in of(*easy, *[("b", "declined")] * 4).objections()[0]
    assert "in group a" in of(*easy[:4], *[("a", "declined")] * 3, *[("b", "pass")] * 90).objections()[0]


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
    run = made("pass", "fail", "declined", "crashed", known=(1,))
    data = json.loads(reports.to_json(run))
    validator("check").validate(data)
    counts = {v: int(v in ("pass", "fail", "declined", "crashed")) for v in VERDICTS}
    assert (data["total"]["counts"], data["exit_code"]) == (counts, 1)
    assert [r.get("answer") for r in data["results"]] == [None, {"x": 1.0}, {"x": 1.0}, {"x": 1.0}]
    assert not validator("check").is_valid({**data, "results": [{}]})


def test_junit_counts_what_happened():
    run = made("pass", "fail", "declined", "crashed", "fail", "pass", known=(4, 5), stderr="\x1b[31mdown\x00")
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


def test_the_cases_beside_the_vectors_are_all_listed(monkeypatch):
    """What a run of an implementation that offers everything contains, and no more."""
    monkeypatch.setitem(ensembles.SIZES, "core", ensembles.Size(20, 50.0, 0.5))
    run = suite.check(faulty(lambda request, answer: answer(request)), groups=["static-cap", *CHECKS], seed=1)
    others = {result.id for result in run.results if not result.level}
    assert others == set(suite.OTHER_CASES)
    assert run.exit_code() == 0
    assert str(run.scope()) == (
        f"core {run.corpus}; cap; constant; step; trajectory, flow, time, mushroom, stem, fourier, bang-bang"
        f" not graded; 0.0 % declined; class {run.precision()}; seed 1"
    )


# So long that no wait for an answer, however short the path, bears it out.
MILLIONFOLD = clock(lambda _, said: [10**6 * n for n in said])


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


@pytest.mark.parametrize(
    ("name", "verdict", "seed", "objection"),
    [
        ("fresh/2@1", "fail", 1, ""),
        ("fresh/2@1", "pass", 1, "passes"),  # strict within a seed
        ("fresh/2@1", "pass", 2, ""),
        ("fresh/2@1", "fail", 2, "fail"),
        ("fresh/*", "fail", 2, ""),
        ("fresh/*", "pass", 2, ""),
        ("profile/*", "fail", 2, "fail"),
        ("fresh/2", "fail", 2, ""),
    ],
)
def test_a_list_made_with_one_seed_holds_with_another(name, verdict, seed, objection):
    result, other = (
        Result("fresh/2", "fresh", verdict, level="core"),
        Result("a/1", "a", "pass", level="core"),
    )
    known = replace(result, is_known=suite._is_known(result, frozenset({name}), seed))
    (told,) = made(results=[known, other]).objections() or [""]
    assert objection in told
    assert bool(objection) == bool(told)


def test_what_is_declined_too_often_can_be_known():
    verdicts = ["pass", "declined", "declined"]
    groups = {name: f"declined/{name}" for name in ("all", "protocol", "made-up")}
    both = frozenset({groups["all"], groups["protocol"]})
    assert len(made(*verdicts).objections()) == 1
    assert made(*verdicts, known_names=frozenset({"declined/all"})).objections() == []
    told = made(*verdicts, known_names=both).objections()
    assert told == ["declined/protocol: less is declined, though it is listed as a known failure"]


def test_known_failures_are_marked_in_a_run(monkeypatch):
    asked_alone(monkeypatch, [made_up(0), made_up(1)])
    monkeypatch.setattr(suite, "draw_transform", lambda *_: symmetry.Transform())  # it knows one answer
    fixed = frozenset({"made-up/0", "made-up/1", "protocol/stop"})
    run = suite.check(command("crash-at-second"), known=fixed)
    assert run.objections() == ["made-up/0: passes, though it is listed as a known failure"]
