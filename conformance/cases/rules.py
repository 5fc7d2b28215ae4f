"""Good and bad questions for each rule of the protocol (`scene.protocol.rules`), drawn from a seeded stream.

`sample(name, key, is_kept)` returns a question that keeps a rule, close to its limit where it has one, or one
that breaks this rule and no other. What passes as its answer follows from the rule's duty and from
`Sample.as_read`. A rule about answers gets an answer to a good question instead (`Sample.answer`).

To draw a new rule, write a function of its name with hyphens as underscores: (draw, is_kept) -> Sample.
"""

import json
import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from conformance.cases import scenes
from conformance.cases.draw import Draw, wire_form
from scene import Scene, State, Wall, from_data
from scene.geometry import TableAt, rounded
from scene.laws import MAX_HARMONICS, MAX_KNOTS
from scene.protocol.messages import MAX_SEQ
from scene.protocol.rules import BY_NAME, LATE, is_late
from scene.tables import period

Data = dict[str, Any]
CAP: Data = {"table": "cap", "r": 1.0}
STEM: Data = {"table": "stem", "w": 1.0, "h": 1.25}
MUSHROOM: Data = {"table": "mushroom", "r": 1.0, "w": 0.5, "h": 1.0}
INSIDE = {"cap": (0.125, 0.25), "stem": (0.125, -0.25), "mushroom": (0.125, 0.25)}
BRIEF, LONG = 2.0**-12, 4.0  # times in which a particle at INSIDE, with speed 1, meets no wall, and meets one
FURTHER: tuple[tuple[str, Any], ...] = (
    ("hint", 7.0),
    ("T", None),
    ("mass", {"unit": "kg"}),
    ("r2", []),
    ("V", True),
    ("Name", "x"),
)


class Sample(NamedTuple):
    """A question on one side of a rule.

    Attributes:
        request: a request of the protocol; for a rule of duty REJECT that is broken only `rejected` passes.
        as_read: the request whose right answer passes: this one, or the one without a field that may be
            ignored; None where only `rejected` passes.
        line: the request as text where an object has a field twice; else empty.
        answer: of a rule for answers, an answer to the request, as text; else empty.
    """

    request: Data
    as_read: Data | None
    line: str = ""
    answer: str = ""

    def text(self) -> str:
        """Return the line that is sent."""
        return self.line or json.dumps(self.request).replace("Infinity", "1e999")


Sides = Callable[[Draw, bool], Sample]
DRAWS: dict[str, Sides] = {}


def rule(function: Sides) -> Sides:
    """Enter a function into the table of draws, under the rule that has its name."""
    name = function.__name__.replace("_", "-")
    DRAWS[BY_NAME[name].name] = function
    return function


def sample(name: str, key: object, is_kept: bool) -> Sample:
    """Return a question on one side of a rule, always the same for the same key."""
    return DRAWS[name](Draw(f"rule/{name}/{is_kept}/{key}"), is_kept)


def _ask(draw: Draw, scene: Mapping[str, Any], state: Data | None = None, span: float | None = None) -> Data:
    """Return a request for a step in a scene: from a place inside, or from a state.

    Args:
        draw: stream of numbers.
        scene: in the wire's form, good or bad.
        state: likewise; None for a place inside.
        span: the time up to the horizon; None for one in which a wall is met, or none is.
    """
    span = draw.pick((BRIEF, LONG)) if span is None else span
    if state is None:
        x, y = INSIDE.get(str(scene.get("table")), INSIDE["cap"])
        vx, vy = draw.direction()
        state = {"t": 0.0, "x": x, "y": y, "vx": vx, "vy": vy, "wall": None}
    seq = draw.pick(range(1, 2**20))
    return {"cmd": "step", "seq": seq, "scene": dict(scene), "state": state, "t_end": state["t"] + span}


def _good(request: Data) -> Sample:
    return Sample(request, request)


def _one_of(request: Data, is_kept: bool) -> Sample:
    """Return a question that is good, or must be rejected."""
    return Sample(request, request if is_kept else None)


def _wave(draw: Draw, **changes: Any) -> Data:
    rate = draw.pick(({"omega": draw.short(0.5, 6.0)}, {"period": draw.pick(scenes.PERIODS)}))
    return {"kind": "fourier", "mean": 1.0, **rate, "cos": [0.05], "sin": [0.02], **changes}


