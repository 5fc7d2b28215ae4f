"""The scalar step: the first collision by construction, or `undecided`, never a guess.

Idea. Time runs from the last event, so nothing is lost when t is large; each law gives its
increment since that event without cancellation, and on the wall being left the root at zero is
removed. For a wall function f (> 0 inside) with f'' >= -K, the parabola f + f' h - K h^2 / 2
bounds f from below, so up to the parabola's root there is no hit: stepping from root to root
can never skip a collision, and converges quadratically to the first. Every value of f carries
a bound on its rounding error; where that bound leaves a question open the answer is `undecided`.

That bound is for f at the time as it stands. Times are rounded as well: a sum s + h, the quotient at which
y = 0 is crossed, the difference to the horizon. A wall can leave rest and return within one ulp of s. So no
sum is rounded up where that matters, and what is asked at a crossing or at the horizon is asked for all
times within rounding of it: with f' of the wall there, and its change.

Once the wall is known, the time is polished. The laws are anchored at the hit, where the remainder of f gives
the time's low part; on the wall that was left, for a short re-collision, the increments since then give it
better. So place, wall speed and velocity are as accurate as their last rounding.
"""

import numpy as np

from fast.kernel.arithmetic import SAFETY, fma, two_product, two_sum
from fast.kernel.compiling import HOW, kept, kernel, part
from fast.kernel.fates import MAX_PARABOLAS
from fast.kernel.laws import phase_room, set_anchors

from fast.kernel.records import (  # isort: skip
    APPROACHING, ARC, BASE, BEND, BEYOND_ARC, CAP, CORNER, DEPTH, FLOOR, HORIZON, LEFT,
    MOUTH_EDGE, MUSHROOM, NEAR_CORNER, NEAR_HORIZON, NEAR_MOUTH_EDGE, NEAR_START, NEAR_TANGENCY,
    NO_WALL, OFF_WALL, PHASE, PHASE_ERROR, RADIUS, RATE, RIGHT, SLIDING, SLOPE, STEM, TOO_LATE,
    TOO_MANY_PARABOLAS, VALUE, VALUE_LOW, WIDTH, Particle, Place, is_hit, is_lost, released,
)  # fmt: skip
from fast.kernel.walls import (  # isort: skip
    crossed_wall, curvature_bounds, law_size, off_the_arc, reach_time, side_of_mouth, wall_function,
    wall_residual, wall_rest, wall_slope, width_rate,
)  # fmt: skip

from scene.states import ON_WALL

LEAST = 2.0**-1022  # a time in which nothing is met
NEAR = 2.0**-30  # how much beyond the limit hits are looked for, relatively
BEFORE = 1.0 - 2.0**-52  # of a sum, so that it is not rounded up: a leg may be shorter than its last place
CLOSE = 2.0**-40  # how near to the limit trouble is trouble with the limit, relatively
# How many parabolas are tried before asking whether the wall is out of the particle's reach.
PARABOLAS_BEFORE_REACH = 6


@kernel
def parabola_root(f, slope, down):
    """Return the root h > 0 of f + slope h - down h^2 / 2, for f >= 0 and down >= 0; infinity for none."""
    d = np.sqrt(slope * slope + 2.0 * down * f)
    if slope < 0.0:
        return 2.0 * f / (d - slope)
    return (slope + d) / down if down > 0.0 else np.inf


@part
def still_reach(wall, f, slope, still, vx, vy):
    """Return a time, at most `still`, before which a wall that stands still so long is not met from f > 0."""
    down = 2.0 * (vx * vx + vy * vy) if wall == ARC else 0.0
    return min(parabola_root(f, slope, down) * (1.0 - 2.0**-20), still)


@part
def reached_at_least(wall, s, f, slope, moved, particle, scene, anchors):
    """Return a time, at least `moved`, before which a wall is not met, from what holds of it for long."""
    vx, vy, off = particle.vx, particle.vy, 0.0
    if wall == particle.wall:  # f(0) is taken out of f: the wall is that much nearer than the place says
        off, _ = wall_residual(wall, particle.x, particle.y, scene, anchors)
    reach = reach_time(wall, particle.x + vx * s, particle.y + vy * s, vx, vy, max(off, 0.0), scene.bounds)
    moved = max(moved, (s + reach) * BEFORE)
    still = wall_rest(wall, s, scene, anchors)
    if s + still > moved:
        moved = max(moved, (s + still_reach(wall, f, slope, still, vx, vy)) * BEFORE)
    return moved


