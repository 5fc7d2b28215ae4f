"""The lanes against the careful step, at collisions of trajectories, and what the compiler made of them.

`MUSHROOMS_LANE_STEPS=1000000 pytest tests/test_fast_lanes.py` checks a million steps.
"""

from __future__ import annotations

import inspect
import os
import re

import numpy as np
import pytest
from numba import typeof
from support.lane_search import Round, try_starts

import fast
from fast.kernel import bounces, lanes, pools
from fast.kernel.limits import LawLimits
from fast.pieces import PARABOLA, SERIES
from fast.starts import initial_states
from fast.step import WALL_CODES
from scene import Cap, State, load

N_STEPS = int(os.environ.get("MUSHROOMS_LANE_STEPS", "4000"))
OFF = np.bool_(False)


@pytest.mark.parametrize("slope", [0.1, None])
@pytest.mark.parametrize("degree", [PARABOLA, SERIES])
@pytest.mark.parametrize("loop", ["aim", "fly", "bounce", "chord", "rebound"])
def test_the_compiler_packs_divisions_and_square_roots(loop, degree, slope):
    """Eight lanes to an instruction, where the machine has 512-bit registers, or four of 256."""
    given = {"degree": (0,) * degree, "slope": slope, "limits": LawLimits(*[1.0] * len(LawLimits._fields))}
    given |= {"a": np.ones(1), "n": 64, "is_stem": OFF, "is_relative": OFF, "is_mushroom": OFF}
    given |= {"is_again": OFF, "is_cap": OFF}
    function = getattr(bounces if loop in ("bounce", "rebound") else lanes, loop)
    names = inspect.signature(function.py_func).parameters
    if not {"degree", "slope"} & set(names) and (degree, slope) != (2, 0.1):
        pytest.skip("takes neither")
    signature = tuple(typeof(given[name]) for name in names)
    function.compile(signature)
    assembly = function.inspect_asm(signature)
    if not re.search("vdiv[sp]d", assembly):
        pytest.skip("needs a machine with AVX")
    assert re.search(r"vdivpd\s+.*%[yz]mm", assembly)
    if loop == "aim":
        assert re.search(r"vsqrtpd\s+.*%[yz]mm", assembly)


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
