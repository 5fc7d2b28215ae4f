"""Following particles: lanes where they are shown right, the scalar step elsewhere.

Many particles are followed to given times (`follow_particles`). One particle from collision to collision is
the subject of fast.kernel.path. A worker holds LANES particles in two pools: `general` for any collision, and
`disk` for captured particles, whose base bounces are counted and not stepped; a cap has the disk alone. Every
particle's numbers depend on that particle only, so threads, chunks and lane positions do not change a bit.

Particles are looked at where their flight passes a *stop*: an instant at which the energy is wanted, a cycle
ends or nu has a local minimum. A capture interval is recorded in the slot of each minimum that it spans,
which keeps out the many brief crossings of the edge |sin phi| = nu. A lane cannot hold all minima, and one is
enough: an interval spans some minimum exactly when it spans the first after its begin. SINCE = UNTIL is that
one, or the last that has passed while there is none.

A run can go on with later stops. A last state does not do for that: it lies in the middle of a flight, and a
flight that begins there is rounded otherwise than the one that passes. Kept is the lane as `attend` meets it,
before it moves on. Its flight is found again, to the same bits: that depends on the lane alone. The piece of
the laws is kept by its number and reference time. It is not always the one that serves at the lane's time: a
flight that ran out of its piece was given another in mid-flight.
"""

import numpy as np

from fast.kernel import rows
from fast.kernel.arithmetic import dot, fma
from fast.kernel.compiling import HOW, kept, kernel, part
from fast.kernel.lane_laws import know_laws, set_piece, set_reference
from fast.kernel.lanes import count_hit, stay_after

from fast.kernel.records import (  # isort: skip
    ARC, CAP, FOLLOW_ANEW, HORIZON, MUSHROOM, N_WALLS, RADIUS, TOO_FAR, VALUE, WIDTH, Particle,
    is_hit, is_lost, particle_at, write_state,
)  # fmt: skip
from fast.kernel.rows import copy_rows, load, particle_of, put_particle, refold, whole_registers
from fast.kernel.scalar_step import KNOWN
from fast.kernel.worker import DISK, GENERAL, NEXT_STOP, PARTICLE, run_careful, run_step

