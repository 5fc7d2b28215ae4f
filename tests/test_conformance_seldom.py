"""What a run's fresh questions draw on purpose: right steppers answer it, who is wrong there is found out."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from support.seldom_wrong import SELDOM_WRONG, SELDOM_WRONG_PATHS, AmplitudesAdded

import fast
from conformance import plain, vectors
from conformance.cases.draws import Draw
from conformance.cases.fresh import fresh_one
from conformance.cases.in_flight import swept_scene, swept_start
from conformance.cases.seldom import DEPTHS, is_leaning, many_legs
from conformance.grading.grade import grade
from conformance.mutants import Mutant
from conformance.plain.step import Flight
from fast import __main__ as fast_program
from fast.__main__ import carry, follow
from scene import BadInput, BangBang, Collision, Horizon, Mushroom, State, Undecided, from_data
from scene.given import MAX_KNOTS
from scene.laws import bounds
from scene.tables import laws

SEEDS = (1, 2)


@cache
def question(seed, number):
    return fresh_one(seed, number)


def verdict(flight, vector):
    faulty = Mutant("faulty", "", flight)
    return grade(vector, vectors.answer(vector, faulty.step, faulty.trajectory, faulty.flow)).verdict


@pytest.mark.parametrize("name", SELDOM_WRONG)
def test_who_is_wrong_where_chance_seldom_looks_is_found_out(name):
    """In a run of either seed; the plain stepper and the fast one are right there."""
    flight, numbers = SELDOM_WRONG[name]
    for seed in SEEDS:
        asked = [question(seed, number) for number in numbers]
        assert any(verdict(flight, vector) == "fail" for vector in asked), seed
        for vector in asked:
            assert verdict(Flight, vector) == "pass", vector
            answer = vectors.answer(vector, fast.next_collision, follow, carry)
            assert grade(vector, answer).verdict == "pass", vector


@pytest.mark.parametrize("name", SELDOM_WRONG_PATHS)
def test_an_engine_of_paths_alone_that_is_wrong_there_is_found_out(name):
    """Trajectories and flows are met, in a run of either seed, though steps may be right."""
    flight, _ = SELDOM_WRONG[name]
    for seed in SEEDS:
        asked = [question(seed, number) for number in SELDOM_WRONG_PATHS[name]]
        kinds = {vector.kind for vector in asked}
        assert kinds <= {"trajectory", "flow"}
        assert {vector.kind for vector in asked if verdict(flight, vector) == "fail"} == kinds, seed
        assert {verdict(Flight, vector) for vector in asked} == {"pass"}


def test_each_depth_is_asked_and_as_many_legs_as_there_may_be():
    stems = [from_data(question(1, number).scene) for number in (2, 20, 68, 86)]
    assert all(map(is_leaning, stems))
    depths = [bounds(stem.h).highest / abs(stem.slope) for stem in stems]
    assert len({round(depth).bit_length() // 4 for depth in depths}) == len(DEPTHS)
    assert min(abs(stem.slope) for stem in stems) < 1e-12
    for number in (32, 38):
        found = laws(from_data(question(1, number).scene)).values()
        assert max(len(law.knots) for law in found if isinstance(law, BangBang)) == MAX_KNOTS
    assert len(many_legs(Draw("legs"), 1.0, 2.0, 1.5).knots) == MAX_KNOTS


@pytest.mark.parametrize("table", ["stem", "mushroom"])
def test_a_sweep_along_a_side_meets_it_for_a_short_time(table, tally):
    """It is met before the side draws back, and flying straight on leads off it again."""
    for i in range(40):
        draw = Draw(f"sweep/{i}")
        scene, t = swept_scene(draw, table)
        try:
            start, t_end = swept_start(draw, scene, t, draw.pick(("left", "right")))
        except BadInput:  # the side comes on: it would be met for longer
            continue
        hit = plain.next_collision(scene, start, t_end)
        tally[getattr(hit, "wall", "none")] += 1
        assert start.t < t < t_end
        if isinstance(hit, Collision):
            assert hit.t < t
            assert Flight(scene, start, t_end).f(hit.wall, t_end - start.t)[0] > 0
    assert tally["left"] + tally["right"] > 10


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


@pytest.mark.deep
@pytest.mark.parametrize("seed", SEEDS)
def test_deep_waves_are_asked_of_every_size(seed, tally):
    for number in range(1, 133):
        vector = question(seed, number)
        if verdict(AmplitudesAdded, vector) == "fail":
            tally[vector.kind] += 1
    assert min(tally[kind] for kind in ("step", "trajectory", "flow")) >= 1
    assert sum(tally.values()) >= 8
