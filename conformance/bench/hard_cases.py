"""The table of hard cases: for each, what every stepper makes of the corpus's vectors."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping
from itertools import groupby

from conformance import vectors
from conformance.bench.contenders import Ask
from conformance.bench.record import Case, short
from conformance.grading.grade import grade
from conformance.suite.process import Trouble
from conformance.vectors import Vector

GROUP = "hard-case-"
WORDS = {"pass": "right", "declined": "undecided", "fail": "wrong"}


def tabulate(steppers: Mapping[str, Ask], tick: Callable[[str], None]) -> tuple[Case, ...]:
    """Grade all hard cases.

    Args:
        steppers: by name, how each answers a vector.
        tick: called after each case.
    """
    hard = sorted((v for v in vectors.load("stress") if v.group.startswith(GROUP)), key=lambda v: v.group)
    cases = []
    for group, members in groupby(hard, key=lambda v: v.group):
        cases.append(_case(group, list(members), steppers))
        tick("")
    return tuple(cases)


def _case(group: str, members: list[Vector], steppers: Mapping[str, Ask]) -> Case:
    verdicts: dict[str, dict[str, int]] = {}
    ulps: dict[str, float | None] = {}
    for name, ask in steppers.items():
        judged = [_judged(vector, ask) for vector in members]
        verdicts[name] = dict(Counter(WORDS.get(verdict, verdict) for verdict, _ in judged))
        measured = [u for verdict, u in judged if verdict == "pass" and not math.isnan(u)]
        worst = max(measured, default=math.inf)
        ulps[name] = short(worst, 2) if math.isfinite(worst) else None
    return Case(group.removeprefix(GROUP), members[0].rule, len(members), verdicts, ulps)


def _judged(vector: Vector, ask: Ask) -> tuple[str, float]:
    """Return verdict and backward ulps, nan when not measured."""
    try:
        found = grade(vector, ask(vector))
    except Trouble as trouble:
        return trouble.verdict, math.nan
    return found.verdict, found.ulps


def to_markdown(cases: tuple[Case, ...]) -> str:
    """Return the table as Markdown, kept in docs/bench/."""
    names = list(cases[0].verdicts)
    lines = [
        "# Hard cases, by stepper",
        "",
        "Each row is a case of the corpus (`hard-case-NN/*`); a cell says how many of its vectors were",
        "answered right, left undecided or answered wrong, and the worst backward ulps of the right ones.",
        "Where the mathematics gives no answer, `undefined` and `undecided` are both right.",
        "`mushrooms bench` makes this table.",
        "",
        "| case | what | " + " | ".join(name.replace("|", "\\|") for name in names) + " |",
        "|---|---|" + "---|" * len(names),
    ]
    for case in cases:
        cells = [cell(case.verdicts[name], case.ulps[name]) for name in names]
        rule = case.rule.replace("|", "\\|")
        lines.append(f"| {case.case} | {rule} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def cell(verdicts: Mapping[str, int], ulps: float | None) -> str:
    """Return what a stepper made of a case: "5 right, 1 undecided (2.1)"."""
    words = ", ".join(f"{n} {word}" for word, n in sorted(verdicts.items()))
    return words if ulps is None else f"{words} ({ulps:.2g})"
