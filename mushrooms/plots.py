"""Plots of the report: the loop of volumes, energies and capture times with theory over them.

One palette throughout (Okabe and Ito's, told apart by colour-blind readers, and viridis for
phases). Simulation is blue and filled, theory orange or black lines.
"""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
import numpy.typing as npt
from matplotlib import colormaps, rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from mpmath import fp

import theory
from scene import Scene
from scene.tables import period

if TYPE_CHECKING:
    from conformance.audit import Sample

FloatArray = npt.NDArray[np.float64]

BLUE, SKY, ORANGE, BLACK, GREY = "#0072B2", "#A6CEE9", "#D55E00", "#1A1A1A", "#8C8C8C"
STYLE: dict[str, Any] = {
    "font.family": "sans-serif",
    "font.size": 10,
    "axes.titlesize": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": BLACK,
    "legend.fontsize": 9,
    "svg.hashsalt": "oscillating-mushrooms",  # the same picture is the same bytes
}
N_BINS = 80
N_FINE = 1200


def phase_colours(n: int) -> list[str]:
    """Return n colours in the order of the phases; the palest end of viridis is left out."""
    shades = colormaps["viridis"](np.linspace(0, 0.88, n))
    return ["#" + "".join(f"{round(255 * part):02x}" for part in shade[:3]) for shade in shades]


def new_figure(width: float, height: float, n_rows: int = 1, n_columns: int = 1) -> tuple[Figure, Any]:
    """Return a figure [inches] and its axes (an array when there are several)."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.subplots(n_rows, n_columns)


def save(figure: Figure, file: BinaryIO, suffix: str) -> None:
    """Write a figure as ".svg" or ".png"; the bytes depend on the picture alone."""
    kind = suffix.removeprefix(".")
    with rc_context(STYLE):
        metadata = {"Date": None} if kind == "svg" else None
        figure.savefig(file, format=kind, dpi=160, bbox_inches="tight", metadata=metadata)


def svg(figure: Figure) -> bytes:
    """Return a figure as SVG."""
    file = io.BytesIO()
    save(figure, file, ".svg")
    return file.getvalue()


@rc_context(STYLE)
def loop(scene: Scene) -> Figure:
    """Draw the cycle in the plane (V_ell/V_cap, V_cap/V), sec. 3.5: its area decides whether energy grows."""
    shared = period(scene)
    assert shared is not None
    span = float(shared.value(fp))
    n = 240
    volumes = [theory.volumes_at(fp, scene, span * k / n) for k in range(n + 1)]
    x = np.array([v.v_ell / v.v_cap for v in volumes])
    y = np.array([v.v_cap / (v.v_cap + v.v_stem) for v in volumes])
    figure, axes = new_figure(6.0, 3.8)
    axes.fill(x, y, color=SKY, alpha=0.5, linewidth=0)
    axes.plot(x, y, color=BLACK, linewidth=1.2)
    n_phases = 6
    for k, colour in enumerate(phase_colours(n_phases)):
        i = k * n // n_phases
        axes.plot(x[i], y[i], "o", color=colour, markersize=7, label=f"t/T = {k}/{n_phases}")
        _arrow(axes, x, y, i + n // (2 * n_phases))
    axes.set(xlabel="island's share of the cap, V_ell / V_cap", ylabel="cap's share of the table, V_cap / V")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    return figure


def _arrow(axes: Axes, x: FloatArray, y: FloatArray, i: int) -> None:
    start, end = (x[i - 2], y[i - 2]), (x[i], y[i])
    if start != end:
        axes.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": BLACK, "linewidth": 0})


@rc_context(STYLE)
def energies(scene: Scene, sample: Sample, prediction: theory.Prediction) -> Figure:
    """Draw the histogram of log E1/E0 with theory over it."""
    centre, width = float(prediction.log_e_nc), sample.sigma_w
    p_nc = float(prediction.p_nc)
    low = min(float(np.quantile(sample.s, 0.001)), centre - 4 * width)
    high = max(float(np.quantile(sample.s, 0.999)), centre + 4 * width)
    fine = np.linspace(low - 4 * width, high + 4 * width, N_FINE + 1)
    step = fine[1] - fine[0]
    middle = (fine[1:] + fine[:-1]) / 2
    captured = np.asarray(theory.energy_density(scene, fine)) / step
    n_reach = min(int(np.ceil(5 * width / step)), N_FINE // 2 - 1)  # five widths to either side
    kernel = _normal(np.arange(-n_reach, n_reach + 1) * step, 0.0, width) * step
    widened = np.convolve(captured, kernel, mode="same") + p_nc * _normal(middle, centre, width)

    figure, axes = new_figure(6.4, 3.8)
    edges = np.linspace(low, high, N_BINS + 1)
    counts = np.histogram(sample.s, edges)[0] / (len(sample.s) * np.diff(edges))
    axes.stairs(counts, edges, fill=True, color=SKY, label=f"simulation, {len(sample.s):,} particles")
    axes.plot(middle, widened, color=BLACK, linewidth=1.4, label=f"theory, widened by {width:.4f}")
    axes.plot(middle, captured, color=ORANGE, linewidth=1.4, label=f"theory, captured: mass {1 - p_nc:.4f}")
    axes.axvline(
        centre,
        color=ORANGE,
        linestyle="--",
        linewidth=1.2,
        label=f"never captured: mass {p_nc:.4f} at {centre:+.4f}",
    )
    tallest = max(float(counts.max()), float(widened.max()))
    axes.set(
        xlim=(low, high),
        ylim=(0, 1.1 * tallest),
        xlabel="s = log E1/E0, one cycle",
        ylabel="density [1 / unit of s]",
    )
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=2, frameon=False)
    return figure


@rc_context(STYLE)
def capture_times(scene: Scene, t_in: FloatArray, n_followed: int) -> Figure:
    """Draw the histogram of capture times with theory over it.

    Args:
        scene: table and laws.
        t_in: capture times [time] of the captured particles.
        n_followed: all particles followed, captured or not: the density's mass is the captured share.
    """
    shared = period(scene)
    assert shared is not None
    span = float(shared.value(fp))
    edges = np.linspace(0, span, 61)
    mass = np.asarray(theory.capture_time_mass(scene, edges))
    counts = np.histogram(t_in % span, edges)[0] / n_followed
    per_cycle = len(edges) - 1  # turns a bin's mass into a density per cycle
    figure, axes = new_figure(6.4, 3.2)
    axes.stairs(
        counts * per_cycle, edges / span, fill=True, color=SKY, label=f"simulation, {len(t_in):,} captured"
    )
    axes.stairs(mass * per_cycle, edges / span, color=ORANGE, linewidth=1.6, label="theory, -dp_cha/dt")
    axes.set(xlim=(0, 1), ylim=(0, None), xlabel="time of capture, t_in / T", ylabel="density [1 / T]")
    axes.legend(frameon=False)
    return figure


def _normal(x: FloatArray, centre: float, width: float) -> FloatArray:
    return np.asarray(np.exp(-(((x - centre) / width) ** 2) / 2) / (width * np.sqrt(2 * np.pi)))
