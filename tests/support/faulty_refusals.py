"""Faults of what is refused, let through or read laxly, for the table of `support.faults`."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

from mpmath import fp

from scene import BadInput, BangBang, Fourier, Mushroom, Scene, from_data
from scene.geometry import TableAt
from scene.geometry import rounded as table_of
from scene.laws import bounds, value
from support.faulty_servers import (
    FLOW,
    NUMBERS,
    PATH,
    STEP,
    Answer,
    Change,
    Fault,
    Line,
    asked,
    parts,
    starts,
)

Excuse = Callable[[TableAt, Line, str], bool]  # (table, state, why it was rejected)
AWAY = re.compile(r"the state is (\S+) of that wall's size away")
BEYOND = re.compile(r"beyond wall (\w+)")

# Refusals that are missing, and some too many.


def straight(request: Line, state: Line) -> Line:
    """Fly straight to t_end."""
    dt = request["t_end"] - state["t"]
    place = {name: state[name] + state["v" + name] * dt for name in ("x", "y")}
    return {"outcome": "horizon", "t": request["t_end"], **place, "vx": state["vx"], "vy": state["vy"]}


def letting(excuse: Excuse, *cmds: str) -> Fault:
    """Let states through that an excuse is found for, in some commands; in all when none is named."""

    def mended(request: Line, state: Line, part: Line) -> Line:
        if part.get("outcome") != "rejected" or state["t"] > request["t_end"]:
            return part
        table = table_of(from_data(request["scene"]), state["t"])
        return straight(request, state) if excuse(table, state, part["reason"]) else part

    def fault(request: Line, answer: Answer) -> Line:
        found, cmd = answer(request), request.get("cmd")
        there = starts(request)
        if cmd not in (cmds or (STEP, PATH, FLOW)) or not is_sound(request):
            return found
        changed = [mended(request, *pair) for pair in zip(there, parts(found), strict=False)]
        if changed == parts(found)[: len(changed)]:
            return found
        seq = {"seq": found["seq"]}
        return (
            {**seq, **changed[0]} if cmd == STEP else {**seq, "states" if cmd == FLOW else "steps": changed}
        )

    return fault


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


def near_by(part: float, *walls: str) -> Excuse:
    """Let states through that lie beyond some walls by less than a part of the table's size."""

    def excuse(table: TableAt, state: Line, why: str) -> bool:
        beyond = BEYOND.search(why)
        if not beyond or (walls and beyond[1] not in walls):
            return False
        gap = abs(table.gap(beyond[1], state["x"], state["y"]))  # type: ignore[arg-type]
        return bool(gap < part * (2 * table.r if beyond[1] == "arc" else 1.0))

    return excuse


def slower(part: float) -> Excuse:
    """Let states move into their wall by less than a part of their speed."""

    def excuse(table: TableAt, state: Line, why: str) -> bool:
        if "moves into it" not in why:
            return False
        rate = table.gap_rate(state["wall"], *(state[name] for name in ("x", "y", "vx", "vy")))
        steep = 2 * table.r if state["wall"] == "arc" else 1.0
        return bool(-rate < part * steep * math.hypot(state["vx"], state["vy"]))

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


def arrived(which: Callable[[float, float], bool]) -> Change:
    """Let particles have arrived whose time stands in some relation to t_end."""

    def change(request: Line, found: Line) -> Line:
        there = [
            {**straight({"t_end": state["t"]}, state), "t": request["t_end"]}
            if which(state["t"], request["t_end"])
            else part
            for state, part in zip(request["states"], found["states"], strict=True)
        ]
        return {**found, "states": there}

    return change


def at_once(request: Line, answer: Answer) -> Line:
    """Answer a step that lasts no time before any check."""
    found = answer(request)
    is_step = request.get("cmd") == STEP and is_sound(request) and found["outcome"] == "rejected"
    if not is_step or request["state"]["t"] != request.get("t_end"):
        return found
    return {"seq": found["seq"], **straight(request, request["state"])}


