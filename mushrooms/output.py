"""Output: folders and files proved writable before work starts, folders held, tables as CSV and Parquet."""

from __future__ import annotations

import csv
import io
import os
import platform
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from itertools import chain
from pathlib import Path
from typing import Any, BinaryIO, TextIO

from conformance.files import named, part
from scene.refusal import BadInput

LOCK = ".lock"


@contextmanager
def writable_folder(path: Path) -> Iterator[Path]:
    """Make a folder, prove that files can be written in it, and tidy up if the work fails.

    Args:
        path: the folder; missing parents are made too.

    Raises:
        BadInput: one line naming the path and what is wrong with it.
    """
    made = []
    folder = path
    while not os.path.lexists(folder):
        made.append(folder)
        folder = folder.parent
    try:
        path.mkdir(parents=True, exist_ok=True)
        probe = part(path / "probe")
        probe.write_bytes(b"")
        probe.unlink()
    except (FileExistsError, NotADirectoryError):
        raise BadInput(f"output {str(path)!r}: {str(folder)!r} is a file, must be a folder") from None
    except OSError as error:
        _remove_empty(made)
        raise BadInput(f"output {str(path)!r} must be a writable folder: {error.strerror}") from None
    try:
        yield path
    except BaseException:
        _remove_empty(made)
        raise


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold a folder; meanwhile all others are refused it, here and in another process.

    The system lets go of it when the process ends, however it ends. No clock and no process number decides.

    Args:
        folder: an existing folder that can be written in.

    Raises:
        BadInput: it is held.
    """
    path = folder / LOCK
    with path.open("a+", encoding="utf-8") as file:
        try:
            _hold(file)
            # A holder that has just ended may have removed the file that we opened.
            is_ours = os.path.samestat(os.fstat(file.fileno()), path.stat())
        except OSError:
            is_ours = False
        if not is_ours:
            file.seek(0)
            holder = file.read(200) or "another process"
            raise BadInput(f"folder {str(folder)!r} is in use by {holder}: one run at a time")
        try:
            file.truncate(0)
            # Past the buffer: what a full disk does not take would stay in it, and fail unnamed on closing.
            with named(path):
                os.write(file.fileno(), f"process {os.getpid()} on {platform.node()}".encode())
            yield
        finally:
            with suppress(PermissionError):  # Windows removes no open file; one that is not held is harmless
                path.unlink(missing_ok=True)


def _hold(file: TextIO) -> None:
    """Lock an open file, or raise OSError at once; the system unlocks it when the process ends."""
    if sys.platform == "win32":
        import msvcrt

        file.seek(2**30)  # what is locked cannot be read there, and the holder's name is to be read
        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
    else:
        import fcntl

        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def check_file(path: Path | None, suffixes: tuple[str, ...]) -> None:
    """Prove that a file of one of these kinds can be written at `path`, if one is asked for.

    Raises:
        BadInput: one line naming the path and what is wrong with it.
    """
    if path is None:
        return
    if path.suffix not in suffixes:
        raise BadInput(f"output {str(path)!r}: its ending must be one of {', '.join(suffixes)}")
    if path.is_dir():
        raise BadInput(f"output {str(path)!r} is a folder, must be a file")
    try:
        probe = part(path)
        probe.write_bytes(b"")
        probe.unlink()
    except OSError as error:
        raise BadInput(f"output {str(path)!r} cannot be written: {error.strerror}") from None


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


def write_csv(tables: Iterable[Mapping[str, Any]], file: BinaryIO, *, scene: str = "") -> None:
    """Write tables of the same columns one below the other; numbers read back to the same bits.

    Args:
        tables: columns by their names, lists or arrays; one table at least.
        file: open for binary writing.
        scene: has no place in a CSV file.
    """
    text = io.TextIOWrapper(file, encoding="utf-8", newline="")
    writer = csv.writer(text, lineterminator="\n")
    for number, columns in enumerate(tables):
        if number == 0:
            writer.writerow(columns)
        lists = (column.tolist() if hasattr(column, "tolist") else column for column in columns.values())
        writer.writerows(zip(*lists, strict=True))
    text.flush()
    text.detach()


def write_parquet(tables: Iterable[Mapping[str, Any]], file: BinaryIO, *, scene: str = "") -> None:
    """Write tables of the same columns, each as a row group, with a scene as metadata.

    Raises:
        BadInput: pyarrow is not installed.
    """
    arrow, parquet = import_arrow()
    parts = map(arrow.table, tables)
    first = next(parts)
    schema = first.schema.with_metadata({"scene": scene} if scene else None)
    with parquet.ParquetWriter(file, schema) as writer:  # else it would close itself later, in a page
        for part in chain([first], parts):
            writer.write_table(part.cast(schema))


TABLES = {".csv": write_csv, ".parquet": write_parquet}  # writers, by the ending of the file


def _remove_empty(folders: list[Path]) -> None:
    for folder in folders:
        try:
            folder.rmdir()
        except OSError:
            return
