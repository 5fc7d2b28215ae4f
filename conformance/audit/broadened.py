"""The theory's distributions of energy as finite energy blurs them.

In theory the uncaptured share one energy and the captured have an implicit density. At finite energy the
uncaptured are a Gaussian peak of measured width sigma_w, shifted by sigma_w²/4. The captured diffuse only
while they are in the chaotic zone, so their blur lies between 0 and sigma_w and is left open: WIDTHS, times
sigma_w. Their mean is left open by SHIFTS, times sigma_w²: diffusion's drift and its share, delayed capture.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import fftconvolve
from scipy.stats import norm

from conformance.audit.evidence import energies_of
from conformance.audit.runs import RUNS, scene_of
from conformance.audit.tolerances import Cdf, FloatArray
from theory import capture_curve, sum_of_cycles

N_BINS = 4000
REACH = 6.0  # blurs beyond hold 1e-9
WIDTHS = (0.2, 0.35, 0.5, 0.65, 0.8, 1.0)
SHIFTS = (-0.25, 0.0, 0.25, 0.5)


def peak(centre: float, sigma: float) -> Cdf:
    """Return the uncaptured peak's distribution function, drift included."""
    return lambda s: np.asarray(norm.cdf(s, centre + sigma**2 / 4, sigma))


def captured(run: str, sigma: float) -> list[Cdf]:
    """Return the distribution functions that captured particles may have, given the peak's width."""
    found = energies_of(run)
    curve = capture_curve(scene_of(RUNS[run]), 400)
    low, high = float(curve.s.min()), float(curve.s.max())
    return [
        _shifted(*blurred(found.captured_below, low, high, part * sigma), move * sigma**2)
        for part in WIDTHS
        for move in SHIFTS
    ]


def blurred(below: Cdf, low: float, high: float, sigma: float) -> tuple[FloatArray, FloatArray]:
    """Return places and the distribution function there of a density in [low, high] and normal noise.

    Args:
        below: distribution function times any mass.
        low: where the density begins.
        high: where it ends.
        sigma: the noise.
    """
    reach = REACH * sigma
    edges = np.linspace(low - reach - 1e-6, high + reach + 1e-6, N_BINS + 1)
    masses = np.diff(below(edges))
    step = edges[1] - edges[0]
    n = int(np.ceil(reach / step)) + 1
    noise = np.diff(norm.cdf((np.arange(-n, n + 2) - 0.5) * step, 0.0, sigma))
    spread = np.maximum(fftconvolve(masses, noise, mode="same"), 0.0)
    total = np.concatenate([[0.0], np.cumsum(spread)])
    return edges, total / total[-1]


def _shifted(places: FloatArray, below: FloatArray, move: float) -> Cdf:
    return lambda s: np.asarray(np.interp(s, places + move, below))


def summed(run: str, n_cycles: int, sigma: float, bias: float) -> tuple[FloatArray, FloatArray]:
    """Return places and distribution function of log E_n/E0 after n independent cycles, blurred and shifted.

    Args:
        run: of the scene.
        n_cycles: n.
        sigma: noise of the sum.
        bias: finite energy's shift of its mean.
    """
    total = sum_of_cycles(energies_of(run), n_cycles)
    low, high = float(total.places[0]), float(total.places[-1])
    edges, below = blurred(total.cdf, low, high, max(sigma, (high - low) / N_BINS))
    return edges + bias, below
