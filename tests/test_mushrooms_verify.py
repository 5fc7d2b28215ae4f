"""`mushrooms verify`: a trajectory of one's own, and a picture of its first false step."""

import json

import msgspec
import pytest
from support.refusals import assert_refused

import scene as scenes
from conformance import plain
from scene import State

START = State(0.0, 0.1, 0.2, 3.0, 4.0)


@pytest.fixture
def rows():
    hits = plain.trajectory(scenes.load("moving-cap"), START, 4, 1e9)
    return [START, *hits]


def write(path, rows):
    lines = [f"{s.t!r},{s.x!r},{s.y!r},{s.vx!r},{s.vy!r},{s.wall or ''}" for s in rows]
    path.write_text("\n".join(["t,x,y,vx,vy,wall", *lines]))
    return path


def test_a_right_trajectory_is_proved_and_a_false_step_is_drawn(rows, tmp_path, command_line):
    path, picture = write(tmp_path / "steps.csv", rows), tmp_path / "false.svg"
    arguments = ("verify", path, "--scene", "moving-cap", "--picture", picture)
    assert command_line(*arguments)[0] == 0
    assert not picture.exists()
    write(path, [*rows[:2], msgspec.structs.replace(rows[2], x=rows[2].x + 0.01)])
    code, out, _ = command_line(*arguments)
    assert code == 1
    assert "step 2: false" in out
    assert picture.read_text().startswith("<?xml")


def test_json_is_what_the_verifier_takes(rows, tmp_path, command_line):
    wire = scenes.to_data(scenes.load("moving-cap"))
    fields = ("t", "x", "y", "vx", "vy", "wall")
    states = [{name: getattr(row, name) for name in fields} for row in rows]
    scene = {name: law for name, law in wire.items() if name not in ("name", "notes")}
    data = {"scene": scene, "state": states[0], "steps": states[1:]}
    path = tmp_path / "steps.json"
    path.write_text(json.dumps(data))
    code, out, _ = command_line("verify", path)
    assert (code, out.splitlines()[-1]) == (0, "4 of 4 proved")


@pytest.mark.parametrize(
    ("content", "options", "message"),
    [
        ("{", [], "Expecting"),
        ("{}", [], "scene"),
        ('{"scene": {"table": "cap", "r": 1.0}, "steps": [], "steps": []}', [], "a key comes twice"),
        ("t,x,y,vx,vy\n0,0,0,1,1", [], "needs --scene"),
        ("t,x,y,vx\n0,0,0,1", ["--scene", "moving-cap"], "column 'vy' is missing"),
        (
            "t,x,y,vx,vy\n0,0,0,1,up",
            ["--scene", "moving-cap"],
            "steps.csv':2: vy = 'up', must be a finite number",
        ),
    ],
)
def test_a_bad_trajectory_is_refused_in_one_line(content, options, message, tmp_path, command_line):
    path = tmp_path / ("steps.json" if content[0] == "{" else "steps.csv")
    path.write_text(content)
    assert_refused(command_line("verify", path, *options), message)
    assert_refused(command_line("verify", tmp_path / "none.json"), "cannot be read")
