"""What the reference claims is true: the verifier proves it from the published line alone."""

from __future__ import annotations

import json
import random
from fractions import Fraction

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.answers_by_hand import ANSWERS
from support.depth import deep_but
from support.tables import LIFT
from support.truth import IS_DEEP, is_delicate, proved_step

import reference
from conformance.cases.certify import claimed_path
from conformance.cases.draw import wire_form
from conformance.strategies import scenes_and_states
from conformance.vectors import Expectation
from conformance.verify import Verdict, verify_line
from scene import BangBang, Cap, Fourier, Mushroom, State, Stem, load

FAR = 1e300  # the horizon of a path that is followed without one [time]


def judge(scene, state, t_end, claim, kind="step"):
    """Return what the verifier says of a claim that is written as a line of the corpus."""
    question = {"kind": kind, "scene": wire_form(scene), "state": state, "t_end": t_end}
    line = {**question, "collisions": max(len(claim.steps), 1), "expect": [claim]}
    return verify_line(json.loads(msgspec.json.encode(line)))


def prove_step(scene, state, t_end):
    """Return the reference's claim about a step, None where it is undecided; the verifier proves it."""
    claim = proved_step(scene, state, t_end)
    assert claim is None or judge(scene, state, t_end, claim) == Verdict("proved")
    return claim


def prove_path(scene, state, n_collisions, t_end=FAR, working=None):
    """Return the reference's claim about a path; the verifier proves it, as far as it goes."""
    claim = claimed_path(scene, state, n_collisions, t_end, working)
    if claim.outcome != "undecided":
        assert judge(scene, state, t_end, claim, "trajectory") == Verdict("proved")
    elif claim.steps:
        decided = Expectation("collision", claim.steps)
        assert judge(scene, state, t_end, decided, "trajectory") == Verdict("proved")
    return claim


def test_every_step_is_proved(tally):
    n_examples = 10_000 if IS_DEEP else 150

    @settings(max_examples=n_examples)
    @given(scenes_and_states())
    def proves(drawn):
        claim = prove_step(*drawn)
        tally[claim.outcome if claim else "undecided"] += 1
        assert claim or is_delicate(*drawn)
        for step in claim.steps if claim else ():
            tally[f"at {step.wall}"] += 1

    proves()
    assert min(tally["collision"], tally["horizon"]) > 0
    assert tally["collision"] + tally["horizon"] >= 0.9 * n_examples


def test_every_path_is_proved(tally):
    n_examples = 5_000 if IS_DEEP else 60

    @settings(max_examples=n_examples)
    @given(scenes_and_states(), st.integers(1, 6), st.sampled_from((None, 10, 25)))
    def proves(drawn, n, working):
        scene, state, t_end = drawn
        claim = prove_path(scene, state, n, t_end, working)
        tally[claim.outcome] += 1
        tally["enclosed starts"] += max(len(claim.steps) - 1, 0)

    proves()
    assert tally["collision"] + tally["horizon"] >= 0.8 * n_examples
    assert tally["enclosed starts"] >= n_examples / 4


WAVES = Stem(w=1.0, h=Fourier(mean=1.0, period=1.0, sin=(0.1, 0.02), cos=(0.05,)))
WIDE = Mushroom(r=1.0, h=1.0, w=0.5)
SHIVERING = Stem(w=BangBang(((0.0, 1.0), (2.0**-41, 1.0 - 2.0**-52), (2.0**-40, 1.0))), h=4.0)
TREMBLING = Cap(r=Fourier(1.0, 1.0, (-1e-30,)))
TOUCHED = 201.06192982974676  # [time]
STEPS = {
    "f rises and falls in dt = 0.07": (
        Cap(r=Fourier(mean=1.0, omega=1.0, cos=(0.25,))),
        State(0.0, 0.75, 1.0, -1.0, 0.6875, "arc"),
        50.0,
    ),
    "met by the floor at 1/8 of its period": (LIFT, State(0.0, 0.0, -1.875, 0.0, 0.0), 50.0),
    "not yet met by the floor": (LIFT, State(0.0, 0.0, -1.875, 0.0, 0.0), 0.0625),
    "out of the mouth": (WIDE, State(0.0, 0.0, -0.5, 0.125, 1.0), 50.0),
    "along the mouth": (WIDE, State(0.0, 0.0, 0.0, 1.0, 0.0), 0.25),
    "hit on a knot": (LIFT, State(0.0, 0.0, -0.75, 0.0, -0.5), 50.0),
    "a start at rest on a floor that sinks": (
        Stem(w=1.0, h=BangBang(knots=((0.0, 1.0), (0.5, 2.0), (1.0, 1.0)))),
        State(0.0, 0.0, -1.0, 0.0, 0.0, "floor"),
        0.75,
    ),
    "a start at rest on an arc that lifts off at length": (
        Cap(r=BangBang(knots=((0.0, 0.5), (2.0, 1.5), (2.25, 2.0), (4.0, 0.5)))),
        State(0.0, -0.3, 0.4, 0.0, 0.0, "arc"),
        3.0,
    ),
    "curvature touching zero": (
        Stem(w=Fourier(mean=0.59375, omega=0.5, sin=(0.46875,)), h=1.5, slope=0.00045955882353110626),
        State(0.0, -0.5923180019154258, -0.59375, -0.000468749999999587, 5.740531870998161e-20),
        TOUCHED,
    ),
    "curvature touching zero on the wall left": (
        Mushroom(
            r=Fourier(mean=0.875, omega=0.5, sin=(0.37499999999965894,)),
            h=Fourier(mean=1.1875, omega=0.5, sin=(0.9374999999991473,)),
            w=Fourier(mean=0.1718749999999996, omega=0.5, sin=(0.10937499999985893,)),
            slope=0.00022977941176530013,
        ),
        State(0.0, -0.17173856847426397, -0.59375, -0.000468749999999587, 5.740531870998161e-20, "left"),
        TOUCHED,
    ),
    "slow, towards waves": (WAVES, State(0.3, 0.0, -0.5, 2.0**-20, -(2.0**-14)), 1e5),
    "slow": (LIFT, State(0.0, 0.0, -0.5, 2.0**-8, 0.0), 500.0),
    "across very many periods": (SHIVERING, State(0.0, 1.0, -2.0, -0.5, 0.01, "right"), 9.0),
    "slow, from outside a trembling arc": (
        TREMBLING,
        State(0.0, 0.0, 1.0 + 2.0**-44, 0.0, -(2.0**-103), "arc"),
        900.0,
    ),
    "slow, from inside a trembling arc": (
        TREMBLING,
        State(0.0, 0.0, 1.0 - 2.0**-44, 0.0, -(2.0**-103), "arc"),
        900.0,
    ),
}


