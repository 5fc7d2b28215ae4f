"""A second opinion: re-prove a certificate of the reference in Arb, knowing nothing of the reference.

From scene and state alone it follows which walls can be met, and when: the arc in the cap, the
sides and the floor in the stem, the base or the mouth where the flight crosses y = 0. The
certificate only says where to cut and which sign to look for; each sign is proved here, with laws
and walls (sec. 2 of the paper) written anew. Times, places and knots are exact rationals (fmpq),
whatever is not rational is a ball (arb); both compare with 0 only when that is certain.
Not checked: whether a state lies close enough to the wall it names.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import flint
from flint import arb, fmpq

from scene import BadInput, BangBang, Cap, Fourier, Law, Mushroom, Scene, Stem, from_data
from scene.tables import width_factors

SIDES = ("left", "right", "floor")
MAX_SPLITS = 400
Number = Any  # fmpq or arb
Jet = tuple[Number, Number, Number]  # f, f', f'' by flight time


class Refuted(AssertionError):  # noqa: N818 (a verdict, not an error)
    """The certificate does not prove its answer, for this reason."""


class Stretch(NamedTuple):
    """Walls to exclude on [start, stop] of flight time."""

    walls: tuple[str, ...]
    start: fmpq
    stop: fmpq


@contextmanager
def precision(bits: int) -> Iterator[None]:
    """Work with balls of this many bits, then restore flint's own."""
    before = flint.ctx.prec
    flint.ctx.prec = bits
    try:
        yield
    finally:
        flint.ctx.prec = before


def check(certificate: dict[str, Any]) -> None:
    """Prove a certificate's answer again.

    Args:
        certificate: the plain data of `reference.certificate`, as it is or back from JSON.

    Raises:
        Refuted: saying what does not hold.
    """
    with precision(2 * max(_bits(certificate), default=128) + 128):
        try:
            scene = from_data(certificate["scene"])
        except BadInput as error:
            raise Refuted(str(error)) from None
        flight = Flight(scene, certificate["state"])
        _Proof(flight, certificate).check()


def _bits(data: Any) -> Iterator[int]:
    """List the lengths of all mantissas."""
    if isinstance(data, dict | list):
        for entry in data.values() if isinstance(data, dict) else data:
            yield from _bits(entry)
    elif isinstance(data, str) and "*2^" in data:
        yield int(data.split("*")[0]).bit_length()


def exact(number: float) -> fmpq:
    """Return the rational that a binary64 is."""
    return fmpq(*float(number).as_integer_ratio())


def dyadic(text: str) -> fmpq:
    """Read "m*2^e"."""
    mantissa, exponent = text.split("*2^")
    return fmpq(int(mantissa)) * fmpq(2) ** int(exponent)


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
    for k, (a, b) in enumerate(zip(law.cos + (0.0,) * n, law.sin + (0.0,) * n, strict=False), 1):
        if not (a or b):
            continue
        frequency = k * exact(law.omega)
        if isinstance(time, fmpq) and time == 0:
            sin, cos = fmpq(0), fmpq(1)
        else:
            sin, cos = arb(frequency * time).sin_cos()
        wave = exact(a) * cos + exact(b) * sin
        total = add(total, (wave, frequency * (exact(b) * cos - exact(a) * sin), -frequency * frequency * wave))
    return total


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


def law_range(law: Law) -> arb:
    """Return a ball that holds all values of a law."""
    if isinstance(law, BangBang):
        values = [exact(v) for _, v in law.knots]
        return ball(min(values), max(values))
    if isinstance(law, Fourier):
        n = max(len(law.cos), len(law.sin))
        swing = arb(0)
        for a, b in zip(law.cos + (0.0,) * n, law.sin + (0.0,) * n, strict=False):
            swing += arb(exact(a) ** 2 + exact(b) ** 2).sqrt()
        return exact(law.mean) + swing * arb(0, 1)
    return arb(exact(law))


class Flight:
    """A straight flight and the walls along it."""

    def __init__(self, scene: Scene, state: dict[str, Any]) -> None:
        self.scene = scene
        self.t, self.x, self.y, self.vx, self.vy = (exact(state[name]) for name in ("t", "x", "y", "vx", "vy"))
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
            if not isinstance(law, BangBang):
                continue
            times = [exact(t) for t, _ in law.knots]
            length = times[-1] - times[0]
            times += [(p + q) / 2 for p, q in zip(times, times[1:], strict=False)]
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

    def swept(self, wall: str, a: fmpq, b: fmpq) -> Number:
        """Enclose f over [a, b], whatever the laws do between their bounds."""
        s = ball(a, b)
        x, y = self.x + self.vx * s, self.y + self.vy * s
        if not isinstance(self.scene, Stem) and wall == "arc":
            lowest = law_range(self.scene.r).lower()
            return lowest * lowest - x * x - y * y
        assert not isinstance(self.scene, Cap)
        if wall == "floor":
            return y + law_range(self.scene.h)
        width = arb(1)
        for law in width_factors(self.scene):
            width = width * law_range(law)
        return width + law_range(self.scene.slope) * y + (x if wall == "left" else -x)

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


