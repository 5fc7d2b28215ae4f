"""Hard cases 34 to 48: knots, late times, extreme numbers, symmetries, refusals.

Each test's number is the case's. Mirror images and static limits are compared bit for bit.
"""

from __future__ import annotations

import io
import json
import math
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from support.hard_cases import BOX, CIRCLE, LIFT, STATIC, collision, is_enclosed

import fast
import reference
from scene import (
    BangBang,
    Collision,
    Fourier,
    Horizon,
    InvalidScene,
    InvalidState,
    Rejected,
    State,
    from_data,
    load,
)
from scene.protocol.wire import serve
from scene.tables import laws
from scene.transforms import backwards

MIRRORED = {"left": "right", "right": "left"}


def test_34_hit_at_a_knot():
    """2 - 8 s^2 = 3/2 at s = 1/4, where the floor's acceleration changes sign."""
    found = collision(LIFT, State(0.0, 0.5, -1.5, 0.0, 0.0))
    assert found.wall == "floor"
    assert found.dt.contains(0.25)
    assert found.after.vy.contains(8.0)


def test_35_start_on_a_knot():
    """At t = 1/4 the floor begins to brake: no recollision at s = 2^-10 / 8, as the law before has it."""
    rise = 2.0**-10
    found = collision(LIFT, State(0.25, 0.0, -1.5, 0.0, 4 + rise, "floor"))
    assert found.wall == "base"
    assert found.dt.contains(Fraction(3, 2) / Fraction(4 + rise))
    before = 0.25 - 2.0**-20
    again = collision(LIFT, State(before, 0.0, 8 * before**2 - 2, 0.0, 4 + rise, "floor"))
    assert again.wall == "base"  # the knot comes before the recollision
    # Just after t = 3/4 the floor recedes ever more slowly, and a particle beside it is met again.
    assert collision(LIFT, State(0.75, 0.0, -1.5, 0.0, -4 + rise, "floor")).wall == "floor"


def test_36_knot_inside_a_flight():
    found = collision(LIFT, State(0.0, 0.0, -1.0625, 0.0, 0.0))
    with mpmath.workdps(300):
        s = mpmath.mpf(0.5) - mpmath.sqrt(mpmath.mpf(1) / 128)  # 1 + 8 (s - 1/2)^2 = 17/16
        assert is_enclosed(s, found.dt)
        assert is_enclosed(32 * (mpmath.mpf(0.5) - s), found.after.vy)


@pytest.mark.parametrize(
    "knots", [((0.0, 1.0), (1.0, 2.0)), ((0.0, 1.0), (0.5, 1.0), (0.5, 2.0), (1.0, 1.0))]
)
def test_37_jump_is_refused(knots):
    with pytest.raises(InvalidScene, match=r"knots\["):
        BangBang(knots=knots)


def test_38_late_start_keeps_full_precision_in_dt():
    """At t = 2 pi 30 the flight time is as sharp as if time began there."""
    state = State(2 * math.pi * 30, 0.1, 0.3, 10.0, 7.0)
    found = collision(load("moving-cap"), state, 200.0)
    answer = fast.next_collision(load("moving-cap"), state, 200.0)
    assert isinstance(answer, Collision)
    assert answer.dt == pytest.approx(float(found.dt), rel=8 * 2.0**-53)


@pytest.mark.parametrize("t", [2.0**24, 1e15])
def test_39_astronomical_times(t):
    """A floor of period 1 is met at sqrt(1/32) past any integer; at 1e15 the fast stepper declines."""
    state = State(t, 0.0, -1.75, 0.0, 0.0)
    proved = reference.next_collision(LIFT, state, t + 64)
    assert isinstance(proved, reference.Collision)
    with mpmath.workdps(300):
        assert is_enclosed(mpmath.sqrt(mpmath.mpf(1) / 32), proved.dt)
    if t == 1e15:
        declines(LIFT, state)
    else:
        assert collision(LIFT, state, t + 64).wall == "floor"


def test_39_astronomical_times_and_an_irrational_period():
    state = State(1e15, 0.1, 0.3, 10.0, 7.0)
    assert isinstance(reference.next_collision(load("moving-cap"), state, 1e15 + 64), reference.Collision)
    declines(load("moving-cap"), state)


def declines(scene, state):
    answer = fast.next_collision(scene, state, state.t + 64)
    assert isinstance(answer, Rejected)
    assert "state.t = 1" in answer.reason


@pytest.mark.parametrize("speed", [1e100, 1e200, 1e300])
def test_40_squares_that_overflow(speed):
    """Scaled by both: a static table has no time of its own, so that any speed is a common one there."""
    state = State(0.0, 0.0, 0.5, speed, 0.0)
    proved = reference.next_collision(CIRCLE, state, 1.0)
    assert isinstance(proved, reference.Collision)
    with mpmath.workdps(300):
        assert is_enclosed(mpmath.sqrt(mpmath.mpf(0.75)) / mpmath.mpf(speed), proved.dt)
    assert collision(CIRCLE, state, 1.0).wall == "arc"


