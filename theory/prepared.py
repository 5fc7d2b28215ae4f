"""A mushroom as theory computes with it: prepared once, found by scene, and handed down.

Each function that takes a scene asks `prepare` for it once and hands on what that returns. The
functions named `..._of` take such a record.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

from mpmath import fp

from scene.laws import Law
from scene.mouth import mouth_factors
from scene.pieces import Period
from scene.refusal import BadInput
from scene.tables import Mushroom, Scene, check_scene
from scene.transforms import scaled

FAR = 100  # powers of two of a length or a time, beyond which others are taken for units


class NotCovered(BadInput):
    """The theory does not cover this scene; the message says why."""


@dataclass(frozen=True, eq=False)
class PreparedMushroom:
    """A mushroom and its motion.

    Attributes:
        given: the scene as it was given.
        laws: by the names of its parameters.
        mouth: two laws whose quotient is nu.
        cycle: the period that all moving laws share; None for a static table.
        period: its length [time]; 0 for a static table.
        jointed: the moving laws that are not analytic at all times.
        breakpoints: the times in one period, law by law, at which laws are not analytic [time].
        is_upright: whether the sides are vertical at all times.
    """

    given: Mushroom
    laws: Mapping[str, Law]
    mouth: tuple[Law, Law]
    cycle: Period | None
    period: float
    jointed: tuple[Law, ...]
    breakpoints: tuple[float, ...]
    is_upright: bool

    @cached_property
    def near(self) -> NearUnits:
        """Return the mushroom in units in which binary64 holds its squares and cubes."""
        length = math.frexp(float(self.laws["r"].value(fp, 0.0)))[1]
        time = math.frexp(self.period)[1]
        if max(abs(length), abs(time)) <= FAR:
            return NearUnits(self, 0, 0)  # solved already, maybe
        return NearUnits(prepare(scaled(self.given, -length, -time)), length, time)

    def __reduce__(self) -> tuple[Callable[[Scene], PreparedMushroom], tuple[Any, ...]]:
        """Tell pickle and copy to prepare the scene again."""
        return prepare, (self.given,)


class NearUnits(NamedTuple):
    """A mushroom in other units, and these as powers of two of its own."""

    mushroom: PreparedMushroom
    length: int
    time: int


def prepare(scene: Scene) -> PreparedMushroom:
    """Prepare a scene, or find it as it was prepared before.

    Raises:
        BadInput: it is no scene.
        NotCovered: it is a cap or a stem.
    """
    return _prepared(as_mushroom(scene))


def as_mushroom(scene: Scene) -> Mushroom:
    """Return the scene when it is a mushroom; else raise as `prepare` does."""
    check_scene(scene)
    if isinstance(scene, Mushroom):
        return scene
    raise NotCovered(f"the theory is of mushrooms: table is {scene.__struct_config__.tag}")


@lru_cache(maxsize=256)
def _prepared(scene: Mushroom) -> PreparedMushroom:
    laws = scene.laws
    slope = laws["slope"]
    return PreparedMushroom(
        given=scene,
        laws=laws,
        mouth=mouth_factors(scene),
        cycle=scene.cycle,
        period=scene.period,
        jointed=tuple(law for law in laws.values() if law.breakpoints() and not law.is_constant),
        breakpoints=tuple(float(time) for law in laws.values() for time in law.breakpoints()),
        is_upright=slope.is_constant and bool(slope.level == 0),
    )
