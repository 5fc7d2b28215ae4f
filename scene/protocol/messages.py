"""The messages of protocol 1, both directions, and their published JSON Schema.

Requests are decoded strictly: an unknown field is refused. (`docs/protocol.md` says where an
implementation may ignore one.) Unknown fields of answers are ignored. `dt` and `wall` of a
collision may be absent, for engines that do not know them. A scene is not decoded here, but once,
by the stepper. In protocol and schema a request has the name of its class without the suffix.
`python -m scene.protocol.messages > docs/protocol.schema.json` prints the schema.
"""

import json
import re
from typing import Annotated, Any, get_args

import msgspec

from scene.load import limit_definitions
from scene.states import Horizon, Rejected, State, Undecided, Undefined
from scene.tables import Scene, Wall

PROTOCOL = 1
MAX_SEQ = 2**53  # the integers that every JSON parser keeps
PROFILES = ("step", "trajectory", "flow", "time")
Seq = Annotated[int, msgspec.Meta(ge=0, le=MAX_SEQ)]


class _Request(msgspec.Struct, frozen=True, tag_field="cmd", forbid_unknown_fields=True):
    pass


class _Question(_Request, frozen=True):
    seq: Seq
    scene: msgspec.Raw


class StartRequest(_Request, frozen=True, tag="start"):
    """Opens a session; answered by Introduction."""

    protocol: int


class EchoRequest(_Request, frozen=True, tag="echo"):
    """Asks for the same numbers back, bit for bit; answered by Echoed."""

    values: tuple[float, ...]


class StepRequest(_Question, frozen=True, tag="step"):
    """Asks for one collision; answered by an outcome with the same seq."""

    state: State
    t_end: float


class TrajectoryRequest(_Question, frozen=True, tag="trajectory"):
    """Asks for successive collisions; answered by Steps."""

    state: State
    collisions: int
    t_end: float


class FlowRequest(_Question, frozen=True, tag="flow"):
    """Asks where many particles are at t_end; answered by Flown."""

    states: tuple[State, ...]
    t_end: float


class TimeRequest(_Question, frozen=True, tag="time"):
    """Asks how long a trajectory of that many collisions takes, `repeat` times over.

    Answered by Timed.
    """

    state: State
    collisions: int
    repeat: int


class StopRequest(_Request, frozen=True, tag="stop"):
    """Ends the session; not answered, the process exits."""


Command = (
    StartRequest
    | EchoRequest
    | StepRequest
    | TrajectoryRequest
    | FlowRequest
    | TimeRequest
    | StopRequest
)


class Introduction(msgspec.Struct, frozen=True):
    """Name and capabilities of an implementation. What is not listed here is never tested."""

    protocol: int
    name: str
    version: str
    language: str
    profiles: tuple[str, ...]
    tables: tuple[str, ...]
    laws: tuple[str, ...]


class Echoed(msgspec.Struct, frozen=True):
    """The numbers of an echo."""

    values: tuple[float, ...]


class AnsweredCollision(
    msgspec.Struct,
    frozen=True,
    kw_only=True,
    omit_defaults=True,
    gc=False,
    tag_field="outcome",
    tag="collision",
):
    """A collision in an answer: `scene.Collision`, with two fields that may be absent.

    Attributes:
        wall: the wall met; if absent, the suite takes the wall nearest to the position.
        dt: flight time; if absent, only `t` is graded.
        t: time; x, y: position; vx, vy: velocity after the bounce.
    """

    wall: Wall | None = None
    dt: float | None = None
    t: float
    x: float
    y: float
    vx: float
    vy: float


Answered = AnsweredCollision | Horizon | Undefined | Undecided | Rejected


class Steps(msgspec.Struct, frozen=True):
    """The collisions of a trajectory.

    If it ended early, the last entry is the outcome that ended it.
    """

    seq: Seq
    steps: tuple[Answered, ...]


class Arrival(Horizon, frozen=True, tag="horizon"):
    """A particle at t_end, and its first capture interval [time]; None if it has none.

    An interval that lasts at t_end ends there.
    """

    captured: tuple[float, float] | None = None


