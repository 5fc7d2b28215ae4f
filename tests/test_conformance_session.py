"""The runner against implementations that break the protocol: the exact verdict, no hang, nothing left."""

from __future__ import annotations

import math
import secrets
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest
from support.depth import deep_among, deep_but
from support.saboteurs import HONEST, SABOTEURS, command

from conformance.suite import run as suite
from conformance.suite.answers import read_answer
from conformance.suite.disguise import Disguise
from conformance.suite.process import CommandNotFound, Trouble
from conformance.suite.session import Limits, Session, probe_values
from conformance.vectors import Certified, Expectation, Vector
from scene import State
from scene.protocol.messages import with_minus_zeros

N = 3
PATIENT = Limits(timeout=30.0, restarts=N + 2)
HASTY = Limits(timeout=1.5, restarts=0)
CASES = ["protocol/start", "protocol/echo", "protocol/rejects", *(f"made-up/{i}" for i in range(N))]
CASES.append("protocol/stop")


def made_up(number: int) -> Vector:
    """A head-on hit of a unit circle, whose answer every citizen knows by heart."""
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


@pytest.fixture
def verdicts(monkeypatch):
    """Return what runs the suite on a saboteur and gives its results by case; nothing may be left running."""
    monkeypatch.setenv("SABOTAGE", token := secrets.token_hex(8))
    monkeypatch.setattr(suite, "checks_of", lambda *_: [])
    monkeypatch.setattr(suite, "drawn_horizons", lambda *_: [])
    monkeypatch.setattr(suite, "fresh", lambda *_: [])
    monkeypatch.setattr(suite, "drawn_disguise", lambda *_: Disguise())  # saboteurs know one answer
    monkeypatch.setattr(suite, "choose", lambda *_: [made_up(i) for i in range(N)])

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


def alive(token: str) -> list[int]:
    """List the processes whose environment or arguments hold the token."""
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            given = (entry / "environ").read_bytes() + (entry / "cmdline").read_bytes()
            if token.encode() in given:
                found.append(int(entry.name))
        except OSError:
            continue
    return found


@pytest.mark.parametrize("name", HONEST)
def test_honest_ones_pass_whatever_their_manners(verdicts, name):
    run = verdicts(name, PATIENT)
    assert run.counts() == {"pass": len(CASES)}, run.results
    assert {result.sent for result in run.results} == {""}
    assert run.exit_code() == 0
    assert len(run.stderr) < 100_000
    assert ("bytes left out" in run.stderr) == (name in ("noise", "last-words"))
    assert shows_no_controls(run)


def shows_no_controls(run: suite.Run) -> bool:
    """Tell whether all text of a run prints as it is; standard error keeps its lines."""
    return all(text.isprintable() for text in texts(msgspec.to_builtins(run)) if text != run.stderr) and all(
        line.isprintable() for line in run.stderr.replace("\t", " ").split("\n")
    )


def texts(data) -> Iterator[str]:
    if isinstance(data, str):
        yield data
    elif isinstance(data, dict | list | tuple):
        for part in data.values() if isinstance(data, dict) else data:
            yield from texts(part)


# What each saboteur gets for every question, and a word of the reason.
AT_EVERY_STEP = {
    "huge-line": ("wrong-format", "longer than"),
    "endless-line": ("wrong-format", "longer than"),
    "wrong-seq": ("wrong-format", "answered seq"),
    "no-seq": ("wrong-format", "answered seq None"),
    "duplicate": ("wrong-format", "more than one line"),
    "split-line": ("wrong-format", "line"),
    "junk": ("wrong-format", "debug: stepping"),
    "blank-line": ("wrong-format", "''"),
    "not-utf8": ("wrong-format", "utf-8"),
    "not-utf8-in-a-further-field": ("wrong-format", "utf-8"),
    "deep-nesting": ("wrong-format", "[[["),
    "nan": ("wrong-format", "JSON"),
    "infinity": ("wrong-format", "out of range"),
    "number-as-text": ("wrong-format", "`float | null`"),
    "missing-field": ("wrong-format", "`vy`"),
    "unknown-wall": ("wrong-format", "lid"),
    "reason-of-its-own": ("wrong-format", "reason"),
    "own-error": ("error", "out of memory"),
    "own-error-beside-an-outcome": ("error", "out of memory"),
    "exit-silently": ("crashed", "exited with status 0 before it answered"),
    "close-stdout": ("crashed", "closed its standard output"),
    "end-by-a-nameless-signal": ("crashed", "was killed by signal 40 before it answered"),
    "fork-and-die": ("crashed", "exited with status 3"),
    "daemon": ("crashed", "exited with status 3"),
    "orphan": ("crashed", "exited with status 3"),
    "control-characters-in-errors": ("error", r"\x1b]0;owned\x07\x1b[2J \x9b31m\u202e \x00"),
    "control-characters-in-reasons": ("fail", r"\x1b]0;owned\x07"),
}


