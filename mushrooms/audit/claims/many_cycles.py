"""What grows over cycles, and what does not: X4, C1, C9, D1 and C11 to C15.

Sums of cycles are held against sums drawn from theory, and a Gaussian; cycles against their
reverses.
"""

from collections.abc import Iterator

import numpy as np
from scipy.stats import chi2, ncx2, norm

import theory
from conformance import profiles
from mushrooms.audit.claim import Check, ClaimEvidence
from mushrooms.audit.claims.finite_energy import (
    DRAWN_SEED,
    N_DRAWN,
    PEAK_DENSITY,
    captured_band,
    predicted,
    summed,
)
from mushrooms.audit.runs import RUNS, Sample, run_seed, scene_of
from mushrooms.audit.tolerances import (
    LEVEL,
    N_SIGMA,
    FloatArray,
    Mean,
    above,
    close,
    critical_gap,
    exact,
    fits,
    mean,
    share,
    spread,
    stated,
)
from scene import Horizon, Scene, State, load
from scene.transforms import backwards

MANY = ("moving-cap@1e5x30", "moving-cap@1e7x30")
INTEGRABLE = ("fermi-ulam@1e3x400", "breathing-circle@1e3x400")
LARGEST = (
    0.1  # of |log E/E0|: a fortieth of what the moving cap gains in as many cycles in the mean
)
WITHOUT_FLUX = ("flux-free@1e6", "only-depth@1e6", "only-slope@1e6")
GROWTH = 0.01  # of log E in a cycle, which would be seen
N_PARTS = 3  # of the cycles, in each of which entropy is to grow
N_REVERSED = {"quick": 20_000, "full": 100_000}
REVERSED_ENERGY = 1e3
N_BINS = 10
FULL_BIN = 20
TAILED = 10  # cycles, after which tails are told from a Gaussian's


def sums(evidence: ClaimEvidence) -> Iterator[Check]:
    """X4: after n cycles the centre is Gaussian, the tails are not."""
    sample = evidence.sample(MANY[-1 if evidence.size == "full" else 0])
    cumulants = [float(k) for k in theory.cumulants(scene_of(sample.run), 3)]
    for n in sorted({10, sample.run.n_cycles}):
        yield from _sum_of(sample, n, cumulants)


def _sum_of(sample: Sample, n: int, cumulants: list[float]) -> list[Check]:
    label = f"{sample.run.name}, n = {n}"
    total = sample.s[:, n - 1]
    sums = summed(sample.run.name, n)
    left = predicted(sample).theory_error
    m1 = cumulants[1]
    centre = sums.mean
    scale = sums.sd
    bias = centre - n * m1
    per_cycle = Mean((mean(total).value - bias) / n, mean(total).error / n)
    own = scale / N_DRAWN**0.5  # the drawn sums' standard error
    diffused = 1 - n * cumulants[2] / scale**2  # of the variance
    places = np.linspace(sums.values[0], sums.values[-1], 2000)
    gap = float(np.max(np.abs(sums.cdf(places) - norm.cdf(places, centre, scale))))
    inner, theirs = (np.abs(x - centre) < scale for x in (total, sums.values))
    z = (total - centre) / scale
    drawn = (sums.values - centre) / scale
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
        stated(
            f"{label}: the tails are no Gaussian's, by theory",
            *_tails(scene_of(sample.run), n, cumulants),
        ),
    ]


