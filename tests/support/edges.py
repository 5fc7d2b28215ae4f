"""Questions at the edges of protocol 1, and what every honest stepper answers to them by its page."""

from __future__ import annotations

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
BASE = {"scene": {"table": "cap", "r": 1.0}, "state": START, "t_end": 9.0}
REFUSED = {"outcome": "rejected"}


def asked(cmd: str, **changes: Any) -> Line:
    """Return a request."""
    if cmd == "flow":
        changes = {"states": [START], "state": None, **changes}
    fields = {"cmd": cmd, "seq": 7, **BASE, **changes}
    return {name: part for name, part in fields.items() if name != "state" or part is not None}


# What is asked, and what may come: a part of the answer, or several of which one comes.
EDGES: list[tuple[Line, list[Line]]] = [
    (asked("step", t_end=5.0), [HERE]),
    (asked("step", t_end=math.nextafter(5.0, 0.0)), [REFUSED]),
    (asked("step", t_end=5.0, state={**START, "y": 2.0}), [REFUSED]),
    (asked("step", t_end=5.0, state={**START, "y": -0.0, "wall": "base"}), [{**HERE, "y": 0.0}]),
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
    (asked("step", **TINY), [{"outcome": "collision", "wall": "arc"}, {"outcome": "undecided"}, REFUSED]),
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
