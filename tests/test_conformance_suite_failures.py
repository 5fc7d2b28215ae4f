"""What a session, a judge or a key may run into: small programs and functions that fail in one way each."""

import json
import math
import sys
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from conformance import plain
from conformance.suite import sheet as sheets
from conformance.suite.checks.form import Implementation
from conformance.suite.checks.path_judge import flaw_of, is_fine
from conformance.suite.checks.timing import ask_time
from conformance.suite.process import CheckFailure, Process, Transcript
from conformance.suite.session import Limits, Session, read_outcome, with_walls
from scene import Cap, Collision, Fourier, Horizon, Mushroom, State, Stem
from scene.refusal import BadInput

STEP = {"cmd": "step", "scene": {"table": "cap", "r": 1.0}, "t_end": 9.0,
        "state": {"t": 0.0, "x": 0.0, "y": 0.5, "vx": 0.0, "vy": 1.0}}  # fmt: skip
INTRODUCTION = {
    "protocol": 1, "name": "failing", "version": "1", "language": "Python", "profiles": ["step"],
    "tables": ["cap"], "laws": ["constant"],
}  # fmt: skip


def program(tmp_path: Path, lines: str) -> list[str]:
    """Return the command of a program that introduces itself and then does what the lines say."""
    file = tmp_path / "program.py"
    begin = f"import os, sys, time\nsys.stdin.readline()\nprint({json.dumps(INTRODUCTION)!r}, flush=True)\n"
    file.write_text(begin + lines)
    return [sys.executable, "-I", "-S", str(file)]


def failure_of(call: Any, *args: Any) -> tuple[str, str]:
    """Return the verdict and the reason of a call that must fail."""
    with pytest.raises(CheckFailure) as found:
        call(*args)
    return found.value.verdict, found.value.why


def test_a_restart_that_fails_ends_the_session(tmp_path):
    """The second process dies before it introduces itself; a third is not tried."""
    command = program(tmp_path, "os.replace(__file__, __file__ + '.gone')\n")
    with Session(command, Limits(timeout=20.0, restarts=5)) as session:
        session.start()
        assert failure_of(session.ask, STEP)[0] == "crashed"
        for _ in range(2):
            verdict, why = failure_of(session.ask, STEP)
            assert verdict == "error"
            assert why.startswith(
                "not asked: the restart failed, crashed: exited with status 2 before it answered"
            )
        assert session.n_restarts == 1
        assert failure_of(session.stop)[0] == "error"


def test_a_program_that_is_gone_at_a_restart_ends_the_session(tmp_path):
    command = [
        str(tmp_path / "run"),
        *program(tmp_path, "os.remove(sys.argv[1])\n")[1:],
        str(tmp_path / "run"),
    ]
    (tmp_path / "run").symlink_to(sys.executable)
    with Session(command, Limits(timeout=20.0, restarts=5)) as session:
        session.start()
        assert failure_of(session.ask, STEP)[0] == "crashed"
        assert "the restart failed" in failure_of(session.ask, STEP)[1]


def test_a_process_that_runs_on_after_stop_is_timed_out(tmp_path):
    process = Process(program(tmp_path, "while True: time.sleep(0.01)\n"), Transcript())
    try:
        process.exchange(b"{}", 20.0)
        assert failure_of(process.finish, b"stop", 0.1) == ("timed-out", "still running 0.1 s after `stop`")
    finally:
        process.kill()


def test_a_process_that_ends_badly_after_stop_has_crashed(tmp_path):
    process = Process(program(tmp_path, "sys.stdin.readline()\nsys.exit(3)\n"), Transcript())
    try:
        process.exchange(b"{}", 20.0)
        assert failure_of(process.finish, b"stop", 20.0) == ("crashed", "exited with status 3 after `stop`")
    finally:
        process.kill()


@pytest.mark.parametrize(
    ("lines", "why"),
    [
        ("os.close(0)\ntime.sleep(60)\n", "no answer within 0.5 s"),
        ("os.close(0)\nos.close(1)\nos.close(2)\nos._exit(4)\n", "exited with status 4"),
    ],
)  # fmt: skip
def test_a_pipe_that_breaks_while_a_line_is_written_is_no_error_of_ours(tmp_path, lines, why):
    """The line is longer than a pipe holds, so that writing goes on when the other end is closed."""
    process = Process(program(tmp_path, lines), Transcript())
    try:
        process.exchange(b"{}", 20.0)
        assert failure_of(process.exchange, b" " * 2**22, 0.5 if "0.5" in why else 20.0)[1].startswith(why)
    finally:
        process.kill()


