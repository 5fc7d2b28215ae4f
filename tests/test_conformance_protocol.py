"""Protocol 1 as our servers and the example programs speak it; the examples are graded at level core.

Spoilt lines are refused without a traceback, by servers and the runner; spoilt scene files are in
test_scene_load. `MUSHROOMS_LINES=20000 MUSHROOMS_RUNS=1000 pytest tests/test_conformance_protocol.py` spoils
20,000 lines for the runner and for each of two servers (the third is deep), and answers 1000 runs with
nonsense; it takes some thirty minutes.

The checks: honest servers hold them, and each faulty server is refused by its own.
"""

import io
import json
import os
import random
import subprocess
import sys
import time
from contextlib import suppress
from functools import partial
from types import SimpleNamespace

import msgspec
import pytest
from hypothesis import find, settings
from support import fuzz
from support.depth import deep_among, deep_but
from support.edges import EDGES, LATE_EDGES, REST, is_among
from support.faults import FAULTS, HARMLESS
from support.faulty_readers import refusing_lines
from support.faulty_steppers import answers_to, faulty
from support.runnable import runnable
from support.schemas import validator
from test_conformance_suite import made_up

import fast
import fast.__main__ as fast_server
import reference.__main__ as reference_server
from conformance import plain, vectors
from conformance.grading.agreement import grade
from conformance.harness import kit
from conformance.harness.examples import Example, find_examples, find_kit_examples
from conformance.mutants import COMMON, MUTANTS, PLAIN
from conformance.suite import checks, reports, run as suite, session
from conformance.suite.checks import bad_input, flows, timing
from conformance.suite.checks.form import Draw, run_check
from conformance.suite.process import CheckFailure
from conformance.suite.result import VERDICTS
from conformance.suite.session import Limits, Session
from scene import Cap, Horizon, Mushroom, Stem
from scene.load import read_data
from scene.protocol.messages import Timed

SERVERS = ("reference", "fast")
FAST = {"flow": fast_server.carry, "timer": fast_server.clock}
IN_PROCESS = {
    "reference": partial(
        answers_to, step=reference_server.step, follow=reference_server.follow, timer=reference_server.clock
    ),
    "fast": partial(answers_to, step=fast.next_collision, follow=fast_server.follow, **FAST),
    "plain": partial(answers_to, step=plain.next_collision, follow=plain.trajectory, flow=plain.flow),
}
KITS = ("C++, next hit", "Python, implicit domain", "Python, intersection and reflection")
LANGUAGES = ("Python", "C", "JavaScript", *KITS)
# One vector in so many, to save time; `mushrooms check` grades them with all.
EVERY = {"Python": 16, "C": 12, "JavaScript": 6, **dict(zip(KITS, (6, 24, 16), strict=True))}


@pytest.fixture(scope="module")
def commands(tmp_path_factory) -> dict[str, Example]:
    """Return each program's command, or why it cannot run here."""
    folder = tmp_path_factory.mktemp("built")
    ours = {f"python -m {name}": Example((sys.executable, "-m", name), "") for name in SERVERS}
    return ours | find_examples(folder, ["-O1"]) | find_kit_examples(folder, ["-O1"])


@pytest.fixture
def ask(commands):
    """Return answers to lines: of a server's steppers in this process, or of a program, without an error."""

    def call(name, *lines):
        sent = "".join((line if isinstance(line, str) else json.dumps(line)) + "\n" for line in lines)
        if name in IN_PROCESS:
            found = IN_PROCESS[name](sent.encode().splitlines(keepends=True))
            return [json.loads(line) for line in found.splitlines()]
        run = subprocess.run(
            runnable(commands[name]), input=sent, capture_output=True, text=True, timeout=120, check=True
        )
        assert run.stderr == ""
        return [json.loads(line) for line in run.stdout.splitlines()]

    return call


