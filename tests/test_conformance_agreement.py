"""fast against reference, step by step, on generated geometries."""

from __future__ import annotations

import os
from fractions import Fraction

import msgspec
import pytest
from hypothesis import given, settings
from support.truth import is_delicate, proved_step

import fast
from conformance.cases.attacks import stepped
from conformance.grading.agreement import Enclosed, compare, middle
from conformance.strategies import scenes_and_states
from conformance.vectors import NUMBERS, Expectation, certified
from scene import Collision, Horizon, Rejected, State, Undecided, load

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


def off(c, dt=1.0, **changes):
    return msgspec.structs.replace(c, dt=c.dt * dt, **changes)


# What is told in place of the right answer up to t_end, how it compares, and how an attack judges it.
SPOILT = {
    "right": (10.0, lambda c: c, "agrees", "agreed"),
    "right horizon": (0.11, lambda c: c, "agrees", "agreed"),
    "another wall": (10.0, lambda c: off(c, wall="floor"), "wall", "wrong"),
    "time": (10.0, lambda c: off(c, 1 + 1e-13), "numbers", "wrong"),
    "velocity": (10.0, lambda c: off(c, vy=-c.vy), "numbers", "wrong"),
    "nan": (10.0, lambda c: off(c, vx=float("nan")), "numbers", "wrong"),
    "place at the horizon": (0.11, lambda c: msgspec.structs.replace(c, x=c.x + 1e-9), "numbers", "wrong"),
    "a horizon": (10.0, lambda c: Horizon(c.t, c.x, c.y, c.vx, c.vy), "outcome", "wrong"),
    "none": (10.0, lambda c: Undecided("shy"), "undecided", "undecided"),
    "a refusal": (10.0, lambda c: Rejected("no"), "outcome", "refused"),
}


@pytest.mark.parametrize("name", SPOILT)
def test_comparison_catches_spoilt_answers(name):
    t_end, spoil, compared, judged = SPOILT[name]
    truth = proved_step(SCENE, STATE, t_end)
    (right,) = middle(truth, STATE)
    assert compare(spoil(right), truth, STATE, BOUND).kind == compared
    assert stepped(spoil(right), truth, STATE).kind == judged
    assert stepped(right, None, STATE).kind == "open"


def fallen(x: Fraction) -> Expectation:
    """A hit of a floor, certified to be exact and not to move with its start."""
    numbers = {"dt": Fraction(1), "x": x, "y": Fraction(-1), "vx": Fraction(0), "vy": Fraction(1)}
    ends = {name: (number, number) for name, number in numbers.items()}
    return Expectation("collision", (certified(ends, [0.0] * 5, "floor", digits=800),))


@pytest.mark.parametrize(
    ("told", "true", "ulps"),
    [
        (0.0, Fraction(0), 0.0),
        (5e-324, Fraction(5e-324), 0.0),
        (1e-323, Fraction(5e-324), 2.0),
        # An exact zero is measured by the vector that it belongs to.
        (5e-324, Fraction(0), pytest.approx(0, abs=1e-300)),
        (0.0, Fraction(5e-324), float("inf")),
    ],
)
def test_exact_answers_where_nothing_may_move(told, true, ulps):
    met = Collision("floor", 1.0, 1.0, told, -1.0, 0.0, 1.0)
    assert compare(met, fallen(true), State(0.0, 0.0, 0.0, 0.0, -1.0), BOUND).ulps == ulps


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
