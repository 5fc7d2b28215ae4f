"""Steppers against the reference on generated geometries; how answers are compared, and each verdict."""

import json
import math
import os
from fractions import Fraction

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from mpmath import MPContext
from support.depth import deep_but
from support.edges import LATE_EDGES, is_among
from support.tables import CIRCLE, LIFT, STATIC
from support.truth import certified_answer, is_delicate, proved_step

import fast
import reference
from conformance import plain
from conformance.cases.attacks import stepped
from conformance.grading.agreement import Enclosed, compare, grade, middle, physics_bound, precision_class
from conformance.mutants import PLAIN
from conformance.mutants.mutant import make_mutant
from conformance.strategies import scenes_and_states
from conformance.vectors import NUMBERS, Certified, Expectation, Vector, certified
from scene import (
    BangBang,
    Cap,
    Collision,
    Fourier,
    Horizon,
    Rejected,
    State,
    Stem,
    Undecided,
    from_data,
    load,
)
from scene.laws import law_of
from scene.states import ON_WALL

N_STEPS = int(os.environ.get("MUSHROOMS_STEPS", "200"))  # MUSHROOMS_STEPS=20000 for the whole
BOUND = 4.0  # backward ulps
# Stepper, how many steps, their bound [backward ulps], and the share that may be undecided: the strategies
# aim at corners and edges on purpose. Of the plain stepper the corpus asks many more; the worst of 2,500
# steps was 218, at a slow particle before a fast wall.
STEPPERS = {
    "fast": (fast.next_collision, N_STEPS, BOUND, 0.04),
    "plain": (plain.next_collision, 100, 1024.0, 0.08),
}


@pytest.mark.parametrize("name", STEPPERS)
def test_it_agrees_with_the_reference(name, tally):
    stepper, n_steps, bound, undecided_share = STEPPERS[name]
    worst = 0.0

    @settings(max_examples=n_steps)
    @given(scenes_and_states())
    def step(drawn):
        nonlocal worst
        answer, truth = stepper(*drawn), proved_step(*drawn)
        found = compare(answer, truth, drawn[1], bound)
        tally["steps"] += 1
        tally[type(answer).__name__.lower()] += 1
        if isinstance(answer, Collision):
            tally[answer.wall] += 1
        worst = max(worst, found.ulps)
        # A place on the side of a stem far narrower than the way there is known to the rounding of that way.
        is_rounding = name == "plain" and found.verdict == "fail" and found.relative <= 2.0**-50
        assert found.verdict in ("pass", "declined") or truth is None or is_rounding, (found, answer)
        assert found.verdict == "pass" or name == "plain" or is_delicate(*drawn), answer

    step()
    tally["worst backward ulps (thousandths)"] = round(1000 * worst)
    assert tally["steps"] >= n_steps
    assert tally["collision"] >= n_steps // 3
    assert tally["undecided"] <= undecided_share * n_steps


SCENE = load("moving-cap")
STATE = State(0.1, 0.2, 0.3, 10.0, -3.0)


def off(c, dt=1.0, **changes):
    return msgspec.structs.replace(c, dt=c.dt * dt, **changes)


# What is told in place of the right answer up to t_end, how it compares, and how an attack judges it.
SPOILT = {
    "right": (10.0, lambda c: c, "pass", "agreed"),
    "right horizon": (0.11, lambda c: c, "pass", "agreed"),
    "another wall": (10.0, lambda c: off(c, wall="floor"), "fail", "wrong"),
    "time": (10.0, lambda c: off(c, 1 + 1e-13), "fail", "wrong"),
    "velocity": (10.0, lambda c: off(c, vy=-c.vy), "fail", "wrong"),
    "nan": (10.0, lambda c: off(c, vx=float("nan")), "fail", "wrong"),
    "place at the horizon": (0.11, lambda c: msgspec.structs.replace(c, x=c.x + 1e-9), "fail", "wrong"),
    "a horizon": (10.0, lambda c: Horizon(c.t, c.x, c.y, c.vx, c.vy), "fail", "wrong"),
    "none": (10.0, lambda c: Undecided("shy"), "declined", "undecided"),
    "a refusal": (10.0, lambda c: Rejected("no"), "fail", "refused"),
}


