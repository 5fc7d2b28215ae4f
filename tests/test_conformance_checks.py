"""Parts of the checks, one by one: what is drawn, and what is said of answers that are given by hand."""

import json
import math
import re
from types import SimpleNamespace
from typing import Any

import msgspec
import pytest
from mpmath import fp
from support.faulty_steppers import faulty

from conformance.cases.draw import Draw
from conformance.profiles import margin
from conformance.suite import pytest_plugin
from conformance.suite.checks import (
    bad_input,
    checks_of,
    flows,
    form,
    path_judge,
    run_check,
    spelling,
    timing,
)
from conformance.suite.checks.form import Implementation, octaves
from conformance.suite.process import CheckFailure
from conformance.suite.result import graded_parts
from conformance.suite.session import Session
from conformance.vectors import Vector, question
from scene import BangBang, Cap, Collision, Fourier, Mushroom, State, Stem, from_data, load
from scene.geometry import area, table_at
from scene.protocol.messages import Introduction
from theory import predict

SCENE, START = Cap(r=1.0), State(0.0, 0.0, 0.25, 0.0, 1.0)
UNDECIDED = {"outcome": "undecided", "reason": "shy"}


@pytest.mark.parametrize(
    ("low", "high"), [(1.0, 8.0), (0.75, 1.0), (0.3, 1.0), (2.0**-40, 0.5), (2.0, 65536.0)]
)
def test_one_number_is_drawn_from_each_octave(low, high):
    lowest = high
    for key in range(50):
        drawn = list(octaves(Draw(f"octaves/{key}"), low, high))
        for k, number in enumerate(drawn):
            assert max(low, high / 2.0 ** (k + 1)) <= number <= high / 2.0**k
        assert high / 2.0 ** len(drawn) <= low
        lowest = min(lowest, *drawn)
    assert lowest < low * min(1.1, (high / low) ** 0.1)


@pytest.mark.parametrize("make", [bad_input._wave, bad_input._legs])
@pytest.mark.parametrize("off", [1.0, -1.0])
@pytest.mark.parametrize(("bound", "far"), [(0.5, 1.5), (1.5, 0.5), (0.0, 1.0), (1.25, 0.75)])
def test_a_law_that_is_broken_for_a_while_keeps_to_its_values(make, off, bound, far):
    """It passes its bound, or stays short of it, by little; elsewhere it reaches what was asked for."""
    law = msgspec.convert(make(bound, far, share=0.01, at=0.25, off=off), Fourier | BangBang).bounds()
    near, most = (law.lowest, law.highest) if bound < far else (law.highest, law.lowest)
    assert most == pytest.approx(far, abs=0.01 * abs(far - bound))
    past = (bound - near) * (1.0 if bound < far else -1.0) * off
    assert 0.0 < past < 0.01 * abs(far - bound)


def arrived(x: float) -> dict[str, Any]:
    return {"outcome": "horizon", "t": 1.0, "x": x, "y": 0.5, "vx": 0.0, "vy": 1.0}


AMONG = {
    "the same": (arrived(0.25), arrived(0.25), True),
    "the same but for rounding": (arrived(0.25), arrived(0.25 + 2.0**-52), True),
    "elsewhere": (arrived(0.25), arrived(0.26), "among others"),
    "undecided alone": (UNDECIDED, arrived(0.25), False),
    "undecided among others": (arrived(0.25), UNDECIDED, False),
    "undecided for another reason": (UNDECIDED, {**UNDECIDED, "reason": "coy"}, False),
    "rejected alone": ({"outcome": "rejected", "reason": "state"}, arrived(0.25), "among others"),
    "rejected among others": (arrived(0.25), {"outcome": "rejected", "reason": "state"}, "among others"),
}


@pytest.mark.parametrize("name", AMONG)
def test_a_state_is_answered_among_others_as_alone(name, monkeypatch):
    alone, among, said = AMONG[name]
    side = Implementation(Session(lambda _: b""), "flow")
    monkeypatch.setattr(
        side, "flown", lambda _, states, __: [alone if len(states) == 1 else among] * len(states)
    )
    if isinstance(said, bool):
        assert flows.together(side, SCENE, [START], [0, 0], 1.0) == said
    else:
        with pytest.raises(AssertionError, match=said):
            flows.together(side, SCENE, [START], [0, 0], 1.0)


