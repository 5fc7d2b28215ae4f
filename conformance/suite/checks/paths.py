"""Questions about hits, paths and flows: `path_judge.follow` judges the answers to all of them.

It needs no certified answer, so questions may be drawn: one from every octave of a size, up to the bounds
below, which docs/detection.md lists.
"""

import math
from collections.abc import Iterator, Sequence
from typing import Any

from mpmath import fp
from msgspec.structs import replace

from conformance import plain
from conformance.cases import scenes
from conformance.cases.draw import Draw, leaves, readable, wire_form
from conformance.suite.checks.form import FOREVER, Question, octaves, rising
from scene import (
    BadInput,
    Cap,
    Collision,
    Fourier,
    Mushroom,
    Scene,
    State,
    Stem,
)
from scene.geometry import table_at
from scene.transforms import scaled, scaled_state

MAX_HITS = 2**13  # of a path, and of a flow
MAX_WAIT = 2**11  # periods of one flight
MAX_LATE = 2**19  # periods from t = 0
NEAREST = 2.0**-32  # of sizes: from a corner, an edge, a tie, a wall; a mouth's width, and what it lacks of r
STEEPEST = 2.0**6
N_USUAL = 24
N_FINEST = 4  # further questions from the two octaves at the bound, which a mistake may hide beyond
USUAL = ("fourier", "bang-bang", "constant")
MIXED = (*USUAL, "mixed", "harmonics")
BREATHING = Cap(r=Fourier(mean=1.0, cos=(0.1,), omega=1.0))
# Starts on orbits whose errors grow slowly: of a mushroom, one that stays in the cap.
REGULAR: tuple[tuple[Scene, State], ...] = (
    (BREATHING, State(0.0, 0.1, 0.2, 3.0, 4.0)),
    (Mushroom(r=1.0, w=0.5, h=1.0), State(0.0, 0.75, 0.25, 0.1, 4.0)),
    (Stem(w=1.0, h=1.25), State(0.0, 0.1, -0.2, 0.3, -0.43)),
)


def draw_start(draw: Draw, kinds: Sequence[str] = USUAL, **at: Any) -> tuple[Scene, State]:
    """Draw a scene with laws of some kinds, and a start in it that meets a wall soon."""
    while True:
        try:
            scene = scenes.scene(draw, draw.pick(("cap", "stem", "mushroom")), scenes.clock(draw, kinds))
            state, t_end = scenes.state(draw, scene, {"speed": draw.power(-1, 5), **at})
        except BadInput:
            continue
        if isinstance(plain.next_collision(scene, state, t_end), Collision):
            return scene, state


def usual(draw: Draw, profile: str) -> Iterator[Question]:
    """Ask about scenes of all kinds."""
    for _ in range(N_USUAL):
        scene, state = draw_start(draw)
        yield scene, state, draw.pick((1, 2, 3, 4, 6))


def edges(draw: Draw, profile: str) -> Iterator[Question]:
    """Ask near corners, edges, ties and walls, and about mouths and slopes of all sizes, at rest."""
    finest = (near for _ in range(N_FINEST) for near in octaves(draw, NEAREST, 4.0 * NEAREST))
    for near in (*octaves(draw, NEAREST, 2.0**-2), *finest):
        for make in (aimed, through_the_mouth, through_the_mouth, slanted, along_the_arc, nearly_captured):
            scene, state, n = make(draw, near)
            k, j = draw.pick(range(-20, 21)), draw.pick(range(-20, 21))
            yield scaled(scene, k, j), scaled_state(state, k, j), n


def _table(draw: Draw, w: float, h: Any = None) -> Mushroom:
    """Return a mushroom of radius 1; given w or nu."""
    deep = draw.between(0.5, 2.0) if h is None else h
    return draw.pick((Mushroom(r=1.0, h=deep, w=w), Mushroom(r=1.0, h=deep, nu=w)))


def _towards(draw: Draw, x: float, y: float, to_x: float, to_y: float) -> State:
    """Return a particle at (x, y) that flies to a place."""
    speed = draw.between(0.5, 2.0)
    return State(0.0, x, y, speed * (to_x - x), speed * (to_y - y))


