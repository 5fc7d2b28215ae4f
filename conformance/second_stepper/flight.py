"""A straight flight and the walls along it, over balls of flight time.

A flight starts from a state whose numbers are balls (a point, for a state given in binary64, kept exactly as
well). A wall's function f is positive inside. Of the wall being left f(0) is taken out wherever f is asked
for: there the particle is on the wall by definition, so that every question (a hit, a corner, the mouth's
edge, the horizon) is asked of f - f(0).
"""

from __future__ import annotations

from typing import Any, NamedTuple

from flint import arb, fmpq

from conformance.second_stepper.answer import Open
from conformance.second_stepper.law_balls import Ball, Rational, Timed, exact, hull, product, timed
from scene import Cap, Mushroom, Scene, State, Stem, Wall
from scene.tables import laws, width_factors

SIDES: tuple[Wall, ...] = ("left", "right", "floor")
MAX_LOOKS = 20_000  # evaluations of a wall in one flight, at one precision: a second or two


class Table:
    """A scene at the present precision of flint."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.is_mushroom, self.is_stem = isinstance(scene, Mushroom), isinstance(scene, Stem)
        self.laws: dict[str, Timed] = {name: timed(law) for name, law in laws(scene).items()}
        self.width = [] if isinstance(scene, Cap) else [timed(law) for law in width_factors(scene)]

    def extent(self) -> tuple[Ball, Ball]:
        """Bound |x| and |y| of all that is inside the table at some time."""
        across, up = arb(0), arb(0)
        if "r" in self.laws:
            across = up = self.laws["r"].range()[1]
        if self.is_mushroom or self.is_stem:
            depth, slope, width = self.laws["h"].range()[1], self.laws["slope"].range(), arb(1)
            for law in self.width:
                width *= law.range()[1]
            across = across + width + depth * slope[0].union(slope[1]).abs_upper()
            up = up + depth
        return across, up


class Course(NamedTuple):
    """Where a flight begins and how fast it goes: balls."""

    t: Ball
    x: Ball
    y: Ball
    vx: Ball
    vy: Ball


def course_of(state: State) -> Course:
    """Return the course of a state, exactly."""
    return Course(*(arb(exact(getattr(state, name))) for name in Course._fields))


class Flight:
    """One flight through a table.

    Args:
        table: the scene.
        course: where the flight begins.
        state: the same as binary64 numbers where it is exact: they decide ties; None where it is a ball.
    """

    def __init__(self, table: Table, course: Course, state: State | None) -> None:
        self.table, self.course, self.state = table, course, state
        self.residuals: dict[Wall, Ball] = {}
        self.exact_residuals: dict[Wall, Rational | None] = {}
        self.flat: set[Wall] = set()  # walls being left with f'(0) = 0 < f''(0), both exactly
        self.looks = 0

    def leave(self, wall: Wall, residual: Ball | None = None) -> None:
        """Take f(0) of a wall out of its function; `residual` gives it where an earlier flight fixed it."""
        if residual is None:
            self.exact_residuals[wall] = self.exact_value(wall, fmpq(0))
            residual = self.jet(wall, arb(0))[0]
        self.residuals[wall] = residual

    def place(self, s: Ball) -> tuple[Ball, Ball]:
        """Return x and y."""
        c = self.course
        return c.x + c.vx * s, c.y + c.vy * s

    def jet(self, wall: Wall, s: Ball) -> tuple[Ball, Ball, Ball]:
        """Enclose f, f' and f'' (by flight time) of a wall at every time of the ball s."""
        self.looks += 1
        if self.looks > MAX_LOOKS:
            raise Open(f"more than {MAX_LOOKS} looks at a wall")
        c, time = self.course, self.course.t + s
        x, y = self.place(s)
        if wall == "base":
            up = -1 if self.table.is_stem else 1
            found = (up * y, up * c.vy, arb(0))
        elif wall == "arc":
            r, rate, bend = self.table.laws["r"].jet(time)
            found = (
                r * r - x * x - y * y,
                2 * (r * rate - x * c.vx - y * c.vy),
                2 * (rate * rate + r * bend - c.vx * c.vx - c.vy * c.vy),
            )
        elif wall == "floor":
            h, rate, bend = self.table.laws["h"].jet(time)
            found = (y + h, c.vy + rate, bend)
        else:
            across = self.width(time)
            tilt = product(self.table.laws["slope"].jet(time), (y, c.vy, arb(0)))
            side = (x, c.vx) if wall == "left" else (-x, -c.vx)
            found = (across[0] + tilt[0] + side[0], across[1] + tilt[1] + side[1], across[2] + tilt[2])
        residual = self.residuals.get(wall)
        return found if residual is None else (found[0] - residual, found[1], found[2])

    def width(self, time: Ball) -> tuple[Ball, Ball, Ball]:
        """Enclose the half-width of the mouth and its derivatives."""
        jets = [law.jet(time) for law in self.table.width]
        found: tuple[Ball, Ball, Ball] = jets[0] if len(jets) == 1 else product(*jets)
        return found

    def gradient(self, wall: Wall, s: Ball) -> tuple[Ball, Ball]:
        """Enclose the derivatives of f by x and y."""
        if wall == "base":
            return arb(0), arb(-1 if self.table.is_stem else 1)
        if wall == "floor":
            return arb(0), arb(1)
        if wall == "arc":
            x, y = self.place(s)
            return -2 * x, -2 * y
        slope = self.table.laws["slope"].jet(self.course.t + s)[0]
        return arb(1 if wall == "left" else -1), slope

    def exact_value(self, wall: Wall, s: Rational) -> Rational | None:
        """Return f exactly at a rational flight time of an exact state, or None where it is not known so."""
        if self.state is None:
            return None
        q = self.state
        x, y = (exact(place) + exact(speed) * s for place, speed in ((q.x, q.vx), (q.y, q.vy)))
        found = self._exact_sum(wall, x, y, exact(q.t) + s)
        if found is None or wall not in self.residuals:
            return found
        residual = self.exact_residuals.get(wall)
        return None if residual is None else found - residual

    def _exact_sum(self, wall: Wall, x: Rational, y: Rational, time: Rational) -> Rational | None:
        if wall == "base":
            return -y if self.table.is_stem else y
        if wall == "arc":
            r = self.table.laws["r"].exact_value(time)
            return None if r is None else r * r - x * x - y * y
        if wall == "floor":
            h = self.table.laws["h"].exact_value(time)
            return None if h is None else y + h
        width = self.exact_width(time)
        slope = self.table.laws["slope"].exact_value(time)
        if width is None or slope is None:
            return None
        return width + slope * y + (x if wall == "left" else -x)

    def exact_width(self, time: Rational) -> Rational | None:
        """Return the half-width of the mouth exactly, or None where it is not known so."""
        total = fmpq(1)
        for law in self.table.width:
            factor = law.exact_value(time)
            if factor is None:
                return None
            total *= factor
        return total

    def is_zero(self, wall: Wall, s: Rational) -> bool:
        """Tell whether f is known to vanish exactly."""
        return bool(self.exact_value(wall, s) == 0)

    def over(self, wall: Wall, a: Rational, b: Rational) -> tuple[Any, Any, Any]:
        """Enclose f, f' and f'' on [a, b]."""
        return self.jet(wall, hull(a, b))
