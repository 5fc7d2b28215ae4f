"""Many particles in lock step: each loop below is branch-free, and the compiler vectorises it.

Idea. Particles sit side by side in lanes. `aim` picks every lane's wall and guesses the time: walls move on
at their speed now, and the quotients of their distances and closing speeds are compared by
cross-multiplication; the arc is taken to second order, and what is beyond that once more at the end. `land`
corrects the time once, checks the step, and bounces the particle. `chord` does the same for captured
particles, unfolded through the base. A lane whose step is not shown right by the checks is left to the scalar
step (fast.kernel.follow).

Laws. A lane knows them in one of two forms: fast.kernel.lane_laws. A slope that stands still is passed as
`slope`; where that is None the slope moves, and its rows are read.

What a lane's step claims, and which inequality in which line carries it, for every kind of flight and every
wall on it, rounding included: docs/lanes.md. In short: Newton leaves less than 2^-57 of the time;
a wall that is not met has f > K s^2 at the end, so that f was positive all along; the wall that is met has
|f'| > K s, or f is concave. A flight costs two divisions and one square root.
"""

from typing import NamedTuple

import numpy as np

from fast.kernel import rows
from fast.kernel.arithmetic import SAFETY, dot, fma, short_sum, two_product, two_sum
from fast.kernel.compiling import packed, part, widest_registers
from fast.kernel.lane_laws import (
    LawsAt,
    laws_in,
    look_ahead,
    move_laws,
    radius_since,
    room_ahead,
)
from fast.kernel.records import CAP, MUSHROOM, STEM, Place

ONE = np.float64(1.0)  # its quotient by 0 is infinite without the compiler too
CLEARLY_BEYOND = 1.05 * 1.05  # (L / (w v))^2 from which a particle moves to the disk's pool


class Outset(NamedTuple):
    """A lane's particle as it leaves a wall: place, velocity v, the wall's code, x vx + y vy, and v^2."""

    x: float
    y: float
    vx: float
    vy: float
    wall: float
    q: float
    v2: float


@packed
def outset_of(a, i):
    """Return the particle of a lane."""
    x, y, vx, vy = a[rows.X + i], a[rows.Y + i], a[rows.VX + i], a[rows.VY + i]
    return Outset(x, y, vx, vy, a[rows.WALL + i], fma(x, vx, y * vy), fma(vx, vx, vy * vy))


@part
def side_curvature(vy, slope, limits):
    """Return a bound on |f''| of a side, w'' + m'' y + 2 m' vy, for a flight of the stem."""
    return fma(limits.turning, abs(vy), limits.curvature) if slope is None else limits.curvature


@part
def side_rate(y, now, slope):
    """Return how fast a side moves out at a height."""
    return fma(now.m1, y, now.w1) if slope is None else now.w1


@part
def side_bend(y, vy, now, slope):
    """Return f'' of a side along a flight."""
    return fma(now.m2, y, fma(2.0 * now.m1, vy, now.w2)) if slope is None else now.w2


@part
def mouth_crossing(outset, w0, w1, k, limits):
    """Return `gap` and `doubt` of docs/lanes.md: on which side of the mouth's edge y = 0 is crossed.

    The gap comes times |vy|, the doubt times |vy|^2.
    """
    (x, y, vx, vy, _, _, _), rate_w, size = outset, limits.rate, limits.size
    depth, rise = abs(y), abs(vy)
    gap = fma(w0, rise, w1 * depth) - abs(fma(x, vy, -y * vx))
    doubt = k * depth * depth
    doubt = fma(SAFETY * rise, fma(size + abs(x), rise, (abs(vx) + rate_w) * depth), doubt)
    return gap, doubt


@part
def nearer(f, d, wall, other_f, other_d, other):
    """Return the lesser of two quotients f / d and its wall; the second one counts where its f is above 0."""
    less = fma(other_d, f, -other_f * d)
    less = less if other_f > 0.0 else 0.0
    return other_f if less > 0.0 else f, other_d if less > 0.0 else d, other if less > 0.0 else wall


