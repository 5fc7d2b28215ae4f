"""An ensemble of another program, read a part at a time from CSV, Parquet or Zarr.

A row is a particle. Columns are E0, then E1, E2 ... after each cycle, or s = log E1/E0. There may
be t_in and t_out (ends of the first cycle's capture interval), captured (0 or 1), and x0, y0, where
it started. The names that `mushrooms export` writes will do.
"""

import re
from collections.abc import Iterable, Iterator
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import zarr

from mushrooms.audit.ensemble_checks import (
    GivenEnsemble,
    cycle_start,
    expected,
    gap,
)
from mushrooms.audit.runs import BoolArray, FloatArray
from mushrooms.store.run import GROUP, UNREADABLE, folder_of, open_run
from scene.files.tables import check_digest, import_arrow, read_names, read_number, read_rows
from scene.refusal import BadInput
from scene.tables import Mushroom

UNITS = {"v2/2": 1.0, "v2": 0.5}  # what an energy of 1 in a file is as v^2/2
TIMES = ("scene", "cycles")
TOUCH = 0.05  # of a cycle, by which times may lie outside the capture that theory has
PART = 500_000  # rows read at a time as arrays
FEW = 20_000  # and as texts
SAME = 1e-6  # relative difference of E0 that writing it in few digits makes
NOTHING = ("", "nan", "NaN", "NA", "null", "none", "None")
FLAGS = {"true": "1", "false": "0", "t": "1", "f": "0", "yes": "1", "no": "0"}
ENERGIES = "E1"
GAIN = "s"
# What a column may be called; of several minima of nu or capture intervals the earliest counts.
NAMES = {
    "E0": r"E_?0|e0|energy_?0",
    ENERGIES: r"E_?[1-9]\d*|e[1-9]\d*|(energy|cycle_energies)(_[1-9]\d*)?",
    GAIN: r"s|log_E1_E0|log_gain",
    "t_in": r"t_in(_1(_\d+)?)?",
    "t_out": r"t_out(_1(_\d+)?)?",
    "captured": r"(is_)?captured(_1)?",
    "x0": "x_?0",
    "y0": "y_?0",
}


class Reading(NamedTuple):
    """How the file of an ensemble is read: energy of the starts, units, number of starts."""

    energy: float | None
    energy_unit: str
    time_unit: str | None
    particles: int | None


def read(path: Path, scene: Mushroom, reading: Reading) -> tuple[GivenEnsemble, list[str]]:
    """Return an ensemble in the scene's units, and what was taken for granted."""
    given, n_other = read_table(path, scene, reading.energy, UNITS[reading.energy_unit])
    form = reading.energy_unit.replace("v2", "v²")
    notes = [
        f"energies are taken as {form}, lengths in the scene's unit: E0 = {given.energy:g} as v²/2"
    ]
    if n_other:
        notes.append(f"{n_other:,} rows of another E0 are left out")
    if given.t_in is not None and np.isfinite(given.t_in).any():
        unit = reading.time_unit or _unit(given)
        size = scene.period if unit == "cycles" else 1.0
        t_out = None if given.t_out is None else given.t_out * size
        given = given._replace(t_in=given.t_in * size, t_out=t_out)
        told = "as parts of a cycle" if unit == "cycles" else "in the unit of the scene"
        notes.append(f"times are taken {told}, {'as said' if reading.time_unit else 'inferred'}")
    if given.captured is None and given.t_in is not None:
        given = given._replace(captured=np.isfinite(given.t_in))
        notes.append("captured are those with a t_in")
    if reading.particles is not None:
        given = _with_particles(given, reading.particles)
    return given, notes


def _with_particles(given: GivenEnsemble, n_particles: int) -> GivenEnsemble:
    """Count as lost the particles that were started and have no row."""
    n_rows = len(given.s) + given.n_lost
    if n_particles < n_rows:
        raise BadInput(f"--particles = {n_particles}, must be at least the {n_rows} rows")
    return given._replace(n_lost=n_particles - len(given.s))


def _unit(given: GivenEnsemble) -> str:
    """Return the unit in which times are in the cycle.

    Of two that in which they are nearer to theory's.
    """
    begin = cycle_start(given.scene)
    span = given.scene.period
    known = np.empty(0) if given.t_in is None else given.t_in[np.isfinite(given.t_in)]
    low = float(known.min())
    high = float(known.max())
    sizes = dict(zip(TIMES, (1.0, span), strict=True))
    least = begin - TOUCH * span
    most = begin + (1 + TOUCH) * span
    fitting = [unit for unit, size in sizes.items() if least <= low * size and high * size <= most]
    if not fitting:
        raise BadInput(
            f"t_in = {low:g} to {high:g}, must be in the cycle, {begin:g} to {begin + span:g} in"
            " the scene's time, or 0 to 1 in cycles: --time-unit says which"
        )
    theirs = expected(given.scene, given.energy)
    if len(fitting) == 1 or theirs.p_nc == 1:
        return fitting[0]
    return min(fitting, key=lambda unit: gap(known * sizes[unit], theirs.capture_cdf))


