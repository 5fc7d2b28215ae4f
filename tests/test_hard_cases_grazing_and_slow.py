"""Hard cases 1 to 16: grazing flights, and slow particles before fast walls.

Each test's number is the case's. The answers are closed forms: chords of a circle, quadratics
before a floor under constant acceleration, or roots bracketed by hand.
"""

from __future__ import annotations

import io
import json
from fractions import Fraction

import mpmath
import pytest
from support.hard_cases import CIRCLE, LIFT, collision, in_both, is_enclosed

import fast
import reference
from scene import BangBang, Cap, Fourier, Horizon, State, Stem, Undecided, Undefined
from scene.protocol.wire import MAX_COLLISIONS, serve


@pytest.fixture(autouse=True)
def three_hundred_digits():
    with mpmath.workdps(300):
        yield


def root(a, b, c, sign=1):
    """(-b + sign sqrt(b^2 - 4 a c)) / (2 a), exact inputs, 300 digits."""
    a, b, c = (mpmath.mpf(n) for n in (a, b, c))
    return (-b + sign * mpmath.sqrt(b * b - 4 * a * c)) / (2 * a)


def inward(tangential, normal):
    """A state on the unit circle at (0.6, 0.8), velocity by its tangential and inward parts."""
    vx, vy = -0.8 * tangential - 0.6 * normal, 0.6 * tangential - 0.8 * normal
    return State(0.0, 0.6, 0.8, vx, vy, "arc")


def test_01_arc_graze():
    """Leaving the arc at v_n / v = 1e-8, the chord takes s = -2 q.v / v^2, exactly."""
    s = inward(1.0, 1e-8)
    x, y, vx, vy = (Fraction(n) for n in (s.x, s.y, s.vx, s.vy))
    found = collision(CIRCLE, s)
    assert found.wall == "arc"
    assert found.dt.contains(-2 * (x * vx + y * vy) / (vx * vx + vy * vy))


@pytest.mark.parametrize("height", [2.0**-40, 2.0**-46, 2.0**-53])
def test_01_arc_graze_from_the_middle_of_a_chord(height):
    """Half a chord is sqrt(1 - y^2); at 1 - 2^-53 the particle is on the arc within rounding."""
    y = 1 - height
    found = collision(CIRCLE, State(0.0, 0.0, y, 1.0, 0.0), may_be_undecided=height < 2.0**-50)
    assert is_enclosed(mpmath.sqrt(1 - mpmath.mpf(y) ** 2), found.dt)


def test_02_whispering_gallery():
    """All chords are alike: no ghost hit at s = 0 in 10^4 bounces, nor in 100 proved ones."""
    s = inward(1.0, 1e-3)
    x, y, vx, vy = (Fraction(n) for n in (s.x, s.y, s.vx, s.vy))
    chord = -2 * (x * vx + y * vy) / (vx * vx + vy * vy)
    proved = reference.trajectory(CIRCLE, s, 100)
    assert [step.wall for step in proved.steps] == ["arc"] * 100
    assert all(step.dt.contains(chord) for step in proved.steps)
    path = fast.trajectory(CIRCLE, s, 10_000)
    assert path.outcome is None
    chords, passages, taken = 0, 0, 0.0
    for wall, dt in zip(path.walls, path.steps[:, 0], strict=True):
        taken += dt  # the base, in the unfolded disk, cuts a chord in two
        if wall == "base":
            passages += 1
            continue
        # A few roundings of v at each bounce turn it by 2^-53 beside its angle 1e-3. The place is
        # rounded there, too: by up to 1.5 x 2^-53 in f, which the next chord keeps, for the root at 0
        # is divided out. After the base nothing is, and what has gathered moves the root, by
        # f / 2e-3 beside a chord of 2e-3.
        bound = 2.0**-53 * (4e3 * (chords + 1) + (8e6 + 4e5 * chords) * passages)
        assert taken == pytest.approx(float(chord), rel=bound)
        chords, taken = chords + 1, 0.0
    assert 10_000 - chords == pytest.approx(10_000 * 2e-3 / mpmath.pi, abs=1)


