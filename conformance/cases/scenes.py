"""Scenes drawn at random, and where, when and how fast a particle starts in them.

Laws lie inside nested ranges, which makes every scene valid. To prove that a slope of many
harmonics closes no stem takes up to some ten seconds, so ranges are nested there too. A deep wave
is a Fourier law whose amplitudes add up to more than its mean, and which is positive all the same.

`law`, `scene`, `time`, `place` and `state` are what the corpus is drawn with: their streams never
change. `any_law`, `any_scene` and `start` go on from there: laws of every shape and length that
begin anywhere, deep stems and shallow ones, narrow mouths, slopes as steep as these allow; late
times and early ones, places near walls, corners and edges, or off their wall by what is allowed,
the directions that formulas divide by. A state may still be refused (its rounded place lies
outside, or it moves into the wall it names): the caller draws again.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from msgspec.structs import replace

from conformance.cases.draw import Draw, Unfit
from scene import (
    BangBang,
    Cap,
    Fourier,
    GivenLaw,
    Mushroom,
    Scene,
    State,
    Stem,
    Wall,
)
from scene.geometry import TableAt, rounded
from scene.laws import MAX_KNOTS, law_of
from scene.states import ON_WALL
from scene.transforms import scaled_law

FEW_HARMONICS = ((1, 0), (0, 1), (1, 1), (2, 0), (0, 2), (2, 2), (1, 3))  # of cosines, of sines
MANY_HARMONICS = ((4, 0), (0, 6), (5, 5), (8, 3), (16, 16))
TABLES = ("cap", "stem", "mushroom")
SIDES: tuple[Wall, ...] = ("left", "right")
MOVING = ("fourier", "bang-bang")
KINDS = ("constant", "fourier", "bang-bang", "mixed", "mixed", "mixed", "harmonics")
PERIODS = (0.5, 1.0, 1.5, 4.0)
LEGS = 5, 6, 7, 12, 23, 40, MAX_KNOTS - 1  # of a law with many: the corpus has at most four
GRID = 1024  # parts of a period that knots lie on
FAINT = 8, 20, 30  # powers of a half that what a law moves by is multiplied with
DEEPER = 0, 0, 0, 3, 5, -3, -5, -10  # powers of two that a stem's depth is multiplied with
NARROWER = 0, 0, -4, -8, -20  # likewise, a mouth's width
LONGEST = 8.0  # periods of one flight
# Periods before a late start, or from it to time 0, as powers of two. Later ones a stepper may
# refuse: of sixteen waves the last is 2^24 of its own periods late by then, and much of a phase is
# lost.
LATE = 9, 20
# The law that says how large a wall is; that of a side is its width.
REACH = {
    "arc": "r",
    "floor": "h",
}


class Clock(NamedTuple):
    """What the moving laws of a scene share: kind, and omega or the period.

    Of kind "mixed" each law is of its own kind, and of "harmonics" a Fourier law of four to
    sixteen; both share a period.
    """

    kind: str
    rate: float = 1.0

    def of_waves(self) -> dict[str, float]:
        """Return what says how long a Fourier law's waves are."""
        return {"omega" if self.kind == "fourier" else "period": self.rate}


def clock(draw: Draw, kinds: Sequence[str] = ("fourier", "bang-bang", "constant")) -> Clock:
    """Draw what the laws of a scene share."""
    kind = draw.pick(kinds)
    return Clock(kind, draw.short(0.5, 6.0) if kind == "fourier" else draw.pick(PERIODS))


class Shapes(NamedTuple):
    """What becomes of a law that was drawn: of a number, of one of legs, of a wave."""

    number: Callable[[Draw, float], GivenLaw]
    legs: Callable[[Draw, float, float, BangBang], GivenLaw]
    wave: Callable[[Draw, float, float, Fourier], GivenLaw]


AS_DRAWN = Shapes(
    number=lambda _draw, found: found,
    legs=lambda _draw, _low, _high, found: found,
    wave=lambda _draw, _low, _high, found: found,
)


def law(draw: Draw, low: float, high: float, shared: Clock) -> GivenLaw:
    """Draw a law that stays within [low, high]; now and then one that stands still."""
    return _draw_law(draw, low, high, shared, AS_DRAWN)


