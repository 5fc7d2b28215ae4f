"""Tables as files, CSV and Parquet: what was run goes with them, damage is seen on reading.

Parquet has a place for metadata, and a checksum for each page of numbers. CSV has neither: beside
`run.csv` stands `run.csv-metadata.json`, as the W3C's "CSV on the Web" has it, with the SHA-256 of
the CSV file.
"""

import csv
import hashlib
import io
import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any, BinaryIO

from scene.files.writer import write_files
from scene.refusal import BadInput, shown

SUFFIXES = (".csv", ".parquet")
METADATA = "-metadata.json"  # after the name of a CSV file
SEPARATORS = {";": "semicolons", "\t": "tabs", "|": "bars", " ": "spaces"}
Tables = Iterable[Mapping[str, Any]]


def write_table(path: Path, tables: Tables, about: Mapping[str, Any]) -> None:
    """Write tables of the same columns one below the other, as a CSV or Parquet file.

    Args:
        path: with an ending of SUFFIXES.
        tables: columns by their names, lists or arrays; one table at least.
        about: what goes with them: scene, energy, seed, version. In Parquet each is a text, JSON if
            need be.

    Raises:
        BadInput: pyarrow is not installed.
    """
    if path.suffix == ".parquet":
        write_files(path.parent, {path.name: partial(_write_parquet, tables, about)})
        return
    digest = hashlib.sha256()

    def write_metadata(file: BinaryIO) -> None:
        notes = [{**about, "sha256": digest.hexdigest()}]
        found = {"@context": "http://www.w3.org/ns/csvw", "url": path.name, "notes": notes}
        file.write(json.dumps(found, indent=2).encode() + b"\n")

    write_files(
        path.parent,
        {
            path.name: partial(_write_csv, tables, digest.update),
            metadata_of(path).name: write_metadata,
        },
    )


def metadata_of(path: Path) -> Path:
    """Return where the metadata of a CSV file are."""
    return path.with_name(path.name + METADATA)


def check_digest(path: Path, label: str) -> None:
    """Refuse a CSV file that is not as its metadata say it was written, if it has any.

    Args:
        path: of the CSV file.
        label: what messages begin with.

    Raises:
        BadInput: naming the metadata.
        OSError: the CSV file cannot be read.
    """
    beside = metadata_of(path)
    if not beside.exists():
        return
    remove = f"remove {beside.name!r} to read the table as it is"
    try:
        wanted = json.loads(beside.read_text("utf-8"))["notes"][0]["sha256"]
    except (OSError, ValueError, LookupError, TypeError, RecursionError):
        raise BadInput(f"{label}: its metadata {beside.name!r} are damaged: {remove}") from None
    with path.open("rb") as file:
        found = hashlib.file_digest(file, "sha256").hexdigest()
    if found != wanted:
        raise BadInput(
            f"{label}: it is not as it was written, by the SHA-256 in its metadata: {remove}"
        )


def import_arrow() -> tuple[Any, Any]:
    """Import pyarrow and its Parquet module.

    Raises:
        BadInput: it is not installed.
    """
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        how = "pip install 'oscillating-mushrooms[parquet]'"
        raise BadInput(f"a .parquet file needs pyarrow: {how}") from None
    return pyarrow, pyarrow.parquet


def read_rows(
    path: Path, label: str, needed: Sequence[str], known: Sequence[str] | None = None
) -> Iterator[tuple[str, dict[str, str]]]:
    """Yield the rows of a CSV file by column names, each with its place; # begins a comment.

    Args:
        path: of the file.
        label: what messages begin with.
        needed: columns that must be there.
        known: columns that there may be; None for any.

    Raises:
        BadInput: naming the column, or the place.
    """
    with path.open(encoding="utf-8-sig", newline="") as file:
        reader = csv.reader(file)
        rows = (row for row in reader if any(map(str.strip, row)) and not row[0].startswith("#"))
        try:
            names = _names(next(rows, []), label)
            _check_names(names, label, needed, known)
            for row in rows:
                place = f"{label}:{reader.line_num}"
                if len(row) != len(names):
                    raise BadInput(f"{place}: {_miscounted(row, names)}")
                yield place, dict(zip(names, map(str.strip, row), strict=True))
        except (csv.Error, UnicodeDecodeError) as error:
            raise _unreadable(label, reader.line_num, error) from None