@pytest.mark.parametrize("rate", [0.25, -0.25])
def test_03_gallery_with_a_moving_arc(rate):
    """The full moving f: a root of r(s)^2 = |q + v s|^2, far from the static chord's."""
    scene = Cap(r=Fourier(mean=1.0, omega=1.0, sin=(rate,)))
    s = inward(1.0, 2.0**-6 - rate)  # leaves the moving arc at relative speed 2^-6
    found = collision(scene, s)
    assert found.wall == "arc"

    def f(time):
        r, q_v = 1 + mpmath.mpf(rate) * mpmath.sin(time), mpmath.mpf(s.x) * s.vx + mpmath.mpf(s.y) * s.vy
        v2 = mpmath.mpf(s.vx) ** 2 + mpmath.mpf(s.vy) ** 2
        return r * r - 1 - 2 * q_v * time - v2 * time * time

    assert f(found.dt.lo) > 0 > f(found.dt.hi)
    assert all(f(found.dt.lo * i / 200) > 0 for i in range(1, 200))
    static = 2 * (2.0**-6 - rate)
    assert abs(float(found.dt) - static) > 1e-3


@pytest.mark.parametrize("least", [1e-12, 1e-14, 1e-16, 1e-30, 1e-100, 1e-300])
def test_04_near_miss(least):
    """A floor that stops `least` below a resting particle; the fast one may be undecided below 1e-13."""
    bottom = min(1.0, least * 2.0**20)  # so that y = least - bottom is within 2^-33 of exact
    scene = Stem(w=1.0, h=BangBang(knots=((0.0, 2.0), (0.5, bottom), (1.0, 2.0))))
    s = State(0.0, 0.0, least - bottom, 0.0, 0.0)
    assert 0 < Fraction(bottom) + Fraction(s.y) < 2 * Fraction(least)
    assert isinstance(in_both(scene, s, 0.9, may_be_undecided=least < 1e-13), reference.Horizon)


def test_05_touch_from_outside_the_path_is_no_event():
    """F = 8 s^2 from the start on: the floor turns under the particle and leaves it, no kick."""
    found = in_both(LIFT, State(0.5, 0.0, -1.0, 0.0, 0.0, "floor"), 1.25, may_be_undecided=True)
    assert isinstance(found, reference.Horizon)


def test_05_touch_in_flight_is_no_event_or_undecided():
    s = State(0.0, 0.0, -1.0, 0.0, 0.0)
    for stepper in (reference, fast):
        outcome = stepper.next_collision(LIFT, s, 0.75)
        assert isinstance(outcome, Undecided | Horizon | reference.Horizon)


def test_06_wall_pushes_a_co_moving_particle():
    """F = -8 s^2: sliding. The fast stepper may be undecided: f' = 0 is within rounding."""
    found = in_both(LIFT, State(0.0, 0.0, -2.0, 0.0, 0.0, "floor"), may_be_undecided=True)
    assert found == Undefined("sliding")


def test_07_triple_root():
    """H = 2 + (2 sin t - sin 2t) / 4 is 2 + t^3 / 4 + ...; the fast stepper may be undecided."""
    scene = Stem(w=1.0, h=Fourier(mean=2.0, omega=1.0, sin=(0.5, -0.25)))
    found = in_both(scene, State(0.0, 0.0, -2.0, 0.0, 0.0, "floor"), may_be_undecided=True)
    assert isinstance(found, Undefined)


def test_08_wall_overtakes():
    """Gate on f', never on v: vy = 1/2 > 0 and the floor is faster."""
    s = State(0.0, 0.0, -1.9, 0.0, 0.5)
    found = collision(LIFT, s)
    assert found.wall == "floor"
    time = root(-8, s.vy, mpmath.mpf(2) + mpmath.mpf(s.y), -1)
    assert is_enclosed(time, found.dt)
    assert is_enclosed(32 * time - mpmath.mpf(s.vy), found.after.vy)


@pytest.mark.parametrize("rise", [1e-3, 1e-9, 1e-12, 1e-15, 1e-30, 1e-100])
def test_09_recollision_at_vanishing_times(rise):
    found = collision(LIFT, State(0.0, 0.0, -2.0, 0.0, rise, "floor"))
    assert found.wall == "floor"
    assert found.dt.contains(Fraction(rise) / 8)


def test_10_train_of_bounces():
    """In the floor's frame a particle under constant gravity: all flights last rise / 8."""
    s = State(0.0, 0.0, -2.0, 0.0, 2.0**-7, "floor")
    proved = reference.trajectory(LIFT, s, 100)
    assert [step.wall for step in proved.steps] == ["floor"] * 100
    assert all(step.dt.contains(Fraction(1, 1024)) for step in proved.steps)
    path = fast.trajectory(LIFT, s, 200)
    assert path.walls == ["floor"] * 200
    assert path.steps[:, 0] == pytest.approx(2.0**-10, rel=1e-10)


