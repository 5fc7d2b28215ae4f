"""Sizes that come near 0: what is left of them is known as well as any other size.

Waves may cancel to a part of 1e-4 to 1e-13, and terms known to 2^-62 of themselves would not do. Waves that
add up to more than their mean may leave a size that is positive all the same; `scene.laws.bounds` says of it
that it may be negative. A bound below 0 must not be squared, divided by or multiplied by another.
"""

from __future__ import annotations

import math
import os

import numpy as np
import pytest

import fast
import reference
from conformance.cases.attacks import UnderAttack, run, stepped
from conformance.cases.certify import proved_step
from conformance.cases.delicate_families import sunk
from conformance.cases.draw import Draw
from conformance.cases.scenes import deep_wave
from conformance.cases.table import FAMILIES
from fast import pieces, units
from fast.batch import lane_steps
from fast.units import compile_scene
from scene import Cap, Fourier, Horizon, Mushroom, State, Stem
from scene.laws import bounds, size_bounds, values

N_ATTACKS = int(os.environ.get("MUSHROOMS_ATTACKS", "100"))


def attack(name, n_cases, seed):
    """Ask the fast stepper questions of a family."""
    (found,) = run([FAMILIES[name]], n_cases, seed, UnderAttack(fast.next_collision, is_proved=False))
    return found


@pytest.mark.parametrize(("name", "seed"), [("nearly-shut", 1), ("all-but-gone", 1), ("deep-waves", 2)])
def test_no_answer_is_wrong(name, seed, tally):
    found = attack(name, N_ATTACKS, seed)
    tally.update(found.counts)
    assert found.cases["wrong"] == []
    assert found.counts["agreed"] > N_ATTACKS // 3


@pytest.mark.usefixtures("uncached")
def test_between_deep_waves_some_answers_hang_on_the_bounds(monkeypatch):
    """With the bounds of a law that may be negative they are wrong."""
    monkeypatch.setattr(units, "size_bounds", bounds)
    assert attack("deep-waves", N_ATTACKS, 2).cases["wrong"] != []


def test_the_least_of_a_size_is_positive_and_below_all_values():
    times = np.arange(10_000) / 10_000
    for index in range(200):
        draw = Draw(f"deep/{index}")
        high = draw.power(-10, 10)
        law = deep_wave(draw, high * draw.power(-10, -4), high, 2.0 * math.pi)
        assert bounds(law).lowest < 0.0 < size_bounds(law).lowest <= values(law, times).min() * (1.0 + 1e-12)


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


def test_who_is_inside_a_mouth_of_1e_13_is_let_through_it():
    w = Fourier(mean=0.5000000000001, cos=(-0.38242109364224425,), sin=(-0.3221088436188455,), period=1.0)
    scene, t = Mushroom(r=1.5, w=w, h=1.0), 0.11140847644675131
    start = State(t, 1.0265573708885821e-13, 6.975390845030978e-11, 0.0, -1.0)
    assert isinstance(fast.next_collision(scene, start, t + 0.01), Horizon)
    assert isinstance(reference.next_collision(scene, start, t + 0.01), reference.Horizon)


@pytest.mark.parametrize("n", [1, 2, 4])
@pytest.mark.parametrize("left", [1e-4, 1e-6, 1e-8])
def test_lanes_meet_what_is_left(n, left, tally):
    """As the careful step does: within the four backward ulps of every answer."""
    random, scene = np.random.default_rng(n), Stem(w=1.0, h=sunk(n, left))
    starts = []
    for _ in range(100):
        t, v = 10.0 ** random.uniform(-6.0, -1.5), 10.0 ** random.uniform(-1.0, 3.0)
        starts.append(State(float(t), 0.1, 0.0, float(0.1 * v * random.normal()), float(-v), "base"))
    for start, answer in zip(starts, lane_steps(scene, starts), strict=True):
        if answer is None:
            continue
        judged = stepped(answer, proved_step(scene, start, start.t + 100.0), start)
        tally[judged.kind] += 1
        assert judged.kind == "agreed", judged
    assert tally["agreed"] > 30
