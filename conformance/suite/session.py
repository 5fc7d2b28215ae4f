"""A session of protocol 1 with one implementation: asks, decodes strictly, restarts after a failure.

What is no answer becomes a verdict (`CheckFailure`): crashed, timed-out, wrong-format; `error` when the
restarts are used up and nothing was asked. Then the process is killed and the next question goes to
a fresh one, to which `start` is replayed. When the time for the whole session is spent, all that is
still asked is `timed-out`. Sequence numbers are random, so that no answer can be given before its question.
How an answer is read is in `conformance.suite.answers`; whether it is right is not judged here.
"""

import math
import random
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from functools import partial
from types import TracebackType
from typing import Any, TypeVar

import msgspec

from conformance.suite.answers import check_echo, read_answer, read_introduction, with_walls
from conformance.suite.process import CheckFailure, Process, Transcript
from scene.protocol.messages import PROTOCOL, Introduction
from scene.refusal import BadInput

AnswerLine = Callable[[bytes], bytes]
T = TypeVar("T")
MAX_SEQ = 2**31 - 1  # the integers of every language


class Limits(msgspec.Struct, frozen=True):
    """What a session puts up with.

    Attributes:
        timeout: seconds for one answer, start-up and just-in-time compilation included; also for the end
            after `stop`.
        restarts: fresh processes after the first.
        total: seconds for the whole session, restarts included; None for as long as it takes.
    """

    timeout: float = 120.0
    restarts: int = 10
    total: float | None = None


class InProcess:
    """A function from lines to lines in place of a process: it has no end, and no time is kept."""

    def __init__(self, answer: AnswerLine) -> None:
        self._answer = answer

    def exchange(self, line: bytes, _: float) -> bytes:
        """Answer one line."""
        return self._answer(line)

    def finish(self, _line: bytes, _timeout: float) -> None:
        """End."""

    def kill(self) -> None:
        """End."""