HIT = {"outcome": "collision", "t": 0.5, "x": 0.0, "y": 1.0, "vx": 0.0, "vy": -1.0}


def test_a_wall_that_is_left_out_is_named_from_the_place():
    cap = {"table": "cap", "r": 1.0}
    assert with_walls(dict(HIT), cap)["wall"] == "arc"
    assert with_walls({**HIT, "y": 0.125}, cap)["wall"] == "base"
    path = with_walls({"steps": [{**HIT, "wall": "base"}, dict(HIT), {"outcome": "undecided"}]}, cap)
    assert [step.get("wall") for step in path["steps"]] == ["base", "arc", None]
    for scene in (None, 5, {"table": "cap"}, {"table": "cap", "r": -1.0}):
        assert "wall" not in with_walls(dict(HIT), scene)
    moving = {"table": "cap", "r": {"kind": "fourier", "mean": 1.0, "omega": 1.0, "sin": [0.1]}}
    assert "wall" not in with_walls({**HIT, "t": 1e400}, moving)
    assert failure_of(read_outcome, HIT) == ("wrong-format", "`wall` is missing")
    assert failure_of(read_outcome, {"error": "out of memory"}) == ("error", "out of memory")


def test_a_flight_time_that_is_left_out_follows_from_the_times():
    assert read_outcome({**HIT, "wall": "arc"}, 0.125).dt == 0.375
    assert read_outcome({**HIT, "wall": "arc", "dt": 0.25}, 0.125).dt == 0.25


def in_session(answer: Any, profiles: tuple[str, ...] = ("step", "trajectory", "flow", "time")) -> Session:
    """Return a session with a function: from a request to its answer without its seq."""

    def line(request: bytes) -> bytes:
        asked = json.loads(request)
        if asked["cmd"] == "start":
            return json.dumps({**INTRODUCTION, "profiles": profiles}).encode()
        return json.dumps({"seq": asked["seq"], **answer(asked)}).encode()

    session = Session(line)
    session.start()
    return session


CAP, START = Cap(r=1.0), State(0.0, 0.0, 0.5, 0.0, 1.0)
FELL = {**HIT, "wall": "arc", "dt": 0.5}


@pytest.mark.parametrize("where", ["t", "x", "y", "vx", "vy"])
def test_answers_that_lead_to_no_state_fail(where):
    side = Implementation(in_session(lambda _: FELL), "step")
    for number in (math.inf, math.nan):
        verdict, why = failure_of(side, CAP, replace(START, **{where: number}), 9.0)
        assert verdict == "fail"
        assert why.startswith("its answers lead to the state")
    assert failure_of(side, CAP, START, math.inf)[0] == "fail"
    assert side(CAP, START, 9.0).wall == "arc"


def test_steps_that_are_too_many_or_go_on_after_the_end_fail():
    end = {"outcome": "horizon", "t": 9.0, "x": 0.0, "y": 0.5, "vx": 0.0, "vy": 1.0}
    for steps, n, is_fine_ in (
        ([FELL, FELL], 2, True), ([FELL, end], 2, True), ([end], 2, True), ([FELL], 2, False),
        ([FELL, FELL], 1, False), ([end, FELL], 2, False), ([FELL, end, end], 3, False), ([], 1, False),
        ([], 0, True),
    ):  # fmt: skip
        side = Implementation(in_session(lambda _, steps=steps: {"steps": steps}), "trajectory")
        if is_fine_:
            assert len(side.path(CAP, START, n)) == len(steps)
        else:
            assert failure_of(side.path, CAP, START, n)[0] == "fail"


def test_an_error_or_another_number_of_outcomes_ends_a_question():
    side = Implementation(
        in_session(lambda _: {"steps": [FELL, {"outcome": "undecided", "reason": "late"}]}), "trajectory"
    )
    assert len(side.path(CAP, START, 3)) == 2
    assert failure_of(side.flown, CAP, [START], 1.0)[0] == "wrong-format"
    broken = Implementation(in_session(lambda _: {"error": "disk full"}), "flow")
    assert failure_of(broken.flown, CAP, [START], 1.0) == ("error", "disk full")


