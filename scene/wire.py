"""Protocol 1, the side of an implementation: one JSON object a line on stdin and stdout.

`serve` answers `start`, `echo`, `step`, `trajectory` and `stop` for a stepper given as two Python
functions. It holds no numerics: a line that cannot be understood is answered by `rejected` with the reason,
naming the field, and the next line is read.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import version
from typing import Any, BinaryIO

import msgspec

from scene.load import from_data
from scene.refusal import BadInput
from scene.states import Outcome, Rejected, State
from scene.tables import Scene

PROTOCOL = 1
MAX_COLLISIONS = 1_000_000
Stepper = Callable[[Scene, State, float], Outcome]
Follower = Callable[[Scene, State, int, float], list[Outcome]]


class Start(msgspec.Struct, frozen=True, tag_field="cmd", tag="start", forbid_unknown_fields=True):
    """Opens a session."""

    protocol: int


class Echo(msgspec.Struct, frozen=True, tag_field="cmd", tag="echo", forbid_unknown_fields=True):
    """Asks for the same numbers back, bit for bit."""

    values: tuple[float, ...]


class Step(msgspec.Struct, frozen=True, tag_field="cmd", tag="step", forbid_unknown_fields=True):
    """Asks for one collision."""

    seq: int
    scene: Any
    state: State
    t_end: float


class Trajectory(msgspec.Struct, frozen=True, tag_field="cmd", tag="trajectory", forbid_unknown_fields=True):
    """Asks for successive collisions."""

    seq: int
    scene: Any
    state: State
    collisions: int
    t_end: float


class Stop(msgspec.Struct, frozen=True, tag_field="cmd", tag="stop", forbid_unknown_fields=True):
    """Ends the session."""


Command = Start | Echo | Step | Trajectory | Stop
_decoder = msgspec.json.Decoder(Command)


def serve(name: str, stepper: Stepper, follower: Follower, lines: BinaryIO, out: BinaryIO) -> None:
    """Answer protocol lines until `stop` or the end of input.

    Args:
        name: of the implementation.
        stepper: (scene, state, t_end) -> outcome in the wire's form.
        follower: (scene, state, collisions, t_end) -> collisions, and last what came instead of one.
        lines: requests, one JSON object a line.
        out: answers, one line each, flushed.
    """
    scenes: dict[bytes, Scene] = {}
    for line in lines:
        if not line.strip():
            continue
        try:
            command = _decoder.decode(line)
        except (msgspec.DecodeError, RecursionError) as error:
            _reply(out, {"seq": _sequence_number(line), **_plain(Rejected(str(error)))})
            continue
        if isinstance(command, Stop):
            return
        if isinstance(command, Echo):
            _reply(out, {"values": command.values})
        elif isinstance(command, Start):
            _reply(out, _introduction(name, command))
        else:
            _reply(out, {"seq": command.seq, **_answer(command, stepper, follower, scenes)})


def _answer(
    command: Step | Trajectory, stepper: Stepper, follower: Follower, scenes: dict[bytes, Scene]
) -> dict[str, Any]:
    key = msgspec.json.encode(command.scene)
    try:
        if key not in scenes:
            scenes.clear()  # successive steps mostly share their scene: keep that one
            scenes[key] = from_data(command.scene)
        if isinstance(command, Step):
            return _plain(stepper(scenes[key], command.state, command.t_end))
        if not 0 <= command.collisions <= MAX_COLLISIONS:
            raise BadInput(f"collisions = {command.collisions}, must be 0 to {MAX_COLLISIONS}")
        steps = follower(scenes[key], command.state, command.collisions, command.t_end)
        return {"steps": [_plain(outcome) for outcome in steps]}
    except BadInput as error:
        return _plain(Rejected(str(error)))


def _introduction(name: str, command: Start) -> dict[str, Any]:
    if command.protocol != PROTOCOL:
        return _plain(Rejected(f"protocol = {command.protocol}, must be {PROTOCOL}"))
    return {
        "protocol": PROTOCOL,
        "name": name,
        "version": version("oscillating-mushrooms"),
        "language": "Python",
        "profiles": ["step", "trajectory"],
        "tables": ["cap", "stem", "mushroom"],
        "laws": ["constant", "fourier", "bang-bang"],
    }


def _sequence_number(line: bytes) -> Any:
    try:
        seq = msgspec.json.decode(line).get("seq")
    except (msgspec.DecodeError, RecursionError, AttributeError):
        return None
    return seq if isinstance(seq, int) else None


def _plain(outcome: Outcome) -> dict[str, Any]:
    data: dict[str, Any] = msgspec.to_builtins(outcome)
    return data


def _reply(out: BinaryIO, answer: dict[str, Any]) -> None:
    out.write(msgspec.json.encode(answer) + b"\n")
    out.flush()
