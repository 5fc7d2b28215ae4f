"""A lane's laws at its last collision, and where its flight ends, in one of two forms.

*Waves*, for Fourier laws of one or two harmonics: a lane has sine and cosine of the fundamental phase. At the
end of a flight they are computed afresh from the time, so that no error gathers; what the radius has grown by
since the begin follows from the turn of the phase by sum formulas, without a difference of values.

*Pieces*, for all other laws: a lane has the coefficients of a polynomial of each law about a reference time:
of a constant, a Fourier sum or a half-leg between knots, in any mixture. When a piece no longer serves, the
lane is given the next. Why the polynomials may be trusted is said where they are cut, in fast.pieces.

`waves` is None for pieces, `slope` is None where the slope moves; `form` is a tuple as long as a form's
number (ONE_WAVE, TWO_WAVES, or the degree of pieces), so that each form is compiled by itself.
"""

from typing import NamedTuple

import numpy as np

from fast.kernel.arithmetic import (  # isort: skip
    PIO2_1, PIO2_2, PIO2_3, TWO_OVER_PI, add, beyond_first_order, fma, sine_cosine, sub, times, turned,
    two_product, two_sum,
)  # fmt: skip
from fast.kernel import rows
from fast.kernel.compiling import kept, kernel, packed, part
from fast.kernel.laws import bend_of_half_leg, set_anchors, whole_periods

from fast.kernel.records import (  # isort: skip
    AMPLITUDES, ANCHORS_SHAPE, BANG_BANG, CONSTANT, COSINE, COSINE_LOW, DEPTH, FOURIER,
    HALF_LEG, KIND, N_HARMONICS, OMEGA, PHASE, RADIUS, RATE, SINE, SINE_LOW, SLOPE, VALUE,
    VALUE_LOW, WIDTH, LaneWaves,
)  # fmt: skip

