"""What finite energy makes of the theory's figures, for a sample's scene and energy, with nothing fitted.

Everything is `theory.at_energy`: diffusion and lags from frozen tables. Each figure's band is how far that
theory says it may be off (`theory_error`): nothing is measured on the samples that it judges.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np

import theory
from conformance.audit.claim import Check
from conformance.audit.runs import RUNS, Sample, Simulation, scene_of
from conformance.audit.tolerances import Cdf, FloatArray, Mean, close, mean, share, spread

INFINITE = 1e40  # energy at which nothing is left of shifts and diffusion
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


class Figure(NamedTuple):
    """A figure of one cycle that finite energy biases.

    Attributes:
        what: in words.
        measured: on a sample.
        of: by the theory at an energy.
        error: its name in `theory_error`.
    """

    what: str
    measured: Callable[[Sample], Mean]
    of: Callable[[theory.FiniteEnergy], float]
    error: str

    def bias(self, sample: Sample) -> float:
        """Return what finite energy adds to it."""
        return self.of(predicted(sample)) - self.of(adiabatic(sample))

    def band(self, sample: Sample) -> float:
        """Return how far theory may be off."""
        return float(getattr(predicted(sample).theory_error, self.error))


GROWTH = Figure("mean of log E1/E0", lambda s: mean(s.gain), lambda f: f.mean_s, "mean_s")
ESCAPE = Figure("share never captured", lambda s: share(s.never_captured), lambda f: f.p_nc, "p_nc")
PEAK = Figure(
    "mean log E1/E0 of the never captured",
    lambda s: mean(s.gain[~s.captured]),
    lambda f: f.peak[0],
    "peak_mean",
)


def less_bias(
    figure: Figure, sample: Sample, expected: float, start: str | None = None, end: str = "", **options: Any
) -> Check:
    """Compare a figure, less what finite energy adds to it, with that of infinite energy.

    Args:
        figure: to be compared.
        sample: measured on.
        expected: at infinite energy.
        start: of the check's label; the run by default.
        end: of the label.
        options: of `close`.
    """
    bias = figure.bias(sample)
    start = f"{sample.run.name}: " if start is None else start
    return close(
        f"{start}{figure.what}, less its bias {bias:.5f}{end}",
        figure.measured(sample).less(bias),
        expected,
        band=figure.band(sample),
        **options,
    )


def width(sample: Sample) -> Mean:
    """Return sigma_w, the width of the peak of the particles never captured."""
    return spread(sample.gain[~sample.captured])


def width_as_predicted(what: str, found: Mean, sample: Sample, **options: Any) -> Check:
    """Compare the width of a sample's peak with that which frozen tables predict."""
    sigma, left = predicted(sample).peak[1] ** 0.5, predicted(sample).theory_error
    return close(what, found, sigma, band=sigma * left.variance / 2, **options)


def peak_band(found: theory.FiniteEnergy) -> float:
    """Return how far the theory's error may move the distribution function of the uncaptured."""
    left = found.theory_error
    sigma = math.sqrt(found.peak[1])
    return PEAK_DENSITY * left.peak_mean / sigma + WIDENED * left.variance + SKEWED * left.skewness


def captured_band(sample: Sample) -> float:
    """Return the same of the captured: a kernel's change moves them no more than it does the peak."""
    found = predicted(sample)
    gains = sample.gain[sample.captured]
    places = np.linspace(gains.min(), gains.max(), 400)
    steepest = float(np.max(np.diff(found.captured_cdf(places)) / np.diff(places)))
    left = found.theory_error
    return steepest * left.captured_mean + WIDENED * left.variance + SKEWED * left.skewness


def zone_energy(sample: Sample) -> tuple[list[float], list[Mean], list[float]]:
    """Return times of the phases, mean log E/E0 of those not captured so far, and their spreads."""
    times, means, spreads = phase_times(sample), [], []
    for k, time in enumerate(times):
        with np.errstate(invalid="ignore"):
            free = ~sample.captured | (time < sample.first_capture[0])
        means.append(mean(sample.phase_s[free, 0, k]))
        spreads.append(spread(sample.phase_s[free, 0, k]).value)
    return times, means, spreads


def phase_times(sample: Sample) -> list[float]:
    """Return the times of the sample's phases."""
    span = scene_of(sample.run).period
    return [span * phase for phase in sample.run.phases]


def captured_change(sample: Sample, first: int, last: int) -> FloatArray:
    """Return the change of log E from one of the run's phases to another of those captured throughout."""
    begin, end = (phase_times(sample)[k] for k in (first, last))
    with np.errstate(invalid="ignore"):
        inside = (sample.first_capture[0] < begin) & (sample.first_capture[1] > end)
    return sample.change(inside, first, last)


def share_in_the_zone(sample: Sample, times: FloatArray) -> FloatArray:
    """Return the predicted share of particles in the chaotic zone, for cycles with a single well."""
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

    def __init__(self, drawn: FloatArray) -> None:
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
    found = theory.at_energy(scene_of(RUNS[run]), RUNS[run].energy)
    return Sums(found.draw(n_cycles, N_DRAWN, DRAWN_SEED)[:, -1])
