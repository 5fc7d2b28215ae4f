"""The promise that a scene is refused which is broken at some time, and none for coming near to that.

Each condition of docs/protocol.md is broken in turn, by a wave and by legs, for a fiftieth of the period and
by a five hundredth of a size, and not when the question is asked nor before its end: who looks at a scene
when a particle starts, at its knots or at its means finds nothing wrong. Its twin comes as near from the
other side and is valid, and must not be refused; nor may scenes whose laws keep apart at all times though
their ranges do not. Laws of different periods, and those that jump or run back in time, are refused too.
Narrower breaks are for the vectors: who samples a period finds all of these.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import cos, pi, sin
from typing import Any, NamedTuple

import msgspec

from conformance.suite.process import Trouble
from conformance.suite.promises.questions import INSIDE
from conformance.suite.session import Session, missing
from scene import Cap, Mushroom, State, Stem

Data = dict[str, Any]
Kind = Callable[[float, float], Data]  # (lowest, highest) -> law
TABLES = {"cap": Cap, "stem": Stem, "mushroom": Mushroom}
MARGIN = 2.0**-9  # of a size, by which a scene is broken, or is not
BREAK = 0.6875  # of a period: when it is
SOON = 2.0**-12  # until t_end: nothing is met by then
RESTING: dict[str, Data] = {
    "cap": {"table": "cap", "r": 1.0},
    "stem": {"table": "stem", "w": 1.0, "h": 1.25},
    "mushroom": {"table": "mushroom", "r": 1.0, "w": 0.5, "h": 1.0},
}
BY_NU: Data = {"table": "mushroom", "r": 1.0, "nu": 0.5, "h": 1.0}


class JudgedScene(NamedTuple):
    """A scene as JSON has it, and what is bad about it; nothing when `why` is empty."""

    scene: Data
    why: str


def bad_scenes(session: Session) -> str:
    """What is no scene at some time is refused, and what is one is not.

    Every scene is asked about by a step, a third each by a trajectory and by a flow too.

    Raises:
        Trouble: fail for a broken scene that is answered, or a valid one that is refused; declined where one
            is undecided; unsupported where nothing can be asked.
    """
    assert session.introduction is not None
    n = n_open = 0
    judged = (*broken_at_times(), *broken_as_written(), *valid_though_near())
    for i, (scene, why) in enumerate(judged):
        for cmd in ("step", *("trajectory", "flow")[i % 3 : 1 + i % 3]):
            if missing(session.introduction, cmd, scene):
                continue
            outcome = _outcome(session, cmd, scene)
            n += 1
            n_open += bool(why) and outcome == "undecided"
            if why and outcome not in ("rejected", "undecided"):
                raise Trouble("fail", f"{cmd}: a scene where {why} is answered {outcome}: {scene}")
            if not why and outcome == "rejected":
                raise Trouble("fail", f"{cmd}: a valid scene is rejected: {scene}")
    if not n:
        raise Trouble("unsupported", "no table is offered, or no laws that move")
    if n_open:
        raise Trouble("declined", f"{n_open} of {n} scenes are undecided")
    return f"{n} scenes"


def _outcome(session: Session, cmd: str, scene: Data) -> str:
    """Ask one command about a scene, and return how it is answered."""
    inside: State = INSIDE[TABLES[scene["table"]]]
    state = msgspec.to_builtins(inside)
    more: Data = {"states": [state]} if cmd == "flow" else {"state": state}
    if cmd == "trajectory":
        more["collisions"] = 1
    answer = session.ask({"cmd": cmd, "scene": scene, **more, "t_end": inside.t + SOON})
    if "error" in answer:
        raise Trouble("error", answer["error"])
    parts = answer.get("steps", answer.get("states", [answer]))
    return str(parts[0]["outcome"]) if parts else "nothing"


def _wave(low: float, high: float, at: float = BREAK) -> Data:
    """Return a wave that is lowest at some part of its period."""
    mean, size = (low + high) / 2, (high - low) / 2
    cosine, sine = -size * cos(2 * pi * at), -size * sin(2 * pi * at)
    return {"kind": "fourier", "mean": mean, "period": 1.0, "cos": [cosine], "sin": [sine]}


def _legs(low: float, high: float) -> Data:
    """Return legs that are lowest where a wave is."""
    return {"kind": "bang-bang", "knots": [[0.0, high], [BREAK, low], [1.0, high]]}


def _peak(kind: Kind, low: float, high: float) -> Data:
    """Return a law that is highest where others are lowest."""
    if kind is _wave:
        return _wave(low, high, BREAK - 0.5)
    return {"kind": "bang-bang", "knots": [[0.0, low], [BREAK, high], [1.0, low]]}


def broken_at_times() -> Iterator[JudgedScene]:
    """Make scenes of which each condition fails for a short time, and their valid twins."""
    for kind in (_wave, _legs):
        for off in (-MARGIN, MARGIN):
            for table, name, law, why in _nearly_broken(kind, off):
                yield JudgedScene({**table, name: law}, why if off < 0 else "")


def _nearly_broken(kind: Kind, off: float) -> Iterator[tuple[Data, str, Data, str]]:
    """Yield a table, a law's name and the law, off a condition by a part of a size, and how it breaks it."""
    cap, stem, mushroom = RESTING.values()
    for table, name in (
        (cap, "r"),
        (stem, "w"),
        (stem, "h"),
        (mushroom, "w"),
        (mushroom, "h"),
        (BY_NU, "nu"),
    ):
        yield table, name, kind(off, 0.75), f"{name} sinks below 0"
    yield BY_NU, "r", kind(off, 1.5), "r sinks below 0"
    yield BY_NU, "nu", _peak(kind, 0.25, 1.0 - off), "nu rises above 1"
    yield mushroom, "w", _peak(kind, 0.25, 1.0 - off), "w rises above r"
    yield mushroom, "r", kind(0.5 * (1.0 + off), 1.0), "r sinks below w"
    meet = "the sides meet above the floor"
    yield stem, "slope", _peak(kind, -0.25, 0.8 * (1.0 - off)), meet
    yield mushroom, "slope", _peak(kind, -0.25, 0.5 * (1.0 - off)), meet
    yield {**stem, "slope": 0.4}, "h", _peak(kind, 1.0, 2.5 * (1.0 - off)), meet
    yield {**stem, "slope": 0.4}, "w", kind(0.5 * (1.0 + off), 1.0), meet
    yield {**BY_NU, "slope": 0.25}, "r", kind(0.5 * (1.0 + off), 1.0), meet


