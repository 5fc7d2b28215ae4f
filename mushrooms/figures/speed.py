"""Figures of the benchmark: speed against error, error growth, cost against work."""

from __future__ import annotations

import math
import statistics
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, NullLocator

from conformance.bench.record import CostSeries, Growth, Point, Record, quartiles
from mushrooms.figures import style as plots

COLOURS = {
    "proof": plots.ORANGE,
    "compiled": plots.BLUE,
    "interpreted": plots.GREEN,
    "time-stepping": plots.GREY,
    "fixed-step": "#8C6D1F",
    "lean": plots.BLACK,
    "example": "#CC79A7",
    "command": "#7A3E9D",
}
WORDS = {
    "proof": "proof (reference)",
    "compiled": "fast",
    "interpreted": "plain Python",
    "time-stepping": "scipy solve_ivp with events",
    "fixed-step": "time steps of 1/10 to 1/1000 flight, in C",
    "lean": "Newton without checks, in C and numba",
    "example": "examples in C, JavaScript, Python",
    "command": "command",
}
RED = "#C00000"
CHARACTER, LINE = 0.035, 0.4  # sizes of labels, in decades of the axes
MOST_DIGITS, LEAST_DIGITS = 300.0, 0.5
BINARY64 = 53 * math.log10(2)
TICKS = (1, 2, 4, 8, 16, 32, 64, 128, 256)


def digits(error: float) -> float:
    """Return correct digits for a relative error: an exact binary64 answer has all of its own."""
    return min(max(-math.log10(error), LEAST_DIGITS), MOST_DIGITS) if error > 0 else BINARY64


@rc_context(plots.STYLE)
def speed(record: Record) -> bytes:
    """Draw time per collision against correct digits, one panel per workload."""
    n_rows = (len(record.workloads) + 1) // 2
    figure, axes = plots.new_figure(10.5, 2.8 * n_rows, n_rows, 2)
    axes = np.atleast_2d(axes)
    panels = axes.ravel()
    for panel in panels[len(record.workloads) :]:
        panel.set_visible(False)
    for panel, workload in zip(panels, record.workloads, strict=False):
        points = [p for p in record.points if p.workload == workload.name]
        _panel(panel, points, record.digits)
        panel.set_title(f"{workload.name}: {workload.what}", loc="left")
    for panel in axes[-1]:
        panel.set_xlabel("correct digits of dt, place and velocity (−log₁₀ relative error)")
    for panel in axes[:, 0]:
        panel.set_ylabel("ns per collision")
    figure.legend(handles=_legend(record), loc="outside upper left", ncols=3)
    return plots.svg(figure)


def _panel(axes: Any, points: list[Point], floor: int) -> None:
    axes.set(xscale="log", yscale="log", xlim=(LEAST_DIGITS / 1.25, MOST_DIGITS * 1.6), ylim=(10, 3e9))
    axes.xaxis.set_major_locator(FixedLocator(TICKS))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xticklabels([str(n) for n in TICKS])
    axes.axvspan(floor, MOST_DIGITS * 1.6, color=plots.BLACK, alpha=0.12, linewidth=0)
    axes.axvline(BINARY64, color=plots.BLACK, linewidth=0.8, linestyle=":")
    for p in points:
        _mark(axes, p)
    _label(axes, points)
    front = pareto(points)
    if front:
        digits_of, times = zip(*front, strict=True)
        # To be right to so many digits, so much time is needed.
        x, y = [LEAST_DIGITS, *digits_of], [times[0], *times]
        axes.step(x, y, where="pre", color=plots.BLACK, linewidth=0.8, zorder=0)


def _mark(axes: Any, p: Point) -> None:
    colour, (first, ns, third) = COLOURS[p.family], quartiles(p.ns)
    middle, worst = _digits_of(p)
    if p.right:
        axes.plot([middle, middle], [first, third], color=colour, marker="_", markersize=5, linewidth=0.8)
        axes.plot([worst, middle], [ns, ns], color=colour, linewidth=1.2)
        axes.plot(middle, ns, marker="o", markersize=4.5, color=colour, linestyle="none")
        axes.plot(worst, ns, marker="<", markersize=4.5, color=colour, linestyle="none")
    if p.wrong or p.astray:
        axes.plot(LEAST_DIGITS, ns, marker="x", markersize=6, color=RED, linestyle="none")


def _label(axes: Any, points: list[Point]) -> None:
    """Name the points: the proofs by their digits, the time-stepping ones at once."""
    style = {"fontsize": 7, "annotation_clip": True}
    slow = [p for p in points if p.family == "time-stepping"]
    if slow:
        ns = statistics.median(statistics.median(p.ns) for p in slow)
        shares = [p.wrong / (p.wrong + p.right + p.undecided) for p in slow]
        wrong = f"\n{max(shares):.0%} of walls wrong" if max(shares) else ""
        place = (min(_digits_of(p)[0] for p in slow) / 1.15, ns)
        side = "left" if place[0] < 1 else "right"
        axes.annotate(
            f"solve_ivp{wrong}", place if side == "right" else (0.6, 2.5 * ns), ha=side, va="bottom",
            color=COLOURS["time-stepping"], **style,
        )  # fmt: skip
    taken: list[tuple[float, float, float]] = []  # from and to which digits, and how high, in decades
    for p in sorted(points, key=lambda p: statistics.median(p.ns)):
        middle, worst = _digits_of(p)
        ns, colour = statistics.median(p.ns), COLOURS[p.family]
        if p.family == "proof":
            axes.annotate(short_name(p.contender), (middle, ns * 1.6), ha="center", color=colour, **style)
        elif p.family != "time-stepping":
            name = short_name(p.contender)
            if p.astray:
                name += f": {100 * p.astray / p.further:.2g} % wrong"
            is_left = p.family in ("example", "command") or (p.family == "lean" and middle < BINARY64 / 2)
            x, width = math.log10(worst / 1.15 if is_left else middle * 1.15), CHARACTER * len(name)
            low, high = (x - width, x) if is_left else (x, x + width)
            height = math.log10(ns)
            for other_low, other_high, other_height in sorted(taken, key=lambda place: place[2]):
                if low < other_high and other_low < high and abs(height - other_height) < LINE:
                    height = max(height, other_height + LINE)
            taken.append((low, high, height))
            side = "right" if is_left else "left"
            axes.annotate(name, (10**x, 10**height), ha=side, va="center", color=colour, **style)


