"""The walls as functions f > 0 inside: their values along a flight, and bounds that hold for all time.

A wall function is a sum of a few products of rounded numbers, so `SAFETY` times the sum of their
sizes bounds its error; every value of f comes with such a bound. Source: sec. 2, D_stem and D_cap.
"""

import numpy as np

from fast.kernel.arithmetic import SAFETY, dot, fma, mul, products, quotient, two_product, two_sum
from fast.kernel.compiling import kernel, packed, part
from fast.kernel.laws import increment, rest, width
from fast.kernel.records import ARC, BASE, CAP, FLOOR, LEFT, MUSHROOM, NO_WALL, RIGHT, STEM

from fast.kernel.records import (  # isort: skip
    BEND, DEPTH, FASTEST, HIGHEST, LOWEST, RADIUS, RATE, SLOPE, VALUE, VALUE_LOW, WIDTH,
)  # fmt: skip


@kernel
def wall_function(wall, s, particle, residual, scene, anchors):
    """Return f(s), f'(s) and the rounding errors of both, for one wall (f > 0 inside).

    `residual` is f(0), or 0 on the wall being left. Source: sec. 2, D_stem and D_cap.
    """
    y, vx, vy = particle.y, particle.vx, particle.vy
    if wall == ARC:
        x = particle.x
        d_r, r_rate, r_size, r_rate_size = increment(scene.laws, anchors, RADIUS, s)
        r = anchors[RADIUS, VALUE]
        q = dot(x, vx, y, vy)
        v2 = vx * vx + vy * vy
        f = residual + (d_r * (2.0 * r + d_r) - s * (2.0 * q + s * v2))
        slope = 2.0 * ((r + d_r) * r_rate - (q + s * v2))
        error = abs(residual) + r_size * (2.0 * r + r_size) + s * (2.0 * abs(q) + s * v2)
        slope_error = 2.0 * ((r + abs(d_r)) * r_rate_size + abs(q) + s * v2)
        return f, slope, SAFETY * error, SAFETY * slope_error
    if wall == FLOOR:
        d_h, h_rate, h_size, h_rate_size = increment(scene.laws, anchors, DEPTH, s)
        f = residual + (vy * s + d_h)
        error = abs(residual) + abs(vy) * s + h_size
        return f, vy + h_rate, SAFETY * error, SAFETY * (abs(vy) + h_rate_size)
    _, d_w, w_rate, w_size, w_rate_size = width(scene, anchors, s)
    d_m, m_rate, m_size, m_rate_size = increment(scene.laws, anchors, SLOPE, s)
    m = anchors[SLOPE, VALUE]
    outward = vx if wall == RIGHT else -vx
    y_s = y + vy * s
    f = residual + (d_w + d_m * y_s + s * (m * vy - outward))
    slope = w_rate + m_rate * y_s + (m + d_m) * vy - outward
    # y_s is rounded as its terms are, however small it is.
    error = abs(residual) + w_size + m_size * (abs(y) + abs(vy) * s) + s * (abs(m * vy) + abs(vx))
    slope_error = w_rate_size + m_rate_size * (abs(y) + abs(vy) * s) + (abs(m) + m_size) * abs(vy) + abs(vx)
    return f, slope, SAFETY * error, SAFETY * slope_error


@kernel
def wall_residual(wall, x, y, scene, anchors):
    """Return f(0), right to its last bits, and a bound on its error had it been summed plainly.

    The second value is used only to judge given states, whose coordinates are rounded.
    """
    if wall == ARC:
        r, r_low = anchors[RADIUS, VALUE], anchors[RADIUS, VALUE_LOW]
        r2, r2_low = two_product(r, r)
        x2, x2_low = two_product(x, x)
        y2, y2_low = two_product(y, y)
        a, a_low = two_sum(r2, -x2)
        b, b_low = two_sum(a, -y2)
        low = b_low + a_low + (r2_low - x2_low - y2_low) + 2.0 * r * r_low
        return b + low, SAFETY * r2
    if wall == FLOOR:
        f, f_low = two_sum(y, anchors[DEPTH, VALUE])
        return f + (f_low + anchors[DEPTH, VALUE_LOW]), SAFETY * anchors[DEPTH, VALUE]
    w, w_low = anchors[WIDTH, VALUE], anchors[WIDTH, VALUE_LOW]
    if scene.is_relative:
        w, w_low = mul((w, w_low), (anchors[RADIUS, VALUE], anchors[RADIUS, VALUE_LOW]))
    tilt, tilt_low = mul((anchors[SLOPE, VALUE], anchors[SLOPE, VALUE_LOW]), (y, 0.0))
    f, f_low = two_sum(w, -x if wall == RIGHT else x)
    f, e = two_sum(f, tilt)
    error = SAFETY * (w + abs(tilt) + abs(x))
    return f + (f_low + e + w_low + tilt_low), error


