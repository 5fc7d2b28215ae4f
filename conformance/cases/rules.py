"""Good and bad questions for each rule of the protocol (`scene.protocol.rules`).

`sample(name, key, is_kept)` returns a question that keeps a rule, close to its limit where it has
one, or one that breaks this rule and no other. What passes as its answer follows from the rule's
duty and from `RuleCase.as_read`. A rule about answers gets an answer to a good question instead
(`RuleCase.answer`).

To draw a new rule, write a function of its name with hyphens as underscores, (draw, is_kept) ->
RuleCase: in `rule_scenes` for a scene or a law, else here.
"""

import json
import math
from typing import Any

from conformance.cases import scenes
from conformance.cases.draw import Draw, wire_form
from conformance.cases.rule_scenes import (
    BRIEF,
    CAP,
    DRAWS,
    MUSHROOM,
    STEM,
    Data,
    RuleCase,
    any_table,
    ask,
    further,
    good,
    legs,
    one_of,
    rule,
    wave,
)
from scene import Scene, State, Wall, from_data
from scene.geometry import TableAt, rounded
from scene.protocol.messages import MAX_SEQ
from scene.protocol.rules import LATE, is_late


def sample(name: str, key: object, is_kept: bool) -> RuleCase:
    """Return a question on one side of a rule, always the same for the same key."""
    return DRAWS[name](Draw(f"rule/{name}/{is_kept}/{key}"), is_kept)


# States


@rule
def whole_state(draw: Draw, is_kept: bool) -> RuleCase:
    """Leave out the wall, or a number."""
    request = ask(draw, any_table(draw))
    gone = "wall" if is_kept else draw.pick(("t", "x", "y", "vx", "vy"))
    state = {name: part for name, part in request["state"].items() if name != gone}
    return one_of({**request, "state": state}, is_kept)


@rule
def state_types(draw: Draw, is_kept: bool) -> RuleCase:
    """Give numbers, or something else in place of one."""
    request = ask(draw, any_table(draw))
    if is_kept:
        return good(request)
    numbers: tuple[Any, ...] = ("0.0", True, None, [0.0], {})
    walls: tuple[Any, ...] = (1, True, ["arc"], {})
    name = draw.pick(("t", "x", "y", "vx", "vy", "wall"))
    bad = draw.pick(walls if name == "wall" else numbers)
    return RuleCase({**request, "state": {**request["state"], name: bad}}, None)


@rule
def known_wall(draw: Draw, is_kept: bool) -> RuleCase:
    """Name no wall, or a word that is none."""
    request = ask(draw, any_table(draw))
    wall = None if is_kept else draw.pick(("", "Arc", "top", "mouth", "null"))
    return one_of({**request, "state": {**request["state"], "wall": wall}}, is_kept)


@rule
def own_wall(draw: Draw, is_kept: bool) -> RuleCase:
    """Name a wall of the table, or one of another table."""
    if is_kept:
        return good(_leaving(draw, 0.0, 1.0))
    scene, walls = draw.pick(((CAP, ("left", "right", "floor")), (STEM, ("arc",))))
    request = ask(draw, scene)
    return RuleCase({**request, "state": {**request["state"], "wall": draw.pick(walls)}}, None)


def _leaving(
    draw: Draw, off: float, lift: float, name: bool = True, walls: tuple[Wall, ...] = ()
) -> Data:
    """Ask for a start on a wall of a drawn scene.

    Args:
        draw: stream of numbers.
        off: how far inwards of the wall it lies, in sizes of the wall.
        lift: its speed away from the wall, as the wall sees it; along the wall it is 1.
        name: whether the state names the wall.
        walls: of which the wall is drawn; all of the table if empty.
    """
    of: Scene = scenes.scene(
        draw, draw.pick(scenes.TABLES if not walls else ("mushroom",)), scenes.clock(draw)
    )
    t = 3.0 * draw.part()
    at = rounded(of, t)
    wall = draw.pick(walls or of.walls)
    x, y = scenes.point(at, wall, draw.between(0.3, 0.7), draw.between(0.3, 0.7))
    nx, ny = at.normal(wall, x, y)
    by = off * _size(at, wall, x)
    x, y = (
        (x + by, y)
        if wall == "left"
        else (x - by, y)
        if wall == "right"
        else (x + by * nx, y + by * ny)
    )
    away = lift - at.receding(wall, y)
    along = draw.pick((1.0, -1.0))
    state = State(t, x, y, away * nx - along * ny, away * ny + along * nx, wall if name else None)
    return ask(
        draw,
        wire_form(of),
        {field: getattr(state, field) for field in State.__struct_fields__},
        2.0**-20,
    )


