"""The plain stepper's paths: collision after collision, and a particle's first capture interval."""

from collections.abc import Sequence
from math import hypot, prod
from typing import NamedTuple

from conformance.plain.step import SIDES, Flight, next_collision
from scene import Collision, Horizon, Mushroom, Outcome, Scene, State, Undecided
from scene.protocol.wire import Captured
from scene.states import Stepper
from scene.tables import width_factors

MAX_COLLISIONS = 20_000  # of one particle's flow: some seconds


class PlainPath:
    """One particle on its way from hit to hit, and its capture intervals (docs/protocol.md).

    A mutant that errs along the way, and not in a single flight, overrides a method.
    """

    most = MAX_COLLISIONS  # up to t_end

    def __init__(self, scene: Scene, state: State, t_end: float, step: Stepper = next_collision) -> None:
        self.scene, self.state, self.t_end, self.step = scene, state, t_end, step
        self.n_hits = 0
        self.stay = CaptureInterval()
        self.stays: list[tuple[float, float]] = []

    def advance(self) -> Outcome:
        """Take the next step; after a collision the particle stands where it led."""
        outcome = self.step(self.scene, self.state, self.t_end)
        if isinstance(outcome, Collision):
            self.n_hits += 1
            outcome = self.report(outcome)
            self.watch(outcome)
            self.state = self.departure(outcome)
        return outcome

    def report(self, hit: Collision) -> Collision:
        """Return a collision as it is answered, and gone on from."""
        return hit

    def departure(self, hit: Collision) -> State:
        """Return the state from which the next step starts."""
        return hit.state()

    def watch(self, hit: Collision) -> None:
        """Note what a collision means for capture intervals; the state is still that before its flight."""
        if hit.wall in SIDES:
            self.close(hit.t)
        elif hit.wall == "arc" and isinstance(self.scene, Mushroom):
            self.stay = self.stay.after(hit.t, self.is_captured(self.scene, hit))

    def close(self, t: float) -> None:
        """End the stay, if one is on, when a wall of the stem is met or at t_end."""
        if (stay := self.stay.until(t)) is not None:
            self.stays.append(stay)
        self.stay = CaptureInterval()

    def is_captured(self, scene: Mushroom, hit: Collision) -> bool:
        """Tell whether |sin phi_hat| > nu: the chord to an arc hit keeps further from the centre than w."""
        return misses_mouth(width(scene, hit.t), hit, self.state.vx, self.state.vy)

    def arrival(self) -> tuple[Outcome, Captured]:
        """Carry the particle to t_end, and return its first capture interval; a lost particle has none."""
        for _ in range(self.most):
            outcome = self.advance()
            if not isinstance(outcome, Collision):
                break
        else:
            outcome = Undecided(f"more than {self.most} collisions")
        if not isinstance(outcome, Horizon):
            return outcome, None
        self.close(self.t_end)
        return outcome, self.stays[0] if self.stays else None


class CaptureInterval(NamedTuple):
    """What is known of a capture interval: its first captured arc hit, and the first after its last one."""

    begin: float | None = None
    end: float | None = None

    def after(self, t: float, is_captured: bool) -> "CaptureInterval":
        """Return the stay after an arc hit: uncaptured hits between captured ones do not divide it."""
        if is_captured:
            return CaptureInterval(t if self.begin is None else self.begin)
        return CaptureInterval(self.begin, t) if self.begin is not None and self.end is None else self

    def until(self, t: float) -> Captured:
        """Return the stay that ends at t, if it did not before; None where there is none."""
        return None if self.begin is None else (self.begin, t if self.end is None else self.end)


def width(scene: Mushroom, t: float) -> float:
    """Return the half-width of the mouth at time t."""
    return float(prod(Flight.kinds[type(law)](law, t).value for law in width_factors(scene)))


def misses_mouth(w: float, at: Collision | State, vx: float, vy: float) -> bool:
    """Tell whether the line through a place keeps further from the centre than w: |x vy - y vx| > w |v|."""
    return abs(at.x * vy - at.y * vx) > w * hypot(vx, vy)


def trajectory(
    scene: Scene,
    state: State,
    n_collisions: int,
    t_end: float,
    step: Stepper = next_collision,
    path: type[PlainPath] = PlainPath,
) -> list[Outcome]:
    """Follow a particle by any stepper: its collisions, and last what came instead of one."""
    along = path(scene, state, t_end, step)
    steps: list[Outcome] = []
    while len(steps) < n_collisions:
        steps.append(along.advance())
        if not isinstance(steps[-1], Collision):
            break
    return steps


def flow(
    scene: Scene, states: Sequence[State], t_end: float, step: Stepper = next_collision
) -> list[tuple[Outcome, Captured]]:
    """Carry particles to t_end by any stepper: the outcome of each there, and its first capture interval."""
    return [PlainPath(scene, state, t_end, step).arrival() for state in states]
