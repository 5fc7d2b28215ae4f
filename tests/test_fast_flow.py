"""`fast.flow`, given particles to a given time, and `fast.follow`, to a capture, a release or an energy."""

import re

import numpy as np
import pytest
from mpmath import fp

import fast
from fast import ensemble
from fast.ensemble import UNDECIDED, initial_states
from scene import (
    BadInput,
    BangBang,
    Cap,
    Fourier,
    Horizon,
    InvalidState,
    Rejected,
    State,
    Undecided,
    Undefined,
    load,
)
from scene.geometry import table_at

SCENE = load("moving-cap")
WALLS = ("arc", "base", "left", "right", "floor")
STARTS = [State(0.25 * k, 0.1 - 0.01 * k, 0.3, 25.0 + k, -7.0 * k) for k in range(5)]


def flow_of(scene, state, t_end):
    return fast.flow(scene, [state], t_end).outcomes[0]


def ends(scene, state, t_end, flow=flow_of):
    """Return where a flow and a path end: x, y, vx, vy; nothing of a flow that is lost."""
    found = flow(scene, state, t_end)
    path = fast.trajectory(scene, state, 10_000, t_end)
    assert isinstance(path.outcome, Horizon)
    return [(o.x, o.y, o.vx, o.vy) if isinstance(o, Horizon) else () for o in (found, path.outcome)]


def test_who_gathers_speed_for_ever_is_given_up(monkeypatch):
    """The first speed says little of how many collisions are to come: they are counted."""
    start = State(0.0, 0.1, 0.2, 3.0, 4.0)
    most = 500
    monkeypatch.setattr(ensemble, "MOST_TO_A_TIME", most)
    monkeypatch.setattr(ensemble, "MOST_IN_CYCLES", most)
    run = fast.flow(SCENE, [start, STARTS[0]], 400.0)
    assert run.outcomes == [Undecided("t_end is over 1e+07 collisions away")] * 2
    assert all(most < n < 10 * most for n in run.wall_counts.sum(axis=1))
    assert isinstance(fast.flow(SCENE, [start], 20.0).outcomes[0], Horizon)
    run = fast.simulate(SCENE, n_particles=4, energy=12.5, n_cycles=60, seed=1)
    assert run.outcome.tolist() == [UNDECIDED] * 4
    # Captured ones are unfolded: they are given up where they are in the table, all the same.
    for name in ("breathing-circle", "moving-cap"):
        scene = load(name)
        lost = fast.simulate(scene, n_particles=200, energy=1250.0, n_cycles=4, seed=1)
        assert (lost.outcome == UNDECIDED).sum() > 100
        for t, x, y in zip(lost.t, lost.x, lost.y, strict=True):
            now = table_at(fp, scene, t)
            walls = ("arc", "base") if y >= 0 else ("left", "right", "floor")
            assert min(now.gap(wall, x, y) for wall in walls if wall in scene.walls) > -1e-9
    at_rest = fast.flow(load("frozen-mushroom"), [start], 400.0)
    assert isinstance(at_rest.outcomes[0], Horizon)
    assert at_rest.wall_counts.sum() > 2 * most


@pytest.mark.parametrize("name", ["a cap at rest", "breathing-circle"])
def test_through_the_centre_and_unfolded_all_the_same(name, tally):
    """With no angular momentum at all a particle of a cap is unfolded like any other."""
    scene = Cap(r=1.0) if name == "a cap at rest" else load(name)
    random = np.random.default_rng(11)
    for _ in range(60):
        p, q = (float(part) for part in random.integers(-8, 9, 2))
        k = 2.0 ** -random.integers(5, 8)
        m = 2.0 ** -random.integers(0, 3) * random.choice([-1.0, 1.0])
        if q == 0:
            continue
        state = State(0.0, k * p, k * abs(q), m * p, m * abs(q))
        assert state.x * state.vy == state.y * state.vx
        t_end = float(random.integers(1, 60)) / 8 + 0.01
        found, expected = ends(scene, state, t_end)
        assert found[1] >= 0
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-9)
        tally["through the centre"] += 1


BREATHING = [Cap(r=BangBang(((0.0, 1.0), (1.0, 0.5), (2.0, 1.0)))), Cap(r=Fourier(1.0, 1.0, (0.5,)))]


