"""Bad input of the steppers' public entries: one line that names field, value and bound, and nothing else."""

import math
from fractions import Fraction

import numpy as np
import pytest
from support.refusals import HUGE, NO_NUMBERS

import fast
import reference
from conformance import plain
from conformance.cases.draw import Draw
from fast.batch import careful_steps
from scene import BadInput, Cap, Collision, Horizon, Mushroom, Rejected, State, Stem, load

CAP, MUSHROOM = Cap(r=1.0), Mushroom(r=1.0, h=1.0, w=0.5)
GOOD = {"t": 0.0, "x": 0.1, "y": 0.3, "vx": 1.0, "vy": 0.7}
START = State(**GOOD)
STEM = Stem(w=1.0, h=1.0)
PAST = 1.0 + 2.0**-50
# What each entry takes: a function of its arguments by name, and arguments that are good.
ENTRIES = {
    "next_collision": (fast.next_collision, {"scene": CAP, "state": START, "t_end": 2.0}),
    "trajectory": (fast.trajectory, {"scene": CAP, "state": START, "n_collisions": 2, "t_end": 2.0}),
    "fine_trajectory": (fast.fine_trajectory, {"scene": CAP, "state": START, "n_collisions": 2}),
    "flow": (fast.flow, {"scene": CAP, "states": [START], "t_end": 2.0, "threads": 1}),
    "simulate": (
        fast.simulate,
        {"scene": CAP, "n_particles": 1, "energy": 1.0, "n_cycles": 1, "seed": 0, "phases": (0.5,)}
        | {"threads": 1, "progress": None},
    ),
    "go_on": (fast.go_on, {"scene": CAP, "n_particles": 1, "energy": 1.0, "threads": 1, "before": None}),
}
PROVED = {
    "reference.next_collision": (
        reference.next_collision,
        {"scene": CAP, "state": START, "t_end": 2.0, "digits": 20},
    ),
    "reference.trajectory": (
        reference.trajectory,
        {"scene": CAP, "state": START, "n_collisions": 2, "t_end": 2.0, "digits": 20, "working": 20},
    ),
}
NAN, INFINITY = math.nan, math.inf
NO_NUMBER = [None, *NO_NUMBERS, NAN, -INFINITY]
NO_COUNT = [*NO_NUMBERS, NAN, -INFINITY, INFINITY, 2.5, Fraction(5, 2), np.array([2]), -1]
BAD = {
    "scene": [None, "moving-cap", b"cap", 1.0, NAN, [], {"table": "cap", "r": 1.0}, Cap, START, HUGE],
    "state": [
        *(value for value in NO_NUMBER if not isinstance(value, State)),
        (0.0, 0.1, 0.3, 1.0, 0.7),
        *(State(**{**GOOD, field: value}) for field in GOOD for value in [*NO_NUMBER, INFINITY]),
        *(State(**GOOD, wall=wall) for wall in ("roof", "left", 0, 1.5, ["arc"], b"arc", *NO_NUMBERS)),
        State(0.0, 0.1, 0.3, 1.0, 0.7, "arc"),
    ],
    "n_collisions": [None, *NO_COUNT, 10**7 + 1, 10**12, HUGE],
    "t_end": [*NO_NUMBER, -1.0],
    "states": [
        *(None, START, "states", 1.0, {}, {START}, CAP, np.zeros((1, 6))),
        *([START, bad] for bad in (None, "a", (0.0, 0.1, 0.3, 1.0, 0.7))),
        *([State(0.0, x, 0.3, 1.0, 0.7)] for x in ("a", 9.0)),
    ],
    "threads": [*NO_COUNT, 0, 10**6, HUGE],
    "n_particles": [None, *NO_COUNT, 0, 10**8 + 1, 10**12, HUGE],
    "energy": [*NO_NUMBER, INFINITY, 0.0, -1.0, 1e30, 2.0**801, 10**300],
    "n_cycles": [None, *NO_COUNT, 0, 10**6 + 1, HUGE],
    "seed": [None, *NO_COUNT, 2**64, HUGE],
    "phases": [
        *(None, True, 0.5, "0.5", b"\x00", {0.5}, {0.5: 1}, CAP, np.array([[0.5]]), np.array(["a"])),
        *((phase,) for phase in (0.0, 1.0, NAN, "a", None, (0.5,), True)),
        *((0.5, 0.5), (0.6, 0.5), (0.5, INFINITY)),
    ],
    "progress": [1, "print", [], START],
    "before": [*NO_NUMBERS, fast.Paused(None, None), fast.Paused(START, np.zeros((1, 2)))],
    "digits": [None, *NO_COUNT, 0, 10**4 + 1, HUGE],
    "working": [*NO_COUNT, 0, 10**4 + 1, HUGE],
}
# A trajectory of `fast` needs no horizon.
FAR = [(name, "t_end", INFINITY) for name in ("flow", "next_collision", *PROVED)]
CASES = [
    (name, field, value)
    for name, (_, good) in {**ENTRIES, **PROVED}.items()
    for field in good
    for value in BAD[field]
    if not (name == "reference.trajectory" and field == "t_end" and value is None)
] + FAR


