"""Scenes and states drawn for the corpus, the same on every machine and in every version of Python.

A draw is seeded by its vector's id, so adding vectors changes none of the others. Only integer bits are
drawn; floats come from + - * / and sqrt alone, and from laws of motion evaluated to 50 digits and then
rounded, so no libm takes part. Directions are rational points of the circle. Laws are drawn in nested ranges,
which makes every scene valid. A state may still be refused (its rounded place lies outside, or it moves into
the wall it names): the caller draws again.
"""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from typing import Any, NamedTuple, TypeVar

import msgspec
from msgspec.structs import replace

from scene import BangBang, Cap, Fourier, Law, Mushroom, Scene, State, Stem, Wall, to_data
from scene.geometry import TableAt, rounded
from scene.laws import bounds, breakpoints
from scene.tables import cycle_length, laws

T = TypeVar("T")
FEW_HARMONICS = ((1, 0), (0, 1), (1, 1), (2, 0), (0, 2), (2, 2), (1, 3))  # of cosines, of sines
MANY_HARMONICS = ((4, 0), (0, 6), (5, 5), (8, 3), (16, 16))


class Draw:
    """A stream of numbers that depends on its key alone."""

    def __init__(self, key: str) -> None:
        self._bits = random.Random(key).getrandbits

    def part(self) -> float:
        """Draw from (0, 1), even."""
        return (2 * self._bits(40) + 1) / 2**41

    def between(self, low: float, high: float) -> float:
        """Draw from (low, high), even."""
        return low + (high - low) * self.part()

    def short(self, low: float, high: float) -> float:
        """Draw a number of at most four decimals from [low, high]."""
        places = [math.ceil(low * 10_000), math.floor(high * 10_000)]
        return (places[0] + self._bits(30) % (places[1] - places[0] + 1)) / 10_000

    def pick(self, options: Sequence[T]) -> T:
        """Draw one of several."""
        return options[self._bits(30) % len(options)]

    def power(self, low: int, high: int) -> float:
        """Draw a power of two, low <= exponent <= high."""
        return 2.0 ** self.pick(range(low, high + 1))

    def direction(self) -> tuple[float, float]:
        """Draw a unit vector: a rational point of the circle, in any octant."""
        p = self.part()
        c, s = (1 - p * p) / (1 + p * p), 2 * p / (1 + p * p)
        if self.pick((False, True)):
            c, s = s, c
        return c * self.pick((1.0, -1.0)), s * self.pick((1.0, -1.0))


class SharedPeriod(NamedTuple):
    """What the moving laws of a scene share: kind, and omega or the period.

    Of kind "mixed" each law is of its own kind, and of "harmonics" a Fourier law of four to sixteen; both
    share a period.
    """

    kind: str
    rate: float


def clock(draw: Draw, kinds: Sequence[str] = ("fourier", "bang-bang", "constant")) -> SharedPeriod:
    """Draw what the laws of a scene share."""
    kind = draw.pick(kinds)
    return SharedPeriod(kind, draw.short(0.5, 6.0) if kind == "fourier" else draw.pick((0.5, 1.0, 1.5, 4.0)))


def law(draw: Draw, low: float, high: float, shared: SharedPeriod) -> Law:
    """Draw a law that stays within [low, high]; now and then one that stands still."""
    if shared.kind == "mixed":
        found = law(draw, low, high, shared._replace(kind=draw.pick(("fourier", "bang-bang", "constant"))))
        return replace(found, omega=None, period=shared.rate) if isinstance(found, Fourier) else found
    if shared.kind == "constant" or draw.pick(range(6)) == 0:
        return draw.short(low, high)
    if shared.kind == "bang-bang":
        n = draw.pick((2, 3, 4))
        places = sorted({draw.pick(range(1, 64)) for _ in range(n - 1)})
        times = [0.0, *(shared.rate * place / 64 for place in places), shared.rate]
        values = [draw.short(low, high) for _ in times[1:]]
        return BangBang(knots=tuple(zip(times, [*values, values[0]], strict=True)))
    mean = draw.short(0.75 * low + 0.25 * high, 0.25 * low + 0.75 * high)
    n_cos, n_sin = draw.pick(MANY_HARMONICS if shared.kind == "harmonics" else FEW_HARMONICS)
    size = 0.999 * min(high - mean, mean - low) / (n_cos + n_sin)
    amplitudes = [draw.short(-size, size) for _ in range(n_cos + n_sin)]
    cos, sin = tuple(amplitudes[:n_cos]), tuple(amplitudes[n_cos:])
    if shared.kind == "harmonics":
        return Fourier(mean=mean, period=shared.rate, cos=cos, sin=sin)
    return Fourier(mean=mean, omega=shared.rate, cos=cos, sin=sin)


