"""One implementation as a subprocess: a line in, a line out, and no way to hang or outlive its session.

Everything happens in one thread, without blocking: writing, reading both of its outputs, and looking at
the clock and at the process. Text that came from it is shown only as `clean` returns it: no control
character of its choice reaches a terminal or a report. Needs a POSIX system; nothing is known here of what
the lines mean.

A process leads its own session. What it forked is found, by descent and by its process group, and killed.
On Linux this process reaps, while a command runs, what descends from it (`PR_SET_CHILD_SUBREAPER`):
a process whose parents are gone becomes a child of this one, not of init, however it was forked, whatever
session it opened and whatever it cleared from its environment. So the descendants of a command are those
below its leader, and those children of this process that are in another session than this process (the
leader's, or one that they opened: nobody can enter an existing one) and were not there before.
On other systems its process group is known, and those below its leader whose parents live.

Not handled: processes of another user (set-user-ID programs), and a family that forks and dies faster than
it can be listed, which is given up after some seconds. While several commands run at once, orphans
cannot be told apart and are left until the last of them ends. A child that other code of this process starts
meanwhile in a session of its own would be taken for one of the command's.
"""

import contextlib
import ctypes
import os
import selectors
import signal
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from typing import ClassVar

import psutil

from scene.refusal import BadInput

KILL_TIMEOUT = 5.0  # seconds until what cannot be killed is given up
SUBREAPER = 36  # PR_SET_CHILD_SUBREAPER of <linux/prctl.h>


class Descendants:
    """The processes that descend from one command."""

    _leaders: ClassVar[set[int]] = set()
    _before: ClassVar[set[psutil.Process]] = set()  # children of this process older than all commands

    def __init__(self) -> None:
        self._leader = 0
        if not self._leaders:
            Descendants._before = set(psutil.Process().children())
        _adopt_orphans(True)

    def follow(self, leader: int) -> None:
        """Name the process that leads them; 0 for one that could not be started."""
        self._leader = leader
        if leader:
            self._leaders.add(leader)
        else:
            _adopt_orphans(bool(self._leaders))

    def alive(self) -> list[psutil.Process]:
        """List the live ones, the leader left out; those that are dead are reaped."""
        parents: dict[psutil.Process, int] = {}
        for process in psutil.Process().children(recursive=True):
            with contextlib.suppress(psutil.Error):
                parents[process] = process.ppid()
        found = set(self._adopted(parents)) | {self._leader}
        while more := {process.pid for process, parent in parents.items() if parent in found} - found:
            found |= more
        return [process for process in parents if process.pid in found - {self._leader} and _is_live(process)]

    def kill(self) -> None:
        """Kill the leader's group and all descendants; the leader is not reaped."""
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self._leader, signal.SIGKILL)
        deadline = time.monotonic() + KILL_TIMEOUT
        while (alive := self.alive()) and time.monotonic() < deadline:
            for process in alive:
                with contextlib.suppress(psutil.Error):
                    process.kill()
            time.sleep(POLL / 5)
        self._leaders.discard(self._leader)
        _adopt_orphans(bool(self._leaders))

    def _adopted(self, parents: dict[psutil.Process, int]) -> Iterator[int]:
        # Orphans that became children of this process, when they can only be this command's.
        if self._leaders != {self._leader}:
            return
        mine = os.getpid()
        session = os.getsid(0)
        for process, parent in parents.items():
            if parent != mine or process.pid == self._leader or process in self._before:
                continue
            with contextlib.suppress(OSError):  # it has ended
                if os.getsid(process.pid) == session:
                    continue
                if _is_live(process):
                    yield process.pid
                else:
                    os.waitpid(process.pid, os.WNOHANG)


def _is_live(process: psutil.Process) -> bool:
    try:
        return bool(process.status() != psutil.STATUS_ZOMBIE)
    except psutil.Error:  # it has ended, and is another's to reap
        return False


def _adopt_orphans(is_wanted: bool) -> None:
    with contextlib.suppress(OSError, AttributeError):  # another system has no prctl
        ctypes.CDLL(None).prctl(SUBREAPER, int(is_wanted), 0, 0, 0)


MAX_LINE = 2**24  # bytes of one answer: a trajectory of 10^5 collisions
MAX_STDERR = 2**15  # bytes kept of the first and of the last that it wrote there
GRACE = 1.0  # seconds between the end of its output and its exit; decides a message only
POLL = 0.05  # seconds between looks at a silent process: a child of it may hold the pipe when it is gone
# What calculating with numbers of a nonsense answer may raise, however a formula is written.
NOT_NUMBERS = (ArithmeticError, ValueError)
MAX_TEXT = 500  # characters kept of a reason, a name, or another text that came from it


