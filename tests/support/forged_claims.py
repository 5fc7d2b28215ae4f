"""Forged claims: false lines of the corpus, which the verifier must not prove.

Each forgery is a function of a stream of random numbers and a line that holds. It returns a line that is
false, or None where it cannot be sure of that; its docstring says why the line is false. One reason serves
most: a question has one answer, so what contradicts a true claim is false. Later roots, wrong physics,
questions that must be refused and exchanged ends are forged elsewhere: by faulty references under attack, and
by weaker verifiers.
"""

import json
from collections.abc import Callable, Iterator
from decimal import Context, Decimal
from fractions import Fraction
from functools import cache, partial
from itertools import cycle, islice
from pathlib import Path
from random import Random
from types import ModuleType
from typing import Any

import msgspec

from conformance import verify
from conformance.vectors import NUMBERS, certified

REFUSALS = ("false", "not proved", "unreadable")
REASONS = ("corner", "tangency", "sliding", "mouth-edge")
DECIMAL = Context(prec=60)
CORPUS = Path(__file__).parents[2] / "conformance" / "corpus"
Line = dict[str, Any]
Forge = Callable[[Random, Line], Line | None]


@cache
def lines() -> list[Line]:
    """Return the corpus."""
    texts = [path.read_text("utf-8") for path in sorted(CORPUS.glob("*.jsonl"))]
    return [json.loads(line) for text in texts for line in text.splitlines()]


def plain(data: object) -> Line:
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


def claim(line: Line, outcome: str, *steps: Line, reason: str = "") -> Line:
    """Return a line with one other answer."""
    answer = {"outcome": outcome, "steps": list(steps)} | ({"reason": reason} if reason else {})
    return {**line, "expect": [answer]}


def coast(line: Line, t_end: float) -> Line:
    """Claim that nothing is met before t_end."""
    t, x, y, vx, vy = (Fraction(line["state"][name]) for name in ("t", *NUMBERS[1:]))
    dt = Fraction(t_end) - t
    there = {"dt": dt, "x": x + vx * dt, "y": y + vy * dt, "vx": vx, "vy": vy}
    step = certified({name: (value, value) for name, value in there.items()}, [1.0] * 5, None)
    return claim({**line, "t_end": t_end}, "horizon", plain(step))


def move(exponent: int, random: Random, line: Line) -> Line | None:
    """Move one number by widths, times a power of ten: what is claimed is disjoint from the truth."""
    forged = plain(line)
    step = random.choice(forged["expect"][0]["steps"])
    name = random.choice(NUMBERS)
    true = ends(step, name)
    low, high = map(Decimal, step[name])
    width = max(DECIMAL.subtract(high, low), Decimal(1).scaleb(high.adjusted() - 23 if high else -30))
    shift = width * random.choice((-5, -3, -2, 2, 3, 5)) * 10**exponent
    step[name] = [str(DECIMAL.add(end, shift)) for end in (low, high)]
    return forged if true[0] > ends(step, name)[1] or ends(step, name)[0] > true[1] else None


def rename_wall(random: Random, line: Line) -> Line | None:
    """Name another wall: where a hit is proved, no other wall is met."""
    forged = plain(line)
    step = random.choice(forged["expect"][0]["steps"])
    true = step.get("wall")
    step["wall"] = random.choice(verify.WALLS[line["scene"]["table"]])
    return forged if true not in (None, step["wall"]) else None


def miss(random: Random, line: Line) -> Line | None:
    """Claim that nothing is met before a t_end that is after the proved hit."""
    t = line["state"]["t"]
    dt = ends(line["expect"][0]["steps"][0], "dt")[1]
    t_end = random.choice((line["t_end"], float(t + dt * (1 + Fraction(1, 2 ** random.randint(1, 40))))))
    return coast(line, t_end) if t_end > Fraction(t) + dt else None


def meet_too_late(random: Random, line: Line) -> Line | None:
    """Move t_end before the proved hit, which is still claimed."""
    t = line["state"]["t"]
    dt = ends(line["expect"][0]["steps"][0], "dt")[0]
    t_end = float(t + dt * (1 - Fraction(1, 2 ** random.randint(1, 40))))
    return {**line, "t_end": t_end} if t <= t_end < Fraction(t) + dt else None


def call_undefined(random: Random, line: Line) -> Line | None:
    """Call an answer undefined that is proved, or undefined for another reason than the proved one."""
    reason = random.choice(REASONS)
    return claim(line, "undefined", reason=reason) if reason != line["expect"][0].get("reason") else None


def answer_all_the_same(_: Random, line: Line) -> Line:
    """Answer a question that is proved to have no answer, or to be bad input."""
    return coast(line, line["t_end"])


