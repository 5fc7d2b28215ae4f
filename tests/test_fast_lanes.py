"""The lanes against the scalar step, at collisions of trajectories; their laws; their machine code.

`MUSHROOMS_LANE_PATHS=1000 pytest tests/test_fast_lanes.py -k careful` compares more steps.
"""

import math
import os
import re
from types import FunctionType

import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st
from mpmath import MPContext
from msgspec.structs import replace
from numba import config, njit, types
from numba.extending import intrinsic
from support.depth import deep_among, deep_but
from support.faulty_kernels import faulty_lanes
from support.from_python import from_python
from support.lane_search import Round, try_starts

import fast
from conformance.cases.delicate_families import sunk
from conformance.strategies import scenes
from fast import pieces
from fast.ensemble import initial_states
from fast.kernel import rows, worker
from fast.kernel.compiling import HOW, TOOLS
from fast.kernel.lane_laws import NO_WAVES, ONE_WAVE, TWO_WAVES, fresh_phase, law_at, law_of_waves, piece_at
from fast.kernel.lanes import chord, fly
from fast.kernel.records import DEPTH, MUSHROOM, N_HARMONICS, OMEGA, SHARED, Compiled, LawLimits
from fast.kernel.worker import CACHE_LINE, new_pools
from fast.pieces import PARABOLA, SERIES, laws_in_lanes, waves_of
from fast.prepared import prepare
from fast.step import WALL_CODES
from fast.units import compile_scene
from scene import BangBang, Cap, Fourier, Mushroom, State, Stem, load
from scene.laws import law_of

N_PATHS = int(os.environ.get("MUSHROOMS_LANE_PATHS", "10"))  # of 128 collisions, in each scene


# Whether the slope moves, and the form of the laws.
FORMS = [(False, ONE_WAVE), (True, TWO_WAVES), (False, PARABOLA), (True, SERIES)]


@pytest.mark.parametrize("form", deep_but(FORMS, (False, PARABOLA)))
@pytest.mark.parametrize("loop", ["fly", "chord"])
def test_the_compiler_packs_divisions_and_square_roots(loop, form):
    """The loop asks for the widest registers; which of them it gets is the compiler's choice."""
    entry = worker.FLIES[form] if loop == "fly" else worker.CHORDS[form[1]]
    function = njit(**HOW)(entry.py_func)  # what the disk cache keeps has no text
    function.compile(worker.STEP.args)
    assert asked_widths(function) == {512}
    if "+avx2" not in TOOLS[3] or not config.ENABLE_AVX:
        pytest.skip("needs a machine with AVX2: for others the compiler may find that packing does not pay")
    assembly = function.inspect_asm(worker.STEP.args)
    # The guess of the time, its correction and the bounce divide: none of these loops is left unpacked.
    assert len(re.findall("vdivpd", assembly)) >= 3
    if loop == "fly":
        assert "vsqrtpd" in assembly


def asked_widths(function):
    """Return the register widths in bits that a compiled function asks for."""
    code = function.inspect_llvm(function.signatures[0])
    return set(map(int, re.findall('"prefer-vector-width"="([0-9]+)"', code)))


def asking_for(width):
    """Return a function of kernels that asks for registers of so many bits, in place of the widest."""

    @intrinsic
    def ask(_context):
        def generate(context, builder, _signature, _arguments):
            set.add(builder.function.attributes, f'"prefer-vector-width"="{width}"')
            return context.get_dummy_value()

        return types.none(), generate

    return ask


@pytest.mark.parametrize("step", deep_but([fly, chord], chord))
def test_the_width_of_registers_changes_no_bit(step):
    """The same loop runs in Python, which has no such registers. Both machine codes must give its bits."""
    limits, waves = LawLimits(*np.ones(8)), NO_WAVES._replace(omega=0.5, r=(1.0, 0.1, 0.2, 0.0, 0.0))
    table = Compiled(int(MUSHROOM), True, np.zeros((5, 5)), np.zeros((4, 4)))
    given = (rows.LANES, table, waves, 0.125, (0,), limits)
    drawn = np.random.default_rng(1).uniform(0.5, 2.0, rows.POOL_SIZE)
    in_python = drawn.tolist()
    with np.errstate(all="ignore"):
        getattr(faulty_lanes(), step.__name__)(in_python, *given)
    for width in (128, 512):
        asking = FunctionType(step.__code__, {**step.__globals__, "widest_registers": asking_for(width)})
        compiled, pool = njit(**HOW)(asking), drawn.copy()
        compiled(pool, *given)
        assert asked_widths(compiled) == {width}
        assert not np.array_equal(pool, drawn)
        assert pool.tobytes() == np.array(in_python).tobytes(), width


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


