"""Flights, laws and walls (sec. 2 of the paper) in Arb, written anew for `conformance.second_proof.step`.

Times, places and knots are exact rationals (fmpq), whatever is not rational is a ball (arb); both
compare with 0 only when that is certain.
"""

from __future__ import annotations

import itertools
from typing import Any

from flint import arb, fmpq

from scene import BangBang, Cap, Fourier, Law, Scene, Stem
from scene.tables import width_factors

MAX_SPLITS = 2000  # a near miss by 1e-300 takes half as many halvings as it has bits
Number = Any  # fmpq or arb
Jet = tuple[Number, Number, Number]  # f, f', f'' by flight time


def exact(number: float) -> fmpq:
    """Return the rational that a binary64 is."""
    return fmpq(*float(number).as_integer_ratio())


def ball(a: fmpq, b: fmpq) -> arb:
    """Return a ball that holds [a, b]."""
    return arb(a).union(arb(b))


def add(p: Jet, q: Jet) -> Jet:
    """Return p + q."""
    return p[0] + q[0], p[1] + q[1], p[2] + q[2]


def multiply(p: Jet, q: Jet) -> Jet:
    """Return p q."""
    return p[0] * q[0], p[1] * q[0] + p[0] * q[1], p[2] * q[0] + 2 * p[1] * q[1] + p[0] * q[2]


def negative(p: Jet) -> Jet:
    """Return -p."""
    return -p[0], -p[1], -p[2]


def law_jet(law: Law, time: Number, within: fmpq) -> Jet:
    """Return a law and its derivatives at `time`, on the analytic piece that holds `within`."""
    if isinstance(law, BangBang):
        return _leg(law, time, within)
    if not isinstance(law, Fourier):
        return exact(law), fmpq(0), fmpq(0)
    total: Jet = (exact(law.mean), fmpq(0), fmpq(0))
    n = max(len(law.cos), len(law.sin))
    omega = _frequency(law)
    for k, (a, b) in enumerate(zip(law.cos + (0.0,) * n, law.sin + (0.0,) * n, strict=False), 1):
        if not (a or b):
            continue
        frequency = k * omega
        if isinstance(time, fmpq) and time == 0:
            sin, cos = fmpq(0), fmpq(1)
        else:
            sin, cos = arb(frequency * time).sin_cos()
        wave = exact(a) * cos + exact(b) * sin
        total = add(
            total, (wave, frequency * (exact(b) * cos - exact(a) * sin), -frequency * frequency * wave)
        )
    return total


def _frequency(law: Fourier) -> Number:
    if law.period is not None:
        return 2 * arb.pi() / exact(law.period)
    assert law.omega is not None
    return exact(law.omega)


def _leg(law: BangBang, time: Number, within: fmpq) -> Jet:
    # v0 + (v1 - v0) 2 u^2 in the first half of a leg, u = (t - t0)/(t1 - t0); mirrored in the second.
    knots = [(exact(t), exact(v)) for t, v in law.knots]
    length = knots[-1][0] - knots[0][0]
    shift = ((within - knots[0][0]) / length).floor() * length
    i = max(k for k, knot in enumerate(knots[:-1]) if knot[0] + shift <= within)
    (t0, v0), (t1, v1) = knots[i], knots[i + 1]
    rate = 4 * (v1 - v0) / (t1 - t0) ** 2
    is_first_half = 2 * (within - shift) < t0 + t1
    origin, value, rate = (t0, v0, rate) if is_first_half else (t1, v1, -rate)
    u = time - origin - shift
    return value + rate * u * u / 2, rate * u, rate


def law_range(law: Law) -> tuple[Number, Number]:
    """Return bounds of all values of a law."""
    if isinstance(law, BangBang):
        values = [exact(v) for _, v in law.knots]
        return min(values), max(values)
    if isinstance(law, Fourier):
        n = max(len(law.cos), len(law.sin))
        swing = arb(0)
        for a, b in zip(law.cos + (0.0,) * n, law.sin + (0.0,) * n, strict=False):
            swing += arb(exact(a) ** 2 + exact(b) ** 2).sqrt()
        return exact(law.mean) - swing, exact(law.mean) + swing
    return exact(law), exact(law)