def aimed(draw: Draw, near: float) -> tuple[Scene, State, int]:
    """Aim at a place beside a corner, or beside the mouth's edge."""
    w, h = draw.between(0.25, 0.75), draw.between(0.5, 2.0)
    slope = draw.pick((0.0, draw.between(-1.0, 0.9 * w / h)))
    tables: tuple[Scene, ...] = (
        Cap(r=1.0),
        Stem(w=w, h=h, slope=slope),
        Mushroom(r=1.0, w=w, h=h, slope=slope),
    )
    scene = draw.pick(tables)
    region = (
        "cap" if isinstance(scene, Cap) else "stem" if isinstance(scene, Stem) else draw.pick(("cap", "stem"))
    )
    table = table_at(fp, scene, 0.0)
    x, y = scenes.place(draw, table, region)
    to_x, to_y = draw.pick(table.corners(region))
    inside = 0.4 if region == "cap" else -0.4 * float(table.h)  # off all walls: the table is convex there
    return scene, _towards(draw, 0.8 * x, 0.8 * y + 0.2 * inside, to_x + draw.pick((near, -near)), to_y), 3


def through_the_mouth(draw: Draw, near: float) -> tuple[Scene, State, int]:
    """Aim through a mouth that is narrow, or nearly as wide as the cap, or at the base beside it."""
    w = draw.pick((near, 1.0 - near))
    to_x = draw.pick((draw.between(-w, w), draw.between(w, 1.0) if w > 0.5 else draw.between(w, 2 * w)))
    c, s = draw.direction()
    return _table(draw, w), _towards(draw, 0.5 * c, 0.1 + 0.5 * abs(s), to_x, 0.0), 3


def slanted(draw: Draw, near: float) -> tuple[Scene, State, int]:
    """Fly into a stem whose sides lean by next to nothing, or by a lot."""
    steep = near / 2.0**-2 * STEEPEST
    w, h = draw.between(0.5, 1.0), draw.between(0.5, 2.0)
    slope = draw.pick((min(steep, 0.9 * w / h), -steep))
    x, y = 0.4 * draw.between(-w, w) * (1.0 - max(slope, 0.0) * h / w), -h * draw.between(0.25, 0.5)
    side = draw.pick((1.0, -1.0))
    return (
        Stem(w=w, h=h, slope=slope),
        _towards(draw, x, y, side * 2 * w * (1 + abs(slope)), y - 0.3 * h * draw.part()),
        2,
    )


def along_the_arc(draw: Draw, near: float) -> tuple[Scene, State, int]:
    """Leave the arc at a small angle: it is met again at once, as a part of the period even sooner."""
    turn, side = draw.between(0.5, 2.5), draw.pick((1.0, -1.0))
    c, s = math.cos(turn), math.sin(turn)
    deep = Fourier(mean=1.0, omega=draw.between(0.5, 2.0), cos=(0.25,))
    tables: tuple[Scene, ...] = (Cap(r=1.0), _table(draw, 0.5, deep))
    scene = draw.pick(tables)
    speed, angle = 2.0 ** draw.between(0.0, 16.0), max(near, 2.0**-24)
    along, inward = side * speed * math.cos(angle), speed * math.sin(angle)
    return scene, State(draw.part(), c, s, -s * along - c * inward, c * along - s * inward, "arc"), 3


def nearly_captured(draw: Draw, near: float) -> tuple[Scene, State, int]:
    """Fly to the arc on a chord that passes the centre at a little more than the mouth's edge, or less.

    The mouth may move: a stay ends when it has opened.
    """
    w, turn, omega = draw.between(0.25, 0.6), draw.between(1.0, 2.0), draw.between(0.25, 1.0)
    sine = w * (1.0 + draw.pick((1.0, -1.0)) * max(near, 2.0**-26))
    course = turn + draw.pick((1.0, -1.0)) * math.asin(sine)
    back, speed = draw.between(0.05, 0.2), draw.between(1.0, 4.0)
    x, y = math.cos(turn) - back * math.cos(course), math.sin(turn) - back * math.sin(course)
    start = State(0.0, x, y, speed * math.cos(course), speed * math.sin(course))
    opening = Mushroom(r=1.0, w=Fourier(mean=w, omega=omega, cos=(-0.4 * w,)), h=1.0)
    return draw.pick(((_table(draw, w), start, 2), (opening, start, 16)))