def lost_in_slow_caps(flow, n):
    """Return how many of n particles, about as slow as the arc of their cap, do not end where they should.

    There a lane's guess of the time of the next hit may be any number, or none.
    """
    random = np.random.default_rng(7)
    n_lost = 0
    for scene in BREATHING:
        for _ in range(n // 2):
            x = float(random.uniform(-0.25, 0.25))
            y = float(random.uniform(0.02, 0.3))
            speed = random.uniform(0.4, 2.5)
            angle = random.uniform(0.0, 2 * np.pi)
            t = float(random.uniform(0.0, 8.0))
            velocity = speed * np.exp(1j * angle)
            state = State(t, x, y, float(velocity.real), float(velocity.imag))
            found, expected = ends(scene, state, t + 8.0, flow)
            n_lost += found != pytest.approx(expected, rel=1e-6, abs=1e-6)
    return n_lost


def test_slow_particles_of_a_cap_are_not_lost():
    assert lost_in_slow_caps(flow_of, 60) == 0


def test_a_flow_that_forgets_which_wall_was_met_last_loses_them():
    def forgetful(scene, state, t_end):
        """At its first hit with the arc after one with the base it does not know that it is there."""
        path = fast.trajectory(scene, state, 1000, t_end)
        if path.walls[:2] != ["base", "arc"]:
            return path.outcome
        return fast.trajectory(scene, State(*map(float, path.steps[1, 1:]), None), 1000, t_end).outcome

    assert lost_in_slow_caps(forgetful, 60) > 5


def test_the_first_captured_stay():
    """Frozen: a particle in the island stays from its first arc hit on; one through the mouth has no stay."""
    scene = load("frozen-mushroom")
    inside = State(0.0, 0.8, 0.1, 0.1, 3.0)
    through = State(0.0, 0.0, 0.5, 0.0, -3.0)
    run = fast.flow(scene, [inside, through], 9.0)
    first = fast.next_collision(scene, inside, 9.0)
    assert (run.t_in[0], run.t_out[0]) == (first.t, 9.0)
    assert np.isnan((run.t_in[1], run.t_out[1])).all()


def test_a_bad_start_is_refused_by_its_number():
    with pytest.raises(InvalidState, match=r"particle 1: state .* is beyond wall arc"):
        fast.flow(SCENE, [STARTS[0], State(0.0, 3.0, 0.1, 1.0, 0.0)], 2.0)
    with pytest.raises(InvalidState, match=r"particle 0: t_end = -1\.0"):
        fast.flow(SCENE, STARTS[:1], -1.0)


def test_laws_too_fast_for_binary64_are_refused():
    scene = Cap(r=BangBang(knots=((0.0, 1.0), (1e-300, 0.5), (1.0, 1.0))))
    outcome = fast.next_collision(scene, State(0.0, 0.1, 0.2, 1.0, 0.0), 1.0)
    assert isinstance(outcome, Rejected)
    assert "2^400" in outcome.reason
    with pytest.raises(ValueError, match=r"2\^400"):
        fast.simulate(scene, n_particles=1, energy=1.0)


def test_what_is_lost_on_the_way_says_why():
    sliding = State(0.0, 0.2, 0.0, 1.0, 0.0, "base")
    (outcome,) = fast.flow(load("breathing-circle"), [sliding], 1.0).outcomes
    assert outcome == Undefined("sliding")


def test_nothing_to_follow():
    assert fast.flow(SCENE, [], 1.0).outcomes == []
    assert isinstance(fast.flow(SCENE, [State(1.0, 0.1, 0.2, 1.0, 0.0)], 1.0).outcomes[0], Horizon)


def drawn(n, energy):
    return [State(t, *place) for t, _, *place in initial_states(SCENE, n, energy, 3).tolist()]


def test_captures_and_releases_are_those_of_a_flow():
    """So slow that some tens of collisions do not part what lanes and a trajectory round otherwise."""
    states = drawn(60, 20.0)
    end = SCENE.period
    n_captured = 0
    n_released = 0
    flown = fast.flow(SCENE, states, end)
    for capture, release, t_in, t_out in zip(
        fast.follow(SCENE, states, "capture", end),
        fast.follow(SCENE, states, "release", end),
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


def test_an_energy_is_reached_from_either_side_at_the_first_collision_with_it():
    (start,) = drawn(1, 1e4)
    path = fast.trajectory(SCENE, start, 5000)
    energies = (path.steps[:, 4] ** 2 + path.steps[:, 5] ** 2) / 2
    for wanted in (energies.max(), energies.min()):
        found = fast.follow(SCENE, start, float(wanted), n_collisions=5000)
        is_there = energies >= wanted if wanted > 1e4 else energies <= wanted
        assert found.n_collisions == 1 + int(np.flatnonzero(is_there)[0])
        assert found.state.t == path.steps[found.n_collisions - 1, 1]


def test_what_does_not_happen_has_no_state():
    states = drawn(2, 1e4)
    found = fast.follow(SCENE, states, 1e9, t_end=0.5)
    assert [one.state for one in found] == [None, None]
    assert all(isinstance(one.outcome, Horizon) for one in found)
    assert fast.follow(SCENE, states[0], 1e9, n_collisions=7) == (None, 7, None)
    assert fast.follow(SCENE, [], "capture") == []


@pytest.mark.parametrize(
    ("scene", "states", "until", "more", "words"),
    [
        ("fermi-ulam", None, "capture", {}, "until = 'capture': table is stem, must be mushroom"),
        ("moving-cap", None, "escape", {}, "until = 'escape', must be capture, release or an energy"),
        ("moving-cap", None, -1.0, {}, "energy = -1.0, must be > 0"),
        ("moving-cap", None, None, {}, "until = None, must be a finite number"),
        ("moving-cap", None, np.array([1.0, 2.0]), {}, "until = [1.0, 2.0], must be a finite number"),
        ("fermi-ulam", None, np.array(["capture"]), {}, "until = ['capture'], must be a finite number"),
        ("moving-cap", None, 1.0, {"n_collisions": 0}, "n_collisions = 0"),
        ("moving-cap", None, 1.0, {"t_end": "late"}, "t_end = 'late'"),
        ("moving-cap", "here", 1.0, {}, "states = 'here'"),
    ],
)
def test_what_cannot_be_followed_to_is_refused(scene, states, until, more, words):
    start = states or State(0.0, 0.1, -0.1, 1.0, 0.5)
    with pytest.raises(BadInput, match=re.escape(words)):
        fast.follow(load(scene), start, until, **more)