class Session(AbstractContextManager["Session"]):
    """A conversation with a command; a context manager that leaves no process behind.

    Args:
        command: program and arguments; or a function that answers lines, in place of a process.
        limits: time and restarts.

    Attributes:
        introduction: what the implementation said of itself, once opened.
        n_restarts: fresh processes that were needed so far.
        sent: the last line that was sent, whatever it asked.
        stderr: what it wrote to standard error, bounded.
        command: as results name it.
        limits: time and restarts.
        cannot_show: what no session of this kind can grade.
    """

    cannot_show: tuple[str, ...] = ()

    def __init__(self, command: Sequence[str] | AnswerLine, limits: Limits | None = None) -> None:
        if not command:
            raise BadInput("COMMAND is missing: give it after `--`")
        self._command, self.limits = command, limits or Limits()
        self.command = ["(in process)"] if callable(command) else list(command)
        self._process: Process | InProcess | None = None
        self._end: CheckFailure | None = None
        self._draw = random.Random()
        total = self.limits.total
        self._deadline = math.inf if total is None else time.monotonic() + total
        self.introduction: Introduction | None = None
        self.n_restarts, self.sent = 0, b""
        self.stderr = Transcript()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.kill()

    def start(self) -> Introduction:
        """Start the process and exchange introductions.

        Raises:
            CommandNotFound: when there is no such program.
            CheckFailure: when it does not introduce itself in protocol 1; the session is then over.
        """
        self._process = (
            InProcess(self._command) if callable(self._command) else Process(self._command, self.stderr)
        )
        request = {"cmd": "start", "protocol": PROTOCOL}
        self.introduction = introduction = self._opened(request, read_introduction)
        return introduction

    def probe(self) -> None:
        """Prove that numbers arrive and return with all their bits.

        Raises:
            CheckFailure: wrong-format, naming the first number that does not; the session is then over.
        """
        values = probe_values()
        self._opened({"cmd": "echo", "values": values}, partial(check_echo, values))

    def ask(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """Put one question and return its answer as plain data, every collision with its wall.

        Args:
            request: a step, trajectory, flow or time request; its seq is replaced by a random one.

        Raises:
            CheckFailure: crashed, timed-out or wrong-format; error or timed-out when the session is over.
        """
        seq = self._draw.randint(1, MAX_SEQ)
        line = msgspec.json.encode({**request, "seq": seq})
        answer = self.say(line, seq, request["cmd"], may_be_null=False)
        return with_walls(answer, request.get("scene"))

    def say(
        self, line: bytes, seq: int | None, cmd: str = "step", *, may_be_null: bool = True
    ) -> dict[str, Any]:
        """Send a line that may be no request, and return what it is answered.

        Args:
            line: without its newline.
            seq: that can be read in it; the answer has this one or null.
            cmd: whose answer may come where it is one after all.
            may_be_null: whether null will do for the seq.

        Raises:
            CheckFailure: as `ask`.
        """
        if self._end is not None:
            raise self._end
        self._check_time()
        if self._process is None:
            self._restart()
        try:
            return read_answer(self._exchange(line), cmd, seq, may_be_null=may_be_null)
        except CheckFailure:
            self.kill()
            raise

    def stop(self) -> None:
        """Ask the process to stop and see it end by itself.

        Raises:
            CheckFailure: when it does not, goes on talking, or leaves a child; it is killed all the same.
        """
        process, self._process = self._process, None
        if process is None:
            self._check_time()
            raise self._end or CheckFailure("error", "not asked: no process was left")
        try:
            process.finish(msgspec.json.encode({"cmd": "stop"}), self.limits.timeout)
        finally:
            process.kill()

    def kill(self) -> None:
        """End the process at once, if there is one."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()

    def _opened(self, request: Mapping[str, Any], read: Callable[[bytes], T]) -> T:
        """Read the answer to a request without which the session is over."""
        try:
            return read(self._exchange(msgspec.json.encode(request)))
        except CheckFailure as failure:
            raise self._given_up(failure) from None

    def _check_time(self) -> None:
        if self._end is None and time.monotonic() >= self._deadline:
            why = f"not asked: the total time of {self.limits.total:g} s is spent"
            raise self._given_up(CheckFailure("timed-out", why))

    def _exchange(self, line: bytes) -> bytes:
        assert self._process is not None
        self.sent = line
        left = max(0.0, self._deadline - time.monotonic())
        return self._process.exchange(line, min(self.limits.timeout, left))

    def _restart(self) -> None:
        if self.n_restarts >= self.limits.restarts:
            why = f"not asked: restarted {self.n_restarts} times; --restarts allows more"
            raise self._given_up(CheckFailure("error", why))
        self.n_restarts += 1
        try:
            self.start()
        except (CheckFailure, BadInput) as failure:
            why = f"not asked: the restart failed, {failure}"
            raise self._given_up(CheckFailure("error", why)) from None

    def _given_up(self, failure: CheckFailure) -> CheckFailure:
        """End the session, and return what is the verdict of all that is still asked."""
        self.kill()
        self._end = failure
        return failure


def missing(introduction: Introduction, profile: str, scene: Mapping[str, Any] | None) -> str:
    """Say what a question needs that an implementation does not list; empty when it lists all.

    Args:
        introduction: what it said of itself.
        profile: step, trajectory, flow or time.
        scene: as for `needs`.
    """
    offered = {"profile": introduction.profiles, "table": introduction.tables, "law": introduction.laws}
    return ", ".join(f"{what} {name}" for what, name in needs(profile, scene) if name not in offered[what])


def needs(profile: str, scene: Mapping[str, Any] | None) -> list[tuple[str, str]]:
    """Return what a question needs: its profile, its table and the kinds of its laws.

    Args:
        profile: step, trajectory, flow or time.
        scene: of the question, in the wire's form; None for one that must be refused, so that no
            table and no law is needed.
    """
    if scene is None:
        return [("profile", profile)]
    parts = {name: part for name, part in scene.items() if name not in ("table", "name", "notes")}
    kinds = {law["kind"] if isinstance(law, Mapping) else "constant" for law in parts.values()}
    return [("profile", profile), ("table", str(scene["table"])), *(("law", kind) for kind in sorted(kinds))]


def probe_values() -> list[float]:
    """Return the numbers of the transport probe: every kind, and random bits of every exponent."""
    least, tiny, largest = 5e-324, sys.float_info.min, sys.float_info.max
    special = [0.0, 0.1, 1 / 3, 2 / 3, 1e22, 1e23, 2.0**53 - 1, 2.0**53 + 2, 123456789012345680.0, largest]
    small = [least, 3 * least, tiny, tiny - least, tiny / 3, 1.0 + 2.0**-52, 1.0 - 2.0**-53]
    draw = random.Random(53)
    scattered = [math.ldexp(1 + draw.random(), exponent) for exponent in range(-1074, 1024, 8)]
    return [sign * value for value in (*special, *small, *scattered) for sign in (1.0, -1.0)]
