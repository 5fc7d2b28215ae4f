"""Certificates of the reference: each holds in a second arithmetic, and forged ones are refuted."""

from __future__ import annotations

import json
from fractions import Fraction

import flint
import pytest
from hypothesis import given, settings
from support import faulty_provers as faults
from support.forgery import both, drop, moved, put, shift
from support.tables import BOX, LIFT
from support.truth import IS_DEEP, is_delicate

import reference
from conformance.second_proof.step import Refuted, check
from conformance.strategies import scenes_and_states
from reference.certificate import certificate
from scene import BangBang, Cap, Fourier, Mushroom, State, Stem, Undecided, to_data

N_EXAMPLES = 10_000 if IS_DEEP else 150

CIRCLE = Cap(r=Fourier(mean=1.0, omega=1.0, cos=(0.25,)))
GALLERY = State(0.0, 0.75, 1.0, -1.0, 0.6875, "arc")  # f rises, falls, all in dt = 0.07
WAVES = Stem(w=1.0, h=Fourier(mean=1.0, period=1.0, sin=(0.1, 0.02), cos=(0.05,)))
RESTING = State(0.0, 0.0, -1.875, 0.0, 0.0)  # met by the floor at 1/8 of each period
WIDE_BOX = Stem(w=2.0, h=1.0)
TO_RIGHT = State(0.0, 0.25, -0.25, 1.0, -0.75)
NARROW, WIDE = (Mushroom(r=1.0, h=1.0, w=w) for w in (0.25, 0.5))
TO_BASE = State(0.0, 0.0, 0.5, 0.75, -1.0)  # crosses y = 0 at x = 3/8


def proved(scene, state, t_end=50.0):
    outcome = reference.next_collision(scene, state, t_end, digits=30)
    assert isinstance(outcome, reference.Collision | reference.Horizon), outcome
    return certificate(scene, state, t_end, outcome)


def test_a_wall_that_lifts_off_at_rest_is_proved_again():
    """The arc's radius is 1/2 + s^2 / 2 up to s = 1: no ball of all of that shows f'' > 0."""
    lifting = Cap(r=BangBang(knots=((0.0, 0.5), (2.0, 1.5), (2.25, 2.0), (4.0, 0.5))))
    claim = proved(lifting, State(0.0, -0.3, 0.4, 0.0, 0.0, "arc"), 3.0)
    assert claim["excluded"]["arc"][0][2] == "lifting"
    check(claim)
    with pytest.raises(Refuted):
        check(proved(lifting, State(0.0, -0.3, 0.4, 0.0, 0.0, "arc"), 3.0) | {"t_end": 4.0})


def test_every_answer_is_proved_again(tally):
    @settings(max_examples=N_EXAMPLES)
    @given(scenes_and_states())
    def proves(drawn):
        outcome = reference.next_collision(*drawn, digits=30)
        if not isinstance(outcome, reference.Collision | reference.Horizon):
            tally[type(outcome).__name__.lower()] += 1
            if isinstance(outcome, Undecided):
                assert is_delicate(*drawn), outcome
            return
        claim = certificate(*drawn, outcome)
        check(claim)
        tally["proved"] += 1
        tally[claim["outcome"]] += 1
        tally[f"at {claim['wall']}"] += 1
        for stretches in claim["excluded"].values():
            tally.update(kind for _, _, kind in stretches)

    proves()
    assert min(tally["collision"], tally["horizon"]) > 0
    assert tally["proved"] >= 0.9 * N_EXAMPLES
    assert min(tally[kind] for kind in ("plain", "rising", "falling", "swept")) > 0


