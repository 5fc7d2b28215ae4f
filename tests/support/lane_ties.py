"""Flights in standing tables that end within rounding of a tie of two walls, judged in exact rationals.

The careful step refuses such flights; exact arithmetic does not. Each draw gives starts in a scene whose
numbers are floats, so that Fractions say which wall is met first. The lanes may refuse, but not be wrong.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np
import numpy.typing as npt

from fast.kernel import records
from scene import Mushroom, Scene

Array = npt.NDArray[np.floating[Any]]
Start = tuple[Array, int]
Draw = Callable[[int, np.random.Generator], tuple[Scene, list[Start]]]


def at_the_mouths_edge(n: int, random: np.random.Generator) -> tuple[Scene, list[Start]]:
    """Aim from the arc at the edge of the mouth."""
    scene = Mushroom(r=1.0, w=float(random.uniform(0.1, 0.9)), h=float(random.uniform(0.2, 2.0)))
    return scene, [_from_arc(scene.w, random) for _ in range(n)]


def at_the_end_of_the_arc(n: int, random: np.random.Generator) -> tuple[Scene, list[Start]]:
    """Aim from the arc at the corner between arc and base."""
    return Mushroom(r=1.0, w=0.1, h=1.0), [_from_arc(1.0, random) for _ in range(n)]


def _from_arc(at: Any, random: np.random.Generator) -> Start:
    angle, pace = random.uniform(0.1, 3.0), random.uniform(0.5, 2.0)
    x, y = np.cos(angle), np.sin(angle)
    goal = random.choice([-1.0, 1.0]) * at
    if abs(goal - x) < 0.3:
        goal = -goal
    return np.array([0.0, 0.0, x, y, pace * (goal - x), -pace * y]), int(records.ARC)


def at_the_floors_corner(n: int, random: np.random.Generator) -> tuple[Scene, list[Start]]:
    """Aim from the left side at the corner between right side and floor."""
    w, h = random.uniform(0.1, 0.9), random.uniform(0.2, 2.0)
    starts = []
    for part, pace in random.uniform(0.1, 2.0, (n, 2)):
        y = -h * min(part, 0.9)
        starts.append((np.array([0.0, 0.0, -w, y, pace * 2.0 * w, -pace * (h + y)]), int(records.LEFT)))
    return Mushroom(r=1.0, w=float(w), h=float(h)), starts


TIES: dict[str, Draw] = {
    "at the mouth's edge": at_the_mouths_edge,
    "at the end of the arc": at_the_end_of_the_arc,
    "at the floor's corner": at_the_floors_corner,
}


def first_wall(scene: Any, p: Array, wall: int) -> int | None:
    """Return the wall met first in a table with upright sides, exactly; None for a tie.

    Args:
        scene: a mushroom that stands still.
        p: the state [t, its low part, x, y, vx, vy], going down from the arc or the left side.
        wall: ARC, on which the start lies by definition, or LEFT.
    """
    x, y, vx, vy = (Fraction(float(v)) for v in p[2:])
    times = {int(records.RIGHT if vx > 0 else records.LEFT): (Fraction(scene.w) - abs(x)) / abs(vx)}
    if vx * x < 0:
        times = {code: (Fraction(scene.w) + abs(x)) / abs(vx) for code in times}
    times[int(records.FLOOR)] = (y + Fraction(scene.h)) / -vy
    if wall == records.ARC:
        back, down = -2 * (x * vx + y * vy) / (vx * vx + vy * vy), -y / vy
        at = abs(x + vx * down)
        if back == down or at == Fraction(scene.w):
            return None
        if back < down:
            return int(records.ARC)
        if at > Fraction(scene.w):
            return int(records.BASE)
    ranked = sorted(times, key=lambda code: times[code])
    return None if times[ranked[0]] == times[ranked[1]] else ranked[0]


def wrong_walls(pool: Any, scene: Scene, starts: list[Start]) -> tuple[int, int]:
    """Take one lane step from each start: how many are answered, and with a wrong wall."""
    for lane, start in enumerate(starts):
        pool.fill(lane, *start)
    right, hits, _ = pool.step(len(starts))
    answers = [(first_wall(scene, *starts[i]), hits[i]) for i in np.flatnonzero(right)]
    return len(answers), sum(truth is not None and truth != hit for truth, hit in answers)
