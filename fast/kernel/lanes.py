"""Many particles in lock step: each loop below is branch-free, and the compiler vectorises it.

Idea. Particles sit side by side in lanes. `aim` (fast.kernel.aiming) picks every lane's wall and guesses the
time; `fly` corrects that once, and checks; `bounce` (fast.kernel.bounces) reflects. `chord` and `rebound` do
the same for captured particles, unfolded through the base. A lane whose step is not shown right by the checks
is left to the careful step (fast.kernel.follow).

Laws. Every law is a short polynomial about the lane's reference time, whatever its kind: fast.kernel.pieces.
A slope that stands still is passed as `slope`; where that is None the slope moves, and its rows are read.

What a lane's step claims, and which inequality in which line carries it, for every kind of flight and every
wall on it, rounding included: docs/lanes.md. In short: Newton leaves less than 2^-57 of the time;
a wall that is not met has f > K s^2 at the end, so that f was positive all along; the wall that is met has
|f'| > K s, or f is concave. A flight costs two divisions and one square root.
"""

from __future__ import annotations

from typing import NamedTuple

from fast.kernel.ahead import cap_ahead, cap_at_hit, stem_ahead, stem_at_hit, stem_there
from fast.kernel.aiming import ONE, cube_of_arc, outset_of, side_curvature
from fast.kernel.arithmetic import SAFETY, fma, two_sum
from fast.kernel.compiling import packed, part, widest_registers

from fast.kernel.pools import (  # isort: skip
    BACK, BEFORE, CERTAIN, CLOSED, COARSE, END, FAR, HIT, LIMIT, MEAN_RATE, NEVER, NEXT_R0, NEXT_R1, NEXT_R2,
    NEXT_T, NEXT_T_LOW, NEXT_W0, NEXT_W1, NEXT_X, NEXT_X_LOW, NEXT_Y, NEXT_Y_LOW, OK, ON_ARC, ON_BASE,
    ON_FLOOR, ON_LEFT, ON_RIGHT, R0, R1, R2, R3, REFUSED, ROUTINE, S, SPIN, STOP, SURE, T, T_LOW, W0,
)  # fmt: skip
from fast.kernel.short import place_after, short_sum


class Correction(NamedTuple):
    """Newton's correction of a time, with 1 / f', and the error that it leaves, times 2^57 at least."""

    delta: float
    inverse: float
    error: float


@part
def at_side_or_floor(hit, outset, place, stem):
    """Return f and f' of the side or the floor that is met."""
    (_, _, vx, vy, _, _, _), (x_s, x_low, y_s, y_low) = outset, place
    w, w_low, w1, _, h, h1, _, m, m1, _ = stem
    sign = 1.0 if hit == ON_RIGHT else -1.0
    f = (w - sign * x_s) + (fma(m, y_s, w_low) + fma(m, y_low, -sign * x_low))
    slope = fma(m, vy, fma(m1, y_s, w1)) - sign * vx
    f = (y_s + h) + y_low if hit == ON_FLOOR else f
    slope = vy + h1 if hit == ON_FLOOR else slope
    return f, slope


@part
def hop_along_arc(s, outset, r0, dr):
    """Return f of the arc that was left, by its increments since, of which `dr` is the radius's."""
    return dr * (2.0 * r0 + dr) - s * fma(s, outset.v2, 2.0 * outset.q)


@part
def arc_sizes(s, outset, r, limits):
    """Return the summed sizes of the terms of half the slope of the arc's function."""
    x, y, vx, vy, _, _, v2 = outset
    return abs(x * vx) + abs(y * vy) + fma(s, v2, r * limits.rate)


@part
def left_in_place(error, hit, vx, vy, r):
    """Return `error` of docs/lanes.md, infinite where the place on the arc is not as well known as the time.

    That is so after flights that are many radii long.
    """
    return NEVER if hit == ON_ARC and error * (abs(vx) + abs(vy)) > 16.0 * r else error


@part
def told_rate(t, r, r1, r2, sizes, limits):
    """Return `told` of docs/lanes.md: positive where a hop hangs on r' no more than on what enters."""
    return (sizes - r * limits.rate) + r * (abs(r1) + abs(t * r2) - limits.arc_rate)


@part
def told_push(hit, t, outset, y_s, stem, limits):
    """Return `pushed` of docs/lanes.md: positive where a bounce hangs on a rate no more than on what enters.

    Of sides and floor; the arc is met by nobody slower than it.
    """
    _, _, vx, vy, _, _, _ = outset
    _, _, w1, w2, _, h1, h2, _, m1, m2 = stem
    rate = h1 if hit == ON_FLOOR else fma(m1, y_s, w1)
    bend = h2 if hit == ON_FLOOR else fma(m2, y_s, w2)
    told = (abs(vx) + abs(vy)) + (abs(rate) + abs(t * bend)) - limits.rate
    told = 1.0 if abs(rate) + abs(bend) == 0.0 else told
    return told if hit >= ON_LEFT else 1.0