def refusal(name, changes):
    """Return the line with which an entry refuses; None when it takes what it is given."""
    entry, good = {**ENTRIES, **PROVED}[name]
    try:
        answer = entry(**{**good, **changes})
    except BadInput as error:
        return str(error)
    if isinstance(answer, fast.Collisions | fast.FineTrajectory | reference.Trajectory):
        answer = answer.outcome
    return answer.reason if isinstance(answer, Rejected) else None


def test_good_input_is_taken():
    assert {refusal(name, {}) for name in [*ENTRIES, *PROVED]} == {None}


@pytest.mark.parametrize("name", [*ENTRIES, *PROVED])
def test_every_bad_value_is_refused_by_its_name(name):
    mine = [(field, value) for entry, field, value in CASES if entry == name]
    assert len(mine) > 50
    for field, value in mine:
        line = refusal(name, {field: value})
        assert line is not None, (field, value)
        assert "\n" not in line
        assert len(line) < 300, line
        named = {"states": ("states", "particle", "state")}.get(field, (field,))
        assert any(word in line for word in named), (field, value, line)


def test_what_an_ensemble_keeps_is_bounded():
    for changes in (
        {"n_particles": 10**8, "n_cycles": 100},
        {"n_cycles": 10**6, "n_particles": 10**6},
        {"n_particles": 10**8, "phases": tuple(np.linspace(0, 1, 102)[1:-1])},
    ):
        assert "to keep, must be at most 1000000000" in refusal("simulate", changes)


@pytest.mark.parametrize("kind", [int, np.int64, np.float64, np.float32, Fraction, np.array])
def test_numbers_of_other_kinds_are_the_floats_they_stand_for(kind):
    """Integers, fractions and numbers of numpy mean the floats that they round to."""
    zero, one, two, five = map(kind, (0, 1, 2, 5))
    wanted, given = State(0.0, 0.5, 0.0, 1.0, 2.0, "base"), State(zero, 0.5, zero, one, two, "base")
    assert reference.next_collision(CAP, given, five) == reference.next_collision(CAP, wanted, 5.0)
    found = fast.trajectory(CAP, given, five, five)
    assert np.array_equal(found.steps, fast.trajectory(CAP, wanted, 5, 5.0).steps)
    runs = [fast.simulate(CAP, n_particles=n, energy=n, phases=np.array([0.5])) for n in (five, 5)]
    assert runs[0].sha256() == runs[1].sha256()


BESIDE = 0.25
ASKED = [
    (scene, State(0.0, x, y, 0.3, -0.7, wall))
    for scene in (CAP, STEM, MUSHROOM)
    for x in (0.0, BESIDE, -0.45, 0.6, -0.75, 0.99)
    for y in (0.0, BESIDE, -BESIDE, 2.0**-60, -(2.0**-60), 0.9, -0.97, 1.02, -1.02)
    for wall in (None, *scene.walls)
]


def test_a_state_beyond_a_wall_is_refused_as_the_reference_does():
    """Of one on a wall to within rounding either may be said; that is asked elsewhere."""
    kinds = {"beyond": 0, "both": 0}
    for scene, state in ASKED:
        proved = reference.next_collision(scene, state, 1.0)
        found = fast.next_collision(scene, state, 1.0)
        refused = [isinstance(one, Rejected) for one in (proved, found)]
        assert refused[0] == refused[1], (scene, state, proved, found)
        kinds["both"] += refused[0]
        kinds["beyond"] += refused[0] and "beyond wall" in found.reason
    assert kinds["beyond"] > 20
    assert len(ASKED) - kinds["both"] > 50


RESTING = State(0.0, 0.0, 0.5, 0.0, 0.0)