@kernel
def width_rate(scene, anchors):
    """Return w' at the time of the anchors."""
    rate = anchors[WIDTH, RATE]
    if not scene.is_relative:
        return rate
    return rate * anchors[RADIUS, VALUE] + anchors[WIDTH, VALUE] * anchors[RADIUS, RATE]


@kernel
def wall_slope(wall, x, y, vx, vy, scene, anchors):
    """Return f' of a wall at the time of the anchors."""
    if wall == BASE:
        return vy
    if wall == ARC:
        return 2.0 * fma(anchors[RADIUS, VALUE], anchors[RADIUS, RATE], -dot(x, vx, y, vy))
    if wall == FLOOR:
        return vy + anchors[DEPTH, RATE]
    return (
        width_rate(scene, anchors)
        + anchors[SLOPE, RATE] * y
        + (anchors[SLOPE, VALUE] * vy - (vx if wall == RIGHT else -vx))
    )


@packed
def off_the_arc(place, vx, vy, r, rate):
    """Return the velocity after a hit on the arc: v - 2 f' grad f / |grad f|^2 = v - 2 (v.n - r') n.

    The place's low part matters: its rounding would turn the normal.
    """
    x, x_low, y, y_low = place
    q, q_low = products(x, x_low, vx, 0.0, y, y_low, vy, 0.0)
    rho2, rho2_low = products(x, x_low, x, x_low, y, y_low, y, y_low)
    p, p_low = two_product(r, rate)
    n, n_low = two_sum(p, -q)
    push, low = quotient(2.0 * n, 2.0 * (n_low + (p_low - q_low)), rho2, rho2_low)
    x_push, y_push = fma(push, x_low, low * x), fma(push, y_low, low * y)
    return fma(push, x, vx) + x_push, fma(push, y, vy) + y_push


@kernel
def curvature_bounds(wall, vx, vy, bounds):
    """Return K >= -inf f'' and L >= sup f'' for all time, from the laws' bounds."""
    if wall == ARC:
        bend = bounds[RADIUS, HIGHEST] * bounds[RADIUS, BEND]
        v2 = vx * vx + vy * vy
        return (
            2.0 * (bend + v2) * (1.0 + SAFETY),
            2.0 * (bend + bounds[RADIUS, FASTEST] * bounds[RADIUS, FASTEST] - v2) + SAFETY * v2,
        )
    if wall == FLOOR:
        return bounds[DEPTH, BEND], bounds[DEPTH, BEND]
    k = (
        bounds[WIDTH, BEND]
        + bounds[SLOPE, BEND] * bounds[DEPTH, HIGHEST]
        + 2.0 * bounds[SLOPE, FASTEST] * abs(vy)
    )
    return k * (1.0 + SAFETY), k * (1.0 + SAFETY)


@part
def law_size(wall, y, bounds):
    """Bound the summed sizes of all terms of the laws in a wall function.

    A positive law's amplitudes add up to at most 2 sqrt(MAX_HARMONICS) = 8 times its highest value, by
    Parseval; two such laws are multiplied at most.
    """
    if wall == ARC:
        return 64.0 * bounds[RADIUS, HIGHEST] * bounds[RADIUS, HIGHEST]
    if wall == FLOOR:
        return 64.0 * bounds[DEPTH, HIGHEST]
    return 64.0 * (
        bounds[WIDTH, HIGHEST] + max(abs(bounds[SLOPE, LOWEST]), abs(bounds[SLOPE, HIGHEST])) * abs(y)
    )


