"""Bad requests, states and scenes, each to be refused; and sound ones as near to them, which must not be.

Requests are broken in every way that the JSON Schema of the protocol forbids, one fault at a time: each
required field is left out, each value is replaced by one of every type that it may not have, a number by one
out of its range, a word by one that is none; of two fields of which one is due, both are given. States lie
beyond a wall, off the wall that they name, past its end, or move into it, by drawn amounts of at least 8
times what is allowed. Scenes break a drawn law for a drawn share of the period, down to one in MOST_SAMPLES;
their twins come as near to it from the other side, and must not be refused.
"""

import json
from collections.abc import Callable, Iterator, Mapping
from functools import cache, partial
from math import cos, inf, pi, sin, sqrt
from typing import Any

from mpmath import fp
from msgspec.structs import replace

from conformance.cases import scenes
from conformance.cases.draw import Draw, wire_form
from conformance.suite.checks.form import Implementation, Question, octaves
from conformance.suite.session import outcomes_of
from conformance.vectors import question
from scene import BangBang, Cap, Fourier, Mushroom, Scene, State, Stem, Wall
from scene.geometry import TableAt, table_at
from scene.protocol.messages import json_schema

MOST_SAMPLES = 400  # an implementation that looks at so many instants of a period finds every broken scene
OFF = 2.0**-17  # of a wall's size: how far off the wall that it names a state is at least; 2^-20 is allowed
ALLOWED = 2.0**-21  # likewise, at most
UNEQUAL = 2.0**-44  # relative: periods that differ by more are different
INSIDE: dict[type, State] = {
    Mushroom: State(0.0, 0.1, 0.3, 0.4, -0.9),
    Cap: State(0.0, 0.1, 0.3, 0.4, 0.9),
    Stem: State(0.0, 0.1, -0.3, 0.4, -0.9),
}
TABLES: dict[str, type] = {"cap": Cap, "stem": Stem, "mushroom": Mushroom}
RESTING: tuple[Scene, ...] = (Cap(r=1.0), Stem(w=1.0, h=1.25), Mushroom(r=1.0, w=0.5, h=1.0))
_WAVE = Fourier(mean=1.0, omega=1.0, cos=(0.05, 0.02), sin=(0.01,))
_LEGS = BangBang(knots=((0.0, 1.0), (0.5, 1.25), (1.5, 0.875), (3.0, 1.0)))
ASKED: tuple[Scene, ...] = (
    Mushroom(r=_WAVE, w=0.5, h=1.0, slope=0.1, name="a name"),
    Stem(w=_LEGS, h=1.25),
    Cap(r=replace(_WAVE, omega=None, period=4.0)),
)

OTHERS: dict[str, Any] = {
    "null": None,
    "boolean": True,
    "string": "1.0",
    "array": [1.0],
    "object": {},
    "number": 5.5,
}
MEANINGLESS = ("name", "notes")
OWN = ("cmd", "seq", "table", "kind")  # by which the rest is found: left out or unknown, not of another type


def bad_requests(draw: Draw, profile: str) -> Iterator[Question]:
    """Break requests in all ways that the schema forbids; the first is sound."""
    for scene in ASKED:
        state = INSIDE[type(scene)]
        sound = question(profile, wire_form(scene), state, 0.5)
        yield scene, sound, ""
        form = {"$ref": f"#/$defs/{profile.capitalize()}"}
        for request, why in _broken(form, sound, ""):
            yield scene, request, why


def refuse(side: Implementation, scene: Scene, request: Mapping[str, Any], why: str) -> bool:
    """Hold a bad request to be refused as a whole, or in its only state; and a sound one not to be."""
    line = json.dumps({**request, "seq": "SEQ"}).replace("Infinity", "1e999")
    answer = side.said(line)
    outcomes = [part.get("outcome", "error") for part in outcomes_of(answer)]
    side.answers.add(request, ["undecided" if "undecided" in outcomes else "decided"])
    if why:
        assert {*outcomes, "rejected"} == {"rejected"} or outcomes == ["undecided"], (
            f"{why}, is answered {answer}: {line}"
        )
    else:
        assert "rejected" not in outcomes, f"a sound question is answered {answer}: {line}"
    return True


@cache
def _schema() -> dict[str, Any]:
    return json_schema()["$defs"]  # type: ignore[no-any-return]