@pytest.mark.parametrize(
    "name", deep_among(AT_EVERY_STEP, "close-stdout", "huge-line", "endless-line", "daemon")
)
def test_a_fault_in_every_answer(verdicts, name):
    run = verdicts(name, PATIENT)
    verdict, word = AT_EVERY_STEP[name]
    asked = [result for result in run.results if result.group == "made-up"]
    assert [result.verdict for result in asked] == [verdict] * N, asked
    assert all(word in result.why for result in asked), asked
    assert all("\n" not in result.why for result in asked)
    assert all('"cmd":"step"' in result.sent and '"vx":0.6' in result.sent for result in asked)
    assert run.counts()["pass"] <= 4
    assert run.exit_code() == 1
    # An error of its own is no reason to restart; all else is.
    assert run.n_restarts == (0 if verdict in ("error", "fail") else N - 1)
    assert shows_no_controls(run)


# What each that breaks the introduction or the probe gets, for the whole session.
AT_THE_DOOR = {
    "early-answers": ("start", "more than one line"),
    "banner": ("start", ""),
    "other-protocol": ("start", "protocol 2"),
    "fourteen-digits": ("echo", "values["),
    "no-minus-zero": ("echo", "values[1] = -0.0 came back as 0.0"),
    "flush-subnormals": ("echo", "5e-324 came back as 0.0"),
    "misread-exponents": ("echo", "1e+22 came back as 1e+21"),
    "fewer-numbers": ("echo", "numbers came back"),
}


@pytest.mark.parametrize("name", AT_THE_DOOR)
def test_a_session_that_never_begins(verdicts, name):
    run = verdicts(name, PATIENT)
    where, word = AT_THE_DOOR[name]
    by_id = {result.id: result for result in run.results}
    assert by_id[f"protocol/{where}"].verdict == "wrong-format"
    assert word in by_id[f"protocol/{where}"].why
    assert run.counts()["pass"] == (1 if where == "echo" else 0)
    assert run.counts()["wrong-format"] == N + 1
    assert f"not asked: {where} failed" in by_id["made-up/0"].why
    assert run.exit_code() == 1


# Those that keep silent; their limit is short, and there is no second process.
SILENT = {
    "hang": "no answer within 1.5 s; is each line flushed? --timeout and --total allow more",
    "late-answer": "no answer within 1.5 s",
    "ignore-sigterm": "no answer within 1.5 s",
    "half-a-line": 'after \'{"seq":',
    "flood-stderr": "no answer within 1.5 s",
}


@pytest.mark.parametrize("name", deep_but(SILENT, "hang", "flood-stderr"))
def test_silence_ends_at_the_limit(verdicts, name):
    run = verdicts(name, HASTY)
    first, *others = [result for result in run.results if result.group == "made-up"]
    assert first.verdict == "timed-out"
    assert SILENT[name] in first.why
    assert first.seconds < HASTY.timeout + 5
    assert {result.verdict for result in others} == {"error"}
    assert all("restarted 0 times; --restarts allows more" in result.why for result in others)
    assert run.counts()["pass"] == 3
    assert run.exit_code() == 1


def test_the_total_time_ends_a_check_that_every_answer_keeps_alive(verdicts):
    run = verdicts("slow", Limits(timeout=30.0, restarts=N, total=2.0))
    asked = {result.id: result for result in run.results}
    assert asked["made-up/0"].verdict == "pass"
    assert asked["made-up/2"].verdict == asked["protocol/stop"].verdict == "timed-out"
    assert asked["protocol/stop"].why == "not asked: the total time of 2 s is spent"
    assert run.seconds < 5.0
    assert run.exit_code() == 1


def test_silence_at_the_start_is_the_verdict_of_all(verdicts):
    run = verdicts("hang-at-start", HASTY)
    assert run.counts() == {"timed-out": N + 1}
    assert run.exit_code() == 1


# Single faults: the case and its verdict; all other cases pass.
ONCE = {
    "crash-on-invalid": ("protocol/rejects", "crashed", "status 1"),
    "guess-on-invalid": ("protocol/rejects", "fail", "without vy"),
    "crash-at-second": ("made-up/1", "crashed", "SIGSEGV"),
    "ignore-stop": ("protocol/stop", "timed-out", "after `stop`"),
    "leave-a-child": ("protocol/stop", "fail", "child"),
    "leave-an-orphan": ("protocol/stop", "fail", "child"),
    "talk-after-stop": ("protocol/stop", "wrong-format", "goodbye"),
    "helper-that-talks": ("protocol/stop", "wrong-format", "farewell"),
}


