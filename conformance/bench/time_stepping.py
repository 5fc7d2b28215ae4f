"""The usual way, as a baseline: integrate the free flight and watch for events, by scipy's solve_ivp.

An event is a change of sign between the ends of an integrator's step, refined by Brent's method. The free
flight has no error that the step control could see, so steps grow until they skip what happens within them;
and at the start on a wall the sign is that of a rounding error. Both are what such codes do.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
from mpmath import fp
from scipy.integrate import solve_ivp

from conformance.plain import Flight
from scene import Collision, Horizon, Mushroom, Outcome, Scene, State, Undecided, Wall
from scene.geometry import table_at

TOLERANCES = (1e-3, 1e-6, 1e-9, 1e-12)
FloatArray = npt.NDArray[np.float64]


def next_collision_by(rtol: float) -> Callable[[Scene, State, float], Outcome]:
    """Return a stepper that integrates with this tolerance, relative and absolute alike."""

    def step(scene: Scene, state: State, t_end: float) -> Outcome:
        part = "cap" if Flight(scene, state, t_end).is_in_cap else "stem"
        t, q = state.t, np.array([state.x, state.y, state.vx, state.vy])
        while True:
            walls: tuple[Wall, ...] = ("arc", "base") if part == "cap" else ("left", "right", "floor", "base")
            events = [_event(scene, part, wall) for wall in walls]
            found = solve_ivp(
                lambda _, q: [q[2], q[3], 0.0, 0.0], (t, t_end), q, rtol=rtol, atol=rtol, events=events
            )
            if found.status == 0:
                return Horizon(t_end, *map(float, found.y[:, -1]))
            if found.status != 1:
                return Undecided(str(found.message))
            wall = next(name for name, times in zip(walls, found.t_events, strict=True) if len(times))
            t, q = float(found.t[-1]), found.y[:, -1]
            is_open = part == "stem" or abs(q[0]) < float(table_at(fp, scene, t).w)
            if wall == "base" and isinstance(scene, Mushroom) and is_open:
                part = "stem" if part == "cap" else "cap"
                q[1] = 0.0
                continue
            velocity = Flight(scene, State(t, *q.tolist()), t).bounce(wall, 0.0)
            return Collision(wall, t - state.t, t, float(q[0]), float(q[1]), *velocity)

    return step


def _event(scene: Scene, part: str, wall: Wall) -> Any:
    """Return when a wall's f, or y = 0 where a part of the table ends, is passed from inside."""

    def event(t: float, q: FloatArray) -> float:
        if wall == "base":
            return float(q[1]) if part == "cap" else -float(q[1])
        return float(table_at(fp, scene, t).gap(wall, *q[:2].tolist()))

    event.terminal, event.direction = True, -1.0  # type: ignore[attr-defined]
    return event
