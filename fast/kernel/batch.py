"""One step of each of many given states, compiled: by the scalar step, or by one round of the lanes."""

import numpy as np

from fast.kernel import rows
from fast.kernel.compiling import kept
from fast.kernel.follow import advance
from fast.kernel.lane_laws import know_laws, set_reference
from fast.kernel.laws import set_anchors
from fast.kernel.records import ANCHORS_SHAPE, particle_at, write_state
from fast.kernel.rows import copy_rows, load, whole_registers
from fast.kernel.scalar_step import KNOWN
from fast.kernel.walls import wall_residual
from fast.kernel.worker import run_careful


@kept(error_model="numpy")
def fill_lane(a, i, particle, age, worker):
    """Put a particle into a lane, its laws known from `age` before its time, if they still serve then."""
    for early in (age, 0.0):
        load(a, i, particle, False)
        know_laws(a, i, early, worker.laws)
        if a[rows.END + i] > particle.t:
            break
    a[rows.AS_GIVEN + i], a[rows.STOP + i] = 0.0, np.inf
    a[rows.SPIN + i] = particle.x * particle.vy - particle.y * particle.vx


@kept(error_model="numpy")
def step_lanes(pool, a, n, worker, spare):
    """Take a step of n lanes where it is shown right, corrected as often as need be in a pool of one lane."""
    advance(pool, a, whole_registers(n), worker)
    for i in range(n):
        copy_rows(a, i, spare, 0, rows.T, rows.POOL_SIZE)
        while spare[rows.FATE] in (rows.COARSE, rows.FAR):
            if spare[rows.FATE] == rows.FAR:
                if spare[rows.TRIES] > rows.MAX_CORRECTIONS:
                    break
                t = spare[rows.T] + spare[rows.S]
                set_reference(spare, 0, t, spare[rows.T_LOW], worker.laws)
            if spare[rows.END] == -np.inf:
                break
            advance(pool, spare, 1, worker)
        copy_rows(spare, 0, a, i, rows.T, rows.POOL_SIZE)


@kept(error_model="numpy")
def residual(particle, scene, anchors):
    """Return the function of a particle's wall where the particle is, and a bound on its rounding."""
    set_anchors(scene.laws, anchors, particle.t, particle.t_low)
    return wall_residual(particle.wall, particle.x, particle.y, scene, anchors)


@kept(error_model="numpy")
def fill_careful(step_at, scene, states, walls, n_times, found):
    """Fill in codes, times and ends of a scalar step from each start, n_times over."""
    codes, times, ends = found
    anchors = np.zeros(ANCHORS_SHAPE)
    for k in range(n_times * states.shape[0]):
        i = k % states.shape[0]
        known = particle_at(states, i, walls[i]), np.inf, KNOWN, scene, anchors
        codes[i], times[i], particle = run_careful(step_at, known)
        write_state(ends, i, particle)
