"""What a run found: a result for each case, what it comes to in the end, and the scope of that.

Physics and precision stay apart: a verdict for each case, a precision class for each group. The scope says in
one line that can be published what was graded, what was not, and how well. A table, a kind of law or a
profile is graded when a vector that needs it passed; a question that must be refused grades none, as it has
no table. What is not in the scope is not accepted, whatever the exit code.
"""

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import msgspec

from conformance.grading.agreement import PrecisionClass, precision_class
from conformance.suite.session import Limits, needs
from conformance.vectors import Vector
from scene.protocol.messages import PROFILES, Introduction

TABLES = ("mushroom", "cap", "stem")
LAWS = ("fourier", "bang-bang", "constant")
PARTS = {"profiles": PROFILES, "tables": TABLES, "laws": LAWS}
BAD = ("fail", "crashed", "timed-out", "wrong-format", "error")
VERDICTS = ("pass", "fail", "indeterminate", "declined", "unsupported", *BAD[1:])
# A stepper that declines more has not been graded: of all vectors and fresh questions; of a part, which is
# one group of these, or one check.
MAX_DECLINED, MAX_DECLINED_OF_PART = 0.05, 0.25
DOUBT = 1e-2  # probability of as many undecided answers at the limit: below it the limit is surely exceeded
NOT_KNOWN = "though it is listed as a known failure"


def declines_too_much(n_declined: int, n: int, limit: float) -> bool:
    """Tell whether n_declined of n answers show that a stepper declines more than a limit.

    They do if a stepper that declines at the limit, each answer for itself, leaves so many or more undecided
    with a probability below DOUBT. The verdict on a stepper well within the limit then depends neither on the
    draw nor on how many answers are asked for. No fewer than four answers show a share above 25 %.

    Args:
        n_declined: answers that are undecided where `undecided` does not pass.
        n: answers in all.
        limit: greatest share of them, above 0 and below 1.
    """
    if n_declined <= limit * n:
        return False
    tail = 0.0
    for k in range(n_declined, n + 1):
        log_ways = math.lgamma(n + 1) - math.lgamma(k + 1) - math.lgamma(n - k + 1)
        tail += math.exp(log_ways + k * math.log(limit) + (n - k) * math.log1p(-limit))
        if tail >= DOUBT:
            return False
    return True


class Result(msgspec.Struct, frozen=True, omit_defaults=True):
    """One case and what came of it.

    Attributes:
        id: of the vector, or protocol/..., property/..., profile/...
        group: what it is counted with.
        verdict: see `VERDICTS`.
        why: one line.
        seconds: until the answer.
        level: of a vector.
        asked: the symmetry transform by which it was asked (`suite.run`).
        ulps: worst backward ulps, absent when not measured (or beyond binary64).
        relative: worst backward error, likewise.
        answer: what the implementation said, taken back to the question as it is published.
        step: of a vector that did not pass, the place of the outcome in question, from 0.
        given: of the answer, the outcome that did not pass.
        expected: the certified outcome in its place, in the middle of its enclosures.
        is_known: listed in the known-failures file.
        sent: of a case that did not pass, the last line that was sent for it.
        paste: of a check that failed, the question as a pytest case.
        n_answers: of a check, how many different answers were asked for: of the command of which too many are
            undecided, if there is one, or else of all.
        n_undecided: of these, how many were undecided where `undecided` does not pass.
    """

    id: str
    group: str
    verdict: str
    why: str = ""
    seconds: float = 0.0
    level: str = ""
    asked: str = ""
    ulps: float | None = None
    relative: float | None = None
    answer: dict[str, Any] | None = None
    step: int = 0
    given: dict[str, Any] | None = None
    expected: dict[str, Any] | None = None
    is_known: bool = False
    sent: str = ""
    paste: str = ""
    n_answers: int = 0
    n_undecided: int = 0

    @property
    def is_declined(self) -> bool:
        """Tell whether this is a check of which too many answers are undecided."""
        return declines_too_much(self.n_undecided, self.n_answers, MAX_DECLINED_OF_PART)

    @property
    def is_right(self) -> bool:
        """Tell whether this result lets the run succeed: a known failure must fail, all else must not."""
        return self.verdict != "pass" if self.is_known else self.verdict not in BAD


class Scope(msgspec.Struct, frozen=True):
    """What a run graded.

    Attributes:
        level: core, extended or stress.
        corpus: version of the vectors.
        tables, laws, profiles: graded ones.
        not_graded: the others.
        declined: share of the vectors and fresh questions that were declined.
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


class Speed(msgspec.Struct, frozen=True):
    """Nanoseconds per collision, by the implementation's own clock, best and median of the repeats."""

    scene: str
    collisions: int
    repeats: int
    best_ns: float
    median_ns: float