@kernel
def wall_rest(wall, s, scene, anchors):
    """Return for how long after the time s a wall stands still."""
    if wall == ARC:
        return rest(scene.laws, anchors, RADIUS, s)
    if wall == FLOOR:
        return rest(scene.laws, anchors, DEPTH, s)
    still = min(rest(scene.laws, anchors, WIDTH, s), rest(scene.laws, anchors, SLOPE, s))
    return min(still, rest(scene.laws, anchors, RADIUS, s)) if scene.is_relative else still


@part
def reach_time(wall, x, y, vx, vy, off, bounds):
    """Return a time before which the particle cannot reach what the wall ever sweeps.

    This lets a slow particle cross the middle of the table in one step. Rounding is taken off the gap, and
    `off`, by which f is less than the place says.
    """
    if wall == ARC:
        inner = bounds[RADIUS, LOWEST]
        gap = inner * inner - (x * x + y * y)
        v2 = vx * vx + vy * vy
        gap -= SAFETY * inner * inner + off
        if gap <= 0.0 or v2 == 0.0:
            return np.inf if gap > 0.0 else 0.0
        q = x * vx + y * vy
        root = np.sqrt(q * q + v2 * gap)
        return (gap / (q + root) if q > 0.0 else (root - q) / v2) * (1.0 - 4.0 * SAFETY)
    if wall == FLOOR:
        gap = y + bounds[DEPTH, LOWEST]
        size = abs(y) + bounds[DEPTH, LOWEST]
        speed = -vy
    else:
        m_lo, m_hi = bounds[SLOPE, LOWEST], bounds[SLOPE, HIGHEST]
        outward = vx if wall == RIGHT else -vx
        position = x if wall == RIGHT else -x
        if m_lo == m_hi:
            gap = bounds[WIDTH, LOWEST] + m_lo * y - position
            speed = outward - m_lo * vy
        else:
            gap = bounds[WIDTH, LOWEST] - max(abs(m_lo), abs(m_hi)) * bounds[DEPTH, HIGHEST] - position
            speed = outward
        size = bounds[WIDTH, LOWEST] + max(abs(m_lo), abs(m_hi)) * bounds[DEPTH, HIGHEST] + abs(x)
    gap -= SAFETY * size + off
    if gap <= 0.0:
        return 0.0
    if speed <= 0.0:
        return np.inf
    return gap / speed * (1.0 - 4.0 * SAFETY)


@kernel
def side_of_mouth(s, x, vx, scene, anchors):
    """Return +1 when the crossing of y = 0 after time s is within |x| < w, -1 beyond, 0 too close."""
    w, d_w, w_rate, w_size, w_rate_size = width(scene, anchors, s)
    x_s = abs(x + vx * s)
    margin = (w - x_s) + d_w
    # s is rounded, too: for a mouth that moves a long time after the event that counts most.
    rounding = SAFETY * s
    drift = abs(w_rate) + SAFETY * w_rate_size + rounding * scene.bounds[WIDTH, BEND]
    error = SAFETY * (w + w_size + abs(x) + abs(vx) * s) + rounding * (abs(vx) + drift)
    if margin > error:
        return 1
    return -1 if margin < -error else 0


@kernel
def crossed_wall(particle, scene, anchors):
    """Return a wall that the particle is beyond by more than rounding, NO_WALL for none."""
    table, y, wall = scene.table, particle.y, particle.wall
    in_cap = table == CAP or (table == MUSHROOM and (y > 0.0 or wall in (BASE, ARC)))
    if (table == CAP and y < 0.0 and wall != BASE) or (table == STEM and y > 0.0 and wall != BASE):
        return BASE
    if table == MUSHROOM and ((wall == ARC and y < 0.0) or (wall >= LEFT and y > 0.0)):
        return BASE
    for candidate in (ARC, LEFT, RIGHT, FLOOR):
        # On y = 0 both the arc and, below it, the sides bound the table; the mouth is checked in flight.
        is_bound = (candidate == ARC and table != STEM and y >= 0.0) or (
            candidate != ARC and table != CAP and (not in_cap) and (y < 0.0 or table == STEM)
        )
        if is_bound and candidate != wall:
            f, error = wall_residual(candidate, particle.x, y, scene, anchors)
            if f < -error:
                return candidate
    return NO_WALL
