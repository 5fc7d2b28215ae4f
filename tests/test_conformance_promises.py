"""What protocol 1 promises: kept by our implementations, and each breach of it met."""

from __future__ import annotations

import pytest
from support.depth import deep_among
from support.forgetful import FORGETFUL, last_bit_varies
from support.leaks import LEAKS, NO_LEAKS
from support.lenient import LENIENT
from support.promise_breakers import FAULTS, Breaker, bisecting, remembering_steps

import reference
from conformance import vectors
from conformance.suite import promises, session
from conformance.suite import run as suite
from conformance.suite.promises import changes, refusals, scenes, timing
from conformance.suite.session import Session
from fast import next_collision
from scene import BadInput, Rejected, Wall, from_data
from scene.geometry import rounded

BREACHES = {**FAULTS, **LEAKS, **LENIENT, **FORGETFUL}


@pytest.fixture
def opened(monkeypatch):
    """Return what opens a session with a faulty implementation."""
    monkeypatch.setattr(timing, "N_TRIES", 2)
    monkeypatch.setattr(timing, "READABLE", 0.1)

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


@pytest.mark.parametrize("name", deep_among(BREACHES, "a-tenth", "no-time", "remembering", "constant"))
def test_a_breach_is_met(opened, name):
    promise, verdict, fault = BREACHES[name]
    ((_, met, why, _),) = promises.ask_promises(opened(fault), (promise,))
    assert met == verdict, why
    assert why.isprintable()


@pytest.mark.parametrize(
    "name", ["repeated-questions", "absent-wall", "malformed-lines", "extra-fields", "spelling"]
)
def test_what_is_not_deterministic_is_told_so_and_nothing_else_is_blamed(opened, name):
    ((_, verdict, why, _),) = promises.ask_promises(opened(last_bit_varies()), (name,))
    assert (verdict, why.partition(":")[0]) == ("fail", "not deterministic")


@pytest.mark.parametrize("cell", [10 * 2.0**-n for n in (32, 37, 41, 44, 46)])
def test_a_coarse_one_may_not_tell_near_questions_apart_but_those_that_it_can(opened, cell):
    """Vectors let it pass, and say class B or C; a promise is no place to ask for more."""
    coarse, keeping = (bisecting(cell), "pass"), (bisecting(cell, remembering_steps(6)), "fail")
    for fault, wanted in (coarse, keeping):
        ((_, verdict, why, _),) = promises.ask_promises(opened(fault), ("near-questions",))
        assert verdict == wanted, why


def test_changed_scenes_are_told_apart_by_their_first_hits(tally):
    """What a promise asks must show: a hit in one scene is none in another of its family."""
    for state, (base, *others) in changes.families():
        first = next_collision(base, state, 100.0)
        assert changes.flaw_of(base, state, first) == ""
        for other in others:
            hit = next_collision(other, state, 100.0)
            assert changes.flaw_of(other, state, hit) == ""
            assert abs(hit.t - first.t) > 1e-3, other
            assert changes.flaw_of(other, state, first), other
            assert changes.flaw_of(base, state, hit), other
            tally["changed scenes"] += 1


def test_bad_states_are_bad_and_good_ones_good_by_the_reference(tally):
    """What a promise asks must be so: the proving stepper says the same, and leaves nothing open."""
    for scene, t in refusals.tables():
        for state, why, _ in refusals.states(scene, t):
            outcome = reference.next_collision(scene, state, t + 2.0**-6)
            assert isinstance(outcome, Rejected) == bool(why), (scene, state, why, outcome)
            tally[why or "leaves its wall"] += 1


def test_bad_scenes_are_bad_and_good_ones_good_by_proof(tally):
    judged = (*scenes.broken_at_times(), *scenes.broken_as_written(), *scenes.valid_though_near())
    for data, why in judged:
        if why:
            with pytest.raises(BadInput):
                from_data(data)
        else:
            from_data(data)
        tally[why or "valid"] += 1


@pytest.mark.parametrize("name", NO_LEAKS)
def test_errors_that_do_not_add_up_are_no_breach(opened, name):
    ((_, verdict, why, _),) = promises.ask_promises(opened(NO_LEAKS[name]), ("at-rest",))
    assert verdict == "pass", why


def test_every_promise_has_its_breach():
    assert {promise for promise, _, _ in BREACHES.values()} == set(promises.PROMISES)


def without_names(request, answer):
    """Answer as an engine that knows neither walls nor flight times."""
    found = answer(request)
    for part in (found, *found.get("steps", ())):
        part.pop("dt", None)
        part.pop("wall", None)
    return found


def test_an_engine_that_names_no_walls_and_keeps_no_flight_times_is_graded(monkeypatch, tally):
    monkeypatch.setattr(session, "Process", lambda *_: Breaker(without_names))
    monkeypatch.setattr(suite, "choose", lambda *_: vectors.load("core")[::16])
    monkeypatch.setattr(suite, "N_STATES", 4)
    monkeypatch.setattr(suite.property_checks, "ask_profiles", lambda *_: iter(()))
    run = suite.check(["in-process"], seed=1)
    assert run.objections() == []
    hits = [r for r in run.results if r.verdict == "pass" and "without dt, t is graded" in r.why]
    assert len(hits) > 60
    tally["without dt"] += len(hits)


def test_a_wall_left_out_is_named_though_the_scene_has_a_field_too_many(opened):
    """The runner reads no such scene, and took the same answer for another: its walls were not named."""

    def ignoring(request, answer):
        for place in (request, request.get("scene"), request.get("state")):
            if isinstance(place, dict):
                place.pop("hint", None)
        return without_names(request, answer)

    ((_, verdict, why, _),) = promises.ask_promises(opened(ignoring), ("extra-fields",))
    assert (verdict, why) == ("pass", "refused in: none; elsewhere ignored")


def test_every_certified_hit_is_nearest_to_its_wall(tally):
    for vector in vectors.load("core"):
        expected = vector.expect[0]
        if vector.kind == "step" and expected.outcome == "collision":
            (step,) = expected.steps
            t = float(step.centre("dt")) + vector.state.t
            place = float(step.centre("x")), float(step.centre("y"))
            met: Wall = rounded(from_data(vector.scene), t).nearest_wall(*place)
            assert met == step.wall, vector.id
            tally[met] += 1
    assert set(tally) == {"arc", "base", "left", "right", "floor"}