def read_table(
    path: Path, scene: Mushroom, energy: float | None, unit: float
) -> tuple[GivenEnsemble, int]:
    """Read an ensemble, its times as they are written.

    Args:
        path: a .csv or .parquet file, or a .zarr folder, or a folder that holds ensemble.zarr.
        scene: that is claimed to have been simulated.
        energy: of the rows to read where E0 has several, or of all where there is no E0, in the
            file's unit.
        unit: v^2/2 of an energy of 1 in the file.

    Returns:
        The ensemble, and the number of rows of another E0 than was asked for.

    Raises:
        BadInput: in one line, naming the column or the place.
    """
    label = f"--ensemble {str(path)!r}"
    n_lost = 0
    n_other = 0
    is_binary32 = True
    kept: dict[str, list[FloatArray]] = {"sums": []}
    one = energy
    for part in _parts(path, label):
        one = _first_energy(label, part) if one is None else one
        start, columns = _split_start(label, part, one, is_asked=energy is not None)
        n_other += len(next(iter(part.values()))) - len(start)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            after = columns.pop(ENERGIES, np.empty((0, 1)))
            sums = columns.pop(GAIN)[:, None] if GAIN in columns else np.log(after / start[:, None])
            is_binary32 &= bool(after.size) and not np.any(
                np.abs(after - after.astype(np.float32)) > 0
            )
        followed = np.isfinite(sums).all(axis=1)
        n_lost += int(np.sum(~followed))
        for name, column in {**columns, "sums": sums}.items():
            kept.setdefault(name, []).append(column[followed])
    whole = _joined(label, kept)
    sums = whole.pop("sums")
    assert one is not None
    given = GivenEnsemble(
        scene,
        one * unit,
        sums[:, 0],
        n_lost=n_lost,
        is_binary32=is_binary32 and len(np.unique(sums[:1000])) > 2,
        later=sums[:, 1:] if sums.shape[1] > 1 else None,
        **whole,
    )
    return given, n_other


def _first_energy(label: str, part: dict[str, FloatArray]) -> float:
    """Return the E0 of the first row, where no energy was asked for."""
    if "E0" not in part:
        raise BadInput(f"{label}: column 'E0' is missing, and so is --energy, v^2/2 of every start")
    return float(part["E0"][0])


