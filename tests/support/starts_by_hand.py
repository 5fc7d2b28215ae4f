"""Starts whose next step is known by hand, beside the guards that a proof of it needs.

Each row is a scene in the wire's form, a state, a horizon and what is true: the wall met first, "horizon",
"rejected", or why it is undefined. Both sides of each bound stand side by side. The verifier and the
reference answer all of them.
"""

import math
from typing import Any

CAP: dict[str, Any] = {"table": "cap", "r": 1.0}
STEM: dict[str, Any] = {"table": "stem", "w": 1.0, "h": 1.0}
MUSHROOM: dict[str, Any] = {"table": "mushroom", "r": 1.0, "w": 0.5, "h": 1.0}


def fourier(**fields: Any) -> dict[str, Any]:
    """Return a law that swells by a quarter, but for the fields given."""
    law = {"kind": "fourier", "mean": 1.0, "omega": 1.0, "sin": [0.25]} | fields
    return {name: value for name, value in law.items() if value is not None}


def bang_bang(*knots: Any) -> dict[str, Any]:
    """Return a bang-bang law."""
    return {"kind": "bang-bang", "knots": list(knots)}


def state(
    x: float, y: float, vx: float, vy: float, wall: str | None = None, t: float = 0.0
) -> dict[str, Any]:
    """Return a state in the wire's form."""
    return {"t": t, "x": x, "y": y, "vx": vx, "vy": vy, "wall": wall}


HALF = 2.0**-20
AFTER = math.nextafter(0.5, 1)
TURNING = fourier(mean=1.0, omega=None, period=8.0)  # 1 at time 0, and more up to time 4
BENT: dict[str, Any] = {**STEM, "h": bang_bang([0.0, 1.0], [1.0, 2.0], [2.0, 1.0])}
LEANING = {**STEM, "slope": -1.0}
SOON = 2.0**-120
SINKING = {**STEM, "h": fourier(omega=None, period=2.0, sin=[], cos=[0.25])}


def both_waves(cos: float) -> dict[str, Any]:
    """Return a stem whose floor is at rest at time 0, with an acceleration that is that of a cosine."""
    return {**STEM, "h": fourier(omega=None, period=2.0, sin=[0.25, -0.125], cos=[cos])}