def test_what_rests_and_is_never_swept_stays_where_it_is():
    """Without a horizon: at t = infinity in its place, the same for all entries; no nan."""
    found = [
        fast.trajectory(CAP, RESTING, 3).outcome,
        fast.trajectory(CAP, RESTING, 3, math.inf).outcome,
        fast.fine_trajectory(CAP, RESTING, 3).outcome,
        *careful_steps(CAP, [RESTING])[0],
    ]
    assert found == [Horizon(math.inf, 0.0, 0.5, 0.0, 0.0)] * 4
    assert fast.trajectory(CAP, RESTING, 3, 7.0).outcome == Horizon(7.0, 0.0, 0.5, 0.0, 0.0)
    assert fast.trajectory(CAP, RESTING, 0).outcome is None


def test_catalogue_names_are_answered_with_a_hint():
    for name in ENTRIES:
        assert "scene.load('moving-cap')" in refusal(name, {"scene": "moving-cap"})
    assert refusal("simulate", {"scene": load("moving-cap")}) is None


def deep_stem(draw):
    """Draw a stem that is up to 2^60 times as wide below as at its mouth, and a start in it."""
    w, h = draw.between(0.5, 1.5), draw.power(-10, 40)
    slope = -draw.power(-10, 60) * w / h
    y = -h * draw.between(0.0, 0.9)
    x = (w + slope * y) * draw.between(-0.9, 0.9)
    turn, speed = draw.between(0.0, 6.28), w - slope * h
    table = Stem(w=w, h=h, slope=slope) if draw.part() < 0.5 else Mushroom(r=2.0, w=w, h=h, slope=slope)
    return table, State(0.0, x, y, speed * math.cos(turn), speed * math.sin(turn) * draw.power(-10, 0))


def test_no_outcome_is_refused_for_the_rounding_of_its_place(tally):
    """However deep and slanted the stem: where x is rounded by more than 2^-20 of the mouth, too."""
    steppers = {"fast": fast.next_collision, "plain": plain.next_collision}
    for index in range(60):
        table, state = deep_stem(Draw(f"deep/{index}"))
        for _ in range(3):
            found = reference.next_collision(table, state, 1e9, digits=20)
            if not isinstance(found, reference.Collision):
                assert not isinstance(found, Rejected), (table, state, found)
                break
            for name, step in steppers.items():
                answer = step(table, state, 1e9)
                tally[f"{name} {type(answer).__name__}"] += 1
                assert not isinstance(answer, Collision) or answer.wall == found.wall, (table, state, name)
                assert not isinstance(answer, Rejected), (table, state, answer)
            state = found.rounded().state()
            tally["deep"] += abs(state.x) > 2.0**33 * table.w
    assert tally["deep"] > 30
    assert min(tally["fast Collision"], tally["plain Collision"]) > 100


@pytest.mark.parametrize(
    "step",
    [
        *(stepper.next_collision for stepper in (fast, reference, plain)),
        lambda scene, state, t_end: fast.trajectory(scene, state, 2, t_end).outcome,
    ],
)
@pytest.mark.parametrize(
    ("scene", "state", "words"),
    [
        (STEM, State(0.0, 0.0, -0.5, 2.0, 1.0), {"mouth": False}),  # a side and the top meet at a corner
        (STEM, State(0.0, 0.0, -PAST, 1.0, 0.5), {"by 8.88e-16": True, "(state.wall = 'floor')": True}),
        (STEM, State(0.0, PAST, -0.5, -1.0, 0.5), {"by 8.88e-16": True, "(state.wall = 'right')": True}),
        (CAP, State(0.0, 0.0, PAST, 1.0, -0.5), {"by 8.88e-16": True, "(state.wall = 'arc')": True}),
        (MUSHROOM, State(0.0, 0.0, -PAST, 1.0, 0.5), {"by 8.88e-16": True, "(state.wall = 'floor')": True}),
        (CAP, State(0.0, 0.0, 3.0, 1.0, -0.5), {"by 2": True, "state.wall": False}),
        (CAP, State(0.0, PAST, 0.0, -1.0, 0.5, "base"), {"by 8.88e-16": True, "state.wall": False}),
    ],
)
def test_a_reason_says_what_is_near_by_how_much_and_what_helps(step, scene, state, words):
    """A state copied after a hit without its wall is within rounding of it, or beyond: naming it helps."""
    reason = step(scene, state, 10.0).reason
    assert {word: word in reason for word in words} == words, reason
