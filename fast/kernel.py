"""One collision, found first by construction: the careful scalar step, compiled by numba.

Idea. Time runs from the last event, so nothing is lost when t is large; each law gives its
increment since that event without cancellation, and on the wall being left the root at zero is
removed. For a wall function f (> 0 inside) with f'' >= -K, the parabola f + f' h - K h^2 / 2
bounds f from below, so up to the parabola's root there is no hit: stepping from root to root
can never skip a collision, and converges quadratically to the first. Every value of f carries
a bound on its rounding error; where that bound leaves a question open the answer is `undecided`.

Everything compiled stands in this one file: numba's disk cache does not notice changes in
other modules. No fastmath, no libm: sine and cosine are made of + - * / alone, so all results
are the same bits on every machine. Laws and walls are numbered as in `fast.compiled`.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

# Codes of walls, outcomes and reasons; fast.compiled and fast.stepper give them names.
NO_WALL, ARC, BASE, LEFT, RIGHT, FLOOR = -1, 0, 1, 2, 3, 4
HORIZON, SLIDING, MOUTH_EDGE = 10, 20, 21
FAR_TIME, TOO_MANY, TANGENT, CORNER, EDGE, START = 31, 32, 33, 34, 35, 36
APPROACHING, OUTSIDE = 40, 41
CAP, STEM, MUSHROOM = 0, 1, 2
R, W, H, M = 0, 1, 2, 3  # rows of the law table: radius, width (w or nu), depth, slope
CONSTANT, FOURIER, BANG_BANG = 0.0, 1.0, 2.0
MAX_HARMONICS = 16
# The laws' rows anchored at the last event: value, derivative, half-leg (Fourier: size of the
# derivative's terms), time in the half-leg. All Fourier laws of a scene share their omega, so two
# more rows hold the harmonics' sines and cosines at the event, and their turn since, at one s.
PHASE, TURN = 4, 5
N_ANCHOR = 4 + 2 * MAX_HARMONICS
ANCHORS_SHAPE = (6, N_ANCHOR)

# A wall function is a sum of a few products of rounded numbers: eight units in the last place
# of the sum of their sizes bound its error.
SAFETY = 8.0 * 2.0**-53
MAX_PARABOLAS = 1_000_000
PATIENCE = 6  # parabolas tried before asking whether the wall is out of the particle's reach
MAX_QUADRANT = 2.0**27

# pi/2 in parts of 26 bits, so that a multiple below 2^27 of each is exact.
PIO2_1 = float.fromhex("0x1.921fb50000000p+0")
PIO2_2 = float.fromhex("0x1.110b460000000p-26")
PIO2_3 = float.fromhex("0x1.1a62630000000p-54")
PIO2_4 = float.fromhex("0x1.8a2e030000000p-81")
TWO_OVER_PI = 0.6366197723675814
SPLITTER = 134217729.0  # 2^27 + 1 (Veltkamp)


@njit(cache=True, inline="always")
def two_sum(a, b):
    """Return a + b as a rounded sum and its exact error."""
    s = a + b
    z = s - a
    return s, (a - (s - z)) + (b - z)


@njit(cache=True, inline="always")
def two_product(a, b):
    """Return a b as a rounded product and its exact error (no fused operation)."""
    p = a * b
    c = SPLITTER * a
    a1 = c - (c - a)
    a2 = a - a1
    c = SPLITTER * b
    b1 = c - (c - b)
    b2 = b - b1
    return p, ((a1 * b1 - p) + a1 * b2 + a2 * b1) + a2 * b2


@njit(cache=True)
def sine_cosine(omega, k, t_hi, t_lo):
    """Return sin and cos of k omega (t_hi + t_lo), and whether the phase could be reduced."""
    p, e = two_product(omega, t_hi)
    e += omega * t_lo
    q, f = two_product(k, p)
    f += k * e
    n = np.floor(q * TWO_OVER_PI + 0.5)
    if not abs(n) < MAX_QUADRANT:
        return 0.0, 1.0, False
    r = q - n * PIO2_1
    r, e1 = two_sum(r, -n * PIO2_2)
    r, e2 = two_sum(r, -n * PIO2_3)
    r, tail = two_sum(r, (e1 + e2) - n * PIO2_4 + f)
    sine, cosine = short_sine_cosine(r, tail)
    quadrant = int(n) & 3
    if quadrant == 0:
        return sine, cosine, True
    if quadrant == 1:
        return cosine, -sine, True
    if quadrant == 2:
        return -sine, -cosine, True
    return -cosine, sine, True


@njit(cache=True, inline="always")
def short_sine_cosine(r, tail):
    """Return sin and cos of r + tail for |r| <= pi/4, by their Taylor series to r^17."""
    z = r * r
    s = 1.0 / 355687428096000.0
    s = s * z - 1.0 / 1307674368000.0
    s = s * z + 1.0 / 6227020800.0
    s = s * z - 1.0 / 39916800.0
    s = s * z + 1.0 / 362880.0
    s = s * z - 1.0 / 5040.0
    s = s * z + 1.0 / 120.0
    s = s * z - 1.0 / 6.0
    c = 1.0 / 20922789888000.0
    c = c * z - 1.0 / 87178291200.0
    c = c * z + 1.0 / 479001600.0
    c = c * z - 1.0 / 3628800.0
    c = c * z + 1.0 / 40320.0
    c = c * z - 1.0 / 720.0
    c = c * z + 1.0 / 24.0
    sine = r + (r * z * s + tail * (1.0 - 0.5 * z))
    half = 0.5 * z
    w = 1.0 - half
    cosine = w + (((1.0 - w) - half) + (z * z * c - r * tail))
    return sine, cosine


@njit(cache=True)
def set_phases(laws, anchors, t_hi, t_lo):
    """Store the sines and cosines of all harmonics at t; False when t is out of reach."""
    anchors[TURN, 0] = -1.0
    for k in range(1, int(laws[PHASE, 1]) + 1):
        s, c, is_reduced = sine_cosine(laws[PHASE, 0], float(k), t_hi, t_lo)
        if not is_reduced:
            return False
        anchors[PHASE, 3 + k] = s
        anchors[PHASE, 3 + MAX_HARMONICS + k] = c
    return True


@njit(cache=True)
def set_turn(laws, anchors, s):
    """Store cos(d) - 1 and sin(d) for the phases d = k omega s, small together with s."""
    anchors[TURN, 0] = s
    for k in range(1, int(laws[PHASE, 1]) + 1):
        half = 0.5 * k * laws[PHASE, 0] * s
        if half < 0.75:
            half_s, half_c = short_sine_cosine(half, 0.0)
        else:
            half_s, half_c, _ = sine_cosine(laws[PHASE, 0], 0.5 * k, s, 0.0)
        anchors[TURN, 3 + k] = -2.0 * half_s * half_s
        anchors[TURN, 3 + MAX_HARMONICS + k] = 2.0 * half_s * half_c


@njit(cache=True)
def set_anchor(laws, anchors, row, t_hi, t_lo):
    """Store what a law needs to give its increments since t; False when t is out of reach."""
    anchors[row, 0] = laws[row, 1]
    anchors[row, 1] = 0.0
    anchors[row, 2] = 0.0
    n = int(laws[row, 3])
    if laws[row, 0] == FOURIER:
        for k in range(1, n + 1):
            s, c = anchors[PHASE, 3 + k], anchors[PHASE, 3 + MAX_HARMONICS + k]
            a, b = laws[row, 3 + k], laws[row, 3 + n + k]
            anchors[row, 0] += a * c + b * s
            anchors[row, 1] += k * laws[row, 2] * (b * c - a * s)
            anchors[row, 2] += k * laws[row, 2] * (abs(a) + abs(b))
    elif laws[row, 0] == BANG_BANG:
        period = laws[row, 2]
        first = laws[row, 4]
        n_periods = np.floor((t_hi - first) / period)
        if not abs(n_periods) < MAX_QUADRANT:
            return False
        d, e = two_sum(t_hi, -first)
        p, q = two_product(n_periods, period)
        tau = (d - p) + ((e - q) + t_lo)
        if tau < 0.0:
            tau += period
        elif tau >= period:
            tau -= period
        i = 0
        while i < n - 2 and laws[row, 5 + i] - first <= tau:
            i += 1
        leg = laws[row, 5 + i] - laws[row, 4 + i]
        u = max(tau - (laws[row, 4 + i] - first), 0.0)
        before, after = laws[row, 4 + n + i], laws[row, 5 + n + i]
        a = laws[row, 4 + 2 * n + i]
        anchors[row, 2] = 2.0 * i
        if u >= 0.5 * leg:
            anchors[row, 2] += 1.0
            u -= 0.5 * leg
            rest = max(0.5 * leg - u, 0.0)
            anchors[row, 0] = after - 0.5 * a * rest * rest
            anchors[row, 1] = a * rest
        else:
            anchors[row, 0] = before + 0.5 * a * u * u
            anchors[row, 1] = a * u
        anchors[row, 3] = u
        anchors[row, 4] = tau
    return True


@njit(cache=True)
def increment(laws, anchors, row, s):
    """Return f(t + s) - f(t), f'(t + s), and the summed sizes of the terms of both."""
    if laws[row, 0] == FOURIER:
        if s == 0.0:
            return 0.0, anchors[row, 1], 0.0, anchors[row, 2]
        if s != anchors[TURN, 0]:
            set_turn(laws, anchors, s)
        change = 0.0
        rate = 0.0
        size = 0.0
        n = int(laws[row, 3])
        for k in range(1, n + 1):
            down, across = anchors[TURN, 3 + k], anchors[TURN, 3 + MAX_HARMONICS + k]
            sine, cosine = anchors[PHASE, 3 + k], anchors[PHASE, 3 + MAX_HARMONICS + k]
            d_cosine = cosine * down - sine * across
            d_sine = sine * down + cosine * across
            a, b = laws[row, 3 + k], laws[row, 3 + n + k]
            change += a * d_cosine + b * d_sine
            rate += k * laws[row, 2] * (b * (cosine + d_cosine) - a * (sine + d_sine))
            size += (abs(a) + abs(b)) * (abs(down) + abs(across))
        return change, rate, size, anchors[row, 2]
    if laws[row, 0] == BANG_BANG:
        return legs_increment(laws, anchors, row, s)
    return 0.0, 0.0, 0.0, 0.0


