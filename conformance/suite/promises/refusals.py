"""The promise that no state is let through which docs/protocol.md says is `rejected`.

Bad states lie outside their table, near a wall or far beyond it; or name a wall and lie off it, lie where
another wall has ended it, or move into it, though slowly. All are made of the table's own geometry, at rest
and moving, and are bad by a margin that no rounding bridges: 8 times what a place may be off its wall, and
more. In the open mouth a state that names the base is good when it rises, and bad when it sinks, and so is
one beside the mouth that names no wall. Every
command that is offered is asked about each, steps and flows up to the state's own time too, and in a flow,
which has all at once, a particle that begins after the end is bad as well. To refuse everything would not do:
beside each wall a state that leaves it as slowly is asked about too, and one that is off its wall by half of
what it may be, and must not be refused.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import cos, sin, sqrt
from typing import Any, NamedTuple

from mpmath import fp
from msgspec.structs import replace

from conformance.suite.process import Trouble
from conformance.suite.promises.questions import INSIDE, MOVING, STANDING, flown, question
from conformance.suite.session import Session, missing
from scene import Cap, Mushroom, Scene, State, Stem, Wall, to_data
from scene.geometry import TableAt, table_at

OUTSIDE = 2.0**-4, 2.0**-10, 2.0**-18  # of a wall's size: how far beyond it
OFF = 2.0**-12, 2.0**-17  # likewise: how far off the wall that it names, of which 2^-20 is allowed
ALLOWED = 2.0**-21  # likewise: half of what is allowed
PAST = 2.0**-4, 2.0**-10  # likewise: how far past its end
IN_MOUTH = 0.0, 0.5, -0.9375  # places between the mouth's edges, as parts of its half-width
SLOWLY = 2.0**-10, 0.5  # of its speed along the wall: how fast it moves into it, or off it
TIMES = 0.375, 3.5  # in the first walls of MOVING come one way, in the second the other
SIDES: tuple[Wall, ...] = ("left", "right")


class JudgedState(NamedTuple):
    """A state, what is bad about it (nothing when `why` is empty), and whether it may be left undecided."""

    state: State
    why: str
    may_be_open: bool = False


def bad_states(session: Session) -> str:
    """What is no state of its scene is refused, by every command and however near the end is.

    Raises:
        Trouble: fail for a bad state that is answered, or a good one that is refused; declined where one is
            undecided; unsupported where nothing can be asked.
    """
    assert session.introduction is not None
    n = n_open = 0
    for scene, t in tables():
        asked = list(states(scene, t))
        offering = [
            cmd
            for cmd in ("step", "trajectory", "flow")
            if not missing(session.introduction, cmd, to_data(scene))
        ]
        for cmd in offering:
            for t_end in (t + 1.0,) if cmd == "trajectory" else (t, t + 1.0):
                found = _outcomes(session, cmd, scene, asked, t_end)
                n_open += sum(_is_open(one, outcome, f"{cmd} to {t_end}") for one, outcome in found)
                n += len(found)
    if not n:
        raise Trouble("unsupported", "no table is offered, or no laws that are constant")
    if n_open:
        raise Trouble("declined", f"{n_open} of {n} states are undecided")
    return f"{n} states"


def tables() -> list[tuple[Scene, float]]:
    """Return scenes, and when to ask about them: all tables, moving and at rest."""
    moving = [scene for scene in MOVING if scene not in STANDING]
    return [*((scene, 0.0) for scene in STANDING), *((scene, t) for scene in moving for t in TIMES)]


def _outcomes(
    session: Session, cmd: str, scene: Scene, asked: list[JudgedState], t_end: float
) -> list[tuple[JudgedState, str]]:
    """Ask one command about all states, and return how each is answered."""
    if cmd == "flow":
        late = JudgedState(replace(INSIDE[type(scene)], t=t_end + 1.0), "begins after t_end")
        asked = [*asked, late]
        found = flown(session, scene, [one.state for one in asked], t_end)
        return [(one, str(answer["outcome"])) for one, answer in zip(asked, found, strict=True)]
    more = {"collisions": 2} if cmd == "trajectory" else {}
    pairs = []
    for one in asked:
        answer: dict[str, Any] = session.ask(question(cmd, scene, one.state, t_end=t_end, **more))
        if "error" in answer:
            raise Trouble("error", answer["error"])
        steps = answer.get("steps", [answer])
        pairs.append((one, str(steps[0]["outcome"]) if steps else "nothing"))
    return pairs


def _is_open(one: JudgedState, outcome: str, asking: str) -> bool:
    """Hold a bad state to be refused, and a good one not to be; tell whether a bad one is left open."""
    if one.why and outcome not in ("rejected", "undecided"):
        raise Trouble("fail", f"{asking}: {one.state} {one.why}, is answered {outcome}, must be rejected")
    if not one.why and outcome == "rejected":
        raise Trouble("fail", f"{asking}: {one.state} is on its wall and leaves it, and is rejected")
    return bool(one.why) and outcome == "undecided" and not one.may_be_open


def states(scene: Scene, t: float) -> Iterator[JudgedState]:
    """Make bad states, and some good ones, of every wall of a table at one time."""
    table = table_at(fp, scene, t)
    for wall in scene.walls:
        x, y = _place(table, wall)
        for part in OUTSIDE:
            for way in (1.0, -1.0):
                place = _moved(table, wall, x, y, -part)
                yield JudgedState(_leaving(table, t, wall, place, way, None), f"is beyond {wall}")
        for part in OFF:
            for way in (1.0, -1.0):
                place = _moved(table, wall, x, y, way * part)
                yield JudgedState(_leaving(table, t, wall, place, 1.0, wall), "is not on its wall")
        for way in (1.0, -1.0):
            place = _moved(table, wall, x, y, way * ALLOWED)
            yield JudgedState(_leaving(table, t, wall, place, 1.0, wall), "")
        for part in SLOWLY:
            yield JudgedState(_leaving(table, t, wall, (x, y), -part, wall), "moves into its wall")
            yield JudgedState(_leaving(table, t, wall, (x, y), part, wall), "")
        for place in _past_the_end(table, wall):
            yield JudgedState(_leaving(table, t, wall, place, 1.0, wall), "is where its wall has ended")
    yield from _nameless_on_the_base(table, t)
    if isinstance(scene, Mushroom):
        yield from _in_the_mouth(table, t)


def _nameless_on_the_base(table: TableAt, t: float) -> Iterator[JudgedState]:
    """Make states at y = 0 that name no wall: beside the mouth these are on the base all the same.

    They are within rounding of a wall that they do not name, and that may be the answer.
    """
    place = _place(table, "base")
    for part in SLOWLY:
        yield JudgedState(_leaving(table, t, "base", place, part, None), "")
        sinking = _leaving(table, t, "base", place, -part, None)
        yield JudgedState(sinking, "moves into the base that it is on", may_be_open=True)


def _in_the_mouth(table: TableAt, t: float) -> Iterator[JudgedState]:
    """Make states that name the base in the open mouth: they leave it upwards, or move into it."""
    for part in IN_MOUTH:
        place = part * float(table.w), 0.0
        for up in SLOWLY:
            yield JudgedState(_leaving(table, t, "base", place, up, "base"), "")
            yield JudgedState(_leaving(table, t, "base", place, -up, "base"), "moves into its wall")


def _place(table: TableAt, wall: Wall) -> tuple[float, float]:
    """Return a point of a wall, away from its ends."""
    if wall == "arc":
        return float(table.r) * cos(1.1), float(table.r) * sin(1.1)
    if wall == "base":
        ends = {Cap: (0.0, table.r), Stem: (0.0, table.w), Mushroom: (table.w, table.r)}[type(table.scene)]
        return float(0.4 * ends[0] + 0.6 * ends[1]), 0.0
    x, y = table.stem_point(wall, 0.3, 0.4)
    return float(x), float(y)


def _moved(table: TableAt, wall: Wall, x: float, y: float, part: float) -> tuple[float, float]:
    """Move a point of a wall inwards by a part of the wall's size, as docs/protocol.md measures it."""
    if wall == "arc":
        return x * (1.0 - part), y * (1.0 - part)
    if wall in SIDES:
        size = max(float(table.w), abs(x))
        return x + (part * size if wall == "left" else -part * size), y
    size = float(table.h) if wall == "floor" else float(max(table.r, table.w))
    return x, y + part * size * table.normal(wall, x, y)[1]


