"""Guards of the reference's proofs: bounds on either side, and questions that must stay undecided."""

from fractions import Fraction
from typing import Any

import pytest
from support.starts_by_hand import CAP, MUSHROOM, STARTS, STEM, bang_bang, fourier, state

import reference
from reference import arithmetic, rational
from reference.arithmetic import Arithmetic, Exhausted, Interval, is_below
from reference.course import Course
from reference.isolation import Isolator
from reference.jets import Jet
from reference.prepared import prepare
from reference.timeline import Timeline
from scene import Rejected, State, Undecided, Undefined, Wall, from_data

MIRRORED = {"left": "right", "right": "left"}


def found(scene: dict[str, Any], start: dict[str, Any], t_end: float) -> str:
    """Return the wall met, or the outcome, or why it is undefined."""
    outcome = reference.next_collision(from_data(scene), State(**start), t_end, digits=10)
    if isinstance(outcome, Undefined):
        return outcome.reason
    if isinstance(outcome, reference.Collision):
        return outcome.wall
    if isinstance(outcome, Rejected):
        return "rejected"
    return "horizon" if isinstance(outcome, reference.Horizon) else "undecided"


@pytest.mark.parametrize(("scene", "start", "t_end", "truth"), STARTS, ids=range(len(STARTS)))
def test_what_is_true_of_a_start_is_answered(
    scene: dict[str, Any], start: dict[str, Any], t_end: float, truth: str
) -> None:
    wall = start["wall"]
    mirrored = {**start, "x": -start["x"], "vx": -start["vx"], "wall": MIRRORED.get(wall, wall)}
    assert found(scene, start, t_end) == truth
    assert found(scene, mirrored, t_end) == MIRRORED.get(truth, truth)


def swelling(mean: float, cos: float, omega: float = 3.0) -> dict[str, Any]:
    return fourier(mean=mean, omega=omega, cos=[cos], sin=[])


LEGS = bang_bang([0.0, 1.0], [0.25, 1.25], [1.0, 1.0])
SLANTED = {**MUSHROOM, "slope": -2.0}
HALF_STEM = {**STEM, "w": 0.5}
WAVY = {**STEM, "h": fourier()}
FLAT = fourier(omega=None, period=2.0, sin=[], cos=[0.25, -0.0625 + 2.0**-30])
# Scene, state, horizon, decimals to work with; how many steps are proved, and why no further one is.
OPEN: list[tuple[dict[str, Any], dict[str, Any], float | None, int, int, str]] = [
    (CAP, state(0.21, 0.48, -0.14, -0.001), None, 1, 0, "the signs around the root are not strict"),
    (HALF_STEM, state(0.48, -0.27, 0.078, 1.08), None, 1, 0, "f has no sign where the interval is split"),
    (SLANTED, state(-0.03, -0.31, -0.053, 0.039), None, 1, 1, "the sign of vy is open"),
    (HALF_STEM, state(0.31, -0.58, -6.476, 4.64), None, 3, 0, "two walls are met together"),
    ({**MUSHROOM, "slope": 0.25}, state(0.02, 0.14, 0.12, -0.035), None, 3, 0, "the mouth's edge is met"),
    ({**STEM, "w": swelling(0.75, 0.1875, 1.0)}, state(-0.61, -0.58, 0.17, 0.072), None, 2, 1,
     "a corner is met"),
    (CAP, state(-0.47, 0.24, 0.42, 0.0), None, 1, 1, "y = 0 is crossed within the enclosure of the start"),
    ({**CAP, "r": swelling(1.0, 0.125)}, state(-0.11, 0.25, -0.06, 0.0), None, 1, 0,
     "f and f' vanish together"),
    ({**SLANTED, "w": swelling(0.5, 0.125)}, state(-0.43, 0.44, 1.36, -0.88), None, 1, 1,
     "a wall is met within the enclosure of the start"),
    ({**SLANTED, "w": 0.25, "h": LEGS}, state(-0.08, 0.53, -0.021, -0.066), None, 1, 0,
     "f of left has no sign where a stretch of the flight begins"),
    (MUSHROOM, state(-0.1694277321860328, 0.1909776383028564, 0.5830474680228209, -0.1909776383028564), None,
     1, 0, "a wall is met at the height of the mouth"),
    ({**CAP, "r": swelling(1.0, 0.25)}, state(-0.31, 0.2, -0.7, 0.0), None, 1, 1,
     "the flight begins along its wall"),
    ({**STEM, "w": 0.75, "slope": -2.0}, state(0.56, -0.05, 0.19, 0.05), 1.0, 4, 0,
     "horizon and collision fall together"),
    ({**CAP, "r": LEGS}, state(-0.47, 0.34, -0.77, 0.0), 1.0, 1, 1, "horizon and event fall together"),
    ({**STEM, "w": fourier()}, state(1.2103, -0.5, -1.0, 0.0, t=1.0), None, 1, 0,
     "the state may be on wall right"),
    (WAVY, state(0.0, -1.2103677, 0.0, -0.13507, "floor", t=1.0), None, 1, 0,
     "whether the state is on wall floor"),
    (WAVY, state(0.0, -1.2103677, 0.0, -0.1350755, "floor", t=1.0), None, 4, 0,
     "f' at the start has no sign"),
    ({**STEM, "h": FLAT}, state(0.0, -1.1875 - 2.0**-30, 0.0, 0.0, "floor"), None, 5, 0,
     "f'' at the start has no sign"),
]  # fmt: skip


