"""What protocol 1 promises: kept by our implementations, and each breach of it met."""

from __future__ import annotations

import pytest
from support.promise_breakers import FAULTS, Breaker

from conformance.suite import promises, session, timing
from conformance.suite.session import Session


@pytest.fixture
def opened(monkeypatch):
    """Return what opens a session with a faulty implementation."""
    monkeypatch.setattr(timing, "N_TRIES", 2)

    def start(fault) -> Session:
        monkeypatch.setattr(session, "Process", lambda *_: Breaker(fault))
        found = Session(["in-process"])
        found.start()
        return found

    return start


def test_an_honest_one_keeps_them_all(opened):
    found = {
        name: (verdict, why) for name, verdict, why, _ in promises.ask_promises(opened(lambda r, a: a(r)))
    }
    assert tuple(found) == promises.PROMISES
    assert {verdict for verdict, _ in found.values()} == {"pass"}, found


@pytest.mark.parametrize("name", FAULTS)
def test_a_breach_is_met(opened, name):
    promise, verdict, fault = FAULTS[name]
    ((_, met, why, _),) = promises.ask_promises(opened(fault), (promise,))
    assert met == verdict, why
    assert why.isprintable()


def test_every_promise_has_its_breach():
    assert {promise for promise, _, _ in FAULTS.values()} == set(promises.PROMISES)
