"""The corpus's hard cases that are followed or compared with each other, and those that no vector can ask.

Scenes and states are the corpus's, by number and index of the case; static limits are compared bit for bit.
That mirror images (cases 43 and 48) are mirrored to the bit is held by test_fast_bits.py and
test_conformance_properties.py for drawn questions.
"""

from __future__ import annotations

import io
import json
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from support.hard_cases import case, is_enclosed, scene_of

import fast
import reference
from scene import Collision, Horizon, State, Undecided
from scene.protocol.wire import MAX_COLLISIONS, serve


def proved_path(name, n):
    return reference.trajectory(scene_of(name), case(name).state, n)


def fast_path(name, n, **options):
    return fast.trajectory(scene_of(name), case(name).state, n, **options)


def walls_of(path):
    return path.walls if hasattr(path, "walls") else [step.wall for step in path.steps]


def test_02_whispering_gallery():
    """All chords are alike: no ghost hit at s = 0 in 10^4 bounces, nor in 100 proved ones."""
    s = case("02/2").state
    x, y, vx, vy = (Fraction(n) for n in (s.x, s.y, s.vx, s.vy))
    chord = -2 * (x * vx + y * vy) / (vx * vx + vy * vy)
    proved = proved_path("02/2", 100)
    assert walls_of(proved) == ["arc"] * 100
    assert all(step.dt.contains(chord) for step in proved.steps)
    path = fast_path("02/2", 10_000)
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


def test_10_train_of_bounces():
    """In the floor's frame a particle under constant gravity: all flights last rise / 8."""
    proved, path = proved_path("10/2", 100), fast_path("10/2", 200)
    assert walls_of(proved) == ["floor"] * 100
    assert all(step.dt.contains(Fraction(1, 1024)) for step in proved.steps)
    assert path.walls == ["floor"] * 200
    assert path.steps[:, 0] == pytest.approx(2.0**-10, rel=1e-10)


def test_10_a_limit_on_collisions_ends_in_a_clear_error():
    path = fast.trajectory(scene_of("10/2"), State(0.0, 0.0, -2.0, 0.0, 2.0**-20, "floor"), 1000, t_end=0.2)
    assert len(path.walls) == 1000
    assert path.outcome is None  # as many as asked for, the horizon not reached
    state = {"t": 0.0, "x": 0.0, "y": -0.5, "vx": 1.0, "vy": 0.0}
    request = {"cmd": "trajectory", "seq": 1, "scene": {"table": "stem", "w": 1.0, "h": 1.0}, "state": state}
    line, out = json.dumps({**request, "collisions": MAX_COLLISIONS + 1, "t_end": 1.0}), io.BytesIO()
    serve("s", pytest.fail, pytest.fail, io.BytesIO(line.encode()), out)
    answer = json.loads(out.getvalue())
    assert answer["outcome"] == "rejected"
    assert "collisions = 1000001" in answer["reason"]


def test_17_level_flight_bounces_for_ever():
    walls = ["right", "left"] * 500
    path, proved = fast_path("17/1", 1000), proved_path("17/1", 50)
    assert path.walls == walls
    assert np.array_equal(path.steps[:, 0], [0.75] + [2.0] * 999)
    assert set(path.steps[:, 3]) == {-0.5}
    assert walls_of(proved) == walls[:50]
    assert all(step.dt.contains(2.0) and step.after.y.contains(-0.5) for step in proved.steps[1:])


def test_17_until_the_moving_floor_ends_it():
    """Sides at 1/64 + k/32; the floor at sqrt(1/32) = 0.1767...: after six of them."""
    proved = proved_path("17/2", 7)
    assert walls_of(proved) == fast_path("17/2", 7).walls == ["right", "left"] * 3 + ["floor"]
    with mpmath.workdps(300):
        assert is_enclosed(mpmath.sqrt(mpmath.mpf(1) / 32), proved.steps[-1].after.t)


def test_19_nearly_level_flight_keeps_its_vertical_velocity():
    path = fast_path("19/1", 1_000_001)
    assert len(path.walls) == 1_000_001
    assert set(path.walls) == {"left", "right"}
    assert np.all(path.steps[:, 5] == 2.0**-22)
    after = [step.after for step in proved_path("19/1", 60).steps]
    assert all(a.vy.contains(2.0**-22) and a.vy.width() == 0 for a in after)


