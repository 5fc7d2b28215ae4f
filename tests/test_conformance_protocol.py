"""Protocol 1 as `python -m reference` and `python -m fast` serve it."""

from __future__ import annotations

import io
import json
import math
import struct
import subprocess
import sys
import threading
from contextlib import ExitStack

import msgspec
import pytest
from support.edges import EDGES, asked, is_among

import fast
import reference
from scene import Horizon, State, catalogue, load, to_data
from scene.protocol.messages import Timed
from scene.protocol.wire import serve

STATE = {"t": 0.0, "x": 0.1, "y": 0.3, "vx": 10.0, "vy": 7.0, "wall": None}
SCENE = to_data(load("moving-cap"))


def converse(module, *lines):
    """Send lines to a server of their own, return the answers; it must end by itself and be silent."""
    text = "\n".join(line if isinstance(line, str) else json.dumps(line) for line in lines) + "\n"
    run = subprocess.run(
        [sys.executable, "-m", module], input=text, capture_output=True, text=True, timeout=120, check=True
    )
    assert run.stderr == ""
    return [json.loads(line) for line in run.stdout.splitlines()]


@pytest.fixture(scope="module")
def ask():
    """Send lines to a server that has answered others before, return the answers; it says nothing else."""
    with ExitStack() as stack:
        started = {}

        def asked(module, *lines):
            if module not in started:
                pipe, command = subprocess.PIPE, [sys.executable, "-m", module]
                server = subprocess.Popen(
                    command, stdin=pipe, stdout=pipe, stderr=subprocess.STDOUT, text=True
                )
                started[module] = stack.enter_context(server)
            limit = threading.Timer(120.0, started[module].kill)
            limit.start()
            answers = []
            for line in lines:
                text = line if isinstance(line, str) else json.dumps(line)
                print(text, file=started[module].stdin, flush=True)
                answers.append(json.loads(started[module].stdout.readline()))
            limit.cancel()
            return answers

        yield asked
    assert all(server.returncode == 0 for server in started.values())


def step(seq, scene=SCENE, **changes):
    return {"cmd": "step", "seq": seq, "scene": scene, "state": {**STATE, **changes}, "t_end": 100.0}


@pytest.fixture(params=["reference", "fast"])
def module(request):
    return request.param


@pytest.mark.parametrize("server", ["reference", "fast", "conformance.plain"])
def test_the_edges_of_the_protocol(server, ask):
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
    start, echo, one, two = converse(
        module,
        {"cmd": "start", "protocol": 1},
        {"cmd": "echo", "values": numbers},
        step(1),
        step(2, vx=0.0, vy=0.0),
        {"cmd": "stop"},
        {"cmd": "echo", "values": []},
    )
    assert start["protocol"] == 1
    assert start["name"] == module
    assert set(start["tables"]) == {"cap", "stem", "mushroom"}
    assert [struct.pack("<d", v) for v in echo["values"]] == [struct.pack("<d", v) for v in numbers]
    assert (one["seq"], one["outcome"], one["wall"]) == (1, "collision", "arc")
    assert two["seq"] == 2
    assert two["outcome"] in ("collision", "horizon")


def test_answers_are_those_of_the_package(module, ask):
    """Shortest round-trip printing: what arrives has the same bits."""
    (answer,) = ask(module, step(7))
    state = State(**STATE)
    if module == "fast":
        expected = fast.next_collision(load("moving-cap"), state, 100.0)
    else:
        expected = reference.next_collision(load("moving-cap"), state, 100.0).rounded()
    assert all(answer[name] == getattr(expected, name) for name in ("wall", "dt", "t", "x", "y", "vx", "vy"))


def test_trajectories_are_chained(module, ask):
    line = {"cmd": "trajectory", "seq": 5, "scene": SCENE, "state": STATE, "collisions": 6, "t_end": 100.0}
    six, short, bad = ask(module, line, {**line, "t_end": 0.5}, {**line, "collisions": -1})
    assert six["seq"] == 5
    assert [s["outcome"] for s in six["steps"]] == ["collision"] * 6
    state = State(**STATE)
    for s in six["steps"]:
        one = fast.next_collision(load("moving-cap"), state, 100.0)
        assert (s["wall"], s["dt"]) == (one.wall, pytest.approx(one.dt, rel=1e-9))
        state = State(s["t"], s["x"], s["y"], s["vx"], s["vy"], s["wall"])
    assert short["steps"][-1]["outcome"] == "horizon"
    assert short["steps"][-1]["t"] == 0.5
    assert bad["outcome"] == "rejected"
    assert "collisions = -1" in bad["reason"]


def test_what_is_never_met_is_timed_up_to_a_number(module, ask):
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
    (json.dumps(step(3)).replace("10.0", "NaN"), "JSON"),
    (json.dumps(step(3)).replace("10.0", "1e999"), "range"),
]


@pytest.fixture(scope="module", params=["reference", "fast"])
def replies(request, ask):
    """The answers of one session to all bad lines, each followed by a good one."""
    found = ask(request.param, *(line for bad, _ in BAD for line in (bad, step(4))))
    return list(zip(found[::2], found[1::2], strict=True))


@pytest.mark.parametrize("i", range(len(BAD)), ids=[words for _, words in BAD])
def test_bad_lines_are_rejected_and_the_session_goes_on(replies, i):
    bad, good = replies[i]
    assert bad["outcome"] == "rejected"
    assert BAD[i][1] in bad["reason"]
    assert "\n" not in bad["reason"]
    assert good["seq"] == 4
    assert good["outcome"] == "collision"


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


def test_every_catalogue_scene_is_served(module, ask):
    names = [name for name in catalogue() if name != "moving-cap-as-printed"]
    scenes = [to_data(load(name)) for name in names]
    starts = [{"y": -0.3} if scene["table"] == "stem" else {} for scene in scenes]
    answers = ask(module, *(step(i, s, **c) for i, (s, c) in enumerate(zip(scenes, starts, strict=True))))
    assert [a["seq"] for a in answers] == list(range(len(names)))
    assert {a["outcome"] for a in answers} == {"collision"}
