"""The lanes against the careful step, at collisions of trajectories, and what the compiler made of them.

`MUSHROOMS_LANE_STEPS=1000000 pytest tests/test_fast_lanes.py` checks a million steps.
"""

from __future__ import annotations

import os
import re

import numpy as np
import pytest
from support.lane_search import Round, try_starts

import fast
from fast.kernel import bounces, lanes, pools
from fast.kernel.limits import LawLimits
from fast.starts import initial_states
from fast.step import WALL_CODES
from scene import Cap, State, load

N_STEPS = int(os.environ.get("MUSHROOMS_LANE_STEPS", "4000"))
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


SCENES = ("moving-cap", "fixed-cap-clockwise", "breathing-circle", "frozen-mushroom", "untilted")


def starts_along(scene, start, n):
    """Yield the states after the collisions of a path that lanes begin from, with the walls they are on."""
    path = fast.trajectory(scene, start, n)
    for wall, (_, t, *place) in zip(path.walls, path.steps.tolist(), strict=True):
        if wall != "base" or not isinstance(scene, Cap):  # lanes unfold a disk
            yield np.array([t, 0.0, *place]), WALL_CODES[wall]


@pytest.mark.parametrize("name", SCENES)
def test_lanes_take_the_careful_steps(name, tally):
    scene, random, starts = load(name), np.random.default_rng(5), []
    driver, paths = Round(scene), initial_states(scene, N_STEPS, 1e6, 3).tolist()
    for t, _, *place in paths:
        starts += starts_along(scene, State(t, *place), 200)
        for _ in range(len(starts) // pools.LANES):
            assert try_starts(driver, scene, starts[: pools.LANES], random, tally) == []
            del starts[: pools.LANES]
        if tally["steps"] >= N_STEPS // len(SCENES):
            break
    assert tally["lane answers"] > 0.9 * tally["steps"]
    assert tally["delicate"] < 0.01 * tally["steps"]


@pytest.mark.parametrize("column", range(5))
def test_a_spoilt_lane_is_seen(column, tally):
    """The comparison notices numbers that are off by 2^-47."""

    class Spoilt(Round):
        def step(self, n):
            right, hits, numbers = super().step(n)
            numbers[:, column] *= 1.0 + 2.0**-47
            return right, hits, numbers

    scene = load("moving-cap")
    starts = list(starts_along(scene, State(0.0, 0.1, 0.2, 1000.0, 700.0), 40))
    assert try_starts(Spoilt(scene), scene, starts, np.random.default_rng(1), tally) != []