@njit(cache=True)
def legs_increment(laws, anchors, row, s):
    """Return `increment` of a bang-bang law by walking its half-legs, each a parabola."""
    n = int(laws[row, 3])
    n_half_legs = 2 * (n - 1)
    j = int(anchors[row, 2])
    u = anchors[row, 3]
    rate = anchors[row, 1]
    change = 0.0
    size = 0.0
    left = s
    if s >= laws[row, 2]:
        p, e = two_product(np.floor(s / laws[row, 2]), laws[row, 2])
        left = max((s - p) - e, 0.0)
    for _ in range(n_half_legs + 2):
        i = j // 2
        half_leg = 0.5 * (laws[row, 5 + i] - laws[row, 4 + i])
        a = laws[row, 4 + 2 * n + i]
        if j % 2:
            a = -a
        room = max(half_leg - u, 0.0)
        step = min(left, room)
        change += step * (rate + 0.5 * a * step)
        size += step * (abs(rate) + 0.5 * abs(a) * step)
        if left <= room:
            # The time within the half-leg is known to rounding of the time within the period.
            rate += a * step
            return change, rate, size, abs(rate) + abs(a) * min(half_leg, anchors[row, 4] + s)
        rate = 0.0 if j % 2 else a * half_leg
        left -= room
        u = 0.0
        j = (j + 1) % n_half_legs
    return change, rate, size, abs(rate)


