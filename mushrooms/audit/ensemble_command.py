"""`mushrooms audit --ensemble`: an ensemble of another program, compared with the paper; a page."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib import rc_context

from mushrooms.audit.claim import Check
from mushrooms.audit.ensemble_checks import (
    GivenEnsemble,
    HighEnergies,
    checks,
    expected,
    likely_causes,
    reversal,
)
from mushrooms.audit.ensemble_table import TIMES, UNITS, Reading, read
from mushrooms.audit.options import AuditOptions
from mushrooms.audit.page import expected_text, figures_text, power_text, pull, to_json
from mushrooms.figures import energies
from mushrooms.figures.style import ORANGE, SKY, STYLE, new_figure, svg
from mushrooms.folders import writable_folder
from mushrooms.output import write_report
from mushrooms.reports.page import embed, render
from scene.named import scene_named
from scene.refusal import BadInput
from scene.tables import Mushroom

N_BINS = 50
SIGNS = {True: ("✓", "good"), False: ("✗", "bad"), None: ("?", "open")}
WORDS = {True: "holds", False: "FAILS", None: "open"}


class EnsembleAudit(NamedTuple):
    """What an audit of an ensemble has found, and what it took for granted."""

    given: GivenEnsemble
    checks: list[Check]
    causes: list[str]
    notes: list[str]

    @property
    def verdict(self) -> str:
        """Say what the exit code says."""
        held = [check.holds for check in self.checks]
        return "refuted" if False in held else "indeterminate" if None in held else "confirmed"


def audit_ensemble(path: Path, options: AuditOptions) -> int:
    """Audit an ensemble, write report.json, report.txt and report.html; return the exit code."""
    if options.scene is None:
        raise BadInput("--ensemble needs --scene, the scene that was simulated")
    found = scene_named(options.scene)
    if not isinstance(found, Mushroom) or not found.period:
        raise BadInput(
            f"--scene = {options.scene!r}, must be a mushroom that moves: theory has no other"
        )
    reading = reading_of(options)
    if reading.energy_unit not in UNITS:
        raise BadInput(
            f"--energy-unit = {reading.energy_unit!r}, must be one of {', '.join(UNITS)}"
        )
    if reading.time_unit not in (None, *TIMES):
        raise BadInput(f"--time-unit = {reading.time_unit!r}, must be one of {', '.join(TIMES)}")
    with writable_folder(options.out) as folder:
        result = examine(path, found, options.backwards, reading)
        data = to_data(result, path, options.scene)
        write_report(
            folder, to_json(data), to_text(data), to_html(data, result.given), options.as_json
        )
    return 0 if result.verdict == "confirmed" else 1


def reading_of(options: AuditOptions) -> Reading:
    """Return how the files of an audit are read."""
    return Reading(
        options.energy, options.energy_unit or "v2/2", options.time_unit, options.particles
    )


def examine(
    path: Path, scene: Mushroom, reversed_path: Path | None, reading: Reading
) -> EnsembleAudit:
    """Read an ensemble and check it."""
    given, notes = read(path, scene, reading)
    theirs = expected(scene, given.energy)
    found = checks(given, theirs)
    if reversed_path is not None:
        other, _ = read(reversed_path, scene, reading._replace(particles=None))
        found.append(reversal(given, other, theirs))
    if isinstance(theirs, HighEnergies):
        notes.append(
            "no frozen rates of this scene: finite energy is not in the theory, and"
            f" {theirs.theory_error.mean_s:.2g} is granted for it, a guess by (walls' speed /"
            " v)^(2/3)"
        )
        found = [c._replace(holds=None) if c.holds is False and c.band else c for c in found]
    return EnsembleAudit(given, found, likely_causes(given, theirs, found), notes)


def to_data(result: EnsembleAudit, path: Path, scene_name: str) -> dict[str, Any]:
    """Return the report as plain data."""
    given = result.given
    return {
        "report": 1,
        "ensemble": str(path),
        "scene": scene_name,
        "energy": given.energy,
        "particles": len(given.s),
        "lost": given.n_lost,
        "verdict": result.verdict,
        "notes": result.notes,
        "causes": result.causes,
        "checks": [{**check._asdict(), "pull": pull(check)} for check in result.checks],
    }


def to_html(data: dict[str, Any], given: GivenEnsemble) -> str:
    """Return the page."""
    times = capture_times(given)
    return render(
        "ensemble.html.jinja",
        report=data,
        signs=SIGNS,
        energies=embed(svg(energies.histogram(given.scene, given.energy, given.s))),
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
    axes.stairs(
        np.histogram(t, edges, density=True)[0], edges, fill=True, color=SKY, label="ensemble"
    )
    theirs = expected(given.scene, given.energy)
    if theirs.p_nc < 1:
        mass = np.diff(theirs.capture_cdf(edges)) / np.diff(edges)
        axes.stairs(mass, edges, color=ORANGE, baseline=None, label="theory")
    axes.set(xlabel="time of capture", ylabel="density")
    axes.legend(loc="best")
    return svg(figure)
