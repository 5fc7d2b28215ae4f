"""Each guard of the verifier is provoked by a line: bad, open or false, beside a neighbour that is not.

Most numbers are enclosed widely, so that lines can be written by hand: outcome, walls and stays count.
"""

import math
from fractions import Fraction
from itertools import islice
from typing import Any

import pytest
from support.starts_by_hand import CAP, MUSHROOM, STARTS, STEM, bang_bang, fourier, state

from conformance import verify

WIDE = ["-1E9", "1E9"]
TABLES = {"cap": CAP, "stem": STEM, "mushroom": MUSHROOM}
REJECTED = {"outcome": "rejected"}


def step(wall: str | None, **numbers: list[str]) -> dict[str, Any]:
    """Return a claimed step, all numbers enclosed widely but those that are given."""
    return dict.fromkeys(verify.NUMBERS, WIDE) | numbers | ({"wall": wall} if wall else {})


def claim(*walls: str | None) -> dict[str, Any]:
    """Return the claim that these walls are met, None for the horizon."""
    return {"outcome": "collision" if walls[-1] else "horizon", "steps": [step(wall) for wall in walls]}


def undefined(reason: str) -> list[dict[str, Any]]:
    return [{"outcome": "undefined", "reason": reason}, {"outcome": "undecided"}]


def line(
    scene: Any,
    start: dict[str, Any],
    expect: Any,
    t_end: float = 9.0,
    kind: str = "step",
    n: int | None = None,
) -> dict[str, Any]:
    """Return a line of a corpus that makes a claim."""
    found = {"id": "guard/1", "kind": kind, "scene": scene, "state": start, "t_end": t_end}
    found["expect"] = expect if isinstance(expect, list) else [expect]
    return found if kind == "step" else {**found, "collisions": len(expect["steps"]) if n is None else n}


def judge(*args: Any, **options: Any) -> str:
    return verify.verify_line(line(*args, **options)).status


REST = {"cap": state(0.0, 0.0625, 0.0, 0.0), "stem": state(0.0, -0.0625, 0.0, 0.0)}
REST["mushroom"] = REST["cap"]


def judge_scene(scene: Any) -> str:
    """Return "valid" or "invalid", by which claim on a particle at rest is proved; "open" for neither."""
    rest = REST.get(scene["table"] if isinstance(scene.get("table"), str) else "cap", REST["cap"])
    found = [judge(scene, rest, expect, 2.0**-10) for expect in (claim(None), REJECTED)]
    names = {("proved", "false"): "valid", ("false", "proved"): "invalid"}
    return names.get((found[0], found[1]), "open")


def law(value: Any) -> dict[str, Any]:
    """Return a cap whose radius is this law."""
    return {"table": "cap", "r": value}


def knots(n: int) -> list[list[float]]:
    return [[float(i), 1.0 + 0.25 * (i % 2 and i < n - 1)] for i in range(n)]


