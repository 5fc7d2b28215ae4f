"""A scene's laws as short polynomials about reference times: what the lanes know of them.

One form for every law: a constant, a Fourier sum, a half-leg between knots, in any mixture. What the pieces
are and why their polynomials may be trusted is said where they are cut, in fast.pieces.
"""

from __future__ import annotations

import numpy as np

from fast.kernel.arithmetic import fma, two_product, two_sum
from fast.kernel.compiling import kernel, packed
from fast.kernel.double_double import add, sub, times
from fast.kernel.laws import bend_of_half_leg, set_anchors, whole_periods

from fast.kernel.records import (  # isort: skip
    AMPLITUDES, BANG_BANG, COSINE, COSINE_LOW, DEPTH, FOURIER, HALF_LEG, KIND, N_HARMONICS, OMEGA, PHASE,
    RADIUS, RATE, SINE, SINE_LOW, SLOPE, VALUE, VALUE_LOW, WIDTH,
)  # fmt: skip


PARABOLA, SERIES = DEGREES = 2, 12  # with the latter a harmonic takes 27 pieces
SHORT, LONG = (0,) * PARABOLA, (0,) * SERIES  # as `law_at` takes them


@packed
def one_power(half_bend, rate, mean, rise, u, u_before, coefficient):
    """Take one step of Horner's rule, for the value's quotient `rise` by the time and what is made of it."""
    half_bend, rate, rise = fma(half_bend, u, rate), fma(rate, u, rise), fma(rise, u, coefficient)
    return half_bend, rate, fma(mean, u_before, rise), rise


@packed
def law_at(a, place, stride, u, u_before, degree):
    """Return a law, two derivatives, and its mean rate (f(u) - f(u_before)) / (u - u_before).

    All by Horner's rule; the mean rate is a divided difference, found without the difference of the values.
    What a caller does not use is not computed.

    Args:
        a: an array with the coefficients.
        place: where that of the value stands; its low part and those of the powers follow.
        stride: how far they are apart.
        u: time since the reference.
        u_before: another one.
        degree: a tuple as long as the degree, PARABOLA or SERIES. The compiler knows its length
            and keeps those steps that there are; a loop inside a loop over lanes would not be packed.
    """
    n = len(degree)
    rate = a[place + (n + 1) * stride]
    rise = fma(rate, u, a[place + n * stride])
    p = (0.0, rate, fma(rate, u_before, rise), rise)
    if n == 12:
        p = one_power(*p, u, u_before, a[place + 11 * stride])
        p = one_power(*p, u, u_before, a[place + 10 * stride])
        p = one_power(*p, u, u_before, a[place + 9 * stride])
        p = one_power(*p, u, u_before, a[place + 8 * stride])
        p = one_power(*p, u, u_before, a[place + 7 * stride])
        p = one_power(*p, u, u_before, a[place + 6 * stride])
        p = one_power(*p, u, u_before, a[place + 5 * stride])
        p = one_power(*p, u, u_before, a[place + 4 * stride])
        p = one_power(*p, u, u_before, a[place + 3 * stride])
        p = one_power(*p, u, u_before, a[place + 2 * stride])
    half_bend, rate, mean, rise = p
    value = a[place] + fma(rise, u, a[place + stride])
    return value, fma(rate, u, rise), 2.0 * fma(half_bend, u, rate), mean


@packed
def third_derivative(a, place, stride, u, degree):
    """Return about the third derivative of a law, from three of its coefficients: for first guesses."""
    if len(degree) == 2:
        return 0.0
    f3, f4, f5 = a[place + 4 * stride], a[place + 5 * stride], a[place + 6 * stride]
    return 6.0 * fma(u, fma(10.0 * u, f5, 4.0 * f4), f3)


@kernel
def piece_at(pieces, t, t_low):
    """Return the number of the piece that serves at a time, and its reference time as a sum of two floats."""
    if not pieces.period < np.inf:
        return 0, pieces.references[0, 0], 0.0
    origin, period, period_low = pieces.origin, pieces.period, pieces.period_low
    n_periods, tau = whole_periods(origin, period, period_low, t, t_low)
    low, high = 0, pieces.begins.shape[0]
    while high - low > 1:
        middle = (low + high) // 2
        if pieces.begins[middle] <= tau:
            low = middle
        else:
            high = middle
    p, e = two_product(n_periods, period)
    reference, f = two_sum(p, pieces.references[low, 0])
    return low, reference, f + (e + n_periods * period_low + pieces.references[low, 1])


@kernel
def expand_waves(laws, anchors, row, out):
    """Write the coefficients of the powers from 2 on of a Fourier law, from the phases at the reference time.

    Harmonic k is A cos(k w u) + B sin(k w u) there. Each coefficient is right to its last bits, however far
    its waves cancel: where a law is nearly 0 its powers add up to little more than its value, and their
    rounding must, too.
    """
    n, scale = int(laws[row, N_HARMONICS]), laws[row, OMEGA]
    out[2:] = 0.0
    for j in range(3, out.shape[0]):
        scale *= laws[row, OMEGA] / (j - 1)
        total = (0.0, 0.0)
        for k in range(1, n + 1):
            sine = (anchors[PHASE, SINE + k], anchors[PHASE, SINE_LOW + k])
            cosine = (anchors[PHASE, COSINE + k], anchors[PHASE, COSINE_LOW + k])
            a, b = laws[row, AMPLITUDES + k], laws[row, AMPLITUDES + n + k]
            wave = add(times(a, cosine), times(b, sine))
            if j % 2 == 0:
                wave = sub(times(b, cosine), times(a, sine))
            power = 1.0  # exact: 16^12 is a float
            for _ in range(1, j):
                power *= k
            total = add(total, times(power, wave))
        out[j] = scale * (total[0] if (j - 1) % 4 < 2 else -total[0])


@kernel
def fill_coefficients(laws, references, coefficients, anchors):
    """Write the polynomials of all laws about reference times (P, 2): see `Pieces.coefficients`."""
    for i in range(references.shape[0]):
        set_anchors(laws, anchors, references[i, 0], references[i, 1])
        for row in (RADIUS, WIDTH, DEPTH, SLOPE):
            out = coefficients[i, row]
            out[:] = 0.0
            if laws[row, KIND] == FOURIER:
                expand_waves(laws, anchors, row, out)
            elif laws[row, KIND] == BANG_BANG:
                out[3] = 0.5 * bend_of_half_leg(laws, row, int(anchors[row, HALF_LEG]))
            out[0], out[1], out[2] = anchors[row, VALUE], anchors[row, VALUE_LOW], anchors[row, RATE]
