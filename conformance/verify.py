"""Prove claims about collisions with moving walls from the published lines alone.

    python verify.py FILE.jsonl ...        one line for each claim not proved; "N of N proved"
    python verify.py --answers FILE        how far a trajectory in floating point is from the truth

A particle flies straight between walls that move (Gelfreich, Rom-Kedar, Turaev 2014, sec. 3.1). A
line of a corpus says where it starts and what comes first: a wall, at a time and with a velocity
that are enclosed between two decimals. This file proves such a line from the line alone. It
computes with integers and imports Python's standard library only. docs/proof.md has the theorem
(sections 1 to 6). The argument stands here in the order in which it is used:

 1. `Interval`: arithmetic that never loses the true number.
 2. `Clock`, `law_jet`: a law and its two derivatives over a stretch of time.
 3. `wall_jet`: each wall is a function f of the flight time, positive inside the table.
 4. `Flight.is_clear`: f > 0 on a stretch. `Flight.first_root`: the first time at which f = 0.
 5. `Flight.event`: which wall is met first. `bounce`: the flight after it.
 6. `start`: which wall a state leaves, or why it is refused or has no answer.
 7. `read_scene`: the scene is valid at all times, or is proved to be invalid.
 8. `check_line`: what a line claims, compared with what is proved.

The proof ends there. Section 9 reads files and prints verdicts. Section 10 is for --answers only:
it estimates errors and proves nothing.

There are three verdicts:

- "proved": the claim is true. The true numbers lie between the decimals, which may be far apart;
  `--digits` bounds how far.
- "false": something that is proved contradicts the claim.
- "not proved": the claim is open at each precision up to 4,096 bits, or a search took too long.

Two kinds of claims stay open. Two walls may be met together at an irrational time. Or f may be 0
exactly while the phase of a Fourier law is not a whole number of quarter turns.

The verifier does not judge the fields `allowance`, `condition` and `level`, the texts that describe
a line, and the reason of a rejection. It refuses the scenes that `scene.from_data` refuses, with one
exception. A condition may combine a Fourier law and a bang-bang law. There `scene.from_data` also
refuses a scene that touches the bound, or nearly does.
"""

import argparse
import csv
import io
import itertools
import json
import os
import re
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import lru_cache, partial, reduce
from math import floor, inf
from typing import Any, NamedTuple, NoReturn

if sys.version_info < (3, 10):  # noqa: UP036 - people run this file alone
    sys.stderr.write("verify.py needs Python 3.10 or later\n")
    sys.exit(2)

PRECISIONS = (128, 256, 512, 1024, 2048, 4096)  # bits, tried in turn
WORK = 2_700_000  # units of work for a line, of some 5 microseconds each: about 13 seconds in all
COST = {"arc": 9, "left": 6, "right": 6}  # units of work for f of a wall; 3 for any other one
SHARE = Fraction(61, 128)  # where a stretch is cut: not in the middle, where a root may well lie
NEAR = Fraction(1, 2**20)  # how far from its wall a state may lie, as a share of the wall's size
LATE = 2**30  # periods: a state at |t| as late as this may be refused
LARGE = Fraction(10**100)  # a state with a number of this size may be refused
MOST_WAVES = 16  # of a Fourier law
MOST_KNOTS = 256  # of a bang-bang law
UNIT = Fraction(1, 2**53)  # unit roundoff of binary64: half a unit in the last place, relative
BEYOND = Fraction(3, 2**12)  # how far past its end a search goes, as a share of its length
WITHIN = 1e-9 * 2.0**53  # --answers: backward error, in ulps, beyond which a step is false
TICKS = 2  # --answers: last places by which t may be off where an answer does not give dt
FAR = 1e300  # --answers: the horizon of a path that has none
PULSE = 5  # --answers: seconds between two lines of progress
LARGEST = sys.float_info.max
SIDES = ("left", "right", "floor")
WALLS = {"cap": ("arc", "base"), "stem": ("base", *SIDES), "mushroom": ("arc", "base", *SIDES)}
FIELDS = ("t", "x", "y", "vx", "vy")  # of a state, and of an answer in floating point
# The laws of a table, and the fields of a law. Those of OPTIONAL may be left out.
LAWS = {"cap": ("r",), "stem": ("w", "h", "slope"), "mushroom": ("r", "w", "nu", "h", "slope")}
LAW_FIELDS = {"wave": ("kind", "mean", "omega", "period", "cos", "sin"), "legs": ("kind", "knots")}
OPTIONAL = ("slope", "w", "nu", "omega", "period", "cos", "sin")
NUMBERS = ("dt", "x", "y", "vx", "vy")  # of a claimed step; dt counts from the step before
DECIMAL = re.compile(r"-?[0-9]{1,400}(\.[0-9]{1,400})?(E[+-]?[0-9]{1,4})?")
# Characters that a name may not hold: controls but tab and line ends, lone surrogates.
HIDDEN = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")


class Unproved(Exception):  # noqa: N818
    """Something is open at this precision. The next precision may decide it."""


class Refused(Exception):  # noqa: N818
    """The question is proved to be bad: its scene is invalid, or its state is not in the table."""


class Undefined(Exception):  # noqa: N818
    """It is proved that the motion has no next step; the message is the reason."""


class Contradicted(Exception):  # noqa: N818
    """A claim is false: what is proved contradicts it."""


class Unreadable(ValueError):  # noqa: N818
    """The input is no line of a corpus."""


def require(holds: object, failure: Exception) -> None:
    """Raise a failure where a condition does not hold."""
    if not holds:
        raise failure


# 1. Intervals


