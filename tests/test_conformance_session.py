"""The runner against implementations that break the protocol: the exact verdict, no hang, nothing left."""

import json
import math
import re
import secrets
from contextlib import suppress
from pathlib import Path

import msgspec
import pytest
from support.depth import deep_among
from support.faulty_servers import FAULTS, HONEST, command

from conformance.suite import run as suite
from conformance.suite.answers import read_answer
from conformance.suite.process import CheckFailure, CommandNotFound
from conformance.suite.session import Limits, Session
from conformance.suite.symmetry import Transform
from conformance.vectors import Certified, Expectation, Vector
from scene import State
from scene.protocol.messages import with_minus_zeros

N = 3
PATIENT = Limits(timeout=30.0, restarts=N + 2)
HASTY = Limits(timeout=1.5, restarts=0)
CASES = ["protocol/start", "protocol/echo", "protocol/rejects", *(f"made-up/{i}" for i in range(N))]
CASES.append("protocol/stop")


def made_up(number: int) -> Vector:
    """A head-on hit of a unit circle, whose answer every faulty server knows by heart."""
    numbers = {"dt": "1", "x": "0.6", "y": "0.8", "vx": "-0.6", "vy": "-0.8"}
    ends = {name: (value, value) for name, value in numbers.items()}
    right = Certified(**ends, allowance=(1.0,) * 5, wall="arc")
    return Vector(
        id=f"made-up/{number}",
        group="made-up",
        level="core",
        kind="step",
        rule="a stand-in",
        source="none",
        scene={"table": "cap", "r": 1.0},
        state=State(0.0, 0.0, 0.0, 0.6, 0.8),
        t_end=9.0,
        expect=(Expectation("collision", (right,)),),
    )


def asked_alone(monkeypatch, vectors: list[Vector]) -> None:
    """Have a run ask these vectors and nothing else."""
    for name in ("checks_of", "fresh"):
        monkeypatch.setattr(suite, name, lambda *_: [])
    monkeypatch.setattr(suite, "choose", lambda *_: vectors)


@pytest.fixture
def verdicts(monkeypatch):
    """Return what runs the suite on a faulty server and leaves nothing running: its results by case."""
    monkeypatch.setenv("FAULTY_SERVER", token := secrets.token_hex(8))
    asked_alone(monkeypatch, [made_up(i) for i in range(N)])
    monkeypatch.setattr(suite, "draw_transform", lambda *_: Transform())  # faulty servers know one answer

    def run(name: str, limits: Limits) -> suite.Run:
        found = suite.check(command(name), limits=limits)
        assert [result.id for result in found.results] in (
            CASES,
            CASES[:2] + CASES[3:-1],
            CASES[:1] + CASES[3:-1],
        )
        assert alive(token) == []
        return found

    return run


def alive(token: str) -> list[str]:
    """List the processes whose environment or arguments hold the token."""
    found = []
    for file in [*Path("/proc").glob("[0-9]*/environ"), *Path("/proc").glob("[0-9]*/cmdline")]:
        with suppress(OSError):  # it has ended, or is another user's
            found += [file.parent.name] if token.encode() in file.read_bytes() else []
    return found