PARABOLA, SERIES = DEGREES = 2, 12  # with the latter a harmonic takes 27 pieces
SHORT, LONG = (0,) * PARABOLA, (0,) * SERIES  # as `law_at` takes them


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
            and unrolls the loop, else the loop over lanes around it would not be packed.
    """
    n = len(degree)
    rate = a[place + (n + 1) * stride]
    rise = fma(rate, u, a[place + n * stride])
    half_bend, mean = 0.0, fma(rate, u_before, rise)
    for k in range(n - 1, 1, -1):
        half_bend, rate = fma(half_bend, u, rate), fma(rate, u, rise)
        rise = fma(rise, u, a[place + k * stride])
        mean = fma(mean, u_before, rise)
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
    origin, period, period_low = pieces.origin, pieces.period, pieces.period_low
    n_periods, tau = whole_periods(origin, period, period_low, t, t_low)
    low = max(np.searchsorted(pieces.begins, tau, side="right") - 1, 0)
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


@kept(error_model="numpy")
def fill_pieces(laws, references, coefficients):
    """Write the polynomials of all laws about reference times (P, 2): see `Pieces.coefficients`."""
    anchors = np.zeros(ANCHORS_SHAPE)
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


ONE_WAVE, TWO_WAVES = 1, 3  # neither is a degree of pieces, so that a number names a form
PIO2_REST = PIO2_2 + PIO2_3
LONGEST_TURN = 0.75  # of the highest harmonic in a hop: `beyond_first_order` serves to pi / 4
NO_WAVES = LaneWaves(0.0, 0.0, *[(0.0,) * 5] * 4)


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
def law_of_waves(law, sine, cosine, omega, form):
    """Return a law and three derivatives at a fundamental phase."""
    even, odd = wave_parts(law, 1, sine, cosine)
    f, rate, bend, third = even, odd, even, odd
    if len(form) == TWO_WAVES:
        even, odd = wave_parts(law, 2, *twice(sine, cosine))
        f, rate, bend, third = f + even, fma(2.0, odd, rate), fma(4.0, even, bend), fma(8.0, odd, third)
    omega2 = -omega * omega
    return law[0] + f, omega * rate, omega2 * bend, omega2 * omega * third


@packed
def laws_of_waves(sine, cosine, waves, is_relative, slope, form):
    """Return all laws at a fundamental phase."""
    omega = waves.omega
    r, r1, r2, r3 = law_of_waves(waves.r, sine, cosine, omega, form)
    nu, nu1, nu2, _ = law_of_waves(waves.w, sine, cosine, omega, form)
    w, w_low, w1, w2 = width_of(nu, nu1, nu2, r, r1, r2, is_relative)
    h, h1, h2, _ = law_of_waves(waves.h, sine, cosine, omega, form)
    if slope is None:
        m, m1, m2, _ = law_of_waves(waves.m, sine, cosine, omega, form)
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
def laws_in(a, place, waves, is_relative, slope, form):
    """Return the laws in the rows of a lane that begin at `place`: R0 for those now, or AHEAD."""
    if waves is not None:
        return laws_of_waves(a[place], a[place + rows.STRIDE], waves, is_relative, slope, form)
    r, r1, r2, r3 = a[place], a[place + rows.STRIDE], a[place + 2 * rows.STRIDE], a[place + 3 * rows.STRIDE]
    w, w1, w2 = a[place + 4 * rows.STRIDE], a[place + 5 * rows.STRIDE], a[place + 6 * rows.STRIDE]
    h, h1, h2 = a[place + 7 * rows.STRIDE], a[place + 8 * rows.STRIDE], a[place + 9 * rows.STRIDE]
    w_low = a[place + 13 * rows.STRIDE]
    m, m1, m2 = slope, 0.0, 0.0
    if slope is None:
        m, m1, m2 = a[place + 10 * rows.STRIDE], a[place + 11 * rows.STRIDE], a[place + 12 * rows.STRIDE]
    return LawsAt(r, r1, r2, r3, w, w_low, w1, w2, h, h1, h2, m, m1, m2)


@packed
def write_laws(a, place, laws, slope):
    """Write laws of pieces into the rows of a lane that begin at `place`."""
    a[place], a[place + rows.STRIDE], a[place + 2 * rows.STRIDE], a[place + 3 * rows.STRIDE] = (
        laws.r,
        laws.r1,
        laws.r2,
        laws.r3,
    )
    a[place + 4 * rows.STRIDE], a[place + 5 * rows.STRIDE], a[place + 6 * rows.STRIDE] = (
        laws.w,
        laws.w1,
        laws.w2,
    )
    a[place + 7 * rows.STRIDE], a[place + 8 * rows.STRIDE], a[place + 9 * rows.STRIDE] = (
        laws.h,
        laws.h1,
        laws.h2,
    )
    if slope is None:
        a[place + 10 * rows.STRIDE], a[place + 11 * rows.STRIDE], a[place + 12 * rows.STRIDE] = (
            laws.m,
            laws.m1,
            laws.m2,
        )
    a[place + 13 * rows.STRIDE] = laws.w_low


@packed
def look_ahead(a, i, s, waves, is_relative, slope, form):
    """Write the laws after a flight, from AHEAD on.

    In a loop of its own: one loop over everything has more instructions than a processor looks ahead, so that
    it would wait for one register of lanes before it begins with the next.
    """
    if waves is None:
        read_pieces(a, i, rows.AHEAD + i, s, is_relative, slope, form)
    else:
        t, low = two_sum(a[rows.T + i], s)
        a[rows.AHEAD + i], a[rows.AHEAD + rows.STRIDE + i] = fresh_phase(t, low + a[rows.T_LOW + i], waves)


@packed
def read_pieces(a, i, place, s, is_relative, slope, form):
    """Write a lane's laws after a flight into the rows from `place` on, from its coefficients."""
    before = (a[rows.T + i] - a[rows.REF + i]) + (a[rows.T_LOW + i] - a[rows.REF_LOW + i])
    u = before + s
    r, r1, r2, mean_rate = law_at(a, rows.RADIUS_LAW + i, rows.STRIDE, u, before, form)
    r3 = third_derivative(a, rows.RADIUS_LAW + i, rows.STRIDE, u, form)
    nu, nu1, nu2, _ = law_at(a, rows.WIDTH_LAW + i, rows.STRIDE, u, u, form)
    w, w_low, w1, w2 = width_of(nu, nu1, nu2, r, r1, r2, is_relative)
    h, h1, h2, _ = law_at(a, rows.DEPTH_LAW + i, rows.STRIDE, u, u, form)
    m, m1, m2 = 0.0, 0.0, 0.0
    if slope is None:
        m, m1, m2, _ = law_at(a, rows.SLOPE_LAW + i, rows.STRIDE, u, u, form)
    a[rows.BEFORE + i], a[rows.MEAN_RATE + i] = before, mean_rate
    write_laws(a, place, LawsAt(r, r1, r2, r3, w, w_low, w1, w2, h, h1, h2, m, m1, m2), slope)


