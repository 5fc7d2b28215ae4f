"""The first collision is the same however far a step may look beyond it."""

from __future__ import annotations

import numpy as np
import pytest

import fast
from fast import __main__ as served
from scene import BangBang, Cap, Collision, Fourier, Mushroom, State, Stem, Undecided

# Sides that lean, now more and now less. What bounds them for all time bounds them above the floor alone.
WAVING = Mushroom(r=1.0, h=1.0, nu=Fourier(0.6, 1.0, (-0.3,)), slope=Fourier(0.1, 1.0, (0.05,)))
TILTING = Mushroom(
    r=1.0,
    h=BangBang(knots=((0.0, 1.0), (3.0, 1.5), (6.0, 1.0))),
    w=BangBang(knots=((0.0, 0.7), (2.0, 0.4), (6.0, 0.7))),
    slope=BangBang(knots=((0.0, 0.0), (2.0, 0.2), (4.0, -0.2), (6.0, 0.0))),
)
# A slow flight to the floor. Below it, had there been none, it would have met the left side later.
MISSED = State(
    19.567471529586616,
    0.3255672736818292,
    -0.35216875914665585,
    -0.08157687079110951,
    -0.15007099796621198,
    "right",
)


def slow_starts(random, n):
    """Draw states in the stem, slow beside the walls, most on their way down."""
    for _ in range(n):
        t, x, y, vx, vy = random.uniform((0.0, -0.15, -0.9, -0.3, -0.3), (60.0, 0.15, -0.1, 0.3, 0.1))
        yield State(float(t), float(x), float(y), float(vx), float(vy))


@pytest.mark.parametrize("scene", [WAVING, TILTING])
def test_a_step_does_not_depend_on_how_far_it_may_look(scene):
    n_met = 0
    for state in slow_starts(np.random.default_rng(7), 400):
        far = fast.next_collision(scene, state, state.t + 300.0)
        if isinstance(far, Collision):
            n_met += 1
            for factor in (1.0 + 2.0**-20, 1.3, 4.0):
                assert fast.next_collision(scene, state, state.t + factor * far.dt) == far
            assert far.y >= -1.5 * (1.0 + 2.0**-50)
    assert n_met > 300


def test_the_floor_is_not_missed():
    assert fast.next_collision(WAVING, MISSED, 50.0) == fast.next_collision(WAVING, MISSED, 25.0)


SWEPT = Stem(w=0.5, h=Fourier(1.0, 1.0, (0.2,)))
RIPPLED = Mushroom(r=1.0, h=1.0, w=Fourier(0.5, 1.0, (0.0,) * 15 + (0.05,)))
# 2^27 quarter turns of the highest harmonic end at t = 2.1e8 and 1.3e7.
LATE = [
    (SWEPT, 1e12),
    (SWEPT, -1e12),
    (SWEPT, 2.2e8),
    (RIPPLED, 1.4e7),
    (Cap(r=Fourier(1.0, 1.0, (0.1,))), 1e300),
]


@pytest.mark.parametrize(("scene", "t"), LATE)
def test_a_late_time_is_undecided_in_every_profile(scene, t):
    start = State(t, 0.0, 0.5 if isinstance(scene, Cap) else -0.5, 0.1, 1.0)
    step = fast.next_collision(scene, start, t + abs(t))
    fine = fast.fine_trajectory(scene, start, 9).outcome
    [(flow, stay)] = served.carry(scene, [start], t + abs(t))
    [path] = served.follow(scene, start, 9)
    for found in (step, fine, flow, path):
        assert isinstance(found, Undecided)
    assert f"state.t = {t!r}" in step.reason
    assert stay is None


def test_a_path_that_grows_late_ends_undecided():
    """It began in time, so that it is no bad input."""
    start = State(2.1e8, 0.0, -0.5, 0.1, 0.5)
    path = fast.trajectory(SWEPT, start, 10**7)
    assert 1e5 < len(path.walls) < 10**7
    assert isinstance(path.outcome, Undecided)
    assert f"{len(path.walls)} collisions after state.t" in path.outcome.reason


def test_a_horizon_beyond_all_patience_is_undecided():
    """A good start beside it is carried all the same."""
    start, slow = State(0.0, 0.0, -0.5, 0.1, 1.0), State(0.0, 0.0, -0.5, 1e-9, 1e-9)
    box = Stem(w=0.5, h=1.0)
    run = fast.flow(box, [slow, start], 1e8)
    assert [type(outcome).__name__ for outcome in run.outcomes] == ["Horizon", "Undecided"]
    assert run.wall_counts.sum(axis=1).tolist() == [0, 0]
