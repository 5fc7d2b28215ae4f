"""Many cycles: X4, the sum of n cycles against the exact convolution and against a Gaussian."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.stats import norm

import theory
from conformance.audit.claims import broadened
from conformance.audit.claims.finite_energy import bias_of_mean, width
from conformance.audit.evidence import ClaimEvidence
from conformance.audit.finding import Check
from conformance.audit.runs import RUNS, scene_of
from conformance.audit.samples import Sample
from conformance.audit.tolerances import FloatArray, Mean, close, fits, mean, share, spread, stated


def sums(evidence: ClaimEvidence) -> Iterator[Check]:
    """X4: after n cycles the centre is Gaussian, the tails are not."""
    runs = ("moving-cap@1e7x10", "moving-cap@1e7x30") if evidence.size == "full" else ("moving-cap@1e5x30",)
    cumulants = [float(k) for k in theory.cumulants(scene_of(RUNS[runs[0]]), 3)]
    for run in runs:
        sample = evidence.sample(run)
        for n in sorted({10, sample.run.n_cycles}):
            yield from _sum_of(evidence, sample, n, cumulants)


def _sum_of(evidence: ClaimEvidence, sample: Sample, n: int, cumulants: list[float]) -> Iterator[Check]:
    label = f"{sample.run.name}, n = {n}"
    total = sample.s[:, n - 1]
    m1, sd = cumulants[1], cumulants[2] ** 0.5
    noise, bias, band = blur_of_sum(sample, n)
    places, below = broadened.summed(sample.run.name, n, noise, bias)
    per_cycle = Mean((mean(total).value - bias) / n, mean(total).error / n)
    centre, scale = n * m1 + bias, float(np.hypot(sd * np.sqrt(n), noise))
    inner = np.abs(total - centre) < scale
    expected = float(np.diff(np.interp([centre - scale, centre + scale], places, below))[0])
    skewness = cumulants[3] * n / scale**3
    z = (total - mean(total).value) / spread(total).value
    gap = float(np.max(np.abs(below - _gaussian(places, centre, scale))))
    yield close(f"{label}: mean of log E_n/E0 over n, less its bias", per_cycle, m1, band=band / n, scale=m1)
    what = f"{label}: standard deviation over n"
    yield close(what, (spread(total).value / n, spread(total).error / n), scale / n, band=0.03 * scale / n)
    yield fits(
        f"{label}: log E_n/E0 against the convolution of n cycles",
        total,
        [lambda s: np.asarray(np.interp(s, places, below))],
        band=band / scale * 0.4,
        scale=0.3,
        note=f"the Gaussian is off by {gap:.3f} of itself",
    )
    yield close(f"{label}: share within one standard deviation", share(inner), expected, band=0.01)
    what = f"{label}: skewness, 0 for a Gaussian"
    yield close(what, (float(np.mean(z**3)), float(np.sqrt(6 / len(z)))), skewness, band=0.1)
    yield stated(f"{label}: the tails are no Gaussian's, by theory", *_tails(places, below, centre, scale))


def blur_of_sum(sample: Sample, n: int) -> tuple[float, float, float]:
    """Return noise, bias and its band, in log E_n/E0 after n cycles.

    A cycle that starts at energy E adds the variance and the bias of one at E0 times (E/E0)^(-1/2);
    both are taken from the width of the first.
    """
    bias, band = bias_of_mean(sample)
    weights = np.concatenate([[1.0], np.exp(-sample.s[:, : n - 1] / 2).mean(axis=0)])
    total = float(weights.sum())
    diffusing = 0.6  # of the particles' time in the chaotic zone, give or take: the blur is small anyway
    return float(np.sqrt(diffusing * total) * width(sample).value), bias * total, band * total


def _gaussian(x: FloatArray, centre: float, scale: float) -> FloatArray:
    return np.asarray(norm.cdf(x, centre, scale))


def _tails(places: FloatArray, below: FloatArray, centre: float, scale: float) -> tuple[bool, str, str]:
    left, right = (np.interp(centre + side * 3 * scale, places, below) for side in (-1, 1))
    normal = float(_gaussian(np.array([-3.0]), 0.0, 1.0)[0])
    ratios = left / normal, (1 - right) / normal
    text = f"beyond 3 sd: {ratios[0]:.2f} and {ratios[1]:.2f} times the Gaussian's"
    return bool(max(abs(ratio - 1) for ratio in ratios) > 0.1), text, "another mass"
