"""`mushrooms simulate`: an ensemble on a scene, its summary, its run on disk and its histogram."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer

from conformance.files import write_file
from mushrooms import output
from mushrooms.main import tell_interrupted
from mushrooms.output import locked
from mushrooms.terminal import (
    AsJson,
    SceneName,
    check_energy,
    check_range,
    compilation_told,
    load_scene,
    print_pairs,
)
from scene.refusal import BadInput, check_seed

MOST_IN_MEMORY, MOST_ON_DISK = 10**8, 10**10
LIMITED = 3  # exit code of a run that a limit has stopped
FOR_STORED = "needs --out: without a folder nothing is kept"
NO_BLOCK = "no block was finished: raise the limit, or begin in another folder with a smaller --block"

Particles = Annotated[int, typer.Option(help="Number of particles, 1 to 10^8; with --out to 10^10.")]
Energy = Annotated[float, typer.Option(help="Initial energy v²/2 of every particle, > 0.")]
Cycles = Annotated[int, typer.Option(help="Cycles of the walls, at least 1.")]
Phases = Annotated[
    str | None,
    typer.Option(
        metavar="A,B,...", help="Fractions of a cycle at which energies are stored too; needs --out."
    ),
]
Seed = Annotated[int, typer.Option(help="Seed of the random starts, 0 to 2^64 - 1.")]
Threads = Annotated[
    int | None, typer.Option(help="Threads; default: all cores, or one per block with --dask.")
]
Out = Annotated[
    Path | None, typer.Option(metavar="DIR", help="Folder for the run (ensemble.zarr) and summary.json.")
]
Resume = Annotated[
    bool,
    typer.Option(
        "--resume",
        help="Continue the run in DIR; with more --particles or more --cycles, extend it.",
    ),
]
Dask = Annotated[
    str | None, typer.Option(metavar="ADDRESS", help="Dask scheduler whose workers simulate the blocks.")
]
BlockSize = Annotated[
    int | None, typer.Option("--block", help="Particles stored at a time; default: some seconds of work.")
]
MostCollisions = Annotated[
    int | None, typer.Option(help="Stop if a particle makes more collisions than this.")
]
MostSeconds = Annotated[float | None, typer.Option(help="Stop after this time; --resume continues.")]
Plot = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Draw the energies after each cycle, with the theory (.svg, .png)."),
]


def simulate(
    scene: SceneName,
    particles: Particles,
    energy: Energy,
    cycles: Cycles = 1,
    seed: Seed = 0,
    phases: Phases = None,
    out: Out = None,
    resume: Resume = False,
    dask: Dask = None,
    block: BlockSize = None,
    max_collisions: MostCollisions = None,
    max_seconds: MostSeconds = None,
    plot: Plot = None,
    threads: Threads = None,
    as_json: AsJson = False,
) -> int:
    """Simulate an ensemble. Undecided particles are counted, never guessed.

    Prints: particles; collisions; lost (not followed to the end); undecided (lost because the stepper could
    not decide); careful (collisions computed by the scalar step, some tens of times slower); collision_time
    (mean time between two collisions of a particle); m1 (mean of log E/E0 per cycle); p_nc (share of cycles
    without capture); _se (standard error); _theory (prediction); _z (difference in standard errors);
    ns_per_collision; SHA-256 of the results. Particles that are in the island for the whole run count neither
    in m1 nor in p_nc. docs/ensembles.md explains each line.

    With --out particles are stored block by block. After any interruption --resume continues the run, to the
    same bits. Exit code 0; 3 if a limit stopped the run; 130 if it was interrupted.

    On stderr: progress and the time left, after 20 s and then every minute; a note if scalar steps took over
    a tenth of the time; a note if the prediction is the limit of high energies.
    """
    _check_ensemble(energy, cycles, seed, threads)
    limits = {"max_collisions": max_collisions, "max_seconds": max_seconds}
    _check_stored(out, particles, phases=phases, resume=resume, dask=dask, block=block, **limits)
    _check_plot(plot, particles)
    from mushrooms.store.spec import RunSpec

    spec = RunSpec(load_scene(scene), energy, cycles, seed, _given_phases(phases))
    wanted = Wanted(scene, spec, particles, threads, dask, block, max_collisions, max_seconds)
    if out is None:
        found = _in_memory(wanted)
    else:
        with output.writable_folder(out) as folder, locked(folder):
            stored = _on_disk(wanted, folder, resume)
            if stored is None:
                return LIMITED
            found = stored
    print_pairs(found.summary, as_json)
    tell_limit(spec, found.summary)
    if plot is not None:
        draw_energies(plot, spec, iter(found.gains()), particles)
    return 0


class Wanted(NamedTuple):
    """The arguments of `simulate`, checked.

    Attributes:
        scene: as given.
        spec: all that decides the bits.
        particles, threads, dask, block, max_collisions, max_seconds: see `simulate`.
    """

    scene: str
    spec: Any
    particles: int
    threads: int | None
    dask: str | None
    block: int | None
    max_collisions: int | None
    max_seconds: float | None

    @property
    def name(self) -> str:
        """Return the scene's name."""
        return self.spec.scene.name or self.scene

    @property
    def n_threads(self) -> int:
        """Return how many threads there are."""
        return self.threads or os.cpu_count() or 1