def test_10_a_limit_on_collisions_ends_in_a_clear_error():
    s = State(0.0, 0.0, -2.0, 0.0, 2.0**-20, "floor")
    path = fast.trajectory(LIFT, s, 1000, t_end=0.2)
    assert len(path.walls) == 1000
    assert path.outcome is None  # as many as asked for, the horizon not reached
    request = {
        "cmd": "trajectory",
        "seq": 1,
        "scene": {"table": "stem", "w": 1.0, "h": 1.0},
        "state": {"t": 0.0, "x": 0.0, "y": -0.5, "vx": 1.0, "vy": 0.0},
        "collisions": MAX_COLLISIONS + 1,
        "t_end": 1.0,
    }
    out = io.BytesIO()
    never = pytest.fail
    serve("limit", never, never, io.BytesIO(json.dumps(request).encode()), out)
    answer = json.loads(out.getvalue())
    assert answer["outcome"] == "rejected"
    assert "collisions = 1000001" in answer["reason"]


@pytest.mark.parametrize("wall", [None, "floor"])
def test_11_receding_wall_is_met_when_it_comes_back(wall):
    """The floor outruns the particle, turns at t = 1, and is met where 1 + 8 u^2 equals its depth."""
    # From the floor at t = 0.625 (depth 1.125, receding at 2), or from above it at t = 0.5.
    s = State(0.625, 0.0, -1.125, 0.0, -0.25, wall) if wall else State(0.5, 0.0, -0.75, 0.0, -0.5)
    found = collision(LIFT, s)
    depth = -mpmath.mpf(s.y) - mpmath.mpf(s.vy) * (mpmath.mpf(1.5) - s.t)  # at t = 3/2
    u = root(8, mpmath.mpf(s.vy), 1 - depth, -1)
    assert -0.25 < u < 0
    assert found.wall == "floor"
    assert is_enclosed(mpmath.mpf(1.5) - s.t + u, found.dt)


@pytest.mark.parametrize("bits", [10, 30, 50])
def test_12_velocity_after_the_hit_cancels(bits):
    """V' = 2 u - v with u = -16 s and v near -4 at s near 1/8: what is left is near 0."""
    s = State(0.5, 0.0, -0.625, 0.0, -4 - 2.0**-bits)
    found = collision(LIFT, s)
    time = root(8, s.vy, 0.375, -1)
    assert is_enclosed(time, found.dt)
    assert is_enclosed(-32 * time - mpmath.mpf(s.vy), found.after.vy)
    assert abs(float(found.after.vy)) < 16 * 2.0**-bits


def test_13_at_rest_and_swept():
    found = collision(LIFT, State(0.0, 0.5, -1.75, 0.0, 0.0))
    assert found.wall == "floor"
    assert is_enclosed(mpmath.sqrt(mpmath.mpf(1) / 32), found.dt)


def test_14_at_rest_and_never_swept():
    found = in_both(LIFT, State(0.0, 0.5, -0.5, 0.0, 0.0), 50.0)
    assert isinstance(found, reference.Horizon)
    assert found.at.t.contains(50.0)
    assert found.at.y.contains(-0.5)


def test_15_first_of_many_roots():
    """F = 1/2 - s / 100 + cos(16 s) / 10 turns negative first in the dip whose least value does."""
    scene = Stem(w=1.0, h=Fourier(mean=2.0, omega=1.0, cos=(0.0,) * 15 + (0.125,)))
    s = State(0.0, 0.0, -1.5, 0.0, -(2.0**-7))

    def f(time):
        return mpmath.mpf(0.5) - time / 128 + mpmath.cos(16 * time) / 8

    def dip(k):  # where f' = -1/128 - 2 sin(16 s) = 0 and f'' > 0
        return ((2 * k + 1) * mpmath.pi + mpmath.asin(mpmath.mpf(1) / 256)) / 16

    first = next(k for k in range(10_000) if f(dip(k)) < 0)
    assert first > 50
    lower, upper = dip(first) - mpmath.pi / 16, dip(first)
    for _ in range(1000):
        middle = (lower + upper) / 2
        lower, upper = (middle, upper) if f(middle) > 0 else (lower, middle)
    found = collision(scene, s)
    assert found.wall == "floor"
    assert is_enclosed(lower, found.dt)


@pytest.mark.parametrize("speed", [1e12, 1e-12])
def test_16_speeds_far_apart(speed):
    s = State(0.0, 0.0, -1.9, 0.0, -speed)
    found = collision(LIFT, s)
    time = root(-8, s.vy, mpmath.mpf(2) + mpmath.mpf(s.y), -1)
    assert is_enclosed(time, found.dt)
    assert is_enclosed(32 * time - mpmath.mpf(s.vy), found.after.vy)