def _size(at: TableAt, wall: Wall, x: float) -> float:
    """Return the size of a wall, as docs/protocol.md has it."""
    if wall in ("left", "right"):
        return max(float(at.w), abs(x))
    return (
        float(at.h) if wall == "floor" else float(at.r) if wall == "arc" else float(max(at.r, at.w))
    )


@rule
def inside(draw: Draw, is_kept: bool) -> RuleCase:
    """Start inside of a wall or beyond it.

    It is off the wall by 2^-18 to 2^-5 of its size, and at rest as the wall sees it.
    """
    off = draw.power(-18, -5) * (1.0 if is_kept else -1.0)
    return one_of(_leaving(draw, off, draw.pick((1.0, 0.5)), name=False), is_kept)


@rule
def on_its_wall(draw: Draw, is_kept: bool) -> RuleCase:
    """Start off the wall that is named, by at most half or at least twice what is allowed."""
    off = (draw.power(-30, -22) if is_kept else draw.power(-18, -6)) * draw.pick((1.0, -1.0))
    return one_of(_leaving(draw, off, 1.0), is_kept)


@rule
def before_its_end(draw: Draw, is_kept: bool) -> RuleCase:
    """Start on the arc above y = 0 or below, or on a side below y = 0 or above."""
    past = draw.power(-10, -4)
    side = draw.pick((1.0, -1.0))
    turn = past if is_kept else -past
    if draw.pick((False, True)):
        x = side * math.cos(turn)
        y = math.sin(turn)
        state = {"t": 0.0, "x": x, "y": y, "vx": -side, "vy": 0.125, "wall": "arc"}
    else:
        wall = "right" if side > 0 else "left"
        state = {"t": 0.0, "x": side / 2, "y": -turn, "vx": -side, "vy": 0.125, "wall": wall}
    return one_of(ask(draw, MUSHROOM, state), is_kept)


@rule
def leaves_its_wall(draw: Draw, is_kept: bool) -> RuleCase:
    """Move away from the wall that is named, or into it, slowly or not."""
    return one_of(_leaving(draw, 0.0, draw.power(-12, 0) * (1.0 if is_kept else -1.0)), is_kept)


CORNERS: tuple[tuple[Data, float, float, tuple[Wall | None, ...]], ...] = (
    (CAP, 1.0, 0.0, ("base", "arc")),
    (STEM, 1.0, 0.0, ("base", "right")),
    (STEM, 1.0, -1.25, ("floor", "right")),
    (MUSHROOM, 0.5, -1.0, ("floor", "right")),
    (MUSHROOM, 0.5, 0.0, ("right", None)),
    (MUSHROOM, 1.0, 0.0, ("arc", None)),
)


def _corner(draw: Draw) -> Data:
    scene, x, y, walls = draw.pick(CORNERS)
    vx, vy = draw.direction()
    wall = draw.pick(walls)
    side = draw.pick((1.0, -1.0))
    wall = "left" if wall == "right" and side < 0 else wall
    return ask(draw, scene, {"t": 0.0, "x": side * x, "y": y, "vx": vx, "vy": vy, "wall": wall})


@rule
def one_wall(draw: Draw, is_kept: bool) -> RuleCase:
    """Start on one wall, or where two meet, whichever way it moves."""
    return good(_leaving(draw, 0.0, 1.0) if is_kept else _corner(draw))


