"""Spoilt protocol lines and scene files: valid ones with a value, a key or some bytes gone wrong."""

import json
import random
from collections.abc import Iterator
from copy import deepcopy
from typing import Any

from scene import catalogue
from scene.load import read_data
from support.faulty_servers import HIT, INTRODUCTION

NUMBERS = (
    0.0,
    -0.0,
    1,
    -1,
    0.1,
    5e-324,
    1e-320,
    -1e-12,
    1e15,
    1e200,
    -1e308,
    2**53,
    2**70,
    6.283185307179586,
)
WORDS = ("", "1.0", "nan", "\u0000\ud800", "arc", "lid")
OTHERS = (None, True, *WORDS, [], {}, [[]], [0.5, "x"], {"kind": "fourier"})
LAWS = (
    {"kind": "fourier", "mean": 1.0, "omega": 0.0, "cos": [0.1]},
    {"kind": "fourier", "mean": 1.0, "omega": 1e9, "sin": [1e-3] * 40},
    {"kind": "bang-bang", "knots": []},
    {"kind": "bang-bang", "knots": [[0.0, 1.0], [0.0, 1.0]]},
    {"kind": "bang-bang", "knots": [[0.0, 1.0], [1e-300, 0.5], [1.0, 1.0]]},
    {"kind": "spline", "knots": [[0.0, 1.0]]},
)
BYTES = (b"\x00", b"\xff", b"{", b"}", b"[", b'"', b"\\", b"e999", b"NaN", b"\xef\xbb\xbf", b",", b"-", b"\r")
FACTORS = (-1.0, 0.0, 0.5, 1 - 2.0**-53, 1 + 1e-12, 1.1, 2.0, 1e3, 1e-9)
# A valid request for so many collisions is work, not an attack: counts are small or refused.
COUNTS = (-1, 0, 1, 2, 1.5, "3", None, 10**7, 2**70, True)
SCENES = [dict(read_data(name)) for name in catalogue()]
STATE = {"t": 0.0, "x": 0.1, "y": 0.3, "vx": 10.0, "vy": 7.0, "wall": None}
CIRCLE = {"table": "cap", "r": 1.0}
WARM_UP = [
    {"cmd": "step", "seq": 1, "scene": CIRCLE, "state": STATE, "t_end": 9.0},
    {"cmd": "trajectory", "seq": 1, "scene": CIRCLE, "state": STATE, "t_end": 9.0, "collisions": 2},
    {"cmd": "flow", "seq": 1, "scene": CIRCLE, "states": [STATE], "t_end": 0.1},
]


def requests(draw: random.Random) -> dict[str, Any]:
    """Return a valid request of protocol 1, other than stop."""
    scene = draw.choice(SCENES)
    common = {"seq": draw.randrange(100), "scene": scene, "state": dict(STATE), "t_end": 50.0}
    return draw.choice(
        [
            {"cmd": "start", "protocol": 1},
            {"cmd": "echo", "values": [draw.choice(NUMBERS[:8]) for _ in range(3)]},
            {"cmd": "step", **common},
            {"cmd": "step", **common},
            {"cmd": "trajectory", "collisions": 2, **common},
            {"cmd": "flow", "seq": 1, "scene": scene, "states": [dict(STATE)], "t_end": 0.1},
            {"cmd": "time", "seq": 1, "scene": scene, "state": dict(STATE), "collisions": 1, "repeat": 1},
        ]
    )


def answers(draw: random.Random) -> dict[str, Any]:
    """Return a valid answer of protocol 1 to seq 1."""
    arrival = {"outcome": "horizon", "t": 1.0, "x": 0.0, "y": 0.0, "vx": 1.0, "vy": 1.0}
    return draw.choice(
        [
            {"seq": 1, **HIT},
            {"seq": 1, **arrival},
            {"seq": 1, "outcome": "undefined", "reason": "corner"},
            {"seq": 1, "steps": [dict(HIT), dict(arrival)]},
            {"seq": 1, "states": [{**arrival, "captured": [0.1, 0.2]}]},
            {"seq": 1, "ns": [100], "steps": [dict(HIT)]},
            {"seq": 1, "error": "no"},
            {"values": [0.1, -0.0]},
            INTRODUCTION,
        ]
    )


def places(data: Any) -> Iterator[tuple[Any, Any]]:
    """Yield what holds each value within, and its key there."""
    inner = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in inner:
        yield data, key
        yield from places(value)


def spoil(draw: random.Random, data: dict[str, Any]) -> Any:
    """Change a copy of the data in one to three places."""
    data = json.loads(json.dumps(data))
    for _ in range(draw.choice((1, 1, 1, 2, 3))):
        found = list(places(data))
        if not found:
            return draw.choice(OTHERS)
        holder, key = draw.choice(found)
        how = draw.randrange(10)
        if key in ("collisions", "repeat"):
            holder[key] = draw.choice(COUNTS)
        elif how == 0:
            del holder[key]
        elif how == 1 and isinstance(holder, dict):
            name = draw.choice(("r", "w", "extra", "", "kind", "reason\n"))
            holder[name] = deepcopy(draw.choice(NUMBERS + OTHERS))
        elif how < 6 and type(holder[key]) is float:
            holder[key] *= draw.choice(FACTORS)
        else:
            holder[key] = deepcopy(draw.choice((*NUMBERS, *NUMBERS, *OTHERS, *LAWS)))
    return data


def garble(draw: random.Random, line: bytes) -> bytes:
    """Cut, double, or sprinkle bytes into a line; it stays one line."""
    at = draw.randrange(len(line) + 1)
    sprinkled = draw.choice(BYTES), bytes([draw.randrange(256)]), b"[" * 5000
    ways = line[:at], line + line[at:], *(line[:at] + more + line[at:] for more in sprinkled)
    return draw.choice(ways).replace(b"\n", b" ")


def lines(seed: int, n: int, kind: Any) -> Iterator[bytes]:
    """Yield n lines, without their newlines: most with spoilt values, some garbled, some sound."""
    draw = random.Random(seed)
    for _ in range(n):
        data = kind(draw)
        part = draw.random()
        if part < 0.65:
            data = spoil(draw, data)
        line = json.dumps(data).encode()
        yield garble(draw, line) if 0.55 < part < 0.75 else line
