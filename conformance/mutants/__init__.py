"""Mutants: the plain stepper with one physics error each, of the kind that people make.

A mutant is a class of flight, of the motion of a law, or of the path from hit to hit, that overrides what is
wrong. Each is killed by a `fail` on five vectors of the corpus or more (`kill_matrix` says which), not by a
crash. They prove that the suite can fail; nothing else may use them. None is equivalent to the plain stepper:
a mutant that changes no answer proves nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from conformance import plain
from conformance.mutants import of_laws, of_mouths, of_paths, of_phases, of_roots, of_stays, of_walls
from conformance.plain.flow import PlainPath
from conformance.plain.step import Flight
from scene import Outcome, Scene, State
from scene.protocol.wire import Captured

MOST_COLLISIONS = 1_000  # of a flow, where a mutant may never get to t_end; the corpus has fewer


class Mutant(NamedTuple):
    """A faulty stepper.

    Attributes:
        name: words joined by hyphens.
        fault: what it does wrong, in a line.
        flight: the faulty computation of one flight.
        path: the faulty way from hit to hit.
    """

    name: str
    fault: str
    flight: type[Flight] = Flight
    path: type[PlainPath] = PlainPath

    def step(self, scene: Scene, state: State, t_end: float) -> Outcome:
        """Return the mutant's answer to a step."""
        return plain.next_collision(scene, state, t_end, self.flight)

    def trajectory(self, scene: Scene, state: State, n_collisions: int, t_end: float) -> list[Outcome]:
        """Return the mutant's answer to a trajectory."""
        return plain.trajectory(scene, state, n_collisions, t_end, self.step, self.path)

    def flow(self, scene: Scene, states: Sequence[State], t_end: float) -> list[tuple[Outcome, Captured]]:
        """Return the mutant's answer to a flow."""
        paths = [self.path(scene, state, t_end, self.step) for state in states]
        for path in paths:
            path.most = MOST_COLLISIONS
        return [path.arrival() for path in paths]


def _listed() -> dict[str, Mutant]:
    """Name every mutant of the modules: its class's name in hyphens, its docstring as the fault."""
    found = {}
    for module in (of_laws, of_phases, of_walls, of_mouths, of_roots, of_paths, of_stays):
        for name, kind in vars(module).items():
            if name.startswith("_") or not isinstance(kind, type) or kind.__module__ != module.__name__:
                continue
            hyphened = "".join("-" * c.isupper() + c.lower() for c in name).strip("-")
            fault = str(kind.__doc__).rstrip(".")
            if issubclass(kind, PlainPath):
                found[hyphened] = Mutant(hyphened, fault, path=kind)
            else:
                found[hyphened] = Mutant(hyphened, fault, _flight(kind))
    return found


def _flight(kind: type) -> type[Flight]:
    """Return a class of flight as it is, and for a class of motion the plain flight that uses it."""
    if issubclass(kind, Flight):
        return kind
    spoilt = {
        law: kind if issubclass(kind, plain_motion) else plain_motion
        for law, plain_motion in Flight.kinds.items()
    }
    return type(kind.__name__, (Flight,), {"kinds": spoilt})


MUTANTS = _listed()