ALONG: tuple[tuple[Data, float, float, Wall, float, float], ...] = (
    (CAP, 0.25, 0.0, "base", 1.0, 0.0),
    (CAP, 0.0, 1.0, "arc", 1.0, 0.0),
    (STEM, 0.25, 0.0, "base", 1.0, 0.0),
    (STEM, 0.25, -1.25, "floor", 1.0, 0.0),
    (STEM, 1.0, -0.5, "right", 0.0, 1.0),
    (MUSHROOM, 0.75, 0.0, "base", 1.0, 0.0),
    (MUSHROOM, 0.25, 0.0, "base", 1.0, 0.0),
    (MUSHROOM, -0.5, -0.5, "left", 0.0, 1.0),
    (MUSHROOM, 0.0, 1.0, "arc", 1.0, 0.0),
)


def _along(draw: Draw) -> Data:
    scene, x, y, wall, vx, vy = draw.pick(ALONG)
    way = draw.pick((1.0, -1.0)) * draw.power(-10, 10)
    state = {
        "t": draw.pick((0.0, -2.5, 7.0)),
        "x": x,
        "y": y,
        "vx": way * vx,
        "vy": way * vy,
        "wall": wall,
    }
    return ask(draw, scene, state)


@rule
def lifts_off(draw: Draw, is_kept: bool) -> RuleCase:
    """Leave a wall, or move along it."""
    return good(_leaving(draw, 0.0, draw.power(-12, 0)) if is_kept else _along(draw))


@rule
def early(draw: Draw, is_kept: bool) -> RuleCase:
    """Start one ulp before or at 2^30 periods, or up to 2^10 times as far.

    Times are on either side of time 0.
    """
    laws = (1.0, wave(draw), legs([[0.0, 1.0], [0.5, 1.25], [1.5, 1.0]]))
    scene = {**CAP, "r": draw.pick(laws)}
    of = from_data(scene)
    shared = of.cycle
    bound = LATE * (
        1.0 if shared is None else float(shared.length or 2 * math.pi / (shared.omega or 1.0))
    )
    while is_late(of, bound):
        bound = math.nextafter(bound, 0.0)
    while not is_late(of, math.nextafter(bound, math.inf)):
        bound = math.nextafter(bound, math.inf)
    t = bound if is_kept else math.nextafter(bound, math.inf) * draw.pick((1.0, 1.0, 2.0, 1024.0))
    t *= draw.pick((1.0, -1.0))
    state = {"t": t, "x": 0.125, "y": 0.25, "vx": 2.0**-20, "vy": -(2.0**-20), "wall": None}
    return good({**ask(draw, scene, state), "t_end": math.nextafter(t, math.inf)})


@rule
def small(draw: Draw, is_kept: bool) -> RuleCase:
    """Move at a speed just below 1e100, or at 1e100 or more."""
    speed = math.nextafter(1e100, 0.0) if is_kept else draw.pick((1e100, 1e101, 1e150))
    state = {
        "t": 0.0,
        "x": 0.125,
        "y": 0.25,
        "vx": draw.pick((1.0, -1.0)) * speed,
        "vy": 1.0,
        "wall": None,
    }
    return good(ask(draw, _any_cap(draw), state, 2.0**-600))


def _any_cap(draw: Draw) -> Data:
    return dict(draw.pick((CAP, MUSHROOM)))


@rule
def known_state_fields(draw: Draw, is_kept: bool) -> RuleCase:
    """Add a field to a state."""
    request = ask(draw, any_table(draw))
    return RuleCase({**request, "state": further(draw, request["state"], is_kept)}, request)


# Requests


@rule
def known_command(draw: Draw, is_kept: bool) -> RuleCase:
    """Give a command, or a word that is none."""
    request = ask(draw, any_table(draw))
    return one_of(
        request if is_kept else {**request, "cmd": draw.pick(("dance", "Step", ""))}, is_kept
    )


