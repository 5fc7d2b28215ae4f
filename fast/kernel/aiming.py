"""Which wall a lane meets, and about when: the first part of a step of fast.kernel.lanes.

Idea. Walls move on at their speed now: the quotients of their distances and closing speeds are compared by
cross-multiplication, the arc is taken to second order, and what is beyond that once more at the end. On which
side of the mouth's edge y = 0 is crossed must be certain: what is shown here, and by which bound, is in
docs/lanes.md. A slope that stands still is passed as `slope`; where that is None the slope moves.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fast.kernel.arithmetic import SAFETY, fma
from fast.kernel.bounces import ONE
from fast.kernel.compiling import packed, part
from fast.kernel.lane_laws import laws_in

from fast.kernel.pools import (  # isort: skip
    HIT, ON_ARC, ON_BASE, ON_FLOOR, ON_LEFT, ON_RIGHT, R0, S, SURE, TRIES, VX, VY, WALL, X, Y,
)  # fmt: skip


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
    x, y, vx, vy = a[X + i], a[Y + i], a[VX + i], a[VY + i]
    return Outset(x, y, vx, vy, a[WALL + i], fma(x, vx, y * vy), fma(vx, vx, vy * vy))


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
    best_l = fma(d_l, f, -f_l * d)
    best_l = best_l if f_l > 0.0 else 0.0
    f = f_l if best_l > 0.0 else f
    d = d_l if best_l > 0.0 else d
    side = ON_LEFT if best_l > 0.0 else side
    best_f = fma(d_f, f, -f_f * d)
    best_f = best_f if f_f > 0.0 else 0.0
    f = f_f if best_f > 0.0 else f
    d = d_f if best_f > 0.0 else d
    side = ON_FLOOR if best_f > 0.0 else side
    return f, d, side


@part
def arc_quotient(outset, r0, r1, r2):
    """Return the time to the arc, to second order in it, as a quotient f / d.

    And half of how fast f falls there.
    """
    x, y, _, _, wall, q, v2 = outset
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
def aim(a, i, is_stem, is_relative, waves, slope, degree, limits):
    """Choose a lane's wall and guess the time, walls moving at their speed now; returns the time.

    SURE is positive only where the part of the flight before y = 0 is as chosen: docs/lanes.md.
    """
    outset, now = outset_of(a, i), laws_in(a, R0 + i, waves, is_relative, slope, degree)
    x, y, vx, vy, wall, _, _ = outset
    depth, rise = abs(y), abs(vy)
    is_in_cap = 1.0 if wall < 1.5 else 0.0
    is_in_cap = 0.0 if is_stem else is_in_cap
    k_side = side_curvature(vy, slope, limits)
    k = k_side if is_in_cap > 0.5 else k_side + limits.lift
    gap, doubt = mouth_crossing(outset, now.w, now.w1, k, limits)
    edge, drift = fma(now.m, y, now.w), fma(now.m, vy, side_rate(y, now, slope))
    f, d, side = nearest_below(wall, edge - x, vx - drift, edge + x, -vx - drift, y + now.h, -vy - now.h1)
    f_a, d_a, root = arc_quotient(outset, now.r, now.r1, now.r2)
    # Which of them, by the part of the table the flight is in and whether it crosses y = 0 before.
    reaches = fma(y, d_a, vy * f_a) if vy < 0.0 else 1.0  # cap: > 0 where the arc comes first
    stays = fma(depth, d, -f * vy) if vy > 0.0 else 1.0  # stem: > 0 where a side comes first
    top = ON_BASE if is_stem else ON_ARC
    below = side if gap > 0.0 else ON_BASE
    from_cap = ON_ARC if reaches > 0.0 else below
    from_stem = side if stays > 0.0 else top
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
    beyond = now.h2 if hit == ON_FLOOR else side_bend(y, vy, now, slope)
    beyond = beyond if hit >= ON_LEFT else 0.0
    beyond = beyond * s if hit != ON_ARC else cube_of_arc(now.r, now.r1, now.r2, now.r3) * s * s * d
    s = s * fma(0.5 * beyond, inverse, 1.0)
    # Comparisons so put that what is no number is never sure.
    whole = reaches if is_in_cap > 0.5 else stays
    gap = gap * rise
    sure = abs(gap) - doubt if is_in_cap > 0.5 else gap - doubt
    sure = 1.0 if is_stem else sure
    sure = 1.0 if whole > 0.0 else sure
    s = a[S + i] if a[TRIES + i] > 0.0 else s
    a[HIT + i], a[S + i], a[SURE + i] = hit, s, sure
    return s
