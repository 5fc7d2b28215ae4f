"""Densities of s = log E1 / E0 and of capture time at any precision, the caustics included.

A particle captured at place x of a panel has s(x), so the density at a value is the sum of
|d p_cha / ds| over the places that reach it. Where ds / dt_in = 0 the density is infinite as
strength / sqrt(|s - s_c|) on one side of a caustic s_c. Distribution functions stay finite. Places are found
in the Chebyshev panels by Newton's method, between the turning points that `theory.branches` finds. Cycles
in which one particle is captured several times are refused here: their densities are convolutions, and
`theory.distribution` has their distribution function in binary64.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from scene.precision import reduce_record
from scene.tables import Scene
from theory.adiabatic import Captures, Placed
from theory.branches import turns
from theory.critical import solve_rising
from theory.precision import guarded, real_numbers
from theory.prediction import converged
from theory.prepared import NotCovered
from theory.volumes import delta_slope, free_share

REACH = 2.0**-12  # of a panel, around a turning point that is known in binary64


class Caustic(NamedTuple):
    """A turning point of s(t_in), where the density of s is infinite.

    t_in: capture time [time].
    s: log E1 / E0 there.
    strength: near s, at values s' that particles reach, the density is strength / sqrt(|s' - s|).
    is_largest: s is a local maximum.
    """

    t_in: Any
    s: Any
    strength: Any
    is_largest: bool

    def __reduce__(self) -> tuple[Any, ...]:
        """Tell pickle and copy how to keep every bit."""
        return reduce_record(self)


class ChebyshevSeries:
    """A Chebyshev series over [0, 1] in one number system."""

    def __init__(self, ctx: Any, coefficients: Any) -> None:
        self.ctx, self.coefficients = ctx, np.array(coefficients, dtype=object)

    def __call__(self, x: Any) -> Any:
        """Return the value at x."""
        return chebyshev.chebval(2 * x - 1, self.coefficients)

    def rate(self) -> ChebyshevSeries:
        """Return the derivative."""
        return ChebyshevSeries(self.ctx, chebyshev.chebder(self.coefficients, scl=2))

    def place(self, level: Any, low: Any, high: Any, guess: Any = None) -> Any:
        """Return where the series, monotone from low to high, has a value that it takes there."""
        sign, rate = (1 if self(low) < self(high) else -1), self.rate()
        return solve_rising(self.ctx, lambda x: (sign * (self(x) - level), sign * rate(x)), low, high, guess)


class _Panel:
    """One panel's s, A and times as series."""

    def __init__(self, found: Captures, placed: Placed) -> None:
        self.binary, grid = found.binary, placed.panel.grid

        def series(values: list[Any]) -> ChebyshevSeries:
            return ChebyshevSeries(self.binary, grid.coefficients(values))

        self.s, self.A, self.t_in = series(placed.s), series(placed.panel.A), series(placed.panel.t_in)
        self.A_rate, self.s_rate = series(placed.panel.rate), self.s.rate()
        self.s_bend = self.s_rate.rate()

    def turns(self) -> list[Any]:
        """Return 0, the turning points of s, and 1."""
        rough = turns(self.s.coefficients.astype(np.float64))
        found = [self.binary.zero]
        for place in rough[1:-1]:
            near = self.binary.mpf(float(place))
            low, high = max(near - REACH, self.binary.zero), min(near + REACH, self.binary.one)
            found.append(self.s_rate.place(0, low, high, near))
        return [*found, self.binary.one]

    def stretches(self) -> Iterator[tuple[Any, Any, Any, Any]]:
        """Yield monotone stretches: start, stop and s at each."""
        places = self.turns()
        for (a, s_a), (b, s_b) in pairwise(zip(places, map(self.s, places), strict=True)):
            yield a, b, s_a, s_b

    def flow(self, x: Any) -> Any:
        """Return the probability captured per unit of x."""
        return self.binary.exp(-self.A(x)) * self.A_rate(x)


def _panels(found: Captures) -> list[_Panel]:
    if found.root.children:
        raise NotCovered("densities are of cycles in which a particle is captured at most once")
    size = max((abs(s) for placed in found.placed for s in placed.s), default=1)
    if size < _resolution(found):
        raise NotCovered("densities are of cycles in which energies change")
    return [_Panel(found, placed) for placed in found.placed]


def _resolution(found: Captures) -> Any:
    """Return what s, resolved to so many decimals, may change by where it is constant."""
    return found.binary.mpf(10) ** -found.target


def _taken(found: Captures, field: str, values: Sequence[Any]) -> list[Any]:
    return [found.binary.taken(value) for value in real_numbers(found.cycle.ctx, field, values)]


