"""Undefined outcomes, proved again: exact zeros of two wall functions at one rational instant.

A ball never proves an equality; rationals do. Wherever two walls are claimed to be met together,
both functions (less the residual of the wall being left) must be rational there and vanish, no other
wall may be met before, and each of the two for the first time.
"""

from __future__ import annotations

from typing import Any

from flint import fmpq

from conformance.arb.flight import SIDES
from conformance.arb.numbers import ZERO, Number, interval
from conformance.second_proof.exclusion import Exclusion, Refuted
from conformance.second_proof.signs import SignedFlight
from scene import Wall
from scene.laws import is_constant
from scene.tables import laws

START = (ZERO, ZERO)


def check_undefined(flight: SignedFlight, claim: dict[str, Any], end: fmpq) -> None:
    """Prove that a step has no answer.

    Args:
        flight: an exact one.
        claim: `reason`, `instant` (flight time as "p/q", or None), `walls`, `roots` and `excluded`.
        end: the horizon as flight time.

    Raises:
        Refuted: saying what does not hold.
    """
    undefined = _Undefined(flight, claim, end)
    if claim["instant"] is None:
        undefined.along_mouth()
    elif undefined.instant == 0:
        undefined.at_start()
    else:
        undefined.later()


class _Undefined:
    """What is claimed about a flight that ends nowhere."""

    def __init__(self, flight: SignedFlight, claim: dict[str, Any], end: fmpq) -> None:
        self.flight, self.end = flight, end
        self.reason: str = claim["reason"]
        self.walls: list[Wall] = claim["walls"]
        self.roots: dict[Wall, tuple[fmpq, fmpq]] = {
            wall: interval(ends) for wall, ends in claim["roots"].items()
        }
        self.excluded = claim["excluded"]
        self.instant = fmpq(*map(int, (claim["instant"] or "0/1").split("/")))

    def at_start(self) -> None:
        """Prove that the state lies on two walls, at the mouth's edge, or slides along one."""
        if not self.walls or not all(map(self._is_on, self.walls)):
            raise Refuted("the state is not shown to lie on these walls")
        self._require_inside()
        flight = self.flight
        is_edge = flight.table.is_mushroom and flight.line.y == 0 and {"left", "right"} & set(self.walls)
        if self.reason in ("corner", "mouth-edge"):
            if len(self.walls) < 2 and not is_edge:
                raise Refuted("the state lies on one wall only")
            self._require_reason("mouth-edge" if is_edge else "corner")
            return
        if len(self.walls) > 1:
            raise Refuted("a particle slides along one wall")
        (wall,) = self.walls
        _, slope, bend = flight.jet(wall, ZERO)
        if not slope == 0:
            raise Refuted("f' does not vanish at the start")
        if bend > 0 or not (bend <= 0):
            raise Refuted("f'' is not shown to let the particle rest on the wall")
        is_at_rest = all(is_constant(law) for law in laws(self.flight.table.scene).values())
        self._require_reason("sliding" if bend < 0 or is_at_rest or wall == "base" else "tangency")

    def _require_inside(self) -> None:
        """Prove that the state lies inside every other wall of its part of the table.

        Of a mouth as wide as the cap the edge is on the arc too, which need not be named.
        """
        f = self.flight
        is_beside = f.wall is None and "base" in self.walls
        in_cap = f.begins_in_cap() or (f.table.is_mushroom and is_beside)
        near: tuple[Wall, ...] = ("arc",) if in_cap else SIDES
        for wall in set(near) - set(self.walls):
            gap = f.jet(wall, ZERO)[0]
            if not (gap > 0 or (gap == 0 and self.reason == "mouth-edge")):
                raise Refuted(f"the state is not shown to be inside {wall}")

    def later(self) -> None:
        """Prove that two walls are met together, for the first time, and no other before."""
        f, s = self.flight, self.instant
        near: tuple[Wall, ...] = ("arc",) if f.begins_in_cap() else SIDES
        if not 0 < s < self.end:
            raise Refuted("the instant does not lie before the horizon")
        f.leave(near)
        if len(set(self.walls)) < 2:
            raise Refuted("one wall alone is met")
        crossing = -f.line.y / f.line.vy if f.line.vy != 0 and f.wall != "base" else None
        is_crossing = crossing is not None and crossing > 0
        if "base" in self.walls and not (is_crossing and crossing == s):
            raise Refuted("y = 0 is not crossed then")
        exclusion, begin = Exclusion(f, START, self.excluded), ZERO
        if crossing is not None and 0 < crossing < s:
            self._pass_mouth(exclusion, near, crossing)
            near, begin = (("arc",) if near == SIDES else SIDES), crossing
        for wall in set(self.walls) - {"base"}:
            if not f.jet(wall, s)[0] == 0:
                raise Refuted(f"{wall} is not shown to be met exactly then")
            if wall in near:
                self._require_first(exclusion, wall, begin)
            elif not ("base" in self.walls and wall in ("left", "right")):
                raise Refuted(f"{wall} cannot be met on this side of y = 0")
        for wall in set(near) - set(self.walls):
            exclusion.cover(wall, begin, s)
        is_edge = self.flight.table.is_mushroom and "base" in self.walls and "arc" not in self.walls
        self._require_reason("mouth-edge" if is_edge else "corner")

    def _pass_mouth(self, exclusion: Exclusion, near: tuple[Wall, ...], crossing: fmpq) -> None:
        """Prove that y = 0 is crossed within the mouth, before any wall is met."""
        f = self.flight
        if not f.table.is_mushroom:
            raise Refuted("y = 0 is crossed before")
        for wall in near:
            exclusion.cover(wall, ZERO, crossing)
        width, x = f.width(crossing)[0], f.place(crossing)[0]
        gaps: dict[Wall, Number] = {"left": width + x, "right": width - x}
        if not all(gap - f.residuals.get(wall, ZERO) > 0 for wall, gap in gaps.items()):
            raise Refuted("the mouth is not open where y = 0 is crossed")

    def along_mouth(self) -> None:
        """Prove that a path along y = 0 inside the mouth comes to its edge."""
        f = self.flight
        if not (f.table.is_mushroom and f.wall is None and f.line.y == f.line.vy == 0 and self.roots):
            raise Refuted("not a path along the mouth")
        self._require_reason("mouth-edge")
        sides: tuple[Wall, ...] = ("left", "right")
        f.leave(sides)
        if f.residuals:
            raise Refuted("the path begins at the mouth's edge")
        exclusion = Exclusion(f, START, self.excluded)
        ends = [exclusion.refined_root(wall, *self._lead(exclusion, wall, ZERO), 0)[1] for wall in self.roots]
        if not min(ends) < self.end:
            raise Refuted("the edge is not met before the horizon")
        for wall in sides:
            if wall not in self.roots:
                exclusion.cover(wall, ZERO, min(ends))

    def _lead(self, exclusion: Exclusion, wall: Wall, begin: fmpq) -> tuple[fmpq, fmpq]:
        exclusion.cover(wall, begin, self.roots[wall][0])
        return self.roots[wall]

    def _require_first(self, exclusion: Exclusion, wall: Wall, begin: fmpq) -> None:
        """Prove that the exact zero is the first root: f > 0 up to an interval on which f falls, once."""
        if wall not in self.roots or not self.roots[wall][0] <= self.instant <= self.roots[wall][1]:
            raise Refuted(f"{wall} has no root claimed around the instant")
        exclusion.refined_root(wall, *self._lead(exclusion, wall, begin), 0)

    def _require_reason(self, reason: str) -> None:
        if self.reason != reason:
            raise Refuted(f"the reason is {reason}")

    def _is_on(self, wall: Wall) -> bool:
        """Tell whether the state is on a wall: it names it, or lies on it exactly."""
        f = self.flight
        if wall == f.wall:
            return True
        is_met = bool(f.jet(wall, ZERO)[0] == 0)
        if wall == "base" and f.table.is_mushroom and f.wall is None:
            # The base is beside the mouth only.
            return is_met and any(f.jet(side, ZERO)[0] < 0 for side in ("left", "right"))
        return is_met
