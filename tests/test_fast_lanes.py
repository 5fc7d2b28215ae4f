"""The lanes against the careful step, at collisions of trajectories, and what the compiler made of them.

`MUSHROOMS_LANE_STEPS=1000000 pytest tests/test_fast_lanes.py` checks a million steps, in a minute.
"""

from __future__ import annotations

import os
import re
from types import FunctionType

import numpy as np
import pytest
from msgspec.structs import replace
from numba import njit, types
from support.depth import deep_but

import fast
from fast.batch import take_careful_steps
from fast.ensemble import initial_states
from fast.kernel import worker
from fast.kernel.compiling import HOW, TOOLS
from fast.kernel.lane_laws import NO_WAVES, ONE_WAVE, TWO_WAVES
from fast.kernel.lanes import chord, fly
from fast.kernel.records import LANES, MUSHROOM, POOL_SIZE, Compiled
from fast.kernel.worker import CACHE_LINE, LawLimits, new_pools
from fast.pieces import PARABOLA, SERIES
from fast.step import WALL_CODES
from fast.units import compile_scene
from scene import BangBang, Cap, Fourier, Mushroom, State, Stem, load

N_STEPS = int(os.environ.get("MUSHROOMS_LANE_STEPS", "20000"))
PATH = 2000  # collisions
BOUND = 4.0  # backward ulps
NUDGE = 2.0**-26


@pytest.mark.parametrize(
    ("form", "is_slope_moving"), [(ONE_WAVE, False), (TWO_WAVES, True), (PARABOLA, False), (SERIES, True)]
)
@pytest.mark.parametrize("loop", ["fly", "chord"])
def test_the_compiler_packs_divisions_and_square_roots(loop, form, is_slope_moving):
    """Eight lanes to an instruction, where the machine has 512-bit registers, or four of 256."""
    entry = worker.FLIES[is_slope_moving, form] if loop == "fly" else worker.CHORDS[form]
    function = njit(**HOW)(entry.py_func)  # what the disk cache keeps has no text
    function.compile(worker.STEP.args)
    assembly = function.inspect_asm(worker.STEP.args)
    if not re.search("vdiv[sp]d", assembly):
        pytest.skip("needs a machine with AVX")
    widest = "z" if "+avx512f" in TOOLS[3] else "y"
    assert re.search(rf"vdivpd\s+.*%{widest}mm", assembly)
    if loop == "fly":
        assert re.search(rf"vsqrtpd\s+.*%{widest}mm", assembly)


@pytest.mark.parametrize("step", [fly, chord])
def test_the_width_of_registers_changes_no_bit(step):
    less = {**step.__globals__, "widest_registers": njit(lambda: None)}
    limits, waves = LawLimits(*np.ones(8)), NO_WAVES._replace(omega=0.5, r=(1.0, 0.1, 0.2, 0.0, 0.0))
    table, pools, texts = Compiled(int(MUSHROOM), True, np.zeros((5, 5)), np.zeros((4, 4))), [], []
    for each in (step, FunctionType(step.__code__, less)):
        pool = np.random.default_rng(1).uniform(0.5, 2.0, POOL_SIZE)
        compiled = njit(**HOW)(each)
        compiled(pool, LANES, table, waves, 0.125, (0,), limits)
        pools.append(pool.tobytes())
        texts.append(compiled.inspect_asm(compiled.signatures[0]))
    assert pools[0] == pools[1]
    has_512 = "+avx512f" in TOOLS[3]
    assert ["vdivpd" in text and "%zmm" in text for text in texts] == [has_512, False]


def test_an_address_is_refused_to_who_expects_another_result():
    """Called all the same, it would write over what is not its own."""
    with pytest.raises(TypeError, match="loop returns none"):
        worker.address(worker.CHORDS[ONE_WAVE], types.float64(*worker.STEP.args))


def moving_cap(**laws):
    return replace(load("moving-cap"), **laws)


DECAYING = tuple(0.3 * (-1) ** k / k**2 for k in range(1, 17))
DEEP_SIZE = Fourier(1.0, 1.0, (0.9, 0.0, -0.25))
SCENES = {
    name: load(name)
    for name in ("moving-cap", "ergodic", "frozen-mushroom", "breathing-circle", "fermi-ulam")
}
SCENES |= {
    "fixed-cap-anticlockwise": load("fixed-cap-anticlockwise"),
    "two harmonics": moving_cap(
        r=Fourier(1.0, 6.0, (), (0.4, 0.1)), h=2.0, nu=Fourier(0.6, 6.0, (0.3, 0.05))
    ),
    "sixteen harmonics": moving_cap(r=Fourier(1.0, 1.0, (), DECAYING), h=Fourier(1.0, 1.0, DECAYING)),
    "deep waves": moving_cap(
        r=Fourier(1.0, 1.0, (0.9, 0.0, -0.35)), h=1.0, nu=Fourier(0.5, 1.0, (0.45, 0.0, -0.17)), slope=0.001
    ),
    "a deep mouth": Mushroom(r=1.0, h=1.0, nu=Fourier(0.5, 1.0, (0.4, 0.0, -0.125))),
    "a deep cap": Cap(r=Fourier(1.0, 1.0, (0.8, 0.0, -0.2))),
    "a deeper cap": Cap(r=Fourier(1.0, 1.0, (0.8, 0.0, -0.25))),
    "a deep stem": Stem(w=DEEP_SIZE, h=DEEP_SIZE),
    "waves and knots": Mushroom(
        r=Fourier(1.5, cos=(0.3,), period=1.0),
        h=BangBang(((0.0, 2.0), (0.3, 1.0), (0.5, 1.0), (1.0, 2.0))),
        nu=Fourier(0.5, sin=(0.2,), period=1.0),
    ),
    "a moving slope": moving_cap(slope=Fourier(0.05, 1.0, (0.03,), (0.02,))),
    "a radius with knots": moving_cap(
        r=BangBang(((0.0, 1.0), (0.5, 1.5), (1.0, 1.0))),
        nu=BangBang(((0.0, 0.4), (0.25, 0.4), (0.5, 0.9), (1.0, 0.4))),
        h=1.0,
    ),
}


