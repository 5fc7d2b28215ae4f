"""Certificates of trajectories and undefined outcomes hold in the second arithmetic; forged ones do not."""

from __future__ import annotations

import copy
import json
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.answers_by_hand import UNDEFINED
from support.depth import deep_but
from support.forgery import both, drop, put, shift
from support.tables import LIFT
from support.truth import IS_DEEP

import reference
from conformance.arb.laws import BallBangBang
from conformance.second_proof.step import Refuted, check
from conformance.second_proof.trajectory import check_path
from conformance.strategies import scenes_and_states
from reference.certificate import certificate, path_certificate
from scene import BadInput, BangBang, Cap, Fourier, Mushroom, State, Stem, Undecided, Undefined, load

N_EXAMPLES = 5_000 if IS_DEEP else 60

START = State(-1.0, 0.375, 0.5, 0.0625, 1.0)  # to the arc, then down across y = 0 at x = 0.33 or so


def opening(moment):
    """A mouth that is a quarter wide and opens at a given time within 2^-20, to three quarters."""
    widths = ((-1.0, 0.25), (moment, 0.25), (moment + 2.0**-20, 0.75), (6.0, 0.75), (7.0, 0.25))
    return Mushroom(r=1.0, h=1.0, w=BangBang(knots=widths))


CROSSING = float(reference.trajectory(Mushroom(r=1.0, h=1.0, w=0.25), START, 2).steps[1].after.t)
# A shallow hop along a breathing arc that comes back to the same wall: its residual is carried on.
HOPS = Cap(r=Fourier(mean=1.0, omega=1.0, cos=(0.25,)))


def path_claim(scene, state, n, t_end=None, **options):
    path = reference.trajectory(scene, state, n, t_end, **options)
    return path, path_certificate(scene, state, t_end, path)


def test_places_known_to_some_tenths_are_found_where_claimed():
    """A product of two wide balls is wider than that of intervals; over parts of the time it is not.

    Signs along so wide a flight may be open in balls: that is another matter.
    """
    draw, refusals = random.Random(5), []
    for _ in range(100):
        start = State(0.0, draw.uniform(-0.9, 0.9), 0.0, draw.uniform(-1, 1), draw.uniform(0.1, 1), "base")
        _, claim = path_claim(Cap(r=1.0), start, 12, working=8)
        try:
            check_path(claim)
        except Refuted as refusal:
            refusals.append(str(refusal))
    assert all("is not excluded" in refusal for refusal in refusals)
    assert len(refusals) <= 5


@pytest.mark.parametrize("working", [5, 6, 7, 8, 12])
def test_a_root_known_to_many_periods_is_proved_without_listing_their_knots(working, monkeypatch):
    """A floor trembles thousands of times within the time at which a crude path meets it."""
    listed = BallBangBang.knots

    def few(self, start, end):
        assert end - start <= 1000 * self.period
        return listed(self, start, end)

    monkeypatch.setattr(BallBangBang, "knots", few)
    half = 2.0**-31
    floor = BangBang(knots=((0.0, 1.0), (half, 1.0 + 2.0**-52), (2 * half, 1.0)))
    scene = Mushroom(r=1.0, w=0.5, h=floor)
    path, claim = path_claim(scene, State(0.0, 0.1, 0.5, 0.3, -1.0), 6, working=working)
    assert "floor" in [step.wall for step in path.steps]
    check_path(claim)


def test_every_path_is_proved_again(tally):
    @settings(max_examples=N_EXAMPLES)
    @given(scenes_and_states(), st.integers(1, 6), st.sampled_from((None, 10, 25)))
    def proves(drawn, n, working):
        scene, state, t_end = drawn
        try:
            path, claim = path_claim(scene, state, n, t_end, digits=15, working=working)
        except BadInput:
            tally["rejected"] += 1
            return
        check_path(claim)
        tally["paths"] += 1
        tally["enclosed starts"] += max(len(claim["steps"]) - 1, 0)
        tally[type(path.outcome).__name__.lower()] += 1

    proves()
    assert tally["paths"] >= 0.9 * N_EXAMPLES
    assert tally["enclosed starts"] >= N_EXAMPLES / 4


@pytest.mark.parametrize("working", deep_but([6, 8, 12, 20, None], 6, None))
def test_knots_within_enclosed_times_are_proved_again(working, tally):
    """The mouth opens just when y = 0 is crossed, give or take what the crossing is enclosed to."""
    for i in range(-24, 24):
        moment = CROSSING - 2.0**-21 + i * 2.0**-24
        path, claim = path_claim(opening(moment), START, 3, digits=15, working=working)
        check_path(claim)
        tally["undecided"] += isinstance(path.outcome, Undecided)
        tally["steps"] += len(path.steps)
        tally.update(step.wall for step in path.steps[1:2])
    assert (tally["undecided"] > 0) == (working in (6, 8))
    assert working == 6 or min(tally["base"], tally["left"]) > 0


