"""A finished run for other programs: a table (CSV, Parquet), arrays (npz), xarray.

The run is read through its checksums (`open_run`), and the numbers keep their bits. In a table a
row is a particle. What it has for each cycle, minimum of nu or wall stands in columns of its own,
counted from 1, or named by the wall: cycle_energies_1, t_in_1_1, wall_counts_arc.

What was run goes with the numbers: scene, energy, seed, versions (`provenance`).
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from mushrooms.folders import check_file
from mushrooms.progress import Watch, progress_bar
from mushrooms.store.run import GROUP, StoredRun, attributes_of, open_run
from mushrooms.store.spec import FIELDS, LANES, WALLS, Array, Arrays
from scene import BadInput
from scene.files.tables import write_table
from scene.files.writer import write_file

MAX_COLUMNS = 10_000  # of a table: programs that read tables take minutes over more
OF_THE_STORE = ("schema", "block", "cycles_of_a_chunk")  # attributes that say nothing of a table


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportOptions:
    """The options of `mushrooms export`: the folder of a run, and the file to be written."""

    run: Path
    to: Path


def export_run(options: ExportOptions) -> None:
    """Write a finished run as one table.

    Raises:
        BadInput: a block is damaged, or pyarrow is not installed.
    """
    to = options.to
    check_file(to, (".parquet", ".csv", ".npz"))
    found = open_run(options.run)
    about = provenance(found)
    if to.suffix == ".npz":
        write_file(to, partial(_write_npz, found, about))
    else:
        with progress_bar() as bar:
            watch = Watch(bar, f"writing {to}", "particles")
            write_table(to, _tables(found, watch), about)
    print(to)


def provenance(run: StoredRun) -> dict[str, Any]:
    """Return what was run: scene, energy, cycles, seed, particles, versions, revision, command."""
    found = attributes_of(run.folder)
    return {name: value for name, value in found.items() if name not in OF_THE_STORE}


def open_dataset(folder: str | Path) -> Any:
    """Open a finished run as an `xarray.Dataset` whose arrays are read when they are needed.

    All of the run is held to its checksums before.

    Args:
        folder: that `mushrooms simulate --out` wrote.

    Returns:
        The arrays of `ensemble.zarr`; attributes: scene, energy, seed, versions, command.

    Raises:
        BadInput: the folder holds no run, one that is not finished, or a damaged one; xarray is
            missing.
    """
    try:
        import xarray
    except ImportError:
        raise BadInput(
            "a dataset needs xarray: pip install 'oscillating-mushrooms[scale]'"
        ) from None
    run = open_run(Path(folder))
    shape = run.shape
    try:
        found = xarray.open_zarr(run.folder / GROUP)
        described = {name: (found[name].dims, found[name].dtype.name) for name in shape.names}
    except (KeyError, TypeError, ValueError) as error:
        raise _damaged_description(run) from error
    wanted = {name: (FIELDS[name].dims, FIELDS[name].kind) for name in shape.names}
    if described != wanted:
        raise _damaged_description(run)
    found.attrs = attributes_of(run.folder)
    return found


def _damaged_description(run: StoredRun) -> BadInput:
    how = "mushrooms simulate --resume mends it"
    return BadInput(f"run {str(run.folder)!r}: the description of its arrays is damaged: {how}")


def _write_npz(run: StoredRun, about: dict[str, Any], file: BinaryIO) -> None:
    """Write the fields of `fast.Ensemble` (times left out) as numpy reads them, and `about`."""
    fields = run.ensemble(run.shape.n_particles)._asdict()
    held = {
        name: array
        for name, array in fields.items()
        if np.size(array) and name not in ("seconds", "threads")
    }
    np.savez(file, about=np.array(json.dumps(about)), **held)


def _tables(run: StoredRun, watch: Watch) -> Iterator[Arrays]:
    """Yield each block as columns by their names.

    Raises:
        BadInput: they are too many for a program that reads tables.
    """
    names = [name for name in run.shape.names if name != LANES]
    n_columns = sum(int(np.prod(run.shape.of(name, 1, run.spec.n_cycles))) for name in names)
    if n_columns > MAX_COLUMNS:
        raise BadInput(
            f"a table of {n_columns} columns, must be at most {MAX_COLUMNS}: export to .npz, or"
            f" read {GROUP} with xarray"
        )
    for number in range(run.shape.n_blocks):
        first = number * run.shape.block
        watch.update(first, run.shape.n_particles)
        table: Arrays = {"particle": np.arange(first, first + run.shape.rows(number))}
        for name in names:
            table |= _columns(name, run.read(number, name))
        yield table


def _columns(name: str, array: Array) -> Iterator[tuple[str, Array]]:
    """Yield an array's columns, one for each place beside that of the particle, by their names."""
    is_by_wall = FIELDS[name].dims[-1] == "wall"
    for place in product(*map(range, array.shape[1:])):
        words = [WALLS[i] if is_by_wall else str(i + 1) for i in place]
        at: Any = (slice(None), *place)
        yield "_".join([name, *words]), array[at]
