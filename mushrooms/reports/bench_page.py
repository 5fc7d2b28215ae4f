"""The pages and figures of the benchmark: speed against error, error growth, numbers."""

import math
import statistics
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from conformance.bench.record import Growth, Point, Record, quartiles
from mushrooms.figures import style as plots
from mushrooms.reports.page import embed, render
from scene import BadInput

ALL = "all"  # workloads, in one table
HEADLINE = "moving-cap-1e7"  # a first look; its times are what the others are compared with


def to_html(record: Record, speed: bytes) -> str:
    """Return the page; `speed` is its first picture, as SVG."""
    return render(
        "bench.html.jinja",
        record=record,
        speed=embed(speed),
        growth=embed(growth(record.growth)),
        rows=[_row(p) for p in record.points],
    )


def _row(p: Point) -> dict[str, Any]:
    first, ns, third = (f"{q:,.0f}" if q >= 100 else f"{q:.1f}" for q in quartiles(p.ns))
    return {
        "point": p,
        "ns": ns,
        "quartiles": f"{first} to {third}",
        "astray": astray(p),
        "ulps": middle_and_worst(p.ulps, ".2g"),
        "relative": middle_and_worst(p.relative, ".1e"),
    }


def to_markdown(record: Record, workload: str) -> str:
    """Return one workload's table, or of "all" that of the lanes, as the page on speed has them.

    Raises:
        BadInput: the record has no such workload.
    """
    names = [w.name for w in record.workloads]
    if workload not in [*names, ALL]:
        raise BadInput(f"workload = {workload!r}, must be {ALL} or one of {', '.join(names)}")
    if workload == ALL:
        return _by_workload(record)
    head = (
        "stepper",
        "ns per collision",
        "worst backward ulps",
        "worst relative error",
        "wrong walls",
        "of further steps",
    )
    rows = [
        (
            p.solver.replace("|", "\\|"),
            f"{statistics.median(p.ns):,.0f}",
            middle_and_worst(p.ulps, ".2g")[1],
            middle_and_worst(p.relative, ".0e")[1],
            f"{p.wrong} of {record.questions}",
            astray(p),
        )
        for p in record.points
        if p.workload == workload
    ]
    return _as_table(head, rows)


def _by_workload(record: Record) -> str:
    """Return what a collision takes in the lanes on each workload that they serve.

    The lean C stands beside it.
    """
    ns = {(p.workload, p.solver): statistics.median(p.ns) for p in record.points}
    head = ("workload", "lanes, ns per collision", f"beside {HEADLINE}", "lean C over lanes")
    rows = []
    for name in (w.name for w in record.workloads):
        lanes, lean = (ns.get((name, solver)) for solver in ("fast, lanes", "lean C"))
        if lanes is not None:
            usual = ns.get((HEADLINE, "fast, lanes"))
            parts = [
                None if usual is None else lanes / usual,
                None if lean is None else lean / lanes,
            ]
            rows.append((name, f"{lanes:,.0f}", *("–" if x is None else f"{x:.2g}" for x in parts)))
    return _as_table(head, rows)


def _as_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    return "".join(f"| {' | '.join(row)} |\n" for row in (head, ("---",) * len(head), *rows))


def astray(p: Point) -> str:
    """Return how many further steps met a wrong wall, as text: "12 of 2,000 (0.6 %)"."""
    return (
        f"{p.astray:,} of {p.further:,} ({100 * p.astray / p.further:.2g} %)" if p.further else "–"
    )


def middle_and_worst(errors: Sequence[float | None], form: str) -> tuple[str, str]:
    """Return the median and the worst error as text; None stands for an infinite one."""
    if not errors:
        return "–", "–"
    numbers = [math.inf if e is None else e for e in errors]
    return f"{statistics.median(numbers):{form}}", f"{max(numbers):{form}}"


# Contrast with white is 4.5 to 1 and more; families differ by their marks too, whatever colours one
# sees.
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
# What the steppers are called in one panel for a first look.
NAMED = {
    "fast, lanes": "fast, many particles",
    "fast, a call": "fast, a call from Python",
    "fast, pairs": "fast, 31 digits",
    "lean C": "Newton without checks, C",
    "plain Python": "plain Python",
    "solve_ivp, rtol 1e-12": "scipy's solve_ivp",
    "steps, flight/100": "time steps, C",
    "proof, 200 digits": "reference, with proof",
}
# Of their names, by family.
PLACES = {
    "time-stepping": ((-14, 0), "right"),
    "proof": ((6, 14), "right"),
}
LABEL = 9  # size of text [points]
MOST_DIGITS = 300.0
LEAST_DIGITS = 0.5
LEAST_NS = 10.0
BINARY64 = 53 * math.log10(2)
TICKS = (1, 2, 4, 8, 16, 32, 64, 128)


