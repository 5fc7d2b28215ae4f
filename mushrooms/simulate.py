"""`mushrooms simulate`: an ensemble on a scene, its summary, its files and its histogram."""

from __future__ import annotations

import json
import math
import os
import sys
from contextlib import nullcontext
from pathlib import Path
from typing import Annotated, Any

import typer

import scene as scenes
from mushrooms import output
from mushrooms.terminal import AsJson, SceneName, check_range, compilation_told, print_pairs, progress_bar
from scene.files import write_file, write_files
from scene.refusal import BadInput, check_seed

MAX_PARTICLES = 10**8

Seed = Annotated[int, typer.Option(help="Seed of the random starts, 0 to 2^64 - 1.")]
Threads = Annotated[int | None, typer.Option(help="Threads; all cores by default.")]


def simulate(
    scene: SceneName,
    particles: Annotated[int, typer.Option(help="Number of particles, 1 to 10^8.")],
    energy: Annotated[float, typer.Option(help="Initial energy v²/2 of every particle, > 0.")],
    cycles: Annotated[int, typer.Option(help="Cycles of the walls, at least 1.")] = 1,
    seed: Seed = 0,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder for ensemble.npz and summary.json.")
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Histogram of log E1/E0 after one cycle (.svg, .png), with theory."
        ),
    ] = None,
    threads: Threads = None,
    as_json: AsJson = False,
) -> None:
    """Simulate an ensemble; undecided particles are counted, never guessed.

    Prints particles, collisions, lost (not followed to the end), undecided (those of the lost
    that the stepper could not decide), careful (collisions found by the careful step, some fifty times
    slower), m1 (mean of log E/E0 per cycle) with its standard error, p_nc (share of cycles without
    capture), ns_per_collision (and thread) and the SHA-256 of the result.
    Particles that no cycle ever frees from the island count neither in m1 nor in p_nc.

    On stderr: before a run of over 20 s about how many collisions and how long; after a run of over a
    second that careful steps took over a tenth of it, if they did.
    """
    _check_ensemble(particles, energy, cycles, seed, threads)
    if plot is not None:
        if cycles != 1:
            raise BadInput(f"--cycles = {cycles}, must be 1 for --plot")
        check_range("--particles", particles, 2)
        output.check_file(plot, (".svg", ".png"))
    table = scenes.load(scene)
    with output.writable_folder(out) if out else nullcontext() as folder:
        import numpy as np

        asked = {"n_particles": particles, "energy": energy, "n_cycles": cycles, "seed": seed}
        ensemble = _simulated(table, table.name or scene, threads, **asked)
        summary = _summary(table, ensemble, cycles)
        if folder is not None:
            fields = {k: v for k, v in ensemble._asdict().items() if k not in ("seconds", "threads")}
            text = json.dumps(
                {"scene": scenes.to_data(table), "energy": energy, "cycles": cycles, "seed": seed} | summary
            )
            write_files(
                folder, {"ensemble.npz": lambda file: np.savez(file, **fields), "summary.json": text + "\n"}
            )
    print_pairs(summary, as_json)
    if plot is not None:
        _plot(plot, table, table.name or scene, ensemble)


def _check_ensemble(particles: int, energy: float, cycles: int, seed: int, threads: int | None) -> None:
    if not (math.isfinite(energy) and energy > 0):
        raise BadInput(f"--energy = {energy}, must be finite and > 0")
    check_range("--particles", particles, 1, MAX_PARTICLES)
    check_range("--cycles", cycles, 1)
    check_seed(seed, "--seed")
    if threads is not None:
        check_range("--threads", threads, 1)


def _plot(path: Path, table: scenes.Scene, name: str, ensemble: Any) -> None:
    """Write the histogram of those who take part."""
    import io

    import numpy as np

    from mushrooms.figures import energies, style

    gain = np.log(ensemble.energy[ensemble.takes_part()] / ensemble.energy0)
    if len(gain) < 2:
        raise BadInput(f"--plot: {len(gain)} particles were followed to the end, must be at least 2")
    title = f"{name}, E0 = {ensemble.energy0:.0e}, {len(gain):,} particles"
    file = io.BytesIO()
    style.save(energies.histogram(table, ensemble.energy0, gain, title), file, path.suffix)
    write_file(path, file.getvalue())


def _simulated(table: scenes.Scene, name: str, threads: int | None, **asked: Any) -> Any:
    """Return the ensemble; stderr says what to expect of a long run, and which steps slowed it."""
    import fast
    from mushrooms.forecast import careful_note, forecast

    with compilation_told(), progress_bar() as bar:
        task = bar.add_task(name, total=asked["n_particles"])

        def advance(n_done: int) -> None:
            if n_done == 0:  # what was asked for has been accepted, and the stepper compiled
                n_threads = threads or os.cpu_count() or 1
                ahead = forecast(table, threads=n_threads, **asked)
                if ahead is not None:
                    print(ahead.text(n_threads), file=sys.stderr, flush=True)
            bar.update(task, completed=n_done)

        ensemble = fast.simulate(table, threads=threads, progress=advance, **asked)
    n_careful, n_collisions = int(ensemble.n_careful.sum()), int(ensemble.n_collisions.sum())
    note = careful_note(n_careful, n_collisions, ensemble.seconds)
    if note is not None:
        print(note, file=sys.stderr)
    return ensemble


def _summary(table: scenes.Scene, ensemble: Any, n_cycles: int) -> dict[str, Any]:
    import numpy as np

    n_followed = int((ensemble.outcome == 0).sum())
    gain = np.log(ensemble.energy[ensemble.takes_part()] / ensemble.energy0) / n_cycles
    n = len(gain)
    has_island = isinstance(table, scenes.Mushroom)
    return {
        "particles": len(ensemble.energy),
        "collisions": int(ensemble.n_collisions.sum()),
        "lost": len(ensemble.energy) - n_followed,
        "undecided": int((ensemble.outcome == 1).sum()),
        "careful": int(ensemble.n_careful.sum()),
        "m1": _finite(gain.mean()) if n else None,
        "m1_se": _finite(gain.std(ddof=1) / math.sqrt(n)) if n > 1 else None,
        "p_nc": float(ensemble.p_nc().mean()) if n and has_island else None,
        "ns_per_collision": _finite(ensemble.ns_per_collision()),
        "sha256": ensemble.sha256(),
    }


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
