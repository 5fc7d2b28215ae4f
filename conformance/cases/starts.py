"""Where a particle starts, when, how fast and where to, and how long it may fly.

`time`, `place` and `state` are what the corpus is drawn with: their streams never change. `start` goes on
from there: late times and early ones, places near walls, corners and edges, or off their wall by what is
allowed, the directions that formulas divide by. A state may still be refused (its rounded place lies
outside, or it moves into the wall it names): the caller draws again.
"""

from __future__ import annotations

import math
from math import sqrt
from typing import Any

import msgspec

from conformance.cases.draw import Draw
from conformance.cases.scenes import walls_speed
from scene import Cap, Mushroom, Scene, State, Stem, Wall
from scene.geometry import TableAt, rounded
from scene.laws import breakpoints
from scene.states import ON_WALL
from scene.tables import cycle_length, laws

LONGEST = 8.0  # periods of one flight
# Periods before a late start, or from it to time 0, as powers of two. Later ones a stepper may refuse: of
# sixteen waves the last is 2^24 of its own periods late by then, and much of a phase is lost.
LATE = 9, 20
REACH = {"arc": "r", "floor": "h"}  # the law that says how large a wall is; that of a side is its width


def place(draw: Draw, at: TableAt, site: str) -> tuple[float, float]:
    """Draw a place in the cap, the stem or the mouth, or on a wall."""
    if site in ("cap", "arc"):
        c, s = draw.direction()
        rho = at.r if site == "arc" else at.r * math.sqrt(draw.part())
        return rho * c, rho * abs(s)
    side = draw.between(-1.0, 1.0)
    if site == "base" and not isinstance(at.scene, Stem):
        return draw.pick((1.0, -1.0)) * draw.between(at.w, at.r), 0.0
    return at.stem_point(site, side, 0.0 if site in ("mouth", "base", "floor") else draw.part())


def time(draw: Draw, scene: Scene, turns: int = 3) -> float:
    """Draw a time within some periods; now and then on a knot."""
    length = cycle_length(scene) or 1.0
    knots = [float(t) for law in laws(scene).values() for t in breakpoints(law)]
    if knots and draw.pick(range(5)) == 0:
        return length * draw.pick(range(turns)) + draw.pick(knots)
    return length * (draw.pick(range(turns)) + draw.part())


def sites(scene: Scene) -> list[str]:
    """List where a particle may start: regions by the names that `place` knows, and walls."""
    regions = {Cap: ["cap"], Stem: ["stem"], Mushroom: ["cap", "stem", "mouth"]}[type(scene)]
    return [*regions, *regions, *scene.walls]


def state(draw: Draw, scene: Scene, at: dict[str, Any]) -> tuple[State, float]:
    """Draw a state and a horizon.

    Args:
        draw: stream of numbers.
        scene: a valid scene.
        at: what is fixed: `t`, `site`, `speed` (a factor of the walls' speed, or of the table's size per
            unit of time when nothing moves), `lift` (sine of the angle at which a wall is left, relative
            to the wall), `patience` (flight time allowed, in crossings of the table).
    """
    t = at["t"] if "t" in at else time(draw, scene)
    table = rounded(scene, t)
    site = at["site"] if "site" in at else draw.pick(sites(scene))
    x, y = at["place"] if "place" in at else place(draw, table, site)
    factor = at["speed"] if "speed" in at else draw.power(-2, 12) * draw.between(1.0, 2.0)
    speed = factor * (walls_speed(scene) or table.size)
    vx, vy = (speed * c for c in draw.direction())
    wall: Wall | None = next((name for name in scene.walls if name == site), None)
    if wall is not None:
        nx, ny = table.normal(wall, x, y)
        lift = at.get("lift") or draw.part()
        along = draw.pick((1.0, -1.0)) * speed
        away = lift * speed - table.receding(wall, y)
        vx, vy = away * nx - along * ny, away * ny + along * nx
    t_end = t + at.get("patience", 64.0) * table.size / speed
    return State(t, x, y, vx, vy, wall), t_end


def when(draw: Draw, scene: Scene) -> float:
    """Draw a time: 0, within some periods before it or after it, on a knot, or late."""
    length = cycle_length(scene) or 1.0
    turns = draw.pick((0.0, 0.0, 1.0, 4.0, 60.0))
    if draw.pick(range(5)) == 4:
        turns = draw.power(*LATE) * draw.pick((1.0, -1.0))
    return 0.0 if draw.pick(range(8)) == 0 else time(draw, scene) - turns * length


