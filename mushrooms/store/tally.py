"""Counts of the particles of a run, gathered block by block, and the mean of log E / E0."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from fast.ensemble import FOLLOWED, UNDECIDED


class RunTally(NamedTuple):
    """Counts of some particles of a run.

    Attributes:
        particles, followed, undecided: how many started, reached the end, could not be decided.
        collisions, careful: in all.
        met: collisions of those that were followed to the end.
        most: collisions of the particle that has most.
        captured: captured cycles of those who take part.
    """

    particles: int = 0
    followed: int = 0
    undecided: int = 0
    collisions: int = 0
    careful: int = 0
    met: int = 0
    most: int = 0
    captured: int = 0

    def merged(self, other: RunTally) -> RunTally:
        """Return the tally of both."""
        sums = RunTally(*(a + b for a, b in zip(self, other, strict=True)))
        return sums._replace(most=max(self.most, other.most))


def tally_of(arrays: dict[str, npt.NDArray[Any]]) -> RunTally:
    """Return the tally of particles, given the arrays that a store keeps of them."""
    n_collisions, takes_part = arrays["wall_counts"].sum(axis=1), arrays["takes_part"] == 1
    was_followed = arrays["outcome"] == FOLLOWED
    return RunTally(
        particles=len(n_collisions),
        followed=int(was_followed.sum()),
        undecided=int((arrays["outcome"] == UNDECIDED).sum()),
        collisions=int(n_collisions.sum()),
        careful=int(arrays["n_careful"].sum()),
        met=int(n_collisions[was_followed].sum()),
        most=int(n_collisions.max(initial=0)),
        captured=int(np.isfinite(arrays["t_in"][takes_part]).any(axis=2).sum()) if "t_in" in arrays else 0,
    )


class Gain(NamedTuple):
    """The mean of n numbers and its standard error; None where they are too few, or one is infinite."""

    n: int = 0
    mean: float | None = None
    standard_error: float | None = None


def gain_of(gains: Callable[[], Iterable[npt.NDArray[np.float64]]]) -> Gain:
    """Return the mean of ln(E/E0) after the last cycle.

    `math.fsum` rounds once, whatever the order: blocks of any size come to the same bits.

    Args:
        gains: returns arrays (n, K) of ln(E/E0) after each cycle, block by block; called three times.
    """
    n = sum(len(part) for part in gains())

    def values(centre: float) -> Iterable[float]:
        return chain.from_iterable((part[:, -1] - centre).tolist() for part in gains())

    total = math.fsum(values(0.0)) if n else math.nan
    if not math.isfinite(total):
        return Gain(n)
    mean = total / n
    squares = math.fsum(x * x for x in values(mean))
    return Gain(n, mean, math.sqrt(squares / (n - 1) / n) if n > 1 else None)
