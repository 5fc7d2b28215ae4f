"""Engines: what follows the blocks of a run, in this process or on the workers of a Dask cluster.

An engine is handed ranges of particles and yields blocks, in any order. Every particle's bits depend on its
number alone: it does not matter which engine, machine or block followed it, nor how often it was tried.
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import CancelledError
from itertools import islice
from typing import Any

import fast
import mushrooms
from mushrooms.store.run import Block, BlockRange
from mushrooms.store.spec import RunSpec, columns, paused_of
from scene import BadInput

# Receives the number of finished particles of the block in progress; its exceptions end the engine.
OnProgress = Callable[[int], None]
Following = Generator[tuple[BlockRange, Block], None, None]
Engine = Callable[[RunSpec, Iterator[BlockRange], OnProgress], Following]
RETRIES = 10  # of a block whose workers fail or die
BLOCKS_AHEAD = 2  # waiting for each thread of the cluster: no worker idles, and few blocks are in memory
CONNECT_TIMEOUT = 10.0  # seconds in which a scheduler must answer
POLL_INTERVAL = 0.5  # seconds after which limits are looked at while no block comes


def follow(
    spec: RunSpec, block_range: BlockRange, threads: int | None, on_progress: OnProgress | None = None
) -> Block:
    """Follow the particles of a block, from their starts or from where they were.

    Raises:
        BadInput: as `fast.go_on`.
    """
    before = None
    if block_range.before is not None:
        before = paused_of(block_range.before.arrays, spec.energy, block_range.before.seconds)
    paused = fast.go_on(
        spec.scene,
        n_particles=block_range.n,
        energy=spec.energy,
        n_cycles=spec.n_cycles,
        seed=spec.seed,
        first=block_range.first,
        threads=threads,
        phases=spec.phases,
        progress=on_progress,
        before=before,
    )
    ensemble = paused.ensemble
    return Block(columns(paused), ensemble.seconds * ensemble.threads)


def in_process(threads: int | None) -> Engine:
    """Return the engine that follows one block after another with all threads."""

    def engine(spec: RunSpec, block_ranges: Iterator[BlockRange], on_progress: OnProgress) -> Following:
        for block_range in block_ranges:
            yield block_range, follow(spec, block_range, threads, on_progress)

    return engine


def follow_elsewhere(version: str, spec: RunSpec, block_range: BlockRange, threads: int) -> Block:
    """Follow a block on a worker, which must be of the version that asks.

    Raises:
        BadInput: it is of another.
    """
    if version != mushrooms.__version__:
        raise BadInput(f"a worker has version {mushrooms.__version__}, must be {version}")
    return follow(spec, block_range, threads)


def by_dask(address: str, threads: int | None) -> Engine:
    """Return the engine that hands blocks to the workers of a Dask scheduler.

    Args:
        address: of the scheduler, as tcp://host:8786.
        threads: for each block; 1 by default, as a worker has as many blocks at a time as it has threads.

    Raises:
        BadInput: dask.distributed is not installed, or no scheduler answers.
        ConnectionError: the engine; the cluster is lost.
    """
    try:
        from distributed import Client
        from distributed.comm import CommClosedError, resolve_address
    except ImportError:
        raise BadInput("--dask needs dask.distributed: pip install 'oscillating-mushrooms[scale]'") from None

    def engine(spec: RunSpec, block_ranges: Iterator[BlockRange], on_progress: OnProgress) -> Following:
        try:
            resolve_address(address)  # of what is no address the client is made, and cannot be closed
            # Not the process's default: what else computes with Dask here would wait for this one, even
            # after it has failed to connect.
            client = Client(address, timeout=CONNECT_TIMEOUT, set_as_default=False)
        except (OSError, ValueError) as error:
            raise BadInput(f"--dask = {address}: no scheduler answers ({type(error).__name__})") from None
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
            raise ConnectionError(f"--dask = {address}: the scheduler must have this project too") from None
        finally:
            log.setLevel(level)

    return engine


def _hand_out(
    client: Any, spec: RunSpec, block_ranges: Iterator[BlockRange], on_progress: OnProgress, threads: int
) -> Following:
    """Keep every worker busy, and yield what comes back; what is still out is dropped at the end."""
    from distributed import KilledWorker, wait

    out, n_killed = dict[Any, BlockRange](), Counter[int]()

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
                    done = wait(list(out), timeout=POLL_INTERVAL, return_when="FIRST_COMPLETED").done
            except TimeoutError:
                continue
            for future in done:
                block_range = out.pop(future)
                try:
                    block = future.result()
                except KilledWorker:
                    # So many workers died with it that the scheduler gave it up; it may not be its fault.
                    n_killed[block_range.number] += 1
                    if n_killed[block_range.number] > RETRIES:
                        raise ConnectionError(
                            f"--dask: workers die of block {block_range.number} again and again"
                        ) from None
                    submit(block_range)
                    continue
                yield block_range, block
    finally:
        client.cancel(list(out))
