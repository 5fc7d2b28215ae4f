"""Implementations that keep answers, scenes and particles by keys that leave something out, or lose count.

As in `support.promise_breakers` each breaks one promise, and is right beside that.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from typing import Any

from support.promise_breakers import Fault, Line, honest, on

Key = Callable[[Any], Any]


def last_bit_varies() -> Fault:
    """Answer with a last bit that depends on how often one was asked, as sums in threads may."""
    n_asked = [0]

    def fault(request: Line, answer: Callable[[Line], Line]) -> Line:
        found = answer(request)
        n_asked[0] += 1
        for part in (found, *found.get("steps", ()), *found.get("states", ())):
            if "vx" in part and n_asked[0] % 3 == 0:
                part["vx"] = math.nextafter(part["vx"], math.inf)
        return found

    return fault


def answers_by(key: Callable[[Line], Any]) -> Fault:
    """Keep every answer to a step, by a key of the request."""
    book: dict[str, Line] = {}

    def fault(request: Line, answer: Callable[[Line], Line]) -> Line:
        if request.get("cmd") != "step":
            return answer(request)
        found = book.setdefault(json.dumps(key(request)), answer(request))
        return {**found, "seq": request["seq"]}

    return fault


def without_wall(request: Line) -> Any:
    """Leave the wall out."""
    return [request["scene"], {**request["state"], "wall": 0}, request["t_end"]]


def scenes_by(law_key: Key, cmd: str = "step", *, are_named: bool = True) -> Fault:
    """Keep scenes by their laws' keys, and answer with the first scene of the same key."""
    book: dict[str, Line] = {}

    def fault(request: Line, answer: Callable[[Line], Line]) -> Line:
        if request.get("cmd") != cmd:
            return answer(request)
        keys = [[name if are_named else "", law_key(law)] for name, law in request["scene"].items()]
        return answer({**request, "scene": book.setdefault(json.dumps(keys), request["scene"])})

    return fault


def first_parts(law: Any) -> Any:
    """Look at the first harmonic, and at the first and the last knot."""
    if not isinstance(law, dict):
        return law
    if law["kind"] == "fourier":
        return {name: part[:1] if isinstance(part, list | tuple) else part for name, part in law.items()}
    return [len(law["knots"]), law["knots"][0], law["knots"][-1]]


def without(*fields: str) -> Key:
    """Leave fields of a law out."""
    return lambda law: (
        {name: part for name, part in law.items() if name not in fields} if isinstance(law, dict) else law
    )


def values_alone(law: Any) -> Any:
    """Leave out when the knots are."""
    return [value for _, value in law["knots"]] if isinstance(law, dict) and "knots" in law else law


def particles_by(*fields: str) -> Fault:
    """Carry each particle of a flow once, and know it again by some fields."""

    def change(request: Line, found: Line) -> Line:
        known: dict[tuple[Any, ...], Line] = {}
        keys = [tuple(state[name] for name in fields) for state in request["states"]]
        return {
            **found,
            "states": [known.setdefault(*pair) for pair in zip(keys, found["states"], strict=True)],
        }

    return on("flow", change)


def uncaptured(where: Callable[[int, int], bool]) -> Fault:
    """Lose the captured stay of some particles: (index, number of particles)."""

    def change(_: Line, found: Line) -> Line:
        n = len(found["states"])
        kept = [
            {**state, "captured": None} if "captured" in state and where(i, n) else state
            for i, state in enumerate(found["states"])
        ]
        return {**found, "states": kept}

    return on("flow", change)


def last_block(size: int) -> Fault:
    """Lose the captured stays of the last block where it is not full, and not the only one."""
    return uncaptured(lambda i, n: n > size and i >= n - n % size)


def straight_after(n: int) -> Fault:
    """Meet no wall after n hits, in a flow."""

    def change(request: Line, found: Line) -> Line:
        for i, state in enumerate(request["states"]):
            bare = {name: part for name, part in request.items() if name != "states"}
            steps = honest({**bare, "cmd": "trajectory", "state": state, "collisions": n}).get("steps", [])
            if len(steps) == n and (last := steps[-1])["outcome"] == "collision":
                dt = request["t_end"] - last["t"]
                place = {"x": last["x"] + last["vx"] * dt, "y": last["y"] + last["vy"] * dt}
                found["states"][i] |= {**place, "vx": last["vx"], "vy": last["vy"]}
        return found

    return on("flow", change)


def one_at_least(request: Line, answer: Callable[[Line], Line]) -> Line:
    """Follow a trajectory for one collision at least."""
    if request.get("cmd") == "trajectory" and request.get("collisions") == 0:
        request["collisions"] = 1
    return answer(request)


def leaving_out(outcome: str) -> Fault:
    """Say nothing of what came instead of a collision."""
    return on(
        "trajectory",
        lambda _, found: {
            **found,
            "steps": [step for step in found.get("steps", ()) if step["outcome"] != outcome],
        },
    )


PLACE = "x", "y", "vx", "vy"
FORGETFUL: dict[str, tuple[str, str, Fault]] = {
    "last-bit-varies": ("repeated-questions", "fail", last_bit_varies()),
    "answers-without-wall": ("changed-questions", "fail", answers_by(without_wall)),
    "scenes-by-first-parts": ("changed-questions", "fail", scenes_by(first_parts)),
    "paths-by-first-parts": ("changed-questions", "fail", scenes_by(first_parts, "trajectory")),
    "scenes-without-names": ("changed-questions", "fail", scenes_by(without(), are_named=False)),
    "scenes-without-omega": ("changed-questions", "fail", scenes_by(without("omega"))),
    "scenes-without-period": ("changed-questions", "fail", scenes_by(without("period"))),
    "scenes-without-sines": ("changed-questions", "fail", scenes_by(without("sin"))),
    "scenes-by-knot-values": ("changed-questions", "fail", scenes_by(values_alone)),
    "particles-without-time": ("twin-particles", "fail", particles_by(*PLACE, "wall")),
    "particles-without-wall": ("twin-particles", "fail", particles_by("t", *PLACE)),
    "particles-by-place": ("twin-particles", "fail", particles_by("t", "x", "y", "wall")),
    "captured-up-to-100": ("many-particles", "fail", uncaptured(lambda i, _: i >= 100)),
    **{f"captured-in-blocks-of-{n}": ("many-particles", "fail", last_block(n)) for n in (16, 32, 64, 100)},
    "straight-after-1000": ("long-flow", "fail", straight_after(1000)),
    "one-at-least": ("trajectory-ends", "fail", one_at_least),
    "undefined-left-out": ("trajectory-ends", "fail", leaving_out("undefined")),
    "horizon-left-out": ("trajectory-ends", "fail", leaving_out("horizon")),
}
