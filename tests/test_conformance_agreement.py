"""fast against reference, step by step, on generated geometries."""

from __future__ import annotations

import os
from fractions import Fraction

import pytest
from hypothesis import given, settings
from support.truth import is_delicate, proved_step

import fast
from conformance.grading.agreement import Truth, compare
from conformance.strategies import scenes_and_states
from scene import Collision, Horizon, State, Undecided, load

N_STEPS = int(os.environ.get("MUSHROOMS_STEPS", "1000"))  # MUSHROOMS_STEPS=20000 for the whole
BOUND = 4.0  # backward ulps
UNDECIDED_SHARE = 0.04  # the strategies aim at corners and edges on purpose


def test_fast_agrees_with_reference(tally):
    worst = 0.0

    @settings(max_examples=N_STEPS)
    @given(scenes_and_states())
    def step(drawn):
        nonlocal worst
        scene, state, t_end = drawn
        answer = fast.next_collision(scene, state, t_end)
        truth = proved_step(scene, state, t_end)
        found = compare(answer, truth, state, BOUND)
        tally["steps"] += 1
        tally[type(answer).__name__.lower()] += 1
        if isinstance(answer, Collision):
            tally[answer.wall] += 1
        worst = max(worst, found.ulps)
        assert found.kind in ("agrees", "undecided"), (found, answer)
        if found.kind == "undecided":
            assert is_delicate(scene, state, t_end), answer

    step()
    tally["worst backward ulps (thousandths)"] = round(1000 * worst)
    assert tally["steps"] >= N_STEPS
    assert tally["collision"] >= N_STEPS // 3
    assert tally["undecided"] <= UNDECIDED_SHARE * N_STEPS


SCENE = load("moving-cap")
STATE = State(0.1, 0.2, 0.3, 10.0, -3.0)


@pytest.mark.parametrize(
    ("spoil", "kind"),
    [
        (lambda c: Collision("floor", c.dt, c.t, c.x, c.y, c.vx, c.vy), "wall"),
        (lambda c: Collision(c.wall, c.dt * (1 + 1e-13), c.t, c.x, c.y, c.vx, c.vy), "numbers"),
        (lambda c: Collision(c.wall, c.dt, c.t, c.x, c.y, c.vx, -c.vy), "numbers"),
        (lambda c: Collision(c.wall, c.dt, c.t, c.x, c.y, float("nan"), c.vy), "numbers"),
        (lambda c: Horizon(c.t, c.x, c.y, c.vx, c.vy), "outcome"),
        (lambda c: Undecided("shy"), "undecided"),
        (lambda c: c, "agrees"),
    ],
)
def test_comparison_catches_spoilt_answers(spoil, kind):
    truth = proved_step(SCENE, STATE, 10.0)
    assert isinstance(truth.outcome, Collision)
    assert compare(spoil(truth.outcome), truth, STATE, BOUND).kind == kind


def test_horizon_is_compared_too():
    truth = proved_step(SCENE, STATE, 0.11)
    assert isinstance(truth.outcome, Horizon)
    right = truth.outcome
    assert compare(right, truth, STATE, BOUND).kind == "agrees"
    wrong = Horizon(right.t, right.x + 1e-9, right.y, right.vx, right.vy)
    assert compare(wrong, truth, STATE, BOUND).kind == "numbers"


def test_exact_answers_where_nothing_may_move():
    truth = Truth(
        Collision("floor", 1.0, 1.0, 0.0, -1.0, 0.0, 1.0),
        [Fraction(n) for n in (1, 0, -1, 0, 1)],
        [[0.0] * 5] * 5,
    )
    assert compare(truth.outcome, truth, State(0.0, 0.0, 0.0, 0.0, -1.0), 4).ulps == 0.0
    off = Collision("floor", 1.0, 1.0, 5e-324, -1.0, 0.0, 1.0)
    assert compare(off, truth, State(0.0, 0.0, 0.0, 0.0, -1.0), 4).ulps == float("inf")
    numbers = [Fraction(n) for n in (1, 0, -1, 0, 1)]
    numbers[1] = Fraction(5e-324)
    tiny = Truth(off, numbers, [[0.0] * 5] * 5)
    rounded = Collision("floor", 1.0, 1.0, 1e-323, -1.0, 0.0, 1.0)
    assert compare(rounded, tiny, State(0.0, 0.0, 0.0, 0.0, -1.0), 4).ulps == 2.0