@pytest.mark.parametrize(
    ("scene", "y", "vy"), [(BOX, -0.5, 5e-324), (BOX, -0.5, -5e-324), (STATIC, -0.5, 5e-324)]
)
def test_41_crossing_beyond_all_times(scene, y, vy):
    found = collision(scene, State(0.0, 0.0, y, 1.0, vy))
    assert found.wall == "right"
    assert found.after.vy.contains(vy)


def test_41_crossing_beyond_all_times_in_the_cap():
    found = collision(CIRCLE, State(0.0, 0.0, 0.5, 1.0, -5e-324))
    assert found.wall == "arc"


def test_42_subnormals_are_not_flushed():
    least = 5e-324
    for state in (State(0.0, 0.0, -3 * least, 0.0, 1.0), State(0.0, 0.0, -3 * least, 1.0, 1.0)):
        assert collision(BOX, state).dt.contains(3 * least)
        answer = fast.next_collision(BOX, state, 1.0)
        assert isinstance(answer, Collision)
        assert answer.dt == 3 * least
    assert collision(CIRCLE, State(0.0, 0.0, least, 0.0, -1.0)).dt.contains(least)


def bits(*numbers):
    return [(n + 0.0).hex() for n in numbers]  # + 0.0: no sign of zero


@pytest.mark.parametrize("name", ["moving-cap", "fixed-cap-clockwise", "frozen-mushroom"])
@pytest.mark.parametrize("start", [(0.1, 0.3, 10.0, 7.0), (0.1, -0.3, 1.0, -0.5), (0.0, 0.5, 1.0, 0.0)])
def test_43_mirror_to_the_bit(name, start):
    x, y, vx, vy = start
    scene, results = load(name), []
    for sign in (1.0, -1.0):
        state = State(0.0, sign * x, y, sign * vx, vy)
        for answer in (
            reference.next_collision(scene, state, 9.0, digits=20).rounded(),
            fast.next_collision(scene, state, 9.0),
        ):
            assert isinstance(answer, Collision)
            wall = answer.wall if sign > 0 else MIRRORED.get(answer.wall, answer.wall)
            numbers = bits(answer.dt, answer.t, sign * answer.x, answer.y, sign * answer.vx, answer.vy)
            results.append((wall, numbers))
    assert results[:2] == results[2:]


@pytest.mark.parametrize("state", [State(0.0, 0.0, 0.5, 0.0, -1.0), State(0.0, 0.0, 0.0, 0.0, 1.0)])
def test_43_signs_of_zero_do_not_matter(state):
    outcomes = set()
    for x in (0.0, -0.0):
        for vx in (0.0, -0.0):
            for t in (0.0, -0.0):
                start = State(t, x, state.y, vx, state.vy)
                answer = fast.next_collision(STATIC, start, 9.0)
                assert isinstance(answer, Collision)
                proved = collision(STATIC, start, 9.0).rounded()
                for found in (answer, proved):
                    outcomes.add((found.wall, *bits(found.dt, found.x, found.y, found.vx, found.vy)))
    assert len(outcomes) == 1


def still(scene):
    """The same table, with laws that move by nothing."""
    return type(scene)(
        **{n: Fourier(mean=law, omega=1.0, sin=(0.0, 0.0), cos=(0.0,)) for n, law in laws(scene).items()}
    )


@pytest.mark.parametrize("scene", [BOX, CIRCLE, STATIC])
def test_44_zero_amplitudes(scene):
    y = -0.5 if scene is BOX else 0.5
    state = State(0.0, 0.1, y, 0.7, 0.3)
    one, two = fast.trajectory(scene, state, 300), fast.trajectory(still(scene), state, 300)
    assert one.walls == two.walls
    assert one.steps.tobytes() == two.steps.tobytes()
    proved = collision(still(scene), state)
    assert proved.rounded() == collision(scene, state).rounded()


def test_44_speed_in_a_static_box():
    path = fast.trajectory(BOX, State(0.0, 0.1, -0.5, 0.7, 0.3), 10_000)
    assert set(np.abs(path.steps[:, 4])) == {0.7}
    assert set(np.abs(path.steps[:, 5])) == {0.3}


def test_44_speed_in_a_static_circle():
    """(vx, vy) are rounded at each bounce off the arc, so v is kept within rounding there."""
    path = fast.trajectory(CIRCLE, State(0.0, 0.1, 0.5, 0.7, 0.3), 10_000)
    v2 = path.steps[:, 4] ** 2 + path.steps[:, 5] ** 2
    drift = np.abs(v2 / (0.7**2 + 0.3**2) - 1.0)
    assert np.all(drift <= 8 * 2.0**-53 * np.arange(2, 10_002))


