"""Implementations that are right in every step, and break one promise of protocol 1; no process is started.

Each is the fast stepper behind `scene.protocol.wire`, in place of a process; its fault changes the request
before it is answered, or the answer.
"""

from __future__ import annotations

import io
import json
import math
import time
from collections.abc import Callable
from typing import Any

import fast.__main__ as server
from conformance.suite.process import Trouble
from fast import next_collision
from scene.protocol.wire import serve

Line = dict[str, Any]
Fault = Callable[[Line, Callable[[Line], Line]], Line]  # (request, honest) -> answer


class Breaker:
    """Stands in for `conformance.suite.process.Process`.

    Args:
        fault: see `FAULTS`.
    """

    def __init__(self, fault: Fault) -> None:
        self.fault = fault

    def exchange(self, line: bytes, _: float) -> bytes:
        """Answer one line."""
        try:
            request = json.loads(line)
        except ValueError:
            request = None
        if not isinstance(request, dict):
            request = {"line": line.decode()}
        return json.dumps(self.fault(request, honest)).encode()

    def finish(self, _line: bytes, _timeout: float) -> None:
        """End."""

    def kill(self) -> None:
        """End."""


def honest(request: Line) -> Line:
    """Answer as the fast stepper does."""
    out = io.BytesIO()
    line = request["line"] if "line" in request else json.dumps(request)
    lines = [line.encode()]
    serve("breaker", next_collision, server.follow, lines, out, flow=server.carry, timer=server.clock)
    answer: Line = json.loads(out.getvalue())
    return answer


def on(cmd: str, change: Callable[[Line, Line], Line]) -> Fault:
    """Change the answers to one command, (request, answer) -> answer."""

    def fault(request: Line, answer: Callable[[Line], Line]) -> Line:
        found = answer(request)
        return change(request, found) if request.get("cmd") == cmd and "reason" not in found else found

    return fault


def absent_is_arc(request: Line, answer: Callable[[Line], Line]) -> Line:
    """Take a wall that is not named for the arc."""
    state = request.get("state")
    if request.get("cmd") == "step" and isinstance(state, dict) and "wall" not in state:
        state["wall"] = "arc"
    return answer(request)


def crash_at_bad_lines(request: Line, answer: Callable[[Line], Line]) -> Line:
    """Die of what is no request."""
    if "cmd" not in request:
        raise Trouble("crashed", "exited with status 1 before it answered")
    return answer(request)


def guess_at_bad_lines(request: Line, answer: Callable[[Line], Line]) -> Line:
    """Answer what is no request."""
    if "cmd" not in request:
        return {"seq": None, "outcome": "undecided", "reason": "what?"}
    return answer(request)


def wrong_after_bad_lines() -> Fault:
    """Be upset for ever by a bad line."""
    upset = []

    def fault(request: Line, answer: Callable[[Line], Line]) -> Line:
        found = answer(request)
        if "cmd" not in request:
            upset.append(request)
        elif upset and "vx" in found:
            found["vx"] *= 1 + 1e-12
        return found

    return fault


def take_hints(request: Line, answer: Callable[[Line], Line]) -> Line:
    """Make something of a field that it does not know."""
    hint = request.get("state", {}).pop("hint", 0.0) if isinstance(request.get("state"), dict) else 0.0
    found = answer(request)
    return {**found, "x": found["x"] + hint} if hint else found


def one_bad_spoils_all(_: Line, found: Line) -> Line:
    """Reject all states of a flow where one is bad."""
    bad = next((state for state in found["states"] if state["outcome"] == "rejected"), None)
    return {**found, "states": [bad] * len(found["states"])} if bad else found


def bad_ones_last(_: Line, found: Line) -> Line:
    """Answer good states first."""
    return {**found, "states": sorted(found["states"], key=lambda state: state["outcome"] == "rejected")}


def no_bad_ones(_: Line, found: Line) -> Line:
    """Leave out what did not arrive."""
    return {**found, "states": [state for state in found["states"] if state["outcome"] == "horizon"]}


def stays_of_the_lost(request: Line, found: Line) -> Line:
    """Tell a captured stay of particles that do not arrive."""
    for state in found["states"]:
        if state["outcome"] != "horizon":
            state["captured"] = [0.0, request["t_end"]]
    return found


def same_wall_for_all(_: Line, found: Line) -> Line:
    """Give every particle the velocity of the first."""
    for state in found["states"]:
        if state["outcome"] == "horizon":
            state["vx"] = found["states"][0]["vx"]
    return found


def one_too_few(request: Line, found: Line) -> Line:
    """Miscount from 100 on."""
    return {**found, "steps": found["steps"][: request["collisions"] - (request["collisions"] > 100)]}


def tired(after: int) -> Callable[[Line, Line], Line]:
    """Lose 1e-5 of the speed at a bounce of a trajectory, and at no other; what follows is honest."""

    def change(request: Line, found: Line) -> Line:
        steps = found["steps"]
        if len(steps) > after and steps[after]["outcome"] == "collision":
            last = steps[after]
            last["vx"], last["vy"] = last["vx"] * (1 - 1e-5), last["vy"] * (1 - 1e-5)
            state = {name: last[name] for name in ("t", "x", "y", "vx", "vy", "wall")}
            rest = {**request, "state": state, "collisions": request["collisions"] - after - 1}
            found["steps"] = [*steps[: after + 1], *honest(rest)["steps"]]
        return found

    return change


