"""The first steps of a process are run by Python: the same bits as compiled code, and nothing is compiled."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import msgspec
import pytest
from numba import config
from support.faulty_steppers import answers_to

import fast
from conformance import vectors
from fast import __main__ as server
from fast.kernel import interpreting, path, single
from fast.kernel.interpreting import MOST_STEPS, Allowance
from scene import State, load, to_data

pytestmark = pytest.mark.skipif(config.DISABLE_JIT, reason="without the compiler Python runs every step")
ROOT = Path(__file__).parent.parent
START = State(0.0, 0.1, -0.5, 1.0, 3.0)

VECTORS = [*vectors.load("core")[::20], *vectors.load("extended")[::20], *vectors.load("stress")[::4]]
STEPS = [vector for vector in VECTORS if vector.kind == "step"]
CORPUS = [json.dumps(vectors.request(vector, seq)).encode() for seq, vector in enumerate(STEPS)]
PATH = {"cmd": "trajectory", "seq": 1, "collisions": 60, "state": msgspec.to_builtins(START)}
PATHS = [json.dumps({**PATH, "scene": to_data(load(name))}).encode() for name in ("moving-cap", "fermi-ulam")]


def answered(lines: list[bytes], monkeypatch: pytest.MonkeyPatch, n_by_python: int) -> list[Any]:
    """Answer questions, so many steps of each kind run by Python, although compiled code is at hand."""
    with monkeypatch.context() as patch:
        patch.setattr(interpreting, "is_at_hand", lambda _: False)
        for allowance in (single.allowance, *path.ALLOWANCES.values()):
            patch.setattr(allowance, "left", n_by_python)
        given = {"follow": server.follow, "flow": server.carry, "timer": server.clock}
        return [answers_to([line], step=fast.next_collision, **given) for line in lines]


@pytest.mark.parametrize("lines", [CORPUS, PATHS], ids=["steps", "paths"])
def test_python_gives_the_bits_of_compiled_code(lines, monkeypatch):
    assert answered(lines, monkeypatch, 10**6) == answered(lines, monkeypatch, 0)


def test_a_product_that_is_rounded_twice_is_seen(monkeypatch):
    """Python has no fused operation of its own before 3.13."""
    right = answered(CORPUS, monkeypatch, 10**6)
    names = interpreting._NAMES
    for each in names.values():
        if "fma" in each:
            monkeypatch.setitem(each, "fma", lambda a, b, c: a * b + c)
    assert answered(CORPUS, monkeypatch, 10**6) != right


FIRST = """
import json, os, sys
import fast
from fast.kernel import interpreting, path, scalar_step, single
from scene import State, load, to_data
scene, state = load("moving-cap"), State(0.0, 0.1, 0.5, 1.0, 3.0)
walls = [fast.next_collision(scene, state, 9.0).wall, *fast.trajectory(scene, state, 20).walls]
entries = [scalar_step.scalar_step, single.single, *path.PATHS.values()]
print(json.dumps([walls, sum(len(entry.signatures) for entry in entries)]))
"""


def test_the_first_questions_compile_nothing(tmp_path):
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-W", "error", "-c", FIRST]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    walls, n_compiled = json.loads(done.stdout)
    assert n_compiled == 0
    assert list(tmp_path.rglob("*.nbi")) == []
    scene, state = load("moving-cap"), State(0.0, 0.1, 0.5, 1.0, 3.0)
    assert walls[0] == walls[1]
    assert walls[1:] == fast.trajectory(scene, state, 20).walls


def test_python_runs_no_more_steps_than_are_worth_the_wait(monkeypatch):
    allowance = Allowance()
    monkeypatch.setattr(interpreting, "is_at_hand", lambda _: False)
    assert allowance.take(MOST_STEPS, single.single)
    assert not allowance.take(1, single.single)
    another = Allowance()
    assert not another.take(MOST_STEPS + 1, single.single)
    assert not another.take(1, single.single)


def test_what_is_compiled_before_is_taken(monkeypatch):
    allowance = Allowance()
    monkeypatch.setattr(interpreting, "is_at_hand", lambda _: True)
    assert not allowance.take(1, single.single)
    assert allowance.left == 0


def test_the_disk_is_looked_at_before_the_first_step_only(monkeypatch):
    looked = []
    monkeypatch.setattr(interpreting, "is_at_hand", looked.append)
    allowance = Allowance()
    assert all(allowance.take(1, single.single) for _ in range(5))
    assert looked == [single.single]