@pytest.mark.parametrize(
    ("scene", "state", "words"),
    [
        (CIRCLE, State(0.0, 0.9, 0.9, 1.0, 0.0), "arc"),
        (CIRCLE, State(0.0, 0.1, -0.1, 1.0, 0.0), "base"),
        (BOX, State(0.0, -1.5, -0.5, 1.0, 0.0), "left"),
        (LIFT, State(0.5, 0.0, -1.5, 1.0, 0.0), "floor"),
        (CIRCLE, State(0.0, 0.6, 0.8, 1.0, 0.0, "arc"), "moves into it"),
        (LIFT, State(0.25, 0.0, -1.5, 0.0, 3.75, "floor"), "moves into it"),  # the floor rises at 4
        (BOX, State(0.0, 0.1, 0.0, 1.0, 1.0, "base"), ""),
    ],
)
def test_45_start_outside_or_approaching(scene, state, words):
    for stepper in (reference, fast):
        outcome = stepper.next_collision(scene, state, 10.0)
        assert isinstance(outcome, Rejected), stepper
        assert words in outcome.reason


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("field", ["t", "x", "y", "vx", "vy"])
def test_46_no_numbers(field, number):
    numbers = {"t": 0.0, "x": 0.1, "y": 0.2, "vx": 1.0, "vy": 0.0, field: number}
    for stepper in (reference, fast):
        outcome = stepper.next_collision(CIRCLE, State(**numbers), 10.0)
        assert isinstance(outcome, Rejected)
        assert f"state.{field}" in outcome.reason
        with pytest.raises(InvalidState, match=f"state.{field}"):
            stepper.trajectory(CIRCLE, State(**numbers), 1)


@pytest.mark.parametrize(
    ("change", "words"),
    [({"vy": None}, "vy"), ({"spin": 1.0}, "spin"), ({"wall": "roof"}, "wall"), ({"x": "0"}, "x")],
)
def test_46_missing_or_extra_fields_of_a_state(change, words):
    state = {"t": 0.0, "x": 0.1, "y": 0.2, "vx": 1.0, "vy": 0.0, **change}
    if state["vy"] is None:
        del state["vy"]
    request = {"cmd": "step", "seq": 1, "scene": {"table": "cap", "r": 1.0}, "state": state, "t_end": 1.0}
    out = io.BytesIO()
    serve("fields", fast.next_collision, pytest.fail, io.BytesIO(json.dumps(request).encode()), out)
    answer = json.loads(out.getvalue())
    assert answer["outcome"] == "rejected"
    assert words in answer["reason"]


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ({"table": "cap"}, "r"),
        ({"table": "cap", "r": 1.0, "colour": 2.0}, "colour"),
        ({"table": "cap", "r": math.nan}, "r = nan"),
        ({"table": "cap", "r": {"kind": "fourier", "mean": 1.0}}, "omega"),
        ({"table": "cap", "r": {"kind": "fourier", "mean": 1.0, "omega": math.inf}}, r"r\.omega = inf"),
    ],
)
def test_46_broken_scenes(data, words):
    with pytest.raises(InvalidScene, match=words):
        from_data(data)


@pytest.mark.parametrize("name", ["moving-cap", "fixed-cap-clockwise"])
@pytest.mark.parametrize("stepper", [reference, fast])
def test_47_reversed_film(stepper, name):
    """Velocity and laws reversed, the path is retraced; a hundredfold per bounce is its sensitivity."""
    scene = load(name)
    film = backwards(scene)
    start, t_end = State(0.125, 0.1, 0.3, 10.0, 7.0), 0.625
    there = stepper.trajectory(scene, start, 99, t_end)
    end = there.outcome if stepper is fast else there.outcome.rounded()
    assert isinstance(end, Horizon)
    back = stepper.trajectory(film, State(-t_end, end.x, end.y, -end.vx, -end.vy), 99, -start.t)
    home = back.outcome if stepper is fast else back.outcome.rounded()
    assert isinstance(home, Horizon)
    walls = [p.walls if stepper is fast else [s.wall for s in p.steps] for p in (there, back)]
    assert len(walls[0]) >= 3
    assert walls[0] == walls[1][::-1]
    got = (home.x, home.y, -home.vx, -home.vy)
    assert got == pytest.approx((start.x, start.y, start.vx, start.vy), rel=1e-10, abs=1e-10)


@pytest.mark.parametrize("name", ["moving-cap", "fixed-cap-clockwise"])
def test_48_mirror_images_collide_together(name):
    scene = load(name)
    one = fast.trajectory(scene, State(0.0, 0.1, 0.3, 10.0, 7.0), 500)
    two = fast.trajectory(scene, State(0.0, -0.1, 0.3, -10.0, 7.0), 500)
    assert len(one.walls) == 500
    assert [MIRRORED.get(wall, wall) for wall in two.walls] == one.walls
    assert (two.steps * (1, 1, -1, 1, -1, 1)).tobytes() == one.steps.tobytes()
    first = reference.trajectory(scene, State(0.0, 0.1, 0.3, 10.0, 7.0), 20).steps
    second = reference.trajectory(scene, State(0.0, -0.1, 0.3, -10.0, 7.0), 20).steps
    assert [s.dt for s in first] == [s.dt for s in second]
    assert [s.after.vy for s in first] == [s.after.vy for s in second]
