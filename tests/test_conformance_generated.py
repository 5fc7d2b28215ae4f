"""Questions of one run: exact images of vectors, and questions in scenes that no file holds.

Right steppers pass them. A stepper that is right in the corpus alone does not, nor one that knows the corpus
by heart, whether or not it knows the seed.
"""

import json
from functools import cache
from itertools import count
from math import inf
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest
from support.depth import deep_but
from support.faulty_steppers import faulty, starts
from support.seldom_wrong import FAULTS
from support.truth import certified_answer

import fast
from conformance import plain, suite, vectors
from conformance.cases.draw import Draw, Question
from conformance.cases.generated import (
    ROUND,
    _is_steady,
    certified_draw,
    family_of,
    fresh,
    fresh_one,
)
from conformance.cases.run_families import WALLS
from conformance.cases.scenes import many_legs
from conformance.cases.table import FAMILIES
from conformance.grading.agreement import SHARP, grade, middle
from conformance.plain.step import PlainPath
from conformance.suite.checks import checks_of
from conformance.suite.symmetry import Transform, draw_transform
from conformance.verify import Verdict, verify_line
from fast import flows
from fast.__main__ import carry, follow
from scene import BadInput, BangBang, Fourier, Horizon, Mushroom, State, Undecided, from_data
from scene.given import MAX_KNOTS
from scene.tables import laws

SEEDS = (1, 2)
SOME = 20  # of the first seed's: what every run of the tests asks
EACH = 40  # of one row
DEALT = [name for name, family in FAMILIES.items() if family.weight]


@cache
def asked_in_a_run(seed, n=ROUND):
    return list(fresh(seed, n))


@cache
def asked_of(name, number):
    """Return a question of a row, whatever the run asks there."""
    return certified_draw(FAMILIES[name], "tests", number)


def assert_right_steppers_pass(vector):
    for steppers in (
        (fast.next_collision, follow, carry),
        (plain.next_collision, plain.trajectory, plain.flow),
    ):
        found = grade(vector, vectors.answer(vector, *steppers))
        assert found.verdict == "pass", (vector, found)


@pytest.mark.parametrize("some", deep_but([(1, SOME), (1, ROUND), (2, ROUND)], (1, SOME)))
def test_right_steppers_pass(some):
    for vector in asked_in_a_run(*some):
        assert_right_steppers_pass(vector)


@pytest.mark.parametrize("name", deep_but(DEALT, "returning-stem-left", "thin-ring"))
def test_right_steppers_pass_each_row(name):
    for number in (1, 2, 3):
        assert_right_steppers_pass(asked_of(name, number))


def features(vector):
    """Name what a question has that the corpus rarely has."""
    scene, step = from_data(vector.scene), vector.expect[0].steps[0]
    kinds = {type(law) for law in laws(scene).values()}
    return {
        f"{vector.scene['table']}, {step.wall}": True,
        vector.kind: True,
        "before 0": vector.state.t < 0,
        "of mixed laws": kinds >= {Fourier, BangBang},
        "hits beyond the first": vector.kind == "trajectory" and vector.collisions > 1,
        "named": "name" in vector.scene,
        "late": abs(vector.state.t) > 500 * (scene.period or inf),
        "more than 20 legs": any(len(getattr(law, "knots", ())) > 20 for law in laws(scene).values()),
    }


# How often what is named is asked in a round.
LEAST = {
    **{f"{table}, {wall}": 4 for table, wall in WALLS},
    **dict.fromkeys(("trajectory", "flow"), ROUND / 12),
    **dict.fromkeys(("before 0", "named"), ROUND / 8),
    **dict.fromkeys(("of mixed laws", "late", "hits beyond the first"), ROUND / 20),
    "more than 20 legs": 4,
}


@pytest.mark.deep
@pytest.mark.parametrize("seed", SEEDS)
def test_all_is_asked_that_the_corpus_asks_seldom(seed, tally):
    known = {msgspec.json.encode(vector.scene) for vector in vectors.load("stress")}
    for vector in asked_in_a_run(seed):
        found = features(vector)
        tally.update(name for name, is_so in found.items() if is_so)
        assert msgspec.json.encode(vector.scene) not in known
        assert draw_transform(vector, seed) == Transform()
    assert {name: tally[name] for name, least in LEAST.items() if tally[name] < least} == {}


def test_every_round_holds_each_row_as_often_as_its_weight_says():
    dealt = [[family_of(7, number).name for number in range(n, n + ROUND)] for n in (1, ROUND + 1)]
    assert {name: dealt[0].count(name) for name in DEALT} == {n: FAMILIES[n].weight for n in DEALT}
    assert sorted(dealt[0]) == sorted(dealt[1])
    assert dealt[0] != dealt[1]


