"""Questions at the edges of protocol 1, and what every honest stepper answers to them by its page."""

import math
from typing import Any

Line = dict[str, Any]
START = {"t": 5.0, "x": 0.25, "y": 0.5, "vx": 0.5, "vy": 1.0, "wall": None}
HERE = {"outcome": "horizon", **{name: START[name] for name in ("t", "x", "y", "vx", "vy")}}
TINY = {
    "scene": {"table": "cap", "r": 2.0**-350},
    "state": {"t": 0.0, "x": 0.75 * 2.0**-350, "y": 0.0, "vx": 0.0, "vy": 2.0**-636, "wall": "base"},
    "t_end": 1.5 * 2.0**286,
}
MUSHROOM = {"table": "mushroom", "r": 1.0, "w": 0.125, "h": 1.0}
# Its half-width is 1 at the mouth and 2e10 below: there x is rounded by more than 2^-20, after any bounce.
DEEP = {"table": "stem", "w": 1.0, "h": 2.0**18, "slope": -(2.0**18) / 3}
OFF_BY_ROUNDING = {
    "t": 0.0,
    "x": 18325211273.533333,
    "y": -209715.40000000002,
    "vx": -1e10,
    "vy": 1e3,
    "wall": "right",
}
BASE = {"scene": {"table": "cap", "r": 1.0}, "state": START, "t_end": 9.0}
# The last place of t is worth more than a period: in binary64 no phase is known; right, exactly, comes first.
LATE = {
    "scene": {"table": "stem", "w": 1.0, "h": {"kind": "fourier", "mean": 1.0, "omega": 1.5, "cos": [0.5]}},
    "state": {"t": -4.8138600903774904e16, "x": 0.25, "y": -0.125, "vx": 0.75, "vy": -0.625, "wall": None},
    "t_end": -4.81386009037749e16,
}
TOUCHED = {
    "scene": {
        "table": "stem",
        "w": 1.0,
        "h": {"kind": "bang-bang", "knots": [[-1, 1], [1, 2], [2, 1.5], [3, 2], [4, 1]]},
    },
    "state": {"t": 0.0, "x": 0.25, "y": -1.5, "vx": 0.0, "vy": 0.0, "wall": "floor"},
    "t_end": 2.75,
}
REST = {"scene": {"table": "cap", "r": 2.0}, "state": {**START, "vx": 0.0, "vy": 0.0}}
REFUSED = {"outcome": "rejected"}
ARRIVED = {"outcome": "horizon", "t": 0.0}
OPEN = {"outcome": "undecided"}


def asked(cmd: str, **changes: Any) -> Line:
    """Return a request."""
    other = {"flow": {"states": [START], "state": None}, "time": {"t_end": None}}.get(cmd, {})
    fields = {"cmd": cmd, "seq": 7, **BASE, **other, **changes}
    return {name: part for name, part in fields.items() if part is not None}


def _at(x: float, y: float, vx: float, vy: float, wall: str | None = None) -> Line:
    return {"state": {"t": 0.0, "x": x, "y": y, "vx": vx, "vy": vy, "wall": wall}}


def _states(*numbers: Any) -> Line:
    return {"states": [_at(*numbers)["state"]]}


def _undefined(reason: str) -> Line:
    return {"outcome": "undefined", "reason": reason}


