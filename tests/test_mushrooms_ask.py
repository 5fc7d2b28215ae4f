"""`mushrooms ask`: a case's question, answer and rule; a stepper's answer to it."""

from __future__ import annotations

import json
import sys
from functools import partial

import msgspec
import pytest
from support.refusals import assert_refused
from support.saboteurs import command

from conformance import vectors

PLAIN = [sys.executable, "-m", "conformance.plain"]


@pytest.fixture
def call(command_line):
    return partial(command_line, "ask")


def test_it_prints_question_answer_and_rule(call):
    vector = next(v for v in vectors.load() if v.id == "moving-cap/3")
    code, out, err = call("moving-cap/3")
    assert (code, err) == (0, "")
    question = next(line for line in out.splitlines() if line.startswith("question"))
    assert json.loads(question.removeprefix("question")) == vectors.request(vector, 0)
    assert vector.rule in out
    assert f"wall={vector.expect[0].steps[0].wall!r}" in out
    assert out.endswith("verifier   proved\n")


def test_the_verifiers_word_is_about_the_vector(call, monkeypatch):
    later = msgspec.structs.replace(vectors.load()[0], t_end=vectors.load()[0].state.t)
    monkeypatch.setattr(vectors, "load", lambda level: (later,))
    _, out, _ = call(later.id)
    assert "verifier   false the answer is horizon" in out


def test_it_prints_the_vector_as_json(call):
    code, out, _ = call("hard-case-23/1", "--json")
    assert code == 0
    assert msgspec.json.decode(out, type=vectors.Vector).id == "hard-case-23/1"


@pytest.mark.parametrize(
    "arguments", [["moving-cap/3"], ["drawn/2", "--seed", 4], ["near-corner/9", "--seed", 4]]
)
def test_it_grades_a_stepper(call, arguments):
    code, out, _ = call(*arguments, "--", *PLAIN)
    assert code == 0
    assert "pass: " in out
    assert ("asked " in out) == ("--seed" in arguments)


def test_a_fresh_question_is_asked_as_it_is(call):
    code, out, _ = call("fresh/3", "--seed", 4, "--", *PLAIN)
    assert code == 0
    assert "pass: " in out
    assert "asked " not in out


def test_a_wrong_answer_is_exit_code_1(call):
    code, out, _ = call("moving-cap/3", "--", *command("honest"))
    assert code == 1
    assert "fail: " in out


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["no-such/1"], "ID = 'no-such/1'"),
        (["drawn/1"], "--seed"),
        (["fresh/1"], "--seed"),
        (["fresh/999", "--seed", "1"], "ID = 'fresh/999'"),
        (["drawn/1", "--seed", "-1"], "--seed = -1"),
        (["moving-cap/3", "--", "./no-such-stepper"], "no-such-stepper"),
        (["moving-cap/3", "--", *command("other-protocol")], "does not speak protocol 1"),
        ([], "ID"),
    ],
)
def test_bad_input_is_one_line(call, arguments, word):
    assert_refused(call(*arguments), word)
