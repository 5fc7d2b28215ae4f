"""Many particles in lock step: each loop below is branch-free, and the compiler vectorises it.

Idea. Particles sit side by side in lanes. `fly` gives every lane its next collision: it picks the
wall and a first guess of the time, corrects it once, and checks; `bounce` reflects. `chord` and
`rebound` do the same for captured particles, unfolded through the base. A lane whose step is not
shown right by the checks is left to the careful step (fast.kernel.follow): a lane is fast, never wrong.

Laws. From a reference time on, a law is f + f' G1(u) + f'' G2(u), with G1 = sin(omega u) / omega
and G2 = (1 - cos(omega u)) / omega^2: exact for one harmonic, and with omega = 0 for half a
bang-bang leg. Laws of several harmonics and moving slopes have no lanes.

What a lane's step claims, and which inequality in which line carries it, for every kind of flight and every
wall on it, rounding included: docs/lanes.md. In short: Newton leaves less than 2^-57 of the time;
a wall that is not met has f > K s^2 at the end, so that f was positive all along; the wall that is met has
|f'| > K s, or f is concave. Quotients are compared by cross-multiplication, so a flight costs two divisions
and one square root.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from fast.kernel.arithmetic import SAFETY, dot, fma, two_sum
from fast.kernel.codes import ARC, BASE, FLOOR, LEFT, RIGHT
from fast.kernel.short import law, moved, short_sum, turns
from fast.kernel.walls import off_the_arc, off_the_arc_spinning

LANES = 64  # all rows of a pool stay in the first-level cache
LONGEST_TURN = 0.25  # omega u up to which the series are used
NEVER = np.inf
ONE = np.float64(1.0)  # its quotient by 0 is infinite without the compiler too

# Rows of a pool, LANES numbers each, in one flat array: constant strides let the loops vectorise.
(
    T, T_LOW, X, Y, VX, VY, WALL,  # state at the last collision
    R0, R1, R2, W0, W1, W2, H0, H1, H2,  # radius, half-width, depth there, with two derivatives
    REF, REF_LOW, END, KNOT,  # the laws' reference time, until when it serves, when the next knot comes
    R_REF, R_REF_LOW, R_REF1, R_REF2,  # radius there, its low part, two derivatives
    N_REF, N_REF_LOW, N_REF1, N_REF2,  # w or nu
    H_REF, H_REF_LOW, H_REF1, H_REF2,  # depth
    S, HIT, SURE, OK, CALM,  # the step: time, wall, mouth; whether it is right; whether nothing else is to do
    NEXT_T, NEXT_T_LOW, NEXT_X, NEXT_X_LOW, NEXT_Y, NEXT_Y_LOW, NEXT_VX, NEXT_VY, DONE,  # state after it
    NEXT_R0, NEXT_R1, NEXT_R2, NEXT_W0, NEXT_W1, NEXT_W2, NEXT_H0, NEXT_H1, NEXT_H2,
    STOP, SINCE, UNTIL,  # next time to look at the particle; a captured stay that spans one between is kept
    STAY_IN, STAY_OUT, CLOSED, SPIN,  # the captured stay, its end once it is over, angular momentum
    N_ARC, N_BASE, N_LEFT, N_RIGHT, N_FLOOR,  # collisions so far
) = LANES * np.arange(67)  # fmt: skip
N_ROWS = 67
# Codes of walls as they stand in a row, and of OK.
ON_ARC, ON_BASE, ON_LEFT, ON_RIGHT, ON_FLOOR = map(float, (ARC, BASE, LEFT, RIGHT, FLOOR))
WRONG, COARSE, RIGHT_ONE = 0.0, 1.0, 2.0
CLEARLY_CAPTURED = 1.05  # |L| over w v from which a particle moves to the disk's pool


@njit(error_model="numpy")
def aim(a, n, is_stem, m, limits):
    """Choose each lane's wall and guess the time, walls moving at their speed now.

    SURE is positive only where the part of the flight before y = 0 is as chosen: docs/lanes.md.
    """
    bend, k_w, rate_w, size = limits.bend, limits.curvature, limits.rate, limits.size
    per_r, least_h = 2.0 / limits.least_r, limits.least_h
    for i in range(n):
        x, y, vx, vy, wall = a[X + i], a[Y + i], a[VX + i], a[VY + i], a[WALL + i]
        r0, r1, r2 = a[R0 + i], a[R1 + i], a[R2 + i]
        w0, w1, w2 = a[W0 + i], a[W1 + i], a[W2 + i]
        h0, h1, h2 = a[H0 + i], a[H1 + i], a[H2 + i]
        depth, rise = abs(y), abs(vy)
        # The crossing of y = 0, all times |vy|: on which side of the mouth's edge.
        gap = fma(w0, rise, w1 * depth) - abs(x * vy - y * vx)
        v2 = fma(vx, vx, vy * vy)
        excess = bend - v2
        excess = excess if excess > 0.0 else 0.0  # by how much the arc's function may be convex, halved
        doubt = (k_w + excess * per_r) * depth * depth
        doubt = fma(SAFETY * rise, fma(size + abs(x), rise, (abs(vx) + rate_w) * depth), doubt)
        lift = least_h * rise * rise - k_w * depth * depth
        # Sides and floor: the least f / -f', by cross-multiplication.
        edge, drift = fma(m, y, w0), fma(m, vy, w1)
        f_r = 0.0 if wall == ON_RIGHT else edge - x
        f_l = 0.0 if wall == ON_LEFT else edge + x
        f_f = 0.0 if wall == ON_FLOOR else y + h0
        d_r, d_l, d_f = vx - drift, -vx - drift, -vy - h1
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
        # The arc, to second order in time.
        q = fma(x, vx, y * vy)
        c = fma(-x, x, (r0 - y) * (r0 + y))
        c = 0.0 if wall == ON_ARC else c
        a2 = v2 - fma(r1, r1, r0 * r2)
        b = fma(-r0, r1, q)
        root = np.sqrt(fma(b, b, a2 * c))
        f_a = c if b > 0.0 else root - b
        d_a = b + root if b > 0.0 else a2
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
        inverse = ONE / d
        s = f * inverse
        bend_s = h2 if hit == ON_FLOOR else w2
        bend_s = bend_s if hit >= ON_LEFT else 0.0
        s = s * fma(0.5 * bend_s * s, inverse, 1.0)
        # Comparisons so put that what is no number is never sure.
        whole = reaches if is_in_cap > 0.5 else stays
        gap = gap * rise
        sure = abs(gap) - doubt if is_in_cap > 0.5 else min(gap - doubt, lift)
        sure = 1.0 if is_stem else sure
        sure = 1.0 if whole > 0.0 else sure
        # The arc's function must be concave.
        concave = v2 - bend if hit == ON_ARC else 1.0
        a[HIT + i], a[S + i], a[SURE + i] = hit, s, min(concave, sure)


def _fly(is_mixed):
    @njit(error_model="numpy")
    def fly(a, n, is_stem, is_relative, omega, m, limits, omegas):
        """Correct each lane's time of flight once, and tell whether the step is then right and calm."""
        bend, k_w, rate_w, size_w = limits.bend, limits.curvature, limits.rate, limits.size
        omega_r = omegas.radius if is_mixed else omega
        omega_w = omegas.width if is_mixed else omega
        omega_h = omegas.depth if is_mixed else omega
        for i in range(n):
            x, y, vx, vy, wall = a[X + i], a[Y + i], a[VX + i], a[VY + i], a[WALL + i]
            r0, r1_0, r2_0, hit, s = a[R0 + i], a[R1 + i], a[R2 + i], a[HIT + i], a[S + i]
            since = ((a[T + i] - a[REF + i]) + (a[T_LOW + i] - a[REF_LOW + i])) + s
            g1, g2, g0 = turns(omega_r, since)
            r, r1, r2 = law(a[R_REF + i], a[R_REF_LOW + i], a[R_REF1 + i], a[R_REF2 + i], omega_r, g1, g2, g0)
            if is_mixed:
                g1, g2, g0 = turns(omega_w, since)
            w, w1, w2 = law(a[N_REF + i], a[N_REF_LOW + i], a[N_REF1 + i], a[N_REF2 + i], omega_w, g1, g2, g0)
            if is_mixed:
                g1, g2, g0 = turns(omega_h, since)
            h, h1, h2 = law(a[H_REF + i], a[H_REF_LOW + i], a[H_REF1 + i], a[H_REF2 + i], omega_h, g1, g2, g0)
            w2 = fma(w2, r, fma(w, r2, 2.0 * w1 * r1)) if is_relative else w2
            w1 = fma(w1, r, w * r1) if is_relative else w1
            nu = w
            w = nu * r if is_relative else nu
            w_low = fma(nu, r, -w) if is_relative else 0.0
            x_s, x_low = moved(x, vx, s)
            y_s, y_low = moved(y, vy, s)
            sign = 1.0 if hit == ON_RIGHT else -1.0
            f = (w - sign * x_s) + (fma(m, y_s, w_low) + fma(m, y_low, -sign * x_low))
            slope = fma(m, vy, w1) - sign * vx
            f = (y_s + h) + y_low if hit == ON_FLOOR else f
            slope = vy + h1 if hit == ON_FLOOR else slope
            # The arc: its increments if it was left, else what is there.
            g1, g2, _ = turns(omega_r, s)
            dr = fma(r1_0, g1, r2_0 * g2)
            q = fma(x, vx, y * vy)
            v2 = fma(vx, vx, vy * vy)
            hop = dr * (2.0 * r0 + dr) - s * fma(s, v2, 2.0 * q)
            f_arc = fma(-x_s, x_s, (r - y_s) * (r + y_s)) - 2.0 * fma(x_s, x_low, y_s * y_low)
            f_arc = hop if wall == ON_ARC else f_arc
            f = f_arc if hit == ON_ARC else f
            slope = 2.0 * fma(r, r1, -fma(s, v2, q)) if hit == ON_ARC else slope
            bend_s = 2.0 * (bend + v2) if hit == ON_ARC else k_w
            f = y_s + y_low if hit == ON_BASE else f
            slope = vy if hit == ON_BASE else slope
            bend_s = 0.0 if hit == ON_BASE else bend_s
            inverse = ONE / slope
            delta = -f * inverse
            error = 2.0**58 * abs(0.5 * bend_s * inverse) * delta * delta
            # The others are not reached: see the error analysis. The mouth was looked at.
            edge = fma(m, y_s, w)
            clear_r = edge - x_s if hit != ON_RIGHT else NEVER
            clear_l = edge + x_s if hit != ON_LEFT else NEVER
            clear_f = y_s + h if hit != ON_FLOOR else NEVER
            way = (abs(vx) + abs(vy)) * s
            far = k_w * s * s + SAFETY * (size_w + abs(x) + abs(y) + way)
            clear = min(clear_r, min(clear_l, clear_f)) - far
            quality = min(a[SURE + i], clear if hit >= (ON_ARC if is_stem else ON_LEFT) else 1.0)
            # An arc is met above y = 0, sides and floor below, the base inside the arc, all on the way out.
            place = y_s if hit == ON_ARC else -y_s
            place -= SAFETY * (abs(y) + abs(vy) * s)
            excess = bend - v2
            excess = excess if excess > 0.0 else 0.0
            inside = r - abs(x_s) - SAFETY * (size_w + abs(x) + abs(vx) * s)
            inside = fma(inside, limits.least_r, -2.0 * excess * s * s)
            inside = 1.0 if is_stem else inside
            place = inside if hit == ON_BASE else place
            first = -slope - (k_w * s + SAFETY * (abs(vx) + abs(vy) + rate_w))
            sizes = abs(x * vx) + abs(y * vy) + fma(s, v2, r * rate_w)
            first = -slope - 2.0 * SAFETY * sizes if hit == ON_ARC else first
            first = 1.0 if hit == ON_BASE else first
            quality = min(min(quality, place), min(first, s))
            quality = min(quality, LONGEST_TURN - omega * since)
            t, low = two_sum(a[T + i], s)
            t, low = two_sum(t, low + (a[T_LOW + i] + delta))
            result = RIGHT_ONE if error < s else COARSE
            result = result if quality > 0.0 else WRONG
            result = result if s < NEVER else WRONG
            calm = result - COARSE if t < min(a[STOP + i], a[END + i]) else 0.0
            calm = calm if a[CLOSED + i] == NEVER else 0.0
            a[CALM + i] = calm if a[SPIN + i] == 0.0 else 0.0
            a[S + i] = s + delta
            a[OK + i] = result
            a[NEXT_T + i] = t
            a[NEXT_T_LOW + i] = low
            a[NEXT_X + i], a[NEXT_X_LOW + i] = short_sum(x_s, fma(vx, delta, x_low))
            y_s, y_low = short_sum(y_s, fma(vy, delta, y_low))
            a[NEXT_Y + i] = 0.0 if hit == ON_BASE else y_s
            a[NEXT_Y_LOW + i] = y_low
            a[NEXT_R0 + i], a[NEXT_R1 + i] = fma(r1, delta, r), fma(r2, delta, r1)
            a[NEXT_R2 + i] = fma(-omega_r * omega_r * r1, delta, r2)
            a[NEXT_W0 + i], a[NEXT_W1 + i], a[NEXT_W2 + i] = fma(w1, delta, w), fma(w2, delta, w1), w2
            a[NEXT_H0 + i], a[NEXT_H1 + i], a[NEXT_H2 + i] = fma(h1, delta, h), fma(h2, delta, h1), h2

    return fly


