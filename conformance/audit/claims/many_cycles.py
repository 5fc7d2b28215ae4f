"""Many cycles: X4, C1, C9 and D1, sums of cycles against sums drawn from theory, and a Gaussian."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.stats import norm

import theory
from conformance.audit.claim import Check, ClaimEvidence, energies_of
from conformance.audit.claims.broadened import (
    DRAWN_SEED,
    N_DRAWN,
    PEAK_DENSITY,
    captured_band,
    predicted,
    summed,
)
from conformance.audit.runs import RUNS, Sample, scene_of
from conformance.audit.tolerances import (
    N_SIGMA,
    FloatArray,
    Mean,
    close,
    critical_gap,
    exact,
    fits,
    mean,
    share,
    spread,
    stated,
)

MANY = ("moving-cap@1e5x30", "moving-cap@1e7x30")
TAILED = 10  # cycles, after which tails are told from a Gaussian's


def sums(evidence: ClaimEvidence) -> Iterator[Check]:
    """X4: after n cycles the centre is Gaussian, the tails are not."""
    sample = evidence.sample(MANY[-1 if evidence.size == "full" else 0])
    cumulants = [float(k) for k in theory.cumulants(scene_of(sample.run), 3)]
    for n in sorted({10, sample.run.n_cycles}):
        yield from _sum_of(sample, n, cumulants)


def _sum_of(sample: Sample, n: int, cumulants: list[float]) -> list[Check]:
    label = f"{sample.run.name}, n = {n}"
    total, sums, left = sample.s[:, n - 1], summed(sample.run.name, n), predicted(sample).theory_error
    m1, centre, scale = cumulants[1], sums.mean, sums.sd
    bias = centre - n * m1
    per_cycle = Mean((mean(total).value - bias) / n, mean(total).error / n)
    own = scale / N_DRAWN**0.5  # the drawn sums' standard error
    diffused = 1 - n * cumulants[2] / scale**2  # of the variance
    places = np.linspace(sums.values[0], sums.values[-1], 2000)
    gap = float(np.max(np.abs(sums.cdf(places) - norm.cdf(places, centre, scale))))
    inner, theirs = (np.abs(x - centre) < scale for x in (total, sums.values))
    z, drawn = (total - centre) / scale, (sums.values - centre) / scale
    return [
        close(
            f"{label}: mean of log E_n/E0 over n, less its bias {bias / n:.5f}",
            per_cycle,
            m1,
            band=left.mean_s + N_SIGMA * own / n,
            scale=m1,
        ),
        close(
            f"{label}: standard deviation over n",
            (spread(total).value / n, spread(total).error / n),
            scale / n,
            band=(abs(diffused) * left.variance / 2 + N_SIGMA / (2 * N_DRAWN) ** 0.5) * scale / n,
        ),
        fits(
            f"{label}: log E_n/E0 against sums of n cycles drawn from theory",
            total,
            sums.cdf,
            band=PEAK_DENSITY * n * left.mean_s / scale + critical_gap(N_DRAWN),
            scale=0.3,
            note=f"the Gaussian is off by {gap:.3f} of itself,"
            f" {len(total)} tell {critical_gap(len(total)):.3f}",
        ),
        close(
            f"{label}: share within one standard deviation",
            share(inner),
            share(theirs).value,
            band=N_SIGMA * share(theirs).error,
        ),
        close(
            f"{label}: skewness, 0 for a Gaussian",
            mean(z**3),
            mean(drawn**3).value,
            band=N_SIGMA * mean(drawn**3).error,
        ),
        stated(f"{label}: the tails are no Gaussian's, by theory", *_tails(sample.run.name, n, cumulants)),
    ]


def _tails(run: str, n: int, cumulants: list[float]) -> tuple[bool, str, str]:
    """Weigh the tails of the adiabatic sums, those of high energies."""
    sums, scale = theory.sum_of_cycles(energies_of(run), n), (n * cumulants[2]) ** 0.5
    left, right = (float(sums.cdf(n * cumulants[1] + side * 3 * scale)) for side in (-1, 1))
    normal = float(norm.cdf(-3))
    ratios = left / normal, (1 - right) / normal
    return (
        bool(max(abs(ratio - 1) for ratio in ratios) > 0.1),
        f"beyond 3 sd: {ratios[0]:.2f} and {ratios[1]:.2f} times the Gaussian's",
        "another mass",
    )


def tails(evidence: ClaimEvidence) -> Iterator[Check]:
    """C9: most of the captured gain; after many cycles the tails are not a Gaussian's."""
    sample = evidence.sample("moving-cap@1e7")
    found, gain = predicted(sample), sample.gain[sample.captured]
    theirs = 1 - float(found.captured_cdf(np.zeros(1))[0])
    yield close(
        "moving-cap@1e7: share of the captured that gain energy",
        share(gain > 0),
        theirs,
        band=captured_band(sample),
        scale=0.1,
        against=("one half", 0.5),
    )
    for many in evidence.samples(MANY[-1]):
        yield _told_from_a_gaussian(many, TAILED)