def _legs(knots: list[list[float]]) -> Data:
    return {"kind": "bang-bang", "knots": knots}


def _any_table(draw: Draw) -> Data:
    return dict(draw.pick((CAP, STEM, MUSHROOM)))


def _further(draw: Draw, data: Mapping[str, Any], is_kept: bool) -> Data:
    """Return an object with one field more, unless the rule is to be kept."""
    name, value = draw.pick(FURTHER)
    return {**data} if is_kept else {**data, name: value}


# Scenes


@rule
def known_table(draw: Draw, is_kept: bool) -> Sample:
    """Name a table, or a word that is none."""
    scene = _any_table(draw)
    other = draw.pick(("disk", "Cap", "", "mushrooms"))
    return _one_of(_ask(draw, scene if is_kept else {**scene, "table": other}), is_kept)


@rule
def whole_scene(draw: Draw, is_kept: bool) -> Sample:
    """Leave out what may be left out, or what may not."""
    scene = {**_any_table(draw), "name": "a name"}
    due = [name for name in ("table", "r", "h") if name in scene]
    gone = "name" if is_kept else draw.pick(due)
    return _one_of(_ask(draw, {name: part for name, part in scene.items() if name != gone}), is_kept)


@rule
def scene_types(draw: Draw, is_kept: bool) -> Sample:
    """Give a law as a number or an object, or as something else."""
    scene = _any_table(draw)
    name = draw.pick([name for name in scene if name != "table"])
    others: tuple[Any, ...] = ("1.0", True, [1.0], {}, [], "r")
    bad = draw.pick(others)
    return _one_of(_ask(draw, scene if is_kept else {**scene, name: bad}), is_kept)


@rule
def one_mouth(draw: Draw, is_kept: bool) -> Sample:
    """Give w or nu, or both or neither."""
    either = draw.pick(({"w": 0.5}, {"nu": 0.5}))
    both = draw.pick(({"w": 0.5, "nu": 0.5}, {}))
    return _one_of(
        _ask(draw, {"table": "mushroom", "r": 1.0, "h": 1.0, **(either if is_kept else both)}), is_kept
    )


def _near(draw: Draw, bound: float, far: float, is_kept: bool) -> float | Data:
    """Return a law that comes as near to a bound as 2^-40, from far away, and passes it unless it is kept."""
    past = draw.power(-40, -2) * (far - bound) * (1.0 if is_kept else -1.0)
    if draw.pick((False, True)):
        return bound + past
    mean, size = (far + bound + past) / 2, (far - bound - past) / 2
    return _wave(draw, mean=mean, cos=[size * draw.pick((1.0, -1.0))], sin=[])


@rule
def sizes(draw: Draw, is_kept: bool) -> Sample:
    """Let a size come near to 0 from above, or reach below it."""
    table, name = draw.pick(((CAP, "r"), (STEM, "w"), (STEM, "h"), (MUSHROOM, "w"), (MUSHROOM, "h")))
    law = _near(draw, 0.0, 0.5, is_kept)
    x = draw.power(-60, -50) if is_kept else 0.0
    state = {"t": 0.0, "x": 0.0, "y": x if table is CAP else -x, "vx": 0.0, "vy": 0.0, "wall": None}
    return _one_of(_ask(draw, {**table, name: law}, state, 2.0**-200), is_kept)


@rule
def mouth_in_base(draw: Draw, is_kept: bool) -> Sample:
    """Let w come near to r from below, or reach above it; or nu to 1."""
    name = draw.pick(("w", "nu"))
    scene = {"table": "mushroom", "r": 1.0, "h": 1.0, name: _near(draw, 1.0, 0.25, is_kept)}
    return _one_of(_ask(draw, scene), is_kept)


@rule
def sides_apart(draw: Draw, is_kept: bool) -> Sample:
    """Let h slope come near to w from below, or reach above it."""
    table = draw.pick((STEM, MUSHROOM))
    steepest = table["w"] / table["h"]
    return _one_of(_ask(draw, {**table, "slope": _near(draw, steepest, -0.25, is_kept)}), is_kept)


