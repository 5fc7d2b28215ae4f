"""One question in many forms: it means the same however its JSON is written, and whatever was asked before.

What is optional may be left out. Answers are compared to rounding: the last bit of an honest implementation
may vary from run to run.
"""

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from decimal import Decimal
from typing import Any

from msgspec.structs import replace

from conformance.cases.draw import Draw
from conformance.suite.checks.bad_input import RESTING
from conformance.suite.checks.form import FOREVER, Implementation, Question, octaves
from conformance.suite.checks.path_judge import answered_distance
from conformance.suite.checks.paths import draw_start
from conformance.suite.process import CheckFailure
from conformance.suite.session import outcomes_of, with_walls
from conformance.vectors import question
from scene import Mushroom, Scene, State, Stem

MAX_LINE = 2**20  # bytes of a request
ROUNDING, CARRIED = 2.0**-44, 2.0**-40  # of sizes: of a step, and of more
N_SPELLINGS, N_AFTER, N_HITS = 16, 4, 2
HINT = '"hint":7.0,'  # a field that the protocol does not know
# What is written further, and before which key.
FURTHER = {
    "request": (HINT, '"cmd"'),
    "scene": (HINT, '"table"'),
    "state": (HINT, '"t"'),
    "law": (HINT, '"mean"'),
    "twice": ('"t_end":0.0,', '"t_end"'),
}
TEXTS = (
    "a name",
    'of "quotes" \\ and / signs',
    "Pilz \u00fc\u00df",
    "\u30ad\u30ce\u30b3 \U0001f344",
    '{"r":2.0}',
    "",
)
# Lines that are no requests, and the seq that can be read in them.
MALFORMED: tuple[tuple[bytes, int | None], ...] = (
    (b"what?", None),
    (b'{"cmd":"step","seq":1', None),
    (b"[1,2]", None),
    (b"5", None),
    (b"null", None),
    (b'"stop"', None),
    (b"{}", None),
    (b'{"seq":2}', 2),
    (b'{"cmd":"dance","seq":3}', 3),
    (b'{"cmd":"step","seq":4}', 4),
    (b'{"cmd":"step","seq":5,"scene":{},"state":[],"t_end":"soon"}', 5),
)


def _one(draw: Draw, profile: str) -> tuple[Scene, State, dict[str, Any]]:
    scene, state = draw_start(draw, t=float(draw.pick(range(4))))  # whole numbers may lack a point
    span = scene.period or 1.0
    t_end = state.t + span * draw.between(0.05, 0.5) if profile == "flow" else FOREVER
    return scene, state, question(profile, scene, state, t_end, N_HITS)


def spellings(draw: Draw, profile: str) -> Iterator[Question]:
    """Write a question in ways of many kinds, with texts of many kinds, on lines of all lengths."""
    for i, length in enumerate([*octaves(draw, 2, MAX_LINE), *[2.0] * N_SPELLINGS]):
        scene, state, request = _one(draw, profile)
        named = {**request["scene"], "name": TEXTS[i % len(TEXTS)], "notes": "\u00e9" * int(length / 2)}
        if draw.pick((False, True)):
            named = {name: part for name, part in named.items() if part != 0.0 or name != "slope"}
        yield scene, state, request, _written(draw, {**request, "scene": named})


def same(side: Implementation, scene: Scene, state: State, request: Mapping[str, Any], line: str) -> bool:
    """Hold a line to be answered as the request is."""
    return _agree(side, scene, state, request, side.said(line), repr(line[:400]))


def bad_lines(draw: Draw, profile: str) -> Iterator[Question]:
    """Send lines that are no requests, and questions after each."""
    scene, state, request = _one(draw, profile)
    asked = []
    for _ in range(N_AFTER):
        start = replace(state, vx=state.vx * draw.between(0.5, 1.0), vy=state.vy * draw.between(0.5, 1.0))
        asked.append((start, question(profile, scene, start, request["t_end"])))
    yield scene, asked


def passed_over(side: Implementation, scene: Scene, asked: Sequence[tuple[State, Mapping[str, Any]]]) -> bool:
    """Hold lines that are no requests to be refused, and what comes after them to be answered as before."""
    before = [side.session.ask(request) for _, request in asked]
    for line, seq in MALFORMED:
        text = line.decode()
        try:
            refusal = side.session.say(line, seq)
            assert refusal.get("outcome") == "rejected", f"{text}: answered {refusal}, must be rejected"
            for (state, request), answer in zip(asked, before, strict=True):
                _agree(side, scene, state, request, answer, f"before {text}")
        except CheckFailure as failure:
            raise CheckFailure(failure.verdict, f"{text}: {failure.why}") from None
    return True


