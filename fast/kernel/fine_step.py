"""The fine step: the scalar step's collision to about 31 decimals, in double-double arithmetic.

The scalar step, on the state rounded to binary64, says which wall is met first and when, or that it cannot
tell; where the state has low parts, its residuals are judged no better than that rounding. Newton's method in
pairs then gives the time, from a wall function made of increments since the last event, so that a hop along
a wall keeps its digits; place, wall speed and reflection follow in pairs. A path carries its state in pairs.

Not handled: a hop along a wall across a knot of its law is the difference of two values, and one along a
wall whose harmonics cancel in its speed meets their rounding: both keep 2^-104 of the table's size only.
Nor is the place after a long flight: it keeps 2^-104 of the way. A hop that leaves its wall at less than
2^-24 of the particle's speed may be undecided: its time is not known to `LOOSE`.
"""

from typing import NamedTuple

import numpy as np

from fast.kernel.arithmetic import add, div, mul, sub, times
from fast.kernel.compiling import kept, kernel
from fast.kernel.laws import ZERO, fine_increment, fine_law, set_anchors

from fast.kernel.records import (  # isort: skip
    ARC, BASE, BEYOND_ARC, DEPTH, FLOOR, NEAR_TANGENCY, NO_WALL, PHASE,
    PHASE_ERROR, RADIUS, RIGHT, SLOPE, TOO_LATE, WIDTH, Particle, is_hit,
)  # fmt: skip
from fast.kernel.scalar_step import first_event
from fast.kernel.walls import crossed_wall

MAX_CORRECTIONS = 8
ROUNDED = 2.0**-57  # what rounding a state takes from a residual: 64 times this (fast.kernel.walls.law_size)
SETTLED, LOOSE = 2.0**-102, 2.0**-80  # relative corrections: done; too coarse for an answer


class FineState(NamedTuple):
    """A particle's time, place and velocity, each a number high + low."""

    t: tuple[float, float]
    x: tuple[float, float]
    y: tuple[float, float]
    vx: tuple[float, float]
    vy: tuple[float, float]


@kernel
def half_width(scene, t):
    """Return w and w'."""
    w, rate = fine_law(scene.laws, WIDTH, t)
    if not scene.is_relative:
        return w, rate
    r, r_rate = fine_law(scene.laws, RADIUS, t)
    return mul(w, r), add(mul(rate, r), mul(w, r_rate))


@kernel
def increase(wall, s, state, scene):
    """Return f(s) - f(0) of a wall along the flight from the state p."""
    t, x, y, vx, vy = state
    if wall == ARC:
        d_r = fine_increment(scene.laws, RADIUS, t, s)
        r, _ = fine_law(scene.laws, RADIUS, t)
        q = add(mul(x, vx), mul(y, vy))
        v2 = add(mul(vx, vx), mul(vy, vy))
        return sub(mul(d_r, add(times(2.0, r), d_r)), mul(s, add(times(2.0, q), mul(s, v2))))
    if wall == FLOOR:
        return add(mul(vy, s), fine_increment(scene.laws, DEPTH, t, s))
    d_w = fine_increment(scene.laws, WIDTH, t, s)
    if scene.is_relative:
        d_r = fine_increment(scene.laws, RADIUS, t, s)
        r, _ = fine_law(scene.laws, RADIUS, t)
        nu, _ = fine_law(scene.laws, WIDTH, t)
        d_w = add(mul(d_w, add(r, d_r)), mul(nu, d_r))
    m, _ = fine_law(scene.laws, SLOPE, t)
    tilt = mul(fine_increment(scene.laws, SLOPE, t, s), add(y, mul(vy, s)))
    outward = times(1.0 if wall == RIGHT else -1.0, vx)
    return add(add(d_w, tilt), mul(s, sub(mul(m, vy), outward)))


@kernel
def residual(wall, state, scene):
    """Return f(0) of a wall."""
    t, x, y, _, _ = state
    if wall == ARC:
        r, _ = fine_law(scene.laws, RADIUS, t)
        return sub(mul(r, r), add(mul(x, x), mul(y, y)))
    if wall == FLOOR:
        return add(y, fine_law(scene.laws, DEPTH, t)[0])
    m, _ = fine_law(scene.laws, SLOPE, t)
    across = times(1.0 if wall == RIGHT else -1.0, x)
    return sub(add(half_width(scene, t)[0], mul(m, y)), across)


