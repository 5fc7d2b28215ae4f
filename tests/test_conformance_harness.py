"""The example harnesses, built and graded at level core wherever their language is present."""

import io
import json
import subprocess
import sys
from types import SimpleNamespace

import pytest
from support.depth import deep_but
from support.edges import EDGES, LATE_EDGES, is_among

from conformance import vectors
from conformance.harness import kit
from conformance.harness.examples import Example, find_examples, find_kit_examples
from conformance.suite import run as suite
from conformance.suite.checks import ensembles
from scene.load import read_data

KITS = ("C++, next hit", "Python, implicit domain", "Python, intersection and reflection")
LANGUAGES = ("Python", "C", "JavaScript", *KITS)
# One vector in so many, to save time; `mushrooms check` grades them with all.
EVERY = {"Python": 16, "C": 6, "JavaScript": 6, **dict(zip(KITS, (6, 24, 16), strict=True))}
STRICT = ("-O3", "-Wall", "-Wextra", "-Werror")


@pytest.fixture(scope="session")
def commands(tmp_path_factory) -> dict[str, Example]:
    """Return each example's command, or why it cannot run here."""
    folder = tmp_path_factory.mktemp("built")
    return find_examples(folder, STRICT) | find_kit_examples(folder, STRICT)


def runnable(example: Example) -> list[str]:
    # A source that does not compile is a failure; a compiler that is absent is not.
    if example.is_absent:
        pytest.skip(example.why_not)
    assert example.command, example.why_not
    return list(example.command)