class Interval:
    """All real numbers from lo 2^exp to hi 2^exp.

    An operation returns an interval that holds the result for all numbers of its operands. It
    rounds outward to `bits` binary digits. `low`, `high` and `number` keep all digits.
    """

    __slots__ = ("bits", "exp", "hi", "lo")

    def __init__(self, lo: int, hi: int, exp: int, bits: int) -> None:
        """Keep the ends as they are."""
        self.lo, self.hi, self.exp, self.bits = lo, hi, exp, bits

    def __add__(self, other: "Interval") -> "Interval":
        """Return all sums."""
        if other.lo == other.hi == 0:
            return self
        if self.lo == self.hi == 0:
            return rounded(other.lo, other.hi, other.exp, self.bits)
        exp = min(self.exp, other.exp)
        up, other_up = self.exp - exp, other.exp - exp
        lo, hi = (self.lo << up) + (other.lo << other_up), (self.hi << up) + (other.hi << other_up)
        return rounded(lo, hi, exp, self.bits)

    def __neg__(self) -> "Interval":
        """Return all numbers with the other sign."""
        return Interval(-self.hi, -self.lo, self.exp, self.bits)

    def __sub__(self, other: "Interval") -> "Interval":
        """Return all differences."""
        return self + -other

    def __mul__(self, other: "Interval | int") -> "Interval":
        """Return all products."""
        if isinstance(other, int):
            ends = self.lo * other, self.hi * other
            return rounded(min(ends), max(ends), self.exp, self.bits)
        if self.lo == self.hi == 0 or other.lo == other.hi == 0:
            return Interval(0, 0, 0, self.bits)
        a, b, c, d = self.lo, self.hi, other.lo, other.hi
        if a >= 0 and c >= 0:
            return rounded(a * c, b * d, self.exp + other.exp, self.bits)
        products = (a * c, a * d, b * c, b * d)
        return rounded(min(products), max(products), self.exp + other.exp, self.bits)

    def __truediv__(self, other: "Interval") -> "Interval":
        """Return all quotients.

        Raises:
            Unproved: the divisor may be 0.
        """
        require(other.sign != 0, Unproved("the sign of a divisor is open"))
        up = self.bits + max(abs(other.lo), other.hi).bit_length()
        pairs = [(a << up, b) for a in (self.lo, self.hi) for b in (other.lo, other.hi)]
        lo, hi = min(a // b for a, b in pairs), max(-(-a // b) for a, b in pairs)
        return rounded(lo, hi, self.exp - other.exp - up, self.bits)

    def __pow__(self, power: int) -> "Interval":
        """Return all squares. `power` is 2: where 0 is inside, the least square is 0."""
        ends = self.lo**power, self.hi**power
        return rounded(min(ends) if self.sign else 0, max(ends), power * self.exp, self.bits)

    @property
    def sign(self) -> int:
        """Return 1 or -1 where all numbers have this sign, else 0."""
        return (self.lo > 0) - (self.hi < 0)

    @property
    def low(self) -> "Interval":
        """Return the lower end, a point."""
        return Interval(self.lo, self.lo, self.exp, self.bits)

    @property
    def high(self) -> "Interval":
        """Return the upper end, a point."""
        return Interval(self.hi, self.hi, self.exp, self.bits)

    @property
    def ends(self) -> tuple[Fraction, Fraction]:
        """Return both ends."""
        up, down = 1 << max(self.exp, 0), 1 << max(-self.exp, 0)
        return Fraction(self.lo * up, down), Fraction(self.hi * up, down)

    def cut(self) -> "Interval":
        """Return a point inside, near the middle: not the middle, where a root may well lie.

        An interval too narrow to cut gives its lower end.
        """
        point = (self.low + (self.high - self.low) * number(SHARE, self.bits)).low
        return point if is_below(self.low, point) else self.low

    def simplest(self) -> "Interval":
        """Return a point inside that has few digits: a root that has few is then found exactly.

        It is the first multiple of 2^up above lo, and 2^up <= hi - lo.
        """
        up = max(0, (self.hi - self.lo).bit_length() - 1)
        point = min(((self.lo >> up) + 1) << up, self.hi)
        return Interval(point, point, self.exp, self.bits)


def rounded(lo: int, hi: int, exp: int, bits: int) -> Interval:
    """Return an interval rounded outward to so many digits.

    The number 0 gets the exponent 0. Exponents of products add up, and no digit of 0 would ever be
    rounded away: over a long path its exponent would fall without end.
    """
    if lo == hi == 0:
        return Interval(0, 0, 0, bits)
    extra = max(lo.bit_length(), hi.bit_length()) - bits
    if extra <= 0:
        return Interval(lo, hi, exp, bits)
    return Interval(lo >> extra, -(-hi >> extra), exp + extra, bits)


def floor_of(end: int, exp: int) -> int:
    """Return the greatest integer that is at most end 2^exp."""
    return end << exp if exp > 0 else end >> -exp


def number(value: Fraction | int, bits: int) -> Interval:
    """Return a number: exactly if its denominator is a power of two, else within one unit."""
    top, bottom = value.numerator, value.denominator
    if bottom & (bottom - 1) == 0:
        return Interval(top, top, 1 - bottom.bit_length(), bits)
    up = bits + bottom.bit_length()
    return rounded((top << up) // bottom, -((-top << up) // bottom), -up, bits)


def join(*parts: Interval) -> Interval:
    """Return the smallest interval that holds all given ones."""
    exp = min(part.exp for part in parts)
    ends = [end << (part.exp - exp) for part in parts for end in (part.lo, part.hi)]
    return Interval(min(ends), max(ends), exp, parts[0].bits)


def is_below(one: Interval, other: Interval) -> bool:
    """Tell whether every number of one interval is less than every number of another."""
    exp = min(one.exp, other.exp)
    return one.hi << (one.exp - exp) < other.lo << (other.exp - exp)


@lru_cache(maxsize=64)
def pi(bits: int) -> Interval:
    """Enclose pi = 16 arctan(1/5) - 4 arctan(1/239) (Machin).

    Each term of either series is rounded down twice, which loses less than 3 units; times 16 that
    is less than 64. What is left out of each series is less than 64, too: 128 for both.
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
    """Enclose cosine and sine of a phase, which is given in turns and known narrowly.

    The nearest quarter turn is taken out. The angle left is m 2^-scale for an integer m, and up to
    `radius` units more or less. The slopes of both functions are at most 1. |m| 2^-scale < 1, so
    each of Taylor's terms is at most the term before. Each term is rounded down twice. If term
    k - 1 is e units too small, term k is at most (e + 1) / k + 1 units too small. From e = 0 on
    that is always less than 4. The series alternates, so the rest counts as one more term.

    Raises:
        Unproved: the phase is known to no better than a radian.
    """
    scale, bits = turns.bits + 8, turns.bits
    quarter = floor_of(floor_of(turns.lo + turns.hi, turns.exp + 2) + 1, -1)
    angle = (turns * 4 - number(quarter, bits)) * pi(scale) * number(Fraction(1, 2), bits)
    m, up = floor_of(angle.lo + angle.hi, angle.exp + scale - 1), angle.exp + scale
    radius = max(-floor_of(-angle.hi, up) - m, m - floor_of(angle.lo, up))
    k, term, sums = 0, 1 << scale, [0, 0]
    require(radius >> scale == 0, Unproved("a phase is open"))
    while term:
        sums[k % 2] += term if k % 4 < 2 else -term
        k += 1
        term = (term * abs(m) >> scale) // k
    error, sums[1] = radius + 4 * k + 4, sums[1] if m > 0 else -sums[1]
    cos, sin = (rounded(total - error, total + error, -scale, bits) for total in sums)
    return ((cos, sin), (-sin, cos), (-cos, -sin), (sin, -cos))[quarter % 4]


# 2. Laws


class Jet(NamedTuple):
    """A function of time with its first and second derivative: intervals, or exact rationals."""

    f: Any
    d1: Any
    d2: Any

    def __add__(self, other: Any) -> "Jet":
        """Return the sum."""
        return Jet(self.f + other.f, self.d1 + other.d1, self.d2 + other.d2)

    def __neg__(self) -> "Jet":
        """Return the function with the other sign."""
        return Jet(-self.f, -self.d1, -self.d2)

    def __sub__(self, other: "Jet") -> "Jet":
        """Return the difference."""
        return self + -other

    def __mul__(self, other: Any) -> "Jet":
        """Return the product, by Leibniz' rule. A square is enclosed more tightly, as one."""
        p, q = self, other
        if p is q:
            return Jet(p.f**2, p.f * p.d1 * 2, (p.d1**2 + p.f * p.d2) * 2)
        d2 = p.d2 * q.f + p.d1 * q.d1 * 2 + p.f * q.d2
        return Jet(p.f * q.f, p.d1 * q.f + p.f * q.d1, d2)


class Leg(NamedTuple):
    """c + bend (t - origin)^2 / 2 from `begin` to `end`: half of the way between two knots.

    `bend` is the acceleration.
    """

    begin: Fraction
    end: Fraction
    origin: Fraction
    c: Fraction
    bend: Fraction


class Law(NamedTuple):
    """A parameter as a function of time.

    Attributes:
        mean: its value without waves; not used where there are legs.
        waves: for k = 1, 2, ... the factors of cos and sin of k times the phase.
        legs: of a bang-bang law, two from each knot to the next, in the order of time; empty where
            nothing moves.
        ends: a lower and an upper bound of its values, at all times.
        is_tight: whether it attains both bounds: then a bound <= 0 breaks "> 0" (`require_valid`).
    """

    mean: Fraction
    waves: tuple[tuple[Fraction, Fraction], ...]
    legs: tuple[Leg, ...]
    ends: tuple[Fraction, Fraction]
    is_tight: bool = True


class Scene(NamedTuple):
    """A table with its laws by name; w = nu r where nu is given.

    What moves has one period: 2 pi / omega, or `period`, exactly. Both are None when nothing moves.
    `work` holds one number: the units of work that are left for the line. `is_loose` tells that the
    scene has a field that one may ignore or refuse (`without_loose`).
    """

    table: str
    laws: dict[str, Law]
    work: list[int]
    omega: Fraction | None = None
    period: Fraction | None = None
    is_loose: bool = False


class Clock:
    """The phase of all laws, in turns, at a time s after an exact instant: offset + pace s.

    Attributes:
        pace: turns per unit of time; 0 when nothing moves.
        offset: the phase at the instant, less whole turns; the phase is 0 at time 0.
        turn: the time of one turn; None when nothing moves.
        omega: the phase's rate in radians, 2 pi pace.
        zero: the number 0.
    """

    def __init__(self, scene: Scene, instant: Fraction, bits: int) -> None:
        """Reduce the phase at the instant to one turn, with as many digits as its size asks for."""
        self.scene, self.instant, self.bits = scene, instant, bits
        self.zero = self.pace = self.offset = number(0, bits)
        self.turn: Interval | None = None
        if scene.omega or scene.period:
            rate = scene.omega or 1 / (scene.period or Fraction(1))
            wide = bits + floor(abs(rate * instant)).bit_length()
            pace = number(rate, wide) / (pi(wide) * 2) if scene.omega else number(rate, wide)
            offset = pace * number(instant, wide)
            offset = offset - number(floor(offset.ends[0]), wide)
            self.pace, self.offset = (rounded(a.lo, a.hi, a.exp, bits) for a in (pace, offset))
            self.turn = number(1, bits) / self.pace
        self.omega = self.pace * pi(bits) * 2
        self._circle: dict[tuple[int, int, int], list[tuple[Interval, Interval]]] = {}

    def spend(self, units: int) -> None:
        """Count work, for each line as a whole.

        Raises:
            Unproved: the line's work is used up.
        """
        self.scene.work[0] -= units
        require(self.scene.work[0] > 0, Unproved("the search takes too long"))

    def circle(self, phase: Interval, n: int) -> Sequence[tuple[Interval, Interval]]:
        """Enclose cosine and sine of k times a phase, for k = 1 to n; stretches share their ends."""
        found = self._circle.setdefault((phase.lo, phase.hi, phase.exp), [])
        for k in range(len(found) + 1, n + 1):
            found.append(cos_sin(phase * k))
        return found

    def waves(self, s: Interval, n: int) -> Iterator[list[Interval]]:
        """Enclose cosine and sine of k times the phase over a stretch, for k = 1 to n.

        The extremes lie at whole quarters of a turn. At quarter q, cosine is 1 if q % 4 = 0 and -1
        if q % 4 = 2. Sine is 1 if q % 4 = 1 and -1 if q % 4 = 3. A stretch without an extreme has
        its largest and its least value at its ends. Any four quarters in a row hold all extremes.
        """
        begin, end = self.offset + self.pace * s.low, self.offset + self.pace * s.high
        one, at_begin, at_end = number(1, self.bits), self.circle(begin, n), self.circle(end, n)
        for k in range(1, n + 1):
            first, last = at_begin[k - 1], at_end[k - 1]
            quarters = range(
                -floor_of(-4 * k * begin.lo, begin.exp), floor_of(4 * k * end.hi, end.exp) + 1
            )[:4]
            tops = [[one] * any(q % 4 == top for q in quarters) for top in (0, 1)]
            lows = [[-one] * any(q % 4 == low for q in quarters) for low in (2, 3)]
            yield [join(first[i], last[i], *tops[i], *lows[i]) for i in (0, 1)]


def wave_jet(
    law: Law, waves: Iterable[Sequence[Any]], omega: Any, exact: Callable[[Any], Any]
) -> Jet:
    """Return mean + sum of a cos + b sin of k times the phase, and its derivatives."""
    f, d1, d2 = exact(law.mean), exact(0), exact(0)
    for k, (wave, (cos, sin)) in enumerate(zip(law.waves, waves, strict=True), 1):
        a, b = map(exact, wave)
        value, slope = cos * a + sin * b, cos * b - sin * a
        f, d1, d2 = f + value, d1 + slope * k, d2 - value * (k * k)
    return Jet(f, d1 * omega, d2 * omega**2)


def law_jet(law: Law, clock: Clock, s: Interval) -> Jet:
    """Enclose a law and its derivatives over a stretch of time.

    Rationals tell which legs of a bang-bang law a stretch touches. The law is enclosed on each of
    these legs, and the parts are joined. f'' jumps where one leg ends and the next begins. A
    stretch that begins there has the value just after the jump.
    """
    exact = partial(number, bits=clock.bits)
    # As measured. With more bits cosines cost much more, and legs hardly more.
    waves = 8 * len(law.waves) * (2**17 + clock.bits**2) // 2**17
    clock.spend(6 + waves + len(law.legs) // 2)
    if not law.legs:
        return wave_jet(law, clock.waves(s, len(law.waves)), clock.omega, exact)
    (low, high), first, jets = s.ends, law.legs[0].begin, []
    period = law.legs[-1].end - first
    begin = first + (clock.instant + low - first) % period
    # The stretch as this period sees it, and as the next one does.
    for since in (begin, begin - period):
        until = since + min(high - low, period)
        for leg in law.legs:
            if since < leg.end and leg.begin <= until:
                ends = max(leg.begin, since), min(leg.end, until)
                u, bend = join(*(exact(at - leg.origin) for at in ends)), exact(leg.bend)
                jets.append(Jet(exact(leg.c) + exact(leg.bend / 2) * u**2, bend * u, bend))
    clock.spend(6 * len(jets))
    return Jet(*(join(*parts) for parts in zip(*jets, strict=True)))


def exact_jet(scene: Scene, time: Fraction, rate: int, name: str) -> Jet:
    """Return a law and its derivatives just after a time, as rationals.

    A wave is taken at whole quarters of its turn only. There cosine and sine are 0, 1 or -1. The
    phase of wave k is 0 at time 0. Where the scene has a period, it is k time / period turns. There
    omega is irrational, and `rate` stands for it.

    Raises:
        Unproved: a wave is not at a whole quarter of its turn.
    """
    law = scene.laws[name]
    if law.legs:
        first = law.legs[0].begin
        at = first + (time - first) % (law.legs[-1].end - first)
        leg = next(leg for leg in law.legs if at < leg.end)
        slope = leg.bend * (at - leg.origin)
        return Jet(leg.c + slope * (at - leg.origin) / 2, slope, leg.bend)
    waves = [
        quarter(scene, k * time) if any(factors) else QUARTERS[0]
        for k, factors in enumerate(law.waves, 1)
    ]
    return wave_jet(law, waves, scene.omega or Fraction(rate), Fraction)


# Cosine and sine after 0, 1, 2 and 3 quarters of a turn.
QUARTERS = ((1, 0), (0, 1), (-1, 0), (0, -1))


def quarter(scene: Scene, time: Fraction) -> tuple[int, int]:
    """Return cosine and sine of the phase at a time, where it is a whole number of quarter turns.

    Raises:
        Unproved: the phase is not a whole number of quarter turns.
    """
    quarters = 4 * time / scene.period if scene.period else Fraction(0)
    require(
        quarters.denominator == 1 and (scene.period or time == 0),
        Unproved("a law is not known to be rational at this time"),
    )
    return QUARTERS[quarters.numerator % 4]


# 3. Walls


def wall_jet(scene: Scene, wall: str, law: Callable[[str], Jet], x: Jet, y: Jet) -> Jet:
    """Return f of a wall along a flight; f > 0 inside the table.

    The base of a stem lies above the particle. Other names are conditions, not walls: a scene is
    valid while r - w >= 0, w - h slope > 0, and every law but the slope is > 0.
    """
    if wall == "arc":
        r = law("r")
        return r * r - x * x - y * y
    if wall == "base":
        return -y if scene.table == "stem" else y
    if wall == "floor":
        return y + law("h")
    if wall == "left":
        return width(scene, law) + law("slope") * y + x
    if wall == "right":
        return width(scene, law) + law("slope") * y - x
    if wall == "r - w":
        return law("r") - width(scene, law)
    if wall == "w - h slope":
        return width(scene, law) - law("h") * law("slope")
    return width(scene, law) if wall == "w" else law(wall)


def width(scene: Scene, law: Callable[[str], Jet]) -> Jet:
    """Return w, half the width of the mouth: w = nu r where nu is given."""
    return law("nu") * law("r") if "nu" in scene.laws else law("w")


# 4. Where f > 0, and where it vanishes first
#
# A stretch is a closed interval of times since the clock's instant. It is cut into parts.


class State(NamedTuple):
    """A state as it is given, exactly."""

    t: Fraction
    x: Fraction
    y: Fraction
    vx: Fraction
    vy: Fraction
    wall: str | None


class Flight:
    """A particle in flight: where walls are on its way, and what it meets first.

    Times count from the clock's instant. The place at time 0 and the velocity lie in a box. The
    flight begins at some time in `begin`, which is exactly 0 for a state that is given. The true
    state lies in the box, and what is proved about walls that are met holds for the whole box.

    The wall being left is an exception. There f is not 0 at the begin but c, the residual, because
    the state is rounded. f - c stands for f, and f - c = 0 at the begin holds for the true state
    only. What is proved about this wall holds for the true state.
    """

    def __init__(
        self,
        clock: Clock,
        line: tuple[Interval, Interval, Interval, Interval],
        end: Fraction,
        begin: Interval,
        wall: str | None = None,
        residual: Interval | None = None,
        state: State | None = None,
    ) -> None:
        """Describe a flight.

        Args:
            clock: the laws' phase; times are counted from its instant.
            line: x and y at that instant, vx and vy.
            end: the horizon.
            begin: encloses when the flight begins.
            wall: the wall being left.
            residual: c of this wall.
            state: where it begins, at time 0 exactly; it decides ties.
        """
        self.clock, self.line, self.end, self.begin = clock, line, end, begin
        self.wall, self.residual, self.state = wall, residual or clock.zero, state
        # Whether f = f' = 0 < f'' on the wall being left at time 0, exactly: `start` tells.
        self.scene, self.bits, self.is_flat = clock.scene, clock.bits, False
        self._laws: dict[tuple[str, int, int, int], Jet] = {}

    def law(self, name: str, s: Interval) -> Jet:
        """Enclose a law over a stretch."""
        law = self.scene.laws[name]
        # A law that never moves is the same over every stretch.
        key = (name, s.lo, s.hi, s.exp) if law.waves or law.legs else (name, 0, 0, 0)
        if key not in self._laws:
            self._laws[key] = law_jet(law, self.clock, s)
        return self._laws[key]

    def f(self, wall: str, s: Interval) -> Jet:
        """Enclose f of a wall, less the residual of the wall being left, over a stretch.

        Nearly all work is done here and in `law_jet`. Both count it, as measured.
        """
        self.clock.spend(COST.get(wall, 3) * (2**20 + self.bits**2) // 2**20)
        (x, y, vx, vy), zero = self.line, self.clock.zero
        place = Jet(x + vx * s, vx, zero), Jet(y + vy * s, vy, zero)
        jet = wall_jet(self.scene, wall, lambda name: self.law(name, s), *place)
        return jet._replace(f=jet.f - self.residual) if wall == self.wall else jet

    def exact(self, wall: str, s: Fraction, rate: int = 1) -> Jet:
        """Return f of a wall at an exact time, in rationals; no residual is subtracted.

        Derivatives of laws with a period are those for 2 pi / period = `rate`.

        Raises:
            Unproved: f is not known to be rational at this time.
        """
        if self.state is None:
            raise Unproved("the state is not known exactly")
        t, x, y, vx, vy, _ = self.state
        place = Jet(x + vx * s, vx, Fraction(0)), Jet(y + vy * s, vy, Fraction(0))
        return wall_jet(self.scene, wall, partial(exact_jet, self.scene, t + s, rate), *place)

    def is_zero(self, wall: str, s: Fraction) -> bool:
        """Tell whether f, less a residual, is known to vanish at an exact time."""
        try:
            residual = self.exact(wall, Fraction(0)).f if wall == self.wall else 0
            return bool(self.exact(wall, s).f == residual)
        except Unproved:
            return False

    def is_clear(self, wall: str, s: Interval, jet: Jet, last: Interval) -> bool:
        """Tell whether f > 0 is proved on a stretch but at its left end, where f >= 0 is known.

        Its enclosure alone does not show f > 0: `first_root` asks that before. If f > 0 is proved
        here, it holds at the right end, where the next stretch starts. f and f' are continuous, as
        laws and their slopes are at knots. f'' may jump at finitely many times. One of these suffices
        (the names are those of docs/proof.md, section 3):

        - rising: f' > 0;
        - concave: f'' <= 0, and f > 0 at the right end: f lies on or above its chord;
        - falling: f' < 0, and f > 0 at the right end;
        - centred: f(p) + f'(p) (s - p) + f'' (s - p)^2 / 2 > 0 for a point p of the stretch.
          Taylor's theorem holds across the jumps, because f' is Lipschitz;
        - never reached: the wall never comes to where the particle is at either end
          (`is_never_met`).

        The wall being left has f = 0 where the flight begins, somewhere in `begin`. On a stretch
        that `begin` overlaps, f > 0 is proved after the begin only. There are three cases. If the
        flight begins within the stretch, f rises from 0, or its chord starts at 0. If it begins
        before the stretch, f > 0 is known at the left end. If it begins after the stretch, there is
        nothing to prove. So "rising" and "concave" suffice there. f'' > 0 suffices, too, if f' = 0
        at the begin exactly (lifting, `is_flat`).

        Args:
            wall: the wall.
            s: the stretch.
            jet: f and its derivatives over the stretch.
            last: f at the right end.
        """
        is_positive_at_end = last.sign > 0
        if jet.d1.sign > 0 or (jet.d2.hi <= 0 and is_positive_at_end):
            return True
        if self.holds_begin(wall, s):
            return bool(self.is_flat and jet.d2.sign > 0)
        if jet.d1.sign < 0 and is_positive_at_end:
            return True
        p, half = s.simplest(), number(Fraction(1, 2), self.bits)
        at, u = self.f(wall, p), s - p
        is_positive = (at.f + at.d1 * u + jet.d2 * u**2 * half).sign > 0
        return is_positive or all(self.is_never_met(wall, end, s) for end in (s.high, s.low))

    def holds_begin(self, wall: str, s: Interval) -> bool:
        """Tell whether f of the wall being left may vanish on a stretch because the flight begins.

        It may, unless the stretch lies after all of `begin`. There no root is accepted.
        """
        return wall == self.wall and not is_below(self.begin, s.low)

    def is_never_met(self, wall: str, at: Interval, s: Interval) -> bool:
        """Tell whether a wall never reaches the place where this particle is at the time `at`.

        The flight is straight, and with the laws held still f is concave in the place. So f on a
        stretch is at least the lesser of its values for two particles that rest at its ends. A
        particle at rest that is not met within one period is never met.

        The particle at rest "begins" at -1, before the search: no stretch holds its begin, so f > 0
        is asked from time 0 on. This is tried only if s is longer than a period. The search for the
        particle at rest covers one period, so it never comes here again.
        """
        (x, y, vx, vy), zero, turn = self.line, self.clock.zero, self.clock.turn
        if turn is None or not is_below(turn, s.high - s.low):
            return False
        line = x + vx * at, y + vy * at, zero, zero
        rest = Flight(self.clock, line, self.end, number(-1, self.bits), self.wall, self.residual)
        rest._laws = self._laws
        try:
            return rest.first_root(wall, zero, turn.high) is None
        except Unproved:
            return False

    def first_root(self, wall: str, start: Interval, stop: Interval) -> Interval | None:
        """Enclose the first root of f between two points; None proves f > 0 up to `stop`.

        Parts are cleared from the left. So f > 0 at the left end of the part in hand, unless it
        holds `begin`. A part is clear if f > 0 as enclosed, or by `is_clear`. A part has exactly
        one root if f' < 0 on it and f < 0 at its right end. That root is the first, because all
        parts before it are clear. Any other part is cut in two: after all of `begin`, so that only
        the first part holds it.

        Raises:
            Unproved: a part stays open, or the line's work is used up.
        """
        parts, is_first = [join(start, stop)], True
        while parts:
            part = parts.pop()
            jet = self.f(wall, part)
            if jet.f.sign > 0:
                continue
            require(
                not is_first or self.holds_begin(wall, start) or self.f(wall, start).f.sign > 0,
                Unproved(f"{wall}: f is not shown to be positive where the search begins"),
            )
            is_first, last = False, self.f(wall, part.high).f
            if self.is_clear(wall, part, jet, last):
                continue
            at_begin, cut = self.holds_begin(wall, part), part.cut()
            falls = jet.d1.sign < 0 and last.sign < 0
            if falls and not at_begin:
                return self.closest(wall, part)
            require(
                is_below(part.low, cut) and is_below(self.begin if at_begin else part.low, cut),
                Unproved(f"{wall}: f is too small, or begins too flat, for this precision"),
            )
            parts += [join(cut, part.high), join(part.low, cut)]
        return None

    def closest(self, wall: str, root: Interval) -> Interval:
        """Narrow a root: by the sign of f at a point p, and by root = p - f(p) / f' (Newton).

        The mean value theorem gives the latter, for some f' between p and the root.
        """
        while True:
            narrow = root
            for choose in (Interval.cut, Interval.simplest):
                p = choose(narrow)
                f = self.f(wall, p).f
                step = p - f / self.f(wall, narrow).d1
                lows = [narrow.low, step.low, p if f.sign > 0 else narrow.low]
                highs = [narrow.high, step.high, p if f.sign < 0 else narrow.high]
                narrow = join(max(lows, key=lambda p: p.ends), min(highs, key=lambda p: p.ends))
            is_narrower = is_below((narrow.high - narrow.low) * 4, (root.high - root.low) * 3)
            if not is_narrower or narrow.lo == narrow.hi:
                return narrow
            root = narrow

    # 5. What is met first

    def event(self, *, in_cap: bool) -> tuple[str, Interval] | None:
        """Find the first wall met before the horizon; None for none.

        y is linear. Before y = 0 is crossed the walls of one part of the table can be met: the arc
        in the cap, both sides and the floor in the stem. Where it is crossed, f of the sides is
        w + x and w - x. From the cap the base is met if one is negative, and the mouth is open if
        both are positive. From the stem both must be positive: the sides were not met before.
        After the mouth come the walls of the other part. A particle that glides along y = 0 inside
        the mouth can meet its edge only.

        Args:
            in_cap: the flight begins above y = 0, or on it and moves up.

        Raises:
            Undefined: two walls are met together exactly, or the mouth's edge is met.
            Unproved: this precision cannot tell what is met.
        """
        table, end, state = self.scene.table, number(self.end, self.bits), self.state
        if state and state.y == state.vy == 0 and table == "mushroom" and self.wall is None:
            hit = self.first_hit(("left", "right"), self.begin.low, end, None)
            require(hit is None, Undefined("mouth-edge"))
            return None
        crossing, exact = self.crossing(in_cap=in_cap)
        hit = self.first_hit(("arc",) if in_cap else SIDES, self.begin.low, crossing or end, exact)
        if hit is not None or crossing is None:
            return hit
        signs = [self.f(wall, crossing).f.sign for wall in ("left", "right") if table != "cap"]
        if table == "cap" or (in_cap and -1 in signs):
            return "base", crossing
        if signs != [1, 1]:
            is_edge = exact is not None and (
                self.is_zero("left", exact) or self.is_zero("right", exact)
            )
            require(not is_edge, Undefined("corner" if table == "stem" else "mouth-edge"))
            raise Unproved("whether the mouth is open where y = 0 is crossed")
        if table == "stem":
            return "base", crossing
        hit = self.first_hit(SIDES if in_cap else ("arc",), crossing.low, end, None)
        require(
            hit is None or is_below(crossing, hit[1]),
            Unproved("a wall is met at the height of the mouth"),
        )
        return hit

    def crossing(self, *, in_cap: bool) -> tuple[Interval | None, Fraction | None]:
        """Enclose when y = 0 is crossed before the horizon; return it exactly, too, if known.

        (None, None) means that it is not crossed. After the base, upward in the cap and downward in
        the stem, y moves away from 0. A crossing at the horizon exactly is not before it.
        """
        (_, y, _, vy), end = self.line, number(self.end, self.bits)
        if self.wall == "base" or vy.lo == vy.hi == 0 or vy.sign == (1 if in_cap else -1):
            return None, None
        found, exact = -y / vy, -self.state.y / self.state.vy if self.state else None
        if is_below(end, found) or exact == self.end:
            return None, None
        require(is_below(found, end), Unproved("whether y = 0 is crossed before the horizon"))
        return found, exact

    def first_hit(
        self, walls: Sequence[str], start: Interval, limit: Interval, exact: Fraction | None
    ) -> tuple[str, Interval] | None:
        """Find which of some walls is met first, before y = 0 is crossed or the horizon comes.

        Each search covers one stretch. All walls are searched in it, one after the other.

        `stop` is where the search for the next wall ends. At first it is the end of the stretch.
        Once a root is found it is just past that root. A later root may lie a little beyond the one
        before, so `stop` may also grow. It never falls below the upper end of the earliest root.
        Therefore a wall without a root is clear up to that upper end, and `earliest` needs to
        compare the roots only.

        A wall of which something is open is asked again after the others. Perhaps it is open after
        their hit only, and then the search ends before that.

        The last search goes a little past the limit, so that a root at the limit lies inside the
        stretch. The limit is the horizon, which is self.end exactly, or a crossing of y = 0, which
        lies before that. A root that overlaps a crossing counts as a hit, and `earliest` decides.
        A root that overlaps the horizon counts, too, unless f = 0 at the horizon exactly. Then that
        is the one root in its enclosure, and the wall is not met before the horizon.
        """
        for since, stop in self.stretches(start, limit.high):
            hits, queue = [], list(walls)
            for wall in queue:
                try:
                    root = self.first_root(wall, since, stop)
                except Unproved as question:
                    require(queue.count(wall) < 2, question)
                    queue.append(wall)
                    continue
                if root is not None and (
                    is_below(root, limit)
                    or (limit.ends[1] != self.end and not is_below(limit, root))
                    or not (is_below(limit, root) or self.is_zero(wall, self.end))
                ):
                    hits.append((wall, root))
                    stop = self.beyond(since, root.high)
            if hits:
                return self.earliest(hits, limit, exact)
        return None

    def stretches(self, start: Interval, last: Interval) -> Iterator[tuple[Interval, Interval]]:
        """Yield stretches, one after the other, from `start` to a little past `last`.

        A particle at rest that is not met within one period is never met, so they end there.

        The first is about as long as a crossing of the table or a period, whichever is less. Each
        next one is four times as long. The lengths affect the cost only, not what is proved. They
        differ from precision to precision: a wall that is met just where a stretch ends is open.

        A particle at rest gives no length, nor does a table at rest. If both rest, one stretch
        reaches `last`, and f is constant on it.
        """
        sizes = [law.ends[1] for name, law in self.scene.laws.items() if name in ("r", "w", "h")]
        speed = max(abs(end) for v in self.line[2:] for end in v.ends)
        lengths = [sum(sizes) / speed] if speed else []
        lengths += [self.clock.turn.ends[1]] if self.clock.turn else []
        length = number(min(lengths, default=Fraction(1)) * (1 - Fraction(8, self.bits)), 32).high
        if self.clock.turn and not speed:
            last = min(last, (self.begin + self.clock.turn).high, key=lambda point: point.ends)
        stop = (start + length).high
        while lengths and is_below(stop, last):
            yield start, stop
            start, length = stop, length * 4
            stop = (start + length).high
        yield start, self.beyond(start, last)

    def beyond(self, start: Interval, stop: Interval) -> Interval:
        """Return a point a little past a stretch, another one at each precision."""
        return (stop + (stop - start) * number(BEYOND + UNIT * self.bits, self.bits)).high

    def earliest(
        self, hits: list[tuple[str, Interval]], limit: Interval, exact: Fraction | None
    ) -> tuple[str, Interval]:
        """Return the earliest of some hits, each the first of its wall.

        `first_hit` has shown that walls without a hit are clear up to the upper end of the earliest
        root. A moment that is guessed below lies within the enclosure of a root, and before all
        roots that are not met at that moment. So walls without a hit are clear up to it, too.

        Raises:
            Undefined: walls are met together at a rational time, exactly, and all others later.
            Unproved: it is open which wall is met first.
        """
        best = min(hits, key=lambda hit: hit[1].ends[1])
        if all(hit is best or is_below(best[1], hit[1]) for hit in hits) and is_below(
            best[1], limit
        ):
            return best
        # A guess: the fraction closest to a root, with a denominator of half as many digits. It
        # proves nothing. `is_zero` proves f = 0 there, and a root's enclosure holds one root only.
        for moment in (
            root.ends[0].limit_denominator(2 ** (self.bits // 2 - 8)) for _, root in hits
        ):
            met = {
                w
                for w, root in hits
                if root.ends[0] <= moment <= root.ends[1] and self.is_zero(w, moment)
            }
            is_first = (
                all(wall in met or moment < root.ends[0] for wall, root in hits)
                and 0 < moment < self.end
                and (exact is None or moment <= exact)
            )
            met |= {"base"} if moment == exact else set()
            is_edge = self.scene.table == "mushroom" and "base" in met and "arc" not in met
            require(
                not (is_first and len(met) > 1),
                Undefined("mouth-edge" if is_edge else "corner"),
            )
        raise Unproved("two walls are met together, as far as this precision shows")


def bounce(flight: Flight, hit: tuple[str, Interval]) -> tuple[dict[str, Interval], Flight]:
    """Return what is claimed of a hit (dt, place, velocity after it), and the next flight.

    n = grad f / |grad f| points inside, and u is the wall's speed along n. f' = |grad f| (v.n - u),
    so v' = v - 2 (v.n - u) n is v - 2 f' grad f / |grad f|^2.

    The hit is at a time s, enclosed; `near` is an exact time close to it. At `near` the new line is
    at x(s) - v' (s - near) = x(near) + (v - v') (s - near), a box. The next flight begins at
    s - near, about 0. If the wall met is the wall left, f - c = 0 at the hit, and c stays. On any
    other wall f = 0 at the hit.
    """
    clock, (wall, s), (x, y, vx, vy), is_base = flight.clock, hit, flight.line, hit[0] == "base"
    at_x, at_y = x + vx * s, clock.zero if is_base else y + vy * s
    one, is_tilted = number(1, clock.bits), wall in ("left", "right")
    slope = flight.law("slope", s).f if is_tilted else clock.zero
    fx, fy = {
        "arc": (at_x * -2, at_y * -2),
        "base": (clock.zero, -one if flight.scene.table == "stem" else one),
        "floor": (clock.zero, one),
        "left": (one, slope),
        "right": (-one, slope),
    }[wall]
    kick = flight.f(wall, s).d1 * 2 / (fx**2 + fy**2)
    new_vx, new_vy = vx - kick * fx, vy - kick * fy
    near, begin = s.simplest(), s - s.simplest()
    next_x = x + vx * near + (vx - new_vx) * begin
    next_y = -new_vy * begin if is_base else y + vy * near + (vy - new_vy) * begin
    later = Clock(flight.scene, clock.instant + near.ends[0], clock.bits)
    residual = flight.residual if wall == flight.wall else clock.zero
    line, end = (next_x, next_y, new_vx, new_vy), flight.end - near.ends[0]
    found = {"dt": s - flight.begin, "x": at_x, "y": at_y, "vx": new_vx, "vy": new_vy}
    return found, Flight(later, line, end, begin, wall, residual)


# 6. Where a flight starts


def start(scene: Scene, state: State, t_end: Fraction, bits: int) -> tuple[Flight, bool]:
    """Judge a start: which wall it leaves, and whether it is in the cap.

    A mushroom's state must lie inside the walls of its own part, cap or stem. On y = 0 beyond the
    mouth it is on the base, so the arc is asked. Inside the mouth |x| < w <= r, so the arc is not
    asked. On the arc the base is asked, too: at y = 0 the state is at a corner.

    Where w = r, a state at y = 0 and |x| = w is on a side, on the base and on the arc. If it names
    the arc or the base, both of these are asked, and it is at a corner. If it names a side or no
    wall, the sides are asked, and it is at the mouth's edge.

    Returns:
        The flight, and whether it begins in the cap.

    Raises:
        Refused: the state is outside the table, is off its wall, or moves into its wall.
        Undefined: the state is on two walls, or slides along a wall.
        Unproved: this precision cannot tell where the state is.
    """
    table, wall, level = scene.table, state.wall, state.y == 0
    require(state.t <= t_end, Refused("t_end is before state.t"))
    is_beyond = (wall == "arc" and state.y < 0) or (wall in SIDES and state.y > 0)
    require(table != "mushroom" or not is_beyond, Refused("the state is beyond its wall's end"))
    clock = Clock(scene, state.t, bits)
    x, y, vx, vy = (number(value, bits) for value in (state.x, state.y, state.vx, state.vy))
    flight = Flight(clock, (x, y, vx, vy), t_end - state.t, clock.zero, state=state)
    f = {name: flight.f(name, clock.zero).f for name in WALLS[table]}
    on = [wall] if wall else []
    walls = WALLS[table]
    if table == "mushroom":
        is_beside = wall is None and level and -1 in (f["left"].sign, f["right"].sign)
        on = ["base"] if is_beside else on
        walls = ("arc",) if state.y > 0 or "arc" in on or "base" in on else SIDES
        walls = ("base", "arc") if "arc" in on else walls
    others = [name for name in walls if name != wall]
    require(all(f[name].sign >= 0 for name in others), Refused("the state is beyond a wall"))
    if wall:
        require_near(flight, wall, f[wall])
    for name in others:
        is_on = flight.is_zero(name, Fraction(0))
        require(is_on or f[name].sign > 0, Unproved(f"whether the state is on wall {name}"))
        on += [name] if is_on else []
    require(
        not (table == "mushroom" and level and ("left" in on or "right" in on)),
        Undefined("mouth-edge"),
    )
    require(len(on) < 2, Undefined("corner"))
    for name in on:
        flight.is_flat, flight.wall, flight.residual = is_flat(flight, name), name, f[name]
    in_cap = state.y > 0 or "arc" in on or "base" in on or (level and state.vy > 0 and not on)
    return flight, table == "cap" or (table == "mushroom" and in_cap)


def is_flat(flight: Flight, wall: str) -> bool:
    """Tell whether f' = 0 < f'' on the wall being left; False where f' > 0.

    f'' is that just after the start. With f'' < 0 the wall pushes: "sliding". With f'' = 0 it is
    "sliding" along a base or where nothing moves, else "tangency".

    Where a law has a period, f' and f'' are polynomials in omega = 2 pi / period, of degree 2 at
    most and with rational coefficients. pi is transcendental, so they vanish only if all their
    coefficients do, and then at three rates.

    Raises:
        Refused: f' < 0, so the particle moves into the wall.
        Undefined: f' = 0 and f'' <= 0, so the particle does not leave the wall.
        Unproved: this precision cannot tell the sign of f' or f''.
    """
    slope, scene = flight.f(wall, flight.clock.zero).d1.sign, flight.scene
    require(slope >= 0, Refused(f"the particle starts on wall {wall} and moves into it"))
    if slope > 0:
        return False
    exact = [flight.exact(wall, Fraction(0), rate) for rate in (-1, 0, 1)]
    require(all(jet.d1 == 0 for jet in exact), Unproved("the sign of f' at the start"))
    bend = flight.f(wall, flight.clock.zero).d2.sign
    require(bend or all(jet.d2 == 0 for jet in exact), Unproved("the sign of f'' at the start"))
    is_resting = wall == "base" or not (scene.omega or scene.period)
    require(bend > 0, Undefined("sliding" if bend < 0 or is_resting else "tangency"))
    return True


def require_near(flight: Flight, wall: str, gap: Interval) -> None:
    """Refuse a state farther from its wall than 2^-20 of the wall's size.

    The size is r for the arc and a base, h for the floor, w for the top of a stem. For a side it is
    w, or |x| if greater. The arc's f is about 2 r times the distance, so it is divided by 2 r.

    Raises:
        Refused: the state is too far from its wall.
        Unproved: this precision cannot tell how far the state is.
    """
    is_width = wall in ("left", "right") or (wall == "base" and flight.scene.table == "stem")
    size = flight.f("w" if is_width else "h" if wall == "floor" else "r", flight.clock.zero).f
    gap = gap / (size * 2) if wall == "arc" else gap
    reach = abs(flight.line[0].ends[0]) if wall in ("left", "right") else Fraction(0)
    least, most = (NEAR * max(end, reach) for end in size.ends)
    require(
        not (gap.sign != 0 and min(map(abs, gap.ends)) > most),
        Refused(f"the state is off wall {wall}"),
    )
    require(max(map(abs, gap.ends)) <= least, Unproved(f"whether the state is on wall {wall}"))


# 7. Scenes


def read_scene(data: Any, work: list[int]) -> Scene:
    """Read a scene from its JSON form, and prove it to be valid at all times.

    Args:
        data: the JSON.
        work: one number: the units of work that are left.

    Raises:
        Refused: the scene is invalid; the message names the broken condition.
        Unproved: it is open whether a condition holds.
    """
    wanted = {
        "cap": [{"r"}],
        "stem": [{"w", "h", "slope"}],
        "mushroom": [{"r", "h", "w", "slope"}, {"r", "h", "nu", "slope"}],
    }
    table = data.get("table")
    require(isinstance(table, str) and table in wanted, Refused("the scene has no known table"))
    given, is_loose = without_loose(data, ("table", "name", "notes", *LAWS[table]))
    # Texts have no effect. One may ignore a text that is not allowed, or refuse it.
    texts = [given.pop(name, "") for name in ("name", "notes")]
    is_loose |= not all(isinstance(text, str) and not HIDDEN.search(text) for text in texts)
    read = {} if table == "cap" else {"slope": read_law(0)}
    for name in (name for name in LAWS[table] if name in given):
        law = given[name]
        if isinstance(law, dict):
            is_legs = law.get("kind") == "bang-bang"
            law, is_more = without_loose(law, LAW_FIELDS["legs" if is_legs else "wave"])
            is_loose |= is_more
        read[name] = read_law(law)
    require(set(read) in wanted[table], Refused(f"these are not the laws of a {table}"))
    rates = {rate for law, rate in read.values() if law.ends[0] < law.ends[1]}
    require(len(rates) < 2, Refused("laws that move must share one period"))
    laws, rate = {name: law for name, (law, _) in read.items()}, rates.pop() if rates else ()
    scene = Scene(table, laws, work, *rate)._replace(is_loose=is_loose)
    require_valid(scene)
    return scene


def without_loose(data: dict[str, Any], fields: Sequence[str]) -> tuple[dict[str, Any], bool]:
    """Return the known fields of a scene, a law or a state, and whether there are more.

    One may ignore, or refuse, a field that is unknown, and one that is optional and null.
    """
    kept = {
        name: value
        for name, value in data.items()
        if name in fields and (value is not None or name not in OPTIONAL)
    }
    return kept, len(kept) < len(data)


def read_law(data: Any) -> tuple[Law, tuple[Fraction | None, Fraction | None]]:
    """Read a law, and its omega or its period.

    Raises:
        Refused: the JSON is not a law.
    """
    if not isinstance(data, dict):
        data = {"kind": "fourier", "mean": data, "omega": 1}
    if data.get("kind") == "bang-bang":
        return read_legs(data.get("knots"))
    rates = [data.get(name) for name in ("omega", "period")]  # of which one is absent
    require(
        data.get("kind") == "fourier" and rates.count(None) == 1,
        Refused("a law is a number, a bang-bang law, or fourier with omega or period"),
    )
    lists = [data.get(name, []) for name in ("cos", "sin")]
    require(
        all(isinstance(waves, list) and len(waves) <= MOST_WAVES for waves in lists),
        Refused(f"cos and sin are lists of at most {MOST_WAVES} numbers"),
    )
    cos, sin = ([read_number("wave", value) for value in waves] for waves in lists)
    mean = read_number("mean", data.get("mean"))
    omega, period = (rate if rate is None else read_number("rate", rate) for rate in rates)
    require((omega or period or 0) > 0, Refused("omega and period must be positive"))
    reach = sum(map(abs, cos + sin), Fraction(0))
    waves = tuple(itertools.zip_longest(cos, sin, fillvalue=Fraction(0))) if reach else ()
    is_tight, ends = sum(map(bool, cos + sin)) < 2, (mean - reach, mean + reach)
    return Law(mean, waves, (), ends, is_tight), (omega, period)


def read_legs(knots: Any) -> tuple[Law, tuple[None, Fraction]]:
    """Read a bang-bang law: two legs, each a parabola, from each knot to the next.

    The law is at rest at the knots. Both legs have the same value and slope where they meet.

    Raises:
        Refused: the times do not rise, the law does not close, or no binary64 number is the period.
    """
    require(
        isinstance(knots, list)
        and 2 <= len(knots) <= MOST_KNOTS
        and all(isinstance(knot, list) and len(knot) == 2 for knot in knots),
        Refused(f"knots are 2 to {MOST_KNOTS} pairs of time and value"),
    )
    pairs = [(read_number("knot", t), read_number("knot", value)) for t, value in knots]
    values, legs = [value for _, value in pairs], []
    period = pairs[-1][0] - pairs[0][0]
    require(read_number("period", period) == period, Refused("the period is no binary64 number"))
    require(values[0] == values[-1], Refused("the last knot's value must be that of the first"))
    for (t, a), (u, b) in itertools.pairwise(pairs):
        require(t < u, Refused("knots must rise in time"))
        middle, bend = (t + u) / 2, 4 * (b - a) / (u - t) ** 2
        legs += [Leg(t, middle, t, a, bend), Leg(middle, u, u, b, -bend)]
    ends = min(values), max(values)
    return Law(values[0], (), tuple(legs) if ends[0] < ends[1] else (), ends), (None, period)


def read_number(name: str, value: Any) -> Fraction:
    """Return the binary64 number nearest to a number, as a fraction.

    Raises:
        Refused: the value is not a finite number.
    """
    try:
        return Fraction(float(value if type(value) in (int, float, Fraction) else inf))
    except (OverflowError, ValueError):
        raise Refused(f"{name} is no finite number") from None


def require_valid(scene: Scene) -> None:
    """Prove r, h, w > 0, w <= r and w > h slope at all times.

    A bound of a law shows it, or a search of section 4 over one period for a root of f. A root
    proves the condition broken: `first_root` accepts one only where f < 0 follows. So does a law
    that attains a bound <= 0 (`is_tight`). As r > 0, w = nu r <= r means nu <= 1. A condition that
    touches 0 may stay open.

    The search has 256 bits at every precision. More bits would rarely decide more, because the
    numbers of a scene have 53. What is proved does not depend on that, only what stays open.

    Raises:
        Refused: a condition is broken.
        Unproved: it is open whether a condition holds.
    """
    laws, clock = scene.laws, Clock(scene, Fraction(0), 256)
    zero, bounds = clock.zero, {name: law.ends[0] for name, law in laws.items() if name != "slope"}
    rest = Flight(clock, (zero, zero, zero, zero), Fraction(0), number(-1, 256))
    if scene.table == "mushroom":
        bounds["r - w"] = (
            1 - laws["nu"].ends[1] if "nu" in laws else laws["r"].ends[0] - laws["w"].ends[1]
        )
    for name in [*bounds, *(["w - h slope"] if "h" in laws else [])]:
        least, is_strict = bounds.get(name, Fraction(-1)), name != "r - w"
        if least > 0 or (least == 0 and not is_strict):
            continue
        value = rest.f(name, zero).f
        is_broken = (
            value.hi < 0
            or (value.hi == 0 and is_strict)
            or (name in laws and laws[name].is_tight)
            or (
                (clock.turn or value.sign < 1)
                and rest.first_root(name, zero, (clock.turn or zero).high) is not None
            )
        )
        require(not is_broken, Refused(f"{name} breaks its bound at some time"))


# 8. Claims


class Verdict(NamedTuple):
    """What is known about a line: "proved", "false" or "not proved", and why."""

    status: str
    reason: str = ""


class Step(NamedTuple):
    """How a flight ends.

    Attributes:
        wall: the wall met; None at the horizon.
        numbers: dt, x, y, vx, vy.
        excess: at the arc of a mushroom (x vy - y vx)^2 - w^2 |v|^2, with v before the hit.
    """

    wall: str | None
    numbers: dict[str, Interval]
    excess: Interval | None = None


def walk(scene: Scene, state: State, t_end: Fraction, bits: int) -> Iterator[Step]:
    """Follow a particle from collision to collision, up to the horizon.

    A state at the horizon has arrived, even where it has no next step.

    Raises:
        Refused: the state is bad.
        Undefined: the first step has no answer.
        Unproved: this precision cannot tell what comes next.
    """
    try:
        flight, in_cap = start(scene, state, t_end, bits)
    except Undefined:
        if state.t < t_end:
            raise
        there = {name: number(value, bits) for name, value in zip(NUMBERS, state[:5], strict=True)}
        yield Step(None, there | {"dt": number(0, bits)})
        return
    hit = flight.event(in_cap=in_cap)
    while hit:
        numbers, later = bounce(flight, hit)
        (_, _, vx, vy), excess = flight.line, None
        if hit[0] == "arc" and scene.table == "mushroom":
            width = flight.f("w", hit[1]).f
            excess = (numbers["x"] * vy - numbers["y"] * vx) ** 2 - width**2 * (vx**2 + vy**2)
        yield Step(hit[0], numbers, excess)
        flight, in_cap = later, scene.table != "stem" and hit[0] in ("arc", "base")
        hit = flight.event(in_cap=in_cap)
    end, (x, y, vx, vy) = number(flight.end, bits), flight.line
    numbers = {"dt": end - flight.begin, "x": x + vx * end, "y": y + vy * end, "vx": vx, "vy": vy}
    yield Step(None, numbers)


def mark(step: Step) -> str:
    """Return what a step means for capture: "out", an arc hit "captured" or "free", or "".

    A hit of the arc is captured when |x vy - y vx| > w |v|: the line passes the centre at a
    distance above w, so it misses the mouth. Squares are compared.
    """
    if step.excess is None:
        return "" if step.wall in ("arc", "base") else "out"
    require(step.excess.sign != 0, Unproved("whether a hit of the arc is captured"))
    return "captured" if step.excess.sign > 0 else "free"


def find_stays(marks: Sequence[str]) -> Iterator[list[int]]:
    """Yield where each stay in the cap begins and ends, as indices into a path.

    It begins with the first captured hit since the particle was last out. It ends with the first
    free hit after the last captured one, or else at the next "out". The horizon counts as "out".
    """
    since = 0
    for place in (place for place, what in enumerate(marks) if what == "out"):
        captured = [at for at in range(since, place) if marks[at] == "captured"]
        if captured:
            free = [at for at in range(captured[-1], place) if marks[at] == "free"]
            yield [captured[0], free[0] if free else place]
        since = place


def take(data: Any, name: str, kind: type) -> Any:
    """Return a field of a JSON object.

    Raises:
        Unreadable: the field is missing, or has another type.
    """
    require(
        isinstance(data, dict) and isinstance(data.get(name), kind),
        Unreadable(f"{name} must be given, as a {kind.__name__}"),
    )
    return data[name]


def require_inside(name: str, claim: Any, found: Interval) -> None:
    """Require that a claimed enclosure (low, high) holds the proved one (least, most).

    Raises:
        Unreadable: the claim is not a pair of decimals.
        Contradicted: the proved number lies outside the claimed enclosure.
        Unproved: the proved number may lie outside.
    """
    ends, (least, most) = take(claim, name, list), found.ends
    require(
        len(ends) == 2 and all(isinstance(end, str) and DECIMAL.fullmatch(end) for end in ends),
        Unreadable(f"{name} must be two decimals"),
    )
    low, high = map(Fraction, ends)
    require(low <= most and least <= high, Contradicted(f"{name} lies outside its enclosure"))
    require(
        low <= least and most <= high, Unproved(f"{name} is not shown to lie within its enclosure")
    )


# The fields of a line, of an answer and of a step, with their types in JSON. A line with any other
# field, at any depth, is not read: people may take that field for proved.
NUMBER, TEXT = (int, float), (str,)
FORMS: dict[str, dict[str, tuple[type, ...]]] = {
    "line": {
        **dict.fromkeys(("id", "group", "level", "kind", "rule", "source"), TEXT),
        **dict.fromkeys(("scene", "state"), (dict,)),
        "t_end": (),  # of any type: a horizon that is no number is bad input
        "expect": (list,),
        "collisions": (int,),
        "condition": NUMBER,
    },
    "answer": {"outcome": TEXT, "steps": (list,), "reason": TEXT, "stays": (list,)},
    "step": {
        **dict.fromkeys((*NUMBERS, "allowance"), (list,)),
        "wall": (str, type(None)),
    },
}


def require_form(what: str, data: Any) -> None:
    """Require that an object of a line has known fields only, each of its type.

    Raises:
        Unreadable: a field is unknown or has another type; the message names it.
    """
    require(isinstance(data, dict), Unreadable(f"{what} must be an object"))
    for name, value in data.items():
        require(name in FORMS[what], Unreadable(f"{what} has an unknown field {name}"))
        types = FORMS[what][name]
        is_right = type(value) in types or not types
        require(is_right, Unreadable(f"{what} has a field {name} of another type"))


def require_known(record: Any) -> None:
    """Require that a line has known fields only, at every depth.

    The scene and the state are the question. An unknown field there is bad input, and the line may
    say so.

    Raises:
        Unreadable: a field is unknown or has another type; the message names it.
    """
    require_form("line", record)
    for answer in take(record, "expect", list):
        require_form("answer", answer)
        for step in answer.get("steps", []):
            require_form("step", step)
            allowance = step.get("allowance", [0] * 5)
            require(
                len(allowance) == 5 and all(type(number) in NUMBER for number in allowance),
                Unreadable("allowance must be five numbers"),
            )


def require_narrow(record: Any, digits: int) -> None:
    """Require that each enclosure of the proved answer is at most 10^-digits of its larger end wide.

    Raises:
        Unproved: an enclosure is wider.
    """
    answer, _ = claim_of(record)
    for place, step in enumerate(answer.get("steps", []), 1):
        for name in NUMBERS:
            low, high = map(Fraction, step[name])
            require(
                (high - low) * 10**digits <= max(abs(low), abs(high)),
                Unproved(f"step {place}: the enclosure of {name} is not narrow to {digits} digits"),
            )


def check_line(record: Any, read: Callable[[], Scene], bits: int) -> None:
    """Hold a line to what is proved at one precision.

    Args:
        record: the line's JSON.
        read: returns its scene, or raises why it is refused.
        bits: the precision.

    Raises:
        Unreadable: the line has not the form of a corpus line.
        Contradicted: the claim is false.
        Unproved: the claim is open.
    """
    first, others = claim_of(record)
    state, steps = take(record, "state", dict), take({"steps": [], **first}, "steps", list)
    kind, count = take(record, "kind", str), record.get("collisions", 1)
    is_kind = kind in ("step", "trajectory", "flow") and type(count) is int and 0 < count < 10**6
    require(is_kind and (kind != "step" or count == 1), Unreadable("kind or collisions are none"))
    found, reason, listed = [], "", ["steps"]
    allowed: list[dict[str, str]] = []  # beside the right answer
    try:
        scene = read()
        given, t_end = read_state(scene, state), read_number("t_end", record.get("t_end"))
        # A flow lists some steps of its path. Any other path is followed as far as it is listed.
        limit = count if kind == "flow" else min(count, len(steps) + 1)
        found = list(itertools.islice(walk(scene, given, t_end, bits), limit))
        right = {"outcome": "collision" if found[-1].wall else "horizon"}
        if kind == "flow":
            is_whole = len(found) == count and found[-1].wall is None
            require(is_whole, Contradicted(f"the path has {len(found)} steps, or goes on"))
            found = list(thin(found, first.get("stays", [])))
            listed.append("stays")
    except Refused as failure:
        right, reason = {"outcome": "rejected"}, str(failure)
    except Undefined as failure:
        right, reason = {"outcome": "undefined", "reason": str(failure)}, str(failure)
        allowed.append({"outcome": "undecided"})
    require(
        right == {name: value for name, value in first.items() if name not in listed},
        Contradicted(f"the answer is {right['outcome']} {reason}"),
    )
    require(len(steps) == len(found), Contradicted(f"the path has {len(found)} steps"))
    for place, (claim, step) in enumerate(zip(steps, found, strict=True), 1):
        for name in NUMBERS:
            require_inside(name, claim, step.numbers[name])
        require(
            claim.get("wall") == step.wall,
            Contradicted(f"step {place} ends at {step.wall or 'the horizon'}"),
        )
    if right["outcome"] != "rejected":
        _, is_more = without_loose(state, (*FIELDS, "wall"))
        if scene.is_loose or is_more or is_extreme(scene, given, bits):
            allowed.append({"outcome": "rejected"})
    require_listed(others, allowed)


def claim_of(record: Any) -> tuple[Any, list[Any]]:
    """Choose the answer of a line that is to be proved: the first that is not "rejected", if any.

    Returns:
        The answer, and the others.
    """
    answers = take(record, "expect", list) or [None]
    outcomes = [take(answer, "outcome", str) for answer in answers]
    place = next((i for i, outcome in enumerate(outcomes) if outcome != "rejected"), 0)
    return answers[place], answers[:place] + answers[place + 1 :]


def require_listed(others: Sequence[Any], permitted: Sequence[Any]) -> None:
    """Require that a line lists each further answer that the rules permit, once, and no other.

    Raises:
        Contradicted: an answer is missing, is listed twice, or is not permitted.
    """
    require(
        all(other in permitted for other in others),
        Contradicted("no rule permits a further answer"),
    )
    for answer in permitted:
        why = f"{answer['outcome']} is permitted, too, and must be listed once"
        require(others.count(answer) == 1, Contradicted(why))


def is_extreme(scene: Scene, state: State, bits: int) -> bool:
    """Tell whether one may refuse a state because its time is so late, or a number so large.

    Lateness is |t| in periods, or in units of time where nothing moves. |t| >= LATE 2 pi / omega
    is asked as |t| omega / (2 LATE) >= pi, with pi enclosed.

    Raises:
        Unproved: this precision cannot tell.
    """
    if max(map(abs, state[:5])) >= LARGE:
        return True
    if not scene.omega:
        return abs(state.t) >= LATE * (scene.period or 1)
    excess = number(abs(state.t) * scene.omega / (2 * LATE), bits) - pi(bits)
    require(excess.sign != 0, Unproved("whether the start is so late that one may refuse it"))
    return excess.sign > 0


def read_state(scene: Scene, data: Mapping[str, Any]) -> State:
    """Read a state; fields that are unknown are ignored.

    Raises:
        Refused: a field is missing or not a number, or the table has no such wall.
    """
    wall = data.get("wall")
    is_wall = wall is None or wall in WALLS[scene.table]
    require(
        is_wall and set(FIELDS) <= set(data),
        Refused("a state has t, x, y, vx, vy and null or a wall of the table"),
    )
    return State(**{name: read_number(name, data[name]) for name in FIELDS}, wall=wall)


def thin(path: Sequence[Step], claimed: Any) -> Iterator[Step]:
    """Yield the steps of a flow that its line lists: begin and end of each stay, and the horizon.

    dt counts from the step listed before.

    Raises:
        Contradicted: the path has other capture intervals.
    """
    stays = list(find_stays([mark(step) for step in path]))
    kept = sorted({place for stay in stays for place in stay} | {len(path) - 1})
    listed = {place: at for at, place in enumerate(kept)}
    # 1.0 and true equal 1, but they are no indices. Their texts differ.
    places = [[listed[place] for place in stay] for stay in stays]
    require(
        claimed == places and str(claimed) == str(places),
        Contradicted("the particle is captured at other times"),
    )
    for before, place in zip([-1, *kept], kept, strict=False):
        dt = reduce(Interval.__add__, (step.numbers["dt"] for step in path[before + 1 : place + 1]))
        yield path[place]._replace(numbers={**path[place].numbers, "dt": dt})


def verify_line(record: Any, digits: int | None = None) -> Verdict:
    """Prove a line of a corpus.

    Args:
        record: the line's JSON.
        digits: if given, an enclosure wider than 10^-digits of its larger end is "not proved".

    Returns:
        The verdict: "proved", "false" or "not proved", and which step of the argument fails.

    Raises:
        Unreadable: the line has not the form of a corpus line.
    """
    require_known(record)
    read = lru_cache(partial(read_scene, take(record, "scene", dict), [WORK]))
    verdict = Verdict("not proved")
    for bits in PRECISIONS:
        try:
            check_line(record, read, bits)
            break
        except Contradicted as reason:
            # It is proved, whatever the precision.
            return Verdict("false", str(reason))
        except Unproved as reason:
            verdict = Verdict("not proved", str(reason))
    else:
        return verdict
    try:
        if digits is not None:
            require_narrow(record, digits)
    except Unproved as reason:
        return Verdict("not proved", str(reason))
    return Verdict("proved")


# The proof ends here. What follows reads files and prints verdicts (9), and estimates errors (10).

# 9. Files


def printable(text: str) -> str:
    """Return a text as one line of characters that can be printed; the others are escaped."""
    return "".join(
        c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text
    )


def name_of(record: Any) -> str:
    """Return the id of a line as it is printed: between quotes, unless it looks like an id.

    Raises:
        Unreadable: the line has no id.
    """
    name = take(record, "id", str)
    return name if re.fullmatch(r"[\w./-]+", name, re.ASCII) else f'"{printable(name)}"'


def read_object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return a JSON object; of a key that comes twice one value would be lost.

    Raises:
        Unreadable: a key comes twice.
    """
    require(len(dict(pairs)) == len(pairs), Unreadable("a key comes twice"))
    return dict(pairs)


def read_json(text: bytes) -> Any:
    """Return what a JSON text says.

    Raises:
        Unreadable: the text is not JSON, or a key comes twice.
    """
    try:
        return json.loads(text.decode("utf-8"), object_pairs_hook=read_object)
    except RecursionError:
        raise Unreadable("nested too deeply") from None
    except json.JSONDecodeError as error:
        is_long = error.doc.count("\n", 0, error.pos) > 0
        line = f"line {error.lineno}, " if is_long else ""
        raise Unreadable(f"{error.msg}, {line}column {error.colno}") from None
    except UnicodeDecodeError as error:
        raise Unreadable(f"byte {error.start + 1} is no UTF-8") from None
    except ValueError as error:  # an integer of thousands of digits
        raise Unreadable(str(error)) from None


def read_lines(path: str) -> Iterator[tuple[str, bytes]]:
    """Yield the lines of a file that are not blank, each with its place; "-" is standard input.

    Raises:
        Unreadable: the file cannot be read, or has no such line.
    """
    is_empty = True
    try:
        with open(0 if path == "-" else path, "rb", closefd=path != "-") as lines:
            for number_of_line, line in enumerate(lines, 1):
                if line.strip():
                    is_empty = False
                    yield f"{printable(path)}:{number_of_line}", line
    except OSError as error:
        raise Unreadable(f"{printable(path)}: {error.strerror}") from None
    require(not is_empty, Unreadable(f"{printable(path)}: there is nothing to verify in this file"))


def verify_file(path: str, digits: int | None = None) -> Iterator[tuple[str, Verdict]]:
    """Verify each line of a corpus file.

    Raises:
        Unreadable: a line has not the form of a corpus line; the message has its number.
    """
    for where, line in read_lines(path):
        try:
            record = read_json(line)
            name, verdict = name_of(record), verify_line(record, digits)
        except Unreadable as error:
            raise Unreadable(f"{where}: {error}") from None
        yield f"{where}: {name}", verdict


class Options(argparse.ArgumentParser):
    """The options of the command line. A fault in them is one line, as in a file."""

    def error(self, message: str) -> NoReturn:
        """Raise what is wrong.

        Raises:
            Unreadable: always.
        """
        raise Unreadable(f"{message} (--help lists the options)")


def between(low: float, high: float, kind: type) -> Callable[[str], Any]:
    """Return a function that reads a number of the command line within two bounds."""

    def read(text: str) -> Any:
        try:
            value = kind(text)
        except ValueError:
            value = None
        if value is None or not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{text!r} must be from {low:g} to {high:g}")
        return value

    return read


def read_options(arguments: Sequence[str]) -> argparse.Namespace:
    """Read the command line.

    Raises:
        Unreadable: an option is wrong.
        SystemExit: it asks for help.
    """
    parser = Options(
        prog="verify.py",
        allow_abbrev=False,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        description=(__doc__ or "").partition("\nA particle")[0],
        epilog="Exit code: 0 all is proved (or agrees), 1 something is not, 2 bad input, 130 interrupted.",
    )
    add = parser.add_argument
    add("files", nargs="+", metavar="FILE", help="JSON lines; - is standard input")
    add(
        "--digits", metavar="N", type=between(1, 1000, int),
        help="demand enclosures at most 10^-N wide, relative to the larger end",
    )  # fmt: skip
    add("--answers", action="store_true", help="judge paths in floating point: JSON, JSONL or CSV")
    add("--scene", metavar="FILE", help="the scene of a CSV file, as JSON")
    add(
        "--t-end", metavar="T", type=between(-LARGEST, LARGEST, float),
        help="the horizon, where the file gives none",
    )  # fmt: skip
    add(
        "--within", metavar="ULPS", type=between(0, LARGEST, float),
        help=f"largest backward error that agrees, in units of 2^-53 (default: {WITHIN:.3g})",
    )  # fmt: skip
    add("--all", action="store_true", help="judge what follows a false step, too")
    options = parser.parse_args(arguments)
    given = {"--scene": options.scene, "--t-end": options.t_end, "--within": options.within}
    given["--all"] = options.all or None
    foreign = [name for name, value in given.items() if value is not None]
    require(options.answers or not foreign, Unreadable(f"{foreign[:1]} goes with --answers"))
    require(not (options.answers and options.digits), Unreadable("--digits is for proofs only"))
    if options.within is None:
        options.within = WITHIN
    return options


def run(options: argparse.Namespace, counts: dict[str, int]) -> int:
    """Judge files, print what is not proved, and return the exit code.

    Raises:
        Unreadable: a file cannot be judged.
    """
    if options.answers:
        # All files are judged, also after one in which something is false.
        return max([judge_file(path, options, counts) for path in options.files])
    for path in options.files:
        for where, verdict in verify_file(path, options.digits):
            counts["claims"] += 1
            counts["proved"] += verdict.status == "proved"
            if verdict.status != "proved":
                print(printable(f"{where}: {verdict.status}: {verdict.reason}"))
    print(f"{counts['proved']} of {counts['claims']} proved")
    return int(counts["proved"] < counts["claims"])


def main(arguments: Sequence[str]) -> int:
    """Run the command line.

    Returns:
        0 when all is proved, or agrees; 1 when not; 2 when something is unreadable; 130 after an
        interrupt, and 141 when nobody reads on, as shells count it.
    """
    counts = {"claims": 0, "proved": 0}
    try:
        if isinstance(sys.stdout, io.TextIOWrapper):
            sys.stdout.reconfigure(errors="backslashreplace")
        code = run(read_options(arguments), counts)
        sys.stdout.flush()
        return code
    except SystemExit:  # after --help
        return 0
    except Unreadable as error:
        n = counts["claims"]
        code, words = 2, f"unreadable after {n} claims: {error}" if n else str(error)
    except KeyboardInterrupt:
        code, words = 130, f"interrupted after {counts['claims']} claims"
    except OSError as error:
        # What is still in the buffer would raise the same again when Python ends.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if isinstance(error, BrokenPipeError):
            return 141
        code, words = 2, f"cannot write the result: {error.strerror}"
    print(printable(f"verify.py: {words}"), file=sys.stderr)
    return code


# 10. Answers in floating point (--answers): estimates, which prove nothing


class Answers(NamedTuple):
    """A path that was computed in floating point.

    Attributes:
        scene: its scene.
        wire_scene: the same as JSON.
        t_end: its horizon.
        state: where it begins, as JSON.
        steps: where it is said to lead, each with its place in the file. They are read one by one.
    """

    scene: Scene
    wire_scene: dict[str, Any]
    t_end: Fraction
    state: dict[str, Any]
    steps: Iterator[tuple[str, Any]]


class Truth(NamedTuple):
    """A step as it really is, from a state in floating point; and the state after it.

    Attributes:
        flight: the flight from the state.
        hit: the wall met and when; None at the horizon.
        numbers: dt, x, y, vx, vy at its end.
    """

    flight: Flight
    hit: tuple[str, Interval] | None
    numbers: list[Fraction]


def find_truth(scene: Scene, state: State, t_end: Fraction) -> Truth:
    """Return the step that follows a state.

    Raises:
        Refused: the state is bad.
        Undefined: the motion has no next step.
        Unproved: 256 bits cannot tell what comes next.
    """
    question = Unproved("nothing was tried")
    for bits in PRECISIONS[:2]:
        try:
            flight, in_cap = start(scene._replace(work=[WORK]), state, t_end, bits)
            hit = flight.event(in_cap=in_cap)
        except Unproved as failure:
            question = failure
        else:
            return Truth(flight, hit, arrive(flight, hit))
    raise question


def arrive(flight: Flight, hit: tuple[str, Interval] | None) -> list[Fraction]:
    """Return dt, x, y, vx, vy at the end of a flight: the lower ends of narrow enclosures."""
    if hit is not None:
        numbers, _ = bounce(flight, hit)
        return [numbers[name].ends[0] for name in NUMBERS]
    (x, y, vx, vy), end = flight.line, number(flight.end, flight.bits)
    return [part.ends[0] for part in (end, x + vx * end, y + vy * end, vx, vy)]


def move_input(truth: Truth, name: str) -> list[Fraction]:
    """Return what the end of a step becomes when one number of its start grows by 2^-53 of itself.

    The same wall is met. One step of Newton's method finds when: what it leaves is of second order.
    """
    flight, hit = truth.flight, truth.hit
    assert flight.state is not None
    value = getattr(flight.state, name)
    state = flight.state._replace(**{name: value * (1 + UNIT)})
    scene, bits, zero = flight.scene, flight.bits, flight.clock.zero
    end = max(flight.end - (state.t - flight.state.t), Fraction(0))
    clock = Clock(scene, state.t, bits) if name == "t" else flight.clock
    x, y, vx, vy = (number(value, bits) for value in state[1:5])
    moved = Flight(clock, (x, y, vx, vy), end, zero, flight.wall, state=state)
    if name != "t":
        moved._laws = flight._laws
    if moved.wall is not None:
        moved.residual = moved.f(moved.wall, zero).f
    if hit is None:
        return arrive(moved, None)
    wall, root = hit
    near = root.simplest()
    jet = moved.f(wall, near)
    return arrive(moved, (wall, (near - jet.f / jet.d1).low))


def measure_sizes(truth: Truth, state: State) -> dict[str, Fraction]:
    """Return the unit in which the error of each number is counted: one backward ulp.

    It is 2^-53 of the number, plus the sum of its changes when one number of the start at a time
    grows by 2^-53 of itself. x and y share the larger of theirs, or 2^-53 of the way flown if that
    is larger; vx and vy share theirs.
    """
    sizes = [UNIT * abs(value) for value in truth.numbers]
    for name in FIELDS:
        if getattr(state, name):
            moved = move_input(truth, name)
            changes = (abs(a - b) for a, b in zip(moved, truth.numbers, strict=True))
            sizes = [size + change for size, change in zip(sizes, changes, strict=True)]
    dt = truth.numbers[0]
    way = UNIT * max(abs(state.vx), abs(state.vy)) * dt
    place, speed = max(*sizes[1:3], way), max(sizes[3:])
    t = sizes[0] + UNIT * (abs(state.t) + abs(state.t + dt))
    return {"t": t, "dt": sizes[0], "x": place, "y": place, "vx": speed, "vy": speed}


def read_answer(answer: Any) -> dict[str, Fraction]:
    """Return the numbers of a step: t, x, y, vx, vy, and dt where it is given.

    Raises:
        Contradicted: a field is missing, unknown, or no finite number; or the outcome is another.
    """
    require(isinstance(answer, dict), Contradicted("the step is no object"))
    for name in answer:
        is_known = name in (*FIELDS, "dt", "wall", "outcome")
        require(is_known, Contradicted(f"{name} is an unknown field"))
    is_end = answer.get("outcome") == "horizon"
    for name in (*FIELDS, *([] if is_end else ["wall"])):
        require(name in answer, Contradicted(f"{name} is missing"))
    outcome = "horizon" if answer.get("wall") is None else "collision"
    is_right = answer.get("outcome", outcome) == outcome
    require(is_right, Contradicted("outcome and wall contradict each other"))
    numbers = {}
    for name in (*FIELDS, "dt"):
        if name in answer:
            try:
                numbers[name] = read_number(name, answer[name])
            except Refused:
                value = repr(answer[name])[:40]
                raise Contradicted(f"{name} = {value} is no finite number") from None
    return numbers


def measure_errors(scene: Scene, state: State, t_end: Fraction, answer: Any) -> dict[str, float]:
    """Estimate the error of each number of a step, with its sign, in backward ulps.

    dt is judged beside t: late in a path a large error of dt is a small one of t. An answer without
    dt gives it as the difference of two times. The last is rounded, so that TICKS units of it are
    no error of dt. A clock that does not go on is false however late it is.

    Raises:
        Contradicted: a field is wrong, another wall is met first, or the clock stands still.
        Refused, Undefined, Unproved: the step is open.
    """
    given = read_answer(answer)
    truth = find_truth(scene, state, t_end)
    dt, x, y, vx, vy = truth.numbers
    wall, right = answer.get("wall"), truth.hit[0] if truth.hit else None
    if wall != right:
        require_not_close(scene, state, t_end, wall)
        raise Contradicted(f"{right or 'the horizon'} is met first, not {wall or 'the horizon'}")
    t = state.t + dt
    unit = 2 * UNIT * abs(t)
    stands = given["t"] <= state.t and dt > unit
    require(not stands, Contradicted("t does not grow, and the flight takes time"))
    sizes = measure_sizes(truth, state)
    right_numbers = {"t": t, "dt": dt, "x": x, "y": y, "vx": vx, "vy": vy}
    wrong = {name: given[name] - right_numbers[name] for name in given}
    if "dt" not in given:
        late = wrong["t"]
        wrong["dt"] = max(abs(late) - TICKS * unit, Fraction(0)) * (1 if late > 0 else -1)
    return {name: ratio(wrong[name], size) for name, size in sizes.items()}


def ratio(error: Fraction, size: Fraction) -> float:
    """Return an error in units, at most LARGE in size. If the unit is 0, any error is LARGE."""
    if size == 0:
        return float(LARGE) * ((error > 0) - (error < 0))
    return float(max(-LARGE, min(error / size, LARGE)))


def require_not_close(scene: Scene, state: State, t_end: Fraction, wall: Any) -> None:
    """Require that a wall is not met first when one number of the start moves by its last place.

    Raises:
        Unproved: the wall is met first then, so in floating point both walls are right.
    """
    for name, sign in itertools.product(FIELDS, (1, -1)):
        moved = state._replace(**{name: getattr(state, name) * (1 + sign * 2 * UNIT)})
        try:
            hit = find_truth(scene, moved, max(t_end, moved.t)).hit
        except (Refused, Undefined, Unproved):
            continue
        is_close = (hit[0] if hit else None) == wall
        require(not is_close, Unproved(f"which wall is first hangs on the last place of {name}"))


class Tally:
    """The errors of one number over a path: the worst, the mean, and the mean with signs.

    A bias is an error that has the same direction at each step. It adds up over a path, while
    errors of both signs cancel. There are two means. In `signed` errors count as they are: a
    constant that is added shows there. In `outward` an error is positive if the number is too large
    in size: a factor of all velocities shows there.
    """

    def __init__(self) -> None:
        """Begin with no step."""
        self.n, self.total, self.worst, self.place = 0, 0.0, 0.0, "-"
        self.sums = {"signed": (0.0, 0.0), "outward": (0.0, 0.0)}

    def add(self, place: str, error: float, given: float) -> None:
        """Count the error of a step, whose answer is given."""
        self.n += 1
        self.total += abs(error)
        if abs(error) > self.worst:
            self.worst, self.place = abs(error), place
        for kind, value in (("signed", error), ("outward", error if given >= 0 else -error)):
            total, squares = self.sums[kind]
            self.sums[kind] = total + value, squares + value * value

    def mean(self, kind: str) -> float:
        """Return the mean error with its sign."""
        return self.sums[kind][0] / max(self.n, 1)

    def is_biased(self, kind: str) -> bool:
        """Tell whether a mean is over one ulp and over five standard errors, from 8 steps on."""
        mean, squares = self.mean(kind), self.sums[kind][1]
        spread = max(squares / max(self.n, 1) - mean * mean, 0.0) / max(self.n - 1, 1)
        return self.n >= 8 and abs(mean) > 1 and mean * mean > 25 * spread


class Report:
    """What is known of a path after some of its steps.

    Attributes:
        counts: how many steps agree, are false, or are open.
        tallies: the errors of each number, over the steps that are not open.
        first_false: the place of the first false step, from 0; None if there is none.
    """

    def __init__(self, within: float) -> None:
        """Begin with no step; an error up to `within` backward ulps agrees."""
        self.within, self.counts = within, {"agrees": 0, "false": 0, "open": 0}
        self.tallies = {name: Tally() for name in ("t", "dt", "x", "y", "vx", "vy")}
        self.first_false: int | None = None

    @property
    def n_steps(self) -> int:
        """Return how many steps were judged."""
        return sum(self.counts.values())

    def judge(self, answers: Answers, before: Any, place: str, answer: Any) -> Verdict:
        """Judge one step from the answer before it, and count it."""
        verdict = self._judge(answers, before, place, answer)
        if verdict.status == "false" and self.first_false is None:
            self.first_false = self.n_steps
        self.counts[verdict.status] += 1
        return verdict

    def _judge(self, answers: Answers, before: Any, place: str, answer: Any) -> Verdict:
        is_state = isinstance(before, dict) and {*FIELDS} <= set(before)
        try:
            require(is_state, Unproved("the step before cannot be read"))
            fields = {name: before.get(name) for name in (*FIELDS, "wall")}
            state = read_state(answers.scene, fields)
            errors = measure_errors(answers.scene, state, answers.t_end, answer)
        except Contradicted as reason:
            return Verdict("false", str(reason))
        except Undefined as reason:
            return Verdict("open", f"the motion has no next step ({reason})")
        except (Refused, Unproved) as reason:
            return Verdict("open", str(reason))
        for name, error in errors.items():
            self.tallies[name].add(place, error, float(answer.get(name, 1.0)))
        worst = max(errors, key=lambda name: abs(errors[name]))
        wall = answer.get("wall") or "the horizon"
        words = f"{wall}, {worst} within {abs(errors[worst]):.2g} backward ulps"
        return Verdict("agrees" if abs(errors[worst]) <= self.within else "false", words)

    def lines(self) -> Iterator[str]:
        """Yield the summary: a table of errors, each bias, and how many steps agree."""
        yield "in backward ulps  worst     mean      mean signed  mean outward  worst at"
        for name, tally in self.tallies.items():
            numbers = f"{tally.worst:<10.3g}{tally.total / max(tally.n, 1):<10.3g}"
            means = f"{tally.mean('signed'):<13.3g}{tally.mean('outward'):<14.3g}"
            yield f"{name:<18}{numbers}{means}{tally.place}"
        for name, tally in self.tallies.items():
            for kind in ("signed", "outward"):
                if tally.is_biased(kind):
                    size = f"{tally.mean(kind):+.3g} backward ulps a step ({kind} mean)"
                    yield f"bias: {name} is wrong by {size} over {tally.n} steps"
        within = f"agree within {self.within:.3g} backward ulps"
        others = "".join(f", {self.counts[name]} {name}" for name in ("false", "open"))
        yield f"{self.counts['agrees']} of {self.n_steps} {within}{others}"


def judge_path(
    answers: Answers, report: Report, *, is_all: bool = False
) -> Iterator[tuple[str, Verdict]]:
    """Judge each step from the answer before it, up to the first false one or, if asked, all."""
    before: Any = answers.state
    for place, answer in answers.steps:
        verdict = report.judge(answers, before, place, answer)
        yield place, verdict
        if verdict.status == "false" and not is_all:
            return
        before = answer


def judge_file(path: str, options: argparse.Namespace, counts: dict[str, int]) -> int:
    """Judge a path, print what does not agree and a summary, and return the exit code.

    Raises:
        Unreadable: the file does not hold a path.
    """
    answers = read_answers(path, options.scene, options.t_end)
    report, begin = Report(options.within), time.monotonic()
    told = begin
    for place, verdict in judge_path(answers, report, is_all=options.all):
        counts["claims"] += 1
        if verdict.status != "agrees":
            print(printable(f"{path}: {place}: {verdict.status}: {verdict.reason}"))
        if time.monotonic() > told + PULSE:
            told = time.monotonic()
            words = f"{report.n_steps} steps judged in {told - begin:.0f} s"
            print(printable(f"{path}: {words}"), file=sys.stderr, flush=True)
    require(report.n_steps, Unreadable(f"{printable(path)}: there is no step to judge"))
    for line in report.lines():
        print(printable(line))
    if report.counts["false"] and not options.all:
        print("stopped at the first false step; --all judges the others, too")
    return int(report.counts["agrees"] < report.n_steps)


def read_answers(path: str, scene_path: str | None = None, t_end: float | None = None) -> Answers:
    """Read a path in floating point.

    JSON: an object with `scene`, `state`, `steps`, and maybe `t_end`. JSON lines: the first has all
    but `steps`, each further one is a step. CSV: each row is a state, the first row is the start,
    and the scene is another file.

    Raises:
        Unreadable: the file has another form, or its scene or its start is refused.
    """
    lines = read_lines(path)
    is_table = path.endswith(".csv")
    require(is_table == (scene_path is not None), Unreadable("--scene goes with each CSV file"))
    if is_table:
        scene = read_whole(read_lines(str(scene_path)))
        rows = read_rows(lines)
        _, first = next(rows, ("", {}))
        return build_answers({"scene": scene, "state": first}, t_end, rows)
    where, text = next(lines)
    try:
        head = read_json(text)
    except Unreadable:
        head = {"steps": []}  # the first line is not all of it
    if not isinstance(head, dict) or "steps" in head:
        head = read_whole(itertools.chain([(where, text)], lines))
        places = enumerate(take(head, "steps", list), 1)
        return build_answers(head, t_end, ((f"step {k}", step) for k, step in places))
    return build_answers(head, t_end, read_steps(lines))


def read_whole(lines: Iterable[tuple[str, bytes]]) -> Any:
    """Return what a file says that is one JSON text."""
    parts = [text for _, text in lines]
    return read_json(b"".join(parts))


def read_steps(lines: Iterable[tuple[str, bytes]]) -> Iterator[tuple[str, Any]]:
    """Yield a step for each line of JSON, with its place."""
    for k, (where, text) in enumerate(lines, 1):
        try:
            yield f"step {k}", read_json(text)
        except Unreadable as error:
            raise Unreadable(f"{where}: {error}") from None


def read_rows(lines: Iterable[tuple[str, bytes]]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the rows of a CSV file, the start as step 0. An empty wall is the horizon.

    Raises:
        Unreadable: a row has too few or too many cells, or the first row does not name the columns.
    """
    names: list[str] = []
    for where, line in lines:
        try:
            text = line.decode("utf-8-sig")
        except UnicodeDecodeError:
            raise Unreadable(f"{where}: this is no UTF-8") from None
        if text.startswith("#"):
            continue
        cells = [cell.strip() for cell in next(csv.reader([text]))]
        if not names:
            names, place = cells, 0
            missing = [name for name in (*FIELDS, "wall") if name not in names]
            unknown = [name for name in names if name not in (*FIELDS, "wall", "dt")]
            require(not missing, Unreadable(f"{where}: column {missing[:1]} is missing"))
            require(not unknown, Unreadable(f"{where}: column {unknown[:1]} is unknown"))
            continue
        is_row = len(cells) == len(names)
        require(is_row, Unreadable(f"{where}: {len(cells)} cells, must be {len(names)}"))
        row = {name: read_cell(name, cell) for name, cell in zip(names, cells, strict=True)}
        yield f"step {place}", row
        place += 1


def read_cell(name: str, cell: str) -> Any:
    """Return a number or a wall. A text that is no number stays a text, and is judged as one."""
    if name == "wall":
        return cell or None
    try:
        return float.fromhex(cell) if "x" in cell.lower() else float(cell)
    except (ValueError, OverflowError):
        return cell


def build_answers(
    head: dict[str, Any], t_end: float | None, steps: Iterator[tuple[str, Any]]
) -> Answers:
    """Return a path whose scene is proved to be valid, and whose start has all fields.

    Raises:
        Unreadable: a field is missing or unknown, or the scene or the start is refused.
    """
    unknown = [name for name in head if name not in ("scene", "state", "t_end", "steps")]
    require(not unknown, Unreadable(f"{unknown[:1]} is an unknown field of a path"))
    try:
        scene = read_scene(take(head, "scene", dict), [WORK])
        end = read_number("t_end", head.get("t_end", FAR if t_end is None else t_end))
        state = take(head, "state", dict)
        read_state(scene, {name: state[name] for name in state if name != "dt"})
    except (Refused, Unproved) as failure:
        raise Unreadable(str(failure)) from None
    return Answers(scene, head["scene"], end, state, steps)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