def _draw_law(draw: Draw, low: float, high: float, shared: Clock, shapes: Shapes) -> GivenLaw:
    kind = shared.kind
    if kind == "mixed":
        kind = draw.pick(("fourier", "bang-bang", "constant"))
    if kind == "constant" or draw.pick(range(6)) == 0:
        return shapes.number(draw, draw.short(low, high))
    if kind == "bang-bang":
        n = draw.pick((2, 3, 4))
        places = sorted({draw.pick(range(1, 64)) for _ in range(n - 1)})
        times = [0.0, *(shared.rate * place / 64 for place in places), shared.rate]
        values = [draw.short(low, high) for _ in times[1:]]
        legs = BangBang(knots=tuple(zip(times, [*values, values[0]], strict=True)))
        return shapes.legs(draw, low, high, legs)
    mean = draw.short(0.75 * low + 0.25 * high, 0.25 * low + 0.75 * high)
    n_cos, n_sin = draw.pick(MANY_HARMONICS if kind == "harmonics" else FEW_HARMONICS)
    size = 0.999 * min(high - mean, mean - low) / (n_cos + n_sin)
    amplitudes = [draw.short(-size, size) for _ in range(n_cos + n_sin)]
    cos = tuple(amplitudes[:n_cos])
    sin = tuple(amplitudes[n_cos:])
    wave = Fourier(mean=mean, cos=cos, sin=sin, **shared.of_waves())
    return shapes.wave(draw, low, high, wave)


def deep_wave(draw: Draw, low: float, high: float, omega: float) -> Fourier:
    """Draw a deep wave within [low, high], where low > 0 is a small part of high."""
    while True:
        a, b = draw.short(0.5, 1.5), draw.short(0.2, 0.6)
        found = _square(low, high, a, b, omega)
        if sum(found.cos) > 1.05 * found.mean:
            return _square(low, high, draw.pick((1.0, -1.0)) * a, b, omega)


def _square(low: float, high: float, a: float, b: float, omega: float) -> Fourier:
    """Return a law in [low, high].

    It is low and a share of |1 + a e^ix + b e^2ix|^2, which is never negative.
    """
    unit = (high - low) / (1 + abs(a) + b) ** 2
    waves = (2 * a * (1 + b) * unit, 2 * b * unit)
    return Fourier(mean=low + (1 + a * a + b * b) * unit, omega=omega, cos=waves)


LawDraw = Callable[[Draw, float, float, Clock], GivenLaw]


def scene(draw: Draw, table: str, shared: Clock, law: LawDraw = law) -> Scene:
    """Draw a valid scene of a table: "cap", "stem" or "mushroom", with laws as `law` draws them."""
    if table == "cap":
        return Cap(r=law(draw, 0.25, 2.0, shared))
    if table == "stem":
        w, h = law(draw, 0.25, 2.0, shared), law(draw, 0.5, 3.0, shared)
        return Stem(w=w, h=h, slope=_slope(draw, _least(w), _greatest(h), shared, law))
    r, h = law(draw, 0.75, 2.0, shared), law(draw, 0.5, 3.0, shared)
    narrowest = _least(r)
    if draw.pick((False, True)):
        nu = law(draw, 0.2, 1.0, shared)
        slope = _slope(draw, narrowest * _least(nu), _greatest(h), shared, law)
        return Mushroom(r=r, nu=nu, h=h, slope=slope)
    if narrowest <= 0:  # of a deep wave no more is known: a mouth as wide might not fit
        raise Unfit("the cap may vanish")
    w = law(draw, narrowest / 4, narrowest * 0.99, shared)
    return Mushroom(r=r, w=w, h=h, slope=_slope(draw, _least(w), _greatest(h), shared, law))


def _least(law: GivenLaw) -> float:
    return law_of(law).bounds().lowest


def _greatest(law: GivenLaw) -> float:
    return law_of(law).bounds().highest


