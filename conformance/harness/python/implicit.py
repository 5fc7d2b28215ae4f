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
never past it. Where one wall must be crossed and no other can be, Newton steps find the crossing.

Each f, its rate and the bound on its curvature are those of the plain stepper; put your own there.
On the wall that the particle leaves f(0) is 0.
"""

import math

from conformance.harness.kit import Hit, UndecidedError, serve_engine
from conformance.plain import Flight
from scene import Mushroom, Scene, State, Wall

STEM: tuple[Wall, ...] = ("left", "right", "floor")
SHORT = 1 - 2.0**-6  # of a safe step: at rest f is the parabola itself, and would be left with no sign
MAX_STEPS = 20_000
Times = dict[Wall, float]


class Path(Flight):
    """A straight flight through a domain whose walls move; s is the time since departure."""

    def first_wall(self) -> tuple[Wall, float]:
        """Return the first wall, and the time of flight to it."""
        s, bends = 0.0, {wall: self.bend(wall) for wall in self.scene.walls}
        for _ in range(MAX_STEPS):
            f = {wall: self.f(wall, s) for wall in bends}
            safe = {wall: self.safe(wall, *f[wall], bends[wall]) for wall in bends}
            step, wall = self.together(safe, s)
            ahead = _ahead(*f[wall], bends[wall])
            others, _ = self.together({**safe, wall: math.inf}, s)
            if ahead < others and self.is_end(wall, hit := self.root_between(wall, s, s + ahead)):
                return wall, hit
            if step <= 2.0**-52 * s:
                break
            s += SHORT * step
        raise UndecidedError("a wall is grazed, two are met at once, or nothing is met for long")

    def safe(self, wall: Wall, gap: float, rate: float, bend: float) -> float:
        """Return a time for which a wall's f stays positive; 0 where it is not."""
        if gap < 0 or (gap == 0 and wall != self.wall):
            return 0.0
        if gap == 0:
            return rate / bend if bend else math.inf  # half of the time until it may be back
        root = math.sqrt(rate * rate + 2 * bend * gap)
        if rate < 0:
            return 2 * gap / (root - rate)
        return (rate + root) / bend if bend else math.inf

    def together(self, times: Times, s: float) -> tuple[float, Wall]:
        """Return the time for which phi stays positive, by its own min and max, and the wall that sets it."""
        pairs = {wall: (time, wall) for wall, time in times.items()}
        if not isinstance(self.scene, Mushroom):
            return min(pairs.values())
        y, cap = self.place(s)[1], min(pairs["arc"], pairs["base"])
        upward = 0.0 if y > 0 else (-y / self.vy + 2.0**-50 * s) / SHORT if self.vy > 0 else math.inf
        # Below the mouth the arc is no wall until the particle is above it.
        return max(cap, min(*(pairs[wall] for wall in STEM), max(pairs["arc"], (upward, "arc"))))

    def is_end(self, wall: Wall, s: float) -> bool:
        """Tell whether the table ends where a wall's f vanishes: the mushroom has walls that end."""
        if not isinstance(self.scene, Mushroom):
            return True
        x, y = self.place(s)
        if wall == "base":
            return abs(x) > self.width(s).now
        return y > 0 if wall == "arc" else y < 0


def _ahead(gap: float, rate: float, bend: float) -> float:
    """Return a time within which a wall's f falls through 0, once; infinite where it need not."""
    square = rate * rate - 4 * bend * gap
    if gap <= 0 or rate >= 0 or square <= 0:
        return math.inf
    return (1 + 2.0**-40) * 2 * gap / (math.sqrt(square) - rate)


def next_hit(scene: Scene, state: State) -> Hit | None:
    """Return time, place and velocity just after the next hit."""
    path = Path(scene, state, math.inf)
    wall, s = path.first_wall()
    return state.t + s, *path.place(s), *path.bounce(wall, s)


if __name__ == "__main__":
    serve_engine("example-implicit", next_hit)