def captured_as(change: Callable[[Line, list[float] | None], list[float] | None]) -> Fault:
    """Tell other captured stays: (request, stay) -> stay."""

    def changed(request: Line, found: Line) -> Line:
        for state in found["states"]:
            if state["outcome"] == "horizon":
                state["captured"] = change(request, state.get("captured"))
        return found

    return on("flow", changed)


def without_slope(cmd: str) -> Fault:
    """Forget in one command that sides may lean."""

    def fault(request: Line, answer: Callable[[Line], Line]) -> Line:
        if request.get("cmd") == cmd and "slope" in request["scene"]:
            request["scene"]["slope"] = 0.0
        return answer(request)

    return fault


def frozen_after(n: int) -> Fault:
    """Keep the speed in a flow from the n-th bounce on."""

    def change(request: Line, found: Line) -> Line:
        for state, arrived in zip(request["states"], found["states"], strict=True):
            ask = {**request, "cmd": "trajectory", "state": state, "collisions": n}
            ask.pop("states")
            steps = honest(ask).get("steps", [])
            if len(steps) == n and steps[-1]["outcome"] == "collision" and arrived["outcome"] == "horizon":
                speeds = [(at["vx"] ** 2 + at["vy"] ** 2) ** 0.5 for at in (steps[-1], arrived)]
                arrived["vx"] *= speeds[0] / speeds[1]
                arrived["vy"] *= speeds[0] / speeds[1]
        return found

    return on("flow", change)


def path_absent_is_arc(request: Line, answer: Callable[[Line], Line]) -> Line:
    """Take a wall that is not named for the arc, in a trajectory."""
    if request.get("cmd") == "trajectory":
        request["state"].setdefault("wall", "arc")
    return answer(request)


def nameless_only(request: Line, answer: Callable[[Line], Line]) -> Line:
    """Refuse a scene that has a name."""
    if request.get("cmd") == "step" and "name" in request["scene"]:
        return {"seq": request["seq"], "outcome": "rejected", "reason": "scene.name is unknown"}
    return answer(request)


def as_fortran_reads(request: Line, answer: Callable[[Line], Line]) -> Line:
    """Take a number without a point for one with six decimals."""
    if request.get("cmd") == "step" and type(request["t_end"]) is int:
        request["t_end"] /= 10**6
    return answer(request)


def remembering_steps(digits: int) -> Fault:
    """Keep every answer, by the question's numbers rounded to so many digits."""
    book: dict[str, Line] = {}

    def rounded(part: Any) -> Any:
        if isinstance(part, dict):
            return {name: rounded(value) for name, value in part.items() if name != "seq"}
        return float(f"{part:.{digits}g}") if isinstance(part, float) else part

    def fault(request: Line, answer: Callable[[Line], Line]) -> Line:
        if request.get("cmd") != "step":
            return answer(request)
        key = json.dumps(rounded(request))
        found = book.setdefault(key, answer(request))
        return {**found, "seq": request["seq"]}

    return fault


def bisecting(cell: float, then: Fault = lambda request, answer: answer(request)) -> Fault:
    """Find hits down to a tolerance, as honest ones do that halve an interval; a fault may come upon that."""

    def change(request: Line, found: Line) -> Line:
        if found["outcome"] == "collision":
            start, dt = request["state"], math.floor(found["dt"] / cell) * cell
            found |= {"dt": dt, "t": start["t"] + dt}
            found |= {"x": start["x"] + start["vx"] * dt, "y": start["y"] + start["vy"] * dt}
        return found

    return lambda request, answer: then(request, lambda asked: on("step", change)(asked, answer))


def first_time_for_all(request: Line, answer: Callable[[Line], Line]) -> Line:
    """Let all particles of a flow begin when the first does."""
    for state in request.get("states", ()):
        state["t"] = request["states"][0]["t"]
    return answer(request)


def room_for(n: int) -> Fault:
    """Have room for n particles, and give the last one's arrival to all beyond."""
    return on(
        "flow",
        lambda _, found: {
            **found,
            "states": [s if i < n else found["states"][n - 1] for i, s in enumerate(found["states"])],
        },
    )


def late_speed(after: float) -> Callable[[Line, Line], Line]:
    """Gain 1e-5 of the speed in a trajectory at every hit after some time."""

    def change(_: Line, found: Line) -> Line:
        for step in found["steps"]:
            if step["outcome"] == "collision" and step["t"] > after:
                step["vx"], step["vy"] = step["vx"] * (1 + 1e-5), step["vy"] * (1 + 1e-5)
        return found

    return change


def ns(change: Callable[[Line, list[int]], list[int]]) -> Fault:
    """Say other nanoseconds."""
    return on("time", lambda request, found: {**found, "ns": change(request, found["ns"])})


