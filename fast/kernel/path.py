"""Following one particle from collision to collision (`PATHS`), by the arithmetic of the SIMD lanes.

A lane computes what each wall asks for and then chooses; one particle alone asks only for what its wall
needs. Each number is found by the same operations, so that it is the same to the bit: `aim_alone` is `aim`
with branches, and `fly_alone` tells `land` in each branch which wall is met, so that the compiler leaves out
what the others ask for.
"""

from typing import Any

import numpy as np

from fast.kernel.arithmetic import fma
from fast.kernel.compiling import HOW, kept, packed, part
from fast.kernel.follow import careful_flight, knows_laws, land_carefully
from fast.kernel.interpreting import Allowance, as_python
from fast.kernel.lane_laws import ONE_WAVE, TWO_WAVES, laws_in, look_ahead, set_reference

from fast.kernel.lanes import (  # isort: skip
    ONE, arc_quotient, cube_of_arc, land, mouth_crossing, nearest_below, outset_of, side_bend,
    side_curvature,
)  # fmt: skip
from fast.kernel import rows
from fast.kernel.records import ANSWER_LOST, STEM, is_hit, particle_at, write_state, write_step
from fast.kernel.rows import load, particle_of, put_particle
from fast.kernel.scalar_step import NEAR, scalar_step
from fast.kernel.worker import FORMS, GENERAL, careful_at

FIRST = np.int64(0)  # the lane in use


@packed
def aim_alone(a, is_stem, is_relative, waves, slope, form, limits):
    """Choose the wall and guess the time, as `aim` does; returns the wall."""
    outset, now = outset_of(a, FIRST), laws_in(a, rows.R0 + FIRST, waves, is_relative, slope, form)
    _, y, _, vy, wall, _, _ = outset
    depth, rise = abs(y), abs(vy)
    k_side = side_curvature(vy, slope, limits)
    sure, root = 1.0, 1.0
    if wall <= rows.ON_BASE and not is_stem:
        f, d, root = arc_quotient(outset, now.r, now.r1, now.r2)
        hit = rows.ON_ARC
        if vy < 0.0 and not fma(y, d, vy * f) > 0.0:
            gap, doubt = mouth_crossing(outset, now.w, now.w1, k_side, limits)
            sure, root = abs(gap * rise) - doubt, 1.0
            f, d, hit = nearest_below(outset, now, slope) if gap > 0.0 else (depth, rise, rows.ON_BASE)
    else:
        f, d, hit = nearest_below(outset, now, slope)
        is_crossing = vy > 0.0 and not fma(depth, d, -f * vy) > 0.0
        if is_crossing and is_stem:
            f, d, hit = depth, rise, rows.ON_BASE
        elif is_crossing:
            gap, doubt = mouth_crossing(outset, now.w, now.w1, k_side + limits.lift, limits)
            f, d, root = arc_quotient(outset, now.r, now.r1, now.r2)
            sure, hit = gap * rise - doubt, rows.ON_ARC
    inverse = ONE / (d * root)
    s, beyond = f * (root * inverse), 0.0
    if hit == rows.ON_ARC:
        beyond = cube_of_arc(now.r, now.r1, now.r2, now.r3) * s * s * d
    elif hit == rows.ON_FLOOR:
        beyond = now.h2 * s
    elif hit != rows.ON_BASE:
        beyond = side_bend(y, vy, now, slope) * s
    a[rows.S] = a[rows.S] if a[rows.TRIES] > 0.0 else s * fma(0.5 * beyond, inverse, 1.0)
    a[rows.SURE] = sure
    return hit


@packed
def land_on(a, hit, is_stem, is_relative, waves, slope, form, limits):
    """Take the step to a wall, if that is shown right; stays are of no interest."""
    a[rows.HIT] = hit
    land(a, FIRST, (is_stem, False, is_relative), waves, slope, form, limits)


