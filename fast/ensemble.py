"""Ensembles: many particles from one energy, followed through cycles of the walls.

Particle i draws its start from block i of a counter-based random stream (Philox) keyed by the
seed: it is the same particle whatever the number of particles, threads or chunks.
"""

from __future__ import annotations

import hashlib
import math
import time
from collections.abc import Callable
from typing import NamedTuple

import numba
import numpy as np
import numpy.typing as npt
from mpmath import fp

from fast import kernel
from fast.compiled import FloatArray, compile_scene
from scene import Cap, Mushroom, Scene, Stem
from scene.laws import BangBang, value
from scene.refusal import BadInput
from scene.tables import laws, period, width_factors

FOLLOWED, UNDECIDED, UNDEFINED = 0, 1, 2
MAX_PARTICLES = 10**8
LARGEST_ENERGY = 2.0**800
CHUNKS = 64


class Ensemble(NamedTuple):
    """What became of N particles over K cycles.

    Attributes:
        energy0: initial energy E = v^2 / 2 of every particle.
        energy: (N,) energy after the last cycle (nan for a particle not followed to the end).
        cycle_energies: (N, K) energy at the end of each cycle.
        t, x, y, vx, vy: (N,) the last states.
        n_collisions: (N,) collisions followed.
        outcome: (N,) 0 followed to the end, 1 undecided, 2 undefined.
        t_in, t_out: (N, K) begin and end of the captured stay that spans the instant of least
            nu in each cycle; nan for a particle not captured.
        seconds: wall time of the kernel.
        threads: number of threads used.
    """

    energy0: float
    energy: FloatArray
    cycle_energies: FloatArray
    t: FloatArray
    x: FloatArray
    y: FloatArray
    vx: FloatArray
    vy: FloatArray
    n_collisions: npt.NDArray[np.int64]
    outcome: npt.NDArray[np.int8]
    t_in: FloatArray
    t_out: FloatArray
    seconds: float
    threads: int

    def ns_per_collision(self) -> float:
        """Return kernel wall time x threads / collisions, in nanoseconds."""
        return self.seconds * self.threads / max(int(self.n_collisions.sum()), 1) * 1e9

    def sha256(self) -> str:
        """Return the SHA-256 of the result's bits (times and thread count left out)."""
        digest = hashlib.sha256()
        for array in self[1:12]:
            digest.update(np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()


def simulate(
    scene: Scene,
    *,
    n_particles: int,
    energy: float,
    n_cycles: int = 1,
    seed: int = 0,
    threads: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> Ensemble:
    """Follow an ensemble, uniform in place and direction, through whole cycles.

    Args:
        scene: table and laws; a static one is followed for one unit of time a cycle.
        n_particles: 1 to 10^8.
        energy: initial energy E = v^2 / 2 of every particle [length^2 / time^2], > 0.
        n_cycles: cycles to follow, >= 1.
        seed: 0 <= seed < 2^64.
        threads: numba threads, by default all.
        progress: called with the number of particles done so far, after every chunk.

    Raises:
        BadInput: naming field, value and bound.

    Source: secs. 4.1, 4.2 (initial conditions); capture as in sec. 3.2.
    """
    threads = _check(n_particles, energy, n_cycles, seed, threads)
    compiled = compile_scene(scene)
    start, ends, narrowest = cycle_times(scene, n_cycles)
    states = initial_states(scene, n_particles, energy, seed, start)
    cycle_energies: FloatArray = np.full((n_particles, n_cycles), np.nan)
    t_in, t_out = cycle_energies.copy(), cycle_energies.copy()
    codes: npt.NDArray[np.int64] = np.zeros(n_particles, dtype=np.int64)
    n_collisions: npt.NDArray[np.int64] = np.zeros(n_particles, dtype=np.int64)
    before = numba.get_num_threads()
    numba.set_num_threads(threads)
    seconds = 0.0
    try:
        _warm_up(compiled)
        size = max(math.ceil(n_particles / CHUNKS), 16 * threads)
        for first in range(0, n_particles, size):
            part = slice(first, min(first + size, n_particles))
            begin = time.perf_counter()
            kernel.follow_all(
                *compiled, states[part], ends, narrowest, cycle_energies[part], t_in[part], t_out[part],
                codes[part], n_collisions[part],
            )  # fmt: skip
            seconds += time.perf_counter() - begin
            if progress:
                progress(part.stop)
    finally:
        numba.set_num_threads(before)
    outcome = np.select([codes == kernel.HORIZON, codes < kernel.FAR_TIME], [FOLLOWED, UNDEFINED], UNDECIDED)
    t, _, x, y, vx, vy = (np.ascontiguousarray(column) for column in states.T)
    return Ensemble(
        energy0=energy,
        energy=np.ascontiguousarray(cycle_energies[:, -1]),
        cycle_energies=cycle_energies,
        t=t,
        x=x,
        y=y,
        vx=vx,
        vy=vy,
        n_collisions=n_collisions,
        outcome=outcome.astype(np.int8),
        t_in=t_in,
        t_out=t_out,
        seconds=seconds,
        threads=threads,
    )


def _warm_up(compiled: tuple[object, ...]) -> None:
    # Compiles (or loads from the disk cache), so that `seconds` holds work alone.
    none = np.empty((0, 1))
    count = np.empty(0, dtype=np.int64)
    kernel.follow_all(*compiled, np.empty((0, 6)), np.ones(1), np.ones(1), none, none, none, count, count)


def _check(n_particles: int, energy: float, n_cycles: int, seed: int, threads: int | None) -> int:
    if not 1 <= n_particles <= MAX_PARTICLES:
        raise BadInput(f"particles = {n_particles}, must be 1 to {MAX_PARTICLES}")
    if not 0 < energy <= LARGEST_ENERGY:
        raise BadInput(f"energy = {energy}, must be > 0 and at most 2^800")
    if n_cycles < 1:
        raise BadInput(f"cycles = {n_cycles}, must be >= 1")
    if not 0 <= seed < 2**64:
        raise BadInput(f"seed = {seed}, must be >= 0 and < 2^64")
    available = int(numba.config.NUMBA_NUM_THREADS)
    if threads is not None and not 1 <= threads <= available:
        raise BadInput(f"threads = {threads}, must be 1 to {available}, the cores of this machine")
    return available if threads is None else threads


def initial_states(scene: Scene, n_particles: int, energy: float, seed: int, start: float) -> FloatArray:
    """Draw states uniform in area and direction at time `start`, all of one energy.

    Returns:
        (N, 6) array: t, its low part 0, x, y, vx, vy.
    """
    # One Philox block gives four numbers, and four is what a particle needs.
    raw = np.random.Philox(key=seed).random_raw(4 * n_particles).reshape(n_particles, 4)
    u = (raw >> np.uint64(11)) * 2.0**-53
    x, y = _uniform_in_area(scene, start, u[:, 0], u[:, 1], u[:, 2])
    speed, angle = math.sqrt(2.0 * energy), 2.0 * np.pi * u[:, 3]
    out: FloatArray = np.column_stack(
        [
            np.full(n_particles, start),
            np.zeros(n_particles),
            x,
            y,
            speed * np.cos(angle),
            speed * np.sin(angle),
        ]
    )
    return out


def _uniform_in_area(
    scene: Scene, t: float, pick: FloatArray, a: FloatArray, b: FloatArray
) -> tuple[FloatArray, FloatArray]:
    now = {name: float(value(fp, law, t)) for name, law in laws(scene).items()}
    r, h, slope = now.get("r", 0.0), now.get("h", 0.0), now.get("slope", 0.0)
    cap_area = 0.5 * math.pi * r * r
    if isinstance(scene, Cap):
        w = stem_area = 0.0
    else:
        w = math.prod(float(value(fp, law, t)) for law in width_factors(scene))
        stem_area = 2.0 * w * h - slope * h * h
    rho, psi = r * np.sqrt(a), np.pi * b
    # Depth d below the mouth has density (w - slope d): invert 2 w d - slope d^2 = a stem_area.
    depth = a * stem_area / (w + np.sqrt(np.maximum(w * w - slope * a * stem_area, 0.0)) + 1e-300)
    side = (w - slope * depth) * (2.0 * b - 1.0)
    in_cap = pick * (cap_area + stem_area) < cap_area
    return np.where(in_cap, rho * np.cos(psi), side), np.where(in_cap, rho * np.sin(psi), -depth)


def cycle_times(scene: Scene, n_cycles: int) -> tuple[float, FloatArray, FloatArray]:
    """Return the start, the end of each cycle and its instant of least nu (middle of a plateau)."""
    shared = period(scene)
    span = float(shared.value(fp)) if shared else 1.0
    start = next((law.knots[0][0] for law in laws(scene).values() if isinstance(law, BangBang)), 0.0)
    count = np.arange(n_cycles)
    ends = start + span * (count + 1.0)
    if isinstance(scene, Stem | Cap):
        return start, ends, np.full(n_cycles, np.inf)
    grid = np.arange(4096) / 4096.0
    nu = np.array([_mouth_ratio(scene, start + span * g) for g in grid])
    low = grid[nu <= nu.min() * (1.0 + 2.0**-40)]
    return start, ends, start + span * (count + 0.5 * (low[0] + low[-1]))


def _mouth_ratio(scene: Mushroom, t: float) -> float:
    if scene.nu is not None:
        return float(value(fp, scene.nu, t))
    assert scene.w is not None
    return float(value(fp, scene.w, t) / value(fp, scene.r, t))
