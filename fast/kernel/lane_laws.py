"""A lane's laws at its last collision, and where its flight ends, in one of two forms.

*Waves*, for Fourier laws of one or two harmonics: a lane has sine and cosine of the fundamental phase. At the
end of a flight they are computed afresh from the time, so that no error gathers; what the radius has grown by
since the begin follows from the turn of the phase by sum formulas, without a difference of values.

*Pieces*, for all other laws: a lane has the coefficients of a polynomial of each law about a reference time
(fast.kernel.pieces). When a piece no longer serves, the lane is given the next.

`waves` is None for pieces, `slope` is None where the slope moves; `degree` is a tuple as long as a form's
number in FORMS, so that each form is compiled by itself.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fast.kernel.arithmetic import (
    PIO2_1,
    PIO2_2,
    PIO2_3,
    TWO_OVER_PI,
    beyond_first_order,
    fma,
    sine_cosine,
    turned,
    two_product,
    two_sum,
)
from fast.kernel.compiling import kernel, packed, part
from fast.kernel.pieces import LONG, PARABOLA, SHORT, law_at, piece_at, third_derivative

from fast.kernel.pools import (  # isort: skip
    BACK, BEFORE, COSINE, DEPTH_LAW, END, H0, H1, H2, LAWS, LIMIT, M0, M1, M2, MEAN_RATE, NEVER,
    NEXT_COSINE, NEXT_H0, NEXT_H1, NEXT_H2, NEXT_M0, NEXT_M1, NEXT_M2, NEXT_R0, NEXT_R1, NEXT_R2, NEXT_R3,
    NEXT_SINE, NEXT_W0, NEXT_W0_LOW, NEXT_W1, NEXT_W2, N_COEFFICIENTS, PIECE, R0, R1, R2, R3, RADIUS_LAW,
    REF, REF_LOW, SINE, SLOPE_LAW, STRIDE, T, T_LOW, W0, W1, W2, WIDTH_LAW,
)  # fmt: skip
from fast.kernel.records import CONSTANT, KIND, RADIUS, Waves

ONE_WAVE, TWO_WAVES = 1, 3  # odd, pieces' degrees are even
PIO2_REST = PIO2_2 + PIO2_3
LONGEST_TURN = 0.75  # of the highest harmonic in a hop: `beyond_first_order` serves to pi / 4
NO_WAVES = Waves(0.0, 0.0, *[(0.0,) * 5] * 4)


class LawsAt(NamedTuple):
    """Radius, half-width with its low part, depth and slope at one time, with derivatives."""

    r: float
    r1: float
    r2: float
    r3: float
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
def width_of(nu, nu1, nu2, r, r1, r2, is_relative):
    """Return the half-width and its low part, and two derivatives: of nu r, or what is given itself."""
    w = nu * r if is_relative else nu
    w1 = fma(nu1, r, nu * r1) if is_relative else nu1
    w2 = fma(nu2, r, fma(nu, r2, 2.0 * nu1 * r1)) if is_relative else nu2
    return w, fma(nu, r, -w) if is_relative else 0.0, w1, w2


@packed
def wave_parts(law, k, sine, cosine):
    """Return harmonic k of a law, and what its derivative is times k omega, at a phase k omega t."""
    a, b = law[2 * k - 1], law[2 * k]
    return fma(a, cosine, b * sine), fma(b, cosine, -a * sine)


@packed
def twice(sine, cosine):
    """Return sine and cosine of twice an angle."""
    return 2.0 * sine * cosine, (cosine - sine) * (cosine + sine)


@packed
def law_of_waves(law, sine, cosine, omega, degree):
    """Return a law and three derivatives at a fundamental phase."""
    even, odd = wave_parts(law, 1, sine, cosine)
    f, rate, bend, third = even, odd, even, odd
    if len(degree) == TWO_WAVES:
        even, odd = wave_parts(law, 2, *twice(sine, cosine))
        f, rate, bend, third = f + even, fma(2.0, odd, rate), fma(4.0, even, bend), fma(8.0, odd, third)
    omega2 = -omega * omega
    return law[0] + f, omega * rate, omega2 * bend, omega2 * omega * third


@packed
def laws_of_waves(sine, cosine, waves, is_relative, slope, degree):
    """Return all laws at a fundamental phase."""
    omega = waves.omega
    r, r1, r2, r3 = law_of_waves(waves.r, sine, cosine, omega, degree)
    nu, nu1, nu2, _ = law_of_waves(waves.w, sine, cosine, omega, degree)
    w, w_low, w1, w2 = width_of(nu, nu1, nu2, r, r1, r2, is_relative)
    h, h1, h2, _ = law_of_waves(waves.h, sine, cosine, omega, degree)
    if slope is None:
        m, m1, m2, _ = law_of_waves(waves.m, sine, cosine, omega, degree)
    else:
        m, m1, m2 = slope, 0.0, 0.0
    return LawsAt(r, r1, r2, r3, w, w_low, w1, w2, h, h1, h2, m, m1, m2)


@packed
def fresh_phase(t, t_low, waves):
    """Return sine and cosine of the fundamental phase at a time, by + - * and floor alone.

    The rest r of the phase beyond whole quarter turns is off by its rounding and no more: by less than half
    a unit in the last place of the phase itself, which a rounding of t would do as well.
    """
    p, e = two_product(waves.omega, t)
    n = np.floor(fma(p, TWO_OVER_PI, 0.5))
    rest = fma(-n, PIO2_REST, fma(-n, PIO2_1, p))
    rest += fma(waves.omega, t_low, fma(waves.omega_low, t, e))
    more, less = beyond_first_order(rest)
    return turned(n, rest + more, 1.0 + less)


@packed
def laws_now(a, i, waves, is_relative, slope, degree):
    """Return a lane's laws at its last collision."""
    if waves is None:
        m, m1, m2 = (a[M0 + i], a[M1 + i], a[M2 + i]) if slope is None else (slope, 0.0, 0.0)
        r, r1, r2, r3, w, w1, w2 = a[R0 + i], a[R1 + i], a[R2 + i], a[R3 + i], a[W0 + i], a[W1 + i], a[W2 + i]
        return LawsAt(r, r1, r2, r3, w, 0.0, w1, w2, a[H0 + i], a[H1 + i], a[H2 + i], m, m1, m2)
    return laws_of_waves(a[SINE + i], a[COSINE + i], waves, is_relative, slope, degree)