def _broken(schema: Mapping[str, Any], value: Any, where: str) -> Iterator[tuple[Any, str]]:
    """Break a value that fits a schema in every way that this forbids; yield each fault with what it is."""
    forms = list(_forms(schema))
    own = next((form for form in forms if _fits(form, value)), {})
    if not where.endswith(OWN):
        kinds = {kind for form in forms for kind in _kinds(form)}
        yield from (
            (other, f"{where} is {other!r}") for kind, other in OTHERS.items() if where and kind not in kinds
        )
    if "integer" in _kinds(own):
        yield 2.5, f"{where} = 2.5"
        yield -1, f"{where} = -1"
    if "number" in _kinds(own):
        yield inf, f"{where} is beyond binary64"
    if "enum" in own:
        yield "nowhere", f"{where} is 'nowhere'"
    if isinstance(value, Mapping):
        for name, part in own.get("properties", {}).items():
            if name in value and name not in MEANINGLESS:
                is_due = name in own.get("required", ())
                for changed, why in _broken(part, value[name], f"{where}.{name}".lstrip(".")):
                    if is_due or changed is not None:  # null may stand for what is optional
                        yield {**value, name: changed}, why
                if name in own.get("required", ()) or {"required": [name]} in own.get("oneOf", ()):
                    yield (
                        {key: one for key, one in value.items() if key != name},
                        f"{where}.{name} is missing".lstrip("."),
                    )
            elif name not in value and {"required": [name]} in own.get("oneOf", ()):
                yield {**value, name: 1.0}, f"{where} has {name} too".lstrip(".")
    if isinstance(value, list | tuple) and value:
        items = own.get("prefixItems", [own.get("items")] * len(value))
        for i, (part, one) in enumerate(zip(items, value, strict=False)):
            for changed, why in _broken(part, one, f"{where}[{i}]") if i < 2 else ():
                yield [*value[:i], changed, *value[i + 1 :]], why
        if "minItems" in own:
            yield value[:-1], f"{where} is too short"


