"""Faults of what is refused, let through or read laxly, for the table of `support.faults`."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

import msgspec
from mpmath import fp

from scene import Mushroom, from_data
from scene.geometry import TableAt
from scene.geometry import rounded as table_of
from scene.laws import Law, bounds, value
from support.faulty_servers import (
    FLOW,
    NUMBERS,
    PATH,
    STEP,
    Answer,
    Fault,
    Line,
    asked,
    starts,
)

Excuse = Callable[[TableAt, Line, str], bool]  # (table, state, why it was rejected)
AWAY = re.compile(r"the state is (\S+) of that wall's size away")
WORDS = ("table", "name", "notes")  # of a scene: what is no law
BEYOND = re.compile(r"beyond wall (\w+)")

# Refusals that are missing, and some too many.


def straight(request: Line, state: Line) -> Line:
    """Fly straight to t_end."""
    dt = request["t_end"] - state["t"]
    place = {name: state[name] + state["v" + name] * dt for name in ("x", "y")}
    return {"outcome": "horizon", "t": request["t_end"], **place, "vx": state["vx"], "vy": state["vy"]}


def letting(is_let: Callable[[Line, Line, str], bool], *cmds: str) -> Fault:
    """Let states through that are rejected: (request, state, why); of some commands or of all."""

    def fault(request: Line, answer: Answer) -> Line:
        found, cmd = answer(request), request.get("cmd")
        there = starts(request)
        if cmd not in (cmds or (STEP, PATH, FLOW)):
            return found
        told = found["states"] if "states" in found else [found] * len(there)  # a whole refusal is of each
        changed = [
            straight(request, state)
            if part.get("outcome") == "rejected" and is_let(request, state, part["reason"])
            else part
            for state, part in zip(there, told, strict=True)
        ]
        if changed == told:
            return found
        more = changed[0] if cmd == STEP else {"states" if cmd == FLOW else "steps": changed}
        return {"seq": found["seq"], **more}

    return fault


def excused(excuse: Excuse, *cmds: str) -> Fault:
    """Let states through that an excuse is found for."""

    def is_let(request: Line, state: Line, why: str) -> bool:
        if not is_sound(request) or state["t"] > request["t_end"]:
            return False
        return excuse(table_of(from_data(request["scene"]), state["t"]), state, why)

    return letting(is_let, *cmds)


def unchecked(is_when: Callable[[float, float], bool], cmd: str) -> Fault:
    """Let all states through whose time stands in some relation to t_end."""
    return letting(lambda asked, at, _: is_sound(asked) and is_when(at["t"], asked["t_end"]), cmd)


def is_sound(request: Line) -> bool:
    """Tell whether a request has numbers and a scene that can be read."""
    try:
        from_data(request["scene"])
    except (KeyError, ValueError):
        return False
    return bool(starts(request)) and all(
        type(s.get(name)) is float for s in starts(request) for name in NUMBERS
    )


def loose(tolerance: float) -> Excuse:
    """Take a place to be on its wall up to another part of its size."""
    return lambda _, __, why: bool(away := AWAY.search(why)) and abs(float(away[1])) < tolerance


def gap(table: TableAt, wall: Any, state: Line) -> float:
    """Return how far a state is from a wall."""
    found = abs(table.gap(wall, state["x"], state["y"]))
    return float(found / (2 * table.r if wall == "arc" else 1.0))


def near_by(part: float, *walls: str) -> Excuse:
    """Let states through that lie beyond some walls by less than a part of the table's size."""

    def excuse(table: TableAt, state: Line, why: str) -> bool:
        beyond = BEYOND.search(why)
        is_meant = beyond is not None and (not walls or beyond[1] in walls)
        return is_meant and gap(table, beyond[1], state) < part

    return excuse


def slower(part: float) -> Excuse:
    """Let states move into their wall by less than a part of their speed."""

    def excuse(table: TableAt, state: Line, why: str) -> bool:
        x, y, vx, vy = (state[name] for name in NUMBERS[1:])
        steep = 2 * table.r if state["wall"] == "arc" else 1.0
        is_into = "moves into it" in why
        return is_into and bool(
            -table.gap_rate(state["wall"], x, y, vx, vy) < part * steep * math.hypot(vx, vy)
        )

    return excuse


def fleeing(_: TableAt, state: Line, why: str) -> bool:
    """Ask for the particle's velocity alone, whatever the arc's."""
    inwards = -state["x"] * state["vx"] - state["y"] * state["vy"]
    return "moves into it" in why and state["wall"] == "arc" and inwards > 0


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
        is_asked = request.get("cmd") in (cmds or (STEP, PATH, FLOW)) and is_sound(request)
        if is_asked and "rejected" not in str(found) and is_refused(request):
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
    inwards = -state["x"] * state["vx"] - state["y"] * state["vy"]
    return state["wall"] == "arc" and 0 < inwards < 0.01 * math.hypot(state["vx"], state["vy"])


def scenes_refused_for(*words: str) -> Fault:
    """Let scenes through that are refused for some reason, by words of it."""
    return letting(lambda _, __, why: any(word in why for word in words))


def passes_samples(n: int) -> Callable[[Line, Line, str], bool]:
    """Look at n instants of a period alone."""

    def is_let(request: Line, _: Line, why: str) -> bool:
        if not why.startswith("scene"):
            return False
        try:
            laws = {k: msgspec.convert(v, Law) for k, v in request["scene"].items() if k not in WORDS}
            for i in range(n):
                now = {name: float(value(fp, law, i / n)) for name, law in laws.items()}
                from_data({"table": request["scene"]["table"], **now})
        except (ValueError, AttributeError):
            return False
        return True

    return is_let


def wide_by_ranges(request: Line) -> bool:
    """Compare the widest mouth with the smallest cap."""
    scene = from_data(request["scene"])
    w = getattr(scene, "w", None)
    return isinstance(scene, Mushroom) and w is not None and bounds(w).highest > bounds(scene.r).lowest


# Lax reading.


def everywhere(change: Callable[[Any], Any]) -> Fault:
    """Change every value of a question before it is read."""

    def changed(part: Any) -> Any:
        if isinstance(part, dict):
            return {
                name: value if name in ("cmd", "table", "kind", "wall") else changed(value)
                for name, value in part.items()
            }
        return [changed(value) for value in part] if isinstance(part, list) else change(part)

    return asked(lambda request: request.update(changed({k: v for k, v in request.items() if k != "seq"})))


def number_of(text: Any) -> Any:
    """Take a text for the number that it may be."""
    return float(text) if isinstance(text, str) and re.fullmatch(r"\d+\.\d+", text) else text


def absent_as_zero(*names: str) -> Fault:
    """Take a field of a state that is missing for 0."""
    return asked(lambda request: [state.setdefault(name, 0.0) for state in starts(request) for name in names])


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
    if "share one period" not in why:
        return False
    laws = [law for law in request["scene"].values() if isinstance(law, dict)]
    periods = [law.get("period") or law["knots"][-1][0] - law["knots"][0][0] for law in laws]
    return bool(max(periods) < (1 + 1e-9) * min(periods))