class CheckFailure(Exception):  # noqa: N818 (a finding about the stepper)
    """No usable answer: the verdict it gets (crashed, timed-out, wrong-format, error) and why."""

    def __init__(self, verdict: str, why: str) -> None:
        self.verdict, self.why = verdict, clean(why)
        super().__init__(verdict, self.why)  # what a copy is made of

    def __str__(self) -> str:
        """Return verdict and reason."""
        return f"{self.verdict}: {self.why}"


class Transcript:
    """The first and the last part of a stream, bounded."""

    def __init__(self) -> None:
        self.kept, self.n_dropped = bytearray(), 0

    def add(self, data: bytes) -> None:
        """Append, dropping from the middle."""
        self.kept += data
        excess = max(0, len(self.kept) - 2 * MAX_STDERR)
        self.n_dropped += excess
        del self.kept[MAX_STDERR : MAX_STDERR + excess]

    def text(self) -> str:
        """Return what was kept, with a note of what was not; lines and tabs stay as they are."""
        gap = f"\n[... {self.n_dropped} bytes left out ...]\n".encode() if self.n_dropped else b""
        text = self.kept[:MAX_STDERR] + gap + self.kept[MAX_STDERR:]
        return escaped(text.decode("utf-8", "replace"), kept="\n\t")