@njit(cache=True)
def set_anchors(laws, anchors, t_hi, t_lo):
    """Anchor all four laws at t."""
    is_reached = set_phases(laws, anchors, t_hi, t_lo)
    for i in range(4):
        is_reached = set_anchor(laws, anchors, i, t_hi, t_lo) and is_reached
    return is_reached


@njit(cache=True)
def width(laws, anchors, is_relative, s):
    """Return w(t), w(t + s) - w(t), w'(t + s) and the sizes of both, for w = nu r or w itself."""
    d_w, rate, size, rate_size = increment(laws, anchors, W, s)
    w = anchors[W, 0]
    if not is_relative:
        return w, d_w, rate, size, rate_size
    d_r, r_rate, r_size, r_rate_size = increment(laws, anchors, R, s)
    r = anchors[R, 0]
    return (
        w * r,
        d_w * (r + d_r) + w * d_r,
        rate * (r + d_r) + (w + d_w) * r_rate,
        size * (abs(r) + r_size) + w * r_size,
        rate_size * (abs(r) + r_size) + (w + size) * r_rate_size,
    )


@njit(cache=True)
def wall_function(wall, s, x, y, vx, vy, residual, laws, anchors, is_relative):
    """Return f(s), f'(s) and the rounding errors of both, for one wall (f > 0 inside).

    `residual` is f(0), or 0 on the wall being left. Source: sec. 2, D_stem and D_cap.
    """
    if wall == ARC:
        d_r, r_rate, r_size, r_rate_size = increment(laws, anchors, R, s)
        r = anchors[R, 0]
        q = x * vx + y * vy
        v2 = vx * vx + vy * vy
        f = residual + (d_r * (2.0 * r + d_r) - s * (2.0 * q + s * v2))
        slope = 2.0 * ((r + d_r) * r_rate - (q + s * v2))
        sizes = abs(x * vx) + abs(y * vy)
        error = abs(residual) + r_size * (2.0 * r + r_size) + s * (2.0 * sizes + s * v2)
        slope_error = 2.0 * ((r + abs(d_r)) * r_rate_size + sizes + s * v2)
        return f, slope, SAFETY * error, SAFETY * slope_error
    if wall == FLOOR:
        d_h, h_rate, h_size, h_rate_size = increment(laws, anchors, H, s)
        f = residual + (vy * s + d_h)
        error = abs(residual) + abs(vy) * s + h_size
        return f, vy + h_rate, SAFETY * error, SAFETY * (abs(vy) + h_rate_size)
    _, d_w, w_rate, w_size, w_rate_size = width(laws, anchors, is_relative, s)
    d_m, m_rate, m_size, m_rate_size = increment(laws, anchors, M, s)
    m = anchors[M, 0]
    outward = vx if wall == RIGHT else -vx
    y_s = y + vy * s
    f = residual + (d_w + d_m * y_s + s * (m * vy - outward))
    slope = w_rate + m_rate * y_s + (m + d_m) * vy - outward
    error = abs(residual) + w_size + m_size * abs(y_s) + s * (abs(m * vy) + abs(vx))
    slope_error = w_rate_size + m_rate_size * (abs(y) + abs(vy) * s) + (abs(m) + m_size) * abs(vy) + abs(vx)
    return f, slope, SAFETY * error, SAFETY * slope_error


