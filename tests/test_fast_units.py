"""Scaling by powers of two: the same bits or a refusal, whatever the exponents; the extremes of binary64.

`MUSHROOMS_SCALINGS=20000 pytest tests/test_fast_units.py` searches deeper.
"""

import math
import os
from importlib import import_module
from random import Random

import numpy as np
import pytest
from hypothesis import Phase, given, settings, strategies as st

import fast
from conformance.strategies import scenes_and_states
from fast import step as stepper
from fast.kernel.single import pack_scene
from fast.prepared import Prepared
from fast.units import compile_scene, outward
from scene import BangBang, Cap, Collision, Fourier, Horizon, Mushroom, Rejected, State, Undecided, load
from scene.refusal import BadInput
from scene.transforms import scaled, scaled_state

N_SCALINGS = int(os.environ.get("MUSHROOMS_SCALINGS", "100"))
MOST = 390
LONGEST = 300
EXPONENTS = st.integers(-MOST, MOST) | st.sampled_from((-MOST, 0, MOST))


def answers(scene, state, t_end):
    """Return words and counts of a step, a path and a flow, and rows of dt, t, x, y, vx, vy, which scale.

    Raises:
        BadInput: this is no question, or one of them is refused.
    """
    step = fast.next_collision(scene, state, t_end)
    path = fast.trajectory(scene, state, LONGEST, t_end)
    # In a slit hits are many: a flow goes as far as the path.
    until = t_end if len(path.walls) < LONGEST else float(path.steps[-1, 1])
    run = fast.flow(scene, [state], until, threads=1)
    words = [*path.walls, run.wall_counts.tolist()]
    rows = list(path.steps)
    for found, dt in ((step, 0.0), (path.outcome, 0.0), (run.outcomes[0], run.t_in[0])):
        if isinstance(found, Rejected):
            raise BadInput(found.reason)
        reason = getattr(found, "reason", "").replace(repr(state.t), "t")  # the only number that scales in it
        words += [type(found).__name__, getattr(found, "wall", None), reason]
        if isinstance(found, Collision | Horizon):
            rows.append([getattr(found, "dt", dt), found.t, found.x, found.y, found.vx, found.vy])
    return words, np.reshape(rows, (-1, 6))  # of none, too


def compare_scaled(question, length, time, tally):
    """Hold that a scaled question has the scaled answers, unless one of the two is refused."""
    scene, state, t_end = question
    tally["scalings"] += 1
    try:
        words, rows = answers(scene, state, t_end)
    except BadInput:
        tally["no question"] += 1
        return
    try:
        found = answers(scaled(scene, length, time), scaled_state(state, length, time), 2.0**time * t_end)
    except BadInput:
        tally["refused"] += 1
        return
    tally["answers"] += 1
    speed = length - time
    assert found[0] == words
    assert np.array_equal(
        found[1], np.ldexp(rows, [time, time, length, length, speed, speed]), equal_nan=True
    )


def search_scalings(tally):
    @settings(max_examples=N_SCALINGS, phases=[Phase.generate], report_multiple_bugs=False)
    @given(scenes_and_states(), EXPONENTS, EXPONENTS)
    def compare_drawn(question, length, time):
        compare_scaled(question, length, time, tally)

    compare_drawn()


def test_scaled_questions_have_scaled_answers(tally):
    search_scalings(tally)
    assert tally["answers"] > 0.6 * tally["scalings"]
    assert tally["refused"] < 0.02 * tally["scalings"]


def test_the_search_sees_a_stepper_that_does_not_scale(monkeypatch, tally):
    """Kernels in the scene's own units, as they would be without fast.units."""

    def unfitted(scene):
        compiled = compile_scene(scene)
        return Prepared(scene, scene, 0, 0, compiled, pack_scene(compiled, 0, 0))

    monkeypatch.setattr(stepper, "prepare", unfitted)
    monkeypatch.setattr(import_module("fast.paths"), "prepare", unfitted)
    with np.errstate(all="ignore"), pytest.raises(AssertionError):
        search_scalings(tally)