@kernel
def gradient(wall, state, scene):
    """Return f_x, f_y and f' of a wall at a state on it."""
    t, x, y, vx, vy = state
    if wall == ARC:
        r, rate = fine_law(scene.laws, RADIUS, t)
        push = sub(mul(r, rate), add(mul(x, vx), mul(y, vy)))
        return times(-2.0, x), times(-2.0, y), times(2.0, push)
    if wall == FLOOR:
        return ZERO, (1.0, 0.0), add(vy, fine_law(scene.laws, DEPTH, t)[1])
    if wall == BASE:
        return ZERO, (1.0, 0.0), vy
    m, m_rate = fine_law(scene.laws, SLOPE, t)
    side = -1.0 if wall == RIGHT else 1.0
    rate = add(half_width(scene, t)[1], mul(m_rate, y))
    return (side, 0.0), m, add(rate, add(mul(m, vy), times(side, vx)))


@kernel
def moved(state, s):
    """Return the state after a free flight."""
    t, x, y, vx, vy = state
    return FineState(add(t, s), add(x, mul(vx, s)), add(y, mul(vy, s)), vx, vy)


@kernel
def corrected(wall, s, is_again, state, scene):
    """Return the time of a hit, from a time right to binary64, and whether Newton's method settled."""
    if wall == BASE:
        return div(times(-1.0, state.y), state.vy), True
    start = ZERO if is_again else residual(wall, state, scene)
    # In the stem, maybe many radii deep, f of the arc is as large as the square of that, and so its rounding.
    is_from_afar = wall == ARC and not is_again and state.y[0] < 0.0
    time, change = (s, 0.0), s
    for _ in range(MAX_CORRECTIONS):
        after = moved(state, time)
        if is_from_afar:
            f = residual(wall, after, scene)
        else:
            f = add(start, increase(wall, time, state, scene))
        _, _, slope = gradient(wall, after, scene)
        change = -f[0] / slope[0]
        time = add(time, (change, 0.0))
        if abs(change) <= SETTLED * time[0]:
            break
    return time, abs(change) <= LOOSE * time[0]


@kernel
def reflected(wall, state, scene):
    """Return the velocity after a hit: v - 2 f' grad f / |grad f|^2."""
    f_x, f_y, slope = gradient(wall, state, scene)
    factor = div(times(2.0, slope), add(mul(f_x, f_x), mul(f_y, f_y)))
    return sub(state.vx, mul(factor, f_x)), sub(state.vy, mul(factor, f_y))


@kernel
def rounded(state, wall):
    """Return a fine state as the scalar step takes it."""
    return Particle(state.t[0], state.t[1], state.x[0], state.y[0], state.vx[0], state.vy[0], wall)


@kernel
def fine_step(wall, state, scene, anchors):
    """Return (code, flight time, state after) from a state on `wall`; the anchors hold the laws at it."""
    code, s = first_event(rounded(state, wall), np.inf, scene, anchors)
    if not is_hit(code):
        return code, (s, 0.0), state
    time, is_settled = corrected(code, s, code == wall, state, scene)
    if not is_settled:
        return NEAR_TANGENCY, (s, 0.0), state
    t, x, y, vx, vy = moved(state, time)
    if code == BASE:
        y = ZERO
    vx, vy = reflected(code, FineState(t, x, y, vx, vy), scene)
    return code, time, FineState(t, x, y, vx, vy)


@kept(error_model="numpy", nogil=True)
def fine_path(scene, anchors, state, wall, out, met, called_off):
    """Fill out[i] with dt, t, x, y, vx, vy as pairs and met[i] with the wall; returns number and last code.

    `called_off` is as in fast.kernel.records.Stops.
    """
    for i in range(out.shape[0]):
        if called_off[0] != 0:
            return i, wall
        if not set_anchors(scene.laws, anchors, state.t[0], state.t[1]):
            return i, TOO_LATE
        if state.t[1] != 0.0 or state.x[1] != 0.0 or state.y[1] != 0.0:
            anchors[PHASE, PHASE_ERROR] = max(anchors[PHASE, PHASE_ERROR], ROUNDED)
        crossed = crossed_wall(rounded(state, wall), scene, anchors) if i == 0 else NO_WALL
        if crossed != NO_WALL:
            return i, BEYOND_ARC + crossed
        wall, time, state = fine_step(wall, state, scene, anchors)
        if not is_hit(wall):
            return i, wall
        met[i] = wall
        for k, pair in enumerate((time, state.t, state.x, state.y, state.vx, state.vy)):
            out[i, k, 0], out[i, k, 1] = pair
    return out.shape[0], wall
