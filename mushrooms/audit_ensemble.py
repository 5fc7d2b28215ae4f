"""`mushrooms audit --ensemble`: an ensemble of another program, held to the paper; one page of it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from conformance.audit.claim import Check
from conformance.audit.ensemble import (
    GivenEnsemble,
    checks,
    cycle_start,
    expected,
    likely_causes,
    nu_at,
    reversal,
)
from conformance.audit.runs import scene_named
from conformance.files import write_files
from mushrooms import output
from mushrooms.ensemble_table import read_table
from mushrooms.reports.page import pull
from scene.refusal import BadInput
from scene.tables import Mushroom

ENERGIES = {"v2/2": 1.0, "v2": 0.5}  # what an energy of 1 in a file is as v^2/2
TIMES = ("scene", "cycles")
TOUCH = 0.05  # of a cycle, by which times may lie outside the capture that theory has


class Options(NamedTuple):
    """What the command line says of an ensemble beside its file and its scene."""

    energy: float | None
    energy_unit: str
    time_unit: str | None
    particles: int | None


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


def audit_ensemble(
    path: Path, scene_name: str | None, reversed_path: Path | None, options: Options, out: Path, as_json: bool
) -> int:
    """Audit an ensemble, write report.json, report.txt and report.html; return the exit code."""
    if scene_name is None:
        raise BadInput("--ensemble needs --scene, the scene that was simulated")
    found = scene_named(scene_name)
    if not isinstance(found, Mushroom) or not found.period:
        raise BadInput(f"--scene = {scene_name!r}, must be a mushroom that moves: theory has no other")
    if options.energy_unit not in ENERGIES:
        raise BadInput(f"--energy-unit = {options.energy_unit!r}, must be one of {', '.join(ENERGIES)}")
    if options.time_unit not in (None, *TIMES):
        raise BadInput(f"--time-unit = {options.time_unit!r}, must be one of {', '.join(TIMES)}")
    with output.writable_folder(out) as folder:
        result = examine(path, found, reversed_path, options)
        data = to_data(result, path, scene_name)
        texts = {
            "report.json": json.dumps(data, indent=1, ensure_ascii=False) + "\n",
            "report.txt": to_text(data),
        }
        from mushrooms.reports import ensemble_page  # it draws, and drawing takes a second to import

        write_files(folder, {**texts, "report.html": ensemble_page.to_html(data, result.given)})
    print(texts["report.json" if as_json else "report.txt"], end="")
    if not as_json:
        print(f"Report: {folder / 'report.html'}")
    return 0 if result.verdict == "confirmed" else 1


def examine(path: Path, scene: Mushroom, reversed_path: Path | None, options: Options) -> EnsembleAudit:
    """Read an ensemble and check it."""
    given, notes = read(path, scene, options)
    theirs = expected(scene, given.energy)
    found = checks(given, theirs)
    if reversed_path is not None:
        other, _ = read(reversed_path, scene, options._replace(particles=None))
        found.append(reversal(given, other, theirs))
    if not theirs.has_rates:
        notes.append(
            "no frozen rates of this scene: finite energy is not in the theory, and"
            f" {theirs.bands['mean_s']:.2g} is granted for it, a guess by (walls' speed / v)^(2/3)"
        )
        found = [c._replace(holds=None) if c.holds is False and c.band else c for c in found]
    return EnsembleAudit(given, found, likely_causes(given, theirs, found), notes)


def read(path: Path, scene: Mushroom, options: Options) -> tuple[GivenEnsemble, list[str]]:
    """Return an ensemble in the scene's units, and what was taken for granted."""
    unit = ENERGIES[options.energy_unit]
    energy = None if options.energy is None else options.energy * unit
    table = read_table(path, energy, unit)
    energy = table.energy
    form = options.energy_unit.replace("v2", "v²")
    notes = [f"energies are taken as {form}, lengths in the scene's unit: E0 = {energy:g} as v²/2"]
    if table.n_other:
        notes.append(f"{table.n_other:,} rows of another E0 are left out")
    t_in, t_out, more = _times(scene, table.columns, options.time_unit)
    captured = table.columns.get("captured")
    if captured is None and t_in is not None:
        captured = np.isfinite(t_in)
        more = [*more, "captured are those with a t_in"]
    elif captured is not None:
        _check_flags(path, captured)
    n_lost = table.n_lost
    if options.particles is not None:
        n_there = len(table.sums) + n_lost
        if options.particles < n_there:
            raise BadInput(f"--particles = {options.particles}, must be at least the {n_there} rows")
        n_lost += options.particles - n_there
    x0, y0 = (table.columns.get(name) for name in ("x0", "y0"))
    flags = None if captured is None else captured.astype(bool)
    return (
        GivenEnsemble(
            scene,
            energy,
            table.sums[:, 0],
            flags,
            t_in,
            t_out,
            x0,
            y0,
            n_lost,
            table.is_binary32,
            table.sums[:, 1:] if table.sums.shape[1] > 1 else None,
        ),
        [*notes, *more],
    )