@packed
def look_ahead(a, i, s, waves, is_relative, slope, degree):
    """Write what the laws after a flight hang on, for `laws_ahead`.

    In a loop of its own: one loop over everything has more instructions than a processor looks ahead, so that
    it would wait for one register of lanes before it begins with the next.
    """
    if waves is None:
        read_pieces(a, i, s, is_relative, slope, degree)
    else:
        t, low = two_sum(a[T + i], s)
        a[NEXT_SINE + i], a[NEXT_COSINE + i] = fresh_phase(t, low + a[T_LOW + i], waves)


@packed
def read_pieces(a, i, s, is_relative, slope, degree):
    """Write a lane's laws after a flight, from the coefficients that it has."""
    before = (a[T + i] - a[REF + i]) + (a[T_LOW + i] - a[REF_LOW + i])
    u = before + s
    r, r1, r2, mean_rate = law_at(a, RADIUS_LAW + i, STRIDE, u, before, degree)
    nu, nu1, nu2, _ = law_at(a, WIDTH_LAW + i, STRIDE, u, u, degree)
    w, w_low, w1, w2 = width_of(nu, nu1, nu2, r, r1, r2, is_relative)
    h, h1, h2, _ = law_at(a, DEPTH_LAW + i, STRIDE, u, u, degree)
    a[BEFORE + i], a[MEAN_RATE + i], a[NEXT_W0_LOW + i] = before, mean_rate, w_low
    a[NEXT_R0 + i], a[NEXT_R1 + i], a[NEXT_R2 + i] = r, r1, r2
    a[NEXT_R3 + i] = third_derivative(a, RADIUS_LAW + i, STRIDE, u, degree)
    a[NEXT_W0 + i], a[NEXT_W1 + i], a[NEXT_W2 + i] = w, w1, w2
    a[NEXT_H0 + i], a[NEXT_H1 + i], a[NEXT_H2 + i] = h, h1, h2
    if slope is None:
        a[NEXT_M0 + i], a[NEXT_M1 + i], a[NEXT_M2 + i], _ = law_at(a, SLOPE_LAW + i, STRIDE, u, u, degree)


@packed
def laws_ahead(a, i, waves, is_relative, slope, degree):
    """Return a lane's laws where its flight was guessed to end."""
    if waves is None:
        m, m1, m2 = slope, 0.0, 0.0
        if slope is None:
            m, m1, m2 = a[NEXT_M0 + i], a[NEXT_M1 + i], a[NEXT_M2 + i]
        r, r1, r2, r3 = a[NEXT_R0 + i], a[NEXT_R1 + i], a[NEXT_R2 + i], a[NEXT_R3 + i]
        w, w_low, w1, w2 = a[NEXT_W0 + i], a[NEXT_W0_LOW + i], a[NEXT_W1 + i], a[NEXT_W2 + i]
        h, h1, h2 = a[NEXT_H0 + i], a[NEXT_H1 + i], a[NEXT_H2 + i]
        return LawsAt(r, r1, r2, r3, w, w_low, w1, w2, h, h1, h2, m, m1, m2)
    return laws_of_waves(a[NEXT_SINE + i], a[NEXT_COSINE + i], waves, is_relative, slope, degree)


