"""The fast stepper's face: one step, and a trajectory of steps, on scenes and states."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from fast.compiled import Compiled, FloatArray
from fast.given import MAX_STEPS, given_end, given_state
from fast.kernel import careful, codes, entries
from fast.units import Units, fit
from scene import (
    Collision,
    Horizon,
    InvalidState,
    Outcome,
    Rejected,
    Scene,
    State,
    Undecided,
    Undefined,
    Wall,
)
from scene.refusal import BadInput, check_count, check_number, check_scene
from scene.states import ON_WALL, check_numbers

WALL_NAMES: dict[int, Wall] = {
    int(codes.ARC): "arc",
    int(codes.BASE): "base",
    int(codes.LEFT): "left",
    int(codes.RIGHT): "right",
    int(codes.FLOOR): "floor",
}
WALL_CODES: dict[Wall | None, int] = {None: int(codes.NO_WALL)} | {n: c for c, n in WALL_NAMES.items()}
REASONS: dict[int, Outcome] = {
    int(codes.SLIDING): Undefined("sliding"),
    int(codes.MOUTH_EDGE): Undefined("mouth-edge"),
    int(codes.ON_CORNER): Undefined("corner"),
    int(codes.TOO_MANY): Undecided(f"no hit within {careful.MAX_PARABOLAS} sub-intervals"),
    int(codes.TANGENT): Undecided("f and f' vanish together within rounding"),
    int(codes.CORNER): Undecided("two walls are hit together within rounding"),
    int(codes.EDGE): Undecided("the mouth's edge is hit within rounding"),
    int(codes.AT_END): Undecided("a wall is hit at the horizon within rounding"),
    int(codes.START): Undecided("the state is on another wall within rounding"),
    int(codes.APPROACHING): Rejected("state.wall: the particle starts on a wall and moves into it"),
}


def next_collision(scene: Scene, state: State, t_end: float) -> Outcome:
    """Find the first wall the particle meets after `state.t`, in binary64.

    Args:
        scene: table and laws of motion.
        state: position (x, y) [length], velocity (vx, vy) [length/time], wall being left or None.
        t_end: horizon [time], t_end >= state.t.

    Returns:
        Collision, Horizon, Undefined, Undecided where rounding leaves it open, or Rejected for
        a state that is none of this table, for a `state` or `t_end` that is none at all (a wrong type,
        nan, infinity, t_end < state.t), and for laws too large or too fast for binary64.

    Raises:
        BadInput: `scene` is no scene; all else that is bad is Rejected.

    Source: Gelfreich, Rom-Kedar, Turaev (2014), sec. 3.1.
    """
    check_scene(scene)
    try:
        t_end = t_end if type(t_end) is float else check_number("t_end", t_end)
        state = given_state(scene, state)
        check_numbers(scene, state, t_end)
        start = fitted_start(scene, state)
        p = start.row()
        limit = start.units.horizon(t_end) - start.state.t
        code, dt = entries.single_step(*start.compiled, p, WALL_CODES[state.wall], limit)
        if code in WALL_NAMES:
            numbers = start.units.steps(np.array([dt, *np.delete(p, 1)]))
            return Collision(WALL_NAMES[code], *numbers.tolist())
        if code == codes.HORIZON:
            return Horizon(t_end, *start.units.places(p[2:]).tolist())
    except BadInput as error:
        return Rejected(str(error))
    return trouble(code, state, WALL_NAMES.get(int(dt)) if code == codes.OUTSIDE else None)


class Trajectory(NamedTuple):
    """Successive collisions, and why they ended.

    Attributes:
        walls: (n,) names of the walls hit.
        steps: (n, 6) dt, t, x, y, vx, vy after each collision.
        outcome: None when all collisions asked for were found, else what came instead.
    """

    walls: list[Wall]
    steps: FloatArray
    outcome: Outcome | None


def trajectory(scene: Scene, state: State, n_collisions: int, t_end: float = np.inf) -> Trajectory:
    """Follow a particle through `n_collisions` collisions, time carried as a compensated pair.

    Args:
        scene: table and laws of motion.
        state: the start, as for `next_collision`.
        n_collisions: how many collisions to follow, 0 to 10^7.
        t_end: horizon [time], >= state.t; infinity for none.

    Returns:
        The collisions. Where t_end is infinite and nothing is met any more (a particle at rest that no wall
        sweeps) the outcome is a Horizon at t = infinity with the place where it rests.

    Raises:
        BadInput: naming field, value and bound, for anything that is not as above. That a state is outside
            the table, or moves into the wall that it leaves, the first step finds: the outcome is Rejected.
    """
    check_scene(scene)
    t_end = given_end(t_end)
    start = check_state(scene, state, None if t_end == np.inf else t_end)
    n_collisions = check_count("n_collisions", n_collisions, 0, MAX_STEPS)
    steps: FloatArray = np.empty((n_collisions, 6))
    met: npt.NDArray[np.int64] = np.empty(n_collisions, dtype=np.int64)
    p, limit = start.row(), start.units.horizon(t_end)
    n, code = entries.trajectory(*start.compiled, p, WALL_CODES[state.wall], limit, steps, met)
    steps = start.units.steps(steps[:n])
    walls = [WALL_NAMES[int(c)] for c in met[:n]]
    outcome: Outcome | None = None
    if n < n_collisions:
        # Without a horizon only what rests is never met, and it rests where it was: there is no v * infinity.
        last = steps[n - 1, 2:] if n else np.array([state.x, state.y, state.vx, state.vy])
        is_horizon = code == codes.HORIZON
        if is_horizon and np.isfinite(t_end):
            last = start.units.places(p[2:])
        outcome = Horizon(t_end, *(float(v) for v in last)) if is_horizon else trouble(code, state)
    return Trajectory(walls, steps, outcome)


class Start(NamedTuple):
    """A state in the kernel's units, with what leads there and back.

    Attributes:
        state: in the kernel's units.
        units: those.
        compiled: the scene's numbers in them.
    """

    state: State
    units: Units
    compiled: Compiled

    def row(self) -> FloatArray:
        """Return the state as the kernels take it: t, its low part, x, y, vx, vy."""
        s = self.state
        return np.array([s.t, 0.0, s.x, s.y, s.vx, s.vy])


def check_state(scene: Scene, state: State, t_end: float | None = None) -> Start:
    """Return a state in the kernel's units; refuse what this stepper cannot hold, naming field and bound."""
    state = given_state(scene, state)
    check_numbers(scene, state, state.t if t_end is None else t_end)
    return fitted_start(scene, state)


