"""A scene's laws cut into pieces, on each of which a short polynomial is as good as the law itself.

Idea. On a half-leg between knots a bang-bang law is a parabola, exactly. A Fourier law differs from its
Taylor polynomial of degree D, for times up to V before and after the reference time, by at most
M(D + 1) V^(D + 1) / (D + 1)!, and its derivative by M(D + 1) V^D / D!, where M(j) = sum (k w)^j (|a_k| +
|b_k|) bounds the law's derivative of order j. V is so short that the first is below 2^-54 of the law's least
value (of a slope, which may be 0, below 2^-54 of M(1) / w), and the second below 2^-54 of M(1). A constant
is its own polynomial.

The period is cut at every knot and in the middle of every leg, and then into pieces of length V: a piece
serves flights that begin in its first half, and holds for all of it, so that flights up to V end in it. Where
a law changes by more than half of itself in a piece (a radius that comes down to 1/1000 of its mean), the
piece is halved again: else the rounding of the terms would be far more than that of their sum.
"""

import math
from fractions import Fraction
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from fast.kernel.arithmetic import HALF_PI, MAX_QUADRANT, SAFETY, split
from fast.kernel.lane_laws import NO_WAVES, ONE_WAVE, PARABOLA, SERIES, TWO_WAVES, fill_pieces
from fast.kernel.laws import IN_LANES

from fast.kernel.records import (  # isort: skip
    AMPLITUDES, BANG_BANG, BEND, CONSTANT, DEPTH, FASTEST, FOURIER, HIGHEST, KIND, KNOTS, LEVEL, LOWEST,
    N_HARMONICS, OMEGA, OMEGA_LOW, PERIOD, PERIOD_LOW, RADIUS, SHARED, SLOPE, WIDTH, Compiled,
    FloatArray, LaneWaves, LawLimits, LawsInLanes, Pieces,
)  # fmt: skip
from scene import Scene

SHALLOW = 0.25  # of its mean: see `waves_of`
MAX_PIECES = 2**15
LEAST_DEPTH = 2.0**-500  # where a bound says no more than that the depth is positive
REMAINDER = 2.0**-54
ALWAYS = np.array([math.inf])
# No piece serves: known neither when laws repeat nor up to when, so that steps are scalar ones.
NO_PIECES = Pieces(
    0.0, math.inf, 0.0, np.zeros(1), np.zeros((1, 2)), ALWAYS, ALWAYS, np.zeros((1, 4, 1)), -1.0
)
INSIDE = 1.0 - 2.0**-50  # of a piece: how far a flight ends from its middle is a sum that lanes round


class Cut(NamedTuple):
    """A piece to be: it begins to serve at `begin`, and holds for a length; both since the origin."""

    begin: Fraction
    serves: Fraction
    holds: Fraction


def laws_in_lanes(scene: Scene, compiled: Compiled) -> LawsInLanes:
    """Return a scene as the lanes know it.

    Args:
        scene: in the kernel's units.
        compiled: its numbers.
    """
    laws = compiled.laws
    is_known = bool(np.isin(laws[:SHARED, KIND], IN_LANES).all())
    waves = waves_of(compiled) if is_known else None
    form = PARABOLA
    if not is_known:
        pieces = NO_PIECES
    elif waves:
        form = TWO_WAVES if laws[SHARED, N_HARMONICS] > 1 else ONE_WAVE
        # Of waves the lanes know when they repeat, and up to when their phase is known.
        period = float(_period_and_origin(laws)[0]) if laws[SHARED, OMEGA] else math.inf
        pieces = NO_PIECES._replace(period=period, until=_until(laws, period))
    else:
        form = SERIES if (laws[:SHARED, KIND] == FOURIER).any() else PARABOLA
        pieces = pieces_of(scene, compiled, form) or NO_PIECES
    return LawsInLanes(
        compiled,
        limits_of(compiled),
        pieces,
        waves or NO_WAVES,
        form,
        is_waves=waves is not None,
        is_slope_moving=bool(laws[SLOPE, KIND] != CONSTANT),
        slope=float(laws[SLOPE, LEVEL]),
    )


