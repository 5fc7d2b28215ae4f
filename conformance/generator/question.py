"""What a vector asks, and how it is filed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from conformance.generator.stays import Mark
from conformance.vectors import Level, OutcomeName
from scene import State

LONGEST = 1e8  # condition number up to which a trajectory is followed


class Question(NamedTuple):
    """What a vector asks, and how its vector is filed.

    Attributes:
        group: first part of its id.
        rule: what it tests.
        source: place in the paper, or hard case.
        scene: the wire's form.
        state: the start.
        t_end: horizon [time].
        collisions: None for a step; for a trajectory how many are tried, for a flow how many at most.
        also: outcomes that are right beside the proved one.
        level: None to measure it.
        longest: condition number up to which a trajectory or a flow is followed.
        flow: None when it is none; else which of its collisions' marks (`stays.marks`) are looked for.
    """

    group: str
    rule: str
    source: str
    scene: dict[str, Any]
    state: State
    t_end: float
    collisions: int | None = None
    also: tuple[OutcomeName, ...] = ()
    level: Level | None = None
    longest: float = LONGEST
    flow: Callable[[Sequence[Mark]], bool] | None = None
