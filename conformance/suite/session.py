"""A session of protocol 1 with one implementation: asks, decodes strictly, restarts after trouble.

What is no answer becomes a verdict (`Trouble`): crashed, timed-out, wrong-format; `error` when the
restarts are used up and nothing was asked. After trouble the process is killed and the next question
goes to a fresh one, to which `start` is replayed. When the time for the whole session is spent, all that is
still asked is `timed-out`. Sequence numbers are random, so that no answer can be given before its question.
Texts are kept without control characters, and a wall that an answer leaves out is named from the place.
Whether an answer is right is not judged here.
"""

from __future__ import annotations

import math
import random
import struct
import sys
import time
from collections.abc import Mapping, Sequence
from types import TracebackType
from typing import Any

import msgspec
from mpmath import fp

from conformance.suite.process import Process, Transcript, Trouble, clean, shown
from scene import Collision, Outcome, Scene, State, from_data, to_data
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
)
from scene.refusal import BadInput

MAX_SEQ = 2**31 - 1  # the integers of every language
STOP_TIMEOUT = 5.0  # seconds to exit after `stop`
UNREADABLE = (msgspec.DecodeError, UnicodeDecodeError, RecursionError)
MAX_OFFERED = 100  # profiles, tables or laws that an introduction may list
ANSWERS = {"step": Answered, "trajectory": Steps, "flow": Flown, "time": Timed}


class Limits(msgspec.Struct, frozen=True):
    """What a session puts up with.

    Attributes:
        timeout: seconds for one answer, start-up and just-in-time compilation included.
        restarts: fresh processes after the first.
        total: seconds for the whole session, restarts included; None for as long as it takes.
    """

    timeout: float = 120.0
    restarts: int = 10
    total: float | None = None


class _Envelope(msgspec.Struct):
    seq: Any = None
    outcome: Any = None
    error: Any = None
    reason: Any = ""


_outcomes: msgspec.json.Decoder[Any] = msgspec.json.Decoder(Answered)
_envelopes = msgspec.json.Decoder(_Envelope)
_failures: msgspec.json.Decoder[Any] = msgspec.json.Decoder(Failed)
_answers: dict[str, msgspec.json.Decoder[Any]] = {
    cmd: msgspec.json.Decoder(form) for cmd, form in ANSWERS.items()
}