def _slope(draw: Draw, narrowest: float, deepest: float, shared: Clock, law: LawDraw) -> GivenLaw:
    steepest = 0.9 * narrowest / deepest
    kind = draw.pick(("positive", "zero", "negative", "moving"))
    if kind == "moving" and steepest > 0.01:
        return law(draw, -0.5, steepest, shared)
    if kind == "positive" and steepest > 0.001:
        return draw.short(0.0001, steepest)
    return draw.short(-0.8, -0.01) if kind == "negative" else 0.0


def any_law(draw: Draw, low: float, high: float, shared: Clock) -> GivenLaw:
    """Draw a law within [low, high], in any shape that it may have.

    A constant may be written as a law that moves by nothing, with a period that no other has; a
    wave may sink nearly to 0; a law may hardly move; one of legs begins anywhere, and may have as
    many as there may be.
    """
    return _draw_law(draw, low, high, shared, ANY_SHAPE)


def _any_number(draw: Draw, found: float) -> GivenLaw:
    """Write a constant in any way."""
    way = draw.pick((0, 1, 2, 3, 4))
    if way == 4:
        return Fourier(mean=found, omega=draw.short(0.5, 6.0), cos=(0.0,))
    begin = draw.pick(range(-16, 17)) / 16
    knots = tuple((begin + t, found) for t in (0.0, 4.0, 8.0))
    return BangBang(knots=knots) if way == 3 else found


def _any_legs(draw: Draw, low: float, high: float, found: BangBang) -> BangBang:
    """Let a law of legs hardly move, or have many; and move its knots by a part of the period.

    All sums of times are exact.
    """
    way = draw.pick((0, 1, 2, 3, 4))
    knots = found.knots
    if way == 4:
        first = knots[0][1]
        part = 2.0 ** -draw.pick(FAINT)
        knots = tuple((t, first + part * (v - first)) for t, v in knots)
    elif way == 3:
        knots = many_legs(draw, low, high, knots[-1][0]).knots
    by = knots[-1][0] * draw.pick((0, *range(-256, 256))) / 64
    return BangBang(knots=tuple((t + by, v) for t, v in knots))


def _any_wave(draw: Draw, low: float, high: float, found: Fourier) -> Fourier:
    """Let a wave hardly move, or sink nearly to 0."""
    way = draw.pick((0, 1, 2, 3, 4))
    if way == 4:
        part = 2.0 ** -draw.pick(FAINT)
        cos, sin = (tuple(part * a for a in given) for given in (found.cos, found.sin))
        return replace(found, cos=cos, sin=sin)
    if way == 3 and 0 < 8 * low < high:
        deep = deep_wave(draw, low, high, 1.0)
        return replace(deep, omega=found.omega, period=found.period)
    return found


ANY_SHAPE = Shapes(_any_number, _any_legs, _any_wave)


def many_legs(draw: Draw, low: float, high: float, period: float, n: int | None = None) -> BangBang:
    """Draw a law of n legs, or of many."""
    n = n or draw.pick(LEGS)
    places = set[int]()
    while len(places) < n - 1:
        places.add(draw.pick(range(1, GRID)))
    times = [0.0, *(period * place / GRID for place in sorted(places)), period]
    values = [draw.between(low, high) for _ in range(n)]
    return BangBang(knots=tuple(zip(times, [*values, values[0]], strict=True)))


def any_scene(draw: Draw, table: str | None = None, kinds: Sequence[str] = KINDS) -> Scene:
    """Draw a scene of a table, or of any: its laws may have any shape, and so may its stem."""
    found = scene(draw, table or draw.pick((*TABLES, "mushroom")), clock(draw, kinds), any_law)
    if not isinstance(found, Cap):
        mouth = "w" if "w" in found.laws else "nu"
        deeper = draw.pick(DEEPER)
        wider = draw.pick(NARROWER)
        powers = {mouth: wider, "h": deeper, "slope": wider - deeper}
        found = replace(
            found, **{name: scaled_law(getattr(found, name), n, 0) for name, n in powers.items()}
        )
    return replace(found, name=draw.pick(("", "", "scene", "1")))


