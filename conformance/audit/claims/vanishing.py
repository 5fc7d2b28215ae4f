"""Where nothing is to grow exponentially, and what grows where it does; cycles against their reverses."""

from __future__ import annotations

import numpy as np
from scipy.stats import chi2, ncx2

from conformance import profiles
from conformance.audit.claim import Check, ClaimEvidence
from conformance.audit.claims.broadened import adiabatic_limit
from conformance.audit.runs import RUNS, Sample, run_seed
from conformance.audit.tolerances import LEVEL, FloatArray, above, close, mean, stated
from scene import Horizon, Scene, State, load
from scene.transforms import backwards

INTEGRABLE = ("fermi-ulam@1e3x400", "breathing-circle@1e3x400")
LARGEST = 0.1  # of |log E/E0|: a fortieth of what the moving cap gains in as many cycles in the mean
WITHOUT_FLUX = ("flux-free@1e6", "only-depth@1e6", "only-slope@1e6")
GROWTH = 0.01  # of log E in a cycle, which would be seen
MANY = "moving-cap@1e5x30"
N_PARTS = 3  # of the cycles, in each of which entropy is to grow
N_REVERSED = {"quick": 20_000, "full": 100_000}
REVERSED_ENERGY, N_BINS = 1e3, 10
FULL_BIN = 20


def integrable(evidence: ClaimEvidence) -> list[Check]:
    """C11: tables that are integrable at every time do not accelerate."""
    checks = []
    for sample in evidence.samples(*INTEGRABLE):
        largest = [float(np.abs(part).max()) for part in np.array_split(sample.s, 4, axis=1)]
        checks += [
            stated(
                f"{sample.run.name}: largest |log E/E0| of {sample.n} particles",
                max(largest) < LARGEST,
                f"{max(largest):.4f}",
                f"< {LARGEST}",
            ),
            stated(
                f"{sample.run.name}: in the last quarter of the cycles as in the first",
                largest[3] < 1.2 * largest[0],
                f"{largest[3]:.4f} after {largest[0]:.4f}",
                "no more than 1.2 times as large",
            ),
        ]
    return checks


def without_flux(evidence: ClaimEvidence) -> list[Check]:
    """C12: nu stands still below 1, and the rate vanishes."""
    checks = []
    for sample in evidence.samples(*WITHOUT_FLUX):
        checks += [*_no_growth(sample), _nobody_moves_over(sample)]
    return checks


def radius_alone(evidence: ClaimEvidence) -> list[Check]:
    """C13: only the radius moves, and with it nu."""
    return [check for sample in evidence.samples("only-radius@1e7") for check in _no_growth(sample)]


def _no_growth(sample: Sample) -> list[Check]:
    """Hold theory to m1 = 0, and particles to a mean of exp(-s/2) that finite energy does not bias."""
    limit, kept = adiabatic_limit(sample.run), np.exp(-sample.gain[sample.takes_part] / 2)
    return [
        stated(f"{sample.run.name}: theory", limit.m1 == 0, f"m1 = {float(limit.m1):.1g}", "m1 = 0"),
        close(
            f"{sample.run.name}: mean of exp(-s/2), which finite energy leaves at 1",
            mean(kept),
            1.0,
            scale=GROWTH / 2,
            against=(f"m1 = {GROWTH}", 1 - GROWTH / 2),
        ),
    ]


def _nobody_moves_over(sample: Sample) -> Check:
    n = int(sample.captured.sum())
    return stated(f"{sample.run.name}: captured on the way", n == 0, f"{n} of {sample.n}", "nobody")


def entropy(evidence: ClaimEvidence) -> list[Check]:
    """C14: the entropy log(E V), as V comes back: log E grows in each part of many cycles."""
    checks = []
    for sample in evidence.samples(MANY):
        gains = np.diff(sample.s, axis=1, prepend=0.0)
        checks += [
            above(
                f"{sample.run.name}: mean of log E V gained in a cycle, part {k + 1} of {N_PARTS}",
                mean(part.mean(axis=1)),
                0.0,
            )
            for k, part in enumerate(np.array_split(gains, N_PARTS, axis=1))
        ]
    return checks


def reversal(evidence: ClaimEvidence) -> list[Check]:
    """C15: W(E0, E1) of a cycle is W(E1, E0) of its reverse, exactly, for phase volume is kept."""
    scene, n = load("moving-cap"), N_REVERSED[evidence.size]
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
            f"moving cap and its reverse at {REVERSED_ENERGY:g}: chi square of {n_bins} bins of (E0, E1)",
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
    """Return E0 and E1, (2, n), of particles that start with all energies from low to high alike."""
    random = np.random.default_rng(run_seed(evidence.seed, RUNS["moving-cap@1e3"], stream))
    speeds = np.sqrt(2 * random.uniform(low, high, n)).tolist()
    states = [
        State(one.t, one.x, one.y, v * one.vx, v * one.vy)
        for one, v in zip(profiles.microcanonical_states(scene, n, 0.5, random), speeds, strict=True)
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
    "C11": integrable,
    "C12": without_flux,
    "C13": radius_alone,
    "C14": entropy,
    "C15": reversal,
}
