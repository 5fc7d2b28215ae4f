"""Many particles in lock step: each loop below is branch-free, and the compiler vectorises it.

Idea. Particles sit side by side in lanes. `aim` (fast.kernel.aiming) picks every lane's wall and guesses the
time; `fly` corrects that once, and checks; `bounce` (fast.kernel.bounces) reflects. `chord` and `rebound` do
the same for captured particles, unfolded through the base. A lane whose step is not shown right by the checks
is left to the careful step (fast.kernel.follow).

Laws. A lane knows them in one of two forms: fast.kernel.lane_laws. A slope that stands still is passed as
`slope`; where that is None the slope moves, and its rows are read.

What a lane's step claims, and which inequality in which line carries it, for every kind of flight and every
wall on it, rounding included: docs/lanes.md. In short: Newton leaves less than 2^-57 of the time;
a wall that is not met has f > K s^2 at the end, so that f was positive all along; the wall that is met has
|f'| > K s, or f is concave. A flight costs two divisions and one square root.
"""

from __future__ import annotations

from typing import NamedTuple

from fast.kernel.aiming import aim, cube_of_arc, outset_of, side_curvature, side_rate
from fast.kernel.arithmetic import SAFETY, fma, short_sum, two_product, two_sum
from fast.kernel.bounces import (
    ONE,
    count_hit,
    off_the_arc_spinning,
    off_the_wall,
    stay_after,
)
from fast.kernel.compiling import packed, part, widest_registers
from fast.kernel.lane_laws import (
    LawsAt,
    laws_in,
    look_ahead,
    move_laws,
    radius_since,
    room_ahead,
)

from fast.kernel.pools import (  # isort: skip
    AHEAD, COARSE, END, FAR, FATE, HIT, LATE, MARKED, MAX_CORRECTIONS, MOVED, NEVER, N_ARC, N_BASE, ON_ARC,
    ON_BASE, ON_FLOOR, ON_LEFT, ON_RIGHT, R0, REFUSED, S, SPIN, STAY, STOP, SURE, T, TRIES, T_LOW, VX, VY,
    WALL, WHEN, X, Y,
)  # fmt: skip
from fast.kernel.records import Place


@packed
def moved(x, v, s):
    """Return x + v s as a sum of two floats."""
    p, e = two_product(v, s)
    x_s, low = two_sum(x, p)
    return x_s, low + e


@packed
def place_after(s, x, y, vx, vy):
    """Return the place a time s after (x, y)."""
    x_s, x_low = moved(x, vx, s)
    y_s, y_low = moved(y, vy, s)
    return Place(x_s, x_low, y_s, y_low)


class Judged(NamedTuple):
    """A time of flight and its correction, how far the laws used hold beyond it, and what is known of it."""

    s: float
    delta: float
    within: float
    result: float


@part
def at_side_or_floor(hit, outset, place, stem, slope):
    """Return f and f' of the side or the floor that is met."""
    (_, _, vx, vy, _, _, _), (x_s, x_low, y_s, y_low) = outset, place
    w, m = stem.w, stem.m
    sign = 1.0 if hit == ON_RIGHT else -1.0
    f = (w - sign * x_s) + fma(m, y_s, fma(m, y_low, fma(-sign, x_low, stem.w_low)))
    rate = fma(-sign, vx, fma(m, vy, side_rate(y_s, stem, slope)))
    f = (y_s + stem.h) + y_low if hit == ON_FLOOR else f
    rate = vy + stem.h1 if hit == ON_FLOOR else rate
    return f, rate


@part
def told_slope(hit, m, vx, vy, limits):
    """Be above 0 where rounding of a moving slope turns a bounce little more than that of the state."""
    steepest = limits.lean - 1.0
    aslant = min(abs(vy) - steepest * abs(vx), abs(vx) - steepest * abs(vy))
    told = max(abs(m) - 0.25 * steepest, aslant)
    return told if hit >= ON_LEFT and hit != ON_FLOOR else 1.0


@part
def hop_along_arc(s, outset, r0, dr):
    """Return f of the arc that was left, by its increments since, of which `dr` is the radius's."""
    return fma(dr, fma(2.0, r0, dr), -s * fma(s, outset.v2, 2.0 * outset.q))


@part
def arc_sizes(s, outset, r, limits):
    """Return the summed sizes of the terms of half the slope of the arc's function."""
    x, y, vx, vy, _, _, v2 = outset
    return fma(abs(x), abs(vx), fma(abs(y), abs(vy), fma(s, v2, r * limits.rate)))


