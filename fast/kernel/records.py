"""What kernels are given and hand back, and the names of the columns and rows of their tables of numbers.

numba reads a named tuple as cheaply as loose arguments. The numbers of all laws are rows of one array,
because a row is chosen while a kernel runs; its columns are named here and nowhere else. Walls, outcomes and
tables are numpy integers, because numba compiles a function anew for each Python integer passed to it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from fast.kernel.compiling import kernel
from fast.kernel.fates import Fate

NO_WALL, ARC, BASE, LEFT, RIGHT, FLOOR = np.arange(-1, 5)
N_WALLS = 5


def code_of(fate: Fate) -> np.int64:
    """Return a fate's code as kernels take it."""
    return np.int64(fate.code)


HORIZON = code_of(Fate.HORIZON)
SLIDING = code_of(Fate.SLIDING)
MOUTH_EDGE = code_of(Fate.MOUTH_EDGE)
CORNER = code_of(Fate.CORNER)
TOO_LATE = code_of(Fate.TOO_LATE)
TOO_MANY_PARABOLAS = code_of(Fate.TOO_MANY_PARABOLAS)
NEAR_TANGENCY = code_of(Fate.NEAR_TANGENCY)
NEAR_CORNER = code_of(Fate.NEAR_CORNER)
NEAR_MOUTH_EDGE = code_of(Fate.NEAR_MOUTH_EDGE)
NEAR_START = code_of(Fate.NEAR_START)
NEAR_HORIZON = code_of(Fate.NEAR_HORIZON)
TOO_FAR = code_of(Fate.TOO_FAR)
ANSWER_LOST = code_of(Fate.ANSWER_LOST)
APPROACHING = code_of(Fate.APPROACHING)
BEYOND_ARC = code_of(Fate.BEYOND_ARC)
OFF_WALL = code_of(Fate.OFF_WALL)
BAD_QUESTION = code_of(Fate.BAD_QUESTION)
FOLLOW_ANEW = code_of(Fate.FOLLOW_ANEW)
CAP, STEM, MUSHROOM = np.arange(3)


FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]
Integer = int | np.integer[Any]  # of Python or of numpy

# Rows of `laws`, `bounds` and `anchors`. WIDTH is the half-width w of the stem, or nu where a scene gives it.
# SHARED, a row of `laws` alone, holds OMEGA, N_HARMONICS and OMEGA_LOW of all Fourier laws of a scene.
RADIUS, WIDTH, DEPTH, SLOPE, SHARED = np.arange(5)

# Columns of `laws`. KIND is one of CONSTANT, FOURIER and BANG_BANG; LEVEL is a constant law's value, or a
# Fourier law's mean.
CONSTANT, FOURIER, BANG_BANG = 0.0, 1.0, 2.0
MAX_HARMONICS = 16
KIND, LEVEL = np.arange(2)
# A Fourier law has the frequency OMEGA + OMEGA_LOW. Harmonic k, from 1 to n, has the amplitude of its cosine
# in column AMPLITUDES + k, and that of its sine in AMPLITUDES + n + k.
OMEGA, N_HARMONICS, OMEGA_LOW, AMPLITUDES = np.array([2, 3, 4, 3])
# A bang-bang law has the period PERIOD + PERIOD_LOW. From column KNOTS on stand, n columns of each: the times
# of its n knots, their values, the accelerations of its legs, and the low parts of these.
PERIOD, N_KNOTS, PERIOD_LOW, KNOTS = np.array([2, 3, 4, 5])

# Columns of `bounds`: the least and greatest value of a law, and the greatest size of its first and second
# derivative. Here WIDTH is w in every scene.
LOWEST, HIGHEST, FASTEST, BEND = np.arange(4)

# Columns of `anchors`, the laws at the last event: value, derivative, and the value's low part. A Fourier law
# has in TERMS the summed sizes of its derivative's terms. A bang-bang law has the number of its half-leg, and
# the time to that half-leg's end as a sum of two floats.
VALUE, RATE, TERMS, ROOM, ROOM_LOW, VALUE_LOW = np.arange(6)
HALF_LEG = TERMS
# Two more rows of `anchors`. PHASE holds the sines and cosines of all harmonics at the last event, each as a
# sum of two floats, in the columns below plus the number of the harmonic; and a bound on their error. TURN
# holds what a later time TURN_TIME adds: sin and cos - 1 of the turn since, or sin less the turn where
# IS_SHORT.
PHASE, TURN = np.array([4, 5])
PHASE_ERROR = 0
TURN_TIME, IS_SHORT = np.arange(2)
SINE, COSINE = 3, 3 + MAX_HARMONICS
SINE_LOW, COSINE_LOW = 3 + 2 * MAX_HARMONICS, 3 + 3 * MAX_HARMONICS
ANCHORS_SHAPE = (6, 4 + 4 * MAX_HARMONICS)