@pytest.mark.parametrize(("scene", "start", "t_end", "working", "n", "reason"), OPEN, ids=range(len(OPEN)))
def test_what_few_digits_leave_open_is_undecided(
    scene: dict[str, Any], start: dict[str, Any], t_end: float | None, working: int, n: int, reason: str
) -> None:
    """With more digits the same question goes on."""
    table, given = from_data(scene), State(**start)
    path = reference.trajectory(table, given, 4, t_end, working=working)
    assert len(path.steps) == n
    assert isinstance(path.outcome, Undecided)
    assert path.outcome.reason.startswith(reason)
    assert path.outcome.reason.endswith(f"({working} digits)")
    assert len(reference.trajectory(table, given, n + 1, t_end, working=60).outcomes) == n + 1


def test_work_that_ends_anywhere_leaves_the_question_open(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also within the proof that the arc is never met."""
    scene = from_data({**CAP, "r": fourier(cos=[0.125, 0.0625])})
    start = State(0.0, 0.125, 0.25, 0.0001, 0.0001)
    ends_within = set()
    honest = Course._is_never_met

    def watched(self: Course, wall: Wall, s: Interval) -> bool:
        try:
            return honest(self, wall, s)
        except Exhausted:
            ends_within.add(self.arithmetic.work.spent)
            raise

    monkeypatch.setattr(Course, "_is_never_met", watched)
    for limit in range(0, 250, 10):
        monkeypatch.setattr(arithmetic, "MAX_WORK", float(limit))
        outcome = reference.next_collision(scene, start, 1e4, digits=10)
        assert isinstance(outcome, Undecided)
        assert outcome.reason.startswith(f"more than {limit} evaluations of the laws")
    assert len(ends_within) > 5
    monkeypatch.undo()
    assert isinstance(reference.next_collision(scene, start, 1e4, digits=10), reference.Collision)


SWAYING = {**STEM, "slope": bang_bang([0.0, 0.125], [1.0, 0.25], [2.0, 0.125])}


@pytest.mark.parametrize(
    ("y", "vy", "time"),
    [
        (0.5, -2.0, 0.25), (-0.5, 2.0, 0.25), (0.5, 2.0, None), (-0.5, -2.0, None),
        (0.5, 0.0, None), (-0.5, 0.0, None), (0.0, 1.0, None), (0.0, -1.0, None), (0.0, 0.0, None),
    ],
)  # fmt: skip
def test_the_mouth_is_crossed_at_a_time_ahead_or_never(y: float, vy: float, time: float | None) -> None:
    assert rational.crossing_time(State(0.0, 0.0, y, 1.0, vy)) == time


@pytest.mark.parametrize(
    ("scene", "start", "wall", "time"),
    [
        (STEM, state(0.0, -0.5, 2.0, 0.0), "right", 0.5),
        (STEM, state(0.0, -0.5, 2.0, 0.0), "left", None),
        (STEM, state(0.0, -0.5, -2.0, 0.0), "left", 0.5),
        (STEM, state(0.0, -0.5, 0.0, 1.0), "left", None),
        (STEM, state(0.0, -0.5, 0.0, -2.0), "floor", 0.25),
        (STEM, state(0.0, -0.5, 0.0, 2.0), "floor", None),
        (STEM, state(1.0, -0.5, 1.0, 0.0), "right", None),
        (STEM, state(1.0, -0.5, -1.0, 0.0, "right"), "left", 2.0),
        (STEM, state(1.0, -0.5, -1.0, 0.0, "right"), "right", None),
        ({**STEM, "slope": 0.25}, state(0.0, -1.0, 0.0, -2.0), "left", 1.5),
        ({**STEM, "h": fourier()}, state(0.0, -0.5, 0.0, -2.0), "floor", None),
        ({**STEM, "h": fourier()}, state(0.0, -0.5, 2.0, 0.0), "right", 0.5),
        ({**STEM, "w": fourier()}, state(0.0, -0.5, 2.0, 0.0), "right", None),
        (SWAYING, state(0.0, -0.5, 2.0, 0.0), "right", None),
        (SWAYING, state(0.0, -0.5, 0.0, -2.0), "floor", 0.25),
        (CAP, state(0.0, 0.5, 2.0, 0.0), "right", None),
    ],
)
def test_a_straight_wall_at_rest_is_met_at_a_time_ahead_or_never(
    scene: dict[str, Any], start: dict[str, Any], wall: Wall, time: float | None
) -> None:
    assert rational.straight_time(prepare(from_data(scene)), State(**start), wall) == time


@pytest.mark.parametrize("ends", [(0.3, 1.0), (0.1, 1.9), (0.0, 1.3), (0.7, 1.0)])
def test_where_f_vanishes_half_way_the_wider_part_is_cut(ends: tuple[float, float]) -> None:
    """Half way is a short number, which may lie aside."""
    exact = Arithmetic(20)
    a, b = map(exact.number, ends)
    middle = exact.middle(exact.hull(a, b))
    begin, one = exact.number(-1), exact.number(1)
    still = Timeline(exact, prepare(from_data(CAP)), Fraction(0))
    search = Isolator(exact, lambda s: Jet(s - middle, one, exact.zero), begin, timeline=still)
    is_left_wider = is_below(b - middle, middle - a)
    assert is_left_wider == (ends in [(0.3, 1.0), (0.1, 1.9)])
    assert is_below(search._split(a, b), middle) == is_left_wider
