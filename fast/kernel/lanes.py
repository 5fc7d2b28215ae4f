"""Many particles in lock step: each loop below is branch-free, and the compiler vectorises it.

Idea. Particles sit side by side in lanes. `fly` gives every lane its next collision: it picks the
wall and a first guess of the time, corrects it once, and checks; `bounce` reflects. `chord` and
`rebound` do the same for captured particles, unfolded through the base. A lane whose step is not
shown right by the checks is left to the careful step (fast.kernel.follow).

Laws. Every law is a short polynomial about the lane's reference time, whatever its kind: fast.kernel.pieces.
A slope that stands still is passed as `slope`; where that is None the slope moves, and its rows are read.

What a lane's step claims, and which inequality in which line carries it, for every kind of flight and every
wall on it, rounding included: docs/lanes.md. In short: Newton leaves less than 2^-57 of the time;
a wall that is not met has f > K s^2 at the end, so that f was positive all along; the wall that is met has
|f'| > K s, or f is concave. Quotients are compared by cross-multiplication, so a flight costs two divisions
and one square root.
"""

from __future__ import annotations

import numpy as np

from fast.kernel.ahead import cap_ahead, cap_at_hit, stem_ahead, stem_at_hit
from fast.kernel.arithmetic import SAFETY, fma, two_sum
from fast.kernel.compiling import packed, part, widest_registers

from fast.kernel.pools import (  # isort: skip
    BACK, BEFORE, CERTAIN, CLOSED, COARSE, END, FAR, H0, H1, H2, HIT, LIMIT, M0, M1, M2, MEAN_RATE, NEVER,
    NEXT_H0, NEXT_H1, NEXT_H2, NEXT_M0, NEXT_M1, NEXT_M2, NEXT_R0, NEXT_R1, NEXT_R2, NEXT_T, NEXT_T_LOW,
    NEXT_W0, NEXT_W0_LOW, NEXT_W1, NEXT_W2, NEXT_X, NEXT_X_LOW, NEXT_Y, NEXT_Y_LOW, OK, ON_ARC, ON_BASE,
    ON_FLOOR, ON_LEFT, ON_RIGHT, R0, R1, R2, R3, REFUSED, ROUTINE, S, SPIN, STOP, SURE, T, T_LOW, VX, VY,
    W0, W1, W2, WALL, X, Y,
)  # fmt: skip
from fast.kernel.short import moved, short_sum

ONE = np.float64(1.0)  # its quotient by 0 is infinite without the compiler too


@part
def side_curvature(vy, slope, limits):
    """Return a bound on |f''| of a side, w'' + m'' y + 2 m' vy, for a flight of the stem."""
    return fma(limits.turning, abs(vy), limits.curvature) if slope is None else limits.curvature


@part
def mouth_crossing(x, y, vx, vy, w0, w1, k_side, per_r, limits):
    """Return `gap`, `doubt` and `lift` of docs/lanes.md: on which side of the mouth's edge y = 0 is crossed.

    The gap comes times |vy|, the other two times |vy|^2.
    """
    bend, rate_w, size = limits.bend, limits.rate, limits.size
    depth, rise = abs(y), abs(vy)
    gap = fma(w0, rise, w1 * depth) - abs(x * vy - y * vx)
    excess = bend - fma(vx, vx, vy * vy)
    excess = excess if excess > 0.0 else 0.0  # by how much the arc's function may be convex, halved
    doubt = (k_side + excess * per_r) * depth * depth
    doubt = fma(SAFETY * rise, fma(size + abs(x), rise, (abs(vx) + rate_w) * depth), doubt)
    lift = limits.least_h * rise * rise - limits.curvature * depth * depth
    return gap, doubt, lift


