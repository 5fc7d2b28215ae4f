"""Laws of motion: table parameters as functions of time.

A law is `Constant`, `Fourier` or `BangBang`. Its numbers are binary64 and mean exactly that real
number. All kinds have one interface, that of `Law`: only what compiles or encloses a law must know
its kind. A table's fields take a bare number for a constant; `scene.laws` of a table are objects.

On each of its analytic pieces (`scene.pieces`) a law is a constant, a polynomial with rational
coefficients, or a sum of waves. docs/new-law.md says how to add a kind.
"""

from __future__ import annotations

import itertools
import math
from bisect import bisect_right
from collections.abc import Iterable
from fractions import Fraction
from functools import cached_property
from typing import Any, NamedTuple

import msgspec
import numpy as np
from msgspec.structs import force_setattr

from scene import bounds as bound
from scene.bounds import Bounds
from scene.pieces import (
    Arrays,
    ConstantPiece,
    FloatArray,
    Period,
    Piece,
    PolynomialPiece,
    TrigonometricPiece,
)
from scene.refusal import BadInput, InvalidScene, check_list, check_number, listed, shown

MAX_HARMONICS = 16  # validity is decided by exact algebra, whose cost grows steeply with the degree
MAX_KNOTS = 256


class Law(msgspec.Struct, frozen=True, dict=True):
    """A parameter of a table as a function of time: what all kinds of laws answer.

    A kind must define `cycle`, `level`, `piece_at`, `bounds`, `scaled` and `reversed`. What else is
    here holds for a law that has a single analytic piece, for ever. A law with knots defines
    `origin`, `breakpoints`, `value` and `values` as well.
    """

    @property
    def cycle(self) -> Period | None:
        """Return the period of a law that moves; None when it never changes."""
        raise NotImplementedError

    @property
    def level(self) -> float:
        """Return a constant law's value, else a number of the law that tells its size.

        For a positive law it is within a factor of a few dozen of the largest value.
        """
        raise NotImplementedError

    def piece_at(self, time: Fraction) -> Piece:
        """Return the analytic piece that holds at an exact time and just after it."""
        raise NotImplementedError

    def bounds(self) -> Bounds:
        """Bound the law and its derivatives for all times, rounded outward at every scale."""
        raise NotImplementedError

    def scaled(self, size: int, time: int) -> Law:
        """Return the law with its values times 2^size and its times times 2^time."""
        raise NotImplementedError

    def reversed(self) -> Law:
        """Return the law that runs backwards: f(-t) for f(t)."""
        raise NotImplementedError

    @property
    def is_constant(self) -> bool:
        """Tell whether the law never changes."""
        return self.cycle is None

    @property
    def is_polynomial(self) -> bool:
        """Tell whether each piece is a polynomial of time; a constant law is one."""
        return self.is_constant

    @property
    def is_trigonometric(self) -> bool:
        """Tell whether the law is `level` and the sum of its `harmonics`.

        A constant law is that.
        """
        return self.is_constant

    @property
    def origin(self) -> float | None:
        """Return a time at which a cycle begins best [time]; None for a law without knots."""
        return None

    def breakpoints(self) -> list[Fraction]:
        """Return the times in one period, ends included, at which the law is not analytic."""
        return []

    def harmonics(self) -> list[tuple[int, float, float]]:
        """Return (k, cosine amplitude, sine amplitude) for every wave of the law."""
        return []

    @property
    def factors(self) -> tuple[Law, ...]:
        """Return the laws whose product it is: itself alone (see `Product`)."""
        return (self,)

    def value(self, ctx: Any, t: Any, order: int = 0) -> Any:
        """Evaluate the law, or a derivative, at a point (not an interval) of time.

        Args:
            ctx: an mpmath context: mp, fp or a private one.
            t: time, a number of ctx [time]; or an array of times, as in `values`.
            order: 0, 1 or 2.
        """
        if isinstance(t, np.ndarray):
            return self.values(t, order)
        return self.piece_at(Fraction(0)).evaluate(ctx, t, order)

    def values(self, times: FloatArray, order: int = 0) -> FloatArray:
        """Evaluate the law, or its derivative of order 1 or 2, in binary64 at times of any shape.

        Times since the first knot, phases and omega t are rounded as floats are.
        """
        found = self.piece_at(Fraction(0)).evaluate(Arrays, times, order)
        return np.full(times.shape, found)

    def size_bounds(self) -> Bounds:
        """Bound a law that is a size (radius, width, depth, nu), positive in a valid scene."""
        return self.bounds()

    def as_field(self) -> float | Law:
        """Return the law as a table's field gives it: a constant is a bare number there."""
        return self

    def __call__(self, t: Any) -> Any:
        """Return the value at a time, or an array of values at an array of times of any shape.

        Raises:
            BadInput: a time is not a finite number.
        """
        return _called(self, t)


