"""Compiling in several processes at once: numba compiles one function after another, but keeps them on disk.

A run needs the careful step, five loops, and `follow_particles`, which calls those by their addresses and
takes longest to compile. When the first of them is about to be compiled, other processes begin with what is
their share; this one will find it kept. Whatever goes wrong there, it is compiled here as if nobody had
tried.
"""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from time import monotonic
from typing import Any

from numba.core import event

COMMAND = ("-P", "-m", "fast.first_run")  # -P: not what lies in the folder that a user happens to be in
MARK = "OSCILLATING_MUSHROOMS_BESIDE"  # in the others' environment: they start none
PATIENCE = 60.0  # seconds beyond our own, after which we go on alone
# Who compiles what, the caller first. Two are done at about the same time, as measured; that three are done
# sooner still is reckoned from how long each part takes alone.
BY_CORES = {
    1: [["careful"]],
    2: [["careful", "fly", "chord", "rebound"], ["follow", "bounce", "aim"]],
    3: [["careful"], ["follow"], ["fly", "aim", "chord", "bounce", "rebound"]],
}
_ONCE = threading.Lock()  # taken by the thread that starts the others, for good


def shares() -> list[list[str]]:
    """Return who compiles what on this machine."""
    # As many cores as this process may use, where the system can tell.
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return BY_CORES[min(cores, max(BY_CORES))]


def own_share() -> list[str]:
    """Return what the caller compiles."""
    return shares()[0]


class _Beside(event.Listener):  # type: ignore[misc]  # numba has no types
    """Starts the others when numba has found one of some entries not kept, and is about to compile it."""

    def __init__(self, entries: Iterable[Any], arguments: tuple[str, ...]) -> None:
        self._entries, self._arguments = list(entries), arguments
        self.processes: list[subprocess.Popen[bytes]] = []

    def on_start(self, told: Any) -> None:
        """See numba's `Listener`."""
        if not self.processes and told.data["dispatcher"] in self._entries:
            start(self.processes, *self._arguments)

    def on_end(self, told: Any) -> None:
        """See numba's `Listener`."""


def start(started: list[subprocess.Popen[bytes]], *arguments: str) -> None:
    """Start the other processes, once; none where they would be of no use, or cannot be.

    Args:
        started: each is appended at once, so that whoever interrupts this can end them.
        arguments: which loops are meant by their names; see fast.first_run.
    """
    is_python = bool(sys.executable) and not getattr(sys, "frozen", False)
    others = shares()[1:]
    if not is_python or MARK in os.environ or not others or not _ONCE.acquire(blocking=False):
        return
    nowhere = subprocess.DEVNULL
    found_as_here = os.pathsep.join(place for place in sys.path if isinstance(place, str))
    for what in others:
        with suppress(OSError, ValueError):
            started.append(
                subprocess.Popen(
                    [sys.executable, *COMMAND, *arguments, *what],
                    stdin=nowhere,
                    stdout=nowhere,
                    stderr=nowhere,
                    env={**os.environ, "PYTHONPATH": found_as_here, MARK: "1"},
                )
            )


@contextmanager
def compiled_beside(entries: Iterable[Any], *arguments: str) -> Iterator[None]:
    """Let other processes compile while the caller does, if it does; wait for them.

    Args:
        entries: the dispatchers with the first of whose compilations they begin.
        arguments: what they are told.
    """
    beside = _Beside(entries, arguments)
    with event.install_listener("numba:compile", beside):
        try:
            yield
            last = monotonic() + PATIENCE
            for process in beside.processes:
                process.wait(max(0.0, last - monotonic()))
        except subprocess.TimeoutExpired:
            pass
        finally:
            for process in beside.processes:
                if process.poll() is None:
                    process.kill()
                    process.wait()
