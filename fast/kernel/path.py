"""Following one particle from collision to collision, by the lanes' loops with one lane in use."""

from __future__ import annotations

import numpy as np

from fast.kernel.careful import NEAR
from fast.kernel.codes import HORIZON
from fast.kernel.compiling import kernel, part
from fast.kernel.follow import advance, careful_flight, knows_laws, land_carefully
from fast.kernel.lane_laws import set_reference

from fast.kernel.pools import (  # isort: skip
    COARSE, END, FAR, FATE, MARKED, MAX_CORRECTIONS, MOVED, S, STOP, T, TRIES, T_LOW, VX, VY, WALL, X, Y,
    load,
)  # fmt: skip
from fast.kernel.records import Particle, particle_at, write_state, write_step
from fast.kernel.worker import GENERAL

ALONE = np.int64(1)  # lanes in use


@part
def next_hit(a, worker):
    """Take the next step of the particle in the first lane; returns its wall, or what comes instead.

    The lanes' answer is taken unless the end may come before: there the careful step looks from both sides.
    """
    i, limit = np.int64(0), (worker.stops.times[-1] - a[T]) - a[T_LOW]
    a[STOP] = min(a[T] + limit * (1.0 - 4.0 * NEAR), worker.pieces.until)
    while knows_laws(a, i, worker):
        advance(GENERAL, a, ALONE, worker)
        if a[FATE] == MOVED or a[FATE] == MARKED:
            if a[T] >= a[END]:
                set_reference(a, i, a[T], a[T_LOW], worker.scene, worker.pieces, worker.degree)
            return int(a[WALL])
        if a[FATE] == FAR and a[TRIES] <= MAX_CORRECTIONS:
            set_reference(a, i, a[T] + a[S], a[T_LOW], worker.scene, worker.pieces, worker.degree)
        elif a[FATE] != COARSE:
            break
    code, s, p = careful_flight(a, i, worker)
    if code < HORIZON:
        land_carefully(GENERAL, a, i, code, s, p, worker)
    else:
        a[T], a[T_LOW], a[X], a[Y], a[VX], a[VY] = p.t, p.t_low, p.x, p.y, p.vx, p.vy
    return code


@kernel
def follow_one(worker, walls, paths):
    """Follow each particle of a worker by itself, through as many collisions as `paths` has room for."""
    states, a = worker.followed.states, worker.pools[GENERAL]
    for j in range(states.shape[0]):
        load(a, 0, particle_at(states, j, walls[j]), False)
        code, n = walls[j], 0
        while n < paths.walls.shape[1] and worker.stops.called_off[0] == 0:
            code = next_hit(a, worker)
            if code >= HORIZON:
                break
            paths.walls[j, n] = code
            particle = Particle(a[T], a[T_LOW], a[X], a[Y], a[VX], a[VY], code)
            write_step(paths, j, n, a[S], particle)
            n += 1
        paths.codes[j], paths.counts[j] = code, n
        write_state(paths.ends, j, Particle(a[T], a[T_LOW], a[X], a[Y], a[VX], a[VY], int(a[WALL])))