@njit(cache=True)
def wall_residual(wall, x, y, laws, anchors, bounds, is_relative):
    """Return f(0) and its rounding error."""
    if wall == ARC:
        r = anchors[R, 0]
        r2, r2_low = two_product(r, r)
        x2, x2_low = two_product(x, x)
        y2, y2_low = two_product(y, y)
        a, a_low = two_sum(r2, -x2)
        b, b_low = two_sum(a, -y2)
        return b + (b_low + a_low + (r2_low - x2_low - y2_low)), SAFETY * bounds[R, 1] * bounds[R, 1]
    if wall == FLOOR:
        return y + anchors[H, 0], SAFETY * bounds[H, 1]
    w, _, _, _, _ = width(laws, anchors, is_relative, 0.0)
    tilt = anchors[M, 0] * y
    error = SAFETY * (bounds[W, 1] + max(abs(bounds[M, 0]), abs(bounds[M, 1])) * abs(y) + abs(x))
    return (w + tilt) - (x if wall == RIGHT else -x), error


@njit(cache=True)
def curvature_bounds(wall, vx, vy, bounds):
    """Return K >= -inf f'' and L >= sup f'' from the laws' bounds (rows: lo, hi, |f'|, |f''|)."""
    if wall == ARC:
        bend = bounds[R, 1] * bounds[R, 3]
        v2 = vx * vx + vy * vy
        return (
            2.0 * (bend + v2) * (1.0 + SAFETY),
            2.0 * (bend + bounds[R, 2] * bounds[R, 2] - v2) + SAFETY * v2,
        )
    if wall == FLOOR:
        return bounds[H, 3], bounds[H, 3]
    k = bounds[W, 3] + bounds[M, 3] * bounds[H, 1] + 2.0 * bounds[M, 2] * abs(vy)
    return k * (1.0 + SAFETY), k * (1.0 + SAFETY)