def hit(dt: float, t: float) -> dict[str, Any]:
    return {
        "outcome": "collision",
        "wall": "arc",
        "dt": dt,
        "t": t,
        "x": 0.0,
        "y": 1.0,
        "vx": 0.0,
        "vy": -1.0,
    }


HIT, END = hit(0.75, 0.75), {**arrived(0.0), "t": 9.0}
PATHS = [
    ([HIT, HIT], 2, None), ([HIT, END], 2, None), ([END], 2, None), ([UNDECIDED], 2, None), ([HIT], 1, None),
    ([HIT] * 9, 2, "9 steps, 9 of them collisions, are answered to 2"),
    ([HIT, HIT, END], 2, "3 steps, 2 of them"),
    ([HIT], 2, "1 steps, 1 of them"),
    ([], 1, "0 steps, 0 of them"),
    ([END, HIT], 2, "2 steps, 1 of them"),
    ([END, END], 3, "2 steps, 0 of them"),
]  # fmt: skip


@pytest.mark.parametrize(("steps", "n", "said"), PATHS, ids=range(len(PATHS)))
def test_a_path_has_as_many_steps_as_asked_for_or_ends(steps, n, said, monkeypatch):
    """A stepper whose steps go on without end is refused, and so is one that stops short."""
    session = Session(lambda _: b"")
    monkeypatch.setattr(session, "ask", lambda _: {"seq": 0, "steps": steps})
    side = Implementation(session, "trajectory")
    if said is None:
        assert len(side.path(SCENE, START, n)) == len(steps)
    else:
        with pytest.raises(CheckFailure, match=said):
            side.path(SCENE, START, n)


@pytest.mark.parametrize(
    ("refusal", "after", "said"),
    [
        ("rejected", 0.75, None),
        ("rejected", 0.76, "before"),
        ("horizon", 0.75, "must be rejected"),
    ],
)
def test_what_comes_after_a_malformed_line_is_answered_as_before(refusal, after, said):
    is_disturbed = []

    def say(line, seq):
        is_disturbed.append(line)
        return {"seq": seq, "outcome": refusal, "reason": "none"}

    session = SimpleNamespace(
        ask=lambda _: {"seq": 0, **hit(dt := after if is_disturbed else 0.75, dt)}, say=say
    )
    asked = [(START, question("step", SCENE, START, 9.0))]
    side = Implementation(session, "step")
    if said is None:
        assert spelling.passed_over(side, SCENE, asked)
        assert is_disturbed == [line for line, _ in spelling.MALFORMED]
    else:
        with pytest.raises((CheckFailure, AssertionError), match=said):
            spelling.passed_over(side, SCENE, asked)


def test_starts_at_either_zero_go_to_every_side_that_is_open():
    """From the mouth up and down; from a base only away from it."""
    asked = list(spelling.zeros(Draw("zeros"), "step"))
    ways = {(type(scene), start.vy > 0, start.wall) for scene, start, _, _ in asked}
    up, down = True, False
    assert ways == {(Cap, up, "base"), (Stem, down, "base"), (Mushroom, up, None), (Mushroom, down, None)}
    assert all('"y": -0.0' in line for _, _, _, line in asked)


def test_what_no_answer_graded_is_listed(corpus: list[Vector]):
    circle, box = {"table": "cap", "r": 1.0}, {"table": "stem", "w": 1.0, "h": 1.0}
    cap = next(vector for vector in corpus if vector.scene == circle and vector.kind == "step")
    rejected = msgspec.structs.replace(cap.expect[0], outcome="rejected")
    refused = msgspec.structs.replace(cap, scene=box, expect=(rejected,))
    found = graded_parts([cap, refused], is_timed=False)
    assert (found["tables"], found["profiles"]) == (["cap"], ["step"])
    assert {"stem", "mushroom", "trajectory", "flow", "time"} <= set(found["not_graded"])
    assert not {"cap", "step"} & set(found["not_graded"])
    timed = graded_parts([cap], is_timed=True)
    assert timed["profiles"] == ["step", "time"]
    assert set(timed["not_graded"]) == set(found["not_graded"]) - {"time"}


