"""Compiling ahead: so that no later call waits for the compiler, as in an image or before a measurement."""

from pathlib import Path

import numpy as np
from numba import config, typeof

from fast.ensemble import only_stop
from fast.kernel import path, single
from fast.kernel.follow import follow_particles
from fast.kernel.numba_internals import cache_folder
from fast.kernel.records import NO_WALL, unfilled_ends
from fast.kernel.worker import loops_for, new_worker
from fast.prepared import prepare
from scene import Cap, Scene, check_scene


def kept_in() -> Path | None:
    """Return the folder in which compiled code is kept; None if there is none that can be written in."""
    return None if config.DISABLE_JIT else cache_folder(follow_particles)


def warm(scene: Scene | None = None) -> None:
    """Compile what steps, paths, flows and ensembles run, or load it from the disk cache.

    Later calls run compiled code from the first step on. The bits are the same either way.

    Args:
        scene: only kernels for such laws; None for those of all laws.

    Raises:
        BadInput: `scene` is not a scene, or does not fit into binary64.
    """
    if scene is not None:
        check_scene(scene)
    in_lanes = prepare(scene if scene is not None else Cap(r=1.0)).in_lanes
    single.allowance.left = 0
    single.asking()
    asked = (in_lanes.is_slope_moving, in_lanes.form)
    keys = list(path.PATHS) if scene is None else [asked]
    for key in keys:
        path.ALLOWANCES[key].left = 0
        loops_for(*key)
    worker = new_worker(in_lanes, only_stop(0.0), unfilled_ends(np.zeros((0, 6))))
    follow_particles(worker, np.zeros(0, np.int64))
    if config.DISABLE_JIT:
        return
    steps = np.zeros((0, 6))
    given = (worker, NO_WALL, np.zeros((4, 6)), steps, np.zeros(0, np.int64))
    for key in keys:
        path.PATHS[key].compile(tuple(map(typeof, given)))
