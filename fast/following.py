"""Compile `follow_particles` and leave it in numba's disk cache: `python -m fast.following`.

A process that compiles the rest meanwhile starts this one: see fast.kernel.beside.
"""

from __future__ import annotations

import numpy as np
from numba import typeof

from fast.kernel import entries
from fast.kernel.loops import Loops
from fast.kernel.records import unfilled_ends, unfilled_paths
from fast.kernel.worker import new_worker
from fast.pieces import laws_in_lanes
from fast.starts import only_stop
from scene import Cap


def compile_following() -> None:
    """Compile it for the one signature that it has, whatever the scene."""
    none = np.empty((0, 6))
    nowhere = Loops(*np.zeros(len(Loops._fields), np.int64).tolist())
    ends = unfilled_ends(none, 1, (1, 1))
    worker = new_worker(laws_in_lanes(Cap(r=1.0)), only_stop(np.inf), ends, loops=nowhere)
    given = worker, np.empty(0, np.int64), unfilled_paths(0, 0)
    entries.follow_particles.compile(tuple(map(typeof, given)))


if __name__ == "__main__":
    compile_following()
