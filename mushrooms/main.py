"""The command line. Bad input of any kind is one line on stderr and exit code 2."""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Mapping
from contextlib import nullcontext
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer
from rich.console import Console
from rich.table import Table

import mushrooms
import scene as scenes
from mushrooms import output
from mushrooms.ask import ask
from mushrooms.attack import attack
from mushrooms.audit import audit
from mushrooms.bench import bench
from mushrooms.check import check
from mushrooms.draw import draw
from mushrooms.options import AsJson, SceneName, Seed, check_range
from mushrooms.terminal import compilation_told, progress_bar
from scene.files import write_file, write_files
from scene.load import catalogue_text, read_data
from scene.refusal import BadInput, check_seed
from scene.tables import cycle_length

PROGRAM = "mushrooms"
MAX_PARTICLES = 10**8
MAX_DIGITS = 1000
# Typer 0.26 carries a click of its own, older ones import it: this is the error class of the one in use.
UsageError: type[Any] = typer.BadParameter.__bases__[0]

app = typer.Typer(
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="Particles between moving walls: theory, simulation and the audit of Oscillating mushrooms.",
    epilog="Example: mushrooms audit --out audit-report",
)

Threads = Annotated[int | None, typer.Option(help="Threads; all cores by default.")]


def run(arguments: list[str] | None = None) -> NoReturn:
    """Run the command line and exit: 0 done, 1 a claim failed, 2 bad input, 130 interrupted."""
    try:
        code = typer.main.get_command(app)(arguments, prog_name=PROGRAM, standalone_mode=False)
        sys.stdout.flush()
    except (KeyboardInterrupt, typer.Abort):
        sys.exit(130)
    except BrokenPipeError:
        # The reader has gone: nothing to say, and nothing left for the interpreter to flush.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
    except UsageError as error:
        _refuse(error.format_message())
    except (BadInput, OSError) as error:
        _refuse(str(error))
    except MemoryError:
        _refuse("not enough memory for so many particles")
    sys.exit(code if isinstance(code, int) else 0)


def _refuse(message: str) -> NoReturn:
    print(f"{PROGRAM}: {' '.join(message.split())}", file=sys.stderr)
    sys.exit(2)


def _print_version(is_wanted: bool) -> None:
    if is_wanted:
        print(f"{PROGRAM} {mushrooms.__version__}")
        raise typer.Exit


@app.callback()
def main(
    _version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Hold the options that come before any command."""


@app.command("scenes", epilog="Example: mushrooms scenes moving-cap --toml > mine.toml")
def list_scenes(
    name: Annotated[str, typer.Argument(metavar="[NAME]", help="Print this scene of the catalogue.")] = "",
    as_toml: Annotated[bool, typer.Option("--toml", help="Print NAME as a file to begin from.")] = False,
    as_json: AsJson = False,
) -> None:
    """List the catalogue; the scene that is refused is shown with its reason. With NAME print that scene."""
    if name or as_toml:
        text = catalogue_text(name)
        print(json.dumps(read_data(name), indent=2, ensure_ascii=False) if as_json else text.rstrip("\n"))
        return
    rows = [_catalogue_row(name) for name in scenes.catalogue()]
    if as_json:
        print(json.dumps(rows, indent=2, ensure_ascii=False))
        return
    table = Table("name", "table", "period", "notes", title="Catalogue")
    for row in rows:
        length = (
            "refused" if row["refused"] else "static" if row["period"] is None else f"{row['period']:.6g}"
        )
        notes = f"Refused: {row['refused']}" if row["refused"] else row["notes"]
        table.add_row(row["name"], row["table"], length, notes)
    _console().print(table)


def _catalogue_row(name: str) -> dict[str, Any]:
    data = read_data(name)
    row = {"name": name, "table": data["table"], "period": None, "notes": data.get("notes", "")}
    row |= {"refused": None}
    try:
        length = cycle_length(scenes.load(name))
    except scenes.InvalidScene as error:
        return row | {"refused": str(error).partition(": ")[2]}
    return row | {"period": length or None}


@app.command("theory", epilog="Example: mushrooms theory moving-cap --digits 40")
def predict(
    scene: SceneName,
    digits: Annotated[int, typer.Option(help=f"Correct digits, 1 to {MAX_DIGITS}.")] = 15,
    energy: Annotated[
        float | None, typer.Option(help="Add the same figures at this initial energy v²/2, > 0.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Print the paper's predictions for one cycle as decimal strings, and what each is.

    With --energy, what particles that begin with it will show, and the size of what that leaves out. It takes
    rates of frozen tables: those of the audit's scenes are known (python -m conformance.audit.frozen).
    """
    import theory
    from mushrooms.explained import FIGURES, at_energy

    check_range("--digits", digits, 1, MAX_DIGITS)
    if energy is not None and not (math.isfinite(energy) and energy > 0):
        raise BadInput(f"--energy = {energy}, must be finite and > 0")
    found = scenes.load(scene)
    with progress_bar() as bar:
        task = bar.add_task("first of two resolutions", total=100)

        def advance(number: int, share: float) -> None:
            bar.update(task, completed=round(100 * share), description=f"resolution {number} of two or more")

        pairs: dict[str, Any] = dict(theory.predict(found, digits, progress=advance).strings(digits))
    pairs |= at_energy(found, energy) if energy is not None else {}
    _print_pairs(pairs, as_json, FIGURES)


@app.command(
    epilog="Example: mushrooms simulate moving-cap --particles 25000 --energy 1e7 --seed 1 --out run"
)
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
    _print_pairs(summary, as_json)
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


app.command(epilog="Example: mushrooms attack --family knot-at-event --cases 20000 --seed 1")(attack)
app.command(epilog="Example: mushrooms audit --only X2,L4 --out audit-report")(audit)
app.command(epilog="Example: mushrooms bench --quick --out bench-report")(bench)
app.command(epilog="Example: mushrooms check --html report.html -- ./my_stepper")(check)
app.command(epilog="Example: mushrooms draw moving-cap --trajectory --seed 1 --out orbit.gif")(draw)
app.command(epilog="Example: mushrooms ask near-corner/3 -- ./my_stepper")(ask)


def _console() -> Console:
    # A pipe has no width: lines long enough for the tables.
    return Console() if sys.stdout.isatty() else Console(width=140)


def _print_pairs(pairs: dict[str, Any], as_json: bool, meanings: Mapping[str, str] | None = None) -> None:
    if as_json:
        print(json.dumps(pairs, indent=2))
        return
    width = max(map(len, pairs))
    texts = {name: "–" if value is None else str(value) for name, value in pairs.items()}
    longest = max(map(len, texts.values()))
    for name, text in texts.items():
        meaning = (meanings or {}).get(name)
        print(f"{name:<{width}}  {text:<{longest}}  {meaning}" if meaning else f"{name:<{width}}  {text}")
