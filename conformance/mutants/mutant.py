"""A mutant: the plain stepper with one method overridden by a function that makes one mistake.

The function takes the object, the plain method, and what the method takes. Its name, with hyphens, is the
mutant's; its docstring is the fault. A keyword `size` is the threshold from which on the mistake shows.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple, TypeVar

from conformance import plain
from conformance.plain.step import Flight, PlainPath
from scene import Outcome, Scene, State
from scene.protocol.wire import Captured

MOST_COLLISIONS = 1_000  # of a flow, where a mutant may never get to t_end; the corpus has fewer

T = TypeVar("T")
Plain = Callable[..., T]  # a method of the plain stepper, bound
Change = TypeVar("Change", bound=Callable[..., Any])


class Mutant(NamedTuple):
    """A faulty stepper.

    Attributes:
        name: words joined by hyphens.
        fault: what it does wrong, in a line.
        flight: the faulty computation of one flight.
        path: the faulty way from hit to hit.
        size: the threshold from which on the fault shows, or None for a fault without one.
        of_size: returns the mutant with another threshold.
    """

    name: str
    fault: str
    flight: type[Flight] = Flight
    path: type[PlainPath] = PlainPath
    size: float | None = None
    of_size: Callable[[float], "Mutant"] | None = None

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


PLAIN = Mutant("plain", "none")
MUTANTS: dict[str, Mutant] = {}
COMMON: dict[str, Mutant] = {}  # mistakes that a diagnosis names, though a mutant subsumes them


def mutant(kind: type, method: str, into: dict[str, Mutant] = MUTANTS) -> Callable[[Change], Change]:
    """Register a function as what a mutant does in place of a method of a flight, a path or a motion."""

    def register(change: Change) -> Change:
        made = make_mutant(kind, method, change, **(change.__kwdefaults__ or {}))
        into[made.name] = made
        return change

    return register


def make_mutant(kind: type, method: str, change: Callable[..., Any], size: float | None = None) -> Mutant:
    """Return the mutant that a function makes of a class; a motion is that of every law of its kind."""
    plain_method = getattr(kind, method)
    sized = change if size is None else partial(change, size=size)

    def changed(self: Any, *args: Any, **named: Any) -> Any:
        return sized(self, partial(plain_method, self), *args, **named)

    spoilt: Any = type(change.__name__, (kind,), {method: changed})
    if not issubclass(kind, Flight | PlainPath):
        motions = {law: spoilt if issubclass(kind, m) else m for law, m in Flight.kinds.items()}
        spoilt = type(change.__name__, (Flight,), {"kinds": motions})
    found = Mutant(
        change.__name__.replace("_", "-"),
        str(change.__doc__).splitlines()[0].rstrip("."),
        size=size,
        of_size=None if size is None else partial(make_mutant, kind, method, change),
    )
    return found._replace(path=spoilt) if issubclass(kind, PlainPath) else found._replace(flight=spoilt)