def walls_speed(scene: Scene) -> float:
    """Return a bound of the walls' speeds; 0 when nothing moves.

    nu moves the mouth at the scale of r, slope the sides at the scale of h.
    """
    found = {name: law.bounds() for name, law in scene.laws.items()}
    reach = {name: found[of].highest for name, of in (("nu", "r"), ("slope", "h")) if name in found}
    return max(law.slope * reach.get(name, 1.0) for name, law in found.items())


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
    length = scene.period or 1.0
    knots = [float(t) for law in scene.laws.values() for t in law.breakpoints()]
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
        at: what is fixed: `t`, `site`, `speed` (a factor of the walls' speed, or of the table's
            size per unit of time when nothing moves), `lift` (sine of the angle at which a wall is
            left, relative to the wall), `patience` (flight time allowed, in crossings of the
            table).
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
        vx = away * nx - along * ny
        vy = away * ny + along * nx
    t_end = t + at.get("patience", 64.0) * table.size / speed
    return State(t, x, y, vx, vy, wall), t_end


def when(draw: Draw, scene: Scene) -> float:
    """Draw a time: 0, within some periods before it or after it, on a knot, or late."""
    length = scene.period or 1.0
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
    length = scene.period or 1.0
    table = rounded(scene, t)
    site = site or draw.pick(sites(scene))
    x, y = point(table, site, draw.near_an_end(), draw.near_an_end())
    usual = draw.pick((walls_speed(scene) or table.size, table.size / length))
    speed = usual * 2.0 ** draw.pick((0, *range(-10, 20))) * draw.between(1.0, 2.0)
    t_end = t + min(draw.pick((32.0, 4.0, 32.0)) * table.size / speed, LONGEST * length)
    vx, vy = _velocity(draw, x, y, speed)
    wall: Wall | None = next((name for name in scene.walls if name == site), None)
    if wall is None:
        return State(t, x, y, vx, vy), t_end
    if (
        wall == "base" and isinstance(scene, Mushroom) and draw.pick((False, True))
    ):  # where it is open now
        return State(t, draw.between(-0.99, 0.99) * table.w, 0.0, vx, abs(vy), wall), t_end
    leaving = _leaving(draw, table, State(t, x, y, vx, vy, wall))
    return off_its_wall(draw, scene, leaving) if draw.pick(range(4)) == 3 else leaving, t_end


def _velocity(draw: Draw, x: float, y: float, speed: float) -> tuple[float, float]:
    """Draw a velocity of some speed.

    Its direction is any, along an axis, or exactly to, from or around the centre.
    """
    way = draw.pick(range(8))
    distance = math.sqrt(x * x + y * y)
    if way == 1 and distance > 0:
        part = 2.0 ** math.frexp(speed / distance)[1]
        return draw.pick(((-part * x, -part * y), (part * x, part * y), (-part * y, part * x)))
    c, s = draw.direction()
    if way == 0:
        c, s = draw.pick(((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)))
    return speed * c, speed * s


def _leaving(draw: Draw, table: TableAt, state: State) -> State:
    """Return a state that leaves its wall.

    It is as it was if it does, else reflected, or grazing the wall.
    """
    assert state.wall is not None
    nx, ny = table.normal(state.wall, state.x, state.y)
    away = state.vx * nx + state.vy * ny + table.receding(state.wall, state.y)
    by = -2 * min(away, 0.0)
    if draw.pick(range(3)) == 2:
        by = abs(away) * draw.power(-40, -1) - away
    return replace(state, vx=state.vx + by * nx, vy=state.vy + by * ny)


def point(at: TableAt, site: str, a: float, b: float) -> tuple[float, float]:
    """Place two parts, from 0 to 1, of a region, or one of a wall; (1/2, 1/2) is its middle."""
    if site in ("cap", "arc"):
        p = 2 * a - 1
        rho = at.r if site == "arc" else at.r * b
        return rho * 2 * p / (1 + p * p), rho * (1 - p * p) / (1 + p * p)
    if site == "base" and not isinstance(at.scene, Stem):
        return math.copysign(at.w + (at.r - at.w) * b, a - 0.5), 0.0
    return at.stem_point(site, 2 * b - 1, a)


def off_its_wall(draw: Draw, scene: Scene, state: State, least: int = -9) -> State:
    """Return a start on its wall by definition, farther from it than rounding leads.

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
    return replace(state, x=state.x + by * nx, y=state.y + by * ny)
