"""Faults of what is read, kept and refused, for the table of `support.faults`."""

import math
import re
from collections.abc import Callable
from typing import Any

import msgspec
from mpmath import fp

from conformance.suite.process import CheckFailure
from scene import Mushroom, from_data
from scene.geometry import TableAt, rounded as table_of
from scene.laws import GivenLaw, law_of
from support.faulty_steppers import (
    FLOW,
    NUMBERS,
    PATH,
    STEP,
    Answer,
    Fault,
    Line,
    asked,
    faulty,
    parts,
    placed,
    starts,
)

Excuse = Callable[[TableAt, Line, str], bool]  # (table, state, why it was rejected)
AWAY = re.compile(r"the state is (\S+) of that wall's size away")
WORDS = ("table", "name", "notes")  # of a scene: what is no law
BEYOND = re.compile(r"beyond wall (\w+)")


# Lines and texts.


def at_bad_lines(act: Callable[[], Line]) -> Fault:
    """Do something else than to refuse what is no request."""
    return lambda request, answer: answer(request) if "cmd" in request else act()


def crash() -> Line:
    """Die."""
    raise CheckFailure("crashed", "exited with status 1 before it answered")


def wrong_after_bad_lines(request: Line, answer: Answer, *, upset: list[Line]) -> Line:
    """Be upset for ever by a bad line."""
    found = answer(request)
    if "cmd" not in request:
        upset.append(request)
    elif upset and "vx" in found:
        found["vx"] *= 1 + 1e-12
    return found


def refusing_lines(is_refused: Callable[[bytes], bool]) -> Callable[[bytes], bytes]:
    """Refuse some lines that are sound."""
    answer = faulty(lambda request, own: own(request))
    refusal = b'{"seq":null,"outcome":"rejected","reason":"cannot read that"}'
    return lambda line: refusal if b'"cmd"' in line and is_refused(line) else answer(line)


def take_hints(request: Line, answer: Answer) -> Line:
    """Make something of a field that it does not know."""
    hints = [place.pop("hint", 0.0) for place in (request, *starts(request))]
    found = answer(request)
    for part in parts(found) if any(hints) else ():
        if "x" in part:
            part["x"] += 7.0
    return found


def as_fortran_reads(request: Line) -> None:
    """Take a number without a point for one with six decimals."""
    for state in starts(request):
        state |= {name: state[name] / 10**6 for name in NUMBERS if type(state.get(name)) is int}


def minus_is_below(request: Line) -> None:
    """Take y = -0.0 for a place in the stem, under a base that is closed."""
    for state in starts(request):
        if state.get("y") == 0 and math.copysign(1.0, state["y"]) < 0:
            state |= {"y": -(2.0**-30), "wall": None}


def nameless(request: Line, answer: Answer) -> Line:
    """Name no walls, and keep no flight times: no fault."""
    found = answer(request)
    for part in (found, *found.get("steps", ())):
        part.pop("dt", None)
        part.pop("wall", None)
    return found


def offering(request: Line, answer: Answer, *, profile: str) -> Line:
    """Offer one profile only: no fault."""
    return {**answer(request), **({"profiles": [profile]} if request.get("cmd") == "start" else {})}


# Caches, and what they forget.


def last_bit_varies(_: Line, found: Line, *, numbers: Any) -> None:
    """Answer with a last bit that depends on how often one was asked, as sums in threads may: no fault."""
    is_varied = next(numbers) % 3 == 0
    for part in parts(found):
        if "vx" in part and is_varied:
            part["vx"] = math.nextafter(part["vx"], math.inf)


def answer_by(request: Line, found: Line, *, key: Callable[[Line], Any], book: dict[str, Line]) -> Line:
    """Keep every answer, by a key of the request."""
    return {**book.setdefault(repr(key(request)), found), "seq": request["seq"]}


def rounded(digits: int) -> Callable[[Any], Any]:
    """Return what rounds all numbers of a request."""

    def key(part: Any) -> Any:
        if isinstance(part, dict):
            return {name: key(value) for name, value in part.items() if name != "seq"}
        return float(f"{part:.{digits}g}") if isinstance(part, float) else part

    return key


def without_wall(request: Line) -> Any:
    """Leave the wall out."""
    return [request["scene"], {**request["state"], "wall": 0}, request["t_end"]]


def scene_by(request: Line, *, key: Callable[[Line], Any], book: dict[str, Line]) -> None:
    """Keep scenes by a key, and answer with the first scene of the same key."""
    request["scene"] = book.setdefault(repr(key(request["scene"])), request["scene"])


