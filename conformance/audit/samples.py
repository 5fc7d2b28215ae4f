"""Samples: what a run's particles did, followed in blocks that outlive an interruption.

Every block is saved as soon as it is followed, sealed by a checksum. A saved block is used again only if no
bit of it has changed, and it was made from the same scene, energy, seed and number of particles.
"""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

import scene as scenes
from conformance.audit.runs import Simulation, Size, block_seed, scene_of
from scene.files import sealed, unsealed, write_file

if TYPE_CHECKING:
    from fast import Ensemble

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
Simulate = Callable[..., "Ensemble"]
Progress = Callable[[str, int, int], None]  # run, particles done, particles in all
Arrays = dict[str, npt.NDArray[Any]]

FORM = 2  # of a saved block: raised when its arrays change, so that older ones are followed anew
ARRAYS = ("s", "t_in", "t_out", "takes_part", "phase_s", "phase_captured", "stem_hits")
COUNTS = ("n_particles", "n_undecided", "n_undefined", "n_collisions", "n_careful")
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
        sha256: of all blocks' results.
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
    folder: Path | None = None,
    resume: bool = False,
    progress: Progress | None = None,
) -> Sample:
    """Follow a run's particles, or take up what was saved of them.

    Args:
        simulate: `fast.simulate`, or another with its signature.
        run: what to simulate.
        size: quick or full.
        seed: the audit's.
        threads: for the stepper; all by default.
        folder: where blocks are saved; None to keep none.
        resume: whether blocks saved earlier may be used.
        progress: told of every block.
    """
    total = run.n_particles(size)
    blocks = []
    for number, first in enumerate(range(0, total, run.block)):
        n = min(run.block, total - first)
        path = folder / f"{run.name}-{number:03}.npz" if folder else None
        key = _key(run, n, block_seed(seed, run, number))
        block = _load(path, key) if path and resume else None
        if block is None:
            block = _follow(simulate, run, n, block_seed(seed, run, number), threads)
            if path:
                write_file(path, _packed({"key": np.array(key), **block}))
        blocks.append(block)
        if progress:
            progress(run.name, first + n, total)
    return gathered(run, blocks)


def _key(run: Simulation, n: int, seed: int) -> str:
    scene = scenes.to_data(scene_of(run))
    return json.dumps([FORM, scene, run.energy, n, run.n_cycles, run.phases, seed])


def _follow(simulate: Simulate, run: Simulation, n: int, seed: int, threads: int | None) -> Arrays:
    ensemble = simulate(
        scene_of(run),
        n_particles=n,
        energy=run.energy,
        n_cycles=run.n_cycles,
        seed=seed,
        threads=threads,
        phases=run.phases,
    )
    return reduced(ensemble)


def reduced(ensemble: Ensemble) -> Arrays:
    """Return what the audit keeps of an ensemble, particles not followed left out."""
    energies = ensemble.cycle_energies
    followed = (ensemble.outcome == 0) & np.all(np.isfinite(energies) & (energies > 0), axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        s, phase_s = np.log(energies / ensemble.energy0), np.log(ensemble.phase_energies / ensemble.energy0)
    counts = [
        len(followed),
        np.sum(ensemble.outcome == 1),
        np.sum(ensemble.outcome == 2),
        np.sum(ensemble.n_collisions),
        np.sum(ensemble.n_careful),
    ]
    return {
        "s": s[followed],
        "t_in": ensemble.t_in[followed],
        "t_out": ensemble.t_out[followed],
        "takes_part": ensemble.takes_part()[followed],
        "phase_s": phase_s[followed],
        "phase_captured": ensemble.phase_captured[followed],
        "stem_hits": ensemble.wall_counts[followed, 2:].sum(axis=1),
        "counts": np.array(counts, dtype=np.int64),
        "seconds": np.array(ensemble.seconds * ensemble.threads),
        "sha256": np.array(ensemble.sha256()),
    }


def gathered(run: Simulation, blocks: list[Arrays]) -> Sample:
    """Join blocks into a sample."""
    arrays: dict[str, Any] = {name: np.concatenate([block[name] for block in blocks]) for name in ARRAYS}
    counts = sum((block["counts"] for block in blocks), np.zeros(len(COUNTS), np.int64)).tolist()
    digest = hashlib.sha256("".join(str(block["sha256"]) for block in blocks).encode()).hexdigest()
    seconds = sum(float(block["seconds"]) for block in blocks)
    return Sample(run, **arrays, **dict(zip(COUNTS, counts, strict=True)), seconds=seconds, sha256=digest)


def _packed(content: Arrays) -> bytes:
    file = io.BytesIO()
    np.savez_compressed(file, **content)  # type: ignore[arg-type]  # its other argument is no array
    return sealed(file.getvalue())


def _load(path: Path, key: str) -> Arrays | None:
    """Return a saved block; None when there is none, it is broken or was made from something else."""
    content = unsealed(path)
    if content is None:
        return None
    with np.load(io.BytesIO(content), allow_pickle=False) as saved:
        if str(saved["key"]) != key:
            return None
        return {name: saved[name] for name in saved.files if name != "key"}
