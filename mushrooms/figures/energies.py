"""Energies of an ensemble after one cycle and from cycle to cycle, with the theory.

The data are s = ln(E/E0) of the particles that take part, as (n, K) arrays: n particles after each
of K cycles. A run too large for memory gives them block by block. Below a histogram stands its
difference from the theory at this energy. For scenes without measured rates the limit of high
energies is drawn. All curves of theory in one panel are of one energy. A density is drawn as its
mean over the width of one bar: at the middle of a bar it is the height that theory expects of this
bar, and it is finite everywhere.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import theory
from fast.validation import check_energy
from mushrooms.figures.style import BLACK, BLUE, GREY, ORANGE, SKY, STYLE, new_figure, plain, power
from mushrooms.store.spec import RunSpec
from mushrooms.store.summary import NO_THEORY, begins_widest, known, predicted
from scene import Mushroom, Scene, check_scene
from scene.pieces import FloatArray
from scene.refusal import BadInput, shown

IntArray = npt.NDArray[np.int64]
Gains = FloatArray | Iterator[FloatArray]
N_BARS = 80
MANY = 2000  # particles; of fewer there are half as many bars
N_PLACES = 1500
N_LINES = 12  # single particles drawn beside the mean
N_MARKS = 60  # cycles at which a mean is drawn, at most
ENOUGH = 10_000  # particles that say where the bars go
ROOM = 1.08  # height of a panel, by that of the highest curve or bar with its error
LEAST_EXPECTED = 5.0  # particles in a bin, to speak of standard errors
TAIL = 0.0005  # left out at either side
LEAST_SPAN = 1e-12  # of a histogram: what is less is rounding
AXIS = "s = ln(E1/E0)"


class Gathered(NamedTuple):
    """The data drawn of n particles over K cycles.

    Attributes:
        n: number of particles.
        edges, counts: bars of ln(E1/E0), after the first cycle.
        mean, sd: (K,) of ln(E/E0) after each cycle.
        few: (m, K) ln(E/E0) of single particles.
    """

    n: int
    edges: FloatArray
    counts: IntArray
    mean: FloatArray
    sd: FloatArray
    few: FloatArray


def gathered(gains: Gains, margin: float = 0.0) -> Gathered:
    """Gather arrays of shape (n,) or (n, K), which an iterator may hand over block by block.

    Args:
        gains: ln(E/E0) after each cycle; particles with a nan are left out.
        margin: room beside the bars.

    Raises:
        BadInput: fewer than two particles.
    """
    rows = map(_rows, gains if isinstance(gains, Iterator) else [gains])
    head = next(rows, np.zeros((0, 1)))
    is_more = True
    while is_more and len(head) < ENOUGH:
        more = next(rows, None)
        is_more = more is not None
        if more is not None:
            head = np.concatenate([head, more])
    if len(head) < 2:
        raise BadInput(f"gains: {len(head)} particles were followed to the end, must be at least 2")
    edges = _edges(head[:, 0], margin)
    n = 0
    counts = np.zeros(len(edges) - 1, np.int64)
    sums, squares = np.zeros((2, head.shape[1]))
    for block in chain([head], rows):
        n = n + len(block)
        counts = counts + np.histogram(block[:, 0], edges)[0]
        sums = sums + block.sum(axis=0)
        squares = squares + (block**2).sum(axis=0)
    mean = sums / n
    sd = np.sqrt(np.maximum(squares / n - mean**2, 0.0))
    return Gathered(n, edges, counts, mean, sd, head[:N_LINES])


def _rows(gains: object) -> FloatArray:
    """Return an array (n, K) without the rows of particles that were not followed to the end."""
    try:
        found = np.asarray(gains, np.float64)
        rows = found.reshape(len(found), -1)
    except (TypeError, ValueError):
        raise BadInput(
            f"gains = {shown(gains)}, must be an array of numbers, (n,) or (n, K)"
        ) from None
    return np.asarray(rows[np.isfinite(rows).all(axis=1)])


def _edges(gain: FloatArray, margin: float) -> FloatArray:
    low, high = (float(np.quantile(gain, q)) for q in (TAIL, 1 - TAIL))
    room = margin or max(0.05 * (high - low), LEAST_SPAN)
    return np.linspace(low - room, high + room, (N_BARS if len(gain) >= MANY else N_BARS // 2) + 1)


def with_residuals(n: int) -> tuple[Figure, Any]:
    """Return a figure of n histograms side by side, and the panels (n, 2).

    Below each is one of residuals.
    """
    figure, grid = new_figure(4.8 * n, 4.8, 2, n, height_ratios=[3, 1], sharex="col", squeeze=False)
    return figure, grid.T


@rc_context(STYLE)
def histogram(scene: Scene, energy: float, gains: Gains, n_particles: int | None = None) -> Figure:
    """Draw an ensemble's ln(E1/E0) after a cycle, with the theory if it covers the scene.

    Args:
        scene: the scene that was simulated.
        energy: initial energy of every particle [length^2 / time^2].
        gains: (n,) ln(E1/E0) of the particles that take part, or an iterator of blocks.
        n_particles: number of simulated particles; n by default.

    Raises:
        BadInput: `scene` is not a scene, or there are fewer than two particles.
    """
    check_scene(scene)
    energy = check_energy(energy)
    found = known(scene, energy)
    bars = gathered(gains, 0.0 if found is None else float(found.peak[1] ** 0.5))
    if found is None:
        figure, axes = new_figure(5.2, 4.2)
        draw_limit(axes, scene, bars)
    else:
        figure, [(axes, rest)] = with_residuals(1)
        draw(axes, rest, bars, found)
        draw_never_captured(axes, float(found.peak[0]))
    axes.set_title(_title(scene, energy, bars, n_particles))
    figure.legend(loc="outside lower center")
    return figure


@rc_context(STYLE)
def growth(scene: Scene, energy: float, gains: Gains, n_particles: int | None = None) -> Figure:
    """Draw the mean of ln(E/E0) by cycles, its spread and theory's; below it `histogram`.

    Args:
        scene: the scene that was simulated.
        energy: initial energy of every particle [length^2 / time^2].
        gains: (n, K) ln(E/E0) after each cycle, of the particles that take part, or an iterator of
            blocks.
        n_particles: number of simulated particles; n by default.

    Raises:
        BadInput: `scene` is not a scene, or there are fewer than two particles.
    """
    check_scene(scene)
    energy = check_energy(energy)
    found = known(scene, energy)
    bars = gathered(gains)
    # One below the other: legible on a telephone.
    figure, (above, below) = new_figure(6.4, 8.4, 2, 1)
    cycles = np.arange(len(bars.mean) + 1)
    mean, sd, few = (
        np.pad(x, [*[(0, 0)] * (x.ndim - 1), (1, 0)]) for x in (bars.mean, bars.sd, bars.few)
    )
    above.plot(cycles, few.T, color=GREY, linewidth=0.6, alpha=0.6)
    above.plot([], [], color=GREY, linewidth=0.6, label="single particles")
    above.fill_between(
        cycles, mean - sd, mean + sd, color=SKY, alpha=0.6, linewidth=0, label="± 1 sd of one"
    )
    shown = np.unique(np.linspace(0, cycles[-1], min(N_MARKS, len(cycles))).astype(int))
    error = sd[shown] / np.sqrt(bars.n)
    above.errorbar(
        cycles[shown], mean[shown], error, fmt="o", color=BLUE, markersize=3.5, label="mean"
    )
    _draw_predictions(above, scene, energy, shown)
    above.set(
        xlabel="cycle of the walls",
        ylabel="ln(E/E0)",
        title=_title(scene, energy, bars, n_particles),
    )
    above.xaxis.get_major_locator().set_params(integer=True)
    draw_limit(below, scene, bars) if found is None else draw(below, None, bars, found)
    below.set(title="after the first cycle")
    for axes in (above, below):
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2)
    return figure


def _draw_predictions(axes: Axes, scene: Scene, energy: float, shown: FloatArray) -> None:
    """Draw theory's mean after each of some cycles, and its spread, if it has them all."""
    predictions = [(k, predicted(RunSpec(scene, energy, int(k), 0))) for k in shown[1:]]
    if all(one is not None for _, one in predictions):
        line = np.array([0.0, *(k * one.m1 for k, one in predictions if one is not None)])
        axes.plot(
            shown,
            line,
            color=BLACK,
            linewidth=1.5,
            label=f"theory, m1 = {line[1]:.4f} a cycle",
        )
        spread = np.array(
            [0.0, *((k * one.variance) ** 0.5 for k, one in predictions if one is not None)]
        )
        for edge, label in ((line - spread, "theory ± its sd"), (line + spread, "_")):
            axes.plot(shown, edge, color=BLACK, linewidth=0.9, linestyle=":", label=label)


