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
from typing import Any, Literal, NamedTuple, TypeVar

from hypothesis import currently_in_test_context, note
from hypothesis import strategies as st

from scene import BangBang, Cap, Fourier, Law, Mushroom, Scene, State, Stem, Wall, to_data
from scene.laws import bounds, breakpoints, value
from scene.precision import decimals
from scene.tables import laws as laws_of
from scene.tables import period, width_factors
from scene.transforms import scaled_law

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


def fractions() -> st.SearchStrategy[float]:
    """Draw from the open interval (0, 1): uniform, or within 2^-k of an end, k up to 52."""
    uniform = st.integers(1, 2**20 - 1).map(lambda n: _scatter(n, 20) / 2**20)
    near_0 = st.integers(2, 52).map(lambda k: 2.0**-k)
    return st.one_of(st.just(0.5), uniform, uniform, uniform, near_0, near_0.map(lambda e: 1 - e))


def clocks() -> st.SearchStrategy[Clock]:
    """Draw what the laws of a scene share: static, Fourier or bang-bang, periods of order 1 to 10."""
    sixteenths = st.integers(8, 64).map(lambda n: n / 16)
    starts = st.one_of(st.just(0.0), st.integers(-32, 32).map(lambda n: n / 16))
    return st.one_of(
        _between(0.5, 8.0).map(lambda omega: Clock("fourier", omega)),
        st.builds(Clock, st.just("bang-bang"), sixteenths, starts),
        st.just(Clock("constant")),
    )


def _scatter(n: int, bits: int) -> int:
    # Hypothesis favours small integers; times an odd number, modulo 2^bits, they spread evenly.
    return (n * 648055) & ((1 << bits) - 1)


def _between(low: float, high: float) -> st.SearchStrategy[float]:
    # Even on a grid of 2^-20 of the range, the ends included.
    part = st.integers(0, 2**20).map(lambda n: 1.0 if n == 2**20 else _scatter(n, 20) / 2**20)
    return part.map(lambda share: min(low + (high - low) * share, high))


