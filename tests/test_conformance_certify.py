"""What makes a question fit to be certified, and what is written down of its answer, each at its bound."""

import math
from fractions import Fraction
from typing import Any

import msgspec
import numpy as np
import pytest
from support.tables import CIRCLE

import reference
from conformance.cases import certify as made
from conformance.cases.attacks import Judgement, Tally, flown, stepped
from conformance.cases.certify import (
    arrival,
    claimed_path,
    condition_number,
    finite,
    free_flight,
    mark,
    measured_step,
    nudged,
    proved_path,
    timing_condition,
)
from conformance.cases.draw import Draw, Family, Question, Unfit
from conformance.vectors import NUMBERS, Certified, Expectation, certified
from scene import BadInput, Collision, Horizon, Rejected, State, Undecided, Undefined, load

STATIC = load("frozen-mushroom")
FALL = State(0.0, 0.0, 0.5, 0.0, -1.0)
START = State(0.25, 0.2, 0.3, 10.0, -3.0)
MOVING = load("moving-cap")


@pytest.mark.parametrize(
    ("state", "signs", "moved"),
    [
        (State(2.0, 3.0, -4.0, 5.0, -12.0, "arc"), (1, 1, 1, 1, 1), (3.0, 5.0, -2.0, 11.0, -6.0)),
        (State(-2.0, -4.0, 3.0, 12.0, 5.0), (-1, 1, -1, 1, -1), (-3.0, -2.0, 1.0, 18.0, -1.0)),
        (State(8.0, 1.0, 0.0, 0.0, 1.0), (1, 0, 1, -1, 0), (9.0, 1.0, 0.5, -0.5, 1.0)),  # t_end = 9
    ],
)  # fmt: skip
def test_a_state_is_nudged_by_a_part_of_its_vectors(state, signs, moved):
    """Of place and velocity the larger component tells how far; the time does not pass the horizon."""
    assert nudged(state, 9.0, signs, 0.5) == State(*moved, state.wall)


@pytest.mark.parametrize("bad", [math.inf, -math.inf, math.nan])
def test_an_allowance_that_is_no_number_makes_a_question_unfit(bad):
    assert finite([0.0, 1e300]) == [0.0, 1e300]
    for at in range(3):
        allowance = [1.0, 2.0, 3.0]
        allowance[at] = bad
        with pytest.raises(Unfit, match="overflows"):
            finite(allowance)


def flow(n: int, t_end: float, scene: Any = CIRCLE, state: State = FALL, **more: Any) -> Question:
    return Question(scene, state, t_end, n, True, **more)


def test_a_flow_is_certified_only_if_it_arrives():
    """It meets the base at 0.5 and the arc at 1.5."""
    for n, t_end in ((1, 1.0), (2, 2.0), (9, 2.0)):
        (found,) = proved_path(CIRCLE, flow(n + 1, t_end)).expect
        assert found.outcome == "horizon"
    for n, t_end in ((1, 1.0), (2, 2.0)):
        with pytest.raises(Unfit, match="no flow to the horizon"):
            proved_path(CIRCLE, flow(n, t_end))


def test_a_path_that_ends_is_certified_to_its_end():
    """Two hits and the horizon; the corner of a cap, after no hit, where a path is undefined."""
    found = proved_path(CIRCLE, Question(CIRCLE, FALL, 2.0, 9))
    assert [step.wall for step in found.expect[0].steps] == ["base", "arc", None]
    assert (found.collisions, len(found.expect)) == (3, 1)
    found = proved_path(CIRCLE, Question(CIRCLE, FALL, 9.0, 2))
    assert [step.wall for step in found.expect[0].steps] == ["base", "arc"]
    with pytest.raises(Unfit):  # it is asked of no such state
        proved_path(CIRCLE, Question(CIRCLE, replaced(FALL, y=-0.5), 9.0, 2))
    corner = State(0.0, 0.0, 0.5, 2.0, 0.5)
    with pytest.raises(Unfit, match=r"the first is too delicate|no collision"):
        proved_path(CIRCLE, Question(CIRCLE, replaced(corner, vy=-1.0), 9.0, 2))
    box = Question(STATIC, State(0.0, 0.25, 0.5, 0.125, -1.0), 9.0, 4)
    ends = proved_path(STATIC, box).expect
    assert ends[0].outcome == "collision"


