"""Output refused early: a folder or a file is proved writable before work starts; the import of pyarrow."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from scene.files import part
from scene.refusal import BadInput


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


def check_file(path: Path, suffixes: tuple[str, ...]) -> None:
    """Prove that a file of one of these kinds can be written at `path`.

    Raises:
        BadInput: one line naming the path and what is wrong with it.
    """
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


def _remove_empty(folders: list[Path]) -> None:
    for folder in folders:
        try:
            folder.rmdir()
        except OSError:
            return