@pytest.mark.parametrize(("energy", "bias"), [(1000.0, 0.08), (4000.0, 0.04)])
def test_a_mean_growth_is_asked_of_as_many_particles_as_tell_it_from_0(energy, bias):
    """Numbers between -L and L are asked about, and L is the largest growth."""
    scene = load(flows.SCENE)
    areas = [area(scene, scene.period * k / 64) for k in range(64)]
    span = 2 * (math.log(max(areas) / min(areas)) + bias)
    beyond = abs(float(predict(scene, 10).m1)) - bias
    least = next(n for n in range(2, 5000) if margin(n, 0.0, span, flows.ALARM) <= beyond)

    def asked(*_):
        raise NotImplementedError

    with pytest.raises(NotImplementedError):
        flows._mean_growth(asked, scene, flows.Size(least, energy, bias), 1)
    with pytest.raises(CheckFailure, match="cannot tell m1 from 0"):
        flows._mean_growth(asked, scene, flows.Size(least - 1, energy, bias), 1)


OPEN_STEP = {"cmd": "step", "scene": {"r": 1.0}, "state": {"x": 1.0}, "t_end": 1.0}
OFFERED = Introduction(1, "it", "1", "Python", ("step", "flow"), ("cap",), ("constant",))
VERDICTS = [  # what is found of each of four questions; verdict, reason, answers and undecided ones
    ([True, True, True, True], "pass", "4 of 4 compared", (0, 0)),
    ([True, False, False, False], "pass", "1 of 4 compared", (0, 0)),
    (["one", "two", "three", "four"], "pass", "one; two; three; four", (0, 0)),
    ([False] * 4, "unsupported", "nothing to compare", (0, 0)),
    ([CheckFailure("unsupported", "law fourier")] * 4, "unsupported", "law fourier", (0, 0)),
    ([CheckFailure("declined", "shy")] * 4, "declined", "shy; shy; shy; shy", (0, 0)),
    ([CheckFailure("declined", "shy"), True, True, True], "pass", "shy", (0, 0)),
    (["undecided", True, True, True], "pass", "3 of 4 compared; 1 of 4 answers are undecided", (4, 1)),
    (["undecided"] * 4, "declined", "0 of 4 compared; 4 of 4 answers are undecided", (4, 4)),
    (["undecided", False, False, False], "declined", "0 of 4 compared; 1 of 4 answers are undecided", (4, 1)),
    ([True, AssertionError("it is off")], "fail", "step: it is off", (0, 0)),
    ([OverflowError("too large")], "fail", "step: its answers cannot be calculated with: too large", (0, 0)),
    ([CheckFailure("timed-out", "slow")], "timed-out", "step: slow", (0, 0)),
]  # fmt: skip


@pytest.mark.parametrize(("findings", "verdict", "why", "counts"), VERDICTS, ids=range(len(VERDICTS)))
def test_a_check_comes_to_a_verdict_from_what_it_found(findings, verdict, why, counts):
    """It ends at the first fault, which it gives as a test to paste."""
    asked = []

    def judge(side, _scene, number):
        asked.append(number)
        found = findings[number]
        if "undecided" in findings:
            said = "undecided" if found == "undecided" else "collision"
            side.answers.add({**OPEN_STEP, "t_end": float(number)}, [said])
        if isinstance(found, Exception):
            raise found
        return found is True if found == "undecided" or isinstance(found, bool) else found

    check = form.SuiteCheck(
        "promise/one-thing", lambda *_: [(SCENE, k) for k in range(len(findings))], judge, ("step",)
    )
    found = form.run_check(check, SimpleNamespace(introduction=OFFERED), 1)
    assert (found.id, found.group) == ("promise/one-thing", "promise")
    assert (found.verdict, found.why) == (verdict, why)
    assert (found.n_answers, found.n_undecided) == counts
    is_fault = verdict in ("fail", "timed-out")
    assert asked == list(range(len(findings)))
    assert ("def test_promise_one_thing(asked):" in found.paste) is is_fault
    assert (f"@example({(SCENE, asked[-1])!r})" in found.paste) is is_fault


