"""What a claim is, the evidence it is compared with, its checks, and the verdict that follows.

A check compares one number, or decides one statement. Its form is `claim` for what the paper says,
`printed` for a form that is expected to fail, `corrected` for the form that must then hold.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import theory
from mushrooms.audit.runs import RUNS, Sample, Simulate, Size, scene_of
from scene import Scene, load

if TYPE_CHECKING:
    from fast import Collisions, Flow

DIGITS = 30
Predict = Callable[[Scene, int], theory.Prediction]
Verdict = Literal[
    "confirmed",
    "misprint",
    "false",
    "not reproducible as stated",
    "loosely worded",
    "remark",
    "inferred",
    "refuted",
    "indeterminate",
]
Form = Literal["claim", "printed", "corrected"]


class Check(NamedTuple):
    """One comparison.

    Attributes:
        what: what is compared, in words.
        holds: True, False, or None when the data are too coarse to tell.
        expected: the value or bound it is held against, as text.
        value: what was found, None when `note` says it in words.
        error: one standard error, None where nothing is random.
        band: how far off finite energy may put it, by the theory.
        form: see the module.
        n_tests: how many chances to be wrong by accident it took, 0 where nothing is random.
        note: what else is worth knowing.
        sees: the departure that it would refute 19 times in 20, None where nothing is random.
        against: the alternative that it is meant to tell from the claim, in words.
        power: the probability with which that alternative is refuted, at least.
    """

    what: str
    holds: bool | None
    expected: str
    value: float | None = None
    error: float | None = None
    band: float | None = None
    form: Form = "claim"
    n_tests: int = 0
    note: str = ""
    sees: float | None = None
    against: str = ""
    power: float | None = None


class Claim(NamedTuple):
    """One statement of the paper, or about it, and how it is checked.

    Attributes:
        id: of the claims.
        where: place in the paper.
        statement: what the paper says; for a misprint, printed and corrected form.
        method: how it is checked.
        tolerance: what is accepted, with its reason.
        expected: the verdict that stands when every check of a claim and of a corrected form holds,
            and one of the printed form fails.
        examine: makes the checks.
        runs: names of the simulations it needs.
    """

    id: str
    where: str
    statement: str
    method: str
    tolerance: str
    expected: Verdict
    examine: Callable[[ClaimEvidence], Iterable[Check]]
    runs: tuple[str, ...] = ()


class Finding(NamedTuple):
    """What came of a claim; `seconds` is the time its checks took, simulations apart."""

    id: str
    verdict: Verdict
    checks: list[Check]
    seconds: float


def verdict_of(claim: Claim, checks: list[Check]) -> Verdict:
    """Return the verdict that the checks make.

    A printed form stands when all its checks hold; then a misprint is "confirmed" after all. Any
    other failure refutes the claim; a check that cannot tell leaves it open.
    """
    printed = [check.holds for check in checks if check.form == "printed"]
    others = [check.holds for check in checks if check.form != "printed"]
    if not others or False in others:
        return "refuted"
    if None in others:
        return "indeterminate"
    if not printed or False in printed:
        return claim.expected
    return "indeterminate" if None in printed else "confirmed"


def to_data(finding: Finding) -> dict[str, Any]:
    """Return a finding as plain data."""
    return {**finding._asdict(), "checks": [check._asdict() for check in finding.checks]}


def from_data(data: dict[str, Any]) -> Finding:
    """Return the finding that plain data hold."""
    return Finding(**{**data, "checks": [Check(**check) for check in data["checks"]]})


class AuditSteppers(NamedTuple):
    """The stepper that the audit simulates with: `fast`, or another with its signatures."""

    simulate: Simulate
    trajectory: Callable[..., Collisions]
    flow: Callable[..., Flow]


class ClaimEvidence:
    """What the checks of claims look at.

    Args:
        samples: by run, those that the claims name.
        steppers: for claims that follow single particles.
        size: of the audit.
        seed: of the audit.
        threads: for the steppers.
        predict: theory, or a wrong one that must be found out.
    """

    def __init__(
        self,
        samples: Mapping[str, Sample],
        steppers: AuditSteppers,
        *,
        size: Size = "quick",
        seed: int = 0,
        threads: int | None = None,
        predict: Predict = theory.predict,
    ) -> None:
        self._samples = samples
        self.steppers = steppers
        self.size = size
        self.seed = seed
        self.threads = threads
        self._predict = predict

    def sample(self, run: str) -> Sample:
        """Return a run's sample."""
        return self._samples[run]

    def samples(self, *runs: str) -> list[Sample]:
        """Return the samples of those runs that this size has."""
        return [self._samples[run] for run in runs if RUNS[run].n_particles(self.size)]

    def predict(self, scene: str | Scene) -> Any:
        """Return the theory of one cycle, to DIGITS digits."""
        return self._predict(load(scene) if isinstance(scene, str) else scene, DIGITS)

    def theory_of(self, sample: Sample) -> Any:
        """Return the theory of the sample's scene."""
        return self.predict(scene_of(sample.run))