@pytest.mark.parametrize("name", deep_among(ONCE, "ignore-stop"))
def test_a_single_fault_is_found_and_nothing_else_suffers(verdicts, name):
    case, verdict, word = ONCE[name]
    run = verdicts(name, PATIENT)
    by_id = {result.id: result for result in run.results}
    assert by_id[case].verdict == verdict
    assert word in by_id[case].why
    assert run.counts()["pass"] == len(CASES) - 1
    assert run.exit_code() == 1
    assert "Traceback" in run.stderr or name != "crash-on-invalid"


def test_an_answer_to_the_question_before(verdicts):
    run = verdicts("stale-answer", PATIENT)
    asked = [result.verdict for result in run.results if result.group == "made-up"]
    assert asked == ["pass", "wrong-format", "pass"]


def test_every_saboteur_is_met():
    met = {*HONEST, *AT_EVERY_STEP, *AT_THE_DOOR, *SILENT, *ONCE, "hang-at-start", "stale-answer", "slow"}
    assert met == set(SABOTEURS)


def test_a_command_that_does_not_exist():
    with pytest.raises(CommandNotFound, match="no-such-stepper"), Session(["./no-such-stepper"]) as session:
        session.start()


def test_leaving_a_session_kills_what_it_started(monkeypatch):
    monkeypatch.setenv("SABOTAGE", token := secrets.token_hex(8))
    with Session(command("honest")) as session:
        session.start()
        assert alive(token)
    assert alive(token) == []


def test_the_probe_sends_every_kind_of_number():
    values = probe_values()
    assert {repr(v) for v in values} >= {
        "-0.0",
        "5e-324",
        "0.1",
        "1.7976931348623157e+308",
        "0.3333333333333333",
    }
    assert len({repr(v) for v in values}) == len(values)
    assert max(len(repr(v).strip("-0.").partition("e")[0].replace(".", "")) for v in values) == 17


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
    with pytest.raises(Trouble, match="wrong-format") as caught:
        read_answer(line, cmd, 1)
    assert word in caught.value.why


def test_a_particle_that_is_lost_may_say_that_it_has_no_stay():
    lost = {"outcome": "rejected", "reason": "r"}
    for more in (b"", b',"captured":null'):
        line = b'{"seq":1,"states":[{"outcome":"rejected","reason":"r"%b}]}' % more
        assert read_answer(line, "flow", 1) == {"states": (lost,)}


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


def test_whole_numbers_are_read_however_they_are_written():
    assert read_answer(b'{"seq":1.0,"error":"no"}', "step", 1) == {"error": "no"}
    assert read_answer(b'{"seq":1e0,"ns":[41e3,2.0],"steps":[]}', "time", 1) == {
        "ns": (41000, 2),
        "steps": (),
    }
    for line in (
        b'{"seq":1.5,"error":"no"}',
        b'{"seq":1,"ns":[0.5],"steps":[]}',
        b'{"seq":1,"ns":-1.0,"steps":[]}',
    ):
        with pytest.raises(Trouble, match="wrong-format"):
            read_answer(line, "time", 1)


@pytest.mark.parametrize(
    ("cmd", "rest"),
    [
        ("step", '"outcome":"rejected","reason":"r"'),
        ("trajectory", '"steps":[]'),
        ("trajectory", '"outcome":"rejected","reason":"r"'),
        ("flow", '"states":[]'),
        ("time", '"ns":[1],"steps":[]'),
    ],
)
def test_a_failure_counts_whatever_stands_beside_it(cmd, rest):
    """One rule for every command: an outcome once hid the error, and an error hid steps."""
    beside = '{"seq":1,"error":%s,' + rest + "}"
    assert read_answer((beside % '"no"').encode(), cmd, 1) == {"error": "no"}
    assert set(read_answer((beside % "null").encode(), cmd, 1)) < {
        "outcome",
        "reason",
        "steps",
        "states",
        "ns",
    }
    with pytest.raises(Trouble, match=r"wrong-format.*error"):
        read_answer((beside % "0.5").encode(), cmd, 1)


def test_right_answers_are_read():
    assert read_answer(b'{"seq":1,"error":"no"}', "step", 1) == {"error": "no"}
    assert read_answer(b'{"seq":1,"steps":[]}', "trajectory", 1) == {"steps": ()}
    further = b'{"seq":1,"error":"no","n":{"a":1,"a":2},"n":%b}' % (b"9" * 10**4)
    assert read_answer(further, "step", 1) == {"error": "no"}
    refusal = {"outcome": "rejected", "reason": "r"}
    assert read_answer(b'{"seq":1,"outcome":"rejected","reason":"r"}', "trajectory", 1) == refusal