@pytest.mark.parametrize(
    ("tables", "n_drawn", "lacking"),
    [
        (["cap", "cap", "cap", "cap"], 1, ""), (["cap", "stem", "cap", "stem"], 1, "table stem"),
        (["cap", "stem", "stem", "stem"], 2, "table stem"), (["cap", *["stem"] * 5], 3, "table stem"),
        (["stem"] * 4, 6, "table stem"),
    ],
)  # fmt: skip
def test_questions_are_drawn_anew_while_fewer_than_half_may_be_asked(tables, n_drawn, lacking):
    drawn = []

    def asks(draw, profile):
        drawn.append((draw, profile))
        return [({"cap": SCENE, "stem": Stem(w=1.0, h=1.0)}[name], k) for k, name in enumerate(tables)]

    check = form.SuiteCheck("promise/x", asks, lambda *_: True)
    fitting, found = form._draw_asked(check, OFFERED, "step", 7)
    assert [profile for _, profile in drawn] == ["step"] * n_drawn
    assert fitting == [(SCENE, k) for k, name in enumerate(tables) if name == "cap"] * n_drawn
    assert found == lacking
    numbers = {draw.part() for draw, _ in drawn}
    assert len(numbers) == n_drawn  # from streams of their own
    assert form._draw_asked(check, OFFERED, "trajectory", 7) == ([], "profile trajectory")
    assert len(drawn) == n_drawn


def test_an_answer_of_another_number_of_outcomes_counts_as_one_question():
    """A flow that is refused as a whole, a path of any length: undecided ones among them count."""
    flow = {"cmd": "flow", "scene": {"r": 1.0}, "states": [{"x": 1.0}, {"x": 2.0}], "t_end": 1.0}
    tally = form.AnswerTally()
    tally.add(flow, ["undecided"])
    assert tally.counts() == (1, 1)
    tally.add({**flow, "cmd": "trajectory"}, ["collision"] * 3)
    tally.add({**OPEN_STEP, "cmd": "trajectory"}, ["collision", "undecided", "undecided"])
    assert tally.counts() == (3, 7)


# A repeat lasts .1 s, and an answer .05 s more, the delay. What a program says otherwise, in nanoseconds:
# of a first start, of each of many repeats, of the least of them, of a path twice as long; and the objection.
CLOCKS = [
    ({}, ""),
    ({"many": 0.026e9}, ""),
    ({"many": 0.024e9}, "makes the answer 100000000 ns later"),
    ({"many": 0.39e9, "first": 0.1e9, "twice": 0.6e9}, ""),
    ({"many": 0.41e9, "first": 0.1e9, "twice": 0.6e9}, "8 repeats are said to last 410000000 ns each"),
    ({"first": 0.39e9}, ""),
    ({"first": 0.41e9}, "a new start is said to last 410000000 ns, the same again 100000000 ns"),
    ({"twice": 0.131e9}, ""),
    ({"twice": 0.129e9}, "10 collisions are said to last 100000000 ns, 20 of them 129000000 ns"),
    ({"delay": 0.2}, ""),  # 32 repeats are asked for, as 8 do not make the answer come much later
    ({"delay": 0.2, "many": 0.024e9}, "makes the answer 100000000 ns later"),
    ({"least": 0.051e9, "first": 0.2e9}, ""),  # the others waited, and so did the first
    (
        {"least": 0.049e9, "first": 0.2e9},
        "a new start is said to last 200000000 ns, the same again 49000000 ns",
    ),
]