@part
def nearest_below(outset, now, slope):
    """Return the time to the nearest of right, left and floor as a quotient f / d, and its wall.

    f is the wall's function, 0 on the wall being left, and d how fast it falls.
    """
    x, y, vx, vy, wall, _, _ = outset
    edge, drift = fma(now.m, y, now.w), fma(now.m, vy, side_rate(y, now, slope))
    f_r = 0.0 if wall == rows.ON_RIGHT else edge - x
    d_r = vx - drift
    f_l = 0.0 if wall == rows.ON_LEFT else edge + x
    f_f = 0.0 if wall == rows.ON_FLOOR else y + now.h
    f = f_r if f_r > 0.0 else 1.0
    d = d_r if f_r > 0.0 else 0.0
    f, d, side = nearer(f, d if d > 0.0 else 0.0, rows.ON_RIGHT, f_l, -vx - drift, rows.ON_LEFT)
    return nearer(f, d, side, f_f, -vy - now.h1, rows.ON_FLOOR)


@part
def arc_quotient(outset, r0, r1, r2):
    """Return the time to the arc, to second order in it, as a quotient f / d.

    And half of how fast f falls there.
    """
    x, y, _, _, wall, q, v2 = outset
    c = fma(-x, x, (r0 - y) * (r0 + y))
    c = 0.0 if wall == rows.ON_ARC else c
    a2 = v2 - fma(r1, r1, r0 * r2)
    b = fma(-r0, r1, q)
    root = np.sqrt(fma(b, b, a2 * c))
    return c if b > 0.0 else root - b, b + root if b > 0.0 else a2, root


@part
def cube_of_arc(r0, r1, r2, r3):
    """Return the coefficient of the third power of the time in r^2."""
    return fma(r1, r2, r0 * r3 * (1.0 / 3.0))


@packed
def aim(a, i, is_stem, is_relative, waves, slope, form, limits):
    """Choose a lane's wall and guess the time, walls moving at their speed now; returns the time.

    SURE is positive only where the part of the flight before y = 0 is as chosen: docs/lanes.md.
    """
    outset, now = outset_of(a, i), laws_in(a, rows.R0 + i, waves, is_relative, slope, form)
    _, y, _, vy, wall, _, _ = outset
    depth, rise = abs(y), abs(vy)
    is_in_cap = 1.0 if wall < 1.5 else 0.0
    is_in_cap = 0.0 if is_stem else is_in_cap
    k_side = side_curvature(vy, slope, limits)
    k = k_side if is_in_cap > 0.5 else k_side + limits.lift
    gap, doubt = mouth_crossing(outset, now.w, now.w1, k, limits)
    f, d, side = nearest_below(outset, now, slope)
    f_a, d_a, root = arc_quotient(outset, now.r, now.r1, now.r2)
    # Which of them, by the part of the table the flight is in and whether it crosses y = 0 before.
    reaches = fma(y, d_a, vy * f_a) if vy < 0.0 else 1.0  # cap: > 0 where the arc comes first
    stays = fma(depth, d, -f * vy) if vy > 0.0 else 1.0  # stem: > 0 where a side comes first
    top = rows.ON_BASE if is_stem else rows.ON_ARC
    below = side if gap > 0.0 else rows.ON_BASE
    from_cap = rows.ON_ARC if reaches > 0.0 else below
    from_stem = side if stays > 0.0 else top
    hit = from_cap if is_in_cap > 0.5 else from_stem
    f = f_a if hit == rows.ON_ARC else f
    d = d_a if hit == rows.ON_ARC else d
    f = depth if hit == rows.ON_BASE else f
    d = rise if hit == rows.ON_BASE else d
    # One division for 1 / d and 1 / root.
    root = root if hit == rows.ON_ARC else 1.0
    inverse = ONE / (d * root)
    s = f * (root * inverse)
    # What is beyond the straight line, or beyond second order at the arc.
    beyond = now.h2 if hit == rows.ON_FLOOR else side_bend(y, vy, now, slope)
    beyond = beyond if hit >= rows.ON_LEFT else 0.0
    beyond = beyond * s if hit != rows.ON_ARC else cube_of_arc(now.r, now.r1, now.r2, now.r3) * s * s * d
    s = s * fma(0.5 * beyond, inverse, 1.0)
    # Comparisons so put that what is no number is never sure.
    whole = reaches if is_in_cap > 0.5 else stays
    gap = gap * rise
    sure = abs(gap) - doubt if is_in_cap > 0.5 else gap - doubt
    sure = 1.0 if is_stem else sure
    sure = 1.0 if whole > 0.0 else sure
    s = a[rows.S + i] if a[rows.TRIES + i] > 0.0 else s
    a[rows.HIT + i], a[rows.S + i], a[rows.SURE + i] = hit, s, sure
    return s


