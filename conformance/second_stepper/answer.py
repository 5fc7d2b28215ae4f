"""What the second stepper answers, and what it may not be able to answer."""

from __future__ import annotations

from typing import Any, NamedTuple

from conformance.vectors import OutcomeName
from scene import Wall


class OpenQuestion(Exception):  # noqa: N818 (a question left open is no error: precision is raised)
    """At this precision, or within this amount of work, the question stays open."""


class Answer(NamedTuple):
    """The outcome of one step.

    Attributes:
        kind: the outcome.
        wall: the wall met, of a collision.
        reason: of undefined, undecided and rejected.
        numbers: balls around dt [time], x, y [length], vx, vy [length/time] after the bounce or at the
            horizon; empty for other outcomes.
        jacobian: derivatives of the numbers by t, x, y, vx, vy (rows by numbers), of a collision: balls.
        bits: precision that decided it.
    """

    kind: OutcomeName
    wall: Wall | None = None
    reason: str = ""
    numbers: tuple[Any, ...] = ()
    jacobian: tuple[tuple[Any, ...], ...] = ()
    bits: int = 0