PATHS = {
    "moving cap": (load("moving-cap"), State(0.1, 0.2, 0.3, 14.0, 3.0), 5, None),
    "along the arc": (HOPS, State(4.0, 0.6, 0.58, -1.0, 0.9), 6, None),
    "to a horizon": (LIFT, State(0.0, 0.25, -0.75, 1.0, -0.5), 9, 3.0),
    "late": (opening(1.0), State(2.0**40, 0.375, 0.5, 0.0625, 1.0), 3, None),
}


@pytest.mark.parametrize("name", PATHS)
def test_honest_paths_hold_and_survive_json(name):
    scene, state, n, t_end = PATHS[name]
    _, claim = path_claim(scene, state, n, t_end)
    assert len(claim["steps"]) >= 3
    assert json.loads(json.dumps(claim)) == claim
    check_path(claim)


def thin_place(claim):
    claim["steps"][1]["departure"]["x"][1] = claim["steps"][1]["departure"]["x"][0]


def later_begin(claim):
    claim["steps"][1]["departure"]["begin"][0] = claim["steps"][1]["departure"]["begin"][1]


DEPARTURE = ("steps", 1, "departure")
FORGED = {
    "thin place": (thin_place, "step 1: the next step's x does not hold"),
    "shifted speed": (
        shift(2.0**-40, "steps", 2, "departure", "vy"),
        "step 2: the next step's vy does not hold",
    ),
    "later begin": (later_begin, "step 1: the next step does not begin"),
    "another instant": (shift(2.0**-20, *DEPARTURE, "instant"), "step 1: the next step"),
    "forgotten wall": (put(*DEPARTURE, "residuals", {}), "step 1: the next step does not leave"),
    "invented residual": (
        put(*DEPARTURE, "residuals", {"arc": ["1*2^-60", "1*2^-60"]}),
        "step 1: the residual",
    ),
    "left out step": (drop("steps", 1), "step 1: the next step"),
    "not excluded": (drop("steps", 1, "excluded", "arc", 0), "step 2: .* is not excluded from"),
    "plain from the wall": (
        put("steps", 1, "excluded", "arc", 0, 2, "plain"),
        "step 2: .* is not excluded, plain",
    ),
    "elapsed otherwise": (shift(2.0**-40, "steps", 1, "dt"), "step 2: dt is not"),
}


@pytest.mark.parametrize("name", FORGED)
def test_a_forged_path_is_refuted(name):
    forge, reason = FORGED[name]
    scene, state, n, t_end = PATHS["along the arc"]
    _, claim = path_claim(scene, state, n, t_end)
    assert set(claim["steps"][1]["departure"]["residuals"]) == {"arc"}
    forge(claim)
    with pytest.raises(Refuted, match=reason):
        check_path(claim)


def test_the_piece_that_does_not_hold_is_refuted():
    """A base hit, claimed where the mouth has opened just before the crossing."""
    _, closed = path_claim(opening(CROSSING), START, 2)
    _, opened = path_claim(opening(CROSSING - 2.0**-20), START, 2)
    assert [claim["steps"][1]["wall"] for claim in (closed, opened)] == ["base", "left"]
    for claim, other in ((closed, opened), (opened, closed)):
        forged = copy.deepcopy(claim) | {"scene": other["scene"]}
        with pytest.raises(Refuted, match="step 2: the mouth is"):
            check_path(forged)


def nowhere(name):
    scene, state, t_end, reason, _ = UNDEFINED[name]
    outcome = reference.next_collision(scene, state, t_end)
    assert outcome == Undefined(reason)
    return certificate(scene, state, t_end, outcome)


@pytest.mark.parametrize("name", UNDEFINED)
def test_undefined_outcomes_are_proved_again(name):
    claim = nowhere(name)
    assert json.loads(json.dumps(claim)) == claim
    check(claim)


