"""Files written whole or not at all, and sealed against damage.

A file gets its name only when it is complete and on the disk. A sealed one ends in its own SHA-256.
"""

import hashlib
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

Writer = Callable[[BinaryIO], object]
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
            with named(folder / name), part(folder / name).open("wb") as file:
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
def named(path: Path) -> Iterator[None]:
    """Let what fails say of which file.

    A full disk is found out by writing, where the system names none.
    """
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
    """Return what was sealed in a file.

    None when there is none, or not all of it is as it was written.
    """
    try:
        found = path.read_bytes()
    except OSError:
        return None
    content = found[:-SEAL]
    seal = found[-SEAL:]
    return content if hashlib.sha256(content).digest() == seal else None