@part
def nearest_below(wall, f_r, d_r, f_l, d_l, f_f, d_f):
    """Return the least quotient f / d of right, left and floor, by cross-multiplication, and its wall.

    f is the wall's function, 0 on the wall being left, and d how fast it falls.
    """
    f_r = 0.0 if wall == ON_RIGHT else f_r
    f_l = 0.0 if wall == ON_LEFT else f_l
    f_f = 0.0 if wall == ON_FLOOR else f_f
    f = f_r if f_r > 0.0 else 1.0
    d = d_r if f_r > 0.0 else 0.0
    d = d if d > 0.0 else 0.0
    side = ON_RIGHT
    best_l = d_l * f - f_l * d
    best_l = best_l if f_l > 0.0 else 0.0
    f = f_l if best_l > 0.0 else f
    d = d_l if best_l > 0.0 else d
    side = ON_LEFT if best_l > 0.0 else side
    best_f = d_f * f - f_f * d
    best_f = best_f if f_f > 0.0 else 0.0
    f = f_f if best_f > 0.0 else f
    d = d_f if best_f > 0.0 else d
    side = ON_FLOOR if best_f > 0.0 else side
    return f, d, side


@part
def arc_quotient(x, y, vx, vy, wall, r0, r1, r2):
    """Return the time to the arc, to second order in it, as a quotient f / d.

    And half of how fast f falls there.
    """
    q, v2 = fma(x, vx, y * vy), fma(vx, vx, vy * vy)
    c = fma(-x, x, (r0 - y) * (r0 + y))
    c = 0.0 if wall == ON_ARC else c
    a2 = v2 - fma(r1, r1, r0 * r2)
    b = fma(-r0, r1, q)
    root = np.sqrt(fma(b, b, a2 * c))
    return c if b > 0.0 else root - b, b + root if b > 0.0 else a2, root


@part
def cube_of_arc(r0, r1, r2, r3):
    """Return the coefficient of the third power of the time in r^2."""
    return fma(r1, r2, r0 * r3 * (1.0 / 3.0))


@packed
def aim(a, n, is_stem, slope, limits):
    """Choose each lane's wall and guess the time, walls moving at their speed now.

    SURE is positive only where the part of the flight before y = 0 is as chosen: docs/lanes.md.
    """
    widest_registers()
    bend, per_r = limits.bend, 2.0 / limits.least_r
    for i in range(n):
        x, y, vx, vy, wall = a[X + i], a[Y + i], a[VX + i], a[VY + i], a[WALL + i]
        w0, w1, w2, h1, h2 = a[W0 + i], a[W1 + i], a[W2 + i], a[H1 + i], a[H2 + i]
        depth, rise = abs(y), abs(vy)
        k_side = side_curvature(vy, slope, limits)
        gap, doubt, lift = mouth_crossing(x, y, vx, vy, w0, w1, k_side, per_r, limits)
        m, m1, m2 = (a[M0 + i], a[M1 + i], a[M2 + i]) if slope is None else (slope, 0.0, 0.0)
        edge, drift = fma(m, y, w0), fma(m, vy, fma(m1, y, w1))
        f, d, side = nearest_below(wall, edge - x, vx - drift, edge + x, -vx - drift, y + a[H0 + i], -vy - h1)
        r0, r1, r2 = a[R0 + i], a[R1 + i], a[R2 + i]
        f_a, d_a, root = arc_quotient(x, y, vx, vy, wall, r0, r1, r2)
        # Which of them, by the part of the table the flight is in and whether it crosses y = 0 before.
        reaches = fma(y, d_a, vy * f_a) if vy < 0.0 else 1.0  # cap: > 0 where the arc comes first
        stays = depth * d - f * vy if vy > 0.0 else 1.0  # stem: > 0 where a side comes first
        top = ON_BASE if is_stem else ON_ARC
        below = side if gap > 0.0 else ON_BASE
        from_cap = ON_ARC if reaches > 0.0 else below
        from_stem = side if stays > 0.0 else top
        is_in_cap = 1.0 if wall < 1.5 else 0.0
        is_in_cap = 0.0 if is_stem else is_in_cap
        hit = from_cap if is_in_cap > 0.5 else from_stem
        f = f_a if hit == ON_ARC else f
        d = d_a if hit == ON_ARC else d
        f = depth if hit == ON_BASE else f
        d = rise if hit == ON_BASE else d
        # One division for 1 / d and 1 / root.
        root = root if hit == ON_ARC else 1.0
        inverse = ONE / (d * root)
        s = f * (root * inverse)
        # What is beyond the straight line, or beyond second order at the arc.
        beyond = h2 if hit == ON_FLOOR else fma(m2, y, fma(2.0 * m1, vy, w2))
        beyond = beyond if hit >= ON_LEFT else 0.0
        beyond = beyond * s if hit != ON_ARC else cube_of_arc(r0, r1, r2, a[R3 + i]) * s * s * d
        s = s * fma(0.5 * beyond, inverse, 1.0)
        # Comparisons so put that what is no number is never sure.
        whole = reaches if is_in_cap > 0.5 else stays
        gap = gap * rise
        sure = abs(gap) - doubt if is_in_cap > 0.5 else min(gap - doubt, lift)
        sure = 1.0 if is_stem else sure
        sure = 1.0 if whole > 0.0 else sure
        # The arc's function must be concave.
        concave = fma(vx, vx, vy * vy) - bend if hit == ON_ARC else 1.0
        a[HIT + i], a[S + i], a[SURE + i] = hit, s, min(concave, sure)


