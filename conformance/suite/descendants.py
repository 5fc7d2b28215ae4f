"""What a command started and left behind: found by descent and by its process group, and killed.

On Linux this process reaps, while a command runs, what descends from it (`PR_SET_CHILD_SUBREAPER`):
a process whose parents are gone becomes a child of this one, not of init, however it was forked, whatever
session it opened and whatever it cleared from its environment. So the descendants of a command are those
below its leader, and those children of this process that are in another session than this process (the
leader's, or one that they opened: nobody can enter an existing one) and were not there before.
On other systems only its process group is known.

Not handled: processes of another user (set-user-ID programs), and a family that forks and dies faster than
it can be listed, which is given up after some seconds. While several commands run at once, orphans
cannot be told apart and are left until the last of them ends. A child that other code of this process starts
meanwhile in a session of its own would be taken for one of the command's.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import ClassVar, NamedTuple

KILL_TIMEOUT = 5.0  # seconds until what cannot be killed is given up
POLL_INTERVAL = 0.01  # seconds between looks
SUBREAPER = 36  # PR_SET_CHILD_SUBREAPER of <linux/prctl.h>


class _Entry(NamedTuple):
    """A line of the process table; `born` tells a process from a later one of the same number."""

    pid: int
    state: str
    parent: int
    session: int
    born: int


class Descendants:
    """The processes that descend from one command."""

    _leaders: ClassVar[set[int]] = set()
    _before: ClassVar[set[tuple[int, int]]] = set()  # children of this process older than all commands

    def __init__(self) -> None:
        self._leader = 0
        if not self._leaders:
            mine = os.getpid()
            self._before.clear()
            self._before.update((entry.pid, entry.born) for entry in _table() if entry.parent == mine)
        _adopt_orphans(True)

    def follow(self, leader: int) -> None:
        """Name the process that leads them; 0 for one that could not be started."""
        self._leader = leader
        if leader:
            self._leaders.add(leader)
        else:
            _adopt_orphans(bool(self._leaders))

    def alive(self) -> list[int]:
        """List the live ones, the leader left out; those that are dead are reaped."""
        table = {entry.pid: entry for entry in _table()}
        found = set(self._adopted(table.values())) | {self._leader}
        while more := {pid for pid, entry in table.items() if entry.parent in found} - found:
            found |= more
        return sorted(pid for pid in found - {self._leader} if table[pid].state != "Z")

    def kill(self) -> None:
        """Kill the leader's group and all descendants; the leader is not reaped."""
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self._leader, signal.SIGKILL)
        deadline = time.monotonic() + KILL_TIMEOUT
        while (alive := self.alive()) and time.monotonic() < deadline:
            for pid in alive:
                with contextlib.suppress(ProcessLookupError, PermissionError):
                    os.kill(pid, signal.SIGKILL)
            time.sleep(POLL_INTERVAL)
        self._leaders.discard(self._leader)
        _adopt_orphans(bool(self._leaders))

    def _adopted(self, table: Iterable[_Entry]) -> Iterator[int]:
        # Orphans that became children of this process, when they can only be this command's.
        if self._leaders != {self._leader}:
            return
        mine, session = os.getpid(), os.getsid(0)
        for entry in table:
            is_known = entry.pid == self._leader or (entry.pid, entry.born) in self._before
            if entry.parent != mine or entry.session == session or is_known:
                continue
            if entry.state == "Z":
                with contextlib.suppress(ChildProcessError):
                    os.waitpid(entry.pid, os.WNOHANG)
            else:
                yield entry.pid


def _adopt_orphans(is_wanted: bool) -> None:
    with contextlib.suppress(OSError, AttributeError):  # another system has no prctl
        ctypes.CDLL(None).prctl(SUBREAPER, int(is_wanted), 0, 0, 0)


def _table() -> Iterator[_Entry]:
    for place in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            # The name, in parentheses, may itself hold spaces and parentheses.
            fields = place.read_text("utf-8", "replace").rpartition(")")[2].split()
            yield _Entry(int(place.parent.name), fields[0], int(fields[1]), int(fields[3]), int(fields[19]))
