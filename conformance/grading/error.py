"""The one measure of a stepper's error: backward ulps.

    |out - truth| / (sum over inputs |d out / d in| |in| u + |out| u),    u = 2^-53

counts how many units in the last place the inputs and the output would have to move to explain the answer.
It is as fair to a grazing hit, where every stepper must lose digits, as to a head-on one. The sum over the
inputs is the `allowance` that a certified answer carries (`conformance.vectors.Certified`).

At a knot of a law the acceleration of a wall jumps, and the derivatives with it. Rounding may put a hit on
either side: the larger sum of both sides counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from math import fsum, inf

from scene import State

U = Fraction(1, 2**53)
LEAST = Fraction(1, 2**1075)  # half the spacing of subnormal numbers: nothing rounds better
Matrix = list[list[float]]


def backward_ulps(error: Fraction, size: Fraction) -> Fraction | float:
    """Return an error in backward ulps.

    Args:
        error: |out - truth|.
        size: the allowance plus |out|.

    Returns:
        error / (size u): 0 for an exact answer, inf where only an exact one is right.
    """
    if not size:
        return inf if error else Fraction(0)
    return error / max(size * U, LEAST)


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


def condition_number(
    out: Sequence[float], jacobian: Sequence[Sequence[float]], inputs: Sequence[float]
) -> float:
    """Return the largest relative change of an output per relative change of the inputs.

    Args:
        out: (dt, x, y, vx, vy), the exact answer rounded.
        jacobian: (5, 5) derivatives of the outputs (rows) by the inputs (columns).
        inputs: (t, x, y, vx, vy) that the step started from.

    Returns:
        max over outputs of (sum |d out / d in| |in|) / |out|, place and velocity taken as vectors'
        largest components; inf when such a vector vanishes though it can move.
    """
    moved = [sum(abs(d * value) for d, value in zip(row, inputs, strict=True)) for row in jacobian]
    sizes = [abs(value) for value in out]
    parts = [(moved[0], sizes[0]), (max(moved[1:3]), max(sizes[1:3])), (max(moved[3:]), max(sizes[3:]))]
    return max((change / size if size else (inf if change else 0.0)) for change, size in parts)
