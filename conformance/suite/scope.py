"""The scope of a verdict: what was graded, what was not, and how well, in one line that can be published.

A table, a kind of law or a profile is graded when a vector that needs it passed. A question that must be
refused grades none: it has no table. What is not in the scope is not accepted, whatever the exit code.
"""

from __future__ import annotations

from collections.abc import Sequence

import msgspec

from conformance.suite.session import needs
from conformance.vectors import Vector
from scene.protocol.messages import PROFILES

TABLES = ("mushroom", "cap", "stem")
LAWS = ("fourier", "bang-bang", "constant")


class Scope(msgspec.Struct, frozen=True):
    """What a run graded.

    Attributes:
        level: core, extended or stress.
        corpus: version of the vectors.
        tables, laws, profiles: graded ones.
        not_graded: the others.
        declined: share of the questions that were declined.
        precision: class A, B or C, or a dash.
        seed: of the run.
    """

    level: str
    corpus: str
    tables: list[str]
    laws: list[str]
    profiles: list[str]
    not_graded: list[str]
    declined: float
    precision: str
    seed: int

    def __str__(self) -> str:
        """Return the line."""
        graded = [", ".join(names) for names in (self.tables, self.laws, self.profiles) if names]
        lacking = [f"{', '.join(self.not_graded)} not graded"] if self.not_graded else []
        end = [f"{100 * self.declined:.1f} % declined", f"class {self.precision}", f"seed {self.seed}"]
        return "; ".join([f"{self.level} {self.corpus}", *graded, *lacking, *end])


def graded_parts(passed: Sequence[Vector], *, is_timed: bool) -> dict[str, list[str]]:
    """Return tables, laws and profiles that some vector graded, and under `not_graded` what none did.

    Args:
        passed: the vectors whose answers were right.
        is_timed: whether a speed was measured.
    """
    valid = [vector for vector in passed if vector.expect[0].outcome != "rejected"]
    seen = {need for vector in valid for need in needs(vector.kind, vector.scene)}
    if is_timed:
        seen.add(("profile", "time"))
    every = {"tables": ("table", TABLES), "laws": ("law", LAWS), "profiles": ("profile", PROFILES)}
    found = {part: [n for n in names if (what, n) in seen] for part, (what, names) in every.items()}
    lacking = [
        name
        for part in ("profiles", "tables", "laws")
        for name in every[part][1]
        if (every[part][0], name) not in seen
    ]
    return {**found, "not_graded": lacking}
