"""Folders that one process holds: where that cannot be written down, the file is named and nothing stays."""

from __future__ import annotations

import errno
import os

import pytest

from mushrooms.output import LOCK, locked


def test_a_full_disk_is_told_of_the_folder_that_was_to_be_held(tmp_path, monkeypatch):
    def full(_descriptor, _content):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "write", full)
    with pytest.raises(OSError, match="No space left") as refusal, locked(tmp_path):
        pass
    assert refusal.value.filename == str(tmp_path / LOCK)
    assert list(tmp_path.iterdir()) == []


def test_what_fails_in_a_held_folder_is_not_laid_to_its_lock(tmp_path):
    with pytest.raises(OSError, match="No space left") as refusal, locked(tmp_path):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    assert refusal.value.filename is None
