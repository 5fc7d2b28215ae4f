"""Pools of particles side by side: what a lane holds, and how particles are put into lanes.

A lane knows its laws as polynomials about a reference time: see fast.kernel.pieces.
"""

from __future__ import annotations

import numpy as np

from fast.kernel.arithmetic import fma
from fast.kernel.codes import ARC, BASE, FLOOR, LEFT, RIGHT
from fast.kernel.compiling import kernel, packed, part
from fast.kernel.pieces import LONG, PARABOLA, SHORT, law_at, piece_at, third_derivative
from fast.kernel.records import CONSTANT, KIND, RADIUS

LANES = 64  # all rows of a pool stay in the first-level cache
# How far rows are apart. Were it a divisor of 4096 bytes, rows would meet in few sets of the cache, and a
# load would wait for stores to rows whose addresses end alike.
STRIDE = 72
NEVER = np.inf

# Rows of a pool, in one flat array: constant strides let the loops vectorise.
(
    T, T_LOW, X, Y, VX, VY, WALL,  # state at the last collision
    R0, R1, R2, R3, W0, W1, W2, H0, H1, H2, M0, M1, M2,  # radius, half-width, depth, slope; derivatives
    REF, REF_LOW, END, LIMIT, BACK,  # the laws' reference time, until when it serves; how far they hold
    PIECE,  # which of them it is
    AS_GIVEN,  # 1 where its distance from the arc is still that of a start that names it; hops keep it
    STOP, CLOSED, SPIN,  # next time to look at the particle; end of a captured stay; angular momentum in one
    HIT, SURE, S,  # the step: wall, mouth, time
    OK, ROUTINE,  # is it right, and is nothing else to do
    NEXT_T, NEXT_T_LOW, NEXT_X, NEXT_X_LOW, NEXT_Y, NEXT_Y_LOW,  # state after it
    NEXT_R0, NEXT_R1, NEXT_R2, NEXT_R3, NEXT_W0, NEXT_W1, NEXT_W2, NEXT_H0, NEXT_H1, NEXT_H2,  # laws there
    NEXT_M0, NEXT_M1, NEXT_M2,
    NEXT_VX, NEXT_VY, DONE,  # velocity after it where a careful step has found it
    SINCE, UNTIL, STAY_IN, STAY_OUT,  # a captured stay that spans an instant between is kept; begin and end
    N_ARC, N_BASE, N_LEFT, N_RIGHT, N_FLOOR,  # collisions so far
    # What a step's first loop tells its second: the flight's begin since REF, the radius's mean rate, the
    # half-width's low part.
    BEFORE, MEAN_RATE, NEXT_W0_LOW,
    LAWS,  # from here on the laws' coefficients: see Pieces.coefficients
) = STRIDE * np.arange(70)  # fmt: skip
N_COEFFICIENTS = 16  # of each law, as many as the highest degree asks for
N_ROWS = 69 + 4 * N_COEFFICIENTS
RADIUS_LAW, WIDTH_LAW, DEPTH_LAW, SLOPE_LAW = LAWS + STRIDE * N_COEFFICIENTS * np.arange(4)
# Codes of walls as they stand in a row, and of OK: out of the laws' reach, not shown right, to be corrected,
# right.
ON_ARC, ON_BASE, ON_LEFT, ON_RIGHT, ON_FLOOR = map(float, (ARC, BASE, LEFT, RIGHT, FLOOR))
FAR, REFUSED, COARSE, CERTAIN = -1.0, 0.0, 1.0, 2.0
POOL_SIZE = np.int64(N_ROWS * STRIDE)
REGISTER = np.int64(8)  # lanes of the widest registers


@part
def whole_registers(n):
    """Return the number of lanes rounded up to whole registers: what they hold too many is not looked at.

    One lane alone is left alone: what is done for it is then not packed, and roots and quotients come sooner.
    """
    return n if n == 1 else (n + REGISTER - 1) // REGISTER * REGISTER


@part
def set_piece(a, i, piece, scene, pieces, degree):
    """Give a lane a piece of the laws whose reference time it has."""
    a[PIECE + i], a[END + i] = piece, a[REF + i] + pieces.serves[piece]
    a[BACK + i], a[LIMIT + i] = -pieces.limits[piece], pieces.limits[piece]
    if scene.laws[RADIUS, KIND] == CONSTANT:
        a[BACK + i] = -NEVER
    if a[AS_GIVEN + i] > 0.0:  # no chord may begin there: through the base it would not be a hop
        a[BACK + i] = NEVER
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