def _tails(scene: Scene, n: int, cumulants: list[float]) -> tuple[bool, str, str]:
    """Weigh the tails of the adiabatic sums, those of high energies."""
    sums = theory.sum_of_cycles(scene, n)
    scale = (n * cumulants[2]) ** 0.5
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
    found = predicted(sample)
    gain = sample.gain[sample.captured]
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

    The logarithm of the likelihoods' ratio tells two distributions apart better than any other
    number. After more cycles, or slower ones that diffuse more, sums are too near a Gaussian for so
    many particles to tell.
    """
    label = f"{sample.run.name}, n = {n}"
    sums = summed(sample.run.name, n)
    total, drawn = ((x - sums.mean) / sums.sd for x in (sample.s[:, n - 1], sums.values))
    edges = np.linspace(-3.5, 3.5, 29)
    counts, likely = (
        np.bincount(np.searchsorted(edges, x), minlength=len(edges) + 1).astype(float)
        for x in (total, drawn)
    )
    p = likely / likely.sum()
    q = np.diff(norm.cdf([-np.inf, *edges, np.inf]))
    weight = np.log(p / q)
    mine = float(p @ weight)
    its = float(q @ weight)
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


def independence(evidence: ClaimEvidence) -> Iterator[Check]:
    """C1: cycles are independent, so log E_n/E0 is a sum of as many like variables."""
    for sample in evidence.samples(*MANY):
        n = sample.run.n_cycles
        run = sample.run.name
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
            f"{run}: spread of log E_n/E0 over that of one cycle, sqrt(n) but for the first's wider"
            " blur",
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
    one = theory.rarity(scene)
    other = theory.rarity(theory.reversed_cycle(scene))
    yield exact(
        "P(E_n < E0) falls as exp(-n I), and so does the reverse's: I by theory",
        other.rate,
        one.rate,
        1e-14,
    )
    for sample in evidence.samples(*MANY):
        for n in sorted({1, 10, sample.run.n_cycles}):
            lost = share(sample.s[:, n - 1] < 0)
            sums = summed(sample.run.name, n)
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


def integrable(evidence: ClaimEvidence) -> Iterator[Check]:
    """C11: tables that are integrable at every time do not accelerate."""
    for sample in evidence.samples(*INTEGRABLE):
        largest = [float(np.abs(part).max()) for part in np.array_split(sample.s, 4, axis=1)]
        yield stated(
            f"{sample.run.name}: largest |log E/E0| of {sample.n} particles",
            max(largest) < LARGEST,
            f"{max(largest):.4f}",
            f"< {LARGEST}",
        )
        yield stated(
            f"{sample.run.name}: in the last quarter of the cycles as in the first",
            largest[3] < 1.2 * largest[0],
            f"{largest[3]:.4f} after {largest[0]:.4f}",
            "no more than 1.2 times as large",
        )


def without_flux(evidence: ClaimEvidence) -> Iterator[Check]:
    """C12: nu stands still below 1, and the rate vanishes."""
    for sample in evidence.samples(*WITHOUT_FLUX):
        yield from _no_growth(sample)
        n = int(sample.captured.sum())
        yield stated(
            f"{sample.run.name}: captured on the way", n == 0, f"{n} of {sample.n}", "nobody"
        )


def radius_alone(evidence: ClaimEvidence) -> list[Check]:
    """C13: only the radius moves, and with it nu."""
    return _no_growth(evidence.sample("only-radius@1e7"))


def _no_growth(sample: Sample) -> list[Check]:
    """Check that theory has m1 = 0, and particles a mean of exp(-s/2).

    Finite energy does not bias that mean.
    """
    limit = theory.predict(scene_of(sample.run))
    kept = np.exp(-sample.gain[sample.takes_part] / 2)
    return [
        stated(
            f"{sample.run.name}: theory", limit.m1 == 0, f"m1 = {float(limit.m1):.1g}", "m1 = 0"
        ),
        close(
            f"{sample.run.name}: mean of exp(-s/2), which finite energy leaves at 1",
            mean(kept),
            1.0,
            scale=GROWTH / 2,
            against=(f"m1 = {GROWTH}", 1 - GROWTH / 2),
        ),
    ]


def entropy(evidence: ClaimEvidence) -> Iterator[Check]:
    """C14: the entropy log(E V), as V comes back: log E grows in each part of many cycles."""
    sample = evidence.sample(MANY[0])
    for k, part in enumerate(np.array_split(_gains(sample.s), N_PARTS, axis=1)):
        yield above(
            f"{sample.run.name}: mean of log E V gained in a cycle, part {k + 1} of {N_PARTS}",
            mean(part.mean(axis=1)),
            0.0,
        )


def reversal(evidence: ClaimEvidence) -> list[Check]:
    """C15: W(E0, E1) of a cycle is W(E1, E0) of its reverse, exactly, for phase volume is kept."""
    scene = load("moving-cap")
    n = N_REVERSED[evidence.size]
    low, high = REVERSED_ENERGY * np.exp([-1.0, 1.0])
    edges = np.geomspace(low, high, N_BINS + 1)
    forward, backward = (
        _energies(evidence, table, n, low, high, stream)
        for stream, table in enumerate((scene, backwards(scene)))
    )
    counts, turned, own = (
        np.histogram2d(first, last, [edges, edges])[0]
        for first, last in (forward, backward[::-1], forward[::-1])
    )
    statistic, n_bins = _difference(counts, turned)
    refuted, _ = _difference(counts, own)
    bound = float(chi2.isf(LEVEL, n_bins))
    return [
        Check(
            f"moving cap and its reverse at {REVERSED_ENERGY:g}: chi square of {n_bins} bins of"
            " (E0, E1)",
            statistic <= bound,
            f"<= {bound:.4g}",
            statistic,
            n_tests=1,
            note=f"p = {chi2.sf(statistic, n_bins):.2g}; {n} particles each way, E0 from {low:.4g}",
            against="a cycle that is its own reverse",
            power=float(ncx2.sf(bound, n_bins, max(refuted - n_bins, 0.0))),
        )
    ]


def _energies(
    evidence: ClaimEvidence, scene: Scene, n: int, low: float, high: float, stream: int
) -> FloatArray:
    """Return E0 and E1, (2, n), of particles whose start energies are uniform from low to high."""
    random = np.random.default_rng(run_seed(evidence.seed, RUNS["moving-cap@1e3"], stream))
    speeds = np.sqrt(2 * random.uniform(low, high, n)).tolist()
    states = [
        State(one.t, one.x, one.y, v * one.vx, v * one.vy)
        for one, v in zip(
            profiles.microcanonical_states(scene, n, 0.5, random), speeds, strict=True
        )
    ]
    done = evidence.steppers.flow(scene, states, scene.period, evidence.threads)
    ends = [one.vx**2 + one.vy**2 if isinstance(one, Horizon) else np.nan for one in done.outcomes]
    return np.array([np.square(speeds), ends]) / 2


def _difference(counts: FloatArray, others: FloatArray) -> tuple[float, int]:
    """Return chi square of two histograms of as many particles, and of how many bins."""
    both = counts + others
    is_full = both >= FULL_BIN
    return float(((counts - others) ** 2)[is_full] @ (1 / both[is_full])), int(is_full.sum())


CHECKS = {
    "X4": sums,
    "C1": independence,
    "C9": tails,
    "C11": integrable,
    "C12": without_flux,
    "C13": radius_alone,
    "C14": entropy,
    "C15": reversal,
    "D1": losses,
}
