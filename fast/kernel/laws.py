"""A scene's laws in compiled code: anchored at the last event, then their increments since.

Idea. A law gives f(t + s) - f(t) without cancellation, so a wall met again soon after it was
left is found to full precision whatever t is; the anchors themselves come from the time as a pair
(t_hi, t_lo), so no digit of the phase is lost in long runs.

The columns of `laws` and `anchors` are those of fast.kernel.records. Times to knots are sums of two floats
throughout: a wall that is met again just after a knot has moved by the square of the time since then, and
its speed is that time's multiple, so that time must be right relative to itself, not to the period that its
knots are written in. All Fourier laws of a scene share their omega, so the sines and cosines of the harmonics
are found once for all of them, at the event (row PHASE) and for the turn since then, at one s (row TURN).

`row_of` lays out a law as the numbers that all this reads. What a path in pairs of floats asks of a law is
at the end (`fine_law`, `fine_increment`). So the scalar step knows a kind of law by this file alone, and by
its number and columns in fast.kernel.records. Lanes take those kinds that are IN_LANES (fast.pieces and
fast.kernel.lane_laws read their numbers), and the scalar step takes the others.

A size is used as if its value were right to a unit or two in its last place. Its terms are known to
2^-62 of themselves, which is enough where they leave more than a small part of the mean; where they cancel
further, and a mouth all but closes, the phases are found again to twice as many digits (`is_cancelled`).
"""

from fractions import Fraction
from itertools import pairwise, zip_longest

import numpy as np

from fast.kernel.arithmetic import (
    HALF_PI,
    MAX_QUADRANT,
    SAFETY,
    TWO_OVER_PI,
    add,
    beyond_first_order,
    fine_sine_cosine,
    mul,
    sine_cosine,
    split,
    sub,
    times,
    two_product,
    two_sum,
)
from fast.kernel.compiling import kernel, part

from fast.kernel.records import (  # isort: skip
    AMPLITUDES, BANG_BANG, CONSTANT, COSINE, COSINE_LOW, DEPTH, FOURIER, HALF_LEG, IS_SHORT, KIND, KNOTS,
    LEVEL, N_HARMONICS, N_KNOTS, OMEGA, OMEGA_LOW, PERIOD, PERIOD_LOW, PHASE, PHASE_ERROR, RADIUS, RATE,
    ROOM, ROOM_LOW, SHARED, SINE, SINE_LOW, SLOPE, TERMS, TURN, TURN_TIME, VALUE, VALUE_LOW, WIDTH,
)  # fmt: skip
from scene import BangBang, Fourier, Law
from scene.pieces import Period

# Part of its mean below which a size's terms cancel so far that their rounding shows in it. The terms of one
# that stays positive add up to at most 46 times its mean (sixteen harmonics, each below twice the mean).
CANCELLED = 2.0**-4
ZERO = (0.0, 0.0)
# Kinds that lanes know, as waves or as pieces. A scene with a law of another kind is left to the scalar step.
IN_LANES = (CONSTANT, FOURIER, BANG_BANG)


def omega_of(cycle: Period) -> tuple[float, float]:
    """Return a frequency as a sum of two floats: exact if given, else 2 pi / period to 2^-106."""
    if cycle.omega is not None:
        return cycle.omega, 0.0
    assert cycle.length is not None
    high, low = split(4 * HALF_PI / cycle.length)
    return high, low


def row_of(law: Law) -> list[float]:
    """Lay out a law as a row of `laws`: the only function of this package that asks for its kind."""
    if law.cycle is None:
        return [CONSTANT, law.level, 0.0, 0.0]
    match law:
        case Fourier():
            harmonics = list(zip_longest(law.cos, law.sin, fillvalue=0.0))
            cos, sin = zip(*harmonics, strict=True)
            return [FOURIER, law.mean, omega_of(law.cycle)[0], len(harmonics), *cos, *sin]
        case BangBang():
            times, values = zip(*law.knots, strict=True)
            accelerations = [
                4 * (Fraction(v1) - Fraction(v0)) / (Fraction(t1) - Fraction(t0)) ** 2
                for (t0, v0), (t1, v1) in pairwise(law.knots)
            ] + [Fraction(0)]  # one for every knot keeps the columns simple
            highs, lows = zip(*map(split, accelerations), strict=True)
            period, period_low = split(law.length)
            return [BANG_BANG, 0.0, period, len(times), period_low, *times, *values, *highs, *lows]
    raise TypeError(f"{type(law).__name__}: fast has no kernel for this kind of law")


