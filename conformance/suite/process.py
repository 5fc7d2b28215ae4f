"""One implementation as a subprocess: a line in, a line out, and no way to hang or outlive its session.

Everything happens in one thread, without blocking: writing, reading both of its outputs, and looking at
the clock and at the process. It leads its own session; what it forked is found and killed with it
(`conformance.suite.descendants` says how, and what is left on systems other than Linux). Text that came from
it is shown only as `clean` returns it: no control character of its choice reaches a terminal or a report.
Needs a POSIX system; nothing is known here of what the lines mean.
"""

from __future__ import annotations

import contextlib
import errno
import os
import selectors
import signal
import subprocess
import time
from collections.abc import Callable, Sequence
from typing import IO

from conformance.suite.descendants import Descendants
from scene.refusal import BadInput

MAX_LINE = 2**24  # bytes of one answer: a trajectory of 10^5 collisions
MAX_STDERR = 2**15  # bytes kept of the first and of the last that it wrote there
GRACE = 1.0  # seconds between the end of its output and its exit, and between its exit and its helpers'
POLL = 0.05  # seconds between looks at a silent process: a child of it may hold the pipe when it is gone
# What calculating with numbers of a nonsense answer may raise, however a formula is written.
NOT_NUMBERS = (ArithmeticError, ValueError)
MAX_TEXT = 500  # characters kept of a reason, a name, or another text that came from it


class Trouble(Exception):  # noqa: N818 (the implementation's trouble, not this program's)
    """No usable answer: the verdict it gets (crashed, timed-out, wrong-format, error) and why."""

    def __init__(self, verdict: str, why: str) -> None:
        self.verdict, self.why = verdict, clean(why)
        super().__init__(f"{verdict}: {self.why}")


class CommandNotFound(BadInput):
    """The command cannot be started: one line naming it and the reason."""


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
        CommandNotFound: when the program cannot be started.
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
            raise CommandNotFound(f"command {command[0]!r} cannot be started: {reason}") from None
        self._descendants.follow(self._child.pid)
        self._stdin, self._stdout, self._stderr = self._streams()
        self._transcript = stderr
        self._received = bytearray()
        self._is_open = True  # its standard output

    def _streams(self) -> tuple[IO[bytes], IO[bytes], IO[bytes]]:
        streams = self._child.stdin, self._child.stdout, self._child.stderr
        for stream in streams:
            assert stream is not None
            os.set_blocking(stream.fileno(), False)
        return streams  # type: ignore[return-value]

    def exchange(self, line: bytes, timeout: float) -> bytes:
        """Write one line and return the one line that answers it.

        Args:
            line: without its newline.
            timeout: seconds until the answer must be complete.

        Raises:
            Trouble: crashed, timed-out, or wrong-format for more or other output than one line.
        """
        deadline = time.monotonic() + timeout
        self._advance(b"", 0.0)
        self._check_silence()
        pending = line + b"\n"
        while b"\n" not in self._received:
            if len(self._received) > MAX_LINE:
                raise Trouble("wrong-format", f"its line is longer than {MAX_LINE} bytes")
            left = deadline - time.monotonic()
            if left <= 0:
                begun = f", after {shown(self._received)}" if self._received else ""
                hint = "is each line flushed? --timeout and --total allow more"
                raise Trouble("timed-out", f"no answer within {timeout:g} s{begun}; {hint}")
            if not self._is_open or (self._has_exited() and not self._is_readable()):
                raise Trouble("crashed", self._ending())
            pending = self._advance(pending, min(left, POLL))
        answer, _, rest = bytes(self._received).partition(b"\n")
        self._received.clear()
        if rest:
            raise Trouble("wrong-format", f"wrote more than one line: {shown(answer)} and {shown(rest)}")
        return answer

    def finish(self, line: bytes, timeout: float) -> None:
        """Write a last line and see the process end by itself, silently.

        Raises:
            Trouble: wrong-format for further output, timed-out, crashed, or fail for what it leaves behind.
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
            raise Trouble("timed-out", f"still running {timeout:g} s after `stop`")
        if status := self._status():
            raise Trouble("crashed", f"{status} after `stop`")
        # A helper that ends because the process has ended does so a little later.
        if not _comes_true(lambda: not self._descendants.alive()):
            raise Trouble("fail", "left a child process running after `stop`")
        self._advance(b"", 0.0)
        self._check_silence()  # of the helpers

    def kill(self) -> None:
        """End the process, its group and whatever else it started; safe to call twice."""
        if self._child.returncode is None:
            self._descendants.kill()
            self._child.wait()
        for stream in (self._stdin, self._stdout, self._stderr):
            with contextlib.suppress(OSError):
                stream.close()

    def _check_silence(self) -> None:
        if self._received:
            raise Trouble("wrong-format", f"wrote without being asked: {shown(self._received)}")

    def _advance(self, pending: bytes, timeout: float) -> bytes:
        # One look at all pipes; returns what is still to be written.
        with selectors.DefaultSelector() as selector:
            if self._is_open:
                selector.register(self._stdout, selectors.EVENT_READ)
            if not self._stderr.closed:
                selector.register(self._stderr, selectors.EVENT_READ)
            if pending:
                selector.register(self._stdin, selectors.EVENT_WRITE)
            for key, _ in selector.select(timeout):
                if key.fileobj is self._stdin:
                    pending = self._write(pending)
                elif key.fileobj is self._stdout:
                    data = self._stdout.read(2**20)
                    self._received += data or b""
                    self._is_open = data != b""
                elif data := self._stderr.read(2**20):
                    self._transcript.add(data)
                else:
                    self._stderr.close()
        return pending

    def _write(self, pending: bytes) -> bytes:
        try:
            return pending[self._stdin.write(pending) or 0 :]
        except OSError as error:
            if error.errno not in (errno.EPIPE, errno.ECONNRESET):
                raise
            return b""  # it no longer reads: its silence or its exit will tell

    def _is_readable(self) -> bool:
        with selectors.DefaultSelector() as selector:
            selector.register(self._stdout, selectors.EVENT_READ)
            return bool(selector.select(0.0))

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
        if not _comes_true(self._has_exited):
            return "closed its standard output"
        return (self._status() or "exited with status 0") + " before it answered"


def _comes_true(condition: Callable[[], bool]) -> bool:
    """Wait a little for something to be so, and tell whether it is."""
    deadline = time.monotonic() + GRACE
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


def shown(data: bytes | bytearray, n: int = 60, at: int = 0) -> str:
    """Return n bytes of what was received, the beginning or those around a place, readable on one line."""
    begin = max(0, at - n // 2)
    text = bytes(data[begin : begin + n]).decode("utf-8", "backslashreplace")
    return "..." * (begin > 0) + repr(text) + "..." * (len(data) > begin + n)
