"""`mushrooms verify`: a trajectory of one's own, step by step; a picture of the first step that is false."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import msgspec
import typer

import reference
from conformance import verify as verifier
from conformance.audit.runs import scene_named
from conformance.cases.draw import wire_form
from conformance.files import write_file
from conformance.suite.sheet import read_number, read_rows
from mushrooms import output
from scene import State, from_data
from scene.refusal import BadInput, shown

FIELDS = ("t", "x", "y", "vx", "vy")


def verify(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A CSV file, or JSON as in docs/corpus.md.")],
    scene: Annotated[
        str | None, typer.Option(metavar="SCENE", help="Scene of a CSV file. Its first row is the start.")
    ] = None,
    picture: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw the first false step (.svg).")
    ] = None,
) -> None:
    """Check a trajectory computed in floating point. Each step is judged from the state before it.

    Exit code 0 if every step is proved, 1 if one is not, 2 on bad input.
    """
    if picture is not None:
        output.check_file(picture, (".svg",))
    label = f"trajectory {str(file)!r}"
    if (file.suffix == ".csv") != (scene is not None):
        raise BadInput(f"{label}: a CSV file needs --scene, a JSON file has its own")
    try:
        text = file.read_text("utf-8") if scene is None else json.dumps(_of_rows(file, label, scene))
        verdicts = list(verifier.verify_answers(text))
    except OSError as error:
        raise BadInput(f"{label} cannot be read: {error.strerror}") from None
    except BadInput:
        raise
    except (verifier.Refused, verifier.Unproved, ValueError, RecursionError) as error:
        raise BadInput(f"{label}: {error}") from None
    for place, verdict in verdicts:
        print(f"{place}: {verdict.status}: {verdict.reason}")
    n_proved = sum(verdict.status == "proved" for _, verdict in verdicts)
    print(f"{n_proved} of {len(verdicts)} proved")
    wrong = next((i for i, (_, verdict) in enumerate(verdicts) if verdict.status == "false"), None)
    if picture is not None and wrong is not None:
        write_file(picture, _draw(json.loads(text), wrong))
        print(f"Picture of step {wrong + 1}: {picture}")
    raise typer.Exit(int(n_proved < len(verdicts)))


def _of_rows(file: Path, label: str, scene: str) -> dict[str, Any]:
    """Return a CSV file as the verifier takes a trajectory."""
    states = []
    for place, row in read_rows(file, label, FIELDS):
        numbers = {name: read_number(place, name, row[name]) for name in FIELDS}
        states.append({**numbers, "wall": row.get("wall") or None})
    if not states:
        raise BadInput(f"{label}: there is no row")
    return {"scene": wire_form(scene_named(scene)), "state": states[0], "steps": states[1:]}


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