@part
def left_in_place(error, hit, vx, vy, r):
    """Return `error` of docs/lanes.md, infinite where the place on the arc is not as well known as the time.

    That is so after flights that are many radii long.
    """
    return NEVER if hit == ON_ARC and error * (abs(vx) + abs(vy)) > 16.0 * r else error


@part
def told_rate(r, sizes, limits):
    """Return `told` of docs/lanes.md: positive where a hop hangs on r' no more than on what enters."""
    return fma(-r, limits.rate + limits.arc_rate, sizes)


@part
def slack_of(s, f_error, delta, inverse, error):
    """Return `slack` of docs/lanes.md: how far off s a certain hit may be, f being known to `f_error`."""
    slack = fma(f_error, abs(inverse), abs(delta))
    return slack if error < s else 0.0


@part
def far_enough(s, outset, k_side, slack, blur, limits):
    """Return by how much a function of docs/lanes.md must be positive where a flight ends: `clear`."""
    far = fma(k_side * s, s, blur)
    return fma(fma(limits.lean, abs(outset.vy), abs(outset.vx)) + limits.rate, slack, far)


@part
def clearance(hit, place, stem, far):
    """Return `clear` of docs/lanes.md: how far inside the walls below that are not met a flight ends."""
    (x_s, _, y_s, _), w, h, m = place, stem.w, stem.h, stem.m
    edge = fma(m, y_s, w)
    clear_r = edge - x_s if hit != ON_RIGHT else NEVER
    clear_l = edge + x_s if hit != ON_LEFT else NEVER
    clear_f = y_s + h if hit != ON_FLOOR else NEVER
    return min(clear_r, min(clear_l, clear_f)) - far


@part
def place_on_wall(hit, outset, end, r, is_stem, slack, blur):
    """Return `place` of docs/lanes.md: positive where the wall met is met in its own part of the table.

    The arc is met above y = 0, sides and floor below it, the base inside the arc.
    """
    place = end.y if hit == ON_ARC else -end.y
    place -= fma(abs(outset.vy), slack, blur)
    inside = (r - abs(end.x)) - blur
    inside = 1.0 if is_stem else inside
    return inside if hit == ON_BASE else place


@part
def way_out(hit, s, outset, slope, k_side, sizes, limits):
    """Return `first` of docs/lanes.md: positive where the wall is met on the way out."""
    vx, vy = outset.vx, outset.vy
    first = -slope - fma(k_side, s, SAFETY * (fma(limits.lean, abs(vy), abs(vx)) + limits.rate))
    first = fma(-2.0 * SAFETY, sizes, -slope) if hit == ON_ARC else first
    return 1.0 if hit == ON_BASE else first


@part
def verdict(quality, ahead, s, error, tries):
    """Return what is known of a flight: LATE for a right one, COARSE, REFUSED, which nan comes to, or FAR."""
    result = COARSE if tries < MAX_CORRECTIONS else REFUSED
    result = LATE if error < s else result
    result = result if quality > 0.0 else REFUSED
    result = result if s < NEVER else REFUSED
    return FAR if ahead <= 0.0 else result


@part
def laws_at_hit(there, delta):
    """Return the laws at a hit, `delta` after the end that was guessed; of what a bounce asks for."""
    w, h = fma(there.w1, delta, there.w), fma(there.h1, delta, there.h)
    r, m = fma(there.r1, delta, there.r), fma(there.m1, delta, there.m)
    r1, w1 = fma(there.r2, delta, there.r1), fma(there.w2, delta, there.w1)
    h1, m1 = fma(there.h2, delta, there.h1), fma(there.m2, delta, there.m1)
    return LawsAt(r, r1, there.r2, there.r3, w, 0.0, w1, there.w2, h, h1, there.h2, m, m1, there.m2)