@pytest.mark.parametrize("language", deep_but(LANGUAGES, "C"))
def test_an_example_passes_at_level_core(language, commands, monkeypatch, tally):
    command = runnable(commands[language])
    chosen = vectors.load("core")[:: EVERY[language]]
    monkeypatch.setattr(suite, "choose", lambda *_: chosen)
    monkeypatch.setitem(flows.SIZES, "core", flows.Size(20, 50.0, 0.5))
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


@pytest.mark.parametrize("name", [*IN_PROCESS, *LANGUAGES])
def test_the_edges_of_the_protocol(name, ask):
    edges = [*EDGES, *([] if name == "fast" else LATE_EDGES)]  # fast refuses all times so late, and says so
    answers = ask(name, *(question for question, _ in edges))
    for (question, allowed), answer in zip(edges, answers, strict=True):
        assert is_among(answer, allowed), (question, answer)


START = {"t": 0.0, "x": 0.0, "y": 0.5, "vx": 1.0, "vy": 0.0, "wall": None}
TIMED = {"cmd": "time", "seq": 5, "scene": {"table": "cap", "r": 1.0}, "state": START}
GOOD = {**TIMED, "cmd": "step", "t_end": 9.0}


def changed(**changes):
    return {**GOOD, **changes}


def started(**changes):
    return changed(state={**START, **changes})


# Lines in which no seq can be read, and what our servers say of them.
NAMELESS = [
    *(("not json", "JSON"), ("5", ""), ("[]", ""), ("{}", "cmd"), ("[" * 5000, "object")),
    *(({"cmd": "echo", "values": values}, "values") for values in (["a"], None, 5)),
    *(({"cmd": "step", "seq": seq}, "") for seq in (None, -1, 1.5, "5")),
    ({"cmd": "dance"}, "dance"),
]
BAD = [
    *(({name: part for name, part in GOOD.items() if name != left}, left) for left in GOOD if left != "seq"),
    (changed(cmd="dance", collisions=1, repeat=1), "dance"),
    (changed(extra=1), "extra"),
    (changed(scene=3), "int"),
    (changed(scene={"table": "cap", "r": -1.0}), "r > 0"),
    (changed(scene={"table": "cap", "r": 1.0, "w": 1.0}), "w"),
    (changed(scene={"table": "cup", "r": 1.0}), "cup"),
    (changed(scene={"table": "cap"}), "r"),
    (changed(scene={"table": "mushroom", "r": 1.0, "nu": 1.5, "h": 1.0}), "nu <= 1"),
    (changed(scene=read_data("moving-cap-as-printed")), ""),
    (changed(state={name: START[name] for name in START if name != "vy"}), "vy"),
    (started(extra=1.0), "extra"),
    (started(x="0.1"), "state.x"),
    (started(x=5.0), "beyond wall arc"),
    (started(wall="lid"), "lid"),
    (started(wall="arc"), "arc"),
    (started(wall=5), "wall"),
    (changed(t_end=-1.0), "t_end"),
    (changed(t_end=None), "t_end"),
    *((changed(cmd="trajectory", collisions=n), "collisions") for n in (-1, 1.5, None)),
    *(({**TIMED, "collisions": n, "repeat": k}, "") for n, k in ((0, 1), (1, 0), (1, 1.5))),
    (json.dumps(GOOD).replace("1.0", "NaN"), "JSON"),
    (json.dumps(GOOD).replace("1.0", "1e999"), "range"),
]


@pytest.mark.parametrize("name", [*IN_PROCESS, *LANGUAGES])
def test_bad_lines_are_rejected_and_the_session_goes_on(name, ask):
    lines = [line for bad, _ in [*NAMELESS, *BAD] for line in (bad, GOOD)]
    *answers, fast_one = ask(name, *lines, started(vx=1e200))
    for (bad, word), answer, good in zip([*NAMELESS, *BAD], answers[::2], answers[1::2], strict=True):
        may_ignore = word == "extra" and name in LANGUAGES  # a field that it does not know
        assert answer["outcome"] == "rejected" or may_ignore, bad
        assert word in answer.get("reason", "") or name in LANGUAGES, (word, answer)
        assert answer["seq"] in ((None,) if (bad, word) in NAMELESS else (5, None))  # null is never wrong
        assert (good["outcome"], good["wall"], good["seq"]) == ("collision", "arc", 5)
        assert "\n" not in answer.get("reason", "")
    overflows = name not in ("reference", "fast")
    assert (
        fast_one["outcome"] in ("rejected", "undecided") if overflows else fast_one["outcome"] == "collision"
    )


