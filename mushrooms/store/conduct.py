"""A run, from what there is of it to its end: what was asked for, what is there, limits, and what is missing.

No decision rests on the time of day: limits and rates are read from a clock that only goes forwards.
"""

from __future__ import annotations

import math
import shutil
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mushrooms.forecast import expected_collisions
from mushrooms.store.asked import Asked, difference, made_by
from mushrooms.store.blocks import AnyRun, Block, Piece, RunFolder, attributes_of, is_run
from mushrooms.store.engines import Engine, Tick, follow
from mushrooms.store.layout import Arrays, Shape
from scene.mouth import narrowings
from scene.refusal import BadInput

BLOCK_COLLISIONS = 2e8  # of a block, some seconds: what a fault can cost, and long beside a block's files
LEAST_BLOCK, MOST_BLOCK = 256, 2**17  # particles: a thread's lanes are full, and memory stays small
ROOM = 2**12  # particles of a new run's block, however few it has: it may be widened
LARGEST_BLOCK = 2**20  # particles that may be asked for: in memory some gigabytes
BLOCK_BYTES = 2**26  # on disk; in memory several times that
LANES_OF_A_THREAD = 128  # particles that a thread needs to be quick
MOST_BLOCKS = 10**6
MOST_CHUNKS = 200  # of a block's array along the cycles: so many fit into MARKER_BYTES of their sums
PROBED = 4  # particles followed again before a run is gone on with
MARKER_BYTES = 2**16  # of a block's files beside its chunks, at most
CLOCK = time.monotonic


class RunLimits(NamedTuple):
    """Where a run stops although it is not at its end; None for no limit.

    Attributes:
        collisions: of a particle.
        seconds: on the clock, from the command's begin.
    """

    collisions: int | None = None
    seconds: float | None = None


class LimitReached(Exception):  # noqa: N818 (nothing is wrong: the run goes on with --resume)
    """A run stopped at a limit, in a state from which it goes on; the limit in a line."""