@packed
def land(a, i, table, waves, slope, degree, limits):
    """Correct a lane's time of flight once, and tell whether the step is then right; if so, take it."""
    is_stem, is_mushroom, _, is_relative = table
    bend = limits.bend
    outset, hit, s = outset_of(a, i), a[HIT + i], a[S + i]
    x, y, vx, vy, wall, q, v2 = outset
    there = laws_in(a, AHEAD + i, waves, is_relative, slope, degree)
    r0, dr, known = radius_since(a, i, s, waves, degree)
    r, r1 = there.r, there.r1
    k_side = side_curvature(vy, slope, limits)
    end = place_after(s, x, y, vx, vy)
    x_s, x_low, y_s, y_low = end
    f, rate = at_side_or_floor(hit, outset, end, there, slope)
    # The arc: its increments if it was left, else what is there.
    hop = hop_along_arc(s, outset, r0, dr)
    f_arc = fma(-2.0, fma(x_s, x_low, y_s * y_low), fma(-x_s, x_s, (r - y_s) * (r + y_s)))
    f_arc = hop if wall == ON_ARC else f_arc
    f = f_arc if hit == ON_ARC else f
    rate = 2.0 * fma(r, r1, -fma(s, v2, q)) if hit == ON_ARC else rate
    half_bend = bend + v2 if hit == ON_ARC else 0.5 * k_side
    f = y_s + y_low if hit == ON_BASE else f
    rate = vy if hit == ON_BASE else rate
    half_bend = 0.0 if hit == ON_BASE else half_bend
    inverse = ONE / rate
    delta = -f * inverse
    error = error_left(half_bend * inverse, s, delta, waves)
    error = left_in_place(error, hit, vx, vy, r)
    sizes = arc_sizes(s, outset, r, limits)
    blur = SAFETY * fma(abs(vx) + abs(vy), s, limits.size + abs(x) + abs(y))
    slack = slack_of(s, blur * (16.0 * r) if hit == ON_ARC else blur, delta, inverse, error)
    # The others are not reached: see the error analysis. The mouth was looked at.
    clear = clearance(hit, end, there, far_enough(s, outset, k_side, slack, blur, limits))
    quality = min(a[SURE + i], clear if hit >= (ON_ARC if is_stem else ON_LEFT) else 1.0)
    place = place_on_wall(hit, outset, end, r, is_stem, slack, blur)
    first = way_out(hit, s, outset, rate, k_side, sizes, limits)
    quality = min(min(quality, place), min(first, s))
    # The arc's function must be concave, and a bounce hang on a rate no more than on what enters.
    pushed = (abs(vy) if hit == ON_FLOOR else abs(vx)) - limits.rate if hit >= ON_LEFT else 1.0
    quality = min(quality, min(v2 - bend, pushed))
    if slope is None:
        quality = min(quality, told_slope(hit, there.m, vx, vy, limits))
    # A hop needs the radius at both of its ends, and its rate as well as what enters.
    known = min(known, told_rate(r, sizes, limits))
    known = known if hit == ON_ARC else 1.0
    quality = min(quality, known if wall == ON_ARC else 1.0)
    within, ahead = room_ahead(a, i, s, delta, waves)
    result = verdict(quality, min(within, ahead), s, error, a[TRIES + i])
    flight = Judged(s, delta, within, result)
    is_moved, at_hit = settle(a, i, flight, outset, end, there, is_mushroom, slope)
    if is_moved:
        move_laws(a, i, delta, at_hit, waves, slope)


@packed
def settle(a, i, flight, outset, end, there, is_mushroom, slope):
    """Bounce off the wall that was met; returns whether the particle moves on, and the laws at the hit."""
    hit, vx, vy, v2 = a[HIT + i], outset.vx, outset.vy, outset.v2
    t, t_low, at, at_hit, is_moved = arrive(a, i, flight, outset, end, there)
    at = Place(at.x, at.x_low, 0.0 if hit == ON_BASE else at.y, at.y_low)
    vx_s, vy_s = off_the_wall(hit, at, vx, vy, at_hit, slope)
    stay = stay_after(a[STAY + i], hit, at, (vx, vy, v2), at_hit.w) if is_mushroom else a[STAY + i]
    is_quiet = stay == a[STAY + i]
    if is_moved:
        count_hit(a, i, hit)
        a[STAY + i], a[WALL + i] = stay, hit
    move(a, i, flight, is_moved, is_quiet, (t, t_low, at.x, at.y, vx_s, vy_s))
    return is_moved, at_hit


@part
def arrive(a, i, flight, outset, end, there):
    """Return time, place and laws at the end of a flight, and whether the particle moves on to there."""
    t, low = two_sum(a[T + i], flight.s)
    t, t_low = short_sum(t, low + (a[T_LOW + i] + flight.delta))
    x_s, x_low = short_sum(end.x, fma(outset.vx, flight.delta, end.x_low))
    y_s, y_low = short_sum(end.y, fma(outset.vy, flight.delta, end.y_low))
    is_moved = t < a[STOP + i] if flight.result == LATE else False
    return t, t_low, Place(x_s, x_low, y_s, y_low), laws_at_hit(there, flight.delta), is_moved


