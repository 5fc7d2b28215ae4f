"""The properties hold for the three steppers, and each refuses a stepper that breaks it."""

import json
import math
import re

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace
from support import tables
from support.depth import deep_but

import fast
import reference
from conformance import plain, profiles
from conformance.mutants import COMMON, MUTANTS
from conformance.profiles import check_work_identity
from conformance.properties import (
    PROPERTIES,
    check_mirror,
    check_period_shift,
    check_scaling,
    is_clearly_inside,
)
from conformance.strategies import scenes_and_states
from scene import (
    Cap,
    Collision,
    Horizon,
    Mushroom,
    Rejected,
    State,
    Stem,
    Undecided,
    load,
    to_data,
    transforms,
)
from scene.geometry import rounded
from scene.tables import laws, period

N_QUESTIONS = 60
HONEST = {"plain": plain.next_collision, "fast": fast.next_collision}


def proved(scene, state, t_end):
    found = reference.next_collision(scene, state, t_end, digits=20)
    return found.rounded() if isinstance(found, reference.Collision | reference.Horizon) else found


@pytest.mark.parametrize("name", PROPERTIES)
@pytest.mark.parametrize("stepper", deep_but(HONEST, "fast"))
def test_honest_steppers_hold(stepper, name, tally):
    stepper = HONEST[stepper]
    # Drawn so that there is something to compare: a period to shift by, a table at rest, a disk.
    moves = {"period-shift": True, "energy": False}.get(name)
    table = "cap" if name == "angular-momentum" else None

    def is_fit(drawn):
        return moves is None or moves == (period(drawn[0]) is not None)

    @settings(max_examples=N_QUESTIONS)
    @given(scenes_and_states(table).filter(is_fit))
    def question(drawn):
        tally["compared" if PROPERTIES[name](stepper, *drawn) else "nothing to compare"] += 1

    question()
    assert tally["compared"] >= N_QUESTIONS // 10


GALLERY = (tables.BREATHING, State(0.5, 0.1, 0.9, 2.0, 0.25), 9.0)
STATIC = (Mushroom(r=1.0, h=1.0, w=0.5, slope=0.25), State(0.5, 0.1, -0.5, 2.0, 0.25), 9.0)
BREATHING = (load("moving-cap"), State(0.5, 0.1, 0.3, 2.0, 3.25), 9.0)
LIFT = (tables.LIFT, State(0.125, 0.3, -1.0, 0.25, -2.0), 9.0)
SLANTED = (Stem(w=1.0, h=1.0, slope=0.25), State(0.5, 0.1, -0.5, -2.0, 0.25), 9.0)


@pytest.mark.parametrize(
    "name", ["mirror", "scaling-of-lengths", "static-limit", "period-shift", "split-flight"]
)
def test_the_questions_of_a_broken_property_are_those_that_were_sent(name):
    """The question as it was given does not repeat a failure of its image: of a slope sent as a law, say."""
    question = SLANTED if name == "static-limit" else BREATHING
    sent = {}

    def step(scene, state, t_end):
        asked = {"scene": to_data(scene), "state": msgspec.structs.asdict(state), "t_end": t_end}
        line, is_image = json.dumps({"cmd": "step", "seq": 1, **asked}), (scene, state, t_end) != question
        sent[line] = is_image
        found = plain.next_collision(scene, state, t_end)
        return replace(found, vx=1.01 * found.vx) if is_image else found

    with pytest.raises(AssertionError) as broken:
        PROPERTIES[name](step, *question)
    printed = re.findall(r"\{.cmd.*?\}(?=; \{.cmd|$)", str(broken.value))
    assert any(sent[line] for line in printed)


@pytest.mark.parametrize("question", [GALLERY, STATIC, BREATHING, LIFT])
def test_the_reference_holds(question):
    """Few questions, for each takes some dozens of proved steps; the point is that all are compared."""
    compared = [name for name, check in PROPERTIES.items() if check(proved, *question)]
    left = set(PROPERTIES) - set(compared)
    assert left <= {"period-shift", "energy", "angular-momentum"}, left


def separate_path_for_moving_walls(scene, state, t_end):
    found = plain.next_collision(scene, state, t_end)
    is_still = all(isinstance(law, float) for law in laws(scene).values())
    return (
        found if is_still or not isinstance(found, Collision) else replace(found, dt=found.dt * (1 + 1e-15))
    )


def shy_of_reversed_time(scene, state, t_end):
    """Kicks by 2 u, unless time is negative."""
    step = COMMON["wall-velocity-once"].step if state.t < 0 else plain.next_collision
    return step(scene, state, t_end)


