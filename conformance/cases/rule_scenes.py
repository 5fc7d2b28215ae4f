"""Good and bad questions for each rule about scenes and laws (`scene.protocol.rules`).

A function has the name of its rule with hyphens as underscores: (draw, is_kept) -> RuleCase. `rule`
enters it into DRAWS. `conformance.cases.rules` has the rules about states, requests and answers.
"""

import json
import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from conformance.cases import scenes
from conformance.cases.draw import Draw
from scene.laws import MAX_HARMONICS, MAX_KNOTS
from scene.protocol.rules import BY_NAME

Data = dict[str, Any]
CAP: Data = {"table": "cap", "r": 1.0}
STEM: Data = {"table": "stem", "w": 1.0, "h": 1.25}
MUSHROOM: Data = {"table": "mushroom", "r": 1.0, "w": 0.5, "h": 1.0}
INSIDE = {"cap": (0.125, 0.25), "stem": (0.125, -0.25), "mushroom": (0.125, 0.25)}
# Times in which a particle at INSIDE, with speed 1, meets no wall, and meets one.
BRIEF = 2.0**-12
LONG = 4.0
FURTHER: tuple[tuple[str, Any], ...] = (
    ("hint", 7.0),
    ("T", None),
    ("mass", {"unit": "kg"}),
    ("r2", []),
    ("V", True),
    ("Name", "x"),
)


