"""Laws of motion: table parameters as functions of time.

A law is a bare number, a trigonometric polynomial or a bang-bang motion. Its numbers are
binary64 and mean exactly that real number. On each of its analytic pieces a law is a
constant, a trigonometric polynomial or a quadratic with rational coefficients; `piece_at`
hands that piece out, and `evaluate` works in any of mpmath's number systems (`mp`, `fp`,
`iv`), so one definition serves points, floats and enclosures.
"""

from __future__ import annotations

import itertools
import math
from bisect import bisect_right
from fractions import Fraction
from typing import Any, NamedTuple

import msgspec
from mpmath import fp

MAX_HARMONICS = 16  # validity is decided by exact algebra, whose cost grows steeply with the degree
MAX_KNOTS = 256


class Fourier(msgspec.Struct, frozen=True, tag_field="kind", tag="fourier", forbid_unknown_fields=True):
    """mean + sum_k cos[k-1] cos(k omega t) + sin[k-1] sin(k omega t).

    Exactly one of `omega` [1/time] and `period` [time] is given; omega is 2 pi / period exactly.
    """

    mean: float
    omega: float | None = None
    cos: tuple[float, ...] = ()
    sin: tuple[float, ...] = ()
    period: float | None = None

    def harmonics(self) -> list[tuple[int, float, float]]:
        """Return (k, cosine amplitude, sine amplitude) for every harmonic present."""
        n = max(len(self.cos), len(self.sin))
        cos = self.cos + (0.0,) * (n - len(self.cos))
        sin = self.sin + (0.0,) * (n - len(self.sin))
        return [(k, c, s) for k, (c, s) in enumerate(zip(cos, sin, strict=True), 1) if c or s]


class BangBang(msgspec.Struct, frozen=True, tag_field="kind", tag="bang-bang", forbid_unknown_fields=True):
    """At rest at each knot (time, value); constant acceleration to mid-leg, the opposite after."""

    knots: tuple[tuple[float, float], ...]


Law = float | Fourier | BangBang


class Quadratic(NamedTuple):
    """c0 + c1 (t - origin) + c2 (t - origin)^2 until `end`, all exact rationals."""

    origin: Fraction
    c0: Fraction
    c1: Fraction
    c2: Fraction
    end: Fraction


Piece = float | Fourier | Quadratic


class Bounds(NamedTuple):
    """lowest <= f <= highest, |f'| <= slope, |f''| <= curvature at all times (rounded outward)."""

    lowest: float
    highest: float
    slope: float
    curvature: float


def defect(law: Law) -> str | None:
    """Say what breaks a law, naming field, value and bound; None when it is sound."""
    if isinstance(law, BangBang):
        return _knots_defect(law.knots)
    if isinstance(law, Fourier):
        for field in ("cos", "sin"):
            amplitudes = getattr(law, field)
            if len(amplitudes) > MAX_HARMONICS:
                return f".{field} has {len(amplitudes)} harmonics, at most {MAX_HARMONICS} are allowed"
            for k, amplitude in enumerate(amplitudes):
                if not math.isfinite(amplitude):
                    return f".{field}[{k}] = {amplitude}, must be finite"
        if not math.isfinite(law.mean):
            return f".mean = {law.mean}, must be finite"
        if (law.omega is None) == (law.period is None):
            return " needs exactly one of `omega` and `period`"
        for field, number in (("omega", law.omega), ("period", law.period)):
            if number is not None and not (math.isfinite(number) and number > 0):
                return f".{field} = {number}, must be finite and > 0"
        return None
    return None if math.isfinite(law) else f" = {law}, must be finite"


def _knots_defect(knots: tuple[tuple[float, float], ...]) -> str | None:
    if not 2 <= len(knots) <= MAX_KNOTS:
        return f".knots has {len(knots)} knots, must have 2 to {MAX_KNOTS}"
    for i, (time, value) in enumerate(knots):
        if not (math.isfinite(time) and math.isfinite(value)):
            return f".knots[{i}] = [{time}, {value}], must be finite"
        if i and time <= knots[i - 1][0]:
            return f".knots[{i}] time = {time}, must be > {knots[i - 1][0]}"
    if knots[-1][1] != knots[0][1]:
        return (
            f".knots[{len(knots) - 1}] value = {knots[-1][1]}, must equal the first ({knots[0][1]}): no jumps"
        )
    span = knots[-1][0] - knots[0][0]
    if not math.isfinite(span) or Fraction(span) != Fraction(knots[-1][0]) - Fraction(knots[0][0]):
        return f".knots span {knots[0][0]} to {knots[-1][0]}: the period must be a binary64 number"
    return None


