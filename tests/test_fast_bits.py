"""Bits: the same for any threads, chunks and lane position; symmetries exact on whole trajectories."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings

import fast
from conformance.strategies import scenes_and_states
from fast import ensemble
from scene import State, load
from scene.transforms import mirrored, mirrored_wall, scaled, scaled_state

# Of `small_ensemble`. It changes when the arithmetic does, and then only on purpose.
PINNED = "20148a59436b17ede759b139061a83977645d4ad60bee275ddef713d22bfe667"


def small_ensemble(threads: int | None = None) -> fast.Ensemble:
    return fast.simulate(
        load("moving-cap"),
        n_particles=70,
        energy=1e3,
        n_cycles=2,
        seed=5,
        phases=(0.25, 0.6),
        threads=threads,
    )


def test_the_pinned_ensemble():
    assert small_ensemble().sha256() == PINNED


@pytest.mark.parametrize("size", [1, 7, 64])
def test_chunks_do_not_change_a_bit(size, monkeypatch):
    """Chunks put particles side by side in other lanes, too."""
    monkeypatch.setattr(ensemble, "SHARE", size)
    assert small_ensemble(threads=1).sha256() == small_ensemble(threads=2).sha256() == PINNED


def test_lane_positions_do_not_change_a_bit():
    """A flow's particles, backwards: each lands in another lane, beside others."""
    scene, random = load("fixed-cap-clockwise"), np.random.default_rng(2)
    numbers = zip(
        *random.uniform((-0.3, 0.01, -300, -300), (0.3, 0.4, 300, 300), size=(150, 4)).T, strict=True
    )
    states = [State(0.0, *map(float, row)) for row in numbers]
    one = fast.flow(scene, states, 1.0, threads=1)
    other = fast.flow(scene, states[::-1], 1.0, threads=1)
    assert one.outcomes == other.outcomes[::-1]
    assert np.array_equal(one.t_in, other.t_in[::-1], equal_nan=True)
    assert one.n_careful.sum() < 0.1 * one.wall_counts.sum()


PROGRAM = """
import fast, scene
path = fast.trajectory(scene.load("moving-cap"), scene.State(0.0, 0.1, 0.3, 20.0, 7.0), 40)
print(path.steps.tobytes().hex())
for size in (1.0, 2.0**-500):
    print(fast.next_collision(scene.Cap(r=size), scene.State(0.0, 0.0, 0.5 * size, 2.0**520, 0.0), 1e9))
for name in ("moving-cap", "breathing-circle"):
    run = fast.simulate(scene.load(name), n_particles=2, energy=200.0, seed=1, threads=1)
    print(run.n_careful.sum() < 0.2 * run.n_collisions.sum(), run.sha256())
"""


@pytest.mark.deep
def test_same_bits_without_the_compiler():
    """Kernels are plain Python too: scalar, uncompiled, they give the bits of the packed machine code."""
    results = []
    for is_off in ("0", "1"):
        environment = {**os.environ, "NUMBA_DISABLE_JIT": is_off}
        command = [sys.executable, "-W", "ignore", "-c", PROGRAM]
        run = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        results.append(run.stdout)
    assert results[0] == results[1]
    assert results[0].count("True") == 2


@settings(max_examples=60)
@given(scenes_and_states())
def test_a_mirrored_trajectory_is_the_mirror_of_the_trajectory(drawn):
    scene, s, _ = drawn
    one = fast.trajectory(scene, s, 30)
    other = fast.trajectory(scene, mirrored(s), 30)
    assert other.walls == [mirrored_wall(wall) for wall in one.walls]
    assert np.array_equal(other.steps, one.steps * [1, 1, -1, 1, -1, 1])


@pytest.mark.parametrize("name", ["moving-cap", "fixed-cap-clockwise", "breathing-circle"])
def test_lanes_mirror_and_scale_exactly(name):
    scene, random = load(name), np.random.default_rng(4)
    rows = random.uniform((-0.3, 0.01, -300, -300), (0.3, 0.4, 300, 300), size=(64, 4)).tolist()
    states = [State(0.0, *row) for row in rows]
    one = fast.flow(scene, states, 1.5)
    image = fast.flow(scene, [mirrored(state) for state in states], 1.5)
    half = fast.flow(scaled(scene, -1, 2), [scaled_state(state, -1, 2) for state in states], 6.0)
    for a, b, c in zip(one.outcomes, image.outcomes, half.outcomes, strict=True):
        assert (b.x, b.y, b.vx, b.vy) == (-a.x, a.y, -a.vx, a.vy)
        assert (c.x, c.y, c.vx, c.vy) == (a.x / 2, a.y / 2, a.vx / 8, a.vy / 8)
    assert np.array_equal(image.t_in, one.t_in, equal_nan=True)
    assert np.array_equal(half.t_in, 4 * one.t_in, equal_nan=True)