@njit(error_model="numpy")
def arrive(a, i):
    """Take the laws and the place at the collision as the present ones."""
    a[T + i], a[T_LOW + i] = a[NEXT_T + i], a[NEXT_T_LOW + i]
    a[X + i], a[Y + i], a[WALL + i] = a[NEXT_X + i], a[NEXT_Y + i], a[HIT + i]
    a[R0 + i], a[R1 + i], a[R2 + i] = a[NEXT_R0 + i], a[NEXT_R1 + i], a[NEXT_R2 + i]
    a[W0 + i], a[W1 + i], a[W2 + i] = a[NEXT_W0 + i], a[NEXT_W1 + i], a[NEXT_W2 + i]
    a[H0 + i], a[H1 + i], a[H2 + i] = a[NEXT_H0 + i], a[NEXT_H1 + i], a[NEXT_H2 + i]


@njit(error_model="numpy")
def bounce(a, n, m, is_mushroom):
    """Bounce off the wall met, v - 2 f' grad f / |grad f|^2; count the hit; watch captured stays.

    A stay in the cap counts as captured from its first arc hit with |sin phi| > nu (angles before
    the bounce, eq. sinphi) to the hit at which that ended.
    """
    tilt, inverse = (m - 1.0) * (m + 1.0) / (1.0 + m * m), 2.0 / (1.0 + m * m)
    for i in range(n):
        x, y, vx, vy, hit = a[NEXT_X + i], a[NEXT_Y + i], a[VX + i], a[VY + i], a[HIT + i]
        w = a[NEXT_W0 + i]
        off_x, off_y = off_the_arc(
            x, a[NEXT_X_LOW + i], y, a[NEXT_Y_LOW + i], vx, vy, a[NEXT_R0 + i], a[NEXT_R1 + i]
        )
        sign = 1.0 if hit == ON_RIGHT else -1.0
        out, rate = sign * vx, a[NEXT_W1 + i]
        vx_s = sign * fma(tilt, out, inverse * fma(m, vy, rate))
        vy_s = fma(inverse * m, out - rate, -tilt * vy)
        vx_s = vx if hit == ON_FLOOR else vx_s
        vy_s = -vy - 2.0 * a[NEXT_H1 + i] if hit == ON_FLOOR else vy_s
        vx_s = vx if hit == ON_BASE else vx_s
        vy_s = -vy if hit == ON_BASE else vy_s
        vx_s = off_x if hit == ON_ARC else vx_s
        vy_s = off_y if hit == ON_ARC else vy_s
        vx_s = a[NEXT_VX + i] if a[DONE + i] > 0.0 else vx_s
        vy_s = a[NEXT_VY + i] if a[DONE + i] > 0.0 else vy_s
        spin = x * vy - y * vx
        beyond = spin * spin - w * w * fma(vx, vx, vy * vy)
        beyond = beyond if hit == ON_ARC else 0.0
        beyond = beyond if is_mushroom else 0.0  # > 0: captured
        t, begin, end = a[NEXT_T + i], a[STAY_IN + i], a[STAY_OUT + i]
        # At the arc: the stay begins, goes on, or (once, until captured again) ends.
        first_end = min(end, t) if begin < NEVER else end
        end = first_end if hit == ON_ARC else end
        end = NEVER if beyond > 0.0 else end
        begin = min(begin, t) if beyond > 0.0 else begin
        # Below the mouth: it is over, and kept if it spans an instant in question.
        last = min(end, t)
        kept = last if begin <= a[UNTIL + i] else NEVER
        kept = kept if a[SINCE + i] <= last else NEVER
        kept = kept if begin < NEVER else NEVER
        kept = kept if hit >= ON_LEFT else NEVER
        a[CLOSED + i] = kept
        left = NEVER if kept == NEVER else begin
        a[STAY_IN + i] = left if hit >= ON_LEFT else begin
        a[STAY_OUT + i] = NEVER if hit >= ON_LEFT else end
        spin = dot(x, vy_s, -y, vx_s)
        clearly = CLEARLY_CAPTURED * CLEARLY_CAPTURED * w * w * fma(vx_s, vx_s, vy_s * vy_s)
        spin = spin if spin * spin > clearly else 0.0
        a[SPIN + i] = spin if beyond > 0.0 else 0.0
        a[VX + i] = vx_s
        a[VY + i] = vy_s
        a[DONE + i] = 0.0
        a[N_ARC + i] += 1.0 if hit == ON_ARC else 0.0
        a[N_BASE + i] += 1.0 if hit == ON_BASE else 0.0
        a[N_LEFT + i] += 1.0 if hit == ON_LEFT else 0.0
        a[N_RIGHT + i] += 1.0 if hit == ON_RIGHT else 0.0
        a[N_FLOOR + i] += 1.0 if hit == ON_FLOOR else 0.0
        arrive(a, i)


