"""A hit that has been found: its time polished, the state moved there, and the bounce.

The laws are anchored at the hit, where the remainder of f gives the time's low part; on the wall that was
left, for a short hop, the increments since then give it better. So place, wall speed and velocity are as
accurate as their last rounding.
"""

from __future__ import annotations

from fast.kernel.arithmetic import SAFETY, two_product, two_sum
from fast.kernel.codes import ARC, BASE, FAR_TIME, FLOOR, RIGHT, TANGENT
from fast.kernel.compiling import kernel, part
from fast.kernel.laws import set_anchors

from fast.kernel.records import (  # isort: skip
    DEPTH, PHASE, PHASE_ERROR, RADIUS, RATE, SLOPE, VALUE, VALUE_LOW, Particle, Place,
)  # fmt: skip
from fast.kernel.walls import (  # isort: skip
    curvature_bounds, off_the_arc, wall_function, wall_residual, wall_slope, width_rate,
)  # fmt: skip

MAX_POLISHES = 4


@part
def remainder(wall, s, rest, residual, particle, scene, anchors):
    """Return what must be added to the time s + rest of a hit, and the rounded place there with its low part.

    The anchors hold the laws at the hit, which is where f = residual.
    """
    vx, vy = particle.vx, particle.vy
    p, x_low = two_product(vx, s)
    x_s, e = two_sum(particle.x, p)
    x_low += e + vx * rest
    p, y_low = two_product(vy, s)
    y_s, e = two_sum(particle.y, p)
    y_low += e + vy * rest
    if wall == BASE:
        return -(y_s + y_low) / vy, x_s, x_low, y_s, y_low
    f, _ = wall_residual(wall, x_s, y_s, scene, anchors)
    f -= residual
    if wall == ARC:
        f -= 2.0 * (x_s * x_low + y_s * y_low)
    elif wall == FLOOR:
        f += y_low
    else:
        f += anchors[SLOPE, VALUE] * y_low - (x_low if wall == RIGHT else -x_low)
    return f / -wall_slope(wall, x_s, y_s, vx, vy, scene, anchors), x_s, x_low, y_s, y_low


@kernel
def bounce(wall, place, vx, vy, scene, anchors):
    """Return the velocity after a hit at a place: v - 2 f' grad f / |grad f|^2 = v - 2 (v.n - u) n."""
    if wall == BASE:
        return vx, -vy
    if wall == ARC:
        return off_the_arc(place, vx, vy, anchors[RADIUS, VALUE], anchors[RADIUS, RATE])
    if wall == FLOOR:
        return vx, -vy - 2.0 * anchors[DEPTH, RATE]
    m = anchors[SLOPE, VALUE]
    sign = 1.0 if wall == RIGHT else -1.0
    rate = width_rate(scene, anchors) + anchors[SLOPE, RATE] * place.y
    out = sign * vx
    # The reflection as a matrix: at slopes near +-1 the diagonal is small and must not cancel.
    tilt, n2 = ((m - 1.0) + anchors[SLOPE, VALUE_LOW]) * (m + 1.0), 1.0 + m * m
    return (
        sign * ((tilt * out + 2.0 * (m * vy + rate)) / n2),
        (2.0 * m * (out - rate) - tilt * vy) / n2,
    )


@part
def settled(s, particle, scene, anchors):
    """Return the time of a hit of the wall left, right to its last bit, with f, f' and f's error there."""
    wall = particle.wall
    f, slope, error, _ = wall_function(wall, s, particle, 0.0, scene, anchors)
    for _ in range(MAX_POLISHES):
        change = f / -slope
        if not abs(change) > 2.0**-52 * s:
            break
        s += change
        f, slope, error, _ = wall_function(wall, s, particle, 0.0, scene, anchors)
    return s, f, slope, error


