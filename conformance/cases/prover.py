"""Certified answers of single steps: the one place that makes them from the reference's enclosures.

The reference proves every answer by itself; `certify` has the verifier prove it again. At a knot of a law
the acceleration of a wall jumps, and the derivatives with it. Rounding may put a hit on either side: the
larger sum of both sides counts.
"""

from collections.abc import Sequence
from fractions import Fraction
from math import fsum, inf
from typing import NamedTuple

import reference
from conformance.vectors import (
    DIGITS,
    NUMBERS,
    Certified,
    Ends,
    Expectation,
    Level,
    certified,
)
from reference.arithmetic import rational
from scene import (
    Rejected,
    Scene,
    State,
    Undecided,
    Undefined,
    Wall,
)

# What a level asks (docs/corpus.md): nudges that change no wall, and the largest condition number.
NUDGES: tuple[tuple[Level, float], ...] = (("core", 2.0**-30), ("extended", 2.0**-44))
CONDITIONS = {"core": 1e6, "extended": 1e12}
# Pairs, so that one of each pair lies on either side of a tie; a trajectory takes the first pair.
SIGNS = ((1, 1, -1, 1, -1), (-1, -1, 1, -1, 1), (1, 1, 1, 1, 1), (-1, -1, -1, -1, -1))
Matrix = list[list[float]]
GUARD = 6  # decimals asked of the reference beyond those that are written down


class ProvedFlight(NamedTuple):
    """A flight up to a collision or the horizon, as the reference proved it.

    Attributes:
        wall: the wall met; None at the horizon.
        ends: low and high of dt, x, y, vx, vy.
        jacobian: (5, 5) derivatives of these, in this order, by t, x, y, vx, vy.
    """

    wall: Wall | None
    ends: dict[str, Ends]
    jacobian: Matrix

    def centre(self) -> list[float]:
        """Return dt, x, y, vx, vy, rounded."""
        return [float(sum(self.ends[name]) / 2) for name in NUMBERS]

    def allowance(self, state: State) -> list[float]:
        """Return for dt, x, y, vx, vy the sum over inputs of |d out / d in| |in|."""
        return [moved(row, inputs_of(state)) for row in self.jacobian]

    def certified(self, state: State, digits: int = DIGITS) -> Certified:
        """Write it down to so many decimals."""
        return certified(self.ends, self.allowance(state), self.wall, digits=digits)


def ask(scene: Scene, state: State, t_end: float, digits: int = DIGITS) -> reference.Outcome:
    """Return the reference's outcome, close enough for so many decimals, with its Jacobian."""
    return reference.next_collision(scene, state, t_end, digits=digits + GUARD, is_differentiated=True)


def flight_of(outcome: reference.Collision | reference.Horizon, state: State, t_end: float) -> ProvedFlight:
    """Return the flight that led to an outcome of `ask`."""
    if isinstance(outcome, reference.Horizon):
        dt = Fraction(t_end) - Fraction(state.t)
        return ProvedFlight(None, _numbers((dt, dt), outcome.at), free_flight(state, float(dt)))
    assert outcome.jacobian is not None
    largest = max(abs(float(end)) for row in outcome.jacobian for d in row for end in d)
    jacobian = [[_steepest(d, largest) for d in row] for row in outcome.jacobian]
    return ProvedFlight(outcome.wall, collided(outcome), jacobian)


def _steepest(derivative: reference.Enclosure, largest: float) -> float:
    """Return a derivative rounded; at a knot, where it is enclosed between two, the greater in size."""
    low, high = float(derivative.lo), float(derivative.hi)
    if high - low <= 2.0**-40 * largest:
        return float(derivative)
    return max(low, high, key=abs)


def expectation(
    outcome: reference.Outcome, state: State, t_end: float, digits: int = DIGITS
) -> Expectation | None:
    """Return an outcome of `ask` as a certified answer; None where it is undecided."""
    if isinstance(outcome, Undecided):
        return None
    if isinstance(outcome, Undefined):
        return Expectation("undefined", reason=outcome.reason)
    if isinstance(outcome, Rejected):
        return Expectation("rejected")
    flight = flight_of(outcome, state, t_end)
    return Expectation("collision" if flight.wall else "horizon", (flight.certified(state, digits),))