def limits_of(scene: Compiled) -> LawLimits:
    """Return the limits of a scene's laws."""
    r, w, h, m = (scene.bounds[row] for row in (RADIUS, WIDTH, DEPTH, SLOPE))
    grow = 1.0 + SAFETY
    lean = 1.0 + max(abs(m[LOWEST]), abs(m[HIGHEST]))
    found = (
        grow * (r[HIGHEST] * r[BEND] + r[FASTEST] * r[FASTEST]),
        grow * max(w[BEND] + m[BEND] * h[HIGHEST], h[BEND]),
        2.0 * m[FASTEST],
        grow * max(r[FASTEST], w[FASTEST] + m[FASTEST] * h[HIGHEST], h[FASTEST]),
        grow * r[FASTEST],
        grow * (r[HIGHEST] + w[HIGHEST] + lean * h[HIGHEST]),
        grow * lean,
        grow * h[BEND] * w[HIGHEST] / max(h[LOWEST], LEAST_DEPTH),
    )
    return LawLimits(*map(float, found))


def waves_of(compiled: Compiled) -> LaneWaves | None:
    """Return a scene's laws as waves, or None where lanes take pieces instead.

    That is for knots, for more than two harmonics, which pieces serve sooner, and for a size that comes down
    to a quarter of its mean: rounding of its waves, which add up to the mean and more, would show in it.
    """
    laws, omegas = compiled.laws, compiled.laws[SHARED, [OMEGA, OMEGA_LOW]].tolist()
    sizes = [row for row in (RADIUS, WIDTH, DEPTH) if laws[row, KIND] == FOURIER]
    is_deep = any(least_of(compiled, row) < SHALLOW * laws[row, LEVEL] for row in sizes)
    if is_deep or (laws[:SHARED, KIND] == BANG_BANG).any() or laws[SHARED, N_HARMONICS] > 2:
        return None
    rows = np.zeros((4, 5))
    for row, law in zip(rows, laws[:SHARED], strict=True):
        row[0], n = law[LEVEL], int(law[N_HARMONICS]) if law[KIND] == FOURIER else 0
        for k in range(1, n + 1):
            row[2 * k - 1], row[2 * k] = law[AMPLITUDES + k], law[AMPLITUDES + n + k]
    return LaneWaves(*omegas, *(tuple(row.tolist()) for row in rows))


def _until(laws: FloatArray, period: float) -> float:
    """Return up to when lanes know the phases of laws of a period."""
    return 0.125 * MAX_QUADRANT * period / max(float(laws[SHARED, N_HARMONICS]), 1.0)


def reach(compiled: Compiled, degree: int) -> float:
    """Return V: how far from its reference time a polynomial holds [time]; infinite without a Fourier law.

    It is 0 where no more is known of a law's least value than that it is positive.
    """
    found = math.inf
    for row in (RADIUS, WIDTH, DEPTH, SLOPE):
        law = compiled.laws[row]
        if law[KIND] != FOURIER:
            continue
        n = int(law[N_HARMONICS])
        k = np.arange(1, n + 1)
        # In units of 1 / w, so that no power overflows.
        sizes = np.abs(law[AMPLITUDES + k]) + np.abs(law[AMPLITUDES + n + k])
        first, beyond = float(sizes @ k), float(sizes @ k.astype(float) ** (degree + 1))
        least = first if row == SLOPE else min(first, (degree + 1) * float(least_of(compiled, row)))
        found = min(
            found,
            (REMAINDER * first * math.factorial(degree) / beyond) ** (1.0 / degree) / law[OMEGA],
            (REMAINDER * least * math.factorial(degree) / beyond) ** (1.0 / (degree + 1)) / law[OMEGA],
        )
    return found