@part
def slack_of(hit, wall, s, correction, r, sizes, blur):
    """Return `slack` of docs/lanes.md: how far off s a certain hit may be."""
    delta, inverse, error = correction
    f_error = 2.0 * SAFETY * s * sizes if wall == ON_ARC else 2.0 * r * blur
    f_error = f_error if hit == ON_ARC else blur
    f_error = 0.0 if hit == ON_BASE else f_error
    slack = fma(f_error, abs(inverse), abs(delta))
    return slack if error < s else 0.0


@part
def far_enough(s, outset, k_side, slack, blur, limits):
    """Return by how much a function of docs/lanes.md must be positive where a flight ends: `clear`."""
    far = k_side * s * s + blur
    return fma(abs(outset.vx) + limits.lean * abs(outset.vy) + limits.rate, slack, far)


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
def place_on_wall(hit, s, outset, end, r, is_stem, slack, limits):
    """Return `place` of docs/lanes.md: positive where the wall met is met in its own part of the table.

    The arc is met above y = 0, sides and floor below it, the base inside the arc.
    """
    (x, y, vx, vy, _, _, v2), (x_s, _, y_s, _) = outset, end
    place = y_s if hit == ON_ARC else -y_s
    place -= SAFETY * (abs(y) + abs(vy) * s) + abs(vy) * slack
    excess = limits.bend - v2
    excess = excess if excess > 0.0 else 0.0
    size_w = limits.size
    inside = r - abs(x_s) - SAFETY * (size_w + abs(x) + abs(vx) * s)
    inside = fma(inside, limits.least_r, -2.0 * excess * s * s)
    inside = 1.0 if is_stem else inside
    return inside if hit == ON_BASE else place


@part
def way_out(hit, s, outset, slope, k_side, sizes, limits):
    """Return `first` of docs/lanes.md: positive where the wall is met on the way out."""
    vx, vy = outset.vx, outset.vy
    first = -slope - (k_side * s + SAFETY * (abs(vx) + limits.lean * abs(vy) + limits.rate))
    first = -slope - 2.0 * SAFETY * sizes if hit == ON_ARC else first
    return 1.0 if hit == ON_BASE else first


@part
def verdict(quality, ahead, s, error):
    """Return what is known of a step: CERTAIN, COARSE, REFUSED, which nan comes to as well, or FAR."""
    result = CERTAIN if error < s else COARSE
    result = result if quality > 0.0 else REFUSED
    result = result if s < NEVER else REFUSED
    return FAR if ahead <= 0.0 else result


@packed
def arrive_at(a, i, outset, s, delta, within, result, place):
    """Write what became of a step, with time and place of the hit; returns y there, and ROUTINE so far."""
    (_, _, vx, vy, _, _, _), (x_s, x_low, y_s, y_low) = outset, place
    t, low = two_sum(a[T + i], s)
    t, low = two_sum(t, low + (a[T_LOW + i] + delta))
    a[S + i] = s + delta if within > 0.0 else s  # from laws out of their reach nothing is learnt
    a[OK + i] = result
    a[NEXT_T + i] = t
    a[NEXT_T_LOW + i] = low
    a[NEXT_X + i], a[NEXT_X_LOW + i] = short_sum(x_s, fma(vx, delta, x_low))
    y_s, y_low = short_sum(y_s, fma(vy, delta, y_low))
    a[NEXT_Y_LOW + i] = y_low
    return y_s, result - COARSE if t < min(a[STOP + i], a[END + i]) else 0.0


