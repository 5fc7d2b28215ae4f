"""Questions that exact arithmetic answers: ties, corners, starts along a wall, paths along y = 0.

Intervals never prove an equality, so `undefined` outcomes rest on this module. Wall functions of a
binary64 state are rational where laws are constant or bang-bang. A Fourier law adds cosines, which
are kept as they are: cos x at a rational angle x if `omega` is given; at a rational part x of a
turn if `period` is given, where each derivative brings a factor of pi. A sum is proved to be 0 by
these facts:

    cos x and sin x at different rational angles x > 0, and 1, are linearly independent over the
    rationals (Lindemann and Weierstrass), so each factor is 0;
    pi is transcendental, so the factor of each power of pi is 0;
    a sum of n-th roots of unity is 0 if the polynomial of their exponents is 0 at a primitive root.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce
from math import lcm
from typing import NamedTuple

from reference.jets import Jet, multiply
from reference.prepared import PreparedTable
from reference.walls import wall_function
from scene import Law, State, Wall

MAX_ORDER = 4096  # of the roots of unity whose sum may be found to be 0


class Wave(NamedTuple):
    """pi^power cos(x + quarters pi / 2), or pi^power cos(2 pi x) where x is a part of a turn."""

    power: int = 0
    x: Fraction = Fraction(0)
    quarters: int = 0
    is_part: bool = True


@dataclass(frozen=True)
class ExactNumber:
    """A sum of different waves, each with a rational factor that is not 0."""

    terms: dict[Wave, Fraction]

    def __add__(self, other: ExactNumber) -> ExactNumber:
        """Return the sum."""
        return _collected([*self.terms.items(), *other.terms.items()])

    def __mul__(self, other: ExactNumber) -> ExactNumber:
        """Return the product, by cos a cos b = (cos(a + b) + cos(a - b)) / 2."""
        return _collected(
            (
                Wave(
                    p.power + q.power,
                    p.x + k * q.x,
                    p.quarters + k * q.quarters,
                    p.is_part and q.is_part,
                ),
                a * b / 2,
            )
            for p, a in self.terms.items()
            for q, b in other.terms.items()
            for k in (1, -1)
        )

    def __neg__(self) -> ExactNumber:
        """Return the number times -1."""
        return ExactNumber({wave: -factor for wave, factor in self.terms.items()})

    def fraction(self) -> Fraction | None:
        """Return the number as a Fraction where it has no wave; else None."""
        return self.terms.get(Wave(), Fraction(0)) if self.terms.keys() <= {Wave()} else None

    def is_zero(self) -> bool:
        """Tell whether the number is known to be 0."""
        by_power: dict[int, dict[Fraction, Fraction]] = {}
        for wave, factor in self.terms.items():
            by_power.setdefault(wave.power, {})[wave.x] = factor
        is_part = all(wave.is_part for wave in self.terms)
        return is_part and all(map(_is_zero_sum, by_power.values()))


def exact(value: float | Fraction) -> ExactNumber:
    """Return a rational number."""
    return _collected([(Wave(), Fraction(value))])


def _collected(terms: Iterable[tuple[Wave, Fraction]]) -> ExactNumber:
    """Add the factors of equal waves; cosines are even, and change their sign over half a turn."""
    found: dict[Wave, Fraction] = {}
    for (power, x, quarters, is_part), given in terms:
        factor = given
        if is_part:
            x = (x + Fraction(quarters, 4)) % 1
            x = min(x, 1 - x)
            factor *= -1 if x > Fraction(1, 4) else (x != Fraction(1, 4))
            wave = Wave(power, min(x, Fraction(1, 2) - x))
        else:
            quarters = (quarters if x > 0 else -quarters) % 4
            factor *= (1 - quarters // 2 * 2) * (x != 0 or quarters % 2 == 0)
            wave = Wave(power, abs(x), quarters % 2, False) if x else Wave(power)
        found[wave] = found.get(wave, Fraction(0)) + factor
    return ExactNumber({wave: factor for wave, factor in found.items() if factor})


def _is_zero_sum(factors: dict[Fraction, Fraction]) -> bool:
    """Tell whether a sum of cosines at parts of a turn is known to be 0.

    Its polynomial in an n-th root of unity z is multiplied by 1 - z^(n/q) for each prime q that
    divides n. These factors are 0 exactly at the roots that are not primitive. So the sum is 0 if
    and only if the product is 0 modulo z^n - 1.
    """
    n = lcm(*(x.denominator for x in factors))
    if n > MAX_ORDER:
        return False
    sums = [Fraction(0)] * n
    for x, factor in factors.items():
        for k in (int(x * n), int(-x * n) % n):
            sums[k] += factor
    for q in (q for q in range(2, n + 1) if n % q == 0 and all(q % d for d in range(2, q))):
        sums = [sums[k] - sums[k - n // q] for k in range(n)]
    return not any(sums)


def law_jet(law: Law, time: Fraction) -> Jet:
    """Return a law and its derivatives just after `time`."""
    piece = law.piece_at(time)
    if piece.is_polynomial:
        f, d1, half_d2, *_ = [*piece.polynomial(time), *[Fraction(0)] * 3]
        return _rational_jet(f, d1, 2 * half_d2)
    omega, length = piece.cycle
    is_part = length is not None
    if length is not None:
        angle = time / length
        frequency = _collected([(Wave(power=1), 2 / length)])
    else:
        assert omega is not None
        angle = Fraction(omega) * time
        frequency = exact(omega)
    totals = [exact(piece.mean), exact(0), exact(0)]
    for k, a, b in piece.harmonics:
        factor = exact(1)
        for order in range(3):
            # A derivative turns each cosine by a quarter; sin x is cos(x - quarter).
            waves = (
                (Wave(0, k * angle, order - turn, is_part), Fraction(c))
                for turn, c in ((0, a), (1, b))
            )
            totals[order] += factor * _collected(waves)
            factor *= frequency * exact(k)
    return Jet(*totals)


def _rational_jet(f: Fraction, d1: Fraction = Fraction(0), d2: Fraction = Fraction(0)) -> Jet:
    return Jet(exact(f), exact(d1), exact(d2))


def wall_jet(table: PreparedTable, state: State, wall: Wall, s: Fraction) -> Jet:
    """Return f, f', f'' of a wall at flight time s, exactly."""
    time = Fraction(state.t) + s
    vx = Fraction(state.vx)
    vy = Fraction(state.vy)
    x = _rational_jet(Fraction(state.x) + vx * s, vx)
    y = _rational_jet(Fraction(state.y) + vy * s, vy)

    def law(name: str) -> Jet:
        if name != "w":
            return law_jet(table.laws[name], time)
        return reduce(multiply, (law_jet(table.laws[factor], time) for factor in table.width))

    return wall_function(table, wall, x, y, law, lambda p: multiply(p, p))


