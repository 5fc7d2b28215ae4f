"""The strategies draw only what is valid, in all variety; the properties hold for the three steppers.

Each property refuses a stepper that breaks it.
"""

import json
import math
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

import msgspec
import numpy as np
import pytest
from hypothesis import HealthCheck, given, seed, settings, strategies as st
from msgspec.structs import replace
from support import tables
from support.depth import deep_but

import fast
import reference
from conformance import plain, profiles
from conformance.cases.scenes import Clock
from conformance.cases.table import FAMILIES
from conformance.mutants import COMMON, MUTANTS
from conformance.plain import Flight, next_collision
from conformance.profiles import check_work_identity
from conformance.properties import (
    PROPERTIES,
    check_mirror,
    check_period_shift,
    check_scaling,
    is_clearly_inside,
)
from conformance.strategies import adversarial, laws, scenes_and_states, states
from scene import (
    BangBang,
    Cap,
    Collision,
    Fourier,
    Horizon,
    Mushroom,
    Rejected,
    State,
    Stem,
    Undecided,
    Undefined,
    check_scene,
    from_data,
    load,
    to_data,
    transforms,
)
from scene.geometry import rounded
from scene.laws import law_of
from scene.states import check_numbers

N_QUESTIONS = 40
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
        return moves is None or moves == (drawn[0].cycle is not None)

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


@pytest.mark.parametrize("question", deep_but([GALLERY, STATIC, BREATHING, LIFT], GALLERY, STATIC))
def test_the_reference_holds(question):
    """Few questions, for each takes some dozens of proved steps; the point is that all are compared."""
    compared = [name for name, check in PROPERTIES.items() if check(proved, *question)]
    left = set(PROPERTIES) - set(compared)
    assert left <= {"period-shift", "energy", "angular-momentum"}, left


def separate_path_for_moving_walls(scene, state, t_end):
    found = plain.next_collision(scene, state, t_end)
    is_still = all(isinstance(law.as_field(), float) for law in scene.laws.values())
    return (
        found if is_still or not isinstance(found, Collision) else replace(found, dt=found.dt * (1 + 1e-15))
    )


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

    @settings(max_examples=100)
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


def lost(share, outcome):
    """Keep every velocity, and give a share of the particles another outcome."""

    def flow(_scene, states, t_end):
        kept = [(Horizon(t_end, s.x, s.y, s.vx, s.vy), None) for s in states]
        n = round(share * len(states))
        return [(outcome, None)] * n + kept[n:]

    return flow


@pytest.mark.parametrize(
    ("share", "outcome", "n", "word"),
    [
        (0.0, Undefined("corner"), 4000, "0 lost"),
        (0.5, Undefined("corner"), 4000, "2000 lost.*at most 1% may be"),
        (1.0, Undefined("corner"), 20, "nan"),
        (0.5, Undecided("shy"), 4000, "0 lost, 2000 undecided.*anything would do"),
        (1.0, Undecided("shy"), 20, "20 undecided.*anything would do"),
    ],
)
def test_a_flow_must_do_work_and_not_lose_so_many_that_anything_would_do(share, outcome, n, word):
    with pytest.raises(AssertionError, match=word):
        check_work_identity(lost(share, outcome), load("breathing-circle"), n_particles=n, kT=100.0)


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


def assert_sound(scene, state, t_end):
    """The reference, which is exact, takes the scene and the state."""
    check_scene(scene)
    check_numbers(scene, state, t_end)
    assert isinstance(reference.next_collision(scene, state, state.t, digits=15), reference.Horizon)


@given(scenes_and_states())
def test_every_drawn_step_is_sound(drawn):
    assert_sound(*drawn)


@pytest.mark.parametrize(
    "name", ["moving-cap", "ergodic", "fixed-cap-anticlockwise", "fermi-ulam", "breathing-circle"]
)
@settings(max_examples=50)
@given(data=st.data())
def test_states_of_a_given_scene_are_sound(name, data):
    assert_sound(load(name), *data.draw(states(load(name))))


