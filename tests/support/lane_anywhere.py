"""Draws of scenes and starts of every kind, for the search in lane_search: those of the suite, on walls.

Laws of every shape, deep stems and shallow ones, narrow mouths; starts on every wall at every time, as slow
as the walls or quicker.
"""

from collections.abc import Callable
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from conformance.cases.draw import Draw, Unfit
from conformance.cases.scenes import any_scene, state, when
from fast.kernel.records import FloatArray
from fast.step import WALL_CODES
from scene import Cap, Scene

Start = tuple[FloatArray, int]  # t, its low part, x, y, vx, vy as the kernels take them, and the wall's code
Starts = tuple[Scene, list[Start]]


class Group(NamedTuple):
    """How to draw a scene and so many starts in it; whether particles move unfolded through the base."""

    draw: Callable[[int, np.random.Generator], Starts]
    is_captured: bool = False


def draw_anywhere(n: int, random: np.random.Generator) -> Starts:
    """Draw a scene and n starts on its walls."""
    draw, scene = Draw(f"lanes/{random.integers(2**32)}"), None
    while scene is None:
        with suppress(Unfit):
            scene = any_scene(draw)
    walls = ("arc",) if isinstance(scene, Cap) else scene.walls
    starts = []
    for _ in range(n):
        site, t, speed = draw.pick(walls), when(draw, scene), draw.power(-1, 8)
        start, _ = state(draw, scene, {"site": site, "t": t, "speed": speed})
        numbers = [start.t, 0.0, start.x, start.y, start.vx, start.vy]
        starts.append((np.array(numbers), int(WALL_CODES[site])))
    return scene, starts
