"""The kit with an engine that knows a table only as an implicit domain, as general billiard codes do.

    mushrooms check -- python implicit.py

A table is where phi(t, x, y) > 0, and every wall is a part of phi = 0. With a = r^2 - x^2 - y^2 for the arc,
b = y for the base, and c = min(w + slope y - |x|, y + h) for sides and floor,

    mushroom   phi = max(min(a, b), d),  d = min(a, c) above the mouth, c below it
    cap        phi = min(a, b)           stem   phi = min(-b, c)

The stem is carried on above the mouth, up to the arc. Without that, max(min(a, b), min(-b, c)) would vanish
on the mouth too, and make it a wall; cut off by the arc below the mouth as well, it would lose its corners
when w is near r. Each f is positive for as long as the parabola with the largest curvature allowed; the
same min and max of these times are a time in which phi is positive. Such steps walk up to the first wall and
never past it. Where one wall must be crossed and no other can be, Newton steps find the crossing, the last
of them in forty digits: in a short flight the difference of two nearly equal f has lost its own.

On the wall that the particle leaves f(0) is rounding, and is taken out of f.
"""

from __future__ import annotations

import math

from mpmath import fp

from conformance.harness.kit import Hit, Open, serve_engine
from scene import Cap, Mushroom, Scene, State, Wall
from scene.geometry import TableAt, table_at
from scene.laws import Bounds, bounds
from scene.precision import decimals
from scene.tables import laws

STEM: tuple[Wall, ...] = ("left", "right", "floor")
SHORT = 1 - 2.0**-6  # of a safe step: at rest f is the parabola itself, and would be left with no sign
DIGITS, MAX_STEPS = 40, 20_000
Times = dict[Wall, float]


