"""Compile what a run needs into numba's disk cache: `python -m fast.first_run MOVES DEGREE WHAT...`.

A process that compiles the rest meanwhile starts this one: see fast.kernel.beside. MOVES is 1 where the
scene's slope moves, else 0; DEGREE is that of its laws' polynomials; WHAT is `follow` or the name of a loop.
"""

from __future__ import annotations

import sys

import numpy as np
from numba import typeof

from fast.compiled import compile_scene
from fast.kernel import entries
from fast.kernel.loops import Loops, compile_loop
from fast.kernel.records import unfilled_ends, unfilled_paths
from fast.kernel.worker import new_worker
from fast.pieces import in_lanes
from fast.starts import only_stop
from scene import Cap


def compile_following() -> None:
    """Compile `follow_particles` for the one signature that it has, whatever the scene."""
    none = np.empty((0, 6))
    nowhere = Loops(*np.zeros(len(Loops._fields), np.int64).tolist())
    ends = unfilled_ends(none, 1, (1, 1))
    # Of types alone: to find the pieces of a scene there is more to compile.
    fixed = in_lanes(compile_scene(Cap(r=1.0)), None)
    worker = new_worker(fixed, only_stop(np.inf), ends, loops=nowhere)
    given = worker, np.empty(0, np.int64), unfilled_paths(0, 0)
    entries.follow_particles.compile(tuple(map(typeof, given)))


def main(moves: str, degree: str, *what: str) -> None:
    """Compile what is named, in that order."""
    for name in what:
        if name == "follow":
            compile_following()
        else:
            compile_loop(name, moves == "1", int(degree))


if __name__ == "__main__":
    main(*sys.argv[1:])
