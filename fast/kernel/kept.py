"""What is kept of a lane whose next flight passes the last stop, so that it can go on with later stops.

A last state does not do: it lies in the middle of a flight, and a flight that begins there is rounded
otherwise than the one that passes. Kept is the lane as `attend` meets it, before it moves on. Its flight is
found again, to the same bits: that hangs on the lane alone. The piece of the laws is kept by its number and
reference time. It is not always the one that serves at the lane's time: a flight that ran out of its piece
was given another in mid-flight.
"""

from __future__ import annotations

import numpy as np

from fast.kernel.compiling import kernel
from fast.kernel.lane_laws import set_piece

from fast.kernel.pools import (  # isort: skip
    END, NEVER, N_ROWS, PIECE, R1, REF, STOP, STRIDE, W0_LOW, WHEN,
)  # fmt: skip
from fast.kernel.worker import NEXT_STOP, PARTICLE

# Columns of what is kept: the pool, the number of the next stop, careful steps so far, whether the lanes know
# the laws; then the rows of the pool up to W0_LOW.
POOL, NEXT, CAREFUL, IS_KNOWN = np.arange(4)
FIRST_ROW = 4
LANE_ROWS = FIRST_ROW + int(W0_LOW // STRIDE)


@kernel
def keep_lane(pool, a, i, roster, is_known, worker):
    """Keep a lane as it is before it is attended to; of its laws what its form has."""
    j, followed = roster[PARTICLE, i], worker.followed
    out = followed.lanes[j]
    out[:] = 0.0
    out[POOL], out[NEXT], out[CAREFUL] = pool, roster[NEXT_STOP, i], followed.careful[j]
    out[IS_KNOWN] = 1.0 if is_known else 0.0
    last = REF if not is_known else (R1 + STRIDE if worker.degree % 2 == 1 else W0_LOW)
    for k in range(last // STRIDE):
        out[FIRST_ROW + k] = a[k * STRIDE + i]


@kernel
def take_lane(a, i, roster, j, worker):
    """Put a kept particle into a lane, before it is attended to."""
    kept = worker.followed.lanes[j]
    for row in range(N_ROWS):
        a[row * STRIDE + i] = 0.0
    roster[PARTICLE, i], roster[NEXT_STOP, i] = j, int(kept[NEXT])
    worker.followed.careful[j] = int(kept[CAREFUL])
    for k in range(W0_LOW // STRIDE):
        a[k * STRIDE + i] = kept[FIRST_ROW + k]
    a[WHEN + i], a[STOP + i], a[END + i] = NEVER, -NEVER, -NEVER
    if kept[IS_KNOWN] > 0.0 and worker.degree % 2 == 0:
        set_piece(a, i, int(a[PIECE + i]), worker.scene, worker.pieces, worker.degree)
    elif kept[IS_KNOWN] > 0.0:
        a[END + i] = NEVER
