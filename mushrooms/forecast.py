"""What `mushrooms simulate` says of time: collisions to expect, durations in words, and what slowed a run."""

from __future__ import annotations

import math
from typing import Any

from mpmath import fp

from fast.starts import one_cycle
from scene import Cap, Mushroom, Scene, Stem
from scene.geometry import table_at
from scene.mouth import start_time
from scene.refusal import BadInput

MOST_CYCLES = 300  # after which particles that grow faster stay fast enough for any run never to end
CAREFUL_COST = 50  # collisions in lanes that take as long as one careful step, measured at 40 to 80
UNITS = ((1.0, "seconds"), (60.0, "minutes"), (3600.0, "hours"), (86400.0, "days"))


def format_duration(seconds: float) -> str:
    """Return a duration in the unit that suits it."""
    size, unit = next(u for u in reversed(UNITS) if seconds >= 1.5 * u[0] or u is UNITS[0])
    n = seconds / size
    return f"{n:.2g} {unit}" if n < 10 or n > 1e6 else f"{n:.0f} {unit}"


def expected_collisions(scene: Scene, energy: float, n_cycles: int) -> float:
    """Return how many collisions to expect of a particle; nan at the edge of binary64."""
    try:
        return _collisions_of_a_cycle(scene, energy) * _as_first_cycles(scene, n_cycles)
    except (BadInput, ArithmeticError):
        return math.nan


def _collisions_of_a_cycle(scene: Scene, energy: float) -> float:
    """Return how many collisions to expect of a particle that is fast beside the walls.

    Particles uniform in place and direction meet the walls, of length P around an area A, at the rate
    v P / (pi A), however they move; in a cycle v^2 goes as 1 / A.
    """
    begin, span, n_times = start_time(scene), one_cycle(scene), 64
    area, _ = _size(scene, begin)
    sizes = [_size(scene, begin + span * ((k + 0.5) / n_times)) for k in range(n_times)]
    rates = [math.sqrt(2.0 * energy * area / a) * walls / (math.pi * a) for a, walls in sizes]
    return math.fsum(rates) * span / n_times


def _as_first_cycles(scene: Scene, n_cycles: int) -> float:
    """Return how many first cycles make as many collisions; theory says how v grows in a mushroom."""
    if n_cycles <= 1 or not isinstance(scene, Mushroom):
        return n_cycles
    import theory

    growth = float(theory.mean_of(scene, lambda s: s.context.exp(s / 2), 5))
    n = min(n_cycles, MOST_CYCLES)
    return max(float(n_cycles), math.fsum(growth**k for k in range(n)))


def _size(scene: Scene, t: float) -> tuple[float, float]:
    """Return a table's area [length^2] and the length of its walls [length] at a time."""
    now: Any = table_at(fp, scene, t)
    top = 2 * now.w if isinstance(scene, Stem) else math.pi * now.r + 2 * (now.r - now.w)
    stem = 2 * (now.h * math.hypot(1.0, now.slope) + now.half_width(-now.h))
    return float(now.cap_area() + now.stem_area()), float(top + (0 if isinstance(scene, Cap) else stem))


def careful_note(n_careful: int, n_collisions: int, seconds: float) -> str | None:
    """Return a line on careful steps, if a run took a second and they took over a tenth of its time."""
    share = n_careful / max(n_collisions, 1)
    part = CAREFUL_COST * share / (1.0 + (CAREFUL_COST - 1.0) * share)
    if seconds < 1.0 or part <= 0.1:
        return None
    return (
        f"careful steps: {share:.2g} of the collisions, some {part:.0%} of the time. They are as right as the"
        " others. Walls that move far between two collisions need them: at higher energy they are fewer"
    )
