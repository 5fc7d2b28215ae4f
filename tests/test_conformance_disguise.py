"""Disguises are exact, and nobody passes by memory: not even one who knows the seed."""

import msgspec
import pytest
from support.depth import deep_but
from support.replayer import replayer

import fast
from conformance import suite, vectors
from conformance.cases.draw import Draw
from conformance.cases.generated import ROUND, fresh
from conformance.grading.agreement import middle
from conformance.grading.grade import SHARP, grade
from conformance.mutants import Mutant
from conformance.mutants.kill_matrix import verdict
from conformance.plain.step import Flight
from conformance.suite.checks import checks_of
from conformance.suite.symmetry import Transform, draw_transform
from fast.__main__ import carry, follow
from scene import BangBang, Fourier
from scene.tables import laws

SEEDS = (1, 2)
GROUPS = ("moving-cap", "horizon")


@pytest.fixture(scope="module")
def corpus():
    return vectors.load("stress")


@pytest.mark.parametrize("seed", deep_but(SEEDS, SEEDS[0]))
def test_the_fast_stepper_answers_as_well_in_disguise(seed, corpus, tally):
    for vector in corpus[seed::5]:
        worn = draw_transform(vector, seed)
        answer = vectors.answer(worn.apply(vector), fast.next_collision, follow, carry)
        found = grade(vector, worn.restore(answer))
        assert found.verdict in ("pass", "declined"), (vector.id, str(worn), found)
        assert found.verdict == "pass" or vector.level == "stress"
        assert vector.level != "core" or not found.ulps > SHARP
        tally[f"{found.verdict}"] += 1
        tally["as published" if worn == Transform() else "in disguise"] += 1


def test_no_question_is_asked_as_it_is_published(corpus):
    """But where all that can be changed is its sign, and nothing has one."""
    same = [v.id for v in corpus if draw_transform(v, 3).apply(v) == v]
    assert len(same) < 0.01 * len(corpus), same


def test_a_disguise_is_taken_off_without_a_rounding(corpus):
    for vector in corpus[::7]:
        worn = draw_transform(vector, 5)
        known = msgspec.to_builtins(middle(vector.expect[0], vector.state))
        inverse = worn._replace(length=-worn.length, time=-worn.time)
        assert worn.restore(inverse.restore(known)) == known


class WavesFromFirstKnot(Flight):
    """Counts the time of every law from the first knot of any."""

    def law(self, law):
        if not isinstance(law, Fourier):
            return super().law(law)
        knots = [other.knots for other in laws(self.scene).values() if isinstance(other, BangBang)]
        return self.kinds[Fourier](law, self.state.t - (knots[0][0][0] if knots else 0.0))


@pytest.mark.deep
def test_laws_side_by_side_are_asked_in_scenes_that_no_file_holds():
    faulty = Mutant("faulty", "", WavesFromFirstKnot)
    assert any(verdict(faulty, vector) == "fail" for vector in fresh(1, ROUND) if vector.kind == "step")


def test_a_scene_stays_one_scene_in_a_run(corpus):
    group = [v for v in corpus if v.group == "moving-cap"]
    assert len({str(draw_transform(v, 2).apply(v).scene) for v in group}) == 1
    assert len({str(draw_transform(v, s).apply(v).scene) for v in group[:1] for s in range(20)}) > 15


def test_all_that_is_drawn_follows_from_the_seed():
    for check in checks_of():
        one, again, other = (list(check.asks(Draw(seed), check.profiles[0])) for seed in ("4", "4", "5"))
        assert one == again, check.name
        assert one != other or check.name == "promise/bad-requests"  # what the schema forbids is not drawn


@pytest.mark.parametrize("seed", deep_but([None, 9], 9))
@pytest.mark.parametrize("is_bold", deep_but([False, True], True))
def test_a_replayer_is_not_accepted(seed, is_bold):
    """One who knows every answer, and one who knows the run's seed beside."""
    run = suite.check(replayer(seed, is_bold, GROUPS), seed=9, groups=[*GROUPS, "property"])
    known = [r.verdict for r in run.results if r.group in GROUPS]
    assert known.count("pass") == (len(known) if seed else 0)
    assert run.exit_code() == 1
    assert any("property" in line for line in run.objections())


def test_a_replayer_would_pass_without_disguise(monkeypatch):
    monkeypatch.setattr("conformance.suite.run.draw_transform", lambda *_: Transform())
    run = suite.check(replayer(None, False, GROUPS), seed=9, groups=[*GROUPS, "fresh"])
    assert {r.verdict for r in run.results if r.group in GROUPS} == {"pass"}
    assert run.exit_code() == 1  # but not what no file holds
    assert run.counts("fresh").keys() == {"declined"}
