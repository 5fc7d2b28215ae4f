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
from numba import njit

from fast.kernel.arithmetic import MAX_QUADRANT, SAFETY, TWO_OVER_PI, fma
from fast.kernel.careful import first_step

from fast.kernel.codes import (  # isort: skip
    ARC, BANG_BANG, CAP, FOURIER, H, HORIZON, M, MUSHROOM, N_WALLS, PHASES, R, STEM, W,
)  # fmt: skip
from fast.kernel.lanes import (  # isort: skip
    CALM, CLOSED, COARSE, DONE, END, H0, HIT, H_REF, KNOT, LANES, NEVER, NEXT_H0, NEXT_R0, NEXT_T, NEXT_T_LOW,
    NEXT_VX, NEXT_VY, NEXT_W0, NEXT_X, NEXT_Y, N_ARC, N_BASE, N_REF, N_ROWS, OK, ON_ARC, R0, REF, REF_LOW,
    RIGHT_ONE, R_REF, S, SINCE, SPIN, STAY_IN, STAY_OUT, STOP, T, T_LOW, UNTIL, VX, VY, W0, WALL, X, Y,
    aim, arrive, bounce, chord, chord_mixed, fly, fly_mixed, rebound,
)  # fmt: skip
from fast.kernel.laws import ANCHORS_SHAPE, LOW, ROOM, bend_of_half_leg, set_anchors
from fast.kernel.limits import limits_of
from fast.kernel.short import law, turns

GENERAL, DISK = np.arange(2)
STAYS, MOVES, ENDS = 0, 1, 2
POOL_SIZE = N_ROWS * LANES
SERVES = 0.125  # omega times how long a reference serves for starting a flight
REFERENCES = (R_REF, N_REF, H_REF)


@njit(error_model="numpy")
def has_lanes(table, laws, last):
    """Tell whether the lanes know these laws, up to the time `last`."""
    if laws[M, 0] != 0.0:
        return False
    for row in (R, W, H):
        if laws[row, 0] == FOURIER and laws[row, 3] != 1.0:
            return False
        if laws[row, 0] == BANG_BANG and not abs(last) < MAX_QUADRANT * laws[row, 2]:
            return False
    return abs(last) * laws[PHASES, 0] * TWO_OVER_PI < 0.5 * MAX_QUADRANT


@njit(error_model="numpy")
def set_reference(a, i, laws, anchors, is_relative):
    """Make the time of a lane's next state the reference of its laws, and give it their values there."""
    t, end, knot = a[NEXT_T + i], NEVER, NEVER
    a[REF + i], a[REF_LOW + i] = t, a[NEXT_T_LOW + i]
    for k, row in enumerate((R, W, H)):
        f, rate, bend = anchors[row, 0], anchors[row, 1], 0.0
        if laws[row, 0] == FOURIER:
            bend = -laws[row, 2] * laws[row, 2] * (f - laws[row, 1])
            end = min(end, t + SERVES / laws[row, 2])
        elif laws[row, 0] == BANG_BANG:
            bend = bend_of_half_leg(laws, row, int(anchors[row, 2]))
            # Rounded down: a flight that ends before it ends before the half-leg does.
            knot = min(knot, (t + anchors[row, ROOM]) - SAFETY * (abs(t) + anchors[row, ROOM]))
        place = REFERENCES[k] + i
        a[place], a[place + LANES] = f, anchors[row, LOW]
        a[place + 2 * LANES], a[place + 3 * LANES] = rate, bend
    a[END + i], a[KNOT + i] = min(end, knot), knot
    set_laws(a, i, NEXT_R0, NEXT_W0, NEXT_H0, 0.0, laws, is_relative)


@njit(error_model="numpy")
def law_of(a, i, row, laws, since):
    """Return a law and its derivatives from the rows of its reference, which begin at i."""
    omega = laws[row, 2] if laws[row, 0] == FOURIER else 0.0
    g1, g2, g0 = turns(omega, since)
    return law(a[i], a[i + LANES], a[i + 2 * LANES], a[i + 3 * LANES], omega, g1, g2, g0)


@njit(error_model="numpy")
def set_laws(a, i, r_row, w_row, h_row, since, laws, is_relative):
    """Write a lane's laws at a time after its reference."""
    r, r1, r2 = law_of(a, R_REF + i, R, laws, since)
    w, w1, w2 = law_of(a, N_REF + i, W, laws, since)
    h, h1, h2 = law_of(a, H_REF + i, H, laws, since)
    if is_relative:
        w, w1, w2 = w * r, fma(w1, r, w * r1), fma(w2, r, fma(w, r2, 2.0 * w1 * r1))
    a[r_row + i], a[r_row + LANES + i], a[r_row + 2 * LANES + i] = r, r1, r2
    a[w_row + i], a[w_row + LANES + i], a[w_row + 2 * LANES + i] = w, w1, w2
    a[h_row + i], a[h_row + LANES + i], a[h_row + 2 * LANES + i] = h, h1, h2


