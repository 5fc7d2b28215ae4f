"""Flights that end near a corner or the mouth's edge, of walls that stand still or move.

Where walls stand still, flights end within rounding of a tie of two walls: lanes may refuse them, but not be
wrong. Where they move, flights end within 1e-16 to 1e-8 of the corner, on either side. The place where the
wall is met and the time are drawn, the velocity follows. The lanes' time of flight is corrected by about so
much: what holds before may not hold after it.
"""

import numpy as np
from mpmath import fp

from fast.kernel import records
from fast.kernel.records import FloatArray
from scene import BangBang, Cap, Fourier, GivenLaw, Mushroom, Scene
from scene.laws import law_of
from support.lane_anywhere import Start


def at_a_resting_edge(n: int, random: np.random.Generator) -> tuple[Scene, list[Start]]:
    """Aim from the arc at the edge of the mouth."""
    w, h = float(random.uniform(0.1, 0.9)), float(random.uniform(0.2, 2.0))
    return Mushroom(r=1.0, w=w, h=h), [_from_resting_arc(w, random) for _ in range(n)]


def at_the_end_of_a_resting_arc(n: int, random: np.random.Generator) -> tuple[Scene, list[Start]]:
    """Aim from the arc at the corner between arc and base."""
    return Mushroom(r=1.0, w=0.1, h=1.0), [_from_resting_arc(1.0, random) for _ in range(n)]


def _from_resting_arc(at: float, random: np.random.Generator) -> Start:
    angle = random.uniform(0.1, 3.0)
    pace = random.uniform(0.5, 2.0)
    x, y = np.cos(angle), np.sin(angle)
    goal = random.choice([-1.0, 1.0]) * at
    if abs(goal - x) < 0.3:
        goal = -goal
    return np.array([0.0, 0.0, x, y, pace * (goal - x), -pace * y]), int(records.ARC)


def at_a_resting_floor(n: int, random: np.random.Generator) -> tuple[Scene, list[Start]]:
    """Aim from the left side at the corner between right side and floor."""
    w, h = random.uniform(0.1, 0.9), random.uniform(0.2, 2.0)
    starts = []
    for part, pace in random.uniform(0.1, 2.0, (n, 2)):
        y = -h * min(part, 0.9)
        starts.append((np.array([0.0, 0.0, -w, y, pace * 2.0 * w, -pace * (h + y)]), int(records.LEFT)))
    return Mushroom(r=1.0, w=float(w), h=float(h)), starts


def at_the_end_of_the_arc(n: int, random: np.random.Generator) -> tuple[Scene, list[Start]]:
    """Fly from the arc to where it meets the base, far or near."""
    r = _moving(1.0, random)
    return Mushroom(r=r, w=0.1, h=1.0), _along_the_arc(r, n, random, -8)


def at_the_end_of_a_chord(n: int, random: np.random.Generator) -> tuple[Scene, list[Start]]:
    """Do so in a cap, where lanes go through the base: on which side the chord ends tells what is first.

    They know the height where they arrive, after Newton's step, so that only rounding is left to mislead.
    """
    r = _moving(1.0, random)
    return Cap(r=r), _along_the_arc(r, n, random, -13)


def _along_the_arc(r: GivenLaw, n: int, random: np.random.Generator, farthest: float) -> list[Start]:
    starts = []
    for t, s in _times(n, random):
        angle = min(10.0 ** random.uniform(-2.5, 0.4), 2.9)
        here = _at(r, t)
        there = _at(r, t + s)
        x, y = here * np.cos(angle), here * np.sin(angle)
        starts.append((_state(t, s, x, y, there, _offset(random, farthest)), int(records.ARC)))
    return starts


def at_the_edge_of_the_mouth(n: int, random: np.random.Generator) -> tuple[Scene, list[Start]]:
    """Fly from the left side or the floor to the upper end of the right side."""
    w = _moving(0.5, random)
    lean = float(random.choice([0.0, random.uniform(-0.3, 0.3)]))
    starts = []
    for t, s in _times(n, random):
        here = _at(w, t)
        there = _at(w, t + s)
        off = _offset(random)
        y = -float(random.uniform(0.01, 0.95))
        wall = records.LEFT
        x = -(here + lean * y)
        if random.random() < 0.4:
            y = -1.0
            wall = records.FLOOR
            x = random.uniform(-0.9, 0.9) * (here - lean)
        starts.append((_state(t, s, x, y, there + lean * off, off), int(wall)))
    return Mushroom(r=1.0, w=w, h=1.0, slope=lean), starts


CORNERS = {
    "a resting mouth's edge": at_a_resting_edge,
    "the end of a resting arc": at_the_end_of_a_resting_arc,
    "a resting floor's corner": at_a_resting_floor,
    "the end of the arc": at_the_end_of_the_arc,
    "the end of a chord": at_the_end_of_a_chord,
    "the edge of the mouth": at_the_edge_of_the_mouth,
}


def _moving(mean: float, random: np.random.Generator) -> GivenLaw:
    swing = mean * float(random.choice([0.04, 0.3]))
    if random.random() < 0.5:
        return Fourier(mean, 1.0, (swing,), (0.2 * swing,))
    inner = 6.0 * float(random.uniform(0.2, 0.8))
    return BangBang(((0.0, mean), (inner, mean + swing * float(random.uniform(-1, 1))), (6.0, mean)))


def _times(n: int, random: np.random.Generator) -> FloatArray:
    return np.column_stack([random.uniform(0.0, 6.0, n), 10.0 ** random.uniform(-2.5, -0.3, n)])


def _offset(random: np.random.Generator, farthest: float = -8) -> float:
    return float(random.choice([-1.0, 1.0]) * 10.0 ** random.uniform(farthest - 8, farthest))


def _at(law: GivenLaw, t: float) -> float:
    return float(law_of(law).value(fp, float(t)))


def _state(t: float, s: float, x: float, y: float, x_end: float, y_end: float) -> FloatArray:
    return np.array([t, 0.0, x, y, (x_end - x) / s, (y_end - y) / s])
