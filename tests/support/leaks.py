"""Breaches of the promise `at-rest`, and errors as large that are none.

A loss that no single answer shows, and what is no path at all. As in
`support.promise_breakers`: the fast stepper, with its answers changed.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from support.promise_breakers import Fault, Line, bisecting, on


def turned(step: Line, factor: float, angle: float) -> None:
    """Change the size and the direction of the velocity after a bounce."""
    vx, vy, c, s = step["vx"], step["vy"], factor * math.cos(angle), factor * math.sin(angle)
    step["vx"], step["vy"] = c * vx - s * vy, s * vx + c * vy


def leaking(part: float, angle: float = 0.0) -> Callable[[Line, Line], Line]:
    """Lose a part of the speed at every bounce of a trajectory, and turn the velocity by an angle."""

    def change(_: Line, found: Line) -> Line:
        for i, step in enumerate(found["steps"], 1):
            if step["outcome"] == "collision":
                turned(step, (1 - part) ** i, angle * i)
        return found

    return change


def leaking_flow(_: Line, found: Line) -> Line:
    """Arrive a little too slow."""
    for state in found["states"]:
        if state["outcome"] == "horizon":
            turned(state, 1 - 1e-8, 0.0)
    return found


def to_and_fro(_: Line, found: Line) -> Line:
    """Be now too fast and now too slow by all that a vector lets pass."""
    for i, step in enumerate(found["steps"]):
        if step["outcome"] == "collision":
            turned(step, 1 + (-1) ** i * 1e-9, 0.0)
    return found


def ill_timed(request: Line, found: Line) -> Line:
    """Find hits now too early and now too late, by all that a vector lets pass; places go with the times."""
    before = request["state"]
    for i, step in enumerate(found["steps"]):
        late, velocity = (-1) ** (i // 2) * 1e-9 * (step["t"] - before["t"]), (before["vx"], before["vy"])
        before = {**step}
        step["t"] += late
        step |= {name: step[name] + late * v for name, v in zip(("x", "y"), velocity, strict=True)}
    return found


def horizon_at_once(request: Line, found: Line) -> Line:
    """Say that nothing is ever met, where the particle begins."""
    start = {name: part for name, part in request["state"].items() if name != "wall"}
    t_end = request["t_end"]
    found["steps"] = [{**start, "outcome": "horizon", "dt": t_end - start["t"], "t": t_end}]
    return found


def never_moving(request: Line, found: Line) -> Line:
    """Be at every hit where the particle began."""
    for step in found["steps"]:
        step |= {name: request["state"][name] for name in ("x", "y", "vx", "vy")}
    return found


def standing_at(turn: float) -> Callable[[Line, Line], Line]:
    """Repeat the first hit for ever, with the velocity it has or the opposite one."""

    def change(_: Line, found: Line) -> Line:
        first = {
            **found["steps"][0],
            "vx": turn * found["steps"][0]["vx"],
            "vy": turn * found["steps"][0]["vy"],
        }
        found["steps"] = [first] * len(found["steps"])
        return found

    return change


def at_twice_the_time(_: Line, found: Line) -> Line:
    """Be right but for the clock."""
    for step in found["steps"]:
        step["t"] *= 2
    return found


def beside_its_wall(_: Line, found: Line) -> Line:
    """See each hit a little early."""
    for step in found["steps"]:
        step |= {name: step[name] - 1e-7 * step["v" + name] for name in ("x", "y")}
    return found


def open_after(n: int, change: Callable[[Line, Line], Line]) -> Callable[[Line, Line], Line]:
    """Leave a path undecided after n hits, and change those before."""

    def changed(request: Line, found: Line) -> Line:
        found = change(request, found)
        found["steps"][n:] = [OPEN]
        return found

    return changed


def in_a_cap(
    change: Callable[[Line, Line], Line], elsewhere: Callable[[Line, Line], Line]
) -> Callable[[Line, Line], Line]:
    """Change paths in a cap in one way, and those in other tables in another."""
    return lambda request, found: (change if request["scene"]["table"] == "cap" else elsewhere)(
        request, found
    )


def open_flow(_: Line, found: Line) -> Line:
    """Leave every state undecided."""
    return {**found, "states": [OPEN for _ in found["states"]]}


def offering(profiles: list[str], fault: Fault) -> Fault:
    """Offer some profiles only."""

    def changed(request: Line, answer: Callable[[Line], Line]) -> Line:
        found = fault(request, answer)
        return {**found, "profiles": profiles} if request.get("cmd") == "start" else found

    return changed


def unchanged(_: Line, found: Line) -> Line:
    """Change nothing."""
    return found


OPEN = {"outcome": "undecided", "reason": "too long"}
LEAKS: dict[str, tuple[str, str, Fault]] = {
    "leaking": ("at-rest", "fail", on("trajectory", leaking(1e-10))),
    "spiralling": ("at-rest", "fail", on("trajectory", leaking(0.0, 1e-10))),
    "leaking-in-flows": ("at-rest", "fail", on("flow", leaking_flow)),
    "horizon-at-once": ("at-rest", "fail", on("trajectory", horizon_at_once)),
    "never-moving": ("at-rest", "fail", on("trajectory", never_moving)),
    "standing-at-a-wall": ("at-rest", "fail", on("trajectory", standing_at(1.0))),
    "pressing-at-a-wall": ("at-rest", "fail", on("trajectory", standing_at(-1.0))),
    "at-twice-the-time": ("at-rest", "fail", on("trajectory", at_twice_the_time)),
    "beside-its-wall": ("at-rest", "fail", on("trajectory", beside_its_wall)),
    "leaking-but-in-a-cap": (
        "at-rest",
        "fail",
        on("trajectory", in_a_cap(open_after(0, unchanged), leaking(1e-8))),
    ),
    "leaking-before-it-is-open": (
        "at-rest",
        "fail",
        on("trajectory", in_a_cap(open_after(300, leaking(1e-10)), unchanged)),
    ),
    "leaking-in-flows-alone": ("at-rest", "fail", offering(["flow"], on("flow", leaking_flow))),
    "open-in-a-cap": (
        "at-rest",
        "declined",
        on("trajectory", in_a_cap(open_after(399, unchanged), unchanged)),
    ),
    "open-flows": ("at-rest", "declined", on("flow", open_flow)),
    "open-flows-alone": ("at-rest", "declined", offering(["flow"], on("flow", open_flow))),
}
# Of class C. Hits that are found 7e-11 too early err all one way, by a part of what a vector lets pass.
NO_LEAKS: dict[str, Fault] = {
    "to and fro": on("trajectory", to_and_fro),
    "early": offering(["step"], bisecting(10 * 2.0**-37)),
    "now early, now late": on("trajectory", ill_timed),
    "flows alone": offering(["flow"], lambda request, answer: answer(request)),
}
