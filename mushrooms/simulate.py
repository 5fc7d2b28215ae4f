"""`mushrooms simulate`: an ensemble on a scene, its summary, its run on disk and its histogram."""

import json
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import typer

import fast
from fast.validation import check_phases
from mushrooms.folders import check_file, locked, writable_folder
from mushrooms.output import print_pairs
from mushrooms.progress import Watch, announce_compilation, progress_bar
from mushrooms.store import conduct
from mushrooms.store.run import StoredRun
from mushrooms.store.spec import RunSpec
from mushrooms.store.summary import (
    RunTally,
    careful_note,
    explain_limit,
    gain_of,
    measured,
    tally_of,
)
from scene import BadInput
from scene.files.writer import named, write_file
from scene.mouth import one_cycle
from scene.named import scene_named
from scene.refusal import refuse_unheeded

Gains = Callable[[], Iterable[Any]]  # returns ln(E/E0) after each cycle, block by block
MOST_IN_MEMORY = 10**8  # particles
LIMITED = 3  # exit code of a run that a limit has stopped
NO_BLOCK = (
    "no block was finished: raise the limit, or begin in another folder with a smaller --block"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulateOptions:
    """The options of `mushrooms simulate`.

    Attributes:
        scene: a name or a file.
        particles, energy, cycles, seed: of the ensemble.
        phases: fractions of a cycle, separated by commas; None for none.
        out: folder for the run; None to keep nothing.
        resume: go on with the run in the folder.
        dask: address of a scheduler; None to compute in this process.
        block: particles stored at a time; None for some seconds of work.
        max_collisions, max_seconds: where a run stops; None for no limit.
        plot: file for a picture of the energies.
        threads: None for all cores, or one for each block of a cluster.
        as_json: print JSON.
    """

    scene: str
    particles: int
    energy: float
    cycles: int
    seed: int
    phases: str | None
    out: Path | None
    resume: bool
    dask: str | None
    block: int | None
    max_collisions: int | None
    max_seconds: float | None
    plot: Path | None
    threads: int | None
    as_json: bool


def simulate_scene(options: SimulateOptions) -> None:
    """Simulate an ensemble, in memory or in a folder, and print its summary."""
    if options.out is None:
        _check_unstored(options)
    if options.plot is not None and options.particles < 2:
        raise BadInput(f"--particles = {options.particles}, must be >= 2 for --plot")
    check_file(options.plot, (".svg", ".png"))
    scene = scene_named(options.scene)
    spec = RunSpec(scene, options.energy, options.cycles, options.seed, _phases(options.phases))
    if options.out is None:
        summary, gains = _in_memory(spec, options)
    else:
        summary, gains = _in_folder(options.out, spec, options)
    print_pairs(summary, options.as_json)
    tell(careful_note(summary))
    tell(explain_limit(spec, summary))
    if options.plot is not None:
        draw_energies(options.plot, spec, iter(gains()), options.particles)


def _check_unstored(options: SimulateOptions) -> None:
    """Refuse what only a run in a folder can have."""
    if options.particles > MOST_IN_MEMORY:
        raise BadInput(
            f"--particles = {options.particles}, must be 1 to {MOST_IN_MEMORY}; more need --out"
        )
    refuse_unheeded(
        {
            "--phases": options.phases,
            "--resume": options.resume or None,
            "--dask": options.dask,
            "--block": options.block,
            "--max-collisions": options.max_collisions,
            "--max-seconds": options.max_seconds,
        },
        "it needs --out, as without a folder nothing is kept",
    )


def _phases(text: str | None) -> tuple[float, ...]:
    if text is None:
        return ()
    try:
        return check_phases([float(part) for part in text.split(",")])
    except ValueError:  # BadInput is one
        raise BadInput(f"--phases = {text}, must be numbers that rise and lie in (0, 1)") from None


def _in_memory(spec: RunSpec, options: SimulateOptions) -> tuple[dict[str, Any], Gains]:
    """Follow an ensemble that is not stored; return its summary and its gains."""
    n_particles = options.particles
    with announce_compilation(), progress_bar() as bar:
        watch = Watch(bar, spec.scene.name or options.scene, "particles")
        found = fast.simulate(
            spec.scene,
            n_particles=n_particles,
            energy=spec.energy,
            n_cycles=spec.n_cycles,
            seed=spec.seed,
            threads=options.threads,
            progress=partial(watch.update, n_total=n_particles),
        )
    with np.errstate(divide="ignore"):
        gains = np.log(found.cycle_energies[found.takes_part()] / spec.energy)
    seconds = found.seconds * found.threads
    return _summary(spec, tally_of(found), seconds, lambda: [gains], found.sha256()), lambda: [
        gains
    ]


def _in_folder(
    folder: Path, spec: RunSpec, options: SimulateOptions
) -> tuple[dict[str, Any], Gains]:
    """Follow an ensemble in a folder that is held meanwhile; return its summary and its gains."""
    threads = options.threads
    engine: conduct.Engine = partial(conduct.in_process, threads=threads)
    if options.dask:
        engine = partial(conduct.by_dask, address=options.dask, threads=threads)
    default = conduct.block_of_new(spec, options.particles, threads or os.cpu_count() or 1)
    with writable_folder(folder), locked(folder):
        with named(folder), announce_compilation():
            run = conduct.open_or_create(
                folder,
                spec,
                options.particles,
                options.block,
                default,
                options.scene,
                options.resume,
            )
        complete = partial(
            conduct.complete,
            run,
            engine,
            max_collisions=options.max_collisions,
            max_seconds=options.max_seconds,
        )
        return _on_disk(run, spec.scene.name or options.scene, complete)


def _on_disk(
    run: StoredRun, name: str, complete: Callable[[conduct.OnProgress], None]
) -> tuple[dict[str, Any], Gains]:
    """Bring a stored run to its end, or the command to its own; return its summary and gains."""
    n_before = run.tally.particles
    try:
        with named(run.folder):
            with announce_compilation(), progress_bar() as bar:
                complete(
                    partial(Watch(bar, name, "particles").update, n_total=run.shape.n_particles)
                )
            summary = _summary(run.spec, run.tally, run.seconds, run.gains, run.sha256())
    except conduct.LimitReached as limit:
        tell(f"{limit}: {_how_to_resume(run)}")
        if run.tally.particles == n_before:  # it would stop there again and again
            tell(f"{NO_BLOCK} than {run.shape.block}")
        raise typer.Exit(LIMITED) from None
    except (KeyboardInterrupt, OSError) as error:  # of a file, or a connection to a cluster
        error.add_note(_how_to_resume(run))
        raise
    data = run.spec.to_data()
    kept = {name: data[name] for name in ("scene", "energy", "cycles", "seed")} | summary
    write_file(run.folder / "summary.json", json.dumps(kept) + "\n")
    return summary, run.gains


def _how_to_resume(run: StoredRun) -> str:
    """Return what is kept of a run that ends early, and which command goes on with it."""
    kept = f"{run.tally.particles:,} of {run.shape.n_particles:,} particles are kept"
    if not run.tally.particles and run.first_there() is not None:  # with fewer cycles or particles
        kept = "what was there is kept"
    return f"{kept}; go on with: {run.command}"


def _summary(
    spec: RunSpec, tally: RunTally, seconds: float, gains: Gains, sha256: str
) -> dict[str, Any]:
    flown = tally.followed * spec.n_cycles * one_cycle(spec.scene)
    return {
        "particles": tally.particles,
        "collisions": tally.collisions,
        "lost": tally.particles - tally.followed,
        "undecided": tally.undecided,
        "careful": tally.careful,
        "collision_time": flown / tally.met if tally.met else None,
        **measured(spec, tally.captured, gain_of(gains)),
        "ns_per_collision": seconds / max(tally.collisions, 1) * 1e9,
        "sha256": sha256,
    }


def tell(note: str | None) -> None:
    """Print a note on stderr, if there is one."""
    if note is not None:
        print(note, file=sys.stderr)


def draw_energies(path: Path, spec: RunSpec, gains: Iterator[Any], n_particles: int) -> None:
    """Write the histogram of ln(E1/E0) of those that take part, and means by cycle if several.

    Raises:
        BadInput: they are too few.
    """
    from mushrooms.figures import energies, style  # drawing takes a second to import

    picture = energies.histogram if spec.n_cycles == 1 else energies.growth
    figure = picture(spec.scene, spec.energy, gains, n_particles)
    write_file(path, lambda file: style.save(figure, file, path.suffix))
