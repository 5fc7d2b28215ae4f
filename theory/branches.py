"""A solution in binary64: its panels as functions of place, inverted in whole arrays, and their curves.

A panel's functions are Chebyshev series in x on [0, 1] from a 15-digit solution, right to about 1e-14. But
s may be far smaller than what it is a difference of: it is subtracted before it is rounded, and errs by
UNRESOLVED and by rounding of its own size. Where s(x) turns, the panel is cut into monotone stretches; the
turns are searched among FINE samples. The place at which s reaches a level is then found by bisection, so
the probability below a level is exact to rounding. Near a caustic an error e in the level becomes sqrt(e)
in the probability; no method avoids this. Two turns nearer to each other than 1 / FINE of a panel are not
told apart; s varies by about FINE^-3 between them.

Curves and histogram masses are to be laid over simulations. A curve is right to about 1e-14 at any sampling,
and masses per bin are differences of exact distribution functions: caustics of the implicit density (where s
turns) need no care. Times run from the cycle's start, where nu begins to fall, not from t = 0.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from mpmath import fp
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike, NDArray

from scene.refusal import BadInput, check_count
from scene.tables import Scene
from theory.adiabatic import Captures, Placed, SolvedWell
from theory.cycle import cycle_of
from theory.precision import finite_array, guarded
from theory.prediction import resolutions
from theory.prepared import PreparedMushroom, prepare
from theory.volumes import volumes_of

Floats = NDArray[np.float64]

DIGITS = 15
UNRESOLVED = 1e-18  # what differs by less is not told from nothing by them
FINE = 2048  # samples of a panel; linear interpolation between them errs by FINE^-2, 2e-7
X = np.linspace(0.0, 1.0, FINE + 1)
BISECTIONS = 52
MAX_POINTS = 10_000_000


class Branch(NamedTuple):
    """One panel.

    coefficients: Chebyshev series in 2 x - 1 of nu, t_in, t_out, A, B, log g, shape (6, n).
    ends: their values at x = 0 and 1, shape (6, 2).
    s: the same of log E1 / E0 of a particle captured here and nowhere else (Eq:lnE/E0), shape (n,).
    s_before, absorbed, s_below: as in `theory.adiabatic.Placed`.
    """

    coefficients: Floats
    ends: Floats
    s: Floats
    s_before: float
    absorbed: float
    s_below: float

    def evaluate(self, x: Floats) -> Floats:
        """Return nu, t_in, t_out, A, B, log g at x in [0, 1], exact at the ends; shape (6, len(x))."""
        values: Floats = np.asarray(chebyshev.chebval(2 * x - 1, self.coefficients.T), dtype=np.float64)
        for end in (0, 1):
            values[:, x == end] = self.ends[:, [end]]
        return values

    def chaotic(self, x: Floats) -> Floats:
        """Return the probability of being in the chaotic zone at x (Eq:ps)."""
        p: Floats = np.exp(-self.evaluate(x)[3])
        return p

    def below(self, series: Floats, levels: Floats, resolution: float = 0.0) -> Floats:
        """Return the probability of being captured here with the series' value <= each level.

        Args:
            series: of the branch.
            levels: (n,) any values.
            resolution: where the series changes by no more it is constant, and all captured have one value:
                what it seems to do there is rounding. They are counted from `resolution` below that value on.
        """
        total = np.zeros_like(levels)
        bounds = turns(series)
        p = self.chaotic(bounds)
        values = at(series, bounds)
        for i in range(len(bounds) - 1):
            if abs(values[i + 1] - values[i]) <= resolution:
                total += np.where(levels >= values[i : i + 2].min() - resolution, p[i] - p[i + 1], 0.0)
                continue
            is_rising = values[i + 1] > values[i]
            u = crossing(series, bounds[i], bounds[i + 1], levels)
            # A level that is met at no inner point has an end for its place; p at the ends is known already.
            here = np.where(u == bounds[i], p[i], np.where(u == bounds[i + 1], p[i + 1], self.chaotic(u)))
            total += p[i] - here if is_rising else here - p[i + 1]
        return total


def at(series: Floats, x: Floats) -> Floats:
    """Evaluate a Chebyshev series in 2 x - 1."""
    return np.asarray(chebyshev.chebval(2 * x - 1, series), dtype=np.float64)


def noise(series: Floats) -> float:
    """Return what a series of s may change by where it is constant, by rounding."""
    return float(max(64 * np.finfo(float).eps * np.max(np.abs(series)), UNRESOLVED))


def turns(series: Floats) -> Floats:
    """Return 0, the places in (0, 1) at which the series, given by its coefficients, turns, and 1."""
    values = at(series, X)
    slopes = np.where(np.abs(np.diff(values)) > noise(series), np.sign(np.diff(values)), 0)
    places = np.flatnonzero(slopes)
    rate = chebyshev.chebder(series)
    found = [0.0]
    for i, j in pairwise(places):
        if slopes[i] != slopes[j]:
            place = crossing(-slopes[i] * rate, X[i], X[j + 1], np.zeros(1))
            found.append(float(place[0]))
    return np.array([*found, 1.0])


def crossing(series: Floats, start: float, stop: float, levels: Floats) -> Floats:
    """Return where a series, monotone from start to stop, meets each level; the nearer end when nowhere."""
    first, last = at(series, np.array([start, stop]))
    sign = 1.0 if last > first else -1.0
    u = np.where(sign * (levels - first) <= 0, start, stop)
    inner = (sign * (levels - first) > 0) & (sign * (last - levels) > 0)
    low, high = np.full(inner.sum(), start), np.full(inner.sum(), stop)
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        is_below = sign * (at(series, middle) - levels[inner]) < 0
        low, high = np.where(is_below, middle, low), np.where(is_below, high, middle)
    u[inner] = (low + high) / 2
    return u


class Node(NamedTuple):
    """A well as numbers: its captured particles as weighted points, and what passing it uncaptured does.

    captured: on the well's own panels: weights, and s from its top.
    branches: the same particles as functions of place.
    p_top: probability of being in the chaotic zone at its top.
    passed, gain: probability of not being captured on its own panels, and the gain in log E of that.
    s_nc: gain in log E of passing the whole well uncaptured (Eq:lnEnc/E0), summed before it is rounded: of
        gains that cancel no rounding is left.
    """

    captured: tuple[tuple[float, float], ...]
    branches: tuple[Branch, ...]
    children: tuple[Node, ...]
    p_top: float
    passed: float
    gain: float
    s_nc: float

    def all_branches(self) -> Iterator[Branch]:
        """Yield all panels, a well's own before its children's."""
        yield from self.branches
        for child in self.children:
            yield from child.all_branches()

    @property
    def p_nc(self) -> float:
        """Probability of passing the whole well uncaptured (Eq:ps)."""
        return self.passed * float(np.prod([child.p_nc for child in self.children]))


class SolvedCycle(NamedTuple):
    """A cycle in binary64: the tree of its wells, when it starts, its period or 0 [time]."""

    root: Node
    start: float
    period: float


def tree(scene: Scene) -> Node:
    """Solve a cycle to 15 digits and bring it to binary64.

    Raises:
        NotCovered, NotConverged: as `theory.predict`.
    """
    return solve_cycle(prepare(scene)).root


@guarded
def solve_cycle(mushroom: PreparedMushroom) -> SolvedCycle:
    """Solve a cycle as `tree` does, or find it as it was solved before."""
    return _solved(mushroom)


@lru_cache(maxsize=32)
def _solved(mushroom: PreparedMushroom) -> SolvedCycle:
    # Every curve and histogram of a scene asks for its tree again. Its arrays are shared, hence read only.
    cycle = cycle_of(mushroom, DIGITS)
    found = next(resolutions(mushroom, cycle))
    with found.binary.working():
        root = _node(found, found.root, map(_branch, found.placed))
    return SolvedCycle(root, float(cycle.start), float(cycle.period or 0.0))


def _branch(placed: Placed) -> Branch:
    p = placed.panel
    functions = (p.nu, p.t_in, p.t_out, p.A, p.B, p.log_g)
    coefficients = [[float(c) for c in p.grid.coefficients(values)] for values in functions]
    ends = [[float(values[0]), float(values[-1])] for values in functions]
    s = _kept([float(c) for c in p.grid.coefficients(placed.s)])
    return Branch(_kept(coefficients), _kept(ends), s, *(float(x) for x in placed[2:]))


def _kept(numbers: list[float] | list[list[float]]) -> Floats:
    array = np.array(numbers)
    array.setflags(write=False)
    return array


def _node(found: Captures, well: SolvedWell, branches: Iterator[Branch]) -> Node:
    own = tuple(next(branches) for _ in well.panels)
    return Node(
        tuple((float(w), float(s)) for w, s in well.captured),
        own,
        tuple(_node(found, child, branches) for child in well.children),
        float(found.binary.exp(-well.A_top)),
        float(well.passed),
        float(well.gain),
        float(well.s_nc),
    )


class CaptureCurve(NamedTuple):
    """Captured particles in order of capture, float64 arrays of one length.

    nu: the mouth at capture and release.
    t_in: capture time [time].
    t_out: release time [time].
    p_cha: probability of being still in the chaotic zone at t_in (Eq:ps).
    log_g: log of the compression factor (Eq:g).
    s: log E1 / E0 after the cycle, for a particle captured then and at no other time (Eq:lnE/E0).
    """

    nu: Floats
    t_in: Floats
    t_out: Floats
    p_cha: Floats
    log_g: Floats
    s: Floats


def capture_curve(scene: Scene, n: int = 400) -> CaptureCurve:
    """Sample the captured particles of one cycle at n points, both ends included.

    Args:
        scene: as for `theory.predict`.
        n: number of points, 2 to 10 million.

    Returns:
        Arrays of length n. They are empty if nothing is captured.

    Raises:
        BadInput: n out of bounds.
        NotCovered, NotConverged: as `theory.predict`.

    Source: Eq:ps, Eq:g, Eq:lnE/E0.
    """
    n = check_count("n", n, 2, MAX_POINTS)
    branches = sorted(tree(scene).all_branches(), key=lambda branch: float(branch.ends[1, 0]))
    place = np.linspace(0.0, len(branches), n)
    index = np.minimum(place.astype(int), len(branches) - 1)
    parts = [_curve(branch, place[index == i] - i) for i, branch in enumerate(branches)]
    if not parts:
        return CaptureCurve(*(np.empty(0) for _ in CaptureCurve._fields))
    return CaptureCurve(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def _curve(branch: Branch, x: Floats) -> CaptureCurve:
    nu, t_in, t_out, A, _, log_g = branch.evaluate(x)
    return CaptureCurve(nu, t_in, t_out, np.exp(-A), log_g, at(branch.s, x))


def largest_gain(scene: Scene) -> tuple[float, float] | None:
    """Return (t_in, s) with the largest s of particles captured once, or None if nothing is captured.

    Args:
        scene: as for `theory.predict`.

    Source: Fig:protocol, right, and the right mode of Fig:E1/E0.
    """
    curves = [_curve(branch, turns(branch.s)) for branch in tree(scene).all_branches()]
    points = [(float(s), float(t)) for curve in curves for s, t in zip(curve.s, curve.t_in, strict=True)]
    if not points:
        return None
    s, t_in = max(points, key=lambda point: point[0])
    return t_in, s


def capture_time_mass(scene: Scene, edges: ArrayLike) -> Floats:
    """Return the mean number of captures per particle within each bin of time.

    If nu falls in only one interval of the cycle, this is the probability of a capture in the bin.

    Args:
        scene: as for `theory.predict`.
        edges: bin edges [time], rising, in the time of the cycle (from `Cycle.start` on).

    Returns:
        Numbers of captures, one per bin.

    Raises:
        BadInput: edges do not rise.
        NotCovered, NotConverged: as `theory.predict`.

    Source: Eq:ps.
    """
    bounds = rising_edges(edges)
    captured = (branch.below(branch.coefficients[1], bounds) for branch in tree(scene).all_branches())
    return np.diff(sum(captured, np.zeros_like(bounds)))


class ChaoticZone(NamedTuple):
    """The chaotic zone through the cycle, float64 arrays of one length.

    log_energy: log E / E0 of a particle that has not been captured, E0 at the cycle's start (Eq:dE).
    p_cha: share of the particles that are in the chaotic zone (Eq:ps).
    """

    log_energy: Floats
    p_cha: Floats


@guarded
def chaotic_zone(scene: Scene, times: ArrayLike) -> ChaoticZone:
    """Follow the chaotic zone's energy and population through the cycle, right to about 2e-7.

    Args:
        scene: as for `theory.predict`.
        times: shape (n,) [time]. Beyond the cycle, p_cha repeats. log_energy grows by log_e_nc per period,
            for a particle that is not captured in the further cycles either.

    Returns:
        Arrays of length n.

    Source: Eq:dE integrated, Eq:ps.
    """
    t = finite_array("times", times, n_dimensions=1)
    return zone_of(prepare(scene), t)


def zone_of(mushroom: PreparedMushroom, t: Floats) -> ChaoticZone:
    """Return the `chaotic_zone` of a mushroom that is prepared, at times (n,)."""
    root, start, period = solve_cycle(mushroom)
    n_before = np.zeros_like(t)
    if not math.isfinite(period):
        raise BadInput("the scene's period is beyond binary64: give its laws other units")
    if period:
        n_before = np.floor((t - start) / period)
        t = t - n_before * period
    near, _, unit = mushroom.near
    then = volumes_of(fp, near, math.ldexp(start, -unit)).v_cha
    log_energy = -np.log(volumes_of(np, near, np.ldexp(t, -unit)).v_cha / then)
    branches = tuple(root.all_branches())
    if not branches:
        return ChaoticZone(log_energy, np.ones_like(t))
    known = []  # time, gain in the chaotic zone's log E but for its volume, A
    for branch in branches:
        _, t_in, t_out, A, B, _ = branch.evaluate(X)
        known += [(t_in, branch.s_before - A, A), (t_out, branch.s_before + branch.s_below - B, A)]
    rows: Floats = np.concatenate([np.array(row) for row in known], axis=1)
    knots, gain, spent = rows[:, np.argsort(rows[0], kind="stable")]
    log_energy += n_before * root.s_nc + np.interp(t, knots, gain)
    return ChaoticZone(log_energy, np.exp(-np.interp(t, knots, spent)))


def rising_edges(edges: ArrayLike) -> Floats:
    """Return the edges of a histogram's bins as an array.

    Raises:
        BadInput: they are not at least two rising numbers.
    """
    bounds = finite_array("edges", edges, n_dimensions=1)
    if bounds.size < 2 or not np.all(np.diff(bounds) > 0):
        raise BadInput("edges must be at least two rising numbers")
    return bounds