def reorder(how: str, random: Random, line: Line) -> Line | None:
    """Exchange two steps that contradict each other, leave the first of them out, or end the path there."""
    forged = plain(line)
    steps = forged["expect"][0]["steps"]
    answer = forged["expect"][0]
    place = random.randrange(len(steps) - 1)
    is_false = contradicts(*steps[place : place + 2])
    if how == "exchange":
        steps[place : place + 2] = steps[place : place + 2][::-1]
    elif how == "leave out":
        del steps[place]
        forged["collisions"] = random.randint(len(steps), len(steps) + 1)
    else:
        answer["outcome"] = random.choice(("horizon", "undefined", "collision"))
        del steps[place + 1 :]
    return forged if is_false else None


def change_stays(how: str, random: Random, line: Line) -> Line:
    """Move an end of a capture interval, drop one or add one: a path has one list of them."""
    forged = plain(line)
    stays = forged["expect"][0].setdefault("stays", [])
    if how == "add":
        stays.append([0, random.randint(1, 9)])
    elif how == "drop":
        del stays[random.randrange(len(stays))]
    else:
        random.choice(stays)[random.randrange(2)] += random.choice((-2, -1, 1, 2))
    return forged


def miscount(random: Random, line: Line) -> Line | None:
    """Claim another number of steps of a flow's path."""
    count = line["collisions"] + random.choice((-10, -2, -1, 1, 2, 10))
    return {**line, "collisions": count} if count > 0 else None


def spoil(random: Random, line: Line) -> Line:
    """Give a field another type: what is left is no claim."""
    forged = plain(line)
    answer = forged["expect"][0]
    fields = [(forged, name) for name in ("kind", "scene", "state", "t_end", "expect", "collisions")]
    fields += [(answer, "outcome"), (answer, "steps"), (answer["steps"][0], random.choice(NUMBERS))]
    holder, name = random.choice(fields)
    holder[name] = random.choice((None, "wall", -1, [], {}, ["1"], [1, 2], [["1"], {}]))
    return forged


UNKNOWN = ("t", "outcome", "captured", "stays", "Wall", "t_end", "dt ", "note", "reason ", "")


def add_field(where: str, random: Random, line: Line) -> Line:
    """Add a field that a line, an answer or a step does not have: a reader may take it for proved."""
    forged = plain(line)
    answer = forged["expect"][0]
    holder = {"line": forged, "answer": answer, "step": random.choice(answer["steps"])}[where]
    free = [name for name in UNKNOWN if name not in verify.FORMS[where]]
    holder[random.choice(free)] = random.choice((None, 0, ["7", "8"], "horizon", True))
    return forged


def negate(names: tuple[str, ...], random: Random, line: Line) -> Line | None:
    """Give numbers of a step the other sign: as before the bounce, or on the other side of the table."""
    forged = plain(line)
    step = random.choice(forged["expect"][0]["steps"])
    true = plain(step)
    for name in names:
        low, high = map(Decimal, step[name])
        step[name] = [str(-high), str(-low)]
    return forged if contradicts(step, true) else None


def exchange(one: str, other: str, random: Random, line: Line) -> Line | None:
    """Exchange two numbers of a step."""
    forged = plain(line)
    step = random.choice(forged["expect"][0]["steps"])
    true = plain(step)
    step[one], step[other] = step[other], step[one]
    return forged if contradicts(step, true) else None


def scale_speed(random: Random, line: Line) -> Line | None:
    """Multiply vx and vy by one factor."""
    forged = plain(line)
    step = random.choice(forged["expect"][0]["steps"])
    true = plain(step)
    factor = 1 + Decimal(random.choice((-3, 1, 2))).scaleb(-random.randint(1, 15))
    for name in ("vx", "vy"):
        step[name] = sorted((str(DECIMAL.multiply(Decimal(end), factor)) for end in step[name]), key=Decimal)
    return forged if contradicts(step, true) else None


def hide_wall(random: Random, line: Line) -> Line:
    """Leave out the wall of a hit: the step ends at the horizon then."""
    forged = plain(line)
    step = random.choice([step for step in forged["expect"][0]["steps"] if step.get("wall")])
    del step["wall"]
    return forged


def start_elsewhere(random: Random, line: Line) -> Line | None:
    """Move x or y of the start: where x(dt) = x + vx dt is the same, dt is not, and there is one dt."""
    forged = plain(line)
    name = random.choice(("x", "y"))
    moved = line["state"][name] * (1 + random.choice((-1, 1)) * 2.0 ** -random.randint(8, 40))
    forged["state"][name] = moved
    return forged if moved != line["state"][name] and line["state"].get("wall") is None else None


def resize(random: Random, line: Line) -> Line | None:
    """Change the radius of a cap at rest: the place of a hit of its arc does not lie on the new arc."""
    scene = line["scene"]
    wall = line["expect"][0]["steps"][0].get("wall")
    is_left = line["state"].get("wall") == "arc"  # its residual would move with the radius
    if not isinstance(scene.get("r"), float) or wall != "arc" or is_left:
        return None
    return {**line, "scene": {**scene, "r": scene["r"] * (1 + 2.0 ** -random.randint(8, 40))}}