def by_laws(key: Callable[[Any], Any], *, are_named: bool = True) -> Callable[[Line], Any]:
    """Return a key of scenes: the keys of their laws."""
    return lambda scene: sorted([name if are_named else "", repr(key(law))] for name, law in scene.items())


def first_parts(law: Any) -> Any:
    """Look at the first harmonic, and at the first and the last knot."""
    if not isinstance(law, dict):
        return law
    if law.get("kind") == "fourier":
        return {name: part[:1] if isinstance(part, list) else part for name, part in law.items()}
    return [len(law["knots"]), law["knots"][0], law["knots"][-1]]


def without(*fields: str) -> Callable[[Any], Any]:
    """Leave fields of a law or a scene out."""
    return lambda law: {k: v for k, v in law.items() if k not in fields} if isinstance(law, dict) else law


def values_alone(law: Any) -> Any:
    """Leave out when the knots are."""
    return [value for _, value in law["knots"]] if isinstance(law, dict) and "knots" in law else law


# Refusals that are missing, and some too many.


def letting(is_let: Callable[..., bool], *cmds: str, **sizes: Any) -> Fault:
    """Let states that are rejected fly straight on: (request, state, why); of some commands or of all."""

    def fault(request: Line, answer: Answer) -> Line:
        found, cmd = answer(request), request.get("cmd")
        if cmd not in (cmds or (STEP, PATH, FLOW)):
            return found
        there = starts(request)
        told = found.get("states", [found] * len(there))  # a whole refusal is of each
        changed = [
            straight(request, state)
            if part.get("outcome") == "rejected" and is_let(request, state, part["reason"], **sizes)
            else part
            for state, part in zip(there, told, strict=True)
        ]
        more = changed[0] if cmd == STEP else {"states" if cmd == FLOW else "steps": changed}
        return found if changed == told else {"seq": found["seq"], **more}

    return fault


def straight(request: Line, state: Line) -> Line:
    """Fly straight to t_end."""
    t_end = request["t_end"]
    return {**state, **placed(state, t_end - state["t"]), "outcome": "horizon", "t": t_end}


def excused(excuse: Excuse, *cmds: str) -> Fault:
    """Let states through that an excuse is found for."""

    def is_let(request: Line, state: Line, why: str) -> bool:
        table = table_of(from_data(request["scene"]), state["t"])
        return state["t"] <= request["t_end"] and excuse(table, state, why)

    return letting(is_let, *cmds)


def unchecked(is_when: Callable[[float, float], bool], cmd: str) -> Fault:
    """Let all states through whose time stands in some relation to t_end."""
    return letting(lambda request, state, _: is_when(state["t"], request["t_end"]), cmd)


def loose(tolerance: float) -> Excuse:
    """Take a place to be on its wall up to another part of its size."""
    return lambda _, __, why: bool(away := AWAY.search(why)) and abs(float(away[1])) < tolerance


def near_by(part: float, *walls: str) -> Excuse:
    """Let states through that lie beyond some walls by less than a part of the table's size."""

    def excuse(table: TableAt, state: Line, why: str) -> bool:
        beyond = BEYOND.search(why)
        if beyond is None or (walls and beyond[1] not in walls):
            return False
        size = 2 * table.r if beyond[1] == "arc" else 1.0
        return bool(abs(table.gap(beyond[1], state["x"], state["y"])) < part * size)

    return excuse


def slower(part: float) -> Excuse:
    """Let states move into their wall by less than a part of their speed."""

    def excuse(table: TableAt, state: Line, why: str) -> bool:
        x, y, vx, vy = (state[name] for name in NUMBERS[1:])
        fast = math.hypot(vx, vy) * (2 * table.r if state["wall"] == "arc" else 1.0)
        return "moves into it" in why and -table.gap_rate(state["wall"], x, y, vx, vy) < part * fast

    return excuse


def inward(state: Line) -> float:
    """Return how fast a particle goes towards the centre, times how far it is."""
    return float(-state["x"] * state["vx"] - state["y"] * state["vy"])


def fleeing(_: TableAt, state: Line, why: str) -> bool:
    """Ask for the particle's velocity alone, whatever the arc's."""
    return "moves into it" in why and state["wall"] == "arc" and inward(state) > 0


def on_a_longer(*walls: str) -> Excuse:
    """Let some walls go on beyond y = 0."""
    return lambda _, state, __: state["wall"] in walls and (state["y"] < 0) == (state["wall"] == "arc")


def in_a(table: str, excuse: Excuse) -> Excuse:
    """Find an excuse in one table only."""
    return lambda at, state, why: at.scene.__struct_config__.tag == table and excuse(at, state, why)


