"""Servers of protocol 1 that are right but for one fault each; no process is started.

Each is the fast stepper behind `scene.protocol.wire`. Its fault changes the request before it is answered, or
the answer. `FAULTS` is their one table: the check that refuses each, the verdict, the fault.
"""

import io
import json
import math
import time
from collections.abc import Callable, Sequence
from itertools import count
from typing import Any

import fast.__main__ as server
from conformance.suite.process import CheckFailure
from fast import next_collision
from scene.protocol.wire import serve

Line = dict[str, Any]
Answer = Callable[[Line], Line]
Fault = Callable[[Line, Answer], Line]  # (request, honest) -> answer
Change = Callable[
    [Line, Line], Line | None
]  # (request, answer) -> answer; None where it was changed in place
STEP, PATH, FLOW = "step", "trajectory", "flow"
NUMBERS = ("t", "x", "y", "vx", "vy")


def honest(request: Line) -> Line:
    """Answer as the fast stepper does."""
    out = io.BytesIO()
    line = request["line"] if "line" in request else json.dumps(request)
    serve(
        "faulty", next_collision, server.follow, [line.encode()], out, flow=server.carry, timer=server.clock
    )
    answer: Line = json.loads(out.getvalue())
    return answer


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


def on(cmds: str | Sequence[str], change: Change) -> Fault:
    """Change the answers to some commands, where they are not whole refusals."""

    def fault(request: Line, answer: Answer) -> Line:
        found = answer(request)
        if request.get("cmd") in ([cmds] if isinstance(cmds, str) else cmds) and "reason" not in found:
            return change(request, found) or found
        return found

    return fault


def asked(change: Callable[[Line], object], *cmds: str) -> Fault:
    """Change questions in place, of some commands or of all."""

    def fault(request: Line, answer: Answer) -> Line:
        if isinstance(request.get("scene"), dict) and request.get("cmd") in (cmds or (STEP, PATH, FLOW)):
            change(request)
        return answer(request)

    return fault


def parts(found: Line) -> list[Line]:
    """Return the outcomes of an answer."""
    return found.get("steps", found.get("states", [found]))  # type: ignore[no-any-return]


def starts(request: Line) -> list[Line]:
    """Return the states of a request that are objects."""
    states = request.get("states", [request.get("state")])
    return [state for state in states if isinstance(state, dict)] if isinstance(states, list) else []


def each(outcome: str, change: Callable[[Line, Line, int], object]) -> Change:
    """Change outcomes of a kind in place: (request, outcome, place)."""

    def changed(request: Line, found: Line) -> None:
        for i, part in enumerate(parts(found)):
            if part["outcome"] == outcome:
                change(request, part, i)

    return changed


def turned(part: Line, factor: float, angle: float = 0.0) -> None:
    """Change the size and the direction of a velocity."""
    vx, vy, c, s = part["vx"], part["vy"], factor * math.cos(angle), factor * math.sin(angle)
    part["vx"], part["vy"] = c * vx - s * vy, s * vx + c * vy


# Lines and texts.


def at_bad_lines(act: Callable[[], Line]) -> Fault:
    """Do something else than to refuse what is no request."""
    return lambda request, answer: answer(request) if "cmd" in request else act()


def crash() -> Line:
    """Die."""
    raise CheckFailure("crashed", "exited with status 1 before it answered")


def wrong_after_bad_lines() -> Fault:
    """Be upset for ever by a bad line."""
    upset: list[Line] = []

    def fault(request: Line, answer: Answer) -> Line:
        found = answer(request)
        if "cmd" not in request:
            upset.append(request)
        elif upset and "vx" in found:
            found["vx"] *= 1 + 1e-12
        return found

    return fault


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


# Caches, and what they forget.


def last_bit_varies() -> Fault:
    """Answer with a last bit that depends on how often one was asked, as sums in threads may: no fault."""
    numbers = count(1)

    def change(_: Line, found: Line) -> None:
        is_varied = next(numbers) % 3 == 0
        for part in parts(found):
            if "vx" in part and is_varied:
                part["vx"] = math.nextafter(part["vx"], math.inf)

    return on((STEP, PATH, FLOW), change)


def answers_by(key: Callable[[Line], Any]) -> Fault:
    """Keep every answer to a step, by a key of the request."""
    book: dict[str, Line] = {}

    def change(request: Line, found: Line) -> Line:
        return {**book.setdefault(json.dumps(key(request)), found), "seq": request["seq"]}

    return on(STEP, change)


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


def scenes_by(law_key: Callable[[Any], Any], *cmds: str, are_named: bool = True) -> Fault:
    """Keep scenes by their laws' keys, and answer with the first scene of the same key."""
    book: dict[str, Line] = {}

    def change(request: Line) -> None:
        keys = sorted(
            [name if are_named else "", json.dumps(law_key(law))] for name, law in request["scene"].items()
        )
        request["scene"] = book.setdefault(json.dumps(keys), request["scene"])

    return asked(change, *cmds)


def scenes_kept(key: Callable[[Line], Any]) -> Fault:
    """Keep scenes by a key of the whole scene, and answer with the first scene of the same key."""
    book: dict[str, Line] = {}

    def change(request: Line) -> None:
        request["scene"] = book.setdefault(json.dumps(key(request["scene"])), request["scene"])

    return asked(change)


def first_parts(law: Any) -> Any:
    """Look at the first harmonic, and at the first and the last knot."""
    if not isinstance(law, dict):
        return law
    if law.get("kind") == "fourier":
        return {name: part[:1] if isinstance(part, list) else part for name, part in law.items()}
    return [len(law["knots"]), law["knots"][0], law["knots"][-1]]


