"""Implementations that let bad states or scenes through, or refuse good ones.

Each breaks `bad-states`, `bad-scenes` or `minus-zero`, and as in `support.promise_breakers` is right beside
that. What it lets through flies straight to t_end.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable

from scene import Mushroom, Scene, from_data
from scene.geometry import TableAt, rounded
from scene.laws import bounds
from support.promise_breakers import Fault, Line, honest, on

Excuse = Callable[[TableAt, Line, str], bool]  # (table, state, why it was rejected)
AWAY = re.compile(r"the state is (\S+) of that wall's size away")
BEYOND = re.compile(r"beyond wall (\w+)")


def letting(excuse: Excuse, *cmds: str) -> Fault:
    """Let states through that an excuse is found for, in some commands; in all when none is named."""

    def mended(request: Line, state: Line, answer: Line) -> Line:
        if answer.get("outcome") != "rejected" or state["t"] > request["t_end"]:
            return answer
        table = rounded(from_data(request["scene"]), state["t"])
        return straight(request, state) if excuse(table, state, answer["reason"]) else answer

    def fault(request: Line, answer: Callable[[Line], Line]) -> Line:
        found, cmd = answer(request), request.get("cmd")
        if cmd not in (cmds or ("step", "trajectory", "flow")):
            return found
        if cmd == "flow":
            pairs = zip(request["states"], found["states"], strict=True)
            return {**found, "states": [mended(request, *pair) for pair in pairs]}
        if "outcome" in found and isinstance(request.get("state"), dict) and "vy" in request["state"]:
            there = mended(request, request["state"], found)
            return there if cmd == "step" or there is found else {"seq": found["seq"], "steps": [there]}
        return found

    return fault


def straight(request: Line, state: Line) -> Line:
    """Fly straight to t_end."""
    dt = request["t_end"] - state["t"]
    place = {"x": state["x"] + state["vx"] * dt, "y": state["y"] + state["vy"] * dt}
    found = {"outcome": "horizon", "t": request["t_end"], **place, "vx": state["vx"], "vy": state["vy"]}
    return {**found, "seq": request["seq"]} if request["cmd"] == "step" else found


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


def named_beyond(_: TableAt, state: Line, why: str) -> bool:
    """Look at no other wall where one is named."""
    return state["wall"] is not None and "beyond wall" in why


def on_a_longer(*walls: str) -> Excuse:
    """Let some walls go on beyond y = 0."""

    def excuse(_: TableAt, state: Line, __: str) -> bool:
        return state["wall"] in walls and (state["y"] < 0) == (state["wall"] == "arc") and state["y"] != 0

    return excuse


def in_a(table: str, excuse: Excuse) -> Excuse:
    """Find an excuse in one table only."""
    return lambda at, state, why: at.scene.__struct_config__.tag == table and excuse(at, state, why)


def at_once(request: Line, answer: Callable[[Line], Line]) -> Line:
    """Answer a step that lasts no time before any check."""
    found = answer(request)
    state = request.get("state")
    if request.get("cmd") != "step" or not isinstance(state, dict) or state.get("t") != request.get("t_end"):
        return found
    return straight(request, state) if found["outcome"] == "rejected" else found


def arrived(which: Callable[[float, float], bool]) -> Fault:
    """Let particles of a flow have arrived whose time stands in some relation to t_end."""

    def change(request: Line, found: Line) -> Line:
        there = [
            straight({**request, "t_end": state["t"]}, state) | {"t": request["t_end"]}
            if which(state["t"], request["t_end"])
            else answer
            for state, answer in zip(request["states"], found["states"], strict=True)
        ]
        return {**found, "states": there}

    return on("flow", change)


def refusing_slow_ones(request: Line, answer: Callable[[Line], Line]) -> Line:
    """Refuse who leaves the arc at rest by less than a hundredth of its speed."""
    found, state = answer(request), request.get("state")
    if request.get("cmd") != "step" or not isinstance(state, dict) or state.get("wall") != "arc":
        return found
    inwards = -state["x"] * state["vx"] - state["y"] * state["vy"]
    is_slow = 0 < inwards < 0.01 * math.hypot(state["vx"], state["vy"])
    return {"seq": request["seq"], "outcome": "rejected", "reason": "it slides"} if is_slow else found


def minus_is_below(request: Line, answer: Callable[[Line], Line]) -> Line:
    """Take y = -0.0 for a place in the stem, under a base that is closed."""
    state = request.get("state")
    is_minus = isinstance(state, dict) and state.get("y") == 0 and math.copysign(1.0, state["y"]) < 0
    if request.get("cmd") != "step" or not is_minus or "w" not in (scene := request["scene"]):
        return answer(request)
    stem = {"table": "stem", "w": scene["w"], "h": scene["h"]}
    return honest({**request, "scene": stem, "state": {**state, "y": -(2.0**-30)}})


def refusing(is_refused: Callable[[TableAt, Line], bool], cmd: str = "step") -> Fault:
    """Refuse states that name a wall, and where something holds."""

    def fault(request: Line, answer: Callable[[Line], Line]) -> Line:
        found, state = answer(request), request.get("state")
        if request.get("cmd") != cmd or not isinstance(state, dict) or not state.get("wall"):
            return found
        table = rounded(from_data(request["scene"]), state["t"])
        if found.get("outcome") == "rejected" or not is_refused(table, state):
            return found
        return {"seq": request["seq"], "outcome": "rejected", "reason": "it is not on its wall"}

    return fault


def in_the_mouth(table: TableAt, state: Line) -> bool:
    """Find the base nowhere in the open mouth."""
    is_open = isinstance(table.scene, Mushroom) and abs(state["x"]) < table.w
    return is_open and state["wall"] == "base"


def strictly_off(*walls: str) -> Callable[[TableAt, Line], bool]:
    """Allow a place off some walls rounding alone."""

    def is_refused(table: TableAt, state: Line) -> bool:
        gap = abs(table.gap(state["wall"], state["x"], state["y"]))
        return state["wall"] in walls and bool(gap > 1e-9 * table.size * max(1.0, table.size))

    return is_refused


def sinking_through_the_mouth(table: TableAt, state: Line, why: str) -> bool:
    """Let a state that names the base go down where the mouth is open."""
    return "moves into it" in why and in_the_mouth(table, state)


def nameless_on_the_base(_: TableAt, state: Line, __: str) -> bool:
    """Let a state at y = 0 that names no wall go anywhere."""
    return state["wall"] is None and bool(state["y"] == 0)


def scenes_refused_for(*words: str) -> Fault:
    """Let scenes through that are refused for some reason, by words of it."""

    def fault(request: Line, answer: Callable[[Line], Line]) -> Line:
        found = answer(request)
        is_question = request.get("cmd") in ("step", "trajectory", "flow")
        if not is_question or not any(word in found.get("reason", "") for word in words):
            return found
        if request["cmd"] == "flow":
            return {"seq": found["seq"], "states": [straight(request, state) for state in request["states"]]}
        there = straight(request, request["state"])
        return there if request["cmd"] == "step" else {"seq": found["seq"], "steps": [there]}

    return fault


def narrower(is_refused: Callable[[Scene], bool]) -> Fault:
    """Refuse some valid scenes."""

    def fault(request: Line, answer: Callable[[Line], Line]) -> Line:
        found = answer(request)
        if "reason" in found or "scene" not in request or not is_refused(from_data(request["scene"])):
            return found
        return {"seq": request["seq"], "outcome": "rejected", "reason": "the scene may break"}

    return fault


def wide_by_ranges(scene: Scene) -> bool:
    """Compare the widest mouth with the smallest cap."""
    w = getattr(scene, "w", None)
    return isinstance(scene, Mushroom) and w is not None and bounds(w).highest > bounds(scene.r).lowest


EXCUSES: dict[str, Excuse] = {
    "loose-on-walls": loose(1e-2),
    "loose-by-1e-5": loose(1e-5),
    "a-tenth-outside": near_by(0.1),
    "little-outside": near_by(2.0**-16),
    "slowly-into-walls": slower(0.01),
    "fleeing-a-faster-wall": fleeing,
    "named-beyond-others": named_beyond,
    "arc-below-the-mouth": in_a("mushroom", on_a_longer("arc")),
    "sides-above-the-mouth": in_a("mushroom", on_a_longer("left", "right")),
    "arc-below-a-cap": in_a("cap", on_a_longer("arc")),
    "sinking-through-the-mouth": sinking_through_the_mouth,
    "nameless-through-the-base": nameless_on_the_base,
    "outside-left": in_a("mushroom", near_by(math.inf, "left")),
}
LENIENT: dict[str, tuple[str, str, Fault]] = {
    **{name: ("bad-states", "fail", letting(excuse, "step")) for name, excuse in EXCUSES.items()},
    "loose-paths": ("bad-states", "fail", letting(loose(1e-2), "trajectory")),
    "loose-flows": ("bad-states", "fail", letting(loose(1e-2), "flow")),
    "no-time-no-check": ("bad-states", "fail", at_once),
    "late-is-arrived": ("bad-states", "fail", arrived(lambda t, t_end: t > t_end)),
    "at-the-end-unchecked": ("bad-states", "fail", arrived(lambda t, t_end: t == t_end)),
    "no-base-in-the-mouth": ("bad-states", "fail", refusing(in_the_mouth)),
    "no-base-in-the-mouth-of-paths": ("bad-states", "fail", refusing(in_the_mouth, "trajectory")),
    **{
        f"strictly-on-{wall}": ("bad-states", "fail", refusing(strictly_off(wall)))
        for wall in ("arc", "base", "left", "floor")
    },
    "refusing-slow-ones": ("bad-states", "fail", refusing_slow_ones),
    "scenes-unchecked": ("bad-scenes", "fail", scenes_refused_for("fails by")),
    "scenes-checked-at-the-start": ("bad-scenes", "fail", scenes_refused_for("near t = 0.6875")),
    **{
        f"scenes-without-{name}": ("bad-scenes", "fail", scenes_refused_for(word))
        for name, word in {
            "w-up-to-r": "w <= r",
            "nu-up-to-1": "nu <= 1",
            "sides-apart": "w > h slope",
            "one-period": "share one period",
            "closed-knots": "no jumps",
        }.items()
    },
    "scenes-by-ranges": ("bad-scenes", "fail", narrower(wide_by_ranges)),
    "minus-is-below": ("minus-zero", "fail", minus_is_below),
}