def _one_of(options: Sequence[T]) -> st.SearchStrategy[T]:
    return st.integers(0, 2**20 - 1).map(lambda n: options[_scatter(n, 20) * len(options) >> 20])


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
        nothing), 1 to 4 harmonics, or 2 to 6 legs. Fourier laws sometimes touch a bound exactly.
    """
    clock = draw(clocks()) if clock is None else clock
    if clock.kind == "constant" or draw(st.integers(0, 5)) == 5:
        constant = draw(_between(low, high))
        still = BangBang(knots=((clock.start, constant), (clock.start + clock.rate, constant)))
        flat = Fourier(mean=constant, omega=clock.rate, cos=(0.0,))
        ways: list[Law] = [constant, constant, flat, still]
        return draw(st.sampled_from(ways))
    if clock.kind == "fourier":
        return draw(_fourier(low, high, clock.rate))
    return draw(_bang_bang(low, high, clock))


@st.composite
def _fourier(draw: st.DrawFn, low: float, high: float, omega: float) -> Fourier:
    mean = draw(_between(0.75 * low + 0.25 * high, 0.25 * low + 0.75 * high))
    swing = min(high - mean, mean - low)
    n_cos, n_sin = draw(st.sampled_from([(i, j) for i in range(5) for j in range(5) if i + j]))
    if (n_cos, n_sin) == (1, 0):
        # One cosine that reaches the nearer bound, exactly where mean and bound are dyadic.
        return Fourier(mean=mean, omega=omega, cos=(swing if mean + swing <= high else swing * MARGIN,))
    size = swing * MARGIN / (n_cos + n_sin)
    amplitudes = st.one_of(st.just(size), _between(-size, size))
    cos = tuple(draw(st.lists(amplitudes, min_size=n_cos, max_size=n_cos)))
    sin = tuple(draw(st.lists(amplitudes, min_size=n_sin, max_size=n_sin)))
    return Fourier(mean=mean, omega=omega, cos=cos, sin=sin)


@st.composite
def _bang_bang(draw: st.DrawFn, low: float, high: float, clock: Clock) -> BangBang:
    # Inner knots on a grid of 1/4096 of the period; or off every grid, to 1/3 of a step.
    n_legs = draw(st.integers(2, 6))
    places = draw(
        st.lists(
            st.integers(1, 4095).map(lambda n: _scatter(n, 12)),
            min_size=n_legs - 1,
            max_size=n_legs - 1,
            unique=True,
        )
    )
    shift = draw(st.sampled_from((0.0, 1 / 3)))
    times = [clock.start + clock.rate * ((place + shift) / 4096) for place in sorted(places)]
    levels = st.one_of(_between(low, high), st.sampled_from((low, high)))
    values = draw(st.lists(levels, min_size=n_legs, max_size=n_legs))
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
    table = draw(_one_of(("mushroom", "cap", "stem"))) if table is None else table
    clock = draw(clocks())
    scene: Scene
    if table == "cap":
        scene = Cap(r=draw(laws(0.25, 2.0, clock)))
    elif table == "stem":
        w = draw(laws(0.125, 2.0, clock))
        h = draw(laws(0.25, 4.0, clock))
        scene = Stem(w=w, h=h, slope=draw(_slopes(bounds(w).lowest, bounds(h).highest, clock)))
    else:
        scene = draw(_mushrooms(clock))
    if draw(st.integers(0, 2)) == 2:
        scene = rescale(scene, draw(st.integers(-20, 20)), draw(st.integers(-20, 20)))
    return scene


@st.composite
def _mushrooms(draw: st.DrawFn, clock: Clock) -> Mushroom:
    r = draw(laws(0.5, 2.0, clock))
    h = draw(laws(0.25, 4.0, clock))
    narrowest, deepest = bounds(r).lowest, bounds(h).highest
    if draw(st.booleans()):
        nu = draw(laws(0.125, 1.0, clock))
        narrowest *= bounds(nu).lowest
        return Mushroom(r=r, nu=nu, h=h, slope=draw(_slopes(narrowest, deepest, clock)))
    w = draw(laws(narrowest / 8, narrowest * MARGIN, clock))
    return Mushroom(r=r, w=w, h=h, slope=draw(_slopes(bounds(w).lowest, deepest, clock)))


@st.composite
def _slopes(draw: st.DrawFn, narrowest: float, deepest: float, clock: Clock) -> Law:
    # A stem that widens downwards may do so freely; one that narrows must stay open at its floor.
    steepest = narrowest / deepest * (1 - draw(st.sampled_from((0.5, 2.0**-4, 2.0**-20))))
    kind = draw(st.sampled_from(("positive", "zero", "negative", "moving")))
    if kind == "zero":
        return 0.0
    if kind == "positive":
        return draw(_between(steepest / 64, steepest))
    if kind == "negative":
        return draw(_between(-1.0, -1 / 64))
    return draw(laws(-0.5, steepest, clock))


def rescale(scene: Scene, length: int, time: int) -> Scene:
    """Return the scene with lengths times 2^length and times times 2^time, exactly.

    Ratios (`nu`, `slope`) stay. Exact as long as no number becomes subnormal or overflows.
    """
    sizes = {"nu": 1.0, "slope": 1.0}
    moved = {
        name: scaled_law(law, sizes.get(name, 2.0**length), 2.0**time) for name, law in laws_of(scene).items()
    }
    return type(scene)(**moved, name=scene.name, notes=scene.notes)


class _Moment:
    # The table at one instant to 50 digits, and the same numbers rounded for placing particles.

    def __init__(self, scene: Scene, t: float) -> None:
        self.ctx, self.scene = decimals(50), scene
        ctx = self.ctx
        found = {name: self._motion(law, t) for name, law in laws_of(scene).items()}
        if not isinstance(scene, Cap):
            w, w_rate = ctx.mpf(1), ctx.mpf(0)
            for factor, rate in (self._motion(law, t) for law in width_factors(scene)):
                w, w_rate = w * factor, w_rate * factor + w * rate
            found["w"] = (w, w_rate)
        absent = (ctx.mpf(0), ctx.mpf(0))
        (self.r, self.r_rate), (self.w, self.w_rate) = found.get("r", absent), found.get("w", absent)
        (self.h, self.h_rate), (self.slope, self.slope_rate) = (found.get(n, absent) for n in ("h", "slope"))
        self.size = float(2 * self.r + 2 * self.w + self.h)

    def _motion(self, law: Law, t: float) -> tuple[Any, Any]:
        return value(self.ctx, law, t), value(self.ctx, law, t, 1)

    def gap(self, wall: Wall, x: float, y: float, vx: float = 0.0, vy: float = 0.0) -> tuple[Any, Any]:
        """The wall's function f > 0 inside [length; the arc's: length^2], and its rate along the flight."""
        X, Y, VX, VY = map(self.ctx.mpf, (x, y, vx, vy))
        if wall == "arc":
            return self.r * self.r - X * X - Y * Y, 2 * (self.r * self.r_rate - X * VX - Y * VY)
        if wall == "floor":
            return Y + self.h, VY + self.h_rate
        if wall == "base":
            return (-Y, -VY) if isinstance(self.scene, Stem) else (Y, VY)
        edge = self.w + self.slope * Y
        rate = self.w_rate + self.slope_rate * Y + self.slope * VY
        return (edge + X, rate + VX) if wall == "left" else (edge - X, rate - VX)

    def is_clear(self, x: float, y: float, start: Wall | None) -> bool:
        """Tell whether (x, y) is strictly inside, the wall it starts on left aside."""
        if isinstance(self.scene, Mushroom):
            if start == "base" or (start is None and y == 0):
                is_over_mouth = bool(abs(self.ctx.mpf(x)) < self.w)
                is_beside = bool(abs(self.ctx.mpf(x)) > self.w) and bool(self.gap("arc", x, 0.0)[0] > 0)
                return y == 0 and (is_beside if start else is_over_mouth)
            is_in_cap = y > 0 and start in (None, "arc")
            if not is_in_cap and (y >= 0 or start == "arc"):
                return False
            near: tuple[Wall, ...] = ("arc",) if is_in_cap else ("left", "right", "floor")
        else:
            near = self.scene.walls
        return all(self.gap(wall, x, y)[0] > 0 for wall in near if wall != start)

    def point(self, site: str, a: float, b: float) -> tuple[float, float]:
        """Place two fractions of a region, or one of a wall; (1/2, 1/2) is its middle."""
        r, w, h, slope = map(float, (self.r, self.w, self.h, self.slope))
        side = 2 * b - 1
        if site in ("cap", "arc"):
            rho = r if site == "arc" else r * b
            return rho * math.cos(math.pi * a), rho * math.sin(math.pi * a)
        if site == "mouth" or (site == "base" and isinstance(self.scene, Stem)):
            return w * side, 0.0
        if site == "base":
            return math.copysign(w + (r - w) * b, a - 0.5), 0.0
        if site == "floor":
            return side * float(self.w - self.slope * self.h), -h
        half_width = w - slope * h * a
        return half_width * {"left": -1.0, "right": 1.0}.get(site, side), -h * a

    def normal(self, wall: Wall, x: float, y: float) -> tuple[float, float]:
        """The wall's unit normal that points inside."""
        if wall == "arc":
            distance = math.hypot(x, y)
            return -x / distance, -y / distance
        if wall in ("base", "floor"):
            return 0.0, -1.0 if wall == "base" and isinstance(self.scene, Stem) else 1.0
        slope = float(self.slope)
        length = math.hypot(1.0, slope)
        return (1.0 if wall == "left" else -1.0) / length, slope / length