@pytest.mark.parametrize("language", deep_but(LANGUAGES, "C"))
def test_an_example_passes_at_level_core(language, commands, monkeypatch, tally):
    command = runnable(commands[language])
    chosen = vectors.load("core")[:: EVERY[language]]
    monkeypatch.setattr(suite, "choose", lambda *_: chosen)
    monkeypatch.setitem(ensembles.SIZES, "core", ensembles.Size(20, 50.0, 0.5))
    run = suite.check(command, seed=1)
    assert (run.objections(), run.exit_code()) == ([], 0)
    lacking = [result for result in run.results if result.verdict == "unsupported"]
    not_offered = {"profile flow"} if language in ("C", "JavaScript") else set()
    assert {result.why for result in lacking if result.group != "property"} == not_offered
    assert set(run.counts()) <= {"pass", "declined", "unsupported"}
    assert run.declined()[0] <= max(3, len(chosen) // 100)  # profiles of so few are declined by the suite
    assert run.precision() in ("A", "B")
    assert (run.n_restarts, run.stderr) == (0, "")
    assert run.speed is not None
    tally[f"{language}: vectors"] += len(chosen)


BAD = [
    {"scene": {"table": "cap", "r": -1.0}},
    {"scene": {"table": "cap", "r": 1.0, "w": 1.0}},
    {"scene": {"table": "cup", "r": 1.0}},
    {"scene": {"table": "cap"}},
    {"scene": read_data("moving-cap-as-printed")},
    {"state": {"t": 0.0, "x": 5.0, "y": 0.5, "vx": 1.0, "vy": 0.0, "wall": None}},
    {"state": {"t": 0.0, "x": 0.0, "y": 0.5, "vx": 1.0, "vy": 0.0, "wall": "lid"}},
    {"state": {"t": 0.0, "x": 0.0, "y": 0.5, "vx": 1.0, "vy": 0.0, "wall": "arc"}},
    {"t_end": -1.0},
    {"t_end": None},
    {"state": {"t": 0.0, "x": 0.0, "y": 0.5, "vx": 1.0, "vy": 0.0, "wall": 5}},
    {"cmd": "dance", "collisions": 1, "repeat": 1},
    *({"cmd": "trajectory", "collisions": n} for n in (-1, 1.5, None)),
    *({"cmd": "time", "collisions": n, "repeat": k} for n, k in ((0, 1), (1, 0), (1, 1.5))),
]
# Lines in which no seq can be read.
NAMELESS = [
    *(json.dumps({"cmd": "echo", "values": values}) for values in (["a"], None, 5)),
    *(json.dumps({"cmd": "step", "seq": seq}) for seq in (None, -1, 1.5, "5")),
]
FAST = {"state": {"t": 0.0, "x": 0.0, "y": 0.5, "vx": 1e200, "vy": 0.0, "wall": None}}
GOOD = {"cmd": "step", "seq": 5, "scene": {"table": "cap", "r": 1.0}, "t_end": 9.0}
GOOD["state"] = {"t": 0.0, "x": 0.0, "y": 0.5, "vx": 1.0, "vy": 0.0, "wall": None}


@pytest.mark.parametrize("language", LANGUAGES)
def test_an_example_refuses_bad_input_and_lives_on(language, commands):
    command = runnable(commands[language])
    spoilt = [{name: part for name, part in GOOD.items() if name != left} for left in GOOD if left != "seq"]
    lines = ["nonsense", "[]", "5", '{"cmd":"dance","seq":1}']
    lines += [*NAMELESS, *map(json.dumps, spoilt)]
    lines += [json.dumps({**GOOD, **changes}) for changes in (*BAD, FAST, {})] + ['{"cmd":"stop"}']
    run = subprocess.run(
        command, input="\n".join(lines) + "\n", capture_output=True, text=True, timeout=60, check=True
    )
    assert run.stderr == ""
    answers = [json.loads(line) for line in run.stdout.splitlines()]
    assert [a["outcome"] for a in answers[:4]] == ["rejected"] * 4
    assert [a["outcome"] for a in answers[4:-2]] == ["rejected"] * len(NAMELESS + spoilt + BAD)
    n_null = 4 + len(NAMELESS)
    assert [a["seq"] for a in answers[4:n_null]] == [None] * len(NAMELESS)
    assert {a["seq"] for a in answers[n_null:-2]} <= {5, None}  # null is never wrong
    assert answers[-2]["outcome"] in ("rejected", "undecided")  # squares may overflow
    assert (answers[-1]["seq"], answers[-1]["outcome"], answers[-1]["wall"]) == (5, "collision", "arc")


@pytest.mark.parametrize("language", LANGUAGES)
def test_an_example_answers_the_edges_of_the_protocol(language, commands):
    edges = [*EDGES, *LATE_EDGES]
    lines = "\n".join(json.dumps(question) for question, _ in edges) + "\n"
    run = subprocess.run(
        runnable(commands[language]), input=lines, capture_output=True, text=True, timeout=60, check=True
    )
    for (question, allowed), line in zip(edges, run.stdout.splitlines(), strict=True):
        assert is_among(json.loads(line), allowed), (question, line)


def refuse_to_say(*_):
    raise kit.UndecidedError("too close")


ENGINES = {
    "a hit": (lambda *_: (1.0, 0.75, 0.5, -1.0, 0.0), {"outcome": "collision", "wall": "arc", "t": 1.0}),
    "too late": (lambda *_: (10.0, 0.75, 0.5, -1.0, 0.0), {"outcome": "horizon", "t": 9.0, "x": 9.0}),
    "none": (lambda *_: None, {"outcome": "horizon", "t": 9.0}),
    "nan": (
        lambda *_: (1.0, float("nan"), 0.5, -1.0, 0.0),
        {"error": "the engine returned (1.0, nan, 0.5, -1.0, 0.0)"},
    ),
    "in the past": (
        lambda *_: (-1.0, 0.75, 0.5, -1.0, 0.0),
        {"error": "the engine returned (-1.0, 0.75, 0.5, -1.0, 0.0)"},
    ),
    "a slip": (lambda *_: 1 / 0, {"error": "the engine raised ZeroDivisionError: division by zero"}),
    "open": (refuse_to_say, {"outcome": "undecided", "reason": "too close"}),
}


@pytest.mark.parametrize("name", ENGINES)
def test_the_kit_makes_an_answer_of_whatever_an_engine_returns(name, monkeypatch):
    engine, expected = ENGINES[name]
    out = io.BytesIO()
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(buffer=io.BytesIO(json.dumps(GOOD).encode() + b"\n")))
    monkeypatch.setattr(sys, "stdout", SimpleNamespace(buffer=out))
    kit.serve_engine("made-up", engine)
    answer = json.loads(out.getvalue())
    assert {field: answer[field] for field in expected} == expected
    assert answer["seq"] == 5
