"""A straight flight and the walls along it (sec. 2 of the paper).

A wall's function f is positive inside the table:
    arc r^2 - x^2 - y^2,   base y (in a stem -y),
    right w + slope y - x,   left w + slope y + x,   floor y + h.
The particle lies by definition on the wall that it is leaving: the residual f(0) of that wall is taken out
wherever f is asked for, so every question (a hit, a corner, the mouth's edge, the horizon) is of f - f(0).
"""

from __future__ import annotations

from functools import reduce
from typing import NamedTuple

from flint import arb, fmpq

from conformance.arb.laws import BallLaw, ball_law
from conformance.arb.numbers import ZERO, Jet, Number, Rational, add, exact, negative, product, rational_ends
from scene import Cap, Mushroom, Scene, State, Stem, Wall
from scene.tables import laws, period, width_factors

SIDES: tuple[Wall, ...] = ("left", "right", "floor")


class Table:
    """A scene with its laws prepared at the present precision of flint."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.is_mushroom, self.is_stem = isinstance(scene, Mushroom), isinstance(scene, Stem)
        self.laws: dict[str, BallLaw] = {name: ball_law(law) for name, law in laws(scene).items()}
        self.width = [] if isinstance(scene, Cap) else [ball_law(law) for law in width_factors(scene)]
        shared = period(scene)
        self.turn: Rational | None = None  # a period of all laws, or a little more
        if shared is not None and shared.length is not None:
            self.turn = fmpq(shared.length.numerator, shared.length.denominator)
        elif shared is not None and shared.omega is not None:
            self.turn = rational_ends(2 * arb.pi() / exact(shared.omega))[1]


class Line(NamedTuple):
    """A straight line of flight: time and place where flight times are counted from, and velocity."""

    t: Number
    x: Number
    y: Number
    vx: Number
    vy: Number


def line_of(state: State) -> Line:
    """Return the line of a state, exactly."""
    return Line(*(exact(float(getattr(state, name))) for name in Line._fields))


class BallFlight:
    """One flight through a table.

    Flight times are rationals, at which the answer is as exact as the line and the laws allow, or balls, for
    every time of which the answer holds. `within` is explained in `conformance.arb.laws`; it is an exact
    flight time and needs a line whose time is exact.

    Args:
        table: the scene.
        line: rationals for an exact state, balls for an enclosed one.
        residuals: f(0) of the walls being left.
    """

    def __init__(self, table: Table, line: Line, residuals: dict[Wall, Number] | None = None) -> None:
        self.table, self.line, self.balls = table, line, Line(*map(arb, line))
        self.residuals: dict[Wall, Number] = {} if residuals is None else residuals

    def place(self, s: Number) -> tuple[Number, Number]:
        """Return x and y."""
        line = self._line(s)
        return line.x + line.vx * s, line.y + line.vy * s

    def at_rest(self, s: Number) -> Line:
        """Return the line of a particle that rests where the flight is at s."""
        return Line(self.line.t, *self.place(s), ZERO, ZERO)

    def law(self, name: str, s: Number, within: Rational | None = None) -> Jet:
        """Enclose a law of the scene and its derivatives."""
        return self.table.laws[name].jet(*self._times(s, within))

    def width(self, s: Number, within: Rational | None = None) -> Jet:
        """Enclose the half-width of the mouth, w or nu r, and its derivatives."""
        times = self._times(s, within)
        return reduce(product, (law.jet(*times) for law in self.table.width))

    def jet(self, wall: Wall, s: Number, within: Rational | None = None) -> Jet:
        """Enclose f, f' and f'' (by flight time) of a wall, less its residual."""
        line = self._line(s)
        x, y = (line.x + line.vx * s, line.vx, ZERO), (line.y + line.vy * s, line.vy, ZERO)
        if wall == "base":
            found = negative(y) if self.table.is_stem else y
        elif wall == "arc":
            r = self.law("r", s, within)
            found = add(product(r, r), negative(add(product(x, x), product(y, y))))
        elif wall == "floor":
            found = add(y, self.law("h", s, within))
        else:
            side = add(self.width(s, within), product(self.law("slope", s, within), y))
            found = add(side, x if wall == "left" else negative(x))
        residual = self.residuals.get(wall)
        return found if residual is None else (found[0] - residual, found[1], found[2])

    def gradient(self, wall: Wall, s: Number) -> tuple[Number, Number]:
        """Enclose the derivatives of f by x and y."""
        if wall == "base":
            return ZERO, fmpq(-1 if self.table.is_stem else 1)
        if wall == "floor":
            return ZERO, fmpq(1)
        if wall == "arc":
            x, y = self.place(s)
            return -2 * x, -2 * y
        return fmpq(1 if wall == "left" else -1), self.law("slope", s)[0]

    def rate(self, wall: Wall, s: Number) -> Number:
        """Enclose f' of a wall, as evaluated."""
        return self.jet(wall, s)[1]

    def reflected(self, wall: Wall, s: Number) -> tuple[Number, Number]:
        """Enclose the velocity after a hit: v - 2 f' grad f / |grad f|^2, which is v - 2 (v.n - u) n."""
        line = self._line(s)
        if wall == "base":
            return line.vx, -line.vy
        f_x, f_y = self.gradient(wall, s)
        push = 2 * self.rate(wall, s) / (f_x * f_x + f_y * f_y)
        return line.vx - push * f_x, line.vy - push * f_y

    def _line(self, s: Number) -> Line:
        return self.line if isinstance(s, fmpq) else self.balls

    def _times(self, s: Number, within: Rational | None) -> tuple[Number, Rational | None]:
        return self._line(s).t + s, None if within is None else self.line.t + within
