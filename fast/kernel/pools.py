"""Pools of particles side by side: what a lane holds, and how particles are put into lanes.

A law in a lane is known from its value and two derivatives at a reference time; see fast.kernel.lanes.
"""

from __future__ import annotations

import numpy as np

from fast.kernel.arithmetic import SAFETY, fma
from fast.kernel.codes import ARC, BASE, FLOOR, LEFT, RIGHT
from fast.kernel.compiling import kernel, packed, part
from fast.kernel.laws import bend_of_half_leg

from fast.kernel.records import (  # isort: skip
    BANG_BANG, DEPTH, FOURIER, HALF_LEG, KIND, LEVEL, OMEGA, RADIUS, RATE, ROOM, VALUE, VALUE_LOW, WIDTH,
)  # fmt: skip
from fast.kernel.short import law, turns

LANES = 64  # all rows of a pool stay in the first-level cache
NEVER = np.inf

# Rows of a pool, LANES numbers each, in one flat array: constant strides let the loops vectorise.
(
    T, T_LOW, X, Y, VX, VY, WALL,  # state at the last collision
    R0, R1, R2, W0, W1, W2, H0, H1, H2,  # radius, half-width, depth there, with two derivatives
    REF, REF_LOW, END, KNOT,  # the laws' reference time, until when it serves, when the next knot comes
    R_REF, R_REF_LOW, R_REF1, R_REF2,  # radius there, its low part, two derivatives
    W_REF, W_REF_LOW, W_REF1, W_REF2,  # w or nu
    H_REF, H_REF_LOW, H_REF1, H_REF2,  # depth
    S, HIT, SURE, OK, ROUTINE,  # the step: time, wall, mouth; is it right, and is nothing else to do
    NEXT_T, NEXT_T_LOW, NEXT_X, NEXT_X_LOW, NEXT_Y, NEXT_Y_LOW, NEXT_VX, NEXT_VY, DONE,  # state after it
    NEXT_R0, NEXT_R1, NEXT_R2, NEXT_W0, NEXT_W1, NEXT_W2, NEXT_H0, NEXT_H1, NEXT_H2,
    STOP, SINCE, UNTIL,  # next time to look at the particle; a captured stay that spans one between is kept
    STAY_IN, STAY_OUT, CLOSED, SPIN,  # the captured stay, its end once it is over, angular momentum
    N_ARC, N_BASE, N_LEFT, N_RIGHT, N_FLOOR,  # collisions so far
) = LANES * np.arange(67)  # fmt: skip
N_ROWS = 67
# Codes of walls as they stand in a row, and of OK.
ON_ARC, ON_BASE, ON_LEFT, ON_RIGHT, ON_FLOOR = map(float, (ARC, BASE, LEFT, RIGHT, FLOOR))
REFUSED, COARSE, CERTAIN = 0.0, 1.0, 2.0
POOL_SIZE = N_ROWS * LANES
SERVES = 0.125  # omega times how long a reference serves for starting a flight


@kernel
def set_reference(a, i, scene, anchors):
    """Make the time of a lane's next state the reference of its laws, and give it their values there."""
    laws, t, end, knot = scene.laws, a[NEXT_T + i], NEVER, NEVER
    a[REF + i], a[REF_LOW + i] = t, a[NEXT_T_LOW + i]
    for row, place in ((RADIUS, R_REF + i), (WIDTH, W_REF + i), (DEPTH, H_REF + i)):
        f, rate, bend = anchors[row, VALUE], anchors[row, RATE], 0.0
        if laws[row, KIND] == FOURIER:
            bend = -laws[row, OMEGA] * laws[row, OMEGA] * (f - laws[row, LEVEL])
            end = min(end, t + SERVES / laws[row, OMEGA])
        elif laws[row, KIND] == BANG_BANG:
            bend = bend_of_half_leg(laws, row, int(anchors[row, HALF_LEG]))
            # Rounded down: a flight that ends before it ends before the half-leg does.
            knot = min(knot, (t + anchors[row, ROOM]) - SAFETY * (abs(t) + anchors[row, ROOM]))
        a[place], a[place + LANES] = f, anchors[row, VALUE_LOW]
        a[place + 2 * LANES], a[place + 3 * LANES] = rate, bend
    a[END + i], a[KNOT + i] = min(end, knot), knot
    set_laws(a, i, NEXT_R0, NEXT_W0, NEXT_H0, 0.0, scene)


