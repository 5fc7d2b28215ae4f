"""A second opinion: re-prove a certificate of the reference in Arb, knowing nothing of the reference.

From scene and state alone it follows which walls can be met, and when: the arc in the cap, the
sides and the floor in the stem, the base or the mouth where the flight crosses y = 0. The
certificate only says where to cut and which sign to look for; each sign is proved here, with the
laws and walls of `generate_flight`.
Not checked: whether a state lies close enough to the wall it names.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import flint
from flint import arb, fmpq

from conformance.generate_flight import Flight, Number, ball, exact
from scene import BadInput, Cap, Mushroom, from_data

SIDES = ("left", "right", "floor")


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
    """List the lengths of all mantissas, and how far binary64 numbers reach from 1."""
    if isinstance(data, dict | list):
        for entry in data.values() if isinstance(data, dict) else data:
            yield from _bits(entry)
    elif isinstance(data, float):
        yield 53 + abs(math.frexp(data)[1])
    elif isinstance(data, str) and "*2^" in data:
        yield int(data.split("*")[0]).bit_length()


def dyadic(text: str) -> fmpq:
    """Read "m*2^e"."""
    mantissa, exponent = text.split("*2^")
    return fmpq(int(mantissa)) * fmpq(2) ** int(exponent)


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
        low, high = self._base_root() if self.wall == "base" else self._refined_root()
        cuts = self.flight.cuts(low, high)
        for a, b in itertools.pairwise(cuts) if low < high else [(low, high)]:
            self._bounce(a, b)

    def _stretches(self) -> list[Stretch]:
        """Say which walls can be met where, up to the claimed end of the flight."""
        in_cap = self._is_in_cap()
        near: tuple[str, ...] = ("arc",) if in_cap else SIDES
        far: tuple[str, ...] = SIDES if in_cap else ("arc",)
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
        if self.root is not None and (self.wall not in far or not crossing < self.root[0]):
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
        return all(self.flight.has_slope(-1, wall, *piece) for piece in itertools.pairwise(cuts))

    def _leaf(self, wall: str, a: fmpq, b: fmpq, kind: str) -> None:
        """Prove f > 0 on a sub-interval, in the way stated.

        Rounded ends may lie a little across a knot: the longest piece holds in the way stated.
        """
        if kind == "swept":
            if not self.flight.is_never_swept(wall, a, b):
                raise Refuted(f"{wall} may sweep [{float(a)!r}, {float(b)!r}]")
            return
        cuts = self.flight.cuts(a, b)
        pieces = list(itertools.pairwise(cuts))
        longest = max(pieces, key=lambda piece: piece[1] - piece[0])
        for low, high in pieces:
            is_sliver = (low, high) != longest
            holds = self._holds(wall, low, high, kind) or (
                is_sliver and self._holds(wall, low, high, "plain")
            )
            if not holds:
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
            return begins_well and self._bends_down(wall, a, b) and bool(flight.at(wall, b)[0] > 0)
        if kind == "lifting":
            is_flat = is_at_start and bool(flight.at(wall, a)[1] == 0)
            return is_flat and bool(flight.over(wall, a, b)[2] > 0)
        raise Refuted(f"no such kind: {kind}")

    def _bends_down(self, wall: str, a: fmpq, b: fmpq) -> bool:
        """Prove f'' <= 0 or, where f'' touches 0 and no ball can show its sign, f > 0 itself."""
        flight = self.flight
        if flight.is_concave(wall, a, b):
            return True
        instants = [a + (b - a) * fmpq(i, 16) for i in range(17)]
        is_convex_somewhere = any(bool(flight.over(wall, s, s)[2] > 0) for s in instants)
        if is_convex_somewhere:
            return False
        if a != 0 or wall not in flight.residuals:
            return flight.is_positive(wall, a, b)
        # From the wall itself, f = 0 at a: f rises at first, and is positive after that.
        rests = (a + (b - a) / 2**k for k in range(1, 60))
        rest = next((s for s in rests if flight.has_slope(1, wall, a, s)), b)
        return rest < b and flight.is_positive(wall, rest, b)

    def _base_root(self) -> tuple[fmpq, fmpq]:
        assert self.root is not None
        crossing = -self.flight.y / self.flight.vy
        if not self.root[0] <= crossing <= self.root[1]:
            raise Refuted("y = 0 is crossed at another time")
        return crossing, crossing

    def _refined_root(self) -> tuple[fmpq, fmpq]:
        """Prove that f falls through 0 within the root interval, once, and enclose it more tightly."""
        assert self.root is not None
        assert self.wall is not None
        (low, high), wall = self.root, self.wall
        if not (self.flight.at(wall, low)[0] > 0 and self.flight.at(wall, high)[0] < 0):
            raise Refuted("f does not change sign from + to - over the root interval")
        if not self._falls(wall, low, high):
            raise Refuted("f' is not negative throughout the root interval")
        for _ in range(flint.ctx.prec // 4):
            # The root itself may lie half way; then it does not lie at a third.
            for middle in ((low + high) / 2, (2 * low + high) / 3):
                f = self.flight.at(wall, middle)[0]
                if f > 0:
                    low = middle
                elif f < 0:
                    high = middle
                else:
                    continue
                break
        return low, high

    def _bounce(self, a: fmpq, b: fmpq) -> None:
        """Prove that the state after v - 2 f' grad f / |grad f|^2 is enclosed, met at [a, b]."""
        f, s, within = self.flight, ball(a, b), (a + b) / 2
        x, y = f.x + f.vx * s, f.y + f.vy * s
        if self.wall == "base":
            self._enclosed((f.t + s, x, fmpq(0), f.vx, -f.vy))
            return
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
