"""Derivatives of a step, by pushing each of the five inputs through it.

With the input moved by e, the wall's function at the hit, f(s) - f(0) for the wall being left, moves by df at
fixed s: the hit then moves by ds = -df / f'. Place, f' and the wall's gradient at the hit follow by the chain
rule. At a knot f'' jumps: where the hit's time touches several pieces, the balls hold the derivatives of all.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from flint import arb

from conformance.arb.flight import BallFlight
from conformance.arb.numbers import Ball, Number, product
from scene import Wall


class Partials(NamedTuple):
    """Derivatives of f(x, y, t) that are not 0 for every wall."""

    fx: Number
    fy: Number
    ft: Number
    fxx: Number
    fyy: Number
    fyt: Number
    ftt: Number


def partials(flight: BallFlight, wall: Wall, s: Ball) -> Partials:
    """Enclose the partial derivatives of a wall's function along the flight."""
    none = arb(0)
    fx, fy = flight.gradient(wall, s)
    if wall == "base":
        return Partials(fx, fy, none, none, none, none, none)
    if wall == "floor":
        _, rate, bend = flight.law("h", s)
        return Partials(fx, fy, rate, none, none, none, bend)
    if wall == "arc":
        r = flight.law("r", s)
        _, rate, bend = product(r, r)
        return Partials(fx, fy, rate, arb(-2), arb(-2), none, bend)
    y = flight.place(s)[1]
    _, rate, bend = flight.width(s)
    _, tilting, turning = flight.law("slope", s)
    return Partials(fx, fy, rate + tilting * y, none, none, tilting, bend + turning * y)


def jacobian(flight: BallFlight, wall: Wall, s: Ball) -> tuple[tuple[Any, ...], ...]:
    """Enclose d(dt, x, y, vx, vy) / d(t, x, y, vx, vy) of a step that hits `wall` at s."""
    p, line = partials(flight, wall, s), flight.balls
    origin = partials(flight, wall, arb(0)) if wall in flight.residuals else None
    rate = p.ft + p.fx * line.vx + p.fy * line.vy
    size = p.fx * p.fx + p.fy * p.fy
    columns = []
    for i in range(5):
        dt, dx, dy, dvx, dvy = (arb(1 if i == j else 0) for j in range(5))
        mx, my = dx + s * dvx, dy + s * dvy
        df = p.fx * mx + p.fy * my + p.ft * dt
        if origin is not None:
            df -= origin.fx * dx + origin.fy * dy + origin.ft * dt
        ds = -df / rate
        mx, my, mt = mx + line.vx * ds, my + line.vy * ds, dt + ds
        dfx, dfy, dft = p.fxx * mx, p.fyy * my + p.fyt * mt, p.fyt * my + p.ftt * mt
        drate = dft + dfx * line.vx + p.fx * dvx + dfy * line.vy + p.fy * dvy
        dsize = 2 * (p.fx * dfx + p.fy * dfy)
        push = 2 * rate / size
        dpush = 2 * drate / size - push * dsize / size
        dvx, dvy = dvx - dpush * p.fx - push * dfx, dvy - dpush * p.fy - push * dfy
        columns.append((ds, mx, arb(0) if wall == "base" else my, dvx, dvy))
    return tuple(zip(*columns, strict=True))
