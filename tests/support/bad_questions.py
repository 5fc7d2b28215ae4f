"""Questions that have no answer, or must be refused, answered all the same; for `forged_claims`.

The forgeries are functions as in `false_answers`. Here the question is changed so that a documented rule
refuses it or calls it undefined, which is shown in exact numbers or to 60 decimals; and the answer is what a
stepper would give that does not look. The last one aims at slow particles.
"""

from __future__ import annotations

from itertools import islice
from random import Random
from typing import Any

import reference
from scene import State, from_data

from .false_answers import N_SAMPLES, answered, claim, coast, opened, plain, written
from .falsifier import Flight, Line, Number, next_hits, numbers

NEAR = 2.0**-20  # how far from the wall that it names a state may be


def leave_corner(random: Random, line: Line) -> Line:
    """Start on two walls exactly: the numbers are dyadic."""
    w, h, side = random.randint(1, 64) / 64, random.randint(1, 64) / 64, random.choice((-1, 1))
    depth: Any = random.choice((h, {"kind": "bang-bang", "knots": [[0.0, h], [1.0, h / 2], [4.0, h]]}))
    table = random.choice(("cap", "stem", "mushroom"))
    scene = {"cap": {"r": w}, "stem": {"w": w, "h": depth}, "mushroom": {"r": 2.0, "w": w, "h": depth}}[table]
    name, y = random.choice((("side", -h), ("floor", -h), ("side", 0.0)))
    if table == "cap":
        name, y = random.choice(("arc", "base")), 0.0
    wall = {"side": "right" if side > 0 else "left"}.get(name, name)
    vy = random.uniform(0.1, 2.0) * (-1 if y == 0 and table != "cap" else 1)
    state = {"t": 0.0, "x": side * w, "y": y, "vx": -side * random.uniform(0.1, 2.0), "vy": vy, "wall": wall}
    return answered({**line, "scene": {"table": table, **scene}, "state": state}, numbers().mpf(20))


def pushed(flight: Flight, wall: str, way: Number) -> Line:
    """Return a start moved along the gradient of a wall's f, as far as f would grow by some way if linear."""
    at = flight.walls(numbers().zero)[wall]
    step = way / (at.fx**2 + at.fy**2 or 1)
    state = flight.free(numbers().zero) | {"x": flight.x + step * at.fx, "y": flight.y + step * at.fy}
    return {name: float(state[name]) for name in ("t", "x", "y", "vx", "vy")}


def leave_wall(random: Random, line: Line) -> Line | None:
    """Move the start off the wall that it names by more than the share of its size that is allowed."""
    flight, s = opened(line)
    laws = [law[0] for law in flight.laws(numbers().zero).values()]
    size = max(abs(flight.x), *laws)
    unit = 2 * flight.laws(numbers().zero)["r"][0] if flight.left == "arc" else 1
    state = pushed(flight, flight.left, unit * size * 2.0 ** -random.uniform(6, 19))
    off = Flight(line["scene"], state).walls(numbers().zero)[flight.left].f / unit
    start = {**state, "wall": flight.left}
    return answered({**line, "state": start}, 2 * s) if off > 1.1 * NEAR * size else None


def start_beyond(random: Random, line: Line) -> Line | None:
    """Start where f of a wall of that part of the table is negative; no wall is named."""
    flight, s = opened(line)
    zero = numbers().zero
    wall = random.choice(flight.reach(zero))
    f = flight.walls(zero)[wall].f
    state = pushed(flight, wall, -f - (1 + abs(f)) * 2.0 ** -random.uniform(2, 30))
    found = Flight(line["scene"], state)
    is_beyond = found.y and wall in found.reach(zero) and found.walls(zero)[wall].f < 0
    return answered({**line, "state": {**state, "wall": None}}, 2 * s) if is_beyond else None


def start_into_wall(_: Random, line: Line) -> Line | None:
    """Turn a velocity round, so that f of the wall being left decreases."""
    flight, s = opened(line)
    after = flight.after(flight.left, numbers().zero)
    state = {**line["state"], "vx": float(after["vx"]), "vy": float(after["vy"])}
    is_inwards = Flight(line["scene"], state).walls(numbers().zero)[flight.left].rate < 0
    return answered({**line, "state": state}, 2 * s) if is_inwards else None


def end_in_the_past(random: Random, line: Line) -> Line:
    """Ask for a horizon before the start."""
    t = line["state"]["t"]
    return coast(line, t - random.choice((1.0, 1e-9)) * max(1.0, abs(t)))


