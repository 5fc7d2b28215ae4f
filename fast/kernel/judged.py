"""What is asked before a careful step: whether the laws are known, and the particle is in the table."""

from __future__ import annotations

import numpy as np

from fast.kernel.careful import step
from fast.kernel.codes import ARC, BASE, BEYOND, FAR_TIME, FLOOR, NO_WALL, OFF_WALL
from fast.kernel.compiling import kernel
from fast.kernel.laws import set_anchors
from fast.kernel.records import DEPTH, RADIUS, VALUE, WIDTH
from fast.kernel.walls import crossed_wall, wall_residual
from scene.states import ON_WALL

# How well a particle is known: met by the step before, with the anchors as that left them; in the table, but
# with anchors that may be of another time; as a user gives it, perhaps off the wall that it names.
MET, KNOWN, GIVEN = np.arange(3)


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


@kernel
def judged_step(particle, limit, origin, scene, anchors):
    """Take a careful step of a particle, known as well as `origin` says: see fast.kernel.careful.

    For OFF_WALL the time of flight is the share of the wall's size by which the particle is off it.
    """
    if origin != MET:
        if not set_anchors(scene.laws, anchors, particle.t, particle.t_low):
            return FAR_TIME, 0.0, particle
        if origin == GIVEN and particle.wall != NO_WALL:
            gap, size = wall_gap(particle, scene, anchors)
            if abs(gap) > ON_WALL * size:
                return OFF_WALL, gap / size, particle
        crossed = crossed_wall(particle, scene, anchors)
        if crossed != NO_WALL:
            return BEYOND + crossed, 0.0, particle
    return step(particle, limit, scene, anchors)
