"""Files written whole or not at all, sealed against damage, and folders that one process holds at a time.

A file gets its name only when it is complete and on the disk. A sealed one ends in its own SHA-256.
"""

from __future__ import annotations

import hashlib
import os
import platform
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO, TextIO

from scene.refusal import BadInput

Writer = Callable[[BinaryIO], object]
LOCK = ".lock"
SEAL = len(hashlib.sha256().digest())  # bytes


def write_files(folder: Path, contents: Mapping[str, bytes | memoryview | str | Writer]) -> None:
    """Write files completely under hidden names, then give all of them their names.

    Args:
        folder: an existing folder.
        contents: per file name its bytes, its text, or what writes it into an open binary file.

    Raises:
        OSError: one of them cannot be written; it names the file.
    """
    try:
        for name, content in contents.items():
            with _named(folder / name), part(folder / name).open("wb") as file:
                if callable(content):
                    content(file)
                else:
                    file.write(content.encode("utf-8") if isinstance(content, str) else content)
                file.flush()
                os.fsync(file.fileno())
        for name in contents:
            part(folder / name).replace(folder / name)
    finally:
        for name in contents:
            part(folder / name).unlink(missing_ok=True)


@contextmanager
def _named(path: Path) -> Iterator[None]:
    """Let what fails say of which file: a full disk is found out by writing, where the system names none."""
    try:
        yield
    except OSError as error:
        if error.filename is None and error.errno is not None:
            raise OSError(error.errno, error.strerror, str(path)) from None
        raise


def write_file(path: Path, content: bytes | str | Writer) -> None:
    """Write one file whole or not at all; its folder must exist."""
    write_files(path.parent, {path.name: content})


def part(path: Path) -> Path:
    """Return the hidden name beside `path` under which this process writes it."""
    return path.with_name(f".{path.name}.{os.getpid()}.part")


def sealed(content: bytes) -> bytes:
    """Return what a file is to hold so that `unsealed` tells whether a bit of it has changed."""
    return content + hashlib.sha256(content).digest()


def unsealed(path: Path) -> bytes | None:
    """Return what was sealed in a file; None when there is none, or not all of it is as it was written."""
    try:
        found = path.read_bytes()
    except OSError:
        return None
    content, seal = found[:-SEAL], found[-SEAL:]
    return content if hashlib.sha256(content).digest() == seal else None


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold a folder; anybody else who asks for it meanwhile, here or in another process, is refused.

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
            with _named(path):
                os.write(file.fileno(), f"process {os.getpid()} on {platform.node()}".encode())
            yield
        finally:
            with suppress(PermissionError):  # Windows removes no open file; one that nobody holds is harmless
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