@pytest.mark.parametrize("name", STEPS)
def test_rare_steps_are_proved(name):
    assert prove_step(*STEPS[name]).outcome in ("collision", "horizon")


@pytest.mark.parametrize("name", ANSWERS)
def test_answers_by_hand_are_proved(name):
    assert prove_step(*ANSWERS[name][:3])


START = State(-1.0, 0.375, 0.5, 0.0625, 1.0)  # to the arc, then down across y = 0 at x = 0.33 or so


def opening(moment):
    """Return a mouth that is a quarter wide and opens to three quarters within 2^-20 from `moment` on."""
    widths = ((-1.0, 0.25), (moment, 0.25), (moment + 2.0**-20, 0.75), (6.0, 0.75), (7.0, 0.25))
    return Mushroom(r=1.0, h=1.0, w=BangBang(knots=widths))


PATHS = {
    "moving cap": (load("moving-cap"), State(0.1, 0.2, 0.3, 14.0, 3.0), 5),
    # The same wall is met again and again: its residual is carried on.
    "along the arc": (
        Cap(r=Fourier(mean=1.0, omega=1.0, cos=(0.25,))),
        State(4.0, 0.6, 0.58, -1.0, 0.9),
        6,
    ),
    "along the arc, from outside it": (Cap(r=1.0), State(0.0, 0.0, 1.0 + 2.0**-24, 4.0, -0.5, "arc"), 4),
    "to a horizon": (LIFT, State(0.0, 0.25, -0.75, 1.0, -0.5), 9, 3.0),
    "late": (opening(1.0), State(2.0**40, 0.375, 0.5, 0.0625, 1.0), 3),
    "met where the wall's rate turns": (
        Stem(w=5.659799424266695e-73, h=Fourier(2.0**-180, omega=2.0**-20, sin=(2.0**-200,))),
        State(0.5, 4.25e-73, -6.52530446800149e-55, 8.59e-80, -8.796729055475663e-77),
        2,
    ),
}


@pytest.mark.parametrize("name", PATHS)
def test_paths_are_proved(name):
    assert len(prove_path(*PATHS[name]).steps) >= 2


@pytest.mark.parametrize("working", deep_but([6, 8, 12, 20, None], 6, None))
def test_knots_within_enclosed_times_are_proved(working, tally):
    """The mouth opens just when y = 0 is crossed, give or take what the crossing is enclosed to."""
    narrow = Mushroom(r=1.0, h=1.0, w=0.25)
    crossing = float(reference.trajectory(narrow, START, 2).steps[1].after.t)
    for i in range(-24, 24):
        claim = prove_path(opening(crossing - 2.0**-21 + i * 2.0**-24), START, 3, working=working)
        tally["undecided"] += claim.outcome == "undecided"
        tally.update(step.wall for step in claim.steps[1:2])
    assert (tally["undecided"] > 0) == (working in (6, 8))
    assert working == 6 or min(tally["base"], tally["left"]) > 0


def test_places_known_to_some_tenths_are_proved(tally):
    """Eight decimals are too few for twelve flights: enclosures end as wide as the table."""
    draw = random.Random(5)
    for _ in range(100 if IS_DEEP else 20):
        start = State(0.0, draw.uniform(-0.9, 0.9), 0.0, draw.uniform(-1, 1), draw.uniform(0.1, 1), "base")
        claim = prove_path(Cap(r=1.0), start, 12, working=8)
        low, high = claim.steps[-1].ends("x")
        tally["wide"] += high - low > Fraction(1, 100)
    assert tally["wide"] > 0


@pytest.mark.parametrize("working", [5, 6, 7, 8, 12])
def test_a_root_known_to_many_periods_is_proved(working):
    """A floor trembles thousands of times within the time at which a crude path meets it."""
    half = 2.0**-31
    floor = BangBang(knots=((0.0, 1.0), (half, 1.0 + 2.0**-52), (2 * half, 1.0)))
    claim = prove_path(Mushroom(r=1.0, w=0.5, h=floor), State(0.0, 0.1, 0.5, 0.3, -1.0), 6, working=working)
    assert "floor" in [step.wall for step in claim.steps]
