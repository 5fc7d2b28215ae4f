"""A stepper that declines: one verdict in a dialogue and behind files, whatever the seed draws.

Both steppers answer as the fast one does. One declines a share of all states by their numbers, one all states
that begin late. What is too much stands in docs/protocol.md, and once in the code: `declines_too_much`.
"""

import hashlib
import json
from fractions import Fraction
from math import comb

import pytest
from support.depth import deep_but
from support.faulty_steppers import faulty

from conformance import profiles, vectors
from conformance.suite import run as suite, sheet as sheets
from conformance.suite.checks import checks_of, flows
from conformance.suite.checks.form import AnswerTally
from conformance.suite.result import DOUBT, declines_too_much
from conformance.suite.session import Session
from scene import Horizon, Undecided, Undefined, load

ASKED = (
    "property/mirror",
    "promise/hits",
    "promise/late-starts",
    "promise/endings",
    "promise/spelling",
    "profile/captured-share",
)
SLOW = ("long-flow", "longest-flow", "long-trajectory")
OPEN = {"outcome": "undecided", "reason": "by content"}
NUMBERS = ("x", "y", "vx", "vy")


def by_content(share):
    """Return what declines a share of all states, each by its own numbers."""

    def declines(state):
        digest = hashlib.sha256(repr([state[name] for name in NUMBERS]).encode()).digest()
        return int.from_bytes(digest[:8], "big") < share * 2**64

    return declines


def late(state):
    return abs(state["t"]) > 100


def declining(declines):
    """Return an honest stepper that leaves what follows some states undecided."""

    def fault(request, answer):
        found = answer(request)
        if found.get("outcome") in ("collision", "horizon") and declines(request["state"]):
            return {"seq": found["seq"], **OPEN}
        if found.get("steps") and "ns" not in found:
            before = [request["state"], *found["steps"]]
            first = next((i for i, at in enumerate(before[:-1]) if declines(at)), len(before))
            if first < len(found["steps"]) and found["steps"][first]["outcome"] != "rejected":
                return {**found, "steps": [*found["steps"][:first], OPEN]}
        if found.get("states"):
            pairs = zip(request["states"], found["states"], strict=True)
            ends = [OPEN if end["outcome"] == "horizon" and declines(at) else end for at, end in pairs]
            return {**found, "states": ends}
        return found

    return faulty(fault)


@pytest.fixture
def few(monkeypatch):
    """Some vectors of every kind, and some checks; of the profile few particles, which decline it or not."""
    chosen = [vector for vector in vectors.load("core") if vector.group not in SLOW][::25]
    checks = [check for check in checks_of() if check.name in ASKED]
    monkeypatch.setattr(suite, "choose", lambda *_: chosen)
    monkeypatch.setattr(suite, "N_FRESH", dict.fromkeys(suite.N_FRESH, 0))
    monkeypatch.setattr(suite, "checks_of", lambda *_: checks)
    monkeypatch.setattr(sheets, "checks_of", lambda *_: checks)
    monkeypatch.setitem(flows.SIZES, "core", flows.Size(60, 20.0, 0.3))


def runs(declines, seed, folder):
    """Return the run of a dialogue, and that of the answers to a file of questions."""
    answer = declining(declines)
    with Session(answer) as session:
        dialogue = suite.converse(session, suite.RunQuestions("core", seed))
    sheet = sheets.Sheet("core", seed)
    path = folder / "answers.jsonl"
    path.write_bytes(b"\n".join(answer(line) for line in sheet.lines()[:-1]))
    return dialogue, sheets.grade_answers(sheet, sheets.read_answers(path))


@pytest.mark.parametrize("seed", deep_but(range(1, 6), 3))
@pytest.mark.parametrize("share", [0.006, 0.03])
def test_a_small_share_is_accepted_whatever_the_mode_and_the_seed(few, tmp_path, share, seed):
    for run in runs(by_content(share), seed, tmp_path):
        assert (run.objections(), run.exit_code()) == ([], 0)
        assert sum(result.n_undecided for result in run.results) > 0


@pytest.mark.parametrize("seed", deep_but(range(1, 6), 1))
@pytest.mark.parametrize(
    ("declines", "part"),
    [(by_content(0.6), "vectors and fresh questions"), (late, "promise/late-starts")],
    ids=["60 %", "late starts"],
)
def test_too_much_is_refused_whatever_the_mode_and_the_seed(few, tmp_path, declines, part, seed):
    for run in runs(declines, seed, tmp_path):
        assert run.exit_code() == 1
        assert any(part in line for line in run.objections())
        assert not [result for result in run.results if result.verdict == "fail"]