IN_A_STEM = [name for name, scene in SCENES.items() if not isinstance(scene, Cap)]  # a cap is unfolded


def paths_along(scene):
    """Yield rows of states at collisions of paths by lanes, codes of their walls, and dt and state one on."""
    for t, _, *place in initial_states(scene, 1000, 1e5, 3).tolist():
        path = fast.trajectory(scene, State(t, *place), PATH)
        codes = np.array([WALL_CODES[wall] for wall in path.walls])
        rows = np.zeros((len(codes) - 1, 6))
        rows[:, 0], rows[:, 2:] = path.steps[:-1, 1], path.steps[:-1, 2:]
        yield rows, codes, path.steps[1:, [0, 2, 3, 4, 5]]


@pytest.mark.parametrize("name", deep_but(IN_A_STEM, "two harmonics", "a moving slope"))
def test_one_particle_takes_the_steps_of_the_lanes(name, tally):
    """A trajectory branches by wall, a flow does not: the same bits until a particle is captured."""
    scene, t_end, n_steps, n_careful = SCENES[name], 1.25, 0, 0
    for energy in (30.0, 1e4):
        starts = [State(t, *place) for t, _, *place in initial_states(scene, 40, energy, 5).tolist()]
        run = fast.flow(scene, starts, t_end)
        free = np.flatnonzero(np.isnan(run.t_in))
        paths = [fast.trajectory(scene, starts[i], 10_000, t_end) for i in free]
        assert [path.outcome for path in paths] == [run.outcomes[i] for i in free]
        n_steps, n_careful = sum(len(path.walls) for path in paths), run.n_careful[free].sum()
    tally["collisions"] += n_steps
    # At 1e4 only: the laws change much in one flight of a slow particle, and half of its steps are careful.
    assert n_steps > 20 * n_careful


def errors_of(scene, rows, codes, answers):
    """Return which walls differ from the careful step's, and backward ulps where no nudge changes the wall.

    As `conformance.grading.agreement`, with derivatives by differences: a million of them take a minute.
    """
    compiled = compile_scene(scene)

    def careful(states):
        met, times, ends = take_careful_steps(compiled, states, codes[:-1])
        return met, np.column_stack([times, ends[:, 2:]])

    found, truth = careful(rows)
    sizes, is_clear = np.abs(truth), found == codes[1:]
    speed = np.hypot(rows[:, 4], rows[:, 5])
    for column, size in zip((0, 2, 3, 4, 5), (1.0 / speed, 1.0, 1.0, speed, speed), strict=True):
        up, down = rows.copy(), rows.copy()
        up[:, column] += NUDGE * size
        down[:, column] -= NUDGE * size
        (code_up, above), (code_down, below) = careful(up), careful(down)
        is_clear &= (code_up == found) & (code_down == found)
        slopes = (above - below) / (up[:, column] - down[:, column])[:, None]
        sizes += np.abs(slopes * rows[:, column, None])
    ulps = np.abs(answers - truth) / (2.0**-53 * sizes + 5e-324)
    return found != codes[1:], ulps.max(axis=1)[is_clear]


@pytest.mark.parametrize("name", SCENES)
def test_lanes_take_the_careful_steps(name, tally):
    scene, worst = SCENES[name], 0.0
    for rows, codes, answers in paths_along(scene):
        is_wrong, ulps = errors_of(scene, rows, codes, answers)
        assert not is_wrong.any()
        tally["steps"] += len(rows)
        tally["delicate"] += len(rows) - len(ulps)
        worst = max(worst, float(ulps.max()))
        if tally["steps"] >= N_STEPS // len(SCENES):
            break
    tally["worst backward ulps (thousandths)"] = round(1000 * worst)
    assert worst <= BOUND
    assert tally["delicate"] < 0.01 * tally["steps"]
    run = fast.simulate(scene, n_particles=4, energy=1e5)  # paths go the same way
    assert (run.outcome == 0).all()
    assert run.n_careful.sum() < 0.02 * run.n_collisions.sum()


@pytest.mark.parametrize("column", range(5))
def test_a_spoilt_lane_is_seen(column):
    """The comparison notices numbers that are off by 2^-47."""
    rows, codes, answers = next(paths_along(SCENES["moving-cap"]))
    answers[:, column] *= 1.0 + 2.0**-47
    _, ulps = errors_of(SCENES["moving-cap"], rows, codes, answers)
    assert ulps.max() > BOUND


def test_pools_begin_with_a_cache_line_wherever_memory_lies():
    held = []
    for n in range(40):
        held.append(np.zeros(2 * n + 1))  # moves what is allocated next
        pools = new_pools()
        held.append(pools)
        assert pools.ctypes.data % CACHE_LINE == 0
        assert pools.flags.c_contiguous
        assert pools.shape == (2, POOL_SIZE)
