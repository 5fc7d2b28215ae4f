"""Which vector kills which mutant: the proof that the corpus can fail, and what failures are compared with.

`python -m conformance.mutants.kill_matrix` answers every vector with every mutant, grades the answers and
writes kill-matrix.json beside this file and docs/kill-matrix.md: some ten minutes on one core. The matrix
is a function of corpus and mutants alone. Only `fail` kills: a vector that a mutant declines, or at which it
crashes or answers in a wrong format, does not count.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import msgspec

from conformance.grading.grade import grade
from conformance.mutants import MUTANTS, Mutant
from conformance.plain.step import Flight
from conformance.vectors import LEVELS, Vector, answer, load, manifest
from scene import BadInput, from_data
from scene.files import write_file
from scene.tables import laws

DATA = Path(__file__).parent  # it ships with the package: `suite.diagnosis` reads it
DOCS = DATA.parent.parent / "docs"
N_WITNESSES = 3
LEAST_KILLS = 5  # of every mutant: one vector alone might be lost, or passed by luck
PLAIN = Mutant("plain", "none", Flight)
_graded: dict[tuple[str, bytes], str] = {}


def is_plain_at(mutant: Mutant, vector: Vector) -> bool:
    """Tell whether a mutant answers a vector as the plain stepper does, because its fault is not used.

    A path is not followed by a step, and a law of a kind that the scene lacks is not evaluated.
    """
    if mutant.flight is Flight:
        return vector.kind == "step"
    others = {kind for kind, motion in Flight.kinds.items() if mutant.flight.kinds[kind] is not motion}
    if not others:
        return False
    try:
        return not {type(law) for law in laws(from_data(vector.scene)).values()} & others
    except BadInput:
        return True


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
    asked = (vector for vector in vectors if not is_plain_at(mutant, vector))
    return [vector.id for vector in asked if verdict(mutant, vector) == "fail"]


def witnesses(killing: Sequence[str], vectors: dict[str, Vector]) -> list[str]:
    """Choose the few vectors that a quick test needs: the easiest first, of different groups."""
    order = sorted(
        (vectors[name] for name in killing),
        key=lambda v: (LEVELS.index(v.level), v.kind != "step", v.collisions, v.id),
    )
    chosen: dict[str, str] = {}
    for vector in order:
        chosen.setdefault(vector.group, vector.id)
    return list(chosen.values())[:N_WITNESSES]


def matrix(vectors: Sequence[Vector], found: dict[str, list[str]]) -> dict[str, Any]:
    """Arrange the kills as they are published.

    Returns:
        `corpus` version, `vectors` graded, `survivors`, and for each mutant its fault, the number of
        vectors that kill it in all and by group, and witnesses; `killed_by` lists for each vector
        the mutants that it kills.
    """
    by_id = {vector.id: vector for vector in vectors}
    mutants = {}
    for name, killing in found.items():
        groups = Counter(by_id[vector].group for vector in killing)
        mutants[name] = {
            "fault": MUTANTS[name].fault,
            "kills": len(killing),
            "groups": dict(sorted(groups.items())),
            "witnesses": witnesses(killing, by_id),
        }
    sets = {name: set(killing) for name, killing in found.items()}
    return {
        "vectors": len(vectors),
        "survivors": [name for name, killing in found.items() if not killing],
        "mutants": mutants,
        "killed_by": {
            vector.id: [name for name, killing in sets.items() if vector.id in killing] for vector in vectors
        },
    }


def table(found: dict[str, Any]) -> str:
    """Return the readable form: mutants by number of kills, and the groups that kill them most."""
    ordered = sorted(found["mutants"].items(), key=lambda item: (item[1]["kills"], item[0]))
    idle = [name for name, killed in found["killed_by"].items() if not killed]
    lines = [
        "# Kill matrix",
        "",
        f"{len(ordered)} mutants of the plain stepper against the {found['vectors']} vectors of corpus"
        f" {found['corpus']}: {len(ordered) - len(found['survivors'])} killed by a `fail`, each by"
        f" {min(entry['kills'] for _, entry in ordered)} vectors or more."
        f" {found['vectors'] - len(idle)} vectors kill at least one. Written by `python -m"
        " conformance.mutants.kill_matrix`; conformance/mutants/kill-matrix.json has it by vector.",
        "",
        "The least killed come first.",
        "",
        "| mutant | fault | kills | most by |",
        "| --- | --- | ---: | --- |",
    ]
    for name, entry in ordered:
        most = sorted(entry["groups"].items(), key=lambda item: (-item[1], item[0]))[:3]
        shown = ", ".join(f"{group} {n}" for group, n in most)
        fault = entry["fault"].replace("|", "\\|")
        lines.append(f"| {name} | {fault} | {entry['kills']} | {shown} |")
    return "\n".join(lines) + "\n"


def run(docs: Path = DOCS, data: Path = DATA, progress: Callable[[str], None] = print) -> int:
    """Compute and write the matrix.

    Returns:
        0 when every mutant is killed by LEAST_KILLS vectors and the plain stepper by none, 1 otherwise.
    """
    vectors = load("stress")
    wrong = kills(vectors, PLAIN)
    found: dict[str, list[str]] = {}
    for mutant in MUTANTS.values():
        found[mutant.name] = kills(vectors, mutant)
        progress(f"{mutant.name}: {len(found[mutant.name])}")
    known = manifest()
    published = {
        "corpus": known.corpus,
        "digest": known.digest,
        "plain_fails": wrong,
        **matrix(vectors, found),
    }
    docs.mkdir(parents=True, exist_ok=True)
    write_file(data / "kill-matrix.json", json.dumps(published, indent=1) + "\n")
    write_file(docs / "kill-matrix.md", table(published))
    weak = [name for name, killing in found.items() if len(killing) < LEAST_KILLS]
    progress(f"killed by fewer than {LEAST_KILLS}: {', '.join(weak) or 'none'}")
    progress(f"plain fails: {', '.join(wrong) or 'none'}")
    return 1 if wrong or weak else 0


if __name__ == "__main__":
    try:
        sys.exit(run())
    except BadInput as error:
        print(error, file=sys.stderr)
        sys.exit(2)