@part
def root_before(limit, wall, root, slope, error):
    """Return a hit as `first_root` does, NO_WALL for one that comes after the limit whatever its error is."""
    if root - error >= limit:
        return NO_WALL, limit, 0.0, 0.0
    return wall, root, slope, error


@part
def is_at_rest(scene):
    """Tell whether no law of a scene ever changes."""
    b = scene.bounds
    return b[RADIUS, BEND] + b[WIDTH, BEND] + b[DEPTH, BEND] + b[SLOPE, BEND] == 0.0


@kernel
def first_root(wall, start, limit, particle, scene, anchors):
    """Find the first s in (start, limit) with f = 0, f' < 0.

    Returns (code, s, f', error of s): code is the wall for a hit, which may come after the limit by less than
    its error, NO_WALL for none before the limit, else a reason for `undecided`.
    """
    is_leaving = wall == particle.wall
    residual = residual_error = 0.0
    doubt = 0.0  # of the place: a start within it of the wall may be beyond
    if not is_leaving:
        residual, doubt = wall_residual(wall, particle.x, particle.y, scene, anchors)
        residual_error = anchors[PHASE, PHASE_ERROR] * law_size(wall, particle.y, scene.bounds)
    down, up = curvature_bounds(wall, particle.vx, particle.vy, scene.bounds)
    known = phase_room(scene.laws, particle.t)
    s = start
    for n_steps in range(MAX_PARABOLAS):
        if s >= limit:
            return NO_WALL, limit, 0.0, 0.0
        if s > known:
            return TOO_LATE, s, 0.0, 0.0
        f, slope, error, slope_error = wall_function(wall, s, particle, residual, scene, anchors)
        error += residual_error
        if s == 0.0 and is_leaving:
            if slope < -slope_error:
                return APPROACHING, s, slope, 0.0
            if slope <= slope_error:
                # With slope and curvature exactly 0 the path runs along a wall that stands still; by the rule
                # of docs/proof.md that is sliding where nothing moves, and else a tangency.
                is_along = slope == 0.0 and slope_error == 0.0 and is_at_rest(scene)
                return (SLIDING if is_along else NEAR_TANGENCY), s, slope, 0.0
            f = 0.0
        elif s == start and f <= error + doubt:
            return (BEYOND_ARC + wall if f < -(error + doubt) else NEAR_START), s, slope, 0.0
        elif f <= error:
            # A simple root from above. Were f convex enough to turn back within its error: undecided.
            if slope >= -slope_error or (up > 0.0 and slope * slope <= 4.0 * up * error):
                return NEAR_TANGENCY, s, slope, 0.0
            return root_before(limit, wall, s - f / slope, slope, error / -slope)
        h = parabola_root(f, slope, down)
        if h == np.inf:
            return NO_WALL, limit, 0.0, 0.0
        is_simple = slope < -slope_error and up * h <= -0.25 * slope
        if is_simple and down * h * h <= 2.0**-54 * (s + h) * -slope:
            # So little curvature that the parabola's root is the function's to the last bit. f is known no
            # better there than here, and changed by what is wrong with f' on the way.
            return root_before(limit, wall, s + h, slope, (error + slope_error * h) / -slope)
        h = parabola_root(f - 0.5 * error, slope, down)
        moved = s + h
        # Where h is less than the last place of s, rounded up, a wall might come and go in between.
        if moved <= s or (h < 2.0**-51 * s and moved - s > h):
            return NEAR_TANGENCY, s, slope, 0.0
        if n_steps >= PARABOLAS_BEFORE_REACH:
            moved = reached_at_least(wall, s, f, slope, moved, particle, scene, anchors)
        s = moved
    return TOO_MANY_PARABOLAS, s, 0.0, 0.0


@kernel
def earliest_side_or_floor(start, limit, particle, scene, anchors):
    """Find the first hit of left, right and floor; (code, s, error of s)."""
    code, s, error = NO_WALL, limit, 0.0
    # The floor first: what bounds a side that leans takes |y| <= h, which holds no longer below the floor.
    for candidate in (FLOOR, LEFT, RIGHT):
        # Look a little beyond the best so far, so that ties are seen from both sides.
        beyond = min(limit, s + 8.0 * error + SAFETY * s)
        found, root, _, root_error = first_root(candidate, start, beyond, particle, scene, anchors)
        if found == NO_WALL:
            continue
        if found != candidate:
            # Undecided from there on, unless a wall still to be tried is met before it.
            code, s, error = found, min(root, s), 0.0
        elif code != NO_WALL and abs(root - s) <= 8.0 * (error + root_error) + SAFETY * s:
            # A tie, unless a wall still to be tried is met before it.
            code, s, error = NEAR_CORNER, min(root, s), max(error, root_error)
        elif code == NO_WALL or root < s:
            code, s, error = candidate, root, root_error
    return code, s, error