@njit(error_model="numpy")
def load(a, i, p, wall, stop, is_first_kept):
    """Put a particle into a lane; its laws are unknown there, so its first step will be careful."""
    for row in range(N_ROWS):
        a[row * LANES + i] = 0.0
    a[T + i], a[T_LOW + i] = p[0], p[1]
    a[X + i], a[Y + i], a[VX + i], a[VY + i] = p[2], p[3], p[4], p[5]
    a[WALL + i] = wall
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
def fold(a, i, laws, is_relative):
    """Bring an unfolded particle back to y >= 0, with the laws that the disk has no use for."""
    if a[Y + i] < 0.0:
        a[Y + i] = -a[Y + i]
        a[VY + i] = -a[VY + i]
    a[SPIN + i] = 0.0
    a[WALL + i] = ON_ARC
    since = (a[T + i] - a[REF + i]) + (a[T_LOW + i] - a[REF_LOW + i])
    set_laws(a, i, R0, W0, H0, since, laws, is_relative)


@njit(error_model="numpy")
def keep_stay(t_in, t_out, j, cycle, stops, begin, end):
    """Keep a captured stay in the slot of each narrowing of a cycle that it spans, or as the first stay."""
    narrowings, is_first_kept = stops[3], stops[4]
    for slot in range(narrowings.shape[1]):
        if is_first_kept:
            is_kept = np.isnan(t_in[j, cycle, slot])
        else:
            is_kept = begin <= narrowings[cycle, slot] <= end
        if is_kept:
            t_in[j, cycle, slot], t_out[j, cycle, slot] = begin, end


@njit(error_model="numpy")
def note_stops(a, i, j, at, last, stops, out):
    """Record what is asked for at the stops up to the time `last`; returns the next stop's number."""
    times, columns, cycles, _, _ = stops
    energies, is_captured, t_in, t_out = out
    while at < times.shape[0] and times[at] <= last:
        begin, end = a[STAY_IN + i], a[STAY_OUT + i]
        column = columns[at]
        if column >= 0:
            energies[j, column] = 0.5 * (a[VX + i] * a[VX + i] + a[VY + i] * a[VY + i])
            is_captured[j, column] = begin < NEVER and end == NEVER
        elif begin == NEVER or a[UNTIL + i] < begin:
            a[SINCE + i] = a[UNTIL + i] = times[at]
        if cycles[at] >= 0 and begin < NEVER:
            keep_stay(t_in, t_out, j, cycles[at], stops, begin, min(end, times[at]))
        at += 1
    a[STOP + i] = times[at] if at < times.shape[0] else NEVER
    return at


@njit(error_model="numpy")
def note_stay(a, i, j, at, stops, out):
    """Record a captured stay that is over."""
    cycles, is_first_kept = stops[2], stops[4]
    while cycles[at] < 0:  # the last stop ends a cycle
        at += 1
    keep_stay(out[2], out[3], j, cycles[at], stops, a[STAY_IN + i], a[CLOSED + i])
    a[STAY_IN + i] = a[STAY_OUT + i] = a[CLOSED + i] = NEVER
    if is_first_kept:
        a[UNTIL + i] = -NEVER  # no other is wanted


@njit(error_model="numpy")
def take_careful_step(scene, a, i, anchors, p, end):
    """Find a lane's next collision carefully; returns its code. The lane then needs no bounce."""
    table, is_relative, laws, bounds = scene
    p[0], p[1] = a[T + i], a[T_LOW + i]
    p[2], p[3], p[4], p[5] = a[X + i], a[Y + i], a[VX + i], a[VY + i]
    limit = (end - p[0]) - p[1]
    code, s = first_step(table, is_relative, laws, bounds, anchors, p, int(a[WALL + i]), limit)
    a[NEXT_T + i], a[NEXT_T_LOW + i] = p[0], p[1]
    a[NEXT_X + i], a[NEXT_Y + i], a[NEXT_VX + i], a[NEXT_VY + i] = p[2], p[3], p[4], p[5]
    a[HIT + i] = code
    a[DONE + i] = 1.0
    a[S + i] = s
    if code < HORIZON:
        set_reference(a, i, laws, anchors, is_relative)
    return code