def without(*fields: str) -> Callable[[Any], Any]:
    """Leave fields of a law out."""
    return lambda law: {k: v for k, v in law.items() if k not in fields} if isinstance(law, dict) else law


def values_alone(law: Any) -> Any:
    """Leave out when the knots are."""
    return [value for _, value in law["knots"]] if isinstance(law, dict) and "knots" in law else law


# Flows.


def particles_by(key: Callable[[Line], Any]) -> Change:
    """Carry each particle of a flow once, and know it again by a key."""

    def change(request: Line, found: Line) -> Line:
        known: dict[str, Line] = {}
        keys = [json.dumps(key(state)) for state in request["states"]]
        there = [known.setdefault(*pair) for pair in zip(keys, found["states"], strict=True)]
        return {**found, "states": there}

    return change


def by(*names: str) -> Callable[[Line], Any]:
    """Return a key of some fields."""
    return lambda state: [state[name] for name in names]


def one_bad_spoils_all(_: Line, found: Line) -> Line:
    """Reject all states of a flow where one is bad."""
    bad = next((state for state in found["states"] if state["outcome"] == "rejected"), None)
    return {**found, "states": [bad] * len(found["states"])} if bad else found


def same_velocity_for_all(_: Line, found: Line) -> None:
    """Give every particle the velocity of the first that arrives."""
    there = [state for state in found["states"] if state["outcome"] == "horizon"]
    for state in there:
        state["vx"] = there[0]["vx"]


def swapping(every: int) -> Change:
    """Swap two answers of a flow now and then."""
    numbers = count(1)

    def change(_: Line, found: Line) -> None:
        states = found["states"]
        if next(numbers) % every == 0:
            states[:1], states[-1:] = states[-1:], states[:1]

    return change


def after_hits(n: int, change: Callable[[Line, Line, Line], object]) -> Fault:
    """Change arrivals of particles that have met n walls before: (request, last hit, arrival)."""

    def changed(request: Line, found: Line) -> None:
        for state, arrived in zip(request["states"], found["states"], strict=True):
            ask = {**request, "cmd": PATH, "state": state, "collisions": n}
            ask.pop("states")
            steps = honest(ask).get("steps", [])
            if len(steps) == n and steps[-1]["outcome"] == "collision" and arrived["outcome"] == "horizon":
                change(request, steps[-1], arrived)

    return on(FLOW, changed)


def straight_on(request: Line, last: Line, arrived: Line) -> None:
    """Meet no wall."""
    dt = request["t_end"] - last["t"]
    place = {name: last[name] + last["v" + name] * dt for name in ("x", "y")}
    arrived |= {**place, "vx": last["vx"], "vy": last["vy"]}


def captured_as(change: Callable[[Line, list[float], int], list[float] | None]) -> Fault:
    """Tell other captured stays: (request, stay, place of the particle) -> stay."""

    def changed(request: Line, part: Line, i: int) -> None:
        if part.get("captured"):
            part["captured"] = change(request, part["captured"], i)

    return on(FLOW, each("horizon", changed))


def losing_stays(is_lost: Callable[[int, int], bool]) -> Fault:
    """Lose the captured stay of some particles: (place, number of particles)."""
    return captured_as(lambda request, stay, i: None if is_lost(i, len(request["states"])) else stay)


def wide_edge(by_part: float) -> Fault:
    """Take a mouth for wider where it is about being captured."""

    def change(request: Line, found: Line) -> None:
        scene = {**request["scene"]}
        name = "nu" if scene.get("nu") is not None else "w"
        if scene["table"] != "mushroom" or not isinstance(scene[name], float):
            return
        other = honest(
            {**request, "scene": {**scene, name: min(scene[name] * (1 + by_part), scene[name] + 0.01)}}
        )
        for part, wide in zip(found["states"], other.get("states", ()), strict=False):
            part["captured"] = wide.get("captured") if part["outcome"] == "horizon" else None

    return on(FLOW, change)


# Clocks.


def clock(change: Callable[[Line, list[int]], list[int]]) -> Fault:
    """Say other nanoseconds."""
    return on("time", lambda request, found: {**found, "ns": change(request, found["ns"])})


def once(said: Callable[[int, list[int], int], list[int]]) -> Fault:
    """Follow each start once, however often is asked, and say something: (collisions, ns, repeat)."""

    def fault(request: Line, answer: Answer) -> Line:
        if (
            request.get("cmd") != "time"
            or not isinstance(request.get("repeat"), int)
            or request["repeat"] < 1
        ):
            return answer(request)
        repeat, request["repeat"] = request["repeat"], 1
        found = answer(request)
        return {**found, "ns": said(request["collisions"], found["ns"], repeat)} if "ns" in found else found

    return fault


def remembered(_: int, ns: list[int], repeat: int) -> list[int]:
    """Look a path up that was followed once."""
    time.sleep(2e-4 * (repeat - 1))
    return [*ns, *[200_000] * (repeat - 1)]


def fewer(most: int) -> Fault:
    """Follow half of the collisions only, when many are asked for."""

    def fault(request: Line, answer: Answer) -> Line:
        if request.get("cmd") == "time" and isinstance(n := request.get("collisions"), int) and n > most:
            request["collisions"] = n // 2
        return answer(request)

    return fault


def elsewhere(_: Line, found: Line) -> None:
    """Invent the last place."""
    found["steps"][-1]["x"] += 0.01