def _digits_of(p: Point) -> tuple[float, float]:
    """Return the correct digits of the median and of the worst right answer."""
    if not p.relative:
        return LEAST_DIGITS, LEAST_DIGITS
    return digits(statistics.median(p.relative)), digits(max(p.relative))


def pareto(points: list[Point]) -> list[tuple[float, float]]:
    """Return (worst digits, ns) of the contenders that none beats in both, from the fastest on.

    Only a contender with no wrong answer and most of them right can stand on the front.
    """
    able = [p for p in points if p.right > p.undecided + p.left and not p.wrong and not p.astray]
    pairs = sorted((statistics.median(p.ns), -digits(max(p.relative))) for p in able)
    front: list[tuple[float, float]] = []
    for ns, minus_digits in pairs:
        if not front or -minus_digits > front[-1][0]:
            front.append((-minus_digits, ns))
    return front


def short_name(contender: str) -> str:
    """Return a contender's label."""
    for part in ("proof, ", " digits", "fast, ", "solve_ivp, ", "example in ", "command ", "steps, flight"):
        contender = contender.replace(part, "1" if part == "steps, flight" else "")
    contender = contender.replace("$", r"\$")  # no formula
    return contender if len(contender) < 18 else contender[:17] + "…"


def _legend(record: Record) -> list[Line2D]:
    families = [f for f in COLOURS if any(p.family == f for p in record.points)]
    handles = [Line2D([], [], color=COLOURS[f], marker="o", markersize=4.5, label=WORDS[f]) for f in families]
    none: dict[str, Any] = {"linestyle": "none"}
    thin: dict[str, Any] = {"color": plots.BLACK, "linewidth": 0.8}
    return [
        *handles,
        Line2D([], [], marker="o", markersize=4.5, label="median", color=plots.BLACK, **none),
        Line2D([], [], marker="<", markersize=4.5, label="worst", color=plots.BLACK, **none),
        Line2D([], [], marker="x", color=RED, label="some walls wrong", **none),
        Line2D([], [], label="front: least time for so many digits, at worst", **thin),
        Line2D([], [], label="binary64; shaded: beyond the proofs", linestyle=":", **thin),
    ]


@rc_context(plots.STYLE)
def growth(found: Growth) -> bytes:
    """Draw errors along trajectories with the Lyapunov slope and the predicted bound."""
    figure, axes = plots.new_figure(7.2, 4.4)
    count = np.arange(1, found.collisions + 1)
    colours = (plots.GREEN, plots.BLUE, "#56B4E9", plots.ORANGE, "#E69F00")
    for (name, errors), colour in zip(found.followers.items(), colours, strict=False):
        shown = np.where(np.array(errors) > 0, errors, np.nan)
        axes.plot(count, shown, color=colour, marker=".", markersize=4, linewidth=1, label=name)
    label = "one ulp a step, grown"
    axes.plot(count, found.bound, color=plots.BLACK, linestyle="--", linewidth=1, label=label)
    early = count[: 2 * (found.collisions // 3)]
    label = f"Lyapunov slope: {found.rate:.2f} decimals a collision"
    axes.plot(early, 10.0 ** (found.rate * (early - 1) - 32), color=plots.GREY, linestyle=":", label=label)
    axes.set(yscale="log", xlabel="collisions", ylabel="error, relative to table and speed", ylim=(1e-60, 10))
    axes.legend(loc="lower right")
    return plots.svg(figure)


@rc_context(plots.STYLE)
def work(series: tuple[CostSeries, ...]) -> bytes:
    """Draw kernel time against particles, cycles, energy and threads."""
    figure, axes = plots.new_figure(10.5, 2.9, 1, len(series))
    panels = np.atleast_1d(axes)
    for panel, one in zip(panels, series, strict=True):
        panel.plot(one.sizes, one.seconds, marker="o", color=plots.BLUE)
        panel.set(xscale="log", yscale="log", xlabel=one.what)
        error = "" if one.error is None else f" ± {one.error:.2f}"
        if one.exponent is not None:
            panel.set_title(f"exponent {one.exponent:.2f}{error}", loc="left")
        if one.what in ("cycles", "threads"):
            panel.xaxis.set_major_locator(FixedLocator(list(one.sizes)))
            panel.xaxis.set_minor_locator(NullLocator())
            panel.set_xticklabels([f"{n:.0f}" for n in one.sizes])
    panels[0].set_ylabel("seconds")
    return plots.svg(figure)