def replaced(state: State, **fields: Any) -> State:
    return msgspec.structs.replace(state, **fields)


def test_a_path_after_which_nothing_is_defined():
    """Into a corner at once, and after a hit, where the state is enclosed only; outside; to the horizon."""
    stem = made.from_data({"table": "stem", "w": 1.0, "h": 1.0})
    question = Question(stem, State(0.0, 0.0, -0.5, 0.0, -0.5), 9.0, 3)
    assert [step.wall for step in proved_path(stem, question).expect[0].steps] == ["floor", "base", "floor"]
    claim = claimed_path(stem, State(0.0, 0.5, -0.5, 0.5, -0.5), 3, 9.0)
    assert (claim.outcome, claim.reason, claim.steps) == ("undefined", "corner", ())
    claim = claimed_path(stem, State(0.0, 0.25, -0.5, 0.5, -1.0), 3, 9.0, 30)
    assert (claim.outcome, [step.wall for step in claim.steps]) == ("undecided", ["floor"])
    claim = claimed_path(stem, State(0.0, 2.0, -0.5, 0.5, -1.0), 3, 9.0)
    assert claim == Expectation("rejected")
    claim = claimed_path(stem, State(1.0, 0.0, -0.5, 0.0, -0.5), 9, 2.5)
    assert (claim.outcome, [step.wall for step in claim.steps]) == ("horizon", ["floor", None])
    assert [claim.steps[1].ends(name)[0] for name in NUMBERS] == pytest.approx([0.5, 0.0, -0.75, 0.0, 0.5])
    claim = claimed_path(stem, State(1.0, 0.0, -0.5, 0.0, -0.5), 9, 1.5)
    assert [claim.steps[0].ends(name)[0] for name in NUMBERS] == pytest.approx([0.5, 0.0, -0.75, 0.0, -0.5])
    claim = claimed_path(stem, State(1.0, 0.0, -0.5, 0.0, -0.5), 1, 9.0)
    assert (claim.outcome, len(claim.steps)) == ("collision", 1)


def test_a_step_has_the_answers_that_are_right():
    stem = made.from_data({"table": "stem", "w": 1.0, "h": 1.0})
    corner = measured_step(stem, State(0.0, 0.5, -0.5, 0.5, -0.5), 9.0)
    assert (corner.expect[0].outcome, corner.expect[0].reason) == ("undefined", "corner")
    assert corner.condition == math.inf
    assert measured_step(stem, State(0.0, 2.0, -0.5, 0.5, -0.5), 9.0).expect == (Expectation("rejected"),)
    arrived = measured_step(stem, State(1.0, 0.25, -0.5, 0.25, -0.25), 2.0)
    (step,) = arrived.expect[0].steps
    assert (arrived.expect[0].outcome, step.wall) == ("horizon", None)
    assert [step.ends(name)[0] for name in NUMBERS] == [1.0, 0.5, -0.75, 0.25, -0.25]
    # |d out / d in| |in|: dt = t_end - t moves with t, x with t, x and vx.
    assert step.allowance == (1.0, 0.25 + 0.25 + 0.25, 0.25 + 0.5 + 0.25, 0.25, 0.25)
    assert arrived.condition == pytest.approx(1.0 / 0.75)


