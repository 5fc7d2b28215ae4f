"""The layout of a pool: particles side by side, one in each SIMD lane, and each number in a row of its own.

Kernels write `rows.STAY_IN + i` for the number STAY_IN of the particle in lane i. What is put into a lane
and taken out of it goes through the functions below.
"""

import numpy as np

from fast.kernel.compiling import kernel, part
from fast.kernel.records import ARC, BASE, FLOOR, LEFT, RIGHT, FloatArray, Integer, Particle

# A pool holds particles side by side, one in each lane.
LANES = 128
# How far rows are apart. Were it a divisor of 4096 bytes, rows would meet in few sets of the cache, and a
# load would wait for stores to rows whose addresses end alike.
STRIDE = 136
NEVER = np.inf

# Rows of a pool, in one flat array: constant strides let the loops vectorise.
(
    T, T_LOW, X, Y, VX, VY, WALL, SPIN,  # state after the last collision; angular momentum when captured
    SINCE, UNTIL, STAY_IN, STAY_OUT,  # a capture interval over an instant between is kept; begin, end
    N_ARC, N_BASE, N_LEFT, N_RIGHT, N_FLOOR,  # collisions so far
    # The laws at T. As waves: sine and cosine of the fundamental phase. As pieces: the reference time and
    # number of the piece; radius, half-width, depth and slope, each with derivatives.
    REF, REF_LOW, PIECE,
    R0, R1, R2, R3, W0, W1, W2, H0, H1, H2, M0, M1, M2, W0_LOW,
    AS_GIVEN,  # 1 where its distance from the arc is still that of a start that names it; hops keep it
    STOP,  # a collision at or after this time is left to `attend`
    END,  # until when the laws are known; minus infinity where they are not
    LIMIT, BACK,  # how long after the reference time a piece holds, and before it for a hop along the arc
    HIT, SURE, S, TRIES,  # the flight: wall, mouth, time; how often the time has been corrected
    FATE, WHEN,  # what became of it, and its time
    STAY,  # of a free particle: whether it is captured
    # The laws where the flight is guessed to end, in as many rows as those at T; with pieces the flight's
    # begin since REF too, and the radius's mean rate.
    AHEAD, _, _, _, _, _, _, _, _, _, _, _, _, _,
    BEFORE, MEAN_RATE,
    LAWS,  # from here on the coefficients of a piece: see Pieces.coefficients
) = STRIDE * np.arange(63)  # fmt: skip
PHASE_SINE, PHASE_COSINE = R0, R1
N_COEFFICIENTS = 16  # of each law, as many as the highest degree asks for
N_ROWS = 62 + 4 * N_COEFFICIENTS
RADIUS_LAW, WIDTH_LAW, DEPTH_LAW, SLOPE_LAW = LAWS + STRIDE * N_COEFFICIENTS * np.arange(4)
# Codes of walls as they stand in a row.
ON_ARC, ON_BASE, ON_LEFT, ON_RIGHT, ON_FLOOR = map(float, (ARC, BASE, LEFT, RIGHT, FLOOR))
# Whether a particle is captured in its stay in the cap: not yet, no longer, or yes; and the last, clearly so,
# just now. A stay counts as captured from its first hit of the arc with |sin phi| > nu to that which ends it.
NOT_YET, OVER, CAPTURED, CLEARLY = 0.0, 1.0, 2.0, 3.0
# What became of a flight. The particle is where it was: the end is out of the laws' reach; not shown right;
# right, and at STOP or later. Or it has moved on, and `attend` is to look at it. Or nothing is to be done, as
# it has moved on, or as its time is to be corrected once more.
FAR, REFUSED, LATE, MARKED, MOVED, COARSE = -1.0, 0.0, 1.0, 2.0, 3.0, 4.0
MAX_CORRECTIONS = 3.0
POOL_SIZE = np.int64(N_ROWS * STRIDE)
REGISTER = np.int64(8)  # lanes of the widest registers


@part
def whole_registers(n: Integer) -> Integer:
    """Return the number of lanes rounded up to whole registers: what they hold too many is not looked at.

    One lane alone is left alone: what is done for it is then not packed, and roots and quotients come sooner.
    """
    return n if n == 1 else (n + REGISTER - 1) // REGISTER * REGISTER


@part
def load(a: FloatArray, i: np.int64, particle: Particle, is_first_kept: bool) -> None:
    """Put a particle into a lane; its laws are unknown there, so its first step will be careful."""
    for row in range(N_ROWS):
        a[row * STRIDE + i] = 0.0
    put_particle(a, i, particle)
    a[WALL + i] = particle.wall
    a[AS_GIVEN + i] = 1.0 if particle.wall == ARC else 0.0
    # Any stay serves, or none until the mouth has narrowed.
    any_serves = -NEVER if is_first_kept else NEVER
    a[SINCE + i], a[UNTIL + i] = any_serves, -any_serves
    a[STAY_IN + i] = a[STAY_OUT + i] = NEVER
    a[STOP + i] = a[END + i] = -NEVER


@part
def particle_of(a: FloatArray, i: np.int64) -> Particle:
    """Return a lane's particle."""
    return Particle(a[T + i], a[T_LOW + i], a[X + i], a[Y + i], a[VX + i], a[VY + i], int(a[WALL + i]))


@part
def put_particle(a: FloatArray, i: np.int64, p: Particle) -> None:
    """Write a particle's state into a lane, but for its wall."""
    a[T + i], a[T_LOW + i], a[X + i], a[Y + i], a[VX + i], a[VY + i] = p.t, p.t_low, p.x, p.y, p.vx, p.vy


@kernel
def copy_rows(a: FloatArray, i: Integer, b: FloatArray, j: Integer, first: Integer, last: Integer) -> None:
    """Copy what lane i of one pool holds to lane j of another, from one row up to another."""
    for row in range(first, last, STRIDE):
        b[row + j] = a[row + i]


@part
def refold(a: FloatArray, i: np.int64) -> None:
    """Bring an unfolded particle back to y >= 0; its wall is known since it first hit the arc.

    One that is below y = 0 as it leaves the base was given so, within what a start may be off its wall.
    """
    if a[Y + i] < 0.0 and a[WALL + i] == ON_ARC:
        a[Y + i], a[VY + i] = -a[Y + i], -a[VY + i]
    a[SPIN + i] = 0.0
