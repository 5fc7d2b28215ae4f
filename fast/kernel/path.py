"""Following one particle from collision to collision, by the lanes' loops with one lane in use."""

from __future__ import annotations

import numpy as np

from fast.kernel.careful import NEAR
from fast.kernel.codes import HORIZON
from fast.kernel.compiling import kernel, part
from fast.kernel.flights import OFF, advance, collide, correct
from fast.kernel.follow import keep_up_laws, step_carefully

from fast.kernel.pools import (  # isort: skip
    CERTAIN, END, HIT, NEVER, NEXT_T, NEXT_T_LOW, NEXT_VX, NEXT_VY, NEXT_X, NEXT_Y, OK, S, T,
    T_LOW, VX, VY, WALL, X, Y, load,
)  # fmt: skip
from fast.kernel.records import Particle, particle_at, write_state, write_step
from fast.kernel.worker import GENERAL, PARTICLE

ALONE = np.int64(1)  # lanes in use


@part
def next_hit(a, roster, worker):
    """Find the next collision of the particle in the first lane; returns its wall, or what comes instead.

    The lanes' answer is taken unless the end may come before: there the careful step looks from both sides.
    """
    i, limit = np.int64(0), (worker.stops.times[-1] - a[T]) - a[T_LOW]
    if worker.is_laned and a[END + i] > -NEVER:
        advance(GENERAL, a, ALONE, OFF, worker)
        if a[OK + i] != CERTAIN:
            correct(GENERAL, a, ALONE, worker)
        if a[OK + i] == CERTAIN and a[S + i] < limit * (1.0 - 4.0 * NEAR):
            keep_up_laws(a, i, worker)
            return int(a[HIT + i])
    return step_carefully(GENERAL, a, i, roster, worker)


@kernel
def follow_one(worker, walls, paths):
    """Follow each particle of a worker by itself, through as many collisions as `paths` has room for."""
    states, a, roster = worker.followed.states, worker.pools[GENERAL], worker.rosters[GENERAL]
    for j in range(states.shape[0]):
        load(a, 0, particle_at(states, j, walls[j]), NEVER, OFF)
        roster[PARTICLE, 0] = j
        code, n = walls[j], 0
        while n < paths.walls.shape[1] and worker.stops.called_off[0] == 0:
            code = next_hit(a, roster, worker)
            if code >= HORIZON:
                a[T], a[T_LOW], a[X], a[Y] = a[NEXT_T], a[NEXT_T_LOW], a[NEXT_X], a[NEXT_Y]
                a[VX], a[VY] = a[NEXT_VX], a[NEXT_VY]
                break
            collide(GENERAL, a, ALONE, worker)
            paths.walls[j, n] = code
            particle = Particle(a[T], a[T_LOW], a[X], a[Y], a[VX], a[VY], code)
            write_step(paths, j, n, a[S], particle)
            n += 1
        paths.codes[j], paths.counts[j] = code, n
        write_state(paths.ends, j, Particle(a[T], a[T_LOW], a[X], a[Y], a[VX], a[VY], int(a[WALL])))
