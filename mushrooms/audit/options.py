"""The options of `mushrooms audit`."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True, kw_only=True)
class AuditOptions:
    """The options of `mushrooms audit`; those after `ensemble` are of another program's ensemble.

    Attributes:
        out: folder for the report.
        full: the paper's sizes, in place of the quick ones.
        only: ids of the claims to check; None for all.
        seed: of the random starts.
        threads: None for all cores.
        resume: go on with the runs and findings in the folder.
        commands: print the runs as commands, and stop.
        as_json: print JSON.
        ensemble: file or folder of the ensemble; None for the claims of the paper.
        scene: that was simulated.
        backwards: an ensemble of the reversed cycle.
        energy: initial energy, in the file's unit.
        energy_unit: None for v^2/2.
        time_unit: None where it is to be inferred.
        particles: number that was started; None where each has a row.
    """

    out: Path
    full: bool
    only: str | None
    seed: int
    threads: int | None
    resume: bool
    commands: bool
    as_json: bool
    ensemble: Path | None
    scene: str | None
    backwards: Path | None
    energy: float | None
    energy_unit: str | None
    time_unit: str | None
    particles: int | None