@rule
def one_period(draw: Draw, is_kept: bool) -> Sample:
    """Give two laws periods that are equal, or differ by a part as small as 2^-44."""
    length = draw.pick((1.0, 2.0, 0.5))
    other = length if is_kept else length * (1.0 + draw.power(-44, 0))
    h = draw.pick(
        (
            {"kind": "fourier", "mean": 1.0, "period": other, "sin": [0.05]},
            _legs([[0.0, 1.0], [other / 2, 1.125], [other, 1.0]]),
        )
    )
    r = {"kind": "fourier", "mean": 1.0, "period": length, "cos": [0.05]}
    return _one_of(_ask(draw, {"table": "mushroom", "r": r, "w": 0.5, "h": h}), is_kept)


@rule
def known_scene_fields(draw: Draw, is_kept: bool) -> Sample:
    """Add a field that no table has, or one of another table."""
    scene = _any_table(draw)
    request = _ask(draw, scene)
    more = {**scene, "h": 1.0} if scene["table"] == "cap" and draw.pick((False, True)) else None
    return Sample({**request, "scene": scene if is_kept else more or _further(draw, scene, False)}, request)


@rule
def texts(draw: Draw, is_kept: bool) -> Sample:
    """Give a name or notes: text, or with control characters, or no text."""
    good, bad = ("", "Pilz \u00fc", "two\nlines\tand a tab", '"'), ("\x00", "a\x1bb", "\x7f", 5, True, [])
    request = _ask(draw, _any_table(draw))
    named = {**request["scene"], draw.pick(("name", "notes")): draw.pick(good if is_kept else bad)}
    return Sample({**request, "scene": named}, request)


@rule
def no_null(draw: Draw, is_kept: bool) -> Sample:
    """Leave out an optional field of a scene or a law, or say null."""
    cases = [
        *(({**STEM}, (), name) for name in ("slope", "name", "notes")),
        *(({**MUSHROOM}, (), name) for name in ("slope", "nu", "name")),
        *(({**CAP, "r": _wave(draw, sin=[0.01])}, ("r",), name) for name in ("cos", "sin")),
        ({**CAP, "r": {"kind": "fourier", "mean": 1.0, "omega": 2.0, "cos": [0.05]}}, ("r",), "period"),
        ({**CAP, "r": {"kind": "fourier", "mean": 1.0, "period": 2.0, "cos": [0.05]}}, ("r",), "omega"),
    ]
    scene, path, name = draw.pick(cases)
    holder = scene[path[0]] if path else scene
    absent = {key: part for key, part in holder.items() if key != name}
    null = {**holder, name: None}
    request = _ask(draw, {**scene, path[0]: absent} if path else absent)
    if is_kept:
        return _good(request)
    return Sample({**request, "scene": {**scene, path[0]: null} if path else null}, request)


# Laws


@rule
def known_kind(draw: Draw, is_kept: bool) -> Sample:
    """Name a kind of law, or a word that is none."""
    law = draw.pick((_wave(draw), _legs([[0.0, 1.0], [0.5, 1.25], [1.0, 1.0]])))
    other = draw.pick(("sawtooth", "Fourier", "", "constant"))
    return _one_of(_ask(draw, {**CAP, "r": law if is_kept else {**law, "kind": other}}), is_kept)


@rule
def one_rate(draw: Draw, is_kept: bool) -> Sample:
    """Give omega or period, or both or neither."""
    rates = draw.pick(({"omega": 2.0}, {"period": 2.0}) if is_kept else ({"omega": 2.0, "period": 2.0}, {}))
    law = {"kind": "fourier", "mean": 1.0, "cos": [0.05], **rates}
    return _one_of(_ask(draw, {**CAP, "r": law}), is_kept)


@rule
def positive_rate(draw: Draw, is_kept: bool) -> Sample:
    """Give an omega or a period of any size above 0, or 0 or less."""
    size = draw.power(-20, 20)
    law = {"kind": "fourier", "mean": 1.0, "cos": [0.05]}
    law[draw.pick(("omega", "period"))] = size if is_kept else draw.pick((0.0, -size, -0.0))
    return _one_of(_ask(draw, {**CAP, "r": law}), is_kept)


@rule
def harmonics(draw: Draw, is_kept: bool) -> Sample:
    """Give as many harmonics as are allowed, or one to some more, of which the last alone may count."""
    n = draw.pick((MAX_HARMONICS, MAX_HARMONICS - 1)) if is_kept else MAX_HARMONICS + draw.pick((1, 1, 2, 16))
    waves = [draw.pick((0.0, 0.01)) for _ in range(n - 1)] + [draw.pick((0.01, 0.0))]
    law = {**_wave(draw, cos=[], sin=[]), draw.pick(("cos", "sin")): waves}
    return _one_of(_ask(draw, {**CAP, "r": law}), is_kept)