# Columns of what is kept: the pool, the number of the next stop, scalar steps so far, whether the lanes know
# the laws; then the rows of the pool up to W0_LOW.
POOL, NEXT, CAREFUL, IS_KNOWN = np.arange(4)
FIRST_ROW = 4
LANE_ROWS = FIRST_ROW + int(rows.W0_LOW // rows.STRIDE)


@kernel
def keep_lane(pool, a, i, roster, is_known, worker):
    """Keep a lane as it is before it is attended to; of its laws what its form has."""
    j, followed = roster[PARTICLE, i], worker.followed
    out = followed.lanes[j]
    out[:] = 0.0
    out[POOL], out[NEXT], out[CAREFUL] = pool, roster[NEXT_STOP, i], followed.careful[j]
    out[IS_KNOWN] = 1.0 if is_known else 0.0
    last = rows.REF
    if is_known:
        last = rows.R1 + rows.STRIDE if worker.laws.is_waves else rows.W0_LOW
    for k in range(last // rows.STRIDE):
        out[FIRST_ROW + k] = a[k * rows.STRIDE + i]


@kernel
def take_lane(a, i, roster, j, worker):
    """Put a kept particle into a lane, before it is attended to."""
    kept = worker.followed.lanes[j]
    for row in range(rows.N_ROWS):
        a[row * rows.STRIDE + i] = 0.0
    roster[PARTICLE, i], roster[NEXT_STOP, i] = j, int(kept[NEXT])
    worker.followed.careful[j] = int(kept[CAREFUL])
    for k in range(rows.W0_LOW // rows.STRIDE):
        a[k * rows.STRIDE + i] = kept[FIRST_ROW + k]
    a[rows.STAY + i] = rows.CAPTURED if a[rows.STAY_OUT + i] == rows.NEVER else rows.OVER
    if a[rows.STAY_IN + i] == rows.NEVER:
        a[rows.STAY + i] = rows.NOT_YET
    a[rows.STOP + i], a[rows.END + i] = -rows.NEVER, -rows.NEVER
    if kept[IS_KNOWN] > 0.0:
        if worker.laws.is_waves:
            a[rows.END + i] = rows.NEVER
        else:
            set_piece(a, i, int(a[rows.PIECE + i]), worker.laws)


STAYS, MOVES, ENDS = 0, 1, 2


@part
def keep_stay(j, cycle, begin, end, stops, followed):
    """Keep a capture interval in the slot of each minimum of nu that it spans, or as the first interval."""
    t_in, t_out = followed.t_in, followed.t_out
    for slot in range(stops.mouth_minima.shape[1]):
        if stops.is_first_kept:
            is_kept = np.isnan(t_in[j, cycle, slot])
        else:
            is_kept = begin <= stops.mouth_minima[cycle, slot] <= end
        if is_kept:
            t_in[j, cycle, slot], t_out[j, cycle, slot] = begin, end


@kernel
def note_stops(a, i, roster, last, stops, followed):
    """Record for a lane's particle what is asked for at the stops up to the time `last`."""
    j, at = roster[PARTICLE, i], roster[NEXT_STOP, i]
    times = stops.times
    while at < times.shape[0] and times[at] <= last:
        begin, end = a[rows.STAY_IN + i], a[rows.STAY_OUT + i]
        column = stops.columns[at]
        if column >= 0:
            vx, vy = a[rows.VX + i], a[rows.VY + i]
            followed.energies[j, column] = 0.5 * (vx * vx + vy * vy)
            followed.is_captured[j, column] = begin < rows.NEVER and end == rows.NEVER
        elif begin == rows.NEVER or a[rows.UNTIL + i] < begin:
            a[rows.SINCE + i] = a[rows.UNTIL + i] = times[at]
        if stops.cycles[at] >= 0 and begin < rows.NEVER:
            keep_stay(j, stops.cycles[at], begin, min(end, times[at]), stops, followed)
        at += 1
    roster[NEXT_STOP, i] = at


@part
def note_stay(a, i, roster, stops, followed):
    """Bring a lane's capture interval up to date with its last hit, and record it where it is over."""
    stay, t, begin = a[rows.STAY + i], a[rows.T + i], a[rows.STAY_IN + i]
    end = min(a[rows.STAY_OUT + i], t)
    if stay >= rows.CAPTURED:
        a[rows.STAY + i], a[rows.STAY_IN + i], a[rows.STAY_OUT + i] = rows.CAPTURED, min(begin, t), rows.NEVER
    elif stay == rows.OVER:
        a[rows.STAY_OUT + i] = end
    elif begin < rows.NEVER:
        if begin <= a[rows.UNTIL + i] and a[rows.SINCE + i] <= end:
            at = roster[NEXT_STOP, i]
            while stops.cycles[at] < 0:  # the last stop ends a cycle
                at += 1
            keep_stay(roster[PARTICLE, i], stops.cycles[at], begin, end, stops, followed)
            if stops.is_first_kept:
                a[rows.UNTIL + i] = -rows.NEVER  # no other is wanted
        a[rows.STAY_IN + i] = a[rows.STAY_OUT + i] = rows.NEVER


@part
def finish(pool, a, i, j, code, end, followed):
    """Write down a particle's end: at the last stop for HORIZON, else where trouble met it.

    In the disk a particle is unfolded, whatever its spin: in a cap that may be 0.
    """
    t, t_low, x, y, vx, vy, wall = particle_of(a, i)
    if code == HORIZON:
        dt = (end - t) - t_low
        t, t_low = end, 0.0
        x, y_end = fma(vx, dt, x), fma(vy, dt, y)
        if pool == DISK and a[rows.WALL + i] == rows.ON_ARC:  # the base may lie between
            if y * y_end < 0.0:
                a[rows.N_BASE + i] += 1.0
            if y_end < 0.0:
                y_end, vy = -y_end, -vy
        y = y_end
    write_state(followed.states, j, Particle(t, t_low, x, y, vx, vy, wall))
    followed.codes[j] = code
    if code != HORIZON and followed.lanes.shape[1] > 0:
        followed.lanes[j] = np.nan  # nothing goes on from there
    for wall in range(N_WALLS):
        followed.counts[j, wall] = int(a[rows.N_ARC + wall * rows.STRIDE + i])


@kernel
def advance(pool, a, n, worker):
    """Take a step of the first n lanes of a pool, whole registers of them, where it is shown right."""
    loop = worker.loops.chord if pool == DISK else worker.loops.fly
    laws = worker.laws
    run_step(loop, (a, n, laws.scene, laws.waves, laws.slope, laws.limits))


@part
def set_stop(a, i, since, roster, worker):
    """Tell a lane when `attend` is to look at it next: never later than a period after the time `since`."""
    times, at, pieces = worker.stops.times, roster[NEXT_STOP, i], worker.laws.pieces
    stop = min(since + pieces.period, pieces.until)
    a[rows.STOP + i] = min(stop, times[at]) if at < times.shape[0] else stop


@kernel
def careful_flight(a, i, worker):
    """Find a lane's next collision carefully; returns what `careful_step` does."""
    p = particle_of(a, i)
    limit = (worker.stops.times[-1] - p.t) - p.t_low
    return run_careful(worker.loops.careful, (p, limit, KNOWN, worker.laws.scene, worker.anchors))


@kernel
def land_carefully(pool, a, i, code, s, p, worker):
    """Move a lane to the collision that a scalar step has found; the anchors hold the laws there."""
    scene, hit = worker.laws.scene, float(code)
    if code != ARC or a[rows.WALL + i] != rows.ON_ARC:  # it has left the arc by now
        a[rows.AS_GIVEN + i] = 0.0
    if worker.laws.scene.table == MUSHROOM:
        w, vx, vy = worker.anchors[WIDTH, VALUE], a[rows.VX + i], a[rows.VY + i]
        if scene.is_relative:
            w *= worker.anchors[RADIUS, VALUE]
        a[rows.STAY + i] = stay_after(a[rows.STAY + i], hit, p, (vx, vy, fma(vx, vx, vy * vy)), w)
    if pool == DISK:
        a[rows.SPIN + i] = p.x * p.vy - p.y * p.vx
    count_hit(a, i, hit)
    put_particle(a, i, p)
    a[rows.WALL + i], a[rows.S + i], a[rows.TRIES + i] = hit, s, 0.0
    if worker.is_laned:
        know_laws(a, i, 0.0, worker.laws)


@kernel
def step_carefully(pool, a, i, roster, worker):
    """Take a lane's next step carefully, in the disk up to the arc; returns the last code.

    HORIZON: the next collision is at the last stop or later, and the lane is where it was.
    """
    stops, followed = worker.stops, worker.followed
    if pool == DISK:
        refold(a, i)
    while True:
        code, s, p = careful_flight(a, i, worker)
        followed.careful[roster[PARTICLE, i]] += 1
        if is_lost(code):
            return code
        # Rounded, the time at the horizon may be before it.
        note_stops(a, i, roster, stops.times[-1] if code == HORIZON else p.t, stops, followed)
        if code == HORIZON or roster[NEXT_STOP, i] == stops.times.shape[0]:
            return np.int64(HORIZON)
        land_carefully(pool, a, i, code, s, p, worker)
        if pool == GENERAL or code == ARC:
            return code


@part
def collisions_of(a, i):
    """Return how many collisions a lane's particle has had."""
    total = 0.0
    for wall in range(N_WALLS):
        total += a[rows.N_ARC + wall * rows.STRIDE + i]
    return total


@part
def knows_laws(a, i, worker):
    """Tell whether the lanes may take a particle's next step."""
    return worker.is_laned and a[rows.END + i] > -rows.NEVER and a[rows.AS_GIVEN + i] == 0.0


@kernel
def mark(pool, a, i, since, roster, worker):
    """Note what came with a lane's move; returns whether it stays or moves to the other pool.

    Its flight was looked at up to the time `since`.
    """
    is_clearly_captured = a[rows.STAY + i] == rows.CLEARLY
    note_stay(a, i, roster, worker.stops, worker.followed)
    if a[rows.T + i] >= a[rows.END + i] and a[rows.END + i] > -rows.NEVER:
        set_reference(a, i, a[rows.T + i], a[rows.T_LOW + i], worker.laws)
    if knows_laws(a, i, worker):
        set_stop(a, i, since, roster, worker)
    else:
        a[rows.STOP + i] = -rows.NEVER
    if pool == GENERAL and is_clearly_captured and worker.is_laned:
        a[rows.SPIN + i] = dot(a[rows.X + i], a[rows.VY + i], -a[rows.Y + i], a[rows.VX + i])
        return MOVES
    return STAYS


@kernel
def code_of_attention(pool, a, i, roster, worker):
    """Take a lane past stops, or a scalar step; returns the code of its end, or ARC for none."""
    stops, followed, end = worker.stops, worker.followed, worker.stops.times[-1]
    is_late = knows_laws(a, i, worker) and a[rows.FATE + i] == rows.LATE
    if followed.lanes.shape[1] > 0 and not (is_late and a[rows.WHEN + i] < end):
        # It may end here. A step that was refused is kept as one of unknown laws: tried again, from another
        # piece, it may be shown right, and then other bits would follow than in a run at once.
        keep_lane(pool, a, i, roster, is_late, worker)
    code = ARC
    if is_late:
        note_stops(a, i, roster, a[rows.WHEN + i], stops, followed)
        if roster[NEXT_STOP, i] == stops.times.shape[0]:
            code = HORIZON
        if not a[rows.WHEN + i] < worker.laws.pieces.until:
            a[rows.END + i] = -rows.NEVER
    else:
        code = step_carefully(pool, a, i, roster, worker)
        code = ARC if is_hit(code) else code
    if roster[NEXT_STOP, i] < worker.n_passed:
        # Put back, it does not pass all stops again: the last had come within rounding of a collision, or the
        # scalar step, which now looks further, is undecided. A run at once would have written otherwise.
        return np.int64(FOLLOW_ANEW)
    if code == ARC and collisions_of(a, i) > stops.most:
        if pool == DISK:
            refold(a, i)
        return np.int64(TOO_FAR)
    return np.int64(code)


@kernel
def attend(pool, a, i, roster, worker):
    """Do for a lane what `advance` could not; returns whether it stays, moves to the other pool or ends.

    A particle with too many collisions is given up: energy may grow without end.
    """
    fate, knows = a[rows.FATE + i], knows_laws(a, i, worker)
    if knows and fate == rows.MARKED:
        return mark(pool, a, i, a[rows.T + i], roster, worker)
    if (
        knows and fate == rows.FAR and a[rows.TRIES + i] <= rows.MAX_CORRECTIONS
    ):  # the piece at the flight's end
        t = a[rows.T + i] + a[rows.S + i]
        set_reference(a, i, t, a[rows.T_LOW + i], worker.laws)
        if a[rows.END + i] > -rows.NEVER:
            return STAYS
    if pool == DISK and worker.laws.scene.table == MUSHROOM and not (knows and fate == rows.LATE):
        refold(a, i)
        a[rows.WALL + i], a[rows.TRIES + i] = rows.ON_ARC, 0.0
        return MOVES
    # A flight that takes longer than a period was looked at up to its end; else it would be again and again.
    flown = a[rows.WHEN + i] if knows and fate == rows.LATE else -rows.NEVER
    code = code_of_attention(pool, a, i, roster, worker)
    if code != ARC:
        finish(pool, a, i, roster[PARTICLE, i], code, worker.stops.times[-1], worker.followed)
        return ENDS
    return mark(pool, a, i, max(flown, a[rows.T + i]), roster, worker)


@part
def last_to_attend(a, n):
    """Return the last of n lanes that needs attention, -1 for none, as is mostly so; one packed loop."""
    last = np.int64(-1)
    for i in range(n):
        last = max(last, np.int64(i) if a[rows.FATE + i] < rows.MOVED else np.int64(-1))
    return last


@part
def change_place(worker, pool, i, other, j):
    """Copy a lane and its entry in the roster to another place; without coefficients where laws are waves."""
    last = rows.LAWS if worker.laws.is_waves else rows.POOL_SIZE
    copy_rows(worker.pools[pool], i, worker.pools[other], j, rows.T, last)
    worker.rosters[other, PARTICLE, j] = worker.rosters[pool, PARTICLE, i]
    worker.rosters[other, NEXT_STOP, j] = worker.rosters[pool, NEXT_STOP, i]


@part
def scan(pool, worker):
    """Attend to every lane of a pool that needs it; the last lane fills the place of one that leaves."""
    a, roster, n_held, other = worker.pools[pool], worker.rosters[pool], worker.n_held, 1 - pool
    i = last_to_attend(a, n_held[pool])
    while i >= 0:
        fate = attend(pool, a, i, roster, worker)
        if fate == MOVES:
            a[rows.FATE + i] = rows.MOVED  # of a flight in the other pool nothing is known yet
            change_place(worker, pool, i, other, n_held[other])
            n_held[other] += 1
        if fate != STAYS:
            n_held[pool] -= 1
            change_place(worker, pool, n_held[pool], pool, i)
        i = last_to_attend(a, i)


@part
def take_in(worker, j, wall):
    """Put a particle into the next lane: from its start, or as it was kept."""
    n_held, followed = worker.n_held, worker.followed
    home = DISK if worker.laws.scene.table == CAP else GENERAL
    if worker.n_passed > 0 and not followed.lanes[j, 0] >= 0.0:
        followed.codes[j] = FOLLOW_ANEW
        return
    if worker.n_passed > 0:
        home = DISK if followed.lanes[j, 0] > 0.0 else GENERAL
        take_lane(worker.pools[home], n_held[home], worker.rosters[home], j, worker)
    else:
        i = n_held[home]
        load(worker.pools[home], i, particle_at(followed.states, j, wall), worker.stops.is_first_kept)
        worker.rosters[home, PARTICLE, i], worker.rosters[home, NEXT_STOP, i] = j, 0
    n_held[home] += 1


@kept(nogil=True, **HOW)
def follow_particles(worker, walls):
    """Follow particles to the last stop. Threads may call it side by side.

    Args:
        worker: it holds no particle yet; its `followed.states` are the particles' starts, or are not looked
            at where particles go on from `followed.lanes`.
        walls: codes of the walls that the particles leave (N,).
    """
    pools, n_held = worker.pools, worker.n_held
    first, last = 0, worker.followed.states.shape[0]
    while worker.stops.called_off[0] == 0:
        while n_held[GENERAL] + n_held[DISK] < rows.LANES and first < last:
            take_in(worker, first, walls[first])
            first += 1
        if n_held[GENERAL] + n_held[DISK] == 0:
            break
        for pool in (GENERAL, DISK):
            n = n_held[pool]
            if n > 0 and worker.is_laned:
                advance(pool, pools[pool], whole_registers(n), worker)
            scan(pool, worker)