THROUGH = "corner of the floor, through the mouth"
FORGED_NOWHERE = [
    *((name, put("reason", "tangency")) for name in UNDEFINED),
    *((name, drop("walls", 1)) for name in ("corner", "on two walls")),
    *((name, put("excluded", {})) for name in ("corner", "along the mouth")),
    *((THROUGH, drop("excluded", wall)) for wall in ("arc", "right")),
    (THROUGH, put("scene", "w", 0.0625)),
    *(
        (name, shift(2.0**-40, "state", "x"))
        for name in ("corner", "corner above", "arc and base", "mouth's edge from above")
    ),
    *(
        (name, shift(2.0**-40, "state", "y"))
        for name in ("on two walls", "at the edge", "along the base, unnamed")
    ),
    *(
        ("where the base ends, " + name, both(put("walls", ["base"]), put("reason", "sliding")))
        for name in ("level", "upwards")
    ),
    *((name, shift(2.0, "state", "x")) for name in ("along the base", "along the base, unnamed")),
    *((name, put("t_end", 2.0**-4)) for name in ("corner", "mouth's edge from below", "along the mouth")),
]


@pytest.mark.parametrize(("name", "forge"), FORGED_NOWHERE)
def test_a_forged_undefined_outcome_is_refuted(name, forge):
    claim = nowhere(name)
    forge(claim)
    with pytest.raises(Refuted):
        check(claim)


def test_a_corner_less_a_residual_is_none():
    """Two functions vanish together at s = 3/2, but one of them is 2^-300 too high: its residual."""
    scene = Stem(w=BangBang(knots=((0.0, 1.0), (1.0, 2.0), (2.0, 1.0))), h=4.0, slope=-(2.0**-300))
    state = State(0.25, -1.125, -1.5, 0.0, 1.0, "left")
    outcome = reference.next_collision(scene, state, 3.0)
    check(certificate(scene, state, 3.0, outcome))
    forged = certificate(scene, State(0.25, -1.125, -1.5, 0.0, 1.0, "left"), 3.0, outcome)
    corner = {
        "instant": "3/2",
        "walls": ["base", "left"],
        "roots": {"left": forged["root"]},
        "reason": "corner",
    }
    with pytest.raises(Refuted, match="left is not shown to be met exactly then"):
        check(forged | corner | {"outcome": "undefined"})
    with pytest.raises(BadInput, match="must be undefined"):
        certificate(scene, state, 3.0, Undefined("corner"))


def test_a_stretch_of_very_many_periods_is_proved_at_once():
    """The knots of 2^42 periods are never listed: a few stretches, each four times as long, cover them."""
    shivering = BangBang(((0.0, 1.0), (2.0**-41, 1.0 - 2.0**-52), (2.0**-40, 1.0)))
    scene, start = Stem(w=shivering, h=4.0), State(0.0, 1.0, -2.0, -0.5, 0.01, "right")
    claim = certificate(scene, start, 9.0, reference.next_collision(scene, start, 9.0))
    assert [kind for _, _, kind in claim["excluded"]["right"]] == ["rising"] + 21 * ["swept"]
    check(claim)
    for kind in ("falling", "concave", "plain", "centred", "lifting", "swept"):
        put("excluded", "right", 0, 2, kind)(claim)
        with pytest.raises(Refuted):
            check(claim)


@pytest.mark.parametrize("off", [-1.0, 1.0])
def test_a_swept_stretch_is_swept_less_the_residual(off):
    """Of an arc that trembles by 1e-30, left as slowly: what is removed, 1e-13 or -1e-13, counts far more."""
    scene = Cap(r=Fourier(1.0, 1.0, (-1e-30,)))
    start = State(0.0, 0.0, 1.0 + off * 2.0**-44, 0.0, -(2.0**-103), "arc")
    claim = certificate(scene, start, 900.0, reference.next_collision(scene, start, 900.0))
    assert claim["excluded"]["arc"][-1][2] == "swept"
    check(claim)
    early = [[first, last, "swept"] for first, last, _ in claim["excluded"]["arc"]]
    put("excluded", "arc", early)(claim)
    with pytest.raises(Refuted, match="may sweep"):
        check(claim)


def test_a_wall_met_where_its_rate_turns_is_proved_again():
    """Met when the floor is as quick as ever, its speed is known far better than the time is."""
    h = Fourier(2.0**-180, omega=2.0**-20, sin=(2.0**-200,))
    scene = Stem(w=5.659799424266695e-73, h=h)
    start = State(0.5, 4.25e-73, -6.52530446800149e-55, 8.59e-80, -8.796729055475663e-77)
    path, claim = path_claim(scene, start, 2)
    assert [step.wall for step in path.steps] == ["right", "floor"]
    check_path(claim)
    shift(2.0**-300, "steps", 1, "after", "vy")(claim)
    with pytest.raises(Refuted, match="vy afterwards"):
        check_path(claim)
