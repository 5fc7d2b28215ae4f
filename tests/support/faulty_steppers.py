"""Steppers behind protocol 1 that are right but for one fault each; no process is started.

Each is the fast stepper behind `scene.protocol.wire`. Its fault changes the request before it is answered, or
the answer. Here are the form of a fault, and faults of hits, paths, flows and clocks; those of reading and
refusing are in `support.faulty_readers`. The table of `support.faults` names the check that refuses each.
"""

import io
import json
import math
import time
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import fast.__main__ as server
from fast import next_collision
from scene import from_data
from scene.protocol.wire import serve

Line = dict[str, Any]
Answer = Callable[[Line], Line]
Fault = Callable[[Line, Answer], Line]  # (request, honest) -> answer
Change = Callable[..., Line | None]  # (request, answer, sizes) -> answer; None where it was changed in place
STEP, PATH, FLOW = "step", "trajectory", "flow"
NUMBERS = ("t", "x", "y", "vx", "vy")
OPEN = {"outcome": "undecided", "reason": "too long"}


def answers_to(lines: Iterable[bytes], step: Any, follow: Any, **options: Any) -> bytes:
    """Answer lines of the protocol by steppers, as a process does."""
    out = io.BytesIO()
    serve("faulty", step, follow, lines, out, **options)
    return out.getvalue()


def honest(request: Line) -> Line:
    """Answer as the fast stepper does."""
    line = request["line"] if "line" in request else json.dumps(request)
    engines = {"flow": server.carry, "timer": server.clock}
    found = answers_to([line.encode()], next_collision, server.follow, **engines)
    return json.loads(found)  # type: ignore[no-any-return]


def faulty(fault: Fault) -> Callable[[bytes], bytes]:
    """Return what answers lines, for `conformance.suite.session.Session`."""

    def answer(line: bytes) -> bytes:
        try:
            request = json.loads(line)
        except ValueError:
            request = None
        # What fast refuses of a line stays refused, though Python would read it.
        readable = isinstance(request, dict) and b"1e999" not in line
        return json.dumps(fault(request if readable else {"line": line.decode()}, honest)).encode()

    return answer


def on(cmds: str | Sequence[str], change: Change, /, **sizes: Any) -> Fault:
    """Change the answers to some commands, where they are not whole refusals."""

    def fault(request: Line, answer: Answer) -> Line:
        found = answer(request)
        if request.get("cmd") in ([cmds] if isinstance(cmds, str) else cmds) and "reason" not in found:
            return change(request, found, **sizes) or found
        return found

    return fault


def asked(change: Callable[..., object], /, *cmds: str, **sizes: Any) -> Fault:
    """Change questions in place, of some commands or of all."""

    def fault(request: Line, answer: Answer) -> Line:
        if isinstance(request.get("scene"), dict) and request.get("cmd") in (cmds or (STEP, PATH, FLOW)):
            change(request, **sizes)
        return answer(request)

    return fault


def each(outcome: str, change: Callable[..., object], /, **sizes: Any) -> Change:
    """Change outcomes of a kind in place: (request, outcome, place)."""

    def changed(request: Line, found: Line) -> None:
        for i, part in enumerate(parts(found)):
            if part["outcome"] == outcome:
                change(request, part, i, **sizes)

    return changed


def both(one: Fault, other: Fault) -> Fault:
    """Have two faults."""
    return lambda request, answer: one(request, lambda changed: other(changed, answer))


def parts(found: Line) -> list[Line]:
    """Return the outcomes of an answer."""
    return found.get("steps", found.get("states", [found]))  # type: ignore[no-any-return]


def starts(request: Line) -> list[Line]:
    """Return the states of a request that are objects."""
    states = request.get("states", [request.get("state")])
    return [state for state in states if isinstance(state, dict)] if isinstance(states, list) else []


def turned(part: Line, factor: float, angle: float = 0.0) -> None:
    """Change the size and the direction of a velocity."""
    vx, vy, c, s = part["vx"], part["vy"], factor * math.cos(angle), factor * math.sin(angle)
    part["vx"], part["vy"] = c * vx - s * vy, s * vx + c * vy


def placed(state: Line, dt: float) -> Line:
    """Return where a state comes to if it meets nothing."""
    return {name: state[name] + state["v" + name] * dt for name in ("x", "y")}


def next_of(request: Line, hit: Line, n: int = 1) -> list[Line]:
    """Return what follows a hit, or any state."""
    state = {name: hit.get(name) for name in (*NUMBERS, "wall")}
    question = {key: part for key, part in request.items() if key not in ("states", "collisions")}
    return honest({**question, "cmd": PATH, "state": state, "collisions": n}).get("steps", [])  # type: ignore[no-any-return]


# Hits.


