"""The report of an ensemble's audit: verdict, likely causes, every check; as a page with figures, as text."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib import rc_context

from conformance.audit.ensemble import GivenEnsemble, expected
from mushrooms.figures import energies
from mushrooms.figures.style import ORANGE, SKY, STYLE, new_figure, svg
from mushrooms.reports.audit_page import expected_text, figures_text, power_text
from mushrooms.reports.page import embed, render

N_BINS = 50
MOST_DRAWN = 1_000_000  # values that a histogram is of; of more, evenly spaced ones
SIGNS = {True: ("✓", "good"), False: ("✗", "bad"), None: ("?", "open")}
WORDS = {True: "holds", False: "FAILS", None: "open"}


def to_html(data: dict[str, Any], given: GivenEnsemble) -> str:
    """Return the page."""
    gain = given.s[:: 1 + (len(given.s) - 1) // MOST_DRAWN]
    first = svg(energies.histogram(given.scene, given.energy, gain))
    times = capture_times(given)
    return render(
        "ensemble.html.jinja",
        report=data,
        signs=SIGNS,
        energies=embed(first),
        times=embed(times) if times else None,
    )


def to_text(data: dict[str, Any]) -> str:
    """Return the report as lines."""
    lines = [
        f"{data['ensemble']} against {data['scene']}: {data['verdict']}",
        f"{data['particles']:,} particles, {data['lost']:,} without an energy",
        *(f"note: {note}" for note in data["notes"]),
    ]
    for check in data["checks"]:
        found = f"{figures_text(check)}, must be {expected_text(check)}"
        found += f"; left out {check['band']:.2g}" if check["band"] else ""
        found += f"; pull {check['pull']:+.1f}" if check["pull"] is not None else ""
        found += f"; detects {power_text(check)}" if check["sees"] is not None else ""
        lines.append(f"{WORDS[check['holds']]:5}  {check['what']}: {found}")
    lines += [f"likely cause: {cause}" for cause in data["causes"]]
    if data["verdict"] == "refuted" and not data["causes"]:
        lines.append("likely cause: none of those that are known")
    return "\n".join(lines) + "\n"


@rc_context(STYLE)
def capture_times(given: GivenEnsemble) -> bytes | None:
    """Draw when particles were captured, with theory over it; None where nothing tells."""
    t = np.empty(0) if given.t_in is None else given.t_in[np.isfinite(given.t_in)]
    if len(t) < 2 or t.min() == t.max():
        return None
    figure, axes = new_figure(4.8, 3.2)
    edges = np.linspace(t.min(), t.max(), N_BINS + 1)
    axes.stairs(np.histogram(t, edges, density=True)[0], edges, fill=True, color=SKY, label="ensemble")
    theirs = expected(given.scene, given.energy)
    if theirs.p_nc < 1:
        mass = np.diff(theirs.capture_cdf(edges)) / np.diff(edges)
        axes.stairs(mass, edges, color=ORANGE, baseline=None, label="theory")
    axes.set(xlabel="time of capture", ylabel="density")
    axes.legend(loc="best")
    return svg(figure)
