"""The fast stepper: a step, a trajectory, a flow and an ensemble in binary64, compiled by numba.

The functions are imported on first use, because importing numba takes half a second.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fast.ensemble import Ensemble, Paused, go_on, simulate
    from fast.paths import (
        Collisions,
        FineTrajectory,
        Flow,
        Reached,
        fine_trajectory,
        flow,
        follow,
        trajectory,
    )
    from fast.step import next_collision
    from fast.warming import kept_in, warm

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
    "kept_in",
    "next_collision",
    "simulate",
    "trajectory",
    "warm",
]

_MODULES = {
    "ensemble": ("Ensemble", "Paused", "go_on", "simulate"),
    "paths": (
        "Collisions",
        "FineTrajectory",
        "Flow",
        "Reached",
        "fine_trajectory",
        "flow",
        "follow",
        "trajectory",
    ),
    "step": ("next_collision",),
    "warming": ("kept_in", "warm"),
}


def __getattr__(name: str) -> Any:
    for module, names in _MODULES.items():
        if name in names:
            found = globals()[name] = getattr(import_module(f"fast.{module}"), name)  # not asked for again
            return found
    raise AttributeError(f"module 'fast' has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
