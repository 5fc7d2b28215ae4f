"""The theory's distributions of energy as finite energy blurs them.

In theory the uncaptured share one energy and the captured have an implicit density. At finite energy the
uncaptured are a Gaussian peak of measured width sigma_w, shifted by sigma_w²/4. The captured diffuse only
while they are in the chaotic zone: as the uncaptured do before the capture, and after the release with a
variance smaller by (E/E_nc)^(-1/2), for E_nc is what the uncaptured have then. So their blur follows from
the measured variances of the uncaptured through the cycle, with nothing fitted. That is off by a
Kolmogorov distance of 0.004 to 0.008 on the moving cap and 0.02 on the fixed cap at the paper's energies,
for capture is delayed until a particle next crosses the mouth, and those just released mix slowly. So their
mean is left open by SHIFTS times sigma_w², of the order 1/v of the delay, and their variance by FACTORS.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import fftconvolve
from scipy.stats import norm

from conformance.audit.evidence import energies_of
from conformance.audit.runs import scene_of
from conformance.audit.samples import Sample
from conformance.audit.tolerances import Cdf, FloatArray, Mean, mean, spread
from scene.tables import cycle_length
from theory import CaptureCurve, capture_curve, sum_of_cycles

N_BINS = 4000
N_CAPTURES = 1500
N_PLACES = 1200
REACH = 6.0  # blurs beyond hold 1e-9
SHIFTS = (0.0, -0.5, -0.25, 0.25, 0.5)
FACTORS = (1.0, 1.25, 1.5)


def peak(centre: float, sigma: float) -> Cdf:
    """Return the uncaptured peak's distribution function, drift included."""
    return lambda s: np.asarray(norm.cdf(s, centre + sigma**2 / 4, sigma))


def captured(sample: Sample) -> list[Cdf]:
    """Return the distribution functions that captured particles may have; first that with nothing fitted."""
    curve = capture_curve(scene_of(sample.run), N_CAPTURES)
    gathered = _variances(sample, curve)
    weights = -np.diff(curve.p_cha) / (1 - curve.p_cha[-1])
    whole = spread(sample.gain[~sample.captured]).value ** 2
    found = []
    for factor in FACTORS:
        variance = factor * gathered
        middle, blur = _between(curve.s + variance / 4), np.sqrt(_between(variance))
        reach = REACH * float(blur.max())
        places = np.linspace(middle.min() - reach, middle.max() + reach, N_PLACES)
        below = norm.cdf((places[:, None] - middle) / blur) @ weights
        found += [_shifted(places, below, move * whole) for move in SHIFTS]
    return found


def _variances(sample: Sample, curve: CaptureCurve) -> FloatArray:
    """Return the variance of s that each captured particle has gathered in the chaotic zone."""
    times, _, spreads = zone_energy(sample)
    kept = sample.gain[~sample.captured]
    knots = np.array([0.0, *times, times[0] / sample.run.phases[0]])
    gathered = np.array([0.0, *(width**2 for width in spreads), kept.var()])
    whole = gathered[-1]
    before, until = (np.interp(t, knots, gathered) for t in (curve.t_in, curve.t_out))
    after = np.maximum(whole - until, 0.0) * np.exp(-(curve.s - curve.s[-1]) / 2)
    total: FloatArray = np.maximum(before + after, whole * 1e-6)
    return total


def _between(values: FloatArray) -> FloatArray:
    middle: FloatArray = (values[1:] + values[:-1]) / 2
    return middle


def zone_energy(sample: Sample) -> tuple[list[float], list[Mean], list[float]]:
    """Return times of the phases, mean log E/E0 of those not captured so far, and their spreads."""
    times, means, spreads = phase_times(sample), [], []
    for k, time in enumerate(times):
        with np.errstate(invalid="ignore"):
            free = ~sample.captured | (time < sample.first_stay[0])
        means.append(mean(sample.phase_s[free, 0, k]))
        spreads.append(spread(sample.phase_s[free, 0, k]).value)
    return times, means, spreads


def phase_times(sample: Sample) -> list[float]:
    """Return the times of the sample's phases."""
    span = cycle_length(scene_of(sample.run))
    return [span * phase for phase in sample.run.phases]


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
