"""Hypothesis strategies: valid scenes of every kind, and states from which a step makes sense.

Scenes are valid by construction: each law is drawn inside a range, and the ranges are nested so
that r, h, w > 0, w <= r and w > h slope hold whatever the laws do between. States are placed by
two fractions of the table (or of a wall) and drawn towards its middle until 50 digits show them
strictly inside. When a test fails, the failing step is printed as the wire's line.
Not handled: particles at rest, and the deliberately nasty cases that hunt one bug each.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from functools import cache
from typing import Any, Literal, NamedTuple, TypeVar

import msgspec
from hypothesis import currently_in_test_context, note
from hypothesis import strategies as st

from conformance.cases.draws import deep_wave, walls_speed
from scene import BangBang, Cap, Fourier, Law, Mushroom, Scene, State, Stem, Wall, to_data
from scene.geometry import DIGITS, TableAt, table_at
from scene.laws import bounds, breakpoints
from scene.precision import decimals
from scene.sizes import size_bounds
from scene.tables import cycle_length
from scene.tables import laws as laws_of
from scene.transforms import scaled

T = TypeVar("T")
MARGIN = 1 - 2.0**-40  # keeps the rounding of sums of amplitudes inside the range asked for
LONGEST_FLIGHT = 16  # periods: what a slow particle may wait for a wall


class Clock(NamedTuple):
    """What the moving laws of a scene share: their kind and period.

    The period [time] is 2 pi / rate for Fourier laws, `rate` itself for bang-bang ones, which
    start at `start` [time].
    """

    kind: Literal["constant", "fourier", "bang-bang"]
    rate: float = 1.0
    start: float = 0.0


@cache
def fractions() -> st.SearchStrategy[float]:
    """Draw from the open interval (0, 1): uniform, or within 2^-k of an end, k up to 52."""
    uniform = st.integers(1, 2**20 - 1).map(lambda n: _scatter(n, 20) / 2**20)
    near_0 = st.integers(2, 52).map(lambda k: 2.0**-k)
    return st.one_of(st.just(0.5), uniform, uniform, uniform, near_0, near_0.map(lambda e: 1 - e))


@cache
def clocks() -> st.SearchStrategy[Clock]:
    """Draw what the laws of a scene share: static, Fourier or bang-bang, periods of order 1 to 10."""
    sixteenths = st.integers(8, 64).map(lambda n: n / 16)
    starts = st.one_of(st.just(0.0), st.integers(-32, 32).map(lambda n: n / 16))
    return st.one_of(
        _SHARES.map(lambda share: Clock("fourier", 0.5 + 7.5 * share)),
        st.builds(Clock, st.just("bang-bang"), sixteenths, starts),
        st.just(Clock("constant")),
    )


def _scatter(n: int, bits: int) -> int:
    # Hypothesis favours small integers; times an odd number, modulo 2^bits, they spread evenly.
    return (n * 648055) & ((1 << bits) - 1)


# Made once, and functions that draw from them: Hypothesis looks through every strategy anew that is made
# while it draws, which takes longer than to draw from it.
_SHARES = st.integers(0, 2**20).map(lambda n: 1.0 if n == 2**20 else _scatter(n, 20) / 2**20)
_PLACES = st.integers(0, 2**20 - 1)
_KNOTS = st.integers(1, 4095).map(lambda n: _scatter(n, 12))
_N_WAVES = st.sampled_from([(i, j) for i in range(5) for j in range(5) if i + j])
_TURNS = st.one_of(st.integers(-2, 3), st.sampled_from((0, 0, 1000, -1000)))
_ONE_OF_SIX, _ONE_OF_FIVE, _ONE_OF_FOUR, _ONE_OF_THREE = (st.integers(0, n) for n in (5, 4, 3, 2))
_COIN = st.booleans()
_N_LEGS = st.integers(2, 6)
_INNER_KNOTS = {n: st.lists(_KNOTS, min_size=n, max_size=n, unique=True) for n in range(1, 6)}
_SHIFTS = st.sampled_from((0.0, 1 / 3))
_POWERS = st.integers(-20, 20)
_CLEARANCES = st.sampled_from((0.5, 2.0**-4, 2.0**-20))
_SLOPES = st.sampled_from(("positive", "zero", "negative", "moving"))
_WAITS = st.sampled_from((4.0, 1.0, 0.125, 2.0**-20, 0.0))
_LIFTS = st.integers(2, 50)


def _between(draw: st.DrawFn, low: float, high: float) -> float:
    # Even on a grid of 2^-20 of the range, the ends included.
    return min(low + (high - low) * draw(_SHARES), high)


def _one_of(draw: st.DrawFn, options: Sequence[T]) -> T:
    return options[_scatter(draw(_PLACES), 20) * len(options) >> 20]


@st.composite
def laws(draw: st.DrawFn, low: float = 0.5, high: float = 2.0, clock: Clock | None = None) -> Law:
    """Draw a law that stays within [low, high] at all times.

    Args:
        draw: given by Hypothesis.
        low: lower bound, any unit.
        high: upper bound, low <= high.
        clock: kind and period; None draws them.

    Returns:
        A constant (sometimes under any clock, and then sometimes written as a law that moves by
        nothing), 1 to 4 harmonics, or 2 to 6 legs. Fourier laws sometimes touch a bound exactly; those
        of positive bounds sometimes have amplitudes that add up to more than their mean.
    """
    return _law(draw, low, high, draw(clocks()) if clock is None else clock)


def _law(draw: st.DrawFn, low: float, high: float, clock: Clock) -> Law:
    if clock.kind == "constant" or draw(_ONE_OF_SIX) == 5:
        constant = _between(draw, low, high)
        still = BangBang(knots=((clock.start, constant), (clock.start + clock.rate, constant)))
        flat = Fourier(mean=constant, omega=clock.rate, cos=(0.0,))
        ways: list[Law] = [constant, constant, flat, still]
        return ways[draw(_ONE_OF_FOUR)]
    if clock.kind == "fourier":
        return _fourier(draw, low, high, clock.rate)
    return _bang_bang(draw, low, high, clock)


def _fourier(draw: st.DrawFn, low: float, high: float, omega: float) -> Fourier:
    mean = _between(draw, 0.75 * low + 0.25 * high, 0.25 * low + 0.75 * high)
    swing = min(high - mean, mean - low)
    if low > 0.0 and draw(_ONE_OF_SIX) == 5:
        return _deep_wave(draw, low, high, omega)
    n_cos, n_sin = draw(_N_WAVES)
    if (n_cos, n_sin) == (1, 0):
        # One cosine that reaches the nearer bound, exactly where mean and bound are dyadic.
        return Fourier(mean=mean, omega=omega, cos=(swing if mean + swing <= high else swing * MARGIN,))
    size = swing * MARGIN / (n_cos + n_sin)
    amplitudes = [_between(draw, -size, size) if draw(_COIN) else size for _ in range(n_cos + n_sin)]
    return Fourier(mean=mean, omega=omega, cos=tuple(amplitudes[:n_cos]), sin=tuple(amplitudes[n_cos:]))


def _deep_wave(draw: st.DrawFn, low: float, high: float, omega: float) -> Fourier:
    # The range is cut by MARGIN of it, half at either end.
    a, b = (_between(draw, *ends) for ends in ((0.5, 1.5), (0.1, 0.6)))
    room = (1 - MARGIN) * (high - low) / 2
    return deep_wave(low + room, high - room, a if draw(_COIN) else -a, b, omega)


def _bang_bang(draw: st.DrawFn, low: float, high: float, clock: Clock) -> BangBang:
    # Inner knots on a grid of 1/4096 of the period; or off every grid, to 1/3 of a step.
    n_legs = draw(_N_LEGS)
    places = draw(_INNER_KNOTS[n_legs - 1])
    shift = draw(_SHIFTS)
    times = [clock.start + clock.rate * ((place + shift) / 4096) for place in sorted(places)]
    values = [(low, high)[draw(_COIN)] if draw(_COIN) else _between(draw, low, high) for _ in range(n_legs)]
    times = [clock.start, *times, clock.start + clock.rate]
    return BangBang(knots=tuple(zip(times, [*values, values[0]], strict=True)))


@st.composite
def scenes(draw: st.DrawFn, table: str | None = None) -> Scene:
    """Draw a valid scene.

    Args:
        draw: given by Hypothesis.
        table: "cap", "stem" or "mushroom"; None draws one.

    Returns:
        A table with laws of one kind and one period; the mouth as `w` or `nu`, up to w = r and
        nu = 1; slope positive, zero, negative or moving. Sizes [length] and periods [time] are of
        order 1, in one scene of three scaled by powers of two from 2^-20 to 2^20.
    """
    table = _one_of(draw, ("mushroom", "cap", "stem")) if table is None else table
    clock = draw(clocks())
    scene: Scene
    if table == "cap":
        scene = Cap(r=_law(draw, 0.25, 2.0, clock))
    elif table == "stem":
        w = _law(draw, 0.125, 2.0, clock)
        h = _law(draw, 0.25, 4.0, clock)
        scene = Stem(w=w, h=h, slope=_slopes(draw, size_bounds(w).lowest, bounds(h).highest, clock))
    else:
        scene = _mushroom(draw, clock)
    if draw(_ONE_OF_THREE) == 2:
        scene = rescale(scene, draw(_POWERS), draw(_POWERS))
    return scene


def _mushroom(draw: st.DrawFn, clock: Clock) -> Mushroom:
    r = _law(draw, 0.5, 2.0, clock)
    h = _law(draw, 0.25, 4.0, clock)
    narrowest, deepest = size_bounds(r).lowest, bounds(h).highest
    if draw(_COIN):
        nu = _law(draw, 0.125, 1.0, clock)
        narrowest *= size_bounds(nu).lowest
        return Mushroom(r=r, nu=nu, h=h, slope=_slopes(draw, narrowest, deepest, clock))
    w = _law(draw, narrowest / 8, narrowest * MARGIN, clock)
    return Mushroom(r=r, w=w, h=h, slope=_slopes(draw, size_bounds(w).lowest, deepest, clock))


def _slopes(draw: st.DrawFn, narrowest: float, deepest: float, clock: Clock) -> Law:
    # A stem that widens downwards may do so freely; one that narrows must stay open at its floor.
    steepest = narrowest / deepest * (1 - draw(_CLEARANCES))
    kind = draw(_SLOPES)
    if kind == "zero":
        return 0.0
    if kind == "positive":
        return _between(draw, steepest / 64, steepest)
    if kind == "negative":
        return _between(draw, -1.0, -1 / 64)
    return _law(draw, -0.5, steepest, clock)


def rescale(scene: Scene, length: int, time: int) -> Scene:
    """Return the scene with lengths times 2^length and times times 2^time, exactly.

    Ratios (`nu`, `slope`), name and notes stay. Exact as long as no number becomes subnormal or overflows.
    """
    return msgspec.structs.replace(scaled(scene, length, time), name=scene.name, notes=scene.notes)


class _Place(NamedTuple):
    """Where a particle may be at one instant: decided to 50 digits, placed in binary64.

    Attributes:
        ctx: number system of 50 digits.
        exact: the table in it.
        near: the same table rounded.
    """

    ctx: Any
    exact: TableAt
    near: TableAt

    @classmethod
    def of(cls, scene: Scene, t: float) -> _Place:
        ctx = decimals(DIGITS)
        exact = table_at(ctx, scene, t)
        return cls(ctx, exact, exact.rounded())

    def gap(self, wall: Wall, x: float, y: float) -> Any:
        """Return the wall's function f > 0 inside."""
        return self.exact.gap(wall, self.ctx.mpf(x), self.ctx.mpf(y))

    def rate(self, wall: Wall, *flight: float) -> Any:
        """Return the rate of f along the flight x, y, vx, vy."""
        return self.exact.gap_rate(wall, *map(self.ctx.mpf, flight))

    def is_clear(self, x: float, y: float, start: Wall | None) -> bool:
        """Tell whether (x, y) is strictly inside, the wall it starts on left aside."""
        scene = self.exact.scene
        if isinstance(scene, Mushroom):
            if start == "base" or (start is None and y == 0):
                is_over_mouth = bool(abs(self.ctx.mpf(x)) < self.exact.w)
                is_beside = bool(abs(self.ctx.mpf(x)) > self.exact.w) and bool(self.gap("arc", x, 0.0) > 0)
                return y == 0 and (is_beside if start else is_over_mouth)
            is_in_cap = y > 0 and start in (None, "arc")
            if not is_in_cap and (y >= 0 or start == "arc"):
                return False
            near: tuple[Wall, ...] = ("arc",) if is_in_cap else ("left", "right", "floor")
        else:
            near = scene.walls
        return all(self.gap(wall, x, y) > 0 for wall in near if wall != start)

    def point(self, site: str, a: float, b: float) -> tuple[float, float]:
        """Place two fractions of a region, or one of a wall; (1/2, 1/2) is its middle."""
        at = self.near
        if site in ("cap", "arc"):
            rho = at.r if site == "arc" else at.r * b
            return rho * math.cos(math.pi * a), rho * math.sin(math.pi * a)
        if site == "base" and not isinstance(at.scene, Stem):
            return math.copysign(at.w + (at.r - at.w) * b, a - 0.5), 0.0
        return at.stem_point(site, 2 * b - 1, a)


