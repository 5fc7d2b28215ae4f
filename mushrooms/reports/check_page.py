"""The HTML report of a conformance run: one self-contained page, no scripts, figures embedded.

It shows the verdicts by group, the worst cases with the implementation's path drawn over the certified
one, the errors by precision class, and the implementation's point in the plane of speed and error.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib import rc_context

from conformance import vectors
from conformance.grading.agreement import FAIR, SHARP
from conformance.suite import reports
from conformance.suite.result import Result, Run
from conformance.vectors import Vector
from mushrooms.figures import case
from mushrooms.figures import style as plots
from mushrooms.reports.page import embed, render
from scene import BadInput

N_FAILED, N_SHARPEST = 8, 4  # cases drawn: those that failed, or else the least precise that passed
MAX_LISTED = 200
EXACT = 1e-2  # ulps at which answers with no error at all are drawn


def to_html(run: Run) -> bytes:
    """Return the page."""
    report = reports.new_report(run)
    seen = [verdict for verdict in report.total.counts if verdict == "pass" or report.total.counts[verdict]]
    others = [r for r in run.results if r.verdict != "pass" or r.is_known]
    by_id = {vector.id: vector for vector in vectors.load(run.level)}
    cases = [_case(result, by_id[result.id]) for result in _worst(run) if result.id in by_id]
    page = render(
        "check.html.jinja",
        report=report,
        seen=seen,
        further=[r for r in run.results if r.group in ("property", "profile")],
        others=others[:MAX_LISTED],
        n_unlisted=max(0, len(others) - MAX_LISTED),
        cases=cases,
        drawn={shown["result"].id for shown in cases},
        legend=case.LEGEND,
        errors=embed(_errors(run)) if run.ulps() else "",
        speed=embed(_speed(run)) if run.speed and run.ulps() else "",
        sharp=SHARP,
        fair=FAIR,
    )
    return page.encode("utf-8")


def _worst(run: Run) -> list[Result]:
    failed = [r for r in run.results if r.verdict in ("fail", "indeterminate") and r.answer is not None]
    if failed:
        return failed[:N_FAILED]
    passed = [r for r in run.results if r.verdict == "pass" and r.relative is not None]
    return sorted(passed, key=lambda r: math.inf if r.ulps is None else r.ulps, reverse=True)[:N_SHARPEST]


def _case(result: Result, vector: Vector) -> dict[str, Any]:
    try:
        figure = embed(case.paths(result, vector))
    except BadInput:  # a vector whose scene must be refused has no table to draw
        figure = ""
    return {"result": result, "vector": vector, "figure": figure, "rows": _rows(result)}


def _rows(result: Result) -> list[tuple[str, str, str]]:
    """Return the fields of a failure: name, certified, given; its reason stands in the caption."""
    certified, given = result.expected or {}, result.given or {}
    names = [
        name
        for name in dict.fromkeys([*certified, *given])
        if certified.get(name) != given.get(name) and name != "reason"
    ]
    return [(name, _cell(certified.get(name)), _cell(given.get(name))) for name in names]


def _cell(value: Any) -> str:
    return "–" if value is None else f"{value:.17g}" if isinstance(value, float) else str(value)


@rc_context(plots.STYLE)
def _errors(run: Run) -> bytes:
    """Draw the backward ulps of every passing answer, by group, with the bounds of the classes."""
    groups = [group for group in run.groups() if run.ulps(group)]
    figure, axes = plots.new_figure(7.2, 0.9 + 0.24 * len(groups))
    for row, group in enumerate(groups):
        ulps = np.maximum([u for u in run.ulps(group) if math.isfinite(u)], EXACT)
        axes.plot(ulps, np.full(len(ulps), row), linestyle="none", marker="o", markersize=3.5, alpha=0.5)
    _mark_classes(axes, axes.axvline)
    axes.set(xscale="log", xlabel="backward ulps of the answers that passed", ylim=(len(groups) - 0.5, -0.5))
    axes.set_yticks(range(len(groups)), groups)
    for lines in axes.lines[: len(groups)]:
        lines.set_color(plots.BLUE)
    return plots.svg(figure)


@rc_context(plots.STYLE)
def _speed(run: Run) -> bytes:
    """Draw the implementation's point: time per collision against the error of its answers."""
    assert run.speed is not None
    ulps = np.maximum([u for u in run.ulps() if math.isfinite(u)], EXACT)
    middle, worst = float(np.median(ulps)), float(ulps.max())
    figure, axes = plots.new_figure(4.8, 3.2)
    axes.plot([run.speed.best_ns] * 2, [middle, worst], color=plots.BLUE, linewidth=1.5)
    axes.plot(run.speed.best_ns, worst, marker="v", color=plots.BLUE, linestyle="none", label="worst")
    axes.plot(run.speed.best_ns, middle, marker="o", color=plots.BLUE, linestyle="none", label="median")
    _mark_classes(axes, axes.axhline)
    axes.set(xscale="log", yscale="log", xlim=(run.speed.best_ns / 30, run.speed.best_ns * 30))
    axes.set(xlabel=f"ns per collision on {run.speed.scene}", ylabel="backward ulps")
    axes.legend(frameon=False)
    return plots.svg(figure)


def _mark_classes(axes: Any, line: Any) -> None:
    for bound, name in ((SHARP, "A"), (FAIR, "B")):
        line(bound, color=plots.ORANGE, linewidth=1, linestyle="--", label=f"class {name} ends")