@part
def set_phases(laws, anchors, t_hi, t_lo):
    """Store the sines and cosines of all harmonics at t; False when t is out of reach."""
    anchors[TURN, TURN_TIME] = -1.0
    omega, omega_low, worst = laws[SHARED, OMEGA], laws[SHARED, OMEGA_LOW], 0.0
    for k in range(1, int(laws[SHARED, N_HARMONICS]) + 1):
        s, s_low, c, c_low, is_reduced = sine_cosine(omega, omega_low, float(k), t_hi, t_lo)
        if not is_reduced:
            return False
        anchors[PHASE, SINE + k] = s
        anchors[PHASE, COSINE + k] = c
        anchors[PHASE, SINE_LOW + k] = s_low
        anchors[PHASE, COSINE_LOW + k] = c_low
        worst = max(worst, min(abs(s), abs(c)))
    # What the low parts lack: the sixth power of the angle from the nearest quarter turn.
    anchors[PHASE, PHASE_ERROR] = 2.0**-59 * worst**6 + 2.0**-98
    return True


@kernel
def set_fine_phases(laws, anchors, t_hi, t_lo):
    """Store the sines and cosines of all harmonics at t, within reach, as `set_phases` does, to 2^-98.

    Of the phase, that is: it is itself rounded to 2^-104 of itself, which moves t by no more of itself.
    """
    turn = mul((laws[SHARED, OMEGA], laws[SHARED, OMEGA_LOW]), (t_hi, t_lo))
    for k in range(1, int(laws[SHARED, N_HARMONICS]) + 1):
        sine, cosine, _ = fine_sine_cosine(times(float(k), turn))
        anchors[PHASE, SINE + k], anchors[PHASE, SINE_LOW + k] = sine
        anchors[PHASE, COSINE + k], anchors[PHASE, COSINE_LOW + k] = cosine
    anchors[PHASE, PHASE_ERROR] = 2.0**-98


@part
def set_turn(laws, anchors, s):
    """Store cos(d) - 1 and sin(d) or, while all d are small, sin(d) - d, for the phases d = k omega s."""
    n = int(laws[SHARED, N_HARMONICS])
    omega, omega_low = laws[SHARED, OMEGA], laws[SHARED, OMEGA_LOW]
    is_short = 0.5 * n * omega * s < 0.75
    anchors[TURN, TURN_TIME] = s
    anchors[TURN, IS_SHORT] = 1.0 if is_short else 0.0
    for k in range(1, n + 1):
        half = 0.5 * k * omega * s
        if is_short:
            more, less = beyond_first_order(half)
            sine = half + more
            anchors[TURN, SINE + k] = 2.0 * (more + sine * less)
        else:
            sine, _, cosine, _, _ = sine_cosine(omega, omega_low, 0.5 * k, s, 0.0)
            anchors[TURN, SINE + k] = 2.0 * sine * cosine
        anchors[TURN, COSINE + k] = -2.0 * sine * sine


@part
def phase_room(laws, t):
    """Return for how long after t the phases of all laws are known."""
    room, omega = np.inf, laws[SHARED, OMEGA]
    if omega > 0.0:
        room = MAX_QUADRANT / (TWO_OVER_PI * omega * laws[SHARED, N_HARMONICS]) - abs(t)
    for row in (RADIUS, WIDTH, DEPTH, SLOPE):
        if laws[row, KIND] == BANG_BANG:
            room = min(room, MAX_QUADRANT * laws[row, PERIOD] - abs(t - laws[row, KNOTS]))
    return room


