"""A run as one file: Parquet, CSV or npz, written block by block, with the same bits.

Tables have a row a particle; what it has for each cycle, minimum of nu or wall stands in columns of its
own, counted from 1, or named by the wall: cycle_energies_1, t_in_1_1, wall_counts_arc.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterator
from functools import partial
from itertools import chain, product
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from conformance.files import write_file
from mushrooms import output
from mushrooms.output import import_arrow
from mushrooms.store.run import StoredRun, open_run
from mushrooms.store.spec import FIELDS, LANES, WALLS, Arrays
from scene.refusal import BadInput

MAX_COLUMNS = 10_000
TIMES = ("seconds", "threads")


def write_csv(run: StoredRun, file: BinaryIO) -> None:
    """Write a table whose numbers read back to the same bits."""
    text = io.TextIOWrapper(file, encoding="utf-8", newline="")
    writer = csv.writer(text)
    for number, columns in enumerate(_tables(run)):
        if number == 0:
            writer.writerow(columns)
        writer.writerows(zip(*(column.tolist() for column in columns.values()), strict=True))
    text.flush()
    text.detach()


def write_parquet(run: StoredRun, file: BinaryIO) -> None:
    """Write a Parquet file, a row group a block.

    Raises:
        BadInput: pyarrow is not installed.
    """
    pyarrow, parquet = import_arrow()
    tables = map(pyarrow.table, _tables(run))
    first = next(tables)
    with parquet.ParquetWriter(file, first.schema) as writer:  # else it would close itself later, in a page
        for table in chain([first], tables):
            writer.write_table(table)


def write_npz(run: StoredRun, file: BinaryIO) -> None:
    """Write the fields of `fast.Ensemble` (times left out) as numpy reads them."""
    fields = run.ensemble(run.shape.n_particles)._asdict()
    held = {name: array for name, array in fields.items() if np.size(array) and name not in TIMES}
    np.savez(file, **held)


# By the ending of the file. Each refuses a damaged block, a table of too many columns, a missing package.
WRITERS: dict[str, Callable[[StoredRun, BinaryIO], None]] = {
    ".parquet": write_parquet,
    ".csv": write_csv,
    ".npz": write_npz,
}


def _tables(run: StoredRun) -> Iterator[Arrays]:
    """Yield each block as columns by their names."""
    shape, names = run.shape, [name for name in run.shape.names if name != LANES]
    n_columns = sum(int(np.prod(shape.of(name, 1, shape.n_cycles))) for name in names)
    if n_columns > MAX_COLUMNS:
        raise BadInput(f"a table of {n_columns} columns, must be at most {MAX_COLUMNS}: read it with xarray")
    for number in range(shape.n_blocks):
        first = number * shape.block
        columns: Arrays = {"particle": np.arange(first, first + shape.rows(number))}
        for name in names:
            array = run.read(number, name)
            for place in product(*map(range, array.shape[1:])):
                words = [WALLS[i] if FIELDS[name].dims[-1] == "wall" else str(i + 1) for i in place]
                at: Any = (slice(None), *place)
                columns["_".join([name, *words])] = array[at]
        yield columns


def export_run(run: Path, to: Path) -> None:
    """Write a finished run as one table."""
    output.check_file(to, tuple(WRITERS))
    write_file(to, partial(WRITERS[to.suffix], open_run(run)))
    print(to)