@pytest.mark.deep
def test_what_is_drawn_follows_from_the_seed():
    assert list(fresh(1, 12)) == asked_in_a_run(1, SOME)[:12]
    assert list(fresh(3, 12)) != asked_in_a_run(1, SOME)[:12]
    assert [fresh_one(1, number) for number in range(1, 13)] == asked_in_a_run(1, SOME)[:12]


def test_what_the_verifier_does_not_prove_is_not_asked(monkeypatch):
    calls = count(1)

    def shy(record):
        return Verdict("not proved", "") if next(calls) == 1 else verify_line(record)

    right = fresh_one(1, 1)
    monkeypatch.setattr("conformance.cases.certify.verify_line", shy)
    assert fresh_one(1, 1).state != right.state
    assert next(calls) > 2


@pytest.mark.parametrize(("x", "is_asked"), [(0.6, True), (0.5 + 2.0**-36, False), (0.5 - 2.0**-36, False)])
def test_a_flow_whose_capture_hangs_by_a_thread_is_not_asked(x, is_asked):
    """The walls that are met are the same on both sides of it."""
    still = Mushroom(r=1.0, w=0.5, h=1.0)
    question = Question(still, State(0.0, x, 0.25, 0.0, 4.0), 0.25, 2, True)
    assert _is_steady(still, question) == is_asked


def test_hundreds_of_draws_that_are_none_end_no_run():
    """One in forty meets the base of a mushroom: in some runs of thousands four hundred in a row do not."""
    family, calls = FAMILIES["anywhere-cap-arc"], count()

    def ask(draw):
        if next(calls) < 1000:
            raise BadInput("none")
        return family.ask(draw)

    assert certified_draw(family._replace(ask=ask), "tests", 1).id == "fresh/1"


def test_laws_have_as_many_legs_as_there_may_be():
    assert len(many_legs(Draw("legs"), 1.0, 2.0, 1.5, MAX_KNOTS - 1).knots) == MAX_KNOTS
    for number in (1, 2):
        found = laws(from_data(asked_of("many-knots-stem", number).scene)).values()
        assert max(len(law.knots) for law in found if isinstance(law, BangBang)) == MAX_KNOTS


def fails(faulty, questions):
    """Tell whether a faulty stepper answers some question wrong."""
    return any(
        grade(v, vectors.answer(v, faulty.step, faulty.trajectory, faulty.flow)).verdict == "fail"
        for v in questions
    )


@pytest.mark.parametrize("name", FAULTS)
def test_a_stepper_that_is_seldom_wrong_is_found_out(name):
    """By some question of its row, or of the first of a run."""
    faulty, row = FAULTS[name]
    in_row = (asked_of(row, number) for number in range(1, EACH + 1))
    assert fails(faulty, in_row if row else asked_in_a_run(1, 3 * SOME))


@pytest.mark.parametrize("name", [name for name in FAULTS if name.endswith("in known scenes")])
def test_a_stepper_right_in_the_corpus_alone_is_right_in_steps(name):
    steps = [v for v in asked_in_a_run(1, 3 * SOME) if v.kind == "step"]
    assert fails(FAULTS[name][0], steps) == (FAULTS[name][0].path is PlainPath)


@pytest.mark.deep
@pytest.mark.parametrize("name", FAULTS)
def test_one_of_three_runs_finds_each_out(name):
    assert any(fails(FAULTS[name][0], asked_in_a_run(seed)) for seed in (1, 2, 3))


def test_a_particle_that_is_lost_after_its_capture_has_no_interval(monkeypatch):
    """The interval begins and ends at the arc, far below the mouth's edge; later no collision is decided."""
    scene, start, t_end = Mushroom(r=1.0, w=0.25, h=1.0), State(0.0, 0.75, 0.25, 0.1, 4.0), 9.0
    calls = count(1)

    def lost(of, state, until):
        return Undecided("lost") if next(calls) == 9 else plain.next_collision(of, state, until)

    for carried in (plain.flow, carry):
        ((arrived, interval),) = carried(scene, [start], t_end)
        assert isinstance(arrived, Horizon)
        assert interval is not None
    assert plain.flow(scene, [start], t_end, lost) == [(Undecided("lost"), None)]
    run = SimpleNamespace(outcomes=[Undecided("lost")], t_in=np.array([1.0]), t_out=np.array([2.0]))
    monkeypatch.setattr(flows, "carry", lambda *_: run)
    assert carry(scene, [start], t_end) == [(Undecided("lost"), None)]