@st.composite
def states(draw: st.DrawFn, scene: Scene) -> tuple[State, float]:
    """Draw a state inside the table, or leaving one of its walls, and a horizon.

    Args:
        draw: given by Hypothesis.
        scene: a valid scene.

    Returns:
        (state, t_end). The place is uniform or close to a wall, corner, the mouth or the centre;
        the speed is 10^-3 to 10^6 times that of the walls (of the table's size per unit of time
        when nothing moves); t lies within a few periods, sometimes on a knot or at 0; t_end is
        late enough for a collision, or early, or t itself. Half of the states leave a wall: they
        lie on it up to the rounding of x and y, and their gap to it grows.
    """
    t = draw(_times(scene))
    moment = _Moment(scene, t)
    wall: Wall | None = draw(_one_of([*(None for _ in scene.walls), *scene.walls]))
    wall, x, y = draw(_places(moment, wall))
    walls_speed = _walls_speed(scene) or moment.size
    speed = walls_speed * 10 ** draw(_between(-3.0, 6.0))
    vx, vy = draw(_headings(moment, wall, x, y))
    vx, vy = _leaving(moment, wall, x, y, speed * vx, speed * vy)
    flight = moment.size / speed * draw(st.sampled_from((4.0, 1.0, 0.125, 2.0**-20, 0.0)))
    shared = period(scene)
    if shared is not None:
        flight = min(flight, LONGEST_FLIGHT * float(shared.value(moment.ctx)))
    state, t_end = State(t, x, y, vx, vy, wall), t + flight
    if currently_in_test_context():
        fields = {name: getattr(state, name) for name in state.__struct_fields__}
        wire = {"cmd": "step", "seq": 1, "scene": to_data(scene), "state": fields, "t_end": t_end}
        note(json.dumps(wire))
    return state, t_end


@st.composite
def scenes_and_states(draw: st.DrawFn, table: str | None = None) -> tuple[Scene, State, float]:
    """Draw (scene, state, t_end): see `scenes` and `states`."""
    scene = draw(scenes(table))
    state, t_end = draw(states(scene))
    return scene, state, t_end