@st.composite
def states(draw: st.DrawFn, scene: Scene) -> tuple[State, float]:
    """Draw a state inside the table, or leaving one of its walls, and a horizon.

    Args:
        draw: given by Hypothesis.
        scene: a valid scene.

    Returns:
        (state, t_end). The place is uniform or close to a wall, corner, the mouth or the centre;
        the speed is 10^-3 to 10^6 times that of the walls (of the table's size per unit of time
        when nothing moves), or what a reflection from them makes of that; t lies within a few periods of 0 or
        of a thousand of them, sometimes on a knot or at 0; t_end is mostly late enough for a collision, or
        early, or t itself. About half of the states leave a wall: they lie on it up to the rounding of x and
        y, and their gap to it grows. Of what is hit the base of a mushroom comes least, in 2 hits of 100.
    """
    t = _time(draw, scene)
    place = _Place.of(scene, t)
    wall: Wall | None = _one_of(draw, [*(None for _ in scene.walls), *scene.walls])
    wall, x, y = _placed(draw, place, wall)
    speed = (walls_speed(scene) or place.near.size) * 10 ** _between(draw, -3.0, 6.0)
    vx, vy = _heading(draw, place, wall, x, y)
    vx, vy = _leaving(place, wall, x, y, speed * vx, speed * vy)
    flight = place.near.size / speed * draw(_WAITS)
    if length := cycle_length(scene):
        flight = min(flight, LONGEST_FLIGHT * length)
    state, t_end = State(t, x, y, vx, vy, wall), t + flight
    if currently_in_test_context():
        asked = {"scene": to_data(scene), "state": msgspec.structs.asdict(state), "t_end": t_end}
        note(json.dumps({"cmd": "step", "seq": 1, **asked}))
    return state, t_end


