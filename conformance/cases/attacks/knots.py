"""Attacks on times near a knot: of an event, of a crossing of y = 0, of a hit exactly at a knot.

A path is followed first with the law in question at rest. The law then gets a short leg whose knots lie next
to the time of an event or of a crossing on that path: before it, after it or within its rounding. Which side
of the knot the time lies on decides the outcome, and a stepper that knows the time only to some digits must
keep both.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

from conformance import plain
from conformance.cases.attacks.case import NEVER, Attack, Family, built
from conformance.cases.draws import Draw, SharedPeriod, law
from scene import BangBang, Cap, Collision, Law, Mushroom, Scene, State, Stem

PERIOD = 16.0
# Nested, so that every scene is valid: nu r >= 0.012, h slope <= 0.008 < w <= 0.4 < r.
SIZES = {"r": (0.6, 1.5), "w": (0.01, 0.4), "h": (0.3, 2.0), "slope": (-0.2, 0.004), "nu": (0.02, 0.6)}
# Of each wall the parameters that move it.
MOVERS = {"arc": ("r",), "floor": ("h",), "left": ("w", "slope"), "right": ("w", "slope")}


class Instant(NamedTuple):
    """A collision, or a crossing of y = 0, of a path that is known.

    Attributes:
        time: since time 0, the start [time].
        x: place then [length].
        n_before: collisions before it.
        wall: the wall met; "mouth" for a crossing of y = 0, on the base or through the mouth.
    """

    time: float
    x: float
    n_before: int
    wall: str


def _start_time(draw: Draw) -> float:
    """Draw a whole number of periods: early, at 4096, or as late as 2^110."""
    kind = draw.pick(("early", "4096", "late", "late"))
    if kind == "early":
        return PERIOD * draw.pick(range(-3, 4))
    return draw.pick((1.0, 1.0, -1.0)) * (4096.0 if kind == "4096" else draw.power(12, 110))


def _working(draw: Draw, t: float, width: float) -> int:
    """Draw decimals, 6 to 60, that mostly resolve times after t a little worse than this width."""
    if draw.pick((True, False, False, False)):
        return draw.pick(range(6, 61))
    resolution = width * draw.power(-4, 16)
    bits = math.log2(max(abs(t), 1.0)) - math.log2(resolution)
    return min(max(round((bits - 8) / math.log2(10)), 6), 60)


def _base(draw: Draw) -> tuple[dict[str, Law], State]:
    """Draw a mushroom's parameters, some of them moving, and a particle in it at t = 0."""
    clock = SharedPeriod("bang-bang", PERIOD)
    names = ("r", draw.pick(("w", "w", "nu")), "h", "slope")
    found = {
        name: law(draw, *SIZES[name], clock) if draw.pick((True, False, False)) else draw.short(*SIZES[name])
        for name in names
    }
    vx, vy = draw.direction()
    if draw.pick((True, True, False)):
        radius, (c, s) = 0.55 * draw.part(), draw.direction()
        place = radius * c, radius * abs(s)
    else:
        place = 0.0, -0.25 * draw.part()
    return found, State(0.0, *place, vx, vy)


def instants(scene: Scene, state: State, n: int) -> list[Instant]:
    """List the first n collisions, and the crossings of y = 0 on the way."""
    before: State | Collision = state
    found = []
    for number, hit in enumerate(plain.trajectory(scene, state, n, NEVER)):
        if not isinstance(hit, Collision):
            break
        if hit.wall == "base" or before.y * hit.y < 0:
            crossing = -before.y / before.vy
            found.append(Instant(before.t + crossing, before.x + before.vx * crossing, number, "mouth"))
        if hit.wall != "base":
            found.append(Instant(hit.t, hit.x, number, hit.wall))
        before = hit
    return found


def _leg(draw: Draw, near: float, low: float, high: float, width: float) -> BangBang | None:
    """Return a law at rest at `low` but for a sudden leg to `high`, so wide, next to the time `near`."""
    begin = near + width * draw.pick((-2.0, -1.0, -0.75, -0.5, -0.25, -0.1, 0.0, 0.1, 0.5, 1.0))
    end = max(begin + width, math.nextafter(begin, math.inf))
    times = [0.0, begin, end, end + draw.between(0.05, 2.0), PERIOD]
    if not all(a < b for a, b in pairwise(times)):
        return None
    return BangBang(knots=tuple(zip(times, (low, low, high, high, low), strict=True)))


def knot_at_event(draw: Draw) -> Attack:
    """A knot next to the time of the first, second or third collision, or of a crossing of y = 0."""
    while True:
        found, state = _base(draw)
        at, name = _target(draw, found, state)
        if at is None:
            continue
        low, high = found[name], draw.short(*SIZES[name])
        assert isinstance(low, float)
        if at.wall == "mouth" and name == "w":  # one of them open at x, the other closed
            ends = abs(at.x) * draw.between(0.1, 0.95), abs(at.x) * draw.between(1.05, 3.0)
            least, most = SIZES["w"]
            low, high = (
                min(max(end, least), most) for end in (ends if draw.pick((True, False)) else ends[::-1])
            )
        width = draw.power(-52, -30) * draw.between(1.0, 2.0)
        leg = _leg(draw, at.time, low, high, width)
        if leg is None:
            continue
        t = _start_time(draw)
        late = State(t, state.x, state.y, state.vx, state.vy)
        moved = Mushroom(**(found | {name: leg}))  # type: ignore[arg-type]
        return Attack(moved, late, NEVER, at.n_before + draw.pick((1, 1, 2)), _working(draw, t, width))


