"""A hit that has been found: its time polished, the state moved there, and the bounce.

The laws are anchored at the hit, where the remainder of f gives the time's low part; on the wall that was
left, for a short hop, the increments since then give it better. So place, wall speed and velocity are as
accurate as their last rounding.
"""

from __future__ import annotations

from numba import njit

from fast.kernel.arithmetic import SAFETY, two_product, two_sum
from fast.kernel.codes import ARC, BASE, FLOOR, RIGHT, H, M, R, W
from fast.kernel.laws import LACK, LOW, PHASE, set_anchors
from fast.kernel.walls import curvature_bounds, off_the_arc, wall_function, wall_residual, wall_slope

MAX_POLISHES = 4


@njit(error_model="numpy")
def remainder(wall, s, rest, residual, x, y, vx, vy, laws, anchors, bounds, is_relative):
    """Return what must be added to the time s + rest of a hit, and the rounded place there with its low part.

    The anchors hold the laws at the hit, which is where f = residual.
    """
    p, x_low = two_product(vx, s)
    x_s, e = two_sum(x, p)
    x_low += e + vx * rest
    p, y_low = two_product(vy, s)
    y_s, e = two_sum(y, p)
    y_low += e + vy * rest
    if wall == BASE:
        return -(y_s + y_low) / vy, x_s, x_low, y_s, y_low
    f, _ = wall_residual(wall, x_s, y_s, laws, anchors, bounds, is_relative)
    f -= residual
    if wall == ARC:
        f -= 2.0 * (x_s * x_low + y_s * y_low)
    elif wall == FLOOR:
        f += y_low
    else:
        f += anchors[M, 0] * y_low - (x_low if wall == RIGHT else -x_low)
    return f / -wall_slope(wall, x_s, y_s, vx, vy, anchors, is_relative), x_s, x_low, y_s, y_low


@njit(error_model="numpy")
def bounce(wall, x, x_low, y, y_low, vx, vy, anchors, is_relative):
    """Return the velocity after a hit at (x, y): v - 2 f' grad f / |grad f|^2 = v - 2 (v.n - u) n."""
    if wall == BASE:
        return vx, -vy
    if wall == ARC:
        return off_the_arc(x, x_low, y, y_low, vx, vy, anchors[R, 0], anchors[R, 1])
    if wall == FLOOR:
        return vx, -vy - 2.0 * anchors[H, 1]
    m = anchors[M, 0]
    sign = 1.0 if wall == RIGHT else -1.0
    rate = anchors[W, 1]
    if is_relative:
        rate = rate * anchors[R, 0] + anchors[W, 0] * anchors[R, 1]
    rate += anchors[M, 1] * y
    out = sign * vx
    # The reflection as a matrix: at slopes near +-1 the diagonal is small and must not cancel.
    tilt, n2 = ((m - 1.0) + anchors[M, LOW]) * (m + 1.0), 1.0 + m * m
    return (
        sign * ((tilt * out + 2.0 * (m * vy + rate)) / n2),
        (2.0 * m * (out - rate) - tilt * vy) / n2,
    )


@njit(error_model="numpy")
def settled(wall, s, x, y, vx, vy, laws, anchors, is_relative):
    """Return the time of a hit of the wall left, right to its last bit, with f, f' and f's error there."""
    f, slope, error, _ = wall_function(wall, s, x, y, vx, vy, 0.0, laws, anchors, is_relative)
    for _ in range(MAX_POLISHES):
        change = f / -slope
        if not abs(change) > 2.0**-52 * s:
            break
        s += change
        f, slope, error, _ = wall_function(wall, s, x, y, vx, vy, 0.0, laws, anchors, is_relative)
    return s, f, slope, error


@njit(error_model="numpy")
def rest_of_hop(wall, s, f, slope, p, laws, anchors, is_relative):
    """Return what must be added to the time s of a hit of the wall left; its increments gave f and f'.

    The low part matters even though s is right to its last bit: a wall that rests until a knot and is met
    just after it has a speed as small as the time since then. Newton's method, f between s and there by
    the trapezoidal rule: exact for a bang-bang law, whose f' is linear.
    """
    x_s, y_s, vx, vy = p[2] + p[4] * s, p[3] + p[5] * s, p[4], p[5]
    t, low = two_sum(p[0], s)
    rest = f / -slope
    for _ in range(MAX_POLISHES):
        if not set_anchors(laws, anchors, t, low + p[1] + rest):
            return 0.0
        now = wall_slope(wall, x_s, y_s, vx, vy, anchors, is_relative)
        change = (f + 0.5 * rest * (slope + now)) / -now
        if not abs(change) <= 2.0**-52 * s:
            return 0.0
        rest += change
        if abs(change) <= 2.0**-54 * abs(rest):
            break
    return rest


@njit(error_model="numpy")
def move(wall, s, is_again, p, laws, bounds, anchors, is_relative):
    """Move the state to the hit at time s and bounce, in place; returns the time, or -1 if it is lost.

    `is_again`: the wall met is the one left, whose residual at the start stays in its function.
    The time is polished as a sum of two floats: beside a violent leg, whose whole length may be a few units
    in the last place of s, Newton's method needs the digits that s alone cannot hold.
    """
    x, y, vx, vy, rest = p[2], p[3], p[4], p[5], 0.0
    residual = residual_error = error = f = slope_s = 0.0
    lack = anchors[PHASE, LACK]
    if is_again:
        residual, residual_error = wall_residual(wall, x, y, laws, anchors, bounds, is_relative)
        s, f, slope_s, error = settled(wall, s, x, y, vx, vy, laws, anchors, is_relative)
    bend, _ = curvature_bounds(wall, vx, vy, bounds)
    for _ in range(MAX_POLISHES):
        t, low = two_sum(p[0], s)
        if not set_anchors(laws, anchors, t, low + p[1] + rest):
            return -1.0
        s_low, x_s, x_low, y_s, y_low = remainder(
            wall, s, rest, residual, x, y, vx, vy, laws, anchors, bounds, is_relative
        )
        lack = max(lack, anchors[PHASE, LACK])
        if is_again and error < lack / SAFETY * residual_error:
            # A short hop along the wall: its increments give s better than the laws' low parts can.
            x_low, y_low = x_low - vx * rest, y_low - vy * rest
            s_low, rest = rest_of_hop(wall, s, f, slope_s, p, laws, anchors, is_relative), 0.0
            break
        slope = wall_slope(wall, x_s, y_s, vx, vy, anchors, is_relative)
        # What Newton leaves, bend s_low^2 / (2 slope), must be nothing to the time and to the wall's speed.
        change = bend * abs(s_low)
        if wall == BASE or (
            change <= 2.0**-27 * abs(slope) and change * abs(s_low) <= 2.0**-54 * s * abs(slope)
        ):
            break
        s, rest = two_sum(s, rest + s_low)
    x_s, x_low = two_sum(x_s, x_low + vx * s_low)
    y_s, y_low = (0.0, 0.0) if wall == BASE else two_sum(y_s, y_low + vy * s_low)
    p[0], p[1] = two_sum(t, low + p[1] + rest + s_low)
    set_anchors(laws, anchors, p[0], p[1])
    p[2], p[3] = x_s, y_s
    p[4], p[5] = bounce(wall, x_s, x_low, y_s, y_low, vx, vy, anchors, is_relative)
    return s + (rest + s_low)