@njit(cache=True)
def reach_time(wall, x, y, vx, vy, bounds):
    """Return a time before which the particle cannot reach what the wall ever sweeps.

    This lets a slow particle cross the middle of the table in one step.
    """
    if wall == ARC:
        inner = bounds[R, 0]
        gap = inner * inner - (x * x + y * y)
        v2 = vx * vx + vy * vy
        if gap <= SAFETY * inner * inner or v2 == 0.0:
            return np.inf if gap > SAFETY * inner * inner else 0.0
        q = x * vx + y * vy
        root = np.sqrt(q * q + v2 * gap)
        return (gap / (q + root) if q > 0.0 else (root - q) / v2) * (1.0 - 4.0 * SAFETY)
    if wall == FLOOR:
        gap = y + bounds[H, 0]
        size = abs(y) + bounds[H, 0]
        speed = -vy
    else:
        m_lo, m_hi = bounds[M, 0], bounds[M, 1]
        outward = vx if wall == RIGHT else -vx
        position = x if wall == RIGHT else -x
        if m_lo == m_hi:
            gap = bounds[W, 0] + m_lo * y - position
            speed = outward - m_lo * vy
        else:
            gap = bounds[W, 0] - max(abs(m_lo), abs(m_hi)) * bounds[H, 1] - position
            speed = outward
        size = bounds[W, 0] + max(abs(m_lo), abs(m_hi)) * bounds[H, 1] + abs(x)
    if gap <= SAFETY * size:
        return 0.0
    if speed <= 0.0:
        return np.inf
    return gap / speed * (1.0 - 4.0 * SAFETY)


@njit(cache=True)
def first_root(wall, start, limit, x, y, vx, vy, is_leaving, laws, anchors, bounds, is_relative):
    """Find the first s in (start, limit) with f = 0, f' < 0.

    Returns (code, s, f', error of s): code is the wall for a hit, NO_WALL for none before
    the limit, else a reason for `undecided`.
    """
    residual = 0.0
    residual_error = 0.0
    if not is_leaving:
        residual, residual_error = wall_residual(wall, x, y, laws, anchors, bounds, is_relative)
    down, up = curvature_bounds(wall, vx, vy, bounds)
    s = start
    for n_steps in range(MAX_PARABOLAS):
        if s >= limit:
            return NO_WALL, limit, 0.0, 0.0
        f, slope, error, slope_error = wall_function(
            wall, s, x, y, vx, vy, residual, laws, anchors, is_relative
        )
        error += residual_error
        if s == 0.0 and is_leaving:
            if slope < -slope_error:
                return APPROACHING, s, slope, 0.0
            if slope <= slope_error:
                # With slope and curvature exactly 0 (static wall, path along it) there is never a hit.
                if slope == 0.0 and slope_error == 0.0 and down == 0.0:
                    return NO_WALL, limit, 0.0, 0.0
                return TANGENT, s, slope, 0.0
            f = 0.0
        elif f <= error:
            if s == start:
                return (OUTSIDE if f < -error else START), s, slope, 0.0
            # A simple root from above. Were f convex enough to turn back within its error: undecided.
            if slope >= -slope_error or (up > 0.0 and slope * slope <= 4.0 * up * error):
                return TANGENT, s, slope, 0.0
            root = s - f / slope
            if root >= limit:
                return NO_WALL, limit, 0.0, 0.0
            return wall, root, slope, error / -slope
        d = np.sqrt(slope * slope + 2.0 * down * f)
        if slope < 0.0:
            h = 2.0 * f / (d - slope)
        elif down > 0.0:
            h = (slope + d) / down
        else:
            return NO_WALL, limit, 0.0, 0.0
        moved = s + h
        if slope < -slope_error and down * h * h <= 2.0**-54 * moved * -slope:
            # So little curvature that the parabola's root is the function's to the last bit.
            if moved >= limit:
                return NO_WALL, limit, 0.0, 0.0
            return wall, moved, slope, error / -slope
        if moved <= s:
            return TANGENT, s, slope, 0.0
        if n_steps >= PATIENCE:
            reach = reach_time(wall, x + vx * s, y + vy * s, vx, vy, bounds)
            moved = max(moved, s + reach)
        s = moved
    return TOO_MANY, s, 0.0, 0.0


@njit(cache=True)
def side_of_mouth(s, x, y, vx, vy, laws, anchors, is_relative):
    """Return +1 when the crossing of y = 0 after time s is within |x| < w, -1 beyond, 0 too close."""
    w, d_w, _, w_size, _ = width(laws, anchors, is_relative, s)
    x_s = abs(x + vx * s)
    margin = (w - x_s) + d_w
    error = SAFETY * (w + w_size + abs(x) + 2.0 * abs(vx) * s)
    if margin > error:
        return 1
    return -1 if margin < -error else 0