SCENES: dict[str, list[dict[str, Any]]] = {
    "valid": [
        *TABLES.values(),
        {**CAP, "name": "a", "notes": "b\n\tc"},
        law(fourier()),
        law(fourier(period=2.0, omega=None)),
        law({"kind": "fourier", "mean": 1.0, "period": 2.0, "cos": [0.5]}),
        law(fourier(sin=[2.0**-9] * 16, cos=[2.0**-9] * 16)),
        law(fourier(sin=[0.5, 0.4999])),
        law(fourier(omega=2.0**-1000)),
        law(bang_bang(*knots(2))),
        law(bang_bang(*knots(256))),
        law(bang_bang([-1.0, 1.0], [0.0, 2.0], [0.5, 1.0])),
        {**MUSHROOM, "w": 1.0},
        {**MUSHROOM, "slope": 0.4999},
        {**MUSHROOM, "slope": -3.0},
        {"table": "mushroom", "r": 1.0, "nu": 1.0, "h": 1.0},
        {"table": "mushroom", "r": fourier(), "nu": 0.5, "h": 1.0, "slope": 0.25},
        {**MUSHROOM, "r": fourier(mean=2.0), "w": fourier(mean=1.0, sin=[0.5])},
        {**STEM, "w": fourier(mean=1.0), "slope": 0.75, "h": 0.75},
        {**MUSHROOM, "w": fourier(mean=0.5), "h": fourier(mean=1.0, sin=[0.5]), "slope": 0.25},
    ],
    "invalid": [
        {"r": 1.0},
        {"table": None, "r": 1.0},
        {"table": ["cap"], "r": 1.0},
        {"table": "disk", "r": 1.0},
        {"table": "cap"},
        {"table": "stem", "w": 1.0},
        {"table": "stem", "h": 1.0},
        {"table": "mushroom", "r": 1.0, "h": 1.0},
        {**MUSHROOM, "nu": 0.5},
        law(None),
        law("1"),
        law(True),
        law([1.0]),
        law(math.nan),
        law(math.inf),
        law(10**400),
        law({}),
        law(fourier(kind="wave")),
        law({"mean": 1.0, "omega": 1.0}),
        law({"kind": "fourier", "omega": 1.0}),
        law({"kind": "fourier", "mean": 1.0}),
        law(fourier(period=2.0)),
        law(fourier(mean="1")),
        law(fourier(sin=0.25)),
        law(fourier(sin=["0.25"])),
        law(fourier(cos=[0.0] * 17)),
        law(fourier(sin=[2.0**-9] * 17)),
        law(fourier(omega=0.0)),
        law(fourier(omega=-1.0)),
        law(fourier(omega=None, period=0.0)),
        law(fourier(omega=None, period=-2.0)),
        law(fourier(omega=math.inf)),
        law({"kind": "bang-bang"}),
        law({"kind": "bang-bang", "knots": 5}),
        law(bang_bang(*knots(1))),
        law(bang_bang(*knots(257))),
        law(bang_bang([0.0, 1.0], 1.0)),
        law(bang_bang([0.0, 1.0, 2.0], [1.0, 1.0])),
        law(bang_bang([0.0, 1.0], [1.0])),
        law(bang_bang([0.0, 1.0], ["1", 1.0])),
        law(bang_bang([0.0, 1.0], [1.0, 2.0])),
        law(bang_bang([0.0, 1.0], [1.0, 2.0], [1.0, 2.5], [2.0, 1.0])),
        law(bang_bang([0.0, 1.0], [1.5, 2.0], [1.0, 2.5], [2.0, 1.0])),
        law(bang_bang([0.1, 1.0], [0.5, 0.75], [1.1, 1.0])),
        law(0.0),
        law(-1.0),
        law(fourier(sin=[1.0])),
        law(fourier(sin=[1.25])),
        law(fourier(mean=0.75, cos=[0.5], sin=[0.0, 0.5])),
        law(bang_bang([0.0, 1.0], [1.0, 0.0], [2.0, 1.0])),
        {**STEM, "h": 0.0},
        {**STEM, "w": -1.0, "h": 1.0},
        {**STEM, "slope": 1.0},
        {**STEM, "w": fourier(), "slope": 0.75, "h": 1.0625},
        {**MUSHROOM, "slope": 0.5},
        {**MUSHROOM, "w": 1.0001},
        {**MUSHROOM, "r": fourier(), "w": 0.8},
        {"table": "mushroom", "r": 1.0, "nu": 1.0001, "h": 1.0},
        {"table": "mushroom", "r": 1.0, "nu": fourier(mean=0.8), "h": 1.0},
        {"table": "mushroom", "r": 1.0, "nu": fourier(mean=0.25), "h": 1.0},
        {**MUSHROOM, "r": fourier(), "w": fourier(mean=0.5, omega=2.0, sin=[0.01])},
        {**MUSHROOM, "r": fourier(), "w": fourier(mean=0.5, omega=None, period=6.0, sin=[0.01])},
        {**MUSHROOM, "h": fourier(omega=None, period=2.0), "w": bang_bang([0, 0.5], [1, 0.4], [3, 0.5])},
    ],
    "open": [  # r - w touches 0 at an irrational phase
        {**MUSHROOM, "r": 2.0, "w": fourier(mean=1.375, cos=[0.375], sin=[0.5])},
    ],
}  # fmt: skip


@pytest.mark.parametrize(
    ("wanted", "scene"), [(wanted, scene) for wanted, scenes in SCENES.items() for scene in scenes], ids=str
)
def test_a_scene_is_valid_or_not(wanted: str, scene: dict[str, Any]) -> None:
    assert judge_scene(scene) == wanted


