"""What a thread holds while it follows particles: the scene, its pools, and what it fills in."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fast.kernel.codes import CAP, MUSHROOM, STEM
from fast.kernel.limits import LawLimits, limits_of
from fast.kernel.loops import Loops, loops_of
from fast.kernel.pools import LANES, POOL_SIZE

from fast.kernel.records import (  # isort: skip
    ANCHORS_SHAPE, Compiled, FloatArray, Followed, IntArray, LawsInLanes, Pieces, Stops,
    TableOfLanes, LaneWaves,
)  # fmt: skip

CACHE_LINE = 64  # bytes
GENERAL, DISK = np.arange(2)  # pools
# Rows of a roster: each lane's particle, and the number of its next stop.
PARTICLE, NEXT_STOP = np.arange(2)


class Worker(NamedTuple):
    """What one thread needs to follow some particles.

    Attributes:
        scene, limits: the scene, and what holds of it for all time.
        table: of which kind it is, for the lanes.
        pieces, waves, degree: its laws as the lanes know them.
        slope, is_slope_moving: of the sides, where it stands still; whether it moves.
        loops: the compiled loops for laws of this degree and such a slope.
        anchors: room for its laws at one time.
        is_laned: the lanes may be used.
        pools: (2, POOL_SIZE) general and disk pool.
        rosters: (2, 2, LANES) their rosters.
        n_held: (2,) number of lanes in use in each.
        stops: when particles are looked at.
        followed: what is filled in.
        n_passed: stops passed before; if any, particles go on from `followed.lanes`.
    """

    scene: Compiled
    limits: LawLimits
    table: TableOfLanes
    pieces: Pieces
    waves: LaneWaves
    degree: int
    slope: float
    is_slope_moving: bool
    loops: Loops
    anchors: FloatArray
    is_laned: bool
    pools: FloatArray
    rosters: IntArray
    n_held: IntArray
    stops: Stops
    followed: Followed
    n_passed: int


def is_known_throughout(in_lanes: LawsInLanes, last: float) -> bool:
    """Tell whether lanes know the laws up to a time; with no end, `set_reference` looks each time."""
    until = in_lanes.pieces.until
    return until > 0.0 and (abs(last) < until or last == np.inf)


def table_of(scene: Compiled) -> TableOfLanes:
    """Return what kind of table a scene is."""
    kind = scene.table
    return TableOfLanes(kind == int(STEM), kind == int(MUSHROOM), kind == int(CAP), bool(scene.is_relative))


def new_pools() -> FloatArray:
    """Return (2, POOL_SIZE) empty pools that begin with a cache line, as then do all their rows.

    numpy begins at any multiple of 16 bytes, and a register that is loaded across two lines takes longer: how
    quick the same loops were hung on where a process happened to put them.
    """
    room = np.zeros(2 * POOL_SIZE + CACHE_LINE // 8)
    first = -room.ctypes.data % CACHE_LINE // 8
    return room[first : first + 2 * POOL_SIZE].reshape(2, POOL_SIZE)


def new_worker(
    in_lanes: LawsInLanes, stops: Stops, followed: Followed, n_passed: int = 0, loops: Loops | None = None
) -> Worker:
    """Return a worker that holds no particle yet; with its scene's loops, or the given ones."""
    return Worker(
        in_lanes.compiled,
        limits_of(in_lanes.compiled),
        table_of(in_lanes.compiled),
        in_lanes.pieces,
        in_lanes.waves,
        in_lanes.degree,
        0.0 if in_lanes.slope is None else in_lanes.slope,
        in_lanes.slope is None,
        loops or loops_of(in_lanes),
        np.zeros(ANCHORS_SHAPE),
        is_known_throughout(in_lanes, float(stops.times[-1])),
        new_pools(),
        np.zeros((2, 2, LANES), np.int64),
        np.zeros(2, np.int64),
        stops,
        followed,
        n_passed,
    )
