"""Where in a cycle the mouth narrows.

The local minima of nu = w / r, by algebra on each analytic piece.

Idea. The sign of nu' is that of N = w' r - w r'. Time is cut where a law is not analytic and, where
a Fourier law moves, into parts of half a wavelength. Between cuts N is interpolated by a Chebyshev
series that rounding alone limits, and its zeros are eigenvalues, polished by Newton's method.
Between neighbours among all cuts and zeros nu is monotone, so its values there show every rise and
fall: a zero too many (of a flat inflection, or by rounding) does no harm, and none that matters is
missed.

A swing of nu below SWING of its largest value is rounding, and counts as none: the two minima
beside so low a peak are one, and a nu that never swings more has no minimum at all. A plateau
counts once, by its middle.
"""

from collections.abc import Callable
from fractions import Fraction
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from numpy.polynomial import chebyshev

from scene.laws import Constant, Law, first_origin
from scene.tables import Mushroom, Scene

FloatArray = npt.NDArray[np.float64]
# Returns a law, its first and its second derivative by the phase, shape (3, ...), at phases given.
Motion = Callable[[FloatArray], FloatArray]

SWING = 2.0**-44  # a few hundred roundings, as sums of sixteen harmonics gather them
# Over half a wavelength the series of cos and sin, times a quadratic, is below 2^-53 from there.
DEGREE = 24
NODES = np.cos(np.pi * (np.arange(DEGREE + 1) + 0.5) / (DEGREE + 1))
TO_SERIES = np.linalg.inv(chebyshev.chebvander(NODES, DEGREE)).T


def start_time(scene: Scene) -> float:
    """Return when the cycle begins [time]: at the first knot of a law that has knots, else at 0."""
    return first_origin(scene.laws.values())


def one_cycle(scene: Scene) -> float:
    """Return how long a cycle takes [time]: the period of the laws, 1 for a static scene."""
    return scene.period or 1.0


def mouth_factors(scene: Mushroom) -> tuple[Law, Law]:
    """Return two laws whose quotient is nu."""
    if "nu" in scene.laws:
        return scene.laws["nu"], Constant(1.0)
    return scene.laws["w"], scene.laws["r"]


@lru_cache(maxsize=256)
def mouth_minima(scene: Scene) -> tuple[float, ...]:
    """Find every local minimum of nu in one cycle.

    Args:
        scene: a valid scene; only a mushroom has a mouth.

    Returns:
        Phases (fractions of the cycle, rising, in (0, 1]) at which nu has a local minimum; one at
        the instant that ends a cycle and begins the next belongs to the one that it ends. None for
        a nu that is constant.

    Source: sec. 3.2, capture while nu falls, release when it has risen.
    """
    if not isinstance(scene, Mushroom):
        return ()
    width, radius = mouth_factors(scene)
    if width.is_constant and radius.is_constant:
        return ()
    start = start_time(scene)
    span = scene.period
    w, r = (_motion(law, start, span) for law in (width, radius))
    cuts = _cuts(start, span, (width, radius))
    # Legs too short for their squares give nan: their zeros drop out, their ends among the cuts
    # stay.
    with np.errstate(all="ignore"):
        zeros = _zeros(w, r, cuts)
        phases = np.unique(np.concatenate([cuts[:-1], zeros[(zeros >= 0.0) & (zeros < 1.0)]]))
        return tuple(sorted(_in_cycle(phase) for phase in _minima(w, r, phases)))


def _in_cycle(phase: float) -> float:
    """Return a phase in (0, 1]; one within rounding of the cycle's ends is its last instant."""
    phase %= 1.0
    return 1.0 if min(phase, 1.0 - phase) < 2.0**-40 else phase


def _motion(law: Law, start: float, span: float) -> Motion:
    """Return a law's motion over a cycle, divided by its highest value.

    Only the ratios of nu matter.
    """
    highest = law.bounds().highest

    def motion(u: FloatArray) -> FloatArray:
        return np.stack(
            [law.values(start + span * u, order) / highest * span**order for order in range(3)]
        )

    return motion