@rule
def whole_request(draw: Draw, is_kept: bool) -> RuleCase:
    """Give all fields, or leave one out."""
    request = ask(draw, any_table(draw))
    gone = draw.pick(("scene", "state", "t_end"))
    return one_of(
        request if is_kept else {name: part for name, part in request.items() if name != gone},
        is_kept,
    )


@rule
def request_types(draw: Draw, is_kept: bool) -> RuleCase:
    """Give each field its type, or another to one."""
    request = ask(draw, any_table(draw))
    others: tuple[tuple[str, Any], ...] = (
        ("t_end", "soon"),
        ("t_end", None),
        ("state", []),
        ("state", None),
        ("scene", "cap"),
        ("scene", []),
    )
    name, bad = draw.pick(others)
    return one_of(request if is_kept else {**request, name: bad}, is_kept)


@rule
def finite(draw: Draw, is_kept: bool) -> RuleCase:
    """Give the largest binary64 number, or one beyond."""
    request = ask(draw, CAP, {"t": 0.0, "x": 0.125, "y": 0.25, "vx": 0.0, "vy": 0.0, "wall": None})
    if is_kept:
        return good({**request, "t_end": math.nextafter(math.inf, 0.0)})
    place = draw.pick(("t_end", "vx", "r"))
    if place == "t_end":
        return RuleCase({**request, "t_end": math.inf}, None)
    part = "scene" if place == "r" else "state"
    return RuleCase(
        {**request, part: {**request[part], place: draw.pick((math.inf, -math.inf))}}, None
    )


@rule
def sequence(draw: Draw, is_kept: bool) -> RuleCase:
    """Number a request by a whole number within bounds, or not."""
    good = (0, 1, MAX_SEQ)
    bad = (-1, 2.5, "1", None, True, MAX_SEQ + 2)
    return one_of(
        {**ask(draw, any_table(draw)), "seq": draw.pick(good if is_kept else bad)}, is_kept
    )


@rule
def counts(draw: Draw, is_kept: bool) -> RuleCase:
    """Ask for a whole number of collisions and repeats within bounds, or not."""
    request = ask(draw, CAP)
    others: tuple[Any, ...] = (-1, 1.5, "1", None, True)
    bad = draw.pick(others)
    if draw.pick((False, True)):
        path = {
            **request,
            "cmd": "trajectory",
            "collisions": draw.pick((0, 1, 3)) if is_kept else bad,
        }
        return one_of(path, is_kept)
    timed = {name: part for name, part in request.items() if name != "t_end"} | {"cmd": "time"}
    numbers: Data = {"collisions": draw.pick((1, 3)), "repeat": draw.pick((1, 2))}
    if not is_kept:
        numbers[draw.pick(("collisions", "repeat"))] = draw.pick((0, bad))
    return one_of({**timed, **numbers}, is_kept)


@rule
def end_not_before(draw: Draw, is_kept: bool) -> RuleCase:
    """End one ulp after the start, or one ulp or more before it."""
    t = draw.pick((0.5, -3.0, 1024.0)) * draw.between(1.0, 2.0)
    request = ask(draw, any_table(draw))
    later = math.nextafter(t, math.inf)
    before = draw.pick((math.nextafter(t, -math.inf), t - 5e-7, t - 1.0))
    return one_of(
        {**request, "state": {**request["state"], "t": t}, "t_end": later if is_kept else before},
        is_kept,
    )


@rule
def time_left(draw: Draw, is_kept: bool) -> RuleCase:
    """End after the start, or at the start.

    It is inside, on a wall, along one, where two meet, or in the mouth.
    """
    kind = draw.pick(("inside", "on a wall", "along a wall", "corner", "mouth", "early"))
    if is_kept or kind == "inside":
        request = ask(draw, any_table(draw))
    elif kind == "on a wall":
        request = _leaving(draw, 0.0, draw.power(-12, 0))
    elif kind == "mouth":
        vx, vy = draw.pick(((1.0, 1.0), (1.0, -1.0), (1.0, 0.0), (0.0, 0.0)))
        request = ask(
            draw, MUSHROOM, {"t": 0.0, "x": 0.25, "y": 0.0, "vx": vx, "vy": vy, "wall": None}
        )
    elif kind == "early":
        request = early(draw, True).request
    else:
        request = _corner(draw) if kind == "corner" else _along(draw)
    return good(request if is_kept else {**request, "t_end": request["state"]["t"]})