EXPECTED: dict[str, Any] = {"horizon": claim(None), "rejected": REJECTED}
EXPECTED |= {reason: undefined(reason) for reason in ("corner", "mouth-edge", "sliding", "tangency")}
EXPECTED |= {wall: claim(wall) for wall in verify.WALLS["mushroom"]}
MIRRORED = {"left": "right", "right": "left"}


@pytest.mark.parametrize(("scene", "start", "t_end", "truth"), STARTS, ids=range(len(STARTS)))
def test_what_is_true_of_a_start_is_proved(
    scene: dict[str, Any], start: dict[str, Any], t_end: float, truth: str
) -> None:
    """So it is in the mirror; and every other claim is false."""
    wall = start["wall"]
    mirrored = {**start, "x": -start["x"], "vx": -start["vx"], "wall": MIRRORED.get(wall, wall)}
    verdicts = {name: judge(scene, start, claimed, t_end) for name, claimed in EXPECTED.items()}
    assert verdicts == {name: "proved" if name == truth else "false" for name in EXPECTED}
    assert judge(scene, mirrored, EXPECTED[MIRRORED.get(truth, truth)], t_end) == "proved"


# Of a state, what no rule allows.
BAD_STATES: list[dict[str, Any]] = [
    {"t": None}, {"x": "0"}, {"y": math.nan}, {"vx": math.inf}, {"vy": True}, {"x": 10**400},
    {"wall": "floor"}, {"wall": "mouth"}, {"wall": 5}, {"t": 9.5},
]  # fmt: skip


@pytest.mark.parametrize("fields", BAD_STATES, ids=str)
def test_a_bad_state_is_rejected(fields: dict[str, Any]) -> None:
    start = {**state(0.0, 0.5, 0.0, -1.0), **fields}
    assert judge(CAP, start, REJECTED) == "proved"
    assert judge(CAP, start, claim("base")) == "false"


@pytest.mark.parametrize("name", verify.FIELDS)
def test_a_state_lacks_no_field(name: str) -> None:
    start = state(0.0, 0.5, 0.0, -1.0)
    del start[name]
    assert judge(CAP, start, REJECTED) == "proved"


TANGENT = state(0.5, 0.25, 0.0, 1.0)  # its line touches the circle of radius w: captured or free is open


def test_a_hit_that_is_neither_captured_nor_free_leaves_a_flow_open():
    """|x vy - y vx| = w |v| exactly, so no enclosure has a sign."""
    arrived = claim(None)
    for w, stays, wanted in ((0.5, None, "not proved"), (0.5, [[0, 1]], "not proved"),
                             (0.501, None, "proved"), (0.499, None, "false")):  # fmt: skip
        scene, expect = (
            {**MUSHROOM, "w": w},
            arrived if stays is None else {**claim("arc", None), "stays": stays},
        )
        expect = {**expect, "outcome": "horizon"}
        assert judge(scene, TANGENT, expect, 1.0, kind="flow", n=2) == wanted
    captured = {**claim("arc", None), "stays": [[0, 1]]}
    assert judge({**MUSHROOM, "w": 0.499}, TANGENT, captured, 1.0, kind="flow", n=2) == "proved"


def test_a_tie_further_on_a_path_is_open():
    """There the state is enclosed only, and no tie is known."""
    path = claim("floor", "right")
    start = state(0.25, -0.5, 0.5, -1.0)
    for expect in (
        path,
        {**claim("floor"), "outcome": "undefined", "reason": "corner"},
        claim("floor", "base"),
    ):
        assert judge(STEM, start, expect, kind="trajectory", n=2) == "not proved"
    assert judge(STEM, start, path, 2.0, kind="trajectory", n=2) == "not proved"
    assert judge(STEM, start, claim("floor", None), 1.5, kind="trajectory", n=2) == "not proved"
    assert judge(STEM, start, claim("floor", None), 1.375, kind="trajectory", n=2) == "proved"


FALL = state(0.0, 0.5, 0.0, -1.0)
NUMBERS = {"dt": "0.5", "x": "0", "y": "0", "vx": "0", "vy": "1"}