def fitted_start(scene: Scene, state: State) -> Start:
    """Return a state that has been checked, in the kernel's units.

    Raises:
        BadInput: scene or state do not fit, or the state is not on the wall that it names.
    """
    fitted = fit(scene)
    units = fitted.units(state)
    inner = units.state(state)
    if state.wall is not None:
        gap, size = wall_gap(fitted.compiled, inner)
        if abs(gap) > ON_WALL * size:
            away = f"{gap / size:.3g} of that wall's distance from the origin"
            raise InvalidState(f"state.wall = {state.wall!r}, but the state is {away} away from that wall")
    return Start(inner, units, fitted.compiled)


def as_arrays(starts: Sequence[Start]) -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """Return N states as the kernels take them: (N, 6) t, its low part, x, y, vx, vy; (N,) codes of walls."""
    rows = np.array([start.row() for start in starts]).reshape(-1, 6)
    return rows, np.array([WALL_CODES[start.state.wall] for start in starts], dtype=np.int64)


def wall_gap(compiled: Compiled, state: State) -> tuple[float, float]:
    """Return how far a state is inside the wall it claims to leave, and that wall's distance from 0, now.

    Today's distance is the measure, not the largest of all time: a small cap is not allowed a large one's
    slack. A time whose phase is lost is left to the step, which refuses it.
    """
    p = np.array([state.t, 0.0, state.x, state.y, state.vx, state.vy])
    is_known, r, w, h, f = entries.wall_gap(*compiled, p, WALL_CODES[state.wall])
    if not is_known:
        return 0.0, 1.0
    if compiled.is_relative:
        w *= r
    if state.wall == "base":
        return state.y, max(r, w)
    if state.wall == "arc":
        return float(f) / (2.0 * r), r
    return float(f), h if state.wall == "floor" else w


def trouble(code: int, state: State, wall: Wall | None = None) -> Outcome:
    """Return the outcome that a code stands for, other than a wall's and HORIZON; `wall`: the one crossed."""
    if code == codes.FAR_TIME:
        return Rejected(f"state.t = {state.t!r} is more than 2^27 quarter periods from 0: its phase is lost")
    if code == codes.OUTSIDE:
        where = f"beyond wall {wall}" if wall else "outside the table"
        return Rejected(f"state (x, y) = ({state.x!r}, {state.y!r}) at t = {state.t!r} is {where}")
    return REASONS[code]