def further_fields(draw: Draw, profile: str) -> Iterator[Question]:
    """Add a field that the protocol does not know, and write one twice."""
    for place in FURTHER:
        scene, state, request = _one(draw, profile)
        yield scene, state, request, place


def ignored_or_refused(
    side: Implementation, scene: Scene, state: State, request: dict[str, Any], place: str
) -> bool:
    """Hold a further field to change nothing, or to be refused."""
    more, key = FURTHER[place]
    answer = side.said(json.dumps({**request, "seq": "SEQ"}).replace(key, more + key))
    if [part["outcome"] for part in outcomes_of(answer)] == ["rejected"]:
        return True
    return _agree(side, scene, state, request, answer, f"with a further field in the {place}")


def zeros(draw: Draw, profile: str) -> Iterator[Question]:
    """Begin at y = 0.0, and at y = -0.0, on the base or in the open mouth."""
    for scene in RESTING:
        for vy in (0.75, -0.75):
            if isinstance(scene, Mushroom) or (vy < 0) == isinstance(scene, Stem):
                start = State(
                    0.0,
                    0.4 * draw.part(),
                    0.0,
                    draw.part(),
                    vy,
                    None if isinstance(scene, Mushroom) else "base",
                )
                request = question(
                    profile, scene, start, draw.between(0.1, 0.5) if profile == "flow" else 10.0
                )
                yield (
                    scene,
                    start,
                    request,
                    json.dumps({**request, "seq": "SEQ"}).replace('"y": 0.0', '"y": -0.0'),
                )


def _agree(
    side: Implementation,
    scene: Scene,
    state: State,
    request: Mapping[str, Any],
    answer: Mapping[str, Any],
    how: str,
) -> bool:
    """Hold an answer to a question in another form to the answer to itself, to rounding."""
    own = side.parts(request)
    found = outcomes_of(with_walls({**answer}, request["scene"]))
    if "error" in answer:
        raise CheckFailure("error", f"{answer['error']}: {how}")
    is_open = "undecided" in [part["outcome"] for part in (*found, *own)]  # a path may end there
    assert is_open or len(found) == len(own), f"{found}, must be {own}: {how}"
    n_compared = 0
    for one, other in zip(found, own, strict=not is_open):
        if "undecided" in (one["outcome"], other["outcome"]):
            continue
        allowed = ROUNDING if side.profile == "step" else CARRIED
        assert answered_distance(scene, one, other, state.t) <= allowed, f"{one}, must be {other}: {how}"
        n_compared += "x" in other
    return bool(n_compared)


def _written(draw: Draw, request: Mapping[str, Any]) -> str:
    """Write a request as JSON in a drawn way: order, blanks, numbers, escapes."""
    blanks = draw.pick(("", " ", "\t "))
    escape, is_short = draw.pick((False, True)), draw.pick((False, True))
    styles: tuple[Callable[[float], str], ...] = (
        repr,
        lambda x: f"{x:.16e}",
        lambda x: f"{x:.16E}",
        lambda x: f"{Decimal(x):f}",
        lambda x: (
            str(int(x))
            if x == int(x) and abs(x) < 2**53 and math.copysign(1, x) * x == abs(x) and x
            else repr(x)
        ),
        lambda x: repr(x).replace("e", "E"),
    )

    def write(part: Any) -> str:
        if isinstance(part, Mapping):
            # What is optional may be left out: a wall that is null.
            names = [name for name in part if not (is_short and part[name] is None)]
            names = [names.pop(draw.pick(range(len(names)))) for _ in range(len(names))]
            pairs = [f"{text(name)}{blanks}:{blanks}{write(part[name])}" for name in names]
            return "{" + blanks + f"{blanks},{blanks}".join(pairs) + blanks + "}"
        if isinstance(part, list | tuple):
            return "[" + f"{blanks},".join(map(write, part)) + "]"
        if isinstance(part, float):
            return draw.pick(styles)(part)
        return text(part) if isinstance(part, str) else json.dumps(part)

    def text(part: str) -> str:
        written = json.dumps(part, ensure_ascii=escape)
        return (
            written.replace("a", "\\u0061").replace("/", "\\/") if escape and "\\" not in written else written
        )

    return blanks + write({**request, "seq": "SEQ"})
