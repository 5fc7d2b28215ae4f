"""A flight as the second stepper searches it: with a limit to the work, and exact where its state is."""

from __future__ import annotations

from flint import arb, fmpq

from conformance.arb.flight import BallFlight, Line, Table
from conformance.arb.numbers import ZERO, Ball, Jet, Number, Rational, hull
from conformance.second_stepper.answer import OpenQuestion
from scene import State, Wall

MAX_LOOKS = 20_000  # evaluations of a wall in one flight, at one precision: a second or two


class SearchedFlight(BallFlight):
    """One flight through a table.

    Args:
        table: the scene.
        line: where the flight begins and how fast it goes.
        state: the same as binary64 numbers where it is exact: they decide ties; None where it is a ball.
    """

    def __init__(self, table: Table, line: Line, state: State | None) -> None:
        super().__init__(table, line)
        self.state = state
        self.flat: set[Wall] = set()  # walls being left with f'(0) = 0 < f''(0), both exactly
        self.looks = 0

    def leave(self, wall: Wall, residual: Number | None = None) -> None:
        """Take f(0) of a wall out of its function; `residual` gives it where an earlier flight fixed it."""
        self.residuals[wall] = self.jet(wall, ZERO)[0] if residual is None else residual

    def resting(self, wall: Wall, s: Rational) -> SearchedFlight:
        """Return the flight of a particle that rests where this one is at s, with the wall's residual."""
        still = SearchedFlight(self.table, self.at_rest(s), None)
        if wall in self.residuals:
            still.leave(wall, self.residuals[wall])
        return still

    def jet(self, wall: Wall, s: Number, within: Rational | None = None) -> Jet:
        """See `BallFlight`.

        Raises:
            OpenQuestion: when that was too often.
        """
        self.looks += 1
        if self.looks > MAX_LOOKS:
            raise OpenQuestion(f"more than {MAX_LOOKS} looks at a wall")
        return super().jet(wall, s, within)

    def is_zero(self, wall: Wall, s: Rational) -> bool:
        """Tell whether f is known to be rational and to vanish exactly."""
        value = self.jet(wall, s)[0]
        return isinstance(value, fmpq) and value == 0

    def over(self, wall: Wall, a: Rational, b: Rational) -> Jet:
        """Enclose f, f' and f'' on [a, b]."""
        return self.jet(wall, hull(a, b))


def extent(table: Table) -> tuple[Ball, Ball]:
    """Bound |x| and |y| of all that is inside the table at some time."""
    highest = {name: arb(law.range()[1]) for name, law in table.laws.items()}
    across = up = highest.get("r", arb(0))
    if table.width:
        width = arb(1)
        for law in table.width:
            width *= law.range()[1]
        across = across + width + highest["h"] * hull(*table.laws["slope"].range()).abs_upper()
        up = up + highest["h"]
    return across, up
