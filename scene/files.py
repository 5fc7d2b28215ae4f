"""Files written whole or not at all: a file gets its name only when it is complete and on the disk."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import BinaryIO

Writer = Callable[[BinaryIO], object]


def write_files(folder: Path, contents: Mapping[str, bytes | str | Writer]) -> None:
    """Write files completely under hidden names, then give all of them their names.

    Args:
        folder: an existing folder.
        contents: per file name its bytes, its text, or what writes it into an open binary file.
    """
    try:
        for name, content in contents.items():
            with part(folder / name).open("wb") as file:
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


def write_file(path: Path, content: bytes | str | Writer) -> None:
    """Write one file whole or not at all; its folder must exist."""
    write_files(path.parent, {path.name: content})


def part(path: Path) -> Path:
    """Return the hidden name beside `path` under which this process writes it."""
    return path.with_name(f".{path.name}.{os.getpid()}.part")