def deep_wave(low: float, high: float, a: float, b: float, omega: float) -> Fourier:
    """Return a law in [low, high]: low and a share of |1 + a e^ix + b e^2ix|^2, which is never negative.

    Its amplitudes may add up to more than its mean.
    """
    unit = (high - low) / (1 + abs(a) + b) ** 2
    waves = (2 * a * (1 + b) * unit, 2 * b * unit)
    return Fourier(mean=low + (1 + a * a + b * b) * unit, omega=omega, cos=waves)


def scene(draw: Draw, table: str, shared: SharedPeriod) -> Scene:
    """Draw a valid scene of a table: "cap", "stem" or "mushroom"."""
    if table == "cap":
        return Cap(r=law(draw, 0.25, 2.0, shared))
    if table == "stem":
        w, h = law(draw, 0.25, 2.0, shared), law(draw, 0.5, 3.0, shared)
        return Stem(w=w, h=h, slope=_slope(draw, bounds(w).lowest, bounds(h).highest, shared))
    r, h = law(draw, 0.75, 2.0, shared), law(draw, 0.5, 3.0, shared)
    narrowest = bounds(r).lowest
    if draw.pick((False, True)):
        nu = law(draw, 0.2, 1.0, shared)
        slope = _slope(draw, narrowest * bounds(nu).lowest, bounds(h).highest, shared)
        return Mushroom(r=r, nu=nu, h=h, slope=slope)
    w = law(draw, narrowest / 4, narrowest * 0.99, shared)
    return Mushroom(r=r, w=w, h=h, slope=_slope(draw, bounds(w).lowest, bounds(h).highest, shared))


def _slope(draw: Draw, narrowest: float, deepest: float, shared: SharedPeriod) -> Law:
    steepest = 0.9 * narrowest / deepest
    kind = draw.pick(("positive", "zero", "negative", "moving"))
    if kind == "moving" and steepest > 0.01:
        return law(draw, -0.5, steepest, shared)
    if kind == "positive" and steepest > 0.001:
        return draw.short(0.0001, steepest)
    return draw.short(-0.8, -0.01) if kind == "negative" else 0.0


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


def wire_form(of: Scene) -> dict[str, Any]:
    """Return a scene as JSON has it, without its name and notes."""
    return _through_json({key: law for key, law in to_data(of).items() if key not in ("name", "notes")})


def unproved(table: str, **laws: Any) -> dict[str, Any]:
    """Return a scene as JSON has it whose laws, or their plain data, may break the rules of scenes."""
    data = {"table": table, **{name: msgspec.to_builtins(law) for name, law in laws.items()}}
    for law in data.values():
        if isinstance(law, dict) and "period" in law:
            del law["omega" if law["omega"] is None else "period"]
    return _through_json(data)


def _through_json(data: dict[str, Any]) -> dict[str, Any]:
    decoded: dict[str, Any] = msgspec.json.decode(msgspec.json.encode(data))  # lists for tuples
    return decoded


def walls_speed(scene: Scene) -> float:
    """Return a bound of the walls' speeds; 0 when nothing moves.

    nu moves the mouth at the scale of r, slope the sides at the scale of h.
    """
    found = {name: bounds(law) for name, law in laws(scene).items()}
    reach = {name: found[of].highest for name, of in (("nu", "r"), ("slope", "h")) if name in found}
    return max(law.slope * reach.get(name, 1.0) for name, law in found.items())


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