@pytest.mark.parametrize(
    ("answer", "verdict"),
    [
        ({"ns": [1], "steps": [FELL]}, "fail"),
        ({"ns": [1, 1, 1], "steps": [FELL]}, "fail"),
        ({"ns": [1, 1], "steps": []}, "fail"),
        ({"ns": [1, 1], "steps": [FELL, FELL]}, "fail"),
        ({"ns": [10**12, 1], "steps": [FELL]}, "fail"),
        (FELL, "fail"),
        ({"error": "no clock"}, "error"),
        ({"ns": [1, 1], "steps": [FELL]}, ""),
    ],
)
def test_a_timing_is_of_as_many_repeats_as_were_asked_for(answer, verdict):
    session = in_session(lambda _: answer)
    if verdict:
        assert failure_of(ask_time, session, CAP, START, 1, 2)[0] == verdict
    else:
        assert ask_time(session, CAP, START, 1, 2).ns == [1, 1]


def test_a_profile_that_is_not_offered_is_unsupported():
    side = Implementation(in_session(lambda _: FELL, ("flow",)), "flow")
    assert failure_of(lambda: side.by("trajectory", "step", scene=CAP)) == (
        "unsupported", "profile trajectory or step"
    )  # fmt: skip
    assert side.by("step", "flow", scene=CAP).profile == "flow"


SWELLING = Fourier(mean=1.0, omega=1.0, sin=(0.125,))
WALKS = {
    "cap": (Cap(r=SWELLING), State(0.0, 0.125, 0.25, 1.0, 2.0)),
    "stem": (Stem(w=SWELLING, h=1.25, slope=0.25), State(0.0, 0.125, -0.25, 1.5, -1.0)),
    "mushroom": (Mushroom(r=1.0, w=0.5, h=SWELLING), State(0.0, 0.125, 0.25, 0.75, 2.0)),
    "narrowing": (
        Mushroom(r=2.0, nu=Fourier(0.5, 1.0, cos=(0.125,)), h=1.0),
        State(0.0, 0.5, -0.25, 0.75, 2.0),
    ),
}


@pytest.mark.parametrize("name", WALKS)
def test_a_number_that_is_off_is_a_flaw_of_its_hit(name):
    """Each number of each hit of a right path, moved by 1e-5 of the size: one flaw is named, at that hit."""
    scene, start = WALKS[name]
    path = plain.trajectory(scene, start, 10, 1e300)
    errors: dict[str, list[float]] = {}
    assert flaw_of(scene, start, path, errors) == ""
    assert sorted(errors) == ["bounce", "flight", "place"]
    assert all(is_fine(errors[kind], 2.0**-36) for kind in ("place", "bounce"))
    for at, hit in enumerate(path):
        for field in ("dt", "t", "x", "y", "vx", "vy"):
            for sign in (1, -1):
                moved = replace(hit, **{field: getattr(hit, field) + sign * 1e-5})
                flaw = flaw_of(
                    scene, start, [*path[:at], moved], {kind: [*found] for kind, found in errors.items()}
                )
                assert flaw.startswith(f"outcome {at + 1} "), (hit, field, sign, flaw)


def coasted(state: State, t: float) -> Horizon:
    return Horizon(t, state.x + state.vx * t, state.y + state.vy * t, state.vx, state.vy)


BEYOND = "outcome 1 is beyond a wall, or was on the way"
BOX, TABLE = Stem(w=1.0, h=1.0, slope=0.25), Mushroom(r=1.0, w=0.5, h=1.0)