@kernel
def set_anchors(laws, anchors, t_hi, t_lo):
    """Anchor all four laws at t; False when t is out of reach.

    A constant law has a value alone: what else is asked of it is the 0 that anchors begin with.
    """
    if not set_phases(laws, anchors, t_hi, t_lo):
        return False
    for row in (RADIUS, WIDTH, DEPTH, SLOPE):
        if laws[row, KIND] == CONSTANT:
            anchors[row, VALUE] = laws[row, LEVEL]
        elif laws[row, KIND] == FOURIER:
            set_waves(laws, anchors, row)
        elif not set_leg(laws, anchors, row, t_hi, t_lo):
            return False
    if is_cancelled(laws, anchors):
        set_fine_phases(laws, anchors, t_hi, t_lo)
        for row in (RADIUS, WIDTH, DEPTH, SLOPE):
            if laws[row, KIND] == FOURIER:
                set_waves(laws, anchors, row)
    return True


@part
def is_cancelled(laws, anchors):
    """Tell whether a Fourier law that is a size is so small now that its terms must be known better."""
    for row in (RADIUS, WIDTH, DEPTH):
        if laws[row, KIND] == FOURIER and anchors[row, VALUE] < CANCELLED * laws[row, LEVEL]:
            return True
    return False


@kernel
def add_product(total, low, a, b, b_low):
    """Return total + low + a (b + b_low), as a sum of two floats."""
    p, e = two_product(a, b)
    total, f = two_sum(total, p)
    return total, low + (e + f + a * b_low)


@part
def set_waves(laws, anchors, row):
    """Anchor a Fourier law from the phases stored; its terms may cancel, hence sums of two floats."""
    n = int(laws[row, N_HARMONICS])
    f, f_low = laws[row, LEVEL], 0.0
    rate, rate_low = 0.0, 0.0
    size = 0.0
    for k in range(1, n + 1):
        s, s_low = anchors[PHASE, SINE + k], anchors[PHASE, SINE_LOW + k]
        c, c_low = anchors[PHASE, COSINE + k], anchors[PHASE, COSINE_LOW + k]
        a, b = laws[row, AMPLITUDES + k], laws[row, AMPLITUDES + n + k]
        f, f_low = add_product(f, f_low, a, c, c_low)
        f, f_low = add_product(f, f_low, b, s, s_low)
        kc, kc_low = two_product(float(k), c)
        ks, ks_low = two_product(float(k), s)
        rate, rate_low = add_product(rate, rate_low, b, kc, kc_low + k * c_low)
        rate, rate_low = add_product(rate, rate_low, -a, ks, ks_low + k * s_low)
        size += k * (abs(a) + abs(b))
    anchors[row, VALUE], anchors[row, VALUE_LOW] = two_sum(f, f_low)
    anchors[row, RATE] = laws[row, OMEGA] * (rate + rate_low)
    anchors[row, TERMS] = laws[row, OMEGA] * size


@kernel
def time_since(knot, n_periods, period, period_low, t_hi, t_lo):
    """Return t - (knot + n_periods period) as a sum of two floats."""
    d, e = two_sum(t_hi, -knot)
    p, q = two_product(n_periods, period)
    difference, f = two_sum(d, -p)
    return two_sum(difference, f + ((e - q) + (t_lo - n_periods * period_low)))


@kernel
def whole_periods(first, period, period_low, t_hi, t_lo):
    """Return how many whole periods lie between `first` and t, and the time since the last of them."""
    n_periods = np.floor((t_hi - first) / period)
    tau, _ = time_since(first, n_periods, period, period_low, t_hi, t_lo)
    if tau < 0.0:
        n_periods -= 1.0
    elif tau >= period + period_low:
        n_periods += 1.0
    tau, _ = time_since(first, n_periods, period, period_low, t_hi, t_lo)
    return n_periods, tau