@packed
def fly_alone(a, is_stem, is_relative, waves, slope, form, limits):
    """Find the next collision, and take the step where it is shown right, as `fly` does."""
    scene = is_stem, is_relative, waves, slope, form, limits
    hit = aim_alone(a, *scene)
    look_ahead(a, FIRST, a[rows.S], waves, is_relative, slope, form)
    if hit == rows.ON_ARC:
        land_on(a, rows.ON_ARC, *scene)
    elif hit == rows.ON_BASE:
        land_on(a, rows.ON_BASE, *scene)
    elif hit == rows.ON_LEFT:
        land_on(a, rows.ON_LEFT, *scene)
    elif hit == rows.ON_RIGHT:
        land_on(a, rows.ON_RIGHT, *scene)
    else:
        land_on(a, rows.ON_FLOOR, *scene)


@part
def next_hit(a, worker, waves, slope, form):
    """Take the next step of the particle in the first lane; returns its wall, or what comes instead.

    The lanes' answer is taken unless the end may come before: there the scalar step looks from both sides.
    """
    limit = (worker.stops.times[-1] - a[rows.T]) - a[rows.T_LOW]
    a[rows.STOP] = min(a[rows.T] + limit * (1.0 - 4.0 * NEAR), worker.laws.pieces.until)
    is_stem, is_relative = worker.laws.scene.table == STEM, worker.laws.scene.is_relative
    while knows_laws(a, FIRST, worker):
        fly_alone(a, is_stem, is_relative, waves, slope, form, worker.laws.limits)
        if a[rows.FATE] == rows.MOVED or a[rows.FATE] == rows.MARKED:
            if a[rows.T] >= a[rows.END]:
                set_reference(a, FIRST, a[rows.T], a[rows.T_LOW], worker.laws)
            return int(a[rows.WALL])
        if a[rows.FATE] == rows.FAR and a[rows.TRIES] <= rows.MAX_CORRECTIONS:
            set_reference(a, FIRST, a[rows.T] + a[rows.S], a[rows.T_LOW], worker.laws)
        elif a[rows.FATE] != rows.COARSE:
            break
    code, s, p = careful_flight(a, FIRST, worker)
    if is_hit(code):
        land_carefully(GENERAL, a, FIRST, code, s, p, worker)
    else:
        put_particle(a, FIRST, p)
    return code


def _path(is_slope_moving, form):
    form, is_waves = (0,) * form, form in (ONE_WAVE, TWO_WAVES)

    @kept(is_slope_moving, form, nogil=True, **HOW)
    def follow_path(worker, wall, factors, steps, walls):
        """Follow a worker's one particle through as many collisions as there is room for in steps and walls.

        Returns:
            How many there are, and the last wall's code or what came instead: ANSWER_LOST before a step that
            loses a bit by `factors`, see `write_step`.
        """
        laws = worker.laws
        waves, slope = laws.waves if is_waves else None, None if is_slope_moving else laws.slope
        states, a = worker.followed.states, worker.pools[GENERAL]
        load(a, FIRST, particle_at(states, 0, wall), False)
        code, n = wall, 0
        while n < steps.shape[0] and worker.stops.called_off[0] == 0:
            code = next_hit(a, worker, waves, slope, form)
            if not is_hit(code):
                break
            if not write_step(steps, n, factors, a[rows.S], particle_of(a, FIRST)):
                code = ANSWER_LOST
                break
            walls[n] = code
            n += 1
        write_state(states, 0, particle_of(a, FIRST))
        return n, code

    return follow_path


# By whether the slope moves, and by the form of the laws.
PATHS = {(moves, form): _path(moves, form) for moves in (False, True) for form in FORMS}


# How many more collisions Python follows, for each of them.
ALLOWANCES = {key: Allowance() for key in PATHS}


def path_kernel(is_slope_moving: bool, form: int, n_collisions: int) -> tuple[Any, Any]:
    """Return what follows a path of so many collisions at most, and the scalar step for its worker."""
    key = is_slope_moving, form
    kernel, allowance = PATHS[key], ALLOWANCES[key]
    if allowance.left and allowance.take(n_collisions, kernel, scalar_step):
        return as_python(kernel), as_python(scalar_step)
    return kernel, careful_at()