@pytest.mark.parametrize("name", ["30/4", "30/6", "30/8"])
def test_30_two_hits_beside_a_corner(name):
    """Right first, then the floor 2 gap later; the fast stepper may be undecided at 2^-50."""
    gap = case(name).state.x - 0.5
    proved, path = proved_path(name, 2), fast_path(name, 2)
    assert walls_of(proved) == ["right", "floor"]
    assert proved.steps[1].dt.contains(2 * gap)
    if gap < 2.0**-48 and isinstance(path.outcome, Undecided):
        return
    assert path.walls == ["right", "floor"]
    assert path.steps[1, 0] == pytest.approx(2 * gap, abs=4 * 2.0**-53)


def bits(answer):
    numbers = answer.dt, answer.t, answer.x, answer.y, answer.vx, answer.vy
    return [(n + 0.0).hex() for n in numbers]  # + 0.0: no sign of zero


@pytest.mark.parametrize("state", [State(0.0, 0.0, 0.5, 0.0, -1.0), State(0.0, 0.0, 0.0, 0.0, 1.0)])
def test_43_signs_of_zero_do_not_matter(state):
    scene, outcomes = scene_of("43/19"), set()
    for x in (0.0, -0.0):
        for vx in (0.0, -0.0):
            for t in (0.0, -0.0):
                start = State(t, x, state.y, vx, state.vy)
                answer = fast.next_collision(scene, start, 9.0)
                assert isinstance(answer, Collision)
                for found in (answer, reference.next_collision(scene, start, 9.0).rounded()):
                    outcomes.add((found.wall, *bits(found)))
    assert len(outcomes) == 1


@pytest.mark.parametrize("index", [1, 3, 5])
def test_44_laws_that_move_by_nothing_stand_still(index):
    names = f"44/{index}", f"44/{index + 1}"
    one, two = (fast_path(name, 300) for name in names)
    assert one.walls == two.walls
    assert one.steps.tobytes() == two.steps.tobytes()
    first, second = (proved_path(name, 1).steps[0].rounded() for name in names)
    assert first == second


def test_44_speed_in_a_static_box():
    path = fast_path("44/1", 10_000)
    assert set(np.abs(path.steps[:, 4])) == {0.7}
    assert set(np.abs(path.steps[:, 5])) == {0.3}


def test_44_speed_in_a_static_circle():
    """(vx, vy) are rounded at each bounce off the arc, so v is kept within rounding there."""
    path = fast_path("44/3", 10_000)
    v2 = path.steps[:, 4] ** 2 + path.steps[:, 5] ** 2
    drift = np.abs(v2 / (0.7**2 + 0.3**2) - 1.0)
    assert np.all(drift <= 8 * 2.0**-53 * np.arange(2, 10_002))


@pytest.mark.parametrize(("forwards", "backwards"), [("47/1", "47/2"), ("47/3", "47/4")])
@pytest.mark.parametrize("stepper", [reference, fast])
def test_47_reversed_film(stepper, forwards, backwards):
    """Velocity and laws reversed, the path is retraced; a hundredfold per bounce is its sensitivity."""
    scene, film, start = scene_of(forwards), scene_of(backwards), case(forwards).state
    t_end = case(forwards).t_end
    there = stepper.trajectory(scene, start, 99, t_end)
    end = there.outcome if stepper is fast else there.outcome.rounded()
    assert isinstance(end, Horizon)
    back = stepper.trajectory(film, State(-t_end, end.x, end.y, -end.vx, -end.vy), 99, -start.t)
    home = back.outcome if stepper is fast else back.outcome.rounded()
    assert isinstance(home, Horizon)
    assert len(walls_of(there)) >= 3
    assert walls_of(there) == walls_of(back)[::-1]
    got = (home.x, home.y, -home.vx, -home.vy)
    assert got == pytest.approx((start.x, start.y, start.vx, start.vy), rel=1e-10, abs=1e-10)
