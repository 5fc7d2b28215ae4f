"""What the reference answers is true: by closed forms, and by the verifier, from the published line alone.

Nothing here compares the reference with its own earlier results. Each faulty reference fails this battery.
Further answers: test_hard_cases.
"""

import json
import math
import random
from fractions import Fraction

import mpmath
import msgspec
import pytest
from hypothesis import given, settings, strategies as st
from support import faulty_references as faults
from support.answers_by_hand import ANSWERS
from support.depth import deep_among, deep_but
from support.tables import BREATHING, LEAP, LIFT
from support.truth import IS_DEEP, is_delicate, jacobian_error, proved_step

import reference
from conformance.cases.certify import claimed_path, with_further
from conformance.cases.delicate_families import sunk
from conformance.cases.draw import wire_form
from conformance.strategies import scenes_and_states
from conformance.vectors import Expectation
from conformance.verify import Verdict, verify_line
from reference import path, rational, start, timeline, walls
from reference.arithmetic import MAX_WORK, Arithmetic, sign
from reference.course import SIDES, Course
from reference.isolation import Isolator
from reference.jets import Jet
from reference.timeline import Legs, Waves, law_in_time
from reference.walls import MovingWalls
from scene import (
    BangBang,
    Cap,
    Fourier,
    InvalidState,
    Mushroom,
    Rejected,
    State,
    Stem,
    Undecided,
    Undefined,
    load,
)

FAR = 1e300  # the horizon of a path that is followed without one [time]
TILTING = Mushroom(
    r=Fourier(mean=1.0, omega=1.0, sin=(0.125,)),
    nu=Fourier(mean=0.5, omega=1.0, cos=(0.125,)),
    h=Fourier(mean=1.0, omega=1.0, sin=(-0.25,)),
    slope=Fourier(mean=0.0625, omega=1.0, sin=(0.0625,)),
)
DIGITS = 20
TINY = Fraction(1, 10**40)


def judge(scene, state, t_end, claim, kind="step"):
    """Return what the verifier says of a claim that is written as a line of the corpus."""
    question = {"kind": kind, "scene": wire_form(scene), "state": state, "t_end": t_end}
    expect = with_further(claim, scene, state)
    line = {**question, "collisions": max(len(claim.steps), 1), "expect": expect}
    return verify_line(json.loads(msgspec.json.encode(line)))


def prove_step(scene, state, t_end):
    """Return the reference's claim about a step, None where it is undecided; the verifier proves it."""
    claim = proved_step(scene, state, t_end)
    assert claim is None or judge(scene, state, t_end, claim) == Verdict("proved")
    return claim


def proved_wall(scene, state, t_end):
    """Return the wall that is met first, as the verifier proves; None where the reference is undecided."""
    claim = prove_step(scene, state, t_end)
    return claim and claim.steps[0].wall


def prove_path(scene, state, n_collisions, t_end=FAR, working=None):
    """Return the reference's claim about a path; the verifier proves it, as far as it goes."""
    claim = claimed_path(scene, state, n_collisions, t_end, working)
    if claim.outcome != "undecided":
        assert judge(scene, state, t_end, claim, "trajectory") == Verdict("proved")
    elif claim.steps:
        decided = Expectation("collision", claim.steps)
        assert judge(scene, state, t_end, decided, "trajectory") == Verdict("proved")
    return claim


def answers_by_hand():
    for name, (scene, state, t_end, expected, numbers) in ANSWERS.items():
        for digits in (DIGITS, 200):
            found = reference.next_collision(scene, state, t_end, digits=digits)
            if isinstance(found, Undefined):
                assert found.reason == expected, name
                continue
            if expected == "rejected":
                assert isinstance(found, Rejected), name
                continue
            assert isinstance(found, reference.Collision | reference.Horizon), name
            assert getattr(found, "wall", "horizon") == expected, name
            end = found.after if isinstance(found, reference.Collision) else found.at
            for field, number in numbers.items():
                enclosure = found.dt if field == "dt" else getattr(end, field)
                assert enclosure.contains(number) or abs(enclosure.centre() - number) < TINY, name