@pytest.mark.parametrize("name", SPOILT)
def test_comparison_catches_spoilt_answers(name):
    t_end, spoil, compared, judged = SPOILT[name]
    truth = proved_step(SCENE, STATE, t_end)
    (right,) = middle(truth, STATE)
    assert compare(spoil(right), truth, STATE, BOUND).verdict == compared
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
    assert compare(Enclosed(step.wall, ends), truth, STATE, BOUND).verdict == "pass"
    off = [
        (low, high) if i else (high + high / 10**20, high + high / 10**19)
        for i, (low, high) in enumerate(ends)
    ]
    found = compare(Enclosed(step.wall, off), truth, STATE, 0.0)
    assert (found.verdict, 0 < found.ulps < 1) == ("fail", True)
    (right,) = middle(truth, STATE)
    low, high = step.ends("x")
    wide = certified(
        {**dict(zip(NUMBERS, ends, strict=True)), "x": (low, high + 1)}, step.allowance, step.wall
    )
    assert compare(right, Expectation("collision", (wide,)), STATE).verdict == "indeterminate"
    assert compare(right, None, STATE, BOUND).verdict == "indeterminate"
    assert compare(Undecided("shy"), None, STATE, BOUND).verdict == "declined"


CTX = MPContext()
CTX.dps = 60
# Its floor, left at speed 1/4 at t = 0, is touched again at t = 7/8: f = (s - 7/8)^2 / 2.
BACK = Stem(w=1.0, h=BangBang(knots=((-1.0, 1.0), (1.0, 2.0), (1.5, 1.5), (2.0, 2.0), (3.0, 1.0))))
DROP = Stem(w=1.0, h=BangBang(knots=((-1.0, 1.0), (0.125, 1.0), (1.125, 0.75), (2.0, 0.75), (3.0, 1.0))))


@pytest.mark.parametrize("s", [1e-12, 0.1, 0.25, 0.6, 1.0, 3.7])
@pytest.mark.parametrize("t", [-1.375, 0.0, 0.125, 0.3125, 0.5, 7.0625])
@pytest.mark.parametrize("law", [LIFT.h, Fourier(mean=1.0, omega=2.0, cos=(0.25, 0.125), sin=(0.5,))])
def test_a_law_rises_by_what_its_values_do(law, t, s):
    """A difference of two values would lose all digits of a rise in a short time."""
    seen = plain.Flight.motion(law_of(law), t).at(s)
    then, rise = (law_of(law).value(CTX, CTX.mpf(t) + CTX.mpf(later)) for later in (0.0, s))
    assert seen.rise == pytest.approx(float(rise - then), rel=1e-11, abs=1e-15 * s)


