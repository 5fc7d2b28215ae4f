"""What keeping a run costs beside following it: the stored run against the bare kernel, lap by lap.

Run as `python -m mushrooms.store.overhead`. Both follow the same particles and end in the same SHA-256; they
take turns, so that what else the machine does meets both. CPU time counts what they do, the wall what one
waits for. On a machine that does other things laps differ by more than keeping costs: the time spent in
writing blocks and in the digest is measured apart, and compared with all of a stored lap.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, NamedTuple

import typer

import fast
import scene as scenes
from mushrooms.output import locked
from mushrooms.store import conduct, digest
from mushrooms.store.asked import Asked
from mushrooms.store.blocks import Block, Piece
from mushrooms.store.engines import in_process


class Took(NamedTuple):
    """What one lap took [s]."""

    wall: float
    cpu: float


def main(
    scene: Annotated[str, typer.Option(help="A catalogue name.")] = "moving-cap",
    particles: Annotated[int, typer.Option(help="Particles of a lap.")] = 262_144,
    energy: Annotated[float, typer.Option(help="Of their starts.")] = 1e4,
    laps: Annotated[int, typer.Option(help="Laps of each.")] = 3,
    threads: Annotated[int | None, typer.Option(help="All cores by default.")] = None,
    folder: Annotated[Path | None, typer.Option(help="On the disk to be measured.")] = None,
) -> None:
    """Time the bare kernel and the stored run in turns; print the best lap of each."""
    asked = Asked(scenes.load(scene), energy, 1, 1)
    fast.simulate(asked.scene, n_particles=1, energy=energy)  # compiled
    block = conduct.block_size(asked, threads or os.cpu_count() or 1)
    digests: set[str] = set()
    apart = list[float]()
    bare, stored = list[Took](), list[Took]()

    def follow() -> str:
        return fast.simulate(
            asked.scene, n_particles=particles, energy=energy, seed=asked.seed, threads=threads
        ).sha256()

    def keep(place: Path) -> str:
        with locked(place):
            run, _ = conduct.opened(place, asked, particles, None, block, "", False)
            keep_block = run.keep

            def timed(piece: Piece, block: Block) -> None:
                begin = time.perf_counter()
                keep_block(piece, block)
                apart.append(time.perf_counter() - begin)

            run.keep = timed  # type: ignore[method-assign]  # only here
            conduct.complete(
                run, asked, in_process(threads), conduct.RunLimits(), lambda _n: None, lambda _b: None
            )
            begin = time.perf_counter()
            found = digest.sha256(run)
            apart.append(time.perf_counter() - begin)
            return found

    for _ in range(laps):
        with TemporaryDirectory(dir=folder) as place:
            bare.append(_timed(follow, digests))
            stored.append(_timed(lambda: keep(Path(place)), digests))
    print(f"{scene} at E0 = {energy:g}: {particles:,} particles in blocks of {block:,}, {laps} laps each")
    for name in Took._fields:
        a, b = (min(getattr(lap, name) for lap in those) for those in (bare, stored))
        print(f"{name:<4}  bare {a:.2f} s, stored {b:.2f} s: {b / a - 1:+.1%}")
    total = sum(lap.wall for lap in stored)
    print(f"writing blocks and digest: {sum(apart):.2f} of {total:.2f} s, {sum(apart) / total:.1%}")
    raise typer.Exit(0 if len(digests) == 1 else 1)


def _timed(work: Callable[[], str], digests: set[str]) -> Took:
    wall, cpu = time.perf_counter(), time.process_time()
    digests.add(work())
    return Took(time.perf_counter() - wall, time.process_time() - cpu)


if __name__ == "__main__":
    typer.run(main)
