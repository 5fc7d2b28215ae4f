"""Where a command writes: proved writable before the work begins, and held while it lasts."""

import os
import platform
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TextIO

from scene.files.writer import named, part
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
        _probe(path / "probe")
    except (FileExistsError, NotADirectoryError):
        raise BadInput(
            f"output {str(path)!r}: {str(folder)!r} is a file, must be a folder"
        ) from None
    except OSError as error:
        _remove_empty(made)
        raise BadInput(
            f"output {str(path)!r} must be a writable folder: {error.strerror}"
        ) from None
    try:
        yield path
    except BaseException:
        _remove_empty(made)
        raise


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold a folder; meanwhile all others are refused it, here and in another process.

    The system lets go of it when the process ends, however it ends. No clock and no process number
    decides.

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
            # Past the buffer: what a full disk does not take would stay in it, and fail unnamed on
            # closing.
            with named(path):
                os.write(file.fileno(), f"process {os.getpid()} on {platform.node()}".encode())
            yield
        finally:
            with suppress(
                PermissionError
            ):  # Windows removes no open file; one that is not held is harmless
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
        _probe(path)
    except OSError as error:
        raise BadInput(f"output {str(path)!r} cannot be written: {error.strerror}") from None


def _probe(path: Path) -> None:
    part(path).write_bytes(b"")
    part(path).unlink()


def _remove_empty(folders: list[Path]) -> None:
    with suppress(OSError):  # one that is not empty stays, and so do those around it
        for folder in folders:
            folder.rmdir()