@pytest.mark.parametrize(
    ("scene", "start", "t"),
    [
        (CAP, State(0.0, 0.0, 0.5, 0.0, 1.0), 0.5),
        (CAP, State(0.0, 0.5, 0.25, 1.0, 0.0), math.sqrt(15) / 4 - 0.5),
        (CAP, State(0.0, -0.5, 0.25, -1.0, 0.0), math.sqrt(15) / 4 - 0.5),
        (CAP, State(0.0, 0.0, 0.5, 0.0, -1.0), 0.5),
        (BOX, State(0.0, 0.0, -0.5, 0.0, 1.0), 0.5),
        (BOX, State(0.0, 0.0, -0.5, 0.0, -1.0), 0.5),
        (BOX, State(0.0, 0.0, -0.5, 1.0, 0.0), 0.875),
        (BOX, State(0.0, 0.0, -0.5, -1.0, 0.0), 0.875),
        (TABLE, State(0.0, 0.25, 0.5, 0.0, 1.0), math.sqrt(15) / 4 - 0.5),
        (TABLE, State(0.0, 0.25, 0.5, 0.0, -1.0), 1.5),
        (TABLE, State(0.0, 0.75, 0.5, 0.0, -1.0), 0.5),
        (TABLE, State(0.0, 0.25, -0.5, 1.0, 0.0), 0.25),
    ],
)
def test_a_horizon_beyond_a_wall_is_a_flaw(scene, start, t):
    """A little before the wall all is right, a little beyond and far beyond it is not."""
    assert flaw_of(scene, start, [coasted(start, t * 0.9999)], {}) == ""
    for late in (1.0001, 1.5, 4.0, 50.0):
        assert flaw_of(scene, start, [coasted(start, t * late)], {}) == BEYOND


def test_a_wall_on_the_way_is_a_flaw():
    """The particle goes out through the base beside the mouth, and is inside again at the end."""
    down = State(0.0, 0.75, 0.5, -1.0, -1.0)  # past the base at x = 1/4 ... 3/4, then on in the stem
    assert flaw_of(TABLE, down, [coasted(down, 0.75)], {}) == ""
    aside = State(0.0, 0.9, 0.25, -1.0, -1.0)
    assert flaw_of(TABLE, aside, [coasted(aside, 0.75)], {}) == BEYOND
    hit = Collision("base", 0.5, 0.5, 0.25, 0.0, 0.0, 1.0)
    assert flaw_of(TABLE, State(0.0, 0.25, 0.5, 0.0, -1.0), [hit], {}) == BEYOND
    assert flaw_of(TABLE, State(0.0, 0.75, 0.5, 0.0, -1.0), [replace(hit, x=0.75)], {}) == ""


def test_what_comes_after_nothing_or_gains_speed_at_rest_is_a_flaw():
    start = State(0.0, 0.0, 0.5, 0.0, 1.0)
    hit = Collision("arc", 0.5, 0.5, 0.0, 1.0, 0.0, -1.0)
    assert flaw_of(CAP, start, [hit], {}) == ""
    assert flaw_of(CAP, start, [replace(hit, vy=1.0)], {}) != ""
    before = Collision("arc", -1.5, -1.5, 0.0, -1.0, 0.0, -1.0)
    assert flaw_of(CAP, start, [before], {}) != ""
    assert flaw_of(CAP, start, [Horizon(0.25, 0.0, 0.75, 0.0, 1.0 + 1e-6)], {}) != ""
    assert flaw_of(CAP, start, [], {}) == ""


def key_of(tmp_path: Path) -> tuple[Path, dict[str, Any]]:
    questions = tmp_path / "q.jsonl"
    key = {"level": "core", "seed": 5, "corpus": sheets.vectors.manifest().digest, "fresh": []}
    return questions, key


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (None, "No such file"),
        ("{", "cannot be read"),
        (b"\xff", "cannot be read"),
        ("[" * 100_000, "cannot be read"),
        ({"seed": "5"}, "cannot be read"),
        ({"fresh": [5]}, "cannot be read"),
        ({"more": 5}, "cannot be read"),
        ({"corpus": "0" * 64}, "is of another corpus: write the questions anew"),
    ],
    ids=str,
)
def test_a_key_that_is_damaged_or_of_another_corpus_is_refused(tmp_path, change, word):
    questions, key = key_of(tmp_path)
    file = sheets.key_file(questions)
    if isinstance(change, dict):
        file.write_text(json.dumps(key | change))
    elif change is not None:
        file.write_bytes(change if isinstance(change, bytes) else change.encode())
    with pytest.raises(BadInput, match=word) as refused:
        sheets.read_key(questions)
    assert str(file) in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_transcript_keeps_both_ends():
    kept = Transcript()
    kept.add(b"a" * 2**15)
    kept.add(b"b" * 5)
    assert kept.n_dropped == 0
    kept.add(b"c" * 2**15)
    assert kept.n_dropped == 5
    text = kept.text()
    assert text.startswith("a" * 2**15)
    assert text.endswith("c" * 2**15)
    assert "[... 5 bytes left out ...]" in text
    assert "b" not in text.replace("bytes", "")
