"""What is known to fail: the names of the list, what they say of the run of a seed, strictness."""

from __future__ import annotations

import pytest
from msgspec.structs import replace
from support.saboteurs import command
from test_conformance_session import asked_alone, made_up
from test_conformance_suite import made

from conformance.suite import disguise
from conformance.suite import run as suite
from conformance.suite.result import Result
from scene.refusal import BadInput


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
    names = "breathing-circle/1@7 property/mirror fresh/2@1 drawn/60@1 fresh/* declined/grazing declined/all"
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
        ("drawn/*", "fail", 2, "fail"),
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
    monkeypatch.setattr(suite, "drawn_disguise", lambda *_: disguise.Disguise())  # it knows one answer
    fixed = frozenset({"made-up/0", "made-up/1", "protocol/stop"})
    run = suite.check(command("crash-at-second"), known=fixed)
    assert run.objections() == ["made-up/0: passes, though it is listed as a known failure"]
