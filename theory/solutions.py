"""Solved cycles, kept for whoever asks again: figures, moments, densities and curves begin from one solution.

What is kept is numbers alone, those of the last KEPT solutions to few digits. Each caller gets them in the
number system of its own cycle: it may change that, or compute in another thread, and nobody else is touched.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

from scene.laws import Law
from scene.tables import Scene, laws
from theory.adiabatic import Captures, Panel, Window, captures, grid_for
from theory.cycle import Cycle

KEPT = 64
FEW_DIGITS = 60  # a solution takes about a megabyte then, and grows with the square of the digits


class _Solution:
    """A place for the numbers of one solution."""

    window: Window | None = None


def solved(scene: Scene, cycle: Cycle, target: int, told: Callable[[float], None] | None = None) -> Captures:
    """Return a cycle's captures: see `theory.adiabatic.captures`.

    Args:
        scene: what the cycle is of.
        cycle: `Cycle.of` the scene.
        target: as for `captures`.
        told: as for `captures`; what is kept is told as done.

    Raises:
        NotConverged: as `captures`.
    """
    if cycle.digits > FEW_DIGITS:
        return captures(cycle, target, told)
    place = _place(tuple(laws(scene).items()), cycle.digits, target)
    if place.window is None:
        found = captures(cycle, target, told)
        place.window = _moved(found.root, lambda number: number._mpf_)
        return found
    if told is not None:
        told(1.0)
    return Captures(cycle, grid_for(cycle.ctx, target), target, _moved(place.window, cycle.ctx.make_mpf))


@lru_cache(maxsize=KEPT)
def _place(given: tuple[tuple[str, Law], ...], digits: int, target: int) -> _Solution:
    return _Solution()


def _moved(window: Window, change: Callable[[Any], Any]) -> Window:
    """Return the same numbers in another form."""
    panels = (Panel(*([change(number) for number in column] for column in panel)) for panel in window.panels)
    children = (_moved(child, change) for child in window.children)
    return Window(tuple(panels), tuple(children), *map(change, window[2:]))
