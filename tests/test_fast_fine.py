"""The fine step against the reference: about 31 decimals, on generated steps and along paths."""

import os
from fractions import Fraction
from math import hypot

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from mpmath import fp
from support.truth import centre, proved_step

import fast
import reference
from conformance.grading.agreement import compare, exact as enclosed
from conformance.strategies import scenes_and_states
from fast.kernel import records
from fast.kernel.fine_step import FineState, fine_path
from fast.kernel.records import ANCHORS_SHAPE
from fast.step import WALL_CODES
from fast.units import compile_scene
from scene import BangBang, Cap, Collision, Mushroom, State, Stem, Undecided, load
from scene.geometry import table_at

N_STEPS = int(os.environ.get("MUSHROOMS_STEPS", "100"))
UNIT = 2.0**51  # backward units of 2^-104 in a backward ulp
SHARP = 4.0  # units that nearly all answers keep
WORST = 2.0**24  # where a wall's speed is the rest of harmonics that cancel: see fast.kernel.fine_step
# So soon, in periods, that terms cancel; or leaving its wall so slowly, in parts of the speed, that pairs,
# right to 2^-104 of the speed, do not tell the time to the 2^-80 of it that the fine step asks for.
BRIEF = 2.0**-33
GRAZING = 2.0**-24
START = State(0.1, 0.2, 0.3, 140.0, 30.0)


def leaves_slowly(scene, state):
    table = table_at(fp, scene, state.t)
    speed = hypot(state.vx, state.vy)
    nx, ny = table.normal(state.wall, state.x, state.y)
    leaving = nx * state.vx + ny * state.vy + table.receding(state.wall, state.y)
    return abs(leaving) < GRAZING * speed


def test_generated_steps_are_right_to_31_decimals(tally):
    units = []

    @settings(max_examples=N_STEPS)
    @given(scenes_and_states())
    def step(drawn):
        scene, state, t_end = drawn
        truth = proved_step(scene, state, t_end, digits=60)
        if truth is None or truth.outcome != "collision":
            return
        path = fast.fine_trajectory(scene, state, 1)
        tally["steps"] += 1
        if not path.walls:
            # Not more shy than the careful step, whose answer it refines, but at once after a bounce.
            assert isinstance(path.outcome, Undecided)
            careful = fast.next_collision(scene, state, t_end)
            is_soon = isinstance(careful, Collision) and careful.dt < BRIEF * scene.cycle.value(fp)
            assert isinstance(careful, Undecided) or is_soon or leaves_slowly(scene, state)
            tally["undecided"] += 1
            return
        dt, _, *place = path.numbers(0)
        found = compare(enclosed(path.walls[0], [dt, *place]), truth, state, WORST / UNIT)
        assert found.verdict == "pass", found
        worst = found.ulps * UNIT
        units.append(worst)

    step()
    tally["worst units of 2^-104"] = round(max(units))
    tally["above the sharp bound"] = sum(u > SHARP for u in units)
    assert np.median(units) <= 1.0
    assert np.quantile(units, 0.9) <= SHARP
    assert len(units) > N_STEPS // 3


SPIKE = ((0.765625, 0.9259033203125), (1.0, 1.6240234375), (1.0009765625, 0.60888671875))
# The law's knots are periods away from the time, and beside both the hop is short.
EARLY = Cap(r=BangBang(knots=(*SPIKE, (1.265625, 0.9259033203125))))
OFF_THE_KNOT = State(0.0, -1.6240234374527343, 1.2390362797987107e-05, 0.000264, 10.287379856, "arc")


DELICATE = [
    *((EARLY, msgspec.structs.replace(OFF_THE_KNOT, t=0.5 * n), 50.0, SHARP) for n in (0, 2, -3, 40)),
    # Up a deep stem to the arc.
    *(
        (Mushroom(r=1.3, h=h, nu=0.7), State(0.0, 0.3, -0.9 * h, 0.1 / h, 1.0), 2.0 * h, WORST)
        for h in (1e2, 1e4, 1e6)
    ),
]


@pytest.mark.parametrize(("scene", "state", "t_end", "bound"), DELICATE)
def test_short_hops_far_from_knots_and_flights_up_deep_stems_keep_their_decimals(scene, state, t_end, bound):
    truth = proved_step(scene, state, t_end, digits=60)
    path = fast.fine_trajectory(scene, state, 1)
    dt, _, *place = path.numbers(0)
    assert compare(enclosed(path.walls[0], [dt, *place]), truth, state, bound / UNIT).verdict == "pass"


def test_the_bound_tells_pairs_from_binary64():
    truth = proved_step(load("moving-cap"), START, 10.0, 60)
    found = fast.fine_trajectory(load("moving-cap"), START, 1)
    highs = [Fraction(found.steps[0, k, 0]) for k in (0, 2, 3, 4, 5)]
    assert compare(enclosed(found.walls[0], highs), truth, START, WORST / UNIT).verdict == "fail"


@pytest.mark.parametrize("name", ["moving-cap", "fixed-cap-clockwise", "ergodic", "breathing-circle"])
def test_a_path_keeps_its_digits_longer_than_binary64(name):
    scene = load(name)
    n = 30
    fine = fast.fine_trajectory(scene, START, n)
    rough = fast.trajectory(scene, START, n)
    truth = reference.trajectory(scene, START, n, digits=40)
    assert fine.walls == [step.wall for step in truth.steps]
    last = [centre(c) for c in truth.steps[-1].after]
    error = max(
        abs(a - b) / max(map(abs, last[1:3]))
        for a, b in zip(fine.numbers(n - 1)[2:4], last[1:3], strict=True)
    )
    same = max(abs(Fraction(a) - b) for a, b in zip(rough.steps[-1, 2:4].tolist(), last[1:3], strict=True))
    assert error <= 1e-18
    assert same > 1e6 * error * max(map(abs, last[1:3]))


def test_rounding_a_state_of_pairs_is_not_taken_for_a_gap():
    """A side and the floor met together but for 3e-7 of 1e-10, and the low parts hold which is first."""
    scene = Stem(w=1.0, h=1.0)
    d = round(1e-10 * 2**53) * 2.0**-53
    start = FineState((0.0, 0.0), (1.0 - d, 0.0), (d - 1.0, -5e-17), (1.0, 0.0), (2e-7 - 1.0, 0.0))
    steps = np.empty((1, 6, 2))
    met = np.empty(1, dtype=np.int64)
    anchors = np.zeros(ANCHORS_SHAPE)
    called_off = np.zeros(1, np.int64)
    compiled = compile_scene(scene)
    wall = WALL_CODES[None]
    n, code = fine_path(compiled, anchors, start, wall, steps, met, called_off)
    assert (n, code) == (0, records.NEAR_CORNER)
