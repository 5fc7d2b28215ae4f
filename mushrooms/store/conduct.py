"""A run, from what there is of it to its end: the specification, what is there, limits, and what is missing.

No decision rests on the time of day: limits and rates are read from a clock that only goes forwards.
"""

from __future__ import annotations

import math
import shutil
import sys
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np

from mushrooms.store.engines import Engine, follow
from mushrooms.store.run import BlockRange, StoredRun, attributes_of, is_run
from mushrooms.store.spec import Arrays, RunSpec, difference, made_by, shape_of
from mushrooms.store.summary import expected_collisions
from scene import BadInput

BLOCK_COLLISIONS = 2e8  # of a block, some seconds: what a fault can cost, and long beside a block's files
LEAST_BLOCK, MOST_BLOCK = 256, 2**17  # particles: a thread's lanes are full, and memory stays small
ROOM = 2**12  # particles of a new run's block, however few it has: it may be widened
BLOCK_BYTES = 2**26  # on disk; in memory several times that
LANES_OF_A_THREAD = 128  # particles that a thread needs to be quick
MOST_BLOCKS = 10**6
PROBED = 4  # particles followed again before a run is gone on with
MARKER_BYTES = 2**16  # of a block's files beside its chunks, at most
CLOCK = time.monotonic


class LimitReached(Exception):  # noqa: N818 (nothing is wrong: the run goes on with --resume)
    """A run stopped at a limit, in a state from which it goes on; the limit in a line."""