@st.composite
def scenes_and_states(draw: st.DrawFn, table: str | None = None) -> tuple[Scene, State, float]:
    """Draw (scene, state, t_end): see `scenes` and `states`."""
    scene = draw(scenes(table))
    state, t_end = draw(states(scene))
    return scene, state, t_end


def adversarial(family: str | None = None) -> st.SearchStrategy[Any]:
    """Draw a `conformance.cases.attacks.Attack` of a family by its name, or of any."""
    from conformance.cases.attacks import FAMILIES

    names = st.sampled_from([family] if family else list(FAMILIES))
    return st.builds(lambda name, index: FAMILIES[name].attack(0, index), names, st.integers(0, 2**32 - 1))


def _time(draw: st.DrawFn, scene: Scene) -> float:
    length = cycle_length(scene) or 1.0
    knots = [float(t) for law in laws_of(scene).values() for t in breakpoints(law)] or [0.0]
    turns = draw(_TURNS)
    way = draw(_ONE_OF_FIVE)
    if way == 4:
        return length * turns + _one_of(draw, knots)
    return length * (turns + draw(fractions())) if way else 0.0


def _placed(draw: st.DrawFn, place: _Place, wall: Wall | None) -> tuple[Wall | None, float, float]:
    regions = {Cap: ("cap",), Stem: ("stem",), Mushroom: ("mouth", "cap", "stem", "cap", "stem")}
    site: str = wall or _one_of(draw, regions[type(place.near.scene)])
    a, b = draw(fractions()), draw(fractions())
    if site == "cap" and draw(_ONE_OF_SIX) == 5:
        # Low over the base, near the mouth's edge (in a cap: near the centre).
        a = min(a, 1 - a)
        b = min(place.near.w / place.near.r * (0.5 + b), 1 - 2.0**-30)
    # Towards the middle in ever larger parts: what is near a wall stays as near as it may.
    for part in (0.0, *(2.0**-k for k in range(52, -1, -4))):
        x, y = place.point(site, a + part * (0.5 - a), b + part * (0.5 - b))
        if place.is_clear(x, y, wall):
            return wall, x, y
    # Only the base of a mushroom may be too short to hold a point: the mouth is as wide as the cap.
    return _placed(draw, place, "arc")


