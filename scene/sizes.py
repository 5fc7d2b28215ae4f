"""Bounds of laws that are sizes: radius, width, depth and nu, which a valid scene keeps positive.

`scene.laws.bounds` takes from the mean of a Fourier law all of its amplitudes, which may leave less than
nothing: 1 + 0.9 cos x - 0.35 cos 3x is above 0.1. Whoever squares a least value, divides by it or multiplies
two of them needs one that is not negative.
"""

from __future__ import annotations

import numpy as np

from scene.laws import Bounds, Fourier, Law, bounds


def size_bounds(law: Law) -> Bounds:
    """Bound a law that is a size, positive because its scene is valid; its least value is never below 0.

    A least value of 0 says no more than that the law is positive.
    """
    found = bounds(law)
    if found.lowest > 0.0 or not isinstance(law, Fourier):
        return found
    return found._replace(lowest=_least_by_samples(law))


def _least_by_samples(law: Fourier) -> float:
    """Bound a positive Fourier law from below, as positively as samples show it; 0 where they do not.

    Between samples d apart f is above the lower of its neighbours less max |f''| d^2 / 8. All is in units of
    the mean, which is positive, too, and of the phase.
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
