"""States on a grid in fourteen degenerate scenes, where ties, slides and exact zeros are the rule.

In twelve of the scenes times, places and velocities are multiples of a quarter of the table, of its speed
and of its period. So two walls are often met together, a particle often starts at rest, along a wall or at
the horizon, and waves are often at a half or a quarter of their period.
"""

import json
from collections.abc import Iterator
from itertools import product
from random import Random
from typing import Any

import msgspec

from conformance.cases.certify import proved_step, with_further
from conformance.vectors import Expectation
from conformance.verify import WALLS
from scene import BadInput, State, from_data

Line = dict[str, Any]
Numbers = tuple[float, ...]


def wave(mean: float, **factors: Any) -> dict[str, Any]:
    """Return a Fourier law."""
    return {"kind": "fourier", "mean": mean, **factors}


def knots(*pairs: list[float]) -> dict[str, Any]:
    """Return a bang-bang law."""
    return {"kind": "bang-bang", "knots": list(pairs)}


def mushroom(**laws: Any) -> dict[str, Any]:
    """Return a mushroom of radius 1 and height 1, with a mouth of half its width."""
    nu = {} if "w" in laws else {"nu": 0.5}
    return {"table": "mushroom", "r": 1.0, "h": 1.0, **nu, **laws}


STEM: dict[str, Any] = {"table": "stem", "w": 1.0, "h": 1.0}
SCENES: dict[str, dict[str, Any]] = {
    "static cap": {"table": "cap", "r": 1.0},
    "static stem": STEM,
    "static stem with a slope": {**STEM, "slope": 0.5},
    "static mushroom": mushroom(w=0.5),
    "static mushroom with w = r": mushroom(w=1.0),
    "static mushroom with a slope": mushroom(slope=0.25),
    "cap, cosine": {"table": "cap", "r": wave(1.0, period=2.0, cos=[0.25])},
    "cap, sine": {"table": "cap", "r": wave(1.0, period=2.0, sin=[0.25])},
    "floor, cosine and sine": {**STEM, "h": wave(1.0, period=4.0, cos=[0.25], sin=[0.25])},
    "sides, second harmonic": {**STEM, "w": wave(1.0, period=4.0, cos=[0.0, 0.25])},
    "mouth that reaches w = r": mushroom(w=wave(0.75, period=2.0, cos=[0.25])),
    "slope, sine": mushroom(slope=wave(0.0, period=2.0, sin=[0.25])),
    "floor that rests": {**STEM, "h": knots([0.0, 1.0], [1.0, 0.5], [2.0, 0.5], [3.0, 1.0], [4.0, 1.0])},
    "mouth of knots": mushroom(w=knots([0.0, 0.5], [1.0, 1.0], [2.0, 0.5])),
}
PERIODS = (0.0, 0.25, 0.5, 0.75, 1.0)  # of the time of a start
FLIGHTS = (0.25, 0.5, 1.0, 4.0)  # from start to horizon, in periods
PLACES = (-1.25, -1.0, -0.75, -0.5, -0.25, 0.0, 0.25, 0.5, 0.75, 1.0, 1.25)
SPEEDS = (-1.0, -0.5, 0.0, 0.5, 1.0)


def period(scene: dict[str, Any]) -> float:
    """Return the period of a scene; 2 where nothing moves."""
    for law in scene.values():
        if isinstance(law, dict):
            return float(law.get("period") or law["knots"][-1][0])
    return 2.0


def starts(name: str) -> Iterator[tuple[State, float]]:
    """Yield all starts of a scene's grid with their horizons, shuffled, in the same order every time."""
    scene = SCENES[name]
    turn = period(scene)
    walls = (None, None, *WALLS[scene["table"]])
    grid = list(product(PERIODS, PLACES, PLACES, SPEEDS, SPEEDS, walls, FLIGHTS))
    Random(name).shuffle(grid)
    for start, x, y, vx, vy, wall, flight in grid:
        yield State(start * turn, x, y, vx, vy, wall), (start + flight) * turn


def answer(name: str, state: State, t_end: float) -> Line | None:
    """Return what the reference proves of a start, as a line of a corpus; None where it is undecided."""
    scene = from_data(SCENES[name])
    try:
        claim = proved_step(scene, state, t_end)
    except BadInput:
        claim = Expectation("rejected")
    if claim is None:
        return None
    question = {"id": "grid/1", "kind": "step", "scene": SCENES[name], "state": state, "t_end": t_end}
    expect = with_further(claim, scene, state)
    line: Line = json.loads(msgspec.json.encode({**question, "expect": expect}))
    return line


def lines(name: str, n: int) -> Iterator[Line | None]:
    """Yield what the reference answers to n starts of a scene; None where it is undecided.

    Most states of the grid lie outside the table or off their wall. One answer in five at most is "rejected".
    """
    n_rejected = n_taken = 0
    for state, t_end in starts(name):
        line = answer(name, state, t_end)
        is_rejected = line is not None and line["expect"][0]["outcome"] == "rejected"
        if is_rejected and 5 * n_rejected >= n_taken:
            continue
        n_rejected += is_rejected
        n_taken += 1
        yield line
        if n_taken == n:
            return