@part
def at_side_or_floor(hit, x_s, x_low, y_s, y_low, vx, vy, w, w_low, w1, h, h1, m, m1):
    """Return f and f' of the side or the floor that is met."""
    sign = 1.0 if hit == ON_RIGHT else -1.0
    f = (w - sign * x_s) + (fma(m, y_s, w_low) + fma(m, y_low, -sign * x_low))
    slope = fma(m, vy, fma(m1, y_s, w1)) - sign * vx
    f = (y_s + h) + y_low if hit == ON_FLOOR else f
    slope = vy + h1 if hit == ON_FLOOR else slope
    return f, slope


@part
def hop_along_arc(s, q, v2, r0, dr):
    """Return f of the arc that was left, by its increments since, of which `dr` is the radius's."""
    return dr * (2.0 * r0 + dr) - s * fma(s, v2, 2.0 * q)


@part
def arc_sizes(s, x, y, vx, vy, v2, r, limits):
    """Return the summed sizes of the terms of half the slope of the arc's function."""
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
def told_push(hit, t, y_s, vx, vy, w1, w2, h1, h2, m1, m2, limits):
    """Return `pushed` of docs/lanes.md: positive where a bounce hangs on a rate no more than on what enters.

    Of sides and floor; the arc is met by nobody slower than it.
    """
    rate = h1 if hit == ON_FLOOR else fma(m1, y_s, w1)
    bend = h2 if hit == ON_FLOOR else fma(m2, y_s, w2)
    told = (abs(vx) + abs(vy)) + (abs(rate) + abs(t * bend)) - limits.rate
    told = 1.0 if abs(rate) + abs(bend) == 0.0 else told
    return told if hit >= ON_LEFT else 1.0


@part
def slack_of(hit, wall, s, delta, inverse, error, r, sizes, blur):
    """Return `slack` of docs/lanes.md: how far off s a certain hit may be."""
    f_error = 2.0 * SAFETY * s * sizes if wall == ON_ARC else 2.0 * r * blur
    f_error = f_error if hit == ON_ARC else blur
    f_error = 0.0 if hit == ON_BASE else f_error
    slack = fma(f_error, abs(inverse), abs(delta))
    return slack if error < s else 0.0