# Which cases of each do not pass, the verdict it gets there, and a word of the reason.
STEP = "every step"
MET = {
    **dict.fromkeys(HONEST, ("", "pass", "")),
    "huge-line": (STEP, "wrong-format", "longer than"),
    "endless-line": (STEP, "wrong-format", "longer than"),
    "wrong-seq": (STEP, "wrong-format", "answered seq"),
    "no-seq": (STEP, "wrong-format", "answered seq None"),
    "duplicate": (STEP, "wrong-format", "more than one line"),
    "split-line": (STEP, "wrong-format", "line"),
    "junk": (STEP, "wrong-format", "debug: stepping"),
    "blank-line": (STEP, "wrong-format", "''"),
    "not-utf8": (STEP, "wrong-format", "utf-8"),
    "not-utf8-in-a-further-field": (STEP, "wrong-format", "utf-8"),
    "deep-nesting": (STEP, "wrong-format", "[[["),
    "nan": (STEP, "wrong-format", "JSON"),
    "infinity": (STEP, "wrong-format", "out of range"),
    "number-as-text": (STEP, "wrong-format", "`float | null`"),
    "missing-field": (STEP, "wrong-format", "`vy`"),
    "unknown-wall": (STEP, "wrong-format", "lid"),
    "reason-of-its-own": (STEP, "wrong-format", "reason"),
    "own-error": (STEP, "error", "out of memory"),
    "own-error-beside-an-outcome": (STEP, "error", "out of memory"),
    "exit-silently": (STEP, "crashed", "exited with status 0 before it answered"),
    "close-stdout": (STEP, "crashed", "closed its standard output"),
    "end-by-a-nameless-signal": (STEP, "crashed", "was killed by signal 40 before it answered"),
    "fork-and-die": (STEP, "crashed", "exited with status 3"),
    "daemon": (STEP, "crashed", "exited with status 3"),
    "orphan": (STEP, "crashed", "exited with status 3"),
    "control-characters-in-errors": (STEP, "error", r"\x1b]0;owned\x07\x1b[2J \x9b31m\u202e \x00"),
    "control-characters-in-reasons": (STEP, "fail", r"\x1b]0;owned\x07"),
    # The session does not begin.
    "early-answers": ("start", "wrong-format", "more than one line"),
    "banner": ("start", "wrong-format", ""),
    "other-protocol": ("start", "wrong-format", "protocol 2"),
    "hang-at-start": ("start", "timed-out", "no answer within 1.5 s"),
    "fourteen-digits": ("echo", "wrong-format", "values["),
    "no-minus-zero": ("echo", "wrong-format", "values[1] = -0.0 came back as 0.0"),
    "flush-subnormals": ("echo", "wrong-format", "5e-324 came back as 0.0"),
    "misread-exponents": ("echo", "wrong-format", "1e+22 came back as 1e+21"),
    "fewer-numbers": ("echo", "wrong-format", "numbers came back"),
    # Silence; no second process is granted.
    "hang": ("silence", "timed-out", "is each line flushed? --timeout and --total allow more"),
    "late-answer": ("silence", "timed-out", "no answer within 1.5 s"),
    "ignore-sigterm": ("silence", "timed-out", "no answer within 1.5 s"),
    "half-a-line": ("silence", "timed-out", 'after \'{"seq":'),
    "flood-stderr": ("silence", "timed-out", "no answer within 1.5 s"),
    # One case suffers.
    "crash-on-invalid": ("protocol/rejects", "crashed", "status 1"),
    "guess-on-invalid": ("protocol/rejects", "fail", "without vy"),
    "crash-at-second": ("made-up/1", "crashed", "SIGSEGV"),
    "stale-answer": ("made-up/1", "wrong-format", "answered seq"),
    "ignore-stop": ("protocol/stop", "timed-out", "after `stop`"),
    "leave-a-child": ("protocol/stop", "fail", "child"),
    "leave-an-orphan": ("protocol/stop", "fail", "child"),
    "talk-after-stop": ("protocol/stop", "wrong-format", "goodbye"),
    "helper-that-talks": ("protocol/stop", "wrong-format", "farewell"),
}
SLOW = "ignore-stop", "close-stdout", "huge-line", "endless-line", "daemon"
SILENT = "late-answer", "ignore-sigterm", "half-a-line"


def failing(where: str, verdict: str) -> dict[str, str]:
    """Return the verdict of every case that does not pass, the first one first."""
    asked = dict.fromkeys(CASES[3:-1], verdict)
    if where == STEP:  # an error of its own is no reason to restart; after all else no process is left
        return asked | ({} if verdict in ("error", "fail") else {"protocol/stop": "error"})
    if where in ("start", "echo"):
        return {f"protocol/{where}": verdict} | asked
    if where == "silence":
        return dict.fromkeys(CASES[3:], "error") | {"made-up/0": verdict}
    return {where: verdict} if where else {}


@pytest.mark.parametrize("name", deep_among((name for name in FAULTS if name != "slow"), *SLOW, *SILENT))
def test_each_gets_its_verdict_and_no_other_case_suffers(verdicts, name):
    where, verdict, word = MET[name]
    run = verdicts(name, HASTY if verdict == "timed-out" and where != "protocol/stop" else PATIENT)
    expected = failing(where, verdict)
    bad = [result for result in run.results if result.verdict != "pass"]
    assert {result.id: result.verdict for result in bad} == expected
    for result in bad[: N if where == STEP else 1]:
        assert word in result.why
        assert '"cmd":' in result.sent or where == "protocol/stop"
    assert run.exit_code() == bool(expected)
    if where == STEP:
        assert run.n_restarts == (N - 1 if "protocol/stop" in expected else 0)
    if where == "silence":
        assert all("restarted 0 times; --restarts allows more" in result.why for result in bad[1:])
    assert ("bytes left out" in run.stderr) == (name in ("noise", "last-words", "flood-stderr"))
    # Text of its own prints as it is; standard error keeps its lines.
    shown = json.dumps(msgspec.to_builtins(run), ensure_ascii=False)
    assert shown.isprintable()
    assert not re.search(r"(?<!\\)(\\\\)*\\u", shown)


def test_the_total_time_ends_a_check_that_every_answer_keeps_alive(verdicts):
    run = verdicts("slow", Limits(timeout=30.0, restarts=N, total=2.0))
    asked = {result.id: result for result in run.results}
    assert asked["made-up/0"].verdict == "pass"
    assert asked["made-up/2"].verdict == asked["protocol/stop"].verdict == "timed-out"
    assert asked["protocol/stop"].why == "not asked: the total time of 2 s is spent"
    assert run.seconds < 5.0


def test_a_command_that_does_not_exist():
    with pytest.raises(CommandNotFound, match="no-such-stepper"), Session(["./no-such-stepper"]) as session:
        session.start()