@rule
def knots(draw: Draw, is_kept: bool) -> Sample:
    """Give the least or the greatest number of knots, or one less or more."""
    n = draw.pick((2, 3, MAX_KNOTS)) if is_kept else draw.pick((1, MAX_KNOTS + 1, MAX_KNOTS + 64))
    values = [1.0 + draw.pick((0.0, 0.125)) for _ in range(max(n - 2, 0))]
    law = _legs([[i / 256, value] for i, value in enumerate([1.0, *values, 1.0][:n] if n > 1 else [1.0])])
    return _one_of(_ask(draw, {**CAP, "r": law}), is_kept)


@rule
def rising_times(draw: Draw, is_kept: bool) -> Sample:
    """Let the times of knots increase by one ulp at least, or stand still or run back."""
    second = math.nextafter(0.5, 1.0) if is_kept else draw.pick((0.5, math.nextafter(0.5, 0.0), 0.25, -1.0))
    law = _legs([[0.0, 1.0], [0.5, 1.0], [second, 1.0], [1.0, 1.0]])
    return _one_of(_ask(draw, {**CAP, "r": law}), is_kept)


@rule
def closed_law(draw: Draw, is_kept: bool) -> Sample:
    """End a law at the value that it begins with, or off it by one ulp or more."""
    end = 1.0 if is_kept else draw.pick((math.nextafter(1.0, 2.0), 1.0 - draw.power(-30, -2)))
    return _one_of(_ask(draw, {**CAP, "r": _legs([[0.0, 1.0], [0.5, 1.125], [1.0, end]])}), is_kept)


@rule
def exact_period(draw: Draw, is_kept: bool) -> Sample:
    """Let the knots span a time that is a binary64 number, or not."""
    begin, end = draw.pick(
        ((0.25, 1.25), (-0.1, 0.1)) if is_kept else ((0.1, 1.1), (-0.1, 1.0), (1e-20, 1.0))
    )
    return _one_of(
        _ask(draw, {**CAP, "r": _legs([[begin, 1.0], [(begin + end) / 2, 1.125], [end, 1.0]])}), is_kept
    )


@rule
def known_law_fields(draw: Draw, is_kept: bool) -> Sample:
    """Add a field to a law."""
    law = draw.pick((_wave(draw), _legs([[0.0, 1.0], [0.5, 1.25], [1.0, 1.0]])))
    request = _ask(draw, {**CAP, "r": law})
    return Sample({**request, "scene": {**CAP, "r": _further(draw, law, is_kept)}}, request)


# States


@rule
def whole_state(draw: Draw, is_kept: bool) -> Sample:
    """Leave out the wall, or a number."""
    request = _ask(draw, _any_table(draw))
    gone = "wall" if is_kept else draw.pick(("t", "x", "y", "vx", "vy"))
    state = {name: part for name, part in request["state"].items() if name != gone}
    return _one_of({**request, "state": state}, is_kept)


@rule
def state_types(draw: Draw, is_kept: bool) -> Sample:
    """Give numbers, or something else in place of one."""
    request = _ask(draw, _any_table(draw))
    if is_kept:
        return _good(request)
    numbers: tuple[Any, ...] = ("0.0", True, None, [0.0], {})
    walls: tuple[Any, ...] = (1, True, ["arc"], {})
    name = draw.pick(("t", "x", "y", "vx", "vy", "wall"))
    bad = draw.pick(walls if name == "wall" else numbers)
    return Sample({**request, "state": {**request["state"], name: bad}}, None)


@rule
def known_wall(draw: Draw, is_kept: bool) -> Sample:
    """Name no wall, or a word that is none."""
    request = _ask(draw, _any_table(draw))
    wall = None if is_kept else draw.pick(("", "Arc", "top", "mouth", "null"))
    return _one_of({**request, "state": {**request["state"], "wall": wall}}, is_kept)


