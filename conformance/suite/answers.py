"""What an implementation says, decoded: strictly, but for manners that mean the same.

A further field is ignored; a whole number is one however it is written, 17.0 too; -0 is minus zero; a wall
that an answer leaves out is named from the place; texts lose their control characters. All else that the
protocol does not name is `wrong-format`, with the field. Whether an answer is right is not judged here.
"""

import json
import re
import struct
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any, get_args

import msgspec
from mpmath import fp

from conformance.suite.process import CheckFailure, clean, excerpt
from scene import Collision, Outcome, from_data
from scene.geometry import table_at
from scene.protocol.messages import (
    PROTOCOL,
    Answered,
    AnsweredCollision,
    Arrival,
    Echoed,
    Failed,
    Flown,
    Introduction,
    Steps,
    Timed,
    with_minus_zeros,
)

UNREADABLE = (msgspec.DecodeError, UnicodeDecodeError, RecursionError)
MAX_OFFERED = 100  # profiles, tables or laws that an introduction may list
ANSWERS = {"step": Answered, "trajectory": Steps, "flow": Flown, "time": Timed}


class _Envelope(msgspec.Struct):
    seq: Any = None
    outcome: Any = None
    error: Any = None
    reason: Any = ""


WHOLE = ("seq", "ns", "protocol")  # what is whole by the schema, where 17.0 is an integer
_FORMS = (Introduction, Echoed, Failed, *get_args(Answered), Arrival, Steps, Flown, Timed)
NAMED = {"outcome"}.union(*(form.__struct_fields__ for form in _FORMS))  # the fields of answers


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
    lists = {name: getattr(introduction, name)[:MAX_OFFERED] for name in ("profiles", "tables", "laws")}
    offered = {name: tuple(map(clean, words)) for name, words in lists.items()}
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
                table = table_at(fp, from_data(scene), part["t"])
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
    """Refuse a named field that stands twice in one object: of two, readers take either."""
    if len({name for name, _ in pairs}) < len(pairs):
        counts = Counter(name for name, _ in pairs)
        for name in NAMED & counts.keys():
            if counts[name] > 1:
                raise msgspec.ValidationError(f"Field `{name}` stands twice")


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
