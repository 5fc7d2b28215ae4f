"""A run as one file: Parquet, CSV or npz, written block by block, with the same bits.

Tables have a row a particle; what it has for each cycle, minimum of nu or wall stands in columns of its
own, counted from 1, or named by the wall: cycle_energies_1, t_in_1_1, wall_counts_arc.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from conformance.files import write_file
from mushrooms import output
from mushrooms.output import TABLES
from mushrooms.store.run import StoredRun, open_run
from mushrooms.store.spec import FIELDS, LANES, WALLS, Arrays
from scene.refusal import BadInput

MAX_COLUMNS = 10_000
TIMES = ("seconds", "threads")


def write_npz(run: StoredRun, file: BinaryIO) -> None:
    """Write the fields of `fast.Ensemble` (times left out) as numpy reads them."""
    fields = run.ensemble(run.shape.n_particles)._asdict()
    held = {name: array for name, array in fields.items() if np.size(array) and name not in TIMES}
    np.savez(file, **held)


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
    """Write a finished run as one table.

    Raises:
        BadInput: a block is damaged, a table has too many columns, or pyarrow is not installed.
    """
    output.check_file(to, (".parquet", ".csv", ".npz"))
    found = open_run(run)
    if to.suffix == ".npz":
        write_file(to, partial(write_npz, found))
    else:
        write_file(to, partial(TABLES[to.suffix], _tables(found)))
    print(to)
