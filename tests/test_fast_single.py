"""One question of the fast stepper: one call of compiled code, the same answer as a path of one collision."""

from __future__ import annotations

import math
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import msgspec
import numpy as np
import pytest

import fast
from fast import step as stepper
from fast.kernel import records
from fast.kernel.single import REFUSED
from fast.units import fit
from scene import (
    BadInput,
    Cap,
    Collision,
    Fourier,
    Horizon,
    Mushroom,
    Outcome,
    Rejected,
    Scene,
    State,
    load,
)  # fmt: skip
from scene.states import check_numbers

NAMES = ("moving-cap", "fixed-cap-clockwise", "fermi-ulam", "frozen-mushroom", "ergodic")
SCENES = (
    *map(load, NAMES),
    Cap(r=1.0),
    Cap(r=2.0**-500),
    Cap(r=2.0**1000),
    Cap(r=Fourier(1.0, 2.0**1000, (0.5,))),
    Cap(r=Fourier(2.0**900, 2.0**300, (2.0**898, 2.0**-170))),  # loses bits in any unit
    Mushroom(r=1.0, h=1.0, w=0.5),
)
ODD = (math.nan, math.inf, -math.inf, 0.0, -0.0, 5e-324, 1e308, 1e-308, 2.0**400, 2.0**-500, 1e15, 1 / 3)
FIELDS = ("t", "x", "y", "vx", "vy")
Question = tuple[Scene, State, float]


def by_a_path(scene: Scene, state: State, t_end: float) -> Outcome | None:
    """Answer as `next_collision`, with checks in Python and the careful step of trajectories."""
    try:
        fit(scene)
        check_numbers(scene, state, t_end)
        path = fast.trajectory(scene, state, 1, t_end)
    except BadInput as error:
        return Rejected(str(error))
    return Collision(path.walls[0], *path.steps[0].tolist()) if path.walls else path.outcome


def questions(seed: int, n: int) -> Iterator[Question]:
    """Draw states and horizons: steps of a path, off the wall by a little, odd numbers in some fields."""
    random = np.random.default_rng(seed)
    for _ in range(n):
        scene = SCENES[random.integers(len(SCENES))]
        size = scene.r if isinstance(getattr(scene, "r", None), float) else 1.0
        speed = size * 10.0 ** float(random.uniform(-3, 5))
        x, y, vx, vy = (float(v) for v in random.uniform(-1.0, 1.0, 4))
        state = State(float(random.uniform(-9, 9)), 0.3 * x * size, 0.9 * y * size, vx * speed, vy * speed)
        t_end = state.t + float(random.choice([0.0, 1e-3, 1.0, 100.0]))
        found = fast.next_collision(scene, state, t_end)
        if isinstance(found, Collision):
            state = found.state()
            off = 1.0 + float(random.choice([0.0, 1e-7, 1e-5]))
            yield scene, msgspec.structs.replace(state, x=state.x * off, y=state.y * off), t_end
        for _ in range(random.integers(3)):
            field, value = FIELDS[random.integers(5)], float(ODD[random.integers(len(ODD))])
            state = msgspec.structs.replace(state, **{field: value})
        yield scene, state, t_end if random.random() < 0.7 else float(ODD[random.integers(len(ODD))])


def differing(seed: int, n: int) -> list[Question]:
    """Return the questions that are answered otherwise than by a path; nan counts as itself."""
    return [q for q in questions(seed, n) if repr(fast.next_collision(*q)) != repr(by_a_path(*q))]


def test_one_call_answers_as_a_path_does(tally):
    assert differing(1, 1500) == []
    for question in questions(1, 1500):
        tally[type(fast.next_collision(*question)).__name__] += 1
    assert tally["Collision"] > 300
    assert tally["Rejected"] > 500
    assert tally["Horizon"] > 50


@pytest.mark.parametrize("exponent", [-900, -950])
def test_a_path_loses_no_bit_that_one_question_keeps(exponent, tally):
    """Products bring the first table's steps back, and ldexp the second's: their units are beyond 2^-1000."""
    random = np.random.default_rng(4)
    for _ in range(60):
        angle, shrink = float(random.uniform(0.1, 3.0)), int(random.integers(20, 1065 + exponent))
        along, across = np.ldexp([math.cos(angle), math.sin(angle)], [exponent, exponent - shrink])
        state = State(0.0, 0.0, math.ldexp(0.5, exponent - shrink), float(along), float(across))
        question = Cap(r=2.0**exponent), state, 1e300
        alone = fast.next_collision(*question)
        assert by_a_path(*question) == alone
        assert isinstance(alone, Collision) or "beyond binary64" in alone.reason
        tally[type(alone).__name__] += 1
    assert tally["Collision"] > 5
    assert tally["Undecided"] > 5


def test_a_kernel_that_overlooks_the_wall_is_found(monkeypatch):
    """It takes for free what is not on the wall that it names."""
    single = stepper.single.single_at_once()

    def lenient(*question):
        found = single(*question)
        return single(*question[:-2], int(records.NO_WALL), question[-1]) if found[0] == REFUSED else found

    monkeypatch.setattr(stepper.single, "single_at_once", lambda: lenient)
    assert differing(1, 300)


def test_a_horizon_of_zero_is_no_late_one(monkeypatch):
    """Where the unit of time is below 2^-1024 no power of two takes 0 anywhere."""
    quick = Cap(r=Fourier(1.0, 2.0**1000, (0.5,))), State(0.0, 0.0, 0.25, 2.0**1000, 0.0)
    small = Cap(r=2.0**-500), State(0.0, 0.0, 2.0**-501, 2.0**520, 0.0)
    for scene, state in (quick, small):
        expected = Horizon(0.0, state.x, state.y, state.vx, state.vy)
        assert fast.next_collision(scene, state, 0.0) == expected
        assert fast.trajectory(scene, state, 1, 0.0).outcome == expected
    latest = np.finfo(np.float64).max
    monkeypatch.setattr(stepper.Units, "horizon", lambda units, t_end: t_end or latest)
    assert by_a_path(*small, 0.0) != fast.next_collision(*small, 0.0)


class Marked(State, frozen=True):
    """A state with a field more."""

    mark: int = 1


AT = {"t": 0.0, "x": 0.25, "y": 0.5, "vx": 1.0, "vy": 0.5}


@pytest.mark.parametrize(
    ("state", "is_taken"),
    [
        (Marked(**AT), True),
        (State(**AT | {"x": np.float64(0.25)}), True),
        (State(**AT | {"vx": 1}), True),
        (State(**AT | {"vx": True}), False),
        (State(**AT | {"vy": "0.5"}), False),
        (State(**AT | {"wall": "floor"}), False),
        (State(**AT | {"wall": ["arc"]}), False),
        (State(**AT | {"wall": np.array(["arc"])}), False),
        (None, False),
    ],
)
def test_states_of_other_types_are_taken_or_refused(state, is_taken):
    scene = Cap(r=load("moving-cap").r)
    found = fast.next_collision(scene, state, 9.0)
    assert found == fast.next_collision(scene, State(**AT), 9.0) if is_taken else isinstance(found, Rejected)


def test_threads_may_ask_side_by_side():
    asked = list(questions(2, 300))
    expected = [repr(fast.next_collision(*question)) for question in asked]
    with ThreadPoolExecutor(4) as threads:
        for found in threads.map(lambda _: [repr(fast.next_collision(*q)) for q in asked], range(8)):
            assert found == expected
