"""Prove claims about collisions with moving walls from the published lines alone.

    python verify.py FILE.jsonl ...        one line for each claim not proved; "N of N proved"
    python verify.py --answers FILE        how far a trajectory in floating point is from the truth

A particle flies straight between walls that move (Gelfreich, Rom-Kedar, Turaev 2014, sec. 3.1). A
line of a corpus says where it starts and what comes first: a wall, at a time and with a velocity
that are enclosed between two decimals. This file proves such a line. It uses integers only, imports
Python's standard library only, and needs no hint from whoever made the line. docs/proof.md has the
theorem behind it; the argument stands here in the order in which it is used:

 1. `Interval`: arithmetic that never loses the true number.
 2. `Clock`, `law_jet`: a law and its two derivatives over a stretch of time.
 3. `wall_jet`: each wall is a function f of the flight time, positive inside the table.
 4. `Flight.is_clear`: f > 0 on a stretch. `Flight.first_root`: the first time at which f = 0.
 5. `Flight.event`: which wall is met first. `bounce`: the flight after it.
 6. `start`: which wall a state leaves, or why it is refused or has no answer.
 7. `read_scene`: the scene is valid at all times, or is proved to be invalid.
 8. `find_fault`: the claim, held against all this.

A claim is "proved", "false" (what is proved contradicts it), or "not proved" (open at 4,096 bits).
Not judged are the fields `allowance`, `condition` and `level`: they say how sensitive an answer is.
"""

from __future__ import annotations

import itertools
import json
import re
import sys
from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import cached_property, lru_cache, reduce
from math import ceil, floor
from operator import add
from typing import Any, NamedTuple

PRECISIONS = (128, 256, 512, 1024, 2048, 4096)  # bits, tried in turn
PARTS = 30_000  # stretches of time that one flight may be cut into
SHARE = Fraction(61, 128)  # where a stretch is cut: not in the middle, where a root may well lie
NEAR = Fraction(1, 2**20)  # how far from its wall a state may lie, as a share of the wall's size
LATE, LARGE = 2**30, 10**100  # periods, or any number, from which on a stepper may refuse
UNIT = Fraction(1, 2**53)  # half a unit in the last place of binary64, relative
WRONG = Fraction(1, 10**9)  # backward error beyond which an answer is false
SIDES = ("left", "right", "floor")
WALLS = {"cap": ("arc", "base"), "stem": ("base", *SIDES), "mushroom": ("arc", "base", *SIDES)}
FIELDS = ("t", "x", "y", "vx", "vy")
NUMBERS = ("dt", "x", "y", "vx", "vy")
BROKEN = {"tilt": "w <= h slope", "mouth": "w > r"}
DECIMAL = re.compile(r"-?\d{1,400}(\.\d{1,400})?(E[+-]?\d{1,4})?")


class Unproved(Exception):  # noqa: N818
    """This precision leaves something open; the next one may not."""


class Refused(Exception):  # noqa: N818
    """The question is proved to be bad: its scene is invalid, or its state is not in the table."""


class Undefined(Exception):  # noqa: N818
    """Mathematics gives no answer, proved; the message is the reason."""


class Unreadable(ValueError):
    """The input is no line of a corpus."""


# 1. Intervals


