"""The benchmark's page: the plots, and the numbers behind them."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from typing import Any

from conformance.bench.record import Point, Record, quartiles
from mushrooms.figures import speed as figures_of_speed
from mushrooms.reports.page import embed, render
from scene.refusal import BadInput

ALL = "all"  # workloads, in one table
BESIDE = "moving-cap-1e7"  # what its times are compared with


def to_html(record: Record, speed: bytes) -> bytes:
    """Return the page; `speed` is its first picture, as SVG."""
    page = render(
        "bench.html.jinja",
        record=record,
        speed=embed(speed),
        growth=embed(figures_of_speed.growth(record.growth)),
        rows=[_row(p) for p in record.points],
    )
    return page.encode("utf-8")


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
    rows = [head, ("---",) * len(head)]
    rows += [
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
    return _as_table(rows)


def _by_workload(record: Record) -> str:
    """Return what a collision takes in the lanes on each workload that they serve, beside the lean C."""
    ns = {(p.workload, p.solver): statistics.median(p.ns) for p in record.points}
    head = ("workload", "lanes, ns per collision", f"beside {BESIDE}", "lean C over lanes")
    rows = [head, ("---",) * len(head)]
    for name in (w.name for w in record.workloads):
        lanes, lean = (ns.get((name, solver)) for solver in ("fast, lanes", "lean C"))
        if lanes is not None:
            usual = ns.get((BESIDE, "fast, lanes"))
            parts = [None if usual is None else lanes / usual, None if lean is None else lean / lanes]
            rows.append((name, f"{lanes:,.0f}", *("–" if x is None else f"{x:.2g}" for x in parts)))
    return _as_table(rows)


def _as_table(rows: Sequence[Sequence[str]]) -> str:
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def astray(p: Point) -> str:
    """Return how many further steps met a wrong wall, as text: "12 of 2,000 (0.6 %)"."""
    return f"{p.astray:,} of {p.further:,} ({100 * p.astray / p.further:.2g} %)" if p.further else "–"


def middle_and_worst(errors: Sequence[float | None], form: str) -> tuple[str, str]:
    """Return the median and the worst error as text; None stands for an infinite one."""
    if not errors:
        return "–", "–"
    numbers = [math.inf if e is None else e for e in errors]
    return f"{statistics.median(numbers):{form}}", f"{max(numbers):{form}}"