@packed
def out_of_arc(place, vx, vy, r, rate):
    """Return r r' - (x vx + y vy) and x^2 + y^2 at a place on the arc, each as a sum of two floats.

    The low parts matter: without them the velocity after a bounce is off by four units in its last place.
    """
    x, x_low, y, y_low = place
    p, push = y * vy, r * rate
    q = fma(x, vx, p)
    out, low = short_sum(-q, push)
    low += fma(r, rate, -push) - (fma(y, vy, -p) + fma(x_low, vx, y_low * vy))
    large, small = max(abs(x), abs(y)), min(abs(x), abs(y))
    square = large * large
    rho2 = fma(small, small, square)
    rho2_low = fma(small, small, square - rho2) + fma(large, large, -square)
    return out, low, rho2, fma(2.0, fma(x, x_low, y * y_low), rho2_low)


@packed
def divided(a, low, b, b_low, inverse):
    """Return (a + low) / (b + b_low) as a sum of two floats, `inverse` being 1 / b."""
    quotient = a * inverse
    return quotient, (fma(-quotient, b, a) + fma(-quotient, b_low, low)) * inverse


@packed
def off_the_arc(place, vx, vy, r, rate):
    """Return the velocity after a hit on the arc: v - 2 f' grad f / |grad f|^2 = v - 2 (v.n - r') n."""
    out, low, rho2, rho2_low = out_of_arc(place, vx, vy, r, rate)
    push, low = divided(2.0 * out, 2.0 * low, rho2, rho2_low, ONE / rho2)
    x, x_low, y, y_low = place
    return fma(push, x, vx) + fma(push, x_low, low * x), fma(push, y, vy) + fma(push, y_low, low * y)


@packed
def off_the_arc_spinning(place, vx, vy, r, rate, spin):
    """Return the velocity after a hit on the arc where the angular momentum is known to be `spin`."""
    x, x_low, y, y_low = place
    # Twice r r' less the velocity out goes out.
    out, low, rho2, rho2_low = out_of_arc(place, vx, vy, 2.0 * r, rate)
    inverse = ONE / rho2
    a, b = dot(out, x, -spin, y), dot(out, y, spin, x)
    a_low = fma(low, x, fma(out, x_low, -spin * y_low))
    b_low = fma(low, y, fma(out, y_low, spin * x_low))
    a, a_low = divided(a, a_low, rho2, rho2_low, inverse)
    b, b_low = divided(b, b_low, rho2, rho2_low, inverse)
    return a + a_low, b + b_low


@packed
def off_the_side(sign, vx, vy, m, rate):
    """Return the velocity after a hit on a side of slope m moving out at a rate; sign is 1 on the right."""
    inverse = 2.0 / fma(m, m, 1.0)
    tilt, out = 0.5 * inverse * (m - 1.0) * (m + 1.0), sign * vx
    return sign * fma(tilt, out, inverse * fma(m, vy, rate)), fma(inverse * m, out - rate, -tilt * vy)


@packed
def off_the_wall(hit, place, vx, vy, at_hit, slope):
    """Return the velocity after a hit, v - 2 f' grad f / |grad f|^2, by the laws at the hit."""
    off_x, off_y = off_the_arc(place, vx, vy, at_hit.r, at_hit.r1)
    m, rate = (at_hit.m, fma(at_hit.m1, place.y, at_hit.w1)) if slope is None else (slope, at_hit.w1)
    vx_s, vy_s = off_the_side(1.0 if hit == rows.ON_RIGHT else -1.0, vx, vy, m, rate)
    vx_s = vx if hit == rows.ON_FLOOR else vx_s
    vy_s = -vy - 2.0 * at_hit.h1 if hit == rows.ON_FLOOR else vy_s
    vx_s = vx if hit == rows.ON_BASE else vx_s
    vy_s = -vy if hit == rows.ON_BASE else vy_s
    return off_x if hit == rows.ON_ARC else vx_s, off_y if hit == rows.ON_ARC else vy_s


