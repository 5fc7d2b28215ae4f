"""The reference's answers in the form that comparisons take, and how delicate a question is."""

from __future__ import annotations

import os
from fractions import Fraction

from msgspec import to_builtins

import reference
import scene as scenes
from conformance.grading.agreement import Truth
from reference.arithmetic import Enclosure
from scene import Scene, State
from scene.laws import bounds
from scene.tables import laws

IS_DEEP = os.environ.get("HYPOTHESIS_PROFILE") == "deep"
NUDGE = 2.0**-46  # what rounding may move a state by, relative to the table and to the speed


centre = Enclosure.centre


def proved_step(scene: Scene, state: State, t_end: float, digits: int = 30) -> Truth:
    outcome = reference.next_collision(scene, state, t_end, digits=digits, is_differentiated=True)
    if isinstance(outcome, reference.Collision):
        numbers = [centre(outcome.dt), *(centre(c) for c in outcome.after[1:])]
        assert outcome.jacobian is not None
        return Truth(outcome.rounded(), numbers, [[float(d) for d in row] for row in outcome.jacobian])
    if isinstance(outcome, reference.Horizon):
        dt = Fraction(t_end) - Fraction(state.t)
        return Truth(outcome.rounded(), [dt, *(centre(c) for c in outcome.at[1:])])
    return Truth(outcome)


def is_delicate(scene: Scene, state: State, t_end: float) -> bool:
    """Tell whether nudging the state changes the kind of its outcome, the wall, or dt greatly."""
    size = max(bounds(law).highest for name, law in laws(scene).items() if name in ("r", "w", "h"))
    speed = abs(state.vx) + abs(state.vy) + max(bounds(law).slope for law in laws(scene).values())
    seen, times = set(), []
    for field, scale in (("x", size), ("y", size), ("vx", speed), ("vy", speed)):
        for nudge in (-NUDGE * scale, 0.0, NUDGE * scale):
            nudged = {**to_builtins(state), field: getattr(state, field) + nudge}
            outcome = reference.next_collision(scene, State(**nudged), t_end, digits=20)
            if isinstance(outcome, scenes.Undecided):
                continue
            seen.add((type(outcome).__name__, getattr(outcome, "wall", None)))
            times += [float(outcome.dt)] if isinstance(outcome, reference.Collision) else []
    return len(seen) != 1 or (len(times) > 0 and max(times) - min(times) > 1e-3 * max(times))
