"""Nonsense of the right seq, anywhere in a run, ends in verdicts; nothing but trouble leaves a session.

`MUSHROOMS_RUNS=1000 pytest tests/test_conformance_nonsense.py` is the deep run, some ten minutes.
"""

from __future__ import annotations

import os
import random

import pytest
from support.nonsense import Nonsense

from conformance import vectors
from conformance.suite import reports, session
from conformance.suite import run as suite
from conformance.suite.checks import ensembles, timing
from conformance.suite.result import VERDICTS
from conformance.suite.session import Limits

N_RUNS = int(os.environ.get("MUSHROOMS_RUNS", "5"))
STRESS = vectors.load("stress")
UNREADABLE = next(v for v in STRESS if "table" not in v.scene)  # to be refused, whatever comes after it
FEW = (*vectors.load("core")[::350], *STRESS[-3:], UNREADABLE)


@pytest.fixture
def small(monkeypatch):
    """Make a run short: few questions, few particles, no long timings."""
    monkeypatch.setattr(suite, "choose", lambda *_: FEW)
    monkeypatch.setattr(suite, "TIMED_LEAST", 1)
    monkeypatch.setattr(timing, "READABLE", 1e-4)
    monkeypatch.setattr(timing, "MAX_REPEAT", 8)
    monkeypatch.setitem(ensembles.SIZES, "core", ensembles.Size(6, 2.0, 0.5))


def test_nonsense_ends_in_verdicts(monkeypatch, small, tally):
    for seed in range(N_RUNS):
        draw = random.Random(seed)
        share = draw.choice((0.02, 0.1, 0.5))
        monkeypatch.setattr(session, "Process", lambda *_, d=draw, s=share: Nonsense(d, s))
        run = suite.check(["nonsense"], seed=seed, limits=Limits(restarts=10**6))
        tally.update(run.counts())
        assert set(run.counts()) <= set(VERDICTS)
        assert all(result.why.isprintable() for result in run.results)
        assert run.exit_code() in (0, 1, 2)
        reports.to_json(run)
        reports.to_junit(run)
    assert min(tally["wrong-format"], tally["error"], tally["fail"], tally["pass"]) > N_RUNS // 2
