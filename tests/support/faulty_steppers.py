"""Faults of hits and paths, for the table of `support.faults`."""

import math
from collections.abc import Callable

from support.faulty_servers import (
    NUMBERS,
    PATH,
    Change,
    Fault,
    Line,
    asked,
    each,
    honest,
    starts,
    turned,
)

OPEN = {"outcome": "undecided", "reason": "too long"}

# Hits and paths.


def next_of(request: Line, hit: Line, n: int = 1) -> list[Line]:
    """Return what follows a hit."""
    state = {name: hit[name] for name in (*NUMBERS, "wall")}
    question = {key: part for key, part in request.items() if key not in ("states", "collisions")}
    return honest({**question, "cmd": PATH, "state": state, "collisions": n}).get("steps", [])  # type: ignore[no-any-return]


def wrong_order(near: float) -> Change:
    """Meet two walls that come within a part of the flight in the order of a list."""

    def change(request: Line, hit: Line) -> None:
        following = next_of(request, hit) if hit["outcome"] == "collision" else []
        for other in following:
            if (
                other["outcome"] == "collision"
                and other["dt"] < near * hit["dt"]
                and other["wall"] != hit["wall"]
            ):
                start, dt = starts(request)[0], hit["dt"] + other["dt"]
                hit |= {"wall": other["wall"], "dt": dt, "t": start["t"] + dt}
                hit |= {name: start[name] + start["v" + name] * dt for name in ("x", "y")}
                hit |= {name: start[name] + other[name] - hit[name] for name in ("vx", "vy")}

    return change


def dead_time(part: float) -> Change:
    """Overlook a hit of the wall just left that comes within a part of the period."""

    def change(request: Line, hit: Line) -> None:
        omegas = [law.get("omega") for law in request["scene"].values() if isinstance(law, dict)]
        span = 2 * math.pi / omegas[0] if omegas and omegas[0] else 1.0
        if hit.get("wall") and hit["wall"] == starts(request)[0].get("wall") and hit["dt"] < part * span:
            for other in next_of(request, hit)[:1]:
                hit |= {**other, "dt": hit["dt"] + other.get("dt", 0.0)}

    return change


def impatient(periods: float) -> Change:
    """Know the time of a hit to 7 digits after many periods."""

    def change(request: Line, hit: Line) -> None:
        omegas = [law.get("omega") for law in request["scene"].values() if isinstance(law, dict)]
        if omegas and omegas[0] and hit.get("dt", 0.0) * omegas[0] > 2 * math.pi * periods:
            hit["dt"] *= 1 + 1e-7

    return change


def with_mouth(change: Callable[[float], float]) -> Fault:
    """Take a mouth for another: the constant w / r."""

    def changed(request: Line) -> None:
        scene = request["scene"] = {**request["scene"]}
        name, r = ("nu", 1.0) if scene.get("nu") is not None else ("w", scene.get("r"))
        if scene.get("table") == "mushroom" and isinstance(scene.get(name), float) and isinstance(r, float):
            scene[name] = r * change(scene[name] / r)

    return asked(changed)


def with_slope(change: Callable[[float], float], *cmds: str) -> Fault:
    """Take a constant slope for another."""

    def changed(request: Line) -> None:
        if isinstance(request["scene"].get("slope"), float):
            request["scene"] = {**request["scene"], "slope": change(request["scene"]["slope"])}

    return asked(changed, *cmds)


def early(part: float) -> Change:
    """Find hits down to a tolerance, a part of the flight too early: no fault."""

    def change(request: Line, found: Line) -> None:
        if found["outcome"] == "collision":
            start, dt = request["state"], found["dt"] * (1 - part)
            found |= {"dt": dt, "t": start["t"] + dt}
            found |= {name: start[name] + start["v" + name] * dt for name in ("x", "y")}

    return change


def tired(after: int) -> Change:
    """Lose 1e-5 of the speed at a bounce of a trajectory, and at no other; what follows is honest."""

    def change(request: Line, found: Line) -> None:
        steps = found["steps"]
        if len(steps) > after and steps[after]["outcome"] == "collision":
            turned(steps[after], 1 - 1e-5)
            n = request["collisions"] - after - 1
            found["steps"] = [*steps[: after + 1], *(next_of(request, steps[after], n) if n else [])]

    return change


def one_too_few(request: Line, found: Line) -> Line:
    """Miscount from 100 on."""
    return {**found, "steps": found["steps"][: request["collisions"] - (request["collisions"] > 100)]}


def leaking(part: float, angle: float = 0.0) -> Change:
    """Lose a part of the speed at every bounce, and turn the velocity by an angle."""
    return each("collision", lambda _, step, i: turned(step, (1 - part) ** (i + 1), angle * (i + 1)))


def to_and_fro(_: Line, step: Line, i: int) -> None:
    """Be now too fast and now too slow by all that a vector lets pass: no fault."""
    turned(step, 1 + (-1) ** i * 1e-9)


def repeated(change: Line) -> Change:
    """Repeat the first hit for ever."""

    def changed(_: Line, found: Line) -> None:
        first = {
            name: part * change.get(name, 1) for name, part in found["steps"][0].items() if name in change
        }
        found["steps"] = [{**found["steps"][0], **first}] * len(found["steps"])

    return changed


def never_moving(request: Line, step: Line, _: int) -> None:
    """Be at every hit where the particle began."""
    step |= {name: request["state"][name] for name in ("x", "y", "vx", "vy")}


def horizon_at_once(request: Line, found: Line) -> None:
    """Say that nothing is ever met, where the particle begins."""
    start = {name: request["state"][name] for name in NUMBERS}
    if found["steps"] and found["steps"][0]["outcome"] == "collision":
        found["steps"] = [{**start, "outcome": "horizon", "t": request["t_end"]}]


def beside_its_wall(_: Line, step: Line, __: int) -> None:
    """See each hit a little early."""
    step |= {name: step[name] - 1e-7 * step["v" + name] for name in ("x", "y")}


def late_speed(after: float) -> Callable[[Line, Line, int], None]:
    """Gain 1e-5 of the speed at every hit after some time."""
    return lambda _, step, __: turned(step, 1 + 1e-5) if step["t"] > after else None


def leaving_out(outcome: str) -> Change:
    """Say nothing of what came instead of a collision."""
    return lambda _, found: {
        **found,
        "steps": [step for step in found["steps"] if step["outcome"] != outcome],
    }


def slowed(_: Line, last: Line, arrived: Line) -> None:
    """Keep the speed."""
    turned(arrived, math.hypot(last["vx"], last["vy"]) / math.hypot(arrived["vx"], arrived["vy"]))