@njit(error_model="numpy")
def finish(a, i, j, code, end, states, codes, counts):
    """Write down a particle's end: at the last stop for HORIZON, else where trouble met it."""
    x, y, vx, vy = a[X + i], a[Y + i], a[VX + i], a[VY + i]
    states[j, 0], states[j, 1] = a[T + i], a[T_LOW + i]
    if code == HORIZON:
        dt = (end - a[T + i]) - a[T_LOW + i]
        states[j, 0], states[j, 1] = end, 0.0
        x, y_end = fma(vx, dt, x), fma(vy, dt, y)
        if a[SPIN + i] != 0.0:
            # Unfolded: the base may lie between.
            if y * y_end < 0.0:
                a[N_BASE + i] += 1.0
            if y_end < 0.0:
                y_end, vy = -y_end, -vy
        y = y_end
    states[j, 2], states[j, 3], states[j, 4], states[j, 5] = x, y, vx, vy
    codes[j] = code
    for wall in range(N_WALLS):
        counts[j, wall] = int(a[N_ARC + wall * LANES + i])


@njit(error_model="numpy")
def step_to_arc(scene, a, i, anchors, p, j, whom, stops, out, n_careful):
    """Take careful steps in a cap until one ends on the arc; returns the last code."""
    if a[Y + i] < 0.0:
        a[Y + i], a[VY + i] = -a[Y + i], -a[VY + i]
    if a[SPIN + i] != 0.0:
        a[WALL + i] = ON_ARC
    a[SPIN + i] = 0.0
    while True:
        code = take_careful_step(scene, a, i, anchors, p, stops[0][-1])
        n_careful[j] += 1
        if code >= HORIZON:
            return code
        whom[1, i] = note_stops(a, i, j, whom[1, i], a[NEXT_T + i], stops, out)
        if code == ARC:
            a[N_ARC + i] += 1.0
            a[SPIN + i] = a[NEXT_X + i] * a[NEXT_VY + i] - a[NEXT_Y + i] * a[NEXT_VX + i]
            return code
        a[N_BASE + i] += 1.0
        arrive(a, i)
        a[VX + i], a[VY + i] = a[NEXT_VX + i], a[NEXT_VY + i]


@njit(error_model="numpy")
def next_flight(a, n, is_stem, is_relative, omega, m, limits):
    """Call the loop over flights that these laws need."""
    if limits.has_knots and omega > 0.0:
        fly_mixed(a, n, is_stem, is_relative, omega, m, limits)
    else:
        fly(a, n, is_stem, is_relative, omega, m, limits)


@njit(error_model="numpy")
def next_chord(a, n, is_again, is_cap, is_relative, omega, limits):
    """Call the loop over chords that these laws need."""
    if limits.has_knots and omega > 0.0:
        chord_mixed(a, n, is_again, is_cap, is_relative, omega, limits)
    else:
        chord(a, n, is_again, is_cap, is_relative, omega, limits)


@njit(error_model="numpy")
def correct_more(pool, scene, a, i, spare, limits):
    """Correct a coarse step until it is right, a few times, in a pool of its own."""
    table, is_relative, laws, _ = scene
    if a[OK + i] != COARSE:
        return
    change_lane(a, i, spare, np.int64(0))
    for _ in range(3):
        if pool == DISK:
            next_chord(spare, np.int64(1), np.bool_(True), table == CAP, is_relative, laws[PHASES, 0], limits)
        else:
            next_flight(spare, np.int64(1), table == STEM, is_relative, laws[PHASES, 0], laws[M, 1], limits)
        if spare[OK] != COARSE:
            break
    change_lane(spare, np.int64(0), a, i)


