"""Forged claims: false ones, made from lines of the corpus, which the verifier must not prove.

Each kind is a function of a stream of random numbers and a line that holds; it returns a line that is false,
or None where it cannot be sure of that. Its docstring says why what it makes is false. Most reasons are one: a
question has one answer, so a claim is false that contradicts a true one. The numbers of a forgery fit each other
(a later root has its own place and velocity), so that no part of the verifier stands in for another.

    python -m tests.support.forged_claims N [SEED]

draws N forgeries, in turn of each kind, has them verified, and prints for each kind how many were called false
and how many not proved. It prints each forgery that is accepted, or that ends in an error, and then exits with 1.
"""

from __future__ import annotations

import json
import math
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from decimal import Context, Decimal
from fractions import Fraction
from functools import cache, partial
from importlib import import_module
from itertools import cycle, islice
from random import Random
from typing import NamedTuple

import msgspec

import reference
from conformance.generator.prover import coasted, collided
from conformance.generator.prover import ends as exact_ends
from conformance.generator.stays import arrival, marks, stays
from conformance.vectors import NUMBERS, certified
from scene import State, from_data

from .falsifier import CORPUS, Flight, Line, Number, negative, next_hits, numbers

REASONS = ("corner", "tangency", "sliding", "mouth-edge")
STEM_WALLS = ("left", "right", "floor")
TABLE_WALLS = {
    "cap": ("arc", "base"),
    "stem": ("base", *STEM_WALLS),
    "mushroom": ("arc", "base", *STEM_WALLS),
}
N_SAMPLES = 300
DECIMAL = Context(prec=60)
Forge = Callable[[Random, Line], Line | None]


class Forgery(NamedTuple):
    """A false claim, its kind, and the id of the true line that it was made from."""

    kind: str
    source: str
    line: Line


@cache
def lines() -> list[Line]:
    """Return the corpus."""
    texts = (path.read_text("utf-8") for path in sorted(CORPUS.glob("*.jsonl")))
    return [json.loads(line) for text in texts for line in text.splitlines()]


def claim(line: Line, outcome: str, steps: Sequence[Line] = (), **changed: object) -> Line:
    """Return a line with one other answer; a reason or stays go to the answer, other fields to the line."""
    answer = {"outcome": outcome, "steps": list(steps)}
    answer |= {name: changed.pop(name) for name in ("reason", "stays") if name in changed}
    return {**line, **changed, "expect": [answer]}


def ends(step: Line, name: str) -> tuple[Fraction, Fraction]:
    """Return an enclosure, exactly."""
    low, high = map(Fraction, step[name])
    return low, high


def contradicts(one: Line, other: Line) -> bool:
    """Tell whether two steps cannot both be true of one flight."""
    pairs = [(ends(one, name), ends(other, name)) for name in NUMBERS]
    return one.get("wall") != other.get("wall") or any(a[1] < b[0] or b[1] < a[0] for a, b in pairs)


def written(state: Line) -> Line:
    """Write down the state of a flight as a step of the corpus."""
    spare = Fraction(1, 10**40)
    exact = {name: Fraction(*map(int, state[name].as_integer_ratio())) for name in NUMBERS}
    around = {name: (v - abs(v) * spare, v + abs(v) * spare) for name, v in exact.items()}
    step: Line = msgspec.to_builtins(certified(around, [1.0] * 5, state["wall"]))
    return step


def instead(line: Line, flight: Flight, hit: tuple[str, Number] | None, **changed: object) -> Line | None:
    """Return a line with another hit, if that contradicts its first answer."""
    if hit is None:
        return None
    step, true = written(flight.after(*hit)), line["expect"][0]
    t_end = max(changed.pop("t_end", line["t_end"]), float(flight.t + 2 * hit[1]))
    is_false = not true.get("steps") or contradicts(step, true["steps"][0])
    if true["outcome"] == "horizon":
        is_false = hit[1] < numbers().mpf(true["steps"][0]["dt"][0])
    return claim(line, "collision", [step], t_end=t_end, **changed) if is_false else None