@pytest.mark.parametrize("name", verify.NUMBERS)
def test_each_number_of_a_step_is_compared(name: str) -> None:
    exact = {other: [number, number] for other, number in NUMBERS.items()}
    number = NUMBERS[name]
    for ends, wanted in (
        ([number, number], "proved"), (["-1E-30", "1E-30"] if number == "0" else ["4E-1", "1E0"], "proved"),
        ([number + ".0000000000000001" if number in "01" else "0.50000001", "9"], "false"),
        (["-9", "-0.0000000000000001" if number == "0" else "0.49999999"], "false"),
        (["9", "-9"], "false"),
    ):  # fmt: skip
        found = {"outcome": "collision", "steps": [{"wall": "base", **exact, name: ends}]}
        assert judge(CAP, FALL, found) == wanted, ends


@pytest.mark.parametrize(
    "ends",
    [None, "0.5", [], ["0.5"], ["0.5", "0.5", "0.5"], [0.5, 0.5], ["0.5", None], ["0.5", "0x1"],
     ["0.5", "1E99999"], ["0.5", "1e0"], ["0.5", " 1"], ["0.5", "1."], ["0.5", "+1"], ["0.5", "nan"],
     [["0.5"], "1"]],
)  # fmt: skip
def test_a_number_is_two_decimals(ends: Any) -> None:
    found = {"outcome": "collision", "steps": [step("base") | {"dt": ends}]}
    words = "dt must be" if isinstance(ends, list) else "a field dt of another type"
    with pytest.raises(verify.Unreadable, match=words):
        judge(CAP, FALL, found)


@pytest.mark.parametrize(
    "change",
    [
        {"kind": "jump"}, {"kind": None}, {"collisions": True}, {"collisions": 0}, {"collisions": 1.0},
        {"collisions": 2}, {"kind": "trajectory", "collisions": 10**6}, {"expect": []}, {"expect": None},
        {"expect": [{}]}, {"expect": [{"outcome": 5}]}, {"expect": [5]}, {"state": None}, {"scene": None},
        {"scene": []}, {"expect": [{"outcome": "collision", "steps": 5}]},
    ],
    ids=str,
)  # fmt: skip
def test_what_is_no_line_is_unreadable(change: dict[str, Any]) -> None:
    honest = line(CAP, FALL, claim("base"))
    assert verify.verify_line(honest).status == "proved"
    with pytest.raises(verify.Unreadable):
        verify.verify_line(honest | change)


@pytest.mark.parametrize(
    ("expect", "options", "wanted"),
    [
        (claim("base", "arc"), {"kind": "trajectory"}, "proved"),
        (claim("base", "arc"), {"kind": "trajectory", "n": 999_999}, "false"),
        (claim("base"), {"kind": "trajectory", "n": 2}, "false"),
        (claim("base", "arc", None), {"kind": "trajectory", "t_end": 1.75}, "proved"),
        (claim("base", "arc", None), {"kind": "trajectory", "t_end": 1.75, "n": 9}, "proved"),
        (claim("base", "arc"), {"kind": "trajectory", "t_end": 1.75, "n": 9}, "false"),
        (claim("base", "base"), {"kind": "trajectory"}, "false"),
        (claim("base", "arc") | {"outcome": "horizon"}, {"kind": "trajectory"}, "false"),
        (claim("base", "arc"), {}, "false"),
        ({"outcome": "collision"}, {}, "false"),
        ([claim("base"), {"outcome": "rejected"}], {}, "false"),
        ([claim("base"), {"outcome": "undecided"}], {}, "false"),
        ([REJECTED, {"outcome": "undecided"}], {}, "false"),
        (claim(None), {"kind": "flow", "n": 3, "t_end": 1.75}, "proved"),
        (claim(None), {"kind": "flow", "n": 2, "t_end": 1.75}, "false"),
        (claim(None), {"kind": "flow", "n": 4, "t_end": 1.75}, "false"),
        (claim("base", "arc", None), {"kind": "flow", "n": 3, "t_end": 1.75}, "false"),
        (claim(None) | {"stays": [[0, 0]]}, {"kind": "flow", "n": 3, "t_end": 1.75}, "false"),
    ],
)  # fmt: skip
def test_a_path_is_compared_whole(expect: Any, options: dict[str, Any], wanted: str) -> None:
    assert judge(CAP, FALL, expect, **options) == wanted


@pytest.mark.parametrize("bits", [24, 128])
def test_nothing_is_divided_by_what_may_be_zero(bits: int) -> None:
    one = verify.number(1, bits)
    for lo, hi in ((0, 0), (0, 1), (-1, 0), (-1, 1)):
        with pytest.raises(verify.Unproved, match="divisor"):
            one / verify.Interval(lo, hi, -5, bits)


