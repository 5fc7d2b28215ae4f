"""Wall functions with their first two derivatives along a flight, as enclosures.

f > 0 inside (sec. 2):   arc r^2 - x^2 - y^2,   base y (in a stem -y),
    right w + slope y - x,   left w + slope y + x,   floor y + h.
A Jet carries f, f' and f'' as functions of the flight time s; with s an interval, each is an
enclosure over all of it. Laws enter through their analytic pieces: the caller cuts at knots.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from reference.arithmetic import Arithmetic, Interval
from scene import Fourier, Wall
from scene.laws import Bounds, Piece, Quadratic


class Jet(NamedTuple):
    """Value and first two derivatives by s; None for a derivative that is 0 identically."""

    f: Interval
    d1: Interval | None
    d2: Interval | None


class Flight(NamedTuple):
    """A straight flight from a state: all components are enclosures."""

    t: Interval
    x: Interval
    y: Interval
    vx: Interval
    vy: Interval


Pieces = Mapping[str, Piece | Bounds]  # with Bounds, all that is known of a law is its range


def _sum(a: Interval | None, b: Interval | None) -> Interval | None:
    if a is None or b is None:
        return b if a is None else a
    return a + b


def add(p: Jet, q: Jet) -> Jet:
    """Return p + q."""
    return Jet(p.f + q.f, _sum(p.d1, q.d1), _sum(p.d2, q.d2))


def negative(p: Jet) -> Jet:
    """Return -p."""
    return Jet(-p.f, None if p.d1 is None else -p.d1, None if p.d2 is None else -p.d2)


def multiply(p: Jet, q: Jet) -> Jet:
    """Return p q."""
    d1 = d2 = None
    if p.d1 is not None:
        d1 = p.d1 * q.f
    if q.d1 is not None:
        d1 = _sum(d1, p.f * q.d1)
        d2 = None if p.d1 is None else 2 * (p.d1 * q.d1)
    if p.d2 is not None:
        d2 = _sum(d2, p.d2 * q.f)
    if q.d2 is not None:
        d2 = _sum(d2, p.f * q.d2)
    return Jet(p.f * q.f, d1, d2)


def square(arithmetic: Arithmetic, p: Jet) -> Jet:
    """Return p^2, with f and d1^2 as true squares."""
    if p.d1 is None:
        return Jet(arithmetic.square(p.f), None, None)
    d2 = arithmetic.square(p.d1)
    if p.d2 is not None:
        d2 = d2 + p.f * p.d2
    return Jet(arithmetic.square(p.f), 2 * (p.f * p.d1), 2 * d2)


class Motion:
    """Evaluates the walls along a flight while every law stays on one analytic piece."""

    def __init__(self, arithmetic: Arithmetic, flight: Flight, pieces: Pieces, *, is_stem: bool) -> None:
        self.arithmetic = arithmetic
        self.flight = flight
        self.pieces = pieces
        self.is_stem = is_stem

    def law(self, name: str, time: Interval) -> Jet:
        """Enclose a law and its derivatives over an interval of absolute time."""
        piece = self.pieces[name]
        number = self.arithmetic.number
        if isinstance(piece, Quadratic):
            u = time - number(piece.origin)
            c1, c2 = number(piece.c1), number(piece.c2)
            return Jet(number(piece.c0) + u * (c1 + u * c2), c1 + 2 * (c2 * u), 2 * c2)
        if isinstance(piece, Fourier):
            return self._fourier(piece, time)
        if isinstance(piece, Bounds):
            unknown = self.arithmetic.context.mpf([-1, 1])
            whole = self.arithmetic.context.mpf([piece.lowest, piece.highest])
            return Jet(whole, number(piece.slope) * unknown, number(piece.curvature) * unknown)
        return Jet(number(piece), None, None)

    def _fourier(self, law: Fourier, time: Interval) -> Jet:
        number = self.arithmetic.number
        f, d1, d2 = number(law.mean), self.arithmetic.zero, self.arithmetic.zero
        phase = number(law.omega) * time
        for k, a, b in law.harmonics():
            cos, sin = self.arithmetic.cos_sin(k * phase)
            frequency = k * number(law.omega)
            wave, quadrature = self.arithmetic.zero, self.arithmetic.zero
            if a:
                wave, quadrature = number(a) * cos, -(number(a) * sin)
            if b:
                wave, quadrature = wave + number(b) * sin, quadrature + number(b) * cos
            f = f + wave
            d1 = d1 + frequency * quadrature
            d2 = d2 - self.arithmetic.square(frequency) * wave
        return Jet(f, d1, d2)

    def width(self, time: Interval) -> Jet:
        """Enclose the half-width w of the mouth, w = nu r where nu is given."""
        if "nu" in self.pieces:
            return multiply(self.law("nu", time), self.law("r", time))
        return self.law("w", time)

    def wall(self, wall: Wall, s: Interval) -> Jet:
        """Enclose f, f', f'' of a wall over flight times s."""
        q, time = self.flight, self.flight.t + s
        y = Jet(q.y + q.vy * s, q.vy, None)
        if wall == "base":
            return negative(y) if self.is_stem else y
        if wall == "floor":
            return add(y, self.law("h", time))
        x = Jet(q.x + q.vx * s, q.vx, None)
        if wall == "arc":
            radius = square(self.arithmetic, self.law("r", time))
            return add(radius, negative(add(square(self.arithmetic, x), square(self.arithmetic, y))))
        side = negative(x) if wall == "right" else x
        return add(add(self.width(time), multiply(self.law("slope", time), y)), side)

    def gradient(self, wall: Wall, s: Interval) -> tuple[Interval, Interval, Interval]:
        """Enclose the partial derivatives of f by x, y and t at flight time s."""
        q, time = self.flight, self.flight.t + s
        one = self.arithmetic.number(1)
        zero = self.arithmetic.zero
        if wall == "base":
            return zero, -one if self.is_stem else one, zero
        if wall == "floor":
            return zero, one, self.law("h", time).d1 or zero
        if wall == "arc":
            r = self.law("r", time)
            f_t = zero if r.d1 is None else 2 * (r.f * r.d1)
            return -2 * (q.x + q.vx * s), -2 * (q.y + q.vy * s), f_t
        slope, y = self.law("slope", time), q.y + q.vy * s
        f_t = self.width(time).d1 or zero
        if slope.d1 is not None:
            f_t = f_t + slope.d1 * y
        return (-one if wall == "right" else one), slope.f, f_t

    def hessian(self, wall: Wall, s: Interval) -> tuple[Interval, Interval, Interval, Interval]:
        """Enclose f_xx, f_yy, f_yt and f_tt at flight time s; the other second partials are 0."""
        q, time = self.flight, self.flight.t + s
        zero = self.arithmetic.zero
        if wall == "base":
            return zero, zero, zero, zero
        if wall == "floor":
            return zero, zero, zero, self.law("h", time).d2 or zero
        if wall == "arc":
            two = self.arithmetic.number(-2)
            return two, two, zero, square(self.arithmetic, self.law("r", time)).d2 or zero
        slope = self.law("slope", time)
        f_tt = self.width(time).d2 or zero
        if slope.d2 is not None:
            f_tt = f_tt + slope.d2 * (q.y + q.vy * s)
        return zero, zero, slope.d1 or zero, f_tt