def _title(scene: Scene, energy: float, bars: Gathered, n_particles: int | None) -> str:
    """Return the title: scene, energy, particles, and how many of these are not drawn."""
    n = n_particles or bars.n
    title = f"{plain(scene.name or 'a scene')}, E0 = {power(energy)}, {n:,} particles"
    return (
        title if n == bars.n else f"{title}\n({n - bars.n:,} of them never free, or lost: left out)"
    )


def draw_limit(axes: Axes, scene: Scene, bars: Gathered) -> None:
    """Draw a histogram, with the limit of high energies if theory covers the scene."""
    highest = _bars(axes, bars)
    edges = bars.edges
    with suppress(*NO_THEORY):
        if isinstance(scene, Mushroom) and begins_widest(scene):
            theirs = draw_adiabatic(axes, theory.energies(scene), edges, "at high energies")
            highest = max(highest, theirs)
    axes.set(xlabel=AXIS, ylabel="density", xlim=(edges[0], edges[-1]), ylim=(0, ROOM * highest))
    axes.locator_params(axis="x", nbins=6)


def draw_adiabatic(axes: Axes, limit: theory.Energies, edges: FloatArray, name: str) -> float:
    """Draw the energies of the adiabatic theory: a density of the captured, a line for the others.

    Returns:
        The greatest density drawn.
    """
    highest = 0.0
    if limit.p_nc < 1:
        highest = _draw_density(
            axes,
            limit.captured_below,
            edges,
            color=ORANGE,
            linewidth=1.4,
            label=f"theory, captured, {name}",
        )
    if limit.p_nc > 0:
        draw_never_captured(axes, float(limit.s_nc))
    return highest