def _split_start(
    label: str, part: dict[str, FloatArray], energy: float, *, is_asked: bool
) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Return the initial energies, and the other columns, of the rows that have this E0."""
    if "E0" not in part:
        return np.full(len(next(iter(part.values()))), energy, float), part
    chosen = _is_start(label, part["E0"], energy, is_asked=is_asked)
    columns = {name: column[chosen] for name, column in part.items()}
    return columns.pop("E0"), columns


def _joined(label: str, kept: dict[str, list[FloatArray]]) -> dict[str, Any]:
    """Join the parts of each column, which are given up one by one; refuse what no ensemble has."""
    whole: dict[str, Any] = {
        name: np.concatenate(kept.pop(name) or [np.empty((0, 1))]) for name in list(kept)
    }
    if len(whole["sums"]) < 2:
        raise BadInput(f"{label}: {len(whole['sums'])} energies, must be 2 or more")
    if "captured" in whole:
        odd = whole["captured"][~np.isin(whole["captured"], (0, 1))]
        if len(odd):
            raise BadInput(f"{label}: captured = {odd[0]}, must be 0 or 1")
        whole["captured"] = whole["captured"].astype(bool)
    return whole


def _is_start(label: str, start: FloatArray, energy: float, *, is_asked: bool) -> BoolArray:
    """Tell which rows have an E0; all must, unless it was asked for."""
    bad = start[~(np.isfinite(start) & (start > 0))]
    if len(bad):
        raise BadInput(f"{label}: E0 = {bad[0]}, must be finite and > 0")
    found = np.abs(start / energy - 1) < SAME
    if not (is_asked or found.all()):
        raise BadInput(
            f"{label}: E0 takes several values, {energy:g} and {start[~found][0]:g} among them:"
            " an audit is of starts of one energy, --energy picks them"
        )
    return np.asarray(found)


def _parts(path: Path, label: str) -> Iterator[dict[str, FloatArray]]:
    """Yield parts of a table by what its columns are.

    Energies after K cycles are (n, K), all others (n,).
    """
    readers = {".csv": _csv, ".parquet": _parquet, ".zarr": _zarr}
    run = folder_of(path)
    path = path / GROUP if (path / GROUP).is_dir() else path
    if run is None and path.suffix not in readers:
        raise BadInput(
            f"{label}, must be a .csv or .parquet file, a .zarr folder, or the folder of a run"
        )
    parts = readers[path.suffix](path, label) if run is None else _run(run)
    try:
        for raw in parts:
            named = {
                what: [raw[name] for name in names]
                for what, names in _find_columns(label, raw).items()
            }
            stacked = {what: np.column_stack(columns) for what, columns in named.items()}
            yield {
                what: column if what == ENERGIES else np.asarray(np.fmin.reduce(column, axis=1))
                for what, column in stacked.items()
            }
    except OSError as error:
        raise BadInput(f"{label} cannot be read: {error.strerror or error}") from None
    except MemoryError:
        raise BadInput(f"{label} cannot be read: it asks for more memory than there is") from None


def _run(folder: Path) -> Iterator[dict[str, FloatArray]]:
    """Yield the blocks of a run of `mushrooms simulate --out`, which is held to its checksums."""
    run = open_run(folder)
    for number in range(run.shape.n_blocks):
        part = {"cycle_energies": run.read(number, "cycle_energies")}
        part |= {
            name: run.read(number, name)[:, 0]
            for name in ("t_in", "t_out")
            if name in run.shape.names
        }
        yield {"E0": np.full(run.shape.rows(number), run.spec.energy), **part}


def _find_columns(label: str, names: Iterable[str]) -> dict[str, list[str]]:
    """Return the columns of a table that are needed, by what they are; cycles in their order."""
    given = list(names)
    ordered = sorted(given, key=lambda name: (len(name), name))
    found = {what: [n for n in ordered if re.fullmatch(form, n)] for what, form in NAMES.items()}
    if not (found[ENERGIES] or found[GAIN]):
        raise BadInput(f"{label}: column 'E1' is missing, as is 's'; it has {', '.join(given[:8])}")
    return {what: columns for what, columns in found.items() if columns}


def _select_columns(label: str, names: Iterable[str]) -> list[str]:
    return [name for columns in _find_columns(label, names).values() for name in columns]


def _csv(path: Path, label: str) -> Iterator[dict[str, FloatArray]]:
    """Yield parts of a CSV file: by Arrow if installed and numbers are decimal, else by cells.

    Of a million rows of two columns Arrow takes half a second, the reader by cells four.
    """
    check_digest(path, label)
    header = read_names(path, label)
    wanted = _select_columns(label, header)
    n_done = 0
    try:
        from pyarrow import csv as arrow

        options = arrow.ConvertOptions(
            include_columns=wanted,
            column_types=dict.fromkeys(wanted, "float64"),
            null_values=list(NOTHING),
        )
        reading = arrow.ReadOptions(column_names=header, skip_rows=1, block_size=2**24)
        for batch in arrow.open_csv(path, reading, convert_options=options):
            yield {name: batch.column(name).to_numpy(zero_copy_only=False) for name in wanted}
            n_done += len(batch)
    except (ImportError, ValueError, KeyError):  # the cells tell what is wrong, and where
        rows = islice(read_rows(path, label, wanted), n_done, None)
        for some in iter(lambda: list(islice(rows, FEW)), []):
            yield {
                name: np.array([_cell(place, name, row[name]) for place, row in some])
                for name in wanted
            }


def _cell(place: str, name: str, word: str) -> float:
    return (
        float("nan") if word in NOTHING else read_number(place, name, FLAGS.get(word.lower(), word))
    )


def _parquet(path: Path, label: str) -> Iterator[dict[str, FloatArray]]:
    arrow, parquet = import_arrow()
    try:
        with parquet.ParquetFile(path, page_checksum_verification=True) as file:
            names = file.schema_arrow.names
            wanted = _select_columns(label, names)
            twice = next((name for name in wanted if names.count(name) > 1), None)
            if twice is not None:
                raise BadInput(f"{label}: column {twice!r} stands twice")
            for batch in file.iter_batches(PART, columns=wanted):
                columns = ((name, batch.column(name).cast("float64")) for name in wanted)
                yield {name: column.to_numpy(zero_copy_only=False) for name, column in columns}
    except (arrow.ArrowException, LookupError, UnicodeError, OverflowError) as error:
        raise BadInput(f"{label} cannot be read: {error}") from None


def _zarr(path: Path, label: str) -> Iterator[dict[str, FloatArray]]:
    """Yield parts of a Zarr group of another program, which has no checksums of ours."""
    try:
        group: Any = zarr.open_group(path, mode="r")
        names = list(group.array_keys())
    except UNREADABLE as error:
        raise BadInput(f"{label} is no Zarr group: {error}") from None
    wanted = _select_columns(label, names)
    try:
        arrays = {name: group[name] for name in wanted}
        lengths = {name: array.shape[0] if array.ndim else 1 for name, array in arrays.items()}
    except UNREADABLE as error:
        raise BadInput(f"{label} cannot be read: {error}") from None
    if len(set(lengths.values())) > 1:
        raise BadInput(f"{label}: arrays of {lengths} particles, must be as many in each")
    for first in range(0, next(iter(lengths.values())), PART):
        yield {name: _values(label, name, array, first) for name, array in arrays.items()}


def _values(label: str, name: str, array: Any, first: int) -> FloatArray:
    """Return part of an array of a Zarr group.

    Of several cycles only energies have more than the first.
    """
    try:
        values = np.asarray(array[first : first + PART], np.float64)
    except UNREADABLE as error:
        raise BadInput(f"{label}: array {name!r} cannot be read: {error}") from None
    return values if values.ndim == 1 or name == "cycle_energies" else values[:, 0]
