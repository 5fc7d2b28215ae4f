"""The benchmark measures what it says: workloads, grades, growth, records."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path

import msgspec
import pytest
from support.schemas import validator
from support.truth import proved_step

import fast
from conformance.bench import growth, measure, record, workloads
from conformance.bench.solvers import Solver, SolverRun, by_call
from conformance.bench.time_stepping import next_collision_by
from conformance.suite.process import Trouble
from mushrooms import bench_solvers as ours
from scene import BadInput, Collision, Horizon, Undecided

DOCS = Path(__file__).parent.parent / "docs"
BRIEF = measure.Effort(repeats=3, least_ns=1.0, most_ns=1e9)


@pytest.fixture(scope="module")
def drawn() -> dict[str, workloads.Workload]:
    return {rule.name: workloads.draw_workload(rule, 7, 3, proved_step) for rule in workloads.RULES}


def tried(workload, *these):
    return measure.measure(workload, these, BRIEF, lambda _: None)


def measured(workload, *these):
    points, troubles = tried(workload, *these)
    assert not troubles
    return points


@pytest.mark.parametrize("name", workloads.NAMES)
def test_answers_of_a_workload_are_proved_collisions(drawn, name):
    for question in drawn[name].questions:
        again = proved_step(drawn[name].scene, question.state, question.t_end, 60)
        assert again.outcome == question.truth.outcome == "collision"
        (step,), (once_more,) = question.truth.steps, again.steps
        assert step.wall == once_more.wall
        assert abs(step.centre("dt") - once_more.centre("dt")) <= step.centre("dt") / 10**50


def test_a_seed_draws_the_same_questions(drawn):
    rule = workloads.RULES[0]
    again = workloads.draw_workload(rule, 7, 2, proved_step)
    other = workloads.draw_workload(rule, 8, 2, proved_step)
    assert [q.state for q in again.questions] == [q.state for q in drawn[rule.name].questions[:2]]
    assert [q.state for q in other.questions] != [q.state for q in again.questions]


def test_workloads_are_what_their_names_say(drawn):
    def speeds(name: str) -> list[float]:
        return [math.hypot(q.state.vx, q.state.vy) for q in drawn[name].questions]

    for name, energy in (("moving-cap-1e4", 1e4), ("moving-cap-1e7", 1e7), ("moving-cap-1e12", 1e12)):
        # One collision changes the speed by twice the walls' at most.
        assert speeds(name) == pytest.approx([math.sqrt(2 * energy)] * 3, abs=10.0)
    assert max(speeds("slow")) < 10.0
    for q in drawn["grazing"].questions:
        s = q.state
        assert s.wall == "arc"
        assert abs(s.x * s.vx + s.y * s.vy) < 0.1 * math.hypot(s.x, s.y) * math.hypot(s.vx, s.vy)


def test_speed_and_error_come_from_the_same_laps(drawn):
    workload = drawn["moving-cap-1e7"]
    (proof, careful, lanes) = measured(
        workload,
        *(c for c in ours.our_solvers() if c.name in ("proof, 30 digits", "fast, careful", "fast, lanes")),
    )
    assert (proof.right, careful.right, lanes.right + lanes.left) == (3, 3, 3)
    assert max(proof.relative) < 1e-30
    assert all(u is not None and u <= 4.0 for u in careful.ulps + lanes.ulps)
    assert len(proof.ns) == len(careful.ns) == 3
    assert min(proof.ns) > min(careful.ns)


@pytest.mark.parametrize(
    ("spoil", "counts"),
    [
        (lambda c: Collision("floor", c.dt, c.t, c.x, c.y, c.vx, c.vy), (0, 3, 0)),
        (lambda c: Horizon(c.t, c.x, c.y, c.vx, c.vy), (0, 3, 0)),
        (lambda c: Collision(c.wall, math.nan, c.t, c.x, c.y, c.vx, c.vy), (0, 3, 0)),
        (lambda _: Undecided("shy"), (0, 0, 3)),
        (lambda c: c, (3, 0, 0)),
    ],
)
def test_a_spoilt_solver_is_seen(drawn, spoil, counts):
    workload = drawn["breathing-disk"]
    spoilt = by_call("spoilt", "compiled", lambda *question: spoil(fast.next_collision(*question)))
    (point,) = measured(workload, spoilt)
    assert (point.right, point.wrong, point.undecided) == counts


def test_walls_of_further_steps_are_compared(drawn):
    steps = [workloads.FurtherStep(q.state, "arc") for q in drawn["breathing-disk"].questions]
    workload = drawn["breathing-disk"]._replace(further=steps)
    met = fast.next_collision(workload.scene, steps[0].state, workload.questions[0].t_end)

    def answers(scene, states):
        return [met, msgspec.structs.replace(met, wall="base"), None]

    stepper = by_call("fast", "compiled", fast.next_collision)
    (point, other) = measured(workload, stepper._replace(steps=answers), stepper)
    assert (point.further, point.astray) == (2, 1)
    assert (other.further, other.astray) == (0, 0)


def test_a_small_error_is_measured(drawn):
    def off(*question):
        c = fast.next_collision(*question)
        return Collision(c.wall, c.dt * (1 + 1e-9), c.t, c.x, c.y, c.vx, c.vy)

    (point,) = measured(drawn["moving-cap-1e4"], by_call("off", "compiled", off))
    assert point.relative == pytest.approx([1e-9] * 3, rel=1e-3)
    assert all(u is not None and u > 1e4 for u in point.ulps)


def test_time_stepping_is_right_where_it_is_easy_and_wrong_where_it_skips(drawn):
    easy = measured(drawn["moving-cap-1e4"], by_call("s", "time-stepping", next_collision_by(1e-9)))[0]
    assert easy.right == 3
    assert max(easy.relative) < 1e-8
    # Hops along the arc: it is left with a rounding error for a gap, and met again within one of its steps.
    hop = drawn["grazing"].questions
    met = [next_collision_by(1e-6)(drawn["grazing"].scene, q.state, q.t_end) for q in hop]
    errors = [
        1.0 if m.wall != step.wall else abs(m.dt / float(step.centre("dt")) - 1)
        for m, step in zip(met, (q.truth.steps[0] for q in hop), strict=True)
    ]
    assert max(errors) > 0.5


def test_a_clock_that_never_ticks_says_no_speed(drawn):
    still = Solver("still", "command", lambda *_: SolverRun(0.0, [Undecided("")] * 3, 0.0))
    points, troubles = tried(drawn["slow"], still)
    assert not points
    assert troubles == {"still": "fail: a run is said to last 0 ns in all"}


def test_a_place_beyond_all_numbers_is_kept(drawn):
    largest = sys.float_info.max

    def far(*question):
        return Collision(fast.next_collision(*question).wall, *[largest, -largest] * 3)

    (point,) = measured(drawn["breathing-disk"], by_call("far", "compiled", far))
    assert (point.right, point.relative) == (3, (1e308,) * 3)
    kept = msgspec.json.decode(msgspec.json.encode(point), type=record.Point)
    assert kept == point


def test_a_solver_that_changes_its_answers_is_left_out(drawn):
    answers = iter(range(100))

    def fickle(workload, n_times):
        return SolverRun(1.0, [Undecided(str(next(answers)))] * 3, 1e9)

    points, troubles = tried(drawn["slow"], Solver("fickle", "command", fickle))
    assert not points
    assert troubles == {"fickle": "fail: its answers differ from run to run"}


def test_a_solver_that_breaks_off_is_left_out(drawn):
    calls = iter(range(100))

    def run(workload, n_times):
        if next(calls) > 2:
            raise Trouble("crashed", "gone")
        return SolverRun(1.0, [Undecided("")] * 3, 1e9)

    points, troubles = tried(drawn["slow"], Solver("brief", "command", run))
    assert not points
    assert troubles == {"brief": "crashed: gone"}


@pytest.mark.deep
def test_errors_grow_as_the_jacobians_say():
    followers = ours.our_followers()
    grown = growth.grow(followers, proved_step, ours.linearise, ours.prove_path, 3, 2, 24, lambda _: None)
    assert 0.05 < grown.rate < 1.0
    rough, fine = grown.followers["compensated (fast)"], grown.followers["double-double (fast)"]
    assert rough[-1] > 100 * rough[0]
    # Two precisions, one slope: the gap stays what it was.
    gaps = [math.log10(a / b) for a, b in zip(rough, fine, strict=True)]
    assert min(gaps) > 12
    assert all(error <= 4 * bound for error, bound in zip(rough, grown.bound, strict=True))
    assert grown.lasts["proof, 30 decimals"] <= grown.lasts["proof, 60 decimals"]


def test_a_wrong_wall_leaves_no_digit():
    def astray(scene, state, n):
        path = ours.prove_path(scene, state, n)
        return [*path[:3], path[3]._replace(wall="nowhere"), *path[4:]]

    grown = growth.grow(
        {"astray": astray}, proved_step, ours.linearise, ours.prove_path, 3, 1, 6, lambda _: None
    )
    assert grown.lasts == {"astray": 3.0}
    assert grown.followers["astray"][3:] == (1.0, 1.0, 1.0)


DRAWN = (record.Drawn("slow", "slow", "moving-cap", 1, 0),)


def a_point(ns: list[float], solver: str = "fast") -> record.Point:
    return record.Point("slow", solver, "compiled", 1, tuple(ns), 1, 0, 0, 0, 0, 0, (0.5,), (1e-16,))


def a_record(*points: record.Point) -> record.Record:
    grown = record.Growth("moving-cap", 1e4, 1, 1, {"a": (1e-16,)}, {"a": 1.0}, (1e-16,), 0.2)
    machine = record.this_machine({})
    return record.Record(3, "quick", 0, 1, 3, 230, machine, DRAWN, points, {}, grown, 1.0)


def test_a_record_meets_its_published_schema():
    data = json.loads((DOCS / "bench" / "bench.json").read_text("utf-8"))
    validator("bench").validate(data)
    del data["seed"]
    assert not validator("bench").is_valid(data)


def test_a_record_returns_whole(tmp_path):
    found = a_record(msgspec.structs.replace(a_point([1.0]), ulps=(None, 2.0)))
    path = tmp_path / "bench.json"
    path.write_bytes(record.encode(found))
    assert record.read(path) == found


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"{}", "missing required field"),
        (b"nonsense", "malformed"),
        (b"\xff", "bench.json"),
        (record.encode(a_record(a_point([0.0]))), "ns"),
        (record.encode(a_record(a_point([]))), "ns"),
        (record.encode(a_record(a_point([1e300]))), "ns"),
        (record.encode(a_record(msgspec.structs.replace(a_point([1.0]), wrong=-1))), "wrong"),
        (record.encode(a_record(msgspec.structs.replace(a_point([1.0]), relative=(-1.0,)))), "relative"),
        (record.encode(a_record(a_point([1.0]), a_point([2.0]))), "'fast' on 'slow' is twice"),
        (
            record.encode(a_record(msgspec.structs.replace(a_point([1.0]), workload="other"))),
            "'fast' on 'other' is of a workload that it does not name",
        ),
        (record.encode(msgspec.structs.replace(a_record(), format=1)), "format = 1, must be 3"),
    ],
)
def test_a_file_that_is_no_record_is_refused(tmp_path, content, words):
    path = tmp_path / "bench.json"
    path.write_bytes(content)
    with pytest.raises(BadInput, match=words):
        record.read(path)
    with pytest.raises(BadInput, match="No such file"):
        record.read(tmp_path / "none.json")