def wrong_order(request: Line, hit: Line, *, near: float) -> None:
    """Meet two walls that come within a part of the flight in the order of a list."""
    for other in next_of(request, hit) if hit["outcome"] == "collision" else []:
        is_met = other["outcome"] == "collision" and other["wall"] != hit["wall"]
        if is_met and other["dt"] < near * hit["dt"]:
            start, dt = starts(request)[0], hit["dt"] + other["dt"]
            hit |= {"wall": other["wall"], "dt": dt, "t": start["t"] + dt, **placed(start, dt)}
            hit |= {name: start[name] + other[name] - hit[name] for name in ("vx", "vy")}


def dead_time(request: Line, hit: Line, *, part: float) -> None:
    """Overlook a hit of the wall just left that comes within a part of the period."""
    span = from_data(request["scene"]).period or 1.0
    if hit.get("wall") and hit["wall"] == starts(request)[0].get("wall") and hit["dt"] < part * span:
        for other in next_of(request, hit):
            hit |= {**other, "dt": hit["dt"] + other.get("dt", 0.0)}


def impatient(request: Line, hit: Line, *, periods: float) -> None:
    """Know the time of a hit to 7 digits after many periods."""
    if hit.get("dt", 0.0) > periods * (from_data(request["scene"]).period or math.inf):
        hit["dt"] *= 1 + 1e-7


def early(request: Line, found: Line, *, part: float) -> None:
    """Find hits down to a tolerance, a part of the flight too early: no fault."""
    if found["outcome"] == "collision":
        start, dt = request["state"], found["dt"] * (1 - part)
        found |= {"dt": dt, "t": start["t"] + dt, **placed(start, dt)}


def other_mouth(request: Line, *, change: Callable[[float], float]) -> None:
    """Take a mouth for another: the constant w / r."""
    scene = request["scene"] = {**request["scene"]}
    name, r = ("nu", 1.0) if scene.get("nu") is not None else ("w", scene.get("r"))
    if scene.get("table") == "mushroom" and isinstance(scene.get(name), float) and isinstance(r, float):
        scene[name] = r * change(scene[name] / r)


def other_slope(request: Line, *, change: Callable[[float], float]) -> None:
    """Take a constant slope for another."""
    if isinstance(request["scene"].get("slope"), float):
        request["scene"] = {**request["scene"], "slope": change(request["scene"]["slope"])}


# Paths.


def tired(request: Line, found: Line, *, after: int) -> None:
    """Lose 1e-5 of the speed at a bounce of a trajectory, and at no other; what follows is honest."""
    steps = found["steps"]
    if len(steps) > after and steps[after]["outcome"] == "collision":
        turned(steps[after], 1 - 1e-5)
        n = request["collisions"] - after - 1
        found["steps"] = [*steps[: after + 1], *(next_of(request, steps[after], n) if n else [])]


def one_too_few(request: Line, found: Line) -> Line:
    """Miscount from 100 on."""
    return {**found, "steps": found["steps"][: request["collisions"] - (request["collisions"] > 100)]}


def leaking(_: Line, step: Line, i: int, *, part: float = 0.0, angle: float = 0.0) -> None:
    """Lose a part of the speed at every bounce, and turn the velocity by an angle."""
    turned(step, (1 - part) ** (i + 1), angle * (i + 1))


def mend(request: Line, found: Line) -> Line:
    """Leave paths open after 300 hits, and lose speed before."""
    each("collision", leaking, part=1e-10)(request, found)
    return {**found, "steps": [*found["steps"][:300], OPEN] if len(found["steps"]) > 300 else found["steps"]}


def to_and_fro(_: Line, step: Line, i: int) -> None:
    """Be now too fast and now too slow by all that a vector lets pass: no fault."""
    turned(step, 1 + (-1) ** i * 1e-9)


def repeated(_: Line, found: Line, *, factor: float = 1.0) -> Line:
    """Repeat the first hit for ever, with a multiple of its velocity."""
    first = found["steps"][0]
    first |= {name: factor * first[name] for name in ("vx", "vy") if name in first}
    return {**found, "steps": [first] * len(found["steps"])}


def horizon_at_once(request: Line, found: Line) -> None:
    """Say that nothing is ever met, where the particle begins."""
    start = {name: request["state"][name] for name in NUMBERS}
    if found["steps"] and found["steps"][0]["outcome"] == "collision":
        found["steps"] = [{**start, "outcome": "horizon", "t": request["t_end"]}]


def beside_its_wall(_: Line, step: Line, __: int) -> None:
    """See each hit a little early."""
    step |= placed(step, -1e-7)


def late_speed(_: Line, step: Line, __: int) -> None:
    """Gain 1e-5 of the speed at every hit after t = 1000."""
    turned(step, 1 + 1e-5 if step["t"] > 1000 else 1.0)


def leaving_out(_: Line, found: Line, *, outcome: str) -> Line:
    """Say nothing of what came instead of a collision."""
    return {**found, "steps": [step for step in found["steps"] if step["outcome"] != outcome]}


