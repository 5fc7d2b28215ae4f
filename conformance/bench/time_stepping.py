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

from scene import Cap, Collision, Horizon, Mushroom, Outcome, Scene, State, Stem, Undecided, Wall
from scene.geometry import half_width, table_at
from scene.laws import value
from scene.tables import laws

TOLERANCES = (1e-3, 1e-6, 1e-9, 1e-12)
FloatArray = npt.NDArray[np.float64]
Gap = Callable[[float, FloatArray], float]


def next_collision_by(rtol: float) -> Callable[[Scene, State, float], Outcome]:
    """Return a stepper that integrates with this tolerance, relative and absolute alike."""

    def step(scene: Scene, state: State, t_end: float) -> Outcome:
        part = _first_part(scene, state)
        t, q = state.t, np.array([state.x, state.y, state.vx, state.vy])
        while True:
            gaps = _gaps(scene, part)
            found = solve_ivp(
                _drift, (t, t_end), q, rtol=rtol, atol=rtol, events=[_event(gap) for gap in gaps.values()]
            )
            if found.status == 0:
                return Horizon(t_end, *map(float, found.y[:, -1]))
            if found.status != 1:
                return Undecided(str(found.message))
            wall = next(name for name, times in zip(gaps, found.t_events, strict=True) if len(times))
            t, q = float(found.t[-1]), found.y[:, -1]
            is_open = isinstance(scene, Mushroom) and abs(q[0]) < half_width(fp, scene, t)
            if wall == "mouth" or (wall == "base" and is_open):
                part = "stem" if part == "cap" else "cap"
                q[1] = 0.0
                continue
            velocity = _bounce(scene, wall, t, q)
            return Collision(wall, t - state.t, t, float(q[0]), float(q[1]), *velocity)

    return step


def _drift(_: float, q: FloatArray) -> FloatArray:
    return np.array([q[2], q[3], 0.0, 0.0])


def _event(gap: Gap) -> Any:
    def event(t: float, q: FloatArray) -> float:
        return gap(t, q)

    event.terminal, event.direction = True, -1.0  # type: ignore[attr-defined]
    return event


def _first_part(scene: Scene, state: State) -> str:
    if isinstance(scene, Cap | Stem):
        return "cap" if isinstance(scene, Cap) else "stem"
    in_cap = state.y > 0 or state.wall in ("arc", "base") or (state.y == 0 and state.vy > 0)
    return "cap" if in_cap else "stem"


def _gaps(scene: Scene, part: str) -> dict[Any, Gap]:
    """Return the wall functions of a part of the table, positive inside."""
    law = {name: _law(scene, name) for name in laws(scene)}
    if part == "cap":
        r = law["r"]
        return {"arc": lambda t, q: r(t) ** 2 - q[0] ** 2 - q[1] ** 2, "base": lambda _, q: float(q[1])}
    slope = law["slope"]
    top = "mouth" if isinstance(scene, Mushroom) else "base"
    return {
        "left": lambda t, q: half_width(fp, scene, t) + slope(t) * q[1] + q[0],
        "right": lambda t, q: half_width(fp, scene, t) + slope(t) * q[1] - q[0],
        "floor": lambda t, q: float(q[1]) + law["h"](t),
        top: lambda _, q: -float(q[1]),
    }


def _law(scene: Scene, name: str) -> Callable[[float], float]:
    of = laws(scene)[name]
    return lambda t: float(value(fp, of, t))


def _bounce(scene: Scene, wall: Wall, t: float, q: FloatArray) -> tuple[float, float]:
    """Reflect: v - 2 (v.n - u) n, with u = -receding the wall's velocity along its inward normal n."""
    x, y, vx, vy = map(float, q)
    table = table_at(fp, scene, t)
    n_x, n_y = table.normal(wall, x, y)
    push = 2 * (vx * n_x + vy * n_y + table.receding(wall, y))
    return vx - push * n_x, vy - push * n_y