GROUPS = ("moving-cap", "horizon")


@pytest.fixture(scope="module")
def corpus():
    return vectors.load("stress")


@pytest.mark.parametrize("sample", deep_but([(1, 20), (1, 5), (2, 5)], (1, 20)))
def test_the_fast_stepper_answers_as_well_after_a_transform(sample, corpus, tally):
    seed, every = sample
    for vector in corpus[seed::every]:
        worn = draw_transform(vector, seed)
        answer = vectors.answer(worn.apply(vector), fast.next_collision, follow, carry)
        found = grade(vector, worn.restore(answer))
        assert found.verdict in ("pass", "declined"), (vector.id, str(worn), found)
        assert found.verdict == "pass" or vector.level == "stress"
        assert vector.level != "core" or not found.ulps > SHARP
        tally[f"{found.verdict}"] += 1
        tally["as published" if worn == Transform() else "transformed"] += 1


def test_no_question_is_asked_as_it_is_published(corpus):
    """But where all that can be changed is its sign, and nothing has one."""
    same = [v.id for v in corpus if draw_transform(v, 3).apply(v) == v]
    assert len(same) < 0.01 * len(corpus), same


def test_a_transform_is_taken_back_without_a_rounding(corpus):
    for vector in corpus[::7]:
        worn = draw_transform(vector, 5)
        known = msgspec.to_builtins(middle(vector.expect[0], vector.state))
        inverse = worn._replace(length=-worn.length, time=-worn.time)
        assert worn.restore(inverse.restore(known)) == known


def test_a_scene_stays_one_scene_in_a_run(corpus):
    group = [v for v in corpus if v.group == "moving-cap"]
    assert len({str(draw_transform(v, 2).apply(v).scene) for v in group}) == 1
    assert len({str(draw_transform(v, s).apply(v).scene) for v in group[:1] for s in range(20)}) > 15


def test_all_that_is_drawn_follows_from_the_seed():
    for check in checks_of():
        one, again, other = (list(check.asks(Draw(seed), check.profiles[0])) for seed in ("4", "4", "5"))
        assert one == again, check.name
        assert one != other or check.name == "promise/bad-requests"  # what the schema forbids is not drawn


UNDECIDED = {"outcome": "undecided", "reason": "not in the book"}


def remembered(seed, groups):
    """Return the certified answer to every question of some groups, as it will be asked."""
    found = {}
    for vector in (v for v in vectors.load("stress") if v.group in groups):
        worn = Transform() if seed is None else draw_transform(vector, seed)
        inverse = worn._replace(length=-worn.length, time=-worn.time)
        found[key_of(vectors.request(worn.apply(vector), 0))] = inverse.restore(certified_answer(vector))
    return found


def key_of(request):
    return json.dumps({name: part for name, part in request.items() if name != "seq"}, sort_keys=True)


def replayer(seed, is_bold, groups):
    """Return a program without physics that knows the certified answers, and how a run of the seed asks.

    What it does not know it leaves undecided; a bold one says what it said last.
    """
    known, last = remembered(seed, groups), UNDECIDED

    def fault(request, answer):
        nonlocal last
        if request.get("cmd") in ("start", "echo") or any("vy" not in state for state in starts(request)):
            return answer(request)
        found = known.get(key_of(request), last if is_bold else UNDECIDED)
        if request["cmd"] == "step":
            last = found
        if request["cmd"] == "flow" and "states" not in found:
            found = {"states": [UNDECIDED] * len(request["states"])}
        return {"seq": request["seq"], **found}

    return faulty(fault)


@pytest.mark.parametrize("seed", deep_but([None, 9], 9))
@pytest.mark.parametrize("is_bold", deep_but([False, True], True))
def test_a_replayer_is_not_accepted(seed, is_bold):
    """One that knows every answer, and one that knows the run's seed too."""
    run = suite.check(replayer(seed, is_bold, GROUPS), seed=9, groups=[*GROUPS, "property"])
    known = [r.verdict for r in run.results if r.group in GROUPS]
    assert known.count("pass") == (len(known) if seed else 0)
    assert run.exit_code() == 1
    assert any("property" in line for line in run.objections())


def test_a_replayer_would_pass_without_transforms(monkeypatch):
    monkeypatch.setattr("conformance.suite.run.draw_transform", lambda *_: Transform())
    run = suite.check(replayer(None, False, GROUPS), seed=9, groups=[*GROUPS, "fresh"])
    assert {r.verdict for r in run.results if r.group in GROUPS} == {"pass"}
    assert run.exit_code() == 1  # but not what no file holds
    assert run.counts("fresh").keys() == {"declined"}
