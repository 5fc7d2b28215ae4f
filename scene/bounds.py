"""Bounds of laws at all times, rounded outward at every scale.

Sizes are summed as fractions in [1/2, 1) with an exponent apart, so nothing overflows or underflows
on the way, and a relative slack covers the roundings. Only the last step, which puts the exponent
back, may leave the range: it rounds up, to a subnormal number or to infinity.
"""

import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

LEAST_NORMAL = 2.0**-1022

Harmonics = Sequence[tuple[int, float, float]]  # (k, cosine amplitude, sine amplitude)


class Bounds(NamedTuple):
    """lowest <= f <= highest, |f'| <= slope, |f''| <= curvature at all times (rounded outward)."""

    lowest: float
    highest: float
    slope: float
    curvature: float


def of_legs(knots: Sequence[tuple[float, float]]) -> Bounds:
    """Bound a bang-bang motion through knots (time, value)."""
    values = [value for _, value in knots]
    legs = [(abs(v1 - v0), t1 - t0) for (t0, v0), (t1, v1) in itertools.pairwise(knots)]
    slope = max(quotient_up(2.0, rise, duration) for rise, duration in legs)
    curvature = max(quotient_up(4.0, rise, duration, duration) for rise, duration in legs)
    return Bounds(min(values), max(values), slope, curvature)


def of_waves(mean: float, harmonics: Harmonics, omega: float, rate: int) -> Bounds:
    """Bound a mean and harmonics, whose frequency is omega 2^rate to a few roundings."""
    _, unit = math.frexp(max(max(abs(c), abs(s)) for _, c, s in harmonics))
    terms = [
        (k * omega, math.hypot(math.ldexp(c, -unit), math.ldexp(s, -unit))) for k, c, s in harmonics
    ]
    swing = round_up(sum(size for _, size in terms), unit)
    slope = round_up(sum(size * f for f, size in terms), unit + rate)
    curvature = round_up(sum(size * f * f for f, size in terms), unit + 2 * rate)
    # The sum of two floats errs by half a unit of its last place, and not at all where it is
    # subnormal.
    lowest = mean - swing
    highest = mean + swing
    return Bounds(
        lowest - _slack(lowest, swing), highest + _slack(highest, swing), slope, curvature
    )


def least_of_waves(mean: float, harmonics: Harmonics) -> float:
    """Bound positive waves from below by samples; return 0 if they do not show a positive bound.

    Between samples at distance d, f is at least the lower neighbour minus max |f''| d^2 / 8. Units
    are the mean, which is positive, and the phase.
    """
    waves = [(k, c / mean, s / mean) for k, c, s in harmonics]
    # It bounds what a rounded phase does, too.
    size = 1.0 + sum(k * (abs(c) + abs(s)) for k, c, s in waves)
    bend = sum(k * k * (abs(c) + abs(s)) for k, c, s in waves)
    for n in (2**8, 2**11, 2**14, 2**17):
        phases = np.arange(n) * (2.0 * np.pi / n)
        swings = sum(c * np.cos(k * phases) + s * np.sin(k * phases) for k, c, s in waves)
        least = float(np.min(1.0 + swings))
        found = least - bend * (2.0 * np.pi / n) ** 2 / 8.0 - 2.0**-40 * size
        if found > 0.5 * least:
            return found * mean
    return 0.0


def of_product(first: Bounds, second: Bounds) -> Bounds:
    """Bound the product of two positive laws (Leibniz)."""
    grow = 1.0 + 2.0**-50  # outward by a few units in the last place
    return Bounds(
        first.lowest * second.lowest / grow,
        first.highest * second.highest * grow,
        (first.slope * second.highest + first.highest * second.slope) * grow,
        (
            first.curvature * second.highest
            + 2 * first.slope * second.slope
            + first.highest * second.curvature
        )
        * grow,
    )


def quotient_up(factor: float, number: float, *divisors: float) -> float:
    """Return factor number / product of divisors, all positive, rounded up."""
    if math.isinf(number):  # a leg from one end of the range of floats to the other
        return number
    quotient, exponent = math.frexp(number)
    for divisor in divisors:
        fraction, shift = math.frexp(divisor)
        quotient /= fraction
        exponent -= shift
    return round_up(factor * quotient, exponent)


def round_up(size: float, exponent: int) -> float:
    """Return at least size 2^exponent, where a few dozen roundings at most went into the size."""
    size *= 1 + 2.0**-45
    try:
        number = math.ldexp(size, exponent)
    except OverflowError:
        return math.inf
    return number if number >= LEAST_NORMAL or size == 0 else math.nextafter(number, math.inf)


def _slack(level: float, swing: float) -> float:
    return (abs(level) + swing) * 2.0**-50
