"""A diagnosis of failures: the mutants of the plain stepper that fail the same vectors.

Every mutant has one known fault, and so have the common mistakes. They answer a sample of the run's failures
and passes, unless the few vectors by which the kill matrix tells them from others all passed. Who fails the
same ones is named.
"""

import json
import math
from collections.abc import Sequence
from importlib import resources

from conformance.cases.generated import FRESH
from conformance.mutants import COMMON, MUTANTS
from conformance.mutants.kill_matrix import kills
from conformance.suite.result import Result
from conformance.vectors import load

N_COMPARED = 20  # failures, and as many passes
# Groups that take the plain stepper long: they are compared only where no other failed.
SLOW = ("waiting", "hard-case-22", "long-trajectory", "long-flow", "longest-flow")
ALIKE = 0.5  # least correlation of two verdicts over the vectors that were asked
NEARLY = 0.9  # of the likest one's correlation, that another must have to be named beside it
MAX_NAMED = 3


def diagnose(results: Sequence[Result]) -> list[str]:
    """Name the mutants that fail most like this, one line each, the likest first; nothing without a likeness.

    Args:
        results: of a run; failures and passes of vectors count, of those that the mutants were asked.
    """
    kept = [r for r in results if r.level and r.group != FRESH]
    failed = [r for r in kept if r.verdict == "fail"]
    passed = [r for r in kept if r.verdict == "pass"]
    # Where nothing passed, every mutant that has the same vectors wrong is as like as any other.
    if not failed or not passed:
        return []
    matrix = json.loads((resources.files("conformance") / "mutants" / "kill-matrix.json").read_bytes())
    faulty = MUTANTS | COMMON
    told = {name: set(matrix["mutants"][name]["vectors"]) for name in faulty}
    ids_failed, ids_passed = {r.id for r in failed}, {r.id for r in passed}
    suspects = [name for name, own in told.items() if own & ids_failed or not own & ids_passed]
    some_failed, some_passed = _sample(failed), _sample(passed)
    compared = [vector for vector in load("stress") if vector.id in some_failed | some_passed]
    alike: dict[str, tuple[int, int]] = {}
    scores: dict[str, float] = {}
    for name in suspects:
        killed = set(kills(compared, faulty[name]))
        alike[name] = len(killed & some_failed), len(killed & some_passed)
        shares = alike[name][0] / len(some_failed), alike[name][1] / len(some_passed)
        scores[name] = _correlation(len(failed), len(passed), *shares)
    likest = sorted(scores, key=lambda name: -scores[name])[:MAX_NAMED]
    return [
        f"like {name} on {alike[name][0]} of {len(some_failed)} failures, and unlike it on {alike[name][1]}"
        f" of {len(some_passed)} passes: {faulty[name].fault}"
        for name in likest
        if scores[name] >= max(ALIKE, NEARLY * scores[likest[0]])
    ]


def _sample(results: Sequence[Result]) -> set[str]:
    """Return the ids of N_COMPARED results, spread over all that are quick, or of all there are."""
    ids = [r.id for r in results if r.group not in SLOW] or [r.id for r in results]
    n = min(N_COMPARED, len(ids))
    return {ids[i * len(ids) // n] for i in range(n)}


def _correlation(n_failed: int, n_passed: int, of_failed: float, of_passed: float) -> float:
    """Return the correlation of a run's failures with another's, by its shares of failures and of passes.

    What neither fails counts too: else a mutant that fails everything would be like all that fail much.
    """
    killed = (n_failed * of_failed + n_passed * of_passed) / (n_failed + n_passed)
    spread = math.sqrt(n_failed * n_passed * killed * (1 - killed)) / (n_failed + n_passed)
    both = of_failed * n_failed / (n_failed + n_passed)
    return (both - killed * n_failed / (n_failed + n_passed)) / spread if spread else 0.0
