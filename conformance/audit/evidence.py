"""What the check of a claim may look at: samples of the simulations it names, steppers and theory."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import theory
from conformance.audit.runs import RUNS, Size, scene_of
from conformance.audit.samples import Sample, Simulate
from scene import Scene, load
from theory.distribution import Energies

if TYPE_CHECKING:
    from fast import Collisions, Flow

DIGITS = 30
Predict = Callable[[Scene, int], theory.Prediction]


class AuditSteppers(NamedTuple):
    """The stepper that the audit simulates with: `fast`, or another with its signatures."""

    simulate: Simulate
    trajectory: Callable[..., Collisions]
    flow: Callable[..., Flow]


@cache
def energies_of(name: str) -> Energies:
    """Return the theory's distribution of energies in a run's scene."""
    return theory.energies(scene_of(RUNS[name]))


class ClaimEvidence:
    """What the check of one claim looks at.

    Args:
        samples: by run, those that the entry names.
        steppers: for entries that follow single particles.
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
        self._samples, self.steppers = samples, steppers
        self.size, self.seed, self.threads = size, seed, threads
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
