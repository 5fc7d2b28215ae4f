"""The compiled functions that Python calls, kept in numba's disk cache.

numba's cache looks only at the file of the function it keeps, not at those of the functions
compiled into it. Hence each entry closes over a digest of all of this folder's sources: a change
anywhere makes it compile anew.
"""

from __future__ import annotations

import hashlib
import math
from pathlib import Path

import numpy as np
from numba import njit

from fast.kernel.arithmetic import sine_cosine
from fast.kernel.careful import first_step, step
from fast.kernel.codes import BASE, HORIZON, H, R, W
from fast.kernel.follow import follow
from fast.kernel.laws import ANCHORS_SHAPE, set_anchors
from fast.kernel.refine import fine_path
from fast.kernel.walls import wall_residual


def digest_of_sources(folder: Path) -> str:
    """Return a digest of the Python files in a folder and the folders in it."""
    digest = hashlib.sha256()
    for path in sorted(folder.rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()


QUARTER_TURN, QUARTER_TURN_LOW = math.pi / 2, 6.123233995736766e-17  # pi/2 as two floats
SOURCES = digest_of_sources(Path(__file__).parent.parent)


def _single_step(sources):
    @njit(cache=True, error_model="numpy")
    def single_step(table, is_relative, laws, bounds, p, wall, limit):
        """Judge one state and advance it in place. Returns (code, dt)."""
        sources  # noqa: B018
        return first_step(table, is_relative, laws, bounds, np.zeros(ANCHORS_SHAPE), p, wall, limit)

    return single_step


def _each_step(sources):
    @njit(cache=True, error_model="numpy")
    def each_step(table, is_relative, laws, bounds, starts, walls, out, met, n_times):
        """Fill out[i] = [dt, t, x, y, vx, vy] and met[i] with a step from each start, n_times over."""
        sources  # noqa: B018
        anchors, p = np.zeros(ANCHORS_SHAPE), np.empty(6)
        for _ in range(n_times):
            for i in range(starts.shape[0]):
                p[:] = starts[i]
                met[i], out[i, 0] = first_step(table, is_relative, laws, bounds, anchors, p, walls[i], np.inf)
                out[i, 1], out[i, 2:] = p[0], p[2:]

    return each_step


def _trajectory(sources):
    @njit(cache=True, error_model="numpy")
    def trajectory(table, is_relative, laws, bounds, p, wall, t_end, out, walls):
        """Fill out[i] = [dt, t, x, y, vx, vy] and walls[i] until full, t_end or trouble.

        Returns the number of collisions and the last code (of a wall when `out` is full).
        """
        sources  # noqa: B018
        anchors = np.zeros(ANCHORS_SHAPE)
        code = wall
        for i in range(out.shape[0]):
            limit = (t_end - p[0]) - p[1]
            if i == 0:
                code, s = first_step(table, is_relative, laws, bounds, anchors, p, code, limit)
            else:
                code, s = step(table, is_relative, laws, bounds, anchors, p, code, limit)
            if code >= HORIZON:
                return i, code
            walls[i] = code
            out[i, 0] = s
            out[i, 1] = p[0]
            out[i, 2:] = p[2:]
        return out.shape[0], code

    return trajectory


def _fine(sources):
    @njit(cache=True, error_model="numpy")
    def fine(table, is_relative, laws, bounds, start, wall, limit, out, met):
        """Follow a path in pairs of floats: see fast.kernel.refine."""
        sources  # noqa: B018
        return fine_path(table, is_relative, laws, bounds, start, wall, limit, out, met)

    return fine


def _follow(sources):
    @njit(cache=True, nogil=True, error_model="numpy")
    def follow_particles(scene, walls, stops, out, ends):
        """Follow particles to the last stop: see fast.kernel.follow. Threads may call it side by side."""
        sources  # noqa: B018
        follow(scene, walls, stops, out, ends)

    return follow_particles


def _wall_gap(sources):
    @njit(cache=True, error_model="numpy")
    def wall_gap(table, is_relative, laws, bounds, p, wall):
        """Tell whether a time's phase is known, and return r, w, h and the residual of a wall then.

        w is nu where `is_relative`. The residual of the base is y.
        """
        sources  # noqa: B018
        anchors = np.zeros(ANCHORS_SHAPE)
        is_known, f = set_anchors(laws, anchors, p[0], p[1]), p[3]
        if is_known and wall != BASE:
            f, _ = wall_residual(wall, p[2], p[3], laws, anchors, bounds, is_relative)
        return is_known, anchors[R, 0], anchors[W, 0], anchors[H, 0], f

    return wall_gap


def _directions(sources):
    @njit(cache=True, error_model="numpy")
    def directions(turns, out):
        """Fill out (n, 2) with cosine and sine of whole turns; no libm, hence the same everywhere."""
        sources  # noqa: B018
        for i in range(turns.shape[0]):
            s, _, c, _, _ = sine_cosine(4.0 * turns[i], 1.0, QUARTER_TURN, QUARTER_TURN_LOW)
            out[i, 0], out[i, 1] = c, s

    return directions


single_step = _single_step(SOURCES)
each_step = _each_step(SOURCES)
trajectory = _trajectory(SOURCES)
fine = _fine(SOURCES)
follow_particles = _follow(SOURCES)
wall_gap = _wall_gap(SOURCES)
directions = _directions(SOURCES)