def coast(line: Line, t_end: float, scene: Line | None = None, state: Line | None = None) -> Line:
    """Return a line that claims that nothing is met before t_end."""
    start = {**(state or line["state"]), "wall": None}
    flight = Flight(scene or line["scene"], start)
    step = written(flight.free(numbers().mpf(t_end) - flight.t))
    asked = {"scene": scene or line["scene"], "state": state or line["state"], "t_end": t_end}
    return claim(line, "horizon", [step], **asked)


def answered(line: Line, scene: Line, state: Line, span: Number) -> Line:
    """Return a line with what is met first by samples, right or not, of another scene or state."""
    flight = Flight(scene, state)
    hit = next(next_hits(flight, numbers().zero, span, N_SAMPLES), None)
    if hit is None:
        return coast(line, float(flight.t + span), scene, state)
    step = written(flight.after(*hit))
    return claim(line, "collision", [step], scene=scene, state=state, t_end=float(flight.t + 2 * span))


def opened(line: Line) -> tuple[Flight, Number]:
    """Return the flight of a line, and the time that its first step takes."""
    flight = Flight(line["scene"], line["state"])
    return flight, numbers().mpf(line["expect"][0]["steps"][0]["dt"][1])


def moved(size: Callable[[Random, Decimal, Decimal], Decimal], random: Random, line: Line) -> Line | None:
    """Move one number. The enclosure that is claimed has no number in common with the true one."""
    forged = json.loads(json.dumps(line))
    step, name = random.choice(forged["expect"][0]["steps"]), random.choice(NUMBERS)
    true, (low, high) = ends(step, name), map(Decimal, step[name])
    shift = size(random, low, high)
    step[name] = [str(DECIMAL.add(end, shift)) for end in (low, high)]
    return forged if max(true[0], ends(step, name)[0]) > min(true[1], ends(step, name)[1]) else None


def by_widths(random: Random, low: Decimal, high: Decimal) -> Decimal:
    """Return two to five widths of an enclosure, or units of its last place."""
    unit = Decimal(1).scaleb(high.adjusted() - 23 if high else -30)
    return max(DECIMAL.subtract(high, low), unit) * random.choice((-5, -3, -2, 2, 3, 5))


def by_rounding(random: Random, _: Decimal, high: Decimal) -> Decimal:
    """Return some 1e-15 of a number."""
    return DECIMAL.create_decimal(high * random.choice((-9, -2, -1, 1, 2, 9))).scaleb(-15)


def by_much(random: Random, _: Decimal, high: Decimal) -> Decimal:
    """Return a large part of a number."""
    factor = random.choice(("-2", "-1", "-0.5", "0.001", "1e-9", "0.5", "1", "1000"))
    return DECIMAL.multiply(high or Decimal(1), Decimal(factor))


def turned_round(random: Random, line: Line) -> Line | None:
    """Exchange the ends of an enclosure: no number lies above the greater and below the lesser."""
    forged = json.loads(json.dumps(line))
    step, name = random.choice(forged["expect"][0]["steps"]), random.choice(NUMBERS)
    step[name].reverse()
    return forged if ends(step, name)[0] > ends(step, name)[1] else None


def later_hit(is_same: bool, random: Random, line: Line) -> Line | None:
    """Claim a hit that comes after the first, of the same wall or another one."""
    flight, s = opened(line)
    true = line["expect"][0]["steps"][0]["wall"]
    others = tuple(wall for wall in flight.walls(s) if wall != true)
    hits = next_hits(flight, s, 50 * s, N_SAMPLES, (true,) if is_same else others)
    return instead(line, flight, random.choice([*islice(hits, 3), None]))


def other_wall(random: Random, line: Line) -> Line | None:
    """Name another wall: the first one met is one wall, or the answer would be `undefined`."""
    forged = json.loads(json.dumps(line))
    step = random.choice([step for step in forged["expect"][0]["steps"] if "wall" in step] or [{}])
    others = [wall for wall in TABLE_WALLS[line["scene"]["table"]] if wall != step.get("wall")]
    true, step["wall"] = step.get("wall"), random.choice(others)
    return forged if true else None


