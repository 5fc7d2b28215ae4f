"""A search for answers that powers of two of length and time do not scale exactly.

`python tests/support/scale_search.py SEED N` compares N answers, each to one question, scaled.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

import fast
from fast.step import WALL_NAMES
from scene import Collision, Horizon, Rejected, Scene, State
from scene.refusal import BadInput
from scene.transforms import frozen, scaled, scaled_state
from support.lane_anywhere import draw_scene, draw_start

MOST = 390
Numbers = tuple[object, ...]  # what does not scale, then dt, t, x, y, vx, vy in rows


class Question(NamedTuple):
    """A scene, a state, and how far it is followed."""

    scene: Scene
    state: State
    t_end: float


def search(seed: int, n: int, tally: Counter[str]) -> list[tuple[Question, int, int]]:
    """Compare n scaled answers, those refused counted apart; returns the questions whose bits differ."""
    random, found = np.random.default_rng(seed), []
    while tally["answers"] < n:
        scene = draw_scene(random)
        questions = [draw_question(scene, random) for _ in range(10)]
        for length, time in (draw_exponents(random), draw_exponents(random)):
            for question in questions:
                for ask in (step, trajectory, flow) if random.random() < 0.2 else (step, trajectory):
                    tally["scalings"] += 1
                    if not is_scaled(ask, question, length, time, tally):
                        found.append((question, length, time))
    return found


def draw_question(scene: Scene, random: np.random.Generator) -> Question:
    """Draw a start on a wall or off it, in a moving scene or frozen, with speeds of many sizes."""
    (t, _, x, y, vx, vy), wall = draw_start(scene, random)
    faster = 2.0 ** random.integers(-8, 9)
    state = State(float(t), float(x), float(y), float(faster * vx), float(faster * vy), WALL_NAMES[wall])
    if random.random() < 0.2:
        scene = frozen(scene, state.t)
    if random.random() < 0.3:
        step = 2.0**-6 / (abs(state.vx) + abs(state.vy))
        state = State(state.t, state.x + step * state.vx, state.y + step * state.vy, state.vx, state.vy)
    return Question(scene, state, state.t + 2.0 ** int(random.integers(-2, 4)))


def draw_exponents(random: np.random.Generator) -> tuple[int, int]:
    """Draw exponents of length and time: together, apart, or one alone; half of them the extremes."""
    length, time = (int(e) for e in random.integers(-MOST, MOST + 1, 2))
    if random.random() < 0.5:
        length, time = (int(e) for e in random.choice([-MOST, MOST], 2))
    kind = int(random.integers(5))
    return ((length, length), (length, -length), (length, 0), (0, time), (length, time))[kind]


def step(q: Question) -> Numbers:
    """Return the kind of the next event and its numbers."""
    found = fast.next_collision(*q)
    if isinstance(found, Rejected):
        raise BadInput(found.reason)
    if isinstance(found, Collision):
        return (found.wall, (found.dt, found.t, found.x, found.y, found.vx, found.vy))
    if isinstance(found, Horizon):
        return ("horizon", (0.0, found.t, found.x, found.y, found.vx, found.vy))
    return (repr(found),)


def trajectory(q: Question) -> Numbers:
    """Return the walls and numbers of a path of a few collisions."""
    path = fast.trajectory(q.scene, q.state, 8)
    if isinstance(path.outcome, Rejected):
        raise BadInput(path.outcome.reason)
    return (tuple(path.walls), type(path.outcome).__name__, *map(tuple, path.steps.tolist()))


def flow(q: Question) -> Numbers:
    """Return where a particle is at the horizon, or at its 300th hit (in a slit they are many), by lanes."""
    path = fast.trajectory(q.scene, q.state, 300, q.t_end)
    t_end = q.t_end if len(path.walls) < 300 else float(path.steps[-1, 1])
    run = fast.flow(q.scene, [q.state], t_end, threads=1)
    (end,) = run.outcomes
    counts = run.wall_counts.tolist()
    if isinstance(end, Horizon):
        return (str(counts), (float(run.t_in[0]), end.t, end.x, end.y, end.vx, end.vy))
    return (str(counts), repr(end))


def is_scaled(
    ask: Callable[[Question], Numbers], q: Question, length: int, time: int, tally: Counter[str]
) -> bool:
    """Tell whether the scaled question has the scaled answer, or one of the two is refused."""
    other = Question(scaled(q.scene, length, time), scaled_state(q.state, length, time), 2.0**time * q.t_end)
    try:
        one = ask(q)
    except BadInput:
        tally["no question"] += 1
        return True
    try:
        two = ask(other)
    except BadInput:
        tally["refused"] += 1
        return True
    tally["answers"] += 1
    speed = length - time
    exponents = np.array([time, time, length, length, speed, speed])
    for a, b in zip(one, two, strict=True):
        same = a == b
        if isinstance(a, tuple) and isinstance(b, tuple) and a and isinstance(a[0], float):
            same = bool(np.array_equal(np.ldexp(np.array(a), exponents), np.array(b), equal_nan=True))
        if not same:
            return False
    return True


if __name__ == "__main__":
    counts: Counter[str] = Counter()
    for wrong in search(int(sys.argv[1]), int(sys.argv[2]), counts):
        print(wrong)
    print(dict(counts))
