"""Compiling in two processes at once: numba compiles one function after another, but keeps them on disk.

A run needs the careful step, its loops and `follow_particles`, which calls those by their addresses and
takes about as long to compile as they do together. When the careful step is about to be compiled, a second
process begins with `follow_particles`; this one will find it kept. Whatever goes wrong there, it is compiled
here as if nobody had tried.
"""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from numba.core import event

COMMAND = ("-P", "-m", "fast.following")  # -P: not what lies in the folder that a user happens to be in
MARK = "OSCILLATING_MUSHROOMS_BESIDE"  # in the second process's environment: it starts no third
PATIENCE = 60.0  # seconds beyond our own, after which we go on alone
_ONCE = threading.Lock()  # taken by the thread that starts the second process, for good


class _Beside(event.Listener):  # type: ignore[misc]  # numba has no types
    """Starts the second process when numba has found an entry not kept, and is about to compile it."""

    def __init__(self, entry: Any) -> None:
        self._entry = entry
        self.process: subprocess.Popen[bytes] | None = None

    def on_start(self, told: Any) -> None:
        """See numba's `Listener`."""
        if self.process is None and told.data["dispatcher"] is self._entry:
            self.process = start()

    def on_end(self, told: Any) -> None:
        """See numba's `Listener`."""


def start() -> subprocess.Popen[bytes] | None:
    """Start the second process, once; None where it would be of no use, or cannot be."""
    is_python = bool(sys.executable) and not getattr(sys, "frozen", False)
    if not is_python or MARK in os.environ or (os.cpu_count() or 1) < 2 or not _ONCE.acquire(blocking=False):
        return None
    nowhere = subprocess.DEVNULL
    found_as_here = os.pathsep.join(place for place in sys.path if isinstance(place, str))
    try:
        return subprocess.Popen(
            [sys.executable, *COMMAND],
            stdin=nowhere,
            stdout=nowhere,
            stderr=nowhere,
            env={**os.environ, "PYTHONPATH": found_as_here, MARK: "1"},
        )
    except (OSError, ValueError):
        return None


@contextmanager
def compiled_beside(entry: Any) -> Iterator[None]:
    """Let a second process compile `follow_particles` while the caller compiles, if it does.

    Args:
        entry: the dispatcher with whose compilation it begins.
    """
    beside = _Beside(entry)
    with event.install_listener("numba:compile", beside):
        try:
            yield
            if beside.process is not None:
                beside.process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            pass
        finally:
            if beside.process is not None and beside.process.poll() is None:
                beside.process.kill()
                beside.process.wait()