# What is asked, and what may come: a part of the answer, or several of which one comes.
EDGES: list[tuple[Line, list[Line]]] = [
    (asked("step", t_end=5.0), [HERE]),
    (asked("step", t_end=math.nextafter(5.0, 0.0)), [REFUSED]),
    (asked("step", t_end=5.0, state={**START, "y": 2.0}), [REFUSED]),
    (asked("step", t_end=5.0, state={**START, "y": -0.0, "wall": "base"}), [{**HERE, "y": 0.0}]),
    # What slides along a wall, or is in a corner, has arrived as well; what moves into a wall is refused.
    (asked("step", **_at(0.25, 0.0, 1.0, 0.0, "base"), t_end=0.0), [{"outcome": "horizon", "t": 0.0}]),
    (asked("flow", **_states(0.25, 0.0, 1.0, 0.0, "base"), t_end=0.0), [REFUSED, {"states": [ARRIVED]}]),
    (
        asked("trajectory", **_at(0.25, 0.0, 1.0, 0.0, "base"), t_end=0.0, collisions=3),
        [{"steps": [ARRIVED]}],
    ),
    (asked("step", **_at(1.0, 0.0, 1.0, 1.0, "base"), t_end=0.0), [ARRIVED, OPEN]),
    (asked("step", **_at(0.25, 0.0, 1.0, -1.0, "base"), t_end=0.0), [REFUSED]),
    (asked("step", scene=MUSHROOM, **_at(0.0625, 0.0, 1.0, 0.0), t_end=0.0), [ARRIVED, OPEN]),
    (asked("step", scene=MUSHROOM, **_at(0.75, 0.0, 1.0, 0.0), t_end=0.0), [ARRIVED, OPEN]),
    # No step is asked for, so that none need be defined.
    (asked("trajectory", **_at(0.25, 0.0, 1.0, 0.0, "base"), collisions=0), [{"steps": []}]),
    (asked("trajectory", collisions=0), [{"steps": []}]),
    (asked("trajectory", collisions=3, t_end=5.0), [{"steps": [HERE]}]),
    (asked("trajectory", collisions=3, t_end=1.0), [REFUSED, {"steps": [REFUSED]}]),
    (asked("trajectory", collisions=0, t_end=1.0), [REFUSED, {"steps": []}]),
    (asked("trajectory", collisions=-1), [REFUSED]),
    (asked("time", collisions=0, repeat=1), [REFUSED]),
    (asked("time", collisions=1, repeat=0), [REFUSED]),
    (asked("flow", t_end=5.0), [REFUSED, {"states": [HERE]}]),  # refused where it is not offered
    (asked("flow", t_end=1.0), [REFUSED, {"states": [REFUSED]}]),
    (asked("flow", states=[]), [REFUSED, {"states": []}]),
    # What overflows is left open, or beyond the bounds that a stepper names; the process lives on.
    (asked("step", state={**START, "vx": 1.7e308, "vy": 1.7e308}), [{"outcome": "undecided"}, REFUSED]),
    # So is what vanishes: the square of this speed is 0, and the arc is met all the same.
    (asked("step", **LATE), [{"outcome": "collision", "wall": "right"}, {"outcome": "undecided"}, REFUSED]),
    (asked("step", **TINY), [{"outcome": "collision", "wall": "arc"}, {"outcome": "undecided"}, REFUSED]),
    # A place on two walls is a corner whichever way it moves; where the mouth ends none need be named.
    (asked("step", scene=MUSHROOM, **_at(0.125, 0.0, -0.5, 1.0)), [_undefined("mouth-edge"), OPEN]),
    (asked("step", scene=MUSHROOM, **_at(-0.125, 0.0, 0.5, -1.0)), [_undefined("mouth-edge"), OPEN]),
    (asked("step", scene=MUSHROOM, **_at(0.125, 0.0, -0.5, 0.5, "right")), [_undefined("mouth-edge"), OPEN]),
    (asked("step", scene=MUSHROOM, **_at(1.0, 0.0, -0.5, -1.0)), [_undefined("corner"), OPEN]),
    (asked("step", scene=MUSHROOM, **_at(1.0, 0.0, -0.5, 0.5, "arc")), [_undefined("corner"), OPEN]),
    (
        asked("step", scene={"table": "cap", "r": 1.0}, **_at(-1.0, 0.0, -1.0, 0.5, "arc")),
        [_undefined("corner"), OPEN],
    ),
    # Sides end at the mouth, and the arc does: a place beyond is on no wall.
    (asked("step", scene=MUSHROOM, **_at(0.125, 0.5, -1.0, 0.25, "right")), [REFUSED]),
    (asked("step", scene=MUSHROOM, **_at(0.6, -0.8, -0.25, 0.5, "arc")), [REFUSED]),
    # The floor that it rests on goes, and comes back to just where it was: it touches, with no net change.
    (asked("step", **TOUCHED), [{"outcome": "horizon"}, OPEN]),
    # By the size of its own wall, now, a state is on it or not: not by the radius, nor by w far below.
    (asked("step", scene=MUSHROOM, **_at(0.125 + 2.0**-22, -0.5, -1.0, 0.25, "right")), [REFUSED]),
    (asked("step", scene=DEEP, state=OFF_BY_ROUNDING), [{"outcome": "collision", "wall": "left"}, OPEN]),
]

# A state on its floor, rightly rounded: but omega t has lost so many places that h is off by 2e-5. A state
# off by far more than that is not on it. (`fast` refuses all times as late as this, and says so.)
LATE_FLOOR = {
    "scene": {"table": "stem", "w": 1.0, "h": {"kind": "fourier", "mean": 1.0, "omega": 0.7, "cos": [0.5]}},
    "t_end": 1e12 + 9.0,
}
LATE_START = {"t": 1e12, "x": 0.25, "y": -0.7681813247020811, "vx": 0.75, "vy": 5.0, "wall": "floor"}
# It leaves the floor by 1e-6; at the phase that is rounded the floor turns round, and comes faster by 1e-5.
LATE_REST = {
    "t": 1000000000006.0453,
    "x": 0.25,
    "y": -1.4999995038661325,
    "vx": 0.75,
    "vy": 0.0004940572730351366,
    "wall": "floor",
}
LATE_EDGES: list[tuple[Line, list[Line]]] = [
    (asked("step", **LATE_FLOOR, state=LATE_START), [{"outcome": "collision", "wall": "base"}, OPEN]),
    (asked("step", **LATE_FLOOR, state={**LATE_START, "y": -0.5}), [REFUSED]),
    (asked("step", **LATE_FLOOR, state=LATE_REST), [{"outcome": "collision", "wall": "floor"}, OPEN]),
    (asked("step", **LATE_FLOOR, state={**LATE_REST, "vy": -0.125}), [REFUSED]),
]


def is_among(answer: Line, allowed: list[Line]) -> bool:
    """Tell whether an answer has all that one of the allowed ones has."""
    return any(_has(answer, one) for one in allowed)


def _has(found: Any, wanted: Any) -> bool:
    if isinstance(wanted, dict):
        return isinstance(found, dict) and all(_has(found.get(name), part) for name, part in wanted.items())
    if isinstance(wanted, list):
        return isinstance(found, list) and len(found) == len(wanted) and all(map(_has, found, wanted))
    return bool(found == wanted)