def refusing(is_refused: Callable[[TableAt, Line], bool], cmd: str = STEP) -> Fault:
    """Refuse states that name a wall, and where something holds."""

    def fault(request: Line, answer: Answer) -> Line:
        found = answer(request)
        if request.get("cmd") != cmd or not is_sound(request) or "rejected" in str(found):
            return found
        table, state = table_of(from_data(request["scene"]), request["state"]["t"]), request["state"]
        if not state.get("wall") or not is_refused(table, state):
            return found
        return {"seq": request["seq"], "outcome": "rejected", "reason": "it is not on its wall"}

    return fault


def strictly_off(*walls: str) -> Callable[[TableAt, Line], bool]:
    """Allow a place off some walls rounding alone."""

    def is_refused(table: TableAt, state: Line) -> bool:
        gap = abs(table.gap(state["wall"], state["x"], state["y"]))
        return state["wall"] in walls and bool(gap > 1e-9 * table.size * max(1.0, table.size))

    return is_refused


def leaving_slowly(_: TableAt, state: Line) -> bool:
    """Tell whether a state leaves the arc at rest by less than a hundredth of its speed."""
    inwards = -state["x"] * state["vx"] - state["y"] * state["vy"]
    return state["wall"] == "arc" and 0 < inwards < 0.01 * math.hypot(state["vx"], state["vy"])


def scenes_refused_for(*words: str) -> Fault:
    """Let scenes through that are refused for some reason, by words of it."""
    return scenes_let(lambda request, why: any(word in why for word in words))


def scenes_let(is_let: Callable[[Line, str], bool]) -> Fault:
    """Let some broken scenes through."""

    def fault(request: Line, answer: Answer) -> Line:
        found = answer(request)
        if request.get("cmd") not in (STEP, PATH, FLOW) or not is_let(request, found.get("reason", "")):
            return found
        there = [straight(request, state) for state in starts(request)]
        seq, cmd = {"seq": found["seq"]}, request["cmd"]
        return {**seq, **there[0]} if cmd == STEP else {**seq, "states" if cmd == FLOW else "steps": there}

    return fault


def passes_samples(n: int) -> Callable[[Line, str], bool]:
    """Look at n instants of a period alone."""

    def is_let(request: Line, why: str) -> bool:
        data = request.get("scene")
        if not why.startswith("scene") or not isinstance(data, dict):
            return False
        try:
            laws = {name: _law(part) for name, part in data.items() if name not in ("table", "name", "notes")}
            return all(_is_valid({k: value(fp, law, i / n) for k, law in laws.items()}) for i in range(n))
        except (BadInput, KeyError, TypeError, AttributeError):
            return False

    return is_let


def _law(data: Any) -> Any:
    if not isinstance(data, dict):
        return float(data)
    given = {
        name: tuple(map(tuple, part)) if name == "knots" else part
        for name, part in data.items()
        if name != "kind"
    }
    return BangBang(**given) if data["kind"] == "bang-bang" else Fourier(**given)


def _is_valid(now: dict[str, float]) -> bool:
    w = now.get("w", now.get("nu", 1.0) * now.get("r", 1.0))
    is_apart = w > now.get("h", 1.0) * now.get("slope", 0.0)
    return min(now.get("r", 1.0), now.get("h", 1.0), w) > 0 and w <= now.get("r", math.inf) and is_apart


def wide_by_ranges(scene: Scene) -> bool:
    """Compare the widest mouth with the smallest cap."""
    w = getattr(scene, "w", None)
    return isinstance(scene, Mushroom) and w is not None and bounds(w).highest > bounds(scene.r).lowest


def narrower(is_refused: Callable[[Scene], bool]) -> Fault:
    """Refuse some valid scenes."""

    def fault(request: Line, answer: Answer) -> Line:
        found = answer(request)
        if "reason" in found or "scene" not in request or not is_refused(from_data(request["scene"])):
            return found
        return {"seq": request["seq"], "outcome": "rejected", "reason": "the scene may break"}

    return fault


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


def nearly_one_period(request: Line, why: str) -> bool:
    """Take periods for the same that are equal to 9 digits."""
    if "share one period" not in why:
        return False
    laws = [law for law in request["scene"].values() if isinstance(law, dict)]
    periods = [law.get("period") or law["knots"][-1][0] - law["knots"][0][0] for law in laws]
    return bool(max(periods) < (1 + 1e-9) * min(periods))
