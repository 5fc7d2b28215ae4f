"""The first particles of a stored run: what is missing of them, and all that is known of them at once."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing

import numpy as np

from fast import Ensemble
from mushrooms.store.blocks import Block, Piece, RunFolder
from mushrooms.store.conduct import keep_all
from mushrooms.store.digest import DIGESTED, part
from mushrooms.store.engines import Engine
from mushrooms.store.layout import Array


def missing(run: RunFolder, n: int) -> Iterator[Piece]:
    """Yield what is still to be followed of the first n particles."""
    for piece in run.missing():
        if piece.first < n:  # what goes on from where it was does so whole
            yield piece if piece.before is not None else piece._replace(n=min(piece.n, n - piece.first))


def complete(run: RunFolder, n: int, engine: Engine, told: Callable[[int], None]) -> None:
    """Follow what is missing of the first n particles, and keep it block by block.

    Args:
        run: to be completed so far; what lacks beyond stays as it is.
        n: at most as many as the run is to have.
        engine: that follows.
        told: how many of them there are, again and again.

    Raises:
        OSError: a block could not be written.
    """
    there = n - sum(min(piece.n, n - piece.first) for piece in run.lacking() if piece.first < n)
    told(there)

    def followed(piece: Piece, _block: Block) -> None:
        nonlocal there
        there += min(piece.n, n - piece.first)
        told(there)

    with closing(engine(run.asked, missing(run, n), lambda n_done: told(there + n_done))) as found:
        keep_all(run, found, followed)


def ensemble_of(run: RunFolder, n: int) -> Ensemble:
    """Return the first n particles of a run as `fast.simulate` would, to the bit; times are their share.

    Raises:
        BadInput: a block is missing or damaged.
    """
    fields = {source: _first(run, n, source) for source in DIGESTED}
    seconds = run.seconds * n / max(run.tally.particles, 1)
    return Ensemble(energy0=run.asked.energy, seconds=seconds, threads=1, **fields)


def _first(run: RunFolder, n: int, source: str) -> Array:
    """Return a field of the first n particles; one without columns where the run holds nothing of it."""
    n_blocks = -(-n // run.shape.block)
    parts = [array for number in range(n_blocks) if (array := part(run, number, source)) is not None]
    return np.concatenate(parts)[:n] if parts else np.zeros((n, run.shape.n_cycles, 0))