class Run(msgspec.Struct, frozen=True):
    """A whole run: what was asked of whom, and every result.

    Attributes:
        seed: all that is drawn follows from it, so that a run can be repeated.
        graded: tables, laws, profiles of vectors that passed, and what no vector graded (`graded_parts`).
        diagnosis: of the failures, by the mutants that fail alike; empty without any.
        known: the names of the known-failures file, of which some are no cases: declined/GROUP.
    """

    command: list[str]
    level: str
    seed: int
    corpus: str
    digest: str
    limits: Limits
    introduction: Introduction | None
    results: list[Result]
    speed: Speed | None
    n_restarts: int
    stderr: str
    seconds: float
    graded: dict[str, list[str]]
    diagnosis: list[str]
    known: frozenset[str] = frozenset()

    def counts(self, group: str | None = None) -> Counter[str]:
        """Count the verdicts, of one group or of all."""
        return Counter(r.verdict for r in self.results if group in (None, r.group))

    def groups(self) -> list[str]:
        """Return the groups in the order they were run."""
        return list(dict.fromkeys(result.group for result in self.results))

    def ulps(self, group: str | None = None) -> list[float]:
        """Return the backward ulps of the answers that passed, inf where binary64 does not hold them."""
        passed = [r for r in self.results if r.verdict == "pass" and group in (None, r.group)]
        return [math.inf if r.ulps is None else r.ulps for r in passed if r.relative is not None]

    def precision(self, group: str | None = None) -> str:
        """Return the class that the passing answers reach, or a dash when none was measured."""
        ulps = self.ulps(group)
        return precision_class(ulps) if ulps else "–"

    def classes(self, group: str | None = None) -> dict[PrecisionClass, int]:
        """Count the answers that passed by the precision class of each."""
        found = Counter(precision_class([ulps]) for ulps in self.ulps(group))
        return {"A": found["A"], "B": found["B"], "C": found["C"]}

    def objections(self) -> list[str]:
        """Say, one line each, why the run does not succeed."""
        wrong: dict[str, list[Result]] = {}
        for result in self.results:
            if not result.is_right:
                # What was never asked has one reason, and one line.
                is_unasked = result.why.startswith("not asked") and not result.is_known
                wrong.setdefault(result.why if is_unasked else result.id, []).append(result)
        found = [_objection(*results) for results in wrong.values()]
        declined = self._declined_too_often()
        found += [line for name, line in declined.items() if name not in self.known]
        listed = {f"declined/{name}" for name in ("all", *self.groups())} & self.known
        found += [f"{name}: less is declined, {NOT_KNOWN}" for name in sorted(listed - set(declined))]
        vectors_passed = any(r.verdict == "pass" and r.level for r in self.results)
        return found if vectors_passed or found else ["no vector passed: nothing was graded"]

    def _declined_too_often(self) -> dict[str, str]:
        """Say where too much was declined for the rest to speak for it.

        Returns:
            A line for each, by declined/all, declined/GROUP, or the name of a check.
        """
        limits = {"all": MAX_DECLINED} | dict.fromkeys(self.groups(), MAX_DECLINED_OF_PART)
        found = {}
        for name, limit in limits.items():
            n_declined, n = self.declined(None if name == "all" else name)
            if declines_too_much(n_declined, n, limit):
                of = "vectors and fresh questions" if name == "all" else f"in group {name}"
                found[f"declined/{name}"] = f"declined {n_declined} of {n} {of}: surely more than {limit:.0%}"
        for result in self.results:
            if result.is_declined and not result.is_known:
                found[result.id] = (
                    f"{result.id}: {result.n_undecided} of {result.n_answers} answers are undecided:"
                    f" surely more than {MAX_DECLINED_OF_PART:.0%}"
                )
        return found

    def declined(self, group: str | None = None) -> tuple[int, int]:
        """Count the vectors and fresh questions that were declined, and those that were asked.

        Args:
            group: only those of this group, and below level stress, where binary64 may not decide.
        """
        counted = [result for result in self.results if result.level]
        if group:
            counted = [r for r in counted if r.group == group and r.level != "stress"]
        counts = Counter(r.verdict for r in counted)
        return counts["declined"], sum(counts.values()) - counts["unsupported"]

    def scope(self) -> Scope:
        """Say what the verdict is about."""
        declined, asked = self.declined()
        share = declined / max(1, asked)
        return Scope(
            self.level, self.corpus, **self.graded, declined=share, precision=self.precision(), seed=self.seed
        )

    def verdict(self) -> str:
        """Say in a word or two what the exit code says."""
        return {0: "accepted", 1: "not accepted", 2: "undecided"}[self.exit_code()]

    def exit_code(self) -> int:
        """Return 0 when all is right, 1 when not, 2 when the corpus could not tell (indeterminate)."""
        if self.objections():
            return 1
        return 2 if self.counts()["indeterminate"] else 0


def graded_parts(passed: Sequence[Vector], *, is_timed: bool) -> dict[str, list[str]]:
    """Return tables, laws and profiles that some vector graded, and under `not_graded` what none did.

    Args:
        passed: the vectors whose answers were right.
        is_timed: whether a speed was measured.
    """
    valid = [vector for vector in passed if vector.expect[0].outcome != "rejected"]
    found = parts_needed((vector.kind, vector.scene) for vector in valid)
    if is_timed:
        found["profiles"].append("time")
    lacking = [name for part, names in PARTS.items() for name in names if name not in found[part]]
    return {**found, "not_graded": lacking}


def parts_needed(questions: Iterable[tuple[str, Mapping[str, Any] | None]]) -> dict[str, list[str]]:
    """Return the profiles, tables and laws that questions need, each by its profile and its scene."""
    seen = {need for profile, scene in questions for need in needs(profile, scene)}
    return {part: [n for n in names if (part, n) in seen] for part, names in PARTS.items()}


def _objection(result: Result, *others: Result) -> str:
    if result.is_known:
        return f"{result.id}: passes, {NOT_KNOWN}"
    on = f" and {len(others)} others" if others else ""
    return f"{result.id}{on}: {result.verdict}: {result.why}"
