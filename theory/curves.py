"""Curves and histogram masses of the theory in binary64, to be laid over simulations.

They come from the Chebyshev panels of a 15-digit solution, so a curve is right to about 1e-14
at any sampling. Masses per bin are differences of p_cha along a fine curve, taken where s
or t_in crosses the bins' edges: caustics of the implicit density (where s turns) integrate
without care. Times run from the cycle's start, where nu begins to fall, not from t = 0.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from mpmath import fp
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike, NDArray

from scene.refusal import BadInput
from scene.tables import Scene
from theory.adiabatic import captures
from theory.cycle import Cycle
from theory.volumes import volumes_at

Floats = NDArray[np.float64]

DIGITS = 15
FINE = 2048  # intervals of a panel's fine curve: masses are right to about its inverse square, 2e-7


class CaptureCurve(NamedTuple):
    """Captured particles in order of capture, float64 arrays of one length.

    nu: the mouth at capture and release.
    t_in: capture time [time].
    t_out: release time [time].
    p_cha: probability of being still in the chaotic zone at t_in (Eq:ps).
    log_g: log of the compression factor (Eq:g).
    s: log E1 / E0 after the cycle (Eq:lnE/E0).
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
        n: number of points, >= 2.

    Returns:
        Arrays of length n; of length 0 when nothing is captured.

    Raises:
        BadInput: n < 2.
        NotCovered, NotConverged: as `theory.predict`.

    Source: Eq:ps, Eq:g, Eq:lnE/E0.
    """
    if n < 2:
        raise BadInput(f"n = {n}, must be >= 2")
    panels = _panels(scene)
    place = np.linspace(0.0, len(panels), n)
    index = np.minimum(place.astype(int), len(panels) - 1)
    parts = [panel.at(place[index == i] - i) for i, panel in enumerate(panels)]
    if not parts:
        return CaptureCurve(*(np.empty(0) for _ in CaptureCurve._fields))
    return CaptureCurve(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def largest_gain(scene: Scene) -> tuple[float, float] | None:
    """Return (t_in, s) of the captured particles that gain most; None when nothing is captured.

    Args:
        scene: as for `theory.predict`.

    Source: Fig:protocol, right, and the right mode of Fig:E1/E0.
    """
    best: tuple[float, float] | None = None
    for panel in _panels(scene):
        fine = panel.at(_X)
        k = int(np.argmax(fine.s))
        x = _X[k]
        if 0 < k < FINE:
            # Newton steps on s' = 0 from a fine sample reach rounding.
            first, second = chebyshev.chebder(panel.s), chebyshev.chebder(panel.s, 2)
            for _ in range(3):
                bend = chebyshev.chebval(2 * x - 1, second)
                step = chebyshev.chebval(2 * x - 1, first) / (2 * bend) if bend < 0 else 0.0
                x = min(max(x - step, _X[k - 1]), _X[k + 1])
        at_best = panel.at(np.array([x]))
        if best is None or at_best.s[0] > best[1]:
            best = float(at_best.t_in[0]), float(at_best.s[0])
    return best


def energy_density(scene: Scene, edges: ArrayLike) -> Floats:
    """Return the probability of being captured and ending with log E1 / E0 in each bin.

    Args:
        scene: as for `theory.predict`.
        edges: bin edges, rising, at least two; a histogram's.

    Returns:
        Masses, one per bin. Over all s they sum to 1 - p_nc; the uncaptured, at log_e_nc, are apart.

    Raises:
        BadInput: edges do not rise.
        NotCovered, NotConverged: as `theory.predict`.

    Source: Eq:lnE/E0 with Eq:ps.
    """
    return _masses(scene, edges, "s")


def capture_time_mass(scene: Scene, edges: ArrayLike) -> Floats:
    """Return the probability of being captured within each bin of time.

    Args:
        scene: as for `theory.predict`.
        edges: bin edges [time], rising, in the time of the cycle (from `Cycle.start` on).

    Returns:
        Masses, one per bin.

    Raises:
        BadInput: edges do not rise.
        NotCovered, NotConverged: as `theory.predict`.

    Source: Eq:ps.
    """
    return _masses(scene, edges, "t_in")


class ChaoticZone(NamedTuple):
    """The chaotic zone through the cycle, float64 arrays of one length.

    log_energy: log E / E0 of a particle that has not been captured, E0 at the cycle's start (Eq:dE).
    p_cha: share of the particles that are in the chaotic zone (Eq:ps).
    """

    log_energy: Floats
    p_cha: Floats


def chaotic_zone(scene: Scene, times: ArrayLike) -> ChaoticZone:
    """Follow the chaotic zone's energy and population through the cycle, right to about 2e-7.

    Args:
        scene: as for `theory.predict`.
        times: shape (n,) [time]. Beyond the cycle, log_energy goes on by log_e_nc per period, for
            a particle not captured then either, and p_cha repeats.

    Returns:
        Arrays of length n.

    Source: Eq:dE integrated, Eq:ps.
    """
    cycle = Cycle.of(scene, DIGITS)
    start = float(cycle.start)
    t = np.asarray(times, dtype=np.float64)
    n_before = np.zeros_like(t)
    if cycle.period is not None:
        n_before = np.floor((t - start) / float(cycle.period))
        t = t - n_before * float(cycle.period)
    volume = np.array([volumes_at(fp, scene, float(x)).v_cha for x in t])
    log_energy = -np.log(volume / volumes_at(fp, scene, start).v_cha)
    if not cycle.pieces:
        return ChaoticZone(log_energy, np.ones_like(t))
    nodes = [panel.evaluate(_X) for panel in _panels(scene)]
    _, t_in, t_out, A, B, _ = (np.concatenate(rows) for rows in zip(*nodes, strict=True))
    is_falling = t < t_in[-1]
    capture = np.interp(t, t_in, A)
    release = np.interp(t, t_out[::-1], (B[-1] - B)[::-1])
    still = np.interp(t, t_out[::-1], A[::-1])
    log_energy += n_before * (B[-1] - A[-1]) + np.where(is_falling, 0.0, release) - capture
    return ChaoticZone(log_energy, np.exp(-np.where(is_falling, capture, still)))


class _FloatPanel(NamedTuple):
    """Chebyshev coefficients over x in [0, 1] of nu, t_in, t_out, A, B and log g, and their end values."""

    coefficients: Floats
    ends: Floats

    @property
    def s(self) -> Floats:
        A, B, log_g = self.coefficients[3:]
        s: Floats = B - A - log_g
        return s

    def evaluate(self, x: Floats) -> Floats:
        values: Floats = np.asarray(chebyshev.chebval(2 * x - 1, self.coefficients.T), dtype=np.float64)
        for end in (0, 1):
            values[:, x == end] = self.ends[:, [end]]
        return values

    def at(self, x: Floats) -> CaptureCurve:
        nu, t_in, t_out, A, B, log_g = self.evaluate(x)
        return CaptureCurve(nu, t_in, t_out, np.exp(-A), log_g, B - A - log_g)


_X = np.linspace(0.0, 1.0, FINE + 1)


def _panels(scene: Scene) -> list[_FloatPanel]:
    found = captures(Cycle.of(scene, DIGITS), DIGITS + 4)
    panels = []
    for p in found.panels:
        functions = (p.nu, p.t_in, p.t_out, p.A, p.B, p.log_g)
        coefficients = [[float(c) for c in found.grid.coefficients(values)] for values in functions]
        ends = [[float(values[0]), float(values[-1])] for values in functions]
        panels.append(_FloatPanel(np.array(coefficients), np.array(ends)))
    return panels


def _masses(scene: Scene, edges: ArrayLike, what: str) -> Floats:
    bounds = np.asarray(edges, dtype=np.float64)
    if bounds.ndim != 1 or bounds.size < 2 or not np.all(np.diff(bounds) > 0):
        raise BadInput("edges must be at least two rising numbers")
    below = np.zeros_like(bounds)
    for panel in _panels(scene):
        fine = panel.at(_X)
        variable: Floats = getattr(fine, what)
        mass = fine.p_cha[:-1] - fine.p_cha[1:]
        low = np.minimum(variable[:-1], variable[1:])
        width = np.abs(np.diff(variable))
        for i, edge in enumerate(bounds):
            covered = np.divide(edge - low, width, out=(edge > low) * 1.0, where=width > 0)
            below[i] += mass @ np.clip(covered, 0.0, 1.0)
    return np.diff(below)