def _told_from_a_gaussian(sample: Sample, n: int) -> Check:
    """Weigh log E_n/E0 between the theory's sums and a Gaussian of their mean and width.

    The logarithm of the likelihoods' ratio tells two distributions apart better than any other number. After
    more cycles, or slower ones that diffuse more, sums are too near a Gaussian for so many particles to tell.
    """
    label, sums = f"{sample.run.name}, n = {n}", summed(sample.run.name, n)
    total, drawn = ((x - sums.mean) / sums.sd for x in (sample.s[:, n - 1], sums.values))
    edges = np.linspace(-3.5, 3.5, 29)
    counts, likely = (_binned(x, edges) for x in (total, drawn))
    p, q = likely / likely.sum(), np.diff(norm.cdf([-np.inf, *edges, np.inf]))
    weight = np.log(p / q)
    mine, its = float(p @ weight), float(q @ weight)
    error = (float(p @ weight**2) - mine**2) ** 0.5 / len(total) ** 0.5
    return close(
        f"{label}: mean log of the likelihoods, theory's over a Gaussian's",
        (float(counts @ weight) / len(total), error),
        mine,
        band=(
            N_SIGMA * error * (len(total) / N_DRAWN) ** 0.5
            + n
            * predicted(sample).theory_error.mean_s
            / sums.sd
            * float(np.abs(np.diff(weight)) @ ((p[1:] + p[:-1]) / 2))
            / (edges[1] - edges[0])
        ),
        against=("a Gaussian", its),
    )


def _binned(values: FloatArray, edges: FloatArray) -> FloatArray:
    return np.bincount(np.searchsorted(edges, values), minlength=len(edges) + 1).astype(float)


def independence(evidence: ClaimEvidence) -> Iterator[Check]:
    """C1: cycles are independent, so log E_n/E0 is a sum of as many like variables."""
    for sample in evidence.samples(*MANY):
        n, run = sample.run.n_cycles, sample.run.name
        drawn = _gains(predicted(sample).draw(n, N_DRAWN // n, DRAWN_SEED))
        for label, first, second in (
            ("one", slice(None, -1), slice(1, None)),
            ("two", slice(None, -2), slice(2, None)),
        ):
            gains = _gains(sample.s)
            theirs = _correlation(drawn[:, first], drawn[:, second])
            what = f"{run}: correlation of the gains of cycles {label} apart"
            ours = _correlation(gains[:, first], gains[:, second])
            yield close(
                what,
                ours,
                theirs.value,
                band=N_SIGMA * theirs.error,
                scale=0.1,
                against=("0.05 more", theirs.value + 0.05),
            )
        ratio = spread(sample.s[:, -1]).over(spread(sample.s[:, 0]))
        theirs = spread(drawn.sum(axis=1)).over(spread(drawn[:, 0]))
        yield close(
            f"{run}: spread of log E_n/E0 over that of one cycle, sqrt(n) but for the first's wider blur",
            ratio,
            theirs.value,
            band=N_SIGMA * theirs.error,
            scale=n**0.5 / 4,
        )


def _gains(s: FloatArray) -> FloatArray:
    return np.diff(s, axis=1, prepend=0.0)


def _correlation(x: FloatArray, y: FloatArray) -> Mean:
    """Return the correlation of two columns of numbers, its error that of independent ones."""
    return Mean(float(np.corrcoef(x.ravel(), y.ravel())[0, 1]), x.size**-0.5)


def losses(evidence: ClaimEvidence) -> Iterator[Check]:
    """D1: how many end with less energy than they began with."""
    scene = scene_of(RUNS[MANY[0]])
    one, other = theory.rarity(scene), theory.rarity(theory.reversed_cycle(scene))
    yield exact(
        "P(E_n < E0) falls as exp(-n I), and so does the reverse's: I by theory", other.rate, one.rate, 1e-14
    )
    for sample in evidence.samples(*MANY):
        for n in sorted({1, 10, sample.run.n_cycles}):
            lost, sums = share(sample.s[:, n - 1] < 0), summed(sample.run.name, n)
            theirs = share(sums.values < 0)
            adiabatic = theory.loss_probability(scene, n)
            # Who ends near E0 is moved across it by what finite energy leaves out.
            near = float(np.mean(np.abs(sums.values) < 0.05)) / 0.1
            yield close(
                f"{sample.run.name}: share with less energy after {n} cycles",
                lost,
                theirs.value,
                band=N_SIGMA * theirs.error + near * n * predicted(sample).theory_error.mean_s,
                scale=0.2,
                note=f"{adiabatic:.4f} at infinite energy",
            )
