"""Tables as files, CSV and Parquet: what was run goes with them, and damage is seen when they are read.

Parquet has a place for metadata, and a checksum for each page of numbers. CSV has neither: beside `run.csv`
stands `run.csv-metadata.json`, as the W3C's "CSV on the Web" has it, with the SHA-256 of the CSV file.
"""

import csv
import hashlib
import io
import json
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any, BinaryIO

import scene as scenes
from conformance.files import write_files
from mushrooms import __version__
from scene import BadInput, Scene

SUFFIXES = (".csv", ".parquet")
METADATA = "-metadata.json"  # after the name of a CSV file
Tables = Iterable[Mapping[str, Any]]


def write_table(path: Path, tables: Tables, about: Mapping[str, Any]) -> None:
    """Write tables of the same columns one below the other, as a CSV or Parquet file.

    Args:
        path: with an ending of SUFFIXES.
        tables: columns by their names, lists or arrays; one table at least.
        about: what goes with them: scene, energy, seed, version. In Parquet each is a text, JSON if need be.

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
        {path.name: partial(_write_csv, tables, digest.update), metadata_of(path).name: write_metadata},
    )


def describe(scene: Scene, *, energy: float, seed: int | None) -> dict[str, Any]:
    """Return what goes with a table of particles: the scene, their initial energy, seed and version."""
    found = {"version": __version__, "scene": scenes.to_data(scene), "energy": energy}
    return found if seed is None else {**found, "seed": seed}


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
        raise BadInput(f"{label}: it is not as it was written, by the SHA-256 in its metadata: {remove}")


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


def _write_csv(tables: Tables, note: Callable[[bytes], object], file: BinaryIO) -> None:
    """Write CSV, whose numbers read back to the same bits; `note` receives each piece as it is written."""
    for number, columns in enumerate(tables):
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        if number == 0:
            writer.writerow(columns)
        lists = (column.tolist() if hasattr(column, "tolist") else column for column in columns.values())
        writer.writerows(zip(*lists, strict=True))
        content = text.getvalue().encode()
        note(content)
        file.write(content)


def _write_parquet(tables: Tables, about: Mapping[str, Any], file: BinaryIO) -> None:
    """Write Parquet, each table as a row group."""
    arrow, parquet = import_arrow()
    parts = map(arrow.table, tables)
    first = next(parts)
    texts = {name: word if isinstance(word, str) else json.dumps(word) for name, word in about.items()}
    schema = first.schema.with_metadata(texts)
    # As a context: else it would close itself later, in a page.
    with parquet.ParquetWriter(file, schema, write_page_checksum=True) as writer:
        for part in chain([first], parts):
            writer.write_table(part.cast(schema))