def _draw_density(
    axes: Axes, below: Callable[[FloatArray], FloatArray], edges: FloatArray, **style: Any
) -> float:
    """Draw a density as its mean over the width of a bar, and return the greatest.

    Args:
        axes: where.
        below: returns the shares below places.
        edges: of the bars, equally wide.
        style: of the line.
    """
    x = np.linspace(edges[0], edges[-1], N_PLACES)
    half = (edges[1] - edges[0]) / 2
    density = (below(x + half) - below(x - half)) / (2 * half)
    axes.plot(x, density, **style)
    return float(density.max())


def draw_never_captured(axes: Axes, place: float) -> None:
    """Draw where theory has the particles that are never captured."""
    axes.axvline(place, color=ORANGE, linestyle="--", linewidth=1.2, label="theory, never captured")


def draw(axes: Axes, rest: Axes | None, bars: Gathered, found: theory.FiniteEnergy) -> None:
    """Draw a histogram, the theory over it, and residuals into `rest` if there is one."""
    top = _bars(axes, bars)
    edges = bars.edges
    shares = np.diff(found.cdf(edges))
    if rest is None:
        axes.set(xlabel=AXIS)
    else:
        _residuals(rest, bars.counts, shares * bars.n, edges)
    theirs = _draw_density(
        axes,
        found.cdf,
        edges,
        color=BLACK,
        linewidth=1.3,
        label=f"theory at this energy, peak {found.peak[1] ** 0.5:.4f} wide",
    )
    axes.set(xlim=(edges[0], edges[-1]), ylim=(0, ROOM * max(top, theirs)), ylabel="density")


def _bars(axes: Axes, bars: Gathered) -> float:
    """Draw densities with their standard errors, and return the highest end of an error bar."""
    unit = bars.n * np.diff(bars.edges)
    heights: FloatArray = bars.counts / unit
    axes.stairs(heights, bars.edges, fill=True, color=SKY, label="simulation")
    places = (bars.edges[1:] + bars.edges[:-1]) / 2
    errors = np.sqrt(bars.counts) / unit
    axes.errorbar(places, heights, errors, fmt="none", ecolor=BLUE, elinewidth=0.7)
    return float((heights + errors).max())


def _residuals(rest: Axes, counts: IntArray, expected: FloatArray, edges: FloatArray) -> None:
    """Draw counts minus expected counts, in standard errors, for bins that expect enough."""
    enough = expected >= LEAST_EXPECTED
    left = np.where(enough, (counts - expected) / np.sqrt(np.where(enough, expected, 1.0)), np.nan)
    rest.axhspan(-2, 2, color=SKY, alpha=0.5, linewidth=0)
    rest.axhline(0, color=BLACK, linewidth=0.8)
    rest.plot((edges[1:] + edges[:-1]) / 2, left, ".", color=BLUE, markersize=4)
    reach = max(4.0, 1.1 * float(np.nanmax(np.abs(left)))) if enough.any() else 4.0
    rest.set(xlabel=AXIS, ylabel="(sim. − theory)\n/ error", ylim=(-reach, reach))
