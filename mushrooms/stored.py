"""Commands on stored runs: `mushrooms export`, and the picture of `mushrooms draw DIR`."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from conformance.files import write_file
from mushrooms import output

PLOTS = (".svg", ".png")


def export(
    run: Annotated[Path, typer.Argument(metavar="DIR", help="Folder that `simulate --out` wrote.")],
    to: Annotated[Path, typer.Option(metavar="FILE", help="A .parquet, .csv or .npz file.")],
) -> None:
    """Write a finished run as one table, one row per particle. An .npz holds the arrays of `fast.Ensemble`.

    The run is read block by block and its checksums are tested. A damaged run is refused.
    """
    from mushrooms.store.export import WRITERS
    from mushrooms.store.run import open_run

    output.check_file(to, tuple(WRITERS))
    write_file(to, partial(WRITERS[to.suffix], open_run(run)))
    print(to)


def draw_run(folder: Path, out: Path | None) -> Path:
    """Draw the energies of a stored run, with theory; return the file's path."""
    from mushrooms.simulate import draw_energies
    from mushrooms.store.run import open_run

    path = out or Path(f"{folder.resolve().name}.svg")
    output.check_file(path, PLOTS)
    run = open_run(folder)
    draw_energies(path, run.spec, run.gains(), run.shape.n_particles)
    return path