def _forms(schema: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """Return the alternatives of a schema, references resolved."""
    if "$ref" in schema:
        yield from _forms(_schema()[schema["$ref"].rpartition("/")[2]])
    elif "anyOf" in schema:
        for form in schema["anyOf"]:
            yield from _forms(form)
    else:
        yield schema


def _kinds(form: Mapping[str, Any]) -> set[str]:
    """Return the JSON types that a form admits."""
    if "enum" in form:
        return {"string"}
    kinds = form.get("type", ())
    return {"number", "integer"} & {kinds} | {kinds} if isinstance(kinds, str) else set(kinds)


def _fits(form: Mapping[str, Any], value: Any) -> bool:
    """Tell whether a value is meant by a form: its type, and of objects the tag."""
    types = {type(None): "null", bool: "boolean", int: "integer", float: "number", str: "string"}
    kind = types.get(type(value), "object" if isinstance(value, Mapping) else "array")
    tags = [(name, part["enum"]) for name, part in form.get("properties", {}).items() if "enum" in part]
    is_meant = kind != "object" or all(value.get(name, words[0]) in words for name, words in tags)
    return (kind in _kinds(form) or (kind == "integer" and "number" in _kinds(form))) and is_meant


def bad_states(draw: Draw, profile: str) -> Iterator[Question]:
    """Put states beyond walls, off them, past their ends, and into them, and others as near that are good."""
    moving = [scenes.scene(draw, table, scenes.clock(draw, ("fourier", "bang-bang"))) for table in TABLES]
    for scene in (*RESTING, *moving):
        t = 3.0 * draw.part()
        for state, why in states(draw, scene, t):
            t_end = t + draw.pick((0.0, 2.0**-6)) if profile != "trajectory" else t + 1.0
            yield scene, question(profile, scene, state, t_end), why and f"{state} {why}"
        late = replace(INSIDE[type(scene)], t=t + 1.0)
        if scene in RESTING:
            yield scene, question(profile, scene, late, t), f"{late} begins after t_end"


def states(draw: Draw, scene: Scene, t: float) -> Iterator[tuple[State, str]]:
    """Make bad states and good ones of every wall of a table at one time, and say what is bad."""
    table = table_at(fp, scene, t)

    def leaving(wall: Wall, place: tuple[float, float], part: float, named: Wall | None) -> State:
        # Along the wall with speed 1, and off it by a part of that, as seen from it.
        nx, ny = table.normal(wall, *place)
        off, way = part - table.receding(wall, place[1]), draw.pick((1.0, -1.0))
        return State(t, float(place[0]), float(place[1]), off * nx - way * ny, off * ny + way * nx, named)

    for wall in scene.walls:
        x, y = _place(draw, table, wall)
        for part in octaves(draw, 2.0**-18, 2.0**-4):
            yield (
                leaving(wall, move_inwards(table, wall, x, y, -part), draw.pick((1.0, -1.0)), None),
                f"is beyond {wall}",
            )
        for part in octaves(draw, OFF, 2.0**-6):
            place = move_inwards(table, wall, x, y, draw.pick((part, -part)))
            yield leaving(wall, place, 1.0, wall), "is not on its wall"
        for part in octaves(draw, ALLOWED / 16, ALLOWED):
            yield leaving(wall, move_inwards(table, wall, x, y, draw.pick((part, -part))), 1.0, wall), ""
        for part in octaves(draw, 2.0**-12, 0.5):
            yield leaving(wall, (x, y), -part, wall), "moves into its wall"
            yield leaving(wall, (x, y), part, wall), ""
        for place in _past_the_end(draw, table, wall):
            yield leaving(wall, place, 1.0, wall), "is where its wall has ended"
    place = _place(draw, table, "base")
    yield leaving("base", place, draw.between(0.1, 0.9), None), ""
    yield leaving("base", place, -draw.between(0.1, 0.9), None), "moves into the base that it is on"
    for up in octaves(draw, 2.0**-12, 0.5) if isinstance(scene, Mushroom) else ():
        mouth = draw.between(-0.95, 0.95) * float(table.w), 0.0
        yield leaving("base", mouth, up, "base"), ""
        yield leaving("base", mouth, -up, "base"), "moves into its wall"


def _place(draw: Draw, table: TableAt, wall: Wall) -> tuple[float, float]:
    """Return a point of a wall, away from its ends."""
    if wall == "arc":
        turn = draw.between(0.5, 2.5)
        return float(table.r) * cos(turn), float(table.r) * sin(turn)
    if wall == "base":
        ends = {Cap: (0.0, table.r), Stem: (0.0, table.w), Mushroom: (table.w, table.r)}[type(table.scene)]
        return float(ends[0] + draw.between(0.3, 0.7) * (ends[1] - ends[0])), 0.0
    x, y = table.stem_point(wall, draw.between(-0.7, 0.7), draw.between(0.3, 0.7))
    return float(x), float(y)


def move_inwards(table: TableAt, wall: Wall, x: float, y: float, part: float) -> tuple[float, float]:
    """Move a point of a wall inwards by a part of the wall's size, as docs/protocol.md measures it."""
    if wall == "arc":
        return x * (1.0 - part), y * (1.0 - part)
    if wall in ("left", "right"):
        size = max(float(table.w), abs(x))
        return x + (part * size if wall == "left" else -part * size), y
    size = float(table.h) if wall == "floor" else float(max(table.r, table.w))
    return x, y + part * size * table.normal(wall, x, y)[1]


def _past_the_end(draw: Draw, table: TableAt, wall: Wall) -> Iterator[tuple[float, float]]:
    """Return places where a wall's f is 0, and which lie past the wall's ends."""
    r, w, h = float(table.r), float(table.w), float(table.h)
    side = draw.pick((1.0, -1.0))
    for part in octaves(draw, 2.0**-10, 2.0**-4):
        if wall == "arc":
            yield side * r * cos(part), -r * sin(part)
        elif wall == "base":
            yield side * (w if isinstance(table.scene, Stem) else r) * (1.0 + part), 0.0
        elif wall == "floor":
            yield side * float(table.half_width(-table.h)) * (1.0 + part), -h
        else:
            y = draw.pick((-h * (1.0 + part), h * part))
            yield float(table.half_width(y)) * (-1.0 if wall == "left" else 1.0), y
    if wall == "arc" and isinstance(table.scene, Mushroom) and (y := -sqrt(r * r - w * w / 16)) > -h:
        yield w / 4, y  # within the stem, where the circle goes on


Kind = Callable[[float, float], dict[str, Any]]  # (its bound, its value far from there) -> law


def bad_scenes(draw: Draw, profile: str) -> Iterator[Question]:
    """Break each condition of a scene for a drawn share of the period, and come as near to it without."""
    for share in octaves(draw, 1.0 / MOST_SAMPLES, 0.25):
        make, at = draw.pick((_wave, _legs)), draw.part()
        for off, why in ((1.0, f"a law is broken for {share:.3g} of the period"), (-1.0, "")):
            law = partial(make, share=share, at=at, off=off)
            for data in _at_their_bounds(law):
                yield _asked_soon(profile, data, why, at - 0.5)
            # Apart at all times, though their ranges are not.
            sound = {"table": "mushroom", "r": law(1.25, 0.75), "w": law(1.2, 0.7), "h": 1.0}
            yield _asked_soon(profile, sound, "", at - 0.5)
    for apart in octaves(draw, UNEQUAL, 1.0):
        yield _asked_soon(profile, _of_two_periods(draw, apart), f"periods differ by {apart:.3g}")
    yield _asked_soon(profile, _of_two_periods(draw, 0.0), "")
    jump, back = [[0.0, 1.0], [0.5, 1.25], [1.0, 1.5]], [[0.0, 1.0], [0.75, 1.25], [0.5, 1.0]]
    for knots, why in ((jump, "a law jumps"), (back, "a law's time runs back")):
        yield _asked_soon(profile, {"table": "cap", "r": {"kind": "bang-bang", "knots": knots}}, why)
    sound = {"table": "mushroom", "r": 1.0, "w": 0.5, "h": 1.0}
    yield _asked_soon(profile, {**sound, "nu": 0.5}, "both w and nu are given")
    yield _asked_soon(profile, {"table": "mushroom", "r": 1.0, "h": 1.0}, "w is missing")
    for near in octaves(draw, 2.0**-40, 0.5):
        for name, value in (
            ("w", 1.0 + near),
            ("r", 0.5 - near / 2),
            ("slope", 0.5 + near),
            ("h", -near),
            ("w", 0.0),
        ):
            yield _asked_soon(profile, {**sound, name: value}, f"{name} = {value!r}")
        yield _asked_soon(profile, {**sound, "w": 1.0 - near, "slope": (1.0 - near) * (1.0 - near)}, "")
    yield _asked_soon(profile, {**sound, "w": 1.0}, "")


def _asked_soon(profile: str, data: dict[str, Any], why: str, t: float = 0.0) -> Question:
    """Ask about a start in a scene, up to a time before which nothing is met."""
    start = replace(INSIDE[TABLES[data["table"]]], t=t)
    return data, question(profile, data, start, t + 2.0**-12), why


def _wave(bound: float, far: float, share: float, at: float, off: float) -> dict[str, Any]:
    """Return a wave that passes a bound for a share of its period, or comes as near (off = -1)."""
    size = (far - bound) / 2
    mean = bound + size - off * size * (1.0 - cos(pi * share))
    cosine, sine = -size * cos(2 * pi * at), -size * sin(2 * pi * at)
    return {"kind": "fourier", "mean": mean, "period": 1.0, "cos": [cosine], "sin": [sine]}


def _legs(bound: float, far: float, share: float, at: float, off: float) -> dict[str, Any]:
    """Return legs that do likewise: near a knot a leg is a parabola."""
    past = off * 2 * (far - bound) * share**2
    return {"kind": "bang-bang", "knots": [[at - 0.5, far], [at, bound - past], [at + 0.5, far]]}


def _at_their_bounds(law: Kind) -> Iterator[dict[str, Any]]:
    """Return scenes of which one law comes to its bound, or passes it."""
    stem = {"table": "stem", "w": 1.0, "h": 1.25}
    mushroom, by_nu = ({"table": "mushroom", "r": 1.0, name: 0.5, "h": 1.0} for name in ("w", "nu"))
    for table, name, bound, far in (
        ({"table": "cap"}, "r", 0.0, 1.0),
        (stem, "w", 0.0, 0.75),
        (mushroom, "h", 0.0, 1.0),
        (by_nu, "nu", 0.0, 0.75),
        (by_nu, "nu", 1.0, 0.25),
        (mushroom, "w", 1.0, 0.25),
        (mushroom, "r", 0.5, 1.0),
        (stem, "slope", 0.8, -0.25),
        (mushroom, "slope", 0.5, -0.25),
        ({**stem, "slope": 0.4}, "h", 2.5, 1.0),
        ({**by_nu, "slope": 0.25}, "r", 0.5, 1.0),
    ):
        yield {**table, name: law(bound, far)}


def _of_two_periods(draw: Draw, apart: float) -> dict[str, Any]:
    """Return a scene whose laws have periods that differ by a part."""
    period = draw.pick((1.0, 2.0)) * (1.0 + apart)
    wave = {"kind": "fourier", "mean": 1.0, "period": period / (1.0 + apart), "cos": [0.05]}
    other = draw.pick(
        (
            {**wave, "period": period},
            {"kind": "bang-bang", "knots": [[0.0, 1.0], [period / 2, 1.1], [period, 1.0]]},
        )
    )
    return {"table": "mushroom", "r": wave, "w": 0.5, "h": other}
