"""The audit's report: one self-contained HTML page and the same content as JSON."""

from __future__ import annotations

import base64
import json
import os
import platform
from collections.abc import Mapping
from importlib import resources
from typing import TYPE_CHECKING, Any, NamedTuple

import jinja2
import numba
import numpy as np

import scene as scenes
import theory
from conformance.audit import DIGITS, MAX_LOST, N_SIGMA, Finding, Sample
from conformance.claims import CLAIMS
from mushrooms import __version__, draw, plots

if TYPE_CHECKING:
    from fast import Ensemble


class Audit(NamedTuple):
    """One run of the audit: what was asked for, what was simulated, what was found."""

    n_particles: int
    seed: int
    wall_time: float  # [s]
    ensembles: Mapping[str, Ensemble]
    samples: Mapping[str, Sample]
    findings: list[Finding]

    @property
    def is_passed(self) -> bool:
        """Tell whether every claim has its expected verdict."""
        return all(finding.is_as_expected for finding in self.findings)


def machine() -> dict[str, str | int]:
    """Return what the numbers were computed on."""
    return {
        "platform": platform.platform(),
        "processor": platform.machine(),
        "cores": os.cpu_count() or 0,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "numba": numba.__version__,
    }


def to_data(audit: Audit) -> dict[str, Any]:
    """Return the content of report.json."""
    return {
        "version": __version__,
        "passed": audit.is_passed,
        "particles": audit.n_particles,
        "seed": audit.seed,
        "wall_time_s": round(audit.wall_time, 3),
        "machine": machine(),
        "simulations": [_simulation(name, audit) for name in audit.samples],
        "findings": [_finding(finding) for finding in audit.findings],
    }


def _simulation(name: str, audit: Audit) -> dict[str, Any]:
    sample, ensemble = audit.samples[name], audit.ensembles[name]
    return {
        "scene": name,
        "energy": ensemble.energy0,
        "particles": sample.n_particles,
        "followed": len(sample.s),
        "undecided": sample.n_undecided,
        "undefined": sample.n_undefined,
        "collisions": sample.n_collisions,
        "captured": int(sample.captured.sum()),
        "sigma_w": _number(sample.sigma_w),
        "quantities": {
            quantity: {field: _number(part) for field, part in measured._asdict().items()}
            for quantity, measured in sample.quantities.items()
        },
        "ns_per_collision": _number(ensemble.ns_per_collision()),
        "threads": ensemble.threads,
        "sha256": ensemble.sha256(),
    }


def _finding(finding: Finding) -> dict[str, Any]:
    claim = next(claim for claim in CLAIMS if claim.id == finding.id)
    numbers = {name: _number(getattr(finding, name)) for name in ("simulation", "error", "band")}
    return {
        **finding._asdict(),
        **numbers,
        "as_expected": finding.is_as_expected,
        "where": claim.where,
        "checked": claim.checked,
        "tolerance": claim.tolerance,
    }


def _number(value: float | None) -> float | None:
    # JSON knows no nan.
    return None if value is None or not np.isfinite(value) else float(value)


def to_json(audit: Audit) -> str:
    """Return report.json's text."""
    return json.dumps(to_data(audit), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def to_html(audit: Audit) -> str:
    """Return report.html's text: no scripts, images embedded, nothing loaded from elsewhere."""
    environment = jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    text = (resources.files("mushrooms") / "report.html.jinja").read_text("utf-8")
    return environment.from_string(text).render(
        report=to_data(audit),
        figures=[_figures(name, audit) for name in audit.samples],
        n_sigma=int(N_SIGMA),
        max_lost=MAX_LOST,
        measured=measured_text,
    )


def measured_text(finding: Mapping[str, Any]) -> str:
    """Return `value ± standard error` of a finding, or a dash."""
    if finding["simulation"] is None or finding["error"] is None:
        return "–"
    return f"{finding['simulation']:.5f} ± {finding['error']:.5f}"


def _figures(name: str, audit: Audit) -> dict[str, Any]:
    scene, sample, ensemble = scenes.load(name), audit.samples[name], audit.ensembles[name]
    prediction = theory.predict(scene, DIGITS)
    t_in = ensemble.t_in[ensemble.outcome == 0].ravel()
    return {
        "scene": name,
        "notes": scene.notes,
        "table": _embed(plots.svg(draw.new_strip(scene, 6.4, 5.2))),
        "loop": _embed(plots.svg(plots.loop(scene))),
        "energies": _embed(plots.svg(plots.energies(scene, sample, prediction))),
        "capture_times": _embed(plots.svg(plots.capture_times(scene, t_in[~np.isnan(t_in)], len(sample.s)))),
    }


def _embed(svg: bytes) -> str:
    return "data:image/svg+xml;base64," + base64.b64encode(svg).decode("ascii")