class LostUndefined(Undefined, frozen=True, omit_defaults=True, tag="undefined"):
    """A particle of a flow for which mathematics gives no arrival. It has no capture interval."""

    captured: None = None


class LostUndecided(Undecided, frozen=True, omit_defaults=True, tag="undecided"):
    """A particle of a flow whose arrival is undecided. It has no capture interval."""

    captured: None = None


class LostRejected(Rejected, frozen=True, omit_defaults=True, tag="rejected"):
    """A particle of a flow that was bad input. It has no capture interval."""

    captured: None = None


class Flown(msgspec.Struct, frozen=True):
    """The particles of a flow at t_end, in order.

    A lost particle has a reason and no capture interval.
    """

    seq: Seq
    states: tuple[Arrival | LostUndefined | LostUndecided | LostRejected, ...]


class Timed(msgspec.Struct, frozen=True):
    """Wall-clock nanoseconds of each repeat, and the last outcome of the trajectory."""

    seq: Seq
    ns: tuple[Annotated[int, msgspec.Meta(ge=0)], ...]
    steps: tuple[Answered, ...]


class Failed(msgspec.Struct, frozen=True):
    """The implementation reports that it failed at this question.

    It counts as an error, not as a crash.
    """

    seq: Seq
    error: str


# Skips strings, and fields of a request that are whole numbers; the last string may have no end.
_WHOLE = rb'"(?:protocol|seq|collisions|repeat)"\s*:\s*-0(?=[\s,}])'
_STRING = rb'"(?:[^"\\]|\\.)*+\\?(?:"|\Z)'
_ZEROS = re.compile(_WHOLE + rb"|" + _STRING + rb"|(?<![\w.+-])-0(?=[\s,\]}]|\Z)", re.DOTALL)
_MAY_HAVE_ZEROS = re.compile(rb"-0(?:[\s,\]}]|\Z)")


def with_minus_zeros(line: bytes) -> bytes:
    """Replace -0 by -0.0 in a line of JSON.

    C writes minus zero as -0, and decoders read that as an integer.

    In fields that are whole numbers -0 is not replaced: it is 0.

    Args:
        line: of JSON, or of anything.
    """
    if not _MAY_HAVE_ZEROS.search(line):
        return line
    return _ZEROS.sub(lambda found: b"-0.0" if found[0] == b"-0" else found[0], line)


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of one line of protocol 1, published as docs/protocol.schema.json."""
    requests = get_args(Command)
    outcomes = get_args(Answered)
    answers = (Introduction, Echoed, Steps, Flown, Timed, Failed)
    _, definitions = msgspec.json.schema_components(
        [*requests, *outcomes, *answers, Scene], ref_template="#/$defs/{name}"
    )
    limit_definitions(definitions)
    published = {name: name.removesuffix("Request") for name in definitions}
    definitions = {
        published[name]: {**kind, "title": published[name]} for name, kind in definitions.items()
    }
    tables = ("Cap", "Stem", "Mushroom")
    scene = {"anyOf": [_reference(name) for name in tables]}
    definitions["Trajectory"]["properties"]["collisions"]["minimum"] = 0
    for field in ("collisions", "repeat"):
        definitions["Time"]["properties"][field]["minimum"] = 1
    for request in (StepRequest, TrajectoryRequest, FlowRequest, TimeRequest):
        definitions[published[request.__name__]]["properties"]["scene"] = scene
    # A step is answered by an outcome that carries the seq of the request (null where it had none).
    seq = {
        "type": "object",
        "properties": {"seq": {"type": ["integer", "null"]}},
        "required": ["seq"],
    }
    definitions["Request"] = {"anyOf": [_reference(published[kind.__name__]) for kind in requests]}
    stepped = {
        "allOf": [seq, {"anyOf": [_reference(published[kind.__name__]) for kind in outcomes]}]
    }
    definitions["Answer"] = {"anyOf": [stepped, *(_reference(kind.__name__) for kind in answers)]}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Protocol 1",
        "anyOf": [_reference("Request"), _reference("Answer")],
        "$defs": definitions,
    }


def _reference(name: str) -> dict[str, str]:
    return {"$ref": f"#/$defs/{name}"}


if __name__ == "__main__":
    print(json.dumps(json_schema(), indent=2, ensure_ascii=False))