def crossing_time(state: State) -> Fraction | None:
    """Return the exact flight time at which y = 0, when it lies ahead."""
    if state.vy == 0 or (state.y > 0) == (state.vy > 0) or state.y == 0:
        return None
    return -Fraction(state.y) / Fraction(state.vy)


def straight_time(table: PreparedTable, state: State, wall: Wall) -> Fraction | None:
    """Return the exact flight time to a straight wall of the stem at rest, when it lies ahead.

    A wall that is being left and stands still is not met: None.
    """
    if table.is_cap or wall == state.wall:
        return None
    moving = ("h",) if wall == "floor" else (*table.width, "slope")
    if not all(table.laws[name].is_constant for name in moving):
        return None
    jet = wall_jet(table, state, wall, Fraction(0))
    f = jet.f.fraction()
    rate = jet.d1.fraction()
    return -f / rate if f is not None and rate is not None and f > 0 > rate else None


def is_zero(table: PreparedTable, state: State, wall: Wall, s: Fraction) -> bool:
    """Tell whether f, less f(0) on the wall being left, is known to vanish exactly at s."""
    f: ExactNumber = wall_jet(table, state, wall, s).f
    if wall == state.wall:
        f += -wall_jet(table, state, wall, Fraction(0)).f
    return f.is_zero()
