"""The kit with an engine that can intersect and reflect: here those of `conformance.plain`.

mushrooms check -- python parts.py
"""

from __future__ import annotations

from conformance.harness.kit import serve_parts
from conformance.plain import Flight
from scene import Scene, State, Wall


def intersect(scene: Scene, wall: Wall, state: State, after: float, until: float) -> float | None:
    """Return the first flight time at which the wall is met."""
    return Flight(scene, state, state.t + until).first_root(wall, after, until)


def reflect(
    scene: Scene, wall: Wall, t: float, x: float, y: float, vx: float, vy: float
) -> tuple[float, float]:
    """Return v - 2 (v.n - u) n at the place of the hit."""
    return Flight(scene, State(t, x, y, vx, vy), t).bounce(wall, 0.0)


if __name__ == "__main__":
    serve_parts("example-parts", intersect, reflect)
