"""Laws of motion: table parameters as functions of time.

A law is a bare number, a trigonometric polynomial or a bang-bang motion. Its numbers are
binary64 and mean exactly that real number. On each of its analytic pieces a law is a
constant, a trigonometric polynomial or a quadratic with rational coefficients. `piece_at`
returns that piece. `evaluate` works in each of mpmath's number systems (`mp`, `fp`, `iv`),
so one definition serves points, floats and enclosures.
"""

import itertools
import math
from bisect import bisect_right
from collections.abc import Iterable
from fractions import Fraction
from functools import lru_cache
from typing import Any, NamedTuple

import msgspec
import numpy as np
from msgspec.structs import force_setattr
from numpy.typing import NDArray

from scene.refusal import BadInput, InvalidScene, check_list, check_number, listed, shown

MAX_HARMONICS = 16  # validity is decided by exact algebra, whose cost grows steeply with the degree
MAX_KNOTS = 256
LEAST_NORMAL = 2.0**-1022

FloatArray = NDArray[np.float64]


class Fourier(
    msgspec.Struct,
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

    def __call__(self, t: Any) -> Any:
        """Return the value at a time, or an array of values at an array of times."""
        return at(self, t)

    def harmonics(self) -> list[tuple[int, float, float]]:
        """Return (k, cosine amplitude, sine amplitude) for every harmonic present."""
        pairs = itertools.zip_longest(self.cos, self.sin, fillvalue=0.0)
        return [(k, c, s) for k, (c, s) in enumerate(pairs, 1) if c or s]


class BangBang(msgspec.Struct, frozen=True, tag_field="kind", tag="bang-bang", forbid_unknown_fields=True):
    """At rest at each knot (time, value); constant acceleration to mid-leg, the opposite after."""

    knots: tuple[tuple[float, float], ...]

    def __post_init__(self) -> None:
        """Refuse invalid fields. Numbers of any kind become floats, and lists become tuples.

        Raises:
            InvalidScene: naming the knot, the value and the bound.
        """
        knots = check_list("bang-bang.knots", self.knots, "a list of pairs [time, value]", InvalidScene)
        if not 2 <= len(knots) <= MAX_KNOTS:
            raise InvalidScene(f"bang-bang.knots has {len(knots)} knots, must have 2 to {MAX_KNOTS}")
        force_setattr(self, "knots", tuple(checked_knot(i, knot) for i, knot in enumerate(knots)))
        check_legs(self.knots)

    def __call__(self, t: Any) -> Any:
        """Return the value at a time, or an array of values at an array of times."""
        return at(self, t)


Law = float | Fourier | BangBang


def amplitudes(field: str, given: object) -> tuple[float, ...]:
    """Return a Fourier law's amplitudes.

    Raises:
        InvalidScene: they are not a list of finite numbers, or too many.
    """
    numbers = check_list(field, given, "a list of numbers", InvalidScene)
    if len(numbers) > MAX_HARMONICS:
        raise InvalidScene(f"{field} has {len(numbers)} harmonics, at most {MAX_HARMONICS} are allowed")
    return tuple(check_number(f"{field}[{k}]", number, InvalidScene) for k, number in enumerate(numbers))


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
    """Refuse knots whose times do not increase, that do not close, or whose span is not a binary64 number.

    Raises:
        InvalidScene: naming the knot, the value and the bound.
    """
    for i, ((before, _), (after, _)) in enumerate(itertools.pairwise(knots), 1):
        if after <= before:
            raise InvalidScene(f"bang-bang.knots[{i}] time = {after}, must be > {before}")
    (start, first), (end, last) = knots[0], knots[-1]
    if last != first:
        raise InvalidScene(
            f"bang-bang.knots[{len(knots) - 1}] value = {last}, must equal the first ({first}): no jumps"
        )
    span = end - start
    if not math.isfinite(span) or Fraction(span) != Fraction(end) - Fraction(start):
        raise InvalidScene(f"bang-bang.knots span {start} to {end}: the period must be a binary64 number")


class Period(NamedTuple):
    """A common period: 2 pi / omega, kept symbolic, or an exact rational length [time]."""

    omega: float | None
    length: Fraction | None

    def value(self, ctx: Any) -> Any:
        """Return the period [time] in an mpmath number system."""
        if self.length is not None:
            return exact(ctx, self.length)
        return 2 * ctx.pi / ctx.mpf(self.omega)


class Quadratic(NamedTuple):
    """c0 + c2 (t - origin)^2 until `end`, all exact rationals: a bang-bang law rests at its knots."""

    origin: Fraction
    c0: Fraction
    c2: Fraction
    end: Fraction


Piece = float | Fourier | Quadratic


class Bounds(NamedTuple):
    """lowest <= f <= highest, |f'| <= slope, |f''| <= curvature at all times (rounded outward)."""

    lowest: float
    highest: float
    slope: float
    curvature: float


def is_constant(law: Law) -> bool:
    """Tell whether the law never changes."""
    if isinstance(law, Fourier):
        return not law.harmonics()
    if isinstance(law, BangBang):
        return all(value == law.knots[0][1] for _, value in law.knots)
    return True


def period_of(law: Law) -> Period | None:
    """Return the period of a law that moves; None when it never changes."""
    if is_constant(law):
        return None
    if isinstance(law, BangBang):
        return Period(None, Fraction(law.knots[-1][0]) - Fraction(law.knots[0][0]))
    assert isinstance(law, Fourier)
    return Period(law.omega, None if law.period is None else Fraction(law.period))


def shared_period(laws: Iterable[Law]) -> Period | None:
    """Return the period of the first law that moves, which all moving laws share; None if nothing moves."""
    return next((found for law in laws if (found := period_of(law)) is not None), None)


def piece_at(law: Law, time: Fraction) -> Piece:
    """Return the analytic piece that holds at `time` and just after it.

    Args:
        law: a sound law.
        time: any exact time.

    Returns:
        A float (constant for ever), the Fourier law itself, or the Quadratic up to its end.
    """
    if isinstance(law, BangBang):
        return law.knots[0][1] if is_constant(law) else leg_at(law, time)
    if isinstance(law, Fourier):
        return law.mean if is_constant(law) else law
    return law


@lru_cache(maxsize=64)
def half_legs(law: BangBang) -> tuple[Quadratic, ...]:
    """Return the parabolas of the period that begins at the first knot, also of a law at rest."""
    found = []
    for knot, next_knot in itertools.pairwise(law.knots):
        (start, before), (stop, after) = map(Fraction, knot), map(Fraction, next_knot)
        half_acceleration = 2 * (after - before) / (stop - start) ** 2
        found.append(Quadratic(start, before, half_acceleration, (start + stop) / 2))
        found.append(Quadratic(stop, after, -half_acceleration, stop))
    return tuple(found)


def leg_at(law: BangBang, time: Fraction) -> Quadratic:
    """Return the half leg that holds at `time` and just after it."""
    legs = half_legs(law)
    start = legs[0].origin
    shift = (time - start) // (legs[-1].end - start) * (legs[-1].end - start)
    leg = legs[bisect_right(legs, time - shift, key=lambda leg: leg.end)]
    return leg._replace(origin=leg.origin + shift, end=leg.end + shift)


def breakpoints(law: Law) -> list[Fraction]:
    """Return the times in one period, ends included, at which the law is not analytic."""
    if not isinstance(law, BangBang):
        return []
    return [half_legs(law)[0].origin, *(leg.end for leg in half_legs(law))]


def exact(ctx: Any, number: Fraction) -> Any:
    """Bring a rational into a number system (in `iv`: an enclosure of it); for floats it is rounded once."""
    if ctx.mpf is not float:
        return ctx.mpf(number.numerator) / ctx.mpf(number.denominator)
    try:
        return float(number)  # its parts alone may be beyond any float, as those of a knot at 1e-310 are
    except OverflowError:
        return math.inf if number > 0 else -math.inf


def _at_float(piece: Quadratic, t: float | FloatArray, order: int) -> Any:
    """Evaluate a parabola whose curvature is beyond any float, exactly, and round once."""
    if isinstance(t, np.ndarray):
        return np.array([_at_float(piece, each, order) for each in t.ravel().tolist()]).reshape(t.shape)
    x = Fraction(t) - piece.origin
    found = (piece.c0 + piece.c2 * x**2, 2 * piece.c2 * x, 2 * piece.c2)
    return exact(_Arrays, found[order])


def evaluate(ctx: Any, piece: Piece, t: Any, order: int = 0) -> Any:
    """Evaluate a piece, or its first or second derivative.

    Args:
        ctx: an mpmath context: mp, fp, iv, or a private one.
        piece: from `piece_at`; the caller keeps t within it.
        t: time, a number of ctx [time].
        order: 0, 1 or 2.

    Returns:
        A number of ctx: [length], [length/time] or [length/time^2]; slopes and nu have no length.
    """
    if isinstance(piece, Quadratic):
        x = t - exact(ctx, piece.origin)
        c2 = exact(ctx, piece.c2)
        if ctx.mpf is float and math.isinf(c2):
            return _at_float(piece, t, order)
        if order == 0:
            return exact(ctx, piece.c0) + x * (x * c2)
        return 2 * c2 * x + 0 if order == 1 else 2 * c2  # + 0: what rests has the rate 0, not minus 0
    if isinstance(piece, Fourier):
        return _trigonometric(ctx, piece, t, order)
    return ctx.mpf(piece) if order == 0 else ctx.mpf(0)


def frequency(ctx: Any, law: Fourier) -> Any:
    """Return omega [1/time] in a number system; in `iv` an enclosure, since 2 pi / period is irrational."""
    if law.period is not None:
        return 2 * ctx.pi / ctx.mpf(law.period)
    return ctx.mpf(law.omega)


def _trigonometric(ctx: Any, law: Fourier, t: Any, order: int) -> Any:
    total = ctx.mpf(law.mean) if order == 0 else ctx.mpf(0)
    omega = frequency(ctx, law)
    for k, c, s in law.harmonics():
        rate = k * omega
        cos, sin = ctx.cos_sin(rate * t)
        if order == 1:
            cos, sin = -rate * sin, rate * cos
        elif order == 2:
            cos, sin = -rate * rate * cos, -rate * rate * sin
        if c:
            total += ctx.mpf(c) * cos
        if s:
            total += ctx.mpf(s) * sin
    return total


def value(ctx: Any, law: Law, t: Any, order: int = 0) -> Any:
    """Evaluate a law at a point (not an interval) of time, in `mp` or `fp`; at an array: `values`."""
    if isinstance(t, np.ndarray):
        return values(law, t, order)
    if isinstance(law, BangBang):
        time = Fraction(*map(int, t.as_integer_ratio()))  # of mpf the parts are integers of gmpy2
        return evaluate(ctx, piece_at(law, time), t, order)
    return evaluate(ctx, law, t, order)


class _Arrays:
    """A number system for `evaluate`: arrays of binary64."""

    mpf, pi = float, math.pi

    @staticmethod
    def cos_sin(x: FloatArray) -> tuple[FloatArray, FloatArray]:
        return np.cos(x), np.sin(x)


def values(law: Law, times: FloatArray, order: int = 0) -> FloatArray:
    """Evaluate a law, or its derivative of order 1 or 2, in binary64 at times of any shape.

    Times since the first knot, phases and omega t are rounded as floats are.
    """
    if is_constant(law) or not isinstance(law, BangBang):
        return np.full(times.shape, evaluate(_Arrays, piece_at(law, Fraction(0)), times, order))
    knots = np.array([t for t, _ in law.knots])
    phases = knots[0] + np.mod(times - knots[0], knots[-1] - knots[0])
    legs = np.minimum(np.searchsorted(knots, phases, side="right"), len(knots) - 1) - 1
    is_late = phases - knots[legs] >= knots[legs + 1] - phases  # the middle of a leg need not be a float
    found = np.empty(times.shape)
    for leg in np.unique(legs):
        for piece, half in zip(half_legs(law)[2 * leg : 2 * leg + 2], (~is_late, is_late), strict=True):
            those = (legs == leg) & half
            found[those] = evaluate(_Arrays, piece, phases[those], order)
    return found


def at(law: Law, t: Any) -> Any:
    """Return the value of a law at a time, or an array of values at an array of times of any shape.

    Raises:
        BadInput: a time is not a finite number.
    """
    try:
        times = np.asarray(t, np.float64)
    except (TypeError, ValueError):
        raise BadInput(f"t = {shown(t)}, must be finite numbers") from None
    if not np.isfinite(times).all():
        raise BadInput(f"t = {times[~np.isfinite(times)][0]}, must be finite")
    found = values(law, times.reshape(-1)).reshape(times.shape)
    return found if times.ndim else float(found)


def bounds(law: Law) -> Bounds:
    """Bound a law and its derivatives for all times, rounded outward at every scale.

    Sizes are summed as fractions in [1/2, 1) with an exponent apart, so nothing overflows or underflows
    on the way, and a relative slack covers the roundings. Only the last step, which puts the exponent back,
    may leave the range: it rounds up, to a subnormal number or to infinity.
    """
    if isinstance(law, BangBang):
        values = [value for _, value in law.knots]
        legs = [(abs(v1 - v0), t1 - t0) for (t0, v0), (t1, v1) in itertools.pairwise(law.knots)]
        slope = max(_quotient_up(2.0, rise, duration) for rise, duration in legs)
        curvature = max(_quotient_up(4.0, rise, duration, duration) for rise, duration in legs)
        return Bounds(min(values), max(values), slope, curvature)
    if not isinstance(law, Fourier):
        return Bounds(law, law, 0.0, 0.0)
    harmonics = law.harmonics()
    if not harmonics:
        return Bounds(law.mean, law.mean, 0.0, 0.0)
    _, unit = math.frexp(max(max(abs(c), abs(s)) for _, c, s in harmonics))
    omega, rate = _split_frequency(law)
    terms = [(k * omega, math.hypot(math.ldexp(c, -unit), math.ldexp(s, -unit))) for k, c, s in harmonics]
    swing = _up(sum(size for _, size in terms), unit)
    slope = _up(sum(size * f for f, size in terms), unit + rate)
    curvature = _up(sum(size * f * f for f, size in terms), unit + 2 * rate)
    # The sum of two floats errs by half a unit of its last place, and not at all where it is subnormal.
    lowest, highest = law.mean - swing, law.mean + swing
    return Bounds(lowest - _slack(lowest, swing), highest + _slack(highest, swing), slope, curvature)


def _split_frequency(law: Fourier) -> tuple[float, int]:
    # omega = fraction 2^exponent to within a few roundings.
    if law.period is not None:
        fraction, exponent = math.frexp(law.period)
        return 2 * math.pi / fraction, -exponent
    assert law.omega is not None
    return math.frexp(law.omega)


def _quotient_up(factor: float, number: float, *divisors: float) -> float:
    if math.isinf(number):  # a leg from one end of the range of floats to the other
        return number
    quotient, exponent = math.frexp(number)
    for divisor in divisors:
        fraction, shift = math.frexp(divisor)
        quotient, exponent = quotient / fraction, exponent - shift
    return _up(factor * quotient, exponent)


def _up(size: float, exponent: int) -> float:
    # A few dozen roundings at most went into the size, each of relative size 2^-53.
    size *= 1 + 2.0**-45
    try:
        number = math.ldexp(size, exponent)
    except OverflowError:
        return math.inf
    return number if number >= LEAST_NORMAL or size == 0 else math.nextafter(number, math.inf)


def _slack(level: float, swing: float) -> float:
    return (abs(level) + swing) * 2.0**-50


def size_bounds(law: Law) -> Bounds:
    """Bound a law that is a size (radius, width, depth or nu), positive because its scene is valid.

    `bounds` subtracts all amplitudes of a Fourier law from its mean. The result may be negative although the
    law is not: 1 + 0.9 cos x - 0.35 cos 3x is above 0.1. Here the least value is never below 0; a lower bound
    of 0 only says that the law is positive.
    """
    found = bounds(law)
    if found.lowest > 0.0 or not isinstance(law, Fourier):
        return found
    return found._replace(lowest=_least_by_samples(law))


def _least_by_samples(law: Fourier) -> float:
    """Bound a positive Fourier law from below by samples; return 0 if they do not show a positive bound.

    Between samples at distance d, f is at least the lower neighbour minus max |f''| d^2 / 8. Units are the
    mean, which is positive, and the phase.
    """
    waves = [(k, c / law.mean, s / law.mean) for k, c, s in law.harmonics()]
    size = 1.0 + sum(k * (abs(c) + abs(s)) for k, c, s in waves)  # bounds what a rounded phase does, too
    bend = sum(k * k * (abs(c) + abs(s)) for k, c, s in waves)
    for n in (2**8, 2**11, 2**14, 2**17):
        phases = np.arange(n) * (2.0 * np.pi / n)
        least = float((1.0 + sum(c * np.cos(k * phases) + s * np.sin(k * phases) for k, c, s in waves)).min())
        found = least - bend * (2.0 * np.pi / n) ** 2 / 8.0 - 2.0**-40 * size
        if found > 0.5 * least:
            return found * law.mean
    return 0.0