@given(st.floats(-4.0, 4.0), st.floats(0.0, 4.0), st.data())
def test_laws_stay_in_their_range(low, width, data):
    law = law_of(data.draw(laws(low, low + width)))
    slack = 2.0**-45 * (abs(low) + width)
    told = law.bounds()
    if low > 0.0 and not told.lowest >= low - slack:  # waves that add up to more than the mean
        reached = law.values(2 * math.pi / law.omega * np.arange(512) / 512)
        told = told._replace(lowest=reached.min(), highest=reached.max())
    assert told.lowest >= low - slack
    assert told.highest <= low + width + slack


def test_some_waves_add_up_to_more_than_the_mean(tally):
    @settings(max_examples=300)
    @given(laws(0.1, 2.0, Clock("fourier", 1.0)))
    def draw(law):
        law = law_of(law)
        tally["deep"] += law.bounds().lowest < 0.0 < law.size_bounds().lowest

    draw()
    assert tally["deep"] > 5


N_SESSIONS, N_EACH = 30, 30
N_DRAWN = N_SESSIONS * N_EACH


def features(scene, state, t_end):
    """Name what tables and laws there are, what a state is near to, how it flies, and when."""
    found, flight = scene.laws, Flight(scene, state, t_end)
    moving = [law for law in found.values() if not law.is_constant]
    waves = [law for law in moving if isinstance(law, Fourier)]
    legs = [len(law.knots) - 1 for law in moving if isinstance(law, BangBang)]
    knots = [t for law in moving if isinstance(law, BangBang) for t, _ in law.knots]
    slope = getattr(scene, "slope", None)
    cycle, is_mushroom = scene.period, isinstance(scene, Mushroom)
    lengths = [law.bounds() for name, law in found.items() if name in ("r", "w", "h")]
    longest = max(max(abs(b.lowest), abs(b.highest)) for b in lengths)
    size = max(flight.laws[name].value for name in ("r", "h") if name in flight.laws)
    around = [w for w in flight.walls_near(in_cap=flight.is_in_cap) if w != state.wall]
    n_close = sum(flight.f(w, 0.0)[0] < size * 2.0**-10 * (size if w == "arc" else 1) for w in around)
    speed, distance = math.hypot(state.vx, state.vy), math.hypot(state.x, state.y)
    fastest = max(b.slope for b in lengths) or longest
    grazing = 2.0**-10 * (2 * distance if state.wall == "arc" else 1.0) * speed
    is_free = is_mushroom and state.wall is None
    return {
        type(scene).__name__: True,
        f"laws: {type(moving[0]).__name__ if moving else 'static'}": True,
        "mouth: w": is_mushroom and scene.nu is None,
        "mouth: nu": is_mushroom and scene.nu is not None,
        "slope: negative": isinstance(slope, float) and slope < 0,
        "slope: zero": slope == 0,
        "slope: positive": isinstance(slope, float) and slope > 0,
        "slope: moving": slope in moving,
        **{f"harmonics: {max(k for k, _, _ in law.harmonics())}": True for law in waves},
        **{f"legs: {n if n < 5 else 'many'}": True for n in legs},
        "size: small": longest < 2.0**-10,
        "size: large": longest > 2.0**10,
        f"on: {type(scene).__name__} {state.wall}": True,
        "near: wall": n_close >= 1,
        "near: corner": n_close >= (2 if state.wall is None else 1),
        "near: mouth": is_free and abs(state.y) < size * 2.0**-10,
        "near: in the mouth": is_free and state.y == 0,
        "near: centre": distance < size * 2.0**-6,
        f"decade: {math.floor(math.log10(speed / fastest))}": True,
        "waits": t_end > state.t,
        "waits not": t_end == state.t,
        "time: zero": state.t == 0,
        "time: negative": state.t < 0,
        "time: on a knot": any(math.remainder(state.t - t, cycle) == 0 for t in knots),
        "time: late": bool(cycle) and abs(state.t) > 100 * cycle,
        "flies: along an axis": 0.0 in (state.vx, state.vy),
        "flies: grazing": state.wall is not None and flight.f(state.wall, 0.0)[1] < grazing,
    }