def repeat_step(random: Random, line: Line) -> Line:
    """Repeat the last step of a path: no wall is met twice at one place and time with one velocity."""
    forged = plain(line)
    steps = forged["expect"][0]["steps"]
    steps.append(steps[-1])
    forged["collisions"] = max(forged["collisions"], len(steps))
    return forged


def answer_twice(_: Random, line: Line) -> Line:
    """Give the right answer as a further one, too: only "undecided" and "rejected" are further answers."""
    return {**line, "expect": [*line["expect"], line["expect"][0]]}


def refuse(_: Random, line: Line) -> Line:
    """Call a question bad that is answered."""
    return {**line, "expect": [{"outcome": "rejected"}]}


def cut_short(random: Random, line: Line) -> Line | None:
    """Leave out the end of a path of which all collisions were found, and still ask for all of them."""
    forged = plain(line)
    answer = forged["expect"][0]
    del answer["steps"][random.randrange(1, len(answer["steps"])) :]
    return forged if answer["outcome"] == "collision" else None


KINDS: dict[str, tuple[str, Forge]] = {
    "a number moved by widths": ("answered", partial(move, 0)),
    "a number moved by some 1e-15": ("answered", partial(move, 8)),
    "a number moved far": ("answered", partial(move, 22)),
    "another wall named": ("answered", rename_wall),
    "a hit missed": ("hit", miss),
    "a hit after t_end": ("hit", meet_too_late),
    "an answer called undefined": ("step", call_undefined),
    "undefined for another reason": ("undefined", call_undefined),
    "a tie broken": ("undefined", answer_all_the_same),
    "bad input answered": ("rejected", answer_all_the_same),
    "a step left out": ("trajectory", partial(reorder, "leave out")),
    "two steps exchanged": ("trajectory", partial(reorder, "exchange")),
    "a path ended early": ("trajectory", partial(reorder, "end")),
    "a capture interval moved": ("stays", partial(change_stays, "move")),
    "a capture interval dropped": ("stays", partial(change_stays, "drop")),
    "a capture interval added": ("flow", partial(change_stays, "add")),
    "steps of a flow miscounted": ("flow", miscount),
    "a field spoiled": ("answered", spoil),
    "a field added to a line": ("answered", partial(add_field, "line")),
    "a field added to an answer": ("answered", partial(add_field, "answer")),
    "a field added to a step": ("answered", partial(add_field, "step")),
    "a velocity not reflected": ("hit", partial(negate, ("vx", "vy"))),
    "a place mirrored": ("answered", partial(negate, ("x", "vx"))),
    "x and y exchanged": ("answered", partial(exchange, "x", "y")),
    "vx and vy exchanged": ("answered", partial(exchange, "vx", "vy")),
    "a speed multiplied": ("answered", scale_speed),
    "a wall hidden": ("hit", hide_wall),
    "another start": ("hit", start_elsewhere),
    "another radius": ("hit", resize),
    "a step repeated": ("trajectory", repeat_step),
    "an answer twice": ("answered", answer_twice),
    "an answer called bad": ("hit", refuse),
    "a path cut short": ("trajectory", cut_short),
}
POOLS: dict[str, Callable[[Line, Line], object]] = {
    "answered": lambda line, answer: answer.get("steps"),
    "step": lambda line, answer: line["kind"] == "step" and answer.get("steps"),
    "hit": lambda line, answer: line["kind"] == "step" and answer["outcome"] == "collision",
    "trajectory": lambda line, answer: line["kind"] == "trajectory" and len(answer["steps"]) > 1,
    "flow": lambda line, answer: line["kind"] == "flow" and 1 < line.get("collisions", 1) < 60,
    "stays": lambda line, answer: POOLS["flow"](line, answer) and answer.get("stays"),
    "undefined": lambda line, answer: answer["outcome"] == "undefined",
    "rejected": lambda line, answer: (
        answer["outcome"] == "rejected" and line["scene"].get("table") in verify.WALLS
    ),
}


@cache
def pool(name: str) -> list[Line]:
    """Return the lines of the corpus that some kinds of forgery begin with."""
    return [line for line in lines() if POOLS[name](line, line["expect"][0])]


def draw(n: int, seed: int) -> Iterator[tuple[str, Line]]:
    """Yield n forgeries with their kinds, of each kind in turn."""
    random = Random(seed)
    for kind, (name, forge) in islice(cycle(KINDS.items()), n):
        tries = (forge(random, random.choice(pool(name))) for _ in iter(int, 1))
        yield kind, next(filter(None, tries))


def judge(line: Line, verifier: ModuleType = verify) -> str:
    """Return a verifier's word on a line, "unreadable" and other errors included."""
    try:
        return str(verifier.verify_line(line).status)
    except verifier.Unreadable:
        return "unreadable"
    except Exception as error:
        return f"{type(error).__name__}: {error}"
