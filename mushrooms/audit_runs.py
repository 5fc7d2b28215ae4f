"""The audit's runs on disk: DIR/runs/NAME is what `mushrooms simulate --out` makes, here or elsewhere."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from conformance.audit.claim import Claim
from conformance.audit.runs import RUNS, Simulation, Size, run_seed, scene_of
from fast import Ensemble
from fast.ensemble import SHARE
from mushrooms import output
from mushrooms.output import locked
from mushrooms.simulate import tell_damaged
from mushrooms.store import conduct, engines
from mushrooms.store.run import is_run
from mushrooms.store.spec import RunSpec
from scene import Scene
from scene.refusal import BadInput

FOLDER = "runs"


def needed(claims: Sequence[Claim], size: Size) -> list[Simulation]:
    """Return the runs that claims rest on, in the order in which they are made."""
    runs = [RUNS[name] for name in dict.fromkeys(name for claim in claims for name in claim.runs)]
    return [run for run in runs if run.n_particles(size)]


def spec_of(run: Simulation, seed: int) -> RunSpec:
    """Return what decides the bits of a run in the audit of a seed."""
    return RunSpec(scene_of(run), run.energy, run.n_cycles, run_seed(seed, run), run.phases)


def command(run: Simulation, size: Size, seed: int, folder: Path) -> str:
    """Return the command that makes a run where an audit in the folder takes it up with --resume."""
    return spec_of(run, seed).command(run.scene, run.n_particles(size), folder / FOLDER / run.name)


class KeptRuns:
    """Runs in the folder of an audit.

    Args:
        folder: of the audit, held by the caller.
        resume: whether runs that are there may be gone on with.
    """

    def __init__(self, folder: Path, resume: bool) -> None:
        self._folder, self._resume = folder / FOLDER, resume

    def check(self, runs: Sequence[Simulation], seed: int) -> None:
        """Refuse at once what would be refused when its turn has come.

        Raises:
            BadInput: the folder of one of these runs holds another, or this one and `resume` was not
                asked for, or another process writes in it.
        """
        for run in runs:
            place = self._folder / run.name
            if is_run(place):
                with locked(place):
                    conduct.read_description(place, spec_of(run, seed), {})
                if not self._resume:
                    how = "--resume takes it up, another --out begins anew"
                    raise BadInput(f"output {str(place)!r} holds a run of this audit: {how}")

    def simulate(self, name: str) -> Callable[..., Ensemble]:
        """Return what stands for `fast.simulate` in a run: it follows only what the run's folder lacks."""
        return partial(self._simulate, self._folder / name)

    def _simulate(
        self,
        place: Path,
        scene: Scene,
        *,
        n_particles: int,
        energy: float,
        n_cycles: int,
        seed: int,
        threads: int | None,
        phases: tuple[float, ...],
        progress: Callable[[int], None],
    ) -> Ensemble:
        spec = RunSpec(scene, energy, n_cycles, seed, phases)
        line = spec.command(scene.name, n_particles, place)
        default = block_size(spec, n_particles, threads or os.cpu_count() or 1)
        with output.writable_folder(place), locked(place):
            run, damaged = conduct.open_or_create(
                place, spec, n_particles, None, default, line, self._resume, at_least=True
            )
            tell_damaged(damaged)
            try:
                conduct.complete(run, engines.in_process(threads), progress, n_particles=n_particles)
            except OSError as error:
                why = error.strerror or error
                raise BadInput(f"output {str(place)!r}: {why}; --resume takes up what is kept") from None
            return run.ensemble(n_particles)


def block_size(spec: RunSpec, n_particles: int, threads: int) -> int:
    """Return how many particles of a new run are kept at a time, at most all of them.

    At the end of a block the lanes wait for its slowest particle. Energies spread with the cycles, so that
    what takes seconds has too few particles to wait for: each thread has a share of `fast`, at the least.
    """
    wanted = max(conduct.block_size(spec, threads), SHARE * threads) * spec.n_cycles
    return min(wanted, conduct.MOST_BLOCK, n_particles)