class Constant(Law, frozen=True):
    """A law that never changes. Tables check its number, and keep it as a bare one."""

    level: float

    @property
    def cycle(self) -> None:
        """Return None."""
        return

    def piece_at(self, time: Fraction) -> ConstantPiece:
        """Return the constant."""
        return ConstantPiece(self.level)

    def bounds(self) -> Bounds:
        """Return the level twice, and no motion."""
        return Bounds(self.level, self.level, 0.0, 0.0)

    def scaled(self, size: int, time: int) -> Constant:
        """Return the level times 2^size."""
        return Constant(times_power(self.level, size))

    def reversed(self) -> Constant:
        """Return the law itself."""
        return self

    def as_field(self) -> float:
        """Return the bare number."""
        return self.level


class Fourier(
    Law,
    frozen=True,
    tag_field="kind",
    tag="fourier",
    forbid_unknown_fields=True,
    repr_omit_defaults=True,
):
    """mean + sum_k cos[k-1] cos(k omega t) + sin[k-1] sin(k omega t).

    Exactly one of `omega` [1/time] and `period` [time] is given; omega is 2 pi / period exactly.
    """

    mean: float
    omega: float | None = None
    cos: tuple[float, ...] = ()
    sin: tuple[float, ...] = ()
    period: float | None = None

    def __post_init__(self) -> None:
        """Refuse invalid fields. Numbers of any kind become floats, and lists become tuples.

        Raises:
            InvalidScene: naming the field, the value and the bound.
        """
        force_setattr(self, "mean", check_number("fourier.mean", self.mean, InvalidScene))
        for field in ("cos", "sin"):
            force_setattr(self, field, amplitudes(f"fourier.{field}", getattr(self, field)))
        if (self.omega is None) == (self.period is None):
            raise InvalidScene("fourier needs exactly one of `omega` and `period`")
        field = "omega" if self.period is None else "period"
        size = check_number(f"fourier.{field}", getattr(self, field), InvalidScene)
        if size <= 0:
            raise InvalidScene(f"fourier.{field} = {size}, must be finite and > 0")
        force_setattr(self, field, size)

    @cached_property
    def _piece(self) -> ConstantPiece | TrigonometricPiece:
        pairs = itertools.zip_longest(self.cos, self.sin, fillvalue=0.0)
        harmonics = tuple((k, c, s) for k, (c, s) in enumerate(pairs, 1) if c or s)
        if not harmonics:
            return ConstantPiece(self.mean)
        length = None if self.period is None else Fraction(self.period)
        return TrigonometricPiece(self.mean, harmonics, Period(self.omega, length))

    @property
    def cycle(self) -> Period | None:
        """Return the period of the first harmonic; None without harmonics."""
        return None if self._piece.is_polynomial else self._piece.cycle

    @property
    def level(self) -> float:
        """Return the mean."""
        return self.mean

    @property
    def is_trigonometric(self) -> bool:
        """Return True."""
        return True

    def harmonics(self) -> list[tuple[int, float, float]]:
        """Return (k, cosine amplitude, sine amplitude) for every harmonic present."""
        return [] if self._piece.is_polynomial else list(self._piece.harmonics)

    def frequency(self, ctx: Any) -> Any:
        """Return omega [1/time] in a number system; in `iv` an enclosure where it is irrational."""
        if self.period is not None:
            return 2 * ctx.pi / ctx.mpf(self.period)
        return ctx.mpf(self.omega)

    def piece_at(self, time: Fraction) -> ConstantPiece | TrigonometricPiece:
        """Return the one piece."""
        return self._piece

    def bounds(self) -> Bounds:
        """Bound the law by its mean and all its amplitudes."""
        harmonics = self.harmonics()
        if not harmonics:
            return Bounds(self.mean, self.mean, 0.0, 0.0)
        if self.period is None:
            assert self.omega is not None
            return bound.of_waves(self.mean, harmonics, *math.frexp(self.omega))
        fraction, exponent = math.frexp(self.period)
        return bound.of_waves(self.mean, harmonics, 2 * math.pi / fraction, -exponent)

    def size_bounds(self) -> Bounds:
        """Bound a law that is a size, positive as its scene is valid.

        `bounds` subtracts all amplitudes from the mean. The result may be negative although the law
        is not: 1 + 0.9 cos x - 0.35 cos 3x is above 0.1. Here the least value is never below 0; a
        lower bound of 0 only says that the law is positive.
        """
        found = self.bounds()
        if found.lowest > 0.0:
            return found
        return found._replace(lowest=bound.least_of_waves(self.mean, self.harmonics()))

    def scaled(self, size: int, time: int) -> Fourier:
        """Return the law with its values times 2^size and its times times 2^time."""
        cos, sin = (tuple(times_power(a, size) for a in given) for given in (self.cos, self.sin))
        omega = None if self.omega is None else times_power(self.omega, -time)
        period = None if self.period is None else times_power(self.period, time)
        return Fourier(
            mean=times_power(self.mean, size), omega=omega, cos=cos, sin=sin, period=period
        )

    def reversed(self) -> Fourier:
        """Return the law that runs backwards."""
        return msgspec.structs.replace(self, sin=tuple(-b for b in self.sin))