@rule
def own_wall(draw: Draw, is_kept: bool) -> Sample:
    """Name a wall of the table, or one of another table."""
    if is_kept:
        return _good(_leaving(draw, 0.0, 1.0))
    scene, walls = draw.pick(((CAP, ("left", "right", "floor")), (STEM, ("arc",))))
    request = _ask(draw, scene)
    return Sample({**request, "state": {**request["state"], "wall": draw.pick(walls)}}, None)


def _leaving(draw: Draw, off: float, lift: float, name: bool = True, walls: tuple[Wall, ...] = ()) -> Data:
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
    x, y = (x + by, y) if wall == "left" else (x - by, y) if wall == "right" else (x + by * nx, y + by * ny)
    away, along = lift - at.receding(wall, y), draw.pick((1.0, -1.0))
    state = State(t, x, y, away * nx - along * ny, away * ny + along * nx, wall if name else None)
    return _ask(
        draw, wire_form(of), {field: getattr(state, field) for field in State.__struct_fields__}, 2.0**-20
    )


def _size(at: TableAt, wall: Wall, x: float) -> float:
    """Return the size of a wall, as docs/protocol.md has it."""
    if wall in ("left", "right"):
        return max(float(at.w), abs(x))
    return float(at.h) if wall == "floor" else float(at.r) if wall == "arc" else float(max(at.r, at.w))


@rule
def inside(draw: Draw, is_kept: bool) -> Sample:
    """Start inside of a wall or beyond it, off it by 2^-18 to 2^-5 of its size, and at rest as it sees it."""
    off = draw.power(-18, -5) * (1.0 if is_kept else -1.0)
    return _one_of(_leaving(draw, off, draw.pick((1.0, 0.5)), name=False), is_kept)


@rule
def on_its_wall(draw: Draw, is_kept: bool) -> Sample:
    """Start off the wall that is named, by at most half of what is allowed, or by twice as much or more."""
    off = (draw.power(-30, -22) if is_kept else draw.power(-18, -6)) * draw.pick((1.0, -1.0))
    return _one_of(_leaving(draw, off, 1.0), is_kept)


@rule
def before_its_end(draw: Draw, is_kept: bool) -> Sample:
    """Start on the arc above y = 0 or below, or on a side below y = 0 or above."""
    past, side = draw.power(-10, -4), draw.pick((1.0, -1.0))
    turn = past if is_kept else -past
    if draw.pick((False, True)):
        x, y = side * math.cos(turn), math.sin(turn)
        state = {"t": 0.0, "x": x, "y": y, "vx": -side, "vy": 0.125, "wall": "arc"}
    else:
        wall = "right" if side > 0 else "left"
        state = {"t": 0.0, "x": side / 2, "y": -turn, "vx": -side, "vy": 0.125, "wall": wall}
    return _one_of(_ask(draw, MUSHROOM, state), is_kept)


@rule
def leaves_its_wall(draw: Draw, is_kept: bool) -> Sample:
    """Move away from the wall that is named, or into it, slowly or not."""
    return _one_of(_leaving(draw, 0.0, draw.power(-12, 0) * (1.0 if is_kept else -1.0)), is_kept)


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
    wall, side = draw.pick(walls), draw.pick((1.0, -1.0))
    wall = "left" if wall == "right" and side < 0 else wall
    return _ask(draw, scene, {"t": 0.0, "x": side * x, "y": y, "vx": vx, "vy": vy, "wall": wall})


@rule
def one_wall(draw: Draw, is_kept: bool) -> Sample:
    """Start on one wall, or where two meet, whichever way it moves."""
    return _good(_leaving(draw, 0.0, 1.0) if is_kept else _corner(draw))


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
    state = {"t": draw.pick((0.0, -2.5, 7.0)), "x": x, "y": y, "vx": way * vx, "vy": way * vy, "wall": wall}
    return _ask(draw, scene, state)


@rule
def lifts_off(draw: Draw, is_kept: bool) -> Sample:
    """Leave a wall, or move along it."""
    return _good(_leaving(draw, 0.0, draw.power(-12, 0)) if is_kept else _along(draw))


