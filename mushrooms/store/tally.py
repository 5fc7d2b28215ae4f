"""What a run comes to, gathered block by block: counts, and moments of log E / E0.

Every sum is exact, a whole number of the least binary64, so that blocks of any size, in any order, come to
the same bits: merging is adding.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from fast import Ensemble
from fast.ensemble import FOLLOWED, UNDECIDED

LEAST = 1074  # 2^-LEAST is the least binary64 above 0
HALF = 27  # bits: sums of 2^36 halves of a mantissa stay 64-bit integers

FloatArray = npt.NDArray[np.float64]


def exact_sum(values: FloatArray) -> int:
    """Return the sum of finite numbers, in units of 2^-LEAST."""
    mantissas, exponents = np.frexp(values)
    whole = np.ldexp(mantissas, 53).astype(np.int64)
    total = 0
    for exponent in np.unique(exponents).tolist():
        those = whole[exponents == exponent]
        part = (int((those >> HALF).sum()) << HALF) + int((those & (2**HALF - 1)).sum())
        shift = exponent - 53 + LEAST  # below 0 for subnormals alone, whose last bits are 0
        total += part << shift if shift >= 0 else part >> -shift
    return total


class Moments(NamedTuple):
    """Exact sums of n numbers and of their squares; infinite ones are counted, and spoil the mean."""

    n: int = 0
    total: int = 0
    squares: int = 0
    n_infinite: int = 0

    def merged(self, other: Moments) -> Moments:
        """Return the moments of both."""
        return Moments(*(a + b for a, b in zip(self, other, strict=True)))

    @property
    def mean(self) -> float | None:
        """Return the mean, rounded once."""
        return None if self.n_infinite or not self.n else float(Fraction(self.total, self.n << LEAST))

    @property
    def variance(self) -> float | None:
        """Return the unbiased variance."""
        if self.n_infinite or self.n < 2:
            return None
        spread = Fraction(self.squares, 1 << LEAST) - Fraction(self.total, 1 << LEAST) ** 2 / self.n
        return max(0.0, float(spread / (self.n - 1)))

    @property
    def standard_error(self) -> float | None:
        """Return that of the mean."""
        return None if self.variance is None else math.sqrt(self.variance / self.n)


def moments_of(values: FloatArray) -> Moments:
    """Return the moments of numbers that are not nan."""
    finite = values[np.isfinite(values)]
    return Moments(len(values), exact_sum(finite), exact_sum(finite**2), len(values) - len(finite))


class RunTally(NamedTuple):
    """What some particles of a run come to.

    Attributes:
        particles, followed, undecided: how many started, reached the end, could not be decided.
        collisions, careful: in all.
        most: collisions of the particle that has most.
        captured: captured cycles of those who take part.
        gain: log E / E0 after all cycles, of those who take part.
    """

    particles: int = 0
    followed: int = 0
    undecided: int = 0
    collisions: int = 0
    careful: int = 0
    most: int = 0
    captured: int = 0
    gain: Moments = Moments()

    def merged(self, other: RunTally) -> RunTally:
        """Return the tally of both."""
        return RunTally(
            particles=self.particles + other.particles,
            followed=self.followed + other.followed,
            undecided=self.undecided + other.undecided,
            collisions=self.collisions + other.collisions,
            careful=self.careful + other.careful,
            most=max(self.most, other.most),
            captured=self.captured + other.captured,
            gain=self.gain.merged(other.gain),
        )

    def to_data(self) -> dict[str, Any]:
        """Return it as JSON can hold it."""
        counts = dict(zip(self._fields[:7], self[:7], strict=True))
        return {**counts, "gain": [hex(number) for number in self.gain]}


def tally_from(data: dict[str, Any]) -> RunTally:
    """Return a tally from what `RunTally.to_data` has made of it."""
    gain = Moments(*(int(number, 16) for number in data["gain"]))
    return RunTally(**{name: data[name] for name in RunTally._fields[:7]}, gain=gain)


def tally_of(ensemble: Ensemble) -> RunTally:
    """Return the tally of an ensemble."""
    takes_part = ensemble.takes_part()
    with np.errstate(divide="ignore"):
        gain = np.log(ensemble.energy[takes_part] / ensemble.energy0)
    return RunTally(
        particles=len(ensemble.energy),
        followed=int((ensemble.outcome == FOLLOWED).sum()),
        undecided=int((ensemble.outcome == UNDECIDED).sum()),
        collisions=int(ensemble.n_collisions.sum()),
        careful=int(ensemble.n_careful.sum()),
        most=int(ensemble.n_collisions.max(initial=0)),
        captured=int(ensemble.is_captured()[takes_part].sum()),
        gain=moments_of(gain),
    )