@guarded
def density_at(scene: Scene, s: Sequence[Any], digits: int = 15) -> tuple[Any, ...]:
    """Return the density of log E1 / E0 of the captured particles at each s.

    Point masses do not count. Particles never captured form a point mass. Particles captured while s(t_in) is
    constant form another one, for example if a loop retraces itself.

    Args:
        scene: a valid mushroom in which a particle is captured at most once per cycle.
        s: floats, mpf or decimal strings.
        digits: correct significant digits wanted.

    Raises:
        NotCovered: not a mushroom, or several captures of one particle.
        NotConverged: the digits were not reached, as within rounding of a caustic.

    Source: Eq:lnE/E0 with Eq:ps.
    """

    def figures(found: Captures) -> tuple[Any, ...]:
        stretches = [(panel, row) for panel in _panels(found) for row in panel.stretches()]
        resolution = _resolution(found)

        def density(level: Any) -> Any:
            total = found.binary.zero
            for panel, (a, b, s_a, s_b) in stretches:
                # A level within rounding of an end is taken to lie beside it: the density jumps there.
                if min(s_a, s_b) + resolution < level < max(s_a, s_b) - resolution:
                    x = panel.s.place(level, a, b)
                    total += panel.flow(x) / abs(panel.s_rate(x))
            return total

        return tuple(density(level) for level in _taken(found, "s", s))

    return converged(scene, digits, figures)


@guarded
def cdf_at(scene: Scene, s: Sequence[Any], digits: int = 15) -> tuple[Any, ...]:
    """Return the probability of log E1 / E0 <= each s, with the particles never captured.

    Args:
        scene: as for `density_at`.
        s: floats, mpf or decimal strings.
        digits: correct significant digits wanted.

    Raises:
        As `density_at`.

    Source: Eq:lnE/E0 with Eq:ps.
    """

    def figures(found: Captures) -> tuple[Any, ...]:
        binary = found.binary
        stretches = [(panel, row) for panel in _panels(found) for row in panel.stretches()]
        resolution = _resolution(found)

        def probability(level: Any) -> Any:
            total = found.p_not_captured if found.root.s_nc - resolution <= level else binary.zero
            for panel, (a, b, s_a, s_b) in stretches:
                is_point_mass = abs(s_a - s_b) <= resolution
                if level < min(s_a, s_b) - (resolution if is_point_mass else 0):
                    continue
                start, stop = a, b
                if level < max(s_a, s_b) and not is_point_mass:
                    x = panel.s.place(level, a, b)
                    start, stop = (a, x) if s_a < s_b else (x, b)
                total += binary.exp(-panel.A(start)) - binary.exp(-panel.A(stop))
            return total

        return tuple(probability(level) for level in _taken(found, "s", s))

    return converged(scene, digits, figures)


@guarded
def caustics(scene: Scene, digits: int = 15) -> list[Caustic]:
    """Return the caustics of the density of s in order of capture time.

    Args:
        scene: as for `density_at`.
        digits: correct significant digits wanted.

    Raises:
        As `density_at`.
    """

    def figures(found: Captures) -> tuple[Any, ...]:
        rows = []
        for panel in _panels(found):
            for x in panel.turns()[1:-1]:
                bend = panel.s_bend(x)
                strength = panel.flow(x) * found.binary.sqrt(2 / abs(bend))
                rows += [panel.t_in(x), panel.s(x), strength, found.binary.one * found.binary.sign(bend)]
        return tuple(rows)

    flat = converged(scene, digits, figures)
    rows = [flat[i : i + 4] for i in range(0, len(flat), 4)]
    return [Caustic(t_in, s, strength, bool(bend < 0)) for t_in, s, strength, bend in rows]


@guarded
def capture_rate_at(scene: Scene, t: Sequence[Any], digits: int = 15) -> tuple[Any, ...]:
    """Return the density of capture times at each t [1/time]; 0 where nothing is captured.

    Args:
        scene: a valid mushroom.
        t: times as floats, mpf or decimal strings. Whole periods are subtracted.
        digits: correct significant digits wanted.

    Raises:
        NotCovered: not a mushroom.
        NotConverged: the digits were not reached.

    Source: Eq:dps/ps.
    """

    def figures(found: Captures) -> tuple[Any, ...]:
        return tuple(_rate(found, time) for time in real_numbers(found.cycle.ctx, "t", t))

    return converged(scene, digits, figures)


def _rate(found: Captures, time: Any) -> Any:
    ctx, binary = found.cycle.ctx, found.binary
    piece, within = found.cycle.capture_at(time)
    if piece is None:
        return binary.zero
    nu, rate = piece.capture.motion.nu(within)
    t = binary.taken(within)
    stem = piece.capture.motion.stem_share(t, binary.taken(nu))
    flux = delta_slope(ctx, nu) * rate / (free_share(ctx, nu) + binary.given(stem))
    panel = next(_Panel(found, p) for p in found.placed if p.panel.t_in[0] <= t <= p.panel.t_in[-1])
    spent = panel.A(panel.t_in.place(t, binary.zero, binary.one))
    return binary.exp(-spent) * binary.taken(flux)