def _leaving(
    table: TableAt, t: float, wall: Wall, place: tuple[float, float], part: float, named: Wall | None
) -> State:
    """Return a state that goes along a wall with speed 1, and off it by a part of its speed as seen from it.

    Args:
        table: at time t.
        t: of the state [time].
        wall: that it leaves, or moves into where `part` is negative.
        place: (x, y) [length].
        part: of its speed, from -1 to 1.
        named: the state's wall.
    """
    nx, ny = table.normal(wall, *place)
    off = part - table.receding(wall, place[1])
    return State(t, *place, off * nx - ny, off * ny + nx, named)


def _past_the_end(table: TableAt, wall: Wall) -> Iterator[tuple[float, float]]:
    """Return places where a wall's f is 0, and which lie clearly past the wall's ends."""
    r, w, h = float(table.r), float(table.w), float(table.h)
    for part in PAST:
        if wall == "arc":
            yield r * cos(part), -r * sin(part)
            yield -r * cos(part), -r * sin(part)
        elif wall == "base":
            end = w if isinstance(table.scene, Stem) else r
            yield end * (1.0 + part), 0.0
            yield -end * (1.0 + part), 0.0
        elif wall == "floor":
            foot = float(table.half_width(-table.h)) * (1.0 + part)
            yield foot, -h
            yield -foot, -h
        else:
            for y in (-h * (1.0 + part), h * part):
                half = float(table.half_width(y))
                yield (-half if wall == "left" else half), y
    if wall == "arc" and isinstance(table.scene, Mushroom) and (y := -sqrt(r * r - w * w / 16)) > -h:
        yield w / 4, y  # within the stem, where the circle goes on
