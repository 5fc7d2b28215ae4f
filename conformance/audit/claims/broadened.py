"""What finite energy makes of the theory's figures, for a sample's scene and energy, with nothing fitted.

Everything is `theory.at_energy`: diffusion and lags from frozen tables. Each figure's band is the next order
of that theory (`theory.NextOrder`): nothing is measured on the samples that it judges.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np

import theory
from conformance.audit.runs import RUNS, Sample, Simulation, scene_of
from conformance.audit.tolerances import Cdf, FloatArray, Mean, mean, spread
from scene.tables import cycle_length

INFINITE = 1e40  # energy at which nothing is left of shifts and blurs
N_PLACES = 2001
PEAK_DENSITY = 0.3989  # of the normal density at its centre, times its width
WIDENED = 0.121  # largest change of the normal distribution function per relative change of the variance
SKEWED = 0.0665  # and per skewness
N_DRAWN = 400_000  # sums of cycles: their own error is a fifth of that of 16,000 particles
DRAWN_SEED = 20140317


def predicted(sample: Sample) -> theory.FiniteEnergy:
    """Return the theory of finite energy for a sample.

    Raises:
        NotCovered: its scene has no frozen rates.
    """
    return theory.at_energy(scene_of(sample.run), sample.run.energy)


def adiabatic(sample: Sample) -> theory.FiniteEnergy:
    """Return the same sums at infinite energy, so that a difference holds finite energy alone."""
    return theory.at_energy(scene_of(sample.run), INFINITE)


@cache
def adiabatic_limit(run: Simulation) -> theory.Prediction:
    """Return the adiabatic theory of a run's cycle, to 15 digits."""
    return theory.predict(scene_of(run), 15)


def bias_of_mean(sample: Sample) -> tuple[float, float]:
    """Return what finite energy adds to the mean of s, and the next order."""
    found = predicted(sample)
    return found.mean_s - adiabatic(sample).mean_s, found.next_order.mean_s


def peak_band(sample: Sample) -> float:
    """Return how far the next order may move the distribution function of the uncaptured."""
    found = predicted(sample)
    left = found.next_order
    sigma = math.sqrt(found.peak[1])
    return PEAK_DENSITY * left.peak_mean / sigma + WIDENED * left.variance + SKEWED * left.skewness


def captured_band(sample: Sample) -> float:
    """Return the same of the captured: a blur's change moves them no more than it does the peak."""
    found = predicted(sample)
    gains = sample.gain[sample.captured]
    places = np.linspace(gains.min(), gains.max(), 400)
    steepest = float(np.max(np.diff(found.captured_cdf(places)) / np.diff(places)))
    left = found.next_order
    return steepest * left.captured_mean + WIDENED * left.variance + SKEWED * left.skewness


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


def captured_change(sample: Sample, first: int, last: int) -> FloatArray:
    """Return the change of log E from one of the run's phases to another of those captured throughout."""
    begin, end = (phase_times(sample)[k] for k in (first, last))
    with np.errstate(invalid="ignore"):
        inside = (sample.first_stay[0] < begin) & (sample.first_stay[1] > end)
    found: FloatArray = sample.phase_s[inside, 0, last] - sample.phase_s[inside, 0, first]
    return found


def share_in_the_zone(sample: Sample, times: FloatArray) -> FloatArray:
    """Return the predicted share of particles in the chaotic zone, for cycles with a single valley."""
    curve, found = theory.capture_curve(scene_of(sample.run), N_PLACES), predicted(sample)
    # Who was captured first is released last: inside are those captured before this time.
    latest = np.minimum(times, np.interp(times, curve.t_out[::-1], curve.t_in[::-1]))
    return np.asarray(1 - (1 - found.p_nc) * found.capture_cdf(latest), dtype=np.float64)


class Sums:
    """log E_n/E0 after n cycles, drawn from the theory of one.

    Attributes:
        values: (n,) sorted.
        mean, sd: of log E_n/E0.
    """

    def __init__(self, run: Simulation, n_cycles: int) -> None:
        found = theory.at_energy(scene_of(run), run.energy)
        drawn = found.draw(n_cycles, N_DRAWN, DRAWN_SEED)[:, -1]
        self.values: FloatArray = np.sort(drawn)
        self.mean, self.sd = float(drawn.mean()), float(drawn.std())

    @property
    def cdf(self) -> Cdf:
        """Return the distribution function."""
        ranks = (np.arange(len(self.values)) + 0.5) / len(self.values)
        return lambda s: np.asarray(np.interp(s, self.values, ranks))


@cache
def summed(run: str, n_cycles: int) -> Sums:
    """Return the sums of n cycles of a run."""
    return Sums(RUNS[run], n_cycles)
