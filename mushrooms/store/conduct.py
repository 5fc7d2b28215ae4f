"""A run, from what there is of it to its end: limits, what is missing, and what follows it.

An engine is handed ranges of particles and yields blocks, in any order: in this process, or from
workers of a Dask cluster. The bits of a particle depend on its number alone: it does not matter
which engine, machine or block followed it, nor how often it was tried. No decision rests on the
time of day: limits and rates are read from a clock that only goes forwards.
"""

import logging
import math
import shutil
import sys
import time
from collections import Counter
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from contextlib import closing
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

import fast
import mushrooms
from mushrooms.store.run import BlockRange, StoredRun, attributes_of, is_run
from mushrooms.store.spec import RunSpec, columns, difference, made_by, shape_of
from mushrooms.store.summary import expected_collisions
from scene import BadInput

# Receives the number of finished particles of the block in progress; its exceptions end the engine.
OnProgress = Callable[[int], None]
Following = Generator[tuple[BlockRange, fast.Paused], None, None]
Engine = Callable[[RunSpec, Iterator[BlockRange], OnProgress], Following]
RETRIES = 10  # of a block whose workers fail or die
BLOCKS_AHEAD = (
    2  # waiting for each thread of the cluster: no worker idles, and few blocks are in memory
)
CONNECT_TIMEOUT = 10.0  # seconds in which a scheduler must answer
POLL_INTERVAL = 0.5  # seconds after which limits are looked at while no block comes


def follow(
    spec: RunSpec,
    block_range: BlockRange,
    threads: int | None,
    on_progress: OnProgress | None = None,
) -> fast.Paused:
    """Follow the particles of a block, from their starts or from where they were.

    Raises:
        BadInput: as `fast.go_on`.
    """
    return fast.go_on(
        spec.scene,
        n_particles=block_range.n,
        energy=spec.energy,
        n_cycles=spec.n_cycles,
        seed=spec.seed,
        first=block_range.first,
        threads=threads,
        phases=spec.phases,
        progress=on_progress,
        before=block_range.before,
    )


def in_process(
    spec: RunSpec, block_ranges: Iterator[BlockRange], on_progress: OnProgress, threads: int | None
) -> Following:
    """Follow one block after another with all threads."""
    for block_range in block_ranges:
        yield block_range, follow(spec, block_range, threads, on_progress)


def follow_elsewhere(
    version: str, spec: RunSpec, block_range: BlockRange, threads: int
) -> fast.Paused:
    """Follow a block on a worker, which must be of the version that asks.

    Raises:
        BadInput: it is of another.
    """
    if version != mushrooms.__version__:
        raise BadInput(f"a worker has version {mushrooms.__version__}, must be {version}")
    return follow(spec, block_range, threads)


def by_dask(
    spec: RunSpec,
    block_ranges: Iterator[BlockRange],
    on_progress: OnProgress,
    address: str,
    threads: int | None,
) -> Following:
    """Hand blocks to the workers of a Dask scheduler.

    Args:
        spec: the run.
        block_ranges: to be followed.
        on_progress: see `OnProgress`.
        address: of the scheduler, as tcp://host:8786.
        threads: for each block; 1 by default, as a worker has as many blocks at a time as it has
            threads.

    Raises:
        BadInput: dask.distributed is not installed, or no scheduler answers.
        ConnectionError: the cluster is lost.
    """
    try:
        from distributed import Client
        from distributed.comm import CommClosedError, resolve_address
    except ImportError:
        raise BadInput(
            "--dask needs dask.distributed: pip install 'oscillating-mushrooms[scale]'"
        ) from None
    try:
        resolve_address(address)  # of what is no address the client is made, and cannot be closed
        # Not the process's default: what else computes with Dask here would wait for this one, even
        # after it has failed to connect.
        client = Client(address, timeout=CONNECT_TIMEOUT, set_as_default=False)
    except (OSError, ValueError) as error:
        raise BadInput(
            f"--dask = {address}: no scheduler answers ({type(error).__name__})"
        ) from None
    # Dask logs pages of its own when a cluster is lost, which are of no use to go on with the run.
    log = logging.getLogger("distributed.client")
    level = log.level
    log.setLevel(logging.CRITICAL + 1)
    try:
        with client:
            yield from _hand_out(client, spec, block_ranges, on_progress, threads or 1)
    except (CancelledError, CommClosedError) as error:
        why = type(error).__name__
        raise ConnectionError(f"--dask = {address}: the scheduler has gone ({why})") from None
    except RuntimeError as error:
        if "deserialization" not in str(error):
            raise
        raise ConnectionError(
            f"--dask = {address}: the scheduler must have this project too"
        ) from None
    finally:
        log.setLevel(level)


