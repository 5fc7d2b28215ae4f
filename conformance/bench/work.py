"""Cost against work: kernel time against particles, cycles, energy and threads, with fitted exponents."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from conformance.bench.record import CostSeries, short

SCENE = "moving-cap"


class Load(NamedTuple):
    """An ensemble to time."""

    particles: int = 1000
    cycles: int = 1
    energy: float = 1e5
    threads: int = 1


class Cost(NamedTuple):
    """What it took: kernel seconds, collisions, bytes held at the peak."""

    seconds: float
    collisions: int
    peak_bytes: int


Ensemble = Callable[[Load], Cost]
# The largest of each is a few seconds of one core.
SWEEPS: dict[str, dict[str, tuple[float, ...]]] = {
    "quick": {
        "particles": (100, 300, 1000, 3000, 10_000),
        "cycles": (1, 2, 4),
        "energy": (1e3, 1e4, 1e5, 1e6, 1e7),
    },
    "full": {
        "particles": (100, 300, 1000, 3000, 10_000, 30_000, 100_000),
        "cycles": (1, 2, 4, 8),
        "energy": (1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9),
    },
}
# What stays the same while the named one grows.
FEW = {"particles": Load(), "cycles": Load(particles=300), "energy": Load(particles=100), "threads": Load()}


def measure_work(
    ensemble: Ensemble, size: str, cores: int, repeats: int, tick: Callable[[str], None]
) -> tuple[tuple[CostSeries, ...], float]:
    """Time ensembles of many sizes.

    Args:
        ensemble: runs one on SCENE.
        size: "quick" or "full".
        cores: threads are 1, 2, 4, ... up to so many.
        repeats: of each ensemble; the median counts.
        tick: called before each sweep with what grows.

    Returns:
        The series, and bytes per particle between the smallest and the largest number of particles.
    """
    threads = [2.0**k for k in range(cores.bit_length()) if 2**k <= cores]
    sweeps = {**SWEEPS[size], "threads": tuple(threads)}
    ensemble(Load(particles=100))  # compiles
    series, memory = [], 0.0
    for what, sizes in sweeps.items():
        tick(f"work: {what}")
        loads = [FEW[what]._replace(**{what: type(getattr(Load(), what))(n)}) for n in sizes]
        costs = [[ensemble(load) for _ in range(repeats)] for load in loads]
        seconds = [statistics.median(cost.seconds for cost in row) for row in costs]
        collisions = [float(row[0].collisions) for row in costs]
        exponent, error = fit(sizes, seconds)
        series.append(
            CostSeries(what, tuple(sizes), tuple(map(short, seconds)), tuple(collisions), exponent, error)
        )
        if what == "particles":
            memory = (costs[-1][0].peak_bytes - costs[0][0].peak_bytes) / (sizes[-1] - sizes[0])
    return tuple(series), round(memory, 1)


def fit(sizes: Sequence[float], seconds: Sequence[float]) -> tuple[float | None, float | None]:
    """Fit seconds ~ size^exponent over the larger half, three sizes at least.

    Returns:
        The exponent and its standard error: None for a single size, and no error for two.
    """
    if len(sizes) < 2:
        return None, None
    half = max(0, min(len(sizes) // 2, len(sizes) - 3))
    x, y = np.log(sizes[half:]), np.log(seconds[half:])
    slope, intercept = np.polyfit(x, y, 1)
    if len(x) == 2:
        return round(float(slope), 3), None
    rest = float(np.sum((y - slope * x - intercept) ** 2))
    spread = float(np.sum((x - x.mean()) ** 2))
    return round(float(slope), 3), round((rest / (len(x) - 2) / spread) ** 0.5, 3)
