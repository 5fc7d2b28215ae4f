"""An ensemble of another program, read a part at a time from CSV, Parquet or Zarr: what the audit needs.

A row is a particle. Columns: E0, E1, E2 ... after each cycle, or s = log E1/E0; where there are any, t_in and
t_out (of a stay in the cap in the first cycle), captured (0 or 1), and x0, y0, where it started. The names
that `mushrooms export` writes will do.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Iterator
from itertools import islice, pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import zarr

from conformance.suite.sheet import read_number, read_rows
from mushrooms.output import import_arrow
from scene.refusal import BadInput, shown

Floats = npt.NDArray[np.float64]
PART, FEW = 500_000, 20_000  # rows read at a time: as arrays, and as texts
ONE_ENERGY = "an audit is of starts of one energy, --energy picks them"
MAX_ENERGIES = 20  # different E0 that are listed
SAME = 1e-6  # relative difference of E0 that writing it in few digits makes
NOTHING = ("", "nan", "NaN", "NA", "null", "none", "None")
FLAGS = {"true": "1", "false": "0", "t": "1", "f": "0", "yes": "1", "no": "0"}
ENERGIES, GAIN = "E1", "s"
# What a column may be called; of several minima of nu or capture intervals the earliest counts.
NAMES = {
    "E0": r"E_?0|e0|energy_?0",
    ENERGIES: r"E_?[1-9]\d*|e[1-9]\d*|energy(_[1-9]\d*)?",
    GAIN: r"s|log_E1_E0|log_gain",
    "t_in": r"t_in(_1(_\d+)?)?",
    "t_out": r"t_out(_1(_\d+)?)?",
    "captured": r"(is_)?captured(_1)?",
    "x0": "x_?0",
    "y0": "y_?0",
}


class EnsembleTable(NamedTuple):
    """What a table holds.

    Attributes:
        sums: (n, K) log E_k/E0 after each cycle, of those that have all energies.
        columns: t_in, t_out, captured, x0, y0 of the same, where there are any.
        energy: v^2/2 of every start.
        n_lost: rows without an energy.
        n_other: rows of another E0 than was asked for.
        is_binary32: whether every energy after a cycle has 24 bits.
    """

    sums: Floats
    columns: dict[str, Floats]
    energy: float
    n_lost: int
    n_other: int
    is_binary32: bool


def read_table(path: Path, energy: float | None, unit: float) -> EnsembleTable:
    """Read an ensemble.

    Args:
        path: a .csv or .parquet file, or a .zarr folder, or a folder that holds ensemble.zarr.
        energy: v^2/2 of the rows to read where E0 has several, or of all where there is no E0.
        unit: v^2/2 of an energy of 1 in the file.

    Raises:
        BadInput: in one line, naming the column or the place.
    """
    label, n_lost, n_other, is_binary32 = f"--ensemble {str(path)!r}", 0, 0, True
    kept: dict[str, list[Floats]] = {"sums": []}
    energies: dict[float, int] = {}
    for part in _parts(path, label):
        start = np.full(len(next(iter(part.values()))), energy, float)
        if "E0" in part:
            start = part.pop("E0") * unit
            chosen = _select(label, start, energy, energies)
            n_other += int(np.sum(~chosen))
            start, part = start[chosen], {name: column[chosen] for name, column in part.items()}
        elif energy is None:
            raise BadInput(f"{label}: column 'E0' is missing, and so is --energy, v^2/2 of every start")
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            after = part.pop(ENERGIES, np.empty((0, 1)))
            sums = part.pop(GAIN)[:, None] if GAIN in part else np.log(after * unit / start[:, None])
            is_binary32 &= bool(after.size) and not np.any(np.abs(after - after.astype(np.float32)) > 0)
        followed = np.isfinite(sums).all(axis=1)
        n_lost += int(np.sum(~followed))
        for name, column in {**part, "sums": sums}.items():
            kept.setdefault(name, []).append(column[followed])
    whole = {name: np.concatenate(kept.pop(name) or [np.empty((0, 1))]) for name in list(kept)}
    sums = whole.pop("sums")
    if len(sums) < 2:
        raise BadInput(f"{label}: {len(sums)} energies, must be 2 or more")
    if len(energies) > 1:
        some = ", ".join(f"{value:g} ({n} rows)" for value, n in list(energies.items())[:4])
        raise BadInput(f"{label}: E0 takes {len(energies)} values, {some}: {ONE_ENERGY}")
    energy = next(iter(energies), energy)
    assert energy is not None
    return EnsembleTable(
        sums, whole, energy, n_lost, n_other, is_binary32 and len(np.unique(sums[:1000])) > 2
    )


def _select(
    label: str, start: Floats, energy: float | None, energies: dict[float, int]
) -> npt.NDArray[np.bool_]:
    """Tell which rows have the E0 that is asked for; where none is, count the rows of each E0."""
    bad = start[~(np.isfinite(start) & (start > 0))]
    if len(bad):
        raise BadInput(f"{label}: E0 = {bad[0]}, must be finite and > 0")
    if energy is not None:
        return np.abs(start / energy - 1) < SAME
    for value, n in zip(*np.unique(start, return_counts=True), strict=True):
        near = next((e for e in energies if abs(e / value - 1) < SAME), float(value))
        energies[near] = energies.get(near, 0) + int(n)
        if len(energies) > MAX_ENERGIES:
            low, high = min(energies), max(energies)
            raise BadInput(f"{label}: E0 takes many values, {low:g} to {high:g}: {ONE_ENERGY}")
    return np.ones(len(start), bool)


def _parts(path: Path, label: str) -> Iterator[dict[str, Floats]]:
    """Yield parts of a table by what its columns are: (n, K) the energies after K cycles, (n,) all others."""
    readers = {".csv": _csv, ".parquet": _parquet, ".zarr": _zarr}
    path = path / "ensemble.zarr" if (path / "ensemble.zarr").is_dir() else path
    if path.suffix not in readers:
        raise BadInput(f"{label}, must be a .csv or .parquet file, or a .zarr folder")
    try:
        for raw in readers[path.suffix](path, label):
            named = {what: [raw[name] for name in names] for what, names in _find_columns(label, raw).items()}
            stacked = {what: np.column_stack(columns) for what, columns in named.items()}
            yield {
                what: column if what == ENERGIES else np.asarray(np.fmin.reduce(column, axis=1))
                for what, column in stacked.items()
            }
    except OSError as error:
        raise BadInput(f"{label} cannot be read: {error.strerror or error}") from None


def _find_columns(label: str, names: Iterable[str]) -> dict[str, list[str]]:
    """Return the columns of a table that are needed, by what they are; cycles in their order."""
    given = list(names)
    names = sorted(given, key=lambda name: (len(name), name))
    twice = [name for name, following in pairwise(names) if name == following]
    found = {what: [n for n in names if re.fullmatch(form, n)] for what, form in NAMES.items()}
    problem = f"column {shown(twice[0])} stands twice" if twice else ""
    if not (problem or found[ENERGIES] or found[GAIN]):
        problem = f"column 'E1' is missing, as is 's'; it has {', '.join(given[:8])}"
    if problem:
        raise BadInput(f"{label}: {problem}")
    return {what: columns for what, columns in found.items() if columns}


def _select_columns(label: str, names: Iterable[str]) -> list[str]:
    return [name for columns in _find_columns(label, names).values() for name in columns]


def _csv(path: Path, label: str) -> Iterator[dict[str, Floats]]:
    """Yield parts of a CSV file: by Arrow where it is installed and numbers are decimal, else by cells."""
    with path.open(encoding="utf-8-sig", newline="") as file:
        header = [name.strip() for name in next(csv.reader(file), [])]
    wanted, n_done = _select_columns(label, header), 0
    try:
        from pyarrow import csv as arrow

        options = arrow.ConvertOptions(
            include_columns=wanted, column_types=dict.fromkeys(wanted, "float64"), null_values=list(NOTHING)
        )
        reading = arrow.ReadOptions(column_names=header, skip_rows=1, block_size=2**24)
        for batch in arrow.open_csv(path, reading, convert_options=options):
            yield {name: batch.column(name).to_numpy(zero_copy_only=False) for name in wanted}
            n_done += len(batch)
    except (ImportError, ValueError):  # the cells tell what is wrong, and where
        rows = islice(read_rows(path, label, wanted), n_done, None)
        while some := list(islice(rows, FEW)):
            yield {name: np.array([_cell(place, name, row[name]) for place, row in some]) for name in wanted}


def _cell(place: str, name: str, word: str) -> float:
    return float("nan") if word in NOTHING else read_number(place, name, FLAGS.get(word.lower(), word))


def _parquet(path: Path, label: str) -> Iterator[dict[str, Floats]]:
    arrow, parquet = import_arrow()
    try:
        with parquet.ParquetFile(path) as file:
            wanted = _select_columns(label, file.schema_arrow.names)
            for batch in file.iter_batches(PART, columns=wanted):
                columns = ((name, batch.column(name).cast("float64")) for name in wanted)
                yield {name: column.to_numpy(zero_copy_only=False) for name, column in columns}
    except (arrow.ArrowInvalid, arrow.ArrowNotImplementedError) as error:
        raise BadInput(f"{label}: {error}") from None


def _zarr(path: Path, label: str) -> Iterator[dict[str, Floats]]:
    try:
        group: Any = zarr.open_group(path, mode="r")
    except (OSError, ValueError, KeyError) as error:
        raise BadInput(f"{label} is no Zarr group: {error}") from None
    arrays = {name: group[name] for name in _select_columns(label, group.array_keys())}
    lengths = {name: array.shape[0] if array.ndim else 1 for name, array in arrays.items()}
    if len(set(lengths.values())) > 1:
        raise BadInput(f"{label}: arrays of {lengths} particles, must be as many in each")
    for first in range(0, next(iter(lengths.values())), PART):
        part = {name: np.asarray(array[first : first + PART], np.float64) for name, array in arrays.items()}
        is_first = {name: name.startswith("energy") or values.ndim == 1 for name, values in part.items()}
        yield {name: values if is_first[name] else values[:, 0] for name, values in part.items()}