def digits(error: float) -> float:
    """Return correct digits for a relative error: an exact binary64 answer has all of its own."""
    return min(max(-math.log10(error), LEAST_DIGITS), MOST_DIGITS) if error > 0 else BINARY64


@rc_context(plots.STYLE)
def headline(record: Record) -> Figure:
    """Draw time per collision against correct digits of a few steppers on one workload."""
    workload = next((w for w in record.workloads if w.name == HEADLINE), record.workloads[-1])
    points = [
        p
        for p in record.points
        if p.workload == workload.name and (p.solver in NAMED or p.family in ("proof", "command"))
    ]
    figure, axes = plots.new_figure(8.0, 5.0)
    axes.set(
        xscale="log",
        yscale="log",
        xlim=(0.65, record.digits),
        ylim=(LEAST_NS, 1e8),
        xlabel="correct digits of an answer (mark: median; bar: to the worst)",
        ylabel="ns per collision",
        title=f"One core, {workload.name}: {workload.what}",
    )
    axes.set_xticks(TICKS, map(str, TICKS))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.tick_params(labelsize=LABEL)
    axes.axvline(BINARY64, color=plots.BLACK, linewidth=0.8, linestyle=":")
    for p in points:
        _mark(axes, p)
        share = (
            p.astray / p.further if p.further else p.wrong / max(1, p.wrong + p.right + p.undecided)
        )
        name = NAMED.get(p.solver, "" if p.family == "proof" else short_name(p.solver)) + (
            f",\n{100 * share:.1g} % wrong walls" if share else ""
        )
        style: dict[str, Any] = {
            "textcoords": "offset points",
            "va": "center",
            "color": COLOURS[p.family],
        }
        place, style["ha"] = PLACES.get(p.family, ((9, 0), "left"))
        axes.annotate(
            name, (_digits_of(p)[0], statistics.median(p.ns)), place, fontsize=LABEL + 1, **style
        )
    axes.text(BINARY64 * 1.04, 4e7, "binary64", fontsize=LABEL)
    return figure


def _mark(axes: Any, p: Point) -> None:
    colour = COLOURS[p.family]
    first, ns, third = quartiles(p.ns)
    middle, worst = _digits_of(p)
    if p.right:
        axes.plot(
            [middle, middle], [first, third], color=colour, marker="_", markersize=6, linewidth=1.2
        )
        axes.plot([worst, middle], [ns, ns], color=colour, marker="|", markersize=7, linewidth=1.2)
        axes.plot(
            middle, ns, marker=MARKS[p.family], markersize=5.5, color=colour, linestyle="none"
        )


def _digits_of(p: Point) -> tuple[float, float]:
    """Return the correct digits of the median and of the worst right answer."""
    if not p.relative:
        return LEAST_DIGITS, LEAST_DIGITS
    return digits(statistics.median(p.relative)), digits(max(p.relative))


def short_name(solver: str) -> str:
    """Return the label of a command that is measured too."""
    command = solver.removeprefix("command ")
    return plots.plain(command if len(command) < 18 else command[:17] + "…")


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
    for (name, errors), colour, mark in zip(
        found.followers.items(), colours, "os^Dv", strict=False
    ):
        shown = np.where(np.array(errors) > 0, errors, np.nan)
        every = max(1, len(count) // 16)
        axes.plot(
            count,
            shown,
            color=colour,
            marker=mark,
            markevery=every,
            markersize=5,
            linewidth=1,
            label=name,
        )
    axes.plot(
        count,
        found.bound,
        color=plots.BLACK,
        linestyle="--",
        linewidth=1,
        label="one ulp a step, grown",
    )
    early = count[: 2 * (found.collisions // 3)]
    axes.plot(
        early,
        10.0 ** (found.rate * (early - 1) - 32),
        color=plots.GREY,
        linestyle=":",
        label=f"Lyapunov slope: {found.rate:.2f} decimals a collision",
    )
    axes.set(
        yscale="log",
        xlabel="collisions",
        ylabel="error, relative to table and speed",
        ylim=(1e-60, 10),
    )
    axes.legend(loc="lower right")
    return plots.svg(figure)