@pytest.mark.parametrize(
    ("scene", "state", "answer"),
    [
        (CIRCLE, State(0.0, 0.5, 0.5, 0.5, -0.5), "undecided"),  # a corner
        (STATIC, State(0.0, 0.25, 0.25, 1.0, -1.0), "undecided"),  # the mouth's edge
        (LIFT, State(0.0, 0.0, -1.0, 0.0, 0.0), "undecided"),  # a touch
        (LIFT, State(0.0, 0.0, -2.0, 0.0, 0.0, "floor"), "undecided"),  # sliding
        (DROP, State(0.0, 0.25, -1.0, 0.0, 0.25, "floor"), "undecided"),  # a touch of the floor that is left
        (DROP, State(0.0, 0.25, -1.0 + 2.0**-30, 0.0, 0.25, "floor"), "undecided"),
        (
            BACK,
            State(0.0, 0.25, -1.5, 0.0, 0.0, "floor"),
            "undecided",
        ),  # a touch with no net change of any term
        (BACK, State(0.0, 0.25, -1.5, 0.0, 2.0**-60, "floor"), "undecided"),
        (CIRCLE, State(0.0, 0.0, 1.0, 1.0, -1.0, "arc"), "undecided"),  # a corner of the arc that is left
        (STATIC, State(0.0, 0.025, 0.0, 0.25, 0.0), "undecided"),  # along the mouth to its edge at t_end
        (STATIC, State(0.0, 0.5, 0.0, 0.25, 1.0), "undecided"),  # at the mouth's edge
        (STATIC, State(0.0, 1.0, 0.0, 0.25, -1.0), "undecided"),  # where the base ends
        (CIRCLE, State(0.0, 0.9, 0.9, 1.0, 0.0), "rejected"),
        (CIRCLE, State(0.0, 0.6, 0.8, 1.0, 0.0, "arc"), "rejected"),
        (CIRCLE, State(0.0, math.nan, 0.8, 1.0, 0.0), "rejected"),
        (CIRCLE, State(0.0, 0.0, 0.5, 1e200, 0.0), "undecided"),
        (CIRCLE, State(0.0, 0.1, 0.5, 0.0, 0.0), "horizon"),  # at rest
        # Outside of the side that is left by rounding, and going inwards: no base is met from below.
        (STATIC, State(0.0, -0.5 - 2.0**-24, -0.25, 2.0**-26, 1.0, "left"), "arc"),
    ],
)
def test_what_it_does_not_answer_it_says(scene, state, answer):
    found = plain.next_collision(scene, state, 1.9)
    assert getattr(found, "wall", type(found).__name__.lower()) == answer


DIAMETERS = [State(0.0, -sign, 2.0**-53, 2.0 * sign, 0.0, "arc") for sign in (-1.0, 1.0)]
# Along these f is a small difference of its terms, and so is f'.
FLAT_CHORDS = [
    State(0.0, x, y, -y - inward * x, x - inward * y, "arc")
    for angle in np.linspace(0.8, 2.3, 8)
    for x, y in [(float(np.cos(angle)), float(np.sin(angle)))]
    for inward in (2.0**-3, 2.0**-10, 2.0**-20)
]


@pytest.mark.parametrize("start", [*DIAMETERS, *FLAT_CHORDS])
def test_the_wall_being_left_met_again_at_the_horizon(start):
    x_is, vx_is, y_is, vy_is = map(Fraction, (start.x, start.vx, start.y, start.vy))
    again = float(-2 * (x_is * vx_is + y_is * vy_is) / (vx_is**2 + vy_is**2))
    for ulps in (-3, -1, 0, 1, 3):
        assert isinstance(plain.next_collision(CIRCLE, start, again * (1.0 + ulps * 2.0**-52)), Undecided)
    assert isinstance(plain.next_collision(CIRCLE, start, 1.001 * again), Collision)
    for part in (0.0, 2.0**-40, 0.999):
        assert isinstance(plain.next_collision(CIRCLE, start, part * again), Horizon)


@pytest.mark.parametrize(
    ("length", "speed"), [(-350, -636), (-400, -700), (-1000, -1000), (-600, -300), (0, -600)]
)
def test_a_hit_is_not_lost_where_squares_vanish(length, speed):
    """The gap of the arc is one of squares: with v^2 = 0 no hit of it is seen."""
    r, v = 2.0**length, 2.0**speed
    for start in (State(0.0, r / 4, r / 2, -0.75 * v, v), State(0.0, 0.75 * r, 0.0, 0.0, v, "base")):
        for t_end in (1.5 * r / v, 4.0 * r / v):
            assert not isinstance(plain.next_collision(Cap(r=r), start, t_end), Horizon)


def rounded_phase(flight, honest, wall):
    """Takes f at departure for exact, though late in time the phase that it is taken at is rounded."""
    off = abs(flight.gap(wall, 0.0).start) > ON_WALL * flight.size(wall)
    return Rejected("not on its wall") if off else honest(wall)


def rounded_turn(flight, honest, wall):
    """Takes f' at departure for exact, though late in time the phase that it is taken at is rounded."""
    return Rejected("it moves into it") if flight.f(wall, 0.0)[1] < 0 else honest(wall)


FAULTY = [
    make_mutant(plain.Flight, "refusal_of_departure", change) for change in (rounded_phase, rounded_turn)
]