class BangBang(Law, frozen=True, tag_field="kind", tag="bang-bang", forbid_unknown_fields=True):
    """At rest at each knot (time, value); constant acceleration to mid-leg, the opposite after."""

    knots: tuple[tuple[float, float], ...]

    def __post_init__(self) -> None:
        """Refuse invalid fields. Numbers of any kind become floats, and lists become tuples.

        Raises:
            InvalidScene: naming the knot, the value and the bound.
        """
        knots = check_list(
            "bang-bang.knots", self.knots, "a list of pairs [time, value]", InvalidScene
        )
        if not 2 <= len(knots) <= MAX_KNOTS:
            raise InvalidScene(
                f"bang-bang.knots has {len(knots)} knots, must have 2 to {MAX_KNOTS}"
            )
        force_setattr(self, "knots", tuple(checked_knot(i, knot) for i, knot in enumerate(knots)))
        check_legs(self.knots)

    @cached_property
    def half_legs(self) -> tuple[PolynomialPiece, ...]:
        """Return the parabolas of one period from the first knot on, also of a law at rest."""
        found = []
        for knot, next_knot in itertools.pairwise(self.knots):
            start, before = map(Fraction, knot)
            stop, after = map(Fraction, next_knot)
            half_acceleration = 2 * (after - before) / (stop - start) ** 2
            zero = Fraction(0)
            found.append(
                PolynomialPiece(start, (before, zero, half_acceleration), (start + stop) / 2)
            )
            found.append(PolynomialPiece(stop, (after, zero, -half_acceleration), stop))
        return tuple(found)

    @cached_property
    def length(self) -> Fraction:
        """Return the time from the first knot to the last [time], also of a law at rest."""
        return Fraction(self.knots[-1][0]) - Fraction(self.knots[0][0])

    @cached_property
    def is_constant(self) -> bool:
        """Tell whether all knots have the same value."""
        return all(value == self.knots[0][1] for _, value in self.knots)

    @property
    def cycle(self) -> Period | None:
        """Return the time from the first knot to the last; None when all have the same value."""
        return None if self.is_constant else Period(None, self.length)

    @property
    def level(self) -> float:
        """Return the highest value."""
        return max(value for _, value in self.knots)

    @property
    def is_polynomial(self) -> bool:
        """Return True: each half leg is a parabola."""
        return True

    @property
    def origin(self) -> float:
        """Return the first knot's time."""
        return self.knots[0][0]

    def breakpoints(self) -> list[Fraction]:
        """Return all knots and the middles of the legs."""
        return [self.half_legs[0].origin, *(leg.end for leg in self.half_legs)]

    def leg_at(self, time: Fraction) -> PolynomialPiece:
        """Return the half leg that holds at `time` and just after it, also of a law at rest."""
        legs = self.half_legs
        shift = (time - legs[0].origin) // self.length * self.length
        return legs[bisect_right(legs, time - shift, key=lambda leg: leg.end)].later(shift)

    def piece_at(self, time: Fraction) -> ConstantPiece | PolynomialPiece:
        """Return the half leg, or the constant."""
        return ConstantPiece(self.knots[0][1]) if self.is_constant else self.leg_at(time)

    def value(self, ctx: Any, t: Any, order: int = 0) -> Any:
        """Evaluate the law, or a derivative, on the piece that holds at a time exactly."""
        if isinstance(t, np.ndarray):
            return self.values(t, order)
        time = Fraction(*map(int, t.as_integer_ratio()))  # of mpf the parts are integers of gmpy2
        return self.piece_at(time).evaluate(ctx, t, order)

    def values(self, times: FloatArray, order: int = 0) -> FloatArray:
        """Evaluate the law, or a derivative, in binary64 at times of any shape."""
        if self.is_constant:
            return super().values(times, order)
        knots = np.array([t for t, _ in self.knots])
        phases = knots[0] + np.mod(times - knots[0], knots[-1] - knots[0])
        legs = np.minimum(np.searchsorted(knots, phases, side="right"), len(knots) - 1) - 1
        # The middle of a leg need not be a float.
        is_late = phases - knots[legs] >= knots[legs + 1] - phases
        found = np.empty(times.shape)
        for leg in np.unique(legs):
            halves = self.half_legs[2 * leg : 2 * leg + 2]
            for piece, half in zip(halves, (~is_late, is_late), strict=True):
                chosen = (legs == leg) & half
                found[chosen] = piece.evaluate(Arrays, phases[chosen], order)
        return found

    def bounds(self) -> Bounds:
        """Bound the law by its lowest and highest knots and its steepest and shortest legs."""
        return bound.of_legs(self.knots)

    def scaled(self, size: int, time: int) -> BangBang:
        """Return the law with its values times 2^size and its times times 2^time."""
        return BangBang(
            knots=tuple((times_power(t, time), times_power(v, size)) for t, v in self.knots)
        )

    def reversed(self) -> BangBang:
        """Return the law that runs backwards."""
        return BangBang(knots=tuple((-t, v) for t, v in reversed(self.knots)))


