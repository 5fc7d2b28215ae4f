"""What heats fastest: m1 of four-leg loops in floats, its bounds, m1 of the moving cap over phase and size.

A four-leg loop over an upright stem closes the mouth from w1 to w0 at depth h1 and opens it at depth h0 (sec.
4.1, r = 1). With a = V_cap / V_cha at capture, b at release and delta the island's share,
    m1 = integral of (b - a - a log(b / a)) exp(-A) |d delta|,   A = integral of a |d delta|.
Its integrand grows with b, by 1 - a / b, and falls with a, by log(b / a), where b > a. So m1 grows as h0
falls, as h1 grows and as w0 falls: bounds on depth and mouth are met at their corner, and
    m1 < integral of b |d delta| at h0 = 0, which is -log(1 - delta(w0)) for w1 = 1.
The last is reached as h1 grows beyond all bounds; without a bound on the mouth too there is no supremum.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.optimize import minimize

import theory
from scene import Fourier, Mushroom

N_NODES = 400  # of the integral over log w
NODES, WEIGHTS = np.polynomial.legendre.leggauss(N_NODES)


class Loop(NamedTuple):
    """A four-leg loop over an upright stem, r = 1: depths while the mouth closes and opens, its extremes."""

    h1: float
    h0: float
    w0: float
    w1: float = 1.0

    @property
    def m1(self) -> float:
        """Mean of log E1 / E0 per cycle (Eq:Erate)."""
        half = math.log(self.w1 / self.w0) / 2
        w = self.w1 * np.exp(half * (NODES - 1))
        slope = half * WEIGHTS * w * 4 / np.pi * np.sqrt(np.maximum(1 - w * w, 0.0))  # |d delta|
        free = 2 / np.pi * (np.arcsin(w) + w * np.sqrt(np.maximum(1 - w * w, 0.0)))
        a, b = (1 / (free + 4 * w * h / np.pi) for h in (self.h1, self.h0))
        # A from w1 down: all of a node's own weight but half is above it.
        below = np.cumsum((a * slope)[::-1])[::-1] - a * slope / 2
        return float(np.sum((b - a - a * np.log(b / a)) * np.exp(-below) * slope))

    @property
    def path(self) -> float:
        """How far walls go in a cycle [r]."""
        return 2 * (self.w1 - self.w0) + 2 * (self.h1 - self.h0)


def supremum(narrowest: float, deepest: float = math.inf) -> float:
    """Return the least upper bound of m1 where the mouth is at least so wide, the stem at most so deep."""
    if math.isfinite(deepest):
        return Loop(deepest, 0.0, narrowest).m1
    return -math.log(1 - float(theory.delta(np, narrowest)))


def fastest(narrowest: float, shallowest: float) -> tuple[Loop, float]:
    """Return the loop that gains most per time, its walls no faster than 1, and m1 over its path.

    A leg from rest to rest takes twice as long as its walls would at full speed all the way; the factor is
    left out.

    Args:
        narrowest: least mouth.
        shallowest: least depth.
    """

    def loss(x: np.ndarray) -> float:
        loop = _bounded(x, narrowest, shallowest)
        return -loop.m1 / loop.path

    best = min(
        (
            minimize(loss, start, method="Nelder-Mead", options={"xatol": 1e-7, "fatol": 1e-11})
            for start in STARTS
        ),
        key=lambda found: found.fun,
    )
    return _bounded(best.x, narrowest, shallowest), -float(best.fun)


STARTS = ((0.0, -1.0), (2.0, 1.0))  # log(h1 - h0), and where between its bounds log w0 lies


def _bounded(x: np.ndarray, narrowest: float, shallowest: float) -> Loop:
    share = 1 / (1 + math.exp(-x[1]))
    return Loop(shallowest + math.exp(x[0]), shallowest, narrowest**share)


def moving_cap(phase: float, radius: float, depth: float) -> Mushroom:
    """Return a cap and a stem that breathe with these amplitudes, the stem ahead by a phase (sec. 4.2)."""
    return Mushroom(
        r=Fourier(1.0, 1.0, sin=(radius,)),
        h=Fourier(1.0, 1.0, cos=(depth * math.sin(phase),), sin=(depth * math.cos(phase),)),
        nu=Fourier(0.6, 1.0, cos=(0.4,)),
        slope=0.04,
    )


def phase_diagram(phases: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Return m1 of moving caps, amplitudes of radius and depth alike; shape (sizes, phases)."""
    return np.array(
        [[float(theory.predict(moving_cap(p, a, a), 6).m1) for p in phases.tolist()] for a in sizes.tolist()]
    )


def draw_phase_diagram(n_phases: int = 16, n_sizes: int = 6) -> Figure:
    """Draw m1 of the moving cap over the phase of the stem and the amplitude."""
    phases, sizes = 2 * np.pi * np.arange(n_phases + 1) / n_phases, 0.6 * np.arange(1, n_sizes + 1) / n_sizes
    figure = Figure(figsize=(7.0, 3.6), layout="constrained")
    axes: Axes = figure.add_subplot()
    found = phase_diagram(phases, sizes)
    filled = axes.contourf(phases / np.pi, sizes, found, levels=12, cmap="viridis")
    figure.colorbar(filled, label="$m_1$ per cycle")
    axes.set(xlabel="phase of the stem ahead of the cap / π", ylabel="amplitude of radius and depth / mean")
    return figure


def draw_loops(deepest: tuple[float, ...] = (1.0, 2.0, 6.0, 20.0), n: int = 40) -> Figure:
    """Draw the supremum of m1 over the narrowest mouth, for several bounds on the depth and for none."""
    mouths = np.geomspace(1e-4, 0.9, n)
    figure = Figure(figsize=(7.0, 3.6), layout="constrained")
    axes: Axes = figure.add_subplot()
    for depth in deepest:
        axes.plot(mouths, [supremum(w, depth) for w in mouths], label=f"depth at most {depth:g} r")
    axes.plot(mouths, [supremum(w) for w in mouths], "k--", label="any depth")
    axes.set(xscale="log", xlabel="narrowest mouth w / r", ylabel="supremum of $m_1$ per cycle")
    axes.legend()
    return figure