class Found(NamedTuple):
    """What `simulate` prints of a run, and a function that returns its ln(E/E0), block by block."""

    summary: dict[str, Any]
    gains: Callable[[], Iterable[Any]]


def _check_ensemble(energy: float, cycles: int, seed: int, threads: int | None) -> None:
    check_energy(energy)
    check_range("--cycles", cycles, 1)
    check_seed(seed, "--seed")
    if threads is not None:
        check_range("--threads", threads, 1)


def _given_phases(text: str | None) -> tuple[float, ...]:
    from fast.validation import check_phases

    if text is None:
        return ()
    try:
        return check_phases([float(part) for part in text.split(",")])
    except (BadInput, ValueError):
        raise BadInput(f"--phases = {text}, must be numbers that rise and lie in (0, 1)") from None


def _check_stored(out: Path | None, particles: int, **options: Any) -> None:
    """Check what only a run on disk can have."""
    check_range("--particles", particles, 1, MOST_IN_MEMORY if out is None else MOST_ON_DISK)
    if options["block"] is not None:
        from mushrooms.store.conduct import LARGEST_BLOCK  # it takes the stepper: most commands end before

        check_range("--block", options["block"], 1, LARGEST_BLOCK)
    for name, value in options.items():
        option = f"--{name.replace('_', '-')}"
        if out is None and value not in (None, False):
            raise BadInput(f"{option} {FOR_STORED}")
        if name.startswith("max") and value is not None and not value > 0:
            raise BadInput(f"{option} = {value}, must be > 0")


def _check_plot(plot: Path | None, particles: int) -> None:
    if plot is None:
        return
    check_range("--particles", particles, 2)
    output.check_file(plot, (".svg", ".png"))


def _in_memory(wanted: Wanted) -> Found:
    """Follow an ensemble that is not stored."""
    import numpy as np

    import fast
    from mushrooms.store.progress import RunTally, Watch, tally_of

    spec = wanted.spec
    try:
        with compilation_told(), Watch(wanted.name, wanted.particles, RunTally()) as watch:
            found = fast.simulate(
                spec.scene,
                n_particles=wanted.particles,
                energy=spec.energy,
                n_cycles=spec.n_cycles,
                seed=spec.seed,
                threads=wanted.threads,
                progress=watch.update,
            )
    except KeyboardInterrupt:
        tell_interrupted("nothing is kept without --out")
        raise
    with np.errstate(divide="ignore"):
        gains = np.log(found.cycle_energies[found.takes_part()] / spec.energy)
    tally = tally_of({**found._asdict(), "takes_part": found.takes_part()})
    _tell_careful(tally.careful, tally.collisions, found.seconds)
    summary = _summary(spec, tally, found.seconds * found.threads, lambda: [gains], found.sha256())
    return Found(summary, lambda: [gains])