HONEST = {
    "grazing a circle": (CIRCLE, GALLERY, 50.0),
    "lifted by a floor": (LIFT, RESTING, 50.0),
    "not yet lifted": (LIFT, RESTING, 0.0625),
    "met at the horizon": (BOX, TO_RIGHT, 0.75),
    "base": (NARROW, TO_BASE, 50.0),
    "through the mouth": (WIDE, TO_BASE, 50.0),
    "out of the mouth": (WIDE, State(0.0, 0.0, -0.5, 0.125, 1.0), 50.0),
    "along the mouth": (WIDE, State(0.0, 0.0, 0.0, 1.0, 0.0), 0.25),
    "hit on a knot": (LIFT, State(0.0, 0.0, -0.75, 0.0, -0.5), 50.0),
    "flat start": (
        Stem(w=1.0, h=BangBang(knots=((0.0, 1.0), (0.5, 2.0), (1.0, 1.0)))),
        State(0.0, 0.0, -1.0, 0.0, 0.0, "floor"),
        0.75,
    ),
    "curvature touching zero": (
        Stem(w=Fourier(mean=0.59375, omega=0.5, sin=(0.46875,)), h=1.5, slope=0.00045955882353110626),
        State(0.0, -0.5923180019154258, -0.59375, -0.000468749999999587, 5.740531870998161e-20),
        201.06192982974676,
    ),
    "curvature touching zero on the wall left": (
        Mushroom(
            r=Fourier(mean=0.875, omega=0.5, sin=(0.37499999999965894,)),
            h=Fourier(mean=1.1875, omega=0.5, sin=(0.9374999999991473,)),
            w=Fourier(mean=0.1718749999999996, omega=0.5, sin=(0.10937499999985893,)),
            slope=0.00022977941176530013,
        ),
        State(0.0, -0.17173856847426397, -0.59375, -0.000468749999999587, 5.740531870998161e-20, "left"),
        201.06192982974676,
    ),
    "slow, towards waves": (WAVES, State(0.3, 0.0, -0.5, 2.0**-20, -(2.0**-14)), 1e5),
    "slow": (LIFT, State(0.0, 0.0, -0.5, 2.0**-8, 0.0), 500.0),
}


@pytest.mark.parametrize("name", HONEST)
def test_honest_certificates_hold_and_survive_json(name):
    claim = proved(*HONEST[name])
    assert json.loads(json.dumps(claim)) == claim
    check(claim)


def test_kinds_of_the_rare_cases_are_met():
    kinds = {name: str(proved(*HONEST[name])["excluded"]) for name in ("flat start", "slow")}
    assert "lifting" in kinds["flat start"]
    assert "swept" in kinds["slow"]


CIRCLE_HIT, LIFT_HIT = HONEST["grazing a circle"], HONEST["lifted by a floor"]


def swept_until_it_is_met(claim):
    claim["excluded"]["floor"] = [[claim["excluded"]["floor"][0][0], claim["root"][0], "swept"]]


def end_past_the_root(claim):
    end = moved(claim["root"][1], Fraction(1, 1024))
    claim["excluded"]["arc"][-1][1] = claim["root"][0] = end
    claim["root"][1] = moved(end, Fraction(1, 1024))


def every_kind_swapped(claim):
    for stretch in claim["excluded"]["floor"]:
        stretch[2] = "rising"


