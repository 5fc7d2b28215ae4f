"""Protocol 1 as `python -m reference` and `python -m fast` serve it."""

from __future__ import annotations

import io
import json
import math
import struct
import subprocess
import sys

import msgspec
import pytest
from support.edges import EDGES, asked, is_among
from test_conformance_fuzz import SERVERS

from scene import Horizon, load, to_data
from scene.protocol.messages import Timed
from scene.protocol.wire import serve

STATE = {"t": 0.0, "x": 0.1, "y": 0.3, "vx": 10.0, "vy": 7.0, "wall": None}
SCENE = to_data(load("moving-cap"))


def ask(module, *lines):
    """Return a server's answers to lines."""
    out = io.BytesIO()
    sent = (line if isinstance(line, str) else json.dumps(line) for line in lines)
    SERVERS[module]((line.encode() + b"\n" for line in sent), out)
    return [json.loads(line) for line in out.getvalue().splitlines()]


def step(seq, scene=SCENE, **changes):
    return {"cmd": "step", "seq": seq, "scene": scene, "state": {**STATE, **changes}, "t_end": 100.0}


@pytest.fixture(params=["reference", "fast"])
def module(request):
    return request.param


@pytest.mark.parametrize("server", SERVERS)
def test_the_edges_of_the_protocol(server):
    none = json.dumps(asked("trajectory", collisions=0)).replace('"seq": 7', '"seq": -0')
    lines = '{"cmd":"echo","values":[-0,0]}', none.replace('"collisions": 0', '"collisions": -0')
    answers = ask(server, *(question for question, _ in EDGES), *lines)
    for (question, allowed), answer in zip(EDGES, answers, strict=False):
        assert is_among(answer, allowed), (question, answer)
    assert len(answers) == len(EDGES) + len(lines)
    assert [math.copysign(1.0, value) for value in answers[-2]["values"]] == [-1.0, 1.0]
    assert answers[-1] == {"seq": 0, "steps": []}


def test_session(module):
    numbers = [0.1, 5e-324, -0.0, 1.7976931348623157e308, 2.0**53 + 2, 1 / 3, -1e-310]
    lines = (
        {"cmd": "start", "protocol": 1},
        {"cmd": "echo", "values": numbers},
        step(1),
        {"cmd": "stop"},
        {"cmd": "echo", "values": []},
    )
    text = "".join(json.dumps(line) + "\n" for line in lines)
    run = subprocess.run(
        [sys.executable, "-m", module], input=text, capture_output=True, text=True, timeout=120, check=True
    )
    assert run.stderr == ""
    start, echo, one = (json.loads(line) for line in run.stdout.splitlines())
    assert start["name"] == module
    assert set(start["tables"]) == {"cap", "stem", "mushroom"}
    assert [struct.pack("<d", v) for v in echo["values"]] == [struct.pack("<d", v) for v in numbers]
    assert (one["seq"], one["outcome"], one["wall"]) == (1, "collision", "arc")


def test_what_is_never_met_is_timed_up_to_a_number(module):
    """A particle at rest has no last collision; a horizon at infinity had been written as null."""
    rest = {**STATE, "vx": 0.0, "vy": 0.0}
    still = {"table": "cap", "r": 2.0}
    (answer,) = ask(
        module, {"cmd": "time", "seq": 1, "scene": still, "state": rest, "collisions": 2, "repeat": 1}
    )
    (last,) = msgspec.convert(answer, Timed).steps
    assert isinstance(last, Horizon)
    assert (last.x, last.y, last.vx, last.vy) == (rest["x"], rest["y"], 0.0, 0.0)


BAD = [
    ("not json", "JSON"),
    ("{}", "cmd"),
    ('{"cmd":"dance"}', "dance"),
    ('{"cmd":"step","seq":3}', "scene"),
    (step(3, x="0.1"), "state.x"),
    ({**step(3), "state": {name: STATE[name] for name in STATE if name != "vy"}}, "vy"),
    ({**step(3), "extra": 1}, "extra"),
    (step(3, z=1.0), "z"),
    (step(3, scene={**SCENE, "table": "cup"}), "cup"),
    (step(3, scene={**SCENE, "nu": 1.5}), "nu <= 1"),
    (step(3, scene=3), "int"),
    (step(3, y=9.0), "beyond wall arc"),
    (step(3, wall="lid"), "lid"),
    ("[" * 5000, "object"),
    ({"cmd": "start", "protocol": 2}, "protocol = 2"),
    ({**step(3), "cmd": "trajectory", "collisions": -1}, "collisions = -1"),
    (json.dumps(step(3)).replace("10.0", "NaN"), "JSON"),
    (json.dumps(step(3)).replace("10.0", "1e999"), "range"),
]


def test_bad_lines_are_rejected_and_the_session_goes_on(module):
    found = ask(module, *(line for bad, _ in BAD for line in (bad, step(4))))
    for (_, word), bad, good in zip(BAD, found[::2], found[1::2], strict=True):
        assert (bad["outcome"], good["outcome"], good["seq"]) == ("rejected", "collision", 4)
        assert word in bad["reason"]
        assert "\n" not in bad["reason"]


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (MemoryError(), "MemoryError"),
        (EOFError("Ran out of input"), "EOFError: Ran out of input"),
        (
            OSError(28, "No space left on device", "kept"),
            "OSError: [Errno 28] No space left on device: 'kept'",
        ),
    ],
)
def test_what_the_machine_refuses_is_owned_to_and_the_session_goes_on(error, told):
    def refused(*_):
        raise error

    out = io.BytesIO()
    lines = [json.dumps(step(seq)).encode() + b"\n" for seq in (1, 2)]
    serve("s", refused, refused, lines, out)
    assert [json.loads(line) for line in out.getvalue().splitlines()] == [
        {"seq": 1, "error": told},
        {"seq": 2, "error": told},
    ]