def is_constant(law: Law) -> bool:
    """Tell whether the law never changes."""
    if isinstance(law, Fourier):
        return not law.harmonics()
    if isinstance(law, BangBang):
        return all(value == law.knots[0][1] for _, value in law.knots)
    return True


def piece_at(law: Law, time: Fraction) -> Piece:
    """Return the analytic piece that holds at `time` and just after it.

    Args:
        law: a sound law.
        time: any exact time.

    Returns:
        A float (constant for ever), the Fourier law itself, or the Quadratic up to its end.
    """
    if isinstance(law, BangBang):
        return law.knots[0][1] if is_constant(law) else _leg_at(law.knots, time)
    if isinstance(law, Fourier):
        return law.mean if is_constant(law) else law
    return law


def _leg_at(knots: tuple[tuple[float, float], ...], time: Fraction) -> Quadratic:
    times = [Fraction(knot[0]) for knot in knots]
    period = times[-1] - times[0]
    shift = (time - times[0]) // period * period
    i = bisect_right(times, time - shift) - 1
    start, stop = times[i] + shift, times[i + 1] + shift
    before, after = Fraction(knots[i][1]), Fraction(knots[i + 1][1])
    half_acceleration = 2 * (after - before) / (stop - start) ** 2
    middle = (start + stop) / 2
    if time < middle:
        return Quadratic(start, before, Fraction(0), half_acceleration, middle)
    return Quadratic(stop, after, Fraction(0), -half_acceleration, stop)


def breakpoints(law: Law) -> list[Fraction]:
    """Return the times in one period, ends included, at which the law is not analytic."""
    if not isinstance(law, BangBang):
        return []
    times = [Fraction(knot[0]) for knot in law.knots]
    middles = [(a + b) / 2 for a, b in itertools.pairwise(times)]
    return sorted(times + middles)


def exact(ctx: Any, number: Fraction) -> Any:
    """Bring a rational into a number system (in `iv`: an enclosure of it)."""
    return ctx.mpf(number.numerator) / ctx.mpf(number.denominator)


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
        if order == 0:
            return exact(ctx, piece.c0) + x * (exact(ctx, piece.c1) + x * c2)
        return exact(ctx, piece.c1) + 2 * c2 * x if order == 1 else 2 * c2
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
        cos, sin = ctx.cos(rate * t), ctx.sin(rate * t)
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
    """Evaluate a law at a point (not an interval) of time, in `mp` or `fp`."""
    if isinstance(law, BangBang):
        # A Python float passes through as it is; an mpf becomes the exact rational it stands for.
        time = (
            Fraction(t)
            if isinstance(t, (int, float, Fraction))
            else Fraction(*map(int, t.as_integer_ratio()))
        )
        return evaluate(ctx, piece_at(law, time), t, order)
    return evaluate(ctx, law, t, order)


def bounds(law: Law) -> Bounds:
    """Bound a law and its derivatives for all times; rounded outward, so sound in binary64."""
    if isinstance(law, BangBang):
        values = [knot[1] for knot in law.knots]
        slope = curvature = 0.0
        for (t0, v0), (t1, v1) in zip(law.knots, law.knots[1:], strict=False):
            slope = max(slope, 2 * abs(v1 - v0) / (t1 - t0))
            curvature = max(curvature, 4 * abs(v1 - v0) / (t1 - t0) / (t1 - t0))
        return Bounds(min(values), max(values), _up(slope), _up(curvature))
    if isinstance(law, Fourier):
        omega = float(frequency(fp, law))  # within the slack of `_up`
        terms = [(k * omega, math.hypot(c, s)) for k, c, s in law.harmonics()]
        swing = _up(sum(size for _, size in terms))
        slope = _up(sum(size * f for f, size in terms))
        curvature = _up(sum(size * f * f for f, size in terms))
        if not terms:
            return Bounds(law.mean, law.mean, 0.0, 0.0)
        lowest, highest = law.mean - swing, law.mean + swing
        return Bounds(lowest - _slack(lowest, swing), highest + _slack(highest, swing), slope, curvature)
    return Bounds(law, law, 0.0, 0.0)


def _up(size: float) -> float:
    # A few dozen roundings at most went into it, each of relative size 2^-53.
    return size * (1 + 2.0**-45)


def _slack(level: float, swing: float) -> float:
    return (abs(level) + swing) * 2.0**-50