@part
def clearance(hit, s, x_s, y_s, vx, vy, w, h, m, k_side, slack, blur, limits):
    """Return `clear` of docs/lanes.md: how far inside the walls below that are not met a flight ends."""
    edge = fma(m, y_s, w)
    clear_r = edge - x_s if hit != ON_RIGHT else NEVER
    clear_l = edge + x_s if hit != ON_LEFT else NEVER
    clear_f = y_s + h if hit != ON_FLOOR else NEVER
    far = k_side * s * s + blur
    far = fma(abs(vx) + limits.lean * abs(vy) + limits.rate, slack, far)
    return min(clear_r, min(clear_l, clear_f)) - far


@part
def place_on_wall(hit, s, x, y, vx, vy, v2, x_s, y_s, r, is_stem, slack, limits):
    """Return `place` of docs/lanes.md: positive where the wall met is met in its own part of the table.

    The arc is met above y = 0, sides and floor below it, the base inside the arc.
    """
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
def way_out(hit, s, vx, vy, slope, k_side, sizes, limits):
    """Return `first` of docs/lanes.md: positive where the wall is met on the way out."""
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
def arrive_at(a, i, s, delta, within, result, x_s, x_low, y_s, y_low, vx, vy):
    """Write what became of a step, with time and place of the hit; returns y there, and ROUTINE so far."""
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
        x, y, vx, vy, wall = a[X + i], a[Y + i], a[VX + i], a[VY + i], a[WALL + i]
        hit, s = a[HIT + i], a[S + i]
        before, mean_rate = a[BEFORE + i], a[MEAN_RATE + i]
        since = before + s
        r, r1, r2 = a[NEXT_R0 + i], a[NEXT_R1 + i], a[NEXT_R2 + i]
        w, w1, w2, w_low = a[NEXT_W0 + i], a[NEXT_W1 + i], a[NEXT_W2 + i], a[NEXT_W0_LOW + i]
        h, h1, h2 = a[NEXT_H0 + i], a[NEXT_H1 + i], a[NEXT_H2 + i]
        m, m1, m2 = (a[NEXT_M0 + i], a[NEXT_M1 + i], a[NEXT_M2 + i]) if slope is None else (slope, 0.0, 0.0)
        k_side = side_curvature(vy, slope, limits)
        x_s, x_low = moved(x, vx, s)
        y_s, y_low = moved(y, vy, s)
        q, v2 = fma(x, vx, y * vy), fma(vx, vx, vy * vy)
        f, rate = at_side_or_floor(hit, x_s, x_low, y_s, y_low, vx, vy, w, w_low, w1, h, h1, m, m1)
        # The arc: its increments if it was left, else what is there.
        hop = hop_along_arc(s, q, v2, a[R0 + i], s * mean_rate)
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
        sizes = arc_sizes(s, x, y, vx, vy, v2, r, limits)
        blur = SAFETY * (limits.size + abs(x) + abs(y) + (abs(vx) + abs(vy)) * s)
        slack = slack_of(hit, wall, s, delta, inverse, error, r, sizes, blur)
        # The others are not reached: see the error analysis. The mouth was looked at.
        clear = clearance(hit, s, x_s, y_s, vx, vy, w, h, m, k_side, slack, blur, limits)
        quality = min(a[SURE + i], clear if hit >= (ON_ARC if is_stem else ON_LEFT) else 1.0)
        place = place_on_wall(hit, s, x, y, vx, vy, v2, x_s, y_s, r, is_stem, slack, limits)
        first = way_out(hit, s, vx, vy, rate, k_side, sizes, limits)
        quality = min(min(quality, place), min(first, s))
        pushed = told_push(hit, a[T + i], y_s, vx, vy, w1, w2, h1, h2, m1, m2, limits)
        quality = min(quality, pushed)
        # A hop needs the radius at both of its ends, and its rate as well as what enters.
        known = min(before - a[BACK + i], told_rate(a[T + i], r, r1, r2, sizes, limits))
        known = known if hit == ON_ARC else 1.0
        quality = min(quality, known if wall == ON_ARC else 1.0)
        within = a[LIMIT + i] - abs(since)
        result = verdict(quality, min(within, a[LIMIT + i] - abs(since + delta)), s, error)
        y_s, routine = arrive_at(a, i, s, delta, within, result, x_s, x_low, y_s, y_low, vx, vy)
        a[NEXT_Y + i] = 0.0 if hit == ON_BASE else y_s
        routine = routine if a[CLOSED + i] == NEVER else 0.0
        a[ROUTINE + i] = routine if a[SPIN + i] == 0.0 else 0.0
        cap_at_hit(a, i, delta, r, r1, r2, w, w1)
        stem_at_hit(a, i, delta, w1, w2, h, h1, h2, m, m1, m2, slope)