class Compiled(NamedTuple):
    """A scene as the numbers that the kernels read.

    Attributes:
        table: CAP, STEM or MUSHROOM.
        is_relative: the width is given as nu, and w = nu r.
        laws: (5, n) a row for each law of motion, and one for what Fourier laws share.
        bounds: (4, 4) what holds of each law for all time.
    """

    table: int
    is_relative: bool
    laws: FloatArray
    bounds: FloatArray


class Pieces(NamedTuple):
    """A scene's laws over one period, as P pieces: polynomials of degree D about reference times.

    The polynomials of a piece hold from the time at which it begins to serve until `limits` after its
    reference time: `fast.pieces` proves how well.

    Attributes:
        origin, period, period_low: when the first piece begins, and the period as a sum of two floats;
            infinite for none.
        begins: (P,) times since the origin at which pieces begin to serve, rising from 0.
        references: (P, 2) reference times in the first period, as sums of two floats.
        limits: (P,) how long before and after it the polynomials hold.
        serves: (P,) until when after its reference time a piece is the best one.
        coefficients: (P, 4, D + 2) for r, w or nu, h, slope: the value at the reference time, its low part,
            and the coefficients of the powers 1 to D of the time since.
        until: up to when they may be used [time]; later, or before minus that, phases are lost.
    """

    origin: float
    period: float
    period_low: float
    begins: FloatArray
    references: FloatArray
    limits: FloatArray
    serves: FloatArray
    coefficients: FloatArray
    until: float


class LaneWaves(NamedTuple):
    """A scene's laws as waves over one fundamental phase (omega + omega_low) t.

    Attributes:
        omega, omega_low: the frequency as a sum of two floats; 0 where nothing moves.
        r, w, h, m: of radius, half-width or nu, depth and slope the mean, and of harmonics 1 and 2 the
            amplitudes of cosine and sine.
    """

    omega: float
    omega_low: float
    r: tuple[float, ...]
    w: tuple[float, ...]
    h: tuple[float, ...]
    m: tuple[float, ...]


class LawLimits(NamedTuple):
    """What holds of a scene's laws for all time, for the lanes' checks.

    Attributes:
        bend: at least |r'^2 + r r''|: half of what the arc's function may curve upwards, speed left out.
        curvature: at least |w''| + |m''| h and |h''|, for a slope m.
        turning: at least 2 |m'|, which comes times |vy| to a side's curvature.
        rate: at least |r'|, |w'| + |m'| h and |h'|.
        arc_rate: at least |r'|.
        size: at least r + w + (1 + |m|) h, which bounds the terms that a wall's function is summed of.
        lean: at least 1 + |m|.
        lift: at least |h''| w / h: a rise short enough beside w / lift is short enough for the floor.
    """

    bend: float
    curvature: float
    turning: float
    rate: float
    arc_rate: float
    size: float
    lean: float
    lift: float


class LawsInLanes(NamedTuple):
    """A scene as the lanes know it: see fast.kernel.lane_laws.

    Attributes:
        scene: its numbers.
        limits: what holds of its laws for all time.
        pieces: its laws as polynomials; of waves their period alone, and up to when they are known.
        waves: its laws as waves.
        form: ONE_WAVE, TWO_WAVES, PARABOLA or SERIES of fast.kernel.lane_laws; those of pieces are the
            polynomials' degree.
        is_waves: the form is one of waves.
        is_slope_moving: the slope of the sides moves.
        slope: what it is where it stands still.
    """

    scene: Compiled
    limits: LawLimits
    pieces: Pieces
    waves: LaneWaves
    form: int
    is_waves: bool
    is_slope_moving: bool
    slope: float


class Particle(NamedTuple):
    """A particle at one instant.

    Attributes:
        t, t_low: time, as a sum of two floats.
        x, y, vx, vy: place and velocity.
        wall: code of the wall that it is leaving, NO_WALL for none.
    """

    t: float
    t_low: float
    x: float
    y: float
    vx: float
    vy: float
    wall: Integer


class Place(NamedTuple):
    """A place whose coordinates are sums of two floats: (x + x_low, y + y_low)."""

    x: float
    x_low: float
    y: float
    y_low: float


