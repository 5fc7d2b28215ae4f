"""The reference: proofs that hold together, honest non-answers, Jacobians and the symplectic form."""

import dataclasses
import math
import random
import re
from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from hypothesis import assume, given, settings
from mpmath import fp
from msgspec.structs import replace
from support.tables import BOX, CIRCLE, STATIC
from support.truth import IS_DEEP, centre, jacobian_error, proved_step

import fast
import reference
import reference.path
from conformance.cases.certify import measured_step
from conformance.grading.agreement import compare
from conformance.strategies import scenes_and_states
from scene import (
    BadInput,
    BangBang,
    Cap,
    Fourier,
    InvalidState,
    Mushroom,
    Rejected,
    State,
    Stem,
    Undecided,
    load,
)
from scene.laws import law_of


def hit(scene, state, t_end=100.0, digits=40):
    outcome = reference.next_collision(scene, state, t_end, digits=digits)
    assert isinstance(outcome, reference.Collision), outcome
    return outcome


def test_a_path_of_fixed_precision_ends_where_it_no_longer_tells():
    scene = load("moving-cap")
    start = State(0.1, 0.2, 0.3, 140.0, 30.0)
    few, more = (reference.trajectory(scene, start, 60, working=digits) for digits in (20, 40))
    assert 5 < len(few.steps) < len(more.steps) <= 60
    assert isinstance(few.outcome, Undecided)
    assert few.digits == 20
    assert few.steps[-1].after.x.width() > 1e6 * few.steps[0].after.x.width()
    close = 1.0 + 0.5 * math.sin(0.3) - 1e-8  # to the arc
    assert isinstance(
        reference.trajectory(scene, State(0.3, 0.0, close, 1.0, -0.5), 1, working=3).outcome, Undecided
    )
    with pytest.raises(BadInput, match="working = 0"):
        reference.trajectory(scene, start, 1, working=0)


def test_a_tie_at_an_irrational_time_stays_undecided():
    """Two moving walls that meet the particle together: no proof either way, and no guess."""
    law = Fourier(mean=1.0, omega=1.0, sin=(0.25,))
    outcome = reference.next_collision(Stem(w=law, h=law), State(0, 0.5, -0.5, 1.0, -1.0), 9.0, digits=10)
    assert isinstance(outcome, Undecided)
    assert "digits" in outcome.reason


@pytest.mark.parametrize("stepper", [reference, fast])
@pytest.mark.parametrize(
    ("scene", "state", "words"),
    [
        (STATIC, State(0, 0.6, 0.7, -1.0, 0.0, "arc"), "away from that wall"),
        (STATIC, State(0, 0.6, 0.0, 1.0, -1.0), "moves into it"),
        (STATIC, State(0, 1.0, -1e-17, -1.0, -0.1, "arc"), "beyond wall base"),
        (STATIC, State(0, 0.5, 1e-17, -1.0, -0.1, "right"), "above the stem|beyond wall base"),
        # At t = pi the radius is 1e-3: 1e-4 is not on the arc, however large r will be.
        (Cap(r=Fourier(1.0, 1.0, (0.999,))), State(math.pi, 0, 1e-4, 0, -1, "arc"), "away from that wall"),
        (
            Cap(r=Fourier(1.0, 1.0, (0.999,))),
            State(math.pi, 0, 1.000005e-3, 0, -1, "arc"),
            "beyond wall arc|away",
        ),
    ],
)
def test_bad_states_are_rejected(stepper, scene, state, words):
    """Beside those of the corpus (test_hard_cases): beyond a wall by a rounding, or on it."""
    outcome = stepper.next_collision(scene, state, 9.0)
    assert isinstance(outcome, Rejected)
    assert re.search(words, outcome.reason)
    assert "\n" not in outcome.reason


