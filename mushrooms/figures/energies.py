"""Histograms of log E1/E0 after one cycle, the theory at that energy over them, and what is left below."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import theory
from mushrooms.figures.style import BLACK, BLUE, ORANGE, SKY, STYLE, FloatArray, new_figure
from scene import Mushroom, Scene
from scene.refusal import BadInput

IntArray = npt.NDArray[np.int64]
N_BINS = 80
LIMIT_DIGITS = 6  # of a line in a picture
N_PLACES = 1500
LEAST_EXPECTED = 5.0  # particles in a bin, to speak of standard errors
TAIL = 0.0005  # left out at either side


def panels(n: int) -> tuple[Figure, list[tuple[Axes, Axes]]]:
    """Return a figure of n histograms side by side, each with a panel for residuals below it."""
    figure, _ = new_figure(4.8 * n, 4.8)
    figure.clear()
    grid = figure.subplots(2, n, height_ratios=[3, 1], sharex="col", squeeze=False)
    return figure, [(above, below) for above, below in grid.T]


@rc_context(STYLE)
def histogram(
    scene: Scene, energy: float, gain: FloatArray, title: str, counts: IntArray | None = None
) -> Figure:
    """Draw one ensemble's log E1/E0 after a cycle; the theory over it, where it covers the scene.

    Args:
        scene: that was simulated.
        energy: of every start [length^2 / time^2].
        gain: (n,) log E1/E0, or the middles of even bins.
        title: of the figure.
        counts: (n,) how many there are of each; one by default.
    """
    found = known(scene, energy)
    if found is None:
        figure, axes = new_figure(4.8, 3.6)
        _bars(axes, gain, _edges(gain, 0.0, counts), counts)
        axes.set(xlabel="log E1/E0", ylabel="density", title=title)
        limit = high_energy_peak(scene)
        if limit is not None:
            axes.axvline(limit, color=ORANGE, linestyle="--", label="theory, never captured, E0 → ∞")
            figure.legend(loc="outside lower center")
        return figure
    figure, [(axes, rest)] = panels(1)
    draw(axes, rest, gain, found, title, counts)
    axes.axvline(float(found.peak[0]), color=ORANGE, linestyle="--", label="theory, never captured")
    axes.legend(loc="best")
    return figure


def known(scene: Scene, energy: float) -> theory.FiniteEnergy | None:
    """Return the theory of a scene at an energy; None where it covers no such scene."""
    try:
        return theory.at_energy(scene, energy) if isinstance(scene, Mushroom) else None
    except (BadInput, theory.NotCovered, theory.NotConverged):
        return None


def high_energy_peak(scene: Scene) -> float | None:
    """Return log E1/E0 of those never captured in the limit of high energies; None where theory has none."""
    try:
        found = theory.predict(scene, LIMIT_DIGITS) if isinstance(scene, Mushroom) else None
    except (BadInput, theory.NotCovered, theory.NotConverged):
        return None
    return float(found.log_e_nc) if found is not None and found.p_nc > 0 else None


def draw(
    axes: Axes,
    rest: Axes | None,
    gain: FloatArray,
    found: theory.FiniteEnergy,
    title: str,
    counts: IntArray | None = None,
) -> FloatArray:
    """Draw a histogram, the theory over it, residuals into `rest` if there is one; return its edges."""
    sigma = float(found.peak[1] ** 0.5)
    edges = _edges(gain, sigma, counts)
    heights = _bars(axes, gain, edges, counts)
    n = len(gain) if counts is None else int(counts.sum())
    if rest is None:
        axes.set(xlabel="log E1/E0")
    else:
        _residuals(rest, heights * n * np.diff(edges), np.diff(found.cdf(edges)) * n, edges)
    x = np.linspace(edges[0], edges[-1], N_PLACES)
    total = np.gradient(found.cdf(x), x)
    axes.plot(x, total, color=BLACK, linewidth=1.3, label=f"theory at this energy, peak {sigma:.4f} wide")
    top = 1.15 * max(float(heights.max()), float(total.max()))
    axes.set(xlim=(edges[0], edges[-1]), ylim=(0, top), ylabel="density", title=title)
    return edges


def _edges(gain: FloatArray, sigma: float, counts: IntArray | None) -> FloatArray:
    """Return the edges of the bars; where even bins are given, none of these is cut."""
    if counts is None:
        low, high = (float(np.quantile(gain, q)) for q in (TAIL, 1 - TAIL))
        return np.histogram_bin_edges(gain, N_BINS, (low - sigma, high + sigma))
    below = np.cumsum(counts) / counts.sum()
    low, high = (float(gain[np.searchsorted(below, q)]) for q in (TAIL, 1 - TAIL))
    bin_width = float(np.diff(gain).min()) if len(gain) > 1 else 1.0
    step = max(1, round((high - low + 2 * sigma) / N_BINS / bin_width))
    first = int(np.floor((low - sigma - gain[0]) / bin_width / step)) * step
    n_bars = int(np.ceil(((high + sigma - gain[0]) / bin_width - first + 1) / step))
    return np.asarray(gain[0] + bin_width * (first - 0.5 + step * np.arange(n_bars + 1)))


def _bars(axes: Axes, gain: FloatArray, edges: FloatArray, weights: IntArray | None = None) -> FloatArray:
    """Draw densities with their standard errors, and return them."""
    n, widths = len(gain) if weights is None else int(weights.sum()), np.diff(edges)
    counts = np.histogram(gain, edges, weights=weights)[0]
    heights: FloatArray = counts / (n * widths)
    axes.stairs(heights, edges, fill=True, color=SKY, label="simulation")
    bars = np.sqrt(counts) / (n * widths)
    axes.errorbar((edges[1:] + edges[:-1]) / 2, heights, bars, fmt="none", ecolor=BLUE, elinewidth=0.7)
    return heights


def _residuals(axes: Axes, counts: FloatArray, expected: FloatArray, edges: FloatArray) -> None:
    """Draw counts less those expected, in standard errors, where a bin expects enough for that to mean it."""
    enough = expected >= LEAST_EXPECTED
    left = np.where(enough, (counts - expected) / np.sqrt(np.where(enough, expected, 1.0)), np.nan)
    axes.axhspan(-2, 2, color=SKY, alpha=0.5, linewidth=0)
    axes.axhline(0, color=BLACK, linewidth=0.8)
    axes.plot((edges[1:] + edges[:-1]) / 2, left, ".", color=BLUE, markersize=4)
    reach = max(4.0, 1.1 * float(np.nanmax(np.abs(left)))) if enough.any() else 4.0
    axes.set(xlabel="log E1/E0", ylabel="pull", ylim=(-reach, reach))