@packed
def move(a, i, flight, is_moved, is_quiet, state):
    """Take a state for the present one, where the particle moves on, and write what became of the flight."""
    s, delta, within, result = flight
    t, t_low, x, y, vx, vy = state
    fate = MOVED if t < a[END + i] else MARKED
    fate = fate if is_quiet else MARKED
    a[FATE + i] = fate if is_moved else result
    a[WHEN + i] = t
    a[S + i] = s + delta if within > 0.0 else s  # from laws out of their reach nothing is learnt
    tries = a[TRIES + i] + 1.0
    a[TRIES + i] = tries if result == COARSE else (tries if result == FAR else 0.0)
    if is_moved:
        a[T + i], a[T_LOW + i], a[X + i], a[Y + i], a[VX + i], a[VY + i] = t, t_low, x, y, vx, vy


@packed
def error_left(curvature, s, delta, waves):
    """Return `error` of docs/lanes.md, from f'' / (2 f')."""
    left = abs(curvature)
    if waves is not None:  # sine and cosine after delta are taken to first order
        left = fma(0.0625 * waves.omega * waves.omega, s, left)
    return 2.0**58 * left * delta * delta


@packed
def fly(a, n, table, waves, slope, degree, limits):
    """Find the next collision of each lane, and take the step where it is shown right."""
    widest_registers()
    is_stem, _, _, is_relative = table
    for i in range(n):
        aim(a, i, is_stem, is_relative, waves, slope, degree, limits)
    for i in range(n):
        look_ahead(a, i, a[S + i], waves, is_relative, slope, degree)
    for i in range(n):
        land(a, i, table, waves, slope, degree, limits)


@packed
def chord(a, n, table, waves, slope, degree, limits):
    """Find the next arc hit of captured particles: the base is unfolded, |L| is constant.

    The chord keeps the distance |L| / v from the centre; while that exceeds w the mouth is out of reach.
    """
    widest_registers()
    bend, k_w, size = limits.bend, limits.curvature, limits.size
    _, _, is_cap, is_relative = table
    for i in range(n):
        outset, now = outset_of(a, i), laws_in(a, R0 + i, waves, is_relative, slope, degree)
        inverse = ONE / (outset.v2 - fma(now.r1, now.r1, now.r * now.r2))
        s = 2.0 * fma(now.r, now.r1, -outset.q) * inverse
        s = s * fma(cube_of_arc(now.r, now.r1, now.r2, now.r3) * s, inverse, 1.0)
        a[S + i] = a[S + i] if a[TRIES + i] > 0.0 else s
        a[SURE + i] = now.w
    for i in range(n):
        look_ahead(a, i, a[S + i], waves, is_relative, slope, degree)
    for i in range(n):
        outset, spin = outset_of(a, i), a[SPIN + i]
        x, y, vx, vy, _, q, v2 = outset
        s = a[S + i]
        there = laws_in(a, AHEAD + i, waves, is_relative, slope, degree)
        r, r1, w = there.r, there.r1, there.w
        r0, dr, known = radius_since(a, i, s, waves, degree)
        f = hop_along_arc(s, outset, r0, dr)
        rate = 2.0 * fma(r, r1, -fma(s, v2, q))
        inverse = ONE / rate
        delta = -f * inverse
        error = error_left((bend + v2) * inverse, s, delta, waves)
        end = place_after(s, x, y, vx, vy)
        # The widest that the mouth can be during the flight, from both ends.
        reach = max(a[SURE + i], w) + fma(k_w * s, s, SAFETY * size)
        clear = spin * spin - (1.0 + 4.0 * SAFETY) * reach * reach * v2
        clear = 1.0 if is_cap else clear
        sizes = arc_sizes(s, outset, r, limits)
        first = -rate - 2.0 * SAFETY * sizes
        slack = slack_of(s, 2.0 * SAFETY * s * sizes, delta, inverse, error)
        place = abs(end.y) - fma(abs(vy), fma(SAFETY, s, slack), SAFETY * abs(y))
        quality = min(min(clear, place), min(first, v2 - bend))
        quality = min(min(quality, s), known)
        quality = min(quality, told_rate(r, sizes, limits))
        within, ahead = room_ahead(a, i, s, delta, waves)
        result = verdict(quality, min(within, ahead), s, error, a[TRIES + i])
        flight = Judged(s, delta, within, result)
        t, t_low, at, at_hit, is_moved = arrive(a, i, flight, outset, end, there)
        # The angular momentum of the whole stay is constant to the bit.
        vx_s, vy_s = off_the_arc_spinning(at, vx, vy, at_hit.r, at_hit.r1, spin)
        # A chord that crosses y = 0 hits the base.
        crossed = 1.0 if y * at.y < 0.0 else 0.0
        if is_moved:
            a[N_ARC + i] += 1.0
            a[N_BASE + i] += crossed
        move(a, i, flight, is_moved, True, (t, t_low, at.x, at.y, vx_s, vy_s))
        if is_moved:
            move_laws(a, i, delta, at_hit, waves, slope)
