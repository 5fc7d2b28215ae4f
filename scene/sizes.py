"""Bounds of laws that are sizes: radius, width, depth and nu, which a valid scene keeps positive.

`scene.laws.bounds` subtracts all amplitudes of a Fourier law from its mean. The result may be negative
although the law is not: 1 + 0.9 cos x - 0.35 cos 3x is above 0.1. A lower bound that is squared, divided by
or multiplied must not be negative.
"""

from __future__ import annotations

import numpy as np

from scene.laws import Bounds, Fourier, Law, bounds


def size_bounds(law: Law) -> Bounds:
    """Bound a law that is a size, positive because its scene is valid; its least value is never below 0.

    A lower bound of 0 only says that the law is positive.
    """
    found = bounds(law)
    if found.lowest > 0.0 or not isinstance(law, Fourier):
        return found
    return found._replace(lowest=_least_by_samples(law))


def _least_by_samples(law: Fourier) -> float:
    """Bound a positive Fourier law from below by samples; return 0 if they do not show a positive bound.

    Between samples at distance d, f is at least the lower neighbour minus max |f''| d^2 / 8. Units are the
    mean, which is positive, and the phase.
    """
    waves = [(k, c / law.mean, s / law.mean) for k, c, s in law.harmonics()]
    size = 1.0 + sum(k * (abs(c) + abs(s)) for k, c, s in waves)  # bounds what a rounded phase does, too
    bend = sum(k * k * (abs(c) + abs(s)) for k, c, s in waves)
    for n in (2**8, 2**11, 2**14, 2**17):
        phases = np.arange(n) * (2.0 * np.pi / n)
        least = float((1.0 + sum(c * np.cos(k * phases) + s * np.sin(k * phases) for k, c, s in waves)).min())
        found = least - bend * (2.0 * np.pi / n) ** 2 / 8.0 - 2.0**-40 * size
        if found > 0.5 * least:
            return found * law.mean
    return 0.0