class Path:
    """A straight flight through a domain whose walls move; s is the time since departure."""

    def __init__(self, scene: Scene, state: State) -> None:
        self.scene, self.wall = scene, state.wall
        self.t, self.x, self.y, self.vx, self.vy = state.t, state.x, state.y, state.vx, state.vy
        self.bends = _bends(scene, self.vx, self.vy)
        self.residual = 0.0
        if self.wall:
            self.residual = self.gap(table_at(fp, scene, self.t), self.wall, 0.0)

    def gap(self, table: TableAt, wall: Wall, s: float) -> float:
        """Return a wall's f; on the wall left f(0) is 0."""
        f = float(table.gap(wall, self.x + s * self.vx, self.y + s * self.vy))
        return f - self.residual if wall == self.wall else f

    def rate(self, table: TableAt, wall: Wall, s: float) -> float:
        """Return d f / ds of a wall."""
        return float(table.gap_rate(wall, self.x + s * self.vx, self.y + s * self.vy, self.vx, self.vy))

    def first_hit(self) -> tuple[float, Wall]:
        """Return the time of flight to the first wall, and the wall."""
        s = 0.0
        for _ in range(MAX_STEPS):
            table = table_at(fp, self.scene, self.t + s)
            gaps = {wall: self.gap(table, wall, s) for wall in self.bends}
            rates = {wall: self.rate(table, wall, s) for wall in self.bends}
            safe = {wall: self.safe(wall, gaps[wall], rates[wall]) for wall in self.bends}
            step, wall = self.together(safe, s)
            ahead = self.ahead(wall, gaps[wall], rates[wall])
            others, _ = self.together({**safe, wall: math.inf}, s)
            if ahead < others and self.is_end(wall, hit := self.crossing(wall, s, s + ahead)):
                return hit, wall
            if step <= 2.0**-52 * s:
                break
            s += SHORT * step
        raise Open("a wall is grazed, two are met at once, or nothing is met for long")

    def safe(self, wall: Wall, gap: float, rate: float) -> float:
        """Return a time for which a wall's f stays positive; 0 where it is not."""
        bend = self.bends[wall]
        if gap < 0 or (gap == 0 and wall != self.wall):
            return 0.0
        if gap == 0:
            return rate / bend if bend else math.inf  # half of the time until it may be back
        root = math.sqrt(rate * rate + 2 * bend * gap)
        if rate < 0:
            return 2 * gap / (root - rate)
        return (rate + root) / bend if bend else math.inf

    def ahead(self, wall: Wall, gap: float, rate: float) -> float:
        """Return a time within which a wall's f falls through 0, once; infinite where it need not."""
        square = rate * rate - 4 * self.bends[wall] * gap
        if gap <= 0 or rate >= 0 or square <= 0:
            return math.inf
        return (1 + 2.0**-40) * 2 * gap / (math.sqrt(square) - rate)

    def together(self, times: Times, s: float) -> tuple[float, Wall]:
        """Return the time for which phi stays positive, by its own min and max, and the wall that sets it."""
        pairs = {wall: (time, wall) for wall, time in times.items()}
        if not isinstance(self.scene, Mushroom):
            return min(pairs.values())
        y, cap = self.y + s * self.vy, min(pairs["arc"], pairs["base"])
        upward = 0.0 if y > 0 else (-y / self.vy + 2.0**-50 * s) / SHORT if self.vy > 0 else math.inf
        # Below the mouth the arc is no wall until the particle is above it.
        return max(cap, min(*(pairs[wall] for wall in STEM), max(pairs["arc"], (upward, "arc"))))

    def is_end(self, wall: Wall, s: float) -> bool:
        """Tell whether the table ends where a wall's f vanishes: the mushroom has walls that end."""
        if not isinstance(self.scene, Mushroom):
            return True
        y, table = self.y + s * self.vy, table_at(fp, self.scene, self.t + s)
        if wall == "base":
            return abs(self.x + s * self.vx) > float(table.w)
        return y > 0 if wall == "arc" else y < 0

    def crossing(self, wall: Wall, a: float, b: float) -> float:
        """Return the zero of a wall's f between a, where f > 0, and b, where it is < 0."""
        s = b
        for _ in range(100):
            table = table_at(fp, self.scene, self.t + s)
            gap, rate = self.gap(table, wall, s), self.rate(table, wall, s)
            a, b = (s, b) if gap > 0 else (a, s)
            newton = s - gap / rate if rate < 0 else a
            following = newton if a < newton < b else (a + b) / 2
            if abs(following - s) <= 2.0**-40 * s:
                break
            s = following
        return self.sharpened(wall, following)

    def sharpened(self, wall: Wall, s: float) -> float:
        """Return a crossing known to some digits to all of binary64's."""
        ctx = decimals(DIGITS)
        t, x, y, vx, vy = map(ctx.mpf, (self.t, self.x, self.y, self.vx, self.vy))
        given = table_at(ctx, self.scene, t).gap(wall, x, y) if wall == self.wall else 0
        exact = ctx.mpf(s)
        for _ in range(3):
            table, place = table_at(ctx, self.scene, t + exact), (x + exact * vx, y + exact * vy)
            rate = table.gap_rate(wall, *place, vx, vy)
            if not rate < 0:
                raise Open("a wall is grazed within rounding")
            exact -= (table.gap(wall, *place) - given) / rate
        if not abs(exact - s) < s / 4:
            raise Open("the flight is too short for what rounding leaves of it")
        return float(exact)


def _bends(scene: Scene, vx: float, vy: float) -> Times:
    """Return bounds on |f''| of every wall along a flight."""
    known: dict[str, Bounds] = {name: bounds(law) for name, law in laws(scene).items()}
    bends: Times = {"base": 0.0}
    if "r" in known:
        r = known["r"]
        bends["arc"] = 2 * (r.slope**2 + r.highest * r.curvature + vx * vx + vy * vy)
    if isinstance(scene, Cap):
        return bends
    lean, h = known["slope"], known["h"]
    if "nu" in known:
        nu, r = known["nu"], known["r"]
        widening = nu.curvature * r.highest + 2 * nu.slope * r.slope + nu.highest * r.curvature
    else:
        widening = known["w"].curvature
    for side in STEM[:2]:
        bends[side] = widening + lean.curvature * h.highest + 2 * lean.slope * abs(vy)
    return {**bends, "floor": h.curvature}


def next_hit(scene: Scene, state: State) -> Hit | None:
    """Return time, place and velocity just after the next hit."""
    s, wall = Path(scene, state).first_hit()
    vx, vy = state.vx, state.vy
    table, x, y = table_at(fp, scene, state.t + s), state.x + s * vx, state.y + s * vy
    nx, ny = table.normal(wall, x, y)
    along = vx * nx + vy * ny + table.receding(wall, y)
    return state.t + s, x, y, vx - 2 * along * nx, vy - 2 * along * ny


if __name__ == "__main__":
    serve_engine("example-implicit", next_hit)
