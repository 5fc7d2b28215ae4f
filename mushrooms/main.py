"""The command line. Bad input of any kind is one line on stderr and exit code 2."""

from __future__ import annotations

import json
import math
import os
import sys
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
from mushrooms.simulate import simulate
from mushrooms.stored import draw_run, export, is_stored
from mushrooms.terminal import AsJson, SceneName, check_range, print_pairs
from scene.files import write_file
from scene.load import read_data
from scene.refusal import BadInput
from scene.tables import cycle_length

PROGRAM = "mushrooms"
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


@app.command("scenes", epilog="Example: mushrooms scenes --json")
def list_scenes(as_json: AsJson = False) -> None:
    """List the catalogue; the scene that is refused is shown with its reason."""
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
    pairs: dict[str, Any] = dict(theory.predict(found, digits).strings(digits))
    pairs |= at_energy(found, energy) if energy is not None else {}
    print_pairs(pairs, as_json, FIGURES)


@app.command(epilog="Example: mushrooms draw moving-cap --out moving-cap.svg")
def draw(
    scene: SceneName,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="A .svg, .png or .gif file; SCENE's name with .svg by default."),
    ] = None,
) -> None:
    """Draw the walls through the cycle, with a few chords of one particle; a .gif moves.

    Given the folder of a run (simulate --out), draw its histogram of log E1/E0, with theory.
    """
    if is_stored(scene):
        print(draw_run(Path(scene), out))
        return
    table = scenes.load(scene)
    path = out or Path(f"{Path(scene).stem}.svg")
    from mushrooms.figures import table as pictures

    output.check_file(path, pictures.SUFFIXES)
    write_file(path, lambda file: pictures.write_picture(table, path.suffix, file))
    print(path)


app.command(
    epilog="Example: mushrooms simulate moving-cap --particles 25000 --energy 1e7 --seed 1 --out run"
)(simulate)
app.command(epilog="Example: mushrooms export run --to run.parquet")(export)
app.command(epilog="Example: mushrooms attack --family knot-at-event --cases 20000 --seed 1")(attack)
app.command(epilog="Example: mushrooms audit --only X2,L4 --out audit-report")(audit)
app.command(epilog="Example: mushrooms bench --quick --out bench-report")(bench)
app.command(epilog="Example: mushrooms check --html report.html -- ./my_stepper")(check)
app.command(epilog="Example: mushrooms ask near-corner/3 -- ./my_stepper")(ask)


def _console() -> Console:
    # A pipe has no width: lines long enough for the tables.
    return Console() if sys.stdout.isatty() else Console(width=140)