def _hand_out(
    client: Any,
    spec: RunSpec,
    block_ranges: Iterator[BlockRange],
    on_progress: OnProgress,
    threads: int,
) -> Following:
    """Keep every worker busy, and yield what comes back.

    What is still out is dropped at the end.
    """
    from distributed import KilledWorker, wait

    out = dict[Any, BlockRange]()
    n_killed = Counter[int]()

    def submit(block_range: BlockRange) -> None:
        asked_for = (mushrooms.__version__, spec, block_range, threads)
        options = {"pure": False, "retries": RETRIES, "priority": -block_range.number}
        out[client.submit(follow_elsewhere, *asked_for, **options)] = block_range

    try:
        while True:
            n_wanted = max(1, BLOCKS_AHEAD * sum(client.nthreads().values())) - len(out)
            for block_range in islice(block_ranges, max(0, n_wanted)):
                submit(block_range)
            if not out:
                return
            on_progress(0)
            try:
                with client.as_current():
                    done = wait(
                        list(out), timeout=POLL_INTERVAL, return_when="FIRST_COMPLETED"
                    ).done
            except TimeoutError:
                continue
            for future in done:
                block_range = out.pop(future)
                try:
                    block = future.result()
                except KilledWorker:
                    # So many workers died with it that the scheduler gave it up; it may not be its
                    # fault.
                    n_killed[block_range.number] += 1
                    _check_killed(block_range, n_killed[block_range.number])
                    submit(block_range)
                else:
                    yield block_range, block
    finally:
        client.cancel(list(out))


def _check_killed(block_range: BlockRange, n_killed: int) -> None:
    """Give a block up that workers have died of too often."""
    if n_killed > RETRIES:
        raise ConnectionError(
            f"--dask: workers die of block {block_range.number} again and again"
        ) from None


BLOCK_COLLISIONS = (
    2e8  # of a block, some seconds: what a fault can cost, and long beside a block's files
)
LEAST_BLOCK = 256  # particles: a thread's lanes are full
MOST_BLOCK = 2**17  # memory stays small
ROOM = 2**12  # particles of a new run's block, however few it has: it may be widened
BLOCK_BYTES = 2**26  # on disk; in memory several times that
LANES_OF_A_THREAD = 128  # particles that a thread needs to be quick
MOST_BLOCKS = 10**6
MOST_CHUNKS = 200  # of a block's array along the cycles: each is a file
PROBED = 4  # particles followed again before a run is gone on with
MARKER_BYTES = 2**16  # of a block's files beside its chunks, at most
CLOCK = time.monotonic


class LimitReached(Exception):  # noqa: N818 (nothing is wrong: the run goes on with --resume)
    """A run stopped at a limit, in a state from which it goes on; the limit in a line."""


