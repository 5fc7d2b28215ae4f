"""The benchmark's baselines: right where most would be, caught where not, timed on what they follow."""

import math
import shutil
import sys
from contextlib import suppress

import numpy as np
import pytest
from support.depth import deep_but
from support.truth import proved_step
from test_conformance_bench import measured

import fast
from conformance import suite
from conformance.bench import baselines, scoreboard, workloads
from conformance.bench.scoreboard import Graded, page, reasons
from conformance.cases import scenes
from conformance.cases.draw import Draw
from conformance.harness import examples
from conformance.suite.process import CheckFailure
from conformance.suite.session import Limits
from scene import BadInput, Collision, Horizon, State, load


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    try:
        return baselines.build(tmp_path_factory.mktemp("baselines"), ["-O1"])[0]
    except CheckFailure as trouble:
        pytest.skip(trouble.why)


@pytest.fixture(scope="module")
def engine(library):
    return baselines.Engine(library)


def drawn(name: str, n_further: int, n_questions: int = 2) -> workloads.Workload:
    rule = next(rule for rule in workloads.RULES if rule.name == name)
    return workloads.draw_workload(rule, 3, n_questions, proved_step, n_further, fast.next_collision)


def points(workload, these):
    return {point.solver: point for point in measured(workload, *these)}


def fast_steps(table: str, n: int):
    """Yield a scene, a state and the careful step's collision, of particles faster than the walls."""
    for i in range(n):
        stream = Draw(f"baselines {table} {i}")
        of = scenes.scene(stream, table, scenes.clock(stream))
        start, t_end = scenes.state(stream, of, {"speed": 2.0**12, "lift": 0.2 + 0.6 * stream.part()})
        with suppress(ValueError):  # the draw may lie outside
            if isinstance(met := fast.next_collision(of, start, t_end), Collision):
                yield of, start, met


@pytest.mark.parametrize("table", ["cap", "stem", "mushroom"])
def test_the_lean_stepper_knows_every_table_and_law(engine, table):
    is_right = []
    for scene, state, met in fast_steps(table, 150):
        dt, t, x, y, vx, vy, wall = engine.hits(baselines.questions(scene, [state]))[0].tolist()
        is_right.append(baselines.WALLS[int(wall)] == met.wall)
        if is_right[-1]:
            assert (dt, t) == (pytest.approx(met.dt, rel=1e-9), pytest.approx(met.t, rel=1e-12))
            assert math.dist((x, y), (met.x, met.y)) <= 1e-9 * math.hypot(met.x, met.y)
            assert math.dist((vx, vy), (met.vx, met.vy)) <= 1e-9 * math.hypot(met.vx, met.vy)
    assert len(is_right) > 100
    assert is_right.count(False) <= 1


@pytest.mark.parametrize("row", range(5))  # r, width, its factor, h, slope
def test_a_law_that_is_misread_is_seen(engine, row):
    places = [(0.3, 300.0, 500.0), (-0.3, 300.0, -500.0), (-0.3, 900.0, -100.0), (0.4, 1000.0, -600.0)]
    asked = baselines.questions(load("moving-cap"), [State(0.5, 0.1, *place) for place in places])
    before = engine.hits(asked)
    asked.laws[row, 2] *= 0.9
    assert not np.array_equal(engine.hits(asked), before)


@pytest.mark.parametrize(
    "name", deep_but(["moving-cap-1e7", "two-harmonics", "moving-slope", "bang-bang"], "moving-cap-1e7")
)
def test_the_lean_one_is_right_and_time_steps_are_not(library, name):
    found = points(drawn(name, 300), baselines.in_c(library))
    lean = found["lean C"]
    assert (lean.right, lean.wrong, lean.further, lean.astray) == (2, 0, 300, 0)
    assert max(lean.relative) < 1e-13
    steps = [found[f"steps, flight/{parts}"] for parts in baselines.PARTS]
    assert steps[0].astray > 10
    assert steps[0].astray > steps[1].astray >= steps[2].astray
    assert all(point.further == 300 and min(point.ns) > 0 for point in steps)
    assert min(min(point.relative, default=1.0) for point in steps) > 1e-6