def changed(draw: Draw, profile: str) -> Iterator[Question]:
    """Ask about a scene or a state, the same with one part changed, and the first again."""
    for change in [*octaves(draw, 2.0**-24, 1.0)] * 2:
        scene, state = draw_start(draw, MIXED)
        other = next(
            filter(None, (_one_number_changed(draw, scene, state, change) for _ in range(64))), scene
        )
        yield from ((replace(one, name="scene"), state, 3) for one in (scene, other, scene))
    for _ in range(N_USUAL):
        scene, state = draw_start(draw)
        for other in _laws_renamed(scene, state):
            yield from ((replace(one, name="scene"), state, 2) for one in (scene, other, scene))
    for near in [*octaves(draw, 2.0**-44, 2.0**-4)] * 2:
        scene, state = draw_start(draw)
        name = draw.pick(("t", "x", "x", "y", "y", "vx", "vy"))
        nudged = replace(state, **{name: getattr(state, name) * (1.0 + near)})
        if _meets(scene, nudged):
            yield from ((scene, start, 1) for start in (state, nudged, state))
    for _ in range(N_USUAL // 3):  # late times that are the same to 15 digits
        t = draw.between(0.6, 1.0) * 2.0**17
        state = State(t, 0.25, 0.25, 0.0, draw.between(1.0, 64.0))
        nudged = replace(state, t=t + draw.pick((4, 5, 6)) * math.ulp(t))
        yield from ((Cap(r=1.0), start, 1) for start in (state, nudged, state))
    for near in octaves(draw, 2.0**-26, 2.0**-21):  # off the arc by less than is allowed
        x, y = -(1.0 - near) * math.cos(0.4), (1.0 - near) * math.sin(0.4)
        state = State(0.0, x, y, 1.0, draw.between(0.0, 0.2), "arc")
        yield from ((Cap(r=1.0), start, 1) for start in (state, replace(state, wall=None), state))


def _meets(scene: Scene | None, state: State) -> bool:
    return scene is not None and isinstance(plain.next_collision(scene, state, FOREVER), Collision)


def _one_number_changed(draw: Draw, scene: Scene, state: State, change: float) -> Scene | None:
    """Return a scene in which one number is another, wherever it stands; None where nothing is met then."""
    data = wire_form(scene)
    numbers = [(label, number) for label, number in leaves(data) if number]
    labels = sorted({label for label, _ in numbers})
    label = draw.pick([name for name in labels if name in ("omega", "period")] or labels)
    label = draw.pick((label, draw.pick(labels)))  # a period as often as all that it shares a law with
    old = draw.pick([number for name, number in numbers if name == label])
    other = readable(_replaced(data, old, old * (1.0 + change)))
    return other if other and _meets(other, state) else None


def _laws_renamed(scene: Scene, state: State) -> Iterator[Scene]:
    """Return scenes with the same laws under other names."""
    data = wire_form(scene)
    for one, other in (("nu", "w"), ("r", "h"), ("w", "h")):
        names = {one: other, other: one}
        renamed = readable({names.get(name, name): law for name, law in data.items()})
        if renamed and renamed != scene and _meets(renamed, state):
            yield renamed


def _replaced(data: Any, old: float, new: float) -> Any:
    if isinstance(data, dict):
        return {name: _replaced(part, old, new) for name, part in data.items()}
    if isinstance(data, list):
        return [_replaced(part, old, new) for part in data]
    return new if data == old and isinstance(data, float) else data


def long(draw: Draw, profile: str) -> Iterator[Question]:
    """Follow paths of many hits, on orbits where rounding grows slowly."""
    for i, n in enumerate(rising(draw, 2, 16 if profile == "step" else MAX_HITS)):
        scene, state = REGULAR[-1 - i % len(REGULAR)]  # the longest path is in a table that moves
        turned = replace(state, vx=state.vx * draw.between(0.9, 1.1), vy=state.vy * draw.between(0.9, 1.1))
        yield scene, turned, math.ceil(n)


def late(draw: Draw, profile: str) -> Iterator[Question]:
    """Begin many periods from t = 0, before or after."""
    for wait in octaves(draw, 1, MAX_LATE):
        t = draw.pick((1.0, -1.0)) * wait * draw.between(1.0, 4.0)
        yield *draw_start(draw, ("fourier", "bang-bang"), t=t, speed=draw.power(0, 4)), 2


def waiting(draw: Draw, profile: str) -> Iterator[Question]:
    """Wait for a wall that moves: for many periods."""
    for periods in octaves(draw, 1, MAX_WAIT):
        omega = draw.between(0.5, 8.0)
        r = Fourier(
            mean=1.0, omega=omega, cos=(draw.between(0.05, 0.1),), sin=(0.0, draw.between(0.01, 0.05))
        )
        y = draw.between(0.3, 0.5)
        speed = (0.85 - y) * omega / (2 * math.pi * periods)
        scene = draw.pick((Cap(r=r), Mushroom(r=r, w=0.25, h=1.0)))
        yield scene, State(0.0, 0.0, y, 0.1 * speed, speed), 1
