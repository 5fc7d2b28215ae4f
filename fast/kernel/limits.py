"""What holds of a scene's laws for all time, as the checks of the lanes need it (docs/lanes.md)."""

from __future__ import annotations

from typing import NamedTuple

from fast.kernel.arithmetic import SAFETY
from fast.kernel.records import BEND, DEPTH, FASTEST, HIGHEST, LOWEST, RADIUS, SLOPE, WIDTH, Compiled

LEAST_RADIUS = 2.0**-1000


class LawLimits(NamedTuple):
    """What holds of a scene's laws for all time, for the lanes' checks.

    Attributes:
        bend: at least |r'^2 + r r''|: half of what the arc's function may curve upwards, speed left out.
        curvature: at least |w''| + |m''| h and |h''|, for a slope m.
        turning: at least 2 |m'|, which comes times |vy| to a side's curvature.
        rate: at least |r'|, |w'| + |m'| h and |h'|.
        arc_rate: at least |r'|.
        size: at least r + w + (1 + |m|) h, which bounds the terms that a wall's function is summed of.
        lean: at least 1 + |m|.
        least_r, least_h: at most the least radius and depth. Where a bound says no more than that the
            radius is positive it is LEAST_RADIUS, with which only concave arcs pass.
    """

    bend: float
    curvature: float
    turning: float
    rate: float
    arc_rate: float
    size: float
    lean: float
    least_r: float
    least_h: float


def limits_of(scene: Compiled) -> LawLimits:
    """Return the limits of a scene's laws."""
    r, w, h, m = (scene.bounds[row] for row in (RADIUS, WIDTH, DEPTH, SLOPE))
    grow = 1.0 + SAFETY
    lean = 1.0 + max(abs(m[LOWEST]), abs(m[HIGHEST]))
    found = (
        grow * (r[HIGHEST] * r[BEND] + r[FASTEST] * r[FASTEST]),
        grow * max(w[BEND] + m[BEND] * h[HIGHEST], h[BEND]),
        2.0 * m[FASTEST],
        grow * max(r[FASTEST], w[FASTEST] + m[FASTEST] * h[HIGHEST], h[FASTEST]),
        grow * r[FASTEST],
        grow * (r[HIGHEST] + w[HIGHEST] + lean * h[HIGHEST]),
        grow * lean,
        max(r[LOWEST], LEAST_RADIUS),
        max(h[LOWEST], 0.0),
    )
    return LawLimits(*map(float, found))