@packed
def law_of(a, place, u, degree):
    """Return a law of a lane, which begins at `place`, and two derivatives at a time since its reference."""
    f, rate, bend, _ = law_at(a, place, STRIDE, u, u, degree)
    return f, rate, bend


@packed
def width_of(a, i, u, r, r1, r2, is_relative, degree):
    """Return the half-width of a lane and two derivatives, and the value's low part; see `law_of`."""
    w, w1, w2 = law_of(a, WIDTH_LAW + i, u, degree)
    w2 = fma(w2, r, fma(w, r2, 2.0 * w1 * r1)) if is_relative else w2
    w1 = fma(w1, r, w * r1) if is_relative else w1
    nu = w
    w = nu * r if is_relative else nu
    return w, w1, w2, fma(nu, r, -w) if is_relative else 0.0


@kernel
def write_laws(a, i, place, u, scene, degree):
    """Write a lane's laws at a time since its reference, in the thirteen rows from `place` on."""
    r, r1, r2 = law_of(a, RADIUS_LAW + i, u, degree)
    w, w1, w2, _ = width_of(a, i, u, r, r1, r2, scene.is_relative, degree)
    h, h1, h2 = law_of(a, DEPTH_LAW + i, u, degree)
    m, m1, m2 = law_of(a, SLOPE_LAW + i, u, degree)
    r3 = third_derivative(a, RADIUS_LAW + i, STRIDE, u, degree)
    for j, number in enumerate((r, r1, r2, r3, w, w1, w2, h, h1, h2, m, m1, m2)):
        a[place + j * STRIDE + i] = number


@kernel
def set_laws(a, i, place, t, t_low, scene, degree):
    """Write a lane's laws at a time in its piece; the degree is a number here, and the lane one of many."""
    u = (t - a[REF + i]) + (t_low - a[REF_LOW + i])
    if degree == PARABOLA:
        write_laws(a, i, place, u, scene, SHORT)
    else:
        write_laws(a, i, place, u, scene, LONG)


@part
def load(a, i, particle, stop, is_first_kept):
    """Put a particle into a lane; its laws are unknown there, so its first step will be careful."""
    for row in range(N_ROWS):
        a[row * STRIDE + i] = 0.0
    a[T + i], a[T_LOW + i] = particle.t, particle.t_low
    a[X + i], a[Y + i], a[VX + i], a[VY + i] = particle.x, particle.y, particle.vx, particle.vy
    a[WALL + i] = particle.wall
    # Any stay serves, or none until the mouth has narrowed.
    any_serves = -NEVER if is_first_kept else NEVER
    a[STOP + i], a[SINCE + i], a[UNTIL + i] = stop, any_serves, -any_serves
    a[STAY_IN + i] = a[STAY_OUT + i] = a[CLOSED + i] = NEVER
    a[END + i] = -NEVER


@kernel
def copy_rows(a, i, b, j, first, last):
    """Copy what lane i of one pool holds to lane j of another, from one row up to another."""
    for row in range(first, last, STRIDE):
        b[row + j] = a[row + i]


@part
def change_lane(a, i, b, j):
    """Copy lane i of one pool to lane j of another."""
    copy_rows(a, i, b, j, T, POOL_SIZE)


@part
def fold(a, i, scene, pieces, degree):
    """Bring an unfolded particle back to y >= 0, with the laws that the disk has no use for."""
    if a[Y + i] < 0.0:
        a[Y + i] = -a[Y + i]
        a[VY + i] = -a[VY + i]
    a[SPIN + i] = 0.0
    a[WALL + i] = ON_ARC
    set_reference(a, i, a[T + i], a[T_LOW + i], scene, pieces, degree)
    set_laws(a, i, R0, a[T + i], a[T_LOW + i], scene, degree)


@part
def refold(a, i):
    """Bring an unfolded particle of a cap back to y >= 0; its wall is known since it first hit the arc.

    One that is below y = 0 as it leaves the base was given so, within what a start may be off its wall.
    """
    if a[Y + i] < 0.0 and a[WALL + i] == ON_ARC:
        a[Y + i], a[VY + i] = -a[Y + i], -a[VY + i]
    a[SPIN + i] = 0.0