def read_names(path: Path, label: str) -> list[str]:
    """Return the names of the columns of a CSV file, from its first line.

    Raises:
        BadInput: it is no CSV file with commas.
    """
    with path.open(encoding="utf-8-sig", newline="") as file:
        try:
            return _names(next(csv.reader(file), []), label)
        except (csv.Error, UnicodeDecodeError) as error:
            raise _unreadable(label, 1, error) from None


def read_number(place: str, name: str, text: str) -> float:
    """Return a number written in decimal, with Fortran's D, or hexadecimal with p.

    Raises:
        BadInput: it is none, or not finite.
    """
    try:
        word = text.lower()
        number = float.fromhex(word) if "0x" in word else float(word.replace("d", "e"))
    except (ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        how = "with a decimal point" if "," in text else "decimal or as 0x1.8p+3"
        raise BadInput(f"{place}: {name} = {shown(text)}, must be a finite number, {how}")
    return number


def _write_csv(tables: Tables, note: Callable[[bytes], object], file: BinaryIO) -> None:
    """Write CSV, whose numbers read back to the same bits.

    `note` receives each piece as it is written.
    """
    for number, columns in enumerate(tables):
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        if number == 0:
            writer.writerow(columns)
        lists = (
            column.tolist() if hasattr(column, "tolist") else column for column in columns.values()
        )
        writer.writerows(zip(*lists, strict=True))
        content = text.getvalue().encode()
        note(content)
        file.write(content)


def _write_parquet(tables: Tables, about: Mapping[str, Any], file: BinaryIO) -> None:
    """Write Parquet, each table as a row group."""
    arrow, parquet = import_arrow()
    parts = map(arrow.table, tables)
    first = next(parts)
    texts = {
        name: word if isinstance(word, str) else json.dumps(word) for name, word in about.items()
    }
    schema = first.schema.with_metadata(texts)
    # As a context: else it would close itself later, in a page.
    with parquet.ParquetWriter(file, schema, write_page_checksum=True) as writer:
        for part in chain([first], parts):
            writer.write_table(part.cast(schema))


def _unreadable(label: str, line: int, error: Exception) -> BadInput:
    why = "it is no UTF-8" if isinstance(error, UnicodeDecodeError) else error
    return BadInput(f"{label}:{line}: {why}")


def _names(row: Sequence[str], label: str) -> list[str]:
    """Return the names in a first row.

    Of one that nothing separates refuse another separator by its name.
    """
    names = [name.strip() for name in row]
    if len(names) == 1:
        for mark, word in SEPARATORS.items():
            if mark in names[0]:
                raise BadInput(f"{label}: its columns are separated by {word}, must be by commas")
    return names


def _check_names(
    names: Sequence[str], label: str, needed: Sequence[str], known: Sequence[str] | None
) -> None:
    """Refuse columns of which one is missing, stands twice, or is unknown."""
    lacking = [name for name in needed if name not in names]
    twice = [name for i, name in enumerate(names) if name in names[:i]]
    unknown = [name for name in names if known and name not in known]
    faults = (("is missing", lacking), ("stands twice", twice), ("is unknown", unknown))
    for fault, found in faults:
        if found:
            which = f"; columns are {', '.join(known)}" if known else ""
            raise BadInput(f"{label}: column {shown(found[0])} {fault}{which}")


def _miscounted(row: Sequence[str], names: Sequence[str]) -> str:
    """Say that a row has too many or too few cells, and what makes twice as many."""
    said = f"{len(row)} cells, must be {len(names)} as in the first row"
    n_whole = sum(cell.strip().lstrip("+-").isdigit() for cell in row)
    is_decimal_comma = len(row) > len(names) and 2 * n_whole > len(row)
    return f"{said}; numbers must have a decimal point, no comma" if is_decimal_comma else said
