"""A run as files: JSON with a published schema, and JUnit XML as continuous integration reads it.

In JUnit a physics `fail` is a failure, what gave no gradable answer (crashed, timed-out, wrong-format, error,
indeterminate) is an error, and declined, unsupported and known failures are skipped with their reason.
`python -m conformance.suite.reports > docs/check.schema.json` prints the schema of the JSON report.
"""

from __future__ import annotations

import json
import re
from typing import Any
from xml.etree import ElementTree

import msgspec

from conformance.grading.grade import PrecisionClass
from conformance.suite.result import VERDICTS, Result, Run, Speed
from conformance.suite.scope import Scope
from scene.protocol.messages import Introduction

TAGS = {"failures": "failure", "errors": "error", "skipped": "skipped"}  # of JUnit, by what counts them
# What XML 1.0 cannot hold, even escaped.
_UNPRINTABLE = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


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
    root = ElementTree.Element("testsuites", name=_printable(f"mushrooms check {name}"))
    totals = dict.fromkeys(("tests", *TAGS), 0)
    for group in run.groups():
        results = [result for result in run.results if result.group == group]
        suite = ElementTree.SubElement(root, "testsuite", name=group)
        tags = [_add_case(suite, result) for result in results]
        counted = {"tests": len(tags), **{name: tags.count(tag) for name, tag in TAGS.items()}}
        totals = {key: totals[key] + counted[key] for key in totals}
        seconds = sum(result.seconds for result in results)
        suite.attrib |= {key: str(value) for key, value in counted.items()} | {"time": f"{seconds:.3f}"}
        if group == "protocol" and run.stderr:
            ElementTree.SubElement(suite, "system-err").text = _printable(run.stderr)
    root.attrib |= {key: str(value) for key, value in totals.items()} | {"time": f"{run.seconds:.3f}"}
    ElementTree.indent(root)
    return bytes(ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)) + b"\n"


def _add_case(suite: ElementTree.Element, result: Result) -> str:
    attributes = {
        "classname": f"mushrooms.{result.group}",
        "name": result.id,
        "time": f"{result.seconds:.3f}",
    }
    case = ElementTree.SubElement(suite, "testcase", attributes)
    tag, message = _junit_tag(result), f"{result.verdict}: {result.why}" if result.why else result.verdict
    if tag:
        if result.is_known:
            message = f"known failure, {message}"
        element = ElementTree.SubElement(case, tag, message=_printable(message))
        if tag != "skipped":
            element.set("type", result.verdict)
            element.text = _printable(json.dumps(result.answer)) if result.answer is not None else None
    return tag


def _junit_tag(result: Result) -> str:
    if result.is_known:
        return "failure" if result.verdict == "pass" else "skipped"
    if result.verdict in ("declined", "unsupported"):
        return "skipped"
    return {"pass": "", "fail": "failure"}.get(result.verdict, "error")


def _printable(text: str) -> str:
    return _UNPRINTABLE.sub("\ufffd", text)


if __name__ == "__main__":
    print(json.dumps(json_schema(), indent=2, ensure_ascii=False))