@packed
def stay_after(stay, hit, place, v, w):
    """Return whether a particle is captured after a hit, from whether it was, and v before the bounce.

    It is at a hit of the arc with |sin phi| > nu (eq. sinphi), |L| > w v, and until the next of the arc.
    """
    vx, vy, v2 = v
    spin, edge = fma(place.x, vy, -place.y * vx), w * w * v2
    at_arc = min(stay, rows.OVER)
    at_arc = rows.CAPTURED if spin * spin > edge else at_arc
    at_arc = rows.CLEARLY if spin * spin > CLEARLY_BEYOND * edge else at_arc
    after = at_arc if hit == rows.ON_ARC else stay
    return rows.NOT_YET if hit >= rows.ON_LEFT else after


@packed
def count_hit(a, i, hit):
    """Count a hit of a wall."""
    a[rows.N_ARC + i] += 1.0 if hit == rows.ON_ARC else 0.0
    a[rows.N_BASE + i] += 1.0 if hit == rows.ON_BASE else 0.0
    a[rows.N_LEFT + i] += 1.0 if hit == rows.ON_LEFT else 0.0
    a[rows.N_RIGHT + i] += 1.0 if hit == rows.ON_RIGHT else 0.0
    a[rows.N_FLOOR + i] += 1.0 if hit == rows.ON_FLOOR else 0.0


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
    sign = 1.0 if hit == rows.ON_RIGHT else -1.0
    f = (w - sign * x_s) + fma(m, y_s, fma(m, y_low, fma(-sign, x_low, stem.w_low)))
    rate = fma(-sign, vx, fma(m, vy, side_rate(y_s, stem, slope)))
    f = (y_s + stem.h) + y_low if hit == rows.ON_FLOOR else f
    rate = vy + stem.h1 if hit == rows.ON_FLOOR else rate
    return f, rate


@part
def told_slope(hit, m, vx, vy, limits):
    """Be above 0 where rounding of a moving slope turns a bounce little more than that of the state."""
    steepest = limits.lean - 1.0
    aslant = min(abs(vy) - steepest * abs(vx), abs(vx) - steepest * abs(vy))
    told = max(abs(m) - 0.25 * steepest, aslant)
    return told if hit >= rows.ON_LEFT and hit != rows.ON_FLOOR else 1.0


@part
def along_arc(a, i, s, outset, there, waves, form, limits):
    """Return f of the arc that was left, f', the summed sizes of the terms of half of f', and what is known.

    f is found by its increments since. The last number is the lesser of `known` and `told` of docs/lanes.md:
    positive where the radius is known at both ends of a hop, which hangs on r' no more than on what enters.
    """
    x, y, vx, vy, _, q, v2 = outset
    r0, dr, known = radius_since(a, i, s, waves, form)
    f = fma(dr, fma(2.0, r0, dr), -s * fma(s, v2, 2.0 * q))
    rate = 2.0 * fma(there.r, there.r1, -fma(s, v2, q))
    sizes = fma(abs(x), abs(vx), fma(abs(y), abs(vy), fma(s, v2, there.r * limits.rate)))
    told = fma(-there.r, limits.rate + limits.arc_rate, sizes)
    return f, rate, sizes, min(known, told)


@part
def left_in_place(error, hit, vx, vy, r):
    """Return `error` of docs/lanes.md, infinite where the place on the arc is not as well known as the time.

    That is so after flights that are many radii long.
    """
    return rows.NEVER if hit == rows.ON_ARC and error * (abs(vx) + abs(vy)) > 16.0 * r else error


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
    clear_r = edge - x_s if hit != rows.ON_RIGHT else rows.NEVER
    clear_l = edge + x_s if hit != rows.ON_LEFT else rows.NEVER
    clear_f = y_s + h if hit != rows.ON_FLOOR else rows.NEVER
    return min(clear_r, min(clear_l, clear_f)) - far


