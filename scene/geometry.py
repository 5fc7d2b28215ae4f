"""The geometry of a table at one instant.

Half width, areas, outline, walls and normals, defined once.

Plots, random starts, strategies, profiles and the generator of questions share these definitions.
Steppers, verifier and theory define their own walls and volumes, so that an error here cannot hide
in all of them.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from mpmath import fp

from scene.laws import Constant
from scene.precision import decimals, reduce_record
from scene.states import ON_WALL, State
from scene.tables import Cap, Scene, Stem, Wall

DIGITS = 50  # to which `rounded` evaluates laws before it rounds them


class TableAt(NamedTuple):
    """A table at one instant: its parameters and their rates, numbers of one number system.

    Attributes:
        scene: the table and its laws.
        r, w, h: radius, half width of the mouth (of a stem's top), depth [length]; 0 where there is
            none.
        slope: of the stem's sides, tan(theta).
        r_rate, w_rate, h_rate: [length/time].
        slope_rate: [1/time].
    """

    scene: Scene
    r: Any
    w: Any
    h: Any
    slope: Any
    r_rate: Any
    w_rate: Any
    h_rate: Any
    slope_rate: Any

    def __reduce__(self) -> tuple[Any, ...]:
        """Tell pickle and copy how to keep every bit."""
        return reduce_record(self)

    @property
    def size(self) -> Any:
        """Return a length [length] that no chord exceeds, except in a stem that is wider below."""
        return 2 * self.r + 2 * self.w + self.h

    def cap_area(self) -> Any:
        """Return the area of the half disk [length^2], 0 in a stem."""
        return 0.5 * math.pi * self.r * self.r

    def stem_area(self) -> Any:
        """Return the area of the trapezoid [length^2], 0 in a cap."""
        return 2.0 * self.w * self.h - self.slope * self.h * self.h

    def half_width(self, y: Any) -> Any:
        """Return half of the stem's width [length] at height -h <= y <= 0."""
        return self.w + self.slope * y

    def gap(self, wall: Wall, x: Any, y: Any) -> Any:
        """Return a wall's function f, positive inside [length; the arc's: length^2]."""
        if wall == "arc":
            return self.r * self.r - x * x - y * y
        if wall == "floor":
            return y + self.h
        if wall == "base":
            return -y if isinstance(self.scene, Stem) else y
        return self.half_width(y) + (x if wall == "left" else -x)

    def nearest_wall(self, x: float, y: float, but: Wall | None = None) -> Wall:
        """Return the wall nearest to a place, `but` left out.

        The distance is |f| / |grad f|. Beyond the ends of a wall it is larger.
        """
        above = max(0.0, y)
        below = max(0.0, -y)
        distances: dict[Wall, float] = {}
        if not isinstance(self.scene, Stem):
            distances["arc"] = abs(self.r - math.hypot(x, y)) + below
        if not isinstance(self.scene, Cap):
            steep = math.sqrt(1 + self.slope * self.slope)
            distances["left"] = abs(self.half_width(y) + x) / steep + above
            distances["right"] = abs(self.half_width(y) - x) / steep + above
            distances["floor"] = abs(y + self.h)
        is_open = not isinstance(self.scene, Cap | Stem)
        distances["base"] = abs(y) + (max(0.0, self.w - abs(x)) if is_open else 0.0)
        return min((wall for wall in distances if wall != but), key=lambda wall: distances[wall])

    def gap_rate(self, wall: Wall, x: Any, y: Any, vx: Any, vy: Any) -> Any:
        """Return d f / dt along a flight at (x, y) with velocity (vx, vy)."""
        if wall == "arc":
            return 2 * (self.r * self.r_rate - x * vx - y * vy)
        if wall == "floor":
            return vy + self.h_rate
        if wall == "base":
            return -vy if isinstance(self.scene, Stem) else vy
        rate = self.w_rate + self.slope_rate * y + self.slope * vy
        return rate + (vx if wall == "left" else -vx)

    def normal(self, wall: Wall, x: float, y: float) -> tuple[float, float]:
        """Return a wall's inward unit normal at one of its points, in binary64."""
        if wall == "arc":
            distance = math.sqrt(x * x + y * y)
            return -x / distance, -y / distance
        if wall in ("base", "floor"):
            return 0.0, -1.0 if wall == "base" and isinstance(self.scene, Stem) else 1.0
        length = math.sqrt(1 + self.slope * self.slope)
        return (1.0 if wall == "left" else -1.0) / length, self.slope / length

    def receding(self, wall: Wall, y: float) -> float:
        """Return minus the velocity of a wall along its inward normal at y [length/time]."""
        if wall == "arc":
            return float(self.r_rate)
        if wall in ("base", "floor"):
            return 0.0 if wall == "base" else float(self.h_rate)
        return float((self.w_rate + self.slope_rate * y) / math.sqrt(1 + self.slope * self.slope))

    def stem_point(self, site: str, across: float, depth: float) -> tuple[float, float]:
        """Return a point of the stem.

        Args:
            site: "mouth" or "base" (the top), "floor", "left", "right", or "stem" for the inside.
            across: from -1 at the left side to 1 at the right one; a side ignores it.
            depth: from 0 at the top to 1 at the floor; top and floor ignore it.
        """
        if site in ("mouth", "base"):
            return self.w * across, 0.0
        if site == "floor":
            return across * self.half_width(-self.h), -self.h
        y = -self.h * depth
        return self.half_width(y) * {"left": -1.0, "right": 1.0}.get(site, across), y

    def corners(self, region: str) -> list[tuple[float, float]]:
        """List where two walls of the "cap" or of the "stem" meet, and the mouth's edges."""
        half = [(self.half_width(-self.h), -self.h)] if region == "stem" else [(self.r, 0.0)]
        if not isinstance(self.scene, Cap):
            half.append((self.w, 0.0))
        return [(side * x, y) for x, y in half for side in (1.0, -1.0)]

    def uniform_in_stem(self, a: Any, b: Any) -> tuple[Any, Any]:
        """Turn pairs of uniform numbers into points uniform in the stem's area.

        Args:
            a: shape (n,), uniform in [0, 1): the share of the stem's area above the point.
            b: shape (n,), uniform in [0, 1): the place across, from left to right.

        Returns:
            (x, depth), each of shape (n,) [length]; the points are (x, -depth). All 0 in a cap.
        """
        # At depth d the stem is 2 (w - slope d) wide: solve 2 w d - slope d^2 = a area for d.
        w = self.w
        slope = self.slope
        area = self.stem_area()
        depth = a * area / (w + np.sqrt(np.maximum(w * w - slope * a * area, 0.0)) + 1e-300)
        return (w - slope * depth) * (2.0 * b - 1.0), depth

    def outline(self, n_arc: int = 180) -> list[list[tuple[float, float]]]:
        """Return the walls as lines through points (x, y) [length].

        A mushroom's mouth is left open.
        """
        r, w, foot, h = map(float, (self.r, self.w, self.half_width(-self.h), self.h))
        lines = []
        if not isinstance(self.scene, Stem):
            angles = [math.pi * k / n_arc for k in range(n_arc + 1)]
            lines.append(
                [(w, 0.0), *((r * math.cos(a), r * math.sin(a)) for a in angles), (-w, 0.0)]
            )
        if not isinstance(self.scene, Cap):
            lines.append([(-w, 0.0), (-foot, -h), (foot, -h), (w, 0.0)])
        if isinstance(self.scene, Stem):
            lines.append([(-w, 0.0), (w, 0.0)])
        return lines


def table_at(ctx: Any, scene: Scene, t: Any) -> TableAt:
    """Evaluate a table at time t in mpmath's `fp` or in numbers of `scene.precision.decimals`.

    With `fp` t may be an array of times: what moves is then an array, too.
    """
    known = {**scene.laws, "w": scene.width}
    laws = [known.get(name, Constant(0.0)) for name in ("r", "w", "h", "slope")]
    return TableAt(scene, *(law.value(ctx, t, order) for order in (0, 1) for law in laws))


def rounded(scene: Scene, t: float) -> TableAt:
    """Evaluate a table to DIGITS digits and round once.

    The same binary64 numbers on every machine.
    """
    _, *numbers = table_at(decimals(DIGITS), scene, t)
    return TableAt(scene, *map(float, numbers))


def placed(scene: Scene, state: State, wall: Wall, how: str) -> str:
    """Say how far a state is from a wall that it does not name, and what to do about it.

    Args:
        scene: the table.
        state: in it.
        wall: not the state's own.
        how: "beyond" or "within rounding of".
    """
    ctx = decimals(DIGITS)
    table = table_at(ctx, scene, state.t)
    x = ctx.mpf(state.x)
    y = ctx.mpf(state.y)
    away = abs(table.gap(wall, x, y)) / (table.r + ctx.hypot(x, y) if wall == "arc" else 1)
    is_after_a_hit = state.wall is None and away <= ON_WALL * table.size
    hint = f": name the wall that is left (state.wall = {wall!r})" if is_after_a_hit else ""
    where = f"state (x, y) = ({state.x!r}, {state.y!r}) at t = {state.t!r}"
    return f"{where} is {how} wall {wall}, off it by {float(away):.3g}{hint}"


def area(scene: Scene, t: float) -> float:
    """Return the area of a table at time t [length^2]."""
    now = table_at(fp, scene, t)
    return float(now.cap_area() + now.stem_area())