@part
def rest_of_hop(s, f, slope, particle, scene, anchors):
    """Return what must be added to the time s of a hit of the wall left; its increments gave f and f'.

    The low part matters even though s is right to its last bit: a wall that rests until a knot and is met
    just after it has a speed as small as the time since then. Newton's method, f between s and there by
    the trapezoidal rule: exact for a bang-bang law, whose f' is linear.
    """
    vx, vy = particle.vx, particle.vy
    x_s, y_s = particle.x + vx * s, particle.y + vy * s
    t, low = two_sum(particle.t, s)
    rest = f / -slope
    for _ in range(MAX_POLISHES):
        if not set_anchors(scene.laws, anchors, t, low + particle.t_low + rest):
            return 0.0
        now = wall_slope(particle.wall, x_s, y_s, vx, vy, scene, anchors)
        change = (f + 0.5 * rest * (slope + now)) / -now
        if not abs(change) <= 2.0**-52 * s:
            return 0.0
        rest += change
        if abs(change) <= 2.0**-54 * abs(rest):
            break
    return rest


@kernel
def move(wall, s, particle, scene, anchors):
    """Move a particle to its hit of a wall at time s, and bounce it.

    The time is polished as a sum of two floats: beside a violent leg, whose whole length may be a few units
    in the last place of s, Newton's method needs the digits that s alone cannot hold. A wall that is met
    again keeps its residual at the start in its function.

    Returns:
        (code, time, particle): the wall and the particle leaving it. Else the particle as it was, with
        FAR_TIME, or with TANGENT where f' is so slight that the polished time lies before the start.
    """
    vx, vy, is_again, rest = particle.vx, particle.vy, wall == particle.wall, 0.0
    residual = residual_error = error = f = slope_s = 0.0
    laws, phase_error = scene.laws, anchors[PHASE, PHASE_ERROR]
    if is_again:
        residual, residual_error = wall_residual(wall, particle.x, particle.y, scene, anchors)
        s, f, slope_s, error = settled(s, particle, scene, anchors)
    bend, _ = curvature_bounds(wall, vx, vy, scene.bounds)
    for _ in range(MAX_POLISHES):
        t, low = two_sum(particle.t, s)
        if not set_anchors(laws, anchors, t, low + particle.t_low + rest):
            return FAR_TIME, s, particle
        s_low, x_s, x_low, y_s, y_low = remainder(wall, s, rest, residual, particle, scene, anchors)
        phase_error = max(phase_error, anchors[PHASE, PHASE_ERROR])
        if is_again and error < max(phase_error / SAFETY * residual_error, 2.0**-53 * abs(residual)):
            # A short hop along the wall: its increments give s better than the laws' low parts can, or
            # than the difference of two residuals, each of them rounded, where the start lies off its wall.
            x_low, y_low = x_low - vx * rest, y_low - vy * rest
            s_low, rest = rest_of_hop(s, f, slope_s, particle, scene, anchors), 0.0
            break
        slope = wall_slope(wall, x_s, y_s, vx, vy, scene, anchors)
        # What Newton leaves, bend s_low^2 / (2 slope), must be nothing to the time and to the wall's speed.
        change = bend * abs(s_low)
        is_slight = change <= 2.0**-27 * abs(slope) and change * abs(s_low) <= 2.0**-54 * s * abs(slope)
        if wall == BASE or is_slight:
            break
        s, rest = two_sum(s, rest + s_low)
    time = s + (rest + s_low)
    if not time >= 0.0:
        return TANGENT, s, particle
    x_s, x_low = two_sum(x_s, x_low + vx * s_low)
    y_s, y_low = (0.0, 0.0) if wall == BASE else two_sum(y_s, y_low + vy * s_low)
    t, t_low = two_sum(t, low + particle.t_low + rest + s_low)
    set_anchors(laws, anchors, t, t_low)
    vx, vy = bounce(wall, Place(x_s, x_low, y_s, y_low), vx, vy, scene, anchors)
    return wall, time, Particle(t, t_low, x_s, y_s, vx, vy, wall)
