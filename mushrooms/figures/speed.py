"""Figures of the benchmark: speed against error, and error growth."""

from __future__ import annotations

import math
import statistics
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, NullLocator

from conformance.bench.record import Growth, Point, Record, quartiles
from mushrooms.figures import style as plots

# Contrast with white is 4.5 to 1 and more; families differ by their marks too, whatever colours one sees.
COLOURS = {
    "proof": "#B34A00",
    "compiled": plots.BLUE,
    "interpreted": "#00775A",
    "time-stepping": "#666666",
    "fixed-step": "#7A5C00",
    "lean": plots.BLACK,
    "example": "#A3417A",
    "command": "#7A3E9D",
}
MARKS = {
    "proof": "s",
    "compiled": "o",
    "interpreted": "D",
    "time-stepping": "v",
    "fixed-step": "^",
    "lean": "P",
    "example": "h",
    "command": "*",
}
WORDS = {
    "proof": "proof (reference), by digits asked",
    "compiled": "fast",
    "interpreted": "plain Python",
    "time-stepping": "scipy solve_ivp with events",
    "fixed-step": "time steps of 1/10 to 1/1000 flight, in C",
    "lean": "Newton without checks, in C and numba",
    "example": "examples in C, JavaScript, Python",
    "command": "command",
}
RED = "#C00000"
LABEL = 9  # size of text [points]
SPACE = 0.0725  # of a panel's height, from one label to the next
MOST_DIGITS, LEAST_DIGITS = 300.0, 0.5
LEAST_NS, MOST_NS = 10.0, 3e9
BINARY64 = 53 * math.log10(2)
TICKS = (1, 2, 4, 8, 16, 32, 64, 128, 256)


def digits(error: float) -> float:
    """Return correct digits for a relative error: an exact binary64 answer has all of its own."""
    return min(max(-math.log10(error), LEAST_DIGITS), MOST_DIGITS) if error > 0 else BINARY64


def speed(record: Record) -> bytes:
    """Draw time per collision against correct digits, one panel per workload, as SVG."""
    return plots.svg(speed_figure(record))


@rc_context(plots.STYLE)
def speed_figure(record: Record) -> Figure:
    """Draw time per collision against correct digits, one panel per workload."""
    n_rows = (len(record.workloads) + 1) // 2
    figure, axes = plots.new_figure(12.0, 3.3 * n_rows + 0.9, n_rows, 2)
    panels = np.atleast_2d(axes).ravel()
    for panel in panels[len(record.workloads) :]:
        panel.set_visible(False)
    for panel, workload in zip(panels, record.workloads, strict=False):
        points = [p for p in record.points if p.workload == workload.name]
        _panel(panel, points, record.digits)
        panel.set_title(f"{workload.name}: {workload.what}", loc="left")
        panel.set_xlabel("correct digits of dt, place and velocity", fontsize=LABEL)
        panel.set_ylabel("ns per collision", fontsize=LABEL)
    figure.legend(handles=_legend(record), loc="outside upper left", ncols=3)
    return figure


def _panel(axes: Any, points: list[Point], floor: int) -> None:
    axes.set(
        xscale="log", yscale="log", xlim=(LEAST_DIGITS / 1.4, MOST_DIGITS * 1.6), ylim=(LEAST_NS, MOST_NS)
    )
    axes.xaxis.set_major_locator(FixedLocator([LEAST_DIGITS, *TICKS]))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xticklabels(["none", *(str(n) for n in TICKS)])
    axes.tick_params(labelsize=LABEL)
    axes.axvspan(floor, MOST_DIGITS * 1.6, color=plots.BLACK, alpha=0.12, linewidth=0)
    axes.axvline(BINARY64, color=plots.BLACK, linewidth=0.8, linestyle=":")
    for p in points:
        _mark(axes, p)
    _label(axes, points)
    front = pareto(points)
    if front:
        x, y = zip(*front, strict=True)
        # To be right to so many digits, so much time is needed.
        axes.step(x, y, where="pre", color=plots.BLACK, linewidth=0.8, zorder=0)


def _mark(axes: Any, p: Point) -> None:
    colour, (first, ns, third) = COLOURS[p.family], quartiles(p.ns)
    middle, worst = _digits_of(p)
    if p.right:
        axes.plot([middle, middle], [first, third], color=colour, marker="_", markersize=6, linewidth=1.2)
        axes.plot([worst, middle], [ns, ns], color=colour, marker="|", markersize=7, linewidth=1.2)
        axes.plot(middle, ns, marker=MARKS[p.family], markersize=5.5, color=colour, linestyle="none")
    if p.wrong or p.astray:
        axes.plot(LEAST_DIGITS, ns, marker="x", markersize=7, color=RED, linestyle="none")


