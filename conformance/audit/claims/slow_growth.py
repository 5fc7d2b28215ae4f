"""C5: speeds grow at most linearly in the number of collisions; E ~ t^2 where nothing is exponential."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

import theory
from conformance.audit.evidence import ClaimEvidence
from conformance.audit.finding import Check
from conformance.audit.runs import scene_of
from conformance.audit.samples import Sample
from conformance.audit.tolerances import FloatArray, Mean, close, mean, stated
from scene import Mushroom, State, load
from scene.laws import bounds
from scene.tables import laws, width_factors

SLOW = ("ergodic@1e4x120", "moving-cap-trivial@1e4x120")
BOUNDED = ("breathing-circle", "moving-cap", "fixed-cap-clockwise")
N_HITS, ROUNDING = 3000, 1e-12
SLOWEST = 0.02  # share of the speeds taken to gain as the next do: theory does not reach to the walls' own
MOVING = 0.06  # half the moving cap's growth rate of log E in a cycle: that of its speeds
N_SPEEDS = 5
STARTS = ((0.3, 0.4, 0.3), (-0.5, 0.2, 1.1), (0.1, 0.6, 2.0), (0.0, 0.3, 2.9))  # x, y, direction


def speeds(evidence: ClaimEvidence) -> Iterator[Check]:
    """C5: the bound by collisions; then cycles that do not accelerate exponentially."""
    for name in BOUNDED:
        yield _at_most_linear(evidence, name)
    for sample in evidence.samples(*SLOW):
        yield from _quadratic(sample)


def _at_most_linear(evidence: ClaimEvidence, name: str) -> Check:
    """Check v_n - v_0 <= 2 u n, u the fastest wall: in the wall's frame a hit only turns the speed."""
    table = load(name)
    fastest, share = _fastest_wall(table), -math.inf
    for x, y, turn in STARTS:
        start = State(0.0, x, y, 2 * fastest * math.cos(turn), 2 * fastest * math.sin(turn))
        done = evidence.steppers.trajectory(table, start, N_HITS, math.inf)
        after = np.hypot(done.steps[:, 4], done.steps[:, 5])
        gained = (after - 2 * fastest) / (2 * fastest * np.arange(1, len(after) + 1))
        share = max(share, float(gained.max()))
    return stated(
        f"{name}, slow starts: largest gain of speed over n collisions, in 2 u n, u the fastest wall",
        share <= 1 + ROUNDING,
        f"{share:.3f}",
        "at most 1",
    )


def _fastest_wall(table: object) -> float:
    """Return a bound on the speed of any wall across itself: of arc, sides and floor."""
    found = laws(table)  # type: ignore[arg-type]  # any table's
    speed = {name: bounds(law).slope for name, law in found.items() if name in ("r", "h")}
    if isinstance(table, Mushroom):
        factors = [bounds(law) for law in width_factors(table)]
        speed["w"] = float(
            sum(f.slope * np.prod([g.highest for g in factors if g is not f]) for f in factors)
        )
    return float(max(speed.values()))


def _quadratic(sample: Sample) -> Iterator[Check]:
    """Compare the mean speed's growth with a straight line, and its slope with theory."""
    name, k = sample.run.name, sample.run.n_cycles
    v = sample.speed * np.exp(np.column_stack([np.zeros(sample.n), sample.s]) / 2)
    half, whole = v[:, k // 2] - v[:, 0], v[:, -1] - v[:, 0]
    accelerating = math.log2((math.exp(MOVING * k) - 1) / (math.exp(MOVING * k / 2) - 1))
    gain, left = _gain_of_a_cycle(sample, v[:, :-1])
    yield close(
        f"{name}: mean speed gained ~ t^p over {k} cycles, p from twice the time",
        _doubling(half, whole),
        1.0,
        band=left / gain,
        scale=0.5,
        against=("exponential growth at the moving cap's rate", accelerating),
        note="so E ~ t^2",
    )
    yield close(
        f"{name}: mean speed gained in a cycle",
        mean(whole / k),
        gain,
        band=left,
        scale=gain,
        against=("none", 0.0),
    )


def _gain_of_a_cycle(sample: Sample, v: FloatArray) -> tuple[float, float]:
    """Return what theory has particles of these speeds gain in a cycle on average, and its next order.

    s = log E1/E0 has mean and variance ~ 1/v, but for lags that fall a little more slowly. So v gains
    v (mean s / 2 + mean s^2 / 8), much the same at every speed: the mean of v is linear in time, E quadratic.
    """
    scene, rows = scene_of(sample.run), []
    grid = np.geomspace(np.quantile(v, SLOWEST), v.max(), N_SPEEDS)
    for speed in grid.tolist():
        found = theory.at_energy(scene, speed**2 / 2)
        left = found.next_order
        gain = speed * (found.mean_s / 2 + (found.variance_s + found.mean_s**2) / 8)
        rows.append((gain, speed * left.mean_s / 2 + gain * left.variance))
    gains, lefts = (float(np.interp(v, grid, column).mean()) for column in np.array(rows).T)
    return gains, lefts


def _doubling(half: FloatArray, whole: FloatArray) -> Mean:
    """Return log2 of the means' ratio, its error from the ratio's to first order, the two being paired."""
    ratio = whole.mean() / half.mean()
    error = mean((whole - ratio * half) / half.mean()).error
    return Mean(math.log2(ratio), error / ratio / math.log(2))


CHECKS = {"C5": speeds}
