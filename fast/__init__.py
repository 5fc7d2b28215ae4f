"""The fast stepper: a step, a trajectory, a flow and an ensemble in binary64, compiled by numba.

numba takes half a second to import, so that what is here is imported when it is first used.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fast.ensemble import Ensemble, Paused, go_on, simulate
    from fast.fine import FineTrajectory, fine_trajectory
    from fast.flow import Flow, flow
    from fast.step import next_collision
    from fast.trajectory import Collisions, trajectory
    from fast.until import Reached, follow

__all__ = [
    "Collisions",
    "Ensemble",
    "FineTrajectory",
    "Flow",
    "Paused",
    "Reached",
    "fine_trajectory",
    "flow",
    "follow",
    "go_on",
    "next_collision",
    "simulate",
    "trajectory",
]

_PLACES = {
    "ensemble": ("Ensemble", "simulate"),
    "fine": ("FineTrajectory", "fine_trajectory"),
    "flow": ("Flow", "flow"),
    "paused": ("Paused", "go_on"),
    "step": ("next_collision",),
    "trajectory": ("Collisions", "trajectory"),
    "until": ("Reached", "follow"),
}
_found: dict[str, Any] = {}


def _late(place: str, name: str) -> property:
    def get(_: ModuleType) -> Any:
        if name not in _found:
            _found[name] = getattr(import_module(f"fast.{place}"), name)
        return _found[name]

    def put(_: ModuleType, value: Any) -> None:
        # Python puts a module that it imports beside its siblings; here a function has that name.
        if not isinstance(value, ModuleType):
            _found[name] = value

    return property(get, put)


class _Face(ModuleType):
    """A module whose names stand before its submodules', two of which are called as their functions are."""

    def __dir__(self) -> list[str]:
        """List the public names, none of which has been imported yet."""
        return __all__


for _place, _names in _PLACES.items():
    for _name in _names:
        setattr(_Face, _name, _late(_place, _name))
sys.modules[__name__].__class__ = _Face
