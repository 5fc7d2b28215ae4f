"""A plain stepper: binary64, scalar arithmetic, nothing clever, and right.

A law is seen from departure on: its value then, its rise since, computed without cancellation however short
the time, and its rate. So no wall is ever evaluated in absolute time.

A particle flies straight until it meets a wall. Every wall is a function f of the flight time s, positive
inside; |f''| is bounded by what is known of the laws, so on an interval of width d f stays above the lesser
of its ends less bound * d^2 / 8. That excludes early roots: an interval is passed when the bound proves
f > 0, solved when f' has one sign and f changes its own, and halved otherwise, left half first. On the wall
being left f(0) = 0 by definition: f is its rise since, and has no root before 2 f'(0) / bound.

Then paths, collision after collision, and a particle's first capture interval. The third implementation
beside `reference` and `fast`, the subject of the tutorial, and what the mutants of `conformance.mutants`
spoil. Ties within rounding are answered `undecided`.
"""

from bisect import bisect_right
from collections.abc import Sequence
from functools import cached_property
from itertools import pairwise
from math import cos, floor, fmod, hypot, inf, prod, sin
from typing import ClassVar, NamedTuple

from mpmath import fp

from scene import (
    BangBang,
    Cap,
    Collision,
    Constant,
    Fourier,
    Horizon,
    InvalidState,
    Law,
    Mushroom,
    Outcome,
    Rejected,
    Scene,
    State,
    Stem,
    Undecided,
    Undefined,
    Wall,
)
from scene.geometry import placed
from scene.protocol.wire import Captured
from scene.states import ON_WALL, Stepper, check_numbers

ROUNDING = 2.0**-48  # f and f' are sums of a few terms, each rounded to some 2^-52 of its size
LARGEST = 2.0**400  # squares of greater numbers overflow
LEAST = 2.0**-500  # squares of smaller ones vanish: f'' of the arc would be 0, and every hit excluded
MAX_PARTS = 20_000  # intervals looked at for one wall
SIDES: tuple[Wall, ...] = ("left", "right", "floor")
MAX_COLLISIONS = 20_000  # of one particle's flow: some seconds


class LawValue(NamedTuple):
    """A law seen from departure: its value then, its rise since, its rate now."""

    value: float
    rise: float
    rate: float

    @property
    def now(self) -> float:
        """The value now."""
        return self.value + self.rise


class ConstantMotion:
    """A law that is a number."""

    def __init__(self, law: Constant, t: float) -> None:
        self.value = law.level

    def at(self, s: float) -> LawValue:
        """Return the motion at the time s since departure."""
        return LawValue(self.value, 0.0, 0.0)


class FourierMotion:
    """A Fourier law from time t on: its waves a cos(f s) + b sin(f s) turned to begin there."""

    def __init__(self, law: Fourier, t: float) -> None:
        self.omega = law.frequency(fp)
        self.waves = [turned(k * self.omega, a, b, t) for k, a, b in law.harmonics()]
        self.value = law.mean + sum(a for _, a, _ in self.waves)

    def at(self, s: float) -> LawValue:
        """Return the motion at the time s since departure; cos(f s) - 1 is -2 sin(f s / 2)^2."""
        rise = sum(b * sin(f * s) - 2 * a * sin(f * s / 2) ** 2 for f, a, b in self.waves)
        rate = sum(f * (b * cos(f * s) - a * sin(f * s)) for f, a, b in self.waves)
        return LawValue(self.value, rise, rate)


def turned(f: float, a: float, b: float, t: float) -> tuple[float, float, float]:
    """Return frequency and amplitudes of a cos(f (t + s)) + b sin(f (t + s)) as a wave in s."""
    c, s = cos(f * t), sin(f * t)
    return f, a * c + b * s, b * c - a * s


class Half(NamedTuple):
    """Half a leg: it rests at its knot, an end of it, and accelerates by `pull`."""

    begin: float
    end: float
    knot: float
    value: float
    pull: float