class _Proof:
    """What a certificate claims about a flight."""

    def __init__(self, flight: Flight, certificate: dict[str, Any]) -> None:
        self.flight = flight
        self.wall: str | None = certificate["wall"]
        self.root = None if certificate["dt"] is None else tuple(dyadic(end) for end in certificate["dt"])
        self.after = {name: tuple(map(dyadic, ends)) for name, ends in certificate["after"].items()}
        self.excluded = certificate["excluded"]
        self.end = exact(certificate["t_end"]) - flight.t
        self.is_hit = certificate["outcome"] == "collision"
        if self.is_hit != (self.root is not None) or self.is_hit != (self.wall is not None) or self.end < 0:
            raise Refuted("not a certificate")

    def check(self) -> None:
        """Prove that nothing is met earlier, that the wall is met, and the state that follows."""
        for walls, start, stop in self._stretches():
            for wall in walls:
                self._cover(wall, start, stop)
        if not self.is_hit:
            f = self.flight
            at = (f.t + self.end, f.x + f.vx * self.end, f.y + f.vy * self.end, f.vx, f.vy)
            self._enclosed(at)
            return
        self._bounce(self._base_root() if self.wall == "base" else self._refined_root())

    def _stretches(self) -> list[Stretch]:
        """Say which walls can be met where, up to the claimed end of the flight."""
        in_cap = self._is_in_cap()
        near, far = (("arc",), SIDES) if in_cap else (SIDES, ("arc",))
        is_along_mouth = isinstance(self.flight.scene, Mushroom) and self.flight.y == self.flight.vy == 0
        if is_along_mouth and self.flight.wall is None:
            near = ("left", "right")
            if self.is_hit:
                raise Refuted("along the mouth no wall is hit")
        self.flight.leave(near)
        crossing = self._crossing(in_cap)
        end = self.end if self.root is None else self.root[1]
        if self.root is not None and not 0 < self.root[0] < end < self.end and self.wall != "base":
            raise Refuted("the root does not lie before the horizon")
        if self.wall == "base":
            if crossing is None or not crossing < self.end:
                raise Refuted("y = 0 is not crossed before the horizon")
            self._require_closed(crossing, in_cap)
            return [Stretch(near, fmpq(0), crossing)]
        if crossing is None or end < crossing or (self.root is None and end == crossing):
            if self.wall is not None and self.wall not in near:
                raise Refuted(f"{self.wall} cannot be met on this side of y = 0")
            return [Stretch(near, fmpq(0), end)]
        if self.wall is not None and (self.wall not in far or not crossing < self.root[0]):
            raise Refuted(f"{self.wall} cannot be met beyond y = 0, or not that early")
        self._require_open(crossing)
        return [Stretch(near, fmpq(0), crossing), Stretch(far, crossing, end)]

    def _is_in_cap(self) -> bool:
        f = self.flight
        if not isinstance(f.scene, Mushroom):
            return isinstance(f.scene, Cap)
        return f.wall in ("arc", "base") or (f.wall is None and (f.y > 0 or (f.y == 0 and f.vy > 0)))

    def _crossing(self, in_cap: bool) -> fmpq | None:
        f, inward = self.flight, 1 if in_cap else -1
        is_on_base = f.wall == "base" or (f.y == 0 and not isinstance(f.scene, Mushroom))
        if is_on_base:
            if not inward * f.vy > 0:
                raise Refuted("the particle does not leave the base")
            return None
        if inward * f.y < 0 or (f.y == 0 and inward * f.vy < 0):
            raise Refuted("the state is beyond y = 0")
        return -f.y / f.vy if inward * f.vy < 0 else None

    def _gaps(self, crossing: fmpq) -> tuple[Number, Number]:
        f, w = self.flight, self.flight.width(crossing, crossing)[0]
        x = f.x + f.vx * crossing
        return w - x, w + x

    def _require_open(self, crossing: fmpq) -> None:
        if not isinstance(self.flight.scene, Mushroom):
            raise Refuted("the base is closed: it is hit")
        if not all(gap > 0 for gap in self._gaps(crossing)):
            raise Refuted("the mouth is not open where y = 0 is crossed")

    def _require_closed(self, crossing: fmpq, in_cap: bool) -> None:
        if isinstance(self.flight.scene, Mushroom):
            if not in_cap:
                raise Refuted("from the stem no base is met")
            if not any(gap < 0 for gap in self._gaps(crossing)):
                raise Refuted("the mouth is open where y = 0 is crossed")

    def _cover(self, wall: str, start: fmpq, stop: fmpq) -> None:
        """Prove f > 0 on [start, stop], or up to the claimed root of this wall."""
        if wall == self.wall and self.root is not None:
            stop = self.root[0]
        reached = start
        for low, high, kind in self.excluded.get(wall, []):
            a, b = max(dyadic(low), reached), min(dyadic(high), stop)
            if dyadic(low) > reached and reached < stop:
                break
            if a < b:
                self._leaf(wall, a, b, kind)
                reached = b
        if reached < stop and not self._touches(wall, reached, stop):
            raise Refuted(f"{wall} is not excluded from {float(reached)!r} on")

    def _touches(self, wall: str, a: fmpq, b: fmpq) -> bool:
        """Tell whether f falls to exactly 0 at the horizon: met there, not before."""
        is_at_end = self.root is None and b == self.end
        return is_at_end and bool(self.flight.at(wall, b)[0] == 0) and self._falls(wall, a, b)

    def _falls(self, wall: str, a: fmpq, b: fmpq) -> bool:
        cuts = self.flight.cuts(a, b)
        return all(self.flight.has_slope(-1, wall, *piece) for piece in zip(cuts, cuts[1:], strict=False))

    def _leaf(self, wall: str, a: fmpq, b: fmpq, kind: str) -> None:
        """Prove f > 0 on a sub-interval, in the way stated.

        Rounded ends may lie a little across a knot: the way is that of the longest analytic piece.
        """
        if kind == "swept":
            if not self.flight.swept(wall, a, b) > 0:
                raise Refuted(f"{wall} may sweep [{float(a)!r}, {float(b)!r}]")
            return
        cuts = self.flight.cuts(a, b)
        pieces = list(zip(cuts, cuts[1:], strict=False))
        longest = max(pieces, key=lambda piece: piece[1] - piece[0])
        for low, high in pieces:
            if not self._holds(wall, low, high, kind if (low, high) == longest else "plain"):
                raise Refuted(f"{wall} is not excluded, {kind}, on [{float(low)!r}, {float(high)!r}]")

    def _holds(self, wall: str, a: fmpq, b: fmpq, kind: str) -> bool:
        flight = self.flight
        is_at_start = a == 0 and wall in flight.residuals
        begins_well = is_at_start or bool(flight.at(wall, a)[0] > 0)
        if kind in ("plain", "centred"):
            return flight.is_positive(wall, a, b)
        if kind == "rising":
            return begins_well and flight.has_slope(1, wall, a, b)
        if kind == "falling":
            return flight.has_slope(-1, wall, a, b) and bool(flight.at(wall, b)[0] > 0)
        if kind == "concave":
            return begins_well and flight.is_concave(wall, a, b) and bool(flight.at(wall, b)[0] > 0)
        if kind == "lifting":
            is_flat = is_at_start and bool(flight.at(wall, a)[1] == 0)
            return is_flat and bool(flight.over(wall, a, b)[2] > 0)
        raise Refuted(f"no such kind: {kind}")

    def _base_root(self) -> arb:
        assert self.root is not None
        crossing = -self.flight.y / self.flight.vy
        if not self.root[0] <= crossing <= self.root[1]:
            raise Refuted("y = 0 is crossed at another time")
        return arb(crossing)

    def _refined_root(self) -> arb:
        """Prove that f falls through 0 within the root interval, once, and enclose it more tightly."""
        assert self.root is not None
        assert self.wall is not None
        (low, high), wall = self.root, self.wall
        if not (self.flight.at(wall, low)[0] > 0 and self.flight.at(wall, high)[0] < 0):
            raise Refuted("f does not change sign from + to - over the root interval")
        if not self._falls(wall, low, high):
            raise Refuted("f' is not negative throughout the root interval")
        for _ in range(flint.ctx.prec // 4):
            middle = (low + high) / 2
            f = self.flight.at(wall, middle)[0]
            if not (f > 0 or f < 0):
                break
            low, high = (middle, high) if f > 0 else (low, middle)
        return ball(low, high)

    def _bounce(self, s: arb) -> None:
        """Prove that the state after v - 2 f' grad f / |grad f|^2 is enclosed."""
        f = self.flight
        x, y = f.x + f.vx * s, f.y + f.vy * s
        if self.wall == "base":
            self._enclosed((f.t + s, x, fmpq(0), f.vx, -f.vy))
            return
        assert self.root is not None
        within = (self.root[0] + self.root[1]) / 2
        gradient: tuple[Number, Number] = (fmpq(0), fmpq(1))
        if self.wall == "arc":
            gradient = (-2 * x, -2 * y)
        elif self.wall != "floor":
            gradient = (fmpq(1 if self.wall == "left" else -1), f.law("slope", s, within)[0])
        factor = 2 * f.jet(str(self.wall), s, within)[1] / (gradient[0] ** 2 + gradient[1] ** 2)
        self._enclosed((f.t + s, x, y, f.vx - factor * gradient[0], f.vy - factor * gradient[1]))

    def _enclosed(self, moment: tuple[Number, ...]) -> None:
        for name, number in zip(("t", "x", "y", "vx", "vy"), moment, strict=True):
            low, high = self.after[name]
            if not (arb(low) <= number and number <= arb(high)):
                raise Refuted(f"{name} afterwards is not what was claimed")
