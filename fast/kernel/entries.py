"""The compiled functions that Python calls, kept in numba's disk cache.

Files of other sources have other names, so that a change in any source compiles them anew: see
fast.kernel.compiling.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numba import config, types

from fast.kernel.arithmetic import sine_cosine
from fast.kernel.codes import HORIZON, OFF_WALL
from fast.kernel.compiling import HOW, kept
from fast.kernel.follow import follow
from fast.kernel.judged import GIVEN, KNOWN, MET
from fast.kernel.lane_laws import ONE_WAVE, TWO_WAVES
from fast.kernel.loops import FORMS, run_careful
from fast.kernel.path import follow_one
from fast.kernel.pieces import fill_coefficients
from fast.kernel.records import ANCHORS_SHAPE, particle_at, write_state, write_step
from fast.kernel.refine import fine_path
from fast.kernel.single import single_step

QUARTER_TURN, QUARTER_TURN_LOW = math.pi / 2, 6.123233995736766e-17  # pi/2 as two floats


@kept(error_model="numpy")
def careful(step_at, scene, anchors, states, walls, t_end, n_times, paths):
    """Fill in the paths from each start by careful steps, n_times over: see fast.kernel.records.Paths."""
    for i in range(n_times * states.shape[0]):
        i %= states.shape[0]
        particle, code, n = particle_at(states, i, walls[i]), walls[i], 0
        while n < paths.walls.shape[1]:
            limit = (t_end - particle.t) - particle.t_low
            origin = KNOWN if n == 0 else MET
            code, dt, particle = run_careful(step_at, (particle, limit, origin, scene, anchors))
            if code >= HORIZON:
                break
            paths.walls[i, n] = code
            write_step(paths, i, n, dt, particle)
            n += 1
        paths.codes[i], paths.counts[i] = code, n
        write_state(paths.ends, i, particle)


@kept(error_model="numpy", nogil=True)
def fine(scene, anchors, start, wall, limit, out, met, called_off):
    """Follow a path in pairs of floats: see fast.kernel.refine."""
    return fine_path(scene, anchors, start, wall, limit, out, met, called_off)


@kept(nogil=True, **HOW)
def follow_particles(worker, walls):
    """Follow particles to the last stop: see fast.kernel.follow. Threads may call it side by side."""
    follow(worker, walls)


def _path(is_slope_moving, form):
    terms, is_waves = (0,) * form, form in (ONE_WAVE, TWO_WAVES)

    @kept(is_slope_moving, form, nogil=True, **HOW)
    def follow_path(worker, walls, paths):
        """Follow particles one by one from collision to collision: see fast.kernel.path."""
        waves, slope = worker.waves if is_waves else None, None if is_slope_moving else worker.slope
        follow_one(worker, walls, paths, waves, slope, terms)

    return follow_path


# By whether the slope moves, and by the form of the laws.
PATHS = {(moves, form): _path(moves, form) for moves in (False, True) for form in FORMS}


@kept(error_model="numpy")
def fill_pieces(laws, references, coefficients):
    """Write the polynomials of all laws about reference times: see fast.kernel.pieces."""
    fill_coefficients(laws, references, coefficients, np.zeros(ANCHORS_SHAPE))


@kept(error_model="numpy")
def single(step_at, numbers, t, x, y, vx, vy, wall, t_end):
    """Take one step: see fast.kernel.single."""
    return single_step(step_at, numbers, t, x, y, vx, vy, wall, t_end)


@kept(error_model="numpy")
def off_wall(step_at, scene, particle):
    """Return the share of its wall's size by which a particle is off it; 0 for one on it.

    And for one at a time whose phase is lost: that is left to the step, which refuses it.
    """
    code, share, _ = run_careful(step_at, (particle, 0.0, GIVEN, scene, np.zeros(ANCHORS_SHAPE)))
    return share if code == OFF_WALL else 0.0


@kept(error_model="numpy")
def directions(turns, out):
    """Fill out (n, 2) with cosine and sine of whole turns; no libm, hence the same everywhere."""
    for i in range(turns.shape[0]):
        s, _, c, _, _ = sine_cosine(4.0 * turns[i], 0.0, 1.0, QUARTER_TURN, QUARTER_TURN_LOW)
        out[i, 0], out[i, 1] = c, s


NUMBERS, REAL, WHOLE = types.float64[::1], types.float64, types.int64
SINGLE = (WHOLE, NUMBERS, REAL, REAL, REAL, REAL, REAL, WHOLE, REAL)


@cache
def single_at_once():
    """Return `single` for arguments that are known to be of the right types: they are not looked at again.

    To find out what each of nine arguments is takes numba a tenth of the time of a whole question.
    """
    if config.DISABLE_JIT:
        return single
    single.compile(SINGLE)
    return single.overloads[SINGLE].entry_point
