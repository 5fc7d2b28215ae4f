"""A scene as this package computes with it: prepared once, found by scene, and handed down.

Each entry of the package asks `prepare` for its scene and hands on what that returns.
What takes long, or is rarely needed, is found when it is first asked for.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

from fast.kernel.records import Compiled, FloatArray, LawsInLanes
from fast.kernel.single import pack_scene, static_time
from fast.pieces import laws_in_lanes
from fast.units import Units, compile_scene, in_units, units_of
from scene import Scene, State
from scene.mouth import mouth_minima, one_cycle, start_time


@dataclass(frozen=True, eq=False)
class Prepared:
    """A scene in the kernel's units.

    Attributes:
        given: the scene as it was given.
        scene: with its lengths and times divided by the units.
        length: exponent of the unit of length.
        time: exponent of the unit of time; None for a static table, which leaves it to the state.
        compiled: its numbers for the kernels.
        packed: the same in one array.
    """

    given: Scene
    scene: Scene
    length: int
    time: int | None
    compiled: Compiled
    packed: FloatArray

    def units(self, state: State) -> Units:
        """Return the units for one state: all that depends on it is a static table's unit of time."""
        speed = max(abs(state.vx), abs(state.vy))
        return Units(self.length, static_time(self.length, speed) if self.time is None else self.time)

    @cached_property
    def in_lanes(self) -> LawsInLanes:
        """Return its laws as the lanes know them."""
        return laws_in_lanes(self.scene, self.compiled)

    @cached_property
    def minima(self) -> tuple[float, ...]:
        """Return the phases of the local minima of nu (`scene.mouth`)."""
        return mouth_minima(self.scene)

    @cached_property
    def start(self) -> float:
        """Return when a cycle begins [time, in the kernel's units]."""
        return start_time(self.scene)

    @cached_property
    def cycle(self) -> float:
        """Return how long a cycle takes [time, in the kernel's units]; one unit for a static table."""
        return one_cycle(self.scene)


@lru_cache(maxsize=256)
def prepare(scene: Scene) -> Prepared:
    """Prepare a scene, or find it as it was prepared before.

    Args:
        scene: it has been checked to be one (`check_scene`).

    Raises:
        BadInput: a number of it loses bits beside the table's size and period, or a wall is too fast.
    """
    length, time = units_of(scene)
    fitted = in_units(scene, length, time or 0)
    compiled = compile_scene(fitted)
    return Prepared(scene, fitted, length, time, compiled, pack_scene(compiled, length, time))