def _check_flags(path: Path, captured: Any) -> None:
    odd = captured[(captured != 0) & (captured != 1)]
    if len(odd):
        raise BadInput(f"--ensemble {str(path)!r}: captured = {odd[0]}, must be 0 or 1")


def _times(scene: Mushroom, columns: dict[str, Any], unit: str | None) -> tuple[Any, Any, list[str]]:
    """Return times of stays in the scene's unit, by what is said or by where theory has captures."""
    t_in, t_out = columns.get("t_in"), columns.get("t_out")
    known = np.empty(0) if t_in is None else t_in[np.isfinite(t_in)]
    if t_in is None or not len(known):
        return t_in, t_out, []
    begin, span = cycle_start(scene), scene.period
    low, high = float(known.min()), float(known.max())
    fitting = [
        name
        for name, size in zip(TIMES, (1.0, span), strict=True)
        if begin - TOUCH * span <= low * size and high * size <= begin + (1 + TOUCH) * span
    ]
    if unit is None:
        if not fitting:
            raise BadInput(
                f"t_in = {low:g} to {high:g}, must be in the cycle, {begin:g} to {begin + span:g} in the"
                " scene's time, or 0 to 1 in cycles: --time-unit says which"
            )
        # A share of a cycle looks like the scene's time too, when nothing is later than 1.
        is_share = "cycles" in fitting and span > 2 and high <= 1 and _falls(scene, known * span, known)
        unit = "cycles" if is_share or "scene" not in fitting else "scene"
        how = "inferred"
    else:
        how = "as said"
    note = (
        f"times are taken {'as parts of a cycle' if unit == 'cycles' else 'in the unit of the scene'}, {how}"
    )
    size = span if unit == "cycles" else 1.0
    return t_in * size, None if t_out is None else t_out * size, [note]


def _falls(scene: Mushroom, times: Any, rather_than: Any) -> bool:
    """Tell whether the mouth narrows over all of some times, and is wider at the first of the others."""
    nu = nu_at(scene, np.quantile(times, (0.02, 0.98)))
    return bool(nu[0] > nu[1]) and float(nu_at(scene, np.array([rather_than.max()]))[0]) > nu[1]


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


def to_text(data: dict[str, Any]) -> str:
    """Return the report as lines."""
    words = {True: "holds", False: "FAILS", None: "open"}
    lines = [f"{data['ensemble']} against {data['scene']}: {data['verdict']}"]
    lines.append(f"{data['particles']:,} particles, {data['lost']:,} without an energy")
    lines += [f"note: {note}" for note in data["notes"]]
    for check in data["checks"]:
        lines.append(f"{words[check['holds']]:5}  {check['what']}: {said(check)}")
    lines += [f"likely cause: {cause}" for cause in data["causes"]]
    if data["verdict"] == "refuted" and not data["causes"]:
        lines.append("likely cause: none of those that are known")
    return "\n".join(lines) + "\n"


def said(check: dict[str, Any]) -> str:
    """Return what was found, what is expected, and what the comparison is worth."""
    if check["value"] is None:
        return f"{check['note']}, must be {check['expected']}"
    parts = [f"{check['value']:.6g}"]
    parts[0] += f" ± {check['error']:.2g}" if check["error"] else ""
    expected_value = check["expected"] if check["error"] is None else f"{float(check['expected']):.6g}"
    parts.append(f"theory {expected_value}" + (f", left out {check['band']:.2g}" if check["band"] else ""))
    parts += [f"pull {check['pull']:+.1f}"] if check["pull"] is not None else []
    parts += [f"would see {check['sees']:.2g}"] if check["sees"] is not None else []
    parts += [f"power {check['power']:.2f} against {check['against']}"] if check["power"] is not None else []
    return "; ".join(parts)
