"""What heats fastest: m1 of loops of depth and mouth, the largest one, m1 of the moving cap.

A four-leg loop over an upright stem closes the mouth from w1 to w0 at one depth and opens it at
another (sec. 4.1, r = 1). It runs anticlockwise in the plane of w and h if the stem is deeper while
the mouth closes. With a = V_cap / V_cha at capture, b at release and delta the island's share, both
directions have
    m1 = integral of (b - a - a log(b / a)) exp(-A) |d delta|,   A = integral of a |d delta|.
The largest gain of mouths narrower than w, V(w), obeys dV = max(b - a - a log(b / a) - a V) |d
delta|. It is convex in (a, b), so a and b are at opposite bounds. The best loop is anticlockwise
where V is large, at wide mouths, and clockwise where V is small. It changes direction at one width,
the switch.
"""

import math
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from scipy.optimize import minimize, minimize_scalar

import theory
from mushrooms.figures.style import new_figure
from scene import Fourier, Mushroom

N_NODES = 400  # of the integral over log w
NODES, WEIGHTS = np.polynomial.legendre.leggauss(N_NODES)


class Loop(NamedTuple):
    """A four-leg loop over an upright stem, r = 1.

    It has depths while the mouth closes and opens, and the mouth's extremes.
    """

    closing: float
    opening: float
    w0: float
    w1: float = 1.0

    @property
    def m1(self) -> float:
        """Mean of log E1 / E0 per cycle (Eq:Erate)."""
        return self._integrate()[0]

    @property
    def free_share(self) -> float:
        """Share of the zone's particles that the loop never captures, exp(-A)."""
        return math.exp(-self._integrate()[1])

    @property
    def path(self) -> float:
        """How far walls go in a cycle [r]."""
        return 2 * (self.w1 - self.w0) + 2 * abs(self.closing - self.opening)

    def _integrate(self) -> tuple[float, float]:
        half = math.log(self.w1 / self.w0) / 2
        w = self.w1 * np.exp(half * (NODES - 1))
        slope = half * WEIGHTS * w * 4 / np.pi * np.sqrt(np.maximum(1 - w * w, 0.0))  # |d delta|
        free = 2 / np.pi * (np.arcsin(w) + w * np.sqrt(np.maximum(1 - w * w, 0.0)))
        a, b = (1 / (free + 4 * w * h / np.pi) for h in (self.closing, self.opening))
        # A from w1 down: all of a node's own weight but half is above it.
        below = np.cumsum((a * slope)[::-1])[::-1] - a * slope / 2
        m1 = np.sum((b - a - a * np.log(b / a)) * np.exp(-below) * slope)
        return float(m1), float(np.sum(a * slope))


def switched(shallowest: float, deepest: float, narrowest: float, switch: float) -> float:
    """Return m1 of a loop that is anticlockwise at mouths wider than the switch, else clockwise."""
    wide = Loop(deepest, shallowest, switch)
    return wide.m1 + wide.free_share * Loop(shallowest, deepest, narrowest, switch).m1


def supremum(shallowest: float, deepest: float, narrowest: float) -> tuple[float, float]:
    """Return the largest m1 within bounds on depth and mouth, and the switch of its loop.

    1 is clockwise.
    """

    def loss(log_switch: float) -> float:
        return -switched(shallowest, deepest, narrowest, math.exp(log_switch))

    inside = minimize_scalar(loss, bounds=(math.log(narrowest), 0.0), options={"xatol": 1e-7}).x
    best = min((float(inside), math.log(narrowest), 0.0), key=loss)
    return -loss(best), math.exp(best)


def fastest(narrowest: float, shallowest: float, *, clockwise: bool = False) -> tuple[Loop, float]:
    """Return the four-leg loop that gains most per time, walls no faster than 1, and its m1.

    A leg from rest to rest takes twice as long as its walls would at full speed all the way; the
    factor is left out.

    Args:
        narrowest: least mouth.
        shallowest: least depth.
        clockwise: deep while the mouth opens, not while it closes.
    """

    def decode(x: np.ndarray) -> Loop:
        depths = (shallowest + math.exp(x[0]), shallowest)
        share = 1 / (1 + math.exp(-x[1]))
        return Loop(*(depths[::-1] if clockwise else depths), narrowest**share)

    def loss(x: np.ndarray) -> float:
        loop = decode(x)
        return -loop.m1 / loop.path

    start = (0.0, -1.0)  # log of the stroke of h, and where between its bounds log w0 lies
    best = minimize(loss, start, method="Nelder-Mead", options={"xatol": 1e-7, "fatol": 1e-11})
    return decode(best.x), -float(best.fun)


def moving_cap(phase: float, radius: float, depth: float) -> Mushroom:
    """Return the cap of sec. 4.2 with these amplitudes, its stem ahead by a phase.

    Slope 0.04, not .1111.
    """
    return Mushroom(
        r=Fourier(1.0, 1.0, sin=(radius,)),
        h=Fourier(1.0, 1.0, cos=(depth * math.sin(phase),), sin=(depth * math.cos(phase),)),
        nu=Fourier(0.6, 1.0, cos=(0.4,)),
        slope=0.04,
    )


def phase_diagram(phases: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Return m1 of moving caps, amplitudes of radius and depth alike; shape (sizes, phases)."""
    return np.array(
        [
            [float(theory.predict(moving_cap(p, a, a), 6).m1) for p in phases.tolist()]
            for a in sizes.tolist()
        ]
    )


def draw_phase_diagram(n_phases: int = 16, n_sizes: int = 6) -> Figure:
    """Draw m1 of the moving cap over the phase of the stem and the amplitude."""
    phases = 2 * np.pi * np.arange(n_phases + 1) / n_phases
    sizes = 0.6 * np.arange(1, n_sizes + 1) / n_sizes
    figure, axes = new_figure(7.0, 3.6)
    found = phase_diagram(phases, sizes)
    filled = axes.contourf(phases / np.pi, sizes, found, levels=12, cmap="viridis")
    figure.colorbar(filled, label="$m_1$ per cycle")
    axes.set(
        xlabel="phase of the stem ahead of the cap / π",
        ylabel="amplitude of radius and depth / mean",
    )
    return figure


def draw_loops(deepest: tuple[float, ...] = (1.0, 6.0, 20.0), n: int = 40) -> Figure:
    """Draw m1 of both directions, and the supremum over the narrowest mouth.

    Each greatest depth has a line.
    """
    mouths = np.geomspace(1e-3, 0.9, n)
    figure, axes = new_figure(7.0, 3.6)
    for i, depth in enumerate(deepest):
        for label, dash, m1 in (
            ("anticlockwise", "-", [Loop(depth, 0.0, w).m1 for w in mouths]),
            ("clockwise", "--", [Loop(0.0, depth, w).m1 for w in mouths]),
            ("supremum", ":", [supremum(0.0, depth, w)[0] for w in mouths]),
        ):
            axes.plot(mouths, m1, dash, color=f"C{i}", label=f"{label}, depth at most {depth:g} r")
    axes.set(xscale="log", xlabel="narrowest mouth w / r", ylabel="$m_1$ per cycle")
    axes.legend(fontsize="small")
    return figure