def _chord(is_mixed):
    @njit(error_model="numpy")
    def chord(a, n, is_again, is_cap, is_relative, omega, limits, omegas):
        """Find the next arc hit of captured particles: the base is unfolded, |L| is constant.

        The chord keeps the distance |L| / v from the centre; while that exceeds w the mouth is out of reach.
        `is_again`: correct the times found before once more, in place of a new guess.
        """
        bend, k_w, rate_w, size = limits.bend, limits.curvature, limits.rate, limits.size
        omega_r = omegas.radius if is_mixed else omega
        omega_w = omegas.width if is_mixed else omega
        for i in range(n):
            x, y, vx, vy, spin = a[X + i], a[Y + i], a[VX + i], a[VY + i], a[SPIN + i]
            r0, r1_0, r2_0 = a[R0 + i], a[R1 + i], a[R2 + i]
            v2 = fma(vx, vx, vy * vy)
            q = fma(x, vx, y * vy)
            s = 2.0 * fma(r0, r1_0, -q) / (v2 - fma(r1_0, r1_0, r0 * r2_0))
            s = a[S + i] if is_again else s
            since = ((a[T + i] - a[REF + i]) + (a[T_LOW + i] - a[REF_LOW + i])) + s
            g1, g2, g0 = turns(omega_r, since)
            r, r1, r2 = law(a[R_REF + i], a[R_REF_LOW + i], a[R_REF1 + i], a[R_REF2 + i], omega_r, g1, g2, g0)
            if is_mixed:
                g1, g2, g0 = turns(omega_w, since)
            w, w1, _ = law(a[N_REF + i], a[N_REF_LOW + i], a[N_REF1 + i], a[N_REF2 + i], omega_w, g1, g2, g0)
            w1 = fma(w1, r, w * r1) if is_relative else w1
            w = w * r if is_relative else w
            g1, g2, _ = turns(omega_r, s)
            dr = fma(r1_0, g1, r2_0 * g2)
            way = fma(s, v2, 2.0 * q)
            f = dr * (2.0 * r0 + dr) - s * way
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
            sizes = abs(x * vx) + abs(y * vy) + fma(s, v2, r * rate_w)
            first = -slope - 2.0 * SAFETY * sizes
            quality = min(min(clear, abs(y_s) - SAFETY * (abs(y) + abs(vy) * s)), min(first, v2 - bend))
            quality = min(min(quality, s), LONGEST_TURN - omega * since)
            t, low = two_sum(a[T + i], s)
            t, low = two_sum(t, low + (a[T_LOW + i] + delta))
            result = RIGHT_ONE if error < s else COARSE
            result = result if quality > 0.0 else WRONG
            result = result if s < NEVER else WRONG
            a[S + i] = s + delta
            a[OK + i] = result
            a[NEXT_T + i] = t
            a[NEXT_T_LOW + i] = low
            a[NEXT_X + i], a[NEXT_X_LOW + i] = short_sum(x_s, fma(vx, delta, x_low))
            a[NEXT_Y + i], a[NEXT_Y_LOW + i] = short_sum(y_s, fma(vy, delta, y_low))
            a[NEXT_R0 + i], a[NEXT_R1 + i] = fma(r1, delta, r), fma(r2, delta, r1)
            a[NEXT_R2 + i] = fma(-omega_r * omega_r * r1, delta, r2)
            a[NEXT_W0 + i], a[NEXT_W1 + i] = fma(w1, delta, w), w1
            a[CALM + i] = result - COARSE if t < min(a[STOP + i], a[END + i]) else 0.0

    return chord


