"""The plain stepper's flow: a particle to t_end, and its first captured stay."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from math import hypot, prod
from typing import NamedTuple

from conformance.plain.step import SIDES, Flight, next_collision
from scene import Collision, Mushroom, Outcome, Scene, State, Undecided
from scene.tables import width_factors

MAX_COLLISIONS = 20_000  # of one particle: some seconds
Step = Callable[[Scene, State, float], Outcome]
Captured = tuple[float, float] | None


def flow(
    scene: Scene, states: Sequence[State], t_end: float, flight: type[Flight] = Flight
) -> list[tuple[Outcome, Captured]]:
    """Carry particles to t_end: the outcome of each there, and (begin, end) of its first captured stay."""
    step = partial(next_collision, flight=flight)
    return [carried(step, scene, state, t_end) for state in states]


def carried(step: Step, scene: Scene, state: State, t_end: float) -> tuple[Outcome, Captured]:
    """Carry one particle by any stepper, and watch its captured stays (docs/protocol.md)."""
    stay, first = Stay(), None
    for _ in range(MAX_COLLISIONS):
        outcome = step(scene, state, t_end)
        if not isinstance(outcome, Collision):
            break
        if outcome.wall in SIDES:
            stay, first = Stay(), first or stay.until(outcome.t)
        elif outcome.wall == "arc" and isinstance(scene, Mushroom):
            stay = stay.after(outcome.t, misses_mouth(scene, outcome.t, outcome, state.vx, state.vy))
        state = outcome.state()
    else:
        outcome = Undecided(f"more than {MAX_COLLISIONS} collisions")
    return outcome, first or stay.until(t_end)


class Stay(NamedTuple):
    """What is known of a captured stay: its first captured arc hit, and the first after its last one."""

    begin: float | None = None
    end: float | None = None

    def after(self, t: float, is_captured: bool) -> Stay:
        """Return the stay after an arc hit: uncaptured hits between captured ones do not divide it."""
        if is_captured:
            return Stay(t if self.begin is None else self.begin)
        return Stay(self.begin, t) if self.begin is not None and self.end is None else self

    def until(self, t: float) -> Captured:
        """Return begin and end of a stay that is over at time t, when a wall of the stem is met or t_end."""
        return None if self.begin is None else (self.begin, t if self.end is None else self.end)


def misses_mouth(scene: Mushroom, t: float, at: Collision | State, vx: float, vy: float) -> bool:
    """Tell whether |sin phi_hat| > nu: the chord through a place keeps further from the centre than w."""
    w = prod(Flight.kinds[type(law)](law, t).value for law in width_factors(scene))
    return bool(abs(at.x * vy - at.y * vx) > w * hypot(vx, vy))
