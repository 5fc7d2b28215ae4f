"""False answers to questions of the corpus, for `forged_claims`.

Each forgery is a function of a stream of random numbers and a line that holds. It returns a line that is
false, or None where it cannot be sure of that; its docstring says why the line is false. One reason serves
most: a question has one answer, so what contradicts a true claim is false. The numbers of a forgery agree
with each other: a later root comes with its own place and velocity.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from decimal import Context, Decimal
from fractions import Fraction
from functools import cache, partial
from itertools import islice
from random import Random
from typing import Any

import msgspec

import reference
from conformance.cases.certify import arrival, marks, stays
from conformance.cases.prover import coasted, collided
from conformance.cases.prover import ends as exact_ends
from conformance.vectors import Certified, certified
from scene import State, from_data

from .falsifier import CORPUS, NUMBERS, Flight, Line, Number, negative, next_hits, numbers

REASONS = ("corner", "tangency", "sliding", "mouth-edge")
SIDES = ("left", "right", "floor")
WALLS = {"cap": ("arc", "base"), "stem": ("base", *SIDES), "mushroom": ("arc", "base", *SIDES)}
N_SAMPLES = 200
DECIMAL = Context(prec=60)
Forge = Callable[[Random, Line], Line | None]


@cache
def lines() -> list[Line]:
    """Return the corpus."""
    texts = [path.read_text("utf-8") for path in sorted(CORPUS.glob("*.jsonl"))]
    return [json.loads(line) for text in texts for line in text.splitlines()]


def plain(data: Any) -> Line:
    """Return a part of a line as JSON has it, which may be changed."""
    copy: Line = json.loads(msgspec.json.encode(data))
    return copy


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
    around = {}
    for names in (("dt",), ("x", "y"), ("vx", "vy")):
        found = {name: Fraction(*map(int, state[name].as_integer_ratio())) for name in names}
        spare = max(map(abs, found.values())) / 10**40
        around |= {name: (value - spare, value + spare) for name, value in found.items()}
    return plain(certified(around, [1.0] * 5, state["wall"]))


def claim(line: Line, outcome: str, *steps: Line, reason: str = "") -> Line:
    """Return a line with one other answer."""
    return {**line, "expect": [{"outcome": outcome, "steps": list(steps), "reason": reason}]}


def coast(line: Line, t_end: float) -> Line:
    """Claim that nothing is met before t_end."""
    flight = Flight(line["scene"], {**line["state"], "wall": None})
    step = written(flight.free(numbers().mpf(t_end) - flight.t))
    return claim({**line, "t_end": t_end}, "horizon", step)


def answered(line: Line, span: Number) -> Line:
    """Answer a question as the samples of a flight suggest, right or not."""
    flight = Flight(line["scene"], line["state"])
    hit = next(next_hits(flight, numbers().zero, span, N_SAMPLES), None)
    t_end = float(flight.t + span)
    return (
        claim({**line, "t_end": t_end}, "collision", written(flight.after(*hit)))
        if hit
        else coast(line, t_end)
    )


def opened(line: Line) -> tuple[Flight, Number]:
    """Return the flight of a line, and the time that its first step takes."""
    return Flight(line["scene"], line["state"]), numbers().mpf(line["expect"][0]["steps"][0]["dt"][1])


def instead(line: Line, flight: Flight, hit: tuple[str, Number] | None) -> Line | None:
    """Claim another hit, where the first answer contradicts that; t_end may move away from it."""
    if hit is None:
        return None
    step, true = written(flight.after(*hit)), [*line["expect"][0].get("steps", []), None][0]
    is_early = true and ends(step, "dt")[1] < ends(true, "dt")[0]
    is_false = is_early or not true or ("wall" in true and contradicts(step, true))
    t_end = max(line["t_end"], float(flight.t + 2 * hit[1]))
    return claim({**line, "t_end": t_end}, "collision", step) if is_false else None


def move(exponent: int, random: Random, line: Line) -> Line | None:
    """Move one number by widths, times a power of ten: what is claimed is disjoint from the truth."""
    forged = plain(line)
    step, name = random.choice(forged["expect"][0]["steps"]), random.choice(NUMBERS)
    true, (low, high) = ends(step, name), map(Decimal, step[name])
    width = max(DECIMAL.subtract(high, low), Decimal(1).scaleb(high.adjusted() - 23 if high else -30))
    shift = width * random.choice((-5, -3, -2, 2, 3, 5)) * 10**exponent
    step[name] = [str(DECIMAL.add(end, shift)) for end in (low, high)]
    return forged if true[0] > ends(step, name)[1] or ends(step, name)[0] > true[1] else None


def exchange_ends(random: Random, line: Line) -> Line | None:
    """Exchange the ends of an enclosure: no number is above the greater and below the lesser."""
    forged = plain(line)
    step, name = random.choice(forged["expect"][0]["steps"]), random.choice(NUMBERS)
    step[name].reverse()
    return forged if ends(step, name)[0] > ends(step, name)[1] else None


def meet_later(is_same: bool, random: Random, line: Line) -> Line | None:
    """Claim a root that comes after the proved hit, of the same wall or of another one."""
    flight, s = opened(line)
    true = line["expect"][0]["steps"][0]["wall"]
    others = tuple(wall for wall in WALLS[flight.table] if wall != true)
    end = s * (1.05 if line["group"] == "waiting" else 20)
    hits = next_hits(flight, s, end, N_SAMPLES, (true,) if is_same else others)
    return instead(line, flight, next(islice(hits, random.choice((0, 0, 1, 2)), None), None))


def rename_wall(random: Random, line: Line) -> Line | None:
    """Name another wall: where a hit is proved, no other wall is met."""
    forged = plain(line)
    step = random.choice(forged["expect"][0]["steps"])
    true, step["wall"] = step.get("wall"), random.choice(WALLS[line["scene"]["table"]])
    return forged if true not in (None, step["wall"]) else None


def miss(random: Random, line: Line) -> Line | None:
    """Claim that nothing is met before a t_end that is after the proved hit."""
    t, dt = line["state"]["t"], ends(line["expect"][0]["steps"][0], "dt")[1]
    t_end = random.choice((line["t_end"], float(t + dt * (1 + Fraction(1, 2 ** random.randint(1, 40))))))
    return coast(line, t_end) if t_end > Fraction(t) + dt else None


def meet_too_late(random: Random, line: Line) -> Line | None:
    """Move t_end before the proved hit, which is still claimed."""
    t, dt = line["state"]["t"], ends(line["expect"][0]["steps"][0], "dt")[0]
    t_end = float(t + dt * (1 - Fraction(1, 2 ** random.randint(1, 40))))
    return {**line, "t_end": t_end} if t <= t_end < Fraction(t) + dt else None


def fly_on(random: Random, line: Line) -> Line | None:
    """Move t_end to where f of a wall in reach has been negative: a sample shows it."""
    flight, s = opened(line)
    met = next(next_hits(flight, numbers().zero, 20 * s, N_SAMPLES), None)
    t_end = float(flight.t + met[1] * (1 + 2.0 ** -random.randint(1, 30))) if met else line["t_end"]
    return coast(line, t_end) if negative(flight, t_end - flight.t, N_SAMPLES) else None


def meet_at_once(_: Random, line: Line) -> Line | None:
    """Claim that the wall being left is hit at dt = 0: the proved hit comes later."""
    flight, _s = opened(line)
    return instead(line, flight, (flight.left, numbers().zero)) if flight.left else None


def keep_residual(_: Random, line: Line) -> Line | None:
    """Claim a root of f, and not of f - f(0), where the proved hit is of the wall being left."""
    flight, s = opened(line)
    flight.residual = numbers().zero
    return instead(line, flight, next(next_hits(flight, s / 2, s * 2, N_SAMPLES, (flight.left,)), None))


def pass_shut_mouth(_: Random, line: Line) -> Line | None:
    """Pass a mouth that is shut: the base is proved to be met, and a wall of the stem is claimed."""
    flight, s = opened(line)
    is_shut = line["expect"][0]["steps"][0].get("wall") == "base" and flight.crossing()
    return (
        instead(line, flight, next(next_hits(flight, s, 20 * s, N_SAMPLES, SIDES), None)) if is_shut else None
    )


def hit_open_mouth(_: Random, line: Line) -> Line | None:
    """Meet the base where the mouth is proved to be passed."""
    flight, s = opened(line)
    crossing = flight.crossing()
    return instead(line, flight, ("base", crossing)) if crossing and crossing < s else None


def ignore_knot(random: Random, line: Line) -> Line | None:
    """Answer for laws that go on as at departure, or lack a knot, where the truth contradicts that."""
    scene, s = plain(line["scene"]), opened(line)[1]
    laws = [law["knots"] for law in scene.values() if isinstance(law, dict) and len(law.get("knots", ())) > 2]
    is_blind = random.random() < 0.5 or not laws
    if not is_blind:
        knots = random.choice(laws)
        del knots[random.randrange(1, len(knots) - 1)]
    flight = Flight(scene, line["state"], is_blind=is_blind)
    return instead(line, flight, next(next_hits(flight, numbers().zero, 4 * s, N_SAMPLES), None))


def call_undefined(random: Random, line: Line) -> Line | None:
    """Call an answer undefined that is proved, or undefined for another reason than the proved one."""
    reason = random.choice(REASONS)
    return claim(line, "undefined", reason=reason) if reason != line["expect"][0].get("reason") else None


def break_tie(random: Random, line: Line) -> Line:
    """Answer a question that is proved to have no answer."""
    flight, mp = Flight(line["scene"], line["state"]), numbers()
    hits = [*islice(next_hits(flight, mp.zero, mp.mpf(10), N_SAMPLES, WALLS[flight.table]), 3), None]
    return instead(line, flight, random.choice(hits)) or coast(line, line["t_end"])


def leave_out_step(random: Random, line: Line) -> Line | None:
    """Leave out a step that the next one contradicts; the path may be asked for one collision less."""
    steps, answer = list(line["expect"][0]["steps"]), line["expect"][0]["outcome"]
    place = random.randrange(len(steps) - 1)
    is_false = contradicts(*steps[place : place + 2])
    del steps[place]
    asked = {**line, "collisions": random.randint(len(steps), len(steps) + 1)}
    return claim(asked, answer, *steps) if is_false else None


def exchange_steps(random: Random, line: Line) -> Line | None:
    """Exchange two steps that follow each other and contradict each other."""
    steps, answer = list(line["expect"][0]["steps"]), line["expect"][0]["outcome"]
    place = random.randrange(len(steps) - 1)
    one, other = steps[place : place + 2]
    steps[place : place + 2] = other, one
    return claim(line, answer, *steps) if contradicts(one, other) else None


def end_path(random: Random, line: Line) -> Line | None:
    """End a path at the horizon, or undefined, where a further hit is proved."""
    steps, mp = line["expect"][0]["steps"], numbers()
    kept = random.randrange(1, len(steps))
    t = line["state"]["t"] + sum(mp.mpf(step["dt"][0]) for step in steps[:kept])
    last = {name: steps[kept - 1][name][0] for name in NUMBERS}
    horizon = written(Flight(line["scene"], {**last, "t": t}).free(mp.mpf(line["t_end"]) - t))
    is_before = "wall" in steps[kept] and ends(horizon, "dt")[0] > ends(steps[kept], "dt")[1]
    undefined = claim(line, "undefined", *steps[:kept], reason=random.choice(REASONS))
    coasting = claim(line, "horizon", *steps[:kept], horizon)
    return random.choice((undefined, coasting)) if is_before else None


@cache
def flow_path(name: str) -> tuple[list[Certified], tuple[tuple[int, int], ...]]:
    """Return all steps of a flow of the corpus, the last to the horizon, and its capture intervals."""
    line = next(line for line in lines() if line["id"] == name)
    scene, state = from_data(line["scene"]), State(**line["state"])
    path = reference.trajectory(scene, state, line["collisions"], line["t_end"])
    assert isinstance(path.outcome, reference.Horizon)
    steps = [certified(collided(step), [1.0] * 5, step.wall) for step in path.steps]
    horizon = coasted(path.outcome, exact_ends(path.steps[-1].after.t))
    return [*steps, certified(horizon, [1.0] * 5, None)], stays(marks(scene, path.steps))


def change_stays(how: str, random: Random, line: Line) -> Line | None:
    """Move an end of a capture interval, drop one or add one: a path has one list of them."""
    steps, true = flow_path(line["id"])
    changed = list(true)
    begin, end = changed.pop(random.randrange(len(true))) if true else (0, 0)
    by = random.choice((-3, -2, -1, 1, 2, 3))
    if how == "add":
        changed = [*true, (random.randrange(len(steps)), random.randrange(len(steps)))]
    elif how == "move":
        changed.append(random.choice(((begin + by, end), (begin, end + by))))
    changed.sort()
    is_list = all(0 <= begin < end < len(steps) for begin, end in changed)
    if not is_list or changed == list(true):
        return None
    return {**line, "expect": [plain(arrival(steps, changed))]}


def miscount(random: Random, line: Line) -> Line | None:
    """Claim another number of steps of a flow's path."""
    count = line["collisions"] + random.choice((-10, -2, -1, 1, 2, 10))
    return {**line, "collisions": count} if count > 0 else None


def permit_refusal(is_only: bool, random: Random, line: Line) -> Line:
    """Permit a refusal, or nothing else, at level core, where an answer is proved and within reach."""
    refusal = {"outcome": random.choice(("rejected", "undecided"))}
    return {**line, "expect": [refusal] if is_only else [*line["expect"], refusal]}


def permit_falsehood(random: Random, line: Line) -> Line | None:
    """Permit a false answer beside the true one."""
    forge: Forge = random.choice((partial(move, 0), rename_wall, exchange_ends, call_undefined))
    forged = forge(random, line)
    both = [*line["expect"], *forged["expect"]] if forged else []
    return {**line, "expect": random.choice((both, both[::-1]))} if forged else None


def spoil(random: Random, line: Line) -> Line:
    """Give a field another type: what is left is no claim."""
    forged = plain(line)
    answer = forged["expect"][0]
    fields = [(forged, name) for name in ("kind", "scene", "state", "t_end", "expect", "collisions")]
    fields += [(answer, "outcome"), (answer, "steps"), (answer["steps"][0], random.choice(NUMBERS))]
    holder, name = random.choice(fields)
    holder[name] = random.choice((None, "wall", -1, [], {}, ["1"], [1, 2], [["1"], {}]))
    return forged
