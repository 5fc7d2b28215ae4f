"""Following particles to given times: lanes where they are shown right, the careful step elsewhere.

A worker holds LANES particles in two pools: `general` for any collision, and `disk` for captured
particles, whose base bounces are counted and not stepped; a cap has the disk alone. Every particle's
numbers depend on that particle only, so threads, chunks and lane positions do not change a bit.

Particles are looked at where their flight passes a *stop*: an instant at which the energy is wanted, a cycle
ends or the mouth narrows (nu has a local minimum). A captured stay is recorded in the slot of each narrowing
that it spans, which keeps out the many brief crossings of the edge |sin phi| = nu. A lane cannot hold all
narrowings, and one is enough: a stay spans some narrowing exactly when it spans the first after its begin.
SINCE = UNTIL is that one, or the last that has passed while there is none.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fast.kernel.arithmetic import fma
from fast.kernel.careful import first_step
from fast.kernel.codes import ARC, CAP, HORIZON, MUSHROOM, N_WALLS, STEM
from fast.kernel.compiling import kernel, part

from fast.kernel.pools import (  # isort: skip
    CERTAIN, CLOSED, COARSE, DONE, END, HIT, KNOT, LANES, NEVER, NEXT_T, NEXT_T_LOW, NEXT_VX, NEXT_VY,
    NEXT_X, NEXT_Y, N_ARC, N_BASE, OK, ROUTINE, S, SINCE, SPIN, STAY_IN, STAY_OUT, STOP, T, T_LOW, UNTIL,
    VX, VY, WALL, X, Y, change_lane, fold, load, refold, set_reference, POOL_SIZE,
)  # fmt: skip
from fast.kernel.bounces import arrive, bounce, rebound
from fast.kernel.lanes import aim, chord, fly
from fast.kernel.laws import set_anchors
from fast.kernel.limits import LawLimits, has_lanes, limits_of

from fast.kernel.records import (  # isort: skip
    ANCHORS_SHAPE, Compiled, FloatArray, Followed, IntArray, LEVEL, OMEGA, Particle, SHARED, SLOPE, Stops,
    particle_at, write_state,
)  # fmt: skip

GENERAL, DISK, SPARE = np.arange(3)  # pools; SPARE is one to correct single lanes in
PARTICLE, NEXT_STOP = np.arange(2)  # rows of a roster: each lane's particle and the number of its next stop
STAYS, MOVES, ENDS = 0, 1, 2
MAX_CORRECTIONS = 3
ON, OFF = np.bool_(True), np.bool_(False)


class Worker(NamedTuple):
    """What one thread needs to follow some particles.

    Attributes:
        scene, limits: the scene, and what holds of it for all time.
        anchors: room for its laws at one time.
        is_laned: the lanes know its laws.
        pools: (3, POOL_SIZE) general, disk and spare pool.
        rosters: (2, 2, LANES) rosters of the first two pools.
        n_held: (2,) number of lanes in use in each.
        stops: when particles are looked at.
        followed: what is filled in.
    """

    scene: Compiled
    limits: LawLimits
    anchors: FloatArray
    is_laned: bool
    pools: FloatArray
    rosters: IntArray
    n_held: IntArray
    stops: Stops
    followed: Followed


def new_worker(scene: Compiled, stops: Stops, followed: Followed) -> Worker:
    """Return a worker that holds no particle yet."""
    return Worker(
        scene,
        limits_of(scene),
        np.zeros(ANCHORS_SHAPE),
        has_lanes(scene, stops.times[-1]),
        np.zeros((3, POOL_SIZE)),
        np.zeros((2, 2, LANES), np.int64),
        np.zeros(2, np.int64),
        stops,
        followed,
    )


@part
def keep_stay(j, cycle, begin, end, stops, followed):
    """Keep a captured stay in the slot of each narrowing of a cycle that it spans, or as the first stay."""
    t_in, t_out = followed.t_in, followed.t_out
    for slot in range(stops.narrowings.shape[1]):
        if stops.is_first_kept:
            is_kept = np.isnan(t_in[j, cycle, slot])
        else:
            is_kept = begin <= stops.narrowings[cycle, slot] <= end
        if is_kept:
            t_in[j, cycle, slot], t_out[j, cycle, slot] = begin, end


@kernel
def note_stops(a, i, roster, last, stops, followed):
    """Record for a lane's particle what is asked for at the stops up to the time `last`."""
    j, at = roster[PARTICLE, i], roster[NEXT_STOP, i]
    times = stops.times
    while at < times.shape[0] and times[at] <= last:
        begin, end = a[STAY_IN + i], a[STAY_OUT + i]
        column = stops.columns[at]
        if column >= 0:
            followed.energies[j, column] = 0.5 * (a[VX + i] * a[VX + i] + a[VY + i] * a[VY + i])
            followed.is_captured[j, column] = begin < NEVER and end == NEVER
        elif begin == NEVER or a[UNTIL + i] < begin:
            a[SINCE + i] = a[UNTIL + i] = times[at]
        if stops.cycles[at] >= 0 and begin < NEVER:
            keep_stay(j, stops.cycles[at], begin, min(end, times[at]), stops, followed)
        at += 1
    roster[NEXT_STOP, i] = at
    a[STOP + i] = times[at] if at < times.shape[0] else NEVER