@pytest.mark.parametrize("name", SERVERS)
def test_session(name, ask):
    numbers = [0.1, 5e-324, -0.0, 1.7976931348623157e308, 2.0**53 + 2, 1 / 3, -1e-310]
    lines = {"cmd": "start", "protocol": 1}, {"cmd": "echo", "values": numbers}, GOOD
    zeros = '{"cmd":"echo","values":[-0,0]}', '{"cmd":"dance","seq":-0,"collisions":-0}'
    timed = {"cmd": "time", "seq": 1, **REST, "collisions": 2, "repeat": 1}
    other = {"cmd": "start", "protocol": 2}
    found = ask(
        f"python -m {name}", *lines, *zeros, timed, other, {"cmd": "stop"}, {"cmd": "echo", "values": []}
    )
    start, echo, one, zero, none, rest, refused = found  # and nothing after `stop`
    assert start["name"] == name
    assert set(start["tables"]) == {"cap", "stem", "mushroom"}
    assert repr(echo["values"]) == repr(numbers)
    assert (one["seq"], one["outcome"], one["wall"]) == (5, "collision", "arc")
    assert repr(zero["values"]) == repr([-0.0, 0.0])
    assert none["seq"] == 0
    assert "protocol = 2" in refused["reason"]
    # A particle at rest has no last collision; a horizon at infinity had been written as null.
    (last,) = msgspec.convert(rest, Timed).steps
    assert isinstance(last, Horizon)
    assert (last.x, last.y, last.vx, last.vy) == tuple(REST["state"][n] for n in ("x", "y", "vx", "vy"))


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (MemoryError(), "MemoryError"),
        (EOFError("Ran out of input"), "EOFError: Ran out of input"),
        (OSError(28, "No space left", "kept"), "OSError: [Errno 28] No space left: 'kept'"),
    ],
)
def test_what_the_machine_refuses_is_owned_to_and_the_session_goes_on(error, told):
    def refused(*_):
        raise error

    sent = [json.dumps(changed(seq=seq)).encode() + b"\n" for seq in (1, 2)]
    found = answers_to(sent, refused, refused)
    assert [json.loads(line) for line in found.splitlines()] == [
        {"seq": seq, "error": told} for seq in (1, 2)
    ]


N_LINES = int(os.environ.get("MUSHROOMS_LINES", "300"))
N_RUNS = int(os.environ.get("MUSHROOMS_RUNS", "1"))
LIMIT = 120.0  # seconds for one line: the time limit of `mushrooms check`


@pytest.mark.parametrize("name", deep_but(IN_PROCESS, *SERVERS))
def test_a_server_answers_every_line_with_one_line(name, tally):
    IN_PROCESS[name](map(msgspec.json.encode, fuzz.WARM_UP))  # compiles
    for line in fuzz.lines(1, N_LINES, fuzz.requests):
        begin = time.perf_counter()
        found = IN_PROCESS[name]([line + b"\n"])
        assert time.perf_counter() - begin < LIMIT, line
        assert found.count(b"\n") == bool(line.strip()), (line, found)
        if found:
            answer = json.loads(found)
            assert validator("protocol", "Answer").is_valid(answer), (line, answer)
            tally[answer.get("outcome", "other")] += 1
    assert min(tally["rejected"], tally["collision"]) > N_LINES / 20


def test_the_runner_reads_every_line_or_says_wrong_format(tally):
    vector = made_up(0)
    for line in fuzz.lines(2, N_LINES, fuzz.answers):
        for read in (session.read_introduction, lambda sent: session.check_echo([0.1, -0.0], sent)):
            with suppress(CheckFailure):
                read(line)
        for cmd in session.ANSWERS:
            try:
                found = grade(vector, session.read_answer(line, cmd, 1))
            except CheckFailure as trouble:
                found = trouble
            assert "\n" not in found.why
            assert len(found.why) < 1000
            tally[found.verdict] += 1
    assert min(tally["wrong-format"], tally["pass"], tally["fail"]) > N_LINES / 20