def adversarial(family: str | None = None) -> st.SearchStrategy[Any]:
    """Draw a `conformance.attacks.Attack` of a family by its name, or of any; needs python-flint."""
    from conformance.attacks import FAMILIES

    names = st.sampled_from([family] if family else list(FAMILIES))
    return st.builds(lambda name, index: FAMILIES[name].attack(0, index), names, st.integers(0, 2**32 - 1))


@st.composite
def _times(draw: st.DrawFn, scene: Scene) -> float:
    shared = period(scene)
    length = 1.0 if shared is None else float(shared.value(decimals()))
    knots = [float(t) for law in laws_of(scene).values() for t in breakpoints(law)] or [0.0]
    turns = draw(st.one_of(st.integers(-2, 3), st.sampled_from((0, 0, 1000, -1000))))
    inside = fractions().map(lambda part: length * (turns + part))
    at_knot = st.sampled_from(knots).map(lambda knot: length * turns + knot)
    return draw(st.one_of(st.just(0.0), inside, inside, inside, at_knot))


def _walls_speed(scene: Scene) -> float:
    # nu moves the mouth at the scale of r, slope the sides at the scale of h.
    found = {name: bounds(law) for name, law in laws_of(scene).items()}
    reach = {name: found[length].highest for name, length in (("nu", "r"), ("slope", "h")) if name in found}
    return max(law.slope * reach.get(name, 1.0) for name, law in found.items())


@st.composite
def _places(draw: st.DrawFn, moment: _Moment, wall: Wall | None) -> tuple[Wall | None, float, float]:
    regions = {Cap: ("cap",), Stem: ("stem",), Mushroom: ("mouth", "cap", "stem", "cap", "stem")}
    site: str = wall or draw(_one_of(regions[type(moment.scene)]))
    a, b = draw(fractions()), draw(fractions())
    if site == "cap" and draw(st.integers(0, 5)) == 5:
        # Low over the base, near the mouth's edge (in a cap: near the centre).
        a = min(a, 1 - a)
        b = min(float(moment.w / moment.r) * (0.5 + b), 1 - 2.0**-30)
    # Towards the middle in ever larger parts: what is near a wall stays as near as it may.
    for part in (0.0, *(2.0**-k for k in range(52, -1, -4))):
        x, y = moment.point(site, a + part * (0.5 - a), b + part * (0.5 - b))
        if moment.is_clear(x, y, wall):
            return wall, x, y
    # Only the base of a mushroom may be too short to hold a point: the mouth is as wide as the cap.
    return draw(_places(moment, "arc"))


@st.composite
def _headings(draw: st.DrawFn, moment: _Moment, wall: Wall | None, x: float, y: float) -> tuple[float, float]:
    # A unit vector: any direction; along an axis; to or around the centre; grazing the wall it leaves.
    turn = 2 * math.pi * draw(fractions())
    any_way = (math.cos(turn), math.sin(turn))
    axes = [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)]
    distance = math.hypot(x, y) or 1.0
    radial = [(-x / distance, -y / distance), (-y / distance, x / distance)] if x or y else axes[:2]
    if wall is None:
        return draw(st.one_of(st.just(any_way), st.just(any_way), st.sampled_from(axes + radial)))
    nx, ny = moment.normal(wall, x, y)
    lift, sense = 2.0 ** -draw(st.integers(2, 50)), draw(st.sampled_from((1.0, -1.0)))
    grazing = (lift * nx - sense * ny, lift * ny + sense * nx)
    return draw(st.sampled_from((any_way, any_way, grazing, grazing, (nx, ny), *axes)))


def _leaving(moment: _Moment, wall: Wall | None, x: float, y: float, *v: float) -> tuple[float, float]:
    # A particle that approaches its wall is first reflected; one that then still grazes it
    # within rounding leaves along the normal, outrunning the wall.
    vx, vy = v
    if wall is None or moment.gap(wall, x, y, vx, vy)[1] > 0:
        return vx, vy
    nx, ny = moment.normal(wall, x, y)
    drift = moment.gap(wall, x, y)[1]
    along = float(moment.gap(wall, x, y, nx, ny)[1] - drift)
    approach = float(moment.gap(wall, x, y, vx, vy)[1]) / along
    away = vx - 2 * approach * nx, vy - 2 * approach * ny
    if moment.gap(wall, x, y, *away)[1] > 0:
        return away
    push = abs(float(drift)) / along + math.hypot(vx, vy)
    return push * nx, push * ny