def test_trajectory_encloses_its_last_state():
    path = reference.trajectory(load("moving-cap"), State(0.0, 0.1, 0.3, 10.0, 7.0), 30, digits=30)
    finer = reference.trajectory(load("moving-cap"), State(0.0, 0.1, 0.3, 10.0, 7.0), 30, digits=50)
    assert len(path.steps) == 30
    assert path.digits < finer.digits
    assert [s.wall for s in path.steps] == [s.wall for s in finer.steps]
    last = path.steps[-1].after
    truth = finer.steps[-1].after
    for a, b in zip(last, truth, strict=True):
        assert a.lo <= b.lo <= b.hi <= a.hi
        assert a.width() < 1e-28


def test_a_path_through_the_middle_of_the_base_has_its_digits_there():
    """Its place there is 0, of which no share can be known."""
    disk = Cap(r=Fourier(mean=1.0, omega=1.0, sin=(0.25,)))
    for n in (2, 4):
        path = reference.trajectory(disk, State(0.0, 0.0, 0.0, 3.0, 7.0, "base"), n, digits=25)
        last = path.steps[-1]
        assert [step.wall for step in path.steps] == ["arc", "base"] * (n // 2)
        assert last.after.x.contains(0.0)
        assert 0 < last.after.x.width() < 1e-25 * last.dt.hi * 8


def test_threads_at_different_digits_do_not_disturb_each_other():
    def flight_time(digits):
        return hit(load("moving-cap"), State(0.0, 0.1, 0.3, 10.0, 7.0), digits=digits).dt

    alone = [flight_time(digits) for digits in (10, 80)]
    before = mpmath.mp.prec, mpmath.iv.prec
    with ThreadPoolExecutor(2) as pool:
        assert list(pool.map(flight_time, [10, 80] * 6)) == alone * 6
    assert (mpmath.mp.prec, mpmath.iv.prec) == before


@pytest.mark.parametrize(
    ("scene", "digits"), [*((CIRCLE, n) for n in (1, 308, 309, 400, 1000)), (load("moving-cap"), 10_000)]
)
def test_digits_are_what_was_asked_for(scene, digits):
    """The bound on work leaves room for ten thousand."""
    found = hit(scene, State(0.0, 0.1, 0.2, 0.3, 0.4), 50.0, digits=digits)
    assert found.dt.extent() * 10**digits <= abs(found.dt.centre())


def test_few_digits_refuse_no_start_on_its_wall():
    """Whether a place is on its wall is left open where digits are too few to tell, and not denied."""
    scene = Stem(w=1 / 3, h=1.0, slope=0.3)
    start = State(0.1, 1 / 3 - 0.3 * 0.7, -0.7, -1.0, 0.3, "right")
    paths = [reference.trajectory(scene, start, 1, working=digits) for digits in range(1, 12)]
    assert isinstance(paths[0].outcome, Undecided)
    assert [step.wall for step in paths[-1].steps] == ["left"]
    off = State(0.1, start.x * (1 - 2.0**-17), -0.7, -1.0, 0.3, "right")
    assert isinstance(reference.trajectory(scene, off, 1, working=2).outcome, Undecided)
    with pytest.raises(InvalidState, match="away from that wall"):
        reference.trajectory(scene, off, 1, working=12)


def many_harmonics(seed):
    """Draw a slow particle in a stem or a mushroom with 8 to 16 harmonics of .05, half the mean at most."""
    draw = random.Random(seed)
    n = draw.randint(8, 16)

    def ripples(mean):
        amplitude = min(0.05, mean / 2 / n)
        factors = [amplitude * draw.choice((-1, 1)) for _ in range(n)]
        angles = [draw.choice((0.0, draw.uniform(0, 6))) for _ in range(n)]
        cos, sin = ([a * f(x) for a, x in zip(factors, angles, strict=True)] for f in (math.cos, math.sin))
        return Fourier(mean=mean, omega=1.0, cos=tuple(cos), sin=tuple(sin))

    w = ripples(0.5) if seed % 2 else 0.5
    h = ripples(draw.uniform(1.0, 2.5))
    slope = draw.choice((0.0, 0.05))
    scene = Mushroom(r=1.5, w=w, h=h, slope=slope) if seed % 3 == 0 else Stem(w=w, h=h, slope=slope)
    speed = draw.choice((0.0, 10 ** draw.uniform(-4, -2)))
    angle = draw.uniform(0, 6)
    y = -draw.uniform(0.02, 0.7) * h.mean
    return scene, State(0.5, draw.uniform(-0.2, 0.2), y, speed * math.cos(angle), speed * math.sin(angle))


# At rest, and met by sixteen harmonics within half a period.
RIPPLED = Stem(w=0.5, h=Fourier(1.5, 1.0, cos=tuple(0.05 * (-1) ** k for k in range(16))))
NEAR_HITS = [(RIPPLED, State(0.3, 0.0, -0.71, 0.0, 0.0)), *map(many_harmonics, range(200 if IS_DEEP else 5))]


@pytest.mark.parametrize(("scene", "state"), NEAR_HITS)
def test_a_far_horizon_costs_no_near_hit(scene, state):
    """What is met within ten periods is found, and found again with any horizon."""
    near, *later = (reference.next_collision(scene, state, t_end) for t_end in (63.0, 1e2, 1e4, 1e7))
    assert isinstance(near, reference.Collision) or (scene != RIPPLED and isinstance(near, reference.Horizon))
    for found in later if isinstance(near, reference.Collision) else ():
        assert found.wall == near.wall
        assert found.dt.lo <= near.dt.hi
        assert near.dt.lo <= found.dt.hi


SLOW_FLOORS = (
    BangBang(knots=((0.0, 1.0), (0.5, 1.0 + 2.0**-30), (1.0, 1.0))),
    Fourier(mean=1.0, period=1.0, cos=(2.0**-30,)),
)


@pytest.mark.parametrize("floor", SLOW_FLOORS, ids=["bang-bang", "fourier"])
@pytest.mark.parametrize("end", [1.0, 4.0, 16.0])
@pytest.mark.parametrize("beyond", [-(2.0**-11), 0.0, 2.0**-40, 2.0**-11, 2.0**-10, 3 * 2.0**-11, 2.0**-8])
def test_a_hit_near_the_end_of_a_search_is_found(floor, end, beyond):
    """A search looks a little farther than it ends; what it finds there is known to the next one."""
    width = end * (1.0 + beyond)
    scene = Stem(w=width, h=floor)
    state = State(0.0, 0.0, -0.5, 1.0, 0.0)
    found = hit(scene, state, 1000.0)
    assert found.wall == "right"
    assert found.dt.contains(width)
    assert isinstance(reference.next_collision(scene, state, width), reference.Horizon)


@pytest.mark.parametrize(("slowness", "later"), [(12, 2), (20, 16), (28, 1024)])
def test_a_wall_met_just_after_the_end_of_a_search_is_not_forgotten(slowness, later):
    """The left side comes just after a period. The floor comes later still: its enclosure holds both."""
    state = State(
        0.0,
        0.0,
        -1.0 + 2.0**-slowness,
        -(1.0 - 4 * 2.0**-52),
        -(2.0**-slowness) * (1.0 - (4 + later) * 2.0**-52),
    )
    for digits in (1, 2, 3, 40):
        assert hit(Stem(w=1.0, h=SLOW_FLOORS[0]), state, digits=digits).wall == "left"


def test_what_another_wall_does_after_a_hit_leaves_the_hit_decided():
    """The right side leaves the particle, and touches it again a period later; the floor is met before."""
    scene = Stem(w=Fourier(mean=0.5, period=1.0, cos=(-0.075,)), h=1.0)
    state = State(0.0, 0.425, -0.75, 0.0, -1.0, "right")
    near, far = (hit(scene, state, t_end) for t_end in (0.5, 1e6))
    assert near.wall == far.wall == "floor"
    assert far.dt.contains(0.25)
    slow = replace(state, vy=-0.0001)
    assert isinstance(reference.next_collision(scene, slow, 1e6), Undecided)


MARGINS = {
    # From the middle with v = (1, 1/4): right at s = 1, base at s = 2, 1/4 below it.
    "a box": (
        BOX,
        State(0, 0.0, -0.5, 1.0, 0.25),
        {"gap": Fraction(1), "corner": Fraction(1, 4), "slope": Fraction(1)},
    ),
    # Along y the sides are never met, and the base lies behind.
    "alone in sight": (BOX, State(0, 0.25, -0.5, 0.0, -1.0), {"gap": None, "corner": 0.75}),
    "the sides of a mushroom ignore the arc": (
        STATIC,
        State(0, 0.0, -0.5, 1.0, 0.0),
        {"corner": 0.5},
    ),
}


def margins_of(scene, state):
    return reference.next_collision(scene, state, 100.0, digits=30, is_measured=True).margins


@pytest.mark.parametrize("name", MARGINS)
def test_margins_by_hand(name):
    """Gap to the wall met next, distance to the nearest corner, speed of approach."""
    scene, state, expected = MARGINS[name]
    found = margins_of(scene, state)
    for field, number in expected.items():
        margin = getattr(found, field)
        if number is None:
            assert margin is None
        else:
            assert margin.contains(number)
            assert margin.extent() < 1e-25


@pytest.mark.parametrize("near", [1e-3, 1e-9])
def test_margins_near_the_corner_of_arc_and_base(near):
    """Falling steeply beside the corner: the base is met, then at once the arc."""
    found = margins_of(CIRCLE, State(0, 0.5, 0.5, 0.5, -0.5 - near))
    assert float(found.corner) == pytest.approx(near, rel=0.02)
    assert 0 < float(found.gap) < 5 * near


FROM_THE_CAP = State(0.3, 0.1, 0.2, 3.0, 4.0)


def presymplectic(vx, vy):
    """Return dx ^ dvx + dy ^ dvy - dt ^ d(v^2/2) as a matrix over (t, x, y, vx, vy)."""
    form = np.full((5, 5), Fraction(0))
    form[1, 3] = form[2, 4] = Fraction(1)
    form[0, 3:] = -vx, -vy
    return form - form.T


def is_kept(jacobian, start, end, tolerance):
    """Tell whether the map with this Jacobian keeps the form, to a share of its terms."""
    before = (Fraction(start.vx), Fraction(start.vy))
    after = (centre(end.vx), centre(end.vy))
    form = jacobian.T @ presymplectic(*after) @ jacobian
    size = max(1, *abs(jacobian).flat) ** 2 * (1 + max(map(abs, after)))
    return (abs(form - presymplectic(*before)) <= tolerance * size).all()


def differentiated(scene, start, n, t_end=100.0):
    """Return a path's Jacobian as exact centres, and its last state; None without a collision."""
    try:
        path = reference.trajectory(scene, start, n, t_end, digits=40, is_differentiated=True)
    except InvalidState:  # off its wall by a rounding
        return None
    if not path.steps:
        return None
    return np.array([[centre(d) for d in row] for row in path.jacobian]), path.steps[-1].after


@settings(max_examples=60)
@given(scenes_and_states())
def test_step_keeps_the_symplectic_form(drawn):
    """In free flight starts (no residual) the step is symplectic in (x, y, vx, vy, t, E)."""
    scene, state, t_end = drawn
    free = replace(state, wall=None)
    found = differentiated(scene, free, 1, t_end)
    assume(found)  # Hypothesis refuses a test whose examples are nearly all left out
    jacobian, end = found
    assert is_kept(jacobian, free, end, Fraction(1, 10**25))


@pytest.mark.parametrize("scale", [Fraction(1001, 1000), Fraction(-1)])
@pytest.mark.parametrize("row", [0, 3, 4])
def test_a_spoilt_jacobian_does_not(row, scale):
    rows, end = differentiated(load("moving-cap"), FROM_THE_CAP, 1)
    rows[row] *= scale
    assert not is_kept(rows, FROM_THE_CAP, end, Fraction(1, 10**25))


@pytest.mark.parametrize(
    ("start", "walls"),
    [(FROM_THE_CAP, ["arc", "floor", "arc", "arc", "base"]), (State(0.3, 0.1, -0.2, 10.0, -27.0), ["floor"])],
)
def test_jacobian_against_differences(start, walls):
    assert jacobian_error(load("moving-cap"), start, walls) < 1e-9


def hops(rng):
    """Return a cap and a start on its arc, residual and all, from which the arc is met again and again."""
    r = Fourier(mean=1.0, omega=1.0, cos=(rng.choice((0.0, 0.1)),)) if rng.random() < 0.5 else 1.0
    t = rng.uniform(-3.0, 3.0)
    angle = rng.uniform(0.05, 0.2)
    lift = rng.uniform(0.02, 0.1)
    now = float(law_of(r).value(fp, t))
    off = 1.0 + rng.uniform(-1.0, 1.0) * 2.0**-24
    x, y = now * off * math.cos(angle), now * off * math.sin(angle)
    return Cap(r=r), State(t, x, y, -4.0 * math.sin(angle + lift), 4.0 * math.cos(angle + lift), "arc")


def test_a_wall_met_again_and_again_keeps_a_residual_that_moves_with_the_first_start():
    """On the second hop, too, the residual is f(0) of the start: held fixed, the chain would be wrong."""
    rng = random.Random(7)
    for n in (1, 2, 2, 3):
        assert jacobian_error(*hops(rng), ["arc"] * n) < 1e-9


def test_a_residual_held_fixed_after_the_first_hop_is_found_out(monkeypatch):
    honest = reference.path.step_jacobian

    def fixed(course, hit):
        leaving = course.leaving if course.flight.begin == 0 else {}
        return honest(dataclasses.replace(course, leaving=leaving), hit)

    monkeypatch.setattr(reference.path, "step_jacobian", fixed)
    rng = random.Random(7)
    assert jacobian_error(*hops(rng), ["arc"]) < 1e-9
    assert jacobian_error(*hops(rng), ["arc", "arc"]) > 1e-3


def test_condition_number_of_a_grazing_hit():
    """A graze with v_n / v = e has derivatives of order 1/e: the measure stays fair."""
    scene = load("frozen-mushroom")
    state = State(0.0, 0.0, 1.0 - 2.0**-30, 1.0, 0.0)
    found = reference.next_collision(scene, state, 10.0, is_differentiated=True)
    largest = max(abs(float(d)) for row in found.jacobian for d in row)
    assert 1e3 < largest < 1e6
    truth = proved_step(scene, state, 10.0)
    assert compare(fast.next_collision(scene, state, 10.0), truth, state, 16.0).verdict == "pass"
    # dt is sqrt(2) 2^-15, its derivative by y 2^15 / sqrt(2).
    assert 1e7 < measured_step(scene, state, 10.0).condition < 1e10


def test_condition_number_of_a_head_on_hit():
    """Along a radius from the centre: dt = 1/v and v' = -v have condition 1."""
    state = State(0.0, 0.0, 0.0, 0.0, 2.0)
    assert measured_step(Cap(r=1.0), state, 10.0).condition == 1.0


@pytest.mark.parametrize("time", [1.0, 0.5], ids=["at a knot", "in the middle of a leg"])
def test_at_a_knot_the_sensitivity_is_that_of_the_steeper_side(time):
    """Starts that differ by single roundings meet the wall on either side of a jump of its acceleration."""
    law = BangBang(((0.0, 1.0), (1.0, 0.6), (1.5, 0.85), (4.0, 1.0)))
    begin = time - 0.75
    v = 0.9
    x = v * (time - begin) - float(law_of(law).value(fp, time))
    starts = [State(begin + k * math.ulp(begin), x, -0.5, -v, 0.01) for k in range(-3, 4)]
    found = [proved_step(Mushroom(r=2.0, h=2.0, w=law, slope=0.0), s, 10.0).steps[0] for s in starts]
    times = [Fraction(s.t) + step.centre("dt") for s, step in zip(starts, found, strict=True)]
    assert {step.wall for step in found} == {"left"}
    assert min(times) < time < max(times)
    steepness = [step.allowance[3] for step in found]
    assert min(steepness) > 0.999 * max(steepness)
