"""The benchmark's page: the plots, and the numbers behind them."""

from __future__ import annotations

import base64
import math
import statistics
from collections.abc import Sequence
from importlib import resources
from typing import Any

import jinja2

from conformance.bench.hard_cases import cell
from conformance.bench.record import Point, Record
from mushrooms import __version__
from mushrooms.figures import speed as figures_of_speed


def to_html(record: Record) -> bytes:
    """Return the page."""
    environment = jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    text = (resources.files("mushrooms.reports") / "bench.html.jinja").read_text("utf-8")
    page = environment.from_string(text).render(
        record=record,
        version=__version__,
        speed=_embed(figures_of_speed.speed(record)),
        growth=_embed(figures_of_speed.growth(record.growth)),
        work=_embed(figures_of_speed.work(record.work.series)),
        rows=[_row(p) for p in record.points],
        steppers=list(record.hard_cases[0].verdicts),
        cell=cell,
        clock=statistics.median(record.clock_ns),
    )
    return page.encode("utf-8")


def _row(p: Point) -> dict[str, Any]:
    ns = statistics.median(p.ns)
    return {
        "point": p,
        "ns": f"{ns:,.0f}" if ns >= 100 else f"{ns:.1f}",
        "spread": f"{max(p.ns) / min(p.ns) - 1:.0%}",
        "ulps": middle_and_worst(p.ulps, ".2g"),
        "relative": middle_and_worst(p.relative, ".1e"),
    }


def middle_and_worst(errors: Sequence[float | None], form: str) -> tuple[str, str]:
    """Return the median and the worst error as text; None stands for an infinite one."""
    if not errors:
        return "–", "–"
    numbers = [math.inf if e is None else e for e in errors]
    return f"{statistics.median(numbers):{form}}", f"{max(numbers):{form}}"


def _embed(svg: bytes) -> str:
    return "data:image/svg+xml;base64," + base64.b64encode(svg).decode("ascii")