def unmet(random: Random, line: Line) -> Line | None:
    """Claim that nothing is met before a t_end that lies after the proved hit."""
    t, dt = line["state"]["t"], ends(line["expect"][0]["steps"][0], "dt")[1]
    t_end = random.choice((line["t_end"], float(t + dt * (1 + Fraction(1, 2 ** random.randint(1, 40))))))
    return coast(line, t_end) if t_end > Fraction(t) + dt else None


def out_of_time(random: Random, line: Line) -> Line | None:
    """Move t_end before the proved hit, which is still claimed."""
    t, dt = line["state"]["t"], ends(line["expect"][0]["steps"][0], "dt")[0]
    t_end = float(t + dt * (1 - Fraction(1, 2 ** random.randint(1, 40))))
    return {**line, "t_end": t_end} if t <= t_end < Fraction(t) + dt else None


def run_on(random: Random, line: Line) -> Line | None:
    """Move t_end of a horizon to where f of a wall in reach has been negative: a sample shows it."""
    flight, s = opened(line)
    span = s * random.randint(2, 30)
    t_end = float(flight.t + span)
    met = next(next_hits(flight, numbers().zero, span, N_SAMPLES), None)
    if met is None or random.random() < 0.5:
        return coast(line, t_end) if negative(flight, t_end - flight.t, N_SAMPLES) else None
    near = float(flight.t + met[1] * (1 + numbers().mpf(2) ** -random.randint(1, 30)))
    return coast(line, near) if negative(flight, near - flight.t, N_SAMPLES) else None


def ghost(_: Random, line: Line) -> Line | None:
    """Claim that the wall being left is hit at once: the proved hit comes later than dt = 0."""
    flight, _s = opened(line)
    return instead(line, flight, (flight.left, numbers().zero)) if flight.left else None


def residual_kept(_: Random, line: Line) -> Line | None:
    """Claim the root of f and not of f - f(0) where the wall being left is met again, if they differ."""
    flight, s = opened(line)
    flight.residual = numbers().zero
    is_again = flight.left == line["expect"][0]["steps"][0]["wall"]
    hit = next(next_hits(flight, s / 2, s * 2, N_SAMPLES, (flight.left,)), None) if is_again else None
    return instead(line, flight, hit)


def step_missing(random: Random, line: Line) -> Line | None:
    """Leave out a step; the next one contradicts it, and so is not what follows the one before."""
    answer = line["expect"][0]
    steps = list(answer["steps"])
    place = random.randrange(len(steps))
    is_contradicted = place + 1 < len(steps) and contradicts(*steps[place : place + 2])
    del steps[place]
    asked = line["collisions"] - random.choice((0, 1)) if is_contradicted else line["collisions"]
    is_counted = answer["outcome"] == "collision" or is_contradicted or place == len(steps)
    return claim(line, answer["outcome"], steps, collisions=asked) if steps and is_counted else None


def steps_exchanged(random: Random, line: Line) -> Line | None:
    """Exchange two steps that follow each other and contradict each other."""
    steps = list(line["expect"][0]["steps"])
    place = random.randrange(max(1, len(steps) - 1))
    pair = steps[place : place + 2]
    steps[place : place + 2] = reversed(pair)
    is_false = len(pair) == 2 and contradicts(*pair)
    return claim(line, line["expect"][0]["outcome"], steps) if is_false else None


