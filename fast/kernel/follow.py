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

import numpy as np

from fast.kernel.arithmetic import fma
from fast.kernel.bounces import arrive
from fast.kernel.codes import ANEW, ARC, CAP, HORIZON, MUSHROOM, N_WALLS, TOO_FAR
from fast.kernel.compiling import kernel, part
from fast.kernel.flights import OFF, advance, collide, correct
from fast.kernel.judged import KNOWN
from fast.kernel.kept import keep_lane, take_lane
from fast.kernel.loops import run_careful

from fast.kernel.pools import (  # isort: skip
    AS_GIVEN, CERTAIN, CLOSED, DONE, END, HIT, LANES, NEVER, NEXT_R0, NEXT_T, NEXT_T_LOW, NEXT_VX, NEXT_VY,
    NEXT_W0, NEXT_X, NEXT_Y, N_ARC, N_BASE, N_FLOOR, N_LEFT, N_RIGHT, OK, ON_ARC, PIECE, ROUTINE, S, SINCE,
    SPIN, STAY_IN, STAY_OUT, STOP, STRIDE, T, T_LOW, UNTIL, VX, VY, WALL, X, Y, change_lane, fold, load,
    refold, set_laws, set_reference, whole_registers,
)  # fmt: skip
from fast.kernel.records import RADIUS, VALUE, WIDTH, Particle, particle_at, write_state
from fast.kernel.worker import DISK, GENERAL, NEXT_STOP, PARTICLE

STAYS, MOVES, ENDS = 0, 1, 2


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
def finish(pool, a, i, j, code, end, followed):
    """Write down a particle's end: at the last stop for HORIZON, else where trouble met it.

    In the disk a particle is unfolded, whatever its spin: in a cap that may be 0.
    """
    t, t_low, x, y, vx, vy = a[T + i], a[T_LOW + i], a[X + i], a[Y + i], a[VX + i], a[VY + i]
    if code == HORIZON:
        dt = (end - t) - t_low
        t, t_low = end, 0.0
        x, y_end = fma(vx, dt, x), fma(vy, dt, y)
        if pool == DISK and a[WALL + i] == ON_ARC:  # the base may lie between
            if y * y_end < 0.0:
                a[N_BASE + i] += 1.0
            if y_end < 0.0:
                y_end, vy = -y_end, -vy
        y = y_end
    write_state(followed.states, j, Particle(t, t_low, x, y, vx, vy, int(a[WALL + i])))
    followed.codes[j] = code
    if code != HORIZON and followed.lanes.shape[1] > 0:
        followed.lanes[j] = np.nan  # nothing goes on from there
    for wall in range(N_WALLS):
        followed.counts[j, wall] = int(a[N_ARC + wall * STRIDE + i])


@part
def has_met_another(a, i):
    """Tell whether a lane's particle has met any wall but the arc."""
    return a[N_BASE + i] + a[N_LEFT + i] + a[N_RIGHT + i] + a[N_FLOOR + i] > 0.0


@kernel
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
        limit = (stops.times[-1] - t) - t_low
        code, s, p = run_careful(worker.loops.careful, (p, limit, KNOWN, scene, anchors))
        followed.careful[roster[PARTICLE, i]] += 1
        a[NEXT_T + i], a[NEXT_T_LOW + i] = p.t, p.t_low
        a[NEXT_X + i], a[NEXT_Y + i], a[NEXT_VX + i], a[NEXT_VY + i] = p.x, p.y, p.vx, p.vy
        a[HIT + i], a[DONE + i], a[S + i] = code, 1.0, s
        if code != ARC or a[WALL + i] != ON_ARC or has_met_another(a, i):
            a[AS_GIVEN + i] = 0.0
        if code < HORIZON:
            set_reference(a, i, p.t, p.t_low, scene, worker.pieces, worker.degree)
            set_laws(a, i, NEXT_R0, p.t, p.t_low, scene, worker.degree)
            w = anchors[WIDTH, VALUE]  # known where the lanes know nothing
            a[NEXT_W0 + i] = w * anchors[RADIUS, VALUE] if scene.is_relative else w
        if pool == GENERAL or code >= HORIZON:
            break
        note_stops(a, i, roster, p.t, stops, followed)
        if code == ARC:
            a[N_ARC + i] += 1.0
            a[SPIN + i] = p.x * p.vy - p.y * p.vx
            # It goes on unfolded, from arc to arc, and nothing else says so: its laws may be lost where a
            # guess of the next flight's time lies beyond all pieces.
            a[WALL + i] = ON_ARC
            break
        a[N_BASE + i] += 1.0
        arrive(a, i, None)
        a[VX + i], a[VY + i] = p.vx, p.vy
    return code


@part
def keep_up_laws(a, i, worker):
    """Give a lane the piece of the laws that serves at its next collision, where its own does no longer."""
    t, t_low = a[NEXT_T + i], a[NEXT_T_LOW + i]
    if t >= a[END + i]:
        set_reference(a, i, t, t_low, worker.scene, worker.pieces, worker.degree)


@part
def collisions_of(a, i):
    """Return how many collisions a lane's particle has had."""
    total = 0.0
    for wall in range(N_WALLS):
        total += a[N_ARC + wall * STRIDE + i]
    return total