@pytest.mark.parametrize("stepper", [reference.next_collision, *(one.step for one in (PLAIN, *FAULTY))])
def test_no_state_is_refused_for_a_rounded_phase(stepper):
    """The reference, which knows every phase, agrees with what may come."""
    is_right = []
    for question, allowed in LATE_EDGES:
        state = msgspec.convert(question["state"], State)
        found = stepper(from_data(question["scene"]), state, question["t_end"])
        kind = "collision" if hasattr(found, "dt") else type(found).__name__.lower()
        is_right.append(is_among({"outcome": kind, "wall": getattr(found, "wall", None)}, allowed))
    assert all(is_right) == (stepper not in [one.step for one in FAULTY])


THIN = {"dt": ("0.75", "0.75"), "x": ("1", "1"), "y": ("-0.5", "-0.5"), "vx": ("-1", "-1"), "vy": ("0", "0")}
BOX = {"table": "stem", "w": 1.0, "h": 1.0}
RIGHT = Certified(**THIN, allowance=(1.25, 1.0, 0.5, 1.0, 0.0), wall="right")
LEFT = Certified(
    **{**THIN, "dt": ("2", "2"), "x": ("-1", "-1"), "vx": ("1", "1")},
    allowance=(2.0, 1.0, 0.5, 1.0, 0.0),
    wall="left",
)
AT_END = Certified(
    **{**THIN, "dt": ("0.5", "0.5"), "x": ("0.75", "0.75"), "vx": ("1", "1")},
    allowance=(0.0, 1.0, 0.5, 1.0, 0.0),
)
HIT = {
    "outcome": "collision",
    "wall": "right",
    "dt": 0.75,
    "t": 0.75,
    "x": 1.0,
    "y": -0.5,
    "vx": -1.0,
    "vy": 0.0,
}
NEXT = {**HIT, "wall": "left", "dt": 2.0, "t": 2.75, "x": -1.0, "vx": 1.0}
END = {"outcome": "horizon", "t": 0.5, "x": 0.75, "y": -0.5, "vx": 1.0, "vy": 0.0}
SHIFT = 4  # times the bound: beyond it, whatever the enclosure's width


def vector(*expect, kind="step", t_end=9.0, collisions=1):
    return Vector(
        id="test/1",
        group="test",
        level="core",
        kind=kind,
        rule="a level flight in a box",
        source="hard case 17",
        scene=BOX,
        state=State(0.0, 0.25, -0.5, 1.0, 0.0),
        t_end=t_end,
        expect=expect,
        collisions=collisions,
    )


STEP = vector(Expectation("collision", (RIGHT,)))
HORIZON = vector(Expectation("horizon", (AT_END,)), t_end=0.5)
TIE = vector(Expectation("undefined", reason="corner"), Expectation("undecided"))
REFUSAL = vector(Expectation("rejected"))
EITHER = vector(Expectation("collision", (RIGHT,)), Expectation("rejected"))
PATH = vector(Expectation("collision", (RIGHT, LEFT)), kind="trajectory", collisions=2)
WIDE = vector(Expectation("collision", (msgspec.structs.replace(RIGHT, x=("0.99999999", "1.00000001")),)))
UNDECIDED = {"outcome": "undecided", "reason": "within rounding"}
REJECTED = {"outcome": "rejected", "reason": "state.x"}
CORNER = {"outcome": "undefined", "reason": "corner"}