@packed
def fly(a, n, is_stem, is_relative, slope, degree, limits):
    """Correct each lane's time of flight once, and tell whether the step is then right and routine."""
    widest_registers()
    bend = limits.bend
    for i in range(n):
        since, w2, w_low = cap_ahead(a, i, is_relative, degree)
        stem_ahead(a, i, since, w2, w_low, slope, degree)
    for i in range(n):
        outset, hit, s = outset_of(a, i), a[HIT + i], a[S + i]
        x, y, vx, vy, wall, q, v2 = outset
        before, mean_rate = a[BEFORE + i], a[MEAN_RATE + i]
        since = before + s
        r, r1, r2 = a[NEXT_R0 + i], a[NEXT_R1 + i], a[NEXT_R2 + i]
        stem = stem_there(a, i, slope)
        k_side = side_curvature(vy, slope, limits)
        end = place_after(s, x, y, vx, vy)
        x_s, x_low, y_s, y_low = end
        f, rate = at_side_or_floor(hit, outset, end, stem)
        # The arc: its increments if it was left, else what is there.
        hop = hop_along_arc(s, outset, a[R0 + i], s * mean_rate)
        f_arc = fma(-x_s, x_s, (r - y_s) * (r + y_s)) - 2.0 * fma(x_s, x_low, y_s * y_low)
        f_arc = hop if wall == ON_ARC else f_arc
        f = f_arc if hit == ON_ARC else f
        rate = 2.0 * fma(r, r1, -fma(s, v2, q)) if hit == ON_ARC else rate
        bend_s = 2.0 * (bend + v2) if hit == ON_ARC else k_side
        f = y_s + y_low if hit == ON_BASE else f
        rate = vy if hit == ON_BASE else rate
        bend_s = 0.0 if hit == ON_BASE else bend_s
        inverse = ONE / rate
        delta = -f * inverse
        error = 2.0**58 * abs(0.5 * bend_s * inverse) * delta * delta
        error = left_in_place(error, hit, vx, vy, r)
        sizes = arc_sizes(s, outset, r, limits)
        blur = SAFETY * (limits.size + abs(x) + abs(y) + (abs(vx) + abs(vy)) * s)
        slack = slack_of(hit, wall, s, Correction(delta, inverse, error), r, sizes, blur)
        # The others are not reached: see the error analysis. The mouth was looked at.
        clear = clearance(hit, end, stem, far_enough(s, outset, k_side, slack, blur, limits))
        quality = min(a[SURE + i], clear if hit >= (ON_ARC if is_stem else ON_LEFT) else 1.0)
        place = place_on_wall(hit, s, outset, end, r, is_stem, slack, limits)
        first = way_out(hit, s, outset, rate, k_side, sizes, limits)
        quality = min(min(quality, place), min(first, s))
        quality = min(quality, told_push(hit, a[T + i], outset, y_s, stem, limits))
        # A hop needs the radius at both of its ends, and its rate as well as what enters.
        known = min(before - a[BACK + i], told_rate(a[T + i], r, r1, r2, sizes, limits))
        known = known if hit == ON_ARC else 1.0
        quality = min(quality, known if wall == ON_ARC else 1.0)
        within = a[LIMIT + i] - abs(since)
        result = verdict(quality, min(within, a[LIMIT + i] - abs(since + delta)), s, error)
        y_s, routine = arrive_at(a, i, outset, s, delta, within, result, end)
        a[NEXT_Y + i] = 0.0 if hit == ON_BASE else y_s
        routine = routine if a[CLOSED + i] == NEVER else 0.0
        a[ROUTINE + i] = routine if a[SPIN + i] == 0.0 else 0.0
        cap_at_hit(a, i, delta, r, r1, r2, stem.w, stem.w1)
        stem_at_hit(a, i, delta, stem, slope)


@packed
def chord(a, n, is_again, is_cap, is_relative, degree, limits):
    """Find the next arc hit of captured particles: the base is unfolded, |L| is constant.

    The chord keeps the distance |L| / v from the centre; while that exceeds w the mouth is out of reach.
    `is_again`: correct the times found before once more, in place of a new guess.
    """
    widest_registers()
    bend, k_w, size = limits.bend, limits.curvature, limits.size
    for i in range(n):
        outset = outset_of(a, i)
        r0, r1_0, r2_0 = a[R0 + i], a[R1 + i], a[R2 + i]
        inverse = ONE / (outset.v2 - fma(r1_0, r1_0, r0 * r2_0))
        s = 2.0 * fma(r0, r1_0, -outset.q) * inverse
        s = s * fma(cube_of_arc(r0, r1_0, r2_0, a[R3 + i]) * s, inverse, 1.0)
        a[S + i] = a[S + i] if is_again else s
        cap_ahead(a, i, is_relative, degree)
    for i in range(n):
        outset, spin = outset_of(a, i), a[SPIN + i]
        x, y, vx, vy, _, q, v2 = outset
        s, before = a[S + i], a[BEFORE + i]
        since = before + s
        r, r1, r2 = a[NEXT_R0 + i], a[NEXT_R1 + i], a[NEXT_R2 + i]
        w, w1 = a[NEXT_W0 + i], a[NEXT_W1 + i]
        f = hop_along_arc(s, outset, a[R0 + i], s * a[MEAN_RATE + i])
        slope = 2.0 * fma(r, r1, -fma(s, v2, q))
        inverse = ONE / slope
        delta = -f * inverse
        error = 2.0**58 * abs((bend + v2) * inverse) * delta * delta
        end = place_after(s, x, y, vx, vy)
        # The widest that the mouth can be during the flight, from both ends.
        reach = max(a[W0 + i], w) + fma(k_w * s, s, SAFETY * size)
        clear = spin * spin - (1.0 + 4.0 * SAFETY) * reach * reach * v2
        clear = 1.0 if is_cap else clear
        sizes = arc_sizes(s, outset, r, limits)
        first = -slope - 2.0 * SAFETY * sizes
        slack = slack_of(ON_ARC, ON_ARC, s, Correction(delta, inverse, error), r, sizes, 0.0)
        place = abs(end.y) - (SAFETY * (abs(y) + abs(vy) * s) + abs(vy) * slack)
        quality = min(min(clear, place), min(first, v2 - bend))
        quality = min(min(quality, s), before - a[BACK + i])
        quality = min(quality, told_rate(a[T + i], r, r1, r2, sizes, limits))
        within = a[LIMIT + i] - abs(since)
        result = verdict(quality, min(within, a[LIMIT + i] - abs(since + delta)), s, error)
        y_s, a[ROUTINE + i] = arrive_at(a, i, outset, s, delta, within, result, end)
        a[NEXT_Y + i] = y_s
        cap_at_hit(a, i, delta, r, r1, r2, w, w1)