@njit(error_model="numpy")
def attend(pool, scene, is_laned, a, i, spare, whom, anchors, p, stops, out, ends, limits):
    """Do for a lane what its tick could not; returns whether it stays, moves to the other pool or ends."""
    states, codes, counts, n_careful = ends
    table, is_relative, laws, _ = scene
    end, j = stops[0][-1], whom[0, i]
    if a[CLOSED + i] < NEVER:
        note_stay(a, i, j, whom[1, i], stops, out)
    if pool == GENERAL and a[SPIN + i] != 0.0 and is_laned:
        return MOVES
    is_known = is_laned and a[END + i] > -NEVER
    if is_known:
        correct_more(pool, scene, a, i, spare, limits)
    if is_known and a[OK + i] == RIGHT_ONE and a[NEXT_T + i] < a[KNOT + i]:
        if a[NEXT_T + i] >= a[END + i]:
            set_anchors(laws, anchors, a[NEXT_T + i], a[NEXT_T_LOW + i])
            set_reference(a, i, laws, anchors, is_relative)
        code = int(a[HIT + i])
    elif pool == DISK and table == MUSHROOM:
        fold(a, i, laws, is_relative)
        return MOVES
    elif pool == DISK:
        code = step_to_arc(scene, a, i, anchors, p, j, whom, stops, out, n_careful)
    else:
        code = take_careful_step(scene, a, i, anchors, p, end)
        n_careful[j] += 1
    if code < HORIZON:
        whom[1, i] = note_stops(a, i, j, whom[1, i], a[NEXT_T + i], stops, out)
        if whom[1, i] < stops[0].shape[0]:
            return STAYS
        code = HORIZON
    elif code == HORIZON:
        note_stops(a, i, j, whom[1, i], end, stops, out)
    finish(a, i, j, code, end, states, codes, counts)
    return ENDS


@njit(error_model="numpy")
def are_calm(a, n):
    """Tell whether no lane of a pool needs attention: mostly so, and seen in one packed loop."""
    least = 1.0
    for i in range(n):
        least = min(least, a[CALM + i])
    return least > 0.0


@njit(error_model="numpy")
def scan(pool, scene, is_laned, pools, whoms, n, anchors, p, stops, out, ends, limits):
    """Attend to every lane of a pool that needs it; the last lane fills the place of one that leaves."""
    a, whom = pools[pool], whoms[pool]
    i = np.int64(0)
    while i < n[pool]:
        if a[CALM + i] > 0.0 and is_laned:
            i += 1
            continue
        fate = attend(pool, scene, is_laned, a, i, pools[2], whom, anchors, p, stops, out, ends, limits)
        if fate == STAYS:
            i += 1
            continue
        if fate == MOVES:
            other = 1 - pool
            change_lane(a, i, pools[other], n[other])
            whoms[other, :, n[other]] = whom[:, i]
            n[other] += 1
        n[pool] -= 1
        change_lane(a, n[pool], a, i)
        whom[:, i] = whom[:, n[pool]]


@njit(error_model="numpy")
def follow(scene, walls, stops, out, ends):
    """Follow particles to the last stop.

    Args:
        scene: table, is_relative, laws, bounds.
        walls: codes of the walls that the particles leave (N,).
        stops: see fast.starts.Stops.
        out: energies (N, C), is_captured (N, C), by the stops' columns; t_in (N, K, M), t_out (N, K, M);
            filled in.
        ends: states (N, 6): t, its low part, x, y, vx, vy, overwritten; codes (N,), counts (N, 5),
            careful steps (N,), filled in.
    """
    states = ends[0]
    first, last = 0, states.shape[0]
    table, is_relative, laws, bounds = scene
    is_laned = has_lanes(table, laws, stops[0][-1])
    home = DISK if table == CAP else GENERAL
    pools = np.zeros((3, POOL_SIZE))  # general, disk, and one to correct single lanes in
    whoms = np.zeros((2, 2, LANES), dtype=np.int64)
    n = np.zeros(2, dtype=np.int64)
    anchors, p = np.zeros(ANCHORS_SHAPE), np.zeros(6)
    omega, m, is_stem = laws[PHASES, 0], laws[M, 1], table == STEM
    limits = limits_of(laws, bounds)
    general, disk = pools[GENERAL], pools[DISK]
    while True:
        while n[0] + n[1] < LANES and first < last:
            load(pools[home], n[home], states[first], walls[first], stops[0][0], stops[4])
            whoms[home, 0, n[home]], whoms[home, 1, n[home]] = first, 0
            n[home] += 1
            first += 1
        if n[0] + n[1] == 0:
            break
        if n[GENERAL] > 0:
            aim(general, n[GENERAL], is_stem, m, limits)
            next_flight(general, n[GENERAL], is_stem, is_relative, omega, m, limits)
            if not (is_laned and are_calm(general, n[GENERAL])):
                scan(GENERAL, scene, is_laned, pools, whoms, n, anchors, p, stops, out, ends, limits)
            bounce(general, n[GENERAL], m, table == MUSHROOM)
        if n[DISK] > 0:
            next_chord(disk, n[DISK], np.bool_(False), table == CAP, is_relative, omega, limits)
            if not (is_laned and are_calm(disk, n[DISK])):
                scan(DISK, scene, is_laned, pools, whoms, n, anchors, p, stops, out, ends, limits)
            rebound(disk, n[DISK])