VERDICTS = [
    (STEP, HIT, "pass", ""),
    (STEP, {**HIT, "seq": 7, "comment": "more than was asked"}, "pass", ""),
    (STEP, {**HIT, "x": 1, "vy": -0.0}, "pass", ""),
    (STEP, {**HIT, "wall": "left"}, "fail", "left, must be right"),
    (STEP, END, "fail", "horizon, must be right"),
    (STEP, {**HIT, "vx": 1.0}, "fail", "vx is off by"),
    (STEP, {**HIT, "vy": 1e-8}, "fail", "vy is off by"),
    (STEP, {**HIT, "t": 0.0}, "fail", "t is off by"),
    (STEP, {name: HIT[name] for name in HIT if name != "dt"}, "pass", "without dt, t is graded"),
    (STEP, {**HIT, "dt": None, "t": 0.75 + 1e-8}, "fail", "t is off by"),
    (STEP, {**HIT, "dt": None, "wall": "left"}, "fail", "left, must be right"),
    (STEP, {**HIT, "dt": 0.75 + 1e-8}, "fail", "dt is off by"),
    (STEP, REJECTED, "fail", "state.x"),
    (STEP, CORNER, "fail", "undefined, must be right"),
    (STEP, UNDECIDED, "declined", "within rounding"),
    (STEP, {"seq": 1, "error": "segmentation\nfault"}, "error", "segmentation fault"),
    (HORIZON, END, "pass", ""),
    (HORIZON, HIT, "fail", "right, must be horizon"),
    (HORIZON, {**END, "t": 0.25}, "fail", "t is off by"),
    (TIE, CORNER, "pass", ""),
    (TIE, UNDECIDED, "pass", ""),
    (TIE, HIT, "fail", "must be undefined corner"),
    (TIE, {**CORNER, "reason": "sliding"}, "fail", "undefined sliding, must be undefined corner"),
    (REFUSAL, REJECTED, "pass", ""),
    (REFUSAL, HIT, "fail", "collision, must be rejected"),
    (REFUSAL, UNDECIDED, "declined", ""),
    (EITHER, HIT, "pass", ""),
    (EITHER, REJECTED, "pass", ""),
    (EITHER, UNDECIDED, "pass", "a refusal is allowed here"),
    (EITHER, {**HIT, "vx": 1.0}, "fail", ""),
    # An enclosure too wide to accept a right x still refuses a wrong one.
    (WIDE, HIT, "indeterminate", "x"),
    (WIDE, {**HIT, "x": 1.1}, "fail", "x"),
    (PATH, {"steps": [HIT, NEXT]}, "pass", ""),
    (PATH, {"steps": [HIT]}, "fail", "step 2: missing, 1 of 2"),
    (PATH, {"steps": []}, "fail", "step 1: missing"),
    (PATH, {"steps": [HIT, NEXT, HIT]}, "fail", "1 steps too many"),
    (PATH, {"steps": [NEXT, HIT]}, "fail", "step 1: left, must be right"),
    (PATH, {"steps": [HIT, {**NEXT, "t": 2.0}]}, "fail", "step 2: t is off by"),
    (PATH, {"steps": [HIT, UNDECIDED]}, "declined", "step 2: undecided"),
    (PATH, {"steps": [{**HIT, "vx": 1.0}, UNDECIDED]}, "fail", "step 1: vx"),
    (PATH, UNDECIDED, "declined", ""),
    (PATH, REJECTED, "fail", ""),
]


MISSHAPEN = [
    (STEP, [HIT]),
    (STEP, None),
    (STEP, {}),
    (STEP, {"outcome": "hit"}),
    (STEP, {name: HIT[name] for name in HIT if name != "y"}),
    (STEP, {name: HIT[name] for name in HIT if name != "wall"}),
    (STEP, {**HIT, "wall": "roof"}),
    (STEP, {**HIT, "wall": None}),
    (STEP, {**HIT, "x": "1.0"}),
    (STEP, {**HIT, "x": True}),
    (STEP, {**HIT, "x": None}),
    (STEP, {**HIT, "x": 10**400}),
    (STEP, {**HIT, "x": math.nan}),
    (STEP, {**HIT, "vy": math.inf}),
    (STEP, {"outcome": "undefined", "reason": "bad luck"}),
    (STEP, {"outcome": "undecided"}),
    (STEP, {"steps": [HIT]}),
    (PATH, HIT),
    (PATH, {"steps": {"0": HIT}}),
    (PATH, {"steps": "none"}),
    (PATH, {"steps": [HIT, 3]}),
    (PATH, {"steps": [END, HIT]}),
]


