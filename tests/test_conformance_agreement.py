"""fast against reference, step by step, on generated geometries."""

from __future__ import annotations

import os
from fractions import Fraction

import pytest
from hypothesis import given, settings
from support.truth import is_delicate, proved_step

import fast
from conformance.grading.agreement import Enclosed, compare, middle
from conformance.strategies import scenes_and_states
from conformance.vectors import NUMBERS, Expectation, certified
from scene import Collision, Horizon, State, Undecided, load

N_STEPS = int(os.environ.get("MUSHROOMS_STEPS", "400"))  # MUSHROOMS_STEPS=20000 for the whole
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
        assert found.kind in ("agrees", "undecided") or truth is None, (found, answer)
        if found.kind != "agrees":
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
    (right,) = middle(truth, STATE)
    assert isinstance(right, Collision)
    assert compare(spoil(right), truth, STATE, BOUND).kind == kind


def test_horizon_is_compared_too():
    truth = proved_step(SCENE, STATE, 0.11)
    (right,) = middle(truth, STATE)
    assert isinstance(right, Horizon)
    assert compare(right, truth, STATE, BOUND).kind == "agrees"
    wrong = Horizon(right.t, right.x + 1e-9, right.y, right.vx, right.vy)
    assert compare(wrong, truth, STATE, BOUND).kind == "numbers"


def fallen(x: Fraction) -> Expectation:
    """A hit of a floor, certified to be exact and not to move with its start."""
    numbers = {"dt": Fraction(1), "x": x, "y": Fraction(-1), "vx": Fraction(0), "vy": Fraction(1)}
    ends = {name: (number, number) for name, number in numbers.items()}
    return Expectation("collision", (certified(ends, [0.0] * 5, "floor", digits=800),))


def test_exact_answers_where_nothing_may_move():
    start, tiny = State(0.0, 0.0, 0.0, 0.0, -1.0), Fraction(5e-324)
    exact, off, further = (Collision("floor", 1.0, 1.0, x, -1.0, 0.0, 1.0) for x in (0.0, 5e-324, 1e-323))
    assert compare(exact, fallen(Fraction(0)), start, BOUND).ulps == 0.0
    assert compare(off, fallen(tiny), start, BOUND).ulps == 0.0
    assert compare(further, fallen(tiny), start, BOUND).ulps == 2.0
    # An exact zero is measured by the vector that it belongs to.
    assert 0 < compare(off, fallen(Fraction(0)), start, BOUND).ulps < 1e-300
    assert compare(exact, fallen(tiny), start, BOUND).ulps == float("inf")


def test_an_enclosed_answer_and_a_wide_truth():
    truth = proved_step(SCENE, STATE, 10.0, 40)
    (step,) = truth.steps
    ends = [step.ends(name) for name in NUMBERS]
    assert compare(Enclosed(step.wall, ends), truth, STATE, BOUND).kind == "agrees"
    off = [
        (low, high) if i else (high + high / 10**20, high + high / 10**19)
        for i, (low, high) in enumerate(ends)
    ]
    found = compare(Enclosed(step.wall, off), truth, STATE, 0.0)
    assert (found.kind, 0 < found.ulps < 1) == ("numbers", True)
    (right,) = middle(truth, STATE)
    low, high = step.ends("x")
    wide = certified(
        {**dict(zip(NUMBERS, ends, strict=True)), "x": (low, high + 1)}, step.allowance, step.wall
    )
    assert compare(right, Expectation("collision", (wide,)), STATE).kind == "indeterminate"
    assert compare(right, None, STATE, BOUND).kind == "indeterminate"
    assert compare(Undecided("shy"), None, STATE, BOUND).kind == "undecided"
