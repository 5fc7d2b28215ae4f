"""`fast.follow`: a particle's first capture and release, and the energy that it reaches."""

from __future__ import annotations

import numpy as np
import pytest

import fast
from fast.starts import initial_states
from scene import BadInput, Horizon, State, load

SCENE = load("moving-cap")


@pytest.fixture(scope="module")
def starts():
    rows = initial_states(SCENE, 40, 1e4, 3)
    return [State(row[0], *row[2:]) for row in rows.tolist()]


def test_captures_and_releases_are_those_of_a_flow():
    """So slow that some tens of collisions do not part what lanes and a trajectory round otherwise."""
    rows, end, n_captured, n_released = initial_states(SCENE, 60, 20.0, 3), SCENE.period, 0, 0
    starts = [State(row[0], *row[2:]) for row in rows.tolist()]
    flown = fast.flow(SCENE, starts, end)
    for capture, release, t_in, t_out in zip(
        fast.follow(SCENE, starts, "capture", end),
        fast.follow(SCENE, starts, "release", end),
        flown.t_in.tolist(),
        flown.t_out.tolist(),
        strict=True,
    ):
        assert (capture.state is not None) == np.isfinite(t_in)
        if capture.state is not None:
            n_captured += 1
            assert capture.state.wall == "arc"
            assert capture.state.t == pytest.approx(t_in, abs=1e-6)
        if release.state is not None:
            n_released += 1
            assert release.state.t == pytest.approx(t_out, abs=1e-6)
    assert n_captured >= n_released > 5


def test_an_energy_is_reached_from_either_side_at_the_first_collision_with_it(starts):
    start = starts[0]
    path = fast.trajectory(SCENE, start, 5000)
    energies = (path.steps[:, 4] ** 2 + path.steps[:, 5] ** 2) / 2
    for wanted in (energies.max(), energies.min()):
        found = fast.follow(SCENE, start, float(wanted), n_collisions=5000)
        is_there = energies >= wanted if wanted > 1e4 else energies <= wanted
        assert found.n_collisions == 1 + int(np.flatnonzero(is_there)[0])
        assert found.state.t == path.steps[found.n_collisions - 1, 1]


def test_what_does_not_happen_has_no_state(starts):
    found = fast.follow(SCENE, starts[:2], 1e9, t_end=0.5)
    assert [one.state for one in found] == [None, None]
    assert all(isinstance(one.outcome, Horizon) for one in found)
    assert fast.follow(SCENE, starts[0], 1e9, n_collisions=7) == (None, 7, None)
    assert fast.follow(SCENE, [], "capture") == []


@pytest.mark.parametrize(
    ("scene", "states", "until", "more", "words"),
    [
        ("fermi-ulam", None, "capture", {}, "until = 'capture': table is stem, must be mushroom"),
        ("moving-cap", None, "escape", {}, "until = 'escape', must be capture, release or an energy"),
        ("moving-cap", None, -1.0, {}, "energy = -1.0, must be > 0"),
        ("moving-cap", None, None, {}, "energy = None"),
        ("moving-cap", None, 1.0, {"n_collisions": 0}, "n_collisions = 0"),
        ("moving-cap", None, 1.0, {"t_end": "late"}, "t_end = 'late'"),
        ("moving-cap", "here", 1.0, {}, "states = 'here'"),
    ],
)
def test_bad_input_is_refused(scene, states, until, more, words):
    start = states or State(0.0, 0.1, -0.1, 1.0, 0.5)
    with pytest.raises(BadInput, match=words.replace("(", r"\(")):
        fast.follow(load(scene), start, until, **more)