# Beside what an answer of each command holds, an error is the answer.
BESIDE = {
    "step": b'"outcome":"rejected","reason":"r"',
    "trajectory": b'"steps":[]',
    "flow": b'"states":[]',
    "time": b'"ns":[1],"steps":[]',
}
LOST = b'{"seq":1,"states":[{"outcome":"%b","reason":"corner","captured":[1,2]}]}'


@pytest.mark.parametrize(
    ("line", "cmd", "word"),
    [
        (b'{"seq":1,"steps":[{"outcome":"collision"}]}', "trajectory", "steps[0]"),
        (b'{"seq":1,"ns":[-1],"steps":[]}', "time", "ns"),
        (b'{"seq":1,"states":[{"outcome":"horizon"}]}', "flow", "states"),
        (b'{"seq":true,"outcome":"undecided","reason":""}', "step", "seq True"),
        (b'{"seq":null,"outcome":"rejected","reason":"what?"}', "step", "what?"),
        (b'{"seq":null,"outcome":"rejected","reason":"two\\nlines"}', "step", "two lines"),
        (b'{"seq":1,"error":5}', "step", "error"),
        *((b'{"seq":1,"error":0.5,%b}' % rest, cmd, "error") for cmd, rest in BESIDE.items()),
        (b'{"seq":1.5,"error":"no"}', "time", "seq 1.5"),
        (b'{"seq":1,"ns":[0.5],"steps":[]}', "time", "ns"),
        (b'{"seq":1,"ns":-1.0,"steps":[]}', "time", "ns"),
        # Where it is no JSON, with what stands around it: -0 is read as -0.0, which would move the place.
        (
            b'{"seq":1,"outcome":"horizon","t":-0,"x":0.1234567,"y":-0,"vx":nan}',
            "step",
            """(byte 66) in ...'"x":0.1234567,"y":-0,"vx":nan}'""",
        ),
        (b'{"seq":2,"error":"no","seq":1}', "step", "Field `seq` stands twice"),
        (
            b'{"seq":1,"outcome":"horizon","t":9,"x":9,"x":0,"y":0,"vx":0,"vy":0}',
            "step",
            "Field `x` stands twice",
        ),
        (
            b'{"seq":1,"steps":[{"outcome":"undefined","reason":"tangency","reason":"corner"}]}',
            "trajectory",
            "Field `reason` stands twice",
        ),
        *((LOST % kind, "flow", "null") for kind in (b"rejected", b"undefined", b"undecided")),
    ],
)
def test_misshapen_answers_are_named(line, cmd, word):
    with pytest.raises(CheckFailure, match="wrong-format") as caught:
        read_answer(line, cmd, 1)
    assert word in caught.value.why


REFUSAL = {"outcome": "rejected", "reason": "r"}


@pytest.mark.parametrize(
    ("line", "cmd", "answer"),
    [
        *((b'{"seq":1,"error":"no",%b}' % rest, cmd, {"error": "no"}) for cmd, rest in BESIDE.items()),
        *((b'{"seq":1,"error":null,%b}' % BESIDE["step"], cmd, REFUSAL) for cmd in BESIDE),
        (b'{"seq":1,"steps":[]}', "trajectory", {"steps": ()}),
        (b'{"seq":1,"error":"no","n":{"a":1,"a":2},"n":%b}' % (b"9" * 10**4), "step", {"error": "no"}),
        (b'{"seq":1.0,"error":"no"}', "step", {"error": "no"}),
        (b'{"seq":1e0,"ns":[41e3,2.0],"steps":[]}', "time", {"ns": (41000, 2), "steps": ()}),
        (b'{"seq":1,"states":[{"outcome":"rejected","reason":"r"}]}', "flow", {"states": (REFUSAL,)}),
        (
            b'{"seq":1,"states":[{"outcome":"rejected","reason":"r","captured":null}]}',
            "flow",
            {"states": (REFUSAL,)},
        ),
    ],
)
def test_right_answers_are_read(line, cmd, answer):
    assert read_answer(line, cmd, 1) == answer


def test_minus_zero_is_read_however_it_is_written():
    """`%.17g` of C, which the protocol's page names, writes -0; a text that has it stays as it is."""
    line = b'{"seq":1,"outcome":"horizon","t":-0,"x":-0 ,"y":-0.0,"vx":-0e0,"vy":1e-0}'
    found = read_answer(line, "step", 1)
    assert [math.copysign(1.0, found[name]) for name in ("t", "x", "y", "vx", "vy")] == [-1.0] * 4 + [1.0]
    assert with_minus_zeros(b'{"-0":-0,"a":"\\"-0 ,-0","b":-0}') == b'{"-0":-0.0,"a":"\\"-0 ,-0","b":-0.0}'
    whole = b'{"seq":-0,"collisions" : -0 ,"repeat":-0}'
    assert with_minus_zeros(whole) == whole
    for line in (b'"' + b'\\"-0,' * 10**5, b'-0 "' * 10**5, b'"' + b"-0,\\" * 10**5):
        with_minus_zeros(line)  # to begin anew at each mark would take hours
