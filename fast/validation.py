"""Arguments of the public functions, checked before any arithmetic: types, nan, infinities, sizes.

Each check returns its argument as the kernels take it (floats, integers), or raises BadInput with one
line that names field, value and bound.
"""

import math
import numbers
import os
import sys
from collections.abc import Callable
from itertools import pairwise

from scene import InvalidState, Scene, State
from scene.refusal import BadInput, check_count, check_list, check_number, shown
from scene.states import check_numbers

MAX_STEPS = 10**7  # collisions of one trajectory, kept in memory: half a gigabyte
MOST_IN_CYCLES = 10**9  # collisions of one particle of an ensemble: a minute of work
MAX_PARTICLES = 10**8
MAX_FIRST = 2**62  # number of a first particle: what is added to it stays a 64-bit integer
MAX_CYCLES = 10**6
MAX_KEPT = 10**9  # energies and times of capture that an ensemble keeps: eight gigabytes


def check_end(t_end: object) -> float:
    """Return a horizon, a number or infinity for none."""
    is_infinite = isinstance(t_end, numbers.Real) and t_end == math.inf
    return math.inf if is_infinite else check_number("t_end", t_end)


def check_states(scene: Scene, states: object) -> list[State]:
    """Return states whose numbers are floats; InvalidState names the particle."""
    found = []
    for i, state in enumerate(check_list("states", states, "a sequence of State")):
        try:
            found.append(check_numbers(scene, state, sys.float_info.max))
        except BadInput as error:
            raise InvalidState(f"particle {i}: {error}") from None
    return found


def check_energy(energy: object) -> float:
    """Return an energy in the bounds that squares allow."""
    found = check_number("energy", energy)
    if not 0.0 < found <= 2.0**800:
        raise BadInput(f"energy = {found}, must be > 0 and at most 2^800")
    return found


def check_phases(phases: object) -> tuple[float, ...]:
    """Return fractions of a cycle that rise and lie in (0, 1)."""
    given = check_list("phases", phases, "a sequence of numbers that rise and lie in (0, 1)")
    found = tuple(check_number(f"phases[{i}]", phase) for i, phase in enumerate(given))
    if any(not a < b for a, b in pairwise([0.0, *found, 1.0])):
        raise BadInput(f"phases = {shown(found)}, must rise and lie in (0, 1)")
    return found


def check_threads(threads: object) -> int:
    """Return how many threads to use: as many as asked for, by default one for each core."""
    available = os.cpu_count() or 1
    return available if threads is None else check_count("threads", threads, 1, available)


def check_progress(progress: object) -> Callable[[int], None] | None:
    """Return what is to be called with the number of particles done, or None."""
    if progress is not None and not callable(progress):
        raise BadInput(f"progress = {shown(progress)}, must be None or a function of one whole number")
    return progress


def check_kept(n_particles: int, n_cycles: int, n_phases: int, n_minima: int) -> None:
    """Refuse an ensemble whose results would not fit into memory."""
    kept = n_particles * n_cycles * (n_phases + 1 + 2 * n_minima)
    if kept > MAX_KEPT:
        raise BadInput(
            f"n_particles = {n_particles}, n_cycles = {n_cycles} and {n_phases} phases: {kept} energies and"
            f" times of capture to keep, must be at most {MAX_KEPT}"
        )