@pytest.mark.parametrize(
    "name",
    deep_among(SCENES, "ergodic", "fermi-ulam", "fixed-cap-anticlockwise", "a deep mouth", "a deep cap"),
)
def test_lanes_take_the_careful_steps(name, tally):
    """From collisions of paths on: the search of test_fast_lane_search.py, in scenes that people ask for."""
    scene, random = SCENES[name], np.random.default_rng(3)
    for t, _, *place in initial_states(scene, N_PATHS, 1e5, 3).tolist():
        path = fast.trajectory(scene, State(t, *place), rows.LANES)
        starts = [
            (np.array([t, 0.0, *place]), WALL_CODES[wall])
            for wall, (_, t, *place) in zip(path.walls, path.steps.tolist(), strict=True)
            if wall == "arc" or not isinstance(scene, Cap)  # a cap is unfolded
        ]
        assert try_starts(Round(scene), scene, starts, random, tally) == []
    assert tally["delicate"] < 0.01 * tally["lane answers"]
    run = fast.simulate(scene, n_particles=4, energy=1e5)  # paths go the same way
    assert (run.outcome == 0).all()
    assert run.n_careful.sum() < 0.02 * run.n_collisions.sum()


def test_pools_begin_with_a_cache_line_wherever_memory_lies():
    held = []
    for n in range(40):
        held.append(np.zeros(2 * n + 1))  # moves what is allocated next
        pools = new_pools()
        held.append(pools)
        assert pools.ctypes.data % CACHE_LINE == 0
        assert pools.flags.c_contiguous
        assert pools.shape == (2, rows.POOL_SIZE)


ROUNDING = 8 * 2.0**-53
CTX = MPContext()
CTX.dps = 40


def as_rows(scene):
    """Return a scene's laws by the row of their coefficients."""
    found = {} if isinstance(scene, Stem) else {0: scene.laws["r"]}
    if not isinstance(scene, Cap):
        found |= {1: scene.width.factors[0], 2: scene.laws["h"], 3: scene.laws["slope"]}
    return found


def worst_errors(scene, random, n):
    """Return how far polynomials are from laws: value over its size, rate and mean rate over their terms."""
    compiled, worst = compile_scene(scene), np.zeros(3)
    degree = (0,) * (SERIES if compiled.laws[SHARED, OMEGA] > 0.0 else PARABOLA)
    p = pieces.pieces_of(scene, compiled, len(degree))
    for t in random.uniform(-7 * p.period, 7 * p.period, n):
        piece, reference, low = from_python(piece_at)(p, t, 0.0)
        near, far = np.sort(random.choice([-1.0, 1.0, *random.uniform(-1, 1, 2)], 2)) * p.limits[piece]
        for row, law in as_rows(scene).items():
            f, rate, _, mean = from_python(law_at)(p.coefficients[piece, row], 0, 1, far, near, degree)
            at = [CTX.mpf(reference) + CTX.mpf(low) + CTX.mpf(u) for u in (near, far)]
            true = [law_of(law).value(CTX, u) for u in at]
            rates = terms_of_rate(law)
            size = max(abs(v) for v in true) + (row == 3)
            errors = [abs(f - true[1]) / size, abs(rate - law_of(law).value(CTX, at[1], 1)) / rates, 0.0]
            if near != far:
                errors[2] = abs(mean - (true[1] - true[0]) / (at[1] - at[0])) / rates
            worst = np.maximum(worst, [float(e) for e in errors])
    return worst


def terms_of_rate(law):
    """Return the summed sizes of the terms of a law's rate, 1 for a constant."""
    if isinstance(law, Fourier):
        omega = law.omega or 2 * np.pi / law.period
        sizes = [k * (abs(c) + abs(s)) for k, c, s in law.harmonics()]
        return omega * sum(sizes) or 1.0
    return law_of(law).bounds().slope or 1.0


@given(scenes(), st.integers(0, 2**32 - 1))
@settings(max_examples=15)
def test_polynomials_are_the_laws_within_rounding(scene, seed):
    assume(scene.period)  # where nothing moves, lanes take no polynomials
    scene = prepare(scene).scene
    assert (worst_errors(scene, np.random.default_rng(seed), 4) <= ROUNDING).all()


DEEP = [
    Mushroom(r=Fourier(1.0, 1.0, (0.9985,)), nu=0.5, h=1.0),
    Mushroom(r=1.0, w=0.1, h=1.0, slope=Fourier(0.0, 3.0, tuple(0.05 / k**2 for k in range(1, 17)))),
    Cap(r=Fourier(mean=1.0, period=1.0, cos=(0.1, 0.0, 0.02), sin=(0.0, 0.05))),
    Stem(
        w=BangBang(((0.3125, 1.0), (0.55, 0.2), (1.3125, 1.0))),
        h=Fourier(mean=2.0, period=1.0, sin=tuple(1.0 / k**3 for k in range(1, 17))),
    ),
    Stem(w=BangBang(((-0.6875, 1.0), (-0.6874, 0.9), (0.3125, 1.0))), h=1.0),
]


