"""Starts on a wall that is met again just after a knot of its law, or while it turns: tiny relative speeds.

The question is delicate in one way only. The wall has been at rest, or has moved with the particle, until
nearly the hit; its speed there is a multiple of the time since, which must be right relative to itself.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from mpmath import fp

from scene import BangBang, Law, Mushroom, Scene, State, Stem, Wall
from scene.geometry import half_width
from scene.laws import value
from scene.tables import laws

WALLS: tuple[Wall, ...] = ("arc", "left", "right", "floor")


def recollisions(seed: int, n: int) -> Iterator[tuple[Scene, State]]:
    """Draw n starts on walls of bang-bang scenes, with speeds relative to the wall from 1e-18 to 1."""
    random = np.random.default_rng(seed)
    for _ in range(n):
        yield _draw(random)


def _draw(random: np.random.Generator) -> tuple[Scene, State]:
    period, first = float(random.choice([0.5, 1.0, 3.5, 2.0**-6])), float(random.choice([0.0, 0.3125, -0.75]))
    wall: Wall = WALLS[int(random.integers(4))]

    def law(low: float, high: float) -> Law:
        if random.random() < 0.3:
            return float(random.uniform(low, high))
        return _plateaus(random, first, period, low, high)

    slope = float(random.choice([0.0, 0.0, random.uniform(-0.05, 0.05)]))
    scene: Scene
    if wall != "arc" and random.random() < 0.5:
        scene = Stem(w=law(0.5, 1.0), h=law(0.5, 4.0), slope=slope)
    elif random.random() < 0.5:
        scene = Mushroom(r=law(1.0, 2.0), w=law(0.5, 0.9), h=law(0.5, 4.0), slope=slope)
    else:
        scene = Mushroom(r=law(1.0, 2.0), nu=law(0.5, 0.9), h=law(0.5, 4.0), slope=slope)
    t = first + period * float(random.integers(-3, 200) + random.random())
    return scene, _on_wall(random, scene, wall, t, slope)


def _plateaus(random: np.random.Generator, first: float, period: float, low: float, high: float) -> Law:
    n = int(random.integers(2, 5))
    inner = np.sort(random.uniform(0.02, 0.98, n)) * period
    values = [float(v) for v in random.uniform(low, high, n)]
    for i in range(1, n):
        if random.random() < 0.5:
            values[i] = values[i - 1]
    times = [first, *(float(first + t) for t in inner), first + period]
    return BangBang(knots=tuple(zip(times, [values[-1], *values, values[-1]], strict=True)))


def _on_wall(random: np.random.Generator, scene: Scene, wall: Wall, t: float, slope: float) -> State:
    now = {name: float(value(fp, law, t)) for name, law in laws(scene).items()}
    rates = {name: float(value(fp, law, t, 1)) for name, law in laws(scene).items()}
    away = float(10.0 ** random.uniform(-18, 0))  # relative to the wall, inward
    along = float(random.choice([0.0, random.uniform(-0.2, 0.2), 10.0 ** random.uniform(-12, -1)]))
    if wall == "arc":
        angle = float(random.uniform(0.05, 3.09))
        x, y = now["r"] * np.cos(angle), now["r"] * np.sin(angle)
        out = rates["r"] - away
        # Along the arc the flight is a chord: short only for a slow particle.
        along *= float(random.choice([0.0, 1.0]))
        return State(
            t, float(x), float(y),
            float(out * np.cos(angle) - along * np.sin(angle)),
            float(out * np.sin(angle) + along * np.cos(angle)),
            wall,
        )  # fmt: skip
    x = float(random.uniform(-0.3, 0.3))
    if wall == "floor":
        return State(t, x, -now["h"], along, away - rates["h"], wall)
    w, rate = (float(half_width(fp, scene, t, order)) for order in (0, 1))
    y = -float(random.uniform(0.1, 0.9)) * now["h"]
    sign = 1.0 if wall == "right" else -1.0
    return State(t, sign * (w + slope * y), y, sign * (rate + slope * along - away), along, wall)