@kernel
def leg_at(laws, row, t_hi, t_lo):
    """Return the number of the leg that a bang-bang law is in, and how many whole periods have gone by."""
    period, period_low = laws[row, PERIOD], laws[row, PERIOD_LOW]
    n_periods, _ = whole_periods(laws[row, KNOTS], period, period_low, t_hi, t_lo)
    i = 0
    while i < int(laws[row, N_KNOTS]) - 2:
        since_next, _ = time_since(laws[row, KNOTS + i + 1], n_periods, period, period_low, t_hi, t_lo)
        if since_next < 0.0:
            break
        i += 1
    return i, n_periods


@kernel
def on_parabola(value, a, a_low, u, u_low):
    """Return value + a u^2 / 2 as a sum of two floats, and a u."""
    p, p_low = two_product(u, u)
    q, q_low = two_product(0.5 * a, p)
    f, f_low = two_sum(value, q)
    return f, f_low + (q_low + (0.5 * a * (p_low + 2.0 * u * u_low) + 0.5 * a_low * p)), a * (u + u_low)


@part
def set_leg(laws, anchors, row, t_hi, t_lo):
    """Anchor a bang-bang law: its nearer knot gives value and derivative without cancellation."""
    n = int(laws[row, N_KNOTS])
    period, period_low = laws[row, PERIOD], laws[row, PERIOD_LOW]
    i, n_periods = leg_at(laws, row, t_hi, t_lo)
    if not abs(n_periods) < MAX_QUADRANT:
        return False
    before, after = laws[row, KNOTS + i], laws[row, KNOTS + i + 1]
    length, length_low = two_sum(after, -before)
    a, a_low = laws[row, KNOTS + 2 * n + i], laws[row, KNOTS + 3 * n + i]
    u, u_low = time_since(before, n_periods, period, period_low, t_hi, t_lo)
    room, room_low = sub((0.5 * length, 0.5 * length_low), (u, u_low))
    if room > 0.0:
        f, f_low, rate = on_parabola(laws[row, KNOTS + n + i], a, a_low, u, u_low)
        anchors[row, HALF_LEG] = 2.0 * i
    else:
        u, u_low = time_since(after, n_periods, period, period_low, t_hi, t_lo)
        f, f_low, rate = on_parabola(laws[row, KNOTS + n + i + 1], -a, -a_low, u, u_low)
        anchors[row, HALF_LEG] = 2.0 * i + 1.0
        room, room_low = -u, -u_low
    anchors[row, VALUE], anchors[row, VALUE_LOW] = two_sum(f, f_low)
    anchors[row, RATE] = rate
    anchors[row, ROOM], anchors[row, ROOM_LOW] = room, room_low
    return True


@kernel
def increment(laws, anchors, row, s):
    """Return f(t + s) - f(t), f'(t + s), and the summed sizes of the terms of both."""
    if laws[row, KIND] == FOURIER:
        if s == 0.0:
            return 0.0, anchors[row, RATE], 0.0, anchors[row, TERMS]
        if s != anchors[TURN, TURN_TIME]:
            set_turn(laws, anchors, s)
        return waves_increment(laws, anchors, row, s)
    if laws[row, KIND] == BANG_BANG:
        return legs_increment(laws, anchors, row, s)
    return 0.0, 0.0, 0.0, 0.0


@part
def waves_increment(laws, anchors, row, s):
    """Return `increment` of a Fourier law for the turn stored."""
    n = int(laws[row, N_HARMONICS])
    is_short = anchors[TURN, IS_SHORT] > 0.0
    # What goes with s at first order is f' s, and f' is known better than its terms' sum.
    change = anchors[row, RATE] * s if is_short else 0.0
    size = abs(change)
    d_rate = 0.0
    for k in range(1, n + 1):
        down, across = anchors[TURN, COSINE + k], anchors[TURN, SINE + k]
        sine, cosine = anchors[PHASE, SINE + k], anchors[PHASE, COSINE + k]
        a, b = laws[row, AMPLITUDES + k], laws[row, AMPLITUDES + n + k]
        change += (a * cosine + b * sine) * down + (b * cosine - a * sine) * across
        size += (abs(a) + abs(b)) * (abs(down) + abs(across))
        if is_short:
            across += k * laws[SHARED, OMEGA] * s
        d_rate += k * ((b * cosine - a * sine) * down - (a * cosine + b * sine) * across)
    return change, anchors[row, RATE] + laws[row, OMEGA] * d_rate, size, anchors[row, TERMS]