@part
def place_on_wall(hit, outset, end, r, is_stem, slack, blur):
    """Return `place` of docs/lanes.md: positive where the wall met is met in its own part of the table.

    The arc is met above y = 0, sides and floor below it, the base inside the arc.
    """
    place = end.y if hit == rows.ON_ARC else -end.y
    place -= fma(abs(outset.vy), slack, blur)
    inside = (r - abs(end.x)) - blur
    inside = 1.0 if is_stem else inside
    return inside if hit == rows.ON_BASE else place


@part
def way_out(hit, s, outset, slope, k_side, sizes, limits):
    """Return `first` of docs/lanes.md: positive where the wall is met on the way out."""
    vx, vy = outset.vx, outset.vy
    first = -slope - fma(k_side, s, SAFETY * (fma(limits.lean, abs(vy), abs(vx)) + limits.rate))
    first = fma(-2.0 * SAFETY, sizes, -slope) if hit == rows.ON_ARC else first
    return 1.0 if hit == rows.ON_BASE else first


@part
def verdict(quality, ahead, s, error, tries):
    """Return what is known of a flight: LATE for a right one, COARSE, REFUSED, which nan comes to, or FAR."""
    result = rows.COARSE if tries < rows.MAX_CORRECTIONS else rows.REFUSED
    result = rows.LATE if error < s else result
    result = result if quality > 0.0 else rows.REFUSED
    result = result if s < rows.NEVER else rows.REFUSED
    return rows.FAR if ahead <= 0.0 else result


@part
def laws_at_hit(there, delta):
    """Return the laws at a hit, `delta` after the end that was guessed; of what a bounce asks for."""
    w, h = fma(there.w1, delta, there.w), fma(there.h1, delta, there.h)
    r, m = fma(there.r1, delta, there.r), fma(there.m1, delta, there.m)
    r1, w1 = fma(there.r2, delta, there.r1), fma(there.w2, delta, there.w1)
    h1, m1 = fma(there.h2, delta, there.h1), fma(there.m2, delta, there.m1)
    return LawsAt(r, r1, there.r2, there.r3, w, 0.0, w1, there.w2, h, h1, there.h2, m, m1, there.m2)


@packed
def land(a, i, table, waves, slope, form, limits):
    """Correct a lane's time of flight once, and tell whether the step is then right; if so, take it.

    `table` tells whether it is a stem, whether captures are wanted, and whether the width is given as nu.
    """
    is_stem, has_captures, is_relative = table
    bend = limits.bend
    outset, hit, s = outset_of(a, i), a[rows.HIT + i], a[rows.S + i]
    x, y, vx, vy, wall, _, v2 = outset
    there = laws_in(a, rows.AHEAD + i, waves, is_relative, slope, form)
    r = there.r
    hop, arc_rate, sizes, known = along_arc(a, i, s, outset, there, waves, form, limits)
    k_side = side_curvature(vy, slope, limits)
    end = place_after(s, x, y, vx, vy)
    x_s, x_low, y_s, y_low = end
    f, rate = at_side_or_floor(hit, outset, end, there, slope)
    # The arc: its increments if it was left, else what is there.
    f_arc = fma(-2.0, fma(x_s, x_low, y_s * y_low), fma(-x_s, x_s, (r - y_s) * (r + y_s)))
    f_arc = hop if wall == rows.ON_ARC else f_arc
    f = f_arc if hit == rows.ON_ARC else f
    rate = arc_rate if hit == rows.ON_ARC else rate
    half_bend = bend + v2 if hit == rows.ON_ARC else 0.5 * k_side
    f = y_s + y_low if hit == rows.ON_BASE else f
    rate = vy if hit == rows.ON_BASE else rate
    half_bend = 0.0 if hit == rows.ON_BASE else half_bend
    inverse = ONE / rate
    delta = -f * inverse
    error = error_left(half_bend * inverse, s, delta, waves)
    error = left_in_place(error, hit, vx, vy, r)
    blur = SAFETY * fma(abs(vx) + abs(vy), s, limits.size + abs(x) + abs(y))
    slack = slack_of(s, blur * (16.0 * r) if hit == rows.ON_ARC else blur, delta, inverse, error)
    # The others are not reached: see the error analysis. The mouth was looked at.
    clear = clearance(hit, end, there, far_enough(s, outset, k_side, slack, blur, limits))
    quality = min(a[rows.SURE + i], clear if hit >= (rows.ON_ARC if is_stem else rows.ON_LEFT) else 1.0)
    place = place_on_wall(hit, outset, end, r, is_stem, slack, blur)
    first = way_out(hit, s, outset, rate, k_side, sizes, limits)
    quality = min(min(quality, place), min(first, s))
    # The arc's function must be concave, and a bounce hang on a rate no more than on what enters.
    pushed = (abs(vy) if hit == rows.ON_FLOOR else abs(vx)) - limits.rate if hit >= rows.ON_LEFT else 1.0
    quality = min(quality, min(v2 - bend, pushed))
    if slope is None:
        quality = min(quality, told_slope(hit, there.m, vx, vy, limits))
    known = known if hit == rows.ON_ARC else 1.0
    quality = min(quality, known if wall == rows.ON_ARC else 1.0)
    within, ahead = room_ahead(a, i, s, delta, waves)
    result = verdict(quality, min(within, ahead), s, error, a[rows.TRIES + i])
    flight = Judged(s, delta, within, result)
    is_moved, at_hit = settle(a, i, flight, outset, end, there, has_captures, slope)
    if is_moved:
        move_laws(a, i, delta, at_hit, waves, slope)