FAULTY = [
    ("mirror", MUTANTS["left-side-upright"].step, SLANTED),
    (
        "mirror",
        COMMON["mouth-tested-to-the-right-only"].step,
        (STATIC[0], State(0.0, -0.5, 0.2, -1.0, -1.0), 9.0),
    ),
    ("scaling-of-lengths", COMMON["root-where-gap-is-small"].step, GALLERY),
    ("scaling-of-times", COMMON["root-to-six-digits"].step, GALLERY),
    ("scaling-of-times", COMMON["hits-within-epsilon-skipped"].step, (*GALLERY[:2], 2.0)),
    ("static-limit", separate_path_for_moving_walls, STATIC),
    ("period-shift", COMMON["pi-too-short"].step, (GALLERY[0], State(6.0, 0.1, 0.9, 2.0, 0.25), 9.0)),
    ("period-shift", MUTANTS["period-wrap-lost"].step, LIFT),
    ("split-flight", COMMON["arc-static"].step, GALLERY),
    ("split-flight", COMMON["wall-velocity-at-departure"].step, BREATHING),
    ("reversal", COMMON["arc-static"].step, GALLERY),
    ("reversal", shy_of_reversed_time, LIFT),
    ("angular-momentum", COMMON["normal-at-departure"].step, GALLERY),
    ("energy", MUTANTS["normal-without-cos"].step, SLANTED),
    ("symplectic", COMMON["wall-velocity-once"].step, LIFT),
    ("symplectic", COMMON["wall-velocity-dropped"].step, GALLERY),
]


@pytest.mark.parametrize(("name", "stepper", "question"), FAULTY)
def test_each_property_refuses_a_faulty_stepper(name, stepper, question):
    assert PROPERTIES[name](plain.next_collision, *question)
    with pytest.raises(AssertionError) as refusal:
        PROPERTIES[name](stepper, *question)
    assert re.fullmatch(r"[a-z ]+: .*; \{\"cmd\": \"step\".*\}", str(refusal.value))


def test_every_property_has_its_faulty_stepper():
    assert {name for name, _, _ in FAULTY} == set(PROPERTIES)


def one_sided(scene, state, t_end):
    """Treat the sides by different formulas, which differ by an ulp."""
    found = plain.next_collision(scene, state, t_end)
    return replace(found, dt=found.dt * (1 + 2.0**-52)) if state.vx < 0 else found


def test_properties_are_exact_or_within_rounding_as_is_asked():
    """Scaling leaves out what would overflow; a shift by a period is exact where the period is."""
    with pytest.raises(AssertionError, match="mirror in x: dt"):
        check_mirror(one_sided, *GALLERY)
    assert check_mirror(one_sided, *GALLERY, is_exact=False)
    with pytest.raises(AssertionError, match="within"):
        check_mirror(one_sided, *GALLERY, is_exact=False, bound=1e-18)
    assert not check_scaling(plain.next_collision, *GALLERY, length=500)
    assert check_scaling(plain.next_collision, *GALLERY, length=30, time=-30)
    assert check_period_shift(plain.next_collision, *LIFT, is_exact=True)
    with pytest.raises(AssertionError):
        check_period_shift(MUTANTS["root-in-absolute-time"].step, *LIFT, is_exact=True)


NO_OUTCOMES = {
    "nothing": lambda _: None,
    "a tuple": lambda _: ("arc", 0.5),
    "an array": lambda _: np.zeros(7),
    "a class": lambda _: Undecided,
    "a wall elsewhere": lambda c: replace(c, wall="roof"),
    "no wall": lambda c: replace(c, wall=None),
    "nan": lambda c: replace(c, dt=math.nan),
    "infinity": lambda c: replace(c, vx=-math.inf),
    "no number": lambda c: replace(c, x=None),
    "a text": lambda c: replace(c, x="0.5"),
    "an integer beyond all floats": lambda c: replace(c, t=10**400),
    "a horizon nowhere": lambda c: Horizon(c.t, math.nan, c.y, c.vx, c.vy),
    "a refusal of a state clearly inside": lambda _: Rejected("no"),
}


@pytest.mark.parametrize("name", PROPERTIES)
@pytest.mark.parametrize("no_outcome", NO_OUTCOMES)
@pytest.mark.parametrize("question", [GALLERY, LIFT], ids=["cap", "stem"])
def test_what_is_no_outcome_is_refused(name, no_outcome, question):
    """It is nothing to compare: a stepper that forgets to return would hold every property."""
    with pytest.raises(AssertionError) as refusal:
        PROPERTIES[name](lambda *asked: NO_OUTCOMES[no_outcome](plain.next_collision(*asked)), *question)
    assert re.fullmatch(r"outcome: .*, must be .*; \{\"cmd\": \"step\".*\}", str(refusal.value))
    assert ("no refusal of a state clearly inside" in str(refusal.value)) == ("a refusal" in no_outcome)


