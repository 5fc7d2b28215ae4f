"""A diagnosis of failures: the mutants of the plain stepper that fail the same vectors.

Every mutant has one known fault, and so have the common mistakes. The kill matrix says which few vectors tell
one from the others. One of whose vectors none passed answers a sample of the run's vectors, and is named
when it fails the same ones.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from importlib import resources

from conformance.generator.fresh import GROUP as FRESH
from conformance.mutants import COMMON, MUTANTS
from conformance.mutants.kill_matrix import kills
from conformance.suite.disguise import DRAWN
from conformance.suite.result import Result
from conformance.vectors import load

N_COMPARED = 20  # failures, and as many passes
ALIKE = 0.5  # least correlation of two verdicts over the vectors compared
NEARLY = 0.9  # of the likest one's correlation, that another must have to be named beside it
MAX_NAMED = 3


def diagnose(results: Sequence[Result]) -> list[str]:
    """Name the mutants that fail most like this, one line each, the likest first; nothing without a likeness.

    Args:
        results: of a run; failures and passes of vectors count, of those that the mutants were asked.
    """
    kept = [r for r in results if r.level and r.group not in (DRAWN, FRESH)]
    failed = [r.id for r in kept if r.verdict == "fail"]
    passed = [r.id for r in kept if r.verdict == "pass"]
    # Where nothing passed, every mutant that has the same vectors wrong is as like as any other.
    if not failed or not passed:
        return []
    matrix = json.loads((resources.files("conformance") / "mutants" / "kill-matrix.json").read_bytes())
    faulty = MUTANTS | COMMON
    told = {name: set(matrix["mutants"][name]["vectors"]) for name in faulty}
    suspects = [name for name, own in told.items() if not own & set(passed)]
    compared = {*_spread(failed), *_spread(passed)}
    vectors = [vector for vector in load("stress") if vector.id in compared]
    failed_too = compared & set(failed)
    killed = {name: set(kills(vectors, faulty[name])) for name in suspects}
    scores = {name: _correlation(failed_too, own, len(vectors)) for name, own in killed.items()}
    likest = sorted(scores, key=lambda name: -scores[name])[:MAX_NAMED]
    return [
        f"like {name} on {len(failed_too & killed[name])} of {len(failed_too)} failures"
        f" (of {len(vectors)} vectors it fails {len(killed[name])}): {faulty[name].fault}"
        for name in likest
        if scores[name] >= max(ALIKE, NEARLY * scores[likest[0]])
    ]


def _spread(ids: Sequence[str]) -> list[str]:
    """Return N_COMPARED of the ids, spread over all, or all of them."""
    n = min(N_COMPARED, len(ids))
    return [ids[i * len(ids) // n] for i in range(n)]


def _correlation(failed: set[str], killed: set[str], n: int) -> float:
    """Return the correlation of two failures over n vectors: what neither fails counts too.

    Without it a mutant that fails everything would be like every stepper that fails much.
    """
    both, neither = len(failed & killed), n - len(failed | killed)
    one, other = len(failed) - both, len(killed) - both
    spread = len(failed) * len(killed) * (neither + one) * (neither + other)
    return (both * neither - one * other) / math.sqrt(spread) if spread else float(failed == killed)