def block_size(spec: RunSpec, threads: int) -> int:
    """Return how many particles a block has, a power of two: it takes seconds, and fits into memory."""
    each = expected_collisions(spec.scene, spec.energy, spec.n_cycles)
    least = max(LEAST_BLOCK, LANES_OF_A_THREAD * threads)
    wanted = BLOCK_COLLISIONS / max(each, 1.0) if math.isfinite(each) else LEAST_BLOCK
    most = min(MOST_BLOCK, BLOCK_BYTES // shape_of(spec, 1, 1).bytes_of_a_particle)
    return int(2 ** math.floor(math.log2(max(1, min(max(wanted, least), most)))))


def block_of_new(spec: RunSpec, n_particles: int, threads: int) -> int:
    """Return how many particles a new run's blocks have: no more than it takes, as chunks are filled up."""
    return min(block_size(spec, threads), max(ROOM, 1 << (n_particles - 1).bit_length()))


def open_or_create(
    folder: Path,
    spec: RunSpec,
    n_particles: int,
    block: int | None,
    default: int,
    command: str,
    resume: bool,
    *,
    at_least: bool = False,
) -> StoredRun:
    """Return the run of a folder, new or gone on with; blocks found damaged are told of on stderr.

    Args:
        folder: held by the caller.
        spec: with as many cycles as there are, or more: then the run is lengthened.
        n_particles: as many as there are, or more: then it is widened.
        block: particles of a block; None for what is there, or `default`.
        default: for a new run.
        command: that makes it.
        resume: whether a run that is there may be gone on with.
        at_least: whether one that has more particles will do, and stays as large as it is.

    Raises:
        BadInput: the folder has another run, or this one and `resume` was not asked for; it is of another
            version or its numbers do not come out here; it has too many blocks; the disk is too small.
    """
    found: dict[str, Any] = {"block": block or default, "cycles_of_a_chunk": None}
    is_there = is_run(folder)
    if is_there:
        found = read_description(folder, spec, {} if block is None else {"block": block})
        if at_least and found["particles"] > n_particles:
            n_particles, command = found["particles"], found["command"]
        _check_growth(folder, "particles", found["particles"], n_particles)
        if not resume:
            raise BadInput(f"output {str(folder)!r} holds this run: --resume goes on with it")
    if n_particles > MOST_BLOCKS * found["block"]:
        least = -(-n_particles // MOST_BLOCKS)
        raise BadInput(f"--block = {found['block']}: {n_particles} particles need blocks of at least {least}")
    shape = shape_of(spec, n_particles, found["block"], found["cycles_of_a_chunk"])
    run = StoredRun(folder, spec, shape, command)
    damaged = run.check()
    if is_there:
        _probe(run)
    _check_disk(run)
    if is_there:
        run.describe()
        if damaged:
            few = ", ".join(map(str, damaged[:5])) + (" ..." if len(damaged) > 5 else "")
            print(f"damaged or broken off: {len(damaged)} blocks ({few}), followed again", file=sys.stderr)
    return run


def read_description(folder: Path, spec: RunSpec, more: dict[str, object]) -> dict[str, Any]:
    """Return the description of a stored run, if it is the one asked for, with as many cycles or fewer.

    Raises:
        BadInput: it is another: in what, and both values; or its description is damaged.
    """
    found, wanted = attributes_of(folder), spec.to_data() | more
    other = difference(found, {name: value for name, value in wanted.items() if name != "cycles"})
    if other is not None:
        raise BadInput(f"output {str(folder)!r} holds another run: {other}")
    _check_growth(folder, "cycles", found["cycles"], spec.n_cycles)
    return found


def _check_growth(folder: Path, name: str, there: int, wanted: int) -> None:
    if there > wanted:
        why = f"{name} = {there} there, {wanted} asked for: a run only grows"
        raise BadInput(f"output {str(folder)!r} holds another run: {why}")


def complete(
    run: StoredRun,
    engine: Engine,
    on_progress: Callable[[int], None],
    *,
    n_particles: int | None = None,
    max_collisions: int | None = None,
    max_seconds: float | None = None,
) -> None:
    """Follow what is missing of the first particles, and keep it block by block.

    A block is written while the next one is followed, so that two are in memory and no more. However this
    ends, the block being written is written first.

    Args:
        run: to be completed so far; what is missing beyond stays as it is.
        engine: that follows.
        on_progress: called with the number of finished particles, again and again.
        n_particles: how many of the first particles; by default all.
        max_collisions: of a particle: stop if one makes more.
        max_seconds: on the clock: stop after them.

    Raises:
        LimitReached: a limit; what was kept stays.
        OSError: a block could not be written; the one followed meanwhile is dropped.
    """
    begin, n = CLOCK(), run.shape.n_particles if n_particles is None else n_particles
    there = n - sum(block_range.n for block_range in run.lacking() if block_range.first < n)

    def report(n_done: int) -> None:
        on_progress(max(0, there + n_done))  # the last block may have more particles than are asked for
        if max_seconds is not None and CLOCK() - begin > max_seconds:
            raise LimitReached(f"--max-seconds = {max_seconds:g} have passed")

    block_ranges = (block_range for block_range in run.missing() if block_range.first < n)
    with closing(engine(run.spec, block_ranges, report)) as found, ThreadPoolExecutor(1) as writer:
        under_way: Future[None] | None = None
        for block_range, block in found:
            most = block.tally.most
            if max_collisions is not None and most > max_collisions:
                made = f"a particle of block {block_range.number} makes {most} collisions"
                raise LimitReached(f"{made}, --max-collisions = {max_collisions}")
            if under_way is not None:
                under_way.result()
            under_way = writer.submit(run.keep, block_range, block)
            there += block_range.n
            on_progress(max(0, there))
        if under_way is not None:
            under_way.result()


def _probe(run: StoredRun) -> None:
    """Refuse to go on where the particles that are there would come out otherwise.

    The first ones are followed again, and where they are to be lengthened once more through all cycles, from
    their starts and from where they are.
    """
    there = run.first_there()
    if there is None:
        return
    stored = {name: array[:PROBED] for name, array in run.block(there).arrays.items()}
    n, n_cycles = stored["cycle_energies"].shape
    block_range, spec = BlockRange(there, there * run.shape.block, n), run.spec
    first = follow(spec._replace(n_cycles=n_cycles), block_range, None)
    _compare(run, stored, first.arrays)
    if n_cycles < spec.n_cycles:
        longer = follow(spec, block_range._replace(before=first._replace(arrays=stored)), None)
        _compare(run, longer.arrays, follow(spec, block_range, None).arrays)


def _compare(run: StoredRun, ones: Arrays, others: Arrays) -> None:
    for name, one in ones.items():
        if not np.array_equal(one, others[name], equal_nan=one.dtype.kind == "f"):
            made, here = attributes_of(run.folder), made_by()
            by = next((key for key in here if made.get(key) != here[key]), "versions")
            raise BadInput(
                f"output {str(run.folder)!r}: {name} of its first particles comes out otherwise here, where"
                f" {by} = {here[by]}; it was made by {made.get(by)}; another --out begins anew"
            )


def _check_disk(run: StoredRun) -> None:
    # A block's chunks are filled up, whatever it lacks and however few particles it has.
    each = run.shape.block * run.shape.bytes_of_a_particle + MARKER_BYTES
    needed = each * sum(1 for _ in run.lacking())
    free = shutil.disk_usage(run.folder).free
    if needed > free:
        raise BadInput(
            f"output {str(run.folder)!r}: {needed / 1e9:.3g} GB to be written, {free / 1e9:.3g} GB are free"
        )