@kernel
def cap_flight(start, limit, has_base, particle, scene, anchors):
    """Follow the flight in the cap from `start` to the arc; (code, s)."""
    code, s, _, error = first_root(ARC, start, limit, particle, scene, anchors)
    if code == ARC and has_base and particle.vy < 0.0:
        # The corner of arc and base: the height there must be above its rounding error.
        y, vy = particle.y, particle.vy
        height = y + vy * s
        if height <= SAFETY * (abs(y) + abs(vy) * s) + abs(vy) * error:
            return NEAR_CORNER, s
    return code, s


@part
def along_mouth(limit, particle, scene, anchors):
    """Follow a path along y = 0 inside the mouth: it may only end at the mouth's edge."""
    level = Particle(particle.t, particle.t_low, particle.x, 0.0, particle.vx, 0.0, NO_WALL)
    code, s, _ = earliest_side_or_floor(0.0, limit, level, scene, anchors)
    return (MOUTH_EDGE if code in (LEFT, RIGHT) else code), s


@kernel
def side_of_wall(candidate, s, particle, scene, anchors):
    """Return +1 when a wall is not yet met at time s, -1 when it is passed, 0 where rounding hides it."""
    y, vy = particle.y, particle.vy
    if candidate == BASE:
        f = y + vy * s if vy < 0.0 else -(y + vy * s)
        error = SAFETY * (abs(y) + abs(vy) * s)
    else:
        residual = residual_error = 0.0
        if particle.wall != candidate:
            residual, residual_error = wall_residual(candidate, particle.x, y, scene, anchors)
        f, slope, error, slope_error = wall_function(candidate, s, particle, residual, scene, anchors)
        # The time is rounded. f' may be larger a moment later, where a leg begins.
        rounding = SAFETY * s
        down, up = curvature_bounds(candidate, particle.vx, particle.vy, scene.bounds)
        error += residual_error + rounding * (abs(slope) + slope_error + rounding * max(down, up))
    if abs(f) <= error:
        return 0
    return 1 if f > 0.0 else -1


@part
def is_within_rounding(wall, x, y, scene, anchors):
    """Tell whether a place, rounded, may lie on a wall."""
    room, error = wall_residual(wall, x, y, scene, anchors)
    return room <= error


@part
def at_foot(code, particle, scene, anchors):
    """Return why no flight begins on a wall of the stem: NEAR_START where another one is within rounding."""
    if code in (SLIDING, APPROACHING):
        for candidate in (LEFT, RIGHT, FLOOR):
            if candidate != particle.wall and is_within_rounding(
                candidate, particle.x, particle.y, scene, anchors
            ):
                return NEAR_START
    return code


@part
def at_base(inward, x, y, scene, anchors):
    """Return why no flight begins on the base, its ends left open; NO_WALL where one does."""
    if inward > 0.0:
        return NO_WALL
    # Where the base ends is another wall, and a corner whichever way the particle moves.
    if scene.table == STEM:
        is_corner = is_within_rounding(LEFT, x, y, scene, anchors)
        is_corner = is_corner or is_within_rounding(RIGHT, x, y, scene, anchors)
    else:
        is_corner = is_within_rounding(ARC, x, y, scene, anchors)
    if is_corner:
        return NEAR_START
    return SLIDING if inward == 0.0 else APPROACHING