# Name: the forgery, what is forged, and why it is refuted.
FORGED = {
    "missing stretch": (drop("excluded", "arc", 0), CIRCLE_HIT, "arc is not excluded from 0"),
    "missing wall": (drop("excluded", "left"), LIFT_HIT, "left is not excluded from 0"),
    "late start": (put("excluded", "arc", 0, 0, "1*2^-30"), CIRCLE_HIT, "arc is not excluded from 0"),
    "shifted time": (shift(2.0**-60, "dt"), CIRCLE_HIT, "dt is not"),
    "shifted root": (
        both(shift(2.0**-60, "dt"), shift(2.0**-60, "root")),
        CIRCLE_HIT,
        "arc is not excluded|change sign",
    ),
    "wide root": (
        both(put("root", 0, "1*2^-10"), put("excluded", "arc", [["0*2^0", "1*2^-10", "rising"]])),
        CIRCLE_HIT,
        "f' is not negative",
    ),
    "wrong wall": (put("wall", "right"), LIFT_HIT, "floor is not excluded|change sign"),
    "wall of the stem": (put("wall", "floor"), CIRCLE_HIT, "floor cannot be met"),
    "hidden root of another wall": (
        put("scene", to_data(BOX)),
        (WIDE_BOX, TO_RIGHT, 50.0),
        "right is not excluded",
    ),
    "hidden root of the same wall": (
        both(
            shift(1, "dt"),
            shift(1, "root"),
            put("excluded", {wall: [["0*2^0", "2*2^0", "plain"]] for wall in ("left", "right", "floor")}),
        ),
        LIFT_HIT,
        "floor is not excluded, plain",
    ),
    "swapped kind": (put("excluded", "arc", 0, 2, "rising"), CIRCLE_HIT, "arc is not excluded, rising"),
    "every kind swapped": (every_kind_swapped, LIFT_HIT, "floor is not excluded, rising"),
    "invented kind": (put("excluded", "arc", 0, 2, "obvious"), CIRCLE_HIT, "no such kind"),
    "wall said to stay away": (
        put("excluded", "floor", [["0*2^0", "1*2^0", "swept"]]),
        LIFT_HIT,
        "floor may sweep",
    ),
    "waves said to stay away": (swept_until_it_is_met, HONEST["slow, towards waves"], "floor may sweep"),
    "end past the root": (end_past_the_root, CIRCLE_HIT, "arc is not excluded, falling"),
    "changed velocity": (put("state", "vx", -1.0 - 2.0**-52), CIRCLE_HIT, "arc is not excluded|change sign"),
    "changed side": (put("state", "y", -0.5), HONEST["base"], "y = 0 is not crossed"),
    "changed law": (
        put("scene", "r", "cos", [0.25 * (1 + 2.0**-52)]),
        CIRCLE_HIT,
        "arc is not excluded|change sign",
    ),
    "invalid law": (put("scene", "r", "cos", [2.0]), CIRCLE_HIT, "scene"),
    "horizon despite a hit": (
        lambda claim: claim.update(outcome="horizon", wall=None, dt=None, root=None),
        CIRCLE_HIT,
        "arc is not excluded from",
    ),
    "later horizon": (put("t_end", 50.0), HONEST["not yet lifted"], "is not excluded from"),
    "horizon before the hit": (put("t_end", 0.07), CIRCLE_HIT, "before the horizon"),
    "open mouth": (put("scene", to_data(WIDE)), HONEST["base"], "the mouth is open"),
    "closed mouth": (put("scene", to_data(NARROW)), HONEST["through the mouth"], "the mouth is not open"),
    "kept velocity": (put("after", "vx", ["-3*2^-2", "-3*2^-2"]), CIRCLE_HIT, "vx afterwards"),
}


@pytest.mark.parametrize("name", FORGED)
def test_a_forged_certificate_is_refuted(name):
    forge, step, reason = FORGED[name]
    claim = proved(*step)
    check(claim)
    forge(claim)
    before = flint.ctx.prec
    with pytest.raises(Refuted, match=reason):
        check(claim)
    assert flint.ctx.prec == before


# A fault in the laws that the second proof shares with the second stepper, and what it shows on.
UNSOUND = [
    (
        faults.period_from_zero,
        (
            Stem(w=1.0, h=BangBang(knots=((0.25, 2.0), (0.75, 1.0), (1.25, 2.0)))),
            State(0.25, 0.0, -1.875, 0.0, 0.0),
            50.0,
        ),
    ),
    (
        faults.few_harmonics,
        (Cap(r=Fourier(mean=1.0, omega=1.0, sin=(0.0625,) * 4)), State(0.0, 0.0, 0.5, 1.0, 0.5), 50.0),
    ),
    (
        faults.rounded_omega,
        (Cap(r=Fourier(mean=1.0, period=3.0, sin=(0.25,))), State(1.0, 0.0, 0.5, 1.0, 0.5), 50.0),
    ),
]


@pytest.mark.parametrize(("fault", "step"), UNSOUND)
def test_a_fault_in_the_second_laws_is_seen(fault, step):
    claim = proved(*step)
    check(claim)
    with faults.patched(fault), pytest.raises(Refuted):
        check(claim)