def _target(draw: Draw, found: dict[str, Law], state: State) -> tuple[Instant | None, str]:
    """Put one law to rest and choose an event or a crossing that it decides."""
    name = draw.pick(("w", "w", *found)) if "w" in found else draw.pick(tuple(found))
    if not isinstance(found[name], float):
        found[name] = draw.short(*SIZES[name])
    known = instants(Mushroom(**found), state, 3)  # type: ignore[arg-type]
    movers = MOVERS | {"mouth": (name,) if name in ("w", "nu") else ()}
    if name == "nu":
        movers |= {"left": ("nu",), "right": ("nu",)}
    targets = [at for at in known if name in movers[at.wall]]
    return (draw.pick(targets) if targets else None), name


def hit_at_knot(draw: Draw) -> Attack:
    """A hit exactly at a knot, a unit in the last place before or after, with a violent leg behind it."""
    start = draw.pick((0.0, 0.0, 4.0, 4096.0, -8.0))
    dt, size = draw.pick((0.5, 1.0, 1.25, 2.0)), draw.pick((1.0, 1.5, 3.0))
    speed, other = size / dt * draw.pick((0.125, 0.25, 0.5, 0.75)), draw.between(0.3, 4.0)
    quick = 2.0 ** -draw.pick(range(1, 41))
    knot = dt * (1 + draw.pick((0, 0, 0, 1, -1, 3, -3)) * 2.0**-52)
    times = (0.0, knot, knot + quick, knot + quick + 1.0, 4.0)
    moving = BangBang(knots=tuple(zip(times, (size, size, other, other, size), strict=True)))
    side, t_end = draw.pick((1.0, -1.0)), start + 3.9
    wall = draw.pick(("arc", "floor", "side", "mouth"))
    if wall == "arc":
        return Attack(Cap(r=moving), State(start, 0.0, size - speed * dt, 0.0, speed), t_end)
    if wall == "floor":
        return Attack(Stem(w=1.0, h=moving), State(start, 0.0, speed * dt - size, 0.25, -speed), t_end)
    if wall == "side":
        depth = draw.pick((2.0**-40, 0.25, 1.0))
        stem = Stem(w=moving, h=2.0, slope=draw.pick((0.0, -0.125, 2.0**-9)))
        return Attack(stem, State(start, side * (size - speed * dt), -depth, side * speed, 0.0), t_end)
    x = side * size * draw.pick((0.5, 0.999, 1.001, 1.5))
    return Attack(Mushroom(r=8.0, h=1.0, w=moving), State(start, x, speed * dt, 0.0, -speed), t_end)


def knots_anywhere(draw: Draw) -> Attack:
    """Knots that begin at 0.3, -0.7 and the like, not at 0 or at a whole period; some steps of a path."""
    first = draw.pick((0.3, -0.7, 0.1, 1.0 / 3.0, -5.3, 17.9))
    period = draw.pick((1.0, 2.0, 0.5))

    def moved(low: float, high: float) -> Law:
        if draw.pick((True, False, False)):
            return draw.short(low, high)
        parts = sorted({draw.part() for _ in range(draw.pick((1, 2, 3, 5)))})
        times = [first, *(first + period * part for part in parts), first + period]
        values = [draw.short(low, high) for _ in times[1:]]
        return BangBang(knots=tuple(zip(times, [*values, values[0]], strict=True)))

    scene = None
    while scene is None:
        # The distance from the first knot to the last may round: then it is no period.
        scene = built(
            lambda: Mushroom(
                r=moved(0.6, 1.5), w=moved(0.05, 0.5), h=moved(0.3, 2.0), slope=moved(-0.2, 0.02)
            )
        )
    vx, vy = draw.direction()
    speed = draw.power(-2, 5)
    t = draw.pick((first, first + 0.25, first - 3 * period, 100 * draw.part(), -100 * draw.part()))
    x, y = 0.5 * draw.between(-1.0, 1.0), 0.3 * draw.part()
    if draw.pick((True, False)):
        x, y = 0.08 * x, -y * 0.9
    state = State(t, x, y, speed * vx, speed * vy)
    if draw.pick((True, False)):
        return Attack(scene, state, t + 40.0 / speed)
    return Attack(scene, state, NEVER, 3)


FAMILIES = (
    Family(
        knot_at_event,
        "one piece of a law decides, though the enclosed time of an event or a crossing touches several",
        is_delicate=True,
    ),
    Family(hit_at_knot, "a hit exactly at a knot, or a unit beside it, before a violent leg"),
    Family(knots_anywhere, "knots are taken to begin at 0 or at a whole period"),
)