@part
def trouble_at_start(is_in_cap, particle, scene, anchors):
    """Return why no flight begins on y = 0, NO_WALL where one does.

    A start on two walls at once, here a named wall and y = 0, is a corner whichever way it moves; a second
    wall of any other pair is found within rounding of f = 0 by `first_root`, and then left undecided. So what
    is told of one wall alone, that the state slides along it or moves into it, waits until no other is near.
    """
    x, y, vx, vy, wall = particle.x, particle.y, particle.vx, particle.vy, particle.wall
    is_mushroom = scene.table == MUSHROOM
    if y == 0.0 and wall in (ARC, LEFT, RIGHT):
        return MOUTH_EDGE if is_mushroom and wall != ARC else CORNER
    if wall == BASE or (y == 0.0 and wall == NO_WALL and not is_mushroom):
        return at_base(vy if is_in_cap else -vy, x, y, scene, anchors)
    if y == 0.0 and wall == NO_WALL and vy > 0.0:
        # In the cap from the mouth or from the base, all the same, but not from the edge between them.
        gap, _ = wall_residual(RIGHT if x > 0.0 else LEFT, x, y, scene, anchors)
        if gap == 0.0:
            return NEAR_MOUTH_EDGE
    elif y == 0.0 and wall == NO_WALL:
        side = side_of_mouth(0.0, x, vx, scene, anchors)
        if side == 0:
            return NEAR_MOUTH_EDGE
        if side < 0:
            return at_base(vy, x, y, scene, anchors)
    return NO_WALL


@part
def event_from_cap(crossing, limit, particle, scene, anchors):
    """Find the next collision of a flight that begins in the cap and crosses y = 0 at a time; (code, s)."""
    code, s = cap_flight(0.0, min(crossing, limit), crossing < np.inf, particle, scene, anchors)
    if code != NO_WALL or crossing >= limit:
        return code, s
    if side_of_wall(ARC, crossing, particle, scene, anchors) <= 0:
        return NEAR_CORNER, crossing
    if scene.table == CAP:
        return BASE, crossing
    side = side_of_mouth(crossing, particle.x, particle.vx, scene, anchors)
    if side <= 0:
        return (BASE if side < 0 else NEAR_MOUTH_EDGE), crossing
    code, s, _ = earliest_side_or_floor(crossing, limit, released(particle), scene, anchors)
    return code, s


@part
def event_from_stem(crossing, limit, particle, scene, anchors):
    """Find the next collision of a flight that begins in the stem and crosses y = 0 at a time; (code, s)."""
    y, vy = particle.y, particle.vy
    code, s, error = earliest_side_or_floor(0.0, min(crossing, limit), particle, scene, anchors)
    edge = NEAR_CORNER if scene.table == STEM else NEAR_MOUTH_EDGE  # where a side ends at the top
    if code != NO_WALL:
        depth = -(y + vy * s)
        is_at_mouth = depth <= SAFETY * (abs(y) + abs(vy) * s) + abs(vy) * error
        code = at_foot(code, particle, scene, anchors)
        return (edge if crossing < np.inf and code <= FLOOR and is_at_mouth else code), s
    if crossing >= limit:
        return NO_WALL, s
    for side in (LEFT, RIGHT):
        if side_of_wall(side, crossing, particle, scene, anchors) <= 0:
            return edge, crossing
    if scene.table == STEM:
        return BASE, crossing
    return cap_flight(crossing, limit, np.bool_(False), released(particle), scene, anchors)


@kernel
def first_event(particle, limit, scene, anchors):
    """Find the next collision or say why not; (code, s). The anchors hold the laws at the particle's time."""
    table, y, vy, wall = scene.table, particle.y, particle.vy, particle.wall
    is_in_cap = table == CAP or (
        table == MUSHROOM and (y > 0.0 or wall in (BASE, ARC) or (y == 0.0 and wall == NO_WALL and vy > 0.0))
    )
    code = trouble_at_start(is_in_cap, particle, scene, anchors)
    if code != NO_WALL:
        return code, 0.0
    crossing = np.inf
    if wall != BASE and ((is_in_cap and vy < 0.0) or (not is_in_cap and vy > 0.0 and y < 0.0)):
        crossing = -y / vy
    if table == MUSHROOM and wall == NO_WALL and y == 0.0 and vy == 0.0:
        code, s = along_mouth(limit, particle, scene, anchors)
    elif is_in_cap:
        code, s = event_from_cap(crossing, limit, particle, scene, anchors)
    else:
        code, s = event_from_stem(crossing, limit, particle, scene, anchors)
    return (HORIZON if code == NO_WALL else code), s


@part
def step_before(wall, s, limit, particle, scene, anchors):
    """Return the step to a hit that is clearly before the limit, else NEAR_HORIZON."""
    code, time, after = move(wall, s, particle, scene, anchors)
    if code == wall and limit - time > CLOSE * limit + 1024.0 * abs(time - s):
        return code, time, after
    return NEAR_HORIZON, s, particle


