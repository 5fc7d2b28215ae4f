"""Samples: what a run's particles did, as the checks of claims look at it."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from conformance.audit.runs import Simulation, Size, run_seed, scene_of

if TYPE_CHECKING:
    from fast import Ensemble

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
Simulate = Callable[..., "Ensemble"]
Progress = Callable[[str, int, int], None]  # run, particles done, particles in all

MAX_LOST = 1e-3  # a larger unfollowed share could hide a bias as large as the errors themselves


class Sample(NamedTuple):
    """The n particles of a run that were followed to the end, over K cycles, at P phases.

    Attributes:
        run: what was asked for.
        s: (n, K) log E / E0 at the end of each cycle.
        t_in, t_out: (n, K, M) captured stay around each narrowing of the mouth; nan for none.
        takes_part: (n,) who is not in the island all the time.
        phase_s: (n, K, P) log E / E0 at the phases.
        phase_captured: (n, K, P) whether in the island there.
        stem_hits: (n,) collisions with left, right and floor.
        n_particles: particles started.
        n_undecided, n_undefined: of those not followed.
        n_collisions, n_careful: in all.
        seconds: kernel time x threads [s].
        sha256: of the ensemble, as `fast.Ensemble` has it.
    """

    run: Simulation
    s: FloatArray
    t_in: FloatArray
    t_out: FloatArray
    takes_part: BoolArray
    phase_s: FloatArray
    phase_captured: BoolArray
    stem_hits: npt.NDArray[np.int64]
    n_particles: int
    n_undecided: int
    n_undefined: int
    n_collisions: int
    n_careful: int
    seconds: float
    sha256: str

    @property
    def n(self) -> int:
        """Return how many were followed to the end."""
        return len(self.s)

    @property
    def is_whole(self) -> bool:
        """Tell whether the unfollowed share is too small to matter."""
        return self.n > (1 - MAX_LOST) * self.n_particles

    @property
    def gain(self) -> FloatArray:
        """Return log E1 / E0 of the first cycle."""
        return self.s[:, 0]

    @property
    def captured(self) -> BoolArray:
        """Return who was captured in the first cycle."""
        return np.asarray(np.isfinite(self.t_in[:, 0]).any(axis=1))

    @property
    def never_captured(self) -> BoolArray:
        """Return, for each who takes part, whether the first cycle passes uncaptured; p_nc is the share."""
        flags: BoolArray = ~self.captured[self.takes_part]
        return flags

    @property
    def first_stay(self) -> tuple[FloatArray, FloatArray]:
        """Return begin and end (n,) of each one's first captured stay in the first cycle; nan for none."""
        begin, end = (np.fmin.reduce(t[:, 0], axis=1, initial=np.nan) for t in (self.t_in, self.t_out))
        return begin, end

    @property
    def speed(self) -> float:
        """Return the initial speed."""
        return float(np.sqrt(2 * self.run.energy))


def draw(
    simulate: Simulate,
    run: Simulation,
    *,
    size: Size,
    seed: int,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Sample:
    """Follow a run's particles.

    Args:
        simulate: `fast.simulate`, or another with its signature; it may know the particles from before.
        run: what to simulate.
        size: quick or full.
        seed: the audit's.
        threads: for the stepper; all by default.
        progress: told of the particles done, again and again.
    """
    n_particles = run.n_particles(size)

    def tell(n_done: int) -> None:
        if progress:
            progress(run.name, n_done, n_particles)

    ensemble = simulate(
        scene_of(run),
        n_particles=n_particles,
        energy=run.energy,
        n_cycles=run.n_cycles,
        seed=run_seed(seed, run),
        threads=threads,
        phases=run.phases,
        progress=tell,
    )
    return reduced(run, ensemble)


def reduced(run: Simulation, ensemble: Ensemble) -> Sample:
    """Return what the audit keeps of an ensemble, particles not followed left out."""
    energies = ensemble.cycle_energies
    followed = (ensemble.outcome == 0) & np.all(np.isfinite(energies) & (energies > 0), axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        s, phase_s = np.log(energies / ensemble.energy0), np.log(ensemble.phase_energies / ensemble.energy0)
    return Sample(
        run=run,
        s=s[followed],
        t_in=ensemble.t_in[followed],
        t_out=ensemble.t_out[followed],
        takes_part=ensemble.takes_part()[followed],
        phase_s=phase_s[followed],
        phase_captured=ensemble.phase_captured[followed],
        stem_hits=ensemble.wall_counts[followed, 2:].sum(axis=1),
        n_particles=len(followed),
        n_undecided=int(np.sum(ensemble.outcome == 1)),
        n_undefined=int(np.sum(ensemble.outcome == 2)),
        n_collisions=int(np.sum(ensemble.n_collisions)),
        n_careful=int(np.sum(ensemble.n_careful)),
        seconds=ensemble.seconds * ensemble.threads,
        sha256=ensemble.sha256(),
    )