@rule
def early(draw: Draw, is_kept: bool) -> Sample:
    """Start one ulp before or at 2^30 periods, or up to 2^10 times as far, on either side of time 0."""
    laws = (1.0, _wave(draw), _legs([[0.0, 1.0], [0.5, 1.25], [1.5, 1.0]]))
    scene = {**CAP, "r": draw.pick(laws)}
    shared = period(of := from_data(scene))
    bound = LATE * (1.0 if shared is None else float(shared.length or 2 * math.pi / (shared.omega or 1.0)))
    while is_late(of, bound):
        bound = math.nextafter(bound, 0.0)
    while not is_late(of, math.nextafter(bound, math.inf)):
        bound = math.nextafter(bound, math.inf)
    t = bound if is_kept else math.nextafter(bound, math.inf) * draw.pick((1.0, 1.0, 2.0, 1024.0))
    t *= draw.pick((1.0, -1.0))
    state = {"t": t, "x": 0.125, "y": 0.25, "vx": 2.0**-20, "vy": -(2.0**-20), "wall": None}
    return _good({**_ask(draw, scene, state), "t_end": math.nextafter(t, math.inf)})


@rule
def small(draw: Draw, is_kept: bool) -> Sample:
    """Move at a speed just below 1e100, or at 1e100 or more."""
    speed = math.nextafter(1e100, 0.0) if is_kept else draw.pick((1e100, 1e101, 1e150))
    state = {"t": 0.0, "x": 0.125, "y": 0.25, "vx": draw.pick((1.0, -1.0)) * speed, "vy": 1.0, "wall": None}
    return _good(_ask(draw, _any_cap(draw), state, 2.0**-600))


def _any_cap(draw: Draw) -> Data:
    return dict(draw.pick((CAP, MUSHROOM)))


@rule
def known_state_fields(draw: Draw, is_kept: bool) -> Sample:
    """Add a field to a state."""
    request = _ask(draw, _any_table(draw))
    return Sample({**request, "state": _further(draw, request["state"], is_kept)}, request)


# Requests


@rule
def known_command(draw: Draw, is_kept: bool) -> Sample:
    """Give a command, or a word that is none."""
    request = _ask(draw, _any_table(draw))
    return _one_of(request if is_kept else {**request, "cmd": draw.pick(("dance", "Step", ""))}, is_kept)


@rule
def whole_request(draw: Draw, is_kept: bool) -> Sample:
    """Give all fields, or leave one out."""
    request, gone = _ask(draw, _any_table(draw)), draw.pick(("scene", "state", "t_end"))
    return _one_of(
        request if is_kept else {name: part for name, part in request.items() if name != gone}, is_kept
    )


@rule
def request_types(draw: Draw, is_kept: bool) -> Sample:
    """Give each field its type, or another to one."""
    request = _ask(draw, _any_table(draw))
    others: tuple[tuple[str, Any], ...] = (
        ("t_end", "soon"),
        ("t_end", None),
        ("state", []),
        ("state", None),
        ("scene", "cap"),
        ("scene", []),
    )
    name, bad = draw.pick(others)
    return _one_of(request if is_kept else {**request, name: bad}, is_kept)


@rule
def finite(draw: Draw, is_kept: bool) -> Sample:
    """Give the largest binary64 number, or one beyond."""
    request = _ask(draw, CAP, {"t": 0.0, "x": 0.125, "y": 0.25, "vx": 0.0, "vy": 0.0, "wall": None})
    if is_kept:
        return _good({**request, "t_end": math.nextafter(math.inf, 0.0)})
    place = draw.pick(("t_end", "vx", "r"))
    if place == "t_end":
        return Sample({**request, "t_end": math.inf}, None)
    part = "scene" if place == "r" else "state"
    return Sample({**request, part: {**request[part], place: draw.pick((math.inf, -math.inf))}}, None)


@rule
def sequence(draw: Draw, is_kept: bool) -> Sample:
    """Number a request by a whole number within bounds, or not."""
    good, bad = (0, 1, MAX_SEQ), (-1, 2.5, "1", None, True, MAX_SEQ + 2)
    return _one_of({**_ask(draw, _any_table(draw)), "seq": draw.pick(good if is_kept else bad)}, is_kept)


@rule
def counts(draw: Draw, is_kept: bool) -> Sample:
    """Ask for a whole number of collisions and repeats within bounds, or not."""
    request = _ask(draw, CAP)
    others: tuple[Any, ...] = (-1, 1.5, "1", None, True)
    bad = draw.pick(others)
    if draw.pick((False, True)):
        path = {**request, "cmd": "trajectory", "collisions": draw.pick((0, 1, 3)) if is_kept else bad}
        return _one_of(path, is_kept)
    timed = {name: part for name, part in request.items() if name != "t_end"} | {"cmd": "time"}
    numbers: Data = {"collisions": draw.pick((1, 3)), "repeat": draw.pick((1, 2))}
    if not is_kept:
        numbers[draw.pick(("collisions", "repeat"))] = draw.pick((0, bad))
    return _one_of({**timed, **numbers}, is_kept)


