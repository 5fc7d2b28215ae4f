"""The fast stepper: one step, and the form of states and outcomes in the kernels."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence

import numpy as np

from fast.kernel import records, single
from fast.kernel.fates import FATES, Fate
from fast.kernel.records import FloatArray, IntArray, Particle
from fast.prepared import Prepared, prepare
from fast.units import LateTime, Units
from scene import (
    BadInput,
    Collision,
    Horizon,
    InvalidState,
    Outcome,
    Rejected,
    Scene,
    State,
    Undecided,
    Wall,
    check_scene,
)
from scene.geometry import placed, rounded
from scene.states import check_numbers

WALL_NAMES: dict[int, Wall] = {
    int(records.ARC): "arc",
    int(records.BASE): "base",
    int(records.LEFT): "left",
    int(records.RIGHT): "right",
    int(records.FLOOR): "floor",
}
BEYOND: dict[Fate, Wall] = {FATES[Fate.BEYOND_ARC.code + code]: wall for code, wall in WALL_NAMES.items()}
WALL_CODES: dict[Wall | None, int] = {None: int(records.NO_WALL)} | {n: c for c, n in WALL_NAMES.items()}


def next_collision(scene: Scene, state: State, t_end: float) -> Outcome:
    """Find the first wall the particle meets after `state.t`, in binary64.

    Args:
        scene: table and laws of motion.
        state: position (x, y) [length], velocity (vx, vy) [length/time], wall being left or None.
        t_end: horizon [time], t_end >= state.t.

    Returns:
        Collision; Horizon; Undefined; Undecided if rounding does not decide, if the time is too late, or if
        binary64 cannot hold the answer; Rejected for a state outside this table, for a bad `state` or
        `t_end` (wrong type, nan, infinity, t_end < state.t), and for laws too large or too fast for
        binary64. A time is too late if k |t| reaches some 3e7 periods, at harmonic k.

    Raises:
        BadInput: `scene` is not a scene. Other bad input is Rejected.

    Source: Gelfreich, Rom-Kedar, Turaev (2014), sec. 3.1.
    """
    check_scene(scene)
    try:
        if not is_plain(scene, state, t_end):
            state, t_end = check_numbers(scene, state, t_end), float(t_end)
        prepared = prepare(scene)
        t, x, y, vx, vy, wall = state.t, state.x, state.y, state.vx, state.vy, WALL_CODES[state.wall]
        ask, step_at = single.asking()
        code, dt, t, x, y, vx, vy = ask(step_at, prepared.packed, t, x, y, vx, vy, wall, t_end)
        if code == records.BAD_QUESTION:  # by checks in compiled code: those that follow say why
            start_at(prepared, state, t_end)[1].horizon(t_end)
    except LateTime as error:
        return Undecided(str(error))
    except BadInput as error:
        return Rejected(str(error))
    if code in WALL_NAMES:
        return Collision(WALL_NAMES[code], dt, t, x, y, vx, vy)
    return end_of_path(code, scene, state, 0, t_end, (x, y, vx, vy))


def is_plain(scene: Scene, state: State, t_end: float) -> bool:
    """Tell whether the types of a question are those of most: State, floats, a wall of the scene."""
    return (
        type(state) is State
        and type(state.t) is type(state.x) is type(state.y) is type(state.vx) is type(state.vy) is float
        and type(t_end) is float
        and (state.wall is None or (isinstance(state.wall, str) and state.wall in scene.walls))
    )


def start_at(prepared: Prepared, state: State, t_end: float = sys.float_info.max) -> tuple[Particle, Units]:
    """Return a state in the kernel's units; refuse what this stepper cannot hold, naming field and bound."""
    return fitted_start(prepared, check_numbers(prepared.given, state, t_end))


def fitted_start(prepared: Prepared, state: State) -> tuple[Particle, Units]:
    """Return a state that has been checked, in the kernel's units, and these.

    Raises:
        BadInput: scene or state do not fit, or the state is not on the wall that it names.
    """
    units = prepared.units(state)
    t, x, y, vx, vy = units.numbers(state)
    particle = Particle(t, 0.0, x, y, vx, vy, WALL_CODES[state.wall])
    if state.wall is not None:
        share = single.share_off_wall(prepared.compiled, particle)
        if share:
            away = f"{share:.3g} of that wall's size"
            raise InvalidState(f"state.wall = {state.wall!r}, but the state is {away} away from that wall")
    return particle, units


def as_arrays(starts: Sequence[Particle]) -> tuple[FloatArray, IntArray]:
    """Return N states as the kernels take them: (N, 6) t, its low part, x, y, vx, vy; (N,) codes of walls."""
    rows = np.array([start[:6] for start in starts]).reshape(-1, 6)
    return rows, np.array([start.wall for start in starts], dtype=np.int64)


def end_of_path(
    code: int, scene: Scene, state: State, n: int, t_end: float, place: Iterable[float]
) -> Outcome:
    """Return what a code other than a wall's stands for, n collisions after a state: for HORIZON a place.

    A state is refused before the first of them only: later, what looks like one beyond a wall is rounding.
    """
    if code == records.HORIZON:
        return Horizon(t_end, *map(float, place))
    fate = FATES[code]
    if fate is Fate.NEAR_START and not n:
        wall = rounded(scene, state.t).nearest_wall(state.x, state.y, but=state.wall)
        return Undecided(placed(scene, state, wall, "within rounding of"))
    since = f"{n} collisions after state.t = {state.t!r}" if n else f"state.t = {state.t!r}"
    if fate is Fate.TOO_LATE:
        return Undecided(f"{since}: {fate.value}")
    if fate.outcome is not Rejected:
        answer: Outcome = fate.outcome(fate.value)
        return answer
    if n:
        return Undecided(f"{since}: rounding puts the particle beyond a wall")
    if fate in BEYOND:
        return Rejected(placed(scene, state, BEYOND[fate], "beyond"))
    return Rejected(fate.value)