def start(draw: Draw, scene: Scene, t: float, site: str | None = None) -> tuple[State, float]:
    """Draw a state at a time and a horizon, of any speed, in any direction.

    Args:
        draw: stream of numbers.
        scene: a valid scene.
        t: time of the start [time].
        site: a region or a wall; any by default.
    """
    length, table = cycle_length(scene) or 1.0, rounded(scene, t)
    site = site or draw.pick(sites(scene))
    x, y = point(table, site, draw.near_an_end(), draw.near_an_end())
    usual = draw.pick((walls_speed(scene) or table.size, table.size / length))
    speed = usual * 2.0 ** draw.pick((0, *range(-10, 20))) * draw.between(1.0, 2.0)
    t_end = t + min(draw.pick((32.0, 4.0, 32.0)) * table.size / speed, LONGEST * length)
    vx, vy = _velocity(draw, x, y, speed)
    wall: Wall | None = next((name for name in scene.walls if name == site), None)
    if wall is None:
        return State(t, x, y, vx, vy), t_end
    if wall == "base" and isinstance(scene, Mushroom) and draw.pick((False, True)):  # where it is open now
        return State(t, draw.between(-0.99, 0.99) * table.w, 0.0, vx, abs(vy), wall), t_end
    leaving = _leaving(draw, table, State(t, x, y, vx, vy, wall))
    return off_its_wall(draw, scene, leaving) if draw.pick(range(4)) == 3 else leaving, t_end


def _velocity(draw: Draw, x: float, y: float, speed: float) -> tuple[float, float]:
    """Draw a velocity of some speed: any, along an axis, and to the centre, from it or around it exactly."""
    way, distance = draw.pick(range(8)), sqrt(x * x + y * y)
    if way == 1 and distance > 0:
        part = 2.0 ** math.frexp(speed / distance)[1]
        return draw.pick(((-part * x, -part * y), (part * x, part * y), (-part * y, part * x)))
    c, s = draw.direction()
    if way == 0:
        c, s = draw.pick(((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)))
    return speed * c, speed * s


def _leaving(draw: Draw, table: TableAt, state: State) -> State:
    """Return a state that leaves its wall: as it is, if it does, reflected if not, or grazing the wall."""
    assert state.wall is not None
    nx, ny = table.normal(state.wall, state.x, state.y)
    away = state.vx * nx + state.vy * ny + table.receding(state.wall, state.y)
    by = -2 * min(away, 0.0)
    if draw.pick(range(3)) == 2:
        by = abs(away) * draw.power(-40, -1) - away
    return msgspec.structs.replace(state, vx=state.vx + by * nx, vy=state.vy + by * ny)


def point(at: TableAt, site: str, a: float, b: float) -> tuple[float, float]:
    """Place two parts, from 0 to 1, of a region, or one of a wall; (1/2, 1/2) is its middle."""
    if site in ("cap", "arc"):
        p, rho = 2 * a - 1, at.r if site == "arc" else at.r * b
        return rho * 2 * p / (1 + p * p), rho * (1 - p * p) / (1 + p * p)
    if site == "base" and not isinstance(at.scene, Stem):
        return math.copysign(at.w + (at.r - at.w) * b, a - 0.5), 0.0
    return at.stem_point(site, 2 * b - 1, a)


def off_its_wall(draw: Draw, scene: Scene, state: State, least: int = -9) -> State:
    """Return a start farther from its wall than rounding leads, on either side, and on it by definition.

    Args:
        draw: stream of numbers.
        scene: a valid scene.
        state: names its wall; at y = 0 it is on the base, or it is not.
        least: power of two, the least part of what is allowed; the greatest is a quarter.
    """
    if state.wall is None or state.wall == "base":
        return state
    table = rounded(scene, state.t)
    nx, ny = table.normal(state.wall, state.x, state.y)
    reach = getattr(table, REACH.get(state.wall, "w"))
    by = reach * ON_WALL * draw.power(least, -2) * draw.pick((1.0, -1.0))
    return msgspec.structs.replace(state, x=state.x + by * nx, y=state.y + by * ny)