@pytest.mark.parametrize(("clock", "said"), CLOCKS, ids=range(len(CLOCKS)))
def test_a_clock_is_held_to_the_time_that_passes(monkeypatch, clock, said):
    usual = {"first": 0.1e9, "many": 0.1e9, "twice": 0.2e9, "delay": 0.05, "least": math.inf}
    known = usual | clock
    asked = []

    def timed(_session, _scene, _state, n, repeat):
        asked.append((n, repeat))
        ns = known["twice" if n == 20 else "many"]
        each = [ns] * repeat
        if n == 10:
            each[0] = min(ns, known["least"])
        return timing.Timing([int(one) for one in each], known["delay"] + 0.1 * repeat * n / 10, None)

    monkeypatch.setattr(timing, "timed", timed)
    ones = [timing.Timing([int(known["first"] * k)], known["delay"] + 0.1 * k, None) for k in (2, 1, 3)]
    found = timing._objection(None, SCENE, START, 10, ones)
    assert said in found
    assert bool(found) == bool(said)
    repeats = [8, 32] if 0.8 + known["delay"] < 3 * (0.1 + known["delay"]) else [8]
    assert asked == [*((10, repeat) for repeat in repeats), (20, 3)]


FALLING = State(0.0, 0.125, 0.5, 0.0, -1.0)
# Of a fall to the base, which ends at (0.125, 0) at t = 0.5: what is changed, and what is said.
SPOILT: list[tuple[dict[str, Any], str]] = [
    ({}, ""),
    ({"dt": 0.4375, "t": 0.4375, "y": 0.0625}, "is off its wall"),
    ({"dt": 0.5625, "t": 0.5625, "y": -0.0625}, "is off its wall"),
    ({"t": 0.625}, "its time is not when the flight ends"),
    ({"x": 0.25}, "is off the flight before"),
    ({"vy": -1.0}, "is not turned round by its wall"),
    ({"vx": 0.25}, "is not turned round by its wall"),
]


@pytest.mark.parametrize(("changes", "said"), SPOILT, ids=range(len(SPOILT)))
def test_a_hit_to_which_no_flight_led_is_named_by_its_flaw(changes, said):
    right = Collision(dt=0.5, t=0.5, x=0.125, y=0.0, vx=0.0, vy=1.0, wall="base")
    flaw = path_judge.flaw_of(SCENE, FALLING, [msgspec.structs.replace(right, **changes)], {})
    assert flaw == (f"outcome 1 {said}" if said else "")


@pytest.mark.parametrize("profile", ["step", "trajectory", "flow"])
def test_states_are_asked_about_up_to_a_time_that_is_near(profile):
    """At once or soon after; a trajectory has time to go on. A start that is late is so by its own time."""
    ahead = set()
    for _, asked, why in bad_input.bad_states(Draw("states"), profile):
        starts = asked["states"] if profile == "flow" else [asked["state"]]
        late = {round(start["t"] - asked["t_end"], 12) for start in starts}
        if "begins after" in why:
            assert late == {1.0}
        else:
            ahead |= late
            assert all(0.0 <= start["t"] < 3.0 for start in starts)
    assert ahead == {-1.0} if profile == "trajectory" else {0.0, -(2.0**-6)}


@pytest.mark.parametrize("scene", [*bad_input.RESTING, load("moving-cap"), Stem(w=1.0, h=1.25, slope=0.25)])
def test_places_past_the_end_of_a_wall_are_on_its_curve_and_not_on_it(scene):
    """As far as a sixteenth of its size and as near as 2^-10; of a mushroom's arc one is within the stem."""
    table = table_at(fp, scene, 0.0)
    r, w, h = float(table.r), float(table.w), float(table.h)
    for wall in scene.walls:
        places = [
            place for key in range(8) for place in bad_input._past_the_end(Draw(f"ends/{key}"), table, wall)
        ]
        in_stem = [(x, y) for x, y in places if wall == "arc" and y < -0.5 * r]
        ends = {"arc": r, "base": w if isinstance(scene, Stem) else r}
        for x, y in places:
            assert abs(table.gap(wall, x, y)) < 1e-12 * table.size
            if wall == "arc":
                assert y < 0
            elif wall == "base":
                assert 2.0**-10 < abs(x) / ends[wall] - 1 <= 2.0**-4
            elif wall == "floor":
                assert 2.0**-10 < abs(x) / table.half_width(-h) - 1 <= 2.0**-4
            else:
                assert 2.0**-10 <= max(y / h, -y / h - 1) <= 2.0**-4
                assert (x < 0) == (wall == "left")
        past = [place for place in places if place not in in_stem]
        assert len(past) >= 8 * 6
        assert {place[wall in ("left", "right")] > 0 for place in past} == {True, False}
        is_deep = isinstance(scene, Mushroom) and wall == "arc" and h > r * math.sqrt(1 - w * w / 16)
        assert len(in_stem) == (8 if is_deep else 0)
        assert all(abs(x) < table.half_width(y) and -h < y for x, y in in_stem)