def _heading(draw: st.DrawFn, place: _Place, wall: Wall | None, x: float, y: float) -> tuple[float, float]:
    # A unit vector: any direction; along an axis; to or around the centre; grazing the wall it leaves.
    turn = 2 * math.pi * draw(fractions())
    any_way = (math.cos(turn), math.sin(turn))
    axes = [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)]
    distance = math.hypot(x, y) or 1.0
    radial = [(-x / distance, -y / distance), (-y / distance, x / distance)] if x or y else axes[:2]
    if wall is None:
        return _one_of(draw, axes + radial) if draw(_ONE_OF_THREE) == 2 else any_way
    nx, ny = place.near.normal(wall, x, y)
    lift, sense = 2.0 ** -draw(_LIFTS), 1.0 if draw(_COIN) else -1.0
    grazing = (lift * nx - sense * ny, lift * ny + sense * nx)
    return _one_of(draw, (any_way, any_way, grazing, grazing, (nx, ny), *axes))


def _leaving(place: _Place, wall: Wall | None, x: float, y: float, *v: float) -> tuple[float, float]:
    # A particle that approaches its wall is first reflected; one that then still grazes it
    # within rounding leaves along the normal, outrunning the wall.
    vx, vy = v
    if wall is None or place.rate(wall, x, y, vx, vy) > 0:
        return vx, vy
    nx, ny = place.near.normal(wall, x, y)
    drift = place.rate(wall, x, y, 0.0, 0.0)
    along = float(place.rate(wall, x, y, nx, ny) - drift)
    approach = float(place.rate(wall, x, y, vx, vy)) / along
    away = vx - 2 * approach * nx, vy - 2 * approach * ny
    if place.rate(wall, x, y, *away) > 0:
        return away
    push = abs(float(drift)) / along + math.hypot(vx, vy)
    return push * nx, push * ny
