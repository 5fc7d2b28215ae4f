"""What an author publishes of a run: a badge (SVG) and a summary (JSON), both with the verdict's scope.

The summary also holds the four fields that shields.io asks of an endpoint, which makes a badge of them.
"""

from __future__ import annotations

from typing import Any
from xml.sax.saxutils import escape

import msgspec

from conformance.suite.result import Run

LABEL = "moving walls"
COLOURS = {"accepted": "#2e7d32", "not accepted": "#b3261e", "undecided": "#8a6d00"}
WIDTH, MARGIN = 6.6, 12  # of a letter at 11 px, and on both sides of a text together [px]
_SVG = """\
<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="20" role="img" aria-label="{title}">
<title>{title}</title>
<rect width="{width:.0f}" height="20" rx="3" fill="#444"/>
<path fill="{colour}" d="M{left:.0f} 0h{right:.0f}a3 3 0 0 1 3 3v14a3 3 0 0 1-3 3h-{right:.0f}z"/>
<g fill="#fff" font-family="Verdana,DejaVu Sans,sans-serif" font-size="11" text-anchor="middle">
<text x="{middle_left:.1f}" y="14">{label}</text>
<text x="{middle_right:.1f}" y="14">{message}</text>
</g>
</svg>
"""


def message(run: Run) -> str:
    """Return the few words of a badge: level, corpus and class of what was accepted, or the verdict."""
    if run.exit_code():
        return run.verdict()
    return f"{run.level} {run.corpus}, class {run.precision()}"


def svg(run: Run) -> str:
    """Return the badge; its title, which browsers show and screen readers read, is the whole scope."""
    text = message(run)
    left, right = WIDTH * len(LABEL) + MARGIN, WIDTH * len(text) + MARGIN
    return _SVG.format(
        width=left + right,
        left=left,
        right=right - 3,
        middle_left=left / 2,
        middle_right=left + right / 2,
        colour=COLOURS[run.verdict()],
        label=LABEL,
        message=escape(text),
        title=escape(f"{LABEL}: {run.verdict()}: {run.scope()}", {'"': "&quot;"}),
    )


def summary(run: Run) -> bytes:
    """Return the summary as JSON: who, verdict, scope, counts, speed, and what shields.io asks for."""
    who = run.introduction
    found: dict[str, Any] = {
        "schemaVersion": 1,
        "label": LABEL,
        "message": message(run),
        "color": COLOURS[run.verdict()].removeprefix("#"),
        "implementation": None if who is None else [who.name, who.version, who.language],
        "verdict": run.verdict(),
        "line": str(run.scope()),
        "scope": run.scope(),
        "counts": dict(run.counts()),
        "ns_per_collision": run.speed and run.speed.best_ns,
        "corpus_digest": run.digest,
    }
    return msgspec.json.format(msgspec.json.encode(found), indent=1) + b"\n"