@packed
def settle(a, i, flight, outset, end, there, has_captures, slope):
    """Bounce off the wall that was met; returns whether the particle moves on, and the laws at the hit."""
    hit, vx, vy, v2 = a[rows.HIT + i], outset.vx, outset.vy, outset.v2
    t, t_low, at, at_hit, is_moved = arrive(a, i, flight, outset, end, there)
    at = Place(at.x, at.x_low, 0.0 if hit == rows.ON_BASE else at.y, at.y_low)
    vx_s, vy_s = off_the_wall(hit, at, vx, vy, at_hit, slope)
    stay = stay_after(a[rows.STAY + i], hit, at, (vx, vy, v2), at_hit.w) if has_captures else a[rows.STAY + i]
    is_quiet = stay == a[rows.STAY + i]
    if is_moved:
        count_hit(a, i, hit)
        a[rows.STAY + i], a[rows.WALL + i] = stay, hit
    move(a, i, flight, is_moved, is_quiet, (t, t_low, at.x, at.y, vx_s, vy_s))
    return is_moved, at_hit


@part
def arrive(a, i, flight, outset, end, there):
    """Return time, place and laws at the end of a flight, and whether the particle moves on to there."""
    t, low = two_sum(a[rows.T + i], flight.s)
    t, t_low = short_sum(t, low + (a[rows.T_LOW + i] + flight.delta))
    x_s, x_low = short_sum(end.x, fma(outset.vx, flight.delta, end.x_low))
    y_s, y_low = short_sum(end.y, fma(outset.vy, flight.delta, end.y_low))
    is_moved = t < a[rows.STOP + i] if flight.result == rows.LATE else False
    return t, t_low, Place(x_s, x_low, y_s, y_low), laws_at_hit(there, flight.delta), is_moved


@packed
def move(a, i, flight, is_moved, is_quiet, state):
    """Take a state for the present one, where the particle moves on, and write what became of the flight."""
    s, delta, within, result = flight
    t, t_low, x, y, vx, vy = state
    fate = rows.MOVED if t < a[rows.END + i] else rows.MARKED
    fate = fate if is_quiet else rows.MARKED
    a[rows.FATE + i] = fate if is_moved else result
    a[rows.WHEN + i] = t
    a[rows.S + i] = s + delta if within > 0.0 else s  # from laws out of their reach nothing is learnt
    tries = a[rows.TRIES + i] + 1.0
    a[rows.TRIES + i] = tries if result == rows.COARSE else (tries if result == rows.FAR else 0.0)
    if is_moved:
        a[rows.T + i], a[rows.T_LOW + i], a[rows.X + i], a[rows.Y + i], a[rows.VX + i], a[rows.VY + i] = (
            t,
            t_low,
            x,
            y,
            vx,
            vy,
        )


