"""What is kept of a lane whose next flight passes the last stop, so that it can go on with later stops.

A last state does not do: it lies in the middle of a flight, and a flight that begins there is rounded
otherwise than the one that passes. Kept is the lane as `attend` meets it, and the step that the lanes have
found where that is right. What came before does not look at later stops: a lane looks no further than its
next one. What comes after is decided by what is kept:

- where the step is right, `attend` and the bounce read it, the state, the stay and the counts;
- where it is not, a careful step reads the state alone. A captured particle is folded back instead, and
  kept where it is met next;
- the piece of the laws is kept by its number and its reference time. It is not always the one that serves at
  the lane's time: a flight that ran out of its piece was given another in mid-flight. For the same reason the
  step is kept and not found again: it may have been found with two pieces.

What nobody reads is not kept, so that a particle leaves the same bits whoever flew beside it.
"""

from __future__ import annotations

import numpy as np

from fast.kernel.codes import ANEW, NO_WALL
from fast.kernel.compiling import kernel

from fast.kernel.pools import (  # isort: skip
    CERTAIN, CLOSED, END, HIT, NEVER, NEXT_R0, NEXT_T, NEXT_T_LOW, NEXT_X, NEXT_X_LOW, NEXT_Y, NEXT_Y_LOW,
    N_ARC, N_BASE, N_FLOOR, N_LEFT, N_RIGHT, N_ROWS, OK, PIECE, REF, REF_LOW, SINCE, SPIN, STAY_IN, STAY_OUT,
    STRIDE, T, T_LOW, UNTIL, VX, VY, WALL, X, Y, set_piece,
)  # fmt: skip
from fast.kernel.worker import DISK, GENERAL, NEXT_STOP, PARTICLE

# Columns of what is kept: the pool, the number of the next stop, and careful steps so far; then these rows of
# the pool; of the step the wall, NO_WALL where it is not right, and these rows; the laws after it.
POOL, NEXT, CAREFUL = np.arange(3)
STATE = (T, T_LOW, X, Y, VX, VY, WALL, SPIN, SINCE, UNTIL, STAY_IN, STAY_OUT)
ROWS = np.array([*STATE, N_ARC, N_BASE, N_LEFT, N_RIGHT, N_FLOOR, REF, REF_LOW])
STEP = np.array([NEXT_T, NEXT_T_LOW, NEXT_X, NEXT_X_LOW, NEXT_Y, NEXT_Y_LOW])
N_LAWS, N_LAWS_OF_DISK, N_LAWS_BUT_SLOPE = 13, 6, 10  # rows of laws after a step, and which of them are read
FIRST_ROW = 3
OWN_PIECE = FIRST_ROW + len(ROWS)
WALL_HIT = OWN_PIECE + 1
FIRST_OF_STEP = WALL_HIT + 1
FIRST_OF_LAWS = FIRST_OF_STEP + len(STEP)
LANE_ROWS = FIRST_OF_LAWS + N_LAWS


@kernel
def keep_lane(pool, a, i, roster, is_certain, worker):
    """Keep a lane as it is before it is attended to."""
    j, followed = roster[PARTICLE, i], worker.followed
    out = followed.lanes[j]
    out[:] = 0.0
    out[POOL], out[NEXT], out[CAREFUL] = pool, roster[NEXT_STOP, i], followed.careful[j]
    for k in range(len(ROWS)):
        out[FIRST_ROW + k] = a[ROWS[k] + i]
    out[OWN_PIECE] = a[PIECE + i] if a[END + i] > -NEVER else -1.0
    out[WALL_HIT] = NO_WALL
    if is_certain:
        out[WALL_HIT] = a[HIT + i]
        for k in range(len(STEP)):
            out[FIRST_OF_STEP + k] = a[STEP[k] + i]
        n_laws = N_LAWS_OF_DISK if pool == DISK else (N_LAWS if worker.is_slope_moving else N_LAWS_BUT_SLOPE)
        for k in range(n_laws):
            out[FIRST_OF_LAWS + k] = a[NEXT_R0 + k * STRIDE + i]


@kernel
def take_lane(a, i, roster, j, worker):
    """Put a kept particle into a lane, before it is attended to; returns its pool, or -1 for none."""
    kept = worker.followed.lanes[j]
    if not kept[POOL] >= 0.0:
        worker.followed.codes[j] = ANEW
        return np.int64(-1)
    for row in range(N_ROWS):
        a[row * STRIDE + i] = 0.0
    roster[PARTICLE, i], roster[NEXT_STOP, i] = j, int(kept[NEXT])
    worker.followed.careful[j] = int(kept[CAREFUL])
    for k in range(len(ROWS)):
        a[ROWS[k] + i] = kept[FIRST_ROW + k]
    a[CLOSED + i] = NEVER
    a[END + i] = -NEVER
    if kept[OWN_PIECE] >= 0.0:
        set_piece(a, i, int(kept[OWN_PIECE]), worker.scene, worker.pieces, worker.degree)
    if kept[WALL_HIT] >= 0.0:
        a[HIT + i], a[OK + i] = kept[WALL_HIT], CERTAIN
        for k in range(len(STEP)):
            a[STEP[k] + i] = kept[FIRST_OF_STEP + k]
        for k in range(N_LAWS):
            a[NEXT_R0 + k * STRIDE + i] = kept[FIRST_OF_LAWS + k]
    return DISK if kept[POOL] > 0.0 else GENERAL
