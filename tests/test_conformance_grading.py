"""Grading: each verdict is reached, right answers pass, shifted and swapped ones fail."""

import json
import math

import msgspec
import pytest
from support.truth import certified_answer

from conformance.grading.agreement import grade, physics_bound, precision_class
from conformance.vectors import NUMBERS, Certified, Expectation, Vector, load
from scene import State

THIN = {"dt": ("0.75", "0.75"), "x": ("1", "1"), "y": ("-0.5", "-0.5"), "vx": ("-1", "-1"), "vy": ("0", "0")}
BOX = {"table": "stem", "w": 1.0, "h": 1.0}
RIGHT = Certified(**THIN, allowance=(1.25, 1.0, 0.5, 1.0, 0.0), wall="right")
LEFT = Certified(
    **{**THIN, "dt": ("2", "2"), "x": ("-1", "-1"), "vx": ("1", "1")},
    allowance=(2.0, 1.0, 0.5, 1.0, 0.0),
    wall="left",
)
AT_END = Certified(
    **{**THIN, "dt": ("0.5", "0.5"), "x": ("0.75", "0.75"), "vx": ("1", "1")},
    allowance=(0.0, 1.0, 0.5, 1.0, 0.0),
)
HIT = {
    "outcome": "collision",
    "wall": "right",
    "dt": 0.75,
    "t": 0.75,
    "x": 1.0,
    "y": -0.5,
    "vx": -1.0,
    "vy": 0.0,
}
NEXT = {**HIT, "wall": "left", "dt": 2.0, "t": 2.75, "x": -1.0, "vx": 1.0}
END = {"outcome": "horizon", "t": 0.5, "x": 0.75, "y": -0.5, "vx": 1.0, "vy": 0.0}
SHIFT = 4  # times the bound: beyond it, whatever the enclosure's width


def vector(*expect, kind="step", t_end=9.0, collisions=1):
    return Vector(
        id="test/1",
        group="test",
        level="core",
        kind=kind,
        rule="a level flight in a box",
        source="hard case 17",
        scene=BOX,
        state=State(0.0, 0.25, -0.5, 1.0, 0.0),
        t_end=t_end,
        expect=expect,
        collisions=collisions,
    )


STEP = vector(Expectation("collision", (RIGHT,)))
HORIZON = vector(Expectation("horizon", (AT_END,)), t_end=0.5)
TIE = vector(Expectation("undefined", reason="corner"), Expectation("undecided"))
REFUSAL = vector(Expectation("rejected"))
EITHER = vector(Expectation("collision", (RIGHT,)), Expectation("rejected"))
PATH = vector(Expectation("collision", (RIGHT, LEFT)), kind="trajectory", collisions=2)
WIDE = vector(Expectation("collision", (msgspec.structs.replace(RIGHT, x=("0.99999999", "1.00000001")),)))
UNDECIDED = {"outcome": "undecided", "reason": "within rounding"}
REJECTED = {"outcome": "rejected", "reason": "state.x"}
CORNER = {"outcome": "undefined", "reason": "corner"}