@njit(cache=True)
def earliest_side_or_floor(wall, start, limit, x, y, vx, vy, laws, anchors, bounds, is_relative):
    """Find the first hit of left, right and floor; (code, s, error of s)."""
    code, s, error = NO_WALL, limit, 0.0
    for candidate in (LEFT, RIGHT, FLOOR):
        # Look a little beyond the best so far, so that ties are seen from both sides.
        beyond = min(limit, s + 8.0 * error + SAFETY * s)
        found, root, _, root_error = first_root(
            candidate, start, beyond, x, y, vx, vy, wall == candidate, laws, anchors, bounds, is_relative
        )
        if found == NO_WALL:
            continue
        if found != candidate:
            return found, root, 0.0
        if code != NO_WALL and abs(root - s) <= 8.0 * (error + root_error) + SAFETY * s:
            # A tie, unless a wall still to be tried is met before it.
            code, s, error = CORNER, min(root, s), max(error, root_error)
        elif code == NO_WALL or root < s:
            code, s, error = candidate, root, root_error
    return code, s, error


@njit(cache=True)
def cap_flight(start, limit, wall, x, y, vx, vy, laws, anchors, bounds, is_relative, has_base):
    """Follow the flight in the cap from `start` to the arc; (code, s)."""
    code, s, _, error = first_root(
        ARC, start, limit, x, y, vx, vy, wall == ARC, laws, anchors, bounds, is_relative
    )
    if code == ARC and has_base and vy < 0.0:
        # The corner of arc and base: the height there must be above its rounding error.
        height = y + vy * s
        if height <= SAFETY * (abs(y) + abs(vy) * s) + abs(vy) * error:
            return CORNER, s
    return code, s


@njit(cache=True)
def along_mouth(limit, x, vx, laws, anchors, bounds, is_relative):
    """Follow a path along y = 0 inside the mouth: it may only end at the mouth's edge."""
    code, s, _ = earliest_side_or_floor(
        NO_WALL, 0.0, limit, x, 0.0, vx, 0.0, laws, anchors, bounds, is_relative
    )
    if code in (LEFT, RIGHT):
        return MOUTH_EDGE, s
    return (HORIZON if code == NO_WALL else code), s


@njit(cache=True)
def first_event(table, is_relative, wall, x, y, vx, vy, limit, laws, anchors, bounds):
    """Find the next collision or say why not; (code, s). The anchors hold the laws at the state."""
    in_cap = table == CAP or (
        table == MUSHROOM and (y > 0.0 or wall in (BASE, ARC) or (y == 0.0 and wall == NO_WALL and vy > 0.0))
    )
    crossing = np.inf
    if wall != BASE and ((in_cap and vy < 0.0) or (not in_cap and vy > 0.0 and y < 0.0)):
        crossing = -y / vy
    if wall == BASE or (y == 0.0 and wall == NO_WALL and table != MUSHROOM):
        inward = vy if in_cap else -vy
        if inward <= 0.0:
            return (SLIDING if inward == 0.0 else APPROACHING), 0.0
    if y == 0.0 and wall == NO_WALL and table == MUSHROOM and vy <= 0.0:
        side = side_of_mouth(0.0, x, y, vx, vy, laws, anchors, is_relative)
        if side == 0:
            return EDGE, 0.0
        if side < 0:
            return (SLIDING if vy == 0.0 else APPROACHING), 0.0
        if vy == 0.0:
            return along_mouth(limit, x, vx, laws, anchors, bounds, is_relative)
    if in_cap:
        code, s = cap_flight(
            0.0,
            min(crossing, limit),
            wall,
            x,
            y,
            vx,
            vy,
            laws,
            anchors,
            bounds,
            is_relative,
            crossing < np.inf,
        )
        if code != NO_WALL or crossing >= limit:
            return (HORIZON if code == NO_WALL else code), s
        residual = residual_error = 0.0
        if wall != ARC:
            residual, residual_error = wall_residual(ARC, x, y, laws, anchors, bounds, is_relative)
        gap, _, gap_error, _ = wall_function(
            ARC, crossing, x, y, vx, vy, residual, laws, anchors, is_relative
        )
        if gap <= gap_error + residual_error:
            return CORNER, crossing
        if table == CAP:
            return BASE, crossing
        side = side_of_mouth(crossing, x, y, vx, vy, laws, anchors, is_relative)
        if side <= 0:
            return (BASE if side < 0 else EDGE), crossing
        code, s, _ = earliest_side_or_floor(
            NO_WALL, crossing, limit, x, y, vx, vy, laws, anchors, bounds, is_relative
        )
        return (HORIZON if code == NO_WALL else code), s
    code, s, error = earliest_side_or_floor(
        wall, 0.0, min(crossing, limit), x, y, vx, vy, laws, anchors, bounds, is_relative
    )
    if code != NO_WALL:
        # A side met at the height of the mouth is its edge.
        depth = y + vy * s
        if (
            crossing < np.inf
            and code <= FLOOR
            and -depth <= SAFETY * (abs(y) + abs(vy) * s) + abs(vy) * error
        ):
            return EDGE, s
        return code, s
    if crossing >= limit:
        return HORIZON, s
    if side_of_mouth(crossing, x, y, vx, vy, laws, anchors, is_relative) <= 0:
        return EDGE, crossing
    if table == STEM:
        return BASE, crossing
    code, s = cap_flight(crossing, limit, NO_WALL, x, y, vx, vy, laws, anchors, bounds, is_relative, False)
    return (HORIZON if code == NO_WALL else code), s


