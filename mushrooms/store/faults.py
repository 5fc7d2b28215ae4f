"""A run killed again and again: whatever the moment, what is left goes on to the bits of one undisturbed.

Run as `python -m mushrooms.store.faults --kills 50`. A child process follows a run in a folder and is killed
(SIGKILL) at a random moment; the next child goes on with what it finds, until as many have been killed. Then
one is left to finish. Every run is lengthened: half of its cycles come first, under the same fire.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import signal
import time
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import numpy as np
import typer

import fast
import scene as scenes
from conformance.files import unsealed, write_file
from mushrooms.main import run
from mushrooms.store.blocks import GROUP, MARKERS

SCENE, ENERGY = "fermi-ulam", 1e3
STAGES = (1, 2)  # cycles, at first and in all
PARTICLES, BLOCK = 1500, 20  # so that most of the time files are being written
LONGEST = 1.5  # seconds after which a child is killed at the latest


def main(
    kills: Annotated[int, typer.Option(help="Processes to kill.")] = 50,
    seed: Annotated[int, typer.Option(help="Of the moments, and of the run.")] = 1,
) -> None:
    """Kill a run at random moments, and compare what it comes to with one undisturbed; exit code 1 if not."""
    wanted = fast.simulate(
        scenes.load(SCENE), n_particles=PARTICLES, energy=ENERGY, n_cycles=STAGES[-1], seed=seed, threads=1
    ).sha256()
    random, moments, digests = np.random.default_rng(seed), Counter[str](), Counter[str]()
    with TemporaryDirectory() as place:
        n_killed, number = 0, 0
        while n_killed < kills:
            number += 1
            folder = Path(place) / str(number)
            # Each run is killed until it has come to its end before it could be.
            for cycles in STAGES:
                end = folder / f"sha256-{cycles}"
                while n_killed < kills and not end.exists():
                    code = _child(folder, cycles, seed, float(random.uniform(0.0, LONGEST)))
                    if code == -signal.SIGKILL:
                        n_killed += 1
                        moments[f"{_left(folder)} of {cycles} cycles"] += 1
                while not end.exists():
                    _child(folder, cycles, seed, None)
            digests[end.read_text("utf-8")] += 1
    print(f"{n_killed} killed: {', '.join(f'{n} {what}' for what, n in sorted(moments.items()))}")
    print(f"{digests[wanted]} of {digests.total()} runs that went on have the SHA-256 of an undisturbed one")
    raise typer.Exit(0 if set(digests) == {wanted} else 1)


def _child(folder: Path, cycles: int, seed: int, seconds: float | None) -> int:
    """Let a child go on with the run; kill it after so many seconds; return its exit code."""
    child = os.fork()
    if child == 0:
        _follow(folder, cycles, seed)
    if seconds is not None:
        time.sleep(seconds)
        os.kill(child, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    return os.waitstatus_to_exitcode(status)


def _follow(folder: Path, cycles: int, seed: int) -> None:
    """Go on with the run, write down its SHA-256, and end this process."""
    options = {"particles": PARTICLES, "energy": ENERGY, "seed": seed, "threads": 1, "block": BLOCK}
    options["cycles"] = cycles
    words = [str(word) for name, value in options.items() for word in (f"--{name}", value)]
    text = io.StringIO()
    code: object = 1
    try:
        with contextlib.redirect_stdout(text), contextlib.redirect_stderr(io.StringIO()):
            run(["simulate", SCENE, *words, "--out", str(folder), "--resume"])
    except SystemExit as ended:
        code = ended.code
        if code == 0:
            write_file(folder / f"sha256-{cycles}", text.getvalue().split()[-1])
    finally:
        os._exit(code if isinstance(code, int) else 1)


def _left(folder: Path) -> str:
    """Return in words at what a process was killed, by what it left."""
    if any(folder.rglob(".*.part")):
        return "while a file was written"
    n_chunks = len(list((folder / GROUP).glob("*/c.*")))
    markers = map(unsealed, (folder / MARKERS).glob("[0-9]*.marker"))
    n_marked = sum(len(json.loads(content)["sums"]) for content in markers if content)
    if not n_chunks:
        return "before a block was there"
    return "between blocks" if n_chunks == n_marked else "between a block's files"


if __name__ == "__main__":
    typer.run(main)