class BangBangMotion:
    """A bang-bang law from time t on: one period of pieces of constant acceleration."""

    def __init__(self, law: BangBang, t: float) -> None:
        first, last = law.knots[0][0], law.knots[-1][0]
        self.period = last - first
        t -= floor((t - first) / self.period) * self.period
        halves = [half for (a, u), (b, v) in pairwise(law.knots) for half in self.halves(a, u, b, v)]
        now = max((i for i, half in enumerate(halves) if half.begin <= t), default=0)
        half, others = halves[now], halves[now + 1 :] + halves[:now]
        since = t - half.knot
        self.value, self.rate = half.value + half.pull * since * since / 2, half.pull * since
        ends = (half.end - t, half.pull), (t - half.begin, half.pull)
        self.pieces = [ends[0], *((other.end - other.begin, other.pull) for other in others), ends[1]]

    @cached_property
    def begins(self) -> list[tuple[float, float, float, float]]:
        """What each piece begins with, carried on from the one before: time, rise, rate, pull."""
        begin, rise, rate = 0.0, 0.0, self.rate
        found = []
        for duration, pull in self.pieces:
            found.append((begin, rise, rate, pull))
            begin += duration
            rise += (rate + pull * duration / 2) * duration
            rate += pull * duration
        return found

    def at(self, s: float) -> LawValue:
        """Return the motion at the time s since departure."""
        left = fmod(s, self.period)
        begin, rise, rate, pull = self.begins[bisect_right(self.begins, (left, inf)) - 1]
        step = left - begin
        return LawValue(self.value, rise + (rate + pull * step / 2) * step, rate + pull * step)

    def halves(self, a: float, u: float, b: float, v: float) -> tuple[Half, Half]:
        """Cut the leg from value u at knot a to value v at knot b in two."""
        middle, pull = (a + b) / 2, 4 * (v - u) / (b - a) / (b - a)
        return Half(a, middle, a, u, pull), Half(middle, b, b, v, -pull)


LawMotion = ConstantMotion | FourierMotion | BangBangMotion


class Gap(NamedTuple):
    """A wall's f > 0 inside: f(0), its rise since, and its partial derivatives by t, x, y."""

    start: float
    rise: float
    ft: float
    fx: float
    fy: float


class UndecidedError(Exception):
    """Rounding, or the limit on work, leaves two answers possible."""


