"""Certificates of the reference: each holds in a second arithmetic, and forged ones are refuted."""

from __future__ import annotations

import copy
import json
from fractions import Fraction

import flint
import pytest
from hypothesis import given, settings
from support.truth import IS_DEEP, is_delicate

import reference
from conformance.second_proof.step import Refuted, check
from conformance.strategies import scenes_and_states
from reference.certificate import certificate
from scene import BangBang, Cap, Fourier, Mushroom, State, Stem, Undecided, to_data

N_EXAMPLES = 10_000 if IS_DEEP else 150

CIRCLE = Cap(r=Fourier(mean=1.0, omega=1.0, cos=(0.25,)))
GALLERY = State(0.0, 0.75, 1.0, -1.0, 0.6875, "arc")  # f rises, falls, all in dt = 0.07
LIFT = Stem(w=1.0, h=BangBang(knots=((0.0, 2.0), (0.5, 1.0), (1.0, 2.0))))
RESTING = State(0.0, 0.0, -1.875, 0.0, 0.0)  # met by the floor at 1/8 of each period
BOX, WIDE_BOX = Stem(w=1.0, h=1.0), Stem(w=2.0, h=1.0)
TO_RIGHT = State(0.0, 0.25, -0.25, 1.0, -0.75)
NARROW, WIDE = (Mushroom(r=1.0, h=1.0, w=w) for w in (0.25, 0.5))
TO_BASE = State(0.0, 0.0, 0.5, 0.75, -1.0)  # crosses y = 0 at x = 3/8


def proved(scene, state, t_end=50.0):
    outcome = reference.next_collision(scene, state, t_end, digits=30)
    assert isinstance(outcome, reference.Collision | reference.Horizon), outcome
    return certificate(scene, state, t_end, outcome)


def moved(number, shift):
    """Add a dyadic rational to "m*2^e"."""
    mantissa, exponent = map(int, number.split("*2^"))
    total = mantissa * Fraction(2) ** exponent + Fraction(shift)
    return f"{total.numerator}*2^{1 - total.denominator.bit_length()}"


def test_every_answer_is_proved_again(tally):
    @settings(max_examples=N_EXAMPLES)
    @given(scenes_and_states())
    def proves(drawn):
        outcome = reference.next_collision(*drawn, digits=30)
        tally[type(outcome).__name__.lower()] += 1
        if not isinstance(outcome, reference.Collision | reference.Horizon):
            if isinstance(outcome, Undecided):
                assert is_delicate(*drawn), outcome
            return
        claim = certificate(*drawn, outcome)
        check(claim)
        tally["proved"] += 1
        tally[f"at {claim['wall']}"] += 1
        for stretches in claim["excluded"].values():
            tally.update(kind for _, _, kind in stretches)

    proves()
    assert tally["proved"] == tally["collision"] + tally["horizon"] >= 0.9 * N_EXAMPLES
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


def missing_stretch(claim):
    del claim["excluded"]["arc"][0]


def missing_wall(claim):
    del claim["excluded"]["left"]


def late_start(claim):
    claim["excluded"]["arc"][0][0] = "1*2^-30"


def shifted_time(claim):
    claim["dt"] = [moved(end, Fraction(1, 2**60)) for end in claim["dt"]]


def shifted_root(claim):
    claim["dt"] = claim["root"] = [moved(end, Fraction(1, 2**60)) for end in claim["dt"]]


def wide_root(claim):
    claim["root"][0] = "1*2^-10"
    claim["excluded"]["arc"] = [["0*2^0", "1*2^-10", "rising"]]


def wrong_wall(claim):
    claim["wall"] = "right"


def wall_of_the_stem(claim):
    claim["wall"] = "floor"


def hidden_root_of_another_wall(claim):
    claim["scene"] = to_data(BOX)


def hidden_root_of_the_same_wall(claim):
    claim["dt"] = claim["root"] = [moved(end, 1) for end in claim["dt"]]
    claim["excluded"] = {wall: [["0*2^0", "2*2^0", "plain"]] for wall in ("left", "right", "floor")}


def swapped_kind(claim):
    claim["excluded"]["arc"][0][2] = "rising"