@njit(cache=True)
def reflect(wall, s, x, y, vx, vy, laws, anchors, is_relative):
    """Move to the wall and bounce: v - 2 f' grad f / |grad f|^2, which is v - 2 (v.n - u) n."""
    x_s = x + vx * s
    y_s = y + vy * s
    if wall == BASE:
        return x_s, 0.0, vx, -vy
    if wall == ARC:
        d_r, r_rate, _, _ = increment(laws, anchors, R, s)
        push = 2.0 * ((anchors[R, 0] + d_r) * r_rate - (x_s * vx + y_s * vy)) / (x_s * x_s + y_s * y_s)
        return x_s, y_s, vx + push * x_s, vy + push * y_s
    if wall == FLOOR:
        _, h_rate, _, _ = increment(laws, anchors, H, s)
        return x_s, y_s, vx, -vy - 2.0 * h_rate
    _, _, w_rate, _, _ = width(laws, anchors, is_relative, s)
    d_m, m_rate, _, _ = increment(laws, anchors, M, s)
    m = anchors[M, 0] + d_m
    sign = 1.0 if wall == RIGHT else -1.0
    out, rate = sign * vx, w_rate + m_rate * y_s
    # The reflection as a matrix: at slopes near +-1 the diagonal is small and must not cancel.
    tilt, n2 = (m - 1.0) * (m + 1.0), 1.0 + m * m
    return (
        x_s,
        y_s,
        sign * ((tilt * out + 2.0 * (m * vy + rate)) / n2),
        (2.0 * m * (out - rate) - tilt * vy) / n2,
    )


@njit(cache=True)
def is_outside(table, is_relative, wall, x, y, laws, anchors, bounds):
    """Tell whether the state is beyond a wall by more than rounding; returns the wall or NO_WALL."""
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
            f, error = wall_residual(candidate, x, y, laws, anchors, bounds, is_relative)
            if f < -error:
                return candidate
    return NO_WALL


@njit(cache=True)
def step(table, is_relative, laws, bounds, anchors, p, wall, limit):
    """Advance the state p = [t, t's low part, x, y, vx, vy] by one collision, in place.

    Returns (code, dt): a wall's code, HORIZON (p is moved to the limit) or why there is none
    (p stays). The anchors must hold the laws at p's time, and do so again afterwards.
    """
    x, y, vx, vy = p[2], p[3], p[4], p[5]
    code, s = first_event(table, is_relative, wall, x, y, vx, vy, limit, laws, anchors, bounds)
    if code > HORIZON:
        return code, s
    if code == HORIZON:
        s = limit
        p[2], p[3] = x + vx * s, y + vy * s
    else:
        p[2], p[3], p[4], p[5] = reflect(code, s, x, y, vx, vy, laws, anchors, is_relative)
    t, low = two_sum(p[0], s)
    p[0], p[1] = two_sum(t, low + p[1])
    if not set_anchors(laws, anchors, p[0], p[1]):
        return FAR_TIME, s
    return code, s