def proved_step(scene: Scene, state: State, t_end: float, digits: int = DIGITS) -> Expectation | None:
    """Answer a step by proof.

    Args:
        scene: table and laws.
        state: the start.
        t_end: horizon [time].
        digits: decimals of the certified answer.

    Returns:
        The certified answer; None where the reference is undecided.
    """
    return expectation(ask(scene, state, t_end, digits), state, t_end, digits)


def nudged(state: State, t_end: float, signs: Sequence[int], nudge: float) -> State:
    """Return a state whose numbers are moved by a part of their sizes, each in a direction of its own.

    Args:
        state: the start.
        t_end: horizon [time]; no later time is returned.
        signs: of the moves of t, x, y, vx, vy.
        nudge: relative; to the greater component for place and velocity.
    """
    place, speed = max(abs(state.x), abs(state.y)), max(abs(state.vx), abs(state.vy))
    sizes = (abs(state.t), place, place, speed, speed)
    values = [v + nudge * sign * size for v, sign, size in zip(inputs_of(state), signs, sizes, strict=True)]
    t, x, y, vx, vy = values
    return State(min(t, t_end), x, y, vx, vy, state.wall)


def ends(enclosure: reference.Enclosure) -> Ends:
    """Return both ends of one of the reference's enclosures, exactly."""
    return rational(enclosure.lo._mpf_), rational(enclosure.hi._mpf_)


def collided(outcome: reference.Collision) -> dict[str, Ends]:
    """Return the ends of dt, x, y, vx, vy of a collision."""
    return _numbers(ends(outcome.dt), outcome.after)


def coasted(outcome: reference.Horizon, since: Ends) -> dict[str, Ends]:
    """Return the ends of dt, x, y, vx, vy at the horizon, dt counted from an enclosed time."""
    low, high = ends(outcome.at.t)
    return _numbers((low - since[1], high - since[0]), outcome.at)


def _numbers(dt: Ends, after: reference.Moment) -> dict[str, Ends]:
    return {"dt": dt, **{name: ends(getattr(after, name)) for name in NUMBERS[1:]}}


def inputs_of(state: State) -> list[float]:
    """Return the five numbers that a step starts from: t, x, y, vx, vy."""
    return [state.t, state.x, state.y, state.vx, state.vy]


def moved(row: Sequence[float], inputs: Sequence[float]) -> float:
    """Return the sum over inputs of |d out / d in| |in|, for the derivatives of one output."""
    return fsum(abs(d * value) for d, value in zip(row, inputs, strict=True))


def free_flight(state: State, dt: float) -> Matrix:
    """Return the (5, 5) Jacobian of a flight up to a fixed time: dt, x, y, vx, vy by t, x, y, vx, vy."""
    return [
        [-1.0, 0.0, 0.0, 0.0, 0.0],
        [-state.vx, 1.0, 0.0, dt, 0.0],
        [-state.vy, 0.0, 1.0, 0.0, dt],
        [0.0, 0.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 1.0],
    ]


def condition_number(out: Sequence[float], allowance: Sequence[float]) -> float:
    """Return the largest relative change of an output per relative change of the inputs.

    Args:
        out: (dt, x, y, vx, vy), the exact answer rounded.
        allowance: for each of these the sum over inputs of |d out / d in| |in|.

    Returns:
        max over outputs of (sum |d out / d in| |in|) / |out|, place and velocity taken as vectors'
        largest components; inf when such a vector vanishes though it can move.
    """
    sizes = [abs(value) for value in out]
    parts = [(max(allowance[part]), max(sizes[part])) for part in (slice(1), slice(1, 3), slice(3, 5))]
    return max((change / size if size else (inf if change else 0.0)) for change, size in parts)
