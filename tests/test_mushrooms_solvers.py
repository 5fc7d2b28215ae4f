"""What the benchmark says of a solver's time: nanoseconds a collision, by each way of calling it."""

import io
import json
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import fast
from conformance.bench import baselines, workloads
from mushrooms import bench
from scene import Collision

RULE = next(rule for rule in workloads.RULES if rule.length == 0)
N_TIMES = 3


@pytest.fixture
def asked() -> Any:
    """Two questions of a workload, each answered by a step of the fast stepper."""
    scene = workloads.SCENES.get(RULE.scene) or workloads.load(RULE.scene)
    states = [workloads._draw_step(RULE, scene, f"time {i}", fast.next_collision)[0] for i in range(2)]
    questions = [SimpleNamespace(state=state, t_end=state.t + 1e9) for state in states]
    return SimpleNamespace(rule=RULE, scene=scene, questions=questions, end=lambda _: 7.0)


def test_lanes_are_timed_by_the_collisions_of_all_laps(asked, monkeypatch):
    counts = iter([[[1, 0, 2, 0, 0], [4, 0, 0, 0, 0]], [[5, 0, 0, 0, 0]], [[8, 0, 0, 0, 0]]])

    def carry(*_: Any) -> tuple[Any, float]:
        return SimpleNamespace(wall_counts=np.array(next(counts))), 0.25

    monkeypatch.setattr(bench, "carry", carry)
    monkeypatch.setattr(bench, "lane_steps", lambda _, states: [None for _ in states])
    assert bench._lanes(asked, N_TIMES) == (0.75 / 20 * 1e9, [None, None], 0.75e9)


@pytest.mark.parametrize("way", ["_careful", "_fine"])
def test_steps_are_timed_by_the_questions_of_all_laps(asked, way, monkeypatch):
    name = {"_careful": "careful_steps", "_fine": "fine_steps"}[way]
    given = getattr(bench, name)
    monkeypatch.setattr(bench, name, lambda *given_to: (given(*given_to)[0], 0.5))
    ns, answers, total = getattr(bench, way)(asked, N_TIMES)
    assert (ns, total) == (0.5 / (N_TIMES * 2) * 1e9, 0.5e9)
    assert len(answers) == 2


def test_a_path_is_timed_by_its_collisions_in_all_laps(asked, monkeypatch):
    asked.rule = RULE._replace(length=40)
    clock = iter([1000, 7000])
    monkeypatch.setattr(bench.time, "perf_counter_ns", lambda: next(clock))
    ns, answers, total = bench._trajectory(asked, N_TIMES)
    assert (ns, total) == (6000 / (N_TIMES * 40), 6000)
    assert all(isinstance(answer, Collision) for answer in answers)


def test_a_baseline_speaks_the_protocol(monkeypatch):
    """An adaptive integrator finds where a level path meets the arc of radius 1."""
    state = {"t": 0.0, "x": 0.0, "y": 0.5, "vx": 1.0, "vy": 0.0, "wall": None}
    step = {"cmd": "step", "seq": 1, "scene": {"table": "cap", "r": 1.0}, "state": state, "t_end": 9.0}
    lines = [{"cmd": "start", "protocol": 1}, step, {"cmd": "stop"}]
    sent = io.TextIOWrapper(io.BytesIO("".join(json.dumps(line) + "\n" for line in lines).encode()))
    heard = io.TextIOWrapper(io.BytesIO())
    monkeypatch.setattr(baselines.sys, "stdin", sent)
    monkeypatch.setattr(baselines.sys, "stdout", heard)
    name = next(name for name in baselines.NAMES if name.startswith("solve-ivp"))
    baselines.main([name])
    start, hit = map(json.loads, heard.buffer.getvalue().splitlines())
    assert start["name"] == name
    assert (hit["outcome"], hit["wall"]) == ("collision", "arc")
    assert abs(hit["x"] - 0.75**0.5) < 1e-2