def test_a_hundred_names_are_kept_of_what_an_introduction_lists():
    """A list without end would fill every report."""
    lists = {name: [f"{name} {i}" for i in range(150)] for name in ("profiles", "tables", "laws")}
    said = {"protocol": 1, "name": "a", "version": "1", "language": "C", **lists}
    found = session.read_introduction(json.dumps(said).encode())
    for name, given in lists.items():
        assert getattr(found, name) == tuple(given[:100])


def nonsense(draw, share):
    """Return what answers lines as the fast stepper does, but for a share of nonsense of the right seq."""

    def fault(request, answer):
        honest = answer(request)
        if draw.random() > (0.1 * share if request.get("cmd") == "start" else share):
            return honest
        others = {"error": "no\x07"}, fuzz.answers(draw), *(fuzz.spoil(draw, honest) for _ in range(4))
        spoilt = draw.choice(others)
        return {**(spoilt if isinstance(spoilt, dict) else {"outcome": spoilt}), "seq": honest.get("seq")}

    return faulty(fault)


STRESS = vectors.load("stress")
UNREADABLE = next(v for v in STRESS if "table" not in v.scene)  # to be refused, whatever comes after it
FEW = (*vectors.load("core")[::350], *STRESS[-3:], UNREADABLE)


def test_nonsense_ends_in_verdicts(monkeypatch, tally):
    """Few questions, few particles, no long timings."""
    monkeypatch.setattr(suite, "choose", lambda *_: FEW)
    monkeypatch.setattr(suite, "TIMED_LEAST", 1)
    monkeypatch.setattr(timing, "READABLE", 1e-4)
    monkeypatch.setattr(timing, "MAX_REPEAT", 8)
    monkeypatch.setitem(flows.SIZES, "core", flows.Size(6, 2.0, 0.5))
    for seed in range(N_RUNS):
        draw = random.Random(seed)
        share = draw.choice((0.02, 0.1, 0.5))
        run = suite.check(nonsense(draw, share), seed=seed, limits=Limits(restarts=10**6))
        tally.update(run.counts())
        assert set(run.counts()) <= set(VERDICTS)
        assert all(result.why.isprintable() for result in run.results)
        assert run.exit_code() in (0, 1, 2)
        reports.to_json(run)
        reports.to_junit(run)
    assert min(tally["wrong-format"], tally["error"], tally["fail"], tally["pass"]) > N_RUNS // 2


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
def test_the_kit_makes_an_answer_of_whatever_an_engine_returns(name, monkeypatch, capsysbinary):
    engine, expected = ENGINES[name]
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(buffer=io.BytesIO(json.dumps(GOOD).encode() + b"\n")))
    kit.serve_engine("made-up", engine)
    answer = json.loads(capsysbinary.readouterr().out)
    assert {field: answer[field] for field in expected} == expected
    assert answer["seq"] == 5


SEEDS = 1, 2, 3
UNTIMED = [check for check in checks.checks_of() if not check.name.startswith(("profile", "promise/time"))]


@pytest.fixture
def hurried(monkeypatch):
    monkeypatch.setattr(timing, "N_TRIES", 2)
    monkeypatch.setattr(timing, "READABLE", 0.1)


def verdict_on(answer, name, seed=1):
    with Session(answer) as session:
        session.start()
        return run_check(next(check for check in checks.checks_of() if check.name == name), session, seed)


LONGEST = (
    "changed-questions",
    "bad-states",
    "edges",
    "bad-scenes",
)  # of an honest server, which is asked all