@rule
def known_request_fields(draw: Draw, is_kept: bool) -> RuleCase:
    """Add a field to a request."""
    request = ask(draw, any_table(draw))
    return RuleCase(further(draw, request, is_kept), request)


@rule
def fields_once(draw: Draw, is_kept: bool) -> RuleCase:
    """Give each field once, or one twice with the same value."""
    request = ask(draw, any_table(draw))
    if is_kept:
        return good(request)
    name = draw.pick(("t_end", "seq"))
    field = f'"{name}": {json.dumps(request[name])}'
    return RuleCase(request, request, json.dumps(request).replace(field, f"{field}, {field}", 1))


# Answers


def _answered(draw: Draw, is_kept: bool, good: str, bad: tuple[tuple[str, str], ...]) -> RuleCase:
    """Return a particle at rest, and its right answer or one with a text replaced."""
    state = {"t": 0.0, "x": 0.125, "y": 0.25, "vx": 0.0, "vy": 0.0, "wall": None}
    request = ask(draw, CAP, state, BRIEF)
    own = '"outcome":"horizon","t":TEND,"x":0.125,"y":0.25,"vx":0.0,"vy":0.0'
    text = ("{" + f'"seq":{request["seq"]},' + own + good + "}").replace(
        "TEND", repr(request["t_end"])
    )
    old, new = draw.pick(bad)
    return RuleCase(request, request, answer=text if is_kept else text.replace(old, new, 1))


@rule
def answer_fields_once(draw: Draw, is_kept: bool) -> RuleCase:
    """Answer with each field once, or with one twice.

    The field is known or unknown, its two values equal or not.
    """
    twice = (
        ('"vy":0.0', '"vy":0.0,"vy":0.0'),
        ('"vy":0.0', '"vy":1.0,"vy":0.0'),
        ('"hint":7', '"hint":7,"hint":8'),
        ('"hint":7', '"hint":7,"hint":7'),
        ('"hint":7', '"hint":{"a":1,"a":2}'),
        ('"hint":7', '"hint":[{"a":1,"\\u0061":1}]'),
    )
    return _answered(draw, is_kept, ',"hint":7', twice)


@rule
def same_seq(draw: Draw, is_kept: bool) -> RuleCase:
    """Answer with the number of the request, or another."""
    return _answered(
        draw, is_kept, "", (('"seq":', '"seq":1'), ('"seq":', '"seq":-'), ('"seq":', '"SEQ":'))
    )


@rule
def finite_answers(draw: Draw, is_kept: bool) -> RuleCase:
    """Answer with finite numbers, or with one beyond binary64, or none."""
    return _answered(draw, is_kept, "", (('"vx":0.0', '"vx":1e999'), ('"vx":0.0', '"vx":NaN')))


@rule
def capture_at_the_end(draw: Draw, is_kept: bool) -> RuleCase:
    """Answer a flow with a capture interval beside a horizon, or beside another outcome."""
    request = ask(
        draw, MUSHROOM, {"t": 0.0, "x": 0.125, "y": 0.25, "vx": 0.0, "vy": 0.0, "wall": None}, BRIEF
    )
    state = request.pop("state")
    request = {**request, "cmd": "flow", "states": [state]}
    outcome = f'"outcome":"horizon","t":{request["t_end"]!r},"x":0.125,"y":0.25,"vx":0.0,"vy":0.0'
    if not is_kept:
        lost = draw.pick(("undefined", "undecided", "rejected"))
        outcome = f'"outcome":"{lost}","reason":"{"corner" if lost == "undefined" else "a reason"}"'
    interval = "null" if is_kept else "[0.0,0.0001]"
    text = f'{{"seq":{request["seq"]},"states":[{{{outcome},"captured":{interval}}}]}}'
    return RuleCase(request, request, answer=text)
