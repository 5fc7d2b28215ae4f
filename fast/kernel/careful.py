"""The careful scalar step: the first collision by construction, or `undecided`, never a guess.

Idea. Time runs from the last event, so nothing is lost when t is large; each law gives its
increment since that event without cancellation, and on the wall being left the root at zero is
removed. For a wall function f (> 0 inside) with f'' >= -K, the parabola f + f' h - K h^2 / 2
bounds f from below, so up to the parabola's root there is no hit: stepping from root to root
can never skip a collision, and converges quadratically to the first. Every value of f carries
a bound on its rounding error; where that bound leaves a question open the answer is `undecided`.

Once the wall is known, the time is polished: the laws are anchored at the hit and the remainder
of f there gives the time's low part, so that what follows (place, wall speed, velocity) is as
accurate as its last rounding, however long the flight was.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from fast.kernel.arithmetic import SAFETY, fma, two_sum

from fast.kernel.codes import (  # isort: skip
    APPROACHING, ARC, AT_END, BASE, CAP, CORNER, EDGE, FAR_TIME, FLOOR, HORIZON, LEFT, MOUTH_EDGE,
    MUSHROOM, NO_WALL, ON_CORNER, OUTSIDE, RIGHT, SLIDING, START, STEM, TANGENT, TOO_MANY,
)  # fmt: skip
from fast.kernel.hits import move
from fast.kernel.laws import LACK, PHASE, set_anchors

from fast.kernel.walls import (  # isort: skip
    curvature_bounds, is_outside, law_size, reach_time, side_of_mouth, wall_function,
    wall_residual, wall_rest,
)  # fmt: skip

MAX_PARABOLAS = 1_000_000
LEAST = 2.0**-1022  # a time in which nothing is met
NEAR = 2.0**-30  # how much beyond the limit hits are looked for, relatively
PATIENCE = 6  # parabolas tried before asking whether the wall is out of the particle's reach


@njit(error_model="numpy")
def parabola_root(f, slope, down):
    """Return the root h > 0 of f + slope h - down h^2 / 2, for f >= 0 and down >= 0; infinity for none."""
    d = np.sqrt(slope * slope + 2.0 * down * f)
    if slope < 0.0:
        return 2.0 * f / (d - slope)
    return (slope + d) / down if down > 0.0 else np.inf


@njit(error_model="numpy")
def still_reach(wall, f, slope, still, vx, vy):
    """Return a time, at most `still`, before which a wall that stands still so long is not met from f > 0."""
    down = 2.0 * (vx * vx + vy * vy) if wall == ARC else 0.0
    return min(parabola_root(f, slope, down) * (1.0 - 2.0**-20), still)


@njit(error_model="numpy")
def first_root(wall, start, limit, x, y, vx, vy, is_leaving, laws, anchors, bounds, is_relative):
    """Find the first s in (start, limit) with f = 0, f' < 0.

    Returns (code, s, f', error of s): code is the wall for a hit, NO_WALL for none before
    the limit, else a reason for `undecided`.
    """
    residual = residual_error = 0.0
    doubt = 0.0  # of the place: a start within it of the wall may be beyond
    if not is_leaving:
        residual, doubt = wall_residual(wall, x, y, laws, anchors, bounds, is_relative)
        residual_error = anchors[PHASE, LACK] * law_size(wall, y, bounds)
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
                # With slope and curvature exactly 0 the path runs along a wall that stands still.
                is_along = slope == 0.0 and slope_error == 0.0 and down == 0.0
                return (SLIDING if is_along else TANGENT), s, slope, 0.0
            f = 0.0
        elif s == start and f <= error + doubt:
            return (OUTSIDE if f < -(error + doubt) else START), s, slope, 0.0
        elif f <= error:
            # A simple root from above. Were f convex enough to turn back within its error: undecided.
            if slope >= -slope_error or (up > 0.0 and slope * slope <= 4.0 * up * error):
                return TANGENT, s, slope, 0.0
            root = s - f / slope
            if root >= limit:
                return NO_WALL, limit, 0.0, 0.0
            return wall, root, slope, error / -slope
        h = parabola_root(f, slope, down)
        if h == np.inf:
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
            still = wall_rest(wall, s, laws, anchors, is_relative)
            if s + still > moved:
                moved = max(moved, s + still_reach(wall, f, slope, still, vx, vy))
        s = moved
    return TOO_MANY, s, 0.0, 0.0


@njit(error_model="numpy")
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
            # Undecided from there on, unless a wall still to be tried is met before it.
            code, s, error = found, min(root, s), 0.0
        elif code != NO_WALL and abs(root - s) <= 8.0 * (error + root_error) + SAFETY * s:
            # A tie, unless a wall still to be tried is met before it.
            code, s, error = CORNER, min(root, s), max(error, root_error)
        elif code == NO_WALL or root < s:
            code, s, error = candidate, root, root_error
    return code, s, error


@njit(error_model="numpy")
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


@njit(error_model="numpy")
def along_mouth(limit, x, vx, laws, anchors, bounds, is_relative):
    """Follow a path along y = 0 inside the mouth: it may only end at the mouth's edge."""
    code, s, _ = earliest_side_or_floor(
        NO_WALL, 0.0, limit, x, 0.0, vx, 0.0, laws, anchors, bounds, is_relative
    )
    if code in (LEFT, RIGHT):
        return MOUTH_EDGE, s
    return (HORIZON if code == NO_WALL else code), s


@njit(error_model="numpy")
def side_of_wall(candidate, wall, s, x, y, vx, vy, laws, anchors, bounds, is_relative):
    """Return +1 when a wall is not yet met at time s, -1 when it is passed, 0 where rounding hides it."""
    if candidate == BASE:
        f = y + vy * s if vy < 0.0 else -(y + vy * s)
        error = SAFETY * (abs(y) + abs(vy) * s)
    else:
        residual = residual_error = 0.0
        if wall != candidate:
            residual, residual_error = wall_residual(candidate, x, y, laws, anchors, bounds, is_relative)
        f, slope, error, slope_error = wall_function(
            candidate, s, x, y, vx, vy, residual, laws, anchors, is_relative
        )
        error += residual_error + SAFETY * s * (abs(slope) + slope_error)
    if abs(f) <= error:
        return 0
    return 1 if f > 0.0 else -1


@njit(error_model="numpy")
def first_event(table, is_relative, wall, x, y, vx, vy, limit, laws, anchors, bounds):
    """Find the next collision or say why not; (code, s). The anchors hold the laws at the state.

    A start on two walls at once, here a named wall and y = 0, is a corner whichever way it moves; a second
    wall of any other pair is found within rounding of f = 0 by `first_root`, and then left undecided.
    """
    if y == 0.0 and wall in (ARC, LEFT, RIGHT):
        return (MOUTH_EDGE if table == MUSHROOM and wall != ARC else ON_CORNER), 0.0
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
    if y == 0.0 and wall == NO_WALL and table == MUSHROOM and vy > 0.0:
        # In the cap from the mouth or from the base, all the same, but not from the edge between them.
        gap, _ = wall_residual(RIGHT if x > 0.0 else LEFT, x, y, laws, anchors, bounds, is_relative)
        if gap == 0.0:
            return EDGE, 0.0
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
    for side in (LEFT, RIGHT):
        if side_of_wall(side, wall, crossing, x, y, vx, vy, laws, anchors, bounds, is_relative) <= 0:
            return (CORNER if table == STEM else EDGE), crossing
    if table == STEM:
        return BASE, crossing
    code, s = cap_flight(
        crossing, limit, NO_WALL, x, y, vx, vy, laws, anchors, bounds, is_relative, np.bool_(False)
    )
    return (HORIZON if code == NO_WALL else code), s


@njit(error_model="numpy")
def step(table, is_relative, laws, bounds, anchors, p, wall, limit):
    """Advance the state p = [t, t's low part, x, y, vx, vy] by one collision, in place.

    Returns (code, dt): a wall's code, HORIZON (p is moved to the limit) or why there is none
    (p stays). The anchors must hold the laws at p's time, and do so again after a collision.
    """
    x, y, vx, vy = p[2], p[3], p[4], p[5]
    # Look a little beyond the limit, so that a hit just there is seen from both sides. With no time left
    # the start is judged all the same.
    ahead = limit * (1.0 + NEAR) if limit > 0.0 else LEAST
    code, s = first_event(table, is_relative, wall, x, y, vx, vy, ahead, laws, anchors, bounds)
    if limit == 0.0 and code < HORIZON:
        code = HORIZON
    if code > HORIZON and s > limit and limit > 0.0:
        code, s = first_event(table, is_relative, wall, x, y, vx, vy, limit, laws, anchors, bounds)
    elif code < HORIZON and s > limit * (1.0 - NEAR):
        side = side_of_wall(code, wall, limit, x, y, vx, vy, laws, anchors, bounds, is_relative)
        if side >= 0:
            code = HORIZON if side > 0 else AT_END
    if code > HORIZON:
        return code, s
    if code == HORIZON:
        p[2], p[3] = fma(p[4], limit, p[2]), fma(p[5], limit, p[3])
        t, low = two_sum(p[0], limit)
        p[0], p[1] = two_sum(t, low + p[1])
        return code, limit
    dt = move(code, s, code == wall, p, laws, bounds, anchors, is_relative)
    return (code, dt) if dt >= 0.0 else (FAR_TIME, s)


@njit(error_model="numpy")
def first_step(table, is_relative, laws, bounds, anchors, p, wall, limit):
    """Judge a state and advance it, for callers whose anchors are not set."""
    if not set_anchors(laws, anchors, p[0], p[1]):
        return FAR_TIME, 0.0
    beyond = is_outside(table, is_relative, wall, p[2], p[3], laws, anchors, bounds)
    if beyond != NO_WALL:
        return OUTSIDE, float(beyond)
    return step(table, is_relative, laws, bounds, anchors, p, wall, limit)