@pytest.mark.parametrize(
    ("n_declined", "n", "limit", "is_too_much"),
    [
        (0, 0, 0.25, False),
        (3, 3, 0.25, False),  # 1 in 64 by chance
        (4, 4, 0.25, True),
        (12, 32, 0.25, False),  # a halving of intervals that declines 2.4 % of all: one group by chance
        (15, 32, 0.25, True),
        (13, 26, 0.25, True),  # every path ends so after its first hit
        (6, 38, 0.25, False),
        (1, 3, 0.05, False),
        (300, 2000, 0.05, True),
        (30_000, 30_000, 0.25, True),
    ],
)
def test_what_is_too_much(n_declined, n, limit, is_too_much):
    assert declines_too_much(n_declined, n, limit) == is_too_much


@pytest.mark.parametrize("limit", [0.05, 0.25])
def test_the_bound_is_the_binomial_one(limit):
    """Against exact fractions: no float is taken for a number of ways."""
    p = Fraction(limit)
    for n in (1, 2, 5, 7, 14, 40):
        for k in range(n + 1):
            exact = sum(comb(n, i) * p**i * (1 - p) ** (n - i) for i in range(k, n + 1))
            assert declines_too_much(k, n, limit) == (exact < DOUBT), (k, n)


def test_equal_questions_count_once():
    """Whatever their number in the conversation, and in whatever order a flow has its states."""
    one, other = {"x": 1.0}, {"x": 2.0}
    step = {"cmd": "step", "scene": {"r": 1.0}, "state": one, "t_end": 1.0}
    path = {**step, "cmd": "trajectory", "collisions": 3}
    flow = {"cmd": "flow", "scene": {"r": 1.0}, "states": [one, other, one], "t_end": 1.0}
    tally = AnswerTally()
    for seq in (1, 2):
        tally.add({**step, "seq": seq}, ["undecided"])
        tally.add({**path, "seq": seq}, ["collision", "collision", "undecided"])
        tally.add({**flow, "seq": seq}, ["horizon", "undecided", "horizon"])
        tally.add({**flow, "states": [other]}, ["undecided"])
    assert tally.counts() == (3, 1 + 3 + 2)
    tally.excuse(path)
    assert tally.counts() == (2, 3)


def test_what_is_asked_as_steps_does_not_speak_for_paths():
    tally = AnswerTally()
    for i in range(100):
        tally.add({"cmd": "step", "state": {"x": i}}, ["collision"])
    for i in range(13):
        tally.add({"cmd": "trajectory", "state": {"x": i}}, ["collision", "undecided"])
    assert tally.counts() == (13, 26)


def test_a_missing_answer_is_an_undecided_one(few, tmp_path):
    sheet = sheets.Sheet("core", 1)
    late_ones = [q.seq for q in sheet.questions.values() if q.case == "promise/late-starts"]
    answer = declining(by_content(0.0))
    lines = {json.loads(line).get("seq"): answer(line) for line in sheet.lines()[:-1]}
    path = tmp_path / "answers.jsonl"
    for missing, code in ((late_ones[:2], 0), (late_ones[2:], 1)):
        path.write_bytes(b"\n".join(line for seq, line in lines.items() if seq not in missing))
        run = sheets.grade_answers(sheet, sheets.read_answers(path))
        (found,) = [result for result in run.results if result.id == "promise/late-starts"]
        assert found.n_undecided == len(missing)
        assert (run.exit_code(), bool(run.objections())) == (code, bool(code)), run.objections()


STATISTICS = {
    "work-identity": lambda flow: profiles.work_identity(flow, CAP, n_particles=200, kT=10.0)[0],
    "captured-share": lambda flow: profiles.captured_share(
        flow, CAP, p_nc=0.4, n_particles=200, energy=10.0, bias=0.1
    ),
    "mean-growth": lambda flow: profiles.mean_growth(
        flow, CAP, m1=0.1, largest=1.0, n_particles=200, energy=10.0, bias=0.1
    ),
    "reversal": lambda flow: profiles.reversal(flow, CAP, n_particles=200, energy=10.0),
}
CAP = load("moving-cap")


def leaving(outcome, share):
    """Return a flow that moves no particle, and gives a share of them another outcome."""

    def flow(scene, states, t_end):
        ends = [Horizon(t_end, s.x, s.y, s.vx, s.vy) for s in states]
        return [(outcome if i < share * len(ends) else end, None) for i, end in enumerate(ends)]

    return flow


@pytest.mark.parametrize("name", STATISTICS)
def test_an_undecided_particle_is_not_lost(name):
    """It may have had any value, so the margin grows as for a lost one; all undecided tell nothing."""
    whole, left, lost, none = (
        STATISTICS[name](leaving(outcome, share))
        for outcome, share in (
            (Undecided("x"), 0.0),
            (Undecided("x"), 0.1),
            (Undefined("corner"), 0.1),
            (Undecided("x"), 1.0),
        )
    )
    assert (left.lost, left.undecided, left.is_depleted) == (0, 20, False)
    assert (lost.lost, lost.undecided, lost.is_depleted) == (20, 0, True)
    assert left.margin == lost.margin > whole.margin
    assert (none.is_met, none.is_depleted, none.has_power) == (True, False, False)
