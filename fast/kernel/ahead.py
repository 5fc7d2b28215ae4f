"""A lane's laws where its flight is guessed to end, and carried on from there to where it does.

`fly` and `chord` ask for the first in a loop of their own: one loop over everything took 2 to 9 % longer. It
has more instructions than a processor looks ahead, so that it would wait for the polynomials of one register
of lanes before it begins with those of the next; that this is why was not measured.
"""

from __future__ import annotations

from typing import NamedTuple

from fast.kernel.arithmetic import fma
from fast.kernel.compiling import packed
from fast.kernel.pieces import law_at, third_derivative

from fast.kernel.pools import (  # isort: skip
    BEFORE, DEPTH_LAW, MEAN_RATE, NEXT_H0, NEXT_H1, NEXT_H2, NEXT_M0, NEXT_M1, NEXT_M2, NEXT_R0, NEXT_R1,
    NEXT_R2, NEXT_R3, NEXT_W0, NEXT_W0_LOW, NEXT_W1, NEXT_W2, RADIUS_LAW, REF, REF_LOW, S, SLOPE_LAW, STRIDE,
    T, T_LOW, law_of, width_of,
)  # fmt: skip


class StemLaws(NamedTuple):
    """Half-width, with its low part, depth and slope at one time, with two derivatives each."""

    w: float
    w_low: float
    w1: float
    w2: float
    h: float
    h1: float
    h2: float
    m: float
    m1: float
    m2: float


@packed
def cap_ahead(a, i, is_relative, degree):
    """Write radius and half-width at the end that a lane's flight is guessed to have.

    Also its begin, since the laws' reference time, and the radius's mean rate from there on.

    Returns:
        The guessed end, since that time too; of the half-width the second derivative and the low part,
        which captured particles do not ask for.
    """
    before = (a[T + i] - a[REF + i]) + (a[T_LOW + i] - a[REF_LOW + i])
    since = before + a[S + i]
    r, r1, r2, mean_rate = law_at(a, RADIUS_LAW + i, STRIDE, since, before, degree)
    w, w1, w2, w_low = width_of(a, i, since, r, r1, r2, is_relative, degree)
    a[BEFORE + i], a[MEAN_RATE + i] = before, mean_rate
    a[NEXT_R0 + i], a[NEXT_R1 + i], a[NEXT_R2 + i] = r, r1, r2
    a[NEXT_R3 + i] = third_derivative(a, RADIUS_LAW + i, STRIDE, since, degree)
    a[NEXT_W0 + i], a[NEXT_W1 + i] = w, w1
    return since, w2, w_low


@packed
def stem_ahead(a, i, since, w2, w_low, slope, degree):
    """Write what sides and floor hang on likewise; a slope that stands still is given, and not written."""
    a[NEXT_W2 + i], a[NEXT_W0_LOW + i] = w2, w_low
    a[NEXT_H0 + i], a[NEXT_H1 + i], a[NEXT_H2 + i] = law_of(a, DEPTH_LAW + i, since, degree)
    if slope is None:
        a[NEXT_M0 + i], a[NEXT_M1 + i], a[NEXT_M2 + i] = law_of(a, SLOPE_LAW + i, since, degree)


@packed
def stem_there(a, i, slope):
    """Return what `stem_ahead` has written."""
    m, m1, m2 = (a[NEXT_M0 + i], a[NEXT_M1 + i], a[NEXT_M2 + i]) if slope is None else (slope, 0.0, 0.0)
    w, w_low, w1, w2 = a[NEXT_W0 + i], a[NEXT_W0_LOW + i], a[NEXT_W1 + i], a[NEXT_W2 + i]
    return StemLaws(w, w_low, w1, w2, a[NEXT_H0 + i], a[NEXT_H1 + i], a[NEXT_H2 + i], m, m1, m2)


@packed
def cap_at_hit(a, i, delta, r, r1, r2, w, w1):
    """Write radius and half-width at the hit, which is `delta` after the end that was guessed."""
    a[NEXT_R0 + i], a[NEXT_R1 + i] = fma(r1, delta, r), fma(r2, delta, r1)
    a[NEXT_W0 + i] = fma(w1, delta, w)


@packed
def stem_at_hit(a, i, delta, stem, slope):
    """Write depth, slope and the half-width's rate at the hit, likewise."""
    a[NEXT_W1 + i] = fma(stem.w2, delta, stem.w1)
    a[NEXT_H0 + i], a[NEXT_H1 + i] = fma(stem.h1, delta, stem.h), fma(stem.h2, delta, stem.h1)
    if slope is None:
        a[NEXT_M0 + i], a[NEXT_M1 + i] = fma(stem.m1, delta, stem.m), fma(stem.m2, delta, stem.m1)