def test_an_ensemble_scales_to_the_bit():
    scene = load("moving-cap")
    length = 380
    time = -350
    energy = 2.0 ** (2 * (length - time) - 1000) * 1e3 * 2.0**300  # of a table that is slower by 2^-350
    with pytest.raises(BadInput):
        fast.simulate(scaled(scene, 2 * length, time), n_particles=5, energy=energy)
    length = 190
    time = 150
    one = fast.simulate(scene, n_particles=5, energy=1e3, seed=2)
    other = fast.simulate(
        scaled(scene, length, time), n_particles=5, energy=1e3 * 4.0 ** (length - time), seed=2
    )
    speed = length - time
    for name, exponent in (("x", length), ("t_in", time), ("vy", speed), ("cycle_energies", 2 * speed)):
        assert np.array_equal(np.ldexp(getattr(one, name), exponent), getattr(other, name), equal_nan=True)


@pytest.mark.parametrize(
    ("scene", "state", "words"),
    [
        # A speed that a moving table's own time does not hold.
        (Cap(r=Fourier(1.0, 1.0, (0.5,))), State(0.0, 0.1, 0.2, 1e200, 0.0), "2^400"),
        (Cap(r=Fourier(1.0, 1.0, (0.5,))), State(0.0, 0.1, 0.2, 1e-200, 0.0), "2^-400"),
        # Bits that would be lost beside the table's size.
        (Cap(r=2.0**200), State(0.0, 5e-324, 1.0, 1.0, 0.0), "state.x = 5e-324"),
    ],
)
def test_what_does_not_fit_is_refused(scene, state, words):
    found = fast.next_collision(scene, state, 1e9)
    assert isinstance(found, Rejected)
    assert words in found.reason
    assert "\n" not in found.reason


@pytest.mark.parametrize("exponent", [-1, -1001])
def test_what_is_rounded_up_to_the_least_normal_number_is_refused(exponent):
    """It looks like one that has kept its bits."""
    least = np.finfo(np.float64).smallest_normal
    kept = np.ldexp([least, 1.5 * least, 0.0, -least], -exponent)
    assert np.array_equal(np.ldexp(outward(kept, np.array(exponent)), -exponent), kept)
    rounded = np.ldexp([np.nextafter(1.0, 0.0)], -1022 - exponent)
    assert np.ldexp(rounded, exponent) == least
    with pytest.raises(BadInput, match="beyond binary64"):
        outward(rounded, np.array(exponent))


@pytest.mark.parametrize(("speed", "is_kept"), [(-20, True), (-26, False), (-30, False)])
def test_a_path_that_overflows_is_undecided(speed, is_kept):
    """Of so large a table: dt = 2^(1000 - speed) is beyond the largest float from 2^1024 on."""
    cap = Cap(r=2.0**1000)
    state = State(0.0, 0.0, 2.0**999, 0.0, 2.0**speed)
    if is_kept:
        assert fast.trajectory(cap, state, 1).steps[0, 0] == 2.0 ** (999 - speed)
    else:
        for found in (fast.trajectory(cap, state, 1), fast.fine_trajectory(cap, state, 1)):
            assert not found.walls
            assert "beyond binary64" in found.outcome.reason


def test_a_path_to_a_place_that_no_float_holds_is_undecided():
    """Its collisions stand: they were found before."""
    cap = Cap(r=2.0**-1000)
    state = State(0.0, 0.0, 2.0**-1002, 3 * 2.0**-1070, 2.0**-1003)
    assert "beyond binary64" in fast.next_collision(cap, state, 0.1).reason
    for t_end, walls in ((0.1, []), (20.1, ["arc", "base"])):
        found = fast.trajectory(cap, state, 3, t_end)
        assert found.walls == walls
        assert "beyond binary64" in found.outcome.reason


def test_a_stay_that_no_float_holds_is_one_particle_s():
    """Beside so short a period some times of capture would lose their last bits."""
    period = 2.0**-1021
    size = 2.0**-500
    knots = ((0.0, 0.9), (period / 2, 0.3), (period, 0.9))
    scene = Mushroom(r=size, h=size, nu=BangBang(knots=knots))
    speed = 20 * size / period
    random = Random(3)
    states = []
    for _ in range(100):
        angle = random.uniform(0, 6.28)
        x = random.uniform(-0.6, 0.6)
        y = random.uniform(0.05, 0.6)
        state = State(0.0, size * x, size * y, speed * math.cos(angle), speed * math.sin(angle))
        if isinstance(fast.next_collision(scene, state, period), Collision):
            states.append(state)
    together = fast.flow(scene, states, period)
    lost = [i for i, found in enumerate(together.outcomes) if isinstance(found, Undecided)]
    assert 0 < len(lost) < len(states)
    assert all("beyond binary64" in together.outcomes[i].reason for i in lost)
    assert np.isnan(together.t_in[lost]).all()