def test_a_condition_number_is_that_of_the_worst_vector():
    for out, allowance, worst in (
        ((2.0, 3.0, -4.0, 0.5, 0.0), (4.0, 4.0, 4.0, 1.0, 0.5), 2.0),
        ((2.0, 3.0, -4.0, 0.5, 0.0), (2.0, 4.0, 12.0, 1.0, 0.5), 3.0),
        ((2.0, 3.0, -4.0, 0.5, 0.0), (2.0, 4.0, 4.0, 0.5, 2.5), 5.0),
        ((0.0, 1.0, 1.0, 1.0, 1.0), (0.0, 1.0, 1.0, 1.0, 1.0), 1.0),
        ((1.0, 0.0, 0.0, 1.0, 1.0), (1.0, 1e-9, 0.0, 1.0, 1.0), math.inf),
        ((-4.0, 1.0, 1.0, 1.0, -1.0), (2.0, 0.5, 0.5, 0.5, 0.5), 0.5),
    ):
        assert condition_number(out, allowance) == worst


def test_the_jacobian_of_a_free_flight_is_that_of_differences():
    state = State(1.0, 0.5, -0.25, 3.0, -2.0)

    def out(t, x, y, vx, vy):
        return np.array([4.0 - t, x + vx * (4.0 - t), y + vy * (4.0 - t), vx, vy])

    numbers = np.array([1.0, 0.5, -0.25, 3.0, -2.0])
    columns = [(out(*(numbers + e)) - out(*(numbers - e))) / 2 for e in np.eye(5)]
    assert np.array_equal(free_flight(state, 3.0), np.array(columns).T)


def test_enclosures_of_a_path_are_narrow():
    """What is wider than 2^-72 of the allowance and the number makes the reference take more digits."""
    ends = {name: (Fraction(0), Fraction(0)) for name in NUMBERS}
    for name in NUMBERS:
        for number, allowance in ((1, 0.0), (-1, 0.0), (0, 1.0), (1, 3.0)):
            size = (Fraction(abs(number)) + Fraction(allowance)) / 2**72
            allowances = [allowance if one == name else 0.0 for one in NUMBERS]
            for part, is_wide in ((Fraction(99, 100), False), (Fraction(101, 100), True)):
                low = Fraction(number) - (size * part if number < 0 else 0)
                high = low + size * part
                step = certified(ends | {name: (low, high)}, allowances, "arc")
                assert made._is_wide(step) == is_wide, (name, number, allowance, part)


def test_a_hit_is_captured_if_its_line_misses_the_mouth():
    for x, meaning in ((0.25, "free"), (0.75, "captured")):
        path = reference.trajectory(STATIC, State(0.0, x, 0.125, 0.0, 1.0), 1, 9.0)
        assert mark(STATIC, path.steps[0]) == meaning
    stem = reference.trajectory(STATIC, State(0.0, 0.25, -0.125, 0.0, -1.0), 2, 9.0)
    assert [mark(STATIC, step) for step in stem.steps] == ["out", "free"]
    cap = reference.trajectory(CIRCLE, State(0.0, 0.75, 0.5, 0.0, -1.0), 2, 9.0)
    assert [mark(CIRCLE, step) for step in cap.steps] == ["", ""]


def a_step(dt: float, allowance: float, wall: str | None = "arc") -> Certified:
    numbers = {name: (Fraction(k), Fraction(k)) for k, name in enumerate(NUMBERS)}
    numbers["dt"] = (Fraction(dt), Fraction(dt) + Fraction(1, 2**60))
    return certified(numbers, [allowance, 1.0, 2.0, 3.0, 4.0], wall)


