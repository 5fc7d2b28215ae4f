"""The audit's report: a self-contained HTML page, the same content as JSON, and a text summary.

docs/report.schema.json defines the fields of report.json.
"""

import json
import math
import os
import platform
import re
from typing import Any

import numba
import numpy as np

import scene as scenes
import theory
from mushrooms import __version__
from mushrooms.audit import figures
from mushrooms.audit.claim import Check, Claim, Finding
from mushrooms.audit.claims.finite_energy import predicted
from mushrooms.audit.runs import Sample, run_seed, scene_of
from mushrooms.audit.session import AuditResult
from mushrooms.audit.tolerances import FAMILY_LEVEL, LEVEL, N_SIGMA, mean, share, spread
from mushrooms.figures import style as plots
from mushrooms.reports.page import embed, render

PAPER = "https://arxiv.org/abs/1305.2624"
# First the paper's claims in its order, then its misprints, then what nobody claimed but must hold.
GROUPS = {
    "Claims, in the paper's order": "XLC",
    "Misprints and gaps": "M",
    "Beyond the paper": "D",
    "Formulas and identities, one by one": "IN",
}
# A verdict has a sign and a word, and coloured: paper right, paper wrong, not decided.
SIGNS = {
    "confirmed": ("✓", "good"),
    "misprint": ("✎", "bad"),
    "false": ("✗", "bad"),
    "not reproducible as stated": ("≁", "bad"),
    "loosely worded": ("≈", "open"),
    "remark": ("§", "open"),
    "inferred": ("∴", "open"),
    "refuted": ("✗", "bad"),
    "indeterminate": ("?", "open"),
}
M1 = "mean of log E1/E0"
P_NC = "share never captured"
# Run, what is measured of it, and what the paper prints: its simulation, and its theory.
MAIN = (
    ("fixed-cap-anticlockwise@1e9", M1, "0.0463 ± 0.0027", "0.044926"),
    ("fixed-cap-anticlockwise@1e9", P_NC, "", "0.843472"),
    ("fixed-cap-clockwise@1e9", M1, "0.0537 ± 0.0034", "0.05252"),
    ("fixed-cap-clockwise@1e9", P_NC, "", "0.717894"),
    ("moving-cap@1e7", M1, "0.1213 ± 0.0033", "0.122768"),
    ("moving-cap@1e7", P_NC, "0.3878", "0.38474"),
)
Data = dict[str, Any]  # as JSON has it
PIXELS_PER_INCH = 104  # of a screen: a figure is shown no larger


def to_data(result: AuditResult) -> Data:
    """Return the content of report.json."""
    pairs = zip(result.claims, result.findings, strict=True)
    return {
        "version": __version__,
        "size": result.settings.size,
        "passed": result.is_passed,
        "seed": result.settings.seed,
        "wall_time_s": round(result.seconds, 3),
        "resumed": result.settings.resume,
        "kernel_time_s": round(sum(sample.seconds for sample in result.samples.values()), 3),
        "machine": {
            "platform": platform.platform(),
            "processor": platform.machine(),
            "cores": os.cpu_count() or 0,
            "python": platform.python_version(),
            "numpy": np.__version__,
            "numba": numba.__version__,
        },
        "false_alarms": {
            "allowed": FAMILY_LEVEL,
            "bound": result.n_tests * LEVEL,
            "tests": result.n_tests,
            "level": LEVEL,
            "standard_errors": N_SIGMA,
        },
        "findings": [_finding(claim, finding) for claim, finding in pairs],
        "runs": [_run(sample, result.settings.seed) for sample in result.samples.values()],
    }


def _finding(claim: Claim, finding: Finding) -> Data:
    return {
        "id": claim.id,
        "where": claim.where,
        "statement": claim.statement,
        "method": claim.method,
        "tolerance": claim.tolerance,
        "verdict": finding.verdict,
        "expected": claim.expected,
        "as_expected": finding.verdict == claim.expected,
        "runs": list(claim.runs),
        "seconds": round(finding.seconds, 3),
        "checks": [_check(check) for check in finding.checks],
    }


def _check(check: Check) -> Data:
    numbers = {
        name: _number(getattr(check, name)) for name in ("value", "error", "band", "sees", "power")
    }
    return check._asdict() | numbers | {"pull": pull(check)}


def pull(check: Check) -> float | None:
    """Return how many standard errors a value is from the number expected.

    None where nothing is random.
    """
    if check.value is None or not check.error:
        return None
    try:
        found = (check.value - float(check.expected)) / check.error
    except ValueError:  # it is held against a bound
        return None
    return found if math.isfinite(found) and math.isfinite(check.error) else None


def _run(sample: Sample, seed: int) -> Data:
    found = mean(sample.gain)
    return {
        "name": sample.run.name,
        "scene": scenes.to_data(scene_of(sample.run)),
        "energy": sample.run.energy,
        "cycles": sample.run.n_cycles,
        "particles": sample.n_particles,
        "phases": list(sample.run.phases),
        "seed": run_seed(seed, sample.run),
        "followed": sample.n,
        "undecided": sample.n_undecided,
        "undefined": sample.n_undefined,
        "collisions": sample.n_collisions,
        "careful": sample.n_careful,
        "captured": float(sample.captured.mean()) if sample.n else 0.0,
        "m1": _number(found.value),
        "m1_error": _number(found.error),
        "sigma_w": _number(spread(sample.gain[~sample.captured]).value),
        "seconds": round(sample.seconds, 3),
        "ns_per_collision": sample.seconds / max(sample.n_collisions, 1) * 1e9,
        "sha256": sample.sha256,
    }