def _cuts(start: float, span: float, factors: tuple[Law, Law]) -> FloatArray:
    """Return phases between which N is analytic and its waves make half a turn at most."""
    waves = [law.harmonics() for law in factors if law.harmonics()]
    parts = 2 * sum(harmonics[-1][0] for harmonics in waves)
    knots = [float(t - Fraction(start)) / span for law in factors for t in law.breakpoints()]
    return np.unique(
        np.concatenate([np.linspace(0.0, 1.0, max(parts, 1) + 1), np.array(knots) % 1.0])
    )


def _slope(w: FloatArray, r: FloatArray) -> FloatArray:
    """Return N = w' r - w r' and its derivative, shape (2, ...)."""
    return np.stack([w[1] * r[0] - w[0] * r[1], w[2] * r[0] - w[0] * r[2]])


def _zeros(w: Motion, r: Motion, cuts: FloatArray) -> FloatArray:
    """Return N's zeros, by Chebyshev series between neighbouring cuts."""
    middle = 0.5 * (cuts[1:] + cuts[:-1])
    half = 0.5 * np.diff(cuts)
    places = middle[:, None] + half[:, None] * NODES
    series = _slope(w(places), r(places))[0] @ TO_SERIES
    sizes = np.abs(series)
    may_vanish = (sizes[:, 0] <= sizes[:, 1:].sum(axis=1)) & np.isfinite(sizes).all(axis=1)
    found = [np.empty(0)]
    for k in np.flatnonzero(may_vanish):
        kept = np.flatnonzero(sizes[k] > 2.0**-52 * sizes[k].max())
        if len(kept) and kept[-1] > 0:
            zeros = chebyshev.chebroots(series[k, : kept[-1] + 1]).real
            found.append(middle[k] + half[k] * zeros[np.abs(zeros) <= 1.0 + 2.0**-20])
    phases = np.concatenate(found)
    for _ in range(3):
        slope, rate = _slope(w(phases), r(phases))
        step = np.divide(slope, rate, out=np.zeros_like(slope), where=rate != 0.0)
        phases = np.where(np.abs(step) < 2.0**-20, phases - step, phases)
    return phases


def _minima(w: Motion, r: Motion, phases: FloatArray) -> list[float]:
    """Return where nu is least in each of its valleys.

    It is monotone between neighbours among `phases`.
    """
    at_w = w(phases)
    at_r = r(phases)
    nu = at_w[0] / at_r[0]
    slope = np.abs(_slope(at_w, at_r)[0])
    top = int(np.argmax(nu))
    small = SWING * nu[top]
    # Once round from the highest place to itself.
    order = np.append(np.arange(top, top + len(nu)), top) % len(nu)
    u = np.append(phases[order[:-1]] + (order[:-1] < top), phases[top] + 1.0)
    found: list[float] = []
    is_falling = True
    extreme = nu[top]
    begin = 0
    for k, level in enumerate(nu[order]):
        if is_falling:
            extreme = min(extreme, level)
            if level > extreme + small:
                low = [i for i in range(begin, k) if nu[order[i]] <= extreme + small]
                found.append(_lowest(w, r, u[low], slope[order[low]]))
                is_falling = False
                extreme = level
        else:
            extreme = max(extreme, level)
            if level < extreme - small:
                is_falling = True
                extreme = level
                begin = k
    return found


def _lowest(w: Motion, r: Motion, u: FloatArray, slope: FloatArray) -> float:
    """Return the middle of a plateau; else, of equal places, that of least slope."""
    middle = np.array([0.5 * (u[0] + u[-1])])
    at_w = w(middle % 1.0)
    at_r = r(middle % 1.0)
    terms = np.abs(at_w[1] * at_r[0]) + np.abs(at_w[0] * at_r[1])
    is_plateau = np.abs(_slope(at_w, at_r)[0]) <= SWING * terms
    return float(middle[0]) if is_plateau else float(u[np.argmin(slope)])