@rule
def end_not_before(draw: Draw, is_kept: bool) -> Sample:
    """End one ulp after the start, or one ulp or more before it."""
    t = draw.pick((0.5, -3.0, 1024.0)) * draw.between(1.0, 2.0)
    request = _ask(draw, _any_table(draw))
    later = math.nextafter(t, math.inf)
    before = draw.pick((math.nextafter(t, -math.inf), t - 5e-7, t - 1.0))
    return _one_of(
        {**request, "state": {**request["state"], "t": t}, "t_end": later if is_kept else before}, is_kept
    )


@rule
def time_left(draw: Draw, is_kept: bool) -> Sample:
    """End after the start, or at the start: inside, on a wall, along one, where two meet, in the mouth."""
    kind = draw.pick(("inside", "on a wall", "along a wall", "corner", "mouth", "early"))
    if is_kept or kind == "inside":
        request = _ask(draw, _any_table(draw))
    elif kind == "on a wall":
        request = _leaving(draw, 0.0, draw.power(-12, 0))
    elif kind == "mouth":
        vx, vy = draw.pick(((1.0, 1.0), (1.0, -1.0), (1.0, 0.0), (0.0, 0.0)))
        request = _ask(draw, MUSHROOM, {"t": 0.0, "x": 0.25, "y": 0.0, "vx": vx, "vy": vy, "wall": None})
    elif kind == "early":
        request = early(draw, True).request
    else:
        request = _corner(draw) if kind == "corner" else _along(draw)
    return _good(request if is_kept else {**request, "t_end": request["state"]["t"]})


@rule
def known_request_fields(draw: Draw, is_kept: bool) -> Sample:
    """Add a field to a request."""
    request = _ask(draw, _any_table(draw))
    return Sample(_further(draw, request, is_kept), request)


@rule
def fields_once(draw: Draw, is_kept: bool) -> Sample:
    """Give each field once, or one twice with the same value."""
    request = _ask(draw, _any_table(draw))
    if is_kept:
        return _good(request)
    name = draw.pick(("t_end", "seq"))
    field = f'"{name}": {json.dumps(request[name])}'
    return Sample(request, request, json.dumps(request).replace(field, f"{field}, {field}", 1))


# Answers


def _answered(draw: Draw, is_kept: bool, good: str, bad: tuple[tuple[str, str], ...]) -> Sample:
    """Return a particle at rest, and an answer: the right one, or with one text replaced by another."""
    state = {"t": 0.0, "x": 0.125, "y": 0.25, "vx": 0.0, "vy": 0.0, "wall": None}
    request = _ask(draw, CAP, state, BRIEF)
    own = '"outcome":"horizon","t":TEND,"x":0.125,"y":0.25,"vx":0.0,"vy":0.0'
    text = ("{" + f'"seq":{request["seq"]},' + own + good + "}").replace("TEND", repr(request["t_end"]))
    old, new = draw.pick(bad)
    return Sample(request, request, answer=text if is_kept else text.replace(old, new, 1))


@rule
def answer_fields_once(draw: Draw, is_kept: bool) -> Sample:
    """Answer with each field once, or with one twice: known or unknown, with equal values or not."""
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
def same_seq(draw: Draw, is_kept: bool) -> Sample:
    """Answer with the number of the request, or another."""
    return _answered(draw, is_kept, "", (('"seq":', '"seq":1'), ('"seq":', '"seq":-'), ('"seq":', '"SEQ":')))


@rule
def finite_answers(draw: Draw, is_kept: bool) -> Sample:
    """Answer with finite numbers, or with one beyond binary64, or none."""
    return _answered(draw, is_kept, "", (('"vx":0.0', '"vx":1e999'), ('"vx":0.0', '"vx":NaN')))


@rule
def capture_at_the_end(draw: Draw, is_kept: bool) -> Sample:
    """Answer a flow with a capture interval beside a horizon, or beside another outcome."""
    request = _ask(
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
    return Sample(request, request, answer=text)
