"""A run as files: JSON with a published schema, JUnit XML, and what an author publishes: a badge, a summary.

In JUnit a physics `fail` is a failure, what gave no gradable answer (crashed, timed-out, wrong-format, error,
indeterminate) is an error, and declined, unsupported and known failures are skipped with their reason.
A badge (SVG) and a summary (JSON) have the verdict's scope; the summary also holds the four fields that
shields.io asks of an endpoint, which makes a badge of them.
`python -m conformance.suite.reports > docs/check.schema.json` prints the schema of the JSON report.
"""

import json
import re
from typing import Any
from xml.sax.saxutils import escape

import msgspec
from jinja2 import Template

from conformance.grading.agreement import PrecisionClass
from conformance.suite.result import VERDICTS, Result, Run, Scope, Speed
from scene.protocol.messages import Introduction

TAGS = {"failures": "failure", "errors": "error", "skipped": "skipped"}  # of JUnit, by what counts them
# What XML 1.0 cannot hold, even escaped.
_UNPRINTABLE = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_JUNIT = Template(
    """\
<?xml version="1.0" encoding="utf-8"?>
{% macro counted(cases, seconds) %}
tests="{{ cases | length }}" {% for name, tag in tags.items() %}
{{ name }}="{{ cases | selectattr(1, "equalto", tag) | list | length }}" {% endfor %}
time="{{ "%.3f" | format(seconds) }}"
{%- endmacro %}
<testsuites name="mushrooms check {{ name }}" {{ counted(cases, run.seconds) }}>
{% for group in run.groups() %}
{% set own = cases | selectattr("0.group", "equalto", group) | list %}
  <testsuite name="{{ group }}" {{ counted(own, own | sum(attribute="0.seconds")) }}>
{% for result, tag in own %}
{% set seconds = "%.3f" | format(result.seconds) %}
    <testcase classname="mushrooms.{{ group }}" name="{{ result.id }}" time="{{ seconds }}">
{% if tag %}
      <{{ tag }} message="{{ "known failure, " if result.is_known }}{{ result.verdict }}
{%- if result.why %}: {{ result.why }}{% endif %}"
{%- if tag != "skipped" %} type="{{ result.verdict }}"{% endif %}>
{%- if tag != "skipped" and result.answer is not none %}{{ result.answer | tojson }}{% endif %}</{{ tag }}>
{% endif %}
    </testcase>
{% endfor %}
{% if group == "protocol" and run.stderr %}
    <system-err>{{ run.stderr }}</system-err>
{% endif %}
  </testsuite>
{% endfor %}
</testsuites>
""",
    autoescape=True,
    trim_blocks=True,
    lstrip_blocks=True,
    keep_trailing_newline=True,
    finalize=lambda part: _UNPRINTABLE.sub("\ufffd", part) if type(part) is str else part,
)


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


class Group(msgspec.Struct, frozen=True):
    """The verdicts of one group.

    Attributes:
        group: its name.
        cases: how many there are, asked or not.
        counts: cases by verdict, all nine.
        precision: class A, B or C of the answers that passed, or a dash.
        classes: how many of these answers are of each class.
        worst_ulps: of those; null when not measured or beyond binary64.
    """

    group: str
    cases: int
    counts: dict[str, int]
    precision: str
    classes: dict[PrecisionClass, int]
    worst_ulps: float | None


class Report(msgspec.Struct, frozen=True):
    """The JSON report of a run; `report` is the version of this form, `verdict` the scope in a line."""

    report: int
    command: list[str]
    implementation: Introduction | None
    level: str
    seed: int
    verdict: str
    scope: Scope
    corpus: str
    digest: str
    timeout_s: float
    restarts_allowed: int
    restarts: int
    seconds: float
    exit_code: int
    objections: list[str]
    diagnosis: list[str]
    total: Group
    groups: list[Group]
    speed: Speed | None
    stderr: str
    results: list[Result]


def summarise(run: Run, group: str | None = None) -> Group:
    """Count one group, or everything."""
    counts, ulps = run.counts(group), run.ulps(group)
    worst = max(ulps, default=None)
    return Group(
        group or "all",
        sum(counts.values()),
        {verdict: counts[verdict] for verdict in VERDICTS},
        run.precision(group),
        run.classes(group),
        None if worst == float("inf") else worst,
    )


def new_report(run: Run) -> Report:
    """Return the report of a run; answers are kept where they did not pass."""
    kept = [r if r.verdict != "pass" else msgspec.structs.replace(r, answer=None) for r in run.results]
    same = ("command", "level", "seed", "corpus", "digest", "seconds", "speed", "stderr", "diagnosis")
    return Report(
        report=2,
        verdict=f"{run.verdict()}: {run.scope()}",
        scope=run.scope(),
        **{name: getattr(run, name) for name in same},
        implementation=run.introduction,
        timeout_s=run.limits.timeout,
        restarts_allowed=run.limits.restarts,
        restarts=run.n_restarts,
        exit_code=run.exit_code(),
        objections=run.objections(),
        total=summarise(run),
        groups=[summarise(run, group) for group in run.groups()],
        results=kept,
    )


def to_json(run: Run) -> bytes:
    """Return the JSON report."""
    return msgspec.json.format(msgspec.json.encode(new_report(run)), indent=1) + b"\n"


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of the report, published as docs/check.schema.json."""
    schema = msgspec.json.schema(Report)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "Report", **schema}


def to_junit(run: Run) -> bytes:
    """Return the JUnit XML report: a suite for each group, a case for each vector."""
    name = run.introduction.name if run.introduction else run.command[0]
    cases = [(result, _junit_tag(result)) for result in run.results]
    return str(_JUNIT.render(run=run, name=name, cases=cases, tags=TAGS)).encode()


def _junit_tag(result: Result) -> str:
    if result.is_known:
        return "failure" if result.verdict == "pass" else "skipped"
    if result.verdict in ("declined", "unsupported"):
        return "skipped"
    return {"pass": "", "fail": "failure"}.get(result.verdict, "error")


def _message(run: Run) -> str:
    """Return the few words of a badge: level, corpus and class of what was accepted, or the verdict."""
    if run.exit_code():
        return run.verdict()
    return f"{run.level} {run.corpus}, class {run.precision()}"


def to_badge(run: Run) -> str:
    """Return the badge; its title, which browsers show and screen readers read, is the whole scope."""
    text = _message(run)
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


def to_summary(run: Run) -> bytes:
    """Return the summary as JSON: stepper, verdict, scope, counts, speed, and what shields.io asks for."""
    stepper = run.introduction
    found: dict[str, Any] = {
        "schemaVersion": 1,
        "label": LABEL,
        "message": _message(run),
        "color": COLOURS[run.verdict()].removeprefix("#"),
        "implementation": None if stepper is None else [stepper.name, stepper.version, stepper.language],
        "verdict": run.verdict(),
        "line": str(run.scope()),
        "scope": run.scope(),
        "counts": dict(run.counts()),
        "ns_per_collision": run.speed and run.speed.best_ns,
        "corpus_digest": run.digest,
    }
    return msgspec.json.format(msgspec.json.encode(found), indent=1) + b"\n"


if __name__ == "__main__":
    print(json.dumps(json_schema(), indent=2, ensure_ascii=False))