def block_size(asked: Asked, threads: int) -> int:
    """Return how many particles a block has, a power of two: it takes seconds, and fits into memory."""
    each = expected_collisions(asked.scene, asked.energy, asked.n_cycles)
    least = max(LEAST_BLOCK, LANES_OF_A_THREAD * threads)
    wanted = BLOCK_COLLISIONS / max(each, 1.0) if math.isfinite(each) else LEAST_BLOCK
    most = min(MOST_BLOCK, BLOCK_BYTES // shape_of(asked, 1, 1).bytes_of_a_particle)
    return int(2 ** math.floor(math.log2(max(1, min(max(wanted, least), most)))))


def block_of_new(asked: Asked, n_particles: int, threads: int) -> int:
    """Return how many particles a new run's blocks have: no more than it takes, as chunks are filled up."""
    return min(block_size(asked, threads), max(ROOM, 1 << (n_particles - 1).bit_length()))


def shape_of(asked: Asked, n_particles: int, block: int, chunked: int | None = None) -> Shape:
    """Return the sizes of a run; in a chunk it has so many cycles, by default all.

    Raises:
        BadInput: it would have more blocks than a folder can hold well.
    """
    if n_particles > MOST_BLOCKS * block:
        least = -(-n_particles // MOST_BLOCKS)
        raise BadInput(f"--block = {block}: {n_particles} particles need blocks of at least {least}")
    n_narrowings, n_phases = len(narrowings(asked.scene)), len(asked.phases)
    return Shape(n_particles, block, asked.n_cycles, n_narrowings, n_phases, chunked or asked.n_cycles)


def opened(
    folder: Path,
    asked: Asked,
    n_particles: int,
    block: int | None,
    default: int,
    command: str,
    resume: bool,
    *,
    at_least: bool = False,
) -> tuple[RunFolder, list[int]]:
    """Return the run of a folder, new or gone on with, and the numbers of the blocks found damaged.

    Args:
        folder: held by the caller.
        asked: for the run; with as many cycles as there are, or more: then it is lengthened.
        n_particles: as many as there are, or more: then it is widened.
        block: particles of a block; None for what is there, or `default`.
        default: for a new run.
        command: that makes it.
        resume: whether a run that is there may be gone on with.
        at_least: whether one that has more particles will do, and stays as large as it is.

    Raises:
        BadInput: the folder has another run, or this one and `resume` was not asked for; it is of another
            version or its numbers do not come out here; the disk is too small.
    """
    if not is_run(folder):
        run = RunFolder(folder, asked, shape_of(asked, n_particles, block or default), command)
        run.check()
        _check_disk(run)
        return run, []
    found = described(folder, asked, {} if block is None else {"block": block})
    if at_least and found["particles"] > n_particles:
        n_particles, command = found["particles"], found["command"]
    _check_growth(folder, "particles", found["particles"], n_particles)
    if not resume:
        raise BadInput(f"output {str(folder)!r} holds this run: --resume goes on with it")
    most = MOST_CHUNKS * found["cycles_of_a_chunk"]
    if asked.n_cycles > most:
        raise BadInput(
            f"output {str(folder)!r}: --cycles = {asked.n_cycles}, must be at most {most} for a run that"
            f" began with {found['cycles_of_a_chunk']}: more need another folder"
        )
    shape = shape_of(asked, n_particles, found["block"], found["cycles_of_a_chunk"])
    run = RunFolder(folder, asked, shape, command)
    damaged = run.check()
    _probe(run)
    _check_disk(run)
    run.describe()
    return run, damaged


def described(folder: Path, asked: Asked, more: dict[str, object]) -> dict[str, Any]:
    """Return what a stored run says of itself, if it is the one asked for, with as many cycles or fewer.

    Raises:
        BadInput: it is another: in what, and both values; or its description is damaged.
    """
    found, wanted = attributes_of(folder), asked.to_data() | more
    other = difference(found, {name: value for name, value in wanted.items() if name != "cycles"})
    if other is not None:
        raise BadInput(f"output {str(folder)!r} holds another run: {other}")
    _check_growth(folder, "cycles", found["cycles"], asked.n_cycles)
    return found


def _check_growth(folder: Path, name: str, there: int, wanted: int) -> None:
    if there > wanted:
        why = f"{name} = {there} there, {wanted} asked for: a run only grows"
        raise BadInput(f"output {str(folder)!r} holds another run: {why}")


def complete(
    run: AnyRun,
    asked: Asked,
    engine: Engine,
    limits: RunLimits,
    tick: Tick,
    followed: Callable[[Block], None],
) -> None:
    """Follow what is missing, and keep it block by block.

    Args:
        run: to be completed.
        asked: what it was asked for.
        engine: that follows.
        limits: at which to stop.
        tick: told of the particles done in the block under way.
        followed: told of every block, before it is kept.

    Raises:
        LimitReached: a limit; what was kept stays.
        OSError: a block could not be written.
    """
    begin = CLOCK()

    def looked(n_done: int) -> None:
        tick(n_done)
        if limits.seconds is not None and CLOCK() - begin > limits.seconds:
            raise LimitReached(f"--max-seconds = {limits.seconds:g} have passed")

    with closing(engine(asked, run.missing(), looked)) as found:
        keep_all(run, _within(limits.collisions, found), lambda _piece, block: followed(block))


def _within(most: int | None, found: Iterable[tuple[Piece, Block]]) -> Iterator[tuple[Piece, Block]]:
    """Hand on blocks up to one with a particle that makes too many collisions."""
    for piece, block in found:
        if most is not None and block.tally.most > most:
            raise LimitReached(
                f"a particle of block {piece.number} makes {block.tally.most} collisions,"
                f" --max-collisions = {most}"
            )
        yield piece, block


def keep_all(
    run: AnyRun, found: Iterable[tuple[Piece, Block]], followed: Callable[[Piece, Block], None]
) -> None:
    """Keep blocks, each while the next one is followed: so that two are in memory, and no more.

    Args:
        run: keeps them.
        found: the blocks, followed as they are asked for.
        followed: told of each as soon as it is there, before it is kept.

    Raises:
        OSError: a block could not be written; the one followed meanwhile is dropped. However this ends, the
            block being written is written first.
    """
    with ThreadPoolExecutor(1) as writer:
        under_way: Future[None] | None = None
        for piece, block in found:
            if under_way is not None:
                under_way.result()
            under_way = writer.submit(run.keep, piece, block)
            followed(piece, block)
        if under_way is not None:
            under_way.result()


def _probe(run: RunFolder) -> None:
    """Refuse to go on where the particles that are there would come out otherwise.

    The first ones are followed again, and where they are to be lengthened once more through all cycles, from
    their starts and from where they are.
    """
    there = run.first_there()
    if there is None:
        return
    stored = {name: array[:PROBED] for name, array in run.block(there).arrays.items()}
    n, n_cycles = stored["cycle_energies"].shape
    piece, asked = Piece(there, there * run.shape.block, n), run.asked
    first = follow(asked._replace(n_cycles=n_cycles), piece, None)
    _compare(run, stored, first.arrays)
    if n_cycles < asked.n_cycles:
        longer = follow(asked, piece._replace(before=first._replace(arrays=stored)), None)
        _compare(run, longer.arrays, follow(asked, piece, None).arrays)


def _compare(run: RunFolder, ones: Arrays, others: Arrays) -> None:
    for name, one in ones.items():
        if not np.array_equal(one, others[name], equal_nan=one.dtype.kind == "f"):
            made, here = attributes_of(run.folder), made_by()
            by = next((key for key in here if made.get(key) != here[key]), "versions")
            raise BadInput(
                f"output {str(run.folder)!r}: {name} of its first particles comes out otherwise here, where"
                f" {by} = {here[by]}; it was made by {made.get(by)}; another --out begins anew"
            )


def _check_disk(run: RunFolder) -> None:
    # A block's chunks are filled up, whatever it lacks and however few particles it has.
    each = run.shape.block * run.shape.bytes_of_a_particle + MARKER_BYTES
    needed = each * sum(1 for _ in run.lacking())
    free = shutil.disk_usage(run.folder).free
    if needed > free:
        raise BadInput(
            f"output {str(run.folder)!r}: {needed / 1e9:.3g} GB to be written, {free / 1e9:.3g} GB are free"
        )
