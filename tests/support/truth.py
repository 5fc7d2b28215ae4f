"""Certified answers, from the one prover, and how delicate a question is."""

import os
from fractions import Fraction
from typing import Any

from msgspec import to_builtins
from msgspec.structs import replace

import reference
import scene as scenes
from conformance import vectors
from conformance.cases.certify import proved_step
from conformance.grading.agreement import middle
from reference.arithmetic import Enclosure
from scene import Scene, State

__all__ = ["IS_DEEP", "centre", "certified_answer", "is_delicate", "jacobian_error", "proved_step"]

IS_DEEP = os.environ.get("HYPOTHESIS_PROFILE") == "deep"
NUDGE = 2.0**-46  # what rounding may move a state by, relative to the table and to the speed
centre = Enclosure.centre
INPUTS = ("t", "x", "y", "vx", "vy")


def jacobian_error(scene: Scene, start: State, walls: list[str]) -> float:
    """Return how far a path's Jacobian is from differences, as a share of its largest entry."""
    n = len(walls)
    path = reference.trajectory(scene, start, n, is_differentiated=True)
    assert [step.wall for step in path.steps] == walls
    h, worst = 2.0**-40, 0.0
    largest = max(abs(float(d)) for row in path.jacobian for d in row)
    for column, field in enumerate(INPUTS):
        starts = [replace(start, **{field: getattr(start, field) + d}) for d in (h, -h)]
        ends = [reference.trajectory(scene, s, n).steps[-1].after for s in starts]
        step = Fraction(getattr(starts[0], field)) - Fraction(getattr(starts[1], field))
        for row, (plus, minus) in zip(path.jacobian, zip(*ends, strict=True), strict=True):
            difference = float((centre(plus) - centre(minus)) / step)
            worst = max(worst, abs(float(row[column]) - difference) / largest)
    return worst


def is_delicate(scene: Scene, state: State, t_end: float) -> bool:
    """Tell whether nudging the state changes the kind of its outcome, the wall, or dt greatly."""
    size = max(law.bounds().highest for name, law in scene.laws.items() if name in ("r", "w", "h"))
    speed = abs(state.vx) + abs(state.vy) + max(law.bounds().slope for law in scene.laws.values())
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


def certified_answer(vector: vectors.Vector) -> dict[str, Any]:
    """Return the answer in the middle of the enclosures, rounded, as it comes over the wire."""
    steps = to_builtins(middle(vector.expect[0], vector.state))
    if vector.kind == "trajectory":
        return {"steps": steps}
    if vector.kind == "step":
        return dict(steps[-1])
    times, stays = [vector.state.t, *(step["t"] for step in steps)], vector.expect[0].stays
    stay = [times[place + 1] for place in stays[0]] if stays else None
    return {"states": [{**steps[-1], "captured": stay}]}
