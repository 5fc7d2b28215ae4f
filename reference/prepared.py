"""A scene as this package computes with it: prepared once, found by scene, and handed down.

Each entry of the package asks `prepare` for its scene and hands on what that returns.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

from scene import Cap, Law, Mushroom, Scene, Stem, Wall
from scene.bounds import Bounds
from scene.pieces import Period


@dataclass(frozen=True, eq=False)
class PreparedTable:
    """A table, its laws, and how large it ever is.

    Attributes:
        given: the scene as it was given.
        is_cap: whether it has no stem.
        is_stem: whether it has no cap.
        is_mushroom: whether it has both.
        walls: the walls that it has.
        laws: by the names of its parameters.
        width: the names of the laws whose product is the half-width w of the mouth.
        cycle: the period that all moving laws share; None for a static table.
        radius: the largest radius of all time [length]; 0 without a cap.
        half_width: the largest w of all time [length]; 0 where w = nu r, which the radius exceeds.
        depth: the largest depth of all time [length]; 0 without a stem.
        tilt: the largest |slope| of all time.
    """

    given: Scene
    is_cap: bool
    is_stem: bool
    is_mushroom: bool
    walls: tuple[Wall, ...]
    laws: Mapping[str, Law]
    width: tuple[str, ...]
    cycle: Period | None
    radius: float
    half_width: float
    depth: float
    tilt: float


@lru_cache(maxsize=256)
def prepare(scene: Scene) -> PreparedTable:
    """Prepare a scene, or find it as it was prepared before.

    Args:
        scene: it has been checked to be one (`check_scene`).
    """
    bounds = {name: law.bounds() for name, law in scene.laws.items()}
    nothing = Bounds(0.0, 0.0, 0.0, 0.0)
    slope = bounds.get("slope", nothing)
    return PreparedTable(
        given=scene,
        is_cap=isinstance(scene, Cap),
        is_stem=isinstance(scene, Stem),
        is_mushroom=isinstance(scene, Mushroom),
        walls=scene.walls,
        laws=scene.laws,
        width=("nu", "r") if "nu" in scene.laws else ("w",),
        cycle=scene.cycle,
        radius=bounds.get("r", nothing).highest,
        half_width=bounds.get("w", nothing).highest,
        depth=bounds.get("h", nothing).highest,
        tilt=max(abs(slope.lowest), abs(slope.highest)),
    )