def _number(value: float | None) -> float | None:
    # JSON knows no nan.
    return None if value is None or not np.isfinite(value) else float(value)


def to_json(data: Data) -> str:
    """Return report.json's text."""
    return json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def to_html(data: Data, samples: figures.Samples) -> str:
    """Return report.html's text: no scripts, images embedded, nothing loaded from elsewhere."""
    claims = {finding["id"] for finding in data["findings"]}
    images: dict[str, list[dict[str, str]]] = {}
    for picture in figures.ALL:
        figure = figures.draw_picture(picture, samples) if picture.claim in claims else None
        if figure is not None:
            wide = f"{figure.get_figwidth() * PIXELS_PER_INCH:.0f}px"
            image = {"source": embed(plots.svg(figure)), "caption": picture.caption, "width": wide}
            images.setdefault(picture.claim, []).append(image)
    first = figures.draw_picture(figures.FIRST, samples)
    groups = [
        (title, sorted((f for f in data["findings"] if f["id"][0] in letters), key=_place))
        for title, letters in GROUPS.items()
    ]
    return render(
        "audit.html.jinja",
        report=data,
        headline=headline(samples),
        first=embed(plots.svg(first)) if first else "",
        groups=groups,
        images=images,
        scenes={run["name"].partition("@")[0]: run["scene"] for run in data["runs"]},
        figures_text=figures_text,
        expected_text=expected_text,
        power_text=power_text,
        signs=SIGNS,
        paper=PAPER,
    )


def headline(samples: figures.Samples) -> list[Data]:
    """Return the first screen: the paper's main numbers as printed, as predicted and as simulated.

    `theory_there` is the limit of infinite energy as printed, `limit` the same by our theory.
    `predicted` is by our theory at the run's energy with nothing fitted, `found` by our simulation.
    `pull` is found less predicted, in standard errors.
    """
    rows = []
    for run, quantity, simulated_there, theory_there in MAIN:
        if run not in samples:
            continue
        limit = theory.predict(scene_of(samples[run].run))
        here = predicted(samples[run])
        if quantity == M1:
            value = float(limit.m1)
            expected = here.mean_s
            found = mean(samples[run].gain)
        else:
            value = float(limit.p_nc)
            expected = here.p_nc
            found = share(samples[run].never_captured)
        rows.append(
            {
                "run": run,
                "quantity": quantity,
                "simulated_there": simulated_there,
                "theory_there": theory_there,
                "limit": value,
                "predicted": expected,
                "found": found,
                "pull": (found.value - expected) / found.error,
            }
        )
    return rows


def _place(finding: Data) -> tuple[list[int], str, int]:
    """Return where in the paper a finding belongs: first section, then letter and number."""
    sections = re.findall(r"sec[s]?\. (\d(?:\.\d)*)", finding["where"])
    first = [int(part) for part in sections[0].split(".")] if sections else [9]
    return first, finding["id"][0], int(finding["id"][1:])


def figures_text(check: Data) -> str:
    """Return what a check found: value ± standard error, or its note."""
    if check["value"] is None:
        return str(check["note"])
    if check["error"] is None:
        return f"{check['value']:.4g}" if check["n_tests"] else f"{check['value']:.10g}"
    digits = _digits(check["error"])
    if digits > 7:
        return f"{check['value']:.3g} ± {check['error']:.2g}"
    return f"{check['value']:.{digits}f} ± {check['error']:.{digits}f}"


def expected_text(check: Data) -> str:
    """Return what a check expects; a number to one digit more than the error beside it has."""
    if check["pull"] is None or check["error"] is None:
        return str(check["expected"])
    return f"{float(check['expected']):.{min(_digits(check['error']) + 1, 10)}f}"


def power_text(check: Data) -> str:
    """Return what a check is worth: the smallest departure seen, and its rival's chances."""
    seen = "" if check["sees"] is None else f"{check['sees']:.1g}"
    if check["power"] is None:
        return seen
    p = check["power"]
    return f"{seen}; {check['against']}: {'> 0.999' if p > 0.999 else f'{p:.2g}'}"


def _digits(error: float) -> int:
    """Return the decimals that a number with this error is worth."""
    return max(0, 1 - int(np.floor(np.log10(error)))) if error > 0 else 6


def to_text(data: Data) -> str:
    """Return the summary: one line per claim, then what did not come out as expected."""
    lines = []
    for finding in data["findings"]:
        n_held = sum(
            check["holds"] is True for check in finding["checks"] if check["form"] != "printed"
        )
        n = sum(check["form"] != "printed" for check in finding["checks"])
        mark = " " if finding["as_expected"] else "!"
        lines.append(
            f"{mark} {finding['id']:<4}{finding['verdict']:<28}{n_held:>3}/{n:<4}{finding['where']}"
        )
        if not finding["as_expected"]:
            lines.append(f"      expected: {finding['expected']}")
            # Each check that does not come out as its form asks: what is printed must fail.
            lines += [
                f"      {check['form']}: {check['what']}: {figures_text(check)}, expected"
                f" {check['expected']}"
                for check in finding["checks"]
                if (check["holds"] is not True) != (check["form"] == "printed")
            ]
    n_right = sum(finding["as_expected"] for finding in data["findings"])
    alarms = data["false_alarms"]
    lines += [
        "",
        f"{n_right} of {len(data['findings'])} claims have their expected verdict."
        f" {alarms['tests']} comparisons with random data at {alarms['standard_errors']:.2f}"
        f" standard errors: a false alarm in fewer than {alarms['bound']:.1e} of audits.",
    ]
    return "\n".join(lines) + "\n"