def idle(said: Callable[[int], int]) -> Fault:
    """Follow nothing but once, and say so many nanoseconds for n collisions."""

    def fault(request: Line, answer: Callable[[Line], Line]) -> Line:
        if request.get("cmd") != "time":
            return answer(request)
        repeat, request["repeat"] = request["repeat"], 1
        return {**answer(request), "ns": [said(request["collisions"])] * repeat}

    return fault


def remembering() -> Fault:
    """Follow each start once, and then look it up, as often as is asked."""

    def fault(request: Line, answer: Callable[[Line], Line]) -> Line:
        if request.get("cmd") != "time":
            return answer(request)
        repeat, request["repeat"] = request["repeat"], 1
        found = answer(request)
        time.sleep(2e-4 * (repeat - 1))
        return {**found, "ns": [*found["ns"], *[200_000] * (repeat - 1)]}

    return fault


def fewer(most: int) -> Fault:
    """Follow half of the collisions only, when many are asked for."""

    def fault(request: Line, answer: Callable[[Line], Line]) -> Line:
        if request.get("cmd") == "time" and request["collisions"] > most:
            request["collisions"] //= 2
        return answer(request)

    return fault


def elsewhere(_: Line, found: Line) -> Line:
    """Invent the last place."""
    found["steps"][-1]["x"] += 0.01
    return found


# The promise that each breaks, the verdict on it, and the fault.
FAULTS: dict[str, tuple[str, str, Fault]] = {
    "absent-is-arc": ("absent-wall", "fail", absent_is_arc),
    "crash-at-bad-lines": ("malformed-lines", "crashed", crash_at_bad_lines),
    "guess-at-bad-lines": ("malformed-lines", "fail", guess_at_bad_lines),
    "wrong-after-bad-lines": ("malformed-lines", "fail", wrong_after_bad_lines()),
    "take-hints": ("extra-fields", "fail", take_hints),
    "one-bad-spoils-all": ("flow-alone", "fail", on("flow", one_bad_spoils_all)),
    "bad-ones-last": ("flow-alone", "fail", on("flow", bad_ones_last)),
    "no-bad-ones": ("flow-alone", "wrong-format", on("flow", no_bad_ones)),
    "stays-of-the-lost": ("flow-alone", "wrong-format", on("flow", stays_of_the_lost)),
    "first-for-all": ("flow-alone", "fail", on("flow", same_wall_for_all)),
    "one-too-few": ("long-trajectory", "fail", on("trajectory", one_too_few)),
    "tired-at-50": ("long-trajectory", "fail", on("trajectory", tired(50))),
    "tired-at-450": ("long-trajectory", "fail", on("trajectory", tired(450))),
    "tired-at-1000": ("long-trajectory", "fail", on("trajectory", tired(1000))),
    "never-captured": ("flow-arrivals", "fail", captured_as(lambda _, __: None)),
    "captured-from-the-start": (
        "flow-arrivals",
        "fail",
        captured_as(lambda _, stay: stay and [0.0, stay[1]]),
    ),
    "captured-to-the-end": (
        "flow-arrivals",
        "fail",
        captured_as(lambda request, stay: stay and [stay[0], request["t_end"]]),
    ),
    "without-slope": ("flow-arrivals", "fail", without_slope("flow")),
    "slope-of-single-steps": ("trajectory-steps", "fail", without_slope("trajectory")),
    "frozen-after-50": ("flow-arrivals", "fail", frozen_after(50)),
    "absent-is-arc-in-paths": ("absent-wall", "fail", path_absent_is_arc),
    "faster-after-1000": ("trajectory-steps", "fail", on("trajectory", late_speed(1000.0))),
    "nameless-only": ("spelling", "fail", nameless_only),
    "as-fortran-reads": ("spelling", "fail", as_fortran_reads),
    "remembering-6-digits": ("near-questions", "fail", remembering_steps(6)),
    "remembering-9-digits": ("near-questions", "fail", remembering_steps(9)),
    "remembering-12-digits": ("near-questions", "fail", remembering_steps(12)),
    "remembering-15-digits": ("near-questions", "fail", remembering_steps(15)),
    "first-time-for-all": ("many-particles", "fail", first_time_for_all),
    "room-for-64": ("many-particles", "fail", room_for(64)),
    "room-for-256": ("many-particles", "fail", room_for(256)),
    "first-time-in-flows": ("flow-arrivals", "fail", first_time_for_all),
    "fewer": ("time-steps", "fail", fewer(8)),
    "fewer-of-many": ("time-clock", "fail", fewer(100)),
    "elsewhere": ("time-steps", "fail", on("time", elsewhere)),
    "no-time": ("time-clock", "fail", ns(lambda _, said: [0] * len(said))),
    "a-tenth": ("time-clock", "fail", ns(lambda _, said: [n // 10 for n in said])),
    "tenfold": ("time-clock", "fail", ns(lambda _, said: [10 * n for n in said])),
    "constant": ("time-clock", "fail", idle(lambda _: 1000)),
    "by-the-piece": ("time-clock", "fail", idle(lambda n: 500 * n)),
    "once-for-all": ("time-clock", "fail", idle(lambda n: 10_000_000 + n)),
    "remembering": ("time-clock", "fail", remembering()),
}
