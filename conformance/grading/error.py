"""The one measure of a stepper's error: backward ulps.

|out - truth| / (sum over inputs |d out / d in| |in| u + |out| u), u = 2^-53: how many units in
the last place the inputs and the output would have to move to explain the answer. It is as
fair to a grazing hit, where every stepper must lose digits, as to a head-on one.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from math import inf

U = Fraction(1, 2**53)
LEAST = Fraction(1, 2**1075)  # half the spacing of subnormal numbers: nothing rounds better


def backward_ulps(
    out: Sequence[float | Fraction],
    truth: Sequence[Fraction],
    jacobian: Sequence[Sequence[float]],
    inputs: Sequence[float],
) -> list[float]:
    """Measure each component of an answer.

    Args:
        out: (dt, x, y, vx, vy) as computed, to any number of digits.
        truth: the same, exact or far more precise than binary64.
        jacobian: (5, 5) derivatives of the outputs (rows) by the inputs (columns).
        inputs: (t, x, y, vx, vy) that the step started from.

    Returns:
        Backward ulps per component: 0 for an exact answer, inf where only an exact one is right.
    """
    found = []
    for computed, exact, row in zip(out, truth, jacobian, strict=True):
        moved = [abs(Fraction(d) * Fraction(value)) for d, value in zip(row, inputs, strict=True)]
        found.append(_ulps(computed, exact, sum(moved, Fraction(0))))
    return found


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


def _ulps(computed: float | Fraction, exact: Fraction, moved: Fraction) -> float:
    if computed != computed or computed in (inf, -inf):
        return inf
    error = abs(Fraction(computed) - exact)
    allowance = (moved + abs(exact)) * U
    if allowance == 0:
        return 0.0 if error == 0 else inf
    return float(error / max(allowance, LEAST))
