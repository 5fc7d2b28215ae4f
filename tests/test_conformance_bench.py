"""The benchmark measures what it says: workloads, grades, growth, records; commands are held to our clock.

Its baselines are right where most would be, caught where not, and timed on what they follow.
"""

import json
import math
import sys
from contextlib import ExitStack, nullcontext, suppress
from itertools import count
from pathlib import Path
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest
from support.depth import deep_among, deep_but
from support.schemas import validator
from support.truth import proved_step

import fast
from conformance import suite
from conformance.bench import baselines, record, scoreboard, solvers, workloads
from conformance.bench.scoreboard import Graded, page, reasons
from conformance.bench.solvers import Solver, SolverRun, by_call
from conformance.cases import scenes
from conformance.cases.draw import Draw
from conformance.grading.agreement import compare
from conformance.harness import examples
from conformance.suite.checks import timing
from conformance.suite.process import CheckFailure
from conformance.suite.session import Limits
from mushrooms import bench as ours
from scene import BadInput, Collision, Horizon, State, Undecided, load

DOCS = Path(__file__).parent.parent / "docs"
BRIEF = solvers.Effort(repeats=3, least_ns=1.0, most_ns=1e9)


@pytest.fixture(scope="module")
def drawn() -> dict[str, workloads.Workload]:
    return {rule.name: workloads.draw_workload(rule, 7, 3, proved_step) for rule in workloads.RULES}


def measured(workload, *these):
    points, troubles = solvers.measure(workload, these, BRIEF, lambda _: None)
    assert not troubles
    return points


@pytest.mark.parametrize("name", workloads.NAMES)
def test_answers_of_a_workload_are_collisions_as_the_fast_stepper_finds_them(drawn, name):
    assert len(drawn[name].questions) == 3
    for q in drawn[name].questions:
        assert q.truth.outcome == "collision"
        met = fast.next_collision(drawn[name].scene, q.state, q.t_end)
        assert compare(met, q.truth, q.state, 4.0).verdict in ("pass", "declined")


def test_a_seed_draws_the_same_questions(drawn):
    rule, trust = workloads.RULES[0], fast.next_collision
    again, once_more = (workloads.draw_workload(rule, 7, 2, proved_step, 5, trust) for _ in range(2))
    other = workloads.draw_workload(rule, 8, 2, proved_step)
    assert [q.state for q in again.questions] == [q.state for q in drawn[rule.name].questions[:2]]
    assert [q.state for q in other.questions] != [q.state for q in again.questions]
    assert again.further == once_more.further
    assert len({step.state for step in again.further}) == 5


def test_workloads_are_what_their_names_say(drawn):
    speeds = {
        name: [math.hypot(q.state.vx, q.state.vy) for q in workload.questions]
        for name, workload in drawn.items()
    }
    for name, energy in (("moving-cap-1e4", 1e4), ("moving-cap-1e7", 1e7), ("moving-cap-1e12", 1e12)):
        # One collision changes the speed by twice the walls' at most.
        assert speeds[name] == pytest.approx([math.sqrt(2 * energy)] * 3, abs=10.0)
    assert max(speeds["slow"]) < 10.0
    for s in (q.state for q in drawn["grazing"].questions):
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


LARGEST = sys.float_info.max
SPOILT = {  # what is told in place of a collision; numbers of right, wrong and undecided; relative errors
    "another wall": (lambda c: Collision("floor", c.dt, c.t, c.x, c.y, c.vx, c.vy), (0, 3, 0), ()),
    "a horizon": (lambda c: Horizon(c.t, c.x, c.y, c.vx, c.vy), (0, 3, 0), ()),
    "nan": (lambda c: Collision(c.wall, math.nan, c.t, c.x, c.y, c.vx, c.vy), (0, 3, 0), ()),
    "nothing": (lambda _: Undecided("shy"), (0, 0, 3), ()),
    "dt off": (
        lambda c: Collision(c.wall, c.dt * (1 + 1e-9), c.t, c.x, c.y, c.vx, c.vy),
        (3, 0, 0),
        [1e-9] * 3,
    ),
    "beyond all numbers": (
        lambda c: Collision(c.wall, *[LARGEST, -LARGEST] * 3),
        (3, 0, 0),
        [1e308] * 3,
    ),
}


@pytest.mark.parametrize("name", SPOILT)
def test_a_spoilt_solver_is_seen(drawn, name):
    spoil, counts, errors = SPOILT[name]
    spoilt = by_call("spoilt", "compiled", lambda *question: spoil(fast.next_collision(*question)))
    (point,) = measured(drawn["breathing-disk"], spoilt)
    assert (point.right, point.wrong, point.undecided) == counts
    assert point.relative == pytest.approx(errors, rel=1e-3)
    assert all(u is None or u > 1e4 for u in point.ulps)
    assert msgspec.json.decode(msgspec.json.encode(point), type=record.Point) == point


