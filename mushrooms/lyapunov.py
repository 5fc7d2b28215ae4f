"""Finite-time Lyapunov exponents: how fast neighbouring particles separate along an orbit.

Idea. The reference proves each step of an orbit and gives the Jacobian d(dt, x, y, vx, vy) / d(t,
x, y, vx, vy). The product of these stretches a small deviation. Lengths are in units of the table,
and velocities in units of the present speed. The exponent after n collisions is the mean of the
logs of the stretches. Its error is the standard error over N_BLOCKS equal parts of the orbit. This
holds if a part is longer than the memory of the orbit. It is an error of the mean along this orbit.
In the chaotic zone orbits stick near islands for long times, which a single orbit does not show. In
an island the exponent falls as (log n) / n to 0.

The Jacobians belong to the states in binary64. Each is right to some 16 digits.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from mushrooms.orbits import FollowedOrbit
from scene import BadInput, Undecided
from scene.pieces import FloatArray

N_BLOCKS = 16
DIGITS = 16


class Stretching(NamedTuple):
    """The n logs of the stretches along an orbit, and the exponents that follow.

    Attributes:
        logs: (n,) log of the growth of a deviation at each collision.
        exponents: (n,) their running mean: the exponent after each collision [1/collision].
        exponent: the last of these.
        error: its standard error over N_BLOCKS parts of the orbit.
        flight: mean flight time [time]; exponent / flight is the exponent per time.
    """

    logs: FloatArray
    exponents: FloatArray
    exponent: float
    error: float
    flight: float


def jacobians(orbit: FollowedOrbit, progress: Callable[[int], None] | None = None) -> FloatArray:
    """Return (n, 5, 5): d(t, x, y, vx, vy) after each collision by d(t, x, y, vx, vy) before it.

    Args:
        orbit: takes some 5 ms per collision.
        progress: called with the number of collisions done.

    Raises:
        BadInput: the reference does not confirm a collision of the orbit.
    """
    import reference

    out = np.empty((len(orbit.walls), 5, 5))
    for k, wall in enumerate(orbit.walls):
        before = orbit.state(k)
        after = orbit.state(k + 1).t
        end = after + (after - before.t) + math.ulp(after)  # a horizon safely beyond the known hit
        proved = reference.next_collision(
            orbit.scene, before, end, digits=DIGITS, is_differentiated=True
        )
        if isinstance(proved, Undecided):
            raise BadInput(
                f"collision {k + 1} of the orbit: the reference is undecided, {proved.reason}"
            )
        if (
            not isinstance(proved, reference.Collision)
            or proved.jacobian is None
            or proved.wall != wall
        ):
            raise BadInput(
                f"collision {k + 1} of the orbit: {wall} is not what the reference proves"
            )
        out[k] = [[float(entry) for entry in row] for row in proved.jacobian]
        out[k, 0, 0] += 1.0  # the row is that of dt, and t after is t + dt
        if progress is not None:
            progress(k + 1)
    return out


def stretching(orbit: FollowedOrbit, progress: Callable[[int], None] | None = None) -> Stretching:
    """Follow a deviation along an orbit.

    Args:
        orbit: of at least 2 N_BLOCKS collisions.
        progress: called with the number of collisions done.

    Raises:
        BadInput: too few collisions, or one that the reference does not confirm.
    """
    n = len(orbit.walls)
    if n < 2 * N_BLOCKS:
        raise BadInput(f"collisions = {n}, must be >= {2 * N_BLOCKS} for an exponent with an error")
    states = orbit.states()
    length = float(np.ptp(states[:, 1:3], axis=0).max())
    speeds = np.hypot(states[:, 3], states[:, 4])
    units = np.column_stack([length / speeds, *[np.full(n + 1, length)] * 2, speeds, speeds])
    # At first without symmetry: equal parts sideways and in direction.
    vx, vy = states[0, 3:]
    deviation = np.array([0.0, -vy, vx, -vy, vx]) / (math.hypot(vx, vy) * math.sqrt(2.0))
    logs = np.empty(n)
    for k, matrix in enumerate(jacobians(orbit, progress)):
        deviation = matrix @ (deviation * units[k]) / units[k + 1]
        size = float(np.linalg.norm(deviation))
        logs[k] = math.log(size)
        deviation = deviation / size
    exponents = np.cumsum(logs) / np.arange(1, n + 1)
    blocks = logs[n % N_BLOCKS :].reshape(N_BLOCKS, -1).mean(axis=1)
    error = float(blocks.std(ddof=1) / math.sqrt(N_BLOCKS))
    flight = float(orbit.steps[:, 0].mean())
    return Stretching(logs, exponents, float(exponents[-1]), error, flight)