# How often what is named is to be drawn.
LEAST = {
    **dict.fromkeys(["Cap", "Stem", "Mushroom"], N_DRAWN // 10),
    **dict.fromkeys(["laws: static", "laws: Fourier", "laws: BangBang"], N_DRAWN // 20),
    **{f"on: {t.__name__} {wall}": 5 for t in (Cap, Stem, Mushroom) for wall in (None, *t.walls)},
    **dict.fromkeys(["mouth: w", "mouth: nu"], 25),
    **{f"slope: {how}": 10 for how in ("negative", "zero", "positive", "moving")},
    **{f"harmonics: {n}": 5 for n in (1, 2, 3)},
    **{f"legs: {n}": 5 for n in (2, 3, 4, "many")},
    **dict.fromkeys(["size: small", "size: large"], 1),
    **dict.fromkeys(["near: wall", "near: corner", "near: mouth", "near: in the mouth", "near: centre"], 5),
    **{f"decade: {n}": 5 for n in range(-3, 6)},
    **dict.fromkeys(["waits", "waits not", "flies: along an axis", "flies: grazing"], 10),
    **dict.fromkeys(["time: zero", "time: negative", "time: on a knot", "time: late"], 5),
}


def test_every_kind_of_scene_and_start_is_reached():
    """Within one session Hypothesis varies what it drew before; separate seeds are independent."""
    counts: Counter[str] = Counter()

    def collect(step):
        counts.update(name for name, is_so in features(*step).items() if is_so)

    for number in range(N_SESSIONS):
        session = settings(max_examples=N_EACH, database=None, derandomize=False)
        seed(number)(session(given(scenes_and_states())(collect)))()
    assert {name: counts[name] for name, least in LEAST.items() if counts[name] < least} == {}


@pytest.mark.parametrize("name", deep_but(FAMILIES, "corner-arrival", "anywhere-stem-left", "nearly-shut"))
def test_every_family_is_reached(name):
    """By Hypothesis's bits as by a seed's."""

    @settings(max_examples=3, suppress_health_check=list(HealthCheck))
    @given(adversarial(name))
    def draw(asked):
        assert asked.group == name
        assert asked.t_end >= asked.state.t

    draw()


BLIND = {
    "to a floor that moves": lambda of, hit: hit.wall == "floor" and not of.laws["h"].is_constant,
    "to a mushroom's base": lambda of, hit: hit.wall == "base" and isinstance(of, Mushroom),
}


def failing_line(name):
    """Return the line that is printed for a stepper that never hits what `name` says."""

    @seed(1)
    @settings(max_examples=1000, database=None, derandomize=False)
    @given(scenes_and_states())
    def hold(drawn):
        hit = next_collision(*drawn)
        assert not (isinstance(hit, Collision) and BLIND[name](drawn[0], hit))

    with pytest.raises(AssertionError) as caught:
        hold()
    return next(text for text in caught.value.__notes__ if '"cmd"' in text)


@pytest.mark.parametrize("name", deep_but(BLIND, "to a floor that moves"))
def test_a_faulty_stepper_is_reported_by_a_line_of_few_and_short_numbers(name):
    """That of the step that fails. At most twelve are not 0 or 1, all but three of at most six digits."""
    # In a process of its own: Hypothesis also draws constants of all modules that are loaded.
    code = f"import sys; sys.path += ['tests']; import {__name__} as t; print(t.failing_line({name!r}))"
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=Path(__file__).parents[1], capture_output=True, check=True, text=True)
    line = next(part for part in done.stdout.splitlines() if '"cmd"' in part)
    request = json.loads(line)
    scene = from_data(request["scene"])
    assert BLIND[name](scene, next_collision(scene, State(**request["state"]), request["t_end"]))
    numbers = [text for text in re.findall(r"-?[0-9][0-9.e+-]*", line) if float(text) not in (0.0, 1.0)]
    lengths = sorted(len(text.strip("-").replace(".", "")) for text in numbers)
    assert len(numbers) <= 12
    assert lengths[-4] <= 6