@pytest.mark.parametrize("left_out", deep_but([LONGEST, ()], LONGEST))
def test_an_honest_server_holds_every_check(left_out, monkeypatch):
    """A run of one that offers everything has all these cases, and no more."""
    left_out = [f"promise/{name}" for name in left_out]
    chosen = [check for check in checks.checks_of() if check.name not in left_out]
    monkeypatch.setattr(suite, "checks_of", lambda *_: chosen)
    run = suite.check(
        faulty(lambda request, answer: answer(request)), groups=["static-cap", *checks.GROUPS], seed=1
    )
    few = ("profile/mean-growth", "profile/reversal")  # particles, to tell anything
    expected = dict.fromkeys(suite.OTHER_CASES, "pass") | dict.fromkeys(few, "declined")
    found = {result.id: result.verdict for result in run.results if not result.level}
    assert found == {name: verdict for name, verdict in expected.items() if name not in left_out}
    assert (run.objections(), run.exit_code()) == ([], 0)
    assert str(run.scope()).startswith(
        f"core {run.corpus}; cap; constant; step; trajectory, flow, time, mushroom, stem, fourier, bang-bang"
        " not graded; "
    )


# Of several that differ by a number, a wall or a profile alone, all but one; those that wait for a clock.
ALIKE = (
    *("a-tenth", "no-time", "remembering", "constant", "tenfold", "by-the-piece", "fleeing-a-faster-wall"),
    *(f"tired-at-{n}" for n in (50, 450, 1000, 2000)),
    *("straight-after-1000", "straight-after-2000", "impatient-after-512"),
    *(f"room-for-{n}" for n in (64, 256, 500)),
    *(
        "captured-in-blocks-of-16",
        "captured-in-blocks-of-32",
        "captured-in-blocks-of-64",
        "captured-up-to-100",
    ),
    *("remembering-6-digits", "remembering-9-digits", "remembering-12-digits"),
    *("flows-by-first-parts", "paths-by-first-parts", "particles-without-wall", "particles-by-place"),
    *("mouths-below-0.001-shut", "mouths-below-1e-05-shut"),
    *("mouths-above-0.999-whole", "mouths-above-0.99999-whole"),
    *("ties-within-0.0001-by-order", "ties-within-1e-08-by-order"),
    *("edge-wider-by-1e-06", "slopes-from--16-on"),
    *("scenes-by-1-samples", "absent-t-as-0", "absent-x-as-0", "absent-y-as-0", "absent-vx-as-0"),
    *("loose-paths", "loose-flows", "at-the-end-unchecked", "no-base-in-the-mouth-of-paths"),
    *("strictly-on-base", "strictly-on-left", "strictly-on-floor"),
    *("absent-is-arc-in-paths", "absent-is-arc-in-flows", "captured-from-the-start", "captured-to-the-end"),
    *("first-time-for-all", "answers-without-wall", "open-flows", "edge-wider-by-2.98023e-08"),
)


@pytest.mark.parametrize("name", deep_among(FAULTS, *ALIKE))
def test_a_faulty_server_is_refused_in_one_of_three_runs(name, tally, hurried):
    check, verdict, fault = FAULTS[name]
    found = [verdict_on(faulty(fault), f"promise/{check}", seed) for seed in SEEDS[:1]]
    if found[0].verdict != verdict:
        found += [verdict_on(faulty(fault), f"promise/{check}", seed) for seed in SEEDS[1:]]
        tally["at a second or third seed"] += 1
    assert verdict in [result.verdict for result in found], found
    assert all(result.why.isprintable() for result in found)


@pytest.mark.parametrize(
    ("name", "is_refused"),
    {
        "no-utf8": lambda line: not line.isascii(),
        "no-escapes": lambda line: b"\\u" in line,
        "no-capital-e": lambda line: b"E+" in line or b"E-" in line,
        "64-KiB": lambda line: len(line) > 2**16,
        "512-KiB": lambda line: len(line) > 2**19,
    }.items(),
)
def test_a_server_that_cannot_read_some_lines_is_refused(name, is_refused):
    assert verdict_on(refusing_lines(is_refused), "promise/spelling").verdict == "fail", name


def test_every_rule_has_its_faulty_server():
    assert {f"promise/{check}" for check, _, _ in FAULTS.values()} == {check.name for check in checks.RULES}


