"""Which vectors kill which mutant: the proof that the corpus can fail, and what failures are compared with.

`python -m conformance.mutants.kill_matrix` answers every vector with every mutant, grades the answers and
writes kill-matrix.json beside this file, with a few vectors for each mutant: some five minutes on one core.
`--table` computes nothing and prints what is kept there as Markdown. Only `fail` kills: a vector that a
mutant declines, or at which it crashes, does not count.

A diagnosis of a run names the mutants, common mistakes included, that fail most like it. They answer a sample
of its failures and passes, unless the few vectors by which the matrix tells them from others all passed.
"""

import json
import math
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import msgspec

from conformance.grading.agreement import grade
from conformance.mutants import COMMON, MUTANTS, PLAIN, Mutant
from conformance.vectors import LEVELS, Vector, answer, load, manifest
from scene import BadInput
from scene.files.writer import write_file

DATA = Path(__file__).parent  # the matrix ships with the package
MOST_VECTORS = 3  # kept of those that kill a mutant
LEAST_COMPARED = 5  # vectors: what fewer kill shows too little to call other mutants needless
HEAD = """# Kill matrix

{n} mutants of the plain stepper, and how many of the {n_vectors} vectors of corpus {corpus} kill each by a
`fail`. None is subsumed by another: none is killed by all the vectors that kill another one, if these are at
least five. The mistakes named last are so common that a diagnosis names them, though the mutant in brackets
subsumes each. At most three vectors are given, chosen so that few other mutants fail them all. A size is the
threshold from which on a mistake shows.

| mutant | what it does wrong | size | kills | some vectors that kill it |
| --- | --- | ---: | ---: | --- |
"""
N_COMPARED = 20  # failures of a run, and as many passes
# Groups that take the plain stepper long: they are compared only where no other failed.
SLOW = ("waiting", "hard-case-22", "long-trajectory", "long-flow", "longest-flow")
ALIKE = 0.5  # least correlation of two verdicts over the vectors that were asked
NEARLY = 0.9  # of the likest one's correlation, that another must have to be named beside it
MAX_NAMED = 3
_graded: dict[tuple[str, bytes], str] = {}


def verdict(mutant: Mutant, vector: Vector) -> str:
    """Grade a mutant's answer; an exception is `crashed`."""
    try:
        found = answer(vector, mutant.step, mutant.trajectory, mutant.flow)
    except (ArithmeticError, ValueError):
        return "crashed"
    key = vector.id, msgspec.json.encode(found)  # most answers are the plain stepper's: grade them once
    if key not in _graded:
        _graded[key] = grade(vector, found).verdict
    return _graded[key]


def kills(vectors: Sequence[Vector], mutant: Mutant) -> list[str]:
    """Return the ids of the vectors that kill a mutant, in the order of the corpus."""
    return [vector.id for vector in vectors if verdict(mutant, vector) == "fail"]


def diagnose(failed: Sequence[Vector], passed: Sequence[Vector]) -> list[str]:
    """Name the mutants that fail most like a run, one line each, the likest first; none without a likeness.

    Args:
        failed: the vectors that a run's implementation failed.
        passed: those that it passed. Where nothing passed, every mutant that has the same vectors wrong is
            as like as any other.
    """
    if not failed or not passed:
        return []
    matrix = json.loads((DATA / "kill-matrix.json").read_bytes())["mutants"]
    ids_failed, ids_passed = ({vector.id for vector in vectors} for vectors in (failed, passed))
    some_failed, some_passed = _sample(failed), _sample(passed)
    found: list[tuple[float, str]] = []
    for name, mutant in (MUTANTS | COMMON).items():
        own = set(matrix[name]["vectors"])
        if own & ids_passed and not own & ids_failed:
            continue
        alike, unlike = len(kills(some_failed, mutant)), len(kills(some_passed, mutant))
        shares = alike / len(some_failed), unlike / len(some_passed)
        line = (
            f"like {name} on {alike} of {len(some_failed)} failures, and unlike it on {unlike} of"
            f" {len(some_passed)} passes: {mutant.fault}"
        )
        found.append((_correlation(len(failed), len(passed), *shares), line))
    likest = sorted(found, key=lambda one: -one[0])[:MAX_NAMED]
    return [line for score, line in likest if score >= max(ALIKE, NEARLY * likest[0][0])]


