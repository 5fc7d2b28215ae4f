"""What holds of a scene's laws for all time, as the checks of the lanes need it (docs/lanes.md)."""

from __future__ import annotations

from typing import NamedTuple

from fast.kernel.arithmetic import MAX_QUADRANT, SAFETY, TWO_OVER_PI

from fast.kernel.records import (  # isort: skip
    BANG_BANG, BEND, CONSTANT, DEPTH, FASTEST, FOURIER, HIGHEST, KIND, LOWEST, N_HARMONICS, OMEGA, PERIOD,
    RADIUS, SHARED, SLOPE, WIDTH, Compiled,
)  # fmt: skip

LEAST_RADIUS = 2.0**-1000


class LawLimits(NamedTuple):
    """What holds of a scene's laws for all time, for the lanes' checks.

    Attributes:
        bend: at least |r'^2 + r r''|: half of what the arc's function may curve upwards, speed left out.
        curvature: at least |w''| and |h''|.
        rate: at least |r'|, |w'| and |h'|.
        size: at least r + w + h, which bounds the terms that a law is summed of.
        least_r, least_h: at most the least radius and depth. Where a bound says no more than that the
            radius is positive it is LEAST_RADIUS, with which only concave arcs pass.
    """

    bend: float
    curvature: float
    rate: float
    size: float
    least_r: float
    least_h: float


class Omegas(NamedTuple):
    """The frequency of each law: 0 for one of constant acceleration."""

    radius: float
    width: float
    depth: float


def limits_of(scene: Compiled) -> LawLimits:
    """Return the limits of a scene's laws."""
    r, w, h = (scene.bounds[row] for row in (RADIUS, WIDTH, DEPTH))
    grow = 1.0 + SAFETY
    found = (
        grow * (r[HIGHEST] * r[BEND] + r[FASTEST] * r[FASTEST]),
        max(w[BEND], h[BEND]),
        max(r[FASTEST], w[FASTEST], h[FASTEST]),
        grow * (r[HIGHEST] + w[HIGHEST] + h[HIGHEST]),
        max(r[LOWEST], LEAST_RADIUS),
        max(h[LOWEST], 0.0),
    )
    return LawLimits(*map(float, found))


def own_omegas(scene: Compiled) -> Omegas | None:
    """Return the frequency of each law where some are Fourier's and others have knots.

    Else None: all laws that oscillate share one frequency, and a constant law may be given any.
    """
    rows = scene.laws[[RADIUS, WIDTH, DEPTH]]
    if not ((rows[:, KIND] == BANG_BANG).any() and scene.laws[SHARED, OMEGA] > 0.0):
        return None
    return Omegas(*(float(row[OMEGA]) if row[KIND] == FOURIER else 0.0 for row in rows))


def has_lanes(scene: Compiled, last: float) -> bool:
    """Tell whether the lanes know a scene's laws, up to the time `last`."""
    laws = scene.laws
    if laws[SLOPE, KIND] != CONSTANT:
        return False
    for row in (RADIUS, WIDTH, DEPTH):
        if laws[row, KIND] == FOURIER and laws[row, N_HARMONICS] != 1.0:
            return False
        if laws[row, KIND] == BANG_BANG and not abs(last) < MAX_QUADRANT * laws[row, PERIOD]:
            return False
    return bool(abs(last) * laws[SHARED, OMEGA] * TWO_OVER_PI < 0.5 * MAX_QUADRANT)
