"""Somebody's ensemble read from CSV, Parquet or Zarr, a part at a time: what the audit needs of it.

A row is a particle. Columns: E0 and E1, or E0, E1, E2 ... a cycle each, or s = log E1/E0; where there are any
t_in, t_out (of a stay in the
cap), captured (0 or 1), and x0, y0, where it started. The names that `mushrooms export` writes will do.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from conformance.suite.sheet_files import read_number
from mushrooms.output import import_arrow
from scene.refusal import BadInput, shown

Floats = npt.NDArray[np.float64]
PART = 500_000  # rows read at a time
MAX_ENERGIES = 20  # different E0 that are listed
SAME = 1e-6  # relative difference of E0 that writing it in few digits makes
NOTHING = ("", "nan", "NaN", "NA", "null", "none", "None")
FLAGS = {"true": 1.0, "false": 0.0, "t": 1.0, "f": 0.0, "yes": 1.0, "no": 0.0}
# What a column may be called; of several narrowings or stays the earliest counts.
NAMES = {
    "E0": r"E_?0|e0|energy_?0",
    "E1": r"E_?1|e1|energy(_1)?",
    "s": r"s|log_E1_E0|log_gain",
    "t_in": r"t_in(_1(_\d+)?)?",
    "t_out": r"t_out(_1(_\d+)?)?",
    "captured": r"(is_)?captured(_1)?",
    "x0": "x_?0",
    "y0": "y_?0",
}


class Given(NamedTuple):
    """What a table holds.

    Attributes:
        s: (n,) log E1/E0 of those that have energies.
        columns: t_in, t_out, captured of the same, where there are any.
        energies: the E0 that occur, with how many; empty where there is no such column.
        n_lost: rows without an energy.
        n_other: rows of another E0 than was asked for.
        is_binary32: whether every E1 has 24 bits.
    """

    s: Floats
    columns: dict[str, Floats]
    energies: dict[float, int]
    n_lost: int
    n_other: int
    is_binary32: bool


def read_table(path: Path, energy: float | None, unit: float) -> Given:
    """Read an ensemble.

    Args:
        path: a .csv or .parquet file, or a .zarr folder, or a folder that holds ensemble.zarr.
        energy: v^2/2 of the rows to read where E0 has several, or of all where there is no E0.
        unit: v^2/2 of an energy of 1 in the file.

    Raises:
        BadInput: in one line, naming the column or the place.
    """
    parts = Parts(path, energy, unit)
    read = _readers().get(path.suffix)
    if (path / "ensemble.zarr").is_dir():
        path, read = path / "ensemble.zarr", _zarr
    if read is None:
        raise BadInput(f"--ensemble = {str(path)!r}, must be a .csv or .parquet file, or a .zarr folder")
    try:
        for columns in read(path):
            parts.add(columns)
    except OSError as error:
        raise BadInput(f"--ensemble {str(path)!r} cannot be read: {error.strerror or error}") from None
    return parts.given()


class Parts:
    """Gathers an ensemble from parts of a table."""

    def __init__(self, path: Path, energy: float | None, unit: float) -> None:
        self._path, self._energy, self._unit = path, energy, unit
        self._kept: dict[str, list[Floats]] = {}
        self._energies: dict[float, int] = {}
        self._n_lost = self._n_other = 0
        self._is_binary32: bool | None = None

    def add(self, columns: Mapping[str, Floats]) -> None:
        """Add some rows, by the names of NAMES."""
        start = self._starts(columns)
        if start is not None and self._energy is not None and "E0" in columns:
            chosen = np.abs(start / self._energy - 1) < SAME
            self._n_other += int(np.sum(~chosen))
            columns = {name: column[chosen] for name, column in columns.items()}
            start = start[chosen]
        with np.errstate(divide="ignore", invalid="ignore"):
            if "s" in columns:
                s = columns["s"]
            else:
                assert start is not None
                s = np.log(columns["E1"] * self._unit / start)
                finite = columns["E1"][np.isfinite(columns["E1"])]
                is_single = bool(np.all(finite == finite.astype(np.float32)))
                self._is_binary32 = is_single and self._is_binary32 is not False
        followed = np.isfinite(s)
        self._n_lost += int(np.sum(~followed))
        for name, column in {**columns, "s": s}.items():
            if name not in ("E0", "E1"):
                self._kept.setdefault(name, []).append(column[followed])

    def given(self) -> Given:
        """Return all rows together, as one array a column."""
        whole: dict[str, Floats] = {}
        for name in list(self._kept):
            whole[name] = np.concatenate(self._kept.pop(name))
        s = whole.pop("s", np.empty(0))
        if len(s) < 2:
            raise BadInput(f"--ensemble {str(self._path)!r}: {len(s)} energies, must be 2 or more")
        is_single = bool(self._is_binary32) and len(np.unique(s[:1000])) > 2
        return Given(s, whole, self._energies, self._n_lost, self._n_other, is_single)

    def _starts(self, columns: Mapping[str, Floats]) -> Floats | None:
        if "E0" not in columns:
            if "E1" in columns and self._energy is None:
                raise BadInput(f"--ensemble {str(self._path)!r}: column 'E0' is missing, and so is --energy")
            return np.full(len(columns["E1"]), self._energy) if "E1" in columns else None
        start = columns["E0"] * self._unit
        bad = start[~(np.isfinite(start) & (start > 0))]
        if len(bad):
            raise BadInput(f"--ensemble {str(self._path)!r}: E0 = {bad[0]}, must be finite and > 0")
        for value, n in zip(*np.unique(start, return_counts=True), strict=True):
            near = next((e for e in self._energies if abs(e / value - 1) < SAME), float(value))
            self._energies[near] = self._energies.get(near, 0) + int(n)
            if len(self._energies) > MAX_ENERGIES and self._energy is None:
                low, high = min(self._energies), max(self._energies)
                raise BadInput(
                    f"--ensemble {str(self._path)!r}: E0 takes many values, {low:g} to {high:g}:"
                    " an audit is of starts of one energy, --energy picks them"
                )
        return start


def _named(path: Path, names: Iterable[str]) -> dict[str, list[str]]:
    """Return the columns of a table that are needed, by what they are."""
    names = list(names)
    twice = [name for i, name in enumerate(names) if name in names[:i]]
    found = {what: [n for n in names if re.fullmatch(form, n)] for what, form in NAMES.items()}
    found = {what: columns for what, columns in found.items() if columns}
    problem = f"column {shown(twice[0])} stands twice" if twice else ""
    if not problem and "E1" not in found and "s" not in found:
        problem = f"column 'E1' is missing, as is 's'; it has {', '.join(names[:8])}"
    if problem:
        raise BadInput(f"--ensemble {str(path)!r}: {problem}")
    return found


def _earliest(columns: Sequence[Floats]) -> Floats:
    return np.asarray(np.fmin.reduce(columns)) if len(columns) > 1 else columns[0]


def _csv(path: Path) -> Iterator[dict[str, Floats]]:
    """Yield parts of a CSV file: by Arrow where it is installed and the numbers are decimal."""
    with path.open(encoding="utf-8-sig", newline="") as file:
        header = [name.strip() for name in next(csv.reader(file), [])]
    named = _named(path, header)
    try:
        from pyarrow import ArrowInvalid
        from pyarrow import csv as arrow
    except ImportError:
        yield from _csv_slowly(path, named)
        return
    wanted = [name for names in named.values() for name in names]
    options = arrow.ConvertOptions(
        include_columns=wanted, column_types=dict.fromkeys(wanted, "float64"), null_values=list(NOTHING)
    )
    done = 0
    try:
        reading = arrow.ReadOptions(column_names=header, skip_rows=1, block_size=2**24)
        for batch in arrow.open_csv(path, reading, convert_options=options):
            table = {name: batch.column(name).to_numpy(zero_copy_only=False) for name in wanted}
            yield {what: _earliest([table[name] for name in names]) for what, names in named.items()}
            done += len(batch)
    except ArrowInvalid:
        yield from _csv_slowly(path, named, done)


def _csv_slowly(path: Path, named: Mapping[str, list[str]], first: int = 0) -> Iterator[dict[str, Floats]]:
    """Yield parts of a CSV file from a row on, cell by cell: other numbers, and what is wrong where."""
    with path.open(encoding="utf-8-sig", newline="") as file:
        reader = csv.reader(file)
        header = [name.strip() for name in next(reader)]
        rows: list[list[float]] = []
        try:
            for number, row in enumerate(reader):
                if number < first or not row:
                    continue
                place = f"--ensemble {str(path)!r}:{reader.line_num}"
                if len(row) != len(header):
                    raise BadInput(f"{place}: {len(row)} cells, must be {len(header)} as in the first row")
                cells = dict(zip(header, row, strict=True))
                rows.append([_cell(place, name, cells[name]) for names in named.values() for name in names])
                if len(rows) == PART:
                    yield _columns(rows, named)
                    rows = []
        except (csv.Error, UnicodeDecodeError) as error:
            raise BadInput(f"--ensemble {str(path)!r}:{reader.line_num}: {error}") from None
    if rows:
        yield _columns(rows, named)


def _columns(rows: list[list[float]], named: Mapping[str, list[str]]) -> dict[str, Floats]:
    table = iter(np.array(rows, dtype=np.float64).T)
    return {what: _earliest([next(table) for _ in names]) for what, names in named.items()}


def _cell(place: str, name: str, text: str) -> float:
    word = text.strip()
    if word in NOTHING:
        return float("nan")
    return FLAGS[word.lower()] if word.lower() in FLAGS else read_number(place, name, word)


def _parquet(path: Path) -> Iterator[dict[str, Floats]]:
    arrow, parquet = import_arrow()
    try:
        with parquet.ParquetFile(path) as file:
            named = _named(path, file.schema_arrow.names)
            wanted = [name for names in named.values() for name in names]
            for batch in file.iter_batches(PART, columns=wanted):
                table = {
                    name: batch.column(name).cast("float64").to_numpy(zero_copy_only=False) for name in wanted
                }
                yield {what: _earliest([table[name] for name in names]) for what, names in named.items()}
    except (arrow.ArrowInvalid, arrow.ArrowNotImplementedError) as error:
        raise BadInput(f"--ensemble {str(path)!r}: {error}") from None


def _zarr(path: Path) -> Iterator[dict[str, Floats]]:
    try:
        import zarr
    except ImportError:
        raise BadInput("a .zarr folder needs zarr: pip install 'oscillating-mushrooms[scale]'") from None
    try:
        group: Any = zarr.open_group(path, mode="r")
    except (OSError, ValueError, KeyError) as error:
        raise BadInput(f"--ensemble {str(path)!r} is no Zarr group: {error}") from None
    named = _named(path, sorted(group.array_keys()))
    arrays = {what: group[names[0]] for what, names in named.items()}
    lengths = {what: array.shape[0] if array.ndim else 1 for what, array in arrays.items()}
    if len(set(lengths.values())) > 1:
        raise BadInput(f"--ensemble {str(path)!r}: arrays of {lengths} particles, must be as many in each")
    for first in range(0, next(iter(lengths.values())), PART):
        table = {what: np.asarray(array[first : first + PART], np.float64) for what, array in arrays.items()}
        # Of several cycles the first; of several narrowings in it the earliest stay.
        yield {what: _first_cycle(values) for what, values in table.items()}


def _first_cycle(values: Floats) -> Floats:
    values = values[:, 0] if values.ndim > 1 else values
    return np.asarray(np.fmin.reduce(values, axis=1)) if values.ndim > 1 else values


def _readers() -> dict[str, Callable[[Path], Iterator[dict[str, Floats]]]]:
    return {".csv": _csv, ".parquet": _parquet, ".zarr": _zarr}