@njit(cache=True)
def single_step(table, is_relative, laws, bounds, p, wall, limit):
    """Judge one state and advance it; the entry for callers with no anchors. Returns (code, dt)."""
    anchors = np.zeros(ANCHORS_SHAPE)
    if not set_anchors(laws, anchors, p[0], p[1]):
        return FAR_TIME, 0.0
    beyond = is_outside(table, is_relative, wall, p[2], p[3], laws, anchors, bounds)
    if beyond != NO_WALL:
        return OUTSIDE, float(beyond)
    return step(table, is_relative, laws, bounds, anchors, p, wall, limit)


@njit(cache=True)
def trajectory(table, is_relative, laws, bounds, p, wall, t_end, out, walls):
    """Fill out[i] = [dt, t, x, y, vx, vy] and walls[i] until full, t_end or trouble.

    Returns the number of collisions and the last code (of a wall when `out` is full).
    """
    anchors = np.zeros(ANCHORS_SHAPE)
    if not set_anchors(laws, anchors, p[0], p[1]):
        return 0, FAR_TIME
    if is_outside(table, is_relative, wall, p[2], p[3], laws, anchors, bounds) != NO_WALL:
        return 0, OUTSIDE
    code = wall
    for i in range(out.shape[0]):
        code, s = step(table, is_relative, laws, bounds, anchors, p, code, (t_end - p[0]) - p[1])
        if code >= HORIZON:
            return i, code
        walls[i] = code
        out[i, 0] = s
        out[i, 1] = p[0]
        out[i, 2:] = p[2:]
    return out.shape[0], code


@njit(cache=True)
def follow(table, is_relative, laws, bounds, p, ends, narrowest, energies, t_in, t_out):
    """Follow one particle through cycles ending at `ends`, noting energies and captured stays.

    A stay in the cap counts as captured from its first arc hit with |sin phi| > nu (angles before
    the bounce, eq. sinphi) to the hit at which that ended; it is recorded for a cycle when it spans
    the instant narrowest[c] of least nu, which keeps out the many brief crossings of the edge.

    Returns the final code (HORIZON when all went well) and the number of collisions.
    """
    anchors = np.zeros(ANCHORS_SHAPE)
    if not set_anchors(laws, anchors, p[0], p[1]):
        return FAR_TIME, 0
    n_collisions = 0
    cycle = 0
    wall = NO_WALL
    stay_in = np.nan
    stay_out = np.nan
    while True:
        vx, vy = p[4], p[5]
        code, _ = step(table, is_relative, laws, bounds, anchors, p, wall, (ends[-1] - p[0]) - p[1])
        while cycle < ends.shape[0] and p[0] >= ends[cycle]:
            energies[cycle] = 0.5 * (vx * vx + vy * vy)
            if stay_in <= narrowest[cycle] and not stay_out < narrowest[cycle]:
                t_in[cycle] = stay_in
                t_out[cycle] = min(stay_out, ends[cycle])
            cycle += 1
        if code >= HORIZON:
            return code, n_collisions
        n_collisions += 1
        wall = code
        if table != MUSHROOM:
            continue
        if wall == ARC:
            w = anchors[W, 0] * (anchors[R, 0] if is_relative else 1.0)
            spin = p[2] * vy - p[3] * vx
            if spin * spin > w * w * (vx * vx + vy * vy):
                if np.isnan(stay_in):
                    stay_in = p[0]
                stay_out = np.inf
            elif stay_out == np.inf:
                stay_out = p[0]
        elif wall != BASE and not np.isnan(stay_in):
            stay_out = min(stay_out, p[0])
            if stay_in <= narrowest[cycle] <= stay_out:
                t_in[cycle] = stay_in
                t_out[cycle] = stay_out
            stay_in = np.nan
            stay_out = np.nan


@njit(cache=True, parallel=True)
def follow_all(
    table, is_relative, laws, bounds, states, ends, narrowest, energies, t_in, t_out, codes, n_collisions
):
    """Follow many particles, each on its own: the result is the same for any number of threads."""
    for i in prange(states.shape[0]):
        codes[i], n_collisions[i] = follow(
            table, is_relative, laws, bounds, states[i], ends, narrowest, energies[i], t_in[i], t_out[i]
        )
