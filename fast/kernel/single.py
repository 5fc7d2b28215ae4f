"""One question: a scalar step of one particle, from numbers to numbers.

Most of what a question costs is around the step. So units are changed here and not in Python, the scene is
one array and the answer a tuple. Nothing is kept between calls, so that threads may ask side by side. What is
refused here is refused by the checks in Python too, which say why.
"""

import math
from functools import cache
from typing import Any

import numpy as np
from numba import config, types

from fast.kernel.compiling import in_kernels, kept, kernel, part
from fast.kernel.interpreting import Allowance, as_python
from fast.kernel.numba_internals import function_of

from fast.kernel.records import (  # isort: skip
    ANCHORS_SHAPE, ANSWER_LOST, BAD_QUESTION, HORIZON, OFF_WALL, SHARED, Compiled, FloatArray,
    Integer, Particle, is_lost,
)  # fmt: skip
from fast.kernel.scalar_step import GIVEN, scalar_step
from fast.kernel.worker import careful_at, run_careful
from scene.laws import times_power

# Squares of what is larger overflow.
LARGEST = 2.0**400
LENGTH, TIME = 96, 32  # exponents of a table's size and period in the kernel
LARGEST_FLOAT = float(np.finfo(np.float64).max)


@in_kernels(times_power)
def _ldexp(number: Any, exponent: Any) -> Any:
    # C has infinity where Python's own ldexp raises.
    return lambda number, exponent: math.ldexp(number, exponent)


def pack_scene(scene: Compiled, length: int, time: int | None) -> FloatArray:
    """Return a Compiled and its units as one array of floats; see fast.units.

    Every argument more costs a call some twentieth of a microsecond.
    """
    first = [scene.table, scene.is_relative, length, math.nan if time is None else time]
    return np.concatenate([first, scene.bounds.ravel(), scene.laws.ravel()])


