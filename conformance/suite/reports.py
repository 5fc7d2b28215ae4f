"""A run as files: JSON with a published schema, and JUnit XML as continuous integration reads it.

In JUnit a physics `fail` is a failure, what gave no gradable answer (crashed, timed-out, wrong-format, error,
indeterminate) is an error, and declined, unsupported and known failures are skipped with their reason.
`python -m conformance.suite.reports > docs/check.schema.json` prints the schema of the JSON report.
"""

from __future__ import annotations

import json
import re
from typing import Any

import msgspec
from jinja2 import Template

from conformance.grading.grade import PrecisionClass
from conformance.suite.result import VERDICTS, Result, Run, Speed
from conformance.suite.scope import Scope
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
    return _JUNIT.render(run=run, name=name, cases=cases, tags=TAGS).encode()


def _junit_tag(result: Result) -> str:
    if result.is_known:
        return "failure" if result.verdict == "pass" else "skipped"
    if result.verdict in ("declined", "unsupported"):
        return "skipped"
    return {"pass": "", "fail": "failure"}.get(result.verdict, "error")


if __name__ == "__main__":
    print(json.dumps(json_schema(), indent=2, ensure_ascii=False))