class RuleCase(NamedTuple):
    """A question on one side of a rule.

    Attributes:
        request: a request of the protocol; for a rule of duty REJECT that is broken only `rejected`
            passes.
        as_read: the request whose right answer passes: this one, or the one without a field that
            may be ignored; None where only `rejected` passes.
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


Sides = Callable[[Draw, bool], RuleCase]
DRAWS: dict[str, Sides] = {}


def rule(function: Sides) -> Sides:
    """Enter a function into the table of draws, under the rule that has its name."""
    name = function.__name__.replace("_", "-")
    DRAWS[BY_NAME[name].name] = function
    return function


def ask(
    draw: Draw, scene: Mapping[str, Any], state: Data | None = None, span: float | None = None
) -> Data:
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
    return {
        "cmd": "step",
        "seq": seq,
        "scene": dict(scene),
        "state": state,
        "t_end": state["t"] + span,
    }


def good(request: Data) -> RuleCase:
    """Return a question that is good."""
    return RuleCase(request, request)


def one_of(request: Data, is_kept: bool) -> RuleCase:
    """Return a question that is good, or must be rejected."""
    return RuleCase(request, request if is_kept else None)


def wave(draw: Draw, **changes: Any) -> Data:
    """Draw a Fourier law close to 1, with some fields given."""
    rate = draw.pick(({"omega": draw.short(0.5, 6.0)}, {"period": draw.pick(scenes.PERIODS)}))
    return {"kind": "fourier", "mean": 1.0, **rate, "cos": [0.05], "sin": [0.02], **changes}


def legs(knots: list[list[float]]) -> Data:
    """Return a bang-bang law."""
    return {"kind": "bang-bang", "knots": knots}


def any_table(draw: Draw) -> Data:
    """Draw one of three tables at rest."""
    return dict(draw.pick((CAP, STEM, MUSHROOM)))


def further(draw: Draw, data: Mapping[str, Any], is_kept: bool) -> Data:
    """Return an object with one field more, unless the rule is to be kept."""
    name, value = draw.pick(FURTHER)
    return {**data} if is_kept else {**data, name: value}


# Scenes


@rule
def known_table(draw: Draw, is_kept: bool) -> RuleCase:
    """Name a table, or a word that is none."""
    scene = any_table(draw)
    other = draw.pick(("disk", "Cap", "", "mushrooms"))
    return one_of(ask(draw, scene if is_kept else {**scene, "table": other}), is_kept)


@rule
def whole_scene(draw: Draw, is_kept: bool) -> RuleCase:
    """Leave out what may be left out, or what may not."""
    scene = {**any_table(draw), "name": "a name"}
    due = [name for name in ("table", "r", "h") if name in scene]
    gone = "name" if is_kept else draw.pick(due)
    return one_of(ask(draw, {name: part for name, part in scene.items() if name != gone}), is_kept)


@rule
def scene_types(draw: Draw, is_kept: bool) -> RuleCase:
    """Give a law as a number or an object, or as something else."""
    scene = any_table(draw)
    name = draw.pick([name for name in scene if name != "table"])
    others: tuple[Any, ...] = ("1.0", True, [1.0], {}, [], "r")
    bad = draw.pick(others)
    return one_of(ask(draw, scene if is_kept else {**scene, name: bad}), is_kept)


@rule
def one_mouth(draw: Draw, is_kept: bool) -> RuleCase:
    """Give w or nu, or both or neither."""
    either = draw.pick(({"w": 0.5}, {"nu": 0.5}))
    both = draw.pick(({"w": 0.5, "nu": 0.5}, {}))
    return one_of(
        ask(draw, {"table": "mushroom", "r": 1.0, "h": 1.0, **(either if is_kept else both)}),
        is_kept,
    )


def _near(draw: Draw, bound: float, far: float, is_kept: bool) -> float | Data:
    """Return a law that comes as near to a bound as 2^-40, or passes it if it is not kept.

    Elsewhere it is far away from the bound.
    """
    past = draw.power(-40, -2) * (far - bound) * (1.0 if is_kept else -1.0)
    if draw.pick((False, True)):
        return bound + past
    mean = (far + bound + past) / 2
    size = (far - bound - past) / 2
    return wave(draw, mean=mean, cos=[size * draw.pick((1.0, -1.0))], sin=[])


@rule
def sizes(draw: Draw, is_kept: bool) -> RuleCase:
    """Let a size come near to 0 from above, or reach below it."""
    table, name = draw.pick(
        ((CAP, "r"), (STEM, "w"), (STEM, "h"), (MUSHROOM, "w"), (MUSHROOM, "h"))
    )
    law = _near(draw, 0.0, 0.5, is_kept)
    x = draw.power(-60, -50) if is_kept else 0.0
    state = {"t": 0.0, "x": 0.0, "y": x if table is CAP else -x, "vx": 0.0, "vy": 0.0, "wall": None}
    return one_of(ask(draw, {**table, name: law}, state, 2.0**-200), is_kept)


@rule
def mouth_in_base(draw: Draw, is_kept: bool) -> RuleCase:
    """Let w come near to r from below, or reach above it; or nu to 1."""
    name = draw.pick(("w", "nu"))
    scene = {"table": "mushroom", "r": 1.0, "h": 1.0, name: _near(draw, 1.0, 0.25, is_kept)}
    return one_of(ask(draw, scene), is_kept)


@rule
def sides_apart(draw: Draw, is_kept: bool) -> RuleCase:
    """Let h slope come near to w from below, or reach above it."""
    table = draw.pick((STEM, MUSHROOM))
    steepest = table["w"] / table["h"]
    return one_of(ask(draw, {**table, "slope": _near(draw, steepest, -0.25, is_kept)}), is_kept)


@rule
def one_period(draw: Draw, is_kept: bool) -> RuleCase:
    """Give two laws periods that are equal, or differ by a part as small as 2^-44."""
    length = draw.pick((1.0, 2.0, 0.5))
    other = length if is_kept else length * (1.0 + draw.power(-44, 0))
    h = draw.pick(
        (
            {"kind": "fourier", "mean": 1.0, "period": other, "sin": [0.05]},
            legs([[0.0, 1.0], [other / 2, 1.125], [other, 1.0]]),
        )
    )
    r = {"kind": "fourier", "mean": 1.0, "period": length, "cos": [0.05]}
    return one_of(ask(draw, {"table": "mushroom", "r": r, "w": 0.5, "h": h}), is_kept)


@rule
def known_scene_fields(draw: Draw, is_kept: bool) -> RuleCase:
    """Add a field that no table has, or one of another table."""
    scene = any_table(draw)
    request = ask(draw, scene)
    more = {**scene, "h": 1.0} if scene["table"] == "cap" and draw.pick((False, True)) else None
    return RuleCase(
        {**request, "scene": scene if is_kept else more or further(draw, scene, False)}, request
    )


@rule
def texts(draw: Draw, is_kept: bool) -> RuleCase:
    """Give a name or notes: text, or with control characters, or no text."""
    plain = ("", "Pilz \u00fc", "two\nlines\tand a tab", '"')
    bad: tuple[Any, ...] = ("\x00", "a\x1bb", "\x7f", 5, True, [])
    request = ask(draw, any_table(draw))
    named = {**request["scene"], draw.pick(("name", "notes")): draw.pick(plain if is_kept else bad)}
    return RuleCase({**request, "scene": named}, request)


@rule
def no_null(draw: Draw, is_kept: bool) -> RuleCase:
    """Leave out an optional field of a scene or a law, or say null."""
    cases = [
        *(({**STEM}, (), name) for name in ("slope", "name", "notes")),
        *(({**MUSHROOM}, (), name) for name in ("slope", "nu", "name")),
        *(({**CAP, "r": wave(draw, sin=[0.01])}, ("r",), name) for name in ("cos", "sin")),
        (
            {**CAP, "r": {"kind": "fourier", "mean": 1.0, "omega": 2.0, "cos": [0.05]}},
            ("r",),
            "period",
        ),
        (
            {**CAP, "r": {"kind": "fourier", "mean": 1.0, "period": 2.0, "cos": [0.05]}},
            ("r",),
            "omega",
        ),
    ]
    scene, path, name = draw.pick(cases)
    holder = scene[path[0]] if path else scene
    absent = {key: part for key, part in holder.items() if key != name}
    null = {**holder, name: None}
    request = ask(draw, {**scene, path[0]: absent} if path else absent)
    if is_kept:
        return good(request)
    return RuleCase({**request, "scene": {**scene, path[0]: null} if path else null}, request)


# Laws


@rule
def known_kind(draw: Draw, is_kept: bool) -> RuleCase:
    """Name a kind of law, or a word that is none."""
    law = draw.pick((wave(draw), legs([[0.0, 1.0], [0.5, 1.25], [1.0, 1.0]])))
    other = draw.pick(("sawtooth", "Fourier", "", "constant"))
    return one_of(ask(draw, {**CAP, "r": law if is_kept else {**law, "kind": other}}), is_kept)


@rule
def one_rate(draw: Draw, is_kept: bool) -> RuleCase:
    """Give omega or period, or both or neither."""
    rates = draw.pick(
        ({"omega": 2.0}, {"period": 2.0}) if is_kept else ({"omega": 2.0, "period": 2.0}, {})
    )
    law = {"kind": "fourier", "mean": 1.0, "cos": [0.05], **rates}
    return one_of(ask(draw, {**CAP, "r": law}), is_kept)


@rule
def positive_rate(draw: Draw, is_kept: bool) -> RuleCase:
    """Give an omega or a period of any size above 0, or 0 or less."""
    size = draw.power(-20, 20)
    law = {"kind": "fourier", "mean": 1.0, "cos": [0.05]}
    law[draw.pick(("omega", "period"))] = size if is_kept else draw.pick((0.0, -size, -0.0))
    return one_of(ask(draw, {**CAP, "r": law}), is_kept)


@rule
def harmonics(draw: Draw, is_kept: bool) -> RuleCase:
    """Give as many harmonics as are allowed, or some more.

    The last one alone may count.
    """
    n = (
        draw.pick((MAX_HARMONICS, MAX_HARMONICS - 1))
        if is_kept
        else MAX_HARMONICS + draw.pick((1, 1, 2, 16))
    )
    waves = [draw.pick((0.0, 0.01)) for _ in range(n - 1)] + [draw.pick((0.01, 0.0))]
    law = {**wave(draw, cos=[], sin=[]), draw.pick(("cos", "sin")): waves}
    return one_of(ask(draw, {**CAP, "r": law}), is_kept)


@rule
def knots(draw: Draw, is_kept: bool) -> RuleCase:
    """Give the least or the greatest number of knots, or one less or more."""
    n = draw.pick((2, 3, MAX_KNOTS)) if is_kept else draw.pick((1, MAX_KNOTS + 1, MAX_KNOTS + 64))
    values = [1.0 + draw.pick((0.0, 0.125)) for _ in range(max(n - 2, 0))]
    law = legs(
        [[i / 256, value] for i, value in enumerate([1.0, *values, 1.0][:n] if n > 1 else [1.0])]
    )
    return one_of(ask(draw, {**CAP, "r": law}), is_kept)


@rule
def rising_times(draw: Draw, is_kept: bool) -> RuleCase:
    """Let the times of knots increase by one ulp at least, or stand still or run back."""
    second = (
        math.nextafter(0.5, 1.0)
        if is_kept
        else draw.pick((0.5, math.nextafter(0.5, 0.0), 0.25, -1.0))
    )
    law = legs([[0.0, 1.0], [0.5, 1.0], [second, 1.0], [1.0, 1.0]])
    return one_of(ask(draw, {**CAP, "r": law}), is_kept)


@rule
def closed_law(draw: Draw, is_kept: bool) -> RuleCase:
    """End a law at the value that it begins with, or off it by one ulp or more."""
    end = 1.0 if is_kept else draw.pick((math.nextafter(1.0, 2.0), 1.0 - draw.power(-30, -2)))
    return one_of(ask(draw, {**CAP, "r": legs([[0.0, 1.0], [0.5, 1.125], [1.0, end]])}), is_kept)


@rule
def exact_period(draw: Draw, is_kept: bool) -> RuleCase:
    """Let the knots span a time that is a binary64 number, or not."""
    begin, end = draw.pick(
        ((0.25, 1.25), (-0.1, 0.1)) if is_kept else ((0.1, 1.1), (-0.1, 1.0), (1e-20, 1.0))
    )
    return one_of(
        ask(draw, {**CAP, "r": legs([[begin, 1.0], [(begin + end) / 2, 1.125], [end, 1.0]])}),
        is_kept,
    )


@rule
def known_law_fields(draw: Draw, is_kept: bool) -> RuleCase:
    """Add a field to a law."""
    law = draw.pick((wave(draw), legs([[0.0, 1.0], [0.5, 1.25], [1.0, 1.0]])))
    request = ask(draw, {**CAP, "r": law})
    return RuleCase({**request, "scene": {**CAP, "r": further(draw, law, is_kept)}}, request)