class Flight:
    """One straight flight from a state to its outcome; s is the time since departure."""

    kinds: ClassVar = {Constant: ConstantMotion, Fourier: FourierMotion, BangBang: BangBangMotion}

    def __init__(self, scene: Scene, state: State, t_end: float) -> None:
        self.scene, self.state, self.t_end = scene, state, t_end
        self.x, self.y, self.vx, self.vy, self.wall = state.x, state.y, state.vx, state.vy, state.wall
        self.known: dict[tuple[Wall, float], Gap] = {}
        if self.wall is None and self.y == 0 and not isinstance(scene, Mushroom):
            self.wall = "base"
        self.laws = {name: self.law(law) for name, law in scene.laws.items()}
        self.bounds = {name: law.bounds() for name, law in scene.laws.items()}
        self.sizes = {name: max(-law.lowest, law.highest) for name, law in self.bounds.items()}
        self.is_in_cap = self.starts_in_cap()
        self.end = min(t_end - state.t, self.escape())
        self.is_horizon = self.end == t_end - state.t
        self.crossing = self.crossing_time()

    def law(self, law: Law) -> LawMotion:
        """Return a law as seen from departure."""
        return self.motion(law, self.state.t)

    @classmethod
    def motion(cls, law: Law, t: float) -> LawMotion:
        """Return a law from time t on. Nothing else in this stepper asks for a law's kind."""
        found: LawMotion = cls.kinds[type(law)](law, t)
        return found

    def starts_in_cap(self) -> bool:
        """Tell whether the flight begins in the cap."""
        if not isinstance(self.scene, Mushroom):
            return isinstance(self.scene, Cap)
        is_rising = self.wall is None and self.y == 0 and self.vy > 0
        return self.wall in ("arc", "base") or (self.wall is None and self.y > 0) or is_rising

    def outcome(self) -> Outcome:
        """Find how the flight ends."""
        if refusal := self.refusal():
            return refusal
        if self.wall is None and self.y == 0 and self.vy == 0:
            hit = self.first_hit(("left", "right"), 0.0, self.end)
            self.require_clear(("left", "right"), self.end if self.is_horizon else 0.0)
            return Undefined("mouth-edge") if hit else self.horizon()
        near = self.walls_near(in_cap=self.is_in_cap)
        if self.is_horizon and abs(self.crossing - self.end) <= ROUNDING * self.end:
            raise UndecidedError("y = 0 is crossed at t_end within rounding")
        hit = self.first_hit(near, 0.0, min(self.crossing, self.end))
        if hit is None and self.crossing < self.end:
            self.require_clear(near, self.crossing)
            if not self.is_mouth_open(self.crossing):
                return self.collision("base", self.crossing)
            near = self.walls_near(in_cap=not self.is_in_cap)
            self.require_clear(near, self.crossing)
            hit = self.first_hit(near, self.crossing, self.end)
        elif self.crossing < inf:
            near = (*near, "base")  # a tie of hit and crossing is a corner
        if not self.is_horizon:
            self.require_clear(near, 0.0)
        elif hit is None or hit[1] > self.end / 2:  # a wall met long before keeps it from there at t_end
            self.require_clear(near, self.end)
        if hit is None:
            return self.horizon()
        wall, s = hit
        self.require_clear([other for other in near if other != wall], s)
        return self.collision(wall, s)

    def walls_near(self, *, in_cap: bool) -> tuple[Wall, ...]:
        """List the walls of one part of the table; a mushroom's base is met at the crossing."""
        near: tuple[Wall, ...] = ("arc",) if in_cap else SIDES
        return near if isinstance(self.scene, Mushroom) else ("base", *near)

    def crossing_time(self) -> float:
        """Return when y = 0 is crossed between cap and stem; infinity for never."""
        is_towards = self.y > 0 > self.vy or self.y < 0 < self.vy
        if not isinstance(self.scene, Mushroom) or self.wall == "base" or not is_towards:
            return inf
        return -self.y / self.vy

    def is_mouth_open(self, s: float) -> bool:
        """Tell whether |x| < w at the time of the crossing."""
        self.require_clear(("left", "right"), s)  # by f of the side left, as all is
        return min(self.f(wall, s)[0] for wall in ("left", "right")) > 0

    def first_hit(self, walls: Sequence[Wall], start: float, end: float) -> tuple[Wall, float] | None:
        """Return the wall met first in start < s <= end, and when."""
        roots = ((wall, self.first_root(wall, start, end)) for wall in walls)
        hits = [(wall, s) for wall, s in roots if s is not None]
        return min(hits, key=lambda hit: hit[1], default=None)

    def first_root(self, wall: Wall, start: float, end: float) -> float | None:
        """Return the first s at which f turns negative, proved first by the bound on f''."""
        if wall == "arc" and min(self.bounds["r"].highest, hypot(self.vx, self.vy) or LEAST) < LEAST:
            raise UndecidedError("the cap is smaller, or the particle slower, than 2^-500: squares vanish")
        bend = self.bend(wall)
        if wall == self.wall:  # f(s) >= f'(0) s - bend s^2 / 2 > 0 up to twice this time
            start = max(start, self.f(wall, 0.0)[1] / bend if bend else inf)
        parts = [(start, end)] if start < end else []
        for _ in range(MAX_PARTS):
            if not parts:
                return None
            a, b = parts.pop()
            middle, width = (a + b) / 2, b - a
            fa, fb = self.f(wall, a)[0], self.f(wall, b)[0]
            if fa <= 0:
                raise UndecidedError(f"f of {wall} has no sign where it should be positive")
            noise = self.noise(wall, b)
            if min(fa, fb) > bend * width * width / 8 + noise:
                continue
            slope = self.f(wall, middle)[1]
            if abs(slope) > bend * width / 2:  # f is monotonic
                if slope > 0 and fa <= self.noise(wall, a):
                    break  # it turns at a, above 0 or below within rounding
                if fb > 0:
                    continue
                root = self.root_between(wall, a, b)
                if fb < -noise or self.f(wall, root)[1] ** 2 > 2 * bend * noise:
                    return root
                break  # f may come back before it is negative beyond rounding
            if not a < middle < b:
                break
            parts += [(middle, b), (a, middle)]
        raise UndecidedError(
            f"no hit of {wall} is proved or excluded: f and f' vanish together, or there is too much to do"
        )

    def root_between(self, wall: Wall, a: float, b: float) -> float:
        """Return the root of a decreasing f with f(a) > 0 >= f(b): Newton, or half the bracket."""
        s = b
        while True:
            f, slope = self.f(wall, s)
            a, b = (s, b) if f > 0 else (a, s)
            newton = s - f / slope if slope < 0 else a
            following = newton if a < newton <= b else a + (b - a) / 2
            if abs(following - s) <= 2.0**-52 * s:
                return following
            s = following

    def f(self, wall: Wall, s: float) -> tuple[float, float]:
        """Evaluate a wall's function along the flight, and its rate; it begins at 0 on the wall left."""
        gap = self.gap(wall, s)
        value = gap.rise if wall == self.wall else gap.start + gap.rise
        return value, gap.ft + gap.fx * self.vx + gap.fy * self.vy

    def gap(self, wall: Wall, s: float) -> Gap:
        """Return a wall's function at a time, evaluated once: the search comes back to most times."""
        if (wall, s) not in self.known:
            self.known[wall, s] = self.evaluate(wall, s)
        return self.known[wall, s]

    def evaluate(self, wall: Wall, s: float) -> Gap:
        """Evaluate a wall's function; each rise is free of cancellation for small s."""
        if wall == "arc":
            r, xy, v2 = self.laws["r"].at(s), self.x * self.vx + self.y * self.vy, self.vx**2 + self.vy**2
            rise = r.rise * (r.value + r.now) - s * (2 * xy + s * v2)
            x, y = self.place(s)
            return Gap(r.value**2 - (self.x**2 + self.y**2), rise, 2 * r.now * r.rate, -2 * x, -2 * y)
        if wall == "floor":
            h = self.laws["h"].at(s)
            return Gap(self.y + h.value, self.vy * s + h.rise, h.rate, 0.0, 1.0)
        if wall == "base":
            up = -1.0 if isinstance(self.scene, Stem) else 1.0
            return Gap(up * self.y, up * self.vy * s, 0.0, 0.0, up)
        side = 1.0 if wall == "left" else -1.0
        w, slope, y = self.width(s), self.laws["slope"].at(s), self.place(s)[1]
        rise = w.rise + (slope.value * self.vy * s + slope.rise * y) + side * self.vx * s
        start = w.value + slope.value * self.y + side * self.x
        return Gap(start, rise, w.rate + slope.rate * y, side, slope.now)

    def width(self, s: float) -> LawValue:
        """Return the half-width w of the mouth, or nu r."""
        if "w" in self.laws:
            return self.laws["w"].at(s)
        nu, r = self.laws["nu"].at(s), self.laws["r"].at(s)
        rise, rate = nu.rise * r.value + nu.now * r.rise, nu.rate * r.now + nu.now * r.rate
        return LawValue(nu.value * r.value, rise, rate)

    def place(self, s: float) -> tuple[float, float]:
        """Return where the particle is."""
        return self.x + self.vx * s, self.y + self.vy * s

    def bend(self, wall: Wall) -> float:
        """Bound |f''| of a wall, whatever the laws do."""
        b = self.bounds
        if wall == "arc":
            moving = b["r"].slope ** 2 + b["r"].highest * b["r"].curvature
            return 2 * (moving + self.vx**2 + self.vy**2)
        if wall == "floor":
            return b["h"].curvature
        if wall == "base":
            return 0.0
        deepest = abs(self.y) + abs(self.vy) * self.end
        tilting = b["slope"].curvature * deepest + 2 * b["slope"].slope * abs(self.vy)
        if "w" in b:
            return b["w"].curvature + tilting
        nu, r = b["nu"], b["r"]
        return nu.curvature * r.highest + 2 * nu.slope * r.slope + nu.highest * r.curvature + tilting

    def noise(self, wall: Wall, s: float) -> float:
        """Bound what rounding may change a wall's f by."""
        if wall == self.wall:  # 0 now, by definition: what rounding has changed since is that of f's terms
            return ROUNDING * s * self.swiftness(wall, s)
        late = abs(self.gap(wall, s).ft * self.state.t)
        x, y = abs(self.x) + abs(self.vx) * s, abs(self.y) + abs(self.vy) * s
        size = self.sizes
        if wall == "arc":
            return ROUNDING * (size["r"] ** 2 + x * x + y * y + late)
        if wall in ("floor", "base"):
            return ROUNDING * (y + (size["h"] if wall == "floor" else 0.0) + late)
        w = size["w"] if "w" in size else size["nu"] * size["r"]
        return ROUNDING * (w + size["slope"] * y + x + late)

    def swiftness(self, wall: Wall, s: float) -> float:
        """Bound the sum of the sizes of the terms of a wall's f' up to s; at s itself they may vanish."""
        b, vx, vy = self.bounds, abs(self.vx), abs(self.vy)
        x, y = abs(self.x) + vx * s, abs(self.y) + vy * s
        if wall == "arc":
            return 2 * (b["r"].highest * self.fastest("r", s) + x * vx + y * vy)
        if wall in ("floor", "base"):
            return vy + (self.fastest("h", s) if wall == "floor" else 0.0)
        tilting = self.fastest("slope", s) * y + self.sizes["slope"] * vy
        if "w" in b:
            return self.fastest("w", s) + tilting + vx
        widening = b["nu"].highest * self.fastest("r", s) + self.fastest("nu", s) * b["r"].highest
        return widening + tilting + vx

    def fastest(self, name: str, s: float) -> float:
        """Bound a law's |f'| up to s, by what it is there and what it may have changed by."""
        bounds = self.bounds[name]
        return min(bounds.slope, abs(self.laws[name].at(s).rate) + bounds.curvature * s)

    def require_clear(self, walls: Sequence[Wall], s: float) -> None:
        """Leave open what comes first when a wall passes the particle, or is met again, within rounding."""
        for wall in walls:
            is_there = wall != self.wall or s > 0
            if is_there and abs(self.f(wall, s)[0]) <= self.noise(wall, s):
                if s == 0:
                    raise UndecidedError(placed(self.scene, self.state, wall, "within rounding of"))
                raise UndecidedError(f"at s = {s!r} the particle is on wall {wall} within rounding")

    def escape(self) -> float:
        """Return a time by which no table is large enough to have kept the particle."""
        r, h = self.sizes.get("r", 0.0), self.sizes.get("h", 0.0)
        half = max(r, self.sizes.get("w", 0.0)) + self.sizes.get("slope", 0.0) * h
        across, along = abs(self.vx) / (4 * half), abs(self.vy) / (2 * (r + h))
        return min(1 / max(across, along, 1 / LARGEST), LARGEST)

    def refusal(self) -> Outcome | None:
        """Judge the state: why no flight begins here, or None."""
        wall, where = self.wall, f"(x, y) = ({self.x!r}, {self.y!r}) at t = {self.state.t!r}"
        if isinstance(self.scene, Mushroom) and (
            (wall == "arc" and self.y < 0) or (wall in SIDES and self.y > 0)
        ):
            return Rejected(f"state {where} is not on wall {wall}")
        if self.y == 0 and wall not in (None, "base"):
            return Undecided("the state is in a corner within rounding")
        if self.y == 0 and wall is None:  # in a mushroom: in the mouth, or on the base, which end at these
            self.require_clear(("left", "right", "arc"), 0.0)
        for near in self.walls_near(in_cap=self.is_in_cap):
            if near != wall and self.f(near, 0.0)[0] < -self.noise(near, 0.0):
                if self.is_along_base(near):
                    return Undefined("sliding")
                return Rejected(placed(self.scene, self.state, near, "beyond"))
        self.require_clear(self.walls_near(in_cap=self.is_in_cap), 0.0)
        return None if wall is None else self.refusal_of_departure(wall)

    def is_along_base(self, beyond: Wall) -> bool:
        """Tell whether a state beyond a side, which names no wall, moves along a mushroom's base."""
        is_level = isinstance(self.scene, Mushroom) and self.wall is None and self.y == self.vy == 0
        return is_level and beyond != "floor" and self.f("arc", 0.0)[0] > 0

    def refusal_of_departure(self, wall: Wall) -> Outcome | None:
        """Judge f(0) and f'(0) on the wall being left."""
        gap, slope = self.gap(wall, 0.0), self.f(wall, 0.0)[1]
        size = self.size(wall)
        off = abs(gap.start) - ON_WALL * size * (2 * size if wall == "arc" else 1.0)
        if off > ROUNDING * abs(gap.ft * self.state.t):
            return Rejected(f"state.wall = {wall!r}, but f there is {gap.start!r}")
        if off > 0:  # late, the phase that f is taken at is rounded as t is
            return Undecided(
                f"f of {wall} is {gap.start!r} at departure, which the rounding of phases may be"
            )
        if wall == "base" and slope == 0:
            return Undefined("sliding")
        if abs(slope) <= ROUNDING * (abs(gap.ft) + abs(gap.fx * self.vx) + abs(gap.fy * self.vy)):
            return Undecided(f"f' of {wall} vanishes at departure within rounding")
        if -ROUNDING * abs(self.state.t) * self.bend(wall) <= slope < 0:
            return Undecided(f"f' of {wall} is {slope!r} at departure, which the rounding of phases may be")
        return Rejected(f"state.wall = {wall!r}: the particle moves into it") if slope < 0 else None

    def size(self, wall: Wall) -> float:
        """Return the wall's size now: a state is on it up to a small part of that."""
        if wall in ("left", "right"):
            return max(self.width(0.0).value, abs(self.x))
        name = "h" if wall == "floor" else "r" if "r" in self.laws else "w"
        return self.laws[name].at(0.0).value

    def collision(self, wall: Wall, s: float) -> Collision:
        """Return the collision with a wall after the flight time s."""
        x, y = self.place(s)
        return Collision(wall, s, self.state.t + s, x, 0.0 if wall == "base" else y, *self.bounce(wall, s))

    def bounce(self, wall: Wall, s: float) -> tuple[float, float]:
        """Return the velocity after: v - 2 (v.n - u) n."""
        nx, ny, u = self.normal(wall, s)
        along = self.vx * nx + self.vy * ny - u
        return self.vx - 2 * along * nx, self.vy - 2 * along * ny

    def normal(self, wall: Wall, s: float) -> tuple[float, float, float]:
        """Return a wall's inward unit normal n and its speed u along it."""
        gap = self.gap(wall, s)
        size = hypot(gap.fx, gap.fy)
        return gap.fx / size, gap.fy / size, -gap.ft / size

    def horizon(self) -> Outcome:
        """Return the state at t_end; nothing was met."""
        if not self.is_horizon:
            return Undecided("no wall is met in the time searched")
        return Horizon(self.t_end, *self.place(self.end), self.vx, self.vy)