@pytest.mark.parametrize("bits", [24, 128])
def test_cosines_are_taken_of_narrow_phases(bits: int) -> None:
    """Of phases as far apart as a radian or more nothing is known but that a cosine is at most 1."""
    for part in (0.125, 0.0625):
        low, high = verify.cos_sin(verify.Interval(0, int(part * 2**bits), -bits, bits))[0].ends
        assert low <= 1.0 <= high
    for width in (1, 2, 99):
        with pytest.raises(verify.Unproved, match="phase"):
            verify.cos_sin(verify.Interval(0, width << bits, -bits, bits))


HALF_STEM = {**STEM, "w": 0.5}
WAVY = {**STEM, "w": fourier()}
SHALLOW = {**MUSHROOM, "w": 0.875, "h": 2.0**-8}
ROLLING = {**MUSHROOM, "w": 0.75, "h": fourier(sin=[], cos=[0.125])}
BREATHING = {**CAP, "r": fourier(omega=3.0, sin=[], cos=[0.25])}
# Scene, state, horizon, bits; how many steps are proved with so few, and what is then open.
OPEN: list[tuple[dict[str, Any], dict[str, Any], float, int, int, str]] = [
    (HALF_STEM, state(0.31, -0.58, -6.48002, 4.64), 99.0, 18, 0, "two walls are met together"),
    (CAP, state(-0.14, 0.15, 0.049, -0.019), 7.8947, 16, 0, "whether y = 0 is crossed before the horizon"),
    ({**MUSHROOM, "slope": 0.25}, state(-0.05, 0.33, -0.9, -0.66), 99.0, 20, 0, "whether the mouth is open"),
    (SHALLOW, state(0.949689, 0.030993, -42.9624, -0.7302), 99.0, 12, 0, "a wall is met at the height"),
    (ROLLING, state(-0.57, -0.41, 2.638, 0.82), 0.5, 16, 0, "right: f is too small"),
    (BREATHING, state(0.05, 0.54, -0.037, -0.068), 99.0, 16, 2, "the sign of a divisor is open"),
    (WAVY, state(1.21036, -0.5, -1.0, 0.0, t=1.0), 99.0, 16, 0, "whether the state is on wall right"),
    (WAVY, state(1.2103677, -0.5, -1.0, 0.0, "right", t=1.0), 99.0, 16, 0, "whether the state is on wall"),
]


@pytest.mark.parametrize(("scene", "start", "t_end", "bits", "n", "reason"), OPEN, ids=range(len(OPEN)))
def test_what_few_bits_leave_open_is_unproved(
    scene: dict[str, Any], start: dict[str, Any], t_end: float, bits: int, n: int, reason: str
) -> None:
    """With more bits the same question goes on."""
    table = verify.read_scene(scene, [verify.WORK])
    given = verify.read_state(table, start)
    steps = verify.walk(table, given, Fraction(t_end), bits)
    for _ in range(n):
        next(steps)
    with pytest.raises(verify.Unproved, match=reason):
        next(steps)
    assert len(list(islice(verify.walk(table, given, Fraction(t_end), 256), n + 1))) == n + 1


def test_a_search_begins_where_f_is_positive():
    """Below the floor, on the way up, f rises through 0; that is no hit, and no wall that is never met."""
    scene = verify.read_scene(STEM, [verify.WORK])
    below = verify.State(*map(Fraction, (0, 0, -1.25, 0, 1)), None)
    clock = verify.Clock(scene, below.t, 128)
    line = [verify.number(number, 128) for number in below[1:5]]
    flight = verify.Flight(clock, tuple(line), Fraction(9), clock.zero, state=below)
    with pytest.raises(verify.Unproved, match="positive where the search begins"):
        flight.first_root("floor", clock.zero, verify.number(Fraction(1, 2), 128))


def test_few_bits_do_not_tell_whether_a_start_is_late():
    scene = verify.read_scene({**CAP, "r": fourier()}, [verify.WORK])
    start = verify.State(Fraction(2.0**31 * math.pi), *map(Fraction, (0, 0, 0, 0)), None)
    assert not verify.is_extreme(scene, start, 128)
    with pytest.raises(verify.Unproved, match="so late"):
        verify.is_extreme(scene, start, 24)
