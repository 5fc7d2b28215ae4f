"""`mushrooms verify`: a trajectory of one's own, step by step; a picture of the first step that is false."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import msgspec

import reference
from conformance import verify as verifier
from conformance.audit.runs import scene_named
from conformance.cases.draw import wire_form
from conformance.files import write_file
from conformance.suite.sheet_files import read_number, read_rows
from mushrooms import output
from scene import State, from_data
from scene.refusal import BadInput, shown

FIELDS = ("t", "x", "y", "vx", "vy")


def verify_file(file: Path, scene: str | None, picture: Path | None) -> int:
    """Judge each step of a trajectory from the state before it, and return the exit code."""
    if picture is not None:
        output.check_file(picture, (".svg",))
    text = _read(file, scene)
    verdicts = _judge(file, text)
    for place, status, reason in verdicts:
        print(f"{place}: {status}: {reason}")
    n_proved = sum(status == "proved" for _, status, _ in verdicts)
    print(f"{n_proved} of {len(verdicts)} proved")
    wrong = next((i for i, (_, status, _) in enumerate(verdicts) if status == "false"), None)
    if picture is not None and wrong is not None:
        write_file(picture, _draw(json.loads(text), wrong))
        print(f"Picture of step {wrong + 1}: {picture}")
    return int(n_proved < len(verdicts))


def _read(file: Path, scene: str | None) -> str:
    """Return a trajectory as the verifier takes it: a JSON file as it is, a CSV file as JSON."""
    try:
        if file.suffix != ".csv":
            if scene is not None:
                raise BadInput(f"--scene = {scene!r} would change nothing here: the JSON file has its scene")
            return file.read_text("utf-8")
        if scene is None:
            raise BadInput(f"trajectory {str(file)!r}: a CSV file needs --scene")
        return json.dumps(_of_rows(file, scene))
    except OSError as error:
        raise BadInput(f"trajectory {str(file)!r} cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise BadInput(f"trajectory {str(file)!r}: {error}") from None


def _of_rows(file: Path, scene: str) -> dict[str, Any]:
    label, states = f"trajectory {str(file)!r}", []
    for place, row in read_rows(file, label, FIELDS):
        numbers = {name: read_number(place, name, row[name]) for name in FIELDS}
        states.append({**numbers, "wall": row.get("wall") or None})
    if not states:
        raise BadInput(f"{label}: there is no row")
    return {"scene": wire_form(scene_named(scene)), "state": states[0], "steps": states[1:]}


def _judge(file: Path, text: str) -> list[tuple[str, str, str]]:
    """Return place, status and reason of each step."""
    errors = verifier.Unreadable, verifier.Refused, verifier.Unproved
    try:
        return [(place, v.status, v.reason) for place, v in verifier.verify_answers(text)]
    except (*errors, ValueError, RecursionError) as error:
        raise BadInput(f"trajectory {str(file)!r}: {error}") from None


def _draw(data: dict[str, Any], at: int) -> bytes:
    """Draw a step as it was given, and as the reference has it."""
    from mushrooms.figures import case  # drawing takes a second to import

    begin = data["steps"][at - 1] if at else data["state"]
    state = msgspec.convert({name: begin.get(name) for name in (*FIELDS, "wall")}, State)
    given, scene = data["steps"][at], from_data(data["scene"])
    found = reference.next_collision(scene, state, float(data.get("t_end", 1e300)))
    if not isinstance(found, reference.Collision | reference.Horizon):
        raise BadInput(f"--picture: step {at + 1} from {shown(str(state))} has no certified end to draw")
    return case.step(scene, state, found.rounded(), given)
