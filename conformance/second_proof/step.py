"""A second opinion: re-prove a certificate of the reference in Arb, knowing nothing of the reference.

From scene and state alone it follows which walls can be met, and when: the arc in the cap, the
sides and the floor in the stem, the base or the mouth where the flight crosses y = 0. The
certificate only says where to cut and which sign to look for; each sign is proved here, with the
laws and walls of `conformance.arb`. The steps of a trajectory are proved for every state of the box
that they start from (`trajectory`), undefined outcomes by exact zeros (`undefined`).
Not checked: whether a state lies close enough to the wall it names.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import reduce
from typing import Any, NamedTuple

import flint
from flint import arb, fmpq

from conformance.arb.flight import SIDES
from conformance.arb.numbers import ZERO, Number, exact, hull, interval, precision, rational_ends
from conformance.second_proof.exclusion import Exclusion, Refuted
from conformance.second_proof.signs import SignedFlight, flight_from
from conformance.second_proof.undefined import check_undefined
from scene import BadInput, Scene, Wall, from_data

__all__ = ["Refuted", "StepProof", "check", "opened"]

PARTS = (1, 16, 128)  # into how many a piece is cut, one after the other, until balls are thin enough


class WallStretch(NamedTuple):
    """Walls to exclude on [start, stop] of flight time."""

    walls: tuple[Wall, ...]
    start: fmpq
    stop: fmpq


@contextmanager
def opened(certificate: dict[str, Any]) -> Iterator[Scene]:
    """Work on a certificate's scene with enough bits.

    Raises:
        Refuted: the scene is none.
    """
    with precision(2 * max(_bits(certificate), default=128) + 128):
        try:
            scene = from_data(certificate["scene"])
        except BadInput as error:
            raise Refuted(str(error)) from None
        yield scene


def check(certificate: dict[str, Any]) -> None:
    """Prove a certificate's answer to one step again.

    Args:
        certificate: the plain data of `reference.certificate`, as it is or back from JSON.

    Raises:
        Refuted: saying what does not hold.
    """
    with opened(certificate) as scene:
        flight = flight_from(scene, certificate["state"])
        end = exact(certificate["t_end"]) - flight.line.t
        if certificate["outcome"] == "undefined":
            check_undefined(flight, certificate, end)
            return
        StepProof(flight, (ZERO, ZERO), certificate, end).check()


def _bits(data: Any) -> Iterator[int]:
    """List the lengths of all mantissas, and how far binary64 numbers reach from 1."""
    if isinstance(data, dict | list):
        for entry in data.values() if isinstance(data, dict) else data:
            yield from _bits(entry)
    elif isinstance(data, float):
        yield 53 + abs(math.frexp(data)[1])
    elif isinstance(data, str) and "*2^" in data:
        mantissa, exponent = map(int, data.split("*2^"))
        yield max(mantissa.bit_length(), abs(exponent) if exponent > 0 else 0)


class StepProof:
    """What a certificate claims about one flight.

    Args:
        flight: an exact one, or one of balls, then with its wall and residual.
        begin: the flight times between which it begins.
        claim: `outcome`, `wall`, `root`, `dt`, `after` and `excluded`.
        end: the horizon as flight time, None for none.
        is_exact: the flight starts from an exact state, whose residual is computed here.
    """

    def __init__(
        self,
        flight: SignedFlight,
        begin: tuple[fmpq, fmpq],
        claim: dict[str, Any],
        end: fmpq | None,
        *,
        is_exact: bool = True,
    ) -> None:
        self.flight, self.begin, self.end, self.is_exact = flight, begin, end, is_exact
        self.wall: Wall | None = claim["wall"]
        self.root, self.dt = (None if claim[key] is None else interval(claim[key]) for key in ("root", "dt"))
        self.after = {name: interval(ends) for name, ends in claim["after"].items()}
        self.exclusion = Exclusion(flight, begin, claim["excluded"])
        self.is_hit = claim["outcome"] == "collision"
        self.n_parts = PARTS[0]
        is_whole = all((part is not None) == self.is_hit for part in (self.root, self.dt, self.wall))
        if not is_whole or (end is not None and end < begin[0]) or (end is None and not self.is_hit):
            raise Refuted("not a certificate")

    def check(self) -> tuple[fmpq, fmpq] | None:
        """Prove that nothing is met earlier, that the wall is met, and the state that follows.

        Returns:
            The flight times between which the wall is met, as tightly as this arithmetic shows; None
            for a horizon.
        """
        for walls, start, stop in self._stretches():
            for wall in walls:
                until = self.root[0] if wall == self.wall and self.root is not None else stop
                self.exclusion.cover(wall, start, until, may_touch=self.root is None and stop == self.end)
        if not self.is_hit:
            line = self.flight.line
            at = (line.t + self.end, *self.flight.place(self.end), line.vx, line.vy)
            if (misplaced := self._misplaced(at)) is not None:
                raise Refuted(f"{misplaced} afterwards is not what was claimed")
            return None
        low, high = self._root_time()
        self._require_dt(low, high)
        for self.n_parts in PARTS:
            misplaced = self._misplaced(self.moment(low, high))
            if misplaced is None:
                return low, high
        raise Refuted(f"{misplaced} afterwards is not what was claimed")

    def _require_dt(self, low: fmpq, high: fmpq) -> None:
        assert self.dt is not None
        if not (self.dt[0] <= low - self.begin[1] and high - self.begin[0] <= self.dt[1]):
            raise Refuted("dt is not what was claimed")

    def _root_time(self) -> tuple[fmpq, fmpq]:
        assert self.root is not None
        assert self.wall is not None
        if self.wall == "base":
            low, high = self._crossing_time()
            if not (self.root[0] <= low and high <= self.root[1]):
                raise Refuted("y = 0 is crossed at another time")
            return low, high
        return self.exclusion.refined_root(self.wall, *self.root, flint.ctx.prec // 4)

    def _stretches(self) -> list[WallStretch]:
        """Say which walls can be met where, up to the claimed end of the flight."""
        f, in_cap, begin = self.flight, self.flight.begins_in_cap(), self.begin[0]
        near: tuple[Wall, ...] = ("arc",) if in_cap else SIDES
        far: tuple[Wall, ...] = SIDES if in_cap else ("arc",)
        if f.table.is_mushroom and f.wall is None and f.line.y == f.line.vy == 0:
            near = ("left", "right")
            if self.is_hit:
                raise Refuted("along the mouth no wall is hit")
        if self.is_exact:
            f.leave(near)
        is_crossing = self._is_crossing(in_cap)
        end = self.end if self.root is None else self.root[1]
        assert end is not None
        self._require_order()
        if self.wall == "base":
            if not is_crossing or (self.end is not None and not self._crossing_time()[1] < self.end):
                raise Refuted("y = 0 is not crossed before the horizon")
            self._require_closed(in_cap)
            return [WallStretch(near, begin, self._crossing_time()[1])]
        if not is_crossing or self._ends_before_crossing(end):
            if self.wall is not None and self.wall not in near:
                raise Refuted(f"{self.wall} cannot be met on this side of y = 0")
            return [WallStretch(near, begin, end)]
        low, high = self._crossing_time()
        if self.root is not None and (self.wall not in far or not high < self.root[0]):
            raise Refuted(f"{self.wall} cannot be met beyond y = 0, or not that early")
        self._require_open()
        return [WallStretch(near, begin, high), WallStretch(far, low, end)]

    def _require_order(self) -> None:
        if self.root is None or self.wall == "base":
            return
        if not self.begin[1] < self.root[0] < self.root[1]:
            raise Refuted("the root does not lie after the start")
        if self.end is not None and not self.root[1] < self.end:
            raise Refuted("the root does not lie before the horizon")

    def _ends_before_crossing(self, end: fmpq) -> bool:
        low, _ = self._crossing_time()
        return bool(end < low or (self.root is None and end == low))

    def _is_crossing(self, in_cap: bool) -> bool:
        """Tell whether the flight heads for y = 0, which it then crosses after it begins."""
        f, inward = self.flight, 1 if in_cap else -1
        y, vy = f.line.y, f.line.vy
        if f.wall == "base" or (y == 0 and not f.table.is_mushroom):
            if not inward * vy > 0:
                raise Refuted("the particle does not leave the base")
            return False
        if self.is_exact and (inward * y < 0 or (y == 0 and inward * vy < 0)):
            raise Refuted("the state is beyond y = 0")
        if not inward * vy < 0:
            if not inward * vy >= 0:
                raise Refuted("the sign of vy is open")
            return False
        if self._crossing_time()[0] <= self.begin[1] and not self.is_exact:
            raise Refuted("y = 0 may be crossed before the flight begins")
        return True

    def _crossing_time(self) -> tuple[fmpq, fmpq]:
        return rational_ends(-self.flight.line.y / self.flight.line.vy)

    def _parts(self, low: fmpq, high: fmpq, n_parts: int) -> list[tuple[fmpq, fmpq]]:
        """Cut [low, high] evenly: the ball of the whole may be too wide."""
        width = (high - low) / n_parts
        return [(low + i * width, low + (i + 1) * width) for i in range(n_parts if width else 1)]

    def _gaps(self, a: fmpq, b: fmpq) -> list[Number]:
        """Enclose the distances to the sides at y = 0, crossed within [a, b]."""
        f, s = self.flight, hull(a, b)
        w, x = f.width(s)[0], f.place(s)[0]
        return [w - x - f.residuals.get("right", ZERO), w + x - f.residuals.get("left", ZERO)]

    def _at_crossing(self, holds: Callable[[list[Number]], bool]) -> bool:
        """Tell whether the gaps have a property wherever within its enclosure the crossing is."""
        low, high = self._crossing_time()
        return any(
            all(holds(self._gaps(*part)) for part in self._parts(low, high, n_parts)) for n_parts in PARTS
        )

    def _require_open(self) -> None:
        if not self.flight.table.is_mushroom:
            raise Refuted("the base is closed: it is hit")
        if not self._at_crossing(_are_positive):
            raise Refuted("the mouth is not open where y = 0 is crossed")

    def _require_closed(self, in_cap: bool) -> None:
        table = self.flight.table
        if table.is_mushroom:
            if not in_cap:
                raise Refuted("from the stem no base is met")
            if not self._at_crossing(lambda gaps: any(gap < 0 for gap in gaps)):
                raise Refuted("the mouth is open where y = 0 is crossed")
        if table.is_stem and not self._at_crossing(_are_positive):
            raise Refuted("the top is crossed beside the stem")

    def moment(self, low: fmpq, high: fmpq) -> tuple[Number, ...]:
        """Return t, x, y, vx, vy after the wall is met at [low, high]."""
        assert self.wall is not None
        f, times = self.flight, [hull(*part) for part in self._parts(low, high, self.n_parts)]
        found = [(*f.place(s), *f.reflected(self.wall, s)) for s in times]
        x, y, vx, vy = (reduce(hull, numbers) for numbers in zip(*found, strict=True))
        return f.line.t + hull(low, high), x, ZERO if self.wall == "base" else y, vx, vy

    def _misplaced(self, moment: tuple[Number, ...]) -> str | None:
        """Return the name of a number that is not shown to lie where it is claimed; None when all do."""
        for name, number in zip(("t", "x", "y", "vx", "vy"), moment, strict=True):
            low, high = self.after[name]
            if not (arb(low) <= number and number <= arb(high)):
                return name
        return None


def _are_positive(numbers: list[Number]) -> bool:
    return all(number > 0 for number in numbers)
