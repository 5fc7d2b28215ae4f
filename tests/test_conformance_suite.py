"""The suite: exact verdicts on what breaks the protocol, no hang, nothing left; accounting and reports."""

import json
import math
import re
import secrets
from contextlib import nullcontext, suppress
from types import SimpleNamespace
from xml.etree import ElementTree

import msgspec
import psutil
import pytest
from support import faults
from support.depth import deep_among
from support.faulty_servers import FAULTS, HONEST, command
from support.faulty_steppers import clock, faulty
from support.schemas import validator

import scene as scenes
from conformance import vectors
from conformance.mutants.kill_matrix import diagnose
from conformance.suite import reports, run as suite
from conformance.suite.checks import form
from conformance.suite.process import CheckFailure
from conformance.suite.result import VERDICTS, Result, Run
from conformance.suite.run import Transform
from conformance.suite.session import Limits, Session, missing, read_answer
from conformance.vectors import Certified, Expectation, Vector
from scene import State
from scene.protocol.messages import Introduction, with_minus_zeros
from scene.refusal import BadInput

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
    monkeypatch.setattr(suite, "checks_of", lambda *_: [])
    monkeypatch.setattr(suite, "N_FRESH", dict.fromkeys(suite.N_FRESH, 0))
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


def alive(token: str) -> list[int]:
    """List the processes whose environment or arguments hold the token."""
    found = []
    for process in psutil.process_iter():
        with suppress(psutil.Error):  # it has ended, or is another user's
            texts = [*process.cmdline(), *process.environ().values()]
            found += [process.pid] if any(token in text for text in texts) else []
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
    "not-utf8": (STEP, "wrong-format", "can't decode byte 0xff"),
    "not-utf8-in-a-further-field": (STEP, "wrong-format", "can't decode byte 0xe9"),
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
SLOW = "ignore-stop", "slow-to-stop", "close-stdout", "huge-line", "endless-line", "daemon"
SILENT = "late-answer", "ignore-sigterm", "half-a-line", "flood-stderr"


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
    is_waited_for = verdict == "timed-out" or word == "child"
    run = verdicts(name, HASTY if is_waited_for else PATIENT)
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


# Beside what an answer of each command holds, an error is the answer.
BESIDE = {
    "step": b'"outcome":"rejected","reason":"r"',
    "trajectory": b'"steps":[]',
    "flow": b'"states":[]',
    "time": b'"ns":[1],"steps":[]',
}
LOST = b'{"seq":1,"states":[{"outcome":"%b","reason":"corner","captured":[1,2]}]}'
# A reader that replaces, drops or passes what is no UTF-8 finds an answer in each.
NO_UTF8 = (
    b'{"seq":1,"outcome":"rejected","reason":"\xff"}',
    b'{"seq":1,"outcome":"reje\xffcted","reason":"r"}',
    b'{"seq":1,"error":"no","not\xe9":1}',
    b'{"seq":1,"error":"no","a surrogate":"\xed\xa0\x80"}',
    b'{"seq":1,"error":"no","a slash in two bytes":"\xc0\xaf"}',
)


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
        # A field that the protocol does not name may stand once, wherever it is, and however it is spelt.
        *(
            (b'{"seq":1,%b,"error":"no"}' % further, cmd, "Field `n` stands twice")
            for cmd in BESIDE
            for further in (
                b'"n":1,"n":1',
                b'"n":1,"n":2',
                b'"n":1,"\\u006e":1',
                b'"m":{"n":1,"n":2}',
                b'"m":[[{"n":1,"o":0,"n":1}]]',
            )
        ),
        (b'{"seq":1,"error":"no","a\\u001bb":1,"a\\u001bb":1}', "step", "stands twice"),
        *((LOST % kind, "flow", "null") for kind in (b"rejected", b"undefined", b"undecided")),
        *((line, "step", "can't decode byte 0x") for line in NO_UTF8),
        *(('{"seq":1,"error":"no"}'.encode(name), "step", "malformed") for name in ("utf-8-sig", "utf-16")),
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
        (b'{"seq":1,"error":"no","n":{"a":1,"b":2},"m":%b}' % (b"9" * 10**4), "step", {"error": "no"}),
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
    return msgspec.structs.replace(Run(*asked, results, None, 0, "", 1.5, graded, []), **fields)


def of_groups(*counts: tuple[int, str, str, str]) -> Run:
    """Return a run of results by number, group, level and verdict."""
    results = [
        Result("a/1", group, verdict, level=level) for n, group, level, verdict in counts for _ in range(n)
    ]
    return made(results=results)


def of_one_seed(name: str, verdict: str, seed: int) -> Run:
    """Return a run of a seed with one generated question, where a name is listed as known to fail."""
    result = Result("fresh/2", "fresh", verdict, level="core")
    known = msgspec.structs.replace(result, is_known=suite._is_known(result, frozenset({name}), seed))
    return made(results=[known, Result("a/1", "a", "pass", level="core")])


def known_in(run: Run, *names: str) -> Run:
    """Return a run with a list of what is known to fail."""
    return msgspec.structs.replace(run, known=frozenset(names))


def of_a_check(n_undecided: int, n_answers: int, *, is_known: bool = False) -> Run:
    """Return a run of some vectors that pass, and a check of so many answers."""
    check = Result(
        "promise/hits",
        "promise",
        "declined" if n_undecided > 3 else "pass",
        is_known=is_known,
        n_answers=n_answers,
        n_undecided=n_undecided,
    )
    return made(results=[Result("a/1", "a", "pass", level="core"), check])