@kernel
def attend(pool, a, i, roster, worker):
    """Do for a lane what `advance` could not; returns whether it stays, moves to the other pool or ends.

    Who has had too many collisions is given up: energy may grow without end.
    """
    scene, stops, followed = worker.scene, worker.stops, worker.followed
    end = stops.times[-1]
    if a[CLOSED + i] < NEVER:
        note_stay(a, i, roster, stops, followed)
    if pool == GENERAL and a[SPIN + i] != 0.0 and worker.is_laned:
        return MOVES
    is_certain = worker.is_laned and a[END + i] > -NEVER and a[OK + i] == CERTAIN
    if not is_certain and pool == DISK and scene.table == MUSHROOM:
        fold(a, i, scene, worker.pieces, worker.degree)
        return MOVES
    if followed.lanes.shape[1] > 0 and not (is_certain and a[NEXT_T + i] < end):
        keep_lane(pool, a, i, roster, is_certain, worker)  # it may end here
    if is_certain:
        keep_up_laws(a, i, worker)
        code = int(a[HIT + i])
    else:
        code = step_carefully(pool, a, i, roster, worker)
    if code < HORIZON:
        note_stops(a, i, roster, a[NEXT_T + i], stops, followed)
        code = HORIZON
        if worker.n_passed <= roster[NEXT_STOP, i] < stops.times.shape[0]:
            if collisions_of(a, i) <= stops.most:
                return STAYS
            code = int(TOO_FAR)
            if pool == DISK:
                refold(a, i)
    elif code == HORIZON:
        note_stops(a, i, roster, end, stops, followed)
    if roster[NEXT_STOP, i] < worker.n_passed:
        # Put back, it does not pass all stops again: the last had come within rounding of a collision, or the
        # careful step, which now looks further, is undecided. A run at once would have written otherwise.
        code = ANEW
    finish(pool, a, i, roster[PARTICLE, i], code, end, followed)
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
def needs_a_piece_alone(pool, a, i, roster, worker):
    """Tell whether all that `attend` would do for a lane is to give it the next piece of the laws.

    As `fly` and `chord` have it in ROUTINE, but for END: no stay ends, no pool changes, and no stop comes
    before the collision, the last one neither, so that nothing is noted or kept.
    Where laws are quick that is so for every few flights, and a call of `attend` takes longer than a flight.
    After a period's first piece it is called all the same, which counts collisions: so often is enough, and
    counting them here, for every piece, made the loop around all this slower by a tenth.
    """
    is_certain = a[OK + i] == CERTAIN and a[END + i] > -NEVER and worker.n_passed <= roster[NEXT_STOP, i]
    return (
        is_certain
        and a[PIECE + i] > 0.0
        and a[CLOSED + i] == NEVER
        and a[NEXT_T + i] < a[STOP + i]
        and (pool == DISK or a[SPIN + i] == 0.0)
    )


@part
def scan(pool, worker):
    """Attend to every lane of a pool that needs it; the last lane fills the place of one that leaves."""
    a, roster, n_held = worker.pools[pool], worker.rosters[pool], worker.n_held
    i = np.int64(0)
    while i < n_held[pool]:
        fate = STAYS
        if not (a[ROUTINE + i] > 0.0 and worker.is_laned):
            if worker.is_laned and needs_a_piece_alone(pool, a, i, roster, worker):
                keep_up_laws(a, i, worker)
            else:
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
def put_back(worker, pool, first, last):
    """Put kept particles back into their pool, up to one of the other pool; returns the next one's number.

    They come between a flight and its bounce, with the step found before or in want of a careful one.
    """
    n_held, is_ours = worker.n_held, True
    while is_ours and first < last and n_held[GENERAL] + n_held[DISK] < LANES:
        i = n_held[pool]
        place = take_lane(worker.pools[pool], i, worker.rosters[pool], first, worker)
        is_ours = place == pool or place < 0
        if is_ours:
            first += 1
        if place == pool:
            n_held[pool] += 1
    return first


@kernel
def follow(worker, walls):
    """Follow particles to the last stop.

    Args:
        worker: it holds no particle yet; its `followed.states` are the particles' starts, or are not looked
            at where particles go on from `followed.lanes`.
        walls: codes of the walls that the particles leave (N,).
    """
    scene, stops, pools, n_held = worker.scene, worker.stops, worker.pools, worker.n_held
    states = worker.followed.states
    first, last = 0, states.shape[0]
    home, is_resumed = DISK if scene.table == CAP else GENERAL, worker.n_passed > 0
    while stops.called_off[0] == 0:
        while not is_resumed and n_held[GENERAL] + n_held[DISK] < LANES and first < last:
            i = n_held[home]
            load(
                pools[home], i, particle_at(states, first, walls[first]), stops.times[0], stops.is_first_kept
            )
            pools[home][AS_GIVEN + i] = 1.0 if walls[first] == ARC else 0.0
            worker.rosters[home, PARTICLE, i], worker.rosters[home, NEXT_STOP, i] = first, 0
            n_held[home] += 1
            first += 1
        if n_held[GENERAL] + n_held[DISK] == 0 and first == last:
            break
        for pool in (GENERAL, DISK):
            a = pools[pool]
            if n_held[pool] == 0 and not is_resumed:
                continue
            n = whole_registers(n_held[pool])
            advance(pool, a, n, OFF, worker)
            if is_resumed and first < last:
                first = put_back(worker, pool, first, last)
                n = whole_registers(n_held[pool])
            if not (worker.is_laned and are_routine(a, n_held[pool])):
                if worker.is_laned:
                    correct(pool, a, n_held[pool], worker)
                scan(pool, worker)
            collide(pool, a, n, worker)