def next_collision(scene: Scene, state: State, t_end: float, flight: type[Flight] = Flight) -> Outcome:
    """Find the first wall the particle meets after `state.t`.

    Args:
        scene: a valid scene.
        state: position (x, y) [length], velocity (vx, vy) [length/time], wall being left or None.
        t_end: horizon [time], t_end >= state.t.
        flight: how one flight is computed; a mutant puts another class here.

    Returns:
        Collision, Horizon, Undefined, Undecided where rounding leaves it open, or Rejected.
    """
    try:
        check_numbers(scene, state, t_end)
        for field in ("x", "y", "vx", "vy"):
            if abs(value := getattr(state, field)) > LARGEST:
                return Undecided(f"state.{field} = {value!r} is beyond 2^400: squares overflow")
        outcome = flight(scene, state, t_end).outcome()
        if isinstance(outcome, Undefined) and t_end == state.t:  # it has arrived, and need not fly on
            return Horizon(t_end, state.x, state.y, state.vx, state.vy)
        return outcome
    except InvalidState as error:
        return Rejected(str(error))
    except UndecidedError as question:
        return Undecided(str(question))
    except OverflowError:
        return Undecided("a number overflows")


class PlainPath:
    """One particle on its way from hit to hit, and its capture intervals (docs/protocol.md).

    A mutant that errs along the way, and not in a single flight, overrides a method.
    """

    most = MAX_COLLISIONS  # up to t_end

    def __init__(self, scene: Scene, state: State, t_end: float, step: Stepper = next_collision) -> None:
        self.scene, self.state, self.t_end, self.step = scene, state, t_end, step
        self.n_hits = 0
        self.stay = CaptureInterval()
        self.stays: list[tuple[float, float]] = []

    def advance(self) -> Outcome:
        """Take the next step; after a collision the particle stands where it led."""
        outcome = self.step(self.scene, self.state, self.t_end)
        if isinstance(outcome, Collision):
            self.n_hits += 1
            outcome = self.report(outcome)
            self.watch(outcome)
            self.state = self.departure(outcome)
        return outcome

    def report(self, hit: Collision) -> Collision:
        """Return a collision as it is answered, and gone on from."""
        return hit

    def departure(self, hit: Collision) -> State:
        """Return the state from which the next step starts."""
        return hit.state()

    def watch(self, hit: Collision) -> None:
        """Note what a collision means for capture intervals; the state is still that before its flight."""
        if hit.wall in SIDES:
            self.close(hit.t)
        elif hit.wall == "arc" and isinstance(self.scene, Mushroom):
            self.stay = self.stay.after(hit.t, self.is_captured(self.scene, hit))

    def close(self, t: float) -> None:
        """End the stay, if one is on, when a wall of the stem is met or at t_end."""
        if (stay := self.stay.until(t)) is not None:
            self.stays.append(stay)
        self.stay = CaptureInterval()

    def is_captured(self, scene: Mushroom, hit: Collision) -> bool:
        """Tell whether |sin phi_hat| > nu: the chord to an arc hit keeps further from the centre than w."""
        return misses_mouth(width(scene, hit.t), hit, self.state.vx, self.state.vy)

    def arrival(self) -> tuple[Outcome, Captured]:
        """Carry the particle to t_end, and return its first capture interval; a lost particle has none."""
        for _ in range(self.most):
            outcome = self.advance()
            if not isinstance(outcome, Collision):
                break
        else:
            outcome = Undecided(f"more than {self.most} collisions")
        if not isinstance(outcome, Horizon):
            return outcome, None
        self.close(self.t_end)
        return outcome, self.stays[0] if self.stays else None