@part
def note_stay(a, i, roster, stops, followed):
    """Record a captured stay that is over."""
    at = roster[NEXT_STOP, i]
    while stops.cycles[at] < 0:  # the last stop ends a cycle
        at += 1
    keep_stay(roster[PARTICLE, i], stops.cycles[at], a[STAY_IN + i], a[CLOSED + i], stops, followed)
    a[STAY_IN + i] = a[STAY_OUT + i] = a[CLOSED + i] = NEVER
    if stops.is_first_kept:
        a[UNTIL + i] = -NEVER  # no other is wanted


@part
def finish(a, i, j, code, end, followed):
    """Write down a particle's end: at the last stop for HORIZON, else where trouble met it."""
    t, t_low, x, y, vx, vy = a[T + i], a[T_LOW + i], a[X + i], a[Y + i], a[VX + i], a[VY + i]
    if code == HORIZON:
        dt = (end - t) - t_low
        t, t_low = end, 0.0
        x, y_end = fma(vx, dt, x), fma(vy, dt, y)
        if a[SPIN + i] != 0.0:
            # Unfolded: the base may lie between.
            if y * y_end < 0.0:
                a[N_BASE + i] += 1.0
            if y_end < 0.0:
                y_end, vy = -y_end, -vy
        y = y_end
    write_state(followed.states, j, Particle(t, t_low, x, y, vx, vy, int(a[WALL + i])))
    followed.codes[j] = code
    for wall in range(N_WALLS):
        followed.counts[j, wall] = int(a[N_ARC + wall * LANES + i])


@part
def step_carefully(pool, a, i, roster, worker):
    """Find a lane's next collision carefully, in the disk the next one with the arc; returns the last code.

    The lane then needs no bounce.
    """
    scene, anchors, stops, followed = worker.scene, worker.anchors, worker.stops, worker.followed
    if pool == DISK:
        refold(a, i)
    while True:
        t, t_low = a[T + i], a[T_LOW + i]
        p = Particle(t, t_low, a[X + i], a[Y + i], a[VX + i], a[VY + i], int(a[WALL + i]))
        code, s, p = first_step(p, (stops.times[-1] - t) - t_low, scene, anchors)
        followed.careful[roster[PARTICLE, i]] += 1
        a[NEXT_T + i], a[NEXT_T_LOW + i] = p.t, p.t_low
        a[NEXT_X + i], a[NEXT_Y + i], a[NEXT_VX + i], a[NEXT_VY + i] = p.x, p.y, p.vx, p.vy
        a[HIT + i], a[DONE + i], a[S + i] = code, 1.0, s
        if code < HORIZON:
            set_reference(a, i, scene, anchors)
        if pool == GENERAL or code >= HORIZON:
            break
        note_stops(a, i, roster, p.t, stops, followed)
        if code == ARC:
            a[N_ARC + i] += 1.0
            a[SPIN + i] = p.x * p.vy - p.y * p.vx
            break
        a[N_BASE + i] += 1.0
        arrive(a, i)
        a[VX + i], a[VY + i] = p.vx, p.vy
    return code


@kernel
def advance(pool, a, n, is_again, scene, limits, omegas):
    """Find the next collision of the n lanes of a pool.

    Args:
        pool: GENERAL, or DISK for lanes that move unfolded from arc to arc.
        a: the pool's rows.
        n: how many lanes are in use.
        is_again: correct the times found before once more, in place of a new guess.
        scene: the scene's numbers.
        limits: what holds of its laws for all time.
        omegas: None where all laws share their frequency; numba then leaves out the slower loops.
    """
    table, is_relative, omega, m = (
        scene.table,
        scene.is_relative,
        scene.laws[SHARED, OMEGA],
        scene.laws[SLOPE, LEVEL],
    )
    if pool == DISK:
        chord(a, n, is_again, table == CAP, is_relative, omega, limits, omegas)
        return
    if not is_again:
        aim(a, n, table == STEM, m, limits)
    fly(a, n, table == STEM, is_relative, omega, m, limits, omegas)