# Flows.


def particles_by(request: Line, found: Line, *, key: Callable[[Line], Any]) -> Line:
    """Carry each particle of a flow once, and know it again by a key."""
    known: dict[str, Line] = {}
    keys = [json.dumps(key(state)) for state in request["states"]]
    there = [known.setdefault(*pair) for pair in zip(keys, found["states"], strict=True)]
    return {**found, "states": there}


def one_bad_spoils_all(_: Line, found: Line) -> Line:
    """Reject all states of a flow where one is bad."""
    bad = [state for state in found["states"] if state["outcome"] == "rejected"][:1]
    return {**found, "states": bad * len(found["states"]) or found["states"]}


def same_time_for_all(request: Line) -> None:
    """Let all particles of a flow begin when the first does."""
    for state in starts(request):
        state["t"] = starts(request)[0].get("t")


def room_for(_: Line, found: Line, *, n: int) -> Line:
    """Have room for n particles, and give the last one's arrival to all beyond."""
    states = found["states"]
    return {**found, "states": [*states[:n], *states[n - 1 : n] * (len(states) - n)]}


def swapping(_: Line, found: Line, *, numbers: Any) -> None:
    """Swap two answers of every fifth flow."""
    states = found["states"]
    if next(numbers) % 5 == 0:
        states[:1], states[-1:] = states[-1:], states[:1]


def after_hits(request: Line, found: Line, *, n: int, change: Callable[[Line, Line, Line], object]) -> None:
    """Change arrivals of particles that have met n walls before: (request, last hit, arrival)."""
    for state, arrived in zip(request["states"], found["states"], strict=True):
        steps = next_of(request, state, n)
        if len(steps) == n and steps[-1]["outcome"] == "collision" and arrived["outcome"] == "horizon":
            change(request, steps[-1], arrived)


def straight_on(request: Line, last: Line, arrived: Line) -> None:
    """Meet no wall."""
    arrived |= {**placed(last, request["t_end"] - last["t"]), "vx": last["vx"], "vy": last["vy"]}


def slowed(_: Line, last: Line, arrived: Line) -> None:
    """Keep the speed."""
    turned(arrived, math.hypot(last["vx"], last["vy"]) / math.hypot(arrived["vx"], arrived["vy"]))


def captured_as(change: Callable[[Line, list[float], int], list[float] | None]) -> Fault:
    """Tell other capture intervals: (request, interval, place of the particle) -> interval."""

    def changed(request: Line, part: Line, i: int) -> None:
        part["captured"] = change(request, part["captured"], i) if part.get("captured") else None

    return on(FLOW, each("horizon", changed))


def losing_stays(is_lost: Callable[[int, int], bool]) -> Fault:
    """Lose the capture interval of some particles: (place, number of particles)."""
    return captured_as(lambda request, stay, i: None if is_lost(i, len(request["states"])) else stay)


def wide_edge(request: Line, found: Line, *, by_part: float) -> None:
    """Take a mouth for wider where it is about being captured."""
    scene = request["scene"]
    name = "nu" if scene.get("nu") is not None else "w"
    if scene["table"] == "mushroom" and isinstance(scene[name], float):
        wider = {**scene, name: min(scene[name] * (1 + by_part), scene[name] + 0.01)}
        other = honest({**request, "scene": wider})
        for part, wide in zip(found["states"], other.get("states", ()), strict=False):
            part["captured"] = wide.get("captured") if part["outcome"] == "horizon" else None


# Clocks.


def clock(change: Callable[[list[int]], list[int]]) -> Fault:
    """Say other nanoseconds."""
    return on("time", lambda request, found: {**found, "ns": change(found["ns"])})


def once(said: Callable[[int, list[int], int], list[int]]) -> Fault:
    """Follow each start once, however often is asked, and say something: (collisions, ns, repeat)."""

    def fault(request: Line, answer: Answer) -> Line:
        if request.get("cmd") != "time":
            return answer(request)
        found = answer({**request, "repeat": 1})
        return {**found, "ns": said(request["collisions"], found["ns"], request["repeat"])}

    return fault


def remembered(_: int, ns: list[int], repeat: int) -> list[int]:
    """Look a path up that was followed once."""
    time.sleep(2e-4 * (repeat - 1))
    return [*ns, *[200_000] * (repeat - 1)]


def fewer(request: Line, answer: Answer, *, most: int) -> Line:
    """Follow half of the collisions only, when many are asked for."""
    n = request.get("collisions", 0)
    is_cut = request.get("cmd") == "time" and n > most
    return answer({**request, "collisions": n // 2} if is_cut else request)


def elsewhere(_: Line, found: Line) -> None:
    """Invent the last place."""
    found["steps"][-1]["x"] += 0.01
