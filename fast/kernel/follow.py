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
from numba import njit

from fast.kernel.arithmetic import SAFETY, fma
from fast.kernel.careful import first_step
from fast.kernel.codes import ARC, CAP, HORIZON, MUSHROOM, N_WALLS, STEM

from fast.kernel.lanes import (  # isort: skip
    CALM, CLOSED, COARSE, DONE, END, H0, HIT, H_REF, KNOT, LANES, NEVER, NEXT_H0, NEXT_R0, NEXT_T, NEXT_T_LOW,
    NEXT_VX, NEXT_VY, NEXT_W0, NEXT_X, NEXT_Y, N_ARC, N_BASE, N_REF, N_ROWS, OK, ON_ARC, R0, REF, REF_LOW,
    RIGHT_ONE, R_REF, S, SINCE, SPIN, STAY_IN, STAY_OUT, STOP, T, T_LOW, UNTIL, VX, VY, W0, WALL, X, Y,
    aim, arrive, bounce, chord, chord_mixed, fly, fly_mixed, rebound,
)  # fmt: skip
from fast.kernel.laws import bend_of_half_leg, set_anchors
from fast.kernel.limits import Limits, has_lanes, limits_of

from fast.kernel.records import (  # isort: skip
    ANCHORS_SHAPE, BANG_BANG, DEPTH, FOURIER, HALF_LEG, KIND, LEVEL, OMEGA, RADIUS, RATE, ROOM, SHARED, SLOPE, VALUE,
    VALUE_LOW, WIDTH, Compiled, FloatArray, Followed, IntArray, Particle, Stops, particle_at, write_state,
)  # fmt: skip
from fast.kernel.short import law, turns

GENERAL, DISK, SPARE = np.arange(3)  # pools; SPARE is one to correct single lanes in
PARTICLE, NEXT_STOP = np.arange(2)  # rows of a roster: each lane's particle and the number of its next stop
STAYS, MOVES, ENDS = 0, 1, 2
POOL_SIZE = N_ROWS * LANES
SERVES = 0.125  # omega times how long a reference serves for starting a flight
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
    limits: Limits
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


@njit(error_model="numpy")
def set_reference(a, i, scene, anchors):
    """Make the time of a lane's next state the reference of its laws, and give it their values there."""
    laws, t, end, knot = scene.laws, a[NEXT_T + i], NEVER, NEVER
    a[REF + i], a[REF_LOW + i] = t, a[NEXT_T_LOW + i]
    for row, place in ((RADIUS, R_REF + i), (WIDTH, N_REF + i), (DEPTH, H_REF + i)):
        f, rate, bend = anchors[row, VALUE], anchors[row, RATE], 0.0
        if laws[row, KIND] == FOURIER:
            bend = -laws[row, OMEGA] * laws[row, OMEGA] * (f - laws[row, LEVEL])
            end = min(end, t + SERVES / laws[row, OMEGA])
        elif laws[row, KIND] == BANG_BANG:
            bend = bend_of_half_leg(laws, row, int(anchors[row, HALF_LEG]))
            # Rounded down: a flight that ends before it ends before the half-leg does.
            knot = min(knot, (t + anchors[row, ROOM]) - SAFETY * (abs(t) + anchors[row, ROOM]))
        a[place], a[place + LANES] = f, anchors[row, VALUE_LOW]
        a[place + 2 * LANES], a[place + 3 * LANES] = rate, bend
    a[END + i], a[KNOT + i] = min(end, knot), knot
    set_laws(a, i, NEXT_R0, NEXT_W0, NEXT_H0, 0.0, scene)


@njit(error_model="numpy")
def law_of(a, i, row, laws, since):
    """Return a law and its derivatives from the rows of its reference, which begin at i."""
    omega = laws[row, OMEGA] if laws[row, KIND] == FOURIER else 0.0
    g1, g2, g0 = turns(omega, since)
    return law(a[i], a[i + LANES], a[i + 2 * LANES], a[i + 3 * LANES], omega, g1, g2, g0)


@njit(error_model="numpy")
def set_laws(a, i, r_row, w_row, h_row, since, scene):
    """Write a lane's laws at a time after its reference."""
    r, r1, r2 = law_of(a, R_REF + i, RADIUS, scene.laws, since)
    w, w1, w2 = law_of(a, N_REF + i, WIDTH, scene.laws, since)
    h, h1, h2 = law_of(a, H_REF + i, DEPTH, scene.laws, since)
    if scene.is_relative:
        w, w1, w2 = w * r, fma(w1, r, w * r1), fma(w2, r, fma(w, r2, 2.0 * w1 * r1))
    a[r_row + i], a[r_row + LANES + i], a[r_row + 2 * LANES + i] = r, r1, r2
    a[w_row + i], a[w_row + LANES + i], a[w_row + 2 * LANES + i] = w, w1, w2
    a[h_row + i], a[h_row + LANES + i], a[h_row + 2 * LANES + i] = h, h1, h2


@njit(error_model="numpy")
def load(a, i, particle, stop, is_first_kept):
    """Put a particle into a lane; its laws are unknown there, so its first step will be careful."""
    for row in range(N_ROWS):
        a[row * LANES + i] = 0.0
    a[T + i], a[T_LOW + i] = particle.t, particle.t_low
    a[X + i], a[Y + i], a[VX + i], a[VY + i] = particle.x, particle.y, particle.vx, particle.vy
    a[WALL + i] = particle.wall
    # Any stay serves, or none until the mouth has narrowed.
    any_serves = -NEVER if is_first_kept else NEVER
    a[STOP + i], a[SINCE + i], a[UNTIL + i] = stop, any_serves, -any_serves
    a[STAY_IN + i] = a[STAY_OUT + i] = a[CLOSED + i] = NEVER
    a[END + i] = -NEVER