def starts_where_a_wall_turns():
    """At rest where an arc turns: after quarters, a sixth, an eighth, a ninth (sin 40 + sin 20 = sin 80)."""
    waves = [
        (0.0, Fourier(1.0, period=1.0, cos=(-0.25,))),
        (-7.75, Fourier(1.0, period=1.0, sin=(-0.25,))),
        (0.5, Fourier(1.0, period=3.0, cos=(-0.25, 0.125))),
        (0.125, Fourier(1.0, period=1.0, cos=(-0.375, 0.0, 0.125))),
        (1.0, Fourier(1.0, period=9.0, cos=(0.25, -0.125, 0.0, 0.0625))),
    ]
    for t, r in waves:
        opposite = Fourier(1.0, period=r.period, cos=[-a for a in r.cos], sin=[-b for b in r.sin])
        for law, expected in ((r, reference.Horizon), (opposite, Undefined)):
            start = State(t, 0.0, float(law.value(mpmath.mp, t)), 0.0, 0.0, "arc")
            assert isinstance(reference.next_collision(Cap(r=law), start, t + 0.125), expected)


def differentiated():
    """The Jacobian is what moving the start shows."""
    assert jacobian_error(BREATHING, State(0.5, 0.1, 0.3, 2.0, 3.0), ["arc"]) < 1e-9


def law_of_reflection():
    """One flight to each wall of a mushroom in which everything moves."""
    starts = {
        "arc": State(0.5, 0.1, 0.3, 2.0, 3.0),
        "base": State(0.5, 0.9, 0.2, 0.25, -2.0),
        "right": State(0.5, 0.1, -0.3, 3.0, 0.5),
        "left": State(0.5, 0.1, -0.3, -3.0, -0.5),
        "floor": State(0.5, 0.1, -0.3, 0.25, -3.0),
    }
    for wall, q in starts.items():
        assert proved_wall(TILTING, q, 100.0) == wall


def slow_across_periods():
    """Particles that come to a wall within thousands of periods, whose waves never are all at their least."""
    draw = random.Random(1)
    law = Fourier(mean=1.0, period=1.0, sin=(0.1, 0.02, draw.uniform(-0.02, 0.02)), cos=(0.05,))
    v, t = 10.0 ** -draw.uniform(2.5, 5.5), draw.random()
    for wall, scene, q in (
        ("floor", Stem(w=1.0, h=law), State(t, 0.25, -0.5, 0.125 * v, -v)),
        ("right", Stem(w=law, h=1.0), State(t, 0.5, -0.5, v, 0.0)),
        ("arc", Cap(r=law), State(t, 0.0, 0.5, 0.0, v)),
    ):
        assert proved_wall(scene, q, 1e9) == wall


# A floor whose highest place is well below what its amplitudes add up to.
GRAZING = Stem(w=1.0, h=Fourier(mean=1.25, omega=1.0, cos=(0.125,), sin=(0.0, 0.125)))


