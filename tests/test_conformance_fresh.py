"""Questions in scenes that no file holds: right steppers pass, who is right in the corpus alone does not."""

from functools import cache
from math import inf
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest
from support.depth import deep_but
from support.seldom_wrong import FAULTS

import fast
from conformance import plain, vectors
from conformance.cases.draw import Draw, Question
from conformance.cases.flow_families import any_marks
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
from conformance.grading.grade import grade
from conformance.plain.flow import PlainPath
from conformance.suite.symmetry import Transform, draw_transform
from conformance.verify import Verdict, verify_line
from fast import __main__ as fast_program
from fast.__main__ import carry, follow
from scene import (
    BadInput,
    BangBang,
    Fourier,
    Horizon,
    Mushroom,
    State,
    Undecided,
    from_data,
)
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


@pytest.mark.parametrize("asked", deep_but([(1, SOME), (1, ROUND), (2, ROUND)], (1, SOME)))
def test_right_steppers_pass(asked):
    for vector in asked_in_a_run(*asked):
        assert_right_steppers_pass(vector)


@pytest.mark.parametrize("name", deep_but(DEALT, "returning-stem-left", "thin-ring"))
def test_right_steppers_pass_each_row(name):
    for number in (1, 2, 3):
        assert_right_steppers_pass(asked_of(name, number))


@pytest.mark.deep
@pytest.mark.parametrize("seed", SEEDS)
def test_all_is_asked_that_the_corpus_asks_seldom(seed, tally):
    asked = asked_in_a_run(seed)
    known = {msgspec.json.encode(vector.scene) for vector in vectors.load("stress")}
    for vector in asked:
        scene, step = from_data(vector.scene), vector.expect[0].steps[0]
        kinds = {type(law) for law in laws(scene).values()}
        assert msgspec.json.encode(vector.scene) not in known
        assert draw_transform(vector, seed) == Transform()
        tally[f"{vector.scene['table']}, {step.wall}"] += 1
        tally["before 0"] += vector.state.t < 0
        tally["of mixed laws"] += kinds >= {Fourier, BangBang}
        tally[vector.kind] += 1
        tally["hits beyond the first"] += (vector.collisions - 1) if vector.kind == "trajectory" else 0
        tally["named"] += "name" in vector.scene
        tally["late"] += abs(vector.state.t) > 500 * (scene.period or inf)
        tally["more than 20 legs"] += any(len(getattr(law, "knots", ())) > 20 for law in laws(scene).values())
    assert all(tally[f"{table}, {wall}"] >= 4 for table, wall in WALLS)
    assert min(tally[kind] for kind in ("trajectory", "flow")) > ROUND / 12
    assert min(tally["before 0"], tally["named"], tally["hits beyond the first"]) > ROUND / 8
    assert min(tally["of mixed laws"], tally["late"]) > ROUND / 20
    assert tally["more than 20 legs"] >= 4


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
    asked = []

    def shy(record):
        asked.append(record)
        return Verdict("not proved", "") if len(asked) == 1 else verify_line(record)

    right = fresh_one(1, 1)
    monkeypatch.setattr("conformance.cases.certify.verify_line", shy)
    assert fresh_one(1, 1).state != right.state
    assert len(asked) > 1


@pytest.mark.parametrize(("x", "is_asked"), [(0.6, True), (0.5 + 2.0**-36, False), (0.5 - 2.0**-36, False)])
def test_a_flow_whose_capture_hangs_by_a_thread_is_not_asked(x, is_asked):
    """The walls that are met are the same on both sides of it."""
    still = Mushroom(r=1.0, w=0.5, h=1.0)
    asked = Question(still, State(0.0, x, 0.25, 0.0, 4.0), 0.25, 2, any_marks)
    assert _is_steady(still, asked) == is_asked


def test_hundreds_of_draws_that_are_none_end_no_run():
    """One in forty meets the base of a mushroom: in some runs of thousands four hundred in a row do not."""
    n_left = 1000

    def ask(draw):
        nonlocal n_left
        n_left -= 1
        if n_left >= 0:
            raise BadInput("none")
        return FAMILIES["anywhere-cap-arc"].ask(draw)

    family = FAMILIES["anywhere-cap-arc"]._replace(ask=ask)
    assert certified_draw(family, "tests", 1).id == "fresh/1"


def test_laws_have_as_many_legs_as_there_may_be():
    assert len(many_legs(Draw("legs"), 1.0, 2.0, 1.5, MAX_KNOTS - 1).knots) == MAX_KNOTS
    for number in (1, 2):
        found = laws(from_data(asked_of("many-knots-stem", number).scene)).values()
        assert max(len(law.knots) for law in found if isinstance(law, BangBang)) == MAX_KNOTS


def fails(faulty, asked):
    """Tell whether a faulty stepper answers some question wrong."""
    return any(
        grade(v, vectors.answer(v, faulty.step, faulty.trajectory, faulty.flow)).verdict == "fail"
        for v in asked
    )


@pytest.mark.parametrize("name", FAULTS)
def test_who_is_wrong_where_chance_seldom_looks_is_found_out(name):
    """By some question of its row, or of the first of a run."""
    faulty, row = FAULTS[name]
    in_row = (asked_of(row, number) for number in range(1, EACH + 1))
    assert fails(faulty, in_row if row else asked_in_a_run(1, 3 * SOME))


@pytest.mark.parametrize("name", [name for name in FAULTS if name.endswith("in known scenes")])
def test_who_goes_on_right_in_the_corpus_alone_is_right_in_steps(name):
    steps = [v for v in asked_in_a_run(1, 3 * SOME) if v.kind == "step"]
    assert fails(FAULTS[name][0], steps) == (FAULTS[name][0].path is PlainPath)


@pytest.mark.deep
@pytest.mark.parametrize("name", FAULTS)
def test_one_of_three_runs_finds_each_out(name):
    assert any(fails(FAULTS[name][0], asked_in_a_run(seed)) for seed in (1, 2, 3))


def test_who_is_lost_after_a_captured_stay_tells_none(monkeypatch):
    """The stay begins and ends at the arc, far below the mouth's edge; later no collision is decided."""
    scene, start, t_end = Mushroom(r=1.0, w=0.25, h=1.0), State(0.0, 0.75, 0.25, 0.1, 4.0), 9.0
    asked = []

    def lost(of, state, until):
        asked.append(state)
        return Undecided("lost") if len(asked) == 9 else plain.next_collision(of, state, until)

    ((arrived, stay),) = plain.flow(scene, [start], t_end)
    assert isinstance(arrived, Horizon)
    assert stay is not None
    assert plain.flow(scene, [start], t_end, lost) == [(Undecided("lost"), None)]
    ((arrived, stay),) = carry(scene, [start], t_end)
    assert isinstance(arrived, Horizon)
    assert stay is not None
    run = SimpleNamespace(outcomes=[Undecided("lost")], t_in=np.array([1.0]), t_out=np.array([2.0]))
    monkeypatch.setattr(fast_program, "carry_judged", lambda *_: run)
    assert carry(scene, [start], t_end) == [(Undecided("lost"), None)]
