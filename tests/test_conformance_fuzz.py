"""Spoilt lines and files against the servers, the runner and the loader: refused, no traceback, no hang.

`MUSHROOMS_LINES=20000 pytest tests/test_conformance_fuzz.py` is the deep run: 20,000 of each kind, 120,000 in
all, some twenty minutes.
"""

from __future__ import annotations

import io
import json
import os
import signal
import time
from collections import Counter
from contextlib import contextmanager, suppress

import msgspec
import pytest
from support import fuzz
from support.schemas import validator
from test_conformance_session import made_up

import fast
import fast.__main__ as fast_server
import reference.__main__ as reference_server
from conformance import plain
from conformance.grading.grade import grade
from conformance.suite import answers
from conformance.suite.process import Trouble
from scene import BadInput, load
from scene.protocol.wire import serve

N_LINES = int(os.environ.get("MUSHROOMS_LINES", "300"))
LIMIT = 120.0  # seconds for one line: the time limit of `mushrooms check`
SERVERS = {
    "reference": lambda feed, out: serve(
        "r", reference_server.step, reference_server.follow, feed, out, timer=reference_server.clock
    ),
    "fast": lambda feed, out: serve(
        "f",
        fast.next_collision,
        fast_server.follow,
        feed,
        out,
        flow=fast_server.carry,
        timer=fast_server.clock,
    ),
    "plain": lambda feed, out: serve("p", plain.next_collision, plain.trajectory, feed, out, flow=plain.flow),
}


@contextmanager
def limit(line):
    """Fail, naming the line, when it takes too long."""

    def stop(*_):
        raise TimeoutError(line[:500])

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, LIMIT)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


@pytest.mark.parametrize("name", SERVERS)
def test_a_server_answers_every_line_with_one_line(name, tally):
    slowest = 0.0
    SERVERS[name](map(msgspec.json.encode, fuzz.WARM_UP), io.BytesIO())  # compiles
    for line in fuzz.lines(1, N_LINES, fuzz.requests):
        out = io.BytesIO()
        with limit(line):
            begin = time.perf_counter()
            SERVERS[name]([line + b"\n"], out)
            slowest = max(slowest, time.perf_counter() - begin)
        found = out.getvalue()
        assert found.count(b"\n") == bool(line.strip()), (line, found)
        if found:
            answer = json.loads(found)
            assert validator("protocol", "Answer").is_valid(answer), (line, answer)
            tally[answer.get("outcome", "other")] += 1
    assert min(tally["rejected"], tally["collision"]) > N_LINES / 20
    tally["slowest in ms"] = round(1000 * slowest)


def judged(line, cmd, vector) -> tuple[str, str]:
    try:
        found = grade(vector, answers.read_answer(line, cmd, 1))
    except Trouble as trouble:
        return trouble.verdict, trouble.why
    return found.verdict, found.why


def test_the_runner_reads_every_line_or_says_wrong_format(tally):
    vector = made_up(0)
    for line in fuzz.lines(2, N_LINES, fuzz.answers):
        for read in (answers.read_introduction, lambda sent: answers.check_echo([0.1, -0.0], sent)):
            with suppress(Trouble):
                read(line)
        for cmd in answers.ANSWERS:
            verdict, why = judged(line, cmd, vector)
            assert "\n" not in why
            assert len(why) < 1000
            tally[verdict] += 1
    assert min(tally["wrong-format"], tally["pass"], tally["fail"]) > N_LINES / 20


@pytest.mark.parametrize("suffix", [".json", ".toml"])
def test_a_scene_file_is_read_or_refused_in_one_line(suffix, tmp_path, tally):
    path = tmp_path / f"scene{suffix}"
    for line in fuzz.lines(3, N_LINES, lambda draw: draw.choice(fuzz.scenes_known)):
        path.write_bytes(line if suffix == ".json" else fuzz.as_toml(line))
        with limit(line):
            refusal = refused(path)
        assert "\n" not in refusal, line
        tally["refused" if refusal else "read"] += 1
    assert min(tally["refused"], tally["read"]) > N_LINES / 20


def refused(path) -> str:
    try:
        load(str(path))
    except BadInput as refusal:
        return str(refusal)
    return ""


def test_a_traceback_or_a_hang_would_be_seen(monkeypatch):
    def crash(*_):
        raise KeyError("vy")

    monkeypatch.setitem(SERVERS, "reference", lambda feed, out: serve("r", crash, crash, feed, out))
    with pytest.raises(KeyError):
        test_a_server_answers_every_line_with_one_line("reference", Counter())
    monkeypatch.setattr("test_conformance_fuzz.LIMIT", 0.05)
    with pytest.raises(TimeoutError, match="a line"), limit(b"a line"):
        time.sleep(5.0)