# Waves that cancel to a millionth.
VANISHING = [Stem(w=1.0, h=sunk(4, 1e-6, least)) for least in (0.0, 0.3)]


@pytest.mark.parametrize("scene", [*DEEP, *VANISHING])
def test_deep_quick_and_mixed_laws_too(scene):
    assert (worst_errors(scene, np.random.default_rng(1), 40) <= ROUNDING).all()


@pytest.mark.usefixtures("uncached")
@pytest.mark.parametrize("scene", DEEP[:4])
def test_pieces_that_hold_for_too_long_are_seen(scene, monkeypatch):
    reach = pieces.reach
    monkeypatch.setattr(pieces, "reach", lambda compiled, degree: 2.0 * reach(compiled, degree))
    assert not (worst_errors(scene, np.random.default_rng(1), 40) <= ROUNDING).all()


@pytest.mark.parametrize("scene", VANISHING)
def test_pieces_of_waves_that_are_rounded_where_they_cancel_are_seen(scene, monkeypatch):
    """Rounded as waves would be that add up to the mean."""
    pieces_of = pieces.pieces_of

    def rough(*given):
        found = pieces_of(*given)
        found.coefficients[:, DEPTH, 0] += 2.0**-54
        return found

    monkeypatch.setattr(pieces, "pieces_of", rough)
    assert worst_errors(scene, np.random.default_rng(1), 40)[0] > 100 * 2.0**-53


def in_lanes(scene):
    """Return a scene, in its own units, as the lanes know it."""
    return laws_in_lanes(scene, compile_scene(scene))


def test_degrees_are_no_higher_than_it_takes():
    """Sizes that come down far are no waves, nor are more than two harmonics, or knots."""
    caps = [Cap(r=Fourier(1.0, 1.0, cos)) for cos in ((0.74,), (0.1, 0.1), (0.76,), (0.1, 0.1, 0.1))]
    found = [in_lanes(scene).form for scene in [*caps, *DEEP]]
    assert found == [ONE_WAVE, TWO_WAVES, SERIES, SERIES, *[SERIES] * 4, PARABOLA]
    assert len(in_lanes(Cap(r=Fourier(1.0, 1.0, (0.8,)))).pieces.begins) >= 27


def test_lanes_know_no_phase_that_the_careful_step_calls_lost():
    """It is lost from 2^27 quarter turns of the highest harmonic on."""
    for scene in DEEP[:4]:
        compiled = compile_scene(scene)
        n, omega = compiled.laws[SHARED, N_HARMONICS], compiled.laws[SHARED, OMEGA]
        assert 2.0**20 < omega * in_lanes(scene).pieces.until < math.pi / 2 * 2.0**27 / n


WAVING = Mushroom(
    r=Fourier(1.0, 1.1, (0.2, 0.1), (0.3,)),
    h=Fourier(2.0, 1.1, (), (0.0, 0.5)),
    nu=Fourier(0.5, 1.1, (0.1,), (0.0, 0.1)),
    slope=Fourier(0.0, 1.1, (0.05,)),
)


def worst_of_waves(random, spoilt):
    """Return how far waves are from laws, in units of 2^-53 of the waves and of what a rounding of t does."""
    waves, worst = waves_of(compile_scene(WAVING)), 0.0
    laws = (WAVING.r, waves.r), (WAVING.h, waves.h), (WAVING.nu, waves.w), (WAVING.slope, waves.m)
    for t in [*random.uniform(-20.0, 20.0, 40).tolist(), *(10.0 ** random.uniform(2, 7, 40)).tolist()]:
        low = float(t * 2.0**-53 * random.uniform(-0.5, 0.5))
        sine, cosine = from_python(fresh_phase)(t, low * (1.0 - spoilt), waves)
        at = CTX.mpf(t) + CTX.mpf(low)
        for law, wave in laws:
            found = from_python(law_of_waves)(wave, sine, cosine, waves.omega, (0,) * TWO_WAVES)
            sizes = [sum(map(abs, wave)), terms_of_rate(law)]
            for order, size in enumerate(sizes):
                true = law_of(law).value(CTX, at, order)
                moved = 0.5 * abs(t) * abs(law_of(law).value(CTX, at, order + 1))
                worst = max(worst, float(abs(found[order] - true) / (size + moved)) * 2.0**53)
    return worst


@pytest.mark.parametrize("spoilt", [0.0, 64.0])
def test_waves_are_the_laws_within_rounding(spoilt):
    """And those whose time is rounded are not."""
    assert (worst_of_waves(np.random.default_rng(1), spoilt) < 4.0) == (spoilt == 0.0)