def path_ended(random: Random, line: Line) -> Line | None:
    """End a path where a further hit is proved: by the horizon, or by an `undefined`."""
    steps = line["expect"][0]["steps"]
    kept = random.randrange(1, len(steps)) if len(steps) > 1 else 0
    if not kept or "wall" not in steps[kept]:
        return None
    if random.random() < 0.5:
        return claim(line, "undefined", steps[:kept], reason=random.choice(REASONS))
    last, flown = steps[kept - 1], [sum(ends(step, "dt")[side] for step in steps[:kept]) for side in (0, 1)]
    rest = [Fraction(line["t_end"]) - line["state"]["t"] - end for end in reversed(flown)]
    found = {"dt": (rest[0], rest[1])} | {name: ends(last, name) for name in ("vx", "vy")}
    for place, speed in (("x", "vx"), ("y", "vy")):
        ways = [v * s for v in found[speed] for s in rest]
        found[place] = ends(last, place)[0] + min(ways), ends(last, place)[1] + max(ways)
    is_before = flown[1] + ends(steps[kept], "dt")[1] < Fraction(line["t_end"]) - line["state"]["t"]
    horizon = msgspec.to_builtins(certified(found, [1.0] * 5, None))
    return claim(line, "horizon", [*steps[:kept], horizon]) if is_before else None


def undefined(random: Random, line: Line) -> Line:
    """Call an answer undefined that is proved."""
    return claim(line, "undefined", reason=random.choice(REASONS))


def other_reason(random: Random, line: Line) -> Line | None:
    """Give an undefined answer another reason than the one that is proved."""
    reason = random.choice(REASONS)
    return claim(line, "undefined", reason=reason) if reason != line["expect"][0]["reason"] else None


def tie_answered(random: Random, line: Line) -> Line | None:
    """Answer a question that is proved to have no answer."""
    flight, mp = Flight(line["scene"], line["state"]), numbers()
    walls = TABLE_WALLS[line["scene"]["table"]]
    hits = [*islice(next_hits(flight, mp.zero, mp.mpf(10), N_SAMPLES, walls), 3), None]
    return instead(line, flight, random.choice(hits)) or coast(line, line["t_end"])


def corner_left(random: Random, line: Line) -> Line:
    """Answer a start that lies on two walls exactly: w, h and r are dyadic, and so is the place."""
    w, h, side = random.randint(1, 64) / 64, random.randint(1, 64) / 64, random.choice((-1, 1))
    depth, t = random.choice((h, {"kind": "bang-bang", "knots": [[0, h], [1, h / 2], [4, h]]})), 0.0
    table = random.choice(("cap", "stem", "mushroom"))
    scene = {"table": table, "w": w, "h": depth} | ({} if table == "stem" else {"r": 2.0})
    wall, x, y = random.choice((("side", w, -h), ("floor", w, -h), ("side", w, 0.0)))
    if table == "cap":
        scene, wall, x, y = {"table": table, "r": w}, random.choice(("arc", "base")), w, 0.0
    wall = ("right" if side > 0 else "left") if wall == "side" else wall
    vx, vy = (
        -side * random.uniform(0.1, 2.0),
        random.uniform(0.1, 2.0) * (-1 if y == 0 and table != "cap" else 1),
    )
    state = {"t": t, "x": side * x, "y": y, "vx": vx, "vy": vy, "wall": wall}
    return answered({**line, "collisions": 1}, scene, state, numbers().mpf(20))


def off_wall(random: Random, line: Line) -> Line | None:
    """Move the start off the wall that it names by more than the 2^-20 of its size that are allowed."""
    state, part = dict(line["state"]), 2.0 ** -random.uniform(4, 19)
    wall, laws = (
        state["wall"],
        {name: float(law[0]) for name, law in opened(line)[0].laws(numbers().zero).items()},
    )
    size = max(laws.get("r", 0.0), laws.get("w", 0.0))
    if wall == "arc":
        state["x"], state["y"], size = state["x"] * (1 - part), state["y"] * (1 - part), 2 * laws["r"] ** 2
    elif wall in ("floor", "base"):
        size = laws["h"] if wall == "floor" else size
        state["y"] += part * size * (-1 if line["scene"]["table"] == "stem" and wall == "base" else 1)
    else:
        size = max(laws["w"], abs(state["x"]))
        state["x"] += part * size * (1 if wall == "left" else -1)
    off = abs(Flight(line["scene"], {**state, "wall": None}).walls(numbers().zero)[wall].f)
    return answered(line, line["scene"], state, 2 * opened(line)[1]) if off > 1.1 * 2.0**-20 * size else None