@packed
def radius_since(a, i, s, waves, form):
    """Return the radius at a flight's begin, its increase since, and `known` of docs/lanes.md."""
    if waves is None:
        return a[rows.R0 + i], s * a[rows.MEAN_RATE + i], a[rows.BEFORE + i] - a[rows.BACK + i]
    law, sine, cosine, turn = waves.r, a[rows.PHASE_SINE + i], a[rows.PHASE_COSINE + i], waves.omega * s
    more, less = beyond_first_order(turn)
    across = turn + more  # sin and, in `less`, cos - 1 of the turn
    even, odd = wave_parts(law, 1, sine, cosine)
    r, dr = law[0] + even, fma(odd, across, even * less)
    if len(form) == TWO_WAVES:
        even, odd = wave_parts(law, 2, *twice(sine, cosine))
        r, dr = r + even, fma(2.0 * across, fma(odd, 1.0 + less, -even * across), dr)
        return r, dr, LONGEST_TURN - 2.0 * turn
    return r, dr, LONGEST_TURN - turn


@packed
def room_ahead(a, i, s, delta, waves):
    """Return for how long after a flight's end, as guessed and as corrected, the laws used there hold."""
    if waves is None:
        u, limit = a[rows.BEFORE + i] + s, a[rows.LIMIT + i]
        return limit - abs(u), limit - abs(u + delta)
    return 1.0, 1.0


@packed
def move_laws(a, i, delta, at_hit, waves, slope):
    """Take the laws at the hit, `delta` after the end that was guessed, for the present ones."""
    if waves is None:
        write_laws(a, rows.R0 + i, at_hit, slope)
    else:
        sine, cosine, turn = a[rows.AHEAD + i], a[rows.AHEAD + rows.STRIDE + i], waves.omega * delta
        a[rows.PHASE_SINE + i], a[rows.PHASE_COSINE + i] = fma(turn, cosine, sine), fma(-turn, sine, cosine)


@part
def set_piece(a, i, piece, laws):
    """Give a lane a piece of the laws whose reference time it has."""
    a[rows.PIECE + i], a[rows.END + i] = piece, a[rows.REF + i] + laws.pieces.serves[piece]
    a[rows.BACK + i], a[rows.LIMIT + i] = -laws.pieces.limits[piece], laws.pieces.limits[piece]
    if laws.scene.laws[RADIUS, KIND] == CONSTANT:
        a[rows.BACK + i] = -rows.NEVER
    for row in range(4):
        # The lane has 0 where no piece has anything else.
        n_coefficients = 1 if laws.scene.laws[row, KIND] == CONSTANT else laws.form + 2
        for j in range(n_coefficients):
            a[rows.LAWS + (row * rows.N_COEFFICIENTS + j) * rows.STRIDE + i] = laws.pieces.coefficients[
                piece, row, j
            ]


@kernel
def set_reference(a, i, t, t_low, laws):
    """Give a lane the piece of the laws that serves at a time; END is minus infinity where none does."""
    if not abs(t) < laws.pieces.until:
        a[rows.END + i] = -rows.NEVER
        return
    piece, a[rows.REF + i], a[rows.REF_LOW + i] = piece_at(laws.pieces, t, t_low)
    set_piece(a, i, piece, laws)


@kernel
def know_laws(a, i, early, laws):
    """Find a lane's laws at its time, of pieces by that which serves so much earlier.

    END is minus infinity where they are out of reach.
    """
    t, t_low = a[rows.T + i], a[rows.T_LOW + i]
    if not laws.is_waves:
        set_reference(a, i, t - early, t_low, laws)
        if laws.form == PARABOLA:
            read_pieces(a, i, rows.R0 + i, 0.0, laws.scene.is_relative, None, SHORT)
        else:
            read_pieces(a, i, rows.R0 + i, 0.0, laws.scene.is_relative, None, LONG)
    elif abs(t) < laws.pieces.until:
        sine, _, cosine, _, _ = sine_cosine(laws.waves.omega, laws.waves.omega_low, 1.0, t, t_low)
        a[rows.PHASE_SINE + i], a[rows.PHASE_COSINE + i] = sine, cosine
        a[rows.END + i] = rows.NEVER
    else:
        a[rows.END + i] = -rows.NEVER