class Interval:
    """All real numbers from lo 2^exp to hi 2^exp.

    The result of an operation holds the result for any numbers of its operands. It is rounded outward
    to `bits` binary digits. A point (lo = hi) is exact, however many digits it has.
    """

    __slots__ = ("bits", "exp", "hi", "lo")

    def __init__(self, lo: int, hi: int, exp: int, bits: int) -> None:
        """Keep the ends as they are."""
        self.lo, self.hi, self.exp, self.bits = lo, hi, exp, bits

    def __add__(self, other: Interval) -> Interval:
        """Return all sums."""
        exp = min(self.exp, other.exp)
        up, other_up = self.exp - exp, other.exp - exp
        lo, hi = (self.lo << up) + (other.lo << other_up), (self.hi << up) + (other.hi << other_up)
        return rounded(lo, hi, exp, self.bits)

    def __neg__(self) -> Interval:
        """Return all numbers with the other sign."""
        return Interval(-self.hi, -self.lo, self.exp, self.bits)

    def __sub__(self, other: Interval) -> Interval:
        """Return all differences."""
        return self + -other

    def __mul__(self, other: Interval | int) -> Interval:
        """Return all products."""
        if isinstance(other, int):
            other = Interval(other, other, 0, self.bits)
        a, b, c, d = self.lo, self.hi, other.lo, other.hi
        products = (a * c, a * d, b * c, b * d)
        return rounded(min(products), max(products), self.exp + other.exp, self.bits)

    def __truediv__(self, other: Interval) -> Interval:
        """Return all quotients.

        Raises:
            Unproved: the divisor may be 0.
        """
        if not other.sign:
            raise Unproved("the sign of a divisor is open")
        up = self.bits + max(abs(other.lo), other.hi).bit_length()
        pairs = [(a << up, b) for a in (self.lo, self.hi) for b in (other.lo, other.hi)]
        lo, hi = min(a // b for a, b in pairs), max(-(-a // b) for a, b in pairs)
        return rounded(lo, hi, self.exp - other.exp - up, self.bits)

    def square(self) -> Interval:
        """Return all squares."""
        ends = self.lo * self.lo, self.hi * self.hi
        least = min(ends) if self.sign else 0
        return rounded(least, max(ends), 2 * self.exp, self.bits)

    @property
    def sign(self) -> int:
        """Return 1 or -1 where all numbers have this sign, else 0."""
        return (self.lo > 0) - (self.hi < 0)

    @property
    def low(self) -> Interval:
        """Return the lower end, a point."""
        return Interval(self.lo, self.lo, self.exp, self.bits)

    @property
    def high(self) -> Interval:
        """Return the upper end, a point."""
        return Interval(self.hi, self.hi, self.exp, self.bits)

    @property
    def ends(self) -> tuple[Fraction, Fraction]:
        """Return both ends."""
        unit = Fraction(2) ** self.exp
        return self.lo * unit, self.hi * unit

    def cut(self) -> Interval:
        """Return a point inside, near the middle: not the middle, where a root may well lie."""
        point = (self.low + (self.high - self.low) * number(SHARE, self.bits)).low
        return point if is_below(self.low, point) else self.low

    def simplest(self) -> Interval:
        """Return a point inside that has few digits: a root that has few is then found exactly."""
        up = (self.hi - self.lo).bit_length()
        middle = -(-self.lo >> up) << up
        if middle > self.hi:
            up -= 1
            middle = -(-self.lo >> up) << up
        return Interval(middle, middle, self.exp, self.bits)


def rounded(lo: int, hi: int, exp: int, bits: int) -> Interval:
    """Return an interval rounded outward to so many digits."""
    extra = max(lo.bit_length(), hi.bit_length()) - bits
    if extra > 0:
        lo, hi, exp = lo >> extra, -(-hi >> extra), exp + extra
    return Interval(lo, hi, exp, bits)


def number(value: Fraction | int, bits: int) -> Interval:
    """Return a number: exactly where its denominator is a power of two, else between two neighbours."""
    above, below = value.numerator, value.denominator
    if below & (below - 1) == 0:
        return Interval(above, above, 1 - below.bit_length(), bits)
    up = bits + below.bit_length()
    return rounded((above << up) // below, -((-above << up) // below), -up, bits)


def join(*parts: Interval) -> Interval:
    """Return the smallest interval that holds all given ones."""
    exp = min(part.exp for part in parts)
    lo = min(part.lo << (part.exp - exp) for part in parts)
    hi = max(part.hi << (part.exp - exp) for part in parts)
    return Interval(lo, hi, exp, parts[0].bits)


def is_below(one: Interval, other: Interval) -> bool:
    """Tell whether every number of one interval is less than every number of another."""
    return (other.low - one.high).sign > 0


@lru_cache(maxsize=64)
def pi(bits: int) -> Interval:
    """Enclose pi = 16 arctan(1/5) - 4 arctan(1/239) (Machin).

    Each term of either series is rounded down twice, which loses less than 3 units; times 16 that is
    less than 64. What comes after the last term is less than that, too.
    """
    scale = bits + 16
    total, error = 0, 128
    for factor, n in ((16, 5), (-4, 239)):
        power, k = (1 << scale) // n, 1
        while power:
            total += (factor if k % 4 == 1 else -factor) * (power // k)
            error, power, k = error + 64, power // (n * n), k + 2
    return rounded(total - error, total + error, -scale, bits)


def cos_sin(turns: Interval) -> tuple[Interval, Interval]:
    """Enclose cosine and sine of so many whole turns, for a narrow interval.

    The nearest quarter turn is taken out. The angle left, about pi/4 at most, is m 2^-scale for an
    integer m, and up to `radius` units more or less; the slopes of both functions are at most 1. Taylor's
    terms at |m| are rounded down to integers: each is less than 4 units too small, as the term before
    counts by |m| 2^-scale / k < 1/2 only. The series alternates, so what is left out counts as one term.
    """
    scale, middle = turns.bits + 8, turns.simplest() * 4
    quarter = floor(middle.ends[0] + Fraction(1, 2))
    angle = (
        (turns * 4 - number(quarter, turns.bits)) * pi(turns.bits + 8) * number(Fraction(1, 2), 1)
    )
    lo, hi = (end * 2**scale for end in angle.ends)
    m = floor((lo + hi) / 2)
    radius = max(ceil(hi) - m, m - floor(lo))
    sums, term, k = [0, 0], 1 << scale, 0
    while term:
        sums[k % 2] += term if k % 4 < 2 else -term
        k += 1
        term = (term * abs(m) >> scale) // k
    error = radius + 4 * k + 4
    sums[1] = sums[1] if m > 0 else -sums[1]
    cos, sin = (rounded(total - error, total + error, -scale, turns.bits) for total in sums)
    return ((cos, sin), (-sin, cos), (-cos, -sin), (sin, -cos))[quarter % 4]


# 2. Laws


class Jet(NamedTuple):
    """A function of time with its first and second derivative: intervals, or exact rationals."""

    f: Any
    d1: Any
    d2: Any


def plus(*jets: Jet) -> Jet:
    """Return the sum."""
    return Jet(*(reduce(add, parts) for parts in zip(*jets, strict=True)))


def minus(p: Jet) -> Jet:
    """Return the function with the other sign."""
    return Jet(-p.f, -p.d1, -p.d2)


def times(p: Jet, q: Jet) -> Jet:
    """Return the product, by Leibniz' rule."""
    if p is q:
        square = p.f.square() if isinstance(p.f, Interval) else p.f * p.f
        slope = p.d1.square() if isinstance(p.f, Interval) else p.d1 * p.d1
        return Jet(square, p.f * p.d1 * 2, (slope + p.f * p.d2) * 2)
    return Jet(p.f * q.f, p.d1 * q.f + p.f * q.d1, p.d2 * q.f + p.d1 * q.d1 * 2 + p.f * q.d2)


class Leg(NamedTuple):
    """c + bend (t - origin)^2 / 2 from `begin` to `end`; times are counted from the law's first knot."""

    begin: Fraction
    end: Fraction
    origin: Fraction
    c: Fraction
    bend: Fraction


class Law(NamedTuple):
    """A parameter as a function of time.

    Attributes:
        mean: its value, if it has neither waves nor legs.
        waves: for k = 1, 2, ... the factors of cos and sin of k times the phase.
        legs: of a bang-bang law, two for each pair of knots, in the order of time.
        first: time of the first knot.
        ends: bounds of its values.
        is_tight: whether it comes to both bounds.
    """

    mean: Fraction
    waves: tuple[tuple[Fraction, Fraction], ...]
    legs: tuple[Leg, ...]
    first: Fraction
    ends: tuple[Fraction, Fraction]
    is_tight: bool = True

    @property
    def is_moving(self) -> bool:
        """Tell whether the law changes."""
        return self.ends[0] < self.ends[1]


class Rate(NamedTuple):
    """How fast the laws of a scene turn: omega, or a period, exactly; both None when nothing moves."""

    omega: Fraction | None = None
    period: Fraction | None = None


class Scene(NamedTuple):
    """A table with its laws by name; w = nu r where nu is given."""

    table: str
    laws: dict[str, Law]
    rate: Rate


class Clock:
    """The common phase of all laws, as a function of the time s since an exact instant."""

    def __init__(self, scene: Scene, instant: Fraction, bits: int) -> None:
        """Reduce the phase at the instant to one turn, with as many digits of pi as its size asks for."""
        self.scene, self.instant, self.bits = scene, instant, bits
        omega, period = scene.rate
        self.zero = number(0, bits)
        self.pace = self.omega = self.offset = self.zero
        self.turn: Interval | None = None
        self._multiples: dict[tuple[int, int], list[tuple[Interval, Interval]]] = {}
        if omega is not None:
            phase = omega * instant
            wide = bits + max(0, floor(abs(phase)).bit_length())
            turns = number(phase, wide) / (pi(wide) * 2)
            turns = turns - number(floor(turns.ends[0]), wide)
            self.offset = rounded(turns.lo, turns.hi, turns.exp, bits)
            self.omega, self.turn = number(omega, bits), pi(bits) * 2 / number(omega, bits)
            self.pace = self.omega / (pi(bits) * 2)
        elif period is not None:
            self.offset, self.pace = number(instant / period % 1, bits), number(1 / period, bits)
            self.omega, self.turn = self.pace * pi(bits) * 2, number(period, bits)

    def waves(self, s: Interval, n: int) -> list[tuple[Interval, Interval]]:
        """Enclose cosine and sine of k times the phase over a stretch, for k = 1 to n.

        A wave lies between its values at the ends, and 1 or -1 where it turns: at quarters of a turn.
        """
        low, high = s.low, s.high
        first, last = self.multiples(low, n), self.multiples(high, n)
        begin, end = (self.offset + self.pace * at for at in (low, high))
        found = []
        for k, (one, other) in enumerate(zip(first, last, strict=True), 1):
            quarters = range(ceil((begin * (4 * k)).ends[0]), floor((end * (4 * k)).ends[1]) + 1)
            passed = {quarter % 4 for quarter in quarters[:4]}
            hulls = []
            for place, top in ((0, 0), (1, 1)):
                turns = [number(1, self.bits)] if top in passed else []
                turns += [number(-1, self.bits)] if top + 2 in passed else []
                hulls.append(join(one[place], other[place], *turns))
            found.append((hulls[0], hulls[1]))
        return found

    def multiples(self, at: Interval, n: int) -> list[tuple[Interval, Interval]]:
        """Enclose cosine and sine of multiples of the phase at a point, by addition of angles."""
        known = self._multiples.setdefault((at.lo, at.exp), [])
        if not known and n:
            known.append(cos_sin(self.offset + self.pace * at))
        while len(known) < n:
            (cos, sin), (c, s) = known[-1], known[0]
            known.append((cos * c - sin * s, sin * c + cos * s))
        return known[:n]


def law_jet(law: Law, clock: Clock, s: Interval) -> Jet:
    """Enclose a law and its derivatives over a stretch of time."""
    bits, zero = clock.bits, clock.zero
    if law.legs and clock.scene.rate.period is not None:
        return leg_jet(law, clock, s)
    f, d1, d2 = number(law.mean, bits), zero, zero
    for k, ((a, b), wave) in enumerate(
        zip(law.waves, clock.waves(s, len(law.waves)), strict=True), 1
    ):
        (cos, sin), p, q = wave, number(a, bits), number(b, bits)
        value = cos * p + sin * q
        f, d1, d2 = f + value, d1 + (cos * q - sin * p) * k, d2 - value * (k * k)
    return Jet(f, d1 * clock.omega, d2 * clock.omega.square())


def leg_jet(law: Law, clock: Clock, s: Interval) -> Jet:
    """Enclose a bang-bang law on each leg that a stretch touches: exact rationals tell which."""
    period, (low, high) = clock.scene.rate.period, s.ends
    assert period is not None
    begin = (clock.instant + low - law.first) % period
    end = begin + min(high - low, period)
    jets, place = [], bisect_right(law.legs, begin, key=lambda leg: leg.begin) - 1
    while (leg := law.legs[place % len(law.legs)]).begin + (
        shift := place // len(law.legs) * period
    ) <= end:
        since = leg.origin + shift
        ends = max(leg.begin + shift, begin) - since, min(leg.end + shift, end) - since
        u, bend = join(*(number(at, clock.bits) for at in ends)), number(leg.bend, clock.bits)
        half = number(leg.bend / 2, clock.bits)
        jets.append(Jet(number(leg.c, clock.bits) + half * u.square(), bend * u, bend))
        place += 1
    return Jet(*(join(*parts) for parts in zip(*jets, strict=True)))


def exact_jet(law: Law, rate: Rate, time: Fraction) -> Jet:
    """Return a law and its derivatives just after a time, as rationals.

    Raises:
        Unproved: they are not known to be rational.
    """
    if law.legs and rate.period is not None:
        u = (time - law.first) % rate.period
        leg = law.legs[bisect_right(law.legs, u, key=lambda leg: leg.begin) - 1]
        u -= leg.origin
        return Jet(leg.c + leg.bend * u * u / 2, leg.bend * u, leg.bend)
    sums = [law.mean, Fraction(0), Fraction(0)]
    for k, (a, b) in enumerate(law.waves, 1):
        quarters = 4 * k * time / rate.period if rate.period else Fraction(0)
        if not (a or b):
            continue
        if quarters.denominator > 1 or (rate.period is None and time):
            raise Unproved("a law is not known to be rational at this time")
        cos, sin = ((1, 0), (0, 1), (-1, 0), (0, -1))[quarters.numerator % 4]
        value = a * cos + b * sin
        sums = [sums[0] + value, sums[1] + (b * cos - a * sin) * k, sums[2] - value * k * k]
    if rate.omega is None and (sums[1] or sums[2]):
        # A derivative brings a factor pi; it is rational where it vanishes only.
        raise Unproved("a derivative of a law is irrational")
    omega = rate.omega or Fraction(0)
    return Jet(sums[0], sums[1] * omega, sums[2] * omega * omega)


# 3. Walls


def width_jet(law: Callable[[str], Jet], laws: Mapping[str, Law]) -> Jet:
    """Return half the width of the mouth."""
    return times(law("nu"), law("r")) if "nu" in laws else law("w")


def wall_jet(scene: Scene, wall: str, law: Callable[[str], Jet], x: Jet, y: Jet) -> Jet:
    """Return f of a wall along a flight: positive inside.

    arc r^2 - x^2 - y^2; base y (in a stem -y); floor y + h; left w + slope y + x; right w + slope y - x.
    A scene is valid while further functions are positive: r, h, w, "mouth" r - w, "tilt" w - h slope.
    """
    if wall in scene.laws:
        return law(wall)
    if wall == "base":
        return minus(y) if scene.table == "stem" else y
    if wall == "floor":
        return plus(y, law("h"))
    if wall == "arc":
        r = law("r")
        return plus(times(r, r), minus(plus(times(x, x), times(y, y))))
    width = width_jet(law, scene.laws)
    if wall == "mouth":
        return plus(law("r"), minus(width))
    if wall == "tilt":
        return plus(width, minus(times(law("slope"), law("h"))))
    return plus(width, times(law("slope"), y), x if wall == "left" else minus(x))


def gradient(scene: Scene, wall: str, x: Any, y: Any, slope: Any, one: Any) -> tuple[Any, Any]:
    """Return the derivatives of f by x and y."""
    if wall == "arc":
        return x * -2, y * -2
    if wall in ("base", "floor"):
        return one * 0, -one if (wall, scene.table) == ("base", "stem") else one
    return (one if wall == "left" else -one), slope


# 4. Where f > 0, and where it vanishes first


class Line(NamedTuple):
    """A straight flight: place at the instant of its clock, and velocity."""

    x: Interval
    y: Interval
    vx: Interval
    vy: Interval


class State(NamedTuple):
    """A state as it is given, exactly."""

    t: Fraction
    x: Fraction
    y: Fraction
    vx: Fraction
    vy: Fraction
    wall: str | None


class Hit(NamedTuple):
    """A wall and when it is met, since the clock's instant."""

    wall: str
    root: Interval


class Flight:
    """A particle in flight: where walls are on its way, and what it meets first.

    The state is enclosed by a box, and begins within the times `begin` (exactly 0 for a state that is
    given). What is proved holds for each state in the box. A wall that is being left has a residual c:
    f vanishes where the flight begins but for the rounding of the state. There f - c stands for f.
    """

    def __init__(
        self,
        clock: Clock,
        line: Line,
        end: Fraction,
        *,
        begin: Interval | None = None,
        wall: str | None = None,
        residual: Interval | None = None,
        state: State | None = None,
        is_flat: bool = False,
    ) -> None:
        """Describe a flight.

        Args:
            clock: the laws' phase; times are counted from its instant.
            line: the flight's line.
            end: the horizon.
            begin: when the flight begins.
            wall: the wall being left.
            residual: c of this wall.
            state: the exact state, where it is known: it decides ties.
            is_flat: f = f' = 0 < f'' on this wall at time 0, exactly.
        """
        self.clock, self.line, self.end, self.wall, self.is_flat = clock, line, end, wall, is_flat
        self.begin, self.residual, self.state = begin or clock.zero, residual or clock.zero, state
        self.scene, self.bits = clock.scene, clock.bits
        self._laws: dict[tuple[str, int, int, int], Jet] = {}
        self._rest: dict[tuple[str, int, int], bool] = {}
        self._parts = 0

    def law(self, name: str, s: Interval) -> Jet:
        """Enclose a law over a stretch."""
        key = name, s.lo, s.hi, s.exp
        if key not in self._laws:
            self._laws[key] = law_jet(self.scene.laws[name], self.clock, s)
        return self._laws[key]

    def place(self, s: Interval) -> tuple[Jet, Jet]:
        """Enclose x and y over a stretch."""
        (x, y, vx, vy), zero = self.line, self.clock.zero
        return Jet(x + vx * s, vx, zero), Jet(y + vy * s, vy, zero)

    def f(self, wall: str, s: Interval) -> Jet:
        """Enclose f of a wall, less the residual of the wall being left, over a stretch."""
        jet = wall_jet(self.scene, wall, lambda name: self.law(name, s), *self.place(s))
        return jet._replace(f=jet.f - self.residual) if wall == self.wall else jet

    def exact(self, wall: str, s: Fraction) -> Jet:
        """Return f of a wall at an exact time, in rationals.

        Raises:
            Unproved: it is not known to be rational.
        """
        if self.state is None:
            raise Unproved("two walls are met together, as far as this precision shows")
        t, x, y, vx, vy, _ = self.state
        places = [
            (Jet(x + vx * at, vx, Fraction(0)), Jet(y + vy * at, vy, Fraction(0)), t + at)
            for at in (s, Fraction(0))
        ]
        now, then = (
            wall_jet(
                self.scene,
                wall,
                lambda n: exact_jet(self.scene.laws[n], self.scene.rate, time),
                a,
                b,
            )  # noqa: B023
            for a, b, time in places
        )
        return now._replace(f=now.f - then.f) if wall == self.wall else now

    def is_zero(self, wall: str, s: Fraction) -> bool:
        """Tell whether f is known to vanish at an exact time."""
        try:
            return bool(self.exact(wall, s).f == 0)
        except Unproved:
            return False

    def is_clear(self, wall: str, s: Interval) -> bool:
        """Tell whether f > 0 is proved on a stretch but at its left end, where f >= 0 is known.

        f and f' are continuous, for laws come to rest at their knots. One of these suffices:

        - f' > 0: f grows;
        - f'' <= 0 but at knots, and f > 0 at the right end: f lies above its chord;
        - f > 0 as enclosed;
        - f' < 0, and f > 0 at the right end;
        - Taylor's formula about a point p of the stretch, f(p) + f'(p) (s - p) + f'' (s - p)^2 / 2 > 0;
        - the wall never comes to where the particle is at either end (`is_never_met`).

        The wall being left has f = 0 where the flight begins, somewhere in `begin`. A stretch that
        holds `begin` is clear by the first two only; or if f' = 0, too, by f'' > 0.
        """
        jet = self.f(wall, s)
        if jet.d1.sign > 0:
            return True
        is_left = bool(self.f(wall, s.high).f.sign > 0)
        if jet.d2.hi <= 0 and is_left:
            return True
        if self.holds_begin(wall, s):
            return self.is_flat and jet.d2.sign > 0
        if jet.f.sign > 0 or (jet.d1.sign < 0 and is_left):
            return True
        p = s.simplest()
        at, u = self.f(wall, p), s - p
        half = number(Fraction(1, 2), self.bits)
        if (at.f + at.d1 * u + jet.d2 * u.square() * half).sign > 0:
            return True
        return (
            self.is_never_met(wall, s.low) and self.is_never_met(wall, s.high)
            if self.is_long(s)
            else False
        )

    def holds_begin(self, wall: str, s: Interval) -> bool:
        """Tell whether f of a wall may vanish on a stretch because the flight begins there."""
        return wall == self.wall and not is_below(self.begin, s.low)

    def is_long(self, s: Interval) -> bool:
        """Tell whether a stretch is longer than a period."""
        return self.clock.turn is not None and is_below(self.clock.turn, s.high - s.low)

    def is_never_met(self, wall: str, at: Interval) -> bool:
        """Tell whether a particle that rests where this one is at a point is never met by a wall.

        With the laws held still, f is concave in the place. So f at each time of a stretch is at least
        the lesser of its values for the two particles that rest at the stretch's ends. Neither is met
        in one period: then neither is ever met, and f > 0 on the stretch.
        """
        key = wall, at.lo, at.exp
        if key not in self._rest:
            (x, _, _), (y, _, _) = (jet for jet in self.place(at))
            line, turn = Line(x, y, self.clock.zero, self.clock.zero), self.clock.turn
            before = number(-1, self.bits)
            rest = Flight(
                self.clock, line, self.end, begin=before, wall=self.wall, residual=self.residual
            )
            rest._laws, rest._parts = self._laws, self._parts
            assert turn is not None
            try:
                found = rest.first_root(wall, self.clock.zero, turn.high)
            except Unproved:
                found = turn
            self._rest[key], self._parts = found is None, rest._parts
        return self._rest[key]

    def first_root(self, wall: str, start: Interval, stop: Interval) -> Interval | None:
        """Enclose the first root of f between two points; None proves that f > 0 after the first.

        The stretch is cut until each part is clear, from the left; or until f' < 0 on a part and f < 0
        at its right end: then f has one root there.

        Raises:
            Unproved: a part stays open.
        """
        if not self.holds_begin(wall, start) and self.f(wall, start).f.sign <= 0:
            raise Unproved(f"f of {wall} is not shown to be positive where the search begins")
        parts = [join(start, stop)]
        while parts:
            part = parts.pop()
            self._parts += 1
            if self._parts > PARTS:
                raise Unproved(f"{wall}: more than {PARTS} stretches of time")
            if self.is_clear(wall, part):
                continue
            at_begin = self.holds_begin(wall, part)
            if (
                not at_begin
                and self.f(wall, part).d1.sign < 0
                and self.f(wall, part.high).f.sign < 0
            ):
                return self.closest(wall, part)
            cut = (part.low + (part.high - part.low) * number(SHARE, self.bits)).low
            if not (
                is_below(part.low, cut) and is_below(self.begin if at_begin else part.low, cut)
            ):
                raise Unproved(f"{wall}: f is too small, or begins too flat, for this precision")
            parts += [join(cut, part.high), join(part.low, cut)]
        return None

    def closest(self, wall: str, root: Interval) -> Interval:
        """Narrow a root: by the sign of f at a point p, and by root = p - f(p) / f' for some f' (Newton)."""
        while True:
            narrow = root
            for choose in (Interval.cut, Interval.simplest):
                p = choose(narrow)
                f = self.f(wall, p).f
                step = p - f / self.f(wall, narrow).d1
                lows = [narrow.low, step.low, *([p] if f.sign > 0 else [])]
                highs = [narrow.high, step.high, *([p] if f.sign < 0 else [])]
                low, high = (
                    pick(ends, key=lambda end: end.ends)
                    for pick, ends in ((max, lows), (min, highs))
                )
                narrow = join(low, high)
            if not is_below((narrow.high - narrow.low) * 4, (root.high - root.low) * 3):
                return narrow
            root = narrow

    # 5. What is met first

    def event(self, *, in_cap: bool) -> Hit | None:
        """Find the first wall met before the horizon; None for none.

        y is linear. Before y = 0 is crossed the walls of one part of the table can be met: the arc in the
        cap, both sides and the floor in the stem. Where it is crossed, the mouth is open or the base is
        met. After that come the walls of the other part.

        Raises:
            Undefined: two walls are met together, or the mouth's edge, exactly.
            Unproved: this precision cannot tell.
        """
        end = number(self.end, self.bits)
        near = ("arc",) if in_cap else SIDES
        if self.state is not None and self.is_along_mouth():
            if self.first_hit(("left", "right"), self.begin.low, end, None) is not None:
                raise Undefined("mouth-edge")
            return None
        crossing = self.crossing(in_cap=in_cap)
        hit = self.first_hit(near, self.begin.low, crossing or end, crossing)
        if hit is not None or crossing is None:
            return hit
        gaps = {
            wall: self.f(wall, crossing).f
            for wall in ("left", "right")
            if "cap" != self.scene.table
        }
        signs = [gap.sign for gap in gaps.values()]
        if self.scene.table == "cap" or (in_cap and -1 in signs):
            return Hit("base", crossing)
        if signs != [1, 1]:
            if any(self.is_zero(wall, self.exact_crossing()) for wall in gaps):
                raise Undefined("corner" if self.scene.table == "stem" else "mouth-edge")
            raise Unproved("whether the mouth is open where y = 0 is crossed")
        if self.scene.table == "stem":
            return Hit("base", crossing)
        hit = self.first_hit(SIDES if in_cap else ("arc",), crossing.low, end, None)
        if hit is not None and not is_below(crossing, hit.root):
            raise Unproved("a wall is met at the height of the mouth")
        return hit

    def is_along_mouth(self) -> bool:
        """Tell whether the particle glides along y = 0 inside the mouth."""
        level = self.state is not None and self.state.y == self.state.vy == 0
        return level and self.scene.table == "mushroom" and self.wall is None

    def exact_crossing(self) -> Fraction:
        """Return when y = 0 is crossed, exactly."""
        if self.state is None:
            raise Unproved("two walls are met together, as far as this precision shows")
        return -self.state.y / self.state.vy

    def crossing(self, *, in_cap: bool) -> Interval | None:
        """Enclose when y = 0 is crossed; None for not before the horizon."""
        y, vy = self.line.y, self.line.vy
        if self.wall == "base" or (vy.lo == 0 == vy.hi) or vy.sign == (1 if in_cap else -1):
            return None
        found, end = -y / vy, number(self.end, self.bits)
        if is_below(found, end):
            return found
        if is_below(end, found) or self.exact_crossing() == self.end:
            return None
        raise Unproved("y = 0 is crossed at the horizon, as far as this precision shows")

    def first_hit(
        self, walls: Sequence[str], start: Interval, limit: Interval, crossing: Interval | None
    ) -> Hit | None:
        """Find which of some walls is met first, before y = 0 is crossed or the horizon comes.

        The search ends soon at first, and then ever later, for all walls. f > 0 is proved at each end.
        It goes on a little past the last, so that a root there lies inside. What is met at the horizon
        exactly is not met before it. A wall of which something is open is asked again after the others:
        it may be open after another is met only.
        """
        for begin, stop in self.searches(start, limit.high):
            hits: list[Hit] = []
            queue, until = list(walls), stop
            for wall in queue:
                try:
                    root = self.first_root(wall, begin, until)
                except Unproved:
                    if queue.count(wall) > 1:
                        raise
                    queue.append(wall)
                    continue
                is_last = root is not None and not is_below(root, limit)
                if root is None or is_below(limit, root):
                    continue
                if is_last and crossing is None and self.is_zero(wall, self.end):
                    continue
                hits.append(Hit(wall, root))
                until = (
                    root.high + (root.high - begin) * number(Fraction(1, 2**10), self.bits)
                ).high
            if hits:
                return self.earliest(hits, limit, crossing)
        return None

    def searches(self, start: Interval, last: Interval) -> Iterator[tuple[Interval, Interval]]:
        """Yield begin and end of searches: first as long as the table needs to be crossed, or a period."""
        bits, (_, _, vx, vy) = self.bits, self.line
        size = sum(law.ends[1] for name, law in self.scene.laws.items() if name in ("r", "w", "h"))
        speed = max(abs(end) for v in (vx, vy) for end in v.ends)
        lengths = [size / speed] if speed else []
        lengths += [self.clock.turn.ends[1]] if self.clock.turn else []
        beyond = (last + (last - start) * number(Fraction(3, 2**12), bits)).high
        if lengths:
            length = number(min(lengths) * SHARE * 2, 32).high
            while is_below(stop := (start + length).high, last):
                yield start, stop
                start, length = stop, length * 4
        yield start, beyond

    def earliest(self, hits: list[Hit], limit: Interval, crossing: Interval | None) -> Hit:
        """Return the earliest of some hits, each the first of its wall.

        Raises:
            Undefined: walls are met together at a rational time, exactly, and all others later.
            Unproved: which is first is open.
        """
        best = min(hits, key=lambda hit: hit.root.ends[1])
        if all(hit is best or is_below(best.root, hit.root) for hit in hits) and is_below(
            best.root, limit
        ):
            return best
        if self.state is None:
            raise Unproved("two walls are met together, as far as this precision shows")
        times = [self.exact_crossing()] if crossing is not None else []
        times += [time for wall in SIDES if (time := self.straight_time(wall)) is not None]
        for time in times:
            met = {hit.wall for hit in hits if hit.root.ends[0] <= time <= hit.root.ends[1]}
            exact = {wall for wall in met if self.is_zero(wall, time)}
            late = [hit for hit in hits if hit.wall not in exact]
            exact |= {"base"} if crossing is not None and self.exact_crossing() == time else set()
            is_first = all(time < hit.root.ends[0] for hit in late) and 0 < time < self.end
            if is_first and len(exact) > 1 and (crossing is None or time <= self.exact_crossing()):
                is_edge = self.scene.table == "mushroom" and "base" in exact and "arc" not in exact
                raise Undefined("mouth-edge" if is_edge else "corner")
        raise Unproved("two walls are met together, as far as this precision shows")

    def straight_time(self, wall: str) -> Fraction | None:
        """Return when a straight wall at rest is met, exactly."""
        law = self.scene.laws
        if wall not in WALLS[self.scene.table] or any(
            law[n].is_moving for n in law if n != "r" or "nu" in law
        ):
            return None
        jet = self.exact(wall, Fraction(0))
        return -jet.f / jet.d1 if jet.d1 else None


def bounce(flight: Flight, hit: Hit) -> tuple[dict[str, Interval], Flight]:
    """Return dt, x, y, vx, vy at a hit, v after it, and the next flight.

    v' = v - 2 f' grad f / |grad f|^2, which is v - 2 (v.n - u) n. The next flight is described at an
    exact instant close to the hit, on its own line: there the place is a box, and it begins a little
    before or after. Its wall keeps the residual when it is the one that was left.
    """
    clock, s, (x, y, vx, vy) = flight.clock, hit.root, flight.line
    is_base, one, zero = hit.wall == "base", number(1, clock.bits), clock.zero
    at_x, at_y = (jet.f for jet in flight.place(s))
    at_y = zero if is_base else at_y
    slope = flight.law("slope", s).f if hit.wall in ("left", "right") else zero
    fx, fy = gradient(flight.scene, hit.wall, at_x, at_y, slope, one)
    kick = flight.f(hit.wall, s).d1 * 2 / (fx.square() + fy.square())
    new_vx, new_vy = vx - kick * fx, vy - kick * fy
    found = {"dt": s - flight.begin, "x": at_x, "y": at_y, "vx": new_vx, "vy": new_vy}
    near = s.simplest()
    begin = s - near
    next_x = x + vx * near + (vx - new_vx) * begin
    next_y = -new_vy * begin if is_base else y + vy * near + (vy - new_vy) * begin
    later = Clock(flight.scene, clock.instant + near.ends[0], clock.bits)
    return found, Flight(
        later,
        Line(next_x, next_y, new_vx, new_vy),
        flight.end - near.ends[0],
        begin=begin,
        wall=hit.wall,
        residual=flight.residual if hit.wall == flight.wall else zero,
    )


# 6. Where a flight starts


def start(scene: Scene, state: State, t_end: Fraction, bits: int) -> tuple[Flight, bool]:
    """Judge a start: which wall it leaves, and whether it is in the cap.

    Raises:
        Refused: the state is not in the table, or off its wall, or moves into it.
        Undefined: it is on two walls, or slides along one.
        Unproved: this precision cannot tell.
    """
    table, wall, end = scene.table, state.wall, t_end - state.t
    if end < 0:
        raise Refused("t_end is before state.t")
    if table == "mushroom" and ((wall == "arc" and state.y < 0) or (wall in SIDES and state.y > 0)):
        raise Refused("the state is beyond the end of the wall that it names")
    clock = Clock(scene, state.t, bits)
    line = Line(*(number(value, bits) for value in state[1:5]))
    flight = Flight(clock, line, end, state=state._replace(wall=None))
    f = {name: flight.f(name, clock.zero).f for name in WALLS[table]}
    if wall is not None:
        require_near(flight, wall, f[wall])
    on = [wall] if wall is not None else []
    is_beside = (
        table == "mushroom"
        and wall is None
        and state.y == 0
        and -1 in (f["left"].sign, f["right"].sign)
    )
    if is_beside:
        on, walls = ["base"], ("arc",)
    elif table == "mushroom":
        in_cap = state.y > 0 or wall in ("arc", "base")
        walls = ("arc",) if in_cap else SIDES
        walls = ("arc", "base") if wall == "arc" and state.y == 0 else walls
    else:
        walls = WALLS[table]
    for name in walls:
        if name != wall and f[name].sign < 0:
            raise Refused(f"the state is beyond wall {name}")
        if name != wall and f[name].sign == 0:
            if not flight.is_zero(name, Fraction(0)):
                raise Unproved(f"the state may be on wall {name}")
            on.append(name)
    if table == "mushroom" and state.y == 0 and {"left", "right"} & set(on):
        raise Undefined("mouth-edge")
    if len(on) > 1:
        raise Undefined("corner")
    is_flat = any(is_flat_start(flight, name) for name in on)
    leaving = {"wall": on[0], "residual": f[on[0]]} if on else {}
    state = state._replace(wall=on[0] if on else None)
    flight = Flight(clock, line, end, state=state, is_flat=is_flat, **leaving)
    in_cap = (
        table == "cap"
        or "arc" in on
        or "base" in on
        or state.y > 0
        or (state.y == 0 < state.vy and not on)
    )
    return flight, in_cap and table != "stem"


def is_flat_start(flight: Flight, wall: str) -> bool:
    """Tell whether f' = 0 < f'' on the wall being left; False where f' > 0.

    Raises:
        Refused: f' < 0.
        Undefined: f' = 0 and f'' <= 0: the wall pushes, or the particle rests on it.
        Unproved: this precision cannot tell.
    """
    jet = flight.f(wall, flight.clock.zero)
    if jet.d1.sign < 0:
        raise Refused(f"the particle starts on wall {wall} and moves into it")
    if jet.d1.sign > 0:
        return False
    exact = flight.exact(wall, Fraction(0))
    if exact.d1 != 0:
        raise Unproved("the sign of f' at the start")
    if exact.d2 > 0:
        return True
    is_at_rest = not any(law.is_moving for law in flight.scene.laws.values())
    raise Undefined("sliding" if exact.d2 < 0 or is_at_rest or wall == "base" else "tangency")


def require_near(flight: Flight, wall: str, gap: Interval) -> None:
    """Refuse a state farther from its wall than 2^-20 of the wall's size.

    Raises:
        Refused: it is.
        Unproved: this precision cannot tell.
    """
    zero, scene, (x, _) = flight.clock.zero, flight.scene, flight.place(flight.clock.zero)
    names = {"arc": "r", "floor": "h"}
    if wall in names or (wall == "base" and scene.table != "stem"):
        size = flight.law(names.get(wall, "r"), zero).f
    else:
        size = width_jet(lambda name: flight.law(name, zero), scene.laws).f
    if wall == "arc":
        gap = gap / (size * 2)
    far, (least, most) = max(abs(end) for end in gap.ends), size.ends
    if wall in ("left", "right"):
        least, most = (max(end, abs(x.f.ends[0])) for end in (least, most))
    if far > NEAR * least:
        if min(abs(end) for end in gap.ends) <= NEAR * most:
            raise Unproved(f"whether the state is on wall {wall}")
        raise Refused(f"the state is off wall {wall}")


# 7. Scenes


def read_scene(data: Any) -> Scene:
    """Read a scene from its JSON form, and prove it to be valid at all times.

    Raises:
        Refused: it is not, with the condition that is broken.
        Unproved: a condition is open.
    """
    shapes = {"cap": {"r"}, "stem": {"w", "h"}, "mushroom": {"r", "h", "w"}}
    table = data.get("table") if isinstance(data, dict) else None
    if not isinstance(table, str) or table not in shapes:
        raise Refused("the scene has no known table")
    given = {name: value for name, value in data.items() if name not in ("table", "name", "notes")}
    optional = set() if table == "cap" else {"slope"}
    wanted = (
        shapes[table] - {"w"} | {"nu"} if "nu" in given and table == "mushroom" else shapes[table]
    )
    if set(given) | optional != wanted | optional:
        raise Refused(f"the laws of a {table} are {', '.join(sorted(wanted | optional))}")
    read = {
        name: read_law(value) for name, value in {**dict.fromkeys(optional, 0), **given}.items()
    }
    rates = {rate for law, rate in read.values() if law.is_moving}
    if len(rates) > 1:
        raise Refused("laws that move must share one period")
    laws = {name: law for name, (law, _) in read.items()}
    scene = Scene(table, laws, rates.pop() if rates else Rate())
    require_valid(scene)
    return scene


def read_law(data: Any) -> tuple[Law, Rate]:
    """Read a law.

    Raises:
        Refused: it is none.
    """
    if not isinstance(data, dict):
        mean = read_number("law", data)
        return Law(mean, (), (), Fraction(0), (mean, mean)), Rate()
    kind = data.get("kind")
    if kind == "bang-bang" and set(data) == {"kind", "knots"}:
        return read_legs(data["knots"])
    if kind != "fourier" or ("omega" in data) == ("period" in data):
        raise Refused("a law is a number, a fourier or a bang-bang law")
    waves = []
    for name in ("cos", "sin"):
        if not isinstance(data.get(name, []), list) or len(data.get(name, [])) > 16:
            raise Refused(f"{name} must be a list of at most 16 numbers")
        waves.append([read_number(name, value) for value in data.get(name, [])])
    if set(data) - {"kind", "mean", "omega", "period", "cos", "sin"}:
        raise Refused("a law has an unknown field")
    mean = read_number("mean", data.get("mean"))
    speeds = [None if data.get(n) is None else read_number(n, data[n]) for n in ("omega", "period")]
    if any(speed is not None and speed <= 0 for speed in speeds):
        raise Refused("omega and period must be positive")
    pairs = tuple(itertools.zip_longest(*waves, fillvalue=Fraction(0)))
    reach = sum((abs(a) + abs(b) for a, b in pairs), Fraction(0))
    ends, is_tight = (mean - reach, mean + reach), sum(a != 0 for pair in pairs for a in pair) < 2
    return Law(mean, pairs, (), Fraction(0), ends, is_tight), Rate(*speeds)


def read_legs(knots: Any) -> tuple[Law, Rate]:
    """Read a bang-bang law: each leg is two parabolas, at rest at its knots.

    Raises:
        Refused: times do not rise, or the law does not close.
    """
    if not isinstance(knots, list) or not 2 <= len(knots) <= 256:
        raise Refused("knots must be a list of 2 to 256 pairs")
    if any(not isinstance(knot, list) or len(knot) != 2 for knot in knots):
        raise Refused("a knot is a pair of time and value")
    pairs = [(read_number("knot", t), read_number("knot", value)) for t, value in knots]
    first, legs = pairs[0][0], []
    for (t, a), (u, b) in itertools.pairwise(pairs):
        if t >= u:
            raise Refused("knots must rise in time")
        begin, end, bend = t - first, u - first, 4 * (b - a) / (u - t) ** 2
        middle = (begin + end) / 2
        legs += [Leg(begin, middle, begin, a, bend), Leg(middle, end, end, b, -bend)]
    if pairs[0][1] != pairs[-1][1]:
        raise Refused("the last knot's value must be that of the first")
    values = [value for _, value in pairs]
    ends = min(values), max(values)
    return Law(pairs[0][1], (), tuple(legs), first, ends), Rate(period=pairs[-1][0] - first)


def read_number(name: str, value: Any) -> Fraction:
    """Return a finite binary64 number, exactly.

    Raises:
        Refused: it is none.
    """
    if type(value) not in (int, float) or not abs(value) <= sys.float_info.max:
        raise Refused(f"{name} is not a finite number")
    return Fraction(float(value))


def require_valid(scene: Scene) -> None:
    """Prove r, h, w > 0, w <= r and w > h slope at all times.

    Bounds of the laws show it, or the search of section 4: each condition is an f that must not
    vanish within a period. Where f has a root it falls below 0, and the condition is broken.

    Raises:
        Refused: a condition is broken.
        Unproved: it is open.
    """
    laws, clock = scene.laws, Clock(scene, Fraction(0), 256)
    zero = clock.zero
    rest = Flight(clock, Line(zero, zero, zero, zero), Fraction(0), begin=number(-1, 256))
    conditions = [name for name in laws if name != "slope"]
    conditions += ["tilt"] if "h" in laws else []
    if scene.table == "mushroom" and not (
        laws["nu"].ends[1] <= 1 if "nu" in laws else laws["w"].ends[1] <= laws["r"].ends[0]
    ):
        conditions.append("mouth")
    for name in conditions:
        least = laws[name].ends[0] if name in laws else Fraction(0)
        value = rest.f(name, zero).f
        if (
            value.hi < 0
            or (value.hi == 0 and name != "mouth")
            or (least <= 0 and name in laws and laws[name].is_tight)
        ):
            raise Refused(f"{BROKEN.get(name, name + ' <= 0')} at some time")
        if least <= 0 and clock.turn and rest.first_root(name, zero, clock.turn.high) is not None:
            raise Refused(f"{BROKEN.get(name, name + ' <= 0')} at some time")


# 8. Claims


class Contradicted(Exception):  # noqa: N818
    """A claim is false: what is proved contradicts it."""


class Verdict(NamedTuple):
    """What is known about a line: "proved", "false" or "not proved", and why."""

    status: str
    reason: str = ""


class Step(NamedTuple):
    """How a flight ends: the wall met (None at the horizon), dt, x, y, vx, vy, and whether captured."""

    wall: str | None
    numbers: dict[str, Interval]
    flight: Flight
    hit: Hit | None


def walk(scene: Scene, state: State, t_end: Fraction, bits: int) -> Iterator[Step]:
    """Follow a particle from collision to collision, up to the horizon.

    Raises:
        Refused: the state is bad.
        Undefined: the first step has no answer.
        Unproved: this precision cannot tell what comes next.
    """
    flight, in_cap = start(scene, state, t_end, bits)
    while hit := flight.event(in_cap=in_cap):
        numbers, later = bounce(flight, hit)
        yield Step(hit.wall, numbers, flight, hit)
        flight, in_cap = later, scene.table != "stem" and hit.wall in ("arc", "base")
    end, (_, _, vx, vy) = number(flight.end, bits), flight.line
    x, y = (jet.f for jet in flight.place(end))
    numbers = {"dt": end - flight.begin, "x": x, "y": y, "vx": vx, "vy": vy}
    yield Step(None, numbers, flight, None)


def mark(step: Step) -> str:
    """Return what a step means for capture: "out" of the cap, an arc hit "captured" or "free", or "".

    A hit of the arc is captured when |x vy - y vx| > w |v|; squares compare as these do.
    """
    flight, hit = step.flight, step.hit
    if hit is None or hit.wall in SIDES:
        return "out"
    if hit.wall == "base" or flight.scene.table != "mushroom":
        return ""
    x, y, vx, vy = flight.line
    width = width_jet(lambda name: flight.law(name, hit.root), flight.scene.laws).f
    excess = (x * vy - y * vx).square() - width.square() * (vx.square() + vy.square())
    if not excess.sign:
        raise Unproved("whether a hit of the arc is captured")
    return "captured" if excess.sign > 0 else "free"


def find_stays(marks: Sequence[str]) -> list[list[int]]:
    """Return where each stay in the cap begins and ends, as places in a path.

    It begins with a captured hit. It ends with the first hit of the arc after its last captured one, or
    where the particle leaves the cap, or at the horizon.
    """
    stays, begin, end = [], None, None
    for place, what in enumerate(marks):
        if what == "captured":
            begin, end = place if begin is None else begin, None
        elif what == "free" and end is None:
            end = place
        elif what == "out":
            if begin is not None:
                stays.append([begin, place if end is None else end])
            begin = end = None
    return stays


def take(data: Any, name: str, kind: type) -> Any:
    """Return a field of a JSON object.

    Raises:
        Unreadable: it is missing, or of another type.
    """
    if not isinstance(data, dict) or not isinstance(data.get(name), kind):
        raise Unreadable(f"{name} must be present, and a {kind.__name__}")
    return data[name]


def require_inside(name: str, claim: Any, found: Interval) -> None:
    """Require that a claimed enclosure holds the enclosed number.

    Raises:
        Unreadable: the claim is no pair of decimals.
        Contradicted: the number lies outside.
        Unproved: it may.
    """
    ends = take(claim, name, list)
    if len(ends) != 2 or not all(isinstance(end, str) and DECIMAL.fullmatch(end) for end in ends):
        raise Unreadable(f"{name} must be two decimals")
    (low, high), (least, most) = map(Fraction, ends), found.ends
    if most < low or least > high:
        raise Contradicted(f"{name} is {float(least)!r}")
    if not low <= least <= most <= high:
        raise Unproved(f"{name} is not shown to lie within its enclosure")


def check_line(record: Any, bits: int) -> None:
    """Hold a line to what is proved at one precision.

    Raises:
        Unreadable: it is no line of a corpus.
        Contradicted: its claim is false.
        Unproved: its claim is open.
    """
    first, *others = take(record, "expect", list) or [None]
    outcome, steps = take(first, "outcome", str), first.get("steps", [])
    kind, given = take(record, "kind", str), take(record, "state", dict)
    count = record.get("collisions", 1)
    late = False
    try:
        scene = read_scene(record.get("scene"))
        state, t_end = read_state(scene, given), read_number("t_end", record.get("t_end"))
        turn = Clock(scene, Fraction(0), 64).turn
        late = abs(state.t) >= LATE * (turn.ends[0] if turn else 1)
        found = list(itertools.islice(walk(scene, state, t_end, bits), count))
    except Refused as reason:
        ending, found = ("rejected", str(reason)), []
    except Undefined as reason:
        ending, found = ("undefined", str(reason)), []
    else:
        ending = ("collision" if found[-1].hit else "horizon"), ""
    if outcome != ending[0] or (outcome == "undefined" and first.get("reason") != ending[1]):
        raise Contradicted(" ".join(("the answer is", *ending)).strip())
    if kind == "flow":
        found = thin(found, first.get("stays", []))
    if len(steps) != len(found) or (
        found and kind != "flow" and ending[0] == "collision" and len(found) != count
    ):
        raise Contradicted(f"the path has {len(found)} steps")
    for place, (claim, step) in enumerate(zip(steps, found, strict=True), 1):
        if claim.get("wall") != step.wall:
            raise Contradicted(f"step {place} ends at {step.wall or 'the horizon'}")
        for name in NUMBERS:
            require_inside(name, claim, step.numbers[name])
    large = any(abs(value) >= LARGE for value in given.values() if type(value) is float)
    for other in others:
        allowed = (other == {"outcome": "undecided"} and outcome == "undefined") or (
            other == {"outcome": "rejected"} and (late or large)
        )
        if not allowed:
            raise Contradicted("no rule permits the further answer")


def read_state(scene: Scene, data: Mapping[str, Any]) -> State:
    """Read a state.

    Raises:
        Refused: a field is missing, unknown, or no number, or the wall is none of the table.
    """
    wall = data.get("wall")
    if set(data) | {"wall"} != {*FIELDS, "wall"}:
        raise Refused(f"the fields of a state are {', '.join(FIELDS)}, wall")
    if wall is not None and wall not in WALLS[scene.table]:
        raise Refused("state.wall is none of the table")
    return State(*(read_number(name, data[name]) for name in FIELDS), wall)


def thin(path: Sequence[Step], claimed: Any) -> list[Step]:
    """Return the steps of a flow that are written down: where a stay begins or ends, and the horizon.

    Raises:
        Contradicted: the stays are others.
    """
    stays = find_stays([mark(step) for step in path])
    kept = sorted({place for stay in stays for place in stay} | {len(path) - 1})
    if claimed != [[kept.index(place) for place in stay] for stay in stays]:
        raise Contradicted("the particle is captured at other times")
    steps = []
    for before, place in zip([-1, *kept], kept, strict=False):
        dt = reduce(add, (step.numbers["dt"] for step in path[before + 1 : place + 1]))
        steps.append(path[place]._replace(numbers={**path[place].numbers, "dt": dt}))
    return steps


def verify_line(record: Any) -> Verdict:
    """Prove a line of a corpus.

    Args:
        record: the line's JSON.

    Returns:
        The verdict: "proved", "false" or "not proved", and which step of the argument fails.

    Raises:
        Unreadable: it is no line of a corpus.
    """
    for bits in PRECISIONS:
        try:
            check_line(record, bits)
        except Contradicted as reason:
            return Verdict("false", str(reason))
        except Unproved as reason:
            verdict = Verdict("not proved", str(reason))
        else:
            return Verdict("proved")
    return verdict


def backward_error(scene: Scene, state: State, t_end: Fraction, answer: Any, bits: int) -> Fraction:
    """Return how far an answer to one step is from the truth, in backward ulps.

    That is |answer - truth|, for the worst of t, x, y, vx, vy, over what moves the truth when each input
    moves by 2^-53 of its size, and 2^-53 of the truth.

    Raises:
        Unreadable: a field is missing.
        Contradicted: another wall is met first.
        Unproved: this precision cannot tell.
    """
    wall, *rest = first_step(scene, state, t_end, bits)
    if answer.get("wall") != wall:
        raise Contradicted(f"{wall or 'the horizon'} comes first, at t = {float(rest[0])!r}")
    moves = [UNIT * abs(value) for value in rest]
    for name in FIELDS:
        value = getattr(state, name)
        other, *moved = first_step(scene, state._replace(**{name: value * (1 + UNIT)}), t_end, bits)
        if other != wall:
            raise Unproved(
                f"another wall is met when {name} moves by half a unit in its last place"
            )
        moves = [move + abs(one - two) for move, one, two in zip(moves, moved, rest, strict=True)]
    errors = [
        abs(Fraction(take(answer, name, float)) - truth)
        for name, truth in zip(FIELDS, rest, strict=True)
    ]
    return max(
        (error / move if move else error / UNIT) for error, move in zip(errors, moves, strict=True)
    )


def first_step(scene: Scene, state: State, t_end: Fraction, bits: int) -> Any:
    """Return the wall that is met first, and t, x, y, vx, vy after it."""
    step = next(walk(scene, state, t_end, bits))
    values = [sum(step.numbers[name].ends) / 2 for name in NUMBERS]
    return step.wall, state.t + values[0], *values[1:]


def verify_answers(data: Any) -> Iterator[str]:
    """Judge a trajectory of floating-point numbers, each step from the state that it had itself."""
    scene = read_scene(take(data, "scene", dict))
    state = read_state(scene, take(data, "state", dict))
    t_end = read_number("t_end", data.get("t_end", 1e300))
    for place, answer in enumerate(take(data, "steps", list), 1):
        try:
            error = backward_error(scene, state, t_end, answer, 256)
            if error * UNIT > WRONG:
                raise Contradicted(f"wrong by {float(error):.3g} backward ulps")
        except (Contradicted, Undefined, Refused, Unproved) as reason:
            raise Contradicted(f"step {place} is false or open: {reason}") from None
        yield f"step {place}: {answer['wall']}, within {float(error):.2g} backward ulps"
        state = read_state(scene, {name: answer[name] for name in (*FIELDS, "wall")})


def main(arguments: Sequence[str]) -> int:
    """Verify files; return 0 when all is proved, 1 when not, 2 when something is unreadable."""
    total = proved = 0
    for path in arguments:
        with open(path, encoding="utf-8") as lines:
            for place, line in enumerate(lines, 1):
                record = json.loads(line)
                verdict = verify_line(record)
                total, proved = total + 1, proved + (verdict.status == "proved")
                if verdict.status != "proved":
                    print(f"{path}:{place}: {record.get('id')}: {verdict.status}: {verdict.reason}")
    print(f"{proved} of {total} proved")
    return int(proved < total)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