def _on_disk(wanted: Wanted, folder: Path, resume: bool) -> Found | None:
    """Bring the run in a folder to its end; return None if a limit came first."""
    from mushrooms.store import conduct

    spec, command = wanted.spec, wanted.spec.command(wanted.scene, wanted.particles, folder)
    default = conduct.block_of_new(spec, wanted.particles, wanted.n_threads)
    try:
        with compilation_told():
            run, damaged = conduct.opened(
                folder, spec, wanted.particles, wanted.block, default, command, resume
            )
    except OSError as error:
        raise BadInput(f"output {str(folder)!r}: {error.strerror or error}") from None
    tell_damaged(damaged)
    try:
        with _told_how_to_go_on(run, command):
            _complete(wanted, run)
            summary = _summary(spec, run.tally, run.seconds, run.gains, run.sha256())
    except conduct.LimitReached:
        return None
    asked = spec.to_data()
    kept = {name: asked[name] for name in ("scene", "energy", "cycles", "seed")} | summary
    write_file(folder / "summary.json", json.dumps(kept) + "\n")
    return Found(summary, run.gains)


def tell_limit(spec: Any, summary: dict[str, Any]) -> None:
    """Say on stderr where the theory printed is not that of the run's energy."""
    from mushrooms.compared import limit_told

    told = limit_told(spec, summary)
    if told is not None:
        print(told, file=sys.stderr)


def tell_damaged(numbers: list[int]) -> None:
    """Say on stderr which blocks of a run are followed again."""
    if numbers:
        few = ", ".join(map(str, numbers[:5])) + (" ..." if len(numbers) > 5 else "")
        print(f"damaged or broken off: {len(numbers)} blocks ({few}), followed again", file=sys.stderr)


@contextmanager
def _told_how_to_go_on(run: Any, command: str) -> Iterator[None]:
    """Say on stderr what is kept of a run that ends early, and which command goes on with it."""
    from mushrooms.store.conduct import LimitReached

    there = run.tally.particles

    def how() -> str:
        n = run.tally.particles
        kept = f"{n:,} of {run.shape.n_particles:,} particles are kept"
        if not n and run.first_there() is not None:  # with fewer cycles
            kept = "what was there is kept"
        return f"{kept}; go on with: {command}"

    try:
        yield
    except LimitReached as limit:
        print(f"{limit}: {how()}", file=sys.stderr)
        if run.tally.particles == there:  # it would stop there again and again
            print(f"{NO_BLOCK} than {run.shape.block}", file=sys.stderr)
        raise
    except KeyboardInterrupt:
        told = "no block was finished: nothing is kept" if run.first_there() is None else how()
        tell_interrupted(told)
        raise
    except ConnectionError as error:  # to a cluster
        raise BadInput(f"{error}: {how()}") from None
    except OSError as error:
        at = error.filename or str(run.folder)
        raise BadInput(f"output {at!r}: {error.strerror or error}: {how()}") from None


def draw_energies(path: Path, spec: Any, gains: Iterator[Any], n_particles: int) -> None:
    """Write the histogram of ln(E1/E0) of those who take part; of several cycles the mean after each, too.

    Raises:
        BadInput: they are too few.
    """
    import io

    from mushrooms.figures import energies, style

    picture = energies.histogram if spec.n_cycles == 1 else energies.growth
    file = io.BytesIO()
    style.save(picture(spec.scene, spec.energy, gains, n_particles), file, path.suffix)
    write_file(path, file.getvalue())


def _complete(wanted: Wanted, run: Any) -> None:
    """Follow what a run lacks."""
    from mushrooms.store import conduct, engines
    from mushrooms.store.progress import Watch

    before, seconds = run.tally, run.seconds
    engine = (
        engines.by_dask(wanted.dask, wanted.threads) if wanted.dask else engines.in_process(wanted.threads)
    )
    limits = conduct.RunLimits(wanted.max_collisions, wanted.max_seconds)
    with compilation_told(), Watch(wanted.name, wanted.particles, before) as watch:
        conduct.complete(run, engine, watch.update, lambda block: watch.add(block.tally), limits=limits)
    n_careful, n = run.tally.careful - before.careful, run.tally.collisions - before.collisions
    _tell_careful(n_careful, n, (run.seconds - seconds) / wanted.n_threads)


def _tell_careful(n_careful: int, n_collisions: int, seconds: float) -> None:
    """Say on stderr that careful steps slowed a run, if they did."""
    from mushrooms.forecast import careful_note

    note = careful_note(n_careful, n_collisions, seconds)
    if note is not None:
        print(note, file=sys.stderr)


def _summary(
    spec: Any, tally: Any, seconds: float, gains: Callable[[], Iterable[Any]], sha256: str
) -> dict[str, Any]:
    from fast.starts import one_cycle
    from mushrooms.compared import measured
    from mushrooms.store.progress import gain_of

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