@packed
def radius_since(a, i, s, waves, degree):
    """Return the radius at a flight's begin, its increase since, and `known` of docs/lanes.md."""
    if waves is None:
        return a[R0 + i], s * a[MEAN_RATE + i], a[BEFORE + i] - a[BACK + i]
    law, sine, cosine, turn = waves.r, a[SINE + i], a[COSINE + i], waves.omega * s
    more, less = beyond_first_order(turn)
    across = turn + more  # sin and, in `less`, cos - 1 of the turn
    even, odd = wave_parts(law, 1, sine, cosine)
    r, dr = law[0] + even, fma(odd, across, even * less)
    if len(degree) == TWO_WAVES:
        even, odd = wave_parts(law, 2, *twice(sine, cosine))
        r, dr = r + even, fma(2.0 * across, fma(odd, 1.0 + less, -even * across), dr)
        return r, dr, LONGEST_TURN - 2.0 * turn
    return r, dr, LONGEST_TURN - turn


@packed
def room_ahead(a, i, s, delta, waves):
    """Return for how long after a flight's end, as guessed and as corrected, the laws used there hold."""
    if waves is None:
        u, limit = a[BEFORE + i] + s, a[LIMIT + i]
        return limit - abs(u), limit - abs(u + delta)
    return 1.0, 1.0


@packed
def move_laws(a, i, delta, is_moved, there, waves, slope):
    """Take the laws at the hit, `delta` after the end that was guessed, for the present ones."""
    if waves is None:
        a[R0 + i] = fma(there.r1, delta, there.r) if is_moved else a[R0 + i]
        a[R1 + i] = fma(there.r2, delta, there.r1) if is_moved else a[R1 + i]
        a[R2 + i] = there.r2 if is_moved else a[R2 + i]
        a[R3 + i] = there.r3 if is_moved else a[R3 + i]
        a[W0 + i] = fma(there.w1, delta, there.w) if is_moved else a[W0 + i]
        a[W1 + i] = fma(there.w2, delta, there.w1) if is_moved else a[W1 + i]
        a[W2 + i] = there.w2 if is_moved else a[W2 + i]
        a[H0 + i] = fma(there.h1, delta, there.h) if is_moved else a[H0 + i]
        a[H1 + i] = fma(there.h2, delta, there.h1) if is_moved else a[H1 + i]
        a[H2 + i] = there.h2 if is_moved else a[H2 + i]
        if slope is None:
            a[M0 + i] = fma(there.m1, delta, there.m) if is_moved else a[M0 + i]
            a[M1 + i] = fma(there.m2, delta, there.m1) if is_moved else a[M1 + i]
            a[M2 + i] = there.m2 if is_moved else a[M2 + i]
    else:
        sine, cosine, turn = a[NEXT_SINE + i], a[NEXT_COSINE + i], waves.omega * delta
        a[SINE + i] = fma(turn, cosine, sine) if is_moved else a[SINE + i]
        a[COSINE + i] = fma(-turn, sine, cosine) if is_moved else a[COSINE + i]


@part
def set_piece(a, i, piece, scene, pieces, degree):
    """Give a lane a piece of the laws whose reference time it has."""
    a[PIECE + i], a[END + i] = piece, a[REF + i] + pieces.serves[piece]
    a[BACK + i], a[LIMIT + i] = -pieces.limits[piece], pieces.limits[piece]
    if scene.laws[RADIUS, KIND] == CONSTANT:
        a[BACK + i] = -NEVER
    for row in range(4):
        for j in range(degree + 2):
            a[LAWS + (row * N_COEFFICIENTS + j) * STRIDE + i] = pieces.coefficients[piece, row, j]


@kernel
def set_reference(a, i, t, t_low, scene, pieces, degree):
    """Give a lane the piece of the laws that serves at a time; END is minus infinity where none does."""
    if not abs(t) < pieces.until:
        a[END + i] = -NEVER
        return
    piece, a[REF + i], a[REF_LOW + i] = piece_at(pieces, t, t_low)
    set_piece(a, i, piece, scene, pieces, degree)


@kernel
def take_from_piece(a, i, scene, degree):
    """Write a lane's laws at its time from the piece that it has."""
    read_pieces(a, i, 0.0, scene.is_relative, None, degree)
    for row in range(0, M2 - R0 + STRIDE, STRIDE):
        a[R0 + row + i] = a[NEXT_R0 + row + i]


@kernel
def know_laws(a, i, early, scene, pieces, degree, waves):
    """Find a lane's laws at its time, of pieces by that which serves so much earlier.

    END is minus infinity where they are out of reach.
    """
    t, t_low = a[T + i], a[T_LOW + i]
    if degree % 2 == 0:
        set_reference(a, i, t - early, t_low, scene, pieces, degree)
        if degree == PARABOLA:
            take_from_piece(a, i, scene, SHORT)
        else:
            take_from_piece(a, i, scene, LONG)
    elif abs(t) < pieces.until:
        a[SINE + i], _, a[COSINE + i], _, _ = sine_cosine(waves.omega, waves.omega_low, 1.0, t, t_low)
        a[END + i] = NEVER
    else:
        a[END + i] = -NEVER
