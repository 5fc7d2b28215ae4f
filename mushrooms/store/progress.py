"""Counts of the particles of a run, the mean of log E / E0, and how many collisions to expect."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from mpmath import fp

import theory
from fast.ensemble import FOLLOWED, UNDECIDED
from fast.starts import one_cycle
from scene import Cap, Mushroom, Scene, Stem
from scene.geometry import table_at
from scene.mouth import start_time
from scene.refusal import BadInput


class RunTally(NamedTuple):
    """Counts of some particles of a run.

    Attributes:
        particles, followed, undecided: how many started, reached the end, could not be decided.
        collisions, careful: in all.
        met: collisions of those that were followed to the end.
        most: collisions of the particle that has most.
        captured: captured cycles of the particles that take part.
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
        gains: returns arrays (n, K) of ln(E/E0) after each cycle, block by block; called twice.
    """
    lengths = []

    def values(centre: float) -> Iterator[float]:
        for part in gains():
            lengths.append(len(part))
            yield from (part[:, -1] - centre).tolist()

    total, n = math.fsum(values(0.0)), sum(lengths)
    if not n or not math.isfinite(total):
        return Gain(n)
    mean = total / n
    squares = math.fsum(x * x for x in values(mean))
    return Gain(n, mean, math.sqrt(squares / (n - 1) / n) if n > 1 else None)


MOST_CYCLES = 300  # after which particles that grow faster stay fast enough for any run never to end
CAREFUL_COST = 50  # collisions in lanes that take as long as one careful step, measured at 40 to 80


def expected_collisions(scene: Scene, energy: float, n_cycles: int) -> float:
    """Return how many collisions to expect of a particle; nan at the edge of binary64."""
    try:
        return _collisions_of_a_cycle(scene, energy) * _as_first_cycles(scene, n_cycles)
    except (BadInput, ArithmeticError):
        return math.nan


def _collisions_of_a_cycle(scene: Scene, energy: float) -> float:
    """Return how many collisions to expect of a particle that is fast beside the walls.

    Particles uniform in place and direction meet the walls, of length P around an area A, at the rate
    v P / (pi A), however they move; in a cycle v^2 goes as 1 / A.
    """
    begin, span, n_times = start_time(scene), one_cycle(scene), 64
    area, _ = _size(scene, begin)
    sizes = [_size(scene, begin + span * ((k + 0.5) / n_times)) for k in range(n_times)]
    rates = [math.sqrt(2.0 * energy * area / a) * walls / (math.pi * a) for a, walls in sizes]
    return math.fsum(rates) * span / n_times


def _as_first_cycles(scene: Scene, n_cycles: int) -> float:
    """Return how many first cycles make as many collisions; theory says how v grows in a mushroom."""
    if n_cycles <= 1 or not isinstance(scene, Mushroom):
        return n_cycles
    growth = float(theory.mean_of(scene, lambda s: s.context.exp(s / 2), 5))
    n = min(n_cycles, MOST_CYCLES)
    return max(float(n_cycles), math.fsum(growth**k for k in range(n)))


def _size(scene: Scene, t: float) -> tuple[float, float]:
    """Return a table's area [length^2] and the length of its walls [length] at a time."""
    now: Any = table_at(fp, scene, t)
    top = 2 * now.w if isinstance(scene, Stem) else math.pi * now.r + 2 * (now.r - now.w)
    stem = 2 * (now.h * math.hypot(1.0, now.slope) + now.half_width(-now.h))
    return float(now.cap_area() + now.stem_area()), float(top + (0 if isinstance(scene, Cap) else stem))


def careful_note(n_careful: int, n_collisions: int, seconds: float) -> str | None:
    """Return a line on careful steps, if a run took a second and they took over a tenth of its time."""
    share = n_careful / max(n_collisions, 1)
    part = CAREFUL_COST * share / (1.0 + (CAREFUL_COST - 1.0) * share)
    if seconds < 1.0 or part <= 0.1:
        return None
    return (
        f"careful steps: {share:.2g} of the collisions, some {part:.0%} of the time. They are as right as the"
        " others. Walls that move far between two collisions need them: at higher energy they are fewer"
    )