@packed
def chord(a, n, is_again, is_cap, is_relative, degree, limits):
    """Find the next arc hit of captured particles: the base is unfolded, |L| is constant.

    The chord keeps the distance |L| / v from the centre; while that exceeds w the mouth is out of reach.
    `is_again`: correct the times found before once more, in place of a new guess.
    """
    widest_registers()
    bend, k_w, size = limits.bend, limits.curvature, limits.size
    for i in range(n):
        x, y, vx, vy = a[X + i], a[Y + i], a[VX + i], a[VY + i]
        r0, r1_0, r2_0 = a[R0 + i], a[R1 + i], a[R2 + i]
        q, v2 = fma(x, vx, y * vy), fma(vx, vx, vy * vy)
        inverse = ONE / (v2 - fma(r1_0, r1_0, r0 * r2_0))
        s = 2.0 * fma(r0, r1_0, -q) * inverse
        s = s * fma(cube_of_arc(r0, r1_0, r2_0, a[R3 + i]) * s, inverse, 1.0)
        a[S + i] = a[S + i] if is_again else s
        cap_ahead(a, i, is_relative, degree)
    for i in range(n):
        x, y, vx, vy, spin = a[X + i], a[Y + i], a[VX + i], a[VY + i], a[SPIN + i]
        q, v2 = fma(x, vx, y * vy), fma(vx, vx, vy * vy)
        s, before = a[S + i], a[BEFORE + i]
        since = before + s
        r, r1, r2 = a[NEXT_R0 + i], a[NEXT_R1 + i], a[NEXT_R2 + i]
        w, w1 = a[NEXT_W0 + i], a[NEXT_W1 + i]
        f = hop_along_arc(s, q, v2, a[R0 + i], s * a[MEAN_RATE + i])
        slope = 2.0 * fma(r, r1, -fma(s, v2, q))
        inverse = ONE / slope
        delta = -f * inverse
        error = 2.0**58 * abs((bend + v2) * inverse) * delta * delta
        x_s, x_low = moved(x, vx, s)
        y_s, y_low = moved(y, vy, s)
        # The widest that the mouth can be during the flight, from both ends.
        reach = max(a[W0 + i], w) + fma(k_w * s, s, SAFETY * size)
        clear = spin * spin - (1.0 + 4.0 * SAFETY) * reach * reach * v2
        clear = 1.0 if is_cap else clear
        sizes = arc_sizes(s, x, y, vx, vy, v2, r, limits)
        first = -slope - 2.0 * SAFETY * sizes
        slack = slack_of(ON_ARC, ON_ARC, s, delta, inverse, error, r, sizes, 0.0)
        place = abs(y_s) - (SAFETY * (abs(y) + abs(vy) * s) + abs(vy) * slack)
        quality = min(min(clear, place), min(first, v2 - bend))
        quality = min(min(quality, s), before - a[BACK + i])
        quality = min(quality, told_rate(a[T + i], r, r1, r2, sizes, limits))
        within = a[LIMIT + i] - abs(since)
        result = verdict(quality, min(within, a[LIMIT + i] - abs(since + delta)), s, error)
        y_s, a[ROUTINE + i] = arrive_at(a, i, s, delta, within, result, x_s, x_low, y_s, y_low, vx, vy)
        a[NEXT_Y + i] = y_s
        cap_at_hit(a, i, delta, r, r1, r2, w, w1)
