"""Sizes whose waves add up to more than their mean, and that are positive all the same.

`scene.laws.bounds` takes all amplitudes from the mean, and says of such a law that it may be negative. Who
squares that, divides by it or multiplies two of them has a bound that is none.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

import fast
import reference
from fast import pieces, units
from fast.units import compile_scene
from scene import BadInput, Cap, Collision, Fourier, Horizon, Mushroom, State, Stem
from scene.geometry import rounded
from scene.laws import bounds, values
from scene.sizes import size_bounds


def deep_wave(random, mean):
    """Draw |1 + a e^ix + b e^2ix|^2 and a little more, a law whose waves add up to more than its mean."""
    while True:
        a, b = random.uniform(0.5, 1.5) * random.choice((-1.0, 1.0)), random.uniform(0.1, 0.6)
        whole = (1.0 + a * a + b * b) * (1.0 + 10.0 ** random.uniform(-3.0, -1.0))
        first, second = 2.0 * a * (1.0 + b) * mean / whole, 2.0 * b * mean / whole
        law = Fourier(mean=mean, period=1.0, cos=(first, second))
        if bounds(law).lowest < 0.0:
            return law


def drawn(random):
    """Draw a valid scene of such laws, and a state inside that is about as slow as its walls."""
    while True:
        r, h, size = (deep_wave(random, mean) for mean in (1.0, 1.0, random.uniform(0.2, 0.5)))
        kind = random.integers(4)
        try:
            scene = (
                Cap(r=r)
                if kind == 0
                else Stem(w=size, h=h)
                if kind == 1
                else Mushroom(r=r, nu=size, h=1.0)
                if kind == 2
                else Mushroom(r=1.0, w=size, h=h)
            )
        except BadInput:  # nu beyond 1
            continue
        t, turn, speed = (
            random.uniform(0.0, 1.0),
            random.uniform(0.0, 2.0 * np.pi),
            10.0 ** random.uniform(-1.0, 0.3),
        )
        now = rounded(scene, t)
        if isinstance(scene, Cap) or (isinstance(scene, Mushroom) and random.random() < 0.5):
            x, y = 0.5 * now.r * random.uniform(-1.0, 1.0), 0.5 * now.r * random.random()
        else:
            x, y = now.w * random.uniform(-0.9, 0.9), -now.h * random.uniform(0.1, 0.9)
        return scene, State(*map(float, (t, x, y, speed * math.cos(turn), speed * math.sin(turn))))


def wrong_steps(n, tally):
    """Return the questions that `fast` answers otherwise than the reference proves, of n drawn ones."""
    random, wrong = np.random.default_rng(1), []
    for _ in range(n):
        scene, state = drawn(random)
        found, proved = (stepper.next_collision(scene, state, state.t + 3.0) for stepper in (fast, reference))
        if not isinstance(proved, reference.Collision | reference.Horizon):
            continue
        truth = proved.rounded()
        tally[type(truth).__name__] += 1
        if isinstance(found, Collision | Horizon):
            same = found.t == pytest.approx(truth.t, rel=1e-9) and type(found) is type(truth)
            if not same or getattr(found, "wall", None) != getattr(truth, "wall", None):
                wrong.append((scene, state))
    return wrong


def test_the_least_of_a_size_is_positive_and_below_all_values():
    random, times = np.random.default_rng(2), np.arange(10_000) / 10_000
    for _ in range(200):
        law = deep_wave(random, 10.0 ** random.uniform(-3.0, 3.0))
        assert 0.0 < size_bounds(law).lowest <= values(law, times).min() * (1.0 + 1e-12)


def test_what_samples_do_not_show_to_be_positive_is_told_to_be_0():
    touching = Fourier(mean=1.0, omega=1.0, cos=(1.0 - 2.0**-53,))
    assert bounds(touching).lowest < size_bounds(touching).lowest == 0.0
    scene = Cap(r=touching)
    assert pieces.pieces_of(compile_scene(scene), pieces.SERIES) is None  # lanes know nothing of it
    start = State(0.0, 0.5, 0.5, 30.0, 40.0)
    path, flow = fast.trajectory(scene, start, 100, 0.5), fast.flow(scene, [start], 0.5)
    end, arrived = path.outcome, flow.outcomes[0]
    assert (arrived.vx, arrived.vy) == pytest.approx((end.vx, end.vy), rel=1e-12)
    assert flow.n_careful.sum() >= flow.wall_counts.sum() > 10


def test_no_step_between_deep_waves_is_wrong(tally):
    assert wrong_steps(150, tally) == []
    assert tally["Collision"] > 100


@pytest.fixture
def forgetful():
    """Forget compiled scenes before and after."""
    for remembered in (compile_scene, units.fit):
        remembered.cache_clear()
    yield
    for remembered in (compile_scene, units.fit):
        remembered.cache_clear()


def test_with_the_bounds_as_they_are_some_would_be(monkeypatch, forgetful, tally):
    monkeypatch.setattr(units, "size_bounds", bounds)
    assert wrong_steps(150, tally) != []


def test_a_product_of_two_lows_below_0_is_no_low():
    """Both factors' bounds are negative, their product is above the mouth's least width."""
    scene = Mushroom(
        r=Fourier(1.0, cos=(0.9, 0.0, -0.35), period=1.0),
        h=1.0,
        nu=Fourier(0.5, cos=(0.45, 0.0, -0.17), period=1.0),
    )
    met = fast.next_collision(scene, State(0.297, -0.024, -0.56, -0.035, -0.87), 2.297)
    assert (met.wall, met.dt) == ("left", pytest.approx(0.032594, rel=1e-4))


@pytest.mark.parametrize(
    "scene",
    [
        Mushroom(r=1.0, h=1.0, nu=Fourier(0.5, omega=1.0, cos=(0.4, 0.0, -0.125))),
        Cap(r=Fourier(1.0, omega=1.0, cos=(0.8, 0.0, -0.2))),
        Cap(r=Fourier(1.0, omega=1.0, cos=(0.8, 0.0, -0.25))),
        Stem(
            w=Fourier(1.0, omega=1.0, cos=(0.9, 0.0, -0.25)), h=Fourier(1.0, omega=1.0, cos=(0.9, 0.0, -0.25))
        ),
    ],
    ids=["mouth", "cap", "deeper cap", "stem"],
)
def test_the_lanes_take_deep_waves(scene):
    ensemble = fast.simulate(scene, n_particles=100, energy=1e4, seed=1)
    assert (ensemble.outcome == 0).all()
    assert ensemble.n_careful.sum() < 0.05 * ensemble.n_collisions.sum()