WRITTEN = (Fourier, BangBang)  # the kinds that files and messages name; a constant is a bare number
GivenLaw = float | Fourier | BangBang  # what a table's field takes


class Product(NamedTuple):
    """The product of two positive laws, as the half-width w = nu r: what a table asks of a law."""

    first: Law
    second: Law

    @property
    def factors(self) -> tuple[Law, ...]:
        """Return the laws whose product it is."""
        return tuple(self)

    @property
    def is_constant(self) -> bool:
        """Tell whether no factor changes."""
        return self.first.is_constant and self.second.is_constant

    @property
    def cycle(self) -> Period | None:
        """Return the period that its factors share; None when it never changes."""
        return shared_cycle(self)

    def value(self, ctx: Any, t: Any, order: int = 0) -> Any:
        """Evaluate the product, or a derivative, as `Law.value` does."""
        return self._combined(order, lambda law, derived: law.value(ctx, t, derived))

    def values(self, times: FloatArray, order: int = 0) -> FloatArray:
        """Evaluate the product, or a derivative, as `Law.values` does."""
        found: FloatArray = self._combined(order, lambda law, derived: law.values(times, derived))
        return found

    def _combined(self, order: int, at: Any) -> Any:
        """Apply Leibniz's rule to the factors' derivatives, `at(law, order)`."""
        terms = [
            math.comb(order, k) * at(self.first, order - k) * at(self.second, k)
            for k in range(order + 1)
        ]
        return sum(terms[1:], terms[0])

    def size_bounds(self) -> Bounds:
        """Bound the product for all times, rounded outward by a few units in the last place."""
        return bound.of_product(self.first.size_bounds(), self.second.size_bounds())

    def __call__(self, t: Any) -> Any:
        """Return the value at a time or an array of times, as a law does."""
        return _called(self, t)