def test_a_flow_lists_begin_and_end_of_each_stay_and_the_horizon():
    """Flight times and what may move them add up over the flights between."""
    steps = [a_step(1.0, 0.5), a_step(2.0, 0.25), a_step(4.0, 8.0), a_step(8.0, 2.0), a_step(16.0, 1.0, None)]
    found = arrival(steps, [(1, 3)])
    assert [step.ends("dt")[0] for step in found.steps] == [3.0, 12.0, 16.0]
    assert [step.allowance for step in found.steps] == [(a, 1.0, 2.0, 3.0, 4.0) for a in (0.75, 10.0, 1.0)]
    assert (found.outcome, found.stays) == ("horizon", ((0, 1),))
    assert arrival(steps, [(0, 4)]).stays == ((0, 1),)
    assert arrival(steps, []).stays == ()
    assert [step.ends("dt")[0] for step in arrival(steps, []).steps] == [31.0]
    # Times 4, 16 of the stay, with allowances 1.75 and 11.75; the horizon's own does not count.
    assert timing_condition(found, State(1.0, 0.0, 0.5, 0.0, 1.0)) == pytest.approx(11.75 / 16.0)
    assert timing_condition(found, State(-3.0, 0.0, 0.5, 0.0, 1.0)) == math.inf
    assert timing_condition(arrival(steps, []), START) == 0.0


def test_a_family_without_a_question_says_so():
    def none(draw: Draw) -> Question:
        raise Unfit("never")

    def at_the_third(draw: Draw) -> Question:
        tried.append(draw)
        if len(tried) < 3:
            raise BadInput("not yet")
        return Question(CIRCLE, FALL, 9.0)

    tried: list[Draw] = []
    with pytest.raises(BadInput, match=r"idle/7: none of \d+ draws is a question"):
        Family("idle", "nothing", none).question(7)
    found = Family("patient", "an aim", at_the_third, source="sec. 3").question(7)
    assert (len(tried), found.group, found.rule, found.source) == (3, "patient", "an aim", "sec. 3")
    kept = Family("own", "an aim", lambda _: Question(CIRCLE, FALL, 9.0, rule="r", source="s")).question(7)
    assert (kept.rule, kept.source) == ("r", "s")


@pytest.mark.parametrize(
    ("outcome", "kind"),
    [
        (Collision("base", 0.5, 0.5, 0.0, 0.0, 0.0, 1.0), "agreed"),
        (Collision("base", 0.5, 0.5, 0.0, 0.0, 0.0, 1.0 + 2e-15), "wrong"),
        (Collision("arc", 0.5, 0.5, 0.0, 0.0, 0.0, 1.0), "wrong"),
        (Horizon(9.0, 0.0, 0.0, 0.0, 1.0), "wrong"),
        (Undecided("late"), "undecided"),
        (Undefined("corner"), "wrong"),
        (Rejected("no"), "refused"),
    ],
)
def test_a_step_under_attack_is_judged(outcome, kind):
    claim = made.proved_step(CIRCLE, FALL, 9.0)
    assert stepped(outcome, claim, FALL).kind == kind
    assert stepped(outcome, None, FALL).kind == ("undecided" if kind == "undecided" else "open")


def test_a_flow_under_attack_is_judged_by_the_walls_it_counts():
    claim = claimed_path(CIRCLE, FALL, 9, 2.0)
    assert flown({"base": 1, "arc": 1}, claim).kind == "agreed"
    for counts in ({"base": 1}, {"base": 1, "arc": 2}, {"base": 2, "arc": 1}, {}):
        assert flown(counts, claim).kind == "wrong"
    assert flown(None, claim).kind == "undecided"
    assert flown({"base": 1, "arc": 1}, None).kind == "open"
    assert flown({"base": 1}, claimed_path(CIRCLE, FALL, 1, 9.0)).kind == "open"


def test_a_tally_counts_and_keeps_the_worst():
    tally = Tally("f")
    for verdict in (Judgement("agreed", ulps=3.0, seconds=0.5), Judgement("wrong", "off", 9.0, seconds=0.25)):
        tally.add(verdict, "here")
    tally.add(Judgement("undecided", "late"), "there")
    assert (tally.counts["agreed"], tally.counts["wrong"], tally.counts["undecided"]) == (1, 1, 1)
    assert (tally.worst_ulps, tally.slowest) == (9.0, 0.5)
    assert tally.cases["wrong"] == ["off: here"]
    assert "agreed" not in tally.cases