def answer_bad_input(_: Random, line: Line) -> Line:
    """Answer a question that is proved to be bad input."""
    return coast(line, line["t_end"])


def raised(law: Any, by: float) -> Any:
    """Return a law plus a constant."""
    if not isinstance(law, dict):
        return law + by
    if law["kind"] == "fourier":
        return {**law, "mean": law["mean"] + by}
    return {**law, "knots": [[t, value + by] for t, value in law["knots"]]}


def is_broken(laws: dict[str, tuple[Number, Number]]) -> bool:
    """Tell whether the laws break a rule of scenes at an instant."""
    r, w, h, slope = (laws[name][0] if name in laws else None for name in ("r", "w", "h", "slope"))
    is_negative = any(law is not None and law < 0 for law in (r, w, h))
    is_crossed = bool(w and h and slope and w < h * slope)
    return is_negative or is_crossed or bool(r and w and w > r)


def break_scene(random: Random, line: Line) -> Line | None:
    """Raise or lower a law, so that a rule of scenes is broken at one of 40 instants or more."""
    s = opened(line)[1]
    name = random.choice([name for name in line["scene"] if name in ("r", "w", "nu", "h", "slope")])
    by = random.choice((-1, 1)) * 2.0 ** random.uniform(-8, 2)
    broken = {**line, "scene": {**line["scene"], name: raised(line["scene"][name], by)}}
    flight = Flight(broken["scene"], line["state"])
    return answered(broken, 2 * s) if any(is_broken(flight.laws(k * s / 4)) for k in range(40)) else None


def break_law(random: Random, line: Line) -> Line | None:
    """Let a law jump where its period ends, or give one of two moving laws another period."""
    forged, part = plain(line), 1 + 2.0 ** -random.randint(1, 40)
    laws = [law for law in forged["scene"].values() if isinstance(law, dict) and moves(law)]
    law = random.choice(laws or [{}])
    if "knots" in law:
        law["knots"][-1][1] *= part
    elif len(laws) > 1:
        law["omega" if law.get("omega") else "period"] *= part
    return answered(forged, 2 * opened(line)[1]) if forged != line else None


def moves(law: Line) -> bool:
    """Tell whether a law is not constant."""
    values = {value for _, value in law.get("knots", ())}
    return len(values) > 1 or any(law.get("cos", ())) or any(law.get("sin", ()))


def miss_slow_particle(random: Random, line: Line) -> Line | None:
    """Miss a wall of many harmonics that comes to a slow particle, as the reference proves."""
    n, period, mp = random.randint(3, 8), random.uniform(1.0, 9.0), numbers()
    cos, sin = ([random.uniform(-0.5, 0.5) / n for _ in range(n)] for _ in range(2))
    law = {"kind": "fourier", "mean": 2.0, "period": period, "cos": cos, "sin": sin}
    name, way = random.choice((("r", 1.0), ("h", -1.0)))
    scene = {"table": "cap", "r": law} if name == "r" else {"table": "stem", "w": 1.0, "h": law}
    state: Line = {"t": random.uniform(0, 20), "x": 0.0, "y": way, "vx": 0.0, "vy": 0.0, "wall": None}
    laws = [Flight(scene, state).laws(mp.mpf(k) * period / 400)[name] for k in range(400)]
    speed = float(max(rate for _, rate in laws)) * 10 ** random.uniform(-6, -3)
    y = way * (float(min(laws)[0]) - speed * period * random.uniform(0.5, 40))
    state |= {"y": y, "vy": way * speed}
    true = reference.next_collision(from_data(scene), State(**state), state["t"] + 200 * period, digits=20)
    if not isinstance(true, reference.Collision):
        return None
    after = float(true.dt) * (1 + 1e-9)
    asked = {
        **line,
        "scene": scene,
        "state": state,
        "t_end": state["t"] + after + period * random.uniform(0, 99),
    }
    flight = Flight(scene, state)
    later = next_hits(flight, mp.mpf(after), mp.mpf(after + 3 * period), N_SAMPLES, (true.wall,))
    hit = next(islice(later, random.randrange(3), None), ("", mp.inf))
    is_coasting = flight.t + hit[1] >= asked["t_end"]
    return (
        coast(asked, asked["t_end"])
        if is_coasting
        else claim(asked, "collision", written(flight.after(*hit)))
    )