@pytest.mark.parametrize("scene", [*bad_input.RESTING, Stem(w=2.0, h=1.25, slope=0.25), load("moving-cap")])
def test_a_place_is_moved_inwards_by_a_part_of_the_walls_size(scene):
    """That is the radius, for a stem's base and for sides the width, for a floor the depth."""
    table = table_at(fp, scene, 0.0)
    for wall in scene.walls:
        x, y = bad_input._place(Draw(f"place/{wall}"), table, wall)
        assert abs(table.gap(wall, x, y)) < 1e-12 * table.size
        size = {"arc": table.r, "base": table.w if isinstance(scene, Stem) else table.r, "floor": table.h}
        for part in (0.0625, -0.0625):
            to = bad_input.move_inwards(table, wall, x, y, part)
            moved = math.hypot(to[0] - x, to[1] - y)
            assert moved == pytest.approx(0.0625 * float(size.get(wall, max(float(table.w), abs(x)))))
            assert (table.gap(wall, *to) > 0) == (part > 0)


TAGGED = {"type": "object", "properties": {"kind": {"enum": ["wave"]}, "x": {"type": "number"}}}
TWICE = {"type": "object", "properties": {"kind": {"enum": ["wave"]}, "wall": {"enum": ["arc"]}}}
FIRST = {"type": "object", "properties": {"kind": {"enum": ["wave", "legs"]}}}
FORMS: list[tuple[dict[str, Any], Any, bool]] = [
    ({"type": "null"}, None, True), ({"type": "null"}, 1.0, False), ({"type": "number"}, None, False),
    ({"type": "boolean"}, True, True), ({"type": "integer"}, True, False), ({"type": "number"}, True, False),
    ({"type": "integer"}, 1, True), ({"type": "number"}, 1, True), ({"type": "integer"}, 1.0, False),
    ({"type": "number"}, 1.0, True), ({"type": "string"}, "1.0", True), ({"type": "number"}, "1.0", False),
    (FIRST, {"kind": "wave"}, True), (FIRST, {}, True), (FIRST, {"kind": "legs"}, True),
    ({"enum": ["arc"]}, "arc", True), ({"enum": ["arc"]}, 1.0, False), ({"type": "array"}, [1.0], True),
    ({"type": "array"}, (1.0,), True), ({"type": "object"}, [1.0], False), ({"type": "array"}, {}, False),
    ({"type": ["number", "null"]}, None, True), ({"type": ["number", "null"]}, "x", False),
    ({"type": "object"}, {}, True), (TAGGED, {"kind": "wave"}, True), (TAGGED, {"kind": "legs"}, False),
    (TAGGED, {"x": 1.0}, True), (TAGGED, 1.0, False), ({}, 1.0, False),
    (TWICE, {"kind": "wave", "wall": "arc"}, True), (TWICE, {"kind": "wave", "wall": "no"}, False),
    (TWICE, {"kind": "no", "wall": "arc"}, False),
]  # fmt: skip


@pytest.mark.parametrize(("form", "value", "is_meant"), FORMS, ids=range(len(FORMS)))
def test_a_form_of_the_schema_is_meant_by_values_of_its_type_and_tag(form, value, is_meant):
    """A whole number is a number too; an object whose tag is missing may be of any form."""
    assert bad_input._fits(form, value) is is_meant