class CaptureInterval(NamedTuple):
    """What is known of a capture interval: its first captured arc hit, and the first after its last one."""

    begin: float | None = None
    end: float | None = None

    def after(self, t: float, is_captured: bool) -> "CaptureInterval":
        """Return the stay after an arc hit: uncaptured hits between captured ones do not divide it."""
        if is_captured:
            return CaptureInterval(t if self.begin is None else self.begin)
        return CaptureInterval(self.begin, t) if self.begin is not None and self.end is None else self

    def until(self, t: float) -> Captured:
        """Return the stay that ends at t, if it did not before; None where there is none."""
        return None if self.begin is None else (self.begin, t if self.end is None else self.end)


def width(scene: Mushroom, t: float) -> float:
    """Return the half-width of the mouth at time t."""
    return float(prod(Flight.motion(law, t).value for law in scene.width.factors))


def misses_mouth(w: float, at: Collision | State, vx: float, vy: float) -> bool:
    """Tell whether the line through a place keeps further from the centre than w: |x vy - y vx| > w |v|."""
    return abs(at.x * vy - at.y * vx) > w * hypot(vx, vy)


def trajectory(
    scene: Scene,
    state: State,
    n_collisions: int,
    t_end: float,
    step: Stepper = next_collision,
    path: type[PlainPath] = PlainPath,
) -> list[Outcome]:
    """Follow a particle by any stepper: its collisions, and last what came instead of one."""
    along = path(scene, state, t_end, step)
    steps: list[Outcome] = []
    while len(steps) < n_collisions:
        steps.append(along.advance())
        if not isinstance(steps[-1], Collision):
            break
    return steps


def flow(
    scene: Scene, states: Sequence[State], t_end: float, step: Stepper = next_collision
) -> list[tuple[Outcome, Captured]]:
    """Carry particles to t_end by any stepper: the outcome of each there, and its first capture interval."""
    return [PlainPath(scene, state, t_end, step).arrival() for state in states]