def beyond(random: Random, line: Line) -> Line | None:
    """Start where f of a wall of that part is negative, the residual rule is not asked for."""
    state, part = {**line["state"], "wall": None}, 1 + 2.0 ** -random.uniform(2, 30)
    flight, zero = Flight(line["scene"], state), numbers().zero
    wall, laws = random.choice(flight.reach(zero)), {name: law[0] for name, law in flight.laws(zero).items()}
    if wall == "arc":
        stretch = part * laws["r"] / math.hypot(state["x"], state["y"] or 1e-9)
        state["x"], state["y"] = float(state["x"] * stretch), float(state["y"] * stretch)
    elif wall == "floor":
        state["y"] = float(-laws["h"] * part)
    elif wall != "base":
        width = laws["w"] + laws.get("slope", zero) * flight.y
        state["x"] = float(width * part * (1 if wall == "right" else -1))
    moved_flight = Flight(line["scene"], state)
    is_out = wall in moved_flight.reach(zero) and moved_flight.walls(zero)[wall].f < 0
    return answered(line, line["scene"], state, 2 * opened(line)[1]) if is_out else None


def into_wall(_: Random, line: Line) -> Line | None:
    """Turn the velocity of a start about, so that it moves into the wall that it is on."""
    flight, s = opened(line)
    if flight.left is None:
        return None
    turned = flight.after(flight.left, numbers().zero)
    state = {**line["state"], "vx": float(turned["vx"]), "vy": float(turned["vy"])}
    is_inward = Flight(line["scene"], state).walls(numbers().zero)[flight.left].rate < 0
    return answered(line, line["scene"], state, 2 * s) if is_inward else None


def past(random: Random, line: Line) -> Line | None:
    """Ask for a horizon before the start: that is to be refused."""
    t = line["state"]["t"]
    t_end = t - random.choice((1.0, 1e-9)) * max(1.0, abs(t))
    return coast(line, t_end) if t_end < t else None


def shut_mouth(random: Random, line: Line) -> Line | None:
    """Pass a mouth that is shut: the base is proved to be met, and a wall of the stem is claimed."""
    flight, s = opened(line)
    if line["expect"][0]["steps"][0].get("wall") != "base" or flight.left == "base":
        return None
    return instead(line, flight, next(next_hits(flight, s, 20 * s, N_SAMPLES, STEM_WALLS), None))


def open_mouth(_: Random, line: Line) -> Line | None:
    """Meet the base where the mouth is proved to be passed."""
    flight, s = opened(line)
    crossing = flight.crossing()
    return instead(line, flight, ("base", crossing)) if crossing and crossing < s else None


def knot_ignored(random: Random, line: Line) -> Line | None:
    """Answer for a law that goes on as at the start, or that lacks a knot, where this contradicts the truth."""
    scene, s = json.loads(json.dumps(line["scene"])), opened(line)[1]
    laws = [law["knots"] for law in scene.values() if isinstance(law, dict) and len(law.get("knots", ())) > 2]
    is_blind = random.random() < 0.5 or not laws
    if not is_blind:
        knots = random.choice(laws)
        del knots[random.randrange(1, len(knots) - 1)]
    flight = Flight(scene, line["state"], is_blind=is_blind)
    return instead(line, flight, next(next_hits(flight, numbers().zero, 4 * s, N_SAMPLES), None))


@cache
def flow_path(name: str) -> tuple[list[Line], tuple[tuple[int, int], ...]]:
    """Return all steps of a flow of the corpus, the last to the horizon, and its captured stays."""
    line = next(line for line in lines() if line["id"] == name)
    scene, state = from_data(line["scene"]), State(**line["state"])
    path = reference.trajectory(scene, state, line["collisions"], line["t_end"])
    steps = [certified(collided(step), [1.0] * 5, step.wall) for step in path.steps]
    start = Fraction(state.t)
    since = exact_ends(path.steps[-1].after.t) if path.steps else (start, start)
    assert isinstance(path.outcome, reference.Horizon)
    return [*steps, certified(coasted(path.outcome, since), [1.0] * 5, None)], stays(marks(scene, path.steps))