def test_what_is_clearly_inside_is_refused_by_nobody(tally):
    """Drawn states and nudged ones, inside and out: where an honest stepper refuses, it is never clear."""
    steppers = [reference.next_collision, *HONEST.values()]

    @settings(max_examples=150)
    @given(scenes_and_states(), st.sampled_from((0.0, 0.0, 0.5, 2.0**-12, 2.0**-18)))
    def question(drawn, off):
        scene, state, t_end = drawn
        size = rounded(scene, state.t).size
        state = replace(state, x=state.x + off * size, y=state.y - off * size)
        is_clear = is_clearly_inside(scene, state, t_end)
        tally["clear" if is_clear else "not clear"] += 1
        for stepper in steppers:
            is_refused = isinstance(stepper(scene, state, t_end), Rejected)
            tally["refused"] += is_refused
            assert not (is_clear and is_refused), stepper

    question()
    assert min(tally["clear"], tally["not clear"], tally["refused"]) > 20


@pytest.mark.parametrize(("t", "t_end"), [(5e-324, 1.0), (0.0, 5e-324), (0.0, 1e-310)])
def test_a_time_that_not_every_stepper_can_hold_makes_nothing_clear(t, t_end):
    state = State(t, 0.125, 0.25, 2.0**-60, 2.0**-60)
    assert isinstance(fast.next_collision(Cap(r=1.0), state, t_end), Rejected)
    assert not is_clearly_inside(Cap(r=1.0), state, t_end)


def in_numpy(*question):
    found = plain.next_collision(*question)
    numbers = {"dt": np.float64(found.dt), "x": np.float64(found.x)} if isinstance(found, Collision) else {}
    return replace(found, **numbers)


def test_numbers_of_other_kinds_are_taken_and_undecided_answers_not_compared():
    corner = (tables.CIRCLE, State(0.0, 0.5, 0.5, 0.5, -0.5), 9.0)
    for check in PROPERTIES.values():
        assert check(in_numpy, *LIFT) == check(plain.next_collision, *LIFT)
        assert not check(plain.next_collision, *corner)


def lost(share):
    """Keep every velocity, and lose a share of the particles."""

    def flow(_scene, states, t_end):
        kept = [(Horizon(t_end, s.x, s.y, s.vx, s.vy), None) for s in states]
        n = round(share * len(states))
        return [(Undecided("shy"), None)] * n + kept[n:]

    return flow


@pytest.mark.parametrize(
    ("share", "n", "word"),
    [(0.0, 4000, "0 lost"), (0.5, 4000, "2000 lost.*at most 1% may be"), (1.0, 20, "nan")],
)
def test_a_flow_must_do_work_and_not_lose_so_many_that_anything_would_do(share, n, word):
    with pytest.raises(AssertionError, match=word):
        check_work_identity(lost(share), load("breathing-circle"), n_particles=n, kT=100.0)


def carried(scene, states, t_end):
    return [(outcome, None) for outcome in fast.flow(scene, states, t_end).outcomes]


def by_one_direction(scene, states, t_end):
    """Carry both directions of a cycle as if they were alike."""
    return carried(transforms.backwards(scene) if scene.r.sin[0] < 0 else scene, states, t_end)


def test_a_stepper_for_which_cycle_and_reverse_are_alike_is_told_from_one_that_reverses_time():
    honest, alike = (
        profiles.reversal(flow, load("moving-cap-trivial"), n_particles=4000, energy=1000.0)
        for flow in (carried, by_one_direction)
    )
    assert honest.is_met
    assert honest.has_power
    assert not alike.is_met


BACK_AND_FORTH = {
    "a film": (transforms.backwards(transforms.backwards(LIFT[0])), LIFT[0]),
    "a mirror": (transforms.mirrored(transforms.mirrored(LIFT[1])), LIFT[1]),
    "units": (transforms.scaled(transforms.scaled(GALLERY[0], 3, 4), -3, -4), GALLERY[0]),
    "units far apart": (
        transforms.scaled(transforms.scaled(GALLERY[0], 700, -400), -1400, 800),
        transforms.scaled(GALLERY[0], -700, 400),
    ),
    "a state in units far apart": (
        transforms.scaled_state(transforms.scaled_state(GALLERY[1], 600, -400), -1080, 0),
        transforms.scaled_state(GALLERY[1], -480, -400),
    ),
    "beyond binary64": (
        transforms.scaled_state(State(0.0, 0.0, 1.0, 0.0, -1.0), 600, -600).vy,
        -math.inf,
    ),
}


@pytest.mark.parametrize("name", BACK_AND_FORTH)
def test_transforms_can_be_undone(name):
    found, expected = BACK_AND_FORTH[name]
    assert found == expected