class Session:
    """A conversation with a command; a context manager that leaves no process behind.

    Attributes:
        introduction: what the implementation said of itself, once opened.
        n_restarts: fresh processes that were needed so far.
        stderr: what it wrote to standard error, bounded.
    """

    def __init__(self, command: Sequence[str], limits: Limits | None = None) -> None:
        if not command:
            raise BadInput("no command to check: give it after `--`")
        self._command, self._limits = list(command), limits or Limits()
        self._process: Process | None = None
        self._end: Trouble | None = None
        self._draw = random.Random()
        total = self._limits.total
        self._deadline = math.inf if total is None else time.monotonic() + total
        self.introduction: Introduction | None = None
        self.n_restarts = 0
        self.stderr = Transcript()

    def __enter__(self) -> Session:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.kill()

    def start(self) -> Introduction:
        """Start the process and exchange introductions.

        Raises:
            CommandNotFound: when there is no such program.
            Trouble: when it does not introduce itself in protocol 1; the session is then over.
        """
        if self._process is not None:
            raise RuntimeError("this session has started")
        self._process = Process(self._command, self.stderr)
        try:
            line = self._exchange(_encode({"cmd": "start", "protocol": PROTOCOL}))
            self.introduction = read_introduction(line)
        except Trouble as trouble:
            self._give_up(trouble)
            raise
        return self.introduction

    def probe(self) -> None:
        """Prove that numbers arrive and return with all their bits.

        Raises:
            Trouble: wrong-format, naming the first number that does not; the session is then over.
        """
        values = probe_values()
        try:
            line = self._exchange(_encode({"cmd": "echo", "values": values}))
            check_echo(values, line)
        except Trouble as trouble:
            self._give_up(trouble)
            raise

    def ask(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """Put one question and return its answer as plain data, every collision with its wall.

        Args:
            request: a step, trajectory, flow or time request; its seq is replaced by a random one.

        Raises:
            Trouble: crashed, timed-out or wrong-format; error or timed-out when the session is over.
        """
        seq = self._draw.randint(1, MAX_SEQ)
        answer = self._say(_encode({**request, "seq": seq}), request["cmd"], seq)
        return _with_walls(answer, request.get("scene"))

    def say(self, line: bytes, seq: int | None) -> dict[str, Any]:
        """Send a line that is no request, and return what it is answered.

        Args:
            line: without its newline.
            seq: that can be read in it; the answer has this one or null.

        Raises:
            Trouble: as `ask`.
        """
        return self._say(line, "step", seq, may_be_null=True)

    def step(self, scene: Scene, state: State, t_end: float) -> Outcome:
        """Ask for one step: the session as a stepper, for properties.

        Raises:
            Trouble: as `ask`; error when that is the answer; fail for a question with a number that is
                not finite, as only the answers before can have made it.
        """
        fields = msgspec.to_builtins(state)
        if not all(math.isfinite(number) for number in (*msgspec.structs.astuple(state)[:5], t_end)):
            raise Trouble("fail", f"its answers lead to the state {fields} and t_end = {t_end}")
        request = {"cmd": "step", "scene": to_data(scene), "state": fields, "t_end": t_end}
        return read_outcome(self.ask(request), state.t)

    def stop(self) -> None:
        """Ask the process to stop and see it end by itself.

        Raises:
            Trouble: when it does not, goes on talking, or leaves a child; it is killed all the same.
        """
        process, self._process = self._process, None
        if process is None:
            self._check_time()
            raise self._end or Trouble("error", "not asked: no process was left")
        try:
            process.finish(_encode({"cmd": "stop"}), min(STOP_TIMEOUT, self._limits.timeout))
        finally:
            process.kill()

    def kill(self) -> None:
        """End the process at once, if there is one."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()

    def _say(self, line: bytes, cmd: str, seq: int | None, *, may_be_null: bool = False) -> dict[str, Any]:
        if self._end is not None:
            raise self._end
        self._check_time()
        if self._process is None:
            self._restart()
        try:
            return read_answer(self._exchange(line), cmd, seq, may_be_null=may_be_null)
        except Trouble:
            self.kill()
            raise

    def _check_time(self) -> None:
        if self._end is None and time.monotonic() >= self._deadline:
            why = f"not asked: the total time of {self._limits.total:g} s is spent"
            self._give_up(trouble := Trouble("timed-out", why))
            raise trouble

    def _exchange(self, line: bytes) -> bytes:
        assert self._process is not None
        left = max(0.0, self._deadline - time.monotonic())
        return self._process.exchange(line, min(self._limits.timeout, left))

    def _restart(self) -> None:
        if self.n_restarts >= self._limits.restarts:
            self._give_up(Trouble("error", f"not asked: restarted {self.n_restarts} times already"))
            raise self._end  # type: ignore[misc]
        self.n_restarts += 1
        try:
            self.start()
        except (Trouble, BadInput) as trouble:
            self._give_up(Trouble("error", f"not asked: the restart failed, {trouble}"))
            raise self._end from None  # type: ignore[misc]

    def _give_up(self, trouble: Trouble) -> None:
        self.kill()
        self._end = trouble


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


def read_introduction(line: bytes) -> Introduction:
    """Decode the answer to `start`.

    Raises:
        Trouble: wrong-format.
    """
    try:
        introduction = msgspec.json.decode(line, type=Introduction)
    except UNREADABLE as error:
        raise Trouble("wrong-format", f"start: {_reason(error)} in {shown(line)}") from None
    if introduction.protocol != PROTOCOL:
        raise Trouble("wrong-format", f"start: it speaks protocol {introduction.protocol}, not {PROTOCOL}")
    texts = {name: clean(getattr(introduction, name)) for name in ("name", "version", "language")}
    lists = {name: getattr(introduction, name)[:MAX_OFFERED] for name in ("profiles", "tables", "laws")}
    offered = {name: tuple(map(clean, given)) for name, given in lists.items()}
    return msgspec.structs.replace(introduction, **texts, **offered)


def check_echo(values: Sequence[float], line: bytes) -> None:
    """Compare an echo bit for bit.

    Raises:
        Trouble: wrong-format, naming the first number that differs.
    """
    try:
        echoed = msgspec.json.decode(line, type=Echoed).values
    except UNREADABLE as error:
        raise Trouble("wrong-format", f"echo: {_reason(error)} in {shown(line)}") from None
    if len(echoed) != len(values):
        raise Trouble("wrong-format", f"echo: {len(echoed)} numbers came back of {len(values)}")
    for i, (sent, came) in enumerate(zip(values, echoed, strict=True)):
        if struct.pack("<d", sent) != struct.pack("<d", came):
            raise Trouble("wrong-format", f"echo: values[{i}] = {sent!r} came back as {came!r}")


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
        Trouble: wrong-format, naming the field.
    """
    try:
        envelope = _envelopes.decode(line)
        is_null = may_be_null and envelope.seq is None
        if not is_null and (type(envelope.seq) is not int or envelope.seq != seq):
            said = f": {str(envelope.reason)[:200]}" if envelope.reason else ""
            given = repr(envelope.seq)[:40]
            raise Trouble("wrong-format", f"answered seq {given} to seq {seq}{said}")
        own = _failures if envelope.error is not None else _answers[cmd]
        decoder = _outcomes if envelope.outcome is not None else own
        data: dict[str, Any] = msgspec.to_builtins(decoder.decode(line))
    except UNREADABLE as error:
        raise Trouble("wrong-format", f"{cmd}: {_reason(error)} in {shown(line)}") from None
    data.pop("seq", None)
    for part in (data, *data.get("steps", ()), *data.get("states", ())):
        part.update({name: clean(part[name]) for name in ("reason", "error") if name in part})
    return data


def read_outcome(answer: Mapping[str, Any], t: float) -> Outcome:
    """Return the outcome that an answer to `step` is, or one of the steps of a trajectory.

    Args:
        answer: as `Session.ask` returns it.
        t: when the flight began, for a collision that does not tell its flight time.

    Raises:
        Trouble: error, when that is the answer; wrong-format, for a collision that names no wall.
    """
    if "error" in answer:
        raise Trouble("error", answer["error"])
    answered: Answered = msgspec.convert(answer, Answered)
    if not isinstance(answered, AnsweredCollision):
        return answered
    if answered.wall is None:
        raise Trouble("wrong-format", "`wall` is missing")
    dt = answered.t - t if answered.dt is None else answered.dt
    return Collision(answered.wall, dt, answered.t, answered.x, answered.y, answered.vx, answered.vy)


def _with_walls(answer: dict[str, Any], scene: Any) -> dict[str, Any]:
    """Name the wall of each collision that leaves it out: the wall nearest to its place at its time."""
    for part in (answer, *answer.get("steps", ())):
        if part.get("outcome") == "collision" and "wall" not in part:
            try:
                table = table_at(fp, from_data(scene), part["t"])
            except (ValueError, ArithmeticError):
                return answer  # no scene at all, or a time beyond its numbers: nothing can have been met
            part["wall"] = table.nearest_wall(part["x"], part["y"])
    return answer


def probe_values() -> list[float]:
    """Return the numbers of the transport probe: every kind, and random bits of every exponent."""
    least, largest = 5e-324, sys.float_info.max
    tiny = sys.float_info.min
    special = [0.0, 0.1, 1 / 3, 2 / 3, 1e22, 1e23, 2.0**53 - 1, 2.0**53 + 2, 123456789012345680.0, largest]
    small = [least, 3 * least, tiny, tiny - least, tiny / 3, 1.0 + 2.0**-52, 1.0 - 2.0**-53]
    draw = random.Random(53)
    bits = [(exponent << 52) | draw.getrandbits(52) for exponent in range(0, 2047, 8)]
    scattered = [struct.unpack("<d", struct.pack("<Q", pattern))[0] for pattern in bits]
    positive = [*special, *small, *scattered]
    return [sign * value for value in positive for sign in (1.0, -1.0)]


def _encode(request: Mapping[str, Any]) -> bytes:
    return msgspec.json.encode(request)


def _reason(error: Exception) -> str:
    return clean(str(error)).replace("$.", "")[:200]