VERDICTS = [
    (STEP, HIT, "pass", ""),
    (STEP, {**HIT, "seq": 7, "comment": "more than was asked"}, "pass", ""),
    (STEP, {**HIT, "x": 1, "vy": -0.0}, "pass", ""),
    (STEP, {**HIT, "wall": "left"}, "fail", "left, must be right"),
    (STEP, END, "fail", "horizon, must be right"),
    (STEP, {**HIT, "vx": 1.0}, "fail", "vx is off by"),
    (STEP, {**HIT, "vy": 1e-8}, "fail", "vy is off by"),
    (STEP, {**HIT, "t": 0.0}, "fail", "t is off by"),
    (STEP, {name: HIT[name] for name in HIT if name != "dt"}, "pass", "without dt, t is graded"),
    (STEP, {**HIT, "dt": None, "t": 0.75 + 1e-8}, "fail", "t is off by"),
    (STEP, {**HIT, "dt": None, "wall": "left"}, "fail", "left, must be right"),
    (STEP, {**HIT, "dt": 0.75 + 1e-8}, "fail", "dt is off by"),
    (STEP, REJECTED, "fail", "state.x"),
    (STEP, CORNER, "fail", "undefined, must be right"),
    (STEP, UNDECIDED, "declined", "within rounding"),
    (STEP, {"seq": 1, "error": "segmentation\nfault"}, "error", "segmentation fault"),
    (HORIZON, END, "pass", ""),
    (HORIZON, HIT, "fail", "right, must be horizon"),
    (HORIZON, {**END, "t": 0.25}, "fail", "t is off by"),
    (TIE, CORNER, "pass", ""),
    (TIE, UNDECIDED, "pass", ""),
    (TIE, HIT, "fail", "must be undefined corner"),
    (TIE, {**CORNER, "reason": "sliding"}, "fail", "undefined sliding, must be undefined corner"),
    (REFUSAL, REJECTED, "pass", ""),
    (REFUSAL, HIT, "fail", "collision, must be rejected"),
    (REFUSAL, UNDECIDED, "declined", ""),
    (EITHER, HIT, "pass", ""),
    (EITHER, REJECTED, "pass", ""),
    (EITHER, UNDECIDED, "pass", "a refusal is allowed here"),
    (EITHER, {**HIT, "vx": 1.0}, "fail", ""),
    # An enclosure too wide to accept a right x still refuses a wrong one.
    (WIDE, HIT, "indeterminate", "x"),
    (WIDE, {**HIT, "x": 1.1}, "fail", "x"),
    (PATH, {"steps": [HIT, NEXT]}, "pass", ""),
    (PATH, {"steps": [HIT]}, "fail", "step 2: missing, 1 of 2"),
    (PATH, {"steps": []}, "fail", "step 1: missing"),
    (PATH, {"steps": [HIT, NEXT, HIT]}, "fail", "1 steps too many"),
    (PATH, {"steps": [NEXT, HIT]}, "fail", "step 1: left, must be right"),
    (PATH, {"steps": [HIT, {**NEXT, "t": 2.0}]}, "fail", "step 2: t is off by"),
    (PATH, {"steps": [HIT, UNDECIDED]}, "declined", "step 2: undecided"),
    (PATH, {"steps": [{**HIT, "vx": 1.0}, UNDECIDED]}, "fail", "step 1: vx"),
    (PATH, UNDECIDED, "declined", ""),
    (PATH, REJECTED, "fail", ""),
]


MISSHAPEN = [
    (STEP, [HIT]),
    (STEP, None),
    (STEP, {}),
    (STEP, {"outcome": "hit"}),
    (STEP, {name: HIT[name] for name in HIT if name != "y"}),
    (STEP, {name: HIT[name] for name in HIT if name != "wall"}),
    (STEP, {**HIT, "wall": "roof"}),
    (STEP, {**HIT, "wall": None}),
    (STEP, {**HIT, "x": "1.0"}),
    (STEP, {**HIT, "x": True}),
    (STEP, {**HIT, "x": None}),
    (STEP, {**HIT, "x": 10**400}),
    (STEP, {**HIT, "x": math.nan}),
    (STEP, {**HIT, "vy": math.inf}),
    (STEP, {"outcome": "undefined", "reason": "bad luck"}),
    (STEP, {"outcome": "undecided"}),
    (STEP, {"steps": [HIT]}),
    (PATH, HIT),
    (PATH, {"steps": {"0": HIT}}),
    (PATH, {"steps": "none"}),
    (PATH, {"steps": [HIT, 3]}),
    (PATH, {"steps": [END, HIT]}),
]