class Process:
    """A running implementation.

    Args:
        command: program and arguments.
        stderr: where its standard error is kept.

    Raises:
        BadInput: when the program cannot be started.
    """

    def __init__(self, command: Sequence[str], stderr: Transcript) -> None:
        self._descendants = Descendants()
        try:
            self._child = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                start_new_session=True,
                bufsize=0,
            )
        except (OSError, ValueError) as error:
            self._descendants.follow(0)
            reason = error.strerror if isinstance(error, OSError) else str(error)
            raise BadInput(f"command {command[0]!r} cannot be started: {reason}") from None
        self._descendants.follow(self._child.pid)
        stdin, stdout, stderr_pipe = self._child.stdin, self._child.stdout, self._child.stderr
        assert stdin is not None and stdout is not None and stderr_pipe is not None  # noqa: PT018
        self._stdin, self._stdout, self._stderr = stdin, stdout, stderr_pipe
        for stream in (stdin, stdout, stderr_pipe):
            os.set_blocking(stream.fileno(), False)
        self._selector = selectors.DefaultSelector()
        for stream in (stdout, stderr_pipe):
            self._selector.register(stream, selectors.EVENT_READ)
        self._transcript = stderr
        self._received = bytearray()
        self._is_open = True  # its standard output

    def exchange(self, line: bytes, timeout: float) -> bytes:
        """Write one line and return the one line that answers it.

        Args:
            line: without its newline.
            timeout: seconds until the answer must be complete.

        Raises:
            CheckFailure: crashed, timed-out, or wrong-format for more or other output than one line.
        """
        deadline = time.monotonic() + timeout
        self._advance(b"", 0.0)
        self._check_silence()
        pending = line + b"\n"
        while b"\n" not in self._received:
            if len(self._received) > MAX_LINE:
                raise CheckFailure("wrong-format", f"its line is longer than {MAX_LINE} bytes")
            left = deadline - time.monotonic()
            if left <= 0:
                begun = f", after {excerpt(self._received)}" if self._received else ""
                hint = "is each line flushed? --timeout and --total allow more"
                raise CheckFailure("timed-out", f"no answer within {timeout:g} s{begun}; {hint}")
            if not self._is_open or (self._has_exited() and not self._is_readable()):
                raise CheckFailure("crashed", self._ending())
            pending = self._advance(pending, min(left, POLL))
        answer, _, rest = bytes(self._received).partition(b"\n")
        self._received.clear()
        if rest:
            raise CheckFailure(
                "wrong-format", f"wrote more than one line: {excerpt(answer)} and {excerpt(rest)}"
            )
        return answer

    def finish(self, line: bytes, timeout: float) -> None:
        """Write a last line and see the process and its children end by themselves, silently.

        Raises:
            CheckFailure: wrong-format for further output, timed-out, crashed; fail for a process left behind.
        """
        deadline = time.monotonic() + timeout
        pending = line + b"\n"
        while not self._received and time.monotonic() < deadline:
            if self._has_exited() and not (self._is_open and self._is_readable()):
                break
            # Until the end: what it has to say on standard error may be more than a pipe holds.
            pending = self._advance(pending, POLL)
            if not pending and not self._stdin.closed:
                self._stdin.close()
        self._check_silence()
        if not self._has_exited():
            raise CheckFailure("timed-out", f"still running {timeout:g} s after `stop`")
        if status := self._status():
            raise CheckFailure("crashed", f"{status} after `stop`")
        # A helper that ends because the process has ended does so a little later.
        if not _comes_true(lambda: not self._descendants.alive(), deadline):
            raise CheckFailure("fail", "left a child process running after `stop`")
        self._advance(b"", 0.0)
        self._check_silence()  # of the helpers

    def kill(self) -> None:
        """End the process, its group and whatever else it started; safe to call twice."""
        if self._child.returncode is None:
            self._descendants.kill()
            self._child.wait()
        self._selector.close()
        for stream in (self._stdin, self._stdout, self._stderr):
            stream.close()

    def _check_silence(self) -> None:
        if self._received:
            raise CheckFailure("wrong-format", f"wrote without being asked: {excerpt(self._received)}")

    def _advance(self, pending: bytes, timeout: float) -> bytes:
        # Write what a pipe takes, and look at all pipes once; returns what is still to be written.
        try:
            pending = pending[self._stdin.write(pending) or 0 :] if pending else b""
        except (BrokenPipeError, ConnectionResetError):
            pending = b""  # it no longer reads: its silence or its exit will tell
        if pending:
            self._selector.register(self._stdin, selectors.EVENT_WRITE)
        for key, _ in self._selector.select(timeout):
            if key.fileobj is self._stdin:
                continue
            data = key.fileobj.read(2**20)  # type: ignore[union-attr]
            if data == b"":
                self._selector.unregister(key.fileobj)
            if key.fileobj is self._stdout:
                self._received += data or b""
                self._is_open = data != b""
            elif data:
                self._transcript.add(data)
        if pending:
            self._selector.unregister(self._stdin)
        return pending

    def _is_readable(self) -> bool:
        return any(key.fileobj is self._stdout for key, _ in self._selector.select(0.0))

    def _has_exited(self) -> bool:
        # Without reaping it: its number must stay taken until its group is killed.
        options = os.WEXITED | os.WNOHANG | os.WNOWAIT
        return self._child.returncode is not None or os.waitid(os.P_PID, self._child.pid, options) is not None

    def _status(self) -> str:
        """Say how it exited; empty for a clean exit."""
        result = os.waitid(os.P_PID, self._child.pid, os.WEXITED | os.WNOHANG | os.WNOWAIT)
        if result is None or result.si_status == 0:
            return ""
        if result.si_code == os.CLD_EXITED:
            return f"exited with status {result.si_status}"
        try:
            return f"was killed by {signal.Signals(result.si_status).name}"
        except ValueError:  # real-time signals have numbers only
            return f"was killed by signal {result.si_status}"

    def _ending(self) -> str:
        if not _comes_true(self._has_exited, time.monotonic() + GRACE):
            return "closed its standard output"
        return (self._status() or "exited with status 0") + " before it answered"


def _comes_true(condition: Callable[[], bool], deadline: float) -> bool:
    """Wait for something to be so until the deadline, and tell whether it is."""
    while not (is_so := condition()) and time.monotonic() < deadline:
        time.sleep(POLL / 5)
    return is_so


def clean(text: str) -> str:
    """Return text that came from an implementation as one line, bounded, without control characters."""
    line = escaped(" ".join(text[: 2 * MAX_TEXT].split()))
    return line if len(line) <= MAX_TEXT else line[: MAX_TEXT - 3] + "..."


def escaped(text: str, kept: str = "") -> str:
    """Write what does not print (controls, marks of direction, lone surrogates) as Python escapes it."""
    if text.isprintable():
        return text
    return "".join(
        c if c.isprintable() or c in kept else c.encode("unicode_escape").decode("ascii") for c in text
    )


def excerpt(data: bytes | bytearray, n: int = 60, at: int = 0) -> str:
    """Return n bytes of what was received, the beginning or those around a place, readable on one line."""
    begin = max(0, at - n // 2)
    text = bytes(data[begin : begin + n]).decode("utf-8", "backslashreplace")
    return "..." * (begin > 0) + repr(text) + "..." * (len(data) > begin + n)
