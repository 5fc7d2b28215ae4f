"""Spoilt lines and files against the servers, the runner and the loader: refused, no traceback.

Nonsense of the right seq, anywhere in a run, ends in verdicts; nothing but trouble leaves a session.
`MUSHROOMS_LINES=20000 MUSHROOMS_RUNS=1000 pytest tests/test_conformance_fuzz.py` is the deep run: 20,000
lines of each kind, 120,000 in all, and 1000 runs; some thirty minutes.
"""

import io
import json
import os
import random
import time
from contextlib import suppress

import msgspec
import pytest
from support import fuzz
from support.faulty_steppers import faulty
from support.schemas import validator
from test_conformance_session import made_up

import fast
import fast.__main__ as fast_server
import reference.__main__ as reference_server
from conformance import plain, vectors
from conformance.grading.grade import grade
from conformance.suite import answers, reports
from conformance.suite import run as suite
from conformance.suite.checks import ensembles, timing
from conformance.suite.process import CheckFailure
from conformance.suite.result import VERDICTS
from conformance.suite.session import Limits
from scene import BadInput, load
from scene.protocol.wire import serve

N_LINES = int(os.environ.get("MUSHROOMS_LINES", "300"))
N_RUNS = int(os.environ.get("MUSHROOMS_RUNS", "5"))
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


@pytest.mark.parametrize("name", SERVERS)
def test_a_server_answers_every_line_with_one_line(name, tally):
    slowest = 0.0
    SERVERS[name](map(msgspec.json.encode, fuzz.WARM_UP), io.BytesIO())  # compiles
    for line in fuzz.lines(1, N_LINES, fuzz.requests):
        out = io.BytesIO()
        begin = time.perf_counter()
        SERVERS[name]([line + b"\n"], out)
        slowest = max(slowest, time.perf_counter() - begin)
        assert slowest < LIMIT, line
        found = out.getvalue()
        assert found.count(b"\n") == bool(line.strip()), (line, found)
        if found:
            answer = json.loads(found)
            assert validator("protocol", "Answer").is_valid(answer), (line, answer)
            tally[answer.get("outcome", "other")] += 1
    assert min(tally["rejected"], tally["collision"]) > N_LINES / 20
    tally["slowest in ms"] = round(1000 * slowest)


def test_the_runner_reads_every_line_or_says_wrong_format(tally):
    vector = made_up(0)
    for line in fuzz.lines(2, N_LINES, fuzz.answers):
        for read in (answers.read_introduction, lambda sent: answers.check_echo([0.1, -0.0], sent)):
            with suppress(CheckFailure):
                read(line)
        for cmd in answers.ANSWERS:
            try:
                found = grade(vector, answers.read_answer(line, cmd, 1))
            except CheckFailure as trouble:
                found = trouble
            assert "\n" not in found.why
            assert len(found.why) < 1000
            tally[found.verdict] += 1
    assert min(tally["wrong-format"], tally["pass"], tally["fail"]) > N_LINES / 20


@pytest.mark.parametrize("suffix", [".json", ".toml"])
def test_a_scene_file_is_read_or_refused_in_one_line(suffix, tmp_path, tally):
    path = tmp_path / f"scene{suffix}"
    for line in fuzz.lines(3, N_LINES, lambda draw: draw.choice(fuzz.scenes_known)):
        path.write_bytes(line if suffix == ".json" else fuzz.as_toml(line))
        refusal = ""
        try:
            load(str(path))
        except BadInput as error:
            refusal = str(error)
        assert "\n" not in refusal, line
        tally["refused" if refusal else "read"] += 1
    assert min(tally["refused"], tally["read"]) > N_LINES / 20


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
    monkeypatch.setitem(ensembles.SIZES, "core", ensembles.Size(6, 2.0, 0.5))
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