class Stops(NamedTuple):
    """Instants at which particles are looked at, in order.

    Attributes:
        times: (S,) the instants; the last one ends the run.
        columns: (S,) where the energy at an instant is written, -1 for an instant that does not ask for it.
        cycles: (S,) number of the cycle that an instant ends, -1 for others.
        mouth_minima: (K, M) times of minima of nu in each cycle: a capture interval goes to slot m of cycle k
            when it spans that instant.
        is_first_kept: the first capture interval is kept in slot 0, whatever its length.
        most: collisions after which a particle is given up; energy may grow without end.
        called_off: (1,) set to 1 from another thread where nothing more is wanted of what is followed: the
            kernel looks at it every few flights, and returns with whatever is there.
    """

    times: FloatArray
    columns: IntArray
    cycles: IntArray
    mouth_minima: FloatArray
    is_first_kept: bool
    most: int
    called_off: IntArray


class Followed(NamedTuple):
    """What the kernel fills in for N particles, K cycles with M minima of nu, C stops that ask for energies.

    Attributes:
        states: (N, 6) last t, its low part, x, y, vx, vy.
        codes: (N,) why each particle ended, HORIZON when all went well.
        counts: (N, 5) collisions by wall: arc, base, left, right, floor.
        careful: (N,) collisions found by the scalar step.
        energies: (N, C) energy at each stop that asks for it.
        is_captured: (N, C) whether the last arc hit before had |sin phi| > nu, and no wall of the
            stem has been met since.
        t_in, t_out: (N, K, M) the capture intervals that are kept; nan for none.
        lanes: (N, LANE_ROWS) what goes on from the last stop, nan for a particle that ended before it: see
            fast.kernel.follow; (N, 0) where it is not asked for.
    """

    states: FloatArray
    codes: IntArray
    counts: IntArray
    careful: IntArray
    energies: FloatArray
    is_captured: BoolArray
    t_in: FloatArray
    t_out: FloatArray
    lanes: FloatArray

    def part(self, those: slice) -> Followed:
        """Return views of some of the particles."""
        return Followed._make(array[those] for array in self)


def unfilled_ends(
    states: FloatArray, n_columns: int = 1, slots: tuple[int, int] = (1, 1), n_lane_rows: int = 0
) -> Followed:
    """Return what is to be filled in for particles that start from `states`, which are overwritten.

    By default for one stop, with one capture interval.
    """
    n = len(states)
    return Followed(
        states,
        np.zeros(n, np.int64),
        np.zeros((n, N_WALLS), np.int64),
        np.zeros(n, np.int64),
        np.full((n, n_columns), np.nan),
        np.zeros((n, n_columns), np.bool_),
        np.full((n, *slots), np.nan),
        np.full((n, *slots), np.nan),
        np.full((n, n_lane_rows), np.nan),
    )


@kernel
def is_hit(code: Integer) -> bool | np.bool:
    """Tell whether a step's code is that of a wall that is met, or NO_WALL."""
    return code < HORIZON


@kernel
def is_lost(code: Integer) -> bool | np.bool:
    """Tell whether a step's code is that of a particle that neither meets a wall nor reaches the horizon."""
    return code > HORIZON


@kernel
def particle_at(states: FloatArray, i: int, wall: Integer) -> Particle:
    """Return the particle whose state is a row of `states`."""
    return Particle(states[i, 0], states[i, 1], states[i, 2], states[i, 3], states[i, 4], states[i, 5], wall)


@kernel
def write_state(states: FloatArray, i: int, particle: Particle) -> None:
    """Write a particle's state into a row of `states`."""
    states[i, 0], states[i, 1] = particle.t, particle.t_low
    states[i, 2], states[i, 3] = particle.x, particle.y
    states[i, 4], states[i, 5] = particle.vx, particle.vy


@kernel
def write_step(steps: FloatArray, i: int, factors: FloatArray, dt: float, particle: Particle) -> bool:
    """Write row i of steps, dt, t, x, y, vx, vy after a collision; returns whether no number lost a bit.

    They are multiplied by `factors` (4, 6), two powers of two, which come with their inverses: one alone may
    be none of the floats.
    """
    numbers = (dt, particle.t, particle.x, particle.y, particle.vx, particle.vy)
    is_exact = True
    for column in range(6):
        number = numbers[column]
        scaled = number * factors[0, column] * factors[1, column]
        steps[i, column] = scaled
        is_exact = is_exact and scaled * factors[2, column] * factors[3, column] == number
    return is_exact


@kernel
def released(particle: Particle) -> Particle:
    """Return the particle as one that is on no wall."""
    return Particle(particle.t, particle.t_low, particle.x, particle.y, particle.vx, particle.vy, NO_WALL)