def block_size(spec: RunSpec, threads: int) -> int:
    """Return how many particles a block has, a power of two.

    It takes seconds, and fits into memory.
    """
    each = expected_collisions(spec.scene, spec.energy, spec.n_cycles)
    least = max(LEAST_BLOCK, LANES_OF_A_THREAD * threads)
    wanted = BLOCK_COLLISIONS / max(each, 1.0) if math.isfinite(each) else LEAST_BLOCK
    most = min(MOST_BLOCK, BLOCK_BYTES // shape_of(spec, 1, 1).bytes_of_a_particle)
    return int(2 ** math.floor(math.log2(max(1, min(max(wanted, least), most)))))


def block_of_new(spec: RunSpec, n_particles: int, threads: int) -> int:
    """Return how many particles a new run's blocks have.

    They are no more than the run takes, because chunks are filled up.
    """
    return min(block_size(spec, threads), max(ROOM, 1 << (n_particles - 1).bit_length()))


def open_or_create(
    folder: Path,
    spec: RunSpec,
    n_particles: int,
    block: int | None,
    default: int,
    name: str,
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
        name: of the scene, for the command that makes the run.
        resume: whether a run that is there may be gone on with.
        at_least: whether one that has more particles will do, and stays as large as it is.

    Raises:
        BadInput: the folder has another run, or this one and `resume` was not asked for; it is of
            another version or its numbers do not come out here; it has too many blocks; the disk is
            too small.
    """
    found: dict[str, Any] = {"block": block or default, "cycles_of_a_chunk": None}
    is_there = is_run(folder)
    if is_there:
        found = read_description(folder, spec, {} if block is None else {"block": block})
        if at_least:
            n_particles = max(n_particles, found["particles"])
        _check_growth(folder, "particles", found["particles"], n_particles)
        if not resume:
            raise BadInput(f"output {str(folder)!r} holds this run: --resume goes on with it")
        most = MOST_CHUNKS * found["cycles_of_a_chunk"]
        if spec.n_cycles > most:
            raise BadInput(
                f"output {str(folder)!r}: --cycles = {spec.n_cycles}, must be at most {most} for a"
                f" run that began with {found['cycles_of_a_chunk']}: more need another folder"
            )
    if n_particles > MOST_BLOCKS * found["block"]:
        least = -(-n_particles // MOST_BLOCKS)
        raise BadInput(
            f"--block = {found['block']}: {n_particles} particles need blocks of at least {least}"
        )
    shape = shape_of(spec, n_particles, found["block"], found["cycles_of_a_chunk"])
    run = StoredRun(folder, spec, shape, spec.command(name, n_particles, folder))
    damaged = run.check()
    _check_disk(run)
    if is_there:
        _probe(run)
        run.describe()
        if damaged:
            _tell_damaged(damaged)
    return run


def _tell_damaged(blocks: list[int]) -> None:
    """Say on stderr which blocks are followed again."""
    few = ", ".join(map(str, blocks[:5])) + (" ..." if len(blocks) > 5 else "")
    count = f"damaged or broken off: {len(blocks)} blocks ({few}), followed again"
    print(count, file=sys.stderr)


def read_description(folder: Path, spec: RunSpec, more: dict[str, object]) -> dict[str, Any]:
    """Return a stored run's description, if it is the one asked for with no more cycles.

    Raises:
        BadInput: it is another: in what, and both values; or its description is damaged.
    """
    found = attributes_of(folder)
    wanted = spec.to_data() | more
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

    A block is written while the next one is followed, so that two are in memory and no more.
    However this ends, the block being written is written first.

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
    begin = CLOCK()
    n = run.shape.n_particles if n_particles is None else n_particles
    there = n - sum(block_range.n for block_range in run.lacking() if block_range.first < n)

    def report(n_done: int) -> None:
        # The last block may have more particles than are asked for.
        on_progress(max(0, there + n_done))
        if max_seconds is not None and CLOCK() - begin > max_seconds:
            raise LimitReached(f"--max-seconds = {max_seconds:g} have passed")

    block_ranges = (block_range for block_range in run.missing() if block_range.first < n)
    with closing(engine(run.spec, block_ranges, report)) as found, ThreadPoolExecutor(1) as writer:
        under_way: Future[None] | None = None
        for block_range, block in found:
            most = int(block.ensemble.n_collisions.max())
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

    The first ones are followed again, and where they are to be lengthened once more through all
    cycles, from their starts and from where they are.
    """
    there = run.first_there()
    if there is None:
        return
    stored = run.block(there, PROBED)
    n, n_cycles = stored.ensemble.cycle_energies.shape
    block_range = BlockRange(there, there * run.shape.block, n)
    spec = run.spec
    _compare(run, stored, follow(spec._replace(n_cycles=n_cycles), block_range, None))
    if n_cycles < spec.n_cycles:
        longer = follow(spec, block_range._replace(before=stored), None)
        _compare(run, longer, follow(spec, block_range, None))


def _compare(run: StoredRun, one: fast.Paused, other: fast.Paused) -> None:
    ones = columns(one)
    others = columns(other)
    for name in run.shape.names:
        if not np.array_equal(ones[name], others[name], equal_nan=ones[name].dtype.kind == "f"):
            made = attributes_of(run.folder)
            here = made_by()
            by = next((key for key in here if made.get(key) != here[key]), "versions")
            raise BadInput(
                f"output {str(run.folder)!r}: {name} of its first particles comes out otherwise"
                f" here, where {by} = {here[by]}; it was made by {made.get(by)}; another --out"
                " begins anew"
            )


def _check_disk(run: StoredRun) -> None:
    # A block's chunks are filled up, whatever it lacks and however few particles it has.
    each = run.shape.block * run.shape.bytes_of_a_particle + MARKER_BYTES
    needed = each * sum(1 for _ in run.lacking())
    free = shutil.disk_usage(run.folder).free
    if needed > free:
        raise BadInput(
            f"output {str(run.folder)!r}: {needed / 1e9:.3g} GB to be written, {free / 1e9:.3g} GB"
            " are free"
        )
