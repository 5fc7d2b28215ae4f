"""One attack: a question that family, seed and index name for ever, and its line in the wire's form."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

import msgspec

from conformance.cases.draws import Draw, wire_form
from scene import BadInput, Cap, Mushroom, Scene, State, Stem

Made = TypeVar("Made", Cap, Stem, Mushroom)
NEVER = 2.0**1000  # the horizon of paths that are asked for without one [time]


class Attack(NamedTuple):
    """A question put to a stepper.

    Attributes:
        scene: table and laws.
        state: the start.
        t_end: horizon [time].
        n_collisions: how many collisions to follow; None asks for one step.
        working: decimals that the reference may work with, on a trajectory; None lets it choose.
        is_flow: ask for all collisions up to t_end at once too (the fast stepper's lanes).
    """

    scene: Scene
    state: State
    t_end: float
    n_collisions: int | None = None
    working: int | None = None
    is_flow: bool = False


class Family(NamedTuple):
    """A kind of attack.

    Attributes:
        draw: from a stream of numbers to a question. Its name is the family's, and names cases for ever.
        hunts: the mistake it looks for.
        is_delicate: built so that an honest stepper may often leave it undecided.
    """

    draw: Callable[[Draw], Attack]
    hunts: str
    is_delicate: bool = False

    @property
    def name(self) -> str:
        """Return the function's name, its words joined by hyphens."""
        return self.draw.__name__.replace("_", "-")

    def attack(self, seed: int, index: int) -> Attack:
        """Draw the question that this seed and index name."""
        return self.draw(Draw(f"{self.name}/{seed}/{index}"))


def built(make: Callable[[], Made]) -> Made | None:
    """Return what is made, or None where a law or the scene would not be valid."""
    try:
        return make()
    except BadInput:
        return None


def line(family: str, seed: int, index: int, attack: Attack) -> str:
    """Write an attack as one line of JSON: where it comes from, and the question in the wire's form."""
    data: dict[str, Any] = {"family": family, "seed": seed, "index": index, "scene": wire_form(attack.scene)}
    data |= {"cmd": "step" if attack.n_collisions is None else "trajectory"}
    data |= {"state": msgspec.structs.asdict(attack.state), "t_end": attack.t_end}
    if attack.n_collisions is not None:
        data |= {"collisions": attack.n_collisions, "working": attack.working}
    return json.dumps(data)
