"""Curves and histogram masses of the theory in binary64, to be laid over simulations.

They come from the Chebyshev panels of a 15-digit solution, so a curve is right to about 1e-14
at any sampling, and masses per bin are differences of exact distribution functions: caustics of
the implicit density (where s turns) need no care. Times run from the cycle's start, where nu
begins to fall, not from t = 0.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from mpmath import fp
from numpy.typing import ArrayLike

from scene.refusal import BadInput, check_count
from scene.tables import Scene
from theory.branches import DIGITS, Branch, Floats, X, at, tree, turns
from theory.cycle import Cycle
from theory.distribution import energies
from theory.precision import finite_array, guarded
from theory.volumes import in_near_units, volumes_at

MAX_POINTS = 10_000_000


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


def energy_density(scene: Scene, edges: ArrayLike) -> Floats:
    """Return the probability of being captured and ending with log E1 / E0 in each bin.

    Args:
        scene: as for `theory.predict`.
        edges: bin edges, rising, at least two; a histogram's.

    Returns:
        Probabilities, one per bin. Over all s they add up to 1 - p_nc: particles never captured do
        not count.

    Raises:
        BadInput: edges do not rise.
        NotCovered, NotConverged: as `theory.predict`.

    Source: Eq:lnE/E0 with Eq:ps.
    """
    bounds = _rising(edges)
    return np.diff(energies(scene).captured_below(bounds))


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
    bounds = _rising(edges)
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
    cycle = Cycle.of(scene, DIGITS)
    start = float(cycle.start)
    n_before = np.zeros_like(t)
    if cycle.period is not None:
        n_before = np.floor((t - start) / float(cycle.period))
        t = t - n_before * float(cycle.period)
    near, _, unit = in_near_units(scene)
    then = volumes_at(fp, near, math.ldexp(start, -unit)).v_cha
    log_energy = -np.log(volumes_at(np, near, np.ldexp(t, -unit)).v_cha / then)
    root = tree(scene)
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


def _rising(edges: ArrayLike) -> Floats:
    bounds = finite_array("edges", edges, n_dimensions=1)
    if bounds.size < 2 or not np.all(np.diff(bounds) > 0):
        raise BadInput("edges must be at least two rising numbers")
    return bounds