STARTS: list[tuple[dict[str, Any], dict[str, Any], float, str]] = [
    # Where the state lies.
    (CAP, state(0.0, -0.001, 0.0, 1.0), 9.0, "rejected"),
    (CAP, state(0.0, 1.001, 0.0, -1.0), 9.0, "rejected"),
    (CAP, state(0.8, 0.61, 0.0, -1.0), 9.0, "rejected"),
    (CAP, state(0.8, 0.59, 0.0, -1.0), 9.0, "base"),
    (STEM, state(0.0, 0.001, 0.0, -1.0), 9.0, "rejected"),
    (STEM, state(0.0, -1.001, 0.0, 1.0), 9.0, "rejected"),
    (STEM, state(-1.001, -0.5, 1.0, 0.0), 9.0, "rejected"),
    (STEM, state(1.001, -0.5, -1.0, 0.0), 9.0, "rejected"),
    (LEANING, state(1.25, -0.5, 0.0, -1.0), 9.0, "floor"),
    (LEANING, state(1.75, -0.5, 0.0, -1.0), 9.0, "rejected"),
    (MUSHROOM, state(0.75, -0.5, 0.0, -1.0), 9.0, "rejected"),
    (MUSHROOM, state(0.75, 0.5, 0.0, -1.0), 9.0, "base"),
    (MUSHROOM, state(-0.75, 0.0, 0.0, 1.0), 9.0, "arc"),
    (MUSHROOM, state(-0.75, 0.0, 0.0, -1.0), 9.0, "rejected"),
    (MUSHROOM, state(1.25, 0.0, 0.0, 1.0), 9.0, "rejected"),
    (MUSHROOM, state(0.25, 0.0, 0.0, 1.0), 9.0, "arc"),
    (MUSHROOM, state(0.25, 0.0, 0.0, -1.0), 9.0, "floor"),
    (MUSHROOM, state(0.25, -0.0, 0.125, 0.0), 9.0, "mouth-edge"),
    (MUSHROOM, state(0.25, 0.0, 0.125, 0.0), 1.5, "horizon"),
    (MUSHROOM, state(0.25, 0.0, 0.0, 0.0), 9.0, "horizon"),
    (MUSHROOM, state(0.75, 0.0, 0.0, 0.0), 9.0, "sliding"),
    (MUSHROOM, state(0.5, 0.0, 0.0, 1.0), 9.0, "mouth-edge"),
    (MUSHROOM, state(-0.5, 0.0, 1.0, 1.0), 9.0, "mouth-edge"),
    (MUSHROOM, state(1.0, 0.0, -1.0, 1.0), 9.0, "corner"),
    (MUSHROOM, state(1.0, 0.0, -1.0, 1.0, "arc"), 9.0, "corner"),
    (MUSHROOM, state(0.5, 0.0, -1.0, -1.0, "right"), 9.0, "mouth-edge"),
    (CAP, state(1.0, 0.0, -1.0, 1.0), 9.0, "corner"),
    (STEM, state(1.0, 0.0, -1.0, -1.0), 9.0, "corner"),
    (STEM, state(-1.0, -1.0, 1.0, 1.0), 9.0, "corner"),
    # Of the wall that it names it must lie within 2^-20 of the wall's size.
    (CAP, state(0.0, 1.0 - 0.999 * HALF, 0.0, -1.0, "arc"), 9.0, "base"),
    (CAP, state(0.0, 1.0 - 1.001 * HALF, 0.0, -1.0, "arc"), 9.0, "rejected"),
    (CAP, state(0.0, 1.0 + 0.999 * HALF, 0.0, -1.0, "arc"), 9.0, "base"),
    (CAP, state(0.0, 1.0 + 1.001 * HALF, 0.0, -1.0, "arc"), 9.0, "rejected"),
    (CAP, state(0.0, 0.999 * HALF, 0.0, 1.0, "base"), 9.0, "arc"),
    (CAP, state(0.0, -1.001 * HALF, 0.0, 1.0, "base"), 9.0, "rejected"),
    ({**STEM, "w": 0.5}, state(0.0, -0.499 * HALF, 0.0, -1.0, "base"), 9.0, "floor"),
    ({**STEM, "w": 0.5}, state(0.0, -0.501 * HALF, 0.0, -1.0, "base"), 9.0, "rejected"),
    ({**STEM, "h": 4.0}, state(0.0, -4.0 + 3.999 * HALF, 0.0, 1.0, "floor"), 9.0, "base"),
    ({**STEM, "h": 4.0}, state(0.0, -4.0 + 4.001 * HALF, 0.0, 1.0, "floor"), 9.0, "rejected"),
    ({**STEM, "w": 4.0}, state(-4.0 - 3.999 * HALF, -0.5, 1.0, 0.0, "left"), 2.0, "horizon"),
    ({**STEM, "w": 4.0}, state(-4.0 - 4.001 * HALF, -0.5, 1.0, 0.0, "left"), 2.0, "rejected"),
    ({**STEM, "w": 4.0}, state(4.0 - 3.999 * HALF, -0.5, -1.0, 0.0, "right"), 2.0, "horizon"),
    ({**STEM, "w": 4.0}, state(4.0 - 4.001 * HALF, -0.5, -1.0, 0.0, "right"), 2.0, "rejected"),
    (LEANING, state(1.5 - 1.499 * HALF, -0.5, -1.0, 0.0, "right"), 2.0, "horizon"),
    (LEANING, state(1.5 - 1.501 * HALF, -0.5, -1.0, 0.0, "right"), 2.0, "rejected"),
    ({**STEM, "slope": 0.5}, state(0.75 - 0.999 * HALF, -0.5, -1.0, 0.0, "right"), 1.0, "horizon"),
    ({**STEM, "slope": 0.5}, state(0.75 - 1.001 * HALF, -0.5, -1.0, 0.0, "right"), 1.0, "rejected"),
    # A wall ends where the other part of the table begins.
    (MUSHROOM, state(1.0, -HALF / 4, -1.0, 1.0, "arc"), 9.0, "rejected"),
    (MUSHROOM, state(0.5, HALF / 4, -1.0, -1.0, "right"), 9.0, "rejected"),
    (MUSHROOM, state(-0.5, HALF / 4, 1.0, -1.0, "left"), 9.0, "rejected"),
    ({**MUSHROOM, "h": 2.0**-22}, state(0.25, 2.0**-43, 0.0, 1.0, "floor"), 9.0, "rejected"),
    ({**STEM, "h": 2.0**-22}, state(0.25, 2.0**-43, 0.0, 1.0, "floor"), 9.0, "rejected"),
    (MUSHROOM, state(0.25, -1.0, 0.0, 1.0, "floor"), 9.0, "arc"),
    # Into its wall, along it, away from it.
    (CAP, state(0.0, 0.0, 1.0, -1.0, "base"), 9.0, "rejected"),
    (CAP, state(0.0, 0.0, 1.0, 0.0, "base"), 9.0, "sliding"),
    (CAP, state(0.0, 1.0, 1.0, 0.0, "arc"), 9.0, "sliding"),
    (STEM, state(0.0, -1.0, 1.0, 0.0, "floor"), 9.0, "sliding"),
    (STEM, state(1.0, -0.5, 0.0, 1.0, "right"), 9.0, "sliding"),
    ({**STEM, "h": fourier(sin=[-0.25])}, state(0.0, -1.0, 0.0, 0.0, "floor"), 9.0, "rejected"),
    ({**STEM, "h": fourier(sin=[0.25])}, state(0.0, -1.0, 0.0, 0.0, "floor"), 9.0, "floor"),
    (BENT, state(0.0, -1.0, 1.0, 0.0, "floor"), 0.5, "horizon"),
    ({**STEM, "h": bang_bang([0.0, 1.0], [1.0, 0.75], [2.0, 1.0])},
     state(0.0, -1.0, 0.25, 0.0, "floor"), 9.0, "sliding"),
    ({**STEM, "h": fourier(omega=None, period=2.0, sin=[0.25]), "w": 2.0},
     state(2.0, -0.5, 0.0, 0.25, "right"), 9.0, "tangency"),
    # Where a cosine turns, f' = vy, and the floor rises from there. With 128 bits vy is lost, with more not.
    (SINKING, state(0.0, -1.25, 0.0, 2.0**-140, "floor"), SOON, "floor"),
    (SINKING, state(0.0, -1.25, 0.0, -(2.0**-140), "floor"), SOON, "rejected"),
    # f' = 0 exactly, and f'' is that of a cosine, which is lost with 128 bits.
    (both_waves(2.0**-140), state(0.0, -1.0, 0.0, 0.0, "floor"), SOON, "sliding"),
    (both_waves(-(2.0**-140)), state(0.0, -1.0, 0.0, 0.0, "floor"), SOON, "horizon"),
    # Not on a wall at this phase, but at phase 0.
    ({**STEM, "w": TURNING}, state(1.0, -0.5, 0.5, 0.0, t=1.0), 9.0, "right"),
    ({**CAP, "r": TURNING}, state(0.0, 1.0, 0.0, 0.5, t=1.0), 9.0, "arc"),
    # What is met, and what lies at the horizon exactly.
    (CAP, state(0.0, 0.5, 0.0, -1.0), AFTER, "base"),
    (CAP, state(0.0, 0.5, 0.0, -1.0), 0.5, "horizon"),
    (CAP, state(0.0, 0.5, 0.0, 1.0), AFTER, "arc"),
    (CAP, state(0.0, 0.5, 0.0, 1.0), 0.5, "horizon"),
    (STEM, state(0.0, -0.5, 0.0, -1.0), AFTER, "floor"),
    (STEM, state(0.0, -0.5, 0.0, -1.0), 0.5, "horizon"),
    (MUSHROOM, state(0.25, 0.5, 0.0, -1.0), 1.5, "horizon"),
    (MUSHROOM, state(0.25, 0.5, 0.0, -1.0), 0.5, "horizon"),
    (MUSHROOM, state(0.25, 0.5, 0.0, -1.0), 9.0, "floor"),
    (MUSHROOM, state(0.25, -0.5, 0.0, 1.0), 9.0, "arc"),
    (MUSHROOM, state(0.5, 0.5, 0.0, -1.0), 9.0, "mouth-edge"),
    (MUSHROOM, state(0.25, -0.25, 0.25, 0.25), 9.0, "mouth-edge"),
    (MUSHROOM, state(0.0, 0.5, 1.0, -0.5), 9.0, "corner"),
    (STEM, state(0.5, -0.5, 0.5, 0.5), 9.0, "corner"),
    (STEM, state(-0.5, -0.5, -0.5, -0.5), 9.0, "corner"),
    (STEM, state(0.5, -0.5, 0.5, -0.5), 1.0, "horizon"),
    (STEM, state(0.5, -0.5, 0.5, -0.5), 0.75, "horizon"),
    # A side that its rounded place lies beyond is left all the same, and the mouth is open above it.
    (MUSHROOM, state(-0.5 - 2.0**-22, -0.5, 2.0**-23, 1.0, "left"), 9.0, "arc"),
    # The stem is wide while its slope is steep.
    ({**STEM, "w": 0.125, "slope": bang_bang([0.0, 0.0], [16.0, -8.0], [48.0, -8.0], [64.0, 0.0])},
     state(-7.0, -0.9, 1.0, 0.0, t=20.0), 99.0, "right"),
    # A place or a time so large that it may be refused.
    (CAP, state(0.0, 0.5, 0.0, -1.0, t=2.0**30 - 1), 2.0**30 + 9, "base"),
]  # fmt: skip
