"""Protocol 1 for implementations in Python: one JSON object a line on stdin and stdout.

`serve` answers every request with a stepper given as Python functions. A line that cannot be
understood is answered by `rejected`, with a reason that names the field. A stepper that does not
know flight times or walls answers `AnsweredCollision` without them.
"""

from collections.abc import Callable, Sequence
from functools import lru_cache
from importlib.metadata import version
from typing import Any, BinaryIO

import msgspec

from scene.laws import WRITTEN
from scene.load import from_data
from scene.protocol.messages import (
    MAX_SEQ,
    PROTOCOL,
    Answered,
    Command,
    EchoRequest,
    FlowRequest,
    StartRequest,
    StepRequest,
    StopRequest,
    TimeRequest,
    TrajectoryRequest,
    with_minus_zeros,
)
from scene.refusal import BadInput, check_count
from scene.states import Outcome, Rejected, State
from scene.tables import Scene

MAX_COLLISIONS = 1_000_000
MAX_REPEAT = 1_000
MAX_STATES = 1_000_000
AnsweringStepper = Callable[[Scene, State, float], Answered | Outcome]
Follower = Callable[[Scene, State, int, float], Sequence[Answered | Outcome]]
Captured = tuple[float, float] | None
Flowing = Callable[[Scene, Sequence[State], float], Sequence[tuple[Outcome, Captured]]]
Timer = Callable[[Scene, State, int, int], tuple[Sequence[int], Answered | Outcome]]


# A failure that is owned to, not an error of this program.
class OwnFailure(Exception):  # noqa: N818
    """Raised by a stepper that cannot give an outcome: answered as `error`, with this text."""


# What a line may do to the decoder: bad JSON, bad fields, bad UTF-8, too deep a nesting.
UNREADABLE = (msgspec.DecodeError, UnicodeDecodeError, RecursionError)
_decoder = msgspec.json.Decoder(Command)


def serve(
    name: str,
    stepper: AnsweringStepper,
    follower: Follower,
    lines: BinaryIO,
    out: BinaryIO,
    *,
    flow: Flowing | None = None,
    timer: Timer | None = None,
) -> None:
    """Answer protocol lines until `stop` or the end of input.

    Args:
        name: of the implementation.
        stepper: (scene, state, t_end) -> outcome in the wire's form.
        follower: (scene, state, collisions, t_end) -> collisions; the last entry may be another
            outcome.
        lines: requests, one JSON object a line.
        out: answers, one line each, flushed.
        flow: (scene, states, t_end) -> for each state its outcome at t_end and (t_in, t_out) of its
            first capture interval, or None; the profile is offered only if this is given.
        timer: (scene, state, collisions, repeat) -> nanoseconds of each repeat, and the last
            outcome; likewise.
    """
    _Server(name, stepper, follower, flow, timer).run(lines, out)


class _Server:
    def __init__(
        self,
        name: str,
        stepper: AnsweringStepper,
        follower: Follower,
        flow: Flowing | None,
        timer: Timer | None,
    ) -> None:
        self.name = name
        self.stepper = stepper
        self.follower = follower
        self.flow = flow
        self.timer = timer

    def run(self, lines: BinaryIO, out: BinaryIO) -> None:
        for line in lines:
            if not line.strip():
                continue
            try:
                command = _decoder.decode(with_minus_zeros(line))
            except UNREADABLE as error:
                _reply(out, {"seq": _sequence_number(line), **_plain(_refusal(error))})
                continue
            if isinstance(command, StopRequest):
                return
            if isinstance(command, EchoRequest):
                _reply(out, {"values": command.values})
            elif isinstance(command, StartRequest):
                _reply(out, self.introduce(command))
            else:
                _reply(out, {"seq": command.seq, **self.answer(command)})

    def introduce(self, command: StartRequest) -> dict[str, Any]:
        if command.protocol != PROTOCOL:
            return {
                "seq": None,
                **_plain(Rejected(f"protocol = {command.protocol}, must be {PROTOCOL}")),
            }
        offered = {"step": True, "trajectory": True, "flow": self.flow, "time": self.timer}
        return {
            "protocol": PROTOCOL,
            "name": self.name,
            "version": version("oscillating-mushrooms"),
            "language": "Python",
            "profiles": [profile for profile, function in offered.items() if function is not None],
            "tables": ["cap", "stem", "mushroom"],
            "laws": ["constant", *(kind.__struct_config__.tag for kind in WRITTEN)],
        }

    def answer(
        self, command: StepRequest | TrajectoryRequest | FlowRequest | TimeRequest
    ) -> dict[str, Any]:
        try:
            scene = _read_scene(bytes(command.scene))
            if isinstance(command, StepRequest):
                return _plain(self.stepper(scene, command.state, command.t_end))
            if isinstance(command, FlowRequest):
                return self.answer_flow(scene, command)
            least = int(isinstance(command, TimeRequest))
            check_count("collisions", command.collisions, least, MAX_COLLISIONS)
            if isinstance(command, TimeRequest):
                return self.answer_time(scene, command)
            steps = self.follower(scene, command.state, command.collisions, command.t_end)
            return {"steps": steps}
        except (BadInput, *UNREADABLE) as error:
            return _plain(_refusal(error))
        except OwnFailure as failure:
            return {"error": str(failure)}
        except (MemoryError, EOFError, OSError) as error:
            return {"error": f"{type(error).__name__}: {error}".removesuffix(": ")}

    def answer_flow(self, scene: Scene, command: FlowRequest) -> dict[str, Any]:
        if self.flow is None:
            raise BadInput("flow is not among this implementation's profiles")
        check_count("number of states", len(command.states), 0, MAX_STATES)
        arrivals = self.flow(scene, command.states, command.t_end)
        return {
            "states": [{**_plain(outcome), "captured": captured} for outcome, captured in arrivals]
        }

    def answer_time(self, scene: Scene, command: TimeRequest) -> dict[str, Any]:
        if self.timer is None:
            raise BadInput("time is not among this implementation's profiles")
        check_count("repeat", command.repeat, 1, MAX_REPEAT)
        ns, last = self.timer(scene, command.state, command.collisions, command.repeat)
        return {"ns": list(ns), "steps": [last]}


@lru_cache(maxsize=1)  # successive requests mostly have the same scene
def _read_scene(raw: bytes) -> Scene:
    return from_data(msgspec.json.decode(raw))


def _refusal(error: Exception) -> Rejected:
    # A key may hold a line break, and the message repeats it.
    return Rejected(" ".join(str(error).split()))


def _sequence_number(line: bytes) -> int | None:
    try:
        seq = msgspec.json.decode(line).get("seq")
    except (*UNREADABLE, AttributeError):
        return None
    return seq if type(seq) is int and 0 <= seq <= MAX_SEQ else None


def _plain(outcome: Answered | Outcome) -> dict[str, Any]:
    data: dict[str, Any] = msgspec.to_builtins(outcome)
    return data


def _reply(out: BinaryIO, answer: dict[str, Any]) -> None:
    out.write(msgspec.json.encode(answer) + b"\n")
    out.flush()
