"""A diagnosis of failures: the mutants of the plain stepper that fail the same vectors.

Every mutant has one known fault, and the kill matrix says which vectors it fails. A stepper that fails the
same ones, of those that it was asked, probably has the same fault, or one near it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from importlib import resources

from conformance.cases.generated import GROUP as FRESH
from conformance.suite.disguise import DRAWN
from conformance.suite.result import Result

ALIKE = 0.5  # least correlation of two verdicts over the vectors asked
NEARLY = 0.9  # of the likest one's correlation, that another must have to be named beside it
MAX_NAMED = 3


def diagnose(results: Sequence[Result]) -> list[str]:
    """Name the mutants that fail most like this, one line each, the likest first; nothing without a likeness.

    Args:
        results: of a run; failures and passes of vectors count, of those that the mutants were asked.
    """
    kept = [r for r in results if r.level and r.group not in (DRAWN, FRESH)]
    failed = {r.id for r in kept if r.verdict == "fail"}
    asked = failed | {r.id for r in kept if r.verdict == "pass"}
    # Where nothing passed, every mutant that has the same vectors wrong is as like as any other.
    if not failed or failed == asked:
        return []
    matrix = json.loads((resources.files("conformance") / "mutants" / "kill-matrix.json").read_bytes())
    killed: dict[str, set[str]] = {name: set() for name in matrix["mutants"]}
    for vector, names in matrix["killed_by"].items():
        for name in names if vector in asked else ():
            killed[name].add(vector)
    scores = {name: _correlation(failed, own, len(asked)) for name, own in killed.items()}
    likest = sorted(scores, key=lambda name: -scores[name])[:MAX_NAMED]
    return [
        f"like {name} on {len(failed & killed[name])} of {len(failed)} failures (it has"
        f" {len(killed[name])}): {matrix['mutants'][name]['fault']}"
        for name in likest
        if scores[name] >= max(ALIKE, NEARLY * scores[likest[0]])
    ]


def _correlation(failed: set[str], killed: set[str], n: int) -> float:
    """Return the correlation of two failures over n vectors: what neither fails counts too.

    Without it a mutant that fails everything would be like every stepper that fails much.
    """
    both, neither = len(failed & killed), n - len(failed | killed)
    one, other = len(failed) - both, len(killed) - both
    spread = len(failed) * len(killed) * (neither + one) * (neither + other)
    return (both * neither - one * other) / math.sqrt(spread) if spread else float(failed == killed)
