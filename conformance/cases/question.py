"""What a vector asks, what is proved of it, and how both are filed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from conformance.cases.stays import Mark
from conformance.vectors import Expectation, Kind, Level, OutcomeName, Vector
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

    @property
    def kind(self) -> Kind:
        """Return what is asked for."""
        return "step" if self.collisions is None else "flow" if self.flow else "trajectory"


class Proved(NamedTuple):
    """What is certified: the right answers, how delicate they are, and how many collisions they have."""

    expect: tuple[Expectation, ...]
    condition: float = 0.0
    collisions: int = 1


def filed(question: Question, number: int, proved: Proved, level: Level) -> Vector:
    """Return a question with its answers as a vector, of this number in its group."""
    return Vector(
        id=f"{question.group}/{number}",
        group=question.group,
        level=level,
        kind=question.kind,
        rule=question.rule,
        source=question.source,
        scene=question.scene,
        state=question.state,
        t_end=question.t_end,
        expect=proved.expect,
        collisions=proved.collisions,
        condition=proved.condition,
    )