def law_of(given: float | Law) -> Law:
    """Return the law that a table's field gives."""
    return given if isinstance(given, Law) else Constant(given)


def shared_cycle(laws: Iterable[Law]) -> Period | None:
    """Return the period of the first law that moves, which all moving laws share.

    None if nothing moves.
    """
    return next((law.cycle for law in laws if not law.is_constant), None)


def first_origin(laws: Iterable[Law]) -> float:
    """Return when a cycle begins [time].

    At the first knot of the first law that has knots, else at 0.
    """
    return next((law.origin for law in laws if law.origin is not None), 0.0)


def times_power(number: float, exponent: int) -> float:
    """Return a number times 2^exponent, infinite where that overflows.

    The power itself need not be a float: 2^1000 times 2^-1080 is 2^-80, though 2^-1080 is rounded
    to 0.
    """
    try:
        return math.ldexp(number, exponent)
    except OverflowError:
        return math.copysign(math.inf, number)


def amplitudes(field: str, given: object) -> tuple[float, ...]:
    """Return a Fourier law's amplitudes.

    Raises:
        InvalidScene: they are not a list of finite numbers, or too many.
    """
    numbers = check_list(field, given, "a list of numbers", InvalidScene)
    if len(numbers) > MAX_HARMONICS:
        raise InvalidScene(
            f"{field} has {len(numbers)} harmonics, at most {MAX_HARMONICS} are allowed"
        )
    return tuple(
        check_number(f"{field}[{k}]", number, InvalidScene) for k, number in enumerate(numbers)
    )


def checked_knot(i: int, knot: object) -> tuple[float, float]:
    """Return a bang-bang law's knot number i.

    Raises:
        InvalidScene: it is not a pair of finite numbers.
    """
    knot = listed(knot)
    if not (isinstance(knot, tuple | list) and len(knot) == 2):
        raise InvalidScene(f"bang-bang.knots[{i}] = {shown(knot)}, must be a pair [time, value]")
    time, value = knot
    return (
        check_number(f"bang-bang.knots[{i}] time", time, InvalidScene),
        check_number(f"bang-bang.knots[{i}] value", value, InvalidScene),
    )


def check_legs(knots: tuple[tuple[float, float], ...]) -> None:
    """Refuse knots that do not rise in time, do not close, or whose span is no binary64 number.

    Raises:
        InvalidScene: naming the knot, the value and the bound.
    """
    for i, ((before, _), (after, _)) in enumerate(itertools.pairwise(knots), 1):
        if after <= before:
            raise InvalidScene(f"bang-bang.knots[{i}] time = {after}, must be > {before}")
    start, first = knots[0]
    end, last = knots[-1]
    if last != first:
        raise InvalidScene(
            f"bang-bang.knots[{len(knots) - 1}] value = {last}, must equal the first ({first}): "
            "no jumps"
        )
    span = end - start
    if not math.isfinite(span) or Fraction(span) != Fraction(end) - Fraction(start):
        raise InvalidScene(
            f"bang-bang.knots span {start} to {end}: the period must be a binary64 number"
        )


def _called(law: Law | Product, t: Any) -> Any:
    """Evaluate a law for a user: at a time, or at an array of times of any shape."""
    try:
        times = np.asarray(t, np.float64)
    except (TypeError, ValueError):
        raise BadInput(f"t = {shown(t)}, must be finite numbers") from None
    if not np.isfinite(times).all():
        raise BadInput(f"t = {times[~np.isfinite(times)][0]}, must be finite")
    found = law.values(times.reshape(-1)).reshape(times.shape)
    return found if times.ndim else float(found)
