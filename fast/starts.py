"""Where an ensemble starts and where it is looked at: initial states, cycles and their instants.

Particle i draws its start from block i of a counter-based random stream (Philox) keyed by the
seed: it is the same particle whatever the number of particles, threads or chunks.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from mpmath import fp

from fast.kernel.arithmetic import directions
from fast.kernel.records import FloatArray, Stops
from fast.validation import MOST_IN_CYCLES, MOST_TO_A_TIME
from scene import Scene
from scene.geometry import table_at
from scene.laws import bounds
from scene.mouth import mouth_minima, start_time
from scene.tables import laws


def initial_states(scene: Scene, n_particles: int, energy: float, seed: int, first: int = 0) -> FloatArray:
    """Draw states uniform in area and direction when the cycle begins, all of one energy.

    Returns:
        (N, 6) array: t, its low part 0, x, y, vx, vy of particles `first` to `first` + N - 1.
    """
    # One Philox block gives four numbers, and four is what a particle needs.
    raw = np.random.Philox(key=seed, counter=first).random_raw(4 * n_particles).reshape(n_particles, 4)
    u = (raw >> np.uint64(11)).astype(np.float64) * 2.0**-53
    start = start_time(scene)
    x, y = _uniform_in_area(scene, start, u[:, 0], u[:, 1], u[:, 2])
    speed, along = math.sqrt(2.0 * energy), directions(np.ascontiguousarray(u[:, 3]))
    out: FloatArray = np.column_stack(
        [np.full(n_particles, start), np.zeros(n_particles), x, y, speed * along[:, 0], speed * along[:, 1]]
    )
    return out


def _uniform_in_area(
    scene: Scene, t: float, pick: FloatArray, a: FloatArray, b: FloatArray
) -> tuple[FloatArray, FloatArray]:
    now = table_at(fp, scene, t)
    cap_area, stem_area = now.cap_area(), now.stem_area()
    rho, along = now.r * np.sqrt(a), directions(0.5 * b)
    side, depth = now.uniform_in_stem(a, b)
    in_cap = pick * (cap_area + stem_area) < cap_area
    return np.where(in_cap, rho * along[:, 0], side), np.where(in_cap, rho * along[:, 1], -depth)


def one_cycle(scene: Scene) -> float:
    """Return how long a cycle takes [time]: the period of the laws, 1 for a static scene."""
    return scene.period or 1.0


def cycle_stops(scene: Scene, n_cycles: int, phases: Sequence[float]) -> Stops:
    """Return the stops of whole cycles: at each of `phases` (fractions of a cycle, rising) and the end.

    The minima of nu are stops too; one at the end of a cycle comes before that end.
    """
    start, span = start_time(scene), one_cycle(scene)
    count = np.arange(n_cycles)
    narrow = np.array(mouth_minima(scene))
    parts = np.array([*narrow, *phases, 1.0])
    columns = np.full((n_cycles, len(parts)), -1)
    columns[:, len(narrow) :] = np.arange(n_cycles * (len(phases) + 1)).reshape(n_cycles, -1)
    cycles = np.full(columns.shape, -1)
    cycles[:, -1] = count
    order = np.argsort(parts, kind="stable")
    times = start + span * (count[:, None] + parts[None, :])
    return Stops(
        times[:, order].ravel(),
        columns[:, order].ravel(),
        cycles[:, order].ravel(),
        np.ascontiguousarray(times[:, : len(narrow)]),  # a slice would have `follow` compiled once more
        is_first_kept=False,
        most=MOST_IN_CYCLES,
        called_off=np.zeros(1, np.int64),
    )


def only_stop(t_end: float) -> Stops:
    """Return one stop, that keeps the first capture interval of any length."""
    return Stops(
        np.array([t_end]),
        np.array([0]),
        np.array([0]),
        np.full((1, 1), math.nan),
        is_first_kept=True,
        most=MOST_TO_A_TIME,
        called_off=np.zeros(1, np.int64),
    )


def least_collisions(scene: Scene, speed: float, span: float) -> float:
    """Return how many flights of the table's full length fit into a path at this speed [collisions]."""
    found = {name: bounds(law).highest for name, law in laws(scene).items() if name != "slope"}
    r, h = found.get("r", 0.0), found.get("h", 0.0)
    w = found.get("w", found.get("nu", 0.0) * r)
    return speed * span / (2.0 * max(r, w) + r + h)
