"""One careful step of one particle, from numbers to numbers: most of what one question costs is around it.

Units are changed here and not in Python, the scene is one array and the answer a tuple. Nothing is kept
between calls, so that threads may ask side by side. What is refused here is refused by the checks in Python
too, which say why.
"""

from __future__ import annotations

import math

import numpy as np
from numba import config

from fast.kernel.careful import step
from fast.kernel.codes import ARC, BASE, BEYOND, FAR_TIME, FLOOR, HORIZON, NO_WALL
from fast.kernel.compiling import kernel, part
from fast.kernel.laws import set_anchors
from fast.kernel.records import ANCHORS_SHAPE, DEPTH, RADIUS, SHARED, VALUE, WIDTH, Compiled, Particle
from fast.kernel.walls import crossed_wall, wall_residual
from scene.states import ON_WALL

# Two more codes: the question is no good, and the answer does not fit into binary64.
REFUSED, ANSWER_LOST = np.array([50, 51])
# Squares of what is larger overflow.
LARGEST = 2.0**400
LENGTH, TIME = 96, 32  # exponents of a table's size and period in the kernel
LARGEST_FLOAT = float(np.finfo(np.float64).max)


def _plain_ldexp(number, exponent):
    try:
        return math.ldexp(number, exponent)
    except OverflowError:
        return math.copysign(math.inf, number)


# Python's own ldexp raises where C has infinity.
ldexp = _plain_ldexp if config.DISABLE_JIT else math.ldexp


def packed(scene, length, time):
    """Return a Compiled and its units as one array of floats; see fast.units.

    Every argument more costs a call some twentieth of a microsecond.
    """
    time = math.nan if time is None else time
    first = [scene.table, scene.is_relative, length, time]
    return np.concatenate([first, scene.bounds.ravel(), scene.laws.ravel()])


@part
def unpacked(numbers):
    """Return the Compiled that `packed` was given."""
    bounds, laws = numbers[4:20].reshape((4, 4)), numbers[20:]
    return Compiled(
        int(numbers[0]), numbers[1] != 0.0, laws.reshape((SHARED + 1, len(laws) // (SHARED + 1))), bounds
    )


def static_time(length, speed):
    """Return the exponent of a static table's unit of time, for a state of this speed; see fast.units."""
    return length + LENGTH - TIME - (math.frexp(speed)[1] - 1) if speed > 0.0 else 0


static_time_inside = kernel(static_time)


@kernel
def scaled(number, exponent):
    """Return a number times 2^exponent, and whether that is finite and exact."""
    if -1000 <= exponent <= 1000:  # a product is exact as well, and quicker
        found = float(number) * ldexp(1.0, exponent)
        return found, abs(found) < np.inf and found * ldexp(1.0, -exponent) == number
    found = ldexp(number, exponent)
    return found, abs(found) < np.inf and ldexp(found, -exponent) == number


@kernel
def wall_gap(particle, scene, anchors):
    """Return how far a particle is inside the wall that it leaves, and that wall's distance from 0, now.

    Today's distance is the measure, not the largest of all time: a small cap is not allowed a large one's
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


@kernel
def judged_step(particle, t_end, scene, anchors):
    """Return the careful step's code, time of flight and particle; REFUSED for one off its wall."""
    if not set_anchors(scene.laws, anchors, particle.t, 0.0):
        return FAR_TIME, 0.0, particle
    if particle.wall != NO_WALL:
        gap, size = wall_gap(particle, scene, anchors)
        if abs(gap) > ON_WALL * size:
            return REFUSED, 0.0, particle
    crossed = crossed_wall(particle, scene, anchors)
    if crossed != NO_WALL:
        return BEYOND + crossed, 0.0, particle
    return step(particle, t_end - particle.t, scene, anchors)


@kernel
def question(length, time, t, x, y, vx, vy, wall, t_end):
    """Return whether a state and a horizon can be taken, and both in the kernel's units; see fast.units."""
    speed = length - time
    t_in, is_t_kept = scaled(t, -time)
    x_in, is_x_kept = scaled(x, -length)
    y_in, is_y_kept = scaled(y, -length)
    vx_in, is_vx_kept = scaled(vx, -speed)
    vy_in, is_vy_kept = scaled(vy, -speed)
    end, is_end_kept = scaled(t_end, -time)
    if abs(end) == np.inf and abs(t_end) < np.inf:
        end, is_end_kept = math.copysign(LARGEST_FLOAT, t_end), True
    fastest = max(abs(vx_in), abs(vy_in))
    is_good = t_end >= t and (fastest == 0.0 or fastest >= 1.0 / LARGEST)
    is_good = is_good and max(abs(x_in), abs(y_in), fastest) <= LARGEST
    is_good = is_good and is_t_kept and is_x_kept and is_y_kept and is_vx_kept and is_vy_kept and is_end_kept
    return is_good, Particle(t_in, 0.0, x_in, y_in, vx_in, vy_in, wall), end


@kernel
def answer(length, time, code, dt, particle):
    """Return a collision, or the place at the horizon, in a scene's units: (code, dt, t, x, y, vx, vy)."""
    t, speed = particle.t, length - time
    if code == HORIZON:
        dt, t = 0.0, 0.0  # neither is asked for
    dt_out, is_dt_kept = scaled(dt, time)
    t_out, is_t_kept = scaled(t, time)
    x_out, is_x_kept = scaled(particle.x, length)
    y_out, is_y_kept = scaled(particle.y, length)
    vx_out, is_vx_kept = scaled(particle.vx, speed)
    vy_out, is_vy_kept = scaled(particle.vy, speed)
    if not (is_dt_kept and is_t_kept and is_x_kept and is_y_kept and is_vx_kept and is_vy_kept):
        code = ANSWER_LOST
    return code, dt_out, t_out, x_out, y_out, vx_out, vy_out


@part
def single_step(numbers, t, x, y, vx, vy, wall, t_end):
    """Take a careful step in a packed scene.

    Returns:
        (code, dt, t, x, y, vx, vy): a wall's code and the collision there, HORIZON and the place then, or why
        there is neither.
    """
    length = int(numbers[2])
    time = static_time_inside(length, max(abs(vx), abs(vy))) if np.isnan(numbers[3]) else int(numbers[3])
    is_good, particle, end = question(length, time, t, x, y, vx, vy, wall, t_end)
    if not is_good:
        return REFUSED, 0.0, t, x, y, vx, vy
    code, dt, particle = judged_step(particle, end, unpacked(numbers), np.zeros(ANCHORS_SHAPE))
    if code > HORIZON:
        return code, 0.0, t, x, y, vx, vy
    return answer(length, time, code, dt, particle)