@njit(error_model="numpy")
def change_lane(a, i, b, j):
    """Copy lane i of one pool to lane j of another."""
    for row in range(N_ROWS):
        b[row * LANES + j] = a[row * LANES + i]


@njit(error_model="numpy")
def fold(a, i, scene):
    """Bring an unfolded particle back to y >= 0, with the laws that the disk has no use for."""
    if a[Y + i] < 0.0:
        a[Y + i] = -a[Y + i]
        a[VY + i] = -a[VY + i]
    a[SPIN + i] = 0.0
    a[WALL + i] = ON_ARC
    since = (a[T + i] - a[REF + i]) + (a[T_LOW + i] - a[REF_LOW + i])
    set_laws(a, i, R0, W0, H0, since, scene)


@njit(error_model="numpy")
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


@njit(error_model="numpy")
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


@njit(error_model="numpy")
def note_stay(a, i, roster, stops, followed):
    """Record a captured stay that is over."""
    at = roster[NEXT_STOP, i]
    while stops.cycles[at] < 0:  # the last stop ends a cycle
        at += 1
    keep_stay(roster[PARTICLE, i], stops.cycles[at], a[STAY_IN + i], a[CLOSED + i], stops, followed)
    a[STAY_IN + i] = a[STAY_OUT + i] = a[CLOSED + i] = NEVER
    if stops.is_first_kept:
        a[UNTIL + i] = -NEVER  # no other is wanted


@njit(error_model="numpy")
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


@njit(error_model="numpy")
def refold(a, i):
    """Bring an unfolded particle of a cap back to y >= 0, on the arc if it was unfolded at all."""
    if a[Y + i] < 0.0:
        a[Y + i], a[VY + i] = -a[Y + i], -a[VY + i]
    if a[SPIN + i] != 0.0:
        a[WALL + i] = ON_ARC
    a[SPIN + i] = 0.0


@njit(error_model="numpy", inline="always")
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


@njit(error_model="numpy")
def advance(pool, a, n, is_again, scene, limits, omegas):
    """Find the next collision of the n lanes of a pool.

    Args:
        pool: GENERAL, or DISK for lanes that move unfolded from arc to arc.
        a: the pool's rows.
        n: how many lanes are in use.
        is_again: correct the times found before once more, in place of a new guess.
        scene, limits: the scene, and what holds of it for all time.
        omegas: None where all laws share their frequency; numba then leaves out the slower loops.
    """
    table, is_relative, omega, m = (
        scene.table,
        scene.is_relative,
        scene.laws[SHARED, OMEGA],
        scene.laws[SLOPE, LEVEL],
    )
    if pool == DISK:
        if omegas is None:
            chord(a, n, is_again, table == CAP, is_relative, omega, limits, omegas)
        else:
            chord_mixed(a, n, is_again, table == CAP, is_relative, omega, limits, omegas)
        return
    if not is_again:
        aim(a, n, table == STEM, m, limits)
    if omegas is None:
        fly(a, n, table == STEM, is_relative, omega, m, limits, omegas)
    else:
        fly_mixed(a, n, table == STEM, is_relative, omega, m, limits, omegas)


@njit(error_model="numpy")
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


@njit(error_model="numpy")
def attend(pool, a, i, roster, worker):
    """Do for a lane what `advance` could not; returns whether it stays, moves to the other pool or ends."""
    scene, stops, followed = worker.scene, worker.stops, worker.followed
    end = stops.times[-1]
    if a[CLOSED + i] < NEVER:
        note_stay(a, i, roster, stops, followed)
    if pool == GENERAL and a[SPIN + i] != 0.0 and worker.is_laned:
        return MOVES
    is_known = worker.is_laned and a[END + i] > -NEVER
    if is_known and a[OK + i] == RIGHT_ONE and a[NEXT_T + i] < a[KNOT + i]:
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


@njit(error_model="numpy")
def are_calm(a, n):
    """Tell whether no lane of a pool needs attention: mostly so, and seen in one packed loop."""
    least = 1.0
    for i in range(n):
        least = min(least, a[CALM + i])
    return least > 0.0


@njit(error_model="numpy")
def change_place(worker, pool, i, other, j):
    """Copy a lane and its entry in the roster to another place."""
    change_lane(worker.pools[pool], i, worker.pools[other], j)
    worker.rosters[other, PARTICLE, j] = worker.rosters[pool, PARTICLE, i]
    worker.rosters[other, NEXT_STOP, j] = worker.rosters[pool, NEXT_STOP, i]


@njit(error_model="numpy", inline="always")
def scan(pool, worker):
    """Attend to every lane of a pool that needs it; the last lane fills the place of one that leaves."""
    a, roster, n_held = worker.pools[pool], worker.rosters[pool], worker.n_held
    i = np.int64(0)
    while i < n_held[pool]:
        fate = STAYS
        if not (a[CALM + i] > 0.0 and worker.is_laned):
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


@njit(error_model="numpy", inline="always")
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
            if not (worker.is_laned and are_calm(a, n_held[pool])):
                if worker.is_laned:
                    correct(pool, a, n_held[pool], pools[SPARE], scene, worker.limits, omegas)
                scan(pool, worker)
            if pool == GENERAL:
                bounce(a, n_held[pool], scene.laws[SLOPE, LEVEL], scene.table == MUSHROOM)
            else:
                rebound(a, n_held[pool])