def test_no_checks_cost_walls_where_walls_are_fast_and_corners_near(library):
    ours = baselines.in_c(library)
    assert points(drawn("slow", 300, 1), ours)["lean C"].astray > 3
    assert points(drawn("near-corner", 100, 1), ours)["steps, flight/1000"].astray > 10


def test_one_path_is_followed_for_its_length(engine):
    workload = drawn("moving-cap-1e4", 0)
    asked = baselines.questions(workload.scene, [workload.questions[0].state])
    assert engine.follow(asked, math.inf, 50, 3)[0] == 150
    last = max(q.state.t for q in workload.questions)
    assert 10 * (workload.end(100.0) - last) == pytest.approx(workload.end() - last)
    n_hits, seconds = engine.follow(asked, workload.end(100.0), 10_000, 1)
    assert 50 < n_hits < 5000  # it may hop along the arc
    assert 0 < seconds < 1


def test_a_particle_that_meets_nothing_is_told(library, engine):
    scene, still = load("fermi-ulam"), State(0.0, 0.0, -0.5, 0.0, 0.0)
    assert engine.hits(baselines.questions(scene, [still]))[0, 6] == baselines.NONE
    assert isinstance(baselines.in_c(library)[0].steps(scene, [still])[0], Horizon)


def test_without_a_compiler_the_reason_is_told(monkeypatch, tmp_path):
    monkeypatch.setattr(baselines, "SOURCE", tmp_path / "absent.c")
    with pytest.raises(CheckFailure, match="it does not compile" if examples.shutil.which("cc") else "no C"):
        baselines.build(tmp_path, [])
    monkeypatch.setattr(examples.shutil, "which", lambda _: None)
    with pytest.raises(CheckFailure, match="no C compiler is installed"):
        baselines.build(tmp_path, [])


needs_compiler = pytest.mark.skipif(not shutil.which("cc"), reason="no C compiler is installed")


@pytest.fixture(scope="module")
def lean():
    command = [sys.executable, "-m", "conformance.bench.baselines", "lean-c"]
    with pytest.MonkeyPatch.context() as patch:  # ensembles and promises are not what is looked at
        patch.setattr("conformance.suite.run.checks_of", lambda *_: [])
        return suite.check(command, seed=1, groups=["moving-cap", "fast-wall"], limits=Limits(total=300.0))


@pytest.mark.deep
@needs_compiler
def test_a_lean_stepper_without_checks_passes_the_easy_and_fails_the_hard(lean):
    easy, hard = (lean.counts(group) for group in ("moving-cap", "fast-wall"))
    assert easy["pass"] > 0.9 * sum(easy.values())
    assert hard["fail"] >= 5
    assert lean.verdict() == "not accepted"
    assert "fast-wall" in reasons(lean)[0]
    text = page([Graded("lean-c", lean), Graded("example in C", None, "no compiler")], lean.corpus)
    for words in (
        "| lean-c | not accepted |",
        "| example in C | not run |",
        f"- **lean-c**: {lean.scope()}.",
        "  - fails most in ",
        "not run here: no compiler.",
    ):
        assert words in text


def test_a_baseline_that_is_none_is_refused():
    with pytest.raises(BadInput, match="must be one of lean-c"):
        baselines.main(["lean"])


def test_every_baseline_is_listed(tmp_path, monkeypatch):
    """Whatever can be built here; the examples have tests of their own."""
    for finder in ("find_examples", "find_kit_examples"):
        monkeypatch.setattr(scoreboard, finder, lambda _: {})
    names = [name for name, _, _ in scoreboard.commands(tmp_path)]
    assert {"fast", "plain", "steps-1000", "solve-ivp-1e-09"} < set(names)