@pytest.mark.parametrize("profile", ["step", "trajectory", "flow"])
def test_bad_states_are_bad_for_what_is_said_alone(profile):
    """Only a start that is late on purpose is asked about up to an earlier time."""
    for scene, asked, why in bad_input.bad_states(Draw("states"), profile):
        starts = asked["states"] if profile == "flow" else [asked["state"]]
        assert all((asked["t_end"] < start["t"]) == ("begins after" in why) for start in starts), (scene, why)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({}, None),
        ({"mushrooms_command": None}, None),
        ({"mushrooms_command": "a 'b"}, '--mushrooms-command = "a \'b": No closing quotation'),
        ({"mushrooms_seed": -1}, "--mushrooms-seed = -1"),
        ({"mushrooms_timeout": 0.0}, "--mushrooms-timeout = 0.0, must be above 0"),
        ({"mushrooms_timeout": math.nan}, "--mushrooms-timeout = nan, must be above 0"),
    ],
)
def test_a_bad_option_of_the_plugin_is_refused_by_its_name(changes, said):
    options = {"mushrooms_seed": 1, "mushrooms_timeout": 1.0, "mushrooms_command": "a 'b c'"} | changes
    config = SimpleNamespace(option=SimpleNamespace(**options))
    if said is None:
        pytest_plugin.pytest_configure(config)
    else:
        with pytest.raises(pytest.UsageError, match=re.escape(said)):
            pytest_plugin.pytest_configure(config)


class SlowSession(Session):
    """A session with a right stepper that takes `pace` seconds for a hit, by a clock that is not waited for.

    A flow is taken to have as many hits as its particles could cross their table.
    """

    def __init__(self, pace: float) -> None:
        super().__init__(faulty(lambda request, answer: answer(request)))
        self.pace = pace
        self.longest = 0.0
        self.start()

    def _exchange(self, line: bytes) -> bytes:
        answer = super()._exchange(line)
        self.seconds = self.pace * hits_of(json.loads(line), json.loads(answer))
        if self.seconds > self.limits.timeout:
            raise CheckFailure("timed-out", f"{self.seconds:g} s")
        self.longest = max(self.longest, self.seconds)
        return answer


def hits_of(request: dict[str, Any], answer: dict[str, Any]) -> float:
    if request["cmd"] == "trajectory":
        return len(answer["steps"])
    if request["cmd"] != "flow":
        return 1
    scene, states = from_data(request["scene"]), [State(**state) for state in request["states"]]
    flown = [max(0.0, request["t_end"] - state.t) / path_judge.crossing(scene, state) for state in states]
    return 1 + sum(flown)


SLOW = (
    *(f"promise/{name}" for name in ("long-paths", "long-flow", "many-particles")),
    f"profile/{flows.PROFILES[0]}",
)


@pytest.mark.parametrize("pace", [0.02, 0.2])
@pytest.mark.parametrize("name", SLOW)
def test_a_slow_stepper_is_asked_for_what_it_answers_in_time(name, pace, monkeypatch):
    """Its paths, flows and ensembles are shorter than those of a fast one, and its result says so."""
    if name.startswith("profile/"):
        pace *= 20  # the energies are low
        monkeypatch.setitem(flows.SIZES, "core", flows.Size(300, 50.0, 0.5))
    check = next(check for check in checks_of() if check.name == name)
    with SlowSession(pace) as slow, SlowSession(0.0) as prompt:
        found, usual = run_check(check, slow, 1), run_check(check, prompt, 1)
    assert (found.verdict, usual.verdict) == ("pass", "pass"), found.why
    assert "not asked" not in usual.why
    assert name.startswith("profile/") or "not asked" in found.why
    assert slow.longest > slow.limits.timeout / 64
    assert prompt.n_restarts == slow.n_restarts == 0


def test_a_stepper_that_becomes_slow_is_timed_out():
    """The paths before do not excuse it."""

    class Tired(SlowSession):
        def _exchange(self, line: bytes) -> bytes:
            self.pace = 1.0 if json.loads(line).get("collisions", 0) > 2000 else 1e-4
            return super()._exchange(line)

    check = next(check for check in checks_of() if check.name == "promise/long-paths")
    with Tired(1e-4) as session:
        assert run_check(check, session, 1).verdict == "timed-out"


@pytest.mark.parametrize(
    ("seconds", "n"), [(0.0, flows.BATCH), (1e-3, flows.BATCH), (1.0, 30), (7.0, 4), (100.0, 1)]
)
def test_an_ensemble_is_cut_by_the_time_of_a_particle(seconds, n):
    assert flows.batch_size(seconds, 120.0) == n
