"""Promises on requests: one asked again, a field left out, lines that are none, fields that nobody knows."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from conformance.suite.process import Trouble
from conformance.suite.promises.questions import INSIDE, STANDING, is_same, offered, question, repeated
from conformance.suite.session import Session, missing
from scene import Scene, to_data

# Lines that are no requests, and the seq that can be read in them.
MALFORMED: tuple[tuple[bytes, int | None], ...] = (
    (b"what?", None),
    (b'{"cmd":"step","seq":1', None),
    (b"[1,2]", None),
    (b"5", None),
    (b"null", None),
    (b'"stop"', None),
    (b"{}", None),
    (b'{"seq":2}', 2),
    (b'{"cmd":"dance","seq":3}', 3),
    (b'{"cmd":"step","seq":4}', 4),
    (b'{"cmd":"step","seq":5,"scene":{},"state":[],"t_end":"soon"}', 5),
)


def _one(session: Session) -> tuple[Scene, dict[str, Any], dict[str, Any]]:
    """Ask one plain question, and return its scene, the request and the answer."""
    scene = offered(session, STANDING, "step")
    request = question("step", scene, INSIDE[type(scene)], t_end=100.0)
    answer = repeated(session, request)
    if answer.get("outcome") == "undecided":
        raise Trouble("declined", f"undecided: {answer['reason']}")
    if answer.get("outcome") != "collision":
        raise Trouble("fail", f"a state inside is answered {answer}"[:200])
    return scene, request, answer


def repeated_questions(session: Session) -> str:
    """A question asked again has the same answer, to the bit, in every command."""
    told = {cmd: repeated(session, request) for cmd, request, _ in _with_and_without_wall(session)}
    return f"the answer is the same: {', '.join(told)}"


def _with_and_without_wall(session: Session) -> Iterator[tuple[str, dict[str, Any], dict[str, Any]]]:
    """Return what is offered of each command's questions about one state, with its wall null and without."""
    scene, request, _ = _one(session)
    assert session.introduction is not None
    more: dict[str, dict[str, Any]] = {"step": {}, "trajectory": {"collisions": 3}, "flow": {}}
    state = request.pop("state")
    nameless = {name: value for name, value in state.items() if name != "wall"}
    for cmd in more:
        if not missing(session.introduction, cmd, to_data(scene)):
            told, bare = (
                {
                    **request,
                    "cmd": cmd,
                    **more[cmd],
                    **({"states": [one]} if cmd == "flow" else {"state": one}),
                }
                for one in (state, nameless)
            )
            yield cmd, told, bare


def absent_wall(session: Session) -> str:
    """A state without `wall` is one whose wall is null, in every command."""
    offering = []
    for cmd, told, bare in _with_and_without_wall(session):
        offering.append(cmd)
        answer, without = repeated(session, told), session.ask(bare)
        if not is_same(without, answer):
            raise Trouble("fail", f"{cmd}: without wall {without}, with null {answer}")
    return f"the answer is the same: {', '.join(offering)}"


def malformed_lines(session: Session) -> str:
    """What is no request is refused, and the next line is answered as ever."""
    _, request, answer = _one(session)
    for line, seq in MALFORMED:
        shown = line.decode("ascii")
        try:
            refusal = session.say(line, seq)
            after = session.ask(request)
        except Trouble as trouble:
            raise Trouble(trouble.verdict, f"{shown}: {trouble.why}") from None
        if refusal.get("outcome") != "rejected":
            raise Trouble("fail", f"{shown}: answered {refusal}, must be rejected")
        if not is_same(after, answer):
            raise Trouble("fail", f"after {shown} a question is answered {after}, before it {answer}")
    return f"{len(MALFORMED)} lines refused"


def extra_fields(session: Session) -> str:
    """A field that the protocol does not know is refused, or changes nothing."""
    _, request, answer = _one(session)
    unknown = {"hint": 7.0}
    asked = {
        "request": {**request, **unknown},
        "state": {**request, "state": {**request["state"], **unknown}},
        "scene": {**request, "scene": {**request["scene"], **unknown}},
    }
    refused = []
    for place, changed in asked.items():
        found = session.ask(changed, request["scene"])
        if found.get("outcome") == "rejected":
            refused.append(place)
        elif not is_same(found, answer):
            raise Trouble("fail", f"with a further field in the {place} {found}, without {answer}")
    return f"refused in: {', '.join(refused) or 'none'}; elsewhere ignored"