@part
def unpack_scene(numbers: FloatArray) -> Compiled:
    """Return the Compiled that `packed` was given."""
    bounds, laws = numbers[4:20].reshape((4, 4)), numbers[20:]
    return Compiled(
        int(numbers[0]), numbers[1] != 0.0, laws.reshape((SHARED + 1, len(laws) // (SHARED + 1))), bounds
    )


@kernel
def static_time(length: int, speed: float) -> int:
    """Return the exponent of a static table's unit of time, for a state of this speed; see fast.units."""
    return length + LENGTH - TIME - (math.frexp(speed)[1] - 1) if speed > 0.0 else 0


@kernel
def scaled(number: float, exponent: int) -> tuple[float, bool]:
    """Return a number times 2^exponent, and whether that is finite and exact."""
    if -1000 <= exponent <= 1000:  # a product is exact as well, and quicker
        found = float(number) * times_power(1.0, exponent)
        return found, abs(found) < np.inf and found * times_power(1.0, -exponent) == number
    found = times_power(number, exponent)
    return found, abs(found) < np.inf and times_power(found, -exponent) == number


@kernel
def rescaled(particle: Particle, length: int, time: int) -> tuple[Particle, bool]:
    """Return a particle times 2^length and 2^time, and whether all its numbers are finite and exact then."""
    speed = length - time
    t, is_t_kept = scaled(particle.t, time)
    x, is_x_kept = scaled(particle.x, length)
    y, is_y_kept = scaled(particle.y, length)
    vx, is_vx_kept = scaled(particle.vx, speed)
    vy, is_vy_kept = scaled(particle.vy, speed)
    is_kept = is_t_kept and is_x_kept and is_y_kept and is_vx_kept and is_vy_kept
    return Particle(t, 0.0, x, y, vx, vy, particle.wall), is_kept


@kernel
def question(given: Particle, t_end: float, length: int, time: int) -> tuple[bool, Particle, float]:
    """Return whether a state and a horizon can be taken, and both in the kernel's units; see fast.units."""
    particle, is_kept = rescaled(given, -length, -time)
    end, is_end_kept = scaled(t_end, -time)
    if abs(end) == np.inf and abs(t_end) < np.inf:
        end, is_end_kept = math.copysign(LARGEST_FLOAT, t_end), True
    fastest = max(abs(particle.vx), abs(particle.vy))
    is_good = t_end >= given.t and (fastest == 0.0 or fastest >= 1.0 / LARGEST)
    is_good = is_good and max(abs(particle.x), abs(particle.y), fastest) <= LARGEST
    return is_good and is_kept and is_end_kept, particle, end


@kept(error_model="numpy")
def single(
    step_at: Any,
    numbers: FloatArray,
    t: float,
    x: float,
    y: float,
    vx: float,
    vy: float,
    wall: Integer,
    t_end: float,
) -> tuple[Integer, float, float, float, float, float, float]:
    """Take a scalar step, whose address is given, in a packed scene.

    Returns:
        (code, dt, t, x, y, vx, vy): a wall's code and the collision there, HORIZON and the place then, or why
        there is neither.
    """
    length = int(numbers[2])
    time = static_time(length, max(abs(vx), abs(vy))) if np.isnan(numbers[3]) else int(numbers[3])
    is_good, particle, end = question(Particle(t, 0.0, x, y, vx, vy, wall), t_end, length, time)
    if not is_good:
        return BAD_QUESTION, 0.0, t, x, y, vx, vy
    known = particle, end - particle.t, GIVEN, unpack_scene(numbers), np.zeros(ANCHORS_SHAPE)
    code, dt, p = run_careful(step_at, known)
    if is_lost(code):
        return (BAD_QUESTION if code == OFF_WALL else code), 0.0, t, x, y, vx, vy
    if code == HORIZON:  # neither time is asked for
        dt, p = 0.0, Particle(0.0, 0.0, p.x, p.y, p.vx, p.vy, p.wall)
    after, is_kept = rescaled(p, length, time)
    dt, is_dt_kept = scaled(dt, time)
    if not (is_kept and is_dt_kept):
        code = ANSWER_LOST
    return code, dt, after.t, after.x, after.y, after.vx, after.vy


@kept(error_model="numpy")
def off_wall(step_at: Any, scene: Compiled, particle: Particle) -> float:
    """Return the share of its wall's size by which a particle is off it; 0 for one on it.

    And for one at a time whose phase is lost: that is left to the step, which refuses it.
    """
    code, share, _ = run_careful(step_at, (particle, 0.0, GIVEN, scene, np.zeros(ANCHORS_SHAPE)))
    return share if code == OFF_WALL else 0.0


NUMBERS, REAL, WHOLE = types.float64[::1], types.float64, types.int64
SINGLE = (WHOLE, NUMBERS, REAL, REAL, REAL, REAL, REAL, WHOLE, REAL)


@cache
def single_at_once() -> Any:
    """Return `single` for arguments that are known to be of the right types: they are not looked at again.

    To find out what each of nine arguments is takes numba a tenth of the time of a whole question.
    """
    if config.DISABLE_JIT:
        return single
    single.compile(SINGLE)
    return function_of(single, SINGLE)


def single_by_python(step_at: Any, numbers: FloatArray, *question: Any) -> tuple[Any, ...]:
    """Answer a question as `single` does, run by Python: the same bits."""
    # Python refuses to divide by zero where numpy's numbers become infinite or nan, as in kernels.
    t, x, y, vx, vy, wall, t_end = question
    state = map(np.float64, (t, x, y, vx, vy))
    with np.errstate(all="ignore"):
        found = as_python(single)(step_at, numbers, *state, wall, np.float64(t_end))
    return int(found[0]), *map(float, found[1:])


@cache
def compiled() -> tuple[Any, Any]:
    """Return what answers a question, and the address of the scalar step."""
    return single_at_once(), careful_at()


allowance = Allowance()


def asking() -> tuple[Any, Any]:
    """Return what answers a question, and the scalar step that it is to be given."""
    if allowance.left and allowance.take(1, single, scalar_step):
        return single_by_python, as_python(scalar_step)
    return compiled()


def share_off_wall(scene: Compiled, particle: Particle) -> float:
    """Return what `off_wall` does."""
    if allowance.left and allowance.take(1, off_wall, scalar_step):
        exact = Particle._make([*map(np.float64, particle[:6]), particle.wall])
        with np.errstate(all="ignore"):
            return float(as_python(off_wall)(as_python(scalar_step), scene, exact))
    return float(off_wall(careful_at(), scene, particle))