def test_walls_of_further_steps_are_compared(drawn):
    steps = [workloads.FurtherStep(q.state, "arc") for q in drawn["breathing-disk"].questions]
    workload = drawn["breathing-disk"]._replace(further=steps)
    met = fast.next_collision(workload.scene, steps[0].state, workload.questions[0].t_end)
    told = [met, msgspec.structs.replace(met, wall="base"), None]
    stepper = by_call("fast", "compiled", fast.next_collision)
    points = measured(workload, stepper._replace(steps=lambda *_: told), stepper)
    assert [(point.further, point.astray) for point in points] == [(2, 1), (0, 0)]


def test_time_stepping_is_right_where_it_is_easy_and_wrong_where_it_skips(drawn):
    easy = measured(
        drawn["moving-cap-1e4"], by_call("s", "time-stepping", baselines.next_collision_by(1e-9))
    )[0]
    assert easy.right == 3
    assert max(easy.relative) < 1e-8
    # Hops along the arc: it is left with a rounding error for a gap, and met again within one of its steps.
    hop = drawn["grazing"].questions
    met = [baselines.next_collision_by(1e-6)(drawn["grazing"].scene, q.state, q.t_end) for q in hop]
    errors = [
        1.0 if m.wall != step.wall else abs(m.dt / float(step.centre("dt")) - 1)
        for m, step in zip(met, (q.truth.steps[0] for q in hop), strict=True)
    ]
    assert max(errors) > 0.5


def test_time_stepping_tells_how_long_a_flight_lasts_and_when_it_ends():
    """Of each wall, and through the mouth; the flight begins late, so that its time is not its end's."""
    for name, state, t_end in (
        ("breathing-circle", State(3.5, 0.1, 0.2, 0.3, 0.4), 90.0),
        ("fermi-ulam", State(3.5, 0.1, -0.5, 0.3, 0.4), 90.0),
        ("moving-cap", State(3.5, 0.02, 0.3, 0.1, -9.0), 90.0),
        ("moving-cap", State(3.5, 0.02, -0.3, 0.1, 9.0), 90.0),
        ("moving-cap", State(3.5, 0.02, -0.3, 9.0, 0.5), 90.0),
        ("moving-cap", State(3.5, 0.02, 0.3, 0.25, 0.125), 3.75),
    ):
        scene = load(name)
        truth = fast.next_collision(scene, state, t_end)
        found = baselines.next_collision_by(1e-12)(scene, state, t_end)
        assert type(found) is type(truth)
        told, right = map(msgspec.to_builtins, (found, truth))
        assert told.pop("wall", None) == right.pop("wall", None)
        assert told.pop("outcome", None) == right.pop("outcome", None)
        assert told == pytest.approx(right, rel=1e-7)


def gone(call):
    if call > 2:
        raise CheckFailure("crashed", "gone")
    return SolverRun(1.0, [Undecided("")] * 3, 1e9)


TROUBLES = {  # what a call, by its number, answers
    "fail: a run is said to last 0 ns in all": lambda _: SolverRun(0.0, [Undecided("")] * 3, 0.0),
    "fail: its answers differ from run to run": lambda n: SolverRun(1.0, [Undecided(str(n))] * 3, 1e9),
    "crashed: gone": gone,
}


@pytest.mark.parametrize("why", TROUBLES)
def test_a_solver_that_cannot_be_timed_is_left_out(drawn, why):
    calls = count()
    solver = Solver("it", "command", lambda *_: TROUBLES[why](next(calls)))
    assert solvers.measure(drawn["slow"], [solver], BRIEF, lambda _: None) == ([], {"it": why})


def test_a_solver_is_run_on_the_workloads_that_it_serves_alone(drawn):
    asked = []

    def run(workload, _n_times):
        asked.append(workload.rule.name)
        return SolverRun(1.0, [Undecided("")] * 3, 1e9)

    solver = Solver("it", "command", run, ("slow",))
    assert solvers.measure(drawn["grazing"], [solver], BRIEF, lambda _: None) == ([], {})
    assert asked == []
    assert len(measured(drawn["slow"], solver)) == 1
    assert set(asked) == {"slow"}


@pytest.mark.deep
def test_errors_grow_as_the_jacobians_say():
    followers = ours.our_followers()
    grown = solvers.grow(followers, proved_step, ours.prove_path, 3, 2, 24, lambda _: None)
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
        path, _ = ours.prove_path(scene, state, n)
        return [*path[:3], path[3]._replace(wall="nowhere"), *path[4:]]

    grown = solvers.grow({"astray": astray}, proved_step, ours.prove_path, 3, 1, 6, lambda _: None)
    assert grown.lasts == {"astray": 3.0}
    assert grown.followers["astray"][3:] == (1.0, 1.0, 1.0)


