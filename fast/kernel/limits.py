"""What holds of a scene's laws for all time, as the checks of the lanes need it (docs/lanes.md)."""

from __future__ import annotations

from typing import NamedTuple

from numba import njit

from fast.kernel.arithmetic import SAFETY
from fast.kernel.codes import BANG_BANG, FOURIER, H, R, W

LEAST_RADIUS = 2.0**-1000


class Limits(NamedTuple):
    """What holds of a scene's laws for all time, for the lanes' checks.

    Attributes:
        bend: at least |r'^2 + r r''|: half of what the arc's function may curve upwards, speed left out.
        curvature: at least |w''| and |h''|.
        rate: at least |r'|, |w'| and |h'|.
        size: at least r + w + h, which bounds the terms that a law is summed of.
        least_r, least_h: at most the least radius and depth. Where a bound says no more than that the
            radius is positive it is LEAST_RADIUS, with which only concave arcs pass.
        omega_r, omega_w, omega_h: omega of the radius, the width (w or nu) and the depth; 0 for laws of
            constant acceleration.
        has_knots: some law has knots.
    """

    bend: float
    curvature: float
    rate: float
    size: float
    least_r: float
    least_h: float
    omega_r: float
    omega_w: float
    omega_h: float
    has_knots: bool


@njit(error_model="numpy")
def limits_of(laws, bounds):
    """Return the limits of laws from the laws and their bounds (rows: lowest, highest, |f'|, |f''|)."""
    grow = 1.0 + SAFETY
    return Limits(
        grow * (bounds[R, 1] * bounds[R, 3] + bounds[R, 2] * bounds[R, 2]),
        max(bounds[W, 3], bounds[H, 3]),
        max(bounds[R, 2], max(bounds[W, 2], bounds[H, 2])),
        grow * (bounds[R, 1] + bounds[W, 1] + bounds[H, 1]),
        max(bounds[R, 0], LEAST_RADIUS),
        max(bounds[H, 0], 0.0),
        laws[R, 2] if laws[R, 0] == FOURIER else 0.0,
        laws[W, 2] if laws[W, 0] == FOURIER else 0.0,
        laws[H, 2] if laws[H, 0] == FOURIER else 0.0,
        laws[R, 0] == BANG_BANG or laws[W, 0] == BANG_BANG or laws[H, 0] == BANG_BANG,
    )