def stays_changed(how: str, random: Random, line: Line) -> Line | None:
    """Move an end of a captured stay, leave a stay out or invent one: the list of stays is one."""
    steps, true = flow_path(line["id"])
    changed = list(true)
    place = random.randrange(len(true)) if true else 0
    if how == "added":
        changed = sorted([*true, (random.randrange(len(steps)), random.randrange(len(steps)))])
    elif how == "dropped":
        del changed[place : place + 1]
    elif true:
        begin, end = true[place]
        by = random.choice((-3, -2, -1, 1, 2, 3))
        changed[place] = random.choice(((begin + by, end), (begin, end + by)))
    is_list = all(0 <= begin < end < len(steps) for begin, end in changed)
    if changed == list(true) or not is_list:
        return None
    return {**line, "expect": [msgspec.to_builtins(arrival(steps, changed))]}


def miscounted(random: Random, line: Line) -> Line | None:
    """Claim another number of steps for a flow's path."""
    count = line.get("collisions", 1) + random.choice((-10, -2, -1, 1, 2, 10))
    return {**line, "collisions": count} if count > 0 else None


def refusal(is_only: bool, random: Random, line: Line) -> Line:
    """Permit a refusal, or nothing else, at level core: there an answer is proved, and is within reach."""
    more = {"outcome": random.choice(("rejected", "undecided"))}
    return {**line, "expect": [more] if is_only else [*line["expect"], more]}


def refused_answered(_: Random, line: Line) -> Line:
    """Answer a question that is proved to be bad input."""
    return coast(line, line["t_end"])


def second_answer(random: Random, line: Line) -> Line | None:
    """Permit a false answer beside the true one."""
    forge = random.choice((partial(moved, by_widths), other_wall, partial(later_hit, False), undefined))
    forged = forge(random, line)
    both = forged and [*line["expect"], *forged["expect"]]
    return forged and {**forged, "expect": random.choice((both, both[::-1]))}


def raised(law: Line | float, by: float) -> Line | float:
    """Return a law plus a constant."""
    if not isinstance(law, dict):
        return law + by
    if law["kind"] == "fourier":
        return {**law, "mean": law["mean"] + by}
    return {**law, "knots": [[t, value + by] for t, value in law["knots"]]}


def broken(random: Random, line: Line) -> Line | None:
    """Break a rule of scenes for a part of the period: laws at a sampled instant, to 60 decimals, show it."""
    scene, (flight, span) = line["scene"], opened(line)
    name = random.choice([name for name in ("r", "w", "nu", "h", "slope") if name in scene])
    part, found = 2.0 ** -random.randint(1, 20), []
    for k in range(40):
        s = span * k / 2
        laws = {of: float(law[0]) for of, law in flight.laws(s).items()}
        room = {
            "nu": 1 - laws.get("nu", 0),
            "slope": laws.get("w", 0) / laws.get("h", 1) - laws.get("slope", 0),
        }
        room["w"] = random.choice((laws.get("r", -laws["w"]) - laws["w"], -laws["w"])) if "w" in laws else 0
        room |= {"h": -laws.get("h", 0), "r": laws["w"] - laws["r"] if "w" in scene and "r" in laws else 0}
        room["r"] = room["r"] or -laws.get("r", 0)
        found.append((abs(room[name]), room[name] * (1 + part), s))
    _, by, s = min(found)
    spoiled = {**scene, name: raised(scene[name], by)}
    laws = {of: law[0] for of, law in Flight(spoiled, line["state"]).laws(s).items()}
    is_bad = min(value for of, value in laws.items() if of in ("r", "w", "h")) <= 0
    is_bad |= "w" in laws and (
        laws["w"] > laws.get("r", laws["w"]) or laws["w"] <= laws["h"] * laws.get("slope", 0)
    )
    return answered(line, spoiled, line["state"], 2 * span) if is_bad else None