@pytest.mark.parametrize(
    ("asked", "answer", "verdict", "words"),
    [*VERDICTS, *((asked, answer, "wrong-format", "") for asked, answer in MISSHAPEN)],
)
def test_verdicts(asked, answer, verdict, words):
    found = grade(asked, answer)
    assert found.verdict == verdict, found
    assert words in found.why
    assert "\n" not in found.why
    assert math.isnan(found.ulps) or verdict not in ("wrong-format", "error", "declined")


def test_backward_ulps_of_known_errors():
    """An error of 2^-50 in dt against (1.25 + 0.75 + 2^-50) 2^-53 is 4 backward ulps, a little less.

    A truth that is exactly zero, and that nothing moves, is measured by the vector that it belongs to.
    """
    found = grade(STEP, {**HIT, "dt": 0.75 + 2.0**-50})
    assert found.verdict == "pass"
    assert found.ulps == pytest.approx(4, rel=1e-14)
    assert found.relative == pytest.approx(2.0**-51, rel=1e-14)
    found = grade(STEP, {**HIT, "vy": 1e-17})
    assert (found.verdict, 0 < found.ulps < 1) == ("pass", True)
    assert grade(STEP, {**HIT, "vy": 1e-12}).ulps > 1000
    assert grade(STEP, HIT).ulps == 0


@pytest.mark.parametrize(
    ("ulps", "reached"),
    [
        ([], "A"),
        ([0.0, 4.0, math.nan], "A"),
        ([math.nan, 0.0, 4.0], "A"),
        ([math.nan, 5.0, math.nan], "B"),
        ([math.nan, math.nan], "A"),
        ([4.1], "B"),
        ([1.0, 1e4], "B"),
        ([5.0, 1.0001e4, 1.0], "C"),
        ([1.0, math.inf], "C"),
    ],
)
def test_precision_class(ulps, reached):
    assert precision_class(ulps) == reached


@pytest.mark.parametrize("every", deep_but([1, 6], 6))
def test_exact_answers_pass_within_an_ulp(corpus, every):
    grades = [grade(asked, certified_answer(asked)) for asked in corpus[::every]]
    assert {found.verdict for found in grades} == {"pass"}
    assert max(found.ulps for found in grades if not math.isnan(found.ulps)) <= 1.0


def shifted(asked: Vector, index: int, name: str, by: float):
    """The exact answer with one number of a step moved by so much backward error; None for an exact zero."""
    answer = json.loads(json.dumps(certified_answer(asked)))
    told = answer.get("steps") or answer.get("states") or [answer]
    step, steps = told[index if asked.kind == "trajectory" else 0], asked.expect[0].steps
    pair = next((pair for pair in (("x", "y"), ("vx", "vy")) if name in pair), (name,))
    allowed = dict(zip(NUMBERS, steps[index].allowance, strict=True))
    if name == "t":
        spans = [s.allowance[0] + float(s.centre("dt")) for s in steps[: index + 1]]
        size = 2 * abs(asked.state.t) + sum(spans)
    else:
        size = max(allowed[n] + abs(step[n]) for n in pair)
    step[name] += by * size
    return answer if size else None


@pytest.mark.parametrize("every", deep_but([3, 12], 12))
def test_shifted_answers_fail_and_slightly_shifted_ones_pass(corpus, every):
    n_shifted = 0
    for i, asked in enumerate(corpus[::every]):
        steps = asked.expect[0].steps
        if not steps or "hard-case-4" in asked.group:
            continue  # extreme numbers: a shift would overflow or vanish
        index = i % len(steps) if asked.kind == "trajectory" else len(steps) - 1
        names = ["t", *NUMBERS] if steps[index].wall else ["t", *NUMBERS[1:]]
        name = names[i % len(names)]
        bound = float(physics_bound(asked.condition))
        answer = shifted(asked, index, name, SHIFT * bound)
        if answer is None:
            continue  # an exact zero
        found = grade(asked, answer)
        assert found.verdict == "fail", (asked.id, index, name, found)
        assert found.why.split(" is off")[0].split(": ")[-1] == name
        assert grade(asked, shifted(asked, index, name, bound / 4)).verdict == "pass", asked.id
        n_shifted += 1
    assert n_shifted > 0.8 * len(corpus) / every