def least_of(compiled: Compiled, row: int | np.integer) -> float:
    """Return the least value of a law as it is given: of nu where the scene has nu."""
    bounds = compiled.bounds
    if row == WIDTH and compiled.is_relative:
        least_r = bounds[RADIUS, LOWEST]  # the bounds of a product are made of those of its factors
        return float(bounds[WIDTH, LOWEST] / least_r) if least_r > 0.0 else 0.0
    return float(bounds[row, LOWEST])


def pieces_of(scene: Scene, compiled: Compiled, degree: int) -> Pieces | None:
    """Return a scene's laws, one of which moves, as polynomials of a degree; None if it takes too many."""
    period, origin = _period_and_origin(compiled.laws)
    longest = reach(compiled, degree)
    if not longest > 0.0:
        return None
    knots = sorted(_knots(scene, period, origin))
    edges = [Fraction(0), *knots, period]
    cuts: list[Cut] = []
    for a, b in pairwise(edges):
        n = 1 if longest == math.inf else math.ceil((b - a) / Fraction(longest))
        if len(cuts) + n > MAX_PIECES:
            return None
        length = (b - a) / n
        for i in range(n):
            begin = a + i * length
            cuts.append(Cut(begin, length, min(2 * length, b - begin) if knots else 2 * length))
    return _refined(compiled, period, origin, cuts, degree)


def _refined(
    compiled: Compiled, period: Fraction, origin: Fraction, cuts: list[Cut], degree: int
) -> Pieces | None:
    """Halve pieces in which a law changes by more than half of itself."""
    while len(cuts) <= MAX_PIECES:
        pieces = _filled(compiled, period, origin, cuts, degree)
        powers = pieces.limits[:, None] ** np.arange(1, degree + 1)
        rows = [row for row in (RADIUS, WIDTH, DEPTH) if compiled.laws[row, KIND] != CONSTANT]
        own = pieces.coefficients[:, rows]
        change = (np.abs(own[:, :, 2:]) * powers[:, None, :]).sum(axis=2)
        is_wide = (change > 0.5 * own[:, :, 0]).any(axis=1)
        if not is_wide.any():
            return pieces
        cuts = [
            part
            for cut, wide in zip(cuts, is_wide, strict=True)
            for part in (_halves(cut) if wide else [cut])
        ]
    return None


def _halves(cut: Cut) -> list[Cut]:
    half = cut.serves / 2
    ends = cut.begin + cut.holds
    return [Cut(begin, half, min(2 * half, ends - begin)) for begin in (cut.begin, cut.begin + half)]


def _filled(compiled: Compiled, period: Fraction, origin: Fraction, cuts: list[Cut], degree: int) -> Pieces:
    middles = [origin + cut.begin + cut.holds / 2 for cut in cuts]
    references = np.array([split(middle) for middle in middles])
    coefficients = np.empty((len(cuts), 4, degree + 2))
    fill_pieces(compiled.laws, references, coefficients)
    begins = np.array([float(cut.begin) for cut in cuts])
    half = INSIDE * np.array([float(cut.holds / 2) for cut in cuts])
    serves = np.array([float(cut.serves - cut.holds / 2) for cut in cuts])
    high, low = split(period)
    until = _until(compiled.laws, high)
    return Pieces(float(origin), high, low, begins, references, half, serves, coefficients, until)


def _period_and_origin(laws: FloatArray) -> tuple[Fraction, Fraction]:
    """Return the period that all moving laws share, and when it begins."""
    for row in laws[:SHARED]:
        if row[KIND] == BANG_BANG:
            return Fraction(row[PERIOD]) + Fraction(row[PERIOD_LOW]), Fraction(row[KNOTS])
    omega = Fraction(laws[SHARED, OMEGA]) + Fraction(laws[SHARED, OMEGA_LOW])
    return 4 * HALF_PI / omega, Fraction(0)


def _knots(scene: Scene, period: Fraction, origin: Fraction) -> set[Fraction]:
    """Return the times since the origin, inside the period, of all knots and of the middles of legs."""
    moving = (law for law in scene.laws.values() if not law.is_constant)
    return {(t - origin) % period for law in moving for t in law.breakpoints()} - {Fraction(0)}