def broken_law(random: Random, line: Line) -> Line | None:
    """Let a law jump at the end of its period, or give one of two moving laws a period of its own."""
    scene = json.loads(json.dumps(line["scene"]))
    moving = [law for law in scene.values() if isinstance(law, dict) and moves(law)]
    law, part = random.choice([*moving, {}]), 1 + 2.0 ** -random.randint(1, 40)
    if "knots" in law and random.random() < 0.5:
        law["knots"][-1][1] *= part
    elif "knots" in law and len(moving) > 1:
        law["knots"][-1][0] *= part
    elif len(moving) > 1 and law:
        law["omega" if law.get("omega") else "period"] *= part
    is_broken = law and scene != line["scene"]
    return answered(line, scene, line["state"], 2 * opened(line)[1]) if is_broken else None


def moves(law: Line) -> bool:
    """Tell whether a law is not constant."""
    values = {value for _, value in law.get("knots", ())}
    return len(values) > 1 or any(law.get("cos", ())) or any(law.get("sin", ()))


def slow(random: Random, line: Line) -> Line | None:
    """Let a wall of many harmonics come to a slow particle: the reference proves when, another time is claimed."""
    n, omega, mp = random.randint(3, 8), random.uniform(0.5, 6), numbers()
    cos, sin = ([random.uniform(-0.5, 0.5) / n for _ in range(n)] for _ in range(2))
    law = {"kind": "fourier", "mean": 2.0, "omega": omega, "cos": cos, "sin": sin}
    table = random.choice(("cap", "stem"))
    scene = {"table": table, "r": law} if table == "cap" else {"table": table, "w": 1.0, "h": law}
    t, period = random.uniform(0, 20), 2 * math.pi / omega
    way = -1.0 if table == "stem" else 1.0
    rest = Flight(scene, {"t": t, "x": 0.0, "y": way / 2, "vx": 0.0, "vy": 0.0, "wall": None})
    sizes = [rest.laws(mp.mpf(k) * period / 400)["h" if table == "stem" else "r"] for k in range(400)]
    least, speed = (
        float(min(sizes)[0]),
        float(max(abs(rate) for _, rate in sizes)) * 10 ** random.uniform(-6, -3),
    )
    y = way * (least - speed * period * random.uniform(0.5, 40))
    state = {"t": t, "x": 0.0, "y": y, "vx": 0.0, "vy": way * speed, "wall": None}
    true = reference.next_collision(from_data(scene), State(**state), t + 200 * period, digits=30)
    if not isinstance(true, reference.Collision):
        return None
    flight, asked = Flight(scene, state), {**line, "collisions": 1}
    dt = float(true.dt) * (1 + 1e-9)
    if random.random() < 0.5:
        return coast(asked, t + dt + period * random.uniform(0, 100), scene, state)
    hit = next(next_hits(flight, mp.mpf(dt), mp.mpf(dt + 3 * period), N_SAMPLES, (true.wall,)), None)
    claimed = hit and [written(flight.after(*hit))]
    return claimed and claim(
        asked, "collision", claimed, scene=scene, state=state, t_end=t + dt + 99 * period
    )