def ripples(mean, amplitude):
    """A law of sixteen harmonics, with a sine and a cosine each."""
    sin = tuple(amplitude * (-1) ** (k * k // 3) for k in range(16))
    return Fourier(mean=mean, omega=1.0, sin=sin, cos=tuple(amplitude * (-1) ** (k // 2) for k in range(16)))


def bounded_work():
    """A side of sixteen harmonics, approached by 1e-10 in a period over 1e10 of them: given up, and soon."""
    spent = [0]
    honest = Arithmetic.spend

    def watched(self, units):
        spent[0] += units
        assert spent[0] < MAX_WORK + 1_000
        honest(self, units)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Arithmetic, "spend", watched)
        slow = State(0.0, 0.5, -1.01, 1e-11, -1e-11)
        rough = Stem(w=ripples(1.0, 0.02), h=ripples(2.0, 0.05), slope=0.01)
        assert isinstance(reference.next_collision(rough, slow, 1e16, digits=DIGITS), Undecided)
    rests = State(0.0, 0.5, -1.01, 0.0, 0.0)
    assert isinstance(reference.next_collision(GRAZING, rests, 1e10, digits=DIGITS), reference.Horizon)


def starts_along_a_wall_that_rests():
    """Chords of a standing arc known so badly in the end that they may begin along it: given up at once.

    A constant law costs no work, so that only reasoning ends the search for a time at which f rises.
    """
    draw, n_cuts, honest = random.Random(24), [0], Isolator._split  # one path in a hundred begins so

    def watched(self, a, b):
        n_cuts[0] += 1
        assert n_cuts[0] < 500
        return honest(self, a, b)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Isolator, "_split", watched)
        for _ in range(25):
            place, speed = draw.uniform(0.1, 3.0), 10.0 ** draw.uniform(-1.0, 3.0)
            course = place + draw.choice((1.0, -1.0)) * draw.uniform(1.0, 1.5)
            vx, vy = -speed * math.cos(course), -speed * math.sin(course)
            start = State(0.0, math.cos(place), math.sin(place), vx, vy, "arc")
            n_cuts[0] = 0
            path = reference.trajectory(Cap(r=1.0), start, 40, working=draw.choice((6, 7, 8)))
            assert isinstance(path.outcome, Undecided | Rejected | None)


def waves_within_their_enclosures():
    """A law and its derivatives within intervals of all lengths, where waves cancel and elsewhere."""
    draw, arithmetic = random.Random(2), Arithmetic(DIGITS)
    fine = Arithmetic(2 * DIGITS)
    for i in range(48):
        law = sunk(1 + i % 6, 10.0 ** -draw.uniform(1.0, 8.0), draw.random())
        start, length = Fraction(draw.uniform(-2.0, 2.0)), Fraction(10.0 ** -draw.uniform(0.3, 15.0))
        whole = law_in_time(arithmetic, law, Fraction(0)).jet(arithmetic.between(start, start + length))
        for j in range(9):
            there = law_in_time(fine, law, Fraction(0)).jet(fine.dyadic(start + length * Fraction(j, 8)))
            for wide, thin in zip(whole, there, strict=True):
                assert thin in arithmetic.context.mpf(wide)


# What takes longest comes last: most faults have been found out by then.
BATTERY = (
    answers_by_hand,
    starts_where_a_wall_turns,
    law_of_reflection,
    differentiated,
    waves_within_their_enclosures,
    starts_along_a_wall_that_rests,
    slow_across_periods,
    bounded_work,
)


@pytest.mark.parametrize("check", BATTERY)
def test_the_reference_passes(check):
    check()


def test_every_step_is_proved(tally):
    n_examples = 10_000 if IS_DEEP else 60

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
    n_examples = 5_000 if IS_DEEP else 30

    @settings(max_examples=n_examples)
    @given(scenes_and_states(), st.integers(1, 6), st.sampled_from((None, 10, 25)))
    def proves(drawn, n, working):
        scene, state, t_end = drawn
        claim = prove_path(scene, state, n, t_end, working)
        tally[claim.outcome] += 1
        tally["enclosed starts"] += max(len(claim.steps) - 1, 0)

    proves()
    # Hypothesis draws constants of all our code, so any change may bring paths along the mouth to its edge:
    # these are undefined, and proved as well.
    assert tally["collision"] + tally["horizon"] + tally["undefined"] >= 0.8 * n_examples
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


STEPS |= {name: answer[:3] for name, answer in ANSWERS.items()}


@pytest.mark.parametrize("name", STEPS)
def test_rare_steps_and_answers_by_hand_are_proved(name):
    claim = prove_step(*STEPS[name])
    assert name in ANSWERS or claim.outcome in ("collision", "horizon")


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
    "a mouth that leaps": (LEAP, State(2.0**110, 0.3, 0.5, 0.02, 1.0), 2),
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


@pytest.mark.parametrize("working", [6, 8, 10, 12, 15, 30, 60])
def test_a_leap_within_an_enclosed_time_is_proved(working):
    """The mouth is open when y = 0 is crossed; with its knot within the enclosure, nothing is said."""
    claim = prove_path(*PATHS["a mouth that leaps"], working=working)
    assert [step.wall for step in claim.steps] == ["arc", "left"][: len(claim.steps)]
    assert len(claim.steps) == 2 or (working <= 15 and claim.outcome == "undecided")


def test_places_known_to_some_tenths_are_proved(tally):
    """Eight decimals are too few for twelve flights: enclosures end as wide as the table."""
    draw = random.Random(5)
    for _ in range(100 if IS_DEEP else 8):
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


@faults.replacing(Isolator, "first_root")
def skip_the_first_root(honest, self, start, end):
    root = honest(self, start, end)
    if root is None:
        return None
    for i in range(1, 65):  # from where f > 0 again
        later = self.arithmetic.middle(root.time + (end - root.time) * self.arithmetic.number(i) / 65)
        if self.value(later) > 0:
            return honest(self, later, end)
    return None


@faults.replacing(Course, "_first_hit")
def exclude_nothing(honest, self, walls, start, limit):
    """The first wall in the list that is hit at all, others not asked."""
    for wall in walls:
        found = honest(self, (wall,), start, limit)
        if found is not None:
            return found
    return None


@faults.replacing(Course, "_first_hit")
def exclude_all_but_the_floor(honest, self, walls, start, limit):
    return honest(self, tuple(wall for wall in walls if wall != "floor") or walls, start, limit)


@faults.replacing(Legs, "jet")
def piece_in_the_middle(honest, self, s):
    """Of the pieces that an enclosed time may touch, the one in its middle is believed."""
    if s.delta == 0 or s.delta > 2.0**-10:
        return honest(self, s)
    middle = honest(self, self.arithmetic.middle(s))
    return Jet(middle.f + s.delta * middle.d1, middle.d1 + s.delta * middle.d2, middle.d2)


@faults.replacing(Isolator, "__init__")
def keep_the_residual(honest, self, arithmetic, jet, begin, residual=None, **options):
    honest(self, arithmetic, jet, begin, None, **options)


@faults.replacing(Course, "_beyond_crossing")
def edge_with_the_residual(honest, self, crossing):
    leaving, self.leaving = self.leaving, {}
    try:
        return honest(self, crossing)
    finally:
        self.leaving = leaving


@faults.replacing(Course, "_beyond_crossing")
def width_at_departure(honest, self, crossing):
    self.motion.width = lambda s: MovingWalls.width(self.motion, self.arithmetic.zero if s is crossing else s)
    return honest(self, crossing)


@faults.replacing(Course, "__init__")
def with_a_later_horizon(honest, self, table, motion, leaving, is_flat, in_cap, end, exact):
    honest(self, table, motion, leaving, is_flat, in_cap, None if end is None else end + 9, exact)


@faults.replacing(Course, "_beyond_crossing")
def open_always(honest, self, crossing):
    if not self.table.is_mushroom:
        return honest(self, crossing)
    walls = SIDES if self.in_cap else ("arc",)
    return self._first_hit(walls, self.arithmetic.lower(crossing), None)


@faults.replacing(path, "reflect")
def with_the_wall_reversed(honest, course, hit):
    f_t = course.motion.gradient(hit.wall, hit.time)[2]
    return honest(course, hit._replace(slope=hit.slope - 2 * f_t))


@faults.replacing(MovingWalls, "wall")
def swapped_sides(honest, self, wall, s):
    return honest(self, {"left": "right", "right": "left"}.get(wall, wall), s)


@faults.replacing(MovingWalls, "gradient")
def level_normal(honest, self, wall, s):
    f_x, f_y, f_t = honest(self, wall, s)
    return f_x, self.arithmetic.zero if wall in ("left", "right") else f_y, f_t


@faults.replacing(MovingWalls, "law")
def still_slope(honest, self, name, s):
    jet = honest(self, name, s)
    return Jet(jet.f, self.arithmetic.zero, self.arithmetic.zero) if name == "slope" else jet


@faults.replacing(MovingWalls, "width")
def width_with_still_nu(honest, self, s):
    if "nu" not in self.table.width:
        return honest(self, s)
    nu, r = self.law("nu", s), self.law("r", s)
    return Jet(nu.f * r.f, nu.f * r.d1, self.arithmetic.zero)


@faults.replacing(walls, "square")
def square_without_second_derivative(honest, arithmetic, p):
    return Jet(arithmetic.square(p.f), 2 * (p.f * p.d1), 2 * arithmetic.square(p.d1))


@faults.replacing(MovingWalls, "hessian")
def hessian_without_time(honest, self, wall, s):
    zero = self.arithmetic.zero
    two = self.arithmetic.number(-2)
    return (two, two, zero, zero) if wall == "arc" else (zero, zero, zero, zero)


@faults.replacing(start, "_judge_on_base")
def base_without_an_end(honest, table, state, motion):
    """The arc is asked only whether the state is surely beyond it."""
    if sign(motion.wall("arc", motion.arithmetic.zero).f) < 0:
        raise InvalidState("beyond wall arc")
    return Undefined("sliding") if state.vy == 0 else None


@faults.replacing(Waves, "_powers")
def powers_of_later_times(honest, self, away):
    """As if the point of the expansion were the interval's begin."""
    later = self.arithmetic.hull(self.arithmetic.zero, away)
    return honest(self, later)


@faults.replacing(timeline.Timeline, "__init__")
def half_a_turn(honest, self, arithmetic, table, instant):
    honest(self, arithmetic, table, instant)
    self.turn = None if self.turn is None else self.turn / 2


@faults.replacing(Waves, "__init__")
def waves_without_a_remainder(honest, self, arithmetic, law, instant):
    honest(self, arithmetic, law, instant)
    self.bound = arithmetic.zero


@faults.replacing(Isolator, "_expanded")
def tangent_for_the_expansion(honest, self, whole, jet):
    """Without the second derivative's part."""
    return honest(self, whole, jet._replace(d2=self.arithmetic.zero))._replace(d2=jet.d2)


MUTANTS = {
    "waves without a remainder": waves_without_a_remainder,
    "odd powers of a negative time dropped": powers_of_later_times,
    "never reached from the first place": faults.swept_begins_alone,
    "never met in half a period": half_a_turn,
    "f by its tangent": tangent_for_the_expansion,
    "cut where nothing rises": faults.replacing(Isolator, "_require_rise")(
        lambda honest, self, a, b, cut: None
    ),
    "first root skipped": skip_the_first_root,
    "first wall in the list wins": exclude_nothing,
    "floor never asked": exclude_all_but_the_floor,
    "piece at the lower end of an enclosed time": faults.knots_unseen,
    "piece in the middle of an enclosed time": piece_in_the_middle,
    "sums of cosines are 0 by their factors alone": faults.replacing(rational, "_is_zero_sum")(
        lambda honest, factors: not factors
    ),
    "ties with the residual": faults.tie_with_the_residual,
    "mouth's edge with the residual": edge_with_the_residual,
    "met at the horizon is met": faults.hit_at_end_counts,
    "a start is on one wall at most": faults.corner_unseen,
    "a base without an end": base_without_an_end,
    "no limit to the work": faults.replacing(Arithmetic, "spend")(lambda honest, self, units: None),
    "mouth's width at departure": width_at_departure,
    "mouth always open": open_always,
    "base always closed": faults.replacing(Course, "_beyond_crossing")(
        lambda honest, self, crossing: self._base_hit(crossing)
    ),
    "residual kept": keep_the_residual,
    "wall velocity reversed in the bounce": with_the_wall_reversed,
    "half the kick": faults.replacing(path, "reflect")(
        lambda honest, course, hit: honest(course, hit._replace(slope=hit.slope / 2))
    ),
    "left and right swapped": swapped_sides,
    "normal of a slanted side level": level_normal,
    "slope's derivative dropped": still_slope,
    "product rule of nu r dropped": width_with_still_nu,
    "r r'' dropped": square_without_second_derivative,
    "second derivatives by time dropped": hessian_without_time,
    "horizon overrun": with_a_later_horizon,
}


@pytest.mark.parametrize("name", deep_among(MUTANTS, "no limit to the work"))
def test_a_mutant_is_killed(name, monkeypatch):
    """Killed by an answer that is wrong, or missing, not by a crash."""
    MUTANTS[name](monkeypatch)

    def battery():
        for check in BATTERY:
            check()

    with pytest.raises(AssertionError):
        battery()