@kernel
def bend_of_half_leg(laws, row, j):
    """Return the second derivative of a bang-bang law in its half-leg j."""
    a = laws[row, KNOTS + 2 * int(laws[row, N_KNOTS]) + j // 2]
    return -a if j % 2 else a


@kernel
def leg_after(laws, anchors, row, s):
    """Walk the half-legs of a bang-bang law for a time s.

    Returns (half-leg, time since the walk entered it, time to its end, derivative at its entry, increase up
    to there, size of that increase's terms).
    """
    n_half_legs = 2 * (int(laws[row, N_KNOTS]) - 1)
    j = int(anchors[row, HALF_LEG])
    room, room_low = anchors[row, ROOM], anchors[row, ROOM_LOW]
    rate, change, size, beyond = anchors[row, RATE], 0.0, 0.0, 0.0
    period, period_low = laws[row, PERIOD], laws[row, PERIOD_LOW]
    n_periods, _ = whole_periods(0.0, period, period_low, s, 0.0)
    left, left_low = time_since(0.0, n_periods, period, period_low, s, 0.0)
    for _ in range(n_half_legs + 1):
        beyond, beyond_low = sub((left, left_low), (room, room_low))
        if beyond < 0.0:
            break
        a = bend_of_half_leg(laws, row, j)
        change += room * (rate + 0.5 * a * room)
        size += room * (abs(rate) + 0.5 * abs(a) * room)
        j = (j + 1) % n_half_legs
        i = j // 2
        length, length_low = two_sum(laws[row, KNOTS + i + 1], -laws[row, KNOTS + i])
        # At a knot the law is at rest; in mid-leg it has what half the leg gave it.
        rate = 0.5 * bend_of_half_leg(laws, row, j - 1) * length if j % 2 else 0.0
        left, left_low = beyond, beyond_low
        room, room_low = 0.5 * length, 0.5 * length_low
    return j, left, max(-beyond, 0.0), rate, change, size


@part
def legs_increment(laws, anchors, row, s):
    """Return `increment` of a bang-bang law by walking its half-legs, each a parabola."""
    j, step, _, rate, change, size = leg_after(laws, anchors, row, s)
    a = bend_of_half_leg(laws, row, j)
    change += step * (rate + 0.5 * a * step)
    size += step * (abs(rate) + 0.5 * abs(a) * step)
    return change, rate + a * step, size, abs(rate) + abs(a) * step


@kernel
def width(scene, anchors, s):
    """Return w(t), w(t + s) - w(t), w'(t + s) and the sizes of both, for w = nu r or w itself."""
    d_w, rate, size, rate_size = increment(scene.laws, anchors, WIDTH, s)
    w = anchors[WIDTH, VALUE]
    if not scene.is_relative:
        return w, d_w, rate, size, rate_size
    d_r, r_rate, r_size, r_rate_size = increment(scene.laws, anchors, RADIUS, s)
    r = anchors[RADIUS, VALUE]
    return (
        w * r,
        d_w * (r + d_r) + w * d_r,
        rate * (r + d_r) + (w + d_w) * r_rate,
        size * (abs(r) + r_size) + w * r_size,
        rate_size * (abs(r) + r_size) + (w + size) * r_rate_size,
    )


@kernel
def rest(laws, anchors, row, s):
    """Return for how long after the time s a law stands still; 0 when it moves, or is not known to rest."""
    if laws[row, KIND] == CONSTANT:
        return np.inf
    if laws[row, KIND] != BANG_BANG:
        return 0.0
    j, left, room, _, _, _ = leg_after(laws, anchors, row, s)
    if bend_of_half_leg(laws, row, j) != 0.0:
        return 0.0
    if j % 2 == 0:  # the leg's other half is at rest too
        i = j // 2
        room += 0.5 * (laws[row, KNOTS + i + 1] - laws[row, KNOTS + i])
    return max(room - SAFETY * (room + left), 0.0)


@kernel
def fine_frequency(laws, row):
    """Return a Fourier law's omega."""
    return laws[row, OMEGA], laws[SHARED, OMEGA_LOW]


@kernel
def fine_phase(laws, row, k, t):
    """Return k omega t."""
    return mul(times(k, fine_frequency(laws, row)), t)


@kernel
def fine_time_after(laws, row, i, n_periods, t):
    """Return the time since a knot of a bang-bang law, so many periods on.

    Knot and periods are added first: t may be short beside both.
    """
    periods = times(n_periods, (laws[row, PERIOD], laws[row, PERIOD_LOW]))
    return sub(t, add((laws[row, KNOTS + i], 0.0), periods))


@kernel
def fine_half_leg(laws, row, t):
    """Return where in a bang-bang law a time lies: half-leg, periods gone by, time from the nearer knot."""
    i, n_periods = leg_at(laws, row, t[0], t[1])
    u = fine_time_after(laws, row, i, n_periods, t)
    rest = fine_time_after(laws, row, i + 1, n_periods, t)
    if add(u, rest)[0] < 0.0:
        return 2 * i, n_periods, u
    return 2 * i + 1, n_periods, rest


@kernel
def fine_bend(laws, row, half_leg):
    """Return the second derivative in a half-leg."""
    n, i = int(laws[row, N_KNOTS]), half_leg // 2
    sign = -1.0 if half_leg % 2 else 1.0
    return sign * laws[row, KNOTS + 2 * n + i], sign * laws[row, KNOTS + 3 * n + i]


@kernel
def fine_law(laws, row, t):
    """Return a law's value and derivative; a constant law is a Fourier law without harmonics."""
    if laws[row, KIND] == BANG_BANG:
        half_leg, _, u = fine_half_leg(laws, row, t)
        a = fine_bend(laws, row, half_leg)
        knot = laws[row, KNOTS + int(laws[row, N_KNOTS]) + (half_leg + 1) // 2]
        return add((knot, 0.0), times(0.5, mul(a, mul(u, u)))), mul(a, u)
    n = int(laws[row, N_HARMONICS])
    f, rate = (laws[row, LEVEL], 0.0), ZERO
    for k in range(1, n + 1):
        sine, cosine, _ = fine_sine_cosine(fine_phase(laws, row, float(k), t))
        a, b = laws[row, AMPLITUDES + k], laws[row, AMPLITUDES + n + k]
        f = add(f, add(times(a, cosine), times(b, sine)))
        rate = add(rate, times(float(k), sub(times(b, cosine), times(a, sine))))
    return f, mul(fine_frequency(laws, row), rate)


@kernel
def fine_increment(laws, row, t, s):
    """Return a law's f(t + s) - f(t), without cancellation."""
    if laws[row, KIND] == BANG_BANG:
        half_leg, n_periods, u = fine_half_leg(laws, row, t)
        later, n_later, _ = fine_half_leg(laws, row, add(t, s))
        if later == half_leg and n_later == n_periods:
            return mul(mul(fine_bend(laws, row, half_leg), s), add(u, times(0.5, s)))
        return sub(fine_law(laws, row, add(t, s))[0], fine_law(laws, row, t)[0])
    n, change = int(laws[row, N_HARMONICS]), ZERO
    for k in range(1, n + 1):
        half = fine_phase(laws, row, 0.5 * k, s)
        sine, cosine, _ = fine_sine_cosine(add(fine_phase(laws, row, float(k), t), half))
        across, _, _ = fine_sine_cosine(half)
        a, b = laws[row, AMPLITUDES + k], laws[row, AMPLITUDES + n + k]
        change = add(change, mul(times(2.0, across), sub(times(b, cosine), times(a, sine))))
    return change