def broken_as_written() -> Iterator[JudgedScene]:
    """Make scenes whose laws do not fit each other, or are none."""
    cap, mushroom = RESTING["cap"], RESTING["mushroom"]
    for longer in (1.5, 2.0):
        others: tuple[tuple[Kind, Data], ...] = (
            (_wave, {**_wave(0.9, 1.1), "period": longer}),
            (_legs, {"kind": "bang-bang", "knots": [[0.0, 1.1], [1.0, 0.9], [longer, 1.1]]}),
        )
        for kind, other in others:
            scene = {**mushroom, "r": kind(0.75, 1.0), "h": other}
            yield JudgedScene(scene, "two laws have different periods")
    jump, back = [[0.0, 1.0], [0.5, 1.25], [1.0, 1.5]], [[0.0, 1.0], [0.75, 1.25], [0.5, 1.0]]
    for knots, why in ((jump, "a law jumps"), (back, "a law's time runs back")):
        yield JudgedScene({**cap, "r": {"kind": "bang-bang", "knots": knots}}, why)
    yield JudgedScene({**mushroom, "nu": 0.5}, "both w and nu are given")
    for name in ("r", "w", "h"):
        without = {part: law for part, law in mushroom.items() if part != name}
        yield JudgedScene(without, f"{name} is missing")
        for size in (0.0, -1.0):
            yield JudgedScene({**mushroom, name: size}, f"{name} is {size}")
    yield JudgedScene({**mushroom, "w": 1.25}, "w is greater than r")
    yield JudgedScene({**BY_NU, "nu": 1.25}, "nu is greater than 1")
    yield JudgedScene({**mushroom, "slope": 0.5}, "the sides meet at the floor")


def valid_though_near() -> Iterator[JudgedScene]:
    """Make valid scenes that ranges of their laws do not show to be valid, and mouths as wide as the cap."""
    stem, mushroom = RESTING["stem"], RESTING["mushroom"]
    for kind in (_wave, _legs):
        yield JudgedScene({**mushroom, "r": kind(0.75, 1.25), "w": kind(0.7, 1.2)}, "")
        yield JudgedScene({**stem, "w": kind(0.5, 1.5), "h": kind(1.0, 2.0), "slope": 0.45}, "")
        yield JudgedScene({**stem, "h": kind(0.5, 1.5), "slope": _peak(kind, 0.25, 0.9)}, "")
    yield JudgedScene({**mushroom, "w": 1.0}, "")
    yield JudgedScene({**BY_NU, "nu": 1.0}, "")