DRAWN = (record.Drawn("slow", "slow", "moving-cap", 1, 0),)


def a_point(ns: list[float], solver: str = "fast") -> record.Point:
    return record.Point("slow", solver, "compiled", 1, tuple(ns), 1, 0, 0, 0, 0, 0, (0.5,), (1e-16,))


def a_record(*points: record.Point) -> record.Record:
    grown = record.Growth("moving-cap", 1e4, 1, 1, {"a": (1e-16,)}, {"a": 1.0}, (1e-16,), 0.2)
    machine = record.this_machine({})
    return record.Record(3, "quick", 0, 1, 3, 230, machine, DRAWN, points, {}, grown, 1.0)


def test_a_record_meets_its_published_schema_and_returns_whole():
    kept = DOCS / "bench" / "bench.json"
    data = json.loads(kept.read_text("utf-8"))
    validator("bench").validate(data)
    assert record.encode(record.read(kept)) == kept.read_bytes()
    del data["seed"]
    assert not validator("bench").is_valid(data)


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
        (record.encode(msgspec.structs.replace(a_record(), format=1)), "format = 1, must be 3"),
        (record.encode(a_record(a_point([1.0]), a_point([2.0]))), "'fast' on 'slow' stands twice"),
        (
            record.encode(a_record(msgspec.structs.replace(a_point([1.0]), workload="other"))),
            "'fast' on 'other' is of a workload that it does not name",
        ),
        (
            record.encode(msgspec.structs.replace(a_record(), workloads=DRAWN + DRAWN)),
            "workload 'slow' stands twice",
        ),
    ],
)
def test_a_file_that_is_no_record_is_refused(tmp_path, content, words):
    path = tmp_path / "bench.json"
    path.write_bytes(content)
    with pytest.raises(BadInput, match=words):
        record.read(path)
    with pytest.raises(BadInput, match="No such file"):
        record.read(tmp_path / "none.json")


@pytest.mark.parametrize(("ns", "is_true"), [(10**6, True), (10**7, False)])
def test_a_tick_of_a_coarse_clock_is_no_lie(ns, is_true):
    """A short repeat may be said to last 1 ms; not so 10 ms where the answer came at once."""
    answer = {"ns": [ns], "steps": [{"outcome": "undecided", "reason": "x"}]}
    at_once = SimpleNamespace(ask=lambda _: answer)
    with nullcontext() if is_true else pytest.raises(CheckFailure, match="the answer came after"):
        assert timing.ask_time(at_once, timing.SCENES[0], timing.START, 1, 1).ns == [ns]


IMPOSTOR = """
import json, sys
for line in sys.stdin:
    asked = json.loads(line)
    if asked["cmd"] == "start":
        every = {"profiles": ["step", "time"], "tables": ["cap"], "laws": ["constant", "fourier"]}
        answer = {"protocol": 1, "name": "impostor", "version": "1", "language": "Python", **every}
    elif asked["cmd"] == "time":
        answer = {"seq": asked["seq"], "ns": NS, "steps": STEPS}
    print(json.dumps(answer), flush=True)
"""


SPOILT_CLOCK = """
import json, subprocess, sys
pipe = subprocess.PIPE
fast = subprocess.Popen([sys.executable, "-m", "fast"], stdin=pipe, stdout=pipe, text=True)
passed = 0

def at_ticks(ns):
    global passed
    before, passed = passed // 10**6, passed + ns
    return (passed // 10**6 - before) * 10**6

for line in sys.stdin:
    fast.stdin.write(line)
    fast.stdin.flush()
    answer = json.loads(fast.stdout.readline())
    if "ns" in answer:
        answer["ns"] = [SAID for ns in answer["ns"]]
    print(json.dumps(answer), flush=True)
"""


OPEN = "{'outcome': 'undecided', 'reason': ''}"
PROGRAMS = {  # a program, how it differs, and why it is left out
    "offers no time": (
        "import runpy; runpy.run_module('conformance.plain', run_name='__main__')",
        {},
        "unsupported",
    ),
    "no repeat": (IMPOSTOR, {"NS": "[]", "STEPS": "[]"}, "fail: 1 repeats are answered"),
    "no step": (IMPOSTOR, {"NS": "[5]", "STEPS": "[]"}, "fail: 1 repeats are answered"),
    "two steps": (IMPOSTOR, {"NS": "[5]", "STEPS": f"[{OPEN}] * 2"}, "fail: 1 repeats are answered"),
    "too long": (
        IMPOSTOR,
        {"NS": "[10**300]", "STEPS": f"[{OPEN}]"},
        "fail: 1 repeats are said to last 1000",
    ),
    "open": (IMPOSTOR, {"NS": "[0] * asked['repeat']", "STEPS": f"[{OPEN}]"}, "declined: undecided"),
    "one nanosecond": (SPOILT_CLOCK, {"SAID": "1"}, "fail: a repeat of"),
    "a twentieth": (SPOILT_CLOCK, {"SAID": "ns // 20"}, "fail: a repeat of"),
    "no time": (SPOILT_CLOCK, {"SAID": "0"}, "fail: a repeat of"),
    # One that counts milliseconds is true: most of its steps are said to last 0 ns.
    "milliseconds": (SPOILT_CLOCK, {"SAID": "at_ticks(ns)"}, ""),
}
SPOILT_CLOCKS = "one nanosecond", "no time", "milliseconds"