@part
def correct(pool, a, n, spare, scene, limits, omegas):
    """Correct coarse steps until they are right, a few times, each in a pool of its own."""
    for i in range(n):
        if a[OK + i] != COARSE or a[END + i] == -NEVER:
            continue
        change_lane(a, i, spare, np.int64(0))
        for _ in range(MAX_CORRECTIONS):
            advance(pool, spare, np.int64(1), ON, scene, limits, omegas)
            if spare[OK] != COARSE:
                break
        change_lane(spare, np.int64(0), a, i)


@kernel
def attend(pool, a, i, roster, worker):
    """Do for a lane what `advance` could not; returns whether it stays, moves to the other pool or ends."""
    scene, stops, followed = worker.scene, worker.stops, worker.followed
    end = stops.times[-1]
    if a[CLOSED + i] < NEVER:
        note_stay(a, i, roster, stops, followed)
    if pool == GENERAL and a[SPIN + i] != 0.0 and worker.is_laned:
        return MOVES
    is_known = worker.is_laned and a[END + i] > -NEVER
    if is_known and a[OK + i] == CERTAIN and a[NEXT_T + i] < a[KNOT + i]:
        if a[NEXT_T + i] >= a[END + i]:
            set_anchors(scene.laws, worker.anchors, a[NEXT_T + i], a[NEXT_T_LOW + i])
            set_reference(a, i, scene, worker.anchors)
        code = int(a[HIT + i])
    elif pool == DISK and scene.table == MUSHROOM:
        fold(a, i, scene)
        return MOVES
    else:
        code = step_carefully(pool, a, i, roster, worker)
    if code < HORIZON:
        note_stops(a, i, roster, a[NEXT_T + i], stops, followed)
        if roster[NEXT_STOP, i] < stops.times.shape[0]:
            return STAYS
        code = HORIZON
    elif code == HORIZON:
        note_stops(a, i, roster, end, stops, followed)
    finish(a, i, roster[PARTICLE, i], code, end, followed)
    return ENDS


@part
def are_routine(a, n):
    """Tell whether no lane of a pool needs attention: mostly so, and seen in one packed loop."""
    least = 1.0
    for i in range(n):
        least = min(least, a[ROUTINE + i])
    return least > 0.0


@part
def change_place(worker, pool, i, other, j):
    """Copy a lane and its entry in the roster to another place."""
    change_lane(worker.pools[pool], i, worker.pools[other], j)
    worker.rosters[other, PARTICLE, j] = worker.rosters[pool, PARTICLE, i]
    worker.rosters[other, NEXT_STOP, j] = worker.rosters[pool, NEXT_STOP, i]


@part
def scan(pool, worker):
    """Attend to every lane of a pool that needs it; the last lane fills the place of one that leaves."""
    a, roster, n_held = worker.pools[pool], worker.rosters[pool], worker.n_held
    i = np.int64(0)
    while i < n_held[pool]:
        fate = STAYS
        if not (a[ROUTINE + i] > 0.0 and worker.is_laned):
            fate = attend(pool, a, i, roster, worker)
        if fate == STAYS:
            i += 1
            continue
        if fate == MOVES:
            other = 1 - pool
            change_place(worker, pool, i, other, n_held[other])
            n_held[other] += 1
        n_held[pool] -= 1
        change_place(worker, pool, n_held[pool], pool, i)


@part
def follow(worker, walls, omegas):
    """Follow particles to the last stop.

    Args:
        worker: it holds no particle yet; its `followed.states` are the particles' starts.
        walls: codes of the walls that the particles leave (N,).
        omegas: see fast.kernel.limits.own_omegas.
    """
    scene, stops, pools, n_held = worker.scene, worker.stops, worker.pools, worker.n_held
    states = worker.followed.states
    first, last = 0, states.shape[0]
    home = DISK if scene.table == CAP else GENERAL
    while True:
        while n_held[GENERAL] + n_held[DISK] < LANES and first < last:
            i = n_held[home]
            load(
                pools[home], i, particle_at(states, first, walls[first]), stops.times[0], stops.is_first_kept
            )
            worker.rosters[home, PARTICLE, i], worker.rosters[home, NEXT_STOP, i] = first, 0
            n_held[home] += 1
            first += 1
        if n_held[GENERAL] + n_held[DISK] == 0:
            break
        for pool in (GENERAL, DISK):
            a = pools[pool]
            if n_held[pool] == 0:
                continue
            advance(pool, a, n_held[pool], OFF, scene, worker.limits, omegas)
            if not (worker.is_laned and are_routine(a, n_held[pool])):
                if worker.is_laned:
                    correct(pool, a, n_held[pool], pools[SPARE], scene, worker.limits, omegas)
                scan(pool, worker)
            if pool == GENERAL:
                bounce(a, n_held[pool], scene.laws[SLOPE, LEVEL], scene.table == MUSHROOM)
            else:
                rebound(a, n_held[pool])
