"""The SHA-256 of a run, that of `fast.Ensemble.sha256`, from its blocks: memory does not grow with the run.

It goes field by field over all particles, so that blocks of any size come to the same.
"""

from __future__ import annotations

import hashlib

import numpy as np

from fast import Ensemble
from mushrooms.store.blocks import AnyRun
from mushrooms.store.layout import Array

DIGESTED = Ensemble._fields[1:-2]  # neither energy0 nor times


def sha256(run: AnyRun) -> str:
    """Return the SHA-256 of a run that has all its blocks.

    Raises:
        BadInput: a block is missing or damaged.
    """
    digest = hashlib.sha256()
    for name in DIGESTED:
        for number in range(run.shape.n_blocks):
            array = part(run, number, name)
            if array is not None:
                digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()


def part(run: AnyRun, number: int, name: str) -> Array | None:
    """Return a field of `fast.Ensemble` for the particles of a block; None where it holds nothing."""
    if name == "energy":
        return run.read(number, "cycle_energies")[:, -1]
    if name == "n_collisions":
        return np.asarray(run.read(number, "wall_counts").sum(axis=1))
    if name not in run.shape.names:
        return None
    array = run.read(number, name)
    return array.astype(bool) if name == "phase_captured" else array  # of Zarr's -1 none is left