KINDS: dict[str, tuple[str, Forge]] = {
    "a number moved by widths": ("answered", partial(moved, by_widths)),
    "a number moved by 1e-15": ("answered", partial(moved, by_rounding)),
    "a number moved far": ("answered", partial(moved, by_much)),
    "an enclosure turned round": ("answered", turned_round),
    "a later root of the wall": ("hit", partial(later_hit, True)),
    "a later root of another wall": ("hit", partial(later_hit, False)),
    "another wall named": ("answered", other_wall),
    "a horizon behind a hit": ("hit", unmet),
    "a hit behind the horizon": ("hit", out_of_time),
    "a horizon moved behind a hit": ("horizon", run_on),
    "the wall left is hit at once": ("hit", ghost),
    "the residual not taken out": ("hit", residual_kept),
    "a step left out": ("trajectory", step_missing),
    "two steps exchanged": ("trajectory", steps_exchanged),
    "a path ended before its time": ("trajectory", path_ended),
    "an answer called undefined": ("step", undefined),
    "undefined for another reason": ("undefined", other_reason),
    "a tie answered": ("undefined", tie_answered),
    "a corner left": ("step", corner_left),
    "a start off its wall": ("leaving", off_wall),
    "a start beyond a wall": ("step", beyond),
    "a start into its wall": ("leaving", into_wall),
    "a horizon before the start": ("step", past),
    "a shut mouth passed": ("mushroom", shut_mouth),
    "an open mouth hit": ("mushroom", open_mouth),
    "a knot ignored": ("knots", knot_ignored),
    "a captured stay moved": ("stays", partial(stays_changed, "moved")),
    "a captured stay dropped": ("stays", partial(stays_changed, "dropped")),
    "a captured stay invented": ("flow", partial(stays_changed, "added")),
    "steps of a flow miscounted": ("flow", miscounted),
    "a refusal permitted": ("core", partial(refusal, False)),
    "nothing but a refusal": ("core", partial(refusal, True)),
    "bad input answered": ("rejected", refused_answered),
    "a false answer permitted": ("step", second_answer),
    "a scene broken for a time": ("step", broken),
    "a law broken": ("step", broken_law),
    "a slow particle missed": ("step", slow),
}


@cache
def pools() -> dict[str, list[Line]]:
    """Return the lines of the corpus that a kind of forgery begins with."""
    sole = [line for line in lines() if len(line["expect"]) == 1]
    found = {line["id"]: line["expect"][0]["outcome"] for line in lines()}
    answers = [line for line in lines() if found[line["id"]] in ("collision", "horizon")]
    steps = [line for line in answers if line["kind"] == "step"]
    flows = [line for line in answers if line["kind"] == "flow" and line.get("collisions", 1) <= 60]
    return {
        "answered": answers,
        "step": steps,
        "hit": [line for line in steps if found[line["id"]] == "collision"],
        "horizon": [line for line in steps if found[line["id"]] == "horizon"],
        "leaving": [line for line in steps if line["state"]["wall"]],
        "mushroom": [line for line in steps if line["scene"]["table"] == "mushroom"],
        "knots": [line for line in steps if "knots" in str(line["scene"])],
        "trajectory": [line for line in answers if line["kind"] == "trajectory"],
        "flow": flows,
        "stays": [line for line in flows if line["expect"][0].get("stays")],
        "undefined": [line for line in lines() if found[line["id"]] == "undefined"],
        "rejected": [
            x for x in sole if found[x["id"]] == "rejected" and x["scene"].get("table") in TABLE_WALLS
        ],
        "core": [line for line in sole if line["level"] == "core" and line in answers],
    }


def draw(n: int, seed: int) -> Iterator[Forgery]:
    """Yield n forgeries, of each kind in turn."""
    random = Random(seed)
    for kind, (pool, forge) in islice(cycle(KINDS.items()), n):
        forged = None
        while forged is None:
            line = random.choice(pools()[pool])
            forged = forge(random, line)
        yield Forgery(kind, line["id"], forged)


def main(n: int, seed: int) -> int:
    """Have n forgeries verified; return 1 if one is accepted, or ends in an error."""
    verify = import_module("conformance.verify")
    counts: dict[str, Counter[str]] = {kind: Counter() for kind in KINDS}
    wrong, began = 0, time.monotonic()
    for forgery in draw(n, seed):
        try:
            status = verify.verify_line(forgery.line).status
        except verify.Unreadable:
            status = "unreadable"
        except Exception as error:
            status = f"{type(error).__name__}: {error}"
        counts[forgery.kind][status] += 1
        if status not in ("false", "not proved", "unreadable"):
            wrong += 1
            print(f"{forgery.kind}, from {forgery.source}: {status}\n{json.dumps(forgery.line)}", flush=True)
    for kind, found in counts.items():
        print(f"{kind:32}" + "".join(f"{k:>6} {status}" for status, k in sorted(found.items())))
    print(f"{n} forgeries, seed {seed}: {wrong} accepted or in error, in {time.monotonic() - began:.0f} s")
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main(*map(int, [*sys.argv[1:], "1"][:2])))