@pytest.mark.parametrize(
    ("asked", "answer", "verdict", "words"),
    [*VERDICTS, *((asked, answer, "wrong-format", "") for asked, answer in MISSHAPEN)],
)
def test_verdicts(asked, answer, verdict, words):
    found = grade(asked, answer)
    assert found.verdict == verdict, found
    assert words in found.why
    assert "\n" not in found.why
    assert math.isnan(found.ulps) or verdict not in ("wrong-format", "error", "declined")


def test_backward_ulps_of_known_errors():
    """An error of 2^-50 in dt against (1.25 + 0.75 + 2^-50) 2^-53 is 4 backward ulps, a little less.

    A truth that is exactly zero, and that nothing moves, is measured by the vector that it belongs to.
    """
    found = grade(STEP, {**HIT, "dt": 0.75 + 2.0**-50})
    assert found.verdict == "pass"
    assert found.ulps == pytest.approx(4, rel=1e-14)
    assert found.relative == pytest.approx(2.0**-51, rel=1e-14)
    found = grade(STEP, {**HIT, "vy": 1e-17})
    assert (found.verdict, 0 < found.ulps < 1) == ("pass", True)
    assert grade(STEP, {**HIT, "vy": 1e-12}).ulps > 1000
    assert grade(STEP, HIT).ulps == 0


@pytest.mark.parametrize(
    ("ulps", "reached"),
    [
        ([], "A"),
        ([0.0, 4.0, math.nan], "A"),
        ([4.1], "B"),
        ([1.0, 1e4], "B"),
        ([1.0001e4], "C"),
        ([1.0, math.inf], "C"),
    ],
)
def test_precision_class(ulps, reached):
    assert precision_class(ulps) == reached


@pytest.fixture(scope="module")
def corpus() -> list[Vector]:
    return load("stress")


def test_exact_answers_pass_within_an_ulp(corpus):
    grades = [grade(asked, certified_answer(asked)) for asked in corpus]
    assert {found.verdict for found in grades} == {"pass"}
    assert max(found.ulps for found in grades if not math.isnan(found.ulps)) <= 1.0


def shifted(asked: Vector, index: int, name: str, by: float):
    """The exact answer with one number of a step moved by so much backward error; None for an exact zero."""
    answer = json.loads(json.dumps(certified_answer(asked)))
    told = answer.get("steps") or answer.get("states") or [answer]
    step, steps = told[index if asked.kind == "trajectory" else 0], asked.expect[0].steps
    pair = next((pair for pair in (("x", "y"), ("vx", "vy")) if name in pair), (name,))
    allowed = dict(zip(NUMBERS, steps[index].allowance, strict=True))
    if name == "t":
        spans = [s.allowance[0] + float(s.centre("dt")) for s in steps[: index + 1]]
        size = 2 * abs(asked.state.t) + sum(spans)
    else:
        size = max(allowed[n] + abs(step[n]) for n in pair)
    step[name] += by * size
    return answer if size else None


def test_shifted_answers_fail_and_slightly_shifted_ones_pass(corpus):
    n_shifted = 0
    for i, asked in enumerate(corpus[::3]):
        steps = asked.expect[0].steps
        if not steps or "hard-case-4" in asked.group:
            continue  # extreme numbers: a shift would overflow or vanish
        index = i % len(steps) if asked.kind == "trajectory" else len(steps) - 1
        names = ["t", *NUMBERS] if steps[index].wall else ["t", *NUMBERS[1:]]
        name = names[i % len(names)]
        bound = float(physics_bound(asked.condition))
        answer = shifted(asked, index, name, SHIFT * bound)
        if answer is None:
            continue  # an exact zero
        found = grade(asked, answer)
        assert found.verdict == "fail", (asked.id, index, name, found)
        assert found.why.split(" is off")[0].split(": ")[-1] == name
        assert grade(asked, shifted(asked, index, name, bound / 4)).verdict == "pass", asked.id
        n_shifted += 1
    assert n_shifted > 0.27 * len(corpus)
