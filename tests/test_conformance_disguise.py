"""Disguises are exact, and nobody passes by memory: not even one who knows the seed."""

from __future__ import annotations

from fractions import Fraction

import msgspec
import pytest
from support import replayer

import fast
from conformance import suite, vectors
from conformance.grading.agreement import middle
from conformance.grading.grade import grade
from conformance.suite import disguise
from conformance.suite.disguise import (
    Disguise,
    asked,
    drawn_disguise,
    drawn_horizons,
    drawn_states,
    published,
)
from fast.__main__ import carry, follow
from scene import BangBang, from_data
from scene.laws import value
from scene.precision import decimals
from scene.tables import laws

SEEDS = (1, 2)
GROUPS = ("moving-cap", "horizon")


@pytest.fixture(scope="module")
def corpus():
    return vectors.load("stress")


@pytest.mark.parametrize("seed", SEEDS)
def test_the_fast_stepper_answers_as_well_in_disguise(seed, corpus, tally):
    for vector in [*corpus[seed::5], *drawn_horizons(corpus, seed)]:
        worn = drawn_disguise(vector, seed)
        answer = vectors.answer(asked(vector, worn), fast.next_collision, follow, carry)
        found = grade(vector, published(answer, worn))
        assert found.verdict in ("pass", "declined"), (vector.id, str(worn), found)
        tally[f"{found.verdict}"] += 1
        tally["as published" if worn == Disguise() else "in disguise"] += 1


def test_no_question_is_asked_as_it_is_published(corpus):
    """But where all that can be changed is its sign, and nothing has one."""
    same = [v.id for v in corpus if asked(v, drawn_disguise(v, 3)) == v]
    assert len(same) < 0.01 * len(corpus), same


def test_a_disguise_is_taken_off_without_a_rounding(corpus):
    for vector in corpus[::7]:
        worn = drawn_disguise(vector, 5)
        known = msgspec.to_builtins(middle(vector.expect[0], vector.state))
        inverse = worn._replace(length=-worn.length, time=-worn.time)
        assert published(published(known, inverse), worn) == known


def test_knots_that_begin_elsewhere_are_the_same_law(corpus, tally):
    ctx = decimals(40)
    for vector in corpus[::3]:
        worn = drawn_disguise(vector, 11)._replace(is_mirrored=False, length=0, time=0)
        if not (worn.first_knot or worn.periods):
            continue
        before, after = (laws(from_data(v.scene)) for v in (vector, asked(vector, worn)))
        for name, law in before.items():
            if isinstance(law, BangBang):
                tally["laws"] += law != after[name]
                for part in (0.0, 0.123, 0.4, 0.77):
                    t = law.knots[0][0] + part
                    assert abs(value(ctx, law, t) - value(ctx, after[name], t)) < 1e-38
    assert tally["laws"] > 80


def test_a_scene_stays_one_scene_in_a_run(corpus):
    group = [v for v in corpus if v.group == "moving-cap"]
    assert len({str(asked(v, drawn_disguise(v, 2)).scene) for v in group}) == 1
    assert len({str(asked(v, drawn_disguise(v, s)).scene) for v in group[:1] for s in range(20)}) > 15


def test_drawn_horizons_are_exact(corpus):
    for vector in drawn_horizons(corpus, 8):
        (step,) = vector.expect[0].steps
        s = Fraction(vector.t_end) - Fraction(vector.state.t)
        for place, speed in (("x", "vx"), ("y", "vy")):
            low, high = step.ends(place)
            exact = Fraction(getattr(vector.state, place)) + Fraction(getattr(vector.state, speed)) * s
            assert low <= exact <= high
            assert high - low <= abs(exact) * Fraction(1, 10**22)


def test_all_that_is_drawn_follows_from_the_seed(corpus):
    for draw in (drawn_horizons, lambda known, seed: drawn_states(known, seed, 9)):
        steps = [v for v in corpus if v.kind == "step" and v.level == "core"]
        assert draw(steps, 4) == draw(steps, 4)
        assert draw(steps, 4) != draw(steps, 5)


@pytest.mark.parametrize("seed", [None, 9])
@pytest.mark.parametrize("otherwise", ["undecided", "last"])
def test_a_replayer_is_not_accepted(seed, otherwise):
    """One who knows every answer, and one who knows the run's seed beside."""
    run = suite.check(replayer.command(seed, otherwise, GROUPS), seed=9, groups=GROUPS)
    known = [r.verdict for r in run.results if r.group in GROUPS]
    assert known.count("pass") == (len(known) if seed else 0)
    assert run.exit_code() == 1
    assert any("property" in line for line in run.objections())


def test_a_replayer_would_pass_without_disguise(monkeypatch):
    monkeypatch.setattr("conformance.suite.run.drawn_disguise", lambda *_: Disguise())
    run = suite.check(replayer.command(None, "undecided", GROUPS), seed=9, groups=GROUPS)
    assert {r.verdict for r in run.results if r.group in GROUPS} == {"pass"}
    assert run.exit_code() == 1  # but not what no file holds
    assert run.counts("drawn")["declined"] == disguise.N_DRAWN