def every_kind_swapped(claim):
    for stretch in claim["excluded"]["floor"]:
        stretch[2] = "rising"


def invented_kind(claim):
    claim["excluded"]["arc"][0][2] = "obvious"


def wall_said_to_stay_away(claim):
    claim["excluded"]["floor"] = [["0*2^0", claim["dt"][0], "swept"]]


def end_past_the_root(claim):
    end = moved(claim["root"][1], Fraction(1, 1024))
    claim["excluded"]["arc"][-1][1] = claim["root"][0] = end
    claim["root"][1] = moved(end, Fraction(1, 1024))


def changed_velocity(claim):
    claim["state"]["vx"] = -1.0 - 2.0**-52


def changed_side(claim):
    claim["state"]["y"] = -0.5


def changed_law(claim):
    claim["scene"]["r"]["cos"] = [0.25 * (1 + 2.0**-52)]


def invalid_law(claim):
    claim["scene"]["r"]["cos"] = [2.0]


def horizon_despite_a_hit(claim):
    claim.update(outcome="horizon", wall=None, dt=None, root=None)


def later_horizon(claim):
    claim["t_end"] = 50.0


def horizon_before_the_hit(claim):
    claim["t_end"] = 0.07


def open_mouth(claim):
    claim["scene"] = to_data(WIDE)


def closed_mouth(claim):
    claim["scene"] = to_data(NARROW)


def kept_velocity(claim):
    claim["after"]["vx"] = ["-3*2^-2", "-3*2^-2"]


CIRCLE_HIT, LIFT_HIT = HONEST["grazing a circle"], HONEST["lifted by a floor"]
TAMPERED = [
    (missing_stretch, CIRCLE_HIT, "arc is not excluded from 0"),
    (missing_wall, LIFT_HIT, "left is not excluded from 0"),
    (late_start, CIRCLE_HIT, "arc is not excluded from 0"),
    (shifted_time, CIRCLE_HIT, "dt is not"),
    (shifted_root, CIRCLE_HIT, "arc is not excluded|change sign"),
    (wide_root, CIRCLE_HIT, "f' is not negative"),
    (wrong_wall, LIFT_HIT, "floor is not excluded|change sign"),
    (wall_of_the_stem, CIRCLE_HIT, "floor cannot be met"),
    (hidden_root_of_another_wall, (WIDE_BOX, TO_RIGHT, 50.0), "right is not excluded"),
    (hidden_root_of_the_same_wall, LIFT_HIT, "floor is not excluded, plain"),
    (swapped_kind, CIRCLE_HIT, "arc is not excluded, rising"),
    (every_kind_swapped, LIFT_HIT, "floor is not excluded, rising"),
    (invented_kind, CIRCLE_HIT, "no such kind"),
    (wall_said_to_stay_away, LIFT_HIT, "floor may sweep"),
    (end_past_the_root, CIRCLE_HIT, "arc is not excluded, falling"),
    (changed_velocity, CIRCLE_HIT, "arc is not excluded|change sign"),
    (changed_side, HONEST["base"], "y = 0 is not crossed"),
    (changed_law, CIRCLE_HIT, "arc is not excluded|change sign"),
    (invalid_law, CIRCLE_HIT, "scene"),
    (horizon_despite_a_hit, CIRCLE_HIT, "arc is not excluded from"),
    (later_horizon, HONEST["not yet lifted"], "is not excluded from"),
    (horizon_before_the_hit, CIRCLE_HIT, "before the horizon"),
    (open_mouth, HONEST["base"], "the mouth is open"),
    (closed_mouth, HONEST["through the mouth"], "the mouth is not open"),
    (kept_velocity, CIRCLE_HIT, "vx afterwards"),
]


@pytest.mark.parametrize(
    ("tamper", "step", "reason"), TAMPERED, ids=lambda value: getattr(value, "__name__", "")
)
def test_a_tampered_certificate_is_refuted(tamper, step, reason):
    claim = proved(*step)
    check(claim)
    forged = copy.deepcopy(claim)
    tamper(forged)
    before = flint.ctx.prec
    with pytest.raises(Refuted, match=reason):
        check(forged)
    assert flint.ctx.prec == before