def in_the_mouth(table: TableAt, state: Line) -> bool:
    """Tell whether a state names the base in the open mouth."""
    return isinstance(table.scene, Mushroom) and abs(state["x"]) < table.w and state["wall"] == "base"


def refusing(is_refused: Callable[[Line], bool], *cmds: str) -> Fault:
    """Refuse sound questions where something holds."""

    def fault(request: Line, answer: Answer) -> Line:
        found = answer(request)
        is_sound = request.get("cmd") in (cmds or (STEP, PATH, FLOW)) and "rejected" not in str(found)
        if is_sound and is_refused(request):
            return {"seq": request["seq"], "outcome": "rejected", "reason": "it is not on its wall"}
        return found

    return fault


def refusing_starts(is_refused: Callable[[TableAt, Line], bool], cmd: str = STEP) -> Fault:
    """Refuse states that name a wall, and where something holds."""

    def is_bad(request: Line) -> bool:
        state = request["state"]
        table = table_of(from_data(request["scene"]), state["t"])
        return bool(state.get("wall")) and is_refused(table, state)

    return refusing(is_bad, cmd)


def strictly_off(wall: str) -> Callable[[TableAt, Line], bool]:
    """Allow a place off a wall rounding alone."""

    def is_refused(table: TableAt, state: Line) -> bool:
        off = abs(table.gap(state["wall"], state["x"], state["y"]))
        return state["wall"] == wall and bool(off > 1e-9 * table.size * max(1.0, table.size))

    return is_refused


def leaving_slowly(_: TableAt, state: Line) -> bool:
    """Tell whether a state leaves the arc at rest by less than a hundredth of its speed."""
    return state["wall"] == "arc" and 0 < inward(state) < 0.01 * math.hypot(state["vx"], state["vy"])


def scenes_refused_for(word: str) -> Fault:
    """Let scenes through that are refused for some reason, by a word of it."""
    return letting(lambda _, __, why: word in why)


def passes_samples(request: Line, _: Line, why: str, *, n: int) -> bool:
    """Look at n instants of a period alone."""
    data = request["scene"]
    try:
        laws = {k: msgspec.convert(v, GivenLaw) for k, v in data.items() if k not in WORDS}
        for i in range(n):
            now = {name: float(law_of(law).value(fp, i / n)) for name, law in laws.items()}
            from_data({"table": data["table"], **now})
    except (ValueError, AttributeError):
        return False
    return why.startswith("scene")


def wide_by_ranges(request: Line) -> bool:
    """Compare the widest mouth with the smallest cap."""
    scene = from_data(request["scene"])
    w = getattr(scene, "w", None)
    return (
        isinstance(scene, Mushroom)
        and w is not None
        and law_of(w).bounds().highest > scene.laws["r"].bounds().lowest
    )


# Lax reading.


def everywhere(change: Callable[[Any], Any]) -> Fault:
    """Change every value of a question before it is read."""

    def changed(part: Any) -> Any:
        if isinstance(part, dict):
            kept = ("cmd", "table", "kind", "wall", "seq")
            return {name: value if name in kept else changed(value) for name, value in part.items()}
        return [changed(value) for value in part] if isinstance(part, list) else change(part)

    return asked(lambda request: request.update(changed(request)))


def number_of(text: Any) -> Any:
    """Take a text for the number that it may be."""
    return float(text) if isinstance(text, str) and re.fullmatch(r"\d+\.\d+", text) else text


def filled_in(request: Line, *, name: str, value: Any) -> None:
    """Take a field of a state that is missing for some value."""
    for state in starts(request):
        state.setdefault(name, value)


def unknown_wall(request: Line) -> None:
    """Take a wall that is unknown for null."""
    for state in starts(request):
        if state.get("wall") not in ("arc", "base", "left", "right", "floor"):
            state["wall"] = None


def whole(request: Line) -> None:
    """Round the number of collisions, and take one below 0 for 0."""
    if isinstance(request.get("collisions"), int | float):
        request["collisions"] = max(0, int(request["collisions"]))


def one_of_two(request: Line) -> None:
    """Overlook `period` where `omega` is given."""
    for law in request["scene"].values():
        if isinstance(law, dict) and "omega" in law:
            law.pop("period", None)


def nearly_one_period(request: Line, _: Line, why: str) -> bool:
    """Take periods for the same that are equal to 9 digits."""
    laws = [law for law in request["scene"].values() if isinstance(law, dict)]
    if "share one period" not in why:
        return False
    periods = [law.get("period") or law["knots"][-1][0] - law["knots"][0][0] for law in laws]
    return bool(max(periods) < (1 + 1e-9) * min(periods))
