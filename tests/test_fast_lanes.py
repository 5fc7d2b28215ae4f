"""The lanes against the careful step, at collisions of trajectories, and what the compiler made of them.

`MUSHROOMS_LANE_STEPS=1000000 pytest tests/test_fast_lanes.py` checks a million steps.
"""

from __future__ import annotations

import os
import re

import numpy as np
import pytest

import fast
from fast.batch import LaneRound
from fast.kernel import bounces, codes, lanes, pools
from fast.kernel.limits import LawLimits
from fast.starts import initial_states
from fast.step import WALL_CODES
from scene import State, load

N_STEPS = int(os.environ.get("MUSHROOMS_LANE_STEPS", "4000"))
BOUND = 4.0  # backward ulps
NUDGE = 2.0**-26
OFF = np.bool_(False)


@pytest.mark.parametrize("loop", ["aim", "fly", "bounce", "chord", "rebound"])
def test_the_compiler_packs_divisions_and_square_roots(loop):
    """Four lanes to an instruction, where the machine has 256-bit registers."""
    a = np.ones(pools.N_ROWS * pools.LANES)
    n, limits = np.int64(60), LawLimits(*[1.0] * 6)
    function = getattr(bounces if loop in ("bounce", "rebound") else lanes, loop)
    arguments = {
        "aim": (OFF, 0.1, limits),
        "fly": (OFF, True, 1.0, 0.1, limits, None),
        "bounce": (0.1, True),
        "chord": (OFF, OFF, True, 1.0, limits, None),
        "rebound": (),
    }
    function(a, n, *arguments[loop])
    (assembly,) = function.inspect_asm().values()
    if "vdivsd" not in assembly:
        pytest.skip("needs a machine with AVX")
    assert "vdivpd" in assembly
    assert re.search(r"vdivpd\s+.*%ymm", assembly)
    if loop == "aim":
        assert re.search(r"vsqrtpd\s+.*%ymm", assembly)


class Driver(LaneRound):
    """A round of the lanes beside the careful step."""

    def careful(self, p, wall):
        """Return the careful step's wall and dt, x, y, vx, vy."""
        code, dt, end = self.careful_step(p, wall)
        return code, np.array([dt, *end[2:]])

    def jacobian(self, p, wall, code, length, speed):
        """Return the careful step's derivatives by central differences; None for a delicate step."""
        columns = []
        for k, size in enumerate((length / speed, length, length, speed, speed)):
            ends = []
            for nudge in (-NUDGE * size, NUDGE * size):
                q = p.copy()
                q[(0, 2, 3, 4, 5)[k]] += nudge
                found, numbers = self.careful(q, wall)
                if found != code:
                    return None
                ends.append(numbers)
            columns.append((ends[1] - ends[0]) / (2 * NUDGE * size))
        return np.column_stack(columns)


def compare(driver, states, walls, random, tally):
    """Step `states` (n, 6) in lanes and carefully; returns the worst backward ulps between them."""
    n, worst = len(states), 0.0
    for i, (p, wall) in enumerate(zip(states, walls, strict=True)):
        serves = pools.SERVES / driver.omega if driver.omega else 0.0
        driver.fill(i, p, wall, random.random() * serves)
    right, hits, found = driver.skip(n) if driver.is_disk else driver.fly(n)
    for p, wall, is_right, hit, numbers in zip(states, walls, right, hits, found, strict=True):
        tally["steps"] += 1
        if not is_right:
            continue
        tally["by lanes"] += 1
        code, truth = driver.careful(p, wall)
        if driver.is_disk and code == codes.BASE:  # the disk is unfolded: compare after the base
            continue
        assert code == hit, (p, wall)
        speed = float(np.hypot(p[4], p[5]))
        jacobian = driver.jacobian(p, wall, code, 1.0, speed)
        if jacobian is None:
            tally["delicate"] += 1
            continue
        # conformance.grading.error.backward_ulps in floats: a million of them should not take all day.
        moved = np.abs(jacobian) @ np.abs([p[0], *p[2:]]) + np.abs(truth)
        ulps = float(np.max(np.abs(numbers - truth) / (2.0**-53 * moved + 5e-324)))
        assert ulps <= BOUND, (ulps, p.tolist(), wall)
        worst = max(worst, ulps)
    return worst


SCENES = ("moving-cap", "fixed-cap-clockwise", "breathing-circle", "frozen-mushroom", "untilted")


@pytest.mark.parametrize("name", SCENES)
def test_lanes_take_the_careful_steps(name, tally):
    scene, random = load(name), np.random.default_rng(5)
    driver = Driver(scene)
    states, walls, worst, n_paths = [], [], 0.0, 0
    while tally["steps"] < N_STEPS // len(SCENES):
        (row,) = initial_states(scene, n_paths + 1, 1e6, 3)[n_paths:]
        n_paths += 1
        path = fast.trajectory(scene, State(row[0], *map(float, row[2:])), 200)
        for wall, (_, t, *place) in zip(path.walls, path.steps.tolist(), strict=True):
            if driver.is_disk and wall == "base":
                continue
            states.append(np.array([t, 0.0, *place]))
            walls.append(WALL_CODES[wall])
            if len(states) == pools.LANES:
                worst = max(worst, compare(driver, states, walls, random, tally))
                states.clear()
                walls.clear()
    tally["worst backward ulps (thousandths)"] = round(1000 * worst)
    assert tally["by lanes"] > 0.9 * tally["steps"]
    assert tally["delicate"] < 0.01 * tally["steps"]


@pytest.mark.parametrize("column", range(5))
def test_a_spoilt_lane_is_seen(column, tally):
    """The comparison notices numbers that are off by 2^-47."""
    scene = load("moving-cap")
    driver = Driver(scene)
    path = fast.trajectory(scene, State(0.0, 0.1, 0.2, 1000.0, 700.0), 40)
    states = [np.array([t, 0.0, *place]) for _, t, *place in path.steps.tolist()]
    walls = [WALL_CODES[wall] for wall in path.walls]
    honest = driver.fly

    def spoilt(n):
        right, hits, numbers = honest(n)
        numbers[:, column] *= 1.0 + 2.0**-47
        return right, hits, numbers

    driver.fly = spoilt
    with pytest.raises(AssertionError):
        compare(driver, states, walls, np.random.default_rng(1), tally)
