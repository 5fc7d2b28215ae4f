"""What a disk, a person or a bad day may do to a file of a stored run."""

import errno
import os

from zarr.storage import LocalStore

PUT = LocalStore.set


def full_disk(monkeypatch, n_writes):
    """Let a disk be full after so many files, whether zarr writes them or we do."""
    left, put = n_writes, PUT

    def take():
        nonlocal left
        left -= 1
        if left < 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    async def full_set(self, key, value):
        take()
        await put(self, key, value)

    monkeypatch.setattr(LocalStore, "set", full_set)
    monkeypatch.setattr(os, "fsync", lambda _descriptor: take())


def harmed(folder, random):
    """Do something bad to a random file of a run: a chunk, a marker, a description of an array."""
    paths = sorted(path for path in folder.rglob("*") if path.is_file())
    path, kind = paths[random.integers(len(paths))], random.integers(4)
    if kind == 0:
        path.unlink()
        return
    content = path.read_bytes()
    at = int(random.integers(len(content)))
    flip = content[:at] + bytes([content[at] ^ 1 << int(random.integers(8))]) + content[at + 1 :]
    other = paths[random.integers(len(paths))].read_bytes()
    path.write_bytes([content[:at], flip, other][kind - 1])


def held(folder):
    """Return what the files in a folder hold, by path."""
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