@njit(error_model="numpy")
def rebound(a, n):
    """Bounce off the arc with the angular momentum of the whole stay, constant to the bit; count."""
    for i in range(n):
        x, y, vx, vy, spin = a[NEXT_X + i], a[NEXT_Y + i], a[VX + i], a[VY + i], a[SPIN + i]
        low_x, low_y, r, rate = a[NEXT_X_LOW + i], a[NEXT_Y_LOW + i], a[NEXT_R0 + i], a[NEXT_R1 + i]
        vx_s, vy_s = off_the_arc_spinning(x, low_x, y, low_y, vx, vy, r, rate, spin)
        is_done = a[DONE + i]
        a[VX + i] = a[NEXT_VX + i] if is_done > 0.0 else vx_s
        a[VY + i] = a[NEXT_VY + i] if is_done > 0.0 else vy_s
        # A chord that crosses y = 0 hits the base; what careful did was counted there.
        crossed = 1.0 if a[Y + i] * y < 0.0 else 0.0
        a[N_ARC + i] += 1.0 - is_done
        a[N_BASE + i] += 0.0 if is_done > 0.0 else crossed
        a[DONE + i] = 0.0
        a[T + i], a[T_LOW + i], a[X + i], a[Y + i] = a[NEXT_T + i], a[NEXT_T_LOW + i], x, y
        a[R0 + i], a[R1 + i], a[R2 + i] = a[NEXT_R0 + i], a[NEXT_R1 + i], a[NEXT_R2 + i]
        a[W0 + i], a[W1 + i] = a[NEXT_W0 + i], a[NEXT_W1 + i]


# Where some laws are Fourier's and others have knots each needs its own omega; else all share one, and a
# constant law any. Two loops, for the choice inside one would cost all scenes.
fly, fly_mixed = _fly(False), _fly(True)
chord, chord_mixed = _chord(False), _chord(True)