def _sample(vectors: Sequence[Vector]) -> list[Vector]:
    """Return N_COMPARED vectors, spread over all that are quick, or of all there are."""
    some = [vector for vector in vectors if vector.group not in SLOW] or vectors
    n = min(N_COMPARED, len(some))
    return [some[i * len(some) // n] for i in range(n)]


def _correlation(n_failed: int, n_passed: int, of_failed: float, of_passed: float) -> float:
    """Return the correlation of a run's failures with a mutant's, by its shares of failures and of passes.

    What neither fails counts too: else a mutant that fails everything would be like all that fail much.
    """
    n, killed = n_failed + n_passed, n_failed * of_failed + n_passed * of_passed
    spread = math.sqrt(n_failed * n_passed * killed * (n - killed))
    return n_failed * (n * of_failed - killed) / spread if spread else 0.0


def subsumed(found: dict[str, list[str]]) -> dict[str, str]:
    """Return by which mutant each is subsumed: all vectors that kill that one, at least five, kill it too."""
    sets = {name: set(killing) for name, killing in found.items()}
    by: dict[str, str] = {}
    subsumers = [other for other in sets if other in MUTANTS and len(sets[other]) >= LEAST_COMPARED]
    for name, killing in sets.items():
        for other in subsumers:
            is_first = list(sets).index(other) < list(sets).index(name)
            if sets[other] < killing or (sets[other] == killing and is_first):
                by[name] = max(by.get(name, other), other, key=lambda one: len(sets[one]))
    return by


def choose(name: str, found: dict[str, list[str]], vectors: dict[str, Vector]) -> list[str]:
    """Choose the few vectors that tell a mutant from the others: of level core if any, the easiest first."""
    order = sorted(
        (vectors[killing] for killing in found[name]),
        key=lambda v: (LEVELS.index(v.level), v.kind != "step", v.collisions, v.id),
    )
    pool = [vector.id for vector in order if vector.level == order[0].level]
    rivals = {other: set(killing) for other, killing in found.items() if other != name}
    chosen: list[str] = []
    while pool and len(chosen) < MOST_VECTORS:
        best = min(pool, key=lambda vector: sum(vector in killing for killing in rivals.values()))
        rivals = {other: killing for other, killing in rivals.items() if best in killing}
        pool.remove(best)
        chosen.append(best)
    return chosen


def page(published: dict[str, Any]) -> str:
    """Return the readable form: mutants, then common mistakes, the least killed first."""
    entries = published["mutants"]
    n = sum(not entry["subsumed_by"] for entry in entries.values())
    lines = [HEAD.format(n=n, **published).rstrip("\n")]
    for name in sorted(
        entries, key=lambda name: (bool(entries[name]["subsumed_by"]), entries[name]["kills"])
    ):
        entry = entries[name]
        label = f"{name} ({entry['subsumed_by']})" if entry["subsumed_by"] else name
        cells = label, entry["fault"].replace("|", "\\|"), entry["size"] or "", entry["kills"]
        lines.append(f"| {' | '.join(map(str, cells))} | {', '.join(entry['vectors'])} |")
    return "\n".join(lines) + "\n"


def run(data: Path = DATA, on_progress: Callable[[str], None] = print) -> int:
    """Compute and write the matrix.

    Returns:
        0 when vectors kill every mutant, none is subsumed, and the plain stepper fails nothing; else 1.
    """
    vectors = {vector.id: vector for vector in load("stress")}
    wrong = kills(list(vectors.values()), PLAIN)
    found: dict[str, list[str]] = {}
    for name, mutant in (MUTANTS | COMMON).items():
        found[name] = kills(list(vectors.values()), mutant)
        on_progress(f"{name}: {len(found[name])}")
    needless = subsumed(found)
    published = {
        "corpus": manifest().corpus,
        "digest": manifest().digest,
        "n_vectors": len(vectors),
        "mutants": {
            name: {
                "fault": mutant.fault,
                "size": mutant.size,
                "kills": len(found[name]),
                "subsumed_by": needless.get(name, ""),
                "vectors": choose(name, found, vectors),
            }
            for name, mutant in (MUTANTS | COMMON).items()
        },
    }
    write_file(data / "kill-matrix.json", json.dumps(published, indent=1) + "\n")
    faults = {
        "not killed": [name for name, killing in found.items() if not killing],
        "subsumed": [f"{name} by {other}" for name, other in needless.items() if name in MUTANTS],
        "plain fails": wrong,
    }
    for what, names in faults.items():
        on_progress(f"{what}: {', '.join(names) or 'none'}")
    return int(any(faults.values()))


if __name__ == "__main__":
    if sys.argv[1:] == ["--table"]:
        print(page(json.loads((DATA / "kill-matrix.json").read_text("utf-8"))), end="")
        sys.exit(0)
    if sys.argv[1:]:
        print(f"{' '.join(sys.argv[1:])!r} is no option: --table is the only one", file=sys.stderr)
        sys.exit(2)
    try:
        sys.exit(run())
    except BadInput as error:
        print(error, file=sys.stderr)
        sys.exit(2)