@pytest.mark.parametrize("name", deep_among(PROGRAMS, *SPOILT_CLOCKS))
def test_a_command_is_timed_by_a_clock_that_is_true(drawn, tmp_path, monkeypatch, name):
    """In runs of several ticks of a clock that counts milliseconds; a false clock is tried twice here."""
    text, changes, trouble = PROGRAMS[name]
    monkeypatch.setattr(timing, "N_TRIES", 2 if trouble else timing.N_TRIES)
    for old, new in changes.items():
        text = text.replace(old, new)
    program = tmp_path / "program.py"
    program.write_text(text)
    brief = solvers.Effort(repeats=3, least_ns=5e6, most_ns=1e9)
    with ExitStack() as stack:
        solver = solvers.by_command("it", "command", [sys.executable, str(program)], stack)
        points, troubles = solvers.measure(drawn["breathing-disk"], [solver], brief, lambda _: None)
    assert [point.right for point in points] == ([] if trouble else [3])
    assert troubles.get("it", "").startswith(trouble)


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    if not examples.find_compiler("C"):
        pytest.skip("no C compiler is installed")
    return baselines.build(tmp_path_factory.mktemp("baselines"), ["-O1"])[0]


@pytest.fixture(scope="module")
def engine(library):
    return baselines.Engine(library)


def workload_of(name: str, n_further: int, n_questions: int = 2) -> workloads.Workload:
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
    found = points(workload_of(name, 300), baselines.in_c(library))
    lean = found["lean C"]
    assert (lean.right, lean.wrong, lean.further, lean.astray) == (2, 0, 300, 0)
    assert max(lean.relative) < 1e-13
    steps = [found[f"steps, flight/{parts}"] for parts in baselines.PARTS]
    assert steps[0].astray > 10
    assert steps[0].astray > steps[1].astray >= steps[2].astray
    assert all(point.further == 300 and min(point.ns) > 0 for point in steps)
    assert min(min(point.relative, default=1.0) for point in steps) > 1e-6


def test_one_path_is_followed_for_its_length(engine):
    workload = workload_of("moving-cap-1e4", 0)
    asked = baselines.questions(workload.scene, [workload.questions[0].state])
    assert engine.follow(asked, math.inf, 50, 3)[0] == 150
    n_hits, seconds = engine.follow(asked, workload.end(100.0), 10_000, 1)
    assert 50 < n_hits < 5000  # it may hop along the arc
    assert 0 < seconds < 1


def test_a_particle_that_meets_nothing_is_told(library, engine):
    scene, still = load("fermi-ulam"), State(0.0, 0.0, -0.5, 0.0, 0.0)
    assert engine.hits(baselines.questions(scene, [still]))[0, 6] == baselines.NONE
    assert isinstance(baselines.in_c(library)[0].steps(scene, [still])[0], Horizon)


def test_without_a_compiler_the_reason_is_told(monkeypatch, tmp_path):
    monkeypatch.setattr(baselines, "SOURCE", tmp_path / "absent.c")
    with pytest.raises(CheckFailure, match="it does not compile" if examples.find_compiler("C") else "no C"):
        baselines.build(tmp_path, [])
    monkeypatch.setattr(examples.shutil, "which", lambda _: None)
    with pytest.raises(CheckFailure, match="no C compiler is installed"):
        baselines.build(tmp_path, [])


@pytest.mark.deep
@pytest.mark.skipif(not examples.find_compiler("C"), reason="no C compiler is installed")
def test_a_lean_stepper_without_checks_passes_the_easy_and_fails_the_hard(monkeypatch):
    """Ensembles and promises are not what is looked at."""
    monkeypatch.setattr("conformance.suite.run.checks_of", lambda *_: [])
    command = [sys.executable, "-m", "conformance.bench.baselines", "lean-c"]
    lean = suite.check(command, seed=1, groups=["moving-cap", "fast-wall"], limits=Limits(total=300.0))
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
    assert {"fast", "plain", "steps-1000", "solve-ivp-1e-09"} < set(scoreboard.find_steppers(tmp_path))