@packed
def law_after(a, place, omega, g1, g2, g0):
    """Return a law and its derivatives from the rows of its reference, which begin at `place`."""
    return law(a[place], a[place + LANES], a[place + 2 * LANES], a[place + 3 * LANES], omega, g1, g2, g0)


@kernel
def law_of(a, place, row, laws, since):
    """Return a law and its derivatives at a time after its reference."""
    omega = laws[row, OMEGA] if laws[row, KIND] == FOURIER else 0.0
    g1, g2, g0 = turns(omega, since)
    return law_after(a, place, omega, g1, g2, g0)


@kernel
def set_laws(a, i, r_row, w_row, h_row, since, scene):
    """Write a lane's laws at a time after its reference."""
    r, r1, r2 = law_of(a, R_REF + i, RADIUS, scene.laws, since)
    w, w1, w2 = law_of(a, W_REF + i, WIDTH, scene.laws, since)
    h, h1, h2 = law_of(a, H_REF + i, DEPTH, scene.laws, since)
    if scene.is_relative:
        w, w1, w2 = w * r, fma(w1, r, w * r1), fma(w2, r, fma(w, r2, 2.0 * w1 * r1))
    a[r_row + i], a[r_row + LANES + i], a[r_row + 2 * LANES + i] = r, r1, r2
    a[w_row + i], a[w_row + LANES + i], a[w_row + 2 * LANES + i] = w, w1, w2
    a[h_row + i], a[h_row + LANES + i], a[h_row + 2 * LANES + i] = h, h1, h2


@part
def load(a, i, particle, stop, is_first_kept):
    """Put a particle into a lane; its laws are unknown there, so its first step will be careful."""
    for row in range(N_ROWS):
        a[row * LANES + i] = 0.0
    a[T + i], a[T_LOW + i] = particle.t, particle.t_low
    a[X + i], a[Y + i], a[VX + i], a[VY + i] = particle.x, particle.y, particle.vx, particle.vy
    a[WALL + i] = particle.wall
    # Any stay serves, or none until the mouth has narrowed.
    any_serves = -NEVER if is_first_kept else NEVER
    a[STOP + i], a[SINCE + i], a[UNTIL + i] = stop, any_serves, -any_serves
    a[STAY_IN + i] = a[STAY_OUT + i] = a[CLOSED + i] = NEVER
    a[END + i] = -NEVER


@kernel
def change_lane(a, i, b, j):
    """Copy lane i of one pool to lane j of another."""
    for row in range(N_ROWS):
        b[row * LANES + j] = a[row * LANES + i]


@part
def fold(a, i, scene):
    """Bring an unfolded particle back to y >= 0, with the laws that the disk has no use for."""
    if a[Y + i] < 0.0:
        a[Y + i] = -a[Y + i]
        a[VY + i] = -a[VY + i]
    a[SPIN + i] = 0.0
    a[WALL + i] = ON_ARC
    since = (a[T + i] - a[REF + i]) + (a[T_LOW + i] - a[REF_LOW + i])
    set_laws(a, i, R0, W0, H0, since, scene)


@part
def refold(a, i):
    """Bring an unfolded particle of a cap back to y >= 0, on the arc if it was unfolded at all."""
    if a[Y + i] < 0.0:
        a[Y + i], a[VY + i] = -a[Y + i], -a[VY + i]
    if a[SPIN + i] != 0.0:
        a[WALL + i] = ON_ARC
    a[SPIN + i] = 0.0