MUCH = of_groups(
    (2, "three", "core", "pass"),
    (2, "one", "core", "pass"),
    (8, "one", "core", "declined"),
    (2, "two", "core", "pass"),
    (8, "two", "core", "declined"),
)
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
        (made("declined", "declined"), ["declined 2 of 2 vectors"], 1),
        (made(*["declined"] * 6), ["declined 6 of 6 vectors and fresh questions"], 1),
        (made(*["pass"] * 19, "declined"), [], 0),
        (made(*["pass"] * 18, "declined"), [], 0),
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
        (of_groups((60, "a", "core", "pass"), (4, "b", "stress", "declined")), [], 0),
        (of_groups((60, "a", "core", "pass"), (12, "b", "stress", "declined")), ["declined 12 of 72"], 1),
        (of_groups(EASY, (3, "a", "core", "declined"), (90, "b", "stress", "pass")), [], 0),
        (of_groups(EASY, (9, "a", "core", "declined"), (300, "b", "stress", "pass")), ["in group a"], 1),
        # What is declined too often can be known.
        (MUCH, ["declined 16 of 22 vectors", "in group one", "in group two"], 1),
        (known_in(MUCH, "declined/all", "declined/one", "declined/two"), [], 0),
        (
            known_in(MUCH, "declined/all", "declined/one", "declined/two", "declined/three"),
            ["declined/three: less is declined, though it is listed as a known failure"],
            1,
        ),
        # A check has its own answers, and can be known by its own name.
        (of_a_check(3, 3), [], 0),
        (of_a_check(4, 4), ["promise/hits: 4 of 4 answers are undecided: surely more than 25%"], 1),
        (of_a_check(12, 32), [], 0),
        (of_a_check(5, 5, is_known=True), [], 0),
        (of_a_check(0, 5, is_known=True), [f"promise/hits: {PASSES}"], 1),
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


@pytest.mark.parametrize(
    ("profile", "scene", "lacking"),
    [
        ("step", {"table": "cap", "r": 1.0}, ""),
        ("step", {"table": "stem", "w": 1.0, "h": {"kind": "fourier"}}, "table stem, law fourier"),
        ("trajectory", {"table": "cap", "r": 1.0}, "profile trajectory"),
        ("step", None, ""),  # what must be refused needs no table
    ],
)
def test_what_is_not_offered_is_not_asked(profile, scene, lacking):
    assert missing(INTRODUCTION, profile, scene) == lacking


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


# So long that no wait for an answer, however short the path, bears it out.
MILLIONFOLD = clock(lambda said: [10**6 * n for n in said])


@pytest.mark.parametrize("fault", [faults.FAULTS["no-time"][2], faults.FAULTS["elsewhere"][2], MILLIONFOLD])
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
    monkeypatch.setattr(suite, "draw_transform", lambda *_: Transform())  # it knows one answer
    fixed = frozenset({"made-up/0", "made-up/1", "protocol/stop"})
    run = suite.check(command("crash-at-second"), known=fixed)
    assert run.objections() == ["made-up/0: passes, though it is listed as a known failure"]


FLYING, HIT = State(0.0, 0.0, 0.5, 0.0, 1.0), {"outcome": "collision", "wall": "arc", "dt": 0.5}
ENDS = {
    "collision": [HIT | {"t": 0.5 * (k + 1), "x": 0.0, "y": 1.0, "vx": 0.0, "vy": -1.0} for k in range(9)],
    "horizon": [{"outcome": "horizon", "t": 9.0, "x": 0.0, "y": 0.5, "vx": 0.0, "vy": 1.0}] * 9,
    "undefined": [{"outcome": "undefined", "reason": "corner"}] * 9,
}


@pytest.mark.parametrize("n", [0, 1, 3])
@pytest.mark.parametrize("hits", [0, 2, 9])
@pytest.mark.parametrize("end", ["horizon", "undefined"])
def test_a_path_is_asked_step_by_step_until_it_ends(n, hits, end):
    """Nothing is asked after what is no collision, and no more than is wanted."""
    answers = [*ENDS["collision"][:hits], *ENDS[end]]
    asked = []

    def ask(request):
        asked.append(request["state"])
        return answers[len(asked) - 1]

    stepper = form.Implementation(SimpleNamespace(ask=ask), "step")
    found = stepper.path(scenes.Cap(r=1.0), FLYING, n, 9.0)
    assert len(asked) == len(found) == min(n, hits + 1)
    kinds = [type(one).__name__.lower() for one in found]
    assert kinds == (["collision"] * hits + [end])[:n]
    assert [state["t"] for state in asked] == [0.5 * k for k in range(len(asked))]


@pytest.mark.parametrize(
    ("n", "steps", "is_right"),
    [
        (2, ENDS["collision"][:2], True), (2, [*ENDS["collision"][:1], ENDS["horizon"][0]], True),
        (2, ENDS["collision"][:1], False), (2, ENDS["collision"][:3], False), (2, [], False),
        (3, [ENDS["horizon"][0], *ENDS["collision"][:1]], False), (0, [], True),
        (3, [*ENDS["collision"][:1], ENDS["horizon"][0], ENDS["horizon"][0]], False),
    ],
)  # fmt: skip
def test_a_trajectory_of_too_many_or_too_few_steps_is_seen(n, steps, is_right):
    session = SimpleNamespace(ask=lambda _: {"steps": steps})
    stepper = form.Implementation(session, "trajectory")
    with nullcontext() if is_right else pytest.raises(CheckFailure, match=f"{len(steps)} steps, "):
        assert len(stepper.path(scenes.Cap(r=1.0), FLYING, n, 9.0)) == len(steps)
