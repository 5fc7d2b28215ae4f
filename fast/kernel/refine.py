"""The fine step: the careful step's collision to about 31 decimals, in double-double arithmetic.

The careful step, on the state rounded to binary64, says which wall is met first and when, or that it cannot
tell; where the state has low parts, its residuals are judged no better than that rounding. Newton's method in
pairs then gives the time, from a wall function made of increments since the last event, so that a hop along
a wall keeps its digits; place, wall speed and reflection follow in pairs. A path carries its state in pairs.

Not handled: a hop along a wall across a knot of its law is the difference of two values, and one along a
wall whose harmonics cancel in its speed meets their rounding: both keep 2^-104 of the table's size only.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from fast.kernel.arithmetic import two_sum
from fast.kernel.careful import first_event

from fast.kernel.codes import (  # isort: skip
    ARC, BANG_BANG, BASE, FAR_TIME, FLOOR, FOURIER, H, HORIZON, M, NO_WALL, OUTSIDE, PHASES, R, RIGHT,
    TANGENT, W,
)  # fmt: skip
from fast.kernel.double_double import add, div, mul, sine_cosine, sub, times
from fast.kernel.laws import ANCHORS_SHAPE, KNOTS, LACK, PHASE, set_anchors
from fast.kernel.walls import is_outside

MAX_CORRECTIONS = 8
ROUNDED = 2.0**-57  # what rounding a state takes from a residual: 64 times this (fast.kernel.walls.law_size)
SETTLED, LOOSE = 2.0**-102, 2.0**-80  # relative corrections: done; too coarse for an answer
ZERO = (0.0, 0.0)


@njit(error_model="numpy")
def phase(laws, row, k, t):
    """Return k omega t."""
    return mul(times(k, (laws[row, 2], laws[PHASES, 2])), t)


@njit(error_model="numpy")
def half_leg_at(laws, row, t):
    """Return where in a bang-bang law a time lies: half-leg, periods gone by, time from the nearer knot."""
    n = int(laws[row, 3])
    first, period = laws[row, KNOTS], (laws[row, 2], laws[row, 4])
    since = sub(t, (first, 0.0))
    n_periods = np.floor(since[0] / period[0])
    tau = sub(since, times(n_periods, period))
    if tau[0] < 0.0:
        n_periods -= 1.0
    elif sub(tau, period)[0] >= 0.0:
        n_periods += 1.0
    tau = sub(since, times(n_periods, period))
    i = 0
    while i < n - 2 and sub(tau, two_sum(laws[row, KNOTS + i + 1], -first))[0] >= 0.0:
        i += 1
    u = sub(tau, two_sum(laws[row, KNOTS + i], -first))
    length = two_sum(laws[row, KNOTS + i + 1], -laws[row, KNOTS + i])
    if sub(u, times(0.5, length))[0] < 0.0:
        return 2 * i, n_periods, u
    return 2 * i + 1, n_periods, sub(u, length)


@njit(error_model="numpy")
def bend_of(laws, row, half_leg):
    """Return the second derivative in a half-leg."""
    n, i = int(laws[row, 3]), half_leg // 2
    sign = -1.0 if half_leg % 2 else 1.0
    return sign * laws[row, KNOTS + 2 * n + i], sign * laws[row, KNOTS + 3 * n + i]


@njit(error_model="numpy")
def law(laws, row, t):
    """Return a law's value and derivative."""
    if laws[row, 0] == FOURIER:
        n = int(laws[row, 3])
        f, rate = (laws[row, 1], 0.0), ZERO
        for k in range(1, n + 1):
            sine, cosine, _ = sine_cosine(phase(laws, row, float(k), t))
            a, b = laws[row, 3 + k], laws[row, 3 + n + k]
            f = add(f, add(times(a, cosine), times(b, sine)))
            rate = add(rate, times(float(k), sub(times(b, cosine), times(a, sine))))
        return f, mul((laws[row, 2], laws[PHASES, 2]), rate)
    if laws[row, 0] == BANG_BANG:
        half_leg, _, u = half_leg_at(laws, row, t)
        a = bend_of(laws, row, half_leg)
        knot = laws[row, KNOTS + int(laws[row, 3]) + (half_leg + 1) // 2]
        return add((knot, 0.0), times(0.5, mul(a, mul(u, u)))), mul(a, u)
    return (laws[row, 1], 0.0), ZERO


@njit(error_model="numpy")
def increment(laws, row, t, s):
    """Return a law's f(t + s) - f(t), without cancellation."""
    if laws[row, 0] == FOURIER:
        n, change = int(laws[row, 3]), ZERO
        for k in range(1, n + 1):
            half = phase(laws, row, 0.5 * k, s)
            sine, cosine, _ = sine_cosine(add(phase(laws, row, float(k), t), half))
            across, _, _ = sine_cosine(half)
            a, b = laws[row, 3 + k], laws[row, 3 + n + k]
            change = add(change, mul(times(2.0, across), sub(times(b, cosine), times(a, sine))))
        return change
    if laws[row, 0] == BANG_BANG:
        half_leg, n_periods, u = half_leg_at(laws, row, t)
        later, n_later, _ = half_leg_at(laws, row, add(t, s))
        if later == half_leg and n_later == n_periods:
            return mul(mul(bend_of(laws, row, half_leg), s), add(u, times(0.5, s)))
        return sub(law(laws, row, add(t, s))[0], law(laws, row, t)[0])
    return ZERO


@njit(error_model="numpy")
def half_width(laws, is_relative, t):
    """Return w and w'."""
    w, rate = law(laws, W, t)
    if not is_relative:
        return w, rate
    r, r_rate = law(laws, R, t)
    return mul(w, r), add(mul(rate, r), mul(w, r_rate))


@njit(error_model="numpy")
def increase(wall, s, p, laws, is_relative):
    """Return f(s) - f(0) of a wall along the flight from the state p."""
    t, x, y, vx, vy = p
    if wall == ARC:
        d_r = increment(laws, R, t, s)
        r, _ = law(laws, R, t)
        q = add(mul(x, vx), mul(y, vy))
        v2 = add(mul(vx, vx), mul(vy, vy))
        return sub(mul(d_r, add(times(2.0, r), d_r)), mul(s, add(times(2.0, q), mul(s, v2))))
    if wall == FLOOR:
        return add(mul(vy, s), increment(laws, H, t, s))
    d_w = increment(laws, W, t, s)
    if is_relative:
        d_r = increment(laws, R, t, s)
        r, _ = law(laws, R, t)
        nu, _ = law(laws, W, t)
        d_w = add(mul(d_w, add(r, d_r)), mul(nu, d_r))
    m, _ = law(laws, M, t)
    tilt = mul(increment(laws, M, t, s), add(y, mul(vy, s)))
    outward = times(1.0 if wall == RIGHT else -1.0, vx)
    return add(add(d_w, tilt), mul(s, sub(mul(m, vy), outward)))


@njit(error_model="numpy")
def residual(wall, p, laws, is_relative):
    """Return f(0) of a wall."""
    t, x, y, _, _ = p
    if wall == ARC:
        r, _ = law(laws, R, t)
        return sub(mul(r, r), add(mul(x, x), mul(y, y)))
    if wall == FLOOR:
        return add(y, law(laws, H, t)[0])
    m, _ = law(laws, M, t)
    across = times(1.0 if wall == RIGHT else -1.0, x)
    return sub(add(half_width(laws, is_relative, t)[0], mul(m, y)), across)


@njit(error_model="numpy")
def gradient(wall, p, laws, is_relative):
    """Return f_x, f_y and f' of a wall at a state on it."""
    t, x, y, vx, vy = p
    if wall == ARC:
        r, rate = law(laws, R, t)
        push = sub(mul(r, rate), add(mul(x, vx), mul(y, vy)))
        return times(-2.0, x), times(-2.0, y), times(2.0, push)
    if wall == FLOOR:
        return ZERO, (1.0, 0.0), add(vy, law(laws, H, t)[1])
    if wall == BASE:
        return ZERO, (1.0, 0.0), vy
    m, m_rate = law(laws, M, t)
    side = -1.0 if wall == RIGHT else 1.0
    rate = add(half_width(laws, is_relative, t)[1], mul(m_rate, y))
    return (side, 0.0), m, add(rate, add(mul(m, vy), times(side, vx)))


@njit(error_model="numpy")
def moved(p, s):
    """Return the state after a free flight."""
    t, x, y, vx, vy = p
    return add(t, s), add(x, mul(vx, s)), add(y, mul(vy, s)), vx, vy


@njit(error_model="numpy")
def corrected(wall, s, is_again, p, laws, is_relative):
    """Return the time of a hit, from a time right to binary64, and whether Newton's method settled."""
    if wall == BASE:
        return div(times(-1.0, p[2]), p[4]), True
    start = ZERO if is_again else residual(wall, p, laws, is_relative)
    time, change = (s, 0.0), s
    for _ in range(MAX_CORRECTIONS):
        f = add(start, increase(wall, time, p, laws, is_relative))
        _, _, slope = gradient(wall, moved(p, time), laws, is_relative)
        change = -f[0] / slope[0]
        time = add(time, (change, 0.0))
        if abs(change) <= SETTLED * time[0]:
            break
    return time, abs(change) <= LOOSE * time[0]


@njit(error_model="numpy")
def reflected(wall, p, laws, is_relative):
    """Return the velocity after a hit: v - 2 f' grad f / |grad f|^2."""
    _, _, _, vx, vy = p
    f_x, f_y, slope = gradient(wall, p, laws, is_relative)
    factor = div(times(2.0, slope), add(mul(f_x, f_x), mul(f_y, f_y)))
    return sub(vx, mul(factor, f_x)), sub(vy, mul(factor, f_y))


@njit(error_model="numpy")
def fine_step(table, is_relative, laws, bounds, anchors, p, wall, limit):
    """Return (code, flight time, state after) for a state of pairs; the anchors hold the laws at it."""
    code, s = first_event(
        table, is_relative, wall, p[1][0], p[2][0], p[3][0], p[4][0], limit, laws, anchors, bounds
    )
    if code >= HORIZON:
        return code, (s, 0.0), p
    time, is_settled = corrected(code, s, code == wall, p, laws, is_relative)
    if not is_settled:
        return TANGENT, (s, 0.0), p
    t, x, y, vx, vy = moved(p, time)
    if code == BASE:
        y = ZERO
    vx, vy = reflected(code, (t, x, y, vx, vy), laws, is_relative)
    return code, time, (t, x, y, vx, vy)


@njit(error_model="numpy")
def fine_path(table, is_relative, laws, bounds, start, wall, limit, out, met):
    """Fill out[i] with dt, t, x, y, vx, vy as pairs and met[i] with the wall; returns number and last code.

    `start` (5, 2): t, x, y, vx, vy as pairs. `limit` [time] is the horizon of every single step.
    """
    anchors = np.zeros(ANCHORS_SHAPE)
    p = (
        (start[0, 0], start[0, 1]),
        (start[1, 0], start[1, 1]),
        (start[2, 0], start[2, 1]),
        (start[3, 0], start[3, 1]),
        (start[4, 0], start[4, 1]),
    )
    for i in range(out.shape[0]):
        if not set_anchors(laws, anchors, p[0][0], p[0][1]):
            return i, FAR_TIME
        if p[0][1] != 0.0 or p[1][1] != 0.0 or p[2][1] != 0.0:
            anchors[PHASE, LACK] = max(anchors[PHASE, LACK], ROUNDED)
        if (
            i == 0
            and is_outside(table, is_relative, wall, p[1][0], p[2][0], laws, anchors, bounds) != NO_WALL
        ):
            return i, OUTSIDE
        wall, time, p = fine_step(table, is_relative, laws, bounds, anchors, p, wall, limit)
        if wall >= HORIZON:
            return i, wall
        met[i] = wall
        out[i, 0, 0], out[i, 0, 1] = time
        for k in range(5):
            out[i, k + 1, 0], out[i, k + 1, 1] = p[k]
    return out.shape[0], wall