@packed
def error_left(curvature, s, delta, waves):
    """Return `error` of docs/lanes.md, from f'' / (2 f')."""
    left = abs(curvature)
    if waves is not None:  # sine and cosine after delta are taken to first order
        left = fma(0.0625 * waves.omega * waves.omega, s, left)
    return 2.0**58 * left * delta * delta


@packed
def fly(a, n, scene, waves, slope, form, limits):
    """Find the next collision of each lane, and take the step where it is shown right."""
    widest_registers()
    is_stem, is_relative = scene.table == STEM, scene.is_relative
    table = is_stem, scene.table == MUSHROOM, is_relative
    for i in range(n):
        aim(a, i, is_stem, is_relative, waves, slope, form, limits)
    for i in range(n):
        look_ahead(a, i, a[rows.S + i], waves, is_relative, slope, form)
    for i in range(n):
        land(a, i, table, waves, slope, form, limits)


@packed
def chord(a, n, scene, waves, slope, form, limits):
    """Find the next arc hit of captured particles: the base is unfolded, |L| is constant.

    The chord keeps the distance |L| / v from the centre; while that exceeds w the mouth is out of reach.
    """
    widest_registers()
    bend, k_w, size = limits.bend, limits.curvature, limits.size
    is_cap, is_relative = scene.table == CAP, scene.is_relative
    for i in range(n):
        outset, now = outset_of(a, i), laws_in(a, rows.R0 + i, waves, is_relative, slope, form)
        inverse = ONE / (outset.v2 - fma(now.r1, now.r1, now.r * now.r2))
        s = 2.0 * fma(now.r, now.r1, -outset.q) * inverse
        s = s * fma(cube_of_arc(now.r, now.r1, now.r2, now.r3) * s, inverse, 1.0)
        a[rows.S + i] = a[rows.S + i] if a[rows.TRIES + i] > 0.0 else s
        a[rows.SURE + i] = now.w
    for i in range(n):
        look_ahead(a, i, a[rows.S + i], waves, is_relative, slope, form)
    for i in range(n):
        outset, spin = outset_of(a, i), a[rows.SPIN + i]
        x, y, vx, vy, _, _, v2 = outset
        s = a[rows.S + i]
        there = laws_in(a, rows.AHEAD + i, waves, is_relative, slope, form)
        f, rate, sizes, known = along_arc(a, i, s, outset, there, waves, form, limits)
        inverse = ONE / rate
        delta = -f * inverse
        error = error_left((bend + v2) * inverse, s, delta, waves)
        end = place_after(s, x, y, vx, vy)
        # The widest that the mouth can be during the flight, from both ends.
        reach = max(a[rows.SURE + i], there.w) + fma(k_w * s, s, SAFETY * size)
        clear = spin * spin - (1.0 + 4.0 * SAFETY) * reach * reach * v2
        clear = 1.0 if is_cap else clear
        first = -rate - 2.0 * SAFETY * sizes
        slack = slack_of(s, 2.0 * SAFETY * s * sizes, delta, inverse, error)
        place = abs(end.y) - fma(abs(vy), fma(SAFETY, s, slack), SAFETY * abs(y))
        quality = min(min(clear, place), min(first, v2 - bend))
        quality = min(min(quality, s), known)
        within, ahead = room_ahead(a, i, s, delta, waves)
        result = verdict(quality, min(within, ahead), s, error, a[rows.TRIES + i])
        flight = Judged(s, delta, within, result)
        t, t_low, at, at_hit, is_moved = arrive(a, i, flight, outset, end, there)
        # The angular momentum of the whole stay is constant to the bit.
        vx_s, vy_s = off_the_arc_spinning(at, vx, vy, at_hit.r, at_hit.r1, spin)
        # A chord that crosses y = 0 hits the base.
        crossed = 1.0 if y * at.y < 0.0 else 0.0
        if is_moved:
            a[rows.N_ARC + i] += 1.0
            a[rows.N_BASE + i] += crossed
        move(a, i, flight, is_moved, True, (t, t_low, at.x, at.y, vx_s, vy_s))
        if is_moved:
            move_laws(a, i, delta, at_hit, waves, slope)
