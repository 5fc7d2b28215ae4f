"""The panels of a solution in binary64: functions of place along each panel, inverted in whole arrays.

A panel's functions are Chebyshev series in x on [0, 1] from a 15-digit solution, right to about 1e-14. But
s may be far smaller than what it is a difference of: it is subtracted before it is rounded, and errs by
UNRESOLVED and by rounding of its own size. Where s(x) turns, the panel is cut into monotone stretches; the
turns are searched among FINE samples. The place at which s reaches a level is then found by bisection, so
the probability below a level is exact to rounding. Near a caustic an error e in the level becomes sqrt(e)
in the probability; no method avoids this. Two turns nearer to each other than 1 / FINE of a panel are not
told apart; s varies by about FINE^-3 between them.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from scene.tables import Scene, check_scene
from theory.adiabatic import Captures, SolvedWell
from theory.cycle import Cycle
from theory.precision import guarded
from theory.prediction import resolutions

Floats = NDArray[np.float64]

DIGITS = 15
UNRESOLVED = 1e-18  # what differs by less is not told from nothing by them
FINE = 2048  # samples of a panel; linear interpolation between them errs by FINE^-2, 2e-7
X = np.linspace(0.0, 1.0, FINE + 1)
BISECTIONS = 52


class Branch(NamedTuple):
    """One panel.

    coefficients: Chebyshev series in 2 x - 1 of nu, t_in, t_out, A, B, log g, shape (6, n).
    ends: their values at x = 0 and 1, shape (6, 2).
    s: the same of log E1 / E0 of a particle captured here and nowhere else (Eq:lnE/E0), shape (n,).
    s_before, s_after, absorbed, s_below: as in `theory.adiabatic.Placed`.
    """

    coefficients: Floats
    ends: Floats
    s: Floats
    s_before: float
    s_after: float
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

    weights, s: captured on the well's own panels, from its top.
    branches: the same particles as functions of place.
    p_top: probability of being in the chaotic zone at its top.
    passed, gain: probability of not being captured on its own panels, and the gain in log E of that.
    s_nc: gain in log E of passing the whole well uncaptured (Eq:lnEnc/E0), summed before it is rounded: of
        gains that cancel no rounding is left.
    """

    weights: Floats
    s: Floats
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


@guarded
def tree(scene: Scene) -> Node:
    """Solve a cycle to 15 digits and bring it to binary64.

    Raises:
        NotCovered, NotConverged: as `theory.predict`.
    """
    check_scene(scene)
    return _solved(scene)


@lru_cache(maxsize=32)
def _solved(scene: Scene) -> Node:
    # Every curve and histogram of a scene asks for its tree again. Its arrays are shared, hence read only.
    found = next(resolutions(scene, Cycle.of(scene, DIGITS)))
    with found.binary.working():
        return _node(found, found.root, iter([_branch(found, k) for k in range(len(found.placed))]))


def _branch(found: Captures, k: int) -> Branch:
    placed = found.placed[k]
    p = placed.panel
    functions = (p.nu, p.t_in, p.t_out, p.A, p.B, p.log_g)
    coefficients = [[float(c) for c in p.grid.coefficients(values)] for values in functions]
    ends = [[float(values[0]), float(values[-1])] for values in functions]
    s = _kept([float(c) for c in p.grid.coefficients(placed.s)])
    return Branch(_kept(coefficients), _kept(ends), s, *(float(x) for x in placed[1:]))


def _kept(numbers: list[float] | list[list[float]]) -> Floats:
    array = np.array(numbers)
    array.setflags(write=False)
    return array


def _node(found: Captures, well: SolvedWell, branches: Iterator[Branch]) -> Node:
    own = tuple(next(branches) for _ in well.panels)
    points = [[float(w), float(s)] for w, s in found.captured(well)]
    weights, s = _kept(points).T if points else (np.empty(0), np.empty(0))
    spent, exp = well.A_end - well.A_top, found.binary.exp
    return Node(
        weights,
        s,
        own,
        tuple(_node(found, child, branches) for child in well.children),
        float(exp(-well.A_top)),
        float(exp(-spent)),
        float(well.B_end - well.B_top - spent),
        float(well.s_nc),
    )