class Flight:
    """A straight flight and the walls along it."""

    def __init__(self, scene: Scene, state: dict[str, Any]) -> None:
        self.scene = scene
        self.t, self.x, self.y, self.vx, self.vy = (
            exact(state[name]) for name in ("t", "x", "y", "vx", "vy")
        )
        self.wall: str | None = state["wall"]
        self.residuals: dict[str, Number] = {}

    def leave(self, walls: tuple[str, ...]) -> None:
        """Take out f(0) of the wall the flight leaves: the one named, or one that is exactly met."""
        for wall in walls:
            f = self.jet(wall, fmpq(0), fmpq(0))[0]
            if wall == self.wall or f == 0:
                self.residuals[wall] = f

    def cuts(self, a: fmpq, b: fmpq) -> list[fmpq]:
        """List a, the flight times between a and b at which some law leaves a piece, and b."""
        found = {a, b}
        for name in ("r", "w", "nu", "h", "slope"):
            law = getattr(self.scene, name, None)
            if not isinstance(law, BangBang) or len({v for _, v in law.knots}) == 1:
                continue
            times = [exact(t) for t, _ in law.knots]
            length = times[-1] - times[0]
            times += [(p + q) / 2 for p, q in itertools.pairwise(times)]
            for time in times:
                turn = ((self.t + a - time) / length).floor() * length
                while (s := time + turn - self.t) < b:
                    found |= {s} if s > a else set()
                    turn += length
        return sorted(found)

    def law(self, name: str, s: Number, within: fmpq) -> Jet:
        """Return a law of the scene along the flight."""
        return law_jet(getattr(self.scene, name), self.t + s, self.t + within)

    def width(self, s: Number, within: fmpq) -> Jet:
        """Return w, or nu r."""
        assert not isinstance(self.scene, Cap)
        total: Jet = (fmpq(1), fmpq(0), fmpq(0))
        for law in width_factors(self.scene):
            total = multiply(total, law_jet(law, self.t + s, self.t + within))
        return total

    def jet(self, wall: str, s: Number, within: fmpq) -> Jet:
        """Return f, f', f'' of a wall at flight time s (a point or a ball), its residual removed."""
        x: Jet = (self.x + self.vx * s, self.vx, fmpq(0))
        y: Jet = (self.y + self.vy * s, self.vy, fmpq(0))
        if wall == "arc":
            r = self.law("r", s, within)
            f = add(multiply(r, r), negative(add(multiply(x, x), multiply(y, y))))
        elif wall == "floor":
            f = add(y, self.law("h", s, within))
        else:
            side = add(self.width(s, within), multiply(self.law("slope", s, within), y))
            f = add(side, x if wall == "left" else negative(x))
        return f[0] - self.residuals.get(wall, 0), f[1], f[2]

    def at(self, wall: str, s: fmpq) -> Jet:
        """Return f, f', f'' at one point, f'' of the piece after it."""
        return self.jet(wall, s, s)

    def over(self, wall: str, a: fmpq, b: fmpq) -> Jet:
        """Enclose f, f', f'' over [a, b], which lies on one piece."""
        return self.jet(wall, ball(a, b), (a + b) / 2)

    def is_never_swept(self, wall: str, a: fmpq, b: fmpq) -> bool:
        """Tell whether f > 0 on [a, b], whatever the laws do between their bounds.

        With laws held still f is concave in s, and linear in the slope: its least value is at ends.
        """
        return all(self._lowest(wall, s) > 0 for s in (a, b))

    def _lowest(self, wall: str, s: fmpq) -> Number:
        x, y = self.x + self.vx * s, self.y + self.vy * s
        if not isinstance(self.scene, Stem) and wall == "arc":
            lowest = law_range(self.scene.r)[0]
            return lowest * lowest - x * x - y * y
        assert not isinstance(self.scene, Cap)
        if wall == "floor":
            return y + law_range(self.scene.h)[0]
        lowest = fmpq(1)
        for law in width_factors(self.scene):
            lowest = lowest * law_range(law)[0]
        return lowest + law_range(self.scene.slope)[y < 0] * y + (x if wall == "left" else -x)

    def is_positive(self, wall: str, a: fmpq, b: fmpq) -> bool:
        """Tell whether f > 0 on [a, b], on one piece: as evaluated, by Taylor, or after splitting."""

        def holds(low: fmpq, high: fmpq) -> bool:
            whole, middle = self.over(wall, low, high), (low + high) / 2
            half = arb((high - low) / 2)
            f, slope, _ = self.jet(wall, middle, middle)
            taylor = f + slope * half * arb(0, 1) + whole[2] * half * half * arb(0.25, 0.25)
            return bool(whole[0] > 0) or bool(taylor > 0)

        return _everywhere(holds, a, b)

    def has_slope(self, sign: int, wall: str, a: fmpq, b: fmpq) -> bool:
        """Tell whether f' has this strict sign on [a, b], on one piece."""

        def holds(low: fmpq, high: fmpq) -> bool:
            whole, middle = self.over(wall, low, high), (low + high) / 2
            centred = self.jet(wall, middle, middle)[1] + whole[2] * arb((high - low) / 2) * arb(0, 1)
            return bool(sign * whole[1] > 0) or bool(sign * centred > 0)

        return _everywhere(holds, a, b)

    def is_concave(self, wall: str, a: fmpq, b: fmpq) -> bool:
        """Tell whether f'' <= 0 on [a, b], on one piece."""
        return _everywhere(lambda low, high: bool(self.over(wall, low, high)[2] <= 0), a, b)


def _everywhere(holds: Any, a: fmpq, b: fmpq) -> bool:
    todo = [(a, b)]
    for _ in range(MAX_SPLITS):
        if not todo:
            return True
        low, high = todo.pop()
        if not holds(low, high):
            middle = (low + high) / 2
            todo += [(middle, high), (low, middle)]
    return False
