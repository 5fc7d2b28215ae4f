"""A session of protocol 1 with one implementation: asks, decodes strictly, restarts after a failure.

What is no answer becomes a verdict (`CheckFailure`): crashed, timed-out, wrong-format; `error` when the
restarts are used up and nothing was asked. Then the process is killed and the next question goes to
a fresh one, to which `start` is replayed. When the time for the whole session is spent, all that is
still asked is `timed-out`. Sequence numbers are random, so that no answer can be given before its question.

Answers are decoded strictly, but for manners that mean the same. A further field is ignored; a whole number
is one however it is written, 17.0 too; -0 is minus zero; a wall that an answer leaves out is named from the
place; texts lose their control characters. All else that the protocol does not name is `wrong-format`, with
the field. Whether an answer is right is not judged here.
"""

import json
import math
import random
import re
import struct
import sys
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from functools import partial
from types import TracebackType
from typing import Any, TypeVar

import msgspec
from mpmath import fp

from conformance.suite.process import CheckFailure, Process, Transcript, clean, excerpt
from scene import BadInput, Collision, Outcome, from_data
from scene.geometry import table_at
from scene.protocol.messages import (
    PROTOCOL,
    Answered,
    AnsweredCollision,
    Echoed,
    Failed,
    Flown,
    Introduction,
    Steps,
    Timed,
    with_minus_zeros,
)
from scene.protocol.rules import without_loose

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
        seconds: that the last answer took to come; 0 of a function, of which no time is kept.
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
        self.n_restarts, self.sent, self.seconds = 0, b"", 0.0
        self.stderr = Transcript()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.kill()

    def start(self) -> Introduction:
        """Start the process and exchange introductions.

        Raises:
            BadInput: when there is no such program.
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
        begin = time.monotonic()
        left = max(0.0, self._deadline - begin)
        answer = self._process.exchange(line, min(self.limits.timeout, left))
        self.seconds = time.monotonic() - begin if isinstance(self._process, Process) else 0.0
        return answer

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


def missing(introduction: Introduction | None, profile: str, scene: Mapping[str, Any] | None) -> str:
    """Say what a question needs that an implementation does not list; empty when it lists all.

    Args:
        introduction: what it said of itself, once opened.
        profile: step, trajectory, flow or time.
        scene: as for `needs`.
    """
    lacking = [
        (part, name) for part, name in needs(profile, scene) if name not in getattr(introduction, part)
    ]
    return ", ".join(f"{part.removesuffix('s')} {name}" for part, name in lacking)


def needs(profile: str, scene: Mapping[str, Any] | None) -> list[tuple[str, str]]:
    """Return what a question needs of `profiles`, `tables` and `laws`: each with the name in an introduction.

    Args:
        profile: step, trajectory, flow or time.
        scene: of the question, in the wire's form; None for one that must be refused, so that no
            table and no law is needed.
    """
    if scene is None:
        return [("profiles", profile)]
    parts = {name: part for name, part in scene.items() if name not in ("table", "name", "notes")}
    kinds = {law["kind"] if isinstance(law, Mapping) else "constant" for law in parts.values()}
    found = [("profiles", profile), ("tables", str(scene["table"]))]
    return [*found, *(("laws", kind) for kind in sorted(kinds))]


def probe_values() -> list[float]:
    """Return the numbers of the transport probe: every kind, and random bits of every exponent."""
    least, tiny, largest = 5e-324, sys.float_info.min, sys.float_info.max
    special = [0.0, 0.1, 1 / 3, 2 / 3, 1e22, 1e23, 2.0**53 - 1, 2.0**53 + 2, 123456789012345680.0, largest]
    small = [least, 3 * least, tiny, tiny - least, tiny / 3, 1.0 + 2.0**-52, 1.0 - 2.0**-53]
    draw = random.Random(53)
    scattered = [math.ldexp(1 + draw.random(), exponent) for exponent in range(-1074, 1024, 8)]
    return [sign * value for value in (*special, *small, *scattered) for sign in (1.0, -1.0)]


UNREADABLE = (msgspec.DecodeError, UnicodeDecodeError, RecursionError)
ANSWERS = {"step": Answered, "trajectory": Steps, "flow": Flown, "time": Timed}


MAX_OFFERED = 100  # names of profiles, tables or laws that are kept of an introduction


class _Envelope(msgspec.Struct):
    seq: Any = None
    outcome: Any = None
    error: Any = None
    reason: Any = ""


WHOLE = ("seq", "ns", "protocol")  # what is whole by the schema, where 17.0 is an integer


def read_introduction(line: bytes) -> Introduction:
    """Decode the answer to `start`.

    Raises:
        CheckFailure: wrong-format.
    """
    introduction: Introduction = _read("start", line, Introduction)
    if introduction.protocol != PROTOCOL:
        raise CheckFailure(
            "wrong-format", f"start: it speaks protocol {introduction.protocol}, not {PROTOCOL}"
        )
    texts = {name: clean(getattr(introduction, name)) for name in ("name", "version", "language")}
    lists = {name: getattr(introduction, name) for name in ("profiles", "tables", "laws")}
    offered = {name: tuple(map(clean, given[:MAX_OFFERED])) for name, given in lists.items()}
    return msgspec.structs.replace(introduction, **texts, **offered)


def check_echo(values: Sequence[float], line: bytes) -> None:
    """Compare an echo bit for bit.

    Raises:
        CheckFailure: wrong-format, naming the first number that differs.
    """
    echoed: Sequence[float] = _read("echo", line, Echoed).values
    if len(echoed) != len(values):
        raise CheckFailure("wrong-format", f"echo: {len(echoed)} numbers came back of {len(values)}")
    for i, (sent, came) in enumerate(zip(values, echoed, strict=True)):
        if struct.pack("<d", sent) != struct.pack("<d", came):
            raise CheckFailure("wrong-format", f"echo: values[{i}] = {sent!r} came back as {came!r}")


def read_answer(line: bytes, cmd: str, seq: int | None, *, may_be_null: bool = False) -> dict[str, Any]:
    """Decode the answer to one question, strictly.

    Args:
        line: as received.
        cmd: step, trajectory, flow or time.
        seq: that of the question.
        may_be_null: whether null will do for it.

    Returns:
        The answer as plain data, without its seq: an outcome, what the command asks for, or an error.

    Raises:
        CheckFailure: wrong-format, naming the field.
    """
    envelope: _Envelope = _read(cmd, line, _Envelope)
    is_null = may_be_null and envelope.seq is None
    if not is_null and (type(envelope.seq) not in (int, float) or envelope.seq != seq):
        said = f": {str(envelope.reason)[:200]}" if envelope.reason else ""
        answered = repr(envelope.seq)[:40]
        raise CheckFailure("wrong-format", f"answered seq {answered} to seq {seq}{said}")
    # A failure that is owned to is the whole answer, whatever stands beside it.
    own = Answered if envelope.outcome is not None else ANSWERS[cmd]
    form = Failed if envelope.error is not None else own
    data: dict[str, Any] = msgspec.to_builtins(_read(cmd, line, form, is_checked=True))
    data.pop("seq", None)
    for part in (data, *outcomes_of(data)):
        part.update({name: clean(part[name]) for name in ("reason", "error") if name in part})
    return data


def outcomes_of(answer: Mapping[str, Any]) -> list[Any]:
    """Return the outcomes that an answer holds: a trajectory's steps, a flow's states, or itself."""
    return list(answer.get("steps", answer.get("states", [answer])))


def read_outcome(answer: Mapping[str, Any], t: float = 0.0) -> Outcome:
    """Return the outcome that an answer to `step` is, or a part of another; its capture interval is left out.

    Args:
        answer: as `Session.ask` returns it, or one of `outcomes_of` it.
        t: when the flight began, for a collision that does not tell its flight time.

    Raises:
        CheckFailure: error, when that is the answer; wrong-format, for a collision that names no wall.
    """
    if "error" in answer:
        raise CheckFailure("error", answer["error"])
    answered: Answered = msgspec.convert(answer, Answered)
    if not isinstance(answered, AnsweredCollision):
        return answered
    if answered.wall is None:
        raise CheckFailure("wrong-format", "`wall` is missing")
    dt = answered.t - t if answered.dt is None else answered.dt
    return Collision(answered.wall, dt, answered.t, answered.x, answered.y, answered.vx, answered.vy)


def with_walls(answer: dict[str, Any], scene: Any) -> dict[str, Any]:
    """Name the wall of each collision that leaves it out: the wall nearest to its place at its time.

    Args:
        answer: as `read_answer` returns it.
        scene: of the question, in the wire's form; with one that is none nothing is named.
    """
    for part in outcomes_of(answer):
        if part.get("outcome") == "collision" and "wall" not in part:
            try:
                table = table_at(fp, from_data(without_loose(scene)[0]), part["t"])
            except (ValueError, ArithmeticError):
                return answer  # no scene at all, or a time beyond its numbers: nothing can have been met
            part["wall"] = table.nearest_wall(part["x"], part["y"])
    return answer


def _read(cmd: str, line: bytes, form: Any, *, is_checked: bool = False) -> Any:
    """Decode a line, strictly: a field that stands twice is refused, and so is what is no UTF-8, anywhere.

    A line that was read before in another form is known to have neither.
    """
    try:
        if not is_checked:
            text = line.decode()
            with suppress(json.JSONDecodeError, RecursionError):  # no JSON: the decoder says where
                FIELDS_ONCE.decode(text)
        return _decoded(with_minus_zeros(line), form)
    except UNREADABLE as error:
        raise _unreadable(cmd, error, line) from None


def _once(pairs: list[tuple[str, object]]) -> None:
    """Refuse a field that stands twice in one object, known or not: of two, readers take either."""
    if len({name for name, _ in pairs}) < len(pairs):
        (name, _), *_ = Counter(name for name, _ in pairs).most_common(1)
        raise msgspec.ValidationError(f"Field `{clean(name)[:60]}` stands twice")


FIELDS_ONCE = json.JSONDecoder(object_pairs_hook=_once, parse_int=str, parse_float=str)


def _decoded(line: bytes, form: Any) -> Any:
    try:
        return msgspec.json.decode(line, type=form)
    except msgspec.ValidationError:
        data = msgspec.json.decode(line)
        if not isinstance(data, dict):
            raise
        return msgspec.convert(data | {name: _whole(data[name]) for name in WHOLE if name in data}, form)


def _whole(value: Any) -> Any:
    if isinstance(value, list):
        return [_whole(one) for one in value]
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _unreadable(cmd: str, error: Exception, line: bytes) -> CheckFailure:
    """Say what is wrong with a line, and show it from its beginning, or where it is no JSON."""
    try:
        msgspec.json.decode(line)
    except msgspec.DecodeError as malformed:
        error = malformed  # with the place in the line as it came
    except UNREADABLE:
        pass
    place = re.search(r"\(byte (\d+)\)$", str(error))
    part = excerpt(line, at=int(place[1]) if place else 0)
    return CheckFailure("wrong-format", f"{cmd}: {clean(str(error)).replace('$.', '')[:200]} in {part}")