@part
def step(particle, limit, scene, anchors):
    """Find the next collision of a particle within a time, and what it is then.

    The anchors must hold the laws at the particle's time, and do so again after a collision.

    Returns:
        (code, dt, particle): a wall's code and the particle that leaves it, HORIZON and the particle at the
        limit, or why there is neither and the particle as it was.
    """
    # Look a little beyond the limit, so that a hit just there is seen from both sides. With no time left
    # the start is judged all the same.
    ahead = limit * (1.0 + NEAR) if limit > 0.0 else LEAST
    code, s = first_event(particle, ahead, scene, anchors)
    if limit == 0.0 and (is_hit(code) or code in (SLIDING, MOUTH_EDGE, CORNER)):
        code = HORIZON  # it has arrived, even where it could not fly on
    if is_lost(code) and limit > 0.0 and s > limit * (1.0 - CLOSE):
        if s <= limit * (1.0 + CLOSE):
            code = NEAR_HORIZON
        else:
            code, s = first_event(particle, limit, scene, anchors)
    elif is_hit(code) and s > limit * (1.0 - NEAR):
        side = side_of_wall(code, limit, particle, scene, anchors)
        if side > 0 and s < limit:
            # The wall has come back before the limit, unless s is not known so well.
            return step_before(code, s, limit, particle, scene, anchors)
        if side >= 0:
            code = HORIZON if side > 0 else NEAR_HORIZON
    if is_lost(code):
        return code, s, particle
    if is_hit(code):
        return move(code, s, particle, scene, anchors)
    x, y = fma(particle.vx, limit, particle.x), fma(particle.vy, limit, particle.y)
    t, low = two_sum(particle.t, limit)
    t, low = two_sum(t, low + particle.t_low)
    return code, limit, Particle(t, low, x, y, particle.vx, particle.vy, particle.wall)


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
    for n_polishes in range(MAX_POLISHES + 1):
        f, slope, error, _ = wall_function(wall, s, particle, 0.0, scene, anchors)
        change = f / -slope
        if n_polishes == MAX_POLISHES or not abs(change) > 2.0**-52 * s:
            break
        s += change
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
        TOO_LATE, or with NEAR_TANGENCY where f' is so slight that the polished time lies before the start.
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
            return TOO_LATE, s, particle
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
        return NEAR_TANGENCY, s, particle
    x_s, x_low = two_sum(x_s, x_low + vx * s_low)
    y_s, y_low = (0.0, 0.0) if wall == BASE else two_sum(y_s, y_low + vy * s_low)
    t, t_low = two_sum(t, low + particle.t_low + rest + s_low)
    set_anchors(laws, anchors, t, t_low)
    vx, vy = bounce(wall, Place(x_s, x_low, y_s, y_low), vx, vy, scene, anchors)
    return wall, time, Particle(t, t_low, x_s, y_s, vx, vy, wall)


# How well a particle is known: in the table, or as a user gives it, perhaps off the wall that it names.
KNOWN, GIVEN = np.arange(2)


@kernel
def wall_gap(particle, scene, anchors):
    """Return how far a particle is inside the wall that it leaves, and that wall's size, now.

    Today's size is the measure, not the largest of all time: a small cap is not allowed a large one's
    slack. The anchors hold the laws at the particle's time.
    """
    r, w, h = anchors[RADIUS, VALUE], anchors[WIDTH, VALUE], anchors[DEPTH, VALUE]
    if scene.is_relative:
        w *= r
    if particle.wall == BASE:
        return particle.y, max(r, w)
    f, _ = wall_residual(particle.wall, particle.x, particle.y, scene, anchors)
    if particle.wall == ARC:
        return f / (2.0 * r), r
    return f, (h if particle.wall == FLOOR else max(w, abs(particle.x)))


@kept(ON_WALL, **HOW)
def scalar_step(particle, limit, origin, scene, anchors):
    """Take a scalar step of a particle, known as well as `origin` says.

    For OFF_WALL the time of flight is the share of the wall's size by which the particle is off it.
    """
    if not set_anchors(scene.laws, anchors, particle.t, particle.t_low):
        return TOO_LATE, 0.0, particle
    if origin == GIVEN and particle.wall != NO_WALL:
        gap, size = wall_gap(particle, scene, anchors)
        if abs(gap) > ON_WALL * size:
            return OFF_WALL, gap / size, particle
    crossed = crossed_wall(particle, scene, anchors)
    if crossed != NO_WALL:
        return BEYOND_ARC + crossed, 0.0, particle
    return step(particle, limit, scene, anchors)