def _label(axes: Any, points: list[Point]) -> None:
    """Name the points: the proofs by their digits, the others in a column at the right, a line to each."""
    for p in (p for p in points if p.family == "proof"):
        above = _digits_of(p)[0], statistics.median(p.ns) * 2
        axes.annotate(short_name(p.solver), above, ha="center", color=COLOURS["proof"], fontsize=LABEL)
    named = [
        (math.log10(statistics.median(p.ns)), _digits_of(p)[0], _name(p), COLOURS[p.family])
        for p in points
        if p.family not in ("proof", "time-stepping")
    ]
    slow = [p for p in points if p.family == "time-stepping"]
    if slow:
        share = max(p.wrong / (p.wrong + p.right + p.undecided) for p in slow)
        name = f"solve_ivp: {share:.0%} wrong" if share else "solve_ivp"
        height = math.log10(statistics.median(statistics.median(p.ns) for p in slow))
        named.append((height, max(_digits_of(p)[0] for p in slow), name, COLOURS["time-stepping"]))
    named.sort()
    low, high = math.log10(LEAST_NS), math.log10(MOST_NS)
    heights = spread([(height - low) / (high - low) for height, *_ in named], SPACE)
    for (height, x, name, colour), place in zip(named, heights, strict=True):
        axes.annotate(
            name, (x, 10**height), (1.02, place), textcoords="axes fraction", va="center", fontsize=LABEL,
            arrowprops={"arrowstyle": "-", "color": colour, "linewidth": 0.7, "shrinkA": 0, "shrinkB": 3,
                        "relpos": (0.0, 0.5)},
        )  # fmt: skip


def spread(wanted: list[float], space: float) -> list[float]:
    """Return places at least `space` apart, with the least sum of squares from those wanted, which rise."""
    groups: list[list[float]] = []  # of wanted places, less what stands before them, that end side by side
    for k, place in enumerate(wanted):
        groups.append([place - k * space])
        while len(groups) > 1 and statistics.mean(groups[-2]) > statistics.mean(groups[-1]):
            last = groups.pop()
            groups[-1] += last
    starts = [statistics.mean(group) for group in groups for _ in group]
    return [start + k * space for k, start in enumerate(starts)]


def _name(p: Point) -> str:
    name = short_name(p.solver)
    share = p.astray / p.further if p.further else p.wrong / max(1, p.wrong + p.right + p.undecided)
    return f"{name}: {100 * share:.2g} % wrong" if share else name


def _digits_of(p: Point) -> tuple[float, float]:
    """Return the correct digits of the median and of the worst right answer."""
    if not p.relative:
        return LEAST_DIGITS, LEAST_DIGITS
    return digits(statistics.median(p.relative)), digits(max(p.relative))


def pareto(points: list[Point]) -> list[tuple[float, float]]:
    """Return (worst digits, ns) of the solvers that none beats in both, from the fastest on.

    Only a solver with no wrong answer and most of them right can stand on the front.
    """
    able = [p for p in points if p.right > p.undecided + p.left and not p.wrong and not p.astray]
    pairs = sorted((statistics.median(p.ns), -digits(max(p.relative))) for p in able)
    front: list[tuple[float, float]] = []
    for ns, minus_digits in pairs:
        if not front or -minus_digits > front[-1][0]:
            front.append((-minus_digits, ns))
    return front


def short_name(solver: str) -> str:
    """Return a solver's label."""
    for part in ("proof, ", " digits", "fast, ", "solve_ivp, ", "example in ", "command ", "steps, flight"):
        solver = solver.replace(part, "1" if part == "steps, flight" else "")
    return plots.plain(solver if len(solver) < 18 else solver[:17] + "…")


def _legend(record: Record) -> list[Line2D]:
    families = [f for f in COLOURS if any(p.family == f for p in record.points)]
    bare: dict[str, Any] = {"linestyle": "none", "markersize": 6}
    black: dict[str, Any] = {"color": plots.BLACK, "linewidth": 1.0}
    return [
        *(Line2D([], [], color=COLOURS[f], marker=MARKS[f], label=WORDS[f], **bare) for f in families),
        Line2D([], [], marker="|", markersize=7, label="from the median to the worst answer", **black),
        Line2D(
            [], [], marker="_", label="up and down: quartiles of the runs", **black | {"linestyle": "none"}
        ),
        Line2D([], [], marker="x", color=RED, label="some walls wrong", **bare),
        Line2D([], [], label="front: least time for so many digits, at worst", **black),
        Line2D([], [], label="binary64; shaded: beyond the proofs", **black | {"linestyle": ":"}),
    ]


@rc_context(plots.STYLE)
def growth(found: Growth) -> bytes:
    """Draw errors along trajectories with the Lyapunov slope and the predicted bound."""
    figure, axes = plots.new_figure(7.2, 4.4)
    count = np.arange(1, found.collisions + 1)
    colours = (
        COLOURS["interpreted"],
        plots.BLUE,
        COLOURS["example"],
        COLOURS["proof"],
        COLOURS["fixed-step"],
    )
    for (name, errors), colour, mark in zip(found.followers.items(), colours, "os^Dv", strict=False):
        shown = np.where(np.array(errors) > 0, errors, np.nan)
        every = max(1, len(count) // 16)
        axes.plot(
            count, shown, color=colour, marker=mark, markevery=every, markersize=5, linewidth=1, label=name
        )
    label = "one ulp a step, grown"
    axes.plot(count, found.bound, color=plots.BLACK, linestyle="--", linewidth=1, label=label)
    early = count[: 2 * (found.collisions // 3)]
    label = f"Lyapunov slope: {found.rate:.2f} decimals a collision"
    axes.plot(early, 10.0 ** (found.rate * (early - 1) - 32), color=plots.GREY, linestyle=":", label=label)
    axes.set(yscale="log", xlabel="collisions", ylabel="error, relative to table and speed", ylim=(1e-60, 10))
    axes.legend(loc="lower right")
    return plots.svg(figure)