@pytest.mark.parametrize("name", deep_but(HARMLESS, "names no walls and keeps no flight times"))
def test_what_is_no_fault_holds_the_checks(name):
    groups, fault = HARMLESS[name]
    concerned = [check for check in UNTIMED if check.name.startswith(groups)]
    assert concerned
    for check in concerned:
        found = verdict_on(faulty(fault), check.name)
        assert found.verdict in ("pass", "unsupported"), (check.name, found.why)


def test_a_failure_can_be_pasted_as_a_test():
    """The case that is printed fails as it stands, for the same reason."""
    check, _, fault = FAULTS["slopes-from--1-on"]
    found = verdict_on(faulty(fault), f"promise/{check}")
    names = {"implementation": faulty(fault)}
    exec(found.paste, names)
    test = next(value for name, value in names.items() if name.startswith("test_"))
    with pytest.raises(AssertionError) as broken:
        settings(max_examples=1, database=None)(test)()
    assert str(broken.value).partition("\n")[0][:60] in found.why


def test_questions_are_a_strategy_too():
    scene, *_ = find(checks.questions("promise/endings", "step"), lambda asked: True)
    assert isinstance(scene, Mushroom | Cap | Stem)


@pytest.mark.parametrize("asks", [bad_input.bad_states, bad_input.bad_scenes])
def test_what_is_asked_as_bad_is_bad_and_the_rest_is_good(asks, tally):
    """The proving stepper says the same of what a check asks, and leaves nothing open."""
    for _, request, why in asks(Draw("1"), "step"):
        answer = json.loads(IN_PROCESS["reference"]([msgspec.json.encode({**request, "seq": 1}) + b"\n"]))
        assert (answer["outcome"] == "rejected") == bool(why), (request, why, answer)
        assert answer["outcome"] != "undecided", request
        tally["bad" if why else "good"] += 1
    assert min(tally.values()) > 100


def flow_of(name: str):
    """Answer by a mutant of the plain stepper, or by itself, or of all particles of a flow but one."""
    stepper = (MUTANTS | COMMON | dict.fromkeys(("none", "one-too-few"), PLAIN))[name]

    def flow(scene, states, t_end):
        return stepper.flow(scene, states[name == "one-too-few" :], t_end)

    return lambda line: answers_to([line], stepper.step, stepper.trajectory, flow=flow)


# A slow particle is sooner done; 20 particles cannot tell anything from anything.
SMALL, SLOW, LITTLE = (flows.Size(*size) for size in ((100, 1000.0, 0.08), (400, 20.0, 0.2), (20, 20.0, 0.3)))


@pytest.mark.parametrize(
    ("name", "case", "size", "verdict"),
    [
        ("none", "work-identity", SMALL, "pass"),
        ("none", "work-identity", LITTLE, "declined"),
        ("energy-kept", "work-identity", SMALL, "fail"),
        pytest.param(
            "wall-velocity-once",
            "work-identity",
            SMALL._replace(n_particles=400),
            "fail",
            marks=pytest.mark.deep,
        ),
        # Loses nearly all its particles.
        ("phase-restarts-at-each-step", "work-identity", SMALL, "fail"),
        pytest.param("none", "captured-share", SLOW._replace(bias=0.1), "pass", marks=pytest.mark.deep),
        ("none", "captured-share", LITTLE, "declined"),
        ("hole-static", "captured-share", SLOW._replace(bias=0.1), "fail"),
        ("none", "mean-growth", SMALL, "declined"),
        ("none", "reversal", SMALL, "declined"),
        ("one-too-few", "work-identity", SMALL, "wrong-format"),
        pytest.param("one-too-few", "captured-share", SMALL, "wrong-format", marks=pytest.mark.deep),
    ],
)
def test_ensembles_tell_a_mutant_from_an_honest_stepper(monkeypatch, name, case, size, verdict):
    monkeypatch.setitem(flows.SIZES, "core", size)
    found = verdict_on(flow_of(name), f"profile/{case}", 3)
    assert found.verdict == verdict, found.why
